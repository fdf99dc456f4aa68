"""CONT_C's instance data block in a virtual PLC, DB41 as the export has it.

Inputs and outputs stand where the sums of their types put them, and the nine statics behind them in the order in which
public re-implementations of the block name them (sInvAlt, sIanteilAlt, sRestInt, sRestDif, sRueck, sLmn, sbArwHLmOn,
sbArwLLmOn, sbILimOn). SP_INT, MAN_ON and MAN are what a client writes here; the exported OB35 takes them from DB101.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Final

from heatertune.live.layout import Laid, Place
from heatertune.plc.core import Running
from heatertune.plc.cpu.s7_300.memory import place
from heatertune.plc.fb41.step import State, call, outcome, scaled
from heatertune.plc.fb41.words import FIELDS
from heatertune.plc.ramp import Number

__all__ = ["LENGTH", "MODE", "POWER", "READING", "SETPOINT", "ContCBlock"]

LENGTH: Final = 126
SETPOINT: Final = Place(6, "REAL")  # SP_INT
READING: Final = Place(14, "INT")  # PV_PER
POWER: Final = Place(72, "REAL")  # LMN
MODE: Final = Place(0, "BOOL", 1)  # MAN_ON

_COM_RST: Final = Place(0, "BOOL", 0)
_PVPER_ON: Final = Place(0, "BOOL", 2)
_PV_IN: Final = Place(10, "REAL")
_WORDS: Final = {field.name: Place(place(field.address)[0], field.format, place(field.address)[1]) for field in FIELDS}
_LMN_P, _LMN_I, _PV = Place(80, "REAL"), Place(84, "REAL"), Place(92, "REAL")


class ContCBlock(Laid):
    """DB41, 126 bytes; see `heatertune.live.layout.Laid`."""

    number = 41
    told = "instance of CONT_C"
    LENGTH, SETPOINT, READING, POWER, MODE = LENGTH, SETPOINT, READING, POWER, MODE
    AUTOMATIC, MANUAL = 0, 1
    WORDS = _WORDS
    INPUTS: ClassVar[Mapping[str, Place]] = {
        "COM_RST": _COM_RST, "MAN_ON": MODE, "SP_INT": SETPOINT, "PV_PER": READING, "INT_HOLD": _WORDS["INT_HOLD"],
        "MAN": _WORDS["MAN"], "DISV": _WORDS["DISV"],
    }
    STATE: ClassVar[Mapping[str, Place]] = {
        "output": POWER, "derivative": Place(88, "REAL"), "before": Place(100, "REAL"), "integral": Place(104, "REAL"),
        "integral_rest": Place(108, "REAL"), "feedback_rest": Place(112, "REAL"), "feedback": Place(116, "REAL"),
        "limited": Place(120, "REAL"), "at_upper": Place(124, "BOOL", 0), "at_lower": Place(124, "BOOL", 1),
    }
    FIRST: ClassVar[Mapping[Place, Number]] = {Place(124, "BOOL", 2): 1}  # sbILimOn, which nothing reads

    def ask(self, cells: bytearray, running: Running, setpoint: Number) -> None:
        """Write SP_INT for an analog value."""
        self.SETPOINT.write(cells, scaled(running.parameters[0], int(setpoint))[0])

    def run(
        self, cells: bytearray, running: Running, state: State, reading: Number
    ) -> tuple[Any, float, Number, int]:
        """Return what one call gives; without PVPER_ON the block's reading is PV_IN."""
        if _PVPER_ON.read(cells) or _COM_RST.read(cells):
            return super().run(cells, running, state, reading)
        after = call(*running.parameters, state, self.SETPOINT.read(cells), _PV_IN.read(cells))
        return outcome(after)

    def tell(self, cells: bytearray, running: Running, after: State, output: Number) -> None:
        """Write what the block shows of a call; ER and LMN_PER are left out."""
        p = running.parameters[0]
        self.POWER.write(cells, output)
        Place(78, "BOOL", 0).write(cells, after.at_upper)
        Place(78, "BOOL", 1).write(cells, after.at_lower)
        _LMN_P.write(cells, after.before if p.p_sel else 0.0)
        _LMN_I.write(cells, after.integral)
        pv = scaled(p, self.READING.read(cells))[0] if _PVPER_ON.read(cells) else _PV_IN.read(cells)
        _PV.write(cells, pv)
