"""Intervals of one heater behind several logs: profile likelihood and block bootstrap, as for one log.

Each log's residuals have their own size and colour; resampled blocks stay within their log.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from scipy.special import stdtrit

from heatertune.model.intervals import RATIO as PER_LAG
from heatertune.model.intervals import envelope, hull, interval
from heatertune.model.joint import DEAD, LAG, POWER, JointFit, JointProblem
from heatertune.model.least_squares import minimise
from heatertune.model.projection import AMBIENT, GAIN
from heatertune.model.statistics import block_resamples
from heatertune.model.uncertainty import LEAST_FREEDOM, STEPS, colour, crossing
from heatertune.model.values import Interval

__all__ = ["joint_intervals"]

Array = npt.NDArray[np.float64]

_READINGS = 400  # averaged, of each log
_RESAMPLES = 200

#: shared number → its value in vectors (n, 4)
_MEASURES: dict[str, Callable[[Array], Array]] = {
    "gain_degC_per_pct": lambda z: np.exp(z[:, POWER]),
    "time_constant_s": lambda z: np.exp(z[:, LAG]),
    "dead_time_s": lambda z: z[:, DEAD],
    PER_LAG: lambda z: np.exp(z[:, POWER] - z[:, LAG]),
}


def joint_intervals(problem: JointProblem, fit: JointFit, *, seed: int) -> dict[str, Interval]:
    """Return the 95 % interval of what the logs share, and of the first log's ambient where it is free.

    An end on a bound of the search is open. The ambient's is of the bootstrap alone.
    """
    problem, told = problem.thinned(_READINGS), fit
    fit = problem.refined(fit.vector[None, :])
    vectors, ambients = _bootstrap(problem, fit, seed)
    deviation, rise, quantile = _linear(problem, fit)
    found = {}
    for name, measure in _MEASURES.items():
        best = float(measure(fit.vector[None, :])[0])
        low, high = _ends(problem)[name]
        resampled = interval(measure(vectors), low, high)
        limit = quantile**2 * rise[name]
        profiled = _profile(problem, fit, name, (best, low, high), deviation[name], limit)
        found[name] = envelope(hull(resampled, profiled), [float(measure(told.vector[None, :])[0])])
    if math.isnan(problem.parts[0].known[AMBIENT]):
        free = interval(ambients, -math.inf, math.inf)
        found["ambient_degC"] = envelope(free, [float(told.parts[0].linear[AMBIENT])])
    return found


def _ends(problem: JointProblem) -> dict[str, tuple[float, float]]:
    low, high = problem.low, problem.high
    return {
        "gain_degC_per_pct": (math.exp(low[POWER]), math.exp(high[POWER])),
        "time_constant_s": (math.exp(low[LAG]), math.exp(high[LAG])),
        "dead_time_s": (float(low[DEAD]), float(high[DEAD])),
        PER_LAG: (0.0, math.inf),
    }


def _bootstrap(problem: JointProblem, fit: JointFit, seed: int) -> tuple[Array, Array]:
    """Return shared vectors (n, 4) and the first log's ambient (n,) of resampled logs."""
    rng = np.random.default_rng(seed)
    made = np.concatenate([part.simulated_degC for part in fit.parts])
    left = problem.split(problem.records - made)
    records = made + np.concatenate([block_resamples(each, _RESAMPLES, rng) for each in left], axis=1)
    starts = np.tile(fit.vector, (_RESAMPLES, 1))
    found = minimise(problem.residuals(records), starts, problem.low, problem.high, iterations=15).parameters
    first = problem.parts[0]
    known = first.nothing_more(_RESAMPLES)
    known.values[:, GAIN] = np.exp(found[:, POWER])
    linear = first.solve(found[:, LAG:], problem.split(records)[0], known)[1]
    return found, linear[:, AMBIENT]


def _linear(problem: JointProblem, fit: JointFit) -> tuple[dict[str, float], dict[str, float], float]:
    """Return each number's deviation, the mean rise of the sum of squares at one of them, and Student's 97.5 % point.

    Under first-order autoregressive noise in each log. What is each log's own is solved inside, so the slopes of the
    residuals are already free of it (Frisch–Waugh).
    """
    free = np.flatnonzero(problem.high > problem.low)
    slopes = _slopes(problem, fit, free)
    inverse = np.linalg.pinv(slopes.T @ slopes)
    middle, freedom = np.zeros_like(inverse), -float(len(free))
    for part, weight, each, slope in zip(
        problem.parts, problem.weights, fit.parts, problem.split(slopes.T), strict=True
    ):
        left = part.readings.temperature_degC - each.simulated_degC
        own = part.basis(each.vector)[np.isnan(part.known)]
        base, _ = np.linalg.qr(np.vstack([own, slope]).T)
        rho, variance = colour(left, base)
        lags = np.abs(np.subtract.outer(np.arange(len(left)), np.arange(len(left))))
        middle += weight**2 * variance * slope @ rho**lags @ slope.T
        freedom += len(left) * (1.0 - rho) / (1.0 + rho) - len(own) + 1.0  # the gain is shared
    coloured = inverse @ middle @ inverse
    deviation, rise = {}, {}
    for name, measure in _MEASURES.items():
        gradient = _gradient(measure, fit.vector)[free]
        spread = float(gradient @ coloured @ gradient)
        deviation[name] = math.sqrt(spread)
        rise[name] = spread / max(float(gradient @ inverse @ gradient), 1e-300)
    return deviation, rise, float(stdtrit(max(freedom, LEAST_FREEDOM), 0.975))


def _slopes(problem: JointProblem, fit: JointFit, free: npt.NDArray[np.intp]) -> Array:
    """Return the derivatives of the weighted residuals by the free shared numbers, shape (m, q)."""
    step = 1e-4 * (problem.high - problem.low)[free]
    moved = np.tile(fit.vector, (2 * len(free), 1))
    up = np.minimum(fit.vector[free] + step, problem.high[free])
    down = np.maximum(fit.vector[free] - step, problem.low[free])
    moved[np.arange(len(free)), free], moved[len(free) + np.arange(len(free)), free] = up, down
    records = np.tile(problem.records, (len(moved), 1))
    answers = problem.residuals(records)(moved, np.arange(len(moved)))
    return np.asarray(((answers[: len(free)] - answers[len(free) :]) / (up - down)[:, None]).T)


def _gradient(measure: Callable[[Array], Array], vector: Array) -> Array:
    step = 1e-6
    moved = vector + step * np.vstack([np.eye(4), -np.eye(4)])
    values = measure(moved)
    return np.asarray((values[:4] - values[4:]) / (2.0 * step))


def _profile(
    problem: JointProblem, fit: JointFit, name: str, place: tuple[float, float, float], deviation: float, limit: float
) -> Interval:
    """Return where the weighted sum of squares, all else fitted anew, has risen by the limit.

    `place`: best value, and the ends of the search.
    """
    best, low, high = place
    least = float(np.sum(problem.residuals(problem.records[None, :])(fit.vector[None, :], np.array([0])) ** 2))
    found = []
    for side in (-1.0, 1.0):
        values = np.clip(best + side * deviation * STEPS, max(low, 1e-300) if name != "dead_time_s" else low, high)
        rise = np.array([0.0, *np.maximum(_held(problem, fit, name, values) - least, 0.0)])
        found.append(crossing(np.array([best, *values]), rise, limit))
    return Interval(low=found[0], high=found[1])


def _held(problem: JointProblem, fit: JointFit, name: str, values: Array) -> Array:
    """Return the least weighted sum of squares with the named number held at each value."""
    per_lag = name == PER_LAG
    place = {"time_constant_s": LAG, "dead_time_s": DEAD}.get(name, POWER)
    starts = np.tile(fit.vector, (len(values), 1))
    starts[:, place] = values if place == DEAD else np.log(values)
    low = problem.low.copy()
    high = problem.high.copy()
    if per_lag:
        low[POWER], high[POWER] = low[POWER] - high[LAG], high[POWER] - low[LAG]
    high[place] = low[place]
    records = np.tile(problem.records, (len(values), 1))
    return minimise(problem.residuals(records, per_lag=per_lag), starts, low, high, iterations=12).cost
