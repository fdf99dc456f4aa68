"""Two-level control of known heaters, with and without the power in the log: what is identified, and is it true?

    python tests/bench/two_level.py --count 200
    python tests/bench/two_level.py --count 20 --first 40 --verbose --keep logs/

Each seed is one log: one lag or two with dead time, a hysteresis of 0.5…10 °C, noise, steps of the reading, minimum on
and off times, rows of 1…60 s, a step of the mains, a start from cold or within the cycle; half of the logs have the
power. A log without power is fitted as it is, and once more with the thresholds stated. What a message names is done.
The thresholds that a note names count as intervals, of a thermostat without minimum times (it says "unless").
Exit status 1 if anything is called identified that is not true, or if fewer than 95 % of the intervals hold the truth.

Heater, thermostat and stability limit are this file's own; they use nothing of heatertune.
"""

import argparse
import math
import re
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))  # started as a file, the tests are no package yet

from heatertune import cache
from heatertune.chain.stages import fit
from heatertune.errors import HeatertuneError
from heatertune.log import read_log
from heatertune.model.findings import remedy_of

_TOLERANCE = 0.02  # of a parameter: half-way models of two lags are no exact truth
_MOST_ROWS = 3000
_NOTHING = ("refused", "LAW_UNKNOWN", "POOR_FIT")  # outcomes that are of use only by their remedy


@dataclass(frozen=True, kw_only=True)
class Plant:
    """gain/((lag·s + 1)(second·s + 1))·e^(−dead·s) above an ambient; second = 0: one lag."""

    gain: float
    lag: float
    second: float
    dead: float
    ambient: float

    def limit(self):
        """Return gain [%/°C] and period [s] of a P controller at the limit of stability, by bisection of the phase."""
        low, high = 0.0, 100.0 / (self.dead + self.second + 1e-9)
        for _ in range(200):
            w = 0.5 * (low + high)
            phase = math.atan(w * self.lag) + math.atan(w * self.second) + w * self.dead
            low, high = (w, high) if phase < math.pi else (low, w)
        return math.hypot(1.0, low * self.lag) * math.hypot(1.0, low * self.second) / self.gain, 2.0 * math.pi / low


@dataclass(frozen=True, kw_only=True)
class Drawn:
    """One log and all that is true of it; mains: factor of the heat after its step (1: no step)."""

    plant: Plant
    low: float
    high: float
    least: tuple[float, float]
    interval: float
    powers: tuple[float, float]
    mains: float
    powered: bool
    time_s: np.ndarray
    temperature: np.ndarray
    power: np.ndarray
    switchings: int
    seed: int = 0

    def text(self, powered):
        """Return the file, with the power or without."""
        head = "time_s,temperature_degC" + (",power_pct" if powered else "")
        rows = (f"{t:.10g},{y:.10g}" + (f",{u:g}" if powered else "")
                for t, y, u in zip(self.time_s, self.temperature, self.power, strict=True))
        return "\n".join([head, *rows, ""])


def draw(seed, finer=1.0):
    """Return the log of a seed, with rows that follow each other so many times as fast; the same at all times."""
    rng = np.random.default_rng([42, seed])
    lag = math.exp(rng.uniform(math.log(60.0), math.log(900.0)))
    second = lag * rng.uniform(0.05, 0.5) if rng.random() < 0.5 else 0.0
    dead = lag * math.exp(rng.uniform(math.log(0.02), math.log(0.2)))
    plant = Plant(gain=math.exp(rng.uniform(math.log(0.5), math.log(5.0))), lag=lag, second=second, dead=dead,
                  ambient=rng.uniform(15.0, 28.0))
    hysteresis = math.exp(rng.uniform(math.log(0.5), math.log(10.0)))
    hysteresis = min(hysteresis, 15.0 * plant.gain)
    middle = plant.ambient + 100.0 * plant.gain * rng.uniform(0.3, 0.7)
    interval = float(rng.choice([each for each in (1.0, 2.0, 5.0, 10.0, 30.0, 60.0) if each <= max(1.0, lag / 8.0)]))
    interval = max(interval / finer, 0.5)
    least = (lag * rng.uniform(0.02, 0.15), lag * rng.uniform(0.02, 0.15)) if rng.random() < 0.4 else (0.0, 0.0)
    powered = rng.random() < 0.5
    powers = ((0.0, 100.0), (0.0, 100.0), (0.0, 80.0), (20.0, 100.0))[int(rng.integers(4))] if powered else (0.0, 100.0)
    mains = rng.uniform(0.88, 1.08) if rng.random() < 0.2 else 1.0
    noise, step = rng.uniform(0.0, 0.15), float(rng.choice([0.01, 0.1, 0.25, 0.5]))
    warm = rng.random() < 0.3
    return _run(rng, plant, (middle - hysteresis / 2.0, middle + hysteresis / 2.0), least, interval, powers, mains,
                noise, step, warm, powered, seed)


def _run(rng, plant, thresholds, least, interval, powers, mains, noise, step, warm, powered, seed):
    """Integrate the loop: both lags exactly over a fine step, the thermostat reads at each of its own scans."""
    fine = min(interval, max(0.1, min(0.5, plant.lag / 400.0)))
    fine = interval / math.ceil(interval / fine - 1e-9)
    late = round(plant.dead / fine)
    scan = max(1, round(min(1.0, interval) / fine))
    per_row = round(interval / fine)
    decay, decay_2 = math.exp(-fine / plant.lag), math.exp(-fine / plant.second) if plant.second else 0.0
    total = plant.lag + plant.second + plant.dead
    runs = max(total * rng.uniform(5.0, 10.0), 40.0 * interval)
    begin = 4.0 * total if warm else 0.0
    steps_at = begin + runs * rng.uniform(0.4, 0.8)
    plant = replace(plant, dead=late * fine)
    pipe, x, y, on, since = [0.0] * late, 0.0, 0.0, True, -1e9
    rows, switchings = [], 0
    k = 0
    while k * fine < begin + runs and len(rows) < _MOST_ROWS:
        now = k * fine
        read = None
        if k % scan == 0 or k % per_row == 0:
            read = round((plant.ambient + y + rng.normal(0.0, noise)) / step) * step
        if k % scan == 0:
            wanted = False if read >= thresholds[1] else True if read <= thresholds[0] else on
            if wanted != on and now - since >= least[0 if on else 1]:
                on, since = wanted, now
                switchings += now >= begin
        power = powers[1] if on else powers[0]
        if k % per_row == 0 and now >= begin - 1e-9:
            rows.append((now - begin, read, power))
        pipe.append(plant.gain * power * (mains if now >= steps_at else 1.0))
        target = pipe.pop(0)
        before = x
        x = target + (x - target) * decay
        if plant.second:
            # exact for a target that is constant over the step: the second lag driven by the exponential of the first
            ratio = plant.lag / (plant.lag - plant.second) if abs(plant.lag - plant.second) > 1e-9 else 0.0
            first = (before - target) * ratio
            y = target + first * decay + (y - target - first) * decay_2
        else:
            y = x
        k += 1
    columns = np.array(rows)
    return Drawn(plant=plant, low=thresholds[0], high=thresholds[1], least=least, interval=interval, powers=powers,
                 mains=mains, powered=powered, seed=seed, time_s=columns[:, 0], temperature=columns[:, 1], power=columns[:, 2],
                 switchings=switchings)


def truths(drawn):
    """Return the interval in which each number is true: more than a point only where the mains moved it."""
    plant, (gain, period) = drawn.plant, drawn.plant.limit()
    ends = sorted((1.0, drawn.mains))
    true = {
        "gain_degC_per_pct": (plant.gain * ends[0], plant.gain * ends[1]),
        "ultimate_gain_pct_per_degC": (gain / ends[1], gain / ends[0]), "ultimate_period_s": (period, period),
        "ambient_degC": (plant.ambient, plant.ambient)}
    if not plant.second:
        true |= {"time_constant_s": (plant.lag, plant.lag), "dead_time_s": (plant.dead, plant.dead)}
    return true


def judged(drawn, fitted):
    """Return (name, whether the truth lies inside) of each interval that the fit states."""
    intervals = {name: inside for name, inside in fitted.ci95.items() if inside is not None}
    intervals |= {name: inside for name, (value, inside) in fitted.combinations.items() if math.isfinite(value)}
    result = []
    for name, (least, most) in truths(drawn).items():
        inside = intervals.get(name)
        if inside is None or (inside.low is None and inside.high is None):
            continue
        low, high = -math.inf if inside.low is None else inside.low, math.inf if inside.high is None else inside.high
        margin = 0.5 if name == "ambient_degC" else _TOLERANCE * most
        result.append((name, low - margin <= most and least <= high + margin))
    return result


_THRESHOLDS = re.compile(r"off at (-?[\d.]+) to (-?[\d.]+) °C and on at (-?[\d.]+) to (-?[\d.]+) °C, ([\d.]+) to ([\d.]+) °C apart")
_DIGIT = 0.05  # the note has one decimal [°C]


def judged_thresholds(drawn, message):
    """Return (name, whether the truth lies inside) of the thresholds that a note names; a minimum time moves them."""
    noted = _THRESHOLDS.search(message)
    if noted is None or any(drawn.least):
        return []
    ends = [float(each) for each in noted.groups()]
    return [(name, low - _DIGIT <= true <= high + _DIGIT) for name, true, low, high in zip(
        ("threshold off", "threshold on", "hysteresis"), (drawn.high, drawn.low, drawn.high - drawn.low), ends[::2], ends[1::2], strict=True)]


@dataclass
class Verdict:
    """What one fit of one log gave."""

    outcome: str
    intervals: list
    message: str
    seconds: float

    @property
    def wrong(self):
        """Names of the heater's own numbers that are called identified and are not true."""
        names = ("gain_degC_per_pct", "time_constant_s")
        return [name for name, holds in self.intervals if name in names and not holds]


def fit_text(drawn, text, **options):
    """Return the verdict of a fit of a file."""
    with tempfile.TemporaryDirectory() as place, cache.cache_disabled():
        path = Path(place) / "log.csv"
        path.write_text(text, encoding="utf-8")
        begun = time.process_time()
        try:
            fitted = fit(read_log(path), **options)
        except HeatertuneError as problem:
            return Verdict("refused", [], str(problem), time.process_time() - begun)
        except Exception as problem:
            return Verdict("crashed", [], repr(problem), time.process_time() - begun)
    seconds = time.process_time() - begun
    names = {finding.name for finding in fitted.findings}
    message = " ".join([fitted.outcome.value, *(remedy_of(name, names) for name in sorted(names)), *fitted.notes])
    claims = [] if fitted.outcome.name in ("POOR_FIT", "LAW_UNKNOWN") else judged(drawn, fitted)
    claims += judged_thresholds(drawn, message)
    return Verdict(fitted.outcome.name, claims, message, seconds)


def follow(drawn, verdict, options):
    """Return the verdict after doing what a refusal names; None if it names nothing that can be done."""
    powered = drawn.powered
    if until := re.search(r"--until ([\d.]+)", verdict.message):
        return fit_text(drawn, drawn.text(powered), until_s=float(until[1]))
    if "shorter interval" in verdict.message:
        again = draw(drawn.seed, finer=10.0)
        return fit_text(again, again.text(powered), **options)
    if "--thermostat" in verdict.message and not powered:
        return fit_text(drawn, drawn.text(False), thermostat=(drawn.low, drawn.high, *drawn.least))
    if re.search(r"power as a column|log the power|log of the power|log the heater power", verdict.message):
        return fit_text(drawn, drawn.text(True))
    if "--ambient" in verdict.message:
        return fit_text(drawn, drawn.text(powered), ambient_degC=drawn.plant.ambient)
    return None


class Table:
    """Counts of outcomes, and which intervals hold the truth, by kind of log."""

    def __init__(self):
        self.ends, self.holds, self.counts = {}, {}, Counter()
        self.wrong = self.deaf = 0
        self.slowest = 0.0

    def add(self, kind, drawn, options, verbose):
        """Fit a log, do what a refusal names, and count both."""
        verdict = fit_text(drawn, drawn.text(drawn.powered), **options)
        self.slowest = max(self.slowest, verdict.seconds)
        self.ends.setdefault(kind, Counter())[verdict.outcome] += 1
        self.counts[kind] += 1
        bad = verdict.wrong or verdict.outcome == "crashed"
        self.wrong += bool(bad)
        for name, inside in verdict.intervals:
            self.holds.setdefault((kind, name), []).append(inside)
        after, helped = None, True
        if verdict.outcome in _NOTHING:
            after = follow(drawn, verdict, options)
            helped = after is not None and after.outcome not in (*_NOTHING, "crashed")
            self.ends[kind]["remedy works" if helped else "remedy fails"] += 1
            self.deaf += not helped
        if verbose or bad or not helped:
            missed = [name for name, inside in verdict.intervals if not inside]
            then = "" if after is None else f" → {after.outcome}: {after.message[:90]}"
            print(f"  {drawn.seed} {kind}: {verdict.outcome}, {drawn.switchings} switchings, rows {drawn.interval:g} s, "
                  f"missed {missed}, {verdict.seconds:.1f} s; {verdict.message[:120]}{then}", flush=True)

    @property
    def share(self):
        """Share of all intervals that hold the truth."""
        total = [inside for each in self.holds.values() for inside in each]
        return float(np.mean(total)) if total else math.nan

    def show(self):
        """Print it."""
        for kind, counted in self.ends.items():
            print(f"{kind}: {self.counts[kind]} logs; {dict(counted)}")
            for (of, name), inside in sorted(self.holds.items()):
                if of == kind:
                    print(f"    {name}: stated {len(inside)}, holds the truth {100.0 * np.mean(inside):.0f} %")
        print(f"all intervals: {sum(map(len, self.holds.values()))}, {100.0 * self.share:.1f} % hold the truth; wrongly "
              f"identified {self.wrong}; remedies that do not work {self.deaf}; slowest fit {self.slowest:.1f} CPU s")


def main(arguments=None):
    """Print a table; return 1 if a false interval is called identified or coverage is below 95 %."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=200, help="number of logs (default: 200)")
    parser.add_argument("--first", type=int, default=0, help="first seed (default: 0)")
    parser.add_argument("--no-stated", action="store_true", help="leave out the fits with the thresholds stated")
    parser.add_argument("--only", choices=("power", "blind"), help="only logs with the power, or without")
    parser.add_argument("--keep", help="folder for the logs")
    parser.add_argument("--verbose", action="store_true")
    asked = parser.parse_args(arguments)
    table = Table()
    for seed in range(asked.first, asked.first + asked.count):
        drawn = draw(seed)
        if asked.only is not None and drawn.powered != (asked.only == "power"):
            continue
        if asked.keep:
            Path(asked.keep).mkdir(parents=True, exist_ok=True)
            (Path(asked.keep) / f"two_level_{seed}.csv").write_text(drawn.text(drawn.powered), encoding="utf-8")
        table.add("with power" if drawn.powered else "without power", drawn, {}, asked.verbose)
        if not drawn.powered and not asked.no_stated:
            table.add("thresholds stated", drawn, {"thermostat": (drawn.low, drawn.high, *drawn.least)}, asked.verbose)
    table.show()
    return 1 if table.wrong or table.deaf or table.share < 0.95 else 0


if __name__ == "__main__":
    sys.exit(main())
