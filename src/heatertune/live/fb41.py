"""CONT_C's instance data block in a virtual PLC, DB41 as the export has it.

Inputs and outputs stand where the sums of their types put them, and the nine statics behind them in the order in which
public re-implementations of the block name them (sInvAlt, sIanteilAlt, sRestInt, sRestDif, sRueck, sLmn, sbArwHLmOn,
sbArwLLmOn, sbILimOn). SP_INT, MAN_ON and MAN are what a client writes here; the exported OB35 takes them from DB101.
"""

from __future__ import annotations

from typing import Any, Final

from heatertune.live.layout import CellAddress, Laid, Layout
from heatertune.live.memory import Signal
from heatertune.plc.core import ControllerState
from heatertune.plc.cpu.s7_300.machine import place
from heatertune.plc.fb41.step import ContCState, call, outcome, scale_reading
from heatertune.plc.fb41.words import FIELDS
from heatertune.plc.ramp import Number

__all__ = ["LAYOUT", "MODE", "POWER", "READING", "SETPOINT", "ContCBlock"]

_WORDS: Final = {field.name: CellAddress(place(field.address)[0], field.format,
                                         place(field.address)[1]) for field in FIELDS}
_COM_RST, _PVPER_ON = CellAddress(0, "BOOL", 0), _WORDS["PVPER_ON"]
_PV_IN: Final = CellAddress(10, "REAL")
_LMN_P, _LMN_I, _PV = CellAddress(80, "REAL"), CellAddress(84, "REAL"), CellAddress(92, "REAL")
_QLMN_HLM, _QLMN_LLM = CellAddress(78, "BOOL", 0), CellAddress(78, "BOOL", 1)

SETPOINT: Final = CellAddress(6, "REAL")  # SP_INT
READING: Final = CellAddress(14, "INT")  # PV_PER
POWER: Final = CellAddress(72, "REAL")  # LMN
MODE: Final = _WORDS["MAN_ON"]
LAYOUT: Final = Layout(
    number=41, description="instance of CONT_C", length=126, setpoint=SETPOINT, reading=READING, power=POWER, mode=MODE,
    manual_is=1, words=_WORDS,
    inputs={
        "COM_RST": _COM_RST, "SP_INT": SETPOINT, "PV_PER": READING,
        **{name: _WORDS[name] for name in ("MAN_ON", "MAN", "DISV", "INT_HOLD")},
    },
    state={
        "output": POWER, "derivative": CellAddress(88, "REAL"), "before": CellAddress(100, "REAL"),
        "integral": CellAddress(104, "REAL"),
        "integral_rest": CellAddress(108, "REAL"), "feedback_rest": CellAddress(112, "REAL"),
        "feedback": CellAddress(116, "REAL"),
        "limited": CellAddress(120, "REAL"), "at_upper": CellAddress(124, "BOOL", 0),
        "at_lower": CellAddress(124, "BOOL", 1),
    },
    first={CellAddress(124, "BOOL", 2): 1})  # sbILimOn, which nothing reads


class ContCBlock(Laid):
    """DB41, 126 bytes; see `heatertune.live.layout.Laid`."""

    layout = LAYOUT

    def _signals(self, degC: tuple[float, float]) -> dict[str, Signal]:
        return super()._signals(degC) | {"temperature": self._signal(_PV)}  # PV_PER needs PV_FAC and PV_OFF

    def ask(self, cells: bytearray, running: ControllerState, setpoint: Number) -> None:
        """Write SP_INT for an analog value."""
        SETPOINT.write(cells, scale_reading(running.parameters[0], int(setpoint))[0])

    def run(
        self, cells: bytearray, running: ControllerState, state: ContCState, reading: Number
    ) -> tuple[Any, float, Number, int]:
        """Return what one call gives; without PVPER_ON the block's reading is PV_IN."""
        if _PVPER_ON.read(cells) or _COM_RST.read(cells):
            return super().run(cells, running, state, reading)
        p, assume = running.parameters
        return outcome(call(p, assume, state, SETPOINT.read(cells), _PV_IN.read(cells)))

    def tell(self, cells: bytearray, running: ControllerState, after: ContCState, output: Number) -> None:
        """Write what the block shows of a call; ER and LMN_PER are left out."""
        p = running.parameters[0]
        POWER.write(cells, output)
        _QLMN_HLM.write(cells, after.at_upper)
        _QLMN_LLM.write(cells, after.at_lower)
        _LMN_P.write(cells, after.before if p.p_sel else 0.0)
        _LMN_I.write(cells, after.integral)
        pv = scale_reading(p, READING.read(cells))[0] if _PVPER_ON.read(cells) else _PV_IN.read(cells)
        _PV.write(cells, pv)
