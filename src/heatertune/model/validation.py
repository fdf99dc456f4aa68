"""Accuracy of a fit on readings that it has not used, and a whiteness test of its residuals."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.model.least_squares import minimise
from heatertune.model.statistics import autocorrelation

if TYPE_CHECKING:
    from heatertune.model.temperature.closed_loop import Hypothesis

__all__ = ["LJUNG_BOX_95", "constant_rmse", "cross_rmse", "hold_out_rmse", "ljung_box"]


#: 95 % point of χ² with 20 degrees of freedom
LJUNG_BOX_95: Final = 31.41

_FOLDS, _BLOCKS = 5, 20  # each fold leaves out every fifth of twenty blocks: longer than the residuals remember


def ljung_box(residuals: Array, lags: int = 20) -> float:
    """Return n(n + 2)·Σ ρₖ²/(n − k) over the lags; white residuals stay below `LJUNG_BOX_95` in 95 of 100 logs.

    G. M. Ljung and G. E. P. Box, "On a measure of lack of fit in time series models", Biometrika 65 (1978) 297–303.
    The residuals are of shape (n,).
    """
    n = len(residuals)
    rho = autocorrelation(residuals, lags)
    return float(n * (n + 2) * np.sum(rho**2 / (n - np.arange(1, len(rho) + 1))))


def hold_out_rmse(hypothesis: Hypothesis, early: Hypothesis, vector: Array) -> float:
    """Return the error on the readings after `early`, which `vector`, shape (p,), was fitted to [°C]."""
    whole = hypothesis.without_events()
    error = whole.simulate(vector[None, :])[0] - whole.measured
    return _rms(np.concatenate(_later(hypothesis, early, error)))


def constant_rmse(hypothesis: Hypothesis, early: Hypothesis) -> float:
    """Return the error of predicting the same readings by their mean [°C]: a larger error means no predictive value."""
    return _rms(np.concatenate([part - part.mean() for part in _later(hypothesis, early, hypothesis.measured)]))


def cross_rmse(hypothesis: Hypothesis, vector: Array) -> float:
    """Return the prediction error on blocks of readings omitted from the fit, each block once [°C].

    The first block of a log is never omitted, because it defines the initial state. Each fit starts at `vector`, shape
    (p,).
    """
    measured = hypothesis.measured
    rows = [len(segment.log.time_s) for segment in hypothesis.segments]
    block = np.concatenate([np.arange(n) * _BLOCKS // n for n in rows])
    left_out = np.array([(block % _FOLDS == fold) & (block > 0) for fold in range(_FOLDS)])

    def residuals(z: Array, rows: npt.NDArray[np.intp]) -> Array:
        return np.where(left_out[rows], 0.0, hypothesis.simulate(z) - measured)

    starts = np.repeat(vector[None, :], _FOLDS, axis=0)
    refits = minimise(residuals, starts, hypothesis.low, hypothesis.high, iterations=15).parameters
    return _rms((hypothesis.simulate(refits) - measured)[left_out])


def _later(hypothesis: Hypothesis, early: Hypothesis, values: Array) -> list[Array]:
    """Return each log's part of the values after its beginning."""
    seen = [len(segment.log.time_s) for segment in early.segments]
    return [part[n:] for part, n in zip(hypothesis.parts(values), seen, strict=True)]


def _rms(error: Array) -> float:
    return float(np.sqrt(np.mean(error**2)))
