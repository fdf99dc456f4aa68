"""The exported program in a machine for structured text."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

from heatertune.plc.cpu.iec.machine import TextProgram
from heatertune.plc.cpu.iec.text import units
from heatertune.plc.iec_pid.export import PROJECT, TEXT
from heatertune.plc.iec_pid.step import IecPidAssumptions
from heatertune.plc.st.duration import time_to_real
from heatertune.plc.st.exported import ExportedProgram, check_project

__all__ = ["loaders"]


def loaders(
    files: Mapping[str, str | bytes], assume: IecPidAssumptions
) -> dict[str, Callable[[], ExportedProgram | None]]:
    """Return what loads each file, for a system whose TIME_TO_REAL is as assumed."""
    text, gives = str(files[TEXT]), partial(time_to_real, unit=assume.time_unit)
    return {TEXT: lambda: ExportedProgram(TextProgram(units(text), {}, gives)),
            PROJECT: lambda: check_project(str(files[PROJECT]), text, TEXT)}
