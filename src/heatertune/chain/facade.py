"""Doors for a session by hand: the stages' own functions, for whatever heater and words are at hand."""

from __future__ import annotations

from collections.abc import Mapping

from heatertune.errors import InputError
from heatertune.model.values import FittedModel, HeaterModel
from heatertune.pid.loop import response, robustness
from heatertune.pid.values import Margins, PidDesign
from heatertune.plc import Words, controller_for
from heatertune.plc.scan_by_scan import RunningController
from heatertune.proof import Actuator, Interlock, Scenario, Trace
from heatertune.proof import simulate as simulate_loop
from heatertune.proof.prove_words import actuator_for, course_for
from heatertune.proof.scenario import delay_heater
from heatertune.settings import Conditions

__all__ = ["controller", "decode", "iae_load", "margins", "simulate"]


def controller(words: Words, **switches: str) -> RunningController:
    """Return `words.controller(**switches)`."""
    return words.controller(**switches)


def margins(heater: HeaterModel | FittedModel, what: PidDesign | Words) -> Margins:
    """Return Ms, Mt, gain and phase margin of the sampled loop; Ms and Mt are infinite where it is unstable.

    Args:
        heater: of a fit, the working model.
        what: a design, or words, which stand for the design that they really run.

    Raises:
        InputError, OutOfRange: as `decode`.
    """
    return robustness.margins(_model(heater), _design(what))


def iae_load(heater: HeaterModel | FittedModel, what: PidDesign | Words) -> float:
    """Return the integral of the absolute error after a load step of 1 % power in the linear loop [°C·s].

    It is infinite where an offset stays or the loop is unstable; arguments and errors are as in `margins`.
    """
    return response.iae_load(_model(heater), _design(what))


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


def simulate(
    words: Words, heater: HeaterModel | FittedModel, scenario: Scenario | float, actuator: Actuator | None = None, *,
    switches: Mapping[str, str] | None = None, interlock: Interlock | None = None,
) -> Trace:
    """Return what a heater does when the PLC runs these words, the delay of its input module and output included.

    Args:
        words: what the PLC holds; they know their controller.
        heater: of a fit, the working model.
        scenario: what happens; a number is the setpoint in the proof's own story [°C].
        actuator: the switch; None: as in a proof without a PWM period. Not used where the controller makes the PWM.
        switches: switch → setting of what the manual leaves open; those not named have their default.
        interlock: what may switch the heater off for good; None: nothing.

    Raises:
        InputError: an unknown ambient temperature.
        OutOfRange: a setpoint outside the sensor's range or out of the heater's reach, words out of their range.
        UnknownName: a switch or setting that the controller does not have.
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
