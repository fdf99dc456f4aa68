"""The heater between two switching instants, exactly: no grid, no solver.

    T2·x′ = target − x,   T1·y′ = x − y,   target = ambient + gain·power

y is the temperature [°C], x the state of the smaller lag [°C]; with one lag x is not used. With constant power

    y(t) = target + e^(−t/T1)·(y − target) + c(t)·(x − target)
    c(t) = e^(−t/T1)·(e^(a·t) − 1)/(a·T1),   a = 1/T1 − 1/T2

and c(t) = t/T1·e^(−t/T1) where the lags are equal. As T1 is the larger lag, a ≤ 0 and nothing can overflow.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

__all__ = ["Factors", "Flow", "Plant", "advance", "factors", "moved", "turn", "turning_times"]

Array = npt.NDArray[np.float64]


class Plant(NamedTuple):
    """The heater: gain [°C/%], the larger lag, the smaller one (0: none) and dead time [s], ambient [°C]."""

    gain: float
    first: float
    second: float
    dead: float
    ambient: float


class Factors(NamedTuple):
    """What some seconds of constant power leave of y − target, of x − target in y, and of x − target."""

    outer: float
    coupling: float
    inner: float


class Flow(NamedTuple):
    """The heater at an instant [s]: y and x, the target they go to [°C], the heater's power and the load [%]."""

    now: float
    y: float
    x: float
    target: float
    heat: float
    load: float


def factors(t: float, plant: Plant) -> Factors:
    """Return the factors of `t` seconds, not negative."""
    decay = math.exp(-t / plant.first)
    if plant.second == 0.0:
        return Factors(decay, 0.0, 1.0)
    rate = 1.0 / plant.first - 1.0 / plant.second
    stretch = t if rate == 0.0 else math.expm1(rate * t) / rate
    return Factors(decay, decay * stretch / plant.first, math.exp(-t / plant.second))


def moved(flow: Flow, now: float, f: Factors) -> Flow:
    """Return the heater at `now`, the power being constant since; the factors are those of the time between."""
    target = flow.target
    outer, inner = flow.y - target, flow.x - target
    return Flow(
        now, target + f.outer * outer + f.coupling * inner, target + f.inner * inner, target, flow.heat, flow.load
    )


def turn(before: Flow, after: Flow, plant: Plant) -> float:
    """Return the instant between two, the power being constant, at which y turns [s]; infinite where it does not."""
    slope = before.x - before.y
    if plant.second == 0.0 or slope * (after.x - after.y) >= 0.0:
        return math.inf
    rate = 1.0 / plant.first - 1.0 / plant.second
    stretch = plant.second * slope / (before.x - before.target)
    return before.now + (stretch if rate == 0.0 else math.log1p(rate * stretch) / rate)


def advance(y: Array, x: Array, target: Array, t: Array, first: float, second: float) -> Array:
    """Return y after `t` seconds, arrays of one shape; see `factors` and `moved`, which do it for numbers."""
    decay = np.exp(-t / first)
    if second == 0.0:
        return np.asarray(target + decay * (y - target))
    rate = 1.0 / first - 1.0 / second
    stretch = t if rate == 0.0 else np.expm1(rate * t) / rate
    return np.asarray(target + decay * (y - target) + decay * stretch / first * (x - target))


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
