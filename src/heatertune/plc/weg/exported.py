"""The exported programs in a machine for structured text; WEG's own block, which is firmware, is the proof's."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final

from heatertune.plc.cpu.iec.machine import Firmware, TextProgram
from heatertune.plc.cpu.iec.text import units
from heatertune.plc.st.exported import ExportedProgram, check_project
from heatertune.plc.weg.step import BLOCK, COLD, WegAssumptions, WegInputs, WegState, call, made_of
from heatertune.plc.weg.words import FIELDS

__all__ = ["loaders"]

_CALL: Final = "weg_pid_call.st"
_BLOCK: Final = "weg_pid_block.st"
_PROJECT: Final = "weg_pid_plcopen.xml"
_INPUTS: Final = {"EN": "BOOL", "SetPoint": "REAL", "ManualSetPoint": "REAL", "SelectSetPoint": "BOOL",
                  "Feedback": "REAL"}


def loaders(files: Mapping[str, str | bytes], assume: WegAssumptions) -> dict[str,
                                                                              Callable[[], ExportedProgram | None]]:
    """Return what loads each file; the block of our own stands for the default assumptions alone."""
    loads: dict[str, Callable[[], ExportedProgram | None]] = {
        _CALL: lambda: _called(str(files[_CALL]), assume)}
    if assume == WegAssumptions():
        loads |= {_BLOCK: lambda: ExportedProgram(TextProgram(units(str(files[_BLOCK])), {})),
                  _PROJECT: lambda: check_project(str(files[_PROJECT]), str(files[_BLOCK]), _BLOCK)}
    return loads


def _called(text: str, assume: WegAssumptions) -> ExportedProgram:
    """Load the program that calls WEG's own block, whose clock, where it keeps Ts, is the program's."""
    loaded: list[TextProgram] = []
    loaded.append(TextProgram(units(text), {"FB_PID": _firmware(assume, lambda: bool(loaded[0]["HeaterDue"]))}))
    return ExportedProgram(loaded[0])


def _firmware(assume: WegAssumptions, due: Callable[[], bool]) -> Firmware:
    """Return WEG's block under the assumptions; `due` tells whether Ts is over, where it keeps Ts itself."""
    def run_when_due(
        r: list[Any], w: list[Any], f: list[Any], a: int, b: int, c: int
    ) -> None:
        if not w[b] or due():
            fb_pid(r, w, f, a, b, c)

    return Firmware({**_INPUTS, **{field.name: field.format for field in FIELDS}, "Output": "REAL"},
                    run=run_when_due if assume.sampling == BLOCK else fb_pid,
                    keeps=(*COLD, *(int(setting) for setting in assume)))


def fb_pid(
    r: Any, w: Any, _f: Any, a: int, b: int, _c: int
) -> None:
    """Run WEG's block on the rows: variables in the order of `_firmware`, then its state and the assumptions."""
    assume = WegAssumptions(
        int(w[b + 8]), w[b + 9] != 0, w[b + 10] != 0, w[b + 11] != 0, w[b + 12] != 0, w[b + 13] != 0, w[b + 14] != 0,
        int(w[b + 15]))
    block = made_of(r[a + 3], r[a + 4], r[a + 5], r[a + 6], r[a + 7], r[a + 8], w[b + 4], w[b + 2] != 0, w[b + 3] != 0,
                    assume)
    before = WegState(w[b + 5] != 0, r[a + 10], r[a + 11], r[a + 12], r[a + 13], w[b + 6] != 0, w[b + 7] != 0)
    after = call(block, assume, before, WegInputs(r[a], r[a + 2], r[a + 1], w[b + 1] != 0, w[b] != 0))
    w[b + 5], w[b + 6], w[b + 7] = after.enabled, after.overflow, after.skips
    r[a + 10], r[a + 11], r[a + 12], r[a + 13] = after.reference, after.error, after.integral, after.output
    r[a + 9] = after.output
