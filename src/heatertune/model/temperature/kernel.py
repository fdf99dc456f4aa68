"""The closed loop that runs inside a fit: one or two lags, exact dead time, a controller law handed in.

The law sees the simulated temperature, as the controller saw the real one. It runs every `h` seconds
and its output is held in between; between two calls the plant's answer is exact. All instants are multiples of `h`
after the start.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from heatertune.compiled import compile_function
from heatertune.heater.exact import advance_step, factors
from heatertune.model.temperature.law import ControllerLaw
from heatertune.plain import bound

__all__ = ["CONSTANTS", "OWN", "PLANT", "simulate_many"]

Array = npt.NDArray[np.float64]
Whole = npt.NDArray[np.int64]

#: a vector begins with the plant, gain and time constant by their logarithms; lag ratio: of the second lag, 0: one lag
PLANT = ("gain_degC_per_pct", "time_constant_s", "lag_ratio", "dead_time_s")
#: what a log has of its own in a vector, before its law's constants; from the event on the setpoint is a step higher
OWN = ("ambient_degC", "start_degC", "inner_start_degC", "setpoint_degC", "setpoint_step_degC", "event_s")
#: most constants of a law
CONSTANTS = 4


def _step(form: int, constants: Array, memory: Array, error: float, h: float) -> float:
    """Stand in for a controller's law, see `heatertune.compiled.bound`."""
    raise NotImplementedError


def simulate_many(law: ControllerLaw, z: Array, own: int, h: float, readings: Whole, out: Array, at: int) -> None:
    """Write the temperature of n loops at the readings into the columns of out (n, m) from `at` on [°C].

    Args:
        law: of the controller.
        z: vectors, shape (n, p): `PLANT`, and from the place `own` on `OWN` and the law's constants.
        own: that place.
        h: interval between scans [s].
        readings: scans before which the temperature was read, in order, shape (k,).
        out: of row after row, in C's order.
        at: column of the first reading.
    """
    run = compile_function(bound(_simulate_many, _step=law.step))
    logarithmic = np.array([float(constant.logarithmic) for constant in law.constants])
    run(law.form, np.ascontiguousarray(z), own, logarithmic, float(h), readings, np.empty(4), np.zeros(CONSTANTS),
        np.empty(int(readings[-1]) + 1), out, at)


def _simulate_many(  # noqa: PLR0913 - compiled for the types of each
    form: int, z: Array, own: int, logarithmic: Array, h: float, readings: Whole, memory: Array, constants: Array,
    power: Array, out: Array, at: int,
) -> None:
    """Fill out, arguments as above; `logarithmic`: 1 for each of the law's constants that is so given, else 0.

    Memory (4,), constants (4,) and power (scans,) are working space.
    """
    scans = len(power)
    for i in range(out.shape[0]):
        gain, first, ratio, dead = math.exp(z[i, 0]), math.exp(z[i, 1]), z[i, 2], z[i, 3]
        ambient, y = z[i, own], z[i, own + 1]
        x = z[i, own + 2] if ratio > 0.0 else y
        before, after = z[i, own + 3], z[i, own + 3] + z[i, own + 4]
        event = int(min(z[i, own + 5] / h, float(scans)))
        for k in range(len(logarithmic)):
            constants[k] = z[i, own + 6 + k]
            if logarithmic[k] != 0.0:
                constants[k] = math.exp(constants[k])
        whole = int(dead / h)
        late = dead - whole * h  # the older power value still acts for this long
        outer, inner = (ratio * first, first) if ratio > 0.0 else (first, 0.0)
        begin, end = factors(late, outer, inner), factors(h - late, outer, inner)
        for k in range(len(memory)):
            memory[k] = 0.0
        read = 0
        for k in range(scans):
            while read < len(readings) and readings[read] == k:
                out[i, at + read] = y
                read += 1
            power[k] = _step(form, constants, memory, (before if k < event else after) - y, h)
            older = power[k - whole - 1] if k > whole else 0.0
            newer = power[k - whole] if k >= whole else 0.0
            y, x = advance_step(y, x, ambient + gain * older, begin)
            y, x = advance_step(y, x, ambient + gain * newer, end)
