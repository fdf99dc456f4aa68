"""The Siemens controllers in a virtual PLC: CONT_C, the PID tip, PID_Compact, OB251 and the S7-200's V memory.

Where the cells of each block are, and what of that is this simulator's own choice, stands at its class.

The instance data block of a PID_Compact is optimized: over OPC UA its members have names and no addresses. An address
that ends in `.*`, as `opc.tcp://192.168.0.10/ns=3;s="PID_Compact_1".*`, stands for all members of one instance. In such
a PLC each word is one node, and so is written alone.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping, Sequence
from typing import Any, Final

from heatertune.errors import InputError
from heatertune.live.block_memory import (
    BLOCKS,
    WORDS,
    BlockSignal,
    CellAddress,
    Laid,
    Layout,
    RegisterRange,
    bytes_of,
    field_of,
    members,
)
from heatertune.plc import Words
from heatertune.plc.controller import Controller
from heatertune.plc.core import ControllerState
from heatertune.plc.cpu.s7_200 import S7200State
from heatertune.plc.cpu.s7_200.io_and_cycle import COUNTS, own, run_cycle, warm_start
from heatertune.plc.cpu.s7_200.memory import V_BEGIN, V_END, cell, put_word
from heatertune.plc.cpu.s7_300.machine import FULL_SCALE
from heatertune.plc.cpu.s7_300.machine import place as place_of
from heatertune.plc.fb41.step import ContCState, call, outcome, scale_reading
from heatertune.plc.fb41.words import FIELDS as CONT_C_FIELDS
from heatertune.plc.pid_compact.words import COMPACT, TEMP, fields_of
from heatertune.plc.ramp import Number
from heatertune.plc.s5_ob251.blocks import DB
from heatertune.plc.s5_ob251.export import LENGTH, PLACES, from_cells, to_image
from heatertune.plc.s5_ob251.step import (
    AUTO,
    COLD,
    GESCHW,
    HANDART,
    Ob251Assumptions,
    Ob251Parameters,
    Ob251State,
    scan,
    start_up,
)
from heatertune.plc.s5_ob251.step import (
    FULL_SCALE as S5_FULL_SCALE,
)
from heatertune.plc.s5_ob251.words import parameters_of
from heatertune.plc.s7_200.controller import step
from heatertune.plc.s7_200_pid.words import FULL, SETPOINT, TABLE
from heatertune.plc.s7_300.words import FIELDS as PID_TIP_FIELDS
from heatertune.plc.single_precision import divide_single
from heatertune.plc.words import WordField

__all__ = [
    "COMPACT_PLACES", "COMPACT_POWER", "COMPACT_READING", "COMPACT_SETPOINT", "CONT_C_LAYOUT", "CONT_C_MODE",
    "CONT_C_POWER", "CONT_C_READING", "CONT_C_SETPOINT", "INSTANCE", "NAMESPACE", "PID_TIP_LAYOUT", "PID_TIP_MODE",
    "PID_TIP_POWER", "PID_TIP_READING", "PID_TIP_SETPOINT", "TAGGED", "TAGS", "CompactBlock", "ContCBlock",
    "Ob251Block", "PaperMemory", "PidMemory", "PidTipBlock", "TempBlock", "instance_of",
]


PID_TIP_MODE: Final = CellAddress(0, "BOOL", 0)  # mode_req
PID_TIP_READING: Final = CellAddress(2, "INT")  # PV
PID_TIP_SETPOINT: Final = CellAddress(4, "INT")  # SP
PID_TIP_POWER: Final = CellAddress(6, "INT")  # OUT
PID_TIP_LAYOUT: Final = Layout(
    number=100, description="instance of the PID tip", length=36, setpoint=PID_TIP_SETPOINT, reading=PID_TIP_READING,
    power=PID_TIP_POWER,
    mode=PID_TIP_MODE,
    words={field.name: CellAddress(place_of(field.address)[0], field.format) for field in PID_TIP_FIELDS},
    inputs={"mode_req": PID_TIP_MODE, "SP": PID_TIP_SETPOINT, "PV": PID_TIP_READING, "OUT": PID_TIP_POWER},
    state={
        "output": PID_TIP_POWER, "overflow": CellAddress(8, "BOOL", 0), "bias": CellAddress(26, "REAL"),
        "reading": CellAddress(30, "REAL"), "started": CellAddress(34, "BOOL", 0),
    },
    anew=WORDS)  # OB100 loads the four words


class PidTipBlock(Laid):
    """The instance of the PID tip, DB100 of the export, 36 bytes; see `heatertune.live.block_memory.Laid`.

    The four words are where the document has them, the rest where the exported function block has it, including all of
    its state. The exported OB35 takes the mode from DB101; here a client writes mode_req, and OUT in manual.
    """

    layout = PID_TIP_LAYOUT

    def _signals(self, degC: tuple[float, float]) -> dict[str, BlockSignal]:
        full = (0, FULL_SCALE)
        return {"temperature": self._signal(PID_TIP_READING, full, degC),
                "power": self._signal(PID_TIP_POWER, full, (0, 100)),
                "setpoint": self._signal(PID_TIP_SETPOINT, full, degC)}


_REALS: Final = ("Setpoint", "Input", "Output", *(f.name for f in fields_of(COMPACT) if f.format == "REAL"))
#: name → its place; of PID_Temp all but InvertControl
COMPACT_PLACES: Final[Mapping[str, CellAddress]] = members([
    *((name, "REAL") for name in _REALS), ("IntegralResetMode", "INT"), ("Reset", "BOOL"), ("InvertControl", "BOOL")])
COMPACT_SETPOINT, COMPACT_READING, COMPACT_POWER = (COMPACT_PLACES[name] for name in ("Setpoint", "Input", "Output"))


def _layout(fields: Sequence[WordField]) -> Layout:
    return Layout(
        description="a global DB of standard access beside the instance", length=52, setpoint=COMPACT_SETPOINT,
        reading=COMPACT_READING,
        power=COMPACT_POWER, words={field.name: COMPACT_PLACES[field.name] for field in fields},
        inputs={name: COMPACT_PLACES[name] for name in ("Setpoint", "Input", "Reset")})


class CompactBlock(Laid):
    """A global DB1 next to a PID_Compact, 52 bytes; see `heatertune.live.block_memory.Laid`.

    S7 with PUT and GET does not reach the optimised instance DB of the instruction. A program therefore copies what
    others may see into a global DB without "optimised block access", and the CPU must permit PUT/GET. The cells of that
    DB are this simulator's own choice; the state of the instance cannot be reached.
    """

    layout = _layout(fields_of(COMPACT))


class TempBlock(Laid):
    """A global DB1 next to a PID_Temp, see `CompactBlock`."""

    layout = _layout(fields_of(TEMP))


_OB251_WORDS: Final = struct.Struct(f">{LENGTH}H")
_ONE: Final = struct.Struct(">h")
#: DW18 to DW48: XW, its change, (X), side and count of calls, (Z), change of XZ, XZ before, Z before, (XZ), dD, Y, YA
_STATE: Final = struct.Struct(">ii2xbb2xihh2xdd20xh")
_BEGIN: Final = 2 * 18
#: places of setpoint, reading, disturbance variable and of what the D part may act on
_W, _X, _Z, _XZ, _YA = 2 * PLACES["W"], 2 * 22, 2 * 24, 2 * 29, 2 * 48
_CONTROL: Final = 2 * PLACES["STEU"]
_STEU: Final = _CONTROL + 1  # its low byte
#: no call gives a number beyond it: what is found there was never one
_MOST: Final = 1e15
_MOST_DIFFERENCE: Final = 4 * 32768  # of two errors, each of which is one of two words
_CALLS: Final = 4


class Ob251Block:
    """The controller DB of OB251, DB30, 49 words; see `heatertune.live.controller_block.ServedBlock`.

    Words and the cells X, Z, XZ and YA are where the manual has them. It says that the other cells between DW18 and
    DW48 hold the state, but not how: this layout is the simulator's own. It holds the state to the last bit, so a
    client that writes there changes it, as on a real CPU.
    """

    number, manual = DB, True
    description, undone_by = "49 words", ""
    operators, mode = ("STEU", "YH"), slice(_STEU, _STEU + 1)
    speaks = (*BLOCKS, "as511")
    registers: Sequence[RegisterRange] = ()

    def __init__(self, controller: Controller, words: Words, assume: Ob251Assumptions) -> None:
        """Take words that run under assumptions.

        Args:
            controller: OB251.
            words: that it holds at the beginning.
            assume: what the manual leaves open.
        """
        self._fields, self._image, self._assume = controller.fields, to_image(words), assume
        degC = words.scaling.low_degC, words.scaling.high_degC
        self.signals = {
            name: BlockSignal(place, "INT", (0, S5_FULL_SCALE), shown)
            for name, place, shown in (("temperature", _X, degC), ("power", _YA, (0, 100)), ("setpoint", _W, degC))}
        self.words = {field.name: BlockSignal(2 * PLACES[field.name], field.format) for field in self._fields}
        self.words["STEU"] = BlockSignal(_STEU, "BYTE")  # the high byte belongs to the operating system
        self.bits: dict[str, tuple[int, int]] = {}
        self._asked: Number | None = None
        self._words, self._parameters = b"", parameters_of(words.whole)
        self._kept = self._image[_BEGIN:]

    def image(self) -> bytes:
        """Return the block as it is keyed in."""
        return self._image

    def begin(self) -> Ob251State:
        """Return the cold state."""
        return COLD

    def scan(self, cells: bytearray, state: Ob251State, setpoint: Number, reading: Number) -> tuple[Ob251State, float,
                                                                                                    int, int]:
        """Run one scan; see `heatertune.live.controller_block.ServedBlock`."""
        if setpoint != self._asked:
            _ONE.pack_into(cells, _W, int(setpoint))
            self._asked = setpoint
        _ONE.pack_into(cells, _X, int(reading))
        if cells[_BEGIN:] != self._kept:
            state = _state_in_cells(cells, state, self._kept)
        w, z, xz = (_ONE.unpack_from(cells, place)[0] for place in (_W, _Z, _XZ))
        parameters = self._parameters_in(cells), self._assume
        after, power, output, flags = scan(parameters, state, {"W": w, "X": int(reading), "Z": z, "XZ": xz})
        _keep(cells, after)
        self._kept = bytes(cells[_BEGIN:])
        return after, power, output, flags

    def _parameters_in(self, cells: bytearray) -> Ob251Parameters:
        words = bytes(cells[:_BEGIN])
        if words != self._words:
            self._words, self._parameters = words, parameters_of(from_cells(_OB251_WORDS.unpack(cells)))
        return self._parameters

    def restarted(self, state: Ob251State) -> Ob251State:
        """Return the state after OB21 or OB22."""
        self._asked = None
        return start_up((self._parameters, self._assume), COLD, state)

    def in_manual(self, cells: bytes | bytearray) -> bool:
        """Return whether bit 0 of STEU is clear."""
        return not cells[_STEU] & AUTO

    def into_automatic(self, cells: bytearray) -> None:
        """Set that bit."""
        cells[_STEU] |= AUTO

    def put_in_manual(self, cells: bytes, power_pct: float) -> tuple[int, bytes]:
        """Return STEU, its bit 0 clear, and YH behind it; see `heatertune.live.controller_block.ServedBlock`."""
        steu = int.from_bytes(cells[_CONTROL : _CONTROL + 2], "big") & ~(AUTO | HANDART | GESCHW)
        return _CONTROL, struct.pack(">Hh", steu, round(power_pct / 100.0 * S5_FULL_SCALE))

    def put_word(self, cells: bytearray, name: str, value: float) -> None:
        """Write one word; errors as `heatertune.live.block_memory`."""
        content, place = bytes_of(field_of(self._fields, name), value), 2 * PLACES[name]
        cells[place : place + len(content)] = content


def _keep(cells: bytearray, state: Ob251State) -> None:
    """Write the state and YA; the inputs between them stay."""
    inputs = [(place, bytes(cells[place : place + 2])) for place in (_X, _Z, _XZ)]
    _STATE.pack_into(
        cells, _BEGIN, int(state.error), int(state.error_change), state.at_limit, state.approach,
        int(state.substitute_change), int(state.substitute), int(state.disturbance), state.derivative, state.total,
        state.output)
    for place, content in inputs:
        cells[place : place + 2] = content


def _state_in_cells(cells: bytearray, state: Ob251State, content: bytes) -> Ob251State:
    """Return the state as the cells have it, where somebody has written to them since; inputs are none of it."""
    now = bytearray(cells[_BEGIN:])
    for place in (_X, _Z, _XZ):
        at = place - _BEGIN
        now[at : at + 2] = content[at : at + 2]
    if now == content:
        return state
    error, change, side, calls, other_change, other, disturbance, derivative, total, output = _STATE.unpack(now)
    return Ob251State(
        error=_difference(error), error_change=_difference(change), substitute=float(other),
        substitute_change=float(other_change), derivative=_real(derivative), disturbance=float(disturbance),
        total=_real(total), output=output, at_limit=(side > 0) - (side < 0), approach=min(max(calls, 0), _CALLS))


def _difference(value: int) -> float:
    """Return an error or its change that calls could have left, 0 for another."""
    return float(value) if abs(value) <= _MOST_DIFFERENCE else 0.0


def _real(value: float) -> float:
    """Return a number that a call could have left, 0 for a pattern of bits that is none."""
    return value if math.isfinite(value) and abs(value) <= _MOST else 0.0


_ANALOG: Final = cell("AIW0", 2).start
#: setpoint, process variable and output in the loop table, as shares (System Manual, table 9-19)
_READING, _SETPOINT, _POWER = CellAddress(TABLE, "REAL"), CellAddress(int(SETPOINT[2:]), "REAL"), CellAddress(TABLE + 8,
                                                                                                              "REAL")
_WIDTHS: Final = {"VD": 4, "VW": 2}
_V: Final = slice(V_BEGIN, V_END)


class _VMemory:
    """512 bytes of V memory, which S7 clients find as DB 1; see `heatertune.live.controller_block.ServedBlock`.

    The program itself uses this memory: its first scan loads the words, and the next interrupt uses what a client has
    written. Inputs, outputs and special memory are elsewhere: the setpoint of the paper's program is an analog
    adjustment, SMB28, and the pulse width is SMW70.
    """

    number, manual = 1, False
    description, operators, mode = "V memory", (), slice(0)
    undone_by = "the first scan after a start-up types in the words of the program that is loaded"
    speaks = BLOCKS
    registers: Sequence[RegisterRange] = ()

    def __init__(self, controller: Controller, words: Words, assume: Any) -> None:
        """Take words that run under assumptions.

        Args:
            controller: one of the S7-200's.
            words: that its program types in at the first scan.
            assume: what the manual leaves open.
        """
        self._fields = [field for field in controller.fields if field.address[:2] in _WIDTHS]
        self.words = {field.name: BlockSignal(int(field.address[2:]), field.format) for field in self._fields
                      if field.format == "REAL"}  # the program has its ticks as constants
        self.bits: dict[str, tuple[int, int]] = {}
        self._timed, self._cold = controller.begin(words, assume)
        self._asked: Number | None = None
        self.signals = self._signals((words.scaling.low_degC, words.scaling.high_degC))

    def image(self) -> bytes:
        """Return the memory before the first scan."""
        return bytes(self._cold.memory[_V])

    def begin(self) -> S7200State:
        """Return a CPU before its first scan."""
        return own(self._cold)

    def _signals(self, degC: tuple[float, float]) -> dict[str, BlockSignal]:
        """Return the shown value; `degC` are both ends of the sensor."""
        raise NotImplementedError

    def restarted(self, state: S7200State) -> S7200State:
        """Return the state after a start-up that finds V memory as it was."""
        self._asked = None
        return warm_start(None, self._cold, state)

    def in_manual(self, _cells: bytes | bytearray) -> bool:
        """Return False: these programs have no manual mode."""
        return False

    def into_automatic(self, _cells: bytearray) -> None:
        """Do nothing."""

    def put_in_manual(self, _cells: bytes, _power_pct: float) -> tuple[int, bytes]:
        """Return nothing.

        Raises:
            InputError: always: these programs have no manual mode.
        """
        raise InputError("the exported programs of the S7-200 have no manual mode: switch manually, and record it")

    def put_word(self, cells: bytearray, name: str, value: float) -> None:
        """Write one word that stands in V memory; errors as `heatertune.live.block_memory`."""
        field = field_of(self._fields, name)
        content, place = bytes_of(field, value), int(field.address[2:])
        cells[place : place + len(content)] = content


class PidMemory(_VMemory):
    """Of the program of the PID instruction: its loop table, REALs as shares of the range, begins at VB100."""

    def _signals(self, degC: tuple[float, float]) -> dict[str, BlockSignal]:
        shown = {"temperature": (_READING, degC), "power": (_POWER, (0.0, 100.0)), "setpoint": (_SETPOINT, degC)}
        return {name: BlockSignal(place.byte, "REAL", shown=scale) for name, (place, scale) in shown.items()}

    def scan(self, cells: bytearray, state: S7200State, setpoint: Number, reading: Number) -> tuple[S7200State, float,
                                                                                                    int, int]:
        """Run one PWM cycle; see `heatertune.live.controller_block.ServedBlock`."""
        if setpoint != self._asked:
            _SETPOINT.write(cells, divide_single(float(setpoint), float(FULL)))
            self._asked = setpoint
        memory = state.memory
        memory[_V] = cells
        put_word(memory, _ANALOG, int(reading))
        power, width, faults = run_cycle(self._timed, memory)
        cells[:] = memory[_V]
        return state, power, width, faults & 1


class PaperMemory(_VMemory):
    """Of the paper's program, repaired: reading in VW0, error in VW10."""

    def _signals(self, degC: tuple[float, float]) -> dict[str, BlockSignal]:
        return {"temperature": BlockSignal(0, "INT", (0, COUNTS), degC)}

    def scan(self, cells: bytearray, state: S7200State, setpoint: Number, reading: Number) -> tuple[S7200State, float,
                                                                                                    int, int]:
        """Run one PWM cycle; see `heatertune.live.controller_block.ServedBlock`."""
        state.memory[_V] = cells
        outcome = step(self._timed, state, int(setpoint), int(reading), True)
        cells[:] = state.memory[_V]
        return outcome


_WORDS: Final = {field.name: CellAddress(place_of(field.address)[0], field.format,
                                         place_of(field.address)[1]) for field in CONT_C_FIELDS}
_COM_RST, _PVPER_ON = CellAddress(0, "BOOL", 0), _WORDS["PVPER_ON"]
_PV_IN: Final = CellAddress(10, "REAL")
_LMN_P, _LMN_I, _PV = CellAddress(80, "REAL"), CellAddress(84, "REAL"), CellAddress(92, "REAL")
_QLMN_HLM, _QLMN_LLM = CellAddress(78, "BOOL", 0), CellAddress(78, "BOOL", 1)

CONT_C_SETPOINT: Final = CellAddress(6, "REAL")  # SP_INT
CONT_C_READING: Final = CellAddress(14, "INT")  # PV_PER
CONT_C_POWER: Final = CellAddress(72, "REAL")  # LMN
CONT_C_MODE: Final = _WORDS["MAN_ON"]
CONT_C_LAYOUT: Final = Layout(
    number=41, description="instance of CONT_C", length=126, setpoint=CONT_C_SETPOINT, reading=CONT_C_READING,
    power=CONT_C_POWER, mode=CONT_C_MODE,
    manual_is=1, words=_WORDS,
    inputs={
        "COM_RST": _COM_RST, "SP_INT": CONT_C_SETPOINT, "PV_PER": CONT_C_READING,
        **{name: _WORDS[name] for name in ("MAN_ON", "MAN", "DISV", "INT_HOLD")},
    },
    state={
        "output": CONT_C_POWER, "derivative": CellAddress(88, "REAL"), "before": CellAddress(100, "REAL"),
        "integral": CellAddress(104, "REAL"), "integral_rest": CellAddress(108, "REAL"),
        "feedback_rest": CellAddress(112, "REAL"), "feedback": CellAddress(116, "REAL"),
        "limited": CellAddress(120, "REAL"), "at_upper": CellAddress(124, "BOOL", 0),
        "at_lower": CellAddress(124, "BOOL", 1),
    },
    first={CellAddress(124, "BOOL", 2): 1})  # sbILimOn, which nothing reads


class ContCBlock(Laid):
    """The instance of CONT_C, DB41 of the export, 126 bytes; see `heatertune.live.block_memory.Laid`.

    The types of inputs and outputs give their addresses. The nine statics follow in the order in which public
    re-implementations of the block name them (sInvAlt, sIanteilAlt, sRestInt, sRestDif, sRueck, sLmn, sbArwHLmOn,
    sbArwLLmOn, sbILimOn). A client writes SP_INT, MAN_ON and MAN; the exported OB35 takes them from DB101.
    """

    layout = CONT_C_LAYOUT

    def _signals(self, degC: tuple[float, float]) -> dict[str, BlockSignal]:
        return super()._signals(degC) | {"temperature": self._signal(_PV)}  # PV_PER needs PV_FAC and PV_OFF

    def ask(self, cells: bytearray, running: ControllerState, setpoint: Number) -> None:
        """Write SP_INT for an analog value."""
        CONT_C_SETPOINT.write(cells, scale_reading(running.parameters[0], int(setpoint))[0])

    def run(
        self, cells: bytearray, running: ControllerState, state: ContCState, reading: Number
    ) -> tuple[Any, float, Number, int]:
        """Return the result of one call; without PVPER_ON the block's reading is PV_IN."""
        if _PVPER_ON.read(cells) or _COM_RST.read(cells):
            return super().run(cells, running, state, reading)
        p, assume = running.parameters
        return outcome(call(p, assume, state, CONT_C_SETPOINT.read(cells), _PV_IN.read(cells)))

    def tell(self, cells: bytearray, running: ControllerState, after: ContCState, output: Number) -> None:
        """Write what the block shows of a call; ER and LMN_PER are left out."""
        p = running.parameters[0]
        CONT_C_POWER.write(cells, output)
        _QLMN_HLM.write(cells, after.at_upper)
        _QLMN_LLM.write(cells, after.at_lower)
        _LMN_P.write(cells, after.before if p.p_sel else 0.0)
        _LMN_I.write(cells, after.integral)
        pv = scale_reading(p, CONT_C_READING.read(cells))[0] if _PVPER_ON.read(cells) else _PV_IN.read(cells)
        _PV.write(cells, pv)


#: the controller whose tags these are
TAGGED: Final = "pid-compact"
#: name of the instance in a virtual PLC, and the namespace of the tags in an S7-1500
INSTANCE: Final = '"PID_Compact_1"'
NAMESPACE: Final = "http://www.siemens.com/simatic-s7-opcua"
_ALL: Final = ".*"
#: of a structure of the instance; other members are its own. The reading is the scaled one, whichever input it is from
_WITHIN: Final = {"Input": '"ScaledInput"', "OutputUpperLimit": '"Config"."OutputUpperLimit"',
                  "OutputLowerLimit": '"Config"."OutputLowerLimit"', "InvertControl": '"Config"."InvertControl"'} | {
    name: f'"Retain"."CtrlParams"."{name}"'
    for name in ("Gain", "Ti", "Td", "TdFiltRatio", "PWeighting", "DWeighting", "Cycle")}
#: tag below the instance → where the same number stands in the block of `heatertune.live.siemens_blocks.CompactBlock`
TAGS: Final[Mapping[str, CellAddress]] = {
    _WITHIN.get(name, f'"{name}"'): place for name, place in COMPACT_PLACES.items()}


def instance_of(node: str) -> str:
    """Return the node of an instance whose tags an address stands for; empty where it is the node of a block."""
    return node.removesuffix(_ALL) if node.endswith(_ALL) else ""
