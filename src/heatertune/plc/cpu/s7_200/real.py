"""REAL and PID instructions of an S7-200 (System Manual C79000-G7076-C233-01, pp. 9-76 and 9-84 to 9-91)."""

from __future__ import annotations

import math
from typing import Final

from heatertune.plc.cpu.s7_200.arithmetic import to_signed
from heatertune.plc.cpu.s7_200.memory import double, put_double, put_real, real, word
from heatertune.plc.cpu.s7_200.opcodes import DIV_R, DTR, ITD, MUL_R, ROUND
from heatertune.plc.single_precision import divide_single, real_of, single

__all__ = ["calculate"]

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
