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
from heatertune.plc.cpu.s7_300.source import (
    LAST,
    Place,
    as_real,
    bits_of,
    constant,
    numbered,
    placed,
    signed,
    statements,
)
from heatertune.plc.cpu.statements import (
    END,
    Accumulators,
    Line,
    Statement,
    carry_out,
    exchange,
    jump,
    load,
    transfer,
)

__all__ = ["Cpu", "Firmware"]

#: what temporaries hold before they are written: anything
_JUNK: Final = b"\x5a" * 128
_WIDTHS: Final = {"X": 0, "B": 1, "W": 2, "D": 4}
_COMPARED: Final = {"==": operator.eq, "<>": operator.ne, ">": operator.gt, ">=": operator.ge, "<": operator.lt,
                    "<=": operator.le}
_HEAD: Final = re.compile(r"(FUNCTION_BLOCK|DATA_BLOCK|FUNCTION|ORGANIZATION_BLOCK) +((?:FB|DB|FC|OB) \d+).*")
_ASSIGNED: Final = re.compile(r"(\w+) := ([^;,)]+)")

#: outputs and inputs, the words of an instance whose block is not in the source → what a call of the block does
Firmware = Callable[["Cpu", dict[str, int]], None]


class _Block(NamedTuple):
    """Source of a code block: its members, its temporaries among them, and its statements."""

    members: dict[str, Place]
    lines: list[Line]


class Cpu(Accumulators):
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
        super().__init__()
        self.memory = {name: bytearray(1024) for name in ("I", "Q", "P")}
        self.members: dict[str, dict[str, Place]] = {}
        self.words: dict[str, dict[str, int]] = {}
        self.os = False
        self.first = True
        self.instance = ""
        self._firmware = firmware
        self._blocks = self._loaded(source)
        self._code = {name: self._translated(block) for name, block in self._blocks.items()}

    def run(self, block: str) -> None:
        """Run a block until it ends.

        Raises:
            InputError: there is none, or a statement at which the CPU would stop.
        """
        if block not in self._code:
            raise InputError(f"{block}: the source has no such block")
        self.first = True
        if block.startswith("F"):
            self.memory[f"L {block}"][:] = _JUNK
        carry_out(self, self._code[block], self._blocks[block].lines)
        self.first = True

    def member(self, data: str, name: str) -> Place:
        """Return the place of a data block's member.

        Raises:
            InputError: there is none.
        """
        try:
            return self.members[data][name]
        except KeyError:
            raise InputError(f"{data}: the source has no member {name} there") from None

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
        part: list[tuple[int, str]] = []
        for number, line in numbered(source):
            part.append((number, line))
            if line in LAST:
                head = next((found for _, text in part if (found := _HEAD.fullmatch(text))), None)
                if head is None or all(text != "BEGIN" for _, text in part):
                    raise InputError(f"line {number}: {line}; expected its head and BEGIN before")
                if head[1] == "DATA_BLOCK":
                    self._data(head[2], part, blocks)
                else:
                    blocks[head[2]] = self._block(head[2], part)
                part = []
        return blocks

    def _data(self, name: str, part: list[tuple[int, str]], blocks: Mapping[str, _Block]) -> None:
        texts = [text for _, text in part]
        begin = texts.index("BEGIN")
        values = {found[1]: (number, _constant(number, found[2].strip())) for number, text in part[begin:]
                  if (found := _ASSIGNED.match(text))}
        of = next((line for line in texts if re.fullmatch(r"FB \d+", line)), None)
        self.memory[name] = bytearray(1024)
        if of is not None and of not in blocks:
            self.words[name] = {member: value for member, (_, value) in values.items()}
            return
        members = placed(texts[:begin], name, 0) if of is None else blocks[of].members
        self.members[name] = {member: place._replace(memory=name) for member, place in members.items()}
        for member, (number, value) in values.items():
            if member not in members:
                raise InputError(f"line {number}: {member}; {name} has no such member")
            self.put(self.members[name][member], value)

    def _block(self, name: str, part: list[tuple[int, str]]) -> _Block:
        texts = [text for _, text in part]
        begin = texts.index("BEGIN")
        declared, temporary = list[str](), list[str]()
        section = declared
        for text in texts[:begin]:
            section = temporary if text == "VAR_TEMP" else declared if text.startswith("VAR") else section
            section.append(text)
        own = f"L {name}"
        self.memory[own] = bytearray(len(_JUNK))
        return _Block(placed(declared, "", 0) | placed(temporary, own, 0), statements(part[begin + 1 : -1]))

    def _translated(self, block: _Block) -> list[Statement[Cpu]]:
        labels = {line.label: place for place, line in enumerate(block.lines) if line.label}
        code = list[Statement[Cpu]]()
        for place, line in enumerate(block.lines):
            try:
                code.append(self._statement(block, line, place + 1, labels))
            except (InputError, LookupError, ValueError):
                raise InputError(f"{line}; this is none that is known here") from None
        return [*code, jump(END, 0)]

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
        self, block: _Block, line: Line, then: int, labels: Mapping[str, int]
    ) -> Statement[Cpu]:
        """Return what a statement does.

        Raises:
            InputError, LookupError, ValueError: it, or its operand, is not known here.
        """
        name, operand = line.operation, line.operand
        place = self._place(block, operand) if operand else None
        kind = name[-1]
        match name:
            case "L":
                return load(_value(place) if place else _always(constant(operand)), then)
            case "T" if place:
                return transfer(_to(place), then)
            case "A" | "AN" if place:
                return _asked(place, name == "AN", then)
            case "=" | "S" | "R" if place:
                return _written(place, name, then)
            case "SET" | "CLR":
                return _set(name == "SET", then)
            case "JU" | "JC" | "JCN" | "JOS":
                return _jump(name, labels[operand], then)
            case "BEU":
                return jump(END, then)
            case "NOP":
                return jump(then, then)
            case "TAK":
                return exchange(then)
            case "CALL":
                return self._call(block, operand, then)
            case "SRD":
                places = int(operand)
                return _unary(lambda one: one >> places, then)
            case "ITD":
                return _unary(lambda one: signed(one, 16) % (1 << 32), then)
            case "DTR":
                return _unary(lambda one: bits_of(real(signed(one, 32))[0]), then)
            case "RND" | "TRUNC":
                whole: Callable[[float], int] = round if name == "RND" else math.trunc
                return _unary(lambda one: whole(as_real(one)) % (1 << 32), then)
            case "/D" | "MOD":
                return _divided(name == "MOD", then)
        if name[:-1] in _COMPARED and kind in "IDR":
            return _compare(_COMPARED[name[:-1]], kind, then)
        if name in ("+I", "-I", "+D", "-D", "*D", "AD"):
            return _whole(name[0], 16 if kind == "I" else 32, then)
        if name in ("+R", "-R", "*R", "/R"):
            return _of_reals(name[0], then)
        raise LookupError(name)

    def _call(self, block: _Block, operand: str, then: int) -> Statement[Cpu]:
        called = re.match(r"((?:FB|FC) \d+)(?: , (DB \d+))?", operand)
        if called is None:
            raise InputError(f"CALL {operand!r}; expected a block, and its instance where it has one")
        name, data = called[1], called[2] or ""
        if name not in self._firmware and name not in self._blocks:
            raise LookupError(name)
        given = [(found[1], self._place(block, found[2].strip()), found[2].strip())
                 for found in _ASSIGNED.finditer(operand)]

        def value(cpu: Cpu, place: Place | None, text: str) -> int:
            return constant(text) if place is None else cpu.get(place)

        def back(cpu: Cpu, after: Callable[[str], int]) -> None:
            for member, place, _ in given:  # what is put in comes back as it was
                if place is not None and not place.memory.startswith(("L", "P")):
                    cpu.put(place, after(member))

        def firmware(cpu: Cpu) -> int:
            cpu.words[data] |= {member: value(cpu, place, text) for member, place, text in given}
            cpu._firmware[name](cpu, cpu.words[data])
            back(cpu, lambda member: cpu.words[data][member])
            return then

        def run(cpu: Cpu) -> int:
            before, members = cpu.instance, cpu.members.get(data, {})
            for member, place, text in given:
                cpu.put(members[member], value(cpu, place, text))
            cpu.instance = data
            cpu.run(name)
            cpu.instance = before
            back(cpu, lambda member: cpu.get(members[member]))
            return then

        return firmware if name in self._firmware else run


def _constant(number: int, text: str) -> int:
    try:
        return constant(text)
    except InputError as problem:
        raise InputError(f"line {number}: {problem}") from None


def _always(value: int) -> Callable[[Cpu], int]:
    return lambda _: value


def _value(place: Place) -> Callable[[Cpu], int]:
    name, byte, end = place.memory, place.byte, place.byte + place.size
    if not name or not place.size:
        return lambda cpu: cpu.get(place)
    return lambda cpu: int.from_bytes(cpu.memory[name][byte:end], "big")


def _to(place: Place) -> Callable[[Cpu, int], None]:
    return lambda cpu, value: cpu.put(place, value)


def _asked(place: Place, negated: bool, then: int) -> Statement[Cpu]:
    def run(cpu: Cpu) -> int:
        bit = bool(cpu.get(place)) != negated
        cpu.true, cpu.first = bit if cpu.first else cpu.true and bit, False
        return then
    return run


def _written(place: Place, name: str, then: int) -> Statement[Cpu]:
    def run(cpu: Cpu) -> int:
        if name == "=" or cpu.true:
            cpu.put(place, int(cpu.true and name != "R"))
        cpu.first = True
        return then
    return run


def _set(value: bool, then: int) -> Statement[Cpu]:
    def run(cpu: Cpu) -> int:
        cpu.true, cpu.first = value, True
        return then
    return run


def _jump(name: str, there: int, then: int) -> Statement[Cpu]:
    def always(cpu: Cpu) -> int:
        cpu.first = True
        return there

    def overflow(cpu: Cpu) -> int:
        goes, cpu.os, cpu.first = cpu.os, False, True
        return there if goes else then

    def asked(cpu: Cpu) -> int:
        goes, cpu.true, cpu.first = cpu.true == wanted, True, True  # the result of both is true
        return there if goes else then

    wanted = name == "JC"
    return {"JU": always, "JOS": overflow}.get(name, asked)


def _unary(makes: Callable[[int], int], then: int) -> Statement[Cpu]:
    def run(cpu: Cpu) -> int:
        cpu.one = makes(cpu.one)
        return then
    return run


def _whole(sign: str, width: int, then: int) -> Statement[Cpu]:
    """Return what whole numbers give together; of 16 bits it leaves the upper half as it is."""
    makes = {"+": operator.add, "-": operator.sub, "*": operator.mul, "A": operator.and_}[sign]
    mask = (1 << width) - 1

    def run(cpu: Cpu) -> int:
        cpu.one = cpu.one & ~mask | makes(cpu.two, cpu.one) & mask
        return then
    return run


def _divided(rest: bool, then: int) -> Statement[Cpu]:
    """Return quotient or remainder, cut towards zero."""
    def run(cpu: Cpu) -> int:
        dividend, divisor = signed(cpu.two, 32), signed(cpu.one, 32)
        share = abs(dividend) // abs(divisor) * (1 if (dividend < 0) == (divisor < 0) else -1)
        cpu.one = (dividend - share * divisor if rest else share) % (1 << 32)
        return then
    return run


def _of_reals(sign: str, then: int) -> Statement[Cpu]:
    makes: dict[str, Callable[[Any, Any, bool], tuple[float, bool]]] = {
        "+": lambda two, one, os: real(two + one, os), "-": lambda two, one, os: real(two - one, os),
        "*": lambda two, one, os: real(two * one, os), "/": quotient}

    def run(cpu: Cpu) -> int:
        made, cpu.os = makes[sign](as_real(cpu.two), as_real(cpu.one), cpu.os)
        cpu.one = bits_of(made)
        return then
    return run


def _compare(asks: Callable[[Any, Any], bool], kind: str, then: int) -> Statement[Cpu]:
    means: Callable[[int], Any] = {
        "I": lambda bits: signed(bits, 16), "D": lambda bits: signed(bits, 32), "R": as_real}[kind]

    def run(cpu: Cpu) -> int:
        cpu.true, cpu.first = asks(means(cpu.two), means(cpu.one)), False
        return then
    return run
