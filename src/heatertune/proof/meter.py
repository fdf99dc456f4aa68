"""What a loop is judged by, measured while it runs, so that no trace need be kept.

The same numbers as `judge` takes from a trace: at every instant at which the temperature may turn (scan, change of
power, jump, and with two lags the turn itself) the error is one point; between two points it counts as straight.
A phase lasts from the start, or a disturbance, to the next one, or the end; the rest is the last part of the first.
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np

__all__ = [
    "ABSOLUTE", "COLUMNS", "FAULTS", "HIGHEST", "LIMITED", "LOWEST", "MEAN", "REST_HIGHEST", "REST_LOWEST", "SETTLED",
    "SWITCHINGS", "TOTALS", "Meter", "Places", "Rest", "Seen", "begin", "close", "no_meter", "point", "rest_begins",
    "rest_point",
]

#: places for numbers: an array where the loop is compiled, a list in plain Python
Places: TypeAlias = Any

#: columns of `Meter.phases`: largest and smallest error, ∫|error|, instant from which the error stays in the band
HIGHEST: Final = 0
LOWEST: Final = 1
ABSOLUTE: Final = 2
SETTLED: Final = 3
COLUMNS: Final = 4

#: places of `Meter.totals`: ∫error at rest, largest and smallest error there, scans at a power limit, scans times
#: flags that mean a wrong result, how often the heater was switched on
MEAN: Final = 0
REST_HIGHEST: Final = 1
REST_LOWEST: Final = 2
LIMITED: Final = 3
FAULTS: Final = 4
SWITCHINGS: Final = 5
TOTALS: Final = 6


class Meter(NamedTuple):
    """What is measured, and places for what is found.

    Attributes:
        measures: whether anything is.
        setpoint, band: the error's origin and how far from it is still right [°C].
        period: PWM period [s].
        wrong: flags that mean a wrong result, as bits.
        phases: `COLUMNS` numbers for each phase, one after the other.
        totals: `TOTALS` numbers.
        high, low: largest and smallest error in each PWM period at rest.
    """

    measures: bool
    setpoint: float
    band: float
    period: float
    wrong: int
    phases: Places
    totals: Places
    high: Places
    low: Places


class Seen(NamedTuple):
    """One phase so far: its number, the last point, extremes, ∫|error|, and whether and since when it has settled."""

    phase: int
    time: float
    error: float
    highest: float
    lowest: float
    absolute: float
    outside: bool
    settled: float


class Rest(NamedTuple):
    """The time at rest so far: whether it lasts, its start, the last point, ∫error, extremes."""

    lasts: bool
    start: float
    time: float
    error: float
    integral: float
    highest: float
    lowest: float


def no_meter(loops: int = 1) -> Meter:
    """Return a meter that measures nothing of any number of loops."""
    nothing = np.empty((loops, 0))
    return Meter(False, 0.0, 0.0, 0.0, 0, nothing, nothing, nothing, nothing)


def begin(phase: int, time: float, error: float, band: float) -> Seen:
    """Return a phase at its first point."""
    return Seen(phase, time, error, error, error, 0.0, abs(error) > band, time)


def point(seen: Seen, time: float, error: float, band: float) -> Seen:
    """Return the phase after one more point."""
    outside = abs(error) > band
    settled = seen.settled
    if seen.outside and not outside:
        edge = math.copysign(band, seen.error)
        settled = seen.time + (seen.error - edge) / (seen.error - error) * (time - seen.time)
    return Seen(
        seen.phase, time, error, max(seen.highest, error), min(seen.lowest, error),
        seen.absolute + (time - seen.time) * (abs(error) + abs(seen.error)) / 2.0, outside, settled,
    )


def close(meter: Meter, seen: Seen, rest: Rest) -> Rest:
    """Write down a phase that ends, and the rest with it."""
    place = seen.phase * COLUMNS
    meter.phases[place + HIGHEST] = seen.highest
    meter.phases[place + LOWEST] = seen.lowest
    meter.phases[place + ABSOLUTE] = seen.absolute
    meter.phases[place + SETTLED] = math.inf if seen.outside else seen.settled
    if rest.lasts:
        meter.totals[MEAN] = rest.integral
        meter.totals[REST_HIGHEST] = rest.highest
        meter.totals[REST_LOWEST] = rest.lowest
    return Rest(False, rest.start, rest.time, rest.error, rest.integral, rest.highest, rest.lowest)


def rest_begins(meter: Meter, time: float, error: float) -> Rest:
    """Return the rest at its first point."""
    for number in range(len(meter.high)):
        meter.high[number] = -math.inf
        meter.low[number] = math.inf
    return rest_point(meter, Rest(True, time, time, error, 0.0, error, error), time, error)


def rest_point(meter: Meter, rest: Rest, time: float, error: float) -> Rest:
    """Return the rest after one more point."""
    number = min(int((time - rest.start) / meter.period), len(meter.high) - 1)
    meter.high[number] = max(meter.high[number], error)
    meter.low[number] = min(meter.low[number], error)
    return Rest(
        rest.lasts, rest.start, time, error, rest.integral + (time - rest.time) * (error + rest.error) / 2.0,
        max(rest.highest, error), min(rest.lowest, error),
    )
