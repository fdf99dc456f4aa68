"""The columns of a log: their roles, and their cells as seconds, °C and percent of full power.

A role comes from the column's name, from its numbers if it has no name, or from the user. An error names the first
cell that is not a number.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import accumulate
from typing import Final

import numpy as np

from heatertune.arrays import Array
from heatertune.errors import LogError
from heatertune.log.log_values import EXPLICIT, LogSignal
from heatertune.log.quantities import (
    ROLES,
    demand_one_unit,
    is_foreign,
    is_heated,
    is_in_celsius,
    is_number,
    is_quantity,
    is_scaled,
    is_second_choice,
    is_switch_word,
    role_of,
    says_nothing,
    signal_rank,
    unit_in_name,
)
from heatertune.log.sheet import CellColumn, Sheet
from heatertune.log.side_columns import (
    add_side_columns,
    demand_no_likely_power,
    demand_own_temperature,
    is_cooling,
    is_fan,
    is_measured,
    quoted,
)
from heatertune.log.timestamps import (
    LONGEST_STEP_S,
    NO_ORDER,
    STAMPS,
    TIME_UNITS,
    clocks_in_digits,
    day_first,
    durations_s,
    is_clock,
    is_date,
    is_date_in_digits,
    is_hours_or_minutes,
    likely_time_unit,
    month_first,
    order_of_dates,
    past_hour,
    past_midnight,
    stamp,
    unlike_part,
    within_hours,
)

__all__ = ["CLOCK_UNITS", "NO_COLUMN", "Columns", "cell_error", "choose_column", "demand_one_form", "find_columns",
           "forwards", "numbers", "seconds", "with_clock_parts", "with_dates", "with_names"]


#: option value if a log has no such column
NO_COLUMN: Final = "none"


@dataclass(frozen=True, slots=True, kw_only=True)
class Columns:
    """Role → index of its column.

    Attributes:
        index: role → index.
        names: role → name, a number where the file has no names.
        notes: assumptions about the columns.
        units: role → unit of the cells in the column.
    """

    index: Mapping[str, int]
    names: Mapping[str, str]
    notes: tuple[str, ...] = field(default=())
    units: Mapping[str, str] = field(default_factory=dict)

    def unit(self, role: str) -> str | None:
        """Return the unit stated in the cells or the name, None if neither states one; for power its full scale."""
        borne, alike = self.units.get(role), {"cooling": "power", "ambient": "temperature"}.get(role, role)
        return unit_in_name(alike, f"[{borne}]") if borne else unit_in_name(alike, self.names[role])

    def is_foreign(self, role: str) -> bool:
        """Return whether the column has a unit that its role does not have: power in watts, a PV in percent."""
        borne = self.units.get(role)
        return unit_in_name(role, f"[{borne}]") is None if borne else is_foreign(role, self.names[role])


def with_names(sheet: Sheet) -> Sheet:
    """Return the sheet, its header taken from the comment above the readings where that names a temperature."""
    if sheet.header or "temperature" not in map(role_of, sheet.comment):
        return sheet
    note = "The comment above the readings was read as the names of the columns."
    return replace(sheet, header=sheet.comment, repairs=(*sheet.repairs, note))


def find_columns(sheet: Sheet, wanted: Mapping[str, str | int], *, counted: bool = False,
                 stated: Collection[str] = ()) -> Columns:
    """Return the columns of time, temperature, power and setpoint.

    Args:
        sheet: the cells.
        wanted: role → column name or number (1 = first) given by the user.
        counted: whether the time is counted in rows, so that no column needs to be found for it.
        stated: roles whose unit the user states, whatever name and cells say.

    Raises:
        LogError: a column that does not exist or is requested twice, or no temperature column.
    """
    absent = {role for role, column in wanted.items() if str(column) == NO_COLUMN and column not in sheet.header}
    index = {role: choose_column(sheet, role, column) for role, column in wanted.items() if role not in absent}
    if len(set(index.values())) < len(index):
        raise LogError(f"one column for two of {', '.join(index)}", file=sheet.file, expected="a column for each")
    notes: list[str] = []
    if sheet.header:
        _by_name(sheet, index, absent, notes)
        add_side_columns(sheet, index, absent, notes)
    else:
        _by_numbers(sheet, index, absent | ({"time"} if counted else set()), notes)
    if sheet.header and "temperature" in index and "temperature" not in wanted:
        demand_own_temperature(sheet, index)
    if "temperature" not in index:
        listed = ", ".join(sheet.header) or f"{len(sheet.columns)} columns without names"
        raise LogError(f"no column is a temperature ({listed})", file=sheet.file,
                       expected="--temperature-column NAME or N" + (
                           "" if "power" in {*index, *absent} else " and --power-column NAME or N, or none"))
    if not {"power"} & {*index, *absent}:
        demand_no_likely_power(sheet, index)
    names = {role: sheet.names()[i] for role, i in index.items()}
    units = {role: sheet.units[i] for role, i in index.items() if sheet.units and sheet.units[i]}
    for role in [role for role in units if role not in stated]:
        demand_one_unit(sheet.file, role, names[role] if sheet.header else "", units[role])
    return Columns(index=index, names=names, notes=tuple(notes), units=units)


def choose_column(sheet: Sheet, role: str, column: str | int) -> int:
    """Return the column of a name or number (1 = first).

    Raises:
        LogError: there is no such column.
    """
    text = str(column).strip()
    if text in sheet.header:
        return sheet.header.index(text)
    plain = [i for i, name in enumerate(sheet.header) if name.rpartition(" [")[0] == text]
    if len(plain) == 1:  # the unit was put behind the name
        return plain[0]
    width = len(sheet.columns)
    if text.isdecimal() and 1 <= int(text) <= width:
        return int(text) - 1
    listed = ", ".join(sheet.header) or f"1…{width}"
    raise LogError(f"no {role} column", file=sheet.file, value=text, expected=f"one of {listed}")


def _by_name(sheet: Sheet, index: dict[str, int], absent: set[str], notes: list[str]) -> None:
    picks = set(index.values())
    by_role: dict[str, list[int]] = {role: [] for role in ROLES if role not in absent}
    roles = list(map(role_of, sheet.header))
    for i, role in enumerate(roles):
        if role in by_role and i not in picks and not _is_text(sheet, role, i, several=roles.count(role) > 1):
            by_role[role].append(i)
    if not by_role.get("time", True) and "time" not in index and (clock := _clock_by_content(sheet, picks)) is not None:
        by_role["time"] = [clock]
    if not by_role.get("temperature", True) and "temperature" not in index:
        degrees = [i for i, name in enumerate(sheet.header) if i not in picks and is_in_celsius(name)]
        by_role["temperature"] = degrees if len(degrees) == 1 else []
    by_role.get("temperature", []).extend(_heated(sheet, by_role, index) or _input_of_sketch(sheet, by_role))
    for role, candidates in by_role.items():
        if role in index or not candidates:
            continue
        heats = [i for i in candidates if role != "power" or not (
            is_cooling(sheet.header[i]) or is_fan(sheet.header[i]))]
        order = {i: (len(candidates) > 1 and role in _MOVING and _stands(sheet.columns[i]),
                     _is_second(role, sheet.header[i]), role == "power" and signal_rank(sheet.header[i]))
                 for i in heats or candidates}
        best, *others = sorted(order, key=lambda i: order[i])
        _demand_two_names(sheet, role, [best, *(i for i in others if order[i] == order[best])])
        index[role] = best
        if others:
            unused = ", ".join(sheet.header[i] for i in others)
            notes.append(f"{sheet.header[best]!r} was taken as the {role}; {unused} not used.")


def _heated(sheet: Sheet, by_role: Mapping[str, Sequence[int]], index: Mapping[str, int]) -> list[int]:
    """Return the only measured column without a role, named for what is heated, next to a power and no temperature."""
    powered = "power" in index or by_role.get("power")
    if not powered or not all(is_second_choice(sheet.header[i]) for i in by_role.get("temperature", ())):
        return []
    free = [i for i, name in enumerate(sheet.header) if i not in index.values() and role_of(name) is None
            and is_measured(sheet.columns[i])]
    return free if len(free) == 1 and is_heated(sheet.header[free[0]]) else []


def _input_of_sketch(sheet: Sheet, by_role: Mapping[str, Sequence[int]]) -> list[int]:
    """Return the column of the Input, as Arduino's PID library calls the reading, next to its Setpoint and Output."""
    names = [name.lower() for name in sheet.header]
    alone = not by_role.get("temperature") and {"input", "output", "setpoint"} <= {*names}
    return [names.index("input")] if alone else []


_MOVING: Final = ("temperature", "power")


def _demand_two_names(sheet: Sheet, role: str, candidates: Sequence[int]) -> None:
    """Refuse to take the first of several columns of one name for temperature or power where they hold different cells.

    Raises:
        LogError: there are such columns.
    """
    name = sheet.header[candidates[0]]
    alike = [i for i in candidates if sheet.header[i] == name]
    if role in _MOVING and any(list(sheet.columns[i]) != list(sheet.columns[alike[0]]) for i in alike[1:]):
        options = " or ".join(f"--{role}-column {i + 1}" for i in alike)
        raise LogError(f"{len(alike)} columns of one name, with different cells", file=sheet.file, column=name,
                       expected=options)


def _stands(cells: CellColumn) -> bool:
    """Return whether a column holds one value throughout: a sensor that is not connected, a heater that is off."""
    return all(cell == cells[0] for cell in cells.kinds())


def _is_text(sheet: Sheet, role: str, i: int, *, several: bool) -> bool:
    """Return whether a column contradicts its name: words in "control mode", numbers in "data" (Portuguese: date).

    `several`: names of this role.
    """
    cell = sheet.columns[i][0]
    if role == "time":
        return is_second_choice(sheet.header[i]) and is_number(cell) and not _is_sheet_day(cell)
    return (role == "power" and not any(fits(cell) for fits in (is_number, says_nothing, is_switch_word))
            and (several or is_second_choice(sheet.header[i])))


def _is_sheet_day(cell: str) -> bool:
    """Return whether a number may be a date as spreadsheets count them."""
    low, high = _SHEET_DAYS
    return low < float(cell.replace(",", ".")) < high


def _clock_by_content(sheet: Sheet, taken: set[int]) -> int | None:
    """Return the first column whose cells are all times, whatever its name: with a date, otherwise times of day."""
    clocks = []
    for i, column in enumerate(sheet.columns):
        some = [*column[:_SAMPLE], *column[-_SAMPLE:-1]]
        if i not in taken and not is_number(some[0]) and sum(
                stamp(cell) is not None and not is_date(cell) for cell in some) > _NEARLY_ALL * len(some):
            clocks.append(i)
    return min(clocks, key=lambda i: (is_clock(sheet.columns[i][0]), i), default=None)


_SAMPLE: Final = 20  # rows looked at at each end
_NEARLY_ALL: Final = 0.9


def _is_second(role: str, name: str) -> bool:
    """Return whether a column has its role only where no other has: a room's temperature, a power in watts."""
    return is_second_choice(name) or (role in ("temperature", "power") and is_foreign(role, name))


_DEGREES: Final = re.compile(r"(°|deg|º) ?[CF]|℃|℉", re.IGNORECASE)
_PERCENT: Final = re.compile("%|pct", re.IGNORECASE)


def _by_numbers(sheet: Sheet, index: dict[str, int], absent: set[str], notes: list[str]) -> None:
    """Deduce roles: the always increasing column is the time; of two others, the constant one is the power."""
    free = [i for i in range(len(sheet.columns)) if i not in index.values()]
    if "time" not in index and "time" not in absent:
        growing = sorted((i for i in free if _grows(sheet, i)), key=lambda i: is_number(sheet.columns[i][0]))
        if growing:
            clock = index["time"] = _growing_clock(sheet, growing, free)
            free = [i for i in free if i != clock and not (i in growing and _steps(sheet, i, 0.0) and (
                i < clock or not is_number(sheet.columns[clock][0])))]
    for role, sign in (("temperature", _DEGREES), ("power", _PERCENT)):
        signed = [i for i in free if sheet.units and sign.fullmatch(sheet.units[i])]
        if role not in index and role not in absent and len(signed) == 1:
            index[role] = signed[0]
            free.remove(signed[0])
    levels = {i: sheet.columns[i].levels() for i in free}
    if "temperature" not in index and len(free) == 1 and levels[free[0]] > _SWITCHED:
        index["temperature"] = free[0]
    elif "temperature" not in index and len(free) == 2 and not {"power"} & {*index, *absent}:
        constant, moving = sorted(free, key=lambda i: levels[i])
        if levels[constant] * 4 < levels[moving]:
            index |= {"power": constant, "temperature": moving}
    places = ", ".join(f"{role} = column {i + 1}" for role, i in sorted(index.items(), key=lambda pair: pair[1]))
    notes.append(f"The file has no header; by their numbers: {places}.")


_SWITCHED: Final = 3  # levels of a power, at most


def _growing_clock(sheet: Sheet, growing: Sequence[int], free: Sequence[int]) -> int:
    """Return the time of growing columns: stamps, else by custom the first, but for the numbers of the rows.

    Raises:
        LogError: a temperature that only rises and a time may be either of two columns.
    """
    if len(growing) == 1 or not is_number(sheet.columns[growing[0]][0]):
        return growing[0]
    first, second = growing[:2]
    others = [i for i in free if i not in (first, second) and sheet.columns[i].levels() > _SWITCHED]
    is_numbered = others and sheet.columns[first][0] in ("0", "1") and _steps(sheet, first, 0.0)
    is_even = _steps(sheet, second, 0.5)
    if is_even != bool(is_numbered) and (is_numbered or not _steps(sheet, first, 0.5)):
        raise LogError(f"columns {first + 1} and {second + 1} only grow, as a time does and a heater that heats up",
                       file=sheet.file, expected=f"--time-column {first + 1} or --time-column {second + 1}")
    return second if is_numbered else first


def _steps(sheet: Sheet, i: int, uneven: float) -> bool:
    """Return whether a column of numbers goes up by steps that are even but for a share of the usual, if 0: by 1."""
    values = sheet.columns[i].floats()
    steps = np.diff([0.0] if values is None else values)
    usual = float(np.median(steps)) if uneven and len(steps) else 1.0
    return bool(len(steps) and np.all(np.abs(steps - usual) <= uneven * usual))


def _grows(sheet: Sheet, i: int) -> bool:
    """Return whether a column never decreases and is hardly ever constant: a clock, not a rising temperature."""
    cells = sheet.columns[i]
    if not is_number(cells[0]):
        return stamp(cells[0]) is not None
    if (values := cells.floats()) is None:
        return False
    steps = np.diff(values)
    return bool(np.all(steps >= 0.0) and np.count_nonzero(steps > 0.0) > 0.9 * len(steps))


_MOST_TEXT: Final = 0.1  # share of the cells
_BEYOND: Final = 1e30  # no instant and no reading; units can still be converted without overflow


def numbers(sheet: Sheet, columns: Columns, role: str, expected: str = "a number", *, holes: bool = False,
            blank: str | None = None, lenient: bool = False) -> Array:
    """Return a column as finite numbers, shape (n,), one for each row.

    Args:
        sheet: the cells.
        columns: which column is what.
        role: what the column holds, a key of `columns`.
        expected: the expected content, for the error message.
        blank: the expected content instead of a cell without a digit, which is then a hole, too; None: `expected`.
        holes: whether an empty cell or a "no value" mark becomes NaN instead of an error.
        lenient: whether a few other cells that are no finite numbers become NaN, too.

    Raises:
        LogError: a cell that is empty (without `holes`), not a number, not finite or beyond 1e30.
    """
    cells = sheet.columns[columns.index[role]]
    values = cells.floats()
    values = cells.numbers(_float) if values is None else values
    usable = np.abs(values) < _BEYOND
    if usable.all():
        return values
    is_blank = says_nothing if blank is None else _has_no_figure
    empty = holes & cells.where(is_blank)
    strange = ~(usable | empty)
    if not strange.any() or (lenient and np.count_nonzero(strange) <= _MOST_TEXT * len(cells)):
        values[~usable] = np.nan
        return values
    row = int(np.flatnonzero(strange)[0])
    cell = cells[row]
    if blank is not None and is_blank(cell):
        expected = blank
    if is_number(cell) or _is_float(cell):
        expected = expected.replace("a number", f"a finite number below {_BEYOND:g}", 1)
        raise cell_error(sheet, columns, role, row, "no reading:", expected)
    problem = "no number:" if cell else "an empty cell"
    raise cell_error(sheet, columns, role, row, "a unit that not all cells bear:" if is_quantity(cell) else problem,
                     expected)


def _has_no_figure(cell: str) -> bool:
    """Return whether a cell says that it holds nothing, or is a word."""
    return says_nothing(cell) or not any(sign.isdigit() for sign in cell)


def cell_error(sheet: Sheet, columns: Columns, role: str, row: int, problem: str, expected: str) -> LogError:
    """Return the error that names a row's line, column and value.

    Args:
        sheet: the cells.
        columns: which column is what.
        role: what the column holds, a key of `columns`.
        row: the row in the sheet, 0 = first.
        problem: what is wrong.
        expected: the expected content.
    """
    file, line = sheet.origin(row, role)
    return LogError(problem, file=file, line=line, column=columns.names[role],
                    value=sheet.columns[columns.index[role]][row] or None, expected=expected)


def _float(cell: str) -> float:
    """Return the number in a cell, NaN if it holds none."""
    try:
        return math.nan if "_" in cell else float(cell)  # Python reads 1_000, a log does not
    except ValueError:
        return math.nan


def _is_float(cell: str) -> bool:
    return not math.isnan(_float(cell)) or cell.strip("+-").lower() == "nan"


#: times of two numbers: the option that says which → name of the first and the second
_TWO_NUMBERS: Final = re.compile(r"\d{1,3}:\d\d(\.\d+)?")
CLOCK_UNITS: Final = ("mm:ss", "hh:mm")
_MINUTES_NAMED: Final = re.compile(r"(?i)\bm{1,3}:ss?\b|\bmin:se?c")
_HOURS_NAMED: Final = re.compile(r"(?i)\bhh?:mm\b|\bh:min")
_MOST_HOURS: Final = 99  # of a firing that is timed in hours and minutes
_LAST_HOUR: Final = 23
_EXPECTED_UNIT: Final = f"--time-unit {', '.join([*TIME_UNITS][:-1])} or {[*TIME_UNITS][-1]}"
_EPOCH: Final = 1e8  # beyond three years in seconds the numbers are a calendar's
_THIS_CENTURY: Final = (946_684_800.0, 4_102_444_800.0)  # 2000 to 2100, in seconds since 1970
#: 19, 18 (of Windows since 1601, or of .NET since the year 1), 16 and 13 digits
_EPOCHS: Final = ((9.4e17, "ns", 1e-9), (1e17, "100 ns", 1e-7), (1e14, "us", 1e-6), (1e11, "ms", 1e-3))
_ANY_TIME: Final = f"{STAMPS}, or --log-interval with the seconds between two rows"
_SHEET_DAYS: Final = (20_000.0, 80_000.0)  # days since 1900 as spreadsheets count them: 1954 to 2119


def with_dates(sheet: Sheet, columns: Columns, wanted: str | int | None) -> tuple[Sheet, Columns]:
    """Return the sheet with date and time of day joined in one column if they are in two.

    Args:
        sheet: the cells.
        columns: which column is what.
        wanted: name or number of the date column, "none": there is none; None: detect it.

    Raises:
        LogError: no such column.
    """
    place = columns.index.get("time")
    if wanted == NO_COLUMN or (wanted is None and (place is None or not is_clock(sheet.columns[place][0]))):
        return sheet, columns
    if place is None or not is_clock(sheet.columns[place][0]):
        raise LogError("no time of day with the date", file=sheet.file, expected="--time-column with a time of day")
    free = [i for i, column in enumerate(sheet.columns) if i not in columns.index.values() and is_date(column[0])]
    if wanted is not None:
        free = [i for i in free if str(wanted) == str(i + 1) or (sheet.header and sheet.header[i] == wanted)]
        if not free:
            raise LogError("no column of dates", file=sheet.file, value=str(wanted), expected="--date-column NAME or N")
    elif sheet.header:
        free = [i for i in free if role_of(sheet.header[i]) == "time"] or free
    if len(free) != 1:
        return sheet, columns
    cells: Iterable[str] = sheet.columns[free[0]]
    dates: Iterable[str] = accumulate(cells, lambda before, cell: cell or before)  # merged cells have the first alone
    sheet = sheet.with_column(place, map(" ".join, zip(dates, sheet.columns[place], strict=True)))
    name = sheet.names()[free[0]]
    note = f"The date in {name!r} and the time of day in {columns.names['time']!r} were put together."
    return sheet, replace(columns, index={**columns.index, "date": free[0]}, names={**columns.names, "date": name},
                          notes=(*columns.notes, note))


#: part of a clock that has a column of its own → its name, without a unit
_PARTS: Final = {
    "year": r"years?|jahr|yyyy|año|année|anno", "month": r"months?|monat|mon|mes|mois|mese",
    "day": r"days?|tag|dd?|día|jour|giorno", "hour": r"hours?|stunden?|std|hr|hh?|hora|heure|ora",
    "minute": r"min(ute[ns]?|s)?|mm|minuto", "second": r"s(ec(ond)?s?|ek(unden?)?)?|ss|segundo",
    "millisecond": r"m(illi)?s(ec(ond)?s?)?|msec|millis"}
_LIMITS: Final = {"month": 13, "day": 32, "hour": 24, "minute": 60, "second": 60, "millisecond": 1000}


def with_clock_parts(sheet: Sheet, columns: Columns) -> tuple[Sheet, Columns]:
    """Return the sheet with the parts of a clock that have columns of their own joined in the column of the time.

    Such are year to second, minute and second, and the milliseconds next to a time of day.
    """
    place = columns.index.get("time")
    if place is None or not sheet.header:
        return sheet, columns
    parts: dict[str, tuple[int, Array]] = {}
    for i, name in enumerate(sheet.header):
        plain = re.sub(r"[\[(/].*", "", name).strip().lower()
        part = next((part for part, names in _PARTS.items() if re.fullmatch(names, plain)), None)
        values = None if part is None or part in parts else sheet.columns[i].floats()
        if values is not None and np.all(values >= 0.0) and np.all(values < _LIMITS.get(str(part), np.inf)):
            parts[str(part)] = i, values
    clock = sheet.columns[place]
    if "millisecond" in parts and is_clock(clock[0].rpartition(" ")[2]) and not re.search(r"[.,]\d+$", clock[0]):
        names = [sheet.header[parts["millisecond"][0]]]
        joined = [f"{cell}.{round(part):03d}" for cell, part in zip(clock, parts["millisecond"][1], strict=True)]
    elif "minute" in parts and {"hour", "second"} & {*parts} and place in [i for i, _ in parts.values()]:
        names = [sheet.header[i] for i, _ in parts.values()]
        joined = _clock_of({part: values for part, (_, values) in parts.items()})
    else:
        return sheet, columns
    note = f"{' and '.join(map(repr, names))} were read as parts of the time."
    sheet = sheet.with_column(place, joined)
    units = {role: unit for role, unit in columns.units.items() if role != "time"}
    return sheet, replace(columns, names={**columns.names, "time": "time"}, notes=(*columns.notes, note), units=units)


def _clock_of(parts: Mapping[str, Array]) -> list[str]:
    """Return a stamp, a time of day or minutes and seconds for each row of the parts of a clock, shape (n,) each."""
    rows = zip(*parts.values(), strict=True)
    whole = ({"hour": 0.0, "second": 0.0, "millisecond": 0.0} | dict(zip(parts, row, strict=True)) for row in rows)
    dated = {"year", "month", "day"} <= {*parts}
    return [(f"{row['year']:04.0f}-{row['month']:02.0f}-{row['day']:02.0f} " if dated else "")
            + f"{row['hour']:02.0f}:{row['minute']:02.0f}:{row['second'] + 1e-3 * row['millisecond']:06.3f}"
            for row in whole]


def seconds(sheet: Sheet, columns: Columns, unit: str | None, sample_time_s: float | None,
            repairs: list[str]) -> LogSignal:
    """Return the time of each row [s]; its unit is also "counted" or "stamps".

    Args:
        sheet: the cells.
        columns: which column is what.
        unit: of the time column, a key of `TIME_UNITS`; None: from its name or digits, otherwise seconds.
        sample_time_s: interval of a log whose rows are counted [s]; None: the time column is read.
        repairs: list to which changes and assumptions are added.

    Raises:
        LogError: neither time column nor interval, a cell that is not a time, an ambiguous unit.
    """
    if sample_time_s is not None:
        unused = f"; column {columns.names['time']} not used" if "time" in columns.index else ""
        repairs.append(f"The time was counted in rows of {sample_time_s:g} s{unused}.")
        return LogSignal(np.arange(len(sheet), dtype=np.float64) * sample_time_s, "counted", "counted")
    if "time" not in columns.index:
        expected = "--log-interval with the seconds between two rows, or --time-column"
        raise LogError("the file has no time column", file=sheet.file, expected=expected)
    cells = sheet.columns[columns.index["time"]]
    two = _two_numbers(sheet, columns, cells, unit)
    if two:
        repairs.append(f"The time was read as {two}.")
        sixties = cells.numbers(_sixties)
        time = past_midnight(60.0 * sixties, repairs) if two == "hh:mm" else past_hour(sixties, repairs)
        return LogSignal(time, two, two)
    if is_date_in_digits(cells[0]) and all(map(is_date_in_digits, cells.kinds())):
        repairs.append("The digits of the time are dates and were converted to seconds from the first row.")
        return LogSignal(_from_stamps(sheet, columns, cells, repairs), "stamps", "stamps")
    if (length_s := durations_s(cells)) is not None:
        repairs.append("The time is written as a duration and was converted to seconds.")
        return LogSignal(length_s, "stamps", "stamps")
    if not is_number(cells[0]) and (stamp(cells[0]) is not None or month_first(cells)):
        repairs.append("Time stamps were converted to seconds from the first row.")
        return LogSignal(_from_stamps(sheet, columns, cells, repairs), "stamps", "stamps")
    return _from_numbers(sheet, columns, unit, repairs)


def _two_numbers(sheet: Sheet, columns: Columns, cells: CellColumn, unit: str | None) -> str:
    """Return "mm:ss" or "hh:mm" for times of two numbers, "" for others: as stated, by the name, or by more than 99.

    Raises:
        LogError: neither says it, and they are a timer's: they begin at 00:00 or so, or pass 23:59.
    """
    if "date" in columns.index or not all(map(_TWO_NUMBERS.fullmatch, cells)):
        return ""
    if unit in CLOCK_UNITS:
        return unit
    name = columns.names["time"]
    longest = max(int(cell.partition(":")[0]) for cell in cells)
    if _MINUTES_NAMED.search(name) or longest > _MOST_HOURS or "." in cells[0]:
        return "mm:ss"
    if _HOURS_NAMED.search(name):
        return "hh:mm"
    if is_hours_or_minutes(cells[0]) or longest > _LAST_HOUR:
        raise cell_error(sheet, columns, "time", 0, "a time that may be hours and minutes or minutes and seconds:",
                         "--time-unit mm:ss or --time-unit hh:mm")
    return ""


def _sixties(cell: str) -> float:
    """Return a time such as 12:30 as minutes and seconds [s], or hours and minutes [min]."""
    minutes, _, seconds = cell.partition(":")
    return 60.0 * int(minutes) + float(seconds)


def _from_numbers(sheet: Sheet, columns: Columns, unit: str | None, repairs: list[str]) -> LogSignal:
    values = numbers(sheet, columns, "time", f"a number or a time like {_ANY_TIME}")
    if unit is None and (clock_s := clocks_in_digits(values)) is not None:
        repairs.append("The digits of the time are times of day and were converted to seconds.")
        return LogSignal(past_midnight(clock_s - clock_s[0], repairs), "stamps", "stamps")
    label = columns.unit("time")
    epoch = next(((name, length) for least, name, length in _EPOCHS if values[0] > least), None)
    if unit is None and epoch is not None and label in (None, "ms", epoch[0]) and not columns.is_foreign("time"):
        since = "1970" if epoch[0] in TIME_UNITS else "1601 or the year 1"
        repairs.append(f"The time is in {epoch[0]} since {since} by its digits and was counted from the first row.")
        return LogSignal((values - values[0]) * epoch[1], epoch[0], epoch[0])
    if unit is None and (columns.is_foreign("time") or epoch is not None or _are_days(values, label)):
        raise cell_error(sheet, columns, "time", 0, "a time in an unknown unit:", _EXPECTED_UNIT)
    if unit in CLOCK_UNITS:
        raise cell_error(sheet, columns, "time", 0, f"a number, not {unit}:", _EXPECTED_UNIT)
    time_unit = unit or label or "s"
    if time_unit != "s":
        repairs.append(f"The time is in {time_unit} {'as stated' if unit else 'by its name'} and was converted to "
                       "seconds.")
    assumed = unit is None and not _is_calendar(values) and (label is None or is_scaled("time", columns.names["time"]))
    if assumed and time_unit == "s":
        likely = likely_time_unit(values)
        other = "" if likely == "s" else f"; its interval makes {likely} likelier"
        repairs.append(f"The time has no unit in the file; taken as seconds (otherwise: --time-unit){other}.")
    if values[0] * TIME_UNITS[time_unit] > _EPOCH:
        repairs.append("The time is a calendar's and was counted from the first row.")
        values = values - values[0]
    return LogSignal(values * TIME_UNITS[time_unit], time_unit, time_unit, "" if assumed else EXPLICIT)


def _is_calendar(values: Array) -> bool:
    """Return whether numbers can only be seconds since 1970."""
    first, last = _THIS_CENTURY
    return len(values) > 1 and first < values[0] < last and float(np.median(np.abs(np.diff(values)))) < LONGEST_STEP_S


def _are_days(values: Array, named: str | None) -> bool:
    """Return whether these are a spreadsheet's dates: days since 1900, a small part of a day from row to row."""
    low, high = _SHEET_DAYS
    within = len(values) > 1 and low < values[0] < high and values[-1] < high
    return named is None and within and 0.0 < float(np.median(np.abs(np.diff(values)))) < 0.05


def _from_stamps(sheet: Sheet, columns: Columns, cells: CellColumn, repairs: list[str]) -> Array:
    order, reason = order_of_dates(cells)
    if reason == NO_ORDER:
        raise cell_error(sheet, columns, "time", 0, "a date that may be day first or month first:", _ANY_TIME)
    if order:
        repairs.append(f"The dates are read with the {order} first{reason}.")
        cells = cells.map(partial(day_first, order=order))
    first = stamp(cells[0])
    within_us, is_parsed = within_hours(cells)
    parsed, elapsed_s = np.flatnonzero(is_parsed), np.empty(len(cells))
    texts = cells.at_rows(parsed)
    for row, text, moment in zip(parsed.tolist(), texts, map(stamp, texts), strict=True):
        if moment is None or first is None:
            raise cell_error(sheet, columns, "time", row, "no time:", _ANY_TIME)
        if lacks := unlike_part(moment, first, text, cells[0]):
            raise cell_error(sheet, columns, "time", row, f"with and without a {lacks}:", f"all like {cells[0]}")
        elapsed_s[row] = (moment - first).total_seconds()
    before = parsed[np.cumsum(is_parsed) - 1]
    elapsed_s = (np.round(1e6 * elapsed_s[before]) + (within_us - within_us[before])) / 1e6
    return past_midnight(elapsed_s, repairs) if is_clock(cells[0]) else elapsed_s


def forwards(sheet: Sheet, time: Array, repairs: list[str]) -> tuple[Sheet, Array]:
    """Return rows that are written newest first in the order of their times, and these, shape (n,) [s]."""
    steps = np.diff(time)
    if not len(steps) or np.any(steps > 0) or not np.any(steps < 0):
        return sheet, time
    repairs.append("The rows are newest first and were reversed.")
    return sheet.at_rows(slice(None, None, -1)), time[::-1] - time[-1]


_THOUSAND_OR_ONE: Final = re.compile(r"[12]\.\d{3}")
_GROUP_OR_DECIMALS: Final = re.compile(r"[1-9]\d{0,2}\.\d{3}")
_WHOLE: Final = re.compile(r"[+-]?\d+")


def demand_one_form(sheet: Sheet, columns: Columns, decimal_comma: str | None) -> None:
    """Refuse numbers that may be thousands in groups or have three decimals.

    Such are temperatures that all lie between 1 and 3, or 1000 and 3000; and powers in a unit such as W of which some
    are whole. Nothing is refused where the user states the columns with decimal commas.

    Raises:
        LogError: they are.
    """
    for role in ("temperature", "power"):
        if role not in columns.index or decimal_comma is not None:
            continue
        cells = sheet.columns[columns.index[role]]
        kinds = [cell for cell in cells.kinds() if not says_nothing(cell)] if cells.holds(".") else []
        marked = next(filter(_GROUP_OR_DECIMALS.fullmatch, kinds), None)
        if marked is None or not (
                all(map(_THOUSAND_OR_ONE.fullmatch, kinds)) if role == "temperature" else columns.is_foreign("power")
                and any(map(_WHOLE.fullmatch, kinds))
                and all(_WHOLE.fullmatch(cell) or _GROUP_OR_DECIMALS.fullmatch(cell) for cell in kinds)):
            continue
        row = int(np.flatnonzero(cells.where(marked.__eq__))[0])
        whole, name = marked.replace(".", ""), quoted(columns.names[role])
        group, decimal = ("none", name) if _COMMAS in sheet.repairs else (name, "none")
        raise cell_error(sheet, columns, role, row, "thousands in groups, or three decimals:",
                         f"--decimal-comma {group} for {whole}, or --decimal-comma {decimal} for {marked}")


_COMMAS: Final = "Decimal commas were read as points."
