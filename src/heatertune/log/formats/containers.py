"""Files that hold more than a table of text.

Excel workbooks, Parquet, Feather and MATLAB are each read by the library that knows the format. Tables of HTML, as web
pages save them under the name of a workbook, and lines in which each value has its name are read here.
"""

from __future__ import annotations

import bz2
import datetime as dt
import gzip
import io
import lzma
import math
import re
import zipfile
import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from html.parser import HTMLParser
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree

import numpy as np

from heatertune.errors import LogError
from heatertune.log.formats.format_table import BinaryFormat, FormatTable, Line, TextFormat, line_stamp
from heatertune.log.quantities import role_of
from heatertune.log.sheet import CellColumn, Grid
from heatertune.units import count
from heatertune.writing import read_beyond

__all__ = ["CONTAINERS", "WEB_TABLES", "decompress"]

_MOST_UNPACKED: Final = 1 << 30
_SHOWN: Final = 8
_AT_ONCE: Final = 4096  # rows


def decompress(path: Path, data: bytes, repairs: list[str]) -> bytes:
    """Return the content of a .gz, .bz2 or .xz file, or of the only one in a .zip; of a .gz that was cut, what is left.

    Raises:
        LogError: nothing can be read, or more than a gigabyte, or several files are in a .zip.
    """
    opened = _only_file(path, data) if data.startswith(b"PK\x03\x04") else next(
        (opened for magic, opened in _PACKED.items() if data.startswith(magic)), None)
    if opened is None:
        return data
    try:
        content = read_beyond(opened(io.BytesIO(data)), _MOST_UNPACKED)
    except (EOFError, OSError, RuntimeError, ValueError, zlib.error, lzma.LZMAError, zipfile.BadZipFile) as problem:
        rest = _rest(data)
        if not rest:
            raise LogError("a compressed file that is damaged", file=path, expected="a whole one") from problem
        repairs.append("The compressed file is cut off; what it holds up to there was read.")
        return rest
    if len(content) > _MOST_UNPACKED:
        raise LogError("more than 1 GB when unpacked", file=path, expected="a smaller log")
    return content


#: how a compressed file begins → what opens it
_PACKED: Final[dict[bytes, Callable[[io.BytesIO], Any]]] = {
    b"\x1f\x8b": gzip.open, b"BZh": bz2.open, b"\xfd7zXZ": lzma.open}


def _only_file(path: Path, data: bytes) -> Callable[[io.BytesIO], Any] | None:
    """Return what opens the only file in a .zip, None of a workbook and of a damaged one, which its reader refuses."""
    try:
        archive = zipfile.ZipFile(io.BytesIO(data))
    except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError):
        return None
    names = [name for name in archive.namelist() if not name.endswith("/")]
    if not {"[Content_Types].xml", "content.xml"}.isdisjoint(names):  # of .xlsx and .ods
        return None
    if len(names) != 1:
        raise LogError(f"a .zip of {count(len(names), 'file')}", file=path,
                       expected=f"one of them unpacked: {', '.join(names[:_SHOWN])}")
    return lambda _: archive.open(names[0])


def _rest(data: bytes) -> bytes:
    """Return what can be unpacked of a .gz stream that is cut off."""
    unpacker = zlib.decompressobj(wbits=31)
    try:
        return unpacker.decompress(data, _MOST_UNPACKED)
    except zlib.error:
        return b""


def _cell(value: Any) -> str:
    """Return a value of a container as a cell of a text file."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, dt.timedelta):
        return repr(value.total_seconds())
    if isinstance(value, dt.datetime):
        return value.isoformat(" ")
    return repr(value) if isinstance(value, float) else str(value)


def _missing(path: Path, extra: str, library: str) -> LogError:
    return LogError(f"this file needs {library}", file=path, expected=f"pip install 'heatertune[{extra}]'")


def _workbook(path: Path, data: bytes, tag: str | None) -> FormatTable:
    """Return the sheet of a workbook that is asked for by its name, else the one with the most numbers."""
    try:
        from python_calamine import CalamineError, CalamineWorkbook
    except ImportError as problem:
        raise _missing(path, "excel", "python-calamine") from problem
    try:
        book = CalamineWorkbook.from_filelike(io.BytesIO(data))
        sheets = {name: book.get_sheet_by_name(name) for name in book.sheet_names}
        numbers = {name: sum(isinstance(cell, int | float) for row in sheet.iter_rows() for cell in row)
                   for name, sheet in sheets.items()}
    except (CalamineError, OSError, ValueError) as problem:
        raise LogError("a workbook that is damaged", file=path, expected="an .xlsx, .xls or .ods file") from problem
    name = str(tag if tag in sheets else max(numbers, key=lambda title: numbers[title]))
    lines = list[int]()
    rows = Grid(_filled(sheets[name].iter_rows(), lines), sheets[name].width)
    others = [each for each in sheets if each != name]
    passed = f"; other sheets: {', '.join(others[:_SHOWN])} (--tag)" if others else ""
    return FormatTable((), rows, lines, [f"Workbook: sheet {name!r} read{passed}."], part=name if tag == name else "")


def _filled(rows: Iterable[Iterable[Any]], lines: list[int]) -> Iterator[list[str]]:
    """Yield the cells of the rows that are not empty, and add their numbers to a list."""
    for number, row in enumerate(rows, start=1):
        if any(cells := list(map(_cell, row))):
            lines.append(number)
            yield cells


def _arrow(path: Path, data: bytes, _: str | None) -> FormatTable:
    """Return a table of Parquet or Feather; an index that was saved with it is a column of it."""
    try:
        from pyarrow import ArrowException, feather, parquet
    except ImportError as problem:
        raise _missing(path, "parquet", "pyarrow") from problem
    try:
        kind, library = ("Parquet", parquet) if data.startswith(b"PAR1") else ("Feather", feather)
        stored = library.read_table(io.BytesIO(data))
        cells = [*map(_texts_of, stored.columns)]
    except (ArrowException, OSError, ValueError, OverflowError) as problem:
        raise LogError("a table that is damaged", file=path, expected="a whole .parquet or .feather file") from problem
    return _of_columns(path, kind, stored.column_names, cells)


def _matlab(path: Path, data: bytes, tag: str | None) -> FormatTable:
    """Return the vectors of one length of a .mat file as columns, or those of its matrix, see `_of_variables`."""
    from scipy.io import loadmat, matlab

    try:
        stored = loadmat(io.BytesIO(data), squeeze_me=True)
    except (matlab.MatReadError, zlib.error, NotImplementedError, ValueError, TypeError, OSError, LookupError,
            ArithmeticError, MemoryError) as problem:
        remedy = "a whole one, saved with -v7, or text"
        raise LogError("an unknown or damaged .mat file", file=path, expected=remedy) from problem
    return _of_variables(path, "MATLAB", ((name, value) for name, value in stored.items() if name[:2] != "__"), tag)


def _numpy(path: Path, data: bytes, tag: str | None) -> FormatTable:
    """Return the columns of an array that numpy saved, by their names if it has any."""
    try:
        stored = np.load(io.BytesIO(data), allow_pickle=False)
        variables = [(name, stored[name]) for name in stored.dtype.names or ()] or [("array", stored)]
    except (ValueError, OSError, EOFError, TypeError) as problem:
        raise LogError("damaged, or of Python's objects", file=path, expected="arrays of numbers") from problem
    return _of_variables(path, "NumPy", variables, tag)


def _of_variables(path: Path, kind: str, stored: Iterable[tuple[str, Any]], tag: str | None) -> FormatTable:
    """Return the vectors of one length as columns, or the columns of the longest matrix or of a structure."""
    variables = dict(stored)
    for name, value in list(variables.items()):
        if getattr(value, "dtype", None) is not None and value.dtype.names and value.shape == ():
            variables |= {f"{name}.{field}": value[field].item() for field in value.dtype.names}
    numbers = {name: value for name, value in variables.items() if getattr(value, "size", 0) > 1
               and value.dtype.kind in "fiub"}
    matrices = {name: value for name, value in numbers.items() if value.ndim > 1}
    vectors = {name: value for name, value in numbers.items() if value.ndim == 1}
    length = max(map(len, vectors.values()), default=0)
    longest = str(tag) if tag in matrices else max(matrices, key=lambda name: max(matrices[name].shape), default="")
    if longest and (tag == longest or max(matrices[longest].shape) > length):
        matrix = matrices[longest]
        matrix = matrix if len(matrix) >= matrix.shape[1] else matrix.T
        return _of_columns(path, kind, (), [*map(_cells_of, matrix.T.tolist())])._replace(
            part=str(tag) if tag == longest else "")
    chosen = {name: _cells_of(value.tolist()) for name, value in vectors.items() if len(value) == length}
    return _of_columns(path, kind, tuple(chosen), list(chosen.values()))


def _texts_of(column: Any) -> CellColumn:
    """Return the cells of a column of Arrow, whose own texts are made many times faster than those of Python."""
    if str(column.type).startswith(_OWN_TEXTS):
        return _cells_of(_in_parts(column))
    return CellColumn.of(_in_parts(column.cast("string").fill_null("")))


_OWN_TEXTS: Final = ("list", "large_list", "fixed_size_list", "struct", "map", "duration")


def _in_parts(column: Any) -> Iterator[Any]:
    """Yield the values of a column of Arrow; all at once they would take ten times the memory."""
    for k in range(0, len(column), _AT_ONCE):
        yield from column.slice(k, _AT_ONCE).to_pylist()


def _cells_of(values: Iterable[Any]) -> CellColumn:
    return CellColumn.of(map(_cell, values))


def _of_columns(path: Path, kind: str, names: Sequence[str], columns: Sequence[CellColumn]) -> FormatTable:
    rows = Grid.of_columns(columns)
    if not rows:
        raise LogError("a table without rows", file=path, expected="columns of time and temperature")
    return FormatTable(tuple(names), rows, range(1, len(rows) + 1), [f"{kind}: {count(len(rows), 'row')} read."])


CONTAINERS: Final = (
    BinaryFormat("workbook", (b"PK\x03\x04", b"\xd0\xcf\x11\xe0"), _workbook),
    BinaryFormat("NumPy", (b"\x93NUMPY",), _numpy),
    BinaryFormat("Parquet or Feather", (b"PAR1", b"ARROW1", b"FEA1"), _arrow),
    BinaryFormat("MATLAB", (b"MATLAB 5.0", b"MATLAB 7.3", b"\x89HDF"), _matlab))


class _Cells(HTMLParser):
    """Collects the cells of the rows of all tables, each row with its line."""

    def __init__(self) -> None:
        super().__init__()
        self.rows: list[tuple[int, list[str]]] = []
        self.within = False

    def handle_starttag(self, tag: str, _: list[tuple[str, str | None]]) -> None:
        if tag == "tr":
            self.rows.append((self.getpos()[0], []))
        elif tag in ("td", "th") and self.rows:
            self.rows[-1][1].append("")
            self.within = True

    def handle_endtag(self, tag: str) -> None:
        self.within &= tag not in ("td", "th", "tr")

    def handle_data(self, data: str) -> None:
        if self.within:
            self.rows[-1][1][-1] += data.strip()


def _html(path: Path, numbered: Sequence[Line], _: str | None) -> FormatTable:
    """Return the rows of the table with the most cells in a row that many rows have."""
    parser = _Cells()
    parser.feed("\n".join(line for _, line in numbered))
    widths = Counter(len(row) for _, row in parser.rows)
    width = max(widths, key=lambda number: number * widths[number], default=0)
    rows = [(number, row) for number, row in parser.rows if len(row) == width and any(row)]
    if width < _FEWEST:
        raise LogError("a page without a table", file=path, expected="a table of time and temperature")
    numbers = [number for number, _ in numbered]
    return FormatTable.from_rows((), [(numbers[number - 1], row) for number, row in rows],
                                 f"Table of a web page: {count(len(rows), 'row')} read.")


_FEWEST: Final = 2
_SAMPLE: Final = 50  # lines
_NEARLY_ALL: Final = 0.9
_NAME: Final = r"(?<![\w.])([^\W\d][\w.]*(?: [^\W\d][\w.]*)?)"
_VALUE: Final = r"(-?\d+(?:[.,]\d+)?(?:[eE][-+]?\d+)?)(?![\d:])"
_UNIT: Final = r" ?(?:°?[CFK]|%|[mk]?[VAW]|m?s)"
#: the time since a board was started, before a line of ESP-IDF's log [ms], or of a kernel's [s]
_UPTIME: Final = re.compile(r"[EWIDV] \((\d+)\) |\[ *(\d+\.\d+)\] ")
#: temp:20.4, output = 51 %, T1: 20.4C, and, with its unit, temperature 20.4 °C
_PAIR: Final = re.compile(rf"{_NAME}(?: ?[:=] ?{_VALUE}({_UNIT})?(?!\w)| {_VALUE}({_UNIT})(?!\w))")


def _pairs(line: str) -> list[tuple[str, str, str]]:
    return [(name, value or other, (unit or its).strip()) for name, value, unit, other, its in _PAIR.findall(line)]


def _last(lines: Sequence[Line]) -> Iterator[str]:
    return (line for _, line in lines[-_SAMPLE:])


def _has_names(lines: Sequence[Line]) -> bool:
    """Return whether nearly all lines at the end hold the same names, one a temperature's or nothing beside them."""
    names = Counter(tuple(name for name, _, _ in _pairs(line)) for line in _last(lines))
    usual, number = names.most_common(1)[0] if names else ((), 0)
    nearly_all = number > _NEARLY_ALL * len(lines[-_SAMPLE:])
    return len(usual) >= _FEWEST and nearly_all and (
        "temperature" in map(role_of, usual) or not any(map(_has_other_words, _last(lines))))


def _has_other_words(line: str) -> bool:
    """Return whether a line holds more than names with their values and a time."""
    return re.search(r"[^\W\d]", _PAIR.sub("", line)) is not None


def _named(_: Path, numbered: Sequence[Line], __: str | None) -> FormatTable:
    """Return a column for each name; the time is the stamp in the line, if there is one."""
    names = Counter(tuple(name for name, _, _ in _pairs(line)) for line in _last(numbered)).most_common(1)[0][0]
    rows, units = list[tuple[int, list[str]]](), dict[str, str]()
    for number, line in numbered:
        pairs = _pairs(line)
        if tuple(name for name, _, _ in pairs) == names:
            units |= {name: unit for name, _, unit in pairs if unit}
            uptime = _UPTIME.match(line)
            units |= {"time": "ms" if uptime[1] else "s"} if uptime is not None else {}
            rows.append((number, [(uptime[1] or uptime[2]) if uptime is not None else line_stamp(line),
                                  *(value for _, value, _ in pairs)]))
    begin = 0 if all(cells[0] for _, cells in rows) else 1
    header = [f"{name} [{units[name]}]" if name in units else name for name in ("time", *names)]
    return FormatTable.from_rows(header[begin:], [(number, cells[begin:]) for number, cells in rows],
                                 f"Lines of names and values: {count(len(rows), 'line')} read, "
                                 f"{len(numbered) - len(rows)} others passed over.")


#: before what a board prints, as the Arduino IDE shows it: 09:58:00.123 -> 20.4,51
_MONITOR: Final = re.compile(r"\s*(\d\d:\d\d:\d\d[.,]\d{3}) -> (.*)")


def _monitor(_: Path, numbered: Sequence[Line], __: str | None) -> FormatTable:
    """Return the cells of the lines of a serial monitor, behind the time that it puts before each."""
    lines = [(number, match) for number, line in numbered if (match := _MONITOR.match(line)) is not None]
    mark = next((mark for mark in "\t;," if lines and mark in lines[-1][1][2]), None)
    return FormatTable.from_rows((), [(number, [
        "time" if k == 0 and re.match(r"[^\W\d]", match[2]) else match[1].replace(",", "."), *_cells(match[2], mark)])
        for k, (number, match) in enumerate(lines)], f"Serial monitor: {count(len(lines), 'line')} read with its time.")


def _cells(text: str, mark: str | None) -> list[str]:
    return [cell.strip() for cell in text.split(mark)]


def _is_monitor(lines: Sequence[Line]) -> bool:
    return sum(_MONITOR.match(line) is not None for line in _last(lines)) > _NEARLY_ALL * len(lines[-_SAMPLE:])


#: temp_C = 20.4, temp_C: 20.4 and temp_C | 20.4 in a line of its own, as databases print a row that is too wide
_OWN_LINE: Final = re.compile(r"[- ]*([^\W\d][^:=|│]*?) *[:=|│](?: ([^|│]*))?$")


def _own_names(lines: Sequence[Line]) -> list[str]:
    """Return the names of the first record of lines that hold a value each, empty if they do not come again in turn."""
    names = [match[1] for _, line in lines[:_LONGEST] if (match := _OWN_LINE.match(line)) is not None]
    record = [*dict.fromkeys(names)]
    return record if len(record) >= _FEWEST and names[len(record):2 * len(record)] == record else []


def _records(_: Path, numbered: Sequence[Line], __: str | None) -> FormatTable:
    """Return a row for each record."""
    names, rows = _own_names(numbered), list[tuple[int, list[str]]]()
    for number, line in numbered:
        if (match := _OWN_LINE.match(line)) is not None and match[1] in names:
            if match[1] == names[0] or not rows:
                rows.append((number, [""] * len(names)))
            rows[-1][1][names.index(match[1])] = (match[2] or "").strip()
    return FormatTable.from_rows(names, rows, f"A value in each line: {count(len(rows), 'record')} read.")


_LONGEST: Final = 200


def _xml(path: Path, numbered: Sequence[Line], _: str | None) -> FormatTable:
    """Return a row for each of the most usual elements with several values: its attributes, else its children."""
    try:
        root = ElementTree.fromstring("\n".join(line for _, line in numbered))
    except ElementTree.ParseError as problem:
        raise LogError("XML that cannot be read", file=path, expected="a whole file, or its table as CSV") from problem
    usual = Counter(element.tag for element in root.iter() if max(len(element), len(element.attrib)) >= _FEWEST)
    tag = max(usual, key=usual.__getitem__, default="")
    rows = [*filter(None, map(_parts_of, root.iter(tag)))]
    names = [name for name, _ in rows[-1]] if rows else []
    header = names if len(set(names)) == len(names) else []  # else a row of the table holds them, or none
    return FormatTable.from_rows(header, [(k, [cell for _, cell in row]) for k, row in enumerate(rows, start=1)],
                                 f"XML: {count(len(rows), 'element')} {tag!r} read.")


def _parts_of(element: ElementTree.Element) -> list[tuple[str, str]]:
    """Return name and text of the children of an element, or of its attributes if it has not several children."""
    if len(element) < _FEWEST:
        return [(name, value.strip()) for name, value in element.attrib.items()]
    return [(child.get("name") or child.tag, "".join(child.itertext()).strip()) for child in element]


#: 1773482280: 2.0300000000e+01 0.0000000000e+00
_FETCHED: Final = re.compile(r"(\d{9,10}): (.+)")


def _fetch(_: Path, numbered: Sequence[Line], __: str | None) -> FormatTable:
    """Return what rrdtool fetch prints, whose first line names the sources."""
    rows = [(number, [match[1], *match[2].split()]) for number, line in numbered if (match := _FETCHED.match(line))]
    return FormatTable.from_rows(("time", *numbered[0][1].split()), rows,
                                 f"Fetch of RRDtool: {count(len(rows), 'row')} read.")


WEB_TABLES: Final = (
    TextFormat("XML", lambda lines: any(line.lstrip("\ufeff ").startswith("<?xml") for _, line in lines[:1]), _xml),
    TextFormat("fetch of RRDtool", lambda lines: len(lines) > _FEWEST and all(
        _FETCHED.match(line) for _, line in lines[1:_FEWEST + 1]), _fetch),
    TextFormat("table of a web page", lambda lines: any("<tr" in line.lower() for _, line in lines[:_SAMPLE]), _html),
    TextFormat("lines of names and values", _has_names, _named),
    TextFormat("serial monitor", _is_monitor, _monitor),
    TextFormat("records of a value in each line", lambda lines: "time" in map(role_of, _own_names(lines)), _records))
