"""V memory of an S7-200 in a virtual PLC.

The program itself lives in that memory: its cells stand where it has them, its first scan types the words in, and what
a client writes there is what the next interrupt finds. Inputs, outputs and special memory stand elsewhere: of the
paper's program the setpoint is an analog adjustment, SMB28, and of both the pulse width SMW70.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from heatertune.errors import InputError
from heatertune.live.layout import BLOCKS, CellAddress, RegisterRange
from heatertune.live.memory import Signal, bytes_of, field_of
from heatertune.plc import Words
from heatertune.plc.controller import Controller
from heatertune.plc.cpu.s7_200 import S7200State
from heatertune.plc.cpu.s7_200.cycle import run_cycle
from heatertune.plc.cpu.s7_200.memory import V_BEGIN, V_END, cell, put_word
from heatertune.plc.cpu.s7_200.state import own, warm_start
from heatertune.plc.cpu.s7_200.wiring import COUNTS
from heatertune.plc.ramp import Number
from heatertune.plc.s7_200.step import step
from heatertune.plc.s7_200_pid.words import FULL, SETPOINT, TABLE
from heatertune.plc.single_precision import divide_single

__all__ = ["PaperMemory", "PidMemory"]

_ANALOG: Final = cell("AIW0", 2).start
#: setpoint, process variable and output in the loop table, as shares (System Manual, table 9-19)
_READING, _SETPOINT, _POWER = CellAddress(TABLE, "REAL"), CellAddress(int(SETPOINT[2:]), "REAL"), CellAddress(TABLE + 8,
                                                                                                              "REAL")
_WIDTHS: Final = {"VD": 4, "VW": 2}
_V: Final = slice(V_BEGIN, V_END)


class _VMemory:
    """512 bytes of V memory, which S7 clients find as DB 1; see `heatertune.live.blocks.ServedBlock`."""

    number, manual = 1, False
    description, operators, mode = "V memory", (), slice(0)
    undone_by = "the first scan after a start-up types in the words of the program that is loaded"
    speaks = BLOCKS
    registers: Sequence[RegisterRange] = ()

    def __init__(self, controller: Controller, words: Words, assume: Any) -> None:
        """Take words that run under assumptions.

        Args:
            controller: one of the S7-200's.
            words: that its program types in at the first scan.
            assume: what the manual leaves open.
        """
        self._fields = [field for field in controller.fields if field.address[:2] in _WIDTHS]
        self.words = {field.name: Signal(int(field.address[2:]), field.format) for field in self._fields
                      if field.format == "REAL"}  # the program has its ticks as constants
        self.bits: dict[str, tuple[int, int]] = {}
        self._timed, self._cold = controller.begin(words, assume)
        self._asked: Number | None = None
        self.signals = self._signals((words.scaling.low_degC, words.scaling.high_degC))

    def image(self) -> bytes:
        """Return the memory before the first scan."""
        return bytes(self._cold.memory[_V])

    def begin(self) -> S7200State:
        """Return a CPU before its first scan."""
        return own(self._cold)

    def _signals(self, degC: tuple[float, float]) -> dict[str, Signal]:
        """Return what it shows; `degC` are both ends of the sensor."""
        raise NotImplementedError

    def restarted(self, state: S7200State) -> S7200State:
        """Return the state after a start-up that finds V memory as it was."""
        self._asked = None
        return warm_start(None, self._cold, state)

    def in_manual(self, _cells: bytes | bytearray) -> bool:
        """Return False: these programs have no manual mode."""
        return False

    def into_automatic(self, _cells: bytearray) -> None:
        """Do nothing."""

    def put_in_manual(self, _cells: bytes, _power_pct: float) -> tuple[int, bytes]:
        """Return nothing.

        Raises:
            InputError: always: these programs have no manual mode.
        """
        raise InputError("the exported programs of the S7-200 have no manual mode: switch manually, and record it")

    def put_word(self, cells: bytearray, name: str, value: float) -> None:
        """Write one word that stands in V memory; errors as `heatertune.live.memory`."""
        field = field_of(self._fields, name)
        content, place = bytes_of(field, value), int(field.address[2:])
        cells[place : place + len(content)] = content


class PidMemory(_VMemory):
    """Of the program of the PID instruction: its loop table, REALs as shares of the range, begins at VB100."""

    def _signals(self, degC: tuple[float, float]) -> dict[str, Signal]:
        shown = {"temperature": (_READING, degC), "power": (_POWER, (0.0, 100.0)), "setpoint": (_SETPOINT, degC)}
        return {name: Signal(place.byte, "REAL", shown=scale) for name, (place, scale) in shown.items()}

    def scan(self, cells: bytearray, state: S7200State, setpoint: Number, reading: Number) -> tuple[S7200State, float,
                                                                                                    int, int]:
        """Run one PWM cycle; see `heatertune.live.blocks.ServedBlock`."""
        if setpoint != self._asked:
            _SETPOINT.write(cells, divide_single(float(setpoint), float(FULL)))
            self._asked = setpoint
        memory = state.memory
        memory[_V] = cells
        put_word(memory, _ANALOG, int(reading))
        power, width, faults = run_cycle(self._timed, memory)
        cells[:] = memory[_V]
        return state, power, width, faults & 1


class PaperMemory(_VMemory):
    """Of the paper's program, repaired: reading in VW0, error in VW10."""

    def _signals(self, degC: tuple[float, float]) -> dict[str, Signal]:
        return {"temperature": Signal(0, "INT", (0, COUNTS), degC)}

    def scan(self, cells: bytearray, state: S7200State, setpoint: Number, reading: Number) -> tuple[S7200State, float,
                                                                                                    int, int]:
        """Run one PWM cycle; see `heatertune.live.blocks.ServedBlock`."""
        state.memory[_V] = cells
        outcome = step(self._timed, state, int(setpoint), int(reading), True)
        cells[:] = state.memory[_V]
        return outcome
