"""Gains beside the optimum: on the bound of Ms or a tighter one, with another TN, by what they cost."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from typing import Final

from heatertune.model.cooler_mirror import cools, mirror_heater
from heatertune.model.values import FittedModel
from heatertune.pid.search.feasible import Problem, keeps, largest_gain, search
from heatertune.pid.values import PidDesign
from heatertune.plc import Scaling, controller_for
from heatertune.plc.design import loop_fit
from heatertune.settings import TuneSettings

__all__ = ["GainFamily", "GainPoint"]

#: shares of the way from Ms = 1 to the limit → times the optimum's TN, of the places that are tried first
_GRID: Final = {1.0: (0.7, 1.4, 2.0, 3.0, 5.0), 0.7: (0.7, 1.0, 1.4, 2.0, 3.0), 0.4: (1.0, 1.5, 2.5)}
_LEAST_SHARE: Final = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class GainPoint:
    """Where gains stand beside the optimum, whose place is (limit, 1).

    Attributes:
        ms: bound on which K stands.
        factor: of TN.
    """

    ms: float
    factor: float

    def towards(self, other: GainPoint, share: float) -> GainPoint:
        """Return the place a share of the way to another one."""
        return GainPoint(ms=self.ms + share * (other.ms - self.ms),
                     factor=self.factor * (other.factor / self.factor) ** share)


@dataclass(frozen=True, slots=True, kw_only=True)
class GainFamily:
    """Designs on the bounds of Ms.

    Attributes:
        problem: whose limits they keep, but for a tighter Ms; of a cooler its mirror image's.
        optimum: of it.
        cooler: whether the designs are a cooler's, the same with K below zero.
    """

    problem: Problem
    optimum: PidDesign
    cooler: bool = False
    _known: dict[GainPoint, PidDesign | None] = field(default_factory=dict, init=False, repr=False, compare=False)

    @classmethod
    @lru_cache(maxsize=16)  # many changes that a search tries have the same gains
    def of(
        cls, wished: PidDesign, fitted: FittedModel, tuned: TuneSettings, target: str, scaling: Scaling
    ) -> GainFamily:
        """Return the family of a design that is an optimum; of another one, where TA, Ms or parts are asked otherwise.

        Args:
            wished: the design.
            fitted: the heater and its candidates.
            tuned: how it was found.
            target: the controller.
            scaling: sensor range.

        Raises:
            InputError: no gains keep the limits.
        """
        its, cooler = controller_for(target), cools(fitted)
        fitted = loop_fit(fitted, target, scaling)
        if cooler:
            fitted, wished = mirror_heater(fitted), _turned(wished)
        problem = Problem(
            plants=fitted.plants, structure=tuned.structure, ms=tuned.ms, mt=tuned.mt, mks=tuned.mks,
            sample_time_s=tuned.sample_time_s or wished.sample_time_s, derivative_filter=wished.derivative_filter,
            objective=tuned.objective, weight=tuned.weight, step_power=wished.step_power_limit_pct_per_degC)
        if its.most_gain is not None:
            problem = replace(problem, most_gain=partial(its.most_gain, scaling))
        same = (wished.structure, wished.sample_time_s) == (problem.structure, problem.sample_time_s)
        optimum = wished if same and keeps(problem, wished) else search(problem)
        return cls(problem=problem, optimum=optimum, cooler=cooler)

    @property
    def place(self) -> GainPoint:
        """Where the optimum stands."""
        return GainPoint(ms=self.problem.ms, factor=1.0)

    def places(self) -> list[GainPoint]:
        """Return places all around, the one whose load disturbances cost the least first, without the optimum's."""
        around = [self._place(share, factor) for share, factors in _GRID.items() for factor in factors]
        return sorted(around, key=self._price)

    def near(self, place: GainPoint, step: float) -> list[GainPoint]:
        """Return the places a step away: a share of the way of Ms, and a factor exp(2·step) of TN."""
        share = (place.ms - 1.0) / (self.problem.ms - 1.0)
        steps = ((0.0, 2.0), (0.0, -2.0), (1.0, 0.0), (-1.0, 0.0))
        around = {self._place(min(1.0, max(_LEAST_SHARE, share + up * step)), place.factor * math.exp(along * step))
                  for up, along in steps}
        return sorted(around - {place}, key=self._price)

    def _place(self, share: float, factor: float) -> GainPoint:
        return GainPoint(ms=1.0 + share * (self.problem.ms - 1.0), factor=factor)

    def _price(self, place: GainPoint) -> float:
        design = self._upright(place)
        return math.inf if design is None else self.problem.least_cost(design)

    def at(self, place: GainPoint) -> PidDesign | None:
        """Return the design at a place, None where no gain keeps the limits."""
        design = self._upright(place)
        return design if design is None or not self.cooler else _turned(design)

    def _upright(self, place: GainPoint) -> PidDesign | None:
        if place not in self._known:
            self._known[place] = self.optimum if place == self.place else self._on_the_bound(place)
        return self._known[place]

    def _on_the_bound(self, place: GainPoint) -> PidDesign | None:
        tn, tv = place.factor * self.optimum.integral_time_s, self.optimum.derivative_time_s
        problem = replace(self.problem, ms=place.ms)
        gains = largest_gain(problem, tn, tv)
        if not gains:
            return None
        return replace(problem.design(gains[0], tn, tv), method=f"Ms <= {place.ms:.4g} at TN = {tn:.4g} s")


def _turned(design: PidDesign) -> PidDesign:
    """Return the design for the mirror image."""
    return replace(design, gain_pct_per_degC=-design.gain_pct_per_degC)
