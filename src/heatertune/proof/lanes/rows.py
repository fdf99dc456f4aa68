"""Nested named tuples of many loops in rows of one flat array, number r of loop l at r·`LANES` + l.

Only so does a compiler see that what one loop writes no other one reads, and runs several at once. The functions that
load and store a tuple are made from its shape: each field stands in a row of its own, whole numbers bit by bit.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any, Final, NamedTuple, cast

import numpy as np

from heatertune.compiled.generated import functions_from_text

__all__ = ["LANES", "STEP", "Rows", "constant_function", "lanes_of", "rows_of"]

#: loops side by side: with fewer a compiler unrolls them first and then sees none, with more one waits for all others
LANES: Final = 32
#: fewer loops are run in so many steps of as many
STEP: Final = 8

_LOAD: Final = {np.float32: "np.float32({0})", bool: "{0} != 0.0", int: "np.float64({0}).view(np.int64)", float: "{0}"}
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


def lanes_of(rows: Any) -> int:
    """Return how many loops stand side by side: what an array is longer than whole rows, in steps of `STEP`.

    A compiler sees of which number it is a multiple, and that it does not change.
    """
    return (len(rows) - STEP & LANES - STEP) + STEP


def rows_of(value: Any, first: int = 0) -> Rows:
    """Return how a value is held in rows; only its shape matters.

    Args:
        value: a number, a truth value, or a tuple of such values, named or not.
        first: number of its first row.

    Raises:
        TypeError: a shape that has no rows: an array, say.
    """
    stores, types = list[str](), dict[str, type]()

    def place(entry: Any, name: str) -> str:
        kind = next((kind for kind in _LOAD if isinstance(entry, kind)), None)
        if kind is None:
            raise TypeError(f"{name} is of type {type(entry).__name__}, which has no row")
        there = f"rows[{(first + len(stores)) * LANES} + lane]"
        stores.append(f"{there} = {_STORE.get(kind, '{0}').format(name)}")
        return _LOAD[kind].format(there)

    load = _rebuilt(value, "value", types, place)
    text = (f"def loaded(rows, lane):\n    return {load}\n\n"
            f"def stored(rows, lane, value):\n    {f'{chr(10)}    '.join(stores)}\n")
    loaded, stored = _made(text, ("loaded", "stored"), tuple(types.items()))
    return Rows(loaded, stored, first + len(stores))


def constant_function(value: Any) -> Callable[[Any], Any]:
    """Return a function of such a value that gives it back, its infinite numbers as constants.

    With them is said that there is something not at all, and a compiler then leaves out what would be done with it.
    """
    types = dict[str, type]()

    def field(entry: Any, name: str) -> str:
        infinite = isinstance(entry, float | np.float32) and math.isinf(entry)
        sign = "PLUS" if infinite and entry > 0.0 else "MINUS"
        constant = f"np.float32({sign})" if isinstance(entry, np.float32) else sign
        return constant if infinite else name

    text = f"def given(value):\n    return {_rebuilt(value, 'value', types, field)}\n"
    return cast("Callable[[Any], Any]", _made(text, ("given",), tuple(types.items()))[0])


def _rebuilt(value: Any, name: str, types: dict[str, type], convert: Callable[[Any, str], str]) -> str:
    """Return the text that makes a tuple anew of what `convert` makes of its numbers and their names."""
    if not isinstance(value, tuple):
        return convert(value, name)
    inside = "".join(f"{_rebuilt(part, field, types, convert)}, "
                     for part, field in zip(value, _fields(value, name), strict=True))
    if not hasattr(value, "_fields"):
        return f"({inside})"
    kind = f"{type(value).__name__}_{len(types)}"
    types[kind] = type(value)
    return f"{kind}({inside})"


def _fields(value: tuple[Any, ...], name: str) -> Iterator[str]:
    if hasattr(value, "_fields"):
        return (f"{name}.{field}" for field in value._fields)
    return (f"{name}[{place}]" for place in range(len(value)))


@cache
def _made(text: str, names: tuple[str, ...], types: tuple[tuple[str, type], ...]) -> tuple[Any, ...]:
    """Return functions made from their text, which only names fields."""
    scope: dict[str, Any] = {"np": np, "PLUS": np.inf, "MINUS": -np.inf, "__name__": __name__, **dict(types)}
    scope = functions_from_text(text, scope, file=__file__)
    digest = hashlib.sha256(text.encode()).hexdigest()[:16]
    for name in names:
        scope[name].__doc__ = "Made by `heatertune.proof.lanes.rows`: see `Rows` and `fixed`."
        scope[name].__qualname__ = f"{name}_{digest}"  # by which `compiled` tells it from that of another shape
    return tuple(scope[name] for name in names)
