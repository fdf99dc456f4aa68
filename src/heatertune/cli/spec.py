"""`heatertune spec`: what words must keep, as a file."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from heatertune import options
from heatertune.cli import printing
from heatertune.codec import encode
from heatertune.report.layout import table
from heatertune.settings import Conditions
from heatertune.writing import write_files

__all__ = ["add_to"]

_EXAMPLE = "example: heatertune spec oven --limit overshoot=3degC -o spec.toml"


def add_to(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "spec", help="print the specification in force as a file, with the reason for each limit", epilog=_EXAMPLE,
        description="Print the limits that parameters must keep, as a file to edit and use with --spec.",
    )
    command.add_argument("spec", metavar="NAME|FILE.toml", nargs="?",
                         help="a preset (heatertune spec --list) or a file (default: general)")
    options.add(command, Conditions, "limit", "profile")
    command.add_argument("-o", "--out", metavar="FILE.toml", help="write the specification to this file")
    command.add_argument("--list", action="store_true", help="list the presets")
    printing.add_output_options(command)
    command.set_defaults(run=_run)


def _run(settings: argparse.Namespace) -> int:
    from heatertune.proof.spec_file import in_force, spec_text  # noqa: PLC0415
    from heatertune.proof.specification import PRESETS  # noqa: PLC0415 - the help must not wait for it

    if settings.list:
        document = {"schema": "heatertune/presets/1",
                    "presets": {name: one.description for name, one in PRESETS.items()}}
        printing.output(settings, document, lambda: table([(name, one.description) for name, one in PRESETS.items()]))
        return 0
    specification = in_force(settings.spec, settings.limit, settings.profile)
    document = {"schema": "heatertune/specification/1", **encode(specification)}
    if settings.out is not None:
        target = Path(settings.out)
        write_files(target.parent, {target.name: spec_text(specification)})
    printing.output(settings, document, lambda: spec_text(specification).rstrip("\n"))
    return 0
