"""The noise of an experiment's readings: what is given, else what a model's residuals show."""

from __future__ import annotations

import numpy as np

from heatertune.errors import InputError
from heatertune.model.experiment.fisher import ReadingNoise
from heatertune.model.values import FittedModel

__all__ = ["noise_of"]


def noise_of(
    fitted: FittedModel | None, *, std_degC: float | None = None, correlation: float | None = None,
    resolution_degC: float | None = None, sample_time_s: float | None = None,
) -> ReadingNoise:
    """Return the noise of the readings: what is given, else what a model's residuals show.

    Residuals hold the sensor's resolution already, and the correlation between two of them shrinks with the interval.

    Args:
        fitted: the model, None where there is none.
        std_degC: standard deviation of the noise [°C]; None: that of the residuals.
        correlation: of the noise between two readings, 0 to 1; None: that of the residuals, else 0.
        resolution_degC: step of the sensor's digits [°C]; None: 0.
        sample_time_s: interval between readings [s]; None: the log's, else 1 s.

    Raises:
        InputError: neither noise nor resolution is given, and the model has no residuals.
        OutOfRange: as `Noise`.
    """
    shown = None if fitted is None else fitted.residuals
    if shown is None or std_degC is not None:
        if std_degC is None and resolution_degC is None:
            raise InputError("the noise is unknown: give --noise or --resolution, or a model fitted to a log")
        return ReadingNoise(
            std_degC=std_degC or 0.0, correlation=correlation or 0.0, resolution_degC=resolution_degC or 0.0,
            sample_time_s=1.0 if sample_time_s is None else sample_time_s,
        )
    logged = float(np.median(np.diff(shown.time_s)))
    interval = logged if sample_time_s is None else sample_time_s
    lag_one = min(max(float(shown.autocorrelation[0]), 0.0), 0.999)
    return ReadingNoise(
        std_degC=float(np.std(shown.measured_degC - shown.simulated_degC)), sample_time_s=interval,
        correlation=min(lag_one ** (interval / logged), 0.999) if correlation is None else correlation,
        resolution_degC=resolution_degC or 0.0,
    )
