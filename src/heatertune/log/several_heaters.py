"""Tables whose rows come from several heaters in turns: a question which of them to read, never a mixture.

A column may name the heater of each row; without one the readings jump back and forth between as many curves.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

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

__all__ = [
    "demand_one_heater_by_name", "demand_one_heater_by_turns", "heater_column", "rows_of_one_heater", "rows_of_turn",
    "turn_of", "with_heaters_in_tags",
]


_MOST_LABELS: Final = 100
_LOOKED_AT: Final = 1000  # rows, to pass over readings and times soon
_FEWEST: Final = 10  # readings of each of two heaters
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
                and np.count_nonzero(np.isfinite(values := _values(cells))) >= 2 * _FEWEST]
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
    if not 2 <= len(labels) <= min(_MOST_LABELS, len(cells) // _FEWEST) or not _are_names(sheet, i, labels):
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
    known = np.flatnonzero(np.isfinite(values))
    codes = _codes(sheet.columns[i], _labels(sheet.columns[i]))[known]
    values, numbers = values[known], np.unique(codes, return_counts=True)[1]
    if np.count_nonzero(numbers >= _FEWEST) < 2:
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
    if len(values) < 2 * _FEWEST * 2 or len(np.unique(values)) <= _FEWEST:
        return
    jump = float(np.quantile(np.abs(np.diff(values)), _JUMPING))
    lags = [float(np.mean(np.abs(values[lag:] - values[:-lag]))) for lag in range(2, _MOST_TURNS + 1)]
    limit = _OF_SPAN * float(np.ptp(values))
    found = next((lag for lag, mean in enumerate(lags, start=2) if jump > max(_APART * mean, limit)), None)
    if found is not None:
        raise LogError(
            f"the temperature jumps back and forth, as where {found} heaters or sensors have rows in turns",
            file=sheet.file, column=columns.names["temperature"],
            expected=f'--tag "1 of {found}" or another to read the rows of one, or --tag-column none if all are of one')


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
