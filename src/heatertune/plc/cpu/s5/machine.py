"""A CPU that runs a STEP 5 listing: the statements that heatertune's own programs use, and no others.

Two accumulators and data words of 16 bits; a comparison asks whether ACCU 2 … ACCU 1 and leaves both as they are
(S5-115U manual EWA 4NEB 811 6130, chapter 8). A statement becomes a function that gives the place of the next one.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Mapping
from typing import Final

from heatertune.errors import InputError

__all__ = ["Cpu"]

_END: Final = -1
_CONSTANTS: Final = {"KF": 10, "KB": 10, "KH": 16, "KM": 2}
_COMPARED: Final = {"!=F": operator.eq, "><F": operator.ne, ">F": operator.gt, ">=F": operator.ge, "<F": operator.lt,
                    "<=F": operator.le}

#: label, operation, operand
_Line = tuple[str, str, str]
_Statement = Callable[["Cpu"], int]


class Cpu:
    """A CPU with a listing in its memory.

    Attributes:
        data: number of a data block → its words.
        inputs: operand, as "PW 128" or "I 0.0" → value; what is not there is 0.
        outputs: operand → the value written last.
    """

    def __init__(self, listing: str, firmware: Mapping[str, Callable[[list[int]], None]]) -> None:
        """Take a listing, and what the CPU brings along: block → what a call does to the open data block.

        Raises:
            InputError: a line that is no statement known here, a jump to nowhere, a block that is not there.
        """
        lines, self.data = _blocks(listing)
        self.inputs: dict[str, int] = {}
        self.outputs: dict[str, int] = {}
        self.one = self.two = 0
        self.true = False
        self.open: list[int] = []
        self._firmware = firmware
        known = {*lines, *firmware}
        self._code = {name: [_statement(line, place, _labels(block), known) for place, line in enumerate(block)]
                      for name, block in lines.items()}

    def run(self, block: str) -> None:
        """Run a block until it ends; the data block open before is open again afterwards."""
        before = self.open
        if block in self._firmware:
            self._firmware[block](before)
            return
        code, place = self._code[block], 0
        while place != _END:
            place = code[place](self)
        self.open = before


def _blocks(listing: str) -> tuple[dict[str, list[_Line]], dict[int, list[int]]]:
    """Return the statements of each block, and the words of each data block."""
    code: dict[str, list[_Line]] = {}
    data: dict[int, list[int]] = {}
    statements, words = list[_Line](), list[int]()
    for number, line in enumerate(listing.splitlines(), 1):
        if not line or line.startswith(("//", "NAME")):
            continue
        if begins := re.fullmatch(r"DB(\d+)", line):
            words = data[int(begins[1])] = []
        elif re.fullmatch(r"(FB|OB) \d+", line):
            statements = code[line] = []
        elif word := re.match(r" *\d+: +(K\w) = ([^;]+);", line):
            words.append(_constant(word[1], word[2]))
        elif found := re.fullmatch(r"(\w*) *:(\S+) *([^;]*?) *(;.*)?", line):
            statements.append((found[1], found[2], found[3]))
        else:
            raise InputError(f"line {number}: {line.strip()!r}; expected a block, a data word or a statement")
    return code, data


def _labels(block: list[_Line]) -> dict[str, int]:
    return {label: place for place, (label, _, _) in enumerate(block) if label}


def _constant(kind: str, digits: str) -> int:
    return _word(int(digits.replace(" ", ""), _CONSTANTS[kind]))


def _word(number: int) -> int:
    """Return what 16 bits hold of a number, as a signed one."""
    return (number + 0x8000) % 0x10000 - 0x8000


def _statement(  # noqa: C901, PLR0911, PLR0912 - one branch for each kind of statement
    line: _Line, place: int, labels: Mapping[str, int], known: set[str]
) -> _Statement:
    """Return what a statement does.

    Raises:
        InputError: it is not known here.
    """
    _, name, operand = line
    then = place + 1
    kind, _, rest = operand.partition(" ")
    if name in _COMPARED and not operand:
        return _compare(_COMPARED[name], then)
    match name, kind:
        case ("JU" | "JC"), _ if operand[1:] in labels and operand.startswith("="):
            return _jump(labels[operand[1:]], then if name == "JC" else None)
        case "JU", ("FB" | "OB") if operand in known:
            return _call(operand, then)
        case "BE", "":
            return lambda _: _END
        case "BEC", "":
            return lambda cpu: _END if cpu.true else then
        case "TAK", "":
            return _exchange(then)
        case ("+F" | "-F"), "":
            return _sum(1 if name == "+F" else -1, then)
        case ("SLW" | "SRW"), _ if operand.isdigit():
            return _shift(int(operand), name == "SLW", then)
        case "C", "DB" if rest.isdigit():
            return _opened(int(rest), then)
        case "L", _ if kind in _CONSTANTS:
            return _loaded(_constant(kind, rest), then)
        case ("L" | "T"), "DW" if rest.isdigit():
            return _load(int(rest), then) if name == "L" else _transfer(int(rest), then)
        case "L", "PW":
            return _read(operand, then)
        case "T", ("PW" | "PY" | "RS"):
            return _written(operand, then)
        case "A", "I":
            return _asked(operand, then)
        case ("TB" | "SU" | "RU"), "D" if re.fullmatch(r"\d+\.\d+", rest):
            number, _, bit = rest.partition(".")
            return _bit(name, int(number), int(bit), then)
    raise InputError(f"statement {' '.join((name, operand)).strip()!r}; this is none that is known here")


def _compare(asks: Callable[[int, int], bool], then: int) -> _Statement:
    def run(cpu: Cpu) -> int:
        cpu.true = asks(cpu.two, cpu.one)
        return then
    return run


def _jump(there: int, then: int | None) -> _Statement:
    """Return a jump, where there is another way one under a condition."""
    return (lambda _: there) if then is None else (lambda cpu: there if cpu.true else then)


def _call(block: str, then: int) -> _Statement:
    def run(cpu: Cpu) -> int:
        cpu.run(block)
        return then
    return run


def _exchange(then: int) -> _Statement:
    def run(cpu: Cpu) -> int:
        cpu.one, cpu.two = cpu.two, cpu.one
        return then
    return run


def _sum(sign: int, then: int) -> _Statement:
    def run(cpu: Cpu) -> int:
        cpu.one = _word(cpu.two + sign * cpu.one)
        return then
    return run


def _shift(places: int, left: bool, then: int) -> _Statement:
    def run(cpu: Cpu) -> int:
        cpu.one = _word(cpu.one << places if left else (cpu.one & 0xFFFF) >> places)
        return then
    return run


def _opened(number: int, then: int) -> _Statement:
    def run(cpu: Cpu) -> int:
        cpu.open = cpu.data[number]
        return then
    return run


def _loaded(value: int, then: int) -> _Statement:
    def run(cpu: Cpu) -> int:
        cpu.one, cpu.two = value, cpu.one
        return then
    return run


def _load(number: int, then: int) -> _Statement:
    def run(cpu: Cpu) -> int:
        cpu.one, cpu.two = cpu.open[number], cpu.one
        return then
    return run


def _transfer(number: int, then: int) -> _Statement:
    def run(cpu: Cpu) -> int:
        cpu.open[number] = cpu.one
        return then
    return run


def _read(operand: str, then: int) -> _Statement:
    def run(cpu: Cpu) -> int:
        cpu.one, cpu.two = _word(cpu.inputs.get(operand, 0)), cpu.one
        return then
    return run


def _written(operand: str, then: int) -> _Statement:
    def run(cpu: Cpu) -> int:
        cpu.outputs[operand] = cpu.one & 0xFF if operand.startswith("PY") else cpu.one
        return then
    return run


def _asked(operand: str, then: int) -> _Statement:
    def run(cpu: Cpu) -> int:
        cpu.true = bool(cpu.inputs.get(operand, 0))
        return then
    return run


def _bit(name: str, number: int, place: int, then: int) -> _Statement:
    """Return what tests (TB), sets (SU) or clears (RU) a bit of a data word."""
    mask = 1 << place

    def test(cpu: Cpu) -> int:
        cpu.true = bool(cpu.open[number] & mask)
        return then

    def write(cpu: Cpu) -> int:
        word = cpu.open[number]
        cpu.open[number] = _word(word | mask if name == "SU" else word & ~mask)
        return then

    return test if name == "TB" else write
