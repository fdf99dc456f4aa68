"""The whole chain in one call, and its report."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from heatertune.chain.comparison import paper_runs, rivals
from heatertune.chain.documents import log_document, pictures, words_document
from heatertune.chain.stages import Told, encode, export, fit, prove, tune
from heatertune.documents import plain, to_json, write_files
from heatertune.log import read_log
from heatertune.model import document as model_document
from heatertune.pid import document as pid_document
from heatertune.plc import Scaling, room

__all__ = ["design", "report"]


def design(
    source: str | Path, *, target: str, out: str | Path, reading: Mapping[str, Any] | None = None,
    fitting: Mapping[str, Any] | None = None, tuning: Mapping[str, Any] | None = None,
    proving: Mapping[str, Any] | None = None, scaling: Scaling | None = None, force: bool = False, progress: Told = str,
) -> dict[str, dict[str, Any]]:
    """Run the whole chain, write every stage's document, the export files and the report; return the documents.

    A verdict of FAIL writes documents and report but no export files, unless `force` is given.

    Args:
        source: a log, or "table3" / "table4".
        target: the controller.
        out: directory for the results.
        reading: options of `read_log`.
        fitting: options of `fit`.
        tuning: options of `tune`.
        proving: options of `prove`.
        scaling: sensor range.
        force: export in spite of FAIL.
        progress: told what begins.

    Raises:
        HeatertuneError: as the stages; nothing is written then.
    """
    room(target)  # an unknown target is refused before the long part
    log = read_log(source, **(reading or {}))
    fitted = fit(log, companions=True, progress=progress, **(fitting or {}))
    wished = tune(fitted, target=target, progress=progress, **(tuning or {}))
    words = encode(wished, target, scaling=scaling)
    progress(f"proving the words on {len(fitted.plants)} models")
    proof = prove(words, fitted, **(proving or {}))
    files = export(words, proof, force=force) if force or proof.verdict == "PASS" else {}
    progress("comparing with other designs")
    # as JSON holds them: the report drawn now is the one drawn later from the files
    documents: dict[str, dict[str, Any]] = plain({
        "log": log_document(log),
        "model": model_document.to_document(fitted),
        "pid": pid_document.to_document(wished, fitted),
        "words": words_document(words, proof, files),
        "proof": proof.to_document(),
        "pictures": pictures(wished, fitted, proof),
        "comparison": {
            "schema": "heatertune/comparison/1",
            "rivals": rivals(fitted, words, proof),
            "paper": paper_runs(fitted) if log.same_heater else None,
        },
    })
    progress("drawing the report")
    written = {f"{name}.json": to_json(document) for name, document in documents.items()}
    from heatertune.report import render  # noqa: PLC0415 - matplotlib only where pictures are drawn

    write_files(out, {**written, **files, "report.html": render(documents)})
    return documents


def report(documents: Mapping[str, Mapping[str, Any]], directory: str | Path) -> list[Path]:
    """Write `report.html` made from the stages' documents; return its path.

    Raises:
        InputError: the directory cannot be written.
    """
    from heatertune.report import render  # noqa: PLC0415 - matplotlib

    return write_files(directory, {"report.html": render(documents)})
