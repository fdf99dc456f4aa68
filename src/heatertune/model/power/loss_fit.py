"""The loss curve of a heater, from a log of two powers or more: convection with radiation, or a power of the rise.

A heater with the curve of `heatertune.heater.heat_loss` and a sensor behind it or none is fitted to the temperature.
The curve is taken only where it leaves nothing but noise, where it explains the log better than any other nonlinear
heater does, and where its shape is known; what else explains the log nearly as well is plausible too. One power alone
shows the gain at one temperature, so it decides nothing about the shape.

Ends of the 95 % intervals are plausible heaters: of the shape, of the dead time, of the gain per time constant, and of
the power at twice the logged rise; the other parameters follow as in the fit's normal equations, whose noise is that of
first-order autoregressive residuals. As no real loss is just a formula, the curves are at least so far apart that the
power at twice the logged rise differs by 2 % both ways.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.compiled import compile_function
from heatertune.errors import OutOfRange
from heatertune.heater.exact import advance_step, factors
from heatertune.heater.heat_loss import ABSOLUTE_ZERO_DEGC, RADIATION, Loss, LossCurve, loss_at, tangent_at
from heatertune.model.least_squares import minimise
from heatertune.model.loss_curve import LossFopdt, LossTwoLag, heater_with_loss, steady_power_pct
from heatertune.model.model_values import HeaterModel
from heatertune.model.power.open_loop import PowerFit, PowerProblem
from heatertune.model.power.regressors import AMBIENT, GAIN, Readings
from heatertune.model.statistics import Interval, ar1_bic, sensor_step, student_t

__all__ = ["LossEnd", "LossFit", "fit_loss_curves", "leaves_noise", "steady_levels"]

#: ln gain, room, first temperature, that of the mass above it, ln lag, dead time, ln sensor's lag, shape
_GAIN, _ROOM, _START, _INNER, _LAG, _DEAD, _SENSOR, _SHAPE = range(8)
_COARSE: Final = 200  # averaged readings in the search
_STEPS: Final = (24.0, 96.0)  # to the lag at the highest temperature, in the search and after it
_LEAST: Final = 0.02  # of the power at twice the logged rise, by which the plausible curves differ both ways
_NOISE: Final = 1.3  # times the noise between neighbours, that the fit may leave over
_NEAR: Final = 10.0  # BIC points
_KNOWN: Final = 0.15  # half the interval of a share or an exponent, at most
_FAR: Final = 2.0  # times the logged rise, at which the power's interval has heaters of its own
_HELD: Final = 0.7  # time constants for which a power has to be held to count as a level
_APART: Final = 0.1  # of the rise: two levels lie further apart


class _Family(NamedTuple):
    """A kind of curve: whether it counts from absolute zero, and the range of its shape with two starts."""

    radiates: bool
    low: float
    high: float
    starts: tuple[float, float]

    def curve(self, shape: float, at: float) -> LossCurve:
        """Return the curve of a shape, with its chord at a temperature [°C]."""
        if self.radiates:
            return LossCurve(share=shape, exponent=RADIATION, origin_degC=ABSOLUTE_ZERO_DEGC, at_degC=at)
        return LossCurve(share=1.0, exponent=shape, at_degC=at)


#: convection and radiation, whose shape is radiation's share; and a power of the rise, whose shape is the exponent
_FAMILIES: Final = (_Family(True, 0.0, 1.0, (0.3, 0.8)), _Family(False, 1.0, 2.0, (1.15, 1.45)))


class LossEnd(NamedTuple):
    """A plausible heater beyond one lag and two, and the end of an interval that it represents; empty: the fit."""

    model: HeaterModel
    part: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LossFit:
    """The best heater with one kind of loss curve.

    Attributes:
        heaters: the fit, and the ends of its intervals.
        shape: share of radiation at the highest reading, or exponent.
        shape_ci95: its interval.
        levels_degC: temperatures at which the log holds the power.
        simulated_degC: shape (n,).
        bic: Bayesian information criterion.
        problem: that was solved.
    """

    heaters: tuple[LossEnd, ...]
    shape: float
    shape_ci95: Interval
    levels_degC: tuple[float, ...]
    simulated_degC: Array
    bic: float
    problem: PowerProblem

    method = "simulation with the logged power and a loss curve"

    @property
    def problems(self) -> tuple[PowerProblem, ...]:
        """The problem of its one log."""
        return (self.problem,)

    @property
    def simulations_degC(self) -> tuple[Array, ...]:
        """The simulation of its one log, shape (n,)."""
        return (self.simulated_degC,)

    @property
    def model(self) -> HeaterModel:
        """The heater."""
        return self.heaters[0].model

    @property
    def law(self) -> str:
        """The curve, in a few words."""
        curve = self.model.loss
        assert curve is not None
        if curve.is_radiation:
            return f"power logged, {100.0 * self.shape:.0f} % of the loss at {curve.at_degC:.0f} °C is radiation"
        return f"power logged, loss as the rise to the power of {self.shape:.2f}"

    @property
    def sentence(self) -> str:
        """What was found, with its interval."""
        curve, ci95 = self.model.loss, self.shape_ci95
        low, high = ci95.low or 0.0, ci95.high or 0.0
        assert curve is not None
        levels = " and ".join(f"{level:.0f}" for level in self.levels_degC)
        power_pct = steady_power_pct(self.model, curve.at_degC)
        power = f"{power_pct:.3g} % of power hold {curve.at_degC:.0f} °C"
        if curve.is_radiation:
            return (f"The heat loss is a curve, known from {levels} °C: convection and radiation, "
                    f"{100.0 * self.shape:.1f} % of it radiation at {curve.at_degC:.0f} °C "
                    f"({100.0 * low:.1f}…{100.0 * high:.1f} %); {power}.")
        return (f"The heat loss is a curve, known from {levels} °C: it grows as the rise above the ambient to the "
                f"power of {self.shape:.3f} ({low:.3f}…{high:.3f}); {power}.")


def steady_levels(problem: PowerProblem, time_constant_s: float) -> tuple[float, ...]:
    """Return the temperatures that the log reaches with powers above 0 held long enough, apart from each other [°C]."""
    readings = problem.readings
    time, temperature = readings.time_s, readings.temperature_degC
    ends = [*readings.edge_s[1:], time[-1]]
    reached = []
    for begin, end, level in zip(readings.edge_s, ends, readings.level_pct, strict=True):
        rows = np.flatnonzero((time >= begin) & (time <= end))
        if level > 0.0 and end - begin >= _HELD * time_constant_s and len(rows):
            reached.append(float(np.median(temperature[rows[-max(len(rows) // 20, 1):]])))
    apart = _APART * float(np.ptp(temperature))
    levels: list[float] = []
    for each in sorted(reached):
        if not levels or each - levels[-1] > apart:
            levels.append(each)
    return tuple(levels)


def fit_loss_curves(problems: Sequence[PowerProblem], fits: Sequence[PowerFit], better_than: float) -> list[LossFit]:
    """Return the loss curves that explain a log, the best first; none where the log does not ask for one.

    Args:
        problems: of one lag and of two, without drift and loads.
        fits: their best fits.
        better_than: BIC of the best heater of any other kind.
    """
    levels = steady_levels(problems[0], _shortest_hold(problems[0]))
    if len(levels) < 2 or len(problems[0].readings.restart_s) or problems[0].drift or fits[0].model is None:
        return []
    if fits[0].linear[GAIN] <= 0.0:
        return []
    loss_fits = []
    for family in _FAMILIES:
        for problem in problems:
            solution = _fit(problem, fits[0], family)
            if solution.bic < better_than - _NEAR and (fit := _described(solution, levels)) is not None:
                loss_fits.append(fit)
    loss_fits.sort(key=lambda fit: fit.bic)
    near_fits = [fit for fit in loss_fits if fit.bic < loss_fits[0].bic + _NEAR]
    if not near_fits or not all(map(_is_known, near_fits)):
        return []
    return near_fits if leaves_noise(near_fits[0].problem.readings, near_fits[0].simulated_degC) else []


def _shortest_hold(problem: PowerProblem) -> float:
    """Return the time constant at the end of the log's longest hold: when 63 % of its way are done [s]."""
    readings = problem.readings
    time, temperature = readings.time_s, readings.temperature_degC
    ends = np.append(readings.edge_s[1:], time[-1])
    shortest = math.inf
    for begin, end in zip(readings.edge_s, ends, strict=True):
        rows = np.flatnonzero((time >= begin) & (time <= end))
        if len(rows) < 8:
            continue
        part = temperature[rows]
        way = part[-1] - part[0]
        if abs(way) > _APART * float(np.ptp(temperature)):
            done = np.flatnonzero((part - part[0]) / way > 0.63)
            shortest = min(shortest, float(time[rows[done[0]]] - begin)) if len(done) else shortest
    return 0.0 if math.isinf(shortest) else shortest


class _Solution(NamedTuple):
    """A fit: the vector, its bounds, the problem and the family."""

    vector: Array
    bounds: tuple[Array, Array]
    problem: PowerProblem
    family: _Family
    simulated_degC: Array
    bic: float


def _fit(problem: PowerProblem, near: PowerFit, family: _Family) -> _Solution:
    low, high = _bounds(problem, near, family)
    coarse = problem.average(_COARSE)
    vectors = _starts(problem, near, family)
    for thin, iterations, steps in zip((coarse, problem), (40, 12), _STEPS, strict=True):
        record = thin.readings.temperature_degC

        def residuals(z: Array, _: npt.NDArray[np.intp], thin: PowerProblem = thin, record: Array = record,
                      steps: float = steps) -> Array:
            return _answers(thin, z, family, steps) - record

        minima = minimise(residuals, vectors, low, high, iterations=iterations)
        vectors = minima.parameters[np.argsort(minima.cost)[:1]]
    simulated = _answers(problem, vectors, family)[0]
    unknowns = int(np.count_nonzero(high > low))
    return _Solution(vectors[0], (low, high), problem, family, simulated,
                   ar1_bic(problem.readings.temperature_degC - simulated, unknowns))


def _bounds(problem: PowerProblem, near: PowerFit, family: _Family) -> tuple[Array, Array]:
    readings = problem.readings.temperature_degC
    span, first = float(np.ptp(readings)), float(near.simulated_degC[0])
    low, high = np.zeros(8), np.zeros(8)
    low[_GAIN], high[_GAIN] = math.log(1e-4), math.log(1e3)
    low[_ROOM], high[_ROOM] = float(readings.min()) - 0.1 * span, float(readings.min()) + 0.1 * span
    if problem.ambient_degC is not None:
        low[_ROOM] = high[_ROOM] = problem.ambient_degC
    low[_START], high[_START] = first - 0.5 * span, first + 0.5 * span
    low[_LAG], high[_LAG] = problem.low[0], problem.high[0] + 1.5
    low[_DEAD], high[_DEAD] = problem.low[1], problem.high[1]
    if problem.two_lags:
        low[_INNER], high[_INNER] = -0.5 * span, 0.5 * span
        low[_SENSOR], high[_SENSOR] = problem.low[0], problem.high[0]
    low[_SHAPE], high[_SHAPE] = family.low, family.high
    return low, high


def _starts(problem: PowerProblem, near: PowerFit, family: _Family) -> Array:
    readings = problem.readings
    top, room = float(readings.temperature_degC.max()), float(readings.temperature_degC.min())
    room = room if problem.ambient_degC is None else problem.ambient_degC
    gain = max(float(near.linear[GAIN]), 1e-3)
    level = float(readings.level_pct.max())
    chord = max((top - room) / level, 1e-3) if level > 0.0 else gain
    lag = float(near.vector[0])
    rows = []
    for shape in family.starts:
        for start_gain in (chord, gain):
            z = np.zeros(8)
            z[[_GAIN, _ROOM, _START]] = math.log(start_gain), room, float(near.simulated_degC[0])
            z[[_LAG, _DEAD, _SHAPE]] = lag + math.log(start_gain / gain), float(near.vector[1]), shape
            z[_SENSOR] = max(lag - 4.0, problem.low[0])
            rows.append(z)
    starts = np.array(rows)
    if problem.ambient_degC is None and abs(float(near.linear[AMBIENT]) - room) < 0.1 * (top - room):
        starts[1::2, _ROOM] = float(near.linear[AMBIENT])
    return starts


def _advance(x: float, y: float, u: float, t: float, heater: tuple[float, float, float, float, float],
             loss: Loss) -> tuple[float, float]:
    """Return the mass and the sensor after a time of constant power; heater: gain, lag, sensor's lag, room, step."""
    gain, lag, sensor, room, step = heater
    while t > 0.0:
        h = min(t, step)
        line = tangent_at(x, gain, lag, room, loss)
        target = line.ambient + line.gain * u
        if sensor > 0.0:
            y, x = advance_step(y, x, target, factors(h, sensor, line.lag))
        else:
            x, _ = advance_step(x, x, target, factors(h, line.lag, 0.0))
            y = x
        t -= h
    return x, y


def _simulate(time: Array, edges: Array, levels: Array, before: float, heaters: Array, out: Array) -> None:
    """Fill out (n, m); a row of heaters is as `_answers` makes it."""
    for row in range(heaters.shape[0]):
        gain, room, y, x, lag, dead, sensor = heaters[row, :7]
        loss = Loss(heaters[row, 7], heaters[row, 8], heaters[row, 9], heaters[row, 10], heaters[row, 11])
        heater = gain, lag, sensor, room, heaters[row, 12]
        acting, now, j = before, time[0], -1
        for i in range(len(time)):
            while True:
                edge = edges[j + 1] + dead if j + 1 < len(edges) else math.inf
                until = min(time[i], edge)
                if until > now:
                    x, y = _advance(x, y, acting, until - now, heater, loss)
                    now = until
                if edge > time[i]:
                    break
                j += 1
                acting = levels[j]
            out[row, i] = y


def _answers(problem: PowerProblem, z: Array, family: _Family, steps: float = _STEPS[-1]) -> Array:
    """Return the readings of each vector, shape (n, m) [°C]."""
    readings = problem.readings
    top = float(readings.temperature_degC.max())
    heaters = np.array([_numbers(row, family, top, steps, two_lags=problem.two_lags) for row in z])
    # of an averaged reading, the mean of two instants is exact up to the third order of its length (Gauss–Legendre)
    apart = readings.half_s / math.sqrt(3.0)
    time = readings.time_s
    if apart.any():
        time = np.column_stack([time - apart, time + apart]).ravel()
    out = np.empty((len(z), len(time)))
    compile_function(_simulate)(time, readings.edge_s, readings.level_pct, problem.power_before, heaters, out)
    return out if time is readings.time_s else 0.5 * (out[:, ::2] + out[:, 1::2])


def _numbers(z: Array, family: _Family, top: float, steps: float, *, two_lags: bool) -> list[float]:
    room, lag = float(z[_ROOM]), math.exp(z[_LAG])
    loss = family.curve(float(z[_SHAPE]), top).loss(room)
    slope = loss_at(top, room, loss)[1]
    return [math.exp(z[_GAIN]), room, float(z[_START]), float(z[_START] + z[_INNER]), lag, float(z[_DEAD]),
            math.exp(z[_SENSOR]) if two_lags else 0.0, *loss, lag / slope / steps]


def _heater(z: Array, solution: _Solution) -> HeaterModel | None:
    """Return the heater of a vector, None where it is none."""
    top = float(solution.problem.readings.temperature_degC.max())
    numbers = {"gain_degC_per_pct": math.exp(z[_GAIN]), "time_constant_s": math.exp(z[_LAG]),
               "dead_time_s": max(float(z[_DEAD]), 0.0), "ambient_degC": float(z[_ROOM]),
               "loss": solution.family.curve(float(z[_SHAPE]), top)}
    try:
        if solution.problem.two_lags:
            return LossTwoLag(**numbers, second_time_constant_s=math.exp(z[_SENSOR]))  # type: ignore[arg-type]
        return LossFopdt(**numbers)  # type: ignore[arg-type]
    except OutOfRange:
        return None


def _described(solution: _Solution, levels: tuple[float, ...]) -> LossFit | None:
    """Return a fit with the ends of its intervals, None where it is no heater or a parameter is not known at all."""
    model, covariance = _heater(solution.vector, solution), _covariance(solution)
    if model is None or covariance is None:
        return None
    shape = float(solution.vector[_SHAPE])
    reach = student_t(max(len(solution.simulated_degC) - 8, 2)) * math.sqrt(covariance[_SHAPE, _SHAPE])
    return LossFit(
        heaters=(LossEnd(model, ""), *_ends(solution, covariance)), shape=shape,
        shape_ci95=Interval(low=max(shape - reach, solution.family.low), high=min(shape + reach, solution.family.high)),
        levels_degC=levels, simulated_degC=solution.simulated_degC, bic=solution.bic, problem=solution.problem)


def _covariance(solution: _Solution) -> Array | None:
    """Return the covariance of the free parameters, shape (8, 8), 0 for the others; None where it is singular."""
    (low, high), z, readings = solution.bounds, solution.vector, solution.problem.readings
    free = np.flatnonzero(high > low)
    steps = 1e-4 * (high - low)[free]
    moved = np.tile(z, (2 * len(free), 1))
    moved[np.arange(len(free)), free] += steps
    moved[len(free) + np.arange(len(free)), free] -= steps
    shapes = np.clip(moved[:, _SHAPE], low[_SHAPE], high[_SHAPE])  # there is no share below 0
    spans = 2.0 * steps - np.abs(moved[:, _SHAPE] - shapes).reshape(2, -1).sum(axis=0)
    moved[:, _SHAPE] = shapes
    answers = _answers(solution.problem, moved, solution.family)
    slopes = (answers[:len(free)] - answers[len(free):]) / spans[:, None]
    left = readings.temperature_degC - solution.simulated_degC
    rho = float(np.clip(left[1:] @ left[:-1] / max(float(left @ left), 1e-300), 0.0, 0.98))
    variance = float(left @ left) / max(len(left) - len(free), 1) * (1.0 + rho) / (1.0 - rho)
    scale = np.sqrt(np.sum(slopes**2, axis=1))
    if not np.all(scale > 0.0) or not np.all(np.isfinite(slopes)):
        return None
    unit = slopes / scale[:, None]
    normal = unit @ unit.T
    if np.linalg.cond(normal) > 1e12:
        return None
    whole = np.zeros((8, 8))
    whole[np.ix_(free, free)] = variance * np.linalg.inv(normal) / np.outer(scale, scale)
    return whole


def _ends(solution: _Solution, covariance: Array) -> Iterator[LossEnd]:
    """Yield the heaters at the ends of intervals, the other parameters following."""
    low, high = solution.bounds
    reach = student_t(max(len(solution.simulated_degC) - 8, 2))
    far = _by_power(solution)
    directions = {"loss curve": np.eye(8)[_SHAPE], "dead time": np.eye(8)[_DEAD],
                  "gain per time constant": np.eye(8)[_GAIN] - np.eye(8)[_LAG],
                  "power beyond the log": far}
    for name, direction in directions.items():
        deviation = math.sqrt(max(float(direction @ covariance @ direction), 0.0))
        if deviation == 0.0:
            continue
        for sign, end in ((-1.0, "low"), (1.0, "high")):
            moved = solution.vector + sign * reach * (covariance @ direction) / deviation
            if name == "loss curve" and reach * deviation * abs(far[_SHAPE]) < _LEAST:  # no real loss is just a formula
                moved = solution.vector + sign * _LEAST / abs(far[_SHAPE]) * direction
            model = _heater(np.clip(moved, low, high), solution)
            if model is not None:
                yield LossEnd(model, f"{name} at its {end} end")


def _by_power(solution: _Solution) -> Array:
    """Return the slopes of the logarithm of the power that holds twice the logged rise, shape (8,)."""
    top = float(solution.problem.readings.temperature_degC.max())
    room = float(solution.vector[_ROOM])
    far, slopes = room + _FAR * (top - room), np.zeros(8)
    low, high = solution.bounds
    for place in np.flatnonzero(high > low):
        step = 1e-4 * (high - low)[place]
        powers = []
        for sign in (1.0, -1.0):
            moved = solution.vector.copy()
            moved[place] = np.clip(moved[place] + sign * step, low[place], high[place])
            model = _heater(moved, solution)
            powers.append(math.nan if model is None else math.log(steady_power_pct(model, far)))
        slopes[place] = (powers[0] - powers[1]) / (2.0 * step)
    return np.nan_to_num(slopes)


def _is_known(fit: LossFit) -> bool:
    """Return whether the shape is known, and the curve is one."""
    low, high = fit.shape_ci95.low or 0.0, fit.shape_ci95.high or math.inf
    family = _FAMILIES[0] if fit.model.loss is not None and fit.model.loss.is_radiation else _FAMILIES[1]
    return high - low <= 2.0 * _KNOWN and low > family.low and fit.shape < family.high + 1e-9 and all(
        heater_with_loss(end.model, fit.levels_degC[-1]).gain_degC_per_pct > 0.0 for end in fit.heaters)


def leaves_noise(readings: Readings, simulated_degC: Array, most: float = _NOISE) -> bool:
    """Return whether a fit leaves little more than the noise between neighbours, in the whole log and in each hold.

    Args:
        readings: that were fitted, n of them.
        simulated_degC: the fit, shape (n,).
        most: times the noise, in the whole log; in a hold half as much again.
    """
    left = readings.temperature_degC - simulated_degC
    step = sensor_step(readings.temperature_degC) or 0.0
    noise = max(float(np.sqrt(np.mean(np.diff(left, 2) ** 2) / 6.0)), step / math.sqrt(12.0))
    if float(np.sqrt(np.mean(left**2))) > most * noise:
        return False
    ends = [readings.time_s[0], *readings.edge_s[1:], readings.time_s[-1]]
    parts = [left[(readings.time_s >= begin) & (readings.time_s <= end)] for begin, end in pairwise(ends)]
    return all(float(np.sqrt(np.mean(part**2))) <= 1.5 * most * noise for part in parts if len(part) >= 20)
