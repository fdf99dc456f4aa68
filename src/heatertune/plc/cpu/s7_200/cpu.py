"""An S7-200 at work: a block of an assembled program, carried out on its memory.

Followed: S7-200 System Manual C79000-G7076-C233-01, chapters 5 (memory) and 9 (instructions). Plain functions of
numbers and bytes, run as they are or compiled with the loop they stand in, the same bit for bit.
"""

from __future__ import annotations

from array import array
from typing import Final, NamedTuple

from heatertune.plc.cpu.s7_200.arithmetic import add_integers, divide_integers, multiply_integers, to_signed
from heatertune.plc.cpu.s7_200.cells import ATTACHED, CYCLE, ENABLED, FAULTS, PULSED, WIDTH, cell
from heatertune.plc.cpu.s7_200.memory import double, number, put_double, put_word, word, write_number
from heatertune.plc.cpu.s7_200.opcodes import (
    ADD_D,
    ADD_W,
    AND_D,
    ASSIGN,
    ATCH,
    CALL,
    CRETI,
    DTCH,
    END,
    ENI,
    LAST_LOAD,
    LAST_MOVE,
    LAST_REAL,
    LAST_SHIFT,
    LAST_SUM,
    LD,
    LDD,
    LDR,
    LDW,
    MOV_B,
    MOV_W,
    MUL,
    PLS,
    ROW,
    SET,
    SHIFT_D,
)
from heatertune.plc.cpu.s7_200.real import calculate
from heatertune.plc.single_precision import real_of

__all__ = ["S7200Program", "carry_out", "flag"]

_ZERO, _OVERFLOW, _NEGATIVE, _BY_ZERO = 1, 2, 4, 8  # bits of SMB1
_SMB1: Final = cell("SMB1", 1).start
_CONTROL, _CYCLE, _WIDTH = (cell(name, width).start for name, width in (("SMB67", 1), ("SMW68", 2), ("SMW70", 2)))
_PWM_ENABLED: Final = 0xC0


class S7200Program(NamedTuple):
    """A program as the CPU takes it.

    Attributes:
        code: its instructions, `ROW` integers each; every block ends with END.
        begins: where in `code` a block begins, by the block's number; -1: it is not there.
    """

    code: array[int]
    begins: array[int]


def carry_out(program: S7200Program, memory: bytearray, block: int, wrap: bool) -> None:
    """Carry out a block up to its end or its return.

    An instruction other than a load or an assignment is carried out where the top of the logic stack is 1.

    Args:
        program: as assembled.
        memory: all of it; it is changed.
        block: its number.
        wrap: whether an overflowing sum writes its wrapped result.
    """
    code, at, back, top = program.code, program.begins[block], -1, True
    memory[PULSED] = memory[FAULTS] = 0
    while True:
        op, operand, output, here = code[at], code[at + 2], code[at + 4], at
        at += ROW
        if op <= LAST_LOAD:
            top = _loaded(code, here, memory)
        elif op == ASSIGN:
            _assign(memory, operand, output, top)
        elif op == END or (op == CRETI and top):
            if back < 0:
                return
            at, back, top = back, -1, True
        elif top and op == CALL:
            at, back = program.begins[operand], at
        elif top:
            _act(code, here, memory, wrap)


def flag(memory: bytearray, result: int, overflow: bool, by_zero: bool) -> None:
    """Set SM1.0 to SM1.3 as an arithmetic instruction leaves them."""
    if overflow or by_zero:
        memory[_SMB1] = _OVERFLOW * overflow + _BY_ZERO * by_zero
        memory[FAULTS] |= memory[_SMB1]
    else:
        memory[_SMB1] = _ZERO * (result == 0) + _NEGATIVE * (result < 0)


def _loaded(code: array[int], at: int, memory: bytearray) -> bool:
    """Return what a load or a comparison makes of the top of the logic stack."""
    op = code[at]
    if op == LD:
        return memory[code[at + 2]] & code[at + 4] != 0
    width = 2 if op < LDD else 4
    first = code[at + 2] if code[at + 1] else number(memory, code[at + 2], width)
    second = code[at + 4] if code[at + 3] else number(memory, code[at + 4], width)
    if op >= LDR:
        return _holds(op - LDR, real_of(first), real_of(second))
    return _holds(op - (LDW if op < LDD else LDD), first, second)


def _holds(relation: int, first: float, second: float) -> bool:
    """Return whether a relation, by its place in `RELATIONS`, holds; none does of what is no number."""
    if relation < 2:
        return first < second if relation else first == second
    if relation == 2:
        return first > second
    return first <= second if relation == 3 else first >= second


def _assign(memory: bytearray, at: int, mask: int, value: bool) -> None:
    memory[at] = memory[at] | mask if value else memory[at] & 0xFF - mask


def _act(code: array[int], at: int, memory: bytearray, wrap: bool) -> None:
    """Carry out what is no load, assignment, call or return."""
    op, is_constant, operand, output = code[at], code[at + 1] != 0, code[at + 2], code[at + 4]
    if op <= LAST_MOVE:
        width = 1 if op == MOV_B else 2 if op == MOV_W else 4
        write_number(memory, output, width, operand if is_constant else number(memory, operand, width))
    elif op <= LAST_SUM:
        _sum(memory, op, operand if is_constant else number(memory, operand, 2 if op < ADD_D else 4), output, wrap)
    elif op <= LAST_SHIFT:
        _combine(memory, op, is_constant, operand, output)
    elif op <= LAST_REAL:
        flags = calculate(memory, op, is_constant, operand, output)
        if flags:
            flag(memory, 0, flags > 1, False)
    else:
        _control(memory, op, operand, output)


def _sum(memory: bytearray, op: int, operand: int, output: int, wrap: bool) -> None:
    width = 2 if op < ADD_D else 4
    operand = operand if op in (ADD_W, ADD_D) else -operand
    result, overflow = add_integers(number(memory, output, width), operand, 8 * width, wrap)
    write_number(memory, output, width, result)
    flag(memory, result, overflow, False)


def _combine(memory: bytearray, op: int, is_constant: bool, operand: int, output: int) -> None:
    """Carry out products, quotients, logic and shifts of double words."""
    before = double(memory, output)
    if op < AND_D:
        factor = operand if is_constant else word(memory, operand)
        after, by_zero = (multiply_integers(factor, before), False) if op == MUL else divide_integers(before, factor)
        flag(memory, after if op == MUL else to_signed(after, 16), False, by_zero)
    elif op == SHIFT_D:
        after = (before & 0xFFFFFFFF) >> min(operand if is_constant else number(memory, operand, 1), 32)
    else:
        mask = operand if is_constant else double(memory, operand)
        after = before & mask if op == AND_D else before ^ mask
    put_double(memory, output, after)


def _control(memory: bytearray, op: int, operand: int, output: int) -> None:
    if op == SET:
        _assign(memory, operand, output, True)
    elif op == ATCH:
        memory[ATTACHED + output] = operand
    elif op == DTCH:
        memory[ATTACHED + operand] = 0
    elif op == ENI:
        memory[ENABLED] = 1
    elif op == PLS:
        _pulse(memory)


def _pulse(memory: bytearray) -> None:
    """PLS 0: hand those registers to the PWM generator whose update bits in SMB67 are set."""
    control = memory[_CONTROL]
    if control & _PWM_ENABLED != _PWM_ENABLED:
        return
    if control & 1:
        put_word(memory, CYCLE, word(memory, _CYCLE))
    if control & 2:
        put_word(memory, WIDTH, word(memory, _WIDTH))
    memory[PULSED] = 1
