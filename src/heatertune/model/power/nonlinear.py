"""Nonlinear heaters: gain that depends on power, loss on temperature, different heating and cooling, a ceiling.

A linear fit lies between the extremes of such a heater, and the worst resulting design uses a third of the true gain.
If another shape explains a log better, the local heaters at both its ends become candidates, unless a load explains
it.

Gain by power: the effective power is a rising piecewise linear curve through the logged levels. Its slopes enter the
temperature linearly, so only lags and dead time are searched.

Direction and temperature: T' = (gain·power(t − dead time) − θ·(1 + loss·θ))/time constant, θ = T − ambient, with the
time constant of heating if the right side is positive, else that of cooling. T stays below the ceiling; a second lag
follows. The solution is exponential in steps in which θ hardly moves, and exact without nonlinear loss.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.compiled import compile_function
from heatertune.heater.exact import advance_step, factors
from heatertune.log.log_values import ABSOLUTE_ZERO_DEGC
from heatertune.model.diagnostics import Remark
from heatertune.model.least_squares import minimise
from heatertune.model.model_values import Fopdt, HeaterModel, TwoLag
from heatertune.model.power.disturbance_fit import Way, bic_of, coincides, left_over, refit_all, with_loads
from heatertune.model.power.loss_fit import LossFit, fit_loss_curves
from heatertune.model.power.open_loop import PowerFit, PowerProblem
from heatertune.model.power.regressors import AMBIENT, DRIFT, FIRST_STATE, GAIN, SECOND_STATE
from heatertune.model.power.two_scales_fit import TwoScaleFit, fit_two_scales
from heatertune.model.statistics import ar1_bic

__all__ = [
    "BEND", "CEILING", "COOLING", "LOSS", "Bend", "BentHeater", "InputCurve", "bend_remarks", "fit_bent_heater",
    "fit_input_curve", "judged_linear", "knots_of",
]


Rows = npt.NDArray[np.intp]

_INPUT_CURVE_READINGS = 250  # averaged, in the search
_KNOTS = 5  # of more levels than _LEVELS, at quantiles
_LEVELS = 8
_APART = 0.1  # of the range of the power: closer knots do not identify a slope
_SPREAD = np.array([0.0, 0.4, -0.4])  # of ln lag, of the starts


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class InputCurve:
    """The best piecewise linear curve.

    Attributes:
        knots_pct: powers at which the gain changes, the least and the greatest included, shape (k + 1,).
        gains_degC_per_pct: between them, none negative, shape (k,).
        vector: ln first lag, dead time, lag ratio.
        simulated_degC: shape (n,).
        unknowns: number of fitted numbers.
    """

    knots_pct: Array
    gains_degC_per_pct: Array
    vector: Array
    simulated_degC: Array
    unknowns: int


def knots_of(problem: PowerProblem) -> Array:
    """Return the powers between which gains are identifiable: logged levels, or quantiles of many; shape (k,) [%]."""
    readings = problem.readings
    durations_s = np.diff(readings.edge_s, append=max(readings.time_s[-1], readings.edge_s[-1]))
    levels = np.append(readings.level_pct[durations_s > 0.0], problem.power_before)
    values = np.unique(levels)
    if len(values) > _LEVELS:
        order = np.argsort(readings.level_pct)
        shares = np.cumsum(durations_s[order]) / durations_s.sum()
        inner = np.interp(np.linspace(0.0, 1.0, _KNOTS)[1:-1], shares, readings.level_pct[order])
        values = np.unique([values[0], *inner, values[-1]])
    apart = _APART * (values[-1] - values[0])
    knots = [float(values[0])]
    for value in values[1:-1]:
        if value - knots[-1] > apart and values[-1] - value > apart:
            knots.append(float(value))
    return np.array([*knots, values[-1]] if values[-1] > values[0] else knots)


def fit_input_curve(problem: PowerProblem, near: PowerFit) -> InputCurve | None:
    """Return the best curve starting from a fit of constant gain, None if the log has only two powers."""
    knots = knots_of(problem)
    if len(knots) < 3:
        return None
    coarse = problem.average(_INPUT_CURVE_READINGS)
    ramps = [_ramp(coarse, *ends) for ends in pairwise(knots)]
    record = coarse.readings.temperature_degC

    def residuals(z: Array, _: Rows) -> Array:
        return np.array([_solved(coarse, ramps, row)[1] for row in z]) - record

    starts = near.vector + np.outer(_SPREAD, [1.0, 0.0, 0.0])
    minima = minimise(residuals, starts, problem.low, problem.high, iterations=25)
    best = minima.parameters[np.argmin(minima.cost)]
    ramps = [_ramp(problem, *ends) for ends in pairwise(knots)]
    gains, simulated = _solved(problem, ramps, best)
    free = int(np.isnan(problem.fixed).sum()) - 1
    return InputCurve(
        knots_pct=knots, gains_degC_per_pct=gains, vector=best, simulated_degC=simulated,
        unknowns=2 + problem.two_lags + free + len(gains),
    )


def _ramp(problem: PowerProblem, low_pct: float, high_pct: float) -> PowerProblem:
    """Return the problem with nothing but the power between two knots."""
    readings = problem.readings
    return replace(
        problem, loads_s=(), power_before_pct=float(np.clip(problem.power_before, low_pct, high_pct)) - low_pct,
        readings=replace(readings, level_pct=np.clip(readings.level_pct, low_pct, high_pct) - low_pct),
    )


def _solved(problem: PowerProblem, ramps: list[PowerProblem], z: Array) -> tuple[Array, Array]:
    """Return gains and temperature for lags and dead time; negative gains are set to 0."""
    own = ramps[0].basis(z)
    linear = problem.fixed
    fixed = np.where(np.isnan(linear[: len(own)]), 0.0, linear[: len(own)])
    fixed[GAIN] = 0.0
    fixed_part = fixed @ own
    free = [place for place in (AMBIENT, DRIFT, FIRST_STATE, SECOND_STATE) if math.isnan(linear[place])]
    rising = [own[GAIN], *(ramp.basis(z)[GAIN] for ramp in ramps[1:])]
    columns = np.array([*rising, *own[free]])
    gains = np.zeros(len(rising))
    active = np.arange(len(columns))
    while True:
        chosen = columns[active]
        weights, *_ = np.linalg.lstsq(chosen.T, problem.readings.temperature_degC - fixed_part, rcond=None)
        bad = (active < len(rising)) & (weights < 0.0)
        if not bad.any():
            break
        active = np.delete(active, np.argmin(np.where(bad, weights, 0.0)))
    here = active < len(rising)
    gains[active[here]] = weights[here]
    return gains, fixed_part + weights @ chosen


#: indices in a vector: ln gain, ambient, first temperature, inner one above it, ln lag, ln of cooling's by warming's,
#: dead time, lag ratio, drift, loss times the span, ceiling
_GAIN, _AMBIENT, _START, _INNER, _LAG, COOLING, _DEAD, _RATIO, _DRIFT, LOSS, CEILING = range(11)
#: the kinds of nonlinearity, and the start of their search
BEND = {COOLING: (-0.5, 0.5), LOSS: (0.3, 1.5), CEILING: (-0.02, -0.1)}

_READINGS = 250  # averaged, in the search
_STEPS = 12.0  # to a time constant, if the loss makes the response nonlinear
_MOST_LOSS = 20.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BentHeater:
    """The best heater with one kind of nonlinearity.

    Attributes:
        gain_degC_per_pct, ambient_degC, dead_time_s: as for a linear heater; the gain is that at the ambient.
        lags_s: heating and cooling.
        ratio: of the second lag to that of heating, 0: none.
        loss_per_degC: growth of the loss with the temperature above the ambient.
        ceiling_degC: highest possible temperature.
        simulated_degC: shape (n,).
        unknowns: number of fitted numbers.
        on_bound: whether the nonlinear parameter ended on a bound of its search.
    """

    gain_degC_per_pct: float
    ambient_degC: float
    dead_time_s: float
    lags_s: tuple[float, float]
    ratio: float
    loss_per_degC: float
    ceiling_degC: float
    simulated_degC: Array
    unknowns: int
    on_bound: bool


def _advance(x: float, y: float, u: float, t: float, plant: Array) -> tuple[float, float]:
    """Return inner and outer temperature after t seconds with constant power; plant as in `_simulate`, here ambient."""
    gain, ambient, warming, cooling, second, loss, ceiling = plant
    while t > 0.0:
        stiff = 1.0 + loss * max(x - ambient, 0.0)
        end = ambient + gain * u / stiff
        lag = (warming if end > x else cooling) / stiff
        step = t if loss == 0.0 else min(t, lag / _STEPS)
        if second > 0.0:
            y, x = advance_step(y, x, end, factors(step, second, lag))
        else:
            x, _ = advance_step(x, x, end, factors(step, lag, 0.0))
        x = min(x, ceiling)
        y = x if second == 0.0 else min(y, ceiling)
        t -= step
    return x, y


def _simulate(time: Array, edges: Array, levels: Array, before: float, plants: Array, plant: Array, out: Array) -> None:
    """Fill out (n, m); a row of plants is as `_answers` makes it, plant (7,) is working space."""
    for row in range(plants.shape[0]):
        gain, ambient, y, x, warming, cooling, dead, second, drift, loss, ceiling = plants[row]
        plant[0], plant[2], plant[3], plant[4], plant[5], plant[6] = gain, warming, cooling, second, loss, ceiling
        acting, now, j = before, time[0], -1
        for i in range(len(time)):
            while True:
                edge = edges[j + 1] + dead if j + 1 < len(edges) else math.inf
                until = min(time[i], edge)
                if until > now:
                    plant[1] = ambient + drift * (0.5 * (now + until) - time[0])
                    x, y = _advance(x, y, acting, until - now, plant)
                    now = until
                if edge > time[i]:
                    break
                j += 1
                acting = levels[j]
            out[row, i] = y


def fit_bent_heater(problem: PowerProblem, near: PowerFit, bend: int) -> BentHeater:
    """Return the heater with one bend, see `BEND`, that a linear fit leads to."""
    coarse = problem.average(_READINGS)
    record = coarse.readings.temperature_degC
    low, high = _bounds(problem, near, bend)
    starts = _starts(problem, near, bend)

    def residuals(z: Array, _: Rows) -> Array:
        return _answers(coarse, z) - record

    minima = minimise(residuals, starts, low, high, iterations=40)
    best = minima.parameters[np.argmin(minima.cost)]
    gain, lag = (float(np.exp(best[i])) for i in (_GAIN, _LAG))
    span, highest = _span(problem)
    margin = 1e-3 * (high - low)[bend]
    return BentHeater(
        gain_degC_per_pct=gain, ambient_degC=float(best[_AMBIENT]), dead_time_s=float(best[_DEAD]),
        lags_s=(lag, lag * math.exp(best[COOLING])), ratio=float(best[_RATIO]), loss_per_degC=float(best[LOSS]) / span,
        ceiling_degC=highest + float(best[CEILING]) * span, simulated_degC=_answers(problem, best[None, :])[0],
        unknowns=int(np.count_nonzero(high > low)), on_bound=not low[bend] + margin < best[bend] < high[bend] - margin,
    )


def _span(problem: PowerProblem) -> tuple[float, float]:
    readings = problem.readings.temperature_degC
    return float(np.ptp(readings)), float(readings.max())


def _bounds(problem: PowerProblem, near: PowerFit, bend: int) -> tuple[Array, Array]:
    span, _ = _span(problem)
    first, ambient = float(near.simulated_degC[0]), float(near.linear[AMBIENT])
    low, high = np.zeros(11), np.zeros(11)
    low[_GAIN], high[_GAIN] = math.log(1e-4), math.log(1e3)
    low[_AMBIENT], high[_AMBIENT] = min(ambient, first) - span, max(ambient, first) + span
    if problem.ambient_degC is not None:
        low[_AMBIENT] = high[_AMBIENT] = problem.ambient_degC
    low[_START], high[_START] = first - span, first + span
    if problem.two_lags:
        low[_INNER], high[_INNER] = -span, span
    low[[_LAG, _DEAD, _RATIO]], high[[_LAG, _DEAD, _RATIO]] = problem.low, problem.high
    if problem.drift:
        most = span / float(np.ptp(problem.readings.time_s))
        low[_DRIFT], high[_DRIFT] = -most, most
    high[CEILING] = low[CEILING] = 1e3  # spans above the highest reading: none
    low[bend], high[bend] = {COOLING: (-2.5, 2.5), LOSS: (0.0, _MOST_LOSS), CEILING: (-0.5, 0.05)}[bend]
    return low, high


def _starts(problem: PowerProblem, near: PowerFit, bend: int) -> Array:
    z = np.zeros(11)
    gain, first = float(near.linear[GAIN]), float(near.simulated_degC[0])
    z[[_GAIN, _AMBIENT, _START, _DRIFT]] = math.log(max(gain, 2e-4)), near.linear[AMBIENT], first, near.linear[DRIFT]
    z[[_LAG, _DEAD, _RATIO]] = near.vector
    z[CEILING] = 1e3
    starts = np.tile(z, (4, 1))
    starts[:, bend] = [*BEND[bend], *BEND[bend]]
    if bend != COOLING:  # a bend hides gain, and lag with it
        starts[2:, _GAIN] += 0.5
        starts[2:, _LAG] += 0.5
        starts[2:, _AMBIENT] = problem.readings.temperature_degC.min()
    else:
        starts[2:, _LAG] += [0.4, -0.4]
    return starts


def _answers(problem: PowerProblem, z: Array) -> Array:
    """Return the readings of each vector, shape (n, m) [°C]."""
    span, highest = _span(problem)
    gain, lag = np.exp(z[:, _GAIN]), np.exp(z[:, _LAG])
    plants = np.column_stack([
        gain, z[:, _AMBIENT], z[:, _START], z[:, _START] + z[:, _INNER], lag, lag * np.exp(z[:, COOLING]), z[:, _DEAD],
        z[:, _RATIO] * lag, z[:, _DRIFT], z[:, LOSS] / span, highest + z[:, CEILING] * span,
    ])
    r = problem.readings
    out = np.empty((len(z), len(r.time_s)))
    compile_function(_simulate)(r.time_s, r.edge_s, r.level_pct, problem.power_before, plants, np.empty(7), out)
    return out


_NEAR = 10.0  # BIC points
_MISFIT = 1.3  # times the noise between neighbours, that a linear fit may leave over
_SATURATED = 0.1  # of the largest gain: less is no gain to control with
_ALIKE = 1.1  # ends nearer than that are one heater
_USE = 0.75  # of the span of the readings: the operating temperature, if not stated


class LocalHeater(NamedTuple):
    """A local heater, and where it is one."""

    model: HeaterModel
    at: str

    @property
    def rate(self) -> float:
        """Gain per time constant [°C/(s·%)]."""
        return self.model.gain_degC_per_pct / self.model.lags_s[0]


class Bend(NamedTuple):
    """A shape that explains a log better than a straight line: its two ends, the one with more gain per lag first."""

    ends: tuple[LocalHeater, LocalHeater]
    simulated_degC: Array
    bic: float
    sentence: str


class LinearityResult(NamedTuple):
    """The explanation by one lag and two, the nonlinear one that explains the log better, if any, and doubts.

    `extended`: heaters with a loss curve, or of two time scales, that explain it better than all of these.
    """

    way: Way
    bend: Bend | None = None
    notes: tuple[str, ...] = ()
    extended: tuple[LossFit | TwoScaleFit, ...] = ()


def bend_remarks(bend: Bend | None) -> tuple[Remark, ...]:
    """Return the findings of a nonlinear heater, empty for a linear one."""
    return () if bend is None else (Remark("nonlinear", bend.sentence),)


def judged_linear(plain: Way, eventful: Way) -> LinearityResult:
    """Return whether the heater is linear.

    Args:
        plain: one lag and two with their initial state, without drift and loads.
        eventful: with the drift and loads that a linear heater needs.
    """
    if len(plain.problems[0].readings.restart_s) or not _misses(plain):
        return LinearityResult(eventful)
    tried = [(bend, way) for way in _without_loads(plain, eventful) for bend in _bends(way)]
    bend, way = min(tried, key=lambda pair: pair[0].bic, default=(None, eventful))
    others = [eventful.bic, *(each.bic for each, _ in tried)]
    fits: list[LossFit | TwoScaleFit] = [*fit_loss_curves(plain.problems, plain.fits, min(others))]
    extended = tuple(fits or fit_two_scales(plain.problems[:1], min(others)))
    if bend is None or not _is_better(bend, eventful):
        return LinearityResult(eventful, None, _untold(eventful), extended)
    return LinearityResult(way, bend, (), extended)


def _is_better(bend: Bend, eventful: Way) -> bool:
    """Return whether a bend explains more than the linear heater with its drift, and loads apart from the edges."""
    dead = max(float(eventful.fits[0].vector[1]), bend.ends[0].model.dead_time_s)
    loads_s = tuple(t for t in eventful.problems[0].loads_s if not coincides(eventful.problems[0], dead, t))
    if loads_s == eventful.problems[0].loads_s:
        return bend.bic < eventful.bic - _NEAR
    problems = [replace(problem, loads_s=loads_s) for problem in eventful.problems]
    honest = Way(*with_loads(problems, refit_all(problems, eventful.fits), edges_dead_time_s=dead))
    # a load that no bend explains as well did set in with an edge
    return bend.bic < honest.bic - _NEAR and bend.bic < eventful.bic + _NEAR


def _untold(eventful: Way) -> tuple[str, ...]:
    if len(knots_of(eventful.problems[0])) > 2:
        return ()
    return ("What one lag and two leave over may be a gain that depends on the power, which a log of two powers cannot "
            "tell: log steps between three.",)


def _misses(way: Way) -> bool:
    """Return whether the better of one lag and two leaves larger residuals than the differences between neighbours."""
    place = int(np.argmin([bic_of(*pair) for pair in zip(*way, strict=True)]))
    if not left_over(way.problems[place], way.fits[place]):
        return False
    thin = way.problems[place].average(_READINGS)
    fit = thin.refine(way.fits[place].vector[None, :])
    if not np.all(np.isfinite(fit.simulated_degC)):
        return True  # averaged, no heater with a gain above 0 is left
    left = thin.readings.temperature_degC - fit.simulated_degC
    noise = float(np.sqrt(np.mean(np.diff(left, 2) ** 2) / 6.0))
    return float(np.sqrt(np.mean(left**2))) > _MISFIT * noise


def _without_loads(plain: Way, eventful: Way) -> Iterator[Way]:
    yield plain
    if eventful.problems[0].drift:
        problems = [replace(problem, drift=True) for problem in plain.problems]
        yield Way(problems, refit_all(problems, plain.fits))


def _bends(way: Way) -> Iterator[Bend]:
    """Yield every bend that a log shows, each with one lag and with two."""
    for problem, fit in zip(*way, strict=True):
        if fit.model is not None:
            curve = fit_input_curve(problem, fit)
            if curve is not None:
                yield from _of_curve(problem, curve)
            for bend in (COOLING, LOSS, CEILING):
                yield from _of_bent(problem, fit_bent_heater(problem, fit, bend), bend)


def _of_curve(problem: PowerProblem, curve: InputCurve) -> Iterator[Bend]:
    knots, gains = curve.knots_pct, curve.gains_degC_per_pct
    lag, dead, ratio = float(np.exp(curve.vector[0])), float(curve.vector[1]), float(curve.vector[2])
    able = np.flatnonzero(gains > _SATURATED * gains.max())
    if not len(able):  # no power warms it at all
        return
    strong, weak = able[np.argmax(gains[able])], able[np.argmin(gains[able])]
    if (strong == weak and len(able) == len(gains)) or _alike(gains[strong], gains.min()):
        return
    rises = np.append(0.0, np.cumsum(gains * np.diff(knots)))
    readings = problem.readings.temperature_degC
    use, lowest = _use(readings), float(readings.min())
    power = float(np.interp(use - lowest, rises, knots)) if rises[-1] > 0.0 else float(knots[-1])
    ends = tuple(
        LocalHeater(_heater(float(gains[i]), (lag, lag * ratio), dead, max(use - float(gains[i]) * power, lowest)),
            f"{knots[i]:.3g}…{knots[i + 1]:.3g} %")
        for i in (strong, weak)
    )
    clause = f"gain from {gains[strong]:.3g} °C/% at {ends[0].at} to {float(gains.min()):.3g} °C/% at " + (
        f"{knots[int(np.argmin(gains))]:.3g}…{knots[int(np.argmin(gains)) + 1]:.3g} % of power")
    yield _bend(problem, ends, curve.simulated_degC, curve.unknowns, clause)


def _of_bent(problem: PowerProblem, bent: BentHeater, bend: int) -> Iterator[Bend]:
    if bent.on_bound:
        return
    readings, ambient = problem.readings.temperature_degC, bent.ambient_degC
    dead, second = bent.dead_time_s, bent.ratio * bent.lags_s[0]

    def at(lag: float, stiff: float) -> HeaterModel:
        gain = bent.gain_degC_per_pct / stiff
        above = _use(readings) - ambient
        power = above * (1.0 + bent.loss_per_degC * above) / bent.gain_degC_per_pct
        return _heater(gain, (lag / stiff, second), dead, max(_use(readings) - gain * power, ambient))

    if bend == COOLING:
        ends = (LocalHeater(at(bent.lags_s[0], 1.0), "heating"), LocalHeater(at(bent.lags_s[1], 1.0), "cooling"))
        if not _alike(*bent.lags_s):
            clause = (f"it warms with a time constant of {bent.lags_s[0]:.3g} s and cools with {bent.lags_s[1]:.3g} s, "
                      f"gain {bent.gain_degC_per_pct:.3g} °C/% at both")
            yield _bend(problem, ends, bent.simulated_degC, bent.unknowns, clause)
    elif bend == LOSS:
        places = (float(readings.min()), float(readings.max()))
        stiff = [1.0 + 2.0 * bent.loss_per_degC * max(place - ambient, 0.0) for place in places]
        if not _alike(*stiff):
            cold, hot = (LocalHeater(at(bent.lags_s[0], s), f"{t:.3g} °C") for s, t in zip(stiff, places, strict=True))
            clause = (f"gain from {cold.model.gain_degC_per_pct:.3g} °C/% at {cold.at} to "
                      f"{hot.model.gain_degC_per_pct:.3g} °C/% at {hot.at}, and the time constant with it")
            yield _bend(problem, (cold, hot), bent.simulated_degC, bent.unknowns, clause)
    else:
        model = at(bent.lags_s[0], 1.0)
        end = LocalHeater(model, f"below {bent.ceiling_degC:.3g} °C")
        clause = (f"gain from {model.gain_degC_per_pct:.3g} °C/% at less than {bent.ceiling_degC:.4g} °C to 0 °C/% at "
                  "that temperature, which it does not pass")
        yield _bend(problem, (end, end), bent.simulated_degC, bent.unknowns, clause)


def _bend(problem: PowerProblem, ends: Sequence[LocalHeater], simulated: Array, unknowns: int, clause: str) -> Bend:
    first, second = sorted(ends, key=lambda end: -end.rate)
    return Bend(
        (first, second), simulated, ar1_bic(problem.readings.temperature_degC - simulated, unknowns),
        f"The heater is not linear: {clause}.",
    )


def _heater(gain: float, lags: tuple[float, float], dead: float, ambient: float) -> HeaterModel:
    ambient_degC = ambient if ambient >= ABSOLUTE_ZERO_DEGC else None
    second, first = sorted(lags)
    if second <= 0.0:
        return Fopdt(gain_degC_per_pct=gain, time_constant_s=first, dead_time_s=dead, ambient_degC=ambient_degC)
    return TwoLag(gain_degC_per_pct=gain, time_constant_s=first, second_time_constant_s=second, dead_time_s=dead,
                  ambient_degC=ambient_degC)


def _use(readings: Array) -> float:
    return float(readings.min()) + _USE * float(np.ptp(readings))


def _alike(first: float, second: float) -> bool:
    return max(first, second) < _ALIKE * min(first, second)
