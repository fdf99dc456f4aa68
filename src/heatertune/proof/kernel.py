"""The closed loop, event by event: scans, PWM edges and disturbances, each at its exact instant.

Plain numbers and lists, so that a compiler could take the function as it is.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from heapq import heapify, heappop, heappush
from typing import Final

from heatertune.proof.plant import advance
from heatertune.proof.pwm import INSTANT_S, on_time

__all__ = ["HEAT", "JUMP", "LOAD", "Event", "run"]

#: what an event does to the plant: all lags jump, the load grows, the heater is switched
JUMP: Final = 0
LOAD: Final = 1
HEAT: Final = 2

Event = tuple[float, int, float]


def run(
    step: Callable[[float, float, bool], float], measure: Callable[[float], float],
    plant: tuple[float, float, float, float, float], start: float, scan_s: float,
    setpoints: Sequence[float], noise: Sequence[float], disturbances: Sequence[Event],
    pwm: tuple[float, float, float, float, bool], cut: float = math.inf,
) -> tuple[list[tuple[float, float, float]], list[float], list[tuple[float, float, float, float]]]:
    """Run the loop for as many scans as there are noise values; scans and PWM periods both begin at 0.

    The power asked for last when a PWM period begins holds for that period; at equal instants the scan is first.

    Args:
        step: (setpoint, reading, whether a PWM period has begun since the scan before or begins now) → power asked
            for [%].
        measure: temperature → reading.
        plant: gain [°C/%], larger lag, smaller lag (0: none), dead time [s], ambient [°C].
        start: temperature of all lags at 0 [°C].
        scan_s: [s].
        setpoints: of each scan, in the controller's units.
        noise: added to the temperature before it is measured [°C].
        disturbances: (instant at which it acts [s], JUMP or LOAD, °C or %).
        pwm: `Actuator.numbers`.
        cut: instant from which on an interlock keeps the heater off [s].

    Returns:
        (temperature, reading, power asked for) of each scan; the instants at which the heater is switched, on and
        off in turn; and for each stretch of constant power (instant from which it acts, temperature, inner state
        and target at that instant).
    """
    gain, first, second, dead, ambient = plant
    period = pwm[0]
    y = x = start
    now = heat = load = carried = 0.0
    target = ambient
    begun = 0
    pending: list[Event] = [*disturbances, (math.inf, HEAT, 0.0)]
    heapify(pending)
    samples: list[tuple[float, float, float]] = []
    edges: list[float] = []
    stretches = [(0.0, y, x, target)]
    for k in range(len(noise)):
        t = k * scan_s
        while pending[0][0] <= t:
            due, kind, value = heappop(pending)
            y, x = advance(y, x, target, due - now, first, second)
            now = due
            if kind == JUMP:
                y, x = y + value, x + value
            elif kind == LOAD:
                load += value
            else:
                heat = value
            target = ambient + gain * (heat + load)
            stretches.append((now, y, x, target))
        y, x = advance(y, x, target, t - now, first, second)
        now = t
        reading = measure(y + noise[k])
        latest = math.floor((t + INSTANT_S) / period) * period
        power = step(setpoints[k], reading, latest > t - scan_s + INSTANT_S)
        samples.append((y, reading, power))
        while begun * period < t + scan_s - INSTANT_S:
            on, carried = on_time(power, carried, pwm)
            _pulse(begun * period, min(on, cut - begun * period), period, dead, edges, pending)
            begun += 1
    return samples, edges, stretches


def _pulse(begin: float, on: float, period: float, dead: float, edges: list[float], pending: list[Event]) -> None:
    """Switch for one period, where the heater is not in that state already."""
    for hot, wanted, at in ((True, on > 0.0, begin), (False, on < period, begin + on)):
        if wanted and len(edges) % 2 != hot:  # edges alternate, so their number tells whether it is hot
            edges.append(at)
            heappush(pending, (at + dead, HEAT, 100.0 if hot else 0.0))
