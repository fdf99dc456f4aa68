"""The closed loop of all zones, instant by instant: plain functions of numbers, run as they are or compiled.

Nothing is allocated: results go to arrays made before the run. Parameters and states of the controllers are nested
pairs, (first zone, (second zone, third zone)), and `scan_zones` bound to itself once for each zone scans them all.
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

from heatertune.compiled.plain_functions import cold_state, disturbance_step, measure, step, warm_state
from heatertune.plc.pwm import INSTANT_S, on_time
from heatertune.plc.single_precision import single
from heatertune.proof.kernel import SetpointProgram, moves, setpoint_word_now
from heatertune.proof.meter import Places

__all__ = ["KINDS", "DecouplingArrays", "JointArrays", "NetworkArrays", "ZoneEvents", "ZoneMemory", "ZoneWords",
           "decoupled_call", "neighbours_pct", "plain_call", "run_joint", "scan_zone", "scan_zones"]

#: what may happen to a zone: its value is the setpoint [°C] or the load [% of its power]; a zone that is off is started
#: again from cold; "broken" is its sensor: every program puts such a zone off, and feeds its reading to no other
KINDS: Final = ("setpoint", "load", "off", "broken", "on", "closed", "open", "stuck", "restart")
_SETPOINT, _LOAD, _BROKEN, _ON, _CLOSED, _STUCK, _RESTART = map(KINDS.index, (
    "setpoint", "load", "broken", "on", "closed", "stuck", "restart"))
_WARM: Final = 1
_COLD: Final = 2
_REFINED: Final = 3  # steps towards a peak between two switchings


class NetworkArrays(NamedTuple):
    """A network by its modes, for constant power: z(t) = target + (z − target)·exp(rates·t), y = outputs·z.

    Attributes:
        rates: shape (m,) [1/s].
        outputs: shape (n, m).
        slopes: outputs·rates, shape (n, m).
        rest: modes at rest without power, shape (m,).
        shifts: by which a percent of power moves them, shape (m, n).
        dead_s: from a switch to its zone, shape (n,) [s].
        supply_shares: of their power that all others lose while a heater is on, shape (n,); of shape (0,) where none
            lose any.
    """

    rates: Places
    outputs: Places
    slopes: Places
    rest: Places
    shifts: Places
    dead_s: Places
    supply_shares: Places


class ZoneEvents(NamedTuple):
    """What happens, in order of time, the last instant infinite; `kind` is a place in `KINDS`."""

    time: Places
    kind: Places
    zone: Places
    value: Places


class DecouplingArrays(NamedTuple):
    """What the program around the controllers adds to their outputs for the neighbours' readings, as REALs.

    Attributes:
        factors: of zone i for the reading of zone j, shape (n, n), 0 where it is not looked at; of shape (0, 0) without
            decoupling [% per unit of the reading].
        references: readings at which nothing is added, shape (n,) [units of the reading].
    """

    factors: Places
    references: Places


class ZoneWords(NamedTuple):
    """Setpoint words, in the controllers' units.

    Attributes:
        now: requested of each zone.
        of_event: of each event.
        last: which each controller was given last, on its ramp.
        calls: of each controller since its start.
        program: the setpoint ramp, one for all zones; its phases are not used.
        decoupling: of the zones.
    """

    now: Places
    of_event: Places
    last: Places
    calls: Places
    program: SetpointProgram
    decoupling: DecouplingArrays


class ZoneMemory(NamedTuple):
    """What the loop remembers from one instant to the next.

    Attributes:
        z, target, offset: modes of the network, where they tend to, and their distance from there at the last
            switching, shape (m,).
        heat, load: power of each zone's heater now and load, shape (n,) [%].
        setpoint: shape (n,) [°C].
        power: that the controller demands, shape (n,) [%].
        carry, begin, origin: of each PWM: on time carried over, begin of the next period and of the first, shape (n,)
            [s].
        is_on, command, fault: of each zone: whether its controller runs, how it starts next, and 0 or the kind of
            event that broke its circuit, shape (n,).
        is_unread: of each zone: whether its sensor is broken, shape (n,).
        period_counts, edge_counts, pulse_counts: of each zone: PWM periods, edges, pulses, shape (n,).
        arrival_counts: edges of zone j that zone i has felt, shape (n, n); on a supply that sags it feels all of them.
        edges: instants at which they arrive, on and off in turn, one place more than edges, shape (n, e) [s].
        pulse_begin, pulse_end: at the switch, shape (n, p) [s].
        overflows: how often a controller set a flag of an overflow, shape (1,).
    """

    z: Places
    target: Places
    offset: Places
    heat: Places
    load: Places
    setpoint: Places
    power: Places
    carry: Places
    begin: Places
    origin: Places
    is_on: Places
    command: Places
    fault: Places
    is_unread: Places
    period_counts: Places
    edge_counts: Places
    arrival_counts: Places
    pulse_counts: Places
    edges: Places
    pulse_begin: Places
    pulse_end: Places
    overflows: Places


class JointArrays(NamedTuple):
    """Places for the trace, shape (K, n) each; see `heatertune.zones.joint_loop.JointTrace`."""

    temperatures: Places
    powers: Places
    setpoints: Places
    readings: Places
    highest: Places
    lowest: Places


def run_joint(  # noqa: PLR0913 - compiled for the types of each
    controllers: Any, cold: Any, states: Any, words: ZoneWords, interval_s: float, overflow: int,
    pwm: tuple[float, float, float, float, bool], network: NetworkArrays, events: ZoneEvents, noise: Places,
    memory: ZoneMemory, out: JointArrays,
) -> int:
    """Run the loop over all scans and return how many events happened.

    Args:
        controllers: parameters and sensor of each zone, nested.
        cold: state of each zone after it was switched on, nested.
        states: likewise; with cells of their own.
        words: setpoints.
        interval_s: of the scans [s].
        overflow: bit of the flag.
        pwm: `Actuator.numbers`.
        network: the heaters.
        events: what happens.
        noise: of the readings, shape (K, n) or (1, n) [°C].
        memory: as it is before the first scan.
        out: places for the trace.
    """
    happened = 0
    for k in range(len(out.powers)):
        now = k * interval_s
        while events.time[happened] <= now + INSTANT_S:
            _happen(memory, network.dead_s, words, events, happened, now)
            happened += 1
        _measure_all(memory, network, out, k)
        states = scan_zones(controllers, cold, states, words, overflow, noise[k % len(noise)], memory, out, 0, k, now)
        for zone in range(len(memory.heat)):
            _switch(memory, network.dead_s[zone], pwm, zone, now + interval_s)
        _heat(memory, network, out, k, now, now + interval_s)
    return happened


def scan_zones(  # noqa: PLR0913 - as `run_joint`
    controllers: Any, cold: Any, states: Any, words: ZoneWords, overflow: int, noise: Places, memory: ZoneMemory,
    out: JointArrays, zone: int, k: int, now: float,
) -> Any:
    """Scan a zone and those behind it; return their states.

    Args:
        controllers: parameters and sensor of each of these zones, nested.
        cold: state of each after it was switched on, nested.
        states: of each, nested.
        words: setpoints.
        overflow: bit of the flag.
        noise: of the readings, shape (n,) [°C].
        memory: of the loop.
        out: places for the trace.
        zone: number of the first zone.
        k: number of the scan.
        now: its instant [s].
    """
    first = scan_zone(controllers[0], cold[0], states[0], words, overflow, noise, memory, out, zone, k, now)
    return first, other_zones(controllers[1], cold[1], states[1], words, overflow, noise, memory, out, zone + 1, k, now)


def other_zones(
    _controllers: Any, _cold: Any, _states: Any, _words: ZoneWords, _overflow: int, _noise: Places,
    _memory: ZoneMemory, _out: JointArrays, _zone: int, _k: int, _now: float,
) -> Any:
    """Stand in for `scan_zones` of the zones behind one."""
    raise NotImplementedError


def scan_zone(  # noqa: PLR0913 - as `scan_zones`
    controller: Any, cold: Any, state: Any, words: ZoneWords, overflow: int, noise: Places, memory: ZoneMemory,
    out: JointArrays, zone: int, k: int, now: float,
) -> Any:
    """Scan a zone if its controller runs; return its state.

    Args:
        controller: parameters and sensor.
        cold: state after it was switched on.
        state: its own.
        words: setpoints.
        overflow: bit of the flag.
        noise: of the readings, shape (n,) [°C].
        memory: of the loop.
        out: places for the trace.
        zone: number of the zone.
        k: number of the scan.
        now: its instant [s].
    """
    if memory.command[zone] == _COLD:
        state = cold_state(controller[0], cold)
    if memory.command[zone] == _WARM:
        state = warm_state(controller[0], cold, state)
    words.calls[zone] = words.calls[zone] if memory.command[zone] == 0 else 0
    memory.command[zone] = 0
    if memory.is_on[zone] == 0:
        return state
    reading = measure(controller[1], out.temperatures[k, zone] + noise[zone])
    begins, calls = memory.begin[zone] <= now + INSTANT_S, words.calls[zone]
    words.last[zone] = setpoint_word_now(
        words.program, words.now[zone], calls == 0, moves(words.program, calls), words.last[zone], reading)
    words.calls[zone] = calls + 1
    state, power, _, flags = plain_call(controller, state, words, noise, memory, out, zone, k, reading, begins)
    memory.power[zone] = 0.0 if math.isnan(power) else power
    memory.overflows[0] += 1 if flags & overflow else 0
    out.readings[k, zone], out.powers[k, zone] = reading, memory.power[zone]
    return state


def plain_call(
    controller: Any, state: Any, words: ZoneWords, _noise: Places, _memory: ZoneMemory, _out: JointArrays, zone: int,
    _k: int, reading: Any, begins: bool,
) -> tuple[Any, float, Any, int]:
    """Return what a zone's controller gives without its neighbours' readings; see `scan_zone`, `StepFunctions.step`.

    Args:
        controller: parameters and sensor.
        state: its own.
        words: setpoints.
        _noise: as `decoupled_call`.
        _memory: likewise.
        _out: likewise.
        zone: number of the zone.
        _k: as `decoupled_call`.
        reading: its own.
        begins: whether a PWM period begins.
    """
    return step(controller[0], state, words.last[zone], reading, begins)


def decoupled_call(  # noqa: PLR0913 - as `run_joint`
    controller: Any, state: Any, words: ZoneWords, noise: Places, memory: ZoneMemory, out: JointArrays, zone: int,
    k: int, reading: Any, begins: bool,
) -> tuple[Any, float, Any, int]:
    """Return what a zone's controller gives with its neighbours' readings of the same scan; arguments as `scan_zone`.

    Args:
        controller: parameters and sensor.
        state: its own.
        words: setpoints and decoupling.
        noise: of the readings, shape (n,) [°C].
        memory: of the loop.
        out: places for the trace.
        zone: number of the zone.
        k: number of the scan.
        reading: its own.
        begins: whether a PWM period begins.
    """
    added = neighbours_pct(controller, words.decoupling, noise, memory, out, zone, k)
    return disturbance_step(controller[0], state, words.last[zone], reading, begins, added)


def neighbours_pct(
    controller: Any, decoupling: DecouplingArrays, noise: Places, memory: ZoneMemory, out: JointArrays, zone: int,
    k: int,
) -> float:
    """Return what a zone's program adds for the neighbours' readings, in REALs, one neighbour after the other [%].

    Args:
        controller: parameters and sensor; all zones have the same sensor range.
        decoupling: factors and references.
        noise: of the readings, shape (n,) [°C].
        memory: of the loop.
        out: places for the trace.
        zone: number of the zone.
        k: number of the scan.
    """
    total = single(0.0)
    for other in range(len(decoupling.references)):
        if decoupling.factors[zone, other] != 0.0 and memory.is_unread[other] == 0:
            away = single(measure(controller[1], out.temperatures[k, other] + noise[other])
                          - decoupling.references[other])
            total = single(total + single(away * decoupling.factors[zone, other]))
    return total


def _happen(memory: ZoneMemory, dead_s: Places, words: ZoneWords, events: ZoneEvents, number: int, now: float) -> None:
    kind, zone = events.kind[number], events.zone[number]
    if kind == _SETPOINT:
        memory.setpoint[zone], words.now[zone] = events.value[number], words.of_event[number]
    elif kind == _LOAD:
        memory.load[zone] = events.value[number]
    elif kind == _RESTART:
        for each in range(len(memory.command)):
            memory.command[each] = max(memory.command[each], _WARM)
    elif kind <= _ON:
        memory.is_on[zone], memory.power[zone], memory.command[zone] = kind == _ON, 0.0, _COLD
        memory.is_unread[zone] = kind == _BROKEN
    else:
        _break_circuit(memory, dead_s[zone], zone, kind, now)


def _break_circuit(memory: ZoneMemory, dead_s: float, zone: int, kind: int, now: float) -> None:
    """Open or close the heater's circuit, or let its relay stick; edges made beyond the instant are taken back."""
    memory.fault[zone] = 0 if kind == _CLOSED else kind
    edges = memory.edges[zone]
    while (memory.edge_counts[zone] > memory.arrival_counts[zone, zone]
           and edges[memory.edge_counts[zone] - 1] - dead_s > now):
        memory.edge_counts[zone] -= 1
    _edge(memory, dead_s, zone, now, kind == _STUCK)
    last = memory.pulse_counts[zone] - 1
    if kind != _CLOSED and last >= 0 and memory.pulse_end[zone, last] > now:
        memory.pulse_end[zone, last] = now


def _switch(
    memory: ZoneMemory, dead_s: float, pwm: tuple[float, float, float, float, bool], zone: int, before: float
) -> None:
    """Make the edges of a zone's PWM periods that begin before an instant."""
    while memory.begin[zone] < before - INSTANT_S:
        begin = memory.begin[zone]
        on, memory.carry[zone] = on_time(max(memory.power[zone], 0.0), memory.carry[zone], pwm)
        if memory.fault[zone] == 0:
            if on > 0.0:
                place = memory.pulse_counts[zone]
                memory.pulse_begin[zone, place], memory.pulse_end[zone, place] = begin, begin + on
                memory.pulse_counts[zone] = place + 1
                _edge(memory, dead_s, zone, begin, True)
            if on < pwm[0]:
                _edge(memory, dead_s, zone, begin + on, False)
        memory.period_counts[zone] += 1
        memory.begin[zone] = memory.origin[zone] + memory.period_counts[zone] * pwm[0]


def _edge(memory: ZoneMemory, dead_s: float, zone: int, instant: float, is_on: bool) -> None:
    """Switch a heater, if it is not so already."""
    if (memory.edge_counts[zone] % 2 == 1) != is_on:
        memory.edges[zone, memory.edge_counts[zone]] = instant + dead_s
        memory.edge_counts[zone] += 1


def _measure_all(memory: ZoneMemory, network: NetworkArrays, out: JointArrays, k: int) -> None:
    """Take the temperatures at a scan."""
    for zone in range(len(memory.heat)):
        temperature = 0.0
        for mode in range(len(memory.z)):
            temperature += (network.outputs[zone, mode] * memory.z[mode]).real
        out.temperatures[k, zone] = out.highest[k, zone] = out.lowest[k, zone] = temperature
        out.setpoints[k, zone] = memory.setpoint[zone]


def _heat(memory: ZoneMemory, network: NetworkArrays, out: JointArrays, k: int, now: float, until: float) -> None:
    """Run the network through all switchings up to the next scan."""
    for mode in range(len(memory.z)):
        memory.target[mode] = network.rest[mode]
        for zone in range(len(memory.heat)):
            memory.target[mode] += network.shifts[mode, zone] * (memory.heat[zone] - memory.load[zone])
    zone, other = _first(memory, network, until)
    while zone >= 0:
        instant = max(_arrival(memory, network, zone, other), now)
        _advance(memory, network, out, k, instant - now)
        memory.arrival_counts[zone, other] += 1
        change = _reaching(memory, network, zone) - memory.heat[zone]
        memory.heat[zone] += change
        for mode in range(len(memory.z)):
            memory.target[mode] += network.shifts[mode, zone] * change
        now = instant
        zone, other = _first(memory, network, until)
    _advance(memory, network, out, k, until - now)


def _arrival(memory: ZoneMemory, network: NetworkArrays, zone: int, source: int) -> float:
    """Return when a zone feels the next edge of another one, or of itself, behind its own dead time [s]."""
    later_s = network.dead_s[zone] - network.dead_s[source]
    return float(memory.edges[source, memory.arrival_counts[zone, source]] + later_s)


def _reaching(memory: ZoneMemory, network: NetworkArrays, zone: int) -> float:
    """Return the power of a zone's heater, less what others that are on take from it [%]."""
    if memory.arrival_counts[zone, zone] % 2 == 0:
        return 0.0
    left = 1.0
    for other in range(len(network.supply_shares)):
        if other != zone and memory.arrival_counts[zone, other] % 2 == 1:
            left -= network.supply_shares[other]
    return 100.0 * max(left, 0.0)


def _first(memory: ZoneMemory, network: NetworkArrays, until: float) -> tuple[int, int]:
    """Return the zone that next feels an edge, and whose, -1 if none does before an instant."""
    first, source, earliest = -1, -1, until
    for zone in range(len(memory.heat)):
        begin, end = zone, zone + 1
        if len(network.supply_shares) > 0:
            begin, end = 0, len(memory.heat)
        for other in range(begin, end):
            if memory.arrival_counts[zone, other] < memory.edge_counts[other]:
                instant = _arrival(memory, network, zone, other)
                if instant < earliest:
                    first, source, earliest = zone, other, instant
    return first, source


def _advance(memory: ZoneMemory, network: NetworkArrays, out: JointArrays, k: int, lasts_s: float) -> None:
    """Let the power stay as it is for a time; take the temperatures at its end and at a peak before it."""
    if lasts_s <= 0.0:
        return
    for mode in range(len(memory.z)):
        memory.offset[mode] = memory.z[mode] - memory.target[mode]
        memory.z[mode] = memory.target[mode] + memory.offset[mode] * _decay(network.rates[mode], lasts_s)
    for zone in range(len(memory.heat)):
        temperature, first, last = 0.0, 0.0, 0.0
        for mode in range(len(memory.z)):
            temperature += (network.outputs[zone, mode] * memory.z[mode]).real
            first += (network.slopes[zone, mode] * memory.offset[mode]).real
            last += (network.slopes[zone, mode] * (memory.z[mode] - memory.target[mode])).real
        if first * last < 0.0:
            peak = _peak(memory, network, zone, lasts_s, first, last)
            out.highest[k, zone] = max(out.highest[k, zone], peak)
            out.lowest[k, zone] = min(out.lowest[k, zone], peak)
        out.highest[k, zone] = max(out.highest[k, zone], temperature)
        out.lowest[k, zone] = min(out.lowest[k, zone], temperature)


def _decay(rate: complex, lasts_s: float) -> complex:
    """Return what is left of a mode's distance from its rest after a time."""
    left = math.exp(rate.real * lasts_s)
    if rate.imag == 0.0:
        return complex(left, 0.0)
    return complex(left * math.cos(rate.imag * lasts_s), left * math.sin(rate.imag * lasts_s))


def _peak(memory: ZoneMemory, network: NetworkArrays, zone: int, lasts_s: float, first: float, last: float) -> float:
    """Return the temperature where a zone's slope changes its sign, of the slopes at begin and end [°C]."""
    low, high, temperature = 0.0, lasts_s, 0.0
    for _ in range(_REFINED):
        instant = low + (high - low) * first / (first - last)
        temperature, slope = 0.0, 0.0
        for mode in range(len(memory.z)):
            left = memory.offset[mode] * _decay(network.rates[mode], instant)
            temperature += (network.outputs[zone, mode] * (memory.target[mode] + left)).real
            slope += (network.slopes[zone, mode] * left).real
        if slope * first > 0.0:
            low, first = instant, slope
        else:
            high, last = instant, slope
    return temperature
