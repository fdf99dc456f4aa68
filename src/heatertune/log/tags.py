"""Rows of several tags: a long table (tag, time, value, quality) → one row per reading; one tag of a wide table.

Also resampling a series with its own time stamps at those of another by sample and hold.

The power from a file of its own: its rows are put among those of the temperature, each at its own instant.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime, timedelta
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.errors import LogError
from heatertune.log.cells import Sheet
from heatertune.log.columns import NO_COLUMN, Columns, choose_column, find_columns, seconds, with_dates
from heatertune.log.on_change import good_rows, is_quality, on_change
from heatertune.log.quantities import (
    is_number,
    is_quantity,
    is_second_choice,
    on_or_off,
    plain_name,
    plain_quantities,
    role_of,
    says_nothing,
    stamp,
    unit_in_name,
)
from heatertune.log.side_columns import likely_power, quoted
from heatertune.settings import ReadSettings
from heatertune.units import count

__all__ = [
    "HeldSeries", "TagSelection", "TagTable", "by_tags", "changes_twice", "hold_series", "places",
    "with_power_rows",
]


_FEW_LEVELS: Final = 5  # of a power that is switched between them: a mean would be neither
_SWITCHED: Final = 0.01  # share of the intervals in which a power changes more than once


class HeldSeries(NamedTuple):
    """Cells at the requested instants, the number of these before the first value, the repairs, and the new unit."""

    cells: list[str]
    late: int
    notes: list[str]
    unit: str = ""


def hold_series(at: Array, time: Array, cells: Sequence[str], *, is_power: bool) -> HeldSeries:
    """Resample a series at other instants by sample and hold.

    A power that changes more than once between two instants is averaged over each interval, because its value at the
    instants would be random. A setpoint before its first instant takes the first value.

    Args:
        at: the requested instants, ascending, shape (n,) [s].
        time: the series' own, ascending, shape (k,) [s].
        cells: its values, one for each of its instants.
        is_power: whether it is a power.
    """
    places = np.searchsorted(time, at, side="right") - 1
    late = int(np.count_nonzero(places < 0))
    values = [cells[k] for k in np.maximum(places, 0)]
    if not is_power:
        return HeldSeries(values, 0,
                          [f"The setpoint of the first {count(late, 'row')} is taken from after."] if late else [])
    notes = [f"{count(late, 'row')} before the first power left out."] if late else []
    switched = on_or_off(cells)
    moved = _latest(at, time, cells)
    twice = changes_twice(at, time, cells)
    means = _means(at, time, switched or cells) if twice or (moved > 0.0 and len(set(cells)) > _FEW_LEVELS) else None
    if means is not None:
        changes = "more than once " if twice else ""
        notes.append(f"The power changes {changes}between readings; its mean over each interval was taken.")
        values = [repr(float(mean) * (100.0 if switched else 1.0)) for mean in means]
    elif moved > 0.0:
        notes.append(f"The power is held to the next reading, up to {moved:.3g} s after it changed.")
    return HeldSeries(values, late, notes, "%" if switched and means is not None else "")


def _changes(time: Array, cells: Sequence[str]) -> Array:
    return time[1:][[a != b for a, b in pairwise(cells)]]


def _latest(at: Array, time: Array, cells: Sequence[str]) -> float:
    """Return the longest time from a change to the first reading that shows it [s]."""
    changes = _changes(time, cells)
    changes = changes[(changes > at[0]) & (changes <= at[-1])]
    return float(np.max(at[np.searchsorted(at, changes)] - changes, initial=0.0))


def changes_twice(at: Array, time: Array, cells: Sequence[str]) -> bool:
    """Return whether a power changes more than once in some of the intervals between the instants `at`.

    Args:
        at: instants of the readings of the temperature [s], shape (n,).
        time: instants of the rows with a power [s], shape (m,).
        cells: the power in each of these rows, as in the file.
    """
    in_each = np.histogram(_changes(time, cells), bins=at)[0] if len(at) > 1 else np.zeros(1)
    return bool(np.count_nonzero(in_each > 1) > _SWITCHED * len(at))


def _means(at: Array, time: Array, cells: Sequence[str]) -> Array | None:
    """Return the mean over each interval; None if the power is not a number."""
    try:
        values = np.array([float(cell) for cell in cells])
    except ValueError:
        return None
    ends = np.append(at, at[-1] + float(np.median(np.diff(at))))
    grown = np.concatenate([[0.0], np.cumsum(values[:-1] * np.diff(time))])
    k = np.clip(np.searchsorted(time, ends, side="right") - 1, 0, None)
    energy = grown[k] + values[k] * (ends - time[k])
    lasted = np.diff(ends)
    means = np.where(lasted > 0.0, np.diff(energy) / np.where(lasted > 0.0, lasted, 1.0), values[k[:-1]])
    return np.clip(means, values.min(), values.max())  # rounding may leave the range of the power


_TAG: Final = re.compile(
    r"(tag( ?(name|index|id))?|name|var(iable)? ?(name)?|point( ?(name|id))?|signal( ?name)?|entity ?id|sensor|channel"
    r"|kanal|series|metric|measurement|field|item|symbol|topic|messstelle|bezeichnung|parameter|node ?id|id|zone)",
    re.IGNORECASE)
_VALUE: Final = re.compile(r"(var ?)?(value|wert|messwert|state|reading|val)( ?[\[(].*)?", re.IGNORECASE)
_UNIT: Final = re.compile(r"(unit|units|einheit|unit of measurement|eu)", re.IGNORECASE)
_WINCC: Final = ("varname", "timestring", "varvalue", "validity", "time ms")
_FIRST_DAY: Final = datetime(1899, 12, 30)  # of WinCC's and spreadsheets' calendar
_ROLES: Final = ("temperature", "power", "setpoint")
_SHOWN: Final = 12
#: share of the readings: so many more rows may be added, each with a temperature on a line between two readings
_MOST_EDGES: Final = 0.5
_OPTIONS: Final = {"temperature": "--tag", "power": "--power-tag", "setpoint": "--setpoint-tag"}


@dataclass(frozen=True, slots=True, kw_only=True)
class TagSelection:
    """Tags and columns selected by the user; None if not stated, "none" if there is none.

    Attributes:
        temperature: tag of the temperature; the same for `power` and `setpoint`.
        column: name or number of the tag column; the same for `quality`, `value`, `time` and `date`.
    """

    temperature: str | None = None
    power: str | None = None
    setpoint: str | None = None
    column: str | int | None = None
    quality: str | int | None = None
    value: str | int | None = None
    time: str | int | None = None
    date: str | int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class TagTable:
    """Result of the selection of tags.

    Attributes:
        sheet: the rows of one heater; of a long table the columns time, temperature, power and setpoint.
        lost: number of omitted rows: bad quality, or before the first power.
        unused: tags that were not used.
        options: option of `read_log` → value that reproduces this reading.
        wanted: role → number of its column for a long table, otherwise empty.
        lost_s: instants of lost readings of the temperature, counted from the first row, ascending [s].
    """

    sheet: Sheet
    lost: int = 0
    unused: tuple[str, ...] = ()
    options: Mapping[str, str] = field(default_factory=dict)
    wanted: Mapping[str, str | int] = field(default_factory=dict)
    lost_s: tuple[float, ...] = ()

    @property
    def is_long(self) -> bool:
        """Whether the file was a long table."""
        return bool(self.wanted)


def by_tags(sheet: Sheet, asked: TagSelection, time_unit: str | None) -> TagTable:
    """Return the rows of one heater.

    Raises:
        LogError: tags or flags that are ambiguous or do not exist.
    """
    sheet = _with_long_header(sheet)
    quality, options = _quality_place(sheet, asked), {}
    good = np.ones(len(sheet.rows), dtype=np.bool_) if quality is None else good_rows(sheet, quality)
    if quality is not None:
        options["quality_column"] = _name(sheet, quality)
    elif asked.quality is not None:
        options["quality_column"] = NO_COLUMN
    tag, value = places(sheet, asked)
    if tag is not None and value is not None:
        return _pivoted(sheet, asked, tag, value, good, time_unit, options)
    _demand_long(sheet, asked)
    if asked.temperature is not None:
        sheet, good, tag_options = _one_tag(sheet, asked.temperature, None if asked.column is None else tag, good)
        options |= tag_options
    if not np.all(good):
        sheet = _without_bad(sheet, good)
    return TagTable(sheet=sheet, lost=int(np.count_nonzero(~good)), options=options)


def _with_long_header(sheet: Sheet) -> Sheet:
    """Return a table without names with those of a long one, if its cells are a time, one of few texts, and a value."""
    if sheet.header or len(sheet.rows[0]) < _LEAST_COLUMNS:
        return sheet
    some = sheet.rows[:_SAMPLE_ROWS]
    clocks = [i for i in range(len(some[0])) if all(stamp(row[i]) is not None for row in some)]
    tags = [i for i in range(len(some[0])) if i not in clocks and not any(is_number(row[i]) for row in some)
            and 1 < len({row[i] for row in sheet.rows}) <= len(sheet.rows) // 4]
    values = [i for i in range(len(some[0])) if i not in (*clocks, *tags)
              and sum(is_number(row[i]) or is_quantity(row[i]) for row in some) > len(some) / 2]
    if len(clocks) != 1 or len(tags) != 1 or len(values) != 1:
        return sheet
    names = {clocks[0]: "time", tags[0]: "tag", values[0]: "value"}
    note = "The file has no header; by its cells a table of time, tag and value."
    return replace(sheet, header=tuple(names.get(i, f"column {i + 1}") for i in range(len(some[0]))),
                   repairs=(*sheet.repairs, note))


_LEAST_COLUMNS: Final = 3
_SAMPLE_ROWS: Final = 50


def _demand_long(sheet: Sheet, asked: TagSelection) -> None:
    """Refuse options for a long table that would have no effect."""
    unheard = [_OPTIONS[role] for role in _ROLES[1:] if getattr(asked, role) is not None]
    if asked.column is not None and asked.temperature is None:
        unheard.append("--tag-column without --tag")
    if unheard:
        raise LogError(f"no long table (tag, time, value), so {unheard[0]} means nothing", file=sheet.file,
                       expected="--temperature-column with its column of values, or no such option")


def _quality_place(sheet: Sheet, asked: TagSelection) -> int | None:
    if asked.quality == NO_COLUMN:
        return None
    if asked.quality is not None:
        return choose_column(sheet, "quality", asked.quality)
    return next((i for i, name in enumerate(sheet.header) if is_quality(name)), None)


def places(sheet: Sheet, asked: TagSelection) -> tuple[int | None, int | None]:
    """Return the columns of the tags and, in a long table, of their values."""
    named = [i for i, name in enumerate(sheet.header) if _TAG.fullmatch(plain_name(name))]
    tag = next((i for i in named if _repeats(sheet, i)), None) if asked.column is None else (
        choose_column(sheet, "tag", asked.column))
    values = [i for i, name in enumerate(sheet.header) if i != tag and _VALUE.fullmatch(plain_name(name))]
    others = [name for i, name in enumerate(sheet.header) if i not in (tag, *values)]
    is_wide = {"temperature", "power"} & set(map(role_of, others))
    if asked.value is not None and (asked.power is not None or asked.setpoint is not None):
        return tag, choose_column(sheet, "temperature", asked.value)
    if is_wide or not values or (asked.value is not None and choose_column(sheet, "temperature",
                                                                           asked.value) not in values):
        return tag, None
    return tag, values[0] if asked.value is None else choose_column(sheet, "temperature", asked.value)


def _repeats(sheet: Sheet, i: int) -> bool:
    """Return whether a column holds few texts again and again: tags, not the numbers of the rows."""
    return len({row[i] for row in sheet.rows}) <= max(1, len(sheet.rows) // 4)


def _name(sheet: Sheet, i: int) -> str:
    return sheet.header[i] if sheet.header else f"{i + 1}"


def _one_tag(
    sheet: Sheet, wanted: str, tag: int | None, good: npt.NDArray[np.bool_]
) -> tuple[Sheet, npt.NDArray[np.bool_], dict[str, str]]:
    """Return the rows of one tag of a wide table."""
    if tag is None:
        tag = next((i for i in range(len(sheet.rows[0])) if any(row[i] == wanted for row in sheet.rows)), None)
    if tag is None or all(row[tag] != wanted for row in sheet.rows):
        raise LogError("no cell holds the tag", file=sheet.file, value=wanted, expected="--tag-column, and a tag of it")
    places = [k for k, row in enumerate(sheet.rows) if row[tag] == wanted]
    note = f"Of {len(sheet.rows)} rows the {len(places)} whose {_name(sheet, tag)!r} is {wanted!r} were read."
    sheet = replace(sheet.picked(places), repairs=(*sheet.repairs, note))
    return sheet, good[places], {"tag": wanted, "tag_column": _name(sheet, tag)}


def _without_bad(sheet: Sheet, good: npt.NDArray[np.bool_]) -> Sheet:
    if not np.any(good):
        raise LogError("no row is of good quality", file=sheet.file, expected="--quality-column none to read all rows")
    return replace(sheet.picked(np.flatnonzero(good).tolist()), repairs=(*sheet.repairs, _bad(sheet, ~good)))


def _bad(sheet: Sheet, bad: npt.NDArray[np.bool_]) -> str:
    rows = np.flatnonzero(bad)
    lines = ", ".join(f"line {sheet.lines[row]}" for row in rows[:5])
    more = f" and {len(rows) - 5} more" if len(rows) > 5 else ""
    return f"{count(len(rows), 'row')} whose quality is not good left out ({lines}{more})."


def _pivoted(
    sheet: Sheet, asked: TagSelection, tag: int, value: int, good: npt.NDArray[np.bool_], time_unit: str | None,
    options: Mapping[str, str],
) -> TagTable:
    """Return the long table with a row for each reading of the temperature."""
    tags = list(dict.fromkeys(row[tag] for row in sheet.rows))
    roles = _roles(sheet, tags, tag, asked)
    clock, time = _time(sheet, asked, time_unit)
    good = good & np.array([not says_nothing(row[value]) for row in sheet.rows], dtype=np.bool_)
    of_tag = np.array([row[tag] for row in sheet.rows], dtype=object)
    bad = np.isin(of_tag, list(roles.values())) & ~good
    series = {role: _series(of_tag == name, good, time) for role, name in roles.items()}
    for role, places in series.items():
        _demand_order(sheet, role, roles[role], time[places], places)
    rows, edges = _with_edges(sheet, value, series, time)
    others = {role: hold_series(time[rows], time[places], [sheet.rows[k][value] for k in places],
                                is_power=role == "power")
              for role, places in series.items() if role != "temperature"}
    late = max((other.late for other in others.values()), default=0)
    if late == len(rows):
        raise LogError(f"no reading of the tag {roles['temperature']!r} after the first of the power", file=sheet.file,
                       expected=f"another {_OPTIONS['power']}, or {_OPTIONS['power']} none")
    parts = ", ".join(f"{name!r} as the {role}" for role, name in roles.items())
    repairs = [f"The table is long: of its column {_name(sheet, tag)!r}, {parts}, was read."]
    repairs += [_bad(sheet, bad)] if np.any(bad) else []
    units = {role: others[role].unit if role in others else "" for role in series}
    return TagTable(
        sheet=replace(
            sheet, comment=(), units=(), lines=[sheet.lines[k] for k in rows[late:]],
            header=(sheet.header[clock[0]], *(_with_unit(sheet, tag, roles[role], units[role]) for role in series)),
            rows=[[sheet.rows[k][clock[0]], "" if k in edges else sheet.rows[k][value],
                   *(other.cells[n] for other in others.values())] for n, k in enumerate(rows) if n >= late],
            repairs=(*sheet.repairs, *repairs, *(note for other in others.values() for note in other.notes)),
        ),
        lost=int(np.count_nonzero(bad)) + late,
        unused=_unused(sheet, tags, roles, (tag, value, *clock), options.get("quality_column")),
        options={
            **options, "tag": roles["temperature"], "power_tag": roles.get("power", NO_COLUMN),
            "setpoint_tag": roles.get("setpoint", NO_COLUMN), "tag_column": _name(sheet, tag),
            "temperature_column": _name(sheet, value), "time_column": sheet.header[clock[0]],
        },
        wanted={role: n + 1 for n, role in enumerate(["time", *series])}
        | {role: NO_COLUMN for role in _ROLES if role not in series},
        lost_s=tuple(time[(of_tag == roles["temperature"]) & ~good] - time[rows[late]]),
    )


def _with_edges(
    sheet: Sheet, value: int, series: Mapping[str, npt.NDArray[np.intp]], time: Array
) -> tuple[npt.NDArray[np.intp], frozenset[int]]:
    """Return the rows of the temperature and those of the power's changes between them, and which the latter are.

    Where the temperature is not written on change, so that its value there has to be put on a line, they are not many;
    of a power that changes more than once between two readings its mean is taken, see `held`.
    """
    rows = series["temperature"]
    if "power" not in series:
        return rows, frozenset()
    power = series["power"]
    cells = [sheet.rows[k][value] for k in power]
    changed = power[1:][[a != b for a, b in pairwise(cells)]]
    within = (time[changed] > time[rows[0]]) & (time[changed] < time[rows[-1]])
    edges = changed[within & ~np.isin(time[changed], time[rows])]
    many = len(edges) > _MOST_EDGES * len(rows) or changes_twice(time[rows], time[power], cells)
    if many and not _stands(sheet, value, rows, time):
        return rows, frozenset()
    both = np.concatenate([rows, edges])
    return both[np.argsort(time[both], kind="stable")], frozenset(edges.tolist())


def _stands(sheet: Sheet, value: int, rows: npt.NDArray[np.intp], time: Array) -> bool:
    """Return whether the temperature is written on change."""
    cells = [sheet.rows[k][value] for k in rows]
    plain = plain_quantities(cells)
    try:
        readings = np.array(cells if plain is None else plain[0], dtype=np.float64)
    except ValueError:
        return False
    return on_change(time[rows], readings) is not None


def _unused(
    sheet: Sheet, tags: Sequence[str], roles: Mapping[str, str], places: Sequence[int], flag: str | None
) -> tuple[str, ...]:
    """Return the tags and the columns that were not used; a column of units is."""
    columns = (name for i, name in enumerate(sheet.header) if i not in places and name != flag)
    return (*(name for name in tags if name not in roles.values()),
            *(name for name in columns if not _UNIT.fullmatch(plain_name(name))))


def _series(of_tag: npt.NDArray[np.bool_], good: npt.NDArray[np.bool_], time: Array) -> npt.NDArray[np.intp]:
    """Return the rows of one tag in the order of their times, also where they are written newest first."""
    rows = np.flatnonzero(of_tag & good)
    steps = np.diff(time[rows])
    return rows[::-1] if len(rows) > 1 and np.all(steps <= 0) and np.any(steps < 0) else rows


def _demand_order(sheet: Sheet, role: str, name: str, time: Array, places: npt.NDArray[np.intp]) -> None:
    """Refuse a tag without readings, or with a time that goes backwards."""
    if not len(places):
        raise LogError(f"no good reading of the tag {name!r}", file=sheet.file, expected=f"{_OPTIONS[role]}, another")
    back = np.flatnonzero(np.diff(time) < 0)
    if len(back):
        raise LogError(f"the time of the tag {name!r} goes backwards", file=sheet.file,
                       line=sheet.lines[places[back[0] + 1]])


def _with_unit(sheet: Sheet, tag: int, name: str, unit: str) -> str:
    """Return a tag as the name of a column: with the unit of a column of units, and never like a column's number."""
    plain = f"tag {name}" if name.isdecimal() else name
    place = next((i for i, head in enumerate(sheet.header) if _UNIT.fullmatch(plain_name(head))), None)
    if not unit and place is not None:
        unit = next((row[place] for row in sheet.rows if row[tag] == name and row[place]), "")
    return f"{plain} [{unit}]" if unit else plain


def _roles(sheet: Sheet, tags: Sequence[str], tag: int, asked: TagSelection) -> dict[str, str]:
    """Return role → tag: as requested, otherwise if the names are unambiguous."""
    listed = f"{', '.join(tags[:_SHOWN])}{', …' if len(tags) > _SHOWN else ''}"
    wanted = {role: getattr(asked, role) for role in _ROLES}
    for role, name in wanted.items():
        if name is not None and name not in tags and (name != NO_COLUMN or role == "temperature"):
            raise LogError(f"column {_name(sheet, tag)!r} holds no tag", file=sheet.file, value=name,
                           expected=f"{_OPTIONS[role]}, one of {listed}")
    free = [name for name in tags if name not in wanted.values()]
    in_degrees = _tags_in_degrees(sheet, tag, asked)
    tag_of: dict[str, str] = {}
    for role, name in wanted.items():
        likely = [tag_name for tag_name in free if _role_of_tag(tag_name) == role]
        if role == "temperature":
            likely += [tag_name for tag_name in free if _role_of_tag(tag_name) is None and tag_name in in_degrees]
        likely = [tag_name for tag_name in likely if not is_second_choice(tag_name)] or likely
        if len(tags) == 1 and role == "temperature" and _role_of_tag(tags[0]) in (None, "time"):
            likely = list(tags)
        if name is None and (len(likely) > 1 or (role == "temperature" and not likely)):
            several = f"{len(likely)} tags may be the {role} ({', '.join(likely[:_SHOWN])})" if likely else (
                f"no tag is plainly the {role} ({listed})")
            raise LogError(several, file=sheet.file, column=_name(sheet, tag),
                           expected=f"{_OPTIONS[role]} NAME" + ("" if role == "temperature" else " or none"))
        if name is None and not likely and role == "power":
            _demand_no_likely_power(sheet, [each for each in free if each not in tag_of.values()], tag, asked)
        if name is None and likely:
            tag_of[role] = likely[0]
        elif name not in (None, NO_COLUMN):
            tag_of[role] = name
    return tag_of


def _tags_in_degrees(sheet: Sheet, tag: int, selection: TagSelection) -> frozenset[str]:
    """Return the tags whose first value bears the unit of a temperature."""
    value = places(sheet, selection)[1]
    if value is None:
        return frozenset()
    first: dict[str, str] = {}
    for row in sheet.rows:
        first.setdefault(row[tag], row[value])
    return frozenset(name for name, cell in first.items()
                     if is_quantity(cell) and unit_in_name("temperature", f"[{cell.split()[-1]}]"))


def _demand_no_likely_power(sheet: Sheet, tags: Sequence[str], tag: int, selection: TagSelection) -> None:
    """Refuse to pass over a tag that may be the power by its values, see `likely_power`.

    Raises:
        LogError: there is one, or several.
    """
    value = places(sheet, selection)[1]
    cells: dict[str, list[str]] = {name: [] for name in tags if _role_of_tag(name) is None}
    if value is None:
        return
    for row in sheet.rows:
        if row[tag] in cells:
            cells[row[tag]].append(row[value])
    plain = {name: plain_quantities(column) or (column, "", False) for name, column in cells.items() if column}
    likely = [name for name, (figures, unit, _) in plain.items() if likely_power(name, figures, in_percent=unit == "%")]
    if likely:
        names = " or ".join(map(quoted, likely[:_SHOWN]))
        raise LogError(f"no tag is named as the power, but {names} may be it by its values", file=sheet.file,
                       expected=f"--power-tag {quoted(likely[0])} or --power-tag none")


def _role_of_tag(name: str) -> str | None:
    """Return the role denoted by a tag: Zone1/Temperature, TIC101.OP, switch.heater."""
    *before, last = re.split(r"[./\\:|!]", name)
    role = role_of(last) or role_of(name)
    return "power" if role in (None, "time") and before[:1] == ["switch"] else role


def _time(sheet: Sheet, asked: TagSelection, unit: str | None) -> tuple[tuple[int, ...], Array]:
    """Return the time column, the date column if it is separate, and the time of each row [s].

    A WinCC panel writes two times; the one with the finer resolution is used.
    """
    names = tuple(plain_name(name).lower() for name in sheet.header)
    if asked.time is not None:
        place = choose_column(sheet, "time", asked.time)
    else:
        clocks = [i for i, name in enumerate(sheet.header) if role_of(name) == "time"]
        if not clocks:
            raise LogError("the file has no time column", file=sheet.file, expected="--time-column NAME or N")
        place = min(clocks, key=lambda i: is_second_choice(sheet.header[i]))
    if names == _WINCC and names[place] == "timestring":
        _refine(sheet, place)
    columns = Columns(index={"time": place}, names={"time": _name(sheet, place)})
    sheet, columns = with_dates(sheet, columns, asked.date)
    return tuple(columns.index.values()), seconds(sheet, columns, unit, None, [])[0]


def _refine(sheet: Sheet, place: int) -> None:
    """Put the time of WinCC's Time_ms, millionths of days, in place of the stamp in whole seconds."""
    try:
        moments = [_FIRST_DAY + timedelta(days=float(row[-1]) / 1e6) for row in sheet.rows]
    except (ValueError, OverflowError):
        return
    for row, moment in zip(sheet.rows, moments, strict=True):
        row[place] = moment.isoformat(" ", "milliseconds")


_ZONE: Final = re.compile(r"(Z|UTC|[+-]\d\d:?\d\d)$")
_NEAR: Final = 1.0  # length of the log by which the power may end before it


def with_power_rows(sheet: Sheet, powers: Sheet, asked: ReadSettings) -> tuple[Sheet, ReadSettings]:
    """Return a sheet with the rows of another file's power, blank where a file has no value, and how to read it.

    Args:
        sheet: of the temperature.
        powers: a table of the same tags, or of time and power; `power_column` is a column of it.
        asked: how to read them.

    Raises:
        LogError: no power in the other file, times that cannot be compared, files without a common time.
    """
    repairs = (*sheet.repairs, f"The power was read from {powers.file}.")
    tag, value = places(sheet, TagSelection(temperature=asked.tag, power=asked.power_tag, setpoint=asked.setpoint_tag,
                                            column=asked.tag_column, value=asked.temperature_column))
    if sheet.header == powers.header and tag is not None and value is not None:
        return replace(sheet, rows=[*sheet.rows, *powers.rows], lines=[*sheet.lines, *powers.lines],
                       repairs=repairs), asked
    wanted = {"time": asked.time_column, "temperature": asked.temperature_column, "power": NO_COLUMN}
    sheet, own = with_dates(sheet, find_columns(
        sheet, {role: column for role, column in wanted.items() if column is not None}), asked.date_column)
    power = _power_place(powers, asked)
    powers, other = with_dates(powers, find_columns(
        powers, {"temperature": power + 1, "power": NO_COLUMN, "setpoint": NO_COLUMN}), None)
    at_s, power_s = _common_s(sheet, own, powers, other, asked.time_unit)
    time, width = own.index["time"], len(sheet.rows[0])
    instants, lines, rows = at_s.tolist(), [*sheet.lines], [[*row, ""] for row in sheet.rows]
    first = {instant: k for k, instant in reversed([*enumerate(instants)])}
    for instant, row, line in zip(power_s.tolist(), powers.rows, powers.lines, strict=True):
        k = first.get(instant)
        if k is None or rows[k][width]:  # else of a reading's own row
            k = len(rows)
            rows.append([row[other.index["time"]] if i == time else "" for i in range(width + 1)])
            instants.append(instant)
            lines.append(line)
        rows[k][width] = row[power]
    order = np.argsort(instants, kind="stable").tolist()
    name = powers.header[power] if powers.header and role_of(powers.header[power]) == "power" else "power"
    unit = powers.units[power] if powers.units else ""
    return replace(
        sheet, header=(*sheet.header, name) if sheet.header else (), repairs=repairs,
        units=(*(sheet.units or ("",) * width), unit) if sheet.units or unit else (),
        rows=[rows[k] for k in order], lines=[lines[k] for k in order],
    ), replace(asked, power_column=str(width + 1), date_column=None)


def _power_place(powers: Sheet, asked: ReadSettings) -> int:
    """Return the column of the power: as stated, by its name, or the only one with numbers beside the time."""
    if asked.power_column is not None:
        return choose_column(powers, "power", asked.power_column)
    names = powers.header or tuple(f"{i + 1}" for i in range(len(powers.rows[0])))
    candidates = [i for i, name in enumerate(powers.header) if role_of(name) == "power"] or [
        i for i, name in enumerate(names) if role_of(name) != "time" and (i > 0 or powers.header)
        and (all(is_number(row[i]) for row in powers.rows) or on_or_off([row[i] for row in powers.rows]))]
    if len(candidates) != 1:
        found = f"no column is a power ({', '.join(names)})" if not candidates else (
            f"several columns may be the power ({', '.join(names[i] for i in candidates)})")
        raise LogError(found, file=powers.file, expected="--power-column with a column of this file")
    return candidates[0]


def _common_s(sheet: Sheet, own: Columns, powers: Sheet, other: Columns, unit: str | None) -> tuple[Array, Array]:
    """Return the instants of both files from the first row of the temperature, shapes (n,) and (m,) [s]."""
    if "time" not in other.index or "time" not in own.index:
        file = sheet if "time" not in own.index else powers
        raise LogError("the file has no time column", file=file.file, expected="a time in both files")
    first, second = (each.rows[0][place.index["time"]] for each, place in ((sheet, own), (powers, other)))
    units = own.unit("time"), other.unit("time")
    ways = {
        f"as {first!r}": is_number(first) == is_number(second),
        "a time zone in both files or in none": (_ZONE.search(first) is None) == (_ZONE.search(second) is None),
        f"--time-unit {units[0] or units[1]}, if both are in {units[0] or units[1]}":
            unit is not None or not is_number(first) or units[0] == units[1]}
    for expected, holds in ways.items():
        if not holds:
            raise LogError("a time that cannot be compared with those of the other file", file=powers.file,
                           line=powers.lines[0], column=other.names["time"], value=second, expected=expected)
    row = list(sheet.rows[0])
    row[own.index["time"]] = second
    both = replace(sheet, rows=[sheet.rows[0], row], lines=[sheet.lines[0], powers.lines[0]])
    begins = np.diff(seconds(both, own, unit, None, [])[0])[0]
    at_s, power_s = (seconds(each, place, unit, None, [])[0] for each, place in ((sheet, own), (powers, other)))
    for each, place, time in ((sheet, own, at_s), (powers, other, power_s)):
        if len(back := np.flatnonzero(np.diff(time) < 0.0)):
            raise LogError("the time goes backwards", file=each.file, line=each.lines[back[0] + 1],
                           column=place.names["time"], value=each.rows[back[0] + 1][place.index["time"]],
                           expected="one run in each of the two files, in the order of its time")
    at_s, power_s = at_s - at_s[0], np.round(power_s - power_s[0] + begins, 6)
    if power_s[0] > at_s[-1] or power_s[-1] < -_NEAR * at_s[-1]:
        raise LogError("powers from another time than the temperatures", file=powers.file, line=powers.lines[0],
                       value=second, expected=f"times near {first}")
    return np.round(at_s, 6), power_s
