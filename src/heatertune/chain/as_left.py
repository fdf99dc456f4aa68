"""A folder of `design` and a trace of the commissioned loop → as left, and the record with it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from heatertune.codec import decode
from heatertune.commissioned import RECORD_SCHEMA, AsLeftSettings, RecordSettings
from heatertune.documents import data_folder, read_document, to_json
from heatertune.log.values import Log
from heatertune.model.document import from_document
from heatertune.progress import ProgressCallback
from heatertune.proof.as_left import AS_LEFT_SCHEMA, AsLeft, as_left
from heatertune.proof.document import ProofView
from heatertune.proof.words_file import words_of
from heatertune.proof.write_comparison import WRITTEN_SCHEMA, WriteHistory

__all__ = ["as_left_in", "files_of", "related_documents"]

def as_left_in(
    directory: str | Path, documents: Mapping[str, Mapping[str, Any]], log: Log,
    settings: AsLeftSettings | None = None, progress: ProgressCallback = str,
) -> AsLeft:
    """Return a trace beside the proof of a design.

    Args:
        directory: names the documents in an error.
        documents: of its stages, as `read_documents` returns them.
        log: the trace.
        settings: what is known beside it.
        progress: told how far the runs are.

    Raises:
        InputError, OutOfRange: as `heatertune.proof.as_left.as_left`.
        DocumentError: a document is not whole.
    """
    held, folder = documents["words"], data_folder(directory)
    words = words_of(held, held["target"], folder / "words.json")
    proof = decode(ProofView, dict(documents["proof"]), folder / "proof.json")
    return as_left(log, words, from_document(documents["model"]), proof, settings, progress=progress)


def related_documents(directory: str | Path, proof: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Return what lies beside the documents of a design: "as_left" and "written" of this proof, and "record".

    Raises:
        DocumentError: one of them is not whole.
    """
    folder, found = data_folder(directory), {}
    for name, schema, kind in (("as_left", AS_LEFT_SCHEMA, AsLeft), ("written", WRITTEN_SCHEMA, WriteHistory),
                               ("record", RECORD_SCHEMA, RecordSettings)):
        path = folder / f"{name}.json"
        if path.exists():
            document = read_document(path, schema)
            decode(kind, document, path)
            if name == "record" or document["digest"] == proof["digest"]:
                found[name] = document
    return found


def files_of(directory: str | Path, documents: Mapping[str, Mapping[str, Any]]) -> dict[str, str]:
    """Return what is written of them beside the documents of a design, name → content."""
    folder = data_folder(directory).relative_to(directory)
    return {str(folder / f"{name}.json"): to_json(documents[name]) for name in ("as_left", "written", "record")
            if name in documents}
