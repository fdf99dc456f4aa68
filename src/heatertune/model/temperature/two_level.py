"""Two-level control without a logged power: the switching instants are fitted together with the heater.

Full power and none alternate. The temperature turns a dead time after each switching, so the curve shows heater and
effective instants, whatever the thresholds are; each instant is an unknown of its own (a bang-bang input of unknown
switching times is piecewise linear in the known step responses; K. J. Åström and T. Hägglund, "PID Controllers: Theory,
Design, and Tuning", 2nd ed., 1995, section 2.7, for the wave forms). The thresholds add the dead time: it is the time
from the crossing of a threshold to the turn. Without them it lies between none and the time at which the heater would
switch off colder than on; the interval and the plausible heaters hold that.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.errors import InputError
from heatertune.log.log_values import Log
from heatertune.model.model_values import Fopdt, HeaterModel, TwoLag
from heatertune.model.statistics import (
    ar1_bic,
    autocorrelation,
    student_t,
)
from heatertune.model.temperature.evidence import Thermostat, end_of_rest, quiet_noise_degC, switching_guess

__all__ = ["LONGEST", "SwitchingSolution", "TwoLevelFit", "change_s", "fit_logged_switchings", "fit_two_level"]


_MOST_READINGS: Final = 800
_MOST_SWITCHINGS: Final = 60
_ROWS: Final = 3.5  # fewest to a switching
_FEWEST: Final = 5  # switchings, if the thresholds are not stated
_ONCE: Final = 2  # switchings of a log that was switched on and off once, which tell nothing of the time constant
_STARTS: Final = 6  # time constants that descents start from
_RATIOS: Final = (0.05, 0.25, 0.6)
_PLACES: Final = 4  # stretches in which a change of full power is tried
_SHARES: Final = (0.0, 0.25, 0.5, 0.75)  # of a stretch with the power on: full power changes there
_EARLY: Final = (0.03, 0.1, 0.25)  # of the time constant, after the beginning: the heater begins to rise
_LEAST_RATIO, _MOST_RATIO = 0.005, 0.98
LONGEST: Final = 30.0  # of the log's length, the longest time constant
_TRIES, _ITERATIONS = 12, 40
_STEPS: Final = (0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 6.0, 10.0, 20.0)  # standard deviations, of a profile
_NEAR: Final = 10.0  # BIC points
_MANY_ROWS: Final = 8  # to a switching
_LEFT: Final = 0.03  # of the swing
_DITHERED: Final = 0.45  # of the step of the readings, the error beyond which rounding is independent noise
_COLDEST: Final = -60.0  # of rooms [°C]
_LOUD: Final = 2.5  # times the noise: a model that leaves more does not explain the log
_MOST_OF_ROW: Final = 1.5  # rows, within which nearly all switchings have to come after those of the log
_MOST: Final = 0.9  # of the switchings, those that decide
_UNEVEN: Final = 0.3  # of the swing: most deviation of the temperatures at which it turns
_CONTINUOUS: Final = 7  # unknowns of a continuous controller and its heater, about
_TRIGGERS: Final = 3.5  # standard deviations of the lowest of many readings
_LEAST_ROWS: Final = 1.0  # of a stretch of power, and of one without: a shorter one shows only how much heat it is
_BELOW: Final = 0.1  # of the span of the readings: the coldest one lies less below the temperature without power
_COOLED: Final = 0.02  # of the span of the readings: the least fall that shows a heater without power
_COLD: Final = 0.5  # of the rise above the temperature without power: a log that begins below shows that temperature


Rows = npt.NDArray[np.intp]


class _SwitchingProblem(NamedTuple):
    """Readings, whether the power is on at first, known ambient or None, the powers [%], and a change of full power.

    The change is given by the switching off that ends the stretch in which it lies, and its place in that stretch.
    """

    time_s: Array
    temperature_degC: Array
    is_on: bool
    ambient_degC: float | None
    changed_at: int | None = None
    share: float = 0.0
    levels: tuple[float, float] = (0.0, 100.0)


class SwitchingSolution(NamedTuple):
    """ln time constant, ratio of the second lag (0: none), effective instants [s], linear numbers, residuals, BIC."""

    lag: float
    ratio: float
    instants: Array
    linear: Array
    left: Array
    problem: _SwitchingProblem

    @property
    def cost(self) -> float:
        """Sum of the squared errors [°C²]."""
        return float(self.left @ self.left)

    @property
    def unknowns(self) -> int:
        """Number of fitted numbers."""
        return 1 + (self.ratio > 0.0) + len(self.instants) + len(self.linear)

    @property
    def bic(self) -> float:
        """Criterion with first-order autoregressive errors."""
        return ar1_bic(self.left, self.unknowns)

    @property
    def gains(self) -> tuple[float, ...]:
        """Gain before and, if it changes, after the change of the mains [°C/%]."""
        first = float(self.linear[0])
        return (first,) if self.problem.changed_at is None else (first, first + float(self.linear[1]))

    @property
    def ambient_degC(self) -> float:
        """Temperature without power [°C]."""
        fixed_degC = self.problem.ambient_degC
        return float(self.linear[-1]) if fixed_degC is None else fixed_degC

    def temperature_degC(self, time_s: Array) -> Array:
        """Return the simulated temperature at instants of shape (n,) [°C], shape (n,)."""
        basis, _ = _basis(self.problem._replace(time_s=time_s), self.lag, self.ratio, self.instants,
                          float(self.problem.time_s[0]))
        return np.asarray(basis @ self.linear + (self.problem.ambient_degC or 0.0))

    def plant(self, gain: float, dead_time_s: float) -> HeaterModel:
        """Return the heater with a dead time."""
        lag = math.exp(self.lag)
        if self.ratio == 0.0:
            return Fopdt(gain_degC_per_pct=gain, time_constant_s=lag, dead_time_s=dead_time_s,
                         ambient_degC=self.ambient_degC)
        return TwoLag(gain_degC_per_pct=gain, time_constant_s=lag, second_time_constant_s=lag * self.ratio,
                      dead_time_s=dead_time_s, ambient_degC=self.ambient_degC)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TwoLevelFit:
    """Heater and switching instants of a log.

    Attributes:
        log: as it was fitted.
        best: of each order that explains the log nearly as well, the best first.
        profile: other heaters that it cannot tell from these.
        gain_margin: 95 % margin of the gain, the time constant held, as a share of it.
        ambient_margin_degC: the same of the ambient [°C].
        instant_margin_s: 95 % margin of a switching instant [s].
        noise_degC: of the readings [°C].
        thermostat: as stated, or None.
        switched_rows: the first row of each logged power, None if the power was not logged.
        is_manual: whether it was switched manually, at temperatures that mean nothing.
        is_power_stated: whether the largest power is stated.
    """

    log: Log
    best: tuple[SwitchingSolution, ...]
    profile: tuple[SwitchingSolution, ...]
    gain_margin: float
    ambient_margin_degC: float
    instant_margin_s: float
    noise_degC: float
    thermostat: Thermostat | None
    switched_rows: Rows | None
    is_manual: bool = False
    is_power_stated: bool = False

    @property
    def rmse_degC(self) -> float:
        """Error of the best heater [°C]."""
        return float(np.sqrt(np.mean(self.best[0].left ** 2)))

    @property
    def explains(self) -> bool:
        """Whether the errors are those of the readings; with few rows to a switching the swing looks like noise."""
        loud, instants = _LOUD * self.noise_degC, self.best[0].instants
        if not self.has_many_rows:
            swing = float(np.median(np.abs(np.diff(self.best[0].temperature_degC(instants)))))
            step = float(np.min(np.diff(np.unique(self.log.temperature_degC))))
            loud = min(loud, max(_LEFT * swing, step))
        return self.rmse_degC <= loud

    @property
    def has_many_rows(self) -> bool:
        """Whether there are enough rows to a switching to tell the swing from noise."""
        return len(self.log.time_s) >= _MANY_ROWS * len(self.best[0].instants)

    @property
    def shows_levels(self) -> bool:
        """Whether the log may be of full power and none: no stretch of a fraction of a row, and no reading too cold.

        An output of coarse steps swings between two neighbouring ones. Full power and none in their place heat as much
        only in short pulses, or in a room as hot as the lower step makes the heater.
        """
        coldest, row = float(self.log.temperature_degC.min()), float(np.median(np.diff(self.log.time_s)))
        ambients = [each.ambient_degC for each in (*self.best, *self.profile)]
        below = _BELOW * float(np.ptp(self.log.temperature_degC)) + self.ambient_margin_degC + self.noise_degC
        stretches = np.diff(self.best[0].instants)
        shortest = min((float(np.median(stretches[k::2])) for k in (0, 1) if len(stretches) > k), default=math.inf)
        return shortest >= _LEAST_ROWS * row and min(ambients) <= coldest + below

    @property
    def shows_ambient(self) -> bool:
        """Whether the log begins so cold, below its swing, that it shows the temperature without power."""
        best, y = self.best[0], self.log.temperature_degC
        first = 0 if best.problem.is_on else 1
        if len(best.instants) < first + 2:
            return False
        high, low = (float(np.median(best.temperature_degC(best.instants[k::2]))) for k in (first, first + 1))
        coldest = float(y.min()) + _TRIGGERS * self.noise_degC
        return coldest < low - (high - low) and coldest - best.ambient_degC <= _COLD * (low - best.ambient_degC)

    @property
    def shows_cooling(self) -> bool:
        """Whether it cools without power for a part of the log, so that no controller can have reduced the power."""
        best, time = self.best[0], self.log.time_s
        y, stretch = best.temperature_degC(time), np.searchsorted(best.instants, time)
        without_power = (y[stretch == k] for k in range(1 if best.problem.is_on else 0, len(best.instants) + 1, 2))
        fall = sum(float(part.max() - part[-1]) for part in without_power if len(part))
        return fall > max(_COOLED * float(np.ptp(self.log.temperature_degC)), _TRIGGERS * self.noise_degC)

    @property
    def delays_s(self) -> Array:
        """How long after its row each logged switching begins to act, shape (k,) [s]."""
        rows, power = self.switched_rows, self.log.power_pct
        assert rows is not None
        assert power is not None
        # it may begin to rise after the log has begun: one more at the beginning; and the fit may add one at the end
        first = int(self.best[0].problem.is_on != bool(power[0] == power.max()))
        return self.best[0].instants[first:first + len(rows)] - self.log.time_s[rows]

    @property
    def follows_rows(self) -> bool:
        """Whether its switchings are those of the logged power: all as late, but for the row in which each lies.

        Pulses that the temperature does not show one by one leave their instants free, which then fit anything.
        """
        row = float(np.median(np.diff(self.log.time_s)))
        least, most = np.quantile(self.delays_s, (1.0 - _MOST, _MOST))
        return float(most - least) <= _MOST_OF_ROW * row and self.instant_margin_s <= row

    def is_better(self, rmse_degC: float, readings: int) -> bool:
        """Return whether it explains the log better than a continuous controller, by 10 BIC points.

        Args:
            rmse_degC: of the continuous controller that explains it best [°C].
            readings: that it was fitted to.
        """
        more = (self.best[0].unknowns - _CONTINUOUS) * math.log(readings)
        return readings * 2.0 * math.log(max(self.rmse_degC, 1e-9) / max(rmse_degC, 1e-9)) + more < -_NEAR


def fit_two_level(log: Log, *, ambient_degC: tuple[float, float] | None, thermostat: Thermostat | None = None,
                  largest_power_pct: float | None = None) -> TwoLevelFit | None:
    """Fit heater and switching instants to a log without power; None if it does not look like two-level control.

    Raises:
        InputError: the log does not reach the stated thresholds.
    """
    guess = switching_guess(log, is_stated=thermostat is not None)
    if thermostat is not None:
        _demand_thresholds(log, thermostat)
        # where the log ends before the last turn shows, the readings tell
        guess = guess if len(guess.instants) else thermostat.crossings(log)
    elif len(guess.instants) < _FEWEST or not _is_even(log, guess.rows, guess.is_on):
        return None
    return _fit(log, guess.instants, guess.is_on, ambient_degC, thermostat=thermostat,
                levels=(0.0, largest_power_pct or 100.0))


def fit_manual_switching(log: Log, *, ambient_degC: tuple[float, float] | None, largest_power_pct: float | None = None,
                         ) -> TwoLevelFit | None:
    """Fit heater and instants to a log in which a constant power was switched on or off, without a controller.

    A turn shows where the power was switched, and the end of a rest at the beginning. With none of them the power is
    taken to be on from the first reading on. None where constant power does not explain the log.
    """
    guess = switching_guess(log, is_stated=True)
    instants, is_on = guess.instants, guess.is_on
    if len(instants) > _FEWEST:  # those are turns of the noise
        y, rest = log.temperature_degC, end_of_rest(log)
        instants, is_on = (np.empty(0) if rest is None else log.time_s[rest:rest + 1]), rest is None
        if y[-1] < y[0]:
            return None
    fitted = _fit(log, instants, is_on, ambient_degC, levels=(0.0, largest_power_pct or 100.0))
    if fitted is None or not (fitted.explains and fitted.has_many_rows):
        return None
    return replace(fitted, is_manual=True, is_power_stated=largest_power_pct is not None)


def fit_logged_switchings(log: Log, dead_time_s: float, *, ambient_degC: tuple[float, float] | None
                          ) -> TwoLevelFit | None:
    """Fit heater and switching instants to a log whose power has two levels; None if it has not, or heats by neither.

    The power changes somewhere between the row before and the row that shows it. Where that is not much shorter than
    the stretches of power, taking the row's own instant makes the gain too small (errors in variables).

    Args:
        log: with power.
        dead_time_s: of a fit that takes the rows' instants [s].
        ambient_degC: as in `fit_two_level`.
    """
    power = log.power_pct
    assert power is not None
    levels = np.unique(power)
    rows = 1 + np.flatnonzero(np.diff(power))
    if len(levels) != 2 or len(rows) < _FEWEST or log.disturbance is not None:
        return None
    half = 0.5 * float(np.median(np.diff(log.time_s)))
    return _fit(log, log.time_s[rows] - half + dead_time_s, bool(power[0] == levels[1]), ambient_degC,
                switched_rows=rows, levels=(float(levels[0]), float(levels[1])))


def _fit(
    log: Log, instants: Array, is_on: bool, ambient_degC: tuple[float, float] | None, *,
    thermostat: Thermostat | None = None, switched_rows: Rows | None = None, levels: tuple[float, float] = (0.0, 100.0),
) -> TwoLevelFit | None:
    if len(instants) > _MOST_SWITCHINGS:
        log = log.window(float(log.time_s[0]), float(instants[_MOST_SWITCHINGS]))
        instants = instants[:_MOST_SWITCHINGS]
        switched_rows = None if switched_rows is None else switched_rows[:_MOST_SWITCHINGS]
    if len(log.time_s) < _ROWS * len(instants):
        return None
    every = -(-len(log.time_s) // _MOST_READINGS)
    fixed_degC = None if ambient_degC is None or ambient_degC[0] < ambient_degC[1] else ambient_degC[0]
    problem = _SwitchingProblem(log.time_s[::every], log.temperature_degC[::every], is_on, fixed_degC, levels=levels)
    solved = _solved(problem, instants)
    if ambient_degC is not None and fixed_degC is None and solved and not (
            ambient_degC[0] <= solved[0].ambient_degC <= ambient_degC[1]):
        end = min(max(solved[0].ambient_degC, ambient_degC[0]), ambient_degC[1])
        solved = _solved(problem._replace(ambient_degC=end), instants)
    if not solved:
        return None
    profiles = [_profiles(each) for each in solved if each.bic - solved[0].bic <= _NEAR]
    near = [each for each in solved if each.bic - solved[0].bic <= _NEAR]
    family = [each for solutions, _ in profiles for each in solutions]
    if fixed_degC is None:  # no room is as cold or as hot as that
        near, family = [[each for each in group if _COLDEST < each.ambient_degC < float(log.temperature_degC.max())]
                        for group in (near, family)]
        near = near or sorted(family, key=lambda entry: entry.cost)[:1]
    if not near:
        return None
    gain, ambient, instant = np.max([margins for _, margins in profiles], axis=0)
    return TwoLevelFit(
        log=log, best=tuple(near), profile=tuple(family), gain_margin=float(gain), ambient_margin_degC=float(ambient),
        instant_margin_s=float(instant), noise_degC=quiet_noise_degC(log), thermostat=thermostat,
        switched_rows=switched_rows)


def _demand_thresholds(log: Log, thermostat: Thermostat) -> None:
    low, high = float(log.temperature_degC.min()), float(log.temperature_degC.max())
    if not (low <= thermostat.low_degC and thermostat.high_degC <= high):
        raise InputError(
            f"{log.name}: its readings, {low:g} to {high:g} °C, do not reach the thresholds {thermostat.low_degC:g} "
            f"and {thermostat.high_degC:g} °C, so it shows no switching; correct --thermostat, or leave it out")


def _is_even(log: Log, rows: Sequence[int], is_on: bool) -> bool:
    """Return whether it turns at nearly the same two temperatures, the heat-up aside."""
    turns = log.temperature_degC[list(rows)]
    offs, ons = turns[0 if is_on else 1 :: 2], turns[1 if is_on else 0 :: 2]
    if not is_on:
        ons = ons[1:]  # the first switching on is from cold
    if len(offs) == 0 or len(ons) == 0:
        return False
    swing = float(np.mean(offs) - np.mean(ons))
    offs = offs[1:] if len(offs) > 2 else offs
    scatter = max(float(np.ptp(offs)), float(np.ptp(ons))) / 2.0
    return swing > 0.0 and scatter <= _UNEVEN * swing + 2.0 * quiet_noise_degC(log)


def _steps(time: Array, instants: Array, lag: float, second: float) -> tuple[Array, Array]:
    """Return step and impulse response at each reading of steps at some instants, both of shape (n, k)."""
    since = np.maximum(time[:, None] - instants[None, :], 0.0)
    is_after = time[:, None] > instants[None, :]
    slow = np.exp(-since / lag)
    if second <= 0.0:
        return 1.0 - slow, np.where(is_after, slow / lag, 0.0)
    fast = np.exp(-since / second)
    both = lag - second
    return 1.0 - (lag * slow - second * fast) / both, np.where(is_after, (slow - fast) / both, 0.0)


def _basis(
    problem: _SwitchingProblem, log_lag: float, ratio: float, instants: Array, begin: float
) -> tuple[Array, Array]:
    """Return the columns of the linear numbers, and the impulse response of each switching with its sign."""
    lag = math.exp(log_lag)
    signs = np.where((np.arange(len(instants)) % 2 == 0) == problem.is_on, -1.0, 1.0)
    steps, pulses = _steps(problem.time_s, instants, lag, ratio * lag)
    since = problem.time_s - begin
    power = steps @ signs
    if problem.is_on:
        power = power + _steps(problem.time_s, np.array([begin]), lag, ratio * lag)[0][:, 0]
    low, high = problem.levels
    columns = [low + (high - low) * power]
    if problem.changed_at is not None:
        change = _steps(problem.time_s, change_s(problem, instants), lag, ratio * lag)[0][:, 0]
        columns.append(high * change + (high - low) * (steps[:, problem.changed_at :] @ signs[problem.changed_at :]))
    columns.append(np.exp(-since / lag))
    if ratio > 0.0:
        columns.append(np.exp(-since / (ratio * lag)))
    if problem.ambient_degC is None:
        columns.append(np.ones(len(since)))
    return np.column_stack(columns), -pulses * signs * (high - low)


def change_s(problem: _SwitchingProblem, instants: Array) -> Array:
    """Return the instant at which full power changes, shape (1,)."""
    place = problem.changed_at
    assert place is not None
    return instants[place - 1 : place] * (1.0 - problem.share) + instants[place : place + 1] * problem.share


def _evaluated(
    problem: _SwitchingProblem, log_lag: float, ratio: float, instants: Array
) -> tuple[SwitchingSolution, Array, Array]:
    basis, pulses = _basis(problem, log_lag, ratio, instants, float(problem.time_s[0]))
    target = problem.temperature_degC - (problem.ambient_degC or 0.0)
    orthogonal, triangle = np.linalg.qr(basis)
    linear = np.linalg.lstsq(triangle, orthogonal.T @ target, rcond=1e-12)[0]
    heat = np.full(len(instants), linear[0])
    if problem.changed_at is not None:
        heat[problem.changed_at :] += linear[1]
    solution = SwitchingSolution(log_lag, ratio, instants, linear, target - basis @ linear, problem)
    return solution, orthogonal, pulses * heat


def _descend(
    start: SwitchingSolution, iterations: int, *, hold_lag: bool = False, hold_ratio: bool = False
) -> SwitchingSolution:
    """Return where Levenberg's and Marquardt's descent ends; the linear numbers are projected out."""
    problem, damping = start.problem, 1e-3
    length = float(np.ptp(problem.time_s))
    limits = math.log(float(np.median(np.diff(problem.time_s)))), math.log(LONGEST * length)
    now, orthogonal, pulses = _evaluated(problem, start.lag, start.ratio, start.instants)
    for _ in range(iterations):
        free = [] if hold_lag else [_slope(now, 1e-4, 0.0)]
        free += [] if now.ratio == 0.0 or hold_ratio else [_slope(now, 0.0, 1e-4)]
        jacobian = np.column_stack([*free, pulses])
        if jacobian.shape[1] == 0:  # no switching, the time constant held: nothing is free
            return now
        jacobian -= orthogonal @ (orthogonal.T @ jacobian)
        square, gradient = jacobian.T @ jacobian, jacobian.T @ now.left
        scale = np.maximum(np.diag(square), 1e-9 * float(np.max(np.diag(square))) + 1e-300)
        for _ in range(6):
            step = np.linalg.solve(square + damping * np.diag(scale), gradient)
            count = len(free)
            lag, ratio = now.lag, now.ratio
            if not hold_lag:
                lag = float(np.clip(lag + np.clip(step[0], -1.0, 1.0), *limits))
            if count > (0 if hold_lag else 1):
                ratio = float(np.clip(ratio * math.exp(float(np.clip(step[count - 1], -1.0, 1.0))), _LEAST_RATIO,
                                      _MOST_RATIO))
            instants = now.instants + step[count:]
            if np.all(np.diff(instants) > 0.0):
                tried, its_orthogonal, its_pulses = _evaluated(problem, lag, ratio, instants)
                if tried.cost < now.cost:
                    break
            damping *= 6.0
        else:
            return now
        gained = now.cost - tried.cost
        now, orthogonal, pulses, damping = tried, its_orthogonal, its_pulses, max(damping / 8.0, 1e-9)
        if gained < 1e-6 * now.cost:
            return now
    return now


def _slope(now: SwitchingSolution, by_lag: float, by_ratio: float) -> Array:
    """Return the change of the simulation by ln time constant or ln ratio, the linear numbers kept."""
    ratio = now.ratio * math.exp(by_ratio)
    begin = float(now.problem.time_s[0])
    moved = _basis(now.problem, now.lag + by_lag, ratio, now.instants, begin)[0] @ now.linear
    still = now.problem.temperature_degC - (now.problem.ambient_degC or 0.0) - now.left
    return np.asarray((moved - still) / (by_lag + by_ratio))


def _solved(problem: _SwitchingProblem, instants: Array) -> list[SwitchingSolution]:
    """Return the fits of one lag and of two that heat, the best by BIC first; a change of the mains is tried."""
    length = float(np.ptp(problem.time_s))
    period = 2.0 * float(np.median(np.diff(instants))) if len(instants) > _ONCE else 0.2 * length
    lags = np.geomspace(0.2 * period, max(1.5 * length, 2.0 * period), _STARTS)
    solutions = list[SwitchingSolution]()
    for ratios in ((0.0,), _RATIOS):
        starts = [SwitchingSolution(math.log(lag), ratio, instants, np.empty(0), np.empty(0), problem)
                  for lag in lags for ratio in ratios]
        tried = sorted((_descend(start, _TRIES) for start in starts), key=lambda entry: entry.cost)
        best = min((_descend(each, _ITERATIONS) for each in tried[:3]), key=lambda entry: entry.cost)
        best = _with_end(_with_start(best))
        if best.ratio > 0.0:  # its valley is long and bent
            again = [_descend(best._replace(lag=best.lag + by, ratio=ratio), _TRIES)
                     for by in (-0.5, 0.0, 0.5) for ratio in _RATIOS]
            best = min((best, *(_descend(each, _ITERATIONS) for each in again)), key=lambda entry: entry.cost)
        solutions += _with_mains(best)
    return sorted((each for each in solutions if min(each.gains) > 0.0), key=lambda entry: entry.bic)


def _with_start(best: SwitchingSolution) -> SwitchingSolution:
    """Return the fit in which the heater is on from soon after the log begins, if that explains the log better.

    A log that begins as the heater is switched on shows its dead time before the first rise.
    """
    if not best.problem.is_on or not len(best.instants):
        return best
    begin, problem = float(best.problem.time_s[0]), best.problem._replace(is_on=False)
    row, lag = float(np.median(np.diff(problem.time_s))), math.exp(best.lag)
    offsets = [late for late in (0.5 * row, *(share * lag for share in _EARLY)) if begin + late < best.instants[0]]
    trials = [_descend(best._replace(problem=problem, instants=np.append(begin + late, best.instants)), _TRIES)
              for late in offsets]
    if not trials:
        return best
    later = _descend(min(trials, key=lambda entry: entry.cost), _ITERATIONS)
    return later if later.bic < best.bic else best


def _with_end(best: SwitchingSolution) -> SwitchingSolution:
    """Return the fit with one more switching near the end of the log, if that explains the log better.

    The last turn is not confirmed by a whole swing.
    """
    time, y, instants = best.problem.time_s, best.problem.temperature_degC, best.instants
    if not len(instants):
        return best
    last = np.flatnonzero(time > instants[-1])
    if len(last) < 2:
        return best
    is_on = (len(instants) % 2 == 0) == best.problem.is_on
    turn = float(time[last][int(np.argmax(y[last]) if is_on else np.argmin(y[last]))])
    row = float(np.median(np.diff(time)))
    places = [each for each in (turn, turn - row, float(time[-1]) - row, float(time[-1]) - 3.0 * row)
              if instants[-1] < each < time[-1]]
    trials = [_descend(best._replace(instants=np.append(instants, each)), _TRIES) for each in places]
    if not trials:
        return best
    later = _descend(min(trials, key=lambda entry: entry.cost), _ITERATIONS)
    return later if later.bic < best.bic else best


def _with_mains(best: SwitchingSolution) -> list[SwitchingSolution]:
    """Return the fits with one change of the heating power that explain the log better, or the fit without.

    The mains voltage, or an element of several, changes what full power is.
    """
    offs = range(2 if best.problem.is_on else 3, len(best.instants), 2)
    trials = [_evaluated(best.problem._replace(changed_at=place, share=share), best.lag, best.ratio, best.instants)[0]
              for place in offs for share in _SHARES]
    if not trials:
        return [best]
    ranked = sorted(trials, key=lambda entry: entry.cost)
    places = list(dict.fromkeys(each.problem.changed_at for each in ranked))[:_PLACES]
    first = [next(each for each in ranked if each.problem.changed_at == place) for place in places]
    changed = sorted((_descend(each, 20) for each in (*first, *ranked[:2])), key=lambda entry: entry.bic)
    least = changed[0].bic
    near = [each for each in changed if each.bic < min(least, best.bic) + _NEAR]
    return near[:_PLACES] if least < best.bic - _NEAR else [best]


def _profiles(best: SwitchingSolution) -> tuple[list[SwitchingSolution], Array]:
    """Return heaters that the log cannot tell from the best, and 95 % margins of gain (a share), ambient and instants.

    Profile likelihood of time constant and ratio, everything else fitted again; the noise is first-order
    autoregressive.
    """
    n = len(best.left)
    rho = float(np.clip(autocorrelation(best.left, 1)[0], 0.0, 0.98))
    freedom = max((n - best.unknowns) * (1.0 - rho) / (1.0 + rho) / _repeats(best), 4.0)
    quantile = student_t(freedom)
    limit = best.cost * quantile**2 / freedom
    pulses = _evaluated(best.problem, best.lag, best.ratio, best.instants)[2]
    columns = [_slope(best, 1e-4, 0.0), *([_slope(best, 0.0, 1e-4)] if best.ratio else [])]
    basis = _basis(best.problem, best.lag, best.ratio, best.instants, float(best.problem.time_s[0]))[0]
    jacobian = np.column_stack([basis, *columns, pulses])
    inverse = np.linalg.pinv(jacobian.T @ jacobian)
    variance = best.cost / freedom
    width = basis.shape[1]
    spread = np.sqrt(np.maximum(np.diag(inverse), 0.0) * variance)
    # of the gain with the time constant held: the profile moves that
    projection = np.linalg.pinv(np.delete(jacobian, width, axis=1).T @ np.delete(jacobian, width, axis=1))
    gain, ambient = quantile * np.sqrt(np.maximum(np.diag(projection)[[0, width - 1]] * variance, 0.0))
    solutions = list[SwitchingSolution]()
    for number, hold in enumerate(("lag", "ratio")[: 1 + (best.ratio > 0.0)]):
        deviation = float(np.clip(spread[width + number], 1e-4, 0.5))
        for side in (-1.0, 1.0):
            solutions += _side(best, hold, side * deviation, limit)
    return solutions, np.array([gain / abs(float(best.linear[0])),
                                ambient if best.problem.ambient_degC is None else 0.0,
                                quantile * float(np.median(spread[-len(best.instants):]))])


def _repeats(best: SwitchingSolution) -> float:
    """Return how often the errors repeat: those of rounding are the same in each period, unless noise dithers them.

    White noise of half a step makes the errors of rounding independent (B. Widrow, I. Kollár, "Quantization Noise",
    2008, section 4.5), which leaves an error of 0.45 steps with noise of a third of one.
    """
    step = float(np.min(np.diff(np.unique(best.problem.temperature_degC))))
    is_dithered = math.sqrt(best.cost / len(best.left)) > _DITHERED * step
    return 1.0 if is_dithered else max(1.0, len(best.instants) / 2.0)


def _side(best: SwitchingSolution, hold: str, deviation: float, limit: float) -> Iterator[SwitchingSolution]:
    """Yield the fits on one side of the best, up to the first beyond the limit."""
    now = best
    for step in _STEPS:
        by = step * deviation
        if hold == "lag":
            start = now._replace(lag=min(best.lag + by, math.log(LONGEST * float(np.ptp(best.problem.time_s)))))
        else:
            start = now._replace(ratio=float(np.clip(best.ratio * math.exp(by), _LEAST_RATIO, _MOST_RATIO)))
        now = _descend(start, 8, hold_lag=hold == "lag", hold_ratio=hold == "ratio")
        if min(now.gains) > 0.0:
            yield now
        if now.cost - best.cost > limit:
            return
