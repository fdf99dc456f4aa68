"""Transfer functions of python-control → heater models, the inverse of `Dynamics.to_tf`.

Continuous: one or two real lags, a zero between two of them, and the dead time as a Padé approximant of any order,
which is recognised by its zeros: they are the poles of its denominator, mirrored. Sampled with held power: exact, the
dead time included.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final, Protocol

import numpy as np
import numpy.typing as npt

from heatertune.errors import InputError
from heatertune.heater.exact import since_step
from heatertune.model.two_scales import heater_of_numbers

if TYPE_CHECKING:
    from heatertune.arrays import Array
    from heatertune.model.model_values import HeaterModel

__all__ = ["LinearSystem", "heater_from"]

_ALIKE = 1e-3  # relative distance of a pole from the mirrored zero of its Padé approximant
_SAME_SAMPLES = 1e-6  # of the largest coefficient: a sampled heater's numerator agrees as closely as this
_EXPECTED = "a gain, one or two real lags, a zero between two of them or no zero, and a dead time"


#: what to do with what is no heater, by its type
_REMEDIES: Final = {
    "Log": ": fit(log) finds its model", "DataFrame": ": fit(frame) finds its model",
    "str": ": load(path) reads a model, fit(path) finds that of a log", "StateSpace": ": control.tf(system) is one",
    "PidDesign": ": the model comes first, then the design",
}


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
        InputError: no transfer function, or one that is no heater with one or two lags and a dead time; a zero that is
            not between two lags.
    """
    if not (hasattr(system, "num") and hasattr(system, "den") and np.shape(system.num)[:2] == (1, 1)):
        kind = type(system).__name__
        raise InputError(f"no heater: {kind}; expected a transfer function of python-control with one input and one "
                         f"output, or a model{_REMEDIES.get(kind, '')}")
    above, below = (np.trim_zeros(np.asarray(part[0][0], dtype=float), "f") for part in (system.num, system.den))
    if not len(above) or not len(below):
        raise InputError(f"no heater: a transfer function of zero; expected {_EXPECTED}")
    read = _sampled(above, below, float(system.dt)) if system.dt else _continuous(above, below)
    return replace(read, ambient_degC=ambient_degC)


def _heater(gain: float, lags: list[float], dead_time_s: float, zero_s: float | None) -> HeaterModel:
    """Return the heater of lags, the largest first, and the time of a zero, None: no zero.

    Raises:
        InputError: the zero is not between two lags.
    """
    if zero_s is not None and len(other := [lag for lag in lags if abs(zero_s - lag) >= _ALIKE * lag]) == 1:
        lags, zero_s = other, None  # the zero cancels a lag
    second = lags[1] if len(lags) > 1 else None
    if zero_s is None:
        return heater_of_numbers(gain_degC_per_pct=gain, time_constant_s=lags[0], second_time_constant_s=second,
                                 dead_time_s=dead_time_s)
    if second is None or not second <= zero_s * (1.0 + _ALIKE) <= lags[0] * (1.0 + 2.0 * _ALIKE):
        raise InputError(f"no heater: a zero at {-1.0 / zero_s:.4g} with lags of "
                         f"{' and '.join(f'{lag:.4g}' for lag in lags)} s; expected {_EXPECTED}")
    return heater_of_numbers(
        gain_degC_per_pct=gain, time_constant_s=lags[0], second_time_constant_s=second, dead_time_s=dead_time_s,
        zero_s=min(max(zero_s, second), lags[0]))


def _continuous(above: Array, below: Array) -> HeaterModel:
    """Return the heater; a Padé approximant's zeros are right of the imaginary axis, its own is left of it."""
    zeros, poles = np.roots(above).astype(np.complex128), list(np.roots(below))
    own = _own_zero(zeros)
    if own is not None:
        zeros = zeros[zeros.real >= 0.0]
    for zero in zeros:
        nearest = min(range(len(poles)), key=lambda i: abs(poles[i] + zero), default=None)
        if zero.real <= 0.0 or nearest is None or abs(poles[nearest] + zero) > _ALIKE * abs(zero):
            raise InputError(f"no heater: a zero at {_number(zero)} that no Padé approximant has; expected {_EXPECTED}")
        poles.pop(nearest)
    lags = _lags([-1.0 / pole if pole else math.inf for pole in poles])
    # of exp(-L·s) the approximant is P(-s)/P(s) with P'(0)/P(0) = L/2, and the sum of -1/pole is P'(0)/P(0)
    dead_time_s = float(2.0 * np.sum(1.0 / zeros).real)
    return _heater(float(above[-1] / below[-1]), lags, dead_time_s, own)


def _number(value: complex) -> str:
    return f"{value if abs(value.imag) > _ALIKE * abs(value) else value.real:.4g}"


def _own_zero(zeros: npt.NDArray[np.complex128]) -> float | None:
    """Return the time of the one zero left of the imaginary axis, of shape (n,) zeros [s]; None: not just one."""
    left = zeros[zeros.real < 0.0]
    return -1.0 / float(left[0].real) if len(left) == 1 else None


def _sampled(above: Array, below: Array, sample_time_s: float) -> HeaterModel:
    """Return the heater: the rise of the step response after its last zero gives its fraction of TA.

    Without a zero of the heater the first sample that rises decides it, with one the first two.
    """
    poles = np.roots(np.trim_zeros(below, "b"))
    if np.any(np.abs(poles.imag) > 1e-9) or np.any(poles.real <= 0.0) or np.any(poles.real >= 1.0):
        raise InputError(f"no heater: poles at {np.round(poles, 4).tolist()}; expected {_EXPECTED}")
    lags = _lags([-sample_time_s / math.log(pole.real) for pole in poles])
    gain = float(np.sum(above) / np.sum(below))
    whole = len(below) - len(above) - 1
    rises = _rises(above, below, 2) / gain  # as parts of the end
    for since, zero_s in ((_instant(rises[0], lags), None), *_with_zero(rises, lags, sample_time_s)):
        if 0.0 < since <= sample_time_s * (1.0 + 1e-9):
            heater = _heater(gain, lags, max((whole + 1) * sample_time_s - since, 0.0), zero_s)
            count = len(above) + 2
            its = heater.step(sample_time_s * np.arange(whole + 1, whole + 1 + count))
            if np.max(np.abs(its / gain - _rises(above, below, count) / gain)) < _SAME_SAMPLES:
                return heater
    raise InputError(f"no heater: its first sample rises by {rises[0]:.4g} of the end, its second by {rises[1]:.4g}; "
                     f"expected {_EXPECTED}")


def _rises(above: Array, below: Array, count: int) -> Array:
    """Return the first samples of the step response that rise, shape (count,)."""
    rises = np.zeros(count)
    for k in range(count):
        before = sum(below[i] * rises[k - i] for i in range(1, min(k + 1, len(below))))
        rises[k] = (np.sum(above[: k + 1]) - before) / below[0]
    return rises


def _with_zero(rises: Array, lags: list[float], sample_time_s: float) -> list[tuple[float, float]]:
    """Return how long the dead time was over at the first sample, and the time of the zero [s]; empty without two lags.

    What is left of two lags in parallel, 1 − rise, falls as P·exp(−t/T1) + Q·exp(−t/T2); it was 1 at the dead time.
    """
    if len(lags) < 2 or lags[1] == lags[0]:
        return []
    slow, fast = lags
    decay = np.exp(-sample_time_s / np.array(lags))
    left = 1.0 - rises
    of_slow = (left[1] - left[0] * decay[1]) / (decay[0] - decay[1])
    of_fast = left[0] - of_slow
    if of_slow <= 0.0 or of_fast <= 0.0:
        return []

    def beyond(since: float) -> float:
        return float(of_slow * math.exp(since / slow) + of_fast * math.exp(since / fast) - 1.0)

    if not beyond(0.0) < 0.0 < beyond(1.01 * sample_time_s):
        return []
    since = _root(beyond, 1.01 * sample_time_s)
    return [(since, slow - float(of_slow) * math.exp(since / slow) * (slow - fast))]


def _instant(rise: float, lags: list[float]) -> float:
    """Return when the unit step response of lags has risen so far [s]; infinite if never."""
    if not 0.0 < rise < 1.0:
        return math.inf
    return _root(lambda t: float(since_step(np.array([t]), *lags)[0][0]) - rise, 100.0 * lags[0])


def _lags(times: list[complex]) -> list[float]:
    if not 1 <= len(times) <= 2 or any(abs(complex(each).imag) > 1e-6 * abs(each) for each in times):
        raise InputError(f"no heater: {len(times)} lags; expected {_EXPECTED}")
    lags = sorted((float(complex(each).real) for each in times), reverse=True)
    if lags[-1] <= 0.0 or not math.isfinite(lags[0]):
        raise InputError(f"no heater: it does not come to rest; expected {_EXPECTED}")
    return lags


def _root(beyond: Callable[[float], float], most: float) -> float:
    """Return where a rising function is 0, between 0 and `most`."""
    from scipy.optimize import brentq

    return float(brentq(beyond, 0.0, most))
