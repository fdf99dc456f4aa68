"""The heater between two switching instants, exactly: no grid, no solver.

    T2·x′ = target − x,   T1·y′ = x − y,   target = ambient + gain·power

y is the temperature [°C], x the state of the smaller lag [°C]; with one lag x is not used. With constant power

    y(t) = target + e^(−t/T1)·(y − target) + c(t)·(x − target)
    c(t) = e^(−t/T1)·(e^(a·t) − 1)/(a·T1),   a = 1/T1 − 1/T2

and c(t) = t/T1·e^(−t/T1) where the lags are equal. As T1 is the larger lag, a ≤ 0 and nothing can overflow.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

__all__ = ["advance", "turning_times"]

Array = npt.NDArray[np.float64]


def advance(
    y: Any, x: Any, target: Any, t: Any, first: float, second: float, exp: Any = math.exp, expm1: Any = math.expm1
) -> tuple[Any, Any]:
    """Return (y, x) after `t` seconds with constant power.

    Args:
        y: temperature before [°C].
        x: state of the smaller lag before [°C].
        target: ambient + gain·power [°C].
        t: [s], not negative.
        first: the larger lag T1 [s].
        second: the smaller lag T2 [s]; 0: one lag.
        exp: `math`'s for numbers, `numpy`'s for arrays of one shape.
        expm1: likewise.
    """
    decay = exp(-t / first)
    if second == 0.0:
        return target + decay * (y - target), x
    rate = 1.0 / first - 1.0 / second
    stretch = t if rate == 0.0 else expm1(rate * t) / rate
    coupling = decay * stretch / first
    return target + decay * (y - target) + coupling * (x - target), target + exp(-t / second) * (x - target)


def turning_times(y: Array, x: Array, target: Array, first: float, second: float) -> Array:
    """Return the time after which y′ = 0 [s], NaN where y does not turn, for two lags and constant power.

    x − y decays with T1 and is fed by x − target, so it has at most one zero:
    (e^(a·t) − 1)/a = T2·(x − y)/(x − target).
    """
    rate = 1.0 / first - 1.0 / second
    with np.errstate(divide="ignore", invalid="ignore"):
        stretch = second * (x - y) / (x - target)
        found = stretch if rate == 0.0 else np.log1p(rate * stretch) / rate
        return np.where(np.isfinite(found) & (found > 0.0), found, np.nan)
