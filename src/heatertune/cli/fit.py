"""`heatertune fit`: log → model."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from heatertune import chain, options, report
from heatertune.cli import common, printing
from heatertune.cli.saved_design import add_known_options, known_words
from heatertune.settings import FitSettings

if TYPE_CHECKING:
    from heatertune.log.values import Log
    from heatertune.model.values import FittedModel

__all__ = ["add_to"]

_EXAMPLE = "example: heatertune fit table4 -o model.json"


def add_to(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "fit", help="log → model: FOPDT with intervals, and every model that explains the log", epilog=_EXAMPLE,
        description="Identify a heater from its temperature log, or from several logs of it.",
    )
    command.add_argument("log", metavar="LOG", nargs="+",
                         help="a CSV file, or the built-in table3 / table4; several logs of one heater (all with "
                              "power, or all without) are fitted together")
    command.add_argument("-o", "--out", metavar="FILE", help="write the model to this JSON file")
    command.add_argument("--hypotheses", action="store_true",
                         help="print the table of controller hypotheses; for one log, all of them")
    common.add_log_options(command)
    add_known_options(command)
    printing.add_output_options(command, brief=True)
    command.set_defaults(run=_run)


def _run(settings: argparse.Namespace) -> int:
    from heatertune.model.document import to_document  # noqa: PLC0415 - the help must not wait for it

    progress = printing.Progress(settings)
    progress("reading")
    logs = [chain.read_log(name, common.reading(settings)) for name in settings.log]
    printing.tell_taken(settings, logs, progress)
    progress("finding the heater")
    document = to_document(_fitted(settings, logs, progress))
    printing.save(settings.out, document)
    shown = settings.hypotheses or settings.controller is not None
    parts = [report.model_lines, report.hypothesis_table] if shown else [report.model_lines]
    printing.output(settings, document, lambda: "\n\n".join(part(document) for part in parts),
                    brief=None if shown else lambda: report.model_brief(document, settings.out),
                    short=lambda: {name: part for name, part in document.items() if name != "residuals"})
    return 0


def _fitted(settings: argparse.Namespace, logs: Sequence[Log], progress: printing.Progress) -> FittedModel:

    given = options.of(FitSettings, settings)
    words = known_words(settings, logs)
    if words is not None:
        its = common.conditions(settings)
        return chain.fit_known(
            logs[0], words, given, setpoint_degC=its.highest_degC, known=its.switches, progress=progress)
    if len(logs) == 1:
        return chain.fit(logs[0], given, thorough=settings.hypotheses, progress=progress)
    return chain.fit_together(logs, given, progress=progress)
