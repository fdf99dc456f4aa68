"""Exact response of a heater to steps of its power, and its sensitivity to the parameters.

The heater is in steady state, and the power steps at given instants. The response to each step is the step response of
the lags, delayed by the dead time. Temperature, sensitivities and peaks are therefore closed forms: no grid, no solver.
All functions take many heaters of one order at once, one per row (see `rows_of`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from heatertune.arrays import Array
from heatertune.errors import OutOfRange
from heatertune.heater.exact import apart, since_step, slopes_by_lag, turning_times
from heatertune.model.model_values import HeaterModel
from heatertune.units import check

__all__ = ["Schedule", "peak_rise", "rise", "rows_of", "sensitivities"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Schedule:
    """Powers of an experiment.

    Attributes:
        base_pct: power before the first instant, and steady for long [%].
        time_s: instants at which the power steps, not decreasing, shape (m,) [s].
        power_pct: power from each instant on, shape (m,) [0…100 %].

    Raises:
        OutOfRange: shapes differ, instants that decrease or are negative, a power outside 0…100 %.
    """

    base_pct: float
    time_s: Array
    power_pct: Array

    def __post_init__(self) -> None:
        check("base_pct", self.base_pct, least=0.0, most=100.0)
        for name in ("time_s", "power_pct"):
            array = np.array(getattr(self, name), dtype=np.float64)
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        if self.time_s.shape != self.power_pct.shape or self.time_s.ndim != 1 or not len(self.time_s):
            raise OutOfRange("power_pct", self.power_pct.shape, f"one power for each of {self.time_s.shape} instants")
        if np.any(np.diff(self.time_s) < 0.0):
            raise OutOfRange("time_s", self.time_s.tolist(), "not decreasing")
        check("time_s", float(self.time_s[0]), least=0.0)
        check("time_s", float(self.time_s[-1]), least=0.0)
        for power in (float(self.power_pct.min()), float(self.power_pct.max())):
            check("power_pct", power, least=0.0, most=100.0)

    @property
    def steps_pct(self) -> Array:
        """Change of the power at each instant, shape (m,) [%]."""
        return np.diff(self.power_pct, prepend=self.base_pct)

    def at(self, instants: Array) -> Array:
        """Return the power that holds at the instants, shape (n,) [%]."""
        index = np.searchsorted(self.time_s, instants, side="right")
        return np.asarray(np.concatenate([[self.base_pct], self.power_pct])[index])


def rows_of(models: Sequence[HeaterModel]) -> Array:
    """Return gain, dead time, and each lag of models of one order, shape (g, 2 + lags)."""
    return np.array([[m.gain_degC_per_pct, m.dead_time_s, *m.lags_s] for m in models])


def rise(rows: Array, schedule: Schedule, instants: Array) -> Array:
    """Return the temperature above that of the base power, shape (g, n) [°C], at instants (n,) or (g, n) [s]."""
    unit, _ = since_step(_since(rows, schedule, instants), *_each_lag(rows))
    return np.asarray(rows[:, :1] * (unit @ schedule.steps_pct))


def sensitivities(rows: Array, schedule: Schedule, instants: Array) -> Array:
    """Return the derivatives of the temperature at the instants, shape (g, n, q).

    Columns: gain [°C per °C/%], dead time [°C/s], each lag [°C/s], ambient, then the deviation of each lag's initial
    state from steady state [°C per °C], which a fit has to find too. Equal lags are moved apart, see `exact.apart`,
    because they would be indistinguishable.
    """
    steps = schedule.steps_pct
    if rows.shape[1] == 4:
        rows = np.hstack([rows[:, :2], [apart(*lags) for lags in rows[:, 2:]]])
    unit, slope, by_lag = _unit_steps(rows, _since(rows, schedule, instants))
    gain = rows[:, :1]
    shared = [schedule.base_pct + unit @ steps, -gain * (slope @ steps),
              *(gain * (derivative @ steps) for derivative in by_lag)]
    initial = [np.exp(-instants[None, :] / lag[:, None]) for lag in _lags(rows)]
    return np.stack([*shared, np.ones_like(shared[0]), *initial], axis=2)


def peak_rise(rows: Array, schedule: Schedule) -> Array:
    """Return the highest temperature above that of the base power, the time after the last step included, shape (g,).

    Between two steps the temperature of one lag is monotonic; that of two lags turns at most once.
    """
    steps, time = schedule.steps_pct, schedule.time_s
    lags = _lags(rows)
    since = np.maximum(time[:, None] - time[None, :], 0.0)
    past = np.tril(np.ones_like(since))
    turns = np.zeros((len(rows), len(time)))
    if len(lags) == 2:
        acting = past * steps
        outer, inner = (lag[:, None, None] for lag in lags)
        covered = since_step(since, outer, inner)[0], since_step(since, inner)[0]
        y, x = (np.sum(acting * share, axis=2) for share in covered)
        turns = np.nan_to_num(turning_times(y, x, acting.sum(axis=1), outer[:, 0], inner[:, 0]))
    undelayed = rows.copy()
    undelayed[:, 1] = 0.0  # the dead time moves the peak, not its height
    later = np.append(np.diff(time), np.inf)
    heights = rise(undelayed, schedule, np.hstack([np.tile(time, (len(rows), 1)), time + np.minimum(turns, later)]))
    last = rows[:, 0] * (schedule.power_pct[-1] - schedule.base_pct)
    return np.asarray(np.maximum(heights.max(axis=1), last))


def _since(rows: Array, schedule: Schedule, instants: Array) -> Array:
    """Return how long each step has acted, shape (g, n, m); 0 before it acts [s]."""
    acting = np.atleast_2d(instants)[:, :, None] - schedule.time_s - rows[:, 1][:, None, None]
    return np.asarray(np.maximum(acting, 0.0))


def _lags(rows: Array) -> list[Array]:
    return list(rows[:, 2:].T)


def _each_lag(rows: Array) -> list[Array]:
    """Return the lags so that they broadcast with instants and steps."""
    return [lag[:, None, None] for lag in _lags(rows)]


def _unit_steps(rows: Array, since: Array) -> tuple[Array, Array, list[Array]]:
    """Return the unit step response of the lags, its slope, and its derivative by each lag."""
    lags = _each_lag(rows)
    covered, slope = since_step(since, *lags)
    return covered, (since > 0.0) * slope, [slopes_by_lag(since, *pair) for pair in (lags, lags[::-1])[: len(lags)]]
