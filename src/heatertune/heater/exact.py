"""Exact response of one or two lags to constant power, equal lags included: no grid, no solver.

    inner·x′ = target − x,   outer·y′ = x − y

y is the temperature [°C], x the state of the inner lag [°C]; with one lag, inner = 0 and x is not used. After t
seconds of a constant target

    y = target + e^(−t/outer)·(y₀ − target) + D/outer·(x₀ − target),   x = target + e^(−t/inner)·(x₀ − target)

D, the coupling of the two lags, is the divided difference of the two exponentials. With the larger lag T and
a = 1/T − 1/(smaller lag) ≤ 0 it is e^(−t/T)·(e^(a·t) − 1)/a, or t·e^(−t/T) if the lags are equal. Nothing
overflows, and nearly equal lags lose no precision. D does not depend on which lag is the outer one.

Scalars run as plain Python or compiled (`heatertune.compiled`); arrays have their own functions.

`decay` and the logarithms are e^x and ln x as explicit sums and products, with the same bits on every machine: library
versions differ between machines, and compilers do not vectorise calls to them over several loops. They are within about
1 ulp (`tests/heater/test_elementary.py`). e^x = 2ⁿ·e^r with n = round(x/ln 2), |r| ≤ ln 2/2 and the exponential series
of r; ln x = k·ln 2 + 2·artanh s with x = 2ᵏ·m, m in √½…√2, s = (m − 1)/(m + 1) and the series of artanh. ln 2 is stored
in two parts, the first so short that its multiples are exact.
"""

from __future__ import annotations

import math
from functools import lru_cache
from math import exp, expm1, log1p  # names that the proof's loop gives its own functions, see `proof.plant`
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.compiled import runs_compiled_as

__all__ = [
    "Factors", "advance", "advance_step", "apart", "area", "decay", "expm1_negative", "factors", "logarithm",
    "logarithm_beside_1", "since_step", "slopes_by_lag", "time_to", "turning_time", "turning_times",
    "unit_step_response",
]


Numbers = float | Array

_SERIES = 0.1  # below, a difference of exponentials has lost a digit, and nine terms of its series give all
_TERMS = 9
_APART = 1e-4  # share of the larger lag


class Factors(NamedTuple):
    """Factors of y − target, of x − target in y, and of x − target after some seconds of constant power."""

    outer: float
    coupling: float
    inner: float


def factors(t: float, outer: float, inner: float) -> Factors:
    """Return the factors of `t` seconds, not negative."""
    left = exp(-t / outer)
    if inner == 0.0:
        return Factors(left, 0.0, 1.0)
    other = exp(-t / inner)
    slow = left if outer >= inner else other
    rate = 1.0 / max(outer, inner) - 1.0 / min(outer, inner)
    stretch = t if rate == 0.0 else expm1(rate * t) / rate
    return Factors(left, slow * stretch / outer, other)


def advance_step(y: float, x: float, target: float, f: Factors) -> tuple[float, float]:
    """Return y and x after a time of constant power, given its factors."""
    above, inner = y - target, x - target
    return target + f.outer * above + f.coupling * inner, target + f.inner * inner


def unit_step_response(t: float, outer: float, inner: float) -> float:
    """Return the answer to a unit step `t` seconds ago, not negative; `since_step` does it for arrays."""
    left = factors(t, outer, inner)
    return 1.0 - left.outer - left.coupling


def turning_time(y: float, x: float, target: float, outer: float, inner: float) -> float:
    """Return the time after which y′ = 0 [s], of two lags and a constant power under which y does turn.

    x − y decays with the outer lag and is fed by x − target, so it has at most one zero:
    (e^(a·t) − 1)/a = inner·(x − y)/(x − target), a = 1/outer − 1/inner.

    Args:
        y: of the outer lag [°C].
        x: of the inner lag [°C].
        target: where the power leads [°C].
        outer: lag [s].
        inner: lag [s].
    """
    rate = 1.0 / outer - 1.0 / inner
    stretch = inner * (x - y) / (x - target)
    return stretch if rate == 0.0 else log1p(rate * stretch) / rate


def advance(y: Array, x: Array, target: Array, t: Array, outer: Numbers, inner: Numbers) -> Array:
    """Return y after a time, all of one shape; see `factors` and `advanced`, which do it for numbers.

    Args:
        y: of the outer lag [°C].
        x: of the inner lag [°C].
        target: where the power leads [°C].
        t: time [s].
        outer: lag [s].
        inner: lag, 0 if there is one alone [s].
    """
    one_lag = target + np.exp(-t / outer) * (y - target)
    return np.asarray(one_lag + _passed(t, outer, inner) / outer * (x - target) if np.any(inner) else one_lag)


def area(y: Array, x: Array, target: Array, t: Array, outer: Numbers, inner: Numbers) -> Array:
    """Return ∫ `advance` dt over a time [°C·s], all of one shape.

    D is outer·inner times the slope of the answer to a unit step, so its integral is that times the answer itself.

    Args:
        y: of the outer lag at the begin [°C].
        x: of the inner lag at the begin [°C].
        target: where the power leads [°C].
        t: time [s].
        outer: lag [s].
        inner: lag, 0 if there is one alone [s].
    """
    one_lag = target * t - outer * np.expm1(-t / outer) * (y - target)
    return np.asarray(one_lag + inner * since_step(t, outer, inner)[0] * (x - target) if np.any(inner) else one_lag)


def turning_times(y: Array, x: Array, target: Array, outer: Numbers, inner: Numbers) -> Array:
    """Return `turning_time` of arrays, NaN if y does not turn; shapes broadcast.

    Args:
        y: of the outer lag [°C].
        x: of the inner lag [°C].
        target: where the power leads [°C].
        outer: lag [s].
        inner: lag [s].
    """
    rate = 1.0 / np.asarray(outer) - 1.0 / np.asarray(inner)
    with np.errstate(divide="ignore", invalid="ignore"):
        stretch = inner * (x - y) / (x - target)
        turns = np.where(rate == 0.0, stretch, np.log1p(rate * stretch) / rate)
        return np.where(np.isfinite(turns) & (turns > 0.0), turns, np.nan)


def since_step(t: Array, outer: Numbers, inner: Numbers = 0.0) -> tuple[Array, Array]:
    """Return the answer to a unit step `t` seconds ago, not negative, and its slope [1/s]; shapes broadcast."""
    left = np.exp(-t / outer)
    if not np.any(inner):
        return np.asarray(1.0 - left), np.asarray(left / outer)
    passed = _passed(t, outer, inner)
    return np.asarray(1.0 - left - passed / outer), np.asarray(passed / outer / inner)


def slopes_by_lag(t: Array, lag: Numbers, second_lag_s: Numbers = 0.0) -> Array:
    """Return the derivative of `since_step` by one of its lags [1/s], the other being `second_lag_s`; shapes broadcast.

    It is −1/(lag²·other)·∫₀ᵗ s·e^(−s/lag)·e^(−(t − s)/other) ds; of one lag, −t/lag²·e^(−t/lag).
    """
    own = np.asarray(lag)
    if not np.any(second_lag_s):
        return np.asarray(-t / own**2 * np.exp(-t / own))
    slow = np.maximum(own, second_lag_s)
    z = (1.0 / np.minimum(own, second_lag_s) - 1.0 / slow) * t  # not negative
    slower = np.broadcast_to(own >= second_lag_s, z.shape)
    with np.errstate(divide="ignore", invalid="ignore"):
        fed = np.where(slower, z + np.expm1(-z), -np.expm1(-z) - z * np.exp(-z)) / z**2
    near = z < _SERIES
    fed[near] = _series(z[near], slower[near])
    return np.asarray(-(t**2) * np.exp(-t / slow) * fed / (own**2 * second_lag_s))


def _series(z: Array, slower: npt.NDArray[np.bool_]) -> Array:
    """Return the quotient in `slopes_by_lag` for small z, for the slower or the faster lag."""
    term, total = np.full(z.shape, 0.5), np.zeros(z.shape)
    for k in range(_TERMS):
        total += term * np.where(slower, 1.0, k + 1.0)
        term = -term * z / (k + 3.0)
    return total


def apart(first: float, second: float) -> tuple[float, float]:
    """Return the lags as modes in parallel can have them, the larger one first: equal lags have no such modes.

    Nearly equal ones are moved by half a ten-thousandth each way. Their sum stays, so an answer changes by 1e-9.
    """
    if first - second >= _APART * first:
        return first, second
    middle = 0.5 * (first + second)
    return middle * (1.0 + 0.5 * _APART), middle * (1.0 - 0.5 * _APART)


def _passed(t: Array, outer: Numbers, inner: Numbers) -> Array:
    """Return D, see above [s]."""
    slow = np.maximum(outer, inner)
    rate = 1.0 / slow - 1.0 / np.minimum(outer, inner)
    with np.errstate(divide="ignore", invalid="ignore"):
        stretch = np.where(rate == 0.0, t, np.expm1(rate * t) / rate)
    return np.asarray(np.exp(-t / slow) * stretch)


def time_to(share: float, first_s: float, second_s: float | None = None) -> float:
    """Return the time after which the answer to a step has done a share of its way, without the dead time [s]."""
    return -first_s * math.log1p(-share) if second_s is None else _two_lags_to(share, first_s, second_s)


@lru_cache(maxsize=4096)  # a test sequence needs the same few times, and the next one most of them again
def _two_lags_to(share: float, first_s: float, second_s: float) -> float:
    low, high = 0.0, (first_s + second_s) * (1.0 - math.log1p(-share))  # no two lags take longer
    for _ in range(60):
        middle = 0.5 * (low + high)
        if unit_step_response(middle, first_s, second_s) < share:
            low = middle
        else:
            high = middle
    return high


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
