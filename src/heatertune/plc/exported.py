"""An export that runs: its own text, input by input, as the PLC that it is loaded into would run it.

Where the program is a firmware's, a library's or an instrument's, the text tells what it is set to, and that is read.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from heatertune.plc.ramp import Boost, Number

__all__ = ["CallInputs", "CallOutputs", "CallResult", "ExportedInPlc", "Loads", "Numbers", "TextSettings"]

Numbers = npt.NDArray[np.float64]


class CallResult(NamedTuple):
    """What one call of the controller gave: setpoint word and output in its units, and the power asked for [%]."""

    setpoint: Number
    output: Number
    power_pct: float


class CallInputs(NamedTuple):
    """What many calls or ticks are given, see `Exported.call`."""

    power_pct: Numbers
    counts: npt.NDArray[np.int64]
    readings_degC: Numbers


class CallOutputs(NamedTuple):
    """What they gave, and whether the heater is on after each; None: the program makes no pulses."""

    setpoints: Numbers
    outputs: Numbers
    powers_pct: Numbers
    on: npt.NDArray[np.bool_] | None


class TextSettings(NamedTuple):
    """What a text sets; None: it tells nothing of that.

    Attributes:
        values: word name → number.
        boost: of the program around the words; None: there is none.
        setpoint_degC: [°C].
        period_s: of the PWM [s].
        pulses_s: step, shortest pulse and shortest pause of the PWM that the text's program makes itself [s].
    """

    values: Mapping[str, Number]
    boost: Boost | None = None
    setpoint_degC: float | None = None
    period_s: float | None = None
    pulses_s: tuple[float, float, float] | None = None


class ExportedInPlc(Protocol):
    """The program of an export in its PLC."""

    @property
    def tick_s(self) -> float:
        """Tick of its clock, as the text has it [s]."""

    def start(self) -> None:
        """Start up: STOP to RUN, or the supply is back."""

    def call(self, target: Number, counts: int, reading_degC: float) -> CallResult:
        """Run the tick of the next call of the controller, what lies between left out.

        Args:
            target: the setpoint that the user enters [units]; the first one is loaded with the program.
            counts: of the input module, from 0 at the beginning of the sensor's range on.
            reading_degC: the same as a module in °C gives it.
        """

    def tick(self, target: Number, counts: int, reading_degC: float) -> tuple[CallResult, bool | None]:
        """Run one tick; return what the controller gave last, and whether the heater is on, as `begin` tells it.

        Arguments as for `call`.
        """

    def calls(self, inputs: CallInputs) -> CallOutputs | None:  # noqa: ARG002 - one that can looks at it
        """Do many times what `call` does, at once; None: one by one it is, and nothing was done."""
        return None

    def ticks(self, inputs: CallInputs) -> CallOutputs | None:  # noqa: ARG002
        """Do so what `tick` does."""
        return None

    def interrupt(self) -> tuple[float, bool | None]:
        """Run a tick with a broken sensor, or what stands for one; afterwards the program is as after a start-up.

        Returns:
            The power asked for meanwhile [%], and whether the heater is on, as `begin` tells it.
        """

    def begin(self, output: Number, ticks: int) -> bool | None:
        """Run the first tick of a PWM period; return whether the heater is on, None where the program makes no pulses.

        Args:
            output: that the controller asks for when the period begins [units].
            ticks: of the period.
        """

    def go_on(self) -> bool:
        """Run the next tick of this period; return whether the heater is on."""

    def periods(
        self, outputs: Numbers, ticks: int, lengths: npt.NDArray[np.int64]  # noqa: ARG002
    ) -> tuple[npt.NDArray[np.int64], Numbers] | None:
        """Do many times what `begin` and `go_on` do, at once; None as for `calls`.

        Args:
            outputs: that periods begin with, of shape (outputs,).
            ticks: of a period.
            lengths: how many ticks of each are run, the first one among them, of shape (outputs,).

        Returns:
            How many of those ticks the heater was on, and what `counted` gives, each of shape (outputs,).
        """
        return None

    def tick_count(self) -> float | None:
        """Return how many ticks on the program counted when the period began; None: it counts none beforehand."""


#: file of an export → what loads its program or reads its settings, None where another file holds the same; it raises
#: InputError for what is not known here
Loads = Mapping[str, Callable[[], ExportedInPlc | TextSettings | None]]
