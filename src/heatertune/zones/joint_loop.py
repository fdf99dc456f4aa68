"""All zones in one closed loop: each controller's own arithmetic and PWM, and the network's exact solution between.

The controllers are called at the same instants, as from one cyclic interrupt. The power asked for last when a PWM
period begins holds for that period, as in `heatertune.proof.kernel`; each PWM may begin with an offset of its own.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from itertools import permutations
from typing import Any, Final, NamedTuple, cast

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.compiled import bound, compile_function, worth_compiling
from heatertune.errors import InputError
from heatertune.plc import controller_for
from heatertune.plc.core import StepFunctions
from heatertune.plc.pwm import INSTANT_S, Actuator, in_ticks
from heatertune.plc.single_precision import to_single
from heatertune.plc.words import Words
from heatertune.proof.kernel import SetpointProgram, setpoint_word_now
from heatertune.proof.loop import LoopController, actuator_of, in_loop
from heatertune.proof.prove_words import actuator_for
from heatertune.proof.ripple_and_wear import ripple_degC
from heatertune.settings import Conditions
from heatertune.zones.decoupling import Decoupling, decoupling_arrays, demand_one_sensor
from heatertune.zones.joint_kernel import (
    KINDS,
    JointArrays,
    NetworkArrays,
    ZoneEvents,
    ZoneMemory,
    ZoneWords,
    decoupled_call,
    neighbours_pct,
    plain_call,
    run_joint,
    scan_zone,
    scan_zones,
)
from heatertune.zones.network import ThermalNetwork

__all__ = [
    "JointCriterion", "JointTrace", "PeakPower", "RunPhase", "StartOrder", "ZoneEvent", "ZoneLoop", "bound_kernel",
    "calm_actuator", "event_arrays", "memory_at_rest", "name_order", "nested_pairs", "network_arrays",
    "offsets_for", "overshoot_criteria", "pwm_option", "ramp_program", "residual_error_degC", "rest_criteria",
    "run_zones",
    "start_orders", "summarize_orders", "tightest_degC", "zone_spread",
]

_MOST_PLAIN: Final = 20_000  # scans of all zones that take as long as to compile the kernel
_ORDERS: Final = 100  # of the zones' pulses tried at random
_MIDDLE_PCT: Final = 40.0  # power from which on an error may move it to both sides
_FREE_PCT: Final = 2.0  # from a limit of the power: nearer, it may stay for that reason
_FADING: Final = 10  # scans after which P and D parts stay
_MOST_TRIES: Final = 1000  # of moving the power to the middle
_STAYS: Final = 300  # scans without a change of the power: such an error is never corrected
_RIPPLE: Final = 0.2  # of the tolerance, peak to peak: so much is left to the PWM
_EVERY_ORDER: Final = 3  # zones of which every order is run
_OF_RANGE: Final = 0.25  # of the sensor's counts: larger errors are not tried


class ZoneEvent(NamedTuple):
    """What happens to a zone at the first scan from an instant on; see `heatertune.zones.joint_kernel.KINDS`.

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
        decoupling: what each zone's program adds for its neighbours' temperatures; None: nothing.

    Raises:
        InputError: words of several targets, intervals or setpoint ramps, or with a boost; decoupled zones of several
            sensor ranges, or of a target whose controller has no input for it.
    """

    words: tuple[Words, ...]
    actuator: Actuator | None
    offsets_s: tuple[float, ...] = ()
    decoupling: Decoupling | None = None

    def __post_init__(self) -> None:
        if len({(words.target, words.sample_time_s, words.ramp) for words in self.words}) > 1:
            raise InputError("zones of one PLC: all controllers need the same target, sampling interval and setpoint "
                             "ramp")
        if any(words.boost is not None for words in self.words):
            raise InputError("zones are proven without boost: leave it out")
        if self.decoupling is not None:
            demand_one_sensor(self.words)
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
        pulses: zone, begin [s] and end [s] of each pulse of the switches, zone after zone, shape (p, 3).
        readings: what each controller was given, in its units, shape (K, n).
        highest_degC, lowest_degC: from each scan up to the next one, shape (K, n).
        overflows: how often a controller set a flag of an overflow.
    """

    time_s: Array
    temperatures_degC: Array
    powers_pct: Array
    setpoints_degC: Array
    pulses: Array
    readings: Array
    highest_degC: Array
    lowest_degC: Array
    overflows: int

    def heaters_on(self, from_s: float = 0.0) -> tuple[Array, Array]:
        """Return the instants from one on at which a heater is switched, and how many are on then, shape (m,)."""
        pulses = self.pulses[self.pulses[:, 2] > from_s]
        if not len(pulses):
            return np.zeros(0), np.zeros(0)
        instants, steps = np.concatenate([pulses[:, 1], pulses[:, 2]]), np.repeat([1.0, -1.0], len(pulses))
        order = np.lexsort((steps, instants))
        instants, steps = instants[order], steps[order]
        places = np.flatnonzero(np.diff(instants, append=math.inf) > INSTANT_S)  # one instant: one step
        return instants[places], np.cumsum(steps)[places]


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
    controllers, scans = _Controllers(loop, switches or {}), int(duration_s / loop.sample_time_s) + 1
    periods = math.ceil((scans + 1) * loop.sample_time_s / controllers.pwm[0]) + 2
    memory = memory_at_rest(loop, network, periods, 2 * periods + len(events))
    shape = scans, len(loop.words)
    noise = np.random.default_rng(seed).normal(0.0, noise_degC, shape) if noise_degC else np.zeros((1, shape[1]))
    out = JointArrays(*(np.zeros(shape) for _ in JointArrays._fields))
    controllers.run(sorted(events), loop.sample_time_s, network_arrays(loop, network), noise, memory, out)
    pulses = np.concatenate([
        np.column_stack([np.full(count, zone), memory.pulse_begin[zone, :count], memory.pulse_end[zone, :count]])
        for zone, count in enumerate(memory.pulse_counts)])
    return JointTrace(
        time_s=np.arange(scans, dtype=np.float64) * loop.sample_time_s, temperatures_degC=out.temperatures,
        powers_pct=out.powers, setpoints_degC=out.setpoints, pulses=pulses, readings=out.readings,
        highest_degC=out.highest, lowest_degC=out.lowest, overflows=int(memory.overflows[0]))


def residual_error_degC(words: Words, switches: Mapping[str, str]) -> float:
    """Return the largest error that a controller of whole numbers never corrects, as it moves by whole increments [°C].

    Args:
        words: of the controller.
        switches: open point → setting.
    """
    counts = controller_for(words.target).sensor(words.scaling).counts
    limit = int(_OF_RANGE * counts)
    integral = _Integral(words, tuple(sorted(switches.items())), limit)
    return _residual_counts(integral, limit) * words.scaling.span_degC / counts


class _Integral:
    """The integral part of one controller while its error stays as it is."""

    def __init__(self, words: Words, switches: tuple[tuple[str, str], ...], limit: int) -> None:
        controller, scaling = controller_for(words.target), words.scaling
        self._own = in_loop(controller, words, [scaling.low_degC], dict(switches), direct=True)
        self._middle_degC = scaling.low_degC + 0.5 * scaling.span_degC + 0.25 * self._own.resolution_degC
        self._setpoint, self._limit = controller.measure(words, self._middle_degC), limit
        self.is_whole = isinstance(self._setpoint, int)

    def _run(self, state: Any, counts: int, scans: int, from_pct: float | None = None) -> tuple[Any, float]:
        """Return state and power [%] after so many scans, or as soon as the power is not the one given."""
        core, power = self._own.core, 0.0
        reading = core.measure(self._own.sensor, self._middle_degC + counts * self._own.resolution_degC)
        for _ in range(scans):
            state, power, *_ = core.step(self._own.parameters, state, self._setpoint, reading, True)
            if from_pct is not None and power != from_pct:
                break
        return state, power

    @cached_property
    def _at_middle(self) -> Any:
        """Return a state in which the integral part gives a power in the middle; None: no error moves it there."""
        state, power = self._own.core.cold_start(self._own.parameters, self._own.core.own(self._own.state)), 0.0
        counts, scans = 1, _FADING
        for _ in range(_MOST_TRIES):
            before, (state, pushed) = power, self._run(state, -counts, scans)
            state, power = self._run(state, 0, _FADING)
            following = self._next_push(counts, scans, pushed)
            if power >= _MIDDLE_PCT or (scans > _STAYS and power == before and following[0] >= counts):
                break
            counts, scans = following
        return state if power >= _MIDDLE_PCT else None

    def _next_push(self, counts: int, scans: int, power: float) -> tuple[int, int]:
        """Return error and scans to try next; smaller where the P part alone reaches the limit, which holds the sum."""
        if power >= 100.0 and scans > _STAYS:
            return max(counts // 2, 1), scans
        return min(2 * counts, self._limit), 2 * scans if counts == self._limit else scans

    def stays(self, counts: int) -> bool:
        """Return whether an error of so many counts of the sensor, on either side, leaves the power where it is."""
        if self._at_middle is None:
            return True
        for sign in (-1, 1):
            state, before = self._run(self._own.core.own(self._at_middle), sign * counts, _FADING)
            if _FREE_PCT < before < 100.0 - _FREE_PCT and self._run(
                    state, sign * counts, _STAYS, before)[1] == before:
                return True
        return False


def _residual_counts(integral: _Integral, limit: int) -> int:
    """Return the largest error that stays, a number beyond the limit where that does, too [counts of the sensor]."""
    if not integral.is_whole:
        return 0
    least, most = 0, 1
    while most < limit and integral.stays(most):
        least, most = most, min(2 * most, limit)
    if most == limit and integral.stays(limit):
        return limit + 1
    while most - least > 1:
        middle = (least + most) // 2
        least, most = (middle, most) if integral.stays(middle) else (least, middle)
    return least


class _Controllers:
    """The controllers of all zones, as the kernel takes them."""

    def __init__(self, loop: ZoneLoop, switches: Mapping[str, str]) -> None:
        self.controller, self.words = controller_for(loop.words[0].target), loop.words
        started = [in_loop(self.controller, words, [words.scaling.low_degC], switches, direct=True)
                   for words in loop.words]
        self.core, self.pwm = started[0].core, actuator_of(started[0], loop.actuator).numbers
        self.parameters = nested_pairs([(each.parameters, each.sensor) for each in started])
        self.program, self.decoupling = ramp_program(started[0]), decoupling_arrays(loop.decoupling, loop.words)
        self.is_decoupled = loop.decoupling is not None
        self.cold, self.states = (nested_pairs([
            each.core.cold_start(each.parameters, each.core.own(each.state)) for each in started]) for _ in range(2))

    def run(self, events: Sequence[ZoneEvent], interval_s: float, network: NetworkArrays, *others: Any) -> None:
        """Run the kernel, compiled where that pays; `others`: its last arguments."""
        measured = [self.controller.measure(self.words[each.zone], each.value if each.kind == "setpoint" else
                                            self.words[each.zone].scaling.low_degC) for each in events]
        none = self.controller.measure(self.words[0], self.words[0].scaling.low_degC)
        now, last = np.array([[none] * len(self.words)] * 2)
        words = ZoneWords(now, np.array([*measured, none]), last, np.zeros(len(now), dtype=np.int64), self.program,
                          self.decoupling)
        own: tuple[Any, ...] = self.parameters, self.cold, self.states, words
        flags, function = self.core.flags, bound_kernel(
            self.core, len(self.words), is_decoupled=self.is_decoupled)
        overflow = 1 << flags.index("overflow") if "overflow" in flags else 0
        if self.core.compiles and worth_compiling(others[-1].powers.size, function.__qualname__, _MOST_PLAIN, function):
            own = to_single(own) if self.core.singles else own
            function = compile_function(function, calls=True)
        function(*own, interval_s, overflow, self.pwm, network, event_arrays(events), *others)


def ramp_program(controller: LoopController) -> SetpointProgram:
    """Return the setpoint ramp of a controller that runs, as the kernel takes it: a program without phases."""
    nothing = np.zeros(0)
    return SetpointProgram(nothing, nothing, controller.ramp_step, controller.ramp_calls, controller.ramp_hold)


def nested_pairs(items: Sequence[Any]) -> Any:
    """Return (first, (second, third)), and so on."""
    nested = items[-1]
    for item in reversed(items[:-1]):
        nested = item, nested
    return nested


@cache
def bound_kernel(
    core: StepFunctions, count: int, *, is_decoupled: bool = False, neighbour_reading: Callable[..., Any] | None = None
) -> Callable[..., int]:
    """Return the kernel with a controller in it for so many zones, a plain function.

    Args:
        core: of the controller.
        count: number of zones.
        is_decoupled: whether the program of each adds something for its neighbours' readings.
        neighbour_reading: (sensor, temperature [°C]) → a neighbour's reading; None: as the controller's own.
    """
    call = bound(plain_call, step=core.step)
    if is_decoupled:
        assert core.disturbance_step is not None, "see ZoneLoop"
        call = bound(decoupled_call, disturbance_step=core.disturbance_step,
                     neighbours_pct=bound(neighbours_pct, measure=neighbour_reading or core.measure))
    one = bound(scan_zone, plain_call=call, measure=core.measure, warm_state=core.warm_start,
                cold_state=core.cold_start,
                setpoint_word_now=bound(setpoint_word_now, setpoint_word=core.store_setpoint))
    scan = one
    for _ in range(count - 1):
        scan = bound(scan_zones, scan_zone=one, other_zones=scan)
    return cast("Callable[..., int]", bound(run_joint, scan_zones=scan))


def event_arrays(events: Sequence[ZoneEvent]) -> ZoneEvents:
    """Return events in order of time as the kernel takes them.

    Raises:
        InputError: an unknown kind of event.
    """
    for each in events:
        if each.kind not in KINDS:
            raise InputError(f"event {each.kind!r}: expected one of {', '.join(KINDS)}")
    rows = [(each.time_s, KINDS.index(each.kind), each.zone, each.value) for each in events]
    time, kind, zone, value = zip(*rows, (math.inf, 0, 0, 0.0), strict=True)
    return ZoneEvents(np.array(time), np.array(kind), np.array(zone), np.array(value))


def network_arrays(loop: ZoneLoop, network: ThermalNetwork) -> NetworkArrays:
    """Return a network as the kernel takes it, behind the delays of the controllers."""
    modes, words = network.modes, loop.words[0]
    late = controller_for(words.target).delayed_s(words.scaling)
    rates, outputs, rest, shifts = (np.array(each, dtype=np.complex128, order="C") for each in (
        modes.rates, modes.outputs, -modes.constant / modes.rates, -modes.inputs / modes.rates[:, None]))
    shares = np.array(network.supply_shares if network.is_supply_shared else (), dtype=np.float64)
    return NetworkArrays(rates, outputs, outputs * rates, rest, shifts, np.array(network.dead_times_s) + late, shares)


def memory_at_rest(loop: ZoneLoop, network: ThermalNetwork, periods: int, edges: int) -> ZoneMemory:
    """Return the memory of a loop at rest without power, with places for so many PWM periods and edges of each zone."""
    count, modes = len(loop.words), network.modes
    states = np.concatenate([network.steady_degC([0.0] * count), np.zeros(len(modes.elements))])
    z, offsets = (modes.inverse @ states).astype(np.complex128), np.array(loop.offsets_s, dtype=np.float64)
    heat, load, power, carry = np.zeros((4, count))
    is_on, command, fault, is_unread, period_counts, edge_counts, pulse_counts = np.zeros((7, count), dtype=np.int64)
    arrival_counts = np.zeros((count, count), dtype=np.int64)
    return ZoneMemory(
        z=z, target=np.zeros_like(z), offset=np.zeros_like(z), heat=heat, load=load, setpoint=np.full(count, np.nan),
        power=power, carry=carry, begin=offsets.copy(), origin=offsets, is_on=is_on, command=command, fault=fault,
        is_unread=is_unread,
        period_counts=period_counts, edge_counts=edge_counts, arrival_counts=arrival_counts, pulse_counts=pulse_counts,
        edges=np.zeros((count, edges)), pulse_begin=np.zeros((count, periods)), pulse_end=np.zeros((count, periods)),
        overflows=np.zeros(1, dtype=np.int64))


def calm_actuator(
    conditions: Conditions, words: Words, network: ThermalNetwork, setpoints_degC: Sequence[float],
    tolerance_degC: float,
) -> Actuator:
    """Return the switch of every zone; without a stated PWM period, TA in as many parts as a small ripple takes.

    Args:
        conditions: of the proof.
        words: of one of the zones.
        network: the heaters.
        setpoints_degC: of the zones [°C].
        tolerance_degC: at rest; the ripple may take a fifth of it [°C].

    Raises:
        InputError, OutOfRange: as `actuator_for`.
    """
    actuator, controller = actuator_for(conditions, words), controller_for(words.target)
    if not pwm_option(conditions, words, actuator):
        return actuator
    holding_pct = np.clip(network.holding_pct(setpoints_degC), 0.0, 100.0)
    heaters = [(network.neighbours_held(zone), float(power)) for zone, power in enumerate(holding_pct)]
    parts = words.sample_time_s / np.arange(1, max(int(words.sample_time_s), 1) + 1)
    for period in map(float, parts[parts <= actuator.pwm_period_s]):
        if not in_ticks(period, controller.tick_s):
            continue
        actuator = actuator_for(replace(conditions, pwm_period_s=period), words)
        ripple = max(ripple_degC(heater, period, power) for heater, power in heaters)
        if ripple <= _RIPPLE * tolerance_degC:
            break
    return actuator


def pwm_option(conditions: Conditions, words: Words, actuator: Actuator) -> str:
    """Return the option that states the PWM period of an actuator; "" where it is stated, or the controller's own.

    Args:
        conditions: of the proof.
        words: of one of the zones.
        actuator: of each zone.
    """
    controller = controller_for(words.target)
    periods = {conditions.pwm_period_s, controller.timing(words).pwm_period_s, controller.pwm_period_s}
    return f" --pwm-period {actuator.pwm_period_s:g}" if periods == {None} else ""


def offsets_for(duties_pct: npt.ArrayLike, period_s: float, resolution_s: float) -> tuple[float, ...]:
    """Return offsets of PWM periods with which as few heaters as can be are on at once.

    Pulses that follow each other around the period need no more than ⌈Σ duty⌉ heaters at once. Of several such orders,
    and of offsets spread evenly, those are taken with which other plausible duties need the fewest beyond that, too.

    Args:
        duties_pct: of each zone, in one row for each plausible case, the most likely one first, shape (m, n) [%].
        period_s: of the PWM [s].
        resolution_s: offsets are multiples of it [s].
    """
    shares = np.clip(np.atleast_2d(np.asarray(duties_pct, dtype=np.float64)), 0.0, 100.0) / 100.0
    count, random = shares.shape[1], np.random.default_rng(1)
    gap = (math.ceil(float(shares[0].sum())) - float(shares[0].sum())) / count  # room for duties that vary
    best: tuple[tuple[int, int], Array] | None = None
    for order in [np.arange(count), np.argsort(shares[0]), *(random.permutation(count) for _ in range(_ORDERS))]:
        for width in (shares[0][order] + gap, shares[0][order], np.full(count, 1.0 / count)):
            begins = np.empty(count)
            begins[order] = np.concatenate([[0.0], np.cumsum(width)[:-1]]) % 1.0
            begins = np.round(begins * period_s / resolution_s) * resolution_s / period_s % 1.0
            beyond = [_most_at_once(begins, share) - math.ceil(float(share.sum()) - 1e-9) for share in shares]
            rank = max(beyond[0], 0), int(np.sum(np.maximum(beyond, 0)))
            if best is None or rank < best[0]:
                best = rank, begins
    assert best is not None
    first = best[1][0]
    return tuple(round(float((begin - first) % 1.0 * period_s / resolution_s)) * resolution_s % period_s
                 for begin in best[1])


def _most_at_once(begins: Array, shares: Array) -> int:
    """Return how many pulses around a period overlap at most; each begins where another does not yet end."""
    since = (begins[:, None] - begins) % 1.0  # at the begin of each pulse
    return int(np.max(np.sum(since < shares - 1e-9, axis=1)))


@dataclass(frozen=True, slots=True, kw_only=True)
class JointCriterion:
    """One figure of a run and its limit.

    Attributes:
        name: what was measured, with its unit.
        value, limit: the value must not exceed the limit.
        where: zone and run.
        cause: number of the zone whose slower controller would lower the value; -1: of none alone.
    """

    name: str
    value: float
    limit: float
    where: str
    cause: int = -1

    @property
    def ok(self) -> bool:
        """Whether the limit is kept."""
        return self.value <= self.limit

    @property
    def share(self) -> float:
        """The value as a share of its limit; a limit of 0 that is kept counts as 0."""
        return 0.0 if self.value <= 0.0 else self.value / self.limit if self.limit > 0.0 else math.inf


class RunPhase(NamedTuple):
    """A part of a run: what is judged between two instants."""

    kind: str
    zone: int
    start_s: float
    end_s: float
    change_degC: float = 0.0
    idle: tuple[int, ...] = ()  # zones that are not judged
    started: tuple[int, ...] = ()  # zones that are started while others run; their neighbours may not overshoot either
    rests: bool = True  # whether the zones can hold their setpoints


def zone_spread(highest_degC: Array, lowest_degC: Array, setpoints_degC: Array) -> tuple[float, int, int]:
    """Return by how much the largest difference between two zones exceeds that between their setpoints [°C].

    A zone may be warmer than another one by as much as its setpoint is higher. The numbers of both zones follow, the
    warmer one first.

    Args:
        highest_degC: of each zone from each scan up to the next one, shape (K, n) [°C].
        lowest_degC: likewise, shape (K, n) [°C].
        setpoints_degC: of the zones, shape (n,) [°C].
    """
    beyond = [(float(np.max(highest_degC[:, warm] - lowest_degC[:, cold]))
               - max(float(setpoints_degC[warm] - setpoints_degC[cold]), 0.0), warm, cold)
              for warm in range(len(setpoints_degC)) for cold in range(len(setpoints_degC)) if warm != cold]
    most, warm, cold = max(beyond)
    return max(most, 0.0), warm, cold


def tightest_degC(whole_degC: float, most_pct: float | None, most_degC: float | None) -> float | None:
    """Return the lower of two limits, one of them a share of a rise or change [°C]; None where there is none [°C]."""
    limits = [] if most_pct is None else [most_pct / 100.0 * whole_degC]
    return min([*limits, *([] if most_degC is None else [most_degC])], default=None)


def overshoot_criteria(
    make: Callable[..., JointCriterion], rise_degC: float, name: str, beyond_degC: Array,
    most: tuple[float | None, float | None],
) -> Iterator[JointCriterion]:
    """Yield an overshoot as a share of the rise, if it is limited, as a share of the rise or in °C.

    Args:
        make: a criterion of a name, value and limit.
        rise_degC: from the ambient to the setpoint [°C].
        name: of the criterion.
        beyond_degC: distance from the setpoint, shape (K,) [°C].
        most: limits, as a share of the rise [%] and in °C; None: none.
    """
    if (limit_degC := tightest_degC(rise_degC, *most)) is not None:
        yield make(name=name, value=100.0 * float(beyond_degC.max()) / rise_degC, limit=100.0 * limit_degC / rise_degC)


def rest_criteria(
    make: Callable[..., JointCriterion], errors: tuple[Array, Array, Array], tolerance_degC: float
) -> Iterator[JointCriterion]:
    """Yield offset, swing and largest error in the last fifth of a phase.

    Args:
        make: a criterion of a name, value and limit.
        errors: distances from the setpoint at the scans, and the highest and lowest between them, shape (K,) [°C].
        tolerance_degC: limit of each [°C].
    """
    last, high, low = (each[-max(len(each) // 5, 2):] for each in errors)
    make = partial(make, limit=tolerance_degC)
    yield make(name="offset at rest [°C]", value=float(np.abs(last.mean())))
    yield make(name="swing at rest [°C]", value=float(np.ptp(last)))
    yield make(name="error at rest [°C]", value=float(max(high.max(), -low.min())))


@dataclass(slots=True)
class PeakPower:
    """How many heaters are on at once while the setpoints are held, over all runs."""

    most: int = 0
    ever: int = 0
    bound: int = 0
    periods: int = 0
    within_bound: int = 0

    @property
    def share(self) -> float:
        """Share of the PWM periods in which no more heaters than the bound are on at once."""
        return self.within_bound / self.periods if self.periods else 1.0

    def count(self, trace: JointTrace, phases: Sequence[RunPhase], period_s: float, bound: int) -> None:
        """Count the heaters in the last fifth of phases in which the setpoints are held; `bound` is ⌈Σ duty⌉."""
        self.bound = self.bound or bound  # that of the best fit, which runs first
        instants, on = trace.heaters_on()
        self.ever = max(self.ever, int(np.max(on, initial=0)))
        for phase in phases:
            start = phase.end_s - 0.2 * (phase.end_s - phase.start_s)
            inside = (instants >= start) & (instants < phase.end_s)
            period = np.floor((instants[inside] - start) / period_s).astype(np.int64)
            if len(period):
                most = np.zeros(int(period.max()) + 1)
                np.maximum.at(most, period, on[inside])
                self.most = max(self.most, int(most.max()))
                self.periods += len(most)
                self.within_bound += int(np.count_nonzero(most <= bound))


#: groups of zones, by their numbers, each started when those before it rest
StartOrder = tuple[tuple[int, ...], ...]


def start_orders(zones: int) -> tuple[StartOrder, ...]:
    """Return the orders in which so many zones are started: of up to three every order, of more each first and last.

    In the first ones, a zone that rests is followed by all others at once, which move it the most.
    """
    every = range(zones)
    alone = [(zone, tuple(other for other in every if other != zone)) for zone in every]
    orders, last = list(permutations(every)), []
    if zones > _EVERY_ORDER:
        orders = [tuple(every), tuple(every[::-1]), (*every[::2], *every[1::2]), (*every[1::2], *every[::2])]
        last = [(others, (zone,)) for zone, others in alone]
    first = [((zone,), others) for zone, others in alone if others]
    return tuple(dict.fromkeys([*first, *(tuple((zone,) for zone in order) for order in orders), *last]))


def name_order(order: StartOrder, zones: Sequence[str], more: str = "") -> str:
    """Return the label of a run in which zones of these names are started in an order; `more`: what else differs."""
    groups = ", then ".join(" and ".join(zones[zone] for zone in group) for group in order)
    return f"zones started in turn: {groups}{more and ', '}{more}"


def summarize_orders(zones: Sequence[str], runs: Sequence[str]) -> list[str]:
    """Return what a verdict says about the orders in which zones are started, a line; nothing where one was not run.

    Args:
        zones: their names.
        runs: labels of the runs.
    """
    orders = start_orders(len(zones))
    if not {name_order(order, zones) for order in orders} <= {*runs}:
        return []
    which = "every order" if len(zones) <= _EVERY_ORDER else f"{len(orders)} orders, each zone first and last"
    first = "; one before all others, which follow when it rests or nears its setpoint" if len(zones) > 1 else ""
    return [f"starts: all zones together; one after the other in {which}, each when those before it rest{first}"]
