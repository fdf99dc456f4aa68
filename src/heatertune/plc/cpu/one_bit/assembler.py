"""Text → program, and back.

A line of text is a line number with a dot (which may be missing), a mnemonic, and an operand: a name, a number, or
for jumps `line` and a number. What follows a semicolon is a comment.

    0. Test R
    1. Jump(CFF=1) line15
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from heatertune.errors import InputError
from heatertune.plc.cpu.one_bit.instructions import MNEMONICS, OPERAND, OneBitInstruction, OneBitProgram, Operand

__all__ = ["Names", "assemble", "disassemble"]

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
