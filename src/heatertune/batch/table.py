"""Rows → one Parquet file, streamed in row groups, written whole or not at all."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import Any, Final

from heatertune.batch.values import Row, TableColumn
from heatertune.errors import InputError

__all__ = ["demand_parquet", "read_note", "read_rows", "write_table"]

_GROUP: Final = 4096  # rows: a few hundred kB
_NOTE: Final = b"heatertune"


def demand_parquet() -> Any:
    """Return pyarrow.

    Raises:
        InputError: it is not installed.
    """
    try:
        import pyarrow  # noqa: PLC0415 - an extra
        import pyarrow.parquet  # noqa: PLC0415
    except ImportError as problem:
        raise InputError("a Parquet table needs pyarrow: pip install 'heatertune[fleet]'") from problem
    return pyarrow


def write_table(
    path: Path, columns: Sequence[TableColumn], rows: Iterable[Row], note: Callable[[], Mapping[str, Any]]
) -> None:
    """Write a table; same rows, same bytes.

    Args:
        path: of the file; another one of this name is replaced.
        columns: every row has these, and no others.
        rows: in order; held in memory one row group at a time.
        note: JSON object kept with the table, asked for when all rows are written.

    Raises:
        InputError: the file cannot be written, or pyarrow is missing.
    """
    arrow = demand_parquet()
    kinds = {"text": arrow.string(), "float": arrow.float64(), "int": arrow.int64(), "bool": arrow.bool_()}
    schema = arrow.schema([arrow.field(c.name, kinds[c.kind], metadata={"what": c.description}) for c in columns])
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        # opened here: pyarrow takes no name that is not UTF-8
        with temporary.open("wb") as file, arrow.parquet.ParquetWriter(file, schema) as writer:
            for group in _groups(rows):
                writer.write_table(arrow.Table.from_pylist(group, schema=schema))
            writer.add_key_value_metadata({_NOTE: _bytes(json.dumps(note(), ensure_ascii=False))})
        temporary.replace(path)
    except OSError as problem:
        raise InputError(f"{path}: cannot be written: {problem.strerror or problem}") from problem
    finally:
        temporary.unlink(missing_ok=True)


def read_note(path: Path) -> dict[str, Any] | None:
    """Return the note of a table, None where there is no such table or no note in it."""
    arrow = demand_parquet()
    try:
        with path.open("rb") as file:
            notes = arrow.parquet.read_metadata(file).metadata or {}
    except (OSError, arrow.ArrowInvalid):
        return None
    return dict(json.loads(notes[_NOTE])) if _NOTE in notes else None


def read_rows(path: Path) -> list[Row]:
    """Return the rows of a table.

    Raises:
        InputError: it cannot be read, or is no Parquet file; pyarrow is missing.
    """
    arrow = demand_parquet()
    try:
        with path.open("rb") as file:
            return list(arrow.parquet.read_table(file).to_pylist())
    except (OSError, arrow.ArrowInvalid) as problem:
        raise InputError(f"{path}: no table: {problem}") from problem


def _groups(rows: Iterable[Row]) -> Iterator[list[Row]]:
    left = iter(rows)
    while group := list(islice(left, _GROUP)):
        yield [{name: _bytes(cell) if isinstance(cell, str) else cell for name, cell in row.items()} for row in group]


def _bytes(text: str) -> bytes:
    """Return a text as UTF-8; a name that is none is escaped where it is not."""
    return text.encode(errors="backslashreplace")
