"""V memory of an S7-200 that runs the program of the PID instruction, in a virtual PLC.

The program itself lives in that memory: loop table, setpoint and counters stand where it has them, its first scan
types the words in, and what a client writes there is what the next interrupt finds.
"""

from __future__ import annotations

import struct
from typing import Final

from heatertune.errors import InputError
from heatertune.live.cells import Signal, bytes_of, field_of
from heatertune.plc import Words
from heatertune.plc.controller import Controller
from heatertune.plc.cpu.s7_200 import State
from heatertune.plc.cpu.s7_200.cells import V_BEGIN, V_END, cell
from heatertune.plc.cpu.s7_200.cycle import run_cycle
from heatertune.plc.cpu.s7_200.memory import put_word
from heatertune.plc.cpu.s7_200.state import own, restarted
from heatertune.plc.ramp import Number
from heatertune.plc.s7_200_pid.step import Assumptions
from heatertune.plc.s7_200_pid.words import FULL, SETPOINT, TABLE
from heatertune.plc.single import divided

__all__ = ["VMemory"]

_READING: Final = cell("AIW0", 2).start
_SETPOINT: Final = cell(SETPOINT, 4).start - V_BEGIN
#: process variable and output in the loop table, as shares (System Manual, table 9-19)
_VARIABLE: Final = TABLE
_OUTPUT: Final = TABLE + 8
_WIDTHS: Final = {"VD": 4, "VW": 2}
_V: Final = slice(V_BEGIN, V_END)


class VMemory:
    """512 bytes of V memory, which S7 clients find as DB 1; see `heatertune.live.blocks.Block`."""

    number, manual = 1, False
    told = "V memory"

    def __init__(self, controller: Controller, words: Words, assume: Assumptions) -> None:
        """Take words that run under assumptions.

        Args:
            controller: the PID instruction's.
            words: that its program types in at the first scan.
            assume: what the manual leaves open.
        """
        self._fields = [field for field in controller.fields if field.address[:2] in _WIDTHS]
        self.words = {field.name: Signal(int(field.address[2:]), field.format) for field in self._fields}
        self._timed, self._cold = controller.begin(words, assume)
        self._asked: Number | None = None
        degC = words.scaling.low_degC, words.scaling.high_degC
        shown = {"temperature": (_VARIABLE, degC), "power": (_OUTPUT, (0.0, 100.0)), "setpoint": (_SETPOINT, degC)}
        self.signals = {name: Signal(place, "REAL", shown=scale) for name, (place, scale) in shown.items()}

    def image(self) -> bytes:
        """Return the memory before the first scan."""
        return bytes(self._cold.memory[_V])

    def begin(self) -> State:
        """Return a CPU before its first scan."""
        return own(self._cold)

    def scan(self, cells: bytearray, state: State, setpoint: Number, reading: Number) -> tuple[State, float, int, int]:
        """Run one PWM cycle; see `heatertune.live.blocks.Block`."""
        if setpoint != self._asked:
            struct.pack_into(">f", cells, _SETPOINT, divided(float(setpoint), float(FULL)))
            self._asked = setpoint
        memory = state.memory
        memory[_V] = cells
        put_word(memory, _READING, int(reading))
        power, width, faults = run_cycle(self._timed, memory)
        cells[:] = memory[_V]
        return state, power, width, faults & 1

    def restarted(self, state: State) -> State:
        """Return the state after a start-up that finds V memory as it was."""
        self._asked = None
        return restarted(None, self._cold, state)

    def in_manual(self, _cells: bytes | bytearray) -> bool:
        """Return False: this program has no manual mode."""
        return False

    def into_automatic(self, _cells: bytearray) -> None:
        """Do nothing."""

    def by_hand(self, _cells: bytes, _power_pct: float) -> tuple[int, bytes]:
        """Return nothing.

        Raises:
            InputError: always: this program has no manual mode.
        """
        raise InputError("the exported program of s7-200-pid has no manual mode: switch by hand, and record it")

    def put_word(self, cells: bytearray, name: str, value: float) -> None:
        """Write one word that stands in V memory; errors as `heatertune.live.cells`."""
        content, place = bytes_of(field_of(self._fields, name), value), self.words[name].start
        cells[place : place + len(content)] = content
