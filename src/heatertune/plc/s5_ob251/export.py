"""The controller DB as a listing to key in, as CSV (DW, format, value, comment), and as the CPU holds it."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from typing import NamedTuple

from heatertune.plc.core import Sensor, count
from heatertune.plc.cpu.letters import in_ascii
from heatertune.plc.keyed_entry import FIRST, THEN, bits, typed_words
from heatertune.plc.ramp import Number
from heatertune.plc.s5_ob251.blocks import DB
from heatertune.plc.s5_ob251.image import LENGTH, to_image
from heatertune.plc.s5_ob251.program import program_listing
from heatertune.plc.s5_ob251.step import FULL_SCALE
from heatertune.plc.words import Certificate, Words

__all__ = ["export_words"]

_CELLS = {22: ("KF", "X actual value, written by the program"), 24: ("KF", "Z disturbance variable"),
          29: ("KF", "XZ substitute for the D part"), 48: ("KF", "YA controller output, read by the program")}


class _Row(NamedTuple):
    """A data word: its number, format, what is typed first and then, comment."""

    dw: int
    format: str
    first: str
    then: str
    comment: str


def export_words(words: Words, certificate: Certificate) -> dict[str, str | bytes]:
    """Return name → content of all files; the same words and certificate give the same bytes."""
    rows, setpoint = _rows(words, certificate.setpoint_degC), certificate.setpoint_degC
    sensor = Sensor(words.scaling.low_degC, words.scaling.span_degC, FULL_SCALE)
    asked = 0 if setpoint is None else count(sensor, setpoint)
    return {
        f"DB{DB}_listing.txt": _listing(words, certificate, rows),
        f"DB{DB}.csv": _csv(rows),
        f"DB{DB}.bin": to_image(words),
        "program_listing.txt": program_listing(words, certificate, asked, [_typed(row) for row in rows]),
    }


def _rows(words: Words, setpoint_degC: float | None) -> list[_Row]:
    """Return all 49 words."""
    named = {int(row.address[2:]): row for row in typed_words(words, setpoint_degC)}
    cells = {dw: _CELLS.get(dw, ("KH", "")) for dw in range(LENGTH)}
    return [
        _Row(dw, named[dw].format, _value(named[dw].format, named[dw].first), _value(named[dw].format, named[dw].then),
             f"{named[dw].name} {named[dw].meaning}") if dw in named
        else _Row(dw, format_, _value(format_, 0), _value(format_, 0), comment)
        for dw, (format_, comment) in cells.items()]


def _value(format_: str, value: Number) -> str:
    if format_ == "KM":
        return bits(int(value))
    return f"{value:+06d}" if format_ == "KF" else f"{value:04X}"


def _listing(words: Words, certificate: Certificate, rows: Sequence[_Row]) -> str:
    s = words.scaling
    head = [
        "OB251 controller DB, a listing to key in (no STEP 5 import file)",
        f"sensor {s.low_degC:g}…{s.high_degC:g} °C = 0…{FULL_SCALE} units; output 0…{FULL_SCALE} units = 0…100 % power",
        f"call OB251 every {words.sample_time_s:g} s from a timed block (OB13), this DB opened before, as "
        "program_listing.txt does",
        *certificate.head,
        f"begin in manual: type the first column; the second where there is one, for automatic. DB{DB}.bin holds the "
        f"words of automatic, W = {words.whole['W']:+06d}",
        f"   {FIRST.ljust(27)}{THEN.ljust(27)}meaning",
    ]
    return "\n".join([*(f"// {line}" for line in head), f"DB{DB}", *(_typed(row, _then(row)) for row in rows)]) + "\n"


def _typed(row: _Row, then: str | None = None) -> str:
    """Return a data word as it is typed, with what is typed later where that is wanted."""
    later = "" if then is None else then.ljust(27)
    return f"{f'{row.dw:4d}:  {row.format} = {row.first};'.ljust(33)}{later}{row.comment}".rstrip()


def _then(row: _Row) -> str:
    return "" if row.first == row.then else f"{row.format} = {row.then};"


def _csv(rows: Sequence[_Row]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["DW", "format", FIRST, THEN, "comment"])
    writer.writerows(rows)
    return in_ascii(text.getvalue())
