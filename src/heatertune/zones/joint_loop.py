"""All zones in one closed loop: each controller's own arithmetic and PWM, and the network's exact solution between.

The controllers are called at the same instants, as from one cyclic interrupt. The power asked for last when a PWM
period begins holds for that period, as in `heatertune.proof.kernel`; each PWM may begin with an offset of its own.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Final, NamedTuple

import numpy as np

from heatertune.arrays import Array
from heatertune.errors import InputError
from heatertune.plc import controller_for
from heatertune.plc.pwm import INSTANT_S, Actuator, on_time
from heatertune.plc.words import Words
from heatertune.proof.loop import actuator_of, in_loop
from heatertune.zones.network import Modes, ThermalNetwork

__all__ = ["JointTrace", "ZoneEvent", "ZoneLoop", "run_zones"]

#: what may happen to a zone: its value is the setpoint [°C] or the load [% of its power]; a zone that is off is started
#: again from cold; a broken sensor is not among them: every program puts such a zone off
KINDS: Final = ("setpoint", "load", "off", "on", "open", "closed", "stuck", "restart")


class ZoneEvent(NamedTuple):
    """What happens to a zone at the first scan from an instant on; see `KINDS`.

    Attributes:
        time_s: [s].
        kind: of the event.
        zone: its number; of a restart of the PLC, any.
        value: setpoint [°C] or load [%].
    """

    time_s: float
    kind: str
    zone: int
    value: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ZoneLoop:
    """The controllers of all zones.

    Attributes:
        words: of each zone, all of one target and interval.
        actuator: the switch of every zone, None if the controllers make the PWM themselves.
        offsets_s: begin of each zone's PWM period after that of the first [s].

    Raises:
        InputError: words of several targets or intervals, or with a setpoint ramp or boost.
    """

    words: tuple[Words, ...]
    actuator: Actuator | None
    offsets_s: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if len({(words.target, words.sample_time_s) for words in self.words}) > 1:
            raise InputError("zones of one PLC: all controllers need the same target and sampling interval")
        if any(words.ramp is not None or words.boost is not None for words in self.words):
            raise InputError("zones are proven without setpoint ramp and boost: leave them out")
        if not self.offsets_s:
            object.__setattr__(self, "offsets_s", (0.0,) * len(self.words))

    @property
    def period_s(self) -> float:
        """PWM period [s]."""
        own = controller_for(self.words[0].target).timing(self.words[0]).pwm_period_s
        if own is not None:
            return own
        return self.sample_time_s if self.actuator is None else self.actuator.pwm_period_s

    @property
    def sample_time_s(self) -> float:
        """Interval of the controllers [s]."""
        return self.words[0].sample_time_s


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JointTrace:
    """A run of all zones.

    Attributes:
        time_s: instants of the scans, shape (K,) [s].
        temperatures_degC, powers_pct: at the scans, shape (K, n); the powers are those asked for.
        setpoints_degC: shape (K, n).
        pulses: (zone, begin [s], end [s]) of each pulse of the switches.
        readings: what each controller was given, in its units, shape (K, n).
        highest_degC, lowest_degC: at each scan, and at each switching up to the next one, shape (K, n).
        overflows: how often a controller set a flag of an overflow.
    """

    time_s: Array
    temperatures_degC: Array
    powers_pct: Array
    setpoints_degC: Array
    pulses: tuple[tuple[int, float, float], ...]
    readings: Array
    highest_degC: Array
    lowest_degC: Array
    overflows: int

    def heaters_on(self, from_s: float = 0.0) -> tuple[Array, Array]:
        """Return the instants from one on at which a heater is switched, and how many are on then, shape (m,)."""
        edges = sorted([(begin, 1) for _, begin, end in self.pulses if end > from_s]
                       + [(end, -1) for _, _, end in self.pulses if end > from_s])
        if not edges:
            return np.zeros(0), np.zeros(0)
        instants, steps = np.array(edges).T
        places = np.flatnonzero(np.diff(instants, append=math.inf) > INSTANT_S)  # one instant: one step
        return instants[places], np.cumsum(steps)[places]


class _Zone:
    """One zone's controller, switch and what is on its way to the heater."""

    def __init__(self, loop: ZoneLoop, number: int, switches: Mapping[str, str], dead_s: float) -> None:
        words = loop.words[number]
        controller = controller_for(words.target)
        core = in_loop(controller, words, [words.scaling.low_degC], switches, direct=True)
        self.core, self.parameters, self.sensor = core.core, core.parameters, core.sensor
        self.cold = core.state
        self.state = core.core.cold_start(core.parameters, core.core.own(core.state))
        actuator = actuator_of(core, loop.actuator)
        self.pwm, self.period = actuator.numbers, actuator.pwm_period_s
        self.measure: Callable[[float], Any] = partial(controller.measure, words)
        self.begin, self.periods, self.origin = loop.offsets_s[number], 0, loop.offsets_s[number]
        self.owed, self.dead = 0.0, dead_s
        self.is_on = self.is_open = self.is_stuck = False
        self.electric = False  # whether the heater gets power now, as far as edges were made
        self.arriving: deque[tuple[float, bool]] = deque()
        self.power = 0.0
        self.word: Any = None

    def start(self, *, on: bool) -> None:
        """Switch the controller on, from cold, or off."""
        self.is_on, self.power = on, 0.0
        self.state = self.core.cold_start(self.parameters, self.core.own(self.cold))

    def break_circuit(self, kind: str, now: float) -> None:
        """Open or close the heater's circuit, or let its relay stick."""
        self.is_open, self.is_stuck = kind == "open", kind == "stuck"
        self.force(now, level=self.is_stuck)

    def restart(self) -> None:
        """Start the PLC up again."""
        self.state = self.core.warm_start(self.parameters, self.cold, self.state)

    def scan(self, temperature_degC: float, now: float) -> tuple[float, int]:
        """Run one scan; return the reading and whether an overflow was flagged."""
        reading = self.core.measure(self.sensor, temperature_degC)
        begins = self.begin <= now + INSTANT_S
        self.state, power, _, flags = self.core.step(self.parameters, self.state, self.word, reading, begins)
        self.power = 0.0 if math.isnan(power) else power
        return reading, int(bool(flags and "overflow" in self.core.flags
                                 and flags >> self.core.flags.index("overflow") & 1))

    def switch(self, before: float, pulses: list[list[float]], number: int) -> None:
        """Make the edges of the periods that begin before an instant."""
        while self.begin < before - INSTANT_S:
            power = self.power if self.is_on else 0.0
            on, self.owed = on_time(max(power, 0.0), self.owed, self.pwm)
            if not (self.is_open or self.is_stuck):
                if on > 0.0:
                    pulses.append([number, self.begin, self.begin + on])
                    self.edge(self.begin, level=True)
                if on < self.period:
                    self.edge(self.begin + on, level=False)
            self.periods += 1
            self.begin = self.origin + self.periods * self.period

    def edge(self, instant: float, *, level: bool) -> None:
        """Switch the heater, if it is not so already."""
        if level != self.electric:
            self.arriving.append((instant + self.dead, level))
            self.electric = level

    def force(self, instant: float, *, level: bool) -> None:
        """Set the heater's power from outside, and take back edges that were made beyond the instant."""
        while self.arriving and self.arriving[-1][0] - self.dead > instant:
            _, last = self.arriving.pop()
            self.electric = not last
        self.edge(instant, level=level)


def run_zones(
    loop: ZoneLoop, network: ThermalNetwork, events: Sequence[ZoneEvent], duration_s: float, *,
    switches: Mapping[str, str] | None = None, noise_degC: float = 0.0, seed: int = 1,
) -> JointTrace:
    """Run the controllers of all zones on a network that rests without power; every zone is off until it is on.

    Args:
        loop: the controllers.
        network: the heaters.
        events: what happens, in order of time.
        duration_s: length of the run [s].
        switches: open point → setting, of all controllers.
        noise_degC: standard deviation of the readings' noise [°C].
        seed: of the noise.
    """
    words = loop.words[0]
    late = controller_for(words.target).delayed_s(words.scaling)
    count, interval = len(loop.words), loop.sample_time_s
    zones = [_Zone(loop, number, switches or {}, network.dead_times_s[number] + late) for number in range(count)]
    modes, scans = network.modes, int(duration_s / interval) + 1
    rest = network.steady_degC([0.0] * count)
    z = modes.inverse @ np.concatenate([rest, np.zeros(len(modes.elements))])
    noise = np.random.default_rng(seed).normal(0.0, noise_degC, (scans, count)) if noise_degC else np.zeros((1, count))
    temperatures, powers = np.empty((scans, count)), np.zeros((scans, count))
    setpoints, readings = np.full((scans, count), np.nan), np.zeros((scans, count))
    highest, lowest = np.empty((scans, count)), np.empty((scans, count))
    load, heat = np.zeros(count), np.zeros(count)
    asked = np.full(count, np.nan)
    pulses: list[list[float]] = []
    waiting, overflows = deque(sorted(events)), 0
    for k in range(scans):
        now = k * interval
        while waiting and waiting[0].time_s <= now + INSTANT_S:
            _happen(waiting.popleft(), now, zones, asked, load, pulses)
        temperatures[k] = (modes.outputs @ z).real
        seen = temperatures[k] + noise[k % len(noise)]
        for number, zone in enumerate(zones):
            if zone.is_on:
                readings[k, number], over = zone.scan(float(seen[number]), now)
                overflows += over
                powers[k, number] = zone.power
            zone.switch(now + interval, pulses, number)
        setpoints[k] = asked
        z, between = _switched(modes, z, heat, load, _arriving(zones, now + interval), now, now + interval)
        highest[k], lowest[k] = between.max(axis=0, initial=-np.inf), between.min(axis=0, initial=np.inf)
    highest, lowest = np.maximum(highest, temperatures), np.minimum(lowest, temperatures)
    return JointTrace(
        time_s=np.arange(scans, dtype=np.float64) * interval, temperatures_degC=temperatures, powers_pct=powers,
        setpoints_degC=setpoints, pulses=tuple((int(zone), begin, end) for zone, begin, end in pulses),
        readings=readings, highest_degC=highest, lowest_degC=lowest, overflows=overflows)


def _switched(
    modes: Modes, z: Array, heat: Array, load: Array, edges: Sequence[tuple[float, int, bool]], now: float, until: float
) -> tuple[Array, Array]:
    """Return the state at an instant, and the temperatures at each switching before it, shape (m, n) [°C].

    Args:
        modes: of the network.
        z: its state now, shape (modes,).
        heat: power of each heater now, shape (n,), changed in place to that at the instant [%].
        load: taken from each zone, shape (n,) [%].
        edges: of `_arriving`.
        now: [s].
        until: the instant [s].
    """
    drives = [modes.inputs @ (heat - load) + modes.constant]
    for _, number, level in edges:
        power = 100.0 if level else 0.0
        drives.append(drives[-1] + modes.inputs[:, number] * (power - heat[number]))
        heat[number] = power
    instants = [max(instant, now) for instant, *_ in edges]
    exponents = np.multiply.outer(np.diff([now, *instants, until]), modes.rates)
    decays, pushed = np.exp(exponents), np.expm1(exponents) / modes.rates * np.array(drives)
    states = [z]
    for decay, push in zip(decays, pushed, strict=True):
        states.append(decay * states[-1] + push)
    return states[-1], (np.array(states[1:-1]).reshape(-1, len(z)) @ modes.outputs.T).real


def _arriving(zones: Sequence[_Zone], until: float) -> list[tuple[float, int, bool]]:
    """Take the switchings that reach the heaters before an instant: instant, zone and level, in order of time."""
    found = []
    for number, zone in enumerate(zones):
        while zone.arriving and zone.arriving[0][0] < until:
            instant, level = zone.arriving.popleft()
            found.append((instant, number, level))
    return sorted(found)


def _happen(
    event: ZoneEvent, now: float, zones: Sequence[_Zone], setpoints: Array, load: Array, pulses: list[list[float]]
) -> None:
    zone = zones[event.zone]
    if event.kind == "setpoint":
        setpoints[event.zone] = event.value
        zone.word = zone.measure(event.value)
    elif event.kind == "load":
        load[event.zone] = event.value
    elif event.kind == "restart":
        for each in zones:
            each.restart()
    elif event.kind in ("on", "off"):
        zone.start(on=event.kind == "on")
    elif event.kind in ("open", "stuck", "closed"):
        zone.break_circuit(event.kind, now)
        for pulse in pulses:
            if event.kind != "closed" and pulse[0] == event.zone and pulse[2] > now:
                pulse[2] = now
    else:
        raise InputError(f"event {event.kind!r}: expected one of {', '.join(KINDS)}")
