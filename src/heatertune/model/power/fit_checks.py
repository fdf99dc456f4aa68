"""The checks of a fit with power, and what they say in plain words."""

from __future__ import annotations

import math
from collections.abc import Iterator

from heatertune.log.values import Log
from heatertune.model.check_results import HeldOut, InputCorrelation, Validation, disagreeing_parameters
from heatertune.model.diagnostics import DROP_PCT, Remark
from heatertune.model.intervals import identified_parts
from heatertune.model.power.causality import follows_temperature
from heatertune.model.power.cross_validation import halves, held_out
from heatertune.model.power.feedback import is_feedback
from heatertune.model.power.input_correlation import input_correlation
from heatertune.model.power.open_loop import PowerFit, PowerProblem
from heatertune.model.power.uncertainty import sensitivities
from heatertune.model.statistics import fit_pct
from heatertune.model.validation import ljung_box
from heatertune.units import NOMENCLATURE

__all__ = ["check_fit", "correlation_of", "judgement_remarks", "predicts", "unseen"]

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


def predicts(problem: PowerProblem, fit: PowerFit) -> bool:
    """Return whether a model is worth about as much on windows left out of its fit as on the readings it has seen."""
    seen = fit_pct(problem.readings.temperature_degC, fit.simulated_degC)
    return unseen(problem, fit).fit_pct >= seen - DROP_PCT


def correlation_of(problem: PowerProblem, fit: PowerFit) -> InputCorrelation | None:
    """Return how far what a fit leaves over follows the power, up to one dead time and time constant later."""
    thin, thinned = _thinned(problem, fit)
    readings = thin.readings
    return input_correlation(
        readings, readings.temperature_degC - thinned.simulated_degC, sensitivities(thin, thinned)[0],
        before_pct=thin.power_before, horizon_s=float(fit.vector[1]) + math.exp(float(fit.vector[0])), seed=_SEED,
    )


def unseen(problem: PowerProblem, fit: PowerFit) -> HeldOut:
    """Return what the model is worth on windows left out of the fit."""
    return held_out(*_thinned(problem, fit))


def _thinned(problem: PowerProblem, fit: PowerFit) -> tuple[PowerProblem, PowerFit]:
    thin = problem.average(_READINGS)
    return thin, thin.refine(fit.vector[None, :])


def judgement_remarks(
    log: Log, validation: Validation, fit: float, second: InputCorrelation | None, *, two_lags_predict: bool = False
) -> Iterator[Remark]:
    """Tell what the checks found, and which finding that is; nothing where all hold.

    Args:
        log: for its name and its loop.
        validation: of one lag.
        fit: of one lag on the readings it has seen [%].
        second: the correlation that two lags leave, None where a second is not seen.
        two_lags_predict: whether two lags are a candidate and predict the windows left out of their fit.
    """
    if validation.input_correlation is not None and not validation.input_correlation.ok:
        kept = second is not None and second.ok
        yield Remark("" if kept else "follows-power", _correlation_note(log, validation.input_correlation, second))
    held = validation.held_out
    if held.fit_pct < fit - DROP_PCT:
        worst = max(range(len(held.rmses_degC)), key=lambda i: held.rmses_degC[i])
        start, end = held.windows_s[worst]
        yield Remark("" if two_lags_predict else "not-foretold", (
            f"Windows left out of the fit are predicted to {held.fit_pct:.0f} % only (fit: {fit:.0f} %), worst from "
            f"{start:.4g} to {end:.4g} s: the fit of one part does not hold "
            f"elsewhere{'; two lags predict them' if two_lags_predict else ''}."
        ))
    if validation.halves is not None:
        apart = [name for name in disagreeing_parameters(validation.halves)
                 if all(identified_parts(half.ci95[name]) for half in validation.halves)]
        differing = [f"{NOMENCLATURE[name][1]} {_pair(*(half.values[name] for half in validation.halves))} "
                     f"{NOMENCLATURE[name][2]}" for name in apart]
        if differing:
            yield Remark("halves-disagree", (
                f"The two halves of the log give different heaters, beyond their intervals: {', '.join(differing)}; "
                "the heater is not linear, or something else moved the temperature."
            ))


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
