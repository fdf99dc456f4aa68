"""Validation ↔ its part of the JSON document that `heatertune fit` writes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from heatertune.model.judgement import Half, HeldOut, InputCorrelation, Validation, disagreeing
from heatertune.model.validation import LJUNG_BOX_95
from heatertune.model.values import Interval

__all__ = ["correlation_document", "from_document", "to_document", "whiteness_document"]


def to_document(found: Validation) -> dict[str, Any]:
    """Return "whiteness", "input_crosscorrelation", "held_out" and "halves"; what could not be checked is null."""
    held = found.held_out
    windows = [{"start_s": start, "end_s": end, "rmse_degC": rmse}
               for (start, end), rmse in zip(held.windows_s, held.rmses_degC, strict=True)]
    return {
        "whiteness": whiteness_document(found.ljung_box),
        "input_crosscorrelation": correlation_document(found.input_correlation),
        "held_out": {"fit_pct": held.fit_pct, "rmse_degC": held.rmse_degC, "windows": windows},
        "halves": None if found.halves is None else {
            "parts": [_half_document(half) for half in found.halves], "disagree": list(disagreeing(found.halves)),
        },
    }


def whiteness_document(ljung_box: float) -> dict[str, Any]:
    """Return the whiteness with its limit."""
    return {"ljung_box": ljung_box, "limit": LJUNG_BOX_95, "ok": ljung_box <= LJUNG_BOX_95}


def correlation_document(found: InputCorrelation | None) -> dict[str, Any] | None:
    """Return the correlation with its limit."""
    if found is None:
        return None
    return {"largest": found.largest, "at_lag_s": found.at_lag_s, "limit": found.limit, "ok": found.ok}


def _half_document(half: Half) -> dict[str, Any]:
    parameters = {
        key: value for name, found in half.ci95.items()
        for key, value in ((name, half.values[name]), (f"{name}_ci95", [found.low, found.high]))
    }
    return {"window_s": list(half.window_s), **parameters}


def from_document(document: Mapping[str, Any]) -> Validation | None:
    """Return the checks of a model document, None where it holds none.

    Raises:
        KeyError, TypeError: a field is missing or of the wrong kind.
    """
    held, seen, halves = (document.get(name) for name in ("held_out", "input_crosscorrelation", "halves"))
    if held is None:
        return None
    return Validation(
        ljung_box=float(document["whiteness"]["ljung_box"]),
        input_correlation=None if seen is None else InputCorrelation(
            **{name: float(seen[name]) for name in ("largest", "at_lag_s", "limit")}),
        held_out=HeldOut(
            fit_pct=float(held["fit_pct"]), rmse_degC=float(held["rmse_degC"]),
            windows_s=tuple((float(each["start_s"]), float(each["end_s"])) for each in held["windows"]),
            rmses_degC=tuple(float(each["rmse_degC"]) for each in held["windows"]),
        ),
        halves=None if halves is None else (_half(halves["parts"][0]), _half(halves["parts"][1])),
    )


def _half(part: Mapping[str, Any]) -> Half:
    names = [key for key in part if key != "window_s" and not key.endswith("_ci95")]
    start, end = part["window_s"]
    return Half(
        window_s=(float(start), float(end)), values={name: float(part[name]) for name in names},
        ci95={name: Interval(low=part[f"{name}_ci95"][0], high=part[f"{name}_ci95"][1]) for name in names},
    )
