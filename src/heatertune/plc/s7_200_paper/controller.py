"""The controller of the printed program; its step runs the statement list that is exported."""

from __future__ import annotations

from typing import ClassVar

from heatertune.plc.controller import Controller
from heatertune.plc.core import ControllerState, StepFunctions, count
from heatertune.plc.cpu.s7_200 import COLD, assemble
from heatertune.plc.cpu.s7_200.io_and_cycle import COUNTS, TIMER
from heatertune.plc.s7_200_paper.export import export_words, faults, from_text, printed_program, setpoint_entry
from heatertune.plc.s7_200_paper.step import (
    LoadedPaperProgram,
    PaperState,
    S7200PaperAssumptions,
    cold_start,
    own,
    step,
    warm_start,
)
from heatertune.plc.s7_200_paper.words import FIELDS, cycle_s, values_of
from heatertune.plc.words import Words, no_pid

__all__ = ["PaperProgram"]

_FLAGS = ("SM1.1", "SM1.3")


class PaperProgram(Controller, name="s7-200-paper"):
    """The paper's PID/PWM program with its faults; what it makes of its constants is no PID."""

    title = "SIMATIC S7-200 CPU 214, PID/PWM program as printed (Alia, Am. J. Appl. Sci. 4(5), 2007, Table 2)"
    main_file = "s7_200_paper.awl"
    setpoint_entry = staticmethod(setpoint_entry)
    can = ("what the paper prints, its own PWM on Q0.0; for comparison",)
    cannot = (
        "no PID: its P accumulates, its D acts as P",
        "no setpoint 128 counts or more above the reading: the error word wraps",
        "no setpoint ramp: the program is exported as the paper prints it",
    )
    fields, assumptions, timer, counts = FIELDS, S7200PaperAssumptions, TIMER, COUNTS
    inputs: ClassVar = {"SP": "BYTE", "PV": "BYTE", "CYCLE_START": "BOOL"}
    scans_per_period = 5  # real ones are more, which changes nothing between two readings
    core = StepFunctions(step=step, measure=count, flags=_FLAGS, own=own, cold_start=cold_start, warm_start=warm_start)
    values, design, interval_s = staticmethod(values_of), staticmethod(no_pid), staticmethod(cycle_s)
    export, faults, text = staticmethod(export_words), staticmethod(faults), staticmethod(from_text)

    def begin(self, words: Words, assume: S7200PaperAssumptions) -> ControllerState:
        """Return the state before the first scan: all words 0."""
        v = words.whole
        return ControllerState(LoadedPaperProgram(assemble(printed_program(words)), v["CYCLE"], v["POT1"], assume),
                               PaperState(COLD))
