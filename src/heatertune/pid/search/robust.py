"""Limits kept on heaters sampled from the uncertainty of a fit, not only on its candidates.

Cutting planes: solve for the candidates, add the sampled heater that violates a limit most as a constraint, and solve
again until no heater, or no more than an allowed number, violates one. The cost remains that of the candidates.

To keep the limits on 95 % of all heaters, a second, independent set of samples is checked too, and so few of it may
violate a limit that the claim holds in spite of the randomness of sampling.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from heatertune.errors import InputError
from heatertune.model.model_values import FittedModel, Fopdt, HeaterModel, TwoLag
from heatertune.model.statistics import RATIO, Interval
from heatertune.model.two_scales import TwoScale
from heatertune.pid.design_values import PidDesign, Promise
from heatertune.pid.sampled_loop import noise_gain, sensitivity_peaks
from heatertune.pid.specs import Specs
from heatertune.units import whole

__all__ = [
    "ROBUST", "BrokenLimit", "Open", "RobustDesign", "SampledMs", "draw_heaters", "interval_ends", "ms_over",
    "ms_quantiles", "peaks_on", "robust_design", "spreads_of",
]


#: half width of a 95 % interval in standard deviations
_HALF_WIDTH: Final = 1.96
_MOST_CORRELATED: Final = 0.99  # intervals are wider than their samples; beyond this they contradict each other


@dataclass(frozen=True, slots=True, kw_only=True)
class SampledMs:
    """Ms over sampled heaters; infinite if the loop is unstable.

    Attributes:
        count: number of samples.
        median, p95, worst: of Ms.
        unstable: number of samples with an unstable loop.
    """

    count: int
    median: float
    p95: float
    worst: float
    unstable: int


def draw_heaters(fitted: FittedModel, count: int = 200, *, seed: int = 0) -> tuple[HeaterModel, ...]:
    """Sample heaters that the log does not rule out; empty if the fit has no intervals.

    Candidates other than the ends of intervals are used in turn. Gain and lags are multiplied by lognormal factors, and
    a normal deviate is added to the dead time, each as wide as its 95 % interval; no dead time is below the plausible
    minimum. The fit's document contains no bootstrap samples, but the interval of gain per time constant is known: it
    gives the correlation of the two, and if they are open it alone is sampled, as a factor of the gain. Otherwise the
    parameters are independent, which is wider than the log allows and therefore conservative. An interval that is open
    or missing adds nothing; there the candidates span the range.

    Raises:
        OutOfRange: a count or a seed that is not a non-negative integer.
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
    """Return ms, mt and mks [%/°C] of a controller on a heater; infinite if the loop is unstable."""
    if design.sample_time_s > 0.0:
        ms, mt = sensitivity_peaks(heater, design)
        return {"ms": ms, "mt": mt, "mks": noise_gain(heater, design) if math.isfinite(ms) else math.inf}
    from heatertune.pid.continuous_optimum import margins

    judged, noise = margins((heater,), design)
    return {"ms": judged.ms, "mt": judged.mt, "mks": noise}


def spreads_of(fitted: FittedModel) -> tuple[float, float, float]:
    """Return the standard deviations of the logarithms of gain and lags, and of the dead time itself [s].

    They are 0 if the interval of gain or lag is open. A dead time with an open lower end reaches down to the plausible
    minimum; one with an open upper end is as wide above the working model as below.
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
    """Return the quantiles of Ms of one controller over heaters; None without heaters."""
    if not heaters:
        return None
    if design.sample_time_s == 0.0:
        return ms_quantiles([peaks_on(heater, design)["ms"] for heater in heaters])
    return ms_quantiles([sensitivity_peaks(heater, design)[0] for heater in heaters])


def ms_quantiles(values: Sequence[float]) -> SampledMs:
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
    if isinstance(plant, TwoScale):
        return plant.scaled(gain, lag, dead_s)
    if isinstance(plant, TwoLag):
        return TwoLag(**scaled, second_time_constant_s=lag * plant.second_time_constant_s)
    return Fopdt(**scaled)


#: way → over which of the sampled heaters the limits hold
ROBUST: Final = {"none": "none: quantiles are told only", "p95": "95 % of them", "worst": "all of them"}

Solve = Callable[[tuple[HeaterModel, ...]], PidDesign]


#: heaters that a design is tuned on, and others that it is checked on
_TUNED_ON: Final = 200
_CHECKED_ON: Final = 1000
_CHECK_SEED: Final = 1

#: way → share of the sampled heaters that may break a limit: with 0.036 of 1000, 95 % of all keep it in 98 of 100 draws
_MAY_BREAK: Final = {"p95": 0.036, "worst": 0.0}


class BrokenLimit(NamedTuple):
    """A limit that a controller does not keep: on which of the heaters, which one, and its value there."""

    heater: HeaterModel
    name: str
    value: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Open:
    """The heaters sampled from the uncertainty of a fit, in two sets for tuning and checking; empty without intervals.

    Attributes:
        tuned_on: the first set.
        checked_on: an independent set; empty if the limits have to hold on all heaters of the first.
    """

    tuned_on: tuple[HeaterModel, ...]
    checked_on: tuple[HeaterModel, ...]

    @classmethod
    def of(cls, fitted: FittedModel, way: str) -> Open:
        """Return the heaters of a fit; `way`: "p95" or "worst"."""
        others = draw_heaters(fitted, _CHECKED_ON, seed=_CHECK_SEED) if way == "p95" else ()
        return cls(tuned_on=draw_heaters(fitted, _TUNED_ON), checked_on=others)

    def __len__(self) -> int:
        """Return the number of heaters."""
        return len(self.tuned_on) + len(self.checked_on)

    def broken(self, promise: Promise, design: PidDesign) -> BrokenLimit | None:
        """Return the heater to add as a constraint, None if enough of both sets keep the limits."""
        for heaters in (self.tuned_on, self.checked_on):
            peaks = [peaks_on(heater, design) for heater in heaters]
            broken = _most_broken(promise, heaters, peaks) if heaters else None
            if broken is not None:
                return broken
        return None

    def ms(self, design: PidDesign) -> SampledMs:
        """Return the quantiles of Ms over both sets."""
        return ms_quantiles([peaks_on(heater, design)["ms"] for heater in (*self.tuned_on, *self.checked_on)])


@dataclass(frozen=True, slots=True, kw_only=True)
class RobustDesign:
    """A design that keeps its limits over sampled heaters.

    Attributes:
        design: the design.
        guards: the sampled heaters added as constraints; empty if the first design kept the limits.
        before, after: Ms over the sampled heaters of the design without guards, and of this one.
        way: "p95" or "worst".
    """

    design: PidDesign
    guards: tuple[HeaterModel, ...]
    before: SampledMs
    after: SampledMs
    way: str

    def sentence(self, before: float, after: float) -> str:
        """Describe the effect and the cost of robustness.

        Args:
            before: cost of the design without guards, in the unit of the objective; −K for a P controller.
            after: cost of this design.
        """
        where = f"the limits hold on {ROBUST[self.way]}, Ms {_quantiles(self.after)}"
        if not self.guards:
            return f"Robust over {self.after.count} heaters sampled from the fit: {where}, at no cost."
        more = 100.0 * ((after / before if before > 0.0 else before / after) - 1.0)
        return (
            f"Robust over {self.after.count} heaters sampled from the fit: {where}, with {len(self.guards)} of them as "
            f"constraints (Ms {_quantiles(self.before)} without them). This costs {more:.1f} %."
        )

    def with_design(self, heaters: Open, specs: Specs, design: PidDesign) -> RobustDesign | None:
        """Return a copy with another design, None if that breaks a limit on the sampled heaters."""
        if heaters.broken(Promise(way=self.way, limits=specs.limits), design) is not None:
            return None
        return replace(self, design=design, after=heaters.ms(design))


def robust_design(heaters: Open, specs: Specs, way: str, solve: Solve, first: PidDesign) -> RobustDesign:
    """Return the design that keeps the limits on the heaters sampled from a fit.

    Args:
        heaters: drawn from the fit.
        specs: the limits.
        way: "p95" or "worst".
        solve: guards → the best design that keeps the limits on candidates and guards.
        first: the best design without guards.

    Raises:
        InputError: the fit has no intervals, or no controller was found that keeps the limits.
    """
    if not len(heaters):
        raise InputError(f"robust = {way} needs a model with intervals to sample heaters from; fit a log, or tune "
                         "without it")
    design, guards, before = first, list[HeaterModel](), heaters.ms(first)
    promise = Promise(way=way, limits=specs.limits)
    while (broken := heaters.broken(promise, design)) is not None:
        if broken.heater in guards:  # the search's frequencies missed a peak that the margins detect
            raise InputError(f"no design keeps {specs.text} on the heaters sampled from the fit; loosen it")
        guards.append(broken.heater)
        design = solve(tuple(guards))
    return RobustDesign(design=design, guards=tuple(guards), before=before, after=heaters.ms(design), way=way)


def _most_broken(
    promise: Promise, heaters: Sequence[HeaterModel], peaks: Sequence[Mapping[str, float]]
) -> BrokenLimit | None:
    strains = [max((there[name] / limit, name) for name, limit in promise.limits.items()) for there in peaks]
    order = sorted(range(len(strains)), key=strains.__getitem__)
    place = order[len(order) - 1 - math.floor(_MAY_BREAK[promise.way] * len(order))]
    strain, name = strains[place]
    return None if strain <= 1.0 else BrokenLimit(heaters[place], name, peaks[place][name])


def _quantiles(drawn: SampledMs) -> str:
    unstable = f", unstable on {drawn.unstable}" if drawn.unstable else ""
    return f"median {drawn.median:.3g}, 95th percentile {drawn.p95:.3g}, worst {drawn.worst:.3g}{unstable}"
