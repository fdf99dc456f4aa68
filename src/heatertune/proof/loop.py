"""The closed loop: a controller's own arithmetic, the switch, the heater and the sensor."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Final, cast

import numpy as np

from heatertune.arrays import Array
from heatertune.compiled import bound, compile_function, worth_compiling
from heatertune.errors import InputError, OutOfRange
from heatertune.model.loss_curve import loss_numbers
from heatertune.model.model_values import HeaterModel
from heatertune.plc.controller import Controller
from heatertune.plc.core import StepFunctions
from heatertune.plc.open_points import settings_of
from heatertune.plc.pwm import INSTANT_S, Actuator
from heatertune.plc.ramp import Number
from heatertune.plc.single_precision import single, to_single
from heatertune.plc.words import Words
from heatertune.proof.criteria import (
    CRITERION,
    Criterion,
    LoopLimits,
    columns_of,
    meter_for,
)
from heatertune.proof.kernel import (
    LoopBatch,
    SetpointProgram,
    TraceArrays,
    keep_tangent,
    next_with_tangent,
    run,
    run_all,
    setpoint_word_now,
)
from heatertune.proof.meter import Meter, no_meter
from heatertune.proof.phase_statistics import CriterionTable, rests_of, table_from
from heatertune.proof.plant import loss_plant, tangent, with_loss
from heatertune.proof.scenario import (
    Scenario,
    conditions,
    events_of,
    temperatures,
)
from heatertune.proof.trace import Trace
from heatertune.proof.verdict import Interlock

__all__ = [
    "MOST_SCANS", "LoopController", "actuator_of", "check_words", "have_loss", "in_loop", "noise_of", "plant_row",
    "plant_rows", "program_of", "pulses_of", "ring_size", "run_compiled", "run_loop", "run_of", "run_plainly",
    "run_with", "scans_of", "simulate", "trace_run",
]


MOST_SCANS: Final = 10_000_000
_ENDS_DEGC: Final = (100.0, 150.0, 200.0, 300.0, 400.0, 600.0, 850.0, 1000.0, 1300.0)  # of usual sensors
_LINEAR: Final = 6  # numbers in a row of a linear heater
_PLC_RESOLUTION_S: Final = 0.001  # pulse width register in milliseconds: S7-200 System Manual, SMW70


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopController:
    """A controller as the loop sees it.

    Attributes:
        core: how it computes.
        parameters, state, sensor: what the core takes.
        asked: setpoint of each phase, in the controller's units.
        scan_s: interval between two steps [s].
        ramp_step, ramp_calls, ramp_hold: of the setpoint ramp, see `heatertune.plc.ramp.Ramp`; no calls: no ramp; a
            hold of 0: none.
        pwm_period_s: where it makes the PWM itself [s], else None.
        unit_degC, zero_degC: a reading r means zero + unit·r [°C].
        resolution_degC: step of the input module [°C]; 0: none.
        words, switches: see `Trace`.
        shown: the switches that a run may show, with their settings: words that have the same run alike, bit for bit.
    """

    core: StepFunctions
    parameters: Any
    state: Any
    sensor: Any
    setpoints: Sequence[Number]
    scan_s: float
    ramp_step: Number = 0
    ramp_calls: int = 0
    ramp_hold: Number = 0
    pwm_period_s: float | None = None
    unit_degC: float = 1.0
    zero_degC: float = 0.0
    resolution_degC: float = 0.0
    words: Words | None = None
    switches: Mapping[str, str] = field(default_factory=dict)
    shown: frozenset[tuple[str, str]] = frozenset()


def simulate(  # noqa: PLR0913 - what a run is made of
    controller: Controller, words: Words, model: HeaterModel, scenario: Scenario,
    actuator: Actuator | None = None, switches: Mapping[str, str] | None = None, interlock: Interlock | None = None, *,
    limits: LoopLimits | None = None, direct: bool = False, start: int = 0,
) -> Trace:
    """Return what the heater does when the PLC runs these words.

    Args:
        controller: that is to run the words.
        words: what it holds; with a ramp, its setpoint goes from the first reading to the scenario's.
        model: the heater.
        scenario: what happens.
        actuator: the switch; not used where the controller makes the PWM itself.
        switches: settings of the controller's open points; those not named have their default.
        interlock: what may switch the heater off for good; None: nothing.
        limits: the run is measured for the trace's criteria; None: it has none.
        direct: without the controller's listing, where that can be.
        start: as for `in_loop`.

    Raises:
        InputError: no actuator where one is needed, an unknown ambient temperature.
        OutOfRange: a setpoint outside the sensor's range or out of the heater's reach, words out of their range.
        UnknownName: a switch or setting the controller does not have.
    """
    check_words(controller, words, scenario)

    def run_from_cold(cut_s: float) -> Trace:
        loop = in_loop(controller, words, scenario.setpoints_degC, switches or {}, direct=direct, start=start)
        return run_loop(loop, model, scenario, actuator, limits, cut_s=cut_s)

    trace = run_from_cold(math.inf)
    if interlock is None:
        return trace
    # up to the cut both runs are the same, so the one without it tells when it comes
    cold_until_s = trace.below_until(interlock.limit_degC)
    cut_s = interlock.opens_s(trace.temperature_at, float(trace.time_s[-1]), cold_until_s)
    trace = trace if math.isinf(cut_s) else run_from_cold(cut_s)
    trips = CRITERION["interlock_trips"].criterion(
        float(math.isfinite(cut_s)), interlock=interlock.name, limit_degC=f"{interlock.limit_degC:g}")
    return replace(trace, interlock=interlock, cut_s=cut_s, criteria=() if limits is None else (*trace.criteria, trips))


def check_words(controller: Controller, words: Words, scenario: Scenario) -> None:
    """Check words against their controller, and the setpoints of a scenario against their sensor.

    Raises:
        OutOfRange: the controller cannot have such words, or their sensor does not see a setpoint.
    """
    controller.check(words)
    controller.check_ramp(words)
    low, high = words.scaling.sensor_degC
    for setpoint in scenario.setpoints_degC:
        if not low < setpoint < high:
            wider = " ".join(f"{end:g}" for end in _range_around(setpoint, low, high))
            rule = f"> {low:g} and < {high:g}, the sensor's range (if that is another one: --range {wider}, say)"
            raise OutOfRange("setpoint_degC", setpoint, rule)


def _range_around(setpoint_degC: float, low_degC: float, high_degC: float) -> tuple[float, float]:
    """Widen a sensor's range until it holds a setpoint, with a sixth of the setpoint to spare above it."""
    if setpoint_degC <= low_degC:
        return 50.0 * math.floor(setpoint_degC / 50.0 - 0.1), high_degC
    usual = (end for end in _ENDS_DEGC if end > max(high_degC, 1.2 * setpoint_degC))
    return low_degC, next(usual, 1000.0 * math.ceil(1.2e-3 * setpoint_degC))


def run_loop(
    controller: LoopController, model: HeaterModel, scenario: Scenario, actuator: Actuator | None,
    limits: LoopLimits | None = None, *, cut_s: float = math.inf,
) -> Trace:
    """Return the trace of any controller; errors as in `simulate`.

    Args:
        controller: the words, running.
        model: the heater.
        scenario: what happens.
        actuator: the switch; None: the controller makes the PWM itself.
        limits: as for `simulate`.
        cut_s: instant from which on the heater is kept off [s].
    """
    conditions(scenario, model)
    scans = scans_of(controller, scenario)
    return trace_run(controller, model, scenario, actuator, noise_of(scenario, scans), np.zeros(1), limits, cut_s=cut_s)


def noise_of(scenario: Scenario, scans: int) -> Array:
    """Return the noise of a proof's readings, the same in each of its runs [°C], shape (scans,), or (1,) for none."""
    if scenario.noise_degC == 0.0:
        return np.zeros(1)
    return np.random.default_rng(scenario.seed).normal(0.0, abs(scenario.noise_degC), scans)  # -0.0


def scans_of(controller: LoopController, scenario: Scenario) -> int:
    """Return the number of scans; the last one comes at the end or just after it.

    Raises:
        OutOfRange: more than a proof can run.
    """
    scans = scenario.duration_s / controller.scan_s
    if scans > MOST_SCANS:
        rule = (f"<= {MOST_SCANS * controller.scan_s:.3g} (ten million scans every {controller.scan_s:g} s); for a "
                "heater as slow take a longer --sample-time or, where that is fixed, another --target")
        raise OutOfRange("duration_s of the proof's story", scenario.duration_s, rule)
    return math.ceil(scans - INSTANT_S) + 1


def trace_run(
    controller: LoopController, model: HeaterModel, scenario: Scenario, actuator: Actuator | None, noise_degC: Array,
    late_s: Array, limits: LoopLimits | None = None, *, cut_s: float = math.inf,
) -> Trace:
    """Return the trace of one run whose noise and delay are given, able to hold the setpoint or not.

    Args:
        controller: the words, running.
        model: the heater.
        scenario: what happens.
        actuator: the switch; None: the controller makes the PWM itself.
        noise_degC: of the readings, one number for all or one for each scan [°C], shape (1,) or (n,).
        late_s: delay of the scans, likewise [s], shape (1,) or (n,).
        limits: as for `simulate`.
        cut_s: instant from which on the heater is kept off [s].
    """
    actuator, scans = actuator_of(controller, actuator), scans_of(controller, scenario)
    time = np.arange(scans, dtype=np.float64) * controller.scan_s + late_s
    plant = plant_rows([model], scenario)
    meter, phases = meter_for(
        scenario, limits or LoopLimits(), end_s=float(time[-1]), period_s=actuator.pwm_period_s,
        flags=controller.core.flags, resolution_degC=controller.resolution_degC)
    # measured or not, the kernel takes the same steps: the trace is the same, bit for bit
    events = events_of(scenario, [model.dead_time_s], marks=rests_of(phases))
    meter = no_meter() if limits is None else meter
    batch = LoopBatch(scans, noise_degC[None], late_s[None], plant, *events, np.array(scenario.leads))
    pulses = pulses_of(time[-1] + 2.0 * controller.scan_s, actuator) + 2 * scenario.supplied.count(False)  # start-ups
    edges = np.empty(ring_size(pulses))
    stretches = pulses + batch.event_time.size
    if have_loss(plant):  # each scan and each tangent begins one more
        stretches += 2 + scans + math.ceil(float(time[-1]) / plant[0, -2])
    columns = np.empty((4, stretches))
    record = TraceArrays(
        True, np.empty(scans), np.empty(scans), np.empty(scans), np.empty(scans), np.zeros(scans, dtype=np.int64),
        *columns,
    )
    arguments = (program_of(controller, scenario), batch, actuator.switches, cut_s, edges, record, meter)
    switched, rows = run_with(controller, arguments, (1 + meter.measures) * scans)  # plain, a measured scan takes two
    shown = edges[:switched][np.abs(edges[:switched]) <= time[-1]]
    edge_pct = np.zeros(len(shown))
    edge_pct[::2] = np.copysign(100.0, shown[::2])
    return Trace(
        time_s=time,
        temperature_degC=record.temperature,
        reading_degC=controller.zero_degC + controller.unit_degC * record.reading,
        followed_degC=controller.zero_degC + controller.unit_degC * record.followed,
        power_asked_pct=record.power,
        edge_time_s=np.abs(shown),
        edge_pct=edge_pct,
        stretches=columns[:, :rows].T,  # no copy: a fast PWM has millions
        model=model,
        scenario=scenario,
        actuator=actuator,
        resolution_degC=controller.resolution_degC,
        words=controller.words,
        switches=controller.switches,
        flags={
            name: int(np.count_nonzero(record.flags >> place & 1)) for place, name in enumerate(controller.core.flags)
        },
        criteria=() if limits is None else _criteria(table_from(meter, phases, scenario, plant), limits),
    )


def _criteria(measured: CriterionTable, limits: LoopLimits) -> tuple[Criterion, ...]:
    """Return the criteria of the only loop that was measured."""
    return tuple(criterion for column in columns_of(measured, limits) for criterion in column.criteria([""]))


def run_with(controller: LoopController, arguments: tuple[Any, ...], scans: int, *, ahead: int = 0) -> tuple[int, int]:
    """Run the kernel with a controller, compiled where that pays; `arguments`: of `run_all` from the program on.

    `scans` tells how much work it is, `ahead` how much more of it is sure to follow.
    """
    core = controller.core
    arguments = (controller.parameters, core.own(controller.state), controller.sensor, controller.scan_s, *arguments)
    loss = _runs_with_loss(arguments)
    name = f"{core.step.__module__}.{core.step.__qualname__}{' with a loss curve' if loss else ''}"
    if core.compiles and worth_compiling(scans, name, function=run_of(core, loss=loss), ahead=ahead):
        return run_compiled(core, arguments)
    return run_plainly(core, arguments)


def run_of(core: StepFunctions, *, loss: bool = False) -> Callable[..., tuple[int, int]]:
    """Return the kernel with a controller in it, a plain function; with `loss`, for heaters with a loss curve."""
    own = _WITH_LOSS if loss else {}
    loop = bound(run, step=core.step, measure=core.measure, warm_state=core.warm_start,
                 setpoint_word_now=bound(setpoint_word_now, setpoint_word=core.store_setpoint), **own)
    rows: dict[str, Callable[..., Any]] = {"linear_plant": loss_plant} if loss else {}
    return cast("Callable[..., tuple[int, int]]", bound(run_all, run=loop, cold_state=core.cold_start, **rows))


#: what the kernel calls for heaters with a loss curve in the place of what it calls for linear ones
_WITH_LOSS: Final[dict[str, Callable[..., Any]]] = {
    "unchanged": tangent, "is_linear": with_loss, "next_event": next_with_tangent, "keep_nothing": keep_tangent}


def _runs_with_loss(arguments: tuple[Any, ...]) -> bool:
    return any(have_loss(each.plants) for each in arguments if isinstance(each, LoopBatch))


def run_compiled(core: StepFunctions, arguments: tuple[Any, ...]) -> tuple[int, int]:
    """Run the kernel as machine code, compiled where it is not yet; `arguments` are all of `run_all`'s arguments."""
    if core.singles:
        parameters, state, sensor, scan_s, program, *others = arguments
        arguments = to_single(parameters), to_single(state), sensor, scan_s, to_single(program), *others
    return compile_function(run_of(core, loss=_runs_with_loss(arguments)))(*arguments)


def run_plainly(core: StepFunctions, arguments: tuple[Any, ...]) -> tuple[int, int]:
    """Run the kernel as plain Python; lists in place of arrays, as their numbers are Python's own."""
    lists: list[tuple[Any, Any]] = []

    def plain(value: Any) -> Any:
        if isinstance(value, np.ndarray):
            lists.append((value, value.tolist()))
            return lists[-1][1]
        return type(value)(*map(plain, value)) if isinstance(value, SetpointProgram | LoopBatch | TraceArrays
                                                             | Meter) else value

    counted = run_of(core, loss=_runs_with_loss(arguments))(*map(plain, arguments))
    for array, written in lists:
        array[:] = written
    return counted


def actuator_of(controller: LoopController, actuator: Actuator | None) -> Actuator:
    """Return the switch: the controller's own PWM, else the one given.

    Raises:
        InputError: there is none.
    """
    if controller.pwm_period_s is not None:
        period = controller.pwm_period_s
        return Actuator(pwm_period_s=period, resolution_s=min(_PLC_RESOLUTION_S, period))
    if actuator is None:
        raise InputError("this controller does not make the PWM itself: give an actuator with its PWM period")
    return actuator


def plant_row(model: HeaterModel, scenario: Scenario) -> list[float]:
    """Return a heater in a scenario as a row of `Batch.plants`."""
    ambient, start = temperatures(scenario, model)
    first, *rest = model.lags_s
    return [model.gain_degC_per_pct, first, rest[0] if rest else 0.0, model.dead_time_s, ambient, start]


def plant_rows(models: Sequence[HeaterModel], scenario: Scenario) -> Array:
    """Return heaters in a scenario as `LoopBatch.plants`, shape (n, 6).

    It is (n, 13) where one has a loss curve or two time scales; the last number is the share that passes the slow mass.
    """
    rows = [plant_row(model, scenario) for model in models]
    if any(model.loss is not None or model.fast_share is not None for model in models):
        rows = [[*row, *loss_numbers(model, row[4]), model.fast_share or 0.0]
                for row, model in zip(rows, models, strict=True)]
    return np.array(rows)


def have_loss(plants: Array) -> bool:
    """Return whether rows, shape (n, 6) or (n, 13), are those of heaters with a loss curve or two time scales."""
    return len(plants[0]) > _LINEAR  # a virtual PLC has them as lists


def program_of(controller: LoopController, scenario: Scenario) -> SetpointProgram:
    """Return the program around a controller, phase by phase; raise ValueError where it is asked for other phases."""
    setpoints = np.array(controller.setpoints)
    if len(setpoints) != len(scenario.setpoints_degC):
        raise ValueError(f"{len(setpoints)} setpoints for {len(scenario.setpoints_degC)} phases")
    return SetpointProgram(setpoints, np.array(scenario.supplied, dtype=np.int64), controller.ramp_step,
                           controller.ramp_calls, controller.ramp_hold)


def pulses_of(seconds: float, actuator: Actuator) -> int:
    """Return how often the heater can be switched in so many seconds."""
    return 2 * (math.ceil(seconds / actuator.pwm_period_s) + 2)


def ring_size(pulses: int) -> int:
    """Return the least power of two that holds so many edges."""
    return 1 << (pulses - 1).bit_length()


def in_loop(
    controller: Controller, words: Words, setpoints_degC: Sequence[float], switches: Mapping[str, str], *,
    direct: bool = False, start: int = 0,
) -> LoopController:
    """Return a controller that runs words, asked for the setpoint of each phase.

    Args:
        controller: that is to run the words.
        words: what it holds.
        setpoints_degC: of the phases [°C].
        switches: settings of the controller's open points; those not named have their default.
        direct: without its listing, where that can be.
        start: 0: the cold state; else the number of one of `StepFunctions.other_starts`, from 1 on.

    Raises:
        UnknownName: a switch or setting the controller does not have.
    """
    timing = controller.timing(words)
    core, running = (
        controller.start_directly(words, switches) if direct else (controller.core, controller.start(words, switches)))
    measured = {setpoint: controller.measure(words, setpoint) for setpoint in {*setpoints_degC}}
    setpoint_words = [measured[setpoint] for setpoint in setpoints_degC]
    low, high = words.scaling.low_degC, words.scaling.high_degC
    lowest, highest = controller.ends(words)
    unit = (high - low) / (highest - lowest)
    none, ramp = type(setpoint_words[0])(0), words.ramp
    settings = settings_of(controller.switches, switches)
    return LoopController(
        core=replace(core, store_setpoint=single) if isinstance(setpoint_words[0], float) else core,
        parameters=running.parameters,
        state=(running.state, *core.other_starts(running.parameters, running.state))[start],
        sensor=controller.sensor(words.scaling),
        setpoints=setpoint_words,
        scan_s=timing.scan_s,
        ramp_step=none if ramp is None else ramp.step,
        ramp_calls=0 if ramp is None else ramp.calls,
        ramp_hold=none if ramp is None or ramp.hold is None else ramp.hold,
        pwm_period_s=timing.pwm_period_s,
        unit_degC=unit,
        zero_degC=low - unit * lowest,
        resolution_degC=words.scaling.span_degC / controller.sensor(words.scaling).counts,
        words=words,
        switches=settings,
        shown=frozenset((switch.name, settings[switch.name]) for switch in controller.switches
                        if switch.shows(running.parameters)),
    )
