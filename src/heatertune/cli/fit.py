"""`heatertune fit`: log → model."""

from __future__ import annotations

import argparse
from typing import Any

from heatertune.cli import common

__all__ = ["add_to"]

_EXAMPLE = "example: heatertune fit table4 -o model.json"


def add_to(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "fit", help="log → model: FOPDT with intervals, and every model that explains the log", epilog=_EXAMPLE,
        description="Identify the heater behind a temperature log.",
    )
    command.add_argument("log", metavar="LOG", help="a CSV file, or table3 / table4 built in")
    command.add_argument("-o", "--out", metavar="FILE", help="write the model to this JSON file")
    common.add_log_options(command)
    common.add_output_options(command)
    command.set_defaults(run=_run)


def _run(settings: argparse.Namespace) -> int:
    from heatertune import chain  # noqa: PLC0415 - the help must not wait for it
    from heatertune.model.document import to_document  # noqa: PLC0415
    from heatertune.report.text import model_lines  # noqa: PLC0415

    log = chain.read_log(settings.log, **common.reading(settings))
    progress = common.Progress(settings)
    for told in (*log.repairs, *log.doubts):
        progress(told)
    document = to_document(chain.fit(log, progress=progress, **common.fitting(settings)))
    common.save(settings.out, document)
    common.output(settings, document, lambda: model_lines(document))
    return 0
