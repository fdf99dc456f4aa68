"""The controller DB as a listing to key in, as CSV (DW, format, value, comment), and as the CPU holds it."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from typing import NamedTuple

from heatertune.plc.ramp import Number
from heatertune.plc.s5_ob251.image import LENGTH, to_image
from heatertune.plc.s5_ob251.ramp import ramp_listing
from heatertune.plc.s5_ob251.start_up import start_up_listing
from heatertune.plc.s5_ob251.step import FULL_SCALE
from heatertune.plc.typed import FIRST, THEN, bits, typed_words
from heatertune.plc.words import Certificate, Words

__all__ = ["export_words"]

_DB = 30

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
    rows = _rows(words, certificate.setpoint_degC)
    files: dict[str, str | bytes] = {
        f"DB{_DB}_listing.txt": _listing(words, certificate, rows),
        f"DB{_DB}.csv": _csv(rows),
        f"DB{_DB}.bin": to_image(words),
        "start_up_listing.txt": start_up_listing(_DB, certificate),
    }
    if words.ramp is not None:
        files["ramp_listing.txt"] = ramp_listing(words.ramp, words.sample_time_s, _DB, certificate)
    return files


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
        f"call OB251 every {words.sample_time_s:g} s from a timed block (OB13), this DB opened before",
        *certificate.head,
        f"begin in manual: type the first column; the second where there is one, for automatic. DB{_DB}.bin holds the "
        f"words of automatic, W = {words.whole['W']:+06d}",
        f"   {FIRST.ljust(27)}{THEN.ljust(27)}meaning",
    ]
    body = [f"{f'{row.dw:4d}:  {row.format} = {row.first};'.ljust(33)}{_then(row).ljust(27)}{row.comment}".rstrip()
            for row in rows]
    return "\n".join([*(f"// {line}" for line in head), f"DB{_DB}", *body]) + "\n"


def _then(row: _Row) -> str:
    return "" if row.first == row.then else f"{row.format} = {row.then};"


def _csv(rows: Sequence[_Row]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["DW", "format", FIRST, THEN, "comment"])
    writer.writerows(rows)
    return text.getvalue()
