"""The most informative experiment within given limits: a doublet (its times and powers), or a relay test.

The figure of merit is the worst relative half width of a 95 % interval, over gain, time constant and dead time and
over every heater of the prior. Also the JSON document of `heatertune plan`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from itertools import product
from typing import Any, Final

import numpy as np
from scipy.optimize import differential_evolution

from heatertune.arrays import Array
from heatertune.errors import InputError, OutOfRange, UnknownName
from heatertune.model.experiment.fisher import (
    QUANTITIES,
    ExperimentSetup,
    Prior,
    ReadingNoise,
    Schedule,
    demand_room,
    errors,
    peaks,
    rests,
    shares,
)
from heatertune.model.model_values import HeaterModel
from heatertune.model.relay_test import TwoLevelRelay, simulate_relay

__all__ = [
    "KINDS", "REST_READINGS", "SCHEMA", "ExperimentPlan", "RelayPlan", "assess_plan", "best_step", "plan_doublet",
    "plan_relay", "propose", "to_document", "within_limit",
]


_READINGS = 150  # in the search; reported figures use all readings
_STEP_AT = (0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6)  # of the duration
_STEPS = 3  # up, down, and a last stretch
_DIGIT_PCT = 0.1
_HOPELESS = 1e6  # represents an infinite interval in the search

#: at the base power before the first step: a log that begins with a step hides the power before
REST_READINGS = 5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ExperimentPlan:
    """An experiment and its expected accuracy.

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
    best = _practical_plan(prior, setup, duration_s, np.sort(ended.x[:_STEPS]), powers(ended.x))
    return best if best.worst < step.worst else step


def best_step(prior: Prior, setup: ExperimentSetup, duration_s: float) -> ExperimentPlan:
    """Return the best plain step of a duration: as high as the limit lets it be, at the best instant."""
    tried = [_practical_plan(prior, setup, duration_s, np.array([at]), np.array([setup.most_pct])) for at in _STEP_AT]
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


def _practical_plan(prior: Prior, setup: ExperimentSetup, duration: float, at: Array, power: Array) -> ExperimentPlan:
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
        base_pct=setup.base_pct, time_s=np.append(at * duration, duration), power_pct=np.append(power, setup.base_pct),
    )


_CHATTER = 3.0  # standard deviations: noise alone then hardly ever switches the relay
_HIGH = (1.0, 0.85, 0.7, 0.55, 0.4, 0.3, 0.2)  # of the power above the least
_LOW = (0.0, 0.25, 0.5)  # of the high power above the least
_AT = (0.25, 0.35, 0.5, 0.65, 0.75)  # of the span of setpoints that swing on every heater
_REST = 0.05  # of the duration: it gives the fit the steady state
_RELAY_READINGS = 400  # in the search; reported figures use all readings
_SWITCHES = 6  # up to the end of the second whole period: fewer have no information


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RelayPlan(ExperimentPlan):
    """A relay test and its expected accuracy.

    The schedule is the one expected on the working model; on the real heater the relay determines it.

    Attributes:
        relay: setpoint, hysteresis and powers to set.
        rest_s: time at base power before the relay is switched on [s].
        periods_s: expected period on each heater, shape (g,).
    """

    relay: TwoLevelRelay
    rest_s: float
    periods_s: Array


def plan_relay(prior: Prior, setup: ExperimentSetup, duration_s: float) -> RelayPlan | None:
    """Return the best relay test of a duration, None if none swings for two periods on all heaters within the limit.

    Its hysteresis is three standard deviations of the noise and at least the sensor's resolution; its setpoint and its
    two powers are searched with a relay that switches exactly at the crossing; the result keeps the limit, and has its
    figures, with a relay that switches at the next reading.
    """
    noise = setup.noise
    hysteresis = math.ceil(100.0 * max(_CHATTER * noise.std_degC, noise.resolution_degC) - 1e-9) / 100.0
    thinned = noise.average(max(1, int(duration_s / noise.sample_time_s / _RELAY_READINGS)))
    ranked: list[tuple[float, TwoLevelRelay]] = []
    for relay in _relays(prior, setup, hysteresis):
        tested = _tested(prior, setup, relay, duration_s)
        if tested is not None:
            ranked.append((float(_assessed(prior, tested, thinned, duration_s)[1].max()), relay))
    for _, relay in sorted(ranked, key=lambda entry: entry[0]):
        tested = _tested(prior, setup, relay, duration_s, sample_time_s=noise.sample_time_s)
        if tested is not None:
            std_errors, widths, highest = _assessed(prior, tested, noise, duration_s)
            return RelayPlan(
                kind="relay", schedule=tested[0], duration_s=duration_s, errors=std_errors, shares=widths,
                peaks_degC=highest, relay=relay, rest_s=_rest_s(setup, duration_s),
                periods_s=np.array([_period(schedule) for schedule in tested]),
            )
    return None


def _rest_s(setup: ExperimentSetup, duration_s: float) -> float:
    return setup.noise.nearest_reading(max(_REST * duration_s, REST_READINGS * setup.noise.sample_time_s))


def _relays(prior: Prior, setup: ExperimentSetup, hysteresis: float) -> list[TwoLevelRelay]:
    """Return the relays that swing on every heater once they are on, powers in whole percent."""
    relays = []
    room = setup.most_pct - setup.least_pct
    for share, lower in product(_HIGH, _LOW):
        high = float(np.floor(setup.least_pct + share * room))
        low = float(np.ceil(setup.least_pct + lower * share * room))
        coolest = float(rests(prior, low).max()) + hysteresis
        warmest = min(float(rests(prior, high).min()), setup.limit_degC) - hysteresis
        if warmest <= coolest or high <= low:
            continue
        for at in _AT:
            setpoint = round(coolest + at * (warmest - coolest), 1)
            if coolest < setpoint < warmest:
                relays.append(TwoLevelRelay(setpoint_degC=setpoint, hysteresis_degC=hysteresis, high_pct=high,
                                            low_pct=low))
    return relays


def _tested(
    prior: Prior, setup: ExperimentSetup, relay: TwoLevelRelay, duration_s: float, *, sample_time_s: float | None = None
) -> list[Schedule] | None:
    """Return the powers on each heater, None if one exceeds the limit or oscillates too few times."""
    schedules, rest_s = [], _rest_s(setup, duration_s)
    for label, model in prior.models.items():
        schedule = simulate_relay(
            model, relay, duration_s - rest_s, base_pct=setup.base_pct, sample_time_s=sample_time_s
        )
        schedule = Schedule(
            base_pct=setup.base_pct, time_s=np.append(schedule.time_s + rest_s, duration_s),
            power_pct=np.append(schedule.power_pct, setup.base_pct),
        )
        alone = _alone(prior, label, model)
        if len(schedule.time_s) - 1 < _SWITCHES or peaks(alone, schedule)[0] > setup.limit_degC:
            return None
        schedules.append(schedule)
    return schedules


def _assessed(
    prior: Prior, schedules: list[Schedule], noise: ReadingNoise, duration_s: float
) -> tuple[Array, Array, Array]:
    """Return standard errors, shares and peaks: on each heater of the powers that the relay sets there."""
    std_errors, widths, highest = [], [], []
    for (label, model), schedule in zip(prior.models.items(), schedules, strict=True):
        alone = _alone(prior, label, model)
        std_errors.append(errors(alone, schedule, noise, duration_s)[0])
        widths.append(shares(alone, std_errors[-1][None, :])[0])
        highest.append(peaks(alone, schedule)[0])
    return np.array(std_errors), np.array(widths), np.array(highest)


def _alone(prior: Prior, label: str, model: HeaterModel) -> Prior:
    return Prior(models={label: model}, ambient_known=prior.ambient_known)


def _period(schedule: Schedule) -> float:
    """Return the mean length of the whole periods behind the first switch [s]."""
    switches = schedule.time_s[1:-1]
    whole = (len(switches) - 1) // 2
    return float(switches[2 * whole] - switches[0]) / whole


SCHEMA: Final = "heatertune/plan/1"

_Z95 = 1.96  # half width of a 95 % interval in standard errors


def to_document(prior: Prior, setup: ExperimentSetup, tried: list[ExperimentPlan]) -> dict[str, Any]:
    """Return the document of the experiments tried, the last of which is proposed.

    Args:
        prior: heaters that are served.
        setup: limits and aim.
        tried: as `propose` returns them.
    """
    chosen = tried[-1]
    document: dict[str, Any] = {
        "schema": SCHEMA, "kind": chosen.kind, "duration_s": chosen.duration_s,
        "conditions": asdict(setup),
        "schedule": {
            "base_pct": chosen.schedule.base_pct, "time_s": chosen.schedule.time_s,
            "power_pct": chosen.schedule.power_pct,
        },
        "highest_degC": float(chosen.peaks_degC.max()),
        "quantities": {name: _quantity(prior, chosen, i) for i, name in enumerate(QUANTITIES)},
        "worst_share": chosen.worst, "reached": chosen.worst <= setup.aim,
        "durations": [{"duration_s": proposal.duration_s, "worst_share": proposal.worst} for proposal in tried],
        "step_worst_share": best_step(prior, setup, chosen.duration_s).worst,
        "heaters": [
            {"label": label, "errors": dict(zip(QUANTITIES, errors, strict=True)), "highest_degC": peak}
            for label, errors, peak in zip(prior.models, chosen.errors, chosen.peaks_degC, strict=True)
        ],
    }
    if isinstance(chosen, RelayPlan):
        shortest, longest = float(chosen.periods_s.min()), float(chosen.periods_s.max())
        document["relay"] = asdict(chosen.relay) | {
            "on_degC": chosen.relay.on_degC, "off_degC": chosen.relay.off_degC, "rest_s": chosen.rest_s,
            "period_s": [shortest, longest],
        }
    return document


def _quantity(prior: Prior, plan: ExperimentPlan, index: int) -> dict[str, Any]:
    """Return one quantity: its range over the prior, the interval on the first heater, the worst of all."""
    values, half = prior.values[:, index], _Z95 * plan.errors[:, index]
    worst = int(np.argmax(plan.shares[:, index])) if index < plan.shares.shape[1] else int(np.argmax(half))
    return {
        "before": [float(values.min()), float(values.max())],
        "value": float(values[0]), "after": [float(values[0] - half[0]), float(values[0] + half[0])],
        "worst_half_width": float(half[worst]), "worst_on": list(prior.models)[worst],
        "worst_share": float(plan.shares[worst, index]) if index < plan.shares.shape[1] else None,
    }


KINDS = ("best", "doublet", "relay")

_DURATIONS = (0.25, 0.5, 0.75, 1.0)  # of the longest


def propose(
    prior: Prior, setup: ExperimentSetup, *, kind: str = "best", progress: Callable[[str], object] = str
) -> list[ExperimentPlan]:
    """Return the best experiment of each tried duration, the shortest first; the last one is the proposal.

    Durations grow until the aim is reached or the longest is used.

    Args:
        prior: heaters to serve.
        setup: limits and aim.
        kind: "doublet", "relay", or "best" of both.
        progress: called with a short message when a stage begins.

    Raises:
        UnknownName: another kind.
        OutOfRange: a limit that the heater reaches without an experiment, or that leaves less than 0.1 % of power.
        InputError: a relay test is requested, and none oscillates for two periods on every heater.
    """
    if kind not in KINDS:
        raise UnknownName("kind of experiment", kind, KINDS)
    demand_room(prior, setup)
    plans: list[ExperimentPlan] = []
    for share in _DURATIONS:
        duration = min(setup.longest_s, setup.noise.nearest_reading(share * setup.longest_s))
        progress(f"searching the best experiment of {duration:g} s on {len(prior.models)} heaters")
        candidates = [] if kind == "relay" else [plan_doublet(prior, setup, duration)]
        relay = None if kind == "doublet" else plan_relay(prior, setup, duration)
        candidates += [] if relay is None else [relay]
        plans += sorted(candidates, key=lambda plan: plan.worst)[:1]
        if plans and plans[-1].worst <= setup.aim:
            break
    if not plans:
        raise InputError(
            f"no relay test swings for two periods on every heater of the prior below {setup.limit_degC:g} °C "
            f"within {setup.longest_s:g} s: raise the limit, lengthen the test, or make a doublet first"
        )
    return plans
