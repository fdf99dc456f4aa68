"""The whole chain in one call, and its report."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from heatertune import cache
from heatertune.chain.comparison import paper_runs, price_of_doubt, rivals
from heatertune.chain.documents import log_document, pictures, read_documents, words_document
from heatertune.chain.pwm import with_pwm
from heatertune.chain.ramp import prove_ramped
from heatertune.chain.refine import refine
from heatertune.chain.stages import Told, export, fit, tune
from heatertune.chain.words import choose_words, search_document, tune_for_words
from heatertune.documents import plain, to_json, write_files
from heatertune.log import read_log
from heatertune.log.values import Log
from heatertune.model import document as model_document
from heatertune.model.values import FittedModel
from heatertune.pid import document as pid_document
from heatertune.pid.values import PidDesign
from heatertune.plc import Scaling, room
from heatertune.proof import Proof

__all__ = ["design", "dossier", "redraw", "write_report"]


def design(
    source: str | Path | Log, *, target: str, out: str | Path, reading: Mapping[str, Any] | None = None,
    fitting: Mapping[str, Any] | None = None, tuning: Mapping[str, Any] | None = None,
    proving: Mapping[str, Any] | None = None, scaling: Scaling | None = None, force: bool = False, progress: Told = str,
    words_by: str = "auto", interval_by_words: bool = False, refined: bool = False,
    switch_kind: str | None = None, setpoint_ramp: float | str | None = None,
) -> dict[str, dict[str, Any]]:
    """Run the whole chain, write every stage's document, the export files and the report; return the documents.

    A verdict of FAIL writes documents and report but no export files, unless `force` is given.

    Args:
        source: a log's file, "table3" / "table4", or what `read_log` returned.
        target: the controller.
        out: directory for the results.
        reading: options of `read_log`; misprints of a built-in table are corrected.
        fitting: options of `fit`.
        tuning: options of `tune`.
        proving: options of `prove`.
        scaling: sensor range.
        force: export in spite of FAIL.
        progress: told what begins.
        words_by: how the words are found, see `choose_words`.
        interval_by_words: whether TA is the one whose words are best, see `tune_for_words`.
        switch_kind: "relay" or "ssr": the PWM period is proposed for it, see `with_pwm`; a given actuator stays.
        refined: whether the gains are refined in the loop of the proof, see `refine`.
        setpoint_ramp: [°C/min], "auto" or "none", see `prove_ramped`.

    Raises:
        HeatertuneError: as the stages; nothing is written then.
    """
    room(target)  # an unknown target is refused before the long part
    log = source if isinstance(source, Log) else read_log(source, **({"errata": True} | dict(reading or {})))
    fitted = fit(log, companions=True, progress=progress, **(fitting or {}))
    asked = dict(tuning or {})
    wished = (
        tune_for_words(fitted, target=target, scaling=scaling, progress=progress, **asked) if interval_by_words
        else tune(fitted, target=target, progress=progress, **asked)
    )
    choice = choose_words(wished, target, fitted, scaling=scaling, way=words_by, progress=progress)
    conditions = dict(proving or {})
    if switch_kind is not None:
        shared = {name: conditions[name] for name in ("setpoint_degC", "tolerance_degC") if name in conditions}
        wished, actuator = with_pwm(wished, fitted, switch_kind, words=choice.words, **shared)
        conditions = {"actuator": actuator} | conditions
    if refined:
        choice = refine(choice, fitted, proving=conditions, progress=progress)
    progress(f"proving the words on {len(fitted.plants)} models")
    proof, notes = prove_ramped(choice.words, fitted, setpoint_ramp, proving=conditions, progress=progress)
    files = export(proof.words, proof, force=force) if force or proof.verdict == "PASS" else {}
    progress("comparing with other designs, drawing the report")
    documents = dossier(log, fitted, wished, proof, files, search=search_document(choice, fitted, notes))
    _write(documents, files, out)
    return documents


def write_report(
    log: Log, fitted: FittedModel, wished: PidDesign, proof: Proof, out: str | Path, *, force: bool = False
) -> list[Path]:
    """Write the documents, the export files of words that passed (or were forced) and `report.html`; return the paths.

    Raises:
        InputError: the directory cannot be written.
    """
    files = export(proof.words, proof, force=force) if force or proof.verdict == "PASS" else {}
    return _write(dossier(log, fitted, wished, proof, files), files, out)


def dossier(
    log: Log, fitted: FittedModel, wished: PidDesign, proof: Proof, files: Mapping[str, str | bytes],
    search: Mapping[str, Any] | None = None,
) -> dict[str, dict[str, Any]]:
    """Return the documents of all stages, as JSON holds them: a report drawn now is one drawn later from the files."""
    documents: dict[str, dict[str, Any]] = plain({
        "log": log_document(log),
        "model": model_document.to_document(fitted),
        "pid": pid_document.to_document(wished, fitted),
        "words": words_document(proof.words, proof, files, search),
        "proof": proof.to_document(),
        "pictures": pictures(wished, fitted, proof),
    })
    inputs = {name: documents[name] for name in ("model", "pid", "words", "proof")} | {"same_heater": log.same_heater}
    documents["comparison"] = cache.cached("comparison", inputs, lambda: {
        "schema": "heatertune/comparison/1",
        "price": price_of_doubt(fitted, wished),
        "rivals": rivals(fitted, wished, proof),
        "paper": paper_runs(fitted) if log.same_heater else None,
    })
    return documents


def redraw(directory: str | Path) -> dict[str, dict[str, Any]]:
    """Draw `report.html` anew from the documents in a directory; return them.

    Raises:
        DocumentError: a document is missing or is none.
        InputError: the directory cannot be written.
    """
    documents = read_documents(Path(directory))
    write_files(directory, {"report.html": _page(documents)})
    return documents


def _write(documents: Mapping[str, Mapping[str, Any]], files: Mapping[str, str | bytes], out: str | Path) -> list[Path]:
    written = {f"{name}.json": to_json(document) for name, document in documents.items()}
    return write_files(out, {**written, **files, "report.html": _page(documents)})


def _page(documents: Mapping[str, Mapping[str, Any]]) -> str:
    from heatertune.report import render  # noqa: PLC0415 - matplotlib only where pictures are drawn

    return render(documents)
