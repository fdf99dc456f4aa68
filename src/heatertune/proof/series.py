"""What a picture of a proof needs, as plain numbers: curves of the loop and of its robustness."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from heatertune.model.values import HeaterModel
from heatertune.pid.loop.robustness import loop_response
from heatertune.pid.loop.sampled import frequencies
from heatertune.pid.values import PidDesign
from heatertune.proof.trace import Trace

__all__ = ["curve_series", "trace_series"]

Array = npt.NDArray[np.float64]

_POINTS: Final = 800


def trace_series(trace: Trace, label: str) -> dict[str, Any]:
    """Return one run as lists: temperature at even instants, power asked for, switching instants.

    The setpoint that was followed is at the instants of the power asked for, and None where it never moved.
    """
    end = float(trace.time_s[-1])
    time = np.linspace(0.0, end, _POINTS)
    return {
        "label": label,
        "setpoint_degC": trace.setpoint_degC,
        "time_s": np.round(time, 2),
        "temperature_degC": np.round(trace.temperature_at(time), 3),
        "followed_degC": np.round(trace.followed_degC, 3) if np.ptp(trace.followed_degC) > 0.0 else None,
        "asked_time_s": np.round(trace.time_s, 3),
        "asked_pct": np.round(trace.power_asked_pct, 3),
        "edge_s": np.round(trace.edge_time_s, 3),
        "edge_pct": np.where(trace.edge_on, 100.0, 0.0),
    }


def curve_series(design: PidDesign, models: Sequence[tuple[str, HeaterModel]]) -> list[dict[str, Any]]:
    """Return the Nyquist curve and |S| of a design on each model, the one with the largest peak marked as worst."""
    curves: list[dict[str, Any]] = []
    peaks: list[float] = []
    for label, model in models:
        omega = frequencies(design.sample_time_s, max(*model.lags_s, model.dead_time_s), 400)
        loop = loop_response(model, design, omega)
        near = np.abs(loop) < 6.0  # the rest lies outside every picture
        curves.append({
            "label": label,
            "omega": omega,
            "sensitivity": np.round(1.0 / np.abs(1.0 + loop), 4),
            "real": np.round(loop.real[near], 4),
            "imaginary": np.round(loop.imag[near], 4),
        })
        peaks.append(float(np.max(1.0 / np.abs(1.0 + loop))))
    return [curve | {"worst": peak == max(peaks)} for curve, peak in zip(curves, peaks, strict=True)]
