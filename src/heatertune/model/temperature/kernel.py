"""The closed loop that runs inside a fit: one or two lags, exact dead time, a controller law handed in.

The law sees the simulated temperature, as the controller saw the real one. It runs every `h` seconds
and its output is held in between; between two calls the plant's answer is exact. A plant is the row
(gain, time constant, ratio of the second lag to the first (0: one lag), dead time, ambient, initial temperature,
initial inner state), units as in `model.values`; all instants are multiples of `h` after the start.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from heatertune.compiled import bound, compiled
from heatertune.model.temperature.law import Step

__all__ = ["PLANT", "simulate_many"]

Array = npt.NDArray[np.float64]
Whole = npt.NDArray[np.int64]

#: names of the plant's numbers, in the order of the row
PLANT = ("gain", "time_constant", "lag_ratio", "dead_time", "ambient", "start", "inner_start")


def _step(constants: Array, memory: Array, error: float, h: float) -> float:
    """Stand in for a controller's law, see `heatertune.compiled.bound`."""
    raise NotImplementedError


def _coupling(first: float, second: float, t: float) -> float:
    """Return what the inner lag's deviation adds to the outer one after t seconds."""
    if abs(first - second) < 1e-6 * first:
        return t / first * math.exp(-t / first)
    return first / (first - second) * (math.exp(-t / first) - math.exp(-t / second))


def _advance(
    y: float, x: float, target: float, decay_1: float, decay_2: float, coupling: float, two_lags: bool
) -> tuple[float, float]:
    """Return (y, x) after a time with constant power whose steady temperature is `target`."""
    inner = target + decay_1 * (x - target)
    if two_lags:
        return target + decay_2 * (y - target) + coupling * (x - target), inner
    return target + decay_1 * (y - target), inner


def simulate_many(
    step: Step, plants: Array, laws: Array, setpoints: Array, h: float, n_scans: int, event_scans: Whole
) -> Array:
    """Return the temperature before each scan, shape (m, n_scans), for m rows of plants and laws.

    Args:
        step: see `model.temperature.law.ControllerLaw.step`.
        plants: shape (m, 7), see `PLANT`.
        laws: shape (m, q), the law's constants.
        setpoints: shape (m, 2), before the event and from it on.
        h: interval between scans [s].
        n_scans: number of scans.
        event_scans: shape (m,), scan from which the second setpoint holds.
    """
    out = np.empty((len(plants), n_scans))
    run = compiled(bound(_simulate_many, _step=step))
    run(plants, laws, setpoints, float(h), event_scans, np.empty(4), np.empty(n_scans), out)
    return out


def _simulate_many(
    plants: Array, laws: Array, setpoints: Array, h: float, event_scans: Whole, memory: Array, power: Array, out: Array
) -> None:
    """Fill out, arguments as above; memory (4,) and power (n_scans,) are working space."""
    for i in range(out.shape[0]):
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
        for k in range(len(memory)):
            memory[k] = 0.0
        for k in range(out.shape[1]):
            out[i, k] = y
            setpoint = setpoints[i, 0] if k < event_scans[i] else setpoints[i, 1]
            power[k] = _step(laws[i], memory, setpoint - y, h)
            older = power[k - whole - 1] if k > whole else 0.0
            newer = power[k - whole] if k >= whole else 0.0
            y, x = _advance(y, x, ambient + gain * older, a1, a2, ac, two_lags)
            y, x = _advance(y, x, ambient + gain * newer, b1, b2, bc, two_lags)
