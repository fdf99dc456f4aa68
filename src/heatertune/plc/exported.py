"""An export that runs: its own text, input by input, as the PLC that it is loaded into would run it."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from heatertune.plc.ramp import Number

__all__ = ["Called", "Exported"]


class Called(NamedTuple):
    """What one call of the controller gave: setpoint word and output in its units, and the power asked for [%]."""

    setpoint: Number
    output: Number
    power_pct: float


class Exported(Protocol):
    """The program of an export in its PLC."""

    def start(self) -> None:
        """Start up: STOP to RUN, or the supply is back."""

    def call(self, asked: Number, counts: int) -> Called:
        """Run up to the next call of the controller, and this one.

        Args:
            asked: the setpoint that the user enters [units].
            counts: of the input module, from 0 at the beginning of the sensor's range on.

        Returns:
            The setpoint word that the controller follows [units], and the its output [units].
        """

    def pulses(self, output: Number, ticks: int) -> int | None:
        """Run a PWM period of so many ticks; return how many of them the heater is on.

        Args:
            output: that the controller asks for when the period begins [units].
            ticks: of the period.

        Returns:
            None: the program makes no pulses.
        """
