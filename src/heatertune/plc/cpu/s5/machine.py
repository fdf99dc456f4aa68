"""A CPU that runs a STEP 5 listing: the statements that heatertune's own programs use, and no others.

Data words of 16 bits; a comparison asks whether ACCU 2 … ACCU 1 and leaves both as they are (S5-115U manual
EWA 4NEB 811 6130, chapter 8).
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Mapping
from typing import Final

from heatertune.errors import InputError
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

__all__ = ["Cpu"]

_CONSTANTS: Final = {"KF": 10, "KB": 10, "KH": 16, "KM": 2}
_COMPARED: Final = {"!=F": operator.eq, "><F": operator.ne, ">F": operator.gt, ">=F": operator.ge, "<F": operator.lt,
                    "<=F": operator.le}
#: integral block of the S5-115U: Z1 times Z2 is Z32 (high word) and Z31 (low word); Z3=0 tells a product of 0
_MULTIPLIER: Final = "FB 242"
_PARAMETERS: Final = ("Z1", "Z2", "Z3=0", "Z32", "Z31")


class Cpu(Accumulators):
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
        super().__init__()
        self._lines, self.data = _blocks(listing)
        self.inputs: dict[str, int] = {}
        self.outputs: dict[str, int] = {}
        self.open: list[int] = []
        self._firmware = firmware
        known = {*self._lines, *firmware}
        self._code = {name: [_statement(line, place, block, known) for place, line in enumerate(block)]
                      for name, block in self._lines.items()}

    def block(self, number: int, last: int) -> list[int]:
        """Return the words of a data block.

        Raises:
            InputError: it has no such last one.
        """
        words = self.data.get(number, [])
        if len(words) <= last:
            raise InputError(f"DB {number}: {len(words)} words; expected {last + 1} or more")
        return words

    def run(self, block: str) -> None:
        """Run a block until it ends; the data block open before is open again afterwards.

        Raises:
            InputError: there is none, or a statement at which the CPU would stop.
        """
        before = self.open
        if block in self._firmware:
            self._firmware[block](before)
            return
        if block not in self._code:
            raise InputError(f"{block}: the listing has no such block")
        carry_out(self, self._code[block], self._lines[block])
        self.open = before


def _blocks(listing: str) -> tuple[dict[str, list[Line]], dict[int, list[int]]]:
    """Return the statements of each block, and the words of each data block."""
    code: dict[str, list[Line]] = {}
    data: dict[int, list[int]] = {}
    statements, words = list[Line](), list[int]()
    for number, line in enumerate(listing.splitlines(), 1):
        if not line or line.startswith(("//", "NAME")):
            continue
        if begins := re.fullmatch(r"DB(\d+)", line):
            words = data[int(begins[1])] = []
        elif re.fullmatch(r"(FB|OB) \d+", line):
            statements = code[line] = []
        elif word := re.match(r" *\d+: +(K\w) = ([^;]+);", line):
            words.append(_constant(word[1], word[2], f"line {number}"))
        elif found := re.fullmatch(r"([\w=]*) *:(\S+) *([^;]*?) *(;.*)?", line):
            statements.append(Line(number, found[1], found[2], found[3]))
        else:
            raise InputError(f"line {number}: {line.strip()!r}; expected a block, a data word or a statement")
    for name, block in code.items():
        if not block or block[-1].operation != "BE":
            raise InputError(f"{block[-1] if block else name}; a block ends with BE")
    return code, data


def _labels(block: list[Line]) -> dict[str, int]:
    return {line.label: place for place, line in enumerate(block) if line.label}


def _constant(kind: str, digits: str, where: object) -> int:
    try:
        return _word(int(digits.replace(" ", ""), _CONSTANTS[kind]))
    except (KeyError, ValueError):
        raise InputError(f"{where}: {kind} = {digits}; this is no constant that is known here") from None


def _word(number: int) -> int:
    """Return what 16 bits hold of a number, as a signed one."""
    return (number + 0x8000) % 0x10000 - 0x8000


def _statement(  # noqa: C901, PLR0911, PLR0912 - one branch for each kind of statement
    line: Line, place: int, block: list[Line], known: set[str]
) -> Statement[Cpu]:
    """Return what a statement does.

    Raises:
        InputError: it is not known here.
    """
    name, operand, then = line.operation, line.operand, place + 1
    labels = _labels(block)
    kind, _, rest = operand.partition(" ")
    if name in _COMPARED and not operand:
        return _compare(_COMPARED[name], then)
    match name, kind:
        case ("JU" | "JC"), _ if operand[1:] in labels and operand.startswith("="):
            return jump(labels[operand[1:]], then, _true if name == "JC" else None)
        case "JU", "FB" if operand == _MULTIPLIER:
            return _product(block[then : then + len(_PARAMETERS)], then + len(_PARAMETERS))
        case ("DW" | "F"), _ if line.label in _PARAMETERS:
            return jump(then, then)
        case "JU", ("FB" | "OB") if operand in known:
            return _call(operand, then)
        case "BE", "":
            return jump(END, then)
        case "BEC", "":
            return jump(END, then, _true)
        case "TAK", "":
            return exchange(then)
        case ("+F" | "-F"), "":
            return _sum(1 if name == "+F" else -1, then)
        case ("SLW" | "SRW"), _ if operand.isdigit():
            return _shift(int(operand), name == "SLW", then)
        case "C", "DB" if rest.isdigit():
            return _opened(int(rest), then)
        case "L", _ if kind in _CONSTANTS:
            return load(_always(_constant(kind, rest, line)), then)
        case ("L" | "T"), "DW" if rest.isdigit():
            return load(_word_of(int(rest)), then) if name == "L" else transfer(_to_word(int(rest)), then)
        case "L", "PW":
            return load(lambda cpu: _word(cpu.inputs.get(operand, 0)), then)
        case "T", ("PW" | "PY" | "RS"):
            return transfer(_to_output(operand, 0xFF if kind == "PY" else -1), then)
        case "A", "I":
            return _asked(operand, then)
        case ("TB" | "SU" | "RU"), "D" if re.fullmatch(r"\d+\.(\d|1[0-5])", rest):
            number, _, bit = rest.partition(".")
            return _bit(name, int(number), int(bit), then)
    raise InputError(f"{line}; this is none that is known here")


def _true(cpu: Cpu) -> bool:
    return cpu.true


def _always(value: int) -> Callable[[Cpu], int]:
    return lambda _: value


def _word_of(number: int) -> Callable[[Cpu], int]:
    return lambda cpu: cpu.open[number]


def _to_word(number: int) -> Callable[[Cpu, int], None]:
    def put(cpu: Cpu, value: int) -> None:
        cpu.open[number] = value
    return put


def _to_output(operand: str, mask: int) -> Callable[[Cpu, int], None]:
    def put(cpu: Cpu, value: int) -> None:
        cpu.outputs[operand] = value & mask
    return put


def _compare(asks: Callable[[int, int], bool], then: int) -> Statement[Cpu]:
    def run(cpu: Cpu) -> int:
        cpu.true = asks(cpu.two, cpu.one)
        return then
    return run


def _call(block: str, then: int) -> Statement[Cpu]:
    def run(cpu: Cpu) -> int:
        cpu.run(block)
        return then
    return run


def _product(given: list[Line], then: int) -> Statement[Cpu]:
    """Return what a call of the multiplier does with the parameters behind it.

    Raises:
        InputError: they are not its own, in their order, each a data word; the bit is not looked at.
    """
    if tuple(line.label for line in given) != _PARAMETERS or not all(
            line.operation == "DW" and line.operand.isdigit() for line in given if line.label != "Z3=0"):
        raise InputError(f"{_MULTIPLIER}: expected the parameters {', '.join(_PARAMETERS)} behind its call, data words")
    one, two, _, high, low = (int(line.operand) if line.operation == "DW" else 0 for line in given)

    def run(cpu: Cpu) -> int:
        product = cpu.open[one] * cpu.open[two]
        cpu.open[high], cpu.open[low] = _word(product >> 16), _word(product)
        return then
    return run


def _sum(sign: int, then: int) -> Statement[Cpu]:
    def run(cpu: Cpu) -> int:
        cpu.one = _word(cpu.two + sign * cpu.one)
        return then
    return run


def _shift(places: int, left: bool, then: int) -> Statement[Cpu]:
    def run(cpu: Cpu) -> int:
        cpu.one = _word(cpu.one << places if left else (cpu.one & 0xFFFF) >> places)
        return then
    return run


def _opened(number: int, then: int) -> Statement[Cpu]:
    def run(cpu: Cpu) -> int:
        cpu.open = cpu.data[number]
        return then
    return run


def _asked(operand: str, then: int) -> Statement[Cpu]:
    def run(cpu: Cpu) -> int:
        cpu.true = bool(cpu.inputs.get(operand, 0))
        return then
    return run


def _bit(name: str, number: int, place: int, then: int) -> Statement[Cpu]:
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
