"""The repaired PID of IEC 61131-3 in a virtual PLC: located variables, as OpenPLC gives them to Modbus.

OpenPLC's own documentation (Modbus addressing): %MW0 is holding register 1024, %MD0 the registers 2048 and 2049, the
high word first. A program locates them as it likes; here they stand one after the other. The instance is not located,
so nobody reaches its memory.
"""

from __future__ import annotations

from typing import Final

from heatertune.live.layout import MODBUS, Laid, Layout, registers
from heatertune.plc.iec_pid.words import FIELDS

__all__ = ["LAYOUT", "MODE", "PLACES", "POWER", "READING", "SETPOINT", "IecPidBlock"]

#: registers of %MW0 and %MD0
_MW: Final = 1024
_MD: Final = 2048
_WORDS: Final = ("RUN", "AUTO")
_DOUBLES: Final = ("SP", "PV", "X0", "XOUT", *(field.name for field in FIELDS))
#: name → its place, and the runs of registers
PLACES, _RUNS = registers(
    {name: (_MW + number, "UINT") for number, name in enumerate(_WORDS)}
    | {name: (_MD + 2 * number, "TIME" if name == "CYCLE" else "REAL") for number, name in enumerate(_DOUBLES)})
SETPOINT, READING, POWER, MODE = (PLACES[name] for name in ("SP", "PV", "XOUT", "AUTO"))
LAYOUT: Final = Layout(
    told="%MW0, %MW1, %MD0 to %MD9", speaks=MODBUS, registers=_RUNS, length=2 * sum(run.size for run in _RUNS),
    setpoint=SETPOINT, reading=READING, power=POWER, mode=MODE,
    words={field.name: PLACES[field.name] for field in FIELDS},
    inputs={name: PLACES[name] for name in (*_WORDS, "SP", "PV", "X0")}, first={PLACES["RUN"]: 1})


class IecPidBlock(Laid):
    """12 words in two runs of registers; see `heatertune.live.layout.Laid`."""

    layout = LAYOUT
