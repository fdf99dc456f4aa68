"""Statements printed as STL: for CPUs with two accumulators, the S5 and the S7-300, and as networks for the S7-200.

Those load, add, compare and jump over what a comparison leaves out. On the S7-200 each comparison begins a network.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import Final, final

from heatertune.plc.cpu.s7_200.assembler import Network
from heatertune.plc.print.statements import OPPOSITE, Group, Operand, Set, Step, SumTerm, steps
from heatertune.plc.ramp import Ramp

__all__ = ["ALWAYS", "Printer", "S5Printer", "S7300Printer", "networks", "ramp_begins"]

#: what stands in the lines below a call of a block of the S5: its name and its operands
_BELOW_CALL: Final = ("NAME", "Z1", "Z2", "Z3=0", "Z32", "Z31")
#: columns of an S5 statement before its remark
_WIDTH: Final = 20
#: begins a network without a comparison
ALWAYS: Final = "LD SM0.0"


class Printer(ABC):
    """Prints statements of one block; the labels count on from one group to the next."""

    def __init__(self) -> None:
        """Begin with the first label."""
        self._label, self._pending = 0, ""

    @final
    def print_group(self, group: Group) -> Iterator[str]:
        """Yield the lines of a group; where its last comparison jumps to, stands before the next line."""
        for step in steps(group):
            over = self._next() if step.condition else ""
            for line in self._step(step, over):
                yield self.next(*line)
            self._pending = over

    @final
    def next(self, operation: str, operand: str = "", remark: str = "") -> str:
        """Return the next line, with its label if there is a jump to it."""
        label, self._pending = self._pending, ""
        return self.line(label, operation, operand, remark)

    @final
    def print_groups(self, groups: Iterable[Group]) -> Iterator[str]:
        """Yield the lines of groups, each below what it does."""
        for group in groups:
            yield f"// {group.title}"
            yield from self.print_group(group)

    @final
    def mark(self, label: str) -> None:
        """Let a label stand before the next line."""
        self._pending = label

    @abstractmethod
    def line(self, label: str, operation: str, operand: str = "", remark: str = "") -> str:
        """Return a line of the text."""

    @abstractmethod
    def operand(self, what: Operand) -> str:
        """Return a cell or a constant."""

    @abstractmethod
    def operation(self, sign: str) -> str:
        """Return the sum, difference or comparison that a sign means."""

    @abstractmethod
    def jump(self, label: str) -> tuple[str, str]:
        """Return the jump under a condition."""

    def load(self, what: Operand, remark: str = "") -> Iterator[tuple[str, ...]]:
        """Yield what loads a cell or a constant."""
        yield "L", self.operand(what), remark

    def assign(self, assignment: Set) -> Iterator[tuple[str, ...]] | None:  # noqa: ARG002 - a target's own looks at it
        """Return what gives a cell its sum where it is no plain one; None: it is."""
        return None

    def _next(self) -> str:
        self._label += 1
        return f"M{self._label:03d}"

    def _step(self, step: Step, over: str) -> Iterator[tuple[str, ...]]:
        if step.condition:
            relation, first, second = step.condition
            yield from self.load(first, f"IF {first} {relation} {second}")
            yield from self.load(second)
            yield (self.operation(OPPOSITE[relation]),)
            yield self.jump(over)
        accumulator: tuple[SumTerm, ...] = ()  # what is in the accumulator
        for assignment in step.sets:
            own = self.assign(assignment)
            if own is not None:
                yield from own
                continue
            text = assignment.text.upper()
            if assignment.terms != accumulator:
                yield from self.load(assignment.terms[0].what, text)
                text = ""
                for term in assignment.terms[1:]:
                    yield from self.load(term.what)
                    yield (self.operation("+" if term.sign > 0 else "-"),)
            yield "T", self.operand(assignment.cell), text
            accumulator = assignment.terms if len(assignment.terms) == 1 else ()


class S5Printer(Printer):
    """Prints for the S5-115U.

    Args:
        at: cell in capitals → number of its data word.
    """

    def __init__(self, at: Mapping[str, int]) -> None:
        super().__init__()
        self.at = at

    def line(self, label: str, operation: str, operand: str = "", remark: str = "") -> str:
        """Return label, colon, statement, semicolon, remark."""
        if operation in _BELOW_CALL:
            return f"{operation:5s}:{operand}"
        statement = f"{operation:2s} {operand}".rstrip()
        return f"{label:5s}:{f'{statement:{_WIDTH}s};{remark}' if remark else statement}"

    def operand(self, what: Operand) -> str:
        """Return a data word or a fixed-point constant."""
        return f"KF {what:+d}" if isinstance(what, int) else f"DW {self.at[what.upper()]}"

    def operation(self, sign: str) -> str:
        """Return it for fixed-point numbers."""
        return {"=": "!=F", "<>": "><F"}.get(sign, f"{sign}F")

    def jump(self, label: str) -> tuple[str, str]:
        """Return the jump where the comparison holds."""
        return "JC", f"={label}"


class S7300Printer(Printer):
    """Prints for the S7-300, in 32 bits.

    Args:
        at: cell in capitals → its operand; those not named are members of the block.
        words: cells of 16 bits.
    """

    def __init__(self, at: Mapping[str, str] | None = None, words: Collection[str] = ()) -> None:
        super().__init__()
        self.at, self._words = at or {}, words

    def line(self, label: str, operation: str, operand: str = "", remark: str = "") -> str:
        """Return label, colon, statement, semicolon, remark."""
        mark = f"{label}:" if label else ""
        return f"{mark:6s}{operation:6s}{operand};" + (f"  // {remark}" if remark else "")

    def operand(self, what: Operand) -> str:
        """Return a cell or a constant of 32 bits."""
        return f"L#{what}" if isinstance(what, int) else self.at.get(what, f"#{what}")

    def load(self, what: Operand, remark: str = "") -> Iterator[tuple[str, ...]]:
        """Yield what loads a cell or a constant, a word with its sign."""
        yield "L", self.operand(what), remark
        if what in self._words:
            yield ("ITD",)

    def operation(self, sign: str) -> str:
        """Return it for double integers."""
        return f"{'==' if sign == '=' else sign}D"

    def jump(self, label: str) -> tuple[str, str]:
        """Return the jump where the comparison holds."""
        return "JC", label


def networks(groups: Iterable[Group], at: Mapping[str, str]) -> Iterator[Network]:
    """Yield the networks of statements; AC0 is used.

    Args:
        groups: of statements.
        at: cell in capitals → its word or double word (VD…).
    """
    for group in groups:
        for number, step in enumerate(steps(group)):
            yield Network(_remark(step, group.title if number == 0 else ""), list(_step(step, at)))


def ramp_begins(ramp: Ramp, at: Mapping[str, str]) -> Network:
    """Return the network of the first scan: the setpoint ramp begins at the reading; cells as for `networks`."""
    return Network("setpoint ramp begins at the process variable", [
        ALWAYS, f"MOVW {at['READING']}, {at['LEAD']}", f"MOVW {ramp.calls:+d}, {at['CALLS']}"])


def _remark(step: Step, title: str) -> str:
    does = "; ".join(assignment.text.upper() for assignment in step.sets)
    condition = "" if step.condition is None else "IF {1} {0} {2}: ".format(*step.condition)
    return f"{title}{': ' if title else ''}{condition}{does}"


def _step(step: Step, at: Mapping[str, str]) -> Iterator[str]:
    if step.condition is None:
        yield ALWAYS
    else:
        _, *both = step.condition
        kind = "D" if any(_is_double(each, at) for each in both) else "W"
        yield f"LD{kind}{_relation(step)} {', '.join(_operand(each, at) for each in both)}"
    for assignment in step.sets:
        yield from _double(assignment, at) if _is_double(assignment.cell, at) else _word(assignment, at)


def _relation(step: Step) -> str:
    """Return the relation; where a cell gets what it is compared with, >= or <=, which a CPU 21x has, too."""
    assert step.condition is not None
    relation, first, second = step.condition
    moved = [(assignment.cell, *(term.what for term in assignment.terms)) for assignment in step.sets]
    clamps = moved in ([(first, second)], [(second, first)])
    return f"{relation}=" if clamps and relation in ("<", ">") else relation


def _is_double(what: Operand, at: Mapping[str, str]) -> bool:
    return not isinstance(what, int) and at[what].startswith("VD")


def _operand(what: Operand, at: Mapping[str, str]) -> str:
    return f"{what:+d}" if isinstance(what, int) else at[what]


def _word(assignment: Set, at: Mapping[str, str]) -> Iterator[str]:
    first, *others = assignment.terms
    target = at[assignment.cell]
    assert all(term.what != assignment.cell for term in others)
    if first.what != assignment.cell:
        yield f"MOVW {_operand(first.what, at)}, {target}"
    for term in others:
        yield f"{'+' if term.sign > 0 else '-'}I {_operand(term.what, at)}, {target}"


def _double(assignment: Set, at: Mapping[str, str]) -> Iterator[str]:
    target = at[assignment.cell]
    first, *others = assignment.terms
    if isinstance(first.what, int):
        yield f"MOVD {first.sign * first.what:+d}, {target}"
    elif first.what != assignment.cell:
        yield f"{'MOVD' if _is_double(first.what, at) else 'ITD'} {_operand(first.what, at)}, {target}"
    for term in others:
        summand = _operand(term.what, at)
        if not isinstance(term.what, int) and not _is_double(term.what, at):
            yield f"MOVW {summand}, AC0"
            yield f"MUL {term.factor:+d}, AC0"
            summand = "AC0"
        yield f"{'+' if term.sign > 0 else '-'}D {summand}, {target}"
