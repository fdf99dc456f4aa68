"""A text file → rows of cells, each with the number of its line."""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from heatertune.errors import LogError
from heatertune.files import read_bytes
from heatertune.log.header import take_header
from heatertune.log.klippy import PrinterTable, printer_table
from heatertune.log.quantities import is_number, plain_quantities
from heatertune.log.recorder_log import MARK, pwm_period_of, without_torn
from heatertune.units import count

__all__ = ["Sheet", "is_number", "plain_cells", "read_sheet"]

_CONTROL = re.compile(r"[\x00-\x08\x0e-\x1f\x7f]")
_BEFORE_CLOCK = re.compile(r"(?<=\d) (?=\d{1,2}:\d\d)")
_UTF16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_SAMPLE = 50  # lines looked at to find the separator


@dataclass(frozen=True, slots=True, kw_only=True)
class Sheet:
    """Cells of one file.

    Attributes:
        file: its path.
        header: column names with their units, empty where the file has none.
        comment: cells of the comment right above the readings, one for each column, else empty.
        rows: cells, all of one length.
        lines: line number of each row, 1 = first line of the file.
        repairs: what was changed or passed over, one sentence each.
        units: unit that all cells of a column bear, one for each column, else empty.
        above: lines above the names of the columns, or above the readings where they have none.
        pwm_period_s: of the switch, as a recording tells it, 0 where nothing does [s].
        recorded: whether `heatertune record` wrote it, whose rows are readings, changed or not.
    """

    file: str
    header: tuple[str, ...]
    comment: tuple[str, ...]
    rows: list[list[str]]
    lines: list[int]
    repairs: tuple[str, ...]
    units: tuple[str, ...] = ()
    above: int = 0
    pwm_period_s: float = 0.0
    recorded: bool = False

    def picked(self, places: Sequence[int]) -> Sheet:
        """Return some of the rows, in the order given."""
        return replace(self, rows=[self.rows[k] for k in places], lines=[self.lines[k] for k in places])


def read_sheet(path: Path, content: bytes | None = None, skip_rows: int = 0, tag: str | None = None) -> Sheet:
    """Return the cells of a CSV file, or of a printer's log; with `content`, the path only names it.

    `tag` is the heater of a printer's log, see `heatertune.log.klippy.printer_table`.

    Raises:
        LogError: the file cannot be read, is empty, is no text, or a row has another number of cells than the others.
    """
    text, repairs = _text(path, content)
    period_s, recorded = 0.0, text.startswith(MARK)
    if recorded:
        period_s = pwm_period_of(text)
        text = without_torn(text, repairs)
    numbered, passed = _written_lines(text, skip_rows)
    log = printer_table(path, numbered, tag)
    if log is not None:
        _demand_cells(path, log)
        return Sheet(file=str(path), header=log.header, comment=(), rows=log.rows, lines=log.lines,
                     repairs=(*repairs, *log.repairs))
    kept = [(i, line) for i, line in numbered if line.strip(" \t,;") and not line.lstrip().startswith("#")]
    if kept and kept[0][1].strip('" ').lower() in ("sep=;", "sep=,", "sep=\t", "sep=|"):  # written by spreadsheets
        del kept[0]
    if not kept:
        raise LogError("the file is empty", file=path, expected="rows of time and temperature")
    if passed := passed + len(numbered) - len(kept):
        repairs.append(f"{count(passed, 'line')} without readings (blank, comment) skipped.")
    lines, texts = [i for i, _ in kept], [line for _, line in kept]
    separator = _separator(texts[-_SAMPLE:])
    rows = _without_empty_ends([row or [""] for row in _split(path, lines, texts, separator)], repairs)
    begin = lines[0]
    header, above = take_header(path, lines, rows, repairs)
    comment: tuple[str, ...] = ()
    if rows and not header:
        comment = _comment_above([pair for pair in numbered if pair[0] < begin], separator, len(rows[0]))
    return Sheet(file=str(path), header=header, comment=comment, rows=rows, lines=lines, repairs=tuple(repairs),
                 above=above, pwm_period_s=period_s, recorded=recorded)


def _written_lines(text: str, skip_rows: int) -> tuple[list[tuple[int, str]], int]:
    """Return number and content of the lines to look at, and how many are not: megabytes of those take no memory.

    Blank lines are not looked at, and of comments in a row only the last, which may name the columns.
    """
    numbered: list[tuple[int, str]] = []
    passed, after_comment = 0, False
    for number, line in enumerate(io.StringIO(text, newline=None), start=1):
        if number <= skip_rows:
            continue
        is_comment, is_blank = line.startswith("#"), not line.strip(" \t,;\n")
        if is_blank or (is_comment and after_comment):
            passed += 1
        if is_blank:
            continue
        if is_comment and after_comment:
            numbered.pop()
        numbered.append((number, line.rstrip("\n")))
        after_comment = is_comment
    return numbered, passed


def _demand_cells(path: Path, log: PrinterTable) -> None:
    for line, row in zip(log.lines, log.rows, strict=True):
        if len(row) != len(log.header):
            raise LogError(f"{count(len(row), 'cell')} in this row", file=path, line=line,
                           expected=f"{len(log.header)}: {', '.join(log.header)}")


def _text(path: Path, content: bytes | None) -> tuple[str, list[str]]:
    try:
        data = read_bytes(path) if content is None else content
    except OSError as problem:
        raise LogError(f"cannot be read: {problem.strerror}", file=path) from problem
    text, repairs = _decoded(path, data)
    if _CONTROL.search(text):
        expected = "a text file with one row per reading (UTF-8, Latin-1, or UTF-16 with its byte order mark)"
        raise LogError("the file is binary", file=path, expected=expected)
    return text, repairs


def _decoded(path: Path, data: bytes) -> tuple[str, list[str]]:
    if data.startswith(_UTF16):
        try:
            return data.decode("utf-16"), ["The file is UTF-16."]
        except UnicodeDecodeError as problem:
            raise LogError("the file is not valid UTF-16 text", file=path) from problem
    try:
        return data.decode("utf-8-sig"), []
    except UnicodeDecodeError:
        return data.decode("latin-1"), ["The file is not UTF-8 and was read as Latin-1."]


def _separator(lines: Sequence[str]) -> str | None:
    """Return the separator that nearly all lines hold; None: white space, or a single column."""
    for candidate in ("\t", ";", "|", ","):
        if sum(candidate in line for line in lines) > 0.8 * len(lines):
            return None if candidate == "," and _is_spaced(lines[-1]) else candidate
    return None


def _is_spaced(line: str) -> bool:
    """Return whether a line holds numbers with decimal commas between spaces."""
    cells = line.split()
    return len(cells) > 1 and all(is_number(cell) and not cell.endswith(",") for cell in cells)


def _split(path: Path, lines: Sequence[int], texts: Sequence[str], separator: str | None) -> list[list[str]]:
    if separator is None:
        return [_BEFORE_CLOCK.sub("T", text).split() for text in texts]
    for line, text in zip(lines, texts, strict=True):
        if text.count('"') % 2:  # else the reader would join this line and the next
            raise LogError("a quotation mark that is not closed", file=path, line=line)
    reader = csv.reader(texts, delimiter=separator, skipinitialspace=True)
    try:
        return [[cell.strip() for cell in row] for row in reader]
    except csv.Error as problem:
        raise LogError(str(problem), file=path, line=lines[reader.line_num - 1]) from problem


def _without_empty_ends(rows: list[list[str]], repairs: list[str]) -> list[list[str]]:
    """Cut what lies beyond the last column that holds anything."""
    if all(row[-1] for row in rows):
        return rows
    width = max(max(i for i, cell in enumerate(row, start=1) if cell or i == 1) for row in rows)
    cut = sum(len(row) > width for row in rows)
    if cut:
        repairs.append(f"Empty cells at the end of {count(cut, 'row')} skipped.")
    return [row[:width] for row in rows]


def _comment_above(above: Sequence[tuple[int, str]], separator: str | None, width: int) -> tuple[str, ...]:
    text = next((text.strip() for _, text in reversed(above) if text.strip()), "")
    cells = [cell.strip(' "') for cell in text.lstrip("# ").split(separator)]
    return tuple(cells) if text.startswith("#") and len(cells) == width and not any(map(is_number, cells)) else ()


def plain_cells(sheet: Sheet) -> Sheet:
    """Return the sheet with plain numbers for those with units or decimal commas; the units are kept beside it."""
    units, commas, repairs = [], False, list(sheet.repairs)
    for i in range(len(sheet.rows[0])):
        plain = plain_quantities([row[i] for row in sheet.rows])
        units.append(plain[1] if plain else "")
        if plain is None:
            continue
        commas |= plain[2]
        for row, cell in zip(sheet.rows, plain[0], strict=True):
            row[i] = cell
        if plain[1]:
            name = f"'{sheet.header[i]}'" if sheet.header else f"{i + 1}"
            repairs.append(f"The cells of column {name} bear the unit {plain[1]}.")
    if commas:
        repairs.append("Decimal commas were read as points.")
    return replace(sheet, repairs=tuple(repairs), units=tuple(units))
