"""The initial state, drift of the ambient, and load steps that a log needs besides its heater, chosen together.

Load steps (an open lid, another heater) begin at unknown instants. A test that starts in steady state has no initial
state to fit: a free one would absorb model error at the first step, and the ambient with it. If the readings before
the first change of power suffice, they decide: a temperature that moves at constant power is not in steady state.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from heatertune.arrays import Array
from heatertune.model.outliers import replace_outliers, sensor_step
from heatertune.model.power.open_loop import PowerFit, PowerProblem
from heatertune.model.power.regressors import AMBIENT, GAIN, Readings
from heatertune.model.statistics import ar1_bic

__all__ = [
    "Way", "bic_of", "coincides", "edges_of", "is_plain_rest", "is_sensible", "left_over", "lowest_degC",
    "refit_all", "starts", "with_events", "with_loads", "without_events",
]


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
        begun = replace(problem, power_before_pct=before)
        yield begun
        if _may_rest(begun) and not (closed_loop and not _held(begun)):
            yield replace(begun, at_rest=True)


def _may_rest(problem: PowerProblem) -> bool:
    """Return whether the first readings may be the steady state of the power before the log.

    If this power continues, they hardly move; if power came on with the log, no later reading is colder.
    """
    if _held(problem):
        slope = _slope(problem.readings)
        return slope is not None and not slope.is_seen
    readings = problem.readings.temperature_degC
    noise = float(np.std(np.diff(readings, 2))) / np.sqrt(6.0)
    return problem.power_before == 0.0 and float(readings.min()) > float(readings[0]) - 2.0 * _SURE * noise


def is_plain_rest(problem: PowerProblem, lag_s: float) -> bool:
    """Return whether the readings before the first change of the power leave nothing but rest.

    A deviation from rest would decay with the lag [s]: its slope, as far as the readings allow one, bounds it.
    """
    slope = _slope(problem.readings) if _held(problem) else None
    if slope is None or slope.is_seen:
        return False
    most = (abs(slope.degC_per_s) + _SURE * slope.error_degC_per_s) * lag_s
    return most < _SHARE * float(np.ptp(problem.readings.temperature_degC))


def _held(problem: PowerProblem) -> bool:
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
_COLDER = 0.05  # of the span: noise and a poor start
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
    return float(fit.linear[AMBIENT]) <= lowest_degC(problem) + _COLDER * float(np.ptp(readings))


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
    given = Way(list(problems), list(fits))
    begun = [_begun(given, start) for start in starts(problems[0], closed_loop=closed_loop)]
    drifting = {id(way): _drifting(way) for way in begun}
    carried = sorted(begun, key=lambda way: min(way.bic, drifting[id(way)].bic))[:_CARRIED]
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
