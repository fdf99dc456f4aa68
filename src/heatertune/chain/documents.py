"""The JSON documents that no single stage owns: log, words, pictures."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from heatertune.chain.views import ComparisonView, LogView, PicturesView
from heatertune.codec import decode, encode, schema_of
from heatertune.documents import read_document
from heatertune.log.values import Log
from heatertune.model.view import ModelView
from heatertune.pid import document as pid_document
from heatertune.pid.document import PidView
from heatertune.plc import Words, controller_for
from heatertune.proof import Proof
from heatertune.proof.document import ProofView, checked
from heatertune.proof.words_file import WORDS_SCHEMA, WholeWordsView, demand_same_words

__all__ = ["log_document", "read_documents", "words_document"]

_VIEWS: Final[Mapping[str, type]] = {
    "log": LogView, "model": ModelView, "pid": PidView, "words": WholeWordsView, "proof": ProofView,
    "pictures": PicturesView, "comparison": ComparisonView,
}


def log_document(log: Log) -> dict[str, Any]:
    """Return the JSON document of a log as it was understood."""
    names = ("name", "source", "time_s", "temperature_degC", "power_pct", "setpoint_degC", "repairs", "doubts")
    taken = None if log.taken is None else log.taken.document()
    return {"schema": "heatertune/log/1"} | {name: getattr(log, name) for name in names} | {"taken": taken}


def words_document(
    words: Words, proof: Proof, files: Mapping[str, str | bytes], search: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Return the JSON document of words, in the order in which they are typed in, and how they were found."""
    fields = controller_for(words.target).fields
    return {
        "schema": WORDS_SCHEMA,
        "target": words.target,
        "words": dict(words.values),
        "fields": [{name: getattr(f, name) for name in ("name", "address", "format", "low", "high", "comment")}
                   for f in fields],
        "sample_time_s": words.sample_time_s,
        "setpoint_degC": proof.scenario.setpoint_degC,
        "setpoint_units": controller_for(words.target).measure(words, proof.scenario.setpoint_degC),
        "setpoint_ramp": proof.ramp_document(),
        "scaling": {"low_degC": words.scaling.low_degC, "high_degC": words.scaling.high_degC},
        "realised": None if proof.design is None else pid_document.to_document(proof.design),
        "files": sorted(files),
        "verdict": proof.verdict,
        "forced": bool(files) and proof.verdict != "PASS",
        "search": None if search is None else dict(search),
    }


def read_documents(directory: Path) -> dict[str, dict[str, Any]]:
    """Return the documents that `design` wrote into a directory.

    Raises:
        DocumentError: one is missing or is none, or the proof does not follow from its values.
        ExportRefused: the proof is of other words.
    """
    documents = {}
    for name, view in _VIEWS.items():
        path = directory / f"{name}.json"
        document = read_document(path, str(schema_of(view)))
        value: object = decode(view, checked(document, path) if name == "proof" else document, path)
        documents[name] = encode(value) | document  # with what it may leave out, its own numbers as they are written
    if documents["words"]["realised"] is not None:
        decode(PidView, documents["words"]["realised"], directory / "words.json", "realised")
    demand_same_words(documents["words"], documents["proof"], directory / "proof.json")
    return documents
