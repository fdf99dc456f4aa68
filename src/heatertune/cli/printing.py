"""Output of the commands: progress on stderr, results on stdout or in a file, colour and a status line."""

from __future__ import annotations

import argparse
import os
import re
import select
import shlex
import sys
import textwrap
import threading
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TextIO

from heatertune.cli.common import FULL, again
from heatertune.codec import to_json
from heatertune.errors import InputError
from heatertune.units import count
from heatertune.writing import write_files

if TYPE_CHECKING:
    from heatertune.log.log_values import Log, ReadSummary

__all__ = [
    "LINE", "Line", "Progress", "add_output_options", "can_take", "colourise", "has_colour", "output", "save",
    "tell_taken", "time_left", "to_nobody",
]


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


#: columns of a terminal; a line that moves is no longer
WIDTH: Final = 80
#: how much faster or slower than as a rule what is left may be taken for: what was kept says nothing of the rest
_PACES: Final = (0.5, 4.0)
_TERMS: Final = "what these terms mean: heatertune terms TA TN Ms …"
_COUNT: Final = re.compile(r"\((\d+) of (\d+)\)$")


class Progress:
    """What is done now, on the line of a terminal that moves; silent where there is none, and with --quiet.

    Where a message ends in its count, "(3 of 9)", the line says so until another count comes, with the time left.
    """

    def __init__(self, settings: argparse.Namespace, typical_s: Sequence[float] = ()) -> None:
        """Begin.

        Args:
            settings: of the command.
            typical_s: how long each step of the count takes as a rule [s]; none: all take as long.
        """
        self._loud, self._typical_s = not settings.quiet, typical_s
        self._begun = self._counted_from = time.monotonic()
        self._count, self._message = "", ""
        self._ends: float | None = None

    def __call__(self, message: str) -> None:
        """Tell what begins now."""
        if (match := _COUNT.search(message)) is not None:
            number, total = int(match[1]), int(match[2])
            now = time.monotonic()
            self._counted_from = now if number <= 1 else self._counted_from
            left = time_left(number, total, now - self._counted_from, self._typical_s)
            self._count, self._ends = f"{number} of {total}: ", None if left is None else now + left
            message = message[:match.start()].rstrip()
        self._message = message
        if self._loud:
            LINE.show(self._line)

    def note(self, message: str) -> None:
        """Tell what has to be known of the input, a line that stays; silent with --quiet."""
        if self._loud:
            LINE.end()
            print(message, file=sys.stderr, flush=True)

    def _line(self) -> str:
        now = time.monotonic()
        left = 0.0 if self._ends is None else self._ends - now
        end = f", about {left:.0f} s left" if left >= 1.0 else ""
        line, room = f"[{now - self._begun:5.1f} s] {self._count}{self._message}", WIDTH - 1 - len(end)
        return f"{line if len(line) <= room else f'{line[:room - 1]}…'}{end}"


def time_left(number: int, total: int, elapsed_s: float, typical_s: Sequence[float] = ()) -> float | None:
    """Return how long steps take that are left, the one that begins included [s]; None: nothing is known yet.

    Args:
        number: of the step that begins, from 1 on.
        total: how many steps there are.
        elapsed_s: since the first one began [s].
        typical_s: how long each takes as a rule [s]; of another number than total: all take as long.
    """
    if len(typical_s) != total:
        return elapsed_s / (number - 1) * (total - number + 1) if number > 1 else None
    pace = elapsed_s / sum(typical_s[:number - 1]) if number > 1 else 1.0
    return min(max(pace, _PACES[0]), _PACES[1]) * sum(typical_s[number - 1:])


def add_output_options(
    command: argparse.ArgumentParser, run: Callable[[argparse.Namespace], int], *, brief: bool = False
) -> None:
    """Add --json and --quiet, with a short form also --verbose, and set the function that runs the command."""
    command.set_defaults(run=run)
    group = command.add_argument_group("output")
    group.add_argument("--json", action="store_true", help="print JSON on stdout instead of the table; "
                       "--json=full: with every curve in it")
    group.add_argument(FULL, action="store_true", help=argparse.SUPPRESS)
    group.add_argument("--quiet", action="store_true", help="no progress on stderr")
    if brief:
        group.add_argument("--verbose", action="store_true", help="print all results, not only what matters most")


def tell_taken(settings: argparse.Namespace, logs: Iterable[Log], progress: Progress) -> None:
    """Tell on stderr what was taken of each log as what, and what was repaired or is doubtful: how many, or each.

    The line on what was taken is no progress: with --quiet it waits for the result, so that an error stays the only
    line; with --quiet and --json it is in the document alone.
    """
    for log in logs:
        line = [] if log.taken is None else [f"[log] {log.taken.line}", *_unit_lines(settings, log.taken)]
        if settings.quiet:
            settings.taken = [*getattr(settings, "taken", ()), *line]
        else:
            _print_lines(line)
        if getattr(settings, "verbose", True):
            for note in (*log.repairs, *log.warnings):
                progress.note(f"- {note}")
        elif counts := [f"{count(len(notes), noun)}" for notes, noun in (
                (log.repairs, "repair"), (log.warnings, "doubt")) if notes]:
            progress.note(f"[log] {log.name}: {' and '.join(counts)} (heatertune read tells which)")


def _unit_lines(settings: argparse.Namespace, taken: ReadSummary) -> list[str]:
    """Return the command that states the units which a log does not show, to be checked; nothing where it shows all."""
    options = " ".join(taken.assumed.values()).split()
    if not options or "unit-assumed" in getattr(settings, "accept", ()):
        return []
    return [f"[log] {taken.file}: units assumed; check and state them: {shlex.join(again(settings.given, options))}"]


def _print_lines(lines: Iterable[str]) -> None:
    LINE.end()
    for line in lines:
        shown = textwrap.fill(line, WIDTH, subsequent_indent=" " * len("[log] ")) if sys.stderr.isatty() else line
        print(shown, file=sys.stderr, flush=True)


def output(
    settings: argparse.Namespace, document: Mapping[str, Any], summary: Callable[[], str],
    brief: Callable[[], str] | None = None, short: Callable[[], Mapping[str, Any]] | None = None,
) -> None:
    """Print a result on stdout.

    Args:
        settings: of the command.
        document: the whole result, for --json=full.
        summary: it as text, for --verbose.
        brief: what matters most of it as text; None: the summary is short enough.
        short: what programs need of it, for --json; None: all.

    Raises:
        InputError: it cannot be written; a reader that went away is none.
    """
    LINE.end()
    if settings.json_full or settings.json:
        _print_result(to_json(document if settings.json_full or short is None else short()))
        return
    _print_lines(getattr(settings, "taken", ()))
    _print_result(colourise((summary if brief is None or settings.verbose else brief)(), sys.stdout) + "\n")
    if brief is not None and settings.verbose and not settings.quiet:
        print(_TERMS, file=sys.stderr)


def _print_result(text: str) -> None:
    """Print a result, to nobody where the reader of a pipe went away: the exit status is still that of the verdict."""
    try:
        print(text, end="", flush=True)
    except BrokenPipeError:
        to_nobody()
    except OSError as problem:
        to_nobody()  # what waits to be written would fail again
        raise InputError(f"the result: cannot be written: {problem.strerror}") from problem


def save(path: str | None, document: Mapping[str, Any]) -> None:
    """Write the document to a file, whole or not at all; nothing without a path."""
    if path is not None:
        target = Path(path)
        write_files(target.parent, {target.name: to_json(document)})
