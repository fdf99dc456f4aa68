"""A program's function run many times by one compiled loop: numbers put in before each scan, others read after it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import FunctionType
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.compiled import bound, compile_function, worth_compiling

__all__ = ["KEEP", "Got", "Tape", "run_tape"]

#: of a whole number: it stays as it is
KEEP: Final = -(1 << 62)
#: scans, one by one, that take as long as to compile a program
_MOST_PLAIN: Final = 400_000

#: variable → its value after each scan
Got = Mapping[str, npt.NDArray[Any]]


class Tape(NamedTuple):
    """What is put in and asked for.

    Attributes:
        scans: how many.
        reals: REAL → its values before each scan, nan where it stays as it is.
        wholes: other variable → the same, `KEEP` where it stays as it is.
        asked: names of what is read after each scan.
    """

    scans: int
    reals: Mapping[str, npt.NDArray[np.float64]]
    wholes: Mapping[str, npt.NDArray[np.int64]]
    outputs: Sequence[str]


def run_tape(
    run: FunctionType, reals: list[float], wholes: list[int], tape: Tape, place: Mapping[str, tuple[int, int]]
) -> Got | None:
    """Run a program's function on its memory; return what is asked for.

    None: that is not worth it, a controller would stop somewhere, or a number is no REAL; the memory is as it was then.

    Args:
        run: the function.
        reals: the row of REALs.
        wholes: the row of other numbers.
        tape: see there.
        place: name → row and place.
    """
    loop = bound(_taped, scan=run)
    if not worth_compiling(tape.scans, f"text {run.__qualname__}", _MOST_PLAIN, loop):
        return None
    r, w = np.array(reals, dtype=np.float32), np.array(wholes, dtype=np.int64)
    read = [[name for name in tape.outputs if place[name][0] == row] for row in (0, 1)]
    got = np.empty((len(read[0]), tape.scans), dtype=np.float32), np.empty((len(read[1]), tape.scans), dtype=np.int64)
    puts = [(_rows(given, tape.scans, kind), _places(given, place)) for given, kind in (
        (tape.reals, np.float32), (tape.wholes, np.int64))]
    if any(not np.array_equal(row, given, equal_nan=True) for row, given in zip(
            puts[0][0], tape.reals.values(), strict=True)):
        return None
    try:
        compile_function(loop)(r, w, *puts[0], *puts[1], got[0], _places(read[0], place), got[1],
                               _places(read[1], place),
                       tape.scans)
    except ArithmeticError:
        return None
    reals[:], wholes[:] = r.tolist(), w.tolist()
    return {name: got[row][k].astype((np.float64, np.int64)[row]) for row in (0, 1) for k, name in enumerate(read[row])}


def _rows(given: Mapping[str, npt.NDArray[Any]], scans: int, kind: type) -> npt.NDArray[Any]:
    return np.array(list(given.values()), dtype=kind).reshape(len(given), scans)


def _places(names: Sequence[str] | Mapping[str, Any], place: Mapping[str, tuple[int, int]]) -> npt.NDArray[np.int64]:
    return np.array([place[name][1] for name in names], dtype=np.int64)


def scan(r: Any, w: Any, f: Any, a: int, b: int, c: int) -> None:
    """Stand for the program's function, which is bound here."""


def _taped(  # noqa: PLR0913 - as the compiler takes them
    r: Any, w: Any, put_r: Any, at_r: Any, put_w: Any, at_w: Any, got_r: Any, of_r: Any, got_w: Any, of_w: Any,
    scans: int,
) -> None:
    for k in range(scans):
        for j in range(len(at_r)):
            value = put_r[j, k]
            if not math.isnan(value):
                r[at_r[j]] = value
        for j in range(len(at_w)):
            whole = put_w[j, k]
            if whole != KEEP:
                w[at_w[j]] = whole
        scan(r, w, at_w, 0, 0, 0)
        for j in range(len(of_r)):
            got_r[j, k] = r[of_r[j]]
        for j in range(len(of_w)):
            got_w[j, k] = w[of_w[j]]
