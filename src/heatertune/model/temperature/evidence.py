"""Facts that a temperature alone shows, whatever the controller: bounds, saturated heat-up, free cooling.

A single lag falls no faster than towards the ambient, and no heater rises faster than gain · 100 %/time constant. An
exponential means constant power: towards a value far above the log it is a heat-up at the output limit, towards the
ambient it is free cooling.

The laws of a fit without power hold a setpoint with continuously varying power. They also fit an open-loop heat-up or
a thermostat closely, so a test here tells these apart from a continuous controller.

The thresholds of two-level control are an interval each, from the temperature at each switching. The controller
switches at its first reading at or beyond the threshold, at an instant that the rows hide. So a threshold lies between
the temperatures at the beginning and at the end of what each switching leaves open. A minimum time on or off delays a
switching: the threshold for off may then be lower, and that for on higher.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.errors import InputError, OutOfRange
from heatertune.log.log_values import Log
from heatertune.model.diagnostics import Remark
from heatertune.model.model_values import HeaterModel
from heatertune.model.power.open_loop import PowerProblem
from heatertune.model.power.regressors import Readings
from heatertune.model.statistics import SWITCHED_OFF, Interval, autocorrelation, hull
from heatertune.model.temperature.closed_loop import Bounds

__all__ = [
    "AS_WELL", "Bound", "ConstantPowerStretch", "Thermostat", "Thresholds", "bound_contradictions", "contradictions",
    "end_of_rest", "evidence_notes", "fall_bound", "free_cooling", "is_faster_than_rows", "is_open_loop", "noise_degC",
    "quiet_noise_degC", "reading_margin_degC", "regulation_remarks", "rise_bound", "saturated_heat_up",
    "steady_swing", "switching_guess", "threshold_between",
]


_FEWEST = 8  # readings of a stretch
_STARTS, _ENDS = 20, 40  # of stretches tried, spread over the readings
_QUIET = 1.5  # times the log's noise that an exponential may leave over
_BEYOND = 0.2  # of the log's span, by which a saturated heat-up aims above its highest reading
_FALL = 0.05  # of the log's span, the least fall that bounds a time constant
_CHI2 = 3.84  # 95 % point of χ² with one degree of freedom
_LAGS: Final = 160  # time constants tried
_COARSER: Final = 4  # of these every so many-th, for a first look
_FAR_OFF: Final = 1.25  # times the ends of the interval of a cooling
_RISE_NOISE: Final = 4.0  # standard deviations by which noise may steepen the steepest rise


class Bound(NamedTuple):
    """A bound and the readings that give it: its value, first and last instant [s]."""

    value: float
    start_s: float
    end_s: float


class ConstantPowerStretch(NamedTuple):
    """A stretch of constant power, as one lag: instants [s], bounds of time constant [s] and final value [°C].

    A bound at the edge of the search is infinite, or zero for a time constant.
    """

    start_s: float
    end_s: float
    time_constant_s: Bounds
    aim_degC: Bounds


def fall_bound(log: Log, coldest_degC: float) -> Bound | None:
    """Return the largest possible time constant of a single lag [s], None if the log never falls.

    From T1 to T2 in a time t: at most t/ln((T1 − Ta)/(T2 − Ta)), Ta the lowest ambient possible.
    """
    time, y = log.time_s, log.temperature_degC - coldest_degC
    best: Bound | None = None
    for i in range(len(time) - _FEWEST):
        later = np.arange(i + _FEWEST, len(time))
        fallen = later[(y[later] > 0.0) & (y[later] < y[i] - _FALL * float(np.ptp(y)))]
        if len(fallen):
            limits = (time[fallen] - time[i]) / np.log(y[i] / y[fallen])
            k = int(np.argmin(limits))
            if best is None or limits[k] < best.value:
                best = Bound(float(limits[k]), float(time[i]), float(time[fallen[k]]))
    return best


def rise_bound(log: Log) -> Bound:
    """Return the least gain per time constant [°C/(s·%)]: the steepest rise over eight readings, by 100 %.

    Two lags rise more slowly than the larger one alone would; but heat stored before the log may add to the rise.
    """
    time, y = log.time_s, log.temperature_degC
    slopes = (y[_FEWEST - 1 :] - y[: 1 - _FEWEST]) / (time[_FEWEST - 1 :] - time[: 1 - _FEWEST])
    k = int(np.argmax(slopes))
    return Bound(float(slopes[k]) / 100.0, float(time[k]), float(time[k + _FEWEST - 1]))


def saturated_heat_up(log: Log) -> ConstantPowerStretch | None:
    """Return the longest stretch before the highest reading that is an exponential aiming far above it."""
    y = log.temperature_degC
    highest = float(y.max()) + _BEYOND * float(np.ptp(y))
    return _longest(log, 0, int(np.argmax(y)), lambda stretch: stretch.aim_degC[0] > highest)


@lru_cache(maxsize=4)  # used by notes and by contradictions
def free_cooling(log: Log, ambient_degC: Bounds) -> ConstantPowerStretch | None:
    """Return the longest stretch after the highest reading that is an exponential aiming at the ambient, far below."""
    y, (low, high) = log.temperature_degC, ambient_degC
    span = float(np.ptp(y))
    lowest = float(y[int(np.argmax(y)) :].min()) - _BEYOND * span

    def cools(stretch: ConstantPowerStretch) -> bool:
        coldest, warmest = stretch.aim_degC
        return low - span <= coldest <= high and low <= warmest < max(lowest, high)

    return _longest(log, int(np.argmax(y)), len(y) - 1, cools)


def evidence_notes(log: Log, ambient_degC: Bounds) -> Iterable[str]:
    """Report the bounds, the stretches of constant power, and whether a single lag is possible."""
    fall, rise = fall_bound(log, ambient_degC[0]), rise_bound(log)
    heat_up, cooling = saturated_heat_up(log), free_cooling(log, ambient_degC)
    yield (
        f"Whatever the controller of {log.name}: gain per time constant is at least {rise.value:.2g} °C/(s·%), unless "
        f"heat was stored before (rise from {rise.start_s:g} to {rise.end_s:g} s)" + ("" if fall is None else (
            f", and a single lag's time constant at most {fall.value:.0f} s (fall from {fall.start_s:g} to "
            f"{fall.end_s:g} s, ambient at least {ambient_degC[0]:.1f} °C)")) + "."
    )
    if heat_up is None:
        yield "No part of its heat-up is an exponential that aims beyond the log: nothing shows full power."
    else:
        low = heat_up.time_constant_s[0]
        yield (
            f"From {heat_up.start_s:g} to {heat_up.end_s:g} s it heats up with constant power: an exponential that "
            f"aims at {heat_up.aim_degC[0]:.0f} °C or more; a single lag's time constant is then at least {low:.0f} s."
        )
        if fall is not None and low > fall.value:
            yield f"No single lag has both ({low:.0f} s or more, and at most {fall.value:.0f} s): there are two."
    if cooling is None:
        yield "None of its falls is an exponential towards the ambient: the heater was never off for long."
    else:
        shortest, longest = cooling.time_constant_s
        yield (
            f"From {cooling.start_s:g} to {cooling.end_s:g} s it cools freely: a single lag's time constant is then "
            f"{shortest:.0f}…{longest:.0f} s."
        )


def bound_contradictions(log: Log, ambient_degC: Bounds, plants: Sequence[HeaterModel]) -> Iterator[Remark]:
    """Yield the finding that all models have one lag, and break a bound of one lag under any controller."""
    fall, rise, heat_up = fall_bound(log, ambient_degC[0]), rise_bound(log), saturated_heat_up(log)
    interval = (rise.end_s - rise.start_s) * 100.0
    least_ratio = (rise.value - _RISE_NOISE * noise_degC(log) / interval) / _FAR_OFF
    longest = np.inf if fall is None else fall.value * _FAR_OFF
    shortest = 0.0 if heat_up is None else heat_up.time_constant_s[0] / _FAR_OFF

    def breaks(plant: HeaterModel) -> bool:
        lag = plant.lags_s[0]
        return len(plant.lags_s) == 1 and (
            plant.gain_degC_per_pct / lag < least_ratio or not shortest <= lag <= longest)

    if all(breaks(plant) for plant in plants):
        yield Remark("contradicted", (
            f"{log.name} is explained by models of one lag alone, and each breaks a bound that holds for one lag under "
            "any controller (gain per time constant, or time constant, see above)."))


def contradictions(log: Log, ambient_degC: Bounds, plants: Sequence[HeaterModel]) -> Iterator[Remark]:
    """Report free cooling that is far quicker or slower than on every model: the assumed law is then wrong."""
    cooling = free_cooling(log, ambient_degC)
    if cooling is None:
        return
    shortest, longest = cooling.time_constant_s[0] / _FAR_OFF, cooling.time_constant_s[1] * _FAR_OFF
    lags = [lag for plant in plants for lag in (plant.lags_s[0], plant.half_rule().time_constant_s)]
    if all(not shortest <= lag <= longest for lag in lags):
        yield Remark("contradicted", (
            f"From {cooling.start_s:g} to {cooling.end_s:g} s {log.name} cools freely with a time constant of "
            f"{cooling.time_constant_s[0]:.3g}…{cooling.time_constant_s[1]:.3g} s; the models that explain it have "
            f"{min(lags):.3g}…{max(lags):.3g} s."
        ))


def _longest(log: Log, first: int, last: int,
             is_wanted: Callable[[ConstantPowerStretch], bool]) -> ConstantPowerStretch | None:
    """Return the longest low-noise exponential between two readings that meets the condition.

    Its intervals contain those of its first half and first three quarters: if the power changes within the stretch,
    they differ.
    """
    quiet = _QUIET * noise_degC(log)
    starts = np.unique(np.linspace(first, max(first, last - _FEWEST + 1), _STARTS).astype(np.intp))
    ends = np.unique(np.linspace(min(first + _FEWEST - 1, last), last, _ENDS).astype(np.intp))
    pairs = [(int(a), int(b)) for a in starts for b in ends if b - a >= _FEWEST - 1]
    for a, b in sorted(pairs, key=lambda pair: pair[0] - pair[1]):
        whole = _exponential(log, a, b, quiet)
        if whole is not None and is_wanted(whole):
            sizes = (max(_FEWEST, (b - a) * share // 4) for share in (2, 3))
            parts = [whole, *filter(None, (_exponential(log, a, a + size, quiet) for size in sizes))]
            lags, aims = ([stretch.time_constant_s for stretch in parts], [stretch.aim_degC for stretch in parts])
            return whole._replace(time_constant_s=_hull(lags), aim_degC=_hull(aims))
    return None


def _hull(intervals: Sequence[Bounds]) -> Bounds:
    return min(low for low, _ in intervals), max(high for _, high in intervals)


def noise_degC(log: Log) -> float:
    """Return the noise of the readings [°C], from their second differences; never less than their resolution shows."""
    y = log.temperature_degC
    step = float(np.min(np.diff(np.unique(y))))
    return float(max(np.std(np.diff(y, 2)) / np.sqrt(6.0), step / np.sqrt(12.0)))


def quiet_noise_degC(log: Log) -> float:
    """Return the noise by the usual second difference [°C]: a few turns between two rows are no noise."""
    y = log.temperature_degC
    step = float(np.min(np.diff(np.unique(y))))
    usual = 1.4826 * float(np.median(np.abs(np.diff(y, 2)))) / math.sqrt(6.0)
    return min(noise_degC(log), max(usual, step / math.sqrt(12.0)))


def _exponential(log: Log, first: int, last: int, quiet: float) -> ConstantPowerStretch | None:
    """Return the one-lag curves that fit some readings as well as the best (95 %), None if none is within the noise."""
    y, elapsed = log.temperature_degC[first : last + 1], log.time_s[first : last + 1] - log.time_s[first]
    n = len(y)
    coarse = np.geomspace(2.0 * elapsed[-1] / (n - 1), 50.0 * elapsed[-1], _LAGS)
    if _is_loud(elapsed, y, np.append(coarse[:-1:_COARSER], coarse[-1]), quiet):
        return None
    near = _as_good(_curves(elapsed, y, coarse)[1], n)
    is_open = near[0] == 0, near[-1] == _LAGS - 1
    lags = np.geomspace(coarse[max(near[0] - 1, 0)], coarse[min(near[-1] + 1, _LAGS - 1)], _LAGS)
    aim, cost = _curves(elapsed, y, lags)
    if np.sqrt(float(cost.min()) / n) > quiet:
        return None
    near = _as_good(cost, n)
    ends = float(log.time_s[first]), float(log.time_s[last])
    between = 0.0 if is_open[0] else float(lags[near[0]]), np.inf if is_open[1] else float(lags[near[-1]])
    return ConstantPowerStretch(*ends, between, (float(aim[near].min()), float(aim[near].max())))


def _is_loud(elapsed: Array, y: Array, lags: Array, quiet: float) -> bool:
    """Return whether every exponential with a time constant in this range certainly leaves more than noise.

    The residual of an exponential is its angle to the readings about their means; one between two neighbours is no
    further from either of them than they are from each other.
    """
    shape = np.exp(-elapsed / lags[:, None])
    shape -= shape.mean(axis=1, keepdims=True)
    shape /= np.sqrt(np.einsum("lt,lt->l", shape, shape))[:, None]
    about = y - y.mean()
    size = float(np.sqrt(about @ about))
    if size == 0.0:
        return False
    angle = np.arccos(np.minimum(np.abs(shape @ about) / size, 1.0))
    apart = np.arccos(np.minimum(np.einsum("lt,lt->l", shape[1:], shape[:-1]), 1.0))
    least = max(float(np.min(np.minimum(angle[1:], angle[:-1]) - apart)), 0.0)
    return bool(size * np.sin(least) > quiet * np.sqrt(len(y)))


def _curves(elapsed: Array, y: Array, lags: Array) -> tuple[Array, Array]:
    """Return the aim of the best exponential of each time constant, and its sum of squares."""
    shape = np.exp(-elapsed / lags[:, None])
    centred = shape - shape.mean(axis=1, keepdims=True)
    height = centred @ (y - y.mean()) / np.einsum("lt,lt->l", centred, centred)
    aim = y.mean() - height * shape.mean(axis=1)
    return aim, np.sum((y - aim[:, None] - height[:, None] * shape) ** 2, axis=1)


def _as_good(cost: Array, n: int) -> npt.NDArray[np.intp]:
    """Return which curves explain n readings as well as the best: three numbers are fitted."""
    return np.flatnonzero(cost <= float(cost.min()) * (1.0 + _CHI2 / (n - 3)) + 1e-12)


_SMOOTH: Final = 300  # parts of a log, over each of which the readings are averaged
_MOVES: Final = 8.0  # standard deviations of the smoothed noise that a turning point is beyond
_LEAST_MOVE: Final = 0.003  # of the span, the same
_TURNS: Final = 6  # fewest turning points of a steady swing: two and a half periods
_EVEN: Final = 0.3  # most standard deviation of its swings, and of its periods, as a share of their mean
_STEADY: Final = 0.75  # least ratio of the later half's swing to the earlier half's
_DEEP: Final = 0.6  # of the span: no overshoot of a usable loop is followed by a deeper fall
_HELD_BAND: Final = 0.03  # of the span: the readings of a hold lie within
_HELD_LEVEL: Final = 0.4  # of the span: a hold lies above
_HELD_SHARE: Final = 0.2  # of the log's length: a hold lasts as long at least
AS_WELL: Final = 1.15  # times the error of the controller that explains the log best
_INSTANTS: Final = 14  # tried for the end of the power
_MOST_READINGS: Final = 20_000  # in which a swing is sought
_READINGS: Final = 200  # of a log that constant power is fitted to
_FEWEST_MEANS: Final = 100  # of a log that is smoothed to find its switchings
_TURNS_OFTEN: Final = 0.4  # share of the rows at which the temperature turns
_STEPS_AT_ONCE: Final = 4.0  # steps of the reading from row to row
_SWING_ROWS: Final = 10  # within which a swing of a few rows comes again
_RELATED: Final = 0.25  # correlation that no noise has, of many readings
_DEVIATIONS: Final = 4.2  # the same, times the root of their number: 3 standard deviations by Bartlett
_FEWER_MOVES: Final = (3.0, 1.5)  # the same, if that finds none
_FLAT: Final = 2.0  # standard deviations about a turning point that are one with it
_RISEN: Final = 0.02  # of the span, above the first reading: a heater that was off at first is on
_RESTS: Final = 5  # rows at least, of a heater that is off at first


class OscillationStats(NamedTuple):
    """A steady swing: number of whole periods, mean period [s], mean lowest and highest temperature [°C]."""

    periods: int
    period_s: float
    lowest_degC: float
    highest_degC: float


def regulation_remarks(log: Log, rmse_degC: float) -> Iterator[Remark]:
    """Yield the findings that no continuous controller made this log.

    Args:
        log: without power.
        rmse_degC: error of the controller hypothesis that explains it best [°C].
    """
    if (swing := steady_swing(log)) is not None:
        yield Remark("two-level", (
            f"{log.name} swings steadily between {swing.lowest_degC:.4g} and {swing.highest_degC:.4g} °C, "
            f"{swing.periods} periods of {swing.period_s:.3g} s: two-level control (a thermostat) or a slow PWM. No "
            "such law is among the hypotheses, so the parameters are not those of the heater."
        ))
    elif is_open_loop(log, rmse_degC):
        yield Remark("not-regulated", (
            f"{log.name} looks like a heat-up in open loop: no controller holds its temperature, and constant power "
            "explains it as well as a controller does. The parameters are not those of the heater." + _restart_note(log)
        ))


def _restart_note(log: Log) -> str:
    """Return the advice about the deepest fall in a log without power, if a temperature was held before it.

    A part after the fall does not begin at the temperature of the room, so it is no way out.
    """
    size = _size(log)
    time, y = _smoothed(log, size)
    least, span = _least_move(log, y, size), float(np.ptp(y))
    falls = [(int(high), int(low)) for high, low in pairwise(_turning_points(y, least))
             if y[high] - y[low] > SWITCHED_OFF * span]
    if not falls:
        return ""
    high, low = max(falls, key=lambda fall: float(y[fall[0]] - y[fall[1]]))  # an overshoot's fall is not as deep
    # the knee before the fall: where the curve is farthest above the chord
    last = high + int(np.argmax(y[high:low + 1] - np.linspace(y[high], y[low], low + 1 - high)))
    if not _is_held(time[:last + 1], y[:last + 1], max(_HELD_BAND * span, least)):
        return ""
    at = float(log.time_s[min(last * size, len(log.time_s) - 1)])
    return (f" But a temperature was held until {at:.10g} s, and then it falls far: the controller was reset or "
            f"switched off. --until {at:.10g} leaves the part before that.")


def steady_swing(log: Log) -> OscillationStats | None:
    """Return the limit cycle at the end of a log, None if it decays, is irregular, or has too few periods.

    It is searched in the readings, and in smoothed ones if the noise is too large.
    """
    size = _size(log)
    swings = (_swing_of(log, each) for each in ((1, size) if size > 1 else (1,)))
    return next((swing for swing in swings if swing is not None), None)


def _swing_of(log: Log, size: int) -> OscillationStats | None:
    """Return the steady swing of the means over so many readings each, of the last ones of a very long log."""
    time, y = _smoothed(log, size)
    least = _least_move(log, y, size)
    time, y = time[-_MOST_READINGS:], y[-_MOST_READINGS:]
    places = _turning_points(y, least)
    places = places[_first_high(y[places]):]
    if len(places) < _TURNS:
        return None
    swings, periods = np.abs(np.diff(y[places]))[1:-1], np.diff(time[places[::2]])
    half = len(swings) // 2
    if max(_scatter(swings), _scatter(periods)) > _EVEN:
        return None
    if float(np.median(swings[-half:])) < _STEADY * float(np.median(swings[:half])):
        return None
    return OscillationStats(len(periods), float(np.mean(periods)), float(np.mean(y[places[1::2]])),
                            float(np.mean(y[places[::2]])))


def is_faster_than_rows(log: Log) -> bool:
    """Return whether the temperature goes up and down from row to row by far more than a step of its reading.

    White noise does so, too. But its second differences are not correlated beyond two rows; those of a swing are.
    """
    late = log.temperature_degC[len(log.temperature_degC) // 2 :]
    moves = np.diff(late)
    moves = moves[moves != 0.0]
    turns = float(np.mean(moves[1:] * moves[:-1] < 0.0)) if len(moves) > _TURNS else 0.0
    step = float(np.min(np.diff(np.unique(log.temperature_degC))))
    if turns <= _TURNS_OFTEN or quiet_noise_degC(log) <= _STEPS_AT_ONCE * step:
        return False
    beyond = autocorrelation(np.diff(late, 2), _SWING_ROWS)[2:]
    return bool(np.abs(beyond).max() > max(_RELATED, _DEVIATIONS / math.sqrt(len(late))))


class SwitchingGuess(NamedTuple):
    """Where two-level control seems to switch: instants [s], rows of the log, and whether it is on at first."""

    instants: Array
    rows: tuple[int, ...]
    is_on: bool


def _most_turns(log: Log, least_degC: float) -> tuple[npt.NDArray[np.intp], int]:
    """Return the turning points of the means over as many readings as show most of them, and how many that are."""
    best, chosen, size = np.empty(0, dtype=np.intp), 1, 1
    while size <= max(1, len(log.time_s) // _FEWEST_MEANS):
        y = _smoothed(log, size)[1]
        places = _turning_points(y, max(least_degC / math.sqrt(size), _LEAST_MOVE * float(np.ptp(y))))
        if len(places) > len(best):
            best, chosen = places, size
        size *= 2
    return best, chosen


def switching_guess(log: Log, *, is_stated: bool) -> SwitchingGuess:
    """Return the turning points of a log, with as much smoothing as shows most of them.

    Args:
        log: without power.
        is_stated: whether two-level control is stated: a single turn is one then, and none is sought in the noise.
    """
    usual = quiet_noise_degC(log)
    for moves in (_MOVES, *_FEWER_MOVES):  # few rows to a swing: it is its own "noise"
        best, chosen = _most_turns(log, moves * usual)
        inner = [int(place) for place in best[:-1] if place > 1]  # the last extreme is that of the log's end
        if len(best) >= _TURNS or (is_stated and inner):
            break
    time, y = _smoothed(log, chosen)
    noise = usual / math.sqrt(chosen)
    if not inner:
        return SwitchingGuess(np.empty(0), (), bool(y[-1] > y[0]))
    is_on = bool(y[inner[0]] > y[0])
    ends = [0, *inner, len(y) - 1]
    instants, rows = [], []
    for number, (before, place, after) in enumerate(zip(ends, ends[1:], ends[2:], strict=False)):
        is_high = (number % 2 == 0) == is_on
        beyond = y[before:after + 1] - y[place] if is_high else y[place] - y[before:after + 1]
        flat = before + np.flatnonzero(beyond >= -_FLAT * noise)
        # a heater at rest is switched on at the end of its rest
        middle = int(flat[-1]) if number == 0 and not is_high else int(np.median(flat))
        instants.append(float(time[middle]))
        rows.append(min(place * chosen + chosen // 2, len(log.time_s) - 1))
    rest = end_of_rest(log)
    if is_stated and is_on and rest is not None and rest < rows[0]:
        is_on, instants, rows = False, [float(log.time_s[rest]), *instants], [rest, *rows]
    in_order = [i for i, instant in enumerate(instants) if i == 0 or instant > instants[i - 1]]
    return SwitchingGuess(np.array(instants)[in_order], tuple(rows), is_on) if len(in_order) == len(instants) else (
        SwitchingGuess(time[inner], tuple(rows), is_on))


def end_of_rest(log: Log) -> int | None:
    """Return the last row that is no warmer than the first one, None where the heater does not rest at first."""
    y = log.temperature_degC
    rest = int(np.flatnonzero(y <= y[0] + _RISEN * np.ptp(y))[-1])
    return rest if rest >= _RESTS else None


def is_open_loop(log: Log, rmse_degC: float) -> bool:
    """Return whether nothing in a log shows that its temperature was held.

    Args:
        log: without power.
        rmse_degC: error of the controller hypothesis that explains it best [°C].
    """
    size = _size(log)
    time, y = _smoothed(log, size)
    least = _least_move(log, y, size)
    turns = y[_turning_points(y, least)]
    moves, span = np.diff(turns[int(np.argmax(turns)):]), float(np.ptp(y))
    deepest = float(-np.diff(turns).min(initial=0.0))
    ends_off = len(moves) > 0 and float(-moves[-1]) > SWITCHED_OFF * span
    if deepest > _DEEP * span or ends_off:
        return True
    if len(moves) <= 1 and not _is_held(time, y, max(_HELD_BAND * span, least)):
        return True
    return _constant_power_rmse(log) <= AS_WELL * rmse_degC


def _scatter(values: Array) -> float:
    """Return the standard deviation of some values as a share of their mean."""
    return float(np.std(values)) / float(np.mean(values))


def _first_high(turns: Array) -> int:
    """Return the number of the first high among turning points: the heat-up before it is no part of a swing."""
    return 0 if len(turns) < 2 or turns[0] > turns[1] else 1


def _size(log: Log) -> int:
    """Return the number of readings in a 300th of a log, at least one."""
    return max(1, len(log.time_s) // _SMOOTH)


def _smoothed(log: Log, size: int) -> tuple[Array, Array]:
    """Return instants and means of so many readings each."""
    whole = len(log.time_s) // size * size
    return (log.time_s[:whole].reshape(-1, size).mean(axis=1),
            log.temperature_degC[:whole].reshape(-1, size).mean(axis=1))


def _least_move(log: Log, smoothed: Array, size: int) -> float:
    """Return the least move of the means of so many readings that is no noise [°C]."""
    return max(_MOVES * noise_degC(log) / math.sqrt(size), _LEAST_MOVE * float(np.ptp(smoothed)))


def _turning_points(y: Array, least: float) -> npt.NDArray[np.intp]:
    """Return the turning points of a minimum size, alternating maxima and minima, with the first and last extreme."""
    places, low, high, rising = list[int](), 0, 0, 0
    for i in range(1, len(y)):
        low = i if y[i] < y[low] else low
        high = i if y[i] > y[high] else high
        if rising >= 0 and y[high] - y[i] >= least:
            places.append(high)
            rising, low = -1, i
        elif rising <= 0 and y[i] - y[low] >= least:
            places.append(low)
            rising, high = 1, i
        if rising == 1:
            low = i
        elif rising == -1:
            high = i
    places.append(high if rising > 0 else low)
    return np.array(places, dtype=np.intp)


def _is_held(time: Array, y: Array, band_degC: float) -> bool:
    """Return whether the temperature stays within a band, above the lower part of the span, for long."""
    lowest = float(y.min()) + _HELD_LEVEL * float(np.ptp(y))
    begin, longest = 0, 0.0
    for end in range(len(y)):
        while float(np.ptp(y[begin:end + 1])) > band_degC:
            begin += 1
        if float(y[begin:end + 1].min()) > lowest:
            longest = max(longest, float(time[end] - time[begin]))
    return bool(longest >= _HELD_SHARE * float(time[-1] - time[0]))


def _constant_power_rmse(log: Log) -> float:
    """Return the error of the heater under constant power that explains a log best [°C].

    The power may begin after a rest, and may end at any instant or never.
    """
    every = max(1, len(log.time_s) // _READINGS)
    thin = log.with_rows(time_s=log.time_s[::every], temperature_degC=log.temperature_degC[::every], setpoint_degC=None)
    y = thin.temperature_degC
    left, peak = int(np.argmax(y > float(y[0]) + 0.05 * float(np.ptp(y)))), int(np.argmax(y))
    coarse = np.unique(np.linspace(max(2, peak // 2), peak, _INSTANTS).astype(np.intp))
    begins = [0] if left <= 1 else [0, max(1, left - 1), max(1, left // 2)]
    trials = [(_pulse_rmse(thin, begin, end), begin, end) for begin in begins for end in [*map(int, coarse), len(y)]]
    best, begin, end = min(trials)
    if end == len(y) or len(coarse) < 2:
        return best
    step = int(np.diff(coarse).max())
    near = range(max(2, end - step + 1), min(peak, end + step - 1) + 1, max(1, step // 4))
    return min([best, *(_pulse_rmse(thin, begin, other) for other in near if other != end)])


def _pulse_rmse(log: Log, first: int, last: int) -> float:
    """Return the error of one lag or two with power on between two readings [°C]."""
    power = np.zeros(len(log.time_s))
    power[first:last] = 100.0
    readings = Readings.of(log.with_rows(power_pct=power))
    problems = (PowerProblem(readings=readings, two_lags=two, at_rest=rest, power_before_pct=0.0)
                for two, rest in ((True, True), (True, False), (False, True)))
    errors = (log.temperature_degC - problem.fit().simulated_degC for problem in problems)
    return min(float(np.sqrt(np.mean(error**2))) for error in errors)


_EXTREME: Final = 3.5  # standard deviations of the noise that many readings reach


@dataclass(frozen=True, slots=True, kw_only=True)
class Thermostat:
    """A stated two-level controller: off from `high_degC` up, on from `low_degC` down.

    Attributes:
        low_degC, high_degC: the thresholds [°C].
        least_on_s, least_off_s: shortest times on and off [s].
    """

    low_degC: float
    high_degC: float
    least_on_s: float = 0.0
    least_off_s: float = 0.0

    @classmethod
    def stated(cls, numbers: float | Sequence[float] | None) -> Thermostat | None:
        """Return the thermostat of two to four stated numbers, None without them.

        Raises:
            OutOfRange: another count of numbers, thresholds in the wrong order, a negative time.
        """
        if numbers is None:
            return None
        entries = (numbers,) if isinstance(numbers, int | float) else tuple(numbers)
        if not 2 <= len(entries) <= 4:
            raise OutOfRange("thermostat", entries, "LOW HIGH, or LOW HIGH MINIMUM-ON MINIMUM-OFF")
        if entries[0] > entries[1]:
            raise OutOfRange("thermostat", entries[0], f"<= its high threshold, {entries[1]:g}")
        if min((0.0, *entries[2:])) < 0.0:
            raise OutOfRange("thermostat", min(entries[2:]), ">= 0: a minimum time [s]")
        return cls(low_degC=entries[0], high_degC=entries[1], least_on_s=entries[2] if len(entries) > 2 else 0.0,
                   least_off_s=entries[3] if len(entries) > 3 else 0.0)

    def crossings(self, log: Log) -> SwitchingGuess:
        """Return where the readings reach the thresholds in turn: it switches there, or later by a minimum time."""
        y, rows = log.temperature_degC, list[int]()
        high, low = (np.flatnonzero(each) for each in (y >= self.high_degC, y <= self.low_degC))
        is_on = bool(len(high)) and (not len(low) or low[0] == 0 or high[0] < low[0])
        ahead, behind = (high, low) if is_on else (low, high)
        row = 0
        while len(after := ahead[ahead > row]):
            row = int(after[0])
            rows.append(row)
            ahead, behind = behind, ahead
        return SwitchingGuess(log.time_s[rows], tuple(rows), is_on)


class Thresholds(NamedTuple):
    """Where a log shows that two-level control switches: on from `low` down, off from `high` up [°C]."""

    low: Interval
    high: Interval
    hysteresis: Interval

    @classmethod
    def between(cls, low: Interval, high: Interval) -> Thresholds:
        """Return two thresholds and the distances that they allow, never negative."""
        (low_least, low_most), (high_least, high_most) = _ends(low), _ends(high)
        least = max(high_least - low_most, 0.0)
        return cls(low, high, Interval(low=least, high=max(high_most - low_least, least)))

    def or_of(self, second: Thresholds) -> Thresholds:
        """Return the intervals that hold both these thresholds and the second ones."""
        return Thresholds(*(hull(one, two) for one, two in zip(self, second, strict=True)))

    @property
    def summary(self) -> str:
        """The thresholds in words."""
        (low, low_most), (high, high_most), (apart, apart_most) = map(_ends, self)
        return (f"off at {high:.1f} to {high_most:.1f} °C and on at {low:.1f} to {low_most:.1f} °C, {apart:.1f} to "
                f"{apart_most:.1f} °C apart, unless a minimum time on or off delays it")

    def check_stated(self, name: str, thermostat: Thermostat) -> None:
        """Refuse stated thresholds that the log contradicts; a stated minimum time allows for a delay.

        Args:
            name: of the log.
            thermostat: as stated.

        Raises:
            InputError: a threshold outside its interval.
        """
        (low, low_most), (high, high_most) = _ends(self.low), _ends(self.high)
        is_off = thermostat.high_degC <= high_most and (thermostat.least_on_s > 0.0 or high <= thermostat.high_degC)
        is_on = low <= thermostat.low_degC and (thermostat.least_off_s > 0.0 or thermostat.low_degC <= low_most)
        if not (is_off and is_on):
            raise InputError(
                f"{name}: its heater is switched {self.summary}; that is not a thermostat of {thermostat.low_degC:g} "
                f"and {thermostat.high_degC:g} °C: correct --thermostat (with its minimum times, if it has any), or "
                "leave it out")


def reading_margin_degC(log: Log) -> float:
    """Return by how much noise and rounding let a controller switch beside its threshold [°C]."""
    step = float(np.min(np.diff(np.unique(log.temperature_degC))))
    noise = np.sqrt(max(quiet_noise_degC(log) ** 2 - step**2 / 12.0, 0.0))
    return float(_EXTREME * noise + 0.5 * step)


def threshold_between(begin_degC: Array, end_degC: Array, margin_degC: float) -> Interval:
    """Return the interval of a threshold from the temperatures on both sides of each switching, of shape (n,).

    Where no threshold fits all switchings (it was changed, or something delays some of them) it holds each one's.
    """
    lowest, highest = np.minimum(begin_degC, end_degC) - margin_degC, np.maximum(begin_degC, end_degC) + margin_degC
    least, most = float(np.max(lowest)), float(np.min(highest))
    if least > most:
        least, most = float(np.min(lowest)), float(np.max(highest))
    return Interval(low=least, high=most)


def _ends(inside: Interval) -> tuple[float, float]:
    """Return the ends of a closed interval."""
    assert inside.low is not None
    assert inside.high is not None
    return inside.low, inside.high
