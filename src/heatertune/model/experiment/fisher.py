"""Expected accuracy of the heater parameters from an experiment, before it is run.

For white noise the covariance of the least-squares estimate is the inverse of the Fisher information JᵀJ/σ². Heater
residuals are coloured, and the output-error fit does not whiten them, so the covariance is
(JᵀJ)⁻¹·JᵀRJ·(JᵀJ)⁻¹ with the noise covariance R (L. Ljung, "System Identification", 2nd ed. (1999), section 9.3).

Also the noise model (given, or from the residuals of a fit) and the values of a plan: prior, limits of the experiment,
expected accuracy.

The exact response of a heater, at rest until its power steps at given instants, and its sensitivity to the parameters
are closed forms: no grid, no solver. The response to each step is the step response of the lags, delayed by the dead
time. All of these functions take many heaters of one order at once, one per row (see `rows_of`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.errors import InputError, OutOfRange
from heatertune.heater.exact import apart, since_step, slopes_by_lag, turning_times
from heatertune.model.circumstances import without_neighbours
from heatertune.model.model_values import FittedModel, Fopdt, HeaterModel
from heatertune.units import check

__all__ = [
    "QUANTITIES", "ExperimentSetup", "Prior", "ReadingNoise", "Schedule", "covariance", "demand_room", "errors",
    "noise_of", "peak_rise", "peaks", "prior_by_hand", "prior_of", "rests", "rise", "rows_of", "sensitivities",
    "shares",
]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Schedule:
    """Powers of an experiment.

    Attributes:
        base_pct: power before the first instant, and steady for long [%].
        time_s: instants at which the power steps, not decreasing, shape (m,) [s].
        power_pct: power from each instant on, shape (m,) [0…100 %].

    Raises:
        OutOfRange: shapes differ, instants that decrease or are negative, a power outside 0…100 %.
    """

    base_pct: float
    time_s: Array
    power_pct: Array

    def __post_init__(self) -> None:
        check("base_pct", self.base_pct, least=0.0, most=100.0)
        for name in ("time_s", "power_pct"):
            array = np.array(getattr(self, name), dtype=np.float64)
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        if self.time_s.shape != self.power_pct.shape or self.time_s.ndim != 1 or not len(self.time_s):
            raise OutOfRange("power_pct", self.power_pct.shape, f"one power for each of {self.time_s.shape} instants")
        if np.any(np.diff(self.time_s) < 0.0):
            raise OutOfRange("time_s", self.time_s.tolist(), "not decreasing")
        check("time_s", float(self.time_s[0]), least=0.0)
        check("time_s", float(self.time_s[-1]), least=0.0)
        for power in (float(self.power_pct.min()), float(self.power_pct.max())):
            check("power_pct", power, least=0.0, most=100.0)

    @property
    def steps_pct(self) -> Array:
        """Change of the power at each instant, shape (m,) [%]."""
        return np.diff(self.power_pct, prepend=self.base_pct)

    def at(self, instants: Array) -> Array:
        """Return the power that holds at the instants, shape (n,) [%]."""
        index = np.searchsorted(self.time_s, instants, side="right")
        return np.asarray(np.concatenate([[self.base_pct], self.power_pct])[index])


def rows_of(models: Sequence[HeaterModel]) -> Array:
    """Return gain, dead time, and each lag of models of one order, shape (g, 2 + lags)."""
    return np.array([[m.gain_degC_per_pct, m.dead_time_s, *m.lags_s] for m in models])


def rise(rows: Array, schedule: Schedule, instants: Array) -> Array:
    """Return the temperature above that of the base power, shape (g, n) [°C], at instants (n,) or (g, n) [s]."""
    unit, _ = since_step(_since(rows, schedule, instants), *_each_lag(rows))
    return np.asarray(rows[:, :1] * (unit @ schedule.steps_pct))


def sensitivities(rows: Array, schedule: Schedule, instants: Array) -> Array:
    """Return the derivatives of the temperature at the instants, shape (g, n, q).

    Columns: gain [°C per °C/%], dead time [°C/s], each lag [°C/s], ambient, then the deviation of each lag's initial
    state from steady state [°C per °C], which a fit has to find too. Equal lags are moved apart, see `exact.apart`,
    because they would be indistinguishable.
    """
    steps = schedule.steps_pct
    if rows.shape[1] == 4:
        rows = np.hstack([rows[:, :2], [apart(*lags) for lags in rows[:, 2:]]])
    unit, slope, by_lag = _unit_steps(rows, _since(rows, schedule, instants))
    gain = rows[:, :1]
    shared = [schedule.base_pct + unit @ steps, -gain * (slope @ steps),
              *(gain * (derivative @ steps) for derivative in by_lag)]
    initial = [np.exp(-instants[None, :] / lag[:, None]) for lag in _lags(rows)]
    return np.stack([*shared, np.ones_like(shared[0]), *initial], axis=2)


def peak_rise(rows: Array, schedule: Schedule) -> Array:
    """Return the highest temperature above that of the base power, the time after the last step included, shape (g,).

    Between two steps the temperature of one lag is monotonic; that of two lags turns at most once.
    """
    steps, time = schedule.steps_pct, schedule.time_s
    lags = _lags(rows)
    since = np.maximum(time[:, None] - time[None, :], 0.0)
    past = np.tril(np.ones_like(since))
    turns = np.zeros((len(rows), len(time)))
    if len(lags) == 2:
        acting = past * steps
        outer, inner = (lag[:, None, None] for lag in lags)
        covered = since_step(since, outer, inner)[0], since_step(since, inner)[0]
        y, x = (np.sum(acting * share, axis=2) for share in covered)
        turns = np.nan_to_num(turning_times(y, x, acting.sum(axis=1), outer[:, 0], inner[:, 0]))
    undelayed = rows.copy()
    undelayed[:, 1] = 0.0  # the dead time moves the peak, not its height
    later = np.append(np.diff(time), np.inf)
    heights = rise(undelayed, schedule, np.hstack([np.tile(time, (len(rows), 1)), time + np.minimum(turns, later)]))
    last = rows[:, 0] * (schedule.power_pct[-1] - schedule.base_pct)
    return np.asarray(np.maximum(heights.max(axis=1), last))


def _since(rows: Array, schedule: Schedule, instants: Array) -> Array:
    """Return how long each step has acted, shape (g, n, m); 0 before it acts [s]."""
    acting = np.atleast_2d(instants)[:, :, None] - schedule.time_s - rows[:, 1][:, None, None]
    return np.asarray(np.maximum(acting, 0.0))


def _lags(rows: Array) -> list[Array]:
    return list(rows[:, 2:].T)


def _each_lag(rows: Array) -> list[Array]:
    """Return the lags so that they broadcast with instants and steps."""
    return [lag[:, None, None] for lag in _lags(rows)]


def _unit_steps(rows: Array, since: Array) -> tuple[Array, Array, list[Array]]:
    """Return the unit step response of the lags, its slope, and its derivative by each lag."""
    lags = _each_lag(rows)
    covered, slope = since_step(since, *lags)
    return covered, (since > 0.0) * slope, [slopes_by_lag(since, *pair) for pair in (lags, lags[::-1])[: len(lags)]]


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
    from scipy.signal import lfilter  # which a fit without a plan does not wait for

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
