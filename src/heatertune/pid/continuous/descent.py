"""The search over TN and TV of the continuous loop, K being known for each: a grid, then the local optimum."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from heatertune.pid.continuous.kernel import Four, least_price, pieces, price

__all__ = ["Task", "refine", "scan"]

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
#: frequencies, heaters' answers there, heaters, weights, limits: see `pieces` and `price`
Task = tuple[Array, Complex, Array, Array, Four]

_RINGING = 2.0  # a response this much dearer than the best is not made the best by a smaller K


def _inside(
    heaters: Array, weights: Array, bottom: float, top: float, tn: float, tv: float, at_top: float, finer: float
) -> tuple[float, float]:
    """Return the best cost and gain below the top of a piece, by golden section; the bound closes the range below."""
    a = math.log(max(bottom, top * least_price(heaters, weights, top, tn) / at_top))
    b = math.log(top)
    golden = 0.5 * (math.sqrt(5.0) - 1.0)
    c, d = b - golden * (b - a), a + golden * (b - a)
    fc = price(heaters, weights, math.exp(c), tn, tv, finer, at_top)
    fd = price(heaters, weights, math.exp(d), tn, tv, finer, at_top)
    while b - a > 1e-3:
        if fc < fd:
            b, d, fd = d, c, fc
            c = b - golden * (b - a)
            fc = price(heaters, weights, math.exp(c), tn, tv, finer, at_top)
        else:
            a, c, fc = c, d, fd
            d = a + golden * (b - a)
            fd = price(heaters, weights, math.exp(d), tn, tv, finer, at_top)
    return (fc, math.exp(c)) if fc < fd else (fd, math.exp(d))


def _reduced(task: Task, tn: float, tv: float, best: float, finer: float) -> tuple[float, float]:
    """Return the least cost over K at one TN and TV, and that K; infinite where it cannot be below `best`.

    TV > TN is left out: with TV without bound the filtered derivative is a gain, a PI controller under another name;
    and so is TV below the shortest, where noise would pay for a derivative that does nothing.
    """
    omega, plant, heaters, weights, limits = task
    cost, gain = math.inf, 0.0
    if tv > tn or 0.0 < tv < limits[3]:
        return cost, gain
    bottoms, tops = pieces(omega, plant, tn, tv, limits)
    for j in range(len(tops)):
        top = tops[j]
        lowest = least_price(heaters, weights, top, tn)
        if lowest >= min(best, cost):
            break  # lower pieces have higher bounds
        dear = _RINGING * min(best, cost)
        value, at = price(heaters, weights, top, tn, tv, finer, dear), top
        if lowest * (1.0 + 1e-7) < value < dear:
            near = top * 0.999
            if near > bottoms[j] and price(heaters, weights, near, tn, tv, finer, value) < value:
                value, at = _inside(heaters, weights, bottoms[j], top, tn, tv, value, finer)
        if value < cost:
            cost, gain = value, at
    return cost, gain


def scan(task: Task, tns: Array, tvs: Array, best: float, finer: float) -> Four:
    """Return (cost, K, TN, TV) of the best point of a grid; cost `best` and K = 0 where none is below `best`.

    Args:
        task: heaters, weights and limits.
        tns: TN of the grid, shape (a,) [s].
        tvs: TV of the grid, shape (b,) [s].
        best: cost to be below.
        finer: factor of the number of time steps.
    """
    best_point = (best, 0.0, 0.0, 0.0)
    for tn in tns:
        for tv in tvs:
            cost, gain = _reduced(task, tn, tv, best_point[0], finer)
            if cost < best_point[0]:
                best_point = (cost, gain, tn, tv)
    return best_point


def refine(task: Task, start: Four, stride: float, least: float, finer: float) -> Four:
    """Return (cost, K, TN, TV) of the local optimum over ln TN (and ln TV) near a start, found by two simplex searches.

    Args:
        task: heaters, weights and limits.
        start: (cost, K, TN, TV).
        stride: first distance of a simplex.
        least: its last distance.
        finer: factor of the number of time steps.
    """
    best = _simplex(task, start, stride, least, finer)
    # begun anew from the other side: a simplex can fall flat where two peaks of |S| meet
    return _simplex(task, best, -0.3 * stride, least, finer)


def _simplex(task: Task, start: Four, stride: float, least: float, finer: float) -> Four:
    """J. A. Nelder and R. Mead, Computer Journal 7 (1965) 308-313, in one dimension (TV = 0) or two."""
    n = 1 if start[3] == 0.0 else 2
    x = np.full((n + 1, 2), -math.inf)
    cost, gain = np.empty(n + 1), np.empty(n + 1)
    for j in range(n + 1):
        for i in range(n):
            x[j, i] = math.log(start[2 + i]) + (stride if j == i + 1 else 0.0)
        cost[j], gain[j] = _at(task, x[j], finer)
    for _ in range(200):
        order = np.argsort(cost)
        x, cost, gain = x[order], cost[order], gain[order]
        if np.abs(x[1:, :n] - x[0, :n]).max() < least:
            break
        middle = x[0].copy() if n == 1 else 0.5 * (x[0] + x[1])
        away = middle[:n] - x[n, :n]
        point = middle.copy()
        point[:n] += away
        value, k = _at(task, point, finer)
        if value < cost[0]:
            further = point.copy()
            further[:n] += away
            wide, w = _at(task, further, finer)
            if wide < value:
                point, value, k = further, wide, w
        elif value >= cost[n - 1]:
            level = min(value, cost[n])
            point[:n] = middle[:n] + (0.5 if value < cost[n] else -0.5) * away
            value, k = _at(task, point, finer)
            if value >= level:
                for j in range(1, n + 1):
                    x[j, :n] = 0.5 * (x[0, :n] + x[j, :n])
                    cost[j], gain[j] = _at(task, x[j], finer)
                continue
        x[n], cost[n], gain[n] = point, value, k
    best = np.argmin(cost)
    answer = cost[best], gain[best], math.exp(x[best, 0]), math.exp(x[best, 1])
    return answer if answer[0] < start[0] else start


def _at(task: Task, x: Array, finer: float) -> tuple[float, float]:
    """Return least cost and K at x = (ln TN, ln TV)."""
    return _reduced(task, math.exp(x[0]), math.exp(x[1]), math.inf, finer)
