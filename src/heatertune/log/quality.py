"""The quality flag of a historian or a panel → which rows are good."""

from __future__ import annotations

import re
from typing import Final

import numpy as np
import numpy.typing as npt

from heatertune.errors import LogError
from heatertune.log.cells import Sheet
from heatertune.log.names import plain_name

__all__ = ["good_rows", "is_quality"]

_QUALITY: Final = re.compile(
    r"((opc ?)?quality( ?code)?|qual|valid(ity)?|status ?code|good|qualit(ä|ae?)t|g(ü|ue)ltig(keit)?)", re.IGNORECASE)
_STATUS_CODE: Final = re.compile(r"status ?code", re.IGNORECASE)
_VALID: Final = re.compile(r"valid(ity)?|good|g(ü|ue)ltig(keit)?", re.IGNORECASE)
_WORDS: Final = re.compile(r"(good|gut|ok|valid|gültig|true|wahr|yes|ja)\b.*", re.IGNORECASE)
_BAD_WORDS: Final = re.compile(
    r"(bad|uncertain|questionable|substitut|invalid|not ?good|error|false|falsch|no\b|nein|schlecht|ungültig|unsicher"
    r"|unknown|unavailable|fail|stale|offline|comm).*", re.IGNORECASE)
_OPC_GOOD: Final = 192  # OPC DA: the two high bits of the byte, 0xC0; 216 is a local override, good too


def is_quality(name: str) -> bool:
    """Return whether a column's name tells a quality flag."""
    return _QUALITY.fullmatch(plain_name(name)) is not None


def good_rows(sheet: Sheet, i: int) -> npt.NDArray[np.bool_]:
    """Return which rows a column flags as good, shape (n,).

    Good are 192 to 255 of OPC DA (0xC0), 0 of an OPC UA status code, 1 of a validity (a WinCC panel writes 0 for a lost
    connection and 2 where it stops), and words such as Good.

    Raises:
        LogError: flags whose meaning is not known.
    """
    cells = [row[i] for row in sheet.rows]
    kinds = set(cells)
    meaning = _by_words(kinds) or _by_numbers(kinds, sheet.header[i] if sheet.header else "")
    if meaning is None:
        shown = ", ".join(sorted(kinds)[:6]) or "empty"
        raise LogError(f"quality flags whose meaning is not known ({shown})", file=sheet.file,
                       column=sheet.header[i] if sheet.header else f"{i + 1}",
                       expected="192 or Good, 1 of a validity, or --quality-column none to read all rows")
    return np.array([meaning[cell] for cell in cells], dtype=np.bool_)


def _by_words(kinds: set[str]) -> dict[str, bool] | None:
    good = {cell for cell in kinds if _WORDS.fullmatch(cell)}
    return {cell: cell in good for cell in kinds} if all(
        cell in good or _BAD_WORDS.fullmatch(cell) for cell in kinds) else None


def _by_numbers(kinds: set[str], name: str) -> dict[str, bool] | None:
    try:
        codes = {cell: int(float(cell)) if "x" not in cell.lower() else int(cell, 16) for cell in kinds}
    except (ValueError, OverflowError):
        return None
    numbers = set(codes.values())
    if _STATUS_CODE.fullmatch(plain_name(name)) and 0 in numbers:
        return {cell: code == 0 for cell, code in codes.items()}
    if numbers <= {0, 1, 2} and _VALID.fullmatch(plain_name(name)):
        return {cell: code == 1 for cell, code in codes.items()}
    if all(0 <= code <= 255 for code in numbers) and max(numbers) >= _OPC_GOOD:
        return {cell: code >= _OPC_GOOD for cell, code in codes.items()}
    return None
