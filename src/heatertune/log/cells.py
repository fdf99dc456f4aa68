"""A text file → rows of cells, each with the number of its line."""

from __future__ import annotations

import codecs
import csv
import re
from dataclasses import dataclass
from pathlib import Path

from heatertune.errors import LogError

__all__ = ["Sheet", "is_number", "read_sheet"]

_NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eE][+-]?\d+)?|[+-]?(nan|inf|infinity)", re.IGNORECASE)
_DECIMAL_COMMA = re.compile(r"\s*[+-]?\d*,\d+([eE][+-]?\d+)?\s*")
_UTF16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_SAMPLE = 50  # lines looked at to find the separator


@dataclass(frozen=True, slots=True, kw_only=True)
class Sheet:
    """Cells of one file.

    Attributes:
        file: its path.
        header: column names with their units, empty where the file has none.
        rows: cells, decimal points restored, all of one length.
        lines: line number of each row, 1 = first line of the file.
        repairs: what was changed or passed over, one sentence each.
    """

    file: str
    header: tuple[str, ...]
    rows: list[list[str]]
    lines: list[int]
    repairs: tuple[str, ...]


def is_number(cell: str) -> bool:
    """Return whether a cell is a number, decimal comma or point."""
    return _NUMBER.fullmatch(cell.strip()) is not None


def read_sheet(path: Path) -> Sheet:
    """Return the cells of a CSV file.

    Raises:
        LogError: the file cannot be read, is empty, is no text, or a row has another number of cells than the first.
    """
    text, repairs = _text(path)
    numbered = [(i, line) for i, line in enumerate(text.splitlines(), start=1)]
    kept = [(i, line) for i, line in numbered if line.strip() and not line.lstrip().startswith("#")]
    if not kept:
        raise LogError("the file is empty", file=path, expected="rows of time and temperature")
    if len(kept) < len(numbered):
        repairs.append(f"{len(numbered) - len(kept)} blank or comment lines were passed over.")
    lines, rows = [i for i, _ in kept], _split([line for _, line in kept])
    rows = _without_empty_columns(rows, repairs)
    _demand_one_width(path, lines, rows)
    header = _take_header(lines, rows)
    if any(_DECIMAL_COMMA.fullmatch(cell) for row in rows[:_SAMPLE] for cell in row):
        rows = [[cell.replace(",", ".") for cell in row] for row in rows]
        repairs.append("Decimal commas were read as points.")
    return Sheet(file=str(path), header=header, rows=rows, lines=lines, repairs=tuple(repairs))


def _text(path: Path) -> tuple[str, list[str]]:
    try:
        data = path.read_bytes()
    except OSError as problem:
        raise LogError(f"cannot be read: {problem.strerror}", file=path) from problem
    if data.startswith(_UTF16):
        return _decoded(path, data, "utf-16"), ["The file is UTF-16."]
    if b"\0" in data:
        raise LogError("the file is binary", file=path, expected="a text file with one row per reading")
    try:
        return data.decode("utf-8-sig"), []
    except UnicodeDecodeError:
        return data.decode("latin-1"), ["The file is not UTF-8 and was read as Latin-1."]


def _decoded(path: Path, data: bytes, encoding: str) -> str:
    try:
        return data.decode(encoding)
    except UnicodeDecodeError as problem:
        raise LogError(f"the file is no {encoding} text", file=path) from problem


def _split(lines: list[str]) -> list[list[str]]:
    separator = _separator(lines[:_SAMPLE])
    if separator is None:
        return [line.split() for line in lines]
    return [[cell.strip() for cell in row] for row in csv.reader(lines, delimiter=separator, skipinitialspace=True)]


def _separator(lines: list[str]) -> str | None:
    """Return the separator that all looked-at lines hold; None: white space, or a single column."""
    for candidate in ("\t", ";", ","):
        if all(candidate in line for line in lines):
            return candidate
    return None


def _without_empty_columns(rows: list[list[str]], repairs: list[str]) -> list[list[str]]:
    width = len(rows[0])
    while width > 1 and all(len(row) >= width and not any(row[width - 1 :]) for row in rows):
        width -= 1
    if width < len(rows[0]):
        repairs.append(f"{len(rows[0]) - width} empty columns at the end were passed over.")
        return [row[:width] for row in rows]
    return rows


def _demand_one_width(path: Path, lines: list[int], rows: list[list[str]]) -> None:
    width = len(rows[0])
    for line, row in zip(lines, rows, strict=True):
        if len(row) != width:
            expected = f"{width} as in the first row"
            raise LogError(f"{len(row)} cells in this row", file=path, line=line, expected=expected)


def _take_header(lines: list[int], rows: list[list[str]]) -> tuple[str, ...]:
    """Remove the header (and a row of units below it) from the rows and return it."""
    if any(is_number(cell) for cell in rows[0]):
        return ()
    names = rows.pop(0)
    lines.pop(0)
    if rows and not any(character.isdigit() for cell in rows[0] for character in cell):
        units = rows.pop(0)
        lines.pop(0)
        names = [f"{name} [{unit.strip('[]() ')}]" if unit else name for name, unit in zip(names, units, strict=True)]
    return tuple(names)
