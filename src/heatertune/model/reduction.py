"""Two lags → one: the FOPDT that stands in for a heater and its sensor around the loop's crossover.

The half rule (`TwoLag.half_rule`) is made for one tuning rule; the matching here keeps the gain and puts lag and dead
time where the frequency responses agree best within an octave of the frequency at which a loop is cut.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from scipy.optimize import brentq, least_squares

from heatertune.model.values import Fopdt, HeaterModel, TwoLag

__all__ = ["crossover_rad_s", "matched"]

#: phase at which a PI loop with Ms about 1.6 is cut [°]: the controller and the phase margin take the rest
_CUT_DEG: Final = 120.0
_OCTAVES: Final = 0.5
_POINTS: Final = 60


def crossover_rad_s(model: HeaterModel) -> float:
    """Return the frequency at which the heater lags by 120°, where loops around it are cut [rad/s]."""
    slowest, quickest = sum(model.lags_s) + model.dead_time_s, min((*model.lags_s, model.dead_time_s or math.inf))

    def beyond(log_omega: float) -> float:
        return _lag_deg(model, math.exp(log_omega)) - _CUT_DEG

    low, high = math.log(1e-3 / slowest), math.log(1e3 / quickest)
    if beyond(high) < 0.0:  # one lag without dead time never lags by so much
        return math.exp(high)
    return math.exp(brentq(beyond, low, high, xtol=1e-10))


def _lag_deg(model: HeaterModel, omega: float) -> float:
    lags = sum(math.atan(lag * omega) for lag in model.lags_s)
    return math.degrees(lags + omega * model.dead_time_s)


def matched(model: HeaterModel) -> Fopdt:
    """Return the FOPDT with the same gain whose frequency response is nearest around the crossover.

    The relative error is weighed by a Gaussian over ln ω, half an octave wide, up to two of its widths to both sides.
    A heater of one lag is its own match.
    """
    if not isinstance(model, TwoLag):
        return model
    octave = math.log(2.0)
    spread = np.linspace(-2.0, 2.0, _POINTS)
    omega = crossover_rad_s(model) * np.exp(spread * _OCTAVES * octave)
    weight = np.exp(-0.5 * spread**2)
    response = model.frequency_response(omega)

    def candidate(z: np.ndarray) -> Fopdt:
        return Fopdt(
            gain_degC_per_pct=model.gain_degC_per_pct, time_constant_s=math.exp(z[0]), dead_time_s=float(z[1]),
            ambient_degC=model.ambient_degC,
        )

    def error(z: np.ndarray) -> np.ndarray:
        relative = weight * (candidate(z).frequency_response(omega) / response - 1.0)
        return np.concatenate([relative.real, relative.imag])

    start = model.half_rule()
    slowest = sum(model.lags_s) + model.dead_time_s
    solution = least_squares(
        error, [math.log(start.time_constant_s), start.dead_time_s],
        bounds=([math.log(1e-3 * slowest), 0.0], [math.log(1e2 * slowest), slowest]), x_scale=[1.0, slowest],
    )
    return candidate(solution.x)
