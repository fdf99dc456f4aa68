"""`heatertune verify`: pid → verdict."""

from __future__ import annotations

import argparse
from typing import Any

from heatertune import options, report
from heatertune.cli import common, printing
from heatertune.cli.saved_design import proof_source, redesign_command
from heatertune.errors import InputError
from heatertune.settings import SampleSettings

__all__ = ["add_to"]

_EXAMPLE = "example: heatertune verify pid.json --target s5-ob251"


def add_to(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "verify", help="prove a design or parameters; exit status 1 if the verdict is not PASS", epilog=_EXAMPLE,
        description="Simulate the closed loop with the PLC's own arithmetic on every plausible heater and judge it.",
    )
    command.add_argument("pid", metavar="PID|WORDS", help="pid.json of tune, or words.json of export-db")
    common.add_word_options(command, "words_by", "setpoint_ramp", "boost")
    common.add_proof_options(command)
    common.add_model_options(command)
    options.add(command.add_argument_group("many heaters"), SampleSettings)
    printing.add_output_options(command, brief=True)
    command.set_defaults(run=_run)


def _run(settings: argparse.Namespace) -> int:
    from heatertune.proof.setpoint_ramp import prove_ramped  # noqa: PLC0415 - the help must not wait for it
    from heatertune.proof.verdict import verdict_first, verdict_line  # noqa: PLC0415

    progress = printing.Progress(settings)
    asked, drawn = proof_source(settings), options.of(SampleSettings, settings)
    fitted, conditions = asked.fitted_model, asked.conditions
    if drawn.replay is not None:
        from heatertune.proof.monte_carlo.run import replay_document  # noqa: PLC0415 - as below

        if asked.ramp is not None:
            raise InputError("--replay runs the words with the ramp they have; --setpoint-ramp would be another proof")
        if drawn.samples is not None:
            raise InputError("--replay runs one sample, --samples many: give one of them")
        document = replay_document(asked.words, fitted, drawn.replay, conditions, spread=drawn.spread)
        printing.output(settings, document, lambda: f"{report.criteria_table(document)}\nVERDICT {document['verdict']}")
        return 0 if document["verdict"] == "PASS" else 1
    progress("proving the parameters")
    proof, notes = prove_ramped(asked.words, fitted, asked.ramp, conditions, progress=progress)
    if drawn.samples is not None:
        from heatertune.proof.monte_carlo.run import with_samples  # noqa: PLC0415 - who asks for none must not wait for it

        progress(f"proving them on {drawn.samples} samples")
        proof = with_samples(proof, fitted, drawn, conditions)
    document = proof.to_document()
    redesign = redesign_command(settings, asked, proof.scenario.setpoint_degC)
    remarks, line = [*asked.notes, *report.ramp_note(document), *notes], verdict_line(document)
    printing.output(
        settings, document,
        lambda: "\n".join([line, report.criteria_table(document), *(f"- {remark}" for remark in remarks),
                           *report.samples_table(document), f"VERDICT {line}"]),
        brief=lambda: report.verify_brief(document, remarks, asked.way_on, redesign),
        short=lambda: verdict_first(document))
    return 0 if document["verdict"] == "PASS" else 1
