"""The repaired PID of IEC 61131-3 in a virtual PLC: located variables, as OpenPLC gives them to Modbus.

OpenPLC's own documentation (Modbus addressing): %MD0 is the holding registers 2048 and 2049; the high word is first.
A program locates them as it likes; here they stand one after the other. The instance is not located, so nobody reaches
its memory.
"""

from __future__ import annotations

from typing import Final

from heatertune.live.layout import ALL, MODBUS, Laid, Layout, registers
from heatertune.plc.iec_pid.words import FIELDS

__all__ = ["LAYOUT", "MODE", "PLACES", "POWER", "READING", "SETPOINT", "IecPidBlock"]

#: register of %MD0
_MD: Final = 2048
_FORMATS: Final = {"CYCLE": "TIME", "RUN": "DINT", "AUTO": "DINT"}
#: name → its place, and the run of registers
PLACES, _RUNS = registers({
    name: (_MD + 2 * number, _FORMATS.get(name, "REAL"))
    for number, name in enumerate(("SP", "PV", "XOUT", "X0", "AUTO", "RUN", *(field.name for field in FIELDS)))})
SETPOINT, READING, POWER, MODE = (PLACES[name] for name in ("SP", "PV", "XOUT", "AUTO"))
LAYOUT: Final = Layout(
    description="%MD0 to %MD11", speaks=MODBUS, registers=_RUNS, length=2 * sum(run.size for run in _RUNS),
    setpoint=SETPOINT, reading=READING, power=POWER, mode=MODE, hand=PLACES["X0"],
    words={field.name: PLACES[field.name] for field in FIELDS},
    inputs={name: PLACES[name] for name in ("RUN", "AUTO", "SP", "PV", "X0")}, first={PLACES["RUN"]: 1}, anew=ALL)


class IecPidBlock(Laid):
    """Registers 2048 to 2071; see `heatertune.live.layout.Laid`."""

    layout = LAYOUT
