"""Verdict → the JSON document that `heatertune validate` writes."""

from __future__ import annotations

from typing import Any

from heatertune.codec import encode
from heatertune.model.document import CorrelationView, WhitenessView
from heatertune.model.validate import Run, Verdict

__all__ = ["SCHEMA", "to_document"]

SCHEMA = "heatertune/validation/1"


def to_document(verdict: Verdict, least_fit_pct: float) -> dict[str, Any]:
    """Return the document: the verdict, its criteria with their limits, and every model's run."""
    worst = verdict.runs[verdict.worst]
    return {
        "schema": SCHEMA,
        "log": verdict.log,
        "verdict": "FAIL" if verdict.fails else "PASS",
        "fails": list(verdict.fails),
        "worst": worst.label,
        "criteria": {
            "fit": {"value": worst.fit_pct, "limit": least_fit_pct, "unit": "%", "ok": "fit" not in verdict.fails},
            "bias": {"value": verdict.bias_degC, "limit": verdict.most_bias_degC, "unit": "°C",
                     "ok": "bias" not in verdict.fails},
        },
        "runs": [_run_document(run) for run in verdict.runs],
        "notes": list(verdict.notes),
    }


def _run_document(run: Run) -> dict[str, Any]:
    names = ("label", "ambient_degC", "fit_pct", "bias_degC", "rmse_degC", "free_fit_pct", "free_ambient_degC")
    return {name: getattr(run, name) for name in names} | {
        "whiteness": encode(WhitenessView.of(run.ljung_box)),
        "input_crosscorrelation": encode(CorrelationView.of(run.input_correlation)),
    }
