"""A heater under a two-level controller: simulated, and in closed form for one lag and dead time."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from heatertune.errors import InputError, OutOfRange
from heatertune.heater.exact import advance_step, factors, turning_time
from heatertune.model.response import Schedule
from heatertune.model.values import Fopdt, HeaterModel
from heatertune.units import check

__all__ = ["Oscillation", "TwoLevelRelay", "oscillation", "simulate_relay"]

_MOST_SWITCHES = 10_000


@dataclass(frozen=True, slots=True, kw_only=True)
class TwoLevelRelay:
    """A two-level controller: low power from `setpoint + hysteresis` up, high power from `setpoint − hysteresis` down.

    Attributes:
        setpoint_degC: middle of the two thresholds [°C].
        hysteresis_degC: half the distance between them [°C].
        high_pct, low_pct: the two powers [%]; asymmetric where their middle does not hold the setpoint.

    Raises:
        OutOfRange: a negative hysteresis, powers outside 0…100 % or in the wrong order.
    """

    setpoint_degC: float
    hysteresis_degC: float
    high_pct: float
    low_pct: float = 0.0

    def __post_init__(self) -> None:
        check("setpoint_degC", self.setpoint_degC, least=-273.15)
        check("hysteresis_degC", self.hysteresis_degC, least=0.0)
        check("low_pct", self.low_pct, least=0.0, most=100.0)
        check("high_pct", self.high_pct, above=self.low_pct, most=100.0)

    @property
    def off_degC(self) -> float:
        """Where the low power begins [°C]."""
        return self.setpoint_degC + self.hysteresis_degC

    @property
    def on_degC(self) -> float:
        """Where the high power begins [°C]."""
        return self.setpoint_degC - self.hysteresis_degC


class Oscillation(NamedTuple):
    """The steady oscillation: how long the power is high and low [s], highest and lowest temperature [°C]."""

    on_s: float
    off_s: float
    highest_degC: float
    lowest_degC: float

    @property
    def period_s(self) -> float:
        """One whole oscillation [s]."""
        return self.on_s + self.off_s


class _RelayState(NamedTuple):
    """Temperature, and that of the lag before it [°C]."""

    outer: float
    inner: float


def oscillation(model: Fopdt, relay: TwoLevelRelay) -> Oscillation:
    """Return the exact oscillation of one lag and dead time under a relay.

    With a = how far full relay power would warm above the setpoint, b = how far the low power would cool below it,
    ε = hysteresis, E = e^(−L/T): the peak is a(1 − E) + εE, the power is high for T·ln(((a + b)/E − b + ε)/(a − ε))
    and low for T·ln(((a + b)/E − a + ε)/(b − ε)) (Q.-G. Wang, C.-C. Hang, B. Zou, "Low-order modeling from relay
    feedback", Ind. Eng. Chem. Res. 36 (1997) 375–381, equations 2–5).

    Raises:
        OutOfRange: the powers do not hold the temperature on both sides of the thresholds.
    """
    up, down = _reach(model, relay)
    eps, decay, lag = relay.hysteresis_degC, math.exp(-model.dead_time_s / model.time_constant_s), model.time_constant_s
    both = (up + down) / decay
    return Oscillation(
        on_s=lag * math.log((both - down + eps) / (up - eps)),
        off_s=lag * math.log((both - up + eps) / (down - eps)),
        highest_degC=relay.setpoint_degC + up * (1.0 - decay) + eps * decay,
        lowest_degC=relay.setpoint_degC - down * (1.0 - decay) - eps * decay,
    )


def simulate_relay(
    model: HeaterModel, relay: TwoLevelRelay, duration_s: float, *, base_pct: float = 0.0,
    sample_time_s: float | None = None
) -> Schedule:
    """Return the powers that a relay sets on a heater that rested at the base power, until the duration is over.

    Between two changes of the acting power the temperature is a closed form. Without a sampling interval the relay
    switches at the very instant of the crossing; with one, at the first reading on or beyond the threshold.

    Args:
        model: with ambient.
        relay: its high power comes first where the heater rests below `relay.off_degC`.
        duration_s: of the test [s].
        base_pct: at which the heater rests at first [%].
        sample_time_s: interval between two readings [s]; None: the relay sees the temperature at every instant.

    Raises:
        OutOfRange: as `oscillation`; a heater without ambient; a duration or an interval that is not positive.
        InputError: more than 10,000 switches: without hysteresis and dead time a relay never rests.
    """
    check("duration_s", duration_s, above=0.0)
    if sample_time_s is not None:
        check("sample_time_s", sample_time_s, above=0.0)
    _reach(model, relay)
    rest = _ambient(model) + model.gain_degC_per_pct * base_pct
    state = _RelayState(rest, rest)
    high = state.outer < relay.off_degC
    times, powers = [0.0], [relay.high_pct if high else relay.low_pct]
    coming = deque([(model.dead_time_s, powers[0])])
    now, acting, readings = 0.0, base_pct, 0
    while now < duration_s:
        threshold = relay.off_degC if high else relay.on_degC
        reading = math.inf if sample_time_s is None else readings * sample_time_s
        until = min(duration_s, reading, coming[0][0] if coming else math.inf)
        course = _ConstantPowerResponse(model, state, acting)
        crossing = course.crossing(threshold, until - now, rising=high) if sample_time_s is None else None
        if crossing is not None:
            until = now + crossing
        state, now = course.after(until - now), until
        if coming and coming[0][0] <= now:
            acting = coming.popleft()[1]
        if now == reading:
            readings += 1
            crossed = state.outer >= threshold if high else state.outer <= threshold
        else:
            crossed = crossing is not None
        if crossed and now < duration_s:
            high = not high
            times.append(now)
            powers.append(relay.high_pct if high else relay.low_pct)
            coming.append((now + model.dead_time_s, powers[-1]))
            if len(times) > _MOST_SWITCHES:
                raise InputError("the relay switches more than 10000 times: give it a hysteresis or a shorter duration")
    return Schedule(base_pct=base_pct, time_s=np.array(times), power_pct=np.array(powers))


class _ConstantPowerResponse:
    """The temperature under one acting power."""

    def __init__(self, model: HeaterModel, state: _RelayState, power_pct: float) -> None:
        self._outer, self._inner = (*model.lags_s[::-1], 0.0)[:2]
        self._target = _ambient(model) + model.gain_degC_per_pct * power_pct
        self._begun = state

    def after(self, t: float) -> _RelayState:
        """Return outer and inner temperature after t seconds."""
        return _RelayState(*advance_step(*self._begun, self._target, factors(t, self._outer, self._inner)))

    def crossing(self, threshold: float, length: float, *, rising: bool) -> float | None:
        """Return when the temperature first is on or beyond the threshold within a length [s], None where it is not."""
        sign = 1.0 if rising else -1.0

        def beyond(t: float) -> float:
            return sign * (self.after(t).outer - threshold)

        ends = sorted({0.0, length, *self._turns(length)})
        if beyond(0.0) >= 0.0:
            return 0.0
        for start, end in pairwise(ends):
            if beyond(end) >= 0.0:
                from scipy.optimize import brentq  # noqa: PLC0415 - takes half a second

                return float(brentq(beyond, start, end, xtol=1e-9))
        return None

    def _turns(self, length: float) -> tuple[float, ...]:
        """Return where the slope vanishes within the length: never with one lag, at most once with two."""
        begun, ended = self._begun, self.after(length)
        if self._inner == 0.0 or (begun.inner - begun.outer) * (ended.inner - ended.outer) >= 0.0:
            return ()
        return (turning_time(*begun, self._target, self._outer, self._inner),)


def _ambient(model: HeaterModel) -> float:
    if model.ambient_degC is None:
        raise OutOfRange("ambient_degC", None, "known: a relay switches on temperatures")
    return model.ambient_degC


def _reach(model: HeaterModel, relay: TwoLevelRelay) -> tuple[float, float]:
    """Return how far the high power would warm above the setpoint, and the low power cool below it [°C]."""
    up = _ambient(model) + model.gain_degC_per_pct * relay.high_pct - relay.setpoint_degC
    down = relay.setpoint_degC - _ambient(model) - model.gain_degC_per_pct * relay.low_pct
    if min(up, down) <= relay.hysteresis_degC:
        low, high = relay.setpoint_degC - down + relay.hysteresis_degC, relay.setpoint_degC + up - relay.hysteresis_degC
        raise OutOfRange("setpoint_degC", relay.setpoint_degC, f"> {low:.4g} and < {high:.4g}, or it never swings")
    return up, down
