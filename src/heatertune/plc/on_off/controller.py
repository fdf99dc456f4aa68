"""The controller that switches between two levels, run by the bit processor."""

from __future__ import annotations

from typing import ClassVar

from heatertune.plc.controller import Controller
from heatertune.plc.core import ControllerState, StepFunctions, count
from heatertune.plc.cpu.one_bit.machine import START
from heatertune.plc.on_off.export import export_words, from_image, from_text, setpoint_entry
from heatertune.plc.on_off.step import OnOffState, listing_step, step
from heatertune.plc.on_off.words import COUNTS, FIELDS, TIMER, consistent, oddities, values_of
from heatertune.plc.open_points import NothingOpen
from heatertune.plc.words import Words, no_pid

__all__ = ["OnOff"]

_FLAGS = ("overflow", "endless")


def _direct(words: Words, _assume: NothingOpen) -> tuple[StepFunctions, ControllerState]:
    return _DIRECT, ControllerState(words.whole["BAND"], OnOffState())


_DIRECT = StepFunctions(step=step, measure=count, flags=_FLAGS)


class OnOff(Controller, name="on-off"):
    """Two-level control; the switch behind the output is an actuator, always on or off for a whole scan."""

    title = "bit processor, two-level control (Hryniewicz, Chmiel, Przegląd Elektrotechniczny 88(9a), 2012, Ex. 3)"
    main_file = "on_off_rom.hex"
    setpoint_entry = staticmethod(setpoint_entry)
    can = ("switch the heater fully on below SP − BAND and off above SP + BAND",)
    cannot = (
        "no PID: of a design only TA is taken, as the scan interval",
        "the temperature swings around the setpoint, the more the longer the dead time",
        "no setpoint ramp in its program",
    )
    fields, timer, counts = FIELDS, TIMER, COUNTS
    inputs: ClassVar = {"SP": "INT", "PV": "INT"}
    baseline = None
    core = StepFunctions(step=listing_step, measure=count, flags=_FLAGS, compiles=False)
    values, design, consistent = staticmethod(values_of), staticmethod(no_pid), staticmethod(consistent)
    export, direct = staticmethod(export_words), staticmethod(_direct)
    image, oddities, text = staticmethod(from_image), staticmethod(oddities), staticmethod(from_text)

    def begin(self, words: Words, assume: NothingOpen) -> ControllerState:  # noqa: ARG002 - the same for all
        """Return the state after power-on: heater off."""
        return ControllerState(words.whole["BAND"], START)
