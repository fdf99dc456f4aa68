"""What a running loop's log has to say of its heater: power that was given, and readings, both at few rows."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.signal import lfilter

from heatertune.log.values import Log

__all__ = ["PowerCourse", "power_course", "risen"]

Array = npt.NDArray[np.float64]

_ROWS: Final = 3000  # of the power's course
_READINGS: Final = 400  # averages that are explained


@dataclass(slots=True)
class PowerCourse:
    """What is to be explained.

    Attributes:
        time: of the rows, from 0 on [s], shape (n,); equally spaced.
        power: held from each row to the next [%], shape (n,).
        before: power before the first row [%].
        readings: averages of so many rows each [°C], shape (m,).
        middle: of the rows of each [s], shape (m,).
        rest: whether the temperature had come to rest with that power.
    """

    time: Array
    power: Array
    before: float
    readings: Array
    middle: Array
    rest: bool = False

    @property
    def step(self) -> float:
        """Time between two rows [s]."""
        return float(self.time[1])

    @property
    def length(self) -> float:
        """Time of the last row [s]."""
        return float(self.time[-1])

    def mean(self, rows: Array) -> Array:
        """Return averages of (n,) or (n, p), shape (m,) or (m, p)."""
        m = len(self.readings)
        each = len(self.time) // m
        return np.asarray(rows[:m * each].reshape(m, each, *rows.shape[1:]).mean(axis=1))

    def answer(self, lag: float, ratio: float, delay: float) -> Array:
        """Return the power behind its lags and dead time [%], shape (m,)."""
        keep = math.exp(-self.step / lag)
        moved = lfilter([0.0, 1.0 - keep], [1.0, -keep], self.power - self.before)
        if ratio > 0.0:
            keep = math.exp(-self.step / (ratio * lag))
            moved = lfilter([1.0 - keep], [1.0, -keep], moved)
        return self.mean(np.interp(self.time - delay, self.time, moved, left=0.0))

    def basis(self, lag: float, ratio: float, delay: float, loads: Sequence[float] | Array) -> Array:
        """Return the columns of power, ambient, state at the start and loads, shape (m, …)."""
        lags = [] if self.rest else [lag, ratio * lag] if ratio > 0.0 else [lag]
        decays = [np.exp(-self.middle / each) for each in lags]
        return np.column_stack([
            self.answer(lag, ratio, delay), np.ones(len(self.readings)), *decays,
            risen(self.middle, np.asarray(loads), lag, ratio)])


def risen(time: Array, instants: Array, lag: float, ratio: float) -> Array:
    """Return unit steps at the instants (p,) behind the lags, shape (n, p)."""
    since = np.maximum(time[:, None] - instants[None, :], 0.0)
    if ratio <= 0.0:
        return np.asarray(1.0 - np.exp(-since / lag))
    return np.asarray(1.0 - (np.exp(-since / lag) - ratio * np.exp(-since / (ratio * lag))) / (1.0 - ratio))


def power_course(log: Log, before: float, pwm_period_s: float | None, *, rest: bool) -> PowerCourse:
    """Return the course of a log.

    Args:
        log: with power.
        before: power before it [%].
        pwm_period_s: of its switch; None: not known.
        rest: whether the temperature had come to rest with that power.
    """
    assert log.power_pct is not None
    since = log.time_s - log.time_s[0]
    step = max(float(np.median(np.diff(since))), float(since[-1]) / _ROWS)
    time = step * np.arange(int(since[-1] / step + 1e-9) + 1, dtype=np.float64)
    held = np.concatenate([[0.0], np.cumsum(log.power_pct[:-1] * np.diff(since))])
    energy = np.interp(np.append(time, time[-1] + step), since, held)
    power = np.append(np.diff(energy)[:-1] / step, log.power_pct[-1])
    # averages over less than a PWM period would not be independent
    each = max(1, len(time) // _READINGS, math.ceil((pwm_period_s or 0.0) / step - 1e-9))
    course = PowerCourse(time, power, before, np.zeros(len(time) // each), np.zeros(0), rest)
    course.middle, course.readings = course.mean(time), course.mean(np.interp(time, since, log.temperature_degC))
    return course


