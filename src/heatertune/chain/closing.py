"""The design closed on the verdict: where the plain optimum fails, the least that makes it pass, and its price."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

from heatertune.chain.pwm import with_pwm
from heatertune.chain.ramp import prove_ramped
from heatertune.chain.refine import refine
from heatertune.chain.stages import Told, tune
from heatertune.chain.words import Choice, choose_words, tune_for_words
from heatertune.errors import InputError, NotRepresentable
from heatertune.model.values import FittedModel
from heatertune.pid.values import PidDesign
from heatertune.plc import Scaling, room
from heatertune.proof import Proof

__all__ = ["Asked", "Closed", "closed", "plainly"]

#: tried in turn, each below what was asked for: the more robust loop overshoots less and is slower
_TIGHTER_MS: Final = (1.5, 1.4, 1.3)


@dataclass(frozen=True, slots=True, kw_only=True)
class Asked:
    """What a design is asked for.

    Attributes:
        target: the controller.
        scaling: sensor range; None: 0…100 °C.
        tuning: options of `tune`.
        proving: options of `prove`.
        words_by: how the words are found, see `choose_words`.
        interval_by_words: whether TA is the one whose words are best, see `tune_for_words`.
        switch_kind: "relay" or "ssr": the PWM period is proposed for it, see `with_pwm`; a given actuator stays.
        refined: whether the gains are refined in the loop of the proof, see `refine`.
        setpoint_ramp: [°C/min], "auto" or "none", see `prove_ramped`; None: one is taken where nothing else helps.
    """

    target: str
    scaling: Scaling | None = None
    tuning: Mapping[str, Any]
    proving: Mapping[str, Any]
    words_by: str = "auto"
    interval_by_words: bool = False
    switch_kind: str | None = None
    refined: bool = False
    setpoint_ramp: float | str | None = None


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
    choice: Choice
    proof: Proof
    notes: tuple[str, ...]


def plainly(fitted: FittedModel, asked: Asked, *, progress: Told = str, stage: Told = str) -> Closed:
    """Return the design as asked for, proven; errors as the stages. `stage` is told "design", "words" and "proof"."""
    stage("design")
    find = tune_for_words if asked.interval_by_words else tune
    wished = find(fitted, target=asked.target, scaling=asked.scaling, progress=progress, **asked.tuning)
    stage("words")
    choice = choose_words(
        wished, asked.target, fitted, scaling=asked.scaling, way=asked.words_by, progress=progress)
    conditions = dict(asked.proving)
    if asked.switch_kind is not None:
        shared = {name: conditions[name] for name in ("setpoint_degC", "tolerance_degC") if name in conditions}
        wished, actuator = with_pwm(wished, fitted, asked.switch_kind, words=choice.words, **shared)
        conditions = {"actuator": actuator} | conditions
    if asked.refined:
        choice = refine(choice, fitted, proving=conditions, progress=progress)
    stage("proof")
    progress(f"proving the words on {len(fitted.plants)} possible heaters")
    proof, notes = prove_ramped(choice.words, fitted, asked.setpoint_ramp, proving=conditions, progress=progress)
    return Closed(wished=wished, choice=choice, proof=proof, notes=tuple(notes))


def closed(fitted: FittedModel, asked: Asked, *, progress: Told = str, stage: Told = str) -> Closed:
    """Return the first design that keeps every limit: as asked for, more robust, then with a setpoint ramp.

    The limits are never moved, and Ms is only lowered. Where nothing helps, or the design is none of the optimum, it is
    the plain one. Arguments as `plainly`.

    Raises:
        HeatertuneError: as the stages on the plain design.
    """
    first = plainly(fitted, replace(asked, setpoint_ramp=asked.setpoint_ramp or "none"), progress=progress, stage=stage)
    if first.proof.verdict != "FAIL":
        return first
    for found in _more_robust(fitted, asked, first, progress):
        if found.proof.verdict != "FAIL":
            return replace(found, notes=(_told(first, found), *found.notes))
    if asked.setpoint_ramp is not None or not room(asked.target).ramped:
        return first
    ramp = replace(asked, setpoint_ramp="auto", tuning={**asked.tuning, "sample_time_s": first.wished.sample_time_s})
    return plainly(fitted, ramp, progress=progress)


def _more_robust(fitted: FittedModel, asked: Asked, first: Closed, progress: Told) -> Iterator[Closed]:
    if not first.wished.method.startswith("optimum") or math.isinf(first.wished.integral_time_s):
        return
    ms = float(asked.tuning.get("ms", 1.6))
    for tighter in (each for each in _TIGHTER_MS if each < ms):
        progress(f"{_broken(first)} fails: trying Ms <= {tighter:g}")
        trial = replace(asked, tuning={**asked.tuning, "ms": tighter}, setpoint_ramp=asked.setpoint_ramp or "none")
        try:
            yield plainly(fitted, trial, progress=progress)
        except (InputError, NotRepresentable):
            return


def _told(first: Closed, found: Closed) -> str:
    costs = [each.choice.search["iae_load"] for each in (first, found)]
    price = "" if None in costs else f"; a load disturbance costs {100.0 * (costs[1] / costs[0] - 1.0):.2g} % more IAE"
    limits = [f"Ms {each.choice.search['ms']:.3g}" for each in (first, found) if each.choice.search["ms"] is not None]
    way = " instead of ".join(reversed(limits))
    return f"The optimum as asked for fails ({_broken(first)}); a more robust one keeps every limit: {way}{price}."


def _broken(found: Closed) -> str:
    return ", ".join(each.name.replace("_", " ") for each in found.proof.criteria if not each.ok)
