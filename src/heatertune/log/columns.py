"""Which column is what, and in which unit: by its name, by its numbers where there is no name, or as the user says."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final

from heatertune.errors import LogError
from heatertune.log.cells import Sheet, is_number

__all__ = ["ROLES", "Columns", "find_columns", "unit_in_name"]

ROLES: Final = ("time", "temperature", "power", "setpoint")

#: looked for in this order: "set point (degC)" is no temperature, "heater temperature" no power
_NAMES: Final[dict[str, re.Pattern[str]]] = {
    "setpoint": re.compile(r"set.?point|\bsp\b|^sp\d*$|soll|target|^w$"),
    "time": re.compile(r"time|zeit|date|datum|elapsed|^t(?=$|\s|\[|\()(?!.*(°|deg|\bk\b|\bc\b|\bf\b))|^s$|^sec"),
    "temperature": re.compile(r"temp|^pv|process.?va|istwert|actual|°[cf]|deg[cf]|^t\d*(?=$|\s|\[|\()|kelvin|^x$"),
    "power": re.compile(r"power|duty|heater|pwm|output|^c[vo]$|^mv$|^op$|^u$|^q\d*$|leistung|stell|voltage|^y$"),
}

_UNITS: Final[dict[str, tuple[tuple[str, re.Pattern[str]], ...]]] = {
    "temperature": (
        ("degF", re.compile(r"°\s*f|deg\s*f|fahrenheit|[\[(_ ]f[\])]?$")),
        ("K", re.compile(r"kelvin|[\[(_ ]k[\])]?$")),
        ("degC", re.compile(r"°\s*c|deg\s*c|celsius|[\[(_ ]c[\])]?$")),
    ),
    "time": (
        ("ms", re.compile(r"[\[(_ ]m(illi)?s(ec(onds)?)?[\])]?$")),
        ("min", re.compile(r"[\[(_ ]min(utes?)?[\])]?$")),
        ("h", re.compile(r"[\[(_ ]h(ours?|r)?[\])]?$")),
        ("s", re.compile(r"[\[(_ ]s(ec(onds)?)?[\])]?$")),
    ),
    "power": (
        ("255", re.compile(r"255|8.?bit|pwm.*counts")),
        ("1", re.compile(r"0\s*(\.\.\.?|…|-|–|to)\s*1\b(?!00)|fraction|p\.?u\.?\b")),
        ("100", re.compile(r"%|pct|percent|prozent|0\s*(\.\.\.?|…|-|–|to)\s*100")),
    ),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Columns:
    """Role → index of its column, and what was assumed in finding them."""

    index: Mapping[str, int]
    names: Mapping[str, str]
    told: tuple[str, ...] = field(default=())


def unit_in_name(role: str, name: str) -> str | None:
    """Return the unit a column's name tells, None where it tells none; for power its full scale."""
    for unit, pattern in _UNITS.get(role, ()):
        if pattern.search(name.strip().lower()):
            return unit
    return None


def find_columns(sheet: Sheet, wanted: Mapping[str, str | int]) -> Columns:
    """Return the columns of time, temperature, power and setpoint.

    Args:
        sheet: the cells.
        wanted: role → column name or number (1 = first), where the user says so.

    Raises:
        LogError: a column that does not exist, or none for the temperature.
    """
    index = {role: _chosen(sheet, role, column) for role, column in wanted.items()}
    told: list[str] = []
    if sheet.header:
        _by_name(sheet, index, told)
    else:
        _by_numbers(sheet, index, told)
    if "temperature" not in index:
        known = ", ".join(sheet.header) or f"{len(sheet.rows[0])} columns without names"
        expected = "--temperature-column NAME or N"
        raise LogError(f"no column is a temperature ({known})", file=sheet.file, expected=expected)
    names = {role: sheet.header[i] if sheet.header else f"{i + 1}" for role, i in index.items()}
    return Columns(index=index, names=names, told=tuple(told))


def _chosen(sheet: Sheet, role: str, column: str | int) -> int:
    text = str(column).strip()
    if text in sheet.header:
        return sheet.header.index(text)
    width = len(sheet.header or sheet.rows[0])
    if text.isdigit() and 1 <= int(text) <= width:
        return int(text) - 1
    known = ", ".join(sheet.header) or f"1…{width}"
    raise LogError(f"no {role} column", file=sheet.file, value=text, expected=f"one of {known}")


def _by_name(sheet: Sheet, index: dict[str, int], told: list[str]) -> None:
    taken = set(index.values())
    found: dict[str, list[int]] = {role: [] for role in ROLES}
    for i, name in enumerate(sheet.header):
        role = next((role for role, pattern in _NAMES.items() if pattern.search(name.strip().lower())), None)
        if role is not None and i not in taken:
            found[role].append(i)
    for role, candidates in found.items():
        if role in index or not candidates:
            continue
        index[role] = candidates[0]
        if len(candidates) > 1:
            others = ", ".join(sheet.header[i] for i in candidates[1:])
            told.append(f"{sheet.header[candidates[0]]!r} was taken as the {role}; {others} not used.")


def _by_numbers(sheet: Sheet, index: dict[str, int], told: list[str]) -> None:
    """Deduce: the column that always grows is the time; of two others, the one that stands still is the power."""
    free = [i for i in range(len(sheet.rows[0])) if i not in index.values()]
    if "time" not in index:
        growing = [i for i in free if _grows(sheet, i)]
        if growing:  # several: by custom the time is written first
            index["time"] = growing[0]
            free.remove(growing[0])
    if "temperature" not in index and len(free) == 1:
        index["temperature"] = free[0]
    elif "temperature" not in index and len(free) == 2 and "power" not in index:
        held, moving = sorted(free, key=lambda i: len({row[i] for row in sheet.rows}))
        levels = [len({row[i] for row in sheet.rows}) for i in (held, moving)]
        if levels[0] * 4 < levels[1]:
            index |= {"power": held, "temperature": moving}
    places = ", ".join(f"{role} = column {i + 1}" for role, i in sorted(index.items(), key=lambda pair: pair[1]))
    told.append(f"The file has no header; by their numbers: {places}.")


def _grows(sheet: Sheet, i: int) -> bool:
    cells = [row[i] for row in sheet.rows]
    if not all(is_number(cell) for cell in cells[:50]):
        return "temperature" not in cells[0] and any(mark in cells[0] for mark in (":", "-", "T"))
    try:
        values = [float(cell) for cell in cells]
    except ValueError:
        return False
    return all(a <= b for a, b in pairwise(values)) and values[-1] > values[0]
