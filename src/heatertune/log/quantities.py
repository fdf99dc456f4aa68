"""Cells that are more than a number: with a unit, with a decimal comma, on or off, or with nothing in them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final

__all__ = ["NOTHING", "is_number", "is_quantity", "on_or_off", "plain_quantities", "says_nothing"]

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
    """Return 1 and 0 for cells that are on or off (true, yes, ein …), None where one is neither."""
    digits = {cell: "1" if cell.lower() in _ON else "0" for cell in set(cells) if cell.lower() in _ON | _OFF}
    try:
        return [digits[cell] for cell in cells]
    except KeyError:
        return None


def plain_quantities(cells: Sequence[str]) -> tuple[list[str], str, bool] | None:
    """Return cells as plain numbers, the unit they all have, and whether they had decimal commas; None: nothing to do.

    A column that holds commas and points is left: one of them may group thousands; so is one with two units.
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
    """Return whether no cell can have a decimal comma or a unit: one with a unit stands in a column where all have."""
    first = next((cell for cell in cells if not says_nothing(cell)), "")
    return not is_quantity(first) and not any("," in cell for cell in cells)


def _without_unit(kinds: set[str]) -> tuple[str, dict[str, str]]:
    """Return the unit of all cells that hold something, and each one's figure; no unit where they are not all alike."""
    matches = {cell: _QUANTITY.fullmatch(cell) for cell in kinds if not says_nothing(cell)}
    units = {"" if match is None else match[2].strip() for match in matches.values()}
    if len(units) != 1 or units == {""}:
        return "", {}
    return units.pop(), {cell: match[1] for cell, match in matches.items() if match is not None}
