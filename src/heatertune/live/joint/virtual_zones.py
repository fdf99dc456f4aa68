"""The virtual PLC of several zones: each zone's controller on a block of its own, the network of the proof behind them.

The kernel of the joint proof (`heatertune.zones.joint_kernel`) runs the network, all PWMs and the scans of all zones in
one thread; each zone's controller is a `VirtualPlc` that scans in served memory. The first one waits for the time and
shows the simulator's own block. All zones of a scan appear to clients at one instant.
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from heatertune.errors import InputError, UnknownName
from heatertune.live.block_memory import BlockMemory, RegisterRange
from heatertune.live.client.connection import demand_library
from heatertune.live.controller_block import ServedBlock
from heatertune.live.joint.zone_blocks import BLOCKS_APART, SPOKEN, demand_served, zone_registers
from heatertune.live.plc import (
    HEATER,
    SENSOR,
    Pace,
    PlcStopped,
    ScheduledFault,
    VirtualPlant,
    VirtualPlc,
    fault_of,
    served_core,
)
from heatertune.live.serve import Simulation, VirtualPlcServed, is_of_link, pace_of, reaching_settings
from heatertune.plc import controller_for
from heatertune.proof.loop import actuator_of, in_loop
from heatertune.proof.scenario import Scenario
from heatertune.zones.decoupling import WRITTEN, decoupling_arrays
from heatertune.zones.joint_kernel import JointArrays, ZoneWords
from heatertune.zones.joint_loop import (
    ZoneEvent,
    ZoneLoop,
    bound_kernel,
    event_arrays,
    memory_at_rest,
    nested_pairs,
    network_arrays,
    ramp_program,
)
from heatertune.zones.zones_folder import ZonesDesign, read_zones_design

__all__ = ["VirtualZones", "ZonesServed", "virtual_zones"]

#: faults of the whole CPU
_OF_CPU: Final = ("cpu-stop", "compressed")
#: fault of a heater → kind of event of the joint kernel
_CIRCUIT: Final[Mapping[str, str]] = {"heater-open": "open", "stuck-on": "stuck"}
_ZONE: Final = re.compile(r"\s*zone=(\S+)\s+(.*)", re.DOTALL)
_RESERVE: Final = 8  # PWM periods that the memory holds beyond those on their way
_DISTURBANCE: Final = "DISV"
_UNIT: Final = 1000  # first register of the simulator's own block


class ZonesNoise:
    """The noise of all sensors, a row for each scan, without an end [°C]."""

    def __init__(self, sigma_degC: float, zones: int, seed: int = 1) -> None:
        """Draw rows; `sigma_degC` is the standard deviation [°C]."""
        self._sigma, self._zones, self._random = sigma_degC, zones, np.random.default_rng(seed)

    def __len__(self) -> int:
        return sys.maxsize

    def __getitem__(self, _scan: int) -> list[float]:
        return [float(each) for each in self._random.normal(0.0, self._sigma, self._zones)]


class _Latest:
    """One figure of each zone in the place of a trace: the latest one."""

    def __init__(self, zones: int, scans: int) -> None:
        self._row, self._scans = [0.0] * zones, scans

    def __len__(self) -> int:
        return self._scans

    def __getitem__(self, place: tuple[int, int]) -> float:
        return self._row[place[1]]

    def __setitem__(self, place: tuple[int, int], value: float) -> None:
        self._row[place[1]] = value


class _Ring:
    """Rows of numbers without an end, of which the latest are kept."""

    def __init__(self, rows: int, size: int) -> None:
        self._rows, self._size = [[0.0] * size for _ in range(rows)], size

    def __getitem__(self, place: Any) -> Any:
        if isinstance(place, tuple):
            return self._rows[place[0]][place[1] % self._size]
        return self._rows[place]

    def __setitem__(self, place: tuple[int, int], value: float) -> None:
        self._rows[place[0]][place[1] % self._size] = value


class _FurtherZone(VirtualPlc):
    """The controller of a zone behind the first one, which has the time and the CPU."""

    def __init__(self, first: VirtualZones, plan: VirtualPlant, block: ServedBlock, memory: BlockMemory) -> None:
        super().__init__(plan, block, controller_for(first.target).core.measure, Pace(), memory=memory)
        self._first = first

    @property
    def runs(self) -> bool:
        """Whether the CPU is in RUN."""
        return self._first.runs

    def link(self, name: str) -> ScheduledFault | None:
        """Return the fault of the link of that name, where it is there now."""
        return self._first.link(name)

    def _gate(self) -> None:
        if self._first.ended:
            raise PlcStopped


class _LastZone(_FurtherZone):
    """The last zone, whose scan ends that of all."""

    def scan(self, state: Any, setpoint: Any, reading: Any) -> tuple[Any, float, Any, int]:
        """Run one scan; see `VirtualPlc.scan`."""
        try:
            return super().scan(state, setpoint, reading)
        finally:
            self._first.end_scan()


class VirtualZones(VirtualPlc):
    """A PLC with several controllers; as a `VirtualPlc` it is that of the first zone.

    Attributes:
        parts: the controller of each zone, this one first.
    """

    def __init__(
        self, design: ZonesDesign, plans: Sequence[VirtualPlant], blocks: Sequence[ServedBlock], pace: Pace,
        noise_degC: float,
    ) -> None:
        """Lay out the memory of all zones; nothing runs before `start`.

        Args:
            design: the words and the network.
            plans: of each zone.
            blocks: of each zone, as one controller alone has it.
            pace: when intervals pass.
            noise_degC: standard deviation of the readings' noise [°C].
        """
        super().__init__(plans[0], blocks[0], controller_for(design.words[0].target).core.measure, pace)
        self._design, self._noise_degC = design, noise_degC
        others = [BlockMemory(block.number + BLOCKS_APART * zone, block.image(), plan.loop.scan_s, first=self.memory)
                  for zone, (plan, block) in enumerate(zip(plans, blocks, strict=True)) if zone]
        self.parts: tuple[VirtualPlc, ...] = (self, *(
            (_LastZone if zone == len(others) else _FurtherZone)(self, plan, block, memory) for zone, (
                plan, block, memory) in enumerate(zip(plans[1:], blocks[1:], others, strict=True), start=1)))
        self._plans, self._is_scanning = plans, False
        self._ranges: dict[int, Sequence[RegisterRange]] | None = None

    def speak_modbus(self, blocks: Sequence[ServedBlock]) -> None:
        """Lay out the registers of each zone.

        Raises:
            InputError: more zones than there are registers for; as `zone_registers`.
        """
        self._ranges = {part.memory.main: [zone_registers(block, zone)]
                        for zone, (part, block) in enumerate(zip(self.parts, blocks, strict=True))}
        upto = _UNIT + self.memory.size(_UNIT) // 2
        if any(run.first < upto and run.first + run.size > _UNIT for (run,) in self._ranges.values()):
            raise InputError("too many zones for Modbus: their registers reach those of the simulator, from 1000 on")

    @property
    def register_ranges(self) -> Mapping[int, Sequence[RegisterRange]]:
        """Number of each zone's block → its registers; none where Modbus is not served."""
        return self._ranges or {}

    @property
    def runs(self) -> bool:
        """Whether the CPU is in RUN: no zone's fault stops it."""
        return VirtualPlc.runs.fget(self) and all(  # type: ignore[attr-defined]
            VirtualPlc.runs.fget(part) for part in self.parts[1:])  # type: ignore[attr-defined]

    def run_loop(self) -> None:
        """Run all intervals of the joint loop."""
        design, plans = self._design, self._plans
        words = design.words
        pwm = actuator_of(plans[0].loop, design.provenance.actuator).numbers
        loop = ZoneLoop(words=words, actuator=design.provenance.actuator, offsets_s=design.offsets_s,
                        decoupling=design.decoupling)
        periods = math.ceil(max(design.fitted.network.dead_times_s) / pwm[0]) + math.ceil(loop.sample_time_s / pwm[0])
        network = network_arrays(loop, design.fitted.network)
        size = 2 * (periods + _RESERVE + math.ceil(max(network.dead_s) / pwm[0]))
        memory = memory_at_rest(loop, design.fitted.network, 1, 1)._replace(
            edges=_Ring(len(words), size), pulse_begin=_Ring(len(words), 2), pulse_end=_Ring(len(words), 2))
        scans = sys.maxsize - 1 if self._pace.intervals is None else self._pace.intervals
        out = JointArrays(*(_Latest(len(words), scans) for _ in JointArrays._fields))
        states = nested_pairs([part.block.begin() for part in self.parts])
        events, degC = self._events(), [plan.loop.setpoints[0] for plan in plans]
        setpoints = ZoneWords(list(degC), [degC[event.zone] for event in events], list(degC), [0] * len(degC),
                              ramp_program(plans[0].loop), decoupling_arrays(design.decoupling, words))
        core = replace(served_core(plans[0].loop.core), disturbance_step=_scan_decoupled)
        try:
            bound_kernel(core, len(words), is_decoupled=design.decoupling is not None,
                         neighbour_reading=_neighbour_reading)(
                nested_pairs([(part, part) for part in self.parts]), states, states, setpoints, loop.sample_time_s, 0,
                pwm, network, event_arrays(events), ZonesNoise(self._noise_degC, len(words)), memory, out)
        finally:
            self.end_scan()

    def _events(self) -> list[ZoneEvent]:
        """Return the events of the zones and their heaters, in order of time."""
        events = [event for zone, setpoint in enumerate(self._design.specification.setpoints_degC) for event in (
            ZoneEvent(0.0, "setpoint", zone, setpoint), ZoneEvent(0.0, "on", zone))]
        gains = self._design.fitted.network.gains_degC_per_pct
        for zone, plan in enumerate(self._plans):
            for fault in plan.faults:
                if (kind := _CIRCUIT.get(fault.name)) is not None:
                    kinds: tuple[tuple[str, float], ...] = (kind, 0.0), ("closed", 0.0)
                elif fault.name == "ambient":
                    kinds = ("load", -fault.value / gains[zone]), ("load", 0.0)
                else:
                    continue
                events += [ZoneEvent(instant, each, zone, value) for instant, (each, value) in zip(
                    (fault.begins_s, fault.ends_s), kinds, strict=True) if instant < math.inf]
        return sorted(events, key=lambda event: event.time_s)

    def _gate(self) -> None:
        super()._gate()
        self.memory.changed.acquire()  # until the last zone's scan: clients find all zones at one instant
        self._is_scanning = True

    def look(self, temperature: float) -> Any:
        """Begin an interval; see `VirtualPlc.look`."""
        try:
            return super().look(temperature)
        except BaseException:
            self.end_scan()
            raise

    def end_scan(self) -> None:
        """Let clients access the blocks: all zones have been scanned."""
        if self._is_scanning:
            self._is_scanning = False
            self.memory.changed.release()


def _scan_decoupled(
    plc: VirtualPlc, state: Any, setpoint: Any, reading: Any, _begins: bool, added_pct: float
) -> tuple[Any, float, Any, int]:
    """Write the disturbance variable, as the program does before it calls the block, and scan."""
    before = plc.memory.image()
    cells = bytearray(before)
    plc.block.put_word(cells, _DISTURBANCE, float(added_pct))
    plc.memory.write_changes(before, cells)
    return plc.scan(state, setpoint, reading)


def _neighbour_reading(plc: VirtualPlc, temperature_degC: float) -> Any:
    return plc.module_reading(temperature_degC)


class ZonesServed(VirtualPlcServed):
    """A virtual PLC of several zones that answers; `with` ends it.

    Attributes:
        zones: names of the zones.
        numbers: of the data block of each zone.
        first_registers: of each zone; none where Modbus is not served.
    """

    def __init__(self, design: ZonesDesign, plc: VirtualZones, settings: Simulation, *, linked: bool) -> None:
        """Begin to serve; see `virtual_zones`."""
        self.zones = design.zones
        self.numbers = tuple(part.memory.main for part in plc.parts)
        self.first_registers = tuple(runs[0].first for runs in plc.register_ranges.values())
        super().__init__(plc, design.words[0].target, design.words[0].sample_time_s, settings, linked=linked)

    def zone_places(self) -> list[dict[str, object]]:
        """Return name, number of the data block and addresses (protocol → address) of each zone."""
        places = []
        for number, name in enumerate(self.zones):
            urls = {protocol: f"s7://{host}:{port}/0/2/db{self.numbers[number]}" if protocol == "s7" else
                    f"modbus://{host}:{port}/1/{self.first_registers[number]}"
                    for protocol, (host, port) in self.addresses.items()}
            places.append({"name": name, "block": self.numbers[number], "urls": urls})
        return places


def virtual_zones(
    source: str | Path | ZonesDesign, settings: Simulation | None = None, *, noise_degC: float | None = None,
) -> ZonesServed:
    """Return a virtual PLC that runs the words of all zones of a design, with the fitted network behind it.

    Args:
        source: a folder that `design --zones` wrote, or what `read_zones_design` returns.
        settings: see `Simulation`; a scheduled fault of a zone begins with `zone=NAME`.
        noise_degC: standard deviation of the readings' noise; None: that of the design's conditions [°C].

    Raises:
        InputError: a target, protocol or fault that zones are not simulated with; a drawn heater or the test sequence.
        DocumentError: as `read_zones_design`.
    """
    design = source if isinstance(source, ZonesDesign) else read_zones_design(source)
    options = settings or Simulation()
    blocks = demand_served(design.words)
    _demand_disturbance_word(design)
    options = reaching_settings(blocks[0], design.words[0].target, _of_zones(options, blocks[0]))
    for protocol in options.serve:
        demand_library(protocol)
    timetable = _timetable(design, options.faults)
    _demand_words(blocks, timetable)
    plans = [_plan(design, zone, timetable[zone]) for zone in range(len(design.zones))]
    noise = design.conditions.noise_degC if noise_degC is None else noise_degC
    plc = VirtualZones(design, plans, blocks, pace_of(options), noise)
    if "modbus" in options.serve:
        plc.speak_modbus(blocks)
    return ZonesServed(design, plc, options, linked=any(map(is_of_link, timetable[0])))


def _demand_disturbance_word(design: ZonesDesign) -> None:
    """Refuse decoupled zones whose program adds power around the block; raise InputError."""
    target = design.words[0].target
    if design.decoupling is not None and WRITTEN[target] != (_DISTURBANCE,):
        raise InputError(f"decoupled zones of {target}: simulate does not serve what the program adds around the "
                         "block; design with --target fb41, or without --decouple")


def _of_zones(settings: Simulation, block: ServedBlock) -> Simulation:
    """Return settings with a protocol that reaches zones; raise InputError for what zones are not simulated with."""
    for is_set, flag in ((settings.sample is not None, "--sample"), (settings.story, "--story"),
                         (settings.dead_man > 0, "--dead-man")):
        if is_set:
            raise InputError(f"{flag}: not for zones; leave it out")
    for protocol in settings.serve:
        if protocol not in SPOKEN:
            raise InputError(f"--serve {protocol}: zones are served over {' and '.join(SPOKEN)} alone")
    return settings if settings.serve else replace(
        settings, serve=tuple(name for name in SPOKEN if name in block.speaks)[:1])


def _demand_words(blocks: Sequence[ServedBlock], timetable: Sequence[Sequence[ScheduledFault]]) -> None:
    """Refuse scheduled words that a block does not have; errors as `ServedBlock.put_word`."""
    for block, faults in zip(blocks, timetable, strict=True):
        for fault in faults:
            if fault.name == "word":
                block.put_word(bytearray(block.image()), fault.word, fault.value)


def _plan(design: ZonesDesign, zone: int, faults: tuple[ScheduledFault, ...]) -> VirtualPlant:
    """Return what the controller of a zone runs; the joint kernel has the heaters and the events."""
    words, setpoint = design.words[zone], design.specification.setpoints_degC[zone]
    network = design.fitted.network
    loop = in_loop(controller_for(words.target), words, [setpoint], design.conditions.switches)
    if loop.scan_s != words.sample_time_s:
        raise InputError(f"zones of {words.target}: its scans are {loop.scan_s:g} s apart, and not TA; simulate does "
                         "not serve that")
    ambient = network.ambients_degC[zone]
    row = [network.gains_degC_per_pct[zone], network.time_constants_s[zone], network.second_time_constants_s[zone],
           network.dead_times_s[zone], ambient, float(network.steady_degC([0.0] * len(design.zones))[zone])]
    return VirtualPlant(
        loop=loop, row=row, events=([], [], []), noise=[0.0], scenario=Scenario(setpoint_degC=setpoint, duration_s=1.0),
        actuator=actuator_of(loop, design.provenance.actuator), faults=faults)


def _timetable(design: ZonesDesign, texts: Sequence[str]) -> list[tuple[ScheduledFault, ...]]:
    """Return the faults of each zone; those of CPU and link are the first one's.

    Raises:
        InputError: a fault without its zone, one of CPU or link with a zone, or one that the network does not have.
        UnknownName: no such zone or fault.
    """
    faults_by_zone: list[list[ScheduledFault]] = [[] for _ in design.zones]
    for text in texts:
        zone, fault = _zone_fault(design, text)
        faults_by_zone[zone].append(fault)
    return [tuple(each) for each in faults_by_zone]


def _zone_fault(design: ZonesDesign, text: str) -> tuple[int, ScheduledFault]:
    """Return the number of a fault's zone, 0 of one of the PLC, and the fault; errors as `_timetable`."""
    match = _ZONE.fullmatch(text)
    name, rest = (None, text) if match is None else match.groups()
    fault = fault_of(rest)
    _demand_simulated(text, fault)
    if design.decoupling is not None and fault.name in SENSOR:
        raise InputError(f"--fault {text!r}: not for decoupled zones, whose neighbours are not served what they read "
                         "then; the proof has a sensor that breaks")
    if name is not None and name not in design.zones:
        raise UnknownName("zone", name, design.zones)
    of_all = is_of_link(fault) or fault.name in _OF_CPU
    if of_all and name is not None:
        raise InputError(f"--fault {text!r}: it is of the PLC and not of a zone: leave out zone=")
    if not of_all and name is None:
        raise InputError(f'--fault {text!r}: state its zone first, as "zone={design.zones[0]} {rest.strip()}"')
    return (0 if name is None else design.zones.index(name)), fault


def _demand_simulated(text: str, fault: ScheduledFault) -> None:
    """Refuse a fault of a heater that the joint kernel does not have; raise InputError."""
    of_heater = fault.name in HEATER or f"{fault.name}=" in HEATER
    if of_heater and fault.name not in (*_CIRCUIT, "ambient"):
        raise InputError(f"--fault {text!r}: not for zones; heater-open, stuck-on and ambient= are")
