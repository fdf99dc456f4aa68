"""The closed loop, event by event: scans, PWM edges and disturbances, each at its exact instant.

Plain functions of numbers, run as they are or compiled (`heatertune.compiled`) with bit-identical results. Nothing is
allocated: results go to arrays made before the run. A loop may keep a trace (`TraceArrays`), be measured while it runs
(`proof.meter`), or both.

The setpoint word follows its target at once or on a ramp, as in `heatertune.plc.ramp`. Edges of the switch on their
way to the heater stand in a ring of instants [s], on and off in turn; a minus sign (also on 0) marks an instant at
which the cooler, not the heater, is switched on.
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

import numpy as np

from heatertune.compiled.plain_functions import cold_state, measure, setpoint_word, step, warm_state
from heatertune.plc.pwm import INSTANT_S, Switches, on_time
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
    phase_after_monotone,
    rest_begins,
    update_rest,
)
from heatertune.proof.plant import (
    AGAIN,
    Flow,
    LossPlant,
    Plant,
    advance_heater,
    factors,
    is_linear,
    linear_plant,
    turn,
    unchanged,
)

__all__ = [
    "AS_TOLD", "HEAT", "JUMP", "LOAD", "MAINS", "PHASE", "REST", "Events", "LoopBatch", "ScanClock",
    "SetpointProgram", "TraceArrays", "apart", "apply_event", "as_strong", "edge_at", "end_phase", "heat_after",
    "keep_nothing", "keep_tangent", "measure", "measure_interval", "moves", "next_event", "next_with_tangent",
    "period_of", "run", "run_all", "setpoint_word_now", "step", "switched_off", "ticked_on", "times_on",
]


class SetpointProgram(NamedTuple):
    """The program around the controller, which sets its setpoint word; all numbers are in the controller's units.

    Attributes:
        asked: setpoint of each phase.
        supplied: whether the PLC has its supply in each phase; where it has it again, it starts up.
        ramp_step, ramp_calls, ramp_hold: of the words' setpoint ramp, see `heatertune.plc.ramp.Ramp`; no calls: no
            ramp; a hold of 0: none; one below zero: a cooler's, the mirror image.
    """

    setpoints: Places
    supplied: Places
    ramp_step: Any
    ramp_calls: int
    ramp_hold: Any


def moves(program: SetpointProgram, calls: int) -> bool:
    """Return whether the ramp makes a step at a call of the controller, `calls` others being before it."""
    return program.ramp_calls > 0 and (calls + 1) % program.ramp_calls == 0


def setpoint_word_now(program: SetpointProgram, target: Any, first: bool, due: bool, word: Any, reading: Any) -> Any:
    """Return the setpoint word for a call of the controller.

    Args:
        program: around it.
        target: setpoint of the phase.
        first: whether it is the first call since the start-up.
        due: whether the ramp makes a step, see `moves`.
        word: of the call before.
        reading: at this call.
    """
    if program.ramp_calls == 0:
        return target
    word = reading if first else word
    hold, cools = program.ramp_hold, program.ramp_hold < 0
    if cools:
        hold, word, target, reading = -hold, -word, -target, -reading
    lowest = target
    if hold > 0 and setpoint_word(reading - hold) > target:
        lowest = setpoint_word(reading - hold)
    if due:
        if word < target:
            word = min(setpoint_word(word + program.ramp_step), target)
        elif word > lowest:
            word = max(setpoint_word(word - program.ramp_step), lowest)
        elif not word > target:  # also what is no number
            word = target
    if hold > 0 and word > setpoint_word(reading + hold):
        word = setpoint_word(reading + hold)
    return -word if cools else word


#: by what the power of coolers is multiplied that are as strong as the switch says
AS_TOLD: Final = np.ones(1)


def as_strong(pwm: Switches, share: float) -> Switches:
    """Return a switch whose cooler is so many times as strong."""
    return Switches(pwm.heat, pwm.cool, share * pwm.cooling)


def edge_at(edges: Places, number: int) -> float:
    """Return the instant of an edge [s]."""
    return float(abs(edges[number & (len(edges) - 1)]))


def heat_after(edges: Places, number: int, cooling: float) -> float:
    """Return the power after an edge [% of the heater's full power], below 0 where the cooler is on.

    Args:
        edges: the ring.
        number: of the edge; edges alternate, so it tells whether something is switched on.
        cooling: `Switches.cooling`.
    """
    if number % 2 == 1:
        return 0.0
    return -100.0 * cooling if _cools(edges, number) else 100.0


def period_of(
    edges: Places, switched: int, begin: float, power: float, owed: tuple[float, float], pwm: Switches, cut: float
) -> tuple[int, tuple[float, float]]:
    """Switch for one period; return how often was switched so far, and what heater and cooler owe [s].

    The one that is not asked for stays off, and what it owes is too little for a pulse.

    Args:
        edges: the ring.
        switched: how often was switched so far.
        begin: of the period [s].
        power: asked for, −100…100 %, below 0 of the cooler.
        owed: by heater and cooler [s].
        pwm: of both.
        cut: instant from which on an interlock keeps the heater off [s].
    """
    if power < 0.0 and pwm.cooling > 0.0:
        on, cool = on_time(-power, owed[1], pwm.cool)
        return _pulse(edges, switched, begin, on, pwm.heat[0], True), (owed[0], cool)
    on, heat = on_time(max(power, 0.0), owed[0], pwm.heat)
    left = max(cut - begin, 0.0) if _cools(edges, switched - 1) else cut - begin  # a pulse that runs ends at the cut
    return _pulse(edges, switched, begin, min(on, left), pwm.heat[0], False), (heat, owed[1])


def _cools(edges: Places, number: int) -> bool:
    """Return whether an edge switches the cooler on."""
    return number >= 0 and number % 2 == 0 and math.copysign(1.0, edges[number & (len(edges) - 1)]) < 0.0


def _pulse(edges: Places, switched: int, begin: float, on: float, period: float, cools: bool) -> int:
    """Switch for one period, where it is not in that state already; return how often it was switched so far."""
    last = len(edges) - 1
    if on > 0.0 and switched % 2 == 1 and _cools(edges, switched - 1) != cools:
        edges[switched & last] = begin
        switched += 1
    if on > 0.0 and switched % 2 == 0:
        edges[switched & last] = -begin if cools else begin
        switched += 1
    if on < period and switched % 2 == 1:
        edges[switched & last] = begin + on
        switched += 1
    return switched


def switched_off(edges: Places, switched: int, now: float) -> int:
    """Take back what is left of a pulse, without supply; return how often was switched so far."""
    last = len(edges) - 1
    if switched % 2 == 1:
        edges[switched & last] = now
        return switched + 1
    if switched > 0 and edges[switched - 1 & last] > now:
        edges[switched - 1 & last] = now
    return switched


def times_on(edges: Places, switched: int, end: float) -> int:
    """Return how often something was switched on until an instant."""
    times = (switched + 1) // 2
    while times > 0 and edge_at(edges, 2 * (times - 1)) > end:
        times -= 1
    return times


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

    Of a plant gain, lags, dead time and ambient of `Plant` and the temperature at the start; of one with a loss curve,
    the numbers of `Loss` too, the longest time for a tangent and the fast share of `LossPlant`. One row of noise or
    delays may serve all, and one number of `cooling`, by which the cooler's power is multiplied.
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
        edges: a ring, see `heatertune.proof.kernel`; its length is a power of two.
        record: places for the trace.
        meter: places for what is measured.

    Returns:
        How often the heater was switched, and how many stretches of constant power there were.
    """
    scan_s, late, noise, cold = clock.scan_s, clock.late, clock.noise, state
    leads, shaken, noisy = events.leads, len(late) > 1, len(noise) > 1
    whole, period, least = factors(scan_s, plant), pwm.heat[0], -100.0 if pwm.cooling > 0.0 else 0.0
    plant, flow = unchanged(plant, Flow(0.0, start, start, plant.ambient, 0.0, 0.0, 1.0))
    owed, begin, tick, origin = (0.0, 0.0), 0.0, 0.0, 0.0
    period_count = ticked = switched = arrived = happened = phase = calls = 0
    rows, t, following, word = _stretch(record, 0, flow), late[0], 0.0, program.setpoints[0]
    (stats, rest), (due, kind) = _begin(meter, start), next_event(plant, events, happened, edges, arrived, switched)
    for k in range(clock.scans):
        # the time between two scans is a whole interval where neither is late and nothing happens between them
        quiet = k > 0 and is_linear(plant) and (not shaken or late[k] == late[k - 1])
        while due <= t:
            quiet = False
            before = advance_heater(flow, due, factors(due - flow.now, plant))
            stats, rest = measure_interval(meter, stats, rest, plant, flow, before)
            value = heat_after(edges, arrived, pwm.cooling) if kind == HEAT else events.value[happened]
            plant, flow = unchanged(plant, apply_event(plant, before, kind, value))
            stats, rest = end_phase(meter, stats, rest, flow, kind)
            arrived, happened = arrived + (kind == HEAT), happened + (kind not in (HEAT, AGAIN))
            phase += _begins_phase(kind)
            rows = _stretch(record, rows, flow) if kind <= HEAT else keep_nothing(record, rows, flow)
            due, kind = next_event(plant, events, happened, edges, arrived, switched)
        before, flow = flow, advance_heater(flow, t, whole if quiet else factors(t - flow.now, plant))
        stats, rest = measure_interval(meter, stats, rest, plant, before, flow)
        plant, flow = unchanged(plant, flow)
        rows = keep_nothing(record, rows, flow)
        reading = measure(sensor, flow.y + (noise[k] if noisy else noise[0]))
        if calls == 0 and k > 0 and program.supplied[phase] and apart(begin, k * scan_s, period):
            origin, begin, tick, period_count, ticked = t, t, t, 0, 0
        cycle_start = tick <= t + INSTANT_S
        ticked, tick = ticked_on(origin, ticked, tick, t, period)
        power, flags = 0.0, 0
        if program.supplied[phase]:
            if calls == 0 and k > 0:
                state = warm_state(parameters, cold, state)
            program.setpoints[phase] = (
                measure(sensor, led_to(leads, phase, t)) if is_led(leads, phase) else program.setpoints[phase])
            word = setpoint_word_now(
                program, program.setpoints[phase], calls == 0, moves(program, calls), word, reading)
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
            period_count += 1
            begin = origin + period_count * period
        t, (due, kind) = following, next_event(plant, events, happened, edges, arrived, switched)
    _end(meter, stats, rest, edges, switched, flow.now)
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
            linear_plant(row), row[5],
            Events(batch.event_time[i], batch.event_kind[i], batch.event_value[i], batch.leads),
            as_strong(pwm, batch.cooling[i % len(batch.cooling)]), cut, edges, record,
            Meter(meter.measures, meter.setpoints, meter.band, meter.period, meter.wrong, meter.phases[i],
                  meter.totals[i], meter.high[i], meter.low[i], meter.leads),
        )
    return counted


def next_event(
    plant: Plant, events: Events, happened: int, edges: Places, arrived: int, switched: int
) -> tuple[float, int]:
    """Return instant and kind of what happens next; at one instant jumps and loads come before the switch.

    Args:
        plant: the heater.
        events: beside the switch.
        happened: how many of them did.
        edges: the ring.
        arrived: how many edges reached the heater.
        switched: how often was switched so far.
    """
    due, kind = events.time[happened], events.kind[happened]
    if arrived < switched:
        edge = edge_at(edges, arrived) + plant.dead
        if edge < due or (edge == due and kind > HEAT):
            return edge, HEAT
    return due, kind


def next_with_tangent(
    plant: LossPlant, events: Events, happened: int, edges: Places, arrived: int, switched: int
) -> tuple[float, int]:
    """Return what happens next to a heater with a loss curve, of which a tangent is taken again; see `next_event`.

    Args:
        plant: the heater.
        events: as there.
        happened: likewise.
        edges: likewise.
        arrived: likewise.
        switched: likewise.
    """
    due, kind = next_event(plant, events, happened, edges, arrived, switched)  # type: ignore[arg-type]  # its fields
    return (plant.until, AGAIN) if plant.until < due else (due, kind)


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


def keep_nothing(_record: TraceArrays, rows: int, _flow: Flow) -> int:
    """Return how many stretches there are: scans begin none; `keep_tangent` is bound for a heater with a loss curve."""
    return rows


def keep_tangent(record: TraceArrays, rows: int, flow: Flow) -> int:
    """Keep the begin of a tangent as that of a stretch; return how many there are."""
    return _stretch(record, rows, flow)


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
    meter: Meter, stats: PhaseStats, rest: SteadyStateStats, plant: Plant, before: Flow, after: Flow
) -> tuple[PhaseStats, SteadyStateStats]:
    """Measure the time between two instants, up to the turn and from it on where there is one.

    Args:
        meter: what is measured.
        stats: the phase so far.
        rest: the rest so far.
        plant: the heater.
        before: at the stretch's begin.
        after: at its end.
    """
    if not meter.measures:
        return stats, rest
    turned = turn(before, after, plant)
    if before.now < turned < after.now:
        top = advance_heater(before, turned, factors(turned - before.now, plant))
        stats = phase_after_monotone(meter, stats, plant, before, top)
        rest = update_rest(meter, stats.phase, rest, plant, before, top) if rest.lasts else rest
        before = top
    stats = phase_after_monotone(meter, stats, plant, before, after)
    return stats, update_rest(meter, stats.phase, rest, plant, before, after) if rest.lasts else rest


def end_phase(meter: Meter, stats: PhaseStats, rest: SteadyStateStats, flow: Flow, kind: int) -> tuple[PhaseStats,
                                                                                                      SteadyStateStats]:
    """End a phase and begin the next one, or begin the rest, where an event does so.

    Args:
        meter: what is measured.
        stats: the phase so far.
        rest: the rest so far.
        flow: the heater.
        kind: of the event.
    """
    if not meter.measures:
        return stats, rest
    if kind == REST:
        return stats, rest_begins(meter, stats.phase, flow.now, flow.y - meter.setpoints[stats.phase])
    if _begins_phase(kind):
        rest, phase = close(meter, stats, rest), stats.phase + 1
        return begin(meter, phase, flow.now, flow.y - meter.setpoints[phase]), rest
    return stats, rest


def _end(meter: Meter, stats: PhaseStats, rest: SteadyStateStats, edges: Places, switched: int, end: float) -> None:
    """Write down the last phase, and how often the heater was switched on until the end."""
    if not meter.measures:
        return
    close(meter, stats, rest)
    meter.totals[SWITCHINGS] = float(times_on(edges, switched, end))
