"""The statements of a block as one Python function of the CPU: accumulators and status bits are its local names.

What stands between two jumps is a part. The function goes through the parts from the first one on and leaves out those
before the place where it is, so that a jump forwards only sets this place, and one backwards begins anew.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

from heatertune.errors import InputError
from heatertune.plc.cpu.s7_300.real import quotient, real
from heatertune.plc.cpu.s7_300.source import Place, as_real, bits_of, constant, signed
from heatertune.plc.cpu.statements import Line

__all__ = ["Called", "Run", "translated"]

#: runs a block to its end on a CPU
Run = Callable[[Any], None]
#: the same of a CALL; returns whether the next bit is asked for anew
Called = Callable[[Any], bool]

#: jumps backwards of a block that is given up as one without end; the programs here make some hundreds
_MOST: Final = 10_000
_JUMPS: Final = {"JU": None, "JC": "true", "JCN": "not true", "JOS": "os"}
_COMPARED: Final = {"==": "==", "<>": "!=", ">": ">", ">=": ">=", "<": "<", "<=": "<="}
#: what the bits of an accumulator mean to a comparison
_MEANT: Final = {"I": "signed({}, 16)", "D": "signed({}, 32)", "R": "as_real({})"}
_WHOLE: Final = {"+": "+", "-": "-", "*": "*", "A": "&"}
_KEEP: Final = "cpu.one, cpu.two, cpu.true, cpu.os = one, two, true, os"
_TAKE: Final = "one, two, true, os = cpu.one, cpu.two, cpu.true, cpu.os"


def translated(
    lines: Sequence[Line], place_of: Callable[[str], Place | None], called: Callable[[str], Called],
    memory: Mapping[str, bytearray],
) -> Run:
    """Return what runs the statements of a block.

    Args:
        lines: the statements.
        place_of: gives the place of an operand, None for a constant; raises LookupError for what is not there.
        called: gives what a CALL does, told its operand.
        memory: the CPU's; what stays in its place.

    Raises:
        InputError: a statement that is not known here. So does the function, where a CPU would stop.
    """
    text = _Writer(lines, place_of, called, memory)
    exec(compile(text.function(), "<block>", "exec"), text.names)
    run: Run = text.names["run"]

    def carry_out(cpu: Any) -> None:
        try:
            run(cpu)
        except InputError:
            raise
        except (ArithmeticError, LookupError, ValueError, RecursionError) as problem:
            raise InputError(f"{text.statement_of(problem)}; the CPU stops here") from None

    return carry_out


class _Writer:
    """Writes the function; `names` are what its text names."""

    def __init__(
        self, lines: Sequence[Line], place_of: Callable[[str], Place | None], called: Callable[[str], Called],
        memory: Mapping[str, bytearray],
    ) -> None:
        self._lines, self._place_of, self._called, self._memory = lines, place_of, called, memory
        self._labels = {line.label: at for at, line in enumerate(lines) if line.label}
        self._part_of = self._parts()
        self._text, self._of = list[str](), list[int]()  # lines of the function, and the statement each is of
        self.names: dict[str, Any] = {
            "real": real, "quotient": quotient, "as_real": as_real, "bits_of": bits_of, "signed": signed,
            "trunc": math.trunc, "share": _share, "number": int.from_bytes, "endless": self._endless}

    def _parts(self) -> list[int]:
        """Return the part that each statement is in."""
        begins = {0, *self._labels.values()}
        begins |= {at + 1 for at, line in enumerate(self._lines) if line.operation in _JUMPS or line.operation == "BEU"}
        parts, part = list[int](), -1
        for at in range(len(self._lines)):
            part += at in begins
            parts.append(part)
        return parts

    def function(self) -> str:
        """Return the text."""
        for at, line in enumerate(self._lines):
            if at == 0 or self._part_of[at] != self._part_of[at - 1]:
                self._add(at, 2, f"if at <= {self._part_of[at]}:")
            try:
                self._add(at, 3, *self._statement(at, line))
            except (InputError, LookupError, ValueError):
                raise InputError(f"{line}; this is none that is known here") from None
        self._add(len(self._lines) - 1, 0, f"  {_KEEP}", "  return", " raise endless(at)")
        own = [" own = cpu.memory[cpu.instance]"] if any("own[" in text for text in self._text) else []
        head = ["def run(cpu):", f" {_TAKE}", " first, at = True, 0", *own, f" for _ in range({_MOST}):"]
        self._of = [0] * len(head) + self._of
        return "\n".join([*head, *self._text])

    def _add(self, at: int, deep: int, *texts: str) -> None:
        for text in texts:
            self._text.append(" " * deep + text)
            self._of.append(at)

    def statement_of(self, problem: BaseException) -> Line:
        """Return the statement at which the function stopped."""
        trace, code, at = problem.__traceback__, self.names["run"].__code__, 0
        while trace is not None:
            if trace.tb_frame.f_code is code:
                at = self._of[trace.tb_lineno - 1]
                break
            trace = trace.tb_next
        return self._lines[at]

    def _endless(self, part: int) -> InputError:
        return InputError(f"{self._lines[self._part_of.index(part)]}; the CPU does not come to the end of this block")

    def _statement(self, at: int, line: Line) -> list[str]:  # noqa: C901, PLR0911, PLR0912 - one branch for each kind
        """Return the text of a statement.

        Raises:
            InputError, LookupError, ValueError: it, or its operand, is not known here.
        """
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
                return self._jump(at, name, self._labels[operand])
            case "BEU":
                return [_KEEP, "return"]
            case "NOP":
                return ["pass"]
            case "TAK":
                return ["one, two = two, one"]
            case "CALL":
                self.names[f"call_{at}"] = self._called(operand)
                return [_KEEP, f"first = call_{at}(cpu) or first", _TAKE]
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

    def _jump(self, at: int, name: str, there: int) -> list[str]:
        goes = [f"at = {self._part_of[there]}", *(["continue"] if there <= at else [])]
        asked = _JUMPS[name]
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
