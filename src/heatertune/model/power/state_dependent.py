"""A heater whose time constant or gain depends on what it does: cooling faster than it warms, radiating, at a ceiling.

T' = (gain·power(t − dead time) − θ·(1 + loss·θ))/time constant, θ = T − ambient; the time constant is that of
warming where the right side is positive and that of cooling else; T is never above the ceiling, and a second lag
follows it. In a step so short that θ hardly moves all is exponential: exact where the loss does not grow.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from heatertune.compiled import compile_function
from heatertune.heater.exact import advance_step, factors
from heatertune.model.least_squares import minimise
from heatertune.model.power.open_loop import PowerFit, PowerProblem
from heatertune.model.power.regressors import AMBIENT, DRIFT, GAIN

__all__ = ["BEND", "CEILING", "COOLING", "LOSS", "BentHeater", "fit_bent_heater"]

Array = npt.NDArray[np.float64]
Rows = npt.NDArray[np.intp]

#: places in a vector: ln gain, ambient, first temperature, inner one above it, ln lag, ln of cooling's by warming's,
#: dead time, lag ratio, drift, loss times the span, ceiling
_GAIN, _AMBIENT, _START, _INNER, _LAG, COOLING, _DEAD, _RATIO, _DRIFT, LOSS, CEILING = range(11)
#: what may bend, and where the search for it begins
BEND = {COOLING: (-0.5, 0.5), LOSS: (0.3, 1.5), CEILING: (-0.02, -0.1)}

_READINGS = 250  # averaged, in the search
_STEPS = 12.0  # to a time constant, where the loss bends the answer
_MOST_LOSS = 20.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BentHeater:
    """The best heater of one bend.

    Attributes:
        gain_degC_per_pct, ambient_degC, dead_time_s: as of a linear heater; the gain is that at the ambient.
        lags_s: warming and cooling.
        ratio: of the second lag to the warming one, 0: none.
        loss_per_degC: growth of the loss with the temperature above the ambient.
        ceiling_degC: no temperature lies above.
        simulated_degC: shape (n,).
        unknowns: number of fitted numbers.
        on_bound: whether the bend ended on a bound of its search.
    """

    gain_degC_per_pct: float
    ambient_degC: float
    dead_time_s: float
    lags_s: tuple[float, float]
    ratio: float
    loss_per_degC: float
    ceiling_degC: float
    simulated_degC: Array
    unknowns: int
    on_bound: bool


def _advance(x: float, y: float, u: float, t: float, plant: Array) -> tuple[float, float]:
    """Return inner and outer temperature after t seconds with constant power; plant as in `_simulate`, here ambient."""
    gain, ambient, warming, cooling, second, loss, ceiling = plant
    while t > 0.0:
        stiff = 1.0 + loss * max(x - ambient, 0.0)
        end = ambient + gain * u / stiff
        lag = (warming if end > x else cooling) / stiff
        step = t if loss == 0.0 else min(t, lag / _STEPS)
        if second > 0.0:
            y, x = advance_step(y, x, end, factors(step, second, lag))
        else:
            x, _ = advance_step(x, x, end, factors(step, lag, 0.0))
        x = min(x, ceiling)
        y = x if second == 0.0 else min(y, ceiling)
        t -= step
    return x, y


def _simulate(
    time: Array, edges: Array, levels: Array, before: float, plants: Array, plant: Array, out: Array
) -> None:
    """Fill out (n, m); a row of plants is as `_answers` makes it, plant (7,) is working space."""
    for row in range(plants.shape[0]):
        gain, ambient, y, x, warming, cooling, dead, second, drift, loss, ceiling = plants[row]
        plant[0], plant[2], plant[3], plant[4], plant[5], plant[6] = gain, warming, cooling, second, loss, ceiling
        acting, now, j = before, time[0], -1
        for i in range(len(time)):
            while True:
                edge = edges[j + 1] + dead if j + 1 < len(edges) else math.inf
                until = min(time[i], edge)
                if until > now:
                    plant[1] = ambient + drift * (0.5 * (now + until) - time[0])
                    x, y = _advance(x, y, acting, until - now, plant)
                    now = until
                if edge > time[i]:
                    break
                j += 1
                acting = levels[j]
            out[row, i] = y


def fit_bent_heater(problem: PowerProblem, near: PowerFit, bend: int) -> BentHeater:
    """Return the heater with one bend, see `BEND`, that a linear fit leads to."""
    coarse = problem.average(_READINGS)
    record = coarse.readings.temperature_degC
    low, high = _bounds(problem, near, bend)
    starts = _starts(problem, near, bend)

    def residuals(z: Array, _: Rows) -> Array:
        return _answers(coarse, z) - record

    minima = minimise(residuals, starts, low, high, iterations=40)
    best = minima.parameters[np.argmin(minima.cost)]
    gain, lag = (float(np.exp(best[i])) for i in (_GAIN, _LAG))
    span, highest = _span(problem)
    margin = 1e-3 * (high - low)[bend]
    return BentHeater(
        gain_degC_per_pct=gain, ambient_degC=float(best[_AMBIENT]), dead_time_s=float(best[_DEAD]),
        lags_s=(lag, lag * math.exp(best[COOLING])), ratio=float(best[_RATIO]),
        loss_per_degC=float(best[LOSS]) / span, ceiling_degC=highest + float(best[CEILING]) * span,
        simulated_degC=_answers(problem, best[None, :])[0], unknowns=int(np.count_nonzero(high > low)),
        on_bound=not low[bend] + margin < best[bend] < high[bend] - margin,
    )


def _span(problem: PowerProblem) -> tuple[float, float]:
    readings = problem.readings.temperature_degC
    return float(np.ptp(readings)), float(readings.max())


def _bounds(problem: PowerProblem, near: PowerFit, bend: int) -> tuple[Array, Array]:
    span, _ = _span(problem)
    first, ambient = float(near.simulated_degC[0]), float(near.linear[AMBIENT])
    low, high = np.zeros(11), np.zeros(11)
    low[_GAIN], high[_GAIN] = math.log(1e-4), math.log(1e3)
    low[_AMBIENT], high[_AMBIENT] = min(ambient, first) - span, max(ambient, first) + span
    if problem.ambient_degC is not None:
        low[_AMBIENT] = high[_AMBIENT] = problem.ambient_degC
    low[_START], high[_START] = first - span, first + span
    if problem.two_lags:
        low[_INNER], high[_INNER] = -span, span
    low[[_LAG, _DEAD, _RATIO]], high[[_LAG, _DEAD, _RATIO]] = problem.low, problem.high
    if problem.drift:
        most = span / float(np.ptp(problem.readings.time_s))
        low[_DRIFT], high[_DRIFT] = -most, most
    high[CEILING] = low[CEILING] = 1e3  # spans above the highest reading: none
    low[bend], high[bend] = {COOLING: (-2.5, 2.5), LOSS: (0.0, _MOST_LOSS), CEILING: (-0.5, 0.05)}[bend]
    return low, high


def _starts(problem: PowerProblem, near: PowerFit, bend: int) -> Array:
    z = np.zeros(11)
    gain, first = float(near.linear[GAIN]), float(near.simulated_degC[0])
    z[[_GAIN, _AMBIENT, _START, _DRIFT]] = math.log(max(gain, 2e-4)), near.linear[AMBIENT], first, near.linear[DRIFT]
    z[[_LAG, _DEAD, _RATIO]] = near.vector
    z[CEILING] = 1e3
    starts = np.tile(z, (4, 1))
    starts[:, bend] = [*BEND[bend], *BEND[bend]]
    if bend != COOLING:  # a bend hides gain, and lag with it
        starts[2:, _GAIN] += 0.5
        starts[2:, _LAG] += 0.5
        starts[2:, _AMBIENT] = problem.readings.temperature_degC.min()
    else:
        starts[2:, _LAG] += [0.4, -0.4]
    return starts


def _answers(problem: PowerProblem, z: Array) -> Array:
    """Return the readings of each vector, shape (n, m) [°C]."""
    span, highest = _span(problem)
    gain, lag = np.exp(z[:, _GAIN]), np.exp(z[:, _LAG])
    plants = np.column_stack([
        gain, z[:, _AMBIENT], z[:, _START], z[:, _START] + z[:, _INNER], lag, lag * np.exp(z[:, COOLING]), z[:, _DEAD],
        z[:, _RATIO] * lag, z[:, _DRIFT], z[:, LOSS] / span, highest + z[:, CEILING] * span,
    ])
    r = problem.readings
    out = np.empty((len(z), len(r.time_s)))
    compile_function(_simulate)(r.time_s, r.edge_s, r.level_pct, problem.power_before, plants, np.empty(7), out)
    return out
