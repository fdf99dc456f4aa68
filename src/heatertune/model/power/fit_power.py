"""Fit a log with power: one lag as the working model, all alternatives that also explain the log, and the findings.

The noise of a fit predicts how far the two halves of the log may deviate from the whole. If they deviate more (a
nonlinear heater, an unknown effect), intervals are widened by the Birge ratio (R. T. Birge, "The calculation of errors
by the method of least squares", Phys. Rev. 40 (1932) 207–227): the root mean square of the deviations, each divided by
its expected value, so a half with little information counts little.

Loads and a drift can imitate a slow response. If they move the model by as much as the span of the readings, or
counteract every step of the power, the gain that remains for the power can be several times that of the heater.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from statistics import NormalDist
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.log.log_values import Log
from heatertune.model.diagnostics import DROP_PCT, Remark, fast_remarks, findings_of, level_remarks, poor_remarks
from heatertune.model.loss_curve import working_values
from heatertune.model.model_values import (
    Candidate,
    FitOutcome,
    FittedModel,
    Fopdt,
    Half,
    HeaterModel,
    Residuals,
    Validation,
)
from heatertune.model.power.candidates import (
    Rival,
    candidates_of,
    family_of,
    rivals_of,
    second_is_seen,
    starts_alike,
    widen_intervals,
)
from heatertune.model.power.changed_heater import ChangePeriod, load_period
from heatertune.model.power.disturbance_fit import bic_of, edges_of
from heatertune.model.power.explanation import Explanation, alias_remarks
from heatertune.model.power.fit_checks import (
    check_fit,
    checks_in_place,
    correlation_of,
    fit_of_half,
    half_of,
    halves_notes,
    judgement_remarks,
    plain_halves,
    predicts,
    sides,
    widening_notes,
)
from heatertune.model.power.loss_fit import LossFit
from heatertune.model.power.nonlinear import Bend, bend_remarks
from heatertune.model.power.open_loop import PowerFit, PowerProblem
from heatertune.model.power.regressors import COLUMNS, DRIFT, GAIN
from heatertune.model.power.two_scales_fit import TwoScaleFit
from heatertune.model.power.uncertainty import (
    READINGS,
    ParameterNoise,
    bounds_of,
    half_rule_by_draws,
    hull_of_each,
    intervals_by,
    noise_of,
    squares_at,
    value_of,
)
from heatertune.model.reduction import FIELDS, half_rule_intervals, ultimate_period_s
from heatertune.model.statistics import (
    PERIOD,
    RATIO,
    Interval,
    autocorrelation,
    fit_pct,
    hull,
    identified_parts,
    sensor_step,
)

__all__ = [
    "TWO_LAGS_SHOWN", "Contributions", "contributions_of", "fit_extended", "fit_power", "interval_widening",
    "limit_notes", "log_notes", "longest_hold_s", "notes_of", "outcome_of", "rival_notes", "said_by_halves",
    "share_remarks", "values_at_ends", "values_of", "weigh_fit",
]


_LEAST: Final = 2.0 / 3.0  # of the span, that the power has to move the model by
_DRIFT: Final = 1.0 / 3.0  # of the span, that a drift may move it by
_LOADS: Final = 2.0 / 3.0  # of the span, that loads may
_AGAINST: Final = 4.0 / 3.0  # of the span: beyond that, power and loads cancel
_CANCELLED: Final = 3.0  # of the span: beyond that, power and initial states cancel
_OFTEN: Final = 0.75  # of the log, within a time constant of a step
_POWER_SHARE_NEAR: Final = 10.0  # BIC points within which a fit explains the log nearly as well as the best
_ROWS_NEAR: Final = 2.0  # by which the power may be logged late
_SMALL: Final = 0.15  # of the span: loads that move it by less hide little


class Contributions(NamedTuple):
    """Contributions to a fit, by cause: maximum minus minimum over the readings [°C].

    Attributes:
        model: of the whole model.
        power: of the response to the power.
        powered: of the response to the power with the initial states.
        events: of drift and loads together.
        drift: of the drift.
        loads: of the loads.
        start: of the free initial states.
    """

    model: float
    power: float
    powered: float
    events: float
    drift: float
    loads: float
    start: float


def contributions_of(problem: PowerProblem, fit: PowerFit) -> Contributions:
    """Compute how far each cause moves a fit over its readings."""
    parts = fit.linear[:, None] * problem.basis(fit.vector)
    end = COLUMNS + len(problem.loads_s)
    power, drift, loads = parts[GAIN], parts[DRIFT], parts[COLUMNS:end].sum(axis=0)
    start = parts[DRIFT + 1 : COLUMNS].sum(axis=0) + parts[end:].sum(axis=0)
    causes = (parts.sum(axis=0), power, power + start, drift + loads, drift, loads, start)
    return Contributions(*(float(np.ptp(cause)) for cause in causes))


def share_remarks(
    name: str, problems: Sequence[PowerProblem], fits: Sequence[PowerFit], doubt: str = ""
) -> Iterator[Remark]:
    """Yield the finding that the power does not explain a log's temperature, once, for the first fit that shows it.

    A fit that is more than 10 BIC points worse than another is not judged, because it is not a model of the log.

    Args:
        name: of the log.
        problems: of one lag and, where two were tried, of two.
        fits: their best fits.
        doubt: about the power as the cause, see `demand_cause`; it is yielded first.
    """
    if doubt:
        yield Remark("unexplained-by-power", f"{name}: {doubt}")
        return
    judged = [(problem, fit) for problem, fit in zip(problems, fits, strict=True)
              if not problem.two_lags or second_is_seen(fit)]
    least = min((bic_of(*pair) for pair in judged), default=math.inf)
    for problem, fit in judged:
        if bic_of(problem, fit) > least + _POWER_SHARE_NEAR:
            continue
        reason = _reason(contributions_of(problem, fit), problem, fit)
        if reason:
            yield Remark("unexplained-by-power", f"{name}, {'two lags' if problem.two_lags else 'one lag'}: {reason}")
            return


def _reason(moved: Contributions, problem: PowerProblem, fit: PowerFit) -> str:
    """Return why the power does not explain the readings; empty if it does."""
    whole, events = moved.model, _events(problem, fit)
    if moved.power < _LEAST * whole:
        rest = "; ".join([*events, *([f"initial states {moved.start:.3g} °C"] if moved.start > _SMALL * whole else [])])
        return (f"the power explains {moved.power:.3g} °C of the {whole:.3g} °C that the model spans "
                f"({100.0 * moved.power / whole:.0f} %, where two thirds are needed); the rest: {rest or 'nothing'}.")
    cancels = moved.events > _DRIFT * whole and moved.powered > _AGAINST * whole
    if moved.drift > _DRIFT * whole or moved.loads > _LOADS * whole or cancels:
        return (f"drift and loads move the model by {moved.events:.3g} °C and the power by {moved.power:.3g} °C, where "
                f"both together span {whole:.3g} °C ({'; '.join(events)}).")
    if moved.power > _CANCELLED * whole and moved.start > whole:
        return (f"the power moves the model by {moved.power:.3g} °C and its initial state by {moved.start:.3g} °C, "
                f"where both together span {whole:.3g} °C.")
    if moved.loads > _SMALL * whole and _loads_oppose(problem, fit):
        return (f"each load begins within a time constant of a step of the power and acts against it "
                f"({'; '.join(events)}).")
    if moved.loads > _SMALL * whole and _loads_join(problem, fit):
        return f"a load begins with each step of the power ({'; '.join(events)}): which of the two acted is not known."
    return ""


def _events(problem: PowerProblem, fit: PowerFit) -> list[str]:
    """Return drift and loads in a few words each, loads by their steady-state effect."""
    drift = [f"drift {3600.0 * fit.linear[DRIFT]:+.3g} °C/h"] * problem.drift
    return drift + [f"load of {size:+.3g} °C at {instant:.4g} s"
                    for instant, size in zip(problem.loads_s, fit.linear[COLUMNS:], strict=False)]


def _loads_oppose(problem: PowerProblem, fit: PowerFit) -> bool:
    """Return whether every load begins within a time constant of a large step of the power, and against it.

    Where the power moves so often that most instants lie within a time constant of a step, no load is judged so.
    """
    edges, steps = edges_of(problem)
    reach = math.exp(float(fit.vector[0]))
    time = problem.readings.time_s
    if not problem.loads_s or not len(edges) or _covered(edges, reach, time) > _OFTEN:
        return False
    return all(np.any((instant >= edges) & (instant <= edges + reach) & (steps * size * fit.linear[GAIN] < 0.0))
               for instant, size in zip(problem.loads_s, fit.linear[COLUMNS:], strict=False))


def _loads_join(problem: PowerProblem, fit: PowerFit) -> bool:
    """Return whether a load begins near every large step of the power: it may be a part of that step."""
    edges, _ = edges_of(problem)
    reach = _ROWS_NEAR * float(np.median(np.diff(problem.readings.time_s))) + float(fit.vector[1])
    return len(edges) > 0 and all(any(abs(load_s - edge_s) < reach for load_s in problem.loads_s) for edge_s in edges)


def _covered(edges: Array, reach: float, time: Array) -> float:
    """Return the share of the log that lies within a reach after an edge."""
    ends = np.minimum(np.append(edges[1:], time[-1]), edges + reach)
    return float(np.sum(np.maximum(ends - edges, 0.0))) / float(np.ptp(time))


_NEAR = 10.0  # BIC points
_SETTLED = 3.0  # time constants of held power, after which 5 % of a step are left
_NAMED = 5  # instants that are listed


def notes_of(
    log: Log, problem: PowerProblem, fit: PowerFit, ci95: Mapping[str, Interval | None],
    candidates: tuple[Candidate, ...], outliers: npt.NDArray[np.intp],
) -> tuple[str, ...]:
    """Return results, assumptions and unidentified quantities, one sentence each.

    Args:
        log: as it was fitted.
        problem: with the initial state, drift and loads that the log needs.
        fit: of the problem, with a model.
        ci95: parameter → its interval, None if it has none.
        candidates: as `candidates_of` gives them.
        outliers: indices of the replaced readings, shape (k,).
    """
    assert fit.model is not None
    return (
        *log_notes(log, problem, fit, outliers),
        *limit_notes(fit.model, fit.on_bound, ci95, longest_hold_s(log, problem)),
        *rival_notes(log.name, candidates),
    )


def log_notes(log: Log, problem: PowerProblem, fit: PowerFit, outliers: npt.NDArray[np.intp]) -> tuple[str, ...]:
    """Return notes on changes of the readings, and on assumptions and effects besides the heater.

    `outliers`: places of the readings that were put where their neighbours are, shape (k,).
    """
    return (*_readings(log, problem, outliers), *_power_before(log, problem), *_disturbed(log, problem, fit))


def longest_hold_s(log: Log, problem: PowerProblem) -> float:
    """Return the longest time for which the power stays the same [s]."""
    return float(np.max(np.diff([*problem.readings.edge_s, log.time_s[-1]])))


def _readings(log: Log, problem: PowerProblem, outliers: npt.NDArray[np.intp]) -> list[str]:
    notes = []
    step = sensor_step(log.temperature_degC)
    if step is not None:
        notes.append(f"The sensor's readings come in steps of {step:.3g} °C.")
    if len(outliers):
        times = ", ".join(f"{t:g}" for t in log.time_s[outliers[:_NAMED]])
        more = f" and {len(outliers) - _NAMED} more" if len(outliers) > _NAMED else ""
        notes.append(f"Readings far from their neighbours were given no weight: {len(outliers)} (at {times} s{more}).")
    if problem.readings.averaged > 1:
        merged = len(problem.readings.edge_s) <= np.count_nonzero(np.diff(log.signals["power"].values))
        notes.append(
            f"Runs of up to {problem.readings.averaged} readings were averaged for the search, "
            "and the model over the same runs; the power's edges were kept exactly"
            f"{', but for small ones that follow closely, which were averaged' if merged else ''}."
        )
    return notes


def _power_before(log: Log, problem: PowerProblem) -> list[str]:
    notes = []
    if problem.ambient_degC is not None:
        notes.append(f"The ambient temperature of {problem.ambient_degC:g} °C was stated, not fitted.")
    first = log.signals["power"].values[0]
    if problem.at_rest and first != problem.power_before:
        notes.append(
            f"The log begins with {first:g} % power already on; it was taken as {problem.power_before:g} %, and the "
            "heater at rest, before, which explains it better than any other start; --power-before states another."
        )
    elif problem.at_rest:
        pass  # the readings before the first step show it
    elif first > 0.0 and problem.power_before_pct is None:
        notes.append(
            f"The log begins with {first:g} % power already on, and nothing before it: no steady start was assumed, "
            "which can more than double the gain; if you know the power before, give --power-before."
        )
    elif first > 0.0 and problem.power_before_pct == 0.0:
        notes.append(
            f"The log begins with {first:g} % power already on; it was taken as 0 % before (--power-before states "
            "another), and no steady start was assumed, which can more than double the gain."
        )
    return notes


def _disturbed(log: Log, problem: PowerProblem, fit: PowerFit) -> list[str]:
    notes = []
    if problem.drift:
        notes.append(f"The ambient drifts by {3600.0 * fit.linear[DRIFT]:.2g} °C/h; the drift was fitted.")
    for place, size in enumerate(fit.linear[COLUMNS:COLUMNS + len(problem.loads_s)]):
        period = load_period(problem, fit, place)
        notes.append(
            f"At {period.message} an unlogged load, or a change of the heater, begins that "
            f"{'warms' if size > 0 else 'cools'} {log.name} by {abs(size):.2g} °C in the long run; it was fitted "
            f"together with the power{_cut(log, fit.model, period)}."
        )
    return notes


def _cut(log: Log, model: HeaterModel | None, period: ChangePeriod) -> str:
    """Return the option that leaves out a load, for a message, if enough of the log is before it to be fitted."""
    power = log.signals.get("power")
    if power is None or model is None or len(power.changes[0]) < 2:
        return ""
    least_s = power.changes[0][1] + model.dead_time_s + _CUT_TIMES * sum(model.lags_s)
    return f" ({period.option} leaves it out)" if period.until_s > least_s else ""


_CUT_TIMES: Final = 3.0  # time constants after the first step of the power


def limit_notes(
    model: HeaterModel, on_bound: tuple[str, ...], ci95: Mapping[str, Interval | None], longest_s: float
) -> tuple[str, ...]:
    """Return notes on partly identified quantities; `longest_s`: see `longest_hold_s`, of all logs."""
    notes = []
    if not all(identified_parts(ci95[name]) for name in ("gain_degC_per_pct", "time_constant_s")):
        full = 100.0 * model.gain_degC_per_pct / model.lags_s[0]
        reason = (
            "the log never reaches steady state (pulses and truncated tests fix no more)"
            if longest_s < _SETTLED * model.lags_s[0]
            else "what the model leaves over is slow, and passes for gain or ambient"
        )
        notes.append(f"Gain and time constant are known only as a ratio, {full:.2g} °C/s at full power: {reason}.")
    if model.dead_time_s > model.lags_s[0]:
        notes.append(
            f"The dead time of {model.dead_time_s:.3g} s is longer than the time constant of {model.lags_s[0]:.3g} s, "
            "which no heater of fewer than six equal lags in series has: it may as well be a clock of the power that "
            "runs ahead of the temperature's, which looks the same; compare the two at one switching of the heater."
        )
    if on_bound:
        notes.append(f"On a bound of the search: {', '.join(on_bound)}.")
    return tuple(notes)


def rival_notes(name: str, candidates: Sequence[Candidate]) -> tuple[str, ...]:
    """Return which other models explain the log, or logs, of this name; the first candidate is of one lag."""
    notes = []
    better = candidates[0].delta_bic
    two = next((c.model for c in candidates if len(c.model.lags_s) > 1 and c.law.endswith("logged")), None)
    if two is not None and better > _NEAR:
        notes.append(
            f"Two lags ({two.lags_s[0]:.3g} s, {two.lags_s[1]:.3g} s, dead time {two.dead_time_s:.3g} s) explain "
            f"{name} better than one (BIC {better:.0f} points): tuning and proof run on both."
        )
    faces = [c for c in candidates if c.law.endswith(("heating", "cooling"))]
    if faces and better > _NEAR:
        notes.append(
            f"{name} warms with a time constant of {faces[0].model.time_constant_s:.3g} s and cools with "
            f"{faces[1].model.time_constant_s:.3g} s: tuning and proof run on both."
        )
    if any(c.law.endswith("integrator") for c in candidates):
        notes.append("No curvature is seen: an integrator explains the log as well and is one of the candidates.")
    return tuple(notes)


_MOST = 10.0  # a larger one is rounding: the log holds no noise
_FOUR_OF_FIVE = NormalDist().inv_cdf(0.9) / NormalDist().inv_cdf(0.975)  # of the reach of a 95 % interval
_SURE = 0.5  # of a 95 % limit of noise, beyond it: noise alone exceeds it so far once in 300 times
_KNOWS = 5.0  # a half that knows a number within this factor has a say
_NORMAL = NormalDist().inv_cdf(0.975)

Rows = npt.NDArray[np.bool_]


def interval_widening(problem: PowerProblem, fit: PowerFit) -> dict[str, float]:
    """Return for each parameter the factor, 1 to 10, by which its interval has to be widened."""
    thin = problem.average(READINGS)
    refit = thin.refine(fit.vector[None, :])
    noise = noise_of(thin, refit)
    # each half has its own ambient, which includes a load that began before
    values = {name: value_of(refit, name) for name in noise.deviation if name != "ambient_degC"}
    surprises = [_surprises(problem, fit, rows, values, noise) for rows in sides(problem)]
    return {name: _ratio([surprise[name] for surprise in surprises if name in surprise]) for name in values}


def said_by_halves(
    problem: PowerProblem, fit: PowerFit, validation: Validation, bounds: Mapping[str, tuple[float, float]]
) -> tuple[Mapping[str, float], ...]:
    """Return the values that intervals have to contain if more than noise separates the log from its model.

    They are both ends of the 80 % interval of each half of the log; NaN if a half has little information. What a half
    says counts as far as noise does not explain it: not at all where its own 95 % interval holds the value of the
    whole log, wholly from half as much again on. Without steps between the two, no few rows decide.

    Args:
        problem: of the whole log.
        fit: of it.
        validation: of the fit.
        bounds: number → its bounds.
    """
    halves = *(validation.halves or ()), *plain_halves(problem, fit, validation.halves)
    correlation, silent = validation.input_correlation, dict.fromkeys(bounds, math.nan)
    missed = 0.0 if correlation is None else _beyond_noise(abs(correlation.largest), correlation.limit)
    return tuple(
        silent | {name: float(np.clip(_said(half, name, sign, value_of(fit, name), missed), *bounds[name]))
                  for name in half.values}
        for half in halves for sign in (-1.0, 1.0))


def _said(half: Half, name: str, sign: float, whole: float, missed: float) -> float:
    """Return an end, as far as it counts; for gain and time constant on a logarithmic scale, which excludes zero.

    Args:
        half: of the log.
        name: of a number.
        sign: of the end.
        whole: the number on the whole log.
        missed: how much every half counts, 0 to 1, as the residuals follow the power.
    """
    value, high = half.values[name], half.ci95[name].high
    if high is None:
        return math.nan
    reach = sign * _FOUR_OF_FIVE * (high - value)
    counts = max(missed, _beyond_noise(abs(value - whole), high - value))
    if name == "dead_time_s":
        return whole + counts * (value + reach - whole)
    if high - value >= math.log(_KNOWS) * value:
        return math.nan
    return float(whole * (value * math.exp(reach / value) / whole) ** counts)


def _beyond_noise(size: float, limit: float) -> float:
    """Return how much of a size noise does not explain: 0 up to its 95 % limit, 1 from half as much again on."""
    return float(np.clip((size - limit) / (_SURE * limit), 0.0, 1.0)) if limit > 0.0 else float(size > 0.0)


def _ratio(squares: list[float]) -> float:
    return float(np.clip(np.sqrt(np.mean(squares)), 1.0, _MOST)) if squares else 1.0


def _surprises(
    problem: PowerProblem, whole_fit: PowerFit, rows: Rows, values: Mapping[str, float], whole: ParameterNoise
) -> dict[str, float]:
    """Return the squared deviations of the whole log's values from those of a half, 1 on average for pure noise.

    The deviation is the increase of the half's sum of squares, so that a half with little information gives small
    values.
    """
    part = half_of(problem, rows)
    if part is None:
        return {}
    free_fit, near = part.fit(), fit_of_half(part, whole_fit)
    fit = near if free_fit.model is None or bic_of(part, near) < bic_of(part, free_fit) else free_fit
    if fit.model is None:
        return {}
    noise = noise_of(part, fit)
    least = part.squares(fit)
    normal = (_NORMAL / noise.quantile) ** 2  # a short half does not know its noise well
    surprises = {}
    for name in (set(values) & set(noise.deviation)) - noise.unseen:
        scale, deviation = noise.inflation[name] * noise.variance, noise.deviation[name]
        if scale > 0.0:
            its, own = squares_at(part, fit, name, np.array([values[name], value_of(fit, name)])).tolist()
            apart = (its - min(own, its) if name == PERIOD else its - least) / scale  # that search is a coarse one
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
    """Of one lag: intervals, checks, other fits that the log does not rule out, and how far intervals were widened.

    `open_start`: the log begins warm, and the power before it is unknown.
    """

    inside: dict[str, Interval]
    validation: Validation
    rivals: tuple[Rival, ...]
    wider: dict[str, float] | None = None
    open_start: bool = False


_POOR = 60.0  # fit [%] below which no interval means anything


def weigh_fit(explanation: Explanation, *, open_start: bool, seed: int) -> WeighedFit:
    """Assess the one-lag fit; `open_start`: whether the power before the log is unknown."""
    problem, one = explanation.problems[0], explanation.fits[0]
    wider = interval_widening(problem, one)
    narrow, inside = intervals_by(problem, one, [{}, wider], seed=seed)
    validation = check_fit(problem, one)
    rivals = rivals_of(explanation.log, problem, one, narrow, validation.held_out, open_start=open_start)
    return WeighedFit(inside, validation, rivals, wider, open_start and not problem.at_rest)


def fit_power(explanation: Explanation, weight: WeighedFit, *, least_dead_time_s: float, seed: int) -> FittedModel:
    """Return the FOPDT of a log with power, its intervals, and the candidates.

    The candidates are one lag, two lags, separate time constants for heating and cooling, an integrator; a drift of the
    ambient and load steps if the log needs them; the ends of the intervals, and the halves if they disagree.

    Args:
        explanation: of the log.
        weight: assessment of one lag.
        least_dead_time_s: shortest plausible dead time.
        seed: of the bootstrap.
    """
    log, (one, two) = explanation.log, explanation.fits
    inside, validation, rivals, wider, open_start = weight
    read_otherwise = widen_intervals(
        inside, [*(values_of(rival.model) for rival in rivals if not rival.shifted), *values_at_ends(explanation.bend)])
    bounds = bounds_of(explanation.problems[0])
    as_read = widen_intervals(read_otherwise, said_by_halves(explanation.problems[0], one, validation, bounds))
    ci95: dict[str, Interval | None] = {
        **widen_intervals(as_read, [values_of(rival.model) for rival in rivals if rival.shifted])}
    lag = ci95["time_constant_s"]
    assert lag is not None
    candidates = candidates_of(
        log, explanation.problems, explanation.fits, left_out=validation.held_out, open_lag=lag.high is None,
        rivals=rivals, bend=explanation.bend)
    ratio, _ = ci95.pop(RATIO), ci95.pop(PERIOD)
    assert ratio is not None
    best_is_two = any(len(each.model.lags_s) > 1 and each.delta_bic == 0.0 for each in candidates)
    shown = _Shown(0, explanation.model, ci95, validation, (
        *widening_notes(wider or {}), *halves_notes(read_otherwise, as_read), *(rival.sentence for rival in rivals)),
        ratio=ratio)
    is_open = open_start or explanation.has_events or not all(rival.of_start for rival in rivals)
    if not (shown.is_resolved or is_open) and candidates[0].delta_bic > _NEAR and best_is_two and two.model:
        shown = _by_two_lags(explanation, shown, rivals, wider or {}, seed)
    family, open_ = family_of(explanation, candidates, as_read, validation.halves, least_dead_time_s, wider or {}, seed,
                              two_lags=shown.alone)
    problem, best = explanation.problems[shown.place], explanation.fits[shown.place]
    simulated = explanation.at_readings(problem, best)
    fit = fit_pct(explanation.clean_temperature, simulated)
    has_second_lag = second_is_seen(two) and not shown.place
    second = correlation_of(explanation.problems[1], two) if has_second_lag else None
    two_predict = (has_second_lag and validation.held_out.fit_pct < fit - DROP_PCT
                   and best_is_two and predicts(explanation.problems[1], two))
    outcome = outcome_of(max([fit, *(candidate.fit_pct for candidate in candidates)]), resolved=shown.is_resolved)
    least_s = math.exp(explanation.problems[0].low[0])
    checks = [*bend_remarks(explanation.bend),
              *share_remarks(log.name, explanation.problems, explanation.fits, explanation.doubt),
              *(() if shown.place else  # two lags that are shown have passed these checks
                judgement_remarks(log, shown.validation, fit, second, two_lags_predict=two_predict)),
              *alias_remarks(explanation.alias), *fast_remarks(least_s, shown.model.time_constant_s, log.name),
              *level_remarks(log)]
    return FittedModel(
        model=shown.model,
        outcome=outcome,
        method="exact simulation with the logged power, "
        f"{'begun at rest' if problem.at_rest else 'free initial state'}; "
        "intervals: profile likelihood or block bootstrap, whichever reaches further",
        ci95=shown.ci95,
        combinations={} if shown.is_resolved else {RATIO: (values_of(shown.model)[RATIO], shown.ratio)},
        candidates=family,
        fit_pct=fit,
        notes=(*explanation.notes, *notes_of(log, problem, best, shown.ci95, candidates, explanation.outliers),
               *shown.notes, *(remark.sentence for remark in checks)),
        findings=(*findings_of([*poor_remarks(outcome, fit, log.name), *checks]), *open_),
        residuals=Residuals(
            time_s=log.time_s, measured_degC=log.temperature_degC, simulated_degC=simulated,
            autocorrelation=autocorrelation(explanation.clean_temperature - simulated),
        ),
        validation=shown.validation,
    )


TWO_LAGS_SHOWN: Final = (
    "One lag does not identify this heater, and two lags explain it better: the values are those of two lags as one by "
    "the half rule.")


class _Shown(NamedTuple):
    """The working model: its place in problems and fits, its values, intervals and checks, and notes on these.

    `ratio`: interval of gain per time constant; `alone`: those of two lags as fitted, where they take one lag's place.
    """

    place: int
    model: Fopdt
    ci95: dict[str, Interval | None]
    validation: Validation
    notes: tuple[str, ...]
    ratio: Interval
    alone: Mapping[str, Interval] | None = None

    @property
    def is_resolved(self) -> bool:
        return all(identified_parts(self.ci95[name]) for name in ("gain_degC_per_pct", "time_constant_s"))


def _by_two_lags(
    explanation: Explanation, single: _Shown, starts: Sequence[Rival], wider: Mapping[str, float], seed: int
) -> _Shown:
    """Return two lags by the half rule, if they may take one lag's place, see `checks_in_place`; else one lag.

    They have to be the same heater with each start that one lag leaves open. One lag that is refuted keeps its values,
    with intervals that hold those of two lags as well.
    """
    problem, fit = explanation.problems[1], explanation.fits[1]
    assert fit.model is not None
    validation = checks_in_place(problem, fit, (explanation.problems[0], explanation.fits[0]))
    own = interval_widening(problem, fit)
    factors = {name: max(own[name], wider.get(name, 1.0)) for name in own}
    ci95 = intervals_by(problem, fit, [factors], seed=seed)[0]
    shown = hull_of_each(half_rule_intervals(fit.model, ci95), half_rule_by_draws(problem, fit, factors, seed=seed))
    if validation is None or not all(starts_alike(problem, fit, start, shown) for start in starts):
        known = {name: inside for name, inside in single.ci95.items() if inside is not None}
        both = {**single.ci95, **hull_of_each(known, shown)}
        return single._replace(ci95=both, ratio=hull(single.ratio, shown[RATIO]))
    reported = {name: shown.get(name) for name in FIELDS}
    return _Shown(1, fit.model.half_rule(), reported, validation, (TWO_LAGS_SHOWN, *widening_notes(own)), shown[RATIO],
                  alone=ci95)


def fit_extended(logs: Sequence[Explanation], extended: Sequence[LossFit | TwoScaleFit]) -> FittedModel:
    """Return the heater with a loss curve, or of two time scales, that explains logs, and the other plausible ones.

    Args:
        logs: explanation of each.
        extended: such heaters, the best first.
    """
    best, names = extended[0], [each.log.name for each in logs]
    records = [problem.readings.temperature_degC for problem in best.problems]
    record, log = np.concatenate(records), logs[0].log
    window_s = (min(float(each.log.time_s[0]) for each in logs), max(float(each.log.time_s[-1]) for each in logs))
    candidates: list[Candidate] = []
    for fit in extended:
        simulation = np.concatenate(fit.simulations_degC)
        fits_pct = [fit_pct(*pair) for pair in zip(records, fit.simulations_degC, strict=True)]
        candidates += (Candidate(
            model=end.model, log=" + ".join(names), window_s=window_s, law=fit.law,
            fit_pct=fits_pct[0] if len(logs) == 1 else fit_pct(record, simulation),
            rmse_degC=float(np.sqrt(np.mean((record - simulation) ** 2))), delta_bic=fit.bic - best.bic, part=end.part,
            fits_pct=dict(zip(names, fits_pct, strict=True)) if len(logs) > 1 else {}) for end in fit.heaters)
    least_s = math.exp(min(problem.low[0] for problem in best.problems))
    checks = [*(remark for each in logs for remark in alias_remarks(each.alias)),
              *fast_remarks(least_s, best.model.lags_s[0], " and ".join(names))]
    simulated = np.interp(log.time_s, best.problems[0].readings.time_s, best.simulations_degC[0])
    return FittedModel(
        outcome=FitOutcome.IDENTIFIED,
        method=f"{best.method}; intervals: normal equations with the autocorrelation of the residuals",
        candidates=tuple(candidates), fit_pct=candidates[0].fit_pct,
        notes=(*(note for each in logs for note in each.notes), *(fit.sentence for fit in extended),
               *(remark.sentence for remark in checks)),
        findings=findings_of(checks),
        residuals=Residuals(
            time_s=log.time_s, measured_degC=log.temperature_degC, simulated_degC=simulated,
            autocorrelation=autocorrelation(records[0] - best.simulations_degC[0])),
        **working_values(candidates))


def values_at_ends(bend: Bend | None) -> list[dict[str, float]]:
    """Return the values of a bend's ends; a second lag counts by the half rule, an ambient not at all."""
    ends = () if bend is None else bend.ends
    return [values_of(end.model.half_rule()) | {"ambient_degC": math.nan} for end in ends]


def outcome_of(fit: float, *, resolved: bool) -> FitOutcome:
    """Return the outcome of a fit, from its fit [%] and the identified parameters."""
    return FitOutcome.POOR_FIT if fit < _POOR else FitOutcome.IDENTIFIED if resolved else FitOutcome.COMBINATIONS_ONLY


def values_of(model: Fopdt) -> dict[str, float]:
    """Return gain, time constant, dead time, ambient (nan: unknown) and gain per time constant."""
    names = ("gain_degC_per_pct", "time_constant_s", "dead_time_s")
    return {name: float(getattr(model, name)) for name in names} | {
        "ambient_degC": math.nan if model.ambient_degC is None else model.ambient_degC,
        RATIO: model.gain_degC_per_pct / model.time_constant_s,
        PERIOD: ultimate_period_s(model),
    }
