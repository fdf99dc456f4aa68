"""Setpoint ramp and boost: how the program around a controller approaches a new setpoint.

The ramp moves the setpoint word from the reading to the requested setpoint. OB251's manual advises it (S5-115U, order
no. 4NEB 811 6130, table 11-11, footnote 1): large changes of the error are to be divided into small ones. Gains, and
with them the response to disturbances, stay the same.

The boost applies full power far from the setpoint with the controller disabled, so that no integral is accumulated: it
starts at zero near the setpoint, after an open heater circuit as in the heat-up.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

from heatertune.errors import OutOfRange
from heatertune.plc.single_precision import is_single, single
from heatertune.units import check

__all__ = ["Boost", "Number", "Ramp", "nearest", "next_setpoint"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Boost:
    """Where the controller has the heater, and where the program around it has.

    Attributes:
        within_degC: on its way to the setpoint, at this distance or less, the controller is enabled [°C].
        again_degC: farther from it than this the program takes the heater back [°C]; what noise and the sensor's steps
            do to the reading has to be less than what lies between.

    Raises:
        OutOfRange: a distance that is not positive or not in single precision, or the second one not above the first.
    """

    within_degC: float
    again_degC: float

    def __post_init__(self) -> None:
        check("boost within_degC", self.within_degC, above=0.0)
        check("boost again_degC", self.again_degC, above=self.within_degC)
        for name in ("within_degC", "again_degC"):
            if not is_single(getattr(self, name)):
                raise OutOfRange(f"boost {name}", getattr(self, name), "a number in single precision")

    def __str__(self) -> str:
        """Return it as told to people."""
        return (f"full power until {self.within_degC:.7g} °C from the setpoint, and again where it is more than "
                f"{self.again_degC:.7g} °C off")


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

    With a holdback, as ramp controllers of kilns have it, the error that the controller sees stays small while the
    reading cannot follow, and so what its integral winds up by: the word is never more than `hold` above the reading,
    and falls with it; down it goes no farther than `hold` below the reading, and stays where it is meanwhile, for
    raised it would keep up a heater that is too hot. A cooler's is the mirror image, up for down.

    Attributes:
        step: [units of the setpoint word]; whole where the word is.
        calls: of the controller, from one step to the next.
        hold: the farthest from the reading [units], below zero a cooler's; None: as far as the ramp goes.

    Raises:
        OutOfRange: a step that is not positive, a holdback of nothing, one that the word's format cannot hold or in
            another format than the step, calls that are not whole or not 1…32767.
    """

    step: Number
    calls: int = 1
    hold: Number | None = None

    def __post_init__(self) -> None:
        _check_size("ramp step", self.step)
        if self.hold is not None:
            _check_size("ramp hold", abs(self.hold))
            if isinstance(self.hold, float) != isinstance(self.step, float):
                raise OutOfRange("ramp hold", self.hold, f"of one kind with the step, {self.step!r}")
        if isinstance(self.calls, bool) or not isinstance(self.calls, int) or not 1 <= self.calls <= _MOST_CALLS:
            raise OutOfRange("ramp calls", self.calls, f"a whole number 1…{_MOST_CALLS}")

    def __str__(self) -> str:
        """Return it as told to people."""
        unit = "units" if isinstance(self.step, int) else "°C"
        holdback = "" if self.hold is None else f", held within {abs(self.hold):.9g} {unit} of the reading"
        cooler = " (of a cooler)" if self.cools else ""
        return f"{self.step:.9g} {unit} every {'call' if self.calls == 1 else f'{self.calls} calls'}{holdback}{cooler}"

    @property
    def cools(self) -> bool:
        """Whether the holdback is a cooler's."""
        return self.hold is not None and self.hold < 0


def next_setpoint(setpoint: Number, target: Number, ramp: Ramp, reading: Number, *, due: bool = True) -> Number:
    """Return the setpoint at the next call of the controller; sums of REALs round once.

    Args:
        setpoint: at the call before.
        target: where it goes to.
        ramp: how.
        reading: at this call.
        due: whether this call makes a step; a step leaves what is no number at once.
    """
    if ramp.hold is not None and ramp.cools:
        return -next_setpoint(-setpoint, -target, replace(ramp, hold=-ramp.hold), -reading, due=due)
    lowest = target if ramp.hold is None else max(target, _stored(reading - ramp.hold, ramp.step))  # nan: asked
    if not due:
        pass
    elif setpoint < target:
        setpoint = min(_stored(setpoint + ramp.step, ramp.step), target)
    elif setpoint > lowest:
        setpoint = max(_stored(setpoint - ramp.step, ramp.step), lowest)
    elif not setpoint > target:
        setpoint = target
    if ramp.hold is None:
        return setpoint
    highest = _stored(reading + ramp.hold, ramp.step)
    return highest if setpoint > highest else setpoint


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


def _check_size(name: str, size: Number) -> None:
    check(name, size, above=0.0)
    if isinstance(size, float) and not is_single(size):
        raise OutOfRange(name, size, "a whole number, or one in single precision")
