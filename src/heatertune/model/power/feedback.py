"""Detect feedback from the temperature to the logged power, and judge a direct fit to such a log.

The residuals are tested for correlation with past power (L. Ljung, "System Identification", 2nd ed., 1999, section
16.6): a correlation means that the model misses part of the heater. The correlation of two coloured series wanders far
from zero on its own (M. S. Bartlett, "Some aspects of the time-correlation problem in regard to tests of significance",
J. R. Stat. Soc. 98 (1935) 536–543), so both are first filtered by the whitening filter of the residuals (G. E. P. Box,
G. M. Jenkins and G. C. Reinsel, "Time Series Analysis", 3rd ed., 1994, section 11.2). A fit makes its residuals
orthogonal to its own sensitivities, which narrows the correlation of a correct model. The limit is therefore computed
from noise with the colour of the residuals and the same projection.

Also the causality test: sign, order in time, and direction. A log is refused only beyond doubt, that is, if
the other explanation accounts for nearly all of the temperature with a response that nothing cancels. Anything less
certain is a warning, which blocks a PASS.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NoReturn

import numpy as np

from heatertune.arrays import Array
from heatertune.errors import InputError
from heatertune.log.log_values import Log
from heatertune.model.diagnostics import Remark
from heatertune.model.model_values import InputCorrelation
from heatertune.model.power.disturbance_fit import bic_of, with_loads
from heatertune.model.power.open_loop import PowerFit, PowerProblem
from heatertune.model.power.regressors import AMBIENT, GAIN, Readings
from heatertune.model.statistics import ar1_bic, autocorrelation, interruption_note

__all__ = [
    "WRONG_SIGN", "closed_loop", "demand_cause", "explains", "feedback_notes", "follows_temperature",
    "input_correlation", "is_feedback", "loop_remarks",
]


_LAGS = 30
_ORDERS = 8  # of the autoregression that whitens the residuals
_DRAWN = 500
_SURE = 0.95
_NULLED = 0.7  # of the deviation of two unrelated series


def input_correlation(
    readings: Readings, residuals: Array, sensitivities: Array, *, before_pct: float, horizon_s: float, seed: int
) -> InputCorrelation | None:
    """Return the correlation of the residuals with the power, None if the power does not change within the horizon.

    Args:
        readings: with the power's edges.
        residuals: measured − simulated at the readings, shape (n,) [°C].
        sensitivities: derivative of the simulation by each fitted parameter, shape (n, p); p = 0: no fit.
        before_pct: power before the first reading [%].
        horizon_s: longest lag [s].
        seed: of the noise that gives the limit.
    """
    spacing = float(np.median(np.diff(readings.time_s)))
    step = spacing * max(1, round(horizon_s / _LAGS / spacing))
    lags = step * np.arange(1, _LAGS + 1)  # at lag 0 a controller answers the reading, not the heater the power
    power = np.array([_mean_power(readings, lag, before_pct) for lag in lags])
    whitening = _whitening(residuals)
    inputs = _filtered(whitening, power)
    length = np.linalg.norm(inputs, axis=1)
    moved = length > 1e-9 * float(np.max(np.abs(power)) + 1.0) * np.sqrt(inputs.shape[1])
    if not np.any(moved):
        return None
    inputs, lags = inputs[moved] / length[moved, None], lags[moved]

    def correlations(errors: Array) -> Array:
        white = _filtered(whitening, errors)
        return np.asarray(white @ inputs.T / np.linalg.norm(white, axis=1)[:, None])

    noise = _coloured(whitening, np.random.default_rng(seed).normal(size=(_DRAWN, 2 * len(residuals))))
    by_chance = correlations(_projected(noise[:, len(residuals):], sensitivities))
    # a lag at which the fit itself has zeroed the correlation has no information, only rounding
    deviation = np.maximum(np.sqrt(np.mean(by_chance**2, axis=0)), _NULLED / np.sqrt(inputs.shape[1]))
    quantile = float(np.quantile(np.max(np.abs(by_chance) / deviation, axis=1), _SURE))
    observed = correlations(residuals[None, :])[0]
    worst = int(np.argmax(np.abs(observed) / deviation))
    return InputCorrelation(
        largest=float(observed[worst]), at_lag_s=float(lags[worst]), limit=quantile * float(deviation[worst]),
    )


def _mean_power(readings: Readings, lag_s: float, before_pct: float) -> Array:
    """Return the held power, so long before each reading, averaged as the reading is, shape (n,) [%]."""
    edges, levels = readings.edge_s, readings.level_pct
    powers_pct = np.concatenate([[before_pct], levels])
    energy = np.concatenate([[0.0], np.cumsum(levels[:-1] * np.diff(edges))])

    def total(instants: Array) -> Array:
        place = np.searchsorted(edges, instants, side="right")
        edge_index = np.maximum(place - 1, 0)
        return np.asarray(energy[edge_index] + powers_pct[place] * (instants - edges[edge_index]))

    middle, half = readings.time_s - lag_s, readings.half_s
    mean = (total(middle + half) - total(middle - half)) / np.maximum(2.0 * half, 1e-300)
    return np.where(half > 0.0, mean, powers_pct[np.searchsorted(edges, middle, side="right")])


def _whitening(residuals: Array) -> Array:
    """Return 1, −a₁, −a₂, … of the autoregression of the residuals; its order is the one of least BIC.

    The Yule–Walker equations by Levinson's recursion.
    """
    n = len(residuals)
    rho = np.concatenate([[1.0], autocorrelation(residuals, _ORDERS)])
    weights, variance = np.empty(0), 1.0
    best, chosen = 0.0, weights
    for order in range(1, len(rho)):
        last = (rho[order] - weights @ rho[order - 1 : 0 : -1]) / variance
        weights = np.append(weights - last * weights[::-1], last)
        variance *= 1.0 - last**2
        criterion = n * float(np.log(max(variance, 1e-12))) + order * float(np.log(n))
        if criterion < best:
            best, chosen = criterion, weights
    return np.concatenate([[1.0], -chosen])


def _filtered(whitening: Array, rows: Array) -> Array:
    """Return the rows through the filter, without its run-in and without their mean."""
    n = rows.shape[1] - len(whitening) + 1
    white = whitening[-1] * rows[:, :n]
    for k in range(1, len(whitening)):
        white += whitening[-1 - k] * rows[:, k : k + n]
    return np.asarray(white - white.mean(axis=1, keepdims=True))


def _coloured(whitening: Array, rows: Array) -> Array:
    """Return the rows as the autoregression that whitens makes them from white noise; SciPy's lfilter, bit for bit."""
    order = len(whitening) - 1
    columns = np.ascontiguousarray(rows.T)  # all rows take one step together
    owed = np.zeros((order + 1, rows.shape[0]))
    for k in range(len(columns)):
        columns[k] += owed[0]
        owed[:-1] = owed[1:] - whitening[1:, None] * columns[k]
    return np.ascontiguousarray(columns.T)


def _projected(errors: Array, sensitivities: Array) -> Array:
    """Return the residuals of errors (k, n) after a fit with these sensitivities."""
    base, _ = np.linalg.qr(sensitivities)
    return np.asarray(errors - (errors @ base) @ base.T)


#: how a doubt begins that no fit of a heater settles
WRONG_SIGN = "a power of the opposite sign"


_CAUSALITY_READINGS = 500
_CAUSALITY_SURE = 10.0  # BIC points
_BETTER = 0.5  # share of the sum of squares that the opposite sign has to reach: a heater's own fit may be poor
_COLDEST, _HOTTEST = -60.0, 150.0  # of rooms [°C]
_FAR = 1.0  # spans of the readings
_ENDLESS = 0.95  # of the longest dead time searched
_LATE = 0.8  # of the longest dead time searched: an answer as late may be to anything
_SHORT = 3.0  # sampling intervals: no heater's time constant
_CAUSALITY_EXPLAINED = 0.3  # share of the power's moves that the temperature explains in a loop
_USUAL = 0.9
_NEARLY_ALL = 0.9  # share of the temperature changes that the alternative has to explain
_SETTLED = 0.98  # share of the temperature changes from which a heater with its loads is accepted
_CANCELS = 1.5  # spans of the readings: a larger answer is cancelled by something else
_FOLLOWS = 0.5  # share of the temperature changes from which it follows the power
_TIMES = 2  # switchings in each direction that show a controller's law: one may be a step at any temperature
_MOVES = 0.1  # share of the readings at which a controller moves its power


def demand_cause(log: Log, problem: PowerProblem, fit: PowerFit | None) -> str:
    """Refuse a log in which the power cannot be the cause of the temperature; return any doubt about it.

    Args:
        log: for its name and columns.
        problem: of one lag.
        fit: its best fit, None if no positive gain fits at all.

    Raises:
        InputError: the temperature falls as the power rises, moves before it, or does not follow it at all.
    """
    problem = problem.average(_CAUSALITY_READINGS)
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
    """Return whether a heater with the identified loads and drift explains nearly all of the temperature.

    This resolves a doubt about the clock or a poor fit, see `demand_cause`.
    """
    problem = problem.average(_CAUSALITY_READINGS)
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
    return rest[0] < (1.0 - _CAUSALITY_EXPLAINED) * rest[1]


def _heats_on_demand(log: Log) -> bool:
    """Check whether the power rises only at lower temperatures than those at which it falls, time and again.

    A controller that switches so drives a heater: the colder it is the more power, whatever a fit of one lag shows.
    """
    power, y = log.power_pct, log.temperature_degC
    assert power is not None
    move = np.diff(power)
    rises, falls = y[1:][move > 0.0], y[1:][move < 0.0]
    return min(len(rises), len(falls)) >= _TIMES and float(rises.max()) < float(falls.min())


def _cools(problem: PowerProblem, fit: PowerFit, opposite: PowerProblem, second_fit: PowerFit) -> bool:
    """Return whether cooling explains a log better than heating, or as well where heating asks for the absurd."""
    dearer = bic_of(problem, fit) - bic_of(opposite, second_fit)
    if dearer > _CAUSALITY_SURE and opposite.squares(second_fit) < _BETTER * problem.squares(fit):
        return True
    if dearer < -_CAUSALITY_SURE or (dearer <= _CAUSALITY_SURE and not _is_strange(problem, fit)):
        return False
    # a load or drift, in a loop above all, may be all that speaks for the opposite: both may have them
    warming, warm = _eventful(problem, fit)
    cooling, cool = _eventful(opposite, second_fit)
    strange = _is_strange(warming, warm) and not _is_strange(cooling, cool)
    limit = bic_of(cooling, cool) + (-_CAUSALITY_SURE if strange else _CAUSALITY_SURE)
    return bic_of(warming, warm) > limit and all(bic_of(*way) > limit for way in _other_heaters(warming))


def _other_heaters(problem: PowerProblem) -> Iterator[tuple[PowerProblem, PowerFit]]:
    """Return a heater with two lags, and one whose power was logged late."""
    for other in (replace(problem, two_lags=True), _ahead(problem)):
        yield other, other.fit()


def _ahead(problem: PowerProblem) -> PowerProblem:
    return replace(problem, least_dead_time_s=-float(np.ptp(problem.readings.time_s)) / 4.0)


def _eventful(problem: PowerProblem, fit: PowerFit) -> tuple[PowerProblem, PowerFit]:
    """Return problem and fit with the drift or the loads that they ask for."""
    drifting = replace(problem, drift=True)
    drifted = drifting.refine(fit.vector[None, :])
    if bic_of(drifting, drifted) < bic_of(problem, fit) - _CAUSALITY_SURE:
        problem, fit = drifting, drifted
    (problem,), (fit,) = with_loads([problem], [fit])
    return problem, fit


def _is_strange(problem: PowerProblem, fit: PowerFit) -> bool:
    """Return whether the ambient is implausible and beyond what the readings support, or the dead time excessive."""
    ambient, readings = float(fit.linear[AMBIENT]), problem.readings.temperature_degC
    reach = _FAR * float(np.ptp(readings))
    outside = ambient < _COLDEST or ambient > _HOTTEST
    endless = float(fit.vector[1]) >= _ENDLESS * float(problem.high[1])
    return endless or (outside and not float(readings.min()) - reach <= ambient <= float(readings.max()) + reach)


def _unexplained(inputs: Array, output: Array) -> float:
    error = output - inputs @ np.linalg.lstsq(inputs, output, rcond=None)[0]
    return float(error @ error)


def _refuse_sign(log: Log, problem: PowerProblem, fit: PowerFit) -> NoReturn:
    gain, lag = float(fit.linear[GAIN]), float(np.exp(fit.vector[0]))
    fault = f"{log.name}: the temperature falls as the power rises (gain {gain:.2g} °C/%, time constant {lag:.3g} s)"
    if lag < _SHORT * _sample(problem) and follows_temperature(log):
        raise InputError(
            f"{fault}: this is the controller seen backwards, which moves the power as the temperature falls, and no "
            "heater; log a step of the setpoint or an open-loop step of the power"
        )
    full = None if log.taken is None else log.taken.reading.get("power_full_scale")
    turned = "" if full is None else f" for a signal that is off at {full:g} say --power-levels {full:g} 0,"
    raise InputError(f"{fault}: a cooler, or the sensor of another zone;{turned} for a cooler say --cooler")


def _demand_order(log: Log, problem: PowerProblem, fit: PowerFit, moving: float) -> str:
    ahead = _ahead(problem)
    other = ahead.fit()
    shift = -float(other.vector[1])
    if shift <= _sample(problem) or bic_of(ahead, other) >= bic_of(problem, fit) - _CAUSALITY_SURE:
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
    return max(problem.squares(fit) - noise, 0.0)


def _still(problem: PowerProblem) -> PowerProblem:
    return replace(
        problem, sign=0.0, readings=replace(problem.readings, level_pct=np.zeros(len(problem.readings.level_pct))))


def _share(problem: PowerProblem, fit: PowerFit, moving: float) -> float:
    """Return the fraction of the temperature changes that the power explains."""
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
    """Refuse a log whose temperature does not follow the power; return a doubt if it mostly does.

    Args:
        log: for its name.
        problem: of one lag.
        fits: with the power: heaters of one lag and two, and a cooler.
        fit: the heater of one lag, None if there is none.
        share: fraction of the temperature changes that the better heater explains.
    """
    if len(problem.readings.level_pct) == 1:
        return ""  # constant power was accepted because the ambient is known
    still = _still(problem)
    idle = still.fit()
    record = problem.readings.temperature_degC
    bics = [ar1_bic(record - each.simulated_degC, each.unknowns) for each in fits if np.all(np.isfinite(each.linear))]
    limit = min(bics, default=math.inf) + _CAUSALITY_SURE
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
    """Return whether the power has an effect if a load is allowed: a controller's response to a load hides it."""
    if fit is None:
        return False
    (loaded, *_), (refit, *_) = with_loads([problem], [fit])
    if not loaded.loads_s:
        return False
    idle = replace(still, loads_s=loaded.loads_s).fit()
    error = problem.readings.temperature_degC - idle.simulated_degC
    return ar1_bic(error, idle.unknowns - 2) > bic_of(loaded, refit) + _CAUSALITY_SURE


def _sample(problem: PowerProblem) -> float:
    return float(np.median(np.diff(problem.readings.time_s))) / problem.readings.averaged


_EXPLAINED = 0.8  # share of the power's variance that the temperature and its sum explain
_MOVING = 0.2  # share of readings at which a controller's power changes
_SWITCHES = 3  # of a two-level controller, each way
_SCATTER = 0.1  # of the temperature's span, within which a two-level controller switches
_PARTS = 8  # of a log; the loop is sought in each and in all neighbours together
_AT_ONCE = 0.5  # correlation
_READINGS = 50  # of a part
_FEW = 10  # readings with the power between its limits; fewer show no law
_APART = 0.2  # of the span between first and last reading: the loop had to heat up


def loop_remarks(log: Log) -> tuple[Remark, ...]:
    """Return the findings of power from a controller, for the whole log or part of it.

    The fit is the direct method: it takes the power as given. With feedback of noise it is biased to the extent that
    the noise model is wrong (L. Ljung, "System Identification", 2nd ed., 1999, section 13.4).
    """
    window = closed_loop(log)
    if window is None:
        return ()
    start, end = window
    text = f"{log.name}: the power answers the temperature, so the log is of a closed loop and noise is fed back."
    if not is_feedback(log):
        text = f"{log.name}: from {start:.4g} to {end:.4g} s the power answers the temperature, a closed loop in " \
            "which noise and loads reach the power and pull a direct fit; an open-loop step would settle the model."
    elif (change := _excitation(log)) is None:
        text += (" Nothing but noise moves it: the fit may be the controller's inverse; change the setpoint, or add a "
                 "dither to the power, and log again.")
    else:
        text += f" {change} moves it, so a direct fit is in order; what the fit calls noise still biases it."
    return (Remark("closed-loop", text + interruption_note(log)),)


def feedback_notes(log: Log) -> tuple[str, ...]:
    """Return the sentences of `loop_remarks`."""
    return tuple(remark.sentence for remark in loop_remarks(log))


def is_feedback(log: Log) -> bool:
    """Return whether the power follows from the temperature: two-level, or nearly linear in it and its sum."""
    power = log.power_pct
    return power is not None and (_is_two_level(power, log.temperature_degC) or _is_linear(log, power))


def closed_loop(log: Log) -> tuple[float, float] | None:
    """Return start and end of the feedback from temperature to power [s], or None.

    This is the longest window of equal parts of the log, without parts at its ends that show no feedback. Timed pulses
    and sines look like feedback too, so the changes have to follow the readings.
    """
    if log.power_pct is None:
        return None
    n = len(log.time_s)
    ends = np.linspace(0, n, max(min(_PARTS, n // _READINGS), 1) + 1).astype(int)

    def answers(i: int, j: int, *, at_once: bool = False) -> bool:
        if np.ptp(log.temperature_degC[ends[i] : ends[j]]) == 0.0:
            return False
        part = log.window(float(log.time_s[ends[i]]), float(log.time_s[ends[j] - 1]))
        return _answers_at_once(part) and (at_once or is_feedback(part) or follows_temperature(part))

    pairs = [(i, i + size) for size in range(len(ends) - 1, 0, -1) for i in range(len(ends) - size)]
    first, last = next((pair for pair in pairs if answers(*pair)), (0, 0))
    while last - first > 1 and not answers(first, first + 1, at_once=True) and answers(first + 1, last):
        first += 1
    while last - first > 1 and not answers(last - 1, last, at_once=True) and answers(first, last - 1):
        last -= 1
    return None if first == last else (float(log.time_s[ends[first]]), float(log.time_s[ends[last] - 1]))


def _answers_at_once(log: Log) -> bool:
    """Return whether the power changes follow the readings, or have two levels without regular timing."""
    assert log.power_pct is not None
    move = np.diff(log.power_pct)
    if len(np.unique(log.power_pct)) == 2:
        runs = np.diff(np.flatnonzero(move))
        return len(np.unique(runs[::2])) > 1 or len(np.unique(runs[1::2])) > 1
    size = np.abs(move)
    free = (size > 0.0) & (size <= np.quantile(size, _USUAL))  # the largest are a hand's, or a setpoint's
    error = log.temperature_degC if log.setpoint_degC is None else log.temperature_degC - log.setpoint_degC
    moves, changes = move[free], np.diff(error)[free]
    if len(moves) < _FEW or min(float(np.ptp(moves)), float(np.ptp(changes))) == 0.0:
        return False
    return bool(np.corrcoef(moves, changes)[0, 1] < -_AT_ONCE)


def _is_two_level(power: Array, temperature: Array) -> bool:
    """Return whether the power is switched on at one temperature and off at a higher one, always the same."""
    if len(np.unique(power)) != 2:
        return False
    change = np.diff(power)
    on, off = temperature[1:][change > 0.0], temperature[1:][change < 0.0]
    if min(len(on), len(off)) < _SWITCHES:
        return False
    same = max(float(np.ptp(on)), float(np.ptp(off))) < _SCATTER * float(np.ptp(temperature))
    return same and float(np.max(on)) <= float(np.min(off))


def _is_linear(log: Log, power: Array) -> bool:
    inside = (power > 0.0) & (power < 100.0)
    moving = np.count_nonzero(np.diff(power[inside]))
    if np.count_nonzero(inside) < _FEW or moving < _MOVING * np.count_nonzero(inside):
        return False
    error = log.temperature_degC if log.setpoint_degC is None else log.temperature_degC - log.setpoint_degC
    total = np.cumsum(error - error.mean()) * np.gradient(log.time_s)
    rows = np.column_stack([np.ones(len(power)), error, total])[inside]
    weights, *_ = np.linalg.lstsq(rows, power[inside], rcond=None)
    left = power[inside] - rows @ weights
    return bool(weights[1] < 0.0 and left.var() < (1.0 - _EXPLAINED) * power[inside].var())


def _excitation(log: Log) -> str | None:
    """Return the external excitation of the loop."""
    if log.setpoint_degC is not None and float(np.ptp(log.setpoint_degC)) > 0.0:
        return "The setpoint changes; that"
    start, end = float(log.temperature_degC[0]), float(np.median(log.temperature_degC[-10:]))
    spread = float(np.ptp(log.temperature_degC))
    power = log.power_pct
    assert power is not None
    limited = np.mean((power == 0.0) | (power == 100.0))
    if abs(end - start) > _APART * spread and limited > 0.0:
        return "The heat-up to the setpoint"
    return None
