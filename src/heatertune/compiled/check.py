"""The check of the tricks, made once in a process before machine code is called directly.

A probe function with every kind of argument and of result goes the whole way, from Numba's compiler or from the disk
through LLVM's loader, and has to give what its plain source gives. Before it is called, the places that are read are
compared with what NumPy and LLVM say of them: nothing wrong is ever called.

Where the check fails Numba's own path is taken: public functions of Numba alone, the same results. It is slower: each
process compiles anew what it needs, with doors to Python for every function.
"""

from __future__ import annotations

import ctypes
from array import array
from collections.abc import Callable
from functools import cache as remember
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.compiled.loader import array_address
from heatertune.compiled.plain_functions import callees, copy_function, plainly

__all__ = ["ProbeResult", "addresses_are_right", "numba_function", "probe", "probe_arguments"]


class ProbeResult(NamedTuple):
    """What the probe returns: a number of each kind, and a tuple."""

    total: float
    number: int
    positive: bool
    pair: tuple[float, int]


def probe(  # noqa: PLR0913 - one of each kind
    number: float, whole: int, flag: bool, row: Any, table: Any, column: Any, words: Any, cells: Any,
    pair: tuple[float, tuple[int, float]],
) -> ProbeResult:
    """Compute with each argument, and write into an array, so that one in a wrong place shows.

    Args:
        number: any.
        whole: any.
        flag: whether the total may be positive.
        row: array, shape (n,); its first number is written.
        table: array, shape (n, m).
        column: array, shape (n,), whose numbers do not stand side by side.
        words: two whole numbers at least, as an `array`.
        cells: bytes.
        pair: nested tuples.
    """
    total = number + 2.0 * pair[0] + 3.0 * pair[1][1]
    for k in range(len(row)):
        total += (k + 1) * row[k]
    for i in range(table.shape[0]):
        for j in range(table.shape[1]):
            total += (10 * i + j) * table[i, j]
    for k in range(len(column)):
        total += (k + 1) * column[k]
    row[0] = total
    count = whole + 5 * pair[1][0] + words[1] + cells[0]
    return ProbeResult(total, count, flag and total > 0.0, (total - number, count - whole))


def probe_arguments() -> tuple[Any, ...]:
    """Return the probe's arguments, made anew: it writes into one."""
    table: npt.NDArray[np.float64] = np.arange(6.0).reshape(2, 3) + 0.25
    return (0.5, 7, True, np.array([1.5, -2.25, 4.0]), table, table[:, 1], array("q", [3, 1 << 40]),
            bytearray(b"\x11\x22"), (1.125, (9, -3.5)))


def addresses_are_right() -> bool:
    """Return whether an array's numbers stand where they are looked for, see `loader.array_address`."""
    table = np.arange(24.0).reshape(2, 3, 4)
    views = (table, table[1], table[:, 1:, ::2], table.T, np.array(3.5), np.zeros(0), np.array([True, False]))
    return all(array_address(view) == view.ctypes.data for view in views) and ctypes.sizeof(ctypes.c_void_p) == 8


@remember
def numba_function(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a plain function as Numba compiles it, with all that it calls; arguments by position only."""
    from numba import njit

    plain = plainly(function)
    inside = {name: numba_function(value) for name, value in callees(plain).items()}
    made: Callable[..., Any] = njit(nogil=True, error_model="numpy")(copy_function(plain, inside))
    return made
