"""Whether the power can have made the temperature: sign, order in time, and which drives which.

A log is refused for what it shows beyond doubt alone: the other explanation has to account for nearly all that the
temperature does, by an answer that nothing cancels. What is less than sure is a doubt, which blocks a PASS.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NoReturn

import numpy as np
import numpy.typing as npt

from heatertune.errors import InputError
from heatertune.log.values import Log
from heatertune.model.power.load_steps import bic_of, with_loads
from heatertune.model.power.open_loop import PowerFit, PowerProblem
from heatertune.model.power.regressors import AMBIENT, GAIN
from heatertune.model.statistics import ar1_bic

__all__ = ["WRONG_SIGN", "demand_cause", "explains", "follows_temperature"]

#: how a doubt begins that no fit of a heater settles
WRONG_SIGN = "a cooler"

Array = npt.NDArray[np.float64]

_READINGS = 500
_SURE = 10.0  # BIC points
_BETTER = 0.5  # share of the sum of squares that the opposite sign has to reach: a heater's own fit may be poor
_COLDEST, _HOTTEST = -60.0, 150.0  # of rooms [°C]
_FAR = 1.0  # spans of the readings
_ENDLESS = 0.95  # of the longest dead time searched
_LATE = 0.8  # of the longest dead time searched: an answer as late may be to anything
_SHORT = 3.0  # sampling intervals: no heater's time constant
_EXPLAINED = 0.3  # share of the power's moves that the temperature explains in a loop
_USUAL = 0.9
_NEARLY_ALL = 0.9  # share of what the temperature does, that an accusation has to explain
_SETTLED = 0.98  # share of what the temperature does, from which on a heater with its loads is believed
_CANCELS = 1.5  # spans of the readings: a larger answer is cancelled by something else
_FOLLOWS = 0.5  # share of what the temperature does, from which on it follows the power
_TIMES = 2  # switchings in each direction that show a controller's law: one may be a step at any temperature
_MOVES = 0.1  # share of the readings at which a controller moves its power


def demand_cause(log: Log, problem: PowerProblem, fit: PowerFit | None) -> str:
    """Refuse a log in which the power cannot be the temperature's cause; return what casts doubt on it, if anything.

    Args:
        log: for its name and columns.
        problem: of one lag.
        fit: its best fit, None where no positive gain fits at all.

    Raises:
        InputError: the temperature falls as the power rises, moves before it, or does not follow it at all.
    """
    problem = problem.average(_READINGS)
    fit = None if fit is None else problem.refine(fit.vector[None, :])
    opposite = replace(problem, sign=-1.0)
    other = opposite.fit()
    two = replace(problem, two_lags=True).fit()
    moving = _moving(problem)
    heaters = [each for each in (fit, two) if each is not None and each.model is not None]
    share = max((_share(problem, each, moving) for each in heaters), default=0.0)
    doubt = _demand_effect(log, problem, [*heaters, other], fit, share)
    if fit is None and not math.isfinite(bic_of(opposite, other)):
        if share < _FOLLOWS:
            raise InputError(f"{log.name}: neither a heater nor a cooler explains the log; is it this heater's power?")
        return doubt or "one lag with a positive gain does not explain the log."
    if fit is None or _cools(problem, fit, opposite, other):
        rivals = [each for each in heaters if not _is_late(problem, each) and "time_constant_s" not in each.on_bound]
        if not _heats_on_demand(log) and _is_plain(opposite, other, moving) and all(
                _lost(opposite, other) < _BETTER * _lost(problem, each) for each in rivals):
            _refuse_sign(log, problem, other)
        if not heaters:
            raise InputError(f"{log.name}: the power does not explain the temperature, which something else moved (a "
                             "load, a drift, a second heater); log steps of the power from rest, each until it rests")
        return doubt or f"{WRONG_SIGN} explains the log as badly: something else than the power moved the temperature."
    return doubt or _demand_order(log, problem, fit, moving)


def explains(problem: PowerProblem, fit: PowerFit) -> bool:
    """Return whether a heater, with the loads and drift that were found, explains nearly all that the temperature does.

    A doubt that another clock or a poor course raised is settled then, see `demand_cause`.
    """
    problem = problem.average(_READINGS)
    return _share(problem, problem.refine(fit.vector[None, :]), _moving(replace(problem, drift=False, loads_s=()))
                  ) > _SETTLED


def follows_temperature(log: Log) -> bool:
    """Return whether the power looks like a controller's answer to the temperature.

    The change of the power between two readings is regressed on the last two temperatures (and setpoints), where
    the power is free to move.
    """
    power, y = log.power_pct, log.temperature_degC
    assert power is not None
    move = np.diff(power)[1:]
    if np.count_nonzero(move) < _MOVES * len(move):
        return False
    inputs = [y[1:-1], y[2:], power[1:-1], np.ones(len(move))]
    if log.setpoint_degC is not None:
        inputs += [log.setpoint_degC[1:-1], log.setpoint_degC[2:]]
    # at a limit the power answers nothing, and the largest moves are the setpoint's
    free = (power[2:] > power.min()) & (power[2:] < power.max()) & (np.abs(move) <= np.quantile(np.abs(move), _USUAL))
    if np.count_nonzero(free) < 4 * len(inputs):
        return False
    rest = [_unexplained(np.array(chosen).T[free], move[free]) for chosen in (inputs, inputs[2:])]
    return rest[0] < (1.0 - _EXPLAINED) * rest[1]


def _heats_on_demand(log: Log) -> bool:
    """Check whether the power rises only at lower temperatures than those at which it falls, time and again.

    A controller that switches so drives a heater: the colder it is the more power, whatever a fit of one lag shows.
    """
    power, y = log.power_pct, log.temperature_degC
    assert power is not None
    move = np.diff(power)
    rises, falls = y[1:][move > 0.0], y[1:][move < 0.0]
    return min(len(rises), len(falls)) >= _TIMES and float(rises.max()) < float(falls.min())


def _cools(problem: PowerProblem, fit: PowerFit, opposite: PowerProblem, other: PowerFit) -> bool:
    """Return whether cooling explains a log better than heating, or as well where heating asks for the absurd."""
    dearer = bic_of(problem, fit) - bic_of(opposite, other)
    if dearer > _SURE and _squares(opposite, other) < _BETTER * _squares(problem, fit):
        return True
    if dearer < -_SURE or (dearer <= _SURE and not _is_strange(problem, fit)):
        return False
    # a load or drift, in a loop above all, may be all that speaks for the opposite: both may have them
    warming, warm = _eventful(problem, fit)
    cooling, cool = _eventful(opposite, other)
    strange = _is_strange(warming, warm) and not _is_strange(cooling, cool)
    limit = bic_of(cooling, cool) + (-_SURE if strange else _SURE)
    return bic_of(warming, warm) > limit and all(bic_of(*way) > limit for way in _other_heaters(warming))


def _other_heaters(problem: PowerProblem) -> Iterator[tuple[PowerProblem, PowerFit]]:
    """Return a heater of two lags, and one whose power was logged late."""
    for other in (replace(problem, two_lags=True), _ahead(problem)):
        yield other, other.fit()


def _ahead(problem: PowerProblem) -> PowerProblem:
    return replace(problem, least_dead_time_s=-float(np.ptp(problem.readings.time_s)) / 4.0)


def _eventful(problem: PowerProblem, fit: PowerFit) -> tuple[PowerProblem, PowerFit]:
    """Return problem and fit with the drift or the loads that they ask for."""
    drifting = replace(problem, drift=True)
    drifted = drifting.refine(fit.vector[None, :])
    if bic_of(drifting, drifted) < bic_of(problem, fit) - _SURE:
        problem, fit = drifting, drifted
    (problem,), (fit,) = with_loads([problem], [fit])
    return problem, fit


def _is_strange(problem: PowerProblem, fit: PowerFit) -> bool:
    """Return whether the ambient is that of no room and beyond what the readings support, or the dead time endless."""
    ambient, readings = float(fit.linear[AMBIENT]), problem.readings.temperature_degC
    reach = _FAR * float(np.ptp(readings))
    outside = ambient < _COLDEST or ambient > _HOTTEST
    endless = float(fit.vector[1]) >= _ENDLESS * float(problem.high[1])
    return endless or (outside and not float(readings.min()) - reach <= ambient <= float(readings.max()) + reach)


def _unexplained(inputs: Array, output: Array) -> float:
    error = output - inputs @ np.linalg.lstsq(inputs, output, rcond=None)[0]
    return float(error @ error)


def _refuse_sign(log: Log, problem: PowerProblem, other: PowerFit) -> NoReturn:
    gain, lag = float(other.linear[GAIN]), float(np.exp(other.vector[0]))
    fault = f"{log.name}: the temperature falls as the power rises (gain {gain:.2g} °C/%, time constant {lag:.3g} s)"
    if lag < _SHORT * _sample(problem) and follows_temperature(log):
        raise InputError(
            f"{fault}: this is the controller seen backwards, which moves the power as the temperature falls, and no "
            "heater; log a step of the setpoint or an open-loop step of the power"
        )
    raise InputError(
        f"{fault}: a cooler, or the sensor of another zone; for a cooler say --cooler"
    )


def _demand_order(log: Log, problem: PowerProblem, fit: PowerFit, moving: float) -> str:
    ahead = _ahead(problem)
    other = ahead.fit()
    shift = -float(other.vector[1])
    if shift <= _sample(problem) or bic_of(ahead, other) >= bic_of(problem, fit) - _SURE:
        return ""
    if not _is_plain(ahead, other, moving):
        return f"a temperature that moves {shift:.3g} s before the power would explain the log better."
    raise InputError(
        f"{log.name}: the temperature moves {shift:.3g} s before the power that makes it: the two columns are in "
        f"different clocks; take at least {shift:.3g} s off the power's time, and know that the dead time "
        "is then what you assume"
    )


def _moving(problem: PowerProblem) -> float:
    """Return the sum of squares that the best decay of the initial state leaves, without any power [°C²]."""
    still = _still(problem)
    return _lost(still, still.fit())


def _lost(problem: PowerProblem, fit: PowerFit) -> float:
    """Return the sum of squares that a fit leaves beyond the noise between neighbours, at least 0 [°C²]."""
    record = problem.readings.temperature_degC
    noise = len(record) * float(np.mean(np.diff(record, 2) ** 2)) / 6.0
    return max(_squares(problem, fit) - noise, 0.0)


def _still(problem: PowerProblem) -> PowerProblem:
    return replace(
        problem, sign=0.0, readings=replace(problem.readings, level_pct=np.zeros(len(problem.readings.level_pct))))


def _share(problem: PowerProblem, fit: PowerFit, moving: float) -> float:
    """Return the share that the power explains of what the temperature does without it."""
    return 1.0 - _lost(problem, fit) / moving if moving > 0.0 else 0.0


def _is_plain(problem: PowerProblem, fit: PowerFit, moving: float) -> bool:
    """Return whether a fit explains nearly all that the temperature does, by an answer that nothing cancels."""
    answer = float(np.ptp(fit.linear[GAIN] * problem.basis(fit.vector)[GAIN]))
    return (_share(problem, fit, moving) > _NEARLY_ALL and not _is_late(problem, fit)
            and answer < _CANCELS * float(np.ptp(problem.readings.temperature_degC)))


def _is_late(problem: PowerProblem, fit: PowerFit) -> bool:
    return float(fit.vector[1]) >= _LATE * float(problem.high[1])


def _demand_effect(
    log: Log, problem: PowerProblem, fits: Sequence[PowerFit], fit: PowerFit | None, share: float
) -> str:
    """Refuse a log whose temperature does not follow the power; return the doubt where much of it does.

    Args:
        log: for its name.
        problem: of one lag.
        fits: with the power: heaters of one lag and two, and a cooler.
        fit: the heater of one lag, None where there is none.
        share: of what the temperature does, that the better heater explains.
    """
    if len(problem.readings.level_pct) == 1:
        return ""  # constant power was accepted because the ambient is known
    still = _still(problem)
    idle = still.fit()
    record = problem.readings.temperature_degC
    bics = [ar1_bic(record - each.simulated_degC, each.unknowns) for each in fits if np.all(np.isfinite(each.linear))]
    limit = min(bics, default=math.inf) + _SURE
    if ar1_bic(record - idle.simulated_degC, idle.unknowns - 2) >= limit or _answers_beside_load(problem, still, fit):
        return ""
    if share > _FOLLOWS:
        return (f"the power explains {100.0 * share:.0f} % of what the temperature does, but not its course from "
                "reading to reading: something else moved it as well.")
    raise InputError(
        f"{log.name}: the temperature does not follow the power within this log: the dead time is longer than the "
        "log, the heater was off, or the sensor sits elsewhere; log until the temperature has answered a step"
    )


def _answers_beside_load(problem: PowerProblem, still: PowerProblem, fit: PowerFit | None) -> bool:
    """Return whether the power is seen once a load is allowed: a controller's answer to one hides its own effect."""
    if fit is None:
        return False
    (loaded, *_), (refit, *_) = with_loads([problem], [fit])
    if not loaded.loads_s:
        return False
    idle = replace(still, loads_s=loaded.loads_s).fit()
    error = problem.readings.temperature_degC - idle.simulated_degC
    return ar1_bic(error, idle.unknowns - 2) > bic_of(loaded, refit) + _SURE


def _sample(problem: PowerProblem) -> float:
    return float(np.median(np.diff(problem.readings.time_s))) / problem.readings.averaged


def _squares(problem: PowerProblem, fit: PowerFit) -> float:
    return float(np.sum((problem.readings.temperature_degC - fit.simulated_degC) ** 2))
