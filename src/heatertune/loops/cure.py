"""The words that would cure a loop: designed for the heater that its log shows, proven, and lived through its day."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

from heatertune import cache
from heatertune.errors import HeatertuneError
from heatertune.loops.diagnosis import Diagnosis, day, times_worse
from heatertune.loops.loop_values import Cause, LoopEntry
from heatertune.model.values import FittedModel
from heatertune.pid.values import PidDesign
from heatertune.plc import Words
from heatertune.proof.redesign import DesignRequest, DesignResult, find_passing_design
from heatertune.proof.verdict import NOT_PROVEN, combined_verdict
from heatertune.units import written

__all__ = ["Cure", "cure_words"]

#: causes that other words cure, as far as words can
_BY_WORDS: Final = (Cause.OSCILLATING, Cause.OFFSET, Cause.SLUGGISH, Cause.DRIFTED, Cause.WEAR)


@dataclass(frozen=True, slots=True, kw_only=True)
class Cure:
    """What would be typed in.

    Attributes:
        words: of the target; None: there are none, see `why`.
        verdict: of their proof; no PASS where the logged day lived with them is worse.
        why: what the proof does not keep, what is not proven, or why there are no words.
        design: what the words make.
        pwm_period_s: that they were proven with.
        was_degC, would_degC: mean error of the logged day, as it was and with them, noise left out; None: not lived.
    """

    words: Words | None
    verdict: str
    reason: str
    design: PidDesign | None = None
    pwm_period_s: float | None = None
    was_degC: float | None = None
    would_degC: float | None = None


def cure_words(told: Diagnosis, loop: LoopEntry, request: DesignRequest | None) -> Cure | None:
    """Return the words that would cure a loop, None where words are not what it needs.

    Args:
        told: what is wrong with it.
        loop: a switch that is known gets the PWM period that suits it; else the period stays.
        request: controller, range and the rest of the design; None: the controller is not known.
    """
    if told.cause not in _BY_WORDS:
        return None
    if told.fitted_model is None:
        return Cure(words=None, verdict="", reason=f"no heater to design for: {told.why_not}")
    if request is None:
        return Cure(words=None, verdict="", reason="name the controller: --target, or target in the list")
    try:
        with cache.cache_disabled():
            done = find_passing_design(told.fitted_model, _asked(told, loop, request))
    except HeatertuneError as problem:
        return Cure(words=None, verdict="", reason=str(problem))
    return _lived(told, told.fitted_model, done)


def _asked(told: Diagnosis, loop: LoopEntry, request: DesignRequest) -> DesignRequest:
    """Return what is asked for, with what is known of the loop in the place of what nobody said."""
    conditions = request.conditions
    if conditions.setpoint_degC is None:
        conditions = replace(conditions, setpoint_degC=round(float(told.course.setpoint_degC.max()), 6))
    kind, tuned = request.switch_kind or loop.switch, request.tune_settings
    if conditions.pwm_period_s is None and any(found.cause is Cause.WEAR for found in told.faults):
        conditions = replace(conditions, pwm_period_s=told.longer_period_s)
        tuned = replace(tuned, sample_time_s=tuned.sample_time_s or told.longer_period_s)
    elif conditions.pwm_period_s is None and kind is None:
        conditions = replace(conditions, pwm_period_s=loop.pwm_period_s)
    return replace(request, conditions=conditions, switch_kind=kind, tune_settings=tuned)


def _lived(told: Diagnosis, fitted: FittedModel, done: DesignResult) -> Cure:
    proof, words = done.proof, done.proof.words
    broken = ", ".join(proof.broken_criteria).replace("_", " ")
    why, open_points = [f"not kept: {broken}"] if broken else [], [*proof.diagnostics.blocking]
    running = words.controller()
    lived = day(told.course, fitted.hypothetical[0], running, running.scan_s)
    _, was, would = times_worse(lived, told.course)
    if would > was + told.course.least_degC:
        open_points.append(
            f"the logged day lived with them is worse, mean error {written(was, 2)} → {written(would, 2)} °C")
    why += [f"not proven: {point}" for point in open_points]
    verdict = combined_verdict([proof.verdict, *([NOT_PROVEN] if open_points else [])])
    return Cure(words=words, verdict=verdict, reason="; ".join(why), design=done.ideal,
                pwm_period_s=proof.actuator.pwm_period_s, was_degC=was, would_degC=would)
