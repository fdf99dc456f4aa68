"""Compiled: the answer to held power, and the linear unknowns solved inside (variable projection).

G. H. Golub and V. Pereyra, SIAM J. Numer. Anal. 10 (1973) 413–432: for given lags and dead time the temperature is
linear in everything else, so only lags and dead time are searched.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

__all__ = ["AMBIENT", "COLUMNS", "DRIFT", "FIRST_STATE", "GAIN", "SECOND_STATE", "columns", "project"]

#: columns of the linear part; one more for each load step
GAIN, AMBIENT, DRIFT, FIRST_STATE, SECOND_STATE, COLUMNS = 0, 1, 2, 3, 4, 5


@njit(cache=True, nogil=True)
def _advance(state, edges, levels, dead, first, second, target):  # type: ignore[no-untyped-def]
    """Move state = now, first and second lag's output, acting power, next edge, to the instant; return ∫power."""
    area = 0.0
    while True:
        j = int(state[4])
        edge = edges[j] + dead if j < len(edges) else math.inf
        t = min(target, edge) - state[0]
        if t > 0.0:
            acting = state[3]
            decay = math.exp(-t / first)
            if second > 0.0:
                other = math.exp(-t / second)
                coupling = first / (first - second) * (decay - other)
                state[2] = acting + other * (state[2] - acting) + coupling * (state[1] - acting)
            state[1] = acting + decay * (state[1] - acting)
            state[0] += t
            area += acting * t
        if edge > target:
            return area
        state[3] = levels[j]
        state[4] += 1.0


@njit(cache=True, nogil=True)
def _forced(time, half, edges, levels, before, first, second, dead, out):  # type: ignore[no-untyped-def]
    """Write the answer of a unit gain to the held power into out (n,); second = 0: one lag.

    A reading is the mean over its time ± half. The mean is exact: a lag's own equation gives the integral of what
    leaves it, ∫out = ∫in − lag·(out at the end − out at the start). The answer starts as if `before` had
    been the power for ever; the free initial state corrects it.
    """
    state = np.array([time[0] - half[0], before, before, before, 0.0])
    last = 2 if second > 0.0 else 1
    for i in range(len(time)):
        _advance(state, edges, levels, dead, first, second, time[i] - half[i])
        out[i] = state[last]
        if half[i] > 0.0:
            begun, x, y = state[0], state[1], state[2]
            area = _advance(state, edges, levels, dead, first, second, time[i] + half[i])
            area -= first * (state[1] - x) + second * (state[2] - y)
            out[i] = area / (state[0] - begun)


@njit(cache=True, nogil=True)
def _decay(time, half, lag, out):  # type: ignore[no-untyped-def]
    for i in range(len(time)):
        out[i] = math.exp((time[0] - time[i]) / lag)
        share = half[i] / lag
        if share > 1e-4:  # below, the mean over the block is its middle
            out[i] *= math.sinh(share) / share


@njit(cache=True, nogil=True)
def columns(time, half, edges, levels, before, loads, plant, basis):  # type: ignore[no-untyped-def]
    """Fill basis (5 + loads, m) for plant = first lag, second lag (0: one lag), dead time."""
    m = len(time)
    first, second = plant[0], plant[1]
    _forced(time, half, edges, levels, before, first, second, plant[2], basis[GAIN])
    basis[SECOND_STATE] = 0.0
    _decay(time, half, first, basis[FIRST_STATE])
    if second > 0.0:
        _decay(time, half, second, basis[SECOND_STATE])
    for i in range(m):
        basis[AMBIENT, i] = 1.0
        basis[DRIFT, i] = time[i] - time[0]
    one = np.ones(1)
    for k in range(len(loads)):
        _forced(time, half, loads[k : k + 1], one, 0.0, first, second, 0.0, basis[COLUMNS + k])


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
def _add(weight, column, out):  # type: ignore[no-untyped-def]
    if weight != 0.0:
        for i in range(len(out)):
            out[i] += weight * column[i]


@njit(cache=True, nogil=True)
def project(  # type: ignore[no-untyped-def]
    time, half, edges, levels, before, loads, records, known, plants, residuals, linear
):
    """Fill residuals (n, m) and the linear part (n, 5 + loads) for rows of plants and their records.

    `known` (n, 5 + loads) holds the linear unknowns that are given, nan where they are free.
    """
    m, width = len(time), known.shape[1]
    basis = np.empty((width, m))
    normal = np.empty((width, width))
    right = np.empty(width)
    free = np.empty(width, dtype=np.int64)
    for row in range(plants.shape[0]):
        columns(time, half, edges, levels, before, loads, plants[row], basis)
        size = 0
        for i in range(m):
            residuals[row, i] = -records[row, i]
        for c in range(width):
            if math.isnan(known[row, c]):
                free[size] = c
                size += 1
            else:
                linear[row, c] = known[row, c]
                _add(known[row, c], basis[c], residuals[row])
        for a in range(size):
            right[a] = -_dot(basis[free[a]], residuals[row])
            for b in range(a + 1):
                normal[a, b] = normal[b, a] = _dot(basis[free[a]], basis[free[b]])
            normal[a, a] += 1e-12 * (normal[a, a] + 1e-12)  # a column of zeros stays solvable
        _solve(normal, right, size)
        for a in range(size):
            linear[row, free[a]] = right[a]
            _add(right[a], basis[free[a]], residuals[row])
