"""Text of programs: numbers as C and YAML write them, and comments put out of the way."""

from __future__ import annotations

import math
import re
from typing import Final

__all__ = ["blank_matches", "number_of"]

_NUMBER: Final = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?[fFlL]?", re.ASCII)


def number_of(text: str) -> float | None:
    """Return a decimal number in double precision, None where it is none or has no end."""
    plain = text.strip()
    if not _NUMBER.fullmatch(plain):
        return None
    value = float(plain.rstrip("fFlL"))
    return value if math.isfinite(value) else None


def blank_matches(pattern: re.Pattern[str], text: str) -> str:
    """Return a text with blanks for what a pattern matches, line for line."""
    return pattern.sub(lambda match: re.sub(r"[^\n]", " ", match[0]), text)
