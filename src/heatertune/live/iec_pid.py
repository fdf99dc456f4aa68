"""The repaired PID of IEC 61131-3 in a virtual PLC: located variables, as OpenPLC gives them to Modbus.

OpenPLC's own documentation (Modbus addressing): %MW0 is holding register 1024, %MD0 the registers 2048 and 2049, the
high word first. A program locates them as it likes; here they stand one after the other. The instance is not located,
so nobody reaches its memory.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Final

from heatertune.live.layout import MODBUS, Laid, Place, registers
from heatertune.plc.iec_pid.words import FIELDS
from heatertune.plc.ramp import Number

__all__ = ["LENGTH", "MODE", "PLACES", "POWER", "READING", "SETPOINT", "IecPidBlock"]

#: registers of %MW0 and %MD0
_MW: Final = 1024
_MD: Final = 2048
_WORDS: Final = ("RUN", "AUTO")
_DOUBLES: Final = ("SP", "PV", "X0", "XOUT", *(field.name for field in FIELDS))
#: name → its place, and the runs of registers
PLACES, _RUNS = registers(
    {name: (_MW + number, "UINT") for number, name in enumerate(_WORDS)}
    | {name: (_MD + 2 * number, "TIME" if name == "CYCLE" else "REAL") for number, name in enumerate(_DOUBLES)})
LENGTH: Final = 2 * sum(run.count for run in _RUNS)
SETPOINT, READING, POWER, MODE = (PLACES[name] for name in ("SP", "PV", "XOUT", "AUTO"))


class IecPidBlock(Laid):
    """%MW0, %MW1 and %MD0 to %MD9; see `heatertune.live.layout.Laid`."""

    told = "%MW0, %MW1, %MD0 to %MD9"
    speaks, registers = MODBUS, _RUNS
    LENGTH, SETPOINT, READING, POWER, MODE = LENGTH, SETPOINT, READING, POWER, MODE
    WORDS: ClassVar[Mapping[str, Place]] = {field.name: PLACES[field.name] for field in FIELDS}
    INPUTS: ClassVar[Mapping[str, Place]] = {name: PLACES[name] for name in (*_WORDS, "SP", "PV", "X0")}
    FIRST: ClassVar[Mapping[Place, Number]] = {PLACES["RUN"]: 1}
