"""The switch's edges under way to the heater: a ring of the instants at which it is switched, on and off in turn.

An instant at which the cooler of a heater that has one is switched on, in place of the heater, has a minus sign, also
that at 0. Plain functions of numbers, as in `heatertune.proof.kernel`.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from heatertune.plc.pwm import Switches, on_time
from heatertune.proof.meter import Places

__all__ = ["AS_TOLD", "as_strong", "edge_at", "heat_after", "period_of", "switched_off", "times_on"]

#: by what the power of coolers is multiplied that are as strong as the switch says
AS_TOLD: Final = np.ones(1)


def as_strong(pwm: Switches, share: float) -> Switches:
    """Return a switch whose cooler is so many times as strong."""
    return Switches(pwm.heat, pwm.cool, share * pwm.cooling)


def edge_at(edges: Places, number: int) -> float:
    """Return the instant of an edge [s]."""
    return float(abs(edges[number & (len(edges) - 1)]))


def heat_after(edges: Places, number: int, cooling: float) -> float:
    """Return the power after an edge [% of the heater's full power], below 0 where the cooler is on.

    Args:
        edges: the ring.
        number: of the edge; edges alternate, so it tells whether something is switched on.
        cooling: `Switches.cooling`.
    """
    if number % 2 == 1:
        return 0.0
    return -100.0 * cooling if _cools(edges, number) else 100.0


def period_of(
    edges: Places, switched: int, begin: float, power: float, owed: tuple[float, float], pwm: Switches, cut: float
) -> tuple[int, tuple[float, float]]:
    """Switch for one period; return how often was switched so far, and what heater and cooler owe [s].

    The one that is not asked for stays off, and what it owes is too little for a pulse.

    Args:
        edges: the ring.
        switched: how often was switched so far.
        begin: of the period [s].
        power: asked for, −100…100 %, below 0 of the cooler.
        owed: by heater and cooler [s].
        pwm: of both.
        cut: instant from which on an interlock keeps the heater off [s].
    """
    if power < 0.0 and pwm.cooling > 0.0:
        on, cool = on_time(-power, owed[1], pwm.cool)
        return _pulse(edges, switched, begin, on, pwm.heat[0], True), (owed[0], cool)
    on, heat = on_time(max(power, 0.0), owed[0], pwm.heat)
    left = max(cut - begin, 0.0) if _cools(edges, switched - 1) else cut - begin  # a pulse that runs ends at the cut
    return _pulse(edges, switched, begin, min(on, left), pwm.heat[0], False), (heat, owed[1])


def _cools(edges: Places, number: int) -> bool:
    """Return whether an edge switches the cooler on."""
    return number >= 0 and number % 2 == 0 and math.copysign(1.0, edges[number & (len(edges) - 1)]) < 0.0


def _pulse(edges: Places, switched: int, begin: float, on: float, period: float, cools: bool) -> int:
    """Switch for one period, where it is not in that state already; return how often it was switched so far."""
    last = len(edges) - 1
    if on > 0.0 and switched % 2 == 1 and _cools(edges, switched - 1) != cools:
        edges[switched & last] = begin
        switched += 1
    if on > 0.0 and switched % 2 == 0:
        edges[switched & last] = -begin if cools else begin
        switched += 1
    if on < period and switched % 2 == 1:
        edges[switched & last] = begin + on
        switched += 1
    return switched


def switched_off(edges: Places, switched: int, now: float) -> int:
    """Take back what is left of a pulse, without supply; return how often was switched so far."""
    last = len(edges) - 1
    if switched % 2 == 1:
        edges[switched & last] = now
        return switched + 1
    if switched > 0 and edges[switched - 1 & last] > now:
        edges[switched - 1 & last] = now
    return switched


def times_on(edges: Places, switched: int, end: float) -> int:
    """Return how often something was switched on until an instant."""
    times = (switched + 1) // 2
    while times > 0 and edge_at(edges, 2 * (times - 1)) > end:
        times -= 1
    return times
