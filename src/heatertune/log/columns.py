"""Which column is what: by its name, by its numbers where there is no name, or as the user says.

A column of cells → numbers; the first cell that is none is refused by its place.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from heatertune.errors import LogError
from heatertune.log.cells import Sheet, is_number
from heatertune.log.quantities import (
    ROLES,
    is_foreign,
    is_quantity,
    is_second_choice,
    on_or_off,
    role_of,
    says_nothing,
    stamp,
    unit_in_name,
)

__all__ = [
    "NO_COLUMN",
    "Array",
    "Columns",
    "cell_error",
    "choose_column",
    "find_columns",
    "numbers",
    "with_names",
]


#: what the user says where a log has no such column
NO_COLUMN: Final = "none"


@dataclass(frozen=True, slots=True, kw_only=True)
class Columns:
    """Role → index of its column.

    Attributes:
        index: role → index.
        names: role → name, a number where the file has no names.
        notes: what was assumed in finding them.
        units: role → unit that the column's cells bear.
    """

    index: Mapping[str, int]
    names: Mapping[str, str]
    notes: tuple[str, ...] = field(default=())
    units: Mapping[str, str] = field(default_factory=dict)

    def unit(self, role: str) -> str | None:
        """Return the unit that the cells or the name tell, None where neither does; for power its full scale."""
        borne = self.units.get(role)
        return unit_in_name(role, f"[{borne}]") if borne else unit_in_name(role, self.names[role])

    def is_foreign(self, role: str) -> bool:
        """Return whether the column has a unit that its role does not have: power in watts, a PV in percent."""
        borne = self.units.get(role)
        return unit_in_name(role, f"[{borne}]") is None if borne else is_foreign(role, self.names[role])


def with_names(sheet: Sheet) -> Sheet:
    """Return the sheet, its header taken from the comment above the readings where that names a temperature."""
    if sheet.header or "temperature" not in map(role_of, sheet.comment):
        return sheet
    note = "The comment above the readings was read as the names of the columns."
    return replace(sheet, header=sheet.comment, repairs=(*sheet.repairs, note))


def find_columns(sheet: Sheet, wanted: Mapping[str, str | int], *, counted: bool = False) -> Columns:
    """Return the columns of time, temperature, power and setpoint.

    Args:
        sheet: the cells.
        wanted: role → column name or number (1 = first), where the user says so.
        counted: whether the time is counted in rows, so that no column needs to be found for it.

    Raises:
        LogError: a column that does not exist or is asked for twice, or none for the temperature.
    """
    absent = {role for role, column in wanted.items() if str(column) == NO_COLUMN and column not in sheet.header}
    index = {role: choose_column(sheet, role, column) for role, column in wanted.items() if role not in absent}
    if len(set(index.values())) < len(index):
        raise LogError(f"one column for two of {', '.join(index)}", file=sheet.file, expected="a column for each")
    notes: list[str] = []
    if sheet.header:
        _by_name(sheet, index, absent, notes)
    else:
        _by_numbers(sheet, index, absent | ({"time"} if counted else set()), notes)
    if "temperature" not in index:
        listed = ", ".join(sheet.header) or f"{len(sheet.rows[0])} columns without names"
        expected = "--temperature-column NAME or N"
        raise LogError(f"no column is a temperature ({listed})", file=sheet.file, expected=expected)
    names = {role: sheet.header[i] if sheet.header else f"{i + 1}" for role, i in index.items()}
    units = {role: sheet.units[i] for role, i in index.items() if sheet.units and sheet.units[i]}
    for role, unit in units.items():
        _demand_one_unit(sheet, role, names[role], unit)
    return Columns(index=index, names=names, notes=tuple(notes), units=units)


def _demand_one_unit(sheet: Sheet, role: str, name: str, unit: str) -> None:
    named, borne = unit_in_name(role, name) if sheet.header else None, unit_in_name(role, f"[{unit}]")
    if named is not None and borne is not None and named != borne:
        raise LogError(f"a column named in {named} whose cells are in", file=sheet.file, column=name, value=unit,
                       expected="one unit")


def choose_column(sheet: Sheet, role: str, column: str | int) -> int:
    """Return the column of a name or number (1 = first).

    Raises:
        LogError: there is none.
    """
    text = str(column).strip()
    if text in sheet.header:
        return sheet.header.index(text)
    width = len(sheet.header or sheet.rows[0])
    if text.isdecimal() and 1 <= int(text) <= width:
        return int(text) - 1
    listed = ", ".join(sheet.header) or f"1…{width}"
    raise LogError(f"no {role} column", file=sheet.file, value=text, expected=f"one of {listed}")


def _by_name(sheet: Sheet, index: dict[str, int], absent: set[str], notes: list[str]) -> None:
    taken = set(index.values())
    by_role: dict[str, list[int]] = {role: [] for role in ROLES if role not in absent}
    for i, name in enumerate(sheet.header):
        role = role_of(name)
        if role in by_role and i not in taken and not _is_text(sheet, role, i):
            by_role[role].append(i)
    for role, candidates in by_role.items():
        if role in index or not candidates:
            continue
        best, *others = sorted(candidates, key=lambda i: _is_second(role, sheet.header[i]))
        index[role] = best
        if others:
            unused = ", ".join(sheet.header[i] for i in others)
            notes.append(f"{sheet.header[best]!r} was taken as the {role}; {unused} not used.")


def _is_text(sheet: Sheet, role: str, i: int) -> bool:
    """Return whether a column that may be the power at best holds words: "control mode" with auto and manual."""
    cell = sheet.rows[0][i]
    return role == "power" and is_second_choice(sheet.header[i]) and not (
        is_number(cell) or says_nothing(cell) or on_or_off([cell]))


def _is_second(role: str, name: str) -> bool:
    """Return whether a column has its role only where no other has: a room's temperature, a power in watts."""
    return is_second_choice(name) or (role in ("temperature", "power") and is_foreign(role, name))


def _by_numbers(sheet: Sheet, index: dict[str, int], absent: set[str], notes: list[str]) -> None:
    """Deduce: the column that always grows is the time; of two others, the one that stands still is the power."""
    free = [i for i in range(len(sheet.rows[0])) if i not in index.values()]
    if "time" not in index and "time" not in absent:
        growing = [i for i in free if _grows(sheet, i)]
        if growing:  # several: by custom the time is written first
            index["time"] = growing[0]
            free.remove(growing[0])
    levels = {i: len({row[i] for row in sheet.rows}) for i in free}
    if "temperature" not in index and len(free) == 1 and levels[free[0]] > 3:  # fewer: a power that is switched
        index["temperature"] = free[0]
    elif "temperature" not in index and len(free) == 2 and not {"power"} & {*index, *absent}:
        held, moving = sorted(free, key=lambda i: levels[i])
        if levels[held] * 4 < levels[moving]:
            index |= {"power": held, "temperature": moving}
    places = ", ".join(f"{role} = column {i + 1}" for role, i in sorted(index.items(), key=lambda pair: pair[1]))
    notes.append(f"The file has no header; by their numbers: {places}.")


def _grows(sheet: Sheet, i: int) -> bool:
    """Return whether a column never falls and hardly ever stands: a clock, not a temperature that rises."""
    cells = [row[i] for row in sheet.rows]
    if not is_number(cells[0]):
        return stamp(cells[0]) is not None
    try:
        steps = np.diff(np.array(cells, dtype=np.float64))
    except ValueError:
        return False
    return bool(np.all(steps >= 0.0) and np.count_nonzero(steps > 0.0) > 0.9 * len(steps))


Array = npt.NDArray[np.float64]
_BEYOND: Final = 1e30  # no instant and no reading; units can still be converted without overflow


def numbers(
    sheet: Sheet, columns: Columns, role: str, expected: str = "a number", *, holes: bool = False,
    blank: str | None = None
) -> Array:
    """Return a column as finite numbers, shape (n,), one for each row.

    Args:
        sheet: the cells.
        columns: which column is what.
        role: what the column holds, a key of `columns`.
        expected: what would be right, as the error tells it.
        blank: what would be right instead of a cell that is empty or says that it holds nothing; None: `expected`.
        holes: whether a cell that is empty or says that it holds nothing is NaN instead of refused.

    Raises:
        LogError: a cell that is empty (without `holes`), no number, not finite or beyond 1e30.
    """
    i = columns.index[role]
    cells = [row[i] for row in sheet.rows]
    if holes:
        cells = ["nan" if says_nothing(cell) else cell for cell in cells]
    try:
        values = np.array([_float(cell) for cell in cells], dtype=np.float64)
    except ValueError:
        row = next(k for k, cell in enumerate(cells) if not _is_float(cell))
        problem = "no number:" if cells[row] else "an empty cell"
        if is_quantity(cells[row]):
            problem = "a unit that not all cells bear:"
        if blank is not None and says_nothing(cells[row]):
            expected = blank
        raise cell_error(sheet, columns, role, row, problem, expected) from None
    unusable = np.flatnonzero(~((np.abs(values) < _BEYOND) | (holes & np.isnan(values))))
    if len(unusable):
        row = int(unusable[0])
        if blank is not None and says_nothing(cells[row]):
            expected = blank
        finite = expected.replace("a number", f"a finite number below {_BEYOND:g}", 1)
        raise cell_error(sheet, columns, role, row, "no reading:", finite)
    return values


def cell_error(sheet: Sheet, columns: Columns, role: str, row: int, problem: str, expected: str) -> LogError:
    """Return the error that names a row's line, column and value.

    Args:
        sheet: the cells.
        columns: which column is what.
        role: what the column holds, a key of `columns`.
        row: the row in the sheet, 0 = first.
        problem: what is wrong.
        expected: what would be right.
    """
    return LogError(problem, file=sheet.file, line=sheet.lines[row], column=columns.names[role],
                    value=sheet.rows[row][columns.index[role]] or None, expected=expected)


def _float(cell: str) -> float:
    if "_" in cell:  # Python reads 1_000, a log does not
        raise ValueError(cell)
    return float(cell)


def _is_float(cell: str) -> bool:
    try:
        _float(cell)
    except ValueError:
        return False
    return True
