"""Intervals that admit what they do not know, and how they come from resampled values."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from heatertune.errors import OutOfRange
from heatertune.model.statistics import percentile_interval

__all__ = ["PERIOD", "RATIO", "Interval", "envelope", "holds", "hull", "identified_interval", "identified_parts",
           "interval"]

Array = npt.NDArray[np.float64]

#: name of what is known where gain and time constant are not
RATIO = "gain_per_time_constant_degC_per_s_pct"

#: name of the period at which the heater lags by half a turn
PERIOD = "ultimate_period_s"

_WIDE = 0.3  # an interval wider than ±30 % of its centre identifies nothing


def interval(values: Array, low: float, high: float) -> Interval:
    """Return the central 95 % of resampled values, shape (n,); an end on a bound of the search is open (None).

    Values that are not finite do not count; where none is, both ends are open.
    """
    known = values[np.isfinite(values)]
    if not len(known):
        return Interval(low=None, high=None)
    lower, upper = percentile_interval(known)
    margin = 1e-9 * (high - low) if np.isfinite(high - low) else 0.0
    return Interval(
        low=None if lower <= low + margin else lower, high=None if upper >= high - margin else upper
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Interval:
    """A 95 % confidence interval; an end that lies on a bound of the search is open and None."""

    low: float | None
    high: float | None

    def __post_init__(self) -> None:
        if self.low is not None and self.high is not None and self.low > self.high:
            raise OutOfRange("low", self.low, f"<= high = {self.high:g}")


def envelope(parts: Interval, values: list[float]) -> Interval:
    """Return the interval widened until it holds every value."""
    low = None if parts.low is None else min(parts.low, *values)
    high = None if parts.high is None else max(parts.high, *values)
    return Interval(low=low, high=high)


def hull(first: Interval, second: Interval) -> Interval:
    """Return the narrowest interval that holds both; an end that is open in one stays open."""
    low = None if first.low is None or second.low is None else min(first.low, second.low)
    high = None if first.high is None or second.high is None else max(first.high, second.high)
    return Interval(low=low, high=high)


def holds(interval: Interval, value: float) -> bool:
    """Return whether an interval holds a value."""
    return (interval.low is None or value >= interval.low) and (interval.high is None or value <= interval.high)


def identified_parts(ci95: Interval | None) -> bool:
    """Return whether an interval is closed and no wider than ±30 % of its centre."""
    if ci95 is None or ci95.low is None or ci95.high is None:
        return False
    return ci95.high - ci95.low <= _WIDE * abs(ci95.high + ci95.low)


def identified_interval(ci95: Interval) -> Interval | None:
    """Return the interval, or None where it identifies nothing."""
    return ci95 if identified_parts(ci95) else None
