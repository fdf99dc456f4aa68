"""A program that was exported as structured text, in a machine that runs it."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from heatertune.errors import InputError
from heatertune.plc.cpu.iec.machine import KEEP, Tape, TextProgram
from heatertune.plc.cpu.iec.st_syntax import units
from heatertune.plc.exported import CallInputs, CallOutputs, CallResult, ExportedInPlc
from heatertune.plc.ramp import Number
from heatertune.plc.st.plcopen import project_of

__all__ = ["ExportedProgram", "check_project"]

#: ms that make a call due, and that keep it from being
_DUE: Final = 1 << 30


class ExportedProgram(ExportedInPlc):
    """See `heatertune.plc.exported.ExportedInPlc`; the program is that of `heatertune.plc.st.program_text`."""

    def __init__(self, program: TextProgram) -> None:
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

    def call(self, target: Number, counts: int, reading_degC: float) -> CallResult:
        """Run the program when the block is due."""
        if self._begun:
            self._program["HeaterSince"] = _DUE
        return self.tick(target, counts, reading_degC)[0]

    def tick(self, target: Number, counts: int, reading_degC: float) -> tuple[CallResult, bool | None]:  # noqa: ARG002
        """Run a scan."""
        program = self._program
        if self._asked not in (None, target):
            program["HeaterSetPoint"] = target
        self._asked, self._begun = target, True
        program["HeaterTemperature"] = reading_degC
        program.scan()
        power = program["HeaterPower"]
        result = CallResult(program[self._led], power, min(max(power, 0.0), 100.0))
        return result, program["HeaterOutput"] if self._pwm else None

    def calls(self, inputs: CallInputs) -> CallOutputs | None:
        """Run the program so often, each time when the block is due."""
        since = np.full(len(inputs.power_pct), _DUE)
        if not self._begun:
            since[0] = KEEP
        return self._scans(inputs, {"HeaterSince": since})

    def ticks(self, inputs: CallInputs) -> CallOutputs | None:
        """Run so many scans."""
        return self._scans(inputs, {})

    def _scans(self, inputs: CallInputs, wholes: dict[str, npt.NDArray[np.int64]]) -> CallOutputs | None:
        setpoints = inputs.power_pct.copy()
        same = setpoints == np.concatenate(([setpoints[0] if self._asked is None else self._asked], setpoints[:-1]))
        setpoints[same] = np.nan
        outputs = (self._led, "HeaterPower", *(["HeaterOutput"] if self._pwm else []))
        got = self._program.scans(Tape(
            len(setpoints), {"HeaterSetPoint": setpoints, "HeaterTemperature": inputs.readings_degC}, wholes, outputs))
        if got is None:
            return None
        self._asked, self._begun, powers = float(inputs.power_pct[-1]), True, got["HeaterPower"]
        on = got["HeaterOutput"] != 0 if self._pwm else None
        return CallOutputs(got[self._led], powers, np.clip(powers, 0.0, 100.0), on)

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

    def periods(
        self, outputs: npt.NDArray[np.float64], ticks: int, lengths: npt.NDArray[np.int64]
    ) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.float64]] | None:
        """Run the scans of many periods in which the block is not due; shapes as in `Exported.periods`."""
        begins = np.concatenate(([0], np.cumsum(lengths)[:-1]))
        scans = int(lengths.sum())
        power, phase, on_ms = np.full(scans, np.nan), np.full(scans, KEEP), np.full(scans, KEEP)
        power[begins], phase[begins], on_ms[begins] = outputs, (ticks - 1) * self._tick_ms, -1
        keeps = {"BlockKeepsTs": np.zeros(scans, dtype=np.int64)} if self._calls_each_scan else {}
        got = self._program.scans(Tape(
            scans, {"HeaterPower": power}, keeps | {
                "HeaterPhase": phase, "HeaterOnMs": on_ms, "HeaterSince": np.full(scans, -_DUE)},
            ("HeaterOutput", "HeaterOnMs")))
        if got is None:
            return None
        return np.add.reduceat(got["HeaterOutput"], begins), got["HeaterOnMs"][begins] / self._tick_ms

    def tick_count(self) -> float:
        """Return HeaterOnMs in scans."""
        return float(self._program["HeaterOnMs"]) / self._tick_ms


def check_project(project: str, text: str, file: str) -> None:
    """Hold a project against the text of a file.

    Raises:
        InputError: it does not hold the program of the text, called at its tick.
    """
    sheet, unit_names = project_of(project), units(text)
    for unit in unit_names:
        if unit not in sheet.units:
            raise InputError(f"its {unit.name} is not that of {file}")
    program = unit_names[-1]
    tick = next((each.initial for each in program.variables if each.name == "SCANMS"), None)
    if tick is None or (sheet.calls, sheet.interval_ms) != (program.name, tick.value):
        raise InputError(f"its task calls {sheet.calls} every {sheet.interval_ms} ms; {file} has another tick")
