"""The controller of the PID tip."""

from __future__ import annotations

from typing import ClassVar

from heatertune.plc.controller import Controller
from heatertune.plc.core import ControllerState, StepFunctions, count
from heatertune.plc.cpu.s7_300.machine import FULL_SCALE, INPUT_S, RANGES, TICK_S, TIMER
from heatertune.plc.s7_300.export import export_words, from_image, from_text, loaders, oddities, setpoint_entry
from heatertune.plc.s7_300.step import COLD, PidTipAssumptions, PidTipParameters, scan, step
from heatertune.plc.s7_300.words import FIELDS, design_of, values_of
from heatertune.plc.words import Words

__all__ = ["PidTip"]


class PidTip(Controller, name="s7-300"):
    """The PID of the application tip, called from OB35; the program around it makes the PWM."""

    title = "SIMATIC S7-300/400, application tip PID No. 2 (Siemens, V1.0, 11/96)"
    main_file = "s7_300_pid.awl"
    setpoint_entry = staticmethod(setpoint_entry)
    can = (
        "P, PI, PD and PID in single precision; derivative of the reading, not filtered; I, ID and D with GAIN = 0",
        "exported as a whole STL program: restart, broken sensor, PWM (or PULSEGEN), setpoint ramp on request",
    )
    cannot = (
        "a PWM that OB35 cannot make, or by PID_Compact's rule, is left to a switch behind the analog output",
        "no feed-forward, no dead band, no derivative filter",
    )
    fields, assumptions, timer, counts = FIELDS, PidTipAssumptions, TIMER, FULL_SCALE
    ranges = RANGES
    inputs: ClassVar = {"SP": "INT", "PV": "INT", "mode_req": "BOOL", "OUT": "INT"}
    derivative_filter = 0.0
    has_ramp = True
    delay_s = INPUT_S
    tick_s = TICK_S
    core = StepFunctions(step=step, measure=count, flags=("overflow",))
    values, design, export = staticmethod(values_of), staticmethod(design_of), staticmethod(export_words)
    image, oddities, scan_all = staticmethod(from_image), staticmethod(oddities), staticmethod(scan)
    text, load_exported = staticmethod(from_text), staticmethod(loaders)

    def begin(self, words: Words, assume: PidTipAssumptions) -> ControllerState:
        """Return the state after OB100."""
        v = words.values
        parameters = PidTipParameters(gain=v["GAIN"], rate=v["RATE"], reset=v["RESET"], sample=v["SAMPLE"])
        return ControllerState((parameters, assume), COLD)
