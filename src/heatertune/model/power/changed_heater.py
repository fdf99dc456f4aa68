"""Find the instant from which a log is not of the heater of its beginning: a probe that fell out, another heater.

A heater is fitted to the beginning of the log. As long as it foretells the readings, it is that heater; the instant
from which it does not, and never does again, is named with the option that cuts the log there.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from heatertune.errors import InputError
from heatertune.log.log_values import MIN_SAMPLES, Log
from heatertune.model.power.open_loop import PowerFit, PowerProblem
from heatertune.model.power.regressors import AMBIENT, GAIN, Readings

__all__ = ["changed_at_s", "refuse_changed"]

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
_LASTS: Final = 0.8  # share of the readings after the instant that depart


def refuse_changed(log: Log, problem: PowerProblem) -> None:
    """Refuse a log that is of another heater, or of another place, from some instant on.

    Args:
        log: for its name.
        problem: of one lag.

    Raises:
        InputError: the heater of the log's beginning does not make its end, see `changed_at_s`.
    """
    instant_s = changed_at_s(problem)
    if instant_s is not None:
        raise InputError(
            f"{log.name}: up to t={instant_s:.4g} s a heater explains the temperature, and from then on it does not "
            "answer the power as before (a probe that fell out or was moved, another unit, a second heater, a load?); "
            f"cut the log there: --until {instant_s:.4g}")


def changed_at_s(problem: PowerProblem) -> float | None:
    """Return the last instant at which the heater of the log's beginning explains it [s]; None: always, or never.

    Args:
        problem: of one lag.
    """
    readings = replace(problem.readings, restart_s=np.empty(0))
    thin = replace(problem, drift=False, loads_s=(), two_lags=True, readings=readings).average(_READINGS)
    ends = [end for share in _PREFIXES if (end := _explained_until(thin, float(share))) is not None]
    return max(ends, default=None)


def _explained_until(problem: PowerProblem, share: float) -> float | None:
    """Return the instant until which a heater fitted to the first part of the log foretells it, or None."""
    time = problem.readings.time_s
    end: float | None = float(time[0]) + share * float(np.ptp(time))
    for _ in range(_ROUNDS):
        assert end is not None
        before = _foretold_until(problem, end)
        if before is None or abs(before - end) <= 2.0 * float(np.median(np.diff(time))):
            return before
        end = before
    return end


def _foretold_until(problem: PowerProblem, end_s: float) -> float | None:
    """Return the instant until which a heater fitted up to another one foretells the log; None: never or always."""
    time, record = problem.readings.time_s, problem.readings.temperature_degC
    rows = time <= end_s
    begun = replace(problem, readings=_first(problem.readings, end_s))
    count = int(np.count_nonzero(rows))
    if count < MIN_SAMPLES or len(rows) - count < _FEWEST or not np.ptp(begun.readings.level_pct):
        return None
    fit = begun.fit()
    if fit.model is None or not _is_heater(begun, fit):
        return None
    span, error = float(np.ptp(record[rows])), float(np.sqrt(np.mean((record[rows] - fit.simulated_degC) ** 2)))
    apart = np.abs(record - np.asarray(fit.linear @ problem.basis(fit.vector)))
    beyond = apart > max(_TIMES * error, _LEAST * span)
    places = [place for place in np.flatnonzero(beyond) if np.mean(beyond[place:place + _FEWEST]) >= _LASTS]
    place = int(places[0]) if places else len(time)  # the first departure that the next readings do not make good
    if not places or float(np.mean(beyond[place:])) < _LASTS or float(apart[place:].max()) < _LARGE * span:
        return None
    while place > 0 and apart[place - 1] > _BEGINS * error:
        place -= 1  # back to where it begins to depart
    return float(time[max(place - 1, 0)])


def _is_heater(problem: PowerProblem, fit: PowerFit) -> bool:
    """Return whether the power, not the initial state, moves the readings, and leaves a possible room behind."""
    record = problem.readings.temperature_degC
    power = fit.linear[GAIN] * problem.basis(fit.vector)[GAIN]
    noise = float(np.sqrt(np.mean(np.diff(record, 2) ** 2) / 6.0))
    error = float(np.sqrt(np.mean((record - fit.simulated_degC) ** 2)))
    span = float(np.ptp(record))
    return (float(np.ptp(power)) > _BY_POWER * span and error < max(_LOUD * noise, _CLOSE * span)
            and error**2 < (1.0 - _EXPLAINED) * float(np.var(record))
            and _COLDEST < float(fit.linear[AMBIENT]) < float(record.max()))


def _first(readings: Readings, end_s: float) -> Readings:
    rows, edges = readings.time_s <= end_s, readings.edge_s <= end_s
    return replace(
        readings, time_s=readings.time_s[rows], half_s=readings.half_s[rows],
        temperature_degC=readings.temperature_degC[rows], edge_s=readings.edge_s[edges],
        level_pct=readings.level_pct[edges])
