"""What was found while reading → what was taken, in one value."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np

from heatertune.log.cells import Sheet
from heatertune.log.clock import ASSUMED, TIME_UNITS, likely_time_unit
from heatertune.log.columns import NO_COLUMN, Columns
from heatertune.log.numbers import Array
from heatertune.log.power import Power
from heatertune.log.read_summary import UNIT_OPTIONS, Option, ReadSummary
from heatertune.log.tags import TagTable
from heatertune.settings import ReadSettings

__all__ = ["SIGNS", "FileNotation", "RowCounts", "TemperatureUnit", "stated_units", "taken_of"]

#: unit of a temperature → how it is written
SIGNS: Final = {
    "degC": "°C", "degF": "°F", "K": "K", "0.1degC": "0.1 °C", "0.01degC": "0.01 °C", "0.1degF": "0.1 °F"}


class TemperatureUnit(NamedTuple):
    """Unit of the temperature.

    Attributes:
        name: the unit.
        assumed: whether neither the file nor the user states it.
        evidence: of an assumed unit, what excludes every other; empty: nothing does.
        likely: of an assumed unit, the unit to propose.
    """

    name: str
    assumed: bool
    evidence: str = ""
    likely: str = ""


class FileNotation(NamedTuple):
    """How time, temperature and power were written; without a power None; which of the units the user states."""

    clock: str
    temperature: TemperatureUnit
    power: Power | None
    stated: frozenset[str] = frozenset()


class RowCounts(NamedTuple):
    """Rows of a file.

    Attributes:
        read: that could have been readings, those aside that `TagTable` left out.
        repeats: that only repeated the one before.
        filled: in which a setpoint was put in.
        put_back: that the file does not hold because nothing had changed.
    """

    read: int
    repeats: int
    filled: int
    put_back: int = 0


def taken_of(
    file: str, sheet: Sheet, columns: Columns, tagged: TagTable, *, time: Array, written: FileNotation,
    counts: RowCounts,
    options: Mapping[str, Option],
) -> ReadSummary:
    """Return what was taken.

    Args:
        file: its name, as told to people.
        sheet: the rows that were read.
        columns: which column is what.
        tagged: what was done about tags and flags.
        time: of the readings that stayed, shape (n,) [s].
        written: how its numbers were written.
        counts: how many rows were what.
        options: what the user or the file said about its rows.
    """
    clock, temperature, power, stated = written
    grounds = temperature.evidence or "assumed"
    how = {
        "time": clock, "temperature": SIGNS[temperature.name] + (f", {grounds}" if temperature.assumed else ""),
        "power": "" if power is None else power.written, "setpoint": "", "disturbance": "",
    }
    used = {role: (_names(sheet, columns, role), how[role]) for role in columns.index if role in how}
    if clock == "counted":
        used["time"] = ("row", f"{options['sample_time_s']:g} s")
    if power is None:
        used.pop("power", None)
    return ReadSummary(
        file=file, rows=len(time), interval_s=float(np.median(np.diff(time))) if len(time) > 1 else 0.0, columns=used,
        rows_read=counts.read + tagged.lost, left_out=counts.read + tagged.lost + counts.put_back - len(time),
        repeats=counts.repeats, repaired=counts.filled, unused=tagged.unused or _unused(sheet, columns, tagged, clock),
        reading=_reading(sheet, columns, tagged, written, options), assumed=_assumed(written, time), stated=stated,
    )


def stated_units(asked: ReadSettings) -> frozenset[str]:
    """Return the roles whose unit the user states."""
    stated = {role for role, option in UNIT_OPTIONS.items() if getattr(asked, option) is not None}
    return frozenset(stated | ({"time"} if asked.sample_time_s is not None else set()))


def _assumed(written: FileNotation, time: Array) -> dict[str, str]:
    """Return role → option that states its unit, of each unit without evidence: the likeliest one, to be checked."""
    likely = {}
    if written.clock.endswith(ASSUMED):
        likely["time"] = likely_time_unit(time)
    if written.temperature.assumed and not written.temperature.evidence:
        likely["temperature"] = written.temperature.likely or written.temperature.name
    if written.power is not None and written.power.written.endswith(ASSUMED):
        likely["power"] = f"{written.power.likely_full_scale:g}"
    return {role: f"--{UNIT_OPTIONS[role].replace('_', '-')} {unit}" for role, unit in likely.items()}


def _names(sheet: Sheet, columns: Columns, role: str) -> str:
    """Return a column as it is told: 'T1', 'Date' + 'Time', column 3 of a file without names."""
    roles = ("date", role) if role == "time" and "date" in columns.index else (role,)
    names = [columns.names[part] for part in roles]
    return " + ".join(f"'{name}'" if sheet.header else f"column {name}" for name in names)


def _unused(sheet: Sheet, columns: Columns, tagged: TagTable, clock: str) -> tuple[str, ...]:
    used = {i for role, i in columns.index.items() if role != "time" or clock != "counted"}
    flags = {tagged.options.get("quality_column"), tagged.options.get("tag_column")}
    names = sheet.header or [f"{i + 1}" for i in range(len(sheet.rows[0]))]
    return tuple(name for i, name in enumerate(names) if i not in used and name not in flags)


def _reading(
    sheet: Sheet, columns: Columns, tagged: TagTable, written: FileNotation, options: Mapping[str, Option]
) -> dict[str, Option]:
    """Return the options that repeat the reading, in the order in which people read a command."""
    reading: dict[str, Option] = {name: value for name, value in options.items() if value}
    if not tagged.is_long:
        reading |= {f"{role}_column": _reference(sheet, i) for role, i in columns.index.items()
                    if role != "time" or written.clock != "counted"}
        reading |= {f"{role}_column": NO_COLUMN for role in ("power", "setpoint") if role not in columns.index}
    reading |= tagged.options
    unit = written.clock.partition(",")[0]
    if unit in TIME_UNITS:
        reading["time_unit"] = unit
    reading["temperature_unit"] = written.temperature.name
    if written.power is not None:
        reading["power_full_scale"] = written.power.full_scale
    return reading


def _reference(sheet: Sheet, i: int) -> str:
    """Return the name of a column where it has one of its own, else its number."""
    name = sheet.header[i] if sheet.header else ""
    is_own = name and sheet.header.count(name) == 1 and not name.isdecimal() and name != NO_COLUMN
    return name if is_own else f"{i + 1}"
