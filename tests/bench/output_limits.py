"""Loops whose log has no power, under controllers with limits that no log shows: is what is called identified true?

    python tests/bench/output_limits.py --count 6
    python tests/bench/output_limits.py --kinds limited soft --first 100 --verbose

Kinds: the output is limited below full power; it never reaches its limit; it has a least value; a bias is added; it has
steps (5 %, 2 %, counts of a byte, a solid-state relay of twelve steps, four stages); it changes slowly; the loop is closed long after the log begins, or a few rows; the log begins during the
heat-up; the proportional part acts on the
reading alone; the controller has a derivative part; it reaches full power. Each log is fitted as it is: without the
power nobody knows how much the largest output was, so nothing may be called identified that depends on it, and the
finding must block. Then the largest power is stated, as the message asks: every interval has to hold the truth. Heater
and controllers are this file's own; they use nothing of heatertune.
"""

import argparse
import math
import sys
import zlib
from collections import Counter
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))  # started as a file, the tests are no package yet

from heatertune import cache
from heatertune.chain.stages import fit
from heatertune.errors import HeatertuneError
from heatertune.log.log_values import Log

_COUNT = 100.0 / 255.0  # of an output of a byte [%]
#: kind → how far the output moves at once [%]
STEPS = {"coarse": 5.0, "steps of 2 %": 2.0, "counts": _COUNT, "counts of 8": 8.0 * _COUNT, "counts of 16": 16.0 * _COUNT,
         "stepper": 100.0 / 12.0, "stages": 25.0}
KINDS = ("limited", "soft", "least", "bias", *STEPS, "slow", "late", "rows late", "begun", "on reading", "derivative", "full")
_TOLERANCE = 0.03  # of a parameter: one lag by the half rule is no exact truth


def draw(kind, seed):
    """Return the rows (s, °C), the largest power [%], the truth, and how far a dead time may be off [s].

    One lag takes a second one as dead time, half of it or all; the controller holds its output for a row, and no row
    shows when in the one before it began.
    """
    rng = np.random.default_rng([zlib.crc32(kind.encode()), seed])
    lag, gain = math.exp(rng.uniform(math.log(60.0), math.log(600.0))), math.exp(rng.uniform(math.log(0.4), math.log(3.0)))
    second = lag * rng.uniform(0.05, 0.4) if rng.random() < 0.5 else 0.0
    dead, ambient = lag * rng.uniform(0.05, 0.2), rng.uniform(15.0, 28.0)
    interval = max(1.0, round(lag / 50.0))
    scans = 10
    step = interval / scans
    limit = rng.uniform(25.0, 85.0) if kind == "limited" else 100.0
    least = rng.uniform(3.0, 12.0) if kind == "least" else 0.0
    bias = rng.uniform(5.0, 20.0) if kind == "bias" else 0.0
    target = ambient + limit * gain * rng.uniform(0.35, 0.7)
    k = lag / (gain * rng.uniform(2.0, 4.0) * (dead + second + interval))
    if kind == "soft":
        k = min(k, rng.uniform(40.0, 90.0) / (target - ambient))
    ti, td = min(lag, 8.0 * (dead + second + interval)), 0.3 * dead if kind == "derivative" else 0.0
    begins = rng.uniform(0.2, 1.0) * lag if kind == "late" else rng.uniform(0.5, 7.0) * interval if kind == "rows late" else 0.0
    left_out = int(rng.uniform(1.0, 3.0) * (dead + second) / interval) if kind == "begun" else 0
    pipe, x, y, part, power, before, rows, largest = [0.0] * round(dead / step), ambient, ambient, 0.0, 0.0, ambient, [], 0.0
    for row in range(int(rng.uniform(6.0, 10.0) * (lag + second + dead) / interval)):
        read = round((y + rng.normal(0.0, 0.05)) / 0.1) * 0.1
        rows.append((row * interval, read))
        error = target - read
        proportional = -k * (read - ambient) if kind == "on reading" else k * error
        wanted = proportional + part + bias - k * td * (read - before) / interval
        before = read
        given = min(limit, max(least, wanted))
        if given == wanted or (wanted - given) * error < 0.0:
            part += k * interval / ti * error
        if kind in STEPS:
            given = min(round(given / STEPS[kind]) * STEPS[kind], limit)
        if kind == "slow":
            given = power + min(max(given - power, -2.0), 2.0)
        power = given if row * interval >= begins else 0.0
        part = part if row * interval >= begins else 0.0
        largest = max(largest, power)
        for _ in range(scans):
            pipe.append(power)
            x += step / lag * (ambient + gain * pipe.pop(0) - x)
            y = x if not second else y + step / second * (x - y)
    return np.array(rows[left_out:]), largest, {"gain_degC_per_pct": gain, "time_constant_s": lag + 0.5 * second,
                                     "dead_time_s": dead + 0.5 * second + 0.5 * interval}, 0.5 * second + interval


def verdict_of(rows, truth, late, **options):
    """Return the outcome, whether a finding blocks, and the identified intervals that do not hold the truth."""
    log = Log(name="log", source="", time_s=rows[:, 0], temperature_degC=rows[:, 1])
    with cache.cache_disabled():
        try:
            fitted = fit(log, **options)
        except HeatertuneError as problem:
            return "refused", True, [], str(problem)
    wrong = []
    for name, true in truth.items():
        inside = fitted.ci95.get(name)
        slack = _TOLERANCE * true + (late if name == "dead_time_s" else 0.0)
        if inside is not None and not inside.low - slack <= true <= inside.high + slack:
            wrong.append(f"{name} {inside.low:.3g}…{inside.high:.3g} for {true:.3g}")
    names = {finding.name for finding in fitted.findings if finding.kind.effect == "blocks"}
    return fitted.outcome.name, bool(names), wrong, " ".join(sorted(names))


def main(arguments=None):
    """Print a table of how logs were served; return 1 if one was served wrongly."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=4, help="seeds of each kind (default: 4)")
    parser.add_argument("--first", type=int, default=0, help="first seed (default: 0)")
    parser.add_argument("--kinds", nargs="+", default=list(KINDS), choices=KINDS, metavar="KIND")
    parser.add_argument("--verbose", action="store_true")
    asked = parser.parse_args(arguments)
    total, failed = 0, 0
    for kind in asked.kinds:
        counted = Counter()
        for seed in range(asked.first, asked.first + asked.count):
            rows, largest, truth, late = draw(kind, seed)
            for way, options in (("as it is", {}), ("stated", {"largest_power_pct": largest})):
                outcome, blocks, wrong, names = verdict_of(rows, truth, late, **options)
                unblocked = not options and not blocks
                word = "wrong" if wrong else "not blocked" if unblocked else outcome
                word += " blocked" if blocks and options else ""
                counted[f"{way}: {word}"] += 1
                total, failed = total + 1, failed + bool((wrong and not blocks) or (wrong and not options) or unblocked)
                if asked.verbose or wrong or unblocked:
                    print(f"  {kind} {seed}, {way}, largest {largest:.0f} %: {outcome}; {'; '.join(wrong)} [{names}]")
        print(f"{kind}: {dict(counted)}", flush=True)
    print(f"{total} fits, {failed} served wrongly")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
