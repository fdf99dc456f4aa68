"""REAL and PID instructions of an S7-200 (System Manual C79000-G7076-C233-01, pp. 9-76 and 9-84 to 9-91)."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from typing import Final

from heatertune.plc.cpu.s7_200.arithmetic import signed
from heatertune.plc.cpu.s7_200.cells import Cell, cell
from heatertune.plc.cpu.s7_200.cpu import Action, Cpu
from heatertune.plc.single import divided, single

__all__ = ["REAL_INSTRUCTIONS", "pid"]

_SECONDS: Final = 60.0  # Ti and Td are in minutes
_LARGEST: Final = 2147483647

#: offsets in the loop table (Table 9-19), all REAL
_PV, _SP, _M, _KC, _TS, _TI, _TD, _MX, _PV_BEFORE = range(0, 36, 4)


def _read(cpu: Cpu, place: Cell) -> float:
    value: float = struct.unpack(">f", cpu.memory[place.start : place.start + 4])[0]
    return value


def _write(cpu: Cpu, place: Cell, value: float) -> None:
    cpu.memory[place.start : place.start + 4] = struct.pack(">f", value)


def _number(text: str) -> float | None:
    try:
        return single(float(text))
    except ValueError:
        return None


def _operand(text: str) -> Callable[[Cpu], float]:
    number = _number(text)
    if number is not None:
        return lambda cpu: number  # noqa: ARG005 - a constant needs no CPU
    place = cell(text, 4)
    return lambda cpu: _read(cpu, place)


def _move(source: str, target: str) -> Action:
    read, place = _operand(source), cell(target, 4)
    return lambda cpu: _write(cpu, place, read(cpu))


def _calculate(of: Callable[[float, float], float]) -> Callable[[str, str], Action]:
    """*R, /R: OUT := OUT op IN; a result that is no number sets SM1.1 and is not written."""

    def build(operand: str, output: str) -> Action:
        read, place = _operand(operand), cell(output, 4)

        def act(cpu: Cpu) -> None:
            result = of(_read(cpu, place), read(cpu))
            if math.isfinite(result):
                _write(cpu, place, result)
            cpu.flag(0, overflow=not math.isfinite(result))

        return act

    return build


def _from_integer(operand: str, output: str) -> Action:
    """DTR."""
    source, place = cell(operand, 4), cell(output, 4)
    return lambda cpu: _write(cpu, place, single(float(cpu.get(source))))


def _widen(operand: str, output: str) -> Action:
    """ITD."""
    source, place = cell(operand, 2), cell(output, 4)
    return lambda cpu: cpu.put(place, cpu.get(source))


def _round(operand: str, output: str) -> Action:
    """ROUND: to the nearest whole number, halves away from zero; beyond 32 bits sets SM1.1 and writes nothing."""
    read, place = _operand(operand), cell(output, 4)

    def act(cpu: Cpu) -> None:
        value = read(cpu)
        fits = math.isfinite(value) and abs(value) + 0.5 <= _LARGEST
        if fits:
            cpu.put(place, signed(int(math.copysign(math.floor(abs(value) + 0.5), value)), 32))
        cpu.flag(0, overflow=not fits)

    return act


def _pid(table: str, loop: str) -> Action:
    start, number = cell(table, 1).start, int(loop)
    if not table.startswith("VB") or not 0 <= number <= 7:  # eight loops at most
        raise ValueError(table, loop)
    return lambda cpu: pid(cpu, start, number)


def pid(cpu: Cpu, start: int, number: int) -> None:
    """Carry out the PID instruction on the loop table that starts here; see the manual's equations on p. 9-86.

    MP = Kc·(SP − PV), MI = Kc·(Ts/Ti)·(SP − PV) + MX, MD = Kc·(Td/Ts)·(PV_{n−1} − PV); with Kc = 0 the factor is 1 in I
    and D. A bias that would drive M out of 0…1 is taken back. The first call after the start is without a bump: SP is
    set to PV. A result that is no number sets SM1.1 and leaves M and MX as they were.
    """
    pv, sp, kc, ts, ti, td, mx = (_at(cpu, start + at) for at in (_PV, _SP, _KC, _TS, _TI, _TD, _MX))
    before = _at(cpu, start + _PV_BEFORE)
    if number not in cpu.state.loops:
        cpu.state = cpu.state._replace(loops=cpu.state.loops | {number})
        before, mx = pv, _at(cpu, start + _M)
        sp = pv if cpu.bumpless else sp
    error = single(sp - pv)
    factor = kc if kc != 0.0 else 1.0
    proportional = single(kc * error)
    change = single(single(factor * divided(ts, single(_SECONDS * ti))) * error)
    derivative = single(single(factor * divided(single(_SECONDS * td), ts)) * single(before - pv))
    integral = single(change + mx)
    output = single(single(proportional + integral) + derivative)
    fast = single(proportional + derivative)
    bias = integral if 0.0 <= output <= 1.0 else single((1.0 if output > 1.0 else 0.0) - fast)
    sound = all(map(math.isfinite, (output, bias)))
    if sound:
        _put(cpu, start + _M, min(max(output, 0.0), 1.0))
        _put(cpu, start + _MX, min(max(bias, 0.0), 1.0))
        _put(cpu, start + _PV_BEFORE, pv)
    cpu.flag(0, overflow=not sound)


def _at(cpu: Cpu, place: int) -> float:
    return _read(cpu, Cell(place, 4))


def _put(cpu: Cpu, place: int, value: float) -> None:
    _write(cpu, Cell(place, 4), value)


REAL_INSTRUCTIONS: Final[dict[str, Callable[..., Action]]] = {
    "MOVR": _move, "*R": _calculate(lambda a, b: single(a * b)), "/R": _calculate(divided),
    "ITD": _widen, "DTR": _from_integer, "ROUND": _round, "PID": _pid,
}
