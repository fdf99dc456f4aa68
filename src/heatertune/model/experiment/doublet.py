"""The doublet that makes a heater known best within a limit, optimised over its instants and powers."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.optimize import differential_evolution

from heatertune.errors import OutOfRange
from heatertune.model.experiment.prior import ExperimentSetup, Prior, errors, peaks, rests, shares
from heatertune.model.response import Schedule

__all__ = ["REST_READINGS", "ExperimentPlan", "assess_plan", "best_step", "plan_doublet", "within_limit"]

Array = npt.NDArray[np.float64]

_READINGS = 150  # in the search; the figures told are those of all readings
_STEP_AT = (0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6)  # of the duration
_STEPS = 3  # up, down, and a last stretch
_DIGIT_PCT = 0.1
_HOPELESS = 1e6  # stands for an infinite interval in the search

#: at the base power before anything steps: a log that begins with a step hides what the power was before
REST_READINGS = 5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ExperimentPlan:
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


def plan_doublet(prior: Prior, setup: ExperimentSetup, duration_s: float, *, seed: int = 1) -> ExperimentPlan:
    """Return the best doublet of a duration, or the best plain step where no doublet is better.

    Raises:
        OutOfRange: the limit leaves less than 0.1 % of power.
    """
    noise = setup.noise.average(max(1, int(duration_s / setup.noise.sample_time_s / _READINGS)))
    step = best_step(prior, setup, duration_s)
    at = float(step.schedule.time_s[0]) / duration_s
    width = setup.most_pct - setup.least_pct

    def powers(x: Array) -> Array:
        return np.asarray(setup.least_pct + width * x[_STEPS:])

    def cost(x: Array) -> float:
        schedule = _drawn(setup, duration_s, np.sort(x[:_STEPS]), powers(x))
        std_errors = errors(prior, within_limit(prior, setup, schedule), noise, duration_s)
        return float(np.log(min(float(shares(prior, std_errors).max()), _HOPELESS)))

    plain_step = np.array([at, 0.5 * (1.0 + at), 1.0, 1.0, 1.0, 1.0])  # the step: nothing worse is ever proposed
    ended = differential_evolution(
        cost, [(0.0, 1.0)] * (2 * _STEPS), x0=plain_step, seed=seed, popsize=6, maxiter=40, tol=0.01, polish=False,
    )
    best = _made(prior, setup, duration_s, np.sort(ended.x[:_STEPS]), powers(ended.x))
    return best if best.worst < step.worst else step


def best_step(prior: Prior, setup: ExperimentSetup, duration_s: float) -> ExperimentPlan:
    """Return the best plain step of a duration: as high as the limit lets it be, at the best instant."""
    tried = [_made(prior, setup, duration_s, np.array([at]), np.array([setup.most_pct])) for at in _STEP_AT]
    return replace(min(tried, key=lambda plan: plan.worst), kind="step")


def within_limit(prior: Prior, setup: ExperimentSetup, schedule: Schedule, *, digit_pct: float = 0.0) -> Schedule:
    """Return the schedule with its departures from the base power made smaller until no heater passes the limit.

    Temperatures depart from rest in proportion to the powers, so the factor is exact. With a digit the powers are then
    rounded down to it: a heater with less power at every instant is nowhere warmer.
    """
    rest = rests(prior, schedule.base_pct)
    above = np.maximum(peaks(prior, schedule) - rest, 1e-12)
    factor = min(1.0, float(np.min((setup.limit_degC - rest) / above)))
    power = schedule.base_pct + factor * (schedule.power_pct - schedule.base_pct)
    if digit_pct:
        power = np.floor(power / digit_pct + 1e-9) * digit_pct
    power = np.clip(power, setup.least_pct, setup.most_pct)
    power[-1] = schedule.base_pct
    return replace(schedule, power_pct=power)


def assess_plan(kind: str, prior: Prior, setup: ExperimentSetup, schedule: Schedule,
                duration_s: float) -> ExperimentPlan:
    """Return the plan of a schedule, its figures from all readings.

    Args:
        kind: as in `Plan`.
        prior: heaters to serve.
        setup: of the experiment; of them the noise counts.
        schedule: of the powers.
        duration_s: of the experiment [s].
    """
    std_errors = errors(prior, schedule, setup.noise, duration_s)
    return ExperimentPlan(
        kind=kind, schedule=schedule, duration_s=duration_s, errors=std_errors, shares=shares(prior, std_errors),
        peaks_degC=peaks(prior, schedule),
    )


def _made(prior: Prior, setup: ExperimentSetup, duration: float, at: Array, power: Array) -> ExperimentPlan:
    """Return the plan as a person can carry it out: switched with a reading, powers of one digit after the point."""
    first = REST_READINGS * setup.noise.sample_time_s
    instants = np.array([min(duration, max(first, setup.noise.nearest_reading(share * duration))) for share in at])
    schedule = _drawn(setup, duration, instants / duration, power)
    schedule = within_limit(prior, setup, schedule, digit_pct=_DIGIT_PCT)
    last = np.append(np.diff(schedule.time_s) > 0.0, True)  # of two steps at one instant the later one holds
    schedule = replace(schedule, time_s=schedule.time_s[last], power_pct=schedule.power_pct[last])
    steps = schedule.steps_pct != 0.0
    if not steps.any():
        raise OutOfRange("limit_degC", setup.limit_degC, "higher: it leaves less than 0.1 % of power")
    schedule = replace(schedule, time_s=schedule.time_s[steps], power_pct=schedule.power_pct[steps])
    return assess_plan("doublet", prior, setup, schedule, duration)


def _drawn(setup: ExperimentSetup, duration: float, at: Array, power: Array) -> Schedule:
    """Return the schedule of powers at shares of the duration, and back to the base power at its end."""
    return Schedule(
        base_pct=setup.base_pct, time_s=np.append(at * duration, duration),
        power_pct=np.append(power, setup.base_pct),
    )
