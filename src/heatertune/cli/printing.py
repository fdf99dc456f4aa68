"""What the commands print and write: progress on stderr, the result on stdout or in a file."""

from __future__ import annotations

import argparse
import re
import sys
import time
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from heatertune.cli.terminal import painted

if TYPE_CHECKING:
    from heatertune.log.values import Log

__all__ = ["Progress", "add_output_options", "output", "save", "tell_taken"]

_COUNT: Final = re.compile(r"\((\d+) of (\d+)\)$")


class Progress:
    """Messages on stderr for whatever takes longer than a second; silent with --quiet."""

    def __init__(self, settings: argparse.Namespace) -> None:
        self._loud = not settings.quiet
        self._begun = time.monotonic()
        self._counted_from = self._begun

    def __call__(self, message: str) -> None:
        """Tell what begins now; where the message ends in its count, "(3 of 9)", also the time that is left."""
        now = time.monotonic()
        if self._loud:
            left = self._left(message, now)
            print(f"[{now - self._begun:5.1f} s] {message}{left}", file=sys.stderr, flush=True)

    def _left(self, message: str, now: float) -> str:
        count = _COUNT.search(message)
        if count is None:
            return ""
        number, total = int(count[1]), int(count[2])
        if number <= 1:
            self._counted_from = now
            return ""
        seconds = (now - self._counted_from) / (number - 1) * (total - number + 1)
        return f", about {seconds:.0f} s left"


def add_output_options(command: argparse.ArgumentParser) -> None:
    """Add --json and --quiet."""
    group = command.add_argument_group("output")
    group.add_argument("--json", action="store_true", help="print one JSON document on stdout instead of the table")
    group.add_argument("--quiet", action="store_true", help="no progress on stderr")


def tell_taken(settings: argparse.Namespace, logs: Iterable[Log], progress: Progress) -> None:
    """Tell on stderr what was taken of each log as what, and as progress what was repaired or is doubtful.

    The line is no progress: with --quiet it waits for the result, so that an error stays the only line; with --quiet
    and --json it is in the document alone.
    """
    for log in logs:
        line = [] if log.taken is None else [f"[log] {log.taken.line}"]
        if settings.quiet:
            settings.taken = [*getattr(settings, "taken", ()), *line]
        else:
            _print_lines(line)
        for note in (*log.repairs, *log.doubts):
            progress(note)


def _print_lines(lines: Iterable[str]) -> None:
    for line in lines:
        print(line, file=sys.stderr, flush=True)


def output(settings: argparse.Namespace, document: Mapping[str, Any], summary: Callable[[], str]) -> None:
    """Print the document (--json) or the summary on stdout."""
    from heatertune.documents import to_json  # noqa: PLC0415

    if settings.json:
        print(to_json(document), end="")
    else:
        _print_lines(getattr(settings, "taken", ()))
        print(painted(summary(), sys.stdout))


def save(path: str | None, document: Mapping[str, Any]) -> None:
    """Write the document to a file, whole or not at all; nothing without a path."""
    from heatertune.documents import to_json  # noqa: PLC0415
    from heatertune.writing import write_files  # noqa: PLC0415

    if path is not None:
        target = Path(path)
        write_files(target.parent, {target.name: to_json(document)})
