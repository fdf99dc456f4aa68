"""Outliers among the readings, and the resolution of the sensor.

Each residual is compared with the running median of the residuals, in robust standard deviations (L. Davies and U.
Gather, "The identification of multiple outliers", J. Am. Stat. Assoc. 88 (1993) 782–792). An outlier is replaced by the
value of its neighbours, and the least-squares fit is repeated. It must also deviate from the neighbouring readings: a
stretch that the model cannot follow for a while is not an outlier.

Also the first disturbance of a log: a model has to explain the part before it. And the stretches in which its
controller gives no power: it was reset or switched off.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.log.log_values import MIN_SAMPLES, Log

__all__ = ["SWITCHED_OFF", "disturbance_s", "interruption_note", "replace_outliers", "sensor_step", "undisturbed_part",
           "without_outliers"]

#: of the span: no overshoot of a usable loop is followed by such a fall without a rise after it
SWITCHED_OFF: Final = 0.35


_NEIGHBOURS = 11  # readings of the running median: up to five consecutive outliers are detected
_COMMON = 0.05  # share of the readings: more frequent deviations are the model's fault, not the sensor's
_LIMIT = 6.0  # standard deviations: fewer than one in 100 million normal readings deviates more
_WILD = 0.1
_FEW_VALUES = 0.5  # of the readings: a column with more distinct values does not count as quantised


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
    """Return the readings with outliers, off by this fraction of the span, replaced by their neighbours [°C].

    Up to half of this number of neighbours may be consecutive outliers. All readings are of shape (n,).
    """
    smooth = _median(measured, neighbours)
    return np.where(np.abs(measured - smooth) > share * float(np.ptp(smooth)), smooth, measured)


def _medians(values: Array, begun: npt.NDArray[np.intp] | None) -> Array:
    return np.concatenate([_median(part) for part in np.split(values, [] if begun is None else begun)])


def _median(values: Array, neighbours: int = _NEIGHBOURS) -> Array:
    beside = np.pad(values, (neighbours // 2, neighbours - 1 - neighbours // 2), mode="edge")
    # for an even number the upper of the middle two, as SciPy's median_filter, whose import takes longer than this
    windows = np.lib.stride_tricks.sliding_window_view(beside, neighbours)
    return np.partition(windows, neighbours // 2)[:, neighbours // 2]


def sensor_step(measured: Array) -> float | None:
    """Return the resolution of the sensor's readings [°C], None if they have no common step.

    The step is the smallest difference between two values; nearly all others have to be integer multiples of it. The
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


_SHARE = 0.1  # of the log's span: a jump no heater makes between two readings
_SPIKE = 5  # neighbours of a reading: two odd ones in a row are a spike, three a disturbance that is over soon
_ABSURD = 0.5  # of the span: no disturbance leaves so far and comes back within a few readings
_TIMES = 10.0  # the usual departure from the neighbouring slopes


def disturbance_s(log: Log) -> float | None:
    """Return the instant of the last reading before the first jump [s], None without one.

    A jump deviates from the median slope of its neighbours by more than a tenth of the log's span and by more than ten
    times the usual deviation. Jumps within the first 20 readings are ignored: they would leave too little to fit. Two
    outliers that return are not a jump.
    """
    readings = replace_outliers(replace_outliers(log.temperature_degC, share=_ABSURD), _SPIKE)
    departure = _departures(readings)
    # of the original log: in pure noise, limited readings look quieter than they are
    typical = 1.4826 * float(np.median(_departures(log.temperature_degC)))
    threshold = max(_SHARE * float(np.ptp(readings)), _TIMES * typical)
    jumps = np.flatnonzero(departure > threshold)
    jumps = jumps[jumps >= MIN_SAMPLES]
    return float(log.time_s[jumps[0]]) if len(jumps) else None


def _departures(readings: Array) -> Array:
    """Return the deviation of each slope from the median of its neighbours."""
    change = np.diff(readings)
    padded = np.pad(change, 3, mode="edge")
    return np.asarray(np.abs(change - np.median(np.lib.stride_tricks.sliding_window_view(padded, 7), axis=1)))


def undisturbed_part(log: Log) -> tuple[Log, tuple[str, ...]]:
    """Return the log up to its first disturbance, and a sentence about any omitted part."""
    end = disturbance_s(log)
    if end is None:
        return log, ()
    left = int(np.count_nonzero(log.time_s > end))
    return log.window(float(log.time_s[0]), end), (
        f"The temperature jumps after {end:g} s; the {left} readings from there on were left out of the fit.",
    )


def _longest_part(time_s: Array, stretches: Sequence[tuple[int, int]]) -> tuple[int, int]:
    """Return first and last row of the longest part of a log outside stretches, each from its first row to its last.

    Args:
        time_s: of all rows, shape (n,) [s].
        stretches: in order.
    """
    firsts = [0, *(last for _, last in stretches)]
    lasts = [*(first for first, _ in stretches), len(time_s) - 1]
    return max(zip(firsts, lasts, strict=True), key=lambda part: float(time_s[part[1]] - time_s[part[0]]))


def _part_flags(time_s: Array, part: tuple[int, int]) -> str:
    """Return the options that leave only a part of a log, from its first row to its last."""
    first, last = part
    flags = [f"--from {time_s[first]:.10g}"] if first else []
    return " ".join([*flags, *([f"--until {time_s[last]:.10g}"] if last < len(time_s) - 1 else [])])


def interruption_note(log: Log) -> str:
    """Return what to do about stretches without power in a loop, through which the temperature falls far; or nothing.

    Args:
        log: of a closed loop, with power.
    """
    power, y, time = log.power_pct, log.temperature_degC, log.time_s
    assert power is not None
    edges = np.flatnonzero(np.diff(np.concatenate([[False], power <= max(0.0, float(power.min())), [False]])))
    rests = [(int(first), int(last)) for first, last in zip(edges[::2], edges[1::2] - 1, strict=True) if first]
    far = SWITCHED_OFF * float(np.ptp(y))
    falls = [(first, last) for first, last in rests if y[first] - y[last] > far]
    if not falls:
        return ""
    places = ", ".join(f"from {time[first]:.4g} to {time[last]:.4g} s" for first, last in falls)
    return (f" It gives no power {places} while the temperature falls: its setpoint was lowered, or it was reset or "
            f"switched off. The fit uses that; {_part_flags(time, _longest_part(time, falls))} leaves the longest part "
            "without it.")
