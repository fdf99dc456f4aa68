"""The closed loop: a room's own arithmetic, the switch, the heater and the sensor."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from heatertune.errors import InputError, OutOfRange
from heatertune.model.values import HeaterModel
from heatertune.plc.ramp import course
from heatertune.plc.room import Room, Words, settings_of
from heatertune.proof.interlock import Interlock
from heatertune.proof.kernel import JUMP, LOAD, Event, run
from heatertune.proof.pwm import INSTANT_S, Actuator
from heatertune.proof.scenario import Kick, Load, Scenario, conditions
from heatertune.proof.trace import Trace

__all__ = ["Controller", "run_loop", "simulate"]

_PLC_RESOLUTION_S = 0.001  # pulse width register in milliseconds: S7-200 System Manual, SMW70


@dataclass(frozen=True, slots=True, kw_only=True)
class Controller:
    """A controller as the loop sees it.

    Attributes:
        step: (setpoint, reading, whether a PWM period begins) → power asked for, 0…100 %.
        setpoints: (first reading, number of scans) → setpoint at each scan [units of a reading].
        measure: temperature [°C] → reading.
        scan_s: interval between two steps [s].
        pwm_period_s: where it makes the PWM itself [s], else None.
        unit_degC, zero_degC: a reading r means zero + unit·r [°C].
        resolution_degC: step of the input module [°C]; 0: none.
        words, switches, flags: see `Trace`.
    """

    step: Callable[[float, float, bool], float]
    setpoints: Callable[[float, int], Sequence[float]]
    measure: Callable[[float], float]
    scan_s: float
    pwm_period_s: float | None = None
    unit_degC: float = 1.0
    zero_degC: float = 0.0
    resolution_degC: float = 0.0
    words: Words | None = None
    switches: Mapping[str, str] = field(default_factory=dict)
    flags: dict[str, int] = field(default_factory=dict)


def simulate(
    room: Room, words: Words, model: HeaterModel, scenario: Scenario,
    actuator: Actuator | None = None, switches: Mapping[str, str] | None = None, interlock: Interlock | None = None,
) -> Trace:
    """Return what the heater does when the PLC runs these words.

    Args:
        room: the controller.
        words: what it holds; with a ramp, its setpoint goes from the first reading to the scenario's.
        model: the heater.
        scenario: what happens.
        actuator: the switch; not used where the controller makes the PWM itself.
        switches: settings of the room's open points; those not named have their default.
        interlock: what may switch the heater off for good; None: nothing.

    Raises:
        InputError: no actuator where one is needed, an unknown ambient temperature.
        OutOfRange: a setpoint outside the sensor's range or out of the heater's reach, words out of their range.
        UnknownName: a switch or setting the room does not have.
    """
    room.check(words)
    room.check_ramp(words)
    scaling = words.scaling
    if not scaling.low_degC < scenario.setpoint_degC < scaling.high_degC:
        rule = f"> {scaling.low_degC:g} and < {scaling.high_degC:g}, the sensor's range"
        raise OutOfRange("setpoint_degC", scenario.setpoint_degC, rule)
    settings = settings_of(room.switches, switches or {})

    def run_from_cold(cut_s: float) -> Trace:
        return run_loop(_of_room(room, words, scenario.setpoint_degC, settings), model, scenario, actuator, cut_s=cut_s)

    trace = run_from_cold(math.inf)
    if interlock is None:
        return trace
    # up to the cut both runs are the same, so the one without it tells when it comes
    cut_s = interlock.opens_s(trace.temperature_at, float(trace.time_s[-1]))
    return replace(trace if math.isinf(cut_s) else run_from_cold(cut_s), interlock=interlock, cut_s=cut_s)


def run_loop(
    controller: Controller, model: HeaterModel, scenario: Scenario, actuator: Actuator | None, *,
    cut_s: float = math.inf,
) -> Trace:
    """Return the trace of any controller, the heater kept off from `cut_s` on [s]; errors as in `simulate`."""
    actuator = _actuator(controller, actuator)
    ambient, start = conditions(scenario, model)
    first, *rest = model.lags_s
    # the last scan comes at the end or just after it
    scans = math.ceil(scenario.duration_s / controller.scan_s - INSTANT_S) + 1
    time = np.arange(scans, dtype=np.float64) * controller.scan_s
    noise = np.random.default_rng(scenario.seed).normal(0.0, scenario.noise_degC, scans)
    setpoints = controller.setpoints(controller.measure(start + noise[0]), scans)
    samples, edges, stretches = run(
        controller.step,
        controller.measure,
        (model.gain_degC_per_pct, first, rest[0] if rest else 0.0, model.dead_time_s, ambient),
        start,
        controller.scan_s,
        setpoints,
        noise.tolist(),
        [_event(each, model.dead_time_s) for each in scenario.disturbances],
        actuator.numbers,
        cut_s,
    )
    temperature, reading, power = np.array(samples, dtype=np.float64).T.copy()
    switched = np.array([edge for edge in edges if edge <= time[-1]])
    return Trace(
        time_s=time,
        temperature_degC=temperature,
        reading_degC=controller.zero_degC + controller.unit_degC * reading,
        followed_degC=controller.zero_degC + controller.unit_degC * np.array(setpoints, dtype=np.float64),
        power_asked_pct=power,
        edge_time_s=switched,
        edge_on=np.arange(len(switched)) % 2 == 0,
        stretches=np.array(stretches),
        model=model,
        scenario=scenario,
        actuator=actuator,
        resolution_degC=controller.resolution_degC,
        words=controller.words,
        switches=controller.switches,
        flags=controller.flags,
    )


def _actuator(controller: Controller, given: Actuator | None) -> Actuator:
    if controller.pwm_period_s is not None:
        period = controller.pwm_period_s
        return Actuator(pwm_period_s=period, resolution_s=min(_PLC_RESOLUTION_S, period))
    if given is None:
        raise InputError("this controller does not make the PWM itself: give an actuator with its PWM period")
    return given


def _event(disturbance: Kick | Load, dead_time_s: float) -> Event:
    if isinstance(disturbance, Kick):
        return disturbance.time_s, JUMP, disturbance.temperature_degC
    return disturbance.time_s + dead_time_s, LOAD, disturbance.power_pct


def _of_room(room: Room, words: Words, setpoint_degC: float, switches: Mapping[str, str]) -> Controller:
    state = room.start(words, switches)
    asked = room.measure(words, setpoint_degC)
    flags: dict[str, int] = {}

    def step(setpoint: float, reading: float, cycle_start: bool) -> float:
        nonlocal state
        state, scan = room.step(words, state, setpoint, reading, switches, cycle_start=cycle_start)
        for name, is_set in scan.flags.items():
            flags[name] = flags.get(name, 0) + is_set
        return scan.power_pct

    timing = room.timing(words)
    low, high = words.scaling.low_degC, words.scaling.high_degC
    lowest = room.measure(words, low)
    unit = (high - low) / (room.measure(words, high) - lowest)
    return Controller(
        step=step,
        setpoints=lambda first, scans: course(words.ramp, first, asked, scans),
        measure=lambda temperature: room.measure(words, temperature),
        scan_s=timing.scan_s,
        pwm_period_s=timing.pwm_period_s,
        unit_degC=unit,
        zero_degC=low - unit * lowest,
        resolution_degC=words.scaling.span_degC / room.counts,
        words=words,
        switches=switches,
        flags=flags,
    )
