"""The JSON documents that belong to no single stage: log, words, pictures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from heatertune.codec import Document, construct_from, data_folder, decode, encode, plain, read_document, schema_of
from heatertune.errors import DocumentError
from heatertune.log.values import Log
from heatertune.model.document import ModelView
from heatertune.pid import document as pid_document
from heatertune.pid.document import PidView
from heatertune.plc import Words, controller_for
from heatertune.proof import Proof
from heatertune.proof.document import ComparisonView, LogView, PicturesView, ProofView, TakenView, check_document
from heatertune.proof.repetition import demand_consistent
from heatertune.proof.verdict import FIRST, verdict_first
from heatertune.proof.words_file import FieldView, WholeWordsView, demand_same_words

__all__ = ["log_document", "read_documents", "without_curves", "words_document"]

_VIEWS: Final[Mapping[str, type]] = {
    "log": LogView, "model": ModelView, "pid": PidView, "words": WholeWordsView, "proof": ProofView,
    "pictures": PicturesView, "comparison": ComparisonView,
}


def log_document(log: Log) -> dict[str, Any]:
    """Return the JSON document of a log as it was understood."""
    taken = None if log.taken is None else decode(TakenView, plain(log.taken.document()), log.name)
    document: dict[str, Any] = encode(construct_from(LogView, log, taken=taken))
    return document


def words_document(
    words: Words, proof: Proof, files: Mapping[str, str | bytes], search: Document | None = None
) -> dict[str, Any]:
    """Return the JSON document of the controller parameters, in the order of entry, and how they were found."""
    target, setpoint = controller_for(words.target), proof.scenario.setpoint_degC
    fields = tuple(construct_from(FieldView, field) for field in target.fields)
    document: dict[str, Any] = encode(construct_from(
        WholeWordsView, words, proof, words=words.values, fields=fields, setpoint_degC=setpoint,
        setpoint_units=target.measure(words, setpoint),
        realised=None if proof.design is None else pid_document.to_document(proof.design), files=tuple(sorted(files)),
        forced=bool(files) and proof.verdict != "PASS", search=None if search is None else plain(search)))
    return document


def without_curves(documents: Mapping[str, Document], nearest: Sequence[str] = ()) -> dict[str, Any]:
    """Return a design without curves: verdict, setpoint, specification, parameters, criteria and files first.

    Args:
        documents: of all stages; log and pictures contain the curves.
        nearest: for a failing design, the command that gives PASS.
    """
    proof = verdict_first(documents["proof"])
    first = {name: proof.pop(name) for name in FIRST}
    curves = {"model": ("residuals",), "comparison": ("paper",)}
    rest = {name: {key: part for key, part in documents[name].items() if key not in curves.get(name, ())}
            for name in ("model", "pid", "comparison")}
    words = {name: part for name, part in documents["words"].items() if name not in ("words", "target", "verdict")}
    return {**first, "files": documents["words"]["files"], "nearest": list(nearest), "schema": "heatertune/design/2",
            "encoded": words, "proof": proof, **rest}


def read_documents(folder: str | Path) -> dict[str, dict[str, Any]]:
    """Return the documents that `design` wrote into a folder.

    Raises:
        DocumentError: one is missing or invalid, the proof does not follow from its values, the parameters do not state
            its verdict, or the words, the design and the heater do not belong together.
        ExportRefused: the proof belongs to other parameters.
    """
    documents, directory = {}, data_folder(folder)
    for name, view in _VIEWS.items():
        path = directory / f"{name}.json"
        document = read_document(path, str(schema_of(view)))
        value: object = decode(view, check_document(document, path) if name == "proof" else document, path)
        documents[name] = _completed(document, encode(value))
    if (realised := documents["words"]["realised"]) is not None:
        complete = encode(decode(PidView, realised, directory / "words.json", "realised"))
        documents["words"]["realised"] = _completed(realised, complete)
    demand_same_words(documents["words"], documents["proof"], directory / "proof.json")
    own, proven = (documents[name]["verdict"] for name in ("words", "proof"))
    if own != proven:
        raise DocumentError(f"{directory / 'words.json'}: verdict: {own!r}; proof.json next to it says {proven!r}: "
                            "export the parameters again (heatertune export-db)")
    demand_consistent(directory, documents)
    return documents


def _completed(document: Any, complete: Any) -> Any:
    """Return a document with the fields that it leaves out, at every depth; its own numbers stay as written."""
    if isinstance(document, dict) and isinstance(complete, dict):
        return complete | {key: _completed(value, complete[key]) if key in complete else value
                           for key, value in document.items()}
    if isinstance(document, list) and isinstance(complete, list) and len(document) == len(complete):
        return [_completed(value, default) for value, default in zip(document, complete, strict=True)]
    return document
