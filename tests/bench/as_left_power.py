"""Traces of commissioned loops whose power is written in many ways: is the power reserve told right?

    python -m tests.bench.as_left_power [COUNT] [FIRST]

A PI of this file's own holds drawn heaters; what its power is worth is counted here. The same heater has to be no worse than
proven in whatever way its power is written, and one that is weaker by more than the stated tolerance has to be told.
"""

from __future__ import annotations

import sys
from collections import Counter
from typing import NamedTuple

import numpy as np

from heatertune import chain
from heatertune.codec import decode, plain
from heatertune.log.log_values import Log, LogSignal
from heatertune.model.model_values import Fopdt, model_by_hand
from heatertune.pid.design_values import PidDesign
from heatertune.proof.as_left import AsLeft, as_left
from heatertune.proof.proof_document import ProofView

WAYS = ("percent", "whole percent", "slow rows", "on change", "pulses on change", "fast pulses")


class Case(NamedTuple):
    """A heater with its loop [°C/%, s, s, °C, %/°C, s, s, °C]."""

    gain: float
    lag: float
    dead: float
    room: float
    k: float
    tn: float
    scan: float
    setpoint: float


def drawn(seed: int) -> Case:
    """Return the case of a seed; it rests at 25 to 75 % of its power."""
    rng = np.random.default_rng(seed)
    lag, gain = float(np.exp(rng.uniform(np.log(80.0), np.log(500.0)))), float(np.exp(rng.uniform(np.log(0.3), np.log(2.0))))
    dead, room = lag * float(rng.uniform(0.05, 0.12)), float(round(rng.uniform(15.0, 25.0), 1))
    setpoint = float(round(room + gain * rng.uniform(25.0, 75.0), 1))
    return Case(gain, lag, dead, room, 0.35 * lag / (gain * (2.0 * dead)), min(lag, 8.0 * dead), 2.0, setpoint)


def proven(case: Case):
    """Return the parameters of the loop, its heater and their proof."""
    fitted = model_by_hand(Fopdt(gain_degC_per_pct=case.gain, time_constant_s=case.lag, dead_time_s=case.dead, ambient_degC=case.room))
    design = PidDesign(gain_pct_per_degC=case.k, integral_time_s=case.tn, derivative_time_s=0.0, sample_time_s=case.scan, structure="pi",
                       method="by hand")
    proof = chain.prove(chain.encode(design, "fb41"), fitted, setpoint_degC=case.setpoint)
    return proof.words, fitted, decode(ProofView, plain(proof.to_document()), "proof.json")


def run(case: Case, *, weaker: float = 0.0, fine: float = 0.05):
    """Return instants, temperature, the power that is asked for and the pulses: Euler's steps, a held integral."""
    seconds = 60.0 + 14.0 * case.lag + 20.0 * case.dead
    n, per_scan, gain = round(seconds / fine), round(case.scan / fine), case.gain * (1.0 - weaker)
    late, reading, part, power, owed = [0.0] * max(1, round(case.dead / fine)), case.room, 0.0, 0.0, 0.0
    temperature, asked, pulses = np.empty(n), np.empty(n), np.empty(n)
    for i in range(n):
        if i % per_scan == 0:
            seen = round(reading / 0.01) * 0.01
            error = case.setpoint - seen if i * fine >= 60.0 else 0.0
            moved = part + case.k * case.scan / case.tn * error
            part = moved if 0.0 < case.k * error + moved < 100.0 else part
            power = min(max(case.k * error + part, 0.0), 100.0) if i * fine >= 60.0 else 0.0
            on = int(power / 100.0 * per_scan + owed)  # what is left of a tick is given in a later period
            owed += power / 100.0 * per_scan - on
        temperature[i], asked[i] = reading, power
        pulses[i] = 100.0 if i % per_scan < on else 0.0
        late.append(pulses[i])
        reading += fine / case.lag * (case.room + gain * late.pop(0) - reading)
    return np.arange(n) * fine, temperature, asked, pulses


def trace(case: Case, way: str, curves, *, every: float = 4.0, step: float = 0.1) -> Log:
    """Return a log of a run, its power written in one of the ways."""
    time, temperature, asked, pulses = curves
    fine = time[1]
    every = {"fast pulses": 0.2, "percent": case.scan, "slow rows": 10.0 * case.scan}.get(way, every)
    rows = slice(0, None, round(every / fine))
    power = pulses if "pulses" in way else asked
    digits = {"whole percent": 0, "pulses on change": 0}.get(way, 1)
    signals = {"temperature": LogSignal(np.round(temperature[rows] / step) * step, "degC", time_s=time[rows])}
    if "on change" in way:
        values = np.round(power, digits)
        edges = np.flatnonzero(np.concatenate([[True], np.diff(values) != 0.0]))
        signals["power"] = LogSignal(values[edges], "100", time_s=time[edges])
    else:
        signals["power"] = LogSignal(np.round(power[rows], digits), "100", time_s=time[rows])
    asked_for = np.where(time[rows] < 60.0, 0.0, case.setpoint)
    signals["setpoint"] = LogSignal(asked_for, "degC", time_s=time[rows])
    return Log(name=f"{way}.csv", source="a plain loop", signals=signals)


def told(found: AsLeft) -> tuple[float | None, bool | None, str]:
    """Return the power reserve that was measured [%], whether it is as proven, and what was said of it."""
    line = next(line for line in found.measurements if line.name == "power_reserve")
    assert not isinstance(line.measured, str)
    return line.measured, line.as_proven, line.message


def main(count: int, first: int) -> int:
    """Print how the reserve was told in each way; return how often it was told wrongly."""
    tally, wrong = Counter[str](), 0
    for seed in range(first, first + count):
        case = drawn(seed)
        parts = proven(case)
        for weaker in (0.0, 0.06):
            curves = run(case, weaker=weaker)
            true = 100.0 - (case.setpoint - case.room) / (case.gain * (1.0 - weaker))
            lost = (case.setpoint - case.room) / case.gain * weaker / (1.0 - weaker)
            for way in WAYS:
                measured, right, message = told(as_left(trace(case, way, curves), *parts))
                word = "not measured" if measured is None else "as proven" if right else "worse"
                tolerance = float(message.split("within ")[1].split(" %")[0]) if measured is not None else 0.0
                off = measured is not None and abs(measured - true) > tolerance
                must = weaker > 0.0 and lost > 1.5 * tolerance
                if off or ((word == "worse") is not must and (not weaker or lost > 3.0 * tolerance)):
                    wrong += 1
                    print(f"  {seed} {way}, {weaker:.0%} weaker: {word}, {measured} for {true:.3f}; {message}")
                tally[f"{way}, {weaker:.0%} weaker: {word}"] += 1
    for key, number in sorted(tally.items()):
        print(f"{key} {number}")
    print(f"{wrong} told wrongly")
    return wrong


if __name__ == "__main__":
    sys.exit(min(main(int([*sys.argv, 6][1]), int([*sys.argv, 0, 0][2])), 1))
