"""`heatertune validate`: model and another log → whether the model holds."""

from __future__ import annotations

import argparse
from typing import Any

from heatertune import chain, options, report
from heatertune.cli import common, printing
from heatertune.cli.saved_design import add_known_options, known_words
from heatertune.settings import ValidateSettings

__all__ = ["add_to"]

_EXAMPLE = "example: heatertune validate model.json other_day.csv --ambient 19.5"


def add_to(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "validate", help="check a model against another log; exit status 1 if it does not fit", epilog=_EXAMPLE,
        description="Simulate a model and its candidates with the power of another log of the same heater and compare "
                    "them with its readings. Only the initial state is fitted.",
    )
    command.add_argument("model", metavar="MODEL", help="model.json as written by fit")
    command.add_argument("log", metavar="LOG",
                         help="a CSV file with power, or without power if the controller is known")
    command.add_argument("-o", "--out", metavar="FILE", help="write the result to this JSON file")
    options.add(command, ValidateSettings, "least_fit_pct")
    common.add_reading_options(command)
    options.add(command.add_argument_group("this log"), ValidateSettings, "ambient_degC", "power_before_pct")
    add_known_options(command)
    printing.add_output_options(command)
    command.set_defaults(run=_run)


def _run(settings: argparse.Namespace) -> int:
    from heatertune.model.document import read_model  # noqa: PLC0415 - the help must not wait for it
    from heatertune.model.validate import to_document  # noqa: PLC0415

    progress = printing.Progress(settings)
    model = read_model(settings.model)
    log = chain.read_log(settings.log, common.reading(settings))
    printing.tell_taken(settings, [log], progress)
    verdict = chain.validate(
        model, log, options.of(ValidateSettings, settings), words=known_words(settings, [log]),
        setpoint_degC=common.conditions(settings).highest_degC, known=common.conditions(settings).switches,
    )
    document = to_document(verdict)
    printing.save(settings.out, document)
    printing.output(settings, document, lambda: report.validation_lines(document))
    return 1 if verdict.fails else 0
