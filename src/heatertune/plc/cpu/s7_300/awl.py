"""AWL source text of STEP 7: literals, comments, lines.

Form: Programming with STEP 7, chapter 13, STL source files: blocks that are called stand before their callers, an
instance data block after its function block; plain ASCII, CRLF. International mnemonics.
"""

from __future__ import annotations

import csv
import io
import struct
from collections.abc import Iterable

from heatertune.plc.cpu.letters import in_ascii
from heatertune.plc.ramp import Number
from heatertune.plc.words import Certificate, WordField, Words

__all__ = ["bits", "head", "literal", "real", "s5_time", "table", "text"]


def real(value: float) -> str:
    """Return a REAL literal with nine digits: enough for every single to come back."""
    mantissa, exponent = f"{value:.8e}".split("e")
    return f"{mantissa}e{int(exponent):+04d}"


def bits(value: float) -> str:
    """Return a REAL as the double word that holds it, for a transfer without any rounding."""
    return f"DW#16#{struct.pack('>f', value).hex().upper()}"


def literal(format_: str, value: Number) -> str:
    """Return a word as STEP 7 writes it in its format: BOOL, TIME (ms) or REAL."""
    if format_ == "BOOL":
        return "TRUE" if value else "FALSE"
    if format_ == "TIME":
        return f"T#{int(value)}MS"
    return real(value)


def s5_time(seconds: float) -> str | None:
    """Return an S5TIME literal, None for a time that its three digits at 10 ms, 100 ms or 1 s cannot hold."""
    ms = round(1000 * seconds)
    fits = any(ms % step == 0 and 0 < ms <= 999 * step for step in (10, 100, 1000))
    return f"S5T#{ms}MS" if fits else None


def head(title: str, words: Words, certificate: Certificate, *facts: str) -> list[str]:
    """Return the comment lines at the beginning of a source."""
    s = words.scaling
    lines = [
        title,
        f"sensor {s.low_degC:g}..{s.high_degC:g} degC = 0..27648 at the analog input; 0..27648 = 0..100 % power",
        *facts, *certificate.head,
        "STL source, international mnemonics; not tried in STEP 7",
    ]
    return [f"// {line}" for line in lines]


def text(lines: Iterable[str]) -> str:
    """Return the source: ASCII, every line ended by CRLF."""
    plain = in_ascii("\r\n".join(lines))
    return f"{plain}\r\n"


def table(fields: Iterable[WordField], words: Words) -> str:
    """Return the words as CSV: address, name, format, value, comment."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["address", "name", "format", "value", "comment"])
    writer.writerows(
        [f.address, f.name, f.format, literal(f.format, words.values[f.name]), f.comment] for f in fields
    )
    return out.getvalue()
