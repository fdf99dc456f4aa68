"""Fit of a log whose power was recorded: exact simulation, held power, exact fractional dead time.

For given lags and dead time the temperature is linear in gain, ambient and initial state, so these are solved inside
(variable projection: G. H. Golub and V. Pereyra, SIAM J. Numer. Anal. 10 (1973) 413–432); only lags and dead time
are searched. Nothing is assumed about steadiness at the start: that would inflate the gain.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from numba import njit

from heatertune.log.values import Log
from heatertune.model.least_squares import minimise
from heatertune.model.values import Fopdt, HeaterModel, TwoLag

__all__ = ["PowerFit", "PowerProblem"]

Array = npt.NDArray[np.float64]
Rows = npt.NDArray[np.intp]

_RATIO = (0.01, 0.98)


@njit(cache=True, nogil=True)
def _forced(time, power, before, first, second, dead, out):  # type: ignore[no-untyped-def]
    """Write the answer of a unit gain to the held power into out (n,); second = 0: one lag.

    The answer starts as if `before` had been the power for ever; the free initial state corrects it.
    """
    n = len(time)
    x = y = before
    out[0] = y
    now = time[0]
    acting = before
    j = -1  # index of the power value that acts now
    for i in range(1, n):
        while now < time[i]:
            edge = time[j + 1] + dead if j + 1 < n else math.inf
            until = min(time[i], edge)
            t = until - now
            if t > 0.0:
                decay = math.exp(-t / first)
                if second > 0.0:
                    other = math.exp(-t / second)
                    coupling = first / (first - second) * (decay - other)
                    y = acting + other * (y - acting) + coupling * (x - acting)
                else:
                    y = acting + decay * (y - acting)
                x = acting + decay * (x - acting)
                now = until
            if edge <= now:
                j += 1
                acting = power[j]
        out[i] = y


@njit(cache=True, nogil=True)
def _solve(matrix, right, size):  # type: ignore[no-untyped-def]
    """Solve a small symmetric positive system in place by elimination."""
    for c in range(size):
        for r in range(c + 1, size):
            factor = matrix[r, c] / matrix[c, c]
            for k in range(c, size):
                matrix[r, k] -= factor * matrix[c, k]
            right[r] -= factor * right[c]
    for c in range(size - 1, -1, -1):
        for k in range(c + 1, size):
            right[c] -= matrix[c, k] * right[k]
        right[c] /= matrix[c, c]


@njit(cache=True, nogil=True)
def _dot(first, second):  # type: ignore[no-untyped-def]
    total = 0.0
    for i in range(len(first)):  # a loop: array expressions take seconds to compile
        total += first[i] * second[i]
    return total


@njit(cache=True, nogil=True)
def _decay(time, lag, out):  # type: ignore[no-untyped-def]
    for i in range(len(time)):
        out[i] = math.exp((time[0] - time[i]) / lag)


@njit(cache=True, nogil=True)
def _project(time, power, before, records, ambient, plants, residuals, linear):  # type: ignore[no-untyped-def]
    """Fill residuals (n, m) and the linear part (n, 4): gain, ambient, deviations of the initial state.

    A row of `plants` is (first lag, second lag or 0, dead time); `ambient` is nan where it is free.
    """
    m = len(time)
    basis = np.empty((4, m))
    normal = np.empty((4, 4))
    right = np.empty(4)
    known = 0.0 if math.isnan(ambient) else ambient
    for row in range(plants.shape[0]):
        first, second = plants[row, 0], plants[row, 1]
        size = 4 if second > 0.0 else 3
        _forced(time, power, before, first, second, plants[row, 2], basis[0])
        basis[1] = 1.0 if math.isnan(ambient) else 0.0
        _decay(time, first, basis[2])
        if size == 4:
            _decay(time, second, basis[3])
        for i in range(m):
            residuals[row, i] = known - records[row, i]
        for a in range(size):
            right[a] = -_dot(basis[a], residuals[row])
            for b in range(size):
                normal[a, b] = _dot(basis[a], basis[b])
            normal[a, a] += 1e-12 * (normal[a, a] + 1e-12)  # a column of zeros stays solvable
        _solve(normal, right, size)
        for a in range(size):
            linear[row, a] = right[a]
            for i in range(m):
                residuals[row, i] += right[a] * basis[a, i]
        if not math.isnan(ambient):
            linear[row, 1] = ambient


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PowerFit:
    """The best model of one order.

    Attributes:
        model: the heater.
        vector: ln first lag, dead time, lag ratio (0: one lag).
        simulated_degC: shape (n,).
        unknowns: number of fitted numbers.
        on_bound: names of the unknowns that ended on a bound.
    """

    model: HeaterModel
    vector: Array
    simulated_degC: Array
    unknowns: int
    on_bound: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PowerProblem:
    """Lags and dead time of a log with power, as a bounded least-squares problem.

    Attributes:
        log: with `power_pct`.
        two_lags: whether a second lag is fitted.
        ambient_degC: known ambient, None where free.
        power_before_pct: power before the first reading, None: the same as at the first reading.
    """

    log: Log
    two_lags: bool
    ambient_degC: float | None = None
    power_before_pct: float | None = None
    low: Array = field(init=False)
    high: Array = field(init=False)

    def __post_init__(self) -> None:
        sample = float(np.median(np.diff(self.log.time_s)))
        length = float(np.ptp(self.log.time_s))
        ratio = _RATIO if self.two_lags else (0.0, 0.0)
        object.__setattr__(self, "low", np.array([math.log(0.5 * sample), 0.0, ratio[0]]))
        object.__setattr__(self, "high", np.array([math.log(5.0 * length), length / 4.0, ratio[1]]))

    def solve(self, z: Array, records: Array) -> tuple[Array, Array]:
        """Return residuals (n, m) and linear parts (n, 4) for vectors (n, 3) and one record each."""
        first = np.exp(z[:, 0])
        plants = np.column_stack([first, first * z[:, 2], z[:, 1]])
        ambient = math.nan if self.ambient_degC is None else self.ambient_degC
        power = self.log.power_pct
        assert power is not None
        before = float(power[0]) if self.power_before_pct is None else self.power_before_pct
        residuals, linear = np.empty(records.shape), np.zeros((len(z), 4))
        _project(self.log.time_s, power, before, records, ambient, plants, residuals, linear)
        # a heater warms: solutions with a negative gain are no models
        residuals = np.where((linear[:, 0] > 0.0)[:, None], residuals, np.inf)
        return residuals, linear

    def fit(self) -> PowerFit:
        """Return the best fit from a grid of starts over lags and dead time."""
        record = self.log.temperature_degC
        grid = self._grid()
        cost = [np.sum(self.solve(z[None, :], record[None, :])[0] ** 2) for z in grid]  # one by one: long logs fit too
        starts = grid[np.argsort(cost)[:8]]

        def against(z: Array, rows: Rows) -> Array:
            return self.solve(z, np.tile(record, (len(rows), 1)))[0]

        minima = minimise(against, starts, self.low, self.high, iterations=80, tolerance=1e-9)
        return self._result(minima.parameters[np.argmin(minima.cost)])

    def refit(self, z: Array, records: Array) -> Array:
        """Return gain, first lag, second lag, dead time, ambient for each record, shape (n, 5), from a known fit."""

        def against(vectors: Array, rows: Rows) -> Array:
            return self.solve(vectors, records[rows])[0]

        starts = np.repeat(z[None, :], len(records), axis=0)
        minima = minimise(against, starts, self.low, self.high, iterations=15)
        _, linear = self.solve(minima.parameters, records)
        first = np.exp(minima.parameters[:, 0])
        return np.column_stack(
            [linear[:, 0], first, first * minima.parameters[:, 2], minima.parameters[:, 1], linear[:, 1]]
        )

    def _grid(self) -> Array:
        lags = np.linspace(self.low[0], self.high[0], 25)
        dead = np.linspace(0.0, 1.0, 17) ** 2 * self.high[1]
        ratios = np.array([0.05, 0.2, 0.5, 0.9]) if self.two_lags else np.zeros(1)
        return np.array(np.meshgrid(lags, dead, ratios)).reshape(3, -1).T.copy()

    def _result(self, z: Array) -> PowerFit:
        record = self.log.temperature_degC
        residuals, linear = self.solve(z[None, :], record[None, :])
        gain, ambient = float(linear[0, 0]), float(linear[0, 1])
        lag, dead = float(np.exp(z[0])), float(z[1])
        margin = 1e-3 * (self.high - self.low)
        touching = (self.high > self.low) & ((z <= self.low + margin) | (z >= self.high - margin))
        names = ("time_constant_s", "dead_time_s", "second_time_constant_s")
        model: HeaterModel = Fopdt(
            gain_degC_per_pct=gain, time_constant_s=lag, dead_time_s=dead, ambient_degC=ambient
        )
        if self.two_lags:
            model = TwoLag(
                gain_degC_per_pct=gain, time_constant_s=lag, second_time_constant_s=lag * float(z[2]),
                dead_time_s=dead, ambient_degC=ambient,
            )
        return PowerFit(
            model=model, vector=z, simulated_degC=record + residuals[0],
            unknowns=5 + 2 * self.two_lags - (self.ambient_degC is not None),
            on_bound=tuple(n for n, t in zip(names, touching, strict=True) if t),
        )
