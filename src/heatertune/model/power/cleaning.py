"""One lag fitted to a log with power without its outliers, in the segments that its disturbances make."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.log.values import Log
from heatertune.model.outliers import replace_outliers, without_outliers
from heatertune.model.power.load_steps import bic_of
from heatertune.model.power.open_loop import PowerFit, PowerProblem
from heatertune.model.power.segments import MOST, Segments, gaps, jumps, part

__all__ = ["CleanedFit", "clean_log"]

Array = npt.NDArray[np.float64]
Places = npt.NDArray[np.intp]

_READINGS = 1000  # averaged, in the search; what is reported is simulated at every reading
_PASSES = 4  # of finding outliers
_ROUNDS = 3  # of finding jumps: a large one hides others


class CleanedFit(NamedTuple):
    """A log in segments with nothing but the outliers replaced, and one lag fitted to just that.

    Attributes:
        whole: the problem at every reading.
        readings_degC: with the outliers put where their neighbours are, shape (n,).
        outliers: their places.
        problem: on averaged readings.
        fit: its best fit.
    """

    whole: PowerProblem
    readings_degC: Array
    outliers: Places
    problem: PowerProblem
    fit: PowerFit

    @property
    def bic(self) -> float:
        """Criterion of the fit; a reading set aside is one more unknown."""
        return bic_of(self.problem, self.fit) + len(self.outliers) * math.log(len(self.readings_degC))

    @property
    def simulated_degC(self) -> Array:
        """What the fit makes of every reading, shape (n,)."""
        return np.asarray(self.fit.linear @ self.whole.basis(self.fit.vector))


def clean_log(log: Log, problem: PowerProblem) -> tuple[Log, CleanedFit, tuple[str, ...]]:
    """Return what is left of a log, one lag fitted to it, and sentences about its disturbances.

    Args:
        log: as given.
        problem: of one lag at every reading.
    """
    segments = gaps(log)
    clean = _without_outliers(_restarted(log, problem, segments))
    for _ in range(_ROUNDS):
        more = segments.with_jumps(_jumps(clean))
        if len(more.places) == len(segments.places) or len(more.places) > MOST:
            break
        segments, clean = more, _without_outliers(_restarted(log, problem, more))
    rows = segments.long_enough(len(log.time_s))
    if not rows.all():
        clean = _without_outliers(_part(clean.whole, rows))
    return (log if rows.all() else part(log, rows)), clean, tuple(segments.notes(log))


def _jumps(clean: CleanedFit) -> Places:
    """Return the places of jumps, whichever power was on before the log."""
    measured = clean.whole.readings.temperature_degC
    places = jumps(measured, clean.simulated_degC)
    if len(places) and clean.whole.power_before_pct is None and clean.whole.power_before != 0.0:
        other = _without_outliers(replace(clean.whole, power_before_pct=0.0))
        places = np.intersect1d(places, jumps(measured, other.simulated_degC))
    return places


def _restarted(log: Log, problem: PowerProblem, segments: Segments) -> PowerProblem:
    return replace(problem, readings=replace(problem.readings, restart_s=log.time_s[segments.places]))


def _part(problem: PowerProblem, rows: npt.NDArray[np.bool_]) -> PowerProblem:
    """Return the problem on the readings of its long segments; the power is known all the time."""
    r = problem.readings
    starts = r.restart_s[rows[np.searchsorted(r.time_s, r.restart_s)]]
    first = r.time_s[rows][0]
    return replace(problem, readings=replace(
        r, time_s=r.time_s[rows], half_s=r.half_s[rows], temperature_degC=r.temperature_degC[rows],
        restart_s=starts[starts > first],
    ))


def _without_outliers(problem: PowerProblem) -> CleanedFit:
    """Return one lag without the outliers, found from the readings as they are and with the wild ones tamed.

    Wild readings would hide the others; but the pulses of a fast heater look wild too, and may not stay tamed.
    """
    measured = problem.readings.temperature_degC
    smooth = replace_outliers(measured)
    starts = [measured] if np.array_equal(smooth, measured) else [measured, smooth]
    return min((_settled(problem, start) for start in starts), key=lambda clean: clean.bic)


def _settled(problem: PowerProblem, start: Array) -> CleanedFit:
    clean, readings = _fitted(problem, start, np.empty(0, dtype=np.intp)), problem.readings
    begun = np.searchsorted(readings.time_s, readings.restart_s)
    for _ in range(_PASSES):
        last = clean
        readings_degC, outliers = without_outliers(readings.temperature_degC, last.simulated_degC, begun)
        if np.array_equal(readings_degC, last.readings_degC):
            break
        clean = _fitted(problem, readings_degC, outliers)
        if len(outliers) and np.array_equal(outliers, last.outliers):
            break
    return clean


def _fitted(problem: PowerProblem, readings_degC: Array, outliers: Places) -> CleanedFit:
    thin = replace(problem, readings=replace(problem.readings, temperature_degC=readings_degC)).average(_READINGS)
    return CleanedFit(problem, readings_degC, outliers, thin, thin.fit())
