"""Read parameters from the text of a programming tool: every line is interpreted, reported as ignored, or refused.

Parameters as people quote them, in a thread or from a screen: names and values with units, one or several a line.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Final, NamedTuple

from heatertune.errors import InputError
from heatertune.plc.ramp import Number
from heatertune.plc.single_precision import single
from heatertune.plc.words import WordField, Words

__all__ = [
    "PastedNames", "PastedWord", "ReadBack", "WordCollector", "demand_whole_lines", "first_few", "first_unlike",
    "lines_of", "pasted_words", "put_pasted", "real_of", "text_of", "unread_lines", "whole_of", "wrong",
]


#: control characters that a text may hold: tab, line and form feeds, the end mark of CP/M and DOS
_IN_TEXT: Final = frozenset(b"\t\n\r\f\x1a")
#: a line that goes on with the number at the end of the one before
_REST: Final = re.compile(r"[.,]?\d[\d.,]*(?:e[-+]?\d+)?(?:\s*[^\d\s]{0,4}|[;,)\s].*)")
#: of what is not looked at, in a log of many lines
_FEW: Final = 3
_UTF_16: Final = (b"\xff\xfe", b"\xfe\xff")

_UNLIKE: Final = "the program around the parameters differs from the exported one"


class ReadBack(NamedTuple):
    """The parameters in a text.

    Attributes:
        values: word name → number.
        passed_over: other content that was not compared, a few words each.
        unlike: for a text with the program around the parameters: words → first difference from the exported program,
            empty if there is none; None: the text contains no program.
        assumed: what the text does not say and was filled in, a phrase such as "PID_K1 = 0.95" each.
    """

    values: dict[str, Number]
    passed_over: tuple[str, ...] = ()
    unlike: Callable[[Words], tuple[str, ...]] | None = None
    assumed: tuple[str, ...] = ()


def text_of(content: bytes) -> str | None:
    """Decode the text in a file, None if it is not text; other encodings than UTF-8 are read as Windows-1252."""
    if content[:2] in _UTF_16:
        wide = content.decode("utf-16", errors="replace")
        return wide if all(sign >= " " or ord(sign) in _IN_TEXT for sign in wide) else None
    if not content or any(byte < 0x20 and byte not in _IN_TEXT for byte in content):
        return None
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("cp1252", errors="replace")


def lines_of(text: str) -> Iterator[tuple[int, str]]:
    """Yield number, from 1 on, and stripped content of each line; form feeds are removed."""
    broken = text.replace("\r\n", "\n").replace("\r", "\n").translate({0x0C: None, 0x1A: None})
    for number, line in enumerate(broken.split("\n"), start=1):
        yield number, line.strip()


def demand_whole_lines(text: str, source: str) -> None:
    """Refuse a text in which a line ends within a number: the next one goes on with digits alone.

    Raises:
        InputError: it does.
    """
    before = ""
    for line, content in lines_of(text):
        if _REST.fullmatch(content) and before[-1:].isdigit():
            raise wrong(source, line, "number", content, f"it in the line before: {before[-30:]}…")
        before = content


def first_few(lines: Sequence[str]) -> tuple[str, ...]:
    """Return the first lines of many, and how many there are besides."""
    more = len(lines) - _FEW
    return (*lines[:_FEW], *([f"{more} more lines"] if more > 0 else []))


def first_unlike(read: Sequence[tuple[int, str]], ours: Sequence[tuple[int, str]]) -> tuple[str, ...]:
    """Return the first difference of a program, by lines and statements, from heatertune's, if any."""
    for (line, code), (_, own) in zip(read, ours, strict=False):
        if code != own:
            return (f"{_UNLIKE} (line {line}: {code}, not {own})",)
    return () if len(read) == len(ours) else (f"{_UNLIKE} ({len(read)} statements, not {len(ours)})",)


def wrong(source: str, line: int, field: str, value: str, expected: str) -> InputError:
    """Return the error of one line.

    Args:
        source: the file.
        line: its number.
        field: what the line is about.
        value: the value found.
        expected: the expected content.
    """
    return InputError(f"{source}, line {line}, {field}: {value!r}; expected {expected}")


def whole_of(text: str) -> int | None:
    """Return a decimal integer, or one as 16#…, 8#… or 2#…; None if it is not an integer."""
    base, mark, digits = text.partition("#")
    try:
        if not mark:
            return int(text) if text.lstrip("+-").isdigit() and text.isascii() else None
        return int(digits.replace("_", ""), int(base)) if base in ("2", "8", "16") and digits[:1].isalnum() else None
    except ValueError:
        return None


def real_of(text: str) -> float | None:
    """Return a number as a REAL, None if it is not a number."""
    plain = text.replace("_", "") if text[:1] not in ("_", "") else ""
    if not plain.isascii() or set(plain.upper()) - set("0123456789+-.E"):
        return None
    try:
        return single(float(plain))
    except ValueError:
        return None


class WordCollector:
    """The parameters of a text, collected line by line.

    Args:
        source: name for error messages.
        fields: the required parameters.
    """

    def __init__(self, source: str, fields: Sequence[WordField]) -> None:
        self._source, self._fields = source, {field.name: field for field in fields}
        self._values: dict[str, Number] = {}
        self._before: dict[str, str] = {}

    def __contains__(self, name: str) -> bool:
        return name in self._values

    def get(self, name: str) -> Number | None:
        """Return a parameter, None where the text has not stated it."""
        return self._values.get(name)

    def put(self, name: str, value: Number | None, line: int, shown: str) -> None:
        """Store a parameter.

        Raises:
            InputError: it is None, out of range, or occurs twice with different values.
        """
        field = self._fields[name]
        if value is None or not field.takes(value):
            raise wrong(self._source, line, name, shown, f"{field.format}, {field.rule}")
        if self._values.setdefault(name, value) != value:
            raise wrong(self._source, line, name, shown, self._before[name])
        self._before.setdefault(name, f"{shown}, as in line {line}")

    def assume(self, defaults: Mapping[str, Number], without: Mapping[str, Sequence[str]] = MappingProxyType({})
               ) -> tuple[str, ...]:
        """Fill in the parameters that the text leaves out; return them, see `ReadBack.assumed`.

        Args:
            defaults: parameter → its value.
            without: parameter that may be 0 → those that then change nothing and are not returned.
        """
        names = [name for name in defaults if name not in self._values]
        self._values |= {name: defaults[name] for name in names}
        idle = {name for switch, its in without.items() if not self._values.get(switch) for name in its}
        return tuple(f"{name} = {defaults[name]:.6g}" for name in names if name not in idle)

    def values(self) -> dict[str, Number]:
        """Return all words.

        Raises:
            InputError: one is missing.
        """
        missing = [field for name, field in self._fields.items() if name not in self._values]
        if missing:
            first = missing[0]
            place = "" if first.address == first.name else f" ({first.address})"
            more = f"; also missing: {', '.join(field.name for field in missing[1:])}" if len(missing) > 1 else ""
            raise InputError(f"{self._source}: {first.name}{place} is missing{more}; expected {first.comment}, "
                             f"{first.rule}")
        return {name: self._values[name] for name in self._fields}


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
#: the unit of a number, in a table the cell after it
_UNIT: Final = re.compile(r"\s*(?:\|\s*)?([^\s\d,;.)(\[\]|]+)?")
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
        matches = list(pattern.finditer(content))
        for number, match in enumerate(matches):
            ends = matches[number + 1].start() if number + 1 < len(matches) else len(content)
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
