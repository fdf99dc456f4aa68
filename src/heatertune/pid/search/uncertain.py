"""Heaters drawn from what a fit leaves open, and what a controller's robustness is on them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from heatertune.model.intervals import RATIO, Interval
from heatertune.model.values import FittedModel, Fopdt, HeaterModel, TwoLag
from heatertune.pid.loop.robustness import noise_gain, sensitivity_peaks
from heatertune.pid.values import PidDesign
from heatertune.units import whole

__all__ = ["SampledMs", "draw_heaters", "drawn_of", "interval_ends", "ms_over", "peaks_on", "spreads_of"]

#: half width of a 95 % interval in standard deviations
_HALF_WIDTH: Final = 1.96
_MOST_CORRELATED: Final = 0.99  # intervals are wider than their samples; beyond this they contradict each other


@dataclass(frozen=True, slots=True, kw_only=True)
class SampledMs:
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

    Each candidate in turn but for the ends of intervals, its gain and lags multiplied by lognormal factors and its dead
    time moved by a normal distance, each as wide as its 95 % interval; no dead time lies below what is believed. The
    fit's document holds no bootstrap samples; of what they would tell, the interval of gain per time constant is known:
    it gives the correlation of the two, and where they are open it alone is drawn, as a factor of the gain. Otherwise
    the numbers are independent, which is wider than the log: what it shows is rather too bad than too good. An
    interval that is open or missing adds nothing; there the candidates span what is possible.

    Raises:
        OutOfRange: a count or a seed that is no whole number from 0 on.
    """
    count, seed = (whole(name, number) for name, number in (("count", count), ("seed", seed)))
    gain, lag, dead = spreads_of(fitted)
    ratio = _spread(fitted.combinations[RATIO][1]) if RATIO in fitted.combinations else 0.0
    together = 0.0
    if ratio and not (gain and lag):
        gain, lag = ratio, 0.0
    elif ratio:
        together = (gain**2 + lag**2 - ratio**2) / (2.0 * gain * lag)
        together = min(max(together, -_MOST_CORRELATED), _MOST_CORRELATED)
    if not (gain or lag or dead):
        return ()
    normal = np.random.default_rng(seed).normal(0.0, 1.0, (count, 3))
    normal[:, 1] = together * normal[:, 0] + math.sqrt(1.0 - together**2) * normal[:, 1]
    factors, moved = np.exp(normal[:, :2] * (gain, lag)).tolist(), (dead * normal[:, 2]).tolist()
    plants, least = fitted.hypothetical, fitted.least_dead_time_s
    turns = (plants[i % len(plants)] for i in range(count))
    return tuple(_scaled(plant, gain, lag, max(plant.dead_time_s + shift, least, 0.0))
                 for plant, (gain, lag), shift in zip(turns, factors, moved, strict=True))


def peaks_on(heater: HeaterModel, design: PidDesign) -> dict[str, float]:
    """Return ms, mt and mks [%/°C] of a controller on a heater; infinite where the loop is unstable."""
    if design.sample_time_s > 0.0:
        ms, mt = sensitivity_peaks(heater, design)
        return {"ms": ms, "mt": mt, "mks": noise_gain(heater, design) if math.isfinite(ms) else math.inf}
    from heatertune.pid.continuous.optimum import margins  # noqa: PLC0415 - compiles; words are of sampled loops

    judged, noise = margins((heater,), design)
    return {"ms": judged.ms, "mt": judged.mt, "mks": noise}


def spreads_of(fitted: FittedModel) -> tuple[float, float, float]:
    """Return the standard deviations of the logarithms of gain and lags, and of the dead time itself [s].

    0 where the interval of gain or lag is open. A dead time whose lower end is open reaches down to the least that is
    believed; one whose upper end is open is as wide above the working model's as below.
    """
    gain, lag = (_spread(fitted.ci95.get(name)) for name in ("gain_degC_per_pct", "time_constant_s"))
    dead = fitted.ci95.get("dead_time_s")
    if dead is None:
        return gain, lag, 0.0
    low = fitted.least_dead_time_s if dead.low is None else max(dead.low, fitted.least_dead_time_s)
    middle = max(fitted.model.dead_time_s, low)
    high = 2.0 * middle - low if dead.high is None else max(dead.high, low)
    return gain, lag, (high - low) / (2.0 * _HALF_WIDTH)


def interval_ends(fitted: FittedModel) -> tuple[HeaterModel, ...]:
    """Return the working model with one parameter at a time at each closed end of its 95 % interval."""
    names = ("gain_degC_per_pct", "time_constant_s", "dead_time_s")
    intervals = [(name, fitted.ci95.get(name)) for name in names]
    ends = [(name, end) for name, its in intervals if its is not None for end in (its.low, its.high)]
    return tuple(replace(fitted.model, **{name: end}) for name, end in ends if end is not None and (
        end >= 0.0 if name == "dead_time_s" else end * getattr(fitted.model, name) > 0.0))


def ms_over(heaters: tuple[HeaterModel, ...], design: PidDesign) -> SampledMs | None:
    """Return the quantiles of Ms of one controller over heaters; None where there are none."""
    if not heaters:
        return None
    if design.sample_time_s == 0.0:
        return drawn_of([peaks_on(heater, design)["ms"] for heater in heaters])
    return drawn_of([sensitivity_peaks(heater, design)[0] for heater in heaters])


def drawn_of(values: Sequence[float]) -> SampledMs:
    """Return the quantiles of Ms of one controller, given its value on each heater; at least one."""
    rising = sorted(values)
    last = len(rising) - 1
    return SampledMs(
        count=len(rising), median=rising[round(0.5 * last)], p95=rising[round(0.95 * last)], worst=rising[-1],
        unstable=sum(math.isinf(ms) for ms in rising),
    )


def _spread(interval: Interval | None) -> float:
    """Return the standard deviation of the logarithm."""
    if interval is None or interval.low is None or interval.high is None or interval.low * interval.high <= 0.0:
        return 0.0
    small, large = sorted((abs(interval.low), abs(interval.high)))
    return math.log(large / small) / (2.0 * _HALF_WIDTH)


def _scaled(plant: HeaterModel, gain: float, lag: float, dead_s: float) -> HeaterModel:
    scaled = {"gain_degC_per_pct": gain * plant.gain_degC_per_pct, "time_constant_s": lag * plant.time_constant_s,
             "dead_time_s": dead_s}
    if isinstance(plant, TwoLag):
        return TwoLag(**scaled, second_time_constant_s=lag * plant.second_time_constant_s)
    return Fopdt(**scaled)
