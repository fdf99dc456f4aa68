"""The controller in PID_Temp, heating."""

from __future__ import annotations

from typing import ClassVar

from heatertune.plc.controller import Controller
from heatertune.plc.core import Running
from heatertune.plc.pid_compact.controller import CORE, COUNTS, DELAY_S, INPUTS, TIMER, UNREAD
from heatertune.plc.pid_temp.export import export_words, exported, from_text
from heatertune.plc.pid_temp.step import COLD, Assumptions, block_of, scan
from heatertune.plc.pid_temp.words import FIELDS, consistent, design_of, interval_s, oddities, values_of
from heatertune.plc.words import Words

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
    fields, assumptions, timer, counts, inputs, core = FIELDS, Assumptions, TIMER, COUNTS, INPUTS, CORE
    tick_s, delay_s, unread = 0.1, DELAY_S, UNREAD
    own_pwm = ("pid-compact", 10.0)
    most_power: ClassVar = ("OutputUpperLimit", 100.0)
    values, design, consistent = staticmethod(values_of), staticmethod(design_of), staticmethod(consistent)
    interval_s, export, scan_all = staticmethod(interval_s), staticmethod(export_words), staticmethod(scan)
    text, oddities, exported = staticmethod(from_text), staticmethod(oddities), staticmethod(exported)

    def begin(self, words: Words, assume: Assumptions) -> Running:
        """Return the state before automatic has ever been on."""
        return Running((block_of(words.values, assume), assume), COLD)
