"""Explain a log with power by one lag and by two, with the initial state, drift and loads that it needs.

A log may consist of segments: after a disturbance the heater is the same, but its state is estimated again. A jump is
detected in the residuals of a fit, which knows power and time, so neither an edge of a fast heater nor a gap looks
like one.

Outliers are removed from the one-lag fit. On/off power that was logged slower than it switches is recognised: its rows
are on or off by chance and are not the power that the heater received.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.errors import InputError
from heatertune.log.log_values import MIN_SAMPLES, Log
from heatertune.model.diagnostics import Remark
from heatertune.model.model_values import Fopdt
from heatertune.model.power.changed_heater import (
    is_impossible,
    refuse_changed,
    refuse_opened,
    residual_share,
    with_load_at_departure,
)
from heatertune.model.power.disturbance_fit import bic_of, refit_all, with_events, without_events
from heatertune.model.power.feedback import WRONG_SIGN, demand_cause, explains, follows_temperature, is_feedback
from heatertune.model.power.loss_fit import LossFit, leaves_noise
from heatertune.model.power.nonlinear import Bend, judged_linear
from heatertune.model.power.open_loop import PowerFit, PowerProblem
from heatertune.model.power.regressors import Readings
from heatertune.model.power.two_scales_fit import TwoScaleFit, fit_two_scales
from heatertune.model.statistics import replace_outliers, without_outliers

__all__ = [
    "MOST", "CleanedFit", "Explanation", "Segments", "alias_of", "alias_remarks", "clean_log", "explain_log", "gaps",
    "jumps", "part",
]


_BINARY = 0.98  # share of the readings at one of two values
_FEWEST = 10  # switchings
_SINGLE = 0.3  # share of the switchings' runs that are one reading long: slower switching has longer ones
_WINDOWS = (5, 11, 25, 61)  # readings that the power's mean is taken over
_ALIASING_READINGS = 500
_SURE = 10.0  # BIC points


def alias_of(log: Log, problem: PowerProblem, fit: PowerFit) -> str:
    """Return the sentence about a binary power that switches faster than it was logged; empty if it does not.

    The temperature decides: it follows the mean of such a power over some readings better than the power as logged.

    Args:
        log: with power.
        problem: of one lag.
        fit: its best fit.
    """
    power = log.power_pct
    assert power is not None
    if not _may_be(power):
        return ""
    thin = problem.average(_ALIASING_READINGS)
    as_logged = bic_of(thin, thin.refine(fit.vector[None, :]))
    least, window = min((_bic_of_mean(log, problem, n), n) for n in _WINDOWS if n < len(power))
    if least > as_logged - _SURE:
        return ""
    switched = 100.0 * np.count_nonzero(np.diff(power)) / (len(power) - 1)
    spacing = float(np.median(np.diff(log.time_s)))
    return (
        f"The power is logged as {power.min():g} or {power.max():g} % alone and changes at {switched:.0f} % of the "
        f"readings, but the temperature follows its mean over about {window * spacing:.3g} s instead: it switches "
        "faster than it was logged, so what was logged is not what the heater got; log the power's mean over each "
        "interval (the controller's output), or every switching."
    )


def alias_remarks(sentence: str) -> tuple[Remark, ...]:
    """Return the finding of a sentence, unless it is empty."""
    return (Remark("alias", sentence),) if sentence else ()


def _may_be(power: Array) -> bool:
    """Return whether a power has two values and often keeps one for a single reading."""
    on = power > 0.5 * (power.min() + power.max())
    binary = np.isin(power, (power.min(), power.max()))
    switched = np.flatnonzero(np.diff(on))
    if np.mean(binary) < _BINARY or len(switched) < _FEWEST:
        return False
    return bool(np.mean(np.diff(switched) == 1) >= _SINGLE)


def _bic_of_mean(log: Log, problem: PowerProblem, count: int) -> float:
    """Return the criterion of one lag driven by the power's mean over so many readings around each."""
    assert log.power_pct is not None
    mean = _running_mean(log.power_pct, count)
    before = -0.5 * count * float(np.median(np.diff(log.time_s)))
    driven = replace(
        problem.average(_ALIASING_READINGS), least_dead_time_s=before,  # the mean looks ahead by half its length
        readings=replace(problem.readings, edge_s=log.time_s, level_pct=mean).average(_ALIASING_READINGS),
    )
    return bic_of(driven, driven.fit())


def _running_mean(values: Array, count: int) -> Array:
    """Return the mean of so many values around each; the first and last go on beyond the ends."""
    extension = np.pad(values, (count // 2, count - 1 - count // 2), mode="edge")
    first = np.cumsum(extension[:count])[-1]
    return np.cumsum(np.concatenate([[first], extension[count:] - extension[:-count]])) / count


Places = npt.NDArray[np.intp]

#: more jumps or gaps than these are the way of the log, not disturbances
MOST = 10

_GAP = 10.0  # times as long as nine of ten steps of the clock
_SHARE = 0.1  # of the log's span: a jump no heater makes between two readings
_TIMES = 10.0  # the usual step of the residuals
_BESIDE = 11  # readings before and after that the jump has to set apart: five odd ones in a row are outliers
_LASTS = 0.3  # of the jump
_NAMED = 5  # instants that are listed


class Segments(NamedTuple):
    """Where the segments of a log after the first begin: places of their first readings."""

    after_gaps: Places
    after_jumps: Places

    @property
    def places(self) -> Places:
        """All of them, in order, shape (n,)."""
        return np.union1d(self.after_gaps, self.after_jumps)

    def with_jumps(self, places: Places) -> Segments:
        """Return the segments with these jumps (n,), too."""
        return self._replace(after_jumps=np.union1d(self.after_jumps, np.setdiff1d(places, self.after_gaps)))

    def long_enough(self, n: int) -> npt.NDArray[np.bool_]:
        """Return which of n readings lie in a sufficiently long segment, shape (n,)."""
        starts = np.concatenate([[0], self.places])
        sizes = np.diff(np.append(starts, n))
        rows = np.repeat(sizes >= _FEWEST, sizes)
        return rows if np.count_nonzero(rows) >= MIN_SAMPLES else np.ones(n, dtype=np.bool_)

    def notes(self, log: Log) -> Iterator[str]:
        """Report where the segments begin, why, and the omitted parts of the log."""
        reasons = [f"{what} {_named(log.time_s[places])} s" for what, places in (
            ("a gap in the clock before", self.after_gaps), ("a jump of the temperature before", self.after_jumps),
        ) if len(places)]
        if reasons:
            yield (
                f"The log is disturbed: {'; '.join(reasons)}. It was fitted in segments, each with an initial state of "
                "its own, all of one heater."
            )
        left = log.time_s[~self.long_enough(len(log.time_s))]
        if len(left):
            yield (
                "Readings between two disturbances, too few to tell anything, were left out: "
                f"{len(left)} (at {_named(left)} s)."
            )


def gaps(log: Log) -> Segments:
    """Return the segments that gaps in the clock make: the power in a gap is unknown."""
    step = np.diff(log.time_s)
    places = 1 + np.flatnonzero(step > _GAP * np.quantile(step, 0.9))
    return Segments(places if len(places) <= MOST else places[:0], places[:0])


def jumps(record: Array, simulated: Array) -> Places:
    """Return the indices of the first readings after a jump: the residuals change at once and permanently.

    Logged and simulated readings [°C] are of shape (n,), the indices of shape (k,).
    """
    left = record - simulated
    step = np.diff(left)
    usual = 1.4826 * float(np.median(np.abs(step - np.median(step))))
    limit = max(_SHARE * float(np.ptp(replace_outliers(record))), _TIMES * usual)
    places = 1 + np.flatnonzero(np.abs(step) > limit)
    lasting = [abs(_apart(left, int(place))) > _LASTS * abs(step[place - 1]) for place in places]
    return places[np.array(lasting, dtype=np.bool_)]


def part(log: Log, rows: npt.NDArray[np.bool_]) -> Log:
    """Return those of a log's readings that the mask `rows`, shape (n,), takes."""
    return log.part(rows)


def _apart(left: Array, place: int) -> float:
    return float(np.median(left[place : place + _BESIDE]) - np.median(left[max(place - _BESIDE, 0) : place]))


def _named(instants: Array) -> str:
    times = ", ".join(f"{t:.6g}" for t in instants[:_NAMED])
    return f"{times} and {len(instants) - _NAMED} more" if len(instants) > _NAMED else times


_MUCH = 0.12  # of the span, that is left of a log that no heater explains
_READINGS = 1000  # averaged, in the search; reported results are simulated at every reading
_PASSES = 4  # of finding outliers
_ROUNDS = 3  # of finding jumps: a large one hides others


class CleanedFit(NamedTuple):
    """A log in segments with nothing but the outliers replaced, and one lag fitted to just that.

    Attributes:
        whole: the problem at every reading.
        readings_degC: with the outliers put where their neighbours are, shape (n,).
        outliers: their places.
        problem: on averaged readings.
        fit: its best fit.
    """

    whole: PowerProblem
    readings_degC: Array
    outliers: Places
    problem: PowerProblem
    fit: PowerFit

    @property
    def bic(self) -> float:
        """Criterion of the fit; a reading set aside is one more unknown."""
        return bic_of(self.problem, self.fit) + len(self.outliers) * math.log(len(self.readings_degC))

    @property
    def simulated_degC(self) -> Array:
        """The simulation of every reading, shape (n,)."""
        return np.asarray(self.fit.linear @ self.whole.basis(self.fit.vector))


def clean_log(log: Log, problem: PowerProblem) -> tuple[Log, CleanedFit, tuple[str, ...]]:
    """Return the usable part of a log, one lag fitted to it, and sentences about its disturbances.

    Args:
        log: as given.
        problem: of one lag at every reading.
    """
    segments = gaps(log)
    clean = _without_outliers(_restarted(log, problem, segments))
    for _ in range(_ROUNDS):
        more = segments.with_jumps(_jumps(clean))
        if len(more.places) == len(segments.places) or len(more.places) > MOST:
            break
        segments, clean = more, _without_outliers(_restarted(log, problem, more))
    rows = segments.long_enough(len(log.time_s))
    if not rows.all():
        clean = _without_outliers(_part(clean.whole, rows))
    return (log if rows.all() else part(log, rows)), clean, tuple(segments.notes(log))


def _jumps(clean: CleanedFit) -> Places:
    """Return the places of jumps, whichever power was on before the log."""
    measured = clean.whole.readings.temperature_degC
    places = jumps(measured, clean.simulated_degC)
    if len(places) and clean.whole.power_before_pct is None and clean.whole.power_before != 0.0:
        other = _without_outliers(replace(clean.whole, power_before_pct=0.0))
        places = np.intersect1d(places, jumps(measured, other.simulated_degC))
    return places


def _restarted(log: Log, problem: PowerProblem, segments: Segments) -> PowerProblem:
    return replace(problem, readings=replace(problem.readings, restart_s=log.time_s[segments.places]))


def _part(problem: PowerProblem, rows: npt.NDArray[np.bool_]) -> PowerProblem:
    """Return the problem on the readings of its long segments; the power is known all the time."""
    r = problem.readings
    starts = r.restart_s[rows[np.searchsorted(r.time_s, r.restart_s)]]
    first = r.time_s[rows][0]
    return replace(problem, readings=replace(
        r, time_s=r.time_s[rows], half_s=r.half_s[rows], temperature_degC=r.temperature_degC[rows],
        restart_s=starts[starts > first],
    ))


def _without_outliers(problem: PowerProblem) -> CleanedFit:
    """Return one lag without outliers, which are detected with and without limiting extreme readings.

    Extreme readings would hide the others, but the pulses of a fast heater look extreme too and must not be limited.
    """
    measured = problem.readings.temperature_degC
    smooth = replace_outliers(measured)
    starts = [measured] if np.array_equal(smooth, measured) else [measured, smooth]
    return min((_settled(problem, start) for start in starts), key=lambda clean: clean.bic)


def _settled(problem: PowerProblem, start: Array) -> CleanedFit:
    clean, readings = _fitted(problem, start, np.empty(0, dtype=np.intp)), problem.readings
    restart_rows = np.searchsorted(readings.time_s, readings.restart_s)
    for _ in range(_PASSES):
        last = clean
        readings_degC, outliers = without_outliers(readings.temperature_degC, last.simulated_degC, restart_rows)
        if np.array_equal(readings_degC, last.readings_degC):
            break
        clean = _fitted(problem, readings_degC, outliers)
        if len(outliers) and np.array_equal(outliers, last.outliers):
            break
    return clean


def _explained_by_two_lags(single: CleanedFit) -> tuple[CleanedFit, PowerFit]:
    """Return one lag with the readings given back that two lags explain, where two then leave noise alone; and two.

    One lag turns at once where the power goes; the readings around a rounder turn are then far from it alone.
    """
    two = replace(single.problem, two_lags=True)
    fit = _second(two, single.fit)
    if not len(single.outliers) or fit.model is None or (
            bic_of(two, fit) > bic_of(single.problem, single.fit) - _SURE):
        return single, fit
    readings, whole = single.whole.readings, replace(single.whole, two_lags=True)
    simulated = np.asarray(fit.linear @ whole.basis(fit.vector))
    restart_rows = np.searchsorted(readings.time_s, readings.restart_s)
    _, odd = without_outliers(readings.temperature_degC, simulated, restart_rows)
    odd = np.intersect1d(odd, single.outliers)
    if len(odd) == len(single.outliers):
        return single, fit
    readings_degC = readings.temperature_degC.copy()
    readings_degC[odd] = single.readings_degC[odd]
    whole_turn = _fitted(single.whole, readings_degC, odd)
    two = replace(whole_turn.problem, two_lags=True)
    again = _second(two, whole_turn.fit)
    is_noise = again.model is not None and leaves_noise(two.readings, again.simulated_degC)
    return (whole_turn, again) if is_noise else (single, fit)


def _fitted(problem: PowerProblem, readings_degC: Array, outliers: Places) -> CleanedFit:
    thin = replace(problem, readings=replace(problem.readings, temperature_degC=readings_degC)).average(_READINGS)
    return CleanedFit(problem, readings_degC, outliers, thin, thin.fit())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Explanation:
    """A log with power, the problems and fits of one lag and two, and the treatment of its readings.

    Attributes:
        log: without readings between disturbances that are too close.
        readings: its readings, and where its segments begin.
        problems: of one lag and of two, with the initial state, drift and loads that the log needs.
        fits: their best fits.
        cleaned: readings with outliers replaced by their neighbours, shape (n,) [°C].
        outliers: their places.
        notes: about the log's disturbances, and the quantities it does not identify, one sentence each.
        alias: about power that switches faster than it was logged, or empty.
        bend: nonlinear heater that explains the log better than a linear one, or None.
        doubt: about the power as the cause of the temperature, or empty.
        extended: heaters with a loss curve, or of two time scales, that explain the log, the best first.
    """

    log: Log
    readings: Readings
    problems: list[PowerProblem]
    fits: list[PowerFit]
    clean_temperature: Array
    outliers: npt.NDArray[np.intp]
    notes: tuple[str, ...]
    alias: str
    bend: Bend | None = None
    doubt: str = ""
    extended: tuple[LossFit | TwoScaleFit, ...] = ()

    @property
    def model(self) -> Fopdt:
        """One lag."""
        model = self.fits[0].model
        assert isinstance(model, Fopdt)
        return model

    @property
    def bic(self) -> float:
        """Criterion of the better of the two."""
        return min(map(bic_of, self.problems, self.fits))

    @property
    def has_events(self) -> bool:
        """Whether it needs a drift or loads."""
        return self.problems[0].drift or bool(self.problems[0].loads_s)

    @property
    def simulated_degC(self) -> Array:
        """Answer of one lag at every reading of the log, shape (n,)."""
        return self.at_readings(self.problems[0], self.fits[0])

    @property
    def best_simulated_degC(self) -> Array:
        """Answer of the best heater at the readings that were fitted, shape (n,)."""
        return self.extended[0].simulations_degC[0] if self.extended else self.fits[0].simulated_degC

    def at_readings(self, problem: PowerProblem, fit: PowerFit) -> Array:
        """Return the simulation of every reading of the log, shape (n,) [°C]."""
        return fit.linear @ replace(problem, readings=self.readings).basis(fit.vector)

    def with_drift(self) -> Explanation:
        """Return the log with a drift of the ambient fitted, whether it asks for one alone or not."""
        problems = [replace(problem, drift=True) for problem in self.problems]
        return replace(self, problems=problems, fits=refit_all(problems, self.fits))


def explain_log(
    log: Log, *, ambient_degC: float | None, power_before_pct: float | None, believed: bool = False,
    most_dead_time_s: float | None = None, power_late_s: float = 0.0,
) -> Explanation:
    """Return one lag and two, each with the initial state, drift and loads that a log with power needs.

    Args:
        log: with power.
        ambient_degC: known ambient [°C], None if free.
        power_before_pct: power before the first reading [%], None: find it.
        believed: the power is known to be the heater's, so causality is not tested.
        most_dead_time_s: longest possible dead time, from the user [s].
        power_late_s: how long before its row the power is taken to have changed [s].

    Raises:
        InputError: the power cannot have made the temperature (sign, clock, no answer at all).
    """
    readings = Readings.of(log)
    readings = replace(readings, edge_s=readings.edge_s - power_late_s)
    problem = PowerProblem(readings=readings, ambient_degC=ambient_degC, power_before_pct=power_before_pct,
                           most_dead_time_s=most_dead_time_s)
    return _search(log, problem, believed=believed)


def _search(log: Log, problem: PowerProblem, *, believed: bool) -> Explanation:
    """Return one lag and two, without the outliers, the start, the drift and the loads the log asks for."""
    original = problem
    log, clean, notes = clean_log(log, problem)
    clean, second = _explained_by_two_lags(clean)
    thin, fit = clean.problem, clean.fit
    alias = "" if believed else alias_of(log, thin, fit)
    doubt = "" if believed else _demand_cause(log, thin, fit, alias)
    two = replace(thin, two_lags=True)
    closed = is_feedback(log) or follows_temperature(log)
    way = with_load_at_departure(
        with_events([thin, two], [fit, second], closed_loop=closed), thin)
    if doubt or way.problems[0].loads_s:
        refuse_opened(log, thin, way)
    if doubt and not doubt.startswith(WRONG_SIGN) and any(map(explains, *way)):
        doubt = ""
    if doubt or is_impossible(way):
        refuse_changed(log, thin, original)
    (problems, fits), bend, untold, extended = judged_linear(without_events(way), way)
    if any(leaves_noise(fit.problems[0].readings, fit.simulations_degC[0]) for fit in extended):
        doubt = ""  # it was that of a heater with one lag
    if any(fit.model is None for fit in fits):
        refuse_opened(log, thin)
        refuse_changed(log, thin, original)
        raise InputError(f"{log.name}: no heater explains the log, as something else than the power moved its "
                         "temperature; log steps of the power from rest, each until it rests")
    if not extended and bend is None and residual_share(thin.readings, fits) > _MUCH:
        refuse_changed(log, thin)
    return Explanation(
        log=log, readings=clean.whole.readings, problems=problems, fits=fits, clean_temperature=clean.readings_degC,
        outliers=clean.outliers, notes=(*notes, *untold), alias=alias, bend=bend, doubt=doubt,
        extended=extended if not (alias or doubt) else (),
    )


def _demand_cause(log: Log, problem: PowerProblem, fit: PowerFit, alias: str) -> str:
    """Refuse a log in which the power cannot be the temperature's cause, by its aliasing where it has one."""
    try:
        return demand_cause(log, problem, None if fit.model is None else fit)
    except InputError as refused:
        if alias:
            raise InputError(f"{log.name}: {alias}") from refused
        refuse_opened(log, problem)
        refuse_changed(log, problem)
        scales = fit_two_scales([problem], math.inf)
        if not any(leaves_noise(each.problems[0].readings, each.simulations_degC[0]) for each in scales):
            raise
        return str(refused)  # one lag misses most of what a quick part and a slow one explain


def _second(problem: PowerProblem, first_fit: PowerFit) -> PowerFit:
    """Return two lags; if the best fit relies on free initial states alone, the two nearest to the one lag."""
    fit = problem.fit()
    if fit.model is not None:
        return fit
    lag, dead = first_fit.vector[:2]
    near = [(lag, max(dead - ratio * math.exp(lag), 0.0), ratio) for ratio in (0.03, 0.2)]
    return problem.refine(np.array(near))
