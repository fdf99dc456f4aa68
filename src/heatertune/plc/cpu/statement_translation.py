"""What CPUs with two accumulators have alike: the statements of a block as one Python function of the CPU.

Accumulators and status bits are its local names. What stands between two jumps is a part. The function goes through the
parts from the first one on and leaves out those before the place where it is, so that a jump forwards only sets this
place, and one backwards begins anew.

The letters that every programming tool takes in comments: ASCII alone.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple

from heatertune.compiled.loader import functions_from_text
from heatertune.errors import InputError

__all__ = ["Accumulators", "Run", "StatementLine", "Translation", "in_ascii"]


_PLAIN: Final = str.maketrans({"°": "deg", "…": "..", "·": "*", "×": "*", "≤": "<=", "≥": ">=", "−": "-", "–": "-"})


def in_ascii(text: str) -> str:
    """Return a text in ASCII: signs by what is written for them, any other letter as a question mark."""
    return text.translate(_PLAIN).encode("ascii", "replace").decode("ascii")


#: runs a block to its end on a CPU
Run = Callable[[Any], None]

#: jumps backwards of a block that is given up as one without end; the programs here make some hundreds
_MOST: Final = 10_000


class Accumulators:
    """ACCU 1 and ACCU 2, and the result of the last question."""

    def __init__(self) -> None:
        self.one = self.two = 0
        self.true = False


class StatementLine(NamedTuple):
    """A statement of a text: the line it begins in, from 1 on, its label or "", operation and operand."""

    number: int
    label: str
    operation: str
    operand: str

    def __str__(self) -> str:
        """Return it as errors name it."""
        return f"line {self.number}: statement {f'{self.operation} {self.operand}'.strip()!r}"


class Translation(ABC):
    """The function of a block; a CPU's own says what its statements are.

    Attributes:
        lines: the statements.
        labels: label → place of its statement.
        names: what the function's text names.
        keep: text that gives the CPU what the function holds.
        take: text that takes it again.
    """

    keep: str
    take: str

    def __init__(self, lines: Sequence[StatementLine]) -> None:
        self.lines = lines
        self.labels = {line.label: at for at, line in enumerate(lines) if line.label}
        self.names: dict[str, Any] = {"endless": self._endless}
        self._part_of = self._parts()
        self._text, self._of = list[str](), list[int]()  # lines of the function, and the statement each is of

    @abstractmethod
    def ends(self, line: StatementLine) -> str | None:
        """Return the label that a statement jumps to, "" where it may end the block; None: the next one follows."""

    @abstractmethod
    def statement(self, at: int, line: StatementLine) -> list[str]:
        """Return the text of a statement.

        Raises:
            InputError, LookupError, ValueError: it, or its operand, is not known here.
        """

    def first(self, text: Sequence[str]) -> list[str]:  # noqa: ARG002 - a CPU's own looks at it
        """Return the lines before the statements, whose text is given."""
        return []

    def run(self) -> Run:
        """Return what runs the statements.

        Raises:
            InputError: a statement that is not known here. So does the function, where a CPU would stop.
        """
        self.names = functions_from_text(self._function(), self.names)
        run: Run = self.names["run"]

        def carry_out(cpu: Any) -> None:
            try:
                run(cpu)
            except InputError:
                raise
            except (ArithmeticError, LookupError, ValueError, RecursionError) as problem:
                raise InputError(f"{self._statement_of(problem)}; the CPU stops here") from None

        return carry_out

    def goes(self, at: int, label: str) -> list[str]:
        """Return the text of a jump to a label."""
        there = self.labels[label]
        return [f"at = {self._part_of[there]}", *(["continue"] if there <= at else [])]

    def _parts(self) -> list[int]:
        """Return the part that each statement is in."""
        ends = [self.ends(line) for line in self.lines]
        begins = {0, *(self.labels[label] for label in ends if label in self.labels)}
        begins |= {at + 1 for at, label in enumerate(ends) if label is not None}
        parts, part = list[int](), -1
        for at in range(len(self.lines)):
            part += at in begins
            parts.append(part)
        return parts

    def _function(self) -> str:
        """Return its text."""
        for at, line in enumerate(self.lines):
            if at == 0 or self._part_of[at] != self._part_of[at - 1]:
                self._add(at, 2, f"if at <= {self._part_of[at]}:")
            try:
                self._add(at, 3, *self.statement(at, line))
            except (InputError, LookupError, ValueError):
                raise InputError(f"{line}; this is none that is known here") from None
        self._add(len(self.lines) - 1, 0, f"  {self.keep}", "  return", " raise endless(at)")
        first = [" at = 0", *(f" {text}" for text in self.first(self._text))]
        begins = f" for _ in range({_MOST}):" if any(text.endswith("continue") for text in self._text) else " if True:"
        head = ["def run(cpu):", f" {self.take}", *first, begins]
        self._of = [0] * len(head) + self._of
        return "\n".join([*head, *self._text])

    def _add(self, at: int, deep: int, *texts: str) -> None:
        for text in texts:
            self._text.append(" " * deep + text)
            self._of.append(at)

    def _statement_of(self, problem: BaseException) -> StatementLine:
        """Return the statement at which the function stopped."""
        trace, code, at = problem.__traceback__, self.names["run"].__code__, 0
        while trace is not None:
            if trace.tb_frame.f_code is code:
                at = self._of[trace.tb_lineno - 1]
                break
            trace = trace.tb_next
        return self.lines[at]

    def _endless(self, part: int) -> InputError:
        return InputError(f"{self.lines[self._part_of.index(part)]}; the CPU does not come to the end of this block")
