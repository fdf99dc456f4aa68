"""A recorded sequence of raw inputs through a controller: the way to hold it against a trace of a real PLC."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path

from heatertune.errors import LogError
from heatertune.plc.controller import Controller
from heatertune.plc.core import Scan
from heatertune.plc.ramp import Number
from heatertune.plc.single_precision import single
from heatertune.plc.words import FLOATS, FORMATS, Words, holds
from heatertune.writing import read_bytes

__all__ = ["powers", "read_inputs", "replay"]


def replay(
    controller: Controller, words: Words, rows: Sequence[Mapping[str, Number]],
    switches: Mapping[str, str] | None = None,
) -> list[Scan]:
    """Return the result of each scan, from the cold state on.

    Args:
        controller: what computes.
        words: its words.
        rows: input name → value in the controller's units, one mapping per scan; see `Controller.inputs`.
        switches: settings of what the manual leaves open; those not named have their default.

    Raises:
        OutOfRange: a word the controller does not allow.
        UnknownName: a switch or setting the controller does not have.
    """
    controller.check(words)
    state, scans = controller.start(words, switches or {}), []
    for row in rows:
        state, scan = controller.scan(state, row)
        scans.append(scan)
    return scans


def powers(
    controller: Controller, words: Words, temperatures_degC: Sequence[float], setpoints_degC: Sequence[float],
    switches: Mapping[str, str] | None = None,
) -> list[float]:
    """Return the power from each scan to the next [%], from the cold state on, one scan per temperature.

    Args:
        controller: as in `replay`.
        words: as there.
        temperatures_degC: the readings [°C].
        setpoints_degC: as many setpoints [°C].
        switches: as in `replay`.

    Raises:
        OutOfRange, UnknownName: as `replay` and `RunningController`.
    """
    return [*map(controller.instantiate(words, switches or {}), temperatures_degC, setpoints_degC)]


def read_inputs(path: str | Path, controller: Controller) -> list[dict[str, Number]]:
    """Return the rows of a CSV file with a header of input names.

    Raises:
        LogError: the file cannot be read, a needed column is missing, one is unknown, a cell is not of its format.
    """
    try:
        table = list(csv.reader(io.StringIO(read_bytes(path).decode("utf-8-sig"), newline="")))
    except (OSError, UnicodeDecodeError, csv.Error) as problem:
        raise LogError(f"cannot be read: {getattr(problem, 'strerror', None) or 'no text'}", file=path) from problem
    header = [name.strip() for name in table[0]] if table else []
    needed, others = list(controller.inputs)[:2], list(controller.inputs)[2:]
    expected = f"{', '.join(needed)} and, if wanted, {', '.join(others)}"
    if not set(needed) <= set(header) or not set(header) <= set(controller.inputs):
        raise LogError(f"the columns are {', '.join(header) or 'none'}", file=path, line=1, expected=expected)
    if len(set(header)) < len(header):
        twice = next(name for name in header if header.count(name) > 1)
        raise LogError(f"the column {twice} is there twice", file=path, line=1, expected="each once")
    rows = []
    for line, cells in enumerate(table[1:], start=2):
        if len(cells) != len(header):
            raise LogError(f"{len(cells)} cells in this row", file=path, line=line, expected=str(len(header)))
        pairs = zip(header, cells, strict=True)
        rows.append({name: _number(path, line, name, cell, controller) for name, cell in pairs})
    return rows


def _number(path: str | Path, line: int, name: str, cell: str, controller: Controller) -> Number:
    value: Number | None
    format_ = controller.inputs[name]
    low, high = controller.input_ranges.get(name, FORMATS[format_])
    try:
        value = single(float(cell)) if format_ == "REAL" else float(cell) if format_ in FLOATS else int(cell)
    except ValueError:
        value = None
    if value is None or not holds(format_, value) or not low <= value <= high:
        expected = f"{format_}, a {'' if format_ in FLOATS else 'whole '}number {low:.9g}…{high:.9g}"
        raise LogError("no input:", file=path, line=line, column=name, value=cell, expected=expected)
    return value
