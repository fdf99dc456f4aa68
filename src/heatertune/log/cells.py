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
from collections.abc import Iterator, MutableSequence, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, takewhile
from pathlib import Path
from typing import Final

from heatertune.errors import LogError
from heatertune.log.formats import BINARY_FORMATS, TEXT_FORMATS
from heatertune.log.formats.containers import decompress
from heatertune.log.formats.format_table import FormatTable, NumberedLines
from heatertune.log.quantities import (
    is_number,
    is_quantity,
    join_decimals,
    plain_quantities,
    role_of,
    says_nothing,
    stamp,
)
from heatertune.units import count
from heatertune.writing import read_bytes

__all__ = [
    "MARK",
    "SWITCHED",
    "TORN",
    "Sheet",
    "is_number",
    "plain_cells",
    "pwm_period_of",
    "read_sheet",
    "take_header",
    "without_torn",
]


_UNIT: Final = re.compile(
    r"[\[(]?(m?s|sec|min|h|°?[CFK]|deg ?[CF]|%|pct|m?V|m?A|k?W|[-–/]|bool|u?s?d?l?int|l?real|float|d?word|string"
    r"|date|time|datetime|double)?[\])]?", re.IGNORECASE)
_UNIT_WORD: Final = re.compile(r"(span/)?units?|einheit(en)?|eu|tag( no\.?)?|ch\.?", re.IGNORECASE)
_HEADER_SAMPLE: Final = 50  # rows at the end that define the form of a reading
_LEAST_NAMED: Final = 0.4  # share of the columns: a pair of columns for each channel has one name
_MOST_TITLES: Final = 200  # rows above the first reading
_FEW: Final = 3  # rows that are not whole, at most, or this share of all
_FEW_SHARE: Final = 0.02
_MOST_BELOW: Final = 40  # lines below a table: means, extremes, a signature
_SHOWN_LINES: Final = 5


def take_header(
    file: Path, lines: MutableSequence[int], rows: list[list[str]], repairs: list[str]
) -> tuple[tuple[str, ...], int, int]:
    """Remove all lines above the readings, and rows that are not whole.

    Return the column names with units, the number of the last line above them, and how many rows were removed.

    Raises:
        LogError: many rows with a different number of cells from the readings.
    """
    width = Counter(len(row) for row in rows[-_HEADER_SAMPLE:]).most_common(1)[0][0]
    empty = [name for name in rows[0][width:] if name]
    if empty and _is_words(rows[0]) and not any(map(role_of, empty)):  # LabVIEW names a comment that no row holds
        repairs.append(f"No row has cells for {', '.join(map(repr, empty))}.")
        rows[0] = rows[0][:width]
    first = _first_reading(rows, width)
    words = [k for k in range(first) if len(rows[k]) == width and _is_words(rows[k])]
    chosen = _names_row(rows, words)
    if chosen is not None:
        begin = next((k for k in range(chosen + 1, first) if k not in words), first)
    else:
        begin = next((k for k in range(first) if not _is_title(rows[k], width)), first)
    names = () if chosen is None else _named(lines, rows, chosen, [k for k in words if k > chosen], repairs)
    titles = begin if chosen is None else chosen
    above = lines[titles - 1] if titles else 0
    if titles:
        repairs.append(f"{count(titles, 'title line')} above the table skipped (up to line {above}).")
    del rows[:begin], lines[:begin]
    _drop_repeats(names, lines, rows, repairs)
    return names, above, _drop_partial_rows(file, lines, rows, width, repairs)


def _first_reading(rows: Sequence[list[str]], width: int) -> int:
    """Return the first row that looks like those at the end of the file."""
    sample = [row for row in rows[-_HEADER_SAMPLE:] if len(row) == width]
    values = [i for i in range(width) if sum(_is_value(row[i]) for row in sample) >= 0.5 * len(sample)]
    for k, row in enumerate(rows[:_MOST_TITLES]):
        if len(row) == width and values and all(_is_value(row[i]) or says_nothing(row[i]) for i in values) and any(
            _is_value(row[i]) for i in values
        ):
            return k
    return 0 if any(is_number(cell) for cell in rows[0]) else 1


def _is_value(cell: str) -> bool:
    return is_number(cell) or is_quantity(cell) or stamp(cell) is not None


def _is_words(row: Sequence[str]) -> bool:
    return not any(map(_is_value, row))


def _names_row(rows: Sequence[list[str]], words: Sequence[int]) -> int | None:
    """Return which row of words names the columns: the one with the most roles, the last of equals."""
    if not words:
        return None
    named = [k for k in words if not _is_units(rows[k]) and sum(map(bool, rows[k])) >= len(rows[k]) * _LEAST_NAMED]
    named = named or list(words[:1])
    return max(named, key=lambda k: (len({role_of(cell) for cell in rows[k]} - {None}), k))


def _is_units(row: Sequence[str]) -> bool:
    return all(map(_UNIT.fullmatch, _without_word(row)))


def _without_word(row: Sequence[str]) -> list[str]:
    """Return a row of units or names without the word that says so in its first cell, as recorders write it."""
    return ["" if i == 0 and _UNIT_WORD.fullmatch(cell) else cell for i, cell in enumerate(row)]


def _is_title(row: Sequence[str], width: int) -> bool:
    """Return whether a row above unnamed readings is a title, rather than an incomplete row or a row of names."""
    is_reading = len(row) == width or (len(row) > 1 and _is_value(row[0]))
    return not is_reading and not (len(row) > 1 and any(map(role_of, row)))


def _other_width(file: Path, line: int, row: Sequence[str], width: int, like: int) -> LogError:
    expected = f"{width} as in line {like} (--skip-empty leaves out such rows)"
    return LogError(f"{count(len(row), 'cell')} in this row", file=file, line=line, expected=expected)


def _named(
    lines: Sequence[int], rows: Sequence[list[str]], chosen: int, below: Sequence[int], repairs: list[str]
) -> tuple[str, ...]:
    """Return the names, with the units of a row below them."""
    names = list(rows[chosen]) if all(rows[chosen]) else _without_word(rows[chosen])
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


def _drop_repeats(names: Sequence[str], lines: MutableSequence[int], rows: list[list[str]], repairs: list[str]) -> None:
    """Remove rows that repeat the column names, as written when a logger restarts."""
    again = [k for k, row in enumerate(rows) if row[0] == names[0] and tuple(row) == tuple(names)] if names else []
    if again:
        repairs.append(f"{count(len(again), 'repeat')} of the header skipped (line {lines[again[0]]}).")
    for k in reversed(again):
        del rows[k], lines[k]


def _drop_partial_rows(
    file: Path, lines: MutableSequence[int], rows: list[list[str]], width: int, repairs: list[str]
) -> int:
    """Remove rows with another number of cells: a row that was cut, statistics below the table; return how many.

    Many of them within the table may be readings whose commas were taken for separators.
    """
    whole = [k for k, row in enumerate(rows) if len(row) == width]
    partial = [k for k, row in enumerate(rows) if len(row) != width]
    if not partial:
        return 0
    if not whole:
        raise LogError("the file holds a header and no readings", file=file, expected="at least 20 rows")
    within = [k for k in partial if k < whole[-1]]
    is_above = partial[0] < whole[0]  # names that are not as many as the columns, or a reading that was cut
    if is_above or len(within) > max(_FEW, _FEW_SHARE * len(rows)) or len(partial) - len(within) > _MOST_BELOW:
        error = _other_width(file, lines[partial[0]], rows[partial[0]], width, lines[whole[0]])
        if is_above:
            skipped = f"{width} as in line {lines[whole[0]]} (--skip-rows {lines[whole[0]] - 1} skips what is above it)"
            error = LogError(f"{count(len(rows[partial[0]]), 'cell')} in this row", file=file, line=lines[partial[0]],
                             expected=skipped)
        raise error
    shown = ", ".join(str(lines[k]) for k in partial[:_SHOWN_LINES])
    more = f" and {len(partial) - _SHOWN_LINES} more" if len(partial) > _SHOWN_LINES else ""
    repairs.append(f"{count(len(partial), 'row')} with another number of cells left out (line {shown}{more}).")
    for k in reversed(partial):
        del rows[k], lines[k]
    return len(partial)


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
    told = _PERIOD.search(text.split("\n", 1)[0])
    return float(told[1]) if told else 0.0


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


_CONTROL = re.compile(r"[\x00-\x08\x0e-\x1a\x1c-\x1f\x7f]")  # but the escape of coloured logs
_MOST_STRANGE: Final = 0.005  # share of control characters other than NUL: more is no text
_HEAD: Final = 1 << 16  # bytes looked at to find the encoding
_NEARLY_ALL: Final = 0.9
_WORDS = re.compile(r"[^\t;,|\"\[\](){}/]+")
#: encoding → its name in messages; of equals the first
_ENCODINGS: Final = {
    "latin-1": "Latin-1", "cp932": "Japanese (cp932)", "gb18030": "Chinese (GB 18030)", "cp949": "Korean (cp949)",
    "cp1250": "Central European (cp1250)", "cp1251": "Cyrillic (cp1251)", "cp1254": "Turkish (cp1254)",
}
_BEFORE_CLOCK = re.compile(r"(?<=\d) (?=\d{1,2}:\d\d)")
_UTF16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_SAMPLE = 50  # lines looked at to find the separator
_FEW_LINES: Final = 20
_SEPARATOR_LINE: Final = re.compile(r'[" ]*sep=[;,\t|][" ]*', re.IGNORECASE)  # written by spreadsheets
_MOST_TEXTS: Final = 4096  # different cells of a column
_MARKS: Final = ("\t", ";", "|", ",")
_ALIKE: Final = 0.05
_MOST_WORDS: Final = 0.6


@dataclass(frozen=True, slots=True, kw_only=True)
class Sheet:
    """Cells of one file.

    Attributes:
        file: its path.
        header: column names with their units, empty if the file has none.
        comment: cells of the comment directly above the readings, one for each column, or empty.
        rows: cells, all of one length.
        lines: line number of each row, 1 = first line of the file.
        repairs: changes and skipped content, one sentence each.
        units: common unit of the cells of each column, or empty.
        above: lines above the column names, or above the readings of unnamed columns.
        pwm_period_s: PWM period stated in a recording, 0 if unknown [s].
        recorded: whether `heatertune record` wrote it; its rows are readings even if the value did not change.
        lost: number of rows that were left out as damaged or not whole.
        part: part of the file that the user asked for by a tag: a sheet of a workbook.
        sessions: line number with which each session of a program begins, if there are several.
        session: the session that is read if the user asks for none, 1 = first.
    """

    file: str
    header: tuple[str, ...]
    comment: tuple[str, ...]
    rows: list[list[str]]
    lines: Sequence[int]
    repairs: tuple[str, ...]
    units: tuple[str, ...] = ()
    above: int = 0
    pwm_period_s: float = 0.0
    recorded: bool = False
    lost: int = 0
    part: str = ""
    sessions: tuple[int, ...] = ()
    session: int | None = None

    def picked(self, places: Sequence[int]) -> Sheet:
        """Return some of the rows, in the order given."""
        return replace(self, rows=[self.rows[k] for k in places], lines=[self.lines[k] for k in places])


def read_sheet(
    path: Path, content: bytes | None = None, skip_rows: int = 0, tag: str | None = None,
    decimal_comma: str | None = None,
) -> Sheet:
    """Return the cells of a file.

    Args:
        path: of the file.
        content: of the file, if it is elsewhere; the path then only names it.
        skip_rows: first lines that are left out.
        tag: heater of a printer's log or sheet of a workbook, see `heatertune.log.formats`.
        decimal_comma: columns with decimal commas that also separate the cells, see `join_decimals`.

    Raises:
        LogError: the file cannot be read, is empty, is no text, or many rows have another number of cells than the
            others.
    """
    repairs: list[str] = []
    data = decompress(path, _content(path, content), repairs)
    binary = next((kind for kind in BINARY_FORMATS if data.startswith(kind.magic)), None)
    if binary is not None:
        return _sheet_of(path, binary.read(path, data, tag), repairs, 0, skip_rows)
    text = _text(path, data, repairs)
    period_s, recorded = 0.0, text.startswith(MARK)
    if recorded:
        period_s = pwm_period_of(text)
        text = without_torn(text, repairs)
    numbered, passed, damaged = _written_lines(text, skip_rows)
    if damaged:
        repairs.append(f"{count(damaged, 'line')} with NUL bytes or other control characters left out.")
    kind = next((kind for kind in TEXT_FORMATS if kind.recognises(numbered)), None)
    if kind is not None:
        return _sheet_of(path, kind.read(path, numbered, tag), repairs, damaged)
    kept = numbered.where(lambda line: line.strip(" \t,;") != "" and not line.lstrip().startswith("#")
                          and not _SEPARATOR_LINE.fullmatch(line))
    if not kept:
        raise LogError("the file is empty", file=path, expected="rows of time and temperature")
    if passed := passed + len(numbered) - len(kept):
        repairs.append(f"{count(passed, 'line')} without readings (blank, comment) skipped.")
    kept, cut = _with_closed_quotes(path, kept, repairs)
    lines, texts = kept.numbers, kept.texts
    before = list(takewhile(lambda pair: pair[0] < lines[0], numbered))
    del text, numbered, kept, data  # a long log is held as few times as can be
    separator = _separator(texts[-_SAMPLE:])
    rows = _without_empty_ends([row or [""] for row in _split(path, lines, texts, separator)], repairs)
    if separator == "," and rows:
        join_decimals(path, rows, decimal_comma, repairs)
    header, above, partial = take_header(path, lines, rows, repairs)
    comment: tuple[str, ...] = ()
    if rows and not header:
        comment = _comment_above(before, separator, len(rows[0]))
    return Sheet(file=str(path), header=header, comment=comment, rows=rows, lines=lines, repairs=tuple(repairs),
                 above=above, pwm_period_s=period_s, recorded=recorded, lost=damaged + cut + partial)


def _sheet_of(path: Path, table: FormatTable, repairs: list[str], lost: int, skip_rows: int = 0) -> Sheet:
    """Return the sheet of a table that a format's parser made; one without a header is searched for it."""
    repairs += table.repairs
    whole = [k for k, row in enumerate(table.rows) if table.lines[k] > skip_rows or table.header]
    rows, lines = [table.rows[k] for k in whole], [table.lines[k] for k in whole]
    header, above, partial = table.header, 0, 0
    if not rows:
        raise LogError("the file is empty", file=path, expected="rows of time and temperature")
    if not header:
        rows = _without_empty_ends(rows, repairs)
        header, above, partial = take_header(path, lines, rows, repairs)
    else:
        partial = _drop_partial_rows(path, lines, rows, len(header), repairs)
    return Sheet(file=str(path), header=header, comment=(), rows=rows, lines=lines, repairs=tuple(repairs), above=above,
                 lost=lost + partial, part=table.part, sessions=table.sessions, session=table.session)


def _with_closed_quotes(path: Path, numbered: NumberedLines, repairs: list[str]) -> tuple[NumberedLines, int]:
    """Return the lines without those that open a quotation and do not close it, and how many those are.

    The reader would join such a line with the next one.
    """
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
    numbered = NumberedLines()
    passed, damaged, comment = 0, 0, None
    clean = _CONTROL.search(text) is None
    for number, line in enumerate(_lines_of(text), start=1):
        if number <= skip_rows:
            continue
        if not clean and _CONTROL.search(line):
            damaged += 1
            continue
        is_comment, is_blank = line.startswith("#"), not line.strip(" \t,;")
        if is_blank or (is_comment and comment is not None):
            passed += 1
        if is_blank:
            continue
        if comment is not None and not is_comment:
            numbered.append(*comment)
        comment = (number, line) if is_comment else None
        if not is_comment:
            numbered.append(number, line)
    if comment is not None:
        numbered.append(*comment)
    return numbered, passed, damaged


def _lines_of(text: str) -> Iterator[str]:
    """Yield the lines of a text, whatever ends them."""
    if "\r" in text:
        text = text.replace("\r\n", "\n").replace("\r", "\n")
    begin = 0
    while (end := text.find("\n", begin)) >= 0:
        yield text[begin:end]
        begin = end + 1
    if begin < len(text):
        yield text[begin:]


def _content(path: Path, content: bytes | None) -> bytes:
    try:
        return read_bytes(path) if content is None else content
    except OSError as problem:
        raise LogError(f"cannot be read: {problem.strerror}", file=path) from problem


def _text(path: Path, data: bytes, repairs: list[str]) -> str:
    text = _decoded(path, data, repairs).removesuffix("\x1a")  # the end of a file of DOS
    written = len(text) - text.count("\0")
    strange = len(_CONTROL.findall(text)) - (len(text) - written) if _CONTROL.search(text) else 0
    if strange > _MOST_STRANGE * written or (text and not written):
        expected = "a text file with one row per reading (UTF-8, Latin-1, or UTF-16 with its byte order mark)"
        raise LogError("the file is binary", file=path, expected=expected)
    return text


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
        return marks[0] if marks else None
    shares = {mark: _share_of_values(lines, mark) for mark in marks}
    best = next(mark for mark in marks if shares[mark] > max(shares.values()) - _ALIKE)
    both = max((one + other for one, other in combinations(marks, 2)), key=lambda mark: _share_of_values(lines, mark))
    return both if shares[best] < _MOST_WORDS and _share_of_values(lines, both) > _NEARLY_ALL else best


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


def _split(path: Path, lines: Sequence[int], texts: list[str], separator: str | None) -> list[list[str]]:
    if separator is None:
        return [_BEFORE_CLOCK.sub("T", text).split() for text in texts]
    if len(separator) > 1:
        texts = [_one_mark(text, separator) for text in texts]
    reader = csv.reader(_taken(texts), delimiter=separator[-1], skipinitialspace=True)
    try:
        texts_of: list[dict[str, str]] = []
        return [_strip_cells(row, texts_of) for row in reader]
    except csv.Error as problem:
        raise LogError(str(problem), file=path, line=lines[reader.line_num - 1]) from problem


def _strip_cells(row: list[str], texts_of: list[dict[str, str]]) -> list[str]:
    """Return the stripped cells of a row; equal cells of a column are one object, `texts_of` holds those of each."""
    texts_of += ({} for _ in range(len(row) - len(texts_of)))
    cells = []
    for cell, texts in zip(row, texts_of, strict=False):
        text = cell.strip()
        cells.append(texts.setdefault(text, text) if len(texts) < _MOST_TEXTS else texts.get(text, text))
    return cells


def _taken(texts: list[str]) -> Iterator[str]:
    """Yield all of a list, and leave it empty: what was yielded need not be held."""
    texts.reverse()
    while texts:
        yield texts.pop()


def _without_empty_ends(rows: list[list[str]], repairs: list[str]) -> list[list[str]]:
    """Remove the empty columns at the end."""
    if all(row[-1] for row in rows):
        return rows
    width = max(max(i for i, cell in enumerate(row, start=1) if cell or i == 1) for row in rows)
    cut = sum(len(row) > width for row in rows)
    if cut:
        repairs.append(f"Empty cells at the end of {count(cut, 'row')} skipped.")
    return [row[:width] for row in rows]


def _comment_above(above: Sequence[tuple[int, str]], separator: str | None, width: int) -> tuple[str, ...]:
    text = next((text.strip() for _, text in reversed(above) if text.strip()), "")
    cells = [cell.strip(' "') for cell in text.lstrip("# ").split(separator and separator[-1])]
    return tuple(cells) if text.startswith("#") and len(cells) == width and not any(map(is_number, cells)) else ()


def plain_cells(sheet: Sheet) -> Sheet:
    """Return the sheet with units and decimal commas converted to plain numbers; the units are stored separately."""
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
