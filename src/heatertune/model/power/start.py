"""How a log begins: whether the heater rested, and with which power before.

A test that begins at rest has no initial state to fit. A free one would swallow what the model cannot follow at the
first step, and the ambient with it. What the readings before the first change of the power show decides where they
can: a temperature that moves while the power is held is no rest.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from heatertune.model.outliers import sensor_step
from heatertune.model.power.log_arrays import Readings
from heatertune.model.power.open_loop import PowerProblem

__all__ = ["is_plain_rest", "starts"]

_FEWEST = 5  # readings before the first change of the power
_SURE = 3.0  # standard deviations
_SHARE = 0.05  # of the span, that an unseen deviation from rest may move the ambient


class _Slope(NamedTuple):
    """The readings before the first change of the power: their slope, its error, scatter and length."""

    degC_per_s: float
    error_degC_per_s: float
    scatter_degC: float
    length_s: float

    @property
    def is_seen(self) -> bool:
        """Whether the temperature moves by more than noise."""
        moved = abs(self.degC_per_s)
        return moved > _SURE * self.error_degC_per_s and moved * self.length_s > _SURE * self.scatter_degC


def starts(problem: PowerProblem, *, closed: bool) -> Iterator[PowerProblem]:
    """Yield the problem with each start that is possible: the power before, known or not, and rest or not.

    `closed`: a controller moved the power, so nobody switched it on with the log.
    """
    befores = [problem.power_before_pct]
    if befores == [None] and problem.readings.level_pct[0] != 0.0:
        befores.append(0.0)
    for before in befores:
        begun = replace(problem, power_before_pct=before)
        yield begun
        if _may_rest(begun) and not (closed and not _held(begun)):
            yield replace(begun, at_rest=True)


def _may_rest(problem: PowerProblem) -> bool:
    """Return whether the first readings may be those of rest with the power before the log.

    Where that power goes on, they hardly move; where it came on with the log, none that follows is colder.
    """
    if _held(problem):
        slope = _slope(problem.readings)
        return slope is not None and not slope.is_seen
    readings = problem.readings.temperature_degC
    noise = float(np.std(np.diff(readings, 2))) / np.sqrt(6.0)
    return problem.power_before == 0.0 and float(readings.min()) > float(readings[0]) - 2.0 * _SURE * noise


def is_plain_rest(problem: PowerProblem, lag_s: float) -> bool:
    """Return whether the readings before the first change of the power leave nothing but rest.

    A deviation from rest would decay with the lag [s]: its slope, as far as the readings allow one, bounds it.
    """
    slope = _slope(problem.readings) if _held(problem) else None
    if slope is None or slope.is_seen:
        return False
    most = (abs(slope.degC_per_s) + _SURE * slope.error_degC_per_s) * lag_s
    return most < _SHARE * float(np.ptp(problem.readings.temperature_degC))


def _held(problem: PowerProblem) -> bool:
    """Return whether the power before the log goes on in it."""
    return problem.power_before == float(problem.readings.level_pct[0])


def _slope(readings: Readings) -> _Slope | None:
    """Return what the readings before the first change of the power show, None where they are too few."""
    end = readings.edge_s[1] if len(readings.edge_s) > 1 else np.inf
    before = readings.time_s + readings.half_s <= end
    n = int(np.count_nonzero(before))
    if n < _FEWEST:
        return None
    time = readings.time_s[before] - np.mean(readings.time_s[before])
    y = readings.temperature_degC[before]
    squares = float(time @ time)
    slope = float(time @ y) / squares
    left = y - np.mean(y) - slope * time
    rounding = (sensor_step(readings.temperature_degC) or 0.0) / np.sqrt(12.0)
    scatter = max(float(np.sqrt(left @ left / (n - 2))), rounding)
    return _Slope(slope, scatter / np.sqrt(squares), scatter, float(np.ptp(time)))
