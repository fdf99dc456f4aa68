"""What CPUs with two accumulators have alike, and how the S5 runs: a statement is a function that gives the next place.

Where a CPU would stop, for an operand that is not there or a block without end, InputError tells statement and line.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final, NamedTuple, TypeVar

from heatertune.errors import InputError

__all__ = ["END", "Accumulators", "Line", "Statement", "carry_out", "exchange", "jump", "load", "transfer"]

END: Final = -1

#: statements of a block that is given up as one without end; the programs here run some hundreds
_MOST: Final = 100_000


class Accumulators:
    """ACCU 1 and ACCU 2, and the result of the last question."""

    def __init__(self) -> None:
        self.one = self.two = 0
        self.true = False


class Line(NamedTuple):
    """A statement of a text: the line it begins in, from 1 on, its label or "", operation and operand."""

    number: int
    label: str
    operation: str
    operand: str

    def __str__(self) -> str:
        """Return it as errors name it."""
        return f"line {self.number}: statement {f'{self.operation} {self.operand}'.strip()!r}"


_Cpu = TypeVar("_Cpu", bound=Accumulators)
Statement = Callable[[_Cpu], int]


def carry_out(cpu: _Cpu, code: Sequence[Statement[_Cpu]], lines: Sequence[Line]) -> None:
    """Run the statements of a block from the first one to its end.

    Args:
        cpu: that runs them.
        code: what each statement does.
        lines: the same as text.

    Raises:
        InputError: a statement at which a CPU would stop.
    """
    place = 0
    try:
        for _ in range(_MOST):
            place = code[place](cpu)
            if place == END:
                return
    except InputError:
        raise
    except (ArithmeticError, LookupError, ValueError, RecursionError):
        raise InputError(f"{lines[min(place, len(lines) - 1)]}; the CPU stops here") from None
    raise InputError(f"{lines[place]}; the CPU does not come to the end of this block")


def load(value: Callable[[_Cpu], int], then: int) -> Statement[_Cpu]:
    """Return what loads a value: ACCU 1 goes to ACCU 2."""
    def run(cpu: _Cpu) -> int:
        cpu.one, cpu.two = value(cpu), cpu.one
        return then
    return run


def transfer(put: Callable[[_Cpu, int], None], then: int) -> Statement[_Cpu]:
    """Return what writes ACCU 1 somewhere."""
    def run(cpu: _Cpu) -> int:
        put(cpu, cpu.one)
        return then
    return run


def exchange(then: int) -> Statement[Accumulators]:
    """Return what exchanges the accumulators."""
    def run(cpu: Accumulators) -> int:
        cpu.one, cpu.two = cpu.two, cpu.one
        return then
    return run


def jump(there: int, then: int, goes: Callable[[_Cpu], bool] | None = None) -> Statement[_Cpu]:
    """Return a jump, where there is a condition one under it."""
    return (lambda _: there) if goes is None else (lambda cpu: there if goes(cpu) else then)
