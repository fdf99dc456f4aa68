"""What `heatertune.proof.lanes.passes` does for heaters of one lag, for such of two.

After an edge the temperature of such a heater goes on for a while and turns, and where it is at a level is searched
for. Each step of a search is a pass over all heaters, until the last one is found.
"""

from __future__ import annotations

from heatertune.heater.exact import Factors
from heatertune.proof.lanes.passes import (
    NEVER,
    EdgeWindow,
    Inner,
    LaneStretch,
    PhaseLimits,
    Point,
    Ring,
    StretchEnd,
    begin_stretch,
    due_until,
    enter_ripple,
    flow_of,
    lanes_of,
    loaded_end,
    loaded_inner,
    loaded_line,
    loaded_point,
    loaded_rest,
    loaded_search,
    loaded_second,
    loaded_seen,
    loaded_stretch,
    loaded_under,
    next_edges,
    plant_of,
    stored_end,
    stored_inner,
    stored_point,
    stored_rest,
    stored_search,
    stored_seen,
    stored_stretch,
    switches,
)
from heatertune.proof.meter import (
    Places,
    absolute_by,
    integral,
    phase_after_known,
    phase_after_stretch,
    rested_from,
    settling_time,
    through,
)
from heatertune.proof.plant import (
    MOST_ROUNDS,
    CrossingSearch,
    Flow,
    Plant,
    advance_heater,
    closer,
    factors,
    searched_from,
    turn,
)

__all__ = ["quickly"]


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
        _along(rows, limits, _to_edges(rows, t))
        switches(rows, t)
        _settled(rows)
        next_edges(rows, ring, window)
        due = due_until(rows, t)
    _along(rows, limits, _to_scan(rows, t) if quiet else _on_to_scan(rows, t))
    begin_stretch(rows)
    _settled(rows)


def _plant(rows: Places, lane: int) -> Plant:
    return plant_of(loaded_line(rows, lane), loaded_second(rows, lane))


def _before(rows: Places, lane: int) -> Flow:
    stretch = loaded_stretch(rows, lane)
    return flow_of(stretch, stretch.now, stretch.y, loaded_inner(rows, lane).x)


def _after(rows: Places, lane: int) -> Flow:
    point = loaded_point(rows, lane)
    return flow_of(loaded_stretch(rows, lane), point.now, point.y, loaded_inner(rows, lane).at)


def _arrived(rows: Places, lane: int, before: Flow, after: Flow, busy: bool) -> int:
    """Keep where a heater gets; return whether it may turn on the way."""
    stored_point(rows, lane, Point(after.now, after.y, busy))
    stored_inner(rows, lane, Inner(before.x, after.x))
    return int((before.x - before.y) * (after.x - after.y) < 0.0)


def _to_edges(rows: Places, t: float) -> int:
    """Bring the heaters to which one comes until an instant to their next edge; return how many may turn."""
    turns = 0
    for lane in range(lanes_of(rows)):
        before, due = _before(rows, lane), loaded_under(rows, lane).due
        moves = due <= t
        now = due if moves else before.now
        there = advance_heater(before, now, factors(now - before.now, _plant(rows, lane)))
        after = Flow(now, there.y if moves else before.y, there.x if moves else before.x, before.target, before.heat,
                     before.load, before.mains)
        turns += _arrived(rows, lane, before, after, moves or loaded_point(rows, lane).busy)
    return turns


def _to_scan(rows: Places, t: float) -> int:
    """Bring all heaters from one scan to the next; return how many may turn."""
    turns = 0
    for lane in range(lanes_of(rows)):
        before, second = _before(rows, lane), loaded_second(rows, lane)
        whole = Factors(loaded_line(rows, lane).whole, second.coupling, second.inner)
        turns += _arrived(rows, lane, before, advance_heater(before, t, whole), False)
    return turns


def _on_to_scan(rows: Places, t: float) -> int:
    """Bring all heaters to a scan before which an edge came to some; return how many may turn."""
    turns = 0
    for lane in range(lanes_of(rows)):
        before, second, busy = _before(rows, lane), loaded_second(rows, lane), loaded_point(rows, lane).busy
        part = factors(t - before.now, _plant(rows, lane))
        left = Factors(part.outer if busy else loaded_line(rows, lane).whole,
                       part.coupling if busy else second.coupling, part.inner if busy else second.inner)
        turns += _arrived(rows, lane, before, advance_heater(before, t, left), False)
    return turns


def _settled(rows: Places) -> None:
    """Begin the next stretch where the last one ended."""
    for lane in range(lanes_of(rows)):
        x = loaded_inner(rows, lane).at
        stored_inner(rows, lane, Inner(x, x))


def _along(rows: Places, limits: PhaseLimits, turns: int) -> None:
    """Measure the stretches of all loops, up to the turn and from it on where there is one."""
    if turns > 0:
        _to_turns(rows)
        _measured(rows, limits)
        _from_turns(rows)
    _measured(rows, limits)


def _to_turns(rows: Places) -> None:
    """Let the stretches end where the heaters turn, or where they begin; keep where they ended."""
    for lane in range(lanes_of(rows)):
        before, after, plant = _before(rows, lane), _after(rows, lane), _plant(rows, lane)
        now = turn(before, after, plant)
        turns = before.now < now < after.now
        top = advance_heater(before, now, factors(now - before.now, plant))
        stored_end(rows, lane, StretchEnd(after.now, after.y, after.x))
        busy = loaded_point(rows, lane).busy
        stored_point(rows, lane, Point(now if turns else before.now, top.y if turns else before.y, busy))
        stored_inner(rows, lane, Inner(before.x, top.x if turns else before.x))


def _from_turns(rows: Places) -> None:
    """Let the stretches begin where they ended, and end where they did before."""
    for lane in range(lanes_of(rows)):
        stretch, point, end = loaded_stretch(rows, lane), loaded_point(rows, lane), loaded_end(rows, lane)
        stored_stretch(rows, lane, LaneStretch(
            point.now, point.y, stretch.target, stretch.heat, stretch.load, stretch.mains))
        stored_inner(rows, lane, Inner(loaded_inner(rows, lane).at, end.x))
        stored_point(rows, lane, Point(end.now, end.y, point.busy))


def _measured(rows: Places, limits: PhaseLimits) -> None:
    """Measure stretches on which no heater turns."""
    crossings = settles = 0
    for lane in range(lanes_of(rows)):
        after = _after(rows, lane)
        crossings += int(through(limits.setpoint, _before(rows, lane), after))
        settles += int(settling_time(loaded_seen(rows, lane), limits.setpoint, limits.band, after))
    if settles > 0:
        for lane in range(lanes_of(rows)):
            _measure_stretch(rows, lane, limits, True)
    elif crossings > 0:
        _search_crossings(rows, limits.setpoint)
        for lane in range(lanes_of(rows)):
            _split(rows, lane, limits.setpoint, limits.band)
    else:
        for lane in range(lanes_of(rows)):
            _measure_stretch(rows, lane, limits, False)
    if limits.lasts:
        for lane in range(lanes_of(rows)):
            _rests(rows, lane, limits.setpoint)
    if limits.resting < NEVER:
        enter_ripple(rows, limits)


def _measure_stretch(rows: Places, lane: int, limits: PhaseLimits, crosses: bool) -> None:
    stored_seen(rows, lane, phase_after_stretch(
        loaded_seen(rows, lane), limits.setpoint, limits.band, 0.0, _plant(rows, lane), _before(rows, lane),
        _after(rows, lane), crosses, crosses))


def _search_crossings(rows: Places, setpoint: float) -> None:
    """Search for the instants at which heaters cross the setpoint."""
    for lane in range(lanes_of(rows)):
        before, after = _before(rows, lane), _after(rows, lane)
        s = searched_from(before, after, setpoint, _plant(rows, lane))
        stored_search(rows, lane,
                      CrossingSearch(s.low, s.high, s.now, s.y, s.x, False, not through(setpoint, before, after)))
    rounds, missing = 0, 1
    while missing > 0 and rounds < MOST_ROUNDS:
        rounds, missing = rounds + 1, 0
        for lane in range(lanes_of(rows)):
            s = loaded_search(rows, lane)
            n = closer(_before(rows, lane), _after(rows, lane), setpoint, _plant(rows, lane), s)
            stored_search(rows, lane, CrossingSearch(
                s.low if s.is_crossed else n.low, s.high if s.is_crossed else n.high, s.now if s.is_crossed else n.now,
                s.y if s.is_crossed else n.y, s.x if s.is_crossed else n.x, n.last, s.is_crossed or n.is_crossed))
            missing += int(not (s.is_crossed or n.is_crossed))


def _split(rows: Places, lane: int, setpoint: float, band: float) -> None:
    """Measure a stretch on which the setpoint is crossed where it was found, in others not at all."""
    stats, s, plant = loaded_seen(rows, lane), loaded_search(rows, lane), _plant(rows, lane)
    before, after = _before(rows, lane), _after(rows, lane)
    there = Flow(s.now, s.y, s.x, before.target, before.heat, before.load, before.mains)
    split, whole = absolute_by(setpoint, plant, before, there, after), abs(integral(setpoint, plant, before, after))
    stored_seen(rows, lane, phase_after_known(
        stats, setpoint, band, 0.0, after.y, stats.settled, split if through(setpoint, before, after) else whole))


def _rests(rows: Places, lane: int, setpoint: float) -> None:
    stored_rest(rows, lane, rested_from(
        loaded_rest(rows, lane), setpoint, _plant(rows, lane), _before(rows, lane), _after(rows, lane)))
