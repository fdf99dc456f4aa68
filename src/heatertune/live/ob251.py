"""OB251's controller data block in a virtual PLC.

Words and the cells X, Z, XZ and YA stand where the manual has them. Of the other cells between DW18 and DW48 it says
that they hold the state, not how: the layout here is this simulator's own. It holds the state to the last bit, so that
a client who writes there changes it, as on a real CPU.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from typing import Final

from heatertune.live.layout import BLOCKS, RegisterRange
from heatertune.live.memory import Signal, bytes_of, field_of
from heatertune.plc import Words
from heatertune.plc.controller import Controller
from heatertune.plc.ramp import Number
from heatertune.plc.s5_ob251.blocks import DB
from heatertune.plc.s5_ob251.export import LENGTH, PLACES, from_cells, to_image
from heatertune.plc.s5_ob251.step import (
    AUTO,
    COLD,
    FULL_SCALE,
    GESCHW,
    HANDART,
    Ob251Assumptions,
    Ob251Parameters,
    Ob251State,
    scan,
    start_up,
)
from heatertune.plc.s5_ob251.words import parameters_of

__all__ = ["Ob251Block"]

_WORDS: Final = struct.Struct(f">{LENGTH}H")
_ONE: Final = struct.Struct(">h")
#: DW18 to DW48: XW, its change, (X), side and count of calls, (Z), change of XZ, XZ before, Z before, (XZ), dD, Y, YA
_STATE: Final = struct.Struct(">ii2xbb2xihh2xdd20xh")
_BEGIN: Final = 2 * 18
#: places of setpoint, reading, disturbance variable and of what the D part may act on
_W, _X, _Z, _XZ, _YA = 2 * PLACES["W"], 2 * 22, 2 * 24, 2 * 29, 2 * 48
_CONTROL: Final = 2 * PLACES["STEU"]
_STEU: Final = _CONTROL + 1  # its low byte
#: no call gives a number beyond it: what is found there was never one
_MOST: Final = 1e15
_MOST_DIFFERENCE: Final = 4 * 32768  # of two errors, each of which is one of two words
_CALLS: Final = 4


class Ob251Block:
    """DB30, 49 words; see `heatertune.live.blocks.ServedBlock`."""

    number, manual = DB, True
    description, undone_by = "49 words", ""
    operators, mode = ("STEU", "YH"), slice(_STEU, _STEU + 1)
    speaks = (*BLOCKS, "as511")
    registers: Sequence[RegisterRange] = ()

    def __init__(self, controller: Controller, words: Words, assume: Ob251Assumptions) -> None:
        """Take words that run under assumptions.

        Args:
            controller: OB251.
            words: that it holds at the beginning.
            assume: what the manual leaves open.
        """
        self._fields, self._image, self._assume = controller.fields, to_image(words), assume
        degC = words.scaling.low_degC, words.scaling.high_degC
        self.signals = {
            name: Signal(place, "INT", (0, FULL_SCALE), shown)
            for name, place, shown in (("temperature", _X, degC), ("power", _YA, (0, 100)), ("setpoint", _W, degC))}
        self.words = {field.name: Signal(2 * PLACES[field.name], field.format) for field in self._fields}
        self.words["STEU"] = Signal(_STEU, "BYTE")  # the high byte belongs to the operating system
        self.bits: dict[str, tuple[int, int]] = {}
        self._asked: Number | None = None
        self._words, self._parameters = b"", parameters_of(words.whole)
        self._kept = self._image[_BEGIN:]

    def image(self) -> bytes:
        """Return the block as it is keyed in."""
        return self._image

    def begin(self) -> Ob251State:
        """Return the cold state."""
        return COLD

    def scan(self, cells: bytearray, state: Ob251State, setpoint: Number, reading: Number) -> tuple[Ob251State, float,
                                                                                                    int, int]:
        """Run one scan; see `heatertune.live.blocks.ServedBlock`."""
        if setpoint != self._asked:
            _ONE.pack_into(cells, _W, int(setpoint))
            self._asked = setpoint
        _ONE.pack_into(cells, _X, int(reading))
        if cells[_BEGIN:] != self._kept:
            state = _found(cells, state, self._kept)
        w, z, xz = (_ONE.unpack_from(cells, place)[0] for place in (_W, _Z, _XZ))
        parameters = self._parameters_in(cells), self._assume
        after, power, output, flags = scan(parameters, state, {"W": w, "X": int(reading), "Z": z, "XZ": xz})
        _keep(cells, after)
        self._kept = bytes(cells[_BEGIN:])
        return after, power, output, flags

    def _parameters_in(self, cells: bytearray) -> Ob251Parameters:
        words = bytes(cells[:_BEGIN])
        if words != self._words:
            self._words, self._parameters = words, parameters_of(from_cells(_WORDS.unpack(cells)))
        return self._parameters

    def restarted(self, state: Ob251State) -> Ob251State:
        """Return the state after OB21 or OB22."""
        self._asked = None
        return start_up((self._parameters, self._assume), COLD, state)

    def in_manual(self, cells: bytes | bytearray) -> bool:
        """Return whether bit 0 of STEU is clear."""
        return not cells[_STEU] & AUTO

    def into_automatic(self, cells: bytearray) -> None:
        """Set that bit."""
        cells[_STEU] |= AUTO

    def put_in_manual(self, cells: bytes, power_pct: float) -> tuple[int, bytes]:
        """Return STEU, its bit 0 clear, and YH, which follows it; see `heatertune.live.blocks.ServedBlock`."""
        steu = int.from_bytes(cells[_CONTROL : _CONTROL + 2], "big") & ~(AUTO | HANDART | GESCHW)
        return _CONTROL, struct.pack(">Hh", steu, round(power_pct / 100.0 * FULL_SCALE))

    def put_word(self, cells: bytearray, name: str, value: float) -> None:
        """Write one word; errors as `heatertune.live.memory`."""
        content, place = bytes_of(field_of(self._fields, name), value), 2 * PLACES[name]
        cells[place : place + len(content)] = content


def _keep(cells: bytearray, state: Ob251State) -> None:
    """Write the state and YA; the inputs between them stay."""
    inputs = [(place, bytes(cells[place : place + 2])) for place in (_X, _Z, _XZ)]
    _STATE.pack_into(
        cells, _BEGIN, int(state.error), int(state.error_change), state.at_limit, state.approach,
        int(state.substitute_change), int(state.substitute), int(state.disturbance), state.derivative, state.total,
        state.output)
    for place, content in inputs:
        cells[place : place + 2] = content


def _found(cells: bytearray, state: Ob251State, kept: bytes) -> Ob251State:
    """Return the state as the cells have it, where somebody has written to them since; inputs are none of it."""
    now = bytearray(cells[_BEGIN:])
    for place in (_X, _Z, _XZ):
        at = place - _BEGIN
        now[at : at + 2] = kept[at : at + 2]
    if now == kept:
        return state
    error, change, side, calls, other_change, other, disturbance, derivative, total, output = _STATE.unpack(now)
    return Ob251State(
        error=_difference(error), error_change=_difference(change), substitute=float(other),
        substitute_change=float(other_change), derivative=_real(derivative), disturbance=float(disturbance),
        total=_real(total), output=output, at_limit=(side > 0) - (side < 0), approach=min(max(calls, 0), _CALLS))


def _difference(found: int) -> float:
    """Return an error or its change that calls could have left, 0 for another."""
    return float(found) if abs(found) <= _MOST_DIFFERENCE else 0.0


def _real(found: float) -> float:
    """Return a number that a call could have left, 0 for a pattern of bits that is none."""
    return found if math.isfinite(found) and abs(found) <= _MOST else 0.0

