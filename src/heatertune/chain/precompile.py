"""Compile machine code and draw pictures in a second process while the first one is busy.

If no machine code of a controller's loop is cached, compiling it takes as long as a fit. The second process
(`heatertune.chain.worker`) stores the code on disk and reports it; any code that needs it waits for this report. It
then draws the sections of the report that contain pictures. If the second process ends early for any reason, the first
process compiles and draws what is missing.

This module is quick to import: the second process starts before the first one has imported all that a design needs.
"""

from __future__ import annotations

import json
import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import partial
from itertools import count
from threading import Event, Thread
from time import monotonic
from typing import IO, Any, Final, NamedTuple

from heatertune.cache import folder
from heatertune.codec import encode
from heatertune.compiled import compile_elsewhere, has_machine_code, machine_code
from heatertune.processors import processors

__all__ = ["OPINION", "Worker", "text_for", "work_alongside"]

#: what is requested beside the sections of the report
OPINION: Final = "second opinion"

_PATIENCE_S: Final = 60.0  # after a longer wait, a process compiles by itself
_PATIENCE_FOR_PICTURES_S: Final = 10.0  # likewise

#: documents by their names, or arguments of the second opinion by theirs
_Documents = Mapping[str, Any]


class _Asked(NamedTuple):
    """A section to draw: number of the request, subject, and whether it is finished."""

    request: int
    documents: _Documents
    drawn: Event


class Worker:
    """The first process's interface to the second; without a second process it never draws anything."""

    def __init__(self, process: subprocess.Popen[bytes] | None) -> None:
        self._process = process
        self._made = dict[str, Event]()
        self._requests = count()
        self._asked = dict[str, _Asked]()
        self._drawn = dict[tuple[int, str], str]()

    def compile(self, targets: Iterable[str]) -> None:
        """Request the compilation of the loops of controllers, possibly none; the second process waits for it."""
        self._made = {target: Event() for target in targets}
        self._send(_write, list(self._made), self._made.values())

    def draw(self, documents: _Documents, name: str) -> None:
        """Request a section of the report, see `heatertune.report.sections`, or its redraw with other documents."""
        order = _Asked(next(self._requests), dict(documents), Event())
        self._asked = {**self._asked, name: order}
        self._send(_write_on, (order.request, order.documents, name), [order.drawn])

    def answer(self, name: str) -> str:
        """Return one of what was requested, as soon as it is there; after a longer wait it is made here."""
        order = self._asked[name]
        order.drawn.wait(_PATIENCE_FOR_PICTURES_S)
        if (order.request, name) not in self._drawn:
            self._draw(name)
        self._asked = {other: each for other, each in self._asked.items() if other != name}
        return self._drawn[order.request, name]

    def sections(self) -> dict[str, str]:
        """Return the drawn sections; wait for outstanding ones, or draw the last of them here."""
        until = monotonic() + _PATIENCE_FOR_PICTURES_S
        while _has_drawn() and len(left := self._undrawn()) > 1:  # the first one is in work
            self._draw(left[-1])
        for order in self._asked.values():
            order.drawn.wait(max(0.0, until - monotonic()))
        return {name: self._drawn[order.request, name] for name, order in self._asked.items()
                if (order.request, name) in self._drawn}

    def waits(self, target: str) -> None:
        """Wait until a loop is compiled or compilation has ended; meanwhile draw sections not yet started."""
        while not self._made[target].is_set() and (left := self._undrawn()):
            self._draw(left[0])
        self._made[target].wait(_PATIENCE_S)

    def _undrawn(self) -> list[str]:
        return [name for name, order in self._asked.items() if not order.drawn.is_set()]

    def _draw(self, name: str) -> None:
        """Draw a section here."""
        order = self._asked[name]
        self._send(_write_on, order.request, [])
        self._drawn[order.request, name] = text_for(order.documents, name)
        order.drawn.set()

    def listen(self, lines: IO[bytes]) -> None:
        """Receive results until the second process ends."""
        for line in lines:
            with suppress(ValueError, TypeError):
                match json.loads(line):
                    case str() as target if target in self._made:
                        self._made[target].set()
                    case [int() as request, str() as name, str() as text]:
                        self._drawn[request, name] = text
                        if name in self._asked and self._asked[name].request == request:
                            self._asked[name].drawn.set()
        self._process = None
        for event in (*self._made.values(), *(order.drawn for order in self._asked.values())):
            event.set()

    def _send(self, write: Callable[[IO[bytes], object], None], message: object, events: Iterable[Event]) -> None:
        pipe = None if self._process is None else self._process.stdin
        if pipe is not None:
            write(pipe, message)
        if self._process is None:  # or by now
            for event in events:
                event.set()


@contextmanager
def work_alongside(target: str) -> Iterator[Worker]:
    """Run the second process during the block, for the design of a controller.

    It compiles the loop of this controller and that of the two-level control for comparison. It is not started if there
    is no second processor, or nothing to do: the machine code is cached or cannot be, and this process has drawn
    pictures before, so that it draws immediately and with any settings made since.

    Raises:
        InputError: no such controller.
    """
    is_worthwhile = processors() > 1 and (not _has_drawn() or _missing(target))
    process = _begun() if is_worthwhile else None
    second = Worker(process)
    if process is None:
        yield second
        return
    listener = Thread(target=second.listen, args=(process.stdout,), daemon=True)
    listener.start()
    try:
        missing = _missing(target)  # imports the same modules as the first process
        second.compile(missing)
        with compile_elsewhere({loop: partial(second.waits, name) for name, loop in missing.items()}):
            yield second
    finally:
        process.kill()
        process.wait()
        listener.join()
        with suppress(OSError):  # the unread data
            process.communicate()


def text_for(documents: _Documents, name: str) -> str:
    """Return a section of the report, or the second opinion as JSON, of which `documents` are the arguments."""
    if name == OPINION:
        from heatertune.chain.second_opinion import second_opinion

        return json.dumps(encode(second_opinion(**documents)))
    from heatertune.report import sections

    return sections(documents, [name])[name]


def _has_drawn() -> bool:
    return "matplotlib" in sys.modules


def _missing(target: str) -> dict[str, Callable[..., Any]]:
    """Return the loops that are not cached, by target: of a controller and of the two-level control for comparison."""
    from heatertune.chain.worker import loops

    return {} if folder() is None else {name: loop for name, loop in loops(target) if not has_machine_code(loop)}


def _begun() -> subprocess.Popen[bytes] | None:
    """Start the second process with the modules of this one; None if impossible."""
    if not sys.executable or getattr(sys, "frozen", False):  # a frozen program instead of an interpreter
        return None
    place = folder()
    likely = ["compiles"] if place is not None and not machine_code(place) else []
    with suppress(OSError):
        return subprocess.Popen(
            [sys.executable, "-P", "-m", "heatertune.chain.worker", *likely],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
            env=os.environ | {"PYTHONPATH": os.pathsep.join(map(str, sys.path))})
    return None


def _write(pipe: IO[bytes], message: object) -> None:
    with suppress(OSError, ValueError):  # it has ended
        pipe.write(pickle.dumps(message))
        pipe.flush()


def _write_on(pipe: IO[bytes], message: object) -> None:
    """Write without waiting for the reader, because unread data may fill the pipe."""
    Thread(target=_write, args=(pipe, message), daemon=True).start()
