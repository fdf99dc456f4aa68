"""`heatertune study`: a sweep over anything → one table."""

from __future__ import annotations

import argparse
from typing import Any

from heatertune import report
from heatertune.batch.commands.table_options import Bar, add_table_options, workers
from heatertune.cli import printing

__all__ = ["add_to"]

_EXAMPLE = """\
example: heatertune study study.toml -o study.parquet

study.toml:
  [fixed]                                  # the same in every case
  log = "table4"                           # or model = "model.json", or gain_degC_per_pct, time_constant_s, …
  setpoint_degC = 53.3
  [grid]                                   # every combination is a case
  target = ["s5-ob251", "s7-300"]
  ms = [1.4, 1.6, 2.0]
  [[case]]                                 # one further case
  target = "s7-200"
  switches = { rails = "edges_go_on" }
"""


def add_to(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "study", help="a sweep over targets, settings and heaters → one table", epilog=_EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        description="Take every case of a study through the chain, and write one row per case. What cannot be done\n"
        "is a row with its reason. Exit status 0 where the table is written, whatever the verdicts in it.",
    )
    command.add_argument("study", metavar="STUDY.toml", help="the definition of the sweep")
    add_table_options(command)
    printing.add_output_options(command)
    command.set_defaults(run=_run)


def _run(settings: argparse.Namespace) -> int:
    from heatertune.batch.studies import study  # noqa: PLC0415 - the help must not wait for it

    document = study(
        settings.study, out=settings.out, workers=workers(settings), resume=settings.resume,
        progress=Bar(settings, "cases"),
    )
    printing.output(settings, document, lambda: report.outcome_lines(document))
    return 0
