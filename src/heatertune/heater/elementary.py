"""e^x and the logarithm as explicit sums and products, with the same bits on every machine.

Library versions differ between machines, and compilers do not vectorise calls to them over several loops. Both
functions are within about 1 ulp (`tests/heater/test_elementary.py`).

e^x = 2ⁿ·e^r with n = round(x/ln 2), |r| ≤ ln 2/2 and the exponential series of r; ln x = k·ln 2 + 2·artanh s with
x = 2ᵏ·m, m in √½…√2, s = (m − 1)/(m + 1) and the series of artanh. ln 2 is stored in two parts, the first so short that
its multiples are exact.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from heatertune.compiled import runs_compiled_as

__all__ = ["decay", "expm1_negative", "logarithm", "logarithm_beside_1"]

_LEAST: Final = -700.0  # below, e^x is negligible
_NEAR: Final = -0.34  # above −½·ln 2
_BY_LN2: Final = 1.4426950408889634
_LN2: Final = 0.6931471803691238  # 32 bits of it
_LN2_REST: Final = 1.9082149292705877e-10
_TO_WHOLE: Final = 6755399441055744.0  # 1.5·2⁵²: a sum with it ends with the units, and they are its last bits
_BIAS: Final = 1023
_MANTISSA: Final = 52
_ROOT: Final = 0.7071067811865476
_ROOT_BITS: Final = 0x3FE6A09E667F3BCD


def decay(power: float) -> float:
    """Return e to a power that is not above 0."""
    scale, rest = _split(power)
    return scale + scale * rest


def expm1_negative(power: float) -> float:
    """Return e^power − 1 of a power that is not above 0."""
    scale, rest = _split(power)
    return (scale - 1.0) + scale * rest


def logarithm(number: float) -> float:
    """Return the natural logarithm of a normal number above 0."""
    m, k = _parts(number)
    s = (m - 1.0) / (m + 1.0)
    z = s * s
    w = z * z
    u = w * w
    low = (2.0 / 3.0 + z * (2.0 / 5.0)) + w * (2.0 / 7.0 + z * (2.0 / 9.0))
    high = (2.0 / 11.0 + z * (2.0 / 13.0)) + w * (2.0 / 15.0 + z * (2.0 / 17.0))
    top = 2.0 / 19.0 + z * (2.0 / 21.0)
    return k * _LN2 + (2.0 * s + (s * z * (low + u * (high + u * top)) + k * _LN2_REST))


def logarithm_beside_1(share: float) -> float:
    """Return ln(1 + share) of a share above −1."""
    number = 1.0 + share
    return logarithm(number) - ((number - 1.0) - share) / number


def _split(power: float) -> tuple[float, float]:
    """Return 2ⁿ and e^r − 1, which give e^power."""
    scale, r = 1.0, power
    if not power > _NEAR:  # else n = 0, and this would give just that
        x = power if power > _LEAST else _LEAST
        whole = x * _BY_LN2 + _TO_WHOLE
        n = whole - _TO_WHOLE
        scale, r = _two_to(whole), (x - n * _LN2) - n * _LN2_REST
    z = r * r
    w = z * z
    low = (1.0 / 2.0 + r * (1.0 / 6.0)) + z * (1.0 / 24.0 + r * (1.0 / 120.0))
    high = (1.0 / 720.0 + r * (1.0 / 5040.0)) + z * (1.0 / 40320.0 + r * (1.0 / 362880.0))
    top = (1.0 / 3628800.0 + r * (1.0 / 39916800.0)) + z * (1.0 / 479001600.0 + r * (1.0 / 6227020800.0))
    return scale, r + z * (low + w * (high + w * top))


def _two_to_in_bits(whole: float) -> float:
    bits = (np.float64(whole).view(np.int64) + _BIAS) << _MANTISSA
    return np.int64(bits).view(np.float64)


@runs_compiled_as(_two_to_in_bits)
def _two_to(whole: float) -> float:
    return math.ldexp(1.0, int(whole - _TO_WHOLE))


def _parts_in_bits(number: float) -> tuple[float, float]:
    bits = np.float64(number).view(np.int64)
    k = (bits - _ROOT_BITS) >> _MANTISSA
    return np.int64(bits - (k << _MANTISSA)).view(np.float64), float(k)


@runs_compiled_as(_parts_in_bits)
def _parts(number: float) -> tuple[float, float]:
    """Return m and k."""
    m, k = math.frexp(number)
    return (2.0 * m, k - 1.0) if m < _ROOT else (m, float(k))
