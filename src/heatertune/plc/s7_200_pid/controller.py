"""The controller of the PID instruction; its step runs the statement list that is exported."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

from heatertune.plc.controller import Controller
from heatertune.plc.core import ControllerState, StepFunctions
from heatertune.plc.cpu.s7_200 import COLD, assemble
from heatertune.plc.cpu.s7_200.io_and_cycle import (
    TIMER,
    check_cycle,
    cold_start,
    cycle_s,
    own,
    timed_program,
    warm_start,
)
from heatertune.plc.s7_200_pid.export import (
    COUNTDOWN,
    export_words,
    from_image,
    from_text,
    oddities,
    pid_program,
    setpoint_entry,
)
from heatertune.plc.s7_200_pid.step import STEP, S7200PidAssumptions, measure, step
from heatertune.plc.s7_200_pid.words import FIELDS, FULL, RANGES, UNREAD, design_of, values_of
from heatertune.plc.words import Words

__all__ = ["S7200Pid"]

_FLAGS = ("SM1.1",)


class S7200Pid(Controller, name="s7-200-pid"):
    """The PID instruction in single precision; the loop is called once in each PWM cycle."""

    title = "SIMATIC S7-200, PID instruction (System Manual C79000-G7076-C233-01, pp. 9-84 to 9-91)"
    main_file = "s7_200_pid.awl"
    setpoint_entry = staticmethod(setpoint_entry)
    can = (
        "P, PI and PID in single precision, D on the process variable; its own PWM on Q0.0 of 0.1 to 32.7 s",
        "bias clamped with the output: no windup", "setpoint ramp in whole input words",
    )
    cannot = ("only on a CPU 22x; no manual mode in this program", "no filter of the derivative")
    fields, assumptions, timer, counts = FIELDS, S7200PidAssumptions, TIMER, FULL // STEP
    ranges, unread = RANGES, UNREAD
    inputs: ClassVar = {"SP": "INT", "PV": "INT"}
    derivative_filter = 0.0
    scans_per_period = 1
    has_ramp = True
    core = StepFunctions(
        step=step, measure=measure, flags=_FLAGS, own=own, cold_start=cold_start, warm_start=warm_start)
    values, design, consistent = staticmethod(values_of), staticmethod(design_of), staticmethod(check_cycle)
    interval_s, export = staticmethod(cycle_s), staticmethod(export_words)
    image, oddities, text = staticmethod(from_image), staticmethod(oddities), staticmethod(from_text)

    def begin(self, words: Words, assume: S7200PidAssumptions) -> ControllerState:
        """Return the state after power-up, the program loaded; `step` is told where its setpoint is on a ramp."""
        program = assemble(pid_program(replace(words, ramp=None)))
        return ControllerState(timed_program(program, words.whole, COUNTDOWN, next_cycle=assume.next_cycle), COLD)
