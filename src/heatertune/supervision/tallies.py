"""What a loop in order shows a monitor: the numbers from which its limits are made."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.compiled import compile_function
from heatertune.supervision.loops import Ran
from heatertune.supervision.monitor import STATE, Numbers, is_full, restart, scan, scan_counts, watch, window_sums

__all__ = ["Tally", "first_alarm", "tally", "windows"]

#: places of `_tallied`
_TALLIES: Final = 8


class Tally(NamedTuple):
    """Extremes of one loop: readings [counts], moves from scan to scan, and how long what lasted [scans].

    `still_moved` is how long a reading stayed the same although the power moved; `grew` how many swings in a row grew.
    """

    low: int
    high: int
    jump: int
    still: int
    still_moved: int
    full: int
    grew: int
    steady: int


def _tallied(numbers: Numbers, state: Any, readings: Any, powers: Any, settled: int, begins: int, out: Any) -> None:
    restart(state)
    off, known, last, least, most = True, False, 0, 0, 0
    for k in range(len(readings)):
        reading, power = int(readings[k]), int(powers[k])
        if power < 0:
            off = True
            continue
        if off:
            restart(state)
            off, last = False, reading
        scan(numbers, state, reading, power)
        still, moved, full, grew, ended, level = scan_counts(state)
        out[0], out[1] = min(out[0], reading), max(out[1], reading)
        out[2] = max(out[2], reading - last, last - reading)
        out[3], out[4], out[5], out[6] = max(out[3], still), max(out[4], moved), max(out[5], full), max(out[6], grew)
        if begins <= k < settled and ended:
            least, most = (min(least, level), max(most, level)) if known else (level, level)
            out[7], known = most - least, True
        last = reading


def _windows(
    numbers: Numbers, state: Any, readings: Any, powers: Any, blocks: int, largest: bool, out: Any,
) -> int:
    restart(state)
    off, rows = False, 0
    for k in range(len(readings)):
        if powers[k] < 0:
            off = True
            continue
        if off:
            restart(state)
            off = False
        scan(numbers, state, int(readings[k]), int(powers[k]))
        if is_full(numbers, state, blocks):
            out[rows, 0], out[rows, 1], out[rows, 2] = window_sums(numbers, state, blocks, largest)
            rows += 1
    return rows


def tally(numbers: Numbers, one: Ran, rest: tuple[int, int]) -> Tally:
    """Return the extremes of a loop in order; within the scans `rest` it is at rest."""
    out = np.zeros(_TALLIES, dtype=np.int64)
    out[0] = 1 << 40
    compile_function(_tallied)(numbers, _state(), one.counts, one.power, rest[1], rest[0], out)
    return Tally(*out.tolist())


def windows(numbers: Numbers, one: Ran, blocks: int, *, largest: bool) -> npt.NDArray[np.int64]:
    """Return movement, level and power of each window of a loop, shape (n, 3)."""
    out = np.empty((len(one.counts) // numbers.block + 1, 3), dtype=np.int64)
    return out[:compile_function(_windows)(numbers, _state(), one.counts, one.power, blocks, largest, out)]


def first_alarm(numbers: Numbers, one: Ran, first: int = 0) -> tuple[int, int]:
    """Return the scan of the first alarm from a scan on, -1 for none, and the alarm."""
    at, alarm = compile_function(watch)(numbers, _state(), one.counts, one.power, first)
    return int(at), int(alarm)


def _state() -> npt.NDArray[np.int64]:
    return np.zeros(STATE, dtype=np.int64)
