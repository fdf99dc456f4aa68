"""What a log without power cannot tell, in words."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from heatertune.model.diagnostics import DROP_PCT, Remark
from heatertune.model.intervals import Interval
from heatertune.model.statistics import fit_pct
from heatertune.model.temperature.closed_loop import Bounds
from heatertune.model.temperature.search import EARLY, Fit
from heatertune.model.validation import LJUNG_BOX_95, constant_rmse, ljung_box
from heatertune.units import NOMENCLATURE

__all__ = [
    "ambient_note", "event_notes", "foretelling_remarks", "foretells", "joint_note", "limit_remarks", "lost_notes",
    "share_remarks", "validation_notes",
]

_LEAST = 2.0 / 3.0  # of the span, that the power has to move the model by
_CANCELLED = 3.0  # of the span: beyond that, power and initial state cancel
_FAR_OUT = 0.2  # of a log's span: a prediction that misses by more is none


def event_notes(best: Fit) -> Iterable[str]:
    """Tell the setpoint steps that were assumed."""
    for i, segment in enumerate(best.hypothesis.segments):
        if segment.event:
            step = best.hypothesis.controller(best.vector, i)
            yield (
                f"A setpoint step of {step['setpoint_step_degC']:+.1f} °C at {step['setpoint_step_at_s']:.0f} s of "
                f"{segment.log.name} is a hypothesis after the fact, suggested by the log; it was not recorded."
            )


def lost_notes(names: Sequence[str], lost: Iterable[str], ranges: Mapping[str, Interval]) -> Iterable[str]:
    """Tell what is not identified, and how wide it is."""
    for name in lost:
        _, called, unit = NOMENCLATURE[name]
        low, high = ("the bound of the search" if end is None else f"{end:.3g} {unit}"
                     for end in (ranges[name].low, ranges[name].high))
        sentence = f"The {called} is not identified: anything from {low} to {high} explains {' and '.join(names)}"
        yield f"{sentence} nearly as well."


def ambient_note(given: Bounds | None, sought: Bounds) -> str:
    """Tell where the ambient temperature comes from."""
    if given is None:
        return (f"The ambient was sought within {sought[0]:.1f}…{sought[1]:.1f} °C, around the first reading; give "
                "--ambient LOW HIGH if you know it better.")
    if given[0] == given[1]:
        return f"The ambient temperature of {given[0]:g} °C was given, not fitted."
    return f"The ambient was sought within the given {given[0]:g}…{given[1]:g} °C."


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

    The power of the law is compared with the decay of the initial state, as `power_share` does where the power was
    logged: a model that gets most of its course from the state it begins in says little of what the power does.

    Args:
        near: fits that explain the logs about as well as the best, the best first.
    """
    for i, segment in enumerate(near[0].hypothesis.segments):
        reason = next(filter(None, (_unexplained(fit, i) for fit in near)), "")
        if reason:
            yield Remark("unexplained-by-power", f"{segment.log.name}: {reason}")


def _unexplained(fit: Fit, segment: int) -> str:
    """Return why the power of a law does not explain one log; empty where it does."""
    simulated = fit.hypothesis.parts(fit.simulated_degC)[segment]
    free = fit.hypothesis.free_response(fit.vector, segment)
    whole, power, start = (float(np.ptp(part)) for part in (simulated, simulated - free, free))
    if _LEAST * whole <= power and not (power > _CANCELLED * whole and start > whole):
        return ""
    return (f"with {fit.hypothesis.title}, the power moves the model by {power:.3g} °C and its initial state by "
            f"{start:.3g} °C, where both together span {whole:.3g} °C.")


def limit_remarks(kept: Sequence[Fit]) -> Iterable[Remark]:
    """Yield the finding that parameters of the plausible heaters lie on arbitrary bounds of their search."""
    names = list(dict.fromkeys(name for fit in kept for name in fit.hypothesis.limits_reached(fit.vector)))
    if names:
        logs = " and ".join(segment.log.name for segment in kept[0].hypothesis.segments)
        yield Remark("on-bound", (
            f"On a bound of the search where models explain {logs}: {', '.join(names)}. What lies beyond the bound "
            "would explain it better still."))


def validation_notes(best: Fit, ranked: Sequence[Fit]) -> Iterable[str]:
    """Tell what the best fit is worth on unseen readings, whether another is worth more, and if residuals are white."""
    hypothesis = best.hypothesis
    early = hypothesis.early(EARLY)
    ends = " and ".join(f"{segment.log.time_s[-1]:g} s" for segment in early.segments)
    step = "; the setpoint step could not be foreseen" if any(s.event for s in hypothesis.segments) else ""
    verdict = "passes" if foretells(best) else "fails"
    yield (
        f"The hold-out in time {verdict}: fitted up to {ends}, the model misses the later "
        f"readings by {best.hold_out_rmse_degC:.2f} °C RMS, their own mean by {constant_rmse(hypothesis, early):.2f} °C"
        f"{step}."
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
    """Tell how well one heater serves all logs, and what that costs against a heater for each."""
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
