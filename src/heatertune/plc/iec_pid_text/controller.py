"""The controller in the PID of IEC 61131-3, as its text is printed."""

from __future__ import annotations

from typing import ClassVar

from heatertune.plc.controller import Controller
from heatertune.plc.core import ControllerState, StepFunctions
from heatertune.plc.iec_pid.controller import measure
from heatertune.plc.iec_pid.export import setpoint_entry
from heatertune.plc.iec_pid.words import COUNTS, TIMER, interval_s
from heatertune.plc.iec_pid_text.export import entries, export_words, from_text
from heatertune.plc.iec_pid_text.faults import faults
from heatertune.plc.iec_pid_text.step import COLD, StandardPidAssumptions, block_of, scan, step
from heatertune.plc.iec_pid_text.words import FIELDS, design_of, values_of
from heatertune.plc.pwm import HALF_WAVE_S
from heatertune.plc.words import Words

__all__ = ["StandardPid"]


class StandardPid(Controller, name="iec-pid-text"):
    """The PID of the IEC 61131-3 text with its faults; the power is XOUT as far as it is within 0…100 %."""

    title = "IEC 61131-3 PID as printed (matiec in Beremiz and OpenPLC, lib/pid_st.txt)"
    main_file = "iec_pid_text.st"
    setpoint_entry = staticmethod(setpoint_entry)
    can = ("what the standard's text computes, for comparison; exported as a call of the library's block",)
    cannot = (
        "no limits, no anti-windup, no P or PD: TR = 0 divides by zero",
        "KP has to be negative for a heater, and by hand the output is KP*X0",
        "one unit of time in the I and D part for seconds alone (`--assume time_unit=s`: matiec)",
        "no setpoint ramp and no boost",
    )
    fields, assumptions, timer, counts = FIELDS, StandardPidAssumptions, TIMER, COUNTS
    inputs: ClassVar = {"SP": "REAL", "PV": "REAL", "X0": "REAL", "AUTO": "BOOL"}
    keyed_entries = staticmethod(entries)
    tick_s = HALF_WAVE_S
    core = StepFunctions(step=step, measure=measure, flags=("above 100 %", "below 0 %", "overflow"), singles=True)
    values, design, interval_s = staticmethod(values_of), staticmethod(design_of), staticmethod(interval_s)
    export, scan_all, faults = staticmethod(export_words), staticmethod(scan), staticmethod(faults)
    text = staticmethod(from_text)

    def begin(self, words: Words, assume: StandardPidAssumptions) -> ControllerState:
        """Return the state before the first call."""
        return ControllerState((block_of(words.values, assume), assume), COLD)
