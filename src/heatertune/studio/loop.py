"""Settings → a first look at the loop in milliseconds, and the full proof; pure functions, for any thread."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from heatertune import chain
from heatertune.model.values import FittedModel
from heatertune.pid.loop.robustness import margins, worst
from heatertune.pid.search.quick import quick_tune
from heatertune.pid.values import Margins, PidDesign
from heatertune.plc import Words, controller_for
from heatertune.plc.choose import choose_words, search_document
from heatertune.progress import Told
from heatertune.proof import Proof, Trace, simulate_wish
from heatertune.proof.fitted import actuator_for
from heatertune.settings import Conditions
from heatertune.studio.settings import Settings

__all__ = ["Gains", "Look", "first_look", "full_proof", "optimum"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Gains:
    """A design and the words it became.

    Attributes:
        design: as wished.
        words: what the controller will hold.
        search: how the words were found, see `heatertune.plc.choose.search_document`; None: each rounded on its own.
    """

    design: PidDesign
    words: Words
    search: Any = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Look:
    """What the page shows at once.

    Attributes:
        settings: it was made for.
        gains: design and words.
        realised: the design as the words realise it; None where the controller is no PID.
        margins: of the words on all heaters, the worst of each; None where the controller is no PID.
        proof: on the nominal heater under default settings of the switches: no verdict on the words.
        wish: the unrounded design on the same heater; None for a controller that is no PID.
    """

    settings: Settings
    gains: Gains
    realised: PidDesign | None
    margins: Margins | None
    proof: Proof
    wish: Trace | None


def first_look(fitted: FittedModel, settings: Settings, gains: Gains | None = None) -> Look:
    """Return the loop on the nominal heater; quick gains where none are given.

    Raises:
        NotRepresentable: the design does not fit the words.
        OutOfRange, InputError: the heater cannot hold the setpoint, the sensor does not see it, …
    """
    gains = gains or _quick(fitted, settings)
    proof = chain.prove(gains.words, fitted, _conditions(settings, gains.words), first_look=True)
    real, nominal = proof.design, proof.nominal
    return Look(
        settings=settings, gains=gains, realised=real, proof=proof,
        margins=None if real is None else worst([margins(plant, real) for plant in fitted.plants]),
        wish=None if real is None else simulate_wish(
            gains.design, nominal.model, nominal.scenario, nominal.actuator),
    )


def full_proof(fitted: FittedModel, look: Look) -> Proof:
    """Return the proof of the same words on every heater under every open point; errors as in `first_look`."""
    return chain.prove(look.gains.words, fitted, _conditions(look.settings, look.gains.words))


def optimum(fitted: FittedModel, settings: Settings, progress: Told = str) -> Gains:
    """Return what `heatertune design` would take for the same settings: IPOPT's optimum and the best words.

    Raises:
        InputError: no design keeps the limits.
        NotRepresentable: as in `first_look`.
    """
    design = chain.tune(fitted, settings.tuned, target=settings.target, progress=progress)
    choice = choose_words(design, settings.target, fitted, scaling=settings.scaling, progress=progress)
    return Gains(design=design, words=choice.words, search=search_document(choice, fitted))


def _quick(fitted: FittedModel, settings: Settings) -> Gains:
    controller = controller_for(settings.target)
    design = quick_tune(
        fitted.plants, structure=settings.structure, ms=settings.ms, sample_time_s=settings.sample_time_s,
        timer=controller.timer, derivative_filter=controller.derivative_filter,
    )
    return Gains(design=design, words=chain.encode(design, settings.target, scaling=settings.scaling))


def _conditions(settings: Settings, words: Words) -> Conditions:
    switch = actuator_for(replace(settings.assumed, pwm_period_s=settings.pwm_period_s or None), words)
    return replace(settings.assumed, pwm_period_s=switch.pwm_period_s, pwm_resolution_s=switch.resolution_s)
