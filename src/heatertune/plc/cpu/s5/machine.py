"""A CPU that runs a STEP 5 listing: the statements that heatertune's own programs use, and no others.

Data words of 16 bits, kept as signed numbers; a comparison asks whether ACCU 2 … ACCU 1 and leaves both as they are
(S5-115U manual EWA 4NEB 811 6130, chapter 8).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Final

from heatertune.errors import InputError
from heatertune.plc.cpu.statement_translation import Accumulators, Run, StatementLine, Translation

__all__ = ["S5Cpu"]

_CONSTANTS: Final = {"KF": 10, "KB": 10, "KH": 16, "KM": 2}
_COMPARED: Final = {"!=F": "==", "><F": "!=", ">F": ">", ">=F": ">=", "<F": "<", "<=F": "<="}
#: integral block of the S5-115U: Z1 times Z2 is Z32 (high word) and Z31 (low word); Z3=0 tells a product of 0
_MULTIPLIER: Final = "FB 242"
_PARAMETERS: Final = ("Z1", "Z2", "Z3=0", "Z32", "Z31")


class S5Cpu(Accumulators):
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
        code, self.data = _blocks(listing)
        self.inputs: dict[str, int] = {}
        self.outputs: dict[str, int] = {}
        self.open: list[int] = []
        self._code = dict[str, Run]()
        for name, block in code.items():
            self._code[name] = _Translated(block, {*code, *firmware}, self, self._code).run()
        self._code |= {name: partial(_on_open_block, effect) for name, effect in firmware.items()}

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
        if block not in self._code:
            raise InputError(f"{block}: the listing has no such block")
        before = self.open
        self._code[block](self)
        self.open = before


def _on_open_block(effect: Callable[[list[int]], None], cpu: S5Cpu) -> None:
    effect(cpu.open)


def _blocks(listing: str) -> tuple[dict[str, list[StatementLine]], dict[int, list[int]]]:
    """Return the statements of each block, and the words of each data block."""
    code: dict[str, list[StatementLine]] = {}
    data: dict[int, list[int]] = {}
    statements, words = list[StatementLine](), list[int]()
    for number, line in enumerate(listing.splitlines(), 1):
        if not line or line.startswith(("//", "NAME")):
            continue
        if begins := re.fullmatch(r"DB(\d+)", line):
            words = data[int(begins[1])] = []
        elif re.fullmatch(r"(FB|OB) \d+", line):
            statements = code[line] = []
        elif word := re.match(r" *\d+: +(K\w) = ([^;]+);", line):
            words.append(_constant(word[1], word[2], f"line {number}"))
        elif match := re.fullmatch(r"([\w=]*) *:(\S+) *([^;]*?) *(;.*)?", line):
            statements.append(StatementLine(number, match[1], match[2], match[3]))
        else:
            raise InputError(f"line {number}: {line.strip()!r}; expected a block, a data word or a statement")
    for name, block in code.items():
        if not block or block[-1].operation != "BE":
            raise InputError(f"{block[-1] if block else name}; a block ends with BE")
    return code, data


def _constant(kind: str, digits: str, where: object) -> int:
    try:
        return _word(int(digits.replace(" ", ""), _CONSTANTS[kind]))
    except (KeyError, ValueError):
        raise InputError(f"{where}: {kind} = {digits}; this is no constant that is known here") from None


def _word(number: int) -> int:
    """Return the low 16 bits of a number, as a signed one."""
    return (number + 0x8000) % 0x10000 - 0x8000


class _Translated(Translation):
    keep = "cpu.one, cpu.two, cpu.true, cpu.open = one, two, true, dw"
    take = "one, two, true, dw = cpu.one, cpu.two, cpu.true, cpu.open"

    def __init__(self, lines: list[StatementLine], names: set[str], cpu: S5Cpu, code: Mapping[str, Run]) -> None:
        super().__init__(lines)
        self._known = names
        self.names |= {"data": cpu.data, "inputs": cpu.inputs, "outputs": cpu.outputs, "code": code}

    def ends(self, line: StatementLine) -> str | None:
        label = line.operand[1:] if line.operation in ("JU", "JC") and line.operand.startswith("=") else None
        return "" if line.operation in ("BE", "BEC") else label

    def statement(self, at: int, line: StatementLine) -> list[str]:  # noqa: C901, PLR0911, PLR0912 - one branch for each kind
        name, operand = line.operation, line.operand
        kind, _, rest = operand.partition(" ")
        match name, kind:
            case _, "" if name in _COMPARED:
                return [f"true = two {_COMPARED[name]} one"]
            case ("JU" | "JC"), _ if self.ends(line):
                goes = self.goes(at, operand[1:])
                return goes if name == "JU" else ["if true:", *(f" {text}" for text in goes)]
            case "JU", "FB" if operand == _MULTIPLIER:
                return _product(self.lines[at + 1 : at + 1 + len(_PARAMETERS)])
            case ("DW" | "F"), _ if line.label in _PARAMETERS:
                return ["pass"]
            case "JU", ("FB" | "OB") if operand in self._known:
                return [self.keep, f"code[{operand!r}](cpu)", "one, two, true = cpu.one, cpu.two, cpu.true"]
            case ("BE" | "BEC"), "":
                end = [self.keep, "return"]
                return end if name == "BE" else ["if true:", *(f" {text}" for text in end)]
            case "TAK", "":
                return ["one, two = two, one"]
            case ("+F" | "-F"), "":
                return [f"one = {_wrapped(f'two {name[0]} one')}"]
            case ("SLW" | "SRW"), _ if operand.isdigit():
                moved = f"(one << {operand})" if name == "SLW" else f"((one & 65535) >> {operand})"
                return [f"one = {_wrapped(moved)}"]
            case "C", "DB" if rest.isdigit():
                return [f"dw = data[{int(rest)}]"]
            case ("L" | "T"), _:
                return [_moved(name, kind, rest, line)]
            case "A", "I":
                return [f"true = inputs.get({operand!r}, 0) != 0"]
            case ("TB" | "SU" | "RU"), "D" if re.fullmatch(r"\d+\.(\d|1[0-5])", rest):
                return [_bit(name, *map(int, rest.split(".")))]
        raise InputError


def _wrapped(value: str) -> str:
    """Return the text of what 16 bits hold of a number, as a signed one."""
    return f"({value} + 32768 & 65535) - 32768"


def _moved(name: str, kind: str, rest: str, line: StatementLine) -> str:
    """Return the text of a load, at which ACCU 1 goes to ACCU 2, or of what writes ACCU 1 somewhere."""
    match name, kind:
        case _, "DW" if rest.isdigit():
            return f"one, two = dw[{int(rest)}], one" if name == "L" else f"dw[{int(rest)}] = one"
        case "L", "PW":
            return f"one, two = {_wrapped(f'inputs.get({line.operand!r}, 0)')}, one"
        case "T", ("PW" | "PY" | "RS"):
            return f"outputs[{line.operand!r}] = one{' & 255' if kind == 'PY' else ''}"
        case "L", _:
            return f"one, two = {_constant(kind, rest, line)}, one"
    raise InputError


def _product(lines: Sequence[StatementLine]) -> list[str]:
    """Return the text of a call of the multiplier with the parameters behind it.

    Raises:
        InputError: they are not its own, in their order, each a data word; the bit is not looked at.
    """
    if tuple(line.label for line in lines) != _PARAMETERS or not all(
            line.operation == "DW" and line.operand.isdigit() for line in lines if line.label != "Z3=0"):
        raise InputError(f"{_MULTIPLIER}: expected the parameters {', '.join(_PARAMETERS)} behind its call, data words")
    one, two, _, high, low = (int(line.operand) if line.operation == "DW" else 0 for line in lines)
    return [f"product = dw[{one}] * dw[{two}]", f"dw[{high}], dw[{low}] = {_wrapped('(product >> 16)')}, "
            f"{_wrapped('product')}"]


def _bit(name: str, number: int, place: int) -> str:
    """Return the text of what tests (TB), sets (SU) or clears (RU) a bit of a data word."""
    word, mask = f"dw[{number}]", 1 << place
    if name == "TB":
        return f"true = {word} & {mask} != 0"
    return f"{word} = {_wrapped(f'({word} | {mask})' if name == 'SU' else f'({word} & {~mask})')}"
