"""How many plausible heaters a design passes on by default: `python tests/bench/passes.py [TARGET ...]`.

Each heater is given by hand, so that no fit has a say, and used between a third and two thirds of what it can hold. Its
sensor is the narrowest usual one with a fifth to spare, and what is asked for is 1 to 3 % of the setpoint step, but
not less than what the controller's own reading can show. All is drawn by --seed, a heater at a time, so that --first
and --count run pieces of one series. Seconds are those of the processor: of the design as it is asked for, and of all
until it is closed on its verdict.

Measured on two processors that five others shared (seconds are about a quarter above those of a quiet machine): seed 0,
heaters 0 to 99, and seed 7, heaters 0 to 99, of s7-200 0 to 39, of s7-200-pid 0 to 13.

    target       seed  PASS        as it is  seconds  as it is  factor  with bursts
    s5-ob251     0     100 of 100  46        0.34     0.17      2.0     15
    s7-300       0     100 of 100  59        0.27     0.12      2.3     13
                 7      99 of 100            0.31     0.15      2.1
    fb41         0     100 of 100  55        0.20     0.11      1.8     12
                 7      99 of 100            0.22     0.15      1.4
    weg          0     100 of 100   0        0.37     0.11      3.4     11
                 7     100 of 100            0.43     0.14      3.0
    s7-200       7      39 of 40             4.9      2.6       1.9
    s7-200-pid   7      14 of 14             5.1      2.4       2.1

Since then a proof that passes also runs the exported text, which takes most of the time (weg, on two processors that six
others shared, seed 0, heaters 0 to 59, and seed 7, 0 to 39: 60 of 60 and 40 of 40 PASS, 0.96 s and 1.00 s a design, of which
about 0.6 s are the text's; as it is 0.12 s, as what fails runs no text).

Since then weg takes a boost where it keeps the limits: seed 0, heaters 0 to 59, 60 of 60 PASS, 35 with a boost where it took gains or a
ramp with holdback, settled after 0.60 of their time (median; 0.48 to 0.78) at no more IAE than asked for, 7 with a ramp yet. On two
processors that took five times their work: 0.98 s a design, 0.14 s as it is; heaters 0 to 19 1.04 s, without boosts 1.19 s.

The tolerance is drawn beside the heater, not from what its switch can hold: fast heaters (T 12 to 40 s) get one that no PWM of
a second or more can keep, as ripple and one half-wave are more than the band. They are what the burst firing is for.
"""

import argparse
import collections
import os
import statistics
import time
from dataclasses import dataclass

import numpy as np

from heatertune.errors import HeatertuneError
from heatertune.model.model_values import Fopdt, model_by_hand
from heatertune.plc import Scaling, controller_for
from heatertune.proof.redesign import DesignRequest, find_passing_design
from heatertune.settings import Conditions

TARGETS = ("s5-ob251", "s7-200", "s7-200-pid", "s7-300", "fb41", "weg", "iec-pid", "pid-compact", "pid-temp")
_AMBIENT = 20.0
#: ends of usual sensor ranges [°C]
_RANGES = (30.0, 40.0, 50.0, 75.0, 100.0, 150.0, 200.0, 300.0, 400.0, 600.0, 850.0, 1000.0, 1300.0)
_STEPS = 2.0  # of the reading: less is no tolerance


@dataclass(frozen=True, kw_only=True)
class Case:
    """A heater as its user tells it: model, setpoint [°C], end of the sensor's range [°C], tolerance [°C]."""

    model: Fopdt
    setpoint: float
    high: float
    tolerance: float

    def __str__(self):
        plant = self.model
        return (f"k {plant.gain_degC_per_pct:.3g} °C/%, T {plant.time_constant_s:.4g} s, L {plant.dead_time_s:.4g} s "
                f"(L/T {plant.dead_time_s / plant.time_constant_s:.2g}), {self.setpoint:.4g} °C of {self.high:g}, "
                f"±{self.tolerance:.3g} °C")


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """Of one design: verdicts as it is and closed, what each breaks, seconds of each, what was done."""

    plain: str
    verdict: str
    broken_plain: tuple[str, ...]
    broken: tuple[str, ...]
    plain_s: float
    closed_s: float
    done: str


def case(number, seed=0):
    """Return a heater: k 0.1…10 °C/%, T 10…7200 s, L/T 0.02…1.5, each even in its logarithm."""
    rng = np.random.default_rng([seed, number])

    def drawn(low, high):
        return low * (high / low) ** rng.random()

    gain, lag = drawn(0.1, 10.0), drawn(10.0, 7200.0)
    model = Fopdt(gain_degC_per_pct=gain, time_constant_s=lag, dead_time_s=lag * drawn(0.02, 1.5),
                  ambient_degC=_AMBIENT)
    step = 100.0 * gain * drawn(1.0 / 3.0, 2.0 / 3.0)
    setpoint = _AMBIENT + step
    high = next(high for high in _RANGES if high >= 1.2 * setpoint or high == _RANGES[-1])
    return Case(model=model, setpoint=setpoint, high=high, tolerance=step * drawn(0.01, 0.03))


def designed(one, target, *, as_is=False, known=None, limit=()):
    """Return what becomes of a heater on a target."""
    tolerance = max(one.tolerance, _STEPS * 1.001 * one.high / controller_for(target).counts)
    asked = DesignRequest(
        target=target, scaling=Scaling(low_degC=0.0, high_degC=one.high), as_is=as_is,
        conditions=Conditions(setpoint_degC=one.setpoint, tolerance_degC=tolerance, switches=known or {}, limit=limit))
    fitted, begun, first = model_by_hand(one.model), time.process_time(), []

    def told(message):
        if " fails" in message and not first:
            first.append((time.process_time() - begun, message.split(" fails")[0]))

    try:
        result = find_passing_design(fitted, asked, progress=told)
    except HeatertuneError as problem:
        taken = time.process_time() - begun
        return Outcome(plain="ERROR", verdict="ERROR", broken_plain=(str(problem)[:60],), broken=(str(problem)[:60],),
                       plain_s=taken, closed_s=taken, done="")
    taken = time.process_time() - begun
    broken = tuple(each.name for each in result.proof.criteria if not each.ok)
    plain_s, broken_plain = first[0] if first else (taken, ",".join(broken))
    done = result.proof.diagnostics.remarks[-1] if result.notes else ""
    return Outcome(plain="FAIL" if first else result.proof.verdict, verdict=result.proof.verdict,
                   broken_plain=tuple(part for part in broken_plain.replace(" ", "_").split(",_") if part),
                   broken=broken, plain_s=plain_s, closed_s=taken, done=done)


def summary(target, outcomes):
    """Return the lines about a target."""
    count = len(outcomes)
    passing = sum(each.verdict == "PASS" for each in outcomes)
    plain = sum(each.plain == "PASS" for each in outcomes)
    often = collections.Counter(name for each in outcomes for name in each.broken)
    before = collections.Counter(name for each in outcomes for name in each.broken_plain)
    factor = sum(each.closed_s for each in outcomes) / sum(each.plain_s for each in outcomes)
    return [
        f"{target}: {passing} of {count} PASS ({100.0 * passing / count:.0f} %), as it is {plain}; "
        f"{statistics.mean(each.closed_s for each in outcomes):.2f} s a design, "
        f"as it is {statistics.mean(each.plain_s for each in outcomes):.2f} s (factor {factor:.2f}), "
        f"longest {max(each.closed_s for each in outcomes):.1f} s",
        *(f"  broken at the end: {name} {times}" for name, times in often.most_common()),
        *(f"  broken as it is: {name} {times}" for name, times in before.most_common()),
    ]


def main():
    """Print a line for each design, and what they come to."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("targets", nargs="*", default=TARGETS, metavar="TARGET")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--no-redesign", action="store_true")
    parser.add_argument("--assume", action="append", default=[], metavar="NAME=SETTING")
    settings = parser.parse_args()
    os.environ["HEATERTUNE_CACHE"] = ""
    known, lines = dict(text.split("=") for text in settings.switch), []
    for target in settings.targets:
        designed(case(settings.first, settings.seed), target, known=known)  # compiles
        outcomes = []
        for number in range(settings.first, settings.first + settings.count):
            one = case(number, settings.seed)
            result = designed(one, target, as_is=settings.as_is, known=known)
            outcomes.append(result)
            print(f"{target} {number:3d} {result.verdict:10s} {result.plain_s:6.2f} {result.closed_s:6.2f} s  {one}  "
                  f"as is: {','.join(result.broken_plain) or '-'}; at the end: {','.join(result.broken) or '-'}"
                  f"{'; ' if result.done else ''}{result.done}", flush=True)
        lines += summary(target, outcomes)
    print("\n".join(lines))


if __name__ == "__main__":
    main()
