"""A program that was exported as structured text, in a machine that runs it."""

from __future__ import annotations

from typing import Final

from heatertune.errors import InputError
from heatertune.plc.cpu.iec.machine import Program
from heatertune.plc.cpu.iec.project import project_of
from heatertune.plc.cpu.iec.text import units
from heatertune.plc.exported import Called
from heatertune.plc.ramp import Number

__all__ = ["ExportedProgram", "check_project"]

#: ms that make a call due, and that keep it from being
_DUE: Final = 1 << 30


class ExportedProgram:
    """See `heatertune.plc.exported.Exported`; the program is that of `heatertune.plc.st.program`."""

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


def check_project(project: str, text: str, file: str) -> None:
    """Hold a project against the text of a file.

    Raises:
        InputError: it does not hold the program of the text, called at its tick.
    """
    held, wanted = project_of(project), units(text)
    for unit in wanted:
        if unit not in held.units:
            raise InputError(f"its {unit.name} is not that of {file}")
    program = wanted[-1]
    tick = next((each.initial for each in program.variables if each.name == "SCANMS"), None)
    if tick is None or (held.calls, held.interval_ms) != (program.name, tick.value):
        raise InputError(f"its task calls {held.calls} every {held.interval_ms} ms; {file} has another tick")
