"""`heatertune health`: the logs of running loops → which are ill, why, and the words that would cure them."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from heatertune import options
from heatertune.cli import batch, common, printing
from heatertune.errors import InputError
from heatertune.settings import ReadSettings, WordSettings

__all__ = ["add_to"]

_EXAMPLE = "example: heatertune health logs/ --target s7-300 -o health.html"


def add_to(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "health", help="many running loops → which are ill, why, and the words that would cure them", epilog=_EXAMPLE,
        description="Examine the log of every running loop: swings, slow recovery, limits, wear, drift, and how far it "
        "is from what is possible for its heater. One page, the worst loop first, with proven words where words cure; "
        "a Parquet table beside it. Exit status 0 where the page is written, however ill the loops are.",
    )
    command.add_argument("logs", metavar="LOGS", help="a folder, a pattern in quotation marks, or a list of paths: one "
                         "log a loop, with setpoint, temperature and power")
    command.add_argument("--loops", metavar="FILE", help="CSV or TOML: what the logs do not say (file, name, target, "
                         "folder, setpoint_degC, switch, pwm_period_s, low_degC, high_degC)")
    command.add_argument("--since", metavar="last|FILE", help="compare with the last run, or with its Parquet table")
    common.add_proof_options(command, needed=False)
    options.add(command, WordSettings, "switch_kind", "as_is")
    options.add(command.add_argument_group("reading the logs"), ReadSettings)
    common.add_tuning_options(command)
    batch.add_table_options(command, "page; its table lies beside it, .parquet in the place of .html")
    printing.add_output_options(command)
    command.set_defaults(run=_run)


def _run(settings: argparse.Namespace) -> int:
    from heatertune.batch.loops import HealthSettings, health, last_table  # noqa: PLC0415 - the help must not wait for it
    from heatertune.report.loops import loops_lines, loops_page  # noqa: PLC0415
    from heatertune.writing import write_files  # noqa: PLC0415

    page, settings.target = Path(settings.out), settings.target or ""  # each loop may name its own
    if page.suffix.lower() not in (".html", ".htm"):
        raise InputError(f"--out {page}: expected the name of a page, .html; its table lies beside it")
    table = page.with_suffix(".parquet")
    since = None if settings.since is None else last_table(table if settings.since == "last" else settings.since)
    document = health(
        settings.logs, HealthSettings(asked=common.asked(settings), read=common.reading(settings)), out=table,
        workers=batch.workers(settings), loops=settings.loops, since=since, resume=settings.resume,
        progress=batch.Bar(settings, "loops")) | {"page": str(page)}
    write_files(page.parent, {page.name: loops_page(document)})
    printing.output(settings, document, lambda: loops_lines(document))
    return 0
