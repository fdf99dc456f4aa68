"""A recorded sequence of raw inputs through a room: the way to hold it against a trace of a real PLC."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path

from heatertune.errors import LogError
from heatertune.files import read_bytes
from heatertune.plc.room import FORMATS, Number, Room, Scan, Words, holds
from heatertune.plc.single import single

__all__ = ["powers", "read_inputs", "replay"]


def replay(
    room: Room, words: Words, rows: Sequence[Mapping[str, Number]], switches: Mapping[str, str] | None = None
) -> list[Scan]:
    """Return what each scan gave, from the cold state on.

    Args:
        room: the controller.
        words: its words.
        rows: input name → value in the controller's units, one mapping per scan; see `Room.inputs`.
        switches: settings of what the manual leaves open; those not named have their default.

    Raises:
        OutOfRange: a word the room does not allow.
        UnknownName: a switch or setting the room does not have.
    """
    room.check(words)
    state, scans = room.start(words, switches or {}), []
    for row in rows:
        state, scan = room.scan(state, row)
        scans.append(scan)
    return scans


def powers(
    room: Room, words: Words, temperatures_degC: Sequence[float], setpoints_degC: Sequence[float],
    switches: Mapping[str, str] | None = None,
) -> list[float]:
    """Return the power from each scan to the next [%], from the cold state on, one scan per temperature.

    A controller that makes the PWM itself takes up a new power where a period begins, at the first scan for the first
    time; the power is the mean over that period.

    Raises:
        OutOfRange, UnknownName: as `replay`.
    """
    room.check(words)
    state, timing = room.start(words, switches or {}), room.timing(words)
    per_period = 1 if timing.pwm_period_s is None else max(1, round(timing.pwm_period_s / timing.scan_s))
    found, held = [], 0.0
    for k, (temperature, setpoint) in enumerate(zip(temperatures_degC, setpoints_degC, strict=True)):
        begins = k % per_period == 0
        asked, reading = room.measure(words, setpoint), room.measure(words, temperature)
        state, scan = room.step(state, asked, reading, cycle_start=begins)
        held = scan.power_pct if begins else held
        found.append(held)
    return found


def read_inputs(path: str | Path, room: Room) -> list[dict[str, Number]]:
    """Return the rows of a CSV file with a header of input names.

    Raises:
        LogError: the file cannot be read, a needed column is missing, one is unknown, a cell is not of its format.
    """
    try:
        table = list(csv.reader(io.StringIO(read_bytes(path).decode("utf-8-sig"), newline="")))
    except (OSError, UnicodeDecodeError, csv.Error) as problem:
        raise LogError(f"cannot be read: {getattr(problem, 'strerror', None) or 'no text'}", file=path) from problem
    header = [name.strip() for name in table[0]] if table else []
    needed, others = list(room.inputs)[:2], list(room.inputs)[2:]
    expected = f"{', '.join(needed)} and, if wanted, {', '.join(others)}"
    if not set(needed) <= set(header) or not set(header) <= set(room.inputs):
        raise LogError(f"the columns are {', '.join(header) or 'none'}", file=path, line=1, expected=expected)
    rows = []
    for line, cells in enumerate(table[1:], start=2):
        if len(cells) != len(header):
            raise LogError(f"{len(cells)} cells in this row", file=path, line=line, expected=str(len(header)))
        pairs = zip(header, cells, strict=True)
        rows.append({name: _number(path, line, name, cell, room.inputs[name]) for name, cell in pairs})
    return rows


def _number(path: str | Path, line: int, name: str, cell: str, format_: str) -> Number:
    value: Number | None
    try:
        value = single(float(cell)) if format_ == "REAL" else int(cell)
    except ValueError:
        value = None
    if value is None or not holds(format_, value):
        low, high = FORMATS[format_]
        expected = f"{format_}, a {'' if format_ == 'REAL' else 'whole '}number {low:.9g}…{high:.9g}"
        raise LogError("no input:", file=path, line=line, column=name, value=cell, expected=expected)
    return value
