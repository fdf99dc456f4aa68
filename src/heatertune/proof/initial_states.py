"""Repeat the runs nearest to a limit from other initial states: a verdict must not depend on the instant of an event.

The events of a test sequence come at whole scans and PWM periods, and always at the same remainder of the controller's
sum. In a plant they come at any phase. Usually the phase changes less than a limit has left over, so only the runs
nearest to a limit are repeated.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Final

import numpy as np

from heatertune.proof.criteria import Criterion, worst_of
from heatertune.proof.scenario import Scenario, SetpointRampEvent

__all__ = ["CLOSE", "SAME", "STATES", "near_limit", "nearest_to_limits", "other_states", "worst_state"]


CLOSE: Final = 0.95
#: of a limit, which another state may use without breaking it; it is told. The search leads parameters up to a limit,
#: and an independent judge takes so much for the same
SAME: Final = 1.02
#: of a limit, per step of scan and PWM as a share of the dead time: an event is noticed so much later at most. On drawn
#: designs another phase raised the use of a limit above 0.6 by up to 14 % of it where that share was 0.25, and by 0.2 %
#: where it was 0.06; a share of a limit of two hundredths is within what an independent judge takes for the same
_PER_STEP: Final = 0.2
_MOST_FOR_STEP: Final = 0.05
#: initial states from which it is repeated
STATES: Final = 4
#: of a scan: an event just after a scan waits longest for the next one
_JUST_AFTER: Final = 0.01
#: of a rest, by which it lasts longer at most: a slow oscillation is in another phase then
_LONGER: Final = 0.25
#: of the heater alone: no state changes it
_OF_HEATER: Final = "power_reserve"
#: criteria of one band: what hunts between two ticks uses the sum of both, and of one tick's effect
_SWING: Final = "limit_cycle"
_AT_REST: Final = frozenset({"steady_offset", _SWING})


def near_limit(step_s: float, dead_time_s: float) -> float:
    """Compute the share of a limit from which on a run is repeated.

    Args:
        step_s: the longest of scan, PWM period and sampling interval [s].
        dead_time_s: of the heater [s].
    """
    return CLOSE - min(_MOST_FOR_STEP, _PER_STEP * step_s / max(dead_time_s, step_s))


def nearest_to_limits(
    runs: Sequence[Sequence[Criterion]], shares: Sequence[float], ticks_degC: Sequence[float]
) -> list[int]:
    """Return, for each limit, the number of the run that uses most of it, if it is near the limit.

    Args:
        runs: criteria of each run.
        shares: of a limit from which on a run is near it, of each run.
        ticks_degC: what one tick of the PWM changes in the temperature at rest, of each run [°C].
    """
    nearest = dict[str, tuple[float, int]]()
    for run, (criteria, share, tick_degC) in enumerate(zip(runs, shares, ticks_degC, strict=True)):
        band = next((one.limit for one in criteria if one.name in _AT_REST and one.limit), None)
        rest = [one for one in criteria if one.name in _AT_REST]
        swing_degC = next((one.value for one in rest if one.name == _SWING), 0.0)  # a loop that is still has no tick
        at_rest = 0.0 if band is None else min(tick_degC, swing_degC) / band + sum(one.strain for one in rest)
        for one in (one for one in criteria if one.name != _OF_HEATER):
            used = at_rest if one.name in _AT_REST else one.strain
            if used > max(share, nearest.get(one.name, (0.0, 0))[0]):
                nearest[one.name] = used, run
    return sorted({run for _, run in nearest.values()})


def other_states(scenario: Scenario, scan_s: float, step_s: float) -> Iterator[Scenario]:
    """Yield a scenario whose events come at other phases of scan, PWM period and sampling interval.

    In the first one they come just after a scan, in the others at drawn phases, after a rest that lasts longer by up to
    a quarter. What a part may take stays the same. The segments of a profile keep their lengths.

    Args:
        scenario: the test sequence; its parts that come to rest do so at their end.
        scan_s: interval of the scans [s].
        step_s: the longest of scan, PWM period and sampling interval [s].
    """
    number = len(scenario.disturbances) + 1
    if number == 1 or not scenario.rests_s:
        return
    rests = np.array(scenario.rests_s)
    within = np.array([False, *(isinstance(one, SetpointRampEvent) and isinstance(other, SetpointRampEvent)
                                for one, other in pairwise(scenario.disturbances)), False])[:number]
    led = bool(scenario.disturbances) and isinstance(scenario.disturbances[-1], SetpointRampEvent)
    for state in range(STATES):
        drawn = np.random.default_rng(state).random(number)
        longer = np.where(np.arange(number) == 0, _JUST_AFTER * scan_s, 0.0) if state == 0 else (
            drawn * (step_s + _LONGER * rests))
        longer = np.where(within, 0.0, longer)
        longer[-1] = 0.0 if led else longer[-1]
        later = np.cumsum(longer)
        yield replace(
            scenario, duration_s=float(scenario.duration_s + later[-1]),
            disturbances=tuple(replace(event, time_s=event.time_s + by_s) for event, by_s in zip(
                scenario.disturbances, later.tolist(), strict=False)),
            rests_s=tuple(np.where(rests > 0.0, rests + longer, 0.0).tolist()))


def worst_state(criteria: Sequence[Criterion], others: Sequence[Sequence[Criterion]]) -> tuple[Criterion, ...]:
    """Return the criteria of a run, each limited one from the state that uses most of its limit.

    Args:
        criteria: of the run in the test sequence.
        others: the same from each other state.
    """
    return tuple(one if one.limit is None else worst_of((one, *same))
                 for one, *same in zip(criteria, *others, strict=True))
