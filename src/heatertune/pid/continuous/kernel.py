"""The loop in continuous time with its exact dead time: feasible gains, time responses, the search.

Controller C(s) = K·c(s), c(s) = 1 + 1/(TN·s) + TV·s/(1 + TV·s/N). Each limit excludes, at each frequency, one interval
of K (`_interval`); what is left is the feasible set, in pieces. Time responses come from the delay equation itself: the
power runs straight between instants that divide the dead time, each lag is solved exactly. ∫e dt is known without (TN/K
after a load of 1), and ∫|e| ≥ |∫e|: only the part of e with the other sign is simulated, and only where this may pay.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from heatertune.heater.exact import apart
from heatertune.pid.specs import ROOM

__all__ = [
    "DERIVATIVE_FILTER_N", "Four", "Task", "controller", "encirclements", "pieces", "price", "refine", "scan", "swing",
]

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
Four = tuple[float, float, float, float]
#: frequencies, heaters' answers there, heaters, weights, limits: see `pieces` and `price`
Task = tuple[Array, Complex, Array, Array, Four]

DERIVATIVE_FILTER_N = 10.0  # N of the ideal form; K. J. Åström and T. Hägglund use 8…20

_MOST_PIECES = 6
_MOST_STEPS = 60_000
_RINGING = 2.0  # a response this much dearer than the best is not made the best by a smaller K
_REST = 1e-5  # share of the largest deviation, and of ∫e, below which the response has come to rest


def _interval(alpha: float, beta: float, gamma: float) -> tuple[float, float]:
    """Return the interval of K > 0 where α·K² + 2·β·K + γ < 0, with γ > 0; both ends infinite where there is none."""
    square = beta * beta - alpha * gamma
    if square <= 0.0 or (alpha >= 0.0 and beta >= 0.0):
        return math.inf, math.inf
    root = math.sqrt(square) - beta
    if root <= 0.0:  # α is negative only by its last digit: K would be without end
        return math.inf, math.inf
    return gamma / root, root / alpha if alpha > 0.0 else math.inf


def controller(omega: Array, tn: float, tv: float) -> Complex:
    """Return c(jω) at one frequency or many [rad/s]."""
    u = omega * (tv / DERIVATIVE_FILTER_N)
    part = DERIVATIVE_FILTER_N * u / (1.0 + u * u)  # jωTV/(1 + ju), in real numbers: a third of the time
    return 1.0 + part * u + 1j * (part - 1.0 / (omega * tn))


def _exclude(omega: Array, plant: Complex, tn: float, tv: float, limits: Four, loop: Complex) -> Array:
    """Return the intervals that Ms, Mt and Mks exclude, shape (m, 2), and fill loop with h = G·c."""
    ms, mt, mks, _ = limits
    n = len(omega)
    rows = 1 + (mt < math.inf) + (mks < math.inf)
    found = np.empty((rows * n, 2))
    low = np.empty((3, n + 2))
    low[:, 0] = low[:, n + 1] = math.inf
    high = np.empty((3, n))
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
                    here = _vertex(omega, low[row], i)
                found[count, 0], found[count, 1] = here, high[row, i]
                count += 1
    return found[:count]


def _vertex(omega: Array, low: Array, i: int) -> float:
    """Return the least value of the parabola over ln ω through the minimum at omega[i], which is low[i + 1]."""
    before: float = low[i]
    here: float = low[i + 1]
    after: float = low[i + 2]
    if not omega[i - 1] < omega[i] < omega[i + 1] < 1.3 * omega[i - 1]:
        return here  # the next plant begins, or the grid has a gap
    p, q = math.log(omega[i - 1] / omega[i]), math.log(omega[i + 1] / omega[i])
    slope_p, slope_q = (before - here) / p, (after - here) / q
    bend = (slope_q - slope_p) / (q - p)
    slope = slope_p - bend * p
    return here - slope * slope / (4.0 * bend)


def encirclements(omega: Array, loop: Complex, gain: float) -> int:
    """Return the largest number of encirclements of −1 by K·h over the plants (ω begins anew with each).

    Counted by the crossings of the negative real axis left of −1; the open loop has one integrator and is stable
    otherwise, so none is what a stable loop has.
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


def pieces(omega: Array, plant: Complex, tn: float, tv: float, limits: Four) -> tuple[Array, Array]:
    """Return bottoms and tops of the feasible pieces of K with a stable loop, the highest first.

    `omega` [rad/s] ascends for each plant, one after the other; `plant` is G(jω) there; `tv` is 0 without a derivative
    part; `limits` are (Ms, Mt, Mks, shortest TV), infinite where there is none.
    """
    loop = np.empty(len(omega), dtype=np.complex128)
    excluded = _exclude(omega, plant, tn, tv, limits, loop)
    ceiling = limits[2] / (1.0 + DERIVATIVE_FILTER_N if tv > 0.0 else 1.0)  # |C·S| at infinite frequency
    bottoms, tops = np.empty(_MOST_PIECES), np.empty(_MOST_PIECES)
    count, reached = 0, 0.0
    for _ in range(_MOST_PIECES):
        top = ceiling
        for i in range(len(excluded)):
            if reached < excluded[i, 0] < top:
                top = excluded[i, 0]
        low, high = (1.0 + ROOM) * reached, (1.0 - ROOM) * top
        # a small gain is stable; higher pieces may not be
        if low < high < math.inf and (reached == 0.0 or encirclements(omega, loop, 0.5 * (low + high)) == 0):
            bottoms[count], tops[count] = low, high
            count += 1
        before, reached = reached, top
        while reached > before:
            before = reached
            for i in range(len(excluded)):
                if excluded[i, 0] <= before and excluded[i, 1] > reached:
                    reached = excluded[i, 1]
        if reached >= ceiling:
            break
    return bottoms[:count][::-1], tops[:count][::-1]


def _grid(heater: Four, high: float, finer: float) -> tuple[float, int, float]:
    """Return the step, the whole steps of dead time and the share of a step left over (only without whole steps).

    `high` is the controller's gain at infinite frequency; it alone sets the pace where a heater has one lag only.
    """
    k, first, second, dead = heater
    pace = first / (k * high)
    if pace < second:
        pace = math.sqrt(pace * second)
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
    """Return ∫ and ∫t· of what is positive of the line from v at t to w at t + h."""
    if v >= 0.0 and w >= 0.0:
        return 0.5 * h * (v + w), 0.5 * h * (v * t + w * (t + h))
    part = 0.5 * max(v, w) ** 2 / (abs(v) + abs(w)) * h
    return part, part * (t if v > 0.0 else t + h)


def swing(  # noqa: PLR0915 - one loop
    heater: Four, settings: tuple[float, float, float], setpoint: float, load: float, finer: float,
    dear: tuple[float, float, float],
) -> tuple[float, float]:
    """Return ∫v and ∫t·v of v, the part of the deviation whose sign is not that of ∫e dt; infinite where it diverges.

    `heater` is (k [°C/%], larger lag, smaller lag (0: none), dead time [s]), `settings` (K, TN, TV); of `setpoint` [°C]
    and `load` [%] one is the height of the step, the other 0; `finer` is the factor of the number of steps; `dear`
    (weight of ∫v, weight of ∫t·v, sum of both at which the response costs too much and is left).
    """
    k, first, second, dead = heater
    gain, tn, tv = settings
    past = DERIVATIVE_FILTER_N if tv > 0.0 else 0.0
    h, whole, late = _grid(heater, gain * (1.0 + past), finer)
    first, second = apart(first, second)
    s1, s2 = k * first / (first - second), -k * second / (first - second)
    (a1, o1, n1), (a2, o2, n2), (af, of, nf) = _lag(first, h), _lag(second, h), _lag(tv / DERIVATIVE_FILTER_N, h)
    new, old = s1 * n1 + s2 * n2, s1 * o1 + s2 * o2
    direct = gain * (1.0 + 0.5 * h / tn + past * (1.0 - nf))
    sign = 1.0 if setpoint > 0.0 else -1.0
    ended = tn / (gain * k) * setpoint - tn / gain * load
    half, ratio = 0.5 * gain * past, gain * tv / h
    queue = np.zeros(whole + 1)  # a ring of the powers still to act; `oldest` acts from now
    lacks = np.zeros(whole + 1)  # mean power of each step beside the straight line: a short TV acts within one step
    x1 = x2 = summed = filtered = area = moment = peak = 0.0
    e, u = setpoint, gain * (1.0 + past) * setpoint
    queue[whole] = u
    oldest = quiet = 0
    for i in range(_MOST_STEPS):
        following = oldest + 1 if oldest < whole else 0
        left = load + (queue[oldest] if whole > 0 else u)
        kept, held = af * filtered + of * e, 0.0
        free = a1 * x1 * s1 + a2 * x2 * s2 + old * left
        rest = gain * ((summed + 0.5 * h * e) / tn - past * kept)
        if whole > 0:
            share = 0.0
            right = load + (queue[following] if i >= whole else 0.0)  # before it acts, a step in power is not there
            lack = lacks[following]
        else:
            share = 1.0 - late
            right = load + late * u + share * rest
            lack = (half + ratio) * kept + (half - ratio) * filtered - half * e
            held = (half + ratio) * nf - half
        before, e = e, setpoint - free - new * right - (old + new) * lack
        if whole == 0:  # else the power of this step acts later
            e /= 1.0 + share * direct * new + (old + new) * held
        right += share * direct * e + lack + held * e
        left += lack + held * e
        x1, x2 = a1 * x1 + o1 * left + n1 * right, a2 * x2 + o2 * left + n2 * right
        summed += 0.5 * h * (before + e)
        kept += nf * e
        lacks[oldest] = (half + ratio) * kept + (half - ratio) * filtered - half * (before + e)
        filtered = kept
        u = rest + direct * e
        queue[oldest] = u
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


def _bound(heaters: Array, weights: Array, gain: float, tn: float) -> float:
    """Return the cost of a response that never changes its sign: no loop with these settings costs less."""
    told = 0.0
    for p in range(len(heaters)):
        k = heaters[p, 0]
        ie = tn / gain
        told += (weights[p, 0] + weights[p, 3]) * ie + weights[p, 1] * ie / k
        told += weights[p, 2] * ie * ie * (1.0 / k + gain)  # ∫t·e dt = −Y′(0) with Y = 1/(s/G + s·C)
    return told


def price(
    heaters: Array, weights: Array, gain: float, tn: float, tv: float, finer: float, best: float
) -> float:
    """Return the cost: Σ over heaters and objectives of weight·value; above `best` it need not be exact.

    `heaters` holds k, lags and dead time of each, `weights` those of load IAE, setpoint IAE, load ITAE and TN/K, both
    of shape (p, 4); `finer` is the factor of the number of steps.
    """
    total = _bound(heaters, weights, gain, tn)
    for p in range(len(heaters)):
        heater = (heaters[p, 0], heaters[p, 1], heaters[p, 2], heaters[p, 3])
        load, setpoint, late = 2.0 * weights[p, 0], 2.0 * weights[p, 1], 2.0 * weights[p, 2]
        if load > 0.0 or late > 0.0:
            area, moment = swing(heater, (gain, tn, tv), 0.0, 1.0, finer, (load, late, best - total))
            total += load * area + late * moment
        if setpoint > 0.0:
            total += setpoint * swing(heater, (gain, tn, tv), 1.0, 0.0, finer, (setpoint, 0.0, best - total))[0]
    return total


def _inside(
    heaters: Array, weights: Array, bottom: float, top: float, tn: float, tv: float, at_top: float, finer: float
) -> tuple[float, float]:
    """Return the best cost and gain below the top of a piece, by golden section; the bound closes the range below."""
    a = math.log(max(bottom, top * _bound(heaters, weights, top, tn) / at_top))
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


def reduced(task: Task, tn: float, tv: float, best: float, finer: float) -> tuple[float, float]:
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
        lowest = _bound(heaters, weights, top, tn)
        if lowest >= min(best, cost):
            break  # lower pieces have higher bounds
        dear = _RINGING * min(best, cost)
        found, at = price(heaters, weights, top, tn, tv, finer, dear), top
        if lowest * (1.0 + 1e-7) < found < dear:
            near = top * 0.999
            if near > bottoms[j] and price(heaters, weights, near, tn, tv, finer, found) < found:
                found, at = _inside(heaters, weights, bottoms[j], top, tn, tv, found, finer)
        if found < cost:
            cost, gain = found, at
    return cost, gain


def scan(task: Task, tns: Array, tvs: Array, best: float, finer: float) -> Four:
    """Return (cost, K, TN, TV) of the best point of a grid that is below `best`; cost `best` where there is none."""
    found = (best, 0.0, 0.0, 0.0)
    for tn in tns:
        for tv in tvs:
            cost, gain = reduced(task, tn, tv, found[0], finer)
            if cost < found[0]:
                found = (cost, gain, tn, tv)
    return found


def refine(task: Task, start: Four, stride: float, least: float, finer: float) -> Four:
    """Return (cost, K, TN, TV) of the local optimum over ln TN (and ln TV) near a start, found by two simplex searches.

    `stride` and `least` are their first and last distance.
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
        told, k = _at(task, point, finer)
        if told < cost[0]:
            further = point.copy()
            further[:n] += away
            wide, w = _at(task, further, finer)
            if wide < told:
                point, told, k = further, wide, w
        elif told >= cost[n - 1]:
            level = min(told, cost[n])
            point[:n] = middle[:n] + (0.5 if told < cost[n] else -0.5) * away
            told, k = _at(task, point, finer)
            if told >= level:
                for j in range(1, n + 1):
                    x[j, :n] = 0.5 * (x[0, :n] + x[j, :n])
                    cost[j], gain[j] = _at(task, x[j], finer)
                continue
        x[n], cost[n], gain[n] = point, told, k
    best = np.argmin(cost)
    found = cost[best], gain[best], math.exp(x[best, 0]), math.exp(x[best, 1])
    return found if found[0] < start[0] else start


def _at(task: Task, x: Array, finer: float) -> tuple[float, float]:
    """Return least cost and K at x = (ln TN, ln TV)."""
    return reduced(task, math.exp(x[0]), math.exp(x[1]), math.inf, finer)
