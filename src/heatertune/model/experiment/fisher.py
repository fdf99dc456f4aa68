"""How well an experiment makes a heater's numbers known, before it is made.

For white noise the covariance of the least-squares estimate is the inverse of the Fisher information JᵀJ/σ². Heater
residuals are coloured, and the output-error fit does not whiten them, so the covariance is
(JᵀJ)⁻¹·JᵀRJ·(JᵀJ)⁻¹ with the noise's covariance R (L. Ljung, "System Identification", 2nd ed. (1999), section 9.3).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.signal import lfilter

from heatertune.errors import OutOfRange
from heatertune.units import check

__all__ = ["ReadingNoise", "covariance"]

Array = npt.NDArray[np.float64]

_SINGULAR = 1e-9  # of the largest scaled column: what is left of one after the others explained it


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadingNoise:
    """What disturbs the readings.

    Attributes:
        std_degC: standard deviation of what the model cannot explain [°C].
        correlation: of that between two readings, a first-order autoregression [0…1).
        resolution_degC: step of the sensor's digits [°C]; each reading is off by up to half of it, uncorrelated.
        sample_time_s: interval between readings [s].

    Raises:
        OutOfRange: a negative number, a correlation of 1 or more, neither noise nor resolution.
    """

    std_degC: float
    sample_time_s: float
    correlation: float = 0.0
    resolution_degC: float = 0.0

    def __post_init__(self) -> None:
        check("std_degC", self.std_degC, least=0.0)
        check("resolution_degC", self.resolution_degC, least=0.0)
        check("sample_time_s", self.sample_time_s, above=0.0)
        check("correlation", self.correlation, least=0.0, most=0.999)
        if self.std_degC == 0.0 and self.resolution_degC == 0.0:
            raise OutOfRange("std_degC", 0.0, "> 0 where the resolution is 0: no sensor is perfect")

    @property
    def white_variance(self) -> float:
        """Variance of the rounding to the sensor's digits [°C²]."""
        return self.resolution_degC**2 / 12.0

    def nearest_reading(self, time_s: float) -> float:
        """Return the instant of the nearest reading [s]."""
        return round(time_s / self.sample_time_s) * self.sample_time_s

    def average(self, times: int) -> ReadingNoise:
        """Return the noise of the means of `times` readings each, which hold nearly all that the readings tell."""
        if times == 1:
            return self
        rho, lags = self.correlation, np.arange(1, times)
        variance = (times + 2.0 * float(np.sum((times - lags) * rho**lags))) / times**2
        neighbours = rho * ((1.0 - rho**times) / (1.0 - rho)) ** 2 / times**2
        return replace(
            self, std_degC=self.std_degC * float(np.sqrt(variance)), correlation=neighbours / variance,
            resolution_degC=self.resolution_degC / float(np.sqrt(times)), sample_time_s=self.sample_time_s * times,
        )


def covariance(jacobian: Array, noise: ReadingNoise) -> Array:
    """Return the covariance of the least-squares estimate, shape (g, q, q); infinite where nothing is identified.

    Args:
        jacobian: derivative of each reading by each unknown, shape (g, n, q).
        noise: of the readings.
    """
    n, q = jacobian.shape[1:]
    if n < q:
        return np.full((len(jacobian), q, q), np.inf)
    scale = np.linalg.norm(jacobian, axis=1, keepdims=True)
    scale = np.where(scale > 0.0, scale, 1.0)
    basis, triangle = np.linalg.qr(jacobian / scale)
    lost = np.abs(np.einsum("gqq->gq", triangle)).min(axis=1) < _SINGULAR
    triangle = np.where(lost[:, None, None], np.eye(q), triangle)
    middle = np.swapaxes(basis, 1, 2) @ _correlated(basis, noise)
    inverse = np.linalg.inv(triangle) / np.swapaxes(scale, 1, 2)
    spread = inverse @ middle @ np.swapaxes(inverse, 1, 2)
    return np.where(lost[:, None, None], np.inf, spread)


def _correlated(columns: Array, noise: ReadingNoise) -> Array:
    """Return R·columns: R = σ²·ρ^|i−j| + rounding on the diagonal, without building R."""
    rho = noise.correlation
    forward = lfilter([1.0], [1.0, -rho], columns, axis=1)
    backward = lfilter([1.0], [1.0, -rho], columns[:, ::-1], axis=1)[:, ::-1]
    both = forward + backward - columns
    return np.asarray(noise.std_degC**2 * both + noise.white_variance * columns)
