"""The PWM period for a heater: ripple against wear of the switch."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from heatertune.errors import InputError, UnknownName
from heatertune.model.values import HeaterModel
from heatertune.units import check

__all__ = ["SWITCHES", "PwmPeriod", "propose_period", "ripple_degC"]

#: kinds of switch: contacts wear with each switching; a solid-state relay does not
SWITCHES: Final = ("relay", "ssr")

#: 100 half-waves at 50 Hz: a zero-crossing relay then has steps of 1 % power [s]
_SHORTEST_S: Final = 1.0
#: switchings that contacts last at rated load; a usual figure, the relay's own data sheet decides
_LIFE: Final = 100_000


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
    told: str


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
    return 100.0 * model.gain_degC_per_pct * math.expm1(-on) * math.expm1(-off) / -math.expm1(-on - off)


def propose_period(
    models: Sequence[HeaterModel], *, kind: str, sample_time_s: float, setpoint_degC: float, ambient_degC: float,
    ripple_degC_most: float,
) -> PwmPeriod:
    """Return the PWM period for a kind of switch: whole periods in each sampling interval, none below one second.

    A solid-state relay gets the shortest, contacts get the longest whose ripple stays within the limit.

    Args:
        models: the heaters to serve.
        kind: one of `SWITCHES`.
        sample_time_s: TA [s].
        setpoint_degC: where the loop rests [°C].
        ambient_degC: temperature without power, for models that do not know theirs [°C].
        ripple_degC_most: largest ripple, peak to peak [°C].

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

    def ripple(period_s: float) -> float:
        return max(ripple_degC(model, period_s, _power(model, setpoint_degC, ambient_degC)) for model in models)

    most = max(1, math.floor(sample_time_s / _SHORTEST_S + 1e-9))  # periods in a sampling interval
    parts = range(1, most + 1) if kind == "relay" else (most,)
    count = next((n for n in parts if ripple(sample_time_s / n) <= ripple_degC_most), most)
    period, found = sample_time_s / count, ripple(sample_time_s / count)
    per_hour = 3600.0 / period
    told = f"PWM period {period:.4g} s for a {_NAMES[kind]}: ripple {found:.2g} °C peak to peak at {setpoint_degC:g} °C"
    if found > ripple_degC_most:
        told += f", above the {ripple_degC_most:.2g} °C wanted; a shorter period would take a faster TA or finer steps"
    if kind == "relay":
        told += f"; {per_hour:.0f} switchings an hour, so contacts made for {_LIFE:,} last {_LIFE / per_hour:.0f} h"
    return PwmPeriod(period_s=period, ripple_degC=found, told=f"{told}.")


_NAMES: Final = {"relay": "relay with contacts", "ssr": "solid-state relay"}


def _power(model: HeaterModel, setpoint_degC: float, ambient_degC: float) -> float:
    """Return the power that holds the setpoint, 0…100 %."""
    ambient = ambient_degC if model.ambient_degC is None else model.ambient_degC
    return min(100.0, max(0.0, (setpoint_degC - ambient) / model.gain_degC_per_pct))
