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
from heatertune.proof.scenario import phases_of
from heatertune.proof.trace import Trace

__all__ = ["curve_series", "trace_series"]

Array = npt.NDArray[np.float64]

_POINTS: Final = 1600
_AT_REST: Final = 0.05  # of the points that as long a time has elsewhere
_SEEN_PCT: Final = 0.2  # a smaller change of the power asked for is not seen in a picture
_MANY: Final = 4000  # scans or edges of a trace, from which on those are left out that no picture shows
_EVERY: Final = 25  # scans of which one is kept all the same, for whoever points at it
_NEAR_S: Final = (600.0, 1800.0)  # before and after the first disturbance, where many edges are kept


def trace_series(trace: Trace, label: str) -> dict[str, Any]:
    """Return one run as lists: temperature at instants that are sparse at rest, power asked for, switching instants.

    The setpoint that was followed is at the instants of the power asked for, and None where it never moved.
    """
    time, asked, edges = _instants(trace), _changing(trace), _edges(trace)
    return {
        "label": label,
        "setpoint_degC": trace.setpoint_degC,
        "time_s": np.round(time, 2),
        "temperature_degC": np.round(trace.temperature_at(time), 3),
        "followed_degC": np.round(trace.followed_degC[asked], 3) if np.ptp(trace.followed_degC) > 0.0 else None,
        "request_time_s": np.round(trace.time_s[asked], 3),
        "request_pct": np.round(trace.power_asked_pct[asked], 3),
        "edge_s": np.round(trace.edge_time_s[edges], 3),
        "edge_pct": trace.edge_pct[edges],
    }


def _instants(trace: Trace) -> Array:
    """Return the instants of a picture, from 0 to the end [s], shape (n,)."""
    end = float(trace.time_s[-1])
    phases = phases_of(trace.scenario, end, end)
    ends = np.array([0.0, *(instant for phase in phases for instant in (phase.rest_s, phase.end_s))])
    weights = np.tile([1.0, _AT_REST], len(phases))
    weighed = np.concatenate([[0.0], np.cumsum(weights * np.diff(ends))])
    return np.asarray(np.interp(np.linspace(0.0, weighed[-1], _POINTS), weighed, ends))


def _changing(trace: Trace) -> npt.NDArray[np.intp]:
    """Return the numbers of the scans that change something that can be seen, the first and the last one included."""
    if len(trace.time_s) <= _MANY:
        return np.arange(len(trace.time_s))
    power, followed = trace.power_asked_pct.tolist(), trace.followed_degC.tolist()
    kept, last = [0], (power[0], followed[0])
    for scan, now in enumerate(zip(power, followed, strict=True)):
        if abs(now[0] - last[0]) > _SEEN_PCT or now[1] != last[1]:
            kept.append(scan)
            last = now
    return np.unique([*kept, *range(0, len(power), _EVERY), len(power) - 1])


def _edges(trace: Trace) -> npt.NDArray[np.intp]:
    """Return the numbers of the edges that a picture shows, where there are many those about the first disturbance."""
    if len(trace.edge_time_s) <= _MANY or not trace.scenario.disturbances:
        return np.arange(len(trace.edge_time_s))
    since = trace.edge_time_s - trace.scenario.disturbances[0].time_s
    return np.flatnonzero((since >= -_NEAR_S[0]) & (since <= _NEAR_S[1]))


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
