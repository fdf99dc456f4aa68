"""The controller in PID_Compact, and what it shares with the one in PID_Temp."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from typing import ClassVar, Final

from heatertune.pid.design_values import PidDesign, Timer
from heatertune.plc.controller import Controller
from heatertune.plc.core import ControllerState, Sensor, StepFunctions, count
from heatertune.plc.pid_compact.export import LAW, export_words, loaders
from heatertune.plc.pid_compact.readback import from_text
from heatertune.plc.pid_compact.step import COLD, PidCompactAssumptions, block_of, scale_input, scan, step
from heatertune.plc.pid_compact.words import (
    COMPACT,
    COUNTS,
    consistent,
    design_of,
    fields_of,
    interval_s,
    oddities,
    values_of,
)
from heatertune.plc.ramp import Number
from heatertune.plc.single_precision import single
from heatertune.plc.words import Scaling, WordField, Words

__all__ = ["CORE", "COUNTS", "DELAY_S", "INPUTS", "TIMER", "UNREAD", "PidCompact"]


def _measure(sensor: Sensor, temperature_degC: float) -> float:
    high = sensor.low + sensor.span
    return scale_input(count(sensor, temperature_degC), sensor.counts, single(sensor.low), single(high))


#: one step for both blocks, so one compiled loop
CORE = StepFunctions(step=step, measure=_measure, flags=("upper limit", "lower limit", "invalid"), singles=True)
#: whole calls of a cyclic interrupt OB
TIMER = Timer(shortest_s=0.01, longest_s=600.0, step_s=0.01)
#: an analog input's own time, as of a module with eight channels, and the time of the process image with
#: which the outputs go out, whose cycle a CPU watches (150 ms by default) [s]
DELAY_S = 0.256 + 0.15
FIELDS: Final[tuple[WordField, ...]] = fields_of(COMPACT)
_AT_ENDS = "say with --range what 0 and 27648 of Input_PER mean"
#: PID_Compact scales Input_PER by two points, so the module's own range is told by these
UNREAD: Mapping[str, str] = {
    "4-20mA": f"Input_PER of a module set to 4…20 mA goes from 0 to 27648, which the instruction scales: {_AT_ENDS}, "
              "that is, at 4 and at 20 mA",
    **dict.fromkeys(
        ("thermocouple", "rtd", "rtd-climatic"),
        "such a module counts tenths of a degree from 0 °C on, as --range 0 2764.8 scales it "
        "(in a climatic range hundredths: --range 0 276.48)"),
}
INPUTS: Mapping[str, str] = {"Setpoint": "REAL", "Input": "REAL", "Reset": "BOOL"}


class PidCompact(Controller, name="pid-compact"):
    """PID_Compact, called from a cyclic interrupt OB; it makes the PWM itself, its period being Cycle."""

    title = "SIMATIC S7-1200/1500, PID_Compact V2 and V3 (function manual PID control, A5E35300227)"
    main_file = "pid_compact_words.scl"
    can = (
        "P, PI, PD and PID in single precision with setpoint weights and a lag of the derivative; inverted control",
        "its own PWM with shortest pulse and pause, what is left out being made up; broken sensor: inactive, 0 %",
        "exported as SCL: words at start-up, call, rollback by LoadBackUp; and as rows of a watch table",
    )
    cannot = (
        "no setpoint ramp, no feed-forward (Disturbance), no dead zone of V3, no manual in the proof",
        "a PWM whose period is not Cycle is left to a switch behind Output",
        "V1 of the block has other names (sRet…) and another start: not this one",
    )
    fields = FIELDS
    assumptions, timer, counts, inputs, core = PidCompactAssumptions, TIMER, COUNTS, INPUTS, CORE
    tick_s, delay_s, unread = 0.1, DELAY_S, UNREAD
    own_pwm = ("pid-compact", math.inf)
    most_power = ("OutputUpperLimit", 100.0)
    design, consistent, interval_s = staticmethod(design_of), staticmethod(consistent), staticmethod(interval_s)
    oddities, scan_all = staticmethod(oddities), staticmethod(scan)
    export: ClassVar = staticmethod(partial(export_words, COMPACT, FIELDS))
    load_exported: ClassVar = staticmethod(partial(loaders, COMPACT, FIELDS, LAW))
    text: ClassVar = staticmethod(partial(from_text, COMPACT, FIELDS))

    @staticmethod
    def values(design: PidDesign, scaling: Scaling) -> Mapping[str, Number]:  # noqa: ARG004 - in °C
        """Return the words of a design."""
        return values_of(COMPACT, design)

    def begin(self, words: Words, assume: PidCompactAssumptions) -> ControllerState:
        """Return the state before automatic has ever been on."""
        return ControllerState((block_of(words.values, assume), assume), COLD)
