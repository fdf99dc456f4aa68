"""Verdict → the JSON document that `heatertune validate` writes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from heatertune.codec import construct_from, encode, register_schema
from heatertune.model.document import CorrelationView, WhitenessView
from heatertune.model.validate import Verdict

__all__ = ["VerdictView", "to_document"]


@dataclass(frozen=True, slots=True, kw_only=True)
class _CriterionDocument:
    value: float
    limit: float
    unit: str
    ok: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class _Criteria:
    fit: _CriterionDocument
    bias: _CriterionDocument


@dataclass(frozen=True, slots=True, kw_only=True)
class _Run:
    label: str
    ambient_degC: float
    fit_pct: float
    bias_degC: float
    rmse_degC: float
    free_fit_pct: float
    free_ambient_degC: float
    whiteness: WhitenessView
    input_crosscorrelation: CorrelationView | None


@register_schema("heatertune/validation/1")
@dataclass(frozen=True, slots=True, kw_only=True)
class VerdictView:
    """What is written of a verdict: the criteria with their limits, and every model's run."""

    log: str
    verdict: Literal["PASS", "FAIL"]
    fails: tuple[str, ...]
    worst: str
    criteria: _Criteria
    runs: tuple[_Run, ...]
    notes: tuple[str, ...]


def to_document(verdict: Verdict) -> dict[str, Any]:
    """Return the document of a verdict."""
    worst = verdict.runs[verdict.worst]
    runs = tuple(construct_from(
        _Run, run, whiteness=WhitenessView.of(run.ljung_box),
        input_crosscorrelation=CorrelationView.of(run.input_correlation)) for run in verdict.runs)
    document: dict[str, Any] = encode(construct_from(
        VerdictView, verdict, verdict="FAIL" if verdict.fails else "PASS", worst=worst.label, runs=runs,
        criteria=_Criteria(
            fit=_CriterionDocument(value=worst.fit_pct, limit=verdict.least_fit_pct, unit="%",
                                   ok="fit" not in verdict.fails),
            bias=_CriterionDocument(value=verdict.bias_degC, limit=verdict.most_bias_degC, unit="°C",
                            ok="bias" not in verdict.fails))))
    return document
