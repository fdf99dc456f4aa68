"""File → Log."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from datetime import datetime
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from heatertune.errors import LogError, OutOfRange, UnknownName
from heatertune.log.cells import Sheet, is_number, read_sheet
from heatertune.log.columns import ROLES, Columns, find_columns, unit_in_name
from heatertune.log.tables import BUILT_IN, BuiltIn, built_in
from heatertune.log.values import Log
from heatertune.units import check, degF_to_degC, kelvin_to_degC

__all__ = ["read_log"]

Array = npt.NDArray[np.float64]

_TO_DEGC: Final[dict[str, Callable[[Any], Any]]] = {
    "degC": lambda value: value, "degF": degF_to_degC, "K": kelvin_to_degC,
}
_TO_SECONDS: Final = {"s": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0}
_DATES: Final = ("%d.%m.%Y %H:%M:%S", "%d.%m.%Y %H:%M", "%d/%m/%Y %H:%M:%S", "%H:%M:%S")
_KELVIN: Final = 250.0  # no heater log lies wholly above 250 °C without saying so, and every room is above 250 K


def read_log(
    source: str | Path,
    *,
    time_column: str | int | None = None,
    temperature_column: str | int | None = None,
    power_column: str | int | None = None,
    setpoint_column: str | int | None = None,
    temperature_unit: str | None = None,
    power_full_scale: float | None = None,
    time_unit: str | None = None,
    sample_time_s: float | None = None,
    errata: bool = False,
) -> Log:
    """Read a temperature log.

    Header or none; comma, semicolon, tab or spaces; decimal comma or point; seconds or time stamps; °C, °F or K; power
    as 0…1, 0…100 or 0…255: as the names of the columns say, or the options. What was changed or assumed is in
    `Log.repairs`.

    Args:
        source: path of a CSV file, or "table3" / "table4", the paper's tables.
        time_column: name or number (1 = first) of the column of the time; likewise the other columns.
        temperature_column: of the temperature.
        power_column: of the heater power.
        setpoint_column: of the setpoint.
        temperature_unit: "degC", "degF" or "K".
        power_full_scale: reading at full power.
        time_unit: "s", "ms", "min" or "h".
        sample_time_s: interval of a log without a time column [s].
        errata: whether the known misprints of a built-in table are corrected.

    Raises:
        LogError: what cannot be understood, with file, line, column and value.
        UnknownName: a unit that does not exist.
    """
    for kind, unit, known in (("temperature unit", temperature_unit, _TO_DEGC), ("time unit", time_unit, _TO_SECONDS)):
        if unit is not None and unit not in known:
            raise UnknownName(kind, unit, known)
    for name, number in (("power_full_scale", power_full_scale), ("sample_time_s", sample_time_s)):
        if number is not None:
            check(name, number, above=0.0)
    table = built_in(str(source).lower()) if isinstance(source, str) and source.lower() in BUILT_IN else None
    sheet = read_sheet(table.path if table else Path(source))
    if not sheet.rows:
        raise LogError("the file holds a header and no readings", file=sheet.file, expected="at least 20 rows")
    repairs = list(sheet.repairs)
    doubts = _errata(table, sheet, errata, repairs) if table else ()
    wanted = zip(ROLES, (time_column, temperature_column, power_column, setpoint_column), strict=True)
    columns = find_columns(sheet, {role: column for role, column in wanted if column is not None})
    repairs += columns.told
    time = _time(sheet, columns, time_unit, sample_time_s, repairs)
    kept = _kept_rows(sheet, columns, time, repairs)
    unit = _temperature_unit(sheet, columns, temperature_unit, repairs)
    found = {
        "time_s": time[kept],
        "temperature_degC": _temperature(sheet, columns, "temperature", unit)[kept],
        "setpoint_degC": _temperature(sheet, columns, "setpoint", unit)[kept] if "setpoint" in columns.index else None,
        "power_pct": _power(sheet, columns, power_full_scale, repairs)[kept] if "power" in columns.index else None,
    }
    return _log(source, table, sheet, found, tuple(repairs), doubts)


def _log(
    source: str | Path, table: BuiltIn | None, sheet: Sheet, found: Mapping[str, Any], repairs: tuple[str, ...],
    doubts: tuple[str, ...],
) -> Log:
    try:
        return Log(
            name=table.name if table else Path(source).stem, source=table.source if table else str(source),
            repairs=repairs, doubts=doubts, same_heater=table.same_heater if table else (), **found,
        )
    except OutOfRange as problem:
        raise LogError(str(problem), file=sheet.file) from problem


def _errata(table: BuiltIn, sheet: Sheet, apply: bool, repairs: list[str]) -> tuple[str, ...]:
    doubts = list(table.doubts)
    for erratum in table.errata:
        place = f"line {erratum['line']}, {erratum['column']}"
        told = f"{place}: {erratum['printed']} is a misprint for {erratum['corrected']}"
        if not apply:
            doubts.append(f"{told} ({erratum['reason']}); left as printed.")
            continue
        row = sheet.rows[sheet.lines.index(erratum["line"])]
        row[sheet.header.index(erratum["column"])] = str(erratum["corrected"])
        repairs.append(f"{told} ({erratum['reason']}); corrected.")
    return tuple(doubts)


def _numbers(sheet: Sheet, columns: Columns, role: str) -> Array:
    """Return a column as finite numbers; the first cell that is none is refused."""
    i = columns.index[role]
    cells = [row[i] for row in sheet.rows]
    try:
        values: Array = np.array([float(cell) for cell in cells])
    except ValueError:
        row = next(k for k, cell in enumerate(cells) if not _is_float(cell))
        raise _refused(sheet, columns, role, row, "no number:" if cells[row] else "an empty cell") from None
    if not np.all(np.isfinite(values)):
        row = int(np.flatnonzero(~np.isfinite(values))[0])
        raise _refused(sheet, columns, role, row, "not a finite number:")
    return values


def _is_float(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _refused(
    sheet: Sheet, columns: Columns, role: str, row: int, problem: str, expected: str = "a number"
) -> LogError:
    value = sheet.rows[row][columns.index[role]] or None
    return LogError(problem, file=sheet.file, line=sheet.lines[row], column=columns.names[role], value=value,
                    expected=expected)


def _time(
    sheet: Sheet, columns: Columns, unit: str | None, sample_time_s: float | None, repairs: list[str]
) -> Array:
    if "time" not in columns.index or sample_time_s is not None:
        if sample_time_s is None:
            raise LogError("the file has no time column", file=sheet.file,
                           expected="--log-interval with the seconds between two rows, or --time-column")
        repairs.append(f"The time was counted in rows of {sample_time_s:g} s.")
        return np.arange(len(sheet.rows), dtype=np.float64) * sample_time_s
    cells = [row[columns.index["time"]] for row in sheet.rows]
    if not is_number(cells[0]):
        repairs.append("Time stamps were turned into seconds from the first row.")
        return _stamps(sheet, columns, cells)
    named = unit_in_name("time", columns.names["time"])
    told = unit or named or "s"
    if unit is None and named not in (None, "s"):
        repairs.append(f"The time is in {told} by its column's name and was turned into seconds.")
    return _numbers(sheet, columns, "time") * _TO_SECONDS[told]


def _stamps(sheet: Sheet, columns: Columns, cells: list[str]) -> Array:
    first = _stamp(cells[0])
    seconds = np.empty(len(cells))
    for row, cell in enumerate(cells):
        moment = _stamp(cell)
        if moment is None or first is None or (moment.tzinfo is None) != (first.tzinfo is None):
            raise _refused(sheet, columns, "time", row, "no time:", "a time like that of the first row, or seconds")
        seconds[row] = (moment - first).total_seconds()
    return seconds


def _stamp(cell: str) -> datetime | None:
    try:
        return datetime.fromisoformat(cell)
    except ValueError:
        pass
    for form in _DATES:
        try:
            return datetime.strptime(cell, form)
        except ValueError:
            continue
    return None


def _kept_rows(sheet: Sheet, columns: Columns, time: Array, repairs: list[str]) -> npt.NDArray[np.bool_]:
    """Return which rows stay: of rows with the same time only the first; a time that goes backwards is refused."""
    steps = np.diff(time)
    if np.any(steps < 0):
        row = int(np.flatnonzero(steps < 0)[0]) + 1
        if "time" not in columns.index:
            raise LogError("the time goes backwards", file=sheet.file, line=sheet.lines[row])
        raise _refused(sheet, columns, "time", row, "the time goes backwards:",
                       f"not before {sheet.rows[row - 1][columns.index['time']]}")
    kept = np.concatenate([[True], steps > 0])
    if not np.all(kept):
        first = sheet.lines[int(np.flatnonzero(~kept)[0])]
        count = np.count_nonzero(~kept)
        repairs.append(f"{count} rows that repeat the time before were dropped, first in line {first}.")
    return kept


def _temperature_unit(sheet: Sheet, columns: Columns, given: str | None, repairs: list[str]) -> str:
    named = unit_in_name("temperature", columns.names["temperature"]) if sheet.header else None
    if given or named:
        unit = given or named or "degC"
        if unit != "degC":
            repairs.append(f"The temperature is in {unit} {'as told' if given else 'by its name'}, turned into °C.")
        return unit
    lowest = float(np.min(_numbers(sheet, columns, "temperature")))
    if lowest > _KELVIN:
        raise LogError(f"temperatures from {lowest:g} up without a unit may be K, °F or °C", file=sheet.file,
                       column=columns.names["temperature"], expected="--temperature-unit")
    repairs.append("The temperature has no unit in the file; taken as °C (else: --temperature-unit).")
    return "degC"


def _temperature(sheet: Sheet, columns: Columns, role: str, unit: str) -> Array:
    values = np.asarray(_TO_DEGC[unit](_numbers(sheet, columns, role)))
    if np.any(values < -273.15):
        row = int(np.flatnonzero(values < -273.15)[0])
        raise _refused(sheet, columns, role, row, "below absolute zero:", f"a temperature in {unit}")
    return values


def _power(sheet: Sheet, columns: Columns, full_scale: float | None, repairs: list[str]) -> Array:
    values = _numbers(sheet, columns, "power")
    named = unit_in_name("power", columns.names["power"]) if sheet.header else None
    largest = float(np.max(values))
    if full_scale is None and named is not None:
        full_scale = float(named)
    if full_scale is None:
        full_scale = _guessed_scale(sheet, columns, largest, repairs)
    elif full_scale != 100.0:
        repairs.append(f"The power was divided by {full_scale:g} at full power.")
    outside = np.flatnonzero((values < 0.0) | (values > full_scale))
    if len(outside):
        raise _refused(sheet, columns, "power", int(outside[0]), "power out of range:",
                       f"0…{full_scale:g} (--power-full-scale tells another reading at full power)")
    return values * (100.0 / full_scale)


def _guessed_scale(sheet: Sheet, columns: Columns, largest: float, repairs: list[str]) -> float:
    if not 1.0 < largest <= 100.0 or math.isnan(largest):
        told = "of at most 1 may be a fraction or percent" if largest <= 1.0 else "beyond 100 is no percentage"
        raise LogError(f"a power of {largest:g} without a unit {told}", file=sheet.file, column=columns.names["power"],
                       expected="--power-full-scale with the reading at full power")
    repairs.append("The power has no unit in the file; taken as percent (else: --power-full-scale).")
    return 100.0
