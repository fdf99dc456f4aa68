"""What a controller does to the power when the error steps, the loop being open."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from heatertune.pid.values import PidDesign

__all__ = ["reaction"]

Array = npt.NDArray[np.float64]

_CONTINUOUS = 200  # points where there is no sampling interval


def reaction(design: PidDesign) -> tuple[Array, Array]:
    """Return instants [s] and the change of power [%] after the error has stepped by 1 °C, without limits.

    The sampled law of `PidDesign`: K·(1 + (n + 1)·TA/TN + D_n), D_n = f·D_{n−1} + (1 − f)·TV/TA·(e_n − e_{n−1}).
    It runs for two TN, after which the I part is twice the P part, or for 20 samples without one. A continuous design
    is drawn in 200 steps, without its filter. Both are of shape (n,).
    """
    tn = design.integral_time_s
    ta = design.sample_time_s or (tn if math.isfinite(tn) else 1.0) / (_CONTINUOUS / 2)
    n = np.arange(max(20, math.ceil(2.0 * tn / ta)) if math.isfinite(tn) else 20)
    integral = (n + 1.0) * ta / tn
    kept = design.derivative_filter
    derivative = (1.0 - kept) * design.derivative_time_s / ta * np.power(kept, n)
    return np.asarray(n * ta, dtype=np.float64), design.gain_pct_per_degC * (1.0 + integral + derivative)
