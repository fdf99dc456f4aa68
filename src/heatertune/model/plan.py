"""The experiment that makes a heater known best within limits: a doublet, optimised over instants and powers.

The figure of merit is the worst half width of a 95 % interval, as a share of its value, over gain, time constant and
dead time and over every heater of the prior.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.optimize import differential_evolution

from heatertune.errors import OutOfRange
from heatertune.model.experiment import Conditions, Prior, demand_room, errors, peaks, shares
from heatertune.model.response import Schedule

__all__ = ["Plan", "assessed", "best_step", "plan_doublet", "within_limit"]

Array = npt.NDArray[np.float64]

_READINGS = 250  # in the search; the figures told are those of all readings
_DURATIONS = (0.25, 0.5, 0.75, 1.0)  # of the longest
_STEP_AT = (0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6)  # of the duration
_STEPS = 3  # up, down, and a last stretch
_DIGIT_PCT = 0.1
_HOPELESS = 1e6  # stands for an infinite interval in the search


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Plan:
    """An experiment and what it would make known.

    Attributes:
        kind: "step", "doublet" or "relay".
        schedule: of the powers, the return to the base power included.
        duration_s: of the experiment [s].
        errors: expected standard errors on each heater of the prior, see `experiment.errors`, shape (g, 4).
        shares: half widths of the 95 % intervals as shares, shape (g, 3).
        peaks_degC: highest temperature on each heater, shape (g,).
    """

    kind: str
    schedule: Schedule
    duration_s: float
    errors: Array
    shares: Array
    peaks_degC: Array

    @property
    def worst(self) -> float:
        """The figure of merit: the worst share."""
        return float(self.shares.max())


def plan_doublet(
    prior: Prior, conditions: Conditions, *, seed: int = 1, progress: Callable[[str], object] = str
) -> list[Plan]:
    """Return the best doublet of each duration tried, the shortest first; the last one is the proposal.

    Durations grow until the aim is reached or the longest is used.

    Raises:
        OutOfRange: a limit that the heater reaches without any experiment, or that leaves less than 0.1 % of power.
    """
    demand_room(prior, conditions)
    found = []
    for share in _DURATIONS:
        duration = float(_rounded(share * conditions.longest_s, conditions.noise.sample_time_s))
        progress(f"searching a doublet of {duration:g} s on {len(prior.models)} heaters")
        found.append(_best_of(prior, conditions, duration, seed))
        if found[-1].worst <= conditions.aim:
            break
    return found


def best_step(prior: Prior, conditions: Conditions, duration_s: float) -> Plan:
    """Return the best plain step of a duration: as high as the limit lets it be, at the best instant."""
    tried = [_made(prior, conditions, duration_s, np.array([at]), np.array([conditions.most_pct])) for at in _STEP_AT]
    return replace(min(tried, key=lambda plan: plan.worst), kind="step")


def within_limit(prior: Prior, conditions: Conditions, schedule: Schedule, *, digit_pct: float = 0.0) -> Schedule:
    """Return the schedule with its departures from the base power made smaller until no heater passes the limit.

    Temperatures depart from rest in proportion to the powers, so the factor is exact. With a digit the powers are then
    rounded down to it: a heater with less power at every instant is nowhere warmer.
    """
    rest = peaks(prior, replace(schedule, power_pct=np.full(len(schedule.time_s), schedule.base_pct)))
    above = np.maximum(peaks(prior, schedule) - rest, 1e-12)
    factor = min(1.0, float(np.min((conditions.limit_degC - rest) / above)))
    power = schedule.base_pct + factor * (schedule.power_pct - schedule.base_pct)
    if digit_pct:
        power = np.floor(power / digit_pct + 1e-9) * digit_pct
    power = np.clip(power, conditions.least_pct, conditions.most_pct)
    power[-1] = schedule.base_pct
    return replace(schedule, power_pct=power)


def assessed(kind: str, prior: Prior, conditions: Conditions, schedule: Schedule, duration_s: float) -> Plan:
    """Return the plan of a schedule, its figures from all readings."""
    found = errors(prior, schedule, conditions.noise, duration_s)
    return Plan(
        kind=kind, schedule=schedule, duration_s=duration_s, errors=found, shares=shares(prior, found),
        peaks_degC=peaks(prior, schedule),
    )


def _best_of(prior: Prior, conditions: Conditions, duration: float, seed: int) -> Plan:
    noise = conditions.noise.thinned(max(1, int(duration / conditions.noise.sample_time_s / _READINGS)))
    step = best_step(prior, conditions, duration)
    at = float(step.schedule.time_s[0]) / duration
    width = conditions.most_pct - conditions.least_pct

    def powers(x: Array) -> Array:
        return np.asarray(conditions.least_pct + width * x[_STEPS:])

    def cost(x: Array) -> float:
        schedule = _drawn(conditions, duration, np.sort(x[:_STEPS]), powers(x))
        found = errors(prior, within_limit(prior, conditions, schedule), noise, duration)
        return float(np.log(min(float(shares(prior, found).max()), _HOPELESS)))

    known = np.array([at, 0.5 * (1.0 + at), 1.0, 1.0, 1.0, 1.0])  # the step: nothing worse is ever proposed
    ended = differential_evolution(
        cost, [(0.0, 1.0)] * (2 * _STEPS), x0=known, seed=seed, popsize=6, maxiter=40, tol=0.01, polish=False,
    )
    best = _made(prior, conditions, duration, np.sort(ended.x[:_STEPS]), powers(ended.x))
    return best if best.worst < step.worst else step


def _made(prior: Prior, conditions: Conditions, duration: float, at: Array, power: Array) -> Plan:
    """Return the plan as a person can carry it out: switched with a reading, powers of one digit after the point."""
    schedule = _drawn(conditions, duration, _rounded(at * duration, conditions.noise.sample_time_s) / duration, power)
    schedule = within_limit(prior, conditions, schedule, digit_pct=_DIGIT_PCT)
    last = np.append(np.diff(schedule.time_s) > 0.0, True)  # of two steps at one instant the later one holds
    schedule = replace(schedule, time_s=schedule.time_s[last], power_pct=schedule.power_pct[last])
    steps = schedule.steps_pct != 0.0
    if not steps.any():
        raise OutOfRange("limit_degC", conditions.limit_degC, "higher: it leaves less than 0.1 % of power")
    schedule = replace(schedule, time_s=schedule.time_s[steps], power_pct=schedule.power_pct[steps])
    return assessed("doublet", prior, conditions, schedule, duration)


def _drawn(conditions: Conditions, duration: float, at: Array, power: Array) -> Schedule:
    """Return the schedule of powers at shares of the duration, and back to the base power at its end."""
    return Schedule(
        base_pct=conditions.base_pct, time_s=np.append(at * duration, duration),
        power_pct=np.append(power, conditions.base_pct),
    )


def _rounded(value: Array | float, step: float) -> Array:
    return np.asarray(np.rint(np.asarray(value) / step) * step)
