"""What passes, when the heater's circuit is open for longer than in the story.

Most controllers stop summing somewhere, and how long it is open changes nothing. One that does not asks for more power
the longer it waits, so no story is long enough: what it does after a longer one leaves its words unproven.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Final, NamedTuple

from heatertune.model.findings import Finding
from heatertune.proof.scenario import Mains, Scenario
from heatertune.proof.verdict import Heard

__all__ = ["Night", "night_of", "winds_up", "wound_up"]

_NAME: Final = "winds-up"
_TIMES: Final = 4.0  # as long as in the story


class Night(NamedTuple):
    """A longer open circuit.

    Attributes:
        scenario: from the heat-up right into it, and the way back.
        proven_s: how long the circuit was open in the story [s].
        open_s: how long it is now [s].
    """

    scenario: Scenario
    proven_s: float
    open_s: float


def night_of(scenario: Scenario) -> Night | None:
    """Return the longest open circuit of a story, longer, right after the heat-up; None: none is closed again."""
    ends = [*(event.time_s for event in scenario.disturbances), scenario.duration_s]
    opened = {number: closed.time_s - event.time_s
              for number, (event, closed) in enumerate(pairwise(scenario.disturbances))
              if isinstance(event, Mains) and isinstance(closed, Mains) and event.share == 0.0 < closed.share}
    if not opened:
        return None
    number = max(opened, key=lambda one: opened[one])
    off_s, open_s = ends[0], _TIMES * opened[number]
    events = [replace(event, time_s=time_s) for event, time_s in zip(
        scenario.disturbances[number:number + 2], (off_s, off_s + open_s), strict=True)]
    rests = scenario.rests_s
    longer = replace(scenario, disturbances=tuple(events), rests_s=(*rests[:1], *rests[number + 1:number + 3]),
                     duration_s=off_s + open_s + ends[number + 2] - ends[number + 1])
    return Night(longer, opened[number], open_s)


def wound_up(night: Night, overshoot: str) -> Finding:
    """Return what an overshoot after the longer time means.

    Args:
        night: which time.
        overshoot: above the setpoint, with its unit.
    """
    return Finding(name=_NAME, told=(
        f"After {night.open_s / 3600.0:.2g} h with an open circuit it overshoots by {overshoot}; the limit is kept "
        f"after {night.proven_s / 3600.0:.2g} h."))


def winds_up(heard: Heard) -> bool:
    """Return whether that was found, and the user has not accepted it."""
    return _NAME not in heard.accepted and any(finding.name == _NAME for finding in heard.findings)
