"""Text → program, and back.

A line of text is a line number with a dot (which may be missing), a mnemonic, and an operand: a name, a number, or
for jumps `line` and a number. What follows a semicolon is a comment.

    0. Test R
    1. Jump(CFF=1) line15

The instruction list of the bit processor, and a program as its ROM holds it.

E. Hryniewicz, M. Chmiel, "About Programmable Logic Controller - step by step", Przegląd Elektrotechniczny 88(9a),
2012, section "PLC Programming". The codes of Load, Add, Sub and Comp are not printed; see DIFFERENCES.md.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Final, NamedTuple

from heatertune.errors import InputError, OutOfRange

__all__ = [
    "MNEMONICS",
    "OPERAND",
    "Names",
    "OneBitInstruction",
    "OneBitProgram",
    "Op",
    "Operand",
    "assemble",
    "disassemble",
    "from_image",
    "from_words",
]


_CODE_BITS: Final = 4


class Op(IntEnum):
    """Operation codes, four bits."""

    NOP = 0b0000
    TEST = 0b0001
    SET = 0b0010
    SET_IF_1 = 0b0011
    SET_IF_0 = 0b0100
    RESET = 0b0101
    RESET_IF_1 = 0b0110
    RESET_IF_0 = 0b0111
    JUMP = 0b1000
    JUMP_IF_1 = 0b1001
    JUMP_IF_0 = 0b1010
    LOAD = 0b1011
    ADD = 0b1100
    SUB = 0b1101
    COMP = 0b1110


class Operand(IntEnum):
    """What the operand of an instruction names."""

    NONE = 0
    BIT = 1
    LINE = 2
    REGISTER = 3


#: operation → mnemonic as the document writes it; Add and Sub stand there as "+" and "-"
MNEMONICS: Final[dict[Op, str]] = {
    Op.NOP: "NOP",
    Op.TEST: "Test",
    Op.SET: "Set",
    Op.SET_IF_1: "Set(CFF=1)",
    Op.SET_IF_0: "Set(CFF=0)",
    Op.RESET: "Reset",
    Op.RESET_IF_1: "Reset(CFF=1)",
    Op.RESET_IF_0: "Reset(CFF=0)",
    Op.JUMP: "Jump",
    Op.JUMP_IF_1: "Jump(CFF=1)",
    Op.JUMP_IF_0: "Jump(CFF=0)",
    Op.LOAD: "Load",
    Op.ADD: "Add",
    Op.SUB: "Sub",
    Op.COMP: "Comp",
}

#: operation → what its operand names
OPERAND: Final[dict[Op, Operand]] = (
    dict.fromkeys(Op, Operand.BIT)
    | dict.fromkeys((Op.JUMP, Op.JUMP_IF_1, Op.JUMP_IF_0), Operand.LINE)
    | dict.fromkeys((Op.NOP, Op.ADD, Op.SUB, Op.COMP), Operand.NONE)
    | {Op.LOAD: Operand.REGISTER}
)


class OneBitInstruction(NamedTuple):
    """One line: operation and operand (a bit's address, a line number, a register's address; 0 where it has none)."""

    op: Op
    operand: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class OneBitProgram:
    """The lines of a program from line 0 on; the rest of the ROM is blank, which is NOP.

    Attributes:
        operand_bits: width of addresses and line numbers; the ROM has 2^operand_bits lines.
        lines: the instructions.

    Raises:
        OutOfRange: more lines than the ROM has, an operand that is too wide.
    """

    operand_bits: int
    lines: tuple[OneBitInstruction, ...]

    def __post_init__(self) -> None:
        if len(self.lines) > self.size:
            raise OutOfRange("lines", len(self.lines), f"<= {self.size}, the lines of this ROM")
        for number, line in enumerate(self.lines):
            if not 0 <= line.operand < self.size:
                raise OutOfRange(f"operand of line {number}", line.operand, f"0…{self.size - 1}")

    @property
    def size(self) -> int:
        """Lines of the ROM."""
        return 1 << self.operand_bits

    @property
    def words(self) -> tuple[int, ...]:
        """Each line as its code word: operation code, then operand."""
        return tuple(line.op << self.operand_bits | line.operand for line in self.lines)

    @property
    def image(self) -> bytes:
        """The code words as bytes, each in as few whole bytes as hold it, high byte first."""
        return b"".join(word.to_bytes(_width(self.operand_bits), "big") for word in self.words)


def from_words(words: tuple[int, ...], operand_bits: int) -> OneBitProgram:
    """Return the program of these code words.

    Raises:
        OutOfRange: a word with a code that is no instruction, or too wide.
    """
    lines = []
    for number, word in enumerate(words):
        code, operand = word >> operand_bits, word & (1 << operand_bits) - 1
        if code not in Op.__members__.values():
            raise OutOfRange(f"code of line {number}", code, f"0…{max(Op)}")
        lines.append(OneBitInstruction(Op(code), operand))
    return OneBitProgram(operand_bits=operand_bits, lines=tuple(lines))


def from_image(image: bytes, operand_bits: int) -> OneBitProgram:
    """Return the program of a ROM image.

    Raises:
        OutOfRange: as `from_words`.
        InputError: the last word is broken.
    """
    width = _width(operand_bits)
    if len(image) % width:
        raise InputError(f"ROM image of {len(image)} bytes; expected whole words of {width} bytes")
    words = (int.from_bytes(image[k : k + width], "big") for k in range(0, len(image), width))
    return from_words(tuple(words), operand_bits)


def _width(operand_bits: int) -> int:
    return -(-(_CODE_BITS + operand_bits) // 8)


_LINE: Final = re.compile(r"(?:(?P<number>\d+)\.\s*)?(?P<mnemonic>[A-Za-z]+(?:\(CFF=[01]\))?)(?:\s+(?P<operand>.+))?")
_OPS: Final = {mnemonic: op for op, mnemonic in MNEMONICS.items()}


@dataclass(frozen=True, slots=True, kw_only=True)
class Names:
    """What a program's operands are called.

    Attributes:
        bits: name → address of an input, output, timer, counter or result of Comp.
        registers: name → address of a number.
    """

    bits: Mapping[str, int] = field(default_factory=dict)
    registers: Mapping[str, int] = field(default_factory=dict)


def assemble(text: str, names: Names, *, operand_bits: int) -> OneBitProgram:
    """Return the program of a listing.

    Raises:
        InputError: a line that cannot be understood, an unknown name, a line number out of order.
        OutOfRange: an operand or the program is too large for the ROM.
    """
    lines: list[OneBitInstruction] = []
    for row in text.splitlines():
        line = row.partition(";")[0].strip()
        if line:
            lines.append(_instruction(line, len(lines), names))
    return OneBitProgram(operand_bits=operand_bits, lines=tuple(lines))


def _instruction(line: str, number: int, names: Names) -> OneBitInstruction:
    match = _LINE.fullmatch(line)
    if match is None or match["mnemonic"] not in _OPS:
        raise InputError(f"line {number}: {line!r} is no instruction; known: {', '.join(_OPS)}")
    if match["number"] is not None and int(match["number"]) != number:
        raise InputError(f"line {number}: {line!r} is numbered {match['number']}")
    op = _OPS[match["mnemonic"]]
    kind, operand = OPERAND[op], match["operand"]
    if (operand is None) != (kind is Operand.NONE):
        wanted = "no operand" if kind is Operand.NONE else "an operand"
        raise InputError(f"line {number}: {line!r}; {match['mnemonic']} has {wanted}")
    return OneBitInstruction(op) if operand is None else OneBitInstruction(op, _operand(operand, kind, number, names))


def _operand(text: str, kind: Operand, number: int, names: Names) -> int:
    if kind is Operand.LINE:
        text = text.removeprefix("line").strip()
    table = _table(kind, names)
    if text in table:
        return table[text]
    if not text.isascii() or not text.isdigit():
        expected = ", ".join([*table, "a number"])
        raise InputError(f"line {number}: unknown operand {text!r}; expected {expected}")
    return int(text)


def _table(kind: Operand, names: Names) -> Mapping[str, int]:
    return {Operand.BIT: names.bits, Operand.REGISTER: names.registers}.get(kind, {})


def disassemble(program: OneBitProgram, names: Names | None = None) -> str:
    """Return the listing; an address that has one name goes by it, others by their number."""
    names = names or Names()
    lines = []
    for number, (op, operand) in enumerate(program.lines):
        kind = OPERAND[op]
        table = _table(kind, names)
        shared = Counter(table.values())
        called = {address: name for name, address in table.items() if shared[address] == 1}
        text = {Operand.NONE: "", Operand.LINE: f" line{operand}"}.get(kind, f" {called.get(operand, operand)}")
        lines.append(f"{number}. {MNEMONICS[op]}{text}")
    return "\n".join(lines) + "\n"
