"""The cooler beside a heater, as words and switch know it."""

from __future__ import annotations

from dataclasses import replace

from heatertune.errors import InputError
from heatertune.plc.controller import controller_for
from heatertune.plc.pwm import Actuator
from heatertune.plc.targets import COOLING
from heatertune.plc.words import Words

__all__ = ["with_cooler", "with_cooling"]


def with_cooling(words: Words, cooling_gain: float | None) -> Words:
    """Return words for a cooler whose full power is so many times the heater's; as they are where none is told.

    Raises:
        NotRepresentable: a gain that they can't hold.
    """
    cooling = controller_for(words.target).cooling
    return words if cooling is None or cooling_gain is None else cooling.words(words, cooling_gain)


def with_cooler(
    actuator: Actuator, words: Words, cooling_gain: float | None, *, minimum_on_s: float | None = None,
    minimum_off_s: float | None = None,
) -> Actuator:
    """Return a switch with the cooler's where the controller has an output for one.

    Args:
        actuator: of the heater.
        words: that run.
        cooling_gain: full power of the cooler as a part of the heater's; None: as the words say.
        minimum_on_s: shortest pulse of the cooler; None: any [s].
        minimum_off_s: its shortest pause [s].

    Raises:
        InputError: a cooler that the controller has no output for.
        OutOfRange: words that don't say how strong it is, or times that leave no pulse.
    """
    cooling = controller_for(words.target).cooling
    if cooling is None:
        if cooling_gain is not None:
            raise InputError(f"{words.target} has no second output for a cooler; {', '.join(COOLING.values())} has one")
        return actuator
    gain = cooling.gain(words) if cooling_gain is None else cooling_gain
    return replace(actuator, cooling_gain=gain, cooling_minimum_on_s=minimum_on_s, cooling_minimum_off_s=minimum_off_s)
