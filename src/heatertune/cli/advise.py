"""`heatertune advise`: a logged response → WEG's advice for it, proven before it is shown."""

from __future__ import annotations

import argparse
from typing import Any

from heatertune import plc, report
from heatertune.cli import common, printing
from heatertune.cli.saved_design import in_force
from heatertune.errors import InputError

__all__ = ["add_to"]

_EXAMPLE = "example: heatertune advise table4 --pid pid.json --target s5-ob251 --setpoint 53.3"


def add_to(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "advise", help="logged response → WEG's retuning advice, each step proven on the model", epilog=_EXAMPLE,
        description="Find the symptom of WEG's manual that a closed-loop response shows, and what the manual's advice "
                    "would change: gains, verdict, overshoot, settling time and IAE before and after each step. Exit "
                    "status 1 if neither the design nor any step passes.",
    )
    command.add_argument("log", metavar="LOG|proof",
                         help="CSV file, table3 or table4; or proof: the response in the design's own proof")
    command.add_argument("--pid", required=True, metavar="FILE", help="pid.json as written by tune, with its model")
    common.add_proof_options(command, target="weg")
    common.add_reading_options(command)
    printing.add_output_options(command)
    command.set_defaults(run=_run)


def _run(settings: argparse.Namespace) -> int:
    from heatertune.log import read_log  # noqa: PLC0415
    from heatertune.pid.document import read_design  # noqa: PLC0415
    from heatertune.proof.advice import advise  # noqa: PLC0415 - the help must not wait for it

    design, model, kept = read_design(settings.pid)
    if model is None:
        raise InputError(f"{settings.pid} holds no model to prove on; expected pid.json as written by tune")
    progress = printing.Progress(settings)
    plc.controller_for(common.target(settings))  # an unknown target is refused before the log is read
    log = None if settings.log == "proof" else read_log(settings.log, common.reading(settings))
    printing.tell_taken(settings, [] if log is None else [log], progress)
    recipe, notes = in_force(settings, kept, settings.pid)
    for note in notes:
        progress.note(note)
    document = advise(design, model, recipe, log, until_s=settings.until, progress=progress)
    printing.output(settings, document, lambda: report.advice_table(document))
    return 0 if any(case["verdict"] == "PASS" for case in document["cases"]) else 1
