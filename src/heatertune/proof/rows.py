"""Nested named tuples of many loops in rows of one flat array, number r of loop l at r·`LANES` + l.

Only so does a compiler see that what one loop writes no other one reads, and runs several at once. The functions that
load and store a tuple are made from its shape: each field stands in a row of its own, whole numbers bit by bit.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any, Final, NamedTuple

import numpy as np

__all__ = ["LANES", "Rows", "rows_of"]

#: loops side by side: with fewer a compiler unrolls them first and then sees none, with more one waits for all others
LANES: Final = 32

_LOAD: Final = {
    np.float32: "np.float32({0})", bool: "{0} != 0.0", int: "np.float64({0}).view(np.int64)", float: "{0}",
}
_STORE: Final = {bool: "1.0 if {0} else 0.0", int: "np.int64({0}).view(np.float64)"}


class Rows(NamedTuple):
    """Functions that load and store a tuple.

    Attributes:
        loaded: (array, number of the loop) → the tuple.
        stored: (array, number of the loop, tuple) → None.
        end: number of the first row behind.
    """

    loaded: Callable[[Any, int], Any]
    stored: Callable[[Any, int, Any], None]
    end: int


def rows_of(value: Any, first: int = 0) -> Rows:
    """Return how a value is held in rows; only its shape matters.

    Args:
        value: a number, a truth value, or a tuple of such values, named or not.
        first: number of its first row.

    Raises:
        TypeError: a shape that has no rows: an array, say.
    """
    lines, types = list[str](), dict[str, type]()
    load, end = _written(value, "value", first, lines, types)
    return Rows(*_made(load, "\n    ".join(lines), tuple(types.items())), end)


def _written(value: Any, name: str, row: int, lines: list[str], types: dict[str, type]) -> tuple[str, int]:
    """Return how a value is loaded, and the first row behind it; add how it is stored."""
    if isinstance(value, tuple):
        parts = list[str]()
        for place, (each, field) in enumerate(zip(value, _fields(value, name), strict=True)):
            part, row = _written(each, field, row, lines, types)
            parts.append(part)
            del place
        inside = "".join(f"{part}, " for part in parts)
        if not hasattr(value, "_fields"):
            return f"({inside})", row
        kind = f"{type(value).__name__}_{len(types)}"
        types[kind] = type(value)
        return f"{kind}({inside})", row
    kind_ = next((each for each in _LOAD if isinstance(value, each)), None)
    if kind_ is None:
        raise TypeError(f"{type(value).__name__} of {name} has no rows")
    place_ = f"rows[{row * LANES} + lane]"
    lines.append(f"{place_} = {_STORE.get(kind_, '{0}').format(name)}")
    return _LOAD[kind_].format(place_), row + 1


def _fields(value: tuple[Any, ...], name: str) -> Iterator[str]:
    if hasattr(value, "_fields"):
        return (f"{name}.{field}" for field in value._fields)
    return (f"{name}[{place}]" for place in range(len(value)))


@cache
def _made(load: str, store: str, types: tuple[tuple[str, type], ...]) -> tuple[Any, Any]:
    text = f"def loaded(rows, lane):\n    return {load}\n\ndef stored(rows, lane, value):\n    {store}\n"
    scope: dict[str, Any] = {"np": np, "__name__": __name__, **dict(types)}
    exec(compile(text, __file__, "exec"), scope)  # noqa: S102 - of names of fields alone; a file a compiler looks for
    digest = hashlib.sha256(text.encode()).hexdigest()[:16]
    for name in ("loaded", "stored"):
        scope[name].__qualname__ = f"{name}_{digest}"  # by which `compiled` tells it from that of another shape
    return scope["loaded"], scope["stored"]
