"""How long work says what begins."""

from __future__ import annotations

from collections.abc import Callable

__all__ = ["ProgressCallback"]

#: called with a short message when something begins
ProgressCallback = Callable[[str], object]
