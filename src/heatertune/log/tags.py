"""Rows of several tags: a long table (tag, time, value, quality) → one row per reading; one tag of a wide table.

Also resampling a series with its own time stamps at those of another by sample and hold.

The power from a file of its own: its rows are put among those of the temperature, each at its own instant.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime, timedelta
from itertools import chain
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.errors import LogError
from heatertune.log.columns import NO_COLUMN, Columns, choose_column, find_columns, seconds, with_dates
from heatertune.log.partial_rows import (
    demand_one_heater_by_name,
    good_rows,
    is_quality,
    on_change,
    turn_of,
    with_heaters_in_tags,
)
from heatertune.log.quantities import (
    is_number,
    is_quantity,
    is_second_choice,
    is_switch_word,
    on_or_off,
    plain_name,
    plain_quantities,
    role_of,
    says_nothing,
    unit_in_name,
)
from heatertune.log.sheet import CellColumn, Sheet
from heatertune.log.side_columns import likely_power, quoted, scale_question
from heatertune.log.timestamps import has_zone, stamp
from heatertune.settings import ReadSettings
from heatertune.units import count

__all__ = ["HeldSeries", "TagSelection", "TagTable", "by_tags", "changes_twice", "hold_series", "places",
           "with_power_rows"]


_FEW_LEVELS: Final = 5  # of a power that is switched between them: a mean would be neither
_SWITCHED: Final = 0.01  # share of the intervals in which a power changes more than once


class HeldSeries(NamedTuple):
    """Cells at the requested instants.

    Attributes:
        cells: one for each instant.
        late: number of the instants before the first value.
        notes: the repairs.
        rows: the value that each cell repeats, shape (n,).
        unit: of the cells, if it is a new one.
    """

    cells: CellColumn
    late: int
    notes: list[str]
    rows: npt.NDArray[np.intp]
    unit: str = ""


def hold_series(at: Array, time: Array, cells: CellColumn, *, is_power: bool) -> HeldSeries:
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
    source_rows = np.maximum(places, 0)
    values = cells.at_rows(source_rows)
    if not is_power:
        notes = [f"The setpoint of the first {count(late, 'row')} is taken from after."] if late else []
        return HeldSeries(values, 0, notes, source_rows)
    notes = [f"{count(late, 'row')} before the first power left out."] if late else []
    switched = on_or_off(cells)
    moved = _latest(at, time, cells)
    twice = changes_twice(at, time, cells)
    means = _means(at, time, cells, switched) if twice or (moved > 0.0 and cells.levels() > _FEW_LEVELS) else None
    if means is not None:
        changes = "more than once " if twice else ""
        notes.append(f"The power changes {changes}between readings; its mean over each interval was taken.")
        values = CellColumn.of(repr(float(mean) * (1.0 if switched is None else 100.0)) for mean in means)
    elif moved > 0.0:
        notes.append(f"The power is held to the next reading, up to {moved:.3g} s after it changed.")
    return HeldSeries(values, late, notes, source_rows, "%" if switched is not None and means is not None else "")


def _changes(time: Array, cells: CellColumn) -> Array:
    return time[1:][cells.differs()[1:]]


def _latest(at: Array, time: Array, cells: CellColumn) -> float:
    """Return the longest time from a change to the first reading that shows it [s]."""
    changes = _changes(time, cells)
    changes = changes[(changes > at[0]) & (changes <= at[-1])]
    return float(np.max(at[np.searchsorted(at, changes)] - changes, initial=0.0))


def changes_twice(at: Array, time: Array, cells: CellColumn) -> bool:
    """Return whether a power changes more than once in some of the intervals between the instants `at`.

    Args:
        at: instants of the readings of the temperature [s], shape (n,).
        time: instants of the rows with a power [s], shape (m,).
        cells: the power in each of these rows, as in the file.
    """
    in_each = np.histogram(_changes(time, cells), bins=at)[0] if len(at) > 1 else np.zeros(1)
    return bool(np.count_nonzero(in_each > 1) > _SWITCHED * len(at))


def _means(at: Array, time: Array, cells: CellColumn, switched: Array | None) -> Array | None:
    """Return the mean over each interval; None if the power is not a number."""
    values = cells.floats() if switched is None else switched
    if values is None:
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
    r"|kanal|series|metric|measurement|field|item|symbol|topic|messstelle|bezeichnung|parameter|((node|statistic) ?)?id"
    r"|zone)",
    re.IGNORECASE)
_VALUE: Final = re.compile(r"(var ?)?(value|wert|messwert|state|reading|val|mean)( ?[\[(].*)?", re.IGNORECASE)
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
        index: role → number of its column for a long table, otherwise empty.
        lost_s: instants of lost readings of the temperature, counted from the first row, ascending [s].
    """

    sheet: Sheet
    lost: int = 0
    unused: tuple[str, ...] = ()
    options: Mapping[str, str] = field(default_factory=dict)
    index: Mapping[str, str | int] = field(default_factory=dict)
    lost_s: tuple[float, ...] = ()

    @property
    def is_long(self) -> bool:
        """Whether the file was a long table."""
        return bool(self.index)


def by_tags(sheet: Sheet, selection: TagSelection, time_unit: str | None) -> TagTable:
    """Return the rows of one heater.

    Raises:
        LogError: tags or flags that are ambiguous or do not exist.
    """
    sheet = _with_long_header(sheet)
    if turn_of(selection.temperature) is not None:  # rows are selected by their turn, not by a tag
        selection = replace(selection, temperature=None, column=NO_COLUMN)
    quality, options = _quality_place(sheet, selection), {}
    good = np.ones(len(sheet), dtype=np.bool_) if quality is None else good_rows(sheet, quality)
    if quality is not None:
        options["quality_column"] = _name(sheet, quality)
    elif selection.quality is not None:
        options["quality_column"] = NO_COLUMN
    tag, value = places(sheet, selection)
    if tag is not None and value is not None:
        return _pivoted(with_heaters_in_tags(sheet, tag), selection, tag, value, good, time_unit, options)
    _demand_long(sheet, selection)
    if selection.column == NO_COLUMN:
        options["tag_column"] = NO_COLUMN
    elif selection.temperature is None:
        demand_one_heater_by_name(sheet)
    if selection.temperature is not None:
        own_tag = None if selection.column is None else tag
        sheet, good, tag_options = _one_tag(sheet, selection.temperature, own_tag, good)
        options |= tag_options
    if not np.all(good):
        sheet = _without_bad(sheet, good)
    return TagTable(sheet=sheet, lost=int(np.count_nonzero(~good)), options=options)


def _with_long_header(sheet: Sheet) -> Sheet:
    """Return a table without names with those of a long one, if its cells are a time, one of few texts, and a value."""
    if sheet.header or len(sheet.columns) < _LEAST_COLUMNS:
        return sheet
    some = {i: column[:_SAMPLE_ROWS] for i, column in enumerate(sheet.columns)}
    clocks = [i for i, cells in some.items() if all(stamp(cell) is not None for cell in cells)]
    tags = [i for i, cells in some.items() if i not in clocks and not any(map(is_number, cells))
            and 1 < sheet.columns[i].levels() <= len(sheet) // 4]
    values = [i for i, cells in some.items() if i not in (*clocks, *tags)
              and sum(is_number(cell) or is_quantity(cell) for cell in cells) > len(cells) / 2]
    if len(clocks) != 1 or len(tags) != 1 or len(values) != 1:
        return sheet
    names = {clocks[0]: "time", tags[0]: "tag", values[0]: "value"}
    note = "The file has no header; by its cells a table of time, tag and value."
    return replace(sheet, header=tuple(names.get(i, f"column {i + 1}") for i in some), repairs=(*sheet.repairs, note))


_LEAST_COLUMNS: Final = 3
_SAMPLE_ROWS: Final = 50


def _demand_long(sheet: Sheet, selection: TagSelection) -> None:
    """Refuse options for a long table that would have no effect."""
    unheard = [_OPTIONS[role] for role in _ROLES[1:] if getattr(selection, role) is not None]
    if selection.column not in (None, NO_COLUMN) and selection.temperature is None:
        unheard.append("--tag-column without --tag")
    if unheard:
        raise LogError(f"no long table (tag, time, value), so {unheard[0]} means nothing", file=sheet.file,
                       expected="--temperature-column with its column of values, or no such option")


def _quality_place(sheet: Sheet, selection: TagSelection) -> int | None:
    if selection.quality == NO_COLUMN:
        return None
    if selection.quality is not None:
        return choose_column(sheet, "quality", selection.quality)
    return next((i for i, name in enumerate(sheet.header) if is_quality(name)), None)


def places(sheet: Sheet, selection: TagSelection) -> tuple[int | None, int | None]:
    """Return the columns of the tags and, in a long table, of their values."""
    tag_columns = [i for i, name in enumerate(sheet.header) if _TAG.fullmatch(plain_name(name))]
    tag = next((i for i in tag_columns if _repeats(sheet, i)), None) if selection.column is None else (
        None if selection.column == NO_COLUMN else choose_column(sheet, "tag", selection.column))
    values = [i for i, name in enumerate(sheet.header) if i != tag and _VALUE.fullmatch(plain_name(name))]
    others = [name for i, name in enumerate(sheet.header) if i not in (tag, *values)]
    is_wide = {"temperature", "power"} & set(map(role_of, others))
    if selection.value is not None and (selection.power is not None or selection.setpoint is not None):
        return tag, choose_column(sheet, "temperature", selection.value)
    if is_wide or not values or (selection.value is not None and choose_column(sheet, "temperature",
                                                                           selection.value) not in values):
        return tag, None
    return tag, values[0] if selection.value is None else choose_column(sheet, "temperature", selection.value)


def _repeats(sheet: Sheet, i: int) -> bool:
    """Return whether a column holds few texts again and again: tags, not the numbers of the rows."""
    return sheet.columns[i].levels() <= max(1, len(sheet) // 4)


def _name(sheet: Sheet, i: int) -> str:
    return sheet.names()[i]


def _one_tag(sheet: Sheet, wanted: str, tag: int | None,
             good: npt.NDArray[np.bool_]) -> tuple[Sheet, npt.NDArray[np.bool_], dict[str, str]]:
    """Return the rows of one tag of a wide table."""
    if tag is None:
        tag = next((i for i, column in enumerate(sheet.columns) if wanted in column.kinds()), None)
    if tag is None or wanted not in sheet.columns[tag].kinds():
        raise LogError("no cell holds the tag", file=sheet.file, value=wanted, expected="--tag-column, and a tag of it")
    places = sheet.columns[tag].where(wanted.__eq__)
    note = f"Of {len(sheet)} rows the {np.count_nonzero(places)} whose {_name(sheet, tag)!r} is {wanted!r} were read."
    sheet = replace(sheet.at_rows(places), repairs=(*sheet.repairs, note))
    return sheet, good[places], {"tag": wanted, "tag_column": _name(sheet, tag)}


def _without_bad(sheet: Sheet, good: npt.NDArray[np.bool_]) -> Sheet:
    if not np.any(good):
        raise LogError("no row is of good quality", file=sheet.file, expected="--quality-column none to read all rows")
    return replace(sheet.at_rows(good), repairs=(*sheet.repairs, _bad(sheet, ~good)))


def _bad(sheet: Sheet, bad: npt.NDArray[np.bool_]) -> str:
    rows = np.flatnonzero(bad)
    lines = ", ".join(f"line {sheet.line_name(row)}" for row in rows[:5])
    more = f" and {len(rows) - 5} more" if len(rows) > 5 else ""
    return f"{count(len(rows), 'row')} whose quality is not good left out ({lines}{more})."


def _pivoted(sheet: Sheet, selection: TagSelection, tag: int, value: int, good: npt.NDArray[np.bool_],
             time_unit: str | None, options: Mapping[str, str]) -> TagTable:
    """Return the long table with a row for each reading of the temperature."""
    of_tag, values = sheet.columns[tag], sheet.columns[value]
    tags = list(dict.fromkeys(of_tag))
    roles = _roles(sheet, tags, tag, selection)
    sheet, clock, time = _time(sheet, selection, time_unit)
    good = good & ~values.where(says_nothing)
    bad = of_tag.where(lambda name: name in roles.values()) & ~good
    series = {role: _series(of_tag.where(name.__eq__), good, time) for role, name in roles.items()}
    for role, places in series.items():
        _demand_order(sheet, role, roles[role], time[places], places)
    rows, edges = _with_edges(sheet, value, series, time)
    others = {role: hold_series(time[rows], time[places], values.at_rows(places), is_power=role == "power")
              for role, places in series.items() if role != "temperature"}
    late = max((other.late for other in others.values()), default=0)
    if late == len(rows):
        raise LogError(f"no reading of the tag {roles['temperature']!r} after the first of the power", file=sheet.file,
                       expected=f"another {_OPTIONS['power']}, or {_OPTIONS['power']} none")
    power_lines = None if "power" not in others else sheet.lines[series["power"][others["power"].rows[late:]]]
    parts = ", ".join(f"{name!r} as the {role}" for role, name in roles.items())
    repairs = [f"The table is long: of its column {_name(sheet, tag)!r}, {parts}, was read."]
    repairs += [_bad(sheet, bad)] if np.any(bad) else []
    units = {role: others[role].unit if role in others else "" for role in series}
    absent = [role for role in _ROLES if role not in series]
    return TagTable(
        sheet=replace(
            sheet, comment=(), units=(), lines=sheet.lines[rows[late:]], power_lines=power_lines,
            header=(sheet.header[clock[0]], *(_with_unit(sheet, tag, roles[role], units[role]) for role in series)),
            columns=(sheet.columns[clock[0]].at_rows(rows[late:]), _blanked(values, rows[late:], edges),
                     *(other.cells.at_rows(slice(late, None)) for other in others.values())),
            repairs=(*sheet.repairs, *repairs, *(note for other in others.values() for note in other.notes))),
        lost=int(np.count_nonzero(bad)) + late,
        unused=_unused(sheet, tags, roles, (tag, value, *clock), options.get("quality_column")),
        options={**options, "tag": roles["temperature"], "power_tag": roles.get("power", NO_COLUMN),
                 "setpoint_tag": roles.get("setpoint", NO_COLUMN), "tag_column": _name(sheet, tag),
                 "temperature_column": _name(sheet, value), "time_column": sheet.header[clock[0]]},
        index={role: NO_COLUMN if role in absent else n + 1 for n, role in enumerate(["time", *series, *absent])},
        lost_s=tuple(time[of_tag.where(roles["temperature"].__eq__) & ~good] - time[rows[late]]))


def _with_edges(sheet: Sheet, value: int, series: Mapping[str, npt.NDArray[np.intp]],
                time: Array) -> tuple[npt.NDArray[np.intp], frozenset[int]]:
    """Return the rows of the temperature and those of the power's changes between them, and which the latter are.

    Where the temperature is not written on change, so that its value there has to be put on a line, they are not many;
    of a power that changes more than once between two readings its mean is taken, see `hold_series`.
    """
    rows = series["temperature"]
    if "power" not in series:
        return rows, frozenset()
    power = series["power"]
    cells = sheet.columns[value].at_rows(power)
    changed = power[1:][cells.differs()[1:]]
    within = (time[changed] > time[rows[0]]) & (time[changed] < time[rows[-1]])
    edges = changed[within & ~np.isin(time[changed], time[rows])]
    many = len(edges) > _MOST_EDGES * len(rows) or changes_twice(time[rows], time[power], cells)
    if many and not _stands(sheet, value, rows, time):
        return rows, frozenset()
    both = np.concatenate([rows, edges])
    return both[np.argsort(time[both], kind="stable")], frozenset(edges.tolist())


def _blanked(cells: CellColumn, rows: npt.NDArray[np.intp], edges: frozenset[int]) -> CellColumn:
    """Return the cells of some rows, empty in those that hold another power alone."""
    texts = cells.at_rows(rows)
    return texts if not edges else CellColumn.of(
        "" if k in edges else cell for k, cell in zip(rows.tolist(), texts, strict=True))


def _stands(sheet: Sheet, value: int, rows: npt.NDArray[np.intp], time: Array) -> bool:
    """Return whether the temperature is written on change."""
    cells = sheet.columns[value].at_rows(rows)
    plain = plain_quantities(cells)
    readings = (cells if plain is None else plain[0]).floats()
    return readings is not None and on_change(time[rows], readings) is not None


def _unused(sheet: Sheet, tags: Sequence[str], roles: Mapping[str, str], places: Sequence[int],
            flag: str | None) -> tuple[str, ...]:
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
        raise LogError(f"the time of the tag {name!r} goes backwards", file=sheet.origin(places[back[0] + 1])[0],
                       line=sheet.origin(places[back[0] + 1])[1])


def _with_unit(sheet: Sheet, tag: int, name: str, unit: str) -> str:
    """Return a tag as the name of a column: with the unit of a column of units, and never like a column's number."""
    plain = f"tag {name}" if name.isdecimal() else name
    place = next((i for i, head in enumerate(sheet.header) if _UNIT.fullmatch(plain_name(head))), None)
    if not unit and place is not None:
        unit = next((unit for unit, of_tag in zip(sheet.columns[place], sheet.columns[tag], strict=True)
                     if unit and of_tag == name), "")
    return f"{plain} [{unit}]" if unit else plain


def _roles(sheet: Sheet, tags: Sequence[str], tag: int, selection: TagSelection) -> dict[str, str]:
    """Return role → tag: as requested, otherwise if the names are unambiguous."""
    listed = f"{', '.join(tags[:_SHOWN])}{', …' if len(tags) > _SHOWN else ''}"
    tags_by_role = {role: getattr(selection, role) for role in _ROLES}
    for role, name in tags_by_role.items():
        if name is not None and name not in tags and (name != NO_COLUMN or role == "temperature"):
            raise LogError(f"column {_name(sheet, tag)!r} holds no tag", file=sheet.file, value=name,
                           expected=f"{_OPTIONS[role]}, one of {listed}")
    free = [name for name in tags if name not in tags_by_role.values()]
    in_degrees = _tags_in_degrees(sheet, tag, selection)
    tag_of: dict[str, str] = {}
    for role, name in tags_by_role.items():
        likely = [tag_name for tag_name in free if _role_of_tag(tag_name) == role]
        if role == "temperature":
            likely += [tag_name for tag_name in free if _role_of_tag(tag_name) is None and tag_name in in_degrees]
        likely = [tag_name for tag_name in likely if not is_second_choice(tag_name)] or likely
        if len(tags) == 1 and role == "temperature" and _role_of_tag(tags[0]) in (None, "time"):
            likely = list(tags)
        if name is None and (len(likely) > 1 or (role == "temperature" and not likely)):
            several = f"{len(likely)} tags may be the {role} ({', '.join(likely[:_SHOWN])})" if likely else (
                f"no tag is plainly the {role} ({listed})")
            others = "" if role != "temperature" or tags_by_role["power"] else " and --power-tag NAME or none"
            raise LogError(several, file=sheet.file, column=_name(sheet, tag),
                           expected=f"{_OPTIONS[role]} NAME" + (others if role == "temperature" else " or none"))
        if name is None and not likely and role == "power":
            _demand_no_likely_power(sheet, [each for each in free if each not in tag_of.values()], tag, selection)
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
    for name, cell in zip(sheet.columns[tag], sheet.columns[value], strict=True):
        first.setdefault(name, cell)
    return frozenset(name for name, cell in first.items()
                     if is_quantity(cell) and unit_in_name("temperature", f"[{cell.split()[-1]}]"))


def _demand_no_likely_power(sheet: Sheet, tags: Sequence[str], tag: int, selection: TagSelection) -> None:
    """Refuse to pass over a tag that may be the power by its values, see `likely_power`.

    Raises:
        LogError: there is one, or several.
    """
    value = places(sheet, selection)[1]
    if value is None:
        return
    scales = {}
    for name in tags:
        if _role_of_tag(name) is None:
            cells = sheet.columns[value].at_rows(sheet.columns[tag].where(name.__eq__))
            figures, unit, _ = plain_quantities(cells) or (cells, "", False)
            if likely_power(name, figures, in_percent=unit == "%"):
                scales[name] = scale_question(name, figures, unit)
    for name, scale in scales.items():
        names = " or ".join(map(quoted, [*scales][:_SHOWN]))
        raise LogError(f"no tag is named as the power, but {names} may be it by its values", file=sheet.file,
                       expected=f"--power-tag {quoted(name)}{scale}, or --power-tag none")


def _role_of_tag(name: str) -> str | None:
    """Return the role denoted by a tag: Zone1/Temperature, TIC101.OP, switch.heater."""
    *before, last = re.split(r"[./\\:|!]", name)
    role = role_of(last) or role_of(name)
    return "power" if role in (None, "time") and before[:1] == ["switch"] else role


def _time(sheet: Sheet, selection: TagSelection, unit: str | None) -> tuple[Sheet, tuple[int, ...], Array]:
    """Return the sheet with whole instants, the columns of time and of a separate date, and the time of each row [s].

    A WinCC panel writes two times; the one with the finer resolution is used.
    """
    names = tuple(plain_name(name).lower() for name in sheet.header)
    if selection.time is not None:
        place = choose_column(sheet, "time", selection.time)
    else:
        clocks = [i for i, name in enumerate(sheet.header) if role_of(name) == "time"]
        if not clocks:
            raise LogError("the file has no time column", file=sheet.file, expected="--time-column NAME or N")
        place = min(clocks, key=lambda i: is_second_choice(sheet.header[i]))
    if names == _WINCC and names[place] == "timestring":
        sheet = _refined(sheet, place)
    columns = Columns(index={"time": place}, names={"time": _name(sheet, place)})
    sheet, columns = with_dates(sheet, columns, selection.date)
    return sheet, tuple(columns.index.values()), seconds(sheet, columns, unit, None, []).values


def _refined(sheet: Sheet, place: int) -> Sheet:
    """Return the sheet with WinCC's Time_ms, millionths of days, in place of the stamp in whole seconds."""
    def moment(cell: str) -> str:
        return (_FIRST_DAY + timedelta(days=float(cell) / 1e6)).isoformat(" ", "milliseconds")

    try:
        return sheet.with_column(place, sheet.columns[-1].map(moment))
    except (ValueError, OverflowError):
        return sheet


_REPEATS: Final = 0.02  # of the rows of a power's file may repeat the one before, if it holds its changes
_NEAR: Final = 1.0  # length of the log by which the power may end before it


def with_power_rows(sheet: Sheet, powers: Sheet, settings: ReadSettings) -> tuple[Sheet, ReadSettings]:
    """Return a sheet with the rows of another file's power, blank where a file has no value, and how to read it.

    Args:
        sheet: of the temperature.
        powers: a table of the same tags, or of time and power; `power_column` is a column of it.
        settings: how to read them.

    Raises:
        LogError: no power in the other file, times that cannot be compared, files without a common time.
    """
    repairs = (*sheet.repairs, f"The power was read from {powers.file}.")
    tag, value = places(sheet, TagSelection(
        temperature=settings.tag, power=settings.power_tag, setpoint=settings.setpoint_tag, column=settings.tag_column,
        value=settings.temperature_column))
    sheet = replace(sheet, repairs=repairs, other_file=powers.file)
    if sheet.header == powers.header and tag is not None and value is not None:
        both = (CellColumn.of(chain(*cells)) for cells in zip(sheet.columns, powers.columns, strict=True))
        return replace(sheet, columns=tuple(both), lines=np.concatenate([sheet.lines, -powers.lines])), settings
    column_names = {"time": settings.time_column, "temperature": settings.temperature_column, "power": NO_COLUMN}
    sheet, own = with_dates(sheet, find_columns(
        sheet, {role: column for role, column in column_names.items() if column is not None}), settings.date_column)
    power = _power_place(powers, settings)
    powers, other = with_dates(powers, find_columns(
        powers, {"temperature": power + 1, "power": NO_COLUMN, "setpoint": NO_COLUMN}), None)
    at_s, power_s = common_instants(sheet, own, powers, other, settings.time_unit)
    width = len(sheet.columns)
    instants, lines, power_lines = at_s.tolist(), sheet.lines.tolist(), [0] * len(sheet)
    powers_of, times = [""] * len(sheet), list[str]()
    first = {instant: k for k, instant in reversed([*enumerate(instants)])}
    changes = powers.columns[power].differs()
    changes[:1] = True
    sampled = np.count_nonzero(changes) < (1.0 - _REPEATS) * len(changes)
    for k in np.flatnonzero(changes).tolist():
        instant, clock, cell = power_s[k], powers.columns[other.index["time"]][k], powers.columns[power][k]
        row = first.get(float(instant))
        if row is None or powers_of[row]:  # else of a reading's own row
            powers_of.append(cell)
            times.append(clock)
            instants.append(float(instant))
            lines.append(-int(powers.lines[k]))
            power_lines.append(lines[-1])
        else:
            powers_of[row], power_lines[row] = cell, -int(powers.lines[k])
    order = np.argsort(instants, kind="stable")
    name = powers.header[power] if powers.header and role_of(powers.header[power]) == "power" else "power"
    unit = powers.units[power] if powers.units else ""
    added = (times if i == own.index["time"] else [""] * len(times) for i in range(width))
    columns = [CellColumn.of(chain(*cells)) for cells in zip(sheet.columns, added, strict=True)]
    return replace(
        sheet, header=(*sheet.header, name) if sheet.header else (),
        units=(*(sheet.units or ("",) * width), unit) if sheet.units or unit else (),
        columns=tuple(column.at_rows(order) for column in (*columns, CellColumn.of(powers_of))),
        lines=np.array(lines, dtype=np.int64)[order], power_lines=np.array(power_lines, dtype=np.int64)[order],
        power_every_s=float(np.median(np.diff(power_s))) if sampled else 0.0,
    ), replace(settings, power_column=str(width + 1), date_column=None)


def _power_place(powers: Sheet, settings: ReadSettings) -> int:
    """Return the column of the power: as stated, by its name, or the only one with numbers beside the time."""
    if settings.power_column is not None:
        return choose_column(powers, "power", settings.power_column)
    names = powers.names()
    candidates = [i for i, name in enumerate(powers.header) if role_of(name) == "power"] or [
        i for i, name in enumerate(names) if role_of(name) != "time" and (i > 0 or powers.header)
        and any(all(map(holds, powers.columns[i].kinds())) for holds in (is_number, is_switch_word))]
    if len(candidates) != 1:
        problem = f"no column is a power ({', '.join(names)})" if not candidates else (
            f"several columns may be the power ({', '.join(names[i] for i in candidates)})")
        raise LogError(problem, file=powers.file, expected="--power-column with a column of this file")
    return candidates[0]


def common_instants(sheet: Sheet, own: Columns, powers: Sheet, columns: Columns,
                    unit: str | None) -> tuple[Array, Array]:
    """Return the instants of two files from the first row of the first file, shapes (n,) and (m,) [s].

    Args:
        sheet: the first file.
        own: its columns.
        powers: the other file.
        columns: its columns.
        unit: of a time in numbers; None: from its name or digits.

    Raises:
        LogError: times that cannot be compared, go backwards, or of another day.
    """
    if "time" not in columns.index or "time" not in own.index:
        file = sheet if "time" not in own.index else powers
        raise LogError("the file has no time column", file=file.file, expected="a time in both files")
    first, second = (each.columns[place.index["time"]][0] for each, place in ((sheet, own), (powers, columns)))
    units = own.unit("time"), columns.unit("time")
    ways = {
        f"as {first!r}": is_number(first) == is_number(second),
        "a time zone in both files or in none": has_zone(first) == has_zone(second),
        f"--time-unit {units[0] or units[1]}, if both are in {units[0] or units[1]}":
            unit is not None or not is_number(first) or units[0] == units[1]}
    for expected, holds in ways.items():
        if not holds:
            raise LogError("a time that cannot be compared with those of the other file", file=powers.file,
                           line=int(powers.lines[0]), column=columns.names["time"], value=second, expected=expected)
    both = sheet.at_rows(np.zeros(2, dtype=np.intp)).with_column(own.index["time"], [first, second])
    begins = np.diff(seconds(both, own, unit, None, []).values)[0]
    at_s, power_s = (seconds(each, place, unit, None, []).values for each, place in ((sheet, own), (powers, columns)))
    for each, place, time in ((sheet, own, at_s), (powers, columns, power_s)):
        if len(back := np.flatnonzero(np.diff(time) < 0.0)):
            raise LogError("the time goes backwards", file=each.file, line=int(each.lines[back[0] + 1]),
                           column=place.names["time"], value=each.columns[place.index["time"]][int(back[0]) + 1],
                           expected="one run in each of the two files, in the order of its time")
    at_s, power_s = at_s - at_s[0], np.round(power_s - power_s[0] + begins, 6)
    if power_s[0] > at_s[-1] or power_s[-1] < -_NEAR * at_s[-1]:
        raise LogError("a log from another time than the first one", file=powers.file, line=int(powers.lines[0]),
                       value=second, expected=f"times near {first}")
    return np.round(at_s, 6), power_s
