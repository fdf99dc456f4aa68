"""`heatertune report`: the documents of a design → report.html, once more, and with what the plant really does."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from heatertune import options, report
from heatertune.cli import common, printing
from heatertune.cli.command_table import written_in
from heatertune.commissioned import AsLeftSettings, RecordSettings
from heatertune.errors import InputError
from heatertune.settings import ReadSettings

if TYPE_CHECKING:
    from heatertune.proof.write_comparison import WriteHistory

__all__ = ["add_to"]

_EXAMPLE = "example: heatertune report out/ --as-left trace.csv --plant-tag TIC-101"


def add_to(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "report", help="rebuild report.html, with the commissioned loop", epilog=_EXAMPLE,
        description="Rebuild report.html from the JSON documents that `heatertune design` wrote. With --as-left, "
                    "compare a trace of the commissioned loop with the proof, which is repeated from the beginning of "
                    "the trace; exit status 1 if the loop is not as proven. With --record, include what was written "
                    "into the PLC; exit status 1 if that did not end in DONE.",
    )
    command.add_argument("directory", metavar="DIR", help="folder that `heatertune design` wrote")
    options.add(command.add_argument_group("the record"), RecordSettings)
    group = command.add_argument_group("as left")
    group.add_argument("--as-left", metavar="TRACE",
                       help="an export of the commissioned loop: time and temperature; setpoint and power if available")
    options.add(group, AsLeftSettings)
    options.add(command.add_argument_group("reading the trace"), ReadSettings)
    command.add_argument_group("written into the PLC").add_argument(
        "--record", action="extend", nargs="+", metavar="RECORD",
        help="records of heatertune write with these parameters: as found, as left and the watched response, in order "
             "of time; they replace earlier ones")
    printing.add_output_options(command, brief=True)
    command.set_defaults(run=_run)


def _run(settings: argparse.Namespace) -> int:
    from heatertune.chain.documents import without_curves  # noqa: PLC0415 - the help must not wait for it
    from heatertune.chain.pipeline import redraw  # noqa: PLC0415
    from heatertune.log import read_log  # noqa: PLC0415
    from heatertune.report.as_left import CURVES, as_left_brief  # noqa: PLC0415

    about, progress = options.of(AsLeftSettings, settings), printing.Progress(settings)
    if settings.as_left is None and about != AsLeftSettings():
        raise InputError("--setpoint, --ambient, --begins-at and --load-at need --as-left TRACE")
    written = _written(settings)
    trace = None if settings.as_left is None else read_log(settings.as_left, common.reading(settings), errata=True)
    printing.tell_taken(settings, [] if trace is None else [trace], progress)
    documents = redraw(settings.directory, trace, about, options.of(RecordSettings, settings), progress,
                       written=written)
    page = Path(settings.directory) / "report.html"
    is_done = written is None or written.passages[-1].outcome == "done"
    if trace is not None:
        left, target = documents["as_left"], documents["words"]["target"]
        printing.output(settings, left, lambda: as_left_brief(left, target, str(page), whole=True),
                        brief=lambda: as_left_brief(left, target, str(page)),
                        short=lambda: {name: part for name, part in left.items() if name not in CURVES})
        return 0 if left["verdict"] == "AS PROVEN" and is_done else 1
    if written is not None:

        printing.output(settings, documents["written"], lambda: report.written_brief(documents["written"], str(page)))
        return 0 if is_done else 1
    printing.output(settings, documents, lambda: f"{report.summary(documents)}\n{page}",
                    brief=lambda: report.design_brief(documents, settings.directory),
                    short=lambda: without_curves(documents))
    return 0 if documents["proof"]["verdict"] == "PASS" else 1


def _written(settings: argparse.Namespace) -> WriteHistory | None:
    return None if settings.record is None else written_in(settings.record, settings.directory)
