"""What a printer with Klipper or Kalico writes of its heaters → one table; text that is none of these is left alone.

Read are the lines Stats of klippy.log, one a second, and what PID_CALIBRATE writes with WRITE_FILE=1: Klipper's
heattest.txt, and Kalico's heattest.csv, whose second table tells of the peaks.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

from heatertune.errors import LogError
from heatertune.units import count

__all__ = ["PrinterTable", "printer_table"]

#: begins a line of klippy.log: seconds of the host's clock
_STATS: Final = re.compile(r"Stats (\d+\.\d+): ")
_HEATER: Final = re.compile(r"(?:^|\s)(\S+): target=(-?\d+) temp=(-?\d+\.\d+) pwm=(\d\.\d+)(?=\s|$)")
_PWM: Final = re.compile(r"pwm: (-?\d+\.\d+) (-?\d+\.\d+)\s*")
_TEMPERATURE: Final = re.compile(r"(-?\d+\.\d+) (-?\d+\.\d+)\s*")
_KALICO: Final = re.compile(r"time, temp, pwm, target\s*")
_PEAKS: Final = re.compile(r"sample, low time, low, high time, high, max power\s*")

#: the heater that is read where none is asked for
_USUAL: Final = "extruder"
_HEADER: Final = ("time [s]", "temperature [degC]", "power [0...1]")
_LEAST: Final = 2

_Line = tuple[int, str]


class PrinterTable(NamedTuple):
    """A table of one heater: names of the columns, cells, number of each row's line, and what was passed over."""

    header: tuple[str, ...]
    rows: list[list[str]]
    lines: list[int]
    repairs: list[str]


def printer_table(path: Path, numbered: Sequence[_Line], tag: str | None) -> PrinterTable | None:
    """Return what a printer wrote of one heater; None: the lines are something else.

    Args:
        path: the file, for error messages.
        numbered: number and content of each line.
        tag: the heater's name, "extruder", "heater_bed"; None: the extruder where there is one, else the only one.

    Raises:
        LogError: no such heater; several, none of them the extruder; a line that is cut.
    """
    stats = [(number, found, line) for number, line in numbered if (found := _STATS.match(line)) is not None]
    if sum(_HEATER.search(line) is not None for _, _, line in stats[:50]) >= _LEAST:
        return _of_stats(path, len(numbered), stats, tag)
    if numbered and tag is None:
        if _PWM.fullmatch(numbered[0][1]):
            return _of_test(path, numbered)
        if _KALICO.fullmatch(numbered[0][1]):
            return _of_kalico(numbered)
    return None


def _of_stats(
    path: Path, total: int, stats: Sequence[tuple[int, re.Match[str], str]], tag: str | None
) -> PrinterTable:
    heaters: dict[str, list[tuple[int, list[str]]]] = {}
    for number, found, line in stats:
        for name, target, temperature, pwm in _HEATER.findall(line[found.end():]):
            heaters.setdefault(name, []).append((number, [found[1], name, temperature, pwm, target]))
    wanted = tag or (_USUAL if _USUAL in heaters else None) or (next(iter(heaters)) if len(heaters) == 1 else None)
    if wanted not in heaters:
        problem = "the printer has several heaters" if tag is None else "the printer has no such heater"
        raise LogError(problem, file=path, value=", ".join(heaters) if tag is None else tag,
                       expected=f"--tag and one of {', '.join(heaters)}")
    rows = heaters[wanted]
    repairs = [f"klippy.log: {count(len(rows), 'line')} Stats of {wanted!r} read, {total - len(rows)} others passed "
               "over; power is what was sent last before each of them."]
    others = [name for name in heaters if name != wanted]
    if others:
        repairs.append(f"Other heaters in it: {', '.join(others)} (--tag).")
    header = (_HEADER[0], "name", *_HEADER[1:], "setpoint [degC]")
    return PrinterTable(header, [row for _, row in rows], [number for number, _ in rows], repairs)


def _of_test(path: Path, numbered: Sequence[_Line]) -> PrinterTable:
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
    return PrinterTable(_HEADER, rows, lines, repairs)


def _of_kalico(numbered: Sequence[_Line]) -> PrinterTable:
    """Return the first table of heattest.csv."""
    end = next((k for k, (_, line) in enumerate(numbered) if _PEAKS.fullmatch(line)), len(numbered))
    kept = [(number, [cell.strip() for cell in line.split(",")]) for number, line in numbered[1:end] if line.strip()]
    peaks = count(len(numbered) - end, "line")
    repairs = [f"heattest.csv of Kalico's PID_CALIBRATE: {peaks} of its peaks passed over."]
    return PrinterTable((*_HEADER, "setpoint [degC]"), [row for _, row in kept], [number for number, _ in kept],
                        repairs)
