"""A heater whose gain depends on the power: its effective power is a rising curve through the logged levels.

The curve is a broken line whose slopes, the gain of each stretch of power, enter the temperature linearly; so only lags
and dead time are searched, as for a constant gain.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from heatertune.model.least_squares import minimise
from heatertune.model.power.open_loop import PowerFit, PowerProblem
from heatertune.model.power.regressors import AMBIENT, DRIFT, FIRST_STATE, GAIN, SECOND_STATE

__all__ = ["InputCurve", "fit_input_curve", "knots_of"]

Array = npt.NDArray[np.float64]
Rows = npt.NDArray[np.intp]

_READINGS = 250  # averaged, in the search
_KNOTS = 5  # of more levels than _LEVELS, at quantiles
_LEVELS = 8
_APART = 0.1  # of the range of the power: nearer knots tell no slope
_SPREAD = np.array([0.0, 0.4, -0.4])  # of ln lag, of the starts


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class InputCurve:
    """The best broken line.

    Attributes:
        knots_pct: powers at which the gain changes, the least and the greatest included, shape (k + 1,).
        gains_degC_per_pct: between them, none negative, shape (k,).
        vector: ln first lag, dead time, lag ratio.
        simulated_degC: shape (n,).
        unknowns: number of fitted numbers.
    """

    knots_pct: Array
    gains_degC_per_pct: Array
    vector: Array
    simulated_degC: Array
    unknowns: int


def knots_of(problem: PowerProblem) -> Array:
    """Return the powers between which a gain can be told: the logged levels, or quantiles of many; shape (k,) [%]."""
    readings = problem.readings
    held = np.diff(readings.edge_s, append=max(readings.time_s[-1], readings.edge_s[-1]))
    levels = np.append(readings.level_pct[held > 0.0], problem.power_before)
    values = np.unique(levels)
    if len(values) > _LEVELS:
        order = np.argsort(readings.level_pct)
        shares = np.cumsum(held[order]) / held.sum()
        inner = np.interp(np.linspace(0.0, 1.0, _KNOTS)[1:-1], shares, readings.level_pct[order])
        values = np.unique([values[0], *inner, values[-1]])
    apart = _APART * (values[-1] - values[0])
    kept = [float(values[0])]
    for value in values[1:-1]:
        if value - kept[-1] > apart and values[-1] - value > apart:
            kept.append(float(value))
    return np.array([*kept, values[-1]] if values[-1] > values[0] else kept)


def fit_input_curve(problem: PowerProblem, near: PowerFit) -> InputCurve | None:
    """Return the best curve that a fit of constant gain leads to, None where the log holds two powers only."""
    knots = knots_of(problem)
    if len(knots) < 3:
        return None
    coarse = problem.average(_READINGS)
    ramps = [_ramp(coarse, *ends) for ends in pairwise(knots)]
    record = coarse.readings.temperature_degC

    def residuals(z: Array, _: Rows) -> Array:
        return np.array([_solved(coarse, ramps, row)[1] for row in z]) - record

    starts = near.vector + np.outer(_SPREAD, [1.0, 0.0, 0.0])
    minima = minimise(residuals, starts, problem.low, problem.high, iterations=25)
    best = minima.parameters[np.argmin(minima.cost)]
    ramps = [_ramp(problem, *ends) for ends in pairwise(knots)]
    gains, simulated = _solved(problem, ramps, best)
    free = int(np.isnan(problem.fixed).sum()) - 1
    return InputCurve(
        knots_pct=knots, gains_degC_per_pct=gains, vector=best, simulated_degC=simulated,
        unknowns=2 + problem.two_lags + free + len(gains),
    )


def _ramp(problem: PowerProblem, low_pct: float, high_pct: float) -> PowerProblem:
    """Return the problem with nothing but the power between two knots."""
    readings = problem.readings
    return replace(
        problem, loads_s=(), power_before_pct=float(np.clip(problem.power_before, low_pct, high_pct)) - low_pct,
        readings=replace(readings, level_pct=np.clip(readings.level_pct, low_pct, high_pct) - low_pct),
    )


def _solved(problem: PowerProblem, ramps: list[PowerProblem], z: Array) -> tuple[Array, Array]:
    """Return gains and temperature for lags and dead time; a gain that would be negative is none."""
    own = ramps[0].basis(z)
    linear = problem.fixed
    fixed = np.where(np.isnan(linear[: len(own)]), 0.0, linear[: len(own)])
    fixed[GAIN] = 0.0
    given = fixed @ own
    free = [place for place in (AMBIENT, DRIFT, FIRST_STATE, SECOND_STATE) if math.isnan(linear[place])]
    rising = [own[GAIN], *(ramp.basis(z)[GAIN] for ramp in ramps[1:])]
    columns = np.array([*rising, *own[free]])
    gains = np.zeros(len(rising))
    taken = np.arange(len(columns))
    while True:
        chosen = columns[taken]
        weights, *_ = np.linalg.lstsq(chosen.T, problem.readings.temperature_degC - given, rcond=None)
        bad = (taken < len(rising)) & (weights < 0.0)
        if not bad.any():
            break
        taken = np.delete(taken, np.argmin(np.where(bad, weights, 0.0)))
    here = taken < len(rising)
    gains[taken[here]] = weights[here]
    return gains, given + weights @ chosen
