"""The linear unknowns of a fit solved inside (variable projection), lags and dead time searched.

G. H. Golub and V. Pereyra, SIAM J. Numer. Anal. 10 (1973) 413–432: for given lags and dead time the temperature is
linear in everything else, so only lags and dead time are searched.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from heatertune.model.power.regressors import COLUMNS, GAIN, HeldPower, columns, forced_response, of_lags, of_power

__all__ = ["ProjectionInput", "Space", "descend", "paths", "project", "space", "try_loads"]

Array = npt.NDArray[np.float64]
#: log; temperatures, shape (n, m), or (1, m) where they are one and the same [°C]; linear unknowns that are given, nan
#: where free, shape (n, columns) or (1, columns); and the law: see `Record`
ProjectionInput = tuple[HeldPower, Array, Array, tuple[bool, float]]
#: the same of one vector: log; temperatures, shape (m,); linear unknowns, shape (columns,); and the law: whether the
#: gain is given as gain per time constant, and its sign, see `PowerProblem`: with another sign the sum of squares is
#: infinite
Record = tuple[HeldPower, Array, Array, tuple[bool, float]]
#: basis, first lag and lag ratio of its columns, normal matrix, right side, what elimination needs, places of the free
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

    An unknown whose column the ones before it make up, but for rounding, is 0: they explain as much without it.
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
    """Return the sum of products: by eight sums, so that none waits for the one before, of an order that stays."""
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
    """Return working space for so many columns and readings: what is compiled makes no arrays, and is quick for it."""
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
    """Fill what the columns in `space` leave, and their weights; return the sum of squares. Arguments as above."""
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
        residuals: shape (n, m), or (1, m) where nobody asks for them [°C].
        linear: linear parts, shape (n, columns) or (1, columns) likewise.
        cost: sums of squares, shape (n,) [°C²].
        space: see `space`.
    """
    for i in range(len(vectors)):
        k = min(i, len(residuals) - 1)
        cost[i] = _residuals(_record(request, i), vectors[i], space, residuals[k], linear[k])


def _record(request: ProjectionInput, i: int) -> Record:
    """Return what is asked of a vector."""
    log, records, fixed, law = request
    return log, records[min(i, len(records) - 1)], fixed[min(i, len(fixed) - 1)], law


def try_loads(
    request: ProjectionInput, vector: Array, instants: Array, residuals: Array, linear: Array, space: Space
) -> None:
    """Fill the residuals with the last load step at other instants; all other columns are made once.

    Args:
        request: see `Asked`, of one record.
        vector: ln first lag, dead time, lag ratio.
        instants: at which the last load begins to act, shape (n,) [s].
        residuals: shape (n, m) [°C]; infinite for what is no model.
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
    """Return what `descend` needs beside `space`, for so many columns and readings."""
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
    """Put a vector onto the bounds; a parameter whose bounds are equal is held where it is."""
    low, high = bounds
    for k in range(3):
        if high[k] > low[k]:
            z[k] = min(max(z[k], low[k]), high[k])


def descend(
    request: ProjectionInput, vectors: Array, bounds: tuple[Array, Array], iterations: int, tolerance: float,
    space: Space,
    work: Paths,
) -> None:
    """Move each vector (n, 3) to the local minimum that it leads to.

    The step is Levenberg's and Marquardt's, as in `least_squares.minimise`. A parameter whose bounds are equal keeps
    its start. A row rests where not even the whole Gauss–Newton step promises to gain more than `tolerance`, or the one
    that is left after others gained nothing; or after three steps that gain no more.

    Args:
        request: see `Asked`.
        vectors: starts, shape (n, 3), moved in place.
        bounds: lower and upper bounds of a vector, each of shape (3,).
        iterations: most steps tried.
        tolerance: relative decrease of the sum of squares that counts as none.
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
