"""The best fit with the ultimate period held: the one number of a heater that limits every loop around it."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from heatertune.model.power.open_loop import PowerProblem

__all__ = ["fits_of_period", "periods_of"]

Array = npt.NDArray[np.float64]

_LAGS: Final = 40  # on the grid, over all that the search allows
_RATIOS: Final = (0.01, 0.03, 0.1, 0.25, 0.5, 0.98)
_ZOOMS: Final = 4
_STEPS: Final = 100  # at most: far below the root each doubles the frequency


def periods_of(vectors: Array) -> Array:
    """Return the ultimate period of vectors (n, 3) of ln first lag, dead time and lag ratio [s], shape (n,).

    As `measures.ultimate_period_s`, but 0 without dead time: what it comes near as the dead time vanishes.
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

    Lags are tried on a grid, then finer around the best; they and the period give the dead time. What the bounds of
    the search do not allow is no fit; a period without one costs infinitely. The periods are of shape (n,).
    """
    first = np.array(_RATIOS) if problem.two_lags else np.zeros(1)
    best, cost = np.full((len(periods), 3), np.nan), np.full(len(periods), np.inf)
    for i, period in enumerate(periods.tolist()):
        lags, ratios = np.linspace(problem.low[0], problem.high[0], _LAGS), first
        step, wide = float(lags[1] - lags[0]), 1.0
        for _ in range(_ZOOMS):
            z = _vectors(problem, period, lags, ratios)
            costs = problem.cost(z, np.tile(problem.readings.temperature_degC, (len(z), 1)))
            if not len(costs) or not np.isfinite(costs).any():
                break
            place = int(np.argmin(costs))
            best[i], cost[i] = z[place], costs[place]
            lags = best[i, 0] + step * np.linspace(-1.0, 1.0, 9)
            near = best[i, 2] * np.exp(wide * np.linspace(-1.0, 1.0, 5))
            ratios = np.unique(np.clip(near, *problem.low[2:], *problem.high[2:]))
            step, wide = step / 4.0, wide / 3.0
    return best, cost


def _vectors(problem: PowerProblem, period: float, lags: Array, ratios: Array) -> Array:
    """Return the vectors with this period and these lags (natural logarithms) whose dead time the bounds allow."""
    lag, ratio = (grid.ravel() for grid in np.meshgrid(lags, ratios))
    omega = 2.0 * np.pi / max(period, 1e-300)
    turned = np.arctan(omega * np.exp(lag)) + np.arctan(omega * np.exp(lag) * ratio)
    z = np.column_stack([lag, (np.pi - turned) / omega, ratio])
    inside = np.all((z >= problem.low - 1e-12) & (z <= problem.high + 1e-12), axis=1)
    return np.ascontiguousarray(z[inside])
