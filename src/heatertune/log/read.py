"""File → Log."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from heatertune.errors import LogError, OutOfRange, UnknownName
from heatertune.log.care import no_readings, one_run, tell_gaps
from heatertune.log.cells import Sheet, read_sheet
from heatertune.log.clock import TIME_UNITS, kept_rows, seconds
from heatertune.log.columns import ROLES, Columns, find_columns, is_foreign, unit_in_name, with_names
from heatertune.log.numbers import Array, numbers, refused
from heatertune.log.tables import BUILT_IN, BuiltIn, built_in
from heatertune.log.values import ABSOLUTE_ZERO_DEGC, Log
from heatertune.units import check, degF_to_degC, kelvin_to_degC

__all__ = ["read_log"]

_TO_DEGC: Final[dict[str, Callable[[Any], Any]]] = {
    "degC": lambda value: value, "degF": degF_to_degC, "K": kelvin_to_degC,
}
_KELVIN: Final = 250.0  # no heater log lies wholly above 250 °C without saying so, and every room is above 250 K
_ROOM_DEGF: Final = (55.0, 110.0)  # 13…43 °C


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
    run: int | None = None,
    skip_empty: bool = False,
    errata: bool = False,
    content: bytes | None = None,
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
        run: which of several runs in one file, 1 = first; by default the longest.
        skip_empty: whether rows without a temperature (empty, NaN) are left out instead of refused.
        errata: whether the known misprints of a built-in table are corrected.
        content: of the file, where it lies on another machine; `source` then only names it.

    Raises:
        LogError: what cannot be understood, with file, line, column and value.
        UnknownName: a unit that does not exist.
    """
    for kind, unit, known in (("temperature unit", temperature_unit, _TO_DEGC), ("time unit", time_unit, TIME_UNITS)):
        if unit is not None and unit not in known:
            raise UnknownName(kind, unit, known)
    for name, number in (("power_full_scale", power_full_scale), ("sample_time_s", sample_time_s)):
        if number is not None:
            check(name, number, above=0.0)
    named = isinstance(source, str) and source.lower() in BUILT_IN and content is None
    table = built_in(str(source).lower()) if named else None
    sheet = with_names(read_sheet(table.path if table else Path(source), content))
    if not sheet.rows:
        raise LogError("the file holds a header and no readings", file=sheet.file, expected="at least 20 rows")
    repairs, doubts = list(sheet.repairs), list(table.doubts if table else ())
    if table:
        _errata(table, sheet, errata, repairs, doubts)
    wanted = zip(ROLES, (time_column, temperature_column, power_column, setpoint_column), strict=True)
    columns = find_columns(sheet, {role: column for role, column in wanted if column is not None},
                           counted=sample_time_s is not None)
    repairs += columns.told
    sheet, time = one_run(sheet, seconds(sheet, columns, time_unit, sample_time_s, repairs), run, repairs)
    raw = numbers(sheet, columns, "temperature", "a number (--skip-empty leaves such rows out)", holes=skip_empty)
    kept = kept_rows(sheet, columns, time, repairs) & ~no_readings(sheet, columns, raw, repairs)
    unit = _temperature_unit(sheet, columns, temperature_unit, raw[kept], repairs, doubts)
    found = {
        "time_s": time,
        "temperature_degC": _temperature(sheet, columns, "temperature", unit, raw, kept),
        "setpoint_degC": _setpoint(sheet, columns, unit, repairs),
        "power_pct": _power(sheet, columns, power_full_scale, repairs),
    }
    found = {name: None if values is None else values[kept] for name, values in found.items()}
    lines = [line for line, keeps in zip(sheet.lines, kept, strict=True) if keeps]
    tell_gaps(time[kept], lines, found["power_pct"] is not None, doubts)
    return _log(source, table, sheet, found, repairs, doubts)


def _log(
    source: str | Path, table: BuiltIn | None, sheet: Sheet, found: Mapping[str, Any], repairs: list[str],
    doubts: list[str],
) -> Log:
    try:
        return Log(
            name=table.name if table else Path(source).stem, source=table.source if table else str(source),
            repairs=tuple(repairs), doubts=tuple(doubts), same_heater=table.same_heater if table else (),
            rests_at_degC=table.rests_at_degC if table else None, **found,
        )
    except OutOfRange as problem:
        raise LogError(str(problem), file=sheet.file) from problem


def _errata(table: BuiltIn, sheet: Sheet, apply: bool, repairs: list[str], doubts: list[str]) -> None:
    """Correct the known misprints of a built-in table, or add them to the doubts."""
    for erratum in table.errata:
        place = f"line {erratum['line']}, {erratum['column']}"
        told = f"{place}: {erratum['printed']} is a misprint for {erratum['corrected']}"
        if not apply:
            doubts.append(f"{told} ({erratum['reason']}); left as printed.")
            continue
        row = sheet.rows[sheet.lines.index(erratum["line"])]
        row[sheet.header.index(erratum["column"])] = str(erratum["corrected"])
        repairs.append(f"{told} ({erratum['reason']}); corrected.")


def _temperature_unit(
    sheet: Sheet, columns: Columns, given: str | None, values: Array, repairs: list[str], doubts: list[str]
) -> str:
    name = columns.names["temperature"]
    named = unit_in_name("temperature", name)
    known = given or named
    if known is not None:
        if known != "degC":
            repairs.append(f"The temperature is in {known} {'as told' if given else 'by its name'}, turned into °C.")
        return known
    lowest, first = float(np.min(values)), float(values[0])
    if is_foreign("temperature", name) or lowest >= _KELVIN:
        raise LogError(f"readings from {lowest:g} up whose unit is not known", file=sheet.file, column=name,
                       expected="--temperature-unit degC, degF or K")
    repairs.append("The temperature has no unit in the file; taken as °C (else: --temperature-unit).")
    if _ROOM_DEGF[0] <= first <= _ROOM_DEGF[1]:
        doubts.append(f"The first reading, {first:g}, taken as °C, would be a room's temperature in °F.")
    return "degC"


def _temperature(
    sheet: Sheet, columns: Columns, role: str, unit: str, raw: Array, kept: npt.NDArray[np.bool_]
) -> Array:
    values = np.asarray(_TO_DEGC[unit](raw))
    below = np.flatnonzero(kept & (values < ABSOLUTE_ZERO_DEGC))
    if len(below):
        raise refused(sheet, columns, role, int(below[0]), "below absolute zero:", f"a temperature in {unit}")
    return values


def _setpoint(sheet: Sheet, columns: Columns, unit: str, repairs: list[str]) -> Array | None:
    """Return the setpoint, in the temperature's unit unless its own name tells another."""
    if "setpoint" not in columns.index:
        return None
    own = unit_in_name("setpoint", columns.names["setpoint"]) or unit
    if own != unit:
        repairs.append(f"The setpoint is in {own} by its name.")
    raw = numbers(sheet, columns, "setpoint")
    return _temperature(sheet, columns, "setpoint", own, raw, np.ones(len(raw), dtype=np.bool_))


def _power(sheet: Sheet, columns: Columns, given: float | None, repairs: list[str]) -> Array | None:
    if "power" not in columns.index:
        return None
    values = numbers(sheet, columns, "power")
    named = unit_in_name("power", columns.names["power"])
    full_scale = given or (float(named) if named else _assumed_scale(sheet, columns, values, repairs))
    if full_scale != 100.0:
        repairs.append(f"The power was divided by its reading at full power, {full_scale:g}.")
    outside = np.flatnonzero((values < 0.0) | (values > full_scale))
    if len(outside):
        raise refused(sheet, columns, "power", int(outside[0]), "power out of range:",
                      f"0…{full_scale:g} (--power-full-scale tells another reading at full power)")
    return values if full_scale == 100.0 else values / full_scale * 100.0


def _assumed_scale(sheet: Sheet, columns: Columns, values: Array, repairs: list[str]) -> float:
    """Return 100 where the numbers can only be percent; everything else has to be told."""
    name, largest = columns.names["power"], float(np.max(values))
    why = next((why for holds, why in (
        (is_foreign("power", name), "in a unit that is no share of full power"),
        (largest > 100.0, "is no percentage"),
        (0.0 < largest <= 1.0, "may be a fraction or percent"),
        ("pwm" in name.lower() and not np.any(values % 1.0), "may be percent or counts of 255"),
    ) if holds), None)
    if why:
        raise LogError(f"a power up to {largest:g} {why}", file=sheet.file, column=name,
                       expected="--power-full-scale with the reading at full power")
    repairs.append("The power has no unit in the file; taken as percent (else: --power-full-scale).")
    return 100.0
