"""Many bounded least-squares problems at once.

Multi-start and bootstrap solve the same small problem some hundred times; solving all rows together keeps the
compiled simulation busy. The step is that of Levenberg and Marquardt (D. W. Marquardt, "An algorithm for least-squares
estimation of nonlinear parameters", SIAM J. Appl. Math. 11 (1963) 431–441), projected onto the bounds.

Saturated power gives the sum of squares kinks with many local minima, and the last digit can decide in which one a
descent ends. Sums and linear systems are therefore written out here: the order of rounding in NumPy and LAPACK depends
on their version and on the processor.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.compiled import compile_function

__all__ = ["Minima", "minimise"]


#: rows of parameters (n, p), and which problem each row belongs to (n) → residuals (n, m)
ResidualFunction = Callable[[Array, npt.NDArray[np.intp]], Array]

_DIFFERENCE = 1e-4  # finite-difference step as a share of the parameter's range
_DAMPING = (1e-8, 1e8)
_POOR_STEPS = 3  # in a row, then a row rests


@dataclass(frozen=True, slots=True)
class Minima:
    """Where each start ended: parameters (n, p) and sums of squares (n,)."""

    parameters: Array
    cost: Array


def minimise(
    residuals: ResidualFunction, starts: Array, low: Array, high: Array, *, iterations: int = 60,
    tolerance: float = 1e-6
) -> Minima:
    """Return the local minimum that each row of `starts` leads to.

    A parameter whose bounds are equal keeps its starting value in every row (so the rows may differ in it).

    Args:
        residuals: see `ResidualFunction`; rows that are not finite count as infinitely bad.
        starts: shape (n, p).
        low: lower bounds, shape (p,).
        high: upper bounds, shape (p,).
        iterations: most steps tried.
        tolerance: relative decrease of the cost below which a row has converged.
    """
    free = np.flatnonzero(high > low)
    width = (high - low)[free]
    z = starts.copy()
    z[:, free] = np.clip(z[:, free], low[free], high[free])
    rows = np.arange(len(z))
    r, cost = _evaluate(residuals, z, rows)
    damping = np.full(len(z), 1e-2)
    resting = np.zeros(len(z), dtype=np.int64)
    moved = np.ones(len(z), dtype=np.bool_)  # since its slopes were taken
    gradient, normal = np.empty((len(z), len(free))), np.empty((len(z), len(free), len(free)))
    for _ in range(iterations):
        live = np.flatnonzero((resting < _POOR_STEPS) & np.isfinite(cost))
        if not len(live):
            break
        new = live[moved[live]]
        if len(new):
            gradient[new], normal[new] = _slopes(residuals, z[new], r[new], rows[new], free, low, high)
        step = _step(z[live], gradient[live], normal[live], free, low, high, damping[live])
        trial = z[live].copy()
        trial[:, free] = np.clip(trial[:, free] + step * width, low[free], high[free])
        r_new, cost_new = _evaluate(residuals, trial, rows[live])
        better = cost_new < cost[live]
        gained = np.where(better, (cost[live] - cost_new) / np.maximum(cost[live], 1e-300), 0.0)
        resting[live] = np.where(gained > tolerance, 0, resting[live] + (better | (damping[live] > 1e3)))
        damping[live] = np.clip(np.where(better, damping[live] / 3.0, damping[live] * 4.0), *_DAMPING)
        moved[live] = better
        indices = live[better]
        z[indices], r[indices], cost[indices] = trial[better], r_new[better], cost_new[better]
    return Minima(z, cost)


def _evaluate(residuals: ResidualFunction, z: Array, rows: npt.NDArray[np.intp]) -> tuple[Array, Array]:
    r = np.ascontiguousarray(residuals(z, rows))
    cost = np.empty(len(r))
    compile_function(_sum_squares)(r, cost)
    return r, np.where(np.isfinite(cost), cost, np.inf)


def _slopes(
    residuals: ResidualFunction, z: Array, r: Array, rows: npt.NDArray[np.intp], free: npt.NDArray[np.intp],
    low: Array, high: Array,
) -> tuple[Array, Array]:
    """Return gradient (n, q) and normal matrix (n, q, q) by the free parameters, as shares of their ranges."""
    n, q = len(z), len(free)
    width = (high - low)[free]
    sign = np.where(z[:, free] + _DIFFERENCE * width > high[free], -1.0, 1.0)
    moved = np.repeat(z[:, None, :], q, axis=1)
    moved[:, np.arange(q), free] += sign * _DIFFERENCE * width
    shifted = residuals(moved.reshape(n * q, -1), np.repeat(rows, q))
    gradient, normal = np.empty((n, q)), np.empty((n, q, q))
    # in C order, whatever the source: one kernel to compile
    jacobian = np.array(shifted, order="C").reshape(n, q, -1)
    compile_function(_normal_equations)(jacobian, r, np.array(sign * _DIFFERENCE, order="C"), gradient, normal)
    return gradient, normal


def _step(
    z: Array, gradient: Array, normal: Array, free: npt.NDArray[np.intp], low: Array, high: Array, damping: Array
) -> Array:
    """Return the damped Gauss–Newton step of the free parameters, as shares of their ranges, shape (n, q)."""
    at_bound = ((z[:, free] <= low[free]) & (gradient > 0)) | ((z[:, free] >= high[free]) & (gradient < 0))
    diagonal = np.diagonal(normal, axis1=1, axis2=2)
    floor = 1e-9 * diagonal.max(axis=1, keepdims=True) + 1e-12
    unit = np.eye(len(free))
    damped = normal + (damping[:, None] * np.maximum(diagonal, floor))[:, :, None] * unit
    damped = np.where(~at_bound[:, :, None] & ~at_bound[:, None, :], damped, unit)
    step = np.where(at_bound, 0.0, -gradient)
    compile_function(_solve)(damped, step)
    return step


def _sum_squares(r: Array, cost: Array) -> None:
    """Fill cost (n,) with the sums of squares of r (n, m)."""
    for i in range(r.shape[0]):
        total = 0.0
        for k in range(r.shape[1]):
            total += r[i, k] * r[i, k]
        cost[i] = total


def _normal_equations(jacobian: Array, r: Array, steps: Array, gradient: Array, normal: Array) -> None:
    """Fill gradient (n, q) and normal (n, q, q) with J·r and J·Jᵀ.

    `jacobian` (n, q, m) is given as residuals after the steps (n, q), r (n, m) are those before. For a row that is not
    a model the slope is unknown and set to 0.
    """
    for i in range(jacobian.shape[0]):
        for a in range(jacobian.shape[1]):
            for k in range(jacobian.shape[2]):
                change = jacobian[i, a, k] - r[i, k]
                jacobian[i, a, k] = change / steps[i, a] if math.isfinite(change) else 0.0
        for a in range(jacobian.shape[1]):
            total = 0.0
            for k in range(jacobian.shape[2]):
                total += jacobian[i, a, k] * r[i, k]
            gradient[i, a] = total
            for b in range(a + 1):
                total = 0.0
                for k in range(jacobian.shape[2]):
                    total += jacobian[i, a, k] * jacobian[i, b, k]
                normal[i, a, b] = normal[i, b, a] = total


def _solve(matrices: Array, sides: Array) -> None:
    """Put the solutions of symmetric positive definite systems (n, q, q) in the place of their sides (n, q).

    The matrices are used up. Elimination needs no pivots here.
    """
    for i in range(matrices.shape[0]):
        a, x = matrices[i], sides[i]
        q = len(x)
        for j in range(q):
            for k in range(j + 1, q):
                share = a[k, j] / a[j, j]
                for c in range(j, q):
                    a[k, c] -= share * a[j, c]
                x[k] -= share * x[j]
        for j in range(q - 1, -1, -1):
            for c in range(j + 1, q):
                x[j] -= a[j, c] * x[c]
            x[j] /= a[j, j]
