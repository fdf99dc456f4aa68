"""`heatertune diff`: two word sets apart."""

from __future__ import annotations

import argparse
from typing import Any

from heatertune import options, report
from heatertune.cli import printing
from heatertune.plc.targets import NAMES
from heatertune.settings import Conditions, SensorSettings
from heatertune.units import check

__all__ = ["add_to"]

_EXAMPLE = "example: heatertune diff out/ out/DB30.bin"


def add_to(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "diff", help="compare two sets of parameters in engineering terms; exit status 1 if they "
                     "differ", epilog=_EXAMPLE,
        description="Compare K, TN, TV, limits and mode of two sets of parameters, one by one, and report whether the "
                    "proof of one covers the other. Each is a folder, a words.json, a pid.json, or a dump or text of a "
                    "controller; what one file does not contain is taken from the other.",
    )
    command.add_argument("before", metavar="A", help="the parameters before")
    command.add_argument("after", metavar="B", help="the parameters after")
    command.add_argument("--target", metavar="NAME", type=options.one_of(NAMES),
                         help=f"the controller, if neither file names it: {', '.join(NAMES)}")
    command.add_argument("--called-every", type=float, metavar="S",
                         help="sampling interval TA of a dump or text [s] (default: as in the other)")
    options.add(command, SensorSettings, "range_degC", default=argparse.SUPPRESS,
                help="sensor range at the lowest and highest reading of a design, dump or text [°C] (default: as in "
                     "the other, else 0 100)")
    options.add(command, SensorSettings, "input", default=argparse.SUPPRESS,
                help="range of the analog module of a design, dump or text (default: as in the other, else a "
                     "plain one)")
    options.add(command, Conditions, "switches", default=argparse.SUPPRESS,
                help="heater=SETTING: whose gains are read of a printer's text that has several heaters (default: as "
                     "in the other)")
    printing.add_output_options(command)
    command.set_defaults(run=_run)


def _run(settings: argparse.Namespace) -> int:
    from heatertune.proof.difference import DeclaredWords, difference, read_sides  # noqa: PLC0415 - the help must not wait

    if settings.called_every is not None:
        check("--called-every", settings.called_every, above=0.0)
    sensor = options.provided_options(SensorSettings, settings)
    given = DeclaredWords(target=settings.target, sample_time_s=settings.called_every,
                          sensor_degC=sensor.get("range_degC"),
                  input=sensor.get("input"), switches=options.of(Conditions, settings).switches)
    document = difference(*read_sides(settings.before, settings.after, given))
    printing.output(settings, document, lambda: report.difference_lines(document))
    return 0 if document["same"] else 1
