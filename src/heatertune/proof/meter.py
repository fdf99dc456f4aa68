"""What a loop is judged by, measured while it runs, so that no trace need be kept.

Between two instants at which the temperature may turn (scan, change of power, jump, and with two lags the turn itself)
it only rises or only falls: there integrals, and the instants at which it crosses the setpoint or an edge of the band,
are those of the heater's own answer, not of a line between two points.
A phase lasts from the start, or a disturbance, to the next one, or the end; its rest is its last part.
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np

from heatertune.proof.plant import Flow, Plant, area, level_crossing

__all__ = [
    "ABSOLUTE", "COLUMNS", "FAULTS", "HIGHEST", "LAG", "LIMITED", "LOWEST", "MEAN", "NOT_LED", "REST_HIGHEST",
    "REST_LOWEST", "SCANS", "SETTLED", "SWITCHINGS", "TOTALS", "Meter", "PhaseStats", "Places", "SteadyStateStats",
    "absolute_by", "begin", "close", "faults", "in_period", "integral", "is_led", "led_to", "no_meter",
    "phase_after_known", "phase_after_monotone", "phase_after_stretch", "rest_begins", "rested_from",
    "settling_time", "through", "update_rest",
]

#: places for numbers: an array where the loop is compiled, a list in plain Python
Places: TypeAlias = Any

#: columns of `Meter.phases`: largest and smallest error, ∫|error|, instant from which the error stays in the band; at
#: rest ∫error, largest and smallest error; largest distance from a setpoint that is led, at each scan and wherever the
#: power changes: in between it is more by about rate·interval²/(8·lag) at most
HIGHEST: Final = 0
LOWEST: Final = 1
ABSOLUTE: Final = 2
SETTLED: Final = 3
MEAN: Final = 4
REST_HIGHEST: Final = 5
REST_LOWEST: Final = 6
LAG: Final = 7
COLUMNS: Final = 8

#: places of `Meter.totals`: scans that were run, those at a power limit, scans times flags that mean a wrong result (a
#: power that is no number counts as one), how often the heater was switched on
SCANS: Final = 0
LIMITED: Final = 1
FAULTS: Final = 2
SWITCHINGS: Final = 3
TOTALS: Final = 4

#: see `Meter.leads`
NOT_LED: Final = np.empty(0)


class Meter(NamedTuple):
    """What is measured, and places for what is found.

    Attributes:
        measures: whether anything is.
        setpoints: the error's origin in each phase [°C].
        band: how far from it is still right [°C].
        period: PWM period [s].
        wrong: flags that mean a wrong result, as bits.
        phases: `COLUMNS` numbers for each phase, one after the other.
        totals: `TOTALS` numbers.
        high, low: largest and smallest error in each PWM period at rest in the first phase.
        leads: begin [s], setpoint there [°C], how fast it moves [°C/s] and how long [s], of each phase in turn; a rate
            of 0: it does not move; empty: in no phase.
    """

    measures: bool
    setpoints: Places
    band: float
    period: float
    wrong: int
    phases: Places
    totals: Places
    high: Places
    low: Places
    leads: Places = NOT_LED


class PhaseStats(NamedTuple):
    """One phase so far: its number, extremes, ∫|error|, whether it is outside the band, else since when not, lag."""

    phase: int
    highest: float
    lowest: float
    absolute: float
    outside: bool
    settled: float
    lag: float


class SteadyStateStats(NamedTuple):
    """The time at rest so far: whether it lasts, its start, ∫error, extremes."""

    lasts: bool
    start: float
    integral: float
    highest: float
    lowest: float


def no_meter(loops: int = 1) -> Meter:
    """Return a meter that measures nothing of any number of loops."""
    nothing = np.empty((loops, 0))
    return Meter(False, np.empty(0), 0.0, 0.0, 0, nothing, nothing, nothing, nothing)


def is_led(leads: Places, phase: int) -> bool:
    """Return whether the setpoint moves in a phase."""
    return len(leads) > 0 and leads[4 * phase + 2] != 0.0


def led_to(leads: Places, phase: int, time: float) -> Any:
    """Return the setpoint of a phase in which it moves, at an instant [°C]."""
    return leads[4 * phase + 1] + leads[4 * phase + 2] * min(time - leads[4 * phase], leads[4 * phase + 3])


def _lag(meter: Meter, phase: int, time: float, error: float) -> float:
    """Return how far the temperature is from a setpoint that moves; 0 where none does."""
    if is_led(meter.leads, phase):
        return float(abs(error + meter.setpoints[phase] - led_to(meter.leads, phase, time)))
    return 0.0


def begin(meter: Meter, phase: int, time: float, error: float) -> PhaseStats:
    """Return a phase at its first instant."""
    return PhaseStats(phase, error, error, 0.0, abs(error) > meter.band, time, _lag(meter, phase, time, error))


def phase_after_monotone(meter: Meter, stats: PhaseStats, plant: Plant, before: Flow, after: Flow) -> PhaseStats:
    """Return the phase after a stretch on which the temperature does not turn.

    Args:
        meter: what is measured.
        stats: the phase so far.
        plant: the heater.
        before: at the stretch's begin.
        after: at its end.
    """
    setpoint = meter.setpoints[stats.phase]
    lag = _lag(meter, stats.phase, after.now, after.y - setpoint)
    return phase_after_stretch(stats, setpoint, meter.band, lag, plant, before, after, True, True)


def phase_after_stretch(  # noqa: PLR0913 - what may be left out is told part by part
    stats: PhaseStats, setpoint: float, band: float, lag: float, plant: Plant, before: Flow, after: Flow, crosses: bool,
    settles: bool,
) -> PhaseStats:
    """Return the phase after a stretch, see `phase_after_monotone`.

    Args:
        stats: the phase so far.
        setpoint: of the phase [°C].
        band: how far from it is still right [°C].
        lag: distance from a setpoint that moves [°C].
        plant: the heater.
        before: at the stretch's begin.
        after: at its end.
        crosses: whether it may be one that goes `through` the setpoint.
        settles: whether it may be one of `settling`.
    """
    settled = stats.settled
    if settles and settling_time(stats, setpoint, band, after):
        settled = level_crossing(before, after, setpoint + math.copysign(band, before.y - setpoint), plant).now
    absolute = _absolute(setpoint, plant, before, after) if crosses else abs(integral(setpoint, plant, before, after))
    return phase_after_known(stats, setpoint, band, lag, after.y, settled, absolute)


def phase_after_known(
    stats: PhaseStats, setpoint: float, band: float, lag: float, y: float, settled: float, absolute: float
) -> PhaseStats:
    """Return the phase after a stretch of which is known what has to be searched for, see `phase_after_stretch`.

    Args:
        stats: the phase so far.
        setpoint: of the phase [°C].
        band: how far from it is still right [°C].
        lag: distance from a setpoint that moves [°C].
        y: temperature at the stretch's end [°C].
        settled: instant from which the error stays in the band [s].
        absolute: ∫|error| over the stretch [°C·s].
    """
    later = y - setpoint
    return PhaseStats(stats.phase, max(stats.highest, later), min(stats.lowest, later), stats.absolute + absolute,
                abs(later) > band, settled, max(stats.lag, lag))


def through(setpoint: float, before: Flow, after: Flow) -> bool:
    """Return whether the temperature comes through the setpoint [°C] on a stretch."""
    return (before.y - setpoint) * (after.y - setpoint) < 0.0


def settling_time(stats: PhaseStats, setpoint: float, band: float, after: Flow) -> bool:
    """Return whether the temperature comes into the band on a stretch.

    Args:
        stats: the phase so far.
        setpoint: of the phase [°C].
        band: how far from it is still right [°C].
        after: at the stretch's end.
    """
    return stats.outside and not abs(after.y - setpoint) > band


def _absolute(setpoint: float, plant: Plant, before: Flow, after: Flow) -> float:
    """Return ∫|error| over a stretch on which the temperature does not turn: it is split where the error is 0."""
    if not through(setpoint, before, after):
        return abs(integral(setpoint, plant, before, after))
    return absolute_by(setpoint, plant, before, level_crossing(before, after, setpoint, plant), after)


def absolute_by(setpoint: float, plant: Plant, before: Flow, there: Flow, after: Flow) -> float:
    """Return ∫|error| over a stretch on which the error is 0 at one instant.

    Args:
        setpoint: of the phase [°C].
        plant: the heater.
        before: at the stretch's begin.
        there: where the error is 0.
        after: at its end.
    """
    part = integral(setpoint, plant, before, there)
    return abs(part) + abs(integral(setpoint, plant, before, after) - part)


def integral(setpoint: float, plant: Plant, before: Flow, after: Flow) -> float:
    """Return ∫error over a stretch.

    Args:
        setpoint: of the phase [°C].
        plant: the heater.
        before: at the stretch's begin.
        after: at its end.
    """
    return area(before, after, plant) - setpoint * (after.now - before.now)


def close(meter: Meter, stats: PhaseStats, rest: SteadyStateStats) -> SteadyStateStats:
    """Write down a phase that ends, and its rest."""
    place = stats.phase * COLUMNS
    meter.phases[place + HIGHEST] = stats.highest
    meter.phases[place + LOWEST] = stats.lowest
    meter.phases[place + ABSOLUTE] = stats.absolute
    meter.phases[place + SETTLED] = math.inf if stats.outside else stats.settled
    meter.phases[place + LAG] = stats.lag
    if rest.lasts:
        meter.phases[place + MEAN] = rest.integral
        meter.phases[place + REST_HIGHEST] = rest.highest
        meter.phases[place + REST_LOWEST] = rest.lowest
    return SteadyStateStats(False, rest.start, rest.integral, rest.highest, rest.lowest)


def rest_begins(meter: Meter, phase: int, time: float, error: float) -> SteadyStateStats:
    """Return the rest of a phase at its first instant."""
    if phase == 0:
        for number in range(len(meter.high)):
            meter.high[number] = -math.inf
            meter.low[number] = math.inf
        _in_period(meter, time, time, error)
    return SteadyStateStats(True, time, 0.0, error, error)


def update_rest(meter: Meter, phase: int, rest: SteadyStateStats, plant: Plant, before: Flow,
                after: Flow) -> SteadyStateStats:
    """Return the rest after a stretch on which the temperature does not turn.

    Args:
        meter: what is measured.
        phase: number of the phase.
        rest: so far.
        plant: the heater.
        before: at the stretch's begin.
        after: at its end.
    """
    setpoint = meter.setpoints[phase]
    if phase == 0:
        _in_period(meter, rest.start, after.now, after.y - setpoint)
    return rested_from(rest, setpoint, plant, before, after)


def rested_from(rest: SteadyStateStats, setpoint: float, plant: Plant, before: Flow, after: Flow) -> SteadyStateStats:
    """Return the rest after a stretch, see `rested`, but for what is kept of each PWM period.

    Args:
        rest: the rest so far.
        setpoint: of the phase [°C].
        plant: the heater.
        before: at the stretch's begin.
        after: at its end.
    """
    error = after.y - setpoint
    return SteadyStateStats(
        rest.lasts, rest.start, rest.integral + integral(setpoint, plant, before, after),
        max(rest.highest, error), min(rest.lowest, error),
    )


def in_period(start: float, time: float, period: float, periods: int) -> int:
    """Return the PWM period at rest that an instant belongs to, the last one being as long as it takes."""
    return min(int((time - start) / period), periods - 1)


def faults(bits: int) -> float:
    """Return how many of eight bits are set."""
    pairs = bits - (bits >> 1 & 0x55)
    fours = (pairs & 0x33) + (pairs >> 2 & 0x33)
    return float((fours + (fours >> 4)) & 0x0F)


def _in_period(meter: Meter, start: float, time: float, error: float) -> None:
    """Enter an error in the PWM period at rest that it belongs to."""
    number = in_period(start, time, meter.period, len(meter.high))
    meter.high[number] = max(meter.high[number], error)
    meter.low[number] = min(meter.low[number], error)
