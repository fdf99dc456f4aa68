"""The setpoint on its way, described once for all languages; `heatertune.plc.ramp.next_setpoint` says what it does."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from heatertune.plc.print.statements import Group, if_
from heatertune.plc.ramp import Number, Ramp

__all__ = ["CELLS", "setpoint_ramp"]

#: cell → what it holds, beside Asked, the setpoint asked for, Reading, and Lead, the setpoint on its way
CELLS: Final = {
    "Calls": "calls until the ramp's next step", "Size": "of the step in this call", "Ahead": "a step on",
    "Back": "a step back", "End": "how far the reading lets it go",
}


def setpoint_ramp(ramp: Ramp, write: Callable[[Number], str] = str) -> Group:
    """Return the statements of one call: Lead moves a step towards Asked, or by what is left.

    A step of nothing leaves it where it is. A holdback keeps it near the reading on the side that heats, and ends its
    way back there. No reading or setpoint that is no number holds it up.

    Args:
        ramp: how it moves.
        write: a number of units → a constant of the language.
    """
    ahead, back, beyond, short = ("-", "+", "<", ">") if ramp.cools else ("+", "-", ">", "<")
    size, end, hold = write(ramp.step), "Asked", "" if ramp.hold is None else write(abs(ramp.hold))
    lines = list[str]()
    if ramp.calls > 1:
        lines += [f"Size := {write(0 * ramp.step)};\n", "Calls := Calls - 1;\n",
                  if_("Calls <= 0", f"Size := {size}", f"Calls := {ramp.calls}")]
        size = "Size"
    if hold:
        lines += [f"End := Reading {back} {hold};\n", if_(f"NOT (End {beyond}= Asked)", "End := Asked")]
        end = "End"
    lines += [
        f"Back := Lead {back} {size};\n", if_(f"NOT (Back {beyond}= {end})", f"Back := {end}"),
        if_(f"NOT (Back {short}= Lead)", "Back := Lead"),
        f"Ahead := Lead {ahead} {size};\n", if_(f"NOT (Ahead {short}= Asked)", "Ahead := Asked"),
        "Lead := Ahead;\n", if_(f"Back {beyond}= Lead", "Lead := Back")]
    if hold:
        lines += [f"End := Reading {ahead} {hold};\n", if_(f"Lead {beyond} End", "Lead := End")]
    return Group("setpoint ramp", "".join(lines))
