"""What is rare in a loop, done loop by loop by the kernel's own functions."""

from __future__ import annotations

from typing import Any

from heatertune.heater.exact import Factors
from heatertune.proof.kernel import HEAT, LoopBatch, apply_event, end_phase, measure_interval
from heatertune.proof.lanes.parts import (
    NEVER,
    Inner,
    LaneCounts,
    LaneLag,
    LaneStretch,
    Point,
    ScanState,
    Second,
    Under,
    flow_of,
    loaded_inner,
    loaded_line,
    loaded_rest,
    loaded_second,
    loaded_seen,
    loaded_stretch,
    loaded_under,
    plant_of,
    stored_counts,
    stored_inner,
    stored_line,
    stored_point,
    stored_rest,
    stored_second,
    stored_seen,
    stored_stretch,
    stored_under,
    toggled_power,
)
from heatertune.proof.lanes.ring import EdgeWindow, Ring, next_edge
from heatertune.proof.lanes.rows import lanes_of
from heatertune.proof.meter import Meter, Places, SteadyStateStats
from heatertune.proof.meter import begin as seen_at
from heatertune.proof.plant import advance_heater, factors, plant_from

__all__ = ["loop_of", "meter_of", "slowly", "start_loop"]


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
        own = meter_of(meter, i)
        listed = min(listed, batch.event_time[i][_lived(rows, ring, window, lane, batch, own, i, t, steady)])
    seen, rest = loaded_seen(rows, 0), loaded_rest(rows, 0)
    resting = rest.start if rest.lasts and seen.phase == 0 else NEVER
    return ScanState(listed, seen.phase, rest.lasts, resting)


def _lived(  # noqa: PLR0913 - as `kernel.run`
    rows: Places, ring: Ring, window: EdgeWindow, lane: int, batch: LoopBatch, own: Meter, i: int, t: float,
    steady: bool
) -> Any:
    """Bring one heater to a scan as `kernel.run` does; return how many events there were so far."""
    line, u, stretch = loaded_line(rows, lane), loaded_under(rows, lane), loaded_stretch(rows, lane)
    edge_s, edge, last = u.due, u.edge, u.last
    second = loaded_second(rows, lane)
    plant, flow = plant_of(line, second), flow_of(stretch, stretch.now, stretch.y, loaded_inner(rows, lane).x)
    seen, rest, happened = loaded_seen(rows, lane), loaded_rest(rows, lane), u.happened
    times, kinds = batch.event_time[i], batch.event_kind[i]
    whole, ends = Factors(line.whole, second.coupling, second.inner), False
    while not ends:  # the scan is the last event: so what each one needs is compiled once
        ends = not min(times[happened], edge_s) <= t
        felt = edge_s < times[happened] or (edge_s == times[happened] and kinds[happened] > HEAT)
        due = t if ends else min(times[happened], edge_s)
        after = advance_heater(flow, due, whole if ends and steady else factors(due - flow.now, plant))
        seen, rest = measure_interval(own, seen, rest, plant, flow, after)
        flow, steady = after, False
        if not ends:
            kind = HEAT if felt else kinds[happened]
            flow = apply_event(plant, after, kind, toggled_power(flow.heat) if felt else batch.event_value[i][happened])
            seen, rest = end_phase(own, seen, rest, flow, kind)
            happened += not felt
            if felt:
                last, edge = edge, next_edge(ring, window, lane, edge)
                edge_s = edge + line.dead
    stored_seen(rows, lane, seen)
    stored_rest(rows, lane, rest)
    stored_stretch(rows, lane, LaneStretch(t, flow.y, flow.target, flow.heat, flow.load, flow.mains))
    stored_point(rows, lane, Point(t, flow.y, False))
    stored_inner(rows, lane, Inner(flow.x, flow.x))
    stored_under(rows, lane, Under(edge_s, edge, last, u.power, u.owed, u.on, u.times, happened))
    return happened
