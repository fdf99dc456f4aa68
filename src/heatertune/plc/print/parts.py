"""Parts of the program around a controller, described once for all languages.

What a setpoint ramp does says `heatertune.plc.ramp.next_setpoint`, what a PWM does `heatertune.plc.pwm.on_time`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Final

from heatertune.plc.print.statements import Group, if_
from heatertune.plc.ramp import Number, Ramp

__all__ = ["CELLS", "pulse_staircase", "setpoint_ramp"]

#: cell → what it holds, beside Asked, the setpoint asked for, Reading, and Lead, the setpoint on its way
CELLS: Final = {
    "Calls": "calls until the ramp's next step", "Size": "of the step in this call", "Ahead": "a step on",
    "Back": "a step back", "End": "how far the reading lets it go",
}


def setpoint_ramp(ramp: Ramp, write: Callable[[Number], str] = str) -> Iterator[Group]:
    """Yield the statements of one call: Lead moves a step towards Asked, or by what is left.

    A step of nothing leaves it where it is. A holdback keeps it near the reading on the side that heats, and ends its
    way back there. No reading or setpoint that is no number holds it up.

    Args:
        ramp: how it moves.
        write: a number of units → a constant of the language.
    """
    ahead, back, beyond, short = ("-", "+", "<", ">") if ramp.cools else ("+", "-", ">", "<")
    size, hold = write(ramp.step), "" if ramp.hold is None else write(abs(ramp.hold))
    if ramp.calls > 1:
        yield Group(f"setpoint ramp: a step in every {ramp.calls} calls, else none", "".join((
            f"Size := {write(0 * ramp.step)};\nCalls := Calls - 1;\n",
            if_("Calls <= 0", f"Size := {size}", f"Calls := {ramp.calls}"))))
        size = "Size"
    yield Group("setpoint ramp: a step back", f"Back := Lead {back} {size};\n")
    if hold:
        yield Group("not farther back than the holdback from the reading, and never forwards", "".join((
            f"End := Reading {back} {hold};\n", if_(f"Back {short} End", "Back := End"),
            if_(f"NOT (Back {short}= Lead)", "Back := Lead"))))
    yield Group("a step ahead, up to what is asked for; back only where that is not reached", "".join((
        f"Ahead := Lead {ahead} {size};\n", if_(f"NOT (Ahead {short}= Asked)", "Ahead := Asked"), "Lead := Ahead;\n",
        if_(f"Back {beyond} Lead", "Lead := Back"))))
    if hold:
        yield Group("never farther ahead than the holdback from the reading", "".join((
            f"End := Reading {ahead} {hold};\n", if_(f"Lead {beyond} End", "Lead := End"))))


def pulse_staircase(ticks: int, full: int, least: int, most: int) -> Iterator[Group]:
    """Yield the statements of one tick of a PWM without multiplication: the heater is on while Held >= Stair.

    At tick j of N the staircase stands at (2j + 1)·full/(2N), rounded up; Rest is what it is above that, in parts of
    2N. So the first ticks of a period are on: the nearest number of them, halves up. Above `full` a period begins, and
    Power is taken over.

    Args:
        ticks: of a period.
        full: power of all its ticks.
        least: smallest power with a pulse.
        most: largest power with a pause.
    """
    parts = 2 * ticks
    first, step = -(-full // parts), divmod(2 * full, parts)
    yield Group("PWM: the staircase rises", "".join((
        f"Stair := Stair + {step[0]};\nRest := Rest - {step[1]};\n",
        if_("Rest < 0", "Stair := Stair + 1", f"Rest := Rest + {parts}"))))
    yield Group("above full power a period begins; the power asked for is taken over", if_(
        f"Stair > {full}", f"Stair := {first}", f"Rest := {first * parts - full}", "Held := Power"))
    yield Group("a pulse or a pause that is too short is left out", "".join((
        if_(f"Held < {least}", "Held := 0"), if_(f"Held > {most}", f"Held := {full}"))))
