"""A data block as STEP 5 tools print it: `1: KF = +01024;`, one data word (KS, KC: text of several) a line."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Final, NamedTuple

from heatertune.errors import InputError
from heatertune.plc.readback import ReadBack, WordCollector, lines_of, wrong
from heatertune.plc.s5_ob251.image import LENGTH, PLACES, from_cells
from heatertune.plc.s5_ob251.words import FIELDS

__all__ = ["from_text"]

_BLOCK: Final = re.compile(r"DB\s*(\d{1,3})\b(?!.*\bK[A-Z]\s*=).*", re.IGNORECASE | re.ASCII)
_WORD: Final = re.compile(r"(\d{1,3})\s*:\s*(K[A-Z])\s*=\s*(.*)", re.IGNORECASE | re.ASCII)
_END: Final = re.compile(r"(\d{1,3})\s*:", re.ASCII)
#: a second column, as `heatertune.plc.s5_ob251.export` writes it: what is typed then, for automatic
_THEN: Final = re.compile(r"[^;']*;\s+(K[A-Z])\s*=\s*(.*)", re.IGNORECASE)
#: what may stand after a value
_REST: Final = re.compile(r"\s*((;|//).*)?")


def _pair(text: str) -> list[int] | None:
    high, low = (int(part) for part in text.split(","))
    return [256 * high + low] if max(high, low) <= 255 else None


def _timer(text: str) -> list[int] | None:
    count, base = text.split(".")
    return [int(base) << 12 | int(count, 16)]  # three digits in BCD


def _fixed(text: str) -> list[int] | None:
    number = int(text.replace(" ", ""))
    return [number & 0xFFFF] if -32768 <= number <= 32767 else None


def _characters(text: str) -> list[int] | None:
    inner = text[1:-1].encode("latin-1", "replace")
    return [*(high << 8 | low for high, low in zip(inner[::2], inner[1::2], strict=True))] if inner else None


class _Kind(NamedTuple):
    pattern: re.Pattern[str]
    words: Callable[[str], list[int] | None]
    rule: str


_CHARACTERS: Final = _Kind(re.compile(r"'(?:[^']{2})+'"), _characters, "pairs of characters in ' '")
_COUNT: Final = _Kind(re.compile(r"\d{1,3}", re.ASCII), lambda text: [int(text, 16)], "0…999")
#: format → how its constant is written (S5-115U manual, constants of the STEP 5 language)
_KINDS: Final = {
    "KF": _Kind(re.compile(r"[+-]?\s?\d{1,5}", re.ASCII), _fixed, "a whole number -32768…32767"),
    "KH": _Kind(re.compile(r"[0-9A-Fa-f]{4}"), lambda text: [int(text, 16)], "four digits 0…9, A…F"),
    "KM": _Kind(re.compile(r"[01]{8}\s?[01]{8}"), lambda text: [int("".join(text.split()), 2)], "16 bits"),
    "KY": _Kind(re.compile(r"\d{1,3}\s*,\s*\d{1,3}", re.ASCII), _pair, "two bytes 0…255,0…255"),
    "KT": _Kind(re.compile(r"\d{1,3}\.[0-3]", re.ASCII), _timer, "a time 0.0…999.3"),
    "KZ": _COUNT,
    "KS": _CHARACTERS,
}
_FORMATS: Final = f"{', '.join(_KINDS)} or KC"


class _Cell(NamedTuple):
    word: int
    line: int
    shown: str


def from_text(text: str, _sample_time_s: float | None, source: str) -> ReadBack:
    """Return the words in the listing of a data block, whatever format each data word is printed in.

    Where a line holds two constants, as in the listing that is exported, the second one counts: that of automatic.

    Raises:
        InputError: a line that is none of such a listing, a data word that is missing, there twice or out of its range.
    """
    cells: dict[int, _Cell] = {}
    number = None
    for line, content in _lines(text):
        block = _BLOCK.fullmatch(content)
        if block is None:
            _take(content, line, cells, source)
        elif number not in (None, int(block[1])):
            raise wrong(source, line, "block", f"DB{block[1]}", f"the listing of one block, DB{number}")
        else:
            number = int(block[1])
    missing = next((place for place in range(LENGTH) if place not in cells), None)
    if missing is not None:
        raise InputError(f"{source}: DW{missing} is not there; expected DW0 to DW{LENGTH - 1}, the whole data block")
    collected = WordCollector(source, FIELDS)
    for name, value in from_cells([cells[place].word for place in range(LENGTH)]).items():
        cell = cells[PLACES[name]]
        collected.put(name, value, cell.line, cell.shown)
    others = sum(1 for place, cell in cells.items() if place not in PLACES.values() and cell.word)
    return ReadBack(collected.values(), (f"{others} data words besides, which are not 0",) if others else ())


def _lines(text: str) -> Iterator[tuple[int, str]]:
    """Return number and content of the lines that are neither empty nor comments."""
    return ((line, content) for line, content in lines_of(text) if content and not content.startswith(("//", ";")))


def _take(content: str, line: int, cells: dict[int, _Cell], source: str) -> None:
    """Add the data words of a line."""
    match = _WORD.fullmatch(content)
    if match is None:
        end = _END.fullmatch(content)
        if end is None or int(end[1]) != max(cells, default=-1) + 1:
            raise wrong(source, line, "data word", content, "a line such as 1: KF = +01024;")
        return
    place = int(match[1])
    words, shown = _constant(match[2].upper(), match[3], source, line, f"DW{place}")
    then = _THEN.fullmatch(match[3])
    if then is not None:
        words, shown = _constant(then[1].upper(), then[2], source, line, f"DW{place}")
    for offset, word in enumerate(words):
        before = cells.setdefault(place + offset, _Cell(word, line, shown))
        if before.line != line:
            raise wrong(source, line, f"DW{place + offset}", shown, f"each data word once; line {before.line} has it")


def _constant(format_: str, rest: str, source: str, line: int, field: str) -> tuple[list[int], str]:
    """Return the words of a constant and its text; KC is a text in German tools, a count in English ones."""
    kind = _KINDS.get(format_, (_CHARACTERS if rest.startswith("'") else _COUNT) if format_ == "KC" else None)
    if kind is None:
        raise wrong(source, line, field, format_, f"a constant {_FORMATS}")
    match = kind.pattern.match(rest)
    words = None if match is None or not _REST.fullmatch(rest, match.end()) else kind.words(match[0])
    if match is None or words is None:
        raise wrong(source, line, field, rest.partition(";")[0].strip(), f"{format_}, {kind.rule}")
    return words, match[0]
