"""File → rows of cells, each with its line number.

Also header lines (titles, column names, units) and rows that are no readings: damaged, cut off, or below the table. The
formats of `heatertune.log.formats` have parsers of their own. Logs of `heatertune record` may contain incomplete lines
of a killed process, and marked gaps.
"""

from __future__ import annotations

import codecs
import csv
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from itertools import combinations, pairwise
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from heatertune.errors import LogError, did_you_mean
from heatertune.log.formats import BINARY_FORMATS, TEXT_FORMATS
from heatertune.log.formats.containers import decompress
from heatertune.log.formats.format_table import FormatTable, NumberedLines
from heatertune.log.formats.printer_logs import heater_names
from heatertune.log.log_values import BUILT_IN
from heatertune.log.quantities import (
    FORM_MARKS,
    is_number,
    is_quantity,
    join_decimals,
    plain_quantities,
    role_of,
    says_nothing,
    usual_form,
    with_common_unit,
    without_marks,
)
from heatertune.log.sheet import Grid, Sheet, TextParts, drain, line_breaks
from heatertune.log.timestamps import stamp
from heatertune.units import count
from heatertune.writing import read_bytes

__all__ = ["MARK", "SWITCHED", "TORN", "heaters_in", "is_number", "plain_cells", "pwm_period_of", "read_sheet",
           "take_header", "without_torn"]

Lines = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]

_UNIT: Final = re.compile(
    r"[\[(]?(m?s|sec|min|h|°?[CFK]|deg ?[CF]|%|pct|m?V|m?A|k?W|[-–/]|bool|u?s?d?l?int|l?real|float|d?word|string"
    r"|date|time|datetime|double|ts|rn)?[\])]?", re.IGNORECASE)
_UNIT_WORD: Final = re.compile(r"(span/)?units?|einheit(en)?|eu|tag( no\.?)?|ch\.?", re.IGNORECASE)
_HEADER_SAMPLE: Final = 50  # rows at the end that define the form of a reading
_LEAST_NAMED: Final = 0.4  # share of the columns: a pair of columns for each channel has one name
_MOST_TITLES: Final = 200  # rows above the first reading
_FEW: Final = 3  # rows that are not whole, at most, or this share of all
_FEW_SHARE: Final = 0.02
_MOST_BELOW: Final = 40  # lines below a table: means, extremes, a signature
_SHOWN_LINES: Final = 5


def take_header(lines: Lines, rows: Grid, repairs: list[str]) -> tuple[tuple[str, ...], int, Mask]:
    """Return the column names with units, the number of the last line above them, and the rows below, shape (n,)."""
    width = rows.width
    empty = [name for name in rows[0][width:] if name]
    if empty and _is_words(rows[0]) and not any(map(role_of, empty)):  # LabVIEW names a comment that no row holds
        longer = {k: row[:width] for k, row in rows.aside.items() if len(row) == len(rows[0])}  # or a serial number
        repairs.append(f"{'Few rows have' if len(longer) > 1 else 'No row has'} cells for "
                       f"{', '.join(map(repr, empty))}.")
        rows.aside |= longer
    if len(rows[0]) == width - 1 and _is_words(rows[0]) and _has_row_names(rows):
        repairs.append("The first column has no name and holds the numbers of the rows.")
        rows.aside[0] = ["", *rows[0]]
    first = _first_reading(rows, width)
    words = [k for k in range(first) if len(rows[k]) == width and _is_words(rows[k])]
    chosen = _names_row(rows, words)
    if chosen is not None:
        begin = next((k for k in range(chosen + 1, first) if k not in words and _is_mostly_values(rows[k])), first)
    else:
        begin = next((k for k in range(first) if not _is_title(rows[k], width)), first)
    names = () if chosen is None else _named(lines, rows, chosen, [k for k in words if k > chosen], repairs)
    titles = begin if chosen is None else chosen
    above = int(lines[titles - 1]) if titles else 0
    if titles:
        repairs.append(f"{count(titles, 'title line')} above the table skipped (up to line {above}).")
    below = np.arange(len(rows)) >= begin
    heads = [] if chosen is None else [list(names), *(rows[k] for k in words if k >= chosen)]
    again = sorted({k for head in heads for k in rows.find(head) if k >= begin})  # as written when a logger restarts
    if again:
        repairs.append(f"{count(len(again), 'repeat')} of the header skipped (line {lines[again[0]]}).")
        below[again] = False
    return names, above, below


def _has_row_names(rows: Grid) -> bool:
    """Return whether the readings begin with the numbers of the rows, and the names without one for these, as R writes.

    The column behind that of the name must then be the time, evenly spaced: names may also lack one at their end.
    """
    clock = next((i + 1 for i, name in enumerate(rows[0]) if role_of(name) == "time"), None)
    numbers, time = (None if i is None else rows.columns[i].floats() for i in (0, clock))
    if numbers is None or time is None or len(time) < 2 or numbers[0] not in (0.0, 1.0):
        return False
    steps, is_counted = np.diff(time), np.array_equal(numbers, numbers[0] + np.arange(len(numbers)))
    usual = float(np.median(steps))
    return bool(is_counted and usual > 0.0 and np.all(np.abs(steps - usual) < 0.5 * usual))


def _first_reading(rows: Grid, width: int) -> int:
    """Return the first row that looks like those at the end of the file."""
    sample = [row for row in rows[-_HEADER_SAMPLE:] if len(row) == width] or [
        row for row in rows[:_MOST_TITLES] if len(row) == width][-_HEADER_SAMPLE:]
    values = [i for i in range(width) if sum(_is_value(row[i]) for row in sample) >= 0.5 * len(sample)]
    for k, row in enumerate(rows[:_MOST_TITLES]):
        filled = [row[i] for i in values if not says_nothing(row[i])] if len(row) == width else []
        if any(map(_is_value, filled)) and all(map(_is_value, filled)):
            return k
    return 0 if any(is_number(cell) for cell in rows[0]) else 1


def _is_value(cell: str) -> bool:
    return is_number(cell) or is_quantity(cell) or stamp(cell) is not None


def _is_words(row: Sequence[str]) -> bool:
    return not any(map(_is_value, row))


def _is_mostly_values(row: Sequence[str]) -> bool:
    """Return whether a row is one of readings, not of settings: SampleTime[ms], 2000."""
    return len(row) == 1 or 2 * sum(_is_value(cell) or says_nothing(cell) for cell in row) > len(row)


def _names_row(rows: Grid, words: Sequence[int]) -> int | None:
    """Return which row of words names the columns: the one with the most roles, the last of equals."""
    if not words:
        return None
    candidates = [k for k in words if not _is_units(rows[k]) and sum(map(bool, rows[k])) >= len(rows[k]) * _LEAST_NAMED]
    candidates = candidates or list(words[:1])
    return max(candidates, key=lambda k: (len({role_of(cell) for cell in rows[k]} - {None}), k))


def _is_units(row: Sequence[str]) -> bool:
    return all(map(_UNIT.fullmatch, _without_word(row)))


def _without_word(row: Sequence[str]) -> list[str]:
    """Return a row of units or names without the word that says so in its first cell, as recorders write it."""
    return ["" if i == 0 and _UNIT_WORD.fullmatch(cell) else cell for i, cell in enumerate(row)]


def _is_title(row: Sequence[str], width: int) -> bool:
    """Return whether a row above unnamed readings is a title, rather than an incomplete row or a row of names."""
    is_reading = len(row) == width or (len(row) > 1 and _is_value(row[0]))
    return not is_reading and not (len(row) > 1 and any(map(role_of, row)))


def _named(lines: Lines, rows: Grid, chosen: int, below: Sequence[int], repairs: list[str]) -> tuple[str, ...]:
    """Return the names, with the units of a row below them."""
    names = list(rows[chosen]) if all(rows[chosen]) else _without_word(rows[chosen])
    above = rows[chosen - 1] if chosen else []
    if len(above) == len(names) and _is_words(above):  # "Time" above "[s]"
        names = [f"{word} {name}" if word and name[:1] in ("[", "(") and _UNIT.fullmatch(name)
                 else name or (word if role_of(word) else "") for word, name in zip(above, names, strict=True)]
    for k in below:
        filled = list(filter(None, _without_word(rows[k])))
        fills = not names[0] and rows[k][0] and not _UNIT_WORD.fullmatch(rows[k][0])
        if not fills and sum(_UNIT.fullmatch(cell) is not None for cell in filled) > len(filled) / 2:
            repairs.append(f"Line {lines[k]} was read as the units of the columns.")
            units = [unit.strip("[]() ") for unit in _without_word(rows[k])]
            names = [f"{name} [{unit}]" if unit.strip("-–/") else name for name, unit in zip(names, units, strict=True)]
        elif not all(names):
            repairs.append(f"Line {lines[k]} was read as the names of the columns that have none above it.")
            names = [name or below_it for name, below_it in zip(names, rows[k], strict=True)]
        else:
            repairs.append(f"Line {lines[k]}, below the names of the columns, skipped.")
    return tuple(names)


def _without_partial_rows(file: Path, lines: Lines, rows: Grid, below: Mask, repairs: list[str], *,
                          skip_empty: bool) -> Mask:
    """Return the rows to keep without those with another number of cells: a row that was cut, statistics below.

    Many of them within the table may be readings whose commas were taken for separators: the user leaves them out.
    """
    is_whole, width = rows.whole(), rows.width
    whole, partial = np.flatnonzero(below & is_whole), np.flatnonzero(below & ~is_whole)
    if not len(partial):
        return below
    if not len(whole):
        raise LogError("the file holds a header and no readings", file=file, expected="at least 20 rows")
    within = np.count_nonzero(partial < whole[-1])
    first, like = int(partial[0]), int(lines[whole[0]])
    is_above = first < whole[0]  # names that are not as many as the columns, or a reading that was cut
    are_many = within > max(_FEW, _FEW_SHARE * below.sum()) or len(partial) - within > _MOST_BELOW
    if is_above or (are_many and not skip_empty):
        way = f"--skip-rows {like - 1} skips what is above it" if is_above else "--skip-empty leaves out such rows"
        raise LogError(f"{count(len(rows[first]), 'cell')} in this row", file=file, line=int(lines[first]),
                       expected=f"{width} as in line {like} ({way})")
    shown = ", ".join(str(lines[k]) for k in partial[:_SHOWN_LINES])
    more = f" and {len(partial) - _SHOWN_LINES} more" if len(partial) > _SHOWN_LINES else ""
    repairs.append(f"{count(len(partial), 'row')} with another number of cells left out (line {shown}{more}).")
    return below & is_whole


#: begins the first line
MARK: Final = "# heatertune record"
#: in the first line, before the PWM period of the switch [s]
SWITCHED: Final = "; PWM period: "
#: ends a line that was torn, once the file has been continued; else it is the last and has no line's end
TORN: Final = "#torn"
_GAP: Final = "# gap "
_SHOWN: Final = 3
_PERIOD: Final = re.compile(re.escape(SWITCHED) + r"(\d+(?:\.\d+)?(?:e-?\d+)?) s\b")


def pwm_period_of(text: str) -> float:
    """Return the PWM period in the first line, 0 if there is none [s]."""
    match = _PERIOD.search(text.split("\n", 1)[0])
    return float(match[1]) if match else 0.0


def without_torn(text: str, repairs: list[str]) -> str:
    """Return the text with incomplete lines blanked, without changing the number of lines; the repairs list them."""
    lines = text.split("\n")
    torn = [i for i, line in enumerate(lines) if line.endswith(TORN) or (line and i == len(lines) - 1)]
    for i in torn:
        repairs.append(f"Line {i + 1} was torn when the recording was cut off, and is left out: {lines[i]!r}.")
        lines[i] = ""
    gaps = [line.removeprefix(_GAP) for line in lines if line.startswith(_GAP)]
    if gaps:
        more = f"; and {len(gaps) - _SHOWN} more" if len(gaps) > _SHOWN else ""
        repairs.append(f"The recording marks {count(len(gaps), 'gap')}: {'; '.join(gaps[:_SHOWN])}{more}.")
    return "\n".join(lines)


_CONTROLS: Final = bytes([*range(9), *range(0x0E, 0x1B), *range(0x1C, 0x20), 0x7F]).decode()  # not of coloured logs
_CONTROL: Final = re.compile(f"[{_CONTROLS}]")
_MOST_STRANGE: Final = 0.005  # share of control characters other than NUL: more is no text
_HEAD: Final = 1 << 16  # bytes looked at to find the encoding
_NEARLY_ALL: Final = 0.9
_WORDS = re.compile(r"[^\t;,|\"\[\](){}/]+")
#: encoding → its name in messages; of equals the first
_ENCODINGS: Final = {
    "latin-1": "Latin-1", "cp932": "Japanese (cp932)", "gb18030": "Chinese (GB 18030)", "cp949": "Korean (cp949)",
    "cp1250": "Central European (cp1250)", "cp1251": "Cyrillic (cp1251)", "cp1254": "Turkish (cp1254)"}
_BEFORE_CLOCK = re.compile(r"(?<=\d) (?=\d{1,2}:\d\d)")
_UTF16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_SAMPLE = 50  # lines looked at to find the separator
_FEW_LINES: Final = 20
_MANY_LINES: Final = 1000
_COLOUR: Final = re.compile(r"\x1b\[[\d;]*[A-Za-z]")  # what a terminal's log holds of its colours and lines
_SEPARATOR_LINE: Final = re.compile(r'[" ]*sep=[;,\t|][" ]*', re.IGNORECASE)  # written by spreadsheets
_FRAME: Final = r"[-+=| :\u2500-\u257f]*"
_FRAME_LINE: Final = re.compile(rf"{_FRAME}(?:---|===|───|═══){_FRAME}")  # of a table that a database's terminal prints
_MARKS: Final = ("\t", ";", "|", "│", ",")
_ALIKE: Final = 0.05
_MOST_WORDS: Final = 0.6


def read_sheet(path: Path, content: bytes | None = None, skip_rows: int = 0, tag: str | None = None,
               decimal_comma: str | None = None, *, skip_empty: bool = False) -> Sheet:
    """Return the cells of a file.

    Args:
        path: of the file.
        content: of the file, if it is elsewhere; the path then only names it.
        skip_rows: first lines that are left out.
        tag: heater of a printer's log or sheet of a workbook, see `heatertune.log.formats`.
        decimal_comma: columns with decimal commas that also separate the cells, see `join_decimals`.
        skip_empty: whether any number of rows with another number of cells than the others is left out.

    Raises:
        LogError: the file cannot be read, is empty, is no text, or many rows have another number of cells than the
            others.
    """
    repairs: list[str] = []
    data = decompress(path, _content(path, content), repairs)
    binary = next((kind for kind in BINARY_FORMATS if data.startswith(kind.magic)), None)
    if binary is not None:
        return _sheet_of(path, binary.read(path, data, tag), repairs, 0, skip_rows, skip_empty=skip_empty)
    text = _text(path, data, repairs)
    if "\x1b[" in text:
        text = _COLOUR.sub("", text)
    period_s, recorded = 0.0, text.startswith(MARK)
    if recorded:
        period_s = pwm_period_of(text)
        text = without_torn(text, repairs)
    numbered, passed, damaged = _written_lines(text, skip_rows)
    if damaged:
        repairs.append(f"{count(damaged, 'line')} with NUL bytes or other control characters left out.")
    kind = next((kind for kind in TEXT_FORMATS if kind.recognises(numbered)), None)
    if kind is not None:
        return _sheet_of(path, kind.read(path, numbered, tag), repairs, damaged, skip_empty=skip_empty)
    lines = numbered
    if any(mark in text for mark in ("#", "=", "---", "───")):
        lines = numbered.where(lambda line: not line.lstrip().startswith("#") and not _SEPARATOR_LINE.fullmatch(line)
                               and not _FRAME_LINE.fullmatch(line))
    if not lines:
        raise LogError("the file is empty", file=path, expected="rows of time and temperature")
    if passed := passed + len(numbered) - len(lines):
        repairs.append(f"{count(passed, 'line')} without readings (blank, comment) skipped.")
    lines, cut = _with_closed_quotes(path, lines, repairs)
    comments = [pair for pair in numbered[:_MOST_TITLES] if pair[1].lstrip().startswith("#")]
    del numbered, data  # a long log is held as few times as can be
    separator = _separator(lines.texts[-_SAMPLE:])
    grid = _split(path, lines, separator)
    _without_empty_ends(grid, repairs)
    grid.change(usual_form, FORM_MARKS)
    if separator == ",":
        grid = _join_groups(grid, repairs)
        join_decimals(path, grid, decimal_comma, repairs)
    sheet = _sheet_of_grid(path, grid, np.array(lines.numbers), repairs, damaged + cut, skip_empty=skip_empty)
    above = [text for line, text in comments if len(sheet) and line < sheet.lines[0]]
    comment = () if sheet.header else _comment_above(above, separator, len(sheet.columns))
    return replace(sheet, comment=comment, pwm_period_s=period_s, recorded=recorded)


def heaters_in(path: Path, content: bytes | None = None) -> list[str]:
    """Return the heaters of a printer's log, by which `read_sheet` selects one; none of another file.

    Args:
        path: of the file.
        content: of the file, None: it is read.

    Raises:
        LogError: the file cannot be read.
    """
    data = decompress(path, _content(path, content), [])
    if any(data.startswith(kind.magic) for kind in BINARY_FORMATS):
        return []
    return heater_names(_written_lines(_text(path, data, []), 0)[0])


def _sheet_of_grid(path: Path, grid: Grid, lines: Lines, repairs: list[str], lost: int, *, skip_empty: bool) -> Sheet:
    """Return the sheet of a table, which is searched for its header."""
    header, above, below = take_header(lines, grid, repairs)
    row_mask = _without_partial_rows(path, lines, grid, below, repairs, skip_empty=skip_empty)
    return Sheet(file=str(path), header=header, comment=(), columns=grid.at_rows(row_mask), lines=lines[row_mask],
                 repairs=tuple(repairs), above=above, lost=lost + int(np.count_nonzero(below & ~row_mask)))


def _sheet_of(path: Path, table: FormatTable, repairs: list[str], lost: int, skip_rows: int = 0, *,
              skip_empty: bool) -> Sheet:
    """Return the sheet of a table that a format's parser made; one without a header is searched for it."""
    repairs += table.repairs
    rows, lines, header = table.rows, np.array(table.lines, dtype=np.int64), table.header
    if not header and skip_rows:
        rows, lines = [row for row, line in zip(rows, lines, strict=True) if line > skip_rows], lines[lines > skip_rows]
    if not len(lines):
        raise LogError("the file is empty", file=path, expected="rows of time and temperature")
    grid = _grid_of(rows, len(header))
    if header:
        row_mask = _without_partial_rows(path, lines, grid, np.ones(len(grid), dtype=np.bool_), repairs,
                                         skip_empty=skip_empty)
        sheet = Sheet(file=str(path), header=header, comment=(), columns=grid.at_rows(row_mask), lines=lines[row_mask],
                      repairs=tuple(repairs), lost=lost + int(np.count_nonzero(~row_mask)))
    else:
        _without_empty_ends(grid, repairs)
        sheet = _sheet_of_grid(path, grid, lines, repairs, lost, skip_empty=skip_empty)
    return replace(sheet, part=table.part, sessions=table.sessions, session=table.session)


def _grid_of(rows: Iterable[list[str]], width: int) -> Grid:
    """Return the cells of a table by columns; a width of 0 is found."""
    if isinstance(rows, Grid):
        return rows
    return Grid(drain(rows) if isinstance(rows, list) else rows, width or _usual_width([*rows][-_HEADER_SAMPLE:]))


def _usual_width(rows: Iterable[Sequence[str]]) -> int:
    """Return the most usual number of cells, the larger one of equals: rows are cut off rather than lengthened."""
    return max(Counter(map(len, rows)).items(), key=lambda pair: pair[::-1])[0]


def _with_closed_quotes(path: Path, numbered: NumberedLines, repairs: list[str]) -> tuple[NumberedLines, int]:
    """Return the lines without those that open a quotation and do not close it, and how many those are.

    The reader would join such a line with the next one.
    """
    if '"' not in numbered.texts.text:
        return numbered, 0
    closed = numbered.where(lambda line: line.count('"') % 2 == 0)
    opened = len(numbered) - len(closed)
    if not opened:
        return numbered, 0
    first = next(number for number, line in numbered if line.count('"') % 2)
    if opened > max(1, _FEW_SHARE * len(numbered)):
        raise LogError("a quotation mark that is not closed", file=path, line=first,
                       expected="--skip-rows if it is above the table, else a closed one")
    repairs.append(f"{count(opened, 'line')} with a quotation mark that is not closed left out (line {first}).")
    return closed, opened


def _written_lines(text: str, skip_rows: int) -> tuple[NumberedLines, int, int]:
    """Return number and content of the lines to look at, how many are not, and how many are damaged.

    Megabytes of lines that are not looked at take no memory: blank ones, and of comments in a row all but the last,
    which may name the columns. A logger that lost its power leaves NUL bytes in its file.
    """
    if "\r" in text:
        text = text.replace("\r\n", "\n").replace("\r", "\n")
    breaks = line_breaks(text)
    begins = np.concatenate([np.zeros(1, breaks.dtype), breaks + 1])[skip_rows:]
    ends = np.concatenate([breaks, np.full(1, len(text), breaks.dtype)])[skip_rows:]
    if len(begins) and begins[-1] == len(text):
        begins, ends = begins[:-1], ends[:-1]
    has_text = ends > begins
    numbers = skip_rows + 1 + np.flatnonzero(has_text)
    lines = NumberedLines(numbers, TextParts(text, begins[has_text], ends[has_text]))
    blank = len(ends) - len(lines)
    written = lines.where(lambda line: _CONTROL.search(line) is None) if _is_damaged(text) else lines
    content = written.where(lambda line: line.strip(" \t,;") != "")
    if "#" in text:
        is_comment = np.fromiter((line.startswith("#") for line in content.texts), dtype=np.bool_, count=len(content))
        content = content.at_rows(~(is_comment & np.append(is_comment[1:], False)))
    return content, len(written) - len(content) + blank, len(lines) - len(written)


def _is_damaged(text: str) -> bool:
    """Return whether a text holds a control character, each looked for at once."""
    return any(mark in text for mark in _CONTROLS)


def _content(path: Path, content: bytes | None) -> bytes:
    try:
        return read_bytes(path) if content is None else content
    except OSError as problem:
        if re.match(r"(https?|ftp|s3):/", str(path)):
            raise LogError("an address; expected a file: download it first", file=path) from problem
        near = did_you_mean(str(path), BUILT_IN) if isinstance(problem, FileNotFoundError) else ""
        raise LogError(f"cannot be read: {problem.strerror}{near}", file=path) from problem


def _text(path: Path, data: bytes, repairs: list[str]) -> str:
    text = _decoded(path, data, repairs).removesuffix("\x1a")  # the end of a file of DOS
    text = text.replace("\x1f", "\t").replace("\x1e", "\n")  # ASCII's own separators
    written = len(text) - text.count("\0")
    strange = len(_CONTROL.findall(text)) - (len(text) - written) if _is_damaged(text) else 0
    if strange > _MOST_STRANGE * written or (text and not written):
        advice = next((advice for magic, advice in _ADVICE.items() if data.startswith(magic)), _ADVICE[b""])
        raise LogError("the file is binary", file=path, expected=advice)
    return text


#: how a binary file begins → what to give in its place
_ADVICE: Final = {
    b"SQLite format 3": "a table of it as text: sqlite3 -header -csv FILE 'SELECT * FROM TABLE' > log.csv",
    b"TDSm": "the same measurement of LabVIEW as .lvm or CSV", b"\x28\xb5\x2f\xfd": "the log unpacked: zstd -d FILE",
    b"": "a text file with one row per reading (UTF-8, Latin-1, or UTF-16 with its byte order mark)"}


def _decoded(path: Path, data: bytes, repairs: list[str]) -> str:
    wide = _without_mark(data)
    if data.startswith(_UTF16) or wide:
        try:
            text = data.decode("utf-16" if data.startswith(_UTF16) else wide)
        except UnicodeDecodeError as problem:
            raise LogError("the file is not valid UTF-16 text", file=path) from problem
        repairs.append("The file is UTF-16.")
        return text
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        encoding = _encoding(data)
        repairs.append(f"The file is not UTF-8 and was read as {_ENCODINGS[encoding]}.")
        return data.decode(encoding, errors="replace")


def _without_mark(data: bytes) -> str:
    """Return the kind of UTF-16 if every other byte is zero, though no mark says so, or ""."""
    head = data[:_HEAD // 8]
    for first, encoding in ((1, "utf-16-le"), (0, "utf-16-be")):
        every = head[first::2]
        if len(every) > _SAMPLE and every.count(0) > _NEARLY_ALL * len(every) and head.count(0) < 0.6 * len(head):
            return encoding
    return ""


def _encoding(data: bytes) -> str:
    """Return the encoding in which most names of columns are words for time, temperature or power, or Latin-1."""
    head = data[:_HEAD].rsplit(b"\n", 1)[0] if b"\n" in data[:_HEAD] else data[:_HEAD]

    def roles(encoding: str) -> int:
        try:
            lines = head.decode(encoding).splitlines()[:_SAMPLE]
        except UnicodeDecodeError:
            return -1
        words = {word for line in lines for word in _WORDS.findall(line) if not word.isascii()}
        return sum(role_of(word.strip()) is not None for word in words)

    return max(_ENCODINGS, key=roles)


def _separator(lines: Sequence[str]) -> str | None:
    """Return the separator, of several that nearly all lines contain the one that leaves the most values.

    Two characters: both separate cells, as where one program writes the stamp and another one the rest. None: white
    space, or a single column.
    """
    marks = [mark for mark in _MARKS if sum(mark in line for line in lines) > 0.8 * len(lines)]
    if "," in marks and _is_spaced(lines[-1]):
        marks.remove(",")
    if len(marks) < 2:
        return marks[0] + _mark_of_some(lines, marks[0]) if marks else None
    shares = {mark: _share_of_values(lines, mark) for mark in marks}
    best = next(mark for mark in marks if shares[mark] > max(shares.values()) - _ALIKE)
    both = max((one + other for one, other in combinations(marks, 2)), key=lambda mark: _share_of_values(lines, mark))
    return both if shares[best] < _MOST_WORDS and _share_of_values(lines, both) > _NEARLY_ALL else best


def _mark_of_some(lines: Sequence[str], mark: str) -> str:
    """Return the mark that some lines have in place of another one: with both nearly all have as many cells."""
    def usual_share(marks: str) -> float:
        widths = Counter(len(_one_mark(line, marks).split(marks[-1])) for line in lines)
        return max(widths.values()) / len(lines)

    others = [] if usual_share(mark) > _NEARLY_ALL else [other for other in _MARKS if other != mark and min(
        usual_share(other + mark), _share_of_values(lines, other + mark)) > _NEARLY_ALL]
    return others[0] if len(others) == 1 else ""


def _share_of_values(lines: Sequence[str], mark: str) -> float:
    """Return the share of the cells that are numbers, quantities or times."""
    cells = [cell.strip(' "') for line in lines[-_FEW_LINES:] for cell in _one_mark(line, mark).split(mark[-1])]
    return sum(says_nothing(cell) or _is_value(cell) for cell in cells) / max(len(cells), 1)


def _one_mark(line: str, mark: str) -> str:
    return line.replace(mark[0], mark[-1]) if len(mark) > 1 else line


def _is_spaced(line: str) -> bool:
    """Return whether a line holds numbers with decimal commas between spaces."""
    cells = line.split()
    return len(cells) > 1 and all(is_number(cell) and not cell.endswith(",") for cell in cells)


def _split(path: Path, lines: NumberedLines, separator: str | None) -> Grid:
    rows: Iterable[list[str]] = (_BEFORE_CLOCK.sub("T", text).split() for text in lines.texts)
    if separator is None:
        return Grid(rows, _usual_width(_BEFORE_CLOCK.sub("T", text).split() for text in lines.texts[-_SAMPLE:]))
    try:
        last = csv.reader(_usual_lines(lines.texts, separator), delimiter=separator[-1], skipinitialspace=True)
        width = _usual_width(row or [""] for row in last)
    except csv.Error:
        width = 1  # the whole table tells the line
    if '"' not in lines.texts.text and lines.texts.longest() <= csv.field_size_limit():
        return Grid((text.split(separator[-1]) for text in _between(lines.texts, separator)), width)
    reader = csv.reader(_between(lines.texts, separator), delimiter=separator[-1], skipinitialspace=True)
    try:
        return Grid((row or [""] for row in reader), width)
    except csv.Error as problem:
        raise LogError(str(problem), file=path, line=lines[reader.line_num - 1][0]) from problem


def _usual_lines(texts: TextParts, separator: str) -> Iterable[str]:
    """Return the last lines; of a table that goes on in another width, those before it, if they are more."""
    some = texts.at_rows(np.unique(np.linspace(0, len(texts) - 1, _MANY_LINES).astype(np.intp)))
    numbers = [text.count(separator[-1]) for text in _between(some, separator)]
    usual, number = Counter(numbers).most_common(1)[0]
    if not usual or number <= 0.5 * len(numbers):
        return _between(texts[-_SAMPLE:], separator)
    return _between(some.at_rows(np.flatnonzero(np.array(numbers) == usual)[-_SAMPLE:]), separator)


def _between(texts: Iterable[str], separator: str) -> Iterable[str]:
    """Return lines whose cells stand between marks of one kind."""
    return texts if len(separator) == 1 else (_one_mark(text, separator) for text in texts)


def _without_empty_ends(rows: Grid, repairs: list[str]) -> None:
    """Remove the empty columns at the end."""
    widths = [i for i, column in enumerate(rows.columns, start=1) if i == 1 or column.has_text().any()][-1:]
    widths += [max((i for i, cell in enumerate(row, start=1) if cell), default=1) for row in rows.aside.values()]
    width = max(widths)
    longer = sum(len(row) > width for row in rows.aside.values())
    cut = longer + (len(rows) - len(rows.aside) if rows.width > width else 0)
    if cut:
        repairs.append(f"Empty cells at the end of {count(cut, 'row')} skipped.")
        rows.cut(width)


def _join_groups(rows: Grid, repairs: list[str]) -> Grid:
    """Return rows with the two cells of each number joined whose comma groups thousands, where only some have one.

    Rows with a number below 1000 have as many cells as there are names; the others have one more, always at one place,
    and of the unit in that column, if it bears one: 800 W, and 1,200 W.

    Args:
        rows: of a file that separates its cells by commas, the names among the first.
        repairs: list to which the joining is added.
    """
    names: list[str] = next(filter(_are_names, rows[:_MOST_TITLES]), [])
    wider = len(names) + 1
    if not names or rows.width not in (wider, wider - 1) or wider not in (rows.width, *map(len, rows.aside.values())):
        return rows
    wide = list(filter(lambda row: len(row) == wider, rows))
    others = list(filter(lambda row: len(row) == len(names) and row != names, rows))
    places = set.intersection(*map(_grouped_places, wide))
    if len(places) != 1 or not others or not _are_below(others, min(places), wide[0][min(places) + 1]):
        return rows
    place = places.pop()
    repairs.append(f"The commas of thousands in {names[place]!r} also separate the cells; each two cells of "
                   f"{count(len(wide), 'row')} were joined.")
    return Grid(map(partial(_joined, place=place, width=wider), rows), len(names))


def _are_names(row: Sequence[str]) -> bool:
    return len(row) > 1 and all(row) and any(map(role_of, row)) and _is_words(row)


def _joined(row: list[str], place: int, width: int) -> list[str]:
    return row if len(row) != width else [*row[:place], row[place] + row[place + 1], *row[place + 2:]]


def _grouped_places(row: Sequence[str]) -> set[int]:
    """Return the places of cells that are thousands with the next one."""
    return {i for i, pair in enumerate(pairwise(row)) if _GROUPED.fullmatch(",".join(pair))}


def _are_below(rows: Sequence[Sequence[str]], place: int, group: str) -> bool:
    """Return whether the cells of a column are numbers up to 999, some from 100 on, of the unit behind a group."""
    unit = re.sub(r"^[\d.]+", "", group)
    figures = [row[place].removesuffix(unit) for row in rows if not says_nothing(row[place]) and row[place] != unit]
    values = [abs(float(figure)) for figure in figures if is_number(figure) and "," not in figure]
    return len(values) >= _NEARLY_ALL * len(figures) > 0.0 and 100.0 <= max(values) < 1000.0


_GROUPED: Final = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}(?:\.\d+)?( ?\D.*)?")


def _comment_above(comments: Sequence[str], separator: str | None, width: int) -> tuple[str, ...]:
    text = comments[-1].strip("# \t") if comments else ""
    cells = [cell.strip(' "') for cell in text.split(separator and separator[-1])]
    return tuple(cells) if len(cells) == width and not any(map(is_number, cells)) else ()


def plain_cells(sheet: Sheet, decimal_comma: str | None = None) -> Sheet:
    """Return the sheet with units and decimal commas converted to plain numbers; the units are stored separately.

    Args:
        sheet: the cells.
        decimal_comma: columns with decimal commas, by number (1 = first) or name, with commas between them; "none".
    """
    units, commas, repairs, bare = [], False, list(sheet.repairs), not _names_rows(sheet)
    stated = None if decimal_comma is None else {part.strip() for part in decimal_comma.split(",")}
    for i, (name, cells) in enumerate(zip(sheet.names(), sheet.columns, strict=True)):
        comma, shown = None, f"'{name}'" if sheet.header else name
        if stated is not None:
            comma = not stated.isdisjoint((name, f"{i + 1}"))
        if (unmarked := without_marks(cells)) is not None:
            sheet = sheet.with_column(i, unmarked)
            repairs.append(f"The marks behind some numbers of column {shown} were left out.")
        column = cells if unmarked is None else unmarked
        if (common := with_common_unit(column, bare=bare, decimal_commas=comma)) is not None:
            column = common[0]
            sheet = sheet.with_column(i, column)
            repairs.extend(filter(None, [common[1].format(shown)]))
        plain = plain_quantities(column, decimal_commas=comma, lenient=bare)
        units.append(plain[1] if plain else "")
        if plain is None:
            continue
        commas |= plain[2]
        sheet = sheet.with_column(i, plain[0])
        if plain[1]:
            repairs.append(f"The cells of column {shown} bear the unit {plain[1]}.")
    if commas:
        repairs.append("Decimal commas were read as points.")
    return replace(sheet, repairs=tuple(repairs), units=tuple(units))


def _names_rows(sheet: Sheet) -> bool:
    """Return whether a column of a few words may say what the values of a row are: a long table."""
    return any(not any(is_number(cell) or is_quantity(cell) for cell in column[:_SOME])
               and 1 < column.levels() <= len(column) // 4 for column in sheet.columns)


_SOME: Final = 5
