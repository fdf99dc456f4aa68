"""The passes of 32 loops at once: each `for` over the loops is compiled to vector instructions.

The state of the loops is one flat array: nested named tuples, number r of loop l at r·`LANES` + l. Only so does a
compiler see that what one loop writes no other one reads, and runs several at once. The functions that load and store
a tuple are made from its shape: each field stands in a row of its own, whole numbers bit by bit.

Also the values that all loops share, and the ring of edges on their way to the heaters,
one PWM period per slot. A heater with a long dead time has many such edges, but only those of few periods can act
next: started no longer ago than the longest dead time of the 32, and no later than the shortest. The cost therefore
depends on the spread of the dead times, not on their length.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any, Final, NamedTuple, cast

import numpy as np

from heatertune.compiled.loader import functions_from_text
from heatertune.compiled.plain_functions import lane_parameters, law_loaded, law_stored, measure, step
from heatertune.plc.pwm import Switches, on_time
from heatertune.proof.kernel import HEAT, SetpointProgram, apply_event, moves, setpoint_word_now
from heatertune.proof.meter import (
    PhaseStats,
    Places,
    SteadyStateStats,
    faults,
    in_period,
    phase_after_stretch,
    rested_from,
    settling_time,
    through,
)
from heatertune.proof.plant import CrossingSearch, Flow, Plant, factors

__all__ = [
    "LANES", "NEVER", "ROWS", "STEP", "EdgeWindow", "Edges", "Inner", "LaneCounts", "LaneLag", "LaneStretch",
    "PhaseLimits", "Point", "Ring", "Rows", "ScanState", "Second", "StretchEnd", "Under", "begin_stretch",
    "begun_at", "constant_function", "cut_off", "due_until", "enter_ripple", "flow_of", "lanes_of", "left_of",
    "loaded_counts", "loaded_edges", "loaded_end", "loaded_inner", "loaded_line", "loaded_point", "loaded_rest",
    "loaded_search", "loaded_second", "loaded_seen", "loaded_stretch", "loaded_under", "measure", "next_edge",
    "next_edges", "open_window", "plant_of", "quickly", "ring_for", "rows_of", "run_scan", "step", "stored_counts",
    "stored_edges", "stored_end", "stored_inner", "stored_line", "stored_point", "stored_rest", "stored_search",
    "stored_second", "stored_seen", "stored_stretch", "stored_under", "switch_period", "switches", "toggled_power",
]


#: loops side by side: with fewer a compiler unrolls them first and then sees none, with more one waits for all others
LANES: Final = 32
#: fewer loops are run in so many steps of as many
STEP: Final = 8

_LOAD: Final = {np.float32: "np.float32({0})", bool: "{0} != 0.0", int: "np.float64({0}).view(np.int64)", float: "{0}"}
_STORE: Final = {bool: "1.0 if {0} else 0.0", int: "np.int64({0}).view(np.float64)"}


class Rows(NamedTuple):
    """Functions that load and store a tuple.

    Attributes:
        loaded: (array, number of the loop) → the tuple.
        stored: (array, number of the loop, tuple) → None.
        end: number of the first row behind.
    """

    loaded: Callable[[Any, int], Any]
    stored: Callable[[Any, int, Any], None]
    end: int


def lanes_of(rows: Any) -> int:
    """Return how many loops stand side by side: what an array is longer than whole rows, in steps of `STEP`.

    A compiler sees of which number it is a multiple, and that it does not change.
    """
    return (len(rows) - STEP & LANES - STEP) + STEP


def rows_of(value: Any, first: int = 0) -> Rows:
    """Return how a value is held in rows; only its shape matters.

    Args:
        value: a number, a truth value, or a tuple of such values, named or not.
        first: number of its first row.

    Raises:
        TypeError: a shape that has no rows: an array, say.
    """
    stores, types = list[str](), dict[str, type]()

    def place(entry: Any, name: str) -> str:
        kind = next((kind for kind in _LOAD if isinstance(entry, kind)), None)
        if kind is None:
            raise TypeError(f"{name} is of type {type(entry).__name__}, which has no row")
        there = f"rows[{(first + len(stores)) * LANES} + lane]"
        stores.append(f"{there} = {_STORE.get(kind, '{0}').format(name)}")
        return _LOAD[kind].format(there)

    load = _rebuilt(value, "value", types, place)
    text = (f"def loaded(rows, lane):\n    return {load}\n\n"
            f"def stored(rows, lane, value):\n    {f'{chr(10)}    '.join(stores)}\n")
    loaded, stored = _functions_of(text, ("loaded", "stored"), tuple(types.items()))
    return Rows(loaded, stored, first + len(stores))


def constant_function(value: Any) -> Callable[[Any], Any]:
    """Return a function of such a value that gives it back, its infinite numbers as constants.

    With them is said that there is something not at all, and a compiler then leaves out what would be done with it.
    """
    types = dict[str, type]()

    def field(entry: Any, name: str) -> str:
        infinite = isinstance(entry, float | np.float32) and math.isinf(entry)
        sign = "PLUS" if infinite and entry > 0.0 else "MINUS"
        constant = f"np.float32({sign})" if isinstance(entry, np.float32) else sign
        return constant if infinite else name

    text = f"def given(value):\n    return {_rebuilt(value, 'value', types, field)}\n"
    return cast("Callable[[Any], Any]", _functions_of(text, ("given",), tuple(types.items()))[0])


def _rebuilt(value: Any, name: str, types: dict[str, type], convert: Callable[[Any, str], str]) -> str:
    """Return the text that makes a tuple anew of what `convert` makes of its numbers and their names."""
    if not isinstance(value, tuple):
        return convert(value, name)
    inside = "".join(f"{_rebuilt(part, field, types, convert)}, "
                     for part, field in zip(value, _fields(value, name), strict=True))
    if not hasattr(value, "_fields"):
        return f"({inside})"
    kind = f"{type(value).__name__}_{len(types)}"
    types[kind] = type(value)
    return f"{kind}({inside})"


def _fields(value: tuple[Any, ...], name: str) -> Iterator[str]:
    if hasattr(value, "_fields"):
        return (f"{name}.{field}" for field in value._fields)
    return (f"{name}[{place}]" for place in range(len(value)))


@cache
def _functions_of(text: str, names: tuple[str, ...], types: tuple[tuple[str, type], ...]) -> tuple[Any, ...]:
    """Return functions made from their text, which only names fields."""
    scope: dict[str, Any] = {"np": np, "PLUS": np.inf, "MINUS": -np.inf, "__name__": __name__, **dict(types)}
    scope = functions_from_text(text, scope, file=__file__)
    digest = hashlib.sha256(text.encode()).hexdigest()[:16]
    for name in names:
        scope[name].__doc__ = "Made by `heatertune.proof.lanes.passes`: see `Rows` and `fixed`."
        scope[name].__qualname__ = f"{name}_{digest}"  # by which `compiled` tells it from that of another shape
    return tuple(scope[name] for name in names)


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
    """Switch and the edge felt next, see `heatertune.proof.lanes.passes`.

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


class Ring(NamedTuple):
    """PWM periods, number p at place p modulo the size.

    Attributes:
        begins: of the periods [s], shape (size,).
        rises: instants at which the heaters are switched on; infinite: not [s], shape (size, `LANES`).
        falls: likewise off.
    """

    begins: Places
    rises: Places
    falls: Places


class EdgeWindow(NamedTuple):
    """The periods of whose edges one may be felt next: numbers of the first one, and of the first one behind."""

    first: int
    beyond: int


def ring_for(dead_s: float, scan_s: float, period_s: float, restarts: int) -> Ring:
    """Return a ring that holds what is under way.

    Args:
        dead_s: the longest dead time [s].
        scan_s: interval between two scans [s].
        period_s: PWM period [s].
        restarts: how often the PLC starts up, and its PWM with it.
    """
    size = 1 << (math.ceil((dead_s + 2.0 * scan_s) / period_s) + 3 + restarts).bit_length()
    return Ring(np.zeros(size), np.zeros((size, LANES)), np.zeros((size, LANES)))


def begun_at(rows: Places, ring: Ring, number: int, begin: float) -> None:
    """Enter a period and the edges that were made for it.

    Args:
        rows: places.
        ring: of the periods.
        number: of the period.
        begin: of it [s].
    """
    place = number & (len(ring.begins) - 1)
    ring.begins[place] = begin
    all_rises, all_falls = ring.rises[place], ring.falls[place]
    for lane in range(lanes_of(rows)):  # a pass of its own: a compiler sees less where two arrays are written
        edges = loaded_edges(rows, lane)
        all_rises[lane], all_falls[lane] = edges.rises, edges.falls


def open_window(
    rows: Places, ring: Ring, window: EdgeWindow, begun: int, before: float, t: float, dead: tuple[float, float]
) -> EdgeWindow:
    """Let the heaters see the edges that one of them may feel until a scan; return the window that has them.

    Args:
        rows: places.
        ring: of the periods.
        window: until the scan before.
        begun: how many periods have begun.
        before: instant of the scan before [s].
        t: instant of the scan [s].
        dead: shortest and longest dead time [s].
    """
    first, beyond, last = window.first, window.beyond, len(ring.begins) - 1
    while beyond < begun and ring.begins[beyond & last] + dead[0] <= t:
        _sooner(rows, ring, beyond, False)
        beyond += 1
    while first + 1 < beyond and ring.begins[first + 1 & last] + dead[1] <= before:
        first += 1
    return EdgeWindow(first, beyond)


def next_edges(rows: Places, ring: Ring, window: EdgeWindow) -> None:
    """Look for the next edge of each heater, behind the one it felt last."""
    if window.first == window.beyond:
        for lane in range(lanes_of(rows)):
            u = loaded_under(rows, lane)
            stored_under(rows, lane, Under(NEVER, NEVER, u.last, u.power, u.owed, u.on, u.times, u.happened))
    for number in range(window.first, window.beyond):
        _sooner(rows, ring, number, number == window.first)


def _sooner(rows: Places, ring: Ring, number: int, anew: bool) -> None:
    """Take the edges of a period where they come before what is the next one so far; `anew`: none is."""
    place = number & (len(ring.begins) - 1)
    all_rises, all_falls = ring.rises[place], ring.falls[place]  # so a compiler sees that they follow one another
    for lane in range(lanes_of(rows)):
        u, rises, falls = loaded_under(rows, lane), all_rises[lane], all_falls[lane]
        edge = min(NEVER if anew else u.edge, rises if rises > u.last else NEVER, falls if falls > u.last else NEVER)
        stored_under(rows, lane, Under(
            edge + loaded_line(rows, lane).dead, edge, u.last, u.power, u.owed, u.on, u.times, u.happened))


def next_edge(ring: Ring, window: EdgeWindow, lane: int, last: float) -> float:
    """Return the edge of one heater that follows the one it felt last; infinite: none so far [s]."""
    edge, end = NEVER, len(ring.begins) - 1
    for number in range(window.first, window.beyond):
        rises, falls = ring.rises[number & end][lane], ring.falls[number & end][lane]
        edge = min(edge, rises if rises > last else NEVER, falls if falls > last else NEVER)
    return edge


def cut_off(rows: Places, ring: Ring, begun: int, now: float) -> None:
    """Take back what is left of a pulse, without supply, as `switch.switched_off` does.

    Args:
        rows: places.
        ring: of the periods.
        begun: how many periods have begun.
        now: instant of the scan [s].
    """
    all_falls = ring.falls[begun - 1 & len(ring.begins) - 1]
    for lane in range(lanes_of(rows)):
        u, falls = loaded_under(rows, lane), all_falls[lane]
        all_falls[lane] = now if u.on or now < falls < NEVER else falls
        stored_under(rows, lane, Under(u.due, u.edge, u.last, 0.0, u.owed, False, u.times, u.happened))


def quickly(rows: Places, ring: Ring, window: EdgeWindow, limits: PhaseLimits, t: float) -> None:
    """Bring all heaters to a scan before which nothing happens but edges.

    Args:
        rows: places.
        ring: of the PWM periods.
        window: those of which edges may be felt.
        limits: what they are held against.
        t: instant of the scan [s].
    """
    quiet = True
    due = due_until(rows, t)
    while due > 0:
        quiet = False
        _along(rows, limits, _to_edges(rows, limits, t))
        switches(rows, t)
        next_edges(rows, ring, window)
        due = due_until(rows, t)
    _along(rows, limits, _to_scan(rows, limits, t) if quiet else _on_to_scan(rows, limits, t))
    begin_stretch(rows)


def due_until(rows: Places, t: float) -> int:
    """Return to how many heaters an edge comes until an instant [s]."""
    due = 0
    for lane in range(lanes_of(rows)):
        due += int(loaded_under(rows, lane).due <= t)
    return due


def _to_edges(rows: Places, limits: PhaseLimits, t: float) -> tuple[int, int]:
    """Bring the heaters to which one comes until an instant to their next edge; return as `_to_scan`."""
    crossings = settles = 0
    for lane in range(lanes_of(rows)):
        line, stretch, due = loaded_line(rows, lane), loaded_stretch(rows, lane), loaded_under(rows, lane).due
        moves = due <= t
        now = due if moves else stretch.now
        left = factors(now - stretch.now, plant_of(line)).outer
        y = left_of(stretch.y, stretch.target, left) if moves else stretch.y
        stored_point(rows, lane, Point(now, y, moves or loaded_point(rows, lane).busy))
        through_it, into_it = _limits(rows, lane, stretch, now, y, limits)
        crossings, settles = crossings + through_it, settles + into_it
    return crossings, settles


def _to_scan(rows: Places, limits: PhaseLimits, t: float) -> tuple[int, int]:
    """Bring all heaters from one scan to the next; return how many meet which limit, see `_limits`."""
    crossings = settles = 0
    for lane in range(lanes_of(rows)):
        stretch = loaded_stretch(rows, lane)
        y = left_of(stretch.y, stretch.target, loaded_line(rows, lane).whole)
        stored_point(rows, lane, Point(t, y, False))
        through_it, into_it = _limits(rows, lane, stretch, t, y, limits)
        crossings, settles = crossings + through_it, settles + into_it
    return crossings, settles


def _on_to_scan(rows: Places, limits: PhaseLimits, t: float) -> tuple[int, int]:
    """Bring all heaters to a scan before which an edge came to some; return as `_to_scan`."""
    crossings = settles = 0
    for lane in range(lanes_of(rows)):
        line, stretch = loaded_line(rows, lane), loaded_stretch(rows, lane)
        left = factors(t - stretch.now, plant_of(line)).outer
        y = left_of(stretch.y, stretch.target, left if loaded_point(rows, lane).busy else line.whole)
        stored_point(rows, lane, Point(t, y, False))
        through_it, into_it = _limits(rows, lane, stretch, t, y, limits)
        crossings, settles = crossings + through_it, settles + into_it
    return crossings, settles


def _limits(
    rows: Places, lane: int, stretch: LaneStretch, now: float, y: float, limits: PhaseLimits,
) -> tuple[int, int]:
    """Return, as 1 or 0, whether a heater comes through the setpoint, and whether into the band."""
    before, after = flow_of(stretch, stretch.now, stretch.y), flow_of(stretch, now, y)
    return (int(through(limits.setpoint, before, after)),
            int(settling_time(loaded_seen(rows, lane), limits.setpoint, limits.band, after)))


def _along(rows: Places, phase_limits: PhaseLimits, limits: tuple[int, int]) -> None:
    """Measure the stretches of all loops, of which so many come through the setpoint, and into the band."""
    crossings, settles = limits
    if settles > 0:
        for lane in range(lanes_of(rows)):
            _measure_stretch(rows, lane, phase_limits, True, True)
    elif crossings > 0:
        for lane in range(lanes_of(rows)):
            _measure_stretch(rows, lane, phase_limits, True, False)
    else:
        for lane in range(lanes_of(rows)):
            _measure_stretch(rows, lane, phase_limits, False, False)
    if phase_limits.lasts:
        for lane in range(lanes_of(rows)):
            _rests(rows, lane, phase_limits.setpoint)
    if phase_limits.resting < NEVER:
        enter_ripple(rows, phase_limits)


def _measure_stretch(rows: Places, lane: int, limits: PhaseLimits, crosses: bool, settles: bool) -> None:
    stretch, point = loaded_stretch(rows, lane), loaded_point(rows, lane)
    stored_seen(rows, lane, phase_after_stretch(
        loaded_seen(rows, lane), limits.setpoint, limits.band, 0.0, plant_of(loaded_line(rows, lane)),
        flow_of(stretch, stretch.now, stretch.y), flow_of(stretch, point.now, point.y), crosses, settles))


def _rests(rows: Places, lane: int, setpoint: float) -> None:
    stretch, point = loaded_stretch(rows, lane), loaded_point(rows, lane)
    stored_rest(rows, lane, rested_from(
        loaded_rest(rows, lane), setpoint, plant_of(loaded_line(rows, lane)), flow_of(stretch, stretch.now, stretch.y),
        flow_of(stretch, point.now, point.y)))


def enter_ripple(rows: Places, limits: PhaseLimits) -> None:
    """Enter where the stretches end in the PWM periods at rest, each loop in its own."""
    for lane in range(lanes_of(rows)):
        point, i = loaded_point(rows, lane), min(limits.first + lane, len(limits.high) - 1)
        error, high, low = point.y - limits.setpoint, limits.high[i], limits.low[i]
        number = in_period(limits.resting, point.now, limits.period, len(high))
        high[number], low[number] = max(high[number], error), min(low[number], error)


def switches(rows: Places, t: float) -> None:
    """Switch the heaters to which an edge came."""
    for lane in range(lanes_of(rows)):
        line, stretch = loaded_line(rows, lane), loaded_stretch(rows, lane)
        point, u = loaded_point(rows, lane), loaded_under(rows, lane)
        felt = u.due <= t
        new = apply_event(plant_of(line), flow_of(stretch, point.now, point.y), HEAT, toggled_power(stretch.heat))
        stored_stretch(rows, lane, LaneStretch(
            point.now, point.y, new.target if felt else stretch.target, new.heat if felt else stretch.heat,
            stretch.load, stretch.mains))
        stored_under(rows, lane, Under(
            u.due, u.edge, u.edge if felt else u.last, u.power, u.owed, u.on, u.times, u.happened))


def begin_stretch(rows: Places) -> None:
    """Begin the next stretch where the scan is."""
    for lane in range(lanes_of(rows)):
        stretch, point = loaded_stretch(rows, lane), loaded_point(rows, lane)
        stored_stretch(rows, lane, LaneStretch(
            point.now, point.y, stretch.target, stretch.heat, stretch.load, stretch.mains))


def run_scan(
    rows: Places, parameters: Any, sensor: Any, program: SetpointProgram, target: Any, calls: int, cycle_start: bool,
    wrong: int,
) -> None:
    """Run the scan of all controllers.

    Args:
        rows: places.
        parameters: what `step` takes.
        sensor: what `measure` takes.
        program: around the controllers.
        target: setpoint of the phase.
        calls: how many scans there were before this one.
        cycle_start: whether a PWM period begins.
        wrong: see `Meter`.
    """
    due, parameters = moves(program, calls), lane_parameters(parameters)
    for lane in range(lanes_of(rows)):
        state, word = law_loaded(rows, lane)
        reading = measure(sensor, loaded_point(rows, lane).y + loaded_counts(rows, lane).noise)
        word = setpoint_word_now(program, target, calls == 0, due, word, reading)
        state, power, _, flags = step(parameters, state, word, reading, cycle_start)
        law_stored(rows, lane, (state, word))
        u = loaded_under(rows, lane)
        none, counts = math.isnan(power), loaded_counts(rows, lane)
        stored_counts(rows, lane, LaneCounts(
            counts.noise, counts.limited + (1.0 if power <= 0.0 or power >= 100.0 else 0.0),
            counts.faults + (1.0 if none else 0.0) + faults(flags & wrong)))
        stored_under(rows, lane, Under(
            u.due, u.edge, u.last, 0.0 if none else power, u.owed, u.on, u.times, u.happened))


def switch_period(rows: Places, ring: Ring, number: int, pwm: Switches, begin: float, end: float) -> None:
    """Switch for one period, as `switch.period_of` does.

    Args:
        rows: places.
        ring: of the PWM periods.
        number: of the period.
        pwm: of the heater.
        begin: of the period [s].
        end: of the run [s].
    """
    for lane in range(lanes_of(rows)):
        u = loaded_under(rows, lane)
        seconds, owed = on_time(max(u.power, 0.0), u.owed, pwm.heat)
        rises = seconds > 0.0 and not u.on
        falls = seconds < pwm.heat[0] and (u.on or rises)
        stored_edges(rows, lane, Edges(begin if rises else NEVER, begin + seconds if falls else NEVER))
        times = u.times + (1.0 if rises and begin <= end else 0.0)
        stored_under(rows, lane, Under(
            u.due, u.edge, u.last, u.power, owed, (u.on or rises) and not falls, times, u.happened))
    begun_at(rows, ring, number, begin)
