"""`heatertune decode`: the dump or listing of a running controller → what it really does."""

from __future__ import annotations

import argparse
from typing import Any

from heatertune import chain, plc, report
from heatertune.cli import common, printing

__all__ = ["add_to"]

_EXAMPLE = "example: heatertune decode out/DB30.bin --target s5-ob251 --called-every 17"


def add_to(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "decode", help="parameters as dumped or printed → K, TN, TV as realised, remarks, and their proof",
        epilog=_EXAMPLE,
        description="Read the parameters of a running controller: the bytes of its data block, high byte first, or "
                    "text as its programming tool saves or prints it (S5: listing of the block; S7-200: statement list "
                    "or data block; S7-300: STL source; WEG: the block's call or a list of parameters; one-bit "
                    "processor: Intel HEX). With a model, prove them.",
    )
    command.add_argument("dump", metavar="DUMP", help="binary or text file")
    command.add_argument("--called-every", type=float, metavar="S",
                         help="sampling interval TA [s]; needed if no parameter contains it")
    command.add_argument("--model", metavar="FILE", help="model.json to prove the controller on")
    common.add_proof_options(command)
    common.add_model_options(command)
    printing.add_output_options(command)
    command.set_defaults(run=_run)


def _run(settings: argparse.Namespace) -> int:
    from heatertune.pid.document import to_document  # noqa: PLC0415 - the help must not wait for it
    from heatertune.plc.dump_reader import realised_design  # noqa: PLC0415

    controller = plc.controller_for(common.target(settings))
    words, passed_over, unlike = common.words_of_machine(settings, settings.dump)
    design = realised_design(controller, words)
    odd = [] if controller.oddities is None else list(controller.oddities(words))
    odd += () if unlike is None else unlike(words)
    document: dict[str, Any] = {
        "schema": "heatertune/decode/1", "target": controller.name, "words": dict(words.values),
        "realised": None if design is None else to_document(design), "odd": odd, "passed_over": list(passed_over),
        "proof": None,
    }
    if settings.model is not None or settings.gain is not None:
        fitted = common.model_from(settings, settings.model)
        printing.Progress(settings)("proving the parameters")
        document["proof"] = chain.prove(words, fitted, common.conditions(settings)).to_document()
    proof = document["proof"]

    def text() -> str:
        lines = ["no PID" if design is None else report.design_lines(document["realised"])]
        lines += [*(f"odd: {oddity}" for oddity in odd), *(f"not looked at: {rest}" for rest in passed_over)]
        return "\n".join(lines + ([report.criteria_table(proof), f"VERDICT {proof['verdict']}"] if proof else []))

    printing.output(settings, document, text)
    return 1 if proof and proof["verdict"] != "PASS" else 0
