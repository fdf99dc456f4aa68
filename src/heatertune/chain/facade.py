"""The functions of the stages for interactive use, with any heater and any controller parameters.

Also planning an experiment from prior knowledge of a heater, and validating a model against another log. If that log
has no power, a known controller provides it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

from heatertune.cache import load_or_compute
from heatertune.errors import InputError
from heatertune.log.log_values import Log
from heatertune.model.experiment.fisher import ExperimentSetup, ReadingNoise, prior_by_hand, prior_of
from heatertune.model.experiment.plan import propose, to_document
from heatertune.model.model_values import FittedModel, HeaterModel
from heatertune.model.power.known_controller import replay_controller
from heatertune.model.validate import Verdict
from heatertune.model.validate import validate as judge
from heatertune.options import checked_arguments, with_options
from heatertune.pid import sampled_loop as robustness
from heatertune.pid.design_values import Margins, PidDesign
from heatertune.pid.sampled_loop import iae_load as load_iae
from heatertune.plc import Words, controller_for
from heatertune.plc.core import RunningController
from heatertune.processors import ProgressCallback
from heatertune.proof import Actuator, Interlock, Scenario, Trace
from heatertune.proof import simulate as simulate_loop
from heatertune.proof.heaters import ROOM_DEGC
from heatertune.proof.known_controller_check import controllers
from heatertune.proof.prove_words import actuator_for, course_for
from heatertune.proof.scenario import delay_heater
from heatertune.settings import Conditions, ValidateSettings

if TYPE_CHECKING:
    from typing import Unpack

    from heatertune.keywords import ValidateOptions

__all__ = ["controller", "decode", "iae_load", "margins", "plan", "simulate", "validate"]


def plan(
    believed: FittedModel | Mapping[str, tuple[float, float]], *, limit_degC: float, noise: ReadingNoise,
    ambient_degC: float | None = None, longest_s: float | None = None, kind: str = "best",
    progress: ProgressCallback = str, **settings: float,
) -> dict[str, Any]:
    """Return the most informative experiment and its expected accuracy, as a document.

    It is cached, because the search takes seconds; see `heatertune.cache`.

    Args:
        believed: prior knowledge: a fitted model, or quantity → (low, high), see `experiment.QUANTITIES`.
        limit_degC: temperature that no heater of the prior may exceed [°C].
        noise: of the readings; see `heatertune.model.experiment.fisher.noise_of`.
        ambient_degC: ambient, if it will be known in the fit after the experiment [°C].
        longest_s: longest duration [s]; None: six times the slowest heater's lags and dead time.
        kind: "doublet", "relay", or "best" of both.
        progress: called with a short message when a stage begins.
        settings: base_pct, least_pct, most_pct, aim, see `experiment.ExperimentSetup`.

    Raises:
        OutOfRange, InputError: as `propose`; a range that is missing or impossible for a heater.
    """
    if isinstance(believed, FittedModel):
        prior = prior_of(believed, ambient_degC=ambient_degC, assumed_degC=ROOM_DEGC)
    else:
        ambient = {} if ambient_degC is None else {"ambient_degC": (ambient_degC, ambient_degC)}
        prior = prior_by_hand(dict(believed) | ambient, ambient_known=ambient_degC is not None)
    setup = ExperimentSetup(
        limit_degC=limit_degC, noise=noise, longest_s=prior.longest_s if longest_s is None else longest_s,
        **settings,
    )
    inputs = {"models": {label: repr(model) for label, model in prior.models.items()}, "setup": asdict(setup),
              "ambient_known": prior.ambient_known, "kind": kind}

    def run() -> dict[str, Any]:
        return to_document(prior, setup, propose(prior, setup, kind=kind, progress=progress))

    return load_or_compute("plan", inputs, run, dict, progress=progress)


@with_options(ValidateSettings)
def validate(
    fitted: FittedModel, log: Log, settings: ValidateSettings | None = None, *, words: Words | None = None,
    setpoint_degC: float | None = None, stated: Mapping[str, str] | None = None, **changed: Unpack[ValidateOptions],
) -> Verdict:
    """Validate a model on another log of its heater; arguments and errors as `heatertune.model.validate.validate`.

    Args:
        fitted: the model.
        log: with power, or without if words are given.
        settings: of the validation; None: the defaults.
        words: controller parameters during a log without power; open points have their defaults.
        setpoint_degC: its setpoint [°C]; None: as logged.
        stated: open point → known setting of this controller.
        changed: fields of `ValidateSettings` that differ from `settings`.

    Raises:
        InputError: words for a log with power, or no setpoint.
        UnknownName: no such open point or setting.
    """
    if words is None:
        return judge(fitted, log, settings, **changed)
    controller = controllers(words, stated)[0]
    verdict = judge(fitted, replay_controller(log, controller, setpoint_degC), settings, **changed)
    note = f"The power was not logged; {controller.name} was run on the readings, from a cold start at the first one."
    return replace(verdict, notes=(note, *verdict.notes))


@checked_arguments
def controller(words: Words, **switches: str) -> RunningController:
    """Return `words.controller(**switches)`."""
    return words.controller(**switches)


@checked_arguments
def margins(heater: HeaterModel | FittedModel, what: PidDesign | Words) -> Margins:
    """Return Ms, Mt, gain and phase margin of the sampled loop; Ms and Mt are infinite if it is unstable.

    Args:
        heater: of a fit, the working model.
        what: a design, or words, which are decoded to the design that they realise.

    Raises:
        InputError, OutOfRange: as `decode`.
    """
    return robustness.margins(_model(heater), _design(what))


@checked_arguments
def iae_load(heater: HeaterModel | FittedModel, what: PidDesign | Words) -> float:
    """Return the integral of the absolute error after a load step of 1 % power in the linear loop [°C·s].

    It is infinite if an offset stays or the loop is unstable; arguments and errors are as in `margins`.
    """
    return load_iae(_model(heater), _design(what))


@checked_arguments
def decode(words: Words) -> PidDesign:
    """Return the design that words really run.

    Raises:
        InputError: words that are no PID constants.
        OutOfRange: words that their controller does not allow, or that have no standard form.
    """
    design = controller_for(words.target).decode(words)
    if design is None:
        raise InputError(f"these words of {words.target} are no PID constants; simulate runs them")
    return design


@checked_arguments
def simulate(
    words: Words, heater: HeaterModel | FittedModel, scenario: Scenario | float, actuator: Actuator | None = None, *,
    switches: Mapping[str, str] | None = None, interlock: Interlock | None = None,
) -> Trace:
    """Simulate a heater controlled by a PLC with these parameters, with the delay of its input module and output.

    Args:
        words: the controller parameters, with their target.
        heater: of a fit, the working model.
        scenario: the test; a number is the setpoint for the proof's own test sequence [°C].
        actuator: None: as in a proof without a PWM period. Not used if the controller generates the PWM.
        switches: open point → setting; others have their default.
        interlock: may switch the heater off permanently; None: no interlock.

    Raises:
        InputError: an unknown ambient temperature.
        OutOfRange: a setpoint outside the sensor's range or out of the heater's reach, words out of their range.
        UnknownName: no such open point or setting.
    """
    controller, model = controller_for(words.target), _model(heater)
    happens = (scenario if isinstance(scenario, Scenario)
               else course_for(words, [model], Conditions(), float(scenario)).scenario)
    switch = actuator_for(Conditions(), words) if actuator is None else actuator
    late = delay_heater(model, controller.delayed_s(words.scaling))
    return simulate_loop(controller, words, late, happens, switch, switches, interlock)


def _design(what: PidDesign | Words) -> PidDesign:
    return decode(what) if isinstance(what, Words) else what


def _model(heater: HeaterModel | FittedModel) -> HeaterModel:
    return heater.model if isinstance(heater, FittedModel) else heater
