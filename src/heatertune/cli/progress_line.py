"""The one line of a terminal that moves while something is under way."""

from __future__ import annotations

import os
import select
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Final, TextIO

__all__ = ["LINE", "Line", "can_take", "to_nobody"]

_ERASE: Final = "\r\033[K"  # ECMA-48, 8.3.41 EL
_BEAT_S: Final = 0.5


class Line:
    """The last line of stderr; it is drawn anew by itself, so that it lives through what takes long."""

    def __init__(self) -> None:
        self._text: Callable[[], str] | None = None
        self._lock = threading.Lock()
        self._ended = threading.Event()

    def show(self, text: Callable[[], str]) -> None:
        """Draw what a function returns, now and every half second until the end; nothing where there is no terminal."""
        if not sys.stderr.isatty():
            return
        begins, self._text = self._text is None, text
        self._draw()
        if begins:
            self._ended = threading.Event()
            threading.Thread(target=self._beat, args=(self._ended,), daemon=True).start()

    def end(self) -> None:
        """Take the line away: something else is to be printed."""
        with self._lock:
            if self._text is not None:
                self._text = None
                self._ended.set()
                _print(sys.stderr, _ERASE)

    def _draw(self) -> None:
        with self._lock:
            if self._text is not None:
                _print(sys.stderr, f"{_ERASE}{self._text()}")

    def _beat(self, ended: threading.Event) -> None:
        while not ended.wait(_BEAT_S):
            self._draw()


def _print(stream: TextIO, text: str) -> None:
    if can_take(stream):
        with suppress(OSError):  # a terminal that was closed: what it would show is not worth the work's end
            print(text, end="", file=stream, flush=True)


def can_take(stream: TextIO) -> bool:
    """Return whether a stream takes a line without waiting: a terminal held by Ctrl-S would stop the program."""
    try:
        return bool(select.select([], [stream], [], 0.0)[1])
    except (OSError, TypeError, ValueError):  # Windows asks this of sockets alone; a stream without a file takes all
        return True


#: of this process: a terminal has one last line
LINE: Final = Line()


def to_nobody() -> None:
    """Let what is still to come on stdout go nowhere: its reader went away, or nothing more can be written."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
