"""The heater's switch: power in percent → time it is on within one PWM period."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from heatertune.errors import OutOfRange
from heatertune.units import check

__all__ = ["INSTANT_S", "Actuator", "on_time"]

#: instants closer than this are one instant [s]: far above rounding, far below a PLC's tick
INSTANT_S: Final = 1e-9

_RULES: Final = ("drop", "carry")


@dataclass(frozen=True, slots=True, kw_only=True)
class Actuator:
    """A switch that holds 0 or 100 % power: relay or solid-state relay behind the controller.

    Attributes:
        pwm_period_s: [s].
        resolution_s: the on time is a multiple of it [s]; 10 ms is one half-wave at 50 Hz, the finest that a
            zero-crossing relay can do.
        minimum_on_s, minimum_off_s: shortest pulse and shortest pause [s].
        minimum_rule: what becomes of a pulse or pause that is too short: "drop" leaves it out for good (PULSEGEN of
            the S7-300), "carry" also makes up the difference, rounding included, in the next period (PID_Compact of
            the S7-1200).

    Raises:
        OutOfRange: a time that is not positive, a resolution above the period, minimum times that leave no pulse,
            an unknown rule.
    """

    pwm_period_s: float
    resolution_s: float = 0.01
    minimum_on_s: float = 0.0
    minimum_off_s: float = 0.0
    minimum_rule: str = "drop"

    def __post_init__(self) -> None:
        check("pwm_period_s", self.pwm_period_s, above=0.0)
        check("resolution_s", self.resolution_s, above=0.0, most=self.pwm_period_s)
        check("minimum_on_s", self.minimum_on_s, least=0.0, most=self.pwm_period_s)
        check("minimum_off_s", self.minimum_off_s, least=0.0, most=self.pwm_period_s - self.minimum_on_s)
        if self.minimum_rule not in _RULES:
            raise OutOfRange("minimum_rule", self.minimum_rule, " or ".join(repr(rule) for rule in _RULES))

    @property
    def numbers(self) -> tuple[float, float, float, float, bool]:
        """Period, resolution, minimum on and off time [s], and whether the difference is carried."""
        return (
            self.pwm_period_s, self.resolution_s, self.minimum_on_s, self.minimum_off_s, self.minimum_rule == "carry",
        )


def on_time(
    power_pct: float, carried_s: float, pwm: tuple[float, float, float, float, bool]
) -> tuple[float, float]:
    """Return the on time of one period and what is carried to the next [s].

    Args:
        power_pct: power asked for, 0…100 % of full power.
        carried_s: what the periods before owe [s].
        pwm: `Actuator.numbers`.
    """
    period, resolution, minimum_on, minimum_off, carries = pwm
    wanted = power_pct / 100.0 * period + carried_s
    on = resolution * math.floor(wanted / resolution + 0.5 + INSTANT_S)
    # neither the pulse wanted nor the rounded one may be too short; nor may its pause
    if min(wanted, on) < minimum_on - INSTANT_S or on < INSTANT_S:
        on = 0.0
    elif max(wanted, on) > period - minimum_off + INSTANT_S or on > period - INSTANT_S:
        on = period
    return on, wanted - on if carries else 0.0
