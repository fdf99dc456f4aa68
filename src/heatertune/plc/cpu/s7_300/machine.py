"""A CPU that runs STL source: the statements that heatertune's own programs use, and no others.

Accumulators hold 32 bits; what they mean, a statement says. OS is set by a REAL result that is no normal number, and
cleared by JOS (Statement List for S7-300 and S7-400, reference manual).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

from heatertune.errors import InputError
from heatertune.plc.cpu.s7_300.source import LAST, MemberPlace, constant, member_places, numbered_lines, statements
from heatertune.plc.cpu.s7_300.translation import BlockCall, TranslatedBlock
from heatertune.plc.cpu.statements import Accumulators, Run, StatementLine

__all__ = ["Firmware", "S7300Cpu"]

#: what temporaries hold before they are written: anything
_JUNK: Final = b"\x5a" * 128
_WIDTHS: Final = {"X": 0, "B": 1, "W": 2, "D": 4}
_HEAD: Final = re.compile(r"(FUNCTION_BLOCK|DATA_BLOCK|FUNCTION|ORGANIZATION_BLOCK) +((?:FB|DB|FC|OB) \d+).*")
_ASSIGNED: Final = re.compile(r"(\w+) := ([^;,)]+)")

#: outputs and inputs, the words of an instance whose block is not in the source → what a call of the block does
Firmware = Callable[["S7300Cpu", dict[str, int]], None]


class _CodeBlock(NamedTuple):
    """Source of a code block: its members, its temporaries among them, and its statements."""

    members: dict[str, MemberPlace]
    lines: list[StatementLine]


class S7300Cpu(Accumulators):
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
        self.members: dict[str, dict[str, MemberPlace]] = {}
        self.words: dict[str, dict[str, int]] = {}
        self.os = False
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
        if block.startswith("F"):
            self.memory[f"L {block}"][:] = _JUNK
        self._code[block](self)

    def member(self, data: str, name: str) -> MemberPlace:
        """Return the place of a data block's member.

        Raises:
            InputError: there is none.
        """
        try:
            return self.members[data][name]
        except KeyError:
            raise InputError(f"{data}: the source has no member {name} there") from None

    def get(self, place: MemberPlace) -> int:
        """Return what stands at a place: a bit, or bytes as an unsigned number."""
        memory = self.memory[place.memory or self.instance]
        if place.size == 0:
            return memory[place.byte] >> place.bit & 1
        return int.from_bytes(memory[place.byte : place.byte + place.size], "big")

    def put(self, place: MemberPlace, value: int) -> None:
        """Write the same."""
        memory = self.memory[place.memory or self.instance]
        if place.size == 0:
            mask = 1 << place.bit
            memory[place.byte] = memory[place.byte] | mask if value else memory[place.byte] & ~mask
        else:
            memory[place.byte : place.byte + place.size] = (value % (1 << 8 * place.size)).to_bytes(place.size, "big")

    def _loaded(self, source: str) -> dict[str, _CodeBlock]:
        """Load the data blocks; return the others."""
        blocks: dict[str, _CodeBlock] = {}
        part: list[tuple[int, str]] = []
        for number, line in numbered_lines(source):
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

    def _data(self, name: str, part: list[tuple[int, str]], blocks: Mapping[str, _CodeBlock]) -> None:
        texts = [text for _, text in part]
        begin = texts.index("BEGIN")
        values = {found[1]: (number, _constant(number, found[2].strip())) for number, text in part[begin:]
                  if (found := _ASSIGNED.match(text))}
        of = next((line for line in texts if re.fullmatch(r"FB \d+", line)), None)
        self.memory[name] = bytearray(1024)
        if of is not None and of not in blocks:
            self.words[name] = {member: value for member, (_, value) in values.items()}
            return
        members = member_places(texts[:begin], name, 0) if of is None else blocks[of].members
        self.members[name] = {member: place._replace(memory=name) for member, place in members.items()}
        for member, (number, value) in values.items():
            if member not in members:
                raise InputError(f"line {number}: {member}; {name} has no such member")
            self.put(self.members[name][member], value)

    def _block(self, name: str, part: list[tuple[int, str]]) -> _CodeBlock:
        texts = [text for _, text in part]
        begin = texts.index("BEGIN")
        declared, temporary = list[str](), list[str]()
        section = declared
        for text in texts[:begin]:
            section = temporary if text == "VAR_TEMP" else declared if text.startswith("VAR") else section
            section.append(text)
        own = f"L {name}"
        self.memory[own] = bytearray(len(_JUNK))
        return _CodeBlock(member_places(declared, "", 0) | member_places(temporary, own, 0),
                          statements(part[begin + 1 : -1]))

    def _translated(self, block: _CodeBlock) -> Run:
        return TranslatedBlock(block.lines, lambda operand: self._place(block, operand),
                          lambda operand: self._call(block, operand), self.memory).run()

    def _place(self, block: _CodeBlock, operand: str) -> MemberPlace | None:
        """Return the place of an operand; None: it is a constant."""
        if operand.startswith("#"):
            return block.members[operand[1:]]
        if found := re.fullmatch(r"DB(\d+)\.DB([XBWD]) ?(\d+)(?:\.(\d))?", operand):
            return MemberPlace(f"DB {found[1]}", int(found[3]), int(found[4] or 0), _WIDTHS[found[2]])
        if found := re.fullmatch(r"(P?)([IQ])([BWD]?) ?(\d+)(?:\.(\d))?", operand):
            memory = "P" if found[1] else found[2]
            return MemberPlace(memory, int(found[4]), int(found[5] or 0), _WIDTHS[found[3] or "X"])
        return None

    def _call(self, block: _CodeBlock, operand: str) -> BlockCall:
        """Return what a CALL does."""
        called = re.match(r"((?:FB|FC) \d+)(?: , (DB \d+))?", operand)
        if called is None:
            raise InputError(f"CALL {operand!r}; expected a block, and its instance where it has one")
        name, data = called[1], called[2] or ""
        if name not in self._firmware and name not in self._blocks:
            raise LookupError(name)
        operands = [(found[1], found[2].strip()) for found in _ASSIGNED.finditer(operand)]
        places = [(member, place) for member, text in operands if (place := self._place(block, text)) is not None]
        constants = {member: constant(text) for member, text in operands if self._place(block, text) is None}
        # what is put in comes back as it was
        back = [(member, place) for member, place in places if not place.memory.startswith(("L", "P"))]

        def firmware(cpu: S7300Cpu) -> bool:
            words = cpu.words[data]
            words |= constants | {member: cpu.get(place) for member, place in places}
            cpu._firmware[name](cpu, words)
            for member, place in back:
                cpu.put(place, words[member])
            return False

        def run(cpu: S7300Cpu) -> bool:
            before, members = cpu.instance, cpu.members.get(data, {})
            for member, value in constants.items():
                cpu.put(members[member], value)
            for member, place in places:
                cpu.put(members[member], cpu.get(place))
            cpu.instance = data
            cpu.run(name)
            cpu.instance = before
            for member, place in back:
                cpu.put(place, cpu.get(members[member]))
            return True

        return firmware if name in self._firmware else run


def _constant(number: int, text: str) -> int:
    try:
        return constant(text)
    except InputError as problem:
        raise InputError(f"line {number}: {problem}") from None
