"""The commands for the whole chain, on one controller and on all: `design` and `compare`."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from heatertune import chain, options, plc, report
from heatertune.cli import common, printing
from heatertune.cli.command_table import design_zones
from heatertune.cli.common import again
from heatertune.cli.saved_design import in_force
from heatertune.codec import DATA, plain, to_json
from heatertune.errors import InputError
from heatertune.settings import FitSettings, SampleSettings, SensorSettings, WordSettings
from heatertune.writing import write_files

if TYPE_CHECKING:
    from heatertune.chain.precompile import Worker

__all__ = ["COMPARE_EXAMPLE", "DESIGN_EXAMPLE", "add_compare", "add_design"]


COMPARE_EXAMPLE = "example: heatertune compare pid.json -o out/"


def add_compare(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "compare", help="one design on every controller: IAE, overshoot, offset, and the cost of rounding",
        epilog=COMPARE_EXAMPLE,
        description="Round a design to the parameters of every controller, prove each, and compare them.",
    )
    command.add_argument("pid", metavar="PID", help="pid.json as written by tune")
    command.add_argument("-o", "--out", metavar="DIR", help="folder for compare.html and data/compare.json")
    common.add_condition_options(command, "range_degC")
    common.add_model_options(command)
    printing.add_output_options(command, _run_compare, brief=True)


def _run_compare(settings: argparse.Namespace) -> int:
    from heatertune.proof.repetition import scaling_of

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


DESIGN_EXAMPLE = "example: heatertune design table4 --target s5-ob251 --out out/"


def add_design(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "design", help="the whole chain: log → model → pid → plc → proof → report", epilog=DESIGN_EXAMPLE,
        description="Fit the heater, tune the controller, round to its parameters, prove them, and write the "
                    "documents, the export files and report.html.",
    )
    command.add_argument("log", metavar="LOG", help="a CSV file, or the built-in table3 / table4")
    command.add_argument("-o", "--out", metavar="DIR", help="folder for the results (default: named after the log)")
    options.add(command, WordSettings)
    command.add_argument("--force", action="store_true", help="export even if the verdict is not PASS")
    common.add_proof_options(command)
    common.add_log_options(command)
    common.add_tuning_options(command)
    options.add(command.add_argument_group("many heaters"), SampleSettings, but=("replay",))
    _add_zones(command.add_argument_group("heaters that exchange heat"))
    printing.add_output_options(command, _run_design, brief=True)


def _add_zones(group: Any) -> None:
    """Add the options of `heatertune.zones`."""
    group.add_argument("--zones", metavar="NAMES", help="names of the zones in the log, with commas between them, "
                       "neighbours next to each other: tune and prove them together")
    group.add_argument("--zone-log", metavar="FILE", action="append", default=[],
                       help="log of a further zone, if each has a file of its own; may be repeated")
    group.add_argument("--zone-setpoints", metavar="X,X", help="setpoint of each zone [°C]; default: --setpoint, or "
                       "the last ones of the log")
    group.add_argument("--neighbours", metavar="NAME", choices=("chain", "ring", "free"),
                       help="which zones exchange heat: chain, ring or free (default: what the log shows)")
    group.add_argument("--neighbour-deviation", type=float, metavar="K", help="by how much a zone may leave its "
                       "setpoint while a neighbour's changes [°C] (default: 40 %% of the change)")
    group.add_argument("--rated-power", metavar="X,X", help="full power of each zone's heater [kW]")
    group.add_argument("--peak-power", type=float, metavar="X", help="most power of all heaters at once while the "
                       "setpoints are held [kW]; the PWM periods are staggered")
    group.add_argument("--stagger", action="store_true", help="begin the PWM periods of the zones one after the other")


def _run_design(settings: argparse.Namespace) -> int:
    if settings.zones is not None:
        return design_zones(settings)
    from heatertune.chain.precompile import work_alongside

    settings.out = settings.out or _folder_of(settings.log)
    common.demand_folder(settings.out)
    with work_alongside(settings.target) as second:  # which begins before the rest is imported
        return _designed(settings, second)


def _folder_of(log: str) -> str:
    """Return the folder for the results of a log: its name without its ending.

    Raises:
        InputError: a folder of that name that holds no design.
    """
    name = Path(log).name.partition(".")[0]
    if not name or (Path(name).exists() and not (Path(name) / DATA / "proof.json").exists()):
        raise InputError(f"{name or log}: there already, and no design: name a folder with --out")
    return name


def _designed(settings: argparse.Namespace, second: Worker) -> int:
    from heatertune.chain.documents import without_curves
    from heatertune.chain.pipeline import TYPICAL_S

    progress = printing.Progress(settings, TYPICAL_S)
    progress("reading")
    asked, beside = common.design_request(settings), options.of(FitSettings, settings)  # refused before the log is read
    plc.controller_for(asked.target)
    log = chain.read_log(settings.log, common.reading(settings), errata=True)
    printing.tell_taken(settings, [log], progress)
    result = chain.design(
        log, asked, out=settings.out, fitted_with=beside, force=settings.force, progress=progress, begun=second)
    effect, feed = result.fitted_model.disturbance, plc.controller_for(asked.target).feed
    fed = "" if effect is None or not effect.acts or feed is None else (
        f"feed it forward: heatertune feed-forward {settings.out}")
    nearest = again(settings.given, result.outcome.passes_with)
    printing.output(
        settings, result.documents,
        lambda: "\n".join(filter(None, (report.summary(result.documents), f"written to {settings.out}", fed))),
        brief=lambda: report.design_brief(result.documents, settings.out, nearest, fed),
        short=lambda: without_curves(result.documents, nearest))
    return 0 if result.outcome.proof.verdict == "PASS" else 1
