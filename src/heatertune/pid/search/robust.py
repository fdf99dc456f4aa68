"""The limits kept over heaters that a fit leaves open, not at its candidates alone.

Cutting planes: solve for the candidates; find the drawn heater on which a limit is broken most; from then on keep the
limits on this heater too, and solve again, until none of the heaters (or no more than few enough) breaks a limit.
The cost stays that of the candidates: the drawn heaters only guard.

What holds on the heaters it was tuned on need not hold on others: to keep the limits on 95 % of all, a second set,
drawn apart, has to keep them too, and so few of it may break one that chance in drawing does not undo the promise.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

from heatertune.errors import InputError
from heatertune.model.values import FittedModel, HeaterModel
from heatertune.pid.search.uncertain import SampledMs, draw_heaters, drawn_of, peaks_on
from heatertune.pid.specs import Specs
from heatertune.pid.values import PidDesign, Promise

__all__ = ["ROBUST", "BrokenLimit", "Open", "RobustDesign", "robust_design"]

#: way → over which of the drawn heaters the limits hold
ROBUST: Final = {"none": "none: quantiles are told only", "p95": "95 % of them", "worst": "all of them"}

Solve = Callable[[tuple[HeaterModel, ...]], PidDesign]


#: heaters that a design is tuned on, and others that it is checked on
_TUNED_ON: Final = 200
_CHECKED_ON: Final = 1000
_CHECK_SEED: Final = 1

#: way → share of the drawn heaters that may break a limit: with 0.036 of 1000, 95 % of all keep it in 98 of 100 draws
_MAY_BREAK: Final = {"p95": 0.036, "worst": 0.0}


class BrokenLimit(NamedTuple):
    """A limit that a controller does not keep: on which of the heaters, which one, and its value there."""

    heater: HeaterModel
    name: str
    value: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Open:
    """The heaters that a fit leaves open, in the two sets that a promise is kept on; none where it has no intervals.

    Attributes:
        tuned_on: drawn first.
        checked_on: drawn apart; none where the limits are to hold on all of the first, which no other set shares.
    """

    tuned_on: tuple[HeaterModel, ...]
    checked_on: tuple[HeaterModel, ...]

    @classmethod
    def of(cls, fitted: FittedModel, way: str) -> Open:
        """Return the heaters of a fit; `way`: "p95" or "worst"."""
        others = draw_heaters(fitted, _CHECKED_ON, seed=_CHECK_SEED) if way == "p95" else ()
        return cls(tuned_on=draw_heaters(fitted, _TUNED_ON), checked_on=others)

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self.tuned_on) + len(self.checked_on)

    def broken(self, promise: Promise, design: PidDesign) -> BrokenLimit | None:
        """Return the heater that has to be guarded, None where enough of both sets keep the limits."""
        for heaters in (self.tuned_on, self.checked_on):
            peaks = [peaks_on(heater, design) for heater in heaters]
            broken = _most_broken(promise, heaters, peaks) if heaters else None
            if broken is not None:
                return broken
        return None

    def ms(self, design: PidDesign) -> SampledMs:
        """Return the quantiles of Ms over both sets."""
        return drawn_of([peaks_on(heater, design)["ms"] for heater in (*self.tuned_on, *self.checked_on)])


@dataclass(frozen=True, slots=True, kw_only=True)
class RobustDesign:
    """A design that keeps its limits over drawn heaters.

    Attributes:
        design: the design.
        guards: the drawn heaters it was solved with besides the candidates; none where it kept the limits as it was.
        before, after: Ms over the drawn heaters of the design without guards, and of this one.
        way: "p95" or "worst".
    """

    design: PidDesign
    guards: tuple[HeaterModel, ...]
    before: SampledMs
    after: SampledMs
    way: str

    def sentence(self, before: float, after: float) -> str:
        """Return what robustness gave and what it costs.

        Args:
            before: cost of the design without guards, in the unit of the objective; −K for a P controller.
            after: cost of this design.
        """
        where = f"the limits hold on {ROBUST[self.way]}, Ms {_quantiles(self.after)}"
        if not self.guards:
            return f"Robust over {self.after.count} heaters drawn from the fit: {where}; that cost nothing."
        more = 100.0 * ((after / before if before > 0.0 else before / after) - 1.0)
        return (
            f"Robust over {self.after.count} heaters drawn from the fit: {where}, by {len(self.guards)} of them as "
            f"guards; without, Ms was {_quantiles(self.before)}. That costs {more:.1f} %."
        )

    def with_design(self, heaters: Open, specs: Specs, design: PidDesign) -> RobustDesign | None:
        """Return the same with another design, None where that breaks a limit on the drawn heaters."""
        if heaters.broken(Promise(way=self.way, limits=specs.limits), design) is not None:
            return None
        return replace(self, design=design, after=heaters.ms(design))


def robust_design(heaters: Open, specs: Specs, way: str, solve: Solve, first: PidDesign) -> RobustDesign:
    """Return the design that keeps the limits over the heaters that a fit leaves open.

    Args:
        heaters: drawn from the fit.
        specs: the limits.
        way: "p95" or "worst".
        solve: guards → the best design that keeps the limits on candidates and guards.
        first: the best design without guards.

    Raises:
        InputError: the fit has no interval to draw from, or no controller was found that keeps the limits.
    """
    if not len(heaters):
        raise InputError(f"robust = {way} has nothing to draw heaters from: the model has no intervals; fit a log, or "
                         "tune without it")
    design, guards, before = first, list[HeaterModel](), heaters.ms(first)
    promise = Promise(way=way, limits=specs.limits)
    while (broken := heaters.broken(promise, design)) is not None:
        if broken.heater in guards:  # the search's frequencies missed what the margins' own see
            raise InputError(f"no design found that keeps {specs.text} on the heaters drawn from the fit; loosen it")
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
    return f"{drawn.median:.3g} in the middle, {drawn.p95:.3g} on 95 %, {drawn.worst:.3g} at worst{unstable}"
