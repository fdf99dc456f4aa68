"""How a controller computes: one scan as a plain function of numbers, and what goes with it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

from heatertune.plc.ramp import Number

__all__ = ["ControllerState", "Scan", "Sensor", "StepFunctions", "Timing", "as_it_is", "cold_again", "count",
           "started_as_it_is"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Timing:
    """When the controller wants to be called.

    Attributes:
        scan_s: interval between two calls of `step` [s].
        pwm_period_s: PWM period where the controller makes the PWM itself [s], else None (the PWM
            is an actuator behind the controller's output).
    """

    scan_s: float
    pwm_period_s: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Scan:
    """What one scan gave.

    Attributes:
        power_pct: heater power asked for, 0…100 % of full power.
        output: the same in the controller's own units.
        flags: the controller's flags after the scan, name → set?
    """

    power_pct: float
    output: Number
    flags: Mapping[str, bool] = field(default_factory=dict)


#: of a count: what the arithmetic of binary numbers can take from a temperature that is a whole number of counts
BINARY_LOSS: Final = 1e-9


class Sensor(NamedTuple):
    """The input module.

    Attributes:
        low, span: lowest temperature and span [°C].
        counts: its highest count.
        least: the least count that a sensor gives.
        half: 0.5 where it gives the nearest count, 0 where it cuts [counts].
    """

    low: float
    span: float
    counts: int
    least: int = 0
    half: float = 0.0


def count(sensor: Sensor, temperature_degC: float) -> int:
    """Return the count of a temperature, limited to 0…`counts`."""
    exact = (temperature_degC - sensor.low) * sensor.counts / sensor.span + sensor.half + BINARY_LOSS
    return int(min(max(exact, 0.0), float(sensor.counts)))


class ControllerState(NamedTuple):
    """A controller that runs: what its words and switches made of its core's parameters, and its memory."""

    parameters: Any
    state: Any


def as_it_is(value: Any) -> Any:
    """Return a number as it is."""
    return value


def started_as_it_is(_parameters: Any, state: Any) -> Any:
    """Return the cold state as it is."""
    return state


def cold_again(_parameters: Any, cold: Any, _state: Any) -> Any:
    """Return the state after a start-up that clears the controller."""
    return cold


@dataclass(frozen=True, slots=True, kw_only=True)
class StepFunctions:
    """How a controller computes, as plain functions of numbers and named tuples that a compiler takes as they are.

    Attributes:
        step: (parameters, state, setpoint, reading, whether a PWM period begins) → (state, power 0…100 %, output in
            the controller's units, flags as bits in the order of `flags`); total for every bit pattern.
        measure: (sensor, temperature [°C]) → reading.
        flags: names of the flags, the lowest bit first.
        compiles: whether a compiler takes it.
        own: a state → one whose cells `step` may change in their place.
        started: (parameters, state) → the cold state, made in the cells of the one given where it has cells.
        restarted: (parameters, cold state, state) → the state after a start-up of the PLC, as the exported program and
            what the PLC retains leave it.
        stored: a sum as the setpoint word holds it.
        singles: whether all floats of parameters, state and setpoint are REALs: a compiled step may then be given them
            in single precision.
    """

    step: Callable[[Any, Any, Any, Any, bool], tuple[Any, float, Any, int]]
    measure: Callable[[Any, float], Any]
    flags: tuple[str, ...]
    compiles: bool = True
    singles: bool = False
    own: Callable[[Any], Any] = as_it_is
    cold_start: Callable[[Any, Any], Any] = started_as_it_is
    warm_start: Callable[[Any, Any, Any], Any] = cold_again
    store_setpoint: Callable[[Any], Any] = as_it_is

    def run(self, running: ControllerState, setpoint: Any, reading: Any, *, cycle_start: bool) -> tuple[ControllerState,
                                                                                                        Scan]:
        """Run one scan."""
        state, *outcome = self.step(running.parameters, self.own(running.state), setpoint, reading, cycle_start)
        return ControllerState(running.parameters, state), self.scan_result(outcome)

    def scan_result(self, outcome: Sequence[Any]) -> Scan:
        """Return what `step` gave beside the state, the flags by name."""
        power_pct, output, bits = outcome
        flags = {name: bool(bits >> place & 1) for place, name in enumerate(self.flags)}
        return Scan(power_pct=power_pct, output=output, flags=flags)
