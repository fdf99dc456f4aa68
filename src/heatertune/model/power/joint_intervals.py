"""Intervals of one heater behind several logs: profile likelihood and block bootstrap, as for one log.

Each log's residuals have their own size and colour; resampled blocks stay within their log.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
import numpy.typing as npt

from heatertune.model.intervals import RATIO as PER_LAG
from heatertune.model.intervals import Interval, envelope, hull, interval
from heatertune.model.least_squares import Minima, minimise
from heatertune.model.power.joint import DEAD, FIRST_AMBIENT, LAG, POWER, JointFit, JointProblem
from heatertune.model.power.regressors import AMBIENT, GAIN
from heatertune.model.power.uncertainty import LEAST_FREEDOM, READINGS, STEPS, bound_crossing, colour
from heatertune.model.statistics import ar1_weighted, block_resamples, student_t

__all__ = ["joint_held_at", "joint_intervals"]

Array = npt.NDArray[np.float64]

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
