"""How near the fit comes to the truth, beside the two usual scripts: python tests/bench/identification.py --heaters 1000.

Random heaters × inputs × noise × sampling. The logs are made by superposing step answers, not by the fit's own
simulation. Rivals on the same data: the two-point method (28.3 % and 63.2 % of a step) and scipy's curve_fit around
odeint from reading to reading, with the power interpolated and a steady start, as course scripts have it.

    python tests/bench/identification.py --heaters 200 --pwm 2          switched by PWM of 0.1 to 2 log intervals
    python tests/bench/identification.py --heaters 200 --pwm 2 --told   the fit being told the period

The log then holds what the controller asks for. Each period begins with its pulse, whose length is what was asked as the
period began; its phase is random.
"""

import argparse
import time
import warnings
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.integrate import odeint
from scipy.optimize import OptimizeWarning, curve_fit
from scipy.signal import lfilter

from heatertune.errors import InputError
from heatertune.log.log_values import Log
from heatertune.model.fit import fit
from heatertune.model.model_values import Fopdt

INPUTS = ("step", "doublet", "levels", "pulse")
NOISES = ("white", "coloured", "8-bit")
SAMPLINGS = ("regular", "irregular", "with a gap")
PARAMETERS = ("gain_degC_per_pct", "time_constant_s", "dead_time_s")
METHODS = ("heatertune", "two points", "curve_fit + odeint")


@dataclass(frozen=True)
class Case:
    """One heater and its log."""

    plant: Fopdt
    log: Log
    kind: tuple[str, str, str]
    period_s: float = 0.0


@dataclass(frozen=True)
class Found:
    """What the methods made of it: method → (gain, time constant, dead time) and seconds, and who held the truth."""

    kind: tuple[str, str, str]
    truth: tuple[float, ...]
    values: dict[str, tuple[float, ...]]
    seconds: dict[str, float]
    held: tuple[bool, ...] | None
    refused: str = ""


def answer(plant, time_s, power_pct, start_degC, changed_s=None):
    """Return the temperature of a heater at the instants: the sum of its answers to each change of the held power.

    `changed_s`: since when each power is held, where not since the instants.
    """
    since_s = time_s if changed_s is None else changed_s
    lag, dead = plant.time_constant_s, plant.dead_time_s
    rise = np.full(len(time_s), plant.gain_degC_per_pct * power_pct[0])
    for i in np.flatnonzero(np.diff(power_pct)) + 1:
        since = np.clip(time_s - since_s[i] - dead, 0.0, None)
        rise += plant.gain_degC_per_pct * (power_pct[i] - power_pct[i - 1]) * -np.expm1(-since / lag)
    steady = plant.ambient_degC + plant.gain_degC_per_pct * power_pct[0]
    return plant.ambient_degC + rise + (start_degC - steady) * np.exp(-(time_s - time_s[0]) / lag)


def pulses(time_s, power_pct, period_s, begun_s):
    """Return what PWM makes of asked power, 0 or 100 %, and since when each is held; a period begins at begun_s."""
    begins = np.arange(begun_s, time_s[-1], period_s)
    asked = power_pct[np.maximum(np.searchsorted(time_s, begins, side="right") - 1, 0)]
    edges = np.column_stack([begins, begins + asked / 100.0 * period_s]).ravel()
    return np.array([power_pct[0], *np.tile([100.0, 0.0], len(begins))]), np.array([-np.inf, *edges])


def make(seed, pwm=None):
    """Return the case of a seed; the PWM period is drawn up to `pwm` intervals, None: the power is not switched."""
    rng = np.random.default_rng(seed)
    kind = (INPUTS[seed % 4], NOISES[seed // 4 % 3], SAMPLINGS[seed // 12 % 3])
    lag = float(np.exp(rng.uniform(np.log(30.0), np.log(600.0))))
    plant = Fopdt(
        gain_degC_per_pct=float(np.exp(rng.uniform(np.log(0.2), np.log(2.0)))), time_constant_s=lag,
        dead_time_s=lag * float(rng.uniform(0.03, 0.5)), ambient_degC=float(rng.uniform(15.0, 30.0)),
    )
    length, n = lag * float(rng.uniform(5.0, 9.0)), int(rng.integers(120, 360))
    instants = np.linspace(0.0, length, n)
    if kind[2] != "regular":
        instants[1:-1] += rng.uniform(-0.4, 0.4, n - 2) * length / n
    if kind[2] == "with a gap":
        gap = rng.uniform(0.3, 0.8) * length
        instants = instants[(instants < gap) | (instants > gap + 0.05 * length)]
    share = instants / length
    levels = rng.uniform(0.0, 100.0, 8)
    power = {
        "step": np.where(share < 0.1, 0.0, 60.0),
        "doublet": np.select([share < 0.1, share < 0.4, share < 0.7], [30.0, 70.0, 10.0], 30.0),
        "levels": levels[np.minimum((share * 8).astype(int), 7)],
        "pulse": np.where((share > 0.1) & (share < 0.3), 80.0, 0.0),
    }[kind[0]]
    steady = plant.ambient_degC + plant.gain_degC_per_pct * power[0]
    unsteady = rng.random() < 0.5
    start = steady + unsteady * rng.uniform(-0.2, 0.4) * 60.0 * plant.gain_degC_per_pct
    clean, period_s = answer(plant, instants, power, start), 0.0
    if pwm is not None:
        drawn = np.random.default_rng([seed, 1])  # of its own: heater, power and noise stay as they are without
        period_s = length / n * pwm * 20.0 ** -float(drawn.uniform())
        held, since = pulses(instants, power, period_s, -period_s * float(drawn.uniform()))
        clean = answer(plant, instants, held, start, since)
    deviation = float(rng.uniform(0.002, 0.02)) * float(np.ptp(clean))
    noisy = clean + noise(rng, kind[1], deviation, len(clean))
    if kind[1] == "8-bit":
        step = 1.2 * float(np.ptp(clean)) / 256.0
        noisy = np.round(noisy / step) * step
    log = Log(name=f"case {seed}", source="made", time_s=instants, temperature_degC=noisy, power_pct=power)
    return Case(plant=plant, log=log, kind=kind, period_s=period_s)


def noise(rng, kind, deviation, n):
    """Return white noise, or noise whose neighbours correlate by 0.8; n readings of one standard deviation."""
    if kind != "coloured":
        return rng.normal(0.0, deviation, n)
    return lfilter([0.6], [1.0, -0.8], rng.normal(0.0, deviation, n + 100))[100:]


def two_points(log):
    """Return gain, time constant, dead time of the first step's 28.3 % and 63.2 % points, None without one step."""
    moved = np.flatnonzero(np.diff(log.power_pct))
    if len(moved) != 1:
        return None
    begun = moved[0] + 1
    y, t = log.temperature_degC[begun:], log.time_s[begun:] - log.time_s[begun]
    start, end = float(np.mean(log.temperature_degC[:begun])), float(np.mean(y[-len(y) // 10 :]))
    share = (y - start) / (end - start)
    early, late = (float(t[np.argmax(share >= level)]) for level in (0.283, 0.632))
    lag = max(1.5 * (late - early), 1e-3)
    return (end - start) / float(np.ptp(log.power_pct)), lag, max(late - lag, 0.0)


def course_script(log):
    """Return gain, time constant, dead time of curve_fit around odeint, power interpolated, steady start."""
    t, u, y = log.time_s, log.power_pct, log.temperature_degC

    def slope(x, at, gain, lag, dead):
        return (gain * (np.interp(at - dead, t, u) - u[0]) - (x - y[0])) / lag

    def simulated(_, gain, lag, dead):
        x = np.empty(len(t))
        x[0] = y[0]
        for i in range(1, len(t)):
            x[i] = odeint(slope, x[i - 1], [t[i - 1], t[i]], args=(gain, lag, dead))[-1, 0]
        return x

    length = t[-1] - t[0]
    found, _ = curve_fit(
        simulated, t, y, p0=[np.ptp(y) / np.ptp(u), length / 6.0, length / 40.0],
        bounds=([1e-4, 1e-3, 0.0], [100.0, 10.0 * length, length / 2.0]), diff_step=1e-3, max_nfev=40,
    )
    return tuple(float(value) for value in found)


def run(seed, pwm=None, told=False):
    """Return what the methods make of one case; `told`: the fit knows the PWM period."""
    case = make(seed, pwm)
    truth = tuple(getattr(case.plant, name) for name in PARAMETERS)
    values, seconds = {}, {}
    begun = time.perf_counter()
    try:
        fitted = fit(case.log, log_pwm_period_s=case.period_s if told else 0.0)
    except InputError as refusal:
        return Found(case.kind, truth, {}, {}, None, str(refusal))
    seconds["heatertune"] = time.perf_counter() - begun
    values["heatertune"] = tuple(getattr(fitted.model, name) for name in PARAMETERS)
    rivals = (("two points", two_points), ("curve_fit + odeint", course_script)) if pwm is None else ()  # they know no PWM
    for method, work in rivals:
        begun = time.perf_counter()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # its ODEintWarning has moved
            warnings.simplefilter("ignore", OptimizeWarning)
            try:
                result = work(case.log)
            except RuntimeError:  # curve_fit gave up after its evaluations: that is a result too
                result = None
        if result is not None:
            values[method], seconds[method] = result, time.perf_counter() - begun
    return Found(case.kind, truth, values, seconds, tuple(map(_holds, (fitted.ci95[n] for n in PARAMETERS), truth)))


def _holds(found, truth):
    return (found.low is None or found.low <= truth) and (found.high is None or truth <= found.high)


def _errors(found, method):
    chosen = [f for f in found if method in f.values]
    return np.array([np.array(f.values[method]) / f.truth - 1.0 for f in chosen]).reshape(-1, 3)


def table(found):
    """Return the lines of the table: bias, error and coverage by kind of log, then the rivals."""
    answered = [f for f in found if f.held is not None]
    lines = [
        f"{len(found)} heaters, {len(found) - len(answered)} refused", "",
        "| logs | n | bias % k, T, L | median error % k, T, L | 95 % intervals that hold k, T, L (%) |",
        "| --- | --- | --- | --- | --- |",
    ]
    groups = [("all", answered)]
    for place, kinds in enumerate((INPUTS, NOISES, SAMPLINGS)):
        groups += [(kind, [f for f in answered if f.kind[place] == kind]) for kind in kinds]
    for name, group in groups:
        if group:
            errors = 100.0 * _errors(group, "heatertune")
            held = 100.0 * np.mean([f.held for f in group], axis=0)
            cells = [_row(np.median(errors, axis=0), "+.2f"), _row(np.median(np.abs(errors), axis=0), ".2f"), _row(held, ".1f")]
            lines.append(f"| {name} | {len(group)} | {' | '.join(cells)} |")
    lines += ["", "| method | logs answered | median error % k, T, L | 90th percentile % | against heatertune | time ratio |",
              "| --- | --- | --- | --- | --- | --- |"]
    for method in METHODS:
        group = [f for f in answered if method in f.values]
        if group:
            errors, own = (100.0 * np.abs(_errors(group, m)) for m in (method, "heatertune"))
            ratio = np.median(errors, axis=0) / np.median(own, axis=0)
            spent = np.median([f.seconds[method] / f.seconds["heatertune"] for f in group])
            cells = [_row(np.median(errors, axis=0), ".2f"), _row(np.percentile(errors, 90.0, axis=0), ".1f"), _row(ratio, ".1f")]
            lines.append(f"| {method} | {len(group)} | {' | '.join(cells)} | {spent:.3g} |")
    return lines


def _row(values, form):
    return ", ".join(f"{value:{form}}" for value in values)


def main(arguments=None):
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--heaters", type=int, default=1000, help="number of random heaters")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--pwm", type=float, help="longest PWM period, in intervals of the log")
    parser.add_argument("--told", action="store_true", help="the fit is told the PWM period")
    settings = parser.parse_args(arguments)
    one = partial(run, pwm=settings.pwm, told=settings.told)
    if settings.jobs == 1:
        found = [one(seed) for seed in range(settings.heaters)]
    else:
        with ProcessPoolExecutor(settings.jobs) as pool:
            found = list(pool.map(one, range(settings.heaters), chunksize=8))
    print("\n".join(table(found)))
    for refusal in [f.refused for f in found if f.refused][:5]:
        print(f"refused: {refusal}")


if __name__ == "__main__":
    main()
