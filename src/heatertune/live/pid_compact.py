"""PID_Compact and PID_Temp in a virtual PLC: a data block of the program's own, of standard access.

An instance DB of these instructions is optimised: S7 with PUT and GET does not reach it, whatever is permitted. So a
program copies what others are to see into a global DB without "optimised block access", and the CPU has to permit
PUT/GET. Which cells that DB has is the program's; here it is this simulator's own. What the instance remembers stays
behind it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Final

from heatertune.live.layout import Laid, Place, members
from heatertune.plc import Words
from heatertune.plc.controller import Controller
from heatertune.plc.pid_compact.words import COMPACT, fields_of

__all__ = ["LENGTH", "PLACES", "POWER", "READING", "SETPOINT", "PidBlock"]

_REALS: Final = ("Setpoint", "Input", "Output", *(f.name for f in fields_of(COMPACT) if f.format == "REAL"))
#: name → its place; of PID_Temp all but InvertControl
PLACES: Final[Mapping[str, Place]] = members([
    *((name, "REAL") for name in _REALS), ("IntegralResetMode", "INT"), ("Reset", "BOOL"), ("InvertControl", "BOOL")])
LENGTH: Final = 52
SETPOINT, READING, POWER = PLACES["Setpoint"], PLACES["Input"], PLACES["Output"]


class PidBlock(Laid):
    """DB1, 52 bytes; see `heatertune.live.layout.Laid`."""

    told = "a global DB of standard access beside the instance"
    LENGTH, SETPOINT, READING, POWER = LENGTH, SETPOINT, READING, POWER
    INPUTS: ClassVar[Mapping[str, Place]] = {name: PLACES[name] for name in ("Setpoint", "Input", "Reset")}

    def __init__(self, controller: Controller, words: Words, assume: object) -> None:
        """Take words of one of both."""
        self.WORDS = {field.name: PLACES[field.name] for field in controller.fields}  # type: ignore[misc]
        super().__init__(controller, words, assume)
