"""Statements as simple as the simplest target: assignments of sums, under one comparison at most.

They are written as structured text, so that a controller which has that takes them as they stand. The other printers
take them as steps. For whole numbers NOT (a < b) is a >= b; a REAL that is no number makes the difference.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Final, NamedTuple

from heatertune.plc.cpu.iec.text import Assignment, Branches, Expression, Literal, Name, Operation, body_of

__all__ = ["OPPOSITE", "Group", "Operand", "Set", "Step", "SumTerm", "if_", "renamed", "steps"]

#: comparison of whole numbers → the one that holds where it does not
OPPOSITE: Final = {"<": ">=", ">": "<=", "<=": ">", ">=": "<", "=": "<>", "<>": "="}


class Group(NamedTuple):
    """Some statements, and what they do."""

    title: str
    lines: str


def if_(condition: str, *then: str) -> str:
    """Return assignments under a comparison."""
    return f"IF {condition} THEN\n" + "".join(f"  {each};\n" for each in then) + "END_IF;\n"


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


def renamed(groups: Iterable[Group], names: Mapping[str, str]) -> Iterator[Group]:
    """Yield statements with a program's own names in the place of some cells' names."""
    for group in groups:
        yield group._replace(lines=re.sub(r"[A-Z]\w*", lambda match: names.get(match[0], match[0]), group.lines))


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
        sets = (_set(each, lines) for each in arm.body if isinstance(each, Assignment))
        yield Step(_comparison(arm.condition), tuple(sets))
    if free:
        yield Step(None, tuple(free))


def _comparison(condition: Expression | None) -> tuple[str, Operand, Operand]:
    assert isinstance(condition, Operation)
    if condition.sign == "NOT":
        relation, first, second = _comparison(condition.operands[0])
        return OPPOSITE[relation], first, second
    first, second = map(_operand, condition.operands)
    return condition.sign, first, second


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
