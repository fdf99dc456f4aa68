"""Settings → a first look at the loop in milliseconds, the full proof, the design; pure functions, for any thread."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

from heatertune import chain
from heatertune.model.values import FittedModel, HeaterModel
from heatertune.pid.document import DesignProvenance
from heatertune.pid.loop.robustness import margins, worst
from heatertune.pid.search.quick import quick_tune
from heatertune.pid.values import Margins, PidDesign
from heatertune.plc import Words, controller_for
from heatertune.plc.cooler import with_cooling
from heatertune.plc.cycle import with_pwm_period
from heatertune.plc.design import loop_fit
from heatertune.plc.word_selection import search_document
from heatertune.processors import ProgressCallback
from heatertune.proof import Proof, Trace, simulate_wish
from heatertune.proof.design_request import made_for
from heatertune.proof.monte_carlo.run import sample_document
from heatertune.proof.redesign import DesignRequest, DesignResult, find_passing_design
from heatertune.proof.text_comparison import as_exported
from heatertune.settings import Conditions
from heatertune.studio.settings import StudioSettings

__all__ = [
    "DRAWN",
    "CandidateWords",
    "DesignOutcome",
    "LoopView",
    "find_design",
    "first_look",
    "full_proof",
    "on_drawn_heaters",
    "optimum",
]

#: heaters that are drawn at a time
DRAWN: Final = 1000


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CandidateWords:
    """A design and the words it became.

    Attributes:
        design: as wished.
        words: what the controller will hold.
        search: how the words were found, see `heatertune.plc.word_selection.search_document`; None: each rounded on its
            own.
        recipe: how the design became the words; None: not told.
        conditions: of the proof, where the design came with some; None: those of the settings.
        proof: of the words, where it is made already.
    """

    design: PidDesign
    words: Words
    search: Any = None
    recipe: DesignProvenance | None = None
    conditions: Conditions | None = None
    proof: Proof | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoopView:
    """What the page shows at once.

    Attributes:
        settings: it was made for.
        gains: design and words.
        realised: the design as the words realise it; None where the controller is no PID.
        margins: of the words on all heaters, the worst of each; None where the controller is no PID.
        proof: on the nominal heater under default settings of the switches: no verdict on the words.
        wish: the unrounded design on the same heater; None for a controller that is no PID.
    """

    settings: StudioSettings
    gains: CandidateWords
    realised: PidDesign | None
    margins: Margins | None
    proof: Proof
    wish: Trace | None

    @property
    def conditions(self) -> Conditions:
        """What the proof assumes."""
        return self.gains.conditions or self.settings.conditions


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DesignOutcome:
    """What `heatertune design` finds.

    Attributes:
        closed: as it came.
        gains: as the page shows them, the proof with them.
    """

    result: DesignResult
    gains: CandidateWords


def first_look(fitted: FittedModel, settings: StudioSettings, gains: CandidateWords | None = None) -> LoopView:
    """Return the loop on the nominal heater; quick gains where none are given.

    Raises:
        NotRepresentable: the design does not fit the words.
        OutOfRange, InputError: the heater cannot hold the setpoint, the sensor does not see it, …
    """
    gains = gains or _quick(fitted, settings)
    proof = chain.prove(gains.words, fitted, gains.conditions or settings.conditions, first_look=True)
    real, nominal = proof.design, proof.nominal
    return LoopView(
        settings=settings, gains=gains, realised=real, proof=proof,
        margins=None if real is None else worst([margins(plant, real) for plant in _plants(fitted, settings)]),
        wish=None if real is None else simulate_wish(
            gains.design, nominal.model, nominal.scenario, nominal.actuator,
            ramp_degC_per_min=proof.ramp_degC_per_min if proof.words.ramp else math.inf, hold_degC=proof.hold_degC),
    )


def optimum(fitted: FittedModel, settings: StudioSettings, progress: ProgressCallback = str) -> CandidateWords:
    """Return the design and the words with which `heatertune design` begins for the same settings.

    Raises:
        InputError: no design keeps the limits.
        NotRepresentable: as in `first_look`.
    """
    asked = _request(settings)
    design, choice = made_for(fitted, asked, progress, str)
    words = with_cooling(choice.words, asked.conditions.cooling_gain)
    words = with_pwm_period(controller_for(asked.target).cycle, words, asked.conditions.pwm_period_s)
    return CandidateWords(design=design, words=words, search=search_document(choice, fitted))


def full_proof(fitted: FittedModel, look: LoopView, progress: ProgressCallback = str) -> Proof:
    """Return the proof of the same words on every heater under every open point; errors as in `first_look`."""
    return as_exported(chain.prove(look.gains.words, fitted, look.conditions, progress=progress))


def on_drawn_heaters(fitted: FittedModel, look: LoopView) -> dict[str, Any]:
    """Return what the same words do on `DRAWN` heaters and days drawn at random, as `verify --samples` does.

    Raises:
        InputError, OutOfRange: as in `first_look`.
    """
    return sample_document(look.gains.words, fitted, DRAWN, look.conditions)


def find_design(fitted: FittedModel, settings: StudioSettings, progress: ProgressCallback = str) -> DesignOutcome:
    """Return what `heatertune design` finds for the same settings: the optimum, changed by as little as makes it pass.

    Raises:
        InputError: no design keeps the limits.
        NotRepresentable: as in `first_look`.
    """
    found = find_passing_design(fitted, _request(settings), progress=progress)
    return DesignOutcome(result=found, gains=CandidateWords(
        design=found.ideal, words=found.proof.words, search=search_document(found.choice, fitted, found.notes),
        recipe=found.recipe, conditions=found.conditions, proof=found.proof))


def _request(settings: StudioSettings) -> DesignRequest:
    return DesignRequest(target=settings.target, scaling=settings.scaling, tune_settings=settings.tune_settings,
                         conditions=settings.conditions)


def _plants(fitted: FittedModel, settings: StudioSettings) -> tuple[HeaterModel, ...]:
    """Return the plausible heaters with the delay of the target's input module and output."""
    return loop_fit(fitted, settings.target, settings.scaling).plants


def _quick(fitted: FittedModel, settings: StudioSettings) -> CandidateWords:
    controller = controller_for(settings.target)
    design = quick_tune(
        _plants(fitted, settings), structure=settings.structure, ms=settings.ms, sample_time_s=settings.sample_time_s,
        timer=controller.timer, derivative_filter=controller.derivative_filter,
    )
    return CandidateWords(design=design, words=chain.encode(design, settings.target, scaling=settings.scaling))
