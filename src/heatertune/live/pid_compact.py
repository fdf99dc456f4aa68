"""PID_Compact and PID_Temp in a virtual PLC: a data block of the program's own, of standard access.

An instance DB of these instructions is optimised: S7 with PUT and GET does not reach it, whatever is permitted. So a
program copies what others are to see into a global DB without "optimised block access", and the CPU has to permit
PUT/GET. Which cells that DB has is the program's; here it is this simulator's own. What the instance remembers stays
behind it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from heatertune.live.layout import CellAddress, Laid, Layout, members
from heatertune.plc.pid_compact.words import COMPACT, TEMP, fields_of
from heatertune.plc.words import WordField

__all__ = ["PLACES", "POWER", "READING", "SETPOINT", "CompactBlock", "TempBlock"]

_REALS: Final = ("Setpoint", "Input", "Output", *(f.name for f in fields_of(COMPACT) if f.format == "REAL"))
#: name → its place; of PID_Temp all but InvertControl
PLACES: Final[Mapping[str, CellAddress]] = members([
    *((name, "REAL") for name in _REALS), ("IntegralResetMode", "INT"), ("Reset", "BOOL"), ("InvertControl", "BOOL")])
SETPOINT, READING, POWER = PLACES["Setpoint"], PLACES["Input"], PLACES["Output"]


def _layout(fields: Sequence[WordField]) -> Layout:
    return Layout(
        description="a global DB of standard access beside the instance", length=52, setpoint=SETPOINT, reading=READING,
        power=POWER, words={field.name: PLACES[field.name] for field in fields},
        inputs={name: PLACES[name] for name in ("Setpoint", "Input", "Reset")})


class CompactBlock(Laid):
    """DB1 beside a PID_Compact, 52 bytes; see `heatertune.live.layout.Laid`."""

    layout = _layout(fields_of(COMPACT))


class TempBlock(Laid):
    """DB1 beside a PID_Temp, likewise."""

    layout = _layout(fields_of(TEMP))
