"""The lines above the readings: titles, the names of the columns, their units."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from heatertune.errors import LogError
from heatertune.log.names import role_of
from heatertune.log.quantities import is_number, is_quantity, says_nothing
from heatertune.log.stamps import stamp
from heatertune.units import count

__all__ = ["take_header"]

_UNIT: Final = re.compile(
    r"[\[(]?(m?s|sec|min|h|°?[CFK]|deg ?[CF]|%|pct|m?V|m?A|k?W|[-–/]|bool|u?s?d?l?int|l?real|float|d?word|string"
    r"|date|time|datetime|double)?[\])]?", re.IGNORECASE)
_SAMPLE: Final = 50  # rows at the end that show what a reading looks like
_MOST_TITLES: Final = 200  # rows above the first reading


def take_header(
    file: Path, lines: list[int], rows: list[list[str]], repairs: list[str]
) -> tuple[tuple[str, ...], int]:
    """Remove all that stands above the readings; return the columns' names with their units, and the lines above them.

    Raises:
        LogError: a row whose cells are not as many as those of the readings.
    """
    width = Counter(len(row) for row in rows[-_SAMPLE:]).most_common(1)[0][0]
    first = _first_reading(rows, width)
    words = [k for k in range(first) if len(rows[k]) == width and _is_words(rows[k])]
    chosen = _names_row(rows, words)
    if chosen is not None:
        begin = next((k for k in range(chosen + 1, first) if k not in words), first)
    else:
        begin = next((k for k in range(first) if not _is_title(rows[k], width)), first)
    names = () if chosen is None else _named(lines, rows, chosen, [k for k in words if k > chosen], repairs)
    titles = begin if chosen is None else chosen
    above = lines[titles - 1] if titles else 0
    if titles:
        repairs.append(f"{count(titles, 'title line')} above the table skipped (up to line {above}).")
    del rows[:begin], lines[:begin]
    _drop_repeats(names, lines, rows, repairs)
    _demand_one_width(file, lines, rows, width)
    return names, above


def _first_reading(rows: Sequence[list[str]], width: int) -> int:
    """Return the first row that looks like those at the end of the file."""
    sample = [row for row in rows[-_SAMPLE:] if len(row) == width]
    values = [i for i in range(width) if sum(_is_value(row[i]) for row in sample) >= 0.5 * len(sample)]
    for k, row in enumerate(rows[:_MOST_TITLES]):
        if len(row) == width and values and all(_is_value(row[i]) or says_nothing(row[i]) for i in values) and any(
            _is_value(row[i]) for i in values
        ):
            return k
    return 0 if any(is_number(cell) for cell in rows[0]) else 1


def _is_value(cell: str) -> bool:
    return is_number(cell) or is_quantity(cell) or stamp(cell) is not None


def _is_words(row: Sequence[str]) -> bool:
    return not any(map(_is_value, row))


def _names_row(rows: Sequence[list[str]], words: Sequence[int]) -> int | None:
    """Return which of the rows of words names the columns: the one that tells most roles, of equals the last."""
    if not words:
        return None
    named = [k for k in words if not _is_units(rows[k]) and sum(map(bool, rows[k])) >= len(rows[k]) / 2]
    named = named or list(words[:1])
    return max(named, key=lambda k: (len({role_of(cell) for cell in rows[k]} - {None}), k))


def _is_units(row: Sequence[str]) -> bool:
    return all(map(_UNIT.fullmatch, row))


def _is_title(row: Sequence[str], width: int) -> bool:
    """Return whether a row above readings without names is none of them: not one cut short, nor too few names."""
    is_reading = len(row) == width or (len(row) > 1 and _is_value(row[0]))
    return not is_reading and not (len(row) > 1 and any(map(role_of, row)))


def _other_width(file: Path, line: int, row: Sequence[str], width: int, like: int) -> LogError:
    expected = f"{width} as in line {like} (a line that is no reading may begin with #)"
    return LogError(f"{count(len(row), 'cell')} in this row", file=file, line=line, expected=expected)


def _named(
    lines: Sequence[int], rows: Sequence[list[str]], chosen: int, below: Sequence[int], repairs: list[str]
) -> tuple[str, ...]:
    """Return the names, with the units of a row below them."""
    names = list(rows[chosen])
    for k in below:
        if any(map(_UNIT.fullmatch, filter(None, rows[k]))):
            repairs.append(f"Line {lines[k]} was read as the units of the columns.")
            units = [unit.strip("[]() ") for unit in rows[k]]
            names = [f"{name} [{unit}]" if unit.strip("-–/") else name for name, unit in zip(names, units, strict=True)]
        else:
            repairs.append(f"Line {lines[k]}, below the names of the columns, skipped.")
    return tuple(names)


def _drop_repeats(names: Sequence[str], lines: list[int], rows: list[list[str]], repairs: list[str]) -> None:
    """Remove rows that repeat the names: the logger began anew."""
    again = [k for k, row in enumerate(rows) if row[0] == names[0] and tuple(row) == tuple(names)] if names else []
    if again:
        repairs.append(f"{count(len(again), 'repeat')} of the header skipped (line {lines[again[0]]}).")
    for k in reversed(again):
        del rows[k], lines[k]


def _demand_one_width(file: Path, lines: Sequence[int], rows: Sequence[list[str]], width: int) -> None:
    like = next((line for line, row in zip(lines, rows, strict=True) if len(row) == width), 0)
    for line, row in zip(lines, rows, strict=True):
        if len(row) != width:
            raise _other_width(file, line, row, width, like)
