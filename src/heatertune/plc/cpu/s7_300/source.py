"""Statements, literals and declarations of an STL source; the latter as bits and bytes."""

from __future__ import annotations

import re
import struct
from collections.abc import Iterable, Iterator
from typing import Final, NamedTuple

from heatertune.errors import InputError
from heatertune.plc.cpu.statements import StatementLine

__all__ = ["LAST", "MemberPlace", "as_real", "bits_of", "constant", "member_places", "numbered_lines", "signed_number",
           "statements"]

#: last lines of blocks
LAST: Final = ("END_FUNCTION_BLOCK", "END_DATA_BLOCK", "END_FUNCTION", "END_ORGANIZATION_BLOCK")

_SIZES: Final = {"BOOL": 0, "BYTE": 1, "INT": 2, "WORD": 2, "DINT": 4, "TIME": 4, "REAL": 4, "DATE_AND_TIME": 8}
_STATEMENT: Final = re.compile(r"\s*(?:(\w+):)?\s*(\S+)\s*(.*?)\s*")
_DECLARED: Final = re.compile(r"(\w+) : (\w+) *(?:\[[^\]]*\] *OF \w+ *)?;")
_REAL: Final = struct.Struct(">f")
_BITS: Final = struct.Struct(">I")


class MemberPlace(NamedTuple):
    """Where something stands: the name of a memory, its first byte, its bit or none, and how many bytes."""

    memory: str
    byte: int
    bit: int
    size: int


def numbered_lines(source: str) -> Iterator[tuple[int, str]]:
    """Yield the lines and their numbers, from 1 on, without remarks and blanks around."""
    for number, line in enumerate(source.splitlines(), 1):
        yield number, line.partition("//")[0].strip()


def statements(lines: Iterable[tuple[int, str]]) -> list[StatementLine]:
    """Return the statements of a block's lines: each ends in a semicolon, and may take several of them.

    Raises:
        InputError: a line after which none ends.
    """
    found, begun, text = list[StatementLine](), 0, ""
    for number, line in lines:
        if not line or (not text and line.startswith(("NETWORK", "TITLE"))):
            continue
        begun, text = (begun, f"{text} {line}") if text else (number, line)
        *whole, text = text.split(";")
        found += [_statement(begun, each) for each in whole]
        begun, text = number, text.strip()
    if text:
        raise InputError(f"line {begun}: {text!r}; expected a semicolon")
    return found


def _statement(number: int, text: str) -> StatementLine:
    parts = _STATEMENT.fullmatch(text)
    if parts is None:
        raise InputError(f"line {number}: {text.strip()!r}; this is no statement")
    return StatementLine(number, parts[1] or "", parts[2], " ".join(parts[3].split()))


def as_real(pattern: int) -> float:
    """Return the REAL that 32 bits hold."""
    value: float = _REAL.unpack(_BITS.pack(pattern))[0]
    return value


def bits_of(value: float) -> int:
    """Return the 32 bits of a REAL."""
    pattern: int = _BITS.unpack(_REAL.pack(value))[0]
    return pattern


def signed_number(value: int, width: int) -> int:
    """Return the number that so many bits hold."""
    return (value + (1 << width - 1)) % (1 << width) - (1 << width - 1)


def member_places(lines: list[str], memory: str, byte: int) -> dict[str, MemberPlace]:
    """Return the places of declared members: bits one after the other, all else from an even byte on."""
    members, bit = {}, 0
    for line in lines:
        found = _DECLARED.match(line)
        if found is None:
            continue
        size = _SIZES.get(found[2], 20)
        if size == 0:
            byte, bit = (byte + 1, 0) if bit > 7 else (byte, bit)
            members[found[1]] = MemberPlace(memory, byte, bit, 0)
            bit += 1
            continue
        byte, bit = byte + (1 if bit else 0), 0
        byte += byte % 2 if size > 1 else 0
        members[found[1]] = MemberPlace(memory, byte, 0, size)
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
