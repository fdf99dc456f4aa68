"""The commands for a controller in operation: `decode`, `diff`, `replay` and `advise`."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import Any

from heatertune import chain, options, plc, report
from heatertune.cli import common, printing
from heatertune.cli.saved_design import in_force
from heatertune.errors import InputError
from heatertune.plc.targets import NAMES, target_by_name
from heatertune.settings import Conditions, SensorSettings
from heatertune.units import check

__all__ = [
    "ADVISE_EXAMPLE", "DECODE_EXAMPLE", "DIFF_EXAMPLE", "REPLAY_EXAMPLE", "add_advise", "add_decode", "add_diff",
    "add_replay",
]


DIFF_EXAMPLE = "example: heatertune diff out/ out/DB30.bin"


def add_diff(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "diff", help="compare two sets of parameters in engineering terms; exit status 1 if they "
                     "differ", epilog=DIFF_EXAMPLE,
        description="Compare K, TN, TV, limits and mode of two sets of parameters, one by one, and report whether the "
                    "proof of one covers the other. Each is a folder, a words.json, a pid.json, or a dump or text of a "
                    "controller; what one file does not contain is taken from the other.",
    )
    command.add_argument("before", metavar="A", help="the parameters before")
    command.add_argument("after", metavar="B", help="the parameters after")
    command.add_argument("--target", metavar="NAME", type=target_by_name,
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
    printing.add_output_options(command, _run_diff)


def _run_diff(settings: argparse.Namespace) -> int:
    from heatertune.proof.difference import DeclaredWords, difference, read_sides

    if settings.called_every is not None:
        check("--called-every", settings.called_every, above=0.0)
    sensor = options.provided_options(SensorSettings, settings)
    declaration = DeclaredWords(target=settings.target, sample_time_s=settings.called_every,
                                sensor_degC=sensor.get("range_degC"),
                  input=sensor.get("input"), switches=options.of(Conditions, settings).switches)
    document = difference(*read_sides(settings.before, settings.after, declaration))
    printing.output(settings, document, lambda: report.difference_lines(document))
    return 0 if document["same"] else 1


REPLAY_EXAMPLE = "example: heatertune replay inputs.csv --target s5-ob251 --words out/words.json"


def add_replay(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "replay", help="run recorded raw inputs through a controller, scan by scan", epilog=REPLAY_EXAMPLE,
        description="Print outputs and flags of each scan as CSV, starting cold. The inputs are in the controller's "
                    "own units, setpoint and process variable first (their names: heatertune targets).",
    )
    command.add_argument("inputs", metavar="INPUTS", help="CSV file with a header, one row per scan")
    command.add_argument("--target", required=True, metavar="NAME", type=target_by_name,
                         help=f"the controller: {', '.join(NAMES)}")
    command.add_argument("--words", required=True, metavar="FILE", help="words.json as written by export-db")
    options.add(
        command, Conditions, "switches", help="setting of an open point (see: heatertune targets); may be repeated")
    printing.add_output_options(command, _run_replay)


def _run_replay(settings: argparse.Namespace) -> int:
    from heatertune.plc.replay import read_inputs, replay
    from heatertune.proof.words_file import read_words

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


ADVISE_EXAMPLE = "example: heatertune advise table4 --pid pid.json --target s5-ob251 --setpoint 53.3"


def add_advise(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "advise", help="logged response → WEG's retuning advice, each step proven on the model", epilog=ADVISE_EXAMPLE,
        description="Find the symptom of WEG's manual that a closed-loop response shows, and what the manual's advice "
                    "would change: gains, verdict, overshoot, settling time and IAE before and after each step. Exit "
                    "status 1 if neither the design nor any step passes.",
    )
    command.add_argument("log", metavar="LOG|proof",
                         help="CSV file, table3 or table4; or proof: the response in the design's own proof")
    command.add_argument("--pid", required=True, metavar="FILE", help="pid.json as written by tune, with its model")
    common.add_proof_options(command, target="weg")
    common.add_reading_options(command)
    printing.add_output_options(command, _run_advise)


def _run_advise(settings: argparse.Namespace) -> int:
    from heatertune.log import read_log
    from heatertune.pid.design_document import read_design
    from heatertune.proof.advice import advise

    design, model, origin = read_design(settings.pid)
    if model is None:
        raise InputError(f"{settings.pid} holds no model to prove on; expected pid.json as written by tune")
    progress = printing.Progress(settings)
    plc.controller_for(common.target(settings))  # an unknown target is refused before the log is read
    log = None if settings.log == "proof" else read_log(settings.log, common.reading(settings))
    printing.tell_taken(settings, [] if log is None else [log], progress)
    recipe, notes = in_force(settings, origin, settings.pid)
    for note in notes:
        progress.note(note)
    document = advise(design, model, recipe, log, until_s=settings.until, progress=progress)
    printing.output(settings, document, lambda: report.advice_table(document))
    return 0 if any(case["verdict"] == "PASS" for case in document["cases"]) else 1


DECODE_EXAMPLE = "example: heatertune decode out/DB30.bin --target s5-ob251 --called-every 17"


def add_decode(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "decode", help="parameters as dumped or printed → K, TN, TV as realised, remarks, and their proof",
        epilog=DECODE_EXAMPLE,
        description="Read the parameters of a running controller: the bytes of its data block, high byte first, or "
                    "text as its programming tool saves or prints it (S5: listing of the block; S7-200: statement list "
                    "or data block; S7-300: STL source; WEG: the block's call or a list of parameters; one-bit "
                    "processor: Intel HEX; printers, sketches, scripts and lists: as people paste them). What the text "
                    "does not say and is assumed is listed. With a model, prove them.",
    )
    command.add_argument("dump", metavar="DUMP", help="binary or text file")
    command.add_argument("--called-every", type=float, metavar="S",
                         help="sampling interval TA [s]; needed if no parameter contains it")
    command.add_argument("--model", metavar="FILE", help="model.json to prove the controller on")
    common.add_proof_options(command)
    common.add_model_options(command)
    printing.add_output_options(command, _run_decode)


def _run_decode(settings: argparse.Namespace) -> int:
    from heatertune.pid.design_document import to_document
    from heatertune.plc.dump_reader import realised_design

    controller = plc.controller_for(common.target(settings))
    words, passed_over, unlike, assumed = common.words_of_machine(settings, settings.dump)
    design = realised_design(controller, words)
    odd = [] if controller.oddities is None else list(controller.oddities(words))
    odd += () if unlike is None else unlike(words)
    document: dict[str, Any] = {
        "schema": "heatertune/decode/1", "target": controller.name, "words": dict(words.values),
        "realised": None if design is None else to_document(design), "odd": odd, "passed_over": list(passed_over),
        "assumed": list(assumed), "proof": None,
    }
    condition = f"on condition that {', '.join(assumed)}" if assumed else ""
    if settings.model is not None or settings.gain is not None:
        fitted = common.model_from(settings, settings.model)
        printing.Progress(settings)("proving the parameters")
        proven = chain.prove(words, fitted, common.conditions(settings))
        if assumed:
            diagnostics = proven.diagnostics
            proven = replace(proven, diagnostics=replace(diagnostics, remarks=(*diagnostics.remarks, condition)))
        document["proof"] = proven.to_document()
    proof = document["proof"]

    def text() -> str:
        lines = ["no PID" if design is None else report.design_lines(document["realised"])]
        lines += [*(f"odd: {oddity}" for oddity in odd), *(f"not looked at: {rest}" for rest in passed_over)]
        lines += [f"assumed, as the text does not say: {', '.join(assumed)}"] if assumed else []
        verdict = f"VERDICT {proof['verdict']} {condition}".rstrip() if proof else ""
        return "\n".join(lines + ([report.criteria_table(proof), verdict] if proof else []))

    printing.output(settings, document, text)
    return 1 if proof and proof["verdict"] != "PASS" else 0
