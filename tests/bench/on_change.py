"""Logs thinned to their changes: the heater they give, against the one that wrote them.

A heater of one or two lags is simulated here by Euler's rule in steps of 0.1 s, read at an interval, and written as
loggers write that report by exception; nothing is shared with the program but the law of the heater. By hand:

    python -m tests.bench.on_change 40
"""

from __future__ import annotations

import datetime as dt
import io
import random
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from heatertune.log import read_log
from heatertune.model.fit import fit
from heatertune.model.model_values import FittedModel

STEP_S = 0.1
LATE = 0.3  # intervals by which `long_late` stamps a reading late, at most
BEGIN = dt.datetime(2026, 3, 9, 20, 0, 0)


@dataclass(frozen=True, kw_only=True)
class Case:
    """A heater, how it was driven, and how it was read.

    Attributes:
        gain, time_constant_s, second_s, dead_time_s, ambient_degC: of the heater [°C/%, s, s, s, °C].
        plan: instants and powers [s, %].
        end_s: of the log [s].
        poll_s: between two readings [s].
        step_degC: by which a reading has to move before it is written [°C].
        noise_degC: of a reading, standard deviation [°C].
    """

    gain: float
    time_constant_s: float
    second_s: float
    dead_time_s: float
    ambient_degC: float
    plan: tuple[tuple[float, float], ...]
    end_s: float
    poll_s: float
    step_degC: float
    noise_degC: float = 0.0

    def power(self, instant_s: float) -> float:
        return [power for at, power in self.plan if at <= instant_s][-1]


def drawn(rng: random.Random) -> Case:
    """Return a case: a bench heater or an oven, a step up and one down, read at an interval."""
    lag = rng.choice([60.0, 200.0, 600.0, 1500.0]) * rng.uniform(0.8, 1.25)
    second = rng.choice([0.0, 0.0, 0.1]) * lag
    dead = lag * rng.uniform(0.04, 0.25)
    poll = max(1.0, round(lag * rng.uniform(0.01, 0.05)))
    high, low = rng.uniform(40.0, 90.0), rng.uniform(5.0, 30.0)
    first = round(rng.uniform(0.2, 0.4) * lag) + rng.choice([0.0, 0.3, 0.7]) * poll
    return Case(
        gain=rng.uniform(0.4, 2.0), time_constant_s=lag, second_s=second, dead_time_s=dead,
        ambient_degC=round(rng.uniform(17.0, 28.0), 1), plan=((0.0, 0.0), (first, round(high)), (first + 4.5 * lag, round(low))),
        end_s=first + 9.0 * lag, poll_s=poll, step_degC=rng.choice([0.1, 0.1, 0.25, 0.5]))


def simulated(case: Case) -> tuple[np.ndarray, np.ndarray]:
    """Return instants of the readings and the true temperatures there [s, °C]."""
    step = min(STEP_S, case.time_constant_s / 500.0) if case.time_constant_s < 300.0 else 0.5
    per = max(1, round(case.poll_s / step))
    step = case.poll_s / per
    slow = fast = case.ambient_degC
    times, values = [], []
    for k in range(int(case.end_s / step)):
        now = k * step
        if k % per == 0:
            times.append(now)
            values.append(fast)
        late = now - case.dead_time_s
        power = case.power(late) if late >= 0.0 else case.plan[0][1]
        slow += step * (case.ambient_degC + case.gain * power - slow) / case.time_constant_s
        fast = slow if not case.second_s else fast + step * (slow - fast) / case.second_s
    return np.array(times), np.array(values)


def readings(case: Case, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return instants and readings in whole steps of the sensor [s, °C]."""
    times, values = simulated(case)
    noisy = values + case.noise_degC * np.random.default_rng(seed).normal(size=len(values))
    return times, np.round(np.round(noisy / case.step_degC) * case.step_degC, 3)


def _stamp(at_s: float) -> str:
    return f"{BEGIN + dt.timedelta(seconds=float(at_s)):%Y-%m-%dT%H:%M:%S.%f}"[:-3] + "Z"


def _long(events: Sequence[tuple[float, str, str]]) -> str:
    rows = [f"{name},{value},{_stamp(at)}" for at, name, value in sorted(events, key=lambda event: event[0])]
    return "\n".join(["entity_id,state,last_changed", *rows]) + "\n"


def _powers(case: Case) -> list[tuple[float, str, str]]:
    return [(at, "number.heater_power", f"{power:g}") for at, power in case.plan]


def _changed(times: np.ndarray, values: np.ndarray, least: float, beat_s: float = np.inf) -> list[int]:
    """Return which readings are written: those that moved by at least so much from the last written, and a beat."""
    kept = [0]
    for k in range(1, len(values)):
        if abs(values[k] - values[kept[-1]]) >= least or times[k] - times[kept[-1]] >= beat_s:
            kept.append(k)
    return kept


def long_rounded(case: Case, seed: int) -> str:
    """Home automation: a row where a rounded reading differs from the last."""
    times, values = readings(case, seed)
    return _long([*_powers(case), *((times[k], "sensor.oven_temperature", f"{values[k]:g}") for k in _changed(times, values, 1e-9))])


def long_beat(case: Case, seed: int) -> str:
    """The same with a row every 20 readings whatever it reads."""
    times, values = readings(case, seed)
    kept = _changed(times, values, 1e-9, 20.0 * case.poll_s)
    return _long([*_powers(case), *((times[k], "sensor.oven_temperature", f"{values[k]:g}") for k in kept)])


def long_noisy(case: Case, seed: int) -> str:
    """The same with a sensor whose last digit flickers."""
    times, values = readings(Case(**{**case.__dict__, "noise_degC": 0.3 * case.step_degC}), seed)
    return _long([*_powers(case), *((times[k], "sensor.oven_temperature", f"{values[k]:g}") for k in _changed(times, values, 1e-9))])


def long_deadband(case: Case, seed: int) -> str:
    """A historian: a fine reading is written once it has moved by a deadband."""
    times, values = simulated(case)
    values = values + 0.02 * case.step_degC * np.random.default_rng(seed).normal(size=len(values))
    kept = _changed(times, values, case.step_degC)
    return _long([*_powers(case), *((times[k], "sensor.oven_temperature", f"{values[k]:.4f}") for k in kept)])


def long_polled(case: Case, seed: int) -> str:
    """A reading at every interval, the power at its own instants between them."""
    times, values = readings(case, seed)
    return _long([*_powers(case), *((at, "sensor.oven_temperature", f"{value:g}") for at, value in zip(times, values, strict=True))])


def long_late(case: Case, seed: int) -> str:
    """Readings on change that arrive up to a third of the interval late."""
    times, values = readings(case, seed)
    rng = random.Random(seed)
    return _long([*_powers(case), *((times[k] + rng.uniform(0.0, LATE) * case.poll_s, "sensor.oven_temperature", f"{values[k]:g}")
                                    for k in _changed(times, values, 1e-9))])


def _events(case: Case, seed: int) -> list[tuple[float, float | None, float | None]]:
    times, values = readings(case, seed)
    events = {float(times[k]): [float(values[k]), None] for k in _changed(times, values, 1e-9)}
    for at, power in case.plan:
        events.setdefault(at, [None, None])[1] = power
    return [(at, *pair) for at, pair in sorted(events.items())]


def wide_filled(case: Case, seed: int) -> str:
    """One table, a row where anything changes, every cell filled."""
    rows, temperature, power = ["time_s,temp_C,power_pct"], None, None
    for at, y, u in _events(case, seed):
        temperature, power = temperature if y is None else y, power if u is None else u
        rows.append(f"{at:.3f},{temperature:g},{power:g}")
    return "\n".join(rows) + "\n"


def wide_blank(case: Case, seed: int) -> str:
    """The same, with a cell only where its value changes."""
    rows = [f"{at:.3f},{'' if y is None else f'{y:g}'},{'' if u is None else f'{u:g}'}" for at, y, u in _events(case, seed)]
    return "\n".join(["time_s,temp_C,power_pct", *rows]) + "\n"


def wide_readings(case: Case, seed: int) -> str:
    """One table, a row where the reading changes, with the power of that instant: when it changed is not known."""
    times, values = readings(case, seed)
    kept = _changed(times, values, 1e-9)
    return "\n".join(["time_s,temp_C,power_pct", *(f"{times[k]:.3f},{values[k]:g},{case.power(times[k]):g}" for k in kept)]) + "\n"


def _loop(case: Case, seed: int) -> tuple[list[tuple[float, float]], list[tuple[float, float]]]:
    """Return readings and powers of a PI controller that acts in the middle between two readings, each with its instant."""
    rng, per = np.random.default_rng(seed), 20
    step, slow, fast, integral = case.poll_s / per, case.ambient_degC, case.ambient_degC, 0.0
    late = [0.0] * (round(case.dead_time_s / step) + 1)
    readings_, powers, power, high = [], [(0.0, 0.0)], 0.0, case.plan[1][1]
    for k in range(int(case.end_s / step)):
        now = k * step
        if k % per == 0:
            readings_.append((now, round(round((fast + case.noise_degC * rng.normal()) / case.step_degC) * case.step_degC, 3)))
        if k % per == per // 2 and now > case.plan[1][0]:
            target = case.ambient_degC + case.gain * (0.6 * high if now < case.plan[2][0] else 0.35 * high)
            error, gain = target - fast, 0.4 * case.time_constant_s / (case.gain * case.dead_time_s)
            integral = min(max(integral + gain * error * case.poll_s / case.time_constant_s, 0.0), 100.0)
            power = round(min(max(gain * error + integral, 0.0), 100.0), 1)
            if power != powers[-1][1]:
                powers.append((now, power))
        late.append(power)
        slow += step * (case.ambient_degC + case.gain * late.pop(0) - slow) / case.time_constant_s
        fast = slow if not case.second_s else fast + step * (slow - fast) / case.second_s
    return readings_, powers


def long_loop(case: Case, seed: int) -> str:
    """A closed loop, its readings and powers on change, each at its own instants."""
    read, powers = _loop(case, seed)
    kept = _changed(np.array([at for at, _ in read]), np.array([value for _, value in read]), 1e-9)
    return _long([*((at, "number.heater_power", f"{power:g}") for at, power in powers),
                  *((read[k][0], "sensor.oven_temperature", f"{read[k][1]:g}") for k in kept)])


def long_polled_loop(case: Case, seed: int) -> str:
    """A closed loop, a reading at every interval, the power between two of them."""
    read, powers = _loop(case, seed)
    return _long([*((at, "number.heater_power", f"{power:g}") for at, power in powers),
                  *((at, "sensor.oven_temperature", f"{value:g}") for at, value in read)])


def _thermostat(case: Case) -> tuple[list[tuple[float, float]], list[tuple[float, str]]]:
    """Return readings of a heater under a thermostat that acts in the middle between two readings, and its switchings."""
    per, slow, fast, on = 20, case.ambient_degC, case.ambient_degC, False
    step, target = case.poll_s / per, case.ambient_degC + 45.0 * case.gain
    late = [0.0] * (round(case.dead_time_s / step) + 1)
    read, switched = [], [(0.0, "off")]
    for k in range(int(case.end_s / step)):
        if k % per == 0:
            read.append((k * step, round(round(fast / case.step_degC) * case.step_degC, 3)))
        if k % per == per // 2 and k * step > case.plan[1][0] and on != (fast < target + (0.5 if on else -0.5)):
            on = not on
            switched.append((k * step, "on" if on else "off"))
        late.append(100.0 * on)
        slow += step * (case.ambient_degC + case.gain * late.pop(0) - slow) / case.time_constant_s
        fast = slow if not case.second_s else fast + step * (slow - fast) / case.second_s
    return read, switched


def long_thermostat(case: Case, seed: int) -> str:
    """A heater that a thermostat switches, its readings on change, its switchings at their own instants."""
    read, switched = _thermostat(case)
    kept = _changed(np.array([at for at, _ in read]), np.array([value for _, value in read]), 1e-9)
    return _long([*((at, "switch.heater", state) for at, state in switched),
                  *((read[k][0], "sensor.oven_temperature", f"{read[k][1]:g}") for k in kept)])


def long_polled_thermostat(case: Case, seed: int) -> str:
    """The same with a reading at every interval."""
    read, switched = _thermostat(case)
    return _long([*((at, "switch.heater", state) for at, state in switched),
                  *((at, "sensor.oven_temperature", f"{value:g}") for at, value in read)])


WRITERS: tuple[Callable[[Case, int], str], ...] = (
    long_rounded, long_beat, long_noisy, long_deadband, long_polled, long_late, wide_filled, wide_blank, wide_readings,
    long_loop, long_polled_loop, long_thermostat, long_polled_thermostat)


def missed(case: Case, fitted: FittedModel, late_s: float = 0.0) -> list[str]:
    """Return the numbers of a heater whose interval does not hold the truth, where it is one of one lag.

    Of two lags the interval has to hold the half rule's dead time within half the smaller lag. An open end holds all, and
    a power whose changes the log does not place, which blocks the verdict, lets the heater be what it may. Readings that are stamped late, which no log shows, make a dead time longer by as much.
    """
    if any(finding.name == "alias" for finding in fitted.findings):
        return []
    true = {"gain_degC_per_pct": case.gain, "time_constant_s": case.time_constant_s, "dead_time_s": case.dead_time_s}
    slack = {"gain_degC_per_pct": 0.03 * case.gain, "time_constant_s": 0.03 * case.time_constant_s + case.second_s,
             "dead_time_s": 0.1 * case.poll_s + case.second_s + late_s}
    out = []
    for name, value in true.items():
        interval = fitted.ci95[name]
        if interval is None:
            continue
        low, high = interval.low, interval.high
        if (low is not None and value < low - slack[name]) or (high is not None and value > high + slack[name]):
            out.append(f"{name} {value:.4g} not in {low}…{high}")
    return out


def judged(writer: Callable[[Case, int], str], case: Case, seed: int) -> tuple[list[str], FittedModel]:
    """Return what is missed of a case as a writer wrote it, and the fit."""
    fitted = fit(read_log(io.StringIO(writer(case, seed)), power_full_scale=100.0))
    return missed(case, fitted, LATE * case.poll_s if writer is long_late else 0.0), fitted


def main(count: int) -> None:
    rng, wrong, blocked, total = random.Random(1), 0, 0, 0
    for number in range(count):
        case, writer = drawn(rng), WRITERS[number % len(WRITERS)]
        try:
            out, fitted = judged(writer, case, number)
        except Exception as problem:
            print(number, writer.__name__, "refused:", problem)
            continue
        blocks = [finding.name for finding in fitted.findings if finding.kind.effect == "blocks"]
        total, wrong, blocked = total + 1, wrong + bool(out), blocked + bool(blocks)
        print(number, writer.__name__, f"L {case.dead_time_s:.4g} poll {case.poll_s:g} step {case.step_degC}",
              f"found {fitted.model.dead_time_s:.4g}", out, blocks, flush=True)
    print(f"{wrong} of {total} miss the truth, {blocked} are blocked")


if __name__ == "__main__":
    main(int(sys.argv[1]))
