"""STL source files of STEP 7: statements, literals, declarations with their bits and bytes, and data blocks.

Form: Programming with STEP 7, chapter 13: called blocks stand before their callers, an instance data block after its
function block; plain ASCII, CRLF; international mnemonics.
"""

from __future__ import annotations

import csv
import io
import re
import struct
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Final, NamedTuple

from heatertune.errors import InputError
from heatertune.plc.cpu.statement_translation import StatementLine, in_ascii
from heatertune.plc.ramp import Number
from heatertune.plc.words import Certificate, WordField, Words

__all__ = [
    "LAST", "BlockMember", "MemberPlace", "as_real", "bits", "bits_of", "block", "constant", "head", "literal",
    "member_places", "numbered_lines", "operands", "real", "signed_number", "statements", "table", "text",
]


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


def head(title: str, words: Words, certificate: Certificate, *facts: str) -> list[str]:
    """Return the comment lines at the beginning of a source."""
    s = words.scaling
    lines = [
        title, f"sensor {s.low_degC:g}..{s.high_degC:g} degC = 0..27648 at the analog input; 0..27648 = 0..100 % power",
        *facts, *certificate.head, "STL source, international mnemonics; not tried in STEP 7",
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
    writer.writerows([f.address, f.name, f.format, literal(f.format, words.values[f.name]), f.comment] for f in fields)
    return out.getvalue()


#: type → letter of its operand, and bytes
_CELLS_SIZES: Final = {"INT": ("W", 2), "DINT": ("D", 4), "REAL": ("D", 4)}


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
    return literal(member.type, member.value)


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
        letter, size = _CELLS_SIZES[member.type]
        yield f"DB{letter}    {byte}"
        byte += size


#: last lines of blocks
LAST: Final = ("END_FUNCTION_BLOCK", "END_DATA_BLOCK", "END_FUNCTION", "END_ORGANIZATION_BLOCK")

_SIZES: Final = {"BOOL": 0, "BYTE": 1, "INT": 2, "WORD": 2, "DINT": 4, "TIME": 4, "REAL": 4, "DATE_AND_TIME": 8}
_STATEMENT: Final = re.compile(r"\s*(?:(\w+):)?\s*(\S+)\s*(.*?)\s*")
_DECLARED: Final = re.compile(r"(\w+) : (\w+) *(?:\[[^\]]*\] *OF \w+ *)?;")
_REAL: Final = struct.Struct(">f")
_BITS: Final = struct.Struct(">I")


class MemberPlace(NamedTuple):
    """Where something stands: the name of a memory, its first byte, its bit or none, and how many bytes."""

    memory: str
    byte: int
    bit: int
    size: int


def numbered_lines(source: str) -> Iterator[tuple[int, str]]:
    """Yield the lines and their numbers, from 1 on, without remarks and blanks around."""
    for number, line in enumerate(source.splitlines(), 1):
        yield number, line.partition("//")[0].strip()


def statements(lines: Iterable[tuple[int, str]]) -> list[StatementLine]:
    """Return the statements of a block's lines: each ends in a semicolon, and may take several of them.

    Raises:
        InputError: a line after which none ends.
    """
    parts, first_line, text = list[StatementLine](), 0, ""
    for number, line in lines:
        if not line or (not text and line.startswith(("NETWORK", "TITLE"))):
            continue
        first_line, text = (first_line, f"{text} {line}") if text else (number, line)
        *whole, text = text.split(";")
        parts += [_statement(first_line, each) for each in whole]
        first_line, text = number, text.strip()
    if text:
        raise InputError(f"line {first_line}: {text!r}; expected a semicolon")
    return parts


def _statement(number: int, text: str) -> StatementLine:
    parts = _STATEMENT.fullmatch(text)
    if parts is None:
        raise InputError(f"line {number}: {text.strip()!r}; this is no statement")
    return StatementLine(number, parts[1] or "", parts[2], " ".join(parts[3].split()))


def as_real(pattern: int) -> float:
    """Return the REAL that 32 bits hold."""
    value: float = _REAL.unpack(_BITS.pack(pattern))[0]
    return value


def bits_of(value: float) -> int:
    """Return the 32 bits of a REAL."""
    pattern: int = _BITS.unpack(_REAL.pack(value))[0]
    return pattern


def signed_number(value: int, width: int) -> int:
    """Return the number that so many bits hold."""
    return (value + (1 << width - 1)) % (1 << width) - (1 << width - 1)


def member_places(lines: list[str], memory: str, byte: int) -> dict[str, MemberPlace]:
    """Return the places of declared members: bits one after the other, all else from an even byte on."""
    members, bit = {}, 0
    for line in lines:
        match = _DECLARED.match(line)
        if match is None:
            continue
        size = _SIZES.get(match[2], 20)
        if size == 0:
            byte, bit = (byte + 1, 0) if bit > 7 else (byte, bit)
            members[match[1]] = MemberPlace(memory, byte, bit, 0)
            bit += 1
            continue
        byte, bit = byte + (1 if bit else 0), 0
        byte += byte % 2 if size > 1 else 0
        members[match[1]] = MemberPlace(memory, byte, 0, size)
        byte += size
    return members


def constant(text: str) -> int:
    """Return the bits of a literal; a whole one without L# has 16.

    Raises:
        InputError: it is none that is known here.
    """
    if text in ("TRUE", "FALSE"):
        return int(text == "TRUE")
    if match := re.fullmatch(r"T#(\d+)MS", text):
        return int(match[1])
    if text.startswith("DW#16#"):
        return int(text[6:], 16)
    if text.startswith("L#"):
        return int(text[2:]) % (1 << 32)
    if re.fullmatch(r"-?\d+", text):
        return int(text) % (1 << 16)
    try:
        return bits_of(float(text))
    except ValueError:
        raise InputError(f"{text!r}; this is no operand that is known here") from None
