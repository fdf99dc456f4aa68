"""Programs in a small subset of structured text: assignments of sums, under at most one comparison.

A target with structured text takes them as written; the other printers take them as steps. For whole numbers NOT (a <
b) is a >= b; this differs for a REAL that is not a number.

The setpoint ramp (`heatertune.plc.ramp.next_setpoint`) and the PWM (`heatertune.plc.pwm.on_time`) are written once in
this form, for all languages.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Final, NamedTuple

from heatertune.plc.cpu.iec.st_syntax import Assignment, Branches, Expression, Literal, Name, Operation, body_of
from heatertune.plc.ramp import Number, Ramp

__all__ = [
    "CELLS", "OPPOSITE", "Group", "Operand", "Set", "Step", "SumTerm", "if_", "pulse_staircase", "renamed",
    "setpoint_ramp", "steps",
]


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


#: cell → what it holds, beside Asked, the setpoint asked for, Reading, and Lead, the setpoint on its way
CELLS: Final = {
    "Calls": "calls until the ramp's next step", "Size": "of the step in this call", "Ahead": "a step on",
    "Back": "a step back", "End": "how far the reading lets it go",
}


def setpoint_ramp(ramp: Ramp, write: Callable[[Number], str] = str) -> Iterator[Group]:
    """Yield the statements of one call: Lead moves a step towards Asked, or by what is left.

    A step of nothing leaves it where it is. A holdback keeps it near the reading on the side that heats, and ends its
    way back there. No reading or setpoint that is no number holds it up.

    Args:
        ramp: how it moves.
        write: a number of units → a constant of the language.
    """
    ahead, back, beyond, short = ("-", "+", "<", ">") if ramp.cools else ("+", "-", ">", "<")
    size, hold = write(ramp.step), "" if ramp.hold is None else write(abs(ramp.hold))
    if ramp.calls > 1:
        yield Group(f"setpoint ramp: a step in every {ramp.calls} calls, else none", "".join((
            f"Size := {write(0 * ramp.step)};\nCalls := Calls - 1;\n",
            if_("Calls <= 0", f"Size := {size}", f"Calls := {ramp.calls}"))))
        size = "Size"
    yield Group("setpoint ramp: a step back", f"Back := Lead {back} {size};\n")
    if hold:
        yield Group("not farther back than the holdback from the reading, and never forwards", "".join((
            f"End := Reading {back} {hold};\n", if_(f"Back {short} End", "Back := End"),
            if_(f"NOT (Back {short}= Lead)", "Back := Lead"))))
    yield Group("a step ahead, up to what is asked for; back only where that is not reached", "".join((
        f"Ahead := Lead {ahead} {size};\n", if_(f"NOT (Ahead {short}= Asked)", "Ahead := Asked"), "Lead := Ahead;\n",
        if_(f"Back {beyond} Lead", "Lead := Back"))))
    if hold:
        yield Group("never farther ahead than the holdback from the reading", "".join((
            f"End := Reading {ahead} {hold};\n", if_(f"Lead {beyond} End", "Lead := End"))))


def pulse_staircase(ticks: int, full: int, least: int, most: int) -> Iterator[Group]:
    """Yield the statements of one tick of a PWM without multiplication: the heater is on while Held >= Stair.

    At tick j of N the staircase stands at (2j + 1)·full/(2N), rounded up; Rest is what it is above that, in parts of
    2N. So the first ticks of a period are on: the nearest number of them, halves up. Above `full` a period begins, and
    Power is taken over.

    Args:
        ticks: of a period.
        full: power of all its ticks.
        least: smallest power with a pulse.
        most: largest power with a pause.
    """
    parts = 2 * ticks
    first, step = -(-full // parts), divmod(2 * full, parts)
    yield Group("PWM: the staircase rises", "".join((
        f"Stair := Stair + {step[0]};\nRest := Rest - {step[1]};\n",
        if_("Rest < 0", "Stair := Stair + 1", f"Rest := Rest + {parts}"))))
    yield Group("above full power a period begins; the power asked for is taken over", if_(
        f"Stair > {full}", f"Stair := {first}", f"Rest := {first * parts - full}", "Held := Power"))
    yield Group("a pulse or a pause that is too short is left out", "".join((
        if_(f"Held < {least}", "Held := 0"), if_(f"Held > {most}", f"Held := {full}"))))
