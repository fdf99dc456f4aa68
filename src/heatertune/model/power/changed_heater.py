"""Find the instant from which a log is not of the heater of its beginning: an open circuit, a loose probe, a load.

A heater is fitted to the beginning of the log. As long as it foretells the readings, it is that heater; the instant
from which it does not, and never does again, is named with the option that cuts the log there. A heater that stops
responding while the power continues (fuse, contactor, wire) is detected as well. No log shows such an instant exactly:
each is stated with the interval in which it lies, and the option cuts at the begin of that interval.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np

from heatertune.arrays import Array
from heatertune.errors import InputError
from heatertune.log.log_values import MIN_SAMPLES, Log
from heatertune.model.power.disturbance_fit import Way, bic_of, is_sensible
from heatertune.model.power.open_loop import PowerFit, PowerProblem
from heatertune.model.power.regressors import AMBIENT, GAIN, Readings

__all__ = ["ChangePeriod", "departure", "is_impossible", "load_period", "opening", "refuse_changed", "refuse_opened",
           "residual_share", "with_load_at_departure"]

_PLAUSIBLE: Final = 8.6  # of twice the log-likelihood: 3.84 at 95 %, 1.5 times as far in standard deviations
_CLOSER: Final = 3  # searches, each 4 times as fine
_HALVINGS: Final = 6


class ChangePeriod(NamedTuple):
    """The interval in which a heater changes, and the most probable instant [s].

    Attributes:
        low_s: the earliest instant that the log allows.
        best_s: the most probable one.
        high_s: the latest instant that the log allows.
        until_s: the end of the readings that the change cannot have reached.
        decimals: of the log's clock.
        may_be_load: whether a load explains the log as well as an open circuit.
    """

    low_s: float
    best_s: float
    high_s: float
    until_s: float
    decimals: int
    may_be_load: bool = False

    @property
    def message(self) -> str:
        """The most probable instant and the interval, for a message."""
        scale, decimals = 10.0**self.decimals, self.decimals
        low, high = math.floor(self.low_s * scale) / scale, math.ceil(self.high_s * scale) / scale
        return f"{self.best_s:.{decimals}f} s (between {low:.{decimals}f} and {high:.{decimals}f} s)"

    @property
    def option(self) -> str:
        """The option that leaves out the readings after the change."""
        scale = 10.0**self.decimals
        return f"--until {math.floor(self.until_s * scale) / scale:.{self.decimals}f}"


def _period(readings: Readings, low_s: float, best_s: float, high_s: float, until_s: float) -> ChangePeriod:
    step = float(np.median(np.diff(readings.time_s)))
    return ChangePeriod(low_s, best_s, high_s, until_s, max(0, -math.floor(math.log10(step) + 1e-9)))


def _likely_period(readings: Readings, criterion: Callable[[float], float], tried: Array) -> ChangePeriod:
    """Return the instants at which a change is as probable as at the most probable one.

    Args:
        readings: of the log.
        criterion: of a fit whose change is at an instant [s]: BIC points.
        tried: instants in order, evenly spaced, shape (n,) [s].
    """
    spacing, near, best, least = float(tried[1] - tried[0]), tried, math.nan, math.inf
    for _ in range(_CLOSER + 1):
        worths = [criterion(float(instant)) for instant in near]
        if min(worths) < least:
            best, least = float(near[int(np.argmin(worths))]), min(worths)
        near = np.clip(best + spacing * np.linspace(-0.75, 0.75, 7), tried[0], tried[-1])
        spacing /= 4.0
    low, high = (_last_plausible(criterion, least, best, spacing, float(end)) for end in (tried[0], tried[-1]))
    return _period(readings, low, best, high, low)


def _last_plausible(
    criterion: Callable[[float], float], least: float, best_s: float, step_s: float, end_s: float
) -> float:
    """Return the farthest instant from the best one, towards an end, that is still plausible [s]."""
    inside, outside = best_s, end_s
    while inside != end_s:
        trial = inside + math.copysign(min(step_s, abs(end_s - inside)), end_s - inside)
        if criterion(trial) > least + _PLAUSIBLE:
            outside = trial
            break
        inside, step_s = trial, 2.0 * step_s
    for _ in range(_HALVINGS if inside != end_s else 0):
        middle = 0.5 * (inside + outside)
        inside, outside = (middle, outside) if criterion(middle) <= least + _PLAUSIBLE else (inside, middle)
    return inside


def load_period(problem: PowerProblem, fit: PowerFit, place: int) -> ChangePeriod:
    """Return the interval in which a load begins that was fitted.

    It is that of two lags: behind a second one the temperature answers later, which one lag takes for a later begin.

    Args:
        problem: with its loads.
        fit: of the problem.
        place: of the load.
    """
    thin = replace(problem, two_lags=True).average(_READINGS)
    time, loads = thin.readings.time_s, problem.loads_s
    start_vectors = [[*fit.vector[:2], max(float(fit.vector[2]), 0.03)], [*fit.vector[:2], 0.3]]
    near = thin.refine(np.array(start_vectors)).vector[None, :]

    def criterion(instant_s: float) -> float:
        moved = replace(thin, loads_s=(*loads[:place], instant_s, *loads[place + 1:]))
        return bic_of(moved, moved.refine(near))

    spacing = float(np.ptp(time)) / _INSTANTS
    tried = np.clip(loads[place] + spacing * np.linspace(-1.5, 1.5, 13), time[0], time[-1])
    return _likely_period(problem.readings, criterion, tried)

_READINGS: Final = 300  # averaged
_PREFIXES: Final = np.linspace(0.25, 0.9, 8)  # of the log
_EXPLAINED: Final = 0.97  # share of the variance before the instant
_TIMES: Final = 6.0  # the error of the fit, that a departure is beyond
_LEAST: Final = 0.03  # of the span, the same
_LARGE: Final = 0.15  # of the span, that the departure reaches
_ROUNDS: Final = 3
_FEWEST: Final = 5  # readings after the instant
_BEGINS: Final = 2.0  # times the error of the fit, where a departure begins
_BY_POWER: Final = 0.67  # of the span before the instant: the power moves it
_LOUD, _CLOSE = 2.0, 0.02  # times the noise, and of the span: the error of a heater that explains its log
_COLDEST: Final = -60.0  # of rooms [°C]
_LOADS: Final = 5  # instants at which a load is tried
_BETTER_BIC: Final = 20.0  # BIC points that a load has to be worth
_WIDEST: Final = 0.25  # of the log: a departure that begins within more is a slow part of the heater, not an event
_LASTS: Final = 0.8  # share of the readings after the instant that depart


def refuse_changed(log: Log, *problems: PowerProblem) -> None:
    """Refuse a log that is of another heater, or of another place, from some instant on.

    Args:
        log: for its name.
        problems: of one lag; the next ones where the first shows no such instant.

    Raises:
        InputError: the heater of the log's beginning does not make its end, see `departure`.
    """
    period = next((period for problem in problems if (period := departure(problem))), None)
    if period is not None:
        raise InputError(
            f"{log.name}: a heater explains the temperature up to t={period.message}, and from then on it does "
            "not answer the power as before (a probe that fell out or was moved, another unit, a second heater, "
            f"a load?); cut the log there: {period.option}")


def departure(problem: PowerProblem) -> ChangePeriod | None:
    """Return the interval in which the heater of the log's beginning ends to explain it; None: always, or never.

    Args:
        problem: of one lag.
    """
    readings = replace(problem.readings, restart_s=np.empty(0))
    thin = replace(problem, drift=False, loads_s=(), two_lags=True, readings=readings).average(_READINGS)
    ends = [end for share in _PREFIXES if (end := _explained_until(thin, float(share))) is not None]
    rested = replace(thin, at_rest=True)
    ends = ends or [end for share in _PREFIXES if (end := _explained_until(rested, float(share))) is not None]
    last = max(ends, key=lambda period: period.best_s, default=None)
    return None if last is None else _period(problem.readings, *last[:4])


def with_load_at_departure(way: Way, problem: PowerProblem) -> Way:
    """Return an explanation, or one with a load from the departure on, if it is better and the first leaves much.

    Under two-level control, a search that begins with the whole log does not find the heater beside a second one.

    Args:
        way: explanation of the whole log.
        problem: of one lag.
    """
    period = departure(problem) if residual_share(problem.readings, way.fits) > _CLOSE else None
    instants = () if period is None else np.linspace(period.low_s, period.high_s, _LOADS)
    tried = [_with_load(problem, float(instant_s)) for instant_s in instants]
    best = min(tried, key=lambda trial: trial.bic, default=way)
    return best if best.bic < way.bic - _BETTER_BIC and all(map(is_sensible, *best)) else way


def _with_load(problem: PowerProblem, instant_s: float) -> Way:
    """Return one lag and two with a load from an instant on."""
    loaded = replace(problem, drift=False, loads_s=(instant_s,))
    problems = [loaded, replace(loaded, two_lags=True)]
    return Way(problems, [each.fit() for each in problems])


def residual_share(readings: Readings, fits: Sequence[PowerFit]) -> float:
    """Return the least error of fits, as a share of the readings' span; infinite without a heater."""
    record = readings.temperature_degC
    errors = [float(np.std(record - fit.simulated_degC)) for fit in fits if fit.model is not None]
    return min(errors, default=math.inf) / float(np.ptp(record))


def is_impossible(way: Way) -> bool:
    """Return whether an explanation with a load has a room colder than any."""
    return bool(way.problems[0].loads_s) and min(float(fit.linear[AMBIENT]) for fit in way.fits) < _COLDEST


def _explained_until(problem: PowerProblem, share: float) -> ChangePeriod | None:
    """Return where a heater fitted to the first part of the log ends to foretell it, or None."""
    time = problem.readings.time_s
    end, period = float(time[0]) + share * float(np.ptp(time)), None
    for _ in range(_ROUNDS):
        period = _foretold_until(problem, end)
        if period is None or abs(period.best_s - end) <= 2.0 * float(np.median(np.diff(time))):
            return period
        end = period.best_s
    return period


def _foretold_until(problem: PowerProblem, end_s: float) -> ChangePeriod | None:
    """Return where a heater fitted up to an instant ends to foretell the log; None: it always does, or none shows.

    A slow part of the heater, which the beginning does not show, moves it away over much of the log.
    """
    time, record = problem.readings.time_s, problem.readings.temperature_degC
    rows = time <= end_s
    opening = replace(problem, readings=_first(problem.readings, end_s))
    count = int(np.count_nonzero(rows))
    if count < MIN_SAMPLES or len(rows) - count < _FEWEST or not np.ptp(opening.readings.level_pct):
        return None
    fit = opening.fit()
    if fit.model is None or not _is_heater(opening, fit):
        return None
    span, error = float(np.ptp(record[rows])), float(np.sqrt(np.mean((record[rows] - fit.simulated_degC) ** 2)))
    apart = np.abs(record - np.asarray(fit.linear @ problem.basis(fit.vector)))
    beyond = apart > max(_TIMES * error, _LEAST * span)
    places = [place for place in np.flatnonzero(beyond) if np.mean(beyond[place:place + _FEWEST]) >= _LASTS]
    place = int(places[0]) if places else len(time)  # the first departure that the next readings do not make good
    if not places or float(np.mean(beyond[place:])) < _LASTS or float(apart[place:].max()) < _LARGE * span:
        return None
    low_s, best_s = _begin(time, apart, place, _BEGINS * error, _LARGE * span)
    if float(time[place]) - low_s > _WIDEST * float(np.ptp(time)):
        return None
    return _period(problem.readings, low_s, best_s, float(time[place]), low_s)


def _begin(time: Array, apart: Array, place: int, noise: float, large: float) -> tuple[float, float]:
    """Return the earliest and the most probable begin of a departure [s].

    Noise hides its begin, and behind two lags it grows with the square of the time.

    Args:
        time: of the readings, shape (n,) [s].
        apart: how far they are from the heater, shape (n,) [°C].
        place: of a reading that departs.
        noise: departure that noise hides [°C].
        large: departure that the readings reach [°C].
    """
    while place > 0 and apart[place - 1] > noise:
        place -= 1
    best_s, far = float(time[max(place - 1, 0)]), place + int(np.argmax(apart[place:] > large))
    hidden, grown = math.sqrt(float(apart[place])), math.sqrt(float(apart[far]))
    before = float(time[far] - time[place]) * hidden / (grown - hidden) if grown > hidden else 0.0
    return max(min(float(time[place]) - before, best_s), float(time[0])), best_s


def _is_heater(problem: PowerProblem, fit: PowerFit) -> bool:
    """Return whether the power, not the initial state, moves the readings, and leaves a possible room behind."""
    record = problem.readings.temperature_degC
    power = fit.linear[GAIN] * problem.basis(fit.vector)[GAIN]
    noise = _noise(record)
    error = float(np.sqrt(np.mean((record - fit.simulated_degC) ** 2)))
    span = float(np.ptp(record))
    return (float(np.ptp(power)) > _BY_POWER * span and error < max(_LOUD * noise, _CLOSE * span)
            and error**2 < (1.0 - _EXPLAINED) * float(np.var(record))
            and _COLDEST < float(fit.linear[AMBIENT]) < float(record.max()))


def _noise(record: Array) -> float:
    return float(np.sqrt(np.mean(np.diff(record, 2) ** 2) / 6.0))


def _first(readings: Readings, end_s: float) -> Readings:
    rows, edges = readings.time_s <= end_s, readings.edge_s <= end_s
    return replace(
        readings, time_s=readings.time_s[rows], half_s=readings.half_s[rows],
        temperature_degC=readings.temperature_degC[rows], edge_s=readings.edge_s[edges],
        level_pct=readings.level_pct[edges])


_OPEN_CIRCUIT_READINGS: Final = 300  # averaged
_OPEN_PREFIXES: Final = np.linspace(0.2, 0.95, 16)  # of the log
_INSTANTS: Final = 60
_OPEN_EXPLAINED: Final = 0.98  # share of the variance, before the instant and over the whole log
_WITHOUT: Final = 0.1  # of the squares that the power as logged leaves after the instant
_BETTER: Final = 0.25  # of the squares that a heater leaves which answers all the time
_ON: Final = 0.1  # of the highest power: less was no power to answer to
_ROWS: Final = 2.0
_LEFT_NOISE, _LEFT_SPAN = 3.0, 0.01  # times the noise, and of the span, that a heater with an open circuit leaves
_OPEN_CIRCUIT_FEWEST: Final = 10  # readings after the instant
_GIVES_WAY: Final = 0.1  # of the span, that the temperature falls after it


class _Opened(NamedTuple):
    """A heater whose power ends to act: its problem, the fit before that, and the squares that it leaves of all."""

    problem: PowerProblem
    fit: PowerFit
    squares: float


def refuse_opened(log: Log, problem: PowerProblem, way: Way | None = None) -> None:
    """Refuse a log whose heater stops responding, with the instant.

    Args:
        log: for its name.
        problem: of one lag.
        way: explanation by loads, if there is one.

    Raises:
        InputError: it stops responding, see `opening`.
    """
    period = opening(problem, way)
    if period is not None:
        what = ((f"from t={period.message} on the temperature falls as without power, though the power goes on (cold "
                 "air or material, another load, an open circuit?)") if period.may_be_load else
                (f"the heater stops answering at t={period.message}: the power goes on, and the temperature falls as "
                 "without it (a fuse, a contactor, a thermal cut-out, a wire?)"))
        raise InputError(f"{log.name}: {what}; cut the log there: {period.option}")


def opening(problem: PowerProblem, way: Way | None = None) -> ChangePeriod | None:
    """Return the interval in which the heater stops responding permanently, or None.

    A heater is fitted to the start of the log, with a free initial state and, as a loop near its setpoint hardly shows
    ambient and gain apart, begun at rest. It has stopped if this fit continues to explain the log without power, and
    leaves ten times larger residuals with the logged power.

    Args:
        problem: of one lag.
        way: explanation by loads, if there is one.
    """
    best = _best_opening(problem)
    if best is None:
        return None
    period = _opening_period(best, problem.readings)
    return period._replace(may_be_load=_may_be_load(best, period.best_s, way))


@lru_cache(maxsize=1)
def _best_opening(problem: PowerProblem) -> _Opened | None:
    """Return the heater that stops responding and explains a log best, None where one that responds does as well.

    The last one is kept: a log is asked for it before and after its loads are known.
    """
    readings = replace(problem.readings, restart_s=np.empty(0))  # a heater that stops answering passes for a jump
    thin = replace(problem, drift=False, loads_s=(), two_lags=True, readings=readings).average(_OPEN_CIRCUIT_READINGS)
    tried = [opened for start in (thin, replace(thin, at_rest=True)) for share in _OPEN_PREFIXES
             if (opened := _after(start, float(share))) is not None]
    best = min(tried, key=lambda opened: opened.squares, default=None)
    if best is None:
        return None
    record = thin.readings.temperature_degC
    always = [problem.fit() for problem in (thin, replace(thin, two_lags=False))]
    least = min((float(np.sum((record - fit.simulated_degC) ** 2)) for fit in always if fit.model), default=np.inf)
    return best if best.squares < _BETTER * least else None


def _may_be_load(opened: _Opened, instant_s: float, way: Way | None) -> bool:
    """Return whether loads explain a log better than an open circuit, or this one leaves more than a heater does."""
    ended = _ended(opened.problem, instant_s)
    record = ended.readings.temperature_degC
    left = record - ended.refine(opened.fit.vector[None, :]).simulated_degC
    if float(np.std(left)) > max(_LEFT_NOISE * _noise(record), _LEFT_SPAN * float(np.ptp(record))):
        return True
    if way is None:
        return False
    like = way.problems[0]
    ends = [_ended(replace(like, loads_s=(), two_lags=True, at_rest=at_rest), instant_s) for at_rest in (False, True)]
    least = min(bic_of(ended, ended.refine(opened.fit.vector[None, :])) for ended in ends)
    return way.bic < least - _BETTER_BIC


def _opening_period(opened: _Opened, readings: Readings) -> ChangePeriod:
    """Return the interval in which a heater opens: heater and instant are fitted together to the whole log."""
    problem, time = opened.problem, opened.problem.readings.time_s

    def criterion(instant_s: float) -> float:
        ended = _ended(problem, instant_s)
        return bic_of(ended, ended.refine(opened.fit.vector[None, :]))

    period = _likely_period(
        readings, criterion, np.linspace(time[MIN_SAMPLES], time[-_OPEN_CIRCUIT_FEWEST], _INSTANTS))
    # while no power is on, nothing is lost by an open circuit; the dead time may be wrong by a row
    edges, levels = problem.readings.edge_s, problem.readings.level_pct
    start_s = period.low_s + _ROWS * float(np.median(np.diff(readings.time_s)))
    level_pct = levels[max(int(np.searchsorted(edges, start_s, "right")) - 1, 0)]
    on = edges[(levels > 0.0) & (edges >= start_s)]
    until = on[0] if len(on) and level_pct <= 0.0 else period.low_s
    return period._replace(until_s=float(until))


def _after(problem: PowerProblem, share: float) -> _Opened | None:
    """Return when a heater fitted to the first part of the log stops responding, or None."""
    readings = problem.readings
    time, record = readings.time_s, readings.temperature_degC
    rows = time <= time[0] + share * float(np.ptp(time))
    if np.count_nonzero(rows) < MIN_SAMPLES or np.count_nonzero(~rows) < _OPEN_CIRCUIT_FEWEST:
        return None
    opening = replace(problem, readings=_first(readings, float(time[rows][-1])))
    if float(np.ptp(opening.readings.level_pct)) == 0.0 and problem.power_before_pct is None:
        return None
    fit = opening.fit()
    if fit.model is None or not _explains(opening.readings.temperature_degC, fit.simulated_degC):
        return None
    if not is_sensible(opening, fit):
        return None  # of a step down, this fit may hold what remains of the power for the room
    instants = np.linspace(time[rows][len(time[rows]) // 2], time[-_OPEN_CIRCUIT_FEWEST], _INSTANTS)
    squares = [float(np.sum((_without(problem, fit, instant) - record) ** 2)) for instant in instants]
    place = int(np.argmin(squares))
    instant, after = float(instants[place]), time > instants[place]
    cut, unchanged = _without(problem, fit, instant), np.asarray(fit.linear @ problem.basis(fit.vector))
    plain = float(np.sum((unchanged[after] - record[after]) ** 2))
    left = float(np.sum((cut[after] - record[after]) ** 2))
    falls = float(np.median(record[after][:3]) - np.median(record[-3:])) > _GIVES_WAY * float(np.ptp(record))
    if left < _WITHOUT * plain and falls and _explains(record[after], cut[after]) and _is_on(readings, instant):
        return _Opened(problem, fit, squares[place])
    return None


def _without(problem: PowerProblem, fit: PowerFit, instant_s: float) -> Array:
    """Return the temperature where no power reaches the heater from an instant on, shape (n,) [°C]."""
    return np.asarray(fit.linear @ _ended(problem, instant_s).basis(fit.vector))


def _ended(problem: PowerProblem, instant_s: float) -> PowerProblem:
    """Return the problem in which no power reaches the heater from an instant on."""
    readings = problem.readings
    before = readings.edge_s < instant_s
    edges, levels = np.append(readings.edge_s[before], instant_s), np.append(readings.level_pct[before], 0.0)
    return replace(problem, power_before_pct=problem.power_before,
                   readings=replace(readings, edge_s=edges, level_pct=levels))


def _is_on(readings: Readings, instant_s: float) -> bool:
    """Return whether the power goes on after an instant."""
    after = np.interp(readings.time_s, readings.edge_s, np.arange(len(readings.edge_s))).astype(np.intp)
    levels = readings.level_pct[after][readings.time_s > instant_s]
    return float(np.mean(levels)) > _ON * float(readings.level_pct.max())


def _explains(record: Array, simulated: Array) -> bool:
    left = float(np.sum((record - simulated) ** 2))
    return left < (1.0 - _OPEN_EXPLAINED) * float(np.sum((record - record.mean()) ** 2))
