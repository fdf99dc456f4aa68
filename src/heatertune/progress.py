"""How long work says what begins."""

from __future__ import annotations

from collections.abc import Callable

__all__ = ["Told"]

#: called with a short message when something begins
Told = Callable[[str], object]
