"""REAL as an S7-300/400 computes it, with the status bit OS.

Source: Statement List (STL) for S7-300 and S7-400, reference manual, floating-point math instructions: a result beyond
the largest number is infinite, a result too small to be a normal number is 0, an undefined one is not a number; each of
these sets OV and OS.
"""

from __future__ import annotations

import math
from typing import Final

from heatertune.plc.single import divided, single

__all__ = ["Real", "clamp"]

_LEAST_NORMAL: Final = 2.0**-126


class Real:
    """The accumulator of one block call: rounds every result once and remembers what overflowed.

    Attributes:
        overflow: whether a result was infinite, too small or not a number (OS).
    """

    __slots__ = ("overflow",)

    def __init__(self) -> None:
        self.overflow = False

    def of(self, value: float) -> float:
        """Return an exact (double precision) result as REAL."""
        if abs(value) < _LEAST_NORMAL:
            self.overflow |= value != 0.0
            return value if value == 0.0 else 0.0
        rounded = single(value)
        if math.isfinite(rounded):
            return rounded
        self.overflow = True
        # one object for all of them, as the CPU has one bit pattern: equal states compare as equal
        return math.nan if math.isnan(rounded) else rounded

    def quotient(self, dividend: float, divisor: float) -> float:
        """Return a quotient; by zero it is infinite or, for 0/0, not a number."""
        return self.of(divided(dividend, divisor) if divisor == 0.0 else dividend / divisor)


def clamp(value: float, low: float, high: float) -> float:
    """Return the value within its limits; what is not a number becomes the lower one."""
    if value > high:
        return high
    return value if value > low else low
