"""The controller of the repaired program; its step runs the statement list that is exported."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

from heatertune.plc.controller import Controller
from heatertune.plc.core import ControllerState, StepFunctions, count
from heatertune.plc.cpu.s7_200 import COLD, assemble
from heatertune.plc.cpu.s7_200.io_and_cycle import COUNTS, TIMER, check_cycle, cycle_s, timed_program
from heatertune.plc.cpu.s7_200.state import cold_start, own, warm_start
from heatertune.plc.s7_200.export import COUNTDOWN, export_words, from_text, repaired_program, setpoint_entry
from heatertune.plc.s7_200.step import S7200ManualAssumptions, step
from heatertune.plc.s7_200.words import FIELDS, design_of, most_gain, values_of
from heatertune.plc.words import Words

__all__ = ["S7200"]

_FLAGS = ("SM1.1", "SM1.3")


class S7200(Controller, name="s7-200"):
    """The paper's PID/PWM program, repaired: whole numbers; the program computes once in each PWM cycle."""

    title = "SIMATIC S7-200 CPU 214, PID/PWM program (Alia, Am. J. Appl. Sci. 4(5), 2007, Table 2), repaired"
    main_file = "s7_200_program.awl"
    setpoint_entry = staticmethod(setpoint_entry)
    can = (
        "PI and PID in whole numbers, D on the process variable; its own PWM on Q0.0 of 0.1 to 32.7 s",
        "free of overflow for every pair of setpoint and reading", "setpoint ramp in whole counts",
    )
    cannot = ("no P alone: the pulse width accumulates", "8-bit readings, no manual mode")
    fields, assumptions, timer, counts = FIELDS, S7200ManualAssumptions, TIMER, COUNTS
    inputs: ClassVar = {"SP": "BYTE", "PV": "BYTE"}
    derivative_filter = 0.0
    scans_per_period = 1
    integers = ("KP", "KI", "KD")
    has_ramp = True
    core = StepFunctions(step=step, measure=count, flags=_FLAGS, own=own, cold_start=cold_start, warm_start=warm_start)
    values, design, consistent = staticmethod(values_of), staticmethod(design_of), staticmethod(check_cycle)
    interval_s, export = staticmethod(cycle_s), staticmethod(export_words)
    most_gain, text = staticmethod(most_gain), staticmethod(from_text)

    def begin(self, words: Words, assume: S7200ManualAssumptions) -> ControllerState:
        """Return the state after power-up, the program loaded; `step` is told where its setpoint is on a ramp."""
        program = assemble(repaired_program(replace(words, ramp=None)))
        return ControllerState(timed_program(program, words.whole, COUNTDOWN, next_cycle=assume.next_cycle), COLD)
