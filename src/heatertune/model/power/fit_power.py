"""The fit of a log with power: one lag as the working model, and beside it whatever else explains the log.

Whether the halves of a log give one heater, and how far its intervals have to be widened until they do.

Noise that a fit sees says how far the halves of a log may lie from the whole. Where a heater is not quite linear or
something else moves the temperature, they lie further, and the whole log's intervals do not hold what the next log
says. They are widened by the Birge ratio (R. T. Birge, "The calculation of errors by the method of least squares",
Phys. Rev. 40 (1932) 207–227): the root mean square of the deviations, each measured by what is expected of it. A half
that knows little is expected to lie far off, and so counts for little.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from statistics import NormalDist
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.model.diagnostics import DROP_PCT, fast_remarks, findings_of, level_remarks, poor_remarks
from heatertune.model.measures import ultimate_period_s
from heatertune.model.power.aliasing import alias_remarks
from heatertune.model.power.alternative_models import Rival, rivals_of, widen_intervals
from heatertune.model.power.candidates import candidates_of, family_of, second_is_seen
from heatertune.model.power.diagnosis import notes_of, share_remarks
from heatertune.model.power.explanation import Explanation
from heatertune.model.power.fit_checks import (
    check_fit,
    correlation_of,
    half_of,
    judgement_remarks,
    plain_halves,
    predicts,
    sides,
)
from heatertune.model.power.nonlinear import Bend, bend_remarks
from heatertune.model.power.open_loop import PowerFit, PowerProblem
from heatertune.model.power.uncertainty import (
    READINGS,
    ParameterNoise,
    bounds_of,
    held_squares,
    intervals_by,
    noise_of,
    value_of,
)
from heatertune.model.statistics import PERIOD, RATIO, Interval, autocorrelation, fit_pct, holds, identified_parts
from heatertune.model.values import FitOutcome, FittedModel, Fopdt, Half, Residuals, Validation
from heatertune.units import NOMENCLATURE

__all__ = [
    "fit_power", "halves_notes", "interval_widening", "outcome_of", "said_by_halves", "values_at_ends", "values_of",
    "weigh_fit", "widening_notes",
]


_TOLD = 1.1  # a smaller factor changes no decision
_TWICE = 2.0  # two halves alone say about this much less than the whole
_MOST = 10.0  # a larger one is rounding: the log holds no noise
_FOUR_OF_FIVE = NormalDist().inv_cdf(0.9) / NormalDist().inv_cdf(0.975)  # of the reach of a 95 % interval
_KNOWS = 5.0  # a half that knows a number within this factor has a say
_NORMAL = NormalDist().inv_cdf(0.975)

Rows = npt.NDArray[np.bool_]


def interval_widening(problem: PowerProblem, fit: PowerFit) -> dict[str, float]:
    """Return for each parameter the factor, 1 to 10, by which its interval has to be widened."""
    thin = problem.average(READINGS)
    refit = thin.refine(fit.vector[None, :])
    noise = noise_of(thin, refit)
    # the ambient of a half is its own: a load that began before is part of it
    values = {name: value_of(refit, name) for name in noise.deviation if name != "ambient_degC"}
    surprises = [_surprises(problem, rows, values, noise) for rows in sides(problem)]
    return {name: _ratio([surprise[name] for surprise in surprises if name in surprise]) for name in values}


def widening_notes(factors: Mapping[str, float]) -> tuple[str, ...]:
    """Tell which intervals were widened."""
    widest = {name: factor for name, factor in factors.items() if factor > _TOLD and name != RATIO}
    if not widest:
        return ()
    listed = ", ".join(f"{NOMENCLATURE[name][1]} {factor:.2g}-fold" for name, factor in widest.items())
    return (f"Intervals were widened, {listed}: the halves of the log differ more than their noise explains.",)


def said_by_halves(
    problem: PowerProblem, fit: PowerFit, validation: Validation, ci95: Mapping[str, Interval]
) -> tuple[Mapping[str, float], ...]:
    """Return the values that intervals have to hold where more than noise parts the log from its model.

    These are both ends of what each half of the log says, right four times of five; not a number where it says little.
    """
    halves = *(validation.halves or ()), *plain_halves(problem, fit, validation.halves)
    correlation = validation.input_correlation
    if (correlation is None or correlation.ok) and all(
            holds(ci95[name], value) for half in halves for name, value in half.values.items()):
        return ()
    bounds, silent = bounds_of(problem), dict.fromkeys(ci95, math.nan)
    return tuple(
        silent | {name: float(np.clip(_said(half, name, sign), *bounds[name])) for name in half.values}
        for half in halves for sign in (-1.0, 1.0))


def _said(half: Half, name: str, sign: float) -> float:
    """Return an end; of gain and time constant on a logarithmic scale: known badly, they are not known as zero."""
    value, high = half.values[name], half.ci95[name].high
    if high is None:
        return math.nan
    reach = sign * _FOUR_OF_FIVE * (high - value)
    if name == "dead_time_s":
        return value + reach
    return value * math.exp(reach / value) if high - value < math.log(_KNOWS) * value else math.nan


def halves_notes(before: Mapping[str, Interval], after: Mapping[str, Interval | None]) -> Iterator[str]:
    """Tell which intervals had to be widened to hold what each half of the log says alone."""
    widest = [NOMENCLATURE[name][1] for name, end in before.items()
              if (held := after.get(name)) is not None and _width(held) > _TWICE * _width(end)]
    if widest:
        yield f"Intervals hold what each half of the log says alone, and are wider for it: {', '.join(widest)}."


def _width(interval: Interval) -> float:
    return math.inf if interval.low is None or interval.high is None else interval.high - interval.low


def _ratio(squares: list[float]) -> float:
    return float(np.clip(np.sqrt(np.mean(squares)), 1.0, _MOST)) if squares else 1.0


def _surprises(problem: PowerProblem, rows: Rows, values: Mapping[str, float], whole: ParameterNoise) -> dict[str,
                                                                                                              float]:
    """Return how far the whole log's values lie from those of a half, squared, 1 on average where noise is all.

    The distance is the rise of the half's sum of squares, so that a half that hardly bounds a value is not surprised.
    """
    part = half_of(problem, rows)
    fit = None if part is None else part.fit()
    if part is None or fit is None or fit.model is None:
        return {}
    noise = noise_of(part, fit)
    least = float(np.sum((part.readings.temperature_degC - fit.simulated_degC) ** 2))
    normal = (_NORMAL / noise.quantile) ** 2  # a short half does not know its noise well
    surprises = {}
    for name in set(values) & set(noise.deviation):
        scale, deviation = noise.inflation[name] * noise.variance, noise.deviation[name]
        if scale > 0.0:
            apart = (float(held_squares(part, fit, name, np.array([values[name]]))[0]) - least) / scale
            if not np.isfinite(apart):  # no model of the half has that value
                apart = ((values[name] - value_of(fit, name)) / deviation) ** 2
            surprises[name] = max(apart, 0.0) * normal * _expected(deviation, whole.deviation[name])
    return surprises


def _expected(half: float, whole: float) -> float:
    """Return the variance of a half's value by that of its distance from the whole log's, in which it has its share.

    A half that knows more than the whole log is measured by the whole: its interval is the one to be widened.
    """
    return half**2 / max(half**2 - whole**2, whole**2)


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
