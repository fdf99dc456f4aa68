"""A heater that warms and cools with different time constants: gains for each face, and what one set for both costs."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from heatertune.model.values import FittedModel, HeaterModel
from heatertune.pid.values import PidDesign

__all__ = ["told_about_faces"]

#: how the law of a candidate ends that is one face of a heater with two time constants, and what the heater does then;
#: `heatertune.model.power.fit_power` writes it, `heatertune.model.power.nonlinear` finds it
_FACES: Final = {"heating": "warms", "cooling": "cools"}

Alone = Callable[[HeaterModel], tuple[PidDesign, Callable[[PidDesign], float]]]


def told_about_faces(fitted: FittedModel, design: PidDesign, alone: Alone) -> list[str]:
    """Return a sentence where a candidate has a heating and a cooling face, else none.

    Args:
        fitted: model and candidates.
        design: the one set of gains for all.
        alone: heater → its own best design under the same limits, and the cost of any design on it.
    """
    faces = {face: c.model for face in _FACES for c in fitted.candidates if c.law.endswith(f", {face}")}
    if len(faces) < len(_FACES) or not math.isfinite(design.integral_time_s):
        return []
    gains, losses = [], []
    for face, plant in faces.items():
        own, cost = alone(plant)
        tv = f", TV = {own.derivative_time_s:.4g} s" if own.derivative_time_s else ""
        gains.append(f"K = {own.gain_pct_per_degC:.4g} %/°C, TN = {own.integral_time_s:.4g} s{tv} for {face}")
        losses.append(f"{100.0 * (cost(design) / cost(own) - 1.0):.0f} % more than its own as it {_FACES[face]}")
    times = " and ".join(f"{plant.time_constant_s:.4g} s" for plant in faces.values())
    return [
        f"This heater warms and cools with different time constants ({times}). Gains scheduled by the sign of the "
        f"change would be {'; '.join(gains)}. One set for both costs {' and '.join(losses)}."
    ]
