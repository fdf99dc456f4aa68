"""What is done for 32 loops at once; each `for` over them is one that a compiler makes vector instructions of."""

from __future__ import annotations

import math
from typing import Any

from heatertune.plc.pwm import Switches, on_time
from heatertune.proof.kernel import HEAT, apply_event
from heatertune.proof.lanes.parts import (
    NEVER,
    Edges,
    LaneCounts,
    LaneStretch,
    PhaseLimits,
    Point,
    Under,
    flow_of,
    left_of,
    loaded_counts,
    loaded_line,
    loaded_point,
    loaded_rest,
    loaded_seen,
    loaded_stretch,
    loaded_under,
    plant_of,
    stored_counts,
    stored_edges,
    stored_point,
    stored_rest,
    stored_seen,
    stored_stretch,
    stored_under,
    toggled_power,
)
from heatertune.proof.lanes.ring import EdgeWindow, Ring, begun_at, next_edges
from heatertune.proof.lanes.rows import lanes_of
from heatertune.proof.meter import Places, faults, in_period, rested_from, seen_from, settling_time, through
from heatertune.proof.plant import factors
from heatertune.proof.setpoint_program import SetpointProgram, asked_now, moves

__all__ = [
    "begin_stretch",
    "due_until",
    "enter_ripple",
    "lane_parameters",
    "law_loaded",
    "law_stored",
    "measure",
    "quickly",
    "run_scan",
    "step",
    "switch_period",
    "switches",
]


def law_loaded(_rows: Places, _lane: int) -> Any:
    """Stand in for what loads a controller's state and setpoint word, see `heatertune.proof.rows`."""
    raise NotImplementedError


def law_stored(_rows: Places, _lane: int, _law: Any) -> None:
    """Stand in likewise."""
    raise NotImplementedError


def step(_parameters: Any, _state: Any, _setpoint: Any, _reading: Any, _cycle_start: bool) -> tuple[Any, ...]:
    """Stand in for the controller's own, as in `heatertune.proof.kernel`.

    Args:
        _parameters: as there.
        _state: likewise.
        _setpoint: likewise.
        _reading: likewise.
        _cycle_start: likewise.
    """
    raise NotImplementedError


def measure(_sensor: Any, _temperature: float) -> Any:
    """Stand in likewise."""
    raise NotImplementedError


def lane_parameters(_parameters: Any) -> Any:
    """Stand in for what gives a controller's parameters, see `heatertune.proof.rows.fixed`."""
    raise NotImplementedError


def quickly(rows: Places, ring: Ring, window: EdgeWindow, held: PhaseLimits, t: float) -> None:
    """Bring all heaters to a scan before which nothing happens but edges.

    Args:
        rows: places.
        ring: of the PWM periods.
        window: those of which edges may be felt.
        held: what they are held against.
        t: instant of the scan [s].
    """
    quiet = True
    due = due_until(rows, t)
    while due > 0:
        quiet = False
        _along(rows, held, _to_edges(rows, held, t))
        switches(rows, t)
        next_edges(rows, ring, window)
        due = due_until(rows, t)
    _along(rows, held, _to_scan(rows, held, t) if quiet else _on_to_scan(rows, held, t))
    begin_stretch(rows)


def due_until(rows: Places, t: float) -> int:
    """Return to how many heaters an edge comes until an instant [s]."""
    due = 0
    for lane in range(lanes_of(rows)):
        due += int(loaded_under(rows, lane).due <= t)
    return due


def _to_edges(rows: Places, held: PhaseLimits, t: float) -> tuple[int, int]:
    """Bring the heaters to which one comes until an instant to their next edge; return as `_to_scan`."""
    crossings = settles = 0
    for lane in range(lanes_of(rows)):
        line, stretch, due = loaded_line(rows, lane), loaded_stretch(rows, lane), loaded_under(rows, lane).due
        moves = due <= t
        now = due if moves else stretch.now
        left = factors(now - stretch.now, plant_of(line)).outer
        y = left_of(stretch.y, stretch.target, left) if moves else stretch.y
        stored_point(rows, lane, Point(now, y, moves or loaded_point(rows, lane).busy))
        through_it, into_it = _limits(rows, lane, stretch, now, y, held)
        crossings, settles = crossings + through_it, settles + into_it
    return crossings, settles


def _to_scan(rows: Places, held: PhaseLimits, t: float) -> tuple[int, int]:
    """Bring all heaters from one scan to the next; return how many meet which limit, see `_limits`."""
    crossings = settles = 0
    for lane in range(lanes_of(rows)):
        stretch = loaded_stretch(rows, lane)
        y = left_of(stretch.y, stretch.target, loaded_line(rows, lane).whole)
        stored_point(rows, lane, Point(t, y, False))
        through_it, into_it = _limits(rows, lane, stretch, t, y, held)
        crossings, settles = crossings + through_it, settles + into_it
    return crossings, settles


def _on_to_scan(rows: Places, held: PhaseLimits, t: float) -> tuple[int, int]:
    """Bring all heaters to a scan before which an edge came to some; return as `_to_scan`."""
    crossings = settles = 0
    for lane in range(lanes_of(rows)):
        line, stretch = loaded_line(rows, lane), loaded_stretch(rows, lane)
        left = factors(t - stretch.now, plant_of(line)).outer
        y = left_of(stretch.y, stretch.target, left if loaded_point(rows, lane).busy else line.whole)
        stored_point(rows, lane, Point(t, y, False))
        through_it, into_it = _limits(rows, lane, stretch, t, y, held)
        crossings, settles = crossings + through_it, settles + into_it
    return crossings, settles


def _limits(rows: Places, lane: int, stretch: LaneStretch, now: float, y: float, held: PhaseLimits) -> tuple[int, int]:
    """Return, as 1 or 0, whether a heater comes through the setpoint, and whether into the band."""
    before, after = flow_of(stretch, stretch.now, stretch.y), flow_of(stretch, now, y)
    return (int(through(held.setpoint, before, after)),
            int(settling_time(loaded_seen(rows, lane), held.setpoint, held.band, after)))


def _along(rows: Places, held: PhaseLimits, limits: tuple[int, int]) -> None:
    """Measure the stretches of all loops, of which so many come through the setpoint, and into the band."""
    crossings, settles = limits
    if settles > 0:
        for lane in range(lanes_of(rows)):
            _seen(rows, lane, held, True, True)
    elif crossings > 0:
        for lane in range(lanes_of(rows)):
            _seen(rows, lane, held, True, False)
    else:
        for lane in range(lanes_of(rows)):
            _seen(rows, lane, held, False, False)
    if held.lasts:
        for lane in range(lanes_of(rows)):
            _rests(rows, lane, held.setpoint)
    if held.resting < NEVER:
        enter_ripple(rows, held)


def _seen(rows: Places, lane: int, held: PhaseLimits, crosses: bool, settles: bool) -> None:
    stretch, point = loaded_stretch(rows, lane), loaded_point(rows, lane)
    stored_seen(rows, lane, seen_from(
        loaded_seen(rows, lane), held.setpoint, held.band, 0.0, plant_of(loaded_line(rows, lane)),
        flow_of(stretch, stretch.now, stretch.y), flow_of(stretch, point.now, point.y), crosses, settles))


def _rests(rows: Places, lane: int, setpoint: float) -> None:
    stretch, point = loaded_stretch(rows, lane), loaded_point(rows, lane)
    stored_rest(rows, lane, rested_from(
        loaded_rest(rows, lane), setpoint, plant_of(loaded_line(rows, lane)), flow_of(stretch, stretch.now, stretch.y),
        flow_of(stretch, point.now, point.y)))


def enter_ripple(rows: Places, held: PhaseLimits) -> None:
    """Enter where the stretches end in the PWM periods at rest, each loop in its own."""
    for lane in range(lanes_of(rows)):
        point, i = loaded_point(rows, lane), min(held.first + lane, len(held.high) - 1)
        error, high, low = point.y - held.setpoint, held.high[i], held.low[i]
        number = in_period(held.resting, point.now, held.period, len(high))
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
    rows: Places, parameters: Any, sensor: Any, program: SetpointProgram, asked: Any, calls: int, cycle_start: bool,
    wrong: int,
) -> None:
    """Run the scan of all controllers.

    Args:
        rows: places.
        parameters: what `step` takes.
        sensor: what `measure` takes.
        program: around the controllers.
        asked: setpoint of the phase.
        calls: how many scans there were before this one.
        cycle_start: whether a PWM period begins.
        wrong: see `Meter`.
    """
    due, parameters = moves(program, calls), lane_parameters(parameters)
    for lane in range(lanes_of(rows)):
        state, word = law_loaded(rows, lane)
        reading = measure(sensor, loaded_point(rows, lane).y + loaded_counts(rows, lane).noise)
        word = asked_now(program, asked, calls == 0, due, word, reading)
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
