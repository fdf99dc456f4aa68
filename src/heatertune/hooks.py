"""Who makes words run: the package hands it in from above, as in `heatertune.show`, for words know no controller."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final

__all__ = ["run_by", "runner"]

#: (words, switch → setting) → the running controller
Runner = Callable[[Any, Mapping[str, str]], Any]

_runners: Final[list[Runner]] = []


def run_by(who: Runner) -> None:
    """Let words be run by a function; it is called when words are to run, not before."""
    _runners.append(who)


def runner() -> Runner:
    """Return who makes words run."""
    return _runners[-1]
