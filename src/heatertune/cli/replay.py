"""`heatertune replay`: raw inputs, scan by scan → what the controller would give."""

from __future__ import annotations

import argparse
from typing import Any

from heatertune import options, plc
from heatertune.cli import common, printing
from heatertune.errors import InputError
from heatertune.plc import NAMES
from heatertune.settings import Conditions

__all__ = ["add_to"]

_EXAMPLE = "example: heatertune replay inputs.csv --target s5-ob251 --words out/words.json"


def add_to(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "replay", help="run recorded raw inputs through a controller, scan by scan", epilog=_EXAMPLE,
        description="Print outputs and flags of each scan as CSV, starting cold. The inputs are in the controller's "
                    "own units, setpoint and process variable first (their names: heatertune targets).",
    )
    command.add_argument("inputs", metavar="INPUTS", help="CSV file with a header, one row per scan")
    command.add_argument("--target", required=True, metavar="NAME", type=options.one_of(NAMES),
                         help=f"the controller: {', '.join(NAMES)}")
    command.add_argument("--words", required=True, metavar="FILE", help="words.json as written by export-db")
    options.add(
        command, Conditions, "switches", help="setting of an open point (see: heatertune targets); may be repeated")
    printing.add_output_options(command)
    command.set_defaults(run=_run)


def _run(settings: argparse.Namespace) -> int:
    from heatertune.plc.replay import read_inputs, replay  # noqa: PLC0415
    from heatertune.proof.words_file import read_words  # noqa: PLC0415 - the help must not wait for it

    controller = plc.controller_for(settings.target)
    words = read_words(settings.words, settings.target)
    if words is None:
        raise InputError(f"{settings.words}: no words; expected words.json as written by export-db")
    scans = replay(controller, words, read_inputs(settings.inputs, controller), common.conditions(settings).switches)
    rows = [
        {"scan": k, "output": scan.output, "power_pct": round(scan.power_pct, 6)}
        | {name: int(is_set) for name, is_set in scan.flags.items()}
        for k, scan in enumerate(scans)
    ]
    document = {"schema": "heatertune/replay/1", "target": controller.name, "scans": rows}

    def csv() -> str:
        heads = list(rows[0]) if rows else ["scan", "output", "power_pct"]
        return "\n".join([",".join(heads), *(",".join(str(row[head]) for head in heads) for row in rows)])

    printing.output(settings, document, csv)
    return 0
