"""The instance data block of the PID tip in a virtual PLC, DB100 as the export has it.

The four words stand where the document has them, all else where the exported function block does: its state is whole
in there. The exported OB35 takes the mode from DB101; here a client writes mode_req, and OUT in manual.
"""

from __future__ import annotations

from typing import Final

from heatertune.live.layout import WORDS, CellAddress, Laid, Layout
from heatertune.live.memory import Signal
from heatertune.plc.cpu.s7_300.hardware import FULL_SCALE
from heatertune.plc.cpu.s7_300.machine import place
from heatertune.plc.s7_300.words import FIELDS

__all__ = ["LAYOUT", "MODE", "POWER", "READING", "SETPOINT", "PidTipBlock"]

MODE: Final = CellAddress(0, "BOOL", 0)  # mode_req
READING: Final = CellAddress(2, "INT")  # PV
SETPOINT: Final = CellAddress(4, "INT")  # SP
POWER: Final = CellAddress(6, "INT")  # OUT
LAYOUT: Final = Layout(
    number=100, description="instance of the PID tip", length=36, setpoint=SETPOINT, reading=READING, power=POWER,
    mode=MODE,
    words={field.name: CellAddress(place(field.address)[0], field.format) for field in FIELDS},
    inputs={"mode_req": MODE, "SP": SETPOINT, "PV": READING, "OUT": POWER},
    state={
        "output": POWER, "overflow": CellAddress(8, "BOOL", 0), "bias": CellAddress(26, "REAL"),
        "reading": CellAddress(30, "REAL"),
        "started": CellAddress(34, "BOOL", 0),
    },
    anew=WORDS)  # OB100 loads the four words


class PidTipBlock(Laid):
    """DB100, 36 bytes; see `heatertune.live.layout.Laid`."""

    layout = LAYOUT

    def _signals(self, degC: tuple[float, float]) -> dict[str, Signal]:
        full = (0, FULL_SCALE)
        return {"temperature": self._signal(READING, full, degC), "power": self._signal(POWER, full, (0, 100)),
                "setpoint": self._signal(SETPOINT, full, degC)}
