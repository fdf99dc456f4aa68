"""The two-level control as a listing, as CSV of its word, and as the memory holds it (binary and Intel HEX).

The memory is this project's choice, as the document prints none: the 16 lines of the program, one byte each, then
BAND as a 16-bit number, high byte first.
"""

from __future__ import annotations

import csv
import io
from typing import Final

from heatertune.errors import InputError
from heatertune.plc.controller import Certificate, Scaling, Words
from heatertune.plc.cpu.one_bit.assembler import assemble, disassemble
from heatertune.plc.cpu.one_bit.programs import ON_OFF, ON_OFF_NAMES
from heatertune.plc.on_off.words import COUNTS, FIELDS, check_words

__all__ = ["PROGRAM", "export_words", "from_image", "intel_hex", "to_image"]

#: lines and addresses fit four bits
PROGRAM: Final = assemble(ON_OFF, ON_OFF_NAMES, operand_bits=4)

_RECORD: Final = 16  # data bytes in a line of Intel HEX


def export_words(words: Words, certificate: Certificate) -> dict[str, str | bytes]:
    """Return all files; the same words and certificate give the same bytes."""
    image = to_image(words)
    return {
        "on_off_listing.txt": _listing(words, certificate),
        "on_off_words.csv": _csv(words),
        "on_off_rom.hex": intel_hex(image),
        "on_off_rom.bin": image,
    }


def to_image(words: Words) -> bytes:
    """Return the memory: program, then BAND."""
    return PROGRAM.image + words.whole["BAND"].to_bytes(2, "big")


def from_image(image: bytes, *, sample_time_s: float, scaling: Scaling, source: str) -> Words:
    """Return the words of a memory that was read back.

    Args:
        image: 18 bytes.
        sample_time_s: scan interval [s]; the memory does not hold it.
        scaling: sensor range; the memory does not hold it either.
        source: name for error messages.

    Raises:
        InputError: another length, or another program than the two-level control.
        OutOfRange: BAND or the scan interval outside its range.
    """
    program, size = PROGRAM.image, len(PROGRAM.image) + 2
    if len(image) != size:
        raise InputError(f"{source}: {len(image)} bytes; expected {size}: {size - 2} lines of program, then BAND")
    for line, (found, expected) in enumerate(zip(image, program, strict=False)):
        if found != expected:
            raise InputError(f"{source}: line {line} of the program is {found:02X}; expected {expected:02X}")
    values = {"BAND": int.from_bytes(image[size - 2 :], "big", signed=True)}
    words = Words(target="on-off", values=values, scaling=scaling, sample_time_s=sample_time_s)
    check_words(words)
    return words


def intel_hex(image: bytes, *, start: int = 0) -> str:
    """Return bytes as Intel HEX (Hexadecimal Object File Format Specification, revision A, 1988), 8-bit records."""
    records = [
        _record(start + k, 0, image[k : k + _RECORD]) for k in range(0, len(image), _RECORD)
    ]
    return "\n".join([*records, _record(0, 1, b"")]) + "\n"


def _record(address: int, kind: int, data: bytes) -> str:
    body = bytes([len(data), *address.to_bytes(2, "big"), kind, *data])
    return f":{body.hex().upper()}{-sum(body) & 0xFF:02X}"


def _listing(words: Words, certificate: Certificate) -> str:
    scale, band = words.scaling, words.whole["BAND"]
    head = [
        "two-level control of a heater, for the bit processor of Hryniewicz and Chmiel (2012)",
        f"sensor {scale.low_degC:g}…{scale.high_degC:g} °C = 0…{COUNTS} counts in register 1 (PV)",
        f"setpoint in counts in register 0 (SP): {COUNTS}/{scale.span_degC:g}·(°C − {scale.low_degC:g}), whole part",
        f"register 2 (BAND) = {band} counts = {band * scale.span_degC / COUNTS:.3g} °C",
        f"one scan every {words.sample_time_s:g} s; output 0 (OUT) switches the heater",
        *certificate.head,
    ]
    rows = zip(disassemble(PROGRAM, ON_OFF_NAMES).splitlines(), PROGRAM.words, strict=True)
    body = [f"{line.ljust(28)}; {word >> 4:04b} {word & 15:04b}" for line, word in rows]
    return "\n".join([*(f"; {line}" for line in head), *body]) + "\n"


def _csv(words: Words) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["address", "word", "format", "value", "comment"])
    writer.writerows([f.address, f.name, f.format, words.whole[f.name], f.comment] for f in FIELDS)
    return text.getvalue()
