"""What an OPC UA client finds of a virtual PLC: each block as one ByteString, and in it each word by its name.

Beside the blocks stands a device zone with the names that OPC 40082-1 (temperature control devices, section 10) and OPC
40083 (plastics and rubber machinery, sections 22 and 23) give to a temperature, its setpoint and the power. These are
their names, not their types: a client that asks for a conforming device finds none.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Final

from asyncua import ua

from heatertune.errors import OutOfRange
from heatertune.live.blocks import ServedBlock
from heatertune.live.memory import OWN, OWN_CELLS, BlockMemory
from heatertune.live.word_codec import STRUCTS, Signal

__all__ = ["NodeVariable", "cells_of", "range_of"]

#: format of `struct` → type of a value
_TYPES: Final = {"B": ua.VariantType.Byte, "h": ua.VariantType.Int16, "H": ua.VariantType.UInt16,
                 "i": ua.VariantType.Int32, "I": ua.VariantType.UInt32, "f": ua.VariantType.Float,
                 "d": ua.VariantType.Double, "4s": ua.VariantType.ByteString}
_WRITTEN: Final = ("released", "heartbeat")  # by clients, of the simulator's own block
#: quantity of `Block.signals` → its name, its unit, and whether clients write it
_ZONE: Final = {
    "temperature": ("DeviceZone.Temperature.ActualValue", "°C", False),
    "setpoint": ("DeviceZone.Temperature.SetValue", "°C", True),
    "power": ("DeviceZone.ActualRegulationRatio", "%", False),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeVariable:
    """A variable: bytes of a block, and what they mean.

    Attributes:
        name: with those of what it stands in before it, dots between them.
        block: number of the block.
        part: its bytes there; None: all that there are.
        type: of its value.
        of: the value that bytes mean.
        to: the bytes of a value; None: clients do not write it. Raises `ua.UaStatusCodeError` where it has none.
        unit, span: of a quantity, and its least and largest value there.
    """

    name: str
    block: int
    part: slice | None
    type: ua.VariantType
    of: Callable[[bytes], Any]
    to: Callable[[Any], bytes] | None
    unit: str = ""
    span: tuple[float, float] = (0.0, 0.0)

    def read(self, memory: BlockMemory, index_range: str | None = None) -> ua.Variant:
        """Return the value, of a ByteString also a part.

        Raises:
            Refusal: the PLC would refuse.
            ua.UaStatusCodeError: an index range that is none.
        """
        with memory.changed:
            part = self.part or slice(0, memory.block_size(self.block))
            if index_range:
                part = self._within(part, index_range)
            found = memory.read(self.block, part.start, part.stop - part.start)
        return ua.Variant(found if index_range else self.of(found), self.type)

    def write(self, memory: BlockMemory, value: ua.Variant | None, index_range: str | None = None) -> None:
        """Write the value, or a part of a ByteString: at once or not at all.

        Raises:
            Refusal: the PLC would refuse.
            ua.UaStatusCodeError: not to be written, another type, another length, or an index range that is none.
        """
        if self.to is None:
            raise ua.uaerrors.BadNotWritable
        if value is None or value.VariantType != self.type or value.is_array or value.Value is None:
            raise ua.uaerrors.BadTypeMismatch
        content = bytes(value.Value) if index_range else self.to(value.Value)
        with memory.changed:
            part = self.part or slice(0, memory.block_size(self.block))
            if index_range:
                part = self._within(part, index_range)
            if len(content) != part.stop - part.start:
                raise ua.uaerrors.BadIndexRangeDataMismatch if index_range else ua.uaerrors.BadOutOfRange
            memory.write(self.block, part.start, content)

    def _within(self, part: slice, index_range: str) -> slice:
        if self.type != ua.VariantType.ByteString:
            raise ua.uaerrors.BadIndexRangeNoData
        first, end = range_of(index_range)
        if part.start + end > part.stop:
            raise ua.uaerrors.BadIndexRangeNoData
        return slice(part.start + first, part.start + end)


def range_of(text: str) -> tuple[int, int]:
    """Return first and end of a numeric range of one dimension (OPC 10000-4, section 7.27).

    Raises:
        ua.UaStatusCodeError: it is none.
    """
    numbers = text.split(":")
    if len(numbers) > 2 or not all(each.isascii() and each.isdigit() for each in numbers):
        raise ua.uaerrors.BadIndexRangeInvalid
    first, last = int(numbers[0]), int(numbers[-1])
    if len(numbers) == 2 and not first < last:
        raise ua.uaerrors.BadIndexRangeInvalid
    return first, last + 1


def cells_of(block: ServedBlock) -> Iterator[NodeVariable]:
    """Yield what clients find: the block, its words, the simulator's own block likewise, and the device zone."""
    for number in (block.number, OWN):
        yield NodeVariable(name=f"DB{number}", block=number, part=None, type=ua.VariantType.ByteString, of=bytes,
                           to=bytes)
    for name, place in block.words.items():
        yield _number(f"DB{block.number}.{name}", block.number, place.start, STRUCTS[place.format], written=True)
    for name, (start, code) in OWN_CELLS.items():
        yield _number(f"DB{OWN}.{name}", OWN, start, code, written=name in _WRITTEN)
    for quantity, (name, unit, written) in _ZONE.items():
        if quantity in block.signals:
            yield _quantity(name, block.number, block.signals[quantity], unit, written=written)


def _number(name: str, block: int, start: int, code: str, *, written: bool) -> NodeVariable:
    """Return the cell of a number that stands in a block."""
    form = struct.Struct(code)

    def to(value: Any) -> bytes:
        try:
            return form.pack(value)
        except (struct.error, OverflowError):
            raise ua.uaerrors.BadOutOfRange from None

    return NodeVariable(name=name, block=block, part=slice(start, start + form.size), type=_TYPES[code[1:]],
                of=lambda found: form.unpack(found)[0], to=to if written else None)


def _quantity(name: str, block: int, signal: Signal, unit: str, *, written: bool) -> NodeVariable:
    """Return the cell of a quantity that a block shows."""

    def to(value: Any) -> bytes:
        try:
            return signal.bytes_of(value)
        except OutOfRange:
            raise ua.uaerrors.BadOutOfRange from None

    part = slice(signal.start, signal.start + signal.size)
    return NodeVariable(name=name, block=block, part=part, type=ua.VariantType.Double, unit=unit, span=signal.shown,
                of=lambda found: signal.of(found, signal.start), to=to if written else None)
