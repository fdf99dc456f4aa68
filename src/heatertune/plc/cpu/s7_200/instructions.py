"""The instructions of an S7-200 that this project's programs use: mnemonic and operands → action on the CPU."""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Sequence
from typing import Final

from heatertune.plc.cpu.s7_200.arithmetic import added, divided, multiplied, signed
from heatertune.plc.cpu.s7_200.cells import bit, cell, constant
from heatertune.plc.cpu.s7_200.cpu import Action, Cpu
from heatertune.plc.cpu.s7_200.real import REAL_INSTRUCTIONS

__all__ = ["instruction"]

_Read = Callable[[Cpu], int]


def instruction(name: str, operands: Sequence[str]) -> Action:
    """Return what an instruction does.

    Raises:
        KeyError, TypeError, ValueError: an unknown mnemonic, a wrong number of operands, a wrong operand.
    """
    if compared := re.fullmatch(r"LD([WD])(=|<|>|<=|>=)", name):
        return _compare(2 if compared[1] == "W" else 4, _RELATIONS[compared[2]], *operands)
    if name in REAL_INSTRUCTIONS:
        return _where_on(REAL_INSTRUCTIONS[name](*operands))
    return _INSTRUCTIONS[name](*operands)


def _operand(text: str, width: int) -> _Read:
    """Return what reads a constant or a cell of this width [bytes]."""
    value = constant(text)
    if value is None:
        place = cell(text, width)
        return lambda cpu: cpu.get(place)
    number = value if width == 1 else signed(value, 8 * width)
    return lambda cpu: number  # noqa: ARG005 - a constant needs no CPU


def _where_on(action: Action) -> Action:
    def act(cpu: Cpu) -> None:
        if cpu.top:
            action(cpu)

    return act


def _load(name: str) -> Action:
    place, mask = bit(name)

    def act(cpu: Cpu) -> None:
        cpu.top = bool(cpu.memory[place] & mask)

    return act


def _compare(width: int, holds: Callable[[int, int], bool], first: str, second: str) -> Action:
    left, right = _operand(first, width), _operand(second, width)

    def act(cpu: Cpu) -> None:
        cpu.top = holds(left(cpu), right(cpu))

    return act


def _assign(name: str) -> Action:
    place, mask = bit(name)

    def act(cpu: Cpu) -> None:
        cpu.memory[place] = cpu.memory[place] | mask if cpu.top else cpu.memory[place] & ~mask

    return act


def _set(name: str, count: str) -> Action:
    if count != "1":
        raise ValueError(count)
    return _where_on(_assign(name))


def _move(width: int) -> Callable[[str, str], Action]:
    def build(source: str, target: str) -> Action:
        read, place = _operand(source, width), cell(target, width)
        return _where_on(lambda cpu: cpu.put(place, read(cpu)))

    return build


def _sum(width: int, sign: int) -> Callable[[str, str], Action]:
    def build(operand: str, output: str) -> Action:
        read, place = _operand(operand, width), cell(output, width)

        def act(cpu: Cpu) -> None:
            result, overflow = added(cpu.get(place), sign * read(cpu), 8 * width, cpu.wrap)
            cpu.put(place, result)
            cpu.flag(result, overflow=overflow)

        return _where_on(act)

    return build


def _multiply(operand: str, output: str) -> Action:
    read, place = _operand(operand, 2), cell(output, 4)

    def act(cpu: Cpu) -> None:
        result = multiplied(read(cpu), cpu.get(place))
        cpu.put(place, result)
        cpu.flag(result)

    return _where_on(act)


def _divide(operand: str, output: str) -> Action:
    read, place = _operand(operand, 2), cell(output, 4)

    def act(cpu: Cpu) -> None:
        result, by_zero = divided(cpu.get(place), read(cpu))
        cpu.put(place, result)
        cpu.flag(signed(result, 16), by_zero=by_zero)

    return _where_on(act)


def _logic(combine: Callable[[int, int], int]) -> Callable[[str, str], Action]:
    def build(operand: str, output: str) -> Action:
        read, place = _operand(operand, 4), cell(output, 4)
        return _where_on(lambda cpu: cpu.put(place, combine(cpu.get(place), read(cpu))))

    return build


def _shift_right(output: str, count: str) -> Action:
    place, read = cell(output, 4), _operand(count, 1)
    return _where_on(lambda cpu: cpu.put(place, (cpu.get(place) & 0xFFFFFFFF) >> min(read(cpu), 32)))


def _return() -> Action:
    def act(cpu: Cpu) -> None:
        cpu.returned = True

    return _where_on(act)


def _attach(block: str, event: str) -> Action:
    return _where_on(lambda cpu: _route(cpu, int(event), block))


def _detach(event: str) -> Action:
    return _where_on(lambda cpu: _route(cpu, int(event), None))


def _route(cpu: Cpu, event: int, block: str | None) -> None:
    others = tuple(pair for pair in cpu.state.attached if pair[0] != event)
    cpu.state = cpu.state._replace(attached=others if block is None else (*others, (event, block)))


def _enable() -> Action:
    def act(cpu: Cpu) -> None:
        cpu.state = cpu.state._replace(enabled=True)

    return _where_on(act)


def _pulse(output: str) -> Action:
    if output != "0":
        raise ValueError(output)
    return _where_on(Cpu.pulse)


_RELATIONS: Final = {
    "=": operator.eq, "<": operator.lt, ">": operator.gt, "<=": operator.le, ">=": operator.ge,
}

_INSTRUCTIONS: Final[dict[str, Callable[..., Action]]] = {
    "LD": _load, "=": _assign, "S": _set,
    "MOVB": _move(1), "MOVW": _move(2), "MOVD": _move(4),
    "+I": _sum(2, 1), "-I": _sum(2, -1), "+D": _sum(4, 1), "-D": _sum(4, -1),
    "MUL": _multiply, "DIV": _divide,
    "ANDD": _logic(operator.and_), "XORD": _logic(operator.xor), "SRD": _shift_right,
    "CALL": lambda block: _where_on(lambda cpu: cpu.call(block)),
    "CRETI": _return, "ATCH": _attach, "DTCH": _detach, "ENI": _enable, "PLS": _pulse,
}
