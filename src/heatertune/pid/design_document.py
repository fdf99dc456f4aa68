"""PidDesign ↔ the JSON document of `heatertune tune`, including the model it was designed for.

Also the provenance of a design that its gains do not contain: controller, changes to other settings, conditions.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from heatertune.codec import (
    LEFT_OUT,
    Document,
    OrInfinite,
    construct_from,
    decode,
    encode,
    plain,
    read_document,
    register_schema,
)
from heatertune.errors import DocumentError
from heatertune.model.model_document import SCHEMA as MODEL_SCHEMA
from heatertune.model.model_document import ModelView
from heatertune.model.model_values import FittedModel
from heatertune.pid.design_values import Margins, PidDesign, Promise, structure_of
from heatertune.settings import Conditions, SensorSettings, WordSettings
from heatertune.units import check

__all__ = [
    "SCHEMA", "BoostView", "DesignProvenance", "PidView", "RampView", "from_document", "parts_of", "promise_document",
    "read_design", "to_document",
]


@dataclass(frozen=True, slots=True, kw_only=True)
class RampView:
    """The setpoint ramp; hold: largest distance of the setpoint from the reading, null: unlimited."""

    step: int | float
    calls: int
    hold: int | float | None
    hold_degC: float | None
    degC_per_min: float


@dataclass(frozen=True, slots=True, kw_only=True)
class BoostView:
    """Full power until one distance from the setpoint, and again beyond another."""

    within_degC: float
    again_degC: float


@dataclass(frozen=True, slots=True, kw_only=True)
class DesignProvenance:
    """How the controller parameters were derived from a design, and the conditions of their proof.

    Attributes:
        target: the controller.
        range_degC: of the sensor, at its lowest and highest reading [°C].
        input: range of the analog module; None: the standard one.
        words_by, refined: see `heatertune.settings.WordSettings`.
        power_most_pct: output limit [%]; None: no limit.
        window_degC: distance from the setpoint at which a firmware hands over to the PID [°C]; None: as it is built.
        setpoint_ramp: None: the setpoint steps.
        boost: None: the PID always controls the heater.
        conditions: of the proof.
        files: "spec" and "profile" → digest of the request in that file, if there is one.
        way_on: remedy found for failing parameters when they were calculated, or that no tried change passes.

    Raises:
        OutOfRange, UnknownName: invalid values of the options of these names.
    """

    target: str
    range_degC: tuple[float, float] = (0.0, 100.0)
    input: str | None = field(default=None, metadata=LEFT_OUT)
    words_by: str = "auto"
    refined: bool = False
    power_most_pct: float | None = None
    window_degC: float | None = field(default=None, metadata=LEFT_OUT)
    setpoint_ramp: RampView | None = None
    boost: BoostView | None = field(default=None, metadata=LEFT_OUT)
    conditions: Conditions
    files: Mapping[str, str] = field(default_factory=dict)
    way_on: str | None = field(default=None, metadata=LEFT_OUT)

    def __post_init__(self) -> None:
        SensorSettings(range_degC=self.range_degC, input=self.input)
        WordSettings(words_by=self.words_by, refined=self.refined)
        if self.power_most_pct is not None:
            check("power_most_pct", self.power_most_pct, above=0.0, most=100.0)
        if self.window_degC is not None:
            check("window_degC", self.window_degC, above=0.0)


SCHEMA = "heatertune/pid/2"


@dataclass(frozen=True, slots=True, kw_only=True)
class PromiseView:
    """The limits that a design keeps on heaters sampled from a fit."""

    way: Literal["p95", "worst"]
    limits: Mapping[str, float]

    def __post_init__(self) -> None:
        if not self.limits:
            raise DocumentError("limits: none; expected one or more of ms, mt, mks")
        for name, limit in self.limits.items():
            if name not in ("ms", "mt", "mks"):
                raise DocumentError(f"limits.{name}: no such limit; known: ms, mt, mks")
            if not limit > 0.0:
                raise DocumentError(f"limits.{name}: {limit!r}; expected a number > 0")

    @property
    def value(self) -> Promise:
        """The promise."""
        return construct_from(Promise, self)


@register_schema(SCHEMA)
@dataclass(frozen=True, slots=True, kw_only=True)
class PidView:
    """The document of a design; null means infinite for a margin, and not computed for the phase margin."""

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
    made_for: DesignProvenance | None = field(default=None, metadata=LEFT_OUT)
    model: ModelView | None = field(default=None, metadata=LEFT_OUT)
    forms: Any = field(default=None, metadata=LEFT_OUT)
    alternatives: Any = field(default=None, metadata=LEFT_OUT)

    def __post_init__(self) -> None:
        if self.structure not in ("", self.value.structure):
            raise DocumentError(f"structure: {self.structure!r}; TN and TV make it {self.value.structure!r}")

    @classmethod
    def of(cls, design: PidDesign, model: FittedModel | None = None, recipe: DesignProvenance | None = None) -> PidView:
        """Return the document of a design, its model, and the proven parameters."""
        return construct_from(
            cls, design, design.margins,
            robust=None if design.promise is None else construct_from(PromiseView, design.promise),
            made_for=recipe, model=None if model is None else ModelView.of(model))

    @property
    def value(self) -> PidDesign:
        """The design."""
        tv = self.derivative_time_s or 0.0
        return construct_from(
            PidDesign, self, derivative_time_s=tv, structure=structure_of(self.integral_time_s, tv),
            margins=None if self.phase_margin_deg is None else construct_from(Margins, self),
            derivative_filter=0.5 if self.derivative_filter is None else self.derivative_filter,
            promise=None if self.robust is None else self.robust.value)


def to_document(
    design: PidDesign, model: FittedModel | None = None, recipe: DesignProvenance | None = None
) -> dict[str, Any]:
    """Return the document; an integral time that is infinite is null."""
    document: dict[str, Any] = encode(PidView.of(design, model, recipe))
    return document


def read_design(path: str | Path) -> tuple[PidDesign, FittedModel | None, DesignProvenance | None]:
    """Return the design of a file, the model it was made for and the recipe of its words, where the file holds them.

    Raises:
        DocumentError: a field is missing, unknown, of the wrong kind or against its rule.
    """
    document = read_document(path, SCHEMA)
    model = document.get("model")
    if isinstance(model, dict) and model.get("schema") != MODEL_SCHEMA:
        raise DocumentError(f"{path}: the model's schema is {model.get('schema')!r}; expected {MODEL_SCHEMA!r}: fit "
                            "and tune again")
    view = decode(PidView, document, path)
    return view.value, None if view.model is None else view.model.value, view.made_for


def from_document(document: Document, *, where: str | Path = "design") -> PidDesign:
    """Return the design of a document; errors as in `read_design`."""
    return parts_of(document, where=where)[0]


def parts_of(document: Document, *, where: str | Path = "design") -> tuple[PidDesign, DesignProvenance | None]:
    """Return the design of a document, and the recipe of its words where it holds one; errors as in `read_design`."""
    view = decode(PidView, plain(document), where)
    return view.value, view.made_for


def promise_document(promise: Promise | None) -> dict[str, Any] | None:
    """Return the promise as JSON holds it."""
    return None if promise is None else encode(construct_from(PromiseView, promise))
