"""A design as it is asked for, its words and their proof."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from heatertune.model.values import FittedModel
from heatertune.pid.recipe import Recipe
from heatertune.pid.values import PidDesign
from heatertune.plc import Scaling, controller_for
from heatertune.plc.choice import WordChoice
from heatertune.plc.choose import choose_words, tune_for_words
from heatertune.plc.cooler import cooled
from heatertune.plc.cycle import switched
from heatertune.plc.design import tune
from heatertune.progress import Told
from heatertune.proof import Proof
from heatertune.proof.fitted import aimed, told_of_aim
from heatertune.proof.interlock import demand_none
from heatertune.proof.pwm_period import with_pwm
from heatertune.proof.recipes import files_of, recorded
from heatertune.proof.refine import refine
from heatertune.proof.setpoint_ramp import prove_ramped
from heatertune.settings import Conditions, SampleSettings, TuneSettings, WordSettings
from heatertune.units import count

__all__ = ["Asked", "Closed", "Made", "made_for", "plainly"]

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
        drawn: on which drawn heaters it has to pass as well.

    Raises:
        InputError: samples behind an interlock.
    """

    target: str
    scaling: Scaling | None = None
    tuned: TuneSettings = field(default_factory=TuneSettings)
    conditions: Conditions = field(default_factory=Conditions)
    interval_by_words: bool = False
    drawn: SampleSettings = field(default_factory=SampleSettings)

    def __post_init__(self) -> None:
        WordSettings.__post_init__(self)
        if self.drawn.samples is not None:
            demand_none(self.conditions.interlock)


@dataclass(frozen=True, slots=True, kw_only=True)
class Closed:
    """A design, its words and their proof.

    Attributes:
        wished: the design.
        choice: its words, and how they were found.
        proof: of the words.
        notes: what was done to make them pass and what that costs, one sentence each.
        conditions: of the proof, with the PWM period that was proposed.
        recipe: of the words, for those who have the design alone.
        passes_with: of a design that fails or winds up, flags and values under which no run does; none: none are known.
    """

    wished: PidDesign
    choice: WordChoice
    proof: Proof
    notes: tuple[str, ...]
    conditions: Conditions
    recipe: Recipe
    passes_with: tuple[str, ...] = ()


def plainly(
    fitted: FittedModel, asked: Asked, *, made: Made | None = None, plain: Proof | None = None, text: bool = True,
    progress: Told = str, stage: Told = str,
) -> Closed:
    """Return the design as asked for, proven; errors as the stages.

    Args:
        fitted: the heater and its candidates.
        asked: what for.
        made: the design and its words, where they are made already.
        plain: their proof without a ramp, where there is one already.
        text: whether the exported text is run, too, see `heatertune.proof.exported.as_exported`.
        progress: told what begins.
        stage: told "design", "words" and "proof".
    """
    wished, choice = made_for(fitted, asked, progress, stage) if made is None else made
    conditions = asked.conditions
    if asked.switch_kind is not None:
        wished, conditions = with_pwm(wished, fitted, asked.switch_kind, conditions, words=choice.words)
    words = cooled(choice.words, conditions.cooling_gain)
    choice = replace(choice, words=switched(controller_for(asked.target).cycle, words, conditions.pwm_period_s))
    if asked.refined:
        choice = refine(choice, fitted, conditions, progress=progress)
    stage("proof")
    progress(f"proving the words on {count(len(fitted.plants), 'possible heater')}")
    proof, notes = prove_ramped(
        choice.words, fitted, asked.setpoint_ramp, conditions, plain=plain, text=text, progress=progress)
    return Closed(wished=wished, choice=choice, proof=proof, notes=tuple(notes), conditions=conditions,
                  recipe=_recipe(asked, proof, conditions))


def _recipe(asked: Asked, proof: Proof, conditions: Conditions) -> Recipe:
    scaling, conditions = proof.words.scaling, recorded(conditions)
    return Recipe(
        target=asked.target, range_degC=scaling.sensor_degC, input=scaling.input,
        words_by=asked.words_by,
        refined=asked.refined, setpoint_ramp=proof.setpoint_ramp,
        boost=proof.boost, conditions=conditions,
        files=files_of(conditions))


def made_for(fitted: FittedModel, asked: Asked, progress: Told, stage: Told) -> Made:
    """Return a design and its words; arguments and errors as `plainly`."""
    stage("design")
    find = tune_for_words if asked.interval_by_words else tune
    tuned = aimed(asked.tuned, asked.conditions)
    wished = find(fitted, tuned, target=asked.target, scaling=asked.scaling, progress=progress)
    wished = replace(wished, notes=(*wished.notes, *told_of_aim(asked.tuned, tuned)))
    stage("words")
    return wished, choose_words(
        wished, asked.target, fitted, scaling=asked.scaling, way=asked.words_by, progress=progress)
