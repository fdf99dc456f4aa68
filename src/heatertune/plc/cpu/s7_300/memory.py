"""The bytes of a data block, high byte first: words by their absolute addresses."""

from __future__ import annotations

import re
import struct
from collections.abc import Sequence
from typing import Final

from heatertune.errors import InputError
from heatertune.plc.ramp import Number
from heatertune.plc.words import WordField

__all__ = ["place", "read"]

#: format → struct code; BOOL is a bit of a byte, TIME a DINT in ms
_CODES: Final = {"INT": ">h", "TIME": ">i", "REAL": ">f"}

_ADDRESS: Final = re.compile(r"DB[XWD](\d+)(?:\.(\d))?")


def place(address: str) -> tuple[int, int]:
    """Return byte and bit of an address such as DBD10 or DBX0.3; the bit is 0 where none is named.

    Raises:
        InputError: it is none.
    """
    match = _ADDRESS.fullmatch(address)
    if match is None:
        raise InputError(f"{address} is no address in a data block")
    return int(match[1]), int(match[2] or 0)


def read(image: bytes, fields: Sequence[WordField], source: str) -> dict[str, Number]:
    """Return the words of a dump; a REAL is given as it stands there, be it infinite or not a number.

    Raises:
        InputError: the dump ends before the last word.
    """
    needed = max(place(field.address)[0] + _size(field) for field in fields)
    if len(image) < needed:
        raise InputError(f"{source}: {len(image)} bytes; expected {needed} or more, a whole instance data block")
    values: dict[str, Number] = {}
    for field in fields:
        byte, bit = place(field.address)
        if field.format == "BOOL":
            values[field.name] = image[byte] >> bit & 1
        else:
            values[field.name] = struct.unpack_from(_CODES[field.format], image, byte)[0]
    return values


def _size(field: WordField) -> int:
    return 1 if field.format == "BOOL" else struct.calcsize(_CODES[field.format])
