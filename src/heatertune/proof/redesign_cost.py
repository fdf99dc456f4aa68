"""What a change of a design does and costs, as it is told."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from heatertune.pid.values import PidDesign
from heatertune.proof.design_request import DesignResult
from heatertune.proof.long_outage import briefly
from heatertune.units import written

__all__ = ["broken", "change_sentence", "costs", "gains_told", "more_iae"]

_NOTICED: Final = 0.1  # a smaller change of heat-up or switchings is not told
_NEAR: Final = 0.05  # a factor nearer to 1 is told with a digit more
_SAME: Final = 0.005  # a factor of gains nearer to 1 is not told
_NOTHING_PCT: Final = 0.05  # more IAE than this is told
#: of what is broken → how it is told, where the story itself is kept
_BRIEFLY: Final = {"reheat": "reheat overshoot after a short open circuit",
                   "restart": "restart overshoot while the heater is warm"}


def gains_told(first: PidDesign, other: PidDesign) -> str:
    """Return by what factors gains were changed, empty where they were not."""
    factors = [other.gain_pct_per_degC / first.gain_pct_per_degC, other.integral_time_s / first.integral_time_s]
    return " and ".join(f"{name} times {factor:.{3 if abs(factor - 1.0) < _NEAR else 2}g}"
                        for name, factor in zip(("K", "TN"), factors, strict=True) if abs(factor - 1.0) >= _SAME)


def change_sentence(first: DesignResult, found: DesignResult, what: str) -> str:
    """Return the sentence of a change that passes: what failed, what was changed, and its price."""
    price = costs(first, found)
    why = f"fails ({broken(first)})" if broken(first) else "winds up"
    return f"The requested optimum {why}; with {what} every limit is kept; {price}."


def more_iae(first: DesignResult, found: DesignResult) -> float:
    """Return how much more a load disturbance costs, as a share of what it did; 0 where that is not known."""
    before, after = first.choice.search.realised.iae_load, found.choice.search.realised.iae_load
    return 0.0 if before is None or after is None else after / before - 1.0


def costs(first: DesignResult, found: DesignResult) -> str:
    """Return what another design costs beside the first, for a reader."""
    return ", ".join(_costs(first, found))


def _costs(first: DesignResult, found: DesignResult) -> Iterator[str]:
    """Return what a change costs: load disturbances, heat-up, wear of the switch."""
    more = 100.0 * more_iae(first, found)
    yield f"the IAE of a load disturbance rises by {more:.2g} %" if more > _NOTHING_PCT else "the IAE does not change"
    for name, unit in (("settling_time", "s"), ("switchings", "1/h")):
        old, new = (next(each.value for each in closed_.proof.criteria if each.name == name)
                    for closed_ in (first, found))
        if abs(new - old) > _NOTICED * old:
            yield f"the worst {name.replace('_', ' ')} changes from {written(old, 3)} to {written(new, 3)} {unit}"


def broken(found: DesignResult) -> str:
    """Return the criteria that a design breaks, in the story or in other lengths of its parts, for a reader."""
    if names := briefly(found.proof.diagnostics):
        return ", ".join(told for part, told in _BRIEFLY.items() if any(each.startswith(part) for each in names))
    return ", ".join(found.proof.broken_criteria).replace("_", " ")
