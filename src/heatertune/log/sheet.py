"""The cells of a file by columns, in few bytes.

A column holds each of its different texts once, or one text with the places of its cells. Rows of another width than
most (titles, names, a row that was cut) stand aside until it is known which are readings.
"""

from __future__ import annotations

import re
import string
from array import array
from bisect import bisect_left
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, islice
from operator import ne
from typing import Any, Final, TypeVar, overload

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array

__all__ = ["CellColumn", "Grid", "Sheet", "TextParts", "drain", "line_breaks"]

Mask = npt.NDArray[np.bool_]
Rows = npt.NDArray[np.intp]
Row = TypeVar("Row")

_AT_ONCE: Final = 4096  # rows
_SEARCHED: Final = 1 << 16  # characters
_MOST_KINDS: Final = 1 << 16
_FEW_KINDS: Final = 0.5  # of the rows: more different texts are held one after the other


class TextParts(Sequence[str]):
    """Parts of one text by their places, so that none needs an object of its own.

    Args:
        text: the whole.
        begins: of each part, shape (n,).
        ends: of each part, shape (n,).
    """

    def __init__(self, text: str, begins: npt.NDArray[np.integer], ends: npt.NDArray[np.integer]) -> None:
        kind = np.uint32 if len(text) < 1 << 32 else np.int64
        self.text = text
        self._begins: npt.NDArray[np.integer] = begins.astype(kind, copy=False)
        self._ends: npt.NDArray[np.integer] = ends.astype(kind, copy=False)

    def at_rows(self, places: Rows | Mask | slice) -> TextParts:
        """Return some of the parts, in the order given."""
        return TextParts(self.text, self._begins[places], self._ends[places])

    def __len__(self) -> int:
        return len(self._ends)

    def __iter__(self) -> Iterator[str]:
        return chain.from_iterable(self._some(slice(k, k + _AT_ONCE)) for k in range(0, len(self), _AT_ONCE))

    def _some(self, part: slice) -> list[str]:
        begins, ends, text = self._begins[part], self._ends[part], self.text
        if np.all(begins[1:] == ends[:-1] + 1):  # one after the other: at once, unless a part has an end of line itself
            parts = text[begins[0]:ends[-1]].split("\n")
            if len(parts) == len(begins):
                return parts
        return [text[first:last] for first, last in zip(begins.tolist(), ends.tolist(), strict=True)]

    def longest(self) -> int:
        """Return the number of characters of the longest part, 0 if there is none."""
        return int(np.max(self._ends - self._begins, initial=0))

    def has_text(self) -> Mask:
        """Return which parts are not empty, shape (n,)."""
        return self._ends > self._begins

    @overload
    def __getitem__(self, place: int) -> str: ...

    @overload
    def __getitem__(self, place: slice) -> list[str]: ...

    def __getitem__(self, place: int | slice) -> str | list[str]:
        if isinstance(place, slice):
            return list(self.at_rows(place))
        return self.text[self._begins[place]:self._ends[place]]


class CellColumn(Sequence[str]):
    """The cells of one column.

    Args:
        texts: its texts; where several cells are alike, each once.
        codes: the text of each cell, shape (n,); None: they are its texts, one after the other.
    """

    def __init__(self, texts: Sequence[str], codes: npt.NDArray[np.integer] | None = None) -> None:
        self._texts, self._codes = texts, codes

    @classmethod
    def of(cls, cells: Iterable[str]) -> CellColumn:
        """Return the column of some cells."""
        writer, cells = _Writer(), iter(cells)
        while part := list(islice(cells, _AT_ONCE)):
            writer.add(part)
        return writer.column()

    def at_rows(self, places: Rows | Mask | slice) -> CellColumn:
        """Return the cells of some rows, in the order given."""
        if self._codes is not None:
            return CellColumn(self._texts, self._codes[places])
        return CellColumn(self._texts.at_rows(places)) if isinstance(self._texts, TextParts) else CellColumn.of(
            np.array(self._texts, dtype=object)[places])

    def kinds(self) -> Iterable[str]:
        """Return the texts of the cells, those of a column of few each once."""
        return self._texts if self._codes is None else [self._texts[k] for k in self._used()]

    def levels(self) -> int:
        """Return how many different texts there are."""
        if self._codes is None:
            return len(np.unique(np.fromiter(map(hash, self._texts), dtype=np.int64, count=len(self))))
        return len(self._used())

    def differs(self) -> Mask:
        """Return which cells differ from the one before, shape (n,)."""
        if self._codes is None:
            return np.fromiter(chain([False], map(ne, self, islice(self, 1, None))), dtype=np.bool_, count=len(self))
        first: dict[str, int] = {}
        codes = np.array([first.setdefault(text, k) for k, text in enumerate(self._texts)], dtype=np.intp)[self._codes]
        return np.append(np.zeros(len(codes[:1]), dtype=np.bool_), codes[1:] != codes[:-1])

    def where(self, holds: Callable[[str], bool]) -> Mask:
        """Return the cells that fulfil a condition, shape (n,)."""
        return self._values_of(holds, np.bool_)

    def numbers(self, value: Callable[[str], float]) -> Array:
        """Return a number for each cell, shape (n,).

        Raises:
            ValueError: as `value`.
        """
        return self._values_of(value, np.float64)

    def floats(self) -> Array | None:
        """Return the numbers that Python reads in the cells, shape (n,); None if a cell holds none."""
        if self.holds("_"):  # Python reads 1_000, a log does not
            return None
        try:
            return self._values_of(float, np.float64)
        except ValueError:
            return None

    def holds(self, mark: str) -> bool:
        """Return whether a cell holds a character."""
        return not (isinstance(self._texts, TextParts) and mark not in self._texts.text) and any(
            mark in cell for cell in self.kinds())

    def matches(self, mark: re.Pattern[str]) -> bool:
        """Return whether a mark occurs in a cell."""
        text = self._texts.text if isinstance(self._texts, TextParts) else "\n".join(self.kinds())
        return mark.search(text) is not None

    def has_text(self) -> Mask:
        """Return which cells are not empty, shape (n,)."""
        return self._texts.has_text() if isinstance(self._texts, TextParts) else self.where(bool)

    def map(self, change: Callable[[str], str]) -> CellColumn:
        """Return the column with each text changed."""
        if self._codes is None:
            return CellColumn.of(map(change, self._texts))
        used = {k: change(self._texts[k]) for k in self._used()}
        return CellColumn([used.get(k, "") for k in range(len(self._texts))], self._codes)

    def _used(self) -> list[int]:
        assert self._codes is not None
        return np.flatnonzero(np.bincount(self._codes, minlength=1)).tolist()

    def _values_of(self, value: Callable[[str], object], kind: type[np.bool_ | np.float64]) -> npt.NDArray[Any]:
        if self._codes is None:
            return np.fromiter(map(value, self._texts), dtype=kind, count=len(self))
        used = self._used()
        table: npt.NDArray[Any] = np.zeros(len(self._texts), dtype=kind)
        table[used] = [value(self._texts[k]) for k in used]
        return np.asarray(table[self._codes])

    def __len__(self) -> int:
        return len(self._texts if self._codes is None else self._codes)

    def __iter__(self) -> Iterator[str]:
        if self._codes is None:
            return iter(self._texts)
        parts = (self._codes[k:k + _AT_ONCE].tolist() for k in range(0, len(self._codes), _AT_ONCE))
        return map(self._texts.__getitem__, chain.from_iterable(parts))

    @overload
    def __getitem__(self, place: int) -> str: ...

    @overload
    def __getitem__(self, place: slice) -> list[str]: ...

    def __getitem__(self, place: int | slice) -> str | list[str]:
        if isinstance(place, slice):
            return list(self.at_rows(place))
        return self._texts[place if self._codes is None else self._codes[place]]


class _Writer:
    """The cells of a column as they are added."""

    def __init__(self) -> None:
        self._kinds: dict[str, int] | None = {}
        self._codes, self._lengths, self._parts = array("H"), array("I"), list[str]()

    def add(self, cells: Sequence[str]) -> None:
        kinds = self._kinds
        if kinds is not None:
            codes = [kinds.setdefault(cell, len(kinds)) for cell in cells]
            if len(kinds) <= max(_AT_ONCE // 4, min(_FEW_KINDS * (len(self._codes) + len(codes)), _MOST_KINDS - 1)):
                self._codes.extend(codes)
                return
            texts, before = list(kinds), self._codes
            self._kinds, self._codes = None, array("H")
            for k in range(0, len(before), _AT_ONCE):
                self.add([texts[code] for code in before[k:k + _AT_ONCE]])
        text = "\n".join(cells)
        ends = np.append(line_breaks(text), len(text))
        if len(ends) != len(cells):  # a cell has a line break itself
            ends = np.cumsum([len(cell) + 1 for cell in cells]) - 1
        self._lengths.frombytes((np.diff(ends, prepend=-1) - 1).astype(np.uint32).tobytes())
        self._parts.append(text)

    def column(self) -> CellColumn:
        if self._kinds is not None:
            narrow = len(self._kinds) <= 1 << 8
            return CellColumn(list(self._kinds), np.array(self._codes, dtype=np.uint8 if narrow else np.uint16))
        ends = np.cumsum(np.frombuffer(self._lengths, dtype=np.uint32) + 1, dtype=np.int64)
        return CellColumn(TextParts("\n".join(self._parts), np.concatenate([[0], ends[:-1]]), ends - 1))


def line_breaks(text: str) -> Rows:
    """Return the places of the line breaks in a text, shape (n,)."""
    kind = np.uint32 if len(text) < 1 << 32 else np.int64
    return np.concatenate([(np.flatnonzero(np.frombuffer(
        text[k:k + _SEARCHED].encode("utf-32-le", "surrogatepass"), dtype="<u4") == ord("\n")) + k).astype(kind)
        for k in range(0, len(text) + 1, _SEARCHED)])


def _stripped(cells: Sequence[str]) -> Sequence[str]:
    """Return cells without the white space around them."""
    text = "".join(cells)
    plain = text.isascii() and not any(mark in text for mark in string.whitespace + "\x1c\x1d\x1e\x1f")
    return cells if plain else list(map(str.strip, cells))


def drain(rows: list[Row]) -> Iterator[Row]:
    """Yield all of a list, and leave it empty: what was yielded need not be held."""
    rows.reverse()
    while rows:
        yield rows.pop()


class Grid(Sequence[list[str]]):
    """Rows of cells, by columns if they are as wide as most.

    Args:
        rows: cells, at least one in each row.
        width: number of cells of most rows.
    """

    def __init__(self, rows: Iterable[list[str]], width: int) -> None:
        writers = [_Writer() for _ in range(width)]
        self.aside: dict[int, list[str]] = {}
        self._number, rows = 0, iter(rows)
        while part := list(islice(rows, _AT_ONCE)):
            wide = [row for row in part if len(row) == width]
            if len(wide) < len(part):
                self.aside |= {k: list(map(str.strip, row)) for k, row in enumerate(part, start=self._number)
                               if len(row) != width}
            for writer, cells in zip(writers, zip(*wide, strict=True), strict=bool(wide)):
                writer.add(_stripped(cells))
            self._number += len(part)
        self.columns = [writer.column() for writer in writers]
        self._places = sorted(self.aside)

    @classmethod
    def of_columns(cls, columns: Sequence[CellColumn]) -> Grid:
        """Return the rows of columns of one length."""
        grid = cls((), 0)
        grid.columns, grid._number = [*columns], max(map(len, columns), default=0)
        return grid

    @property
    def width(self) -> int:
        """Number of cells of most rows."""
        return len(self.columns)

    def change(self, change: Callable[[str], str], mark: re.Pattern[str]) -> None:
        """Change the text of each cell, in the columns in which a mark occurs."""
        self.columns = [column.map(change) if column.matches(mark) else column for column in self.columns]
        self.aside = {k: list(map(change, row)) for k, row in self.aside.items()}

    def cut(self, width: int) -> None:
        """Remove the cells beyond a width."""
        self.columns = self.columns[:width]
        self.aside = {k: row[:width] for k, row in self.aside.items()}

    def join(self, width: int, pairs: Iterable[int]) -> None:
        """Join the cells at some places with the next ones by a decimal point, in rows of a width."""
        for place in sorted(pairs, reverse=True):
            if width == self.width and place + 1 < width:
                both = zip(self.columns[place], self.columns[place + 1], strict=True)
                self.columns[place:place + 2] = [CellColumn.of(map(".".join, both))]
            for row in self.aside.values():
                if len(row) == width and place + 1 < width:
                    row[place:place + 2] = [f"{row[place]}.{row[place + 1]}"]
            width -= 1

    def find(self, row: Sequence[str]) -> list[int]:
        """Return the rows with these cells."""
        row_numbers = [k for k, cells in self.aside.items() if cells == list(row)]
        if len(row) == self.width:
            alike = np.flatnonzero(self.columns[0].where(row[0].__eq__))
            row_numbers += [k for k in self._usual()[alike].tolist() if self[k] == list(row)]
        return sorted(row_numbers)

    def whole(self) -> Mask:
        """Return the rows that are as wide as most, shape (n,)."""
        mask = np.ones(len(self), dtype=np.bool_)
        mask[[k for k, row in self.aside.items() if len(row) != self.width]] = False
        return mask

    def at_rows(self, wanted: Mask) -> tuple[CellColumn, ...]:
        """Return the columns of some rows, of which all are as wide as most."""
        usual = self._usual()
        aside = [k for k in self._places if wanted[k]]
        if not aside:
            return tuple(column.at_rows(wanted[usual]) for column in self.columns)
        places = np.concatenate([usual[wanted[usual]], aside])
        order = np.argsort(places, kind="stable")
        return tuple(
            CellColumn.of(chain(column.at_rows(wanted[usual]), (self.aside[k][i] for k in aside))).at_rows(order)
            for i, column in enumerate(self.columns))

    def _usual(self) -> Rows:
        return np.delete(np.arange(self._number), self._places)

    def __len__(self) -> int:
        return self._number

    @overload
    def __getitem__(self, place: int) -> list[str]: ...

    @overload
    def __getitem__(self, place: slice) -> list[list[str]]: ...

    def __getitem__(self, place: int | slice) -> list[str] | list[list[str]]:
        if isinstance(place, slice):
            return [self[k] for k in range(*place.indices(self._number))]
        place += self._number if place < 0 else 0
        if not 0 <= place < self._number:
            raise IndexError(place)
        if place in self.aside:
            return self.aside[place]
        place -= bisect_left(self._places, place)
        return [column[place] for column in self.columns]


@dataclass(frozen=True, slots=True, kw_only=True)
class Sheet:
    """Cells of one file.

    Attributes:
        file: its path.
        header: column names with their units, empty if the file has none.
        comment: cells of the comment directly above the readings, one for each column, or empty.
        columns: cells, all columns of one length.
        lines: line number of each row, 1 = first line of the file, shape (n,).
        repairs: changes and skipped content, one sentence each.
        units: common unit of the cells of each column, or empty.
        above: lines above the column names, or above the readings of unnamed columns.
        pwm_period_s: PWM period stated in a recording, 0 if unknown [s].
        recorded: whether `heatertune record` wrote it; its rows are readings even if the value did not change.
        lost: number of rows that were left out as damaged or not whole.
        part: part of the file that the user asked for by a tag: a sheet of a workbook.
        sessions: line number with which each session of a program begins, if there are several.
        session: the session that is read if the user asks for none, 1 = first.
        other_file: a second file, of whose rows `lines` has the line number below 0.
        power_lines: line number of each row's power where it comes from another row or file, shape (n,).
        power_every_s: interval of a power that the second file samples, 0 if it holds its changes [s].
    """

    file: str
    header: tuple[str, ...]
    comment: tuple[str, ...]
    columns: tuple[CellColumn, ...]
    lines: npt.NDArray[np.int64]
    repairs: tuple[str, ...]
    units: tuple[str, ...] = ()
    above: int = 0
    pwm_period_s: float = 0.0
    recorded: bool = False
    lost: int = 0
    part: str = ""
    sessions: tuple[int, ...] = ()
    session: int | None = None
    other_file: str = ""
    power_lines: npt.NDArray[np.int64] | None = None
    power_every_s: float = 0.0

    def __len__(self) -> int:
        return len(self.lines)

    def line_name(self, place: int, role: str = "") -> str:
        """Return the line number of a row, or of its power, for messages: with its file if that is the other one."""
        file, line = self.origin(place, role)
        return f"{line}" if file == self.file else f"{line} of {file}"

    def origin(self, place: int, role: str = "") -> tuple[str, int]:
        """Return file and line number of a row, or of its power."""
        own = role == "power" and self.power_lines is not None and self.power_lines[place]
        line = int(own or self.lines[place])
        return self.other_file if line < 0 else self.file, abs(line)

    def row(self, place: int) -> list[str]:
        """Return the cells of a row."""
        return [column[place] for column in self.columns]

    def names(self) -> tuple[str, ...]:
        """Return the names of the columns, numbers if the file has none."""
        return self.header or tuple(f"{i + 1}" for i in range(len(self.columns)))

    def at_rows(self, places: Rows | Mask | slice) -> Sheet:
        """Return some of the rows, in the order given."""
        return replace(self, columns=tuple(column.at_rows(places) for column in self.columns), lines=self.lines[places],
                       power_lines=None if self.power_lines is None else self.power_lines[places])

    def with_column(self, i: int, cells: Iterable[str]) -> Sheet:
        """Return the sheet with other cells of a column."""
        column = cells if isinstance(cells, CellColumn) else CellColumn.of(cells)
        return replace(self, columns=(*self.columns[:i], column, *self.columns[i + 1:]))
