"""The settings of the page with their ranges and steps, and the loop that they give.

A first view of the loop takes milliseconds; the full proof and the design follow. Pure functions, for any thread.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import cached_property, lru_cache, partial
from typing import Any, Final

from heatertune import chain
from heatertune.errors import OutOfRange
from heatertune.model.model_values import FittedModel, HeaterModel
from heatertune.pid.design_document import DesignProvenance
from heatertune.pid.design_values import Margins, PidDesign
from heatertune.pid.sampled_loop import margins, worst
from heatertune.pid.tune import quick_tune
from heatertune.plc import NAMES, Scaling, Words, controller_for
from heatertune.plc.controller import with_cooling
from heatertune.plc.design import loop_fit
from heatertune.plc.inputs import has_ends
from heatertune.plc.word_selection import search_document
from heatertune.plc.words import with_pwm_period
from heatertune.processors import ProgressCallback
from heatertune.proof import Proof, Trace, simulate_wish
from heatertune.proof.design_request import made_for, with_heater
from heatertune.proof.heaters import default_setpoint, labelled_heaters
from heatertune.proof.monte_carlo.run import sample_document
from heatertune.proof.redesign import DesignRequest, DesignResult, find_passing_design
from heatertune.proof.ripple_and_wear import SWITCHES
from heatertune.proof.specification import GENERAL, PRESETS
from heatertune.proof.text_comparison import as_exported
from heatertune.settings import Conditions, TuneSettings
from heatertune.units import check

__all__ = [
    "DRAWN", "SLIDERS", "CandidateWords", "DesignOutcome", "LoopView", "Slider", "StudioSettings", "document_of",
    "find_design", "first_look", "full_proof", "optimum", "results_on_samples", "settings_for",
]


_SENSOR_STEP: Final = 50.0  # sensors are sold in such ranges [°C]
#: where nothing is said
_ASKED: Final = TuneSettings()
_ABOVE: Final = 1.25  # sensor range over the highest temperature that is meant


@dataclass(frozen=True, slots=True, kw_only=True)
class Slider:
    """One slider.

    Attributes:
        field: of `Settings`.
        label: as read out.
        unit: of the value.
        low, high, step: of the value; where a heater is known, `high` of a time follows it.
        auto: whether the program may choose the value itself.
    """

    field: str
    label: str
    unit: str
    low: float
    high: float
    step: float
    auto: bool = False


SLIDERS: Final = (
    Slider(field="ms", label="Robustness: largest sensitivity Ms", unit="", low=1.2, high=2.0, step=0.05),
    Slider(field="sample_time_s", label="Sampling interval TA", unit="s", low=0.1, high=60.0, step=0.1, auto=True),
    Slider(field="pwm_period_s", label="PWM period", unit="s", low=0.1, high=60.0, step=0.1, auto=True),
    Slider(field="setpoint_degC", label="Setpoint", unit="°C", low=0.0, high=400.0, step=0.5, auto=True),
    Slider(field="low_degC", label="Sensor range from", unit="°C", low=-200.0, high=50.0, step=10.0),
    Slider(field="high_degC", label="Sensor range up to", unit="°C", low=60.0, high=1600.0, step=10.0),
    Slider(field="noise_degC", label="Sensor noise (standard deviation)", unit="°C", low=0.0, high=2.0, step=0.05),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class StudioSettings:
    """What a design is made and proven for; equal settings mean the same design.

    Attributes:
        target: the controller.
        structure: "p", "pi" or "pid".
        ms: limit of the maximum sensitivity.
        sample_time_s: TA [s]; None: TRdom/10.
        pwm_period_s: of the switch behind the controller [s]; None: TA in whole parts of up to 10 s.
        setpoint_degC: of the proof [°C]; None: as the proof takes it.
        low_degC, high_degC: sensor range; not looked at where the module has its own [°C].
        input: range of the analog module, one of `heatertune.plc.inputs.INPUTS`; None: a plain one.
        noise_degC: standard deviation of the sensor's noise [°C].
        tolerance_degC: how far from the setpoint is still right [°C]; None: as the proof takes it.
        limits: of the proof that are other than its own, as "overshoot=24%".
        assumptions: open point of the controller's manual and the setting that is taken as known.
        heaters: names of the heater that the log is of, for a controller that has several.
        switch_kind: one of `heatertune.proof.ripple_and_wear.SWITCHES`; it tells how long contacts last.
        spec: what words must keep, one of `heatertune.proof.specification.PRESETS`.

    Raises:
        OutOfRange, UnknownName: a value without meaning.
    """

    target: str = "s5-ob251"
    structure: str = _ASKED.structure
    ms: float = _ASKED.ms
    sample_time_s: float | None = None
    pwm_period_s: float | None = None
    setpoint_degC: float | None = None
    low_degC: float = 0.0
    high_degC: float = 100.0
    noise_degC: float = 0.0
    input: str | None = None
    tolerance_degC: float | None = None
    limits: tuple[str, ...] = ()
    assumptions: tuple[tuple[str, str], ...] = ()
    heaters: tuple[str, ...] = ()
    switch_kind: str = "ssr"
    spec: str = GENERAL

    def __post_init__(self) -> None:
        if self.target not in NAMES:
            raise OutOfRange("target", self.target, f"one of {', '.join(NAMES)}")
        for name, choices in (("switch_kind", SWITCHES), ("spec", PRESETS)):
            if getattr(self, name) not in choices:
                raise OutOfRange(name, getattr(self, name), f"one of {', '.join(choices)}")
        if self.sample_time_s is not None:  # 0 means a continuous design elsewhere
            check("sample_time_s", self.sample_time_s, above=0.0)
        _ = self.scaling, self.tune_settings, self.conditions

    @property
    def scaling(self) -> Scaling:
        """The sensor range."""
        which = controller_for(self.target)
        if has_ends(which.ranges, self.input):
            return which.scaled(self.input)
        return which.scaled(self.input, (self.low_degC, self.high_degC))

    @property
    def resolution_degC(self) -> float:
        """One step of the input module [°C]."""
        return self.scaling.span_degC / controller_for(self.target).sensor(self.scaling).counts

    @property
    def conditions(self) -> Conditions:
        """What the proof assumes."""
        return Conditions(
            setpoint_degC=self.setpoint_degC, noise_degC=self.noise_degC, pwm_period_s=self.pwm_period_s,
            tolerance_degC=self.tolerance_degC, limit=self.limits, spec=None if self.spec == GENERAL else self.spec,
            switches=with_heater(dict(self.assumptions), self.target, self.heaters))

    @property
    def tune_settings(self) -> TuneSettings:
        """What the design is asked for."""
        return TuneSettings(structure=self.structure, ms=self.ms, sample_time_s=self.sample_time_s)


assert {slider.field for slider in SLIDERS} <= {field.name for field in fields(StudioSettings)}


def settings_for(fitted: FittedModel, start: StudioSettings) -> StudioSettings:
    """Return settings that suit a new heater: the sensor's range reaches beyond the setpoint and ambient."""
    places = [default_setpoint(fitted), *(float(model.ambient_degC or 0.0) for _, model in labelled_heaters(fitted))]
    high = max(2.0, math.ceil(_ABOVE * max(places) / _SENSOR_STEP)) * _SENSOR_STEP
    low = min(0.0, math.floor(min(places) / _SENSOR_STEP) * _SENSOR_STEP)
    return replace(start, sample_time_s=None, pwm_period_s=None, setpoint_degC=None, low_degC=low, high_degC=high)


#: heaters that are drawn at a time
DRAWN: Final = 1000


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CandidateWords:
    """A design and the words it became.

    Attributes:
        design: as wished.
        words: what the controller will hold.
        search: makes the document of how the words were found, see `heatertune.plc.word_selection.search_document`;
            only a download needs it, and of words each rounded on its own there is none.
        notes: on the words, as in that document.
        recipe: how the design became the words; None: not told.
        conditions: of the proof, where the design came with some; None: those of the settings.
        proof: of the words, where it is made already.
    """

    design: PidDesign
    words: Words
    search: Callable[[], Any] = lambda: None
    notes: tuple[str, ...] = ()
    recipe: DesignProvenance | None = None
    conditions: Conditions | None = None
    proof: Proof | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class LoopView:
    """What the page shows at once.

    Attributes:
        settings: it was made for.
        gains: design and words.
        realised: the design as the words realise it; None where the controller is no PID.
        plants: heaters for which `margins` are.
        proof: on the nominal heater under default settings of the switches: no verdict on the words.
        is_opening: whether its test sequence takes long and ends after its first event.
    """

    settings: StudioSettings
    gains: CandidateWords
    realised: PidDesign | None
    plants: tuple[HeaterModel, ...]
    proof: Proof
    is_opening: bool = False

    @cached_property
    def wish(self) -> Trace | None:
        """The unrounded design on the same heater; None for a controller that is no PID."""
        proof, nominal = self.proof, self.proof.nominal
        return None if self.realised is None else simulate_wish(
            self.gains.design, nominal.model, nominal.scenario, nominal.actuator,
            ramp_degC_per_min=proof.ramp_degC_per_min if proof.words.ramp else math.inf, hold_degC=proof.hold_degC)

    @cached_property
    def margins(self) -> Margins | None:
        """Those of the words on all heaters, the worst of each; None where the controller is no PID."""
        real = self.realised
        return None if real is None else worst([margins(plant, real) for plant in self.plants])

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


#: scans of a test sequence that run while a slider moves (30 ms); of a longer one its opening alone
_QUICK_SCANS: Final = 50_000


def first_look(
    fitted: FittedModel, settings: StudioSettings, gains: CandidateWords | None = None, *, whole: bool = True,
) -> LoopView:
    """Return the loop on the nominal heater; quick gains where none are given.

    Args:
        fitted: the heater.
        settings: what is asked for.
        gains: design and words.
        whole: False: of a test sequence that takes long its opening, heat-up and first event, is enough.

    Raises:
        NotRepresentable: the design does not fit the words.
        OutOfRange, InputError: the heater cannot hold the setpoint, the sensor does not see it, …
    """
    gains = gains or _quick(fitted, settings)
    conditions = gains.conditions or settings.conditions
    proof = chain.prove(gains.words, fitted, conditions, first_look=True if whole else _QUICK_SCANS)
    return LoopView(
        settings=settings, gains=gains, realised=proof.design, proof=proof, plants=_plants(fitted, settings),
        is_opening=not whole and len(proof.scenario.rests_s) == 2)  # heat-up and one event


def optimum(fitted: FittedModel, settings: StudioSettings, progress: ProgressCallback = str) -> CandidateWords:
    """Return the design and the words with which `heatertune design` begins for the same settings.

    Raises:
        InputError: no design keeps the limits.
        NotRepresentable: as in `first_look`.
    """
    request = _request(settings)
    design, choice = made_for(fitted, request, progress, str)
    words = with_cooling(choice.words, request.conditions.cooling_gain)
    words = with_pwm_period(controller_for(request.target).cycle, words, request.conditions.pwm_period_s)
    return CandidateWords(design=design, words=words, search=partial(search_document, choice, fitted),
                          notes=choice.search.notes)


#: the document of a proof, for every window once: it takes longer than a window may wait
document_of = lru_cache(8)(Proof.to_document)


def full_proof(fitted: FittedModel, look: LoopView, progress: ProgressCallback = str) -> Proof:
    """Return the proof of the same words on every heater under every open point; errors as in `first_look`."""
    proof = as_exported(chain.prove(look.gains.words, fitted, look.conditions, progress=progress))
    document_of(proof)
    return proof


def results_on_samples(fitted: FittedModel, look: LoopView) -> dict[str, Any]:
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
    result = find_passing_design(fitted, _request(settings), progress=progress)
    return DesignOutcome(result=result, gains=CandidateWords(
        design=result.ideal, words=result.proof.words, notes=(*result.choice.search.notes, *result.notes),
        search=partial(search_document, result.choice, fitted, result.notes),
        recipe=result.recipe, conditions=result.conditions, proof=result.proof))


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
