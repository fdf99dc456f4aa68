"""The workers that compute the chunks of a batch: processes on this machine, or a Dask cluster of the user's.

If a process of the pool dies, its cases are run again.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from itertools import islice
from typing import Any, Final

from heatertune.batch.engine import Chunk, Row, Task, Workers
from heatertune.errors import InputError
from heatertune.processors import processors
from heatertune.units import check

__all__ = ["in_processes", "on_dask"]


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
