"""Parse cells with a unit, a decimal comma, on or off, or no content.

Also the role and unit in a column name, and time stamps → seconds.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from datetime import datetime
from typing import Final

__all__ = [
    "NOTHING", "ROLES", "STAMPS", "is_clock", "is_date", "is_day_or_month", "is_foreign", "is_hours_or_minutes",
    "is_number", "is_quantity", "is_scaled", "is_second_choice", "month_first", "on_or_off", "plain_name",
    "plain_quantities", "role_of", "says_nothing", "stamp", "unit_in_name",
]


ROLES: Final = ("time", "temperature", "power", "setpoint")

#: characters of a name that are looked at: a cell of a million would be searched for hours
_LONGEST: Final = 1000

#: looked for in this order: "set point (degC)" is no temperature, "heater temperature" no power; t is a time, T is not
_NAMES: Final[dict[str, re.Pattern[str]]] = {
    "setpoint": re.compile(r"(?i:set.?(point|temp|value)|temp\w* ?set\b|\bt?sp\d*\b|soll|target)"),
    "time": re.compile(r"(?i:time|zeit|\bdate|datum|elapsed|^milli|^sec|^minutes?$|^hours?$|^m?s$|^tage$|^days?$"
                       r"|last.?(chang|updat)ed)|^t$|^[tT] ?[\[(/ ] ?(s|sec|ms|min|h)\b"),
    "temperature": re.compile(r"(?i:temp|\bpv\d*\b|process.?va|istwert|\bist\b|actual(?!.*(power|output|duty|%))|°[cf]"
                              r"|deg ?[cf]|kelvin|thermocouple)|^T\d*$|^[tT]\d* ?[\[(/ ] ?[KCF]\b|\bT\d*$"),
    "power": re.compile(r"(?i:power|duty|heat(er|ing)|pwm|output|\bc[vo]\d*\b|\bop\d*\b|^[uq]\d*($|[ \[(/])|leistung"
                        r"|stell|heiz|volt|watt|spannung|strom|\bcurrent|\bamp(s|ere)?\b"
                        r"|^control( signal| value)?$|manipulat|ausgang"
                        r"|relais|relay|\bssr\b|^heat$|\bout\d*\b)|\bMV\d*\b"),
}

#: used only if nothing else has the role: a room's temperature, a date next to the time of day, an electric current
_SECOND_CHOICE: Final = re.compile(
    r"(?i:ambient|room|\bext|outside|umgebung|raum|junction|board|cpu|^dat(e|um)$|volt|watt|spannung|strom|\bcurrent"
    r"|\bamp(s|ere)?\b|^control|last.?updated)")

#: after a unit of time in full: no second one follows, as in "hours, minutes and seconds"
_ALONE: Final = r"(?!.*\b(minutes|seconds|minuten|sekunden)\b)"

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
        ("d", re.compile(r"(^|[\[(/ ])(d|days?|tage)\.?[\])]?$")),
        ("s", re.compile(r"(^|[\[(/ ])s(e[ck](onds?|unden)?)?\.?[\])]?$")),
        ("ms", re.compile(rf"\b(milliseconds|millisekunden)\b{_ALONE}")),
        ("min", re.compile(rf"\b(minutes|minuten)\b{_ALONE}")),
        ("h", re.compile(rf"\b(hours|stunden)\b{_ALONE}")),
        ("s", re.compile(rf"\b(seconds|sekunden)\b{_ALONE}")),
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
    "time": re.compile(r"[\[(/ ][uµμn]s[\])]?$"),
    "power": re.compile(r"[\[(/ 0-9][mk]?[wva][\])]?$|volt|watt|spannung|strom|\bcurrent|\bamp(s|ere)?\b"
                        r"|^control( signal| value)?$|counts?\b|\braw\b|\b[da][da]c\b|°|deg ?[cf]\b"),
}

#: a unit of time written as a capitalised end: timeMs, elapsedSeconds
_CAPITALISED: Final = re.compile(r"(?<=[a-z])(?=(Ms|Millis|Sec|Secs|Seconds|Min|Minutes|Hours)$)")
#: the numbers are a multiple of the unit: Temp_x10, PV [0.1 °C], time [10 ms]
_TIMES_TEN: Final = (r"(?<![a-z0-9])(x|×|\*) ?10+\b|(?<!\d)/ ?10+\b|(?<=[a-z])X10+\b"
                     r"|(?i:\bdeci(?!mal)|\bcenti(?!grad)|tenths?|zehntel|hundredths?)")
_SCALED: Final[dict[str, re.Pattern[str]]] = {
    "temperature": re.compile(rf"{_TIMES_TEN}|\b(0[.,]0?1|1/10+) ?(°|[dD]eg|[CFK]\b)|\b[cd]deg"),
    "time": re.compile(rf"{_TIMES_TEN}|\d ?(?i:m?s|sec|min|h)\b"),
    "power": re.compile(rf"{_TIMES_TEN}|\b(0[.,]0?1|1/10+) ?%|‰|(?i:permil|promille)"),
}


def role_of(name: str) -> str | None:
    """Return the role denoted by a name, or None."""
    plain = plain_name(name)
    return next((role for role, pattern in _NAMES.items() if pattern.search(plain)), None)


def is_second_choice(name: str) -> bool:
    """Return whether a column is taken for its role only where nothing else has it."""
    return _SECOND_CHOICE.search(plain_name(name)) is not None


def unit_in_name(role: str, name: str) -> str | None:
    """Return the unit in a column's name, or None; for power its full scale."""
    lower = _CAPITALISED.sub(" ", plain_name(name)).lower()
    patterns = _UNITS.get("temperature" if role == "setpoint" else role, ())
    units = (unit for unit, pattern in patterns if pattern.search(lower))
    return next(units, None)


def is_foreign(role: str, name: str) -> bool:
    """Return whether a column's name contains a unit foreign to its role: power in watts, a PV in percent."""
    return unit_in_name(role, name) is None and _FOREIGN[role].search(plain_name(name).lower()) is not None


def is_scaled(role: str, name: str) -> bool:
    """Return whether a column's name says that its numbers are a multiple of a unit: Temp_x10, time [10 ms]."""
    return _SCALED["temperature" if role == "setpoint" else role].search(plain_name(name)) is not None


def plain_name(name: str) -> str:
    """Normalise a name: spaces for underscores, one notation for degrees, long names truncated."""
    return name[:_LONGEST].replace("_", " ").strip().replace("º", "°").replace("℃", "°C").replace("℉", "°F")


#: the formats of `stamp`, for messages
STAMPS: Final = "2026-03-01 10:00:00 (ISO 8601), 01.03.2026 10:00:00 or 10:00:00"

_DAY_FIRST = re.compile(r"(\d{1,2})[./](\d{1,2})[./](\d{4}|\d\d)(?:,?[ T]+(.+))?")
_CLOCK = re.compile(r"\d{1,2}:\d\d(:\d\d([.,:]\d+)?)?( ?[AaPp]\.?[Mm]\.?)?")
_NOON = re.compile(r"(\d{1,2})(:\d\d.*?) ?([AaPp])\.?[Mm]\.?")
_DATE = re.compile(r"\d{4}[-/]\d\d?[-/]\d\d?|\d\d?[./]\d\d?[./](\d{4}|\d\d)")
_SLASHED = re.compile(r"(\d{1,2})/(\d{1,2})/(\d{4}|\d\d)(?!\d)")
_THOUSANDTHS = re.compile(r"(:\d\d:\d\d):(\d{1,3})$")


def stamp(cell: str) -> datetime | None:
    """Parse the time stamp in a cell, with its time zone if it has one; None if it is not a time stamp.

    ISO 8601, also with a space or slashes in the date; day.month.year; a time of day alone; am and pm.
    """
    try:  # the two ways that nearly all logs have; the others take five times as long
        if cell[4:5] == "-" and ":" in cell:
            return datetime.fromisoformat(cell)
        if cell[2:3] == cell[5:6] == "." and cell[13:14] == ":":
            return datetime.fromisoformat(f"{cell[6:10]}-{cell[3:5]}-{cell[:2]}T{cell[11:]}")
    except ValueError:
        pass
    try:
        return _moment(cell.strip())
    except ValueError:
        return None


def _moment(text: str) -> datetime | None:
    match = _DAY_FIRST.fullmatch(text)
    if match:
        day, month, year, clock = match.groups()
        text = f"{year if len(year) == 4 else f'20{year}'}-{month:0>2}-{day:0>2}T{_clock(clock or '00:00')}"
    elif _CLOCK.fullmatch(text):
        text = f"1970-01-01T{_clock(text)}"
    elif not text[:4].isdigit() or text.isdigit() or len(text) < 8:
        return None
    else:
        text = text.removesuffix(" UTC").replace("/", "-")
        day, mark, clock = text.partition(" ")
        text = f"{day}T{_clock(clock.lstrip())}" if mark and clock.strip() else day
    return datetime.fromisoformat(text)


def _clock(text: str) -> str:
    """Return a time of day as ISO 8601 has it."""
    noon = _NOON.fullmatch(text)
    if noon:
        hour, rest, half = noon.groups()
        text = f"{int(hour) % 12 + 12 * (half in 'pP')}{rest}"
    text = _THOUSANDTHS.sub(r"\1.\2", text)
    return f"0{text}" if text[1:2] == ":" else text


def is_clock(cell: str) -> bool:
    """Return whether a cell is a time of day without a date."""
    return _CLOCK.fullmatch(cell) is not None


def is_hours_or_minutes(cell: str) -> bool:
    """Return whether the first cell of a column may be either 0 h 05 min or 0 min 05 s."""
    return re.fullmatch(r"0?0:\d\d", cell) is not None


def is_date(cell: str) -> bool:
    """Return whether a cell is a date without a time of day."""
    return _DATE.fullmatch(cell) is not None


def is_day_or_month(cells: Iterable[str]) -> bool:
    """Return whether the dates are ambiguous in day and month, such as 03/04/2026 and 03/05/2026."""
    dates = {match.group(): match.group(1) for match in map(_SLASHED.match, cells) if match}
    return len(dates) > 1 and all(int(first) <= 12 for first in dates.values())


def month_first(cells: Iterable[str], *, turn: bool = False) -> str:
    """Return the first date that can only be month first, day first then; with `turn` every slashed date is turned."""
    for cell in cells:
        match = _SLASHED.match(cell)
        if match and (turn or int(match[2]) > 12):
            return f"{match[2]}/{match[1]}/{match[3]}{cell[match.end():]}"
    return ""


_FIGURE: Final = r"[+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][+-]?\d+)?"
_NUMBER: Final = re.compile(rf"{_FIGURE}|[+-]?(?:nan|inf|infinity)", re.IGNORECASE)
_COMMA: Final = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")
_POINT: Final = re.compile(r"[+-]?\d*\.\d+([eE][+-]?\d+)?")
_QUANTITY: Final = re.compile(
    rf"({_FIGURE})[ \u00a0\u202f]*(°[CFK]?|º[CF]|℃|℉|deg ?[CF]|[CFK]|Kelvin|%|pct|[mk]?[VAW]|Volts?|Watts?"
    r"|m?s|sec|min|h)", re.IGNORECASE)

#: cells that say that they hold nothing
NOTHING: Final = frozenset((
    "", "nan", "null", "none", "n/a", "na", "-", "--", "---", "unavailable", "unknown", "#n/a", "#nv", "no data",
    "undefined", "bad", "bad input", "i/o timeout", "comm fail",
))
_ON: Final = frozenset((
    "true", "on", "yes", "ja", "ein", "an", "wahr", "heating", "high", "active", "aktiv", "run", "running"))
_OFF: Final = frozenset(("false", "off", "no", "nein", "aus", "falsch", "idle", "low", "inactive", "inaktiv", "stop",
    "stopped", "standby"))


def is_number(cell: str) -> bool:
    """Return whether a cell is a number, decimal comma or point."""
    return _NUMBER.fullmatch(cell.strip()) is not None


def is_quantity(cell: str) -> bool:
    """Return whether a cell is a number with a unit: 20.0 °C, 40%."""
    return _QUANTITY.fullmatch(cell) is not None


def says_nothing(cell: str) -> bool:
    """Return whether a cell is empty or says that it holds nothing."""
    return cell.lower() in NOTHING


def on_or_off(cells: Sequence[str]) -> list[str] | None:
    """Convert on/off cells (true, yes, ein …) to 1 and 0; None if one of them is neither."""
    digits = {cell: "1" if cell.lower() in _ON else "0" for cell in set(cells) if cell.lower() in _ON | _OFF}
    try:
        return [digits[cell] for cell in cells]
    except KeyError:
        return None


def plain_quantities(cells: Sequence[str]) -> tuple[list[str], str, bool] | None:
    """Return plain numbers, the common unit, and whether there were decimal commas; None if nothing changes.

    A column with both commas and points is left unchanged, because one of them may group thousands; so is one with two
    units.
    """
    if _are_plain(cells):
        return None
    kinds = set(cells)
    unit, figures = _without_unit(kinds)
    plain = {cell: figures.get(cell, cell) for cell in kinds}
    held = plain.values()
    commas = any(map(_COMMA.fullmatch, held)) and not any(map(_POINT.fullmatch, held))
    if not unit and not commas:
        return None
    if commas:
        plain = {cell: text.replace(",", ".") if _COMMA.fullmatch(text) else text for cell, text in plain.items()}
    return [plain[cell] for cell in cells], unit, commas


def _are_plain(cells: Sequence[str]) -> bool:
    """Return whether no cell can have a decimal comma or a unit; units occur only if all cells of a column have one."""
    first = next((cell for cell in cells if not says_nothing(cell)), "")
    return not is_quantity(first) and not any("," in cell for cell in cells)


def _without_unit(kinds: set[str]) -> tuple[str, dict[str, str]]:
    """Return the unit of all cells that hold something, and each one's figure; no unit where they are not all alike."""
    matches = {cell: _QUANTITY.fullmatch(cell) for cell in kinds if not says_nothing(cell)}
    units = {"" if match is None else match[2].strip() for match in matches.values()}
    if len(units) != 1 or units == {""}:
        return "", {}
    return units.pop(), {cell: match[1] for cell, match in matches.items() if match is not None}
