"""The checks of a fit with power, and their messages.

Also cross-validation: prediction of blocks that the fit has not used, and agreement of the two halves of a log, or of
several logs.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from statistics import NormalDist

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.log.log_values import Log
from heatertune.model.diagnostics import DROP_PCT, Remark
from heatertune.model.model_values import Half, HeldOut, InputCorrelation, OneLog, Validation, disagreeing_parameters
from heatertune.model.power.disturbance_fit import is_sensible
from heatertune.model.power.feedback import follows_temperature, input_correlation, is_feedback
from heatertune.model.power.loss_fit import leaves_noise
from heatertune.model.power.open_loop import PowerFit, PowerProblem
from heatertune.model.power.regressors import GAIN
from heatertune.model.power.uncertainty import reaches, sensitivities
from heatertune.model.statistics import RATIO, Interval, fit_pct, identified_parts, ljung_box
from heatertune.units import NOMENCLATURE

__all__ = [
    "Disagreement", "agreement_remarks", "check_fit", "checks_in_place", "correlation_of", "disagreements",
    "fit_of_half", "half_of", "halves", "halves_notes", "held_out", "judgement_remarks", "plain_halves", "predicts",
    "sides", "unseen", "widening_notes",
]


Rows = npt.NDArray[np.bool_]

_WINDOWS = 6  # the first stays in every fit because it defines the initial state
_BEGUN = 5  # readings of a later segment
_AS_WELL = 5.0  # fit [%] that may be lost
_FELT_CORRELATION = 0.1  # of noise with the power: a hundredth of its variance
_TOGETHER = 1.22  # intervals of three parameters at 5 % for all of them together (Bonferroni), of those of each at 5 %
_FELT = 0.02  # of a parameter, between the halves of a log: what is smaller moves no criterion of the loop
_FEWEST = 20  # readings of a half
_CROSS_VALIDATION_READINGS = 250  # averaged, of a half
_LESS = 0.999  # of the squares: a search with one unknown less ended lower, so the other one went astray
_SHOWN = ("gain_degC_per_pct", "time_constant_s", "dead_time_s")


def held_out(problem: PowerProblem, fit: PowerFit) -> HeldOut:
    """Return the prediction error of each window by a fit to all other readings; drift and load instants are kept."""
    time, record = problem.readings.time_s, problem.readings.temperature_degC
    places = [place for window in np.array_split(np.arange(len(time)), _WINDOWS)[1:]
              if len(place := np.setdiff1d(window, _begun(problem)))]
    foretold = np.empty_like(record)
    for place in places:
        training = np.ones(len(time), dtype=np.bool_)
        training[place] = False
        foretold[place] = _foretold(problem, fit, training)[place]
    rows = np.concatenate(places)
    error = foretold - record
    still = np.ptp(record[rows]) == 0.0  # all that moved came before: the error is measured by that
    return HeldOut(
        fit_pct=100.0 * (1.0 - _rms(error[rows]) / float(np.std(record))) if still
        else fit_pct(record[rows], foretold[rows]), rmse_degC=_rms(error[rows]),
        windows_s=tuple((float(time[place[0]]), float(time[place[-1]])) for place in places),
        rmses_degC=tuple(_rms(error[place]) for place in places),
    )


def _begun(problem: PowerProblem) -> npt.NDArray[np.intp]:
    """Return the first readings of the segments, which stay in every fit because they define the initial states."""
    first = np.searchsorted(problem.readings.time_s, problem.readings.restart_s)
    return np.asarray((first[:, None] + np.arange(_BEGUN)).ravel())


def halves(problem: PowerProblem, fit: PowerFit) -> tuple[Half, Half] | None:
    """Return one lag fitted to each half of the time, None if a half gives no heater or has too few readings."""
    first, second = (_half(problem, fit, rows) for rows in sides(problem))
    return None if first is None or second is None else (first, second)


def plain_halves(problem: PowerProblem, fit: PowerFit, with_all: Sequence[Half] | None) -> tuple[Half, ...]:
    """Return the halves that fit as well without the initial state, drift and loads of the whole log."""
    plain = replace(problem, at_rest=False, drift=False, loads_s=())
    if with_all is None or not (problem.at_rest or problem.drift or problem.loads_s):
        return ()
    halves = (_half(plain, fit, rows) for rows in sides(plain))
    return tuple(half for half, other in zip(halves, with_all, strict=True)
                 if half is not None and half.fit_pct > other.fit_pct - _AS_WELL)


def sides(problem: PowerProblem) -> tuple[Rows, Rows]:
    """Return which readings lie in each half of the time."""
    time = problem.readings.time_s
    middle = 0.5 * float(time[0] + time[-1])
    return time <= middle, time > middle


def half_of(problem: PowerProblem, rows: Rows) -> PowerProblem | None:
    """Return the problem on a half of its readings, None if these are too few or all the same."""
    if np.count_nonzero(rows) < _FEWEST:
        return None
    part = _part(problem, rows).average(_CROSS_VALIDATION_READINGS)
    if np.ptp(part.readings.temperature_degC) == 0.0:
        return None
    start, end = float(part.readings.time_s[0]), float(part.readings.time_s[-1])
    # a load that began before is ambient, but for its start, which the free initial state takes
    return replace(part, loads_s=tuple(t for t in problem.loads_s if start < t < end),
                   at_rest=problem.at_rest and bool(rows[0]))


def fit_of_half(part: PowerProblem, whole: PowerFit) -> PowerFit:
    """Return the fit of a half of a log; where its readings leave the sign of the gain to noise, with the log's gain.

    The sum of squares is then nearly the same for every gain, but no heater has one below zero. That is so where the
    power does not change within the half.

    Args:
        part: the half, see `half_of`.
        whole: fit of the log.
    """
    fit = part.refine(whole.vector[None, :])
    gain_fit = part.refine_at_gain(whole.vector, float(whole.linear[GAIN]))
    return gain_fit if fit.model is None or part.squares(gain_fit) < _LESS * part.squares(fit) else fit


def _half(problem: PowerProblem, fit: PowerFit, rows: Rows) -> Half | None:
    part = half_of(problem, rows)
    if part is None:
        return None
    start, end = float(part.readings.time_s[0]), float(part.readings.time_s[-1])
    refit = fit_of_half(part, fit)
    if refit.model is None:
        return None
    values = {name: float(getattr(refit.model, name)) for name in _SHOWN}
    reach = reaches(part, refit)
    ends = {"dead_time_s": float(part.low[1])}
    return Half(
        window_s=(start, end), values=values, ambient_degC=refit.model.ambient_degC,
        fit_pct=fit_pct(part.readings.temperature_degC, refit.simulated_degC),
        rmse_degC=_rms(part.readings.temperature_degC - refit.simulated_degC),
        ci95={name: _around(values[name], reach[name], ends.get(name, 0.0)) for name in _SHOWN},
    )


def _around(value: float, reach: float, least: float) -> Interval:
    low = value - reach
    return Interval(low=low if low > least else None, high=value + reach if math.isfinite(reach) else None)


def _foretold(problem: PowerProblem, fit: PowerFit, rows: Rows) -> Array:
    """Return the temperature at all readings by a fit to those that are kept."""
    refit = _part(problem, rows).refine(fit.vector[None, :])
    return np.asarray(refit.linear @ problem.basis(refit.vector))


def _part(problem: PowerProblem, rows: Rows) -> PowerProblem:
    """Return the problem on some of its readings; the power is known all the time."""
    r = problem.readings
    time = r.time_s[rows]
    return replace(problem, readings=replace(
        r, time_s=time, half_s=r.half_s[rows], temperature_degC=r.temperature_degC[rows],
        restart_s=r.restart_s[(r.restart_s > time[0]) & (r.restart_s <= time[-1])],
    ))


def _rms(error: Array) -> float:
    return float(np.sqrt(np.mean(error**2)))


_READINGS = 500  # averaged
_SEED = 1


def check_fit(problem: PowerProblem, fit: PowerFit) -> Validation:
    """Return the checks of a one-lag fit."""
    return Validation(
        ljung_box=ljung_box(problem.readings.temperature_degC - fit.simulated_degC),
        input_correlation=correlation_of(problem, fit),
        held_out=unseen(problem, fit),
        halves=halves(problem, fit),
    )


def checks_in_place(
    problem: PowerProblem, fit: PowerFit, rival: tuple[PowerProblem, PowerFit]
) -> Validation | None:
    """Return the checks of two lags that may take a rival's place, None if they may not.

    They have to leave noise alone, predict the windows that are left out, pass all checks (at a level that holds for
    all of them together, and but for what is too little to matter), and need no room that is warmer than the log where
    the rival needs none.
    """
    if fit.model is None or not leaves_noise(problem.readings, fit.simulated_degC):
        return None
    validation, found_pct = check_fit(problem, fit), fit_pct(problem.readings.temperature_degC, fit.simulated_degC)
    passes = (not _follows(validation.input_correlation), validation.halves is None or not _differ(validation.halves),
              validation.held_out.fit_pct >= found_pct - DROP_PCT,
              is_sensible(problem, fit) or not is_sensible(*rival))
    return validation if all(passes) else None


def _follows(correlation: InputCorrelation | None) -> bool:
    return correlation is not None and not correlation.ok and abs(correlation.largest) >= _FELT_CORRELATION


def _differ(halves: tuple[Half, Half]) -> bool:
    return any(_are_apart(*(half.values[name] for half in halves))
               for name in disagreeing_parameters(halves, reaches=_TOGETHER))


def predicts(problem: PowerProblem, fit: PowerFit) -> bool:
    """Return whether a model fits omitted windows about as well as the readings used in its fit."""
    own_fit_pct = fit_pct(problem.readings.temperature_degC, fit.simulated_degC)
    return unseen(problem, fit).fit_pct >= own_fit_pct - DROP_PCT


def correlation_of(problem: PowerProblem, fit: PowerFit) -> InputCorrelation | None:
    """Return the correlation of the residuals with the power, up to one dead time plus one time constant later."""
    thin, thinned = _thinned(problem, fit)
    readings = thin.readings
    return input_correlation(
        readings, readings.temperature_degC - thinned.simulated_degC, sensitivities(thin, thinned)[0],
        before_pct=thin.power_before, horizon_s=float(fit.vector[1]) + math.exp(float(fit.vector[0])), seed=_SEED,
    )


def unseen(problem: PowerProblem, fit: PowerFit) -> HeldOut:
    """Return the cross-validation of the model."""
    return held_out(*_thinned(problem, fit))


def _thinned(problem: PowerProblem, fit: PowerFit) -> tuple[PowerProblem, PowerFit]:
    thin = problem.average(_READINGS)
    return thin, thin.refine(fit.vector[None, :])


def judgement_remarks(
    log: Log, validation: Validation, fit: float, second: InputCorrelation | None, *, two_lags_predict: bool = False
) -> Iterator[Remark]:
    """Yield the findings of the checks; empty if all are passed.

    Args:
        log: for its name and its loop.
        validation: of the working model.
        fit: of it on the readings used in the fit [%].
        second: residual correlation of two lags, None where the working model has them or there is no second lag.
        two_lags_predict: whether two lags are a candidate and predict the omitted windows.
    """
    if validation.input_correlation is not None and not validation.input_correlation.ok:
        is_clear = second is not None and second.ok
        yield Remark("" if is_clear else "follows-power", _correlation_note(log, validation.input_correlation, second))
    blocks = validation.held_out
    if blocks.fit_pct < fit - DROP_PCT:
        worst = max(range(len(blocks.rmses_degC)), key=lambda i: blocks.rmses_degC[i])
        start, end = blocks.windows_s[worst]
        yield Remark("" if two_lags_predict else "not-foretold", (
            f"Windows left out of the fit are predicted to {blocks.fit_pct:.0f} % only (fit: {fit:.0f} %), worst from "
            f"{start:.4g} to {end:.4g} s: the fit of one part does not hold "
            f"elsewhere{'; two lags predict them' if two_lags_predict else ''}."
        ))
    if validation.halves is not None:
        apart = [name for name in disagreeing_parameters(validation.halves)
                 if all(identified_parts(half.ci95[name]) for half in validation.halves)
                 and _are_apart(*(half.values[name] for half in validation.halves))]
        differing = [f"{NOMENCLATURE[name][1]} {_pair(*(half.values[name] for half in validation.halves))} "
                     f"{NOMENCLATURE[name][2]}" for name in apart]
        if differing:
            yield Remark("halves-disagree", (
                f"The two halves of the log give different heaters, beyond their intervals: {', '.join(differing)}; "
                "the heater is not linear, or something else moved the temperature."
            ))


def _are_apart(first: float, second: float) -> bool:
    """Return whether they differ so much that the loop feels it; intervals are widened for less."""
    return abs(first - second) > _FELT * max(abs(first), abs(second))


def _pair(first: float, second: float) -> str:
    return f"{first:.3g} and then {second:.3g}"


def _correlation_note(log: Log, correlation: InputCorrelation, second: InputCorrelation | None) -> str:
    sentence = (
        f"What one lag leaves over still follows the power, most after {correlation.at_lag_s:.3g} s (correlation "
        f"{correlation.largest:+.2f}, by chance up to {correlation.limit:.2f}): a second lag or a longer dead time is "
        "missing"
    )
    if second is not None:
        sentence += ("; two lags leave nothing of that" if second.ok else
                     ", and two lags leave some of it: the heater is richer than both")
    if is_feedback(log) or follows_temperature(log):
        sentence += "; or a load or noise was fed back, as in any closed loop"
    return sentence + "."


_SHARED = ("gain_degC_per_pct", "time_constant_s", "dead_time_s", RATIO)


@dataclass(frozen=True, slots=True, kw_only=True)
class Disagreement:
    """A parameter, and the two logs whose values differ most relative to their intervals."""

    parameter: str
    first: OneLog
    second: OneLog


def disagreements(logs: Sequence[OneLog]) -> tuple[Disagreement, ...]:
    """Return the parameters whose values differ significantly between logs (5 % level).

    The variances of independent estimates add up; the 5 % are divided among all pairs and parameters (Bonferroni). An
    interval open towards the other value never disagrees.
    """
    pairs = list(combinations(logs, 2))
    normal = NormalDist()
    wider = normal.inv_cdf(1.0 - 0.025 / (len(_SHARED) * len(pairs))) / normal.inv_cdf(0.975)
    differing = []
    for name in _SHARED:
        apart, (first, second) = max(((_apart(name, *pair), pair) for pair in pairs), key=lambda ranked: ranked[0])
        if apart > wider:
            differing.append(Disagreement(parameter=name, first=first, second=second))
    return tuple(differing)


def _apart(name: str, first: OneLog, second: OneLog) -> float:
    """Return the distance of two values by what their intervals allow; 0 if one is open towards the other."""
    lower, upper = sorted((first, second), key=lambda log: log.values[name])
    high, low = lower.ci95[name].high, upper.ci95[name].low
    if high is None or low is None:
        return 0.0
    reach = math.hypot(high - lower.values[name], upper.values[name] - low)
    return (upper.values[name] - lower.values[name]) / max(reach, 1e-300)


def agreement_remarks(logs: Sequence[OneLog], apart: Sequence[Disagreement]) -> Iterator[Remark]:
    """Report how well one heater fits all logs, and yield a finding if the logs disagree."""
    fits = ", ".join(f"{log.fit_pct:.1f} % of {log.name} ({log.alone_fit_pct:.1f} % alone)" for log in logs)
    yield Remark(
        "", f"One heater for all logs explains {fits}; ambient and residuals shown are those of {logs[0].name}.")
    if not apart:
        yield Remark("", "Alone, the logs give the same heater within their intervals.")
        return
    clashes = "; ".join(
        f"{NOMENCLATURE[clash.parameter][1]} {_value(clash, clash.first)} by {clash.first.name}, "
        f"{_value(clash, clash.second)} by {clash.second.name}"
        for clash in apart
    )
    yield Remark("logs-disagree", (
        f"The logs disagree beyond their intervals: {clashes}; it is not one heater, or it was not used in one way "
        "(load, fan, working point), so the intervals hold what each log says alone, and each log's own heater is a "
        "candidate."
    ))


def _value(clash: Disagreement, log: OneLog) -> str:
    ends = log.ci95[clash.parameter]
    return f"{log.values[clash.parameter]:.3g} {NOMENCLATURE[clash.parameter][2]} [{_end(ends.low)}, {_end(ends.high)}]"


def _end(value: float | None) -> str:
    return "open" if value is None else f"{value:.3g}"


_TOLD = 1.1  # a smaller factor changes no decision
_TWICE = 2.0  # two halves alone say about this much less than the whole


def widening_notes(factors: Mapping[str, float]) -> tuple[str, ...]:
    """Report which intervals were widened."""
    widest = {name: factor for name, factor in factors.items() if factor > _TOLD and name != RATIO}
    if not widest:
        return ()
    listed = ", ".join(f"{NOMENCLATURE[name][1]} {factor:.2g}-fold" for name, factor in widest.items())
    return (f"Intervals were widened, {listed}: the halves of the log differ more than their noise explains.",)


def halves_notes(before: Mapping[str, Interval], after: Mapping[str, Interval | None]) -> Iterator[str]:
    """Report the intervals that were widened to contain the results of each half of the log."""
    widest = [NOMENCLATURE[name][1] for name, end in before.items()
              if (counterpart := after.get(name)) is not None and _width(counterpart) > _TWICE * _width(end)]
    if widest:
        yield f"Intervals hold what each half of the log says alone, and are wider for it: {', '.join(widest)}."


def _width(interval: Interval) -> float:
    return math.inf if interval.low is None or interval.high is None else interval.high - interval.low
