"""The controller of the printed program; its step runs the statement list that is exported."""

from __future__ import annotations

from typing import ClassVar

from heatertune.plc.controller import Controller
from heatertune.plc.core import Core, Running, count
from heatertune.plc.cpu.s7_200 import COLD, assemble
from heatertune.plc.cpu.s7_200.cycle import TIMER
from heatertune.plc.cpu.s7_200.wiring import COUNTS
from heatertune.plc.s7_200_paper.export import export_words, setpoint_entry
from heatertune.plc.s7_200_paper.faults import faults
from heatertune.plc.s7_200_paper.listing import printed_program
from heatertune.plc.s7_200_paper.readback import from_text
from heatertune.plc.s7_200_paper.step import Assumptions, Listed, Loaded, own, restarted, started, step
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
    fields, assumptions, timer, counts = FIELDS, Assumptions, TIMER, COUNTS
    inputs: ClassVar = {"SP": "BYTE", "PV": "BYTE", "CYCLE_START": "BOOL"}
    scans_per_period = 5  # real ones are more, which changes nothing between two readings
    core = Core(step=step, measure=count, flags=_FLAGS, own=own, started=started, restarted=restarted)
    values, design, interval_s = staticmethod(values_of), staticmethod(no_pid), staticmethod(cycle_s)
    export, faults, text = staticmethod(export_words), staticmethod(faults), staticmethod(from_text)

    def begin(self, words: Words, assume: Assumptions) -> Running:
        """Return the state before the first scan: all words 0."""
        v = words.whole
        return Running(Loaded(assemble(printed_program(words)), v["CYCLE"], v["POT1"], assume), Listed(COLD))
