"""The controller DB as a listing to key in, as CSV (DW, format, value, comment), and as the CPU holds it."""

from __future__ import annotations

import csv
import io

from heatertune.plc.s5_ob251.image import LENGTH, to_image
from heatertune.plc.s5_ob251.ramp import ramp_listing
from heatertune.plc.s5_ob251.words import FIELDS, FULL_SCALE
from heatertune.plc.words import Certificate, Words

__all__ = ["export_words"]

_DB = 30

_CELLS = {22: ("KF", "X actual value, written by the program"), 24: ("KF", "Z disturbance variable"),
          29: ("KF", "XZ substitute for the D part"), 48: ("KF", "YA controller output, read by the program")}


def export_words(words: Words, certificate: Certificate) -> dict[str, str | bytes]:
    """Return listing, CSV, DB image and the ramp's listing; the same words and certificate give the same bytes."""
    rows = _rows(words)
    files: dict[str, str | bytes] = {
        f"DB{_DB}_listing.txt": _listing(words, certificate, rows),
        f"DB{_DB}.csv": _csv(rows),
        f"DB{_DB}.bin": to_image(words),
    }
    if words.ramp is not None:
        files["ramp_listing.txt"] = ramp_listing(words.ramp, words.sample_time_s, _DB, certificate)
    return files


def _rows(words: Words) -> list[tuple[int, str, str, str]]:
    """Return (DW, format, value, comment) for all 49 words."""
    named = {int(field.address[2:]): field for field in FIELDS}
    rows = []
    for dw in range(LENGTH):
        if dw in named:
            field = named[dw]
            rows.append((dw, field.format, _value(field.format, words.whole[field.name]),
                         f"{field.name} {_meaning(field.name, words) or field.comment}"))
        else:
            format_, comment = _CELLS.get(dw, ("KH", ""))
            rows.append((dw, format_, _value(format_, 0), comment))
    return rows


def _value(format_: str, value: int) -> str:
    if format_ == "KM":
        bits = f"{value:016b}"
        return f"{bits[:8]} {bits[8:]}"
    return f"{value:+06d}" if format_ == "KF" else f"{value:04X}"


def _meaning(name: str, words: Words) -> str:
    v, ta = words.whole, words.sample_time_s
    if name == "TI":
        return "no integral action" if not v["TI"] else f"TN = {ta * v['R'] / v['TI']:.4g} s"
    if name == "TD":
        return "no derivative action" if not v["TD"] else f"TV = {ta * v['TD'] * 1024 / v['R']:.4g} s"
    if name == "K":
        return f"K·R = {v['K'] * v['R'] / 1024**2:.5g} units per unit"
    if name == "W":
        low, span = words.scaling.low_degC, words.scaling.span_degC
        units = f"setpoint: round(({FULL_SCALE}/{span:g})·(°C − {low:g}))"
        return f"{units}, enter yours" if words.ramp is None else f"{units}, led there by ramp_listing.txt"
    return ""


def _listing(words: Words, certificate: Certificate, rows: list[tuple[int, str, str, str]]) -> str:
    s = words.scaling
    head = [
        "OB251 controller DB, a listing to key in (no STEP 5 import file)",
        f"sensor {s.low_degC:g}…{s.high_degC:g} °C = 0…{FULL_SCALE} units; output 0…{FULL_SCALE} units = 0…100 % power",
        f"call OB251 every {words.sample_time_s:g} s from a timed block (OB13), this DB opened before",
        *certificate.head,
    ]
    body = [f"{dw:4d}:  {format_} = {value};".ljust(38) + comment for dw, format_, value, comment in rows]
    return "\n".join([f"// {line}" for line in head] + [f"DB{_DB}"] + [line.rstrip() for line in body]) + "\n"


def _csv(rows: list[tuple[int, str, str, str]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["DW", "format", "value", "comment"])
    writer.writerows(rows)
    return text.getvalue()
