"""`heatertune export-db`: pid → proven words → text."""

from __future__ import annotations

import argparse
from typing import Any

from heatertune.cli import common, printing
from heatertune.cli.recorded import Proving, proving

__all__ = ["add_to"]

_EXAMPLE = "example: heatertune export-db pid.json --target s5-ob251 -o out/"


def add_to(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "export-db", help="pid → words, proven, as text for the PLC", epilog=_EXAMPLE,
        description="Round a design to words, prove them, and write what is typed into the PLC. Refuses what is "
                    "not PASS.",
    )
    command.add_argument("pid", metavar="PID|WORDS", help=(
        "pid.json as written by tune; or words.json, exported again as the proof.json beside it says"))
    command.add_argument("-o", "--out", required=True, metavar="DIR", help="directory for the files")
    common.add_word_options(command, but=("switch_kind", "as_is"))
    command.add_argument("--force", action="store_true", help="export whatever the verdict; the files say so")
    common.add_proof_options(command)
    common.add_model_options(command)
    printing.add_output_options(command)
    command.set_defaults(run=_run)


def _run(settings: argparse.Namespace) -> int:
    from heatertune.documents import DATA, to_json  # noqa: PLC0415 - the help must not wait for it
    from heatertune.proof.verdict import verdict_line  # noqa: PLC0415
    from heatertune.proof.words_file import export_again, export_first  # noqa: PLC0415 - the help must not wait for it
    from heatertune.report.text import words_table  # noqa: PLC0415
    from heatertune.writing import write_files  # noqa: PLC0415

    again = None if common.proof_asked(settings) else export_again(
        settings.pid, common.target(settings), force=settings.force,
        accept=common.conditions(settings).accept)
    proven = again or _proven(settings)
    document = proven["words"]
    documents = {"words.json": to_json(document), "proof.json": to_json(proven["proof"])}
    moved = {f"{DATA}/{name}": content for name, content in documents.items()}
    written = write_files(settings.out, {**proven["files"], **moved}, gone=documents)
    names = "\n".join(str(path) for path in written)
    line = verdict_line(proven["proof"])
    printing.output(settings, document, lambda: f"{line}\n{words_table(document)}\nVERDICT {line}\n{names}",
                    short=lambda: export_first(document, proven["proof"]))
    return 0


def _proven(settings: argparse.Namespace) -> dict[str, Any]:
    """Return the words of a design, proven: documents and files.

    What is exported was proven then or before: the verdict on the same words, heater and conditions by the same
    program is read where it is kept. `verify` proves anew.
    """
    from dataclasses import asdict  # noqa: PLC0415 - the help must not wait for it

    from heatertune.cache import cached, release  # noqa: PLC0415
    from heatertune.model import document as model_document  # noqa: PLC0415
    from heatertune.proof.spec_file import specified  # noqa: PLC0415

    progress = printing.Progress(settings)
    asked = proving(settings)
    inputs = {
        "words": repr(asked.words), "choice": repr(asked.choice), "model": model_document.to_document(asked.fitted),
        "ramp": asked.ramp, "conditions": asdict(asked.conditions), "notes": asked.notes, "force": settings.force,
        "specification": repr(specified(asked.conditions)),  # of files that may change
        "libraries": [release(name) for name in ("numpy", "scipy", "numba")]}
    kept = cached("export", inputs, lambda: _prove(asked, progress, force=settings.force), dict, progress=progress)
    for note in kept["notes"]:
        progress.note(note)
    files = {name: text if isinstance(text, str) else bytes(text) for name, text in kept["files"].items()}
    return kept | {"files": files}


def _prove(asked: Proving, progress: Any, *, force: bool) -> dict[str, Any]:
    from heatertune import chain  # noqa: PLC0415 - words that are proven already need none of it
    from heatertune.chain.documents import words_document  # noqa: PLC0415
    from heatertune.errors import ExportRefused  # noqa: PLC0415
    from heatertune.plc.choose import search_document  # noqa: PLC0415
    from heatertune.proof.setpoint_ramp import prove_ramped  # noqa: PLC0415

    proof, told = prove_ramped(asked.words, asked.fitted, asked.ramp, asked.conditions, progress=progress)
    notes = [*asked.notes, *told]
    search = None if asked.choice is None else search_document(asked.choice, asked.fitted, notes)
    try:
        files = chain.export(proof.words, proof, force=force)
    except ExportRefused:  # nothing is kept; the way on is among the notes
        for note in notes:
            progress.note(note)
        raise
    document = words_document(proof.words, proof, files, search)
    return {"words": document, "proof": proof.to_document(), "notes": notes,
            "files": {name: text if isinstance(text, str) else list(text) for name, text in files.items()}}
