"""The controller of the printed program; its step runs the statement list that is exported."""

from __future__ import annotations

from typing import ClassVar

from heatertune.plc.controller import Controller, no_pid
from heatertune.plc.core import Core, Running, count
from heatertune.plc.cpu.s7_200 import COLD, assemble
from heatertune.plc.cpu.s7_200.cycle import TIMER
from heatertune.plc.cpu.s7_200.wiring import COUNTS
from heatertune.plc.s7_200_paper.export import export_words
from heatertune.plc.s7_200_paper.faults import faults
from heatertune.plc.s7_200_paper.listed import Listed, Loaded, listed
from heatertune.plc.s7_200_paper.listing import printed_program
from heatertune.plc.s7_200_paper.readback import from_text
from heatertune.plc.s7_200_paper.step import Assumptions, Constants, Memory, step
from heatertune.plc.s7_200_paper.words import FIELDS, cycle_s, values_of
from heatertune.plc.words import Words

__all__ = ["PaperProgram"]

_FLAGS = ("SM1.1", "SM1.3")


def _constants(words: Words, assume: Assumptions) -> Constants:
    v = words.whole
    return Constants(
        kp=v["KP"], ki=v["KI"], kd=v["KD"], t=v["T"], cycle_ms=v["CYCLE"], pot1=v["POT1"], assume=assume,
    )


def _direct(words: Words, assume: Assumptions) -> tuple[Core, Running]:
    return _DIRECT, Running(_constants(words, assume), Memory())


_DIRECT = Core(step=step, measure=count, flags=_FLAGS)


class PaperProgram(Controller, name="s7-200-paper"):
    """The paper's PID/PWM program with its faults; what it makes of its constants is no PID."""

    title = "SIMATIC S7-200 CPU 214, PID/PWM program as printed (Alia, Am. J. Appl. Sci. 4(5), 2007, Table 2)"
    can = ("what the paper prints, its own PWM on Q0.0; for comparison",)
    cannot = (
        "no PID: its P accumulates, its D acts as P",
        "no setpoint 128 counts or more above the reading: the error word wraps",
        "no setpoint ramp: the program is exported as the paper prints it",
    )
    fields, assumptions, timer, counts = FIELDS, Assumptions, TIMER, COUNTS
    inputs: ClassVar = {"SP": "BYTE", "PV": "BYTE", "CYCLE_START": "BOOL"}
    scans_per_period = 5  # real ones are more, which changes nothing between two readings
    core = Core(step=listed, measure=count, flags=_FLAGS, compiles=False)
    values, design, interval_s = staticmethod(values_of), staticmethod(no_pid), staticmethod(cycle_s)
    export, faults, direct = staticmethod(export_words), staticmethod(faults), staticmethod(_direct)
    text = staticmethod(from_text)

    def begin(self, words: Words, assume: Assumptions) -> Running:
        """Return the state before the first scan: all words 0."""
        cpu = COLD.written({"SM0.1": 1, "SMB29": words.whole["POT1"]})
        return Running(Loaded(assemble(printed_program(words)), _constants(words, assume)), Listed(cpu))
