"""The program around the controller in the proof's loop: it sets the setpoint word, at once or on its ramp.

Plain functions of numbers, compiled with the kernel; `heatertune.plc.ramp` has the same law for one controller.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from heatertune.compiled.plain_functions import setpoint_word
from heatertune.proof.meter import Places

__all__ = ["SetpointProgram", "asked_now", "moves"]


class SetpointProgram(NamedTuple):
    """The program around the controller, which sets its setpoint word; all numbers are in the controller's units.

    Attributes:
        asked: setpoint of each phase.
        supplied: whether the PLC has its supply in each phase; where it has it again, it starts up.
        ramp_step, ramp_calls, ramp_hold: of the words' setpoint ramp, see `heatertune.plc.ramp.Ramp`; no calls: no
            ramp; a hold of 0: none; one below zero: a cooler's, the mirror image.
    """

    setpoints: Places
    supplied: Places
    ramp_step: Any
    ramp_calls: int
    ramp_hold: Any


def moves(program: SetpointProgram, calls: int) -> bool:
    """Return whether the ramp makes a step at a call of the controller, `calls` others being before it."""
    return program.ramp_calls > 0 and (calls + 1) % program.ramp_calls == 0


def asked_now(program: SetpointProgram, asked: Any, first: bool, due: bool, word: Any, reading: Any) -> Any:
    """Return the setpoint word for a call of the controller.

    Args:
        program: around it.
        asked: setpoint of the phase.
        first: whether it is the first call since the start-up.
        due: whether the ramp makes a step, see `moves`.
        word: of the call before.
        reading: at this call.
    """
    if program.ramp_calls == 0:
        return asked
    word = reading if first else word
    hold, cools = program.ramp_hold, program.ramp_hold < 0
    if cools:
        hold, word, asked, reading = -hold, -word, -asked, -reading
    lowest = asked
    if hold > 0 and setpoint_word(reading - hold) > asked:
        lowest = setpoint_word(reading - hold)
    if due:
        if word < asked:
            word = min(setpoint_word(word + program.ramp_step), asked)
        elif word > lowest:
            word = max(setpoint_word(word - program.ramp_step), lowest)
        elif not word > asked:  # also what is no number
            word = asked
    if hold > 0 and word > setpoint_word(reading + hold):
        word = setpoint_word(reading + hold)
    return -word if cools else word
