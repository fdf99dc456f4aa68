"""A heater that stops answering: a fuse, a contactor or a wire opens within the log, and the power goes on."""

from __future__ import annotations

from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.errors import InputError
from heatertune.log.values import MIN_SAMPLES, Log
from heatertune.model.power.log_arrays import Readings
from heatertune.model.power.open_loop import PowerFit, PowerProblem

__all__ = ["opened_at_s", "refuse_opened"]

Array = npt.NDArray[np.float64]

_READINGS: Final = 300  # averaged
_PREFIXES: Final = np.linspace(0.2, 0.95, 16)  # of the log
_INSTANTS: Final = 60
_EXPLAINED: Final = 0.98  # share of the variance, before the instant and over the whole log
_WITHOUT: Final = 0.1  # of the squares that the power as logged leaves after the instant
_BETTER: Final = 0.25  # of the squares that a heater leaves which answers all the time
_ON: Final = 0.1  # of the highest power: less was no power to answer to
_FEWEST: Final = 10  # readings after the instant
_GIVES_WAY: Final = 0.1  # of the span, that the temperature falls after it


class _Opened(NamedTuple):
    """An instant at which the power ends to act, and the sum of squares that it leaves over the whole log."""

    instant_s: float
    squares: float


def refuse_opened(log: Log, problem: PowerProblem) -> None:
    """Refuse a log whose heater stops answering, with the instant.

    Args:
        log: for its name.
        problem: of one lag.

    Raises:
        InputError: it does, see `opened_at_s`.
    """
    instant_s = opened_at_s(problem)
    if instant_s is not None:
        raise InputError(
            f"{log.name}: the heater stops answering at t={instant_s:.4g} s: the power goes on, and the temperature "
            "falls as without it (a fuse, a contactor, a thermal cut-out, a wire?); cut the log there: "
            f"--until {instant_s:.4g}")


def opened_at_s(problem: PowerProblem) -> float | None:
    """Return when the heater stops answering for good [s]; None where it does not.

    A heater is fitted to the beginning of the log. It stopped where it goes on to explain the log, once no power
    reaches it, and leaves ten times as much with the power as it was logged.

    Args:
        problem: of one lag.
    """
    readings = replace(problem.readings, restart_s=np.empty(0))  # a heater that stops answering passes for a jump
    thin = replace(problem, drift=False, loads_s=(), two_lags=True, readings=readings).average(_READINGS)
    tried = [opened for share in _PREFIXES if (opened := _after(thin, float(share))) is not None]
    best = min(tried, key=lambda opened: opened.squares, default=None)
    if best is None:
        return None
    record = thin.readings.temperature_degC
    always = [problem.fit() for problem in (thin, replace(thin, two_lags=False))]
    least = min((float(np.sum((record - fit.simulated_degC) ** 2)) for fit in always if fit.model), default=np.inf)
    return best.instant_s if best.squares < _BETTER * least else None


def _after(problem: PowerProblem, share: float) -> _Opened | None:
    """Return when a heater that is fitted to the first share of the log stops answering, None where it does not."""
    readings = problem.readings
    time, record = readings.time_s, readings.temperature_degC
    rows = time <= time[0] + share * float(np.ptp(time))
    if np.count_nonzero(rows) < MIN_SAMPLES or np.count_nonzero(~rows) < _FEWEST:
        return None
    begun = replace(problem, readings=_first(readings, rows))
    if float(np.ptp(begun.readings.level_pct)) == 0.0 and problem.power_before_pct is None:
        return None
    fit = begun.fit()
    if fit.model is None or not _explains(begun.readings.temperature_degC, fit.simulated_degC):
        return None
    instants = np.linspace(time[rows][len(time[rows]) // 2], time[-_FEWEST], _INSTANTS)
    squares = [float(np.sum((_without(problem, fit, instant) - record) ** 2)) for instant in instants]
    place = int(np.argmin(squares))
    instant, after = float(instants[place]), time > instants[place]
    cut, kept = _without(problem, fit, instant), np.asarray(fit.linear @ problem.basis(fit.vector))
    plain = float(np.sum((kept[after] - record[after]) ** 2))
    left = float(np.sum((cut[after] - record[after]) ** 2))
    falls = float(np.median(record[after][:3]) - np.median(record[-3:])) > _GIVES_WAY * float(np.ptp(record))
    if left < _WITHOUT * plain and falls and _explains(record[after], cut[after]) and _is_on(readings, instant):
        return _Opened(instant, squares[place])
    return None


def _first(readings: Readings, rows: npt.NDArray[np.bool_]) -> Readings:
    """Return the first of the readings, shape of `rows` (n,), with the edges of the power until then."""
    end = readings.time_s[rows][-1]
    edges = readings.edge_s <= end
    return replace(
        readings, time_s=readings.time_s[rows], half_s=readings.half_s[rows],
        temperature_degC=readings.temperature_degC[rows], edge_s=readings.edge_s[edges],
        level_pct=readings.level_pct[edges])


def _without(problem: PowerProblem, fit: PowerFit, instant_s: float) -> Array:
    """Return the temperature where no power reaches the heater from an instant on, shape (n,) [°C]."""
    readings = problem.readings
    before = readings.edge_s < instant_s
    edges, levels = np.append(readings.edge_s[before], instant_s), np.append(readings.level_pct[before], 0.0)
    return np.asarray(fit.linear @ replace(
        problem, power_before_pct=problem.power_before,
        readings=replace(readings, edge_s=edges, level_pct=levels)).basis(fit.vector))


def _is_on(readings: Readings, instant_s: float) -> bool:
    """Return whether the power goes on after an instant."""
    after = np.interp(readings.time_s, readings.edge_s, np.arange(len(readings.edge_s))).astype(np.intp)
    levels = readings.level_pct[after][readings.time_s > instant_s]
    return float(np.mean(levels)) > _ON * float(readings.level_pct.max())


def _explains(record: Array, simulated: Array) -> bool:
    return float(np.sum((record - simulated) ** 2)) < (1.0 - _EXPLAINED) * float(np.sum((record - record.mean()) ** 2))
