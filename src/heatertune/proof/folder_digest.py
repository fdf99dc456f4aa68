"""One digest over log, model, design, parameters and proof: a folder with documents of two designs is refused.

Each of these documents may be whole by itself. A folder of an earlier release has no digest over all of them; its
parameters are proven again before they leave, as those of any folder are.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from heatertune.codec import Document, EarlierDocument, decode, read_document, register_schema, schema_of
from heatertune.errors import DocumentError
from heatertune.model import model_document
from heatertune.pid import design_document
from heatertune.proof.proof_document import LogView, digest_of, with_digest
from heatertune.proof.verdict import PROOF_SCHEMA
from heatertune.proof.words_file import WORDS_SCHEMA

__all__ = ["DIGEST_FILE", "DIGEST_SCHEMA", "demand_one_design", "digest_problem", "folder_digest"]

DIGEST_FILE: Final = "digest.json"
DIGEST_SCHEMA: Final = "heatertune/digest/1"
_SCHEMAS: Final[Mapping[str, str]] = {
    "log": str(schema_of(LogView)), "model": model_document.SCHEMA, "pid": design_document.SCHEMA,
    "words": WORDS_SCHEMA, "proof": PROOF_SCHEMA}
#: readings of two logs differ by more than a fit leaves over (rms, times), and than documents round [°C]
_APART: Final = 2.0
_LEAST_DEGC: Final = 1e-3
#: that an export writes; log and model stay where `design` wrote them
_EXPORTED: Final = ("pid", "words", "proof")


@register_schema(DIGEST_SCHEMA)
@dataclass(frozen=True, slots=True, kw_only=True)
class FolderDigest:
    """What `digest.json` holds.

    Attributes:
        documents: name of a document → its digest.
        digest: of these together.
    """

    documents: Mapping[str, str]
    digest: str


def folder_digest(documents: Mapping[str, Document], earlier: Path | None = None) -> Document:
    """Return the document of the digest over documents that belong together.

    Args:
        documents: by name; those that have no part in it are left out.
        earlier: folder whose log and model stay, with the digests that they have there; None: there is none.
    """
    own = {name: digest_of(documents[name]) for name in _SCHEMAS if name in documents}
    stored = None if earlier is None else _stored(earlier)
    stay = {} if stored is None else {name: digest for name, digest in stored.documents.items()
                                      if name not in _EXPORTED}
    return with_digest({"schema": DIGEST_SCHEMA, "documents": {**stay, **own}})


def demand_one_design(folder: Path, remedy: str) -> None:
    """Refuse documents of a folder that do not belong together.

    Args:
        folder: that holds them.
        remedy: makes a folder of one design.

    Raises:
        DocumentError: they do not, see `digest_problem`; or a document is damaged.
    """
    if problem := digest_problem(folder):
        raise DocumentError(f"{problem}; {remedy}")


def digest_problem(folder: Path) -> str:
    """Return which document of a folder is not that of its digest, or that its model is of another log; else nothing.

    Raises:
        DocumentError: a document is damaged.
    """
    stored = _stored(folder)
    for name, digest in () if stored is None else stored.documents.items():
        if name not in _SCHEMAS or _digest_in(folder, name) != digest:
            return (f"{folder / DIGEST_FILE}: {name}.json is not the one of this design: it was changed, is gone, or "
                    "is of another design")
    return _other_log(folder)


def _other_log(folder: Path) -> str:
    """Return that the model of a folder was fitted to another log than is there; nothing where it was not."""
    log, model = _read(folder, "log") or {}, _read(folder, "model") or {}
    with suppress(KeyError, TypeError, ValueError):  # damaged: who reads them tells it
        fitted_to, read = model["log_summary"], log["taken"]["line"]
        if fitted_to and read not in fitted_to:
            return f"{folder / 'log.json'}: {read!r}; the model was fitted to {fitted_to[0]!r}"
        if len(fitted_to) == 1 and (apart_degC := _apart_degC(log, model)):
            return (f"{folder / 'log.json'}: its readings differ by {apart_degC:.2g} °C (rms) from those that the "
                    "model was fitted to")
    return ""


def _apart_degC(log: Document, model: Document) -> float:
    """Return how far the readings of a log are from those of a model's residuals, rms [°C]; 0 where they are the same.

    What a fit corrects before (a disturbance, a cooler) is not comparable. Raises KeyError, TypeError or ValueError
    where a document is damaged.
    """
    found = model["residuals"]
    if found is None or model.get("disturbance") is not None or log.get("cooling_pct") is not None:
        return 0.0
    time_s, measured, simulated = (np.asarray(found[name], dtype=float)
                                   for name in ("time_s", "measured_degC", "simulated_degC"))
    at_s, degC = (np.asarray(log[name], dtype=float) for name in ("time_s", "temperature_degC"))
    apart, left = (float(np.sqrt(np.mean(each**2))) for each in (np.interp(time_s, at_s, degC) - measured,
                                                                measured - simulated))
    return apart if apart > _LEAST_DEGC + _APART * left else 0.0


def _stored(folder: Path) -> FolderDigest | None:
    """Return the digest of a folder, None where there is none; raise DocumentError where it is damaged."""
    path = folder / DIGEST_FILE
    if not path.is_file():
        return None
    document = read_document(path, DIGEST_SCHEMA)
    view = decode(FolderDigest, document, path)
    if view.digest != with_digest(document)["digest"]:
        raise DocumentError(f"{path}: digest: not that of its documents: it was changed; design again")
    return view


def _read(folder: Path, name: str) -> Document | None:
    path = folder / f"{name}.json"
    return read_document(path, _SCHEMAS[name]) if path.is_file() else None


def _digest_in(folder: Path, name: str) -> str | None:
    document = _read(folder, name)
    return None if document is None else digest_of(
        document.original if isinstance(document, EarlierDocument) else document)
