"""`heatertune supervise`: words and their heater → a monitor, and how soon it tells each fault."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from heatertune import report
from heatertune.cli import common, printing
from heatertune.cli.saved_design import proof_source
from heatertune.codec import peek_schema, to_json
from heatertune.errors import InputError
from heatertune.writing import write_files

if TYPE_CHECKING:
    from heatertune.model.model_values import FittedModel
    from heatertune.plc import Words
    from heatertune.settings import Conditions

__all__ = ["SUPERVISE_EXAMPLE", "add_supervise"]

SUPERVISE_EXAMPLE = "example: heatertune supervise pid.json --target s5-ob251 -o out/"


def add_supervise(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "supervise", epilog=SUPERVISE_EXAMPLE,
        help="build a monitor with no false trips on any plausible healthy heater, and report its detection time for "
             "each fault",
        description="Derive the limits of a monitor from all plausible heaters through the whole test sequence, and "
                    "report how soon it detects each fault. It does not replace a thermal cut-out.",
    )
    command.add_argument("pid", metavar="MODEL|PID|WORDS", nargs="?", help=(
        "model.json as written by fit; pid.json by tune, or words.json by export-db"))
    command.add_argument("-o", "--out", metavar="DIR", help="folder for the document, the page and the program")
    common.add_word_options(command, "words_by", "setpoint_ramp", "boost")
    common.add_proof_options(command)
    common.add_model_options(command)
    group = command.add_argument_group("the sampled heaters")
    group.add_argument("--spread", type=float, default=20.0, metavar="%", help=(
        "deviation of gain and lags from the model; of the dead time, 1.5 times that (default: 20)"))
    group.add_argument("--ambient-spread", type=float, default=5.0, metavar="°C", help=(
        "deviation of the ambient temperature from the model (default: 5)"))
    group.add_argument("--least-noise", type=float, default=0.0, metavar="°C", help=(
        "noise that the sensor always has; its absence reveals a frozen sensor (default: 0)"))
    group.add_argument("--samples", type=int, default=1000, metavar="N", help=(
        "new heaters on which it must not trip (default: 1000)"))
    group.add_argument("--faults-per-kind", type=int, default=60, metavar="N", help=(
        "heaters on which each fault is simulated (default: 60)"))
    group.add_argument("--seed", type=int, default=0, help="seed of the first sampled heater (default: 0)")
    printing.add_output_options(command, _run_supervise)


def _run_supervise(settings: argparse.Namespace) -> int:
    from heatertune.supervision.supervise import SampleCounts, supervise

    progress = printing.Progress(settings)
    words, fitted, conditions, notes = _supervised_loop(settings, progress)
    for note in notes:
        progress.note(note)
    counts = SampleCounts(
        spread_pct=settings.spread, checked=settings.samples, ambient_degC=settings.ambient_spread,
        least_noise_degC=settings.least_noise, broken=settings.faults_per_kind, seed=settings.seed)
    document = supervise(words, fitted, conditions, counts, progress=progress)
    page = report.supervision_page(document)
    if settings.out is not None:
        program = document["program"]
        write_files(settings.out, {"supervision.json": to_json(document), "supervision.txt": page + "\n",
                                   "supervision.html": report.supervision_html(document)}
                    | ({} if program["file"] is None else {program["file"]: program["text"]}))
    printing.output(settings, document, lambda: page)
    return 0


def _supervised_loop(
    settings: argparse.Namespace, progress: printing.Progress
) -> tuple[Words, FittedModel, Conditions, tuple[str, ...]]:
    """Return words, heater and conditions: of a file, or designed for a model as `design` does."""
    schema = None if settings.pid is None else peek_schema(settings.pid)
    if settings.pid is not None and not (schema or "").startswith("heatertune/model/"):
        source = proof_source(settings)
        return source.words, source.fitted_model, source.conditions, source.notes
    from heatertune.proof.design_request import DesignRequest, plainly

    fitted = common.model_from(settings, settings.pid)
    closed = plainly(fitted, DesignRequest(target=common.target(settings), scaling=common.scaling(settings),
                                   conditions=common.conditions(settings)), progress=progress)
    if closed.proof.verdict == "FAIL":
        raise InputError("the words that are designed for this model FAIL their proof; `heatertune design` says why "
                         "and what would pass: give supervise its pid.json")
    return closed.proof.words, fitted, closed.conditions, ()
