"""The components of the temperature in a log: response to held power, ambient, drift, free initial states, loads.

Their weighted sum is the temperature; see `projection` for the weights.

Also a log with power in the form of the compiled fit: readings, and the exact instants of the power changes. A long log
is reduced by averaging runs of readings. The model is averaged over the same runs, exactly, and the edges of the power
are not changed, so this costs resolution but causes no bias. Only if a controller changes the power at nearly every
reading is the power averaged too, between its largest changes; its integral is kept.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.heater.exact import Factors, factors
from heatertune.log.log_values import Log

__all__ = [
    "AMBIENT", "COLUMNS", "DRIFT", "FIRST_STATE", "GAIN", "GAP", "SECOND_STATE", "HeldPower", "Readings", "columns",
    "forced_response", "of_lags", "of_power",
]


GAP = 2.5  # sampling intervals: a wider step of the time is a gap, over which nothing is averaged

_EDGES = 4000  # of the power: with more, a fit takes long


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Readings:
    """Readings and power edges.

    Attributes:
        time_s: middle of each reading, shape (n,).
        half_s: half the time over which it was averaged, 0: an instant, shape (n,).
        temperature_degC: shape (n,).
        edge_s: instants at which the power takes a new value, the log's first one included, shape (k,).
        level_pct: that value, shape (k,).
        averaged: largest number of readings of the log in one of these.
        restart_s: instants of the first readings of later segments, whose initial state is unknown, shape (r,).
    """

    time_s: Array
    half_s: Array
    temperature_degC: Array
    edge_s: Array
    level_pct: Array
    averaged: int = 1
    restart_s: Array = field(default_factory=lambda: np.empty(0))

    @classmethod
    def of(cls, log: Log) -> Readings:
        """Return the readings of a log with power, one for one."""
        edge_s, level_pct = log.signals["power"].changes
        return cls(time_s=log.time_s, half_s=np.zeros(len(log.time_s)), temperature_degC=log.temperature_degC,
                   edge_s=edge_s, level_pct=level_pct)

    def average(self, most: int) -> Readings:
        """Return the readings averaged to about `most`: more, where gaps and edges end a run early."""
        time, n = self.time_s, len(self.time_s)
        count = -(-n // most)
        if count == 1:
            return self
        starts = self._runs(count)
        sizes = np.diff(np.append(starts, n))
        ends = starts + sizes - 1
        weight = np.where(self.half_s > 0.0, self.half_s, 0.5 * float(np.median(np.diff(time))))
        total = np.add.reduceat(weight, starts)
        # each reading stands for its interval (midpoint rule), so a run reaches half an interval beyond its ends
        own = np.where(sizes > 1, (time[ends] - time[starts]) / np.maximum(sizes - 1, 1), 2.0 * self.half_s[starts])
        edges, levels = self._merged()
        middle = np.add.reduceat(weight * time, starts) / total
        return replace(
            self, edge_s=edges, level_pct=levels, time_s=middle, half_s=_apart(middle, 0.5 * own * sizes),
            temperature_degC=np.add.reduceat(weight * self.temperature_degC, starts) / total,
            averaged=self.averaged * count,
        )

    def _merged(self) -> tuple[Array, Array]:
        """Return edges and levels; where there are very many edges, only the largest stay exact."""
        if len(self.edge_s) <= _EDGES:
            return self.edge_s, self.level_pct
        hold_s = np.diff(self.edge_s, append=max(self.time_s[-1], self.edge_s[-1]) + 1e-9)
        large = 1 + np.argpartition(np.abs(np.diff(self.level_pct)), -_EDGES // 2)[-_EDGES // 2 :]
        count = -(-2 * len(hold_s) // _EDGES)
        starts = np.union1d(large, np.arange(1, len(hold_s), count))  # the first level is also the one before the log
        mean = np.add.reduceat(hold_s * self.level_pct, starts) / np.add.reduceat(hold_s, starts)
        return self.edge_s[np.append(0, starts)], np.append(self.level_pct[0], mean)

    def _runs(self, count: int) -> npt.NDArray[np.intp]:
        """Return where runs of `count` readings begin; a run ends at a gap, a restart, and at edges if they are few."""
        n, step = len(self.time_s), np.diff(self.time_s)
        breaks = np.concatenate([[True], step > GAP * np.median(step)])
        if len(self.edge_s) * count < n:
            breaks[np.minimum(np.searchsorted(self.time_s, self.edge_s), n - 1)] = True
        breaks[np.searchsorted(self.time_s, self.restart_s)] = True
        run_start = np.maximum.accumulate(np.where(breaks, np.arange(n), 0))
        return np.flatnonzero((np.arange(n) - run_start) % count == 0)


def _apart(middle: Array, half: Array) -> Array:
    """Return half the time of each reading, shorter where it would reach into the one before: none is a mean of both.

    Args:
        middle: of each reading, shape (m,) [s].
        half: half the time that it stands for, shape (m,) [s].
    """
    half = half.copy()
    for i in 1 + np.flatnonzero(np.diff(middle) < half[1:] + half[:-1]):
        half[i] = max(0.0, min(half[i], middle[i] - middle[i - 1] - half[i - 1]))
    return half


#: time: middle of each reading, shape (m) [s]; half: half the time that it is the mean of, shape (m) [s];
#: edges: instants from which a power is held, shape (e) [s]; levels: the powers, shape (e) [%]; before: the power
#: before the first [%]; loads: instants at which they begin to act, shape (s) [s]; restarts: instants at which the
#: state is estimated again, shape (r) [s]
HeldPower = tuple[Array, Array, Array, Array, float, Array, Array]

#: columns of the linear part; one more for each load step, then two states for each restart
GAIN, AMBIENT, DRIFT, FIRST_STATE, SECOND_STATE, COLUMNS = 0, 1, 2, 3, 4, 5

#: half widths of a reading in lags, from which on a free state is gone within it: its mean would overflow
STEEP = 100.0
ALIKE = 1e-10  # share of a step of the time by which another may differ and have its factors


def forced_response(
    time: Array, half: Array, edges: Array, levels: Array, before: float, lags: tuple[float, float], dead: float,
    out: Array,
) -> None:
    """Write the response of a unit gain to the held power into out.

    A reading is the mean over its time ± half. The mean is exact: a lag's own equation gives the integral of what the
    output, ∫out = ∫in − lag·(out at the end − out at the start). The response starts as if `before` had always been the
    power; the free initial state corrects this. `x` and `y` are the deviations of the lags' outputs from the power:
    under constant power one product takes each to the next reading.

    Args:
        time: middle of each reading, shape (n,) [s].
        half: half the averaging time, shape (n,) [s].
        edges: instants of power changes, shape (e,) [s].
        levels: the powers, shape (e,) [%].
        before: the power before the first [%].
        lags: the second is 0 for one lag [s].
        dead: dead time [s].
        out: the response, shape (n,) [%].
    """
    inner, outer = lags if lags[1] > 0.0 else (0.0, lags[0])
    now, acting, x, y, j = time[0] - half[0], before, 0.0, 0.0, 0
    edge = edges[0] + dead if len(edges) else math.inf
    length, f = 0.0, Factors(1.0, 0.0, 1.0)  # of the last step: readings are often evenly spaced
    for i in range(len(time)):
        if half[i] == 0.0 and time[i] < edge and abs(time[i] - now - length) <= ALIKE * length:
            y = f.outer * y if inner == 0.0 else f.outer * y + f.coupling * x
            x *= f.inner
            now = time[i]
            out[i] = acting + y
            continue
        begin, x_begin, y_begin, area = now, 0.0, 0.0, 0.0
        for part in range(2):  # to the begin of the reading, then over it
            target = time[i] + half[i] if part else time[i] - half[i]
            begin, x_begin, y_begin, area = now, acting + x, acting + y, 0.0
            while now < target or edge <= target:
                end = min(target, edge)
                t = end - now
                if t > 0.0:
                    if abs(t - length) > ALIKE * t:
                        length, f = t, factors(t, outer, inner)
                    y = f.outer * y + f.coupling * x
                    x *= f.inner
                    now = end
                    area += acting * t
                if edge <= target:
                    x, y, acting = x + (acting - levels[j]), y + (acting - levels[j]), levels[j]
                    j += 1
                    edge = edges[j] + dead if j < len(edges) else math.inf
        out[i] = acting + y
        if now > begin:  # irregular runs may overlap so far that nothing is left of one
            out[i] = (area - inner * (acting + x - x_begin) - outer * (acting + y - y_begin)) / (now - begin)


def _decay(time: Array, half: Array, begun: float, lag: float, out: Array) -> None:
    step, factor, left, width, mean = 0.0, 1.0, 0.0, 0.0, 1.0
    for i in range(len(time)):
        if time[i] < begun:
            out[i] = 0.0
            continue
        if i == 0 or time[i - 1] < begun:
            left = math.exp((begun - time[i]) / lag)
        else:
            if abs(time[i] - time[i - 1] - step) > ALIKE * step:
                step = time[i] - time[i - 1]
                factor = math.exp(-step / lag)
            left *= factor
        if half[i] != width:
            width, share = half[i], min(half[i] / lag, STEEP)
            mean = math.sinh(share) / share if share > 1e-4 else 1.0  # below, the mean over the block is its middle
        out[i] = left * mean


def _states(time: Array, half: Array, begun: float, first: float, second: float, out: Array) -> None:
    """Write the contribution of free states at an instant into out (2, n); second = 0: one lag."""
    _decay(time, half, begun, first, out[0])
    out[1] = 0.0
    if second > 0.0:
        _decay(time, half, begun, second, out[1])


def columns(log: HeldPower, lags: tuple[float, float], dead: float, unit: Array, basis: Array) -> None:
    """Fill basis for the lags and the dead time.

    Args:
        log: see `Held`.
        lags: the second is 0 for one lag [s].
        dead: dead time [s].
        unit: the number 1, shape (1,): the level of a load.
        basis: the columns, as named above, shape (5 + s + 2·r, m).
    """
    of_lags(log, lags, unit, basis)
    of_power(log, lags, dead, basis)


def of_power(log: HeldPower, lags: tuple[float, float], dead: float, basis: Array) -> None:
    """Fill the answer to the power, which alone knows the dead time; arguments as `columns`, of the same shapes."""
    forced_response(log[0], log[1], log[2], log[3], log[4], lags, dead, basis[GAIN])


def of_lags(log: HeldPower, lags: tuple[float, float], unit: Array, basis: Array) -> None:
    """Fill all other columns; arguments as `columns`, of the same shapes."""
    time, half, _, _, _, loads, restarts = log
    first, second = lags
    m = len(time)
    _states(time, half, time[0], first, second, basis[FIRST_STATE:COLUMNS])
    for i in range(m):
        basis[AMBIENT, i] = 1.0
        basis[DRIFT, i] = time[i] - time[0]
    for k in range(len(loads)):
        forced_response(time, half, loads[k : k + 1], unit, 0.0, lags, 0.0, basis[COLUMNS + k])
    for k in range(len(restarts)):
        place = COLUMNS + len(loads) + 2 * k
        _states(time, half, restarts[k], first, second, basis[place : place + 2])
