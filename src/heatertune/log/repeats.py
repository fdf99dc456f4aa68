"""Rows of one instant: repeats are dropped, and rows that are not of one heater are refused."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from heatertune.errors import LogError
from heatertune.log.cells import Sheet, is_number
from heatertune.log.columns import Columns
from heatertune.log.numbers import Array, cell_error
from heatertune.units import count

__all__ = ["kept_rows"]

Rows = npt.NDArray[np.intp]
_SHOWN: Final = 5  # line numbers told
_MOST_LOST: Final = 0.1  # share of the rows that a clock with coarse steps may cost
_MOST_TAGS: Final = 100
_HOUR_S: Final = 3600.0
_TOLD: Final = 0.95  # of the instants a column has to tell apart


def kept_rows(sheet: Sheet, columns: Columns, time: Array, repairs: list[str]) -> tuple[npt.NDArray[np.bool_], int]:
    """Return which rows stay, of rows with the same time only the first, and how many of the others repeat it.

    The times [s] and what stays are of shape (n,), one for each row.

    Raises:
        LogError: a time that goes backwards; many rows of one instant that read otherwise.
    """
    steps = np.diff(time)
    if np.any(steps < 0):
        row = int(np.flatnonzero(steps < 0)[0]) + 1
        before = sheet.rows[row - 1][columns.index["time"]]
        raise cell_error(sheet, columns, "time", row, "the time goes backwards:",
                         f"not before {before}{_put_back(steps)}")
    dropped = np.flatnonzero(steps == 0) + 1
    kept = np.ones(len(time), dtype=np.bool_)
    kept[dropped] = False
    if not len(dropped):
        return kept, 0
    firsts = np.flatnonzero(kept)[np.cumsum(kept)[dropped] - 1]
    other = _otherwise(sheet, columns, dropped, firsts)
    if other:
        _demand_one_heater(sheet, columns, dropped, firsts, other)
    lines = ", ".join(str(sheet.lines[row]) for row in dropped[:_SHOWN])
    lines += f" and {len(dropped) - _SHOWN} more" if len(dropped) > _SHOWN else ""
    note = f"{count(len(dropped), 'row')} at the time of the row before dropped (line {lines})"
    repairs.append(f"{note}; {len(other)} of them with another reading." if other else f"{note}.")
    return kept, len(dropped) - len(other)


def _put_back(steps: Array) -> str:
    """Return what helps where a clock was put back by an hour, once, as at the end of summer time; else nothing."""
    usual = float(np.median(steps))
    if np.count_nonzero(steps < 0) > 1 or not abs(float(steps.min()) + _HOUR_S - usual) <= max(usual, 1.0):
        return ""
    return f"; where the clock was put back by an hour (end of summer time), --log-interval {usual:g} counts the rows"


def _otherwise(sheet: Sheet, columns: Columns, dropped: Rows, firsts: Rows) -> list[int]:
    """Return the rows that read otherwise than the first of their instant."""
    used = [i for role, i in columns.index.items() if role not in ("time", "date")]
    return [row for row, first in zip(dropped, firsts, strict=True)
            if any(sheet.rows[row][i] != sheet.rows[first][i] for i in used)]


def _demand_one_heater(
    sheet: Sheet, columns: Columns, dropped: Rows, firsts: Rows, other: Sequence[int]
) -> None:
    for i in range(len(sheet.rows[0])):
        if i not in columns.index.values() and (tags := _tags(sheet, i, dropped, firsts)):
            name = sheet.header[i] if sheet.header else f"{i + 1}"
            raise LogError(
                f"line {sheet.lines[other[0]]} is of the same instant as the row before, with another reading; column "
                f"{name!r} tells them apart ({', '.join(tags[:_SHOWN])}{', …' if len(tags) > _SHOWN else ''})",
                file=sheet.file, expected=f"--tag {_quoted(tags[0])} --tag-column {_quoted(name)} to read one of them")
    if len(other) > _MOST_LOST * len(sheet.rows):
        problem = f"{len(other)} rows of {len(sheet.rows)} share an instant with another reading, the first:"
        raise cell_error(sheet, columns, "time", other[0], problem,
                      "a finer clock, or --log-interval with the seconds between two rows")


def _tags(sheet: Sheet, i: int, dropped: Rows, firsts: Rows) -> list[str]:
    """Return the few values of a column that differ within each instant; none where it does not tell rows apart."""
    tags = list(dict.fromkeys(row[i] for row in sheet.rows))
    figures = sum(is_number(tag) and not tag.isdigit() for tag in tags)
    if not 2 <= len(tags) <= min(_MOST_TAGS, len(sheet.rows) / 4) or figures:
        return []
    apart = sum(sheet.rows[row][i] != sheet.rows[first][i] for row, first in zip(dropped, firsts, strict=True))
    return tags if apart >= _TOLD * len(dropped) else []


def _quoted(text: str) -> str:
    return f'"{text}"' if " " in text else text
