"""Candidate models of a log with power: one lag, two lags, two time constants, an integrator, and alternatives.

An alternative explains drift, load or initial state as a slow response of the heater. The family of plausible heaters
consists of the candidates, the ends of their intervals, and the fits of the two halves of the log.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.log.log_values import Log
from heatertune.model.findings import Finding
from heatertune.model.model_values import Candidate, Fopdt, Half, HeaterModel, HeldOut
from heatertune.model.power.disturbance_fit import bic_of, is_plain_rest, is_sensible, lowest_degC, starts
from heatertune.model.power.feedback import follows_temperature, is_feedback
from heatertune.model.power.fit_checks import unseen
from heatertune.model.power.nonlinear import Bend
from heatertune.model.power.open_loop import PowerFit, PowerProblem
from heatertune.model.power.regressors import AMBIENT, GAP, Readings
from heatertune.model.power.uncertainty import (
    distinct_candidates,
    ends_of,
    fit_at_value,
    halves_of,
    intervals_by,
    parameters_with_ends,
)
from heatertune.model.statistics import RATIO, Interval, envelope, fit_pct, holds

if TYPE_CHECKING:
    from heatertune.model.power.explanation import Explanation

__all__ = [
    "Rival", "candidates_of", "family_of", "lies_inside", "open_ends", "rivals_of", "second_is_seen",
    "starts_alike", "widen_intervals",
]


_SURE = 0.4  # of the cross-validation error: drift and loads must reduce it to this in an open loop
_NEAR = 10.0  # BIC points
_TRIALS = 6  # of dead times between the best and the longest that may be
_WAYS = 4  # gaps in which the power changed that are tried one by one
_POOR = 60.0  # fit [%] below which a model is no rival


class Rival(NamedTuple):
    """An alternative one-lag fit, its difference, and a sentence about it.

    If `shifted`, the power itself is different: the ends in between are not heaters of the log as read. If `of_start`,
    it begins from rest, or not, other than the working model.
    """

    problem: PowerProblem
    fit: PowerFit
    model: Fopdt
    law: str
    sentence: str
    shifted: bool = False
    of_start: bool = False


def rivals_of(
    log: Log, problem: PowerProblem, fit: PowerFit, ci95: Mapping[str, Interval | None], held_out: HeldOut, *,
    open_start: bool,
) -> tuple[Rival, ...]:
    """Return the one-lag fits that the log does not rule out and that lie outside the intervals.

    Args:
        log: the whole log.
        problem: of one lag, with the identified drift and loads.
        fit: its best fit.
        ci95: its intervals.
        held_out: its error in cross-validation.
        open_start: whether the power before the log is unknown.
    """
    rivals = (
        *_without_events(log, problem, fit, held_out), *_at_rest(problem, fit, ci95.get("ambient_degC")),
        *_other_rest(log, problem, fit), *(_other_start(problem, fit) if open_start else ()),
    )
    record = problem.readings.temperature_degC
    return tuple(
        rival for rival in rivals
        if fit_pct(record, rival.fit.simulated_degC) > _POOR and not lies_inside(rival.model, ci95)
    ) + tuple(_other_edges(log, problem, fit, ci95.get("dead_time_s")))


def widen_intervals(ci95: Mapping[str, Interval], values: Sequence[Mapping[str, float]]) -> dict[str, Interval]:
    """Return the intervals, widened until they hold the rivals too."""
    others = {name: [rival[name] for rival in values if math.isfinite(rival[name])] for name in ci95}
    return {name: envelope(inside, others[name]) if others[name] else inside for name, inside in ci95.items()}


def lies_inside(model: Fopdt, ci95: Mapping[str, Interval | None]) -> bool:
    """Return whether gain and time constant of a model lie in the intervals."""
    inside = ((ci95[name], float(getattr(model, name))) for name in ("gain_degC_per_pct", "time_constant_s"))
    return all(interval is not None and holds(interval, value) for interval, value in inside)


def _without_events(log: Log, problem: PowerProblem, fit: PowerFit, held_out: HeldOut) -> Iterator[Rival]:
    if not problem.drift and not problem.loads_s:
        return
    plain = replace(problem, drift=False, loads_s=())
    refit = min((plain.fit(), plain.refine(fit.vector[None, :])), key=lambda trial: bic_of(plain, trial))
    closed = is_feedback(log) or follows_temperature(log)
    if refit.model is None or (not closed and held_out.rmse_degC < _SURE * unseen(plain, refit).rmse_degC):
        return
    law = "power logged, without drift and loads"
    if plain.ambient_degC is None and not is_sensible(plain, refit):
        # under feedback a load drives the gain of a fit without it towards nothing, and the ambient to the setpoint
        plain, law = _with_lowest_ambient(plain), f"{law}, ambient at the lowest reading"
        refit = plain.fit()
    if not isinstance(refit.model, Fopdt):
        return
    events = " and ".join(["drift"] * problem.drift + ["load steps"] * bool(problem.loads_s))
    answers = ", and in a closed loop the power answers them" if closed else ""
    yield Rival(plain, refit, refit.model, law, (
        f"With {events} fitted, {_heater(fit.model)}; without, {_heater(refit.model)}. They can absorb a slow response "
        f"of the heater{answers}. The log does not decide, so both are candidates and the intervals contain both."
    ))


def _at_rest(problem: PowerProblem, fit: PowerFit, ambient: Interval | None) -> Iterator[Rival]:
    """Return the fit with the ambient at the lowest reading, where a free one lies above it for sure."""
    lowest = lowest_degC(problem)
    if ambient is None or ambient.low is None or ambient.low <= lowest or is_sensible(problem, fit):
        return
    variant = _with_lowest_ambient(problem)
    refit = min((variant.fit(), variant.refine(fit.vector[None, :])), key=lambda trial: bic_of(variant, trial))
    if not isinstance(refit.model, Fopdt):
        return
    yield Rival(variant, refit, refit.model, "power logged, ambient at the lowest reading", (
        f"Left free, the ambient comes out at {fit.linear[AMBIENT]:.3g} °C, above the lowest reading of "
        f"{lowest:.3g} °C, though no heater is colder than its room: a slow part of the heater passes for its initial "
        f"state. With the ambient at that reading {_heater(refit.model)}; both are candidates, the intervals hold "
        "both, and --ambient would settle it."
    ))


def _other_start(problem: PowerProblem, fit: PowerFit) -> Iterator[Rival]:
    """Return the fit with the alternative power before the log, zero or the first one, if it is nearly as good."""
    first = float(problem.readings.level_pct[0])
    if first == 0.0:
        return
    other = replace(problem, power_before_pct=0.0 if problem.power_before_pct is None else None)
    refit = min((other.fit(), other.refine(fit.vector[None, :])), key=lambda trial: bic_of(other, trial))
    if not isinstance(refit.model, Fopdt) or bic_of(other, refit) > bic_of(problem, fit) + _NEAR:
        return
    yield Rival(other, refit, refit.model, f"power logged, {other.power_before:g} % before it", (
        f"With {problem.power_before:g} % power before the log, {_heater(fit.model)}; with {other.power_before:g} %, "
        f"{_heater(refit.model)}. The log does not decide, so both are candidates and the intervals contain both; "
        "--power-before would settle it."
    ))


def _other_rest(log: Log, problem: PowerProblem, fit: PowerFit) -> Iterator[Rival]:
    """Return the fit from rest, or not from rest, where it is nearly as good and the readings do not settle it."""
    if problem.at_rest and is_plain_rest(problem, math.exp(float(fit.vector[0]))):
        return
    closed = is_feedback(log) or follows_temperature(log)
    for other in starts(replace(problem, at_rest=False), closed_loop=closed):
        if other.at_rest == problem.at_rest or other.power_before_pct != problem.power_before_pct:
            continue
        refit = min((other.fit(), other.refine(fit.vector[None, :])), key=lambda trial: bic_of(other, trial))
        if isinstance(refit.model, Fopdt) and bic_of(other, refit) < bic_of(problem, fit) + _NEAR:
            start_texts = ("not from rest", "from rest")
            yield Rival(other, refit, refit.model, f"power logged, {start_texts[other.at_rest]}", (
                f"With a start {start_texts[problem.at_rest]}, {_heater(fit.model)}; {start_texts[other.at_rest]}, "
                f"{_heater(refit.model)}. The readings before the first step do not decide, so both are candidates and "
                "the intervals contain both; log more readings before the first step."
            ), of_start=True)


def starts_alike(problem: PowerProblem, fit: PowerFit, start: Rival, ci95: Mapping[str, Interval]) -> bool:
    """Return whether two lags with another start explain the log worse, or by a heater within the intervals.

    Args:
        problem: of two lags.
        fit: of them.
        start: a rival of one lag that begins otherwise.
        ci95: of two lags by the half rule.
    """
    other = replace(start.problem, two_lags=True)
    refit = min((other.fit(), other.refine(fit.vector[None, :])), key=lambda trial: bic_of(other, trial))
    return (refit.model is None or bic_of(other, refit) > bic_of(problem, fit) + _NEAR
            or lies_inside(refit.model.half_rule(), ci95))


def _other_edges(log: Log, problem: PowerProblem, fit: PowerFit, dead: Interval | None) -> Iterator[Rival]:
    """Return the fits with power changes at the start of gaps rather than at their end, if nearly as good.

    The instant of the change is unknown, so the dead time may be longer by up to the gap: the longest that fits is
    used.
    """
    step, at_reading = np.diff(log.time_s), np.isin(log.time_s[1:], log.signals["power"].changes[0][1:])
    places = 1 + np.flatnonzero((step > GAP * np.median(step)) & at_reading)
    ways = [places, *(places[i : i + 1] for i in range(len(places)))] if len(places) > 1 else [places]
    late_s = float(fit.vector[1]) if dead is None or dead.high is None else dead.high
    for way in ways[: _WAYS + 1] if len(places) else ():
        other, gap_s = replace(problem, readings=_earlier(problem.readings, log.time_s, way)), step[way - 1].max()
        most_s = min(late_s + float(gap_s), float(other.high[1]))
        starts = np.array([[fit.vector[0], shift, fit.vector[2]] for shift in (fit.vector[1], 0.5 * most_s, most_s)])
        best = min((other.fit(), other.refine(starts)), key=lambda trial: bic_of(other, trial))
        if bic_of(other, best) > bic_of(problem, fit) + _NEAR:
            continue
        at = _latest(other, best, most_s)
        if isinstance(at.model, Fopdt):
            times = ", ".join(f"{t:.6g}" for t in log.time_s[way])
            law = "power logged, changed as gaps began" + ("" if way is places else f" (before {times} s)")
            yield Rival(other, at, at.model, law, (
                f"The power changed in a gap of the log, before {times} s. If it changed at the end of the gap, the "
                f"dead time is {fit.vector[1]:.3g} s; if at its beginning, up to {at.model.dead_time_s:.3g} s. Both "
                "are candidates; log a step of the power without a gap."
            ), shifted=True)


def _latest(problem: PowerProblem, best: PowerFit, most_s: float) -> PowerFit:
    """Return the fit with the longest dead time, up to the most, that is nearly as good as the best."""
    limit = bic_of(problem, best) + _NEAR
    early_s, late_s, trial_s, latest = float(best.vector[1]), most_s, most_s, best
    for _ in range(_TRIALS):
        there = fit_at_value(problem, best, "dead_time_s", trial_s)
        if there.model is not None and bic_of(problem, there) < limit:
            early_s, latest = trial_s, there
        else:
            late_s = trial_s
        trial_s = 0.5 * (early_s + late_s)
    return latest


def _earlier(readings: Readings, time_s: Array, places: npt.NDArray[np.intp]) -> Readings:
    """Return the readings with the edges at these places of the log just after the reading before."""
    before = dict(zip(time_s[places], time_s[places - 1] + 1e-9 * (time_s[places] - time_s[places - 1]), strict=True))
    return replace(readings, edge_s=np.array([before.get(edge, edge) for edge in readings.edge_s]))


def _with_lowest_ambient(problem: PowerProblem) -> PowerProblem:
    return replace(problem, ambient_degC=lowest_degC(problem))


def _heater(model: object) -> str:
    assert isinstance(model, Fopdt)
    return f"the gain is {model.gain_degC_per_pct:.3g} °C/% and the time constant {model.time_constant_s:.3g} s"


_PLAUSIBLE_HEATERS_NEAR: Final = 10.0  # BIC points


class _Order(NamedTuple):
    """One lag or two: its place in problems and fits, its candidate and its intervals."""

    place: int
    candidate: Candidate
    ci95: Mapping[str, Interval | None]


def family_of(
    explanation: Explanation, candidates: Sequence[Candidate], ci95: Mapping[str, Interval | None],
    halves: tuple[Half, Half] | None, least_dead_time_s: float, wider: Mapping[str, float], seed: int,
    two_lags: Mapping[str, Interval] | None = None,
) -> tuple[tuple[Candidate, ...], tuple[Finding, ...]]:
    """Return all plausible heaters, and the open ends that no heater can represent.

    Args:
        explanation: of the log.
        candidates: the hypotheses that explain it, one lag first.
        ci95: intervals of one lag, gain per time constant and ultimate period among them.
        halves: one lag fitted to each half, None if impossible.
        least_dead_time_s: shortest plausible dead time.
        wider: factors by which the halves widen the intervals, see `parts.widening`; used for two lags too.
        seed: of the bootstrap of two lags.
        two_lags: their intervals, where they take the place of one lag, which is left out with its ends and halves.
    """
    if two_lags is None:
        orders = list(_orders_plausible_heaters(explanation, candidates, ci95, wider, seed))
    else:
        candidates = [each for each in candidates if each.delta_bic < _PLAUSIBLE_HEATERS_NEAR]
        candidates.sort(key=lambda near: near.model != explanation.fits[1].model)
        orders, halves = [_Order(1, candidates[0], two_lags)], None
    ends: list[Candidate] = []
    for order in orders:
        values, fit_with_fixed = parameters_with_ends(explanation.problems[order.place], explanation.fits[order.place])
        ends += ends_of(order.candidate, values, order.ci95, fit_with_fixed, least_dead_time_s=least_dead_time_s)
    parts = () if halves is None else halves_of(explanation.log, halves, law=candidates[0].law)
    return distinct_candidates([*candidates, *ends, *parts], least_dead_time_s), tuple(
        open_ends([("two lags" if order.place else "one lag", order.ci95) for order in orders]))


def _orders_plausible_heaters(
    explanation: Explanation, candidates: Sequence[Candidate], ci95: Mapping[str, Interval | None],
    wider: Mapping[str, float], seed: int,
) -> Iterator[_Order]:
    """Return one lag and two, as far as they explain the log.

    If two lags explain it far better, only the dead time of one lag is kept, because its interval is reported.
    """
    one, *others = candidates
    two = next((other for other in others if len(other.model.lags_s) > 1 and other.law == one.law), None)
    better = two is not None and one.delta_bic >= two.delta_bic + _PLAUSIBLE_HEATERS_NEAR
    yield _Order(0, one, {"dead_time_s": ci95["dead_time_s"]} if better else ci95)
    if two is not None:
        yield _Order(1, two, intervals_by(explanation.problems[1], explanation.fits[1], [wider], seed=seed)[0])


def open_ends(orders: Sequence[tuple[str, Mapping[str, Interval | None]]]) -> Iterator[Finding]:
    """Report open upper ends: the proof does not cover the heaters beyond them.

    `orders`: number of lags in words, and the intervals with it.
    """
    for name, finding, what in (
        ("dead_time_s", "dead-time-open", "dead time has no upper end"),
        (RATIO, "faster-than-log", "gain per time constant has no upper end"),
    ):
        open_ = [lags for lags, ci95 in orders if (end := ci95.get(name)) is not None and end.high is None]
        if open_:
            yield Finding(name=finding, message=f"With {open_[0]}, the {what} within the log.")


class _CandidateTrial(NamedTuple):
    model: HeaterModel
    simulated_degC: Array
    bic: float
    law: str
    left_out: HeldOut | None = None
    is_kept: bool = False


def second_is_seen(two: PowerFit) -> bool:
    """Return whether the second lag exists, that is, is not at its lower bound."""
    return "second_time_constant_s" not in two.on_bound


def candidates_of(
    log: Log, problems: Sequence[PowerProblem], fits: Sequence[PowerFit], *, left_out: HeldOut, open_lag: bool,
    rivals: Sequence[Rival], bend: Bend | None = None,
) -> tuple[Candidate, ...]:
    """Return the one-lag model, its alternatives, and every other model that explains the log nearly as well or better.

    Args:
        log: for its name and times.
        problems: of one lag and of two.
        fits: their best fits.
        left_out: error of one lag on windows left out.
        open_lag: whether the time constant's interval is open upwards.
        rivals: alternatives to keep even if they are far behind.
        bend: nonlinear fit whose ends are kept.
    """
    record = problems[0].readings.temperature_degC
    tried = [*_orders(problems, fits, left_out, open_lag=open_lag)]
    tried += [_CandidateTrial(r.model, r.fit.simulated_degC, bic_of(r.problem, r.fit), r.law, None,
                              True) for r in rivals]
    if bend is not None:
        tried += [_CandidateTrial(end.model, bend.simulated_degC, bend.bic, f"power logged, {end.at}", None, True)
                  for end in dict.fromkeys(bend.ends)]
    least = min(trial.bic for trial in tried)
    return tuple(
        Candidate(
            model=trial.model, log=log.name, window_s=(float(log.time_s[0]), float(log.time_s[-1])), law=trial.law,
            fit_pct=fit_pct(record, trial.simulated_degC),
            rmse_degC=float(np.sqrt(np.mean((record - trial.simulated_degC) ** 2))), delta_bic=trial.bic - least,
            cross_rmse_degC=None if trial.left_out is None else trial.left_out.rmse_degC,
        )
        for trial in tried if trial.is_kept or trial.bic - least < _NEAR
    )


def _orders(
    problems: Sequence[PowerProblem], fits: Sequence[PowerFit], left_out: HeldOut, *, open_lag: bool
) -> list[_CandidateTrial]:
    """Return one lag, two lags if the second exists, and the integrator if the time constant has no upper end."""
    (problem, other), (one, two) = problems, fits
    assert one.model is not None
    tried = [_CandidateTrial(one.model, one.simulated_degC, bic_of(problem, one), "power logged", left_out, True)]
    if second_is_seen(two) and two.model is not None:
        tried.append(_CandidateTrial(two.model, two.simulated_degC, bic_of(other, two), "power logged",
                                     unseen(other, two)))
    if open_lag:
        far = problem.far()
        if far.model is not None:
            law = "power logged, as an integrator"
            tried.append(_CandidateTrial(far.model, far.simulated_degC, bic_of(problem, far), law))
    return tried
