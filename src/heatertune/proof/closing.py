"""The design closed on the verdict: where the plain optimum fails, the least that makes it pass, and its price."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Final, NamedTuple

from heatertune.errors import InputError, NotRepresentable
from heatertune.model.values import FittedModel
from heatertune.pid.values import PidDesign
from heatertune.plc import Scaling, controller_for
from heatertune.plc.choice import WordChoice
from heatertune.plc.choose import choose_words, tune_for_words
from heatertune.plc.design import tune
from heatertune.progress import Told
from heatertune.proof import Proof
from heatertune.proof.fitted import aimed, default_pwm_period_s, told_of_aim
from heatertune.proof.pwm_period import with_pwm
from heatertune.proof.refine import refine
from heatertune.proof.setpoint_ramp import prove_ramped
from heatertune.settings import Conditions, TuneSettings, WordSettings

__all__ = ["Asked", "Closed", "closed", "plainly"]

#: tried in turn, each below what was asked for: the more robust loop overshoots less and is slower
_TIGHTER_MS: Final = (1.5, 1.4, 1.3)
#: PWM period that a solid-state relay takes well and a contactor does not [s]
_FAST_S: Final = 2.5
#: criteria that a setpoint ramp helps to keep
_BEYOND: Final = frozenset({"overshoot", "overshoot_degC"})
_NOTHING_PCT: Final = 0.05  # more IAE than this is told


#: a design and its words
Made = tuple[PidDesign, WordChoice]


@dataclass(frozen=True, slots=True, kw_only=True)
class Asked(WordSettings):
    """What a design is asked for.

    Attributes:
        target: the controller.
        scaling: sensor range; None: 0…100 °C.
        tuned: how the design is found.
        conditions: of the proof.
        interval_by_words: whether TA is the one whose words are best, see `tune_for_words`.
    """

    target: str
    scaling: Scaling | None = None
    tuned: TuneSettings = field(default_factory=TuneSettings)
    conditions: Conditions = field(default_factory=Conditions)
    interval_by_words: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Closed:
    """A design, its words and their proof.

    Attributes:
        wished: the design.
        choice: its words, and how they were found.
        proof: of the words.
        notes: what was done to make them pass and what that costs, one sentence each.
    """

    wished: PidDesign
    choice: WordChoice
    proof: Proof
    notes: tuple[str, ...]


def plainly(
    fitted: FittedModel, asked: Asked, *, made: Made | None = None, progress: Told = str, stage: Told = str
) -> Closed:
    """Return the design as asked for, proven; errors as the stages.

    Args:
        fitted: the heater and its candidates.
        asked: what for.
        made: the design and its words, where they are made already.
        progress: told what begins.
        stage: told "design", "words" and "proof".
    """
    wished, choice = _made(fitted, asked, progress, stage) if made is None else made
    conditions = asked.conditions
    if asked.switch_kind is not None:
        wished, conditions = with_pwm(wished, fitted, asked.switch_kind, conditions, words=choice.words)
    if asked.refined:
        choice = refine(choice, fitted, conditions, progress=progress)
    stage("proof")
    progress(f"proving the words on {len(fitted.plants)} possible heaters")
    proof, notes = prove_ramped(choice.words, fitted, asked.setpoint_ramp, conditions, progress=progress)
    return Closed(wished=wished, choice=choice, proof=proof, notes=tuple(notes))


def _made(fitted: FittedModel, asked: Asked, progress: Told, stage: Told) -> Made:
    stage("design")
    find = tune_for_words if asked.interval_by_words else tune
    tuned = aimed(asked.tuned, asked.conditions)
    wished = find(fitted, tuned, target=asked.target, scaling=asked.scaling, progress=progress)
    wished = replace(wished, notes=(*wished.notes, *told_of_aim(asked.tuned, tuned)))
    stage("words")
    return wished, choose_words(
        wished, asked.target, fitted, scaling=asked.scaling, way=asked.words_by, progress=progress)


def closed(fitted: FittedModel, asked: Asked, *, progress: Told = str, stage: Told = str) -> Closed:
    """Return the first design that keeps every limit: as asked for, or changed by as little as will do.

    A more robust loop first, then a faster PWM, then a setpoint ramp. The limits are never moved, Ms is only lowered,
    and what the user gave stays. Where nothing helps it is the plain design. Arguments as `plainly`.

    Raises:
        HeatertuneError: as the stages on the plain design.
    """
    made = {asked.tuned.ms: _made(fitted, asked, progress, stage)}
    still = replace(asked, setpoint_ramp=asked.setpoint_ramp or "none")
    first = plainly(fitted, still, made=made[asked.tuned.ms], progress=progress, stage=stage)
    if first.proof.verdict != "FAIL":
        return first
    for changed in _changes(asked, first):
        progress(f"{_broken(first)} fails: trying {changed.what}")
        ms = changed.asked.tuned.ms
        try:
            made[ms] = made.get(ms) or _made(fitted, changed.asked, progress, str)
            found = plainly(fitted, changed.asked, made=made[ms], progress=progress)
        except (InputError, NotRepresentable):
            continue
        if found.proof.verdict != "FAIL":
            heard = found.proof.heard
            proof = replace(found.proof, heard=replace(heard, remarks=(*heard.remarks, f"with {changed.what}")))
            return replace(found, proof=proof, notes=(_told(first, found, changed.what), *found.notes))
    return first


class _Change(NamedTuple):
    asked: Asked
    what: str


def _changes(asked: Asked, first: Closed) -> Iterator[_Change]:
    """Return what is tried, the least first."""
    still = replace(asked, setpoint_ramp=asked.setpoint_ramp or "none")
    by_optimum = first.wished.method.startswith("optimum") and math.isfinite(first.wished.integral_time_s)
    ms = asked.tuned.ms
    robust = [_Change(replace(still, tuned=replace(asked.tuned, ms=tighter)), f"Ms <= {tighter:g}")
              for tighter in _TIGHTER_MS if by_optimum and tighter < ms]
    yield from robust
    fast = _faster(asked, first)
    if fast is not None:
        conditions = replace(asked.conditions, pwm_period_s=fast)
        told = f"a PWM period of {fast:.3g} s (a solid-state relay)"
        for each, what in [_Change(still, ""), *robust]:
            yield _Change(replace(each, conditions=conditions), " and ".join(filter(None, (what, told))))
    broken = {each.name for each in first.proof.criteria if not each.ok}
    if asked.setpoint_ramp is None and controller_for(asked.target).ramped and broken & _BEYOND:
        ramped = replace(asked, setpoint_ramp="auto")
        yield _Change(ramped, "a setpoint ramp")
        if fast is not None:
            yield _Change(replace(ramped, conditions=conditions), f"a setpoint ramp and {told}")


def _faster(asked: Asked, first: Closed) -> float | None:
    """Return a shorter PWM period [s]; None where the user chose one, or the controller makes the PWM itself."""
    chosen = asked.switch_kind is not None or asked.conditions.pwm_period_s is not None
    words = first.proof.words
    if chosen or controller_for(words.target).timing(words).pwm_period_s is not None:
        return None
    period = default_pwm_period_s(words.sample_time_s, most_s=_FAST_S)
    return period if period < default_pwm_period_s(words.sample_time_s) else None


def _told(first: Closed, found: Closed, what: str) -> str:
    before, after = first.choice.search.realised.iae_load, found.choice.search.realised.iae_load
    more = None if before is None or after is None else 100.0 * (after / before - 1.0)
    dearer = more is not None and more > _NOTHING_PCT
    price = "" if more is None else f"; a load disturbance costs {more:.2g} % more IAE" if dearer else "; IAE stays"
    return f"The optimum as asked for fails ({_broken(first)}); with {what} every limit is kept{price}."


def _broken(found: Closed) -> str:
    return ", ".join(each.name.replace("_", " ") for each in found.proof.criteria if not each.ok)
