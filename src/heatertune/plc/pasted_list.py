"""Parameters as people quote them, in a thread or from a screen: names and values with units, one or several a line."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Final, NamedTuple

from heatertune.errors import InputError
from heatertune.plc.ramp import Number
from heatertune.plc.readback import WordCollector, demand_whole_lines, first_few, lines_of, wrong
from heatertune.plc.single_precision import single
from heatertune.plc.words import WordField

__all__ = ["PastedNames", "PastedWord", "pasted_words", "put_pasted", "unread_lines"]

#: unit of a time → seconds
_SECONDS: Final = {
    **dict.fromkeys(("ms", "msec", "millis", "milliseconds"), 0.001),
    **dict.fromkeys(("s", "sec", "secs", "second", "seconds", "sek", "sekunden"), 1.0),
    **dict.fromkeys(("min", "mins", "minute", "minutes", "minuten"), 60.0),
    **dict.fromkeys(("h", "hr", "hour", "hours", "stunden", "std"), 3600.0),
}
#: units of anything else, which change nothing
_PLAIN_UNITS: Final = frozenset(("%", "%/°c", "%/k", "%/degc", "1"))
#: words after a value that are no unit
_WORDS: Final = frozenset(("and", "und", "et", "y", "e", "with", "mit"))
_TRUTH: Final = {"TRUE": 1, "FALSE": 0, "ON": 1, "OFF": 0, "1": 1, "0": 0, "YES": 1, "NO": 0}
_ENDLESS: Final = frozenset(("INF", "INFINITE", "INFINITY", "3.4E38", "3.4E+38"))

_GAP: Final = re.compile(r"[\s_-]+")
_BETWEEN: Final = re.compile(
    r"[\s\"']*(?:[(\[]\s*(?P<unit>[^)\]]*?)\s*[)\]])?"
    r"(?:[\s=:|\"']|->|\b(?:is|to|of|auf|ist|REAL|BOOL|TIME|INT|Floating[-_ ]point(?: number)?)\b"
    r"|\b(?:VD|DBD|MD)\s?\d+(?!\w))*",
    re.IGNORECASE)
_VALUE: Final = re.compile(
    r"(?P<number>[-+]?(?:(?!0\d)\d+(?:[.,]\d+)?|\.\d+)(?:e[-+]?\d+)?)(?![\w.,]*\d)|(?P<word>[A-Za-z_#][\w#.]*)",
    re.IGNORECASE)
_DURATION: Final = re.compile(
    r"(?:T|TIME|S5T)#(?:(\d+)d_?)?(?:(\d+)h_?)?(?:(\d+)m(?!s)_?)?(?:(\d+(?:\.\d+)?)s_?)?(?:(\d+)ms)?", re.IGNORECASE)
_PARTS_S: Final = (86400.0, 3600.0, 60.0, 1.0, 0.001)
_UNIT: Final = re.compile(r"\s*([^\s\d,;.)(\[\]]+)?")
#: what begins a parameter of another name
_NEXT: Final = re.compile(r"[,;]\s*[^\W\d]|\b[^\W\d]\w*\s*:?=")
#: a comma that may part thousands
_THOUSANDS: Final = re.compile(r"[-+]?[1-9]\d{0,2},\d{3}")


#: what no list holds, but a program; and names by which a block is known → the block
_PROGRAM: Final = re.compile(
    r"(?:DATA_BLOCK|END_\w+|ORGANIZATION_BLOCK|FUNCTION\w*|PROGRAM|NETWORK|TITLE|VAR\w*|SUBROUTINE_BLOCK|LD|import|def)\b"
    r"(?!\s*[:=])|[<#]|.*(?:\{|\bPID\s*\()", re.IGNORECASE)
_MARKS: Final = {name: re.compile(marks, re.IGNORECASE) for name, marks in (
    ("CONT_C", r"\b(?:PVPER_ON|PV_PER|TM_LAG|LMN_\w+|CONT_C|S?FB\s?41)\b"),
    ("PID_Compact or PID_Temp", r"CtrlParams|\b(?:TdFiltRatio|PID_Compact|PID_Temp)"),
    ("the S7-200's PID", r"\bPID\d+_|^\s*VD\s?\d+\b"),
    ("Marlin", r"\bM30[1-4]\b|DEFAULT_|PID_FUNCTIONAL_RANGE"), ("Klipper", r"\bpid_K[pid]\b"),
)}


class PastedNames(NamedTuple):
    """What to look for.

    Attributes:
        fields: the parameters.
        names: other names of them, in any case → name of the field.
        seconds: name of a field that is a time → the unit of its word [s].
        unitless: names of times that need no unit: what a screen shows of them has none.
        block: whose they are, one of `_MARKS`.
    """

    fields: tuple[WordField, ...]
    names: Mapping[str, str]
    seconds: Mapping[str, float]
    unitless: frozenset[str] = frozenset()
    block: str = ""

    def pattern(self) -> tuple[re.Pattern[str], dict[str, str]]:
        """Return what finds a name, and each in small letters → its field."""
        by_name = {field.name.lower(): field.name for field in self.fields} | {
            " ".join(name.lower().split()): field for name, field in self.names.items()}
        longest = sorted(by_name, key=len, reverse=True)
        either = "|".join(re.escape(name).replace(r"\ ", _GAP.pattern) for name in longest)
        return re.compile(rf"(?<![\w#])(?:PID\d+_)?({either})(?!\w)", re.IGNORECASE), by_name


class PastedWord(NamedTuple):
    """One parameter of a text.

    Attributes:
        line: its number.
        name: of the field.
        value: None: a variable, or nothing.
        shown: as the text has it.
        has_unit: whether the text says the unit of a time.
    """

    line: int
    name: str
    value: float | None
    shown: str
    has_unit: bool = True


def pasted_words(lines: Iterable[tuple[int, str]], vocabulary: PastedNames, source: str) -> Iterator[PastedWord]:
    """Yield the parameters in lines; prose that names one without a number is passed over.

    Raises:
        InputError: a value that is none, has another unit, or may be two numbers.
    """
    pattern, by_name = vocabulary.pattern()
    fields = {field.name: field for field in vocabulary.fields}
    for line, content in lines:
        found = list(pattern.finditer(content))
        for number, match in enumerate(found):
            ends = found[number + 1].start() if number + 1 < len(found) else len(content)
            written = match[1].lower()
            name = by_name[written] if written in by_name else by_name[_GAP.sub(" ", written)]
            word = _word(fields[name], content[match.end():ends], line, vocabulary, source)
            if word is not None:
                yield word


def _word(field: WordField, rest: str, line: int, vocabulary: PastedNames, source: str) -> PastedWord | None:
    """Return the value that follows a name; None: there is none."""
    between = _BETWEEN.match(rest)
    assert between is not None
    tail = rest[between.end():]
    is_assigned = bool(re.search(r"[=:]", between[0]))
    value, unit_s = _VALUE.match(tail), vocabulary.seconds.get(field.name)
    spelled = {**(_TRUTH if field.format == "BOOL" else {}), **dict.fromkeys(_ENDLESS if unit_s is not None else ())}
    is_value = bool(re.search(r"\d", tail)) or (value is not None and (value["word"] or "").upper() in spelled)
    if not tail.strip(" ;,.") or not (is_assigned or is_value):
        return None
    if value is None:
        raise wrong(source, line, field.name, rest.strip()[:40], _expected(field, unit_s))
    if value["word"]:
        return _named_value(field, value["word"], line, unit_s, source)
    after = _UNIT.match(tail, value.end())
    assert after is not None
    is_prose = (after[1] or "").lower() in _WORDS
    left = tail[value.end() if is_prose else after.end():]
    unclear = re.search(r"\d", _NEXT.split(left, maxsplit=1)[0]) or re.match(r"[,;]\s*(?:ms|s|sec|min)\b", left)
    if unclear or _THOUSANDS.fullmatch(value["number"]):
        raise wrong(source, line, field.name, rest.strip()[:40], "one number, its fraction after a point")
    unit = ((None if is_prose else after[1]) or between["unit"] or "").lower()
    return _with_unit(field, value["number"], unit, line, vocabulary, source)


def _with_unit(
    field: WordField, text: str, unit: str, line: int, vocabulary: PastedNames, source: str,
) -> PastedWord:
    """Return a number in the unit of its word."""
    number, shown, unit_s = float(text.replace(",", ".")), f"{text} {unit}".strip(), vocabulary.seconds.get(field.name)
    if unit_s is None:
        if field.format != "BOOL" and unit not in _PLAIN_UNITS | {""}:
            raise wrong(source, line, field.name, shown, f"{field.comment}, no other unit")
        return PastedWord(line, field.name, number, shown)
    if unit not in _SECONDS if unit else field.name not in vocabulary.unitless:
        raise wrong(source, line, field.name, shown, _expected(field, unit_s))
    return PastedWord(line, field.name, number * (_SECONDS[unit] / unit_s if unit else 1.0), shown, bool(unit))


def _named_value(field: WordField, text: str, line: int, unit_s: float | None, source: str) -> PastedWord:
    """Return TRUE or FALSE, a duration, infinity, or a variable, whose value is unknown."""
    upper = text.upper().rstrip(".")
    if field.format == "BOOL":
        return PastedWord(line, field.name, _TRUTH.get(upper), text)
    parts = _DURATION.fullmatch(text)
    if unit_s is not None and parts is not None and any(parts.groups()):
        total = sum(float(part or 0) * each for part, each in zip(parts.groups(), _PARTS_S, strict=True))
        return PastedWord(line, field.name, total / unit_s, text)
    if unit_s is not None and upper in _ENDLESS:
        return PastedWord(line, field.name, float("inf"), text)
    raise wrong(source, line, field.name, text, _expected(field, unit_s))


def _expected(field: WordField, unit_s: float | None) -> str:
    time = "a time with its unit, such as 20 s or 1.5 min"
    return f"{'a number' if unit_s is None else time}: {field.comment}"


def put_pasted(
    collected: WordCollector, text: str, vocabulary: PastedNames, needed: Mapping[str, str], source: str,
) -> list[PastedWord]:
    """Store the parameters in a text as their words hold them, and return them; of a variable nothing is stored.

    Args:
        collected: where they are stored.
        text: without comments.
        vocabulary: what to look for.
        needed: parameter without which nothing is known of the loop → a line that would tell it.
        source: name for error messages.

    Raises:
        InputError: as `pasted_words`; a value out of its range, one with a fraction that has none, two values of one,
            or a needed one that is missing.
    """
    demand_whole_lines(text, source)
    for line, content in lines_of(text):
        _demand_list(content, line, vocabulary.block, source)
    by_name = {field.name: field for field in vocabulary.fields}
    words = list(pasted_words(lines_of(text), vocabulary, source))
    for word in words:
        if word.value is not None:
            collected.put(word.name, _rounded(by_name[word.name], word.value), word.line, word.shown)
    if missing := [name for name in needed if name not in collected]:
        lines = " and ".join(needed[name] for name in missing)
        raise InputError(f"{source}: no {' and '.join(missing)}; expected such as: {lines}")
    return words


def _demand_list(content: str, line: int, block: str, source: str) -> None:
    """Refuse a line of a program, or of another block, whose parameters have the same names."""
    other = next((mark for name, mark in _MARKS.items() if name != block and mark.search(content)), None)
    if other is not None or _PROGRAM.match(content):
        raise wrong(source, line, "list", content[:40], f"names and values of {block}, one a line")


def _rounded(field: WordField, value: float) -> Number | None:
    if field.format == "REAL":
        return field.high if math.isinf(value) and math.isinf(single(2.0 * field.high)) else single(value)
    whole = round(value, 6)
    return int(whole) if math.isfinite(whole) and whole == int(whole) else None


def unread_lines(text: str, vocabulary: PastedNames) -> tuple[str, ...]:
    """Return the lines that name no parameter, the first three and how many there are besides."""
    pattern, _ = vocabulary.pattern()
    return first_few([f"{content[:40]} (line {line})" for line, content in lines_of(text)
                      if content and not pattern.search(content)])
