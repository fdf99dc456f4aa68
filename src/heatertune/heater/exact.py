"""Exact response of one or two lags to constant power, equal lags included: no grid, no solver.

    inner·x′ = target − x,   outer·y′ = x − y

y is the temperature [°C], x the state of the inner lag [°C]; with one lag, inner = 0 and x is not used. After t
seconds of a constant target

    y = target + e^(−t/outer)·(y₀ − target) + D/outer·(x₀ − target),   x = target + e^(−t/inner)·(x₀ − target)

D, the coupling of the two lags, is the divided difference of the two exponentials. With the larger lag T and
a = 1/T − 1/(smaller lag) ≤ 0 it is e^(−t/T)·(e^(a·t) − 1)/a, or t·e^(−t/T) if the lags are equal. Nothing
overflows, and nearly equal lags lose no precision. D does not depend on which lag is the outer one.

Scalars run as plain Python or compiled (`heatertune.compiled`); arrays have their own functions.
"""

from __future__ import annotations

import math
from functools import lru_cache
from math import exp, expm1, log1p  # names that the proof's loop gives its own functions, see `proof.plant`
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array

__all__ = [
    "Factors", "advance", "advance_step", "apart", "area", "factors", "since_step", "slopes_by_lag", "time_to",
    "turning_time", "turning_times", "unit_step_response",
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
    kept = target + np.exp(-t / outer) * (y - target)
    return np.asarray(kept + _passed(t, outer, inner) / outer * (x - target) if np.any(inner) else kept)


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
    kept = target * t - outer * np.expm1(-t / outer) * (y - target)
    return np.asarray(kept + inner * since_step(t, outer, inner)[0] * (x - target) if np.any(inner) else kept)


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
