"""Readings that lie off their neighbours, and the sensor's own step.

Each residual is compared with the running median of the residuals, in robust standard deviations (L. Davies and
U. Gather, "The identification of multiple outliers", J. Am. Stat. Assoc. 88 (1993) 782–792). A reading too far off
loses its weight: it is put where its neighbours are, and the least-squares fit repeated. It has to be off the readings
of its neighbours too: what the model cannot follow for a while is no outlier.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

__all__ = ["replace_outliers", "sensor_step", "without_outliers"]

Array = npt.NDArray[np.float64]

_NEIGHBOURS = 11  # readings under the running median: up to five odd ones in a row stand out
_COMMON = 0.05  # share of the readings: what lies off so often is the model's fault, not the sensor's
_LIMIT = 6.0  # standard deviations: none of 100 million normal readings lies further off
_WILD = 0.1
_FEW_VALUES = 0.5  # of the readings: a column with more distinct values is not seen as quantised


def without_outliers(
    measured: Array, simulated: Array, begun: npt.NDArray[np.intp] | None = None
) -> tuple[Array, npt.NDArray[np.intp]]:
    """Return the readings with outliers put where their neighbours are [°C], and the outliers' places.

    `begun`: places of the first readings of later segments, shape (k,); no reading has its neighbours across such a
    place. Readings are of shape (n,), the outliers' places of shape (o,).
    """
    residuals = measured - simulated
    off = residuals - _medians(residuals, begun)
    deviation = 1.4826 * float(np.median(np.abs(off)))
    # the error of a rounded reading is uniform: its standard deviation is the step over the root of 12
    step = sensor_step(measured) or 0.0
    limit = _LIMIT * max(deviation, step / np.sqrt(12.0), 1e-6 * float(np.ptp(simulated)))
    odd: npt.NDArray[np.bool_] = (np.abs(off) > limit) & (np.abs(measured - _medians(measured, begun)) > limit)
    if np.mean(odd) > _COMMON:
        odd = np.zeros(len(odd), dtype=np.bool_)
    return np.where(odd, measured - off, measured), np.flatnonzero(odd)


def replace_outliers(measured: Array, neighbours: int = _NEIGHBOURS, share: float = _WILD) -> Array:
    """Return the readings with wild ones, off by this share of the span, put where their neighbours are [°C].

    Of so many neighbours up to half may be wild in a row. All readings are of shape (n,).
    """
    smooth = _median(measured, neighbours)
    return np.where(np.abs(measured - smooth) > share * float(np.ptp(smooth)), smooth, measured)


def _medians(values: Array, begun: npt.NDArray[np.intp] | None) -> Array:
    return np.concatenate([_median(part) for part in np.split(values, [] if begun is None else begun)])


def _median(values: Array, neighbours: int = _NEIGHBOURS) -> Array:
    beside = np.pad(values, (neighbours // 2, neighbours - 1 - neighbours // 2), mode="edge")
    # of an even number the upper one of the middle two, as SciPy's median_filter, whose import takes longer than this
    windows = np.lib.stride_tricks.sliding_window_view(beside, neighbours)
    return np.partition(windows, neighbours // 2)[:, neighbours // 2]


def sensor_step(measured: Array) -> float | None:
    """Return the step in which the sensor's readings come [°C], None where they have no common one.

    The step is the least difference between two values; nearly all others have to be whole multiples of it. The
    readings are of shape (n,).
    """
    values = np.unique(np.round(measured, 6))
    if len(values) < 3 or len(values) > _FEW_VALUES * len(measured):
        return None
    between = np.diff(values)
    step = float(np.median(between[between < 1.5 * between.min()]))
    multiples = between / step
    whole = np.abs(multiples - np.rint(multiples)) < 0.1 * np.maximum(multiples, 1.0)
    return step if np.mean(whole) > 0.9 else None
