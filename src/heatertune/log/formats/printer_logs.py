"""Logs of 3D printers: Klipper, Kalico, and the serial lines of Marlin and Repetier as hosts write them.

Klipper and Kalico logs become one table: the Stats lines of klippy.log, one per second, and the files that
PID_CALIBRATE writes with WRITE_FILE=1 (heattest.txt of Klipper, heattest.csv of Kalico, whose second table contains the
peaks).
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np

from heatertune.errors import LogError
from heatertune.log.formats.format_table import FormatTable, Line, TextFormat, line_stamp, matching
from heatertune.units import count

__all__ = ["PRINTER_LOGS", "heater_names", "names_of"]


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


def _klippy(path: Path, numbered: Sequence[Line], tag: str | None) -> FormatTable:
    heaters, lines = dict[str, list[str]](), dict[str, list[int]]()
    for number, line in numbered:
        if (match := _STATS.match(line)) is not None:
            for name, target, degC, pwm in _HEATER.findall(line[match.end():]):
                heaters.setdefault(name, []).extend((match[1], name, degC, pwm, target))
                lines.setdefault(name, []).append(number)
    sessions = {name: _sessions(cells) for name, cells in heaters.items()}
    moved = {name: max(by_degC for by_degC, *_ in parts) for name, parts in sessions.items()}
    heater, why = _heater_to_read(path, moved, tag)
    parts = sessions[heater]
    size = len(lines[heater])
    repairs = [f"klippy.log: {count(size, 'line')} Stats of {heater!r} read{why}, {len(numbered) - size} others passed "
               "over; power is what was sent last before each of them."]
    others = [name + (f", which moved by {moved[name]:.0f} °C" if moved[name] > _MOVED_DEGC else "")
              for name in heaters if name != heater]
    if others:
        repairs.append(f"Other heaters in it: {', '.join(others)} (--tag).")
    begins = tuple(lines[heater][begin] for *_, begin in parts) if len(parts) > 1 else ()
    return FormatTable(
        (_HEADER[0], "name", *_HEADER[1:], "setpoint [degC]"), _rows(heaters[heater]), lines[heater], repairs, begins,
        parts.index(max(parts, key=lambda part: part[:2])) + 1 if begins else None, part="" if tag else heater)


_CELLS: Final = 5  # of a report: time, heater, temperature, power, target


def _rows(cells: Sequence[str], begin: int = 0) -> Iterator[list[str]]:
    """Yield the cells of each report, from one of them on."""
    return (list(cells[k + begin:k + _CELLS]) for k in range(0, len(cells), _CELLS))


def heater_names(numbered: Sequence[Line]) -> list[str]:
    """Return the heaters of a printer's log, by which `--tag` selects one; none of other lines."""
    if matching(_STATS_WITH_HEATER)(numbered):
        stats = (line for _, line in numbered if _STATS.match(line))
        return [*dict.fromkeys(name for line in stats for name, *_ in _HEATER.findall(line))]
    return [*_reports(numbered)[0]] if matching(_REPORT)(numbered) else []


def names_of(reading: Mapping[str, object]) -> tuple[str, ...]:
    """Return what firmwares call the heater of a log, by how it was read: its tag, of a printer its other names, too.

    A letter is a heater's name in a printer's reports only.
    """
    tag = str(reading.get("tag", ""))
    is_report = str(reading.get("power_column", "")).startswith("power [0...") or len(tag) > len("T0")
    own = (tag,) if tag else ()
    return (*own, *(name for names in _SAME if tag in names and is_report for name in names))


def _sessions(cells: Sequence[str]) -> list[tuple[float, int, int]]:
    """Return movement [°C], number of reports and first report of each run of the host.

    In each, its clock begins again, or the statistics pause.
    """
    steps = np.diff([*map(float, cells[::_CELLS])])
    begins = [0, *(np.flatnonzero((steps < 0.0) | (steps > _PAUSE_S)) + 1).tolist(), len(cells) // _CELLS]
    return [(_movement(cells[begin * _CELLS:end * _CELLS]), end - begin, begin) for begin, end in pairwise(begins)]


def _movement(cells: Sequence[str]) -> float:
    """Return by how much a heater moved under power [°C]; 0 without power: a warming neighbour is no test."""
    values = [*map(float, cells[2::_CELLS])]
    return max(values) - min(values) if any(map(float, cells[3::_CELLS])) else 0.0


def _heater_to_read(path: Path, moved: Mapping[str, float], tag: str | None) -> tuple[str, str]:
    """Return the heater to read and why: the one asked for, the extruder, the only one, or the only one that moved."""
    heated = [name for name, by_degC in moved.items() if by_degC > _MOVED_DEGC]
    if tag is None and len(heated) == 1 and len(moved) > 1:
        return heated[0], "" if heated[0] == _USUAL else ", the only heater that was heated"
    heater = tag or (_USUAL if _USUAL in moved else None) or (next(iter(moved)) if len(moved) == 1 else None)
    if heater not in moved:
        problem = "the printer has several heaters" if tag is None else "the printer has no such heater"
        raise LogError(problem, file=path, value=", ".join(moved) if tag is None else tag,
                       expected=f"--tag and one of {', '.join((heated if tag is None else []) or moved)}")
    return str(heater), ""


def _klipper_test(path: Path, numbered: Sequence[Line], _: str | None) -> FormatTable:
    """Return the readings of heattest.txt, each with the power that is in effect."""
    times, powers, rows = [], [], list[tuple[int, list[str]]]()
    for number, line in numbered:
        sent, read = _PWM.fullmatch(line), _TEMPERATURE.fullmatch(line)
        if sent is not None:
            times.append(float(sent[1]))
            powers.append(sent[2])
        elif read is not None:
            before = bisect_right(times, float(read[1]))
            rows.append((number, [read[1], read[2], powers[before - 1] if before else "0.000"]))
        elif line.strip():
            raise LogError("a line that PID_CALIBRATE does not write", file=path, line=number, value=line[:60],
                           expected="pwm, time and duty, or time and temperature")
    if times != sorted(times):
        raise LogError("the times of pwm do not rise", file=path, expected="the file of one PID_CALIBRATE")
    return FormatTable.from_rows(_HEADER, rows, f"heattest.txt of PID_CALIBRATE: {count(len(times), 'change')} of the "
                                 "power, each from its instant on.")


def _kalico_test(_: Path, numbered: Sequence[Line], __: str | None) -> FormatTable:
    """Return the first table of heattest.csv."""
    end = next((k for k, (_, line) in enumerate(numbered) if _PEAKS.fullmatch(line)), len(numbered))
    rows = [(number, [cell.strip() for cell in line.split(",")]) for number, line in numbered[1:end] if line.strip()]
    return FormatTable.from_rows((*_HEADER, "setpoint [degC]"), rows, "heattest.csv of Kalico's PID_CALIBRATE: "
                                 f"{count(len(numbered) - end, 'line')} of its peaks passed over.")


#: a report of temperatures, as M105, M155 and M303 make it: T:20.5 /60.0 B:22.1 /0.0 @:64 B@:0
_BEGINS: Final = r"(?<![^\s:].)"  # behind the first letter, which a search finds faster than what stands before it
_REPORT: Final = re.compile(rf"T{_BEGINS}\d?: ?-?\d+(?:\.\d+)? */-?\d")
_PART: Final = re.compile(rf"([TBC]{_BEGINS}\d?): ?(-?\d+(?:\.\d+)?) */ ?(-?\d+(?:\.\d+)?)")
_SMOOTHIE: Final = re.compile(r"(?:^|[\s:])([TBC]\d?):-?[\d.]+ */ ?-?[\d.]+ @(\d+)")
_SENT: Final = re.compile(r"@(?:(?<=(?<!\w)([TBC])@)|(?<!\w@))(\d?):(-?\d+)")
#: names of one heater: in printer.cfg and klippy.log, in Marlin's configuration, and the letters of its reports
_SAME: Final = (("extruder", "hotend", "T", "T0"), ("heater_bed", "bed", "B"))
_MARLIN_FULL: Final = 127  # Marlin's soft PWM has seven bits
_EIGHT_BITS_FULL: Final = 255


def _reports(numbered: Sequence[Line]) -> tuple[dict[str, list[str]], dict[str, list[int]], int]:
    """Return heater → stamp, name, °C, power and target of its reports in turn; their lines; the count of full power.

    Marlin reports 0…127 with the hot end's @ before the bed's, Repetier 0…255 with the bed's first, Smoothieware 0…255
    behind each heater.
    """
    heaters, lines = dict[str, list[str]](), dict[str, list[int]]()
    counts: dict[tuple[tuple[str, str, str], ...], dict[str, str]] = {}  # a log has few
    full = _MARLIN_FULL
    for number, line in numbered:
        if not (parts := _PART.findall(line)):
            continue
        if (sent := counts.get(matches := (*_SENT.findall(line),))) is None:
            sent = counts[matches] = {name: f"{int(value)}" for letter, digit, value in sorted(matches)
                                      for name in ((letter or "T") + digit, *(() if letter + digit else ("T0",)))}
            begins_with_bed = [match[:2] for match in matches[:2]] == [("B", ""), ("", "")]
            if begins_with_bed or max(map(int, sent.values()), default=0) > _MARLIN_FULL:
                full = _EIGHT_BITS_FULL
        if not sent and (sent := {name: f"{int(value)}" for name, value in _SMOOTHIE.findall(line)}):
            full = _EIGHT_BITS_FULL
        stamp = line_stamp(line)
        for name, degC, target in parts:
            if name in sent:
                heaters.setdefault(name, []).extend((stamp, name, degC, sent[name], target))
                lines.setdefault(name, []).append(number)
    if "T0" in heaters:
        heaters.pop("T", None)  # the same hot end twice
    return heaters, lines, full


def _serial(path: Path, numbered: Sequence[Line], tag: str | None) -> FormatTable:
    """Return the reports of one heater: T, T0, T1 …, B; the power is the number behind its @."""
    heaters, lines, full = _reports(numbered)
    moved = {name: _movement(cells) for name, cells in heaters.items()}
    if not moved:
        raise LogError("the lines report temperatures without the power behind @", file=path,
                       expected="reports such as T:20.5 /60.0 @:64, which M105 and M155 make")
    hot = [name for name, by_degC in moved.items() if by_degC > _MOVED_DEGC]
    if tag not in heaters and (tag is not None or (len(hot) != 1 and len(moved) > 1)):
        problem = "the printer has several heaters" if tag is None else "the printer has no such heater"
        raise LogError(problem, file=path, value=", ".join(moved) if tag is None else tag,
                       expected=f"--tag and one of {', '.join((hot if tag is None else []) or moved)}")
    heater = tag or (hot or [*moved])[0]
    cells = heaters[heater]
    begin = 0 if all(cells[::_CELLS]) else 1  # without stamps
    names = ", ".join(name for name in heaters if name != heater)
    others = f"; other heaters: {names} (--tag)" if names else ""
    header = ("time", "name", "temperature [degC]", f"power [0...{full}]", "setpoint [degC]")
    number = count(len(lines[heater]), "line")
    return FormatTable(header[begin:], _rows(cells, begin), lines[heater], [
        f"Reports of a printer: {number} of {heater!r} read, its power as 0 to {full}{others}."])


def _first_line(pattern: re.Pattern[str], lines: Sequence[Line]) -> bool:
    return bool(lines) and pattern.fullmatch(lines[0][1]) is not None


PRINTER_LOGS: Final = (
    TextFormat("klippy.log", matching(_STATS_WITH_HEATER), _klippy),
    TextFormat("heattest.txt", lambda lines: _first_line(_PWM, lines), _klipper_test),
    TextFormat("heattest.csv", lambda lines: _first_line(_KALICO, lines), _kalico_test),
    TextFormat("serial log of a printer", matching(_REPORT), _serial))
