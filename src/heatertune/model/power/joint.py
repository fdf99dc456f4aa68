"""One heater behind several logs with power: gain, lags and dead time shared, all else each log's own.

A log's ambient, drift, initial state and loads are solved inside, the shared numbers searched. A log weighs by the
noise it has in the long run, so a long, noisy record does not outvote a short, quiet one.

Intervals of one heater behind several logs: profile likelihood and block bootstrap, as for one log.

Each log's residuals have their own size and colour; resampled blocks stay within their log.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from heatertune.model.least_squares import Minima, Residuals, minimise
from heatertune.model.power.open_loop import FixedUnknowns, PowerFit, PowerProblem, parameters_on_bounds
from heatertune.model.power.regressors import AMBIENT, GAIN
from heatertune.model.power.uncertainty import LEAST_FREEDOM, READINGS, STEPS, bound_crossing, colour
from heatertune.model.statistics import RATIO as PER_LAG
from heatertune.model.statistics import (
    Interval,
    ar1_bic,
    ar1_weighted,
    autocorrelation,
    block_resamples,
    envelope,
    hull,
    interval,
    student_t,
)

__all__ = [
    "DEAD",
    "FIRST_AMBIENT",
    "LAG",
    "POWER",
    "JointFit",
    "JointProblem",
    "joint_held_at",
    "joint_intervals",
]


Array = npt.NDArray[np.float64]

#: places in a vector: ln gain (or ln gain per lag), ln first lag, dead time, ratio of the second lag; then, where it is
#: sought beside what is shared, the first log's ambient
POWER, LAG, DEAD, SECOND, FIRST_AMBIENT = 0, 1, 2, 3, 4

_FAR_AMBIENT = 10.0  # spans of the first log, about its best ambient
_FAR = 1e3  # times the largest gain of a log alone, and its inverse of the least, the search goes no further
_MOST_CORRELATION = 0.99
_LEAST_NOISE = 1e-6  # of the span: a log made without noise does not outweigh all others without limit


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JointFit:
    """The best heater of one order for all logs.

    Attributes:
        vector: see the places above.
        parts: each log's own fit, with the shared numbers held.
    """

    vector: Array
    parts: tuple[PowerFit, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JointProblem:
    """Logs of one heater as a bounded least-squares problem.

    Shapes of the arrays: a vector of what is shared (4,), or (5,) with the first log's ambient, see the places above;
    starts (n, 4) or (n, 5); readings (m,), one log after the other, stacked (…, m).

    Attributes:
        parts: one problem for each log, all of one lag or all of two.
        weights: of each log, the inverse of its noise [1/°C].
        low, high: bounds of the shared vector.
    """

    parts: tuple[PowerProblem, ...]
    weights: Array
    low: Array
    high: Array

    @classmethod
    def of(cls, parts: Sequence[PowerProblem], fits: Sequence[PowerFit]) -> JointProblem:
        """Return the problem of logs whose fits alone are known."""
        gains = [math.log(fit.linear[GAIN]) for fit in fits]
        low = np.min([part.low for part in parts], axis=0)
        high = np.max([part.high for part in parts], axis=0)
        return cls(
            parts=tuple(parts), weights=np.array([1.0 / _noise(p, f) for p, f in zip(parts, fits, strict=True)]),
            low=np.array([min(gains) - math.log(_FAR), *low]),
            high=np.array([max(gains) + math.log(_FAR), *high]),
        )

    @property
    def records(self) -> Array:
        """The readings of all logs, one log after the other [°C], shape (m,)."""
        return np.concatenate([part.readings.temperature_degC for part in self.parts])

    def average(self, most: int) -> JointProblem:
        """Return the problem with each log's readings averaged to about `most`; neighbours' noise is taken as one."""
        parts = tuple(part.average(most) for part in self.parts)
        counts = [math.sqrt(len(a.readings.time_s) / len(b.readings.time_s))
                  for a, b in zip(self.parts, parts, strict=True)]
        return replace(self, parts=parts, weights=self.weights * np.array(counts))

    def split(self, stacked: Array) -> list[Array]:
        """Return the part of each log, along the last axis: of shape (…, m) as many of shape (…, m of the log)."""
        ends = np.cumsum([len(part.readings.time_s) for part in self.parts])
        return np.split(stacked, ends[:-1], axis=-1)

    def residuals(self, records: Array, *, per_lag: bool = False) -> Residuals:
        """Return the weighted residuals of all logs as `minimise` wants them.

        Args:
            records: readings, shape (n, m), of the row that a problem belongs to [°C].
            per_lag: whether the vector begins with the gain per first lag instead of the gain.
        """
        split = self.split(records)

        def answer(z: Array, rows: npt.NDArray[np.intp]) -> Array:
            gain = np.exp(z[:, POWER] + (z[:, LAG] if per_lag else 0.0))
            weighted = []
            for i, (part, weight, record) in enumerate(zip(self.parts, self.weights, split, strict=True)):
                fixed = part.nothing_more(len(z)).values
                fixed[:, GAIN] = gain
                if i == 0 and z.shape[1] > FIRST_AMBIENT:
                    fixed[:, AMBIENT] = z[:, FIRST_AMBIENT]
                own = np.ascontiguousarray(z[:, LAG : SECOND + 1])
                weighted.append(weight * part.solve(own, record[rows], FixedUnknowns(values=fixed))[0])
            return np.concatenate(weighted, axis=1)

        return answer

    def with_ambient(self, fit: JointFit) -> tuple[JointProblem, Array]:
        """Return the problem that seeks the first log's ambient beside what is shared, and the vector of a fit in it.

        Of shape (4,), or with that ambient (5,). The problem itself, where that ambient is known.
        """
        first = self.parts[0]
        if not math.isnan(first.fixed[AMBIENT]):
            return self, fit.vector
        best = float(fit.parts[0].linear[AMBIENT])
        reach = _FAR_AMBIENT * float(np.ptp(first.readings.temperature_degC))
        wider = replace(self, low=np.append(self.low, best - reach), high=np.append(self.high, best + reach))
        return wider, np.append(fit.vector, best)

    def refine(self, starts: Array) -> JointFit:
        """Return the best fit that the starts (n, p), vectors of what is shared, lead to."""
        records = np.tile(self.records, (len(starts), 1))
        minima = minimise(self.residuals(records), starts, self.low, self.high, tolerance=1e-9)
        return self.at(minima.parameters[int(np.argmin(minima.cost))])

    def far(self, fit: JointFit) -> JointFit:
        """Return the best fit whose time constant is the longest searched: the heater as an integrator."""
        longer = self.high[LAG] - fit.vector[LAG]
        start = fit.vector + np.array([longer, longer, 0.0, 0.0])
        high = np.where(np.arange(len(start)) == LAG, self.low, np.maximum(self.high, start))
        records = self.records[None, :]
        return self.at(minimise(self.residuals(records), start[None, :], self.low, high).parameters[0])

    def at(self, vector: Array) -> JointFit:
        """Return the fit at a shared vector (p,), its gain not per lag."""
        gain = math.exp(vector[POWER])
        return JointFit(vector=vector, parts=tuple(part.fit_held(vector[LAG:], gain) for part in self.parts))

    def on_bound(self, fit: JointFit) -> tuple[str, ...]:
        """Return the names of the lags and the dead time that ended on a bound of the search."""
        low, high, z = (vector[LAG:] for vector in (self.low, self.high, fit.vector))
        return parameters_on_bounds(z, low, high)

    def bic(self, fit: JointFit) -> float:
        """Return the criterion over all logs; what they share counts once."""
        shared = 3 + self.parts[0].two_lags
        own = sum(
            ar1_bic(part.readings.temperature_degC - part_fit.simulated_degC, part_fit.unknowns - shared)
            for part, part_fit in zip(self.parts, fit.parts, strict=True)
        )
        return own + shared * math.log(len(self.records))


def _noise(part: PowerProblem, fit: PowerFit) -> float:
    """Return the deviation that white noise of the same size in the long run would have [°C]."""
    record = part.readings.temperature_degC
    left = record - fit.simulated_degC
    rho = float(np.clip(autocorrelation(left, 1)[0], 0.0, _MOST_CORRELATION))
    return max(float(np.std(left)) * math.sqrt((1.0 + rho) / (1.0 - rho)), _LEAST_NOISE * float(np.ptp(record)))


_RESAMPLES = 200

#: of vectors, shape (n, 4) or (n, 5)
Measure = Callable[[Array], Array]

_MEASURES: dict[str, Measure] = {
    "gain_degC_per_pct": lambda z: np.exp(z[:, POWER]),
    "time_constant_s": lambda z: np.exp(z[:, LAG]),
    "dead_time_s": lambda z: z[:, DEAD],
    PER_LAG: lambda z: np.exp(z[:, POWER] - z[:, LAG]),
    "ambient_degC": lambda z: z[:, FIRST_AMBIENT],
}


def joint_intervals(problem: JointProblem, fit: JointFit, *, seed: int) -> dict[str, Interval]:
    """Return the 95 % interval of what the logs share, and of the first log's ambient where it is free.

    An end on a bound of the search is open.
    """
    thin, reported = problem.average(READINGS), problem.with_ambient(fit)[1]
    fit = thin.refine(fit.vector[None, :])
    wider, best = thin.with_ambient(fit)
    measures = {name: measure for name, measure in _MEASURES.items()
                if name != "ambient_degC" or len(best) > FIRST_AMBIENT}
    resampled = _bootstrap(wider, fit, best, seed)
    noise = _linear(wider, fit, best, measures)
    ends, intervals = _ends(wider), {}
    for name, measure in measures.items():
        shaken = interval(measure(resampled), *ends[name])
        profiled = _profile(wider, best, name, noise)
        intervals[name] = envelope(hull(shaken, profiled), [float(measure(reported[None, :])[0])])
    return intervals


def _ends(problem: JointProblem) -> dict[str, tuple[float, float]]:
    low, high = problem.low, problem.high
    return {
        "gain_degC_per_pct": (math.exp(low[POWER]), math.exp(high[POWER])),
        "time_constant_s": (math.exp(low[LAG]), math.exp(high[LAG])),
        "dead_time_s": (float(low[DEAD]), float(high[DEAD])),
        PER_LAG: (math.exp(low[POWER] - high[LAG]), math.exp(high[POWER] - low[LAG])),
        "ambient_degC": (float(low[-1]), float(high[-1])),
    }


def _bootstrap(problem: JointProblem, fit: JointFit, best: Array, seed: int) -> Array:
    """Return the vectors of resampled logs, shape (n, len(best))."""
    rng = np.random.default_rng(seed)
    made = np.concatenate([part.simulated_degC for part in fit.parts])
    left = problem.split(problem.records - made)
    records = made + np.concatenate([block_resamples(error, _RESAMPLES, rng) for error in left], axis=1)
    starts = np.tile(best, (_RESAMPLES, 1))
    return minimise(problem.residuals(records), starts, problem.low, problem.high, iterations=15).parameters


def _linear(
    problem: JointProblem, fit: JointFit, best: Array, measures: Mapping[str, Measure]
) -> dict[str, tuple[float, float]]:
    """Return of each number its deviation, and how far the sum of squares rises at the end of its 95 % interval.

    Under first-order autoregressive noise in each log. What is each log's own is solved inside, so the slopes of the
    residuals are already free of it (Frisch–Waugh).
    """
    free = np.flatnonzero(problem.high > problem.low)
    slopes = _slopes(problem, best, free)
    inverse = np.linalg.pinv(slopes.T @ slopes)
    middle, freedom = np.zeros_like(inverse), -float(len(free))
    for i, (part, weight, part_fit, slope) in enumerate(
        zip(problem.parts, problem.weights, fit.parts, problem.split(slopes.T), strict=True)
    ):
        left = part.readings.temperature_degC - part_fit.simulated_degC
        own = np.isnan(part.fixed)
        own[GAIN] = False  # shared
        own[AMBIENT] &= i > 0 or len(best) <= FIRST_AMBIENT
        columns = np.vstack([part.basis(part_fit.vector)[own], slope[np.any(slope != 0.0, axis=1)]])
        rho, variance = colour(left, np.linalg.qr(columns.T)[0])
        middle += weight**2 * variance * ar1_weighted(slope, rho) @ slope.T
        freedom += len(left) * (1.0 - rho) / (1.0 + rho) - np.count_nonzero(own)
    coloured = inverse @ middle @ inverse
    quantile = student_t(max(freedom, LEAST_FREEDOM))
    noise = {}
    for name, measure in measures.items():
        gradient = _gradient(measure, best)[free]
        spread = float(gradient @ coloured @ gradient)
        rise = quantile**2 * spread / max(float(gradient @ inverse @ gradient), 1e-300)
        noise[name] = math.sqrt(spread), rise
    return noise


def _slopes(problem: JointProblem, best: Array, free: npt.NDArray[np.intp]) -> Array:
    """Return the derivatives of the weighted residuals by the free numbers of the vector, shape (m, q)."""
    step = 1e-4 * (problem.high - problem.low)[free]
    count = np.arange(len(free))
    moved = np.tile(best, (2 * len(free), 1))
    up = np.minimum(best[free] + step, problem.high[free])
    down = np.maximum(best[free] - step, problem.low[free])
    moved[count, free], moved[len(free) + count, free] = up, down
    records = np.tile(problem.records, (len(moved), 1))
    answers = problem.residuals(records)(moved, np.arange(len(moved)))
    return np.asarray(((answers[: len(free)] - answers[len(free) :]) / (up - down)[:, None]).T)


def _gradient(measure: Measure, best: Array) -> Array:
    step, unit = 1e-6, np.eye(len(best))
    values = measure(best + step * np.vstack([unit, -unit]))
    return np.asarray((values[: len(best)] - values[len(best) :]) / (2.0 * step))


def _profile(problem: JointProblem, best: Array, name: str, noise: Mapping[str, tuple[float, float]]) -> Interval:
    """Return where the weighted sum of squares, all else fitted anew, has risen as far as the noise allows."""
    deviation, limit = noise[name]
    value = float(_MEASURES[name](best[None, :])[0])
    least = float(np.sum(problem.residuals(problem.records[None, :])(best[None, :], np.array([0])) ** 2))
    ends = []
    for side in (-1.0, 1.0):
        values = np.clip(value + side * deviation * STEPS, *_ends(problem)[name])
        rise = np.array([0.0, *np.maximum(_held(problem, best, name, values).cost - least, 0.0)])
        ends.append(bound_crossing(np.array([value, *values]), rise, limit))
    return Interval(low=ends[0], high=ends[1])


def joint_held_at(problem: JointProblem, fit: JointFit, name: str, value: float) -> JointFit:
    """Return one heater for all logs with one number held: dead time [s], or gain per time constant."""
    thin = problem.average(READINGS)
    vector = _held(thin, thin.refine(fit.vector[None, :]).vector, name, np.array([value])).parameters[0].copy()
    if name == PER_LAG:
        vector[POWER] += vector[LAG]
    return problem.at(vector)


def _held(problem: JointProblem, best: Array, name: str, values: Array) -> Minima:
    """Return the fits and least weighted sums of squares with the named number held at each value."""
    per_lag = name == PER_LAG
    place = {"time_constant_s": LAG, "dead_time_s": DEAD, "ambient_degC": FIRST_AMBIENT}.get(name, POWER)
    starts = np.tile(best, (len(values), 1))
    starts[:, place] = values if place in (DEAD, FIRST_AMBIENT) else np.log(values)
    high = problem.high.copy()
    high[place] = problem.low[place]  # held
    records = np.tile(problem.records, (len(values), 1))
    residuals = problem.residuals(records, per_lag=per_lag)
    return minimise(residuals, starts, problem.low, high, iterations=12)
