"""The loop in continuous time with its exact dead time: feasible gains and time responses.

Controller C(s) = K·c(s), c(s) = 1 + 1/(TN·s) + TV·s/(1 + TV·s/N). At each frequency, each limit excludes one interval
of K (`_interval`); the rest is the feasible set, in pieces. Time responses are solved from the delay equation: the
power is linear between instants that divide the dead time, and each lag is solved exactly. ∫e dt is known without
simulation (TN/K after a load of 1), and ∫|e| ≥ |∫e|: only the part of e with the opposite sign is simulated, and only
if this bound does not already rule the point out.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from heatertune.arrays import Array, Complex
from heatertune.heater.exact import apart
from heatertune.pid.design_values import DERIVATIVE_FILTER_N
from heatertune.pid.specs import ROOM

__all__ = [
    "DERIVATIVE_FILTER_N", "Four", "Heater", "Space", "controller", "encirclements", "least_price", "oscillation",
    "pieces", "price", "space_for",
]

Four = tuple[float, float, float, float]
#: k [°C/%], larger lag, smaller lag (0: none), dead time [s], and the share that passes the larger lag
Heater = tuple[float, float, float, float, float]


_MOST_PIECES = 6
_MOST_STEPS = 60_000
_REST = 1e-5  # share of the largest deviation, and of ∫e, below which the response has come to rest


class Space(NamedTuple):
    """Work arrays for n frequencies and a queue of q steps.

    Attributes:
        loop: G·c, shape (n,).
        low: lower ends of the intervals that Ms, Mt and Mks exclude, padded with infinity at both ends, shape (3, n
            + 2).
        high: upper ends, shape (3, n).
        excluded: the existing intervals, shape (3·n, 2).
        ends: bottoms and tops of the feasible pieces, shape (2, 6).
        queue: ring buffer of delayed powers, and of each step's mean deviation from the straight line, shape (2, q).
        corners: cost, K, ln TN and ln TV of a simplex's corners, shape (3, 4).
    """

    loop: Complex
    low: Array
    high: Array
    excluded: Array
    ends: Array
    queue: Array
    corners: Array


def space_for(points: int, heaters: Array, finer: float) -> Space:
    """Return room for so many frequencies and for the steps of these heaters, shape (p, 5) as for `price`."""
    steps = [finer * max(32.0, 8.0 * dead / first) for _, first, _, dead, _ in heaters.tolist()]  # at most, see `_grid`
    return Space(
        loop=np.empty(points, dtype=np.complex128), low=np.full((3, points + 2), math.inf), high=np.empty((3, points)),
        excluded=np.empty((3 * points, 2)), ends=np.empty((2, _MOST_PIECES)),
        queue=np.empty((2, math.ceil(max(steps, default=0.0)) + 2)), corners=np.empty((3, 4)))


def _interval(alpha: float, beta: float, gamma: float) -> tuple[float, float]:
    """Return the interval of K > 0 if α·K² + 2·β·K + γ < 0, with γ > 0; both ends infinite if it does not exist."""
    square = beta * beta - alpha * gamma
    if square <= 0.0 or (alpha >= 0.0 and beta >= 0.0):
        return math.inf, math.inf
    root = math.sqrt(square) - beta
    if root <= 0.0:  # α is negative only by its last digit: K would be without end
        return math.inf, math.inf
    return gamma / root, root / alpha if alpha > 0.0 else math.inf


def controller(omega: Array, tn: float, tv: float) -> Complex:
    """Return c(jω) at one frequency or many [rad/s], in the shape of `omega`."""
    u = omega * (tv / DERIVATIVE_FILTER_N)
    part = DERIVATIVE_FILTER_N * u / (1.0 + u * u)  # jωTV/(1 + ju), in real numbers: a third of the time
    return 1.0 + part * u + 1j * (part - 1.0 / (omega * tn))


def _exclude(omega: Array, plant: Complex, tn: float, tv: float, limits: Four, space: Space) -> int:
    """Enter the intervals that Ms, Mt and Mks exclude, and h = G·c; return how many there are."""
    ms, mt, mks, _ = limits
    n = len(omega)
    rows = 1 + (mt < math.inf) + (mks < math.inf)
    loop, low, high, excluded = space.loop, space.low, space.high, space.excluded
    for i in range(n):
        c = controller(omega[i], tn, tv)
        h = plant[i] * c
        loop[i] = h
        size, real = h.real * h.real + h.imag * h.imag, h.real
        row = 0
        low[0, i + 1], high[0, i] = _interval(size, real, 1.0 - 1.0 / ms**2)
        if mt < math.inf:
            row += 1
            low[row, i + 1], high[row, i] = _interval((1.0 - 1.0 / mt**2) * size, real, 1.0)
        if mks < math.inf:
            row += 1
            noise = (c.real * c.real + c.imag * c.imag) / mks**2
            low[row, i + 1], high[row, i] = _interval(size - noise, real, 1.0)
    count = 0
    for row in range(rows):
        for i in range(n):
            here = low[row, i + 1]
            if here < math.inf:
                if here < low[row, i] < math.inf and here <= low[row, i + 2] < math.inf:
                    here = _vertex(omega, low, row, i)
                excluded[count, 0], excluded[count, 1] = here, high[row, i]
                count += 1
    return count


def _vertex(omega: Array, low: Array, row: int, i: int) -> float:
    """Return the least value of the parabola over ln ω through the minimum at omega[i], which is low[row, i + 1]."""
    before: float = low[row, i]
    here: float = low[row, i + 1]
    after: float = low[row, i + 2]
    if not omega[i - 1] < omega[i] < omega[i + 1] < 1.3 * omega[i - 1]:
        return here  # the next plant begins, or the grid has a gap
    p, q = math.log(omega[i - 1] / omega[i]), math.log(omega[i + 1] / omega[i])
    slope_p, slope_q = (before - here) / p, (after - here) / q
    bend = (slope_q - slope_p) / (q - p)
    slope = slope_p - bend * p
    return here - slope * slope / (4.0 * bend)


def encirclements(omega: Array, loop: Complex, gain: float) -> int:
    """Return the largest number of encirclements of −1 by K·h over the plants (ω restarts with each), shapes (n,).

    They are counted by the crossings of the negative real axis left of −1. The open loop has one integrator and is
    stable otherwise, so a stable loop has no encirclements.
    """
    worst = count = 0
    for i in range(1, len(omega)):
        if omega[i] < omega[i - 1]:
            worst, count = max(worst, abs(count)), 0
            continue
        a, b = loop[i - 1], loop[i]
        if (a.imag < 0.0) != (b.imag < 0.0):
            share = a.imag / (a.imag - b.imag)
            if gain * (a.real + share * (b.real - a.real)) < -1.0:
                count += 1 if a.imag < 0.0 else -1
    return max(worst, abs(count))


def pieces(omega: Array, plant: Complex, tn: float, tv: float, limits: Four, space: Space) -> int:
    """Store lower and upper ends of the feasible pieces of K with a stable loop, the lowest first; return their number.

    Both ends are moved inwards by `ROOM`; a narrower piece is omitted.

    Args:
        omega: frequencies, ascending for each plant, one plant after the other, shape (n,) [rad/s].
        plant: G(jω) there, shape (n,) [°C/%].
        tn: TN [s].
        tv: TV [s], 0 without a derivative part.
        limits: (Ms, Mt, Mks, shortest TV), infinite if it does not exist.
        space: work arrays for the result.
    """
    many = _exclude(omega, plant, tn, tv, limits, space)
    loop, excluded = space.loop, space.excluded
    ceiling = limits[2] / (1.0 + DERIVATIVE_FILTER_N if tv > 0.0 else 1.0)  # |C·S| at infinite frequency
    count, reached = 0, 0.0
    for _ in range(_MOST_PIECES):
        top = ceiling
        for i in range(many):
            if reached < excluded[i, 0] < top:
                top = excluded[i, 0]
        low, high = (1.0 + ROOM) * reached, (1.0 - ROOM) * top
        # a small gain is stable; higher pieces may not be
        if low < high < math.inf and (reached == 0.0 or encirclements(omega, loop, 0.5 * (low + high)) == 0):
            space.ends[0, count], space.ends[1, count] = low, high
            count += 1
        before, reached = reached, top
        while reached > before:
            before = reached
            for i in range(many):
                if excluded[i, 0] <= before and excluded[i, 1] > reached:
                    reached = excluded[i, 1]
        if reached >= ceiling:
            break
    return count


def _grid(heater: Heater, high: float, finer: float) -> tuple[float, int, float]:
    """Return the step, the whole steps of dead time and the share of a step left over (only without whole steps).

    `high` is the controller's gain at infinite frequency; it alone sets the pace where a heater has one lag only.
    """
    k, first, second, dead, fast = heater
    pace = first / (k * high)
    if pace < second:
        pace = math.sqrt(pace * second)
    if fast > 0.0:
        pace = min(pace, second / (fast * k * high))
    step = min(max(dead + min(second, 4.0 * pace), pace / 8.0) / 32.0, first / 8.0) / finer
    if dead < step / 20.0:
        return step, 0, dead / step
    whole = math.ceil(dead / step)
    return dead / whole, whole, 0.0


def _lag(lag: float, h: float) -> tuple[float, float, float]:
    """Return the weights of state, input and next input in a lag's next state; between, the input runs straight."""
    a = math.exp(-h / lag) if lag > 0.0 else 0.0
    new = 1.0 - (1.0 - a) * lag / h
    return a, 1.0 - a - new, new


def _above(v: float, w: float, t: float, h: float) -> tuple[float, float]:
    """Return ∫ and ∫t· of the positive part of the line from v at t to w at t + h."""
    if v >= 0.0 and w >= 0.0:
        return 0.5 * h * (v + w), 0.5 * h * (v * t + w * (t + h))
    part = 0.5 * max(v, w) ** 2 / (abs(v) + abs(w)) * h
    return part, part * (t if v > 0.0 else t + h)


def oscillation(  # noqa: PLR0915 - one loop
    heater: Heater, settings: tuple[float, float, float], setpoint: float, load: float, finer: float,
    dear: tuple[float, float, float], queue: Array,
) -> tuple[float, float]:
    """Return ∫v and ∫t·v of v, the part of the deviation whose sign is not that of ∫e dt; infinite if it diverges.

    Args:
        heater: see `Heater`.
        settings: (K, TN, TV).
        setpoint: height of its step [°C], 0 if the load steps.
        load: height of its step [%], 0 if the setpoint steps.
        finer: factor of the number of steps.
        dear: (weight of ∫v, weight of ∫t·v, weighted sum at which the response costs too much and is abandoned).
        queue: work array, shape (2, q), see `Space`.
    """
    k, first, second, dead, fast = heater
    gain, tn, tv = settings
    past = DERIVATIVE_FILTER_N if tv > 0.0 else 0.0
    h, whole, late = _grid(heater, gain * (1.0 + past), finer)
    first, second = apart(first, second)
    s1, s2 = k * (first - fast * first) / (first - second), -k * (second - fast * first) / (first - second)
    (a1, o1, n1), (a2, o2, n2), (af, of, nf) = _lag(first, h), _lag(second, h), _lag(tv / DERIVATIVE_FILTER_N, h)
    new, old = s1 * n1 + s2 * n2, s1 * o1 + s2 * o2
    direct = gain * (1.0 + 0.5 * h / tn + past * (1.0 - nf))
    sign = 1.0 if setpoint > 0.0 else -1.0
    ended = tn / (gain * k) * setpoint - tn / gain * load
    half, ratio = 0.5 * gain * past, gain * tv / h
    if not 0 <= whole < queue.shape[1]:
        return math.inf, math.inf  # gains overflow: no step
    queue[:, :whole + 1] = 0.0
    x1 = x2 = summed = filtered = area = moment = peak = 0.0
    e, u = setpoint, gain * (1.0 + past) * setpoint
    queue[0, whole] = u
    oldest = quiet = 0
    for i in range(_MOST_STEPS):
        following = oldest + 1 if oldest < whole else 0
        left = load + (queue[0, oldest] if whole > 0 else u)  # `oldest` acts from now
        filter_out, lack_gain = af * filtered + of * e, 0.0
        free = a1 * x1 * s1 + a2 * x2 * s2 + old * left
        free_output = gain * ((summed + 0.5 * h * e) / tn - past * filter_out)
        if whole > 0:
            share = 0.0
            right = load + (queue[0, following] if i >= whole else 0.0)  # before it acts, a step in power is not there
            lack = queue[1, following]  # a short TV acts within one step
        else:
            share = 1.0 - late
            right = load + late * u + share * free_output
            lack = (half + ratio) * filter_out + (half - ratio) * filtered - half * e
            lack_gain = (half + ratio) * nf - half
        before, e = e, setpoint - free - new * right - (old + new) * lack
        if whole == 0:  # else the power of this step acts later
            e /= 1.0 + share * direct * new + (old + new) * lack_gain
        right += share * direct * e + lack + lack_gain * e
        left += lack + lack_gain * e
        x1, x2 = a1 * x1 + o1 * left + n1 * right, a2 * x2 + o2 * left + n2 * right
        summed += 0.5 * h * (before + e)
        filter_out += nf * e
        queue[1, oldest] = (half + ratio) * filter_out + (half - ratio) * filtered - half * (before + e)
        filtered = filter_out
        u = free_output + direct * e
        queue[0, oldest] = u
        oldest = following
        v, w = -sign * before, -sign * e
        t = i * h + (dead if load != 0.0 else 0.0)
        if v > 0.0 or w > 0.0:
            more, later = _above(v, w, t, h)
            area, moment = area + more, moment + later
            if dear[0] * area + dear[1] * moment > dear[2]:
                break
        peak = max(peak, abs(e))
        if peak > 1e6 * (k * abs(load) + setpoint):
            return math.inf, math.inf
        quiet = quiet + 1 if abs(e) < _REST * peak and abs(summed - ended) < _REST * abs(ended) else 0
        if quiet > 2 * whole + 20:
            break
    return area, moment


def least_price(heaters: Array, weights: Array, gain: float, tn: float) -> float:
    """Return the cost of a response that never changes its sign: no loop with these settings costs less.

    `heaters`, shape (p, 5), and `weights`, shape (p, 4), are those of `price`.
    """
    least = 0.0
    for p in range(len(heaters)):
        k = heaters[p, 0]
        ie = tn / gain
        least += (weights[p, 0] + weights[p, 3]) * ie + weights[p, 1] * ie / k
        least += weights[p, 2] * ie * ie * (1.0 / k + gain)  # ∫t·e dt = −Y′(0) with Y = 1/(s/G + s·C)
    return least


def price(
    heaters: Array, weights: Array, gain: float, tn: float, tv: float, finer: float, best: float, queue: Array
) -> float:
    """Return the cost: Σ over heaters and objectives of weight·value.

    Args:
        heaters: a row of each, see `Heater`, shape (p, 5).
        weights: of load IAE, setpoint IAE, load ITAE and TN/K, shape (p, 4).
        gain: K [%/°C].
        tn: TN [s].
        tv: TV [s], 0 without a derivative part.
        finer: factor of the number of steps.
        best: above this the cost need not be exact.
        queue: work array, shape (2, q), see `Space`.
    """
    total = least_price(heaters, weights, gain, tn)
    for p in range(len(heaters)):
        heater = (heaters[p, 0], heaters[p, 1], heaters[p, 2], heaters[p, 3], heaters[p, 4])
        load, setpoint, late = 2.0 * weights[p, 0], 2.0 * weights[p, 1], 2.0 * weights[p, 2]
        if load > 0.0 or late > 0.0:
            area, moment = oscillation(heater, (gain, tn, tv), 0.0, 1.0, finer, (load, late, best - total), queue)
            total += load * area + late * moment
        if setpoint > 0.0:
            total += setpoint * oscillation(heater, (gain, tn, tv), 1.0, 0.0, finer, (setpoint, 0.0, best - total),
                                            queue)[0]
    return total
