"""STL source of a data block, as STEP 7 generates it from a block: member := value ; between BEGIN and its end."""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Iterator, Sequence
from decimal import Decimal
from itertools import pairwise
from typing import Final, NamedTuple

from heatertune.errors import InputError
from heatertune.plc.cpu.s7_300.program import ANALOG, OWN, PULSEGEN
from heatertune.plc.ramp import Number
from heatertune.plc.readback import ReadBack, WordCollector, first_unlike, lines_of, real_of, whole_of, wrong
from heatertune.plc.words import WordField, Words

__all__ = ["read_source"]

_BLOCK: Final = re.compile(r'DATA_BLOCK\s+("[^"]*"|DB\s*(\d+))\s*', re.IGNORECASE | re.ASCII)
_END: Final = re.compile(r"END_DATA_BLOCK\b\s*;?", re.IGNORECASE)
_TITLE: Final = re.compile(r"TITLE\b", re.IGNORECASE)
_SECTION: Final = re.compile(r"(?:BEGIN|STRUCT|END_STRUCT)\b", re.IGNORECASE)
_HEAD: Final = re.compile(
    r"(?:AUTHOR|FAMILY|NAME|VERSION|KNOW_HOW_PROTECT|READ_ONLY|UNLINKED|NON_RETAIN)(?:\s*:[^=;]*)?|\{[^{}]*\}"
    r"|S?FB\s*\d+|\"[^\"]*\"|[\w.]+\s*:\s*[\w\s\[\].]+", re.IGNORECASE)
#: member := value, as an assignment or with its type as an initial value
_VALUE: Final = re.compile(r'([\w.\[\]"]+)\s*(?::\s*[\w\s\[\].]+)?:=\s*(.+)', re.IGNORECASE)
_LOAD: Final = re.compile(r"(?:\w+\s*:)?\s*L\s+(\S+)\s*", re.IGNORECASE)
_TRANSFER: Final = re.compile(r"T\s+DB\s*(\d+)\s*\.\s*(DB[BWD])\s*(\d+)\s*", re.IGNORECASE | re.ASCII)

_TIME: Final = re.compile(r"(?:TIME|T)#(-?)((?:\d+(?:\.\d+)?(?:D|H|MS|M|S)_?)+)", re.IGNORECASE | re.ASCII)
_PART: Final = re.compile(r"(\d+(?:\.\d+)?)(D|H|MS|M|S)", re.IGNORECASE | re.ASCII)
_MS: Final = {"D": 86_400_000, "H": 3_600_000, "M": 60_000, "S": 1000, "MS": 1}
_LONGEST_TIME: Final = 40

#: who makes the pulses → the statement that calls it
_PULSES: Final = {OWN: "CALL FB 101 , DB 102 (", PULSEGEN: "CALL FB 43 , DB 43 ("}


def _bool(text: str) -> int | None:
    return {"TRUE": 1, "FALSE": 0, "1": 1, "0": 0}.get(text.upper())


def _time(text: str) -> int | None:
    match = _TIME.fullmatch(text) if len(text) <= _LONGEST_TIME else None
    if match is None:
        return None
    parts = [(Decimal(number), _MS[unit.upper()]) for number, unit in _PART.findall(match[2])]
    ms = sum(number * unit for number, unit in parts)
    falling = all(one > two for (_, one), (_, two) in pairwise(parts))
    return int(-ms if match[1] else ms) if falling and not ms % 1 else None


def _real(text: str) -> float | None:
    if text.upper().startswith("DW#16#"):
        bits = whole_of(text[3:])
        return None if bits is None or bits >= 1 << 32 else struct.unpack(">f", struct.pack(">I", bits))[0]
    return real_of(text)


_LITERALS: Final[dict[str, Callable[[str], Number | None]]] = {"BOOL": _bool, "TIME": _time, "REAL": _real}


class _AwlAssignments(NamedTuple):
    line: int
    name: str
    value: str


class _BlockText(NamedTuple):
    line: int
    number: int | None
    members: list[_AwlAssignments]

def read_source(text: str, fields: Sequence[WordField], source: str, export: Callable[[Words, str], str]) -> ReadBack:
    """Return the words in the one data block of a source that has them, and what else it assigns.

    What a statement outside loads into the same block (L …; T DBn.DBDm;) must be the same.
    `export` makes of words, and who makes the pulses (see `switch`), the source that is exported with them.

    Raises:
        InputError: a line of the data block that is none, a word that is missing, there with two values, no literal of
            its format or out of its range; no data block with such words, or several.
    """
    names = {field.name.upper(): field for field in fields}
    blocks = list(_blocks(text, source))
    block = _only(blocks, names, source)
    collected, over = WordCollector(source, fields), [_block_name(other) for other in blocks if other is not block]
    for line, name, value in block.members:
        field = names.get(name.strip('"').upper())
        if field is None:
            over.append(f"{name} := {value} (line {line})")
        else:
            collected.put(field.name, _LITERALS[field.format](value), line, value)
    for line, field, value in _transferred(text, block, fields):
        collected.put(field.name, _LITERALS[field.format](value), line, value)
    return ReadBack(collected.values(), tuple(over), _comparing(text, export) if _program(text) else None)


def _block_name(block: _BlockText) -> str:
    return f"data block{'' if block.number is None else f' DB {block.number}'} (line {block.line})"


def _comparing(text: str, export: Callable[[Words, str], str]) -> Callable[[Words], tuple[str, ...]]:
    program = _program(text)
    statements = {statement for _, statement in program}
    by = next((by for by, call in _PULSES.items() if call in statements), ANALOG)
    return lambda words: first_unlike(program, _program(export(words, by)))


def _program(text: str) -> list[tuple[int, str]]:
    """Return line and content of the statements and declarations that stand in no data block."""
    code, inside = [], False
    for line, content in lines_of(text):
        statement = " ".join(content.partition("//")[0].split())
        inside = inside or _BLOCK.fullmatch(statement) is not None
        if statement and not inside and not _TITLE.match(statement):
            code.append((line, statement))
        inside = inside and not _END.fullmatch(statement)
    return code


def _only(blocks: Sequence[_BlockText], names: dict[str, WordField], source: str) -> _BlockText:
    counts = [sum(member.name.strip('"').upper() in names for member in block.members) for block in blocks]
    # an instance of another block may share a name or two
    with_words = [block for block, count in zip(blocks, counts, strict=True) if count and 2 * count >= max(counts)]
    if not with_words:
        first = next(iter(names.values()))
        raise InputError(f"{source}: no data block with {first.name}; expected DATA_BLOCK … BEGIN … "
                         f"{first.name} := … ; … END_DATA_BLOCK")
    if len(with_words) > 1:
        lines = " and ".join(str(block.line) for block in with_words)
        raise InputError(f"{source}: data blocks of several controllers begin in lines {lines}; expected one")
    return with_words[0]


def _blocks(text: str, source: str) -> Iterator[_BlockText]:
    """Yield the data blocks of a source."""
    block: _BlockText | None = None
    for line, content in lines_of(text):
        code = content.partition("//")[0].strip()
        begins = _BLOCK.fullmatch(code)
        if begins is not None:
            if block is not None:
                raise wrong(source, line, "data block", code, f"END_DATA_BLOCK before it: line {block.line} began one")
            block = _BlockText(line, int(begins[2]) if begins[2] else None, [])
        elif block is not None and _END.fullmatch(code):
            yield block
            block = None
        elif block is not None:
            block.members.extend(_members(code, line, source))
    if block is not None:
        raise InputError(f"{source}: the data block of line {block.line} has no end; expected END_DATA_BLOCK")


def _members(code: str, line: int, source: str) -> Iterator[_AwlAssignments]:
    """Yield the assignments of a line of a data block."""
    if _TITLE.match(code):
        return
    section = _SECTION.match(code)
    *ended, rest = (part.strip() for part in code[section.end() if section else 0 :].split(";"))
    for part in ended:
        match = _VALUE.fullmatch(part)
        if match is not None:
            yield _AwlAssignments(line, match[1], match[2].strip())
        elif part and not _HEAD.fullmatch(part):
            raise wrong(source, line, "member", part, "NAME := VALUE ;")
    if rest and not _HEAD.fullmatch(rest):
        raise wrong(source, line, "member", rest, "NAME := VALUE ;")


def _transferred(text: str, block: _BlockText, fields: Sequence[WordField]) -> Iterator[tuple[int, WordField, str]]:
    """Yield what statements of the source load into words of the block."""
    places = {field.address.upper(): field for field in fields}
    loaded: str | None = None
    for line, content in lines_of(text):
        for code in content.partition("//")[0].split(";"):
            load, transfer = _LOAD.fullmatch(code.strip()), _TRANSFER.fullmatch(code.strip())
            if load is not None:
                loaded = load[1]
            elif transfer is not None and loaded is not None and int(transfer[1]) == block.number:
                field = places.get(f"{transfer[2]}{transfer[3]}".upper())
                if field is not None:
                    yield line, field, loaded
            elif code.strip():
                loaded = None
