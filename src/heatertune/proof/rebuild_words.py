"""The words that were proven, made again of a design and its recipe."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Collection
from dataclasses import replace

from heatertune.codec import construct_from
from heatertune.errors import InputError
from heatertune.model.values import FittedModel
from heatertune.pid.design_provenance import DesignProvenance, RampView
from heatertune.pid.values import PidDesign
from heatertune.plc import Boost, Ramp, Scaling, Words, controller_for
from heatertune.plc.cooler import with_cooling
from heatertune.plc.cycle import with_pwm_period
from heatertune.plc.word_choice import WordChoice
from heatertune.plc.word_selection import choose_words
from heatertune.proof.profile_file import read_profile
from heatertune.proof.spec_file import in_force
from heatertune.proof.specification import NOTHING
from heatertune.settings import Conditions

__all__ = ["apply_provenance", "demand_same_files", "files_of", "made_again", "recorded_conditions", "scaling_of"]


def recorded_conditions(conditions: Conditions) -> Conditions:
    """Return conditions as a document can hold them: what is not asked for at all is said by a limit."""
    if conditions.step_power_pct is None or math.isfinite(conditions.step_power_pct):
        return conditions
    return replace(conditions, step_power_pct=None, limit=(*conditions.limit, f"step-power={NOTHING}"))


def files_of(conditions: Conditions) -> dict[str, str]:
    """Return digests of what the files of a specification ask for, by the names of the options; none: there are none.

    Raises:
        DocumentError: one cannot be read.
    """
    spec, profile = conditions.spec, conditions.profile
    asked: dict[str, object] = {}
    if spec is not None and spec.endswith(".toml"):
        asked["spec"] = in_force(spec)
    if profile is not None:
        asked["profile"] = read_profile(profile)
    return {name: f"sha256:{hashlib.sha256(repr(content).encode()).hexdigest()}" for name, content in asked.items()}


def demand_same_files(recipe: DesignProvenance, given: Collection[str], where: str) -> None:
    """Refuse a file that has changed since a recipe was written, but for those that options give anew.

    Raises:
        InputError: it asks for something else; as `files_of`.
    """
    kept = recipe.conditions
    now = files_of(Conditions(spec=None if "spec" in given else kept.spec,
                              profile=None if "profile" in given else kept.profile))
    for name, digest in now.items():
        if recipe.files.get(name) != digest:
            raise InputError(f"{where}: {getattr(kept, name)}, under which it was made, has changed since: say "
                             f"--{name}, or design again")


def scaling_of(recipe: DesignProvenance) -> Scaling:
    """Return the sensor's range as its module gives it; errors as `heatertune.plc.inputs.sensor_scaling`."""
    if recipe.input is None:
        low, high = recipe.range_degC
        return Scaling(low_degC=low, high_degC=high)
    return controller_for(recipe.target).scaled(recipe.input, recipe.range_degC)


def made_again(design: PidDesign, fitted: FittedModel, recipe: DesignProvenance) -> WordChoice:
    """Return the words that a recipe makes of a design.

    Raises:
        NotRepresentable, OutOfRange, UnknownName, InputError: as `choose_words`, `refine` and `finished`.
    """
    choice = choose_words(design, recipe.target, fitted, scaling=scaling_of(recipe), way=recipe.words_by)
    if recipe.refined:
        from heatertune.proof.refine import refine  # noqa: PLC0415 - few recipes need the proof's loop

        choice = refine(choice, fitted, recipe.conditions)
    return replace(choice, words=apply_provenance(choice.words, recipe))


def apply_provenance(words: Words, recipe: DesignProvenance | None) -> Words:
    """Return words with what a recipe changes beside the gains; as they are where it is of another controller.

    Raises:
        OutOfRange, InputError: the controller cannot have it.
    """
    if recipe is None or recipe.target != words.target:
        return words
    words = with_cooling(words, recipe.conditions.cooling_gain)
    words = with_pwm_period(controller_for(words.target).cycle, words, recipe.conditions.pwm_period_s)
    if recipe.power_most_pct is not None:
        words = controller_for(words.target).with_output_limit(words, recipe.power_most_pct)
    if recipe.boost is not None:
        words = replace(words, boost=construct_from(Boost, recipe.boost))
    return words if recipe.setpoint_ramp is None else replace(words, ramp=_ramp(words, recipe.setpoint_ramp))


def _ramp(words: Words, view: RampView) -> Ramp:
    """Return the very ramp, or, where the words' units are others now, the one that comes near it."""
    controller, ramp = controller_for(words.target), Ramp(step=view.step, calls=view.calls, hold=view.hold)
    same = replace(words, ramp=ramp)
    held = controller.hold_degC(same)
    as_told = math.isclose(controller.ramp_degC_per_min(same), view.degC_per_min) and (
        held == view.hold_degC if held is None or view.hold_degC is None else math.isclose(held, view.hold_degC))
    if as_told:
        return ramp
    far = view.hold_degC if view.hold_degC is None or not ramp.cools else -view.hold_degC
    return controller.ramp(words, view.degC_per_min, far)
