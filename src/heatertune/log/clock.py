"""The column of the time → seconds, and the rows that stay."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from heatertune.errors import LogError
from heatertune.log.cells import Sheet, count, is_number
from heatertune.log.columns import Columns, is_foreign, unit_in_name
from heatertune.log.numbers import Array, numbers, refused
from heatertune.log.stamps import STAMPS, is_day_or_month, stamp

__all__ = ["TIME_UNITS", "kept_rows", "seconds"]

#: unit → its length [s]
TIME_UNITS: Final = {"s": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0}
_EPOCH: Final = 1e8  # beyond three years in seconds the numbers are a calendar's
_EPOCH_MS: Final = 1e11  # beyond the year 5000 in seconds they are not in seconds
_SHOWN: Final = 5  # line numbers told


def seconds(
    sheet: Sheet, columns: Columns, unit: str | None, sample_time_s: float | None, repairs: list[str]
) -> Array:
    """Return the time of each row [s], and add to the repairs what was changed or assumed.

    Raises:
        LogError: no time column and no interval, a cell that is no time, a unit that cannot be known.
    """
    if sample_time_s is not None:
        unused = f"; column {columns.names['time']} not used" if "time" in columns.index else ""
        repairs.append(f"The time was counted in rows of {sample_time_s:g} s{unused}.")
        return np.arange(len(sheet.rows), dtype=np.float64) * sample_time_s
    if "time" not in columns.index:
        expected = "--log-interval with the seconds between two rows, or --time-column"
        raise LogError("the file has no time column", file=sheet.file, expected=expected)
    cells = [row[columns.index["time"]] for row in sheet.rows]
    if stamp(cells[0]) is not None and not is_number(cells[0]):
        repairs.append("Time stamps were turned into seconds from the first row.")
        return _from_stamps(sheet, columns, cells)
    return _from_numbers(sheet, columns, unit, repairs)


def _from_numbers(sheet: Sheet, columns: Columns, unit: str | None, repairs: list[str]) -> Array:
    name = columns.names["time"]
    values = numbers(sheet, columns, "time", f"a number or a time like {STAMPS}")
    named = unit_in_name("time", name)
    if unit is None and named is None and (is_foreign("time", name) or values[0] > _EPOCH_MS):
        raise refused(sheet, columns, "time", 0, "a time in an unknown unit:", "--time-unit s, ms, min or h")
    known = unit or named or "s"
    if known != "s":
        repairs.append(f"The time is in {known} {'as told' if unit else 'by its name'}, turned into seconds.")
    if values[0] * TIME_UNITS[known] > _EPOCH:
        repairs.append("The time is a calendar's and was counted from the first row.")
        values = values - values[0]
    return values * TIME_UNITS[known]


def _from_stamps(sheet: Sheet, columns: Columns, cells: list[str]) -> Array:
    if is_day_or_month(cells):
        raise refused(sheet, columns, "time", 0, "a date that may be day first or month first:",
                      f"{STAMPS}, or --log-interval with the seconds between two rows")
    moments = [stamp(cell) for cell in cells]
    first = moments[0]
    found = np.empty(len(cells))
    for row, moment in enumerate(moments):
        if moment is None or first is None:
            raise refused(sheet, columns, "time", row, "no time:", STAMPS)
        if (moment.tzinfo is None) != (first.tzinfo is None):
            raise refused(sheet, columns, "time", row, "with and without a time zone:", f"all like {cells[0]}")
        found[row] = (moment - first).total_seconds()
    return found


def kept_rows(sheet: Sheet, columns: Columns, time: Array, repairs: list[str]) -> npt.NDArray[np.bool_]:
    """Return which rows stay: of rows with the same time only the first.

    Raises:
        LogError: a time that goes backwards.
    """
    steps = np.diff(time)
    if np.any(steps < 0):
        row = int(np.flatnonzero(steps < 0)[0]) + 1
        before = sheet.rows[row - 1][columns.index["time"]]
        raise refused(sheet, columns, "time", row, "the time goes backwards:", f"not before {before}")
    dropped = np.flatnonzero(steps == 0) + 1
    if len(dropped):
        lines = ", ".join(str(sheet.lines[row]) for row in dropped[:_SHOWN])
        lines += f" and {len(dropped) - _SHOWN} more" if len(dropped) > _SHOWN else ""
        other = sum(sheet.rows[row] != sheet.rows[row - 1] for row in dropped)
        told = f"{count(len(dropped), 'row')} at the time of the row before dropped (line {lines})"
        repairs.append(f"{told}; {other} of them with another reading." if other else f"{told}.")
    kept = np.ones(len(time), dtype=np.bool_)
    kept[dropped] = False
    return kept
