"""A column of cells → numbers; the first cell that is none is refused by its place."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from heatertune.errors import LogError
from heatertune.log.cells import Sheet
from heatertune.log.columns import Columns
from heatertune.log.quantities import is_quantity, says_nothing

__all__ = ["Array", "cell_error", "numbers"]

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
