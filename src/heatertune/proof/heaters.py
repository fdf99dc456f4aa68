"""The heaters that a fit leaves possible, as a proof takes them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from heatertune.model.findings import Finding
from heatertune.model.outliers import tamed
from heatertune.model.values import FittedModel, HeaterModel
from heatertune.proof.scenario import can_hold

__all__ = ["ROOM_DEGC", "default_setpoint", "holding", "labelled", "left_out", "unreached"]

#: ambient assumed where neither the log nor the user tells it [°C]
ROOM_DEGC: Final = 20.0

_NEAR: Final = 0.02  # of the span of the readings: as near to a setpoint they are at it


def labelled(fitted: FittedModel) -> list[tuple[str, HeaterModel]]:
    """Return every candidate with its label, the one that fits best first; an unknown ambient is taken as 20 °C."""
    ranked = sorted(fitted.candidates, key=lambda c: (c.part != "", c.log != fitted.candidates[0].log, -c.fit_pct))
    return [(label, _with_ambient(model)) for label, model in replace(fitted, candidates=tuple(ranked)).heaters]


def holding(fitted: FittedModel, setpoint_degC: float) -> list[tuple[str, HeaterModel]]:
    """Return the possible heaters that can hold a setpoint with their labels; all of them where none can."""
    heaters = labelled(fitted)
    return [(label, model) for label, model in heaters
            if can_hold(model, setpoint_degC, float(model.ambient_degC or 0.0))] or heaters


def unreached(fitted: FittedModel, able: int, setpoint_degC: float) -> Iterator[Finding]:
    """Return the finding that only so many of the possible heaters can hold the setpoint, none where all can.

    A heater that cannot, though the log shows that it did, contradicts the log and counts for nothing.
    """
    unable = [model for _, model in labelled(fitted)
              if not can_hold(model, setpoint_degC, float(model.ambient_degC or 0.0))]
    possible = len(fitted.heaters)
    if able < possible and not all(_contradicts(fitted, model, setpoint_degC) for model in unable):
        yield Finding(name="setpoint-unreached",
                      told=f"{possible - able} of {possible} possible heaters cannot hold {setpoint_degC:g} °C.")


def left_out(fitted: FittedModel, able: int, setpoint_degC: float) -> Iterator[str]:
    """Return the remark on possible heaters that are left out as the log contradicts them, nothing without any."""
    possible = len(fitted.heaters)
    if able < possible and not any(unreached(fitted, able, setpoint_degC)):
        yield (f"{possible - able} of {possible} possible heaters left out: they could not hold {setpoint_degC:g} °C, "
               "which the log shows held")


def _contradicts(fitted: FittedModel, model: HeaterModel, setpoint_degC: float) -> bool:
    """Return whether a log shows that a heater, which cannot hold a setpoint, is another than the log's.

    Its ambient lies beyond the setpoint, which the readings have passed; or full power does not lead as far as the
    readings have rested for as long as all its lags and its dead time.
    """
    if fitted.residuals is None:
        return False
    sign, time = math.copysign(1.0, model.gain_degC_per_pct), fitted.residuals.time_s
    above = sign * (tamed(fitted.residuals.measured_degC) - setpoint_degC)
    near = _NEAR * float(np.ptp(above))
    if sign * (float(model.ambient_degC or 0.0) - setpoint_degC) >= 0.0:
        return float(above.min()) < -near
    lasts = model.dead_time_s + sum(model.lags_s)
    breaks = np.flatnonzero(above < -near)
    runs = zip(np.append(0, breaks + 1), np.append(breaks, len(above)), strict=True)
    return any(end - begin > 1 and time[end - 1] - time[begin] >= lasts and above[end - 1] > above[begin] - near
               for begin, end in runs)


def default_setpoint(fitted: FittedModel) -> float:
    """Return where the log says that the heater was used, else half way up (or down) on the weakest model [°C]."""
    if fitted.setpoint_degC is not None:
        return fitted.setpoint_degC
    weakest = min((model for _, model in labelled(fitted)), key=_half_way)
    return float(weakest.ambient_degC or 0.0) + 50.0 * weakest.gain_degC_per_pct


def _half_way(model: HeaterModel) -> float:
    """Return how high half power lifts a heater [°C], or how deep a cooler."""
    sign = math.copysign(1.0, model.gain_degC_per_pct)
    return sign * (float(model.ambient_degC or 0.0) + 50.0 * model.gain_degC_per_pct)


def _with_ambient(model: HeaterModel) -> HeaterModel:
    return model if model.ambient_degC is not None else replace(model, ambient_degC=ROOM_DEGC)
