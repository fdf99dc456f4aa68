"""The virtual PLC: the loop of the proof, run in one thread, with a scan on served memory.

`heatertune.proof.loop.run_plainly` runs heater, switch, noise and events, and calls `measure` and `step` of this
controller as of any other. `measure` begins an interval and waits for its time, or for a client to release it. `step`
is the scan: inputs from the image, the controller's own arithmetic, outputs to the image.

Also the heater behind the PLC (that of the proof or a drawn one) and the timetable of faults of heater, sensor, link
and operator.
"""

from __future__ import annotations

import math
import re
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from threading import Thread
from typing import Any, Final

import numpy as np

from heatertune.errors import InputError, UnknownName
from heatertune.live.block_memory import BlockMemory, RegisterRange
from heatertune.live.controller_block import ServedBlock
from heatertune.live.simulator_status import DEAD_MAN, FAULTY, GUARDED, RUNS
from heatertune.model.model_values import FittedModel
from heatertune.plc import Words, controller_for
from heatertune.plc.core import StepFunctions
from heatertune.plc.pwm import Actuator
from heatertune.proof.criteria import LoopLimits, phases_measured
from heatertune.proof.heaters import holding_heaters
from heatertune.proof.kernel import LOAD, MAINS, LoopBatch, TraceArrays
from heatertune.proof.loop import (
    LoopController,
    actuator_of,
    check_words,
    in_loop,
    plant_row,
    program_of,
    pulses_of,
    ring_size,
    run_plainly,
    scans_of,
)
from heatertune.proof.meter import no_meter
from heatertune.proof.monte_carlo.draw import BLOCK, block_of
from heatertune.proof.monte_carlo.run import drawing_for
from heatertune.proof.phase_statistics import rests_of
from heatertune.proof.prove_words import actuator_for, course_for, setpoints_for
from heatertune.proof.scenario import Mains, PlcPower, Scenario, SetpointRampEvent, delay_heater, events_of
from heatertune.settings import Conditions
from heatertune.units import check

__all__ = [
    "FAULTS", "HEATER", "LINK", "Pace", "PlcStopped", "ScheduledFault", "SensorNoise", "VirtualPlant", "VirtualPlc",
    "fault_of", "heater_events", "plan_for", "served_core", "touch_mains",
]


#: name → what happens; those with = take a number
HEATER: Final[Mapping[str, str]] = {
    "heater-open": "its circuit is open",
    "half-power": "half of it has failed, or the switch passes every other half-wave",
    "stuck-on": "the switch conducts for ever",
    "polarity": "power moves the temperature the wrong way",
    "mains=": "the voltage is so much higher or lower [%]",
    "ambient=": "the ambient is so much warmer or colder [°C]",
}
SENSOR: Final[Mapping[str, str]] = {
    "sensor-off": "its wire is broken: the module reads its upper end",
    "sensor-frozen": "the reading stands still",
    "sensor-half": "it is half out: it sees half of the rise above the ambient",
    "sensor-reversed": "its poles are changed: a rise reads as a fall",
}
PEOPLE: Final[Mapping[str, str]] = {
    "word NAME=": "somebody writes this word",
    "cpu-stop": "somebody puts the CPU in STOP",
    "db-missing": "the block is deleted, which stops the CPU",
    "db-short": "the block is half as long, which stops the CPU",
    "write-protected": "the block cannot be written",
    "compressed": "somebody compresses the memory: over AS511 the blocks stand elsewhere",
}
LINK: Final[Mapping[str, str]] = {
    "cut": "connections are closed, and new ones too",
    "black-hole": "nothing gets through, without any error",
    "lost-reply": "requests arrive, replies do not",
    "late-reply=": "each reply comes so many scans later",
    "late-request=": "requests have no answer, and what they write arrives so many scans later, whoever is still there",
    "duplicate=": "what is written arrives at once and again so many scans later, and is answered then",
    "reordered=": "what is written is answered at once, and arrives behind the next write, or so many scans later",
    "cached=": "what is read of the block is a copy, up to so many scans old",
    "half-taken": "of what is written the device takes the first half, and answers that it took all",
    "clamped=": "of a parameter that is written the device keeps no more than so much, and answers that it took all",
    "torn": "a scan writes half of the block, and the rest with the next scan",
}
FAULTS: Final[Mapping[str, str]] = {**HEATER, **SENSOR, **PEOPLE, **LINK}
#: of the link, those whose number is one of scans
_OF_SCANS: Final = ("late-reply", "late-request", "duplicate", "reordered", "cached")

_WORD: Final = "word"
_FORM: Final = 't=SECONDS NAME [until=SECONDS], as "t=900 sensor-off until=1200"'
_RULE: Final = re.compile(r"t=(\S+) (?:(word) (\w+)=(\S+)|([a-z-]+)(?:=(\S+))?)(?: until=(\S+))?")


@dataclass(frozen=True, slots=True, kw_only=True)
class ScheduledFault:
    """One fault.

    Attributes:
        name: as in `FAULTS`, without what follows it.
        begins_s, ends_s: of the plant's time [s]; what does not end is there for ever.
        value: its number, where it has one.
        word: that is written, where one is.
    """

    name: str
    begins_s: float
    ends_s: float = math.inf
    value: float = 0.0
    word: str = ""

    def at(self, time_s: float) -> bool:
        """Return whether it is there at an instant."""
        return self.begins_s <= time_s < self.ends_s


def fault_of(text: str) -> ScheduledFault:
    """Return the fault that a text names.

    Raises:
        InputError: another form, a time that is none, or a number where there is none.
        UnknownName: no such fault.
    """
    match = _RULE.fullmatch(" ".join(text.split()))
    if match is None:
        raise InputError(f"--fault {text!r}: expected {_FORM}")
    begins, word, name, new, plain, value, until = match.groups()
    begins_s, ends_s = _number(text, begins, 0.0), math.inf if until is None else _number(text, until, 0.0)
    if not ends_s > begins_s:
        raise InputError(f"--fault {text!r}: it ends at {ends_s:g} s, before it begins")
    if word is not None:
        return ScheduledFault(name=_WORD, begins_s=begins_s, ends_s=ends_s, value=_number(text, new), word=name)
    if plain not in FAULTS and f"{plain}=" not in FAULTS:
        raise UnknownName("fault", plain, [kind.rstrip("=") for kind in FAULTS])
    if (value is not None) != (f"{plain}=" in FAULTS):
        raise InputError(f"--fault {text!r}: {plain} {'takes no number' if value is not None else 'needs =NUMBER'}")
    number = 0.0 if value is None else _number(text, value)
    _demand(text, plain, number)
    return ScheduledFault(name=plain, begins_s=begins_s, ends_s=ends_s, value=number)


def _demand(text: str, name: str, value: float) -> None:
    """Refuse a number without meaning."""
    if name == "mains" and not -100.0 <= value <= 50.0:
        raise InputError(f"--fault {text!r}: mains takes -100…50 % of the voltage")
    if name in _OF_SCANS and not (value >= 1.0 and value == int(value)):
        raise InputError(f"--fault {text!r}: {name} takes a whole number of scans from 1 on")


def _number(text: str, part: str, least: float = -math.inf) -> float:
    try:
        value = float(part)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value >= least):
        raise InputError(f"--fault {text!r}: {part!r} is no number{'' if least < 0.0 else ' from 0 on'}")
    return value


def touch_mains(faults: Iterable[ScheduledFault]) -> bool:
    """Return whether one of them changes what full power is."""
    return any(_is_heaters(fault) and fault.name != "ambient" for fault in faults)


def heater_events(faults: Sequence[ScheduledFault], gain_degC_per_pct: float,
                  dead_s: float) -> list[tuple[float, int, float]]:
    """Return the faults of the heater for the proof's kernel: instants [s], kinds and values, in order.

    What acts on the power reaches the temperature after the dead time.

    Args:
        faults: of which those of the heater are taken.
        gain_degC_per_pct: of the heater [°C/%].
        dead_s: its dead time [s].
    """
    own = [fault for fault in faults if _is_heaters(fault)]
    instants = sorted({instant for fault in own for instant in (fault.begins_s, fault.ends_s) if instant < math.inf})
    events, mains, load = [], 1.0, 0.0
    for instant in instants:
        there = [fault for fault in own if fault.at(instant)]
        now = math.prod(_share(fault) for fault in there)
        more = sum(_load(fault, gain_degC_per_pct) for fault in there)
        if more != load:
            events.append((instant + dead_s, LOAD, more - load))
        if now != mains:
            events.append((instant + dead_s, MAINS, now))
        mains, load = now, more
    return events


def _is_heaters(fault: ScheduledFault) -> bool:
    return fault.name in HEATER or f"{fault.name}=" in HEATER


def _share(fault: ScheduledFault) -> float:
    """Return the share of the rated power that full power is."""
    shares = {"heater-open": 0.0, "stuck-on": 0.0, "half-power": 0.5, "polarity": -1.0,
              "mains": (1.0 + fault.value / 100.0) ** 2}
    return shares.get(fault.name, 1.0)


def _load(fault: ScheduledFault, gain: float) -> float:
    """Return the power that is there whatever the switch does [%]."""
    return {"stuck-on": 100.0, "ambient": fault.value / gain}.get(fault.name, 0.0)


class SensorNoise:
    """The noise of a sensor, scan by scan without an end [°C]; the same numbers as an array of them has."""

    def __init__(self, block: Callable[[int], list[float]], sigma_degC: float) -> None:
        """Take what blocks of numbers give.

        Args:
            block: number of a block → standard normal numbers of its `BLOCK` scans; asked for in order.
            sigma_degC: standard deviation [°C].
        """
        self._block, self._sigma = block, sigma_degC
        self._number, self._drawn = -1, list[float]()

    def __len__(self) -> int:
        return sys.maxsize

    def __getitem__(self, scan: int) -> float:
        """Return the noise of a scan; scans are asked for in order, each as often as it is wanted."""
        while scan >= BLOCK * (self._number + 1):
            self._number += 1
            self._drawn = [self._sigma * number for number in self._block(self._number)]
        return self._drawn[scan - BLOCK * self._number]


@dataclass(frozen=True, slots=True, kw_only=True)
class VirtualPlant:
    """A heater, a controller and what happens, as the proof's kernel takes them.

    Attributes:
        loop: the words, running, with the settings of what the manual leaves open.
        row: of `Batch.plants`.
        events: instants [s], kinds and values, in order, the last instant infinite.
        noise: of the readings [°C].
        scenario: what is asked for, and what happens but for the faults.
        actuator: the switch.
        faults: the timetable.
    """

    loop: LoopController
    row: Sequence[float]
    events: tuple[list[float], list[int], list[float]]
    noise: SensorNoise | list[float]
    scenario: Scenario
    actuator: Actuator
    faults: tuple[ScheduledFault, ...]


def plan_for(
    words: Words, fitted: FittedModel, conditions: Conditions, *, sample: int | None = None, story: bool = False,
    spread: Mapping[str, float] | None = None, faults: Sequence[ScheduledFault] = (),
) -> VirtualPlant:
    """Return what a virtual PLC runs: at rest at the ambient first, and then the setpoint.

    Args:
        words: that the PLC holds at the beginning.
        fitted: the heater.
        conditions: setpoint, switch, noise, settings of what the manual leaves open.
        sample: seed of the heater that is drawn, as `heatertune verify --replay` does; None: the working model.
        story: whether the proof's story happens; else nothing does but the faults.
        spread: as for `heatertune.proof.monte_carlo.run.replay_document`.
        faults: the timetable.

    Raises:
        InputError: a profile, which is not served; a story whose mains change beside faults that change them too.
        OutOfRange, UnknownName: as `heatertune.proof.monte_carlo.run.replay_document`.
    """
    controller = controller_for(words.target)
    setpoint, farthest = setpoints_for(fitted, conditions)
    family = [model for _, model in holding_heaters(fitted, farthest)]
    scenario = course_for(words, family, conditions, setpoint).scenario
    factors, switches = np.ones(len(scenario.disturbances)), dict(conditions.switches)
    if sample is None:
        model = delay_heater(fitted.model, controller.delayed_s(words.scaling))
        row = plant_row(model, scenario)
        block = partial(_next_block, np.random.default_rng(scenario.seed))
    else:
        check("sample", sample, least=0)
        drawing = drawing_for(words, fitted, spread or {}, conditions)
        (row,), (factors,) = (part.tolist() for part in drawing.heaters_of([sample]))
        block = partial(block_of, sample)
        switches = dict(drawing.controllers[0].switches)
        scenario = replace(drawing.scenario, ambient_degC=row[4], start_degC=row[5], seed=sample)
    if not story:
        scenario, factors = replace(scenario, disturbances=(), rests_s=()), np.ones(0)
    _demand_served(scenario, faults)
    check_words(controller, words, scenario)
    loop = in_loop(controller, words, scenario.setpoints_degC, switches)
    actuator = actuator_of(loop, actuator_for(conditions, words))
    marks = _rests(loop, scenario, actuator.pwm_period_s)
    return VirtualPlant(
        loop=loop, row=[float(number) for number in row], events=_events(scenario, row, factors, faults, marks),
        noise=SensorNoise(block, scenario.noise_degC) if scenario.noise_degC > 0.0 else [0.0], scenario=scenario,
        actuator=actuator, faults=tuple(faults))


def _next_block(generator: np.random.Generator, _number: int) -> list[float]:
    return [float(number) for number in generator.standard_normal(BLOCK)]


def _demand_served(scenario: Scenario, faults: Sequence[ScheduledFault]) -> None:
    if any(isinstance(event, SetpointRampEvent) for event in scenario.disturbances):
        raise InputError("simulate does not run profiles: leave out --profile, or --story")
    if touch_mains(faults) and any(isinstance(event, Mains | PlcPower) for event in scenario.disturbances):
        raise InputError("the test sequence switches the mains itself: leave out --story, or such faults")


def _rests(loop: LoopController, scenario: Scenario, period_s: float) -> list[tuple[float, int]]:
    """Return when the rests of the test sequence begin: the proof's steps end there, so that a served heater's must."""
    if not scenario.disturbances:
        return []
    end_s = (scans_of(loop, scenario) - 1) * loop.scan_s
    return rests_of(phases_measured(scenario, LoopLimits(), end_s, period_s))


def _events(
    scenario: Scenario, row: Sequence[float], factors: Any, faults: Sequence[ScheduledFault],
    marks: Sequence[tuple[float, int]],
) -> tuple[list[float], list[int], list[float]]:
    """Return the events of a scenario, sizes drawn, and its marks, with those of the faults among them."""
    columns = events_of(scenario, [row[3]], np.array([factors]), marks)
    own = zip(*(column[0].tolist() for column in columns), strict=True)
    merged = sorted([*own, *heater_events(faults, row[0], row[3])])
    times, kinds, values = (list(column) for column in zip(*merged, strict=True))
    assert math.isinf(times[-1])
    assert {LOAD, MAINS}.issuperset(kinds[-1:])
    return times, kinds, values


class RudeGateway:
    """What stands between the servers and the block, as a gateway or the device itself may be."""

    def __init__(self, plc: VirtualPlc) -> None:
        """Take the PLC whose timetable has the faults."""
        self._plc = plc
        self._late: list[tuple[int, int, bytes]] = []  # interval, first byte, content; in the order of arrival
        self._overtaken: tuple[int, int, bytes] | None = None
        self._copy: tuple[int, bytes] | None = None

    def read(self, block: bytes | bytearray) -> bytes | bytearray:
        """Return the content of the block that a client reads."""
        cached = self._plc.link("cached")
        if cached is None:
            self._copy = None
            return block
        if self._copy is None or self._plc.intervals - self._copy[0] >= cached.value:
            self._copy = self._plc.intervals, bytes(block)
        return self._copy[1]

    def write(self, block: bytes | bytearray, start: int, content: bytes) -> list[tuple[int, bytes]]:
        """Return the part of a client's write that arrives in the block now."""
        plc, now = self._plc, self._plc.intervals
        if plc.link("half-taken") is not None:
            content = content[: len(content) // 2] + bytes(block[start + len(content) // 2 : start + len(content)])
        if (clamped := plc.link("clamped")) is not None:
            content = plc.block_with_limit(block, start, content, clamped.value)
        if (late := plc.link("late-request")) is not None:
            self._late.append((now + int(late.value), start, content))
            return []
        if (twice := plc.link("duplicate")) is not None:
            self._late.append((now + int(twice.value), start, content))
        arriving = [(start, content)]
        if self._overtaken is not None:
            arriving.append(self._overtaken[1:])
            self._overtaken = None
        elif (slow := plc.link("reordered")) is not None:
            self._overtaken = now + int(slow.value), start, content
            return []
        return arriving

    def due(self) -> list[tuple[int, bytes]]:
        """Return the writes that arrive in the block with this interval."""
        now = self._plc.intervals
        arriving = [each[1:] for each in self._late if each[0] <= now]
        self._late = [each for each in self._late if each[0] > now]
        if self._overtaken is not None and self._overtaken[0] <= now:
            arriving.append(self._overtaken[1:])
            self._overtaken = None
        return arriving


_STOPPING: Final = ("cpu-stop", "db-missing", "db-short")
#: so far behind its time the loop hurries [s]; what a busy or sleeping machine took beyond is not made up for, as else
#: the plant would leap while nobody could look
_MADE_UP_S: Final = 0.02


class PlcStopped(Exception):
    """Raised in the loop when nobody wants it any more."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Pace:
    """When intervals pass, each as long as the time between two scans.

    Attributes:
        rate: at most so many times as fast as a real heater; infinite: as fast as they can.
        by_client: each when a client has released it.
        intervals: after so many the plant stands still; None: it goes on.
    """

    rate: float = 1.0
    by_client: bool = False
    intervals: int | None = None


class VirtualPlc:
    """A PLC with a heater behind it; protocols serve its `memory`.

    Attributes:
        block: of the controller.
        memory: what clients read and write.
        registers: where Modbus finds the words of the controller's block.
        failed: what ended the loop by a fault of heatertune's own, else None.
    """

    def __init__(self, plan: VirtualPlant, block: ServedBlock, measure: Callable[[Any, float], Any], pace: Pace, *,
                 dead_man_scans: int = 0, memory: BlockMemory | None = None) -> None:
        """Lay out the memory; nothing runs before `start`.

        Args:
            plan: heater, words and what happens.
            block: what is served of the controller.
            measure: the controller's input module, as `StepFunctions.measure`.
            pace: when intervals pass.
            dead_man_scans: scans in manual without a new heartbeat, after which the controller goes to automatic; 0:
                it stays.
            memory: that holds the block, where it is one of several; None: one of its own.
        """
        self._plan, self.block, self._measured, self._pace = plan, block, measure, pace
        self.memory = memory or BlockMemory(block.number, block.image(), plan.loop.scan_s)
        self.memory.gateway = RudeGateway(self)
        self.registers = block.registers or [RegisterRange(0, 0, self.memory.size(self.memory.main) // 2)]
        self._scan_s, self._ambient, self._dead_man = plan.loop.scan_s, plan.row[4], dead_man_scans
        self._intervals = self._scans = self._silent = self._status = 0
        self._seen = (plan.row[5], 0.0, 0.0, 0.0)
        self._beat, self._frozen_at = self.memory.heartbeat, math.nan
        self._there: tuple[ScheduledFault, ...] = ()
        self._written: set[int] = set()
        self._late: tuple[bytes, bytes] | None = None
        self._stopped_by_client = self._was_stopped = self._closing = False
        self.failed: BaseException | None = None
        self._due_s = 0.0
        self._thread = Thread(target=self._run, name="virtual PLC", daemon=True)

    # what others ask for

    @property
    def intervals(self) -> int:
        """How many intervals are over."""
        return self._intervals

    @property
    def target(self) -> str:
        """Name of the controller."""
        return "" if self._plan.loop.words is None else self._plan.loop.words.target

    @property
    def register_ranges(self) -> Mapping[int, Sequence[RegisterRange]]:
        """Number of each controller's block → its registers."""
        return {self.memory.main: self.registers}

    @property
    def elapsed_s(self) -> float:
        """How much of the plant's time is over [s]."""
        return self._intervals * self._scan_s

    @property
    def runs(self) -> bool:
        """Whether the CPU is in RUN."""
        return not (self._stopped_by_client or any(fault.name in _STOPPING for fault in self._there))

    @property
    def ended(self) -> bool:
        """Whether the plant stands still for good."""
        return self._closing

    def stop_cpu(self, stopped: bool) -> None:
        """Put the CPU in STOP, or in RUN with a start-up."""
        self._stopped_by_client = stopped

    def link(self, name: str) -> ScheduledFault | None:
        """Return the fault of the link of that name, where it is there now."""
        return next((fault for fault in self._there if fault.name == name), None)

    def block_with_limit(self, block: bytes | bytearray, start: int, content: bytes, most: float) -> bytes:
        """Return bytes that are written with no parameter in them above a limit."""
        cells = bytearray(block)
        cells[start : start + len(content)] = content
        for name, signal in self.block.words.items():
            if start <= signal.start < start + len(content) and signal.of(bytes(cells)) > most:
                self.block.put_word(cells, name, most)
        return bytes(cells[start : start + len(content)])

    def start(self) -> None:
        """Let the intervals begin."""
        self._due_s = time.monotonic()
        self._thread.start()

    def wait(self, timeout_s: float | None = None) -> bool:
        """Wait until all intervals are over; return whether they are."""
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def close(self) -> None:
        """End the loop."""
        with self.memory.changed:
            self._closing = True
            self.memory.changed.notify_all()
        if self._thread.ident is not None:
            self._thread.join()

    # the loop, in its own thread

    def _run(self) -> None:
        try:
            self.run_loop()
            self._over()
        except PlcStopped:
            pass
        except BaseException as problem:  # the thread must not end in silence: who waits for it tells
            self.failed = problem
        finally:
            with self.memory.changed:
                self._closing = True
                self.memory.changed.notify_all()

    def run_loop(self) -> None:
        """Run all intervals."""
        run_plainly(served_core(self._plan.loop.core), self._kernel_arguments())

    def _kernel_arguments(self) -> tuple[Any, ...]:
        """Return all arguments of `heatertune.proof.kernel.run_all`."""
        plan = self._plan
        times, kinds, values = ([column] for column in plan.events)
        intervals = sys.maxsize - 1 if self._pace.intervals is None else self._pace.intervals
        batch: Any = LoopBatch(intervals, [plan.noise], [[0.0]], [plan.row], times, kinds, values)
        ring: Any = [0.0] * ring_size(pulses_of(
            plan.row[3] + 3.0 * self._scan_s + plan.actuator.pwm_period_s, plan.actuator))
        nothing: Any = [0.0]
        record = TraceArrays(False, *([nothing] * 9))
        return (self, self.block.begin(), self, self._scan_s, program_of(plan.loop, plan.scenario), batch,
                plan.actuator.switches, math.inf, ring, record, no_meter())

    def look(self, temperature: float) -> Any:
        """Begin an interval: wait for it, see what has gone wrong, and measure."""
        self._gate()
        now = self._intervals * self._scan_s
        self._there = tuple(fault for fault in self._plan.faults if fault.at(now))
        names = {fault.name for fault in self._there}
        self._change_memory(names)
        reading = self._sensed(temperature, names)
        self._seen = (reading, *self._seen[1:])
        self._intervals += 1
        return self._measured(self._plan.loop.sensor, reading)

    def module_reading(self, temperature: float) -> Any:
        """Return what the input module reads of a temperature [°C], whatever has gone wrong."""
        return self._measured(self._plan.loop.sensor, temperature)

    def _gate(self) -> None:
        """Tell what is over, and wait until the next interval may begin."""
        self._over()
        changed, pace = self.memory.changed, self._pace
        with changed:
            if pace.by_client:
                changed.wait_for(lambda: self._closing or self.memory.released > self._intervals)
            elif pace.rate < math.inf:
                while not self._closing and (left := self._due_s - time.monotonic()) > 0.0:
                    changed.wait(left)
                self._due_s = max(self._due_s, time.monotonic() - _MADE_UP_S) + self._scan_s / pace.rate
            if self._closing:
                raise PlcStopped

    def _over(self) -> None:
        """Tell clients which intervals are over."""
        status = RUNS * self.runs | self._status | FAULTY * bool(self._there) | GUARDED * bool(self._dead_man)
        self.memory.tell(self._intervals, self._scans, status, self._seen)
        with self.memory.changed:
            self.memory.changed.notify_all()

    def _sensed(self, temperature: float, names: set[str]) -> float:
        """Return the temperature at the input module [°C]."""
        if "sensor-frozen" in names:
            self._frozen_at = temperature if math.isnan(self._frozen_at) else self._frozen_at
            return self._frozen_at
        self._frozen_at = math.nan
        if "sensor-off" in names:
            scaling = self._plan.loop.words.scaling  # type: ignore[union-attr]
            return scaling.high_degC + scaling.span_degC
        if "sensor-half" in names:
            temperature = self._ambient + 0.5 * (temperature - self._ambient)
        if "sensor-reversed" in names:
            temperature = 2.0 * self._ambient - temperature
        return temperature

    def _change_memory(self, names: set[str]) -> None:
        """Do what people do to the block, and what is left of a scan that was torn."""
        memory = self.memory
        with memory.changed:
            memory.missing, memory.protected = "db-missing" in names, "write-protected" in names
            whole = memory.size(memory.main)
            memory.length = whole // 4 * 2 if "db-short" in names else whole
            for start, content in self.memory.gateway.due():
                memory.carry_out(start, content)
            if self._late is not None:
                before, after = self._late
                memory.write_changes(before, after, slice(len(before) // 2, None))
                self._late = None
            for number, fault in enumerate(self._plan.faults):
                if fault in self._there and fault.name == "word" and number not in self._written:
                    self._written.add(number)
                    before = memory.image()
                    cells = bytearray(before)
                    self.block.put_word(cells, fault.word, fault.value)
                    memory.write_changes(before, cells)

    def scan(self, state: Any, setpoint: Any, reading: Any) -> tuple[Any, float, Any, int]:
        """Run one scan: image in, the controller's step, image out."""
        if not self.runs:
            self._was_stopped = True
            self._seen = (self._seen[0], 0.0, *self._seen[2:])
            return state, 0.0, 0, 0
        if self._was_stopped:
            self._was_stopped, state = False, self.block.restarted(state)
        before = self.memory.image()
        cells = bytearray(before)
        self._watch_host(cells)
        state, power, output, flags = self.block.scan(cells, state, setpoint, reading)
        whole = self.link("torn") is None
        self.memory.write_changes(before, cells, slice(None if whole else len(before) // 2), scan_of=self._intervals)
        if not whole:
            self._late = before, bytes(cells)
        self._scans += 1
        self._seen = (self._seen[0], power, float(setpoint), float(reading))
        return state, power, output, flags

    def _watch_host(self, cells: bytearray) -> None:
        """Count the scans in manual without a heartbeat, and put the controller in automatic after too many."""
        if not self._dead_man:
            return
        beat, manual = self.memory.heartbeat, self.block.in_manual(cells)
        self._silent = self._silent + 1 if manual and beat == self._beat else 0
        if beat != self._beat:
            self._beat, self._status = beat, self._status & ~DEAD_MAN
        if self._silent >= self._dead_man:
            self.block.into_automatic(cells)
            self._status, self._silent = self._status | DEAD_MAN, 0

    def restarted(self, state: Any) -> Any:
        """Return the controller's state after the PLC had no supply."""
        return self.block.restarted(state)


def _step(plc: VirtualPlc, state: Any, setpoint: Any, reading: Any, _begins: bool) -> tuple[Any, float, Any, int]:
    return plc.scan(state, setpoint, reading)


def _measure(plc: VirtualPlc, temperature: float) -> Any:
    return plc.look(temperature)


def _restarted(plc: VirtualPlc, _cold: Any, state: Any) -> Any:
    return plc.restarted(state)


def served_core(core: StepFunctions) -> StepFunctions:
    """Return a core that scans in served memory."""
    return replace(core, step=_step, measure=_measure, warm_start=_restarted, compiles=False, own=_as_it_is,
                   cold_start=_begun)


def _as_it_is(value: Any) -> Any:
    return value


def _begun(_plc: VirtualPlc, state: Any) -> Any:
    return state
