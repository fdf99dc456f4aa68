"""A heater that warms with one time constant and cools with another (a fan, a lid, a Peltier element).

T' = (ambient + gain·power(t − dead time) − T)/time constant, where the time constant depends on the sign of the right
side. Between two edges the temperature runs towards its end without turning, so each stretch is one exponential.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from numba import njit

from heatertune.log.values import ABSOLUTE_ZERO_DEGC
from heatertune.model.least_squares import minimise
from heatertune.model.open_loop import PowerFit, PowerProblem
from heatertune.model.projection import AMBIENT, GAIN
from heatertune.model.values import Fopdt

__all__ = ["TwoRates", "fit_two_rates"]

Array = npt.NDArray[np.float64]
Rows = npt.NDArray[np.intp]

UNKNOWNS = 6


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TwoRates:
    """The two faces of one heater.

    Attributes:
        heating: as it warms.
        cooling: as it cools.
        simulated_degC: shape (n,).
        on_bound: whether a time constant ended on a bound: the log shows only one face.
        unknowns: number of fitted numbers.
    """

    heating: Fopdt
    cooling: Fopdt
    simulated_degC: Array
    on_bound: bool
    unknowns: int = UNKNOWNS


@njit(cache=True, nogil=True)
def _simulate(time, edges, levels, before, plants, out):  # type: ignore[no-untyped-def]
    """Fill out (n, m); a row of plants is gain, ambient, start, heating and cooling time constant, dead time."""
    for row in range(plants.shape[0]):
        gain, ambient, y, heating, cooling, dead = plants[row]
        acting = before
        now = time[0]
        j = -1
        for i in range(len(time)):
            while True:
                edge = edges[j + 1] + dead if j + 1 < len(edges) else math.inf
                until = min(time[i], edge)
                if until > now:
                    end = ambient + gain * acting
                    lag = heating if end > y else cooling
                    y = end + math.exp((now - until) / lag) * (y - end)
                    now = until
                if edge > time[i]:
                    break
                j += 1
                acting = levels[j]
            out[row, i] = y


def fit_two_rates(problem: PowerProblem, one: PowerFit) -> TwoRates:
    """Return the fit that the one-lag fit leads to."""
    r = problem.readings
    record = r.temperature_degC
    before = float(r.level_pct[0]) if problem.power_before_pct is None else problem.power_before_pct
    span = float(np.ptp(record))
    given = problem.ambient_degC
    ambient = float(one.linear[AMBIENT])
    low = np.array([math.log(1e-4), ambient - 2 * span, record[0] - span, problem.low[0], problem.low[0], 0.0])
    high = np.array([math.log(1e3), ambient + 2 * span, record[0] + span, *problem.high[[0, 0]], problem.high[1]])
    if given is not None:
        low[1] = high[1] = given
    starts = np.tile(
        [math.log(one.linear[GAIN]), ambient, record[0], one.vector[0], one.vector[0], one.vector[1]], (4, 1)
    )
    starts[1:, 3] += np.array([0.4, -0.4, 0.0])
    starts[1:, 4] += np.array([-0.4, 0.4, 0.4])

    def residuals(z: Array, _: Rows) -> Array:
        plants = z.copy()
        plants[:, [0, 3, 4]] = np.exp(z[:, [0, 3, 4]])
        out = np.empty((len(z), len(record)))
        _simulate(r.time_s, r.edge_s, r.level_pct, before, plants, out)
        return out - record

    minima = minimise(residuals, starts, low, high, iterations=60)
    best = minima.parameters[np.argmin(minima.cost)]
    gain, heating, cooling = (float(np.exp(best[i])) for i in (0, 3, 4))
    ambient_degC = float(best[1]) if best[1] >= ABSOLUTE_ZERO_DEGC else None
    heater, cooler = (
        Fopdt(gain_degC_per_pct=gain, time_constant_s=lag, dead_time_s=float(best[5]), ambient_degC=ambient_degC)
        for lag in (heating, cooling)
    )
    margin = 1e-3 * (high - low)[3]
    return TwoRates(
        heating=heater, cooling=cooler, simulated_degC=record + residuals(best[None, :], np.arange(1))[0],
        on_bound=bool(np.any((best[3:5] <= low[3:5] + margin) | (best[3:5] >= high[3:5] - margin))),
    )
