"""Whether what a fit leaves over still follows the power: the cross-correlation of residuals and power.

L. Ljung, "System Identification", 2nd ed., 1999, section 16.6: residuals that correlate with past power hold some of
the heater that the model does not. The correlation of two coloured series wanders far from zero on its own (M. S.
Bartlett, "Some aspects of the time-correlation problem in regard to tests of significance", J. R. Stat. Soc. 98 (1935)
536–543), so both are first filtered by what whitens the residuals (G. E. P. Box, G. M. Jenkins and G. C. Reinsel, "Time
Series Analysis", 3rd ed., 1994, section 11.2). A fit makes its residuals orthogonal to its own sensitivities, which
narrows the correlation of a right model; the limit is therefore taken from noise of the residuals' colour that went
through the same projection.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from heatertune.model.check_results import InputCorrelation
from heatertune.model.power.log_arrays import Readings
from heatertune.model.statistics import autocorrelation

__all__ = ["input_correlation"]

Array = npt.NDArray[np.float64]

_LAGS = 30
_ORDERS = 8  # of the autoregression that whitens the residuals
_DRAWN = 500
_SURE = 0.95
_NULLED = 0.7  # of the deviation of two unrelated series


def input_correlation(
    readings: Readings, residuals: Array, sensitivities: Array, *, before_pct: float, horizon_s: float, seed: int
) -> InputCorrelation | None:
    """Return how far the residuals follow the power, None where the power never changed within reach.

    Args:
        readings: with the power's edges.
        residuals: measured − simulated at the readings, shape (n,) [°C].
        sensitivities: derivative of the simulation by each fitted number, shape (n, p); p = 0: nothing was fitted.
        before_pct: power before the first reading [%].
        horizon_s: longest lag to look at [s].
        seed: of the noise that gives the limit.
    """
    spacing = float(np.median(np.diff(readings.time_s)))
    step = spacing * max(1, round(horizon_s / _LAGS / spacing))
    lags = step * np.arange(1, _LAGS + 1)  # at lag 0 a controller answers the reading, not the heater the power
    power = np.array([_mean_power(readings, lag, before_pct) for lag in lags])
    whitening = _whitening(residuals)
    inputs = _filtered(whitening, power)
    length = np.linalg.norm(inputs, axis=1)
    moved = length > 1e-9 * float(np.max(np.abs(power)) + 1.0) * np.sqrt(inputs.shape[1])
    if not np.any(moved):
        return None
    inputs, lags = inputs[moved] / length[moved, None], lags[moved]

    def correlations(errors: Array) -> Array:
        white = _filtered(whitening, errors)
        return np.asarray(white @ inputs.T / np.linalg.norm(white, axis=1)[:, None])

    noise = _coloured(whitening, np.random.default_rng(seed).normal(size=(_DRAWN, 2 * len(residuals))))
    by_chance = correlations(_projected(noise[:, len(residuals):], sensitivities))
    # a lag that the fit itself has nulled says nothing: what is left there is the arithmetic of the fit
    deviation = np.maximum(np.sqrt(np.mean(by_chance**2, axis=0)), _NULLED / np.sqrt(inputs.shape[1]))
    quantile = float(np.quantile(np.max(np.abs(by_chance) / deviation, axis=1), _SURE))
    observed = correlations(residuals[None, :])[0]
    worst = int(np.argmax(np.abs(observed) / deviation))
    return InputCorrelation(
        largest=float(observed[worst]), at_lag_s=float(lags[worst]), limit=quantile * float(deviation[worst]),
    )


def _mean_power(readings: Readings, lag_s: float, before_pct: float) -> Array:
    """Return the held power, so long before each reading, averaged as the reading is, shape (n,) [%]."""
    edges, levels = readings.edge_s, readings.level_pct
    held = np.concatenate([[before_pct], levels])
    energy = np.concatenate([[0.0], np.cumsum(levels[:-1] * np.diff(edges))])

    def total(instants: Array) -> Array:
        place = np.searchsorted(edges, instants, side="right")
        begun = np.maximum(place - 1, 0)
        return np.asarray(energy[begun] + held[place] * (instants - edges[begun]))

    middle, half = readings.time_s - lag_s, readings.half_s
    mean = (total(middle + half) - total(middle - half)) / np.maximum(2.0 * half, 1e-300)
    return np.where(half > 0.0, mean, held[np.searchsorted(edges, middle, side="right")])


def _whitening(residuals: Array) -> Array:
    """Return 1, −a₁, −a₂, … of the autoregression of the residuals; its order is the one of least BIC.

    The Yule–Walker equations by Levinson's recursion.
    """
    n = len(residuals)
    rho = np.concatenate([[1.0], autocorrelation(residuals, _ORDERS)])
    weights, variance = np.empty(0), 1.0
    best, chosen = 0.0, weights
    for order in range(1, len(rho)):
        last = (rho[order] - weights @ rho[order - 1 : 0 : -1]) / variance
        weights = np.append(weights - last * weights[::-1], last)
        variance *= 1.0 - last**2
        criterion = n * float(np.log(max(variance, 1e-12))) + order * float(np.log(n))
        if criterion < best:
            best, chosen = criterion, weights
    return np.concatenate([[1.0], -chosen])


def _filtered(whitening: Array, rows: Array) -> Array:
    """Return the rows through the filter, without its run-in and without their mean."""
    n = rows.shape[1] - len(whitening) + 1
    white = whitening[-1] * rows[:, :n]
    for k in range(1, len(whitening)):
        white += whitening[-1 - k] * rows[:, k : k + n]
    return np.asarray(white - white.mean(axis=1, keepdims=True))


def _coloured(whitening: Array, rows: Array) -> Array:
    """Return the rows as the autoregression that whitens makes them from white noise; SciPy's lfilter, bit for bit."""
    order = len(whitening) - 1
    columns = np.ascontiguousarray(rows.T)  # all rows take one step together
    owed = np.zeros((order + 1, rows.shape[0]))
    for k in range(len(columns)):
        columns[k] += owed[0]
        owed[:-1] = owed[1:] - whitening[1:, None] * columns[k]
    return np.ascontiguousarray(columns.T)


def _projected(errors: Array, sensitivities: Array) -> Array:
    """Return what a fit with these sensitivities leaves of errors (k, n)."""
    base, _ = np.linalg.qr(sensitivities)
    return np.asarray(errors - (errors @ base) @ base.T)
