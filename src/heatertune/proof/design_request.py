"""A requested design: its PWM period, its words and their proof."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Final

from heatertune.model.model_values import FittedModel
from heatertune.pid.design_document import DesignProvenance
from heatertune.pid.design_values import PidDesign
from heatertune.plc import Scaling, Words, controller_for
from heatertune.plc.controller import with_cooling
from heatertune.plc.design import tune
from heatertune.plc.pwm import tick_for
from heatertune.plc.targets import GROUPS, target_by_name
from heatertune.plc.word_selection import WordChoice, choose_words, tune_for_words
from heatertune.plc.words import with_pwm_period
from heatertune.processors import ProgressCallback
from heatertune.proof import Proof
from heatertune.proof.heaters import ROOM_DEGC
from heatertune.proof.prove_words import aim_sentences, setpoints_for, tune_settings_for
from heatertune.proof.refine import refine
from heatertune.proof.repetition import files_of, recorded_conditions
from heatertune.proof.ripple_and_wear import SWITCHES, propose_period
from heatertune.proof.setpoint_ramp import prove_ramped
from heatertune.proof.specification import specification_of
from heatertune.proof.verdict import demand_none
from heatertune.settings import Conditions, SampleSettings, TuneSettings, WordSettings
from heatertune.units import count

__all__ = ["Candidate", "DesignRequest", "DesignResult", "made_for", "plainly", "with_printer_range", "with_pwm"]


#: of a printer whose log goes above the default range: HEATER_0_MAXTEMP of Marlin and max_temp of Klipper's examples
#: are 250 to 300 °C
_PRINTER_DEGC: Final = (0.0, 300.0)
_OF_TOLERANCE = 0.2  # ripple, peak to peak: a fifth of the half band leaves the rest to the loop


def with_pwm(
    design: PidDesign, fitted: FittedModel, kind: str, conditions: Conditions | None = None, *,
    words: Words | None = None,
) -> tuple[PidDesign, Conditions]:
    """Return the design with a note on the PWM period, and the conditions with that period, where they have none.

    They stay as they are where the target makes the PWM itself, with TA as its period: there is nothing to choose.

    Args:
        design: what was tuned.
        fitted: the heater and its candidates.
        kind: "ssr", "relay" or "contactor".
        conditions: of the proof: where the loop rests, and the band, of which the ripple may take a fifth.
        words: what the controller will hold; None: a switch behind its output.

    Raises:
        UnknownName: no such kind of switch.
    """
    assumed = conditions or Conditions()
    setpoint, _ = setpoints_for(fitted, assumed)
    tick = None if words is None else controller_for(words.target).tick_s
    offer = propose_period(
        fitted.plants, kind=kind, sample_time_s=design.sample_time_s, ambient_degC=ROOM_DEGC, setpoint_degC=setpoint,
        ripple_degC_most=_OF_TOLERANCE * specification_of(assumed).tolerance_degC, tick_s=tick,
    )
    if words is not None and (cycle := controller_for(words.target).cycle) is not None:
        if assumed.pwm_period_s is not None or len(cycle.periods_s) == 1:
            return design, assumed
        least = SWITCHES[kind].shortest_s
        longer = [each for each in cycle.periods_s if each >= least] or [cycle.periods_s[-1]]
        calm = [each for each in longer if each <= offer.period_s]
        period = calm[-1] if calm and math.isfinite(SWITCHES[kind].life) else longer[0]
        return design, replace(assumed, pwm_period_s=period)
    if words is not None and (pwm_s := controller_for(words.target).timing(words).pwm_period_s) is not None:
        note = f"{words.target} makes the PWM itself, period {pwm_s:g} s; a switch behind it would get: {offer.summary}"
        return replace(design, notes=(*design.notes, note)), assumed
    if assumed.pwm_period_s is None:
        resolution = tick_for(tick, sample_time_s=design.sample_time_s, pwm_period_s=offer.period_s)
        assumed = replace(assumed, pwm_period_s=offer.period_s, pwm_resolution_s=resolution)
    return replace(design, notes=(*design.notes, offer.summary)), assumed


#: a design and its words
Candidate = tuple[PidDesign, WordChoice]


@dataclass(frozen=True, slots=True, kw_only=True)
class DesignRequest(WordSettings):
    """What a design is asked for.

    Attributes:
        target: the controller.
        scaling: sensor range; None: 0…100 °C.
        tuned: how the design is found.
        conditions: of the proof.
        interval_by_words: whether TA is the one whose words are best, see `tune_for_words`.
        drawn: on which drawn heaters it has to pass as well.

    Raises:
        InputError: samples behind an interlock.
    """

    target: str
    scaling: Scaling | None = None
    tune_settings: TuneSettings = field(default_factory=TuneSettings)
    conditions: Conditions = field(default_factory=Conditions)
    interval_by_words: bool = False
    sample_settings: SampleSettings = field(default_factory=SampleSettings)

    def __post_init__(self) -> None:
        WordSettings.__post_init__(self)
        object.__setattr__(self, "target", target_by_name(self.target))
        if self.sample_settings.samples is not None:
            demand_none(self.conditions.interlock)


@dataclass(frozen=True, slots=True, kw_only=True)
class DesignResult:
    """A design, its words and their proof.

    Attributes:
        ideal: the design, before it is rounded.
        choice: its words, and how they were found.
        proof: of the words.
        notes: what was done to make them pass and what that costs, one sentence each.
        conditions: of the proof, with the PWM period that was proposed.
        recipe: of the words, for those who have the design alone.
        passes_with: of a design that fails or winds up, flags and values under which no run does; none: none are known.
    """

    ideal: PidDesign
    choice: WordChoice
    proof: Proof
    notes: tuple[str, ...]
    conditions: Conditions
    recipe: DesignProvenance
    passes_with: tuple[str, ...] = ()

    def __repr__(self) -> str:
        """Return the proof in one line."""
        return f"<DesignResult {self.proof!r}>"


def plainly(
    fitted: FittedModel, request: DesignRequest, *, candidate: Candidate | None = None, plain: Proof | None = None,
    text: bool = True,
    progress: ProgressCallback = str, stage: ProgressCallback = str,
) -> DesignResult:
    """Return the design as asked for, proven; errors as the stages.

    Args:
        fitted: the heater and its candidates.
        request: what for.
        candidate: the design and its words, where they are made already.
        plain: their proof without a ramp, where there is one already.
        text: whether the exported text is run, too, see `heatertune.proof.text_comparison.as_exported`.
        progress: called with a few words as each step begins.
        stage: called with "design", "words" and "proof".
    """
    wished, choice = made_for(fitted, request, progress, stage) if candidate is None else candidate
    conditions = request.conditions
    if request.switch_kind is not None:
        wished, conditions = with_pwm(wished, fitted, request.switch_kind, conditions, words=choice.words)
    words = with_cooling(choice.words, conditions.cooling_gain)
    choice = replace(choice,
                     words=with_pwm_period(controller_for(request.target).cycle, words, conditions.pwm_period_s))
    if request.refined:
        choice = refine(choice, fitted, conditions, progress=progress)
    stage("proof")
    progress(f"proving the parameters on {count(len(fitted.plants), 'plausible heater')}")
    proof, notes = prove_ramped(
        choice.words, fitted, request.setpoint_ramp, conditions, plain=plain, gains_open=not request.as_is, text=text,
        progress=progress)
    return DesignResult(ideal=wished, choice=choice, proof=proof, notes=tuple(notes), conditions=conditions,
                  recipe=_recipe(request, proof, conditions))


def _recipe(request: DesignRequest, proof: Proof, conditions: Conditions) -> DesignProvenance:
    scaling, conditions = proof.words.scaling, recorded_conditions(conditions)
    return DesignProvenance(
        target=request.target, range_degC=scaling.sensor_degC, input=scaling.input, words_by=request.words_by,
        refined=request.refined, setpoint_ramp=proof.setpoint_ramp, boost=proof.boost, conditions=conditions,
        files=files_of(conditions))


def made_for(fitted: FittedModel, request: DesignRequest, progress: ProgressCallback,
             stage: ProgressCallback) -> Candidate:
    """Return a design and its words; arguments and errors as `plainly`."""
    stage("design")
    find = tune_for_words if request.interval_by_words else tune
    tuned = tune_settings_for(request.tune_settings, request.conditions)
    wished = find(fitted, tuned, target=request.target, scaling=request.scaling, progress=progress)
    wished = replace(wished, notes=(*wished.notes, *aim_sentences(request.tune_settings, tuned)))
    stage("words")
    return wished, choose_words(
        wished, request.target, fitted, scaling=request.scaling, way=request.words_by, progress=progress)


def with_heater(switches: Mapping[str, str], target: str, names: Iterable[str]) -> Mapping[str, str]:
    """Return what is known of the open points, with the heater that a log is of where the controller leaves that open.

    Args:
        switches: what is known already.
        target: the controller.
        names: of the heater, any of which the controller may use.
    """
    point = next((each for each in controller_for(target).switches if each.name == "heater"), None)
    heater = None if point is None else next((name for name in names if name in point.settings), None)
    return switches if heater is None else {"heater": heater, **switches}


def with_printer_range(request: DesignRequest, hottest_degC: float) -> DesignRequest:
    """Return the request with the sensor range of a printer, where none is stated and the default one is too narrow.

    Args:
        request: the design.
        hottest_degC: of the logged temperatures and setpoints [°C].
    """
    if request.target not in GROUPS["printer"] or request.scaling is not None or hottest_degC < Scaling().high_degC:
        return request
    low, high = _PRINTER_DEGC
    return replace(request, scaling=Scaling(low_degC=low, high_degC=high))
