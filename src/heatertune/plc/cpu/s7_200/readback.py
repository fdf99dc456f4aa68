"""Text of STEP 7-Micro/WIN: a data block as its editor has it, and the constants that a statement list loads."""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from typing import Final, NamedTuple

from heatertune.plc.ramp import Number
from heatertune.plc.readback import first_unlike, lines_of, real_of, whole_of, wrong

__all__ = ["DataBlockMemory", "LoadedNumber", "difference", "is_program", "loads", "statements"]

_PROGRAM: Final = re.compile(r"^[ \t]*(?:(?:ORGANIZATION|SUBROUTINE|INTERRUPT)_BLOCK|NETWORK|LD|MEND)\b",
                             re.IGNORECASE | re.MULTILINE)
_PLACE: Final = re.compile(r"V([BWD])(\d{1,5})(?:\s*,\s*|\s+)(.*)", re.IGNORECASE | re.ASCII)
_KEYWORD: Final = re.compile(r"(?:END_)?DATA_BLOCK\b.*|BEGIN|TITLE\s*=.*", re.IGNORECASE)
_SIZES: Final = {"B": 1, "W": 2, "D": 4}
#: decimal numbers of a size; in another base all bits may be written
_RANGES: Final = {"B": (0, 255), "W": (-32768, 32767), "D": (-2147483648, 2147483647)}
_MOST: Final = 65536
_NO_CODE: Final = re.compile(r"TITLE\b.*|BEGIN|(?:END_)?\w+_BLOCK|NETWORK", re.IGNORECASE)
_LOAD: Final = re.compile(r"MOV([BWDR])")
_EXAMPLE: Final = "an entry such as VW200 1234 or VD112 2.5"
#: the heads of a status chart, and a row of it: number, address, format, current value; the new value is not the CPU's
_CHART_HEADS: Final = re.compile(r"(?:#\s+)?(?:Address|Adresse|Operand)\s+Format\b.*", re.IGNORECASE)
_CHART_ROW: Final = re.compile(
    r"(?:\d+\s+)?(V[BWD]\s?\d{1,5})\s+(?:Floating Point|Gleitpunkt|(?:Un)?signed|(?:Mit|Ohne) Vorzeichen"
    r"|Hexa\w+|Bin\w+)\s+(\S+)(?:\s+\S+)?", re.IGNORECASE | re.ASCII)


class LoadedNumber(NamedTuple):
    """A number that stands in a text."""

    line: int
    shown: str
    value: Number


def is_program(text: str) -> bool:
    """Return whether a text is a statement list, not a data block."""
    return _PROGRAM.search(text) is not None


class _Byte(NamedTuple):
    value: int
    line: int
    place: str
    shown: str
    decimal: bool  # typed as a decimal whole number


class DataBlockMemory:
    """V memory as the entries of a data block fill it.

    Args:
        text: of the data block, or of a status chart; an entry without an address goes on where the one before ended.
        source: name for error messages.

    Raises:
        InputError: a line that is no entry, a value that does not fit its place, a byte that is written twice.
    """

    def __init__(self, text: str, source: str) -> None:
        self._bytes: dict[int, _Byte] = {}
        self._source = source
        self._read: set[int] = set()
        size, place = "", 0
        for line, content in lines_of(text):
            entry = content.partition("//")[0].strip()
            if not entry or _KEYWORD.fullmatch(entry) or _CHART_HEADS.fullmatch(entry):
                continue
            entry = _CHART_ROW.sub(r"\1 \2", entry)
            match = _PLACE.fullmatch(entry)
            if match is not None:
                size, place, entry = match[1].upper(), int(match[2]), match[3]
            elif not size or entry[:1].upper() == "V":
                raise wrong(source, line, "entry", entry, _EXAMPLE)
            for shown in (part.strip() for part in entry.split(",")):
                place = self._write(size, place, shown, line)

    def _write(self, size: str, place: int, shown: str, line: int) -> int:
        packed = _packed(size, shown)
        if place + _SIZES[size] > _MOST:
            raise wrong(self._source, line, f"V{size}{place}", shown, f"a place below V{_MOST}")
        if packed is None:
            low, high = _RANGES[size]
            raise wrong(self._source, line, f"V{size}{place}", shown,
                        f"a whole number {low}…{high}{', or a REAL with a point' if size == 'D' else ''}")
        decimal = "#" not in shown and whole_of(shown) is not None
        for number, value in enumerate(packed, start=place):
            before = self._bytes.get(number)
            if before is not None:
                raise wrong(self._source, line, f"V{size}{place}", shown, f"each byte once; line {before.line} has it")
            self._bytes[number] = _Byte(value, line, f"V{size}{place}", shown, decimal)
        return place + len(packed)

    def read(self, name: str, address: str, *, real: bool) -> LoadedNumber | None:
        """Return the content of an address, None where there is none.

        Raises:
            InputError: a part of it is missing, or a REAL was typed as a whole number.
        """
        start, size = int(address[2:]), _SIZES[address[1]]
        cells = [self._bytes.get(start + offset) for offset in range(size)]
        there = [cell for cell in cells if cell is not None]
        if not there:
            return None
        self._read.update(range(start, start + size))
        first = there[0]
        if len(there) < size:
            raise wrong(self._source, first.line, name, first.shown, f"all {size} bytes of {address}")
        if real and first.decimal:
            raise wrong(self._source, first.line, name, first.shown, "a REAL with a point, or the CPU holds another")
        content = bytes(cell.value for cell in there)
        code = ">f" if real else {1: ">B", 2: ">h", 4: ">i"}[size]
        return LoadedNumber(first.line, first.shown, struct.unpack(code, content)[0])

    @property
    def rest(self) -> tuple[str, ...]:
        """The entries of which nothing was read."""
        entries = {(byte.line, byte.place): f"{byte.place} {byte.shown} (line {byte.line})"
                   for number, byte in self._bytes.items() if number not in self._read}
        return tuple(entries.values())


def _packed(size: str, shown: str) -> bytes | None:
    """Return a constant's bytes, None where it is none or does not fit."""
    bits = 8 * _SIZES[size]
    whole = whole_of(shown)
    if whole is not None:
        low, high = (0, (1 << bits) - 1) if "#" in shown else _RANGES[size]
        return (whole & (1 << bits) - 1).to_bytes(bits // 8, "big") if low <= whole <= high else None
    real = real_of(shown) if size == "D" else None
    try:
        return None if real is None else struct.pack(">f", real)
    except OverflowError:
        return None


def statements(text: str) -> Iterator[tuple[int, str, list[str]]]:
    """Yield line, operation and operands of each instruction; heads, titles and network lines are left out."""
    for line, content in lines_of(text):
        code = content.partition("//")[0].strip()
        name, _, rest = code.replace("\t", " ").partition(" ")
        if code and not _NO_CODE.fullmatch(name):
            yield line, name.upper(), [part.strip() for part in rest.split(",")]


def loads(text: str, source: str) -> dict[str, list[LoadedNumber]]:
    """Return address → the constants that a program moves there, in its order.

    Raises:
        InputError: what looks like a constant and is none.
    """
    moved: dict[str, list[LoadedNumber]] = {}
    for line, name, operands in statements(text):
        match = _LOAD.fullmatch(name)
        if match is None or len(operands) != 2 or not re.match(r"[+\-.\d]", operands[0]):
            continue
        shown, address = operands
        value = real_of(shown) if match[1] == "R" else whole_of(shown)
        if value is None:
            raise wrong(source, line, address, shown, "a REAL" if match[1] == "R" else "a whole number")
        moved.setdefault(address.upper(), []).append(LoadedNumber(line, shown, value))
    return moved


def difference(text: str, expected: str) -> tuple[str, ...]:
    """Return where a program first differs from the one that is exported with the same constants, if it does."""
    return first_unlike(_shown(text), _shown(expected))


def _shown(text: str) -> list[tuple[int, str]]:
    return [(line, f"{name} {', '.join(operands)}".strip()) for line, name, operands in statements(text)]
