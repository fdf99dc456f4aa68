"""The one place that runs generated source: functions made from their text, where loops over it would be too slow."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

__all__ = ["BEYOND", "Scope", "functions_from_text"]

#: names that a function may use
Scope = dict[str, Any]

#: lines, more than any file has: who looks in it for the lines of a generated function finds none
BEYOND: Final = 1000


def functions_from_text(text: str, names: Mapping[str, object], *, file: str = "<generated>") -> Scope:
    """Run the text of functions and return the names it defines, with those that it was given.

    Only heatertune writes such text: from field names, numbers and instructions that were parsed before, never from
    what a user typed.

    Args:
        text: the functions.
        names: what they may use.
        file: that of which they count as a part. Machine code is kept for functions of files alone, since it depends
            on their content; the lines begin beyond its end.
    """
    scope = dict(names)
    exec(compile(text if file == "<generated>" else "\n" * BEYOND + text, file, "exec"), scope)
    return scope
