"""Where a log was disturbed: the part before is what a model has to explain."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from heatertune.log.values import MIN_SAMPLES, Log
from heatertune.model.outliers import replace_outliers

__all__ = ["disturbance_s", "undisturbed_part"]

Array = npt.NDArray[np.float64]

_SHARE = 0.1  # of the log's span: a jump no heater makes between two readings
_SPIKE = 5  # neighbours of a reading: two odd ones in a row are a spike, three a disturbance that is over soon
_ABSURD = 0.5  # of the span: no disturbance leaves so far and comes back within a few readings
_TIMES = 10.0  # the usual departure from the neighbouring slopes


def disturbance_s(log: Log) -> float | None:
    """Return the instant of the last reading before the first jump [s], None without one.

    A jump departs from the median slope of its neighbours by more than a tenth of the log's span and by more than
    ten times the usual departure. Jumps within the first 20 readings are not looked for: they would leave
    too little to fit. Two odd readings that return are no jump.
    """
    readings = replace_outliers(replace_outliers(log.temperature_degC, share=_ABSURD), _SPIKE)
    departure = _departures(readings)
    # of the log as it is: where all is noise, what was tamed looks quieter than it was
    typical = 1.4826 * float(np.median(_departures(log.temperature_degC)))
    threshold = max(_SHARE * float(np.ptp(readings)), _TIMES * typical)
    jumps = np.flatnonzero(departure > threshold)
    jumps = jumps[jumps >= MIN_SAMPLES]
    return float(log.time_s[jumps[0]]) if len(jumps) else None


def _departures(readings: Array) -> Array:
    """Return how far each slope departs from the median of its neighbours."""
    change = np.diff(readings)
    padded = np.pad(change, 3, mode="edge")
    return np.asarray(np.abs(change - np.median(np.lib.stride_tricks.sliding_window_view(padded, 7), axis=1)))


def undisturbed_part(log: Log) -> tuple[Log, tuple[str, ...]]:
    """Return the log up to its first disturbance, and a sentence about what was left out, if anything was."""
    end = disturbance_s(log)
    if end is None:
        return log, ()
    left = int(np.count_nonzero(log.time_s > end))
    return log.window(float(log.time_s[0]), end), (
        f"The temperature jumps after {end:g} s; the {left} readings from there on were left out of the fit.",
    )
