"""Remove rows that are not readings of the heater (dropouts, an open sensor, spikes), and select one of several runs.

Removed rows are not replaced: the models accept any spacing of readings. Of rows of one instant, repeats are dropped,
those of a coarse clock spread, and those of several heaters refused.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.errors import LogError
from heatertune.log.columns import Columns, cell_error
from heatertune.log.log_values import MIN_SAMPLES
from heatertune.log.quantities import is_number, is_switch_word, says_nothing
from heatertune.log.sheet import Sheet
from heatertune.log.side_columns import is_measured, quoted
from heatertune.units import count

__all__ = ["in_order", "no_readings", "one_run", "rows_to_keep", "spread_instants", "tell_gaps", "without_strays",
           "without_unreadable_power", "without_unset_clock"]


Rows = npt.NDArray[np.intp]
_SHOWN: Final = 5  # line numbers in messages
_MOST_LOST: Final = 0.1  # share of the rows that a clock with coarse steps may cost
_MOST_TAGS: Final = 100
_HOUR_S: Final = 3600.0
_MOSTLY: Final = 0.9
_FEW_TIMES: Final = 3
_TOLD: Final = 0.95  # of the instants that a column has to distinguish


def rows_to_keep(sheet: Sheet, columns: Columns, time: Array, repairs: list[str]) -> tuple[npt.NDArray[np.bool_], int]:
    """Return the rows to keep (the first of equal times), and how many of the others repeat the first.

    The times [s] and the result are of shape (n,), one for each row.

    Raises:
        LogError: a time that goes backwards; many rows of one instant with different readings.
    """
    steps = np.diff(time)
    if np.any(steps < 0):
        row = int(np.flatnonzero(steps < 0)[0]) + 1
        before = sheet.columns[columns.index["time"]][row - 1]
        raise cell_error(sheet, columns, "time", row, "the time goes backwards:",
                         f"not before {before}{_put_back_repeats(steps)}")
    dropped = np.flatnonzero(steps == 0) + 1
    selection = np.ones(len(time), dtype=np.bool_)
    selection[dropped] = False
    if not len(dropped):
        return selection, 0
    firsts = np.flatnonzero(selection)[np.cumsum(selection)[dropped] - 1]
    other = _otherwise(sheet, columns, dropped, firsts)
    if other:
        _demand_one_heater(sheet, columns, dropped, firsts, other)
    note = f"{count(len(dropped), 'row')} at the time of the row before dropped ({_lines(sheet, dropped)})"
    repairs.append(f"{note}; {len(other)} of them with another reading." if other else f"{note}.")
    return selection, len(dropped) - len(other)


def _lines(sheet: Sheet, rows: npt.NDArray[np.intp], role: str = "") -> str:
    """Return for a message the lines of some rows, or of their power: line 3, 4 and 12 more."""
    more = f" and {len(rows) - _SHOWN} more" if len(rows) > _SHOWN else ""
    return f"line {', '.join(sheet.line_name(row, role) for row in rows[:_SHOWN].tolist())}{more}"


def spread_instants(sheet: Sheet, columns: Columns, time: Array, repairs: list[str]) -> Array:
    """Return times, those of rows of one instant spread up to the next one where a clock is coarser than the interval.

    Each instant then has equally many rows, but for the first and the last, and no column tells them apart. The times
    [s] and the result are of shape (n,).
    """
    steps = np.diff(time)
    begins = np.flatnonzero(np.concatenate([[True], steps != 0.0]))
    counts = np.diff([*begins, len(time)])
    if len(begins) < _LEAST_INSTANTS or np.any(steps < 0) or not _is_even(counts[1:-1], np.diff(time[begins])[1:]):
        return time
    dropped = np.setdiff1d(np.arange(len(time)), begins)
    firsts = begins[np.searchsorted(begins, dropped, side="right") - 1]
    names = range(len(sheet.columns))
    differ = len(_otherwise(sheet, columns, dropped, firsts)) > _MOST_LOST * len(time)
    if not differ or any(_tags(sheet, i, dropped, firsts) for i in names if i not in columns.index.values()):
        return time
    if _zigzags(sheet, columns, dropped):
        return time
    usual = float(np.median(np.diff(time[begins])))
    spread, most = time.copy(), float(np.median(counts[1:-1]))
    for k, (begin, number) in enumerate(zip(begins, counts, strict=True)):
        end = time[begins[k + 1]] if k + 1 < len(begins) else time[begin] + usual
        each = (end - time[begin]) / max(number, most)
        late = (max(most - number, 0.0) if k == 0 else 0.0) * each  # a log begins within an instant
        spread[begin:begin + number] += late + each * np.arange(number)
    repairs.append(f"The clock shows one instant for {most:g} rows; they were spread evenly up to the next one.")
    return spread


_LEAST_INSTANTS: Final = 10
_LARGEST_STEP: Final = 0.05  # of the range


def _zigzags(sheet: Sheet, columns: Columns, later: Rows) -> bool:
    """Return whether the rows of one instant are of several sensors: their readings differ as much as the log's."""
    temperatures = sheet.columns[columns.index["temperature"]].numbers(
        lambda cell: float(cell) if is_number(cell) and "," not in cell else np.nan)
    steps = np.abs(temperatures[later] - temperatures[later - 1])
    return bool(np.nanmedian(steps) > _LARGEST_STEP * (np.nanmax(temperatures) - np.nanmin(temperatures)))


def _is_even(counts: npt.NDArray[np.intp], lengths: Array) -> bool:
    """Return whether each instant has two or more rows, the same number but for one, and lasts as long."""
    if not len(counts) or np.median(counts) < 2 or not len(lengths):
        return False
    usual = float(np.median(counts))
    alike = np.mean(lengths == np.median(lengths)) > _MOSTLY
    return bool(np.all(np.abs(counts - usual) <= 1.0) and alike)


def _put_back_repeats(steps: Array) -> str:
    """Return the remedy where rows may be counted: the clock was set back a few times, otherwise they are even."""
    usual = float(np.median(steps))
    even = np.mean(np.abs(steps - usual) <= 0.5 * usual) > _MOSTLY
    if usual <= 0.0 or not even or np.count_nonzero(steps < 0) > _FEW_TIMES:
        return ""
    reason = " by an hour (end of summer time)" if _is_hour_back(steps, usual) else ""
    return f"; where the clock was put back{reason}, --log-interval {usual:g} counts the rows"


def _is_hour_back(steps: Array, usual: float) -> bool:
    """Return whether the clock was put back by an hour; the steps are of shape (n,) [s], the usual one in seconds."""
    return abs(float(steps.min()) + _HOUR_S - usual) <= max(usual, 1.0)


def _otherwise(sheet: Sheet, columns: Columns, dropped: Rows, firsts: Rows) -> list[int]:
    """Return the rows that read otherwise than the first of their instant."""
    used = [i for role, i in columns.index.items() if role not in ("time", "date")]
    return [row for row, first in zip(dropped, firsts, strict=True)
            if any(sheet.columns[i][row] != sheet.columns[i][first] for i in used)]


def _demand_one_heater(sheet: Sheet, columns: Columns, dropped: Rows, firsts: Rows,
                       second_columns: Sequence[int]) -> None:
    for i, name in enumerate(sheet.names()):
        if i not in columns.index.values() and (tags := _tags(sheet, i, dropped, firsts)):
            some = f"{', '.join(tags[:_SHOWN])}{', …' if len(tags) > _SHOWN else ''}"
            raise LogError(
                f"line {sheet.line_name(second_columns[0])} is of the same instant as the row before, with another "
                f"reading; column {name!r} tells them apart ({some})",
                file=sheet.file, expected=f"--tag {quoted(tags[0])} --tag-column {quoted(name)} to read one of them")
    if len(second_columns) > _MOST_LOST * len(sheet):
        problem = f"{len(second_columns)} rows of {len(sheet)} share an instant with another reading, the first:"
        raise cell_error(sheet, columns, "time", second_columns[0], problem,
                      "a finer clock, or --log-interval with the seconds between two rows")


def _tags(sheet: Sheet, i: int, dropped: Rows, firsts: Rows) -> list[str]:
    """Return the few values of a column that differ within each instant; none if it does not distinguish rows."""
    column = sheet.columns[i]
    if not 2 <= column.levels() <= min(_MOST_TAGS, len(sheet) / 4):
        return []
    tags = list(dict.fromkeys(column))
    figures = sum(is_number(tag) and not tag.isdigit() for tag in tags)
    apart = sum(column[row] != column[first] for row, first in zip(dropped, firsts, strict=True))
    return tags if not figures and apart >= _TOLD * len(dropped) else []


Mask = npt.NDArray[np.bool_]

#: readings of converters without a sensor: MAX6675 and MAX31855 at full scale, DS18B20, open inputs of PLC modules
_OPEN: Final = (1023.75, 1024.0, 2047.75, 2048.0, -127.0, 3276.7, 3276.8, 6553.5, -999.0, 9999.0)
_LONGEST_SPIKE: Final = 3  # readings
_SHORTEST_STAND: Final = 5
_FAR_VALUE: Final = "at one value that the log jumps to, as of an open sensor,"
_SPIKE_SHARE: Final = 0.1  # of the log's span
_LEVELS: Final = 1.5
_SPIKE_TIMES: Final = 12.0  # the usual departure of a reading from its neighbours
_EDGE_TIMES: Final = 2.0  # 90 % of the log's steps are smaller: one reading in twenty may be a spike
_GAP_TIMES: Final = 5.0  # the usual interval
_PAUSE_TIMES: Final = 3.0  # the usual interval: a jump after a longer pause may be the heater's
_STARTS: Final = (0.0, 85.0, 32.0, 185.0)  # °C and °F
_STARTS_TIMES: Final = 2.0  # the largest other step
_ALONE_TIMES: Final = 4.0
_MOST_EDGES: Final = 8  # of a loose probe
_ROWS_BEFORE: Final = 3
_MOST_LOOSE: Final = 0.3  # share of the rows


_MOST_STRAYS: Final = 0.02  # share of the rows
_FEW_STRAYS: Final = 3
_MOST_BELOW: Final = 40  # rows of statistics
_TIME_BEGINS: Final = frozenset("0123456789+-.[")


def without_strays(sheet: Sheet, columns: Columns, repairs: list[str]) -> Sheet:
    """Return the sheet without the few rows whose time is a word or empty: means and extremes, a message."""
    if "time" not in columns.index:
        return sheet
    cells = sheet.columns[columns.index["time"]]
    are_numbers = is_number(cells[len(cells) // 2])  # else a number is none: 650 rows selected.
    begins = cells.where(lambda cell: cell[:1] in _TIME_BEGINS and (are_numbers or not cell.isdigit()))
    strays = np.flatnonzero(~begins)
    if not len(strays) or not begins.any():
        return sheet
    within = np.count_nonzero(strays < np.flatnonzero(begins)[-1])
    if within > max(_FEW_STRAYS, _MOST_STRAYS * len(sheet)) or len(strays) - within > _MOST_BELOW:
        return sheet
    repairs.append(f"{count(len(strays), 'row')} without a time left out ({_lines(sheet, strays)}).")
    return replace(sheet.at_rows(begins), lost=sheet.lost + len(strays))


def without_unreadable_power(sheet: Sheet, columns: Columns, time: Array, edges: Mask,
                             repairs: list[str]) -> tuple[Sheet, Array, Mask]:
    """Return sheet, times and edges without the few rows whose power is no power: blank, Err, NULL.

    The power before is held through them, as through any row that is missing.

    Args:
        sheet: the cells.
        columns: which column is what.
        time: of each row, shape (n,) [s].
        edges: the rows that hold another power but no temperature, shape (n,).
        repairs: list to which omitted rows are added.
    """
    if "power" not in columns.index:
        return sheet, time, edges
    place = columns.index["power"]
    strange = ~sheet.columns[place].where(is_switch_word)
    if strange.all():
        strange = ~sheet.columns[place].where(lambda cell: is_number(cell) and not says_nothing(cell))
    if not np.any(strange) or np.count_nonzero(strange) > _MOST_LOST * len(strange):
        return sheet, time, edges
    rows = np.flatnonzero(strange)
    repairs.append(f"{count(len(rows), 'row')} without a power left out ({_lines(sheet, rows, 'power')}).")
    return replace(sheet.at_rows(~strange), lost=sheet.lost + len(rows)), time[~strange], edges[~strange]


_UNSET_S: Final = 1e7  # four months: no pause of a log


def without_unset_clock(sheet: Sheet, time: Array, repairs: list[str]) -> tuple[Sheet, Array]:
    """Return sheet and times, shape (n,) [s], without the few rows in front whose date is years before the others.

    A logger without a battery begins in 1970 or 2000, until it is told the time.
    """
    back = np.flatnonzero(np.abs(np.diff(time)) > _UNSET_S)
    first = int(back[0]) + 1 if len(back) == 1 else 0
    if not 0 < first <= max(_FEW_STRAYS, _MOST_LOST * len(time)):
        return sheet, time
    repairs.append(f"{count(first, 'row')} before the clock was set left out (up to line "
                   f"{sheet.line_name(first - 1)}).")
    remainder = sheet.at_rows(slice(first, None))
    return replace(remainder, lost=remainder.lost + first), time[first:] - time[first]


_MOST_BACK: Final = 5.0  # intervals by which a row may be late in its file


def in_order(sheet: Sheet, time: Array, repairs: list[str]) -> tuple[Sheet, Array]:
    """Return sheet and times, shape (n,) [s], with the few rows put in order that were written behind a later one.

    They are put back only where there is a gap for each of them: a clock that was put back leaves none. A ring of rows
    whose end is followed by its beginning begins with its oldest row, unless it may be the end of summer time.
    """
    steps = np.diff(time)
    back = np.flatnonzero(steps < 0.0)
    usual = float(np.median(steps)) if len(steps) else 0.0
    if len(back) == 1 and 0.0 < time[0] - time[-1] <= _PAUSE_TIMES * usual and not _is_hour_back(steps, usual):
        repairs.append(f"The file is a ring of rows; those from line {sheet.line_name(int(back[0]) + 1)} on are older "
                       "and were put first.")
        order = np.roll(np.arange(len(time)), -int(back[0]) - 1)
        return sheet.at_rows(order), time[order] - time[order[0]]
    if not len(back) or usual <= 0.0 or len(back) > max(_FEW_STRAYS, _MOST_STRAYS * len(time)) or (
            steps.min() < -_MOST_BACK * usual):
        return sheet, time
    order = np.argsort(time, kind="stable")
    near = np.unique(np.clip(np.concatenate([back + k for k in range(-6, 8)]), 0, len(steps) - 1))
    if np.any(np.abs(np.diff(time[order])[near] - usual) > 0.5 * usual):
        return sheet, time
    repairs.append(f"{count(len(back), 'row')} written behind a later one put in the order of the time (line "
                   f"{', '.join(sheet.line_name(int(k)) for k in back[:_SHOWN])}).")
    return sheet.at_rows(order), time[order]


def one_run(sheet: Sheet, columns: Columns, time: Array, wanted: int | None,
            repairs: list[str]) -> tuple[Sheet, Array, int | None]:
    """Return the rows of one run, their times, and the number of the run, None if there is only one.

    The run is the requested one (1 = first), otherwise the longest of those in which the power moves.

    A run begins where the clock restarts at its first value, or jumps by years as it is set; a time that only goes
    backwards is not a new run.

    Args:
        sheet: the cells.
        columns: which column is what.
        time: of each row, shape (n,) [s].
        wanted: the requested run, None for the longest in which the power moves.
        repairs: list to which the choice is added.

    Raises:
        LogError: a run that does not exist.
    """
    set_at = (np.flatnonzero(np.abs(np.diff(time)) > _UNSET_S) + 1).tolist()
    starts = _session_starts(sheet) or ([0, *set_at] if set_at else _restarts(time))
    if wanted is not None and not 1 <= wanted <= len(starts):
        raise LogError(f"run {wanted}", file=sheet.file, expected=f"1…{len(starts)}, as many runs as the file holds")
    if len(starts) == 1:
        return sheet, time, wanted
    ends = [*starts[1:], len(time)]
    lengths = [end - start for start, end in zip(starts, ends, strict=True)]
    power = sheet.columns[columns.index["power"]] if "power" in columns.index else None
    moves = [power is not None and power.at_rows(slice(start, end)).levels() > 1
             for start, end in zip(starts, ends, strict=True)]
    longest = max(range(len(starts)), key=lambda k: (moves[k] and lengths[k] >= MIN_SAMPLES, lengths[k]))
    best = sheet.session is not None and len(starts) == len(sheet.sessions)
    chosen = sheet.session - 1 if best and wanted is None and sheet.session else (
        longest if wanted is None else wanted - 1)
    begin, end = starts[chosen], ends[chosen]
    why = "as asked" if wanted is not None else "in which the heater moved most" if best else (
        "the longest" if lengths[longest] == max(lengths) else "the longest in which the power moves")
    repairs.append(
        f"The {'clock jumps by years; the ' if set_at else ''}file holds {len(starts)} runs (from lines "
        f"{', '.join(map(sheet.line_name, starts))}); run {chosen + 1} was read, {why}: --run reads another.")
    return sheet.at_rows(slice(begin, end)), time[begin:end] - (time[begin] if set_at else 0.0), chosen + 1


def _session_starts(sheet: Sheet) -> list[int]:
    """Return the row with which each session begins that the file itself marks, empty if it marks none."""
    starts = [next((k for k, line in enumerate(sheet.lines) if line >= begin), -1) for begin in sheet.sessions]
    return starts if starts and starts[0] == 0 and len(set(starts)) == len(starts) and -1 not in starts else []


def _restarts(time: Array) -> list[int]:
    steps = np.diff(time)
    forward = steps[steps > 0]
    usual = float(np.median(forward)) if len(forward) else 0.0
    starts = [0]
    for k in (np.flatnonzero(steps < 0) + 1).tolist():
        begins_anew = abs(time[k] - time[0]) <= 2.0 * usual and k + 1 < len(time) and 0 <= steps[k] <= 3.0 * usual
        if begins_anew and k - starts[-1] >= MIN_SAMPLES and len(time) - k >= MIN_SAMPLES:
            starts.append(k)
    return starts


def no_readings(sheet: Sheet, columns: Columns, raw: Array, time: Array, repairs: list[str], *, edges: Mask,
                moves: Mask | None = None, skip_empty: bool = False) -> Mask:
    """Return a mask of the rows without a valid temperature, shape (n,), and list them in the repairs.

    Args:
        sheet: for line numbers.
        columns: for names.
        raw: the temperature as in the file, shape (n,), NaN if the cell is empty or not a number of the
            sensor.
        time: of each row, shape (n,) [s].
        repairs: list to which omitted rows are added.
        edges: the rows that are there for another power alone, and are no readings, shape (n,).
        moves: the rows in which the power moves, shape (n,); None if it is not logged.
        skip_empty: whether the user accepts any number of rows without a reading.

    Raises:
        LogError: more than a tenth of the rows are lost.
    """
    empty = np.isnan(raw) & ~edges
    is_open = _is_open(raw)
    good_rows = np.flatnonzero(~(empty | is_open | edges))
    stuck = np.zeros_like(empty)
    stuck[good_rows[_stuck(raw[good_rows], time[good_rows])]] = True
    lost = empty | is_open | stuck
    loose = np.zeros_like(lost)
    good_rows = np.flatnonzero(~(lost | edges))
    if moves is not None:
        loose[good_rows[_loose(raw[good_rows], time[good_rows], moves[good_rows])]] = True
    lost |= loose
    refused = (lost & ~empty if skip_empty else lost) & ~loose
    if np.count_nonzero(refused) > _MOST_LOST * len(raw) or np.all(lost):
        row = int(np.flatnonzero(refused)[0])
        what = _FAR_VALUE if stuck[row] else "without a reading,"
        problem = f"{count(int(np.count_nonzero(refused)), 'row')} of {len(raw)} {what} the first:"
        way = " (--skip-empty leaves out those without one)" if np.any(refused & empty) else _other_column(
            sheet, columns)
        raise cell_error(sheet, columns, "temperature", row, problem, f"a log with a reading in nine rows of ten{way}")
    spikes = np.zeros_like(lost)
    good_rows = np.flatnonzero(~(lost | edges))
    spikes[good_rows[_spikes(raw[good_rows])]] = True
    ends = np.zeros_like(lost)
    good_rows = np.flatnonzero(~(lost | spikes | edges))
    ends[good_rows[_wild_ends(raw[good_rows], time[good_rows])]] = True
    kinds = ((empty, "without a reading"), (is_open, "with an open sensor's reading"),
             (stuck, _FAR_VALUE),
             (loose, "between two opposite jumps, as of a loose probe,"),
             (spikes, "with a spike"), (ends, "at an end of the log, far from all others,"))
    for mask, what in kinds:
        if np.any(mask):
            rows = count(int(np.count_nonzero(mask)), "row")
            repairs.append(f"{rows} {what} left out ({_places(sheet, raw, mask)}).")
    return np.asarray(lost | spikes | ends)


def _other_column(sheet: Sheet, columns: Columns) -> str:
    """Return the option that reads the temperature from another measured column, "" if there is none."""
    others = [i for i, cells in enumerate(sheet.columns) if i not in columns.index.values() and is_measured(cells)]
    return f", or --temperature-column {quoted(sheet.names()[others[0]])}" if others else ""


def _is_open(raw: Array) -> Mask:
    """Return which readings are an open sensor's.

    A heater that passes such a value comes from one side and goes on to the other, in steps as the log has them.
    """
    there = np.isin(raw, _OPEN)
    finite_rows = np.flatnonzero(~there & ~np.isnan(raw))
    steps = np.abs(np.diff(raw[finite_rows]))
    usual = 3.0 * float(np.percentile(steps[steps > 0.0], 95.0)) if np.any(steps) else 0.0
    for place in np.flatnonzero(there) if len(finite_rows) else []:
        after = int(np.searchsorted(finite_rows, place))
        ends = raw[finite_rows[[max(after - 1, 0), min(after, len(finite_rows) - 1)]]]
        passes = min(ends) < raw[place] < max(ends) and np.abs(ends - raw[place]).max() <= usual
        there[place] = not passes
    return there


def _stuck(values: Array, time: Array) -> Mask:
    """Return which readings stay at the log's maximum or minimum, entered and left by jumps that occur nowhere else.

    An input with an open sensor reads one end of its range. A heater reaches an extreme gradually, and the effect of
    cold goods does not end in a jump. A few readings, or a jump across a pause, may be genuine. At the start a heater
    may be in steady state until cold goods arrive; there, an open sensor is assumed if the log jumps up and rises.
    """
    n = len(values)
    stuck = np.zeros(n, dtype=np.bool_)
    if n < 2 * MIN_SAMPLES:
        return stuck
    steps, pauses = np.abs(np.diff(values)), np.diff(time)
    for end in (float(values.max()), float(values.min())):
        there = values == end
        edges = np.flatnonzero(np.diff(there))  # entered, left, entered, …
        others = values[~there]
        if not len(edges) or len(others) < MIN_SAMPLES or (there[0] and not end < others[0] < others[-1]):
            continue
        lengths = np.diff([*([-1] if there[0] else []), *edges.tolist(), n - 1])[::2]
        most = float(np.max(np.delete(steps, edges), initial=0.0))
        least = max(_ALONE_TIMES * most, _SPIKE_SHARE * float(np.ptp(others)))
        at_once = np.all(pauses[edges] <= _PAUSE_TIMES * np.median(pauses))
        if at_once and lengths.min() >= _SHORTEST_STAND and steps[edges].min() > least:
            stuck |= there
    return stuck


def _loose(values: Array, time: Array, moves: Mask) -> Mask:
    """Return which readings lie between a jump and the opposite jump, both larger than any other change by far.

    A probe that hangs in the air reads the room, and jumps back when it is put in again. No heater jumps up; cold goods
    let it fall at once, but it never returns at once. In a slow log it may, where the power moves just before.
    """
    n = len(values)
    loose = np.zeros(n, dtype=np.bool_)
    if n < 2 * MIN_SAMPLES:
        return loose
    steps = np.diff(values)
    sizes, pauses = np.abs(steps), np.diff(time)
    edges = np.flatnonzero(sizes > _SPIKE_SHARE * float(np.ptp(values)))
    if not len(edges) or len(edges) % 2 or len(edges) > _MOST_EDGES:
        return loose
    others = float(np.delete(sizes, edges).max())
    opposite = np.all(np.sign(steps[edges[::2]]) == -np.sign(steps[edges[1::2]]))
    at_once = np.all(pauses[edges] <= _PAUSE_TIMES * np.median(pauses)) and not any(
        np.any(moves[max(edge - _ROWS_BEFORE, 0):edge + 2]) for edge in edges)
    spacings = np.diff(np.flatnonzero(moves))
    if any(np.any(np.abs(spacings - (end - begin)) <= _ROWS_BEFORE) for begin, end in zip(
            edges[::2], edges[1::2], strict=True)):
        return loose  # a pulse of the power, which a fast heater follows after its dead time
    if not opposite or not at_once or sizes[edges].min() <= _ALONE_TIMES * others:
        return loose
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        loose[begin + 1:end + 1] = True
    lengths = edges[1::2] - edges[::2]
    short = np.count_nonzero(loose) <= _MOST_LOOSE * n and lengths.min() > _LONGEST_SPIKE
    return loose if short else np.zeros(n, dtype=np.bool_)


def _spikes(values: Array) -> npt.NDArray[np.intp]:
    """Return the readings that leave the line of their neighbours far more than usual in the log, and return.

    A permanent jump, as after cold goods, is not a spike; nor is a large step in a slow log that often has such steps.
    """
    n = len(values)
    is_spike = np.zeros(n, dtype=np.bool_)
    if n < 2 * MIN_SAMPLES:
        return np.flatnonzero(is_spike)
    usual = 1.4826 * float(np.median(np.abs(values[1:-1] - (values[:-2] + values[2:]) / 2.0)))
    span = float(np.subtract(*np.percentile(values, [98.0, 2.0])))
    levels = np.unique(values)  # a reading one step of the card away is not a spike
    least = max(_SPIKE_TIMES * usual, _SPIKE_SHARE * span, _LEVELS * float(np.diff(levels).min(initial=span)))
    steps = np.abs(np.diff(values))
    steep = _EDGE_TIMES * float(np.percentile(steps, 90.0))
    for width in range(1, _LONGEST_SPIKE + 1):
        before, after = values[: n - width - 1], values[width + 1 :]
        away, sides = np.full(len(before), np.inf), np.zeros(len(before), dtype=np.int8)
        for k in range(1, width + 1):
            off = values[k : n - width - 1 + k] - (before + k / (width + 1) * (after - before))
            sides += np.sign(off).astype(np.int8)
            np.minimum(away, np.abs(off), out=away)
        together = np.abs(sides) == width
        back = np.abs(after - before) < 0.3 * away
        abrupt = np.minimum(steps[: n - width - 1], steps[width:]) > steep
        for k in np.flatnonzero((away > least) & together & back & abrupt).tolist():
            if not np.any(is_spike[k : k + width + 2]):
                is_spike[k + 1 : k + 1 + width] = True
    return np.flatnonzero(is_spike)


def _wild_ends(values: Array, time: Array) -> list[int]:
    """Return the first and last readings from which the log jumps as nowhere else, as a starting sensor does.

    A jump occurs between two readings, without a pause, far beyond the usual step and several times the largest other
    step: a slow log has large steps, but never a single one. 0 and 85 are the values that a DS18B20 and many converters
    give before their first conversion; for these the threshold is lower.
    """
    n = len(values)
    wild: list[int] = []
    if n < MIN_SAMPLES + 2 * _LONGEST_SPIKE:
        return wild
    for order in (np.arange(n), np.arange(n)[::-1]):
        y, t = values[order], time[order]
        steps, pauses = np.abs(np.diff(y)), np.abs(np.diff(t))
        first_change = int(np.argmax(y != y[0]))
        starts = bool(y[0] in _STARTS and 0 < first_change <= max(_LONGEST_SPIKE, _MOST_LOST * n))
        width = first_change if starts else int(np.argmax(steps[:_LONGEST_SPIKE])) + 1
        core = y[max(width, _LONGEST_SPIKE):]
        usual = 1.4826 * float(np.median(np.abs(core[1:-1] - (core[:-2] + core[2:]) / 2.0)))
        least = max(_SPIKE_TIMES * usual, _SPIKE_SHARE * float(np.ptp(core)))
        others = float(np.max(steps[width:-_LONGEST_SPIKE]))
        times = _STARTS_TIMES if starts else _ALONE_TIMES if n > 2 * MIN_SAMPLES else np.inf
        together = pauses[width - 1] <= _PAUSE_TIMES * np.median(pauses)
        if together and others > 0.0 and steps[width - 1] > max(least, times * others):
            wild += order[:width].tolist()
    return wild


def tell_gaps(time: Array, lines: npt.NDArray[np.intp], powered: bool, doubts: list[str]) -> None:
    """Add to the doubts where the log pauses; `time`, shape (n,) [s], and `lines` are those of its rows."""
    steps = np.diff(time)
    gaps = np.flatnonzero(steps > _GAP_TIMES * np.median(steps)) if len(steps) else np.zeros(0, dtype=np.intp)
    if not len(gaps):
        return
    places = ", ".join(f"{steps[k]:g} s after line {lines[k]}" for k in gaps[:_SHOWN])
    more = f" and {len(gaps) - _SHOWN} more" if len(gaps) > _SHOWN else ""
    assumption = "; the power is assumed constant in them" if powered else ""
    usual = float(np.median(steps))
    forward = len(gaps) == 1 and abs(float(steps[gaps[0]]) - _HOUR_S - usual) <= max(0.1 * usual, 1.0)
    hour = f"; where the clock was put forward by an hour, --log-interval {usual:g} counts the rows" if forward else ""
    doubts.append(f"The log has {count(len(gaps), 'gap')} ({places}{more}){assumption}{hour}.")


def _places(sheet: Sheet, raw: Array, mask: Mask) -> str:
    rows = np.flatnonzero(mask)
    listed = ", ".join(f"line {sheet.line_name(row)}" + ("" if np.isnan(raw[row]) else f": {raw[row]:g}")
                       for row in rows[:_SHOWN])
    return listed + (f" and {len(rows) - _SHOWN} more" if len(rows) > _SHOWN else "")
