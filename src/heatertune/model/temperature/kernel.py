"""The compiled closed loop that runs inside a fit: one or two lags, exact dead time, a controller law handed in.

The law sees the simulated temperature, as the controller saw the real one. It runs every `h` seconds
and its output is held in between; between two calls the plant's answer is exact. A plant is the row
(gain, time constant, ratio of the second lag to the first (0: one lag), dead time, ambient, initial temperature,
initial inner state), units as in `model.values`; all instants are multiples of `h` after the start.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

__all__ = ["PLANT", "simulate_many"]

#: names of the plant's numbers, in the order of the row
PLANT = ("gain", "time_constant", "lag_ratio", "dead_time", "ambient", "start", "inner_start")


@njit(cache=True)
def _coupling(first, second, t):  # type: ignore[no-untyped-def]
    """Return what the inner lag's deviation adds to the outer one after t seconds."""
    if abs(first - second) < 1e-6 * first:
        return t / first * math.exp(-t / first)
    return first / (first - second) * (math.exp(-t / first) - math.exp(-t / second))


@njit(cache=True)
def _advance(y, x, target, decay_1, decay_2, coupling, two_lags):  # type: ignore[no-untyped-def]
    """Return (y, x) after a time with constant power whose steady temperature is `target`."""
    inner = target + decay_1 * (x - target)
    if two_lags:
        return target + decay_2 * (y - target) + coupling * (x - target), inner
    return target + decay_1 * (y - target), inner


@njit(cache=True, nogil=True)
def simulate_many(step, plants, laws, setpoints, h, n_scans, event_scans):  # type: ignore[no-untyped-def]
    """Return the temperature before each scan, shape (m, n_scans), for m rows of plants and laws.

    Args:
        step: compiled law, see `model.law.ControllerLaw.step`.
        plants: shape (m, 7), see `PLANT`.
        laws: shape (m, q), the law's constants.
        setpoints: shape (m, 2), before the event and from it on.
        h: interval between scans [s].
        n_scans: number of scans.
        event_scans: shape (m,), scan from which the second setpoint holds.
    """
    m = plants.shape[0]
    out = np.empty((m, n_scans))
    power = np.empty(n_scans)
    for i in range(m):
        gain, first, ratio, dead = plants[i, 0], plants[i, 1], plants[i, 2], plants[i, 3]
        ambient, y, x = plants[i, 4], plants[i, 5], plants[i, 6]
        two_lags = ratio > 0.0
        second = ratio * first if two_lags else first
        whole = int(dead / h)
        late = dead - whole * h  # the older power value still acts for this long
        rest = h - late
        a1, b1 = math.exp(-late / first), math.exp(-rest / first)
        a2, b2 = math.exp(-late / second), math.exp(-rest / second)
        ac = _coupling(first, second, late) if two_lags else 0.0
        bc = _coupling(first, second, rest) if two_lags else 0.0
        memory = np.zeros(4)
        constants = laws[i].copy()
        for k in range(n_scans):
            out[i, k] = y
            setpoint = setpoints[i, 0] if k < event_scans[i] else setpoints[i, 1]
            power[k] = step(constants.ctypes, memory.ctypes, setpoint - y, h)
            older = power[k - whole - 1] if k > whole else 0.0
            newer = power[k - whole] if k >= whole else 0.0
            y, x = _advance(y, x, ambient + gain * older, a1, a2, ac, two_lags)
            y, x = _advance(y, x, ambient + gain * newer, b1, b2, bc, two_lags)
    return out

