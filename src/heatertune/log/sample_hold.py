"""A series of its own instants, held to the instants of another."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from heatertune.log.numbers import Array
from heatertune.log.quantities import on_or_off
from heatertune.units import count

__all__ = ["HeldSeries", "changes_twice", "hold_series"]

_FEW_LEVELS: Final = 5  # of a power that is switched between them: a mean would be none of them
_SWITCHED: Final = 0.01  # share of the intervals in which a power changes more than once


class HeldSeries(NamedTuple):
    """Cells at the instants asked for; how many of these come before the first known one; what was done; a new unit."""

    cells: list[str]
    late: int
    notes: list[str]
    unit: str = ""


def hold_series(at: Array, time: Array, cells: Sequence[str], *, is_power: bool) -> HeldSeries:
    """Return what a series holds at other instants.

    A power that changes more than once between two instants is told as its mean over each interval, for what it held at
    the instants would be chance. A setpoint before its first instant is that first one.

    Args:
        at: the instants asked for, ascending, shape (n,) [s].
        time: the series' own, ascending, shape (k,) [s].
        cells: its values, one for each of its instants.
        is_power: whether it is a power.
    """
    places = np.searchsorted(time, at, side="right") - 1
    late = int(np.count_nonzero(places < 0))
    values = [cells[k] for k in np.maximum(places, 0)]
    if not is_power:
        return HeldSeries(values, 0,
                          [f"The setpoint of the first {count(late, 'row')} is taken from after."] if late else [])
    notes = [f"{count(late, 'row')} before the first power left out."] if late else []
    switched = on_or_off(cells)
    moved = _latest(at, time, cells)
    twice = changes_twice(at, time, cells)
    means = _means(at, time, switched or cells) if twice or (moved > 0.0 and len(set(cells)) > _FEW_LEVELS) else None
    if means is not None:
        changes = "more than once " if twice else ""
        notes.append(f"The power changes {changes}between readings; its mean over each interval was taken.")
        values = [repr(float(mean) * (100.0 if switched else 1.0)) for mean in means]
    elif moved > 0.0:
        notes.append(f"The power is held to the next reading, up to {moved:.3g} s after it changed.")
    return HeldSeries(values, late, notes, "%" if switched and means is not None else "")


def _changes(time: Array, cells: Sequence[str]) -> Array:
    return time[1:][[a != b for a, b in pairwise(cells)]]


def _latest(at: Array, time: Array, cells: Sequence[str]) -> float:
    """Return how long after a change the first reading comes that shows it, at most [s]."""
    changes = _changes(time, cells)
    changes = changes[(changes > at[0]) & (changes <= at[-1])]
    return float(np.max(at[np.searchsorted(at, changes)] - changes, initial=0.0))


def changes_twice(at: Array, time: Array, cells: Sequence[str]) -> bool:
    """Return whether a power changes more than once in some of the intervals between the instants `at`.

    Args:
        at: instants of the readings of the temperature [s], shape (n,).
        time: instants of the rows with a power [s], shape (m,).
        cells: the power in each of these rows, as in the file.
    """
    in_each = np.histogram(_changes(time, cells), bins=at)[0] if len(at) > 1 else np.zeros(1)
    return bool(np.count_nonzero(in_each > 1) > _SWITCHED * len(at))


def _means(at: Array, time: Array, cells: Sequence[str]) -> Array | None:
    """Return the mean over each interval; None where the power is no number."""
    try:
        values = np.array([float(cell) for cell in cells])
    except ValueError:
        return None
    ends = np.append(at, at[-1] + float(np.median(np.diff(at))))
    grown = np.concatenate([[0.0], np.cumsum(values[:-1] * np.diff(time))])
    k = np.clip(np.searchsorted(time, ends, side="right") - 1, 0, None)
    energy = grown[k] + values[k] * (ends - time[k])
    lasted = np.diff(ends)
    means = np.where(lasted > 0.0, np.diff(energy) / np.where(lasted > 0.0, lasted, 1.0), values[k[:-1]])
    return np.clip(means, values.min(), values.max())  # rounding may leave the range of the power
