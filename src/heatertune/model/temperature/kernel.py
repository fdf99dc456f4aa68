"""The closed loop that runs inside a fit: one or two lags, exact dead time, a controller law handed in.

The law sees the simulated temperature, as the controller saw the real one. It runs every `h` seconds
and its output is held in between; between two calls the plant's answer is exact. A plant is the row
(gain, time constant, ratio of the second lag to the first (0: one lag), dead time, ambient, initial temperature,
initial inner state), units as in `model.values`; all instants are multiples of `h` after the start.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from heatertune.compiled import bound, compiled
from heatertune.heater.exact import advanced, factors
from heatertune.model.temperature.law import Step

__all__ = ["PLANT", "simulate_many"]

Array = npt.NDArray[np.float64]
Whole = npt.NDArray[np.int64]

#: names of the plant's numbers, in the order of the row
PLANT = ("gain", "time_constant", "lag_ratio", "dead_time", "ambient", "start", "inner_start")


def _step(form: int, constants: Array, memory: Array, error: float, h: float) -> float:
    """Stand in for a controller's law, see `heatertune.compiled.bound`."""
    raise NotImplementedError


def simulate_many(
    step: Step, form: int, plants: Array, laws: Array, setpoints: Array, h: float, n_scans: int, event_scans: Whole
) -> Array:
    """Return the temperature before each scan, shape (m, n_scans), for m rows of plants and laws.

    Args:
        step: see `model.temperature.law.ControllerLaw`.
        form: likewise.
        plants: shape (m, 7), see `PLANT`.
        laws: shape (m, q), the law's constants.
        setpoints: shape (m, 2), before the event and from it on.
        h: interval between scans [s].
        n_scans: number of scans.
        event_scans: shape (m,), scan from which the second setpoint holds.
    """
    out = np.empty((len(plants), n_scans))
    run = compiled(bound(_simulate_many, _step=step))
    run(form, plants, laws, setpoints, float(h), event_scans, np.empty(4), np.empty(n_scans), out)
    return out


def _simulate_many(  # noqa: PLR0913 - compiled for the types of each
    form: int, plants: Array, laws: Array, setpoints: Array, h: float, event_scans: Whole, memory: Array, power: Array,
    out: Array,
) -> None:
    """Fill out, arguments as above; memory (4,) and power (n_scans,) are working space."""
    for i in range(out.shape[0]):
        gain, first, ratio, dead = plants[i, 0], plants[i, 1], plants[i, 2], plants[i, 3]
        ambient, y, x = plants[i, 4], plants[i, 5], plants[i, 6]
        whole = int(dead / h)
        late = dead - whole * h  # the older power value still acts for this long
        outer, inner = (ratio * first, first) if ratio > 0.0 else (first, 0.0)
        begin, end = factors(late, outer, inner), factors(h - late, outer, inner)
        for k in range(len(memory)):
            memory[k] = 0.0
        for k in range(out.shape[1]):
            out[i, k] = y
            setpoint = setpoints[i, 0] if k < event_scans[i] else setpoints[i, 1]
            power[k] = _step(form, laws[i], memory, setpoint - y, h)
            older = power[k - whole - 1] if k > whole else 0.0
            newer = power[k - whole] if k >= whole else 0.0
            y, x = advanced(y, x, ambient + gain * older, begin)
            y, x = advanced(y, x, ambient + gain * newer, end)
