"""Loops in which something breaks: the proof's kernel with another sensor, and what the controller saw and asked for.

The heater's circuit and its switch break as mains and loads do: open or half the power is a share of the mains; a
switch that is stuck is an open circuit and a load of full power.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.plain import bound
from heatertune.plc.pwm import Actuator
from heatertune.proof.event_table import events_of
from heatertune.proof.kernel import LOAD, MAINS, LoopBatch, TraceArrays
from heatertune.proof.loop import LoopController, program_of, pulses_of, ring_size, run_with, scans_of
from heatertune.proof.meter import Places, no_meter
from heatertune.proof.scenario import Scenario

__all__ = ["SENSOR_FAULTS", "Card", "Fault", "Ran", "breakable_sensor", "card_of", "ran", "whole_pct"]

Array = npt.NDArray[np.float64]

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


def sensor_reading(_sensor: Any, _temperature: float) -> Any:
    """Stand in for the controller's own, see `heatertune.compiled.bound`."""
    raise NotImplementedError


def broken(sensor: Any, temperature: float) -> Any:
    """Return what the card reads of a temperature; it is asked once a scan."""
    seen, number = temperature, int(sensor.memory[0])
    if number < sensor.begins or sensor.fault == 0:
        sensor.memory[1] = temperature
    elif sensor.fault == _FROZEN:
        seen = sensor.memory[1]
    elif sensor.fault == _HALF:
        seen = sensor.ambient + 0.5 * (temperature - sensor.ambient)
    elif sensor.fault == _LOW or (sensor.fault == _LOOSE and number % _OFTEN != 0):
        seen = -_FAR_DEGC
    elif sensor.fault == _HIGH:
        seen = _FAR_DEGC
    sensor.memory[0] = number + 1.0
    return sensor_reading(sensor.inner, seen)


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
    return replace(loop, core=replace(loop.core, measure=bound(broken, sensor_reading=loop.core.measure)))


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
    given = (program_of(loop, scenario), batch, actuator.switches, tripped_s, edges, record, no_meter())
    run_with(replace(loop, sensor=sensor), given, scans)
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
    asked: npt.NDArray[np.int16] = whole_pct(np.nan_to_num(power)).astype(np.int16)
    ends = [*(event.time_s for event in scenario.disturbances), math.inf]
    for begin, end, supplied in zip([0.0, *ends], ends, scenario.supplied, strict=False):
        if not supplied:
            last = None if math.isinf(end) else math.ceil(end / scan_s - 1e-9)
            asked[math.ceil(begin / scan_s - 1e-9):last] = -1
    return asked


