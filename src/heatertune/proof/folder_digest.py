"""One digest over log, model, design, parameters and proof: a folder with documents of two designs is refused.

Each of these documents may be whole by itself. A folder of an earlier release has no digest over all of them; its
parameters are proven again before they leave, as those of any folder are. The digest bears a mark by this user's key:
that the model is of the log is believed of a folder that was designed here, and looked at in any other.
"""

from __future__ import annotations

import hmac
from collections.abc import Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np

from heatertune import cache
from heatertune.codec import LEFT_OUT, Document, EarlierDocument, decode, read_document, register_schema, schema_of
from heatertune.errors import DocumentError
from heatertune.model import model_document
from heatertune.model.model_values import FitOutcome
from heatertune.pid import design_document
from heatertune.proof.proof_document import LogView, digest_of, with_digest
from heatertune.proof.verdict import PROOF_SCHEMA
from heatertune.proof.words_file import WORDS_SCHEMA

__all__ = ["DIGEST_FILE", "DIGEST_SCHEMA", "demand_log_of_model", "demand_one_design", "digest_problem",
           "folder_digest"]

DIGEST_FILE: Final = "digest.json"
DIGEST_SCHEMA: Final = "heatertune/digest/1"
_SCHEMAS: Final[Mapping[str, str]] = {
    "log": str(schema_of(LogView)), "model": model_document.SCHEMA, "pid": design_document.SCHEMA,
    "words": WORDS_SCHEMA, "proof": PROOF_SCHEMA}
#: readings of two logs differ by more than a fit leaves over (rms, times), and than documents round [°C]
_APART: Final = 2.0
_LEAST_DEGC: Final = 1e-3
#: outcome of a model that was entered by its numbers, and that says that no log supports it
_BY_HAND: Final = FitOutcome.BY_HAND.name
#: that an export writes; log and model stay where `design` wrote them
_EXPORTED: Final = ("pid", "words", "proof")


@register_schema(DIGEST_SCHEMA)
@dataclass(frozen=True, slots=True, kw_only=True)
class FolderDigest:
    """What `digest.json` holds.

    Attributes:
        documents: name of a document → its digest.
        digest: of these together.
        mark: of that digest, by the key of the user who designed; None: no key could be kept.
    """

    documents: Mapping[str, str]
    digest: str
    mark: str | None = field(default=None, metadata=LEFT_OUT)

    def without(self, names: Collection[str]) -> dict[str, str]:
        """Return the digests of all documents but some."""
        return {name: digest for name, digest in self.documents.items() if name not in names}

    @property
    def knows_log(self) -> bool:
        """Whether this user designed the model of this log on this machine."""
        own = cache.mark(self.digest) if self.mark is not None and {"log", "model"} <= self.documents.keys() else None
        return own is not None and hmac.compare_digest(own.encode(), str(self.mark).encode(errors="replace"))


def folder_digest(documents: Mapping[str, Document], earlier: Path | None = None) -> Document:
    """Return the document of the digest over documents that belong together.

    Args:
        documents: by name; those that have no part in it are left out.
        earlier: folder whose log and model stay, with the digests that they have there; None: there is none.
    """
    own = {name: digest_of(documents[name]) for name in _SCHEMAS if name in documents}
    stored = None if earlier is None else _stored(earlier)
    stay = {} if stored is None else stored.without(_EXPORTED)
    document = with_digest({"schema": DIGEST_SCHEMA, "documents": {**stay, **own}})
    # who exports into the folder of another does not vouch for its log
    mark = None if stored is not None and stay and not stored.knows_log else cache.mark(str(document["digest"]))
    return document if mark is None else {**document, "mark": mark}


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


def demand_log_of_model(folder: Path, remedy: str) -> None:
    """Refuse a folder of another user or machine in which nothing shows whether the model is of the log.

    Args:
        folder: that holds them.
        remedy: takes the parameters out of it without the log.

    Raises:
        DocumentError: nothing shows it; or a document is damaged.
    """
    log, model, stored = _read(folder, "log"), _read(folder, "model"), _stored(folder)
    if log is None or model is None or model.get("outcome") == _BY_HAND or (stored is not None and stored.knows_log):
        return
    try:
        apart = _apart_degC(log, model)
    except (KeyError, TypeError, ValueError) as problem:
        raise DocumentError(f"{folder / 'log.json'}: nothing shows whether the model was fitted to it: {problem}, and "
                            f"the folder was not designed by this user on this machine; {remedy}") from None
    if apart:
        raise DocumentError(f"{folder / 'log.json'}: the model was fitted to other readings; {remedy}")


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
    with suppress(KeyError, TypeError, ValueError):  # damaged, which who reads them tells; or not comparable
        fitted_to, read = model["log_summary"], (log["taken"] or {"line": None})["line"]
        if fitted_to and read is not None and read not in fitted_to:
            return f"{folder / 'log.json'}: {read!r}; the model was fitted to {fitted_to[0]!r}"
        if apart_degC := _apart_degC(log, model):
            return (f"{folder / 'log.json'}: its readings differ by {apart_degC:.2g} °C (rms) from those that the "
                    "model was fitted to")
    return ""


def _apart_degC(log: Document, model: Document) -> float:
    """Return how far the readings of a log are from those of a model's residuals, rms [°C]; 0 where they are the same.

    Raises KeyError, TypeError or ValueError where they cannot be compared, with the reason.
    """
    _demand_comparable(log, model)
    residuals = model["residuals"]
    time_s, measured, simulated = (np.asarray(residuals[name], dtype=float)
                                   for name in ("time_s", "measured_degC", "simulated_degC"))
    at_s, degC = (np.asarray(log[name], dtype=float) for name in ("time_s", "temperature_degC"))
    if not len(measured) or len(measured) != len(simulated):
        raise ValueError("the residuals are not as many as the readings")
    apart, misfit = (float(np.sqrt(np.mean(error**2))) for error in (np.interp(time_s, at_s, degC) - measured,
                                                                measured - simulated))
    if isinstance(fit_pct := model.get("fit_pct"), float):  # the model's own figure for what is left
        misfit = min(misfit, (1.0 - fit_pct / 100.0) * float(np.std(measured)) + _LEAST_DEGC)
    return 0.0 if apart <= _LEAST_DEGC + _APART * misfit else apart


def _demand_comparable(log: Document, model: Document) -> None:
    """Raise ValueError, with the reason, where a model's residuals are not of the readings of one log as they are."""
    reasons = {"the model is of several logs": len(model.get("log_summary") or ()) > 1,
               "the model has no residuals": model.get("residuals") is None,
               "the fit corrects the readings for a disturbance": model.get("disturbance") is not None,
               "the fit corrects the readings for a cooler": log.get("cooling_pct") is not None}
    for reason, holds in reasons.items():
        if holds:
            raise ValueError(reason)


def _stored(folder: Path) -> FolderDigest | None:
    """Return the digest of a folder, None where there is none; raise DocumentError where it is damaged."""
    path = folder / DIGEST_FILE
    if not path.is_file():
        return None
    document = read_document(path, DIGEST_SCHEMA)
    view = decode(FolderDigest, document, path)
    if view.digest != with_digest({name: value for name, value in document.items() if name != "mark"})["digest"]:
        raise DocumentError(f"{path}: digest: not that of its documents: it was changed; design again")
    return view


def _read(folder: Path, name: str) -> Document | None:
    path = folder / f"{name}.json"
    return read_document(path, _SCHEMAS[name]) if path.is_file() else None


def _digest_in(folder: Path, name: str) -> str | None:
    document = _read(folder, name)
    return None if document is None else digest_of(
        document.original if isinstance(document, EarlierDocument) else document)
