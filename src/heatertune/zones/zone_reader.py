"""Files → the log of several zones: one file with a temperature and a power for each zone, or one for each zone."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from heatertune.arrays import Array
from heatertune.errors import InputError
from heatertune.log import read_log
from heatertune.log.cells import heaters_in, read_sheet
from heatertune.log.columns import with_names
from heatertune.log.log_values import MIN_SAMPLES, Log
from heatertune.log.quantities import is_second_choice, role_of
from heatertune.log.read import clock_shifts_s
from heatertune.log.side_columns import is_cooling, is_fan
from heatertune.model.findings import Finding
from heatertune.options import merge_options
from heatertune.settings import ReadSettings
from heatertune.zones.identify import ZoneLog
from heatertune.zones.network import ZonePower

__all__ = ["numbers_in", "read_zones", "zones_in"]

_ROLES: Final = ("temperature", "power", "setpoint")
_TOKEN: Final = re.compile(r"[^\W\d_]+|\d+")
_CLOCK_S: Final = 1e-6  # instants of two zones closer than this are one row


def read_zones(
    sources: str | Path | Sequence[str | Path], zones: Sequence[str], settings: ReadSettings | None = None,
    **changed: Any,
) -> ZoneLog:
    """Read a log of several zones.

    In one file, a zone's columns are those whose names hold the zone's name; where no name does, the first zone has the
    first temperature, power and setpoint, the second one the second, and so on.

    Args:
        sources: one file with all zones, or one file for each zone in their order, all of one clock.
        zones: names of the zones, neighbours next to each other.
        settings: how to read each file, as `heatertune.log.read_log`; None: detect everything.
        changed: fields of `ReadSettings` that differ from `settings`.

    Raises:
        InputError: fewer than two zones, another number of files than zones, a zone without temperature or power, or
            files of different clocks.
        LogError, OutOfRange: as `read_log`.
    """
    options = merge_options(ReadSettings, settings, changed)
    paths = [sources] if isinstance(sources, str | Path) else list(sources)
    names = tuple(zone.strip() for zone in zones)
    if len(names) < 2 or len(set(names)) < len(names):
        raise InputError("--zones: expected the names of two zones or more, each another one")
    if len(paths) == 1:
        columns = _columns_of(Path(paths[0]), names, options)
        logs = [read_log(paths[0], merge_options(ReadSettings, options, column_options)) for column_options in columns]
        return _joined(names, logs, [log.time_s for log in logs])
    return _of_files(paths, names, options)


def numbers_in(name: str, text: str) -> tuple[float, ...]:
    """Return a number for each zone, typed with commas between them.

    Args:
        name: what the numbers are, for the error.
        text: as typed.

    Raises:
        InputError: a text with anything else.
    """
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError as problem:
        raise InputError(f"{name} {text}: expected numbers with commas between them, such as 180,190") from problem


def _of_files(paths: Sequence[str | Path], names: tuple[str, ...], settings: ReadSettings) -> ZoneLog:
    """Return the log of a file for each zone."""
    if len(paths) != len(names):
        raise InputError(f"{len(paths)} logs for {len(names)} zones: give one file with all zones, or one for each")
    logs = [read_log(path, settings) for path in paths]
    shifts_s = clock_shifts_s([Path(path) for path in paths], settings)
    joined = _joined(names, logs, [log.time_s + shift_s for log, shift_s in zip(logs, shifts_s, strict=True)])
    if any(log.taken is None or log.taken.columns["time"][1] != "stamps" for log in logs):
        joined = replace(joined, findings=(*joined.findings, Finding(name="one-clock", message=(
            "the files have no dates; their times are taken from one clock"))))
    return joined


def _columns_of(path: Path, zones: Sequence[str], settings: ReadSettings) -> list[dict[str, str]]:
    """Return the columns, or the heaters of a printer's log, of each zone as options of `read_log`."""
    heaters = heaters_in(path)
    if heaters:
        return [{"tag": _heater_of(path, zone, heaters)} for zone in zones]
    columns = _by_role(path, settings, zones)
    return [_of_zone(path, zone, number, len(zones), columns) for number, zone in enumerate(zones)]


def _by_role(path: Path, settings: ReadSettings, zones: Sequence[str] = ()) -> dict[str, list[str]]:
    """Return the columns that may be the temperatures, powers and setpoints of zones.

    A name that is a second choice beside a heater, such as the extruder beside a bed, may be that of a zone.
    """
    sheet = with_names(read_sheet(path, None, settings.skip_rows, settings.tag, settings.decimal_comma))
    if not sheet.header:
        raise InputError(f"{path.name}: columns without names; name them in a first row, so that zones are known")
    heated = [name for name in sheet.header if not (is_cooling(name) or is_fan(name))]
    zones = zones or _own_parts([name for name in heated if role_of(name) == "power"])
    words = [_words(zone) for zone in zones if _words(zone)]
    candidates = [name for name in heated if not is_second_choice(name) or any(zone <= _words(name) for zone in words)]
    return {role: [name for name in candidates if role_of(name) == role] for role in _ROLES}


def _words(name: str) -> set[str]:
    return {word.casefold() for word in _TOKEN.findall(name)}


def zones_in(source: str | Path, settings: ReadSettings | None = None) -> tuple[str, ...]:
    """Return the names of the zones in one file, as `read_zones` takes them; none of a file with one heater.

    The heaters of a printer's log; otherwise the words in which the names of the power columns differ.

    Args:
        source: the file.
        settings: how to read it; None: detect everything.

    Raises:
        LogError: the file cannot be read.
    """
    path, reading = Path(source), settings or ReadSettings()
    if heaters := heaters_in(path):
        return tuple(heaters) if len(heaters) > 1 else ()
    try:
        columns = _by_role(path, reading)
        zones = _own_parts(columns["power"])
        _ = [_of_zone(path, zone, number, len(zones), columns) for number, zone in enumerate(zones)]
    except InputError:
        return ()
    return zones


def _own_parts(names: Sequence[str]) -> tuple[str, ...]:
    """Return the part of each name that no other one has; none where a name has no such part, or there is one name."""
    words = [_words(name) for name in names]
    parts = tuple(_own_part(name, set.intersection(*words)) for name in names)
    return parts if len(parts) == len(set(parts)) > 1 and all(parts) else ()


def _own_part(name: str, common: set[str]) -> str:
    """Return the part of a column's name from its first to its last word that is not common to all columns."""
    own = [word for word in _TOKEN.finditer(name) if word[0].casefold() not in common]
    return name[own[0].start():own[-1].end()] if own else ""


def _of_zone(path: Path, zone: str, number: int, count: int, by_role: dict[str, list[str]]) -> dict[str, str]:
    columns = {}
    for role, names in by_role.items():
        own = [name for name in names if zone.casefold() in name.casefold()]
        if len(own) == 1:
            columns[f"{role}_column"] = own[0]
        elif len(names) == count:
            columns[f"{role}_column"] = names[number]
        elif role == "setpoint":
            columns["setpoint_column"] = "none"
        else:
            raise InputError(
                f"{path.name}: {len(own) or len(names)} columns may be the {role} of zone {zone!r} "
                f"({', '.join(own or names) or 'none'}); name the columns by their zones, such as '{zone} {role}'")
    return columns


def _heater_of(path: Path, zone: str, heaters: Sequence[str]) -> str:
    own = [zone] if zone in heaters else [name for name in heaters if zone.casefold() in name.casefold()]
    if len(own) != 1:
        raise InputError(f"{path.name}: zone {zone!r} is none of its heaters; name zones as {', '.join(heaters)}")
    return own[0]


def _joined(zones: tuple[str, ...], logs: Sequence[Log], times_s: Sequence[Array]) -> ZoneLog:
    """Return all zones at the instants of the first one at which all are logged.

    Args:
        zones: their names.
        logs: of each zone.
        times_s: the instants of each log by one clock, shape (n,) each [s].
    """
    begin, end = max(time[0] for time in times_s), min(time[-1] for time in times_s)
    common = times_s[0][(times_s[0] >= begin - _CLOCK_S) & (times_s[0] <= end + _CLOCK_S)]
    for zone, log in zip(zones, logs, strict=True):
        if log.power_pct is None:
            raise InputError(f"{log.name}: zone {zone!r} has no power; log the power of each zone")
        log.demand_heater_alone("which the zones cannot use: log heaters alone")
        if len(common) < max(MIN_SAMPLES, len(times_s[0]) // 2):
            raise InputError(f"{len(common)} of {len(times_s[0])} rows of zone {zones[0]!r} are of a time at which all "
                             "zones are logged; give logs of the same hours")
    rows = [np.maximum(np.searchsorted(time, common + _CLOCK_S) - 1, 0) for time in times_s]
    apart = [zone for zone, time, row in zip(zones, times_s, rows, strict=True)
             if np.any(np.abs(time[row] - common) > _CLOCK_S)]
    has_setpoints = all(log.setpoint_degC is not None for log in logs)

    def column(name: str) -> Array:
        return np.column_stack([getattr(log, name)[row] for log, row in zip(logs, rows, strict=True)])

    repairs = dict.fromkeys(repair for log in logs for repair in log.repairs
                            if "was taken as the" not in repair and "(--tag)" not in repair)
    if apart:
        names = " and ".join(map(repr, apart))
        repairs[f"Readings of {names} were interpolated at the instants of {zones[0]!r}."] = None
    firsts = [max(row[0], 0) for row in rows]
    courses = tuple(ZonePower.from_rows(time[first:], np.asarray(log.power_pct)[first:])
                    for log, time, first in zip(logs, times_s, firsts, strict=True)) if apart else ()
    return ZoneLog(
        name=logs[0].name if len({log.name for log in logs}) == 1 else " and ".join(log.name for log in logs),
        zones=zones, time_s=common,
        temperatures_degC=np.column_stack([np.interp(common, time, log.temperature_degC)
                                           for log, time in zip(logs, times_s, strict=True)]),
        powers_pct=column("power_pct"), courses=courses,
        setpoints_degC=column("setpoint_degC") if has_setpoints else None,
        repairs=tuple(repairs),
        findings=tuple({finding.message: finding for finding in _unit_findings(zones, logs)}.values()))


def _unit_findings(zones: Sequence[str], logs: Sequence[Log]) -> Iterator[Finding]:
    for zone, log in zip(zones, logs, strict=True):
        if log.taken is not None and log.taken.assumed:
            yield Finding(name="unit-assumed", message=(
                f"nothing in {log.taken.file} shows the unit of the {' and '.join(log.taken.assumed)} of zone {zone}; "
                f"check, and state: {' '.join(log.taken.assumed.values())}"))
        if log.taken is not None and log.taken.begins_as_room:
            yield Finding(name="begins-as-room", message=(
                f"the temperature of zone {zone} is taken as °C, as {log.taken.file} begins like a room in °C; state "
                f"it for a heater in the cold: {log.taken.unit_option('temperature')}"))
