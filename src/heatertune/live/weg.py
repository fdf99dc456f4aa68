"""WEG's PID block in a virtual PLC: its interface as holding registers.

The SCA06 gives its parameters and the markers of its ladder as holding registers (SCA06, Ethernet communication module,
section 7.3); which markers a program ties the block to is the program's, and their addresses stand in a book that was
not at hand. So the map is this simulator's own: the interface in the manual's order from register 0 on, a REAL in two
registers, the high word first. The instance behind it nobody reaches.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import accumulate
from typing import ClassVar, Final

from heatertune.live.layout import MODBUS, Laid, Place
from heatertune.plc.ramp import Number
from heatertune.plc.weg.words import FIELDS

__all__ = ["LENGTH", "MODE", "PLACES", "POWER", "READING", "SETPOINT", "WegBlock"]

_INTERFACE: Final = (
    ("EN", "UINT"), ("SetPoint", "REAL"), ("ManualSetPoint", "REAL"), ("SelectSetPoint", "UINT"), ("Feedback", "REAL"),
    ("MinimumOutput", "REAL"), ("MaximumOutput", "REAL"), ("Kp", "REAL"), ("Ki", "REAL"), ("Kd", "REAL"),
    ("TauSetPoint", "REAL"), ("Type", "UINT"), ("Action", "UINT"), ("Ts", "UINT"), ("ENO", "UINT"), ("Output", "REAL"),
)
_ENDS: Final = list(accumulate((4 if format_ == "REAL" else 2 for _, format_ in _INTERFACE), initial=0))
#: name → its place; register r is at byte 2·r
PLACES: Final[Mapping[str, Place]] = {
    name: Place(byte, format_) for (name, format_), byte in zip(_INTERFACE, _ENDS[:-1], strict=True)}
LENGTH: Final = _ENDS[-1]
SETPOINT, READING, POWER = PLACES["SetPoint"], PLACES["Feedback"], PLACES["Output"]
MODE: Final = PLACES["SelectSetPoint"]


class WegBlock(Laid):
    """Registers 0 to 26; see `heatertune.live.layout.Laid`."""

    told = "interface of the block PID"
    speaks = MODBUS
    LENGTH, SETPOINT, READING, POWER, MODE = LENGTH, SETPOINT, READING, POWER, MODE
    AUTOMATIC, MANUAL = 0, 1
    WORDS: ClassVar[Mapping[str, Place]] = {field.name: PLACES[field.name] for field in FIELDS}
    INPUTS: ClassVar[Mapping[str, Place]] = {
        name: PLACES[name] for name in ("EN", "SetPoint", "ManualSetPoint", "SelectSetPoint", "Feedback")}
    FIRST: ClassVar[Mapping[Place, Number]] = {PLACES["EN"]: 1}
