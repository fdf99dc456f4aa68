"""What a loop keeps in rows, and what all loops have in common."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from heatertune.proof.lanes.rows import rows_of
from heatertune.proof.meter import PhaseStats, Places, SteadyStateStats
from heatertune.proof.plant import CrossingSearch, Flow, Plant

__all__ = [
    "NEVER",
    "ROWS",
    "Edges",
    "Inner",
    "LaneCounts",
    "LaneLag",
    "LaneStretch",
    "PhaseLimits",
    "Point",
    "ScanState",
    "Second",
    "StretchEnd",
    "Under",
    "flow_of",
    "left_of",
    "loaded_counts",
    "loaded_edges",
    "loaded_end",
    "loaded_inner",
    "loaded_line",
    "loaded_point",
    "loaded_rest",
    "loaded_search",
    "loaded_second",
    "loaded_seen",
    "loaded_stretch",
    "loaded_under",
    "plant_of",
    "stored_counts",
    "stored_edges",
    "stored_end",
    "stored_inner",
    "stored_line",
    "stored_point",
    "stored_rest",
    "stored_search",
    "stored_second",
    "stored_seen",
    "stored_stretch",
    "stored_under",
    "toggled_power",
]


class LaneLag(NamedTuple):
    """A heater's larger lag; `Plant` says what its numbers are."""

    gain: float
    lag: float
    dead: float
    ambient: float
    by_lag: float
    whole: float  # what a whole interval leaves


class Second(NamedTuple):
    """A heater's smaller lag [s], 0: it has none, see `Plant`; what a whole interval leaves of it, see `Factors`."""

    lag: float
    by_lag: float
    apart: float
    by_apart: float
    coupling: float
    inner: float


class LaneStretch(NamedTuple):
    """The heater at the begin of a stretch, see `Flow`."""

    now: float
    y: float
    target: float
    heat: float
    load: float
    mains: float


class Point(NamedTuple):
    """Where the stretch ends: instant [s] and temperature [°C]; and whether an edge came in this scan."""

    now: float
    y: float
    busy: bool


class Inner(NamedTuple):
    """State of the smaller lag where a stretch begins and where it ends [°C]."""

    x: float
    at: float


class StretchEnd(NamedTuple):
    """Where a stretch ended that now ends at the turn: instant [s], y and x [°C]."""

    now: float
    y: float
    x: float


class Under(NamedTuple):
    """Switch and the edge felt next, see `heatertune.proof.lanes.ring`.

    Attributes:
        due: instant at which the next edge is felt; infinite: none so far [s].
        edge: instant at which it was made [s].
        last: instant at which the edge that was felt last was made [s].
        power: asked for last [%].
        owed: by the heater [s].
        on: whether the last edge made switches on.
        times: how often was switched on until the end.
        happened: how many events.
    """

    due: float
    edge: float
    last: float
    power: float
    owed: float
    on: bool
    times: float
    happened: int


class Edges(NamedTuple):
    """When this PWM period switches on and off; infinite: it does not [s]."""

    rises: float
    falls: float


class LaneCounts(NamedTuple):
    """Noise of this scan [°C], scans at a limit, faults."""

    noise: float
    limited: float
    faults: float


class ScanState(NamedTuple):
    """What is common to 32 loops at a scan.

    Attributes:
        listed: when something beside edges comes next to one of them [s].
        phase: its number.
        lasts: whether its rest lasts.
        resting: since when, where it is the rest of the first phase, else infinite [s].
    """

    listed: float
    phase: int
    lasts: bool
    resting: float


class PhaseLimits(NamedTuple):
    """What 32 loops are held against in a phase, and where the ripple of the first one is kept, see `Meter`.

    Attributes:
        setpoint: [°C].
        band: how far from it is still right [°C].
        lasts: whether the rest lasts.
        resting: since when ripple is measured; infinite: it is not [s].
        period: PWM period [s].
        high: of all loops.
        low: likewise.
        first: number of the first of the 32 loops.
    """

    setpoint: float
    band: float
    lasts: bool
    resting: float
    period: float
    high: Places
    low: Places
    first: int


NEVER: Final = math.inf
_NO_SECOND: Final = Second(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
loaded_line, stored_line, _end = rows_of(LaneLag(0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
loaded_stretch, stored_stretch, _end = rows_of(LaneStretch(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), _end)
loaded_point, stored_point, _end = rows_of(Point(0.0, 0.0, False), _end)
loaded_under, stored_under, _end = rows_of(Under(0.0, 0.0, 0.0, 0.0, 0.0, False, 0.0, 0), _end)
loaded_seen, stored_seen, _end = rows_of(PhaseStats(0, 0.0, 0.0, 0.0, False, 0.0, 0.0), _end)
loaded_rest, stored_rest, _end = rows_of(SteadyStateStats(False, 0.0, 0.0, 0.0, 0.0), _end)
loaded_counts, stored_counts, _end = rows_of(LaneCounts(0.0, 0.0, 0.0), _end)
loaded_second, stored_second, _end = rows_of(_NO_SECOND, _end)
loaded_inner, stored_inner, _end = rows_of(Inner(0.0, 0.0), _end)
loaded_end, stored_end, _end = rows_of(StretchEnd(0.0, 0.0, 0.0), _end)
loaded_edges, stored_edges, _end = rows_of(Edges(0.0, 0.0), _end)
#: number of the first row of the controller's state and setpoint word
loaded_search, stored_search, ROWS = rows_of(CrossingSearch(0.0, 0.0, 0.0, 0.0, 0.0, False, False), _end)


def plant_of(line: LaneLag, second: Second = _NO_SECOND) -> Plant:
    """Return the heater as the kernel has it; `second`: where it has two lags."""
    return Plant(line.gain, line.lag, second.lag, line.dead, line.ambient, line.by_lag, second.by_lag, second.apart,
                 second.by_apart)


def flow_of(stretch: LaneStretch, now: float, y: float, x: float = 0.0) -> Flow:
    """Return the heater at an instant of its stretch; with one lag nobody asks for x.

    Args:
        stretch: on which it is.
        now: instant [s].
        y: temperature [°C].
        x: state of the smaller lag [°C].
    """
    return Flow(now, y, x, stretch.target, stretch.heat, stretch.load, stretch.mains)


def toggled_power(heat: float) -> float:
    """Return the power after an edge: edges alternate."""
    return 0.0 if heat > 0.0 else 100.0


def left_of(y: float, target: float, left: float) -> float:
    """Return the temperature where a part of its way to the target is left."""
    return target + left * (y - target)
