"""What is done for 32 loops at once; each `for` over them is one that a compiler makes vector instructions of."""

from __future__ import annotations

import math
from typing import Any

from heatertune.plc.pwm import Switches, on_time
from heatertune.proof.kernel import HEAT, changed
from heatertune.proof.lanes.parts import (
    NEVER,
    Counts,
    Edges,
    Extremes,
    Point,
    Stretch,
    Under,
    flow_of,
    left_of,
    loaded_counts,
    loaded_extremes,
    loaded_line,
    loaded_point,
    loaded_rest,
    loaded_seen,
    loaded_stretch,
    loaded_under,
    other,
    plant_of,
    stored_counts,
    stored_edges,
    stored_extremes,
    stored_point,
    stored_rest,
    stored_seen,
    stored_stretch,
    stored_under,
)
from heatertune.proof.lanes.ring import Ring, Window, begun_at, next_edges
from heatertune.proof.lanes.rows import lanes_of
from heatertune.proof.meter import Places, crossing, faults, rested_from, seen_from
from heatertune.proof.plant import factors
from heatertune.proof.program import Program, asked_now, moves

__all__ = [
    "computed", "due_until", "fixed", "law_loaded", "law_stored", "measure", "quickly", "settled", "step",
    "switched", "switches",
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


def fixed(_parameters: Any) -> Any:
    """Stand in for what gives a controller's parameters, see `heatertune.proof.rows.fixed`."""
    raise NotImplementedError


def quickly(
    rows: Places, ring: Ring, window: Window, setpoint: float, band: float, t: float, lasts: bool
) -> None:
    """Bring all heaters to a scan before which nothing happens but edges.

    Args:
        rows: places.
        ring: of the PWM periods.
        window: those of which edges may be felt.
        setpoint: of the phase [°C].
        band: how far from it is still right [°C].
        t: instant of the scan [s].
        lasts: whether the rest of the phase lasts.
    """
    quiet = True
    due = due_until(rows, t)
    while due > 0:
        quiet = False
        _along(rows, setpoint, band, _to_edges(rows, setpoint, band, t), lasts)
        switches(rows, t)
        next_edges(rows, ring, window)
        due = due_until(rows, t)
    crossings = _to_scan(rows, setpoint, band, t) if quiet else _on_to_scan(rows, setpoint, band, t)
    _along(rows, setpoint, band, crossings, lasts)
    settled(rows)


def due_until(rows: Places, t: float) -> int:
    """Return to how many heaters an edge comes until an instant [s]."""
    due = 0
    for lane in range(lanes_of(rows)):
        due += int(loaded_under(rows, lane).due <= t)
    return due


def _to_edges(rows: Places, setpoint: float, band: float, t: float) -> int:
    """Bring the heaters to which one comes until an instant to their next edge; return how many cross a limit."""
    crossings = 0
    for lane in range(lanes_of(rows)):
        line, stretch, due = loaded_line(rows, lane), loaded_stretch(rows, lane), loaded_under(rows, lane).due
        moves = due <= t
        now = due if moves else stretch.now
        left = factors(now - stretch.now, plant_of(line)).outer
        y = left_of(stretch.y, stretch.target, left) if moves else stretch.y
        stored_point(rows, lane, Point(now, y, moves or loaded_point(rows, lane).busy))
        crossings += _crosses(rows, lane, stretch, now, y, setpoint, band)
    return crossings


def _to_scan(rows: Places, setpoint: float, band: float, t: float) -> int:
    """Bring all heaters from one scan to the next; return how many cross a limit."""
    crossings = 0
    for lane in range(lanes_of(rows)):
        stretch = loaded_stretch(rows, lane)
        y = left_of(stretch.y, stretch.target, loaded_line(rows, lane).whole)
        stored_point(rows, lane, Point(t, y, False))
        crossings += _crosses(rows, lane, stretch, t, y, setpoint, band)
    return crossings


def _on_to_scan(rows: Places, setpoint: float, band: float, t: float) -> int:
    """Bring all heaters to a scan before which an edge came to some; return how many cross a limit."""
    crossings = 0
    for lane in range(lanes_of(rows)):
        line, stretch = loaded_line(rows, lane), loaded_stretch(rows, lane)
        left = factors(t - stretch.now, plant_of(line)).outer
        y = left_of(stretch.y, stretch.target, left if loaded_point(rows, lane).busy else line.whole)
        stored_point(rows, lane, Point(t, y, False))
        crossings += _crosses(rows, lane, stretch, t, y, setpoint, band)
    return crossings


def _crosses(rows: Places, lane: int, stretch: Stretch, now: float, y: float, setpoint: float, band: float) -> int:
    return int(crossing(loaded_seen(rows, lane), setpoint, band, flow_of(stretch, stretch.now, stretch.y),
                        flow_of(stretch, now, y)))


def _along(rows: Places, setpoint: float, band: float, crossings: int, lasts: bool) -> None:
    """Measure the stretches of all loops."""
    if crossings > 0:
        for lane in range(lanes_of(rows)):
            _seen(rows, lane, setpoint, band, True)
    else:
        for lane in range(lanes_of(rows)):
            _seen(rows, lane, setpoint, band, False)
    if lasts:
        for lane in range(lanes_of(rows)):
            _rests(rows, lane, setpoint)


def _seen(rows: Places, lane: int, setpoint: float, band: float, crosses: bool) -> None:
    stretch, point = loaded_stretch(rows, lane), loaded_point(rows, lane)
    stored_seen(rows, lane, seen_from(
        loaded_seen(rows, lane), setpoint, band, 0.0, plant_of(loaded_line(rows, lane)),
        flow_of(stretch, stretch.now, stretch.y), flow_of(stretch, point.now, point.y), crosses))


def _rests(rows: Places, lane: int, setpoint: float) -> None:
    stretch, point, extremes = loaded_stretch(rows, lane), loaded_point(rows, lane), loaded_extremes(rows, lane)
    stored_rest(rows, lane, rested_from(
        loaded_rest(rows, lane), setpoint, plant_of(loaded_line(rows, lane)), flow_of(stretch, stretch.now, stretch.y),
        flow_of(stretch, point.now, point.y)))
    error = point.y - setpoint
    stored_extremes(rows, lane, Extremes(max(extremes.high, error), min(extremes.low, error)))


def switches(rows: Places, t: float) -> None:
    """Switch the heaters to which an edge came."""
    for lane in range(lanes_of(rows)):
        line, stretch = loaded_line(rows, lane), loaded_stretch(rows, lane)
        point, u = loaded_point(rows, lane), loaded_under(rows, lane)
        felt = u.due <= t
        new = changed(plant_of(line), flow_of(stretch, point.now, point.y), HEAT, other(stretch.heat))
        stored_stretch(rows, lane, Stretch(
            point.now, point.y, new.target if felt else stretch.target, new.heat if felt else stretch.heat,
            stretch.load, stretch.mains))
        stored_under(rows, lane, Under(
            u.due, u.edge, u.edge if felt else u.last, u.power, u.owed, u.on, u.times, u.happened))


def settled(rows: Places) -> None:
    """Begin the next stretch where the scan is."""
    for lane in range(lanes_of(rows)):
        stretch, point = loaded_stretch(rows, lane), loaded_point(rows, lane)
        stored_stretch(rows, lane, Stretch(
            point.now, point.y, stretch.target, stretch.heat, stretch.load, stretch.mains))


def computed(
    rows: Places, parameters: Any, sensor: Any, program: Program, asked: Any, calls: int, cycle_start: bool, wrong: int,
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
    due, parameters = moves(program, calls), fixed(parameters)
    for lane in range(lanes_of(rows)):
        state, word = law_loaded(rows, lane)
        reading = measure(sensor, loaded_point(rows, lane).y + loaded_counts(rows, lane).noise)
        word = asked_now(program, asked, calls == 0, due, word, reading)
        state, power, _, flags = step(parameters, state, word, reading, cycle_start)
        law_stored(rows, lane, (state, word))
        u = loaded_under(rows, lane)
        none, counts = math.isnan(power), loaded_counts(rows, lane)
        stored_counts(rows, lane, Counts(
            counts.noise, counts.limited + (1.0 if power <= 0.0 or power >= 100.0 else 0.0),
            counts.faults + (1.0 if none else 0.0) + faults(flags & wrong)))
        stored_under(rows, lane, Under(
            u.due, u.edge, u.last, 0.0 if none else power, u.owed, u.on, u.times, u.happened))


def switched(rows: Places, ring: Ring, number: int, pwm: Switches, begin: float, end: float) -> None:
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
