"""`heatertune decode`: the dump of a running controller → what it really does."""

from __future__ import annotations

import argparse
from typing import Any

from heatertune.cli import common, printing
from heatertune.errors import InputError

__all__ = ["add_to"]

_EXAMPLE = "example: heatertune decode out/DB30.bin --target s5-ob251 --called-every 17"


def add_to(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "decode", help="a dumped controller DB → K, TN, TV as realised, what is odd, and its proof", epilog=_EXAMPLE,
        description="Read the data block of a running controller, high byte first (OB251: 49 words; S7-300: "
        "its instance data block); with a model by hand or --model, prove it.",
    )
    command.add_argument("dump", metavar="DUMP", help="binary file of the data block")
    command.add_argument("--called-every", type=float, required=True, metavar="S", help="sampling interval TA [s]")
    command.add_argument("--model", metavar="FILE", help="model.json to prove the controller on")
    common.add_proof_options(command)
    common.add_model_options(command)
    printing.add_output_options(command)
    command.set_defaults(run=_run)


def _run(settings: argparse.Namespace) -> int:
    from heatertune import chain  # noqa: PLC0415 - the help must not wait for it
    from heatertune.pid.document import to_document  # noqa: PLC0415
    from heatertune.plc import TARGETS, controller_for  # noqa: PLC0415
    from heatertune.report.text import criteria_table, design_lines  # noqa: PLC0415
    from heatertune.units import check  # noqa: PLC0415

    check("--called-every", settings.called_every, above=0.0)
    controller = controller_for(common.target(settings))
    if controller.image is None or controller.oddities is None:
        decodable = ", ".join(name for name in TARGETS if controller_for(name).image is not None)
        raise InputError(f"a dump of {controller.name} cannot be decoded; known: {decodable}")
    image, scaling = _bytes(settings.dump), common.scaling(settings)
    words = controller.read_image(image, sample_time_s=settings.called_every, scaling=scaling, source=settings.dump)
    realised = controller.decode(words)
    document: dict[str, Any] = {
        "schema": "heatertune/decode/1", "target": controller.name, "words": dict(words.values),
        "realised": None if realised is None else to_document(realised), "odd": list(controller.oddities(words)),
        "proof": None,
    }
    if settings.model is not None or settings.gain is not None:
        fitted = common.model_from(settings, settings.model)
        document["proof"] = chain.prove(words, fitted, common.conditions(settings)).to_document()
    proof = document["proof"]

    def text() -> str:
        realised_lines = "no PID" if realised is None else design_lines(document["realised"])
        lines = [realised_lines, *[f"odd: {oddity}" for oddity in document["odd"]]]
        return "\n".join(lines + ([criteria_table(proof), f"VERDICT {proof['verdict']}"] if proof else []))

    printing.output(settings, document, text)
    return 1 if proof and proof["verdict"] == "FAIL" else 0


def _bytes(path: str) -> bytes:
    from heatertune.files import read_bytes  # noqa: PLC0415

    try:
        return read_bytes(path)
    except OSError as problem:
        raise InputError(f"{path}: cannot be read: {problem.strerror}") from problem
