"""`heatertune export-db`: pid → proven words → text."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from typing import Any

from heatertune import chain, plc, report
from heatertune.cli import common, printing
from heatertune.cli.saved_design import ProofSource, proof_source
from heatertune.codec import DATA, to_json
from heatertune.errors import DocumentError, ExportRefused
from heatertune.writing import write_files

__all__ = ["add_to"]

_EXAMPLE = "example: heatertune export-db pid.json --target s5-ob251 -o out/"


def add_to(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "export-db", help="pid → proven parameters as text for the PLC", epilog=_EXAMPLE,
        description="Round a design to controller parameters, prove them, and write what is entered into the PLC. "
                    "Refused unless the verdict is PASS.",
    )
    command.add_argument("pid", metavar="PID|WORDS", help=(
        "pid.json as written by tune; or words.json, exported again according to the proof.json next to it"))
    command.add_argument("-o", "--out", required=True, metavar="DIR", help="directory for the files")
    common.add_word_options(command, but=("switch_kind", "as_is"))
    command.add_argument("--force", action="store_true",
                         help="export even if the verdict is not PASS; the files say so")
    common.add_proof_options(command)
    common.add_model_options(command)
    printing.add_output_options(command)
    command.set_defaults(run=_run)


def _run(settings: argparse.Namespace) -> int:
    from heatertune.proof.verdict import verdict_line  # noqa: PLC0415 - the help must not wait for it
    from heatertune.proof.words_file import export_first  # noqa: PLC0415

    again = None if common.proof_asked(settings) else _exported_again(settings)
    proven = again or _proven(settings)
    document = proven["words"]
    documents = {"words.json": to_json(document), "proof.json": to_json(proven["proof"])}
    gone = ["words.json", "proof.json"]
    if proven["pid"] is not None:
        documents["pid.json"] = to_json(proven["pid"])
    else:  # that of other words must not lie next to these
        gone.append(f"{DATA}/pid.json")
    moved = {f"{DATA}/{name}": content for name, content in documents.items()}
    written = write_files(settings.out, {**proven["files"], **moved}, gone=gone)
    names = "\n".join(str(path) for path in written)
    line = verdict_line(proven["proof"])
    printing.output(settings, document, lambda: f"{line}\n{report.words_table(document)}\nVERDICT {line}\n{names}",
                    short=lambda: export_first(document, proven["proof"]))
    return 0


def _exported_again(settings: argparse.Namespace) -> dict[str, Any] | None:
    """Return documents and files of words that were exported before, proven again; None where the file holds no words.

    Raises:
        ExportRefused: the verdict is not PASS and `--force` was not given; as `repeat_proof`.
        DocumentError, InputError, OutOfRange, UnknownName: as `repeat_proof`.
    """
    from heatertune.proof.words_file import certificate, read_words  # noqa: PLC0415 - the help must not wait for it

    if read_words(settings.pid, common.target(settings)) is None:
        return None
    from heatertune.proof.repetition import repeat_proof  # noqa: PLC0415 - a design is proven without it

    again = repeat_proof(
        settings.pid, accept=common.conditions(settings).accept, progress=printing.Progress(settings))
    certified = certificate(again.proof, force=settings.force)
    files = dict(plc.controller_for(again.words.target).export(again.words, certified))
    exported = {"files": sorted(files), "verdict": certified.verdict, "forced": certified.forced}
    return {"words": {**again.words_document, **exported}, "proof": again.proof, "files": files, "pid": again.design}


def _proven(settings: argparse.Namespace) -> dict[str, Any]:
    """Return the words of a design, proven: documents and files.

    What is exported was proven then or before: the verdict on the same words, heater and conditions by the same
    program on this machine is read from the cache and checked like any proof. `verify` always proves again.
    """
    from heatertune.cache import load_or_compute, release  # noqa: PLC0415 - the help must not wait for it
    from heatertune.model import document as model_document  # noqa: PLC0415
    from heatertune.proof.spec_file import specification_of  # noqa: PLC0415

    progress = printing.Progress(settings)
    asked = proof_source(settings)
    inputs = {
        "words": repr(asked.words), "choice": repr(asked.choice),
        "model": model_document.to_document(asked.fitted_model),
        "ramp": asked.ramp, "conditions": asdict(asked.conditions), "notes": asked.notes, "force": settings.force,
        "specification": repr(specification_of(asked.conditions)),  # of files that may change
        "libraries": [release(name) for name in ("numpy", "scipy", "numba")]}
    kept = load_or_compute("export", inputs, lambda: _prove(asked, progress, force=settings.force),
                  lambda document: _demand_export(document, asked, force=settings.force), progress=progress)
    for note in kept["notes"]:
        progress.note(note)
    files = {name: text if isinstance(text, str) else bytes(text) for name, text in kept["files"].items()}
    return kept | {"files": files}


def _prove(asked: ProofSource, progress: Any, *, force: bool) -> dict[str, Any]:
    from heatertune.chain.documents import words_document  # noqa: PLC0415 - words that are proven already need none of it
    from heatertune.plc.word_selection import search_document  # noqa: PLC0415
    from heatertune.proof.repetition import design_document  # noqa: PLC0415
    from heatertune.proof.setpoint_ramp import prove_ramped  # noqa: PLC0415

    proof, told = prove_ramped(asked.words, asked.fitted_model, asked.ramp, asked.conditions, progress=progress)
    notes = [*asked.notes, *told]
    search = None if asked.choice is None else search_document(asked.choice, asked.fitted_model, notes)
    try:
        files = chain.export(proof.words, proof, force=force)
    except ExportRefused:  # nothing is kept; the way on is among the notes
        for note in notes:
            progress.note(note)
        raise
    document = words_document(proof.words, proof, files, search)
    design = design_document(proof, asked.design, asked.fitted_model, asked.recipe, asked.conditions)
    return {"words": document, "pid": design, "proof": proof.to_document(), "notes": notes,
            "files": {name: text if isinstance(text, str) else list(text) for name, text in files.items()}}


def _demand_export(document: dict[str, Any], asked: ProofSource, *, force: bool) -> dict[str, Any]:
    """Return the document of an export, checked as one that was read from a folder.

    Raises:
        HeatertuneError: it is damaged, of other words, without a PASS or with files that the controller does not have.
    """
    from heatertune.proof.document import check_document  # noqa: PLC0415 - the help must not wait for it
    from heatertune.proof.words_file import certificate, demand_same_words, words_of  # noqa: PLC0415

    where = "the cache"
    if set(document) != {"words", "pid", "proof", "notes", "files"} or not all(
            isinstance(document[name], kind) for name, kind in (("words", dict), ("proof", dict), ("notes", list),
                                                                ("files", dict))):
        raise DocumentError(f"{where}: no export")
    proof = check_document(document["proof"], where)
    demand_same_words(document["words"], proof, where)
    words = words_of(document["words"], asked.words.target, where)
    if asked.ramp is None and words != asked.words:
        raise DocumentError(f"{where}: other words")
    expected = plc.controller_for(words.target).export(words, certificate(proof, force=force))
    if {name: text if isinstance(text, str) else list(text) for name, text in expected.items()} != document["files"]:
        raise DocumentError(f"{where}: files: others than the controller's")
    return document
