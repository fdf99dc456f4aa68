"""Numbers in the memory of an S7-200, high byte first; words and double words are signed.

Plain functions of numbers and bytes, which run compiled too.
"""

from __future__ import annotations

from heatertune.plc.single_precision import real_of, word_of

__all__ = ["double", "number", "put_double", "put_real", "put_word", "real", "word", "write_number"]


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
