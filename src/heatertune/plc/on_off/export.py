"""The two-level control as a listing, as CSV of its word, and as a memory image (binary and Intel HEX).

The document prints no image, so its layout is this project's choice: the 16 lines of the program, one byte each, then
BAND as a 16-bit number, high byte first.
"""

from __future__ import annotations

import csv
import io
import re
from typing import Final

from heatertune.errors import InputError
from heatertune.plc.cpu.one_bit.machine import disassemble
from heatertune.plc.cpu.one_bit.programs import ON_OFF_NAMES
from heatertune.plc.on_off.step import PROGRAM
from heatertune.plc.on_off.words import COUNTS, FIELDS
from heatertune.plc.readback import ReadBack, lines_of, wrong
from heatertune.plc.words import Certificate, Words

__all__ = ["export_words", "from_image", "from_text", "intel_hex", "setpoint_entry", "to_image"]


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


def from_image(image: bytes, _sample_time_s: float, source: str) -> dict[str, int]:
    """Return BAND from a memory of 18 bytes that was read back.

    Raises:
        InputError: another length, or another program than the two-level control.
    """
    program, size = PROGRAM.image, len(PROGRAM.image) + 2
    if len(image) != size:
        raise InputError(f"{source}: {len(image)} bytes; expected {size}: {size - 2} lines of program, then BAND")
    for line, (byte, expected) in enumerate(zip(image, program, strict=False)):
        if byte != expected:
            raise InputError(f"{source}: line {line} of the program is {byte:02X}; expected {expected:02X}")
    return {"BAND": int.from_bytes(image[size - 2 :], "big", signed=True)}


def intel_hex(image: bytes, *, start: int = 0) -> str:
    """Return bytes as Intel HEX (Hexadecimal Object File Format Specification, revision A, 1988), 8-bit records."""
    records = [_record(start + k, 0, image[k : k + _RECORD]) for k in range(0, len(image), _RECORD)]
    return "\n".join([*records, _record(0, 1, b"")]) + "\n"


def _record(address: int, kind: int, data: bytes) -> str:
    body = bytes([len(data), *address.to_bytes(2, "big"), kind, *data])
    return f":{body.hex().upper()}{-sum(body) & 0xFF:02X}"


def _listing(words: Words, certificate: Certificate) -> str:
    scale, band = words.scaling, words.whole["BAND"]
    head = [
        "two-level control of a heater, for the bit processor of Hryniewicz and Chmiel (2012)",
        f"sensor {scale.low_degC:g}…{scale.high_degC:g} °C = 0…{COUNTS} counts in register 1 (PV)",
        f"setpoint in counts in register 0 (SP): {COUNTS}/{scale.span_degC:g}·({scale.formula}), whole part",
        f"register 2 (BAND) = {band} counts = {band * scale.span_degC / COUNTS:.3g} °C",
        f"one scan every {words.sample_time_s:g} s; output 0 (OUT) switches the heater",
        "after a loss of supply: proven with output 0 off until the first scan, which switches it by this law",
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


def setpoint_entry(_words: Words, _setpoint_degC: float, units: int) -> str:
    """Return the setpoint as a person enters it, see `heatertune.plc.controller.Controller`."""
    return f"register 0 = {units}"


_READBACK_RECORD: Final = re.compile(r":((?:[0-9A-F]{2}){5,260})", re.IGNORECASE)
_DATA, _END = 0, 1


def from_text(text: str, _sample_time_s: float | None, source: str) -> ReadBack:
    """Return BAND from the records of a memory that was read back.

    Raises:
        InputError: a line that is no record or whose length, address, kind or checksum is wrong; as `from_image`.
    """
    image, ended = bytearray(), False
    for line, content in lines_of(text):
        if not content:
            continue
        data, kind = _record_readback(content, line, source)
        if ended:
            raise wrong(source, line, "record", content, "nothing after the record of kind 01, the end")
        if kind == _DATA and int.from_bytes(data[:2], "big") != len(image):
            raise wrong(source, line, "address", data[:2].hex().upper(), f"{len(image):04X}, where the data before end")
        image += data[2:] if kind == _DATA else b""
        ended = kind == _END
    if not ended:
        raise InputError(f"{source}: no record of kind 01; expected :00000001FF as the last line")
    return ReadBack({**from_image(bytes(image), 0.0, source)})


def _record_readback(content: str, line: int, source: str) -> tuple[bytes, int]:
    """Return address and data of a record, and its kind."""
    match = _READBACK_RECORD.fullmatch(content)
    if match is None:
        raise wrong(source, line, "record", content, "a record of Intel HEX such as :00000001FF")
    record = bytes.fromhex(match[1])
    if record[0] != len(record) - 5:
        raise wrong(source, line, "length", match[1][:2], f"{len(record) - 5:02X}, the number of data bytes")
    if sum(record) & 0xFF:
        raise wrong(source, line, "checksum", match[1][-2:], f"{-sum(record[:-1]) & 0xFF:02X}")
    if record[3] not in (_DATA, _END):
        raise wrong(source, line, "kind", match[1][6:8], "00 (data) or 01 (end)")
    return record[1:3] + record[4:-1], record[3]
