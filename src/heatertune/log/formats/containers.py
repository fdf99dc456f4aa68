"""Files that are no text: Excel workbooks, Parquet, Feather and MATLAB, each read by the library that knows it."""

from __future__ import annotations

import datetime as dt
import gzip
import io
import math
import zlib
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, Final

from heatertune.errors import LogError
from heatertune.log.formats.format_table import BinaryFormat, FormatTable
from heatertune.units import count
from heatertune.writing import read_beyond

__all__ = ["CONTAINERS", "decompress"]

_GZIP: Final = b"\x1f\x8b"
_MOST_UNPACKED: Final = 1 << 30
_SHOWN: Final = 8


def decompress(path: Path, data: bytes, repairs: list[str]) -> bytes:
    """Return the content of a .gz file; of a stream that was cut, what can be read.

    Raises:
        LogError: nothing can be read, or more than a gigabyte.
    """
    if not data.startswith(_GZIP):
        return data
    try:
        with gzip.open(io.BytesIO(data)) as stream:
            content = read_beyond(stream, _MOST_UNPACKED)
    except (EOFError, zlib.error, gzip.BadGzipFile) as problem:
        rest = _rest(data)
        if not rest:
            raise LogError("a compressed file that is damaged", file=path, expected="a whole .gz file") from problem
        repairs.append("The compressed file is cut off; what it holds up to there was read.")
        return rest
    if len(content) > _MOST_UNPACKED:
        raise LogError("more than 1 GB when unpacked", file=path, expected="a smaller log")
    return content


def _rest(data: bytes) -> bytes:
    """Return what can be unpacked of a stream that is cut off."""
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
        sheets = {name: book.get_sheet_by_name(name).to_python() for name in book.sheet_names}
    except (CalamineError, OSError, ValueError) as problem:
        raise LogError("a workbook that is damaged", file=path, expected="an .xlsx, .xls or .ods file") from problem
    numbers = {name: sum(isinstance(cell, int | float) for row in rows for cell in row)
               for name, rows in sheets.items()}
    name = tag if tag in sheets else max(numbers, key=lambda title: numbers[title], default="")
    rows = [(number, [_cell(cell) for cell in row]) for number, row in enumerate(sheets.get(name, ()), start=1)]
    kept = [(number, row) for number, row in rows if any(row)]
    others = [each for each in sheets if each != name]
    passed = f"; other sheets: {', '.join(others[:_SHOWN])} (--tag)" if others else ""
    return FormatTable((), [row for _, row in kept], [number for number, _ in kept],
                       [f"Workbook: sheet {name!r} read{passed}."], part=str(name) if tag == name else "")


def _arrow(path: Path, data: bytes, _: str | None) -> FormatTable:
    """Return a table of Parquet or Feather; an index that was saved with it is a column of it."""
    try:
        from pyarrow import ArrowException, feather, parquet, timestamp, types
    except ImportError as problem:
        raise _missing(path, "parquet", "pyarrow") from problem
    try:
        kind, library = ("Parquet", parquet) if data.startswith(b"PAR1") else ("Feather", feather)
        stored = library.read_table(io.BytesIO(data))
        columns = [column.cast(timestamp("us", column.type.tz), safe=False) if types.is_timestamp(column.type)
                   else column for column in stored.columns]
        cells = [column.to_pylist() for column in columns]
    except (ArrowException, OSError, ValueError, OverflowError) as problem:
        raise LogError("a table that is damaged", file=path, expected="a whole .parquet or .feather file") from problem
    return _of_columns(path, kind, stored.column_names, cells)


def _matlab(path: Path, data: bytes, tag: str | None) -> FormatTable:
    """Return the vectors of one length of a .mat file as columns, or the columns of its matrix or of a structure."""
    from scipy.io import loadmat, matlab

    try:
        stored = loadmat(io.BytesIO(data), squeeze_me=True)
    except (matlab.MatReadError, zlib.error, NotImplementedError, ValueError, TypeError, OSError, LookupError,
            ArithmeticError, MemoryError) as problem:
        wanted = "a whole one, saved with -v7, or text"
        raise LogError("an unknown or damaged .mat file", file=path, expected=wanted) from problem
    variables = {name: value for name, value in stored.items() if name[:2] != "__"}
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
        return _of_columns(path, "MATLAB", (), matrix.T.tolist())._replace(part=str(tag) if tag == longest else "")
    chosen = {name: value.tolist() for name, value in vectors.items() if len(value) == length}
    return _of_columns(path, "MATLAB", tuple(chosen), list(chosen.values()))


def _of_columns(path: Path, kind: str, names: Sequence[str], columns: Iterable[Sequence[Any]]) -> FormatTable:
    rows = [list(map(_cell, row)) for row in zip(*columns, strict=True)]
    if not rows:
        raise LogError("a table without rows", file=path, expected="columns of time and temperature")
    return FormatTable(tuple(names), rows, list(range(1, len(rows) + 1)), [f"{kind}: {count(len(rows), 'row')} read."])


CONTAINERS: Final = (
    BinaryFormat("workbook", (b"PK\x03\x04", b"\xd0\xcf\x11\xe0"), _workbook),
    BinaryFormat("Parquet or Feather", (b"PAR1", b"ARROW1", b"FEA1"), _arrow),
    BinaryFormat("MATLAB", (b"MATLAB 5.0", b"MATLAB 7.3", b"\x89HDF"), _matlab),
)
