"""Whether a log without power can be of a continuous controller: not of an open-loop heat-up, not of two-level control.

The laws that a fit tries hold a temperature at a setpoint by a power that varies continuously. A heat-up at constant
power until a target holds nothing, and a thermostat swings without end between two thresholds. Both are explained
closely by laws that did not make them, so the fit itself gives no warning.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.log.values import Log
from heatertune.model.diagnostics import Remark
from heatertune.model.power.log_arrays import Readings
from heatertune.model.power.open_loop import PowerProblem
from heatertune.model.temperature.evidence import noise_degC

__all__ = ["is_open_loop", "regulation_remarks", "steady_swing"]

Array = npt.NDArray[np.float64]

_SMOOTH: Final = 300  # parts of a log, over each of which the readings are averaged
_MOVES: Final = 8.0  # standard deviations of the smoothed noise that a turning point is beyond
_LEAST_MOVE: Final = 0.003  # of the span, the same
_TURNS: Final = 6  # fewest turning points of a steady swing: two and a half periods
_EVEN: Final = 0.3  # most standard deviation of its swings, and of its periods, as a share of their mean
_STEADY: Final = 0.75  # least ratio of the later half's swing to the earlier half's
_DEEP: Final = 0.6  # of the span: no overshoot of a usable loop is followed by a deeper fall
_SWITCHED_OFF: Final = 0.35  # of the span: nor by such a fall without a rise after it
_HELD_BAND: Final = 0.03  # of the span: the readings of a hold lie within
_HELD_LEVEL: Final = 0.4  # of the span: a hold lies above
_HELD_SHARE: Final = 0.2  # of the log's length: a hold lasts as long at least
_AS_WELL: Final = 1.15  # times the error of the controller that explains the log best
_INSTANTS: Final = 14  # tried for the end of the power
_MOST_READINGS: Final = 20_000  # in which a swing is sought
_READINGS: Final = 200  # of a log that constant power is fitted to


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
            "explains it as well as a controller does. The parameters are not those of the heater."
        ))


def steady_swing(log: Log) -> OscillationStats | None:
    """Return the swing that a log ends in, None where it dies away, is irregular, or has too few periods.

    It is sought in the readings as they are, and in smoothed ones where the noise is too large for that.
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
    ends_off = len(moves) > 0 and float(-moves[-1]) > _SWITCHED_OFF * span
    if deepest > _DEEP * span or ends_off:
        return True
    if len(moves) <= 1 and not _is_held(time, y, max(_HELD_BAND * span, least)):
        return True
    return _constant_power_rmse(log) <= _AS_WELL * rmse_degC


def _scatter(values: Array) -> float:
    """Return the standard deviation of some values as a share of their mean."""
    return float(np.std(values)) / float(np.mean(values))


def _first_high(turns: Array) -> int:
    """Return the number of the first high among turning points: the heat-up before it is no part of a swing."""
    return 0 if len(turns) < 2 or turns[0] > turns[1] else 1


def _size(log: Log) -> int:
    """Return how many readings a 300th part of a log has, at least one."""
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
    """Return where readings turn by at least so much, first and last extreme included, highs and lows in turn."""
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
    thin = replace(log, time_s=log.time_s[::every], temperature_degC=log.temperature_degC[::every], setpoint_degC=None)
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
    """Return the error of one lag or two whose power is on from one reading to another [°C]."""
    power = np.zeros(len(log.time_s))
    power[first:last] = 100.0
    readings = Readings.of(replace(log, power_pct=power))
    problems = (PowerProblem(readings=readings, two_lags=two, at_rest=rest, power_before_pct=0.0)
                for two, rest in ((True, True), (True, False), (False, True)))
    errors = (log.temperature_degC - problem.fit().simulated_degC for problem in problems)
    return min(float(np.sqrt(np.mean(error**2))) for error in errors)
