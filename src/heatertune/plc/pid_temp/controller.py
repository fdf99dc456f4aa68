"""The controller in PID_Temp, heating."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import ClassVar

from heatertune.pid.values import PidDesign
from heatertune.plc.controller import Controller
from heatertune.plc.core import Running
from heatertune.plc.pid_compact.controller import CORE, DELAY_S, INPUTS, TIMER, begin
from heatertune.plc.pid_compact.export import export_words
from heatertune.plc.pid_compact.exported import exported
from heatertune.plc.pid_compact.readback import from_text
from heatertune.plc.pid_compact.step import Assumptions, scan
from heatertune.plc.pid_compact.words import (
    COUNTS,
    TEMP,
    consistent,
    design_of,
    fields_of,
    interval_s,
    oddities,
    values_of,
)
from heatertune.plc.ramp import Number
from heatertune.plc.words import Scaling, Words

__all__ = ["PidTemp"]


class PidTemp(Controller, name="pid-temp"):
    """PID_Temp with its cooling off, called from a cyclic interrupt OB; it makes the PWM itself."""

    title = "SIMATIC S7-1200/1500, PID_Temp V1 and V2, heating (function manual PID control, A5E35300227)"
    can = (
        "P, PI, PD and PID in single precision with setpoint weights and a lag of the derivative",
        "its own PWM of Cycle or a shorter period, shortest times, what is left out made up; broken sensor: 0 %",
        "exported as SCL: words at start-up, call, rollback by LoadBackUp; and as rows of a watch table",
    )
    cannot = (
        "no cooling: OutputCool stays 0; no proof knows an actuator that heats and cools",
        "no inverted control (a cooler alone: pid-compact), no dead zone, no control zone, no cascade",
        "no setpoint ramp, no feed-forward (Disturbance), no manual in the proof",
    )
    fields = fields_of(TEMP)
    assumptions, timer, counts, inputs, core = Assumptions, TIMER, COUNTS, INPUTS, CORE
    tick_s, delay_s = 0.1, DELAY_S
    own_pwm = ("pid-compact", 10.0)
    most_power = ("OutputUpperLimit", 100.0)
    design, consistent, interval_s = staticmethod(design_of), staticmethod(consistent), staticmethod(interval_s)
    oddities, scan_all = staticmethod(oddities), staticmethod(scan)
    export: ClassVar = staticmethod(partial(export_words, TEMP))
    exported: ClassVar = staticmethod(partial(exported, TEMP))
    text: ClassVar = staticmethod(partial(from_text, TEMP))

    @staticmethod
    def values(design: PidDesign, scaling: Scaling) -> Mapping[str, Number]:  # noqa: ARG004 - in °C
        """Return the words of a design; raise NotRepresentable for a cooler's."""
        return values_of(TEMP, design)

    def begin(self, words: Words, assume: Assumptions) -> Running:
        """Return the state before automatic has ever been on."""
        return begin(words, assume)
