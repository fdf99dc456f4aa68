"""Parse cells with a unit, a decimal comma, on or off, or no content.

Also the role and unit in a column name, and time stamps → seconds.

Join numbers whose decimal commas were taken for separators: 12,5,30,0 is 12.5 and 30.0 under two names.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from datetime import date, datetime
from itertools import accumulate, combinations, pairwise
from pathlib import Path
from typing import Final

import numpy as np

from heatertune.arrays import Array
from heatertune.errors import LogError
from heatertune.log.sheet import CellColumn, Grid

__all__ = [
    "NOTHING", "ROLES", "STAMPS", "is_clock", "is_date", "is_day_or_month", "is_foreign", "is_hours_or_minutes",
    "is_in_celsius",
    "is_number", "is_quantity", "is_scaled", "is_second_choice", "is_switch_word", "join_decimals", "month_first",
    "month_or_day_first", "on_or_off", "plain_name", "plain_quantities", "role_of", "says_nothing", "stamp",
    "unit_in_name",
]


ROLES: Final = ("time", "temperature", "power", "setpoint")

#: characters of a name that are looked at: a cell of a million would be searched for hours
_LONGEST: Final = 1000

#: looked for in this order: "set point (degC)" is no temperature, "heater temperature" no power; t is a time, T is not
_NAMES: Final[dict[str, re.Pattern[str]]] = {
    "setpoint": re.compile(
        r"(?i:set.?(point|temp|value)|temp\w* ?set\b|\bt?sp\d*\b|(target|working) ?sp\b|soll|target|consign[ea]"
        r"|设定|設定|목표|설정|уставк|заданн|zadan|žádan|börvärde|asetusarvo|ayar değeri|riferimento)"),
    "time": re.compile(
        r"(?i:time|zeit|\bdate|datum|elapsed|^milli|^sec|^minutes?$|^hours?$|^m?s$|^tage$|^days?$"
        r"|last.?(chang|updat)ed|^(tiempo|tempo|tijd|tid|czas|čas|zaman|aika|hora|heure|fecha|godzina|data)\b"
        r"|^(дата|время)\b"
        r"|时间|日期|時刻|日時|時間|年月日|시간|날짜|^temps ?[\[(/] ?(s|sec|ms|min|h)\b)"
        r"|^ts$|^t$|^[tT]s? ?[\[(/ ] ?(s|sec|[mnuµμ]s|min|h)\b"),
    "temperature": re.compile(
        r"(?i:(?<!pid )(?<!pid)temp|\bpv\d*\b|process.?va|istwert|\bist\b|actual(?!.*(power|output|out|duty|%))|°[cf]"
        r"|deg ?[cf]|kelvin|thermocouple|scaled.?input|teplot|lämpötil|s[ıi]cakl[ıi]k|температур|温度|現在値|測定値"
        r"|온도)"
        r"|^T\d*$|^[tT]\d* ?[\[(/ ] ?[KCF]\b|\bT\d*$"),
    "power": re.compile(
        r"(?i:power|duty|heat(er|ing)|pwm|output|\bc[vo]\d*\b|\bop\d*\b|^[uq]\d*($|[ \[(/])|leistung"
        r"|stell|heiz|volt|watt|spannung|strom|\bcurrent|\bamp(s|ere)?\b"
        r"|^control( signal| value)?$|manipulat|ausgang|\bactive ?out"
        r"|relais|relay|\bssr\b|^heat$|\bout\d*\b|puissance|pot[eê]nci?a|potenza|vermogen|^moc\b|výkon|мощност|нагрев|功率|出力"
        r"|输出|加热|加熱|操作量|ヒータ|effekt|^güç|출력|히터|^teho\b|saída|salida|sortie|uscita|aquec|calefac|chauff|riscald)"
        r"|\bMV\d*\b"),
}

#: used only if nothing else has the role: a room's temperature, a date next to the time of day, an electric current
_SECOND_CHOICE: Final = re.compile(
    r"(?i:ambient|room|\bext|outside|umgebung|raum|junction|board|cpu|^dat(e|um|a)$|^fecha$|^data\b|volt|watt|spannung|strom|\bcurrent"
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
        ("ms", re.compile(r"(^|[\[(/ ])m(illi)?s(ec(onds?)?)?\.?[\])]?$|^millis|[\[(]мс[\])]$")),
        ("min", re.compile(r"(^|[\[(/ ])min(ute[ns]?|s)?\.?[\])]?$|[\[(](мин|分)[\])]$")),
        ("h", re.compile(r"(^|[\[(/ ])(h(ours?|rs?)?|std|stunden)\.?[\])]?$")),
        ("d", re.compile(r"(^|[\[(/ ])(d|days?|tage)\.?[\])]?$")),
        ("s", re.compile(r"(^|[\[(/ ])s(e[ck](onds?|unden)?)?\.?[\])]?$|[\[(](с|сек|秒|초)[\])]$")),
        ("us", re.compile(r"(^|[\[(/ ])([uµμ]s(ec)?|micros(ec(onds?)?)?)\.?[\])]?$")),
        ("ns", re.compile(r"(^|[\[(/ ])n(ano)?s(ec(onds?)?)?\.?[\])]?$")),
        ("ms", re.compile(rf"\b(milliseconds|millisekunden)\b{_ALONE}")),
        ("min", re.compile(rf"\b(minutes|minuten)\b{_ALONE}")),
        ("h", re.compile(rf"\b(hours|stunden)\b{_ALONE}")),
        ("s", re.compile(rf"\b(seconds|sekunden)\b{_ALONE}")),
    ),
    "power": (
        ("27648", re.compile(r"\boutput per$")),  # Siemens: Output_PER of PID_Compact is an analogue output
        ("255", re.compile(r"255|8.?bit|pwm.*counts")),
        ("1", re.compile(r"0\s*(\.\.\.?|…|-|–|to)\s*1\b(?!00)|fraction|p\.?u\.?\b")),
        ("100", re.compile(r"main\.(active|working)out|%|pct|percent|prozent|0\s*(\.\.\.?|…|-|–|to)\s*100\b")),
    ),
}

#: the range of a power in its name, of those that devices have: [0...127], (0-4095), [-255…255]
_FULL_SCALE: Final = re.compile(
    r"[\[(] *(?:0|-(?=(\d+)\D+\1 *[\])])\d+) *(?:\.\.\.?|…|–|-|to|bis) *"
    r"(1|100|127|255|1000|1023|4095|10000|27648|32767|65535) *[\])]")
#: a column of a recorder whose name says nothing but its unit: CH0001 [C]
_IN_CELSIUS: Final = re.compile(r"[\[(] ?C ?[\])]$")
#: units that are neither a temperature, a time nor a share of full power
_FOREIGN: Final[dict[str, re.Pattern[str]]] = {
    "temperature": re.compile(r"%|pct|percent|counts?\b|\badc\b|[\[(/ ]m?[va][\])]?$|ohm|ω|\bbar\b"),
    "time": re.compile(r"[\[(/ ]ticks?[\])]?$"),
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
    "time": re.compile(rf"{_TIMES_TEN}|\d ?(?i:[mnuµμ]?s|sec|min|h)\b"),
    "power": re.compile(rf"{_TIMES_TEN}|\b(0[.,]0?1|1/10+) ?%|‰|(?i:permil|promille)"),
}


def role_of(name: str) -> str | None:
    """Return the role denoted by a name, or None."""
    plain = plain_name(name)
    return next((role for role, pattern in _NAMES.items() if pattern.search(plain)), None)


def is_in_celsius(name: str) -> bool:
    """Return whether a name that denotes no role ends with the unit of a temperature, CH0001 [C]."""
    return role_of(name) is None and _IN_CELSIUS.search(plain_name(name)) is not None


def is_second_choice(name: str) -> bool:
    """Return whether a column is taken for its role only where nothing else has it."""
    return _SECOND_CHOICE.search(plain_name(name)) is not None


def unit_in_name(role: str, name: str) -> str | None:
    """Return the unit in a column's name, or None; for power its full scale."""
    lower = _CAPITALISED.sub(" ", plain_name(name)).lower()
    patterns = _UNITS.get("temperature" if role == "setpoint" else role, ())
    if role == "power" and (full := _FULL_SCALE.search(lower)) is not None:
        return full[2]
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
#: 2026年03月14日 09時58分00秒, and the same in Korean
_CHARACTERS: Final = str.maketrans(
    {**dict.fromkeys("年月년월", "-"), **dict.fromkeys("時分시분", ":"), **dict.fromkeys("日일秒초")})
_MONTHS: Final = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
_NAMED_MONTH = re.compile(
    r"(?:[A-Z][a-z]{2},? )?(?:(\d{1,2})[- ]([A-Z][a-z]{2})[a-z]*[- ,]+(\d{4})"
    r"|([A-Z][a-z]{2})[a-z]* (\d{1,2}),? (\d{4})),? *(.*)")
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
    if not text.isascii():
        text = text.translate(_CHARACTERS).strip(": ")
    if "A" <= text[:1] <= "Z" or "A" <= text[3:4] <= "Z" or "A" <= text[2:3] <= "Z":
        text = _with_number_of_month(text)
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


def _with_number_of_month(text: str) -> str:
    """Return a date with the name of its month, 14-Mar-2026 or Mar 14, 2026, as ISO 8601 has it."""
    found = _NAMED_MONTH.fullmatch(text)
    if found is None:
        return text
    day, month, year = (found[1], found[2], found[3]) if found[1] else (found[5], found[4], found[6])
    if month.lower() not in _MONTHS:
        return text
    return f"{year}-{_MONTHS.index(month.lower()) + 1:02d}-{day:0>2} {found[7]}".strip()


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


def month_or_day_first(cells: Sequence[str]) -> str:
    """Return "month" or "day" if only with it first dates such as 03/04/2026 follow each other day by day, else "".

    Of a log with a row or two for each date, which may be one of a month, nothing is inferred.
    """
    dates = list(dict.fromkeys(found.groups() for cell in cells if (found := _SLASHED.match(cell)) is not None))
    if len(cells) < _ROWS_OF_DATE * len(dates):
        return ""
    longest = {}
    for order, month, day in (("month", 0, 1), ("day", 1, 0)):
        try:
            days = [date(int(found[2]) % 100 + 2000, int(found[month]), int(found[day])).toordinal() for found in dates]
        except ValueError:
            return ""
        longest[order] = max(abs(after - before) for before, after in pairwise(days))
    order = min(longest, key=lambda first: longest[first])
    return order if longest[order] <= _DAY_BY_DAY and max(longest.values()) > _MONTH_BY_MONTH else ""


_ROWS_OF_DATE: Final = 4
_DAY_BY_DAY: Final = 7  # days
_MONTH_BY_MONTH: Final = 20


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
    "undefined", "bad", "bad input", "i/o timeout", "comm fail", "#n/d", "#wert!", "#value!", "#valor!", "#div/0!", "#",
    "----", "-----", "--.-", "--.--", "---.-", "err", "erro", "error", "open", "+over", "-over", "over", "nan.", "s.br",
    "sbr", "nopv", "****",
))
_ON: Final = frozenset((
    "true", "on", "yes", "ja", "ein", "an", "wahr", "heating", "high", "active", "aktiv", "run", "running", "ligado",
    "marche", "encendido", "acceso", "aan", "вкл", "включено", "zał", "zapnuto", "på", "päällä", "açık", "オン", "开",
    "켜짐"))
_OFF: Final = frozenset(("false", "off", "no", "nein", "aus", "falsch", "idle", "low", "inactive", "inaktiv", "stop",
    "stopped", "standby", "desligado", "arrêt", "apagado", "spento", "uit", "выкл", "выключено", "wył", "vypnuto", "av",
    "pois", "kapalı", "オフ", "关", "꺼짐"))


def is_number(cell: str) -> bool:
    """Return whether a cell is a number, decimal comma or point."""
    return _NUMBER.fullmatch(cell.strip()) is not None


def is_quantity(cell: str) -> bool:
    """Return whether a cell is a number with a unit: 20.0 °C, 40%."""
    return _QUANTITY.fullmatch(cell) is not None


def says_nothing(cell: str) -> bool:
    """Return whether a cell is empty or says that it holds nothing."""
    return cell.lower() in NOTHING


def on_or_off(cells: CellColumn) -> Array | None:
    """Convert on/off cells (true, yes, ein …) to 1 and 0, shape (n,); None if one of them is neither."""
    if not all(cell.lower() in _ON | _OFF for cell in cells.kinds()):
        return None
    return cells.numbers(lambda cell: float(cell.lower() in _ON))


def is_switch_word(cell: str) -> bool:
    """Return whether a cell says on or off."""
    return cell.lower() in _ON | _OFF


def plain_quantities(cells: CellColumn) -> tuple[CellColumn, str, bool] | None:
    """Return plain numbers, the common unit, and whether there were decimal commas; None if nothing changes.

    A column with both commas and points is left unchanged, because one of them may group thousands; so is one with two
    units.
    """
    first = next((cell for cell in cells if not says_nothing(cell)), "")
    if not is_quantity(first) and not cells.holds(","):
        return None
    unit = _common_unit(cells.kinds()) if is_quantity(first) else ""

    def figure(cell: str) -> str:
        match = _QUANTITY.fullmatch(cell) if unit and not says_nothing(cell) else None
        return cell if match is None else match[1]

    commas = False
    for cell in map(figure, cells.kinds()):
        commas |= _COMMA.fullmatch(cell) is not None
        if _POINT.fullmatch(cell):
            commas = False
            break
    if not unit and not commas:
        return None

    def plain(cell: str) -> str:
        text = figure(cell)
        return text.replace(",", ".") if commas and _COMMA.fullmatch(text) else text

    return cells.map(plain), unit, commas


def _common_unit(kinds: Iterable[str]) -> str:
    """Return the unit of all cells that hold something, "" where they are not all alike."""
    unit = ""
    for cell in kinds:
        match = None if says_nothing(cell) else _QUANTITY.fullmatch(cell)
        own = "" if match is None else match[2].strip()
        if not says_nothing(cell) and (not own or own != (unit or own)):
            return ""
        unit = own or unit
    return unit


_WHOLE: Final = re.compile(r"[+-]?\d+|.*:\d\d")
_DIGITS: Final = re.compile(r"\d{1,6}")
_SAMPLE: Final = 400  # rows that are tried
_NEARLY_ALL: Final = 0.98
_CLEARLY: Final = 0.5  # of the roughness of the next best
_MOST_COLUMNS: Final = 12
_MANY: Final = 20  # values


def join_decimals(file: Path, rows: Grid, stated: str | None, repairs: list[str]) -> None:
    """Join the two cells of each number with a decimal comma, in place, where there are more cells than names.

    Args:
        file: for messages.
        rows: of a file that separates its cells by commas, the names among the first.
        stated: columns with decimal commas, by number (1 = first) or name, with commas between them; "none"; None: find
            them.
        repairs: list to which the joining is added.

    Raises:
        LogError: several columns may be those with decimal commas, or one that is stated does not exist.
    """
    width = rows.width
    sample = [row for row in rows[-_SAMPLE:] if len(row) == width]
    words = [row for row in rows[:_SAMPLE] if 1 < len(row) < width and all(row) and not any(
        is_number(cell) or is_quantity(cell) or stamp(cell) is not None for cell in row)]
    names = max(words, key=lambda row: len({role_of(cell) for cell in row}), default=None)
    if stated is not None:
        columns = () if stated == "none" else _stated(file, stated, names)
    elif names is None:
        _demand_no_fractions(file, sample)
        return
    elif width > 2 * len(names) or len(names) > _MOST_COLUMNS:
        return
    else:
        columns = _found(file, sample, len(names), width)
    if not columns:
        return
    number = width - len(columns)
    rows.join(width, [place for i, place in zip(range(number), _places(number, columns), strict=True) if i in columns])
    shown = ", ".join(repr(names[i]) if names else str(i + 1) for i in columns)
    repairs.append(f"The decimal commas of {shown} also separate the cells; each two cells were joined.")


def _demand_no_fractions(file: Path, sample: Sequence[Sequence[str]]) -> None:
    """Refuse cells without names of which one looks like the digits behind a decimal comma: 05, 31, 90.

    Raises:
        LogError: there is one, behind whole numbers.
    """
    for place, (before, cells) in enumerate(pairwise(zip(*sample, strict=True)), start=1):
        is_fraction = len(set(map(len, cells))) == 1 and len(cells[0]) > 1 and len(set(cells)) > _MANY and any(
            cell[0] == "0" for cell in cells)
        if is_fraction and all(map(_DIGITS.fullmatch, cells)) and all(map(_WHOLE.fullmatch, before)):
            raise LogError(f"{cells[-1]!r} in cell {place + 1} looks like decimals behind a comma", file=file,
                           expected=f"--decimal-comma {place} if so (the number of the column, further ones behind "
                                    "commas), or --decimal-comma none")


def _stated(file: Path, stated: str, names: Sequence[str] | None) -> tuple[int, ...]:
    columns = []
    for text in map(str.strip, stated.split(",")):
        if names and text in names:
            columns.append(names.index(text))
        elif text.isdecimal() and int(text) >= 1:
            columns.append(int(text) - 1)
        else:
            raise LogError("no column of decimal commas", file=file, value=text,
                           expected=f"one of {', '.join(names)}" if names else "numbers, 1 = first")
    return tuple(sorted(columns))


def _found(file: Path, sample: Sequence[Sequence[str]], count: int, width: int) -> tuple[int, ...]:
    """Return the columns whose joining makes the smoothest numbers, empty if none makes numbers."""
    rough = {}
    for columns in combinations(range(count), width - count):
        trial = [list(row) for row in sample]
        if _are_decimals(sample, count, columns):
            _join(trial, count, columns)
            rough[columns] = _roughness(trial)
    if not rough:
        return ()
    best, *others = sorted(rough, key=lambda columns: rough[columns])
    if others and rough[best] > _CLEARLY * rough[others[0]]:
        asked = " or ".join("--decimal-comma " + ",".join(str(i + 1) for i in each) for each in (best, *others[:2]))
        raise LogError("commas both separate the cells and mark decimals", file=file,
                       expected=f"{asked}; or a file with semicolons")
    return best


def _places(count: int, columns: Iterable[int]) -> list[int]:
    """Return the place of the first cell of each column."""
    joined = set(columns)
    return list(accumulate((2 if i in joined else 1 for i in range(count - 1)), initial=0))


def _are_decimals(sample: Sequence[Sequence[str]], count: int, columns: Sequence[int]) -> bool:
    """Return whether the cells of the columns are a whole number and digits, always as many."""
    places = _places(count, columns)
    for column in columns:
        place = places[column]
        good = [row for row in sample if _WHOLE.fullmatch(row[place]) and _DIGITS.fullmatch(row[place + 1])]
        if len(good) < _NEARLY_ALL * len(sample) or len({len(row[place + 1]) for row in good}) > 1:
            return False
    return True


def _join(rows: Iterable[list[str]], count: int, columns: Sequence[int]) -> None:
    for row in rows:
        for column, place in reversed(list(zip(range(count), _places(count, columns), strict=True))):
            if column in columns and place + 1 < len(row):
                row[place : place + 2] = [f"{row[place]}.{row[place + 1]}"]


def _roughness(rows: Sequence[Sequence[str]]) -> float:
    """Return how far the numbers of each column jump from row to row, as a fraction of their span, added up."""
    total = 0.0
    for cells in zip(*rows, strict=True):
        try:
            values = np.array(cells, dtype=np.float64)
        except ValueError:
            continue
        total += float(np.mean(np.abs(np.diff(values)))) / max(float(np.ptp(values)), 1e-12)
    return total
