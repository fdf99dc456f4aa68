"""Loops with a fault, run by the kernel of the proof: named faults, and the readings and requested power of each scan.

Faults of heater circuit and switch are shares of the mains: an open circuit 0, half the power ½; a stuck switch is an
open circuit and a load of full power. Others change the sensor.

Healthy heaters, on which a monitor must never trip, are drawn from a box around each plausible heater, corners first:
gain and lags ± the spread, the dead time ± one and a half times that, the ambient ± 5 °C, noise between none (or the
known one) and the assumed one. Heaters that could not hold the setpoint are not drawn: they should trip.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.compiled import bound
from heatertune.compiled.plain_functions import measure
from heatertune.errors import OutOfRange
from heatertune.heater.exact import time_to
from heatertune.model.model_values import HeaterModel
from heatertune.plc.pwm import Actuator
from heatertune.proof.kernel import LOAD, MAINS, LoopBatch, TraceArrays
from heatertune.proof.loop import LoopController, program_of, pulses_of, ring_size, run_with, scans_of
from heatertune.proof.meter import Places, no_meter
from heatertune.proof.scenario import Disturbance, Load, Mains, NewSetpoint, PlcPower, Scenario, events_of
from heatertune.units import check

__all__ = [
    "FAULTS", "SENSOR_FAULTS", "Card", "FamilyMember", "Fault", "FaultKind", "HeaterFamily", "Ran",
    "breakable_sensor", "card_of", "ran", "whole_pct",
]


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultKind:
    """One fault.

    Attributes:
        name: few words.
        mains: share of the power that is left.
        stuck_pct: power that flows whatever is asked for.
        sensor: what becomes of it, see `heatertune.supervision.faulty_loops.SENSOR_FAULTS`.
        later: by which the dead time is multiplied, over the whole run.
        cold: whether it is there from the cold start on; else it comes when the loop is at rest.
    """

    name: str
    mains: float = 1.0
    stuck_pct: float = 0.0
    sensor: str = "right"
    later: float = 1.0
    cold: bool = False


FAULTS: Final = (
    FaultKind(name="switch stuck on", mains=0.0, stuck_pct=100.0),
    FaultKind(name="heater open", mains=0.0),
    FaultKind(name="heater open from cold", mains=0.0, cold=True),
    FaultKind(name="half of the power", mains=0.5),
    FaultKind(name="half of the power from cold", mains=0.5, cold=True),
    FaultKind(name="sensor reads its low end", sensor="low"),
    FaultKind(name="sensor reads its high end", sensor="high"),
    FaultKind(name="sensor frozen at rest", sensor="frozen"),
    FaultKind(name="sensor frozen in the heat-up", sensor="frozen", cold=True),
    FaultKind(name="sensor half out", sensor="half"),
    FaultKind(name="sensor half out from cold", sensor="half", cold=True),
    FaultKind(name="sensor loose", sensor="loose"),
    FaultKind(name="dead time 4 times as long", later=4.0, cold=True),
)


_CORNERS: Final = 32  # of gain, lags, dead time, ambient and noise
_RESERVE_PCT: Final = 5.0
_LITTLE_PCT: Final = 2.0
_LOW_MAINS: Final = 0.9**2
_HIGH_MAINS: Final = 1.1**2
_LOOP_TIMES: Final = 6.0  # of the slowest heater's lags and dead time, for the loop to come to rest
_SHORT_OFF: Final = 0.1
_LONG_OFF: Final = 3.0
_SHAKEN: Final = 24  # scans by which an event comes later, drawn
_LOW_SHARE: Final = 0.2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FamilyMember:
    """One drawn heater.

    Attributes:
        row: as `heatertune.proof.kernel.LoopBatch` has it.
        scenario: its story.
        noise_degC: of its sensor, standard deviation.
        seed: of that noise.
    """

    row: list[float]
    scenario: Scenario
    noise_degC: float
    seed: int

    def noise(self, scans: int) -> Array:
        """Return the noise of its readings [°C], shape (scans,)."""
        return np.random.Generator(np.random.Philox(key=self.seed)).normal(0.0, self.noise_degC, scans)

    @property
    def needs_pct(self) -> float:
        """Power that holds the setpoint [%]."""
        return (self.scenario.setpoint_degC - self.row[4]) / self.row[0]


@dataclass(frozen=True, slots=True, kw_only=True)
class HeaterFamily:
    """What is drawn.

    Attributes:
        heaters: the possible ones; each with its ambient temperature.
        setpoint_degC: upper end of the setpoints of use.
        low_degC: lower end; None: a fifth of the way to the ambient below.
        delay_s: of the controller, added to each dead time.
        scan_s: of the controller.
        spread: of gain and lags; the dead time's is half as much again.
        ambient_degC: half width of the ambient temperature.
        noise_degC: (least, most) standard deviation of the noise.
        ramp_degC_per_min: of the setpoint; infinite: none.
        load_pct: most power that a load takes.

    Raises:
        OutOfRange: a spread that leaves no heater; a heater that cannot hold the setpoint.
    """

    heaters: Sequence[HeaterModel]
    setpoint_degC: float
    scan_s: float
    low_degC: float | None = None
    delay_s: float = 0.0
    spread: float = 0.2
    ambient_degC: float = 5.0
    noise_degC: tuple[float, float] = (0.0, 0.1)
    ramp_degC_per_min: float = math.inf
    load_pct: float = 15.0
    slowest_s: float = field(init=False)

    def __post_init__(self) -> None:
        check("spread", self.spread, least=0.0, most=0.6)
        for heater in self.heaters:
            if not 0.0 < self._needs(heater, 0.0) <= 100.0 - _LITTLE_PCT:
                rule = f"above the ambient and below what {100.0 - _LITTLE_PCT:g} % of power reach on each heater"
                raise OutOfRange("setpoint_degC", self.setpoint_degC, rule)
        slow = max(sum(h.lags_s) * (1.0 + self.spread) + h.dead_time_s * (1.0 + 1.5 * self.spread)
                   for h in self.heaters)
        object.__setattr__(self, "slowest_s", slow + self.delay_s)

    def _needs(self, heater: HeaterModel, warmer: float) -> float:
        return (self.setpoint_degC - float(heater.ambient_degC or 0.0) - warmer) / heater.gain_degC_per_pct

    @property
    def dead_times_s(self) -> tuple[float, float]:
        """Shortest and longest time after which power acts, most of the smaller lag included [s]."""
        low = min(h.dead_time_s * (1.0 - 1.5 * self.spread) for h in self.heaters)
        high = max(h.dead_time_s * (1.0 + 1.5 * self.spread) + (1.0 + self.spread) * sum(h.lags_s[1:])
                   for h in self.heaters)
        return low + self.delay_s, high + self.delay_s

    def member(self, seed: int, *, corner: int | None = None) -> FamilyMember:
        """Return the heater of a seed, or of a corner of the box."""
        generator = np.random.Generator(np.random.Philox(key=seed))
        even = generator.uniform(-1.0, 1.0, 16)
        if corner is not None:
            even[:5] = [1.0 if corner >> place & 1 else -1.0 for place in range(5)]
            even[5] = 1.0
        heater = self.heaters[(seed if corner is None else corner // _CORNERS) % len(self.heaters)]
        ambient = float(heater.ambient_degC or 0.0) + self.ambient_degC * even[3]
        ambient = min(ambient, self.setpoint_degC - 1.0)
        least = min((self.setpoint_degC - ambient) / (100.0 - _RESERVE_PCT), heater.gain_degC_per_pct)
        gain = max(heater.gain_degC_per_pct * (1.0 + self.spread * even[0]), least,
                   (self.setpoint_degC - ambient) / (100.0 - _LITTLE_PCT))
        first, *rest = (lag * (1.0 + self.spread * even[1]) for lag in heater.lags_s)
        dead = heater.dead_time_s * (1.0 + 1.5 * self.spread * even[2]) + self.delay_s
        low, high = self.noise_degC
        row = [gain, first, rest[0] if rest else 0.0, dead, ambient, ambient]
        return FamilyMember(row=row, scenario=self._story(row, even[5:], generator), seed=seed,
                      noise_degC=low + (high - low) * 0.5 * (1.0 + even[4]))

    def corners(self) -> range:
        """Return the numbers of all corners."""
        return range(_CORNERS * len(self.heaters))

    def way_s(self) -> float:
        """Return the longest time from cold to the setpoint with all power, and the ramp's."""
        ways, step = [], 0.0
        for heater in self.heaters:
            needs = min(self._needs(heater, -self.ambient_degC) / (1.0 - self.spread), 100.0 - _RESERVE_PCT) / 100.0
            lags = [lag * (1.0 + self.spread) for lag in heater.lags_s]
            ways.append(time_to(needs, *lags))
            step = max(step, self.setpoint_degC - float(heater.ambient_degC or 0.0) + self.ambient_degC)
        return max(ways) + 60.0 * step / self.ramp_degC_per_min

    def settled_s(self) -> float:
        """Return when every heater has come to rest after the cold start [s]."""
        return self._whole(self.way_s() + _LOOP_TIMES * self.slowest_s)

    def _whole(self, seconds: float) -> float:
        return math.ceil(seconds / self.scan_s - 1e-9) * self.scan_s

    def _story(self, row: list[float], even: Array, generator: np.random.Generator) -> Scenario:
        settles, way = _LOOP_TIMES * self.slowest_s, self.way_s()
        needs = (self.setpoint_degC - row[4]) / row[0]
        most = max(0.0, min(self.load_pct * (0.75 + 0.25 * float(even[0])), 100.0 - needs - _LITTLE_PCT))
        weak = max(_LOW_MAINS, min(1.0, needs / (100.0 - _LITTLE_PCT)))
        low = self.setpoint_degC - _LOW_SHARE * (self.setpoint_degC - row[4])
        low = low if self.low_degC is None else max(self.low_degC, row[4] + 1.0)
        parts: list[tuple[Any, dict[str, Any], float]] = [
            (None, {}, way + settles), (Load, {"power_pct": -most}, settles), (Load, {"power_pct": most}, settles),
            (NewSetpoint, {"setpoint_degC": low}, settles),
            (NewSetpoint, {"setpoint_degC": self.setpoint_degC}, settles), (Mains, {"share": weak}, settles),
            (Mains, {"share": _HIGH_MAINS}, settles), (Mains, {"share": 1.0}, settles),
            (PlcPower, {"on": False}, _SHORT_OFF * self.slowest_s), (PlcPower, {"on": True}, settles),
            (PlcPower, {"on": False}, _LONG_OFF * self.slowest_s * (0.5 + 0.5 * abs(float(even[1])))),
            (PlcPower, {"on": True}, way + settles),
        ]
        now, events = 0.0, list[Disturbance]()
        for kind, fields, lasts in parts:
            if kind is not None:
                events.append(kind(time_s=now, **fields))
            now += self._whole(lasts) + int(generator.integers(0, _SHAKEN)) * self.scan_s
        return Scenario(setpoint_degC=self.setpoint_degC, ambient_degC=row[4], duration_s=now,
                        disturbances=tuple(events))


#: what becomes of the sensor
SENSOR_FAULTS: Final = ("right", "low", "high", "frozen", "half", "loose")
_LOW: Final = 1
_HIGH: Final = 2
_FROZEN: Final = 3
_HALF: Final = 4
_LOOSE: Final = 5
_FAR_DEGC: Final = 1e6
_OFTEN: Final = 7  # scans: a loose sensor has contact for one in so many


class BrokenSensor(NamedTuple):
    """A sensor, what becomes of it from which scan on, the ambient [°C], and (scans so far, last right temperature)."""

    inner: Any
    fault: int
    begins: int
    ambient: float
    memory: Places


def broken(sensor: Any, temperature: float) -> Any:
    """Return what the card reads of a temperature; it is asked once a scan."""
    reading, number = temperature, int(sensor.memory[0])
    if number < sensor.begins or sensor.fault == 0:
        sensor.memory[1] = temperature
    elif sensor.fault == _FROZEN:
        reading = sensor.memory[1]
    elif sensor.fault == _HALF:
        reading = sensor.ambient + 0.5 * (temperature - sensor.ambient)
    elif sensor.fault == _LOW or (sensor.fault == _LOOSE and number % _OFTEN != 0):
        reading = -_FAR_DEGC
    elif sensor.fault == _HIGH:
        reading = _FAR_DEGC
    sensor.memory[0] = number + 1.0
    return measure(sensor.inner, reading)


class Card(NamedTuple):
    """The input module: temperature at count 0 and step [°C], and its highest count."""

    low_degC: float
    step_degC: float
    highest: int


def card_of(loop: LoopController) -> Card:
    """Return the input module of a loop."""
    step = loop.resolution_degC if loop.resolution_degC > 0.0 else loop.unit_degC
    if loop.words is None:
        return Card(loop.zero_degC, step, 0)
    scale = loop.words.scaling
    return Card(scale.low_degC, step, round(scale.span_degC / step))


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """What breaks, and when.

    Attributes:
        time_s: [s].
        mains: share of the power that is left.
        stuck_pct: power that flows whatever is asked for.
        sensor: of `SENSOR_FAULTS`.
    """

    time_s: float
    mains: float = 1.0
    stuck_pct: float = 0.0
    sensor: str = "right"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Ran:
    """What a loop did, scan by scan.

    Attributes:
        counts: readings of the card.
        power: asked for, whole percent; -1 without supply.
        temperature_degC: of the heater.
    """

    counts: npt.NDArray[np.int32]
    power: npt.NDArray[np.int16]
    temperature_degC: Array


def breakable_sensor(loop: LoopController) -> LoopController:
    """Return the loop of a controller whose sensor can break."""
    return replace(loop, core=replace(loop.core, measure=bound(broken, measure=loop.core.measure)))


def ran(
    loop: LoopController, row: list[float], scenario: Scenario, actuator: Actuator, noise_degC: Array, *,
    fault: Fault | None = None, tripped_s: float = math.inf,
) -> Ran:
    """Run a loop and return what it did.

    Args:
        loop: of `loosened`.
        row: the heater, see `heatertune.proof.kernel.LoopBatch`.
        scenario: what happens beside the fault.
        actuator: the switch.
        noise_degC: shape (scans,).
        fault: what breaks; None: nothing.
        tripped_s: when the heater is switched off for good, whatever is stuck [s].
    """
    scans, dead = scans_of(loop, scenario), row[3]
    wrong = fault or Fault(time_s=math.inf)
    time, kind, value = _events(scenario, dead, wrong, tripped_s)
    begins = scans if math.isinf(wrong.time_s) else math.ceil(wrong.time_s / loop.scan_s)
    sensor = BrokenSensor(loop.sensor, SENSOR_FAULTS.index(wrong.sensor), begins, row[4], np.zeros(2))
    edges = np.empty(ring_size(pulses_of(dead + 3.0 * loop.scan_s + actuator.pwm_period_s, actuator)))
    stretches = 2 * math.ceil(scans * loop.scan_s / actuator.pwm_period_s) + 16 + time.size
    record = TraceArrays(True, np.empty(scans), np.empty(scans), np.empty(scans), np.empty(scans),
                    np.zeros(scans, dtype=np.int64), *(np.empty(stretches) for _ in range(4)))
    batch = LoopBatch(scans, noise_degC[None], np.zeros((1, 1)), np.array([row]), time, kind, value)
    arguments = (program_of(loop, scenario), batch, actuator.switches, tripped_s, edges, record, no_meter())
    run_with(replace(loop, sensor=sensor), arguments, scans)
    return Ran(counts=_counts(loop, record.reading), power=_power(record.power, scenario, loop.scan_s),
               temperature_degC=record.temperature)


def _events(scenario: Scenario, dead: float, wrong: Fault, tripped_s: float) -> tuple[Array, Any, Array]:
    """Return the events of a scenario with those of a fault, which acts after the dead time as all power does."""
    time, kind, value = (column[0].tolist() for column in events_of(scenario, [dead]))
    rows = list(zip(time, kind, value, strict=True))
    if wrong.mains != 1.0:
        rows.append((wrong.time_s + dead, MAINS, wrong.mains))
    if wrong.stuck_pct:
        rows.append((wrong.time_s + dead, LOAD, wrong.stuck_pct))
        if math.isfinite(tripped_s):
            rows.append((tripped_s + dead, LOAD, -wrong.stuck_pct))
    table = np.array(sorted(rows))
    return table[None, :, 0].copy(), table[None, :, 1].astype(np.int64), table[None, :, 2].copy()


def _counts(loop: LoopController, reading: Array) -> npt.NDArray[np.int32]:
    """Return readings as counts of the card."""
    card = card_of(loop)
    return np.rint((loop.zero_degC - card.low_degC + loop.unit_degC * reading) / card.step_degC).astype(np.int32)


def whole_pct(power: Array) -> Any:
    """Return powers of any shape as the monitor takes them [%]: halves up, in single precision, as programs do."""
    return np.floor(power.astype(np.float32) + np.float32(0.5))


def _power(power: Array, scenario: Scenario, scan_s: float) -> npt.NDArray[np.int16]:
    request_pct: npt.NDArray[np.int16] = whole_pct(np.nan_to_num(power)).astype(np.int16)
    ends = [*(event.time_s for event in scenario.disturbances), math.inf]
    for begin, end, supplied in zip([0.0, *ends], ends, scenario.supplied, strict=False):
        if not supplied:
            last = None if math.isinf(end) else math.ceil(end / scan_s - 1e-9)
            request_pct[math.ceil(begin / scan_s - 1e-9):last] = -1
    return request_pct
