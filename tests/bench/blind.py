"""Logs without power whose heater is known: open-loop heat-ups, two-level control, and loops that P and PI laws made.

    python tests/bench/blind.py --count 10
    python tests/bench/blind.py --kinds pulse thermostat --seed 3 --keep logs/

"identified" may only be said where the truth lies inside the interval, and a PASS may not be unstable on the true
heater: exit status 1 otherwise. Heaters are those of heaters.py, judged by truth.py; neither uses heatertune.
"""

import argparse
import math
import sys
import tempfile
import time
import zlib
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))  # started as a file, the tests are no package yet

from heatertune import cache
from heatertune.chain.stages import fit
from heatertune.log import read_log
from tests.bench import danger
from tests.bench.heaters import Case, Heater, Rig, sensor_range

_TOLERANCE = 0.02  # of a parameter: a half-rule FOPDT of two lags is no exact truth


@dataclass
class Run:
    """One log that is being made: the heater, its rig, the log's interval [s], and the generator of what is drawn."""

    rng: np.random.Generator
    heater: Heater
    interval: float
    noise: float
    resolution: float
    times: list = field(default_factory=list)
    readings: list = field(default_factory=list)
    powers: list = field(default_factory=list)

    def __post_init__(self):
        self.rig = Rig(self.heater, self.heater.ambient)

    @property
    def total(self):
        """All lags and the dead time [s]."""
        return sum(self.heater.lags) + self.heater.dead

    @property
    def hottest(self):
        """Temperature at full power [°C]."""
        return self.heater.ambient + 100.0 * self.heater.gain

    def read(self):
        """Return the next reading, as a controller and the log both have it."""
        now = self.interval * len(self.times)
        value = self.rig.run(now) + float(self.rng.normal(0.0, self.noise))
        self.times.append(now)
        self.readings.append(round(value / self.resolution) * self.resolution)
        return self.readings[-1]

    def apply(self, power):
        """Apply a power from this reading on."""
        if not self.powers or power != self.powers[-1]:
            self.rig.set(power)
        self.powers.append(power)


def _drawn(rng, low, high):
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _start(rng):
    """Return a run of one lag or two that has not begun."""
    lag, gain = _drawn(rng, 60.0, 900.0), _drawn(rng, 0.3, 3.0)
    second = (lag * float(rng.uniform(0.05, 0.5)),) if rng.random() < 0.5 else ()
    heater = Heater(gain=gain, lags=(lag, *second), dead=lag * _drawn(rng, 0.02, 0.2), ambient=float(rng.uniform(15.0, 28.0)))
    interval = float(max(1.0, round(lag / float(rng.uniform(40.0, 120.0)))))
    return Run(rng, heater, interval, noise=float(rng.uniform(0.01, 0.15)), resolution=float(rng.choice([0.01, 0.1, 0.25])))


def _until(run, seconds, power):
    """Apply one power for so long."""
    end = run.interval * len(run.times) + seconds
    while run.interval * len(run.times) < end:
        run.read()
        run.apply(power)


def _heat(run, target, power=100.0):
    """Apply a power until a temperature is reached."""
    for _ in range(3000):
        if run.read() >= target:
            run.apply(0.0)
            return
        run.apply(power)


def _target(run, low=0.2, high=0.6):
    return run.heater.ambient + 100.0 * run.heater.gain * float(run.rng.uniform(low, high))


def pulse(run):
    """Full power until a target, then off until it has fallen by some per cent."""
    _heat(run, _target(run))
    top, share = max(run.readings), float(run.rng.uniform(0.02, 0.15))
    for _ in range(3000):
        value = run.read()
        run.apply(0.0)
        top = max(top, value)
        if value < top - share * (top - run.heater.ambient) - 3.0 * run.noise:
            return


def long_pulse(run):
    """Full power until a target, then off until it is nearly cold."""
    _heat(run, _target(run))
    _until(run, 2.5 * run.total, 0.0)


def part_pulse(run):
    """Part of the power until a target, then off."""
    power = float(run.rng.uniform(40.0, 90.0))
    _heat(run, run.heater.ambient + power * run.heater.gain * float(run.rng.uniform(0.3, 0.8)), power)
    _until(run, run.total * float(run.rng.uniform(0.3, 1.5)), 0.0)


def rest_pulse(run):
    """A rest, then full power until a target, then off."""
    _until(run, run.total * float(run.rng.uniform(0.2, 0.6)), 0.0)
    pulse(run)


def heat_up(run):
    """Full power until a target, where the log ends."""
    _heat(run, _target(run, 0.3, 0.8))


def step(run):
    """One constant power until it rests."""
    _until(run, run.total * float(run.rng.uniform(3.0, 6.0)), float(run.rng.uniform(20.0, 100.0)))


def stairs(run):
    """Three levels of power, each higher, then off."""
    for power in np.sort(run.rng.uniform(15.0, 100.0, 3)):
        _until(run, run.total * float(run.rng.uniform(0.5, 2.0)), float(power))
    _until(run, run.total * float(run.rng.uniform(0.1, 1.0)), 0.0)


def firings(run):
    """Two heat-ups with a long cooling between."""
    for _ in range(2):
        _heat(run, _target(run))
        _until(run, run.total * float(run.rng.uniform(0.6, 2.0)), 0.0)


def thermostat(run, least=0.0):
    """Two levels of power between two thresholds, each for a least time."""
    target, half = _target(run), 100.0 * run.heater.gain * _drawn(run.rng, 0.002, 0.03)
    on, since = True, 0.0
    end = run.total * float(run.rng.uniform(4.0, 10.0))
    while run.interval * len(run.times) < end and len(run.times) < 3000:
        value, now = run.read(), run.interval * (len(run.times) - 1)
        wanted = False if value > target + half else True if value < target - half else on
        if wanted != on and now - since >= least:
            on, since = wanted, now
        run.apply(100.0 if on else 0.0)


def slow_thermostat(run):
    """The same with a least time on and off."""
    thermostat(run, least=run.total * float(run.rng.uniform(0.05, 0.3)))


def _loop(run, integral):
    """A P or PI controller with anti-windup, five scans to a reading, moderately tuned."""
    heater, rng = run.heater, run.rng
    lag = heater.lags[0] + (heater.lags[1] / 2.0 if len(heater.lags) > 1 else 0.0)
    dead = heater.dead + (heater.lags[1] / 2.0 if len(heater.lags) > 1 else 0.0)
    gain = lag / (heater.gain * 2.0 * dead) * float(rng.uniform(0.4, 1.1))
    time_s = min(lag, 8.0 * dead) * float(rng.uniform(0.7, 1.5)) if integral else math.inf
    target, part = _target(run), 0.0
    seconds = run.total * float(rng.uniform(4.0, 8.0))
    while run.interval * len(run.times) < seconds and len(run.times) < 3000:
        error = target - run.read()
        wanted = gain * error + part
        power = min(100.0, max(0.0, wanted))
        if power == wanted and integral:
            part += gain * run.interval / time_s * error
        run.apply(power)


def p_loop(run):
    """A P controller."""
    _loop(run, integral=False)


def pi_loop(run):
    """A PI controller with anti-windup."""
    _loop(run, integral=True)


#: name → how its log is made, and whether a law that is tried made it
KINDS = {
    "pulse": (pulse, False), "long pulse": (long_pulse, False), "part pulse": (part_pulse, False),
    "rest pulse": (rest_pulse, False), "heat-up": (heat_up, False), "step": (step, False), "stairs": (stairs, False),
    "firings": (firings, False), "thermostat": (thermostat, False), "slow thermostat": (slow_thermostat, False),
    "P": (p_loop, True), "PI": (pi_loop, True),
}


def make(kind, seed):
    """Return the case of a kind and a seed; its columns hold the power, which the log without it leaves out."""
    run = _start(np.random.default_rng([zlib.crc32(kind.encode()), seed]))
    KINDS[kind][0](run)
    columns = {"time_s": np.array(run.times), "temperature_degC": np.array(run.readings),
               "power_pct": np.array(run.powers[:len(run.times)])}
    return Case(kind=kind, seed=seed, heater=run.heater, columns=columns, range=sensor_range(max(run.readings)))


def without_power(case):
    """Return the text of the log without its power."""
    rows = zip(case.columns["time_s"], case.columns["temperature_degC"], strict=True)
    return "\n".join(["time_s,temperature_degC", *(f"{t:.10g},{y:.10g}" for t, y in rows), ""])


def outside(case, fitted):
    """Return the parameters that are called identified in an interval without the truth."""
    heater = case.heater
    if len(heater.lags) > 1:  # the half rule is one first-order reduction of several: only the gain is a truth
        truth = {"gain_degC_per_pct": heater.gain}
    else:
        truth = {"gain_degC_per_pct": heater.gain, "time_constant_s": heater.lags[0]}
    wrong = []
    for name, value in truth.items():
        inside = fitted.ci95.get(name)
        if inside is None:
            continue
        low, high = -math.inf if inside.low is None else inside.low, math.inf if inside.high is None else inside.high
        if not (1.0 - _TOLERANCE) * low <= value <= (1.0 + _TOLERANCE) * high:
            wrong.append(name)
    return wrong


def run_case(kind, seed, targets, powered=False, keep=None):
    """Return the outcome of a fit, what was wrongly called identified, the endings on the targets, and CPU seconds."""
    case = make(kind, seed)
    with tempfile.TemporaryDirectory() as place, cache.cache_disabled():
        path = Path(keep or place) / f"{kind.replace(' ', '_')}_{seed}.csv"
        path.write_text(case.text() if powered else without_power(case), encoding="utf-8")
        begun = time.process_time()
        fitted, lost = danger.take("refused", lambda: fit(read_log(path)))
        seconds = time.process_time() - begun
        if lost is not None:
            return lost.why if lost.end == "refused" else f"crashed: {lost.why}", [], {}, [], seconds
        ends = {target: danger.on_target(case, fitted, target, "pi", False) for target in targets}
    return fitted.outcome.name, outside(case, fitted), ends, [finding.name for finding in fitted.findings], seconds


def main(arguments=None):
    """Print a line for each log and a table; return 1 where a PASS is unstable or a false interval is claimed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=5, help="seeds of each kind (default: 5)")
    parser.add_argument("--first", type=int, default=0, help="first seed (default: 0)")
    parser.add_argument("--kinds", nargs="+", default=list(KINDS), choices=KINDS, metavar="KIND")
    parser.add_argument("--targets", nargs="*", default=["fb41"], choices=danger.TARGETS, metavar="TARGET")
    parser.add_argument("--power", action="store_true", help="the log holds the power")
    parser.add_argument("--keep", help="folder for the logs")
    parser.add_argument("--verbose", action="store_true")
    asked = parser.parse_args(arguments)
    if asked.keep:
        Path(asked.keep).mkdir(parents=True, exist_ok=True)
    bad, slowest = 0, 0.0
    for kind in asked.kinds:
        counted, findings = Counter(), Counter()
        for seed in range(asked.first, asked.first + asked.count):
            outcome, wrong, ends, found, seconds = run_case(kind, seed, asked.targets, asked.power, asked.keep)
            slowest = max(slowest, seconds)
            false = [target for target, end in ends.items() if end.danger]
            bad += len(false) + bool(wrong) + outcome.startswith("crashed")
            counted.update(end.end for end in ends.values())
            findings.update(found)
            counted["false PASS"] += len(false)
            counted["wrong interval"] += bool(wrong)
            counted["crashed"] += outcome.startswith("crashed")
            if asked.verbose or false or wrong or outcome.startswith("crashed"):
                told = ", ".join(f"{target} {end.end} Ms {end.ms} {end.why[:60]}" for target, end in ends.items())
                print(f"  {kind} {seed}: {outcome[:90]}; wrong: {wrong}; {told}; {found}; {seconds:.1f} s")
        print(f"{kind}: {dict(+counted)}; findings {dict(findings)}")
    print(f"slowest fit {slowest:.1f} CPU s; {bad} wrong")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
