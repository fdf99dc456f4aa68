"""The statements of the S7-300 as text of a Python function, see `heatertune.plc.cpu.statements`.

An accumulator holds 32 bits, and most of what stands in one is a REAL. What a statement makes has a local name of its
own, as bits or as a number; it becomes the other one where a statement asks for that, and the accumulators themselves
are written where another part reads them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from struct import Struct
from typing import Any, Final, Literal

from heatertune.plc.cpu.s7_300.real import quotient, real
from heatertune.plc.cpu.s7_300.source import MemberPlace, as_real, bits_of, constant, signed_number
from heatertune.plc.cpu.statements import StatementLine, Translation

__all__ = ["BlockCall", "TranslatedBlock"]

#: runs the block of a CALL on a CPU; returns whether the next bit is asked for anew
BlockCall = Callable[[Any], bool]
_Form = Literal["bits", "real"]
_Slot = Literal["one", "two"]

_JUMPS: Final = {"JU": None, "JC": "true", "JCN": "not true", "JOS": "os"}
_COMPARED: Final = {"==": "==", "<>": "!=", ">": ">", ">=": ">=", "<": "<", "<=": "<="}
_WHOLE: Final = {"+": "+", "-": "-", "*": "*", "A": "&"}
#: statements that ask for ACCU 1 alone, and as what; all but T make another ACCU 1 of it
_OF_ONE: Final[Mapping[str, _Form]] = {
    "T": "bits", "SRD": "bits", "ITD": "bits", "DTR": "bits", "RND": "real", "TRUNC": "real"}
#: statements that ask for neither
_OF_NONE: Final = ("L", "TAK", "A", "AN", "=", "S", "R", "SET", "CLR", "NOP", "BEU", *_JUMPS)
_SLOTS: Final[tuple[_Slot, _Slot]] = ("one", "two")
_REAL: Final = Struct(">f")


class _Value:
    """What stands in an accumulator: text that gives its bits, or the REAL that they mean; "": not made yet."""

    def __init__(self, *, bits: str = "", real: str = "") -> None:
        self.bits, self.real = bits, real


class TranslatedBlock(Translation):
    """A block of the S7-300."""

    keep = "cpu.one, cpu.two, cpu.true, cpu.os = one, two, true, os"
    take = "one, two, true, os = cpu.one, cpu.two, cpu.true, cpu.os"

    def __init__(
        self, lines: Sequence[StatementLine], place_of: Callable[[str], MemberPlace | None],
        called: Callable[[str], BlockCall],
        memory: Mapping[str, bytearray],
    ) -> None:
        """Take a block.

        Args:
            lines: the statements.
            place_of: gives the place of an operand, None for a constant; raises LookupError for what is not there.
            called: gives what a CALL does, told its operand.
            memory: the CPU's; what stays in its place.
        """
        super().__init__(lines)
        self._place_of, self._called, self._memory = place_of, called, memory
        self._one, self._two, self._made, self._emitted = _Value(), _Value(), 0, list[str]()
        self._read = self._read_later()
        self.names |= {
            "real": real, "quotient": quotient, "as_real": as_real, "bits_of": bits_of, "signed": signed_number,
            "trunc": math.trunc, "share": _share, "number": int.from_bytes, "packed": _REAL.pack,
            "unpacked": _REAL.unpack_from}

    def ends(self, line: StatementLine) -> str | None:
        """See `Translation`."""
        return line.operand if line.operation in _JUMPS else "" if line.operation == "BEU" else None

    def first(self, text: Sequence[str]) -> list[str]:
        """See `Translation`."""
        return ["first = True", *(["own = cpu.memory[cpu.instance]"] if any("own[" in line for line in text) else [])]

    def statement(self, at: int, line: StatementLine) -> list[str]:
        """See `Translation`."""
        if at == 0 or self._is_last(at - 1):
            self._one, self._two = _Value(bits="one"), _Value(bits="two")
        self._emitted = []
        ends = self.ends(line) is not None
        if ends or line.operation == "CALL":
            self._write(at)
        self._emit(*self._carried_out(at, line))
        if line.operation == "CALL":
            self._one, self._two = _Value(bits="one"), _Value(bits="two")
        if not ends and self._is_last(at):
            self._write(at)
        return self._emitted or ["pass"]

    def _carried_out(self, at: int, line: StatementLine) -> list[str]:  # noqa: C901, PLR0911, PLR0912 - one branch for each kind
        """Return what a statement does beside what it makes of the accumulators."""
        name, operand = line.operation, line.operand
        place = self._place_of(operand) if operand else None
        match name:
            case "L":
                self._one, self._two = self._loaded(at, operand, place), self._one
            case "T" if place:
                return [self._stored(place)]
            case "A" | "AN" if place:
                bit = f"({self._value(place)}) {'==' if name == 'AN' else '!='} 0"
                return [f"true, first = {bit} if first else true and {bit}, False"]
            case "=" if place:
                return [self._put(place, "true"), "first = True"]
            case "S" | "R" if place:
                return [f"if true: {self._put(place, str(int(name == 'S')))}", "first = True"]
            case "SET" | "CLR":
                return [f"true, first = {name == 'SET'}, True"]
            case _ if name in _JUMPS:
                return self._jump(at, name, operand)
            case "BEU":
                return [self.keep, "return"]
            case "NOP":
                return ["pass"]
            case "TAK":
                self._one, self._two = self._two, self._one
            case "CALL":
                self.names[f"call_{at}"] = self._called(operand)
                return [self.keep, f"first = call_{at}(cpu) or first", self.take]
            case _ if name[:-1] in _COMPARED:
                return [self._compared(name)]
            case _:
                self._one = self._computed(name, operand)
        return []

    def _computed(self, name: str, operand: str) -> _Value:  # noqa: PLR0911 - likewise
        """Return the ACCU 1 that a statement makes of what stands in both."""
        one, two = (partial(self._as, held) for held in (self._one, self._two))
        match name:
            case "SRD":
                return self._new(f"{one('bits')} >> {int(operand)}")
            case "ITD":
                return self._new(f"signed({one('bits')}, 16) & 0xFFFFFFFF")
            case "DTR":
                return self._new_real(f"real(signed({one('bits')}, 32))", "_")
            case "RND" | "TRUNC":
                return self._new(f"{'round' if name == 'RND' else 'trunc'}({one('real')}) & 0xFFFFFFFF")
            case "/D" | "MOD":
                return self._new(f"share({two('bits')}, {one('bits')}, {name == 'MOD'})")
            case "/R":
                return self._new_real(f"quotient({two('real')}, {one('real')}, os)", "os")
            case "+R" | "-R" | "*R":
                return self._new_real(f"real({two('real')} {name[0]} {one('real')}, os)", "os")
            case "+I" | "-I":  # the upper half stays
                return self._new(f"{one('bits')} & ~0xFFFF | ({two('bits')} {name[0]} {one('bits')}) & 0xFFFF")
            case "+D" | "-D" | "*D" | "AD":
                return self._new(f"({two('bits')} {_WHOLE[name[0]]} {one('bits')}) & 0xFFFFFFFF")
        raise LookupError(name)

    def _compared(self, name: str) -> str:
        asks, kind = _COMPARED[name[:-1]], name[-1]
        if kind == "R":
            return f"true, first = {self._as(self._two, 'real')} {asks} {self._as(self._one, 'real')}, False"
        width = {"I": 16, "D": 32}[kind]
        two, one = (f"signed({self._as(held, 'bits')}, {width})" for held in (self._two, self._one))
        return f"true, first = {two} {asks} {one}, False"

    def _loaded(self, at: int, operand: str, place: MemberPlace | None) -> _Value:
        """Return what L brings: as a number where nothing asks for its bits."""
        if place is None:
            bits = constant(operand)
            meant = as_real(bits)
            return _Value(bits=str(bits), real=repr(meant) if math.isfinite(meant) else "")
        asked, stays = self._followed(at + 1, "one", self._part_of[at])
        if place.size == 4 and asked == {"real"} and not (stays and stays in self._read[self._part_of[at]]):
            return _Value(real=self._named(f"unpacked({self._bytes(place)}, {place.byte})[0]"))
        return self._new(self._value(place))

    def _stored(self, place: MemberPlace) -> str:
        """Return the text that T is."""
        held = self._one
        if place.size == 4 and not held.bits:
            return f"{self._bytes(place)}[{place.byte}:{place.byte + 4}] = packed({held.real})"
        return self._put(place, self._as(held, "bits"))

    def _as(self, held: _Value, form: _Form) -> str:
        """Return text that gives what an accumulator holds as bits or as a number."""
        if form == "bits":
            held.bits = held.bits or self._named(f"bits_of({held.real})")
            return held.bits
        held.real = held.real or self._named(f"as_real({held.bits})")
        return held.real

    def _new(self, bits: str) -> _Value:
        return _Value(bits=self._named(bits))

    def _new_real(self, made: str, status: str) -> _Value:
        self._made += 1
        self._emit(f"v{self._made}, {status} = {made}")
        return _Value(real=f"v{self._made}")

    def _named(self, text: str) -> str:
        """Give a text a local name of its own."""
        self._made += 1
        self._emit(f"v{self._made} = {text}")
        return f"v{self._made}"

    def _emit(self, *texts: str) -> None:
        self._emitted += texts

    def _write(self, at: int) -> None:
        """Write the accumulators that are read behind a part, or by what is called."""
        read = _SLOTS if self.lines[at].operation == "CALL" else self._read[self._part_of[at]]
        held: dict[_Slot, _Value] = {"one": self._one, "two": self._two}
        written = {slot: bits for slot in held if slot in read and (bits := self._as(held[slot], "bits")) != slot}
        if written:
            self._emit(f"{', '.join(written)} = {', '.join(written.values())}")

    def _is_last(self, at: int) -> bool:
        return at + 1 == len(self.lines) or self._part_of[at + 1] != self._part_of[at]

    def _followed(self, at: int, slot: _Slot | None, part: int) -> tuple[set[_Form], _Slot | None]:
        """Return as what is asked for what stands in an accumulator until its part ends, and where it stands then."""
        asked = set[_Form]()
        while slot and at < len(self.lines) and self._part_of[at] == part:
            name = self.lines[at].operation
            if name == "CALL":
                asked.add("bits")
                slot = None
            elif name == "L":
                slot = "two" if slot == "one" else None
            elif name == "TAK":
                slot = "two" if slot == "one" else "one"
            elif name in _OF_ONE:
                if slot == "one":
                    asked.add(_OF_ONE[name])
                    slot = "one" if name == "T" else None
            elif name not in _OF_NONE:
                asked.add("real" if name[-1] == "R" else "bits")
                slot = None if slot == "one" and name[:-1] not in _COMPARED else slot
            at += 1
        return asked, slot

    def _read_later(self) -> list[set[_Slot]]:
        """Return for each part which accumulators are read behind it."""
        begins = [at for at in range(len(self.lines)) if at == 0 or self._is_last(at - 1)]
        here = [{slot: self._followed(at, slot, part) for slot in _SLOTS} for part, at in enumerate(begins)]
        after = [self._after(at) for at in range(len(self.lines)) if self._is_last(at)]
        read: list[set[_Slot]] = [set() for _ in begins]
        while True:
            needed = [{slot for slot, (asked, stays) in slots.items() if asked or stays in read[part]}
                      for part, slots in enumerate(here)]
            found = [{slot for slot in _SLOTS if any(part is None or slot in needed[part] for part in parts)}
                     for parts in after]
            if found == read:
                return read
            read = found

    def _after(self, at: int) -> set[int | None]:
        """Return the parts that may follow the last statement of one; None: the block may end."""
        label = self.ends(self.lines[at])
        behind = self._part_of[at + 1] if at + 1 < len(self.lines) else None
        return {None if label == "" else behind, *([self._part_of[self.labels[label]]] if label in self.labels else [])}

    def _jump(self, at: int, name: str, label: str) -> list[str]:
        goes, asked = self.goes(at, label), _JUMPS[name]
        if asked is None:
            return ["first = True", *goes]
        # JC and JCN leave a true result of both
        after = "os = False" if name == "JOS" else "true = True"
        return [f"goes, first = {asked}, True", after, "if goes:", *(f" {line}" for line in goes)]

    def _bytes(self, place: MemberPlace) -> str:
        """Return what names the memory of a place; one that is nowhere is looked for when it is asked for."""
        memory = self._memory.get(place.memory)
        if memory is None:
            return f"cpu.memory[{place.memory!r}]" if place.memory else "own"
        if place.byte + place.size > len(memory):
            raise LookupError(place)
        name = f"m{list(self._memory).index(place.memory)}"
        self.names[name] = memory
        return name

    def _value(self, place: MemberPlace) -> str:
        memory, byte = self._bytes(place), place.byte
        if place.size == 0:
            return f"{memory}[{byte}] >> {place.bit} & 1"
        return f"number({memory}[{byte}:{byte + place.size}], 'big')"

    def _put(self, place: MemberPlace, value: str) -> str:
        memory, byte, size = self._bytes(place), place.byte, place.size
        if size == 0:
            mask = 1 << place.bit
            return f"{memory}[{byte}] = {memory}[{byte}] | {mask} if {value} else {memory}[{byte}] & {0xFF - mask}"
        return f"{memory}[{byte}:{byte + size}] = ({value} & {(1 << 8 * size) - 1}).to_bytes({size}, 'big')"


def _share(two: int, one: int, rest: bool) -> int:
    """Return quotient or remainder, cut towards zero."""
    dividend, divisor = signed_number(two, 32), signed_number(one, 32)
    share = abs(dividend) // abs(divisor) * (1 if (dividend < 0) == (divisor < 0) else -1)
    return (dividend - share * divisor if rest else share) & 0xFFFFFFFF
