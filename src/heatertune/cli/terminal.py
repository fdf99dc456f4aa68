"""Colour, for eyes only: a verdict is red, yellow or green on a terminal and plain text everywhere else."""

from __future__ import annotations

import os
import re
from typing import Final, TextIO

__all__ = ["colourise", "has_colour"]

#: what is painted → its attributes: bold, and one of the eight colours that every terminal has
_PAINT: Final = {"PASS": "1;32", "FAIL": "1;31", "NOT PROVEN": "1;33", "error:": "1;31"}
_PAINTED: Final = re.compile(r"\b(?:PASS|FAIL|NOT PROVEN)\b|\Aerror:")


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
