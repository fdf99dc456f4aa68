"""The PWM period for a heater: ripple against wear of the switch."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final, NamedTuple

from heatertune.errors import InputError, UnknownName
from heatertune.model.model_values import HeaterModel
from heatertune.plc.pwm import in_ticks, tick_for
from heatertune.units import check

__all__ = ["SWITCHES", "PwmPeriod", "holding_power_pct", "life", "propose_period", "ripple_at", "ripple_degC"]


class _SwitchKind(NamedTuple):
    """A kind of switch: its name, the shortest PWM period that suits it [s], and how often it switches in its life."""

    name: str
    shortest_s: float
    life: float


#: kinds of switch; the data sheet of the very switch decides. A solid-state relay switches at zero crossings: 100
#: half-waves of 50 Hz are steps of 1 %. Contacts wear: 20 s for relays (Eurotherm's note), whose contacts last 1 to
#: 3·10⁵ switchings at rated load; 30 s for contactors, which last 1.5 to 2 million in AC-1 (Microelettrica's table)
SWITCHES: Final = {
    "ssr": _SwitchKind("solid-state relay", 1.0, math.inf),
    "relay": _SwitchKind("relay with contacts", 20.0, 100_000.0),
    "contactor": _SwitchKind("contactor", 30.0, 1_500_000.0),
}
_HOURS_A_YEAR: Final = 8766.0
_MONTHS_FROM: Final = 1.0 / 12.0  # years; below, hours say more


@dataclass(frozen=True, slots=True, kw_only=True)
class PwmPeriod:
    """A period and what it costs.

    Attributes:
        period_s: a whole part of the sampling interval [s].
        ripple_degC: peak to peak at the setpoint, worst over the heaters [°C].
        told: both, and the wear, in sentences.
    """

    period_s: float
    ripple_degC: float
    summary: str


def ripple_degC(model: HeaterModel, period_s: float, power_pct: float) -> float:
    """Return the temperature's peak to peak when PWM holds a steady mean power [°C].

    One lag, exactly: 100·k·(1 − a)(1 − b)/(1 − a·b), a and b the decays over the on and the off time. A second lag
    only smooths, so with two lags it is a bound.

    Args:
        model: the heater.
        period_s: PWM period [s].
        power_pct: mean power, 0…100 %.
    """
    on, off = (share * period_s / model.time_constant_s for share in (power_pct / 100.0, 1.0 - power_pct / 100.0))
    return 100.0 * abs(model.gain_degC_per_pct) * math.expm1(-on) * math.expm1(-off) / -math.expm1(-on - off)


def ripple_at(models: Sequence[HeaterModel], period_s: float, *, setpoint_degC: float, ambient_degC: float) -> float:
    """Return the largest peak to peak over models at rest at a setpoint [°C].

    Args:
        models: the heaters.
        period_s: PWM period [s].
        setpoint_degC: where the loop rests [°C].
        ambient_degC: temperature without power, for models that do not know theirs [°C].
    """
    return max(ripple_degC(model, period_s, holding_power_pct(model, setpoint_degC, ambient_degC)) for model in models)


def propose_period(
    models: Sequence[HeaterModel], *, kind: str, sample_time_s: float, setpoint_degC: float, ambient_degC: float,
    ripple_degC_most: float, tick_s: float | None = None,
) -> PwmPeriod:
    """Return the PWM period for a kind of switch: whole periods in each sampling interval, or whole intervals in each.

    A solid-state relay gets the shortest that suits it, and contacts the longest whose ripple stays within the limit.
    If the ripple permits, a solid-state relay's is so long that the controller's usual clock makes at least fifty steps
    of it: the S5's interrupt every 100 ms needs 5 s. A finer clock takes a share of the controller's time.

    Args:
        models: the heaters to serve.
        kind: one of `SWITCHES`.
        sample_time_s: TA [s].
        setpoint_degC: where the loop rests [°C].
        ambient_degC: temperature without power, for models that do not know theirs [°C].
        ripple_degC_most: largest ripple, peak to peak [°C].
        tick_s: `Controller.tick_s`; only periods in its ticks; None: any.

    Raises:
        UnknownName: no such kind of switch.
        InputError: no model.
        OutOfRange: a time or limit that is not positive.
    """
    if kind not in SWITCHES:
        raise UnknownName("kind of switch", kind, SWITCHES)
    if not models:
        raise InputError("a PWM period needs at least one model")
    check("sample_time_s", sample_time_s, above=0.0)
    check("ripple_degC_most", ripple_degC_most, above=0.0)

    ripple = partial(ripple_at, models, setpoint_degC=setpoint_degC, ambient_degC=ambient_degC)
    switch, wears = SWITCHES[kind], math.isfinite(SWITCHES[kind].life)
    most = math.floor(sample_time_s / switch.shortest_s + 1e-9)  # periods in a sampling interval
    if most == 0 and wears:
        periods = [sample_time_s * math.ceil(switch.shortest_s / sample_time_s - 1e-9)]
    else:
        parts = range(1, max(1, most) + 1)
        periods = [sample_time_s / n for n in parts if n == 1 or in_ticks(sample_time_s / n, tick_s)]
    calm = [period for period in periods if ripple(period) <= ripple_degC_most and (
        wears or tick_s == tick_for(tick_s, sample_time_s=sample_time_s, pwm_period_s=period))]
    period = calm[0 if wears else -1] if calm else periods[-1]
    waves = ripple(period)
    text = f"PWM period {period:.4g} s for a {switch.name}: ripple {waves:.2g} °C peak to peak at {setpoint_degC:g} °C"
    if waves > ripple_degC_most:
        text += f", above the {ripple_degC_most:.2g} °C wanted; a shorter period would take a faster TA or finer steps"
    if wears:
        text += (f"; {3600.0 / period:.0f} switchings an hour, so contacts made for {switch.life:,.0f} last "
                 f"{life(kind, 3600.0 / period)}")
    return PwmPeriod(period_s=period, ripple_degC=waves, summary=f"{text}.")


def life(kind: str, switchings_per_h: float) -> str:
    """Return how long a kind of switch lasts at so many switchings an hour: "278 h", "5 months", "2.1 years"."""
    if switchings_per_h <= 0.0 or math.isinf(SWITCHES[kind].life):
        return "for ever"
    hours = SWITCHES[kind].life / switchings_per_h
    years = hours / _HOURS_A_YEAR
    if years < _MONTHS_FROM:
        return f"{hours:.0f} h"
    months = round(12.0 * years)
    return f"{years:.2g} years" if years >= 1.0 else f"{months} months" if months > 1 else "1 month"


def holding_power_pct(model: HeaterModel, setpoint_degC: float, ambient_degC: float) -> float:
    """Return the power that holds a setpoint, 0…100 %; the ambient is that of models that do not know theirs [°C]."""
    ambient = ambient_degC if model.ambient_degC is None else model.ambient_degC
    return min(100.0, max(0.0, (setpoint_degC - ambient) / model.gain_degC_per_pct))
