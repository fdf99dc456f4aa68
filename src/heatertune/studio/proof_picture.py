"""The picture of a proof: runs as thin lines, limits as walls, the parts of the test sequence.

Long lines are reduced to the points that are visible: minimum and maximum of each pixel, nothing on a straight line.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.proof import Proof, Trace
from heatertune.proof.criteria import CRITERION, TIME_OF, band_of, names_of, phases_measured
from heatertune.proof.loop import plant_row
from heatertune.proof.phase_statistics import behind_degC, beyond_degC, first_within
from heatertune.proof.scenario import Phase, event_name

__all__ = [
    "Line", "Picture", "PicturePart", "Wall", "course_of", "downsample", "parts_of", "picture_of", "step_corners",
    "straight", "torn", "walls_of",
]


Places = npt.NDArray[np.intp]


def downsample(across: Array, values: Array, pixels: int) -> Places:
    """Return the places of first, least, most and last value of each pixel, ascending.

    Args:
        across: where each value stands in the picture, ascending, shape (n,).
        values: shape (n,).
        pixels: the picture is as wide as so many.
    """
    if len(across) <= 4 * pixels:
        return np.arange(len(across))
    pixel = np.minimum(((across - across[0]) / (across[-1] - across[0]) * pixels).astype(np.intp), pixels - 1)
    first = np.flatnonzero(np.diff(pixel, prepend=-1))
    last = np.append(first[1:], len(across)) - 1
    inside = last - first + 1
    selection = np.zeros(len(across), dtype=np.bool_)
    selection[first] = selection[last] = True
    for extreme in (np.minimum, np.maximum):
        selection |= values == np.repeat(extreme.reduceat(values, first), inside)
    return np.flatnonzero(selection)


def step_corners(time: Array, values: Array) -> tuple[Array, Array]:
    """Return the corners of a line, shape (m,), whose values, shape (n,), hold until the next instant."""
    change = np.flatnonzero(np.diff(values)) + 1
    return (np.concatenate([time[:1], np.repeat(time[change], 2), time[-1:]]),
            np.concatenate([values[:1], np.stack([values[change - 1], values[change]], axis=1).ravel(), values[-1:]]))


def straight(across: Array, values: Array, within: float, begun: int = 1) -> Places:
    """Return the places at which a line of shape (n,) bends: all others lie as near as `within` to those between these.

    The line is looked at in so many pieces of equal width, whose ends stay: a saw of a thousand teeth takes one piece
    a thousand rounds, and a thousand pieces a few.

    U. Ramer, "An iterative procedure for the polygonal approximation of plane curves" (1972), distances taken along
    the values.
    """
    selection = np.zeros(len(across), dtype=np.bool_)
    selection[[0, -1]] = True
    selection[np.searchsorted(across, np.linspace(across[0], across[-1], begun + 1)[1:-1])] = True
    ends = np.flatnonzero(selection)
    begin, end = ends[:-1], ends[1:]
    while len(begin):  # all pieces at once, level by level
        begin, end = begin[end - begin > 1], end[end - begin > 1]
        worst, off = _farthest(across, values, begin, end)
        far = off > within
        begin, end, worst = begin[far], end[far], worst[far]
        selection[worst] = True
        begin, end = np.concatenate([begin, worst]), np.concatenate([worst, end])
    return np.flatnonzero(selection)


def _farthest(across: Array, values: Array, begin: Places, end: Places) -> tuple[Places, Array]:
    """Return where each piece of a line is farthest from its chord, the first such place, and how far; shape (m,)."""
    if not len(begin):
        return begin, np.empty(0)
    inside = end - begin - 1
    first = np.cumsum(inside) - inside
    piece = np.repeat(np.arange(len(begin)), inside)
    place = np.arange(len(piece)) + (begin + 1 - first)[piece]
    slope = (values[end] - values[begin]) / np.maximum(across[end] - across[begin], 1e-9)
    off = np.abs(values[place] - values[begin][piece] - slope[piece] * (across[place] - across[begin][piece]))
    most = np.maximum.reduceat(off, first)
    at = np.flatnonzero(off == most[piece])
    return place[at[np.searchsorted(piece[at], np.arange(len(begin)))]], most


#: instants [s] and temperatures [°C], both of shape (n)
Line = tuple[npt.NDArray[Any], Array]

_PIXELS: Final = 3000  # of the whole story, which is zoomed to a tenth
_DENSE: Final = 100 * _PIXELS  # stretches of a run: with more of them no tooth of its PWM is seen
_SCANS: Final = 10 * _PIXELS  # and as many switchings are looked at of a loop in motion
_PIXELS_BEHIND: Final = 700  # of a run that is seen in a crowd
_WITHIN: Final = 0.008  # of the temperature's span: two pixels of a picture 250 high
_REST_SEEN: Final = 0.05  # of a time at rest, before the picture is torn


@dataclass(frozen=True, slots=True, kw_only=True)
class Wall:
    """Where no line may be: a rectangle [s, °C], open ends infinite, and what it means."""

    begin_s: float
    end_s: float
    low_degC: float
    high_degC: float
    name: str


@dataclass(frozen=True, kw_only=True, eq=False)
class PicturePart:
    """A part of the story, and what one run does in it: measured when it is asked for, after the lines are drawn.

    Attributes:
        name: what begins it.
        begin_s, rest_s, end_s: see `heatertune.proof.scenario.Phase`.
        setpoint_degC: what is asked for.
        trace: the run.
        band_degC: around the setpoint.
        most: stretches of the run that are looked at one by one, see `Trace.course`.
    """

    name: str
    begin_s: float
    rest_s: float
    end_s: float
    setpoint_degC: float
    trace: Trace
    band_degC: float
    most: float

    @property
    def highest_degC(self) -> float:
        """The highest temperature of the run."""
        return float(self._course[1].max())

    @property
    def lowest_degC(self) -> float:
        """The lowest temperature of the run."""
        return float(self._course[1].min())

    @property
    def within_s(self) -> float | None:
        """From when on the run stays in the band, None: it does not."""
        time, temperature = self._course
        first = first_within(temperature - self.setpoint_degC, self.band_degC)
        return None if first == len(time) else float(time[first])

    @cached_property
    def _course(self) -> Line:
        return self.trace.course(self.begin_s, self.end_s, most=self.most)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Picture:
    """What is drawn behind the nominal run.

    Attributes:
        crowd: every run once, the same line not twice.
        runs: how many runs these are.
        worst: the run that uses most of its limits, and its name; None where it is the nominal one.
        walls: its limits.
        parts: of the story, as the nominal run lives through them.
        torn: times at rest that are left out, from and to [s].
        fails: whether the worst run breaks a limit.
    """

    crowd: tuple[Line, ...]
    runs: int
    worst: tuple[str, Line] | None
    walls: tuple[Wall, ...]
    parts: tuple[PicturePart, ...]
    torn: tuple[tuple[float, float], ...]
    fails: bool = False

    @property
    def called(self) -> str:
        """What the worst run is called."""
        return "failing run" if self.fails else "worst run"

    def place(self, time: npt.ArrayLike) -> Array:
        """Return where instants [s], of any shape, stand in the picture: what is torn out has no width."""
        return _place(np.asarray(time, dtype=np.float64), self.torn)


def picture_of(proof: Proof, before_run: Callable[[], object] = bool, *, crowd: bool = True) -> Picture:
    """Return what a full proof's picture shows; it runs every loop of the proof once more.

    Args:
        proof: or a first look.
        before_run: called before each run is drawn; what it raises gives the picture up.
        crowd: whether all runs are drawn, not the nominal and the worst alone.
    """
    lines: dict[bytes, Line] = {}
    gaps, runs = torn(proof), len(proof.runs) if crowd else 1
    for run in range(runs if runs > 1 else 0):
        before_run()
        time, temperature = course_of(proof.trace(run), proof, _PIXELS_BEHIND)
        points = straight(_place(time, gaps), temperature, _WITHIN * float(np.ptp(temperature)))
        line = np.round(time[points]).astype(np.intp), np.round(temperature[points], 1)
        lines[line[0].tobytes() + line[1].tobytes()] = line
    run = proof.worst_run
    worst = None if run == 0 else (proof.runs[run].label, course_of(proof.worst, proof))
    fails = worst is not None and proof.verdict == "FAIL"
    return Picture(crowd=tuple(lines.values()), runs=runs, worst=worst, walls=tuple(walls_of(proof, run)),
                   parts=tuple(parts_of(proof.nominal, proof)), torn=gaps, fails=fails)


def course_of(trace: Trace, proof: Proof, pixels: int = _PIXELS, *, coarse: bool = False) -> Line:
    """Return a run's temperature as a picture of so many pixels shows it, of shape (n,).

    Its extremes are exact, but for the ripple of a PWM that is too fast to be seen; `coarse`: those between two scans
    or switchings are not looked for.
    """
    if coarse:
        time, temperature = _without_search(trace)
    else:
        time, temperature = trace.course(0.0, float(trace.time_s[-1]), most=_DENSE)
    jumps = np.array([event.time_s for event in trace.scenario.disturbances])
    places = np.searchsorted(time, jumps)
    time = np.insert(time, places, jumps)
    temperature = np.insert(temperature, places, trace.temperature_at(jumps, before=True))
    gaps = torn(proof)
    is_visible = np.all([(time <= begin) | (time >= end) for begin, end in gaps], axis=0)
    time, temperature = time[is_visible], temperature[is_visible]
    points = downsample(_place(time, gaps), temperature, pixels)
    return time[points], temperature[points]


def _without_search(trace: Trace) -> Line:
    """Return a run at its scans and where its stretches begin, of shape (n,): what is known of it already."""
    parts = []
    for instants, values in ((trace.stretches[:, 0], trace.stretches[:, 1]), (trace.time_s, trace.temperature_degC)):
        stride = slice(None, None, math.ceil(len(instants) / _SCANS))
        parts.append((instants[stride], values[stride]))
    time, temperature = (np.concatenate(column) for column in zip(*parts, strict=True))
    order = np.argsort(time, kind="stable")
    inside = order[time[order] <= trace.time_s[-1]]
    return time[inside], temperature[inside]


def parts_of(trace: Trace, proof: Proof) -> list[PicturePart]:
    """Return what a run does in each part of the story: exactly, but for a first look at a run with a fast PWM."""
    band, most = band_of(proof.limits, trace.resolution_degC), math.inf if proof.open_points else _DENSE
    events = zip((None, *trace.scenario.disturbances), _phases(trace, proof), strict=True)
    return [PicturePart(name=event_name(event), begin_s=phase.begin_s, rest_s=phase.rest_s, end_s=phase.end_s,
                        setpoint_degC=phase.setpoint_degC, trace=trace, band_degC=band, most=most)
            for event, phase in events]


def walls_of(proof: Proof, run: int) -> Iterator[Wall]:
    """Return where the line of a run may not be: beyond its overshoot, and out of the band once it has to be there."""
    trace, limits = proof.trace(run), proof.limits
    band, row = band_of(limits, trace.resolution_degC), plant_row(trace.model, trace.scenario)
    before = trace.scenario.setpoint_degC
    step = abs(before - float(row[5]))
    for phase in _phases(trace, proof):
        if phase.kind not in TIME_OF:
            continue
        rises = (float(row[0]) > 0.0) == phase.up if phase.by_power else phase.up
        settles = limits.settling_s if phase.kind == "heat-up" else (
            limits.recovery_s if phase.kind == "recovery" else None)
        in_s = min(phase.begin_s + (phase.limit_s if settles is None else settles), phase.end_s)
        up = rises != (phase.kind == "recovery")
        setpoint_degC = phase.setpoint_degC
        change = abs(setpoint_degC - before) if phase.kind == "small-change" else step
        before = setpoint_degC
        if beyond := [*_beyond(proof, phase, change)]:
            yield _side(phase.begin_s, phase.end_s, setpoint_degC, min(beyond), up=up, name="overshoot")
        if phase.kind == "recovery" and limits.deviation_degC is not None:
            yield _side(phase.begin_s, phase.end_s, setpoint_degC, limits.deviation_degC, up=not up, name="deviation")
        if in_s < phase.end_s:
            for side in (True, False):
                yield _side(in_s, phase.end_s, setpoint_degC, band, up=side, name="settled")


def _beyond(proof: Proof, phase: Phase, step: float) -> Iterator[float]:
    """Return how far beyond the setpoint the limits let a run go [°C]."""
    for name in names_of(behind_degC if phase.kind == "recovery" else beyond_degC, phases=(phase.kind,)):
        limit = CRITERION[name].limit_in(proof.limits)
        if limit is not None:
            yield limit / 100.0 * step if CRITERION[name].of else limit


def _side(begin_s: float, end_s: float, setpoint_degC: float, far: float, *, up: bool, name: str) -> Wall:
    low, high = (setpoint_degC + far, np.inf) if up else (-np.inf, setpoint_degC - far)
    return Wall(begin_s=begin_s, end_s=end_s, low_degC=low, high_degC=high, name=name)


def _phases(trace: Trace, proof: Proof) -> tuple[Phase, ...]:
    return phases_measured(trace.scenario, proof.limits, float(trace.time_s[-1]), trace.actuator.pwm_period_s)


def torn(proof: Proof) -> tuple[tuple[float, float], ...]:
    """Return the times at rest that the picture leaves out, from and to [s]."""
    phases = _phases(proof.nominal, proof)
    return tuple((phase.rest_s + _REST_SEEN * (phase.end_s - phase.rest_s), phase.end_s)
                 for phase in phases if phase.end_s > phase.rest_s)


def _place(time: Array, gone: tuple[tuple[float, float], ...]) -> Array:
    return np.asarray(time - np.interp(time, *_knots(gone))) if gone else time


@lru_cache(16)
def _knots(gone: tuple[tuple[float, float], ...]) -> tuple[Array, Array]:
    """Return instants at which times are left out begin and end, and how much is lost by then [s]."""
    ends = np.array(gone)
    lost = np.cumsum(ends[:, 1] - ends[:, 0])
    return ends.ravel(), np.ravel([np.append(0.0, lost[:-1]), lost], order="F")
