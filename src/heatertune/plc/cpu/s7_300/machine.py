"""A CPU that runs STL source: the statements that heatertune's own programs use, and no others.

Accumulators hold 32 bits; what they mean, a statement says. OS is set by a REAL result that is no normal number, and
cleared by JOS (Statement List for S7-300 and S7-400, reference manual).
"""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Mapping
from typing import Any, Final, NamedTuple

from heatertune.errors import InputError
from heatertune.plc.cpu.s7_300.real import quotient, real
from heatertune.plc.cpu.s7_300.source import Place, as_real, bits_of, constant, placed, signed

__all__ = ["Cpu", "Firmware"]

_END: Final = -1
_WIDTHS: Final = {"X": 0, "B": 1, "W": 2, "D": 4}
_COMPARED: Final = {"==": operator.eq, "<>": operator.ne, ">": operator.gt, ">=": operator.ge, "<": operator.lt,
                    "<=": operator.le}
_HEAD: Final = re.compile(r"(FUNCTION_BLOCK|DATA_BLOCK|FUNCTION|ORGANIZATION_BLOCK) +((?:FB|DB|FC|OB) \d+).*")
_ASSIGNED: Final = re.compile(r"(\w+) := ([^;,)]+)")

#: outputs and inputs, the words of an instance whose block is not in the source → what a call of the block does
Firmware = Callable[["Cpu", dict[str, int]], None]
_Statement = Callable[["Cpu"], int]


class _Block(NamedTuple):
    """Source of a code block: its members, its temporaries, and its statements (label, operation, operand)."""

    members: dict[str, Place]
    lines: list[tuple[str, str, str]]


class Cpu:
    """A CPU with a source in its memory.

    Attributes:
        memory: "DB 101", "I", "Q", "P" (periphery), "L 35" (temporaries of OB35) → its bytes.
        members: "DB 101" → name of a member → its place.
        words: "DB 41", the instance of a block that is not in the source → member → value, a REAL as its bits.
    """

    def __init__(self, source: str, firmware: Mapping[str, Firmware]) -> None:
        """Take a source, and what the CPU brings along: block → what a call of it does.

        Raises:
            InputError: what is no source, or a statement that is not known here.
        """
        self.memory = {name: bytearray(1024) for name in ("I", "Q", "P")}
        self.members: dict[str, dict[str, Place]] = {}
        self.words: dict[str, dict[str, int]] = {}
        self.one = self.two = 0
        self.true = self.os = False
        self.first = True
        self.instance = ""
        self._firmware = firmware
        blocks = self._loaded(source)
        self._code = {name: self._translated(block) for name, block in blocks.items()}

    def run(self, block: str) -> None:
        """Run a block until it ends."""
        code, place = self._code[block], 0
        self.first = True
        while place != _END:
            place = code[place](self)
        self.first = True

    def get(self, place: Place) -> int:
        """Return what stands at a place: a bit, or bytes as an unsigned number."""
        memory = self.memory[place.memory or self.instance]
        if place.size == 0:
            return memory[place.byte] >> place.bit & 1
        return int.from_bytes(memory[place.byte : place.byte + place.size], "big")

    def put(self, place: Place, value: int) -> None:
        """Write the same."""
        memory = self.memory[place.memory or self.instance]
        if place.size == 0:
            mask = 1 << place.bit
            memory[place.byte] = memory[place.byte] | mask if value else memory[place.byte] & ~mask
        else:
            memory[place.byte : place.byte + place.size] = (value % (1 << 8 * place.size)).to_bytes(place.size, "big")

    def _loaded(self, source: str) -> dict[str, _Block]:
        """Load the data blocks; return the others."""
        blocks: dict[str, _Block] = {}
        part: list[str] = []
        for raw in source.splitlines():
            line = raw.partition("//")[0].strip()
            part.append(line)
            if line.startswith("END_") and line.split()[0].removeprefix("END_") in (
                    "FUNCTION_BLOCK", "DATA_BLOCK", "FUNCTION", "ORGANIZATION_BLOCK"):
                head = next(found for found in map(_HEAD.fullmatch, part) if found)
                if head[1] == "DATA_BLOCK":
                    self._data(head[2], part, blocks)
                else:
                    blocks[head[2]] = self._block(head[2], part)
                part = []
        return blocks

    def _data(self, name: str, part: list[str], blocks: Mapping[str, _Block]) -> None:
        begin = part.index("BEGIN")
        values = {found[1]: constant(found[2].strip()) for found in map(_ASSIGNED.match, part[begin:]) if found}
        of = next((line for line in part if re.fullmatch(r"FB \d+", line)), None)
        self.memory[name] = bytearray(1024)
        if of is not None and of not in blocks:
            self.words[name] = values
            return
        members = placed(part[:begin], name, 0) if of is None else blocks[of].members
        self.members[name] = {member: place._replace(memory=name) for member, place in members.items()}
        for member, value in values.items():
            self.put(self.members[name][member], value)

    def _block(self, name: str, part: list[str]) -> _Block:
        begin = part.index("BEGIN")
        declared, temporary = list[str](), list[str]()
        section = declared
        for line in part[:begin]:
            section = temporary if line == "VAR_TEMP" else declared if line.startswith("VAR") else section
            section.append(line)
        own = f"L {name}"
        self.memory[own] = bytearray(128)
        lines, text = [], " ".join(line for line in part[begin + 1 : -1] if not line.startswith(("NETWORK", "TITLE")))
        for statement in text.split(";"):
            if found := re.fullmatch(r"\s*(?:(\w+):)?\s*(\S+)\s*(.*?)\s*", statement):
                lines.append((found[1] or "", found[2], " ".join(found[3].split())))
        return _Block(placed(declared, "", 0) | placed(temporary, own, 0), lines)

    def _translated(self, block: _Block) -> list[_Statement]:
        labels = {label: place for place, (label, _, _) in enumerate(block.lines) if label}
        code = [self._statement(block, operation, operand, place + 1, labels)
                for place, (_, operation, operand) in enumerate(block.lines)]
        return [*code, lambda _: _END]

    def _place(self, block: _Block, operand: str) -> Place | None:
        """Return the place of an operand; None: it is a constant."""
        if operand.startswith("#"):
            return block.members[operand[1:]]
        if found := re.fullmatch(r"DB(\d+)\.DB([XBWD]) ?(\d+)(?:\.(\d))?", operand):
            return Place(f"DB {found[1]}", int(found[3]), int(found[4] or 0), _WIDTHS[found[2]])
        if found := re.fullmatch(r"(P?)([IQ])([BWD]?) ?(\d+)(?:\.(\d))?", operand):
            memory = "P" if found[1] else found[2]
            return Place(memory, int(found[4]), int(found[5] or 0), _WIDTHS[found[3] or "X"])
        return None

    def _statement(  # noqa: C901, PLR0911, PLR0912 - one branch for each kind of statement
        self, block: _Block, name: str, operand: str, then: int, labels: Mapping[str, int]
    ) -> _Statement:
        """Return what a statement does.

        Raises:
            InputError: it is not known here.
        """
        place = self._place(block, operand) if operand else None
        kind = name[-1]
        match name:
            case "L":
                return _load(place, then) if place else _loaded(constant(operand), then)
            case "T" if place:
                return _transfer(place, then)
            case "A" | "AN" if place:
                return _asked(place, name == "AN", then)
            case "=" | "S" | "R" if place:
                return _written(place, name, then)
            case "SET" | "CLR":
                return _set(name == "SET", then)
            case "JU" | "JC" | "JCN" | "JOS":
                return _jump(name, labels[operand], then)
            case "BEU":
                return lambda _: _END
            case "NOP":
                return lambda _: then
            case "TAK":
                return _exchange(then)
            case "CALL":
                return self._call(block, operand, then)
            case "SRD":
                return _unary(lambda one: one >> int(operand), then)
            case "ITD":
                return _unary(lambda one: signed(one, 16) % (1 << 32), then)
            case "DTR":
                return _unary(lambda one: bits_of(real(signed(one, 32))[0]), then)
            case "RND" | "TRUNC":
                whole: Callable[[float], int] = round if name == "RND" else math.trunc
                return _unary(lambda one: whole(as_real(one)) % (1 << 32), then)
            case "AD":
                return _binary(operator.and_, then)
            case "/D" | "MOD":
                return _divided(name == "MOD", then)
        if name[:-1] in _COMPARED and kind in "IDR":
            return _compare(_COMPARED[name[:-1]], kind, then)
        if name in ("+I", "-I", "+D", "-D", "*D"):
            return _whole(name[0], 16 if kind == "I" else 32, then)
        if name in ("+R", "-R", "*R", "/R"):
            return _of_reals(name[0], then)
        raise InputError(f"statement {name} {operand!r}; this is none that is known here")

    def _call(self, block: _Block, operand: str, then: int) -> _Statement:
        called = re.match(r"((?:FB|FC) \d+)(?: , (DB \d+))?", operand)
        if called is None:
            raise InputError(f"CALL {operand!r}; expected a block, and its instance where it has one")
        name, data = called[1], called[2] or ""
        given = [(found[1], self._place(block, found[2].strip()), found[2].strip())
                 for found in _ASSIGNED.finditer(operand)]

        def value(cpu: Cpu, place: Place | None, text: str) -> int:
            return constant(text) if place is None else cpu.get(place)

        def firmware(cpu: Cpu) -> int:
            cpu.words[data] |= {member: value(cpu, place, text) for member, place, text in given}
            cpu._firmware[name](cpu, cpu.words[data])
            return then

        def run(cpu: Cpu) -> int:
            before, members = cpu.instance, cpu.members.get(data, {})
            for member, place, text in given:
                cpu.put(members[member], value(cpu, place, text))
            cpu.instance = data
            cpu.run(name)
            cpu.instance = before
            for member, place, _ in given:  # what is put in comes back as it was
                if place is not None and not place.memory.startswith(("L", "P")):
                    cpu.put(place, cpu.get(members[member]))
            return then

        return firmware if name in self._firmware else run


def _load(place: Place, then: int) -> _Statement:
    def run(cpu: Cpu) -> int:
        cpu.one, cpu.two = cpu.get(place), cpu.one
        return then
    return run


def _loaded(value: int, then: int) -> _Statement:
    def run(cpu: Cpu) -> int:
        cpu.one, cpu.two = value, cpu.one
        return then
    return run


def _transfer(place: Place, then: int) -> _Statement:
    def run(cpu: Cpu) -> int:
        cpu.put(place, cpu.one)
        return then
    return run


def _asked(place: Place, negated: bool, then: int) -> _Statement:
    def run(cpu: Cpu) -> int:
        bit = bool(cpu.get(place)) != negated
        cpu.true, cpu.first = bit if cpu.first else cpu.true and bit, False
        return then
    return run


def _written(place: Place, name: str, then: int) -> _Statement:
    def run(cpu: Cpu) -> int:
        if name == "=" or cpu.true:
            cpu.put(place, int(cpu.true and name != "R"))
        cpu.first = True
        return then
    return run


def _set(value: bool, then: int) -> _Statement:
    def run(cpu: Cpu) -> int:
        cpu.true, cpu.first = value, True
        return then
    return run


def _jump(name: str, there: int, then: int) -> _Statement:
    def run(cpu: Cpu) -> int:
        goes = {"JU": True, "JC": cpu.true, "JCN": not cpu.true, "JOS": cpu.os}[name]
        if name == "JOS":
            cpu.os = False
        elif name != "JU":
            cpu.true = True  # of both
        cpu.first = True
        return there if goes else then
    return run


def _exchange(then: int) -> _Statement:
    def run(cpu: Cpu) -> int:
        cpu.one, cpu.two = cpu.two, cpu.one
        return then
    return run


def _unary(makes: Callable[[int], int], then: int) -> _Statement:
    def run(cpu: Cpu) -> int:
        cpu.one = makes(cpu.one)
        return then
    return run


def _binary(makes: Callable[[int, int], int], then: int) -> _Statement:
    def run(cpu: Cpu) -> int:
        cpu.one = makes(cpu.two, cpu.one)
        return then
    return run


def _whole(sign: str, width: int, then: int) -> _Statement:
    """Return a sum, difference or product of whole numbers; that of 16 bits leaves the upper half as it is."""
    makes = {"+": operator.add, "-": operator.sub, "*": operator.mul}[sign]
    mask = (1 << width) - 1

    def run(cpu: Cpu) -> int:
        cpu.one = cpu.one & ~mask | makes(cpu.two, cpu.one) & mask
        return then
    return run


def _divided(rest: bool, then: int) -> _Statement:
    """Return quotient or remainder, cut towards zero."""
    def run(cpu: Cpu) -> int:
        dividend, divisor = signed(cpu.two, 32), signed(cpu.one, 32)
        share = abs(dividend) // abs(divisor) * (1 if (dividend < 0) == (divisor < 0) else -1)
        cpu.one = (dividend - share * divisor if rest else share) % (1 << 32)
        return then
    return run


def _of_reals(sign: str, then: int) -> _Statement:
    makes: dict[str, Callable[[Any, Any, bool], tuple[float, bool]]] = {
        "+": lambda two, one, os: real(two + one, os), "-": lambda two, one, os: real(two - one, os),
        "*": lambda two, one, os: real(two * one, os), "/": quotient}

    def run(cpu: Cpu) -> int:
        made, cpu.os = makes[sign](as_real(cpu.two), as_real(cpu.one), cpu.os)
        cpu.one = bits_of(made)
        return then
    return run


def _compare(asks: Callable[[Any, Any], bool], kind: str, then: int) -> _Statement:
    means: Callable[[int], Any] = {
        "I": lambda bits: signed(bits, 16), "D": lambda bits: signed(bits, 32), "R": as_real}[kind]

    def run(cpu: Cpu) -> int:
        cpu.true, cpu.first = asks(means(cpu.two), means(cpu.one)), False
        return then
    return run
