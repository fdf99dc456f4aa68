"""Validation, and what each of several logs says, → their part of the JSON document that `heatertune fit` writes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from heatertune.model.intervals import Interval
from heatertune.model.judgement import Half, InputCorrelation, Validation, disagreeing
from heatertune.model.validation import LJUNG_BOX_95
from heatertune.model.values import OneLog

__all__ = ["correlation_document", "log_document", "to_document", "whiteness_document"]

_OF_LOG = ("name", "fit_pct", "alone_fit_pct", "ambient_degC", "drift_degC_per_s", "noise_degC")
_OF_HALF = ("ambient_degC", "fit_pct", "rmse_degC")


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
    beside = {name: getattr(half, name) for name in _OF_HALF}
    return {"window_s": list(half.window_s), **beside, **_parameters(half.values, half.ci95)}


def log_document(found: OneLog) -> dict[str, Any]:
    """Return what one of several logs says; `alone` holds its own values and intervals."""
    return {name: getattr(found, name) for name in _OF_LOG} | {"alone": _parameters(found.values, found.ci95)}


def _parameters(values: Mapping[str, float], ci95: Mapping[str, Interval]) -> dict[str, Any]:
    return {
        key: value for name, found in ci95.items()
        for key, value in ((name, values[name]), (f"{name}_ci95", [found.low, found.high]))
    }
