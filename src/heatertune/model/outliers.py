"""Readings that lie off their neighbours, and the sensor's own step.

The loss is Huber's, by his modified residuals (P. J. Huber, Robust Statistics, Wiley 1981, section 7.8): a reading
too far off is pulled to the limit and the least-squares fit repeated. "Off" is measured against the running median
of the residuals, and of the readings themselves: what the model cannot follow for a while is no outlier.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.ndimage import median_filter

__all__ = ["pulled_in", "sensor_step"]

Array = npt.NDArray[np.float64]

_NEIGHBOURS = 11  # readings under the running median: up to five odd ones in a row stand out
_COMMON = 0.05  # share of the readings: what lies off so often is the model's fault, not the sensor's
_LIMIT = 6.0  # standard deviations: none of 100 million normal readings lies further off
_FEW_VALUES = 0.25  # of the readings: a column with more distinct values is not seen as quantised


def pulled_in(measured: Array, simulated: Array) -> tuple[Array, npt.NDArray[np.intp]]:
    """Return the readings with outliers pulled in [°C], and where these are."""
    residuals = measured - simulated
    off = residuals - _median(residuals)
    deviation = 1.4826 * float(np.median(np.abs(off)))
    # the error of a rounded reading is uniform: its standard deviation is the step over the root of 12
    step = sensor_step(measured) or 0.0
    limit = _LIMIT * max(deviation, step / np.sqrt(12.0), 1e-6 * float(np.ptp(simulated)))
    odd: npt.NDArray[np.bool_] = (np.abs(off) > limit) & (np.abs(measured - _median(measured)) > limit)
    if np.mean(odd) > _COMMON:
        odd = np.zeros(len(odd), dtype=np.bool_)
    return np.where(odd, measured - off + np.clip(off, -limit, limit), measured), np.flatnonzero(odd)


def _median(values: Array) -> Array:
    return np.asarray(median_filter(values, size=_NEIGHBOURS, mode="nearest"))


def sensor_step(measured: Array) -> float | None:
    """Return the step in which the sensor's readings come [°C], None where they have no common one.

    The step is the least difference between two values; nearly all others have to be whole multiples of it.
    """
    values = np.unique(np.round(measured, 6))
    if len(values) < 3 or len(values) > _FEW_VALUES * len(measured):
        return None
    between = np.diff(values)
    step = float(np.median(between[between < 1.5 * between.min()]))
    multiples = between / step
    whole = np.abs(multiples - np.rint(multiples)) < 0.1 * np.maximum(multiples, 1.0)
    return step if np.mean(whole) > 0.9 else None
