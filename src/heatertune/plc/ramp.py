"""A setpoint that moves: the program around the controller leads its setpoint word from the reading to what is asked.

OB251's manual advises it (S5-115U, order no. 4NEB 811 6130, table 11-11, footnote 1): large changes of the error are to
be divided into small ones, as by a ramp of the setpoint. The gains, and with them what a disturbance costs, stay as
they are.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from heatertune.errors import OutOfRange
from heatertune.plc.single import is_single, single
from heatertune.units import check

__all__ = ["Number", "Ramp", "course", "moved", "nearest"]

#: a word or reading: whole, or a REAL (single precision) in controllers that have them
Number = int | float

#: a countdown is a word of 16 bits with sign
_MOST_CALLS: Final = 32767
#: a realised rate is as near to the wished one as this
_NEAR: Final = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class Ramp:
    """How the setpoint word moves.

    After a restart the word holds the reading. Before every `calls`-th call of the controller it moves by `step`
    towards what is asked for, and by what is left where that is less.

    Attributes:
        step: [units of the setpoint word]; whole where the word is.
        calls: of the controller, from one step to the next.

    Raises:
        OutOfRange: a step that is not positive or that the word's format cannot hold, calls that are not whole or not
            1…32767.
    """

    step: Number
    calls: int = 1

    def __post_init__(self) -> None:
        check("ramp step", self.step, above=0.0)
        if isinstance(self.step, float) and not is_single(self.step):
            raise OutOfRange("ramp step", self.step, "a whole number, or one in single precision")
        if isinstance(self.calls, bool) or not isinstance(self.calls, int) or not 1 <= self.calls <= _MOST_CALLS:
            raise OutOfRange("ramp calls", self.calls, f"a whole number 1…{_MOST_CALLS}")

    def __str__(self) -> str:
        """Return it as told to people."""
        return f"{self.step:.9g} units every {'call' if self.calls == 1 else f'{self.calls} calls'}"


def moved(setpoint: Number, asked: Number, step: Number) -> Number:
    """Return the setpoint one step nearer to what is asked for; REALs round once, what is no number is left at once."""
    if setpoint < asked:
        return min(_stored(setpoint + step, step), asked)
    if setpoint > asked:
        return max(_stored(setpoint - step, step), asked)
    return asked


def course(ramp: Ramp | None, begin: Number, asked: Number, calls: int) -> list[Number]:
    """Return the setpoint word at each call of the controller; without a ramp it is what is asked for from the first.

    Args:
        ramp: None: none.
        begin: the word after the restart: the reading.
        asked: where it goes to.
        calls: how many calls.
    """
    if ramp is None:
        return [asked] * calls
    word, followed = begin, []
    for call in range(1, calls + 1):
        if call % ramp.calls == 0:
            word = moved(word, asked, ramp.step)
        followed.append(word)
    return followed


def nearest(per_call: float, *, whole: bool, least: float) -> Ramp:
    """Return the ramp for a rate, within 5 % of it.

    Whole steps: with the fewest calls that come so near. REALs: steps of one count of the input module or more, for a
    step far below the last digit of the setpoint would move nothing.

    Args:
        per_call: wished rate [units per call].
        whole: whether the setpoint word is whole.
        least: smallest step of a REAL [units].

    Raises:
        OutOfRange: a rate so slow that 32767 calls do not make a step.
    """
    check("setpoint ramp in units per call", per_call, above=0.0)
    least = 1.0 / (1.0 + _NEAR) if whole else least
    for calls in range(max(1, math.floor(min(least / per_call, _MOST_CALLS + 1))), _MOST_CALLS + 1):
        wished = per_call * calls
        if whole and round(wished) >= 1 and abs(round(wished) - wished) <= _NEAR * wished:
            return Ramp(step=round(wished), calls=calls)
        if not whole and wished >= least:
            return Ramp(step=single(wished), calls=calls)
    rule = f"> {least / _MOST_CALLS:.3g}, a step in {_MOST_CALLS} calls"
    raise OutOfRange("setpoint ramp in units per call", per_call, rule)


def _stored(value: Number, step: Number) -> Number:
    return value if isinstance(step, int) else single(value)
