"""What a batch is made of."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

__all__ = ["CaseBatch", "Chunk", "Progress", "Row", "TableColumn", "Task", "Workers", "silent"]

Row = dict[str, Any]

#: told how many cases are done, and how many there are
Progress = Callable[[int, int], object]

#: cases of a chunk, as they are sent → their rows
Task = Callable[[list[Any]], list[Row]]


def silent(done: int, total: int) -> None:
    """Tell nobody."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TableColumn:
    """One column of the table.

    Attributes:
        name: with its unit at the end.
        kind: "text", "float", "int" or "bool"; a row may hold None in any of them.
        what: its meaning, kept in the table.
    """

    name: str
    kind: str
    description: str


class Chunk(NamedTuple):
    """Cases that go to a worker together: the number of the first, and all as they are sent."""

    start: int
    cases: list[Any]


#: Runs chunks anywhere, in any order; None in place of rows: every process that took the chunk died.
Workers = Callable[[Iterator[Chunk], Task], Iterator[tuple[Chunk, list[Row] | None]]]


@dataclass(frozen=True, slots=True, kw_only=True)
class CaseBatch:
    """Cases, and what is done with each.

    Attributes:
        do: (what all cases share, one case as sent) → row. It runs in other processes, so it must be importable; a
            case it cannot do is a row as well, not an exception.
        shared: what all cases share.
        cases: one per row, in the order of the table.
        sent: case → what a worker gets, which may not see the files of this machine.
        lost: (case, why) → row of a case whose process died.
        columns: of the table; every row has an "outcome".
        identity: JSON object of all that decides the table, but for what the cases hold as sent, which a run that goes
            on looks at case by case.
    """

    do: Callable[[Any, Any], Row]
    common: Any
    cases: Sequence[Any]
    sent: Callable[[Any], Any]
    lost: Callable[[Any, str], Row]
    columns: tuple[TableColumn, ...]
    identity: Mapping[str, Any]
