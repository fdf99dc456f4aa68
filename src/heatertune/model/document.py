"""FittedModel ↔ the JSON document that `heatertune fit` writes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from heatertune.documents import number, optional_number, read_document
from heatertune.errors import DocumentError
from heatertune.model import judgement_document
from heatertune.model.by_hand import model_by_hand
from heatertune.model.findings import Finding
from heatertune.model.intervals import Interval
from heatertune.model.values import Candidate, FittedModel, Fopdt, HeaterModel, Outcome, Residuals, TwoLag

__all__ = ["SCHEMA", "from_document", "read_model", "to_document"]

#: those of the first held no ends of intervals and no findings
SCHEMA = "heatertune/model/2"

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
        DocumentError: a field is missing or of the wrong kind.
        OutOfRange: a value breaks the rule of its field.
    """
    return from_document(read_document(path, SCHEMA), where=path)


def from_document(document: Mapping[str, Any], *, where: str | Path = "model") -> FittedModel:
    """Return the model of a document; errors as in `read_model`."""
    model = _plant(document, where)
    if not document.get("candidates"):
        return model_by_hand(model)
    assert isinstance(model, Fopdt)
    try:
        return FittedModel(
            model=model,
            outcome=Outcome[document["outcome"]],
            method=str(document["method"]),
            ci95={name: _interval(document.get(f"{name}_ci95")) for name in _FIELDS},
            combinations={
                name: (float(item["value"]), _interval(item["ci95"]) or Interval(low=None, high=None))
                for name, item in document.get("combinations", {}).items()
            },
            candidates=tuple(_candidate(item, where) for item in document["candidates"]),
            hypotheses=tuple(_candidate(item, where) for item in document.get("hypotheses", ())),
            fit_pct=optional_number(document, "fit_pct", where),
            notes=tuple(str(note) for note in document.get("notes", ())),
            residuals=_residuals(document.get("residuals")),
            validation=judgement_document.from_document(document),
            logs=tuple(judgement_document.one_log(each) for each in document.get("logs", ())),
            log_told=tuple(str(line) for line in document.get("log_told", ())),
            findings=tuple(Finding(name=str(each["name"]), told=str(each["told"]))
                           for each in document.get("findings", ())),
            setpoint_degC=optional_number(document, "setpoint_degC", where),
            assumed={str(name): float(value) for name, value in document.get("assumed", {}).items()},
            **{name: optional_number(document, name, where) or 0.0 for name in _LOGGED if name != "setpoint_degC"},
        )
    except (KeyError, TypeError, AttributeError) as problem:
        raise DocumentError(f"{where}: {problem} is missing or of the wrong kind") from problem


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


def _candidate(document: Mapping[str, Any], where: str | Path) -> Candidate:
    def known(field: str) -> float:
        value = optional_number(document, field, where)
        return math.nan if value is None else value

    return Candidate(
        model=_plant(document, where),
        log=str(document["log"]),
        window_s=(float(document["window_s"][0]), float(document["window_s"][1])),
        law=str(document["law"]),
        controller={str(k): float(v) for k, v in document.get("controller", {}).items()},
        fits_pct={str(k): float(v) for k, v in document.get("fits_pct", {}).items()},
        hold_out_rmse_degC=optional_number(document, "hold_out_rmse_degC", where),
        cross_rmse_degC=optional_number(document, "cross_rmse_degC", where),
        on_bound=tuple(str(name) for name in document.get("on_bound", ())),
        part=str(document.get("part", "")),
        fit_pct=known("fit_pct"),
        rmse_degC=known("rmse_degC"),
        delta_bic=known("delta_bic"),
    )


def _plant(document: Mapping[str, Any], where: str | Path) -> HeaterModel:
    settings = {name: number(document, name, where) for name in _FIELDS[:3]}
    ambient = optional_number(document, "ambient_degC", where)
    second = optional_number(document, "second_time_constant_s", where)
    if second is None:
        return Fopdt(**settings, ambient_degC=ambient)
    return TwoLag(**settings, second_time_constant_s=second, ambient_degC=ambient)


def _pair(found: Interval | None) -> list[float | None] | None:
    return None if found is None else [found.low, found.high]


def _interval(pair: Any) -> Interval | None:
    return None if pair is None else Interval(low=pair[0], high=pair[1])


def _residuals(document: Any) -> Residuals | None:
    if document is None:
        return None
    return Residuals(**{name: np.array(values, dtype=np.float64) for name, values in document.items()})
