"""A measured disturbance in a log with power: its effect, and the log without it.

Heater and disturbance are fitted together: temperature = ambient + k·G[power](t − L) + k·c·G[disturbance](t − L′), with
G the heater's one or two lags. For given lags and delays this is linear in the rest (variable projection), so the
search has four unknowns. Alternatives are no effect at all, and an effect through a separate lag. Intervals are those
of the linearised problem with AR(1) errors.

Also the initial state, drift of the ambient, and load steps that a log needs besides its heater, chosen together. Load
steps (an open lid, another heater) begin at unknown instants. A test that starts in steady state has no initial state
to fit: a free one would absorb model error at the first step, and the ambient with it. If the readings before the first
change of power suffice, they decide: a temperature that moves at constant power is not in steady state.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.errors import InputError
from heatertune.log.log_values import Log
from heatertune.model.disturbance import CoolingEffect, DisturbanceEffect
from heatertune.model.power.open_loop import FAR, PowerFit, PowerProblem
from heatertune.model.power.regressors import AMBIENT, FIRST_STATE, GAIN, SECOND_STATE, Readings
from heatertune.model.statistics import ar1_bic, replace_outliers, sensor_step

__all__ = [
    "COLDER", "TAILS_PCT", "Way", "ar1_covariance", "bic_of", "coincides", "cooling_effect", "edges_of",
    "is_plain_rest", "is_sensible", "left_over", "lowest_degC", "refit_all", "starts", "with_events", "with_loads",
    "without_disturbance", "without_events",
]


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
    base_problem = PowerProblem(readings=thin, two_lags=True)
    length, sample = float(np.ptp(log.time_s)), float(np.median(np.diff(log.time_s)))
    lags = (math.log(0.5 * sample), math.log(FAR * length))
    bounds = np.array([lags, (0.0, length / 4.0), (0.01, 0.98), (0.0, length / 4.0)])
    return _Problem(base_problem, PowerProblem(readings=replace(
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
    """Return the effect on the readings of edges written late, a standard deviation each, shape (n, k) [°C].

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


_FEWEST = 5  # readings before the first change of the power
_SURE = 3.0  # standard deviations
_SHARE = 0.05  # of the span, that an unseen deviation from rest may move the ambient


class _Slope(NamedTuple):
    """The readings before the first change of the power: their slope, its error, scatter and length."""

    degC_per_s: float
    error_degC_per_s: float
    scatter_degC: float
    length_s: float

    @property
    def is_seen(self) -> bool:
        """Whether the temperature moves by more than noise."""
        moved = abs(self.degC_per_s)
        return moved > _SURE * self.error_degC_per_s and moved * self.length_s > _SURE * self.scatter_degC


def starts(problem: PowerProblem, *, closed_loop: bool) -> Iterator[PowerProblem]:
    """Yield the problem with each possible start: power before, known or unknown, steady state or not.

    `closed_loop`: a controller set the power, so it was not switched on together with the log.
    """
    befores = [problem.power_before_pct]
    if befores == [None] and problem.readings.level_pct[0] != 0.0:
        befores.append(0.0)
    for before in befores:
        start = replace(problem, power_before_pct=before)
        yield start
        if _may_rest(start) and not (closed_loop and not _power_goes_on(start)):
            yield replace(start, at_rest=True)


def _may_rest(problem: PowerProblem) -> bool:
    """Return whether the first readings may be the steady state of the power before the log.

    If this power continues, they hardly move; if power came on with the log, no later reading is colder.
    """
    if _power_goes_on(problem):
        slope = _slope(problem.readings)
        return slope is not None and not slope.is_seen
    readings = problem.readings.temperature_degC
    noise = float(np.std(np.diff(readings, 2))) / np.sqrt(6.0)
    return problem.power_before == 0.0 and float(readings.min()) > float(readings[0]) - 2.0 * _SURE * noise


def is_plain_rest(problem: PowerProblem, lag_s: float) -> bool:
    """Return whether the readings before the first change of the power leave nothing but rest.

    A deviation from rest would decay with the lag [s]: its slope, as far as the readings allow one, bounds it.
    """
    slope = _slope(problem.readings) if _power_goes_on(problem) else None
    if slope is None or slope.is_seen:
        return False
    most = (abs(slope.degC_per_s) + _SURE * slope.error_degC_per_s) * lag_s
    return most < _SHARE * float(np.ptp(problem.readings.temperature_degC))


def _power_goes_on(problem: PowerProblem) -> bool:
    """Return whether the power before the log goes on in it."""
    return problem.power_before == float(problem.readings.level_pct[0])


def _slope(readings: Readings) -> _Slope | None:
    """Return the slope of the readings before the first change of the power, None if they are too few."""
    end = readings.edge_s[1] if len(readings.edge_s) > 1 else np.inf
    before = readings.time_s + readings.half_s <= end
    n = int(np.count_nonzero(before))
    if n < _FEWEST:
        return None
    time = readings.time_s[before] - np.mean(readings.time_s[before])
    y = readings.temperature_degC[before]
    squares = float(time @ time)
    slope = float(time @ y) / squares
    left = y - np.mean(y) - slope * time
    rounding = (sensor_step(readings.temperature_degC) or 0.0) / np.sqrt(12.0)
    scatter = max(float(np.sqrt(left @ left / (n - 2))), rounding)
    return _Slope(slope, scatter / np.sqrt(squares), scatter, float(np.ptp(time)))


_MOST = 3
_GAIN = 20.0  # BIC points a load step has to be worth: its instant is chosen among many
_LEFT = 2e-3  # of the span
_INSTANTS = 80
_ROUNDS = 3
COLDER = 0.05  # of the span: noise and a poor start
_GRID = 16  # instants
_EDGE = 0.1  # of the power's range: a smaller edge moves too little to hide anything
_FEW = 3.0  # sampling intervals
_OFTEN = 0.5  # of the log
_RATIO = 0.1  # of two lags to begin with


def bic_of(problem: PowerProblem, fit: PowerFit) -> float:
    """Return the criterion of a fit on its problem's readings; infinite if it is no heater."""
    if fit.model is None and problem.sign > 0.0 and problem.least_dead_time_s == 0.0:
        return np.inf
    if problem.sign < 0.0 and not float(fit.linear[GAIN]) < 0.0:  # no cooler fits at all
        return np.inf
    return ar1_bic(problem.readings.temperature_degC - fit.simulated_degC, fit.unknowns)


def left_over(problem: PowerProblem, fit: PowerFit) -> bool:
    """Return whether a fit leaves enough for a drift or a load to be there at all, and not the arithmetic of a fit."""
    record = problem.readings.temperature_degC
    return float(np.sqrt(np.mean((record - fit.simulated_degC) ** 2))) > _LEFT * float(np.ptp(record))


def is_sensible(problem: PowerProblem, fit: PowerFit) -> bool:
    """Return whether the ambient lies below the readings, but for a little: only coolers go below it."""
    if float(problem.readings.level_pct.min()) < 0.0:
        return True
    readings = problem.readings.temperature_degC
    return float(fit.linear[AMBIENT]) <= lowest_degC(problem) + COLDER * float(np.ptp(readings))


def lowest_degC(problem: PowerProblem) -> float:
    """Return the lowest temperature of a log, from the running median to exclude noise [°C]."""
    return float(replace_outliers(problem.readings.temperature_degC, share=0.0).min())


def edges_of(problem: PowerProblem) -> tuple[Array, Array]:
    """Return instants [s] and sizes [%] of the power's steps of more than a tenth of its range, each shape (k,)."""
    readings = problem.readings
    steps = np.diff(readings.level_pct)
    large = np.abs(steps) > _EDGE * np.ptp(readings.level_pct)
    return readings.edge_s[1:][large], steps[large]


def coincides(problem: PowerProblem, dead_time_s: float, instant_s: float) -> bool:
    """Return whether a load coincides with the arrival of a power edge, so that the heater explains it.

    If the power changes so often that most instants would coincide, the result is False.
    """
    readings = problem.readings
    edges, _ = edges_of(problem)
    early = _FEW * float(np.median(np.diff(readings.time_s)))
    late = 2.0 * dead_time_s + early
    if len(edges) * (early + late) > _OFTEN * float(np.ptp(readings.time_s)):
        return False
    return bool(np.any((instant_s > edges - early) & (instant_s < edges + late)))


def with_loads(
    problems: list[PowerProblem], fits: list[PowerFit], *, edges_dead_time_s: float | None = None
) -> tuple[list[PowerProblem], list[PowerFit]]:
    """Return the problems and fits with the load steps that every one of them asks for.

    A step that only the poorer model wants covers that model's own fault. `edges_dead_time_s`: dead time after
    which edges of the power arrive; a load that sets in with one ends the search.
    """
    for _ in range(_MOST):
        bics = [bic_of(problem, fit) for problem, fit in zip(problems, fits, strict=True)]
        best = int(np.argmin(bics))
        if not left_over(problems[best], fits[best]):
            break
        ways = [_descended(problems, fits, best)]
        if not problems[0].loads_s:  # under feedback a load passes for a weak heater, far from the true one
            ways += [way for way in [_descended(problems, _far_off(problems), 0)] if is_sensible(way[0][0], way[1][0])]
        trial, trial_fits = min(ways, key=lambda way: min(map(bic_of, *way)))
        gains = [bic - bic_of(t, f) for bic, t, f in zip(bics, trial, trial_fits, strict=True)]
        if min(gains) < _GAIN or (
            edges_dead_time_s is not None and coincides(trial[best], edges_dead_time_s, trial[best].loads_s[-1])
        ):
            break
        problems, fits = trial, trial_fits
    return problems, fits


def _descended(
    problems: list[PowerProblem], fits: list[PowerFit], best: int
) -> tuple[list[PowerProblem], list[PowerFit]]:
    """Return the problems and fits with one more load, searched from the current fits."""
    trial = problems
    for _ in range(_ROUNDS):  # the load bends lags and dead time, and these its instant
        instant = _instant(problems[best], fits[best])
        trial = [replace(problem, loads_s=(*problem.loads_s, instant)) for problem in problems]
        fits = [t.refine(fit.vector[None, :]) for t, fit in zip(trial, fits, strict=True)]
    return trial, fits


def _far_off(problems: list[PowerProblem]) -> list[PowerFit]:
    """Return the fits with one load, with instant, lag and dead time searched together on a coarse grid."""
    time = problems[0].readings.time_s
    tried = time[0] + np.linspace(0.05, 0.95, _GRID) * float(np.ptp(time))
    rough = [replace(problems[0], loads_s=(float(instant),)).roughly() for instant in tried]
    place = int(np.argmin([cost for cost, _ in rough]))
    vector, fits = rough[place][1], []
    for problem in problems:
        start = np.array([[vector[0], vector[1], _RATIO if problem.two_lags else 0.0]])
        fits.append(replace(problem, loads_s=(float(tried[place]),)).refine(start))
    return fits


def _instant(problem: PowerProblem, fit: PowerFit) -> float:
    """Return when a further load step would explain most, lags and dead time as they are."""
    time = problem.readings.time_s
    length = float(np.ptp(time))
    trial = replace(problem, loads_s=(*problem.loads_s, float(time[0])))
    tried = time[0] + np.linspace(0.03, 0.97, _INSTANTS) * length
    spacing = float(tried[1] - tried[0])
    best = _best(trial, fit, tried)
    for _ in range(4):
        near = best + spacing * np.linspace(-0.75, 0.75, 7)
        best = _best(trial, fit, near[(near > time[0]) & (near < time[-1])])
        spacing /= 3.0
    return best


def _best(trial: PowerProblem, fit: PowerFit, tried: Array) -> float:
    """Return at which of the instants tried (n,) the last load step explains most [s]."""
    left = trial.with_last_load(fit.vector, tried)
    bics = [ar1_bic(residuals, 0) if np.all(np.isfinite(residuals)) else np.inf for residuals in left]
    return float(tried[np.argmin(bics)])


_NEAR = 10.0  # BIC points
_CARRIED = 2  # starts that loads are sought for


class Way(NamedTuple):
    """One lag and two, each with the same start, drift and loads, and their fits."""

    problems: list[PowerProblem]
    fits: list[PowerFit]

    @property
    def bic(self) -> float:
        """The better of the two."""
        return min(map(bic_of, self.problems, self.fits))


def with_events(problems: Sequence[PowerProblem], fits: Sequence[PowerFit], *, closed_loop: bool) -> Way:
    """Return one lag and two with the initial state, drift and loads that explain the log best.

    A wrong initial state looks like a drift or a load, and a drift like a load, so they have to be chosen together.
    `closed_loop`: a controller moved the power.
    """
    initial_way = Way(list(problems), list(fits))
    beginnings = [_begun(initial_way, start) for start in starts(problems[0], closed_loop=closed_loop)]
    drifting = {id(way): _drifting(way) for way in beginnings}
    carried = sorted(beginnings, key=lambda way: min(way.bic, drifting[id(way)].bic))[:_CARRIED]
    ways = []
    for way in carried:
        ways += [Way(*with_loads(*drifting[id(way)])), _drifting(Way(*with_loads(*way)))]
    return min(ways, key=_worth)


def without_events(way: Way) -> Way:
    """Return the explanation without drift and loads, with its initial state."""
    if not way.problems[0].drift and not way.problems[0].loads_s:
        return way
    problems = [replace(problem, drift=False, loads_s=()) for problem in way.problems]
    return Way(problems, [min((near, problem.fit()), key=lambda fit: bic_of(problem, fit))
                          for problem, near in zip(problems, refit_all(problems, way.fits), strict=True)])


def refit_all(problems: Sequence[PowerProblem], fits: Sequence[PowerFit]) -> list[PowerFit]:
    """Return the fits that fits of similar problems lead to."""
    return [problem.refine(fit.vector[None, :]) for problem, fit in zip(problems, fits, strict=True)]


def _worth(way: Way) -> tuple[bool, float]:
    """Return whether a load imitates the unknown power before the log, then the criterion.

    An obvious steady state is not abandoned for a small improvement.
    """
    first, fit = way.problems[0], way.fits[0]
    time = first.readings.time_s
    arrived = float(time[0]) + 2.0 * float(fit.vector[1]) + _FEW * float(np.median(np.diff(time)))
    plain = first.at_rest and fit.model is not None and is_plain_rest(first, fit.model.lags_s[0])
    return any(t < arrived for t in first.loads_s), way.bic - _NEAR * plain


def _begun(way: Way, start: PowerProblem) -> Way:
    """Return the way with another start."""
    if start.power_before_pct == way.problems[0].power_before_pct and not start.at_rest:
        return way
    others = [replace(p, power_before_pct=start.power_before_pct, at_rest=start.at_rest) for p in way.problems]
    near = refit_all(others, way.fits)
    if not start.at_rest:
        return Way(others, near)
    # a free initial state may have led far off
    return Way(others, [min((fit, other.fit()), key=lambda trial: bic_of(other, trial))
                        for other, fit in zip(others, near, strict=True)])


def _drifting(way: Way) -> Way:
    """Return the way with a drift of the ambient where one lag and two both ask for it."""
    if not any(map(left_over, *way)):
        return way
    others = [replace(problem, drift=True) for problem in way.problems]
    tried = Way(others, refit_all(others, way.fits))
    worth = [bic_of(*before) - bic_of(*after) for before, after in
             zip(zip(*way, strict=True), zip(*tried, strict=True), strict=True)]
    return tried if min(worth) > _NEAR else way
