"""The loop in continuous time with its exact dead time, compiled: feasible gains, time responses, the search.

Controller C(s) = K·c(s), c(s) = 1 + 1/(TN·s) + TV·s/(1 + TV·s/N). Each limit excludes, at each frequency, one interval
of K (`_interval`); what is left over all frequencies is the feasible set, in pieces. Time responses come from the
delay equation itself: the power runs straight between instants that divide the dead time, each lag is solved exactly.

∫e dt is known without a simulation (TN/K after a load of 1), and ∫|e| ≥ |∫e|: the search leaves out what this bound
already shows to be worse, and only the part of e with the other sign is simulated.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

__all__ = ["DERIVATIVE_FILTER_N", "peaks", "pieces", "price", "reduced", "refine", "scan", "swing"]

DERIVATIVE_FILTER_N = 10.0  # N of the ideal form; K. J. Åström and T. Hägglund use 8…20

_MOST_PIECES = 6
_MOST_STEPS = 60_000
_REST = 1e-7  # share of the largest deviation below which the response has come to rest


@njit(cache=True, nogil=True)
def _interval(alpha, beta, gamma):  # type: ignore[no-untyped-def]
    """Return the interval of K > 0 where α·K² + 2·β·K + γ < 0, with γ > 0; both ends infinite where there is none."""
    square = beta * beta - alpha * gamma
    if square <= 0.0 or (alpha >= 0.0 and beta >= 0.0):
        return math.inf, math.inf
    root = math.sqrt(square) - beta
    return gamma / root, root / alpha if alpha > 0.0 else math.inf


@njit(cache=True, nogil=True)
def _controller(omega, tn, tv):  # type: ignore[no-untyped-def]
    """Return c(jω)."""
    c = 1.0 - 1j / (omega * tn)
    if tv > 0.0:
        c += 1j * omega * tv / (1.0 + 1j * omega * tv / DERIVATIVE_FILTER_N)
    return c


@njit(cache=True, nogil=True)
def _exclude(omega, plant, tn, tv, limits, low, high, loop):  # type: ignore[no-untyped-def]
    """Fill low and high, shape (3, n), with the intervals that Ms, Mt and Mks exclude, and loop with h = G·c."""
    ms, mt, mks = limits
    for i in range(len(omega)):
        c = _controller(omega[i], tn, tv)
        h = plant[i] * c
        loop[i] = h
        size, real = h.real * h.real + h.imag * h.imag, h.real
        low[0, i], high[0, i] = _interval(size, real, 1.0 - 1.0 / ms**2)
        if mt < math.inf:
            low[1, i], high[1, i] = _interval((1.0 - 1.0 / mt**2) * size, real, 1.0)
        if mks < math.inf:
            noise = (c.real * c.real + c.imag * c.imag) / mks**2
            low[2, i], high[2, i] = _interval(size - noise, real, 1.0)


@njit(cache=True, nogil=True)
def _vertex(omega, low, i):  # type: ignore[no-untyped-def]
    """Return the least value of the parabola through low at i and its neighbours over ln ω."""
    if i == 0 or i == len(omega) - 1 or not (omega[i - 1] < omega[i] < omega[i + 1]):
        return low[i]
    before, here, after = low[i - 1], low[i], low[i + 1]
    if not (before < math.inf and after < math.inf):
        return here
    p, q = math.log(omega[i - 1] / omega[i]), math.log(omega[i + 1] / omega[i])
    slope_p, slope_q = (before - here) / p, (after - here) / q
    bend = (slope_q - slope_p) / (q - p)
    if bend <= 0.0:
        return here
    slope = slope_p - bend * p
    return here - slope * slope / (4.0 * bend)


@njit(cache=True, nogil=True)
def _encirclements(omega, loop, gain):  # type: ignore[no-untyped-def]
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


@njit(cache=True, nogil=True)
def pieces(omega, plant, tn, tv, limits):  # type: ignore[no-untyped-def]
    """Return bottoms and tops of the feasible pieces of K with a stable loop, the highest first.

    Args:
        omega: frequencies [rad/s], ascending for each plant, one plant after the other, shape (n,).
        plant: G(jω), shape (n,).
        tn, tv: [s].
        limits: (Ms, Mt, Mks), infinite where there is no limit.
    """
    n = len(omega)
    low, high = np.full((3, n), math.inf), np.full((3, n), math.inf)
    loop = np.empty(n, dtype=np.complex128)
    _exclude(omega, plant, tn, tv, limits, low, high, loop)
    ceiling = limits[2] / (1.0 + DERIVATIVE_FILTER_N if tv > 0.0 else 1.0)  # |C·S| at infinite frequency
    bottoms, tops = np.empty(_MOST_PIECES), np.empty(_MOST_PIECES)
    found, reached = 0, 0.0
    for _ in range(_MOST_PIECES):
        top, row, at = ceiling, 0, -1
        for r in range(3):
            for i in range(n):
                if reached < low[r, i] < top:
                    top, row, at = low[r, i], r, i
        if at >= 0:
            top = _vertex(omega, low[row], at)
        if reached < top < math.inf and _encirclements(omega, loop, 0.5 * (reached + top)) == 0:
            bottoms[found], tops[found] = reached, top
            found += 1
        if at < 0:
            break
        before, reached = reached, max(reached, high[row, at])
        while reached > before and reached < ceiling:
            before = reached
            for r in range(3):
                for i in range(n):
                    if low[r, i] <= before and high[r, i] > reached:
                        reached = high[r, i]
        if reached >= ceiling:
            break
    return bottoms[:found][::-1], tops[:found][::-1]


@njit(cache=True, nogil=True)
def peaks(omega, plant, gain, tn, tv):  # type: ignore[no-untyped-def]
    """Return Ms, Mt and Mks at the given frequencies; infinite where the loop is unstable."""
    loop = np.empty(len(omega), dtype=np.complex128)
    ms = mt = 0.0
    mks = gain * (1.0 + DERIVATIVE_FILTER_N if tv > 0.0 else 1.0)
    for i in range(len(omega)):
        c = gain * _controller(omega[i], tn, tv)
        loop[i] = plant[i] * c
        s = 1.0 / abs(1.0 + loop[i])
        ms, mt, mks = max(ms, s), max(mt, abs(loop[i]) * s), max(mks, abs(c) * s)
    if _encirclements(omega, loop, 1.0) != 0:
        return math.inf, math.inf, math.inf
    return ms, mt, mks


@njit(cache=True, nogil=True)
def _grid(dead, small, large, finer):  # type: ignore[no-untyped-def]
    """Return the step, the whole steps of dead time and the share of a step left over (only without whole steps)."""
    step = min((dead + small) / 32.0, large / 8.0) / finer
    if dead < step / 20.0:
        return step, 0, dead / step
    whole = math.ceil(dead / step)
    return dead / whole, whole, 0.0


@njit(cache=True, nogil=True)
def swing(heater, gain, tn, tv, setpoint, load, finer):  # type: ignore[no-untyped-def]
    """Return ∫v and ∫t·v of v, the part of the deviation whose sign is not that of ∫e dt; infinite where it diverges.

    Args:
        heater: (k [°C/%], larger lag, smaller lag (0: none), dead time [s]).
        gain, tn, tv: of the controller.
        setpoint, load: height of the step in setpoint [°C] and load [%]; one of them is 0.
        finer: factor of the number of steps.
    """
    k, first, second, dead = heater
    h, whole, late = _grid(dead, second, first, finer)
    if second > 0.9999 * first:
        second = 0.9999 * first  # equal lags are moved apart; the answer changes by 1e-9
    a1, a2 = math.exp(-h / first), math.exp(-h / second) if second > 0.0 else 0.0
    s1, s2 = k * first / (first - second), -k * second / (first - second)
    n1 = 1.0 - (1.0 - a1) * first / h
    n2 = 1.0 - (1.0 - a2) * second / h
    o1, o2 = 1.0 - a1 - n1, 1.0 - a2 - n2
    new = s1 * n1 + s2 * n2
    past = DERIVATIVE_FILTER_N if tv > 0.0 else 0.0
    af = math.exp(-h * DERIVATIVE_FILTER_N / tv) if tv > 0.0 else 0.0
    nf = 1.0 - (1.0 - af) * tv / (DERIVATIVE_FILTER_N * h)
    of = 1.0 - af - nf
    direct = gain * (1.0 + 0.5 * h / tn + past * (1.0 - nf))
    sign = 1.0 if setpoint > 0.0 else -1.0
    ended = tn / (gain * k) * setpoint - tn / gain * load
    queue = np.zeros(whole + 1)
    x1 = x2 = y = summed = filtered = area = moment = peak = 0.0
    e = setpoint
    u = gain * (1.0 + past) * setpoint
    queue[0] = u
    quiet = 0
    for i in range(_MOST_STEPS):
        if whole > 0:
            left = queue[(i - whole) % (whole + 1)] if i >= whole else 0.0
            right = queue[(i + 1 - whole) % (whole + 1)] if i >= whole else 0.0
        else:
            left, right = u, 0.0
        left += load
        free = a1 * x1 * s1 + a2 * x2 * s2 + (s1 * o1 + s2 * o2) * left
        rest = gain * ((summed + 0.5 * h * e) / tn - past * (af * filtered + of * e))
        if whole > 0:
            right += load
        else:
            share = 1.0 - late
            known = late * u + load + share * (rest + direct * setpoint)
            right = (known - share * direct * free) / (1.0 + share * direct * new)
        y = free + new * right
        x1 = a1 * x1 + o1 * left + n1 * right
        x2 = a2 * x2 + o2 * left + n2 * right
        before, e = e, setpoint - y
        summed += 0.5 * h * (before + e)
        filtered = af * filtered + of * before + nf * e
        u = rest + direct * e
        queue[(i + 1) % (whole + 1)] = u
        v, w = -sign * before, -sign * e
        t = i * h + (dead if load != 0.0 else 0.0)
        if v > 0.0 or w > 0.0:
            if v >= 0.0 and w >= 0.0:
                area += 0.5 * h * (v + w)
                moment += 0.5 * h * (v * t + w * (t + h))
            else:
                part = max(v, w) / (abs(v) + abs(w)) * h
                area += 0.5 * part * max(v, w)
                moment += 0.5 * part * max(v, w) * (t if v > 0.0 else t + h)
        peak = max(peak, abs(e))
        if peak > 1e6 * (k * abs(load) + setpoint):
            return math.inf, math.inf
        quiet = quiet + 1 if abs(e) < _REST * peak and abs(summed - ended) < _REST * abs(ended) * 10.0 else 0
        if quiet > 2 * whole + 20:
            break
    return area, moment


@njit(cache=True, nogil=True)
def _bound(heaters, weights, gain, tn):  # type: ignore[no-untyped-def]
    """Return the cost of a response that never changes its sign: no loop with these settings costs less."""
    told = 0.0
    for p in range(len(heaters)):
        k = heaters[p, 0]
        ie = tn / gain
        told += (weights[p, 0] + weights[p, 3]) * ie + weights[p, 1] * ie / k
        told += weights[p, 2] * ie * ie * (1.0 / k + gain)  # ∫t·e dt = −Y′(0) with Y = 1/(s/G + s·C)
    return told


@njit(cache=True, nogil=True)
def price(heaters, weights, gain, tn, tv, finer):  # type: ignore[no-untyped-def]
    """Return the cost: Σ over heaters and objectives of weight·value.

    Args:
        heaters: k, lags and dead time of each, shape (p, 4).
        weights: of load IAE, setpoint IAE, load ITAE and TN/K, shape (p, 4).
        gain, tn, tv: of the controller.
        finer: factor of the number of steps.
    """
    total = _bound(heaters, weights, gain, tn)
    for p in range(len(heaters)):
        heater = (heaters[p, 0], heaters[p, 1], heaters[p, 2], heaters[p, 3])
        if weights[p, 0] > 0.0 or weights[p, 2] > 0.0:
            area, moment = swing(heater, gain, tn, tv, 0.0, 1.0, finer)
            total += 2.0 * (weights[p, 0] * area + weights[p, 2] * moment)
        if weights[p, 1] > 0.0:
            total += 2.0 * weights[p, 1] * swing(heater, gain, tn, tv, 1.0, 0.0, finer)[0]
    return total


@njit(cache=True, nogil=True)
def _inside(heaters, weights, bottom, top, tn, tv, at_top, finer):  # type: ignore[no-untyped-def]
    """Return the best cost and gain below the top of a piece, by golden section; the bound closes the range below."""
    a = math.log(max(bottom, top * _bound(heaters, weights, top, tn) / at_top))
    b = math.log(top)
    golden = 0.5 * (math.sqrt(5.0) - 1.0)
    c, d = b - golden * (b - a), a + golden * (b - a)
    fc = price(heaters, weights, math.exp(c), tn, tv, finer)
    fd = price(heaters, weights, math.exp(d), tn, tv, finer)
    while b - a > 1e-5:
        if fc < fd:
            b, d, fd = d, c, fc
            c = b - golden * (b - a)
            fc = price(heaters, weights, math.exp(c), tn, tv, finer)
        else:
            a, c, fc = c, d, fd
            d = a + golden * (b - a)
            fd = price(heaters, weights, math.exp(d), tn, tv, finer)
    return (fc, math.exp(c)) if fc < fd else (fd, math.exp(d))


@njit(cache=True, nogil=True)
def reduced(omega, plant, heaters, weights, limits, tn, tv, best, finer):  # type: ignore[no-untyped-def]
    """Return the least cost over K at one TN and TV, and that K; infinite where it cannot be below `best`."""
    bottoms, tops = pieces(omega, plant, tn, tv, limits)
    cost, gain = math.inf, 0.0
    for j in range(len(tops)):
        top = tops[j]
        lowest = _bound(heaters, weights, top, tn)
        if lowest >= min(best, cost):
            break  # lower pieces have higher bounds
        found, at = price(heaters, weights, top, tn, tv, finer), top
        if found > lowest * (1.0 + 1e-7):
            near = top * 0.999
            if near > bottoms[j] and price(heaters, weights, near, tn, tv, finer) < found:
                found, at = _inside(heaters, weights, bottoms[j], top, tn, tv, found, finer)
        if found < cost:
            cost, gain = found, at
    return cost, gain


@njit(cache=True, nogil=True)
def scan(omega, plant, heaters, weights, limits, tns, tvs, best, finer):  # type: ignore[no-untyped-def]
    """Return (cost, K, TN, TV) of the best point of a grid that is below `best`; cost `best` where there is none."""
    found = (best, 0.0, 0.0, 0.0)
    for tn in tns:
        for tv in tvs:
            cost, gain = reduced(omega, plant, heaters, weights, limits, tn, tv, found[0], finer)
            if cost < found[0]:
                found = (cost, gain, tn, tv)
    return found


@njit(cache=True, nogil=True)
def refine(omega, plant, heaters, weights, limits, start, stride, least, finer):  # type: ignore[no-untyped-def]
    """Return (cost, K, TN, TV) of the local optimum: a cross and its diagonals around the best point, halved at rest.

    Args:
        omega, plant, heaters, weights, limits: as in `pieces` and `price`.
        start: (cost, K, TN, TV).
        stride, least: first and last distance, in ln TN and ln TV.
        finer: factor of the number of steps.
    """
    best = start
    flat = start[3] == 0.0
    while stride > least:
        centre, moved = best, False
        for i in range(-2, 3):
            for j in range(0 if flat else -2, 1 if flat else 3):
                if i == 0 and j == 0:
                    continue
                tn, tv = centre[2] * math.exp(0.5 * i * stride), centre[3] * math.exp(0.5 * j * stride)
                cost, gain = reduced(omega, plant, heaters, weights, limits, tn, tv, best[0], finer)
                if cost < best[0] * (1.0 - 1e-12):
                    best, moved = (cost, gain, tn, tv), True
        if not moved:
            stride *= 0.4
    return best
