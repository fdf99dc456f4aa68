"""The exported program of the tip's PID in its CPU."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from heatertune.plc.cpu.s7_300.exported import ExportedS7
from heatertune.plc.ramp import Number
from heatertune.plc.s7_300.step import PidTipAssumptions, percent

__all__ = ["loaders"]

_FILE: Final = "s7_300_pid.awl"
_OUT: Final = slice(6, 8)


class _Exported(ExportedS7):
    def setpoint_bits(self, counts: int) -> int:
        return counts

    def outcome(self) -> tuple[Number, float]:
        output = int.from_bytes(self._cpu.memory["DB 100"][_OUT], "big", signed=True)
        return output, percent(output)

    def force(self, output: Number) -> None:
        self._cpu.memory["DB 100"][_OUT] = int(output).to_bytes(2, "big", signed=True)


def loaders(files: Mapping[str, str | bytes], assume: PidTipAssumptions) -> dict[str, Callable[[], ExportedS7]]:
    """Return what loads the source; nothing for other assumptions than its own: the text is one of several."""
    return {_FILE: lambda: _Exported(str(files[_FILE]), {})} if assume == PidTipAssumptions() else {}
