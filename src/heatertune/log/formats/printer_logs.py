"""Logs of 3D printers: Klipper, Kalico, and the serial lines of Marlin and Repetier as hosts write them.

Klipper and Kalico logs become one table: the Stats lines of klippy.log, one per second, and the files that
PID_CALIBRATE writes with WRITE_FILE=1 (heattest.txt of Klipper, heattest.csv of Kalico, whose second table contains the
peaks).
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final, NamedTuple

from heatertune.errors import LogError
from heatertune.log.formats.format_table import FormatTable, Line, TextFormat, line_stamp, matching
from heatertune.units import count

__all__ = ["PRINTER_LOGS", "heater_names"]


#: begins a line of klippy.log: seconds of the host's clock
_STATS: Final = re.compile(r"Stats (\d+\.\d+): ")
_HEATER: Final = re.compile(r"(?:^|\s)(\S+): target=(-?\d+) temp=(-?\d+\.\d+) pwm=(\d\.\d+)(?=\s|$)")
_STATS_WITH_HEATER: Final = re.compile(rf"^{_STATS.pattern}.*{_HEATER.pattern}")
_PWM: Final = re.compile(r"pwm: (-?\d+\.\d+) (-?\d+\.\d+)\s*")
_TEMPERATURE: Final = re.compile(r"(-?\d+\.\d+) (-?\d+\.\d+)\s*")
_KALICO: Final = re.compile(r"time, temp, pwm, target\s*")
_PEAKS: Final = re.compile(r"sample, low time, low, high time, high, max power\s*")

#: the default heater
_USUAL: Final = "extruder"
_HEADER: Final = ("time [s]", "temperature [degC]", "power [0...1]")
_MOVED_DEGC: Final = 5.0  # more than the noise of a thermistor or a warming room
_PAUSE_S: Final = 30.0  # without statistics: the host was restarted


class _StatsReading(NamedTuple):
    """A reading of one heater in a line of statistics: line number, cells, and as numbers."""

    line: int
    cells: list[str]
    time_s: float
    degC: float
    pwm: float


def _klippy(path: Path, numbered: Sequence[Line], tag: str | None) -> FormatTable:
    heaters: dict[str, list[_StatsReading]] = {}
    for number, line in numbered:
        found = _STATS.match(line)
        for name, target, degC, pwm in _HEATER.findall(line[found.end():]) if found is not None else ():
            cells = [found[1], name, degC, pwm, target] if found is not None else []
            heaters.setdefault(name, []).append(_StatsReading(number, cells, float(cells[0]), float(degC), float(pwm)))
    sessions = {name: _sessions(readings) for name, readings in heaters.items()}
    moved = {name: max(map(_movement, parts)) for name, parts in sessions.items()}
    wanted, why = _heater_to_read(path, moved, tag)
    parts = sessions[wanted]
    readings = heaters[wanted]
    repairs = [f"klippy.log: {count(len(readings), 'line')} Stats of {wanted!r} read{why}, "
               f"{len(numbered) - len(readings)} others passed over; power is what was sent last before each of them."]
    others = [name + (f", which moved by {moved[name]:.0f} °C" if moved[name] > _MOVED_DEGC else "")
              for name in heaters if name != wanted]
    if others:
        repairs.append(f"Other heaters in it: {', '.join(others)} (--tag).")
    header = (_HEADER[0], "name", *_HEADER[1:], "setpoint [degC]")
    best = max(range(len(parts)), key=lambda k: (_movement(parts[k]), len(parts[k])))
    return FormatTable(
        header, [reading.cells for reading in readings], [reading.line for reading in readings], repairs,
        tuple(part[0].line for part in parts) if len(parts) > 1 else (), best + 1 if len(parts) > 1 else None,
        part="" if tag else wanted)


def heater_names(numbered: Sequence[Line]) -> list[str]:
    """Return the heaters of a printer's log, by which `--tag` selects one; none of other lines."""
    if matching(_STATS_WITH_HEATER)(numbered):
        stats = (line for _, line in numbered if _STATS.match(line))
        return [*dict.fromkeys(name for line in stats for name, *_ in _HEATER.findall(line))]
    return [*_reports(numbered)[0]] if matching(_REPORT)(numbered) else []


def _sessions(readings: Sequence[_StatsReading]) -> list[list[_StatsReading]]:
    """Return the readings of each run of the host: its clock begins again, or the statistics pause."""
    parts: list[list[_StatsReading]] = []
    for reading in readings:
        if not parts or not 0.0 <= reading.time_s - parts[-1][-1].time_s <= _PAUSE_S:
            parts.append([])
        parts[-1].append(reading)
    return parts


def _movement(readings: Sequence[_StatsReading]) -> float:
    """Return by how much a heater moved under power [°C]; 0 without power: a warming neighbour is no test."""
    if not any(reading.pwm for reading in readings):
        return 0.0
    values = [reading.degC for reading in readings]
    return max(values) - min(values)


def _heater_to_read(path: Path, moved: Mapping[str, float], tag: str | None) -> tuple[str, str]:
    """Return the heater to read and why: the one asked for, the extruder, the only one, or the only one that moved."""
    heated = [name for name, by_degC in moved.items() if by_degC > _MOVED_DEGC]
    if tag is None and len(heated) == 1 and len(moved) > 1:
        return heated[0], "" if heated[0] == _USUAL else ", the only heater that was heated"
    wanted = tag or (_USUAL if _USUAL in moved else None) or (next(iter(moved)) if len(moved) == 1 else None)
    if wanted not in moved:
        problem = "the printer has several heaters" if tag is None else "the printer has no such heater"
        raise LogError(problem, file=path, value=", ".join(moved) if tag is None else tag,
                       expected=f"--tag and one of {', '.join((heated if tag is None else []) or moved)}")
    return str(wanted), ""


def _klipper_test(path: Path, numbered: Sequence[Line], _: str | None) -> FormatTable:
    """Return the readings of heattest.txt, each with the power that is in effect."""
    times, powers, rows, lines = [], [], [], []
    for number, line in numbered:
        sent, read = _PWM.fullmatch(line), _TEMPERATURE.fullmatch(line)
        if sent is not None:
            times.append(float(sent[1]))
            powers.append(sent[2])
        elif read is not None:
            before = bisect_right(times, float(read[1]))
            rows.append([read[1], read[2], powers[before - 1] if before else "0.000"])
            lines.append(number)
        elif line.strip():
            raise LogError("a line that PID_CALIBRATE does not write", file=path, line=number, value=line[:60],
                           expected="pwm, time and duty, or time and temperature")
    if times != sorted(times):
        raise LogError("the times of pwm do not rise", file=path, expected="the file of one PID_CALIBRATE")
    repairs = [f"heattest.txt of PID_CALIBRATE: {count(len(times), 'change')} of the power, each from its instant on."]
    return FormatTable(_HEADER, rows, lines, repairs)


def _kalico_test(_: Path, numbered: Sequence[Line], __: str | None) -> FormatTable:
    """Return the first table of heattest.csv."""
    end = next((k for k, (_, line) in enumerate(numbered) if _PEAKS.fullmatch(line)), len(numbered))
    kept = [(number, [cell.strip() for cell in line.split(",")]) for number, line in numbered[1:end] if line.strip()]
    peaks = count(len(numbered) - end, "line")
    repairs = [f"heattest.csv of Kalico's PID_CALIBRATE: {peaks} of its peaks passed over."]
    return FormatTable((*_HEADER, "setpoint [degC]"), [row for _, row in kept], [number for number, _ in kept], repairs)


#: a report of temperatures, as M105, M155 and M303 make it: T:20.5 /60.0 B:22.1 /0.0 @:64 B@:0
_BEGINS: Final = r"(?<![^\s:].)"  # behind the first letter, which a search finds faster than what stands before it
_REPORT: Final = re.compile(rf"T{_BEGINS}\d?: ?-?\d+(?:\.\d+)? */-?\d")
_PART: Final = re.compile(rf"([TBC]{_BEGINS}\d?): ?(-?\d+(?:\.\d+)?) */ ?(-?\d+(?:\.\d+)?)")
_SMOOTHIE: Final = re.compile(r"(?:^|[\s:])([TBC]\d?):-?[\d.]+ */ ?-?[\d.]+ @(\d+)")
_SENT: Final = re.compile(r"@(?:(?<=(?<!\w)([TBC])@)|(?<!\w@))(\d?):(-?\d+)")
_MARLIN_FULL: Final = 127  # Marlin's soft PWM has seven bits
_EIGHT_BITS_FULL: Final = 255


def _reports(numbered: Sequence[Line]) -> tuple[dict[str, list[tuple[int, list[str]]]], int]:
    """Return heater → line number and cells of its reports, and the count of full power.

    Marlin reports 0…127 with the hot end's @ before the bed's, Repetier 0…255 with the bed's first, Smoothieware 0…255
    behind each heater.
    """
    heaters: dict[str, list[tuple[int, list[str]]]] = {}
    full = _MARLIN_FULL
    for number, line in numbered:
        if _REPORT.search(line) is None:
            continue
        sent = {letter + digit: int(value) for letter, digit, value in _SENT.findall(line)}
        behind = {} if sent else {name: int(value) for name, value in _SMOOTHIE.findall(line)}
        if behind or ("B" in sent and [*sent][:2] == ["B", ""]) or max(sent.values(), default=0) > _MARLIN_FULL:
            full = _EIGHT_BITS_FULL
        sent, stamp = sent or behind, line_stamp(line)
        for name, degC, target in _PART.findall(line):
            power = sent.get(name, sent.get(name[1:], sent.get("") if name in ("T", "T0") else None))
            if power is not None:
                heaters.setdefault(name, []).append((number, [stamp, name, degC, str(power), target]))
    if "T0" in heaters:
        heaters.pop("T", None)  # the same hot end twice
    return heaters, full


def _serial(path: Path, numbered: Sequence[Line], tag: str | None) -> FormatTable:
    """Return the reports of one heater: T, T0, T1 …, B; the power is the number behind its @."""
    heaters, full = _reports(numbered)
    moved = {name: _reported_movement(rows) for name, rows in heaters.items()}
    if not moved:
        raise LogError("the lines report temperatures without the power behind @", file=path,
                       expected="reports such as T:20.5 /60.0 @:64, which M105 and M155 make")
    hot = [name for name, by_degC in moved.items() if by_degC > _MOVED_DEGC]
    if tag not in heaters and (tag is not None or (len(hot) != 1 and len(moved) > 1)):
        problem = "the printer has several heaters" if tag is None else "the printer has no such heater"
        raise LogError(problem, file=path, value=", ".join(moved) if tag is None else tag,
                       expected=f"--tag and one of {', '.join((hot if tag is None else []) or moved)}")
    wanted = tag or (hot or [*moved])[0]
    rows = heaters[wanted]
    stamps = all(cells[0] for _, cells in rows)
    names = ", ".join(name for name in heaters if name != wanted)
    others = f"; other heaters: {names} (--tag)" if names else ""
    return FormatTable(
        (*(("time",) if stamps else ()), "name", "temperature [degC]", f"power [0...{full}]", "setpoint [degC]"),
        [cells if stamps else cells[1:] for _, cells in rows], [number for number, _ in rows],
        [f"Reports of a printer: {count(len(rows), 'line')} of {wanted!r} read, its power as 0 to {full}{others}."])


def _reported_movement(rows: Sequence[tuple[int, list[str]]]) -> float:
    values = [float(cells[2]) for _, cells in rows]
    return max(values) - min(values) if any(cells[3] != "0" for _, cells in rows) else 0.0


def _first_line(pattern: re.Pattern[str], lines: Sequence[Line]) -> bool:
    return bool(lines) and pattern.fullmatch(lines[0][1]) is not None


PRINTER_LOGS: Final = (
    TextFormat("klippy.log", matching(_STATS_WITH_HEATER), _klippy),
    TextFormat("heattest.txt", lambda lines: _first_line(_PWM, lines), _klipper_test),
    TextFormat("heattest.csv", lambda lines: _first_line(_KALICO, lines), _kalico_test),
    TextFormat("serial log of a printer", matching(_REPORT), _serial),
)
