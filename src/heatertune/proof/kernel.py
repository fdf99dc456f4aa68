"""The closed loop, event by event: scans, PWM edges and disturbances, each at its exact instant.

Plain functions of numbers, run as they are or compiled (`heatertune.compiled`), the same bit for bit. Nothing is
allocated: what is kept goes to places made before, and edges under way to the heater stand in a ring. A loop may keep
a trace (`Record`), be measured while it runs (`proof.meter`), or both.
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

from heatertune.compiled.plain_functions import cold_state, measure, step, warm_state
from heatertune.plc.pwm import INSTANT_S, Switches
from heatertune.proof.meter import (
    FAULTS,
    LIMITED,
    NOT_LED,
    SCANS,
    SWITCHINGS,
    Meter,
    PhaseStats,
    Places,
    SteadyStateStats,
    begin,
    close,
    faults,
    is_led,
    led_to,
    rest_begins,
    seen_on,
    update_rest,
)
from heatertune.proof.plant import Flow, Plant, advance_heater, factors, plant_from, turn
from heatertune.proof.setpoint_program import SetpointProgram, asked_now, moves
from heatertune.proof.switch_edges import AS_TOLD, as_strong, edge_at, heat_after, period_of, switched_off, times_on

__all__ = [
    "HEAT",
    "JUMP",
    "LOAD",
    "MAINS",
    "PHASE",
    "REST",
    "Events",
    "LoopBatch",
    "ScanClock",
    "TraceArrays",
    "apart",
    "apply_event",
    "end_phase",
    "measure",
    "measure_interval",
    "run",
    "run_all",
    "step",
    "ticked_on",
]

#: what an event does: all lags jump, the load grows, the mains change, the heater is switched, a phase begins (as it
#: does with a jump), the rest of a phase begins
JUMP: Final = 0
LOAD: Final = 1
MAINS: Final = 2
HEAT: Final = 3
PHASE: Final = 4
REST: Final = 5


class Events(NamedTuple):
    """What happens beside the switch, in order of time and kind, at least one event; the last instant is infinite.

    `leads` tells how the setpoint is led, see `Meter.leads`.
    """

    time: Places
    kind: Places
    value: Places
    leads: Places = NOT_LED


class ScanClock(NamedTuple):
    """The scans: interval [s], how many, and for each noise [°C] and delay [s].

    One number of noise or delay serves all scans.
    """

    scan_s: float
    scans: int
    noise: Places
    late: Places


class TraceArrays(NamedTuple):
    """Whether a trace is kept, and places for it: one per scan, one per stretch of constant power, the first at 0."""

    keeps: bool
    temperature: Places
    followed: Places
    reading: Places
    power: Places
    flags: Places
    since: Places
    outer: Places
    inner: Places
    target: Places


class LoopBatch(NamedTuple):
    """Many loops of one controller: what differs between them, one row for each; see `run` for the meaning.

    Of a plant the numbers of `Plant` and the temperature at the start. One row of noise or delays may serve all, and
    one number of `cooling`, by which the cooler's power is multiplied.
    """

    scans: int
    noise: Places
    late: Places
    plants: Places
    event_time: Places
    event_kind: Places
    event_value: Places
    leads: Places = NOT_LED
    cooling: Places = AS_TOLD


def run(  # noqa: PLR0913 - compiled for the types of each: one value of them all would be as many fields again
    parameters: Any, state: Any, sensor: Any, clock: ScanClock, program: SetpointProgram, plant: Plant, start: float,
    events: Events, pwm: Switches, cut: float, edges: Places, record: TraceArrays, meter: Meter,
) -> tuple[int, int]:
    """Run the loop over all scans; scans and PWM periods both begin at 0, and the periods anew at each start-up.

    The power asked for last when a PWM period begins holds for that period; at equal instants the scan is first.
    Without supply no scan is run, and the power asked for is 0.

    Args:
        parameters: what `step` takes.
        state: what `step` begins with.
        sensor: what `measure` takes.
        clock: the scans; each is late by less than the interval.
        program: what is asked of the controller.
        plant: the heater.
        start: temperature of all lags at 0 [°C].
        events: beside the switch.
        pwm: `Actuator.switches`.
        cut: instant from which on an interlock keeps the heater off [s].
        edges: a ring, see `heatertune.proof.switch_edges`; its length is a power of two.
        record: places for the trace.
        meter: places for what is measured.

    Returns:
        How often the heater was switched, and how many stretches of constant power there were.
    """
    scan_s, late, noise, cold = clock.scan_s, clock.late, clock.noise, state
    leads, shaken, noisy = events.leads, len(late) > 1, len(noise) > 1
    whole, period, least = factors(scan_s, plant), pwm.heat[0], -100.0 if pwm.cooling > 0.0 else 0.0
    flow = Flow(0.0, start, start, plant.ambient, 0.0, 0.0, 1.0)
    owed, begin, tick, origin = (0.0, 0.0), 0.0, 0.0, 0.0
    begun = ticked = switched = arrived = happened = phase = calls = 0
    rows, t, following, word = _stretch(record, 0, flow), late[0], 0.0, program.setpoints[0]
    seen, rest = _begin(meter, start)
    due, kind = _next(plant, events, happened, edges, arrived, switched)
    for k in range(clock.scans):
        # the time between two scans is a whole interval where neither is late and nothing happens between them
        quiet = k > 0 and (not shaken or late[k] == late[k - 1])
        while due <= t:
            quiet = False
            before = advance_heater(flow, due, factors(due - flow.now, plant))
            seen, rest = measure_interval(meter, seen, rest, plant, flow, before)
            value = heat_after(edges, arrived, pwm.cooling) if kind == HEAT else events.value[happened]
            flow = apply_event(plant, before, kind, value)
            seen, rest = end_phase(meter, seen, rest, flow, kind)
            arrived, happened = arrived + (kind == HEAT), happened + (kind != HEAT)
            phase += _begins_phase(kind)
            rows = _stretch(record, rows, flow) if kind <= HEAT else rows
            due, kind = _next(plant, events, happened, edges, arrived, switched)
        before, flow = flow, advance_heater(flow, t, whole if quiet else factors(t - flow.now, plant))
        seen, rest = measure_interval(meter, seen, rest, plant, before, flow)
        reading = measure(sensor, flow.y + (noise[k] if noisy else noise[0]))
        if calls == 0 and k > 0 and program.supplied[phase] and apart(begin, k * scan_s, period):
            origin, begin, tick, begun, ticked = t, t, t, 0, 0
        cycle_start = tick <= t + INSTANT_S
        ticked, tick = ticked_on(origin, ticked, tick, t, period)
        power, flags = 0.0, 0
        if program.supplied[phase]:
            if calls == 0 and k > 0:
                state = warm_state(parameters, cold, state)
            program.setpoints[phase] = (
                measure(sensor, led_to(leads, phase, t)) if is_led(leads, phase) else program.setpoints[phase])
            word = asked_now(program, program.setpoints[phase], calls == 0, moves(program, calls), word, reading)
            calls += 1
            state, power, _, flags = step(parameters, state, word, reading, cycle_start)
            _counted(meter, power, least, flags)
        else:
            switched, calls = switched_off(edges, switched, t), 0
        _scanned(record, k, flow.y, word, reading, power, flags)
        power = 0.0 if math.isnan(power) else power  # which the meter has counted as a fault
        following = (k + 1) * scan_s + (late[min(k + 1, len(late) - 1)] if shaken else late[0])
        while begin < following - INSTANT_S:
            switched, owed = period_of(edges, switched, begin, power, owed, pwm, cut)
            begun += 1
            begin = origin + begun * period
        due, kind = _next(plant, events, happened, edges, arrived, switched)
        t = following
    _end(meter, seen, rest, edges, switched, flow.now)
    return switched, rows


def run_all(  # noqa: PLR0913 - as `run`
    parameters: Any, state: Any, sensor: Any, scan_s: float, program: SetpointProgram, batch: LoopBatch,
    pwm: Switches, cut: float, edges: Places, record: TraceArrays, meter: Meter,
) -> tuple[int, int]:
    """Run many loops, one after the other; return what `run` returns of the last one.

    Args:
        parameters: as for `run`, like all that is not told here.
        state: likewise.
        sensor: likewise.
        scan_s: [s].
        program: likewise.
        batch: what differs.
        pwm: `Actuator.switches`.
        cut: [s].
        edges: one ring for all of them.
        record: places of one trace: that of the last loop stays.
        meter: its phases, totals, high and low have one row for each loop.
    """
    counted = 0, 0
    for i in range(len(batch.plants)):
        row = batch.plants[i]
        noise, late = batch.noise[i % len(batch.noise)], batch.late[i % len(batch.late)]
        counted = run(
            parameters, cold_state(parameters, state), sensor, ScanClock(scan_s, batch.scans, noise, late), program,
            plant_from(row[0], row[1], row[2], row[3], row[4]), row[5],
            Events(batch.event_time[i], batch.event_kind[i], batch.event_value[i], batch.leads),
            as_strong(pwm, batch.cooling[i % len(batch.cooling)]), cut, edges, record,
            Meter(meter.measures, meter.setpoints, meter.band, meter.period, meter.wrong, meter.phases[i],
                  meter.totals[i], meter.high[i], meter.low[i], meter.leads),
        )
    return counted


def _next(
    plant: Plant, events: Events, happened: int, edges: Places, arrived: int, switched: int
) -> tuple[float, int]:
    """Return instant and kind of what happens next; at one instant jumps and loads come before the switch."""
    due, kind = events.time[happened], events.kind[happened]
    if arrived < switched:
        edge = edge_at(edges, arrived) + plant.dead
        if edge < due or (edge == due and kind > HEAT):
            return edge, HEAT
    return due, kind


def apply_event(plant: Plant, flow: Flow, kind: int, value: float) -> Flow:
    """Return the heater just after an event; the mains are those of the heater, not of a cooler."""
    heat, load, mains, jump = flow.heat, flow.load, flow.mains, 0.0
    if kind == HEAT:
        heat = value
    elif kind == LOAD:
        load += value
    elif kind == MAINS:
        mains = value
    elif kind == JUMP:
        jump = value
    target = plant.ambient + plant.gain * ((heat * mains if heat > 0.0 else heat) + load)
    return Flow(flow.now, flow.y + jump, flow.x + jump, target, heat, load, mains)


def _begins_phase(kind: int) -> int:
    return int(kind in (JUMP, PHASE))


def apart(begin: float, starts: float, period: float) -> bool:
    """Return whether a start-up is no instant at which a PWM period begins.

    Args:
        begin: of the next PWM period [s].
        starts: instant of the start-up [s].
        period: PWM period [s].
    """
    return min(abs(begin - starts), abs(begin - starts - period)) > INSTANT_S


def ticked_on(origin: float, ticked: int, tick: float, now: float, period: float) -> tuple[int, float]:
    """Return how many PWM periods have begun up to an instant, and when the next one begins.

    Args:
        origin: begin of the first PWM period [s].
        ticked: periods begun so far.
        tick: begin of the next one [s].
        now: what is common to the loops.
        period: PWM period [s].
    """
    while tick <= now + INSTANT_S:
        ticked += 1
        tick = origin + ticked * period
    return ticked, tick


def _stretch(record: TraceArrays, rows: int, flow: Flow) -> int:
    """Keep the begin of a stretch of constant power; return how many there are."""
    if record.keeps:
        record.since[rows] = flow.now
        record.outer[rows] = flow.y
        record.inner[rows] = flow.x
        record.target[rows] = flow.target
    return rows + 1


def _scanned(record: TraceArrays, k: int, y: float, followed: Any, reading: Any, power: float, flags: int) -> None:
    """Keep what one scan gave."""
    if record.keeps:
        record.temperature[k] = y
        record.followed[k] = followed
        record.reading[k] = reading
        record.power[k] = power
        record.flags[k] = flags


def _counted(meter: Meter, power: float, least: float, flags: int) -> None:
    """Count one scan; `least` is the least power that can be asked for."""
    if meter.measures:
        meter.totals[SCANS] += 1.0
        if power <= least or power >= 100.0:
            meter.totals[LIMITED] += 1.0
        if math.isnan(power):
            meter.totals[FAULTS] += 1.0
        if flags & meter.wrong:
            meter.totals[FAULTS] += faults(flags & meter.wrong)


def _begin(meter: Meter, start: float) -> tuple[PhaseStats, SteadyStateStats]:
    """Return what is measured at the start."""
    error = start - meter.setpoints[0] if meter.measures else 0.0
    return begin(meter, 0, 0.0, error), SteadyStateStats(False, 0.0, 0.0, 0.0, 0.0)


def measure_interval(
    meter: Meter, seen: PhaseStats, rest: SteadyStateStats, plant: Plant, before: Flow, after: Flow
) -> tuple[PhaseStats, SteadyStateStats]:
    """Measure the time between two instants, up to the turn and from it on where there is one.

    Args:
        meter: what is measured.
        seen: the phase so far.
        rest: the rest so far.
        plant: the heater.
        before: at the stretch's begin.
        after: at its end.
    """
    if not meter.measures:
        return seen, rest
    turned = turn(before, after, plant)
    if before.now < turned < after.now:
        top = advance_heater(before, turned, factors(turned - before.now, plant))
        seen = seen_on(meter, seen, plant, before, top)
        rest = update_rest(meter, seen.phase, rest, plant, before, top) if rest.lasts else rest
        before = top
    seen = seen_on(meter, seen, plant, before, after)
    return seen, update_rest(meter, seen.phase, rest, plant, before, after) if rest.lasts else rest


def end_phase(meter: Meter, seen: PhaseStats, rest: SteadyStateStats, flow: Flow, kind: int) -> tuple[PhaseStats,
                                                                                                      SteadyStateStats]:
    """End a phase and begin the next one, or begin the rest, where an event does so.

    Args:
        meter: what is measured.
        seen: the phase so far.
        rest: the rest so far.
        flow: the heater.
        kind: of the event.
    """
    if not meter.measures:
        return seen, rest
    if kind == REST:
        return seen, rest_begins(meter, seen.phase, flow.now, flow.y - meter.setpoints[seen.phase])
    if _begins_phase(kind):
        rest, phase = close(meter, seen, rest), seen.phase + 1
        return begin(meter, phase, flow.now, flow.y - meter.setpoints[phase]), rest
    return seen, rest


def _end(meter: Meter, seen: PhaseStats, rest: SteadyStateStats, edges: Places, switched: int, end: float) -> None:
    """Write down the last phase, and how often the heater was switched on until the end."""
    if not meter.measures:
        return
    close(meter, seen, rest)
    meter.totals[SWITCHINGS] = float(times_on(edges, switched, end))
