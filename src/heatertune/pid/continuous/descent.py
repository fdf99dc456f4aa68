"""The search over TN and TV of the continuous loop, K being known for each: a grid, then the local optimum."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from heatertune.pid.continuous.kernel import Four, Space, least_price, pieces, price

__all__ = ["Task", "refine", "scan"]

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
#: frequencies, heaters' answers there, heaters, weights, limits: see `pieces` and `price`
Task = tuple[Array, Complex, Array, Array, Four]

_RINGING = 2.0  # a response this much dearer than the best is not made the best by a smaller K


def _inside(
    heaters: Array, weights: Array, piece: tuple[float, float], tn: float, tv: float, at_top: float, finer: float,
    queue: Array,
) -> tuple[float, float]:
    """Return the best cost and gain below the top of a piece, by golden section; the bound closes the range below."""
    bottom, top = piece
    a = math.log(max(bottom, top * least_price(heaters, weights, top, tn) / at_top))
    b = math.log(top)
    golden = 0.5 * (math.sqrt(5.0) - 1.0)
    c, d = b - golden * (b - a), a + golden * (b - a)
    fc = price(heaters, weights, math.exp(c), tn, tv, finer, at_top, queue)
    fd = price(heaters, weights, math.exp(d), tn, tv, finer, at_top, queue)
    while b - a > 1e-3:
        if fc < fd:
            b, d, fd = d, c, fc
            c = b - golden * (b - a)
            fc = price(heaters, weights, math.exp(c), tn, tv, finer, at_top, queue)
        else:
            a, c, fc = c, d, fd
            d = a + golden * (b - a)
            fd = price(heaters, weights, math.exp(d), tn, tv, finer, at_top, queue)
    return (fc, math.exp(c)) if fc < fd else (fd, math.exp(d))


def _reduced(task: Task, tn: float, tv: float, best: float, finer: float, space: Space) -> tuple[float, float]:
    """Return the least cost over K at one TN and TV, and that K; infinite where it cannot be below `best`.

    TV > TN is left out: with TV without bound the filtered derivative is a gain, a PI controller under another name;
    and so is TV below the shortest, where noise would pay for a derivative that does nothing.
    """
    omega, plant, heaters, weights, limits = task
    cost, gain = math.inf, 0.0
    if tv > tn or 0.0 < tv < limits[3]:
        return cost, gain
    for j in range(pieces(omega, plant, tn, tv, limits, space) - 1, -1, -1):  # from the highest
        bottom, top = space.ends[0, j], space.ends[1, j]
        lowest = least_price(heaters, weights, top, tn)
        if lowest >= min(best, cost):
            break  # lower pieces have higher bounds
        dear = _RINGING * min(best, cost)
        value, at = price(heaters, weights, top, tn, tv, finer, dear, space.queue), top
        if lowest * (1.0 + 1e-7) < value < dear:
            near = top * 0.999
            if near > bottom and price(heaters, weights, near, tn, tv, finer, value, space.queue) < value:
                value, at = _inside(heaters, weights, (bottom, top), tn, tv, value, finer, space.queue)
        if value < cost:
            cost, gain = value, at
    return cost, gain


def scan(task: Task, tns: Array, tvs: Array, best: float, finer: float, space: Space) -> Four:
    """Return (cost, K, TN, TV) of the best point of a grid; cost `best` and K = 0 where none is below `best`.

    Args:
        task: heaters, weights and limits.
        tns: TN of the grid, shape (a,) [s].
        tvs: TV of the grid, shape (b,) [s].
        best: cost to be below.
        finer: factor of the number of time steps.
        space: room for the task.
    """
    best_point = (best, 0.0, 0.0, 0.0)
    for tn in tns:
        for tv in tvs:
            cost, gain = _reduced(task, tn, tv, best_point[0], finer, space)
            if cost < best_point[0]:
                best_point = (cost, gain, tn, tv)
    return best_point


def refine(task: Task, start: Four, stride: float, least: float, finer: float, space: Space) -> Four:
    """Return (cost, K, TN, TV) of the local optimum over ln TN (and ln TV) near a start, found by two simplex searches.

    Args:
        task: heaters, weights and limits.
        start: (cost, K, TN, TV).
        stride: first distance of a simplex.
        least: its last distance.
        finer: factor of the number of time steps.
        space: room for the task.
    """
    best = _simplex(task, start, stride, least, finer, space)
    # begun anew from the other side: a simplex can fall flat where two peaks of |S| meet
    return _simplex(task, best, -0.3 * stride, least, finer, space)


def _simplex(task: Task, start: Four, stride: float, least: float, finer: float, space: Space) -> Four:
    """J. A. Nelder and R. Mead, Computer Journal 7 (1965) 308-313, in one dimension (TV = 0) or two."""
    n, x = 1 if start[3] == 0.0 else 2, space.corners
    for j in range(n + 1):
        x[j, 2] = math.log(start[2]) + (stride if j == 1 else 0.0)
        x[j, 3] = math.log(start[3]) + (stride if j == 2 else 0.0) if n == 2 else -math.inf
        x[j, 0], x[j, 1] = _at(task, x[j, 2], x[j, 3], finer, space)
    for _ in range(200):
        _sort(x, n)
        if _width(x, n) < least:
            break
        tn, tv = (x[0, 2], x[0, 3]) if n == 1 else (0.5 * (x[0, 2] + x[1, 2]), 0.5 * (x[0, 3] + x[1, 3]))
        away_tn, away_tv = tn - x[n, 2], tv - x[n, 3] if n == 2 else 0.0
        point = tn + away_tn, tv + away_tv
        value, k = _at(task, point[0], point[1], finer, space)
        if value < x[0, 0]:
            further = point[0] + away_tn, point[1] + away_tv
            wide, w = _at(task, further[0], further[1], finer, space)
            if wide < value:
                point, value, k = further, wide, w
        elif value >= x[n - 1, 0]:
            level = min(value, x[n, 0])
            share = 0.5 if value < x[n, 0] else -0.5
            point = tn + share * away_tn, tv + share * away_tv
            value, k = _at(task, point[0], point[1], finer, space)
            if value >= level:
                for j in range(1, n + 1):
                    for i in range(2, n + 2):
                        x[j, i] = 0.5 * (x[0, i] + x[j, i])
                    x[j, 0], x[j, 1] = _at(task, x[j, 2], x[j, 3], finer, space)
                continue
        x[n, 0], x[n, 1], x[n, 2], x[n, 3] = value, k, point[0], point[1]
    _sort(x, n)
    answer = x[0, 0], x[0, 1], math.exp(x[0, 2]), math.exp(x[0, 3])
    return answer if answer[0] < start[0] else start


def _sort(x: Array, n: int) -> None:
    """Sort the n + 1 corners of a simplex, the cheapest first; what costs the same stays in its order."""
    for last in range(1, n + 1):
        j = last
        while j > 0 and x[j, 0] < x[j - 1, 0]:
            for i in range(4):
                x[j - 1, i], x[j, i] = x[j, i], x[j - 1, i]
            j -= 1


def _width(x: Array, n: int) -> float:
    """Return how far a corner is from the cheapest one, in ln TN or ln TV, at most."""
    widest = 0.0
    for j in range(1, n + 1):
        for i in range(2, n + 2):
            widest = max(widest, abs(x[j, i] - x[0, i]))
    return widest


def _at(task: Task, ln_tn: float, ln_tv: float, finer: float, space: Space) -> tuple[float, float]:
    """Return least cost and K at ln TN and ln TV."""
    return _reduced(task, math.exp(ln_tn), math.exp(ln_tv), math.inf, finer, space)
