"""The heaters that a fit leaves possible, as a proof takes them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Final

from heatertune.model.findings import Finding
from heatertune.model.values import FittedModel, HeaterModel
from heatertune.proof.scenario import can_hold

__all__ = ["ROOM_DEGC", "default_setpoint", "holding", "labelled", "unreached"]

#: ambient assumed where neither the log nor the user tells it [°C]
ROOM_DEGC: Final = 20.0


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
    """Return the finding that only so many of the possible heaters can hold the setpoint, none where all can."""
    possible = len(fitted.heaters)
    if able < possible:
        yield Finding(name="setpoint-unreached",
                      told=f"{possible - able} of {possible} possible heaters cannot hold {setpoint_degC:g} °C.")


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
