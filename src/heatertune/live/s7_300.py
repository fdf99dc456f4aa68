"""The instance data block of the PID tip in a virtual PLC, DB100 as the export has it.

The four words stand where the document has them, all else where the exported function block does: its state is whole
in there. The exported OB35 takes the mode from DB101; here a client writes mode_req, and OUT in manual.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Final

from heatertune.live.layout import Laid, Place
from heatertune.plc.cpu.s7_300.memory import place
from heatertune.plc.s7_300.words import FIELDS

__all__ = ["LENGTH", "MODE", "POWER", "READING", "SETPOINT", "PidTipBlock"]

LENGTH: Final = 36
MODE: Final = Place(0, "BOOL", 0)  # mode_req
READING: Final = Place(2, "INT")  # PV
SETPOINT: Final = Place(4, "INT")  # SP
POWER: Final = Place(6, "INT")  # OUT


class PidTipBlock(Laid):
    """DB100, 36 bytes; see `heatertune.live.layout.Laid`."""

    number = 100
    told = "instance of the PID tip"
    LENGTH, SETPOINT, READING, POWER, MODE = LENGTH, SETPOINT, READING, POWER, MODE
    reloads = True  # OB100 loads the four words
    WORDS: ClassVar[Mapping[str, Place]] = {field.name: Place(place(field.address)[0], field.format) for field in FIELDS}
    INPUTS: ClassVar[Mapping[str, Place]] = {"mode_req": MODE, "SP": SETPOINT, "PV": READING, "OUT": POWER}
    STATE: ClassVar[Mapping[str, Place]] = {
        "output": POWER, "overflow": Place(8, "BOOL", 0), "bias": Place(26, "REAL"), "reading": Place(30, "REAL"),
        "started": Place(34, "BOOL", 0),
    }
