"""Logs with a row only when a value changes: home automation, historians, exception reporting.

A value that was not written has changed by less than its step, so the temperature is constant between two rows. Rows
with this value are inserted at the interval of the readings; the power keeps its own time stamps.

Also the quality flag of a historian or panel instrument → rows to use.
"""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.errors import LogError
from heatertune.log.columns import Columns
from heatertune.log.quantities import plain_name, says_nothing
from heatertune.log.sheet import CellColumn, Sheet
from heatertune.units import count

__all__ = [
    "OnChange", "RestoredRows", "good_rows", "held_readings", "is_quality", "on_change", "spread",
    "without_blank_power",
]


_QUALITY: Final = re.compile(
    r"((opc ?)?quality( ?code)?|qual|valid(ity)?|status ?code|good|qualit(ä|ae?)t|g(ü|ue)ltig(keit)?)", re.IGNORECASE)
_STATUS_CODE: Final = re.compile(r"status ?code", re.IGNORECASE)
_VALID: Final = re.compile(r"valid(ity)?|good|g(ü|ue)ltig(keit)?", re.IGNORECASE)
_WORDS: Final = re.compile(r"(good|gut|ok|valid|gültig|true|wahr|yes|ja)\b.*", re.IGNORECASE)
_BAD_WORDS: Final = re.compile(r"(?i)(bad|uncertain|questionable|substitut|invalid|not ?good|error|false|falsch|no\b"
                               r"|nein|schlecht|ungültig|unsicher|unknown|unavailable|fail|stale|offline|comm).*")
_OPC_GOOD: Final = 192  # OPC DA: the two high bits of the byte, 0xC0; 216 is a local override, good too


def is_quality(name: str) -> bool:
    """Return whether a column's name denotes a quality flag."""
    return _QUALITY.fullmatch(plain_name(name)) is not None


def good_rows(sheet: Sheet, i: int) -> npt.NDArray[np.bool_]:
    """Return which rows a column flags as good, shape (n,).

    Good are 192 to 255 of OPC DA (0xC0), 0 of an OPC UA status code, 1 of a validity (a WinCC panel writes 0 for a lost
    connection and 2 where it stops), and words such as Good.

    Raises:
        LogError: flags whose meaning is not known.
    """
    kinds = set(sheet.columns[i].kinds())
    meaning = _by_words(kinds) or _by_numbers(kinds, sheet.header[i] if sheet.header else "")
    if meaning is None:
        shown = ", ".join(sorted(kinds)[:6]) or "empty"
        raise LogError(f"quality flags whose meaning is not known ({shown})", file=sheet.file,
                       column=sheet.names()[i],
                       expected="192 or Good, 1 of a validity, or --quality-column none to read all rows")
    return sheet.columns[i].where(meaning.__getitem__)


def _by_words(kinds: set[str]) -> dict[str, bool] | None:
    good = {cell for cell in kinds if _WORDS.fullmatch(cell)}
    return {cell: cell in good for cell in kinds} if all(
        cell in good or _BAD_WORDS.fullmatch(cell) for cell in kinds) else None


def _by_numbers(kinds: set[str], name: str) -> dict[str, bool] | None:
    try:
        codes = {cell: int(float(cell)) if "x" not in cell.lower() else int(cell, 16) for cell in kinds}
    except (ValueError, OverflowError):
        return None
    numbers = set(codes.values())
    if _STATUS_CODE.fullmatch(plain_name(name)) and 0 in numbers:
        return {cell: code == 0 for cell, code in codes.items()}
    if numbers <= {0, 1, 2} and _VALID.fullmatch(plain_name(name)):
        return {cell: code == 1 for cell, code in codes.items()}
    if all(0 <= code <= 255 for code in numbers) and max(numbers) >= _OPC_GOOD:
        return {cell: code >= _OPC_GOOD for cell, code in codes.items()}
    return None


Mask = npt.NDArray[np.bool_]

_FEWEST: Final = 20
_LONG: Final = 1.5  # times the interval of the readings
_LONG_SHARE: Final = 0.03  # of the intervals are long, at least, if rows are written on change
_REPEATS: Final = 0.02  # share of the readings that may repeat the one before
_ONE_STEP: Final = 1.6  # times the smallest change: the value had moved by one step when it was written
_FASTEST: Final = 1.5  # times the fastest change between two readings that follow at once
_MOST_ROWS: Final = 20_000  # put back
_NEAR_STEPS: Final = 5
_FEWEST_REPEATS: Final = 5.0  # to be expected: by chance a sampled log has none in one of 150 cases
_FLICKER_REPEATS: Final = 0.1  # of the repeats that are to be expected


class OnChange(NamedTuple):
    """How readings are written on change.

    Attributes:
        interval_s: between two readings of which each is written [s].
        step_degC: by which a reading moves before it is written, in the unit of the readings.
        rounded: whether the readings are whole steps; otherwise they are written as soon as they moved by one.
    """

    interval_s: float
    step_degC: float
    rounded: bool


class RestoredRows(NamedTuple):
    """Rows including the inserted ones: the row that each continues, shape (n,), its instant [s] and temperature."""

    source: npt.NDArray[np.intp]
    time_s: Array
    temperature: Array


def on_change(time: Array, readings: Array) -> OnChange | None:
    """Return how readings are written on change, None if rows are not only written on change.

    They are if hardly any reading repeats the previous one immediately, and if the readings after a long pause have
    mostly moved by no more than the smallest change. After a gap, a log may have moved by any amount. Rounded readings
    that flicker by one step up and down would also repeat as often: if none does, the repeats were not written.

    Args:
        time: of each reading, shape (n,) [s].
        readings: shape (n,), finite.
    """
    if len(time) < _FEWEST:
        return None
    pauses, changes = np.diff(time), np.abs(np.diff(readings))
    moved = changes > 0.0
    if not np.any(moved):
        return None
    interval = float(np.percentile(pauses[moved], 10.0))
    long = pauses > _LONG * interval
    repeated = np.count_nonzero(~moved & ~long) > _REPEATS * len(pauses)
    if interval <= 0.0 or repeated or np.count_nonzero(long & moved) < max(3.0, _LONG_SHARE * len(pauses)):
        return None
    smallest = float(np.percentile(changes[moved], 5.0))
    if float(np.median(changes[long & moved])) > _ONE_STEP * smallest:
        smallest = float(np.min(changes[moved]))  # of a sensor's last digit
        if not _flickers(readings / smallest):
            return None
    return OnChange(interval, smallest, _is_rounded(readings / smallest))


def _is_rounded(levels: Array) -> bool:
    return float(np.mean(np.abs(levels - np.round(levels)) < 0.05)) > 0.9


def _flickers(levels: Array) -> bool:
    """Return whether whole steps up and down are so many that repeats can only be absent because they are not written.

    The levels are the readings in steps, shape (n,).
    """
    steps = np.round(np.diff(levels))
    up, down = (np.count_nonzero((sign * steps >= 1.0) & (sign * steps <= _NEAR_STEPS)) for sign in (1.0, -1.0))
    repeats = min(up, down) / _NEAR_STEPS  # to be expected, as often as any other step near 0
    return bool(_is_rounded(levels) and repeats >= _FEWEST_REPEATS and (
        np.count_nonzero(steps == 0.0) < _FLICKER_REPEATS * repeats))


def spread(time: Array, readings: Array, written: OnChange, breaks: Array) -> RestoredRows:
    """Insert the rows that were not written because the value had not changed.

    A pause remains if a reading was lost in it, or if the next reading has changed faster than any that follows
    immediately: the value was not available.

    Args:
        time: of each row, shape (n,) [s].
        readings: shape (n,).
        written: how they are written.
        breaks: instants of known lost readings, ascending, shape (k,) [s].
    """
    pauses, changes = np.diff(time), np.diff(readings)
    interval, step = written.interval_s, written.step_degC
    short = pauses <= _LONG * interval
    fastest = float(np.max(np.abs(changes[short]), initial=step))
    lost = np.searchsorted(breaks, time[1:]) > np.searchsorted(breaks, time[:-1])
    filled = ~short & ~lost & (np.abs(changes) <= _FASTEST * fastest + step)
    every = interval * max(1.0, np.sum(pauses[filled]) / interval / _MOST_ROWS)
    source, instants, values = [np.arange(len(time))], [time], [readings]
    for k in np.flatnonzero(filled):
        back = time[k + 1] - interval - every * np.arange(int(max(0.0, pauses[k] - _LONG * interval) / every) + 1)
        back = back[back > time[k] + 0.5 * interval][::-1]
        drifts = not written.rounded and abs(changes[k]) <= _ONE_STEP * step
        along = (back - time[k]) / pauses[k] if drifts else np.zeros(len(back))
        source.append(np.full(len(back), k))
        instants.append(back)
        values.append(readings[k] + changes[k] * along)
    order = np.argsort(np.concatenate(instants), kind="stable")
    return RestoredRows(np.concatenate(source)[order], np.concatenate(instants)[order], np.concatenate(values)[order])


def without_blank_power(sheet: Sheet, columns: Columns, time: Array, repairs: list[str]) -> tuple[Sheet, Array, Mask]:
    """Return the sheet with blank powers held, its times, and its rows that hold another power but no temperature.

    Both are of shape (n,); rows before the first power are left out.

    Powers are held where the table has a value only where it changes: a written power never repeats the one before, and
    a row without a temperature is there because power or setpoint change. A single power in the first row stays.
    """
    blank = sheet.columns[columns.index["temperature"]].where(says_nothing)
    if "power" not in columns.index:
        return sheet, time, np.zeros(len(blank), dtype=np.bool_)
    place = columns.index["power"]
    cells = sheet.columns[place]
    written = np.flatnonzero(~cells.where(says_nothing))
    sparse = 0 < len(written) < len(cells) and (
        sheet.other_file != "" or _is_of_changes(cells.at_rows(written), int(written[0])))
    if not sparse:
        return sheet, time, blank & cells.differs() if np.any(blank) else blank
    first = int(written[0])
    last = written[np.searchsorted(written, np.arange(first, len(cells)), side="right") - 1]
    repairs.append("The power is written where it changes; it was held through "
                   f"{count(len(cells) - len(written) - first, 'row')}.")
    edge = np.isin(np.arange(len(cells)), written)
    held = sheet.at_rows(slice(first, None)).with_column(place, cells.at_rows(last))
    if sheet.power_lines is not None:
        held = replace(held, power_lines=sheet.power_lines[last])
    return held, time[first:], (blank & edge)[first:]


_SHORTEST_HOLD, _LONGEST_HOLD = 3, 60  # rows
_AT_BEGIN: Final = 0.98  # share of the changes that occur where a row is written anew
_CHANGED: Final = 0.6  # share of the rows written anew that differ from the one before


def held_readings(readings: Array) -> Mask:
    """Return which readings only hold the one before, shape (n,), where a device reads its sensor in every k-th row.

    All changes are then k rows apart, or a multiple of it, and most readings of the sensor differ.

    Args:
        readings: shape (n,), NaN where there is none.
    """
    held = np.zeros(len(readings), dtype=np.bool_)
    changes = np.flatnonzero(np.diff(readings) != 0.0) + 1
    few = int(2.0 * (1.0 - _AT_BEGIN) * len(changes)) + 1  # two rows written anew for each change elsewhere
    longest = min(_LONGEST_HOLD, np.partition(np.diff(changes), few)[few]) if len(changes) >= _FEWEST else 0
    for length in range(_SHORTEST_HOLD, longest + 1):
        phases = np.bincount(changes % length, minlength=length)
        begin = int(phases.argmax())
        if phases[begin] > max(_AT_BEGIN * len(changes), _CHANGED * len(readings) / length):
            held[begin:] = (np.arange(begin, len(readings)) - begin) % length != 0
            held[1:begin] = True
    return held


def _is_of_changes(written: CellColumn, first: int) -> bool:
    """Return whether written cells are changes; a single one is where `first`, the row of the first one, is 0."""
    repeats = np.count_nonzero(~written.differs()[1:])
    return bool((len(written) > 1 or first == 0) and repeats <= _REPEATS * len(written))
