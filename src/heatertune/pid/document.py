"""PidDesign ↔ the JSON document that `heatertune tune` writes, the model it was made for included."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from heatertune.documents import number, optional_number, read_document
from heatertune.errors import DocumentError
from heatertune.model.document import SCHEMA as MODEL_SCHEMA
from heatertune.model.document import from_document as model_from_document
from heatertune.model.document import to_document as model_to_document
from heatertune.model.values import FittedModel
from heatertune.pid.values import Margins, PidDesign, Promise, structure_of

__all__ = ["SCHEMA", "from_document", "promise_document", "read_design", "read_promise", "to_document"]

SCHEMA = "heatertune/pid/1"


def to_document(design: PidDesign, model: FittedModel | None = None) -> dict[str, Any]:
    """Return the document; an integral time that is infinite is null."""
    document: dict[str, Any] = {
        "schema": SCHEMA,
        "gain_pct_per_degC": design.gain_pct_per_degC,
        "integral_time_s": design.integral_time_s,
        "derivative_time_s": design.derivative_time_s,
        "sample_time_s": design.sample_time_s,
        "derivative_filter": design.derivative_filter,
        "structure": design.structure,
        "method": design.method,
        "ms": None, "mt": None, "gain_margin": None, "phase_margin_deg": None,
        "iae_load": design.iae_load,
        "iae_setpoint": design.iae_setpoint,
        "mks": design.mks,
        "notes": list(design.notes),
        "robust": promise_document(design.promise),
        "step_power_limit_pct_per_degC": _finite(design.step_power_limit_pct_per_degC),
    }
    if design.margins is not None:
        document |= {name: getattr(design.margins, name) for name in ("ms", "mt", "gain_margin", "phase_margin_deg")}
    if model is not None:
        document["model"] = model_to_document(model)
    return document


def read_design(path: str | Path) -> tuple[PidDesign, FittedModel | None]:
    """Return the design of a file, and the model it was made for where the file holds it.

    Raises:
        DocumentError: a field is missing or of the wrong kind.
        OutOfRange: a value breaks the rule of its field.
    """
    document = read_document(path, SCHEMA)
    model = document.get("model")
    if isinstance(model, dict) and model.get("schema") != MODEL_SCHEMA:
        raise DocumentError(f"{path}: the model's schema is {model.get('schema')!r}; expected {MODEL_SCHEMA!r}: fit "
                            "and tune again")
    return from_document(document, where=path), None if model is None else model_from_document(model, where=path)


def from_document(document: Mapping[str, Any], *, where: str | Path = "design") -> PidDesign:
    """Return the design of a document; errors as in `read_design`."""
    integral = optional_number(document, "integral_time_s", where)
    tn = math.inf if integral is None else integral
    tv = optional_number(document, "derivative_time_s", where) or 0.0
    found = [optional_number(document, n, where) for n in ("ms", "mt", "gain_margin", "phase_margin_deg")]
    known = found[3] is not None
    past = optional_number(document, "derivative_filter", where)
    limit = optional_number(document, "step_power_limit_pct_per_degC", where)
    return PidDesign(
        gain_pct_per_degC=number(document, "gain_pct_per_degC", where),
        integral_time_s=tn,
        derivative_time_s=tv,
        sample_time_s=number(document, "sample_time_s", where),
        structure=structure_of(tn, tv),
        method=str(document.get("method", "given by hand")),
        margins=Margins(**dict(zip(("ms", "mt", "gain_margin", "phase_margin_deg"),
                                   (math.inf if v is None else v for v in found), strict=True))) if known else None,
        iae_load=optional_number(document, "iae_load", where),
        iae_setpoint=optional_number(document, "iae_setpoint", where),
        mks=optional_number(document, "mks", where),
        notes=tuple(str(note) for note in document.get("notes", ())),
        derivative_filter=0.5 if past is None else past,
        promise=read_promise(document.get("robust"), where),
        step_power_limit_pct_per_degC=math.inf if limit is None else limit,
    )


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def promise_document(promise: Promise | None) -> dict[str, Any] | None:
    """Return the promise as JSON holds it."""
    return None if promise is None else {"way": promise.way, "limits": dict(promise.limits)}


def read_promise(document: Any, where: str | Path = "design") -> Promise | None:
    """Return the promise of a document.

    Raises:
        DocumentError: no such way to be robust, or no limits.
    """
    if document is None:
        return None
    try:
        way, limits = document["way"], {str(name): float(limit) for name, limit in document["limits"].items()}
    except (KeyError, TypeError, ValueError, AttributeError) as problem:
        raise DocumentError(f"{where}: robust holds no way and limits") from problem
    if way not in ("p95", "worst") or not set(limits) <= {"ms", "mt", "mks"}:
        raise DocumentError(f"{where}: robust is {way!r} on {', '.join(limits)}; known: p95, worst on ms, mt, mks")
    return Promise(way=way, limits=limits)
