"""Segments of a log with power: where it was disturbed, the heater stays the same and its state begins anew.

A jump is sought in what a fit leaves over: the model knows the power and the time between two readings, so neither a
kink of a fast heater at an edge nor a slope over a gap looks like one, and no heater's answer jumps.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.log.values import MIN_SAMPLES, Log
from heatertune.model.outliers import replace_outliers

__all__ = ["MOST", "Segments", "gaps", "jumps", "part"]

Array = npt.NDArray[np.float64]
Places = npt.NDArray[np.intp]

#: more jumps or gaps than these are the way of the log, not disturbances
MOST = 10

_GAP = 10.0  # times as long as nine of ten steps of the clock
_SHARE = 0.1  # of the log's span: a jump no heater makes between two readings
_TIMES = 10.0  # the usual step of what is left over
_BESIDE = 11  # readings before and after that the jump has to set apart: five odd ones in a row are outliers
_LASTS = 0.3  # of the jump
_FEWEST = 10  # readings of a segment: fewer carry nothing beside its own state
_NAMED = 5  # instants that are listed


class Segments(NamedTuple):
    """Where the segments of a log after the first begin: places of their first readings."""

    after_gaps: Places
    after_jumps: Places

    @property
    def places(self) -> Places:
        """All of them, in order, shape (n,)."""
        return np.union1d(self.after_gaps, self.after_jumps)

    def with_jumps(self, places: Places) -> Segments:
        """Return the segments with these jumps (n,), too."""
        return self._replace(after_jumps=np.union1d(self.after_jumps, np.setdiff1d(places, self.after_gaps)))

    def long_enough(self, n: int) -> npt.NDArray[np.bool_]:
        """Return which of n readings lie in a segment that is long enough to tell something, shape (n,)."""
        starts = np.concatenate([[0], self.places])
        sizes = np.diff(np.append(starts, n))
        rows = np.repeat(sizes >= _FEWEST, sizes)
        return rows if np.count_nonzero(rows) >= MIN_SAMPLES else np.ones(n, dtype=np.bool_)

    def notes(self, log: Log) -> Iterator[str]:
        """Tell where the segments begin, why, and what of the log is not in them."""
        reasons = [f"{what} {_named(log.time_s[places])} s" for what, places in (
            ("a gap in the clock before", self.after_gaps), ("a jump of the temperature before", self.after_jumps),
        ) if len(places)]
        if reasons:
            yield (
                f"The log is disturbed: {'; '.join(reasons)}. It was fitted in segments, each with an initial state of "
                "its own, all of one heater."
            )
        left = log.time_s[~self.long_enough(len(log.time_s))]
        if len(left):
            yield (
                "Readings between two disturbances, too few to tell anything, were left out: "
                f"{len(left)} (at {_named(left)} s)."
            )


def gaps(log: Log) -> Segments:
    """Return the segments that gaps in the clock make: the power in a gap is unknown."""
    step = np.diff(log.time_s)
    places = 1 + np.flatnonzero(step > _GAP * np.quantile(step, 0.9))
    return Segments(places if len(places) <= MOST else places[:0], places[:0])


def jumps(record: Array, simulated: Array) -> Places:
    """Return the places of the first readings after a jump: what a fit leaves over goes elsewhere at once and stays.

    Logged and simulated readings [°C] are of shape (n,), the places of shape (k,).
    """
    left = record - simulated
    step = np.diff(left)
    usual = 1.4826 * float(np.median(np.abs(step - np.median(step))))
    limit = max(_SHARE * float(np.ptp(replace_outliers(record))), _TIMES * usual)
    places = 1 + np.flatnonzero(np.abs(step) > limit)
    lasting = [abs(_apart(left, int(place))) > _LASTS * abs(step[place - 1]) for place in places]
    return places[np.array(lasting, dtype=np.bool_)]


def part(log: Log, rows: npt.NDArray[np.bool_]) -> Log:
    """Return those of a log's readings that the mask `rows`, shape (n,), takes."""
    setpoint, power = log.setpoint_degC, log.power_pct
    return replace(
        log, time_s=log.time_s[rows], temperature_degC=log.temperature_degC[rows],
        power_pct=None if power is None else power[rows], setpoint_degC=None if setpoint is None else setpoint[rows],
    )


def _apart(left: Array, place: int) -> float:
    return float(np.median(left[place : place + _BESIDE]) - np.median(left[max(place - _BESIDE, 0) : place]))


def _named(instants: Array) -> str:
    named = ", ".join(f"{t:.6g}" for t in instants[:_NAMED])
    return f"{named} and {len(instants) - _NAMED} more" if len(instants) > _NAMED else named
