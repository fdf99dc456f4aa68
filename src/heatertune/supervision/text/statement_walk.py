"""The statements of a monitor as what any printer has to write: assignments under a comparison."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from heatertune.errors import InputError
from heatertune.plc.cpu.iec.text import Assignment, Branches, Expression, Literal, Name, Operation, body_of
from heatertune.supervision.monitor import Numbers
from heatertune.supervision.text.statements import MARGIN, Group

__all__ = ["Operand", "Set", "Step", "SumTerm", "check_reach", "steps"]

#: a cell's name in capitals, or a whole number
Operand = str | int


class SumTerm(NamedTuple):
    """A part of a sum: its sign, the factor before it, and what is added."""

    sign: int
    factor: int
    what: Operand


class Set(NamedTuple):
    """A cell gets a sum; as structured text, too."""

    cell: str
    terms: tuple[SumTerm, ...]
    text: str


class Step(NamedTuple):
    """Some of them, under a comparison of two operands (relation, first, second) or whatever is."""

    condition: tuple[str, Operand, Operand] | None
    sets: tuple[Set, ...]


def steps(group: Group) -> Iterator[Step]:
    """Yield the steps of a group; assignments in a row are one."""
    free = list[Set]()
    lines = group.lines.splitlines()
    for statement in body_of(group.lines):
        if isinstance(statement, Assignment):
            free.append(_set(statement, lines))
            continue
        if free:
            yield Step(None, tuple(free))
            free = []
        assert isinstance(statement, Branches)
        (arm,) = statement.arms
        assert isinstance(arm.condition, Operation)
        first, second = map(_operand, arm.condition.operands)
        yield Step((arm.condition.sign, first, second),
                   tuple(_set(each, lines) for each in arm.body if isinstance(each, Assignment)))
    if free:
        yield Step(None, tuple(free))


def _set(statement: Assignment, lines: Sequence[str]) -> Set:
    return Set(statement.target.path[0], tuple(_terms(statement.value)), lines[statement.line - 1].strip().rstrip(";"))


def _terms(value: Expression, sign: int = 1) -> Iterator[SumTerm]:
    if isinstance(value, Operation) and value.sign in "+-":
        first, second = value.operands
        yield from _terms(first, sign)
        yield from _terms(second, sign if value.sign == "+" else -sign)
    elif isinstance(value, Operation):
        factor, what = map(_operand, value.operands)
        assert isinstance(factor, int)
        yield SumTerm(sign, factor, what)
    else:
        yield SumTerm(sign, 1, _operand(value))


def _operand(value: Expression) -> Operand:
    if isinstance(value, Name):
        return value.path[0]
    assert isinstance(value, Literal)
    return int(value.value)


def check_reach(numbers: Numbers, highest: int, bits: int) -> None:
    """Refuse a monitor whose cells cannot hold what its card may give.

    Args:
        numbers: of the monitor.
        highest: count of the card, from 0 on.
        bits: of each cell but `Margin`, which has 32; the factors before cells are as wide.

    Raises:
        InputError: it does not fit; the error tells which number.
    """
    window, level = max(numbers.slow_blocks, numbers.fast_blocks), numbers.block * highest
    powers = 100 * numbers.block * window
    held = {"the sum of a block's readings": level, "the sum of a window's powers": powers} | {
        name: abs(value) for name, value in numbers._asdict().items() if not name.endswith("_rest")}
    for name, value in held.items():
        if value >= 1 << bits - 1:
            raise InputError(f"no program: {name} may be {value}, which {bits} bits do not hold")
    for of in ("slow", "fast"):
        scale, gain, loss, rest = (getattr(numbers, f"{of}_{name}") for name in ("scale", "gain", "loss", "rest"))
        most = scale * level + gain * powers + loss * level + abs(rest)
        if most >= 1 << 31:
            raise InputError(f"no program: what the {of} rule adds up may be {most}, which 32 bits do not hold")


#: cells that are twice as wide as the others where these are words
WIDE = MARGIN.upper()
