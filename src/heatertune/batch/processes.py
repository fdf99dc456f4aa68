"""A pool of processes on this machine; a process that dies takes no case with it."""

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
from typing import Final

from heatertune.batch.values import Chunk, Row, Task, Workers
from heatertune.processors import processors
from heatertune.units import check

__all__ = ["in_processes"]

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
