"""The controller CONT_C."""

from __future__ import annotations

from typing import ClassVar

from heatertune.plc.controller import Controller
from heatertune.plc.core import ControllerState, StepFunctions, count
from heatertune.plc.cpu.s7_300.machine import FULL_SCALE, INPUT_S, RANGES, TICK_S, TIMER
from heatertune.plc.fb41.export import (
    FEED,
    export_words,
    from_image,
    from_text,
    loaders,
    oddities,
    premises,
    setpoint_entry,
)
from heatertune.plc.fb41.step import ContCAssumptions, disturbance_step, restart, scan, step
from heatertune.plc.fb41.words import FIELDS, consistent, design_of, parameters_of, reading_periphery, values_of
from heatertune.plc.words import Words

__all__ = ["ContC"]


class ContC(Controller, name="fb41"):
    """The standard block CONT_C, called from OB35; the program around it makes the PWM."""

    title = "SIMATIC S7-300/400, FB41 CONT_C (Standard Library; SFB41 of the CPU 31xC)"
    main_file = "fb41_cont_c.awl"
    setpoint_entry = staticmethod(setpoint_entry)
    can = (
        "P, PI, PD and PID in single precision with a filtered derivative of the error; PV and setpoint in °C",
        "dead band, limits, feed-forward DISV, manual with a smooth return",
        "exported as a whole STL program: restart, broken sensor, PWM (or PULSEGEN), setpoint ramp on request",
    )
    cannot = (
        "a PWM that OB35 cannot make, or by PID_Compact's rule, is left to a switch behind the analog output",
        "no setpoint weights: the block has none",
        "PV_IN where words are read: in °C, as the program before the block scales it; the export reads PV_PER",
    )
    fields, assumptions, timer, counts = FIELDS, ContCAssumptions, TIMER, FULL_SCALE
    ranges = RANGES
    #: SP_PER is a setpoint as an analog value; SP_INT, where given, is the block's own input
    inputs: ClassVar = {
        "SP_PER": "INT", "PV_PER": "INT", "SP_INT": "REAL", "MAN_ON": "BOOL", "MAN": "REAL", "DISV": "REAL",
        "INT_HOLD": "BOOL", "COM_RST": "BOOL",
    }
    written = ("MAN_ON", "MAN")
    has_ramp = True
    delay_s = INPUT_S
    tick_s = TICK_S
    most_power = ("LMN_HLM", 100.0)
    core = StepFunctions(step=step, measure=count, flags=("QLMN_HLM", "QLMN_LLM", "overflow"),
                         disturbance_step=disturbance_step)
    values, design, consistent = staticmethod(values_of), staticmethod(design_of), staticmethod(consistent)
    export, image, oddities = staticmethod(export_words), staticmethod(from_image), staticmethod(oddities)
    load_exported, premises = staticmethod(loaders), staticmethod(premises)
    text, scan_all, feed = staticmethod(from_text), staticmethod(scan), FEED

    def begin(self, words: Words, assume: ContCAssumptions) -> ControllerState:
        """Return the state after OB100's call with COM_RST."""
        parameters = parameters_of(reading_periphery(words.values, words.scaling))
        return ControllerState((parameters, assume), restart(parameters))
