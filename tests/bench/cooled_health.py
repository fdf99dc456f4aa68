"""Days of loops that heat and cool through `health`: what is wrong with each, and does it say which of the two drifted?

    python -m tests.bench.cooled_health [COUNT] [FIRST]

A rig of this file's own, of one lag with a dead time, split range PI, setpoints up and down and a load. Its heater and its
cooler each are as before, or have lost 45 % of their strength; or the loop swings.
"""

from __future__ import annotations

import sys
from collections import Counter
from dataclasses import dataclass

import numpy as np

from heatertune.errors import HeatertuneError
from heatertune.log.log_values import Log, LogSignal
from heatertune.loops.diagnosis import diagnose
from heatertune.loops.measures import LoopEntry
from heatertune.model.model_values import Fopdt, model_by_hand

KINDS = ("as before", "cooler lost", "heater lost", "swings")
#: what has to be said of each
RIGHT = {"as before": ("well",), "cooler lost": ("cooling gain",), "heater lost": ("gain",), "swings": ("swings",)}
_LOST = 0.55


@dataclass(frozen=True)
class Rig:
    """A heater and its cooler before the day [°C/%, s, s, °C, fraction]."""

    gain: float
    lag: float
    dead: float
    room: float
    cooling: float


def drawn(seed: int) -> Rig:
    """Return the rig of a seed."""
    rng = np.random.default_rng([77, seed])
    lag = float(np.exp(rng.uniform(np.log(100.0), np.log(600.0))))
    return Rig(float(np.exp(rng.uniform(np.log(0.4), np.log(1.5)))), lag, lag * float(rng.uniform(0.05, 0.15)),
               float(rng.uniform(18.0, 25.0)), float(rng.uniform(0.3, 1.2)))


def day(rig: Rig, kind: str, seed: int) -> Log:
    """Return the log of a day of 60 lags, read about every twentieth of one."""
    rng = np.random.default_rng([78, seed])
    gain = rig.gain * (_LOST if kind == "heater lost" else 1.0)
    cool = rig.gain * rig.cooling * (_LOST if kind == "cooler lost" else 1.0)
    interval = max(1.0, round(rig.lag / 20.0))
    per_row = max(10, round(interval / (rig.lag / 200.0)))
    fine = interval / per_row
    k = (2.6 if kind == "swings" else 0.45) * rig.lag / (rig.gain * (rig.dead + interval))
    tn = min(rig.lag, 6.0 * (rig.dead + interval))
    base = rig.room + rig.gain * 20.0
    targets = base + rig.gain * np.array([0.0, 15.0, -25.0, 5.0, -30.0, 20.0])
    late, x, part, rows = [gain * 20.0] * max(1, round(rig.dead / fine)), base, 20.0, []
    count = int(60.0 * rig.lag / interval)
    for row in range(count):
        target = float(np.round(targets[min(5, 6 * row // count)], 1))
        read = round((x + rng.normal(0.0, 0.03)) / 0.1) * 0.1
        wish = k * (target - read) + part
        out = min(max(wish, -100.0), 100.0)
        part += k * interval / tn * (target - read) if out == wish else 0.0
        heat, cold = round(max(out, 0.0), 1), round(max(-out, 0.0), 1)
        rows.append((row * interval, read, heat, cold, target))
        load = -8.0 * gain if 0.4 < row / count < 0.48 else 0.0
        for _ in range(per_row):
            late.append(gain * heat - cool * cold)
            x += fine / rig.lag * (rig.room + late.pop(0) + load - x)
    time, *columns = (np.array(column) for column in zip(*rows, strict=True))
    names = ("temperature", "power", "cooling", "setpoint")
    return Log(name=f"{kind}.csv", source="a rig", signals={
        name: LogSignal(values, time_s=time) for name, values in zip(names, columns, strict=True)})


def judged(rig: Rig, kind: str, seed: int) -> tuple[str, str]:
    """Return whether a day was judged right, and what was said of it."""
    before = model_by_hand(Fopdt(gain_degC_per_pct=rig.gain, time_constant_s=rig.lag, dead_time_s=rig.dead, ambient_degC=rig.room))
    try:
        told = diagnose(day(rig, kind, seed), LoopEntry(name=kind, file=""), before, rig.cooling)
    except HeatertuneError as problem:
        return "refused", str(problem)
    said = [told.cause.label, *(fault.message for fault in told.faults)]
    first = " ".join(said[:2])
    right = any(words in first for words in RIGHT[kind])
    if kind == "heater lost":
        right = right and "cooling gain" not in " ".join(said)
    return "right" if right else "wrong", "; ".join(said) + (f"; {told.why_not}" if told.why_not else "")


def main(count: int, first: int) -> int:
    """Print how the days were judged; return how many were judged wrongly."""
    tally, wrong = Counter[str](), 0
    for seed in range(first, first + count):
        for kind in KINDS:
            word, said = judged(drawn(seed), kind, seed)
            tally[f"{kind}: {word}"] += 1
            wrong += word == "wrong"
            if word != "right":
                print(f"  {seed} {kind}: {word}; {said[:300]}", flush=True)
    for key, number in sorted(tally.items()):
        print(f"{key} {number}")
    return wrong


if __name__ == "__main__":
    sys.exit(min(main(int([*sys.argv, 6][1]), int([*sys.argv, 0, 0][2])), 1))
