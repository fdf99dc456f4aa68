"""CONT_C's instance data block in a virtual PLC, DB41 as the export has it.

Inputs and outputs stand where the sums of their types put them, and the nine statics behind them in the order in which
public re-implementations of the block name them (sInvAlt, sIanteilAlt, sRestInt, sRestDif, sRueck, sLmn, sbArwHLmOn,
sbArwLLmOn, sbILimOn). SP_INT, MAN_ON and MAN are what a client writes here; the exported OB35 takes them from DB101.
"""

from __future__ import annotations

from typing import Any, Final

from heatertune.live.cells import Signal
from heatertune.live.layout import Laid, Layout, Place
from heatertune.plc.core import Running
from heatertune.plc.cpu.s7_300.memory import place
from heatertune.plc.fb41.step import State, call, outcome, scaled
from heatertune.plc.fb41.words import FIELDS
from heatertune.plc.ramp import Number

__all__ = ["LAYOUT", "MODE", "POWER", "READING", "SETPOINT", "ContCBlock"]

_WORDS: Final = {field.name: Place(place(field.address)[0], field.format, place(field.address)[1]) for field in FIELDS}
_COM_RST, _PVPER_ON = Place(0, "BOOL", 0), _WORDS["PVPER_ON"]
_PV_IN: Final = Place(10, "REAL")
_LMN_P, _LMN_I, _PV = Place(80, "REAL"), Place(84, "REAL"), Place(92, "REAL")
_QLMN_HLM, _QLMN_LLM = Place(78, "BOOL", 0), Place(78, "BOOL", 1)

SETPOINT: Final = Place(6, "REAL")  # SP_INT
READING: Final = Place(14, "INT")  # PV_PER
POWER: Final = Place(72, "REAL")  # LMN
MODE: Final = _WORDS["MAN_ON"]
LAYOUT: Final = Layout(
    number=41, told="instance of CONT_C", length=126, setpoint=SETPOINT, reading=READING, power=POWER, mode=MODE,
    manual_is=1, words=_WORDS,
    inputs={
        "COM_RST": _COM_RST, "SP_INT": SETPOINT, "PV_PER": READING,
        **{name: _WORDS[name] for name in ("MAN_ON", "MAN", "DISV", "INT_HOLD")},
    },
    state={
        "output": POWER, "derivative": Place(88, "REAL"), "before": Place(100, "REAL"), "integral": Place(104, "REAL"),
        "integral_rest": Place(108, "REAL"), "feedback_rest": Place(112, "REAL"), "feedback": Place(116, "REAL"),
        "limited": Place(120, "REAL"), "at_upper": Place(124, "BOOL", 0), "at_lower": Place(124, "BOOL", 1),
    },
    first={Place(124, "BOOL", 2): 1})  # sbILimOn, which nothing reads


class ContCBlock(Laid):
    """DB41, 126 bytes; see `heatertune.live.layout.Laid`."""

    layout = LAYOUT

    def _signals(self, degC: tuple[float, float]) -> dict[str, Signal]:
        return super()._signals(degC) | {"temperature": self._signal(_PV)}  # PV_PER needs PV_FAC and PV_OFF

    def ask(self, cells: bytearray, running: Running, setpoint: Number) -> None:
        """Write SP_INT for an analog value."""
        SETPOINT.write(cells, scaled(running.parameters[0], int(setpoint))[0])

    def run(
        self, cells: bytearray, running: Running, state: State, reading: Number
    ) -> tuple[Any, float, Number, int]:
        """Return what one call gives; without PVPER_ON the block's reading is PV_IN."""
        if _PVPER_ON.read(cells) or _COM_RST.read(cells):
            return super().run(cells, running, state, reading)
        p, assume = running.parameters
        return outcome(call(p, assume, state, SETPOINT.read(cells), _PV_IN.read(cells)))

    def tell(self, cells: bytearray, running: Running, after: State, output: Number) -> None:
        """Write what the block shows of a call; ER and LMN_PER are left out."""
        p = running.parameters[0]
        POWER.write(cells, output)
        _QLMN_HLM.write(cells, after.at_upper)
        _QLMN_LLM.write(cells, after.at_lower)
        _LMN_P.write(cells, after.before if p.p_sel else 0.0)
        _LMN_I.write(cells, after.integral)
        pv = scaled(p, READING.read(cells))[0] if _PVPER_ON.read(cells) else _PV_IN.read(cells)
        _PV.write(cells, pv)
