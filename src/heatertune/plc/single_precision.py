"""REAL: IEEE 754 single precision, one rounding after each operation.

A sum, difference, product or quotient of two singles that is formed in double precision and then rounded to single is
the correctly rounded one: 53 bits are more than twice 24 plus 2 (S. A. Figueroa, "When is double rounding innocuous?",
ACM SIGNUM Newsletter 30(3), 1995).
"""

from __future__ import annotations

import math
import struct
from ctypes import c_float
from typing import Any, Final

import numpy as np

from heatertune.compiled import runs_compiled_as

__all__ = ["LARGEST", "divide_single", "exponential", "is_single", "real_of", "single", "to_single", "word_of"]

#: the largest number of single precision
LARGEST: Final = 3.4028234663852886e38
#: beyond it the exponential is no single
_MOST_POWER: Final = 89.0


def _single(value: float) -> float:
    # no compiler knows ctypes; as plain Python this warns of infinities. Operations of two of these stay in single
    # precision, so that rounding once more is nothing
    return np.float32(value)  # type: ignore[return-value]  # a float to all that the callers do with it


@runs_compiled_as(_single)
def single(value: float) -> float:
    """Return the nearest single; beyond the largest one it is infinite."""
    return c_float(value).value


def _real_of(bits: int) -> float:
    return np.int32(bits).view(np.float32)  # type: ignore[return-value]  # as in `_single`


@runs_compiled_as(_real_of)
def real_of(bits: int) -> float:
    """Return the single of these 32 bits, a signed number."""
    value: float = struct.unpack("=f", struct.pack("=i", bits))[0]
    return value


def _word_of(value: float) -> int:
    return np.int64(np.float32(value).view(np.int32))  # type: ignore[return-value]  # an int to all that the callers do


@runs_compiled_as(_word_of)
def word_of(value: float) -> int:
    """Return the 32 bits of a number that single precision holds, as a signed number."""
    bits: int = struct.unpack("=i", struct.pack("=f", value))[0]
    return bits


def to_single(value: Any) -> Any:
    """Return an array or nested tuples whose floats, all of them singles, a compiler holds in single precision."""
    if isinstance(value, np.ndarray):
        return value.astype(np.float32) if value.dtype == np.float64 else value
    if isinstance(value, tuple):
        return type(value)(*map(to_single, value)) if hasattr(value, "_fields") else tuple(map(to_single, value))
    return np.float32(value) if isinstance(value, float) else value


def is_single(value: float) -> bool:
    """Return whether a finite number is one that single precision holds."""
    return math.isfinite(value) and single(value) == value


def divide_single(dividend: float, divisor: float) -> float:
    """Return the quotient in single precision; by zero it is infinite or, for 0/0, not a number, as IEEE 754 has it."""
    if divisor != 0.0:
        return single(dividend / divisor)
    if dividend == 0.0 or math.isnan(dividend):
        return math.nan
    return math.copysign(math.inf, dividend) * math.copysign(1.0, divisor)


def exponential(power: float) -> float:
    """Return e to a power in single precision, infinite where it is too large."""
    return math.inf if power > _MOST_POWER else single(math.exp(power))
