"""The fit of a log with power: one lag as the working model, and beside it whatever else explains the log."""

from __future__ import annotations

import math
from typing import NamedTuple

from heatertune.model.check_results import Validation
from heatertune.model.diagnostics import DROP_PCT, fast_remarks, findings_of, level_remarks, poor_remarks
from heatertune.model.intervals import PERIOD, RATIO, Interval, identified_parts
from heatertune.model.measures import ultimate_period_s
from heatertune.model.power.aliasing import alias_remarks
from heatertune.model.power.alternative_models import Rival, rivals_of, widen_intervals
from heatertune.model.power.candidates import candidates_of, second_is_seen
from heatertune.model.power.diagnosis import notes_of
from heatertune.model.power.explanation import Explanation
from heatertune.model.power.fit_checks import check_fit, correlation_of, judgement_remarks, predicts
from heatertune.model.power.half_logs import halves_notes, interval_widening, said_by_halves, widening_notes
from heatertune.model.power.nonlinear import Bend, bend_remarks
from heatertune.model.power.plausible_heaters import family_of
from heatertune.model.power.power_share import share_remarks
from heatertune.model.power.uncertainty import intervals_by
from heatertune.model.statistics import autocorrelation, fit_pct
from heatertune.model.values import FitOutcome, FittedModel, Fopdt, Residuals

__all__ = ["fit_power", "outcome_of", "values_at_ends", "values_of", "weigh_fit"]


class WeighedFit(NamedTuple):
    """Of one lag: intervals, checks, other fits that the log does not rule out, and how far intervals were widened."""

    inside: dict[str, Interval]
    validation: Validation
    rivals: tuple[Rival, ...]
    wider: dict[str, float] | None = None


_POOR = 60.0  # fit [%] below which no interval means anything


def weigh_fit(explanation: Explanation, *, open_start: bool, seed: int) -> WeighedFit:
    """Return what one lag is worth; `open_start`: nobody knows the power before the log."""
    problem, one = explanation.problems[0], explanation.fits[0]
    wider = interval_widening(problem, one)
    narrow, inside = intervals_by(problem, one, [{}, wider], seed=seed)
    validation = check_fit(problem, one)
    rivals = rivals_of(explanation.log, problem, one, narrow, validation.held_out, open_start=open_start)
    return WeighedFit(inside, validation, rivals, wider)


def fit_power(explanation: Explanation, weight: WeighedFit, *, least_dead_time_s: float, seed: int) -> FittedModel:
    """Return the FOPDT of a log with power, its intervals, and the candidates.

    Beside one lag: two lags, a time constant for heating and one for cooling, an integrator; a drift of the ambient
    and load steps where the log asks for them; the ends of the intervals, and the halves where they disagree.

    Args:
        explanation: what explains the log.
        weight: what one lag is worth.
        least_dead_time_s: no dead time below this is believed.
        seed: of the bootstrap.
    """
    log, (one, two) = explanation.log, explanation.fits
    inside, validation, rivals, wider = weight
    read_otherwise = widen_intervals(
        inside, [*(values_of(rival.model) for rival in rivals if not rival.shifted), *values_at_ends(explanation.bend)])
    as_read = widen_intervals(read_otherwise, said_by_halves(explanation.problems[0], one, validation, read_otherwise))
    ci95: dict[str, Interval | None] = {
        **widen_intervals(as_read, [values_of(rival.model) for rival in rivals if rival.shifted])}
    lag = ci95["time_constant_s"]
    assert lag is not None
    candidates = candidates_of(
        log, explanation.problems, explanation.fits, left_out=validation.held_out, open_lag=lag.high is None,
        rivals=rivals, bend=explanation.bend)
    family, open_ = family_of(explanation, candidates, as_read, validation.halves, least_dead_time_s, wider or {}, seed)
    ratio, _ = ci95.pop(RATIO), ci95.pop(PERIOD)
    assert ratio is not None
    resolved = all(identified_parts(ci95[name]) for name in ("gain_degC_per_pct", "time_constant_s"))
    simulated = explanation.simulated_degC
    fit = fit_pct(explanation.clean_temperature, simulated)
    seen = second_is_seen(two)
    second = correlation_of(explanation.problems[1], two) if seen else None
    two_predict = (seen and validation.held_out.fit_pct < fit - DROP_PCT
                   and any(len(each.model.lags_s) > 1 and each.delta_bic == 0.0 for each in candidates)
                   and predicts(explanation.problems[1], two))
    outcome = outcome_of(max([fit, *(candidate.fit_pct for candidate in candidates)]), resolved=resolved)
    least_s = math.exp(explanation.problems[0].low[0])
    checks = [*bend_remarks(explanation.bend),
              *share_remarks(log.name, explanation.problems, explanation.fits, explanation.doubt),
              *judgement_remarks(log, validation, fit, second, two_lags_predict=two_predict),
              *alias_remarks(explanation.alias), *fast_remarks(least_s, explanation.model.time_constant_s, log.name),
              *level_remarks(log)]
    return FittedModel(
        model=explanation.model,
        outcome=outcome,
        method="exact simulation with the logged power, "
        f"{'begun at rest' if explanation.problems[0].at_rest else 'free initial state'}; "
        "intervals: profile likelihood or block bootstrap, whichever reaches further",
        ci95=ci95,
        combinations={} if resolved else {RATIO: (values_of(explanation.model)[RATIO], ratio)},
        candidates=family,
        fit_pct=fit,
        notes=(*explanation.notes, *notes_of(log, explanation.problems[0], one, ci95, candidates, explanation.outliers),
               *widening_notes(wider or {}), *halves_notes(read_otherwise, as_read),
               *(rival.sentence for rival in rivals), *(remark.sentence for remark in checks)),
        findings=(*findings_of([*poor_remarks(outcome, fit, log.name), *checks]), *open_),
        residuals=Residuals(
            time_s=log.time_s, measured_degC=log.temperature_degC, simulated_degC=simulated,
            autocorrelation=autocorrelation(explanation.clean_temperature - simulated),
        ),
        validation=validation,
    )


def values_at_ends(bend: Bend | None) -> list[dict[str, float]]:
    """Return the values of a bend's ends; a second lag counts by the half rule, an ambient not at all."""
    ends = () if bend is None else bend.ends
    return [values_of(end.model.half_rule()) | {"ambient_degC": math.nan} for end in ends]


def outcome_of(fit: float, *, resolved: bool) -> FitOutcome:
    """Return how a fit ended: by its fit [%] and by whether gain and time constant are known."""
    return FitOutcome.POOR_FIT if fit < _POOR else FitOutcome.IDENTIFIED if resolved else FitOutcome.COMBINATIONS_ONLY


def values_of(model: Fopdt) -> dict[str, float]:
    """Return gain, time constant, dead time, ambient (nan: unknown) and gain per time constant."""
    named = ("gain_degC_per_pct", "time_constant_s", "dead_time_s")
    return {name: float(getattr(model, name)) for name in named} | {
        "ambient_degC": math.nan if model.ambient_degC is None else model.ambient_degC,
        RATIO: model.gain_degC_per_pct / model.time_constant_s,
        PERIOD: ultimate_period_s(model),
    }
