"""One word of a block as bytes, as somebody at a programming unit writes it."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Final

from heatertune.errors import OutOfRange, UnknownName
from heatertune.plc.single import single
from heatertune.plc.words import FORMATS, WordField

__all__ = ["bytes_of", "checked", "field_of"]

#: format → how its bytes stand, the high one first
_STRUCTS: Final = {"INT": ">h", "KF": ">h", "KM": ">H", "WORD": ">H", "UINT": ">H", "REAL": ">f", "TIME": ">i"}


def field_of(fields: Sequence[WordField], name: str) -> WordField:
    """Return the word of a name.

    Raises:
        UnknownName: the controller has no such word.
    """
    for field in fields:
        if field.name == name:
            return field
    raise UnknownName("word", name, [field.name for field in fields])


def checked(field: WordField, value: float) -> float:
    """Return a number as the word's format has it; whatever that holds goes, as on a real PLC.

    Raises:
        OutOfRange: a number that the format does not hold.
    """
    low, high = FORMATS[field.format]
    whole = field.format != "REAL"
    if not low <= value <= high or (whole and value != int(value)):
        kind = "a whole number" if whole else "a number"
        raise OutOfRange(f"word {field.name}", value, f"{kind} {low:.9g}…{high:.9g}")
    return int(value) if whole else single(value)


def bytes_of(field: WordField, value: float) -> bytes:
    """Return a number as the word's bytes; raise OutOfRange as `checked`."""
    return struct.pack(_STRUCTS[field.format], checked(field, value))
