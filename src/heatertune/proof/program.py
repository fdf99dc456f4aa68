"""The program around the controller in the proof's loop: it sets the setpoint word, at once or on its ramp.

Plain functions of numbers, compiled with the kernel; `heatertune.plc.ramp` has the same law for one controller.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from heatertune.proof.meter import Places

__all__ = ["Program", "asked_now", "stored"]


class Program(NamedTuple):
    """The program around the controller, which sets its setpoint word; all numbers are in the controller's units.

    Attributes:
        asked: setpoint of each phase.
        supplied: whether the PLC has its supply in each phase; where it has it again, it starts up.
        ramp_step, ramp_calls, ramp_hold: of the words' setpoint ramp, see `heatertune.plc.ramp.Ramp`; no calls: no
            ramp; a hold of 0: none; one below zero: a
            cooler's, the mirror image.
        word: one place, for the setpoint word.
    """

    asked: Places
    supplied: Places
    ramp_step: Any
    ramp_calls: int
    ramp_hold: Any
    word: Places


def stored(_setpoint: Any) -> Any:
    """Stand in for the controller's own, a sum as the setpoint word holds it."""
    raise NotImplementedError


def asked_now(program: Program, phase: int, calls: int, reading: Any) -> int:
    """Set the setpoint word for a call of the controller; return how many there were since the start-up."""
    asked = program.asked[phase]
    if program.ramp_calls == 0:
        program.word[0] = asked
        return 1
    if calls == 0:
        program.word[0] = reading
    calls += 1
    hold, word, cools = program.ramp_hold, program.word[0], program.ramp_hold < 0
    if cools:
        hold, word, asked, reading = -hold, -word, -asked, -reading
    lowest = asked
    if hold > 0 and stored(reading - hold) > asked:
        lowest = stored(reading - hold)
    if calls % program.ramp_calls == 0:
        if word < asked:
            word = min(stored(word + program.ramp_step), asked)
        elif word > lowest:
            word = max(stored(word - program.ramp_step), lowest)
        elif not word > asked:  # also what is no number
            word = asked
    if hold > 0 and word > stored(reading + hold):
        word = stored(reading + hold)
    program.word[0] = -word if cools else word
    return calls
