"""What is asked and told about a loop."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from heatertune.errors import UnknownName
from heatertune.proof.ripple_and_wear import SWITCHES
from heatertune.units import check

__all__ = ["Cause", "LoopEntry", "LoopFault"]


class Cause(Enum):
    """What is wrong with a loop; each member's value is what to do about it."""

    FULL_POWER = "a stronger heater, less loss or a lower setpoint: no words help"
    NO_POWER = "look for heat from elsewhere, a stuck switch or a setpoint below the room: no words help"
    DRIFTED = "look at the heater (element, mains, insulation, sensor); then take the new words"
    OSCILLATING = "take calmer words"
    OFFSET = "take words with an integral part"
    SLUGGISH = "take faster words"
    WEAR = "take a longer PWM period"
    UNKNOWN = "log the power and a change of the setpoint until it rests, or list the controller and its words"
    WELL = "nothing"

    @property
    def label(self) -> str:
        """The cause as a table has it."""
        return self.name.lower().replace("_", " ")


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopEntry:
    """A loop as the list has it; what is not said is None or its default.

    Attributes:
        name: of the loop.
        file: its log, a path below the folder; of a loop that is recorded, the address of its PLC.
        target: the controller.
        folder: what `design` wrote for it: its words, and the heater they were made for.
        setpoint_degC: where the log holds none [°C].
        switch: what switches the heater, one of `heatertune.proof.ripple_and_wear.SWITCHES`; None: not known.
        pwm_period_s: of it [s].
        low_degC, high_degC: range of the sensor [°C]; None: that of its words, or as asked for.
        map: small file that says where the PLC shows temperature and power, where no `folder` does; of a loop that is
            recorded.

    Raises:
        OutOfRange: a period that is not above zero, a setpoint below the absolute zero, half a range or an empty one.
        UnknownName: no such switch.
    """

    name: str
    file: str
    target: str | None = None
    folder: str | None = None
    setpoint_degC: float | None = None
    switch: str | None = None
    pwm_period_s: float | None = None
    low_degC: float | None = None
    high_degC: float | None = None
    map: str | None = None

    def __post_init__(self) -> None:
        if self.pwm_period_s is not None:
            check("pwm_period_s", self.pwm_period_s, above=0.0)
        if self.setpoint_degC is not None:
            check("setpoint_degC", self.setpoint_degC, least=-273.15)
        if self.low_degC is not None or self.high_degC is not None:
            check("low_degC", math.nan if self.low_degC is None else self.low_degC, least=-273.15)
            check("high_degC", math.nan if self.high_degC is None else self.high_degC, above=self.low_degC)
        if self.switch is not None and self.switch not in SWITCHES:
            raise UnknownName("switch", self.switch, tuple(SWITCHES))


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopFault:
    """One thing that is wrong.

    Attributes:
        cause: what.
        excess: how far it is beyond what is accepted: 1 is just there.
        told: one sentence with its numbers.
    """

    cause: Cause
    excess: float
    message: str
