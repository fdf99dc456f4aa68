"""What a switch made of the duty that was logged: it waits for its next period, and it counts whole ticks.

A PWM of 50 ticks gives power in steps of 2 %, whatever a controller asks for. In a loop that hardly moves the rest that
it leaves out stays for minutes, and a heater that is found without it is bent by that rest: its dead time most of all.
How many ticks there are nobody logs. But a wrong count explains nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from heatertune.log.values import Log

__all__ = ["DutySwitch", "phases", "reconstruct_power", "with_duty"]

Array = npt.NDArray[np.float64]

_ROWS: Final = 3.0  # in a period: with fewer the log does not tell where it begins
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
    if period_s is None or period_s < _ROWS * float(np.median(np.diff(log.time_s))):
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
        asked = power * (switch.ticks / 100.0)
        power = (np.floor(asked + 1e-9) if switch.down else np.round(asked)) * (100.0 / switch.ticks)
    if switch.phase_s is not None:
        assert period_s is not None
        first, last = float(log.time_s[0]), float(log.time_s[-1])
        begins = np.arange(first + switch.phase_s - period_s, last + 2.0 * period_s, period_s)
        taken = power[np.maximum(np.searchsorted(log.time_s, begins + 1e-9 * period_s, side="right") - 1, 0)]
        energy = np.concatenate([[0.0], np.cumsum(taken[:-1]) * period_s])
        ends = np.append(log.time_s, 2.0 * last - log.time_s[-2])
        power = np.diff(np.interp(ends, begins, energy)) / np.diff(ends)
    return replace(log, power_pct=np.clip(power, 0.0, 100.0))


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
    seen = error[np.maximum(np.searchsorted(time, begins + 1e-9 * period_s, side="right") - 1, 0)]
    mean = np.diff(_energy(time, error, np.append(begins, begins[-1] + period_s)))
    summed = np.concatenate([[0.0], np.cumsum(np.where(between, mean, 0.0))[:-1]])
    law = np.column_stack([seen, summed, np.ones(len(begins))])
    told = np.clip(law @ np.linalg.lstsq(law[between], duty[between], rcond=None)[0], 0.0, 100.0)
    row = 100.0 * float(np.median(np.diff(time))) / period_s
    if float(np.sqrt(np.mean((told - duty)[between] ** 2))) > _OFF * row:
        return log
    rows = np.maximum(np.searchsorted(begins, time + 1e-9 * period_s, side="right") - 1, 0)
    return replace(log, power_pct=np.where(between, told, np.clip(duty, 0.0, 100.0))[rows])


def _energy(time: Array, held: Array, at: Array) -> Array:
    """Return the integral of what is held from each row to the next, at instants."""
    return np.asarray(np.interp(at, time, np.concatenate([[0.0], np.cumsum(held[:-1] * np.diff(time))])))
