"""The block's parameters in text: its call in structured text, or a list of parameters, one a line."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Final, NamedTuple

from heatertune.errors import InputError
from heatertune.plc.ramp import Number
from heatertune.plc.readback import Collected, ReadBack, lines_of, real_of, whole_of, wrong
from heatertune.plc.weg.export import RENAMED
from heatertune.plc.weg.program import PROBE
from heatertune.plc.weg.words import FIELDS

__all__ = ["from_text"]

#: of a PLCopen project, whose text is the statements
_TAG: Final = re.compile(r"<[^<>]*>")
_COMMENT: Final = re.compile(r"\(\*.*?(?:\*\)|\Z)|//[^\r\n]*", re.DOTALL)
_CALL: Final = re.compile(r"\b[A-Za-z_]\w*\s*\(((?:[^()]|\([^()]*\))*)\)")
#: statements of the instance that finds out who keeps Ts
_PROBED: Final = re.compile(rf"\b{PROBE}\b[^;]*;")
#: an input that is set before the call
_MEMBER: Final = re.compile(r"\b[A-Za-z_]\w*\.([A-Za-z_]\w*)\s*:=\s*([^;]*?)\s*;")
_NAMED: Final = re.compile(r"([A-Za-z_]\w*)#?\s*:=")
_WIRE: Final = re.compile(r"\s*([A-Za-z_]\w*)#?\s*:=\s*(.*?)\s*", re.DOTALL)
#: name, sign, value and unit of a parameter in a list
_LISTED: Final = re.compile(r"([A-Za-z_]\w*)#?(?:\s*(?::=|[=:;])\s*|\s+)([^\s;]+)\s*;?\s*(1/s|[^\s;\d]\S*)?")
_TYPE: Final = re.compile(r"(?:REAL|BYTE|USINT|UINT|INT)#", re.IGNORECASE)

_ASKED: Final = {field.name.upper(): field for field in FIELDS} | {
    exported.upper(): next(field for field in FIELDS if field.name == name) for name, exported in RENAMED.items()}
#: units in which a list may tell a parameter; without one it is in the block's
_UNITS: Final = {"Kp": "%/°C", "Ki": "1/s", "Kd": "s", "TauSetPoint": "s", "MinimumOutput": "%", "MaximumOutput": "%",
                 "Ts": "ms"}


class _Assigned(NamedTuple):
    line: int
    name: str
    value: str
    unit: str = ""


def from_text(text: str, _sample_time_s: float | None, source: str) -> ReadBack:
    """Return the words in a text, and the inputs of the block that are none.

    Raises:
        InputError: a line of a list that is none, a parameter that is missing, there with two values, no constant of
            its format, in another unit or out of its range; the calls of several blocks.
    """
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    plain = _blanked(_COMMENT, _blanked(_TAG, text) if text.lstrip().startswith("<") else text)
    plain = _blanked(_PROBED, plain)
    calls = [call for call in _CALL.finditer(plain) if any(name.upper() in _ASKED for name in _NAMED.findall(call[1]))]
    if len(calls) > 1:
        lines = " and ".join(str(plain.count("\n", 0, call.start()) + 1) for call in calls[:2])
        raise InputError(f"{source}: the block is called in lines {lines}; expected one call")
    collected, over = Collected(source, FIELDS), []
    assigned = [*_members(plain), *(wire for call in calls for wire in _wires(plain, call, source))]
    for line, name, value, unit in assigned or _listed(plain, source):
        field = _ASKED.get(name.upper())
        if field is None:
            over.append(f"{name} := {value} (line {line})")
            continue
        if unit not in ("", _UNITS.get(field.name, "")):
            raise wrong(source, line, field.name, f"{value} {unit}", f"{field.comment}, no other unit")
        number: Number | None = (real_of if field.format == "REAL" else whole_of)(_TYPE.sub("", value))
        collected.put(field.name, number, line, value)
    return ReadBack(collected.values(), tuple(over))


def _blanked(pattern: re.Pattern[str], text: str) -> str:
    """Return a text with blanks for what a pattern matches, line for line."""
    return pattern.sub(lambda match: re.sub(r"[^\n]", " ", match[0]), text)


def _members(text: str) -> Iterator[_Assigned]:
    """Yield the words that a program sets as members of its block."""
    for match in _MEMBER.finditer(text):
        if match[1].upper() in _ASKED:
            yield _Assigned(text.count("\n", 0, match.start()) + 1, match[1], match[2])


def _wires(text: str, call: re.Match[str], source: str) -> Iterator[_Assigned]:
    """Yield what a call hands its block."""
    line = text.count("\n", 0, call.start(1)) + 1
    for part in call[1].split(","):
        wire, begins = _WIRE.fullmatch(part), line + part[: len(part) - len(part.lstrip())].count("\n")
        if wire is None:
            raise wrong(source, begins, "input", part.strip(), "NAME := VALUE")
        yield _Assigned(begins, wire[1], wire[2])
        line += part.count("\n")


def _listed(text: str, source: str) -> Iterator[_Assigned]:
    for line, content in lines_of(text):
        if not content:
            continue
        match = _LISTED.fullmatch(content)
        if match is None:
            raise wrong(source, line, "parameter", content, "a call of the block, or a line such as Kp = 2.5")
        yield _Assigned(line, match[1], re.sub(r"^(-?\d+),(\d+)$", r"\1.\2", match[2]), match[3] or "")
