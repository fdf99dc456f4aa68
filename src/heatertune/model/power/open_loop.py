"""Fit of a log with recorded power: exact simulation, held power, exact fractional dead time.

For given lags and dead time the temperature is linear in gain, ambient, drift, initial state and load steps (variable
projection; G. H. Golub and V. Pereyra, SIAM J. Numer. Anal. 10 (1973) 413–432), so only lags and dead time are
searched. The heater is not assumed to start in steady state, which would inflate the gain.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.compiled import compile_function
from heatertune.log.log_values import ABSOLUTE_ZERO_DEGC
from heatertune.model.model_values import Fopdt, HeaterModel, TwoLag
from heatertune.model.power.regressors import (
    AMBIENT,
    COLUMNS,
    DRIFT,
    FIRST_STATE,
    GAIN,
    SECOND_STATE,
    HeldPower,
    Readings,
    columns,
    forced_response,
    of_lags,
    of_power,
)

__all__ = [
    "FAR", "FixedUnknowns", "PowerFit", "PowerProblem", "ProjectionInput", "Space", "descend",
    "parameters_on_bounds", "paths", "project", "space", "try_loads",
]


#: log; temperatures, shape (n, m), or (1, m) if they are equal [°C]; given linear unknowns, NaN
#: if free, shape (n, columns) or (1, columns); and the law: see `Record`
ProjectionInput = tuple[HeldPower, Array, Array, tuple[bool, float]]
#: the same of one vector: log; temperatures, shape (m); linear unknowns, shape (columns); and the law: whether the
#: gain is given as gain per time constant, and its sign, see `PowerProblem`: with another sign the sum of squares is
#: infinite
Record = tuple[HeldPower, Array, Array, tuple[bool, float]]
#: basis, first lag and lag ratio of its columns, normal matrix, right side, work array, indices of the free
#: unknowns, and the number 1
Space = tuple[Array, Array, Array, Array, Array, npt.NDArray[np.int64], Array]

#: residuals, those tried and their slopes, shape (5, m); normal matrix, that of a step, −slopes·residuals, the step,
#: where it leads and what is moved for a slope, shape (10, 3); and a linear part
Paths = tuple[Array, Array, Array]

DIFFERENCE = 1e-4  # finite-difference step as a share of the parameter's range
LEAST_DAMPING = 1e-8
REST = 3  # poor steps in a row, then a row rests
ROUNDING = 1e-13  # share of a column's square that rounding may leave of it


def _solve(matrix: Array, right: Array, left: Array, size: int) -> None:
    """Solve a small symmetric system in place by elimination; `left`, of that size, is working space.

    An unknown whose column depends linearly on the previous ones is 0.
    """
    for c in range(size):
        left[c] = ROUNDING * matrix[c, c]
    for c in range(size):
        if not matrix[c, c] > left[c]:
            right[c] = 0.0
            for k in range(size):
                matrix[c, k] = matrix[k, c] = 1.0 if k == c else 0.0
        for r in range(c + 1, size):
            factor = matrix[r, c] / matrix[c, c]
            for k in range(c, size):
                matrix[r, k] -= factor * matrix[c, k]
            right[r] -= factor * right[c]
    for c in range(size - 1, -1, -1):
        for k in range(c + 1, size):
            right[c] -= matrix[c, k] * right[k]
        right[c] /= matrix[c, c]


def _dot(first: Array, second: Array) -> float:
    """Return the sum of products, in eight independent sums of a fixed order."""
    whole = len(first) // 8 * 8
    a = b = c = d = e = f = g = h = 0.0
    for i in range(0, whole, 8):  # a loop: array expressions take seconds to compile
        a += first[i] * second[i]
        b += first[i + 1] * second[i + 1]
        c += first[i + 2] * second[i + 2]
        d += first[i + 3] * second[i + 3]
        e += first[i + 4] * second[i + 4]
        f += first[i + 5] * second[i + 5]
        g += first[i + 6] * second[i + 6]
        h += first[i + 7] * second[i + 7]
    for i in range(whole, len(first)):
        a += first[i] * second[i]
    return ((a + e) + (b + f)) + ((c + g) + (d + h))


def _add(weight: float, column: Array, out: Array) -> None:
    if weight != 0.0:
        for i in range(len(out)):
            out[i] += weight * column[i]


def space(width: int, m: int) -> Space:
    """Allocate the work arrays for so many columns and readings; the compiled code allocates none, for speed."""
    made_of = np.full(2, math.nan)  # of none yet
    normal, right, left, free = np.empty((width, width)), np.empty(width), np.empty(width), np.empty(width, np.int64)
    return np.empty((width, m)), made_of, normal, right, left, free, np.ones(1)


def _residuals(record: Record, z: Array, space: Space, out: Array, linear: Array) -> float:
    """Fill residuals (m,) and linear part (one for each column) of one vector; return the sum of squares.

    Args:
        record: see `Record`.
        z: ln first lag, dead time, lag ratio.
        space: see `space`.
        out: residuals.
        linear: linear part.
    """
    lag = math.exp(z[0])
    lags, basis, made_of = (lag, z[2] * lag), space[0], space[1]
    if made_of[0] != z[0] or made_of[1] != z[2]:
        of_lags(record[0], lags, space[-1], basis)
        made_of[0], made_of[1] = z[0], z[2]
    of_power(record[0], lags, z[1], basis)
    return _left_by(record, lag, space, out, linear)


def _left_by(record: Record, lag: float, space: Space, out: Array, linear: Array) -> float:
    """Compute residuals and weights of the columns in `space`; return the sum of squares. Arguments as above."""
    _, temperatures, fixed, (per_lag, sign) = record
    basis, _, normal, right, left, free, _ = space
    size = 0
    for i in range(len(out)):
        out[i] = -temperatures[i]
    for c in range(len(fixed)):
        if math.isnan(fixed[c]):
            free[size] = c
            size += 1
        else:
            linear[c] = fixed[c] * lag if per_lag and c == GAIN else fixed[c]
            _add(linear[c], basis[c], out)
    for a in range(size):
        right[a] = -_dot(basis[free[a]], out)
        for b in range(a + 1):
            normal[a, b] = normal[b, a] = _dot(basis[free[a]], basis[free[b]])
        normal[a, a] += 1e-12 * (normal[a, a] + 1e-12)  # a column of zeros stays solvable
    _solve(normal, right, left, size)
    for a in range(size):
        linear[free[a]] = right[a]
        _add(right[a], basis[free[a]], out)
    total = _dot(out, out)
    no_model = sign != 0.0 and not sign * linear[GAIN] > 0.0
    return math.inf if no_model or not math.isfinite(total) else total


def project(request: ProjectionInput, vectors: Array, residuals: Array, linear: Array, cost: Array,
            space: Space) -> None:
    """Fill residuals, linear parts and sums of squares of vectors.

    Args:
        request: see `Asked`.
        vectors: ln first lag, dead time, lag ratio, shape (n, 3); quickest with those of the same lags in a row.
        residuals: shape (n, m), or (1, m) if not needed [°C].
        linear: linear parts, shape (n, columns), or (1, columns) if not needed.
        cost: sums of squares, shape (n,) [°C²].
        space: see `space`.
    """
    for i in range(len(vectors)):
        k = min(i, len(residuals) - 1)
        cost[i] = _residuals(_record(request, i), vectors[i], space, residuals[k], linear[k])


def _record(request: ProjectionInput, i: int) -> Record:
    """Return the record requested for a vector."""
    log, records, fixed, law = request
    return log, records[min(i, len(records) - 1)], fixed[min(i, len(fixed) - 1)], law


def try_loads(
    request: ProjectionInput, vector: Array, instants: Array, residuals: Array, linear: Array, space: Space
) -> None:
    """Compute the residuals with the last load step at other instants; all other columns are computed once.

    Args:
        request: see `Asked`, of one record.
        vector: ln first lag, dead time, lag ratio.
        instants: at which the last load begins to act, shape (n,) [s].
        residuals: shape (n, m) [°C]; infinite for an impossible model.
        linear: of the last instant, shape (columns,).
        space: see `space`.
    """
    log, lag, one = request[0], math.exp(vector[0]), space[-1]
    lags, last = (lag, vector[2] * lag), COLUMNS + len(log[5]) - 1
    columns(log, lags, vector[1], one, space[0])
    for i in range(len(instants)):
        forced_response(log[0], log[1], instants[i : i + 1], one, 0.0, lags, 0.0, space[0][last])
        if math.isinf(_left_by(_record(request, 0), lag, space, residuals[i], linear)):
            residuals[i] = math.inf


def paths(width: int, m: int) -> Paths:
    """Allocate the other work arrays of `descend`, for so many columns and readings."""
    return np.empty((5, m)), np.empty((10, 3)), np.empty(width)


def _slopes(
    record: Record, z: Array, bounds: tuple[Array, Array], r: Array, space: Space, moved: Array, work: Paths
) -> None:
    """Fill the residuals' change over the range of each parameter, 0 for one that is held, and the normal equations."""
    (low, high), (lines, small, linear) = bounds, work
    jacobian, normal, downhill, shifted = lines[2:], small[:3], small[6], small[9]
    for k in range(3):
        shifted[k] = z[k]
    for k in (1, 0, 2):  # the dead time first: the columns are of these lags
        jacobian[k] = 0.0
        if high[k] > low[k]:
            change = DIFFERENCE * (high[k] - low[k])
            shifted[k] = z[k] + change if z[k] + change <= high[k] else z[k] - change
            if math.isfinite(_residuals(record, shifted, space, moved, linear)):
                share = (high[k] - low[k]) / (shifted[k] - z[k])
                for i in range(len(r)):
                    jacobian[k, i] = (moved[i] - r[i]) * share
            shifted[k] = z[k]
    for a in range(3):
        downhill[a] = -_dot(jacobian[a], r)
        for b in range(a + 1):
            normal[a, b] = normal[b, a] = _dot(jacobian[a], jacobian[b])


def _stepped(z: Array, bounds: tuple[Array, Array], damping: float, small: Array, left: Array) -> float:
    """Write z after the damped Gauss–Newton step, projected onto the bounds, into its row of `small`.

    Return how far the sum of squares would fall at most if the residuals were linear.
    """
    low, high = bounds
    normal, matrix, downhill, step, trial = small[:3], small[3:6], small[6], small[7], small[8]
    most = max(normal[0, 0], normal[1, 1], normal[2, 2])
    for a in range(3):
        step[a] = downhill[a]
        for b in range(3):
            matrix[a, b] = normal[a, b]
        matrix[a, a] += damping * max(normal[a, a], 1e-9 * most + 1e-12)
    for a in range(3):
        outward = (z[a] <= low[a] and step[a] < 0.0) or (z[a] >= high[a] and step[a] > 0.0)
        if outward or high[a] == low[a]:
            step[a] = 0.0
            for b in range(3):
                matrix[a, b] = matrix[b, a] = 1.0 if a == b else 0.0
    _solve(matrix, step, left, 3)
    fall = 0.0
    for a in range(3):
        fall += 2.0 * step[a] * downhill[a]
        trial[a] = z[a] + step[a] * (high[a] - low[a])
    _keep_inside(trial, bounds)
    return fall


def _keep_inside(z: Array, bounds: tuple[Array, Array]) -> None:
    """Clip a vector to the bounds; a parameter with equal bounds is unchanged."""
    low, high = bounds
    for k in range(3):
        if high[k] > low[k]:
            z[k] = min(max(z[k], low[k]), high[k])


def descend(
    request: ProjectionInput, vectors: Array, bounds: tuple[Array, Array], iterations: int, tolerance: float,
    space: Space,
    work: Paths,
) -> None:
    """Move each vector (n, 3) to its local minimum.

    The step is Levenberg's and Marquardt's, as in `least_squares.minimise`. A parameter whose bounds are equal keeps
    its start. A row has converged if even the full Gauss–Newton step predicts a decrease below `tolerance`, or the one
    that is left after others gained nothing; or after three steps that gain no more.

    Args:
        request: see `Asked`.
        vectors: starts, shape (n, 3), moved in place.
        bounds: lower and upper bounds of a vector, each of shape (3,).
        iterations: most steps tried.
        tolerance: relative decrease of the sum of squares that counts as zero.
        space: see `space`.
        work: see `paths`.
    """
    lines, small, linear = work
    r, tried, trial = lines[0], lines[1], small[8]
    for row in range(len(vectors)):
        z, record = vectors[row], _record(request, row)
        _keep_inside(z, bounds)
        cost = _residuals(record, z, space, r, linear)
        damping, resting, better = 1e-2, 0, True
        for _ in range(iterations if math.isfinite(cost) else 0):
            if better:
                _slopes(record, z, bounds, r, space, tried, work)
            promised = _stepped(z, bounds, LEAST_DAMPING if better else damping, small, space[4])
            if promised <= tolerance * cost:
                break
            if better:
                _stepped(z, bounds, damping, small, space[4])
            trial_cost = _residuals(record, trial, space, tried, linear)
            better = trial_cost < cost
            if not better or cost - trial_cost <= tolerance * cost:
                resting += 1 if better or damping > 1e3 else 0
            else:
                resting = 0
            damping = max(damping / 3.0, LEAST_DAMPING) if better else min(damping * 4.0, 1e8)
            if better:
                for k in range(3):
                    z[k] = trial[k]
                r, tried, cost = tried, r, trial_cost
            if resting == REST:
                break


_SECOND = 2  # place of the lag ratio in a vector
_RATIO = (0.01, 0.98)  # from 0.98 on, answers differ from those of equal lags by less than a ten-thousandth
_COARSE = 250  # readings that locate the region of the best fit
_ROUGH, _ROUGH_READINGS = 3, 120  # every third of the grid
#: lengths of the log: a longer time constant shows no curvature
FAR = 5.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FixedUnknowns:
    """Linear unknowns that are given, row by row.

    Attributes:
        values: nan where free, shape (n, columns).
        gain_per_lag: whether the gain is given as gain per time constant [°C/(s·%)].
    """

    values: Array
    gain_per_lag: bool = False


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PowerFit:
    """The best model of one order.

    Attributes:
        model: the heater; None if the gain or the dead time is negative.
        vector: ln first lag, dead time, lag ratio (0: one lag).
        linear: gain, ambient, drift [°C/s], initial states, load steps, states at the restarts [°C].
        simulated_degC: shape (n,).
        unknowns: number of fitted numbers.
        on_bound: names of the unknowns that ended on a bound.
    """

    model: HeaterModel | None
    vector: Array
    linear: Array
    simulated_degC: Array
    unknowns: int
    on_bound: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PowerProblem:
    """Lags and dead time of a log with power, as a bounded least-squares problem.

    Shapes of the arrays: a vector (3,), see `PowerFit`, vectors and starts (n, 3); a record of readings (m,) [°C],
    records (n, m); the linear unknowns (columns,), see `PowerFit.linear`.

    Attributes:
        readings: of the log.
        two_lags: whether a second lag is fitted.
        ambient_degC: known ambient, None if free.
        power_before_pct: power before the first reading, None: the same as at the first reading.
        at_rest: whether the temperature was in steady state with that power.
        drift: whether the ambient may drift by a constant rate.
        loads_s: instants at which an unknown permanent load begins to act.
        sign: of the gain: 1 a heater, -1 the opposite, 0 either.
        least_dead_time_s: lower bound of the dead time; below 0 the temperature precedes the power.
        most_dead_time_s: upper bound of the dead time that the user knows, None: a quarter of the log.
    """

    readings: Readings
    two_lags: bool = False
    ambient_degC: float | None = None
    power_before_pct: float | None = None
    at_rest: bool = False
    drift: bool = False
    loads_s: tuple[float, ...] = ()
    sign: float = 1.0
    least_dead_time_s: float = 0.0
    most_dead_time_s: float | None = None
    low: Array = field(init=False)
    high: Array = field(init=False)

    def __post_init__(self) -> None:
        sample, length = _sample_and_length(self.readings)
        ratio = _RATIO if self.two_lags else (0.0, 0.0)
        longest = min(length / 4.0, math.inf if self.most_dead_time_s is None else self.most_dead_time_s)
        object.__setattr__(self, "low", np.array([math.log(0.5 * sample), self.least_dead_time_s, ratio[0]]))
        object.__setattr__(self, "high", np.array([math.log(FAR * length), longest, ratio[1]]))

    @property
    def fixed(self) -> Array:
        """The linear unknowns that are given, nan where they are free, shape (q,)."""
        fixed = np.full(self._width, math.nan)
        if self.ambient_degC is not None:
            fixed[AMBIENT] = self.ambient_degC
        if not self.drift:
            fixed[DRIFT] = 0.0
        if self.at_rest:
            fixed[FIRST_STATE] = 0.0
        if self.at_rest or not self.two_lags:
            fixed[SECOND_STATE] = 0.0
        if not self.two_lags:
            fixed[COLUMNS + len(self.loads_s) + 1 :: 2] = 0.0
        return fixed

    @property
    def _width(self) -> int:
        """How many columns the linear part has."""
        return COLUMNS + len(self.loads_s) + 2 * len(self.readings.restart_s)

    def squares(self, fit: PowerFit) -> float:
        """Return the sum of the squared residuals of a fit [°C²]."""
        return float(np.sum((self.readings.temperature_degC - fit.simulated_degC) ** 2))

    def solve(self, z: Array, records: Array, fixed: FixedUnknowns | None = None) -> tuple[Array, Array]:
        """Return residuals (n, m) and linear parts (n, columns) for vectors (n, 3) and one record each.

        The residuals are infinite if the gain has the wrong sign: that is no model.
        """
        terms = self.nothing_more(len(z)) if fixed is None else fixed
        residuals, linear, cost = np.empty((len(z), records.shape[1])), np.zeros(terms.values.shape), np.empty(len(z))
        compile_function(project)(self._inputs(records, terms), z, residuals, linear, cost, self._space)
        residuals[np.isinf(cost)] = np.inf
        return residuals, linear

    def with_last_load(self, vector: Array, instants: Array) -> Array:
        """Return the residuals, shape (n, m), with the last load step at other instants (n,) [s]."""
        record = self.readings.temperature_degC[None, :]
        residuals = np.empty((len(instants), record.shape[1]))
        compile_function(try_loads)(self._inputs(record, self.nothing_more(1)), _writable(vector), _writable(instants),
                            residuals, np.empty(self._width), self._space)
        return residuals

    def cost(self, z: Array, records: Array, fixed: FixedUnknowns | None = None) -> Array:
        """Return the sums of squares (n,), infinite for what is no model.

        Arguments as `solve`, but one record, shape (1, m), and one row of what is fixed may serve all vectors, which
        are quickest with those of the same lags in a row.
        """
        terms = self.nothing_more(1) if fixed is None else fixed
        cost, residuals, linear = np.empty(len(z)), np.empty((1, records.shape[1])), np.zeros((1, self._width))
        compile_function(project)(self._inputs(records, terms), z, residuals, linear, cost, self._space)
        return cost

    def nothing_more(self, rows: int) -> FixedUnknowns:
        """Return the known linear unknowns of the problem, for so many rows."""
        return FixedUnknowns(values=np.tile(self.fixed, (rows, 1)))

    def _inputs(self, records: Array, fixed: FixedUnknowns) -> ProjectionInput:
        """Return log, records, known and law as the compiled code takes them."""
        return self._log, _writable(records), fixed.values, (fixed.gain_per_lag, self.sign)

    @property
    def _space(self) -> Space:
        return space(self._width, len(self.readings.time_s))

    @property
    def _log(self) -> HeldPower:
        return *_arrays(self.readings), self.power_before, np.array(self.loads_s), _writable(self.readings.restart_s)

    def basis(self, z: Array) -> Array:
        """Return the columns whose sum, weighted by the linear part, is the temperature, shape (columns, m)."""
        basis = np.empty((self._width, len(self.readings.time_s)))
        lag = math.exp(z[0])
        compile_function(columns)(self._log, (lag, lag * z[2]), z[1], np.ones(1), basis)
        return basis

    def minimum(
        self, starts: Array, records: Array, fixed: FixedUnknowns | None = None, *, fixed_index: int | None = None,
        iterations: int = 15, tolerance: float = 1e-6,
    ) -> Array:
        """Return the vector that each start leads to for its record, shape (n, 3).

        Args:
            starts: shape (n, 3).
            records: shape (n, m), or (1, m) where they are one and the same.
            fixed: by default what the problem knows; one row or n.
            fixed_index: place in the vector that keeps its start.
            iterations: most steps tried.
            tolerance: relative decrease of the sum of squares below which a row rests.
        """
        stays = np.arange(len(self.high)) == (-1 if fixed_index is None else fixed_index)
        high = np.where(stays, self.low, self.high)
        terms = self.nothing_more(1) if fixed is None else fixed
        z = starts.copy()
        work = paths(self._width, len(self.readings.time_s))
        compile_function(descend)(self._inputs(records, terms), z, (self.low, high), iterations, tolerance, self._space,
                                  work)
        return z

    def fit(self) -> PowerFit:
        """Return the best fit from a grid of starts over lags and dead time."""
        coarse = self.average(_COARSE)
        grid = self._grid()
        record = coarse.readings.temperature_degC[None, :]
        starts = coarse.minimum(_best(grid, coarse.cost(grid, record), 8), record, iterations=30)
        return self.refine(_best(starts, coarse.cost(starts, record), 3))

    def roughly(self) -> tuple[float, Array]:
        """Return the least sum of squares on a grid over lags and dead time, by a few readings, and its place (3,)."""
        coarse = self.average(_ROUGH_READINGS)
        grid = self._grid()[::_ROUGH].copy()  # rows side by side: of others `project` would be compiled once more
        cost = coarse.cost(grid, coarse.readings.temperature_degC[None, :])
        place = int(np.argmin(cost))
        return float(cost[place]) / len(coarse.readings.time_s), grid[place]

    def refine(self, starts: Array) -> PowerFit:
        """Return the best fit that the starts (n, 3) lead to."""
        records = self.readings.temperature_degC[None, :]
        z = self.minimum(starts, records, iterations=60, tolerance=1e-9)
        return self.at(_best(z, self.cost(z, records), 1)[0])

    def refine_at_gain(self, vector: Array, gain: float) -> PowerFit:
        """Return the best fit of a given gain [°C/%] that lags and dead time (3,) lead to."""
        fixed, records = self.nothing_more(1), self.readings.temperature_degC[None, :]
        fixed.values[0, GAIN] = gain
        return self.at(self.minimum(vector[None, :], records, fixed, iterations=60, tolerance=1e-9)[0], fixed)

    def far(self) -> PowerFit:
        """Return the best fit whose time constant is the longest searched: the heater as an integrator."""
        starts = np.column_stack([np.full(9, self.high[0]), np.linspace(self.low[1], self.high[1], 9), np.zeros(9)])
        records = self.readings.temperature_degC[None, :]
        z = self.minimum(starts, records, fixed_index=0, iterations=30)
        return self.at(z[np.argmin(self.cost(z, records))])

    def fit_at_gain(self, vector: Array, gain: float) -> PowerFit:
        """Return the fit with lags and dead time (3,) and gain [°C/%] given, whatever this log's own bounds."""
        fixed = self.nothing_more(1)
        fixed.values[0, GAIN] = gain
        return self.at(vector, fixed)

    def average(self, most: int) -> PowerProblem:
        """Return the problem with its readings averaged to about `most`."""
        return replace(self, readings=self.readings.average(most))

    @property
    def power_before(self) -> float:
        """Power before the first reading [%]."""
        first = float(self.readings.level_pct[0])
        return first if self.power_before_pct is None else self.power_before_pct

    def _grid(self) -> Array:
        lags = np.linspace(self.low[0], self.high[0], 25)
        dead = self.low[1] + np.linspace(0.0, 1.0, 17) ** 2 * (self.high[1] - self.low[1])
        ratios = np.array([0.05, 0.2, 0.5, 0.9]) if self.two_lags else np.zeros(1)
        # those of the same lags in a row: their columns are made once
        lag, ratio, late = np.meshgrid(lags, ratios, dead, indexing="ij")
        return np.column_stack([lag.ravel(), late.ravel(), ratio.ravel()])

    def at(self, z: Array, fixed: FixedUnknowns | None = None) -> PowerFit:
        """Return the fit with lags and dead time (3,) given, and of the linear unknowns what is known (one row)."""
        record = self.readings.temperature_degC
        residuals, linear = self.solve(z[None, :], record[None, :], fixed)
        return PowerFit(
            model=_plant(z, linear[0], two_lags=self.two_lags), vector=z, linear=linear[0],
            simulated_degC=record + residuals[0],
            # lag and dead time, what is solved inside, and an instant for each load
            unknowns=2 + self.two_lags + int(np.isnan(self.fixed).sum()) + len(self.loads_s),
            on_bound=parameters_on_bounds(z, self.low, self.high),
        )


def parameters_on_bounds(vector: Array, low: Array, high: Array) -> tuple[str, ...]:
    """Return the names of the parameters on a bound of the search: first lag, dead time, second lag.

    A second lag as long as the first does not count: equal lags are possible. Vector and bounds are of shape (3,).
    """
    margin = 1e-3 * (high - low)
    above = (vector >= high - margin) & (np.arange(len(vector)) != _SECOND)
    touched = (high > low) & ((vector <= low + margin) | above)
    names = ("time_constant_s", "dead_time_s", "second_time_constant_s")
    return tuple(name for name, touches in zip(names, touched, strict=True) if touches)


def _best(vectors: Array, cost: Array, count: int) -> Array:
    """Return so many vectors of least cost, best first; of those alike but for rounding, that of the least dead time.

    Where the power does not move within the readings, every dead time explains them as well.
    """
    return vectors[np.lexsort((vectors[:, 1], cost.astype(np.float32)))[:count]]


@lru_cache(maxsize=8)
def _sample_and_length(readings: Readings) -> tuple[float, float]:
    """Return sampling interval and length of the log [s]; cached, because a search for loads needs them often."""
    time = readings.time_s
    return float(np.median(np.diff(time))) / readings.averaged, float(np.ptp(time))


@lru_cache(maxsize=8)
def _arrays(readings: Readings) -> tuple[Array, Array, Array, Array]:
    """Return times, half widths, edges and levels as the compiled code takes them; kept as above."""
    return (
        _writable(readings.time_s), _writable(readings.half_s), _writable(readings.edge_s),
        _writable(readings.level_pct),
    )


def _writable(array: Array) -> Array:
    """Return a writable array, because a read-only one is a different type for the compiler."""
    return np.require(array, requirements=["C", "W"])


def _plant(z: Array, linear: Array, *, two_lags: bool) -> HeaterModel | None:
    gain, lag, dead = float(linear[GAIN]), float(np.exp(z[0])), float(z[1])
    if gain <= 0.0 or dead < 0.0:
        return None
    # without visible curvature, the ambient may diverge below absolute zero
    ambient = float(linear[AMBIENT]) if linear[AMBIENT] >= ABSOLUTE_ZERO_DEGC else None
    if not two_lags:
        return Fopdt(gain_degC_per_pct=gain, time_constant_s=lag, dead_time_s=dead, ambient_degC=ambient)
    return TwoLag(
        gain_degC_per_pct=gain, time_constant_s=lag, second_time_constant_s=lag * float(z[2]), dead_time_s=dead,
        ambient_degC=ambient,
    )
