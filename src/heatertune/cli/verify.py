"""`heatertune verify`: pid → verdict."""

from __future__ import annotations

import argparse
from typing import Any

from heatertune.cli import common, printing
from heatertune.errors import InputError

__all__ = ["add_to"]

_EXAMPLE = "example: heatertune verify pid.json --target s5-ob251"


def add_to(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "verify", help="prove a design or words: exit status 1 where the verdict is not PASS", epilog=_EXAMPLE,
        description="Run the closed loop in the PLC's own arithmetic on every candidate model and judge it.",
    )
    command.add_argument("pid", metavar="PID|WORDS", help="pid.json as written by tune, or words.json by export-db")
    common.add_words_option(command)
    common.add_ramp_option(command)
    common.add_proof_options(command)
    common.add_model_options(command)
    _add_sample_options(command)
    printing.add_output_options(command)
    command.set_defaults(run=_run)


def _add_sample_options(command: argparse.ArgumentParser) -> None:
    group = command.add_argument_group("many heaters")
    group.add_argument("--samples", type=int, metavar="N",
                       help="also prove on N drawn heaters: FAIL where too many of them break a limit")
    group.add_argument("--seed", type=int, default=0, metavar="SEED",
                       help="seed of the first sample; each next one has the next number (default: 0)")
    group.add_argument("--replay", type=int, metavar="SEED", help="run the one sample that has this seed, and judge it")
    group.add_argument("--quantile", type=float, default=0.95, metavar="SHARE",
                       help="share of the samples that must keep every limit (default: 0.95)")
    group.add_argument("--mains", type=float, default=10.0, metavar="%",
                       help="mains voltage, even within ± this; the power goes with its square (default: 10)")
    group.add_argument("--ambient-spread", type=float, default=5.0, metavar="°C",
                       help="ambient temperature, even within ± this [°C] (default: 5)")
    group.add_argument("--disturbance-spread", type=float, default=50.0, metavar="%",
                       help="size of each disturbance, even within ± this (default: 50)")
    group.add_argument("--jitter", type=float, default=0.0, metavar="S",
                       help="latest delay of a scan [s] (default: 0)")


def _run(settings: argparse.Namespace) -> int:
    from heatertune import chain  # noqa: PLC0415 - the help must not wait for it
    from heatertune.proof.document import digested  # noqa: PLC0415
    from heatertune.proof.drawn import replay_document, sample_document  # noqa: PLC0415
    from heatertune.proof.verdict import combined, verdict_line  # noqa: PLC0415
    from heatertune.report.text import criteria_table, ramp_note, samples_table  # noqa: PLC0415

    words, _, fitted = common.words_and_model(settings)
    conditions, spread = common.conditions(settings), _spread(settings)
    if settings.replay is not None:
        if settings.setpoint_ramp is not None:
            raise InputError("--replay runs the words with the ramp they have; --setpoint-ramp would be another proof")
        document = replay_document(words, fitted, settings.replay, conditions, spread=spread)
        printing.output(settings, document, lambda: f"{criteria_table(document)}\nVERDICT {document['verdict']}")
        return 0 if document["verdict"] == "PASS" else 1
    proof, notes = chain.prove_ramped(words, fitted, common.setpoint_ramp(settings), conditions)
    document, verdicts = proof.to_document(), [proof.verdict]
    if settings.samples is not None:
        document["samples"] = sample_document(
            proof.words, fitted, settings.samples, conditions, seed=settings.seed, quantile=settings.quantile,
            spread=spread,
        )
        verdicts.append(document["samples"]["verdict"])
    verdict = document["verdict"] = combined(verdicts)
    document = digested(document)
    remarks, line = [f"- {note}" for note in (*ramp_note(document), *notes)], verdict_line(document)
    printing.output(settings, document, lambda: "\n".join(
        [line, criteria_table(document), *remarks, *samples_table(document), f"VERDICT {line}"]
    ))
    return 0 if verdict == "PASS" else 1


def _spread(settings: argparse.Namespace) -> dict[str, float]:
    return {
        "mains_pct": settings.mains, "ambient_degC": settings.ambient_spread,
        "disturbance_pct": settings.disturbance_spread, "jitter_s": settings.jitter,
    }
