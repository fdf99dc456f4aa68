"""The closed loop, event by event: scans, PWM edges and disturbances, each at its exact instant.

Plain functions of numbers, named tuples and sequences, run as they are or compiled (`heatertune.compiled`); both give
the same, bit for bit. Nothing is allocated: what is kept goes to places made before, and edges under way to the heater
stand in a ring. A loop may keep a trace (`Record`), be measured while it runs (`proof.meter`), or both.
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

from heatertune.proof.meter import (
    FAULTS,
    LIMITED,
    SWITCHINGS,
    Meter,
    Places,
    Rest,
    Seen,
    begin,
    close,
    rest_begins,
    rested,
    seen_on,
)
from heatertune.proof.plant import Flow, Plant, factors, moved, turn
from heatertune.proof.pwm import INSTANT_S, on_time

__all__ = [
    "HEAT", "JUMP", "LOAD", "PHASE", "REST", "Batch", "Clock", "Events", "Record", "measure", "run", "run_all", "step",
]

#: what an event does: all lags jump, the load grows, the heater is switched; the others only divide what is measured
JUMP: Final = 0
LOAD: Final = 1
HEAT: Final = 2
PHASE: Final = 3
REST: Final = 4


class Events(NamedTuple):
    """What happens beside the switch, in order of time and kind, at least one event; the last instant is infinite."""

    time: Places
    kind: Places
    value: Places


class Clock(NamedTuple):
    """The scans: interval [s], and for each the setpoint in the controller's units, noise [°C] and delay [s].

    One number of noise or delay serves all scans.
    """

    scan_s: float
    setpoints: Places
    noise: Places
    late: Places


class Record(NamedTuple):
    """Whether a trace is kept, and places for it: one per scan, one per stretch of constant power, the first at 0."""

    keeps: bool
    temperature: Places
    reading: Places
    power: Places
    flags: Places
    since: Places
    outer: Places
    inner: Places
    target: Places


class Batch(NamedTuple):
    """Many loops of one controller: what differs between them, one row for each; see `run` for the meaning.

    Of a plant the numbers of `Plant` and the temperature at the start. One row of setpoints, noise
    or delays may serve all.
    """

    setpoints: Places
    noise: Places
    late: Places
    plants: Places
    event_time: Places
    event_kind: Places
    event_value: Places


def step(_parameters: Any, _state: Any, _setpoint: Any, _reading: Any, _cycle_start: bool) -> tuple[Any, ...]:
    """Stand in for a controller's own, see `heatertune.plc.core.Core` and `heatertune.compiled.bound`."""
    raise NotImplementedError


def measure(_sensor: Any, _temperature: float) -> Any:
    """Stand in likewise."""
    raise NotImplementedError


def run(
    parameters: Any, state: Any, sensor: Any, clock: Clock, plant: Plant, start: float, events: Events,
    pwm: tuple[float, float, float, float, bool], cut: float, edges: Places, record: Record, meter: Meter,
) -> tuple[int, int]:
    """Run the loop over all scans; scans and PWM periods both begin at 0.

    The power asked for last when a PWM period begins holds for that period; at equal instants the scan is first.

    Args:
        parameters: what `step` takes.
        state: what `step` begins with.
        sensor: what `measure` takes.
        clock: the scans; each is late by less than the interval.
        plant: the heater.
        start: temperature of all lags at 0 [°C].
        events: beside the switch.
        pwm: `Actuator.numbers`.
        cut: instant from which on an interlock keeps the heater off [s].
        edges: ring of the instants at which the heater is switched, on and off in turn; its length is a power of two.
        record: places for the trace.
        meter: places for what is measured.

    Returns:
        How often the heater was switched, and how many stretches of constant power there were.
    """
    scan_s, late, noise = clock.scan_s, clock.late, clock.noise
    shaken, noisy = len(late) > 1, len(noise) > 1
    whole = factors(scan_s, plant)
    flow = Flow(0.0, start, start, plant.ambient, 0.0, 0.0)
    carried = begin = tick = 0.0
    begun = ticked = switched = arrived = happened = 0
    rows = _stretch(record, 0, flow)
    seen, rest = _begin(meter, start)
    t, following = late[0], 0.0
    due, kind = _next(plant, events, happened, edges, arrived, switched)
    for k in range(len(clock.setpoints)):
        # the time between two scans is a whole interval where neither is late and nothing happens between them
        quiet = k > 0 and (not shaken or late[k] == late[k - 1])
        while due <= t:
            quiet = False
            before = moved(flow, due, factors(due - flow.now, plant))
            seen, rest = _measured(meter, seen, rest, plant, flow, before)
            flow = _changed(plant, before, kind, events.value[happened], arrived)
            seen, rest = _divided(meter, seen, rest, flow, kind)
            arrived, happened = arrived + (kind == HEAT), happened + (kind != HEAT)
            if kind <= HEAT:
                rows = _stretch(record, rows, flow)
            due, kind = _next(plant, events, happened, edges, arrived, switched)
        before, flow = flow, moved(flow, t, whole if quiet else factors(t - flow.now, plant))
        seen, rest = _measured(meter, seen, rest, plant, before, flow)
        reading = measure(sensor, flow.y + (noise[k] if noisy else noise[0]))
        cycle_start = tick <= t + INSTANT_S
        while tick <= t + INSTANT_S:
            ticked += 1
            tick = ticked * pwm[0]
        state, power, _, flags = step(parameters, state, clock.setpoints[k], reading, cycle_start)
        _scanned(record, meter, k, flow.y, reading, power, flags)
        power = 0.0 if math.isnan(power) else power  # which the meter has counted as a fault
        following = (k + 1) * scan_s + (late[min(k + 1, len(late) - 1)] if shaken else late[0])
        if begin < following - INSTANT_S:
            while begin < following - INSTANT_S:
                on, carried = on_time(power, carried, pwm)
                switched = _pulse(edges, switched, begin, min(on, cut - begin), pwm[0])
                begun += 1
                begin = begun * pwm[0]
            due, kind = _next(plant, events, happened, edges, arrived, switched)
        t = following
    _end(meter, seen, rest, edges, switched, flow.now)
    return switched, rows


def run_all(
    parameters: Any, state: Any, sensor: Any, scan_s: float, batch: Batch,
    pwm: tuple[float, float, float, float, bool], cut: float, edges: Places, record: Record, meter: Meter,
) -> tuple[int, int]:
    """Run many loops, one after the other; return what `run` returns of the last one.

    Args:
        parameters: as for `run`, like all that is not told here.
        state: likewise.
        sensor: likewise.
        scan_s: [s].
        batch: what differs.
        pwm: `Actuator.numbers`.
        cut: [s].
        edges: one ring for all of them.
        record: places of one trace: that of the last loop stays.
        meter: its phases, totals, high and low have one row for each loop.
    """
    found = 0, 0
    for i in range(len(batch.plants)):
        row = batch.plants[i]
        setpoints = batch.setpoints[i % len(batch.setpoints)]
        noise, late = batch.noise[i % len(batch.noise)], batch.late[i % len(batch.late)]
        found = run(
            parameters, state, sensor, Clock(scan_s, setpoints, noise, late),
            Plant(row[0], row[1], row[2], row[3], row[4]), row[5],
            Events(batch.event_time[i], batch.event_kind[i], batch.event_value[i]), pwm, cut, edges, record,
            Meter(meter.measures, meter.setpoint, meter.band, meter.period, meter.wrong, meter.phases[i],
                  meter.totals[i], meter.high[i], meter.low[i]),
        )
    return found


def _next(
    plant: Plant, events: Events, happened: int, edges: Places, arrived: int, switched: int
) -> tuple[float, int]:
    """Return instant and kind of what happens next; at one instant jumps and loads come before the switch."""
    due, kind = events.time[happened], events.kind[happened]
    if arrived < switched:
        edge = edges[arrived & (len(edges) - 1)] + plant.dead
        if edge < due or (edge == due and kind > HEAT):
            return edge, HEAT
    return due, kind


def _changed(plant: Plant, flow: Flow, kind: int, value: float, arrived: int) -> Flow:
    """Return the heater just after an event; edges alternate, so their number tells whether it gets hot."""
    heat, load, jump = flow.heat, flow.load, 0.0
    if kind == HEAT:
        heat = 0.0 if arrived % 2 else 100.0
    elif kind == LOAD:
        load += value
    elif kind == JUMP:
        jump = value
    return Flow(flow.now, flow.y + jump, flow.x + jump, plant.ambient + plant.gain * (heat + load), heat, load)


def _pulse(
    edges: Places, switched: int, begin: float, on: float, period: float
) -> int:
    """Switch for one period, where the heater is not in that state already; return how often it was switched so far."""
    last = len(edges) - 1
    if on > 0.0 and switched % 2 == 0:
        edges[switched & last] = begin
        switched += 1
    if on < period and switched % 2 == 1:
        edges[switched & last] = begin + on
        switched += 1
    return switched


def _stretch(record: Record, rows: int, flow: Flow) -> int:
    """Keep the begin of a stretch of constant power; return how many there are."""
    if record.keeps:
        record.since[rows] = flow.now
        record.outer[rows] = flow.y
        record.inner[rows] = flow.x
        record.target[rows] = flow.target
    return rows + 1


def _scanned(
    record: Record, meter: Meter, k: int, y: float, reading: Any, power: float, flags: int
) -> None:
    """Keep and count what one scan gave."""
    if record.keeps:
        record.temperature[k] = y
        record.reading[k] = reading
        record.power[k] = power
        record.flags[k] = flags
    if meter.measures:
        if power <= 0.0 or power >= 100.0:
            meter.totals[LIMITED] += 1.0
        if math.isnan(power):
            meter.totals[FAULTS] += 1.0
        wrong = flags & meter.wrong
        while wrong:
            meter.totals[FAULTS] += 1.0
            wrong &= wrong - 1


def _begin(meter: Meter, start: float) -> tuple[Seen, Rest]:
    """Return what is measured at the start."""
    return begin(0, 0.0, start - meter.setpoint, meter.band), Rest(False, 0.0, 0.0, 0.0, 0.0)


def _measured(
    meter: Meter, seen: Seen, rest: Rest, plant: Plant, before: Flow, after: Flow
) -> tuple[Seen, Rest]:
    """Measure the time between two instants, up to the turn and from it on where there is one."""
    if not meter.measures:
        return seen, rest
    turned = turn(before, after, plant)
    if before.now < turned < after.now:
        top = moved(before, turned, factors(turned - before.now, plant))
        seen = seen_on(meter, seen, plant, before, top)
        rest = rested(meter, rest, plant, before, top) if rest.lasts else rest
        before = top
    seen = seen_on(meter, seen, plant, before, after)
    return seen, rested(meter, rest, plant, before, after) if rest.lasts else rest


def _divided(meter: Meter, seen: Seen, rest: Rest, flow: Flow, kind: int) -> tuple[Seen, Rest]:
    """End a phase and begin the next one, or begin the rest, where an event does so."""
    if not meter.measures:
        return seen, rest
    error = flow.y - meter.setpoint
    if kind == REST:
        return seen, rest_begins(meter, flow.now, error)
    if kind in (JUMP, PHASE):
        rest = close(meter, seen, rest)
        return begin(seen.phase + 1, flow.now, error, meter.band), rest
    return seen, rest


def _end(
    meter: Meter, seen: Seen, rest: Rest, edges: Places, switched: int, end: float
) -> None:
    """Write down the last phase, and how often the heater was switched on until the end."""
    if not meter.measures:
        return
    close(meter, seen, rest)
    times = (switched + 1) // 2
    while times > 0 and edges[2 * (times - 1) & (len(edges) - 1)] > end:
        times -= 1
    meter.totals[SWITCHINGS] = float(times)
