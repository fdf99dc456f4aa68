"""The memory of an S7-200: addresses, and numbers (high byte first; words and double words are signed).

Source: System Manual C79000-G7076-C233-01, chapter 5. All areas share one array; byte and word access to an
accumulator is to its low end. Behind the areas lies internal state of the CPU that no instruction addresses. Plain
functions of numbers and bytes, which can be compiled.
"""

from __future__ import annotations

import re
from functools import lru_cache
from typing import Final, NamedTuple

from heatertune.plc.single_precision import real_of, word_of

__all__ = [
    "ATTACHED", "BEGUN", "CYCLE", "ENABLED", "EVENTS", "FAULTS", "PULSED", "SIZE", "V_BEGIN", "V_END", "WHOLE", "WIDTH",
    "MemoryCell", "bit", "cell", "constant", "double", "number", "put_double", "put_real", "put_word", "real", "word",
    "write_number",
]


#: area → where it begins in the memory, and its size in bytes
_AREAS: Final = {"I": (0, 16), "Q": (16, 16), "SM": (32, 256), "V": (288, 512), "AC": (800, 16), "AI": (816, 8)}
SIZE: Final = 824
#: V memory
V_BEGIN: Final = 288
V_END: Final = 800

#: cycle and width of the PWM generator on Q0.0, words in units of its time base
CYCLE: Final = SIZE
WIDTH: Final = SIZE + 2
#: whether interrupts are enabled
ENABLED: Final = SIZE + 4
#: whether the last pass through a block carried out PLS 0
PULSED: Final = SIZE + 5
#: which of SM1.1 and SM1.3 were set in the last pass, as bits of SMB1
FAULTS: Final = SIZE + 6
#: whether the first scan is over
BEGUN: Final = SIZE + 7
#: for each event the number of the block that is attached to it, 0: none
ATTACHED: Final = SIZE + 8
EVENTS: Final = 34
#: of the areas and of what lies behind them
WHOLE: Final = ATTACHED + EVENTS

_WIDTHS: Final = {"B": 1, "W": 2, "D": 4}
_BIT: Final = re.compile(r"(I|Q|SM|V)(\d+)\.([0-7])")
_CELL: Final = re.compile(r"(AI|I|Q|SM|V)([BWD])(\d+)")
_ACCUMULATOR: Final = re.compile(r"AC([0-3])")
_HEX: Final = re.compile(r"16#([0-9A-Fa-f]{1,8})")


class MemoryCell(NamedTuple):
    """A byte, word or double word."""

    start: int
    width: int


@lru_cache(maxsize=256)
def cell(text: str, width: int) -> MemoryCell:
    """Return the place of a cell that an instruction of this width [bytes] uses.

    Raises:
        ValueError: no address, none of this width, or beyond its area.
    """
    if match := _ACCUMULATOR.fullmatch(text):
        return MemoryCell(_AREAS["AC"][0] + 4 * int(match[1]) + 4 - width, width)
    match = _CELL.fullmatch(text)
    if match is None or _WIDTHS[match[2]] != width:
        raise ValueError(text)
    return MemoryCell(_place(match[1], int(match[3]), width), width)


def bit(text: str) -> tuple[int, int]:
    """Return byte and mask of a bit; raise ValueError for what is none."""
    match = _BIT.fullmatch(text)
    if match is None:
        raise ValueError(text)
    return _place(match[1], int(match[2]), 1), 1 << int(match[3])


def constant(text: str) -> int | None:
    """Return the value of a decimal or 16# constant, None for what is none."""
    if match := _HEX.fullmatch(text):
        return int(match[1], 16)
    return int(text) if re.fullmatch(r"[+-]?\d+", text) else None


def _place(area: str, offset: int, width: int) -> int:
    begin, size = _AREAS[area]
    if offset + width > size:
        raise ValueError(f"{area}{offset}")
    return begin + offset


def word(memory: bytearray, at: int) -> int:
    """Return the word at a place."""
    value = memory[at] * 0x100 + memory[at + 1]
    return value - 0x10000 if value >= 0x8000 else value


def put_word(memory: bytearray, at: int, value: int) -> None:
    """Write the low 16 bits of a number."""
    memory[at] = value >> 8 & 0xFF
    memory[at + 1] = value & 0xFF


def double(memory: bytearray, at: int) -> int:
    """Return the double word at a place."""
    value = memory[at] * 0x1000000 + memory[at + 1] * 0x10000 + memory[at + 2] * 0x100 + memory[at + 3]
    return value - 0x100000000 if value >= 0x80000000 else value


def put_double(memory: bytearray, at: int, value: int) -> None:
    """Write the low 32 bits of a number."""
    memory[at] = value >> 24 & 0xFF
    memory[at + 1] = value >> 16 & 0xFF
    memory[at + 2] = value >> 8 & 0xFF
    memory[at + 3] = value & 0xFF


def number(memory: bytearray, at: int, width: int) -> int:
    """Return a byte (unsigned), word or double word; `width` is in bytes."""
    if width == 2:
        return word(memory, at)
    return double(memory, at) if width == 4 else memory[at] * 1


def write_number(memory: bytearray, at: int, width: int, value: int) -> None:
    """Write the low bytes of a number."""
    if width == 2:
        put_word(memory, at, value)
    elif width == 4:
        put_double(memory, at, value)
    else:
        memory[at] = value & 0xFF


def real(memory: bytearray, at: int) -> float:
    """Return the REAL at a place."""
    return real_of(double(memory, at))


def put_real(memory: bytearray, at: int, value: float) -> None:
    """Write a number that single precision holds."""
    put_double(memory, at, word_of(value))
