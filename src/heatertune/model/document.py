"""FittedModel ↔ the JSON document that `heatertune fit` writes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from heatertune.codec import decode
from heatertune.documents import plain, read_document
from heatertune.model import judgement_document
from heatertune.model.intervals import Interval
from heatertune.model.values import Candidate, FittedModel, TwoLag
from heatertune.model.view import SCHEMA, ModelView

__all__ = ["SCHEMA", "from_document", "read_model", "to_document"]

#: what is known of the log a model was fitted to
_LOGGED = ("setpoint_degC", "log_interval_s", "least_dead_time_s", "reading_step_degC")
_FIELDS = ("gain_degC_per_pct", "time_constant_s", "dead_time_s", "ambient_degC")


def to_document(fitted: FittedModel) -> dict[str, Any]:
    """Return the document; the keys of the working FOPDT stand at its top, each with `<name>_ci95`."""
    document: dict[str, Any] = {"schema": SCHEMA}
    for name in _FIELDS:
        document[name] = getattr(fitted.model, name)
        document[f"{name}_ci95"] = _pair(fitted.ci95.get(name))
    document |= {
        "fit_pct": fitted.fit_pct,
        "outcome": fitted.outcome.name,
        "outcome_text": fitted.outcome.value,
        "method": fitted.method,
        "combinations": {
            name: {"value": value, "ci95": _pair(found)} for name, (value, found) in fitted.combinations.items()
        },
        "candidates": [_candidate_document(candidate) for candidate in fitted.candidates],
        "hypotheses": [_candidate_document(candidate) for candidate in fitted.hypotheses],
        "notes": list(fitted.notes),
        "log_told": list(fitted.log_told),
        "findings": [{"name": each.name, "effect": each.kind.effect, "told": each.told} for each in fitted.findings],
        **{name: getattr(fitted, name) for name in _LOGGED},
        "assumed": dict(fitted.assumed),
    }
    if fitted.logs:
        document["logs"] = [judgement_document.log_document(each) for each in fitted.logs]
    if fitted.validation is not None:
        document |= judgement_document.to_document(fitted.validation)
    if fitted.residuals is not None:
        document["residuals"] = {
            "time_s": fitted.residuals.time_s,
            "measured_degC": fitted.residuals.measured_degC,
            "simulated_degC": np.round(fitted.residuals.simulated_degC, 4),
            "autocorrelation": np.round(fitted.residuals.autocorrelation, 4),
        }
    return document


def read_model(path: str | Path) -> FittedModel:
    """Return the model of a file; a document that holds only the FOPDT is a model given by hand.

    Raises:
        DocumentError: a field is missing, unknown, of the wrong kind or against its rule.
    """
    return from_document(read_document(path, SCHEMA), where=path)


def from_document(document: Mapping[str, Any], *, where: str | Path = "model") -> FittedModel:
    """Return the model of a document; errors as in `read_model`."""
    return decode(ModelView, plain(document), where).value


def _candidate_document(candidate: Candidate) -> dict[str, Any]:
    plant = candidate.model
    document: dict[str, Any] = {name: getattr(plant, name) for name in _FIELDS}
    if isinstance(plant, TwoLag):
        document["second_time_constant_s"] = plant.second_time_constant_s
        from heatertune.model.reduction import matched  # noqa: PLC0415 - an optimiser; reading needs none

        for name, reduced in (("half_rule", plant.half_rule()), ("matched", matched(plant))):
            document[name] = {field: getattr(reduced, field) for field in ("time_constant_s", "dead_time_s")}
    return document | {
        "log": candidate.log,
        "window_s": candidate.window_s,
        "law": candidate.law,
        "controller": dict(candidate.controller),
        "fit_pct": candidate.fit_pct,
        "rmse_degC": candidate.rmse_degC,
        "delta_bic": candidate.delta_bic,
        "fits_pct": dict(candidate.fits_pct),
        "hold_out_rmse_degC": candidate.hold_out_rmse_degC,
        "cross_rmse_degC": candidate.cross_rmse_degC,
        "on_bound": list(candidate.on_bound),
        "part": candidate.part,
    }


def _pair(found: Interval | None) -> list[float | None] | None:
    return None if found is None else [found.low, found.high]
