"""Rows that hold a part of the readings: written when a value changes, or by several heaters in turns.

Home automation, historians and exception reporting write a row only when a value changes. A value that was not written
has changed by less than its step, so the temperature is constant between two rows. Rows with this value are inserted at
the interval of the readings; the power keeps its own time stamps.

Where rows come from several heaters in turns, the reader asks which of them to read; they are never mixed. A column may
name the heater of each row; without one the readings jump back and forth between as many curves.

Also the quality flag of a historian or panel instrument → rows to use.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.errors import LogError
from heatertune.log.columns import Columns
from heatertune.log.quantities import is_number, is_switch_word, plain_name, says_nothing
from heatertune.log.sheet import CellColumn, Sheet
from heatertune.log.side_columns import quoted
from heatertune.log.timestamps import stamp
from heatertune.settings import ReadSettings
from heatertune.units import count

__all__ = ["OnChange", "RestoredRows", "demand_one_heater_by_name", "demand_one_heater_by_turns", "good_rows",
           "heater_column", "held_readings", "is_quality", "on_change", "rows_of_one_heater", "rows_of_turn", "spread",
           "stale_readings", "turn_of", "with_heaters_in_tags", "without_blank_power"]


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
    own_rows = _have_own_rows(blank, written)
    sparse = 0 < len(written) < len(cells) and (
        own_rows or sheet.other_file != "" or _is_of_changes(cells.at_rows(written), int(written[0])))
    if not sparse:
        return sheet, time, blank & cells.differs() if np.any(blank) else blank
    first = int(written[0])
    last = written[np.searchsorted(written, np.arange(first, len(cells)), side="right") - 1]
    how = ("is written where it changes", "has rows of its own")[own_rows]
    repairs.append(f"The power {how}; it was held through {count(len(cells) - len(written) - first, 'row')}.")
    edge = np.isin(np.arange(len(cells)), written)
    filled_sheet = sheet.at_rows(slice(first, None)).with_column(place, cells.at_rows(last))
    if sheet.power_lines is not None:
        filled_sheet = replace(filled_sheet, power_lines=sheet.power_lines[last])
    return filled_sheet, time[first:], (blank & edge)[first:]


_SHORTEST_HOLD, _LONGEST_HOLD = 3, 60  # rows
_AT_BEGIN: Final = 0.98  # share of the changes that occur where a row is written anew
_CHANGED: Final = 0.6  # share of the rows written anew that differ from the one before


def held_readings(readings: Array) -> Mask:
    """Return which readings only hold the one before, shape (n,), where a device reads its sensor in every k-th row.

    All changes are then k rows apart, or a multiple of it, and most readings of the sensor differ.

    Args:
        readings: shape (n,), NaN where there is none.
    """
    repeats = np.zeros(len(readings), dtype=np.bool_)
    changes = np.flatnonzero(np.diff(readings) != 0.0) + 1
    few = int(2.0 * (1.0 - _AT_BEGIN) * len(changes)) + 1  # two rows written anew for each change elsewhere
    longest = min(_LONGEST_HOLD, np.partition(np.diff(changes), few)[few]) if len(changes) >= _FEWEST else 0
    for length in range(_SHORTEST_HOLD, longest + 1):
        phases = np.bincount(changes % length, minlength=length)
        begin = int(phases.argmax())
        if phases[begin] > max(_AT_BEGIN * len(changes), _CHANGED * len(readings) / length):
            repeats[begin:] = (np.arange(begin, len(readings)) - begin) % length != 0
            repeats[1:begin] = True
    return repeats


_NEAR_STALE: Final = 12  # steps on each side, by which the noise is judged
_MOVES: Final = 0.65  # share of these that are no repeats: noise beyond the last digit
_BY_CHANCE: Final = 1e-3  # of a log


def stale_readings(readings: Array) -> Mask:
    """Return which readings repeat the one before though all others near them move, shape (n,).

    A sensor, a bus or a device that hangs for a while repeats its last reading. Noise hardly ever does, and a heater
    that moves does not stand and then make up for it in one step. A heater at rest whose last digit stands does not
    flicker up and down before and after it. At the largest and the smallest reading, an input is at its end.

    Args:
        readings: shape (n,), NaN where there is none.
    """
    steps, stale = np.diff(readings), np.zeros(len(readings), dtype=np.bool_)
    lowest, highest = np.fmin.reduce(readings, initial=np.inf), np.fmax.reduce(readings, initial=-np.inf)
    stands = (steps == 0.0) & (readings[1:] > lowest) & (readings[1:] < highest)
    bounds = np.flatnonzero(np.diff(np.concatenate([[False], stands, [False]]).astype(np.int8)))
    for begin, end in zip(bounds[::2].tolist(), bounds[1::2].tolist(), strict=True):
        sides = steps[max(begin - _NEAR_STALE, 0):begin], steps[end + 1:end + 1 + _NEAR_STALE]
        if min(map(len, sides)) == _NEAR_STALE and all(np.mean(side != 0.0) >= _MOVES for side in sides):
            near = np.concatenate(sides)
            share = (np.count_nonzero(near == 0.0) + 1.0) / (len(near) + 2.0)
            stale[begin + 1:end + 1] = len(readings) * share ** (end - begin) < _BY_CHANCE and (
                all(map(_flickers_often, sides)) or abs(steps[end]) > 2.0 * np.abs(near).max())
    return stale


def _flickers_often(steps: Array) -> bool:
    return bool(min(np.count_nonzero(steps > 0.0), np.count_nonzero(steps < 0.0)) > 1)


def _is_of_changes(written: CellColumn, first: int) -> bool:
    """Return whether written cells are changes; a single one is where `first`, the row of the first one, is 0."""
    repeats = np.count_nonzero(~written.differs()[1:])
    return bool((len(written) > 1 or first == 0) and repeats <= _REPEATS * len(written))


_OFTEN: Final = 0.1  # share of the rows; a power that is written where it changes seldom has as many


def _have_own_rows(blank: Mask, written: npt.NDArray[np.intp]) -> bool:
    """Return whether each row holds either a temperature or a power, as where two devices write one table."""
    powered = np.isin(np.arange(len(blank)), written)
    alone = np.count_nonzero(powered)
    return bool(alone >= _OFTEN * len(blank) and np.count_nonzero(powered != blank) <= _REPEATS * len(blank))


_MOST_LABELS: Final = 100
_LOOKED_AT: Final = 1000  # rows, to pass over readings and times soon
_FEWEST_EACH: Final = 10  # readings of each of two heaters
_IN_TURNS: Final = 0.2  # of the rows, at least, follow one of another heater
_APART: Final = 4.0  # times as far from the row before as from the last row of the same heater
_OF_SPAN: Final = 0.02  # of the log's span: as far as rows in turns are apart at least, in the mean
_MOST_TURNS: Final = 4
_JUMPING: Final = 0.6  # quantile of the steps from row to row: a few wild readings are none of another heater
_SHOWN: Final = 5
_NAMED: Final = re.compile(
    r"(zone|oven|furnace|device|unit|equipment|machine|loop|controller|extruder|nozzle|channel|sensor|probe|tag"
    r"|name|topic|id|slave|address|station|node|host|ofen|ger(ä|ae?)t|kanal|f(ü|ue)hler|regler|kreis)"
    r"( ?(name|id|no|nr|number|index|tag))?\.?", re.IGNORECASE)
_USUAL: Final = 0.95  # quantile of the steps of one heater
_TURN: Final = re.compile(r"([1-4]) of ([2-4])")


def heater_column(sheet: Sheet) -> int | None:
    """Return the column that names the heater of each row, if several heaters have rows in turns; otherwise None.

    Its cells are a few texts, or a few whole numbers under a name such as "zone". A column of numbers holds readings
    of at least two of the heaters, and where the name does not tell, these lie on curves of their own.
    """
    candidates = [i for i, cells in enumerate(sheet.columns) if _may_label(sheet, i, cells)]
    if not candidates:
        return None
    readings = [values for i, cells in enumerate(sheet.columns) if i not in candidates
                and np.count_nonzero(np.isfinite(values := _values(cells))) >= 2 * _FEWEST_EACH]
    candidates.sort(key=lambda i: all(map(is_number, _labels(sheet.columns[i]))))
    return next((i for i in candidates if any(_tells(sheet, i, values) for values in readings)), None)


def demand_one_heater_by_name(sheet: Sheet) -> None:
    """Refuse rows of several heaters that a column tells apart.

    Raises:
        LogError: there is such a column, and which options read one of the heaters.
    """
    i = heater_column(sheet)
    if i is None:
        return
    labels, name = _labels(sheet.columns[i]), sheet.names()[i]
    more = ", …" if len(labels) > _SHOWN else ""
    raise LogError(
        f"rows of several heaters or sensors in turns; column {name!r} tells them apart "
        f"({', '.join(labels[:_SHOWN])}{more})", file=sheet.file,
        expected=f"--tag {quoted(labels[0])} --tag-column {quoted(name)} to read one of them, or --tag-column none if "
                 "all are of one heater")


def with_heaters_in_tags(sheet: Sheet, tag: int) -> Sheet:
    """Return a long table whose tags name the heater, too, where another column tells several apart: A/temperature."""
    of_tag = sheet.columns[tag]
    for name in _labels(of_tag)[:_MOST_LABELS]:
        i = heater_column(sheet.at_rows(of_tag.where(name.__eq__)))
        if i is not None:
            joined = map("/".join, zip(sheet.columns[i], of_tag, strict=True))
            note = f"The tags are those of column {sheet.names()[i]!r} and of {sheet.names()[tag]!r}, with / between."
            return replace(sheet.with_column(tag, joined), repairs=(*sheet.repairs, note))
    return sheet


def _labels(cells: CellColumn) -> list[str]:
    return list(dict.fromkeys(cells.kinds()))


def _may_label(sheet: Sheet, i: int, cells: CellColumn) -> bool:
    """Return whether a column holds a few names, and often another one than in the row before."""
    if len(set(cells[:_LOOKED_AT])) > _MOST_LABELS:
        return False
    labels = _labels(cells)
    if not 2 <= len(labels) <= min(_MOST_LABELS, len(cells) // _FEWEST_EACH) or not _are_names(sheet, i, labels):
        return False
    return float(np.mean(np.diff(_codes(cells, labels)) != 0.0)) >= _IN_TURNS


def _are_names(sheet: Sheet, i: int, labels: Sequence[str]) -> bool:
    """Return whether the cells of a column are words but for on and off, or whole numbers under a fitting name."""
    if all(map(is_switch_word, labels)) or any(says_nothing(label) or stamp(label) is not None for label in labels):
        return False
    return not any(map(is_number, labels)) or (all(map(str.isdecimal, labels)) and _is_named(sheet, i))


def _is_named(sheet: Sheet, i: int) -> bool:
    return bool(sheet.header) and _NAMED.fullmatch(plain_name(sheet.header[i])) is not None


def _codes(cells: CellColumn, labels: Sequence[str]) -> Array:
    place = {label: float(k) for k, label in enumerate(labels)}
    return cells.numbers(place.__getitem__)


def _values(cells: CellColumn) -> Array:
    """Return the numbers in a column, NaN for other cells, shape (n,); none in a column of times or words."""
    values = cells.floats()
    if values is None and is_number(next((cell for cell in cells if not says_nothing(cell)), "")):
        values = cells.numbers(lambda cell: float(cell) if is_number(cell) and "," not in cell else np.nan)
    return np.zeros(0) if values is None or np.all(np.diff(values) >= 0.0) else values


def _tells(sheet: Sheet, i: int, values: Array) -> bool:
    """Return whether two heaters have readings in a column, by name or on curves of their own."""
    finite_rows = np.flatnonzero(np.isfinite(values))
    codes = _codes(sheet.columns[i], _labels(sheet.columns[i]))[finite_rows]
    values, numbers = values[finite_rows], np.unique(codes, return_counts=True)[1]
    if np.count_nonzero(numbers >= _FEWEST_EACH) < 2:
        return False
    if _is_named(sheet, i):
        return True
    own = np.concatenate([np.abs(np.diff(values[codes == code])) for code in np.unique(codes)])
    other = np.abs(np.diff(values))[np.diff(codes) != 0.0]
    return len(other) > 0 and float(np.mean(other)) > max(
        _APART * float(np.mean(own)), _OF_SPAN * float(np.ptp(values)))


def rows_of_one_heater(sheet: Sheet, columns: Columns, settings: ReadSettings, *, is_long: bool) -> Sheet:
    """Return the rows of the turn that the tag selects, such as "1 of 2", else all.

    Args:
        sheet: the cells.
        columns: which column is what.
        settings: a tag column of "none" says that all rows are of one heater.
        is_long: whether the rows are selected by their tags.

    Raises:
        LogError: rows without a name that come from several heaters in turns, of which none is selected.
    """
    turn = turn_of(settings.tag)
    if turn is not None:
        return rows_of_turn(sheet, columns, turn)
    if not is_long and settings.tag_column is None:
        demand_one_heater_by_turns(sheet, columns)
    return sheet


def demand_one_heater_by_turns(sheet: Sheet, columns: Columns) -> None:
    """Refuse rows without a name that come from several heaters, or sensors, in turns.

    Raises:
        LogError: the temperature jumps back and forth between as many curves.
    """
    values = _values(sheet.columns[columns.index["temperature"]])
    values = values[np.isfinite(values)]
    if len(values) < 2 * _FEWEST_EACH * 2 or len(np.unique(values)) <= _FEWEST_EACH:
        return
    jump = float(np.quantile(np.abs(np.diff(values)), _JUMPING))
    lags = [float(np.mean(np.abs(values[lag:] - values[:-lag]))) for lag in range(2, _MOST_TURNS + 1)]
    limit = _OF_SPAN * float(np.ptp(values))
    turns = next((lag for lag, mean in enumerate(lags, start=2) if jump > max(_APART * mean, limit)), None)
    if turns is not None:
        raise LogError(
            f"the temperature jumps back and forth, as where {turns} heaters or sensors have rows in turns",
            file=sheet.file, column=columns.names["temperature"],
            expected=f'--tag "1 of {turns}" or another to read the rows of one, or --tag-column none if all are of one')


def turn_of(tag: str | None) -> tuple[int, int] | None:
    """Return which of how many turns a tag selects, such as "1 of 2"; None if it is another tag."""
    match = None if tag is None else _TURN.fullmatch(tag.strip())
    return (int(match[1]), int(match[2])) if match and int(match[1]) <= int(match[2]) else None


def rows_of_turn(sheet: Sheet, columns: Columns, turn: tuple[int, int]) -> Sheet:
    """Return the rows of one of several heaters that come in turns.

    A row that the log lacks shifts the turns: where a reading lies on the curve after its own, it is of that heater.
    """
    number, count = turn
    values = _values(sheet.columns[columns.index["temperature"]])
    owner: npt.NDArray[np.intp] = np.arange(len(sheet)) % count
    shifts = 0
    if len(values):
        last, due = values[:count].tolist(), 0
        usual = float(np.nanquantile(np.abs(values[count:] - values[:-count]), _USUAL)) if len(values) > count else 0.0
        for k, value in enumerate(values.tolist()):
            after = (due + 1) % count
            if abs(value - last[due]) > _APART * (abs(value - last[after]) + usual):
                due, shifts = after, shifts + 1
            owner[k], last[due] = due, value if np.isfinite(value) else last[due]
            due = (due + 1) % count
    own = owner == number - 1
    note = f"Of {len(sheet)} rows in turns of {count} the {np.count_nonzero(own)} of turn {number} were read" + (
        f"; rows are missing in {shifts} turns, before which it may be another heater's." if shifts else ".")
    return replace(sheet.at_rows(own), repairs=(*sheet.repairs, note), part=f"{number} of {count}")
