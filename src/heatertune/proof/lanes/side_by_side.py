"""The closed loop of `heatertune.proof.kernel` for 32 heaters of one lag at once, with bit-identical results.

The state of the loops is one flat array (`heatertune.proof.lanes.passes`). Each part of a scan is a plain `for` over
the loops without a call or a jump, which a compiler turns into vector instructions: what only some loops need is
computed for all and selected. Scans, PWM periods and the supply of the PLC are common to all. Edges reach the heaters
at their own instants: passes repeat until none is due, and only passes in which some loop crosses a limit look for the
instant. Rare events (disturbances, rest, start-up) use the kernel's own functions, loop by loop.
"""

from __future__ import annotations

from typing import Any

from heatertune.compiled.plain_functions import law_loaded, law_stored, warm_state
from heatertune.heater.exact import Factors
from heatertune.plc.pwm import INSTANT_S, Switches
from heatertune.proof.kernel import (
    HEAT,
    LoopBatch,
    SetpointProgram,
    apart,
    apply_event,
    end_phase,
    measure_interval,
    ticked_on,
)
from heatertune.proof.lanes.passes import (
    LANES,
    NEVER,
    STEP,
    EdgeWindow,
    Inner,
    LaneCounts,
    LaneLag,
    LaneStretch,
    PhaseLimits,
    Point,
    Ring,
    ScanState,
    Second,
    Under,
    cut_off,
    flow_of,
    lanes_of,
    loaded_counts,
    loaded_inner,
    loaded_line,
    loaded_rest,
    loaded_second,
    loaded_seen,
    loaded_stretch,
    loaded_under,
    next_edge,
    next_edges,
    open_window,
    plant_of,
    quickly,
    run_scan,
    stored_counts,
    stored_inner,
    stored_line,
    stored_point,
    stored_rest,
    stored_second,
    stored_seen,
    stored_stretch,
    stored_under,
    switch_period,
    toggled_power,
)
from heatertune.proof.meter import FAULTS, LIMITED, SCANS, SWITCHINGS, Meter, Places, SteadyStateStats, close
from heatertune.proof.meter import begin as seen_at
from heatertune.proof.plant import advance_heater, factors, plant_from

__all__ = ["group", "loop_of", "meter_of", "run_in_lanes", "slowly", "start_loop", "started_up"]


def loop_of(batch: LoopBatch, first: int, lane: int) -> int:
    """Return the number of a loop of the 32 from the first one on: the last of all once more where there are fewer."""
    return min(first + lane, len(batch.plants) - 1)


def meter_of(meter: Meter, i: int) -> Meter:
    """Return the meter of one loop."""
    return Meter(meter.measures, meter.setpoints, meter.band, meter.period, meter.wrong, meter.phases[i],
                 meter.totals[i], meter.high[i], meter.low[i], meter.leads)


def start_loop(rows: Places, lane: int, row: Places, scan_s: float, meter: Meter, noise: float) -> None:
    """Put a loop at its start; `row` is one of `Batch.plants`.

    Args:
        rows: places.
        lane: number of the loop among the 32.
        row: one of `Batch.plants`.
        scan_s: interval between two scans [s].
        meter: what is measured.
        noise: of the first scan [°C].
    """
    plant, y = plant_from(row[0], row[1], row[2], row[3], row[4]), row[5]
    whole = factors(scan_s, plant)
    stored_line(rows, lane, LaneLag(plant.gain, plant.first, plant.dead, plant.ambient, plant.by_first, whole.outer))
    stored_second(rows, lane, Second(
        plant.second, plant.by_second, plant.apart, plant.by_apart, whole.coupling, whole.inner))
    stored_inner(rows, lane, Inner(y, y))
    stored_stretch(rows, lane, LaneStretch(0.0, y, plant.ambient, 0.0, 0.0, 1.0))
    stored_point(rows, lane, Point(0.0, y, False))
    stored_under(rows, lane, Under(NEVER, NEVER, -1.0, 0.0, 0.0, False, 0.0, 0))
    stored_seen(rows, lane, seen_at(meter, 0, 0.0, y - meter.setpoints[0]))
    stored_rest(rows, lane, SteadyStateStats(False, 0.0, 0.0, 0.0, 0.0))
    stored_counts(rows, lane, LaneCounts(noise, 0.0, 0.0))


def slowly(
    rows: Places, ring: Ring, window: EdgeWindow, batch: LoopBatch, meter: Meter, first: int, t: float, steady: bool
) -> ScanState:
    """Bring all heaters to a scan, whatever happens before it, one after the other; return what is common then.

    Args:
        rows: places.
        ring: of the PWM periods.
        window: those of which edges may be felt.
        batch: what differs from loop to loop.
        meter: what is measured.
        first: number of the first of the 32 loops.
        t: instant of the scan [s].
        steady: whether it is not the first scan.
    """
    listed = NEVER
    for lane in range(lanes_of(rows)):
        i = loop_of(batch, first, lane)
        loop_meter = meter_of(meter, i)
        listed = min(listed, batch.event_time[i][_lived(rows, ring, window, lane, batch, loop_meter, i, t, steady)])
    stats, rest = loaded_seen(rows, 0), loaded_rest(rows, 0)
    resting = rest.start if rest.lasts and stats.phase == 0 else NEVER
    return ScanState(listed, stats.phase, rest.lasts, resting)


def _lived(  # noqa: PLR0913 - as `kernel.run`
    rows: Places, ring: Ring, window: EdgeWindow, lane: int, batch: LoopBatch, own: Meter, i: int, t: float,
    steady: bool
) -> Any:
    """Bring one heater to a scan as `kernel.run` does; return how many events there were so far."""
    line, u, stretch = loaded_line(rows, lane), loaded_under(rows, lane), loaded_stretch(rows, lane)
    edge_s, edge, last = u.due, u.edge, u.last
    second = loaded_second(rows, lane)
    plant, flow = plant_of(line, second), flow_of(stretch, stretch.now, stretch.y, loaded_inner(rows, lane).x)
    stats, rest, happened = loaded_seen(rows, lane), loaded_rest(rows, lane), u.happened
    times, kinds = batch.event_time[i], batch.event_kind[i]
    whole, ends = Factors(line.whole, second.coupling, second.inner), False
    while not ends:  # the scan is the last event: so what each one needs is compiled once
        ends = not min(times[happened], edge_s) <= t
        felt = edge_s < times[happened] or (edge_s == times[happened] and kinds[happened] > HEAT)
        due = t if ends else min(times[happened], edge_s)
        after = advance_heater(flow, due, whole if ends and steady else factors(due - flow.now, plant))
        stats, rest = measure_interval(own, stats, rest, plant, flow, after)
        flow, steady = after, False
        if not ends:
            kind = HEAT if felt else kinds[happened]
            flow = apply_event(plant, after, kind, toggled_power(flow.heat) if felt else batch.event_value[i][happened])
            stats, rest = end_phase(own, stats, rest, flow, kind)
            happened += not felt
            if felt:
                last, edge = edge, next_edge(ring, window, lane, edge)
                edge_s = edge + line.dead
    stored_seen(rows, lane, stats)
    stored_rest(rows, lane, rest)
    stored_stretch(rows, lane, LaneStretch(t, flow.y, flow.target, flow.heat, flow.load, flow.mains))
    stored_point(rows, lane, Point(t, flow.y, False))
    stored_inner(rows, lane, Inner(flow.x, flow.x))
    stored_under(rows, lane, Under(edge_s, edge, last, u.power, u.owed, u.on, u.times, happened))
    return happened


def run_in_lanes(  # noqa: PLR0913 - as `kernel.run_all`
    parameters: Any, state: Any, sensor: Any, scan_s: float, program: SetpointProgram, batch: LoopBatch, pwm: Switches,
    rows: Places, ring: Ring, meter: Meter,
) -> None:
    """Run many loops, 32 at a time in the order given; arguments as of `kernel.run_all`.

    Args:
        parameters: as there.
        state: likewise.
        sensor: likewise.
        scan_s: [s].
        program: whose setpoint is not led.
        batch: heaters of one lag, no scan late.
        pwm: without a cooler.
        rows: places, `LANES` for each row, and as many again, see `lanes_of`.
        ring: for the longest dead time.
        meter: that measures.
    """
    first = 0
    while first < len(batch.plants):
        lanes = min(len(batch.plants) - first + STEP - 1 & -STEP, LANES)
        places = rows[:len(rows) - LANES + lanes]
        group(parameters, state, sensor, scan_s, program, batch, pwm, places, ring, meter, first)
        first += LANES


def group(  # noqa: PLR0913 - as `kernel.run`
    parameters: Any, state: Any, sensor: Any, scan_s: float, program: SetpointProgram, batch: LoopBatch, pwm: Switches,
    rows: Places, ring: Ring, meter: Meter, first: int,
) -> None:
    """Run 32 loops from the first one on, the last of all once more where there are fewer; see `run_in_lanes`.

    Args:
        parameters: of the controller.
        state: at the start.
        sensor: what `measure` takes.
        scan_s: interval between two scans [s].
        program: around the controllers.
        batch: what differs from loop to loop.
        pwm: of the heater.
        rows: places.
        ring: places for PWM periods.
        meter: what is measured.
        first: number of the first of the 32 loops.
    """
    period, end, noisy = pwm.heat[0], (batch.scans - 1) * scan_s, len(batch.noise[0]) > 1
    begin, tick, origin, t = 0.0, 0.0, 0.0, 0.0
    period_count = ticked = number = calls = scans = 0
    window, shortest, longest = EdgeWindow(0, 0), NEVER, 0.0
    now = ScanState(0.0, 0, False, NEVER)  # an event is due, so the first scan is no quick one
    for lane in range(lanes_of(rows)):
        i = loop_of(batch, first, lane)
        start_loop(rows, lane, batch.plants[i], scan_s, meter, batch.noise[i % len(batch.noise)][0])
        law_stored(rows, lane, (state, program.setpoints[0]))
        shortest, longest = min(shortest, batch.plants[i][3]), max(longest, batch.plants[i][3])
    for k in range(batch.scans):
        window = open_window(rows, ring, window, number, (k - 1) * scan_s, t, (shortest, longest))
        if now.listed <= t:
            now = slowly(rows, ring, window, batch, meter, first, t, k > 0)
        else:
            quickly(rows, ring, window, PhaseLimits(meter.setpoints[now.phase], meter.band, now.lasts, now.resting,
                                             meter.period, meter.high, meter.low, first), t)
        if noisy:
            _take_noise(rows, batch, first, k)
        supplied = program.supplied[now.phase]
        starts_up = calls == 0 and k > 0 and supplied
        if starts_up and apart(begin, k * scan_s, period):
            origin, begin, tick, period_count, ticked = t, t, t, 0, 0
        cycle_start = tick <= t + INSTANT_S
        ticked, tick = ticked_on(origin, ticked, tick, t, period)
        if starts_up:
            started_up(rows, parameters, state)
        if supplied:
            run_scan(rows, parameters, sensor, program, program.setpoints[now.phase], calls, cycle_start, meter.wrong)
            calls, scans = calls + 1, scans + 1
        else:
            cut_off(rows, ring, number, t)
            next_edges(rows, ring, window)
            calls = 0
        t = (k + 1) * scan_s
        while begin < t - INSTANT_S:
            switch_period(rows, ring, number, pwm, begin, end)
            period_count, number = period_count + 1, number + 1
            begin = origin + period_count * period
    _ended(rows, meter, first, min(lanes_of(rows), len(batch.plants) - first), scans)


def _take_noise(rows: Places, batch: LoopBatch, first: int, k: int) -> None:
    """Take the noise of a scan."""
    for lane in range(lanes_of(rows)):
        i, counts = loop_of(batch, first, lane), loaded_counts(rows, lane)
        stored_counts(rows, lane,
                      LaneCounts(batch.noise[min(i, len(batch.noise) - 1)][k], counts.limited, counts.faults))


def started_up(rows: Places, parameters: Any, cold: Any) -> None:
    """Start all controllers up.

    Args:
        rows: places.
        parameters: what `step` takes.
        cold: state at the start.
    """
    for lane in range(lanes_of(rows)):
        state, word = law_loaded(rows, lane)
        law_stored(rows, lane, (warm_state(parameters, cold, state), word))


def _ended(rows: Places, meter: Meter, first: int, count: int, scans: int) -> None:
    """Write down what the loops amount to; `scans` are those that were run."""
    for lane in range(count):
        own, counts = meter_of(meter, first + lane), loaded_counts(rows, lane)
        close(own, loaded_seen(rows, lane), loaded_rest(rows, lane))
        own.totals[SCANS], own.totals[LIMITED] = float(scans), counts.limited
        own.totals[FAULTS], own.totals[SWITCHINGS] = counts.faults, loaded_under(rows, lane).times
