"""Logs in which the power is not the only cause of the temperature: does a PASS hold on the heater?

    python tests/bench/causes.py --count 8 --kinds two-scales drift

Nothing of heatertune makes the logs: the heater is a few lags in parallel or in series, integrated by Euler steps.
A dangerous PASS is a loop that is unstable on the true heater, or has Ms > 2.5 there; a PASS with Ms > 2 is counted too.
"""

import argparse
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))  # started as a file, the tests are no package yet

from heatertune import cache
from heatertune.chain.stages import fit
from heatertune.errors import HeatertuneError
from heatertune.log import read_log
from tests.bench import danger, truth

_TARGET = "fb41"
_EULER = 20  # steps per shortest lag


@dataclass(frozen=True)
class Truth:
    """dx/dt = A·x + B·power(t - dead) [°C, %, s]; the sensor reads ambient + the last state.

    Attributes:
        a, b: shapes (n, n) and (n,).
        dead: dead time [s].
        slowest: longest lag [s].
    """

    a: np.ndarray
    b: np.ndarray
    dead: float
    slowest: float


@dataclass(frozen=True)
class Case:
    """A log and the heater that made it.

    Attributes:
        heater: the truth.
        time, temperature, power: of the log, shape (n,) [s, °C, %].
    """

    heater: Truth
    time: np.ndarray
    temperature: np.ndarray
    power: np.ndarray

    def text(self):
        """Return the file's text."""
        rows = zip(self.time, self.temperature, self.power, strict=True)
        return "time_s,temperature_C,power_pct\n" + "".join(f"{t:g},{y:.2f},{u:.3f}\n" for t, y, u in rows)


def series(gain, lags, dead):
    """Return a heater of lags in series [s]."""
    n = len(lags)
    a, b = np.zeros((n, n)), np.zeros(n)
    b[0] = gain / lags[0]
    for i, lag in enumerate(lags):
        a[i, i] = -1.0 / lag
        if i:
            a[i, i - 1] = 1.0 / lag
    return Truth(a, b, dead, max(lags))


def two_scales(gain, share, fast, slow, sensor, dead):
    """Return a heater with a share of its gain on a fast lag, the rest on a slow one, both seen by one sensor [s]."""
    a = np.array([[-1.0 / fast, 0.0, 0.0], [0.0, -1.0 / slow, 0.0], [1.0 / sensor, 1.0 / sensor, -1.0 / sensor]])
    return Truth(a, np.array([gain * share / fast, gain * (1.0 - share) / slow, 0.0]), dead, slow)


def run(heater, power_of, rows, interval, rng, *, start=None, other=None, noise=0.06, ambient=22.0):
    """Return the case of a heater under a power.

    Args:
        heater: the truth.
        power_of: row, reading → power [%].
        rows, interval: of the log [s].
        rng: of the noise.
        start: first states [°C], None: at rest without power.
        other: instant → what else lifts the reading [°C], None: nothing.
        noise: standard deviation of a reading [°C].
        ambient: [°C].
    """
    shortest = -1.0 / np.min(np.diag(heater.a))
    parts = max(4, int(np.ceil(_EULER * interval / shortest)))
    h = interval / parts
    x = np.zeros(len(heater.b)) if start is None else np.array(start, float)
    late = [0.0] * round(heater.dead / h)
    y, u = np.empty(rows), np.empty(rows)
    for i in range(rows):
        y[i] = ambient + x[-1] + (0.0 if other is None else other(i * interval)) + rng.normal(0.0, noise)
        u[i] = power_of(i, y[i])
        for _ in range(parts):
            late.append(u[i])
            x = x + h * (heater.a @ x + heater.b * late.pop(0))
    return Case(heater, np.arange(rows) * interval, y, u)


def _levels(rng, rows, rest, count=3):
    """Return a program of a few levels of power, after so many rows without."""
    begins = np.sort(rng.choice(np.arange(rest + rows // 10, rows - rows // 10, rows // 20), count - 1, replace=False))
    levels = rng.uniform(15.0, 70.0, count)

    def power(i, _):
        return 0.0 if i < rest else float(levels[np.searchsorted(begins, i, side="right")])

    return power


def _drawn_scales(rng):
    return two_scales(rng.uniform(0.4, 0.8), rng.uniform(0.15, 0.6), rng.uniform(6.0, 30.0), rng.uniform(400.0, 1500.0),
                      rng.uniform(3.0, 12.0), rng.uniform(1.0, 8.0))


def _drawn_series(rng):
    lag = rng.uniform(60.0, 250.0)
    return series(rng.uniform(0.4, 0.8), (lag, lag * rng.uniform(0.03, 0.6)), lag * rng.uniform(0.03, 0.2))


def _loop(heater, rng, rows, interval, points):
    """Return a PI controller of moderate gain for a heater."""
    steady = -float(np.linalg.solve(heater.a, heater.b)[-1])
    k, ti = rng.uniform(0.5, 4.0), heater.slowest * rng.uniform(0.2, 1.0)
    total = [0.0]

    def power(i, y):
        if i < rows // 40:
            return 0.0
        e = 22.0 + steady * points[min(len(points) - 1, i * len(points) // rows)] - y
        u = k * e + total[0]
        if 0.0 < u < 100.0:
            total[0] += k * e * interval / ti
        return float(min(max(u, 0.0), 100.0))

    return power


def _scales_open(rng):
    return run(_drawn_scales(rng), _levels(rng, 2600, 60), 2600, 1.0, rng)


def _scales_unrested(rng):
    return run(_drawn_scales(rng), _levels(rng, 2600, 0), 2600, 1.0, rng)


def _scales_hot(rng):
    heater = _drawn_scales(rng)
    before = rng.uniform(20.0, 60.0)
    return run(heater, _levels(rng, 2600, 200), 2600, 1.0, rng, start=-np.linalg.solve(heater.a, heater.b) * before)


def _scales_loop(rng):
    heater = _drawn_scales(rng)
    return run(heater, _loop(heater, rng, 2600, 1.0, rng.uniform(25.0, 60.0, 3)), 2600, 1.0, rng)


def _steps(rng, rows, rest, low, high):
    middle = int(rows * rng.uniform(0.45, 0.65))
    first, second = rng.uniform(low, high), rng.uniform(low, high)
    return lambda i, _: 0.0 if i < rest else first if i < middle else second


def _drift(rng):
    heater = _drawn_series(rng)
    rows, interval = 900, heater.slowest / 100.0
    rise = -float(np.linalg.solve(heater.a, heater.b)[-1]) * 15.0
    size = rng.choice([-1.0, 1.0]) * rng.uniform(0.3, 3.0) * rise
    return run(heater, _steps(rng, rows, 60, 5.0, 25.0), rows, interval, rng, other=lambda t: size * t / (rows * interval))


def _day(rng):
    heater = _drawn_series(rng)
    rows, interval = 900, heater.slowest / 100.0
    rise = -float(np.linalg.solve(heater.a, heater.b)[-1]) * 15.0
    size, turns, phase = rng.uniform(0.2, 1.5) * rise, rng.uniform(0.5, 2.0), rng.uniform(0.0, 6.28)
    return run(heater, _steps(rng, rows, 60, 5.0, 25.0), rows, interval, rng,
               other=lambda t: size * np.sin(6.28 * turns * t / (rows * interval) + phase))


def _cooling(rng):
    heater = _drawn_series(rng)
    rows, interval = 900, heater.slowest / 100.0
    rise = -float(np.linalg.solve(heater.a, heater.b)[-1]) * 15.0
    hot = rng.uniform(1.0, 8.0) * rise
    tail = heater.slowest * rng.uniform(1.5, 6.0)  # the mass behind cools more slowly than the heater
    share = rng.uniform(0.0, 0.5)
    return run(heater, _steps(rng, rows, 0, 5.0, 25.0), rows, interval, rng,
               start=np.full(len(heater.b), hot * (1.0 - share)), other=lambda t: share * hot * np.exp(-t / tail))


def _load(rng, low, high):
    heater = _drawn_series(rng)
    rows, interval = 900, heater.slowest / 100.0
    rise = -float(np.linalg.solve(heater.a, heater.b)[-1]) * 40.0
    size, lag = rng.choice([-1.0, -1.0, 1.0]) * rng.uniform(low, high) * rise, heater.slowest
    begins = rng.uniform(0.15, 0.8) * rows * interval
    ends = begins + rng.uniform(0.1, 0.6) * rows * interval

    def other(t):
        risen = 1.0 - np.exp(-max(t - begins, 0.0) / lag)
        return size * (risen - (1.0 - np.exp(-max(t - ends, 0.0) / lag)))

    return run(heater, _steps(rng, rows, 60, 25.0, 60.0), rows, interval, rng, other=other)


_SUB = 10  # instants of the truth in a row of the log


def _read_as(rng, what):
    """Return a log of few rows per lag whose power column is late or early by a row, or the mean of the row before."""
    lag = rng.uniform(60.0, 250.0)
    heater = series(rng.uniform(0.4, 0.8), (lag, lag * rng.uniform(0.02, 0.3)), lag * rng.uniform(0.01, 0.15))
    row = lag / rng.uniform(6.0, 40.0)
    rows = 14 * round(lag / row) + 30
    begins = np.sort(rng.integers(_SUB * 8, _SUB * rows * 8 // 10, 2)) // (1 if what == "mean" else _SUB) * (
        1 if what == "mean" else _SUB)
    levels = rng.uniform(15.0, 70.0, 3) * (0.0, 1.0, 1.0)
    fine = run(heater, lambda i, _: float(levels[np.searchsorted(begins, i, side="right")]), _SUB * rows, row / _SUB, rng)
    power = fine.power[::_SUB]
    if what == "late":
        power = np.concatenate([power[:1], power[:-1]])
    elif what == "early":
        power = np.concatenate([power[1:], power[-1:]])
    elif what == "mean":
        power = np.concatenate([power[:1], fine.power.reshape(rows, _SUB).mean(axis=1)[:-1]])
    return Case(heater, fine.time[::_SUB], fine.temperature[::_SUB], power)


#: kind → what draws a case
KINDS = {
    "two-scales": _scales_open, "two-scales-unrested": _scales_unrested, "two-scales-hot": _scales_hot,
    "two-scales-loop": _scales_loop, "drift": _drift, "day": _day, "cooling": _cooling,
    "small-load": lambda rng: _load(rng, 0.05, 0.2), "door": lambda rng: _load(rng, 0.2, 0.6),
    "large-load": lambda rng: _load(rng, 0.6, 1.5),
    "row-late": lambda rng: _read_as(rng, "late"), "row-mean": lambda rng: _read_as(rng, "mean"),
    "row-early": lambda rng: _read_as(rng, "early"), "row-exact": lambda rng: _read_as(rng, "exact"),
    "plain": lambda rng: run(h := _drawn_series(rng), _steps(rng, 900, 60, 15.0, 60.0), 900, h.slowest / 100.0, rng),
}


def make(kind, seed):
    """Return the case of a kind and a seed."""
    return KINDS[kind](np.random.default_rng([seed, *kind.encode()]))


def outcome(case, name="log"):
    """Return how the design of a case's log ends: verdict or refusal, why, true Ms (inf: unstable), fit, CPU time."""
    begun = time.process_time()
    with tempfile.TemporaryDirectory() as place, cache.cache_disabled():
        path = Path(place) / f"{name}.csv"
        path.write_text(case.text(), encoding="utf-8")
        try:
            fitted = fit(read_log(path))
        except HeatertuneError as refused:
            return "refused", str(refused), None, None, time.process_time() - begun
        high = 50.0 * (2.0 + case.temperature.max() // 50.0)
        ending, words = danger.ended(fitted, danger.asked_for(_TARGET, 0.0, high, "pi", False))
    ms = None
    if words is not None:
        law = danger.law_of(words)
        plant = truth.sampled(case.heater.a, case.heater.b, case.heater.dead, law.interval)
        ms = truth.peak(plant, law, case.heater.slowest) if truth.stable(plant, law) else np.inf
    return ending.end, ending.why, ms, fitted, time.process_time() - begun


def main(arguments=None):
    """Print a line a kind; return 1 where a PASS is a dangerous one."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=4)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--kinds", nargs="+", default=list(KINDS), choices=KINDS)
    parser.add_argument("--each", action="store_true", help="a line a log")
    asked = parser.parse_args(arguments)
    dangerous = 0
    for kind in asked.kinds:
        ends, bad, strained, longest = Counter(), [], 0, 0.0
        for seed in range(asked.first, asked.first + asked.count):
            end, why, ms, fitted, seconds = outcome(make(kind, seed), f"{kind}-{seed}")
            ends[end] += 1
            longest = max(longest, seconds)
            if end == "PASS" and ms > 2.0:
                strained += 1
                bad += [(seed, round(ms, 2))] if ms > 2.5 else []
            if asked.each:
                found = [] if fitted is None else [finding.name for finding in fitted.findings]
                print(f"  {kind} {seed}: {end} Ms {ms} {why[:140]} {found}", flush=True)
        dangerous += len(bad)
        print(f"{kind}: {dict(ends)}; PASS with Ms > 2: {strained}; dangerous {bad}; longest {longest:.1f} CPU s", flush=True)
    return 1 if dangerous else 0


if __name__ == "__main__":
    sys.exit(main())
