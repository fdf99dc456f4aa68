"""Literals and declarations of an STL source, as bits and bytes."""

from __future__ import annotations

import re
import struct
from typing import Final, NamedTuple

from heatertune.errors import InputError

__all__ = ["Place", "as_real", "bits_of", "constant", "placed", "signed"]

_SIZES: Final = {"BOOL": 0, "BYTE": 1, "INT": 2, "WORD": 2, "DINT": 4, "TIME": 4, "REAL": 4, "DATE_AND_TIME": 8}
_DECLARED: Final = re.compile(r"(\w+) : (\w+) *(?:\[[^\]]*\] *OF \w+ *)?;")


class Place(NamedTuple):
    """Where something stands: the name of a memory, its first byte, its bit or none, and how many bytes."""

    memory: str
    byte: int
    bit: int
    size: int


def as_real(pattern: int) -> float:
    """Return the REAL that 32 bits hold."""
    value: float = struct.unpack(">f", struct.pack(">I", pattern))[0]
    return value


def bits_of(value: float) -> int:
    """Return the 32 bits of a REAL."""
    pattern: int = struct.unpack(">I", struct.pack(">f", value))[0]
    return pattern


def signed(value: int, width: int) -> int:
    """Return the number that so many bits hold."""
    return (value + (1 << width - 1)) % (1 << width) - (1 << width - 1)


def placed(lines: list[str], memory: str, byte: int) -> dict[str, Place]:
    """Return the places of declared members: bits one after the other, all else from an even byte on."""
    members, bit = {}, 0
    for line in lines:
        found = _DECLARED.match(line)
        if found is None:
            continue
        size = _SIZES.get(found[2], 20)
        if size == 0:
            byte, bit = (byte + 1, 0) if bit > 7 else (byte, bit)
            members[found[1]] = Place(memory, byte, bit, 0)
            bit += 1
            continue
        byte, bit = byte + (1 if bit else 0), 0
        byte += byte % 2 if size > 1 else 0
        members[found[1]] = Place(memory, byte, 0, size)
        byte += size
    return members


def constant(text: str) -> int:
    """Return the bits of a literal; a whole one without L# has 16.

    Raises:
        InputError: it is none that is known here.
    """
    if text in ("TRUE", "FALSE"):
        return int(text == "TRUE")
    if found := re.fullmatch(r"T#(\d+)MS", text):
        return int(found[1])
    if text.startswith("DW#16#"):
        return int(text[6:], 16)
    if text.startswith("L#"):
        return int(text[2:]) % (1 << 32)
    if re.fullmatch(r"-?\d+", text):
        return int(text) % (1 << 16)
    try:
        return bits_of(float(text))
    except ValueError:
        raise InputError(f"{text!r}; this is no operand that is known here") from None
