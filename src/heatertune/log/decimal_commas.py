"""Join numbers whose decimal commas were taken for separators: 12,5,30,0 is 12.5 and 30.0 under two names."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import accumulate, combinations, pairwise
from pathlib import Path
from typing import Final

import numpy as np

from heatertune.errors import LogError
from heatertune.log.quantities import is_number, is_quantity, role_of, stamp

__all__ = ["join_decimals"]


_WHOLE: Final = re.compile(r"[+-]?\d+|.*:\d\d")
_DIGITS: Final = re.compile(r"\d{1,6}")
_SAMPLE: Final = 400  # rows that are tried
_NEARLY_ALL: Final = 0.98
_CLEARLY: Final = 0.5  # of the roughness of the next best
_MOST_COLUMNS: Final = 12
_MANY: Final = 20  # values


def join_decimals(file: Path, rows: list[list[str]], stated: str | None, repairs: list[str]) -> None:
    """Join the two cells of each number with a decimal comma, in place, where there are more cells than names.

    Args:
        file: for messages.
        rows: of a file that separates its cells by commas, the names among the first.
        stated: columns with decimal commas, by number (1 = first) or name, with commas between them; "none"; None: find
            them.
        repairs: list to which the joining is added.

    Raises:
        LogError: several columns may be those with decimal commas, or one that is stated does not exist.
    """
    width = Counter(map(len, rows[-_SAMPLE:])).most_common(1)[0][0]
    words = [row for row in rows[:_SAMPLE] if 1 < len(row) < width and all(row) and not any(
        is_number(cell) or is_quantity(cell) or stamp(cell) is not None for cell in row)]
    names = max(words, key=lambda row: len({role_of(cell) for cell in row}), default=None)
    if stated is not None:
        columns = () if stated == "none" else _stated(file, stated, names)
    elif names is None:
        _demand_no_fractions(file, [row for row in rows if len(row) == width][-_SAMPLE:])
        return
    elif width > 2 * len(names) or len(names) > _MOST_COLUMNS:
        return
    else:
        columns = _found(file, [row for row in rows if len(row) == width][-_SAMPLE:], len(names), width)
    if not columns:
        return
    _join([row for row in rows if len(row) == width], width - len(columns), columns)
    shown = ", ".join(repr(names[i]) if names else str(i + 1) for i in columns)
    repairs.append(f"The decimal commas of {shown} also separate the cells; each two cells were joined.")


def _demand_no_fractions(file: Path, sample: Sequence[Sequence[str]]) -> None:
    """Refuse cells without names of which one looks like the digits behind a decimal comma: 05, 31, 90.

    Raises:
        LogError: there is one, behind whole numbers.
    """
    for place, (before, cells) in enumerate(pairwise(zip(*sample, strict=True)), start=1):
        is_fraction = len(set(map(len, cells))) == 1 and len(cells[0]) > 1 and len(set(cells)) > _MANY and any(
            cell[0] == "0" for cell in cells)
        if is_fraction and all(map(_DIGITS.fullmatch, cells)) and all(map(_WHOLE.fullmatch, before)):
            raise LogError(f"{cells[-1]!r} in cell {place + 1} looks like decimals behind a comma", file=file,
                           expected=f"--decimal-comma {place} if so (the number of the column, further ones behind "
                                    "commas), or --decimal-comma none")


def _stated(file: Path, stated: str, names: Sequence[str] | None) -> tuple[int, ...]:
    columns = []
    for text in map(str.strip, stated.split(",")):
        if names and text in names:
            columns.append(names.index(text))
        elif text.isdecimal() and int(text) >= 1:
            columns.append(int(text) - 1)
        else:
            raise LogError("no column of decimal commas", file=file, value=text,
                           expected=f"one of {', '.join(names)}" if names else "numbers, 1 = first")
    return tuple(sorted(columns))


def _found(file: Path, sample: Sequence[Sequence[str]], count: int, width: int) -> tuple[int, ...]:
    """Return the columns whose joining makes the smoothest numbers, empty if none makes numbers."""
    rough = {}
    for columns in combinations(range(count), width - count):
        trial = [list(row) for row in sample]
        if _are_decimals(sample, count, columns):
            _join(trial, count, columns)
            rough[columns] = _roughness(trial)
    if not rough:
        return ()
    best, *others = sorted(rough, key=lambda columns: rough[columns])
    if others and rough[best] > _CLEARLY * rough[others[0]]:
        asked = " or ".join("--decimal-comma " + ",".join(str(i + 1) for i in each) for each in (best, *others[:2]))
        raise LogError("commas both separate the cells and mark decimals", file=file,
                       expected=f"{asked}; or a file with semicolons")
    return best


def _places(count: int, columns: Iterable[int]) -> list[int]:
    """Return the place of the first cell of each column."""
    joined = set(columns)
    return list(accumulate((2 if i in joined else 1 for i in range(count - 1)), initial=0))


def _are_decimals(sample: Sequence[Sequence[str]], count: int, columns: Sequence[int]) -> bool:
    """Return whether the cells of the columns are a whole number and digits, always as many."""
    places = _places(count, columns)
    for column in columns:
        place = places[column]
        good = [row for row in sample if _WHOLE.fullmatch(row[place]) and _DIGITS.fullmatch(row[place + 1])]
        if len(good) < _NEARLY_ALL * len(sample) or len({len(row[place + 1]) for row in good}) > 1:
            return False
    return True


def _join(rows: Iterable[list[str]], count: int, columns: Sequence[int]) -> None:
    for row in rows:
        for column, place in reversed(list(zip(range(count), _places(count, columns), strict=True))):
            if column in columns and place + 1 < len(row):
                row[place : place + 2] = [f"{row[place]}.{row[place + 1]}"]


def _roughness(rows: Sequence[Sequence[str]]) -> float:
    """Return how far the numbers of each column jump from row to row, as a fraction of their span, added up."""
    total = 0.0
    for cells in zip(*rows, strict=True):
        try:
            values = np.array(cells, dtype=np.float64)
        except ValueError:
            continue
        total += float(np.mean(np.abs(np.diff(values)))) / max(float(np.ptp(values)), 1e-12)
    return total
