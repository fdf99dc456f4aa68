"""The loops of a folder of logs, and what a log shows if no heater is known: swings, limits, switchings."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from enum import Enum
from itertools import pairwise
from pathlib import Path, PurePath
from typing import Any, Final

import numpy as np

from heatertune.arrays import Array
from heatertune.codec import read_toml
from heatertune.errors import HeatertuneError, InputError, UnknownName, did_you_mean
from heatertune.log.log_values import Log
from heatertune.plc import controller_for
from heatertune.proof.phase_statistics import turning_points
from heatertune.proof.ripple_and_wear import SWITCHES
from heatertune.units import check
from heatertune.writing import read_text

__all__ = [
    "Cause", "LoopEntry", "LoopFault", "RegularLog", "Swings", "at_limit", "average_log", "course_of", "list_loops",
    "offset_degC", "read_list", "swings", "switching_period_s", "switchings_per_h",
]


_ROWS: Final = 6000
_OF_FIT: Final = 1500  # rows: more tell no more of a heater, but take time
_NOISE: Final = 4.0  # standard deviations: as far as the error of a loop at rest goes
_LEAST: Final = 0.002  # of the rise above the coldest reading: less is nobody's concern
_ENDS: Final = (1.0, 99.0)  # power that counts as off and on [%]
_REGULAR: Final = 0.15  # of a period between its quartiles: a PWM is a clock
_EDGES: Final = 12
_OF_LARGEST: Final = 0.2  # of the largest error of an event: a smaller way back is no half cycle
_TURN: Final = 6.0  # standard deviations of averages: as far as these go to and fro without a loop's doing
_EVEN: Final = 2.2  # ratio of a half cycle to the median one
_MOSTLY: Final = 0.6  # of the half cycles are even
_LAST: Final = 10  # part of a stretch whose slope tells where it goes
_STAYS: Final = 0.95  # of an error, from a fifth of a part to the next
_MOVES_PCT: Final = 0.5  # of power, likewise: more is an integral part at work
_STILL: Final = 0.3  # of the log, at least, at a limit


@dataclass(frozen=True, slots=True, kw_only=True)
class RegularLog:
    """A log at equal steps, averaged over the PWM period: without that a good loop swings with its PWM.

    Attributes:
        time_s: [s], shape (n,).
        temperature_degC, setpoint_degC, power_pct: likewise; None: the power is not known.
        changes_s: when the setpoint changes, the begin of the log being the first [s].
        least_degC: an error that is noise, or too small for anyone to care [°C].
        step_degC: of the readings [°C].
        lowest_pct: power at full cooling, 0 without a cooler [% of full heating].
        turn_degC: a way back of the averages that is noise, or too small for anyone to care [°C].
    """

    time_s: Array
    temperature_degC: Array
    setpoint_degC: Array
    power_pct: Array | None
    changes_s: tuple[float, ...]
    least_degC: float
    turn_degC: float
    step_degC: float = 0.0
    lowest_pct: float = 0.0

    @property
    def error_degC(self) -> Array:
        """Setpoint minus temperature, shape (n,) [°C]."""
        return self.setpoint_degC - self.temperature_degC

    @property
    def hours(self) -> float:
        """How long it is [h]."""
        return float(np.ptp(self.time_s)) / 3600.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Swings:
    """The half cycles of the error that follow one event.

    Attributes:
        count: how many there are, one after the other on either side.
        period_s: of a whole cycle; 0 where there are fewer than two [s].
        size_degC: median peak to peak [°C].
        even: whether most are of one length.
    """

    count: int
    period_s: float
    size_degC: float
    even: bool


def switching_period_s(log: Log) -> float | None:
    """Return the PWM period where the logged power is the switch itself, on or off in even periods; else None [s]."""
    if log.power_pct is None:
        return None
    low, high = _ENDS
    if np.mean((log.power_pct <= low) | (log.power_pct >= high)) < 1.0 - low / 100.0:
        return None
    rises = log.time_s[1:][np.diff((log.power_pct > high / 2.0).astype(int)) > 0]
    if len(rises) < _EDGES:
        return None
    between = np.diff(rises)
    first, period, third = np.percentile(between, [25, 50, 75]).tolist()
    if third - first > _REGULAR * period:
        return None
    return float(between[np.abs(between - period) <= _REGULAR * period].mean())  # finer than the log's rows


def course_of(log: Log, pwm_period_s: float | None, changes_at_least_degC: float = 0.0) -> RegularLog:
    """Return a log's course, averaged over the PWM period.

    Args:
        log: with a setpoint.
        pwm_period_s: None: nothing is averaged but what many rows ask for.
        changes_at_least_degC: smaller changes of the setpoint are none [°C].
    """
    assert log.setpoint_degC is not None
    length = float(log.time_s[-1] - log.time_s[0])
    step = max(float(np.median(np.diff(log.time_s))), length / _ROWS)
    time = np.arange(log.time_s[0], log.time_s[-1] + 1e-9 * length, step)
    width = max(1, round((pwm_period_s or 0.0) / step))

    def mean(values: Array) -> Array:
        rows = np.interp(time, log.time_s, values)
        summed = np.cumsum(np.concatenate([np.full(width, rows[:width].mean()), rows]))
        return np.asarray((summed[width:] - summed[:-width]) / width)

    row_indices = np.maximum(np.searchsorted(log.time_s, time + 1e-9 * step, side="right") - 1, 0)
    setpoint = log.setpoint_degC[row_indices]
    readings = np.interp(time, log.time_s, log.temperature_degC)
    averages = mean(log.temperature_degC)
    levels = np.diff(np.unique(log.temperature_degC))
    level = float(np.min(levels)) if len(levels) else 0.0
    least = max(level, _LEAST * float(np.ptp(readings)))
    turn, least = max(_TURN * _noise(averages, width), least), max(_NOISE * _noise(readings, 1), least)
    moved = np.flatnonzero(np.abs(np.diff(setpoint)) > max(changes_at_least_degC, least)) + 1
    return RegularLog(
        time_s=time, temperature_degC=averages, setpoint_degC=setpoint,
        power_pct=None if log.power_pct is None else mean(log.power_pct),
        changes_s=(float(time[0]), *time[moved].tolist()), least_degC=least, turn_degC=turn, step_degC=level,
        lowest_pct=-100.0 * log.cooling_gain)


def _noise(rows: Array, apart: int) -> float:
    """Return the standard deviation of what rows so far apart do not share with a line [°C]."""
    bends = rows[2 * apart:] - 2.0 * rows[apart:-apart] + rows[:-2 * apart]
    return 1.4826 * float(np.median(np.abs(bends - np.median(bends)))) / math.sqrt(6.0) if len(bends) else 0.0


def swings(course: RegularLog, events_s: Sequence[float], shortest_s: float = 0.0) -> Swings:
    """Return the longest row of half cycles that follows one of the events.

    Args:
        course: of the loop.
        events_s: changes of the setpoint and loads, from the begin of the log on [s].
        shortest_s: half a cycle that is shorter is not the loop's: nothing answers within its dead time [s].
    """
    bounds = [*sorted(set(events_s)), float(course.time_s[-1])]
    candidates = [_half_cycles(course, start, end, shortest_s) for start, end in pairwise(bounds)]
    return max(candidates, key=lambda entry: entry.count * entry.even, default=Swings(
        count=0, period_s=0.0, size_degC=0.0, even=False))


def _half_cycles(course: RegularLog, start_s: float, end_s: float, shortest_s: float) -> Swings:
    """Return the ways from one turn to the next: a loop that swings as it nears its setpoint does not cross it."""
    inside = (course.time_s >= start_s) & (course.time_s < end_s)
    error, time = course.error_degC[inside], course.time_s[inside]
    none = Swings(count=0, period_s=0.0, size_degC=0.0, even=False)
    if not len(error):
        return none
    least = max(course.turn_degC, _OF_LARGEST * float(np.max(np.abs(error))))
    turns = np.array(turning_points(error.tolist(), least), dtype=int)
    lengths, sizes = np.diff(time[turns]), np.abs(np.diff(error[turns]))
    edges = np.flatnonzero(np.diff(np.concatenate([[0], (lengths >= shortest_s).astype(int), [0]])))
    in_a_row = max((slice(*pair) for pair in edges.reshape(-1, 2).tolist()), key=lambda row: row.stop - row.start,
                   default=slice(0))
    lengths, sizes = lengths[in_a_row], sizes[in_a_row]
    if len(lengths) < 3:  # the first comes from the event itself
        return none
    median = float(np.median(lengths[1:]))
    even = float(np.mean((lengths[1:] < _EVEN * median) & (lengths[1:] * _EVEN > median))) >= _MOSTLY
    return Swings(count=len(lengths), period_s=2.0 * median, even=even, size_degC=float(np.median(sizes)))


def at_limit(course: RegularLog, *, high: bool) -> float:
    """Return the share of the log at full power (or none) with the setpoint out of reach that way, 0…1.

    Where the temperature still comes nearer, as it does in a heat-up, nothing is at its limits: it would get there
    within the time that it has been at the limit so far, and does not come to rest before.
    """
    if course.power_pct is None:
        return 0.0
    low, full = course.lowest_pct + _ENDS[0], _ENDS[1]
    sign = 1.0 if high else -1.0
    is_at_limit = (course.power_pct >= full if high else course.power_pct <= low) & (
        sign * course.error_degC > course.least_degC)
    share, n = 0, len(is_at_limit)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], is_at_limit.astype(int), [0]])))
    for begin, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        last = slice(end - max(2, (end - begin) // _LAST), end)
        slope = float(np.polyfit(course.time_s[last], course.temperature_degC[last], 1)[0])
        comes = slope * (course.time_s[end - 1] - course.time_s[begin])
        if sign * min(comes, _to_rest(course.temperature_degC[begin:end], comes), key=abs) < (
                sign * course.error_degC[end - 1]):
            share += end - begin
    return share / n if share >= _STILL * n else 0.0


def _to_rest(rows: Array, otherwise: float) -> float:
    """Return how far rows go on where their last parts come nearer to each other, as with one lag [°C]."""
    part, n = max(1, len(rows) // _LAST), len(rows)
    if n < 3 * part:
        return otherwise
    first, second, third = (float(rows[n - (back + 1) * part:n - back * part].mean()) for back in (2, 1, 0))
    before, now = second - first, third - second
    return now * now / (before - now) if 0.0 < now / (before or 1.0) < 1.0 else otherwise


def offset_degC(course: RegularLog) -> float:
    """Return the error that stays, its sign kept: of the last fifth before each change the median, the smallest [°C].

    It is 0 where the error of one of them is within the noise, still falls, or the power still moves against it.
    """
    if course.power_pct is None:
        return 0.0
    rests = []
    for start, end in pairwise([*course.changes_s, float(course.time_s[-1]) + 1.0]):
        last = (course.time_s >= end - (end - start) / 5.0) & (course.time_s < end)
        before = (course.time_s >= end - 2.0 * (end - start) / 5.0) & (course.time_s < end - (end - start) / 5.0)
        if np.count_nonzero(last) < 5 or np.count_nonzero(before) < 5:
            continue
        now, then = float(np.median(course.error_degC[last])), float(np.median(course.error_degC[before]))
        moved = float(np.median(course.power_pct[last]) - np.median(course.power_pct[before]))
        stays = abs(now) > max(course.least_degC, _STAYS * abs(then)) and abs(moved) < _MOVES_PCT
        rests.append(now if stays else 0.0)
    return min(rests, key=abs, default=0.0)


def switchings_per_h(log: Log, pwm_period_s: float | None) -> float | None:
    """Return how often the switch opens or closes in an hour, None where neither log nor period tells."""
    if log.power_pct is None:
        return None
    low, high = _ENDS
    hours = float(log.time_s[-1] - log.time_s[0]) / 3600.0
    if switching_period_s(log) is not None:
        return float(np.count_nonzero(np.diff((log.power_pct > high / 2.0).astype(int)))) / hours
    if pwm_period_s is None:
        return None
    partly = float(np.mean((log.power_pct > low) & (log.power_pct < high)))
    return 2.0 * 3600.0 / pwm_period_s * partly


def average_log(log: Log, pwm_period_s: float | None, before_pct: float | None = None) -> Log:
    """Return a log with power at fewer rows, readings and power both averaged over whole PWM periods.

    What a heater makes of its power it makes of the averaged power too, and the ripple that no row of a log can follow
    is gone from both. Without a PWM period the average is that of a row; a short log is then returned as it is.

    Args:
        log: with power.
        pwm_period_s: as far as it is known; None: that of the switch, where the power is one.
        before_pct: power before the first row [%]; None: that of the first row.
    """
    assert log.power_pct is not None
    length, own = float(log.time_s[-1] - log.time_s[0]), float(np.median(np.diff(log.time_s)))
    step, period = max(length / _OF_FIT, own), pwm_period_s or switching_period_s(log)
    if period is None and step < 2.0 * own:
        return log
    width = step if period is None else max(period * math.ceil(step / period - 1e-9), own)
    time = log.time_s[0] + step * np.arange(int(length / step + 1e-9) + 1, dtype=np.float64)
    edges = np.append(time, time[-1] + step)
    before = float(log.power_pct[0]) if before_pct is None else before_pct
    times = np.concatenate([[log.time_s[0] - width], log.time_s])
    power = np.concatenate([[before], log.power_pct])
    twice = _integrated_twice(times, power, edges + 0.5 * width) - _integrated_twice(times, power, edges - 0.5 * width)
    middle = (log.temperature_degC[1:] + log.temperature_degC[:-1]) / 2.0
    warmth = np.concatenate([log.temperature_degC[:1], middle, log.temperature_degC[-1:]])
    once = _integrated(times, warmth, time + 0.5 * width) - _integrated(times, warmth, time - 0.5 * width)
    rows = np.searchsorted(log.time_s, time + 1e-9 * step, side="right") - 1
    return log.with_rows(
        time_s=time, temperature_degC=once / width, disturbance=None,
        power_pct=np.clip(np.diff(twice) / (width * step), -100.0 * log.cooling_gain, 100.0),
        setpoint_degC=None if log.setpoint_degC is None else log.setpoint_degC[rows])


def _integrated(time: Array, values: Array, at: Array) -> Array:
    """Return the integral of what is held from each instant to the next, the last for good, shape of `at`."""
    row = np.clip(np.searchsorted(time, at, side="right") - 1, 0, None)
    sums = np.concatenate([[0.0], np.cumsum(values[:-1] * np.diff(time))])
    return np.asarray(sums[row] + values[row] * (at - time[row]))


def _integrated_twice(time: Array, values: Array, at: Array) -> Array:
    """Return the integral of `_integrated`, exactly."""
    row, gap = np.clip(np.searchsorted(time, at, side="right") - 1, 0, None), np.diff(time)
    once = np.concatenate([[0.0], np.cumsum(values[:-1] * gap)])
    sums = np.concatenate([[0.0], np.cumsum(once[:-1] * gap + 0.5 * values[:-1] * gap**2)])
    since = at - time[row]
    return np.asarray(sums[row] + once[row] * since + 0.5 * values[row] * since**2)


class Cause(Enum):
    """What is wrong with a loop; each member's value is what to do about it."""

    FULL_POWER = "a stronger heater, less loss or a lower setpoint: no words help"
    NO_POWER = "look for heat from elsewhere, a stuck switch or a setpoint below the room: no words help"
    DRIFTED = "look at the heater (element, mains, insulation, sensor); then take the new words"
    OSCILLATING = "take calmer words"
    OFFSET = "take words with an integral part"
    SLUGGISH = "take faster words"
    WEAR = "take a longer PWM period"
    UNKNOWN = "log the power and a change of the setpoint until it rests, or list the controller and its words"
    WELL = "nothing"

    @property
    def label(self) -> str:
        """The cause as a table has it."""
        return self.name.lower().replace("_", " ")


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopEntry:
    """A loop as the list has it; what is not said is None or its default.

    Attributes:
        name: of the loop.
        file: its log, a path below the folder; of a loop that is recorded, the address of its PLC.
        target: the controller.
        folder: what `design` wrote for it: its words, and the heater they were made for.
        setpoint_degC: where the log holds none [°C].
        switch: what switches the heater, one of `heatertune.proof.ripple_and_wear.SWITCHES`; None: not known.
        pwm_period_s: of it [s].
        low_degC, high_degC: range of the sensor [°C]; None: that of its words, or as asked for.
        map: small file that says where the PLC shows temperature and power, where no `folder` does; of a loop that is
            recorded.

    Raises:
        OutOfRange: a period that is not above zero, a setpoint below the absolute zero, half a range or an empty one.
        UnknownName: no such switch.
    """

    name: str
    file: str
    target: str | None = None
    folder: str | None = None
    setpoint_degC: float | None = None
    switch: str | None = None
    pwm_period_s: float | None = None
    low_degC: float | None = None
    high_degC: float | None = None
    map: str | None = None

    def __post_init__(self) -> None:
        if self.pwm_period_s is not None:
            check("pwm_period_s", self.pwm_period_s, above=0.0)
        if self.setpoint_degC is not None:
            check("setpoint_degC", self.setpoint_degC, least=-273.15)
        if self.low_degC is not None or self.high_degC is not None:
            check("low_degC", math.nan if self.low_degC is None else self.low_degC, least=-273.15)
            check("high_degC", math.nan if self.high_degC is None else self.high_degC, above=self.low_degC)
        if self.switch is not None and self.switch not in SWITCHES:
            raise UnknownName("switch", self.switch, tuple(SWITCHES))


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopFault:
    """One thing that is wrong.

    Attributes:
        cause: what.
        excess: how far it is beyond what is accepted: 1 is just there.
        told: one sentence with its numbers.
    """

    cause: Cause
    excess: float
    message: str


_KEYS: Final = tuple(field.name for field in fields(LoopEntry))
_Entry = Mapping[str, Any]
_NUMBERS: Final = ("setpoint_degC", "pwm_period_s", "low_degC", "high_degC")


def list_loops(names: Sequence[str], entries: Mapping[str, LoopEntry]) -> list[LoopEntry]:
    """Return a loop for each log, by its file; what the list says of it is in the place of its name alone.

    Raises:
        InputError: the list names a file that is no log of the folder.
    """
    for file in entries:
        if file not in names:
            raise InputError(f"the list names {file!r}, which is no log of the folder{did_you_mean(file, names)}")
    return [entries.get(name, LoopEntry(name=str(PurePath(name).with_suffix("")), file=name)) for name in names]


def read_list(path: str | Path) -> dict[str, LoopEntry]:
    """Return file → loop of a list: a CSV table with a head, or a TOML file with one [[loop]] each.

    Raises:
        InputError: it cannot be read, or an entry is not right; the line (of a TOML file: the entry) is named.
    """
    loops: dict[str, LoopEntry] = {}
    names: dict[str, str] = {}
    entries = _entries_of_toml if Path(path).suffix.lower() == ".toml" else _entries_of_csv
    for where, entry in entries(Path(path)):
        loop = _loop(entry, where)
        if loop.file in loops:
            raise InputError(f"{where}: the log {loop.file!r} is listed twice; a loop has one log")
        if loop.name in names:
            raise InputError(f"{where}: the name {loop.name!r} is that of {names[loop.name]!r}, too; give another one")
        loops[loop.file], names[loop.name] = loop, loop.file
    return loops


def _entries_of_toml(path: Path) -> Iterator[tuple[str, _Entry]]:
    document = read_toml(path)
    if set(document) != {"loop"} or not isinstance(document["loop"], list):
        raise InputError(f"{path}: expected [[loop]] entries and nothing else")
    for number, entry in enumerate(document["loop"], 1):
        if not isinstance(entry, dict):
            raise InputError(f"{path}, loop {number}: expected a table, [[loop]]")
        yield f"{path}, loop {number}", entry


def _entries_of_csv(path: Path) -> Iterator[tuple[str, _Entry]]:
    try:
        text = read_text(path)
    except (OSError, UnicodeDecodeError) as problem:
        raise InputError(f"{path}: cannot be read as a list; expected CSV or TOML as UTF-8") from problem
    rows = csv.reader(io.StringIO(text), delimiter=";" if ";" in text.partition("\n")[0] else ",")
    heads = [head.strip() for head in next(rows, [])]
    for row in rows:
        where = f"{path}, line {rows.line_num}"
        cells = [cell.strip() for cell in row]
        if any(cells) and len(cells) != len(heads):
            raise InputError(f"{where}: {len(cells)} cells; expected {len(heads)}, as in the first line")
        if any(cells):
            yield where, {head: cell for head, cell in zip(heads, cells, strict=True) if cell}


def _loop(entry: _Entry, where: str) -> LoopEntry:
    for key in entry:
        if key not in _KEYS:
            raise InputError(f"{where}: unknown field {key!r}{did_you_mean(key, _KEYS)}; expected {', '.join(_KEYS)}")
    if "file" not in entry:
        raise InputError(f"{where}: no file; every loop names its log")
    values: dict[str, Any] = {
        key: _number(value, key, where) if key in _NUMBERS else str(value) for key, value in entry.items()}
    file = str(entry["file"])
    values.setdefault("name", file if "://" in file else str(PurePath(file).with_suffix("")))
    try:
        if "target" in values:
            controller_for(values["target"])
        return LoopEntry(**values)
    except HeatertuneError as problem:
        raise InputError(f"{where}: {problem}") from problem


def _number(value: Any, key: str, where: str) -> float:
    try:
        if isinstance(value, bool):
            raise TypeError
        return float(value)
    except (TypeError, ValueError):
        raise InputError(f"{where}, field {key}: no number: {value!r}") from None
