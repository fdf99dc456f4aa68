"""The workers of a Dask cluster; the cluster itself is the user's."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from typing import Any, Final

from heatertune.batch.values import Chunk, Row, Task, Workers
from heatertune.errors import InputError

__all__ = ["on_dask"]

_AHEAD: Final = 4  # chunks under way per thread of the cluster: the way there must not be waited for
_PATIENCE_S: Final = 30.0


def on_dask(address: str) -> Workers:
    """Return workers: those of the Dask scheduler at an address, as many as it has at any time.

    The scheduler gives the chunk of a worker that was lost to another one; `distributed.scheduler.allowed-failures`
    tells how often.

    Raises:
        InputError: Dask is not installed; when run: no scheduler answers, or it goes away.
    """
    try:
        import distributed  # noqa: PLC0415 - an extra
        from distributed.client import FutureCancelledError  # noqa: PLC0415
        from distributed.comm import CommClosedError  # noqa: PLC0415
    except ImportError as problem:
        raise InputError("--scheduler needs Dask: pip install 'heatertune[dask]'") from problem

    def workers(chunks: Iterator[Chunk], do: Task) -> Iterator[tuple[Chunk, list[Row] | None]]:
        try:
            client = distributed.Client(address, timeout=_PATIENCE_S, set_as_default=False)
        except (OSError, ValueError) as problem:
            raise InputError(f"--scheduler {address}: no Dask scheduler answers there") from problem
        try:
            yield from _all(distributed, client, chunks, do)
        except (FutureCancelledError, CommClosedError) as problem:
            raise InputError(f"--scheduler {address}: the scheduler went away; --resume goes on") from problem
        finally:
            client.close()

    return workers


def _all(
    distributed: Any, client: Any, chunks: Iterator[Chunk], do: Task
) -> Iterator[tuple[Chunk, list[Row] | None]]:
    """Run all chunks; one whose workers died runs again alone, for it may only have stood beside the guilty one."""
    under_way: dict[Any, Chunk] = {}
    suspects: list[Chunk] = []
    ready = distributed.as_completed(loop=client.loop)

    def submit(number: int) -> None:
        for chunk in islice(chunks, number):
            future = client.submit(do, chunk.cases, pure=False)
            under_way[future] = chunk
            ready.add(future)

    submit(_AHEAD)
    for future in ready:
        chunk = under_way.pop(future)
        rows = _rows(distributed, future)
        if rows is None:
            suspects.append(chunk)
        else:
            yield chunk, rows
        submit(max(1, _AHEAD * sum(client.nthreads().values()) - len(under_way)))
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
