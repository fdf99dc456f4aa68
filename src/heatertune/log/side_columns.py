"""Columns next to heater and power that act on the temperature: a cooler's power, a fan or a flow, the room."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Final

import numpy as np

from heatertune.arrays import Array
from heatertune.log.cells import Sheet
from heatertune.log.quantities import on_or_off, role_of, says_nothing

__all__ = ["SIDE_ROLES", "add_side_columns", "is_cooling", "is_fan"]


SIDE_ROLES: Final = ("cooling", "disturbance", "ambient")

_HEATS: Final = re.compile(r"(?i:heat|heiz|aquec|calefac|chauff|riscald|нагрев|加热|加熱)")
_COOLS: Final = re.compile(r"(?i:cool(?!ant)|kühl|kuehl|kälte|refrig|refroid|chill|raffredd|enfri|冷却|охлажд)")
_FAN: Final = re.compile(
    r"(?i:\bfan(s?\b|\d|speed|power|pct)|lüfter|luefter|gebläse|geblaese|ventilat|blower|\b(air|water)? ?flow\b"
    r"|durchflu|volumenstrom|damper|klappe|coolant|fläkt|风扇|风机|ファン)")
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
    for role, (fits, does, told) in _KINDS.items():
        if role in absent or role in index:
            continue
        found = [i for i, name in enumerate(sheet.header)
                 if i not in index.values() and fits(name) and does(_values([row[i] for row in sheet.rows]))]
        if found:
            index[role] = found[0]
            notes.append(f"{sheet.header[found[0]]!r} was taken as {told} (otherwise: --{role}-column none).")


def _values(cells: list[str]) -> Array:
    """Return the numbers in a column, none if many cells hold no number; on and off are 1 and 0."""
    written = [cell for cell in cells if not says_nothing(cell)]
    try:
        values = np.array(on_or_off(written) or written, dtype=np.float64)
    except ValueError:
        return np.zeros(0)
    return values if len(written) >= len(cells) * (1.0 - _MOST_BLANK) and np.all(np.isfinite(values)) else np.zeros(0)


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
        None, "temperature"), _is_room, "the room's temperature"),
}
