"""Columns whose names say nothing, but whose cells do: they are asked for, not passed over."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from heatertune.errors import LogError
from heatertune.log.cells import Sheet
from heatertune.log.quantities import is_second_choice, on_or_off, role_of, says_nothing, unit_in_name

__all__ = ["demand_no_likely_power", "demand_own_temperature", "likely_power", "quoted"]

_MOST_TEXT: Final = 0.1
_NO_POWER: Final = re.compile(
    r"(?i:humid|feucht|moist|\brh\b|r\.h\.|batter|akku|\bsoc\b|level|füllst|fan|lüfter|ventil|flow|durchfl|door|tür|alarm"
    r"|fault|error|quality|valid|mode|state|status|signal|rssi|cpu|memory|disk|light|pressure|druck|\bno\b|nr|index|segment"
    r"|step|run|cycle|batch|zone|slot)")
_FEW_CHANGES: Final = 0.1  # of the rows: a power that is set rather than measured
_FEW_LEVELS: Final = 12


def likely_power(name: str, cells: Sequence[str], *, in_percent: bool = False) -> bool:
    """Return whether a column that nobody has named a power may be one by its content.

    Its cells are on and off, or percent by name or unit; or they are numbers that stand and change at once,
    from 0 up or on both sides of it.
    """
    written = [cell for cell in cells if not says_nothing(cell)]
    if len(written) < len(cells) * (1.0 - _MOST_TEXT) or len(set(written)) < 2 or _NO_POWER.search(name):
        return False
    if on_or_off(written) is not None:
        return True
    try:
        values = np.array(written, dtype=np.float64)
    except ValueError:
        return False
    changes = np.count_nonzero(np.diff(values)) / len(values)
    in_percent |= unit_in_name("power", name) == "100"
    is_set = changes <= _FEW_CHANGES and len(np.unique(values)) <= _FEW_LEVELS
    lowest = float(values.min())
    cools = lowest < 0.0 < float(values.max())  # one signal that heats and cools
    if in_percent or is_set:
        return lowest >= 0.0 or (cools and (is_set or lowest >= -100.0))
    return bool(lowest == 0.0 and changes <= _FEW_CHANGES)


def demand_no_likely_power(sheet: Sheet, index: Mapping[str, int]) -> None:
    """Refuse to pass over the one column that may be the power.

    Raises:
        LogError: there is one, or several.
    """
    names = sheet.header or [""] * len(sheet.rows[0])
    likely = [i for i, name in enumerate(names) if i not in index.values() and role_of(name) is None
              and likely_power(name, [row[i] for row in sheet.rows], in_percent=bool(
                  sheet.units and sheet.units[i] in ("%", "pct")))]
    if likely:
        names = [quoted(names[i]) if names[i] else str(i + 1) for i in likely]
        raise LogError(f"no column is named as the power, but {' or '.join(names)} may be it by its numbers",
                       file=sheet.file, expected=f"--power-column {names[0]}, or --power-column none")


def demand_own_temperature(sheet: Sheet, index: Mapping[str, int]) -> None:
    """Refuse to take a room's or a board's temperature for the heater's where another column may hold that.

    Raises:
        LogError: the only temperature by its name is such a one, and a column without a role holds many values.
    """
    name = sheet.header[index["temperature"]]
    if not is_second_choice(name):
        return
    others = [i for i, head in enumerate(sheet.header) if i not in index.values() and role_of(head) is None
              and _is_measured([row[i] for row in sheet.rows])]
    if others:
        names = [quoted(sheet.header[i]) if sheet.header[i] else str(i + 1) for i in others]
        raise LogError(f"the only temperature by its name is {name!r}, but {' or '.join(names)} may be the heater's",
                       file=sheet.file,
                       expected=f"--temperature-column {names[0]}, or --temperature-column {quoted(name)}")


_MEASURED: Final = 10  # values, at least


def _is_measured(cells: Sequence[str]) -> bool:
    """Return whether a column holds numbers of many values, that do not only grow."""
    try:
        values = np.array([cell for cell in cells if not says_nothing(cell)], dtype=np.float64)
    except ValueError:
        return False
    return len(np.unique(values)) > _MEASURED and bool(np.any(np.diff(values) < 0.0))


def quoted(text: str) -> str:
    """Return a name as a command line needs it."""
    return text if re.fullmatch(r"[\w./:=+-]+", text) else f'"{text}"'
