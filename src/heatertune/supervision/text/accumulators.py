"""The monitor for CPUs with two accumulators, the S5 and the S7-300: loads, sums, comparisons, short jumps."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import Final, final

from heatertune.supervision.text.statements import WIDE, Group, Operand, Set, Step, SumTerm, steps

__all__ = ["Printer"]

#: what jumps over the statements under a comparison
_ELSE: Final = {"<": ">=", ">": "<=", "<=": ">", ">=": "<", "=": "<>"}


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

    @abstractmethod
    def wide(self, made: Set) -> Iterator[tuple[str, ...]]:
        """Yield what gives `Margin` a sum of products."""

    @abstractmethod
    def sign_of_wide(self) -> tuple[str, Operand]:
        """Return what is loaded to ask whether `Margin` is below 0, and what it is compared with."""

    def _next(self) -> str:
        self._label += 1
        return f"M{self._label:03d}"

    def _step(self, step: Step, over: str) -> Iterator[tuple[str, ...]]:
        if step.condition:
            relation, first, second = step.condition
            loaded, beside = self.sign_of_wide() if first == WIDE else (self.operand(first), second)
            yield "L", loaded, f"IF {first} {relation} {second}"
            yield "L", self.operand(beside)
            yield (self.operation(_ELSE[relation]),)
            yield self.jump(over)
        held: tuple[SumTerm, ...] = ()  # what is in the accumulator
        for made in step.sets:
            if made.cell == WIDE:
                yield from self.wide(made)
                continue
            text = made.text.upper()
            if made.terms != held:
                yield "L", self.operand(made.terms[0].what), text
                text = ""
                for term in made.terms[1:]:
                    yield "L", self.operand(term.what)
                    yield (self.operation("+" if term.sign > 0 else "-"),)
            yield "T", self.operand(made.cell), text
            held = made.terms if len(made.terms) == 1 else ()
