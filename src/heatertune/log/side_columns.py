"""Columns next to heater and power that act on the temperature: a cooler's power, a fan or a flow, the room.

Columns whose names say nothing, but whose cells do: they are asked for, not passed over.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable, Mapping
from typing import Final

import numpy as np

from heatertune.arrays import Array
from heatertune.errors import LogError
from heatertune.log.quantities import (
    is_number,
    is_quantity,
    is_second_choice,
    on_or_off,
    role_of,
    says_nothing,
    unit_in_name,
)
from heatertune.log.sheet import CellColumn, Sheet
from heatertune.log.timestamps import stamp

__all__ = ["SIDE_ROLES", "add_side_columns", "demand_no_likely_power", "demand_own_temperature", "is_cooling",
           "is_fan", "is_measured", "likely_power", "moving_heaters", "quoted", "scale_question"]


_MOST_TEXT: Final = 0.1
_NO_POWER: Final = re.compile(
    r"(?i:humid|feucht|moist|\brh\b|r\.h\.|batter|akku|\bsoc\b|level|füllst|fan|lüfter|ventil|flow|durchfl|door|tür|alarm"
    r"|fault|error|quality|valid|mode|state|status|signal|rssi|cpu|memory|disk|light|pressure|druck|\bno\b|nr|index|segment"
    r"|step|run|cycle|batch|zone|slot)")
_FEW_CHANGES: Final = 0.1  # of the rows: a power that is set rather than measured
_FEW_LEVELS: Final = 12


def likely_power(name: str, cells: CellColumn, *, in_percent: bool = False) -> bool:
    """Return whether a column that nobody has named a power may be one by its content.

    Its cells are on and off, or percent by name or unit; or they are numbers that stand and change at once,
    from 0 up or on both sides of it.
    """
    written = _written(cells)
    if len(written) < len(cells) * (1.0 - _MOST_TEXT) or all(
            cell == written[0] for cell in written.kinds()) or _NO_POWER.search(name):
        return False
    if on_or_off(written) is not None or _two_words(written):
        return True
    if (values := written.floats()) is None:
        return False
    changes = np.count_nonzero(np.diff(values)) / len(values)
    in_percent |= unit_in_name("power", name) == "100"
    is_set = changes <= _FEW_CHANGES and len(np.unique(values)) <= _FEW_LEVELS
    lowest = float(values.min())
    cools = lowest < 0.0 < float(values.max())  # one signal that heats and cools
    if in_percent or is_set:
        return lowest >= 0.0 or (cools and (is_set or lowest >= -100.0))
    return bool(lowest == 0.0 and changes <= _FEW_CHANGES)


_LONGEST_WORD: Final = 20


def _two_words(cells: CellColumn) -> tuple[str, ...]:
    """Return the two words that a column alternates between, as a switch in a language that is not known, or ()."""
    kinds = tuple(dict.fromkeys(cells.kinds()))
    are_words = len(kinds) == _TWO and not any(
        is_number(kind) or is_quantity(kind) or stamp(kind) is not None or len(kind) > _LONGEST_WORD for kind in kinds)
    return kinds if are_words else ()


_TWO: Final = 2


def demand_no_likely_power(sheet: Sheet, index: Mapping[str, int]) -> None:
    """Refuse to pass over the one column that may be the power.

    Raises:
        LogError: there is one, or several.
    """
    names = sheet.header or [""] * len(sheet.columns)
    likely = [i for i, name in enumerate(names) if i not in index.values() and role_of(name) in (None, "time")
              and likely_power(name, sheet.columns[i], in_percent=[*sheet.units[i:i + 1]] in (["%"], ["pct"]))]
    if likely:
        names = [quoted(names[i]) if names[i] else str(i + 1) for i in likely]
        cells = _written(sheet.columns[likely[0]])
        words = [] if on_or_off(cells) is not None else [f"--power-on {quoted(word)}" for word in _two_words(cells)]
        scale = scale_question(sheet.names()[likely[0]], cells, sheet.units[likely[0]] if sheet.units else "")
        ways = f"{' or '.join(words)}, the cell that means on" if words else f"--power-column {names[0]}{scale}"
        raise LogError(f"no column is named as the power, but {' or '.join(names)} may be it by its "
                       f"{'words' if words else 'numbers'}", file=sheet.file,
                       expected=f"{ways}, or --power-column none")


def scale_question(name: str, cells: CellColumn, unit: str) -> str:
    """Return for a message the option that states the reading at full power, "" where name, unit or cells show it."""
    values = cells.floats()
    if unit_in_name("power", f"[{unit}]" if unit else name) or on_or_off(cells) is not None or (
            values is None or values.min() != 0.0):
        return ""
    return " and --power-full-scale with its reading at full power"


def demand_own_temperature(sheet: Sheet, index: Mapping[str, int]) -> None:
    """Refuse to take a room's or a board's temperature for the heater's where another column may hold that.

    Raises:
        LogError: the only temperature by its name is such a one, and a column without a role holds many values.
    """
    name = sheet.header[index["temperature"]]
    if not is_second_choice(name):
        return
    others = [i for i, head in enumerate(sheet.header) if i not in index.values() and role_of(head) is None
              and is_measured(sheet.columns[i])]
    if others:
        names = [quoted(sheet.header[i]) if sheet.header[i] else str(i + 1) for i in others]
        raise LogError(f"the only temperature by its name is {name!r}, but {' or '.join(names)} may be the heater's",
                       file=sheet.file,
                       expected=f"--temperature-column {names[0]}, or --temperature-column {quoted(name)}")


_MEASURED: Final = 10  # values, at least


def is_measured(cells: CellColumn) -> bool:
    """Return whether a column holds numbers of many values, that do not only grow."""
    values = _written(cells).floats()
    return values is not None and len(np.unique(values)) > _MEASURED and bool(np.any(np.diff(values) < 0.0))


def _written(cells: CellColumn) -> CellColumn:
    """Return the cells that hold something."""
    values = cells.floats()
    return cells if values is not None and not np.any(np.isnan(values)) else cells.at_rows(~cells.where(says_nothing))


def quoted(text: str) -> str:
    """Return a name as a command line needs it."""
    return text if re.fullmatch(r"[\w./:=+-]+", text) else shlex.quote(text) if '"' in text else f'"{text}"'


SIDE_ROLES: Final = ("cooling", "disturbance", "ambient")

_HEATS: Final = re.compile(r"(?i:heat|heiz|aquec|calefac|chauff|riscald|нагрев|加热|加熱)")
_COOLS: Final = re.compile(r"(?i:cool(?!ant)|kühl|kuehl|kälte|refrig|refroid|chill|raffredd|enfri|冷却|охлажд)")
_FAN: Final = re.compile(r"(?i:\bfan(s?\b|\d|speed|power|pct)|lüfter|luefter|gebläse|geblaese|ventilat|blower"
                         r"|\b(air|water)? ?flow\b|durchflu|volumenstrom|damper|klappe|coolant|fläkt|风扇|风机|ファン)")
_ROOM: Final = re.compile(r"(?i:\bambien|\bambian|\broom\b|\broom.?temp|umgebung|\braum(?!f)|室温)")
_MOST_BLANK: Final = 0.1
_FEWEST: Final = 0.02  # of the rows, with a level of its own: one wild cell is no level
_ROOM_RANGE: Final = (-40.0, 350.0)  # °C, °F or K


def is_cooling(name: str) -> bool:
    """Return whether a name is that of a cooler's power, and not of one signal that heats and cools."""
    return _is_named(_COOLS, name) and not is_fan(name)


def is_fan(name: str) -> bool:
    """Return whether a name is that of a fan, a flow or a damper, which carry heat away."""
    return _is_named(_FAN, name)


def _is_named(pattern: re.Pattern[str], name: str) -> bool:
    plain = name.replace("_", " ")
    return pattern.search(plain) is not None and _HEATS.search(plain) is None and role_of(name) in (None, "power")


def add_side_columns(sheet: Sheet, index: dict[str, int], absent: set[str], notes: list[str]) -> None:
    """Add the columns that act next to the power, by their names; those that stand still do nothing and are left out.

    Args:
        sheet: with names.
        index: role → column, to which they are added.
        absent: roles that the user excludes.
        notes: list to which the assumptions are added.
    """
    if "power" not in index:
        return
    for role, (fits, does, description) in _KINDS.items():
        if role in absent or role in index:
            continue
        matches = [i for i, name in enumerate(sheet.header)
                   if i not in index.values() and fits(name) and does(_values(sheet.columns[i]))]
        if matches:
            index[role] = matches[0]
            notes.append(f"{sheet.header[matches[0]]!r} was taken as {description} (otherwise: --{role}-column none).")


def _values(cells: CellColumn) -> Array:
    """Return the numbers in a column, none if many cells hold no number; on and off are 1 and 0."""
    written = _written(cells)
    switched = on_or_off(written)
    values = written.floats() if switched is None else switched
    if values is None or len(written) < len(cells) * (1.0 - _MOST_BLANK):
        return np.zeros(0)
    return values if np.all(np.isfinite(values)) else np.zeros(0)


def _moves(values: Array) -> bool:
    return len(values) > 0 and bool(np.ptp(np.quantile(values, (_FEWEST, 1.0 - _FEWEST))) > 0.0)


def _is_room(values: Array) -> bool:
    low, high = _ROOM_RANGE
    return len(values) > 0 and low <= float(values.min()) and float(values.max()) <= high


#: role → whether a name has it, whether the numbers do something, and what it is
_KINDS: Final[Mapping[str, tuple[Callable[[str], bool], Callable[[Array], bool], str]]] = {
    "cooling": (is_cooling, lambda values: len(values) > 0 and bool(np.any(values > 0.0)), "the power of a cooler"),
    "disturbance": (is_fan, _moves, "a disturbance, whose effect is fitted"),
    "ambient": (lambda name: _ROOM.search(name.replace("_", " ")) is not None and role_of(name) in (
        None, "temperature"), _is_room, "the room's temperature")}


_NUMBERED: Final = re.compile(r"\d+")
_OWN_HEATER: Final = re.compile(r"(?i:\bbed|chamber|zone|extruder|nozzle|hot.?end|heater ?\d)")
_SAME: Final = 0.999  # correlation above which two columns are one power in two units


def moving_heaters(sheet: Sheet, index: Mapping[str, int]) -> tuple[str, ...]:
    """Return the names of unused columns that hold the power of another heater, which changes in the log.

    Such a name is the one of the power that was used with another number, or it names a heater of its own.
    """
    if not sheet.header or "power" not in index:
        return ()
    own = sheet.header[index["power"]]
    power = _changing_power(sheet, index["power"])
    moving = []
    for i, name in enumerate(sheet.header):
        if i in index.values() or role_of(name) != "power" or is_cooling(name) or is_fan(name):
            continue
        is_sibling = _NUMBERED.sub("#", name) == _NUMBERED.sub("#", own)
        other = _changing_power(sheet, i) if is_sibling or _OWN_HEATER.search(name) else None
        if other is not None and (is_sibling or power is None or not _are_same(power, other)):
            moving.append(name)
    return tuple(moving)


def _changing_power(sheet: Sheet, i: int) -> Array | None:
    """Return the numbers of a column, shape (n,), empty cells 0; None where they are none or never change."""
    cells = sheet.columns[i]
    switched = on_or_off(cells)
    try:
        plain = cells.numbers(lambda cell: 0.0 if says_nothing(cell) else float(cell)) if switched is None else switched
    except ValueError:
        return None
    return plain if np.ptp(plain) > 0.0 else None


def _are_same(power: Array, second: Array) -> bool:
    return abs(float(np.corrcoef(power, second)[0, 1])) > _SAME
