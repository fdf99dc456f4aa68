"""Exports of laboratories and plants that are more than a table below names: LabVIEW, Ignition, traces."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Final

from heatertune.errors import LogError
from heatertune.log.formats.format_table import FormatTable, Line, TextFormat
from heatertune.log.quantities import role_of
from heatertune.units import count

__all__ = ["PLANT_EXPORTS"]


_END_OF_HEADER: Final = "***End_of_Header***"


def _labview(path: Path, numbered: Sequence[Line], _: str | None) -> FormatTable:
    """Return the segments of a .lvm file: each follows the second end of a header and names its columns."""
    separator = "," if any(line.startswith("Separator,Comma") for _, line in numbered[:30]) else "\t"
    decimal = next((line.split(separator)[1] for _, line in numbered[:30] if line.startswith("Decimal_Separator")), ".")
    names: list[str] = []
    units: list[str] = []
    rows, lines, begins, in_header = [], [], [], True
    for number, line in numbered:
        cells = [cell.strip() for cell in line.split(separator)]
        if cells[0] == "Y_Unit_Label":
            units = cells[1:]
        if cells[0] in ("X_Value", "") and any(cell == "Comment" for cell in cells):
            names, in_header = cells[:cells.index("Comment")], False
            begins.append(number)
        elif cells[0] in ("LabVIEW Measurement", "Channels"):
            in_header = True
        elif not in_header and names and len(cells) >= len(names):
            rows.append([cell.replace(decimal, ".") for cell in cells[:len(names)]])
            lines.append(number)
    if not rows:
        raise LogError("no segment with X_Value and readings", file=path,
                       expected="a measurement file of LabVIEW with one X column")
    units = ["", *units, *[""] * len(names)]
    header = ["time [s]" if name == "X_Value" else f"{name} [{units[k]}]" if units[k] else name
              for k, name in enumerate(names)]
    return FormatTable(tuple(header), rows, lines, [f"Measurement of LabVIEW: {count(len(begins), 'segment')} read."])


def _ignition(_: Path, numbered: Sequence[Line], __: str | None) -> FormatTable:
    """Return the data set of Ignition: #NAMES, #TYPES and #ROWS stand above the rows."""
    cells = [(number, row) for number, line in numbered for row in csv.reader([line.replace("\0", "")])]
    names = next(row for (_, before), (_, row) in pairwise(cells) if before[0] == "#NAMES")
    rows = next(k for k, (_, row) in enumerate(cells) if row[0] == "#ROWS") + 1
    kept = [(number, row) for number, row in cells[rows:] if len(row) == len(names)]
    return FormatTable(tuple(names), [row for _, row in kept], [number for number, _ in kept],
                       [f"Data set of Ignition: {count(len(kept), 'row')} read."])


def _codesys(_: Path, numbered: Sequence[Line], __: str | None) -> FormatTable:
    """Return a trace that CODESYS saves as text: the time in milliseconds, then the variables of the third line."""
    names = numbered[2][1].split()
    kept = [(number, cells) for number, line in numbered[3:] if len(cells := line.split()) == len(names)]
    return FormatTable(("time [ms]", *names[1:]), [cells for _, cells in kept], [number for number, _ in kept],
                       [f"Trace of CODESYS: {count(len(kept), 'row')} read, their first column as milliseconds."])


def _paired(_: Path, numbered: Sequence[Line], __: str | None) -> FormatTable:
    """Return a table in which each variable has a column of times of its own as a long table."""
    separator = _pair_separator(numbered[0][1])
    head = [cell.strip('" ') for cell in numbered[0][1].split(separator)]
    rows, lines = [], []
    for number, line in numbered[1:]:
        cells = [cell.strip('" ') for cell in line.split(separator)]
        for k in range(0, min(len(cells), len(head)) - 1, 2):
            if cells[k] and cells[k + 1]:
                rows.append([cells[k], head[k + 1], cells[k + 1]])
                lines.append(number)
    order = sorted(range(len(rows)), key=lambda k: lines[k])
    return FormatTable((head[0], "tag", "value"), [rows[k] for k in order], [lines[k] for k in order],
                       [f"Each of {count(len(head) // 2, 'variable')} was read with its own column of times."])


def _pair_separator(line: str) -> str:
    return next((mark for mark in ("\t", ";", ",") if mark in line), ",")


def _has_pairs(lines: Sequence[Line]) -> bool:
    """Return whether the first line names a time before each variable."""
    if not lines:
        return False
    head = [cell.strip('" ') for cell in lines[0][1].split(_pair_separator(lines[0][1]))]
    times = head[::2]
    return len(times) > 1 and len(head) == 2 * len(times) and len(set(times)) == 1 and role_of(times[0]) == "time" and (
        "time" not in map(role_of, head[1::2]))


def _within(lines: Sequence[Line], pattern: str) -> bool:
    return any(re.match(pattern, line) for _, line in lines)


PLANT_EXPORTS: Final = (
    TextFormat("measurement of LabVIEW", lambda lines: _within(lines[:60], re.escape(_END_OF_HEADER)), _labview),
    TextFormat("data set of Ignition", lambda lines: _within(lines[:5], '"?#NAMES"?'), _ignition),
    TextFormat("trace of CODESYS", lambda lines: len(lines) > 3 and lines[0][1].strip() == "CoDeSys Trace", _codesys),
    TextFormat("table with a time for each variable", _has_pairs, _paired),
)
