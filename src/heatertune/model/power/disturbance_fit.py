"""A measured disturbance in a log with power: its effect, and the log without it.

Heater and disturbance are fitted together: temperature = ambient + k·G[power](t − L) + k·c·G[disturbance](t − L′), with
G the heater's one or two lags. For given lags and delays this is linear in the rest (variable projection), so the
search has four unknowns. Alternatives are no effect at all, and an effect through a separate lag. Intervals are those
of the linearised problem with AR(1) errors.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.errors import InputError
from heatertune.log.log_values import Log
from heatertune.model.disturbance import CoolingEffect, DisturbanceEffect
from heatertune.model.power.open_loop import FAR, PowerProblem
from heatertune.model.power.regressors import AMBIENT, FIRST_STATE, GAIN, SECOND_STATE, Readings
from heatertune.model.statistics import ar1_bic

__all__ = ["TAILS_PCT", "ar1_covariance", "cooling_effect", "without_disturbance"]


_READINGS: Final = 400  # averaged, of the search
TAILS_PCT: Final = (1.0, 99.0)  # of the levels: a lone wild cell is no level
_NORMAL: Final = 1.96  # of a 95 % interval
_MOST_COLOUR: Final = 0.98
_EDGES: Final = 40  # of a signal, one by one
_SMALL: Final = 1e-4  # step of a difference quotient, of the unknown's range


class _Fit(NamedTuple):
    """A least-squares solution: searched unknowns, linear part, residuals (m,) and columns of the linear part."""

    z: Array
    linear: Array
    residuals: Array
    columns: Callable[[Array], Array]

    @property
    def bic(self) -> float:
        return ar1_bic(self.residuals, len(self.z) + len(self.linear))


class _Problem(NamedTuple):
    """Power and disturbance as the compiled columns take them, on averaged readings, and the bounds [s]."""

    power: PowerProblem
    disturbance: PowerProblem
    bounds: Array

    @property
    def measured(self) -> Array:
        return self.power.readings.temperature_degC


def without_disturbance(log: Log) -> tuple[Log, DisturbanceEffect]:
    """Return a log as if its disturbance had always been at the calm level, and the effect of the disturbance.

    If the log shows no significant effect, the readings are unchanged.

    Raises:
        InputError: the disturbance or the power never changes, they change together, or no heater explains the log.
    """
    assert log.disturbance is not None
    if float(np.ptp(log.signals["power"].values)) == 0.0:
        raise InputError(f"{log.name}: the power never changes, so no disturbance can be expressed in power: log a "
                         "step of each")
    calm, strong = np.percentile(log.disturbance, TAILS_PCT).tolist()
    if not strong > calm:
        raise InputError(f"{log.name}: the disturbance {_named(log)!r} is {calm:g} in all but a hundredth of the "
                         "readings, so its effect is unknown: log a step of it, or leave it out: --disturbance-column "
                         "none")
    effect, through = _effect(log, calm, strong, f"the disturbance {_named(log)!r} moves with the power, so their "
                              "effects cannot be separated: log a step of it with constant power, or leave it out: "
                              "--disturbance-column none")
    cleared = log.with_rows(disturbance=None)
    if not effect.acts:
        return cleared, effect
    course = _problem(log, most=len(log.time_s)).disturbance.basis(_vector(through.z[:-1], effect.delay_s))[GAIN]
    return cleared.with_rows(temperature_degC=log.temperature_degC - through.linear[-1] * (course - calm)), effect


def cooling_effect(log: Log) -> CoolingEffect:
    """Return how strong the cooler of a log is: its power as that of the heater, of the opposite sign.

    Raises:
        InputError: the power never changes, the cooler moves with the heater, or no heater explains the log.
    """
    power, cooling = log.signals["power"].values, log.signals["cooling"].values
    if float(np.ptp(power)) == 0.0:
        raise InputError(f"{log.name}: the heater's power never changes, so a cooler cannot be expressed in it: log a "
                         "step of each, or fit the cooler alone: --power-levels 0 -100 --cooler")
    most = float(np.max(cooling))
    inseparable = (
        "the cooler is on whenever the heater is off, so their effects cannot be separated: log a while with both off; "
        f"or read a signal of both as one power, 0 % at full cooling: --power-levels {-most:g} 100")
    effect, _ = _effect(replace(log, signals=dict(log.signals) | {"disturbance": log.signals["cooling"]}), 0.0, most,
                        inseparable, by_controller=True)
    low, high = effect.pct_per_unit_ci95
    coarse = abs(effect.pct_per_unit) * _NORMAL * math.hypot(_rounding(power), _rounding(cooling))
    return CoolingEffect(
        cooling_gain=-effect.pct_per_unit, cooling_gain_ci95=(-high - coarse, -low + coarse), lead_s=effect.lead_s,
        lead_s_ci95=effect.lead_s_ci95, delta_bic=effect.delta_bic, delta_bic_own_lag=effect.delta_bic_own_lag,
        own_lag_s=effect.own_lag_s)


def _rounding(power: Array) -> float:
    """Return the error of a power that was rounded to its last written digit, as a fraction of what it was when on."""
    digit = next(10.0**-digits for digits in range(7) if digits == 6 or np.allclose(
        power, np.round(power, digits), rtol=0.0, atol=1e-9))
    return digit / math.sqrt(12.0) / float(np.sqrt(np.mean(power[power > 0.0] ** 2)))


def _effect(
    log: Log, calm: float, strong: float, inseparable: str, *, by_controller: bool = False
) -> tuple[DisturbanceEffect, _Fit]:
    """Return the effect of a disturbance, and the fit of heater and disturbance together.

    `by_controller`: a controller moves both within the log's interval, so the interval holds what that does.

    Raises:
        InputError: they change together, which `inseparable` says, or no heater explains the log.
    """
    assert log.disturbance is not None
    assert log.power_pct is not None
    problem = _problem(log)
    through = min((_searched(problem, two_lags=two) for two in (False, True)), key=lambda fit: fit.bic)
    two_lags = len(through.z) == 4
    none = _searched(problem, two_lags=two_lags, effect=False)
    own = _searched(problem, two_lags=two_lags, own_lag=True)
    together = _one_shape(log.power_pct, log.disturbance)  # the fit would then divide rounding errors, of either sign
    if together or through.linear[0] <= 0.0:
        why = inseparable if together or none.linear[0] > 0.0 else (
            "no heater explains the log: a rising power never warms it")
        raise InputError(f"{log.name}: {why}")
    late = _late_edges(log, problem, through) if by_controller else np.zeros((len(problem.measured), 0))
    pct_per_unit, (spread, lead_spread) = _interval(problem, through, late)
    delay, lead = float(through.z[-1]), float(through.z[1] - through.z[-1])
    lead_spread += float(np.median(np.diff(log.time_s)))  # a change is logged up to an interval late
    effect = DisturbanceEffect(
        column=_named(log), pct_per_unit=pct_per_unit, pct_per_unit_ci95=(pct_per_unit - spread, pct_per_unit + spread),
        delay_s=delay, lead_s=lead, lead_s_ci95=(lead - lead_spread, lead + lead_spread), calm=calm, strong=strong,
        delta_bic=none.bic - through.bic, delta_bic_own_lag=none.bic - own.bic, own_lag_s=math.exp(own.z[-1]))
    return effect, through


def _one_shape(power: npt.NDArray[np.float64], shape: npt.NDArray[np.float64]) -> bool:
    """Return whether two signals are, but for rounding, one and the same line of the other, arrays of shape (n,)."""
    first, second = power - power.mean(), shape - shape.mean()
    alike = float(first @ second) ** 2
    return alike >= (1.0 - 1e-12) * float(first @ first) * float(second @ second)


def _named(log: Log) -> str:
    name, _ = ("disturbance", "") if log.taken is None else log.taken.columns.get("disturbance", ("disturbance", ""))
    return name.strip("'")


def _problem(log: Log, most: int = _READINGS) -> _Problem:
    power = Readings.of(log)
    edge_s, level = log.signals["disturbance"].changes
    thin = power.average(most)
    held = PowerProblem(readings=thin, two_lags=True)
    length, sample = float(np.ptp(log.time_s)), float(np.median(np.diff(log.time_s)))
    lags = (math.log(0.5 * sample), math.log(FAR * length))
    bounds = np.array([lags, (0.0, length / 4.0), (0.01, 0.98), (0.0, length / 4.0)])
    return _Problem(held, PowerProblem(readings=replace(
        thin, edge_s=edge_s, level_pct=level), two_lags=True), bounds)


def _vector(heater: Array, delay_s: float) -> Array:
    """Return lags and a delay as `PowerProblem.basis` takes them: ln lag, delay, ratio of the lags."""
    return np.array([heater[0], delay_s, heater[2] if len(heater) > 2 else 0.0])


def _searched(problem: _Problem, *, two_lags: bool, effect: bool = True, own_lag: bool = False) -> _Fit:
    """Return the best fit of one or two lags, with an effect or without, through the heater's lags or its own."""
    bounds = problem.bounds[:3] if two_lags else problem.bounds[:2]
    if effect:
        bounds = np.vstack([bounds, problem.bounds[0] if own_lag else problem.bounds[3]])

    def columns(z: Array) -> Array:
        heater = z[:-1] if effect else z
        basis = problem.power.basis(_vector(heater, heater[1]))
        parts = [basis[GAIN], basis[AMBIENT], basis[FIRST_STATE]] + ([basis[SECOND_STATE]] if two_lags else [])
        if effect:
            along = np.array([z[-1], 0.0, 0.0]) if own_lag else _vector(heater, z[-1])
            parts.append(problem.disturbance.basis(along)[GAIN])
        return np.column_stack(parts)

    def residuals(z: Array) -> Array:
        basis = columns(z)
        return basis @ np.linalg.lstsq(basis, problem.measured, rcond=None)[0] - problem.measured

    starts = [np.array([*start, *([_last(start, bounds, own_lag=own_lag)] if effect else [])])
              for start in _starts(bounds, two_lags=two_lags)]
    from scipy.optimize import least_squares

    tried = sorted(starts, key=lambda z: float(np.sum(residuals(z) ** 2)))[:3]
    solutions = [least_squares(residuals, z, bounds=bounds.T, x_scale=np.ptp(bounds, axis=1), max_nfev=60)
                 for z in tried]
    z = min(solutions, key=lambda solution: float(solution.cost)).x
    linear = np.asarray(np.linalg.lstsq(columns(z), problem.measured, rcond=None)[0], dtype=np.float64)
    return _Fit(z, linear, residuals(z), columns)


def _starts(bounds: Array, *, two_lags: bool) -> list[tuple[float, ...]]:
    """Return lags and dead times over the whole region that is searched."""
    lags = np.linspace(bounds[0, 0], bounds[0, 1], 12)[1:-1]
    dead = [share * bounds[1, 1] for share in (0.002, 0.02, 0.1, 0.4)]
    return [(lag, time, *((0.3,) if two_lags else ())) for lag in lags for time in dead]


def _last(start: tuple[float, ...], bounds: Array, *, own_lag: bool) -> float:
    return start[0] if own_lag else min(start[1], bounds[-1, 1])


def _late_edges(log: Log, problem: _Problem, fit: _Fit) -> Array:
    """Return what edges that were written late do to the readings, a standard deviation each, shape (n, k) [°C].

    A signal changes at any instant of the interval before the row that shows it: evenly spread.
    """
    interval = float(np.median(np.diff(log.time_s)))
    rows: list[Array] = []
    for role, delay, gain in (("power", fit.z[1], fit.linear[0]), ("disturbance", fit.z[-1], fit.linear[-1])):
        steps = np.diff(log.signals[role].values)
        largest = np.argsort(-np.abs(steps))[:_EDGES]
        # the small ones that are left out add up to as much as their squares
        rest = math.sqrt(float(steps @ steps) / max(float(steps[largest] @ steps[largest]), 1e-300))
        for place in largest[steps[largest] != 0.0]:
            edge = float(log.signals[role].time_s[place + 1])
            pulse = PowerProblem(two_lags=True, readings=replace(
                problem.power.readings, edge_s=np.array([log.time_s[0] - interval, edge - interval, edge]),
                level_pct=np.array([0.0, steps[place], 0.0])))
            heater = fit.z[:-1]
            rows.append(rest * gain * pulse.basis(_vector(heater, float(delay)))[GAIN] / math.sqrt(12.0))
    return np.column_stack(rows)


def _interval(problem: _Problem, fit: _Fit, late: Array) -> tuple[float, tuple[float, float]]:
    """Return the effect as power, and half its 95 % interval and that of the difference of the delays [s].

    `late`: errors of the readings, independent of each other, in addition to the noise, shape (n, k) [°C].
    """
    jacobian, scale = [], np.ptp(problem.bounds, axis=1)[[0, 1, 2, 3] if len(fit.z) == 4 else [0, 1, 3]]
    base = fit.columns(fit.z)
    for place, size in enumerate(_SMALL * scale):
        moved = fit.z.copy()
        moved[place] += size
        jacobian.append((fit.columns(moved) - base) @ fit.linear / size)
    slopes = np.column_stack([*jacobian, base])
    power, effect = float(fit.linear[0]), float(fit.linear[-1])
    norms = np.linalg.norm(slopes, axis=0)
    covariance = ar1_covariance(slopes / norms, fit.residuals)
    moved = np.linalg.pinv(slopes / norms) @ late
    covariance = (covariance + moved @ moved.T) / np.outer(norms, norms)
    searched = len(fit.z)
    gradients = np.zeros((2, slopes.shape[1]))
    gradients[0, searched], gradients[0, -1] = -effect / power**2, 1.0 / power
    gradients[1, 1], gradients[1, searched - 1] = 1.0, -1.0
    spread, lead_spread = (_NORMAL * np.sqrt(np.diag(gradients @ covariance @ gradients.T))).tolist()
    return effect / power, (spread, lead_spread)


def ar1_covariance(slopes: Array, residuals: Array) -> Array:
    """Return the covariance of the unknowns, shape (p, p), the residuals (n,) being AR(1) of their own colour."""
    n = len(residuals)
    colour = float(residuals[1:] @ residuals[:-1]) / max(float(residuals @ residuals), 1e-300)
    colour = min(max(colour, 0.0), _MOST_COLOUR)
    variance = float(residuals @ residuals) / max(n - slopes.shape[1], 1)
    apart = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    inverse = np.linalg.pinv(slopes.T @ slopes)
    return np.asarray(inverse @ slopes.T @ (variance * colour**apart) @ slopes @ inverse)
