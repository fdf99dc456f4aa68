"""Loads that were not logged, found in the log of a running loop together with its heater.

A door, goods or a draught act like steps of power through the heater's lags, and would bias the heater if taken for
the effect of the power. Both are therefore fitted together: for given lags and dead time everything else is linear,
and the load that explains most of the rest is added while `heatertune.model.statistics.ar1_bic` falls.

Logged duty is also converted to the power that a PWM delivers: it waits for its next period and rounds to whole ticks
(50 ticks: steps of 2 %). In a loop at rest this difference lasts for minutes and would bias the dead time. The number
of ticks is not logged; a wrong number explains nothing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import lfilter

from heatertune.arrays import Array
from heatertune.log.log_values import Log
from heatertune.loops.measures import average_log, switching_period_s
from heatertune.model.statistics import ar1_bic

__all__ = [
    "CoolerGain", "DutySwitch", "LoadFreeLog", "LoadStep", "PowerCourse", "cooler_gain", "phases", "power_course",
    "reconstruct_power", "risen", "with_duty", "without_loads",
]


_ROWS: Final = 3000  # of the power's course
_READINGS: Final = 400  # averages that are explained


@dataclass(slots=True)
class PowerCourse:
    """What is to be explained.

    Attributes:
        time: of the rows, from 0 on [s], shape (n,); equally spaced.
        power: held from each row to the next [%], shape (n,).
        before: power before the first row [%].
        readings: averages of so many rows each [°C], shape (m,).
        middle: of the rows of each [s], shape (m,).
        rest: whether the temperature had come to rest with that power.
        cooling: power of a cooler, whose gain is free, as `power`; None: there is none.
    """

    time: Array
    power: Array
    before: float
    readings: Array
    middle: Array
    rest: bool = False
    cooling: Array | None = None

    @property
    def step(self) -> float:
        """Time between two rows [s]."""
        return float(self.time[1])

    @property
    def length(self) -> float:
        """Time of the last row [s]."""
        return float(self.time[-1])

    def mean(self, rows: Array) -> Array:
        """Return averages of (n,) or (n, p), shape (m,) or (m, p)."""
        m = len(self.readings)
        each = len(self.time) // m
        return np.asarray(rows[:m * each].reshape(m, each, *rows.shape[1:]).mean(axis=1))

    def answer(self, lag: float, ratio: float, delay: float) -> Array:
        """Return the power behind its lags and dead time [%], shape (m,)."""
        return self._behind(self.power - self.before, lag, ratio, delay)

    def _behind(self, power: Array, lag: float, ratio: float, delay: float) -> Array:
        keep = math.exp(-self.step / lag)
        moved = lfilter([0.0, 1.0 - keep], [1.0, -keep], power)
        if ratio > 0.0:
            keep = math.exp(-self.step / (ratio * lag))
            moved = lfilter([1.0 - keep], [1.0, -keep], moved)
        return self.mean(np.interp(self.time - delay, self.time, moved, left=0.0))

    def basis(self, lag: float, ratio: float, delay: float, loads: Sequence[float] | Array) -> Array:
        """Return the columns of power, ambient, state at the start, cooler and loads, shape (m, …)."""
        lags = [] if self.rest else [lag, ratio * lag] if ratio > 0.0 else [lag]
        decays = [np.exp(-self.middle / each) for each in lags]
        cooler = [] if self.cooling is None else [
            self._behind(self.cooling - self.cooling[0], lag, ratio, delay)]
        return np.column_stack([
            self.answer(lag, ratio, delay), np.ones(len(self.readings)), *decays, *cooler,
            risen(self.middle, np.asarray(loads), lag, ratio)])


def risen(time: Array, instants: Array, lag: float, ratio: float) -> Array:
    """Return unit steps at the instants (p,) behind the lags, shape (n, p)."""
    since = np.maximum(time[:, None] - instants[None, :], 0.0)
    if ratio <= 0.0:
        return np.asarray(1.0 - np.exp(-since / lag))
    return np.asarray(1.0 - (np.exp(-since / lag) - ratio * np.exp(-since / (ratio * lag))) / (1.0 - ratio))


def power_course(log: Log, before: float, pwm_period_s: float | None, *, rest: bool) -> PowerCourse:
    """Return the course of a log.

    Args:
        log: with power.
        before: power before it [%].
        pwm_period_s: of its switch; None: not known.
        rest: whether the temperature had come to rest with that power.
    """
    assert log.power_pct is not None
    since = log.time_s - log.time_s[0]
    step = max(float(np.median(np.diff(since))), float(since[-1]) / _ROWS)
    time = step * np.arange(int(since[-1] / step + 1e-9) + 1, dtype=np.float64)

    def held(values: Array) -> Array:
        energy = _energy(since, values, np.append(time, time[-1] + step))
        return np.append(np.diff(energy)[:-1] / step, values[-1])

    # averages over less than a PWM period would not be independent
    each = max(1, len(time) // _READINGS, math.ceil((pwm_period_s or 0.0) / step - 1e-9))
    course = PowerCourse(time, held(log.power_pct), before, np.zeros(len(time) // each), np.zeros(0), rest,
                         None if log.cooling_pct is None else held(log.cooling_pct))
    course.middle, course.readings = course.mean(time), course.mean(np.interp(time, since, log.temperature_degC))
    return course


_PWM_RECONSTRUCTION_ROWS: Final = 3.0  # in a period: with fewer the log does not tell where it begins
_PHASES: Final = 12
_BY_LAW: Final = 20  # periods that a P and an I part are sought in, at least
_ENDS_PCT: Final = (0.5, 99.5)  # duties that are no limit
_OFF: Final = 0.5  # of a row's share of the period: as far as a duty may be from that of the rows, root mean square


@dataclass(frozen=True, slots=True, kw_only=True)
class DutySwitch:
    """How a duty becomes power.

    Attributes:
        ticks: of a period, of which a whole number is on; None: as many as it takes.
        down: whether a part of a tick is left out; else the nearest number counts.
        phase_s: when its first period begins, from the begin of the log on [s]; None: a duty acts at once.
    """

    ticks: int | None = None
    down: bool = False
    phase_s: float | None = None


def phases(log: Log, period_s: float | None) -> list[float]:
    """Return instants at which the first period may begin, from the begin of the log on [s]; none: too few rows."""
    if period_s is None or period_s < _PWM_RECONSTRUCTION_ROWS * float(np.median(np.diff(log.time_s))):
        return []
    return [period_s * place / _PHASES for place in range(_PHASES)]


def reconstruct_power(log: Log, switch: DutySwitch, period_s: float | None) -> Log:
    """Return a log with the mean power of each row, as the switch gave it.

    Args:
        log: with the duty as its power.
        switch: what makes power of it.
        period_s: of the switch; None: not known, and its phase is not asked for.
    """
    assert log.power_pct is not None
    power = log.power_pct
    if switch.ticks is not None:
        ticks = power * (switch.ticks / 100.0)
        power = (np.floor(ticks + 1e-9) if switch.down else np.round(ticks)) * (100.0 / switch.ticks)
    if switch.phase_s is not None:
        assert period_s is not None
        first, last = float(log.time_s[0]), float(log.time_s[-1])
        begins = np.arange(first + switch.phase_s - period_s, last + 2.0 * period_s, period_s)
        levels = power[np.maximum(np.searchsorted(log.time_s, begins + 1e-9 * period_s, side="right") - 1, 0)]
        energy = np.concatenate([[0.0], np.cumsum(levels[:-1]) * period_s])
        ends = np.append(log.time_s, 2.0 * last - log.time_s[-2])
        power = np.diff(np.interp(ends, begins, energy)) / np.diff(ends)
    return log.with_rows(power_pct=np.clip(power, -100.0 * log.cooling_gain, 100.0))


def with_duty(log: Log, period_s: float) -> Log:
    """Return a log of a switch with the duty that its controller asked for, finer than its rows tell.

    Whatever the controller, its duty is P on the error, its integral and a constant, where the rows say so: these three
    are found from all periods together, each of which tells its duty to a row. Where no such law keeps to the rows, the
    log is returned as it is.

    Args:
        log: whose power is on or off, with its setpoint.
        period_s: of the switch.
    """
    assert log.power_pct is not None
    if log.setpoint_degC is None:
        return log
    time, on = log.time_s, log.power_pct
    rises = time[1:][np.diff((on > 50.0).astype(int)) > 0]
    count = np.round((rises - rises[0]) / period_s)
    phase = float((rises - count * period_s).mean())
    begins = phase + period_s * np.arange(math.ceil((time[0] - phase) / period_s), int((time[-1] - phase) / period_s))
    duty = np.diff(_energy(time, on, np.append(begins, begins[-1] + period_s))) / period_s
    between = (duty > _ENDS_PCT[0]) & (duty < _ENDS_PCT[1])
    if np.count_nonzero(between) < _BY_LAW:
        return log
    error = log.setpoint_degC - log.temperature_degC
    sampled_error = error[np.maximum(np.searchsorted(time, begins + 1e-9 * period_s, side="right") - 1, 0)]
    mean = np.diff(_energy(time, error, np.append(begins, begins[-1] + period_s)))
    summed = np.concatenate([[0.0], np.cumsum(np.where(between, mean, 0.0))[:-1]])
    law = np.column_stack([sampled_error, summed, np.ones(len(begins))])
    model_duty = np.clip(law @ np.linalg.lstsq(law[between], duty[between], rcond=None)[0], 0.0, 100.0)
    row = 100.0 * float(np.median(np.diff(time))) / period_s
    if float(np.sqrt(np.mean((model_duty - duty)[between] ** 2))) > _OFF * row:
        return log
    rows = np.maximum(np.searchsorted(begins, time + 1e-9 * period_s, side="right") - 1, 0)
    return log.with_rows(power_pct=np.where(between, model_duty, np.clip(duty, -100.0 * log.cooling_gain, 100.0))[rows])


def _energy(time: Array, values: Array, at: Array) -> Array:
    """Return the integral of what is held from each row to the next, at instants."""
    return np.asarray(np.interp(at, time, np.concatenate([[0.0], np.cumsum(values[:-1] * np.diff(time))])))


_INSTANTS: Final = 120  # tried for a load
_EDGES: Final = (0.08, 0.97)  # of the log: what happens before is the start's, and after it nobody sees it answered
_MOST: Final = 6
_GAIN: Final = 20.0  # BIC points a load has to be worth: its instant is chosen among many
_LEAST_PCT: Final = 3.0  # of power: a smaller load is drift, or a switch that is not as fine as its duty
_LARGEST_PCT: Final = 50.0  # a larger one is no load but another heater
_BELOW: Final = 0.3  # of the span of readings, under its setpoint: there a loop was not at work before
_COLDEST: Final = 0.02  # of the span: within it a reading is the coldest
_RISEN: Final = (0.1, 0.2)  # of the span, where a straight line is laid through the rise
_STILL: Final = 3.0  # rows before that line begins
_ONE: Final = 0.01  # of the log: two loads that are nearer are one
_LONGER: Final = (1.2, 1.4, 1.7, 2.0, 2.5, 3.0, 4.0)  # times the dead time, that are tried
_RULED_OUT: Final = 50.0  # BIC points
_LAGS: Final = 10
_DELAYS: Final = 40
_EVERY: Final = 6  # of them with loads, and the nearest without: where a loop swings its phase tells the dead time
_NEAREST: Final = 3
_STARTS: Final = 3
_APART: Final = 1.4  # ratio of the lags of two starts
_HINT: Final = 6.0  # BIC points, with which another switch is tried
_ROUNDS: Final = 5  # of looking for a heater and for its switch
_TICKS: Final = range(10, 101)  # of a PWM period; with more of them nobody sees them
_SOME: Final = 0.05  # of lags and dead time, to see what changes with them
_RATIO: Final = 0.1  # of two lags, to begin with
_PLAIN_LAG: Final = 30.0  # of them in a log, to begin with
_PLAIN_DELAY: Final = 0.1  # of the lag, likewise
_AGAIN: Final = 0.99  # correlation of one average left over with the next, at most
_NORMAL: Final = 1.96  # standard deviations of a 95 % interval


class LoadStep(NamedTuple):
    """A load: when it sets in, in the log's time [s], and the power that does the same [%]; below 0 it cools."""

    instant_s: float
    power_pct: float


class _LoadFit(NamedTuple):
    """Lags, dead time and loads with their criterion; `linear` as the columns of `PowerCourse.basis`."""

    bic: float
    lag: float
    ratio: float
    delay: float
    instants: Array
    linear: Array

    @property
    def sizes(self) -> Array:
        """Of the loads, as power [%]."""
        return np.asarray(self.linear[len(self.linear) - len(self.instants):] / self.linear[0])

    @property
    def sensible(self) -> bool:
        return bool(self.linear[0] > 0.0 and np.all(np.abs(self.sizes) <= _LARGEST_PCT))


class LoadFreeLog(NamedTuple):
    """A log as it would be without the loads.

    Attributes:
        log: at fewer rows, see `heatertune.loops.measures.average_log`.
        loads: that are taken out, in order.
        power_before_pct: power before the log that explains it best; None: not known.
        ambient_degC: of a loop that was off and cold when its log began; None: not known.
        most_dead_time_s: with a longer one no heater explains the whole log; None: with any.
        ticks: whole ones that the switch counts in a PWM period; None: too many for the log to tell.
    """

    log: Log
    loads: tuple[LoadStep, ...] = ()
    power_before_pct: float | None = None
    ambient_degC: float | None = None
    most_dead_time_s: float | None = None
    ticks: int | None = None


def without_loads(log: Log, pwm_period_s: float | None = None) -> LoadFreeLog:
    """Return a log with power as it would be without the loads, and these.

    Args:
        log: of a heater in its loop, with power that changes.
        pwm_period_s: of its switch; None: not known.
    """
    best, switch = _best_with_switch(log, pwm_period_s)
    thin, course, fit = best
    if not fit.sensible:
        return LoadFreeLog(thin)
    since = thin.time_s - thin.time_s[0]
    done = risen(since, fit.instants, fit.lag, fit.ratio) @ (fit.sizes * fit.linear[0])
    loads = sorted(LoadStep(float(log.time_s[0] + at), float(size))
                   for at, size in zip(fit.instants, fit.sizes, strict=True))
    return LoadFreeLog(thin.with_rows(temperature_degC=thin.temperature_degC - done), tuple(loads),
                   course.before, float(fit.linear[1]) if course.rest else None,
                   _most_dead_time_s(course, fit, pwm_period_s or course.step), switch.ticks)


class CoolerGain(NamedTuple):
    """How strong a cooler is: full cooling as a fraction of full heating, with its 95 % interval."""

    fraction: float
    low: float
    high: float


def cooler_gain(log: Log, pwm_period_s: float | None) -> CoolerGain | None:
    """Return how strong the cooler of a loop is, found together with the heater and the loads; None: nothing tells.

    A load in one half of the day would pass for a weaker cooler.

    Args:
        log: with the powers of both.
        pwm_period_s: of the heater's switch; None: not known.
    """
    trials = []
    for before, rest in _starts(log, pwm_period_s):
        course = power_course(log, before, pwm_period_s, rest=rest)
        trials += [_LoadTrial(log, course, fit) for fit in (_searched(course), _from_plain(course))]
    course, fit = min(trials, key=_LoadTrial.worth)[1:]
    # what changes with lags, dead time and instants is free as well
    basis = np.column_stack([course.basis(fit.lag, fit.ratio, fit.delay, fit.instants), _bent(course, fit)])
    linear = np.linalg.lstsq(basis, course.readings, rcond=None)[0]
    left = course.readings - basis @ linear
    again = float(left[1:] @ left[:-1]) / max(float(left @ left), 1e-12)
    inflated = float(left @ left) / max(1, len(left) - len(linear)) * (
        1.0 + max(0.0, again)) / (1.0 - min(again, _AGAIN))
    place = len(fit.linear) - len(fit.instants) - 1
    heater, cooler = float(fit.linear[0]), -float(fit.linear[place])
    if heater <= 0.0:
        return None
    fraction = cooler / heater
    slope = np.zeros(len(linear))
    slope[0], slope[place] = fraction / heater, 1.0 / heater
    half = _NORMAL * math.sqrt(max(0.0, float(inflated * (slope @ np.linalg.pinv(basis.T @ basis) @ slope))))
    return CoolerGain(fraction, fraction - half, fraction + half)


def _from_plain(course: PowerCourse) -> _LoadFit:
    """Return the best heater without loads, with those that it then asks for: loads found first may replace a cooler.

    The first is a pulse, on and off again: neither of its edges explains much alone.
    """
    lag = course.length / _PLAIN_LAG
    plain = _refined(course, lag, 0.0, _PLAIN_DELAY * lag, np.empty(0))
    tried = np.linspace(*_EDGES, _INSTANTS) * course.length
    steps, (on, off) = risen(course.middle, tried, plain.lag, 0.0), np.triu_indices(_INSTANTS, 1)
    q, _ = np.linalg.qr(course.basis(plain.lag, 0.0, plain.delay, ()))
    fresh = steps - q @ (q.T @ steps)
    pulses = fresh[:, on] - fresh[:, off]
    score = (pulses.T @ course.readings) ** 2 / np.maximum(np.sum(pulses**2, axis=0), 1e-12)
    pulse = tried[[on[place := int(np.argmax(score))], off[place]]]
    fits = [plain, _refined(course, plain.lag, 0.0, plain.delay, pulse)]
    best = min(fits, key=_worth)
    _, instants = _added(course, course.basis(best.lag, 0.0, best.delay, best.instants),
                         risen(course.middle, tried, best.lag, 0.0), tried, best.instants)
    fits.append(_refined(course, best.lag, 0.0, best.delay, instants))
    best = min(fits, key=_worth)
    fits.append(_refined(course, best.lag, _RATIO, best.delay, best.instants))
    return _pruned(course, min(fits, key=_worth))


class _LoadTrial(NamedTuple):
    """A start, and the heater that goes with it."""

    thin: Log
    course: PowerCourse
    fit: _LoadFit

    def worth(self) -> tuple[bool, float]:
        """Less is better."""
        return _worth(self.fit)


def _best(log: Log, pwm_period_s: float | None) -> _LoadTrial:
    tried = [_tried(log, pwm_period_s, before, rest=rest) for before, rest in _starts(log, pwm_period_s)]
    return min(tried, key=_LoadTrial.worth)


def _best_with_switch(log: Log, pwm_period_s: float | None) -> tuple[_LoadTrial, DutySwitch]:
    """Return the heater, and the switch that goes with it where that explains plainly more."""
    plain, own = _best(log, pwm_period_s), switching_period_s(log)
    duty = log if own is None else with_duty(log, own)
    if own is not None and duty is log:
        return plain, DutySwitch()
    best, best_switch = plain if duty is log else _best(duty, pwm_period_s), DutySwitch()
    for _ in range(_ROUNDS):
        other, switch = _switched(duty, pwm_period_s, best)
        if switch == best_switch:
            break
        tried = _best(other, pwm_period_s)
        if tried.worth() >= best.worth():
            break
        best, best_switch = tried, switch
    return (best, best_switch) if best.fit.bic < plain.fit.bic - _RULED_OUT else (plain, DutySwitch())


def _switched(log: Log, pwm_period_s: float | None, tried: _LoadTrial) -> tuple[Log, DutySwitch]:
    """Return a log with the power that its switch gave, and that switch; itself, where none explains more.

    Lags, dead time and instants are not those of the right switch yet: what changes with them is free here.
    """
    fit, bent = tried.fit, _bent(tried.course, tried.fit)

    def left(switch: DutySwitch) -> float:
        thin = average_log(reconstruct_power(log, switch, pwm_period_s), pwm_period_s, tried.course.before)
        course = power_course(thin, tried.course.before, pwm_period_s, rest=tried.course.rest)
        basis = np.column_stack([course.basis(fit.lag, fit.ratio, fit.delay, fit.instants), bent])
        linear = np.linalg.lstsq(basis, course.readings, rcond=None)[0]
        return ar1_bic(course.readings - basis @ linear, len(linear))

    plain = least = left(DutySwitch())
    switch, begins = DutySwitch(), phases(log, pwm_period_s)
    for change in ("phase_s", "ticks", "phase_s"):
        others = [replace(switch, ticks=count, down=down) for count in _TICKS for down in (False, True)] if (
            change == "ticks") else [replace(switch, phase_s=begin) for begin in begins]
        least, switch = min([(least, switch), *((left(other), other) for other in others)], key=lambda entry: entry[0])
    return (reconstruct_power(log, switch, pwm_period_s), switch) if least < plain - _HINT else (log, DutySwitch())


def _bent(course: PowerCourse, fit: _LoadFit) -> Array:
    """Return the slopes of the readings by lags, dead time and the instants of loads, shape (m, 3 + loads)."""
    def readings(lag: float, ratio: float, delay: float, at: Array) -> Array:
        loads = fit.linear[len(fit.linear) - len(at):]
        driven = fit.linear[0] * course.answer(lag, ratio, delay) + risen(course.middle, at, lag, ratio) @ loads
        if course.cooling is None:
            return np.asarray(driven)
        cooler = course.basis(lag, ratio, delay, ())[:, -1]
        return np.asarray(driven + fit.linear[len(fit.linear) - len(at) - 1] * cooler)

    lag, ratio, delay, at = fit.lag, max(fit.ratio, _SOME), fit.delay, fit.instants
    some = max(_SOME * delay, course.step)
    others = [(lag * (1.0 + _SOME), ratio, delay, at), (lag, ratio + _SOME, delay, at), (lag, ratio, delay + some, at),
              *((lag, ratio, delay, np.where(np.arange(len(at)) == place, at + some, at)) for place in range(len(at)))]
    return np.column_stack([readings(*other) - readings(lag, ratio, delay, at) for other in others])


def _tried(log: Log, pwm_period_s: float | None, before: float, *, rest: bool) -> _LoadTrial:
    thin = average_log(log, pwm_period_s, before)
    course = power_course(thin, before, pwm_period_s, rest=rest)
    return _LoadTrial(thin, course, _searched(course))


def _most_dead_time_s(course: PowerCourse, fit: _LoadFit, wait_s: float) -> float | None:
    """Return the shortest dead time tried with which one lag, its loads fitted anew, is plainly worse [s].

    A duty acts when the next PWM period begins, `wait_s` later at most: the log does not tell a dead time finer.
    """
    best = _refined(course, fit.lag, 0.0, fit.delay + fit.ratio * fit.lag, fit.instants)
    for times in _LONGER:
        dead_time_s = times * best.delay + wait_s
        if _refined(course, best.lag, 0.0, dead_time_s, best.instants, fixed=True).bic > best.bic + _RULED_OUT:
            return dead_time_s
    return None


def _worth(fit: _LoadFit) -> tuple[bool, float]:
    return not fit.sensible, fit.bic


def _starts(log: Log, pwm_period_s: float | None) -> list[tuple[float, bool]]:
    """Return the possible powers before the first reading [%], and whether the heater was at rest with each.

    A loop that is at its setpoint as its log begins was at work. One that is far below may have been off, and cold:
    that is plain where the temperature begins to rise no sooner than a dead time after the power.
    """
    assert log.power_pct is not None
    readings, own = log.temperature_degC, float(np.median(np.diff(log.time_s)))
    first, span = float(readings[0]), float(np.ptp(readings))
    at_work = (float(log.power_pct[log.time_s < log.time_s[0] + (pwm_period_s or own)].mean()), False)
    if log.setpoint_degC is not None and float(log.setpoint_degC[0]) - first < _BELOW * span:
        return [at_work]
    risen = [float(log.time_s[np.argmax(readings >= first + share * span)] - log.time_s[0]) for share in _RISEN]
    if first < float(readings.min()) + _COLDEST * span and 2.0 * risen[0] - risen[1] > _STILL * own:
        return [(0.0, True)]
    return [at_work, (0.0, False)]


def _searched(course: PowerCourse) -> _LoadFit:
    """Return the best heater with its loads."""
    tried = np.linspace(*_EDGES, _INSTANTS) * course.length
    delays = np.append(0.0, np.geomspace(max(course.step, course.length / 600.0), course.length / 10.0, _DELAYS - 1))
    rough = []
    for lag in np.geomspace(max(3.0 * course.step, course.length / 150.0), course.length / 2.0, _LAGS).tolist():
        steps = risen(course.middle, tried, lag, 0.0)
        bases = [course.basis(lag, 0.0, delay, ()) for delay in delays.tolist()]
        left = [np.linalg.norm(course.readings - q @ (q.T @ course.readings)) for q, _ in map(np.linalg.qr, bases)]
        near = {*range(0, _DELAYS, _EVERY), *np.argsort(left)[:_NEAREST].tolist()}
        rough += [(*_added(course, bases[place], steps, tried), lag, float(delays[place])) for place in sorted(near)]
    starts: list[tuple[float, Array, float, float]] = []
    for start in sorted(rough, key=lambda entry: entry[0]):
        if all(max(start[2] / other[2], other[2] / start[2]) > _APART for other in starts):
            starts.append(start)
    refined = [_refined(course, lag, 0.0, delay, instants) for _, instants, lag, delay in starts[:_STARTS]]
    best = min(refined, key=_worth)
    best = min(best, _refined(course, best.lag, _RATIO, best.delay, best.instants), key=_worth)
    steps = risen(course.middle, tried, best.lag, best.ratio)
    _, instants = _added(
        course, course.basis(best.lag, best.ratio, best.delay, best.instants), steps, tried, best.instants)
    again = best if len(instants) == len(best.instants) else _refined(
        course, best.lag, best.ratio, best.delay, instants)
    return _pruned(course, min(best, again, key=_worth))


def _added(
    course: PowerCourse, basis: Array, steps: Array, tried: Array, instants: Array | None = None
) -> tuple[float, Array]:
    """Return the criterion and the instants of the loads that are worth it, added one by one to those given."""
    loads = np.zeros(0) if instants is None else instants
    best, chosen, at_best = math.inf, loads, 0
    size = np.sum(steps**2, axis=0)
    for count in range(len(loads), _MOST + 1):
        q, _ = np.linalg.qr(basis)
        left = course.readings - q @ (q.T @ course.readings)
        bic = ar1_bic(left, basis.shape[1] + len(chosen))
        if bic < best - _GAIN:
            best, at_best, loads = bic, count, chosen
        elif count > at_best + 1:  # a pulse is two loads, of which the first alone explains little
            break
        fresh = steps - q @ (q.T @ steps)
        free = np.sum(fresh**2, axis=0)
        score = np.where(free > 1e-6 * size, (fresh.T @ left) ** 2 / np.maximum(free, 1e-12), 0.0)
        place = int(np.argmax(score))
        chosen, basis = np.append(chosen, tried[place]), np.column_stack([basis, steps[:, place]])
    return best, loads


def _refined(
    course: PowerCourse, lag: float, ratio: float, delay: float, instants: Array, *, fixed: bool = False
) -> _LoadFit:
    """Return the least-squares fit from a start: all that is not linear, the instants of the loads included.

    `fixed`: the dead time stays.
    """
    two, length = ratio > 0.0, course.length

    def parts(z: Array) -> tuple[float, float, float, Array]:
        return math.exp(z[0]), float(z[2]) if two else 0.0, float(z[1]) * length, z[2 + two:] * length

    def left(z: Array) -> Array:
        basis = course.basis(*parts(z))
        return np.asarray(basis @ np.linalg.lstsq(basis, course.readings, rcond=None)[0] - course.readings)

    low = [math.log(0.5 * course.step), 0.0, *([0.005] if two else []), *([_EDGES[0]] * len(instants))]
    high = [math.log(5.0 * length), 0.25, *([0.98] if two else []), *([_EDGES[1]] * len(instants))]
    if fixed:
        low[1], high[1] = delay / length - 1e-6, delay / length + 1e-6
    start = np.clip([math.log(lag), delay / length, *([ratio] if two else []), *(instants / length)],
                    np.array(low) + 1e-9, np.array(high) - 1e-9)
    z = least_squares(left, start, bounds=(low, high), x_scale="jac", diff_step=1e-4, max_nfev=40).x
    basis = course.basis(*parts(z))
    linear = np.asarray(np.linalg.lstsq(basis, course.readings, rcond=None)[0])
    return _LoadFit(ar1_bic(left(z), len(z) + len(linear)), *parts(z), linear)


def _pruned(course: PowerCourse, fit: _LoadFit) -> _LoadFit:
    """Return what was found without what is no load: too small, the start's, or the second of two at one instant."""
    while len(fit.instants):
        order = np.argsort(fit.instants)
        apart = np.diff(fit.instants[order])
        smallest = int(np.argmin(np.abs(fit.sizes)))
        if fit.instants.min() < (_EDGES[0] + _ONE) * course.length:
            smallest = int(np.argmin(fit.instants))
        elif len(apart) and apart.min() < _ONE * course.length:
            smallest = int(order[np.argmin(apart)])
        elif abs(fit.sizes[smallest]) >= _LEAST_PCT:
            break
        fit = _refined(course, fit.lag, fit.ratio, fit.delay, np.delete(fit.instants, smallest))
    return fit
