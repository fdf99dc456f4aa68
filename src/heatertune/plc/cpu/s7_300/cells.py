"""A data block of the program's own: its members, where STEP 7 puts them, and its source."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Final, NamedTuple

from heatertune.plc.cpu.s7_300 import awl
from heatertune.plc.ramp import Number

__all__ = ["BlockMember", "block", "operands"]

#: type → letter of its operand, and bytes
_SIZES: Final = {"INT": ("W", 2), "DINT": ("D", 4), "REAL": ("D", 4)}


class BlockMember(NamedTuple):
    """A member of a data block: its name, type, value after loading, and meaning."""

    name: str
    type: str
    value: Number
    meaning: str


def operands(number: int, members: Sequence[BlockMember]) -> Mapping[str, str]:
    """Return name → operand in statements, as "DB101.DBX    0.0" or "DB101.DBD    4"."""
    return {member.name: f"DB{number}.{place}" for member, place in zip(members, _places(members), strict=True)}


def block(number: int, title: str, members: Sequence[BlockMember]) -> list[str]:
    """Return the source of a data block with these members."""
    places = ["".join(place.split()) for place in _places(members)]
    return [
        f"DATA_BLOCK DB {number}", f"TITLE ={title}", "VERSION : 0.1", "  STRUCT",
        *(f"    {one.name} : {one.type} ;  // {place}: {one.meaning}"
          for one, place in zip(members, places, strict=True)),
        "  END_STRUCT ;", "BEGIN", *values(members), "END_DATA_BLOCK", "",
    ]


def values(members: Sequence[BlockMember]) -> list[str]:
    """Return the assignments between BEGIN and the end of a data block."""
    return [f"  {one.name} := {_literal(one)} ;" for one in members]


def _literal(member: BlockMember) -> str:
    if member.type in ("INT", "DINT"):
        return f"{'L#' if member.type == 'DINT' else ''}{int(member.value)}"
    return awl.literal(member.type, member.value)


def _places(members: Sequence[BlockMember]) -> Iterator[str]:
    """Yield the operands: bits one after the other, all else from an even byte on."""
    byte = bit = 0
    for member in members:
        if member.type == "BOOL":
            byte, bit = (byte + 1, 0) if bit > 7 else (byte, bit)
            yield f"DBX    {byte}.{bit}"
            bit += 1
            continue
        byte, bit = byte + (1 if bit else 0), 0
        byte += byte % 2
        letter, size = _SIZES[member.type]
        yield f"DB{letter}    {byte}"
        byte += size
