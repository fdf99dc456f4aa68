"""The column of the time → seconds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from heatertune.errors import LogError
from heatertune.log.cells import Sheet, is_number
from heatertune.log.columns import NO_COLUMN, Array, Columns, cell_error, numbers
from heatertune.log.quantities import (
    STAMPS,
    is_clock,
    is_date,
    is_day_or_month,
    is_hours_or_minutes,
    is_scaled,
    month_first,
    role_of,
    stamp,
)

__all__ = ["ASSUMED", "TIME_UNITS", "forwards", "likely_time_unit", "seconds", "with_dates"]

#: ends how a number was written whose unit nothing shows
ASSUMED: Final = ", assumed"

#: unit → its length [s]
TIME_UNITS: Final = {"s": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0, "d": 86400.0}
_EPOCH: Final = 1e8  # beyond three years in seconds the numbers are a calendar's
_THIS_CENTURY: Final = (946_684_800.0, 4_102_444_800.0)  # 2000 to 2100, in seconds since 1970
_LONGEST_STEP_S: Final = 500.0  # of a calendar's seconds: a counter of milliseconds has longer ones after weeks
_EPOCHS: Final = ((1e17, "ns", 1e-9), (1e14, "µs", 1e-6), (1e11, "ms", 1e-3))  # 19, 16 and 13 digits since 1970
_UNEVEN: Final = 0.02
_DAY: Final = 86400.0
_SHEET_DAYS: Final = (20_000.0, 80_000.0)  # days since 1900 as spreadsheets count them: 1954 to 2119


def with_dates(sheet: Sheet, columns: Columns, wanted: str | int | None) -> tuple[Sheet, Columns]:
    """Return the sheet with date and time of day in one column, where they stand in two.

    Args:
        sheet: the cells.
        columns: which column is what.
        wanted: name or number of the column of the date, "none": there is none; None: found where there is one.

    Raises:
        LogError: no such column.
    """
    place = columns.index.get("time")
    if wanted == NO_COLUMN or (wanted is None and (place is None or not is_clock(sheet.rows[0][place]))):
        return sheet, columns
    if place is None or not is_clock(sheet.rows[0][place]):
        raise LogError("no time of day with the date", file=sheet.file, expected="--time-column with a time of day")
    free = [i for i in range(len(sheet.rows[0])) if i not in columns.index.values() and is_date(sheet.rows[0][i])]
    if wanted is not None:
        free = [i for i in free if str(wanted) == str(i + 1) or (sheet.header and sheet.header[i] == wanted)]
        if not free:
            raise LogError("no column of dates", file=sheet.file, value=str(wanted), expected="--date-column NAME or N")
    elif sheet.header:
        free = [i for i in free if role_of(sheet.header[i]) == "time"]
    if len(free) != 1:
        return sheet, columns
    for row in sheet.rows:
        row[place] = f"{row[free[0]]} {row[place]}"
    name = sheet.header[free[0]] if sheet.header else f"{free[0] + 1}"
    note = f"The date in {name!r} and the time of day in {columns.names['time']!r} were put together."
    return sheet, replace(columns, index={**columns.index, "date": free[0]}, names={**columns.names, "date": name},
                          notes=(*columns.notes, note))


def seconds(
    sheet: Sheet, columns: Columns, unit: str | None, sample_time_s: float | None, repairs: list[str]
) -> tuple[Array, str]:
    """Return the time of each row [s], shape (n,), and how it was written: "counted", "stamps" or its unit.

    Args:
        sheet: the cells.
        columns: which column is what.
        unit: of the time column's numbers, a key of `TIME_UNITS`; None: as its name or its digits say, else seconds.
        sample_time_s: interval of a log whose rows are counted [s]; None: the time column is read.
        repairs: what was changed or assumed is added here.

    Raises:
        LogError: no time column and no interval, a cell that is no time, a unit that cannot be known.
    """
    if sample_time_s is not None:
        unused = f"; column {columns.names['time']} not used" if "time" in columns.index else ""
        repairs.append(f"The time was counted in rows of {sample_time_s:g} s{unused}.")
        return np.arange(len(sheet.rows), dtype=np.float64) * sample_time_s, "counted"
    if "time" not in columns.index:
        expected = "--log-interval with the seconds between two rows, or --time-column"
        raise LogError("the file has no time column", file=sheet.file, expected=expected)
    cells = [row[columns.index["time"]] for row in sheet.rows]
    if not is_number(cells[0]) and (stamp(cells[0]) is not None or month_first(cells)):
        if "date" not in columns.index and is_hours_or_minutes(cells[0]):
            raise cell_error(sheet, columns, "time", 0, "a time that may be hours and minutes or minutes and seconds:",
                          f"{STAMPS}, or --log-interval with the seconds between two rows")
        repairs.append("Time stamps were converted to seconds from the first row.")
        return _from_stamps(sheet, columns, cells, repairs), "stamps"
    return _from_numbers(sheet, columns, unit, repairs)


def _from_numbers(sheet: Sheet, columns: Columns, unit: str | None, repairs: list[str]) -> tuple[Array, str]:
    values = numbers(sheet, columns, "time", f"a number or a time like {STAMPS}")
    named = columns.unit("time")
    epoch = next(((name, length) for least, name, length in _EPOCHS if values[0] > least), None)
    if unit is None and named in (None, "ms") and epoch is not None and not columns.is_foreign("time"):
        repairs.append(f"The time is in {epoch[0]} since 1970 by its digits and was counted from the first row.")
        return (values - values[0]) * epoch[1], epoch[0]
    if unit is None and (columns.is_foreign("time") or epoch is not None or _are_days(values, named)):
        raise cell_error(sheet, columns, "time", 0, "a time in an unknown unit:", "--time-unit s, ms, min, h or d")
    time_unit = unit or named or "s"
    if time_unit != "s":
        repairs.append(f"The time is in {time_unit} {'as stated' if unit else 'by its name'} and was converted to "
                       "seconds.")
    assumed = unit is None and not _is_calendar(values) and (named is None or is_scaled("time", columns.names["time"]))
    if assumed and time_unit == "s":
        likely = likely_time_unit(values)
        other = "" if likely == "s" else f"; its interval makes {likely} likelier"
        repairs.append(f"The time has no unit in the file; taken as seconds (otherwise: --time-unit){other}.")
    if values[0] * TIME_UNITS[time_unit] > _EPOCH:
        repairs.append("The time is a calendar's and was counted from the first row.")
        values = values - values[0]
    return values * TIME_UNITS[time_unit], f"{time_unit}{ASSUMED}" if assumed else time_unit


def _is_calendar(values: Array) -> bool:
    """Return whether numbers can only be seconds since 1970."""
    first, last = _THIS_CENTURY
    return len(values) > 1 and first < values[0] < last and float(np.median(np.abs(np.diff(values)))) < _LONGEST_STEP_S


def likely_time_unit(time: Array) -> str:
    """Return the likeliest unit of a time without one, judged by its interval if it were in seconds, shape (n,) [s].

    Loggers write every so many seconds or minutes: 1000 s are milliseconds, and a sixtieth of a second is a minute's.
    """
    usual = float(time[-1] - time[0]) / max(len(time) - 1, 1)
    if usual > _LONGEST_STEP_S / 10.0 and abs(usual / 60.0 - round(usual / 60.0)) > _UNEVEN:
        return "ms"
    in_milliseconds, as_minutes = usual * 1e3, usual * 60.0
    uneven = abs(in_milliseconds - round(in_milliseconds)) > _UNEVEN
    return "min" if usual < 1.0 and uneven and abs(as_minutes - round(as_minutes)) < _UNEVEN else "s"


def _are_days(values: Array, named: str | None) -> bool:
    """Return whether these are a spreadsheet's dates: days since 1900, a small part of a day from row to row."""
    low, high = _SHEET_DAYS
    within = len(values) > 1 and low < values[0] < high and values[-1] < high
    return named is None and within and 0.0 < float(np.median(np.abs(np.diff(values)))) < 0.05


def _from_stamps(sheet: Sheet, columns: Columns, cells: Sequence[str], repairs: list[str]) -> Array:
    if month_first(cells):
        repairs.append("The dates are read with the month first.")
        cells = [month_first((cell,), turn=True) or cell for cell in cells]
    elif is_day_or_month(cells):
        raise cell_error(sheet, columns, "time", 0, "a date that may be day first or month first:",
                      f"{STAMPS}, or --log-interval with the seconds between two rows")
    moments = [stamp(cell) for cell in cells]
    first = moments[0]
    elapsed_s = np.empty(len(cells))
    for row, moment in enumerate(moments):
        if moment is None or first is None:
            raise cell_error(sheet, columns, "time", row, "no time:", STAMPS)
        if (moment.tzinfo is None) != (first.tzinfo is None):
            raise cell_error(sheet, columns, "time", row, "with and without a time zone:", f"all like {cells[0]}")
        elapsed_s[row] = (moment - first).total_seconds()
    return _past_midnight(elapsed_s, repairs) if is_clock(cells[0]) else elapsed_s


def _past_midnight(time: Array, repairs: list[str]) -> Array:
    """Return times of day that go on after midnight."""
    nights = np.flatnonzero(np.diff(time) < -_DAY / 2.0) + 1
    if not len(nights):
        return time
    repairs.append(f"The time of day passes midnight {len(nights)} times; a day was added at each."
                   if len(nights) > 1 else "The time of day passes midnight; a day was added there.")
    time = time.copy()
    for row in nights:
        time[row:] += _DAY
    return time


def forwards(sheet: Sheet, time: Array, repairs: list[str]) -> tuple[Sheet, Array]:
    """Return rows that are written newest first in the order of their times, and these, shape (n,) [s]."""
    steps = np.diff(time)
    if not len(steps) or np.any(steps > 0) or not np.any(steps < 0):
        return sheet, time
    repairs.append("The rows are newest first and were reversed.")
    return sheet.picked(range(len(time) - 1, -1, -1)), time[::-1] - time[-1]
