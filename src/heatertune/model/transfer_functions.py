"""Transfer functions of python-control → heater models, the inverse of `Dynamics.to_tf`.

Continuous: one or two real lags, and the dead time as a Padé approximant of any order, which is recognised by its
zeros: they are the poles of its denominator, mirrored. Sampled with held power: exact, the dead time included.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from heatertune.errors import InputError
from heatertune.heater.exact import since_step
from heatertune.model.model_values import Fopdt, TwoLag

if TYPE_CHECKING:
    from heatertune.arrays import Array
    from heatertune.model.model_values import HeaterModel

__all__ = ["LinearSystem", "heater_from"]

_ALIKE = 1e-3  # relative distance of a pole from the mirrored zero of its Padé approximant
_EXPECTED = "a gain, one or two real lags and a dead time"


class LinearSystem(Protocol):
    """What is read of a transfer function of python-control, which has no types of its own."""

    num: Any
    den: Any
    dt: Any


def heater_from(system: LinearSystem, *, ambient_degC: float | None = None) -> HeaterModel:
    """Return the heater that a transfer function of python-control describes, from power [%] to temperature rise [°C].

    Args:
        system: continuous, or sampled with held power; one input and one output.
        ambient_degC: temperature without power [°C], None if unknown.

    Raises:
        InputError: no transfer function, or one that is no heater with one or two lags and a dead time.
    """
    if not (hasattr(system, "num") and hasattr(system, "den") and np.shape(system.num)[:2] == (1, 1)):
        raise InputError(f"no heater: {type(system).__name__}; expected a transfer function of python-control with one "
                         "input and one output")
    above, below = (np.trim_zeros(np.asarray(part[0][0], dtype=float), "f") for part in (system.num, system.den))
    if not len(above) or not len(below):
        raise InputError(f"no heater: a transfer function of zero; expected {_EXPECTED}")
    gain, lags, dead_time = (
        _sampled(above, below, float(system.dt)) if system.dt else _continuous(above, below))
    named: dict[str, Any] = {"gain_degC_per_pct": gain, "dead_time_s": dead_time, "ambient_degC": ambient_degC}
    if len(lags) == 1:
        return Fopdt(time_constant_s=lags[0], **named)
    return TwoLag(time_constant_s=lags[0], second_time_constant_s=lags[1], **named)


def _continuous(above: Array, below: Array) -> tuple[float, list[float], float]:
    """Return gain, lags, the largest first, and dead time."""
    zeros, poles = np.roots(above), list(np.roots(below))
    for zero in zeros:
        nearest = min(range(len(poles)), key=lambda i: abs(poles[i] + zero), default=None)
        if zero.real <= 0.0 or nearest is None or abs(poles[nearest] + zero) > _ALIKE * abs(zero):
            raise InputError(f"no heater: a zero at {zero:.4g} that no Padé approximant has; expected {_EXPECTED}")
        poles.pop(nearest)
    lags = _lags([-1.0 / pole if pole else math.inf for pole in poles])
    # of exp(-L·s) the approximant is P(-s)/P(s) with P'(0)/P(0) = L/2, and the sum of -1/pole is P'(0)/P(0)
    return float(above[-1] / below[-1]), lags, float(2.0 * np.sum(1.0 / zeros).real) if len(zeros) else 0.0


def _sampled(above: Array, below: Array, sample_time_s: float) -> tuple[float, list[float], float]:
    """Return gain, lags and dead time: the rise of the step response after its last zero gives its fraction of TA."""
    poles = np.roots(np.trim_zeros(below, "b"))
    if np.any(np.abs(poles.imag) > 1e-9) or np.any(poles.real <= 0.0) or np.any(poles.real >= 1.0):
        raise InputError(f"no heater: poles at {np.round(poles, 4).tolist()}; expected {_EXPECTED}")
    lags = _lags([-sample_time_s / math.log(pole.real) for pole in poles])
    gain = float(np.sum(above) / np.sum(below))
    whole = len(below) - len(above) - 1
    first = float(above[0] / below[0]) / gain  # of the step response, as a part of the end
    since = _instant(first, lags)
    if not 0.0 < since <= sample_time_s * (1.0 + 1e-9):
        raise InputError(f"no heater: its first sample rises by {first:.4g} of the end; expected {_EXPECTED}")
    return gain, lags, max((whole + 1) * sample_time_s - since, 0.0)


def _instant(rise: float, lags: list[float]) -> float:
    """Return when the unit step response of lags has risen so far [s]; infinite if never."""
    from scipy.optimize import brentq

    if not 0.0 < rise < 1.0:
        return math.inf
    return float(brentq(lambda t: float(since_step(np.array([t]), *lags)[0][0]) - rise, 0.0, 100.0 * lags[0]))


def _lags(times: list[complex]) -> list[float]:
    if not 1 <= len(times) <= 2 or any(abs(complex(each).imag) > 1e-6 * abs(each) for each in times):
        raise InputError(f"no heater: {len(times)} lags; expected {_EXPECTED}")
    lags = sorted((float(complex(each).real) for each in times), reverse=True)
    if lags[-1] <= 0.0 or not math.isfinite(lags[0]):
        raise InputError(f"no heater: it does not come to rest; expected {_EXPECTED}")
    return lags
