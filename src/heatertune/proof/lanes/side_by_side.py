"""The closed loop of `heatertune.proof.kernel` for 32 heaters of one lag side by side, the same bit for bit.

All that a loop keeps stands in rows of one flat array (`heatertune.proof.rows`), and each part of a scan is a plain
`for` over the loops without a call or a jump, of which a compiler makes vector instructions; the text of controller,
switch, heater and meter is that of the kernel. Scans, PWM periods and the PLC's supply are common to all. Edges come to
the heaters at instants of their own: passes go on until none is due. What is rare (disturbances, the time at rest, a
start-up) is left to the kernel's own functions, loop by loop.

A pass without branches is one for all loops: what only some need is computed for all and chosen. So instants at which
the temperature crosses a limit are looked for only in passes in which it does so in some loop.
"""

from __future__ import annotations

from typing import Any

from heatertune.plc.pwm import INSTANT_S, Switches
from heatertune.proof.kernel import LoopBatch, apart, ticked_on, warm_state
from heatertune.proof.lanes.parts import (
    NEVER,
    LaneCounts,
    PhaseLimits,
    ScanState,
    loaded_counts,
    loaded_rest,
    loaded_seen,
    loaded_under,
    stored_counts,
)
from heatertune.proof.lanes.passes import law_loaded, law_stored, quickly, run_scan, switch_period
from heatertune.proof.lanes.ring import EdgeWindow, Ring, cut_off, next_edges, open_window
from heatertune.proof.lanes.rows import LANES, STEP, lanes_of
from heatertune.proof.lanes.slow import loop_of, meter_of, slowly, start_loop
from heatertune.proof.meter import FAULTS, LIMITED, SCANS, SWITCHINGS, Meter, Places, close
from heatertune.proof.setpoint_program import SetpointProgram

__all__ = ["group", "run_in_lanes", "started_up"]


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
    begun = ticked = number = calls = scans = 0
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
            _heard(rows, batch, first, k)
        supplied = program.supplied[now.phase]
        starts_up = calls == 0 and k > 0 and supplied
        if starts_up and apart(begin, k * scan_s, period):
            origin, begin, tick, begun, ticked = t, t, t, 0, 0
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
            begun, number = begun + 1, number + 1
            begin = origin + begun * period
    _ended(rows, meter, first, min(lanes_of(rows), len(batch.plants) - first), scans)


def _heard(rows: Places, batch: LoopBatch, first: int, k: int) -> None:
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
