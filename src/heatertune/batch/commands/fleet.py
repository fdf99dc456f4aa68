"""`heatertune fleet`: many logs → one table of proven words."""

from __future__ import annotations

import argparse
from typing import Any

from heatertune import options, report
from heatertune.batch.commands.table_options import Bar, add_table_options, workers
from heatertune.cli import common, printing
from heatertune.settings import FitSettings, SampleSettings, WordSettings

__all__ = ["add_to"]

_EXAMPLE = "example: heatertune fleet logs/ --target s7-300 -o fleet.parquet"


def add_to(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "fleet", help="many logs → one table: each fitted, tuned, rounded and proven", epilog=_EXAMPLE,
        description="Run the chain on the log of every zone of a plant and write one row per log. A log that cannot be "
                    "read, fitted or proven gets a row with the reason. Exits 0 once the table is written, whatever "
                    "its verdicts.",
    )
    command.add_argument("logs", metavar="LOGS", help="a folder, a quoted pattern, or a list of paths")
    add_table_options(command)
    options.add(command, SampleSettings, "samples",
                help="also prove each zone on N sampled heaters; see: design --samples")
    options.add(command, WordSettings, "words_by", "as_is")
    common.add_proof_options(command)
    common.add_log_options(command)
    common.add_tuning_options(command)
    printing.add_output_options(command)
    command.set_defaults(run=_run)


def _run(settings: argparse.Namespace) -> int:
    from heatertune.batch.fleets import ZoneSettings, fleet  # noqa: PLC0415 - the help must not wait for it

    zones = ZoneSettings(request=common.design_request(settings), read=common.reading(settings),
                         fitted_with=options.of(FitSettings, settings))
    document = fleet(settings.logs, zones, out=settings.out, workers=workers(settings), resume=settings.resume,
                     progress=Bar(settings, "zones"))
    printing.output(settings, document, lambda: report.outcome_lines(document))
    return 0
