"""Cases → chunks → parts → table."""

from __future__ import annotations

import hashlib
import json
import sys
import threading
from collections import Counter
from collections.abc import Callable, Iterator
from functools import cache, partial
from importlib import metadata
from pathlib import Path
from typing import Any, Final

from heatertune.batch.lock import hold_lock
from heatertune.batch.parts import Parts
from heatertune.batch.table import demand_parquet, read_note, write_table
from heatertune.batch.values import CaseBatch, Chunk, Progress, Row, Task, Workers, silent
from heatertune.cache import source_digest
from heatertune.errors import InputError

__all__ = ["run"]

_EXAMPLES: Final = 3  # rows told of each outcome that is not PASS
_DIED: Final = "every process that worked on it died (out of memory?)"

#: what rounds the numbers, beside heatertune itself
_LIBRARIES: Final = ("numpy", "scipy", "casadi", "numba", "control")

#: CasADi's symbols are not made for several threads, which a Dask worker may have
_ONE_AT_A_TIME: Final = threading.Lock()


def run(
    batch: CaseBatch, out: str | Path, *, workers: Workers, resume: bool = False, progress: Progress = silent
) -> dict[str, Any]:
    """Do every case and write the table; return what became of them.

    Args:
        batch: the cases.
        out: Parquet file. Beside it lies the folder of parts until it is written.
        workers: where the cases are done.
        resume: go on where a run of the same batch was stopped, however it was.
        progress: told how many cases are done, and how many there are.

    Returns:
        table (path), rows, outcomes (outcome → number, by name), examples (outcome → first rows: name, reason), and,
        where there are some, done_again: number of rows that a stopped run had made of what has changed since.

    Raises:
        InputError: pyarrow is missing, no case, another run writes the table, parts in the way (see `Parts.open`), a
            folder that cannot be written, a worker that runs another program.
    """
    demand_parquet()
    if not batch.cases:
        raise InputError(f"{out}: no case to do")
    with hold_lock(Path(out)):
        return {"table": str(out), **_run(batch, Path(out), workers, progress, resume=resume)}


def _run(batch: CaseBatch, table: Path, workers: Workers, progress: Progress, *, resume: bool) -> dict[str, Any]:
    identity = {**batch.identity, "program": _program()}
    parts = Parts(table, len(batch.cases))

    def chunk(start: int) -> Chunk:
        return Chunk(start, [batch.sent(batch.cases[k]) for k in range(start, start + parts.length(start))])

    def mark() -> str:
        return hashlib.sha256(json.dumps([identity, parts.contents()], sort_keys=True).encode()).hexdigest()

    missing = list(parts.missing(map(chunk, parts.starts())) if resume else parts.starts())
    if resume and not parts.folder.exists():
        note = read_note(table)
        if note is not None and note.get("mark") == mark():  # finished, and the parts are gone
            return dict(note["summary"])
    parts.open(identity, resume=resume)
    progress(done := parts.total - sum(map(parts.length, missing)), parts.total)
    task = partial(_task, batch.do, batch.common, _program())
    for finished, rows in workers(map(chunk, missing), task) if missing else ():
        parts.write(finished, _one_by_one(batch, finished, workers, task) if rows is None else rows)
        progress(done := done + len(finished.cases), parts.total)
    summary = _Summary()
    write_table(table, batch.columns, summary.watch(parts.rows()),
                lambda: {"mark": mark(), "summary": summary.as_dict()})
    parts.remove()
    return summary.as_dict() | ({"done_again": parts.outdated} if parts.outdated else {})


def _one_by_one(batch: CaseBatch, chunk: Chunk, workers: Workers, task: Task) -> list[Row]:
    """Return the rows of a chunk that took its processes along: a case that does so again is lost, the others not."""
    first = chunk.start
    rows: dict[int, list[Row] | None] = {first: None}
    if len(chunk.cases) > 1:
        singles = (Chunk(k, [case]) for k, case in enumerate(chunk.cases, start=first))
        rows = {single.start: done for single, done in workers(singles, task)}
    return [done[0] if (done := rows[k]) else batch.lost(batch.cases[k], _DIED)
            for k in range(first, first + len(chunk.cases))]


def _task(
    do: Callable[[Any, Any], Row], shared: Any, program: str, cases: list[Any]
) -> list[Row]:
    """Do a chunk; this runs on the worker.

    Raises:
        InputError: the worker's program is another one, so its numbers might be, too.
    """
    if _program() != program:
        raise InputError(f"a worker runs another program: there {_program()}, here {program}; install the same")
    with _ONE_AT_A_TIME:
        return [do(shared, case) for case in cases]


@cache
def _program() -> str:
    """Return what decides the bits of a result: heatertune's source, Python, and the libraries that round.

    Raises:
        InputError: the source is no longer the one that runs.
    """
    if (source := source_digest()) is None:
        raise InputError("heatertune was replaced by another release while it runs; start it again")
    versions = [f"{name} {metadata.version(name)}" for name in _LIBRARIES]
    return ", ".join([f"heatertune {source[:12]}", f"Python {sys.version.split()[0]}", *versions])


class _Summary:
    """Counts rows by outcome while they pass."""

    def __init__(self) -> None:
        self._outcomes: Counter[str] = Counter()
        self._examples: dict[str, list[dict[str, Any]]] = {}

    def watch(self, rows: Iterator[Row]) -> Iterator[Row]:
        for row in rows:
            outcome = row["outcome"]
            self._outcomes[outcome] += 1
            if outcome != "PASS" and self._outcomes[outcome] <= _EXAMPLES:
                self._examples.setdefault(outcome, []).append({"name": row["name"], "reason": row["reason"]})
            yield row

    def as_dict(self) -> dict[str, Any]:
        return {
            "rows": self._outcomes.total(), "outcomes": dict(sorted(self._outcomes.items())),
            "examples": dict(sorted(self._examples.items())),
        }
