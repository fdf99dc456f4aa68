"""Time stamps → seconds."""

from __future__ import annotations

import re
from collections.abc import Iterable
from datetime import datetime
from typing import Final

__all__ = ["STAMPS", "is_day_or_month", "stamp"]

#: what `stamp` understands, as told to people
STAMPS: Final = "2026-03-01 10:00:00 (ISO 8601), 01.03.2026 10:00:00 or 10:00:00"

_DAY_FIRST = re.compile(r"(\d{1,2})[./](\d{1,2})[./](\d{4})[ T](.+)")
_CLOCK = re.compile(r"\d{1,2}:\d\d(:\d\d([.,]\d+)?)?")
_SLASHED = re.compile(r"(\d{1,2})/\d{1,2}/\d{4}")


def stamp(cell: str) -> datetime | None:
    """Return the moment a cell tells, with its time zone where it tells one; None where it is no moment.

    ISO 8601, also with a space or slashes in the date; day.month.year; a time of day alone.
    """
    text = cell.strip()
    found = _DAY_FIRST.fullmatch(text)
    if found:
        day, month, year, text = found.groups()
        text = f"{year}-{month:0>2}-{day:0>2}T{_two_digits(text)}"
    elif _CLOCK.fullmatch(text):
        text = f"1970-01-01T{_two_digits(text)}"
    try:
        return datetime.fromisoformat(text.replace("/", "-"))
    except ValueError:
        return None


def is_day_or_month(cells: Iterable[str]) -> bool:
    """Return whether the dates differ and may be days in March or in April: 03/04/2026 and 03/05/2026."""
    dates = {found.group(): found.group(1) for found in map(_SLASHED.match, cells) if found}
    return len(dates) > 1 and all(int(first) <= 12 for first in dates.values())


def _two_digits(clock: str) -> str:
    return f"0{clock}" if clock[1:2] == ":" else clock
