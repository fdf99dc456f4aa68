"""Intervals of a fit with power: the wider of profile likelihood and block bootstrap; and the heaters at their ends.

Residuals of a heater are coloured, so the profile of the sum of squares is scaled until its curvature gives the
variance under first-order autoregressive noise (R. E. Chandler and S. Bate, "Inference for clustered data using the
independence loglikelihood", Biometrika 94 (2007) 167–183). The profile covers skewed and open intervals, the bootstrap
noise of any other colour.

Also the best fit at a fixed ultimate period, the parameter that limits every loop around a heater.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.log.log_values import Log
from heatertune.model.loss_curve import same_beyond
from heatertune.model.model_values import Candidate, Fopdt, Half, HeaterModel, disagreeing_parameters
from heatertune.model.power.disturbance_fit import bic_of
from heatertune.model.power.open_loop import FAR, FixedUnknowns, PowerFit, PowerProblem
from heatertune.model.power.regressors import AMBIENT, GAIN
from heatertune.model.reduction import ultimate_period_s
from heatertune.model.statistics import (
    PERIOD,
    RATIO,
    Interval,
    ar1_weighted,
    autocorrelation,
    block_resamples,
    envelope,
    fit_pct,
    hull,
    identified_parts,
    interval,
    student_t,
)

__all__ = [
    "LEAST_FREEDOM", "READINGS", "STEPS", "AtEnd", "ParameterNoise", "bound_crossing", "bounds_of", "colour",
    "distinct_candidates", "ends_of", "fit_at_value", "fits_of_period", "half_rule_by_draws", "halves_of",
    "hull_of_each", "intervals", "intervals_by",
    "noise_of", "parameters_with_ends", "periods_of", "reaches", "sensitivities", "squares_at", "value_of",
]


_LAGS: Final = 40  # on the grid, over all that the search allows
_RATIOS: Final = (0.01, 0.03, 0.1, 0.25, 0.5, 0.98)
_ZOOMS: Final = 4
_STEPS: Final = 100  # at most: far below the root each doubles the frequency


def periods_of(vectors: Array) -> Array:
    """Return the ultimate period of vectors (n, 3) of ln first lag, dead time and lag ratio [s], shape (n,).

    As `measures.ultimate_period_s`, but 0, the limit, without dead time.
    """
    lag, dead, ratio = np.exp(vectors[:, 0]), np.maximum(vectors[:, 1], 0.0), vectors[:, 2]
    delayed = np.where(dead > 0.0, dead, 1.0)
    # the angle is concave in the frequency: Newton's steps come from below and never pass the root
    frequency = np.pi / (delayed + lag * (1.0 + ratio))
    for _ in range(_STEPS):
        first, second = frequency * lag, frequency * lag * ratio
        missing = np.pi - (frequency * delayed + np.arctan(first) + np.arctan(second))
        more = missing / (delayed + lag / (1.0 + first**2) + lag * ratio / (1.0 + second**2))
        frequency += more
        if not (more > 1e-14 * frequency).any():
            break
    return np.where(dead > 0.0, 2.0 * np.pi / frequency, 0.0)


def fits_of_period(problem: PowerProblem, periods: Array) -> tuple[Array, Array]:
    """Return the vectors (n, 3) that fit best with each ultimate period [s], and their sums of squares (n,).

    Lags are tried on a grid, then on a finer one around the best; they and the period give the dead time. Values
    outside the bounds of the search are skipped; a period without a fit has an infinite cost. The periods are of shape
    (n,).
    """
    count = len(periods)
    best, cost = np.full((count, 3), np.nan), np.full(count, np.inf)
    lags = np.repeat(np.linspace(problem.low[0], problem.high[0], _LAGS)[:, None], count, axis=1)
    ratios = np.repeat((np.array(_RATIOS) if problem.two_lags else np.zeros(1))[:, None], count, axis=1)
    step, wide = float(lags[1, 0] - lags[0, 0]), 1.0
    for _ in range(_ZOOMS):
        z, inside = _vectors(problem, periods, lags, ratios)
        costs = np.full(inside.shape, np.inf)
        if inside.any():
            costs[inside] = problem.cost(z[inside], problem.readings.temperature_degC[None, :])
        place = np.argmin(costs, axis=0), np.arange(count)
        best, cost = np.where(np.isfinite(costs[place])[:, None], z[place], np.nan), costs[place]
        lags = best[:, 0] + step * np.linspace(-1.0, 1.0, 9)[:, None]
        near = np.linspace(-1.0, 1.0, 5 if problem.two_lags else 1)[:, None]
        ratios = np.clip(best[:, 2] * np.exp(wide * near), *problem.low[2:], *problem.high[2:])
        step, wide = step / 4.0, wide / 3.0
    return best, cost


def _vectors(problem: PowerProblem, periods: Array, lags: Array, ratios: Array) -> tuple[Array, npt.NDArray[np.bool_]]:
    """Return the vectors with these periods (n,) and lags (natural logarithms), and whether the bounds allow them.

    Lags (a, n) and ratios (b, n) are each period's own; vectors (a·b, n, 3), and (a·b, n): those of the same lags are
    side by side.
    """
    lag, ratio = (np.reshape(grid, (-1, len(periods))) for grid in np.broadcast_arrays(lags[:, None], ratios[None]))
    omega = 2.0 * np.pi / np.maximum(periods, 1e-200)  # its product with any lag of a log is still a number
    turned = np.arctan(omega * np.exp(lag)) + np.arctan(omega * np.exp(lag) * ratio)
    z = np.stack([lag, (np.pi - turned) / omega, ratio], axis=-1)
    return z, np.all((z >= problem.low - 1e-12) & (z <= problem.high + 1e-12), axis=-1)


_NAMES = ("gain_degC_per_pct", "time_constant_s", "dead_time_s", "ambient_degC")
#: averaged: neighbours of coloured noise say little more than their mean
READINGS = 400
_POSITIVE = ("gain_degC_per_pct", "time_constant_s", RATIO, PERIOD)
_RESAMPLES = 200
_SINGULAR = 1e-9  # of the largest singular value: rounding
#: of the noise, however coloured
LEAST_FREEDOM = 4.0
#: of a profile: standard deviations from the best
STEPS = np.array([0.6, 1.2, 1.7, 2.2, 3.0, 4.5, 8.0, 25.0])
_NEAR_STEPS = 4  # of them, that are tried first


@dataclass(frozen=True, slots=True)
class ParameterNoise:
    """Standard deviations of the parameters, inflation by colour, Student's 97.5 % point, unidentified parameters."""

    deviation: dict[str, float]
    inflation: dict[str, float]
    variance: float
    quantile: float
    unseen: frozenset[str]


def intervals(problem: PowerProblem, fit: PowerFit, *, seed: int) -> dict[str, Interval]:
    """Return the 95 % interval of each parameter, of gain per time constant and of the ultimate period.

    An end on a bound of the search is open, but for a bound of the dead time that the user knows.
    """
    return intervals_by(problem, fit, [{}], seed=seed)[0]


def intervals_by(
    problem: PowerProblem, fit: PowerFit, factors: Sequence[Mapping[str, float]], *, seed: int
) -> list[dict[str, Interval]]:
    """Return the intervals for each set of factors by which deviations are larger than the residuals say."""
    problem, reported = problem.average(READINGS), fit
    fit = problem.refine(fit.vector[None, :])
    noise, ends = noise_of(problem, fit), bounds_of(problem)
    drawn = {name: values for name, values in _bootstrap(problem, fit, seed).items() if name in noise.deviation}

    def interval_of(name: str, times: float) -> Interval:
        by_draws = interval(_spread(name, drawn[name], value_of(fit, name), times), *ends[name])
        by_profile = _profile(problem, fit, name, noise, times)
        return envelope(hull(by_draws, by_profile), [value_of(reported, name)])

    pairs = {(name, times.get(name, 1.0)) for times in factors for name in drawn}
    cache = {each: interval_of(*each) for each in pairs}
    wide = [{name: cache[name, times.get(name, 1.0)] for name in drawn} for times in factors]
    return [_capped(_beyond(intervals, reported), problem) for intervals in wide]


def _capped(intervals: dict[str, Interval], problem: PowerProblem) -> dict[str, Interval]:
    """Return the intervals with the end of the dead time that the user knows, where the log leaves it open."""
    dead, most = intervals["dead_time_s"], problem.most_dead_time_s
    return intervals if dead.high is not None or most is None else intervals | {"dead_time_s": replace(dead, high=most)}


def _beyond(intervals: dict[str, Interval], fit: PowerFit) -> dict[str, Interval]:
    """Return the intervals; an open time constant needs less gain per time constant than the longest one searched.

    Over the length of the log that one falls behind an integrator of the same rate by half its share on average.
    """
    lag = intervals.get("time_constant_s")
    if lag is None or lag.high is not None:
        return intervals
    return intervals | {RATIO: envelope(intervals[RATIO], [value_of(fit, RATIO) * (1.0 - 0.5 / FAR)])}


def _spread(name: str, values: Array, best: float, times: float) -> Array:
    """Return samples with their distance from the best scaled; positive parameters in the logarithm."""
    if name in _POSITIVE and best > 0.0:
        return np.asarray(best * np.maximum(values / best, 0.0) ** times)
    return best + times * (values - best)


def reaches(problem: PowerProblem, fit: PowerFit) -> dict[str, float]:
    """Return half the width of each parameter's 95 % interval by linear theory, under noise of the residuals' colour.

    It is infinite for indistinguishable parameters, such as gain and ambient under constant power.

    This is for comparisons; reported intervals come from `intervals`, which handles skewed and open ones.
    """
    noise = noise_of(problem, fit)
    return {name: math.inf if name in noise.unseen else noise.quantile * deviation
            for name, deviation in noise.deviation.items()}


def bounds_of(problem: PowerProblem) -> dict[str, tuple[float, float]]:
    """Return the bounds of the search for each number."""
    low, high = problem.low, problem.high
    return {
        "gain_degC_per_pct": (0.0, math.inf),
        "time_constant_s": (math.exp(low[0]), math.exp(high[0])),
        "dead_time_s": (float(low[1]), float(high[1])),
        "ambient_degC": (-math.inf, math.inf),
        RATIO: (0.0, math.inf),
        PERIOD: (0.0, math.inf),
    }


def half_rule_by_draws(
    problem: PowerProblem, fit: PowerFit, factors: Mapping[str, float], *, seed: int
) -> dict[str, Interval]:
    """Return the bootstrap's 95 % intervals of two lags as one by the half rule: both lags and the dead time move.

    Args:
        problem: of two lags.
        fit: of them.
        factors: parameter → factor by which deviations are larger than the residuals say.
        seed: of the bootstrap.
    """
    problem = problem.average(READINGS)
    fit = problem.refine(fit.vector[None, :])
    vectors, linear = _resampled_fits(problem, fit, seed)

    def half_rules(z: Array, gain: Array) -> dict[str, Array]:
        lag, half = np.exp(z[:, 0]), 0.5 * np.exp(z[:, 0]) * z[:, 2]
        return {"time_constant_s": lag + half, "dead_time_s": z[:, 1] + half, RATIO: gain / (lag + half)}

    best = half_rules(fit.vector[None, :], fit.linear[None, GAIN])
    return {name: interval(_spread(name, values, float(best[name][0]), factors.get(name, 1.0)), 0.0, math.inf)
            for name, values in half_rules(vectors, linear[:, GAIN]).items()}


def hull_of_each(ci95: Mapping[str, Interval], others: Mapping[str, Interval]) -> dict[str, Interval]:
    """Return the narrowest interval of each parameter that holds both; those of which there is no other stay."""
    return {name: hull(inside, others[name]) if name in others else inside for name, inside in ci95.items()}


def _resampled_fits(problem: PowerProblem, fit: PowerFit, seed: int) -> tuple[Array, Array]:
    """Return the vectors (n, 3) and linear parts (n, columns) of fits to the simulation with residuals in blocks."""
    shaken = block_resamples(
        problem.readings.temperature_degC - fit.simulated_degC, _RESAMPLES, np.random.default_rng(seed)
    )
    records = fit.simulated_degC + shaken
    z = problem.minimum(np.tile(fit.vector, (len(records), 1)), records)
    return z, problem.solve(z, records)[1]


def _bootstrap(problem: PowerProblem, fit: PowerFit, seed: int) -> dict[str, Array]:
    z, linear = _resampled_fits(problem, fit, seed)
    lag = np.exp(z[:, 0])
    values = (linear[:, GAIN], lag, z[:, 1], linear[:, AMBIENT], linear[:, GAIN] / lag, periods_of(z))
    return dict(zip((*_NAMES, RATIO, PERIOD), values, strict=True))


def noise_of(problem: PowerProblem, fit: PowerFit) -> ParameterNoise:
    """Return the effect of first-order autoregressive noise of the residuals' colour on the parameters."""
    jacobian, names = sensitivities(problem, fit)
    residuals = problem.readings.temperature_degC - fit.simulated_degC
    base, triangle = np.linalg.qr(jacobian)
    rho, variance = colour(residuals, base)
    inverse = np.linalg.pinv(triangle)
    white, coloured = inverse @ inverse.T, inverse @ (ar1_weighted(base.T, rho) @ base) @ inverse.T
    freedom = len(residuals) * (1.0 - rho) / (1.0 + rho) - jacobian.shape[1]
    weights = {name: np.eye(len(names))[names.index(name)] for name in _NAMES if name in names}
    gain, lag = value_of(fit, "gain_degC_per_pct"), value_of(fit, "time_constant_s")
    weights[RATIO] = weights["gain_degC_per_pct"] / lag - weights["time_constant_s"] * gain / lag**2
    weights[PERIOD] = sum(
        (np.eye(len(names))[names.index(name)] * slope for name, slope in _slopes_of_period(fit.vector).items()
         if name in names), start=np.zeros(len(names)))
    spread = {name: float(w @ coloured @ w) for name, w in weights.items()}
    return ParameterNoise(
        deviation={name: math.sqrt(variance * spread[name]) for name in weights},
        inflation={name: spread[name] / max(float(w @ white @ w), 1e-300) for name, w in weights.items()},
        variance=variance,
        quantile=student_t(max(freedom, LEAST_FREEDOM)),
        unseen=_unseen(triangle, weights),
    )


def _unseen(triangle: Array, weights: Mapping[str, Array]) -> frozenset[str]:
    """Return which numbers change along a direction that leaves the readings as they are."""
    size = np.linalg.norm(triangle, axis=0)
    scale = np.where(size > 0.0, size, 1.0)
    _, values, directions = np.linalg.svd(triangle / scale)
    null = directions[values < _SINGULAR * values[0]]
    return frozenset(
        name for name, weight in weights.items()
        if len(null) and np.linalg.norm(null @ (weight / scale)) > _SINGULAR**0.5 * np.linalg.norm(weight / scale))


def sensitivities(problem: PowerProblem, fit: PowerFit) -> tuple[Array, list[str]]:
    """Return the derivative of the temperature by each unknown, shape (m, p), and the unknowns' names."""
    free = np.flatnonzero(np.isnan(problem.fixed))
    column_names = {GAIN: "gain_degC_per_pct", AMBIENT: "ambient_degC"}
    names = [column_names.get(int(i), str(i)) for i in free]
    basis = [problem.basis(fit.vector)[i] for i in free]
    for k, name in enumerate(("time_constant_s", "dead_time_s", "lag_ratio")):
        if problem.high[k] == problem.low[k]:
            continue
        step = 1e-4 * (problem.high[k] - problem.low[k])
        up, down = fit.vector.copy(), fit.vector.copy()
        up[k], down[k] = min(up[k] + step, problem.high[k]), max(down[k] - step, problem.low[k])
        change = fit.linear @ (problem.basis(up) - problem.basis(down)) / (up[k] - down[k])
        basis.append(change / math.exp(fit.vector[0]) if k == 0 else change)
        names.append(name)
    return np.array(basis).T, names


def colour(residuals: Array, base: Array) -> tuple[float, float]:
    """Return lag-one correlation and variance of the noise that gives such residuals on average.

    A fit absorbs slow noise, so residuals look whiter and smaller than the noise: their expected value is computed for
    each correlation and compared.

    Args:
        residuals: shape (m,) [°C].
        base: orthonormal basis of what the fit can follow, shape (m, p).
    """
    m = len(residuals)
    lag_one = float(np.clip(autocorrelation(residuals, 1)[0], 0.0, 0.99))
    tried = np.array([0.0, 0.2, 0.4, 0.6, 0.7, 0.8, 0.85, 0.9, 0.93, 0.95, 0.97, 0.98, 0.99])
    mixed = ar1_weighted(base.T, tried[:, None, None])  # (tried, p, m)
    inner = mixed @ base
    left = m - np.trace(inner, axis1=1, axis2=2)
    numerator = (m - 1) * tried - np.sum(base[:-1].T * mixed[:, :, 1:] + base[1:].T * mixed[:, :, :-1], axis=(1, 2))
    looks = (numerator + np.sum(inner * (base[:-1].T @ base[1:]), axis=(1, 2))) / left
    rho = float(np.interp(lag_one, np.maximum.accumulate(looks), tried))
    return rho, float(residuals @ residuals) / float(np.interp(rho, tried, left))


def _profile(problem: PowerProblem, fit: PowerFit, name: str, noise: ParameterNoise, times: float = 1.0) -> Interval:
    """Return where the sum of squares, all other unknowns fitted again, has risen by the 95 % limit, times squared."""
    low, high = bounds_of(problem)[name]
    best = value_of(fit, name)
    limit = (times * noise.quantile) ** 2 * noise.inflation[name] * noise.variance
    least = problem.squares(fit)
    ends = []
    for side in (-1.0, 1.0):
        values = np.clip(best + side * times * noise.deviation[name] * STEPS, low, high)
        rise = np.zeros(1)
        for part in np.split(values, [_NEAR_STEPS]):  # most profiles pass the limit within the first
            rise = np.append(rise, np.maximum(squares_at(problem, fit, name, part) - least, 0.0))
            if not (rise < limit).all():
                break
        ends.append(bound_crossing(np.array([best, *values])[: len(rise)], rise, limit))
    return Interval(low=ends[0], high=ends[1])


def bound_crossing(values: Array, rise: Array, limit: float) -> float | None:
    """Return where the rise first exceeds the limit, None if it does not within the search.

    Args:
        values: tried, from the best one outwards, shape (k,).
        rise: of the sum of squares at each, 0 at the first, shape (k,).
        limit: of the rise.
    """
    over = np.flatnonzero(~(rise < limit))
    if not len(over):
        return None
    i = int(over[0])
    if i == 0:  # no noise at all: the rise at the best value is 0, and so is the limit
        return float(values[0])
    if not math.isfinite(rise[i]):
        return float(values[i - 1])
    a, b, c = math.sqrt(rise[i - 1]), math.sqrt(rise[i]), math.sqrt(limit)
    return float(values[i - 1] + (values[i] - values[i - 1]) * (c - a) / (b - a))


def _slopes_of_period(vector: Array) -> dict[str, float]:
    """Return the derivative of the ultimate period by first lag, dead time and lag ratio."""
    lag, dead, ratio = math.exp(vector[0]), float(vector[1]), float(vector[2])
    steps = {"time_constant_s": (1e-4, 0.0, 0.0), "dead_time_s": (0.0, 1e-4 * (dead + 1e-3 * lag), 0.0),
             "lag_ratio": (0.0, 0.0, 1e-4)}
    moved = np.array([(vector[0] + a, dead + b, ratio + c) for a, b, c in ((0.0, 0.0, 0.0), *steps.values())])
    base, *others = periods_of(moved).tolist()
    lengths = (lag * 1e-4, 1e-4 * (dead + 1e-3 * lag), 1e-4)
    return {name: (other - base) / length for name, other, length in zip(steps, others, lengths, strict=True)}


def fit_at_value(problem: PowerProblem, fit: PowerFit, name: str, value: float) -> PowerFit:
    """Return the fit with one number held: "dead_time_s" [s], gain per time constant or the ultimate period."""
    vectors, fixed, _ = _hold(problem, fit, name, np.array([value]))
    return problem.at(vectors[0], fixed)


def squares_at(problem: PowerProblem, fit: PowerFit, name: str, values: Array) -> Array:
    """Return the least sum of squares with the number, see `fit_at_value`, held at each value; both shape (n,)."""
    return _hold(problem, fit, name, values)[-1]


def _hold(problem: PowerProblem, fit: PowerFit, name: str, values: Array) -> tuple[Array, FixedUnknowns | None, Array]:
    """Return vectors, known unknowns and lowest sums of squares with the parameter fixed at each value."""
    if name == PERIOD:
        vectors, cost = fits_of_period(problem, values)
        return vectors, None, cost
    z = np.tile(fit.vector, (len(values), 1))
    records = problem.readings.temperature_degC[None, :]
    parameter_index = {"time_constant_s": 0, "dead_time_s": 1}.get(name)
    if parameter_index is not None:
        z[:, parameter_index] = np.log(values) if parameter_index == 0 else values

    unknowns = problem.nothing_more(len(values))
    if parameter_index is None:
        unknowns.values[:, AMBIENT if name == "ambient_degC" else GAIN] = values
    fixed = replace(unknowns, gain_per_lag=name == RATIO)
    z = problem.minimum(z, records, fixed, fixed_index=parameter_index, iterations=12)
    return z, fixed, problem.cost(z, records, fixed)


def value_of(fit: PowerFit, name: str) -> float:
    """Return a parameter of a fit, or its gain per time constant."""
    gain, lag = float(fit.linear[GAIN]), math.exp(fit.vector[0])
    return {
        "gain_degC_per_pct": gain, "ambient_degC": float(fit.linear[AMBIENT]), "time_constant_s": lag,
        "dead_time_s": float(fit.vector[1]), RATIO: gain / lag, PERIOD: float(periods_of(fit.vector[None, :])[0]),
    }[name]


_SAME: Final = 0.03  # of each number: such a heater adds nothing to a family
_ON_BOUND: Final = 0.99  # of the longest time constant that is searched
_HALVINGS: Final = 6  # of the way to an end that no heater has


class AtEnd(NamedTuple):
    """A heater with one number held: its fit [%], its error [°C], and its BIC above the best one's."""

    model: HeaterModel
    fit_pct: float
    rmse_degC: float
    bic: float = 0.0


#: name and value of a parameter → the heater with it fixed, or None
FitWithHeld = Callable[[str, float], AtEnd | None]


class _ParameterEnd(NamedTuple):
    name: str
    side: str
    what: str


_ENDS: Final = (
    _ParameterEnd("dead_time_s", "low", "dead time at its low end"),
    _ParameterEnd("dead_time_s", "high", "dead time at its high end"),
    _ParameterEnd(RATIO, "high", "gain per time constant at its high end"),
    _ParameterEnd(PERIOD, "low", "ultimate period at its low end"),
    _ParameterEnd(PERIOD, "high", "ultimate period at its high end"),
)


def ends_of(
    best: Candidate, values: Mapping[str, float], ci95: Mapping[str, Interval | None], fit_with_fixed: FitWithHeld, *,
    least_dead_time_s: float,
) -> Iterator[Candidate]:
    """Return the heater at each closed end of its intervals; a dead time without a low end is set to the minimum.

    If a value is impossible (the heater would cool while heated), the nearest possible one is used.

    Args:
        best: the candidate whose ends are computed.
        values: its own dead time, gain per time constant and ultimate period.
        ci95: their intervals.
        fit_with_fixed: name and value → the heater with this parameter fixed.
        least_dead_time_s: shortest plausible dead time.
    """
    for end in _ENDS:
        value = _value(ci95.get(end.name), end, least_dead_time_s)
        if value is not None and (at := _nearest(fit_with_fixed, end.name, values[end.name], value)) is not None:
            yield Candidate(
                model=at.model, log=best.log, window_s=best.window_s, law=best.law, fit_pct=at.fit_pct,
                rmse_degC=at.rmse_degC, delta_bic=best.delta_bic + at.bic, part=end.what)


def _nearest(fit_with_fixed: FitWithHeld, name: str, best: float, end: float) -> AtEnd | None:
    """Return the heater at an end, or as near to it as there is one on the way from the best value."""
    at, nearest, beyond = fit_with_fixed(name, end), best, end
    for _ in range(0 if at is not None else _HALVINGS):
        middle = 0.5 * (nearest + beyond)
        there = fit_with_fixed(name, middle)
        at, nearest, beyond = (at, nearest, middle) if there is None else (there, middle, beyond)
    return at


def parameters_with_ends(problem: PowerProblem, fit: PowerFit) -> tuple[Mapping[str, float], FitWithHeld]:
    """Return the parameters of a fit to one log that have ends, and a function that fixes one of them."""
    thin = problem.average(READINGS)
    best = thin.refine(fit.vector[None, :])
    record, least = thin.readings.temperature_degC, bic_of(thin, best)

    def held(name: str, value: float) -> AtEnd | None:
        at = fit_at_value(thin, best, name, value)
        if at.model is None:
            return None
        left = record - at.simulated_degC
        return AtEnd(at.model, fit_pct(record, at.simulated_degC), math.sqrt(float(left @ left) / len(left)),
                     max(bic_of(thin, at) - least, 0.0))

    return {name: value_of(best, name) for name in ("dead_time_s", RATIO, PERIOD)}, held


def _value(ci95: Interval | None, end: _ParameterEnd, least_dead_time_s: float) -> float | None:
    if ci95 is None:
        return None
    value = ci95.low if end.side == "low" else ci95.high
    if end.name != "dead_time_s":
        return value if value else None
    if end.side == "low":
        return max(value or 0.0, least_dead_time_s)
    return None if value is None else max(value, least_dead_time_s)


def halves_of(log: Log, halves: tuple[Half, Half], *, law: str) -> Iterator[Candidate]:
    """Return the heater of each half of a log, if both halves identify a parameter and disagree.

    A half whose time constant lies on the bound of its search gives no heater: the readings show no curvature, and the
    test sequence of such a heater would last for days. The log's intervals contain the results of that half.
    """
    apart = [name for name in disagreeing_parameters(halves)
             if all(identified_parts(half.ci95[name]) for half in halves)]
    if not apart:
        return
    for half, which in zip(halves, ("first", "second"), strict=True):
        start, end = half.window_s
        if half.values["time_constant_s"] >= _ON_BOUND * FAR * (end - start):
            continue
        yield Candidate(
            model=Fopdt(**half.values, ambient_degC=half.ambient_degC), log=log.name, window_s=half.window_s, law=law,
            fit_pct=half.fit_pct, rmse_degC=half.rmse_degC, delta_bic=0.0, part=f"{which} half alone",
        )


def distinct_candidates(candidates: Sequence[Candidate], least_dead_time_s: float) -> tuple[Candidate, ...]:
    """Return the candidates without the ends that differ from another one by less than 3 % in every number."""
    distinct = [candidate for candidate in candidates if not candidate.part]
    for candidate in candidates:
        if candidate.part and not any(_alike(candidate.model, other.model, least_dead_time_s) for other in distinct):
            distinct.append(candidate)
    return tuple(distinct)


def _alike(first: HeaterModel, second: HeaterModel, least_dead_time_s: float) -> bool:
    if len(first.lags_s) != len(second.lags_s) or not same_beyond(first, second):
        return False
    pairs = zip(_numbers(first, least_dead_time_s), _numbers(second, least_dead_time_s), strict=True)
    return all(abs(a - b) <= _SAME * max(abs(a), abs(b)) for a, b in pairs)


def _numbers(model: HeaterModel, least_dead_time_s: float) -> tuple[float, ...]:
    dead = max(model.dead_time_s, least_dead_time_s)
    gain, total = model.gain_degC_per_pct, sum(model.lags_s)
    return gain, gain / total, total, dead + sum(model.lags_s[1:]), ultimate_period_s(model)
