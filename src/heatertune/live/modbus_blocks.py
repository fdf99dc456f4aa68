"""The controllers that a virtual PLC serves over Modbus: panel instruments, WEG's PID block, the PID of IEC 61131-3.

Sources of addresses, and what is this simulator's own choice, stand at each class.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any, Final, NamedTuple

from heatertune.live.block_memory import ALL, MODBUS, BlockSignal, CellAddress, Laid, Layout, members, registers
from heatertune.plc import Words
from heatertune.plc.controller import Controller
from heatertune.plc.core import ControllerState
from heatertune.plc.iec_pid.words import FIELDS as IEC_PID_FIELDS
from heatertune.plc.pband.export import number_of
from heatertune.plc.pband.makes import MAKES, Make
from heatertune.plc.pband.words import COUNTS
from heatertune.plc.ramp import Number
from heatertune.plc.weg.words import FIELDS as WEG_FIELDS

__all__ = [
    "IEC_PID_LAYOUT", "IEC_PID_MODE", "IEC_PID_PLACES", "IEC_PID_POWER", "IEC_PID_READING", "IEC_PID_SETPOINT",
    "PROCESS", "WEG_LAYOUT", "WEG_MODE", "WEG_PLACES", "WEG_POWER", "WEG_READING", "WEG_SETPOINT", "IecPidBlock",
    "InstrumentBlock", "Process", "WegBlock",
]


#: name → its place; register r is at byte 2·r
WEG_PLACES: Final = members([
    ("EN", "UINT"), ("SetPoint", "REAL"), ("ManualSetPoint", "REAL"), ("SelectSetPoint", "UINT"), ("Feedback", "REAL"),
    ("MinimumOutput", "REAL"), ("MaximumOutput", "REAL"), ("Kp", "REAL"), ("Ki", "REAL"), ("Kd", "REAL"),
    ("TauSetPoint", "REAL"), ("Type", "UINT"), ("Action", "UINT"), ("Ts", "UINT"), ("ENO", "UINT"), ("Output", "REAL"),
])
WEG_SETPOINT, WEG_READING, WEG_POWER, WEG_MODE = (WEG_PLACES[name] for name in ("SetPoint", "Feedback", "Output",
                                                                                "SelectSetPoint"))
WEG_LAYOUT: Final = Layout(
    description="interface of the block PID", speaks=MODBUS, length=WEG_PLACES["Output"].part.stop,
    setpoint=WEG_SETPOINT, reading=WEG_READING, power=WEG_POWER, mode=WEG_MODE, manual_is=1,
    hand=WEG_PLACES["ManualSetPoint"], words={field.name: WEG_PLACES[field.name] for field in WEG_FIELDS},
    inputs={name: WEG_PLACES[name] for name in ("EN", "SetPoint", "ManualSetPoint", "SelectSetPoint", "Feedback")},
    first={WEG_PLACES["EN"]: 1}, anew=ALL)


class WegBlock(Laid):
    """The interface of WEG's PID block as registers 0 to 25; see `heatertune.live.block_memory.Laid`.

    The SCA06 serves its parameters and the markers of its ladder as holding registers (SCA06, Ethernet communication
    module, section 7.3). A program chooses the markers, whose addresses are in a manual that was not available. So this
    map is the simulator's own: the interface in the manual's order, a REAL in two registers, the high word first. The
    internal state of the block cannot be reached.
    """

    layout = WEG_LAYOUT

    def tell(self, cells: bytearray, running: ControllerState, after: Any, output: Number) -> None:
        """Write Output, and ENO, which follows EN."""
        super().tell(cells, running, after, output)
        WEG_PLACES["ENO"].write(cells, bool(WEG_PLACES["EN"].read(cells)))


#: register of %MD0
_MD: Final = 2048
_FORMATS: Final = {"CYCLE": "TIME", "RUN": "DINT", "AUTO": "DINT"}
#: name → its place, and the run of registers
IEC_PID_PLACES, _RUNS = registers({
    name: (_MD + 2 * number, _FORMATS.get(name, "REAL"))
    for number,
    name in enumerate(("SP", "PV", "XOUT", "X0", "AUTO", "RUN", *(field.name for field in IEC_PID_FIELDS)))})
IEC_PID_SETPOINT, IEC_PID_READING, IEC_PID_POWER, IEC_PID_MODE = (IEC_PID_PLACES[name] for name in ("SP", "PV", "XOUT",
                                                                                                    "AUTO"))
IEC_PID_LAYOUT: Final = Layout(
    description="%MD0 to %MD11", speaks=MODBUS, registers=_RUNS, length=2 * sum(run.size for run in _RUNS),
    setpoint=IEC_PID_SETPOINT, reading=IEC_PID_READING, power=IEC_PID_POWER, mode=IEC_PID_MODE,
    hand=IEC_PID_PLACES["X0"], words={field.name: IEC_PID_PLACES[field.name] for field in IEC_PID_FIELDS},
    inputs={name: IEC_PID_PLACES[name] for name in ("RUN", "AUTO", "SP", "PV", "X0")}, first={IEC_PID_PLACES["RUN"]: 1},
    anew=ALL)


class IecPidBlock(Laid):
    """The repaired PID of IEC 61131-3 as located variables of OpenPLC; see `heatertune.live.block_memory.Laid`.

    %MD0 is the holding registers 2048 and 2049, the high word first (OpenPLC documentation, Modbus addressing). A
    program locates its variables freely; here they are consecutive, registers 2048 to 2071. The internal state of the
    block is not located and cannot be reached.
    """

    layout = IEC_PID_LAYOUT


_LEAST, _MOST = -32768, 32767


class Process(NamedTuple):
    """Registers of what an instrument measures and does.

    Attributes:
        reading, output: registers.
        setpoint: register that is written.
        working: register that repeats the setpoint; None: none does.
        floats: whether they are floats; else temperatures are in 0.1 °C and the output in 0.1 %.
    """

    reading: int
    setpoint: int
    output: int
    working: int | None = None
    floats: bool = False


#: make → its registers; an ABB Commander 300 has no Modbus. Omron E5CC: communications manual H175, section 5-1,
#: two-byte mode; Eurotherm 3200: HA028651, section 15.5; Omega, Delta: a list that counts from one less (4095, 4096,
#: 4113); JUMO diconTOUCH: B 703571.2.0, p. 18, which gives the setpoint alone, and the low word of a float first
PROCESS: Final[Mapping[str, Process]] = {
    "pband": Process(reading=0, setpoint=1, output=2),  # own
    "omron-e5cc": Process(reading=0x2000, setpoint=0x2103, output=0x2004, working=0x2002),
    "eurotherm-3200": Process(reading=1, setpoint=2, output=4, working=5),
    "jumo-dicon": Process(reading=0x1231, setpoint=0x122F, output=0x1233, floats=True),  # reading and output: own
    "omega-cn7800": Process(reading=0x1000, setpoint=0x1001, output=0x1012),
}
_OWN_WORDS: Final = 3  # of the generic one: its first parameter


def _wanted(make: Make, process: Process) -> dict[str, tuple[int, str]]:
    """Return name → register and format; of what an instrument measures and does beginning with a space."""
    plain, size = ("REAL", 2) if process.floats else ("INT", 1)
    points = {" reading": (process.reading, plain), " setpoint": (process.setpoint, plain),
              " output": (process.output, plain)}
    if process.working is not None:
        points[" working"] = (process.working, plain)
    for number, entry in enumerate(make.entries, start=_OWN_WORDS):
        register = number_of(make, entry)
        points[entry.name] = (number if register is None else register, "REAL" if entry.real else "INT")
    registers = {register for register, _ in points.values()}
    near = sorted((process.reading, process.working or process.setpoint, process.output))
    between = [register for register in range(near[0], near[-1], size) if register not in registers]
    return points | {f" {register}": (register, plain) for register in between}


class InstrumentBlock(Laid):
    """The Modbus registers of a panel instrument, without gaps; see `heatertune.live.block_memory.Laid`.

    Registers between reading, setpoint and output read 0, so that one request reads all three. A real instrument
    refuses a number out of its range; here it is replaced by the previous one at the next sample.
    """

    def __init__(self, controller: Controller, words: Words, assume: Any) -> None:
        """Take words of a make; see `heatertune.live.block_memory.Laid`."""
        make, process = MAKES[controller.name], PROCESS[controller.name]
        places, runs = registers(_wanted(make, process), turned=process.floats)
        parameters = {name: place for name, place in places.items() if name[0] != " "}
        self.layout = Layout(
            description=f"{len(parameters)} parameters and what it measures and does", speaks=MODBUS, registers=runs,
            length=2 * sum(run.size for run in runs), setpoint=places[" setpoint"], reading=places[" reading"],
            power=places[" output"], words=parameters)
        self._working, self._digits = places.get(" working"), 1.0 if process.floats else 10.0
        self._fields = {field.name: field for field in controller.fields}
        self._measure = partial(controller.measure, words)
        self._counts, self._written = 0, b""
        super().__init__(controller, words, assume)
        self._good = dict(words.values)

    def _signals(self, degC: tuple[float, float]) -> dict[str, BlockSignal]:  # noqa: ARG002 - shown in °C
        places = {"temperature": self.layout.reading, "power": self.layout.power,
                  "setpoint": self._working or self.layout.setpoint}
        return {name: self._signal(place, (0.0, self._digits)) for name, place in places.items()}

    def ask(self, cells: bytearray, _running: ControllerState, setpoint: Number) -> None:
        """Write the setpoint's temperature; until somebody writes another, it is the number of counts itself."""
        self._counts = int(setpoint)
        self._show(cells, self.layout.setpoint, self._degC(setpoint))
        self._written = bytes(cells[self.layout.setpoint.part])

    def read_in(self, cells: bytearray, reading: Number) -> None:
        """Write the reading's temperature."""
        self._show(cells, self.layout.reading, self._degC(reading))

    def run(
        self, cells: bytearray, running: ControllerState, state: Any, reading: Number
    ) -> tuple[Any, float, Number, int]:
        """Return the result of a sample."""
        if bytes(cells[self.layout.setpoint.part]) != self._written:
            self._take_setpoint(cells)
        if self._working is not None:
            self._working.write(cells, self.layout.setpoint.read(cells))
        return self._controller.core.step(running.parameters, state, self._counts, int(reading), True)

    def tell(self, cells: bytearray, _running: ControllerState, _after: Any, output: Number) -> None:
        """Write the output."""
        self._show(cells, self.layout.power, output)

    def _take_setpoint(self, cells: bytearray) -> None:
        """Take what somebody has written; put the setpoint before back where it is no number of the range."""
        number, scaling = self.layout.setpoint.read(cells), self._words.scaling
        degC = number / self._digits
        if scaling.low_degC <= degC <= scaling.high_degC:
            self._counts, self._written = int(self._measure(degC)), bytes(cells[self.layout.setpoint.part])
        else:
            cells[self.layout.setpoint.part] = self._written

    def _taken(self, cells: bytearray) -> ControllerState:
        for name, place in self.layout.words.items():
            value = place.read(cells)
            if self._fields[name].takes(value):
                self._good[name] = value
            else:
                place.write(cells, self._good[name])
        return super()._taken(cells)

    def _degC(self, counts: Number) -> float:
        scaling = self._words.scaling
        return scaling.low_degC + scaling.span_degC * counts / COUNTS

    def _show(self, cells: bytearray, place: CellAddress, value: float) -> None:
        """Write a number in the digits of its register."""
        digits = value * self._digits
        place.write(cells, digits if place.format == "REAL" else min(max(round(digits), _LEAST), _MOST))
