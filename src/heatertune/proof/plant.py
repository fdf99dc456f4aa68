"""The heater between two switching instants: `heatertune.heater.exact` with the values of the proof.

y is the temperature [°C], behind the larger lag; x the state of the smaller lag before it, unused with one lag.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from heatertune.heater.exact import Factors, advanced, turning_time
from heatertune.heater.exact import factors as factors_of

__all__ = ["Flow", "Plant", "factors", "moved", "turn"]


class Plant(NamedTuple):
    """The heater: gain [°C/%], the larger lag, the smaller one (0: none) and dead time [s], ambient [°C]."""

    gain: float
    first: float
    second: float
    dead: float
    ambient: float


class Flow(NamedTuple):
    """The heater at an instant [s]: y and x, the target they go to [°C], the heater's power and the load [%]."""

    now: float
    y: float
    x: float
    target: float
    heat: float
    load: float


def factors(t: float, plant: Plant) -> Factors:
    """Return what `t` seconds of constant power leave, not negative."""
    return factors_of(t, plant.first, plant.second)


def moved(flow: Flow, now: float, f: Factors) -> Flow:
    """Return the heater at `now`, the power being constant since; the factors are those of the time between."""
    y, x = advanced(flow.y, flow.x, flow.target, f)
    return Flow(now, y, x, flow.target, flow.heat, flow.load)


def turn(before: Flow, after: Flow, plant: Plant) -> float:
    """Return the instant between two, the power being constant, at which y turns [s]; infinite where it does not."""
    if plant.second == 0.0 or (before.x - before.y) * (after.x - after.y) >= 0.0:
        return math.inf
    return before.now + turning_time(before.y, before.x, before.target, plant.first, plant.second)
