"""What a loop is judged by, measured while it runs, so that no trace need be kept.

The same numbers as `judge` takes from a trace. Between two instants at which the temperature may turn (scan, change of
power, jump, and with two lags the turn itself) it only rises or only falls: there integrals, and the instants at which
it crosses the setpoint or an edge of the band, are those of the heater's own answer, not of a line between two points.
A phase lasts from the start, or a disturbance, to the next one, or the end; the rest is the last part of the first.
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np

from heatertune.proof.plant import Flow, Plant, area, reached

__all__ = [
    "ABSOLUTE", "COLUMNS", "FAULTS", "HIGHEST", "LIMITED", "LOWEST", "MEAN", "REST_HIGHEST", "REST_LOWEST", "SETTLED",
    "SWITCHINGS", "TOTALS", "Meter", "Places", "Rest", "Seen", "begin", "close", "no_meter", "rest_begins", "rested",
    "seen_on",
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
#: flags that mean a wrong result (a power that is no number counts as one), how often the heater was switched on
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
    """One phase so far: its number, extremes, ∫|error|, and whether it is outside the band, else since when not."""

    phase: int
    highest: float
    lowest: float
    absolute: float
    outside: bool
    settled: float


class Rest(NamedTuple):
    """The time at rest so far: whether it lasts, its start, ∫error, extremes."""

    lasts: bool
    start: float
    integral: float
    highest: float
    lowest: float


def no_meter(loops: int = 1) -> Meter:
    """Return a meter that measures nothing of any number of loops."""
    nothing = np.empty((loops, 0))
    return Meter(False, 0.0, 0.0, 0.0, 0, nothing, nothing, nothing, nothing)


def begin(phase: int, time: float, error: float, band: float) -> Seen:
    """Return a phase at its first instant."""
    return Seen(phase, error, error, 0.0, abs(error) > band, time)


def seen_on(meter: Meter, seen: Seen, plant: Plant, before: Flow, after: Flow) -> Seen:
    """Return the phase after a stretch on which the temperature does not turn."""
    error, later = before.y - meter.setpoint, after.y - meter.setpoint
    outside, settled = abs(later) > meter.band, seen.settled
    if seen.outside and not outside:
        edge = meter.setpoint + math.copysign(meter.band, error)
        settled = reached(before, after, edge, plant).now
    return Seen(
        seen.phase, max(seen.highest, later), min(seen.lowest, later),
        seen.absolute + _absolute(meter, plant, before, after), outside, settled,
    )


def _absolute(meter: Meter, plant: Plant, before: Flow, after: Flow) -> float:
    """Return ∫|error| over a stretch on which the temperature does not turn: it is split where the error is 0."""
    whole = _integral(meter, plant, before, after)
    if (before.y - meter.setpoint) * (after.y - meter.setpoint) >= 0.0:
        return abs(whole)
    part = _integral(meter, plant, before, reached(before, after, meter.setpoint, plant))
    return abs(part) + abs(whole - part)


def _integral(meter: Meter, plant: Plant, before: Flow, after: Flow) -> float:
    return area(before, after, plant) - meter.setpoint * (after.now - before.now)


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
    return Rest(False, rest.start, rest.integral, rest.highest, rest.lowest)


def rest_begins(meter: Meter, time: float, error: float) -> Rest:
    """Return the rest at its first instant."""
    for number in range(len(meter.high)):
        meter.high[number] = -math.inf
        meter.low[number] = math.inf
    _in_period(meter, time, time, error)
    return Rest(True, time, 0.0, error, error)


def rested(meter: Meter, rest: Rest, plant: Plant, before: Flow, after: Flow) -> Rest:
    """Return the rest after a stretch on which the temperature does not turn."""
    error = after.y - meter.setpoint
    _in_period(meter, rest.start, after.now, error)
    return Rest(
        rest.lasts, rest.start, rest.integral + _integral(meter, plant, before, after),
        max(rest.highest, error), min(rest.lowest, error),
    )


def _in_period(meter: Meter, start: float, time: float, error: float) -> None:
    """Enter an error in the PWM period at rest that it belongs to."""
    number = min(int((time - start) / meter.period), len(meter.high) - 1)
    meter.high[number] = max(meter.high[number], error)
    meter.low[number] = min(meter.low[number], error)
