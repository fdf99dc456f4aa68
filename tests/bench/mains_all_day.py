"""Does a PASS hold where the mains voltage is low or high all day? python -m tests.bench.mains_all_day [FIRST LAST [TARGET…]].

Heaters are drawn and designed for (outages.py); each PASS runs again under every setting by second_opinion.c, which shares
nothing with the proof, with the heater's power at 0.81 to 1.21 of the rated one from the first scan to the last,
as far as that power holds the setpoint with the reserve that the proof asks for. The sequence is not the proof's: heat-up,
open circuits of 0.3 TN to 12 h, changes of the setpoint down and up by 5 to 100 % of the range, each followed by a
disturbance of the other kind, restarts with the heater hot, warm and cold. Held against their limits, with two hundredths of
slack for close calls: each overshoot, the distance at rest, and the growth of the time to return after 3, 6 and 12 h with an
open circuit. Exit status 1 where something is broken.
"""

import math
import sys
import tempfile
from dataclasses import replace
from itertools import product
from unittest import mock

import numpy as np

from heatertune.plc import controller_for
from heatertune.plc.open_points import settings_to_prove
from heatertune.proof.heaters import holding_heaters
from heatertune.proof.prove_words import setpoints_for
from tests.bench import second_opinion
from tests.bench.false_passes import _limits
from tests.bench.outages import Night, bench_of, passing
from tests.bench.second_opinion import compiled, opinion

POWERS = (0.81, 0.9, 1.0, 1.1, 1.21)
SLACK = 1.02
_HOURS = (3.0, 6.0, 12.0)
_RESERVE_PCT = 5.0
_OVERSHOOTS = {"heat-up": "overshoot", "reheat": "reheat_overshoot", "change": "change_overshoot",
               "small-change": "small_change_overshoot", "restart": "restart_overshoot"}
_LONGEST_SCANS = 3e6


def day(b, low):
    """Return the parts of a day, and the numbers of those that follow the long open circuits.

    Args:
        b: a bench.
        low: lowest setpoint of use [°C].
    """
    told, long = Night(b), []
    for share in (0.3, 1.0, 4.0):
        told.open(max(b.interval, share * told.tn))
    for hours in _HOURS:
        if 3600.0 * hours / b.interval < _LONGEST_SCANS:
            told.open(3600.0 * hours)
            long.append(len(told.parts) - 1)
    for share in (1.0, 0.5, 0.2, 0.1, 0.05):
        change = share * (b.setpoint - low)
        told.then("setpoint", kind="change", asked=b.setpoint - change)
        told.open(told.tn, " at the lower setpoint")
        told.then("setpoint", kind="change", asked=b.setpoint)
    _at_an_edge(b, told, low)
    small = max(0.05 * told.step, 2.0 * b.band)
    for change in (small, 1.25 * small, 1.5 * small, 2.0 * small):
        if change <= b.setpoint - low:
            told.then("setpoint", kind="small-change", asked=b.setpoint - change)
            told.then("setpoint", kind="small-change", asked=b.setpoint)
    for cold in (0.05, 0.4, 0.8, 0.97):
        told.then("plc", second_opinion._takes(b, cold), power=0.0, supplied=False)
        told.then("plc", kind="restart", power=1.0, supplied=True)
    return told.parts, long


def _at_an_edge(b, told, low):
    """Add open circuits and changes of the setpoint about as far as a boost or Marlin's window reaches, into it from both sides."""
    again = b.boost[1] if b.boost else b.words["PID_FUNCTIONAL_RANGE"] if b.target == "marlin" else math.inf
    if again >= told.step:
        return
    falls = second_opinion._takes(b, again / told.step) - b.dead
    for share in np.linspace(-1.0, 2.0, 40):
        told.open(max(b.interval, falls + share * b.dead), " at the edge")
    for share in np.linspace(0.9, 1.6, 8):
        if share * again <= b.setpoint - low:
            told.then("setpoint", kind="change", asked=b.setpoint - share * again)
            told.then("setpoint", kind="change", asked=b.setpoint)


def broken(library, b, limits, low, heater_s):
    """Return (share of the limit, of what) of all that a day breaks.

    Args:
        library: of `compiled`.
        b: a bench whose heater has its gain at the mains voltage.
        limits: by the judge's names.
        low: lowest setpoint of use [°C].
        heater_s: lags and dead time of the slowest plausible heater [s].
    """
    parts, long = day(b, low)
    with mock.patch.object(second_opinion, "story", return_value=parts):
        told = opinion(library, b, limits, longer=0.0)
    found, before = [], parts[0].asked
    for number, (part, seen) in enumerate(zip(parts, told.seen, strict=True)):
        change, before = part.asked - before, part.asked
        if part.kind == "off":
            continue
        beyond = max(0.0, seen["highest"] if change >= 0.0 else -seen["lowest"])
        name, step = _OVERSHOOTS[part.kind], abs(change) if part.kind == "small-change" else b.setpoint - b.ambient
        rest = max(seen["rest_highest"], -seen["rest_lowest"])
        for what, used in ((name, 100.0 * beyond / step / (limits[name] or math.inf)),
                           (f"{name} in °C", beyond / (limits.get(f"{name} in degC") or math.inf)),
                           ("distance at rest", rest / (2.0 * b.band) if b.noise else rest / (SLACK * b.band))):
            if used > SLACK:
                found.append((round(used, 3), f"{what} in part {number}, {part.kind} at {part.asked:.4g} °C"))
    returns = [told.seen[number]["settled"] - told.begins[number] for number in long]
    growth = max(returns, default=0.0) - min(returns, default=0.0)
    if growth > 0.1 * min(returns, default=0.0) + heater_s:
        found.append((math.inf, f"returns in {', '.join(f'{each / 60.0:.1f}' for each in returns)} min after {_HOURS} h"))
    return found


def judged(library, fitted, design, powers=POWERS):
    """Yield (power, name of the heater, settings, what is broken) of each run of a design."""
    models = holding_heaters(fitted, setpoints_for(fitted, design.conditions)[1])
    slowest = max(sum(model.lags_s) + model.dead_time_s for _, model in models)
    limits = _limits(design.proof.limits) | {"iae": math.inf}
    high, low = design.conditions.highest_degC, design.conditions.lowest_degC
    for (name, model), settings, power in product(
        models, settings_to_prove(controller_for(design.proof.words.target).switches), powers,
    ):
        b = bench_of(model, design, settings)
        b = replace(b, gain=power * b.gain)
        lowest = b.setpoint - 0.2 * (b.setpoint - b.ambient) if low is None else low
        if (high - b.ambient) / b.gain > 100.0 - _RESERVE_PCT or not b.ambient < lowest < high:
            continue
        yield power, name, settings, broken(library, b, limits, lowest, slowest)


def main(first=0, last=6, *targets):
    proven = runs = wrong = 0
    with tempfile.TemporaryDirectory() as folder:
        library = compiled(folder)
        for seed, target, fitted, design in passing(first, last, targets, folder):
            proven += 1
            bad = []
            for power, name, settings, found in judged(library, fitted, design):
                runs += 1
                bad += [(power, name, settings, each) for each in sorted(found, reverse=True)[:2]]
            wrong += bool(bad)
            for each in bad[:3]:
                print(seed, target, *each, flush=True)
    print(f"{proven} PASS in {runs} runs, {wrong} of them break a limit at another mains voltage")
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
