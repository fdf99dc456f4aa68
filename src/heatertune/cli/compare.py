"""`heatertune compare`: one design on every controller."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from heatertune import chain, options, report
from heatertune.cli import common, printing
from heatertune.cli.saved_design import in_force
from heatertune.codec import DATA, plain, to_json
from heatertune.errors import InputError
from heatertune.settings import SensorSettings
from heatertune.writing import write_files

__all__ = ["add_to"]

_EXAMPLE = "example: heatertune compare pid.json -o out/"


def add_to(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "compare", help="one design on every controller: IAE, overshoot, offset, and the cost of rounding",
        epilog=_EXAMPLE,
        description="Round a design to the parameters of every controller, prove each, and compare them.",
    )
    command.add_argument("pid", metavar="PID", help="pid.json as written by tune")
    command.add_argument("-o", "--out", metavar="DIR", help="folder for compare.html and data/compare.json")
    common.add_condition_options(command, "range_degC")
    common.add_model_options(command)
    printing.add_output_options(command, brief=True)
    command.set_defaults(run=_run)


def _run(settings: argparse.Namespace) -> int:
    from heatertune.proof.repetition import scaling_of  # noqa: PLC0415 - the help must not wait for it

    design, fitted, kept = common.design_and_model(settings)
    progress, (recipe, notes) = printing.Progress(settings), in_force(settings, kept, settings.pid)
    for note in notes:
        progress.note(note)
    if recipe.input is not None:
        if "range_degC" not in options.provided_options(SensorSettings, settings):
            raise InputError(f"{settings.pid} is for --input {recipe.input} of {recipe.target}, which others have not: "
                             "say a --range")
        recipe = replace(recipe, input=None)
    document = plain(chain.compare(
        design, fitted, recipe.conditions, scaling=scaling_of(recipe), recipe=recipe, progress=progress))
    if settings.out is not None:
        write_files(settings.out, {
            f"{DATA}/compare.json": to_json(document), "compare.html": report.render_targets(document)})
    printing.output(settings, document, lambda: report.targets_table(document),
                    brief=lambda: report.targets_brief(document),
                    short=lambda: {**document, "rows": [_without_curves(row) for row in document["rows"]]})
    return 0


def _without_curves(row: Mapping[str, Any]) -> dict[str, Any]:
    return {name: part for name, part in row.items() if name not in ("series", "ideal")}
