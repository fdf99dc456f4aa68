"""`heatertune design`: the whole chain."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from heatertune import chain, options, plc, report
from heatertune.cli import common, printing
from heatertune.cli.common import again
from heatertune.settings import FitSettings, SampleSettings, WordSettings

if TYPE_CHECKING:
    from heatertune.chain.precompile import Worker

__all__ = ["add_to"]

_EXAMPLE = "example: heatertune design table4 --target s5-ob251 --out out/"


def add_to(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "design", help="the whole chain: log → model → pid → plc → proof → report", epilog=_EXAMPLE,
        description="Fit the heater, tune the controller, round to its parameters, prove them, and write the "
                    "documents, the export files and report.html.",
    )
    command.add_argument("log", metavar="LOG", help="a CSV file, or the built-in table3 / table4")
    command.add_argument("-o", "--out", required=True, metavar="DIR", help="folder for the results")
    options.add(command, WordSettings)
    command.add_argument("--force", action="store_true", help="export even if the verdict is not PASS")
    common.add_proof_options(command)
    common.add_log_options(command)
    common.add_tuning_options(command)
    options.add(command.add_argument_group("many heaters"), SampleSettings, but=("replay",))
    printing.add_output_options(command, brief=True)
    command.set_defaults(run=_run)


def _run(settings: argparse.Namespace) -> int:
    from heatertune.chain.precompile import work_alongside  # noqa: PLC0415 - the help must not wait for it

    with work_alongside(settings.target) as second:  # which begins before the rest is imported
        return _designed(settings, second)


def _designed(settings: argparse.Namespace, second: Worker) -> int:
    from heatertune.chain.documents import without_curves  # noqa: PLC0415 - the help must not wait for it
    from heatertune.chain.pipeline import TYPICAL_S  # noqa: PLC0415

    progress = printing.Progress(settings, TYPICAL_S)
    progress("reading")
    asked, beside = common.design_request(settings), options.of(FitSettings, settings)  # refused before the log is read
    plc.controller_for(asked.target)
    log = chain.read_log(settings.log, common.reading(settings), errata=True)
    printing.tell_taken(settings, [log], progress)
    result = chain.design(
        log, asked, out=settings.out, fitted_with=beside, force=settings.force,
        progress=progress, begun=second)
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
