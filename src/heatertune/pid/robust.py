"""The limits kept over heaters that a fit leaves open, not at its candidates alone.

Cutting planes: solve for the candidates; find the drawn heater on which a limit is broken most; from then on keep the
limits on this heater too, and solve again, until none of the heaters (or no more than one in twenty) breaks a limit.
The cost stays that of the candidates: the drawn heaters only guard.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

from heatertune.errors import InputError
from heatertune.model.values import FittedModel, HeaterModel
from heatertune.pid.specs import Specs
from heatertune.pid.uncertain import Drawn, draw_heaters, drawn_of, peaks_on
from heatertune.pid.values import PidDesign, Promise

__all__ = ["ROBUST", "TOLERANCE", "Broken", "Guarded", "guarded", "most_broken"]

#: way → over which of the drawn heaters the limits hold
ROBUST: Final = {"none": "none: quantiles are told only", "p95": "95 % of them", "worst": "all of them"}

#: of a limit on a drawn heater; the search itself keeps its limits to 0.2 %
TOLERANCE: Final = 1.003

Solve = Callable[[tuple[HeaterModel, ...]], PidDesign]


class Broken(NamedTuple):
    """A limit that a controller does not keep: on which of the heaters, which one, and its value there."""

    place: int
    name: str
    value: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Guarded:
    """A design that keeps its limits over drawn heaters.

    Attributes:
        design: the design.
        guards: the drawn heaters it was solved with besides the candidates; none where it kept the limits as it was.
        before, after: Ms over the drawn heaters of the design without guards, and of this one.
        way: "p95" or "worst".
    """

    design: PidDesign
    guards: tuple[HeaterModel, ...]
    before: Drawn
    after: Drawn
    way: str

    def told(self, before: float, after: float) -> str:
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

    def improved(self, fitted: FittedModel, specs: Specs, design: PidDesign) -> Guarded | None:
        """Return the same with another design, None where that breaks a limit on the drawn heaters."""
        peaks = [peaks_on(heater, design) for heater in draw_heaters(fitted)]
        if most_broken(Promise(way=self.way, limits=specs.limits), peaks) is not None:
            return None
        return replace(self, design=design, after=drawn_of([found["ms"] for found in peaks]))


def guarded(fitted: FittedModel, specs: Specs, way: str, solve: Solve, first: PidDesign) -> Guarded:
    """Return the design that keeps the limits over the heaters that `draw_heaters` draws.

    Args:
        fitted: model, candidates and intervals.
        specs: the limits.
        way: "p95" or "worst".
        solve: guards → the best design that keeps the limits on candidates and guards.
        first: the best design without guards.

    Raises:
        InputError: the fit has no interval to draw from, or no controller was found that keeps the limits.
    """
    heaters = draw_heaters(fitted)
    if not heaters:
        raise InputError(f"robust = {way} has nothing to draw heaters from: the model has no intervals; fit a log, or "
                         "tune without it")
    design, guards = first, list[HeaterModel]()
    before = None
    while True:
        peaks = [peaks_on(heater, design) for heater in heaters]
        spread = drawn_of([found["ms"] for found in peaks])
        before = before or spread
        broken = most_broken(Promise(way=way, limits=specs.limits), peaks)
        if broken is None:
            return Guarded(design=design, guards=tuple(guards), before=before, after=spread, way=way)
        guard = heaters[broken.place]
        if guard in guards:  # the search's frequencies missed what the margins' own see
            raise InputError(f"no design found that keeps {specs.text} on the heaters drawn from the fit; loosen it")
        guards.append(guard)
        design = solve(tuple(guards))


def most_broken(promise: Promise, peaks: Sequence[Mapping[str, float]]) -> Broken | None:
    """Return the heater that has to be guarded, None where enough keep the limits.

    `peaks`: of each heater, as `peaks_on` returns them.
    """
    strains = [max((found[name] / limit, name) for name, limit in promise.limits.items()) for found in peaks]
    order = sorted(range(len(strains)), key=strains.__getitem__)
    place = order[-1 if promise.way == "worst" else round(0.95 * (len(order) - 1))]
    strain, name = strains[place]
    return None if strain <= TOLERANCE else Broken(place, name, peaks[place][name])


def _quantiles(drawn: Drawn) -> str:
    unstable = f", unstable on {drawn.unstable}" if drawn.unstable else ""
    return f"{drawn.median:.3g} in the middle, {drawn.p95:.3g} on 95 %, {drawn.worst:.3g} at worst{unstable}"
