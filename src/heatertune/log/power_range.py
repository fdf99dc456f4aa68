"""The range of a power signal: a live zero (4–20 mA, 1–5 V, 2–10 V), and values below 0, at which a cooler works."""

from __future__ import annotations

import re
from typing import Final

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array

__all__ = ["BELOW_ZERO", "is_two_way", "live_zeros", "outside_levels", "percent_between", "reaches_ends"]


#: readings without power and at full power of signals with a live zero, and the unit of each
_LIVE_ZEROS: Final = ((4.0, 20.0, "ma"), (1.0, 5.0, "v"), (2.0, 10.0, "v"))
_UNIT: Final = re.compile(r"[\[(/ _0-9](m?[av])[\])]?$|\b(volt|spannung|strom|current|amp)", re.IGNORECASE)
_VOLTS: Final = ("v", "mv", "volt", "nung")
_TOLERANCE: Final = 0.015  # of the span: an output card's error, which is set to the end of its range
_REACHED: Final = 0.01  # of the span
#: share of full power: readings as far below 0 are the error of an analogue signal, not those of a cooler
BELOW_ZERO: Final = 0.01
_TWO_WAY: Final = re.compile(r"cool|kühl|kuehl|refrig|kälte|pid.?output.?sum|pid.?temp|peltier", re.IGNORECASE)


def is_two_way(name: str) -> bool:
    """Return whether a name says that the signal heats and cools."""
    return _TWO_WAY.search(name) is not None


def live_zeros(name: str, values: Array) -> list[tuple[float, float]]:
    """Return the ranges with a live zero that a signal may have, the nearest first; values of shape (n,)."""
    unit = _UNIT.search(name)
    kind = "" if unit is None else "v" if (unit[1] or unit[2])[-4:].lower() in _VOLTS else "ma"
    fitting = [(low, high) for low, high, its in _LIVE_ZEROS
               if kind in ("", its) and not len(outside_levels(values, (low, high)))]
    return sorted(fitting, key=lambda ends: abs(float(np.min(values)) - ends[0]) + abs(float(np.max(values)) - ends[1]))


def reaches_ends(values: Array, ends: tuple[float, float]) -> bool:
    """Return whether a signal, shape (n,), reaches both ends of a range: without a unit, that is more than chance."""
    low, high = ends
    return bool(max(abs(np.min(values) - low), abs(np.max(values) - high)) < _REACHED * (high - low))


def outside_levels(values: Array, levels: tuple[float, float]) -> npt.NDArray[np.intp]:
    """Return the rows whose reading lies outside of the readings without power and at full power, shape (k,)."""
    share = _share(values, levels)
    return np.flatnonzero((share < -_TOLERANCE) | (share > 1.0 + _TOLERANCE))


def percent_between(values: Array, levels: tuple[float, float]) -> Array:
    """Return the power by its readings without power and at full power, shape (n,) [0…100 %]."""
    return np.clip(100.0 * _share(values, levels), 0.0, 100.0)


def _share(values: Array, levels: tuple[float, float]) -> Array:
    low, high = levels
    return np.asarray((values - low) / (high - low))
