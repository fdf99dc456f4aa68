"""`heatertune feed-forward`: a design with a measured disturbance → what the PLC makes of it."""

from __future__ import annotations

import argparse
from typing import Any

from heatertune import options, report
from heatertune.cli import printing
from heatertune.errors import ExportRefused
from heatertune.settings import FeedForwardSettings
from heatertune.writing import write_files

__all__ = ["add_to"]

_EXAMPLE = "example: heatertune feed-forward oven/ --disturbance-range 0 1 --contact"


def add_to(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "feed-forward", help="measured disturbance → feed-forward for the PLC, compared with plain feedback",
        epilog=_EXAMPLE,
        description="Design feed-forward of the disturbance that `heatertune design --disturbance-column` found in the "
                    "log, compare it with plain feedback on every plausible heater, and write its program.",
    )
    command.add_argument("directory", metavar="DIR", help="folder that `heatertune design` wrote")
    command.add_argument("-o", "--out", metavar="DIR", help="folder for the results (default: the same)")
    options.add(command, FeedForwardSettings)
    command.add_argument("--force", action="store_true", help="write the program even if a verdict is not PASS")
    printing.add_output_options(command)
    command.set_defaults(run=_run)


def _run(settings: argparse.Namespace) -> int:
    from heatertune.chain.pipeline import feed_forward  # noqa: PLC0415 - the help must not wait for it

    fed = feed_forward(settings.directory, options.of(FeedForwardSettings, settings), force=settings.force)
    out, document = settings.out or settings.directory, fed.proof.to_document()
    write_files(out, fed.files)
    written = f"written to {out}: {', '.join(sorted(fed.files))}"
    printing.output(settings, document, lambda: f"{report.feed_forward_lines(document)}\n{written}")
    if fed.proof.refusal and not settings.force:
        raise ExportRefused(f"{fed.proof.refusal}; --force writes the program anyway")
    return 0
