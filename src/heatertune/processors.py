"""The processors that this process has, and work on all of them at once.

How long work says what begins, and where it can be ended.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Final, TypeVar

__all__ = [
    "ProgressCallback", "interruptible", "interruption_point", "log_progress", "on_one", "processors", "threaded_list",
    "threaded_map",
]


#: called with a short message when something begins
ProgressCallback = Callable[[str], object]


def log_progress(message: str) -> None:
    """Give a message to `logging.getLogger("heatertune")` [INFO]; without a handler of the user it costs nothing."""
    if (logging := sys.modules.get("logging")) is not None:  # who has not imported it has no handler
        logging.getLogger("heatertune").info(message)


_check: Final[ContextVar[Callable[[], object]]] = ContextVar("check", default=int)


def interruption_point() -> None:
    """Let long work be ended here by what `interruptible` was given; called every few milliseconds of a search."""
    _check.get()()


@contextmanager
def interruptible(check: Callable[[], object]) -> Iterator[None]:
    """Call a function at each `interruption_point` that this thread passes within the block.

    Args:
        check: raises an exception to end the work.
    """
    mark = _check.set(check)
    try:
        yield
    finally:
        _check.reset(mark)


_Item = TypeVar("_Item")
_Value = TypeVar("_Value")

_one: Final[ContextVar[bool]] = ContextVar("one", default=False)


def processors() -> int:
    """Return how many processors this process may use."""
    if _one.get():
        return 1
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def on_one() -> Iterator[None]:
    """Let the block use one processor: the others have such blocks of their own."""
    mark = _one.set(True)
    try:
        yield
    finally:
        _one.reset(mark)


def threaded_map(function: Callable[[_Item], _Value], items: Sequence[_Item],
                 workers: int | None = None) -> Iterator[_Value]:
    """Yield a function of each item in turn, found by threads, as a compiled kernel gives up Python's lock.

    Args:
        function: of one.
        items: all of them.
        workers: how many threads; None: one for each processor.
    """
    workers = min(workers or processors(), len(items))
    if workers <= 1:
        yield from map(function, items)
    else:
        with ThreadPoolExecutor(workers) as pool:
            yield from pool.map(function, items)


def threaded_list(function: Callable[[_Item], _Value], items: Sequence[_Item],
                  workers: int | None = None) -> list[_Value]:
    """Return a function of each item, see `each`."""
    return list(threaded_map(function, items, workers))
