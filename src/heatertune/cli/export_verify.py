"""The commands from a design to its proof and its files: `export-db`, `verify`, `feed-forward` and `report`."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from heatertune import chain, options, plc, report
from heatertune.cli import common, printing
from heatertune.cli.command_table import write_records
from heatertune.cli.saved_design import ProofSource, parameters_file, proof_source, redesign_command, target_in
from heatertune.codec import DATA, data_folder, to_json
from heatertune.errors import DocumentError, ExportRefused, InputError
from heatertune.settings import AsLeftSettings, FeedForwardSettings, ReadSettings, RecordSettings, SampleSettings
from heatertune.writing import write_files

if TYPE_CHECKING:
    from heatertune.proof.difference import WriteHistory

__all__ = [
    "EXPORT_DB_EXAMPLE", "FEED_FORWARD_EXAMPLE", "REPORT_EXAMPLE", "VERIFY_EXAMPLE", "add_export_db",
    "add_feed_forward", "add_report", "add_verify",
]


VERIFY_EXAMPLE = "example: heatertune verify pid.json --target s5-ob251"


def add_verify(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "verify", help="prove a design or parameters; exit status 1 if the verdict is not PASS", epilog=VERIFY_EXAMPLE,
        description="Simulate the closed loop with the PLC's own arithmetic on every plausible heater and judge it.",
    )
    command.add_argument("pid", metavar="PID|WORDS",
                         help="pid.json of tune, words.json of export-db, or the folder of a design")
    common.add_word_options(command, "words_by", "setpoint_ramp", "boost")
    common.add_proof_options(command, needed=False)
    common.add_model_options(command)
    options.add(command.add_argument_group("many heaters"), SampleSettings)
    printing.add_output_options(command, _run_verify, brief=True)


def _run_verify(settings: argparse.Namespace) -> int:
    from heatertune.proof.setpoint_ramp import prove_ramped
    from heatertune.proof.verdict import verdict_first, verdict_line

    progress = printing.Progress(settings)
    settings.pid = parameters_file(settings.pid)
    settings.target = settings.target or target_in(settings.pid)
    source, drawn = proof_source(settings), options.of(SampleSettings, settings)
    fitted, conditions = source.fitted_model, source.conditions
    if drawn.replay is not None:
        from heatertune.proof.monte_carlo.run import replay_document

        if source.ramp is not None:
            raise InputError("--replay runs the words with the ramp they have; --setpoint-ramp would be another proof")
        if drawn.samples is not None:
            raise InputError("--replay runs one sample, --samples many: give one of them")
        document = replay_document(source.words, fitted, drawn.replay, conditions, spread=drawn.spread)
        printing.output(settings, document, lambda: f"{report.criteria_table(document)}\nVERDICT {document['verdict']}")
        return 0 if document["verdict"] == "PASS" else 1
    progress("proving the parameters")
    proof, notes = prove_ramped(source.words, fitted, source.ramp, conditions, progress=progress)
    if drawn.samples is not None:
        from heatertune.proof.monte_carlo.run import with_samples

        progress(f"proving them on {drawn.samples} samples")
        proof = with_samples(proof, fitted, drawn, conditions)
    document = proof.to_document()
    redesign = redesign_command(settings, source, proof.scenario.setpoint_degC)
    remarks, line = [*source.notes, *report.ramp_note(document), *notes], verdict_line(document)
    printing.output(
        settings, document,
        lambda: "\n".join([line, report.criteria_table(document), *(f"- {remark}" for remark in remarks),
                           *report.samples_table(document), f"VERDICT {line}"]),
        brief=lambda: report.verify_brief(document, remarks, source.way_on, redesign),
        short=lambda: verdict_first(document))
    return 0 if document["verdict"] == "PASS" else 1


FEED_FORWARD_EXAMPLE = "example: heatertune feed-forward oven/ --disturbance-range 0 1 --contact"


def add_feed_forward(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "feed-forward", help="measured disturbance → feed-forward for the PLC, compared with plain feedback",
        epilog=FEED_FORWARD_EXAMPLE,
        description="Design feed-forward of the disturbance that `heatertune design --disturbance-column` found in the "
                    "log, compare it with plain feedback on every plausible heater, and write its program.",
    )
    command.add_argument("directory", metavar="DIR", help="folder that `heatertune design` wrote")
    command.add_argument("-o", "--out", metavar="DIR", help="folder for the results (default: the same)")
    options.add(command, FeedForwardSettings)
    command.add_argument("--force", action="store_true", help="write the program even if a verdict is not PASS")
    printing.add_output_options(command, _run_feed_forward)


def _run_feed_forward(settings: argparse.Namespace) -> int:
    from heatertune.chain.pipeline import feed_forward

    fed = feed_forward(settings.directory, options.of(FeedForwardSettings, settings), force=settings.force)
    out, document = settings.out or settings.directory, fed.proof.to_document()
    write_files(out, fed.files)
    written = f"written to {out}: {', '.join(sorted(fed.files))}"
    printing.output(settings, document, lambda: f"{report.feed_forward_lines(document)}\n{written}")
    if fed.proof.refusal and not settings.force:
        raise ExportRefused(f"{fed.proof.refusal}; --force writes the program anyway")
    return 0


REPORT_EXAMPLE = "example: heatertune report out/ --as-left trace.csv --plant-tag TIC-101"


def add_report(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "report", help="rebuild report.html, with the commissioned loop", epilog=REPORT_EXAMPLE,
        description="Rebuild report.html from the JSON documents that `heatertune design` wrote. With --as-left, "
                    "compare a trace of the commissioned loop with the proof, which is repeated from the beginning of "
                    "the trace; exit status 1 if the loop is not as proven. With --record, include what was written "
                    "into the PLC; exit status 1 if that did not end in DONE.",
    )
    command.add_argument("directory", metavar="DIR", help="folder that `heatertune design` wrote")
    options.add(command.add_argument_group("the record"), RecordSettings)
    group = command.add_argument_group("as left")
    group.add_argument("--as-left", metavar="TRACE",
                       help="an export of the commissioned loop: time and temperature; setpoint and power if available")
    options.add(group, AsLeftSettings)
    options.add(command.add_argument_group("reading the trace"), ReadSettings)
    command.add_argument_group("written into the PLC").add_argument(
        "--record", action="extend", nargs="+", metavar="RECORD",
        help="records of heatertune write with these parameters: as found, as left and the watched response, in order "
             "of time; they replace earlier ones")
    printing.add_output_options(command, _run_report, brief=True)


def _run_report(settings: argparse.Namespace) -> int:
    from heatertune.chain.documents import without_curves
    from heatertune.chain.pipeline import redraw
    from heatertune.log import read_log
    from heatertune.report.as_left_section import CURVES, as_left_brief

    about, progress = options.of(AsLeftSettings, settings), printing.Progress(settings)
    if settings.as_left is None and about != AsLeftSettings():
        raise InputError("--setpoint, --ambient, --begins-at and --load-at need --as-left TRACE")
    written = _written(settings)
    trace = None if settings.as_left is None else read_log(settings.as_left, common.reading(settings), errata=True)
    printing.tell_taken(settings, [] if trace is None else [trace], progress)
    documents = redraw(settings.directory, trace, about, options.of(RecordSettings, settings), progress,
                       written=written)
    page = Path(settings.directory) / "report.html"
    is_done = written is None or written.passages[-1].outcome == "done"
    if trace is not None:
        left, target = documents["as_left"], documents["words"]["target"]
        printing.output(settings, left, lambda: as_left_brief(left, target, str(page), whole=True),
                        brief=lambda: as_left_brief(left, target, str(page)),
                        short=lambda: {name: part for name, part in left.items() if name not in CURVES})
        return 0 if left["verdict"] == "AS PROVEN" and is_done else 1
    if written is not None:

        printing.output(settings, documents["written"], lambda: report.writes_brief(documents["written"], str(page)))
        return 0 if is_done else 1
    printing.output(settings, documents, lambda: f"{report.summary(documents)}\n{page}",
                    brief=lambda: report.design_brief(documents, settings.directory),
                    short=lambda: without_curves(documents))
    return 0 if documents["proof"]["verdict"] == "PASS" else 1


def _written(settings: argparse.Namespace) -> WriteHistory | None:
    return None if settings.record is None else write_records(settings.record, settings.directory)


EXPORT_DB_EXAMPLE = "example: heatertune export-db pid.json --target s5-ob251 -o out/"


def add_export_db(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "export-db", help="pid → proven parameters as text for the PLC", epilog=EXPORT_DB_EXAMPLE,
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
    printing.add_output_options(command, _run_export_db)


def _run_export_db(settings: argparse.Namespace) -> int:
    from heatertune.proof.folder_digest import DIGEST_FILE, folder_digest
    from heatertune.proof.verdict import verdict_line
    from heatertune.proof.words_file import export_first, exported_names

    again = None if common.wants_proof(settings) else _exported_again(settings)
    proven = again or _proven(settings)
    document = proven["words"]
    documents = {"words.json": to_json(document), "proof.json": to_json(proven["proof"])}
    stale_files = ["words.json", "proof.json", *exported_names(data_folder(settings.out) / "words.json")]
    if proven["pid"] is not None:
        documents["pid.json"] = to_json(proven["pid"])
    else:  # that of other words must not lie next to these
        stale_files.append(f"{DATA}/pid.json")
    together = {name: proven[name] for name in ("pid", "words", "proof") if proven[name] is not None}
    documents[DIGEST_FILE] = to_json(folder_digest(together, Path(settings.out) / DATA))
    moved = {f"{DATA}/{name}": content for name, content in documents.items()}
    written = write_files(settings.out, {**proven["files"], **moved}, gone=stale_files)
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
    from heatertune.proof.words_file import certificate, read_words

    if read_words(settings.pid, common.target(settings)) is None:
        return None
    from heatertune.proof.repetition import repeat_proof

    again = repeat_proof(settings.pid, accept=common.conditions(settings).accept, progress=printing.Progress(settings))
    certified = certificate(again.proof, force=settings.force)
    files = dict(plc.controller_for(again.words.target).export(again.words, certified))
    exported = {"files": sorted(files), "verdict": certified.verdict, "forced": certified.forced}
    return {"words": {**again.words_document, **exported}, "proof": again.proof, "files": files, "pid": again.design}


def _proven(settings: argparse.Namespace) -> dict[str, Any]:
    """Return the words of a design, proven: documents and files.

    What is exported was proven then or before: the verdict on the same words, heater and conditions by the same
    program on this machine is read from the cache and checked like any proof. `verify` always proves again.
    """
    from heatertune.cache import load_or_compute, release
    from heatertune.model import model_document
    from heatertune.proof.specification import specification_of

    progress = printing.Progress(settings)
    source = proof_source(settings)
    inputs = {
        "words": repr(source.words), "choice": repr(source.choice),
        "model": model_document.to_document(source.fitted_model),
        "ramp": source.ramp, "conditions": asdict(source.conditions), "notes": source.notes, "force": settings.force,
        "specification": repr(specification_of(source.conditions)),  # of files that may change
        "libraries": [release(name) for name in ("numpy", "scipy", "numba")]}
    result = load_or_compute("export", inputs, lambda: _prove(source, progress, force=settings.force),
                  lambda document: _demand_export(document, source, force=settings.force), progress=progress)
    for note in result["notes"]:
        progress.note(note)
    files = {name: text if isinstance(text, str) else bytes(text) for name, text in result["files"].items()}
    return result | {"files": files}


def _prove(source: ProofSource, progress: Any, *, force: bool) -> dict[str, Any]:
    from heatertune.chain.documents import words_document
    from heatertune.plc.word_selection import search_document
    from heatertune.proof.repetition import design_document
    from heatertune.proof.setpoint_ramp import prove_ramped

    proof, remarks = prove_ramped(source.words, source.fitted_model, source.ramp, source.conditions, progress=progress)
    notes = [*source.notes, *remarks]
    search = None if source.choice is None else search_document(source.choice, source.fitted_model, notes)
    try:
        files = chain.export(proof.words, proof, force=force)
    except ExportRefused:  # nothing is kept; the way on is among the notes
        for note in notes:
            progress.note(note)
        raise
    document = words_document(proof.words, proof, files, search)
    design = design_document(proof, source.design, source.fitted_model, source.recipe, source.conditions)
    return {"words": document, "pid": design, "proof": proof.to_document(), "notes": notes,
            "files": {name: text if isinstance(text, str) else list(text) for name, text in files.items()}}


def _demand_export(document: dict[str, Any], source: ProofSource, *, force: bool) -> dict[str, Any]:
    """Return the document of an export, checked as one that was read from a folder.

    Raises:
        HeatertuneError: it is damaged, of other words, without a PASS or with files that the controller does not have.
    """
    from heatertune.proof.proof_document import check_document
    from heatertune.proof.words_file import certificate, demand_same_words, words_of

    where = "the cache"
    if set(document) != {"words", "pid", "proof", "notes", "files"} or not all(
            isinstance(document[name], kind) for name, kind in (("words", dict), ("proof", dict), ("notes", list),
                                                                ("files", dict))):
        raise DocumentError(f"{where}: no export")
    proof = check_document(document["proof"], where)
    demand_same_words(document["words"], proof, where)
    words = words_of(document["words"], source.words.target, where)
    if source.ramp is None and words != source.words:
        raise DocumentError(f"{where}: other words")
    expected = plc.controller_for(words.target).export(words, certificate(proof, force=force))
    if {name: text if isinstance(text, str) else list(text) for name, text in expected.items()} != document["files"]:
        raise DocumentError(f"{where}: files: others than the controller's")
    return document
