"""What a parser of a format returns, and what several parsers need."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Final, NamedTuple, overload

import numpy as np
import numpy.typing as npt

from heatertune.log.sheet import TextParts

__all__ = ["LINE_STAMP", "BinaryFormat", "FormatTable", "Line", "NumberedLines", "TextFormat", "line_stamp", "matching"]

#: number of a line in the file, and its content
Line = tuple[int, str]
_FEWEST: Final = 2
_SAMPLE: Final = 5000  # lines in which a format has to show itself

#: the time in a line of a log: [10:00:00.123], 2026-03-01 10:00:00,123
_CLOCK: Final = r"\d\d:\d\d:\d\d(?:[.,]\d{1,6})?"
LINE_STAMP: Final = (re.compile(rf"\d{{4}}-\d\d-\d\d[T ]{_CLOCK}"), re.compile(_CLOCK))
_STAMP_WITHIN: Final = 80


class NumberedLines(Sequence[Line]):
    """Lines of a file with their numbers; a pair for each would take ten times the memory.

    Args:
        numbers: of the lines, shape (n,).
        texts: their content.
    """

    def __init__(self, numbers: npt.NDArray[np.int64], texts: TextParts) -> None:
        self.numbers, self.texts = numbers, texts

    def where(self, holds: Callable[[str], bool]) -> NumberedLines:
        """Return the lines whose text fulfils a condition."""
        mask = np.fromiter(map(holds, self.texts), dtype=np.bool_, count=len(self))
        return self if mask.all() else self.at_rows(mask)

    def at_rows(self, places: npt.NDArray[np.bool_]) -> NumberedLines:
        """Return the lines that a mask of shape (n,) keeps."""
        return NumberedLines(self.numbers[places], self.texts.at_rows(places))

    def __len__(self) -> int:
        return len(self.texts)

    def __iter__(self) -> Iterator[Line]:
        return zip(map(int, self.numbers), self.texts, strict=True)

    @overload
    def __getitem__(self, place: int) -> Line: ...

    @overload
    def __getitem__(self, place: slice) -> list[Line]: ...

    def __getitem__(self, place: int | slice) -> Line | list[Line]:
        if isinstance(place, slice):
            return list(zip(self.numbers[place].tolist(), self.texts[place], strict=True))
        return int(self.numbers[place]), self.texts[place]


class FormatTable(NamedTuple):
    """A file as a table.

    Attributes:
        header: column names with their units.
        rows: cells, all of one length.
        lines: line number of each row.
        repairs: how it was read, and skipped content, one sentence each.
        sessions: line number with which each session of the program begins, if there are several.
        session: the session that is read if the user asks for none, 1 = first.
        part: the part of the file that the user asked for by a tag, a sheet of a workbook, if it is no tag of a row.
    """

    header: tuple[str, ...]
    rows: Iterable[list[str]]
    lines: Sequence[int]
    repairs: list[str]
    sessions: tuple[int, ...] = ()
    session: int | None = None
    part: str = ""

    @classmethod
    def from_rows(cls, header: Iterable[str], rows: Sequence[tuple[int, list[str]]], repair: str) -> FormatTable:
        """Return the table of some rows, each with the number of its line."""
        return cls(tuple(header), [cells for _, cells in rows], [number for number, _ in rows], [repair])


class TextFormat(NamedTuple):
    """A format of text files.

    Attributes:
        name: shown to people.
        recognises: whether lines are of this format.
        read: file, lines and the tag that the user asks for → the table.
    """

    name: str
    recognises: Callable[[Sequence[Line]], bool]
    read: Callable[[Path, Sequence[Line], str | None], FormatTable]


class BinaryFormat(NamedTuple):
    """A format of files that are no text.

    Attributes:
        name: shown to people.
        magic: how such files begin.
        read: file, content and the tag that the user asks for → the table.
    """

    name: str
    magic: tuple[bytes, ...]
    read: Callable[[Path, bytes, str | None], FormatTable]


def matching(pattern: re.Pattern[str]) -> Callable[[Sequence[Line]], bool]:
    """Return a test whether at least two of the first lines hold a pattern."""

    def recognises(lines: Sequence[Line]) -> bool:
        hits = 0
        for _, line in lines[:_SAMPLE]:
            hits += pattern.search(line) is not None
            if hits >= _FEWEST:
                return True
        return False

    return recognises


def line_stamp(line: str) -> str:
    """Return the time near the beginning of a line of a log, one with a date before others, or ""."""
    dated, clock = LINE_STAMP
    match = dated.search(line, 0, _STAMP_WITHIN) or clock.search(line, 0, _STAMP_WITHIN)
    return "" if match is None else match[0].replace(",", ".")
