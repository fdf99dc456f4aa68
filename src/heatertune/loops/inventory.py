"""Which loops there are: a folder of logs, and a list that says what the logs do not."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields
from pathlib import Path, PurePath
from typing import Any, Final

from heatertune.documents import read_toml
from heatertune.errors import HeatertuneError, InputError, did_you_mean
from heatertune.files import read_text
from heatertune.loops.loop_values import LoopEntry
from heatertune.plc import controller_for

__all__ = ["list_loops", "read_list"]

_KEYS: Final = tuple(field.name for field in fields(LoopEntry))
_NUMBERS: Final = ("setpoint_degC", "pwm_period_s", "low_degC", "high_degC")


def list_loops(names: Sequence[str], told: Mapping[str, LoopEntry]) -> list[LoopEntry]:
    """Return a loop for each log, by its file; what the list says of it is in the place of its name alone.

    Raises:
        InputError: the list names a file that is no log of the folder.
    """
    for file in told:
        if file not in names:
            raise InputError(f"the list names {file!r}, which is no log of the folder{did_you_mean(file, names)}")
    return [told.get(name, LoopEntry(name=str(PurePath(name).with_suffix("")), file=name)) for name in names]


def read_list(path: str | Path) -> dict[str, LoopEntry]:
    """Return file → loop of a list: a CSV table with a head, or a TOML file with one [[loop]] each.

    Raises:
        InputError: it cannot be read, or an entry is not right; the line (of a TOML file: the entry) is named.
    """
    told: dict[str, LoopEntry] = {}
    names: dict[str, str] = {}
    for where, entry in _entries(Path(path)):
        loop = _loop(entry, where)
        if loop.file in told:
            raise InputError(f"{where}: the log {loop.file!r} is listed twice; a loop has one log")
        if loop.name in names:
            raise InputError(f"{where}: the name {loop.name!r} is that of {names[loop.name]!r}, too; give another one")
        told[loop.file], names[loop.name] = loop, loop.file
    return told


def _entries(path: Path) -> Iterator[tuple[str, Mapping[str, Any]]]:
    if path.suffix.lower() == ".toml":
        document = read_toml(path)
        if set(document) != {"loop"} or not isinstance(document["loop"], list):
            raise InputError(f"{path}: expected [[loop]] entries and nothing else")
        for number, entry in enumerate(document["loop"], 1):
            if not isinstance(entry, dict):
                raise InputError(f"{path}, loop {number}: expected a table, [[loop]]")
            yield f"{path}, loop {number}", entry
        return
    try:
        text = read_text(path)
    except (OSError, UnicodeDecodeError) as problem:
        raise InputError(f"{path}: cannot be read as a list; expected CSV or TOML as UTF-8") from problem
    rows = csv.reader(io.StringIO(text), delimiter=";" if ";" in text.partition("\n")[0] else ",")
    heads = [head.strip() for head in next(rows, [])]
    for row in rows:
        where = f"{path}, line {rows.line_num}"
        if not any(cell.strip() for cell in row):
            continue
        if len(row) != len(heads):
            raise InputError(f"{where}: {len(row)} cells; expected {len(heads)}, as in the first line")
        yield where, {head: cell.strip() for head, cell in zip(heads, row, strict=True) if cell.strip()}


def _loop(entry: Mapping[str, Any], where: str) -> LoopEntry:
    for key in entry:
        if key not in _KEYS:
            raise InputError(f"{where}: unknown field {key!r}{did_you_mean(key, _KEYS)}; expected {', '.join(_KEYS)}")
    if "file" not in entry:
        raise InputError(f"{where}: no file; every loop names its log")
    values: dict[str, Any] = {
        key: _number(value, key, where) if key in _NUMBERS else str(value) for key, value in entry.items()}
    file = str(entry["file"])
    values.setdefault("name", file if "://" in file else str(PurePath(file).with_suffix("")))
    try:
        if "target" in values:
            controller_for(values["target"])
        return LoopEntry(**values)
    except HeatertuneError as problem:
        raise InputError(f"{where}: {problem}") from problem


def _number(value: Any, key: str, where: str) -> float:
    try:
        if isinstance(value, bool):
            raise TypeError
        return float(value)
    except (TypeError, ValueError):
        raise InputError(f"{where}, field {key}: no number: {value!r}") from None
