"""Time stamps → seconds."""

from __future__ import annotations

import re
from collections.abc import Iterable
from datetime import datetime
from typing import Final

__all__ = ["STAMPS", "is_clock", "is_date", "is_day_or_month", "is_hours_or_minutes", "month_first", "stamp"]

#: what `stamp` understands, as told to people
STAMPS: Final = "2026-03-01 10:00:00 (ISO 8601), 01.03.2026 10:00:00 or 10:00:00"

_DAY_FIRST = re.compile(r"(\d{1,2})[./](\d{1,2})[./](\d{4}|\d\d)(?:,?[ T]+(.+))?")
_CLOCK = re.compile(r"\d{1,2}:\d\d(:\d\d([.,:]\d+)?)?( ?[AaPp]\.?[Mm]\.?)?")
_NOON = re.compile(r"(\d{1,2})(:\d\d.*?) ?([AaPp])\.?[Mm]\.?")
_DATE = re.compile(r"\d{4}[-/]\d\d?[-/]\d\d?|\d\d?[./]\d\d?[./](\d{4}|\d\d)")
_SLASHED = re.compile(r"(\d{1,2})/(\d{1,2})/(\d{4}|\d\d)(?!\d)")
_THOUSANDTHS = re.compile(r"(:\d\d:\d\d):(\d{1,3})$")


def stamp(cell: str) -> datetime | None:
    """Return the moment a cell tells, with its time zone where it tells one; None where it is no moment.

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
    """Return whether a cell, the first of its column, may be 0 h 05 min or 0 min 05 s."""
    return re.fullmatch(r"0?0:\d\d", cell) is not None


def is_date(cell: str) -> bool:
    """Return whether a cell is a date without a time of day."""
    return _DATE.fullmatch(cell) is not None


def is_day_or_month(cells: Iterable[str]) -> bool:
    """Return whether the dates differ and may be days in March or in April: 03/04/2026 and 03/05/2026."""
    dates = {match.group(): match.group(1) for match in map(_SLASHED.match, cells) if match}
    return len(dates) > 1 and all(int(first) <= 12 for first in dates.values())


def month_first(cells: Iterable[str], *, turn: bool = False) -> str:
    """Return the first date that can only be month first, day first then; with `turn` every slashed date is turned."""
    for cell in cells:
        match = _SLASHED.match(cell)
        if match and (turn or int(match[2]) > 12):
            return f"{match[2]}/{match[1]}/{match[3]}{cell[match.end():]}"
    return ""
