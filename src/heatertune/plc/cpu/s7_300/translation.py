"""The statements of the S7-300 as text of a Python function, see `heatertune.plc.cpu.statements`."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

from heatertune.plc.cpu.s7_300.real import quotient, real
from heatertune.plc.cpu.s7_300.source import Place, as_real, bits_of, constant, signed
from heatertune.plc.cpu.statements import Line, Translation

__all__ = ["Called", "Translated"]

#: runs the block of a CALL on a CPU; returns whether the next bit is asked for anew
Called = Callable[[Any], bool]

_JUMPS: Final = {"JU": None, "JC": "true", "JCN": "not true", "JOS": "os"}
_COMPARED: Final = {"==": "==", "<>": "!=", ">": ">", ">=": ">=", "<": "<", "<=": "<="}
#: what the bits of an accumulator mean to a comparison
_MEANT: Final = {"I": "signed({}, 16)", "D": "signed({}, 32)", "R": "as_real({})"}
_WHOLE: Final = {"+": "+", "-": "-", "*": "*", "A": "&"}


class Translated(Translation):
    """A block of the S7-300."""

    keep = "cpu.one, cpu.two, cpu.true, cpu.os = one, two, true, os"
    take = "one, two, true, os = cpu.one, cpu.two, cpu.true, cpu.os"

    def __init__(
        self, lines: Sequence[Line], place_of: Callable[[str], Place | None], called: Callable[[str], Called],
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
        self.names |= {
            "real": real, "quotient": quotient, "as_real": as_real, "bits_of": bits_of, "signed": signed,
            "trunc": math.trunc, "share": _share, "number": int.from_bytes}

    def ends(self, line: Line) -> str | None:
        """See `Translation`."""
        return line.operand if line.operation in _JUMPS else "" if line.operation == "BEU" else None

    def first(self, text: Sequence[str]) -> list[str]:
        """See `Translation`."""
        return ["first = True", *(["own = cpu.memory[cpu.instance]"] if any("own[" in line for line in text) else [])]

    def statement(self, at: int, line: Line) -> list[str]:  # noqa: C901, PLR0911, PLR0912 - one branch for each kind
        """See `Translation`."""
        name, operand, kind = line.operation, line.operand, line.operation[-1]
        place = self._place_of(operand) if operand else None
        match name:
            case "L":
                return [f"one, two = {self._value(place) if place else constant(operand)}, one"]
            case "T" if place:
                return [self._put(place, "one")]
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
                return ["one, two = two, one"]
            case "CALL":
                self.names[f"call_{at}"] = self._called(operand)
                return [self.keep, f"first = call_{at}(cpu) or first", self.take]
            case "SRD":
                return [f"one >>= {int(operand)}"]
            case "ITD":
                return ["one = signed(one, 16) & 0xFFFFFFFF"]
            case "DTR":
                return ["one = bits_of(real(signed(one, 32))[0])"]
            case "RND" | "TRUNC":
                return [f"one = {'round' if name == 'RND' else 'trunc'}(as_real(one)) & 0xFFFFFFFF"]
            case "/D" | "MOD":
                return [f"one = share(two, one, {name == 'MOD'})"]
            case "/R":
                return ["made, os = quotient(as_real(two), as_real(one), os)", "one = bits_of(made)"]
            case "+R" | "-R" | "*R":
                return [f"made, os = real(as_real(two) {name[0]} as_real(one), os)", "one = bits_of(made)"]
            case "+I" | "-I":
                return [f"one = one & ~0xFFFF | (two {name[0]} one) & 0xFFFF"]  # the upper half stays
            case "+D" | "-D" | "*D" | "AD":
                return [f"one = (two {_WHOLE[name[0]]} one) & 0xFFFFFFFF"]
        asks, means = _COMPARED[name[:-1]], _MEANT[kind]
        return [f"true, first = {means.format('two')} {asks} {means.format('one')}, False"]

    def _jump(self, at: int, name: str, label: str) -> list[str]:
        goes, asked = self.goes(at, label), _JUMPS[name]
        if asked is None:
            return ["first = True", *goes]
        # JC and JCN leave a true result of both
        after = "os = False" if name == "JOS" else "true = True"
        return [f"goes, first = {asked}, True", after, "if goes:", *(f" {line}" for line in goes)]

    def _bytes(self, place: Place) -> str:
        """Return what names the memory of a place; one that is nowhere is looked for when it is asked for."""
        memory = self._memory.get(place.memory)
        if memory is None:
            return f"cpu.memory[{place.memory!r}]" if place.memory else "own"
        name = f"m{list(self._memory).index(place.memory)}"
        self.names[name] = memory
        return name

    def _value(self, place: Place) -> str:
        memory, byte = self._bytes(place), place.byte
        if place.size == 0:
            return f"{memory}[{byte}] >> {place.bit} & 1"
        return f"number({memory}[{byte}:{byte + place.size}], 'big')"

    def _put(self, place: Place, value: str) -> str:
        memory, byte, size = self._bytes(place), place.byte, place.size
        if size == 0:
            mask = 1 << place.bit
            return f"{memory}[{byte}] = {memory}[{byte}] | {mask} if {value} else {memory}[{byte}] & {0xFF - mask}"
        return f"{memory}[{byte}:{byte + size}] = (int({value}) & {(1 << 8 * size) - 1}).to_bytes({size}, 'big')"


def _share(two: int, one: int, rest: bool) -> int:
    """Return quotient or remainder, cut towards zero."""
    dividend, divisor = signed(two, 32), signed(one, 32)
    share = abs(dividend) // abs(divisor) * (1 if (dividend < 0) == (divisor < 0) else -1)
    return (dividend - share * divisor if rest else share) & 0xFFFFFFFF
