"""What a column's name tells: its role and its unit."""

from __future__ import annotations

import re
from typing import Final

__all__ = ["ROLES", "is_foreign", "is_scaled", "is_second_choice", "plain_name", "role_of", "unit_in_name"]

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

#: taken only where nothing else has the role: a room's temperature, a date beside the time of day, an electric current
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
    """Return the role that a name tells, None where it tells none."""
    plain = plain_name(name)
    return next((role for role, pattern in _NAMES.items() if pattern.search(plain)), None)


def is_second_choice(name: str) -> bool:
    """Return whether a column is taken for its role only where nothing else has it."""
    return _SECOND_CHOICE.search(plain_name(name)) is not None


def unit_in_name(role: str, name: str) -> str | None:
    """Return the unit a column's name tells, None where it tells none; for power its full scale."""
    lower = _CAPITALISED.sub(" ", plain_name(name)).lower()
    patterns = _UNITS.get("temperature" if role == "setpoint" else role, ())
    units = (unit for unit, pattern in patterns if pattern.search(lower))
    return next(units, None)


def is_foreign(role: str, name: str) -> bool:
    """Return whether a column's name tells a unit that the role does not have: power in watts, a PV in percent."""
    return unit_in_name(role, name) is None and _FOREIGN[role].search(plain_name(name).lower()) is not None


def is_scaled(role: str, name: str) -> bool:
    """Return whether a column's name says that its numbers are a multiple of a unit: Temp_x10, time [10 ms]."""
    return _SCALED["temperature" if role == "setpoint" else role].search(plain_name(name)) is not None


def plain_name(name: str) -> str:
    """Return a name with spaces for underscores and one way to write degrees, of what is longer the beginning."""
    return name[:_LONGEST].replace("_", " ").strip().replace("º", "°").replace("℃", "°C").replace("℉", "°F")
