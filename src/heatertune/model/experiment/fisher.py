"""Expected accuracy of the heater parameters from an experiment, before it is run.

For white noise the covariance of the least-squares estimate is the inverse of the Fisher information JᵀJ/σ². Heater
residuals are coloured, and the output-error fit does not whiten them, so the covariance is
(JᵀJ)⁻¹·JᵀRJ·(JᵀJ)⁻¹ with the noise covariance R (L. Ljung, "System Identification", 2nd ed. (1999), section 9.3).

Also the noise model (given, or from the residuals of a fit) and the values of a plan: prior, limits of the experiment,
expected accuracy.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from scipy.signal import lfilter

from heatertune.arrays import Array
from heatertune.errors import InputError, OutOfRange
from heatertune.model.circumstances import without_neighbours
from heatertune.model.model_values import FittedModel, Fopdt, HeaterModel
from heatertune.model.response import Schedule, peak_rise, rows_of, sensitivities
from heatertune.units import check

__all__ = [
    "QUANTITIES", "ExperimentSetup", "Prior", "ReadingNoise", "covariance", "demand_room", "errors", "noise_of",
    "peaks", "prior_by_hand", "prior_of", "rests", "shares",
]


_SINGULAR = 1e-9  # of the largest scaled column: the part of a column that the others do not explain


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadingNoise:
    """Noise of the readings.

    Attributes:
        std_degC: standard deviation of the noise [°C].
        correlation: of the noise between two readings, first-order autoregressive [0…1).
        resolution_degC: resolution of the sensor [°C]; each reading has an uncorrelated error of up to half of it.
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
        """Return the noise of the means of `times` readings each, which contain nearly all their information."""
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
    """Return the covariance of the least-squares estimate, shape (g, q, q); infinite if nothing is identified.

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


def noise_of(
    fitted: FittedModel | None, *, std_degC: float | None = None, correlation: float | None = None,
    resolution_degC: float | None = None, sample_time_s: float | None = None,
) -> ReadingNoise:
    """Return the noise of the readings: as given, otherwise from the residuals of a model.

    Residuals include the sensor's resolution, and their correlation decreases with the interval.

    Args:
        fitted: the model, or None.
        std_degC: standard deviation of the noise [°C]; None: that of the residuals.
        correlation: of the noise between two readings, 0 to 1; None: that of the residuals, else 0.
        resolution_degC: resolution of the sensor [°C]; None: 0.
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


Rows = npt.NDArray[np.intp]

#: the criteria of an experiment; with two lags the time constant is their sum
QUANTITIES = ("gain_degC_per_pct", "time_constant_s", "dead_time_s", "ambient_degC")

_SHORT = 0.1  # of the lags: a shorter dead time limits no loop, so its error is measured against this


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Prior:
    """All heaters that are plausible before the experiment.

    Attributes:
        models: label → heater, each with its ambient.
        ambient_known: whether the ambient is given to the fit after the experiment.
        values: the quantities of each model, shape (g, 4).
        by_order: indices and rows (see `response.rows_of`) of the models with one lag, and of those with two.

    Raises:
        OutOfRange: one of the models cools.
    """

    models: Mapping[str, HeaterModel]
    ambient_known: bool
    values: Array = field(init=False)
    by_order: tuple[tuple[Rows, Array], ...] = field(init=False)

    def __post_init__(self) -> None:
        models = list(self.models.values())
        weakest = min(model.gain_degC_per_pct for model in models)
        if weakest < 0.0:
            raise OutOfRange("gain_degC_per_pct", weakest, "> 0: no experiment is planned for a cooler, a plan keeps "
                             "a heater from getting too hot and knows nothing of too cold")
        values = [[m.gain_degC_per_pct, sum(m.lags_s), m.dead_time_s, m.ambient_degC] for m in models]
        object.__setattr__(self, "values", np.array(values, dtype=np.float64))
        orders = []
        for lags in (1, 2):
            index = np.array([i for i, m in enumerate(models) if len(m.lags_s) == lags], dtype=np.intp)
            if len(index):
                orders.append((index, rows_of([models[i] for i in index])))
        object.__setattr__(self, "by_order", tuple(orders))

    @property
    def slowest_s(self) -> float:
        """Longest sum of lags and dead time [s]."""
        return float((self.values[:, 1] + self.values[:, 2]).max())

    @property
    def longest_s(self) -> float:
        """Default limit of the duration: six times that of the slowest heater [s]."""
        return 6.0 * self.slowest_s

_MOST_READINGS: Final = 1e7  # of an experiment


@dataclass(frozen=True, slots=True, kw_only=True)
class ExperimentSetup:
    """Limits and readings of an experiment.

    Attributes:
        limit_degC: temperature that no heater of the prior may exceed [°C].
        noise: of the readings.
        longest_s: longest duration [s].
        base_pct: steady power before and after [%].
        least_pct, most_pct: bounds of the power [%].
        aim: relative half width of the 95 % intervals of gain, time constant and dead time to aim at.

    Raises:
        OutOfRange: a power outside 0…100 % or in the wrong order, a duration of less than 40 readings.
    """

    limit_degC: float
    noise: ReadingNoise
    longest_s: float
    base_pct: float = 0.0
    least_pct: float = 0.0
    most_pct: float = 100.0
    aim: float = 0.1

    def __post_init__(self) -> None:
        check("limit_degC", self.limit_degC)
        interval = self.noise.sample_time_s
        check("longest_s", self.longest_s, least=40.0 * interval, most=_MOST_READINGS * interval)
        check("least_pct", self.least_pct, least=0.0, most=100.0)
        check("most_pct", self.most_pct, above=self.least_pct, most=100.0)
        check("base_pct", self.base_pct, least=self.least_pct, most=self.most_pct)
        check("aim", self.aim, above=0.0)


def prior_of(fitted: FittedModel, *, ambient_degC: float | None, assumed_degC: float) -> Prior:
    """Return the candidates of a fit, and its working model with each parameter at each end of its interval.

    Args:
        fitted: result of a fit, or a model given by its parameters.
        ambient_degC: ambient, if known [°C].
        assumed_degC: ambient for a model without one [°C]; it shifts the temperatures, not the intervals.
    """

    def at_home(model: HeaterModel) -> HeaterModel:
        ambient = model.ambient_degC if ambient_degC is None else ambient_degC
        return replace(model, ambient_degC=assumed_degC if ambient is None else ambient)

    models: dict[str, HeaterModel] = {"working model": at_home(fitted.model)}
    for candidate in without_neighbours(fitted).candidates:
        models.setdefault(candidate.label, at_home(candidate.model))
    for name in QUANTITIES[:3]:
        ci95 = fitted.ci95.get(name)
        ends = {} if ci95 is None else {"lowest": ci95.low, "highest": ci95.high}
        for end, value in ends.items():
            if value is not None and (value > 0.0 or name == "dead_time_s"):
                changed: dict[str, Any] = {name: value}
                models[f"{end} {name}"] = replace(at_home(fitted.model), **changed)
    return Prior(models=models, ambient_known=ambient_degC is not None)


def prior_by_hand(ranges: Mapping[str, tuple[float, float]], *, ambient_known: bool) -> Prior:
    """Return the centre and every corner of ranges, name of a quantity → (low, high).

    The corners use the warmest room, in which a limit is reached first; the weakest heater in the coolest room limits
    how high a relay's setpoint may be.

    Raises:
        InputError: a quantity is missing.
        OutOfRange: low above high, or an impossible value.
    """
    missing = [name for name in QUANTITIES if name not in ranges]
    if missing:
        raise InputError(f"the prior needs a range of {', '.join(missing)}")
    for name, (low, high) in ranges.items():
        check(name, low, most=high)
    middle = {name: float(np.mean(ranges[name])) for name in QUANTITIES}
    models: dict[str, HeaterModel] = {"centre": Fopdt(**middle)}
    coolest, warmest = ranges["ambient_degC"]
    weakest = middle | {"gain_degC_per_pct": ranges["gain_degC_per_pct"][0], "ambient_degC": coolest}
    models["weakest in the coolest room"] = Fopdt(**weakest)
    for ends in product(*(sorted(set(ranges[name])) for name in QUANTITIES[:3])):
        corner = dict(zip(QUANTITIES, (*ends, warmest), strict=True))
        label = ", ".join(f"{value:g}" for value in ends)
        models[f"corner {label}"] = Fopdt(**corner)
    return Prior(models=models, ambient_known=ambient_known)


def rests(prior: Prior, power_pct: float) -> Array:
    """Return the steady temperature at a power on each heater, shape (g,) [°C]."""
    return np.asarray(prior.values[:, 3] + prior.values[:, 0] * power_pct)


def peaks(prior: Prior, schedule: Schedule) -> Array:
    """Return the highest temperature on each heater, shape (g,) [°C]."""
    highest = rests(prior, schedule.base_pct)
    for index, rows in prior.by_order:
        highest[index] += peak_rise(rows, schedule)
    return highest


def errors(prior: Prior, schedule: Schedule, noise: ReadingNoise, duration_s: float) -> Array:
    """Return the expected standard error of each quantity on each heater, shape (g, 4); 0 for a known ambient."""
    instants = np.arange(0.0, duration_s + 0.5 * noise.sample_time_s, noise.sample_time_s)
    std_errors = np.zeros((len(prior.models), len(QUANTITIES)))
    for index, rows in prior.by_order:
        lags = rows.shape[1] - 2
        jacobian = sensitivities(rows, schedule, instants)
        if prior.ambient_known:
            jacobian = np.delete(jacobian, 2 + lags, axis=2)
        spread = covariance(jacobian, noise)
        pick = np.zeros((jacobian.shape[2], len(QUANTITIES)))
        pick[0, 0] = pick[1, 2] = 1.0
        pick[2 : 2 + lags, 1] = 1.0
        if not prior.ambient_known:
            pick[2 + lags, 3] = 1.0
        identified = np.all(np.isfinite(spread), axis=(1, 2))
        variance = np.einsum("qk,gqr,rk->gk", pick, np.where(identified[:, None, None], spread, 0.0), pick)
        std_errors[index] = np.where(identified[:, None], np.sqrt(np.maximum(variance, 0.0)), np.inf)
    return std_errors


def shares(prior: Prior, std_errors: Array) -> Array:
    """Return the half width of the 95 % interval of gain, time constant and dead time as a share, shape (g, 3)."""
    values = prior.values[:, :3].copy()
    values[:, 2] = np.maximum(values[:, 2], _SHORT * values[:, 1])
    return np.asarray(1.96 * std_errors[:, :3] / values)


def demand_room(prior: Prior, setup: ExperimentSetup) -> None:
    """Refuse a limit that the heater reaches without any experiment.

    Raises:
        OutOfRange: it does so on some heater of the prior.
    """
    rest = float(rests(prior, setup.base_pct).max())
    if setup.limit_degC <= rest:
        raise OutOfRange(
            "limit_degC", setup.limit_degC, f"> {rest:.4g}, where the heater may rest at {setup.base_pct:g} %"
        )
