"""Fit logs that contain only the temperature: controller hypotheses compared on the same rows.

Each hypothesis is fitted from random starts (a race, then a descent) and rated by the information criterion. Also the
messages about what such a log does not identify, and the joint candidates of several logs of one heater.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from heatertune.log.log_values import Log
from heatertune.model.diagnostics import DROP_PCT, Remark, findings_of, poor_remarks
from heatertune.model.least_squares import minimise
from heatertune.model.model_values import Candidate, FitOutcome, FittedModel, Residuals
from heatertune.model.reduction import COMBINATIONS, FIELDS, PROPORTIONAL_TO_GAIN
from heatertune.model.statistics import (
    LJUNG_BOX_95,
    Interval,
    autocorrelation,
    block_resamples,
    envelope,
    fit_pct,
    identified_interval,
    interval,
    ljung_box,
)
from heatertune.model.temperature.closed_loop import Bounds, ControllerLaw, Hypothesis, LogSegment
from heatertune.model.temperature.evidence import (
    bound_contradictions,
    contradictions,
    evidence_notes,
    regulation_remarks,
)
from heatertune.model.temperature.hypothesis_fits import EARLY, Fit, constant_rmse, fit_all, residuals_of
from heatertune.model.temperature.rival_fits import extremes, rival_fits
from heatertune.units import NOMENCLATURE

__all__ = [
    "ambient_note", "event_notes", "fit_temperature", "foretelling_remarks", "foretells", "joint_note", "limit_remarks",
    "lost_notes", "room_bounds", "share_remarks", "validation_notes",
]

_LEAST = 2.0 / 3.0  # of the span, that the power has to move the model by
_CANCELLED = 3.0  # of the span: beyond that, power and initial state cancel
_FAR_OUT = 0.2  # of a log's span: a prediction with a larger error is useless


def event_notes(best: Fit) -> Iterable[str]:
    """Report the assumed setpoint steps."""
    for i, segment in enumerate(best.hypothesis.segments):
        if segment.event:
            step = best.hypothesis.controller(best.vector, i)
            yield (
                f"A setpoint step of {step['setpoint_step_degC']:+.1f} °C at {step['setpoint_step_at_s']:.0f} s of "
                f"{segment.log.name} is a hypothesis after the fact, suggested by the log; it was not recorded."
            )


def lost_notes(names: Sequence[str], lost: Iterable[str], ranges: Mapping[str, Interval]) -> Iterable[str]:
    """Report unidentified parameters and their ranges."""
    for name in lost:
        _, title, unit = NOMENCLATURE[name]
        low, high = ("the bound of the search" if end is None else f"{end:.3g} {unit}"
                     for end in (ranges[name].low, ranges[name].high))
        sentence = f"The {title} is not identified: anything from {low} to {high} explains {' and '.join(names)}"
        yield f"{sentence} nearly as well."


def ambient_note(bounds: Bounds | None, sought: Bounds) -> str:
    """Report the source of the ambient temperature."""
    if bounds is None:
        return (f"The ambient was sought within {sought[0]:.1f}…{sought[1]:.1f} °C, around the first reading; give "
                "--ambient LOW HIGH if you know it better.")
    if bounds[0] == bounds[1]:
        return f"The ambient temperature of {bounds[0]:g} °C was given, not fitted."
    return f"The ambient was sought within the given {bounds[0]:g}…{bounds[1]:g} °C."


def foretells(fit: Fit) -> bool:
    """Return whether the hypothesis, fitted to the beginning, foretells the later readings better than their mean."""
    return fit.hold_out_rmse_degC < constant_rmse(fit.hypothesis, fit.hypothesis.early(EARLY))


def foretelling_remarks(best: Fit) -> Iterable[Remark]:
    """Yield the finding that readings left out of the fit, or after its beginning, are badly predicted."""
    hypothesis = best.hypothesis
    names = " and ".join(segment.log.name for segment in hypothesis.segments)
    if best.cross_rmse_degC is not None:
        unseen = 100.0 - (100.0 - best.fit_pct) * best.cross_rmse_degC / max(best.rmse_degC, 1e-12)
        if unseen < best.fit_pct - DROP_PCT:
            yield Remark("not-foretold", (
                f"Blocks of {names} left out of the fit are predicted to {unseen:.0f} % only (fit: "
                f"{best.fit_pct:.0f} %)."))
    span = max(float(np.ptp(segment.log.temperature_degC)) for segment in hypothesis.segments)
    steps = any(segment.event for segment in hypothesis.segments)
    if not steps and not foretells(best) and best.hold_out_rmse_degC > _FAR_OUT * span:
        yield Remark("not-foretold", (
            f"Fitted to the first {EARLY:.0%} of {names}, the model misses the later readings by "
            f"{best.hold_out_rmse_degC:.3g} °C RMS, more than {_FAR_OUT:.0%} of what the log spans."))


def share_remarks(near: Sequence[Fit]) -> Iterable[Remark]:
    """Yield, once for each log, the finding that the power of a law does not explain the temperature.

    The power of the law is compared with the decay of the initial state, as `power_share` does if the power was logged:
    a model that is dominated by its initial state says little about the effect of the power.

    Args:
        near: fits that explain the logs about as well as the best, the best first.
    """
    for i, segment in enumerate(near[0].hypothesis.segments):
        reason = next(filter(None, (_unexplained(fit, i) for fit in near)), "")
        if reason:
            yield Remark("unexplained-by-power", f"{segment.log.name}: {reason}")


def _unexplained(fit: Fit, segment: int) -> str:
    """Return why the power of a law does not explain one log; empty if it does."""
    simulated = fit.hypothesis.parts(fit.simulated_degC)[segment]
    free = fit.hypothesis.free_response(fit.vector, segment)
    whole, power, start = (float(np.ptp(part)) for part in (simulated, simulated - free, free))
    if _LEAST * whole <= power and not (power > _CANCELLED * whole and start > whole):
        return ""
    return (f"with {fit.hypothesis.title}, the power moves the model by {power:.3g} °C and its initial state by "
            f"{start:.3g} °C, where both together span {whole:.3g} °C.")


def limit_remarks(fits: Sequence[Fit]) -> Iterable[Remark]:
    """Yield the finding that parameters of the plausible heaters lie on arbitrary bounds of their search."""
    names = list(dict.fromkeys(name for fit in fits for name in fit.hypothesis.limits_reached(fit.vector)))
    if names:
        logs = " and ".join(segment.log.name for segment in fits[0].hypothesis.segments)
        yield Remark("on-bound", (
            f"On a bound of the search where models explain {logs}: {', '.join(names)}. What lies beyond the bound "
            "would explain it better still."))


def validation_notes(best: Fit, ranked: Sequence[Fit]) -> Iterable[str]:
    """Report the prediction error of the best fit, whether another predicts better, and whether residuals are white."""
    hypothesis = best.hypothesis
    early = hypothesis.early(EARLY)
    ends = " and ".join(f"{segment.log.time_s[-1]:g} s" for segment in early.segments)
    step = "; the setpoint step could not be foreseen" if any(s.event for s in hypothesis.segments) else ""
    verdict = "passes" if foretells(best) else "fails"
    by_mean_degC = constant_rmse(hypothesis, early)
    yield (
        "There are too few rows for a hold-out in time." if math.isnan(by_mean_degC) else
        f"The hold-out in time {verdict}: fitted up to {ends}, the model misses the later readings by "
        f"{best.hold_out_rmse_degC:.2f} °C RMS, their own mean by {by_mean_degC:.2f} °C{step}."
    )
    tried = [fit for fit in ranked if fit.cross_rmse_degC is not None]
    first = min(tried, key=lambda fit: fit.cross_rmse_degC or np.inf, default=best)
    if first is not best and first.cross_rmse_degC is not None and best.cross_rmse_degC is not None:
        yield (
            f"On blocks left out of the fit {first.hypothesis.title} does best ({first.cross_rmse_degC:.2f} °C RMS), "
            f"not {best.hypothesis.title} ({best.cross_rmse_degC:.2f} °C)."
        )
    errors = hypothesis.parts(hypothesis.measured - best.simulated_degC)
    for segment, part in zip(hypothesis.segments, errors, strict=True):
        if (score := ljung_box(part)) > LJUNG_BOX_95:
            yield (
                f"The residuals of {segment.log.name} are not white: Ljung–Box over 20 lags is {score:.0f}, white ones "
                f"stay below {LJUNG_BOX_95:.0f}; so something moves the temperature that the model does not know."
            )


def joint_note(best: Fit, ranked: Sequence[Fit], alone: Sequence[Sequence[Fit]]) -> str:
    """Report how well one heater fits all logs, and the loss compared with a heater for each."""
    hypothesis = best.hypothesis
    simulated = hypothesis.parts(best.simulated_degC)
    fits = ", ".join(
        f"{fit_pct(segment.log.temperature_degC, part):.1f} % of {segment.log.name}"
        for segment, part in zip(hypothesis.segments, simulated, strict=True)
    )
    dearer = ranked[0].bic - sum(fits_alone[0].bic for fits_alone in alone)
    judged = "one heater explains them as well as several" if dearer <= 0.0 else (
        "as numbers go, the logs ask for different heaters, or for something that no hypothesis has")
    side = "above" if dearer > 0.0 else "below"
    return (
        f"One heater for all logs: {fits} explained; {abs(dearer):.0f} BIC points {side} a "
        f"heater for each: {judged}. Curve and residuals are those of {hypothesis.segments[0].log.name}."
    )


_NO_POWER = Remark("no-power", (
    "Neither power nor setpoint was logged: the controller's law is a hypothesis, setpoint and bias show only as their "
    "sum, and the controller's largest output is taken as the heater's full power."
))

_NO_POWER_BUT_SETPOINT = Remark("no-power", (
    "The power was not logged, and the fit does not use the logged setpoint: the controller's law is a hypothesis, "
    "setpoint and bias show only as their sum, and the controller's largest output is taken as the heater's full power."
))

#: measures in the unit of the power
_NEAR = 10.0  # BIC points within which a model explains the log nearly as well
_FOPDT_NEAR = 3.0  # fit [%] within which the best single lag stays a candidate
_POOR = 60.0
_RESAMPLES = 100
_MOST_READINGS = 500
_MOST_LAWS = 4  # of one log, that are tried together with those of another
_AMBIENT_BELOW, _AMBIENT_ABOVE = 8.0, 6.0  # °C around the first reading: a log without power starts near the room's


def fit_temperature(
    logs: Sequence[Log], laws: Sequence[ControllerLaw], *, ambient_degC: Bounds | None, seed: int,
    thorough: bool = False, largest_power_pct: float | None = None,
) -> FittedModel:
    """Return the half-rule FOPDT of the best-fitting hypothesis and every hypothesis that explains the logs as well.

    Hypotheses: each law, one lag and two, with and without one setpoint step. They are ranked by BIC with AR(1) errors
    on identical rows; those within 10 points stay, and the best single lag if its fit is within 3 % of the best.
    Before a time constant or dead time is called identified, `rival_fits` are added.
    Several logs are of one heater: one plant, each log with its own law, setpoint, ambient and initial state; the laws
    tried together are those that explain a log alone.

    Args:
        logs: at least one.
        laws: hypotheses about the controller.
        ambient_degC: bounds of the ambient temperature [°C]; equal if it is known, None: near the first reading.
        seed: of the random starts and the bootstrap.
        thorough: fit every hypothesis of a single log completely, even if it is far behind.
        largest_power_pct: largest power that the heater got in the logs [%]; None: not stated.
    """
    used, notes = _thinned(logs)
    sought = [room_bounds(log) if ambient_degC is None else ambient_degC for log in used]
    singles = [_single(log, laws, bounds, largest_power_pct) for log, bounds in zip(used, sought, strict=True)]
    alone = [fit_all(hypotheses, seed=seed, thorough=thorough and len(used) == 1) for hypotheses in singles]
    ranked = alone[0] if len(used) == 1 else fit_all(_joint(alone, largest_power_pct), seed=seed)
    near_fits = _near_fits(ranked)
    ranges = _ranges(_best(near_fits), near_fits, seed, ambient_degC)
    claimed = _intervals(_best(near_fits), near_fits, ranges, ambient_degC)
    if (claimed["time_constant_s"] or claimed["dead_time_s"]) and any(log.output_limit_pct is None for log in used):
        ranked = ranked if thorough or len(used) > 1 else fit_all(singles[0], seed=seed, thorough=True)
        rivals = rival_fits(ranked, seed)
        ranked = sorted([*ranked, *rivals], key=lambda fit: fit.bic)
        near_fits = _with_rivals(ranked, rivals)
        ranges = _ranges(_best(near_fits), [*near_fits, *rivals], seed, ambient_degC)
    best = _best(near_fits)
    law, against = list(_law_remarks(best, logs)), list(_contradictions(best, near_fits))
    power = [] if law else list(_power_remarks(used, ranges, largest_power_pct))
    ci95 = dict.fromkeys(FIELDS) if law or against else _intervals(best, near_fits, ranges, ambient_degC)
    plant = best.hypothesis.plant(best.vector)
    values = {name: measure(plant) for name, measure in COMBINATIONS.items()}
    notes += (joint_note(best, ranked, alone),) if len(used) > 1 else ()
    near = [best, *(fit for fit in near_fits if fit.bic - ranked[0].bic <= _NEAR and fit is not best)]
    doubts = [*law, *against, *power, *limit_remarks(near_fits), *foretelling_remarks(best), *share_remarks(near)]
    first, simulated = used[0], best.hypothesis.parts(best.simulated_degC)[0]
    outcome = FitOutcome.LAW_UNKNOWN if law else _outcome(best.fit_pct, ci95)
    names = " and ".join(log.name for log in used)
    return FittedModel(
        model=plant.half_rule(),
        outcome=outcome,
        findings=findings_of([_no_power(used), *poor_remarks(outcome, best.fit_pct, names), *doubts]),
        method=_method(best),
        ci95=ci95,
        combinations={} if law else {
            name: (value, ranges[name]) for name, value in values.items() if np.isfinite(value)},
        candidates=tuple(_candidate(fit, ranked[0].bic) for fit in near_fits),
        hypotheses=tuple(_candidate(fit, ranked[0].bic) for fit in ranked),
        fit_pct=best.fit_pct,
        notes=(*notes, *_notes(best, ranked, ranges, ci95, ambient_degC), *(remark.sentence for remark in doubts)),
        residuals=Residuals(
            time_s=first.time_s, measured_degC=first.temperature_degC, simulated_degC=simulated,
            autocorrelation=autocorrelation(first.temperature_degC - simulated),
        ),
    )


def room_bounds(log: Log) -> Bounds:
    """Return the bounds of the room's temperature around the first reading of a log [°C]."""
    first = float(log.temperature_degC[0])
    return first - _AMBIENT_BELOW, first + _AMBIENT_ABOVE


def _single(
    log: Log, laws: Sequence[ControllerLaw], ambient_degC: Bounds, largest_power_pct: float | None
) -> list[Hypothesis]:
    return [
        Hypothesis(segments=(LogSegment(log=log, law=law, event=event, ambient_degC=ambient_degC),), two_lags=two,
                   largest_power_pct=largest_power_pct)
        for law, two, event in product(laws, (False, True), (False, True))
    ]


def _joint(alone: Sequence[Sequence[Fit]], largest_power_pct: float | None) -> list[Hypothesis]:
    """Return hypotheses of one heater for all logs: the segments that explain each log alone, in all combinations.

    A setpoint step is admitted in the logs that ask for it alone.
    """
    segments = []
    for ranked in alone:
        still = min((fit.bic for fit in ranked if not fit.hypothesis.segments[0].event), default=np.inf)
        needs_event = still > ranked[0].bic + _NEAR
        near = [fit.hypothesis.segments[0] for fit in ranked if fit.bic <= ranked[0].bic + _NEAR]
        fitting = {s.law.name: replace(s, event=needs_event) for s in near if s.event or not needs_event}
        segments.append(list(fitting.values())[:_MOST_LAWS])
    return [Hypothesis(segments=chosen, two_lags=two, largest_power_pct=largest_power_pct)
            for chosen in product(*segments) for two in (False, True)]


def _law_remarks(best: Fit, logs: Sequence[Log]) -> Iterator[Remark]:
    """Yield the findings that no law that was tried can have made a log, with all its readings."""
    hypothesis = best.hypothesis
    errors = hypothesis.parts(hypothesis.measured - best.simulated_degC)
    for log, error in zip(logs, errors, strict=True):
        yield from regulation_remarks(log, float(np.sqrt(np.mean(error**2))))


def _contradictions(best: Fit, fits: Sequence[Fit]) -> Iterator[Remark]:
    """Yield where the curve by itself contradicts every model."""
    plants = [fit.hypothesis.plant(fit.vector) for fit in fits]
    for segment in best.hypothesis.segments:
        yield from contradictions(segment.log, segment.ambient_degC, plants)
        yield from bound_contradictions(segment.log, segment.ambient_degC, plants)


def _intervals(
    best: Fit, fits: Sequence[Fit], ranges: Mapping[str, Interval], ambient_degC: Bounds | None
) -> dict[str, Interval | None]:
    """Return the identified intervals; gain and time constant trade off against an unknown ambient.

    The intervals are valid only for the hypothesis: one that does not predict the later readings identifies neither.
    """
    limits = {name for fit in fits for name in fit.hypothesis.limits_reached(fit.vector)}
    ci95 = {name: None if name in limits else identified_interval(ranges[name]) for name in FIELDS}
    lost: dict[str, Interval | None] = {}
    if ambient_degC is not None and ambient_degC[0] == ambient_degC[1]:
        lost["ambient_degC"] = None
    if not foretells(best) or ci95["ambient_degC"] is None or ci95["time_constant_s"] is None:
        lost |= {"gain_degC_per_pct": None, "time_constant_s": None}
    return ci95 | lost


def _near_fits(ranked: Sequence[Fit]) -> list[Fit]:
    near = [fit for fit in ranked if fit.bic - ranked[0].bic <= _NEAR]
    single = max((fit for fit in ranked if not fit.hypothesis.two_lags), key=lambda fit: fit.fit_pct, default=near[0])
    best = max(fit.fit_pct for fit in near)
    return near if single in near or single.fit_pct < best - _FOPDT_NEAR else [*near, single]


def _best(fits: Sequence[Fit]) -> Fit:
    return max(fits, key=lambda fit: fit.fit_pct)


def _with_rivals(ranked: Sequence[Fit], rivals: Sequence[Fit]) -> list[Fit]:
    """Return the fits that stay, and the rivals with the least and the largest of each measure."""
    return list(dict.fromkeys([*_near_fits(ranked), *extremes(rivals)]))


def _ranges(best: Fit, fits: Sequence[Fit], seed: int, ambient_degC: Bounds | None) -> dict[str, Interval]:
    """Return each measure's interval: block bootstrap of the best model, widened to hold every candidate."""
    hypothesis, rng = best.hypothesis, np.random.default_rng(seed)
    errors = hypothesis.parts(hypothesis.measured - best.simulated_degC)
    shaken = np.concatenate([block_resamples(error, _RESAMPLES, rng) for error in errors], axis=1)
    starts = np.repeat(best.vector[None, :], _RESAMPLES, axis=0)
    residuals = residuals_of(hypothesis, best.simulated_degC + shaken)
    minima = minimise(residuals, starts, hypothesis.low, hypothesis.high, iterations=10)
    plants = [hypothesis.plant(z) for z in minima.parameters]
    others = [fit.hypothesis.plant(fit.vector) for fit in fits]
    # a bound the user gave is knowledge, not the end of a search
    ambient = hypothesis.segments[0].ambient_degC if ambient_degC is None else (-np.inf, np.inf)
    ranges = {}
    for name, measure in (FIELDS | COMBINATIONS).items():
        low, high = ambient if name == "ambient_degC" else (0.0, np.inf)
        values = np.array([measure(plant) for plant in plants])
        range_ = envelope(interval(values, low, high), [measure(plant) for plant in others])
        endless = not np.isfinite(values).all() or range_.high == np.inf
        sides = {fit.hypothesis.limits_reached(fit.vector).get(name) for fit in fits}
        ranges[name] = Interval(low=None if "low" in sides else range_.low,
                                high=None if endless or "high" in sides else range_.high)
    return ranges


def _candidate(fit: Fit, leader: float) -> Candidate:
    hypothesis = fit.hypothesis
    logs = [segment.log for segment in hypothesis.segments]
    together = len(logs) > 1
    pairs = zip(hypothesis.parts(hypothesis.measured), hypothesis.parts(fit.simulated_degC), strict=True)
    controller = {
        f"{log.name}: {name}" if together else name: value
        for i, log in enumerate(logs) for name, value in hypothesis.controller(fit.vector, i).items()
    }
    return Candidate(
        model=hypothesis.plant(fit.vector),
        log=" + ".join(log.name for log in logs),
        window_s=(min(float(log.time_s[0]) for log in logs), max(float(log.time_s[-1]) for log in logs)),
        law=hypothesis.law_name,
        controller=controller,
        fit_pct=fit.fit_pct,
        rmse_degC=fit.rmse_degC,
        delta_bic=fit.bic - leader,
        fits_pct={log.name: fit_pct(*pair) for log, pair in zip(logs, pairs, strict=True)} if together else {},
        hold_out_rmse_degC=fit.hold_out_rmse_degC,
        cross_rmse_degC=fit.cross_rmse_degC,
        on_bound=hypothesis.on_bound(fit.vector),
    )


def _thinned(logs: Sequence[Log]) -> tuple[list[Log], tuple[str, ...]]:
    """Return the logs with every k-th reading only, where they have more than loops inside a fit need, and notes."""
    thin, notes = [], []
    for log in logs:
        every = -(-len(log.time_s) // _MOST_READINGS)
        if every > 1:
            notes.append(f"Of {len(log.time_s)} readings of {log.name} every {every}th was used.")
        setpoint = None if log.setpoint_degC is None else log.setpoint_degC[::every]
        temperature = log.temperature_degC[::every]
        thin.append(log.with_rows(time_s=log.time_s[::every], temperature_degC=temperature, setpoint_degC=setpoint))
    return thin, tuple(notes)


def _outcome(fit: float, ci95: Mapping[str, Interval | None]) -> FitOutcome:
    if fit < _POOR:
        return FitOutcome.POOR_FIT
    apart = ci95["gain_degC_per_pct"] is not None and ci95["time_constant_s"] is not None
    return FitOutcome.IDENTIFIED if apart else FitOutcome.COMBINATIONS_ONLY


def _power_remarks(
    logs: Sequence[Log], ranges: dict[str, Interval], largest_power_pct: float | None
) -> Iterator[Remark]:
    """Yield the finding what the largest power in the logs is; if it is not known, the gain has no upper end.

    A source that states the limit of the output does not show that the heater got that much: it is an assumption.

    Args:
        logs: without power.
        ranges: measure → its range, changed in place.
        largest_power_pct: as stated [%], or None.
    """
    names = " and ".join(log.name for log in logs)
    if largest_power_pct is not None:
        yield Remark("largest-power", f"The largest power in {names} is {largest_power_pct:g} %, as stated.")
    elif any(log.output_limit_pct is None for log in logs):
        low = ranges["gain_degC_per_pct"].low
        ranges |= {name: Interval(low=ranges[name].low, high=None) for name in PROPORTIONAL_TO_GAIN}
        least = "larger than that of the fit" if low is None else f"anything from {low:.3g} °C/% upwards"
        yield Remark("largest-power-unknown", (
            f"{names} does not show how much power the largest output of its controller was: the process gain is "
            f"{least} where the heater never got full power. State the largest power that it got in the log: "
            "--largest-power PCT, 100 if it was fully on for a while."))
    else:
        limits = " and ".join(dict.fromkeys(f"{log.output_limit_pct:g} %" for log in logs))
        yield Remark("output-limit", (
            f"The largest power in {names} is taken as {limits}, the largest output that the program of its controller "
            "allows; the curve does not show that the heater got it."))


def _no_power(logs: Sequence[Log]) -> Remark:
    """Return the finding that the power was not logged; it says so if a setpoint was, which the fit does not use."""
    return _NO_POWER if all(log.setpoint_degC is None for log in logs) else _NO_POWER_BUT_SETPOINT


def _method(best: Fit) -> str:
    order = "two lags, reduced by the half rule" if best.hypothesis.two_lags else "one lag"
    laws = " and ".join(segment.law.name for segment in best.hypothesis.segments)
    return f"closed loop simulated with {laws} inside the fit; {order}; block bootstrap"


def _notes(
    best: Fit, ranked: Sequence[Fit], ranges: Mapping[str, Interval], ci95: Mapping[str, Interval | None],
    ambient_degC: Bounds | None,
) -> tuple[str, ...]:
    hypothesis = best.hypothesis
    has_fixed_ambient = ambient_degC is not None and ambient_degC[0] == ambient_degC[1]
    exempt = {"ambient_degC"} if has_fixed_ambient else set()
    if hypothesis.largest_power_pct is None:
        exempt |= {name for name in PROPORTIONAL_TO_GAIN if ranges[name].high is None}
    lost = [name for name, limits in ci95.items() if limits is None and name not in exempt]
    names = [segment.log.name for segment in hypothesis.segments]
    notes = [_no_power([segment.log for segment in hypothesis.segments]).sentence, *event_notes(best),
             *lost_notes(names, lost, ranges),
             ambient_note(ambient_degC, hypothesis.segments[0].ambient_degC),
             *(note for s in hypothesis.segments for note in evidence_notes(s.log, s.ambient_degC)),
             *validation_notes(best, ranked)]
    if lost:
        notes.append("A log of the power, or one open-loop step of known size until the temperature rests, settles it.")
    return tuple(notes)
