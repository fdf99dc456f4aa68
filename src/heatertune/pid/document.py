"""PidDesign ↔ the JSON document that `heatertune tune` writes, the model it was made for included."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from heatertune.codec import OrInfinite, decode, registered
from heatertune.documents import plain, read_document
from heatertune.errors import DocumentError
from heatertune.model.document import SCHEMA as MODEL_SCHEMA
from heatertune.model.document import to_document as model_to_document
from heatertune.model.values import FittedModel
from heatertune.model.view import ModelView
from heatertune.pid.values import Margins, PidDesign, Promise, structure_of

__all__ = ["SCHEMA", "PidView", "from_document", "promise_document", "read_design", "read_promise", "to_document"]

SCHEMA = "heatertune/pid/1"


@dataclass(frozen=True, slots=True, kw_only=True)
class PromiseView:
    """What a design keeps on the heaters drawn from a fit."""

    way: Literal["p95", "worst"]
    limits: Mapping[str, float]

    def __post_init__(self) -> None:
        for name in self.limits:
            if name not in ("ms", "mt", "mks"):
                raise DocumentError(f"limits.{name}: no such limit; known: ms, mt, mks")

    @property
    def value(self) -> Promise:
        """The promise."""
        return Promise(way=self.way, limits=self.limits)


@registered(SCHEMA)
@dataclass(frozen=True, slots=True, kw_only=True)
class PidView:
    """The document of a design; of the margins null says infinite, but for the phase margin: none were computed."""

    gain_pct_per_degC: float
    integral_time_s: OrInfinite = math.inf
    derivative_time_s: float | None = None
    sample_time_s: float
    derivative_filter: float | None = None
    structure: str = ""
    method: str = "given by hand"
    ms: OrInfinite = math.inf
    mt: OrInfinite = math.inf
    gain_margin: OrInfinite = math.inf
    phase_margin_deg: float | None = None
    iae_load: float | None = None
    iae_setpoint: float | None = None
    mks: float | None = None
    notes: tuple[str, ...] = ()
    robust: PromiseView | None = None
    step_power_limit_pct_per_degC: OrInfinite = math.inf
    model: ModelView | None = None
    forms: Any = None
    alternatives: Any = None

    def __post_init__(self) -> None:
        if self.structure not in ("", self.value.structure):
            raise DocumentError(f"structure: {self.structure!r}; TN and TV make it {self.value.structure!r}")

    @property
    def value(self) -> PidDesign:
        """The design."""
        tn, tv, phase = self.integral_time_s, self.derivative_time_s or 0.0, self.phase_margin_deg
        return PidDesign(
            gain_pct_per_degC=self.gain_pct_per_degC, integral_time_s=tn, derivative_time_s=tv,
            sample_time_s=self.sample_time_s, structure=structure_of(tn, tv), method=self.method,
            margins=None if phase is None else Margins(
                ms=self.ms, mt=self.mt, gain_margin=self.gain_margin, phase_margin_deg=phase),
            iae_load=self.iae_load, iae_setpoint=self.iae_setpoint, mks=self.mks, notes=self.notes,
            derivative_filter=0.5 if self.derivative_filter is None else self.derivative_filter,
            promise=None if self.robust is None else self.robust.value,
            step_power_limit_pct_per_degC=self.step_power_limit_pct_per_degC)


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
        DocumentError: a field is missing, unknown, of the wrong kind or against its rule.
    """
    document = read_document(path, SCHEMA)
    model = document.get("model")
    if isinstance(model, dict) and model.get("schema") != MODEL_SCHEMA:
        raise DocumentError(f"{path}: the model's schema is {model.get('schema')!r}; expected {MODEL_SCHEMA!r}: fit "
                            "and tune again")
    view = decode(PidView, document, path)
    return view.value, None if view.model is None else view.model.value


def from_document(document: Mapping[str, Any], *, where: str | Path = "design") -> PidDesign:
    """Return the design of a document; errors as in `read_design`."""
    return decode(PidView, plain(document), where).value


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
    return None if document is None else decode(PromiseView, plain(document), where, "robust").value
