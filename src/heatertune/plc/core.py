"""How a controller computes: one scan as a plain function of numbers, its timing, sensor and state.

`RunningController` runs such a step scan by scan, as the PLC calls it, in a control loop of the user's own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

from heatertune.errors import InputError
from heatertune.plc.ramp import Number, Ramp, next_setpoint
from heatertune.units import check

__all__ = [
    "ControllerState", "RunningController", "Scan", "Sensor", "StepFunctions", "Timing", "as_it_is", "cold_again",
    "count", "started_as_it_is",
]


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
        other_starts: (parameters, cold state) → cold states from which the calls that are missed are other ones.
        store_setpoint: a sum as the setpoint word holds it.
        disturbance_step: as `step`, with power behind the reading that the program around the controller adds to its
            output, and to its anti-windup [% of full power]; None: it has no input for that.
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
    other_starts: Callable[[Any, Any], Sequence[Any]] = lambda _parameters, _cold: ()
    store_setpoint: Callable[[Any], Any] = as_it_is
    disturbance_step: Callable[[Any, Any, Any, Any, bool, float], tuple[Any, float, Any, int]] | None = None

    def run(self, running: ControllerState, setpoint: Any, reading: Any, *, cycle_start: bool) -> tuple[ControllerState,
                                                                                                        Scan]:
        """Run one scan."""
        state, *outcome = self.step(running.parameters, self.own(running.state), setpoint, reading, cycle_start)
        return ControllerState(running.parameters, state), self.scan_result(outcome)

    def scan_result(self, outcome: Sequence[Any]) -> Scan:
        """Return the results of `step` other than the state, the flags by name."""
        power_pct, output, bits = outcome
        flags = {name: bool(bits >> place & 1) for place, name in enumerate(self.flags)}
        return Scan(power_pct=power_pct, output=output, flags=flags)


class RunningController:
    """Words that run: `power_pct = c(reading_degC, setpoint_degC)`, one scan for each call.

    Attributes:
        scan_s: interval at which it is to be called [s].
        pwm_period_s: of the PWM that it makes itself [s], else None: the PWM is an actuator behind it.
        scan: what the last scan gave, in a controller with its own PWM also between two periods; None before the first.
    """

    def __init__(
        self, *, begin: ControllerState, step: Callable[..., tuple[ControllerState, Scan]],
        measure: Callable[[float], Number],
        timing: Timing, ramp: Ramp | None = None,
    ) -> None:
        """Take what `Controller.called` hands in.

        Args:
            begin: the cold state.
            step: `Controller.step`.
            measure: temperature [°C] → reading.
            timing: when it is to be called.
            ramp: how the setpoint moves; None: at once.
        """
        self._begin, self._step, self._measure, self._ramp = begin, step, measure, ramp
        self.scan_s, self.pwm_period_s = timing.scan_s, timing.pwm_period_s
        self._per_period = 1 if timing.pwm_period_s is None else max(1, round(timing.pwm_period_s / timing.scan_s))
        self.reset()

    def reset(self) -> None:
        """Go back to the cold state; the setpoint is forgotten, too."""
        self._running, self._calls, self._held_pct = self._begin, 0, 0.0
        self._setpoint_degC: float | None = None
        self._followed: Number = 0
        self.scan: Scan | None = None

    @property
    def flags(self) -> Mapping[str, bool]:
        """The flags after the last scan, name → set?; empty before the first."""
        return {} if self.scan is None else self.scan.flags

    def __call__(self, reading_degC: float, setpoint_degC: float | None = None) -> float:
        """Run one scan.

        Args:
            reading_degC: the temperature, which is quantised and limited as the input module does it [°C].
            setpoint_degC: likewise; None: as at the scan before [°C].

        Returns:
            The power until the next scan [0…100 %]. A controller that makes the PWM itself takes up a new power where a
            period begins, at the first scan for the first time: it is the mean over that period.

        Raises:
            InputError: no setpoint at the first scan.
            OutOfRange: a reading or setpoint that is no finite number; nothing has changed then.
        """
        asked_degC = self._setpoint_degC if setpoint_degC is None else setpoint_degC
        if asked_degC is None:
            raise InputError("the first scan needs a setpoint: c(reading_degC, setpoint_degC)")
        check("reading_degC", float(reading_degC))
        check("setpoint_degC", float(asked_degC))
        reading, begins = self._measure(float(reading_degC)), self._calls % self._per_period == 0
        self._followed = self._follow(self._measure(float(asked_degC)), reading)
        self._running, self.scan = self._step(self._running, self._followed, reading, cycle_start=begins)
        self._setpoint_degC, self._calls = asked_degC, self._calls + 1
        self._held_pct = self.scan.power_pct if begins else self._held_pct
        return self._held_pct

    def _follow(self, target: Number, reading: Number) -> Number:
        """Return the setpoint word at this scan."""
        if self._ramp is None:
            return target
        word = self._followed if self._calls else reading
        return next_setpoint(word, target, self._ramp, reading, due=(self._calls + 1) % self._ramp.calls == 0)
