"""Read parameters from the text of a programming tool: every line is interpreted, reported as ignored, or refused."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Final, NamedTuple

from heatertune.errors import InputError
from heatertune.plc.ramp import Number
from heatertune.plc.single_precision import single
from heatertune.plc.words import WordField, Words

__all__ = [
    "ReadBack", "WordCollector", "demand_whole_lines", "first_few", "first_unlike", "lines_of", "real_of", "text_of",
    "whole_of", "wrong",
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
