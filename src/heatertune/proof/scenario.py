"""A scenario: heat-up, then disturbances, setpoint changes and power failures at given instants, with sensor noise.

Also the events of many scenarios as arrays for the kernel, the earliest first.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.codec import LEFT_OUT
from heatertune.errors import InputError, OutOfRange
from heatertune.model.loss_curve import top_degC
from heatertune.model.model_values import HeaterModel
from heatertune.proof.kernel import JUMP, LOAD, MAINS, PHASE
from heatertune.units import check

__all__ = [
    "LED", "REST_SHARE", "TO_SETPOINT", "Course", "Disturbance", "Load", "Mains", "NewSetpoint", "OutageLengths",
    "Phase", "PlcPower", "Scenario", "SetpointRampEvent", "TemperatureStep", "can_hold", "conditions", "delay_heater",
    "event_name", "events_of", "heat_up", "heated_s", "kinds_of", "lengthen", "opening", "paper_scenario", "phases_of",
    "scenario_for", "temperatures", "way_back",
]


@dataclass(frozen=True, slots=True, kw_only=True)
class TemperatureStep:
    """The temperature of every lag jumps at once: cold goods, an opened door.

    Attributes:
        time_s: [s].
        temperature_degC: the jump, signed [°C].
    """

    time_s: float
    temperature_degC: float

    def __post_init__(self) -> None:
        check("time_s", self.time_s, above=0.0)
        check("temperature_degC", self.temperature_degC)


@dataclass(frozen=True, slots=True, kw_only=True)
class Load:
    """A power that is added at the heater's input from then on: a draught, a second source of heat.

    It acts after the dead time, as the heater's own power does.

    Attributes:
        time_s: [s].
        power_pct: added to all that is there already, signed [% of full power].
    """

    time_s: float
    power_pct: float

    def __post_init__(self) -> None:
        check("time_s", self.time_s, above=0.0)
        check("power_pct", self.power_pct)


@dataclass(frozen=True, slots=True, kw_only=True)
class NewSetpoint:
    """Another temperature is asked for from then on.

    Attributes:
        time_s: [s].
        setpoint_degC: [°C]. A ramp on the way to it belongs to the words.
        small: True: the change is so small that its overshoot is judged as a share of it; None: as one of the rise.
        unheld: True: no power holds it, so the heater cools down towards its ambient and no criterion judges the phase;
            None: every heater holds it.
    """

    time_s: float
    setpoint_degC: float
    small: bool | None = field(default=None, metadata=LEFT_OUT)
    unheld: bool | None = field(default=None, metadata=LEFT_OUT)

    def __post_init__(self) -> None:
        check("time_s", self.time_s, above=0.0)
        check("setpoint_degC", self.setpoint_degC)


@dataclass(frozen=True, slots=True, kw_only=True)
class Mains:
    """The mains change: the heater's power is multiplied from then on, which acts after the dead time.

    Attributes:
        time_s: [s].
        share: of the rated power that full power then is; 0: the heater's circuit is open, and the PLC runs on.
    """

    time_s: float
    share: float

    def __post_init__(self) -> None:
        check("time_s", self.time_s, above=0.0)
        check("share", self.share, least=0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class PlcPower:
    """The PLC loses its supply, and the heater with it, or gets it back and starts up.

    Attributes:
        time_s: [s].
        on: whether it has its supply from then on.
    """

    time_s: float
    on: bool

    def __post_init__(self) -> None:
        check("time_s", self.time_s, above=0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class SetpointRampEvent:
    """The program around the controller leads the setpoint straight from one temperature to another, and stays there.

    It is set anew at each scan. A PLC without supply gets it and starts up.

    Attributes:
        time_s: [s].
        from_degC: setpoint at the begin [°C].
        setpoint_degC: setpoint at the end; the same: a soak [°C].
        duration_s: of the way [s].
    """

    time_s: float
    from_degC: float
    setpoint_degC: float
    duration_s: float

    def __post_init__(self) -> None:
        check("time_s", self.time_s, above=0.0)
        check("from_degC", self.from_degC)
        check("setpoint_degC", self.setpoint_degC)
        check("duration_s", self.duration_s, above=0.0)

    @property
    def degC_per_s(self) -> float:
        """How fast the setpoint moves [°C/s]."""
        return (self.setpoint_degC - self.from_degC) / self.duration_s


Disturbance = TemperatureStep | Load | NewSetpoint | Mains | PlcPower | SetpointRampEvent


#: The paper's record (Tables 3 and 4): disturbance in the 27th minute, last row at 40 min [s].
_PAPER_STEP_S: Final = 1620.0
_PAPER_DURATION_S: Final = 2400.0
#: Sum of lags and dead time up to which the paper's times suit a heater [s].
_PAPER_HEATER_S: Final = 600.0
#: The paper's temperature step, 53.3 → 44.5 °C, is 30 % of its setpoint step of 29.3 °C.
_TEMPERATURE_STEP_SHARE: Final = 0.3
#: Record of a heater as fast as the paper's [s]; recovery gets nearly as long as heat-up.
_DURATION_S: Final = 3000.0
_NOT_LED: Final = (0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """One run of the loop, from a heater (or cooler) at rest with the power off.

    Attributes:
        setpoint_degC: what is asked for first [°C]. A ramp on the way to it belongs to the words.
        duration_s: [s].
        ambient_degC: temperature without power [°C]; None: the model's own.
        start_degC: temperature of all lags at the start [°C]; None: ambient.
        disturbances: in order of time; each begins a phase.
        rests_s: how long the heater has to be at rest at the end of each phase, one number more than disturbances [s];
            empty: see `Limits.steady_share`.
        noise_degC: standard deviation of the sensor's Gaussian noise [°C].
        seed: of that noise.
        setpoint_low_degC: lower end of the range of setpoints that the user stated, of a cooler the upper one [°C];
            None: one setpoint, or none, was stated, and a lower one is only the test sequence's own.

    Raises:
        OutOfRange: a time or temperature without meaning, a start at the setpoint, disturbances out of order or
            after the end, a rest longer than its phase.
    """

    setpoint_degC: float
    duration_s: float
    ambient_degC: float | None = None
    start_degC: float | None = None
    disturbances: tuple[Disturbance, ...] = ()
    rests_s: tuple[float, ...] = ()
    noise_degC: float = 0.0
    seed: int = 0
    setpoint_low_degC: float | None = field(default=None, metadata=LEFT_OUT)

    def __post_init__(self) -> None:
        check("setpoint_degC", self.setpoint_degC)
        check("duration_s", self.duration_s, above=0.0)
        check("noise_degC", self.noise_degC, least=0.0)
        check("seed", self.seed, least=0)
        for name in ("ambient_degC", "start_degC"):
            if (value := getattr(self, name)) is not None:
                check(name, value, least=-273.15)
                if value == self.setpoint_degC:
                    raise OutOfRange(name, value, f"not setpoint_degC = {self.setpoint_degC:g}")
        times = [event.time_s for event in self.disturbances]
        ends = [*times, self.duration_s]
        if any(later <= earlier for earlier, later in pairwise(ends)):
            raise OutOfRange("disturbances", times, f"ascending in time and < duration_s = {self.duration_s:g}")
        if not self.rests_s:
            return
        lengths = [end - begin for begin, end in pairwise([0.0, *ends])]
        short = any(not 0.0 <= rest <= length for rest, length in zip(self.rests_s, lengths, strict=False))
        if short or len(self.rests_s) != len(lengths):
            raise OutOfRange("rests_s", self.rests_s, f"one for each phase, of {lengths} s, and no longer")

    @property
    def setpoints_degC(self) -> tuple[float, ...]:
        """The setpoint of each phase [°C]."""
        targets = [self.setpoint_degC]
        for event in self.disturbances:
            targets.append(event.setpoint_degC if isinstance(event, NewSetpoint | SetpointRampEvent) else targets[-1])
        return tuple(targets)

    @property
    def lower_setpoint_degC(self) -> float | None:
        """The lowest setpoint that is held, to which the setpoint changes first [°C]; None without a change."""
        return next((event.setpoint_degC for event in self.disturbances if isinstance(event, NewSetpoint)), None)

    @property
    def held_setpoints_degC(self) -> tuple[float, ...]:
        """The setpoints that the heater has to hold [°C]."""
        unheld = [False, *(isinstance(event, NewSetpoint) and bool(event.unheld) for event in self.disturbances)]
        return tuple(setpoint for setpoint, coasts in zip(self.setpoints_degC, unheld, strict=True) if not coasts)

    @property
    def supplied(self) -> tuple[bool, ...]:
        """Whether the PLC has its supply in each phase."""
        powered = [True]
        for event in self.disturbances:
            powered.append(event.on if isinstance(event, PlcPower) else isinstance(event,
                                                                                   SetpointRampEvent) or powered[-1])
        return tuple(powered)

    @property
    def leads(self) -> tuple[float, ...]:
        """See `heatertune.proof.meter.Meter`; empty where the setpoint is led in no phase."""
        if not any(isinstance(event, SetpointRampEvent) for event in self.disturbances):
            return ()
        led = [(event.time_s, event.from_degC, event.degC_per_s, event.duration_s) if isinstance(event,
                                                                                                 SetpointRampEvent)
               else _NOT_LED for event in self.disturbances]
        return (*_NOT_LED, *(number for phase in led for number in phase))

    @property
    def mains(self) -> tuple[float, ...]:
        """The share of the rated power that full power is in each phase, whether or not the PLC has its supply."""
        shares = [1.0]
        for event in self.disturbances:
            shares.append(event.share if isinstance(event, Mains) else shares[-1])
        return tuple(shares)


#: kinds of the phases that lead to a setpoint
TO_SETPOINT: Final = ("heat-up", "reheat", "change", "small-change", "restart")
#: kinds of the phases of a profile
LED: Final = ("ramp", "soak")
#: of the rest after an event of the test sequence, where only the overshoot counts: it has come to rest by then
REST_SHARE: Final = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Phase:
    """What a run lives through from one event to the next.

    Attributes:
        begin_s, end_s: [s].
        rest_s: from when on it is held to be at rest; `end_s`: not at all [s].
        limit_s: in which it has to get there [s].
        setpoint_degC: what is asked for [°C].
        kind: by which criteria it is judged: "heat-up", "recovery" (from a disturbance), "change", "small-change" (of
            the setpoint), "reheat" (the heater's circuit was open), "restart" (the PLC was without supply), "ramp" and
            "soak" (of a profile), or "off": by none.
        up: whether the event moves the temperature up, or adds power.
        by_power: whether it adds or takes power; a cooler's power moves the temperature down.
    """

    begin_s: float
    end_s: float
    rest_s: float
    limit_s: float
    setpoint_degC: float
    kind: str
    up: bool
    by_power: bool


@lru_cache(maxsize=8)
def phases_of(scenario: Scenario, end_s: float, first_rest_s: float) -> tuple[Phase, ...]:
    """Return the phases of a run.

    Args:
        scenario: what happens.
        end_s: instant of the last scan [s].
        first_rest_s: from when on the first phase has to be at rest, where the scenario does not tell [s].
    """
    ends = [*(event.time_s for event in scenario.disturbances), end_s]
    begins = [0.0, *ends[:-1]]
    last = [end - rest for end, rest in zip(ends, scenario.rests_s, strict=False)]
    rests, limits = (last, last) if last else ([first_rest_s, *ends[1:]], ends)
    return tuple(
        Phase(begin_s=begin, end_s=end, rest_s=min(max(begin, rest), end), limit_s=limit - begin, setpoint_degC=target,
              kind=kind, up=up, by_power=by_power)
        for begin, end, rest, limit, target, (kind, up, by_power) in zip(
            begins, ends, rests, limits, scenario.setpoints_degC, kinds_of(scenario), strict=True))


def event_name(event: Disturbance | None) -> str:
    """Return what an event is, in the few words of a picture."""
    if event is None:
        return "heat-up"
    if isinstance(event, TemperatureStep):
        return f"{event.temperature_degC:+.3g} °C at once"
    if isinstance(event, Load):
        return f"load {event.power_pct:+.3g} %"
    if isinstance(event, NewSetpoint | SetpointRampEvent):
        return f"{_led(event) if isinstance(event, SetpointRampEvent) else 'setpoint'} {event.setpoint_degC:.4g} °C"
    if isinstance(event, Mains):
        return f"power {100.0 * event.share:.3g} %" if event.share > 0.0 else "heater's circuit open"
    return "controller on" if event.on else "controller off"


def kinds_of(scenario: Scenario) -> Iterator[tuple[str, bool, bool]]:
    """Return kind and direction of each phase, and whether the direction is that of the power, see `Phase`."""
    yield "heat-up", True, True
    setpoints, supplied, mains = scenario.setpoints_degC, scenario.supplied, scenario.mains
    for number, event in enumerate(scenario.disturbances):
        if not supplied[number + 1] or mains[number + 1] == 0.0:
            yield "off", False, True
        elif isinstance(event, PlcPower):
            yield "restart", True, True
        elif isinstance(event, SetpointRampEvent):
            yield _led(event), event.setpoint_degC > event.from_degC, False
        elif _goes_on(scenario, number) or (isinstance(event, NewSetpoint) and event.unheld):
            yield "off", False, True
        elif isinstance(event, NewSetpoint):
            kind = "reheat" if _goes_on(scenario, number - 1) else "small-change" if event.small else "change"
            yield kind, setpoints[number + 1] > setpoints[number], False
        elif isinstance(event, Mains):
            yield "reheat" if mains[number] == 0.0 else "recovery", mains[number + 1] > mains[number], True
        elif isinstance(event, TemperatureStep):
            yield "recovery", event.temperature_degC > 0.0, False
        else:
            yield "recovery", event.power_pct > 0.0, True


def _goes_on(scenario: Scenario, number: int) -> bool:
    """Return whether an event closes the heater's circuit and the next one moves the setpoint before it is at rest."""
    events = scenario.disturbances[max(number, 0):number + 2]
    return len(events) == 2 and isinstance(events[0], Mains) and isinstance(events[1], NewSetpoint) and (
        bool(scenario.rests_s) and scenario.rests_s[number + 1] == 0.0)


def _led(event: SetpointRampEvent) -> str:
    return "soak" if event.degC_per_s == 0.0 else "ramp"


def conditions(
    scenario: Scenario, model: HeaterModel, held_degC: Sequence[float] | None = None
) -> tuple[float, float]:
    """Return ambient and start temperature of a run [°C].

    Args:
        scenario: of the run.
        model: the heater.
        held_degC: `scenario.held_setpoints_degC`, for callers with many heaters; None: computed here.

    Raises:
        InputError: neither scenario nor model knows the ambient temperature.
        OutOfRange: the setpoint lies outside what the heater can hold, between ambient and full power.
    """
    ambient = _ambient(scenario, model)
    top = top_degC(model, ambient)
    above, below, device = (">", "<", "heater") if model.gain_degC_per_pct > 0.0 else ("<", ">", "cooler")
    for setpoint in scenario.held_setpoints_degC if held_degC is None else held_degC:
        if not can_hold(model, setpoint, ambient):
            rule = (
                f"{above} {ambient:g} (ambient) and {below} {top:g} (ambient + 100 % · {model.gain_degC_per_pct:g} "
                f"°C/%), or this {device} cannot hold it"
            ) if model.loss is None else (
                f"{above} {ambient:g} (ambient) and {below} {top:.4g} (100 % on its loss curve), or this {device} "
                "cannot hold it"
            )
            raise OutOfRange("setpoint_degC", setpoint, rule)
    return temperatures(scenario, model)


def can_hold(model: HeaterModel, setpoint_degC: float, ambient_degC: float) -> bool:
    """Return whether a heater or cooler holds a setpoint with less than full power, and with more than none."""
    return 0.0 < (setpoint_degC - ambient_degC) / model.gain_degC_per_pct < 100.0


def temperatures(scenario: Scenario, model: HeaterModel) -> tuple[float, float]:
    """Return ambient and start temperature of a run [°C], whether or not the heater can hold the setpoint.

    Raises:
        InputError: neither scenario nor model knows the ambient temperature.
        OutOfRange: ambient or start on the side of the setpoint to which the power leads.
    """
    ambient = _ambient(scenario, model)
    start = ambient if scenario.start_degC is None else scenario.start_degC
    for name, value in (("ambient_degC", ambient), ("start_degC", start)):
        if not (scenario.setpoint_degC - value) * model.gain_degC_per_pct > 0.0:
            side = "<" if model.gain_degC_per_pct > 0.0 else ">"
            raise OutOfRange(name, value, f"{side} setpoint_degC = {scenario.setpoint_degC:g}")
    return ambient, start


def _ambient(scenario: Scenario, model: HeaterModel) -> float:
    ambient = model.ambient_degC if scenario.ambient_degC is None else scenario.ambient_degC
    if ambient is None:
        raise InputError("ambient_degC is unknown to both model and scenario: give the temperature without power")
    return ambient


def delay_heater(model: HeaterModel, delay_s: float) -> HeaterModel:
    """Return a heater whose temperature is read, or whose switch is reached, so much later."""
    return replace(model, dead_time_s=model.dead_time_s + delay_s) if delay_s > 0.0 else model


def paper_scenario(
    *, setpoint_degC: float = 53.3, ambient_degC: float | None = None, temperature_step_degC: float = -8.8,
    duration_s: float = _PAPER_DURATION_S,
) -> Scenario:
    """Return the paper's record: heat-up, and from 53.3 to 44.5 °C at once in the 27th minute."""
    return Scenario(
        setpoint_degC=setpoint_degC,
        ambient_degC=ambient_degC,
        duration_s=duration_s,
        disturbances=(TemperatureStep(time_s=_PAPER_STEP_S, temperature_degC=temperature_step_degC),),
    )


def scenario_for(
    models: Sequence[HeaterModel], *, setpoint_degC: float, ambient_degC: float | None = None,
    temperature_step_degC: float | None = None, noise_degC: float = 0.0, seed: int = 0,
) -> Scenario:
    """Return the paper's story in times that suit the slowest of the models.

    Up to 600 s of lags and dead time the temperature step comes at 1620 s, as in the paper; above, all times grow in
    proportion.

    Args:
        models: the plausible heaters.
        setpoint_degC: [°C].
        ambient_degC: temperature without power; None: the models' own [°C].
        temperature_step_degC: step of the temperature; None: 30 % of the largest setpoint step back to the
            ambient, as in the paper [°C].
        noise_degC: of the sensor, standard deviation [°C].
        seed: of that noise.

    Raises:
        InputError: no model, or nobody knows the ambient temperature.
        OutOfRange: one of the heaters cannot hold the setpoint.
    """
    if not models:
        raise InputError("a scenario needs at least one model")
    slowest = max(sum(model.lags_s) + model.dead_time_s for model in models)
    stretch = max(1.0, slowest / _PAPER_HEATER_S)
    plain = Scenario(
        setpoint_degC=setpoint_degC, ambient_degC=ambient_degC, duration_s=stretch * _DURATION_S,
        noise_degC=noise_degC, seed=seed,
    )
    step = max((setpoint_degC - conditions(plain, model)[0] for model in models), key=abs)
    fall = -_TEMPERATURE_STEP_SHARE * step if temperature_step_degC is None else temperature_step_degC
    return replace(plain, disturbances=(TemperatureStep(time_s=stretch * _PAPER_STEP_S, temperature_degC=fall),))


def events_of(
    scenario: Scenario, dead_times_s: Sequence[float], sizes: Array | None = None,
    marks: Sequence[tuple[float, int]] = (),
) -> tuple[Array, npt.NDArray[np.int64], Array]:
    """Return the disturbances as three arrays of a `Batch`: instants, kinds and values, each of shape (n, events).

    Args:
        scenario: whose disturbances.
        dead_times_s: of the n heaters [s].
        sizes: by what each disturbance is multiplied, shape (n, disturbances); None: by nothing.
        marks: (instant, kind) of what divides what is measured.
    """
    dead = np.array(dead_times_s)
    happening = zip(scenario.disturbances, _powers(scenario), strict=True)
    acting = [event for number, (what, power) in enumerate(happening) for event in _acting(number, what, power)]
    acting += [*(_Acting(time, kind, 0.0) for time, kind in marks), _Acting(math.inf, LOAD, 0.0)]
    begins, kind, value, late, sized = zip(*acting, strict=True)
    times = np.add(begins, np.multiply.outer(dead, late))
    values = np.broadcast_to(np.array(value), times.shape)
    if sizes is not None:
        values = values * np.column_stack([sizes, np.ones(len(dead))])[:, sized]  # behind them that of what has none
    kinds = np.broadcast_to(np.array(kind, dtype=np.int64), times.shape)
    order = np.lexsort((values, kinds, times), axis=1)
    times, kinds, values = (np.take_along_axis(each, order, axis=1) for each in (times, kinds, values))
    return times, kinds, values


class _Acting(NamedTuple):
    """What the kernels are told of: an instant [s], kind and value, and what differs from heater to heater.

    `late` is by how many dead times it is, `sized` the number of the disturbance whose size counts, −1: of none.
    """

    time_s: float
    kind: int
    value: float
    late: float = 0.0
    sized: int = -1


def _powers(scenario: Scenario) -> list[float]:
    """Return what full power is from each disturbance on, as a share of the rated one: none while the PLC is off."""
    return [mains * supplied for mains, supplied in zip(scenario.mains, scenario.supplied, strict=True)][1:]


def _acting(number: int, event: Disturbance, power: float) -> list[_Acting]:
    """Return what the kernels are told of a disturbance; temperature steps, loads and full power have a size."""
    if isinstance(event, TemperatureStep):
        return [_Acting(event.time_s, JUMP, event.temperature_degC, sized=number)]
    begins = _Acting(event.time_s, PHASE, 0.0)
    if isinstance(event, Load):
        return [begins, _Acting(event.time_s, LOAD, event.power_pct, 1.0, number)]
    if isinstance(event, NewSetpoint):
        return [begins]
    return [begins, _Acting(event.time_s, MAINS, power, 1.0, number)]  # also where a PLC gets its supply


class OutageLengths(NamedTuple):
    """How long the circuit is open, and the PLC without supply.

    Attributes:
        openings_s: lengths of the open circuits [s].
        restarts_s: times without supply [s].
    """

    openings_s: Sequence[float] = ()
    restarts_s: Sequence[float] = ()

    @property
    def fewer(self) -> OutageLengths:
        """A third of them: the shortest, and each third from there."""
        return OutageLengths(self.openings_s[::3], self.restarts_s[::3])


class Course:
    """Events one after the other, from a heat-up at rest for so long [s].

    Args:
        sequence: the test sequence.
        rest_s: rest after the heat-up [s].
    """

    def __init__(self, sequence: Scenario, rest_s: float) -> None:
        self._sequence, self._time_s = sequence, heated_s(sequence, rest_s)
        self._events, self._rests_s = list[Disturbance](), [rest_s]

    def add(self, event: Disturbance, lasts_s: float, rest_s: float = 0.0) -> None:
        """Let something happen, and nothing else for so long, the rest included [s]."""
        self._events.append(replace(event, time_s=self._time_s))
        self._rests_s.append(rest_s)
        self._time_s += lasts_s

    def single(
        self, number: int, event: Disturbance | None = None, *, rest_share: float = REST_SHARE
    ) -> None:
        """Let what an event of the test sequence begins happen, with another event in its place if one is given."""
        self.add(event or self._sequence.disturbances[number], *way_back(self._sequence, number, rest_share))

    def pairs(self, number: int, lengths_s: Iterable[float], rest_share: float = REST_SHARE) -> None:
        """Let an event of the test sequence happen, and after each length the one that ends it."""
        for length_s in lengths_s:
            self.add(self._sequence.disturbances[number], length_s)
            self.single(number + 1, rest_share=rest_share)

    def outages(
        self, opening: int, restart: int | None, lengths_s: OutageLengths, rest_share: float = REST_SHARE
    ) -> None:
        """Let the circuit be open and the PLC be without supply for each length; events by their numbers."""
        self.pairs(opening, lengths_s.openings_s, rest_share)
        if restart is not None:
            self.pairs(restart, lengths_s.restarts_s, rest_share)

    @property
    def scenario(self) -> Scenario:
        """All of it so far."""
        return replace(self._sequence, disturbances=tuple(self._events), rests_s=tuple(self._rests_s),
                       duration_s=self._time_s)


def heat_up(scenario: Scenario) -> Scenario:
    """Return only the heat-up of a test sequence."""
    end_s = next((event.time_s for event in scenario.disturbances), scenario.duration_s)
    return replace(scenario, disturbances=(), rests_s=scenario.rests_s[:1], duration_s=end_s)


def opening(scenario: Scenario, rest_share: float) -> Scenario:
    """Return heat-up and first event of a test sequence, each with a share of its time at rest; all without rests."""
    if len(scenario.rests_s) < 2:
        return scenario
    first, *later = scenario.disturbances
    ends, rests = [first.time_s, *(event.time_s for event in later[:1]), scenario.duration_s], scenario.rests_s[:2]
    heated_s, recovered_s = (end - (1.0 - rest_share) * rest for end, rest in zip(ends, rests, strict=False))
    return replace(
        scenario, disturbances=(replace(first, time_s=heated_s),), duration_s=heated_s + recovered_s - first.time_s,
        rests_s=tuple(rest_share * rest for rest in rests))


def lengthen(scenario: Scenario, times: float) -> Scenario:
    """Return a scenario with its first event, an open circuit, lengthened by a factor."""
    begins, *others = scenario.disturbances
    more_s = (times - 1.0) * (others[0].time_s - begins.time_s)
    later = (replace(event, time_s=event.time_s + more_s) for event in others)
    return replace(scenario, disturbances=(begins, *later), duration_s=scenario.duration_s + more_s)


def heated_s(scenario: Scenario, rest_s: float) -> float:
    """Return when the heat-up of a test sequence has been at rest for so long [s]."""
    end_s = next((event.time_s for event in scenario.disturbances), scenario.duration_s)
    return end_s - scenario.rests_s[0] + rest_s


def way_back(scenario: Scenario, number: int, rest_share: float) -> tuple[float, float]:
    """Return how long the part of an event lasts, and its rest, if that is as long as this share of its own [s]."""
    ends, own_s = [*(event.time_s for event in scenario.disturbances), scenario.duration_s], scenario.rests_s
    return ends[number + 1] - ends[number] - (1.0 - rest_share) * own_s[number + 1], rest_share * own_s[number + 1]
