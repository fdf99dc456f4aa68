"""An S7-200 CPU: its instructions, and a block of an assembled program run on its memory.

Source: S7-200 System Manual C79000-G7076-C233-01, chapters 5 (memory) and 9; integer instructions pp. 9-70 to 9-77,
REAL and PID pp. 9-76 and 9-84 to 9-91. Plain functions of numbers and bytes, run as they are or compiled,
bit-identical.

Words and double words are signed. Sums return the result and SM1.1 (overflow); on overflow the output operand is
unchanged or, with `wrap`, wrapped.
"""

from __future__ import annotations

import math
from array import array
from typing import Final, NamedTuple

from heatertune.plc.cpu.s7_200.memory import (
    ATTACHED,
    CYCLE,
    ENABLED,
    FAULTS,
    PULSED,
    WIDTH,
    cell,
    double,
    number,
    put_double,
    put_real,
    put_word,
    real,
    word,
    write_number,
)
from heatertune.plc.single_precision import divide_single, real_of, single

__all__ = [
    "ADD_D", "ADD_W", "AND_D", "ASSIGN", "ATCH", "CALL", "CRETI", "DIV", "DIV_R", "DTCH", "DTR", "END", "ENI", "ITD",
    "LAST_LOAD", "LAST_MOVE", "LAST_REAL", "LAST_SHIFT", "LAST_SUM", "LD", "LDD", "LDR", "LDW", "MOV_B", "MOV_D",
    "MOV_W", "MUL", "MUL_R", "PID", "PLS", "RELATIONS", "ROUND", "ROW", "SET", "SHIFT_D", "SUB_D", "SUB_W", "XOR_D",
    "S7200Program", "add_integers", "calculate", "carry_out", "divide_integers", "flag", "high_word",
    "multiply_integers", "to_signed",
]




def to_signed(value: int, bits: int) -> int:
    """Return the low bits of a number as a signed one."""
    half = 1 << (bits - 1)
    return (value + half) % (2 * half) - half


def high_word(value: int) -> int:
    """Return the high 16 bits of a double word as a signed word: the floor of value/65536."""
    return value >> 16


def add_integers(output: int, operand: int, bits: int, wrap: bool) -> tuple[int, bool]:
    """+I, −I, +D, −D: output plus operand (negative for a difference), and whether it overflows."""
    wrapped = to_signed(output + operand, bits)
    if wrapped == output + operand:
        return wrapped, False
    return (wrapped if wrap else output), True


def multiply_integers(first: int, second: int) -> int:
    """MUL: the low words of both → double word; it cannot overflow."""
    return to_signed(first, 16) * to_signed(second, 16)


def divide_integers(dividend: int, divisor: int) -> tuple[int, bool]:
    """DIV: low word of `dividend` / divisor → remainder in the high word, quotient in the low word.

    Returns the double word and whether SM1.3 (division by zero) is set; then the operand stays.
    """
    low = to_signed(dividend, 16)
    if divisor == 0:
        return dividend, True
    quotient = abs(low) // abs(divisor) * (1 if (low < 0) == (divisor < 0) else -1)
    remainder = low - quotient * divisor
    return (remainder << 16) | (quotient & 0xFFFF), False


#: integers of an instruction in a program's code: its number, then, for both operands, whether it is a constant, and
#: the constant or place
ROW: Final = 5

#: relations of two operands; a comparison's number is LDW, LDD or LDR plus its place here
RELATIONS: Final = ("=", "<", ">", "<=", ">=")

# what sets the top of the logic stack
LD: Final = 0
LDW: Final = 1
LDD: Final = 6
LDR: Final = 11
LAST_LOAD: Final = 15
# what is carried out whatever it is
ASSIGN: Final = 16
END: Final = 17
# what is carried out where it is 1
MOV_B: Final = 18
MOV_W: Final = 19
MOV_D: Final = 20
LAST_MOVE: Final = 20
ADD_W: Final = 21
SUB_W: Final = 22
ADD_D: Final = 23
SUB_D: Final = 24
LAST_SUM: Final = 24
MUL: Final = 25
DIV: Final = 26
AND_D: Final = 27
XOR_D: Final = 28
SHIFT_D: Final = 29
LAST_SHIFT: Final = 29
MUL_R: Final = 30
DIV_R: Final = 31
ITD: Final = 32
DTR: Final = 33
ROUND: Final = 34
PID: Final = 35
LAST_REAL: Final = 35
SET: Final = 36
CALL: Final = 37
CRETI: Final = 38
ATCH: Final = 39
DTCH: Final = 40
ENI: Final = 41
PLS: Final = 42


_SECONDS: Final = 60.0  # Ti and Td are in minutes
_LARGEST: Final = 2147483647

#: offsets in the loop table (Table 9-19), all REAL
_PV, _SP, _M, _KC, _TS, _TI, _TD, _MX, _PV_BEFORE = range(0, 36, 4)


def calculate(memory: bytearray, op: int, is_constant: bool, operand: int, output: int) -> int:
    """Carry out an instruction; return 0 where it leaves the flags alone, 1 where its result is sound, else 2.

    A result that is no number is not written; ROUND goes to the nearest whole number, halves away from zero.

    Args:
        memory: all of it.
        op: which.
        is_constant: whether `operand` is one, the bits of a REAL.
        operand: else its place; of PID the loop table's.
        output: place of the output; PID has none.
    """
    if op == ITD:
        put_double(memory, output, word(memory, operand))
        return 0
    if op == DTR:
        put_real(memory, output, single(float(double(memory, operand))))
        return 0
    if op not in (MUL_R, DIV_R, ROUND):
        return _pid(memory, operand)
    value = real_of(operand if is_constant else double(memory, operand))
    if op == ROUND:
        return _round(memory, value, output)
    before = real(memory, output)
    result = single(before * value) if op == MUL_R else divide_single(before, value)
    if not math.isfinite(result):
        return 2
    put_real(memory, output, result)
    return 1


def _round(memory: bytearray, value: float, output: int) -> int:
    if not (math.isfinite(value) and abs(value) + 0.5 <= _LARGEST):
        return 2
    put_double(memory, output, to_signed(int(math.copysign(math.floor(abs(value) + 0.5), value)), 32))
    return 1


def _pid(memory: bytearray, table: int) -> int:
    """Carry out the PID instruction on the loop table that stands there; see the manual's equations on p. 9-86.

    MP = Kc·(SP − PV), MI = Kc·(Ts/Ti)·(SP − PV) + MX, MD = Kc·(Td/Ts)·(PV_{n−1} − PV); with Kc = 0 the factor is 1 in I
    and D. A bias that would drive M out of 0…1 is taken back. A result that is no number leaves M and MX as they were.
    After STOP → RUN the loop goes on from what the table holds: only a 0 → 1 of the instruction's power flow would set
    SP, MX and PV_{n−1} (p. 9-92), and the programs here never take it away.
    """
    pv, sp, kc = real(memory, table + _PV), real(memory, table + _SP), real(memory, table + _KC)
    ts, ti, td = real(memory, table + _TS), real(memory, table + _TI), real(memory, table + _TD)
    mx, before = real(memory, table + _MX), real(memory, table + _PV_BEFORE)
    error = single(sp - pv)
    factor = kc if kc != 0.0 else 1.0
    proportional = single(kc * error)
    change = single(single(factor * divide_single(ts, single(_SECONDS * ti))) * error)
    derivative = single(single(factor * divide_single(single(_SECONDS * td), ts)) * single(before - pv))
    integral = single(change + mx)
    output = single(single(proportional + integral) + derivative)
    bias = integral
    if not 0.0 <= output <= 1.0:
        bias = single((1.0 if output > 1.0 else 0.0) - single(proportional + derivative))
    if not (math.isfinite(output) and math.isfinite(bias)):
        return 2
    put_real(memory, table + _M, min(max(output, 0.0), 1.0))
    put_real(memory, table + _MX, min(max(bias, 0.0), 1.0))
    put_real(memory, table + _PV_BEFORE, pv)
    return 1


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
    """Return the top of the logic stack after a load or a comparison."""
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
