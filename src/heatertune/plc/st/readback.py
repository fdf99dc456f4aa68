"""A block's parameters in text: its call in structured text, or a list of parameters, one a line."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from decimal import Decimal
from types import MappingProxyType
from typing import Final, NamedTuple

from heatertune.errors import InputError
from heatertune.plc.ramp import Number
from heatertune.plc.readback import ReadBack, WordCollector, lines_of, real_of, whole_of, wrong
from heatertune.plc.words import WordField

__all__ = ["ExpectedBlock", "words_in"]

#: of a PLCopen project, whose text is the statements
_TAG: Final = re.compile(r"<[^<>]*>")
_COMMENT: Final = re.compile(r"\(\*.*?(?:\*\)|\Z)|//[^\r\n]*", re.DOTALL)
_CALL: Final = re.compile(r"\b[A-Za-z_]\w*\s*\(((?:[^()]|\([^()]*\))*)\)")
#: a block's own text, in structured text and in a PLCopen project
_TEXT_OF: Final = re.compile(r'\bFUNCTION_BLOCK\s+(\w+)|<pou\s+name="(\w+)"\s+pouType="functionBlock"')
#: an input that is set before the call
_MEMBER: Final = re.compile(r"\b[A-Za-z_]\w*\.([A-Za-z_]\w*)\s*:=\s*([^;]*?)\s*;")
_NAMED: Final = re.compile(r"([A-Za-z_]\w*)#?\s*:=")
_WIRE: Final = re.compile(r"\s*([A-Za-z_]\w*)#?\s*:=\s*(.*?)\s*", re.DOTALL)
#: name, sign, value and unit of a parameter in a list
_LISTED: Final = re.compile(r"([A-Za-z_]\w*)#?(?:\s*(?::=|[=:;])\s*|\s+)([^\s;]+)\s*;?\s*(1/s|[^\s;\d]\S*)?")
_DURATION: Final = re.compile(
    r"(?:T|TIME)#(?:(\d+(?:\.\d+)?)d)?(?:(\d+(?:\.\d+)?)h)?(?:(\d+(?:\.\d+)?)m)?(?:(\d+(?:\.\d+)?)s)?"
    r"(?:(\d+(?:\.\d+)?)ms)?", re.IGNORECASE)
#: in a day, hour, minute, second and millisecond
_MS: Final = (86_400_000, 3_600_000, 60_000, 1000, 1)
_TYPE: Final = re.compile(r"(?:REAL|BYTE|USINT|UINT|INT)#", re.IGNORECASE)


class ExpectedBlock(NamedTuple):
    """What is asked of a text.

    Attributes:
        fields: the words.
        units: field → the unit in which a list may tell it; without one it is in the block's.
        renamed: input of the block → the field that it is, where they have not one name.
        beside: instance of the block that is called beside the controller's and whose statements tell nothing.
    """

    fields: tuple[WordField, ...]
    units: Mapping[str, str]
    renamed: Mapping[str, str] = MappingProxyType({})
    neighbour: str = ""

    def fields_by_name(self) -> dict[str, WordField]:
        """Return name in capitals → field."""
        fields = {field.name: field for field in self.fields}
        return {name.upper(): field for name, field in fields.items()} | {
            other.upper(): fields[name] for other, name in self.renamed.items()}


class _StAssignments(NamedTuple):
    line: int
    name: str
    value: str
    unit: str = ""


def words_in(text: str, source: str, block: ExpectedBlock) -> ReadBack:
    """Return the words in a text, and what else stands there: inputs of the block that are none, the program around.

    Raises:
        InputError: a line of a list that is none, a parameter that is missing, there with two values, no constant of
            its format, in another unit or out of its range; the calls of several blocks.
    """
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    plain = _blanked(_COMMENT, _blanked(_TAG, text) if text.lstrip().startswith("<") else text)
    if block.neighbour:
        plain = _blanked(re.compile(rf"\b{block.neighbour}\b[^;]*;"), plain)
    fields = block.fields_by_name()
    calls = [call for call in _CALL.finditer(plain) if any(name.upper() in fields for name in _NAMED.findall(call[1]))]
    if len(calls) > 1:
        lines = " and ".join(str(plain.count("\n", 0, call.start()) + 1) for call in calls[:2])
        raise InputError(f"{source}: the block is called in lines {lines}; expected one call")
    collected, over = WordCollector(source, block.fields), []
    assigned = [*_members(plain, fields), *(wire for call in calls for wire in _wires(plain, call, source))]
    for line, name, value, unit in assigned or _listed(plain, source):
        field = fields.get(name.upper())
        if field is None:
            over.append(f"{name} := {value} (line {line})")
            continue
        if unit not in ("", block.units.get(field.name, "")):
            raise wrong(source, line, field.name, f"{value} {unit}", f"{field.comment}, no other unit")
        number = _number(field, value)
        collected.put(field.name, number, line, value)
    return ReadBack(collected.values(), (*over, *(_around(text, plain, fields) if calls else ())))


def _around(text: str, plain: str, fields: Mapping[str, WordField]) -> Iterator[str]:
    """Yield what a program holds beside the one call of the block and what is set for it: nothing of it is compared."""
    for match in _TEXT_OF.finditer(_blanked(_COMMENT, text)):
        yield f"FUNCTION_BLOCK {match[1] or match[2]} (line {text.count(chr(10), 0, match.start()) + 1})"
    rest = _blanked(_CALL, plain)
    members = sum(match[1].upper() in fields for match in _MEMBER.finditer(rest))
    if rest.count(":=") > members:
        yield "the program around the call: when it is called, what else switches the heater"


def _number(field: WordField, text: str) -> Number | None:
    """Return a constant as its field has it; None: it is none of that format."""
    if field.format == "TIME":
        return _ms(text)
    return (real_of if field.format == "REAL" else whole_of)(_TYPE.sub("", text))


def _ms(text: str) -> Number | None:
    """Return a duration in ms, as a literal of the language (T#1s500ms) or a whole number."""
    literal = _DURATION.fullmatch(text.replace("_", ""))
    if literal is None:
        return whole_of(text)
    parts = [Decimal(part or 0) * ms for part, ms in zip(literal.groups(), _MS, strict=True)]
    return int(sum(parts)) if any(literal.groups()) and sum(parts) == int(sum(parts)) else None


def _blanked(pattern: re.Pattern[str], text: str) -> str:
    """Return a text with blanks for what a pattern matches, line for line."""
    return pattern.sub(lambda match: re.sub(r"[^\n]", " ", match[0]), text)


def _members(text: str, fields: Mapping[str, WordField]) -> Iterator[_StAssignments]:
    """Yield the words that a program sets as members of its block."""
    for match in _MEMBER.finditer(text):
        if match[1].upper() in fields:
            yield _StAssignments(text.count("\n", 0, match.start()) + 1, match[1], match[2])


def _wires(text: str, call: re.Match[str], source: str) -> Iterator[_StAssignments]:
    """Yield what a call hands its block."""
    line = text.count("\n", 0, call.start(1)) + 1
    for part in call[1].split(","):
        wire, begins = _WIRE.fullmatch(part), line + part[: len(part) - len(part.lstrip())].count("\n")
        if wire is None:
            raise wrong(source, begins, "input", part.strip(), "NAME := VALUE")
        yield _StAssignments(begins, wire[1], wire[2])
        line += part.count("\n")


def _listed(text: str, source: str) -> Iterator[_StAssignments]:
    for line, content in lines_of(text):
        if not content:
            continue
        match = _LISTED.fullmatch(content)
        if match is None:
            raise wrong(source, line, "parameter", content, "a call of the block, or a line such as Kp = 2.5")
        yield _StAssignments(line, match[1], re.sub(r"^(-?\d+),(\d+)$", r"\1.\2", match[2]), match[3] or "")
