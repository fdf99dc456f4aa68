"""Heaters drawn from what a fit leaves open, and what a controller's robustness is on them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from heatertune.model.values import FittedModel, Fopdt, HeaterModel, Interval, TwoLag
from heatertune.pid.robustness import margins
from heatertune.pid.values import PidDesign

__all__ = ["Drawn", "draw_heaters", "interval_ends", "ms_over"]

#: half width of a 95 % interval in standard deviations
_HALF_WIDTH: Final = 1.96


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawn:
    """Ms over drawn heaters; infinite where the loop is unstable.

    Attributes:
        count: how many were drawn.
        median, p95, worst: of Ms.
        unstable: on how many the loop is unstable.
    """

    count: int
    median: float
    p95: float
    worst: float
    unstable: int


def draw_heaters(fitted: FittedModel, count: int = 200, *, seed: int = 0) -> tuple[HeaterModel, ...]:
    """Return heaters that the log does not rule out; none where the fit gives no interval.

    Each candidate in turn, its gain, lags and dead time multiplied by factors drawn lognormally from the width of their
    95 % intervals. The factors are drawn independently, although a fit knows some combinations better than each
    parameter alone: the draw is wider than the log, so what it shows is rather too bad than too good. An interval that
    is open or missing adds nothing; there the candidates themselves span what is possible.
    """
    spreads = [_spread(fitted.ci95.get(name)) for name in ("gain_degC_per_pct", "time_constant_s", "dead_time_s")]
    if not any(spreads):
        return ()
    factors = np.exp(np.random.default_rng(seed).normal(0.0, 1.0, (count, 3)) * spreads)
    plants = fitted.plants
    return tuple(_scaled(plants[i % len(plants)], *row) for i, row in enumerate(factors.tolist()))


def interval_ends(fitted: FittedModel) -> tuple[HeaterModel, ...]:
    """Return the working model with one parameter at a time at each closed end of its 95 % interval."""
    names = ("gain_degC_per_pct", "time_constant_s", "dead_time_s")
    intervals = [(name, fitted.ci95.get(name)) for name in names]
    ends = [(name, end) for name, found in intervals if found is not None for end in (found.low, found.high)]
    return tuple(replace(fitted.model, **{name: end}) for name, end in ends
                 if end is not None and (end > 0.0 or (name == "dead_time_s" and end == 0.0)))


def ms_over(heaters: tuple[HeaterModel, ...], design: PidDesign) -> Drawn | None:
    """Return the quantiles of Ms of one controller over heaters; None where there are none."""
    if not heaters:
        return None
    found = sorted(margins(heater, design).ms for heater in heaters)
    last = len(found) - 1
    return Drawn(
        count=len(found), median=found[round(0.5 * last)], p95=found[round(0.95 * last)], worst=found[-1],
        unstable=sum(math.isinf(ms) for ms in found),
    )


def _spread(interval: Interval | None) -> float:
    """Return the standard deviation of the logarithm."""
    if interval is None or interval.low is None or interval.high is None or interval.low <= 0.0:
        return 0.0
    return math.log(interval.high / interval.low) / (2.0 * _HALF_WIDTH)


def _scaled(plant: HeaterModel, gain: float, lag: float, dead: float) -> HeaterModel:
    known = {"gain_degC_per_pct": gain * plant.gain_degC_per_pct, "time_constant_s": lag * plant.time_constant_s,
             "dead_time_s": dead * plant.dead_time_s}
    if isinstance(plant, TwoLag):
        return TwoLag(**known, second_time_constant_s=lag * plant.second_time_constant_s)
    return Fopdt(**known)
