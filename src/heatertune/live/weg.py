"""WEG's PID block in a virtual PLC: its interface as holding registers.

The SCA06 gives its parameters and the markers of its ladder as holding registers (SCA06, Ethernet communication module,
section 7.3); which markers a program ties the block to is the program's, and their addresses stand in a book that was
not at hand. So the map is this simulator's own: the interface in the manual's order from register 0 on, a REAL in two
registers, the high word first. The instance behind it nobody reaches.
"""

from __future__ import annotations

from typing import Any, Final

from heatertune.live.layout import ALL, MODBUS, Laid, Layout, members
from heatertune.plc.core import ControllerState
from heatertune.plc.ramp import Number
from heatertune.plc.weg.words import FIELDS

__all__ = ["LAYOUT", "MODE", "PLACES", "POWER", "READING", "SETPOINT", "WegBlock"]

#: name → its place; register r is at byte 2·r
PLACES: Final = members([
    ("EN", "UINT"), ("SetPoint", "REAL"), ("ManualSetPoint", "REAL"), ("SelectSetPoint", "UINT"), ("Feedback", "REAL"),
    ("MinimumOutput", "REAL"), ("MaximumOutput", "REAL"), ("Kp", "REAL"), ("Ki", "REAL"), ("Kd", "REAL"),
    ("TauSetPoint", "REAL"), ("Type", "UINT"), ("Action", "UINT"), ("Ts", "UINT"), ("ENO", "UINT"), ("Output", "REAL"),
])
SETPOINT, READING, POWER, MODE = (PLACES[name] for name in ("SetPoint", "Feedback", "Output", "SelectSetPoint"))
LAYOUT: Final = Layout(
    description="interface of the block PID", speaks=MODBUS, length=PLACES["Output"].part.stop, setpoint=SETPOINT,
    reading=READING, power=POWER, mode=MODE, manual_is=1,
    hand=PLACES["ManualSetPoint"], words={field.name: PLACES[field.name] for field in FIELDS},
    inputs={name: PLACES[name] for name in ("EN", "SetPoint", "ManualSetPoint", "SelectSetPoint", "Feedback")},
    first={PLACES["EN"]: 1}, anew=ALL)


class WegBlock(Laid):
    """Registers 0 to 25; see `heatertune.live.layout.Laid`."""

    layout = LAYOUT

    def tell(self, cells: bytearray, running: ControllerState, after: Any, output: Number) -> None:
        """Write Output, and ENO, which follows EN."""
        super().tell(cells, running, after, output)
        PLACES["ENO"].write(cells, bool(PLACES["EN"].read(cells)))
