"""Batches: cases are run in chunks, and their rows are written to one Parquet file.

Finished chunks are stored in a folder next to the table until the table is written, so an interrupted run continues
where it stopped. A lock lets one run at a time write a table; the lock of a dead run is ignored. Rows are streamed in
row groups, and the file is written whole or not at all. The chunks are computed by processes on this machine or by a
Dask cluster of the user's; if a process of the pool dies, its cases are run again.
"""

from __future__ import annotations

import hashlib
import json
import multiprocessing
import os
import shutil
import signal
import sys
import threading
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache, partial
from hashlib import sha256
from importlib import metadata
from itertools import islice
from pathlib import Path
from typing import IO, Any, Final, NamedTuple

from heatertune.cache import source_digest
from heatertune.codec import read_document, to_json
from heatertune.errors import DocumentError, InputError
from heatertune.processors import processors
from heatertune.units import check
from heatertune.writing import write_files

__all__ = [
    "CaseBatch", "Chunk", "Parts", "Progress", "Row", "TableColumn", "Task", "Workers", "demand_parquet",
    "hold_lock", "in_processes", "on_dask", "read_note", "read_rows", "run", "silent", "write_table",
]


Row = dict[str, Any]

#: called with how many cases are done, and how many there are
Progress = Callable[[int, int], object]

#: cases of a chunk, as they are sent → their rows
Task = Callable[[list[Any]], list[Row]]


def silent(done: int, total: int) -> None:
    """Tell nobody."""


@dataclass(frozen=True, slots=True)
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


_SCHEMA: Final = "heatertune/parts/1"
_MANIFEST: Final = "manifest.json"
_MOST_CASES: Final = 16  # of a chunk: a kill costs no more than these again
_MANY: Final = 2000  # chunks, from which on they grow
_DIGITS: Final = 9  # of the number that a part's name begins with


class Parts:
    """The folder `<table>.parts`: a manifest, and one file of JSON lines per finished chunk.

    Which cases make a chunk depends on their number alone; a part's name tells what they held, so one whose cases have
    changed since is no part of the table any more.

    Attributes:
        folder: of the parts.
        total: number of cases.
        size: cases of a chunk, the last one excepted.
        outdated: number of cases that were done before they changed; they are missing again.
    """

    def __init__(self, table: Path, total: int) -> None:
        self.folder = table.with_name(f"{table.name}.parts")
        self.total = total
        self.size = min(max(total // _MANY, 1), _MOST_CASES)
        self.outdated = 0
        self._names: dict[int, str] = {}

    def open(self, identity: Mapping[str, Any], *, resume: bool) -> None:
        """Make the folder, or find it as a stopped run left it.

        Args:
            identity: of the batch; a folder of another one is refused.
            resume: whether there may be parts already.

        Raises:
            InputError: parts are there and not to be used, or they are of another batch.
        """
        if self.folder.exists() and not resume:
            raise InputError(
                f"{self.folder}: parts of an interrupted run; continue it with --resume, or remove the folder")
        if (self.folder / _MANIFEST).exists():
            earlier = read_document(self.folder / _MANIFEST, _SCHEMA).get("identity")
            other = _differences(earlier, json.loads(json.dumps(identity)))
            if other:
                raise InputError(
                    f"{self.folder}: parts of a run with different {', '.join(other)}; "
                    "repeat the options of that run, or remove the folder")
        else:
            write_files(self.folder, {_MANIFEST: to_json({"schema": _SCHEMA, "identity": identity})})

    def starts(self) -> range:
        """Return the number of the first case of each chunk."""
        return range(0, self.total, self.size)

    def missing(self, chunks: Iterable[Chunk]) -> Iterator[int]:
        """Return the numbers of the first cases of those chunks that are not finished as they are now."""
        before = {path.name for path in self.folder.glob("[0-9]*.jsonl")}
        began = {name[:_DIGITS] for name in before}
        for chunk in chunks:
            name = self._named(chunk)
            if name in before and self._whole(name, len(chunk.cases)):
                continue
            self.outdated += len(chunk.cases) if name not in before and name[:_DIGITS] in began else 0
            yield chunk.start

    def write(self, chunk: Chunk, rows: Sequence[Row]) -> None:
        """Keep the rows of a chunk."""
        # a number that is not finite is kept as such: "never settled" is no missing value
        lines = "".join(json.dumps(row, ensure_ascii=False) + "\n" for row in rows)
        write_files(self.folder, {self._named(chunk): lines})

    def rows(self) -> Iterator[Row]:
        """Return all rows in order.

        Raises:
            DocumentError: a part is no longer as it was written.
        """
        for start in self.starts():
            path = self.folder / self._names[start]
            try:
                rows = [json.loads(line) for line in path.read_bytes().split(b"\n")[:-1]]
            except (OSError, ValueError) as problem:
                raise DocumentError(f"{path}: not a valid part of a table; remove it, and --resume computes it "
                                    "again") from problem
            yield from rows

    def contents(self) -> list[str]:
        """Return what tells the contents of all chunks, as they were done, from others."""
        return [self._names[start] for start in self.starts()]

    def remove(self) -> None:
        """Remove the folder; a kill meanwhile leaves none that looks like parts of a stopped run."""
        done = self.folder.with_name(f".{self.folder.name}.done")
        shutil.rmtree(done, ignore_errors=True)
        self.folder.rename(done)
        shutil.rmtree(done, ignore_errors=True)

    def length(self, start: int) -> int:
        """Return the number of cases of the chunk that begins with this one."""
        return min(self.size, self.total - start)

    def _whole(self, name: str, rows: int) -> bool:
        """Return whether a part is there with all its rows: a power cut may leave a name without its content."""
        try:
            lines = (self.folder / name).read_bytes().split(b"\n")
        except OSError:
            return False
        return len(lines) == rows + 1 and all(line.endswith(b"}") for line in lines[:-1])

    def _named(self, chunk: Chunk) -> str:
        """Return the name of a chunk's part, and keep it in mind."""
        content = sha256(repr(chunk.cases).encode(errors="backslashreplace")).hexdigest()[:32]
        name = self._names[chunk.start] = f"{chunk.start:0{_DIGITS}d}-{content}.jsonl"
        return name


def _differences(earlier: object, identity: Mapping[str, Any]) -> list[str]:
    """Return the names of what two identities do not share."""
    if not isinstance(earlier, dict):
        return sorted(identity)
    return sorted(name for name in {*earlier, *identity} if earlier.get(name) != identity.get(name))


if sys.platform == "win32":
    import msvcrt

    def _take(file: IO[str]) -> None:
        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
else:
    import fcntl

    def _take(file: IO[str]) -> None:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


@contextmanager
def hold_lock(
    table: Path, instead: str = ", or give another table", *, what: str | None = None, holder: str = ""
) -> Iterator[None]:
    """Hold the lock of a table, or of another file, within the block.

    The system holds it for the process, not the file: with the process ends the lock, however that ended.

    Args:
        table: the file.
        instead: what can be done beside waiting, the end of the error.
        what: beginning of the error of whoever comes second; None: that another run writes the table.
        holder: said of this process in that error, behind its number.

    Raises:
        InputError: another run holds it, or the file beside the table cannot be written.
    """
    path = table.with_name(f".{table.name}.lock")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        file = path.open("a+", encoding="utf-8")
    except OSError as problem:
        raise InputError(f"{path}: cannot be written: {problem.strerror}") from problem
    with file:
        _demand(file, path, what or f"{table}: another run is writing it", instead)
        with suppress(OSError):  # on a full disk the lock holds all the same
            os.write(file.fileno(), f"process {os.getpid()}{holder}".encode())
        try:
            yield
        finally:
            path.unlink(missing_ok=True)


def _demand(file: IO[str], path: Path, what: str, instead: str) -> None:
    """Lock an open file that is still the one of this name: its last owner takes it away when it ends."""
    try:
        _take(file)
        mine = path.exists() and os.path.samestat(os.fstat(file.fileno()), path.stat())
    except OSError:
        mine = False
    if not mine:
        file.seek(0)
        raise InputError(f"{what} ({file.read() or 'just started'}); wait until it ends{instead}")
    file.truncate(0)


_GROUP: Final = 4096  # rows: a few hundred kB
_NOTE: Final = b"heatertune"


def demand_parquet() -> Any:
    """Return pyarrow.

    Raises:
        InputError: it is not installed.
    """
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as problem:
        raise InputError("a Parquet table needs pyarrow: pip install 'heatertune[fleet]'") from problem
    return pyarrow


def write_table(
    path: Path, columns: Sequence[TableColumn], rows: Iterable[Row], note: Callable[[], Mapping[str, Any]]
) -> None:
    """Write a table; same rows, same bytes.

    Args:
        path: of the file; another one of this name is replaced.
        columns: every row has these, and no others.
        rows: in order; held in memory one row group at a time.
        note: JSON object kept with the table, asked for when all rows are written.

    Raises:
        InputError: the file cannot be written, or pyarrow is missing.
    """
    arrow = demand_parquet()
    kinds = {"text": arrow.string(), "float": arrow.float64(), "int": arrow.int64(), "bool": arrow.bool_()}
    schema = arrow.schema([arrow.field(c.name, kinds[c.kind], metadata={"what": c.description}) for c in columns])
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        # opened here: pyarrow takes no name that is not UTF-8
        with temporary.open("wb") as file, arrow.parquet.ParquetWriter(file, schema) as writer:
            for group in _groups(rows):
                writer.write_table(arrow.Table.from_pylist(group, schema=schema))
            writer.add_key_value_metadata({_NOTE: _bytes(json.dumps(note(), ensure_ascii=False))})
        temporary.replace(path)
    except OSError as problem:
        raise InputError(f"{path}: cannot be written: {problem.strerror or problem}") from problem
    finally:
        temporary.unlink(missing_ok=True)


def read_note(path: Path) -> dict[str, Any] | None:
    """Return the note of a table, None where there is no such table or no note in it."""
    arrow = demand_parquet()
    try:
        with path.open("rb") as file:
            notes = arrow.parquet.read_metadata(file).metadata or {}
    except (OSError, arrow.ArrowInvalid):
        return None
    return dict(json.loads(notes[_NOTE])) if _NOTE in notes else None


def read_rows(path: Path) -> list[Row]:
    """Return the rows of a table.

    Raises:
        InputError: it cannot be read, or is no Parquet file; pyarrow is missing.
    """
    arrow = demand_parquet()
    try:
        with path.open("rb") as file:
            return list(arrow.parquet.read_table(file).to_pylist())
    except (OSError, arrow.ArrowInvalid) as problem:
        raise InputError(f"{path}: not a Parquet table: {problem}") from problem


def _groups(rows: Iterable[Row]) -> Iterator[list[Row]]:
    left = iter(rows)
    while group := list(islice(left, _GROUP)):
        yield [{name: _bytes(cell) if isinstance(cell, str) else cell for name, cell in row.items()} for row in group]


def _bytes(text: str) -> bytes:
    """Return a text as UTF-8; a name that is none is escaped where it is not."""
    return text.encode(errors="backslashreplace")


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
        progress: called with how many cases are done, and how many there are.

    Returns:
        table (path), rows, outcomes (outcome → number, by name), examples (outcome → first rows: name, reason), and,
        where there are some, done_again: number of rows that a stopped run had made of what has changed since.

    Raises:
        InputError: pyarrow is missing, no case, another run writes the table, parts in the way (see `Parts.open`), a
            folder that cannot be written, a worker that runs another program.
    """
    demand_parquet()
    if not batch.cases:
        raise InputError(f"{out}: there are no cases to run")
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


def _task(do: Callable[[Any, Any], Row], shared: Any, program: str, cases: list[Any]) -> list[Row]:
    """Do a chunk; this runs on the worker.

    Raises:
        InputError: the worker's program is another one, so its numbers might be, too.
    """
    if _program() != program:
        raise InputError(f"a worker runs a different program ({_program()}; expected {program}); install the same "
                         "version there")
    with _ONE_AT_A_TIME:
        return [do(shared, case) for case in cases]


@cache
def _program() -> str:
    """Return what decides the bits of a result: heatertune's source, Python, and the libraries that round.

    Raises:
        InputError: the source is no longer the one that runs.
    """
    if (source := source_digest()) is None:
        raise InputError("heatertune was replaced by another release during the run; start the run again")
    versions = [f"{name} {metadata.version(name)}" for name in _LIBRARIES]
    return ", ".join([f"heatertune {source[:12]}", f"Python {sys.version.split()[0]}", *versions])


class _Summary:
    """Counts rows by outcome while they pass."""

    def __init__(self) -> None:
        self._outcomes: Counter[str] = Counter()
        self._examples: dict[str, list[Row]] = {}

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


_CLUSTER_AHEAD: Final = 4  # chunks under way per thread of the cluster: the way there must not be waited for
_PATIENCE_S: Final = 30.0


def on_dask(address: str) -> Workers:
    """Return workers: those of the Dask scheduler at an address, as many as it has at any time.

    The scheduler gives the chunk of a worker that was lost to another one; `distributed.scheduler.allowed-failures`
    tells how often.

    Raises:
        InputError: Dask is not installed; when run: no scheduler answers, or it goes away.
    """
    try:
        import distributed
        from distributed.client import FutureCancelledError
        from distributed.comm import CommClosedError
    except ImportError as problem:
        raise InputError("--scheduler needs Dask: pip install 'heatertune[dask]'") from problem

    def workers(chunks: Iterator[Chunk], do: Task) -> Iterator[tuple[Chunk, list[Row] | None]]:
        try:
            client = distributed.Client(address, timeout=_PATIENCE_S, set_as_default=False)
        except (OSError, ValueError) as problem:
            raise InputError(f"--scheduler {address}: no Dask scheduler answers at this address") from problem
        try:
            yield from _all(distributed, client, chunks, do)
        except (FutureCancelledError, CommClosedError) as problem:
            raise InputError(f"--scheduler {address}: the connection to the scheduler was lost; continue with "
                             "--resume") from problem
        finally:
            client.close()

    return workers


def _all(distributed: Any, client: Any, chunks: Iterator[Chunk], do: Task) -> Iterator[tuple[Chunk, list[Row] | None]]:
    """Run all chunks; one whose workers died runs again alone, for it may only have stood beside the guilty one."""
    under_way: dict[Any, Chunk] = {}
    suspects: list[Chunk] = []
    ready = distributed.as_completed(loop=client.loop)

    def submit(number: int) -> None:
        for chunk in islice(chunks, number):
            future = client.submit(do, chunk.cases, pure=False)
            under_way[future] = chunk
            ready.add(future)

    submit(_CLUSTER_AHEAD)
    for future in ready:
        chunk = under_way.pop(future)
        rows = _rows(distributed, future)
        if rows is None:
            suspects.append(chunk)
        else:
            yield chunk, rows
        submit(max(1, _CLUSTER_AHEAD * sum(client.nthreads().values()) - len(under_way)))
    for chunk in suspects:
        yield chunk, _rows(distributed, client.submit(do, chunk.cases, pure=False))


def _rows(distributed: Any, future: Any) -> list[Row] | None:
    """Wait for the rows of a chunk, None where its workers died."""
    try:
        rows: list[Row] = future.result()
    except distributed.KilledWorker:
        return None
    finally:
        future.release()
    return rows


#: Each process is one thread: no more threads than processors, and sums in one order whatever the machine.
_THREADS: Final = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
_AHEAD: Final = 2  # chunks under way per process: one at work, one waiting
_TRIES: Final = 3  # that a chunk alone in a process gets


def in_processes(jobs: int | None = None) -> Workers:
    """Return workers: a pool of so many processes, by default one for each processor this process may use.

    Raises:
        OutOfRange: fewer than one process.
    """
    number = processors() if jobs is None else jobs
    check("jobs", number, least=1)

    def workers(chunks: Iterator[Chunk], do: Task) -> Iterator[tuple[Chunk, list[Row] | None]]:
        with _one_thread_each():
            while True:
                suspects: list[Chunk] = []
                yield from _until_one_dies(chunks, do, number, suspects)
                if not suspects:
                    return
                for chunk in suspects:
                    yield chunk, _alone(chunk, do)

    return workers


@contextmanager
def _pool(number: int) -> Iterator[ProcessPoolExecutor]:
    """Give a pool whose waiting work is dropped when the block is left early."""
    pool = ProcessPoolExecutor(number, mp_context=multiprocessing.get_context("spawn"), initializer=_begin)
    try:
        yield pool
    finally:
        pool.shutdown(cancel_futures=True)


def _begin() -> None:
    """Make a process of the pool end with its parent, however that ends, and leave Ctrl-C to it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    assert parent is not None

    def follow() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=follow, daemon=True).start()


def _until_one_dies(
    chunks: Iterator[Chunk], do: Task, number: int, suspects: list[Chunk]
) -> Iterator[tuple[Chunk, list[Row]]]:
    """Run chunks until none is left, or a process dies; `suspects` then gets those under way."""
    with _pool(number) as pool:
        under_way = {pool.submit(do, chunk.cases): chunk for chunk in islice(chunks, _AHEAD * number)}
        while under_way and not suspects:
            done, _ = wait(under_way, return_when=FIRST_COMPLETED)
            for future in done:
                chunk = under_way.pop(future)
                try:
                    rows = future.result()
                except BrokenProcessPool:
                    suspects.append(chunk)
                    continue
                yield chunk, rows
                _refill(pool, do, chunks, under_way, suspects)
        suspects += under_way.values()


def _refill(
    pool: ProcessPoolExecutor, do: Task, chunks: Iterator[Chunk], under_way: dict[Future[list[Row]], Chunk],
    suspects: list[Chunk],
) -> None:
    """Submit the next chunk, if there is one; where the pool has just broken it is suspected without reason."""
    for chunk in islice(chunks, 1):
        try:
            under_way[pool.submit(do, chunk.cases)] = chunk
        except BrokenProcessPool:
            suspects.append(chunk)


def _alone(chunk: Chunk, do: Task) -> list[Row] | None:
    """Return the rows of a chunk that has a process for itself, None where that dies every time."""
    for _ in range(_TRIES):
        with _pool(1) as pool:
            try:
                return pool.submit(do, chunk.cases).result()
            except BrokenProcessPool:
                continue
    return None


@contextmanager
def _one_thread_each() -> Iterator[None]:
    before = {name: os.environ.get(name) for name in _THREADS}
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
