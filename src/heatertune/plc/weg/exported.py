"""The exported programs in a machine for structured text; WEG's own block, which is firmware, is the proof's."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final

from heatertune.errors import InputError
from heatertune.plc.cpu.iec.machine import Firmware, Program, Value
from heatertune.plc.cpu.iec.project import project_of
from heatertune.plc.cpu.iec.text import units
from heatertune.plc.exported import Called
from heatertune.plc.ramp import Number
from heatertune.plc.weg.step import COLD, Assumptions, Inputs, block_of, call
from heatertune.plc.weg.words import FIELDS

__all__ = ["exported"]

_CALL: Final = "weg_pid_call.st"
_BLOCK: Final = "weg_pid_block.st"
_PROJECT: Final = "weg_pid_plcopen.xml"
#: ms that make a call due, and that keep it from being
_DUE: Final = 1 << 30
_INPUTS: Final = {"EN": "BOOL", "SetPoint": "REAL", "ManualSetPoint": "REAL", "SelectSetPoint": "BOOL",
                  "Feedback": "REAL"}


class ExportedWeg:
    """See `heatertune.plc.exported.Exported`."""

    def __init__(self, program: Program) -> None:
        """Take a program; raise InputError where it is not of the exported form."""
        self._program, self._tick_ms = program, int(program["ScanMs"])
        self._asked: Number | None = None
        self._led = "HeaterRamp" if "HeaterRamp" in program else "HeaterSetPoint"
        self.start()

    def start(self) -> None:
        """Begin with all variables at their initial values, as nothing is declared to be retained."""
        self._program.start()
        self._program["HeaterOn"] = True
        if self._asked is not None:
            self._program["HeaterSetPoint"] = self._asked

    def call(self, asked: Number, _counts: int, reading_degC: float) -> Called:
        """Run the program when the block is due."""
        program = self._program
        if self._asked not in (None, asked):
            program["HeaterSetPoint"] = asked
        self._asked = asked
        program["HeaterTemperature"] = reading_degC
        program["HeaterSince"] = _DUE
        program.scan()
        power = program["HeaterPower"]
        return Called(program[self._led], power, min(max(power, 0.0), 100.0))

    def interval_s(self, most: int) -> float | None:
        """Run it from one scan in which the block is due to the next."""
        program = self._program
        since: int | None = None
        for scan in range(most):
            program.scan()
            if program["HeaterDue"]:
                if since is not None:
                    return (scan - since) * self._tick_ms / 1000.0
                since = scan
        return None

    def begin(self, output: Number, ticks: int) -> bool | None:
        """Run the scan in which a period begins with this HeaterPower."""
        program = self._program
        if "HeaterOutput" not in program:
            return None
        program["HeaterPower"], program["HeaterPhase"] = output, (ticks - 1) * self._tick_ms
        return self.tick()

    def tick(self) -> bool:
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
        _CALL: lambda: ExportedWeg(Program(units(str(files[_CALL])), {"FB_PID": _firmware(assume)}))}
    if assume == Assumptions():
        loads |= {_BLOCK: lambda: ExportedWeg(Program(units(str(files[_BLOCK])), {})),
                  _PROJECT: lambda: _check_project(str(files[_PROJECT]), str(files[_BLOCK]))}
    return loads


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


def _firmware(assume: Assumptions) -> Firmware:
    """Return WEG's block under the assumptions."""
    def make() -> Callable[[Mapping[str, Value]], Mapping[str, Value]]:
        state = COLD

        def run(given: Mapping[str, Any]) -> dict[str, Value]:
            nonlocal state
            inputs = Inputs(given["SetPoint"], given["Feedback"], given["ManualSetPoint"], given["SelectSetPoint"],
                            given["EN"])
            state = call(block_of(given, assume), assume, state, inputs)
            return {"Output": state.output}

        return run

    return Firmware({**_INPUTS, **{field.name: field.format for field in FIELDS}, "Output": "REAL"}, make)
