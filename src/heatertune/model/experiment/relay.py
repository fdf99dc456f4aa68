"""The relay test that makes a heater known best within limits."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product

import numpy as np
import numpy.typing as npt

from heatertune.model.experiment.doublet import REST_READINGS, ExperimentPlan
from heatertune.model.experiment.fisher import ReadingNoise
from heatertune.model.experiment.prior import ExperimentSetup, Prior, errors, peaks, rests, shares
from heatertune.model.relay.relay import TwoLevelRelay, simulate_relay
from heatertune.model.response import Schedule
from heatertune.model.values import HeaterModel

__all__ = ["RelayPlan", "plan_relay"]

Array = npt.NDArray[np.float64]

_CHATTER = 3.0  # standard deviations: noise alone then hardly ever switches the relay
_HIGH = (1.0, 0.85, 0.7, 0.55, 0.4, 0.3, 0.2)  # of the power above the least
_LOW = (0.0, 0.25, 0.5)  # of the high power above the least
_AT = (0.25, 0.35, 0.5, 0.65, 0.75)  # of the span of setpoints that swing on every heater
_REST = 0.05  # of the duration: it shows the fit where the heater rested
_READINGS = 400  # in the search; the figures told are those of all readings
_SWITCHES = 6  # up to the end of the second whole period: fewer tell nothing


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RelayPlan(ExperimentPlan):
    """A relay test and what it would make known.

    The schedule is the one expected on the working model: on the real heater the relay decides.

    Attributes:
        relay: setpoint, hysteresis and powers to set.
        rest_s: how long the base power is logged before the relay is switched on [s].
        periods_s: expected period on each heater, shape (g,).
    """

    relay: TwoLevelRelay
    rest_s: float
    periods_s: Array


def plan_relay(prior: Prior, setup: ExperimentSetup, duration_s: float) -> RelayPlan | None:
    """Return the best relay test of a duration, None where none swings for two periods on every heater below the limit.

    Its hysteresis is three standard deviations of the noise and at least the sensor's resolution; its setpoint and its
    two powers are searched with a relay that switches at the very crossing; what is returned keeps the limit, and has
    its figures, with one that switches at the next reading.
    """
    noise = setup.noise
    hysteresis = math.ceil(100.0 * max(_CHATTER * noise.std_degC, noise.resolution_degC) - 1e-9) / 100.0
    thinned = noise.average(max(1, int(duration_s / noise.sample_time_s / _READINGS)))
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
    """Return the powers on each heater, None where one passes the limit or swings too seldom."""
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
