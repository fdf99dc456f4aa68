"""`heatertune verify`: pid → verdict."""

from __future__ import annotations

import argparse
from typing import Any

from heatertune.cli import common

__all__ = ["add_to"]

_EXAMPLE = "example: heatertune verify pid.json --target s5-ob251"


def add_to(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "verify", help="prove a design or words: exit status 1 where the verdict is FAIL", epilog=_EXAMPLE,
        description="Run the closed loop in the PLC's own arithmetic on every candidate model and judge it.",
    )
    command.add_argument("pid", metavar="PID|WORDS", help="pid.json as written by tune, or words.json by export-db")
    common.add_words_option(command)
    common.add_ramp_option(command)
    common.add_proof_options(command)
    common.add_model_options(command)
    common.add_output_options(command)
    command.set_defaults(run=_run)


def _run(settings: argparse.Namespace) -> int:
    from heatertune import chain  # noqa: PLC0415 - the help must not wait for it
    from heatertune.report.text import criteria_table, ramp_note  # noqa: PLC0415

    words, _, fitted = common.words_and_model(settings)
    proof, notes = chain.prove_ramped(words, fitted, common.setpoint_ramp(settings), proving=common.proving(settings))
    document = proof.to_document()
    told = "".join(f"- {note}\n" for note in (*ramp_note(document), *notes))
    common.output(settings, document, lambda: f"{criteria_table(document)}\n{told}VERDICT {proof.verdict}")
    return 0 if proof.verdict == "PASS" else 1
