"""One word of a block as bytes, as somebody at a programming unit writes it, or as a client reads it."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from typing import Final, NamedTuple

from heatertune.errors import OutOfRange, UnknownName
from heatertune.plc.single_precision import single
from heatertune.plc.words import FORMATS, WordField

__all__ = ["STRUCTS", "Signal", "bytes_of", "field_of", "to_word_format"]

#: format → how its bytes stand, the high one first
STRUCTS: Final = {"INT": ">h", "KF": ">h", "KM": ">H", "WORD": ">H", "UINT": ">H", "REAL": ">f", "TIME": ">i",
                  "DINT": ">i", "UDINT": ">I", "LREAL": ">d", "BYTE": ">B"}


class Signal(NamedTuple):
    """A quantity that a block shows.

    Attributes:
        start: its first byte.
        format: of `STRUCTS`.
        raw: two numbers as they stand there.
        shown: what they mean, in the quantity's unit; the scale is straight.
        turned: whether the low one of two words comes first.
    """

    start: int
    format: str
    raw: tuple[float, float] = (0.0, 1.0)
    shown: tuple[float, float] = (0.0, 1.0)
    turned: bool = False

    @property
    def size(self) -> int:
        """Its bytes."""
        return struct.calcsize(STRUCTS[self.format])

    def of(self, content: bytes, begin: int = 0) -> float:
        """Return the quantity in bytes of the block that begin at one of its bytes."""
        own = content[self.start - begin : self.start - begin + self.size]
        found: float = struct.unpack(STRUCTS[self.format], own[2:] + own[:2] if self.turned else own)[0]
        (raw_0, raw_1), (shown_0, shown_1) = self.raw, self.shown
        return shown_0 + (found - raw_0) * (shown_1 - shown_0) / (raw_1 - raw_0)

    def bytes_of(self, quantity: float) -> bytes:
        """Return the bytes that show a quantity, or that nearest to it.

        Raises:
            OutOfRange: the format does not hold it.
        """
        (raw_0, raw_1), (shown_0, shown_1) = self.raw, self.shown
        raw = raw_0 + (quantity - shown_0) * (raw_1 - raw_0) / (shown_1 - shown_0)
        try:
            if not math.isfinite(raw):
                raise OverflowError
            return struct.pack(STRUCTS[self.format], raw if self.format == "REAL" else round(raw))
        except (struct.error, OverflowError):
            raise OutOfRange("quantity", quantity, f"one that {self.format} holds") from None


def field_of(fields: Sequence[WordField], name: str) -> WordField:
    """Return the word of a name.

    Raises:
        UnknownName: the controller has no such word.
    """
    for field in fields:
        if field.name == name:
            return field
    raise UnknownName("word", name, [field.name for field in fields])


def to_word_format(field: WordField, value: float) -> float:
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
    return struct.pack(STRUCTS[field.format], to_word_format(field, value))
