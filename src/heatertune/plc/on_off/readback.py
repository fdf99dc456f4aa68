"""The memory as Intel HEX, the form in which programmers of memories save what they read."""

from __future__ import annotations

import re
from typing import Final

from heatertune.errors import InputError
from heatertune.plc.on_off.export import from_image
from heatertune.plc.readback import ReadBack, lines_of, wrong

__all__ = ["from_text"]

_RECORD: Final = re.compile(r":((?:[0-9A-F]{2}){5,260})", re.IGNORECASE)
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
        data, kind = _record(content, line, source)
        if ended:
            raise wrong(source, line, "record", content, "nothing after the record of kind 01, the end")
        if kind == _DATA and int.from_bytes(data[:2], "big") != len(image):
            raise wrong(source, line, "address", data[:2].hex().upper(), f"{len(image):04X}, where the data before end")
        image += data[2:] if kind == _DATA else b""
        ended = kind == _END
    if not ended:
        raise InputError(f"{source}: no record of kind 01; expected :00000001FF as the last line")
    return ReadBack({**from_image(bytes(image), 0.0, source)})


def _record(content: str, line: int, source: str) -> tuple[bytes, int]:
    """Return address and data of a record, and its kind."""
    match = _RECORD.fullmatch(content)
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
