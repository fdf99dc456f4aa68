"""Time stamps and durations in cells: the dates of many countries and programs, and their time zones."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from datetime import date, datetime, timedelta, timezone
from itertools import islice, pairwise
from typing import Final

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.log.sheet import CellColumn

__all__ = ["LONGEST_STEP_S", "NO_ORDER", "STAMPS", "TIME_UNITS", "clocks_in_digits", "day_first", "durations_s",
           "has_zone", "is_clock", "is_date", "is_date_in_digits", "is_day_or_month", "is_hours_or_minutes",
           "likely_time_unit", "month_first", "order_of_dates", "past_hour", "past_midnight", "stamp", "unlike_part",
           "within_hours"]


#: the formats of `stamp`, for messages
STAMPS: Final = "2026-03-01 10:00:00 (ISO 8601), 01.03.2026 10:00:00 or 10:00:00"

#: unit → its length [s]
TIME_UNITS: Final = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0, "d": 86400.0}
LONGEST_STEP_S: Final = 500.0  # of a calendar's seconds: a counter of milliseconds has longer ones after weeks
_UNEVEN: Final = 0.02

_DAY_FIRST = re.compile(r"(\d{1,2})([-./]) ?(\d{1,2})\2 ?(\d{4}|\d\d)(?:,?[ T]+(.+))?")
_YEAR_FIRST = re.compile(r"(\d{4}) ?[-/.] ?(\d{1,2}) ?[-/.] ?(\d{1,2})(?:\.? *[-T:_ ] *(\S.*))?")
_ORDINAL: Final = re.compile(r"(\d{4})-?([0-3]\d\d)[T ]+(\d.*)")  # the day of the year, ISO 8601
_DIGITS = re.compile(r"((?:19|20)\d\d)([01]\d)([0-3]\d)[T_ ]?([0-2]\d)([0-5]\d)(?:([0-5]\d)(?:\.?(\d{1,6}))?)?")
_CLOCK = re.compile(r"\d{1,2}:\d\d(:\d\d([.,:]\d+)?)?( ?[AaPp]\.?[Mm]\.?)?")
_DOTTED_CLOCK = re.compile(r"(\d{1,2})\.(\d\d)\.(\d\d)(?!\d)")
_NOON = re.compile(r"(\d{1,2})(:\d\d.*?) ?([AaPp])\.? ?[Mm]\.?")
_NOON_BEFORE = re.compile(r"([AP]M) ?(\d{1,2}:\d\d(?::\d\d)?(?:\.\d+)?)")
_DATE = re.compile(r"\d{4}[-/.]\d\d?[-/.]\d\d?|\d\d?([-./]) ?\d\d?\1 ?(\d{4}|\d\d)")
_SLASHED = re.compile(r"(\d{1,2})[-/](\d{1,2})[-/](\d{4}|\d\d)(?!\d)")
#: 2026年03月14日 09時58分00秒, and the same in Korean
_CHARACTERS: Final = str.maketrans(
    {**dict.fromkeys("年月년월", "-"), **dict.fromkeys("時时分시분", ":"), **dict.fromkeys("日일秒초"),
     **dict.fromkeys("\u00a0\u202f\u2009\u3000", " ")})
_HALVES: Final = re.compile("(上午|午前|오전|πμ|π\\.μ\\.)|下午|午後|오후|μμ|μ\\.μ\\.")
#: the beginnings of the months' names: English, German, French, Spanish, Italian, Portuguese, Dutch, Polish, Czech,
#: Swedish, Danish, Norwegian, Russian
_MONTHS: Final = (
    ("jan", "gen", "ene", "sty", "led", "янв"), ("feb", "fév", "fev", "lut", "úno", "фев"),
    ("mar", "mär", "mrt", "maa", "bře", "мар"), ("apr", "avr", "abr", "kwi", "dub", "апр"),
    ("may", "mai", "maj", "mei", "mag", "kvě", "мая", "май"), ("jun", "juin", "giu", "cze", "июн"),
    ("jul", "juil", "lug", "lip", "июл"), ("aug", "aoû", "aou", "ago", "sie", "srp", "авг"),
    ("sep", "set", "wrz", "zář", "сен"), ("oct", "okt", "ott", "out", "paź", "říj", "окт"), ("nov", "lis", "ноя"),
    ("dec", "dez", "dic", "déc", "des", "gru", "pro", "дек"))
_NAME: Final = r"([^\W\d_]{3,})"
_DAY_AND_MONTH = re.compile(
    rf"(?:\w{{2,4}}\.?,? )?(\d{{1,2}})\.?[- /]+(?:de )?{_NAME}\.?[-, /]+(?:de )?(\d{{4}}|\d\d)\b[ ,T:]*(.*)")
_MONTH_AND_DAY = re.compile(rf"(?:\w{{2,9}}\.?,? )?{_NAME}\.? (\d{{1,2}})(?:st|nd|rd|th)?,? (\d{{4}})\b[ ,T]*(.*)")
_YEAR_LAST = re.compile(rf"(?:\w{{3}} )?{_NAME} +(\d{{1,2}}) (\d\d:\d\d:\d\d(?:\.\d+)?)( [A-Z]{{2,5}})?(?: (\d{{4}}))?")
_YEAR_UNKNOWN: Final = "2000"  # a leap year, for lines of a system's log
_THOUSANDTHS = re.compile(r"(:\d\d:\d\d):(\d{1,3})$")
_PLACE: Final = re.compile(r"\[\w+/[\w/]+\]$")  # [Europe/Berlin] behind an offset
_ZONE: Final = re.compile(r"(?<=[\d ]) ?\(?([A-Z]{2,4}T|UTC|BST|MEZ|MSK|Z)\)?$")
#: name of a zone → its offset [h]; those that have two differ in both halves of a log alike
_ZONES: Final = {
    "Z": 0, "UTC": 0, "GMT": 0, "WET": 0, "WEST": 1, "BST": 1, "CET": 1, "MEZ": 1, "CEST": 2, "MESZ": 2, "EET": 2,
    "EEST": 3, "MSK": 3, "IST": 5.5, "JST": 9, "KST": 9, "AST": -4, "ADT": -3, "EST": -5, "EDT": -4, "CST": -6,
    "CDT": -5, "MST": -7, "MDT": -6, "PST": -8, "PDT": -7, "AEST": 10, "AEDT": 11, "NZST": 12, "NZDT": 13,
    "BRT": -3, "SGT": 8}


def stamp(cell: str) -> datetime | None:
    """Parse the time stamp in a cell, with its time zone if it has one; None if it is not a time stamp.

    ISO 8601, also with a space or slashes in the date; day.month.year; a time of day alone; am and pm; a month's name.
    """
    try:  # the two ways that nearly all logs have; the others take five times as long
        if cell[4:5] == "-" and ":" in cell:
            return datetime.fromisoformat(cell)
        if cell[2:3] == cell[5:6] == "." and cell[13:14] == ":":
            return datetime.fromisoformat(f"{cell[6:10]}-{cell[3:5]}-{cell[:2]}T{cell[11:]}")
    except ValueError:
        pass
    if _POSSIBLE.match(cell) is None:
        return None
    try:
        return _moment(cell.strip())
    except ValueError:
        return None


_POSSIBLE: Final = re.compile(r"(?=\D*\d).{1,60}$", re.DOTALL)


def _moment(text: str) -> datetime | None:
    """Return the moment in a text; a date without a clock is its midnight.

    Raises:
        ValueError: numbers that are no moment.
    """
    if not text.isascii():
        text = _HALVES.sub(lambda match: "AM" if match[1] else "PM", text.translate(_CHARACTERS)).strip(": ")
    text, zone = _without_zone(" ".join(text.replace(" @ ", " ").split()))  # as Kibana writes it
    text = _with_number_of_month(text)
    if match := _DIGITS.fullmatch(text):
        year, month, day, hour, minute, second, more = match.groups()
        text = f"{year}-{month}-{day}T{hour}:{minute}:{second or '00'}.{more or '0':0<6}"
    elif match := _DAY_FIRST.fullmatch(text):
        day, _, month, year, clock = match.groups()
        text = f"{year if len(year) == 4 else f'20{year}'}-{month:0>2}-{day:0>2}T{_clock(clock or '00:00')}"
    elif match := _ORDINAL.fullmatch(text):
        day_in_year = date(int(match[1]), 1, 1) + timedelta(days=int(match[2]) - 1)
        text = f"{day_in_year}T{_clock(match[3])}"
    elif match := _YEAR_FIRST.fullmatch(text):
        year, month, day, clock = match.groups()
        text = f"{year}-{month:0>2}-{day:0>2}T{_clock(clock or '00:00')}"
    elif _CLOCK.fullmatch(text := _clock(text)):
        text = f"1970-01-01T{text}"
    elif not text[:4].isdigit() or text.isdigit() or len(text) < 8:
        return None
    moment = datetime.fromisoformat(text)
    return moment if zone is None else moment.replace(tzinfo=zone)


def within_hours(cells: Iterable[str]) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.bool_]]:
    """Return minutes and seconds of stamps [µs], and which differ in more than these from the one before, shapes (n,).

    A stamp of another form than the one before differs, too; where the minutes cannot be told by their place, all do.
    """
    rest = iter(cells)
    parts = iter(lambda: list(islice(rest, _AT_ONCE)), [])
    within_us, differs = zip(*map(_within_hour, parts), strict=True)
    return np.concatenate(within_us), np.concatenate(differs)


def _within_hour(cells: Sequence[str]) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.bool_]]:
    place, differs = _MINUTES.search(cells[0]), np.ones(len(cells), dtype=np.bool_)
    if place is None or max(map(len, cells)) > _LONGEST:
        return np.zeros(len(cells), dtype=np.int64), differs
    begin, end = place.span(1)
    letters = np.array(cells).view(np.uint32).reshape(len(cells), -1).astype(np.int64)
    low, high, size_us = _DIGITS_WITHIN[:, :end - begin]
    earliest, latest = (stamp("".join([cells[0][:begin], *map(chr, ends), cells[0][end:]])) for ends in (low, high))
    if earliest is None or latest is None or latest - earliest != timedelta(microseconds=int((high - low) @ size_us)):
        return np.zeros(len(cells), dtype=np.int64), differs
    digits, others = letters[:, begin:end], np.delete(letters, slice(begin, end), axis=1)
    usual = np.all((low <= digits) & (digits <= high), axis=1)
    differs[1:] = ~usual[1:] | ~usual[:-1] | np.any(others[1:] != others[:-1], axis=1)
    return (digits - low) @ size_us, differs


#: the least and the greatest character at each place of minutes and seconds, and how long its digit lasts [µs]
_DIGITS_WITHIN: Final = np.array([[*map(ord, "00:00.000000")], [*map(ord, "59:59.999999")],
    [600_000_000, 60_000_000, 0, 10_000_000, 1_000_000, 0, *(10**k for k in range(5, -1, -1))]])
_AT_ONCE: Final = 4096
_LONGEST: Final = 60  # characters
_MINUTES: Final = re.compile(r"\d:(\d\d:\d\d(?:\.\d{1,6})?)(?!\d)")


def has_zone(cell: str) -> bool:
    """Return whether a cell is a time stamp with its time zone."""
    moment = stamp(cell)
    return moment is not None and moment.tzinfo is not None


def _without_zone(text: str) -> tuple[str, timezone | None]:
    """Return a text without the name of its time zone, and the zone."""
    text = _PLACE.sub("", text)
    match = _ZONE.search(text)
    if match is None or match[1] not in _ZONES:
        return text, None
    return text[:match.start()].rstrip(), timezone(timedelta(hours=_ZONES[match[1]]))


def _with_number_of_month(text: str) -> str:
    """Return a date with the name of its month, 14-Mar-2026 or Mar 14, 2026, as ISO 8601 has it."""
    if match := _DAY_AND_MONTH.fullmatch(text):
        day, name, year, clock = match.groups()
    elif match := _MONTH_AND_DAY.fullmatch(text):
        name, day, year, clock = match.groups()
    elif match := _YEAR_LAST.fullmatch(text):
        name, day, clock, zone, year = match.groups()
        return _without_zone(f"{year or _YEAR_UNKNOWN}-{_month(name):02d}-{day:0>2} {clock}{zone or ''}")[0]
    else:
        return text
    return f"{year if len(year) == 4 else f'20{year}'}-{_month(name):02d}-{day:0>2} {clock}".strip()


def _month(name: str) -> int:
    """Return the number of a month.

    Raises:
        ValueError: it is none.
    """
    for number, beginnings in enumerate(_MONTHS, start=1):
        if name.lower().startswith(beginnings):
            return number
    raise ValueError(name)


def _clock(text: str) -> str:
    """Return a time of day as ISO 8601 has it."""
    text = _DOTTED_CLOCK.sub(r"\1:\2:\3", text, count=1)
    text = _NOON_BEFORE.sub(r"\2 \1", text)
    if noon := _NOON.fullmatch(text):
        hour, rest, half = noon.groups()
        text = f"{int(hour) % 12 + 12 * (half in 'pP')}{rest}"
    text = _THOUSANDTHS.sub(r"\1.\2", text)
    text = re.sub(r" (?=[+-]\d)", "", text)  # before an offset
    return f"0{text}" if text[1:2] == ":" else text


_CLOCK_LENGTH = re.compile(r"(?:(-?\d+)(?: ?d(?:ays?)?,? ?|\.(?=\d\d:)))?(\d{1,5}):([0-5]?\d):([0-5]?\d(?:[.,]\d+)?)")
_WORDED_LENGTH = re.compile(r"(?:P?(?:(\d+) ?d(?:ays?)? ?,? ?T?|T))?(?:(\d+) ?h(?:ours?|rs?|)? ?,? ?)?"
    r"(?:(\d+) ?(?:m(?:in(?:ute)?s?)?|') ?,? ?)?(?:(\d+(?:[.,]\d+)?) ?(?:s(?:ec(?:ond)?s?)?|\"|''))?", re.IGNORECASE)


def duration_s(cell: str) -> float | None:
    """Return the length of time in a cell [s]: 25:10:00, 0 days 00:00:02, 0.00:00:02, 5m 3s, PT1H2M3S; None: none."""
    text = cell.strip()
    match = _CLOCK_LENGTH.fullmatch(text) or _WORDED_LENGTH.fullmatch(text)
    if match is None or not any(match.groups()):
        return None
    days, hours, minutes, seconds = (float((part or "0").replace(",", ".")) for part in match.groups())
    return 86400.0 * days + 3600.0 * hours + 60.0 * minutes + seconds


def durations_s(cells: CellColumn) -> Array | None:
    """Return durations [s], shape (n,): 0 days 00:00:02, 5m 3s, 25:10:00; None of other cells, and of times of day."""
    if duration_s(cells[0]) is None or duration_s(cells[-1]) is None:
        return None
    if is_clock(cells[0]) and all(cell.partition(":")[0].strip() in _HOURS_OF_DAY for cell in cells):
        return None
    values = cells.numbers(lambda cell: np.nan if (length := duration_s(cell)) is None else length)
    return None if np.isnan(values).any() else values


_HOURS_OF_DAY: Final = frozenset([*map(str, range(24)), *(f"0{hour}" for hour in range(10))])


def is_date_in_digits(cell: str) -> bool:
    """Return whether a number can only be a date and a time of day, 20260314095800: no epoch has as many digits."""
    return len(cell) in (12, 14, 17) and _DIGITS.fullmatch(cell) is not None and stamp(cell) is not None


def clocks_in_digits(values: Array) -> Array | None:
    """Return times of day [s] in whole numbers, 95958 and 100000 for 9:59:58 and 10:00:00, shape (n,); None: none.

    They pass a minute at least, and are evenly spaced only as such.
    """
    if len(values) < _FEWEST_CLOCKS or np.any(values % 1.0) or not 0.0 <= values.min() <= values.max() < _END_OF_DAY:
        return None
    hours, minutes, seconds = values // 10000, values // 100 % 100, values % 100
    elapsed_s = 3600.0 * hours + 60.0 * minutes + seconds
    uneven_s, uneven = np.ptp(np.percentile(np.diff([elapsed_s, values]), [1.0, 99.0], axis=1), axis=0)
    return elapsed_s if max(minutes.max(), seconds.max()) < _SIXTY and uneven_s == 0.0 < uneven else None


_FEWEST_CLOCKS: Final = 20
_END_OF_DAY: Final = 240000.0
_SIXTY: Final = 60.0


def is_clock(cell: str) -> bool:
    """Return whether a cell is a time of day without a date."""
    return _CLOCK.fullmatch(cell) is not None


def unlike_part(moment: datetime, first: datetime, text: str, first_text: str) -> str:
    """Return what one of two stamps has and the other has not, empty if they are alike."""
    if moment.date() != first.date() and is_clock(text) != is_clock(first_text):
        return "date"
    return "" if (moment.tzinfo is None) == (first.tzinfo is None) else "time zone"


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


def _is_day_or_year(cells: Iterable[str]) -> bool:
    """Return whether the dates may begin with a year of two digits, such as 26/03/14 and 26/03/15."""
    dates = {match.group(): match.group(3) for match in map(_SLASHED.match, cells) if match}
    return len(dates) > 1 and all(len(last) == 2 for last in dates.values())


def _month_or_day_first(cells: Sequence[str]) -> str:
    """Return "month", "day" or "year" if only with it first dates such as 03/04/2026 follow each other, else "".

    Of a log with a row or two for each date, which may be one of a month, nothing is inferred.
    """
    dates = list(dict.fromkeys(match.groups() for cell in cells if (match := _SLASHED.match(cell)) is not None))
    if len(cells) < _ROWS_OF_DATE * len(dates):
        return ""
    longest = {}
    for order, year, month, day in (("month", 2, 0, 1), ("day", 2, 1, 0), ("year", 0, 1, 2)):
        try:
            days = [date(int(match[year]) % 100 + 2000, int(match[month]), int(match[day])).toordinal()
                    for match in dates]
        except ValueError:
            continue
        longest[order] = max(abs(after - before) for before, after in pairwise(days))
    order, *others = sorted(longest, key=lambda first: longest[first]) or [""]
    return order if order and longest[order] <= _DAY_BY_DAY and (
        not others or longest[others[0]] > _MONTH_BY_MONTH) else ""


_ROWS_OF_DATE: Final = 4
_DAY_BY_DAY: Final = 7  # days
_MONTH_BY_MONTH: Final = 20


def order_of_dates(cells: Sequence[str]) -> tuple[str, str]:
    """Return "month", "day" or "year" if dates that may be read otherwise begin with it, else ""; and why."""
    dates = dict.fromkeys(cell[:11] for cell in cells)  # the characters that `_SLASHED` looks at
    if month_first(dates):
        return "month", ""
    is_open = is_day_or_month(dates)
    order = _month_or_day_first(cells) if is_open or _is_day_or_year(dates) else ""
    if order and (is_open or order == "year"):
        return order, ": so they follow each other day by day"
    return "", NO_ORDER if is_open else ""


#: the reason of `order_of_dates` where day and month may be meant
NO_ORDER: Final = "?"


def day_first(cell: str, order: str) -> str:
    """Return a cell whose date begins with the month or the year, 26/03/14, with the day first, or the year as 2026."""
    if order == "month":
        return month_first((cell,), turn=True) or cell
    return f"20{cell}" if order == "year" and _SLASHED.match(cell) else cell


def month_first(cells: Iterable[str], *, turn: bool = False) -> str:
    """Return the first date that can only be month first, day first then; with `turn` every slashed date is turned."""
    for cell in cells:
        match = _SLASHED.match(cell)
        if match and (turn or int(match[2]) > 12):
            return f"{match[2]}/{match[1]}/{match[3]}{cell[match.end():]}"
    return ""


_HOUR: Final = 3600.0
_DAY: Final = 86400.0


def past_midnight(time: Array, repairs: list[str]) -> Array:
    """Return times of day that go on after midnight, shape (n,) [s]; the repairs say so."""
    return _past_end(time, _DAY, "time of day passes midnight", "a day", repairs)


def past_hour(time: Array, repairs: list[str]) -> Array:
    """Return minutes and seconds that go on after the full hour, shape (n,) [s]: of a spreadsheet's times of day."""
    return time if np.any(time >= _HOUR) else _past_end(time, _HOUR, "time passes the full hour", "an hour", repairs)


def _past_end(time: Array, whole_s: float, passes: str, period: str, repairs: list[str]) -> Array:
    """Return the times of a clock that begins again after so many seconds."""
    turns = np.flatnonzero(np.diff(time) < -whole_s / 2.0) + 1
    if not len(turns):
        return time
    repairs.append(f"The {passes} {len(turns)} times; {period} was added at each." if len(turns) > 1
                   else f"The {passes}; {period} was added there.")
    time = time.copy()
    for row in turns:
        time[row:] += whole_s
    return time


def likely_time_unit(time: Array) -> str:
    """Return the likeliest unit of a time without one, judged by its interval if it were in seconds, shape (n,) [s].

    Loggers write every so many seconds or minutes: 1000 s are milliseconds, and a sixtieth of a second is a minute's.
    """
    usual = float(time[-1] - time[0]) / max(len(time) - 1, 1)
    if usual > LONGEST_STEP_S / 10.0 and abs(usual / 60.0 - round(usual / 60.0)) > _UNEVEN:
        return "ms"
    if usual >= 1.0 or _is_whole(usual * 1e3):
        return "s"
    return next((unit for unit in ("min", "h", "d") if _is_whole(usual * TIME_UNITS[unit])), "s")


def _is_whole(value: float) -> bool:
    return value > 0.5 and abs(value - round(value)) <= _UNEVEN
