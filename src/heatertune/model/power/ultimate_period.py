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
    omega = 2.0 * np.pi / np.maximum(periods, 1e-300)
    turned = np.arctan(omega * np.exp(lag)) + np.arctan(omega * np.exp(lag) * ratio)
    z = np.stack([lag, (np.pi - turned) / omega, ratio], axis=-1)
    return z, np.all((z >= problem.low - 1e-12) & (z <= problem.high + 1e-12), axis=-1)
