"""The closed loop: a room's own arithmetic, the switch, the heater and the sensor."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final, cast

import numpy as np
import numpy.typing as npt

from heatertune.compiled import bound, compiled, worth_compiling
from heatertune.errors import InputError, OutOfRange
from heatertune.model.values import HeaterModel
from heatertune.plc.controller import Controller
from heatertune.plc.core import Core
from heatertune.plc.open_points import settings_of
from heatertune.plc.ramp import Number, course
from heatertune.plc.single import narrowed
from heatertune.plc.words import Words
from heatertune.proof.interlock import Interlock
from heatertune.proof.kernel import JUMP, LOAD, Batch, Record, run, run_all
from heatertune.proof.meter import Meter, no_meter
from heatertune.proof.pwm import INSTANT_S, Actuator
from heatertune.proof.scenario import Kick, Scenario, conditions, temperatures
from heatertune.proof.trace import Trace

__all__ = [
    "InLoop",
    "actuator_of",
    "check_words",
    "events_of",
    "in_loop",
    "noise_of",
    "plant_row",
    "pulses_of",
    "ring_size",
    "run_compiled",
    "run_loop",
    "run_plainly",
    "run_with",
    "scans_of",
    "setpoints_of",
    "simulate",
    "traced",
]

Array = npt.NDArray[np.float64]

_MOST_SCANS: Final = 10_000_000
_PLC_RESOLUTION_S: Final = 0.001  # pulse width register in milliseconds: S7-200 System Manual, SMW70


@dataclass(frozen=True, slots=True, kw_only=True)
class InLoop:
    """A controller as the loop sees it.

    Attributes:
        core: how it computes.
        parameters, state, sensor: what the core takes.
        setpoints: (first reading, number of scans) → setpoint at each scan, all in the controller's units.
        scan_s: interval between two steps [s].
        pwm_period_s: where it makes the PWM itself [s], else None.
        unit_degC, zero_degC: a reading r means zero + unit·r [°C].
        resolution_degC: step of the input module [°C]; 0: none.
        words, switches: see `Trace`.
    """

    core: Core
    parameters: Any
    state: Any
    sensor: Any
    setpoints: Callable[[Number, int], Sequence[Number]]
    scan_s: float
    pwm_period_s: float | None = None
    unit_degC: float = 1.0
    zero_degC: float = 0.0
    resolution_degC: float = 0.0
    words: Words | None = None
    switches: Mapping[str, str] = field(default_factory=dict)


def simulate(
    room: Controller, words: Words, model: HeaterModel, scenario: Scenario,
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
    check_words(room, words, scenario)

    def run_from_cold(cut_s: float) -> Trace:
        controller = in_loop(room, words, scenario.setpoint_degC, switches or {})
        return run_loop(controller, model, scenario, actuator, cut_s=cut_s)

    trace = run_from_cold(math.inf)
    if interlock is None:
        return trace
    # up to the cut both runs are the same, so the one without it tells when it comes
    cut_s = interlock.opens_s(trace.temperature_at, float(trace.time_s[-1]))
    return replace(trace if math.isinf(cut_s) else run_from_cold(cut_s), interlock=interlock, cut_s=cut_s)


def check_words(room: Controller, words: Words, scenario: Scenario) -> None:
    """Raise OutOfRange where the room cannot have such words, or their sensor does not see the setpoint."""
    room.check(words)
    room.check_ramp(words)
    scaling = words.scaling
    if not scaling.low_degC < scenario.setpoint_degC < scaling.high_degC:
        rule = f"> {scaling.low_degC:g} and < {scaling.high_degC:g}, the sensor's range"
        raise OutOfRange("setpoint_degC", scenario.setpoint_degC, rule)


def run_loop(
    controller: InLoop, model: HeaterModel, scenario: Scenario, actuator: Actuator | None, *,
    cut_s: float = math.inf,
) -> Trace:
    """Return the trace of any controller, the heater kept off from `cut_s` on [s]; errors as in `simulate`."""
    conditions(scenario, model)
    scans = scans_of(controller, scenario)
    return traced(controller, model, scenario, actuator, noise_of(scenario, scans), np.zeros(1), cut_s=cut_s)


def noise_of(scenario: Scenario, scans: int) -> Array:
    """Return the noise of a proof's readings, the same in each of its runs [°C], shape (scans,)."""
    return np.random.default_rng(scenario.seed).normal(0.0, abs(scenario.noise_degC), scans)  # -0.0


def scans_of(controller: InLoop, scenario: Scenario) -> int:
    """Return the number of scans; the last one comes at the end or just after it.

    Raises:
        OutOfRange: more than a proof can run.
    """
    scans = scenario.duration_s / controller.scan_s
    if scans > _MOST_SCANS:
        rule = f"<= {_MOST_SCANS * controller.scan_s:.3g} (ten million scans); a longer TA or a faster heater"
        raise OutOfRange("duration_s of the proof's story", scenario.duration_s, rule)
    return math.ceil(scans - INSTANT_S) + 1


def traced(
    controller: InLoop, model: HeaterModel, scenario: Scenario, actuator: Actuator | None, noise_degC: Array,
    late_s: Array, *, cut_s: float = math.inf,
) -> Trace:
    """Return the trace of one run whose noise and delay are given, able to hold the setpoint or not; see `Clock`."""
    actuator, scans = actuator_of(controller, actuator), scans_of(controller, scenario)
    time = np.arange(scans, dtype=np.float64) * controller.scan_s + late_s
    plant = plant_row(model, scenario)
    setpoints = setpoints_of(controller, [plant[-1] + float(noise_degC[0])], scans)
    events = events_of(scenario, [model.dead_time_s])
    batch = Batch(setpoints, noise_degC[None], late_s[None], np.array([plant]), *events)
    pulses = pulses_of(time[-1] + 2.0 * controller.scan_s, actuator)
    edges = np.empty(ring_size(pulses))
    record = Record(
        True, np.empty(scans), np.empty(scans), np.empty(scans), np.zeros(scans, dtype=np.int64),
        *(np.empty(pulses + batch.event_time.size) for _ in range(4)),
    )
    given = (batch, actuator.numbers, cut_s, edges, record, no_meter())
    switched, rows = run_with(controller, given, scans)
    shown = edges[:switched][edges[:switched] <= time[-1]]
    return Trace(
        time_s=time,
        temperature_degC=record.temperature,
        reading_degC=controller.zero_degC + controller.unit_degC * record.reading,
        followed_degC=controller.zero_degC + controller.unit_degC * setpoints[0],
        power_asked_pct=record.power,
        edge_time_s=shown,
        edge_on=np.arange(len(shown)) % 2 == 0,
        stretches=np.column_stack([each[:rows] for each in record[-4:]]),
        model=model,
        scenario=scenario,
        actuator=actuator,
        resolution_degC=controller.resolution_degC,
        words=controller.words,
        switches=controller.switches,
        flags={
            name: int(np.count_nonzero(record.flags >> place & 1)) for place, name in enumerate(controller.core.flags)
        },
    )


def run_with(controller: InLoop, given: tuple[Any, ...], scans: int) -> tuple[int, int]:
    """Run the kernel with a controller, compiled where that pays; `given` are `run_all`'s arguments from the batch on.

    `scans` tells how much work it is.
    """
    core = controller.core
    given = (controller.parameters, controller.state, controller.sensor, controller.scan_s, *given)
    if core.compiles and worth_compiling(scans):
        return run_compiled(core, given)
    return run_plainly(core, given)


def _run_of(core: Core) -> Callable[..., tuple[int, int]]:
    loop = bound(run, step=core.step, measure=core.measure)
    return cast("Callable[..., tuple[int, int]]", bound(run_all, run=loop))


def run_compiled(core: Core, given: tuple[Any, ...]) -> tuple[int, int]:
    """Run the kernel as machine code, compiled where it is not yet; `given` are all of `run_all`'s arguments."""
    if core.singles:
        parameters, state, sensor, scan_s, batch, *others = given
        batch = batch._replace(setpoints=narrowed(batch.setpoints))
        given = narrowed(parameters), narrowed(state), sensor, scan_s, batch, *others
    return compiled(_run_of(core))(*given)


def run_plainly(core: Core, given: tuple[Any, ...]) -> tuple[int, int]:
    """Run the kernel as plain Python; lists in place of arrays, as their numbers are Python's own."""
    lists: list[tuple[Any, Any]] = []

    def plain(value: Any) -> Any:
        if isinstance(value, np.ndarray):
            lists.append((value, value.tolist()))
            return lists[-1][1]
        return type(value)(*map(plain, value)) if isinstance(value, Batch | Record | Meter) else value

    found = _run_of(core)(*map(plain, given))
    for array, written in lists:
        array[:] = written
    return found


def actuator_of(controller: InLoop, given: Actuator | None) -> Actuator:
    """Return the switch: the controller's own PWM, else the one given; raise InputError where there is none."""
    if controller.pwm_period_s is not None:
        period = controller.pwm_period_s
        return Actuator(pwm_period_s=period, resolution_s=min(_PLC_RESOLUTION_S, period))
    if given is None:
        raise InputError("this controller does not make the PWM itself: give an actuator with its PWM period")
    return given


def plant_row(model: HeaterModel, scenario: Scenario) -> list[float]:
    """Return a heater in a scenario as a row of `Batch.plants`."""
    ambient, start = temperatures(scenario, model)
    first, *rest = model.lags_s
    return [model.gain_degC_per_pct, first, rest[0] if rest else 0.0, model.dead_time_s, ambient, start]


def events_of(
    scenario: Scenario, dead_times_s: Sequence[float], sizes: Array | None = None,
    marks: Sequence[tuple[float, int]] = (),
) -> tuple[Array, npt.NDArray[np.int64], Array]:
    """Return the disturbances as three arrays of a `Batch`: instants, kinds and values, a row for each dead time.

    Args:
        scenario: whose disturbances.
        dead_times_s: of the heaters [s].
        sizes: by what each disturbance is multiplied, a row for each heater; None: by nothing.
        marks: (instant, kind) of what divides what is measured.
    """
    rows = []
    for number, dead in enumerate(dead_times_s):
        factors = [1.0] * len(scenario.disturbances) if sizes is None else sizes[number].tolist()
        acting = [
            (each.time_s, JUMP, factor * each.temperature_degC) if isinstance(each, Kick)
            else (each.time_s + dead, LOAD, factor * each.power_pct)
            for each, factor in zip(scenario.disturbances, factors, strict=True)
        ]
        rows.append(sorted([*acting, *((time, kind, 0.0) for time, kind in marks), (math.inf, LOAD, 0.0)]))
    table = np.array(rows)
    return table[..., 0].copy(), table[..., 1].astype(np.int64), table[..., 2].copy()


def setpoints_of(controller: InLoop, first_degC: Sequence[float], scans: int) -> npt.NDArray[Any]:
    """Return the setpoints of runs that first see these temperatures, shape (n, scans); without a ramp one row."""
    moves = controller.words is None or controller.words.ramp is not None
    firsts = [controller.core.measure(controller.sensor, each) for each in (first_degC if moves else first_degC[:1])]
    return np.array([controller.setpoints(first, scans) for first in firsts])


def pulses_of(seconds: float, actuator: Actuator) -> int:
    """Return how often the heater can be switched in so many seconds."""
    return 2 * (math.ceil(seconds / actuator.pwm_period_s) + 2)


def ring_size(pulses: int) -> int:
    """Return the least power of two that holds so many edges."""
    return 1 << (pulses - 1).bit_length()


def in_loop(
    room: Controller, words: Words, setpoint_degC: float, switches: Mapping[str, str], *, direct: bool = False
) -> InLoop:
    """Return a room that runs words, its switches set; `direct`: without its listing, where that can be.

    Raises:
        UnknownName: a switch or setting the room does not have.
    """
    timing = room.timing(words)
    core, running = room.start_directly(words, switches) if direct else (room.core, room.start(words, switches))
    asked = room.measure(words, setpoint_degC)
    low, high = words.scaling.low_degC, words.scaling.high_degC
    lowest = room.measure(words, low)
    unit = (high - low) / (room.measure(words, high) - lowest)
    return InLoop(
        core=core,
        parameters=running.parameters,
        state=running.state,
        sensor=room.sensor(words),
        setpoints=lambda first, scans: course(words.ramp, first, asked, scans),
        scan_s=timing.scan_s,
        pwm_period_s=timing.pwm_period_s,
        unit_degC=unit,
        zero_degC=low - unit * lowest,
        resolution_degC=words.scaling.span_degC / room.counts,
        words=words,
        switches=settings_of(room.switches, switches),
    )
