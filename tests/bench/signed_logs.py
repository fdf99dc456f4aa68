"""Drawn logs of heaters with a cooler: does the fit hold the truth in its intervals, or say that it cannot?

    python -m tests.bench.signed_logs [COUNT] [--first SEED] [--together] [--verbose]

The power is open-loop steps or a PI controller's output of -100...100 %, in one column or in two. The cooler acts as
negative power of another gain, with a dead time of its own in some logs, or multiplies the loss. With --together, two
logs of each are fitted as one heater. Integrated here, by Euler's method, and written as CSV: shares nothing with the
reader or the fit.
"""

from __future__ import annotations

import argparse
import random
import sys
from collections import Counter
from typing import NamedTuple

from heatertune.errors import HeatertuneError
from heatertune.log import read_log
from heatertune.model.findings import KINDS
from heatertune.model.fit import fit, fit_together
from heatertune.model.model_values import FittedModel

HELD, NEAR, OPEN, REFUSED, WRONG = "held", "near", "not proven", "refused", "WRONG HEATER"
CLASSES = (HELD, NEAR, OPEN, REFUSED, WRONG)
STEP_S = 0.5
_WITHIN = 0.1  # of the truth


class Truth(NamedTuple):
    """What a log was made with [°C/%, s]."""

    gain: float
    time_constant_s: float
    second_s: float
    dead_time_s: float
    cooling_gain: float
    cooler_later_s: float
    multiplies: bool
    closed_loop: bool


def drawn(seed: int, record: int = 0) -> tuple[Truth, bytes]:
    """Draw a heater with a cooler, and log it, another time for another record."""
    chance = random.Random(f"signed-{seed}")
    lag = chance.uniform(60, 500)
    truth = Truth(
        gain=chance.uniform(0.3, 1.4), time_constant_s=lag, second_s=lag * chance.choice((0, 0, 0, chance.uniform(0.05, 0.25))),
        dead_time_s=chance.uniform(2, 25), cooling_gain=chance.uniform(0.15, 1.5), cooler_later_s=chance.choice((0, 0, 0, 0, 8)),
        multiplies=chance.random() < 0.15, closed_loop=chance.random() < 0.3)
    if truth.multiplies:
        truth = truth._replace(cooler_later_s=0.0, second_s=0.0)
    chance = random.Random(f"signed-{seed}-{record}") if record else chance
    noise, every, room = chance.choice((0.02, 0.05, 0.1, 0.2)), chance.choice((1, 2, 5)), chance.uniform(15, 26)
    rows = _logged(truth, chance, noise, every, room)
    if chance.random() < 0.5:
        cells = ["time [s],Temp [degC],Heating/cooling output [%]", *(f"{t:g},{y:.2f},{u:.1f}" for t, y, u in rows)]
    else:
        cells = ["time [s],Temp [degC],OutputHeat [%],OutputCool [%]", *(
            f"{t:g},{y:.2f},{max(u, 0.0):.1f},{max(-u, 0.0):.1f}" for t, y, u in rows)]
    return truth, ("\n".join(cells) + "\n").encode()


def _logged(truth: Truth, chance: random.Random, noise: float, every: int, room: float) -> list[tuple[float, float, float]]:
    """Integrate the heater, and return its rows: time [s], reading [°C], power [%]."""
    hold = 2.5 * truth.time_constant_s + 5.0 * truth.dead_time_s
    least = -60.0 if truth.gain * truth.cooling_gain * 60.0 < 70.0 else -70.0 / truth.gain / truth.cooling_gain
    levels = [chance.uniform(30, 80), chance.uniform(least, 0.3 * least), chance.uniform(10, 50), chance.uniform(least, 0.2 * least)]
    chance.shuffle(levels)
    levels = [0.0, *levels, 0.0]
    begins = [0.0, 60.0]
    for _ in levels[2:]:
        begins.append(begins[-1] + hold * chance.uniform(0.6, 1.3))
    end = begins[-1] + 0.7 * hold
    targets = [room, room + 0.5 * truth.gain * 60.0, room + 8.0, room + 0.3 * truth.gain * 60.0, room - 2.0, room + 5.0]
    controller_gain = 0.4 * truth.time_constant_s / (truth.gain * (truth.dead_time_s + truth.second_s + 5.0))
    x = y = room
    total, power, sent, rows = 0.0, 0.0, [0.0] * (int((truth.dead_time_s + 10.0) / STEP_S) + 2), []
    for k in range(int(end / STEP_S)):
        t = k * STEP_S
        place = sum(begin <= t for begin in begins) - 1
        reading = y + chance.gauss(0.0, noise)
        if not truth.closed_loop:
            power = round(levels[place], 1)
        elif k % 4 == 0:
            error = targets[place] - reading
            wanted = controller_gain * error + total
            power = round(min(max(wanted, -100.0), 100.0), 1)
            total += 0.0 if power != round(wanted, 1) else controller_gain * error * 2.0 / max(truth.time_constant_s, 30.0)
        sent.append(power)
        if t % every == 0:
            rows.append((t, reading, power))
        heat = sent[-1 - int(truth.dead_time_s / STEP_S)]
        cool = sent[-1 - int((truth.dead_time_s + truth.cooler_later_s) / STEP_S)]
        flow = truth.gain * max(heat, 0.0)
        loss = x - room
        if truth.multiplies:
            loss *= 1.0 + truth.cooling_gain * max(-cool, 0.0) / 20.0
        else:
            flow -= truth.gain * truth.cooling_gain * max(-cool, 0.0)
        x += STEP_S * (flow - loss) / truth.time_constant_s
        y = y + STEP_S * (x - y) / truth.second_s if truth.second_s > STEP_S else x
    return rows


def judge(truth: Truth, *contents: bytes) -> tuple[str, str]:
    """Return what became of a log, or of several together, and the figures."""
    try:
        logs = [read_log(f"drawn{number}.csv", content=content) for number, content in enumerate(contents)]
        fitted = fit(logs[0]) if len(logs) == 1 else fit_together(logs)
    except HeatertuneError as problem:
        return REFUSED, str(problem)
    names = {finding.name for finding in fitted.findings}
    cooling = fitted.cooling
    low, high = (0.0, 0.0) if cooling is None else cooling.cooling_gain_ci95
    said = (f"gain {fitted.model.gain_degC_per_pct:.3g}, lag {fitted.model.time_constant_s:.3g}, dead {fitted.model.dead_time_s:.3g}, "
            f"cooling {low:.3g}…{high:.3g}; {sorted(names)}; {truth}")
    if any(KINDS[name].effect == "blocks" for name in names):
        return OPEN, said
    if truth.multiplies:
        cools = cooling is not None and bool(cooling.doubts)
    else:
        slack = _WITHIN * truth.cooling_gain
        cools = cooling is not None and low - slack <= truth.cooling_gain <= high + slack
    if not cools or not _has_heater(fitted, truth):
        return WRONG, said
    exact = truth.multiplies or low <= truth.cooling_gain <= high
    return HELD if exact and _holds(fitted, truth) else NEAR, said


def _holds(fitted: FittedModel, truth: Truth) -> bool:
    """Return whether the intervals hold the heater; of two lags only the gain, and the model by the half rule near it."""
    values = {"gain_degC_per_pct": truth.gain}
    if not truth.second_s:
        values |= {"time_constant_s": truth.time_constant_s, "dead_time_s": truth.dead_time_s}
    for name, value in values.items():
        interval = fitted.ci95[name]
        if interval is not None and not (interval.low or 0.0) <= value <= (value if interval.high is None else interval.high):
            return False
    return True


def _has_heater(fitted: FittedModel, truth: Truth) -> bool:
    """Return whether a plausible heater is the true one within 10 %, its lags and dead time by the half rule."""
    for model in fitted.plants:
        own = (model.lags_s[0], sum(model.lags_s[1:]), model.dead_time_s)
        lag, late = own[0] + own[1] / 2.0, own[1] / 2.0 + own[2]
        true_lag, true_late = truth.time_constant_s + truth.second_s / 2.0, truth.second_s / 2.0 + truth.dead_time_s
        if (abs(model.gain_degC_per_pct - truth.gain) <= _WITHIN * truth.gain and abs(lag - true_lag) <= _WITHIN * true_lag
                and abs(late - true_late) <= max(_WITHIN * true_late, 5.0, 0.05 * true_lag)):
            return True
    return False


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", nargs="?", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--together", action="store_true")
    parser.add_argument("--verbose", action="store_true")
    chosen = parser.parse_args()
    counts: Counter[str] = Counter()
    for seed in range(chosen.first, chosen.first + chosen.count):
        truth, first = drawn(seed)
        outcome, said = judge(truth, first, *([drawn(seed, 1)[1]] if chosen.together else []))
        counts[outcome] += 1
        if chosen.verbose or outcome == WRONG:
            print(seed, outcome, said, flush=True)
    print(", ".join(f"{counts[outcome]} {outcome}" for outcome in CLASSES))
    sys.exit(counts[WRONG] > 0)
