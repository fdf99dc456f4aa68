"""The closed loop of `heatertune.proof.kernel` for 32 heaters of one lag side by side, the same bit for bit.

All that a loop keeps stands in rows of one flat array (`heatertune.proof.rows`), and each part of a scan is a plain
`for` over the loops without a call or a jump, of which a compiler makes vector instructions; the text of controller,
switch, heater and meter is that of the kernel. Scans and PWM periods are common to all. Edges come to the heaters at
instants of their own: passes go on until none is due. What is rare (disturbances, the time at rest) is left to the
kernel's own functions, loop by loop.

A pass without branches is one for all loops: what only some need is computed for all and chosen. So instants at which
the temperature crosses a limit are looked for only in passes in which it does so in some loop.
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

from heatertune.plc.pwm import INSTANT_S, Switches, on_time
from heatertune.proof.kernel import HEAT, Batch, changed, divided, measured, ticked_on
from heatertune.proof.meter import (
    FAULTS,
    LIMITED,
    SCANS,
    SWITCHINGS,
    Meter,
    Places,
    Rest,
    Seen,
    close,
    crossing,
    faults,
    in_period,
    rested_from,
    seen_from,
)
from heatertune.proof.meter import begin as seen_at
from heatertune.proof.plant import Flow, Plant, factors, moved
from heatertune.proof.program import Program, asked_now, moves
from heatertune.proof.rows import LANES, rows_of

__all__ = ["PERIODS", "ROWS", "law_loaded", "law_stored", "run_in_lanes"]

#: PWM periods that may be on their way to the heater
PERIODS: Final = 4


class Line(NamedTuple):
    """A heater of one lag; `Plant` says what its numbers are."""

    gain: float
    lag: float
    dead: float
    ambient: float
    whole: float  # what a whole interval leaves


class Stretch(NamedTuple):
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


class Under(NamedTuple):
    """Switch and edges under way.

    Attributes:
        due: instant at which the next edge is felt; infinite: there is none [s].
        edge: instant at which it was made [s].
        last: instant at which the edge that was felt last was made [s].
        power: asked for last [%].
        owed: by the heater [s].
        on: whether the last edge made switches on.
        times: how often was switched on until the end.
        edges: on and off of the last periods, the last period at the end; infinite: none [s].
        happened: how many events.
    """

    due: float
    edge: float
    last: float
    power: float
    owed: float
    on: bool
    times: float
    edges: tuple[float, ...]
    happened: int


class Extremes(NamedTuple):
    """Largest and smallest error in this PWM period at rest, as far as `Meter` has not got them [°C]."""

    high: float
    low: float


class Counts(NamedTuple):
    """Noise of this scan [°C], scans at a limit, faults."""

    noise: float
    limited: float
    faults: float


class Now(NamedTuple):
    """What is common to 32 loops at a scan.

    Attributes:
        listed: when something beside edges comes next to one of them [s].
        phase: its number.
        lasts: whether its rest lasts.
        resting: since when, where it is the rest of the first phase, else infinite [s].
        number: of the PWM period of that rest.
    """

    listed: float
    phase: int
    lasts: bool
    resting: float
    number: int


_NEVER: Final = math.inf
_NONE: Final = (_NEVER,) * 2 * PERIODS
loaded_line, stored_line, _end = rows_of(Line(0.0, 0.0, 0.0, 0.0, 0.0))
loaded_stretch, stored_stretch, _end = rows_of(Stretch(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), _end)
loaded_point, stored_point, _end = rows_of(Point(0.0, 0.0, False), _end)
loaded_under, stored_under, _end = rows_of(Under(0.0, 0.0, 0.0, 0.0, 0.0, False, 0.0, _NONE, 0), _end)
loaded_seen, stored_seen, _end = rows_of(Seen(0, 0.0, 0.0, 0.0, False, 0.0, 0.0), _end)
loaded_rest, stored_rest, _end = rows_of(Rest(False, 0.0, 0.0, 0.0, 0.0), _end)
loaded_extremes, stored_extremes, _end = rows_of(Extremes(0.0, 0.0), _end)
#: number of the first row of the controller's state and setpoint word
loaded_counts, stored_counts, ROWS = rows_of(Counts(0.0, 0.0, 0.0), _end)


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


def run_in_lanes(  # noqa: PLR0913 - as `kernel.run_all`
    parameters: Any, state: Any, sensor: Any, scan_s: float, program: Program, batch: Batch, pwm: Switches,
    rows: Places, meter: Meter,
) -> None:
    """Run many loops, 32 at a time in the order given; arguments as of `kernel.run_all`.

    Args:
        parameters: as there.
        state: likewise.
        sensor: likewise.
        scan_s: [s].
        program: whose setpoint is not led and whose PLC is always supplied.
        batch: heaters of one lag, no scan late, no more dead time than `PERIODS` allows.
        pwm: without a cooler.
        rows: places, `LANES` for each row.
        meter: that measures.
    """
    first = 0
    while first < len(batch.plants):
        group(parameters, state, sensor, scan_s, program, batch, pwm, rows, meter, first)
        first += LANES


def group(  # noqa: PLR0913 - as `kernel.run`
    parameters: Any, state: Any, sensor: Any, scan_s: float, program: Program, batch: Batch, pwm: Switches,
    rows: Places, meter: Meter, first: int,
) -> None:
    """Run 32 loops from the first one on, the last of all once more where there are fewer; see `run_in_lanes`."""
    period, end, noisy = pwm.heat[0], (batch.scans - 1) * scan_s, len(batch.noise[0]) > 1
    begin, tick, begun, ticked, t = 0.0, 0.0, 0, 0, 0.0
    now = Now(0.0, 0, False, _NEVER, 0)  # an event is due, so the first scan is no quick one
    for lane in range(LANES):
        i = _loop_of(batch, first, lane)
        _started(rows, lane, batch.plants[i], scan_s, meter, batch.noise[i % len(batch.noise)][0])
        law_stored(rows, lane, (state, program.asked[0]))
    for k in range(batch.scans):
        if now.listed <= t or _number(meter, now.resting, t) != now.number:
            now = _slowly(rows, batch, meter, first, t, k > 0, now)
        else:
            _quickly(rows, meter.setpoints[now.phase], meter.band, t, now.lasts)
        if noisy:
            for lane in range(LANES):
                i = _loop_of(batch, first, lane)
                counts = loaded_counts(rows, lane)
                stored_counts(rows, lane, Counts(batch.noise[i % len(batch.noise)][k], counts.limited, counts.faults))
        cycle_start = tick <= t + INSTANT_S
        ticked, tick = ticked_on(0.0, ticked, tick, t, period)
        computed(rows, parameters, sensor, program, program.asked[now.phase], k, cycle_start, meter.wrong)
        t = (k + 1) * scan_s
        while begin < t - INSTANT_S:
            _switched(rows, pwm, begin, end)
            begun += 1
            begin = begun * period
    for lane in range(min(LANES, len(batch.plants) - first)):
        own, counts = _meter_of(meter, first + lane), loaded_counts(rows, lane)
        _kept(rows, lane, own, now)
        close(own, loaded_seen(rows, lane), loaded_rest(rows, lane))
        own.totals[SCANS], own.totals[LIMITED] = float(batch.scans), counts.limited
        own.totals[FAULTS], own.totals[SWITCHINGS] = counts.faults, loaded_under(rows, lane).times


def _loop_of(batch: Batch, first: int, lane: int) -> int:
    return min(first + lane, len(batch.plants) - 1)


def _meter_of(meter: Meter, i: int) -> Meter:
    return Meter(meter.measures, meter.setpoints, meter.band, meter.period, meter.wrong, meter.phases[i],
                 meter.totals[i], meter.high[i], meter.low[i], meter.leads)


def _started(rows: Places, lane: int, row: Places, scan_s: float, meter: Meter, noise: float) -> None:
    """Put a loop at its start; `row` is one of `Batch.plants`."""
    plant, y = Plant(row[0], row[1], 0.0, row[3], row[4]), row[5]
    stored_line(rows, lane, Line(plant.gain, plant.first, plant.dead, plant.ambient, factors(scan_s, plant).outer))
    stored_stretch(rows, lane, Stretch(0.0, y, plant.ambient, 0.0, 0.0, 1.0))
    stored_point(rows, lane, Point(0.0, y, False))
    stored_under(rows, lane, Under(_NEVER, _NEVER, -1.0, 0.0, 0.0, False, 0.0, _NONE, 0))
    stored_seen(rows, lane, seen_at(meter, 0, 0.0, y - meter.setpoints[0]))
    stored_rest(rows, lane, Rest(False, 0.0, 0.0, 0.0, 0.0))
    stored_extremes(rows, lane, Extremes(-_NEVER, _NEVER))
    stored_counts(rows, lane, Counts(noise, 0.0, 0.0))


def _plant(line: Line) -> Plant:
    return Plant(line.gain, line.lag, 0.0, line.dead, line.ambient)


def _flow(stretch: Stretch, now: float, y: float) -> Flow:
    """Return the heater at an instant of its stretch; nobody asks for the state of a second lag."""
    return Flow(now, y, 0.0, stretch.target, stretch.heat, stretch.load, stretch.mains)


def _other(heat: float) -> float:
    """Return the power after an edge: edges alternate."""
    return 0.0 if heat > 0.0 else 100.0


def _felt(under: Under, edge: float, dead: float) -> Under:
    """Return what is under way after an edge that was made at an instant."""
    e = under.edges
    early = min(min(_behind(e[0], edge), _behind(e[1], edge)), min(_behind(e[2], edge), _behind(e[3], edge)))
    later = min(min(_behind(e[4], edge), _behind(e[5], edge)), min(_behind(e[6], edge), _behind(e[7], edge)))
    following = min(early, later)
    return Under(following + dead, following, edge, under.power, under.owed, under.on, under.times, e, under.happened)


def _behind(edge: float, last: float) -> float:
    return edge if edge > last else _NEVER


def _number(meter: Meter, resting: float, t: float) -> int:
    """Return the number of the PWM period at rest at an instant, 0 where none is counted."""
    return in_period(resting, t, meter.period, len(meter.high[0])) if resting <= t else 0


def _kept(rows: Places, lane: int, own: Meter, now: Now) -> None:
    """Write down the extremes of a PWM period at rest, and begin anew."""
    if now.resting < _NEVER:
        extremes = loaded_extremes(rows, lane)
        own.high[now.number] = max(own.high[now.number], extremes.high)
        own.low[now.number] = min(own.low[now.number], extremes.low)
    stored_extremes(rows, lane, Extremes(-_NEVER, _NEVER))


def _slowly(rows: Places, batch: Batch, meter: Meter, first: int, t: float, steady: bool, now: Now) -> Now:
    """Bring all heaters to a scan, whatever happens before it, one after the other; `steady`: not the first scan."""
    listed = _NEVER
    for lane in range(LANES):
        i = _loop_of(batch, first, lane)
        own = _meter_of(meter, i)
        _kept(rows, lane, own, now)
        listed = min(listed, batch.event_time[i][_lived(rows, lane, batch, own, i, t, steady)])
    seen, rest = loaded_seen(rows, 0), loaded_rest(rows, 0)
    resting = rest.start if rest.lasts and seen.phase == 0 else _NEVER
    return Now(listed, seen.phase, rest.lasts, resting, _number(meter, resting, t))


def _lived(rows: Places, lane: int, batch: Batch, own: Meter, i: int, t: float, steady: bool) -> int:
    """Bring one heater to a scan as `kernel.run` does; return how many events there were so far."""
    line, under, stretch = loaded_line(rows, lane), loaded_under(rows, lane), loaded_stretch(rows, lane)
    plant, flow = _plant(line), _flow(stretch, stretch.now, stretch.y)
    seen, rest, happened = loaded_seen(rows, lane), loaded_rest(rows, lane), under.happened
    times, kinds = batch.event_time[i], batch.event_kind[i]
    while min(times[happened], under.due) <= t:
        steady = False
        felt = under.due < times[happened] or (under.due == times[happened] and kinds[happened] > HEAT)
        due, kind = (under.due, HEAT) if felt else (times[happened], kinds[happened])
        before = moved(flow, due, factors(due - flow.now, plant))
        seen, rest = measured(own, seen, rest, plant, flow, before)
        flow = changed(plant, before, kind, _other(flow.heat) if felt else batch.event_value[i][happened])
        seen, rest = divided(own, seen, rest, flow, kind)
        under, happened = _felt(under, under.edge if felt else under.last, line.dead), happened + (not felt)
    left = line.whole if steady else factors(t - flow.now, plant).outer
    after = _flow(Stretch(0.0, 0.0, flow.target, flow.heat, flow.load, flow.mains), t, _left(flow.y, flow.target, left))
    seen, rest = measured(own, seen, rest, plant, flow, after)
    stored_seen(rows, lane, seen)
    stored_rest(rows, lane, rest)
    stored_stretch(rows, lane, Stretch(t, after.y, flow.target, flow.heat, flow.load, flow.mains))
    stored_point(rows, lane, Point(t, after.y, False))
    stored_under(rows, lane, Under(under.due, under.edge, under.last, under.power, under.owed, under.on, under.times,
                                   under.edges, happened))
    return happened


def _left(y: float, target: float, left: float) -> float:
    """Return the temperature where a part of its way to the target is left."""
    return target + left * (y - target)


def _quickly(rows: Places, setpoint: float, band: float, t: float, lasts: bool) -> None:
    """Bring all heaters to a scan before which nothing happens but edges."""
    quiet = True
    due = _due(rows, t)
    while due > 0:
        quiet = False
        _along(rows, setpoint, band, _to_edges(rows, setpoint, band, t), lasts)
        due = _switches(rows, t)
    crossings = _to_scan(rows, setpoint, band, t) if quiet else _on_to_scan(rows, setpoint, band, t)
    _along(rows, setpoint, band, crossings, lasts)


def _due(rows: Places, t: float) -> int:
    """Return to how many heaters an edge comes until an instant."""
    due = 0
    for lane in range(LANES):
        due += int(loaded_under(rows, lane).due <= t)
    return due


def _to_edges(rows: Places, setpoint: float, band: float, t: float) -> int:
    """Bring the heaters to which one comes until an instant to their next edge; return how many cross a limit."""
    crossings = 0
    for lane in range(LANES):
        line, stretch, due = loaded_line(rows, lane), loaded_stretch(rows, lane), loaded_under(rows, lane).due
        moves = due <= t
        now = due if moves else stretch.now
        left = factors(now - stretch.now, _plant(line)).outer
        y = _left(stretch.y, stretch.target, left) if moves else stretch.y
        stored_point(rows, lane, Point(now, y, moves or loaded_point(rows, lane).busy))
        crossings += _crosses(rows, lane, stretch, now, y, setpoint, band)
    return crossings


def _to_scan(rows: Places, setpoint: float, band: float, t: float) -> int:
    """Bring all heaters from one scan to the next; return how many cross a limit."""
    crossings = 0
    for lane in range(LANES):
        stretch = loaded_stretch(rows, lane)
        y = _left(stretch.y, stretch.target, loaded_line(rows, lane).whole)
        stored_point(rows, lane, Point(t, y, False))
        crossings += _crosses(rows, lane, stretch, t, y, setpoint, band)
    return crossings


def _on_to_scan(rows: Places, setpoint: float, band: float, t: float) -> int:
    """Bring all heaters to a scan before which an edge came to some; return how many cross a limit."""
    crossings = 0
    for lane in range(LANES):
        line, stretch = loaded_line(rows, lane), loaded_stretch(rows, lane)
        left = factors(t - stretch.now, _plant(line)).outer
        y = _left(stretch.y, stretch.target, left if loaded_point(rows, lane).busy else line.whole)
        stored_point(rows, lane, Point(t, y, False))
        crossings += _crosses(rows, lane, stretch, t, y, setpoint, band)
    return crossings


def _crosses(rows: Places, lane: int, stretch: Stretch, now: float, y: float, setpoint: float, band: float) -> int:
    return int(crossing(loaded_seen(rows, lane), setpoint, band, _flow(stretch, stretch.now, stretch.y),
                        _flow(stretch, now, y)))


def _along(rows: Places, setpoint: float, band: float, crossings: int, lasts: bool) -> None:
    """Measure the stretches of all loops."""
    if crossings > 0:
        for lane in range(LANES):
            _seen(rows, lane, setpoint, band, True)
    else:
        for lane in range(LANES):
            _seen(rows, lane, setpoint, band, False)
    if lasts:
        for lane in range(LANES):
            _rests(rows, lane, setpoint)


def _seen(rows: Places, lane: int, setpoint: float, band: float, crosses: bool) -> None:
    stretch, point = loaded_stretch(rows, lane), loaded_point(rows, lane)
    stored_seen(rows, lane, seen_from(
        loaded_seen(rows, lane), setpoint, band, 0.0, _plant(loaded_line(rows, lane)),
        _flow(stretch, stretch.now, stretch.y), _flow(stretch, point.now, point.y), crosses))


def _rests(rows: Places, lane: int, setpoint: float) -> None:
    stretch, point, extremes = loaded_stretch(rows, lane), loaded_point(rows, lane), loaded_extremes(rows, lane)
    stored_rest(rows, lane, rested_from(
        loaded_rest(rows, lane), setpoint, _plant(loaded_line(rows, lane)), _flow(stretch, stretch.now, stretch.y),
        _flow(stretch, point.now, point.y)))
    error = point.y - setpoint
    stored_extremes(rows, lane, Extremes(max(extremes.high, error), min(extremes.low, error)))


def _switches(rows: Places, t: float) -> int:
    """Switch the heaters to which an edge came; return to how many the next one comes until an instant."""
    due = 0
    for lane in range(LANES):
        line, stretch = loaded_line(rows, lane), loaded_stretch(rows, lane)
        point, under = loaded_point(rows, lane), loaded_under(rows, lane)
        felt = under.due <= t
        new = changed(_plant(line), _flow(stretch, point.now, point.y), HEAT, _other(stretch.heat))
        stored_stretch(rows, lane, Stretch(
            point.now, point.y, new.target if felt else stretch.target, new.heat if felt else stretch.heat,
            stretch.load, stretch.mains))
        under = _felt(under, under.edge if felt else under.last, line.dead)
        stored_under(rows, lane, under)
        due += int(under.due <= t)
    return due


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
    for lane in range(LANES):
        state, word = law_loaded(rows, lane)
        reading = measure(sensor, loaded_point(rows, lane).y + loaded_counts(rows, lane).noise)
        word = asked_now(program, asked, calls == 0, due, word, reading)
        state, power, _, flags = step(parameters, state, word, reading, cycle_start)
        law_stored(rows, lane, (state, word))
        stretch, point, under = loaded_stretch(rows, lane), loaded_point(rows, lane), loaded_under(rows, lane)
        none, counts = math.isnan(power), loaded_counts(rows, lane)
        stored_counts(rows, lane, Counts(
            counts.noise, counts.limited + (1.0 if power <= 0.0 or power >= 100.0 else 0.0),
            counts.faults + (1.0 if none else 0.0) + faults(flags & wrong)))
        stored_stretch(rows, lane, Stretch(
            point.now, point.y, stretch.target, stretch.heat, stretch.load, stretch.mains))
        stored_under(rows, lane, Under(under.due, under.edge, under.last, 0.0 if none else power, under.owed, under.on,
                                       under.times, under.edges, under.happened))


def _switched(rows: Places, pwm: Switches, begin: float, end: float) -> None:
    """Switch for one period, as `switch.period_of` does."""
    for lane in range(LANES):
        under, dead = loaded_under(rows, lane), loaded_line(rows, lane).dead
        seconds, owed = on_time(max(under.power, 0.0), under.owed, pwm.heat)
        rises = seconds > 0.0 and not under.on
        falls = seconds < pwm.heat[0] and (under.on or rises)
        new = begin if rises else _NEVER, begin + seconds if falls else _NEVER
        edges = under.edges[2:] + new  # noqa: RUF005 - as the compiler takes it
        times = under.times + (1.0 if rises and begin <= end else 0.0)
        stored_under(rows, lane, _felt(Under(
            under.due, under.edge, under.last, under.power, owed, (under.on or rises) and not falls, times, edges,
            under.happened), under.last, dead))
