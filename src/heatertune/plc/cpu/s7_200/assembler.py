"""Statement list as STEP 7-Micro/WIN exports it → a program as the CPU takes it.

Blocks and networks → statement list as STEP 7-Micro/WIN exports it (keywords, TAB before each line, CRLF).

The instructions of an S7-200 that this project's programs use: mnemonic and operands → a row of a program's code.
"""

from __future__ import annotations

import re
from array import array
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Final, NamedTuple

from heatertune.errors import InputError
from heatertune.plc.cpu.s7_200 import cpu as opcodes
from heatertune.plc.cpu.s7_200.cpu import ATCH, CALL, END, ROW, S7200Program, to_signed
from heatertune.plc.cpu.s7_200.memory import EVENTS, bit, cell, constant
from heatertune.plc.single_precision import single, word_of

__all__ = [
    "Network", "assemble", "block", "block_number", "count_ticks", "instruction", "is_subroutine", "program",
    "pwm_registers", "real", "timed_interrupt",
]


_KINDS = {"OB": "ORGANIZATION", "SBR": "SUBROUTINE", "INT": "INTERRUPT"}


class Network(NamedTuple):
    """One network: what it does, and its instructions, "MNEMONIC operand, operand"."""

    comment: str
    instructions: Sequence[str]


def block(name: str, title: str, networks: Sequence[Network], head: Sequence[str] = ()) -> list[str]:
    """Return the lines of a block; `head` are comments below its title."""
    area = name.rstrip("0123456789")
    kind, symbol = _KINDS[area], "MAIN" if area == "OB" else f"{area}_{name.removeprefix(area)}"
    lines = [f"{kind}_BLOCK {symbol}:{name}", f"TITLE={title}", *[f"// {line}" for line in head], "BEGIN"]
    for number, network in enumerate(networks, start=1):
        lines.append(f"Network {number} // {network.comment}")
        lines += ["\t" + line.replace(" ", "\t", 1) for line in network.instructions]
    return [*lines, f"END_{kind}_BLOCK"]


def program(*blocks: Sequence[str]) -> str:
    """Return the text of a program; Micro/WIN takes OB1, subroutines and interrupts in this order."""
    return "\r\n".join(line for lines in blocks for line in lines) + "\r\n"


def real(value: float) -> str:
    """Return a REAL constant: the nine digits that tell every single from the next, always with a point or exponent."""
    text = f"{value:.9g}"
    return text if set(text) & set(".e") else f"{text}.0"


def pwm_registers(cycle_ms: int, control: str) -> Network:
    """Return the network that prepares PWM on Q0.0; the first PLS loads cycle time and pulse width.

    Args:
        cycle_ms: PWM cycle [ms].
        control: byte for SMB67 at that.
    """
    loads = [f"MOVB {control}, SMB67", f"MOVW {cycle_ms:+d}, SMW68", "MOVW +0, SMW70"]
    return Network("PWM, ms; cycle time and pulse width are loaded by the first PLS", ["LD SM0.0", *loads])


def timed_interrupt(tick_ms: int) -> Network:
    """Return the network that starts timed interrupt 0."""
    return Network("timed interrupt 0", ["LD SM0.0", f"MOVB {tick_ms}, SMB34", "ATCH INT0, 10", "ENI"])


def count_ticks(word: str, ticks: str) -> list[Network]:
    """Return the networks that leave the interrupt until so many ticks (a constant or a word) are over."""
    return [
        Network("count the ticks of a PWM cycle", ["LD SM0.0", f"-I +1, {word}"]),
        Network("not yet over", [f"LDW>= {word}, +1", "CRETI"]),
        Network("over: count anew", ["LD SM0.0", f"MOVW {ticks}, {word}"]),
    ]


_INSTRUCTIONS_BLOCK: Final = re.compile(r"OB1|SBR(\d{1,2})|INT(\d{1,3})")
_SUBROUTINES: Final = 64  # SBR0 to SBR63; INT0 to INT127 follow
_LOOPS: Final = 8


class _Operand(NamedTuple):
    is_constant: bool
    value: int


_Row = tuple[int, _Operand, _Operand]
_NONE: Final = _Operand(is_constant=True, value=0)


def instruction(name: str, operands: Sequence[str]) -> list[int]:
    """Return a row of `opcodes.ROW` integers.

    Raises:
        KeyError, TypeError, ValueError: an unknown mnemonic, a wrong number of operands, a wrong operand.
    """
    if compared := re.fullmatch(r"LD([WDR])(=|<|>|<=|>=)", name):
        base, read = _COMPARED[compared[1]]
        op, (first, second) = base + opcodes.RELATIONS.index(compared[2]), _both(read, *operands)
    else:
        op, first, second = _INSTRUCTIONS[name](*operands)
    return [op, int(first.is_constant), first.value, int(second.is_constant), second.value]


def block_number(name: str) -> int:
    """Return the number of a block: OB1 is 0; raise ValueError for what is none."""
    match = _INSTRUCTIONS_BLOCK.fullmatch(name)
    if match is None:
        raise ValueError(name)
    if match[1] is not None:
        return 1 + _below(int(match[1]), _SUBROUTINES)
    return 0 if match[2] is None else 1 + _SUBROUTINES + _below(int(match[2]), 128)


def is_subroutine(number: int) -> bool:
    """Return whether a block's number is that of a subroutine."""
    return 0 < number <= _SUBROUTINES


def _below(number: int, count: int) -> int:
    if not 0 <= number < count:
        raise ValueError(number)
    return number


def _place(text: str, width: int) -> _Operand:
    return _Operand(is_constant=False, value=cell(text, width).start)


def _fixed(value: int) -> _Operand:
    return _Operand(is_constant=True, value=value)


def _operand(text: str, width: int) -> _Operand:
    """Return a constant or a cell of this width [bytes]."""
    value = constant(text)
    if value is None:
        return _place(text, width)
    return _fixed(value & 0xFF if width == 1 else to_signed(value, 8 * width))


def _real(text: str) -> _Operand:
    try:
        return _fixed(word_of(single(float(text))))
    except ValueError:
        return _place(text, 4)


def _both(read: Callable[[str], _Operand], first: str, second: str) -> tuple[_Operand, _Operand]:
    return read(first), read(second)


def _of_bit(op: int) -> Callable[[str], _Row]:
    def build(name: str) -> _Row:
        place, mask = bit(name)
        return op, _fixed(place), _fixed(mask)

    return build


def _set(name: str, count: str) -> _Row:
    if count != "1":
        raise ValueError(count)
    return _of_bit(opcodes.SET)(name)


def _two(op: int, width: int, wide: int | None = None) -> Callable[[str, str], _Row]:
    """IN, OUT: of this width [bytes], the output of another where it is told."""
    return lambda operand, output: (op, _operand(operand, width), _place(output, wide or width))


def _two_real(op: int) -> Callable[[str, str], _Row]:
    return lambda operand, output: (op, _real(operand), _place(output, 4))


def _convert(op: int, width: int) -> Callable[[str, str], _Row]:
    return lambda operand, output: (op, _place(operand, width), _place(output, 4))


def _shift(output: str, count: str) -> _Row:
    return opcodes.SHIFT_D, _operand(count, 1), _place(output, 4)


def _pid(table: str, loop: str) -> _Row:
    if not table.startswith("VB"):
        raise ValueError(table)
    cell(f"VD{int(table[2:]) + 32}", 4)  # the table's last word must be there
    return opcodes.PID, _place(table, 1), _fixed(_below(int(loop), _LOOPS))


def _attach(block: str, event: str) -> _Row:
    return opcodes.ATCH, _fixed(block_number(block)), _fixed(_below(int(event), EVENTS))


def _pulse(output: str) -> _Row:
    if output != "0":
        raise ValueError(output)
    return opcodes.PLS, _NONE, _NONE


#: format of what is compared → number of its comparisons, and what reads an operand
_COMPARED: Final[dict[str, tuple[int, Callable[[str], _Operand]]]] = {
    "W": (opcodes.LDW, lambda text: _operand(text, 2)), "D": (opcodes.LDD, lambda text: _operand(text, 4)),
    "R": (opcodes.LDR, _real),
}

_INSTRUCTIONS: Final[dict[str, Callable[..., _Row]]] = {
    "LD": _of_bit(opcodes.LD), "=": _of_bit(opcodes.ASSIGN), "S": _set,
    "MOVB": _two(opcodes.MOV_B, 1), "MOVW": _two(opcodes.MOV_W, 2), "MOVD": _two(opcodes.MOV_D, 4),
    "+I": _two(opcodes.ADD_W, 2), "-I": _two(opcodes.SUB_W, 2), "+D": _two(opcodes.ADD_D, 4),
    "-D": _two(opcodes.SUB_D, 4), "MUL": _two(opcodes.MUL, 2, 4), "DIV": _two(opcodes.DIV, 2, 4),
    "ANDD": _two(opcodes.AND_D, 4), "XORD": _two(opcodes.XOR_D, 4), "SRD": _shift,
    "MOVR": _two_real(opcodes.MOV_D), "*R": _two_real(opcodes.MUL_R), "/R": _two_real(opcodes.DIV_R),
    "ITD": _convert(opcodes.ITD, 2), "DTR": _convert(opcodes.DTR, 4), "ROUND": _two_real(opcodes.ROUND), "PID": _pid,
    "CALL": lambda block: (opcodes.CALL, _fixed(block_number(block)), _NONE),
    "CRETI": lambda: (opcodes.CRETI, _NONE, _NONE), "ATCH": _attach,
    "DTCH": lambda event: (opcodes.DTCH, _fixed(_below(int(event), EVENTS)), _NONE),
    "ENI": lambda: (opcodes.ENI, _NONE, _NONE), "PLS": _pulse,
}


_BLOCK: Final = re.compile(r"(ORGANIZATION|SUBROUTINE|INTERRUPT)_BLOCK \w+:(\w+)")
_NO_CODE: Final = re.compile(r"BEGIN|TITLE=.*|Network \d+|END_\w+_BLOCK|")

#: number of a block → number, text and code of its lines
_Rows = dict[int, list[tuple[int, str, list[int]]]]


@lru_cache(maxsize=64)
def assemble(text: str) -> S7200Program:
    """Return a program.

    Raises:
        InputError: by its number, a line that is no known instruction, one outside any block, or one that calls or
            attaches a block that is not there; a subroutine that calls another.
    """
    rows: _Rows = {}
    current: int | None = None
    for number, line in enumerate(text.splitlines(), start=1):
        code = line.split("//")[0].strip()
        match = _BLOCK.fullmatch(code)
        if match is None and _NO_CODE.fullmatch(code):
            continue
        if match is None and current is None:
            raise InputError(f"line {number}: {code!r} stands outside any block")
        try:
            if match is not None:
                current = block_number(match[2])
                rows.setdefault(current, [])
            elif current is not None:
                name, _, rest = code.partition("\t")
                operands = [part.strip() for part in rest.split(",")] if rest else []
                rows[current].append((number, code, instruction(name, operands)))
        except (KeyError, TypeError, ValueError) as problem:
            raise InputError(f"line {number}: {code!r} is no instruction this machine knows") from problem
    _check_calls(rows)
    return _laid_out(rows)


def _check_calls(rows: _Rows) -> None:
    for block, lines in rows.items():
        for number, code, (op, _, target, *_) in lines:
            if op in (CALL, ATCH) and target not in rows:
                raise InputError(f"line {number}: {code!r} names a block that is not there")
            if op == CALL and (is_subroutine(block) or not is_subroutine(target)):
                raise InputError(f"line {number}: {code!r}: only OB1 and interrupts call subroutines here")


def _laid_out(rows: _Rows) -> S7200Program:
    code, begins = array("q"), array("q", [-1] * (1 + max(rows, default=0)))
    for block, lines in rows.items():
        begins[block] = len(code)
        for *_, row in lines:
            code.extend(row)
        code.extend([END] + [0] * (ROW - 1))
    return S7200Program(code, begins)
