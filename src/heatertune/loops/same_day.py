"""The logged day once more with another controller: what a linear heater lets a log say of words that never ran there.

temperature = heater[power] + rest: what the fitted heater does not make of the logged power is the rest, loads, room
and noise of that day. Under another controller the rest is the same and the heater is known: the day can be lived
again.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from heatertune.loops.measures import RegularLog
from heatertune.model.values import HeaterModel
from heatertune.pid.loop.sampled import SampledPlant, sample_plant
from heatertune.pid.values import PidDesign

__all__ = ["Day", "day", "ideal", "times_worse"]

Array = npt.NDArray[np.float64]

#: (reading [°C], setpoint [°C]) → power until the next scan [%]
Controller = Callable[[float, float], float]

_MOST_SCANS: Final = 20_000
_WARM: Final = 10.0  # errors that are noise: nearer than so many to its setpoint a loop was at work before the log
_TO_REST: Final = 12.0  # lags and dead times: as long, at least, as a loop gets to come to rest before the log begins
_NEAR: Final = 0.2  # errors that are noise: a slower loop gets longer, until it is so near
_BAND: Final = 0.1  # of a step: there its end begins


@dataclass(frozen=True, slots=True, kw_only=True)
class Day:
    """A day as it was, and as it would have been.

    Attributes:
        time_s: of the scans [s], shape (n,).
        setpoint_degC, measured_degC, relived_degC: at each [°C], shape (n,).
    """

    time_s: Array
    setpoint_degC: Array
    measured_degC: Array
    relived_degC: Array


class _Plant:
    """A heater from scan to scan."""

    def __init__(self, model: HeaterModel, scan_s: float, before_pct: float) -> None:
        self._sampled: SampledPlant = sample_plant(model, scan_s)
        sampled = self._sampled
        self._late = [before_pct] * (sampled.delay + 2)
        self._modes = (sampled.now + sampled.before) / (1.0 - sampled.poles) * before_pct

    def step(self, power_pct: float) -> float:
        """Return the temperature's share of the power after a scan [°C]."""
        self._late.insert(0, power_pct)
        self._late.pop()
        sampled = self._sampled
        now, before = self._late[sampled.delay], self._late[sampled.delay + 1]
        self._modes = sampled.poles * self._modes + sampled.now * now + sampled.before * before
        return float(self._modes.sum())

    @property
    def share(self) -> float:
        """The temperature's share of the power so far [°C]."""
        return float(self._modes.sum())


def ideal(design: PidDesign) -> Controller:
    """Return a design that runs without anybody's arithmetic: P and I on the error, the sum held at the limits."""
    total = 0.0
    k, rate = design.gain_pct_per_degC, design.sample_time_s / design.integral_time_s

    def step(reading: float, setpoint: float) -> float:
        nonlocal total
        error = setpoint - reading
        wish = k * (error + total + rate * error)
        if 0.0 <= wish <= 100.0 or (wish > 100.0) != (k * error > 0.0):
            total += rate * error
        return min(max(k * (error + total), 0.0), 100.0)

    return step


def day(course: RegularLog, model: HeaterModel, controller: Controller, scan_s: float) -> Day:
    """Return the day of a course under another controller.

    Args:
        course: with power.
        model: the heater.
        controller: called once a scan, from its cold state on; a loop that was at work before the log gets time to
            come to rest first.
        scan_s: between two calls [s].
    """
    assert course.power_pct is not None
    length = float(course.time_s[-1] - course.time_s[0])
    h = max(scan_s, length / _MOST_SCANS)
    time = course.time_s[0] + h * np.arange(int(length / h) + 1)
    step = float(course.time_s[1] - course.time_s[0])
    energy = np.concatenate([[0.0], np.cumsum(course.power_pct) * step])
    ends = np.append(course.time_s, course.time_s[-1] + step)
    power = np.diff(np.interp(np.append(time, time[-1] + h), ends, energy)) / h
    measured = np.interp(time, course.time_s, course.temperature_degC)
    held = np.clip(np.searchsorted(course.time_s, time + 1e-9 * h, side="right") - 1, 0, None)
    setpoint = course.setpoint_degC[held]
    warm = abs(float(course.error_degC[0])) <= _WARM * course.least_degC
    was = _Plant(model, h, float(course.power_pct[0]) if warm else 0.0)
    rest = measured - np.array([was.share, *(was.step(each) for each in power[:-1].tolist())])
    relived = _relived(model, controller, h, rest, setpoint, course.least_degC if warm else None)
    return Day(time_s=time, setpoint_degC=setpoint, measured_degC=measured, relived_degC=relived)


def _relived(
    model: HeaterModel, controller: Controller, h: float, rest: Array, setpoint: Array, warm_degC: float | None
) -> Array:
    plant = _Plant(model, h, 0.0)
    if warm_degC is not None:
        settle = int(_TO_REST * (sum(model.lags_s) + model.dead_time_s) / h)
        quiet = float(np.median(rest[:max(1, len(rest) // 200)]))
        now = float(setpoint[0])
        for count in range(_MOST_SCANS):
            if count > settle and abs(plant.share + quiet - now) < _NEAR * warm_degC:
                break
            plant.step(controller(plant.share + quiet, now))
    temperatures, share = [], plant.share
    for other, asked in zip(rest.tolist(), setpoint.tolist(), strict=True):
        temperatures.append(share + other)
        share = plant.step(controller(share + other, asked))
    return np.array(temperatures)


def _near(error: Array, least_degC: float) -> int | None:
    """Return the first row of a stretch that is near its setpoint, None where none is."""
    off = np.abs(error)
    near = np.flatnonzero(off <= np.maximum(least_degC, _BAND * off[:1]))
    return int(near[0]) if len(near) else None


def times_worse(lived: Day, course: RegularLog) -> tuple[float, float, float]:
    """Return how many times the mean error of a day is what it would have been, and both means [°C].

    After a change of the setpoint the comparison begins where the other controller is near it: until then both can
    but heat. Where it never is, it begins where the day as it was is near. Errors that are noise count as nothing, and
    a quarter of one is added to both means: a loop that is never off its setpoint is as good as any.
    """
    counted = np.ones(len(lived.time_s), dtype=bool)
    ends = [*course.changes_s[1:], np.inf]
    for start, end in zip(course.changes_s, ends, strict=True):
        part = np.flatnonzero((lived.time_s >= start) & (lived.time_s < end))
        near = [first for day_degC in (lived.relived_degC, lived.measured_degC)
                if (first := _near(lived.setpoint_degC[part] - day_degC[part], course.least_degC)) is not None]
        counted[part[:near[0] if near else len(part)]] = False
    if not np.any(counted):
        return 1.0, 0.0, 0.0

    def mean(temperature: Array) -> float:
        off = np.abs(lived.setpoint_degC - temperature)[counted]
        return float(np.mean(np.maximum(off - course.least_degC, 0.0)))

    was, would = mean(lived.measured_degC), mean(lived.relived_degC)
    quarter = course.least_degC / 4.0
    return (was + quarter) / (would + quarter), was, would
