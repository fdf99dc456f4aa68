"""The power from a file of its own: its rows are put among those of the temperature, each at its own instant."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Final

import numpy as np

from heatertune.arrays import Array
from heatertune.errors import LogError
from heatertune.log.cells import Sheet
from heatertune.log.columns import NO_COLUMN, Columns, choose_column, find_columns, seconds, with_dates
from heatertune.log.quantities import is_number, on_or_off, role_of
from heatertune.log.tags import TagSelection, places
from heatertune.settings import ReadSettings

__all__ = ["with_power_rows"]

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
    row_at = {instant: [*row, ""] for instant, row in zip(at_s.tolist(), sheet.rows, strict=True)}
    line_at = dict(zip(at_s.tolist(), sheet.lines, strict=True))
    for instant, row, line in zip(power_s.tolist(), powers.rows, powers.lines, strict=True):
        blank = [row[other.index["time"]] if i == time else "" for i in range(width + 1)]
        row_at.setdefault(instant, blank)[width] = row[power]
        line_at.setdefault(instant, line)
    order = sorted(row_at)
    name = powers.header[power] if powers.header and role_of(powers.header[power]) == "power" else "power"
    unit = powers.units[power] if powers.units else ""
    return replace(
        sheet, header=(*sheet.header, name) if sheet.header else (), repairs=repairs,
        units=(*(sheet.units or ("",) * width), unit) if sheet.units or unit else (),
        rows=[row_at[instant] for instant in order], lines=[line_at[instant] for instant in order],
    ), replace(asked, power_column=str(width + 1), date_column=None)


def _power_place(powers: Sheet, asked: ReadSettings) -> int:
    """Return the column of the power: as stated, by its name, or the only one with numbers beside the time."""
    if asked.power_column is not None:
        return choose_column(powers, "power", asked.power_column)
    names = powers.header or tuple(f"{i + 1}" for i in range(len(powers.rows[0])))
    places_ = [i for i, name in enumerate(powers.header) if role_of(name) == "power"] or [
        i for i, name in enumerate(names) if role_of(name) != "time" and (i > 0 or powers.header)
        and (all(is_number(row[i]) for row in powers.rows) or on_or_off([row[i] for row in powers.rows]))]
    if len(places_) != 1:
        found = f"no column is a power ({', '.join(names)})" if not places_ else (
            f"several columns may be the power ({', '.join(names[i] for i in places_)})")
        raise LogError(found, file=powers.file, expected="--power-column with a column of this file")
    return places_[0]


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
    at_s, power_s = at_s - at_s[0], np.round(power_s - power_s[0] + begins, 6)
    if power_s[0] > at_s[-1] or power_s[-1] < -_NEAR * at_s[-1]:
        raise LogError("powers from another time than the temperatures", file=powers.file, line=powers.lines[0],
                       value=second, expected=f"times near {first}")
    return np.round(at_s, 6), power_s
