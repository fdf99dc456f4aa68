"""What a log asks for beside the heater: how it begins, a drift of the ambient, load steps; chosen together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from heatertune.model.power.load_steps import bic_of, is_plain_rest, left_over, starts, with_loads
from heatertune.model.power.open_loop import PowerFit, PowerProblem

__all__ = ["Way", "refit_all", "with_events", "without_events"]

_NEAR = 10.0  # BIC points
_FEW = 3.0  # sampling intervals
_CARRIED = 2  # starts that loads are sought for


class Way(NamedTuple):
    """One lag and two, each with the same start, drift and loads, and their fits."""

    problems: list[PowerProblem]
    fits: list[PowerFit]

    @property
    def bic(self) -> float:
        """The better of the two."""
        return min(map(bic_of, self.problems, self.fits))


def with_events(problems: Sequence[PowerProblem], fits: Sequence[PowerFit], *, closed: bool) -> Way:
    """Return one lag and two with the start, the drift and the loads that explain the log best.

    A start that is wrong passes for a drift or a load, and a drift for a load: none can be chosen before the others.
    `closed`: a controller moved the power.
    """
    given = Way(list(problems), list(fits))
    begun = [_begun(given, start) for start in starts(problems[0], closed=closed)]
    drifting = {id(way): _drifting(way) for way in begun}
    carried = sorted(begun, key=lambda way: min(way.bic, drifting[id(way)].bic))[:_CARRIED]
    ways = []
    for way in carried:
        ways += [Way(*with_loads(*drifting[id(way)])), _drifting(Way(*with_loads(*way)))]
    return min(ways, key=_worth)


def without_events(way: Way) -> Way:
    """Return the way without drift and loads, its start as it is."""
    if not way.problems[0].drift and not way.problems[0].loads_s:
        return way
    problems = [replace(problem, drift=False, loads_s=()) for problem in way.problems]
    return Way(problems, [min((near, problem.fit()), key=lambda fit: bic_of(problem, fit))
                          for problem, near in zip(problems, refit_all(problems, way.fits), strict=True)])


def refit_all(problems: Sequence[PowerProblem], fits: Sequence[PowerFit]) -> list[PowerFit]:
    """Return the fits that fits of similar problems lead to."""
    return [problem.refine(fit.vector[None, :]) for problem, fit in zip(problems, fits, strict=True)]


def _worth(way: Way) -> tuple[bool, float]:
    """Return whether a load stands for the unknown power before the log, then the criterion.

    A rest that is plain to see is not given up for a little.
    """
    first, fit = way.problems[0], way.fits[0]
    time = first.readings.time_s
    arrived = float(time[0]) + 2.0 * float(fit.vector[1]) + _FEW * float(np.median(np.diff(time)))
    plain = first.at_rest and fit.model is not None and is_plain_rest(first, fit.model.lags_s[0])
    return any(t < arrived for t in first.loads_s), way.bic - _NEAR * plain


def _begun(way: Way, start: PowerProblem) -> Way:
    """Return the way with another start."""
    if start.power_before_pct == way.problems[0].power_before_pct and not start.at_rest:
        return way
    others = [replace(p, power_before_pct=start.power_before_pct, at_rest=start.at_rest) for p in way.problems]
    near = refit_all(others, way.fits)
    if not start.at_rest:
        return Way(others, near)
    # a free initial state may have led far off
    return Way(others, [min((fit, other.fit()), key=lambda trial: bic_of(other, trial))
                        for other, fit in zip(others, near, strict=True)])


def _drifting(way: Way) -> Way:
    """Return the way with a drift of the ambient where one lag and two both ask for it."""
    if not any(map(left_over, *way)):
        return way
    others = [replace(problem, drift=True) for problem in way.problems]
    tried = Way(others, refit_all(others, way.fits))
    worth = [bic_of(*before) - bic_of(*after) for before, after in
             zip(zip(*way, strict=True), zip(*tried, strict=True), strict=True)]
    return tried if min(worth) > _NEAR else way
