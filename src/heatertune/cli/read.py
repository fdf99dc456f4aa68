"""`heatertune read`: a file → what is read of it as what, and the command that says so."""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

from heatertune import chain
from heatertune.cli import common, printing

if TYPE_CHECKING:
    from heatertune.log.values import Log

__all__ = ["add_to", "command_of"]

_EXAMPLE = "example: heatertune read table4"
_ROWS: Final = 5  # shown
_NO_FLAG: Final = {"sample_time_s": "log-interval"}
_COLUMNS: Final = (("time_s", "time [s]"), ("temperature_degC", "temperature [°C]"), ("power_pct", "power [%]"),
                   ("setpoint_degC", "setpoint [°C]"), ("disturbance", "disturbance"))


def add_to(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "read", help="file → how its columns are read, and the command that repeats it", epilog=_EXAMPLE,
        description="Show how a log is read: its first rows, the meaning and unit of each column, what was assumed, "
                    "repaired or looks odd, and the command that repeats this reading without guesses.",
    )
    command.add_argument("log", metavar="LOG", help="a CSV file, or the built-in table3 / table4")
    common.add_reading_options(command)
    printing.add_output_options(command)
    command.set_defaults(run=_run)


def _run(settings: argparse.Namespace) -> int:

    log = chain.read_log(settings.log, common.reading(settings))
    if settings.until is not None:
        log = log.window(float(log.time_s[0]), settings.until)
    document = _document(settings.log, log)
    printing.output(settings, document, lambda: _lines(document))
    return 0


def command_of(source: str, reading: Mapping[str, Any]) -> str:
    """Return the command line that reads a file with these options of `read_log`."""
    parts = ["heatertune", "read", source]
    for name, value in reading.items():
        parts.append(f"--{_NO_FLAG.get(name, name.replace('_', '-'))}")
        if value is not True:
            parts.append(str(value).removesuffix(".0") if isinstance(value, float) else str(value))
    return shlex.join(parts)


def _document(source: str, log: Log) -> dict[str, Any]:
    assert log.taken is not None
    rows = [{name: float(getattr(log, name)[k]) for name, _ in _COLUMNS if getattr(log, name) is not None}
            for k in range(_ROWS)]
    return {
        "schema": "heatertune/reading/2", "name": log.name, "source": log.source, "taken": log.taken.document(),
        "first_rows": rows, "repairs": list(log.repairs), "warnings": list(log.warnings),
        "command": command_of(source, log.taken.reading),
    }


def _lines(document: Mapping[str, Any]) -> str:
    rows = document["first_rows"]
    heads = [(name, head) for name, head in _COLUMNS if name in rows[0]]
    table = [[head for _, head in heads], *([f"{row[name]:.7g}" for name, _ in heads] for row in rows)]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    shown = ["  ".join(f"{cell:>{width}}" for cell, width in zip(row, widths, strict=True)) for row in table]
    parts = [document["taken"]["line"], "\n".join(shown)]
    for title, notes in (("Changed or assumed", document["repairs"]), ("Odd, but left as it is", document["warnings"])):
        if notes:
            parts.append("\n".join([f"{title}:", *(f"- {sentence}" for sentence in notes)]))
    return "\n\n".join([*parts, f"The same with nothing left to guess:\n{document['command']}"])
