"""Read a log: a file, or the objects of a session (DataFrame, arrays), becomes a `Log`.

All findings of the reader are collected in one value.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.errors import InputError, LogError, OutOfRange
from heatertune.log.cells import plain_cells, read_sheet
from heatertune.log.cleaning import (
    in_order,
    no_readings,
    one_run,
    rows_to_keep,
    spread_instants,
    tell_gaps,
    without_strays,
    without_unreadable_power,
    without_unset_clock,
)
from heatertune.log.columns import (
    CLOCK_UNITS,
    NO_COLUMN,
    Columns,
    cell_error,
    demand_one_form,
    find_columns,
    forwards,
    numbers,
    seconds,
    with_clock_parts,
    with_dates,
    with_names,
)
from heatertune.log.log_values import (
    ABSOLUTE_ZERO_DEGC,
    AS_ROOM,
    BUILT_IN,
    ON_CHANGE,
    SAMPLES,
    UNIT_OPTIONS,
    BuiltIn,
    Log,
    LogSignal,
    Option,
    ReadSummary,
    built_in,
)
from heatertune.log.partial_rows import (
    Mask,
    held_readings,
    on_change,
    rows_of_one_heater,
    spread,
    stale_readings,
    without_blank_power,
)
from heatertune.log.power_range import power_moves, power_of, with_one_unit, with_switch
from heatertune.log.quantities import ROLES, is_scaled, on_or_off, says_nothing
from heatertune.log.sheet import Sheet
from heatertune.log.side_columns import SIDE_ROLES, is_cooling, moving_heaters, quoted
from heatertune.log.tags import TagSelection, TagTable, by_tags, common_instants, with_power_rows
from heatertune.log.timestamps import TIME_UNITS, likely_time_unit
from heatertune.options import merge_options, with_options
from heatertune.settings import ReadSettings
from heatertune.units import count, degF_to_degC, kelvin_to_degC
from heatertune.writing import display_name

if TYPE_CHECKING:
    from typing import Unpack

    from pandas import DataFrame

    from heatertune.keywords import ReadOptions

__all__ = ["SIGNS", "RowCounts", "clock_shifts_s", "log_of", "read_log", "stated_units", "taken_of"]


#: unit of a temperature → how it is written
SIGNS: Final = {"degC": "°C", "degF": "°F", "K": "K", "0.1degC": "0.1 °C", "0.01degC": "0.01 °C", "0.1degF": "0.1 °F"}


class RowCounts(NamedTuple):
    """Rows of a file.

    Attributes:
        read: that could have been readings, those aside that `TagTable` left out.
        repeats: that only repeated the one before.
        filled: in which a setpoint was put in.
        used: that hold a reading, or another power alone.
    """

    read: int
    repeats: int
    filled: int
    used: int


def taken_of(file: str, sheet: Sheet, columns: Columns, tagged: TagTable, *, signals: Mapping[str, LogSignal],
             stated: frozenset[str], counts: RowCounts, options: Mapping[str, Option]) -> ReadSummary:
    """Return the summary of the reading.

    Args:
        file: its name for messages.
        sheet: the rows that were read.
        columns: which column is what.
        tagged: result of the selection of tags and flags.
        signals: of each role, those of the readings that were kept.
        stated: roles whose unit the user states.
        counts: number of rows of each kind.
        options: options for its rows, from the user or the file.
    """
    time, counted = signals["time"].values, signals["time"].unit == "counted"
    how = {role: signals[role].written if role in signals else "" for role in (*ROLES, *SIDE_ROLES)}
    lost = tagged.lost + sheet.lost
    used = {role: (_names(sheet, columns, role), how[role]) for role in columns.index if role in how}
    if counted:
        used["time"] = ("row", f"{options['sample_time_s']:g} s")
    return ReadSummary(
        file=file, rows=len(time), interval_s=float(np.median(np.diff(time))) if len(time) > 1 else 0.0, columns=used,
        rows_read=counts.read + lost, left_out=counts.read + lost - counts.used, repeats=counts.repeats,
        repaired=counts.filled, unused=tagged.unused or _unused(sheet, columns, tagged, counted=counted),
        moving_heaters=() if tagged.is_long else moving_heaters(sheet, columns.index),
        reading=_reading(sheet, columns, tagged, signals, options), assumed=_assumed(signals), stated=stated)


def stated_units(settings: ReadSettings) -> frozenset[str]:
    """Return the roles whose unit the user states."""
    stated = {role for role, option in UNIT_OPTIONS.items() if getattr(settings, option) is not None}
    stated |= {"power"} if settings.power_levels is not None else set()
    return frozenset(stated | ({"time"} if settings.sample_time_s is not None else set()))


def _assumed(signals: Mapping[str, LogSignal]) -> dict[str, str]:
    """Return role → option that states its unit, of each unit without evidence: the likeliest one, to be checked."""
    unknown = {role: signals[role] for role in UNIT_OPTIONS if role in signals and not signals[role].evidence}
    return {role: f"--{UNIT_OPTIONS[role].replace('_', '-')} {signal.likely or likely_time_unit(signal.values)}"
            for role, signal in unknown.items()}


def _names(sheet: Sheet, columns: Columns, role: str) -> str:
    """Return the name of a column for messages: 'T1', 'Date' + 'Time', column 3 of a file without names."""
    roles = ("date", role) if role == "time" and "date" in columns.index else (role,)
    names = [columns.names[part] for part in roles]
    return " + ".join(f"'{name}'" if sheet.header else f"column {name}" for name in names)


def _unused(sheet: Sheet, columns: Columns, tagged: TagTable, *, counted: bool) -> tuple[str, ...]:
    used = {i for role, i in columns.index.items() if role != "time" or not counted}
    flags = {tagged.options.get("quality_column"), tagged.options.get("tag_column")}
    return tuple(name for i, name in enumerate(sheet.names()) if i not in used and name not in flags)


def _reading(sheet: Sheet, columns: Columns, tagged: TagTable, signals: Mapping[str, LogSignal],
             options: Mapping[str, Option]) -> dict[str, Option]:
    """Return the options that repeat the reading, in the order in which people read a command."""
    reading: dict[str, Option] = {name: value for name, value in options.items() if value}
    if not tagged.is_long:
        reading |= {f"{role}_column": _reference(sheet, i) for role, i in columns.index.items()
                    if role != "time" or signals["time"].unit != "counted"}
        reading |= {f"{role}_column": NO_COLUMN for role in ("power", "setpoint") if role not in columns.index}
    reading |= tagged.options
    if (unit := signals["time"].unit) in TIME_UNITS or unit in CLOCK_UNITS:
        reading["time_unit"] = unit
    reading["temperature_unit"] = signals["temperature"].unit
    power = signals.get("power")
    if power is not None and power.levels is not None:
        reading["power_levels"] = power.levels
    elif power is not None:
        reading["power_full_scale"] = power.full_scale
    return reading


def _reference(sheet: Sheet, i: int) -> str:
    """Return the name of a column if it is unique, otherwise its number."""
    name = sheet.header[i] if sheet.header else ""
    is_own = name and sheet.header.count(name) == 1 and not name.isdecimal() and name != NO_COLUMN
    return name if is_own else f"{i + 1}"


_TO_DEGC: Final[dict[str, Callable[[Any], Any]]] = {
    "degC": lambda value: value, "degF": degF_to_degC, "K": kelvin_to_degC, "0.1degC": lambda value: 0.1 * value,
    "0.01degC": lambda value: 0.01 * value, "0.1degF": lambda value: degF_to_degC(0.1 * value)}
_KELVIN: Final = 250.0  # no heater log lies wholly above 250 °C without saying so, and every room is above 250 K
_ROOM_DEGF: Final = (55.0, 110.0)  # 13…43 °C
_ROOM_DEGC: Final = (15.0, 30.0)  # in °F, in kelvins and in tenths of a degree no heater rests there
_WITHIN: Final = 1.5  # intervals between two readings: a power that is late by no more is as in any other log
_BELOW_FIRST: Final = 0.1  # fraction of the span by which a heater's log may fall below its start
_POSSIBLE_DEGC: Final = (-90.0, 2000.0)  # colder than any place on earth; hotter than any electric heater


@with_options(ReadSettings)
def read_log(source: str | Path | IO[Any] | DataFrame, settings: ReadSettings | None = None, *,
             content: bytes | None = None, power_content: bytes | None = None, **changed: Unpack[ReadOptions]) -> Log:
    """Read a temperature log.

    Titles, header or none; comma, semicolon, tab or spaces; decimal comma or point; seconds or time stamps; °C, °F or
    K; power as 0…1, 0…100, 0…255, on and off; one column each, or a long table of tags. The names of the columns or the
    options decide. `Log.taken` contains the interpretation, `Log.repairs` the changes and assumptions.

    Args:
        source: path of a CSV file, an open one, a table of pandas, or "table3" / "table4", the paper's tables.
        settings: how to read the file; None: detect everything.
        content: of the file, if it is on another machine; `source` is then only its name.
        power_content: the same of the power's own file, `power_log`.
        changed: fields of `ReadSettings` that differ from `settings`.

    Raises:
        InputError: a source of another type.
        LogError: content that cannot be interpreted, with file, line, column and value.
        UnknownName: a unit that does not exist.
    """
    options = merge_options(ReadSettings, settings, changed, also=("settings", "content", "power_content"))
    if not isinstance(source, str | Path):
        source, content = _handed(source)
    is_built_in = isinstance(source, str) and source.lower() in BUILT_IN and content is None
    table = built_in(str(source).lower()) if is_built_in else None
    sheet, doubts = _opened(Path(source), table, content, options)
    sheet, options = _with_power_log(sheet, options, power_content)
    sheet, options = with_switch(sheet, options)
    tagged, sheet, columns = _placed(sheet, options)
    sheet, columns = with_one_unit(sheet, columns, options.power_full_scale)
    repairs = [*sheet.repairs, *columns.notes]
    if options.sample_time_s is None:
        sheet = without_strays(sheet, columns, repairs)
    clock = seconds(sheet, columns, options.time_unit, options.sample_time_s, repairs)
    sheet, time = forwards(sheet, clock.values, repairs)
    sheet, time = in_order(*without_unset_clock(sheet, time, repairs), repairs)
    sheet, time, chosen_run = one_run(sheet, columns, time, options.run, repairs)
    time = spread_instants(sheet, columns, time, repairs)
    sheet, time, edges = without_blank_power(sheet, columns, time, repairs)
    sheet, time, edges = without_unreadable_power(sheet, columns, time, edges, repairs)
    raw, edges, held_rows = _readings(sheet, columns, edges, repairs, skip_empty=options.skip_empty)
    valid, repeats = rows_to_keep(sheet, columns, time, repairs)
    valid &= ~(held_rows | no_readings(sheet, columns, raw, time, repairs, edges=edges, skip_empty=options.skip_empty,
                                       moves=power_moves(sheet, columns)))
    raw *= options.temperature_scale or 1.0
    unit = _temperature_unit(sheet, columns, options, raw[valid & ~edges], repairs, doubts)
    setpoint, filled = _setpoint(sheet, columns, unit.unit, options.temperature_scale or 1.0, repairs)
    disturbance, filled_disturbance = _disturbance(sheet, columns, repairs)
    temperature = _in_degC(sheet, columns, "temperature", unit.unit, raw, valid)
    power = power_of(sheet, columns, options.power_full_scale, repairs, doubts, levels=options.power_levels,
                     temperature_degC=np.where(valid, temperature, np.nan),
                     others=_assumed({"time": clock, "temperature": unit}).values())
    every: dict[str, LogSignal | None] = {
        "time": clock._replace(values=time), "temperature": unit._replace(values=temperature),
        "power": _with_cooling(sheet, columns, power, repairs), "setpoint": setpoint, "disturbance": disturbance,
        "ambient": _setpoint(sheet, columns, unit.unit, 1.0, repairs, role="ambient")[0]}
    signals, continued = _on_own_clocks(
        {role: signal._replace(values=signal.values[valid]) for role, signal in every.items() if signal is not None},
        edges[valid], tagged.lost_s, repairs, recorded=sheet.recorded, power_every_s=sheet.power_every_s)
    tell_gaps(signals["time"].values, np.abs(sheet.lines)[valid][continued], "power" in signals, doubts)
    summary = taken_of(
        table.name if table else display_name(Path(source).name), sheet, columns, tagged, signals=signals,
        stated=stated_units(options), counts=RowCounts(
            read=len(time), repeats=repeats, filled=filled + filled_disturbance, used=int((valid | held_rows).sum())),
        options={"sample_time_s": options.sample_time_s, "run": chosen_run, "skip_empty": options.skip_empty,
                 "errata": options.errata, "skip_rows": max(options.skip_rows, sheet.above),
                 "temperature_scale": options.temperature_scale, "decimal_comma": options.decimal_comma,
                 "tag": sheet.part or None, "power_log": options.power_log, "power_on": options.power_on})
    return _log(source, table, sheet, signals, tuple(repairs), tuple(doubts), summary)


def _placed(sheet: Sheet, settings: ReadSettings) -> tuple[TagTable, Sheet, Columns]:
    """Return which tags were selected, the cells, and which column is what."""
    columns_of = {role: getattr(settings, f"{role}_column") for role in (*ROLES, *SIDE_ROLES)}
    column_names = {role: column for role, column in columns_of.items() if column is not None}
    tags = TagSelection(
        temperature=None if sheet.part else settings.tag, power=settings.power_tag, setpoint=settings.setpoint_tag,
        column=settings.tag_column, quality=settings.quality_column, value=settings.temperature_column,
        time=settings.time_column, date=settings.date_column)
    tagged = by_tags(sheet, tags, settings.time_unit)
    if tagged.is_long:
        _demand_no_sides(sheet, column_names, tagged.unused)
    sheet = plain_cells(tagged.sheet, settings.decimal_comma) if tagged.is_long else tagged.sheet
    columns = find_columns(
        sheet, tagged.index or column_names, counted=settings.sample_time_s is not None, stated=stated_units(settings))
    demand_one_form(sheet, columns, settings.decimal_comma)
    sheet = rows_of_one_heater(sheet, columns, settings, is_long=tagged.is_long)
    sheet, columns = with_clock_parts(*with_dates(sheet, columns, None if tagged.is_long else settings.date_column))
    return tagged, sheet, columns


def clock_shifts_s(paths: Sequence[Path], settings: ReadSettings) -> list[float]:
    """Return for each of several files what added to the time of its log gives that of the first file's clock [s].

    Args:
        paths: of the files.
        settings: how each is read.

    Raises:
        LogError: files whose times cannot be compared, go backwards, or are of different days.
    """
    if settings.sample_time_s is not None:
        return [0.0] * len(paths)
    placed = [_placed(_opened(path, None, None, settings)[0], settings)[1:] for path in paths]
    sheet, own = placed[0]
    begins_s = [float(common_instants(sheet, own, *each, settings.time_unit)[1][0]) for each in placed]
    return [begin_s - float(seconds(each, columns, settings.time_unit, None, []).values[0])
            for begin_s, (each, columns) in zip(begins_s, placed, strict=True)]


def _demand_no_sides(sheet: Sheet, wanted: Mapping[str, str | int], unused: Sequence[str]) -> None:
    """Refuse columns of a cooler, a disturbance or the room, and a cooler's tag, of a table with a row for each tag."""
    cooling = next(filter(is_cooling, unused), None)
    if cooling is not None and "cooling" not in wanted:
        raise LogError("a tag of a cooler's power, which is not read from a table with a row for each tag",
                       file=sheet.file, value=cooling,
                       expected="a table with a column for each; or --cooling-column none if it was off")
    for role in SIDE_ROLES:
        if wanted.get(role, NO_COLUMN) != NO_COLUMN:
            raise LogError(f"a table with a row for each tag has no column of {_SIDE_NAMES[role]}", file=sheet.file,
                           value=str(wanted[role]), expected="a table with a column for each")


def _readings(sheet: Sheet, columns: Columns, edges: Mask, repairs: list[str], *,
              skip_empty: bool) -> tuple[Array, Mask, Mask]:
    """Return the column of the temperature, NaN without a reading, the rows for a power alone, and those for nothing.

    The last hold the reading before, and no other power.

    Raises:
        LogError: as `numbers`: a cell without a reading that is neither such a row nor to be left out.
    """
    explained = bool(np.any(edges)) and bool(np.all(
        edges | ~sheet.columns[columns.index["temperature"]].where(says_nothing)))
    raw = numbers(sheet, columns, "temperature", holes=skip_empty or explained,
                  blank="a number (--skip-empty leaves such rows out)", lenient=True)
    finite_rows = np.flatnonzero(~np.isnan(raw))
    between = np.zeros(len(raw), dtype=np.bool_)
    if len(finite_rows):
        between[finite_rows[0]:finite_rows[-1]] = np.isnan(raw[finite_rows[0]:finite_rows[-1]])
    hold = held_readings(raw)
    if hold.any():
        repairs.append(f"The sensor is read in every {len(hold) / np.count_nonzero(~hold):.0f}th row; the rows between "
                       "hold its reading.")
    stale = stale_readings(raw) & ~hold
    if stale.any():
        repairs.append(f"{count(int(stale.sum()), 'reading')} left out that repeat the one before while others near "
                       f"them move: a sensor or bus that hangs (first: line {sheet.line_name(int(stale.argmax()))}).")
        hold |= stale
    powered = hold & ("power" in columns.index and sheet.columns[columns.index["power"]].differs())
    return raw, (edges & between) | powered, hold & ~powered


def _on_own_clocks(signals: Mapping[str, LogSignal], edges: Mask, lost_s: Sequence[float], repairs: list[str], *,
                   recorded: bool, power_every_s: float) -> tuple[dict[str, LogSignal], npt.NDArray[np.intp]]:
    """Return the signals with their instants, and the row that each reading continues.

    Readings that were not written since nothing changed are put back. The power may have changed before the row that
    shows it: up to the row before, where no row is there for the power alone, or an interval of the file that samples
    the power alone.

    Args:
        signals: the values of all rows, of the time as well.
        edges: rows for another power alone, without a reading, shape (n,).
        lost_s: instants of lost readings since the first row [s].
        repairs: list to which it is added what was put back.
        recorded: whether each reading was written.
        power_every_s: interval of a file that samples the power alone, else 0 [s].
    """
    rows, source = signals["time"].values, np.flatnonzero(~edges)
    time, temperature = rows[source], signals["temperature"].values[source]
    moved = np.zeros(len(rows), dtype=np.bool_)
    for role in signals.keys() & {"power", "setpoint"}:
        moved[1:] |= np.diff(signals[role].values) != 0.0
    own = ~(moved[source] & np.array([False, *(np.diff(temperature) == 0.0)]))
    usual_s = float(np.median(np.diff(time[own]))) if np.count_nonzero(own) > 1 else 0.0
    late_s = power_every_s if power_every_s > _WITHIN * usual_s else 0.0
    written = None if recorded else on_change(time[own], temperature[own])  # a recorder writes each reading
    if "power" in signals and written is not None:
        alone = np.ones(len(rows), dtype=np.bool_)
        alone[source[own]] = False
        late_s = late_s or _late_s(rows, signals["power"].values, alone, written.interval_s)
    between = SAMPLES
    if written is not None:
        readings = spread(time, temperature, written, np.array(lost_s) + rows[0])
        put_back = len(readings.source) - len(source)
        source, time, temperature = source[readings.source], readings.time_s, readings.temperature
        if put_back:
            between = ON_CHANGE
            repairs.append(
                f"The temperature is written where it changes by {written.step_degC:.3g} °C; {put_back} rows in which "
                f"it stood were put back, {written.interval_s:.3g} s apart.")
    changes = np.ones(len(rows), dtype=np.bool_)
    own_clocks = {}
    for role, signal in signals.items():
        if len(time) != len(rows):
            changes[1:] = np.diff(signal.values) != 0.0
        clock = time if len(time) == len(rows) else rows[changes]
        own_clocks[role] = signal._replace(values=signal.values[changes], time_s=clock)
    own_clocks["time"] = signals["time"]._replace(values=time, time_s=time)
    own_clocks["temperature"] = signals["temperature"]._replace(values=temperature, between=between, time_s=time)
    if "power" in signals:
        own_clocks["power"] = own_clocks["power"]._replace(late_s=late_s)
    return own_clocks, source


def _late_s(time: Array, power: Array, alone: Mask, interval_s: float) -> float:
    """Return by how much a power may have changed before its row, where all its rows are readings' as well [s]."""
    changed = np.flatnonzero(np.diff(power) != 0.0) + 1
    if not len(changed) or np.any(alone[changed]):
        return 0.0
    late_s = float(np.max(time[changed] - time[changed - 1]))
    return late_s if late_s > _WITHIN * interval_s else 0.0


def _handed(source: Any) -> tuple[str, bytes]:
    """Return name and content of an open file, or of a table of pandas as a file would hold it."""
    if hasattr(source, "to_csv") and hasattr(source, "columns"):
        return "frame", _csv(source)
    if not hasattr(source, "read"):
        raise InputError(f"not a log: {type(source).__name__}; expected a path, an open file, or a pandas table")
    content = source.read()
    return str(getattr(source, "name", "file")), content.encode() if isinstance(content, str) else content


def _csv(frame: DataFrame) -> bytes:
    """Return a table of pandas as a file would hold it, spans of time as seconds by their name."""
    frame = frame.copy(deep=False)
    counted = frame.index.name is None and frame.index.dtype.kind in "iu"
    label = frame.index.name or "time"
    if frame.index.dtype.kind == "m":
        frame.index = frame.index / np.timedelta64(1, "s")
        label = f"{label} [s]"
    for name in [name for name in frame.columns if frame[name].dtype.kind == "m"]:
        frame[name] = frame[name] / np.timedelta64(1, "s")
        frame = frame.rename(columns={name: f"{name} [s]"})
    return str(frame.to_csv(index=not counted, index_label=label)).encode()


def _opened(source: Path, table: BuiltIn | None, content: bytes | None,
            settings: ReadSettings) -> tuple[Sheet, list[str]]:
    """Return the cells of a file with plain numbers, and the doubts about a built-in table."""
    sheet = with_names(read_sheet(table.path if table else source, content, settings.skip_rows, settings.tag,
                                  settings.decimal_comma, skip_empty=settings.skip_empty))
    if not len(sheet):
        raise LogError("the file holds a header and no readings", file=sheet.file, expected="at least 20 rows")
    doubts = list(table.doubts if table else ())
    if table:
        sheet = _errata(table, sheet, settings.errata, doubts)
    return plain_cells(sheet, settings.decimal_comma), doubts


def _with_power_log(sheet: Sheet, settings: ReadSettings, content: bytes | None) -> tuple[Sheet, ReadSettings]:
    """Return the cells with those of the power's own file, if it has one, and how to read them."""
    if settings.power_log is None:
        return sheet, settings
    return with_power_rows(sheet, _opened(Path(settings.power_log), None, content, ReadSettings())[0], settings)


def _log(source: str | Path, table: BuiltIn | None, sheet: Sheet, signals: Mapping[str, LogSignal],
         repairs: tuple[str, ...], doubts: tuple[str, ...], taken: ReadSummary) -> Log:
    shown = {role: signal for role, signal in signals.items() if role != "time"}
    if "power" in shown:
        net = shown["power"]
        shown["power"] = net._replace(values=np.maximum(net.values, 0.0))
        if np.any(net.values < 0.0):
            shown["cooling"] = net._replace(values=np.maximum(-net.values, 0.0))
    try:
        return Log(
            name=table.name if table else display_name(Path(source).stem),
            source=table.source if table else display_name(str(source)), repairs=repairs, warnings=doubts,
            same_heater=table.same_heater if table else (), taken=taken,
            rests_at_degC=table.rests_at_degC if table else None,
            output_limit_pct=table.output_limit_pct if table else None, pwm_period_s=sheet.pwm_period_s, signals=shown)
    except OutOfRange as problem:
        raise LogError(str(problem), file=sheet.file) from problem


def _errata(table: BuiltIn, sheet: Sheet, apply: bool, doubts: list[str]) -> Sheet:
    """Correct the known misprints of a built-in table, or add them to the doubts."""
    repairs = list(sheet.repairs)
    for erratum in table.errata:
        place = f"line {erratum.line}, {erratum.column}"
        misprint = f"{place}: {erratum.printed} is a misprint for {erratum.corrected}"
        if not apply:
            doubts.append(f"{misprint} ({erratum.reason}); left as printed.")
            continue
        i, row = sheet.header.index(erratum.column), int(np.flatnonzero(sheet.lines == erratum.line)[0])
        column = sheet.columns[i]
        sheet = sheet.with_column(i, [*column[:row], str(erratum.corrected), *column[row + 1:]])
        repairs.append(f"{misprint} ({erratum.reason}); corrected.")
    return replace(sheet, repairs=tuple(repairs))


def _temperature_unit(sheet: Sheet, columns: Columns, settings: ReadSettings, values: Array, repairs: list[str],
                      doubts: list[str]) -> LogSignal:
    """Return how the temperature is written; its values are those of the file, shape (n,)."""
    name, header_unit, option = columns.names["temperature"], columns.unit("temperature"), settings.temperature_unit
    unit, scaled = option or header_unit, is_scaled("temperature", name) and settings.temperature_scale is None
    if settings.temperature_scale is not None:
        repairs.append(f"The temperature was multiplied by {settings.temperature_scale:g}, as stated.")
    if unit is not None and not (scaled and option is None):
        if unit != "degC":
            repairs.append(f"The temperature is in {unit} {'as stated' if option else 'by its name'} and was converted "
                           "to °C.")
        return LogSignal(values, unit, SIGNS[unit], between=SAMPLES)
    if unit == "degF":
        return LogSignal(values, unit, SIGNS[unit], "", "0.1degF", between=SAMPLES)
    lowest, highest, first = float(np.min(values)), float(np.max(values)), float(values[0])
    least, most = _POSSIBLE_DEGC
    if columns.is_foreign("temperature") or lowest >= _KELVIN or lowest < least or highest > most:
        raise LogError(f"readings from {lowest:g} up to {highest:g} whose unit is not known", file=sheet.file,
                       column=name, expected=_by_room(first))
    if not scaled and _starts_at_room(values):
        repairs.append(f"The temperature has no unit in the file; taken as °C, because it starts at {first:g}, a room "
                       "temperature only in °C.")
        return LogSignal(values, "degC", SIGNS["degC"], AS_ROOM, between=SAMPLES)
    repairs.append("The temperature has no unit in the file; taken as °C (otherwise: --temperature-unit).")
    likely = _likely(first, scaled=scaled)
    if _ROOM_DEGF[0] <= first <= _ROOM_DEGF[1] or likely != "degC":
        sign = SIGNS["degF" if likely == "degC" else likely]
        doubts.append(f"The first reading, {first:g}, taken as °C, would be a room temperature in {sign}.")
    return LogSignal(values, "degC", SIGNS["degC"], "", likely, between=SAMPLES)


def _by_room(first: float) -> str:
    """Return the options to choose from, the one first with which the first reading is a room's temperature."""
    likely = next((unit for unit in _TO_DEGC if _ROOM_DEGC[0] <= _TO_DEGC[unit](first) <= _ROOM_DEGC[1]), "degC")
    units = ", ".join([likely, *(unit for unit in _TO_DEGC if unit != likely)][:-1]) + f" or {[*_TO_DEGC][-1]}"
    ways = [f"--temperature-unit {units}", "--temperature-scale 0.001, or another factor of all readings"]
    return "; or ".join(ways[::-1] if _ROOM_DEGC[0] <= 0.001 * first <= _ROOM_DEGC[1] else ways)


def _starts_at_room(values: Array) -> bool:
    """Return whether readings begin at a room's temperature in °C, and rise from there."""
    least, most = _ROOM_DEGC
    first, span = float(values[0]), float(np.ptp(values))
    rises = float(np.max(values)) > first + span / 2.0
    return least <= first <= most and rises and first - float(np.min(values)) <= _BELOW_FIRST * span


def _likely(first: float, *, scaled: bool) -> str:
    """Return the unit in which the first reading is likeliest a room's."""
    units = [unit for unit in _TO_DEGC if unit.startswith("0.") or not scaled]
    return next((unit for unit in units if _ROOM_DEGC[0] <= _TO_DEGC[unit](first) <= _ROOM_DEGC[1]), units[0])


def _in_degC(sheet: Sheet, columns: Columns, role: str, unit: str, raw: Array, mask: Mask) -> Array:
    values = np.asarray(_TO_DEGC[unit](raw))
    least, most = _POSSIBLE_DEGC
    for outside, problem in ((values < ABSOLUTE_ZERO_DEGC, "below absolute zero:"),
                             ((values < least) | (values > most), "a temperature that no heater reaches:")):
        rows = np.flatnonzero(mask & outside)
        if len(rows):
            other = "--setpoint-column none" if role == "setpoint" else "--temperature-unit"
            expected = f"{least:g}…{most:g} °C, here in {unit} (else: {other})"
            raise cell_error(sheet, columns, role, int(rows[0]), problem, expected)
    return values


def _setpoint(sheet: Sheet, columns: Columns, unit: str, scale: float, repairs: list[str],
              role: str = "setpoint") -> tuple[LogSignal | None, int]:
    """Return the setpoint, in the temperature's unit unless its name states another, and the number of filled cells.

    With the role "ambient", the same of the room's temperature.

    Empty cells repeat the last value; those before the first value take the first.
    """
    if role not in columns.index:
        return None, 0
    raw, filled = _filled_column(sheet, columns, role, repairs)
    if filled == len(raw):
        repairs.append(f"The column of the {role} is empty; no {role} was read.")
        return None, 0
    own = columns.unit(role) or unit
    raw = raw * scale
    if own != unit:
        repairs.append(f"The {role} is in {own} by its name.")
    everywhere = np.ones(len(raw), dtype=np.bool_)
    return LogSignal(_in_degC(sheet, columns, role, own, raw, everywhere)), filled


_SIDE_NAMES: Final = {"cooling": "a cooler", "disturbance": "a disturbance", "ambient": "the room's temperature"}
_IDLE: Final = 1.0  # %: a controller that heats and cools switches one of them off


def _with_cooling(sheet: Sheet, columns: Columns, power: LogSignal | None, repairs: list[str]) -> LogSignal | None:
    """Return the power, below 0 that of a cooler in a column of its own.

    Raises:
        LogError: a cell that is no power of a cooler; heater and cooler are on at once.
    """
    if "cooling" not in columns.index or power is None:
        return power
    if np.any(power.values < 0.0):
        repairs.append("The power goes below 0 where it cools; the column of the cooler was not needed.")
        return power
    switched = on_or_off(sheet.columns[columns.index["cooling"]])
    header_unit = columns.unit("cooling")
    full = 1.0 if switched is not None else float(header_unit) if header_unit else power.full_scale
    values = switched if switched is not None else _filled_column(sheet, columns, "cooling", repairs)[0]
    other = "--cooling-column none --disturbance-column " + quoted(columns.names["cooling"])
    for wrong, problem, expected in (
        ((values < 0.0) | (values > full), "power of the cooler out of range:",
         f"0…{full:g}, as the heater's power (else: {other}, in a unit of its own)"),
        ((values > _IDLE / 100.0 * full) & (power.values > _IDLE), "heater and cooler are on at once:",
         f"one of them at 0; a cooler that is no part of the controller is a disturbance: {other}")):
        if len(rows := np.flatnonzero(wrong)):
            raise cell_error(sheet, columns, "cooling", int(rows[0]), problem, expected)
    return power._replace(values=np.where(values > 0.0, -100.0 * values / full, power.values))


def _disturbance(sheet: Sheet, columns: Columns, repairs: list[str]) -> tuple[LogSignal | None, int]:
    """Return the column that the user names as a disturbance, in its own unit, and how many cells were filled.

    On and off are 1 and 0; an empty cell is filled as one of the setpoint.

    Raises:
        LogError: a cell that is no number, or no cell that holds one.
    """
    if "disturbance" not in columns.index:
        return None, 0
    switched = on_or_off(sheet.columns[columns.index["disturbance"]])
    if switched is not None:
        repairs.append("The disturbance is on or off; taken as 1 and 0.")
        return LogSignal(switched), 0
    values, filled = _filled_column(sheet, columns, "disturbance", repairs)
    if filled == len(values):
        raise LogError("the column of the disturbance is empty", file=sheet.file,
                       column=columns.names["disturbance"], expected="numbers, or on and off in every row")
    return LogSignal(values), filled


def _filled_column(sheet: Sheet, columns: Columns, role: str, repairs: list[str]) -> tuple[Array, int]:
    """Return a column, its empty cells holding the last value, those before the first that one; and how many."""
    raw = numbers(sheet, columns, role, holes=True)
    written = np.flatnonzero(~np.isnan(raw))
    filled = len(raw) - len(written)
    if filled and len(written):
        raw = raw[written[np.maximum(np.searchsorted(written, np.arange(len(raw)), side="right") - 1, 0)]]
        repairs.append(f"The {role} is empty in {count(filled, 'row')}; the last one was held there.")
    return raw, filled


def log_of(data: Log | str | Path | IO[Any] | DataFrame | tuple[npt.ArrayLike, ...]) -> Log:
    """Convert the argument to a log.

    Args:
        data: a log; what `read_log` reads: path or built-in name, an open file, a table of pandas; or the columns
            (time_s, temperature_degC, power_pct), all of shape (n,), with the power omitted or None if it was not
            logged.

    Raises:
        InputError: another type, or columns that are not numbers.
        LogError: as `read_log`.
        OutOfRange: as `Log`.
    """
    if isinstance(data, Log):
        return data
    if isinstance(data, str | Path) or hasattr(data, "read") or hasattr(data, "columns"):
        return read_log(data)
    if not isinstance(data, tuple) or not 2 <= len(data) <= 3:
        raise InputError(f"not a log: {type(data).__name__}; expected a log, a path, an open file, a pandas table, or "
                         "arrays (time_s, temperature_degC, power_pct)")
    time, temperature, *rest = data
    power = _numbers("power_pct", rest[0]) if rest and rest[0] is not None else None
    return Log(name="arrays", source="arrays", time_s=_numbers("time_s", time),
               temperature_degC=_numbers("temperature_degC", temperature), power_pct=power)


def _numbers(name: str, column: npt.ArrayLike) -> npt.NDArray[np.float64]:
    try:
        numbers = np.asarray(column, dtype=np.float64)
    except (TypeError, ValueError) as problem:
        raise InputError(f"{name}: not an array of numbers") from problem
    if numbers.ndim != 1:
        raise InputError(f"{name}: an array of shape {numbers.shape}; expected (n,)")
    return numbers
