"""The exported programs in a machine for structured text; WEG's own block, which is firmware, is the proof's."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from operator import itemgetter
from typing import Any, Final

from heatertune.errors import InputError
from heatertune.plc.cpu.iec.machine import Firmware, Program, Value
from heatertune.plc.cpu.iec.project import project_of
from heatertune.plc.cpu.iec.text import units
from heatertune.plc.exported import Called
from heatertune.plc.ramp import Number
from heatertune.plc.weg.step import BLOCK, COLD, Assumptions, Inputs, block_of, call
from heatertune.plc.weg.words import FIELDS

__all__ = ["exported"]

_CALL: Final = "weg_pid_call.st"
_BLOCK: Final = "weg_pid_block.st"
_PROJECT: Final = "weg_pid_plcopen.xml"
#: ms that make a call due, and that keep it from being
_DUE: Final = 1 << 30
_words: Final = itemgetter(*(field.name for field in FIELDS))
_INPUTS: Final = {"EN": "BOOL", "SetPoint": "REAL", "ManualSetPoint": "REAL", "SelectSetPoint": "BOOL",
                  "Feedback": "REAL"}


class ExportedWeg:
    """See `heatertune.plc.exported.Exported`."""

    def __init__(self, program: Program) -> None:
        """Take a program; raise InputError where it is not of the exported form."""
        self._program, self._tick_ms = program, int(program["ScanMs"])
        self._led = "HeaterRamp" if "HeaterRamp" in program else "HeaterSetPoint"
        self._pwm, self._calls_each_scan = "HeaterOutput" in program, "BlockKeepsTs" in program
        self._asked: Number | None = None
        self.start()

    @property
    def tick_s(self) -> float:
        """Initial value of ScanMs [s]."""
        return self._tick_ms / 1000.0

    def start(self) -> None:
        """Begin with all variables at their initial values, as nothing is declared to be retained."""
        self._program.start()
        self._program["HeaterOn"], self._begun = True, False
        if self._asked is not None:
            self._program["HeaterSetPoint"] = self._asked

    def call(self, asked: Number, counts: int, reading_degC: float) -> Called:
        """Run the program when the block is due."""
        if self._begun:
            self._program["HeaterSince"] = _DUE
        return self.tick(asked, counts, reading_degC)[0]

    def tick(self, asked: Number, counts: int, reading_degC: float) -> tuple[Called, bool | None]:  # noqa: ARG002
        """Run a scan."""
        program = self._program
        if self._asked not in (None, asked):
            program["HeaterSetPoint"] = asked
        self._asked, self._begun = asked, True
        program["HeaterTemperature"] = reading_degC
        program.scan()
        power = program["HeaterPower"]
        called = Called(program[self._led], power, min(max(power, 0.0), 100.0))
        return called, program["HeaterOutput"] if self._pwm else None

    def interrupt(self) -> tuple[float, bool | None]:
        """Run a scan without HeaterOn, which has to fall when the sensor breaks."""
        program, self._begun = self._program, False
        program["HeaterOn"] = False
        program.scan()
        program["HeaterOn"] = True
        return program["HeaterPower"], program["HeaterOutput"] if self._pwm else None

    def begin(self, output: Number, ticks: int) -> bool | None:
        """Run the scan in which a period begins with this HeaterPower."""
        if not self._pwm:
            return None
        program = self._program
        if self._calls_each_scan:  # a block that is called each scan would give its own
            program["BlockKeepsTs"] = False
        program["HeaterPower"], program["HeaterPhase"] = output, (ticks - 1) * self._tick_ms
        program["HeaterOnMs"] = -1  # anything else than what it has to become
        return self.go_on()

    def go_on(self) -> bool:
        """Run a scan in which the block is not due."""
        self._program["HeaterSince"] = -_DUE
        self._program.scan()
        return bool(self._program["HeaterOutput"])

    def counted(self) -> float:
        """Return HeaterOnMs in scans."""
        return float(self._program["HeaterOnMs"]) / self._tick_ms


def exported(files: Mapping[str, str | bytes], assume: Assumptions) -> dict[str, Callable[[], ExportedWeg | None]]:
    """Return what loads each file; the block of our own stands for the default assumptions alone."""
    loads: dict[str, Callable[[], ExportedWeg | None]] = {
        _CALL: lambda: _called(str(files[_CALL]), assume)}
    if assume == Assumptions():
        loads |= {_BLOCK: lambda: ExportedWeg(Program(units(str(files[_BLOCK])), {})),
                  _PROJECT: lambda: _check_project(str(files[_PROJECT]), str(files[_BLOCK]))}
    return loads


def _called(text: str, assume: Assumptions) -> ExportedWeg:
    """Load the program that calls WEG's own block, whose clock, where it keeps Ts, is the program's."""
    loaded: list[Program] = []
    loaded.append(Program(units(text), {"FB_PID": _firmware(assume, lambda: bool(loaded[0]["HeaterDue"]))}))
    return ExportedWeg(loaded[0])


def _check_project(project: str, text: str) -> None:
    """Raise InputError where a project does not hold the program of a text, called at its tick."""
    held, wanted = project_of(project), units(text)
    for unit in wanted:
        if unit not in held.units:
            raise InputError(f"its {unit.name} is not that of {_BLOCK}")
    program = wanted[-1]
    tick = next((each.initial for each in program.variables if each.name == "SCANMS"), None)
    if tick is None or (held.calls, held.interval_ms) != (program.name, tick.value):
        raise InputError(f"its task calls {held.calls} every {held.interval_ms} ms; {_BLOCK} has another tick")


def _firmware(assume: Assumptions, due: Callable[[], bool]) -> Firmware:
    """Return WEG's block under the assumptions; `due` tells whether Ts is over, where it keeps Ts itself."""
    def make() -> Callable[[Mapping[str, Value]], Mapping[str, Value]]:
        state, held, block = COLD, tuple[Value, ...](), None

        def run(given: Mapping[str, Any]) -> dict[str, Value]:
            nonlocal state, held, block
            if assume.sampling == BLOCK and given["EN"] and not due():
                return {"Output": state.output}
            if block is None or _words(given) != held:
                held, block = _words(given), block_of(given, assume)
            inputs = Inputs(given["SetPoint"], given["Feedback"], given["ManualSetPoint"], given["SelectSetPoint"],
                            given["EN"])
            state = call(block, assume, state, inputs)
            return {"Output": state.output}

        return run

    return Firmware({**_INPUTS, **{field.name: field.format for field in FIELDS}, "Output": "REAL"}, make)
