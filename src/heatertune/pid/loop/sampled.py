"""The loop as a PLC runs it: a sampled controller, a power held between samples, exact fractional dead time.

Controller, backward difference, with the derivative filter D_k = f·D_{k−1} + (1 − f)·TV/TA·(e_k − e_{k−1}); f is ½ in
OB251 and 0 in controllers without a filter:

    C(z) = K·[1 + TA/TN·1/(1 − 1/z) + (1 − f)·TV/TA·(1 − 1/z)/(1 − f/z)]

Plant: each lag as a first-order mode behind a hold; a dead time of d samples and a fraction splits each input
between two samples (the modified z-transform; K. J. Åström and B. Wittenmark, "Computer-Controlled Systems",
3rd ed., section 2.3).

A search asks for the same plant at the same frequencies again and again: plants, frequencies and responses are kept,
and read-only.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from heatertune.heater.exact import apart
from heatertune.model.values import HeaterModel, TwoLag
from heatertune.pid.values import PidDesign

__all__ = [
    "SampledPlant", "combine_responses", "controller_response", "frequencies", "part_responses", "parts_seen",
    "plant_seen",
    "sample_plant",
]

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
_Numbers = TypeVar("_Numbers", Array, Complex)

_KEPT = 64  # of each; a response takes up to 72 kB


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SampledPlant:
    """G behind a hold, as modes in parallel: x⁺ = pole·x + now·u[k−delay] + before·u[k−delay−1].

    Attributes:
        poles, now, before: per mode, shape (m,); the output is the sum of the modes [°C].
        delay: whole samples of dead time.
        sample_time_s: TA [s].
    """

    poles: Array
    now: Array
    before: Array
    delay: int
    sample_time_s: float

    def frequency_response(self, omega: Array) -> Complex:
        """Return the pulse transfer function at e^(jω·TA) [°C/%], shape (n,)."""
        z = np.exp(1j * np.asarray(omega) * self.sample_time_s)
        modes = (self.now[:, None] + self.before[:, None] / z) / (z - self.poles[:, None])
        return np.asarray(modes.sum(axis=0) * z ** (-self.delay))


@lru_cache(maxsize=_KEPT)
def sample_plant(model: HeaterModel, sample_time_s: float, *, computing_delay_s: float = 0.0) -> SampledPlant:
    """Return the plant seen by a controller that acts every `sample_time_s` and a hold [s]."""
    dead = model.dead_time_s + computing_delay_s
    delay = math.floor(dead / sample_time_s)
    late = dead - delay * sample_time_s
    lags, shares = _modes(model)
    whole = np.exp(-sample_time_s / lags)
    rest = np.exp(-(sample_time_s - late) / lags)
    gains = model.gain_degC_per_pct * shares
    return SampledPlant(
        poles=_kept(whole), now=_kept(gains * (1.0 - rest)), before=_kept(gains * (rest - whole)), delay=delay,
        sample_time_s=sample_time_s,
    )


def controller_response(design: PidDesign, omega: Array) -> Complex:
    """Return C(e^(jω·TA)) [%/°C], shape (n,)."""
    return combine_responses(design, part_responses(omega, design.sample_time_s, design.derivative_filter))


def combine_responses(design: PidDesign, parts: Complex) -> Complex:
    """Return C [%/°C], shape (n,), from the responses of its parts, shape (3, n)."""
    proportional, summed, difference = parts
    integral = design.sample_time_s / design.integral_time_s
    derivative = design.derivative_time_s / design.sample_time_s
    return np.asarray(design.gain_pct_per_degC * (proportional + integral * summed + derivative * difference))


def part_responses(omega: Array, sample_time_s: float, derivative_filter: float) -> Complex:
    """Return what the P, I and D part make of an error at e^(jω·TA), per unit of kP, kI, kD, shape (3, n).

    P: 1; I: 1/(1 − z⁻¹), the sum; D: (1 − f)·(1 − z⁻¹)/(1 − f·z⁻¹), the filtered difference.
    """
    backward = np.exp(-1j * np.asarray(omega) * sample_time_s)
    past = derivative_filter
    difference = (1.0 - past) * (1.0 - backward) / (1.0 - past * backward)
    return np.stack([np.ones_like(backward), 1.0 / (1.0 - backward), difference])


@lru_cache(maxsize=_KEPT)
def plant_seen(model: HeaterModel, sample_time_s: float, slowest_s: float, n: int = 1500) -> Complex:
    """Return the plant's pulse transfer function [°C/%] at `frequencies`, shape (n,)."""
    return _kept(sample_plant(model, sample_time_s).frequency_response(frequencies(sample_time_s, slowest_s, n)))


@lru_cache(maxsize=_KEPT)
def parts_seen(derivative_filter: float, sample_time_s: float, slowest_s: float, n: int = 1500) -> Complex:
    """Return `part_responses` at `frequencies`, shape (3, n)."""
    return _kept(part_responses(frequencies(sample_time_s, slowest_s, n), sample_time_s, derivative_filter))


@lru_cache(maxsize=_KEPT)
def frequencies(sample_time_s: float, slowest_s: float, n: int = 1500) -> Array:
    """Return frequencies from far below 1/`slowest_s` up to half the sampling frequency, shape (n,) [rad/s]."""
    return _kept(np.geomspace(min(1e-3 / slowest_s, 1e-2 * math.pi / sample_time_s), math.pi / sample_time_s, n))


def _kept(array: _Numbers) -> _Numbers:
    array.flags.writeable = False
    return array


def _modes(model: HeaterModel) -> tuple[Array, Array]:
    if not isinstance(model, TwoLag):
        return np.array([model.time_constant_s]), np.ones(1)
    first, second = apart(*model.lags_s)
    return np.array([first, second]), np.array([first, -second]) / (first - second)
