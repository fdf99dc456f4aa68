"""Which column is what, and in which unit: by its name, by its numbers where there is no name, or as the user says."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from heatertune.errors import LogError
from heatertune.log.cells import Sheet, is_number
from heatertune.log.stamps import stamp

__all__ = ["ROLES", "Columns", "find_columns", "is_foreign", "unit_in_name", "with_names"]

ROLES: Final = ("time", "temperature", "power", "setpoint")

#: looked for in this order: "set point (degC)" is no temperature, "heater temperature" no power; t is a time, T is not
_NAMES: Final[dict[str, re.Pattern[str]]] = {
    "setpoint": re.compile(r"(?i:set.?point|\bt?sp\d*\b|soll|target)"),
    "time": re.compile(r"(?i:time|zeit|\bdate|datum|elapsed|^milli|^sec|^minutes?$|^hours?$|^m?s$)"
                       r"|^t$|^[tT] ?[\[(/ ] ?(s|sec|ms|min|h)\b"),
    "temperature": re.compile(r"(?i:temp|^pv|process.?va|istwert|actual(?!.*(power|output|duty|%))|°[cf]|deg ?[cf]"
                              r"|kelvin|thermocouple)|^T\d*$|^[tT]\d* ?[\[(/ ] ?[KCF]\b"),
    "power": re.compile(r"(?i:power|duty|heater|pwm|output|^c[vo]\d*\b|^op\b|^[uq]\d*($|[ \[(/])|leistung|stell|volt"
                        r"|watt)|^MV\b"),
}

#: taken only where nothing else has the role: a room's temperature, a date beside the time of day
_SECOND_CHOICE: Final = re.compile(r"(?i:ambient|room|\bext|outside|umgebung|raum|junction|board|cpu|^dat(e|um)$)")

_UNITS: Final[dict[str, tuple[tuple[str, re.Pattern[str]], ...]]] = {
    "temperature": (
        ("degF", re.compile(r"°\s*f|deg\s*f|fahrenheit|[\[(/ ]f[\])]?$|temp(erature)?\d*f$")),
        ("K", re.compile(r"kelvin|[\[(/ ]k[\])]?$|temp(erature)?\d*k$")),
        ("degC", re.compile(r"°\s*c|deg\s*c|celsius|[\[(/ ]c[\])]?$|temp(erature)?\d*c$")),
    ),
    "time": (
        ("ms", re.compile(r"(^|[\[(/ ])m(illi)?s(ec(onds?)?)?\.?[\])]?$|^millis")),
        ("min", re.compile(r"(^|[\[(/ ])min(ute[ns]?|s)?\.?[\])]?$")),
        ("h", re.compile(r"(^|[\[(/ ])(h(ours?|rs?)?|std|stunden)\.?[\])]?$")),
        ("s", re.compile(r"(^|[\[(/ ])s(e[ck](onds?|unden)?)?\.?[\])]?$")),
    ),
    "power": (
        ("255", re.compile(r"255|8.?bit|pwm.*counts")),
        ("1", re.compile(r"0\s*(\.\.\.?|…|-|–|to)\s*1\b(?!00)|fraction|p\.?u\.?\b")),
        ("100", re.compile(r"%|pct|percent|prozent|0\s*(\.\.\.?|…|-|–|to)\s*100\b")),
    ),
}

#: units that are neither a temperature, a time nor a share of full power
_FOREIGN: Final[dict[str, re.Pattern[str]]] = {
    "temperature": re.compile(r"%|pct|percent|counts?\b|\badc\b|[\[(/ ]m?[va][\])]?$|ohm|ω|\bbar\b"),
    "time": re.compile(r"[\[(/ ]([uµμn]s|d|days?|tage)[\])]?$"),
    "power": re.compile(r"[\[(/ ][mk]?[wva][\])]?$|volt|watt"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Columns:
    """Role → index of its column, and what was assumed in finding them."""

    index: Mapping[str, int]
    names: Mapping[str, str]
    told: tuple[str, ...] = field(default=())


def unit_in_name(role: str, name: str) -> str | None:
    """Return the unit a column's name tells, None where it tells none; for power its full scale."""
    lower = _plain(name).lower()
    found = (unit for unit, pattern in _UNITS["temperature" if role == "setpoint" else role] if pattern.search(lower))
    return next(found, None)


def is_foreign(role: str, name: str) -> bool:
    """Return whether a column's name tells a unit that the role does not have: power in watts, a PV in percent."""
    return unit_in_name(role, name) is None and _FOREIGN[role].search(_plain(name).lower()) is not None


def _plain(name: str) -> str:
    """Return a name with spaces for underscores and one way to write degrees."""
    return name.strip().replace("_", " ").replace("º", "°").replace("℃", "°C").replace("℉", "°F")


def with_names(sheet: Sheet) -> Sheet:
    """Return the sheet, its header taken from the comment above the readings where that names a temperature."""
    if sheet.header or not any(_NAMES["temperature"].search(_plain(name)) for name in sheet.comment):
        return sheet
    told = "The comment above the readings was read as the names of the columns."
    return replace(sheet, header=sheet.comment, repairs=(*sheet.repairs, told))


def find_columns(sheet: Sheet, wanted: Mapping[str, str | int], *, counted: bool = False) -> Columns:
    """Return the columns of time, temperature, power and setpoint.

    Args:
        sheet: the cells.
        wanted: role → column name or number (1 = first), where the user says so.
        counted: whether the time is counted in rows, so that no column needs to be found for it.

    Raises:
        LogError: a column that does not exist or is asked for twice, or none for the temperature.
    """
    index = {role: _chosen(sheet, role, column) for role, column in wanted.items()}
    if len(set(index.values())) < len(index):
        raise LogError(f"one column for two of {', '.join(index)}", file=sheet.file, expected="a column for each")
    told: list[str] = []
    if sheet.header:
        _by_name(sheet, index, told)
    else:
        _by_numbers(sheet, index, told, counted)
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
    if text.isdecimal() and 1 <= int(text) <= width:
        return int(text) - 1
    known = ", ".join(sheet.header) or f"1…{width}"
    raise LogError(f"no {role} column", file=sheet.file, value=text, expected=f"one of {known}")


def _by_name(sheet: Sheet, index: dict[str, int], told: list[str]) -> None:
    taken = set(index.values())
    found: dict[str, list[int]] = {role: [] for role in ROLES}
    for i, name in enumerate(sheet.header):
        role = next((role for role, pattern in _NAMES.items() if pattern.search(_plain(name))), None)
        if role is not None and i not in taken:
            found[role].append(i)
    for role, candidates in found.items():
        if role in index or not candidates:
            continue
        best, *others = sorted(candidates, key=lambda i: _SECOND_CHOICE.search(_plain(sheet.header[i])) is not None)
        index[role] = best
        if others:
            unused = ", ".join(sheet.header[i] for i in others)
            told.append(f"{sheet.header[best]!r} was taken as the {role}; {unused} not used.")


def _by_numbers(sheet: Sheet, index: dict[str, int], told: list[str], counted: bool) -> None:
    """Deduce: the column that always grows is the time; of two others, the one that stands still is the power."""
    free = [i for i in range(len(sheet.rows[0])) if i not in index.values()]
    if "time" not in index and not counted:
        growing = [i for i in free if _grows(sheet, i)]
        if growing:  # several: by custom the time is written first
            index["time"] = growing[0]
            free.remove(growing[0])
    levels = {i: len({row[i] for row in sheet.rows}) for i in free}
    if "temperature" not in index and len(free) == 1 and levels[free[0]] > 3:  # fewer: a power that is switched
        index["temperature"] = free[0]
    elif "temperature" not in index and len(free) == 2 and "power" not in index:
        held, moving = sorted(free, key=lambda i: levels[i])
        if levels[held] * 4 < levels[moving]:
            index |= {"power": held, "temperature": moving}
    places = ", ".join(f"{role} = column {i + 1}" for role, i in sorted(index.items(), key=lambda pair: pair[1]))
    told.append(f"The file has no header; by their numbers: {places}.")


def _grows(sheet: Sheet, i: int) -> bool:
    """Return whether a column never falls and hardly ever stands: a clock, not a temperature that rises."""
    cells = [row[i] for row in sheet.rows]
    if not is_number(cells[0]):
        return stamp(cells[0]) is not None
    try:
        steps = np.diff(np.array(cells, dtype=np.float64))
    except ValueError:
        return False
    return bool(np.all(steps >= 0.0) and np.mean(steps > 0.0) > 0.9)
