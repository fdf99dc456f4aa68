"""REAL as an S7-300/400 computes it, with the status bit OS.

Source: Statement List (STL) for S7-300 and S7-400, reference manual, floating-point math instructions: a result beyond
the largest number is infinite, a result too small to be a normal number is 0, an undefined one is not a number; each of
these sets OV and OS.
"""

from __future__ import annotations

import math
from typing import Final

from heatertune.plc.single_precision import divide_single, single

__all__ = ["clamp", "quotient", "real"]

_LEAST_NORMAL: Final = 2.0**-126


def real(value: float, os: bool = False) -> tuple[float, bool]:
    """Return an exact (double precision) result as REAL, rounded once, and OS after it.

    Args:
        value: sum, difference or product of two REALs.
        os: whether a result before was infinite, too small or not a number.
    """
    if abs(value) < _LEAST_NORMAL:
        return (value if value == 0.0 else 0.0), os or value != 0.0
    rounded = single(value)
    if math.isfinite(rounded):
        return rounded, os
    # one object for all of them, as the CPU has one bit pattern: equal states compare as equal
    return (math.nan if math.isnan(rounded) else rounded), True


def quotient(dividend: float, divisor: float, os: bool = False) -> tuple[float, bool]:
    """Return a quotient and OS after it, as `real`; by zero it is infinite or, for 0/0, not a number."""
    return real(divide_single(dividend, divisor) if divisor == 0.0 else dividend / divisor, os)


def clamp(value: float, low: float, high: float) -> float:
    """Return the value within its limits; what is not a number becomes the lower one."""
    if value > high:
        return high
    return value if value > low else low
