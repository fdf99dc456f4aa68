"""What of a heater a closed loop shows: its numbers, and the combinations that are known better than they."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from heatertune.model.values import HeaterModel

__all__ = ["COMBINATIONS", "FIELDS", "ultimate_period_s"]

_BISECTIONS = 60


def ultimate_period_s(plant: HeaterModel) -> float:
    """Return the period at which the heater lags by half a turn [s]; infinite where it never does.

    A proportional controller that is turned up swings at it (J. G. Ziegler and N. B. Nichols, "Optimum settings for
    automatic controllers", Trans. ASME 64 (1942) 759–768).
    """
    if plant.dead_time_s == 0.0:
        return float("inf")  # two lags alone come near half a turn and never reach it

    def turned(omega: float) -> float:
        return omega * plant.dead_time_s + sum(float(np.arctan(omega * lag)) for lag in plant.lags_s)

    low, high = 0.0, np.pi / plant.dead_time_s
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2.0
        low, high = (middle, high) if turned(middle) < np.pi else (low, middle)
    return 2.0 * np.pi / high


Measure = Callable[[HeaterModel], float]

#: field of the working model → its value for a heater
FIELDS: Final[dict[str, Measure]] = {
    "gain_degC_per_pct": lambda plant: plant.half_rule().gain_degC_per_pct,
    "time_constant_s": lambda plant: plant.half_rule().time_constant_s,
    "dead_time_s": lambda plant: plant.half_rule().dead_time_s,
    "ambient_degC": lambda plant: float(plant.ambient_degC or 0.0),
}

#: combination → its value for a heater
COMBINATIONS: Final[dict[str, Measure]] = {
    "gain_per_time_constant_degC_per_s_pct": lambda plant: plant.gain_degC_per_pct / plant.half_rule().time_constant_s,
    "effective_dead_time_s": lambda plant: plant.half_rule().dead_time_s,
    "ultimate_period_s": ultimate_period_s,
}
