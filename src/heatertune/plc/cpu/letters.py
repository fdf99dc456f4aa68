"""The letters that every programming tool takes in comments: ASCII alone."""

from __future__ import annotations

from typing import Final

__all__ = ["in_ascii"]

_PLAIN: Final = str.maketrans({"°": "deg", "…": "..", "·": "*", "×": "*", "≤": "<=", "≥": ">=", "−": "-", "–": "-"})


def in_ascii(text: str) -> str:
    """Return a text in ASCII: signs by what is written for them, any other letter as a question mark."""
    return text.translate(_PLAIN).encode("ascii", "replace").decode("ascii")
