"""Whether logs of one heater give the same heater, and what that means in words."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from statistics import NormalDist

from heatertune.model.diagnostics import Remark
from heatertune.model.intervals import RATIO
from heatertune.model.values import OneLog
from heatertune.units import NOMENCLATURE

__all__ = ["Disagreement", "agreement_remarks", "disagreements"]

_SHARED = ("gain_degC_per_pct", "time_constant_s", "dead_time_s", RATIO)


@dataclass(frozen=True, slots=True, kw_only=True)
class Disagreement:
    """A parameter, and the two logs whose values of it lie furthest apart for their intervals."""

    parameter: str
    first: OneLog
    second: OneLog


def disagreements(logs: Sequence[OneLog]) -> tuple[Disagreement, ...]:
    """Return the parameters whose values alone lie further apart than chance allows in 5 of 100 sets of such logs.

    The deviations of independent estimates add up as squares; the 5 % are shared out over all pairs and parameters
    (Bonferroni). An interval open towards the other value never disagrees.
    """
    pairs = list(combinations(logs, 2))
    normal = NormalDist()
    wider = normal.inv_cdf(1.0 - 0.025 / (len(_SHARED) * len(pairs))) / normal.inv_cdf(0.975)
    differing = []
    for name in _SHARED:
        apart, (first, second) = max(((_apart(name, *pair), pair) for pair in pairs), key=lambda ranked: ranked[0])
        if apart > wider:
            differing.append(Disagreement(parameter=name, first=first, second=second))
    return tuple(differing)


def _apart(name: str, first: OneLog, second: OneLog) -> float:
    """Return the distance of two values by what their intervals allow; 0 where one is open towards the other."""
    lower, upper = sorted((first, second), key=lambda log: log.values[name])
    high, low = lower.ci95[name].high, upper.ci95[name].low
    if high is None or low is None:
        return 0.0
    reach = math.hypot(high - lower.values[name], upper.values[name] - low)
    return (upper.values[name] - lower.values[name]) / max(reach, 1e-300)


def agreement_remarks(logs: Sequence[OneLog], apart: Sequence[Disagreement]) -> Iterator[Remark]:
    """Tell how well one heater serves every log, and where the logs disagree, which is a finding."""
    fits = ", ".join(f"{log.fit_pct:.1f} % of {log.name} ({log.alone_fit_pct:.1f} % alone)" for log in logs)
    yield Remark(
        "", f"One heater for all logs explains {fits}; ambient and residuals shown are those of {logs[0].name}.")
    if not apart:
        yield Remark("", "Alone, the logs give the same heater within their intervals.")
        return
    clashes = "; ".join(
        f"{NOMENCLATURE[clash.parameter][1]} {_value(clash, clash.first)} by {clash.first.name}, "
        f"{_value(clash, clash.second)} by {clash.second.name}"
        for clash in apart
    )
    yield Remark("logs-disagree", (
        f"The logs disagree beyond their intervals: {clashes}; it is not one heater, or it was not used in one way "
        "(load, fan, working point), so the intervals hold what each log says alone, and each log's own heater is a "
        "candidate."
    ))


def _value(clash: Disagreement, log: OneLog) -> str:
    ends = log.ci95[clash.parameter]
    return f"{log.values[clash.parameter]:.3g} {NOMENCLATURE[clash.parameter][2]} [{_end(ends.low)}, {_end(ends.high)}]"


def _end(value: float | None) -> str:
    return "open" if value is None else f"{value:.3g}"
