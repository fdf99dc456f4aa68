"""What a terminal shows beside text: colour, and one line that moves while something is under way."""

from __future__ import annotations

import os
import re
import select
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Final, TextIO

__all__ = ["LINE", "Line", "can_take", "colourise", "has_colour", "to_nobody"]

#: what is painted → its attributes: bold, and one of the eight colours that every terminal has
_PAINT: Final = {"PASS": "1;32", "FAIL": "1;31", "NOT PROVEN": "1;33", "error:": "1;31"}
_PAINTED: Final = re.compile(r"\b(?:PASS|FAIL|NOT PROVEN)\b|\Aerror:")
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


def has_colour(stream: TextIO) -> bool:
    """Return whether a stream is a terminal that shows colour and whose user wants it.

    Any text in NO_COLOR switches colour off (no-color.org); so does a terminal that calls itself dumb.
    """
    return stream.isatty() and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"


def colourise(text: str, stream: TextIO) -> str:
    """Return the text as the stream is to have it: verdicts and the word `error:` in colour, or as it is.

    A colour takes no room, so columns stay aligned.
    """
    if not has_colour(stream):
        return text
    return _PAINTED.sub(lambda match: f"\033[{_PAINT[match[0]]}m{match[0]}\033[0m", text)
