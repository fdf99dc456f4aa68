"""Rows of one instant: repeats are dropped, those of a coarse clock spread, those of several heaters refused."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.errors import LogError
from heatertune.log.cells import Sheet, is_number
from heatertune.log.columns import Columns, cell_error
from heatertune.log.unnamed_columns import quoted
from heatertune.units import count

__all__ = ["kept_rows", "spread_instants"]

Rows = npt.NDArray[np.intp]
_SHOWN: Final = 5  # line numbers in messages
_MOST_LOST: Final = 0.1  # share of the rows that a clock with coarse steps may cost
_MOST_TAGS: Final = 100
_HOUR_S: Final = 3600.0
_MOSTLY: Final = 0.9
_FEW_TIMES: Final = 3
_TOLD: Final = 0.95  # of the instants that a column has to distinguish


def kept_rows(sheet: Sheet, columns: Columns, time: Array, repairs: list[str]) -> tuple[npt.NDArray[np.bool_], int]:
    """Return the rows to keep (the first of equal times), and how many of the others repeat the first.

    The times [s] and the result are of shape (n,), one for each row.

    Raises:
        LogError: a time that goes backwards; many rows of one instant with different readings.
    """
    steps = np.diff(time)
    if np.any(steps < 0):
        row = int(np.flatnonzero(steps < 0)[0]) + 1
        before = sheet.rows[row - 1][columns.index["time"]]
        raise cell_error(sheet, columns, "time", row, "the time goes backwards:",
                         f"not before {before}{_put_back_repeats(steps)}")
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


def spread_instants(sheet: Sheet, columns: Columns, time: Array, repairs: list[str]) -> Array:
    """Return times, those of rows of one instant spread up to the next one where a clock is coarser than the interval.

    Each instant then has equally many rows, but for the first and the last, and no column tells them apart. The times
    [s] and the result are of shape (n,).
    """
    steps = np.diff(time)
    begins = np.flatnonzero(np.concatenate([[True], steps != 0.0]))
    counts = np.diff([*begins, len(time)])
    if len(begins) < _LEAST_INSTANTS or np.any(steps < 0) or not _is_even(counts[1:-1], np.diff(time[begins])[1:]):
        return time
    dropped = np.setdiff1d(np.arange(len(time)), begins)
    firsts = begins[np.searchsorted(begins, dropped, side="right") - 1]
    names = range(len(sheet.rows[0]))
    differ = len(_otherwise(sheet, columns, dropped, firsts)) > _MOST_LOST * len(time)
    if not differ or any(_tags(sheet, i, dropped, firsts) for i in names if i not in columns.index.values()):
        return time
    if _zigzags(sheet, columns, dropped):
        return time
    usual = float(np.median(np.diff(time[begins])))
    spread, most = time.copy(), float(np.median(counts[1:-1]))
    for k, (begin, number) in enumerate(zip(begins, counts, strict=True)):
        end = time[begins[k + 1]] if k + 1 < len(begins) else time[begin] + usual
        each = (end - time[begin]) / max(number, most)
        late = (max(most - number, 0.0) if k == 0 else 0.0) * each  # a log begins within an instant
        spread[begin:begin + number] += late + each * np.arange(number)
    repairs.append(f"The clock shows one instant for {most:g} rows; they were spread evenly up to the next one.")
    return spread


_LEAST_INSTANTS: Final = 10
_LARGEST_STEP: Final = 0.05  # of the range


def _zigzags(sheet: Sheet, columns: Columns, later: Rows) -> bool:
    """Return whether the rows of one instant are of several sensors: their readings differ as much as the log's."""
    cells = [row[columns.index["temperature"]] for row in sheet.rows]
    known = np.array([float(cell) if is_number(cell) and "," not in cell else np.nan for cell in cells])
    steps = np.abs(known[later] - known[later - 1])
    return bool(np.nanmedian(steps) > _LARGEST_STEP * (np.nanmax(known) - np.nanmin(known)))


def _is_even(counts: npt.NDArray[np.intp], lengths: Array) -> bool:
    """Return whether each instant has two or more rows, the same number but for one, and lasts as long."""
    if not len(counts) or np.median(counts) < 2 or not len(lengths):
        return False
    usual = float(np.median(counts))
    alike = np.mean(lengths == np.median(lengths)) > _MOSTLY
    return bool(np.all(np.abs(counts - usual) <= 1.0) and alike)


def _put_back_repeats(steps: Array) -> str:
    """Return the remedy where rows may be counted: the clock was set back a few times, otherwise they are even."""
    usual = float(np.median(steps))
    even = np.mean(np.abs(steps - usual) <= 0.5 * usual) > _MOSTLY
    if usual <= 0.0 or not even or np.count_nonzero(steps < 0) > _FEW_TIMES:
        return ""
    hour = abs(float(steps.min()) + _HOUR_S - usual) <= max(usual, 1.0)
    reason = " by an hour (end of summer time)" if hour else ""
    return f"; where the clock was put back{reason}, --log-interval {usual:g} counts the rows"


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
                file=sheet.file, expected=f"--tag {quoted(tags[0])} --tag-column {quoted(name)} to read one of them")
    if len(other) > _MOST_LOST * len(sheet.rows):
        problem = f"{len(other)} rows of {len(sheet.rows)} share an instant with another reading, the first:"
        raise cell_error(sheet, columns, "time", other[0], problem,
                      "a finer clock, or --log-interval with the seconds between two rows")


def _tags(sheet: Sheet, i: int, dropped: Rows, firsts: Rows) -> list[str]:
    """Return the few values of a column that differ within each instant; none if it does not distinguish rows."""
    tags = list(dict.fromkeys(row[i] for row in sheet.rows))
    figures = sum(is_number(tag) and not tag.isdigit() for tag in tags)
    if not 2 <= len(tags) <= min(_MOST_TAGS, len(sheet.rows) / 4) or figures:
        return []
    apart = sum(sheet.rows[row][i] != sheet.rows[first][i] for row, first in zip(dropped, firsts, strict=True))
    return tags if apart >= _TOLD * len(dropped) else []
