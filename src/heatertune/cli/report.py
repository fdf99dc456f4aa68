"""`heatertune report`: the documents of a design → report.html, once more."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from heatertune.cli import printing

__all__ = ["add_to"]

_EXAMPLE = "example: heatertune report out/"


def add_to(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "report", help="draw report.html anew from the documents in a directory", epilog=_EXAMPLE,
        description="Make report.html from the JSON documents that `heatertune design` wrote; nothing is computed.",
    )
    command.add_argument("directory", metavar="DIR", help="directory that `heatertune design` wrote")
    printing.add_output_options(command, brief=True)
    command.set_defaults(run=_run)


def _run(settings: argparse.Namespace) -> int:
    from heatertune.chain.documents import without_curves  # noqa: PLC0415 - the help must not wait for it
    from heatertune.chain.whole import redraw  # noqa: PLC0415
    from heatertune.report.brief import design_brief  # noqa: PLC0415
    from heatertune.report.text import summary  # noqa: PLC0415

    documents = redraw(settings.directory)
    printing.output(
        settings, documents, lambda: f"{summary(documents)}\n{Path(settings.directory) / 'report.html'}",
        brief=lambda: design_brief(documents, settings.directory), short=lambda: without_curves(documents))
    return 0 if documents["proof"]["verdict"] == "PASS" else 1
