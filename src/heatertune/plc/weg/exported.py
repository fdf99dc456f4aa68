"""The exported programs in a machine for structured text; WEG's own block, which is firmware, is the proof's."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from operator import itemgetter
from typing import Any, Final

from heatertune.plc.cpu.iec.machine import Firmware, Program, Value
from heatertune.plc.cpu.iec.text import units
from heatertune.plc.st.exported import ExportedProgram, check_project
from heatertune.plc.weg.step import BLOCK, COLD, Assumptions, Inputs, block_of, call
from heatertune.plc.weg.words import FIELDS

__all__ = ["exported"]

_CALL: Final = "weg_pid_call.st"
_BLOCK: Final = "weg_pid_block.st"
_PROJECT: Final = "weg_pid_plcopen.xml"
_words: Final = itemgetter(*(field.name for field in FIELDS))
_INPUTS: Final = {"EN": "BOOL", "SetPoint": "REAL", "ManualSetPoint": "REAL", "SelectSetPoint": "BOOL",
                  "Feedback": "REAL"}


def exported(files: Mapping[str, str | bytes], assume: Assumptions) -> dict[str, Callable[[], ExportedProgram | None]]:
    """Return what loads each file; the block of our own stands for the default assumptions alone."""
    loads: dict[str, Callable[[], ExportedProgram | None]] = {
        _CALL: lambda: _called(str(files[_CALL]), assume)}
    if assume == Assumptions():
        loads |= {_BLOCK: lambda: ExportedProgram(Program(units(str(files[_BLOCK])), {})),
                  _PROJECT: lambda: check_project(str(files[_PROJECT]), str(files[_BLOCK]), _BLOCK)}
    return loads


def _called(text: str, assume: Assumptions) -> ExportedProgram:
    """Load the program that calls WEG's own block, whose clock, where it keeps Ts, is the program's."""
    loaded: list[Program] = []
    loaded.append(Program(units(text), {"FB_PID": _firmware(assume, lambda: bool(loaded[0]["HeaterDue"]))}))
    return ExportedProgram(loaded[0])


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
