"""One call of a PID in the parallel form, as four programs compute it; each names what it does against windup.

    window      Marlin: full power or none outside a window around the setpoint, where I and D begin anew; the sum of
                the errors is limited to what makes full power; the output has 127 steps
    sum         Arduino PID_v1: the I part is limited to the limits of the output, and goes on while that is at a limit
    sum_by_time ESPHome: likewise, with limits of its own, times the measured interval
    terms       simple-pid: likewise, in double precision; P on measurement is a sum of its own, without limits

All are one function and one pair of tuples, so that a compiler sees one program. Where `narrow` holds, every operation
rounds to single precision; else they are those of double precision.

The program around them may have the heater on full power far from the setpoint, see `heatertune.plc.ramp`. Until it
gives it back, PID_v1 is in manual at 0 and simple-pid is none: each begins anew. ESPHome's goes on computing, its
integral part being put to 0 after each reading. Marlin does that itself.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from heatertune.plc.core import Sensor, StepFunctions, count
from heatertune.plc.single_precision import single

__all__ = [
    "COLD", "FLAGS", "NOBODY", "PARALLEL", "SUM", "SUM_BY_TIME", "TERMS", "WINDOW", "ParallelParameters",
    "ParallelState", "again", "clamp", "compute_call", "narrowed_to", "quotient", "scan_result", "step",
]

#: what a program does against windup
WINDOW: Final = 0
SUM: Final = 1
SUM_BY_TIME: Final = 2
TERMS: Final = 3

#: who has the heater: the controller; nobody yet, after a start or while it is off; the program, at full power
CONTROLLER: Final = 0
NOBODY: Final = 1
PROGRAM: Final = 2

#: calls of which one is missed, where they come late
_TEN: Final = 10
#: the largest number of °C that Marlin's setpoint holds
_MOST_WHOLE: Final = 32767.0
#: readings whose mean a derivative can be
_SAMPLES: Final = 8

FLAGS: Final = ("upper limit", "lower limit", "no number")


class ParallelParameters(NamedTuple):
    """The words as the program keeps them."""

    law: int
    narrow: bool  # single precision
    kp: float
    ki: float  # per call where the program keeps it so
    kd: float
    low: float  # limits of the output
    high: float
    least: float  # limits of the sum
    most: float
    full: float  # output that is 100 %
    interval: float  # what one call measures as its interval
    late: bool = False  # each tenth call is missed
    on_measurement: bool = False  # P
    on_error: bool = False  # D
    window: float = 0.0
    weight: float = 0.0  # of the new value in the filtered derivative
    samples: int = 1
    inside: bool = False  # the reading before is that of the last call within the window
    within: float = math.inf  # see `heatertune.plc.ramp.Boost`; infinite: there is none
    far: float = math.inf


class ParallelState(NamedTuple):
    """What the program keeps from call to call."""

    begins: bool = True  # nothing computed since the start or since manual
    calls: int = 0  # of ten
    integral: float = 0.0
    proportional: float = 0.0
    derivative: float = 0.0
    reading: float = 0.0
    error: float = 0.0
    setpoint: float = 0.0
    output: float = 0.0
    waited: float = 0.0  # ms since the last call that computed
    sample_count: int = 0
    slopes: tuple[float, float, float, float, float, float, float, float] = (0.0,) * _SAMPLES
    mode: int = NOBODY  # who has the heater


COLD: Final = ParallelState()


def step(p: ParallelParameters, s: ParallelState, setpoint: float, reading: float,
         _begins: bool) -> tuple[ParallelState, float, float, int]:
    """Compute one scan, see `heatertune.plc.core.StepFunctions`.

    Args:
        p: of the controller.
        s: before the call.
        setpoint: [°C].
        reading: [°C].
        _begins: not looked at: the PWM is behind the output.
    """
    if p.late and s.calls == _TEN - 1:
        return scan_result(p, again(s, s.begins, s.output, 0.0, s.mode))
    missed = p.late and s.calls == _TEN and not (p.law == TERMS and s.begins)  # a new object takes its interval as told
    interval = p.interval + p.interval if missed else p.interval
    return scan_result(p, compute_call(p, s, setpoint, reading, interval))


def again(s: ParallelState, begins: bool, output: float, waited: float, bits: int) -> ParallelState:
    """Return a state whose memory is as it was.

    Args:
        s: before the call.
        begins: whether nothing is computed since the start or since manual.
        output: from now on.
        waited: since the last call that computed [ms].
        bits: who has the heater.
    """
    return ParallelState(begins, s.calls % _TEN + 1, s.integral, s.proportional, s.derivative, s.reading, s.error,
                         s.setpoint, output, waited, s.sample_count, s.slopes, bits)


def scan_result(p: ParallelParameters, s: ParallelState) -> tuple[ParallelState, float, float, int]:
    """Return the state, the output as power, the output, and the flags as bits; what is no number is off."""
    output = p.high if s.mode == PROGRAM else s.output
    share = output / p.full
    power = 100.0 * min(max(share, 0.0), 1.0) if share == share else 0.0  # noqa: PLR0124 - only NaN is not itself
    highest = float(math.floor(p.high / 2.0)) if p.law == WINDOW else p.high
    bits = int(output >= highest) + 2 * int(output <= p.low) + 4 * int(math.isnan(output))
    return s, power, output, bits


def compute_call(p: ParallelParameters, s: ParallelState, setpoint: float, reading: float,
                 interval: float) -> ParallelState:
    """Return the state after one call that computes; total for all numbers.

    Args:
        p: of the controller.
        s: before the call.
        setpoint: [°C].
        reading: [°C].
        interval: since the call before, as the program measures it.
    """
    if p.law == WINDOW:
        return _windowed(p, s, setpoint, reading)
    away = narrowed_to(p.narrow, setpoint - reading)
    if (p.far if s.mode == CONTROLLER else p.within) < away < math.inf:
        return _on_full_power(p, s, setpoint, reading, interval)
    if p.law == SUM:
        return _summed(p, s, setpoint, reading)
    if p.law == SUM_BY_TIME:
        return _summed_by_time(p, s, setpoint, reading, interval)
    return _of_terms(p, s, setpoint, reading, interval)


def _on_full_power(p: ParallelParameters, s: ParallelState, setpoint: float, reading: float,
                   interval: float) -> ParallelState:
    """Return the state after one call in which the program gives full power."""
    if p.law != SUM_BY_TIME:
        return ParallelState(True, s.calls % _TEN + 1, 0.0, 0.0, 0.0, reading, 0.0, setpoint, 0.0, 0.0, 0, s.slopes,
                             PROGRAM)
    s = _summed_by_time(p, s, setpoint, reading, interval)
    return ParallelState(False, s.calls, 0.0, 0.0, s.derivative, reading, s.error, setpoint, s.output, 0.0,
                         s.sample_count, s.slopes, PROGRAM)


def _windowed(p: ParallelParameters, s: ParallelState, setpoint: float, reading: float) -> ParallelState:
    target = float(math.floor(setpoint + 0.5)) if abs(setpoint) < _MOST_WHOLE else 0.0
    error = narrowed_to(p.narrow, target - reading)
    if target == 0.0 or error < -p.window:
        return _outside(p, s, reading, 0.0)
    if error > p.window:
        return _outside(p, s, reading, float(math.floor(p.high / 2.0)))
    total, lagged = (0.0, 0.0) if s.begins else (s.integral, s.derivative)
    total = clamp(narrowed_to(p.narrow, total + error), 0.0, p.most)
    slope = narrowed_to(p.narrow, p.kd * narrowed_to(p.narrow, s.reading - reading))
    lagged = narrowed_to(p.narrow, lagged + narrowed_to(p.narrow, p.weight * narrowed_to(p.narrow, slope - lagged)))
    both = narrowed_to(p.narrow, narrowed_to(p.narrow, p.kp * error) + narrowed_to(p.narrow, p.ki * total))
    output = clamp(narrowed_to(p.narrow, both + lagged), p.low, p.high)
    steps = float(math.floor(output / 2.0)) if output >= 0.0 else 0.0  # a whole number, halved: both cut
    return ParallelState(False, s.calls % _TEN + 1, total, 0.0, lagged, reading, error, target, steps, 0.0, 0,
                         s.slopes, CONTROLLER)


def _outside(p: ParallelParameters, s: ParallelState, reading: float, output: float) -> ParallelState:
    last = s.reading if p.inside else reading
    return ParallelState(True, s.calls % _TEN + 1, s.integral, 0.0, s.derivative, last, s.error, s.setpoint, output,
                         0.0, 0, s.slopes, CONTROLLER)


def _summed(p: ParallelParameters, s: ParallelState, setpoint: float, reading: float) -> ParallelState:
    total, before = (clamp(s.output, p.low, p.high), reading) if s.begins else (s.integral, s.reading)
    error = narrowed_to(p.narrow, setpoint - reading)
    change = narrowed_to(p.narrow, reading - before)
    total = narrowed_to(p.narrow, total + narrowed_to(p.narrow, p.ki * error))
    if p.on_measurement:
        total = narrowed_to(p.narrow, total - narrowed_to(p.narrow, p.kp * change))
    total = clamp(total, p.least, p.most)
    output = 0.0 if p.on_measurement else narrowed_to(p.narrow, p.kp * error)
    output = narrowed_to(p.narrow, output + narrowed_to(p.narrow, total - narrowed_to(p.narrow, p.kd * change)))
    output = clamp(output, p.low, p.high)
    return ParallelState(False, s.calls % _TEN + 1, total, 0.0, 0.0, reading, error, setpoint, output, 0.0, 0,
                         s.slopes, CONTROLLER)


def _summed_by_time(p: ParallelParameters, s: ParallelState, setpoint: float, reading: float,
                    interval: float) -> ParallelState:
    if not (setpoint == setpoint and reading == reading):  # noqa: PLR0124 - no number: off, and no call
        return again(s, s.begins, 0.0, s.waited, min(s.mode, NOBODY))
    interval = 0.0 if s.begins else interval
    error = narrowed_to(p.narrow, setpoint - reading)
    growth = narrowed_to(p.narrow, narrowed_to(p.narrow, error * interval) * p.ki)
    total = clamp(narrowed_to(p.narrow, s.integral + growth), p.least, p.most)
    slope = 0.0
    if interval != 0.0:
        before = s.error if s.setpoint == setpoint else narrowed_to(
            p.narrow, s.error - narrowed_to(p.narrow, s.setpoint - setpoint))
        slope = narrowed_to(p.narrow, narrowed_to(p.narrow, error - before) / interval)
    length, slopes = 0, s.slopes
    if p.samples > 1:
        length = min(s.sample_count + 1, p.samples)
        slopes = slopes[1:] + (slope,)  # noqa: RUF005 - unpacked, no compiler takes it
        slope = _mean(p, slopes, length)
    pi_output = narrowed_to(p.narrow, narrowed_to(p.narrow, p.kp * error) + 0.0 + total)
    output = narrowed_to(p.narrow, pi_output + narrowed_to(p.narrow, p.kd * slope))
    level = clamp(output, 0.0, 1.0) if output == output else s.output  # noqa: PLR0124 - neither output is set
    return ParallelState(False, s.calls % _TEN + 1, total, 0.0, slope, reading, error, setpoint, level, 0.0, length,
                         slopes, CONTROLLER)


def _mean(p: ParallelParameters, slopes: tuple[float, ...], count: int) -> float:
    total = 0.0
    for place in range(_SAMPLES - count, _SAMPLES):
        total = narrowed_to(p.narrow, total + slopes[place])
    return narrowed_to(p.narrow, total / count)


def _of_terms(p: ParallelParameters, s: ParallelState, setpoint: float, reading: float,
              interval: float) -> ParallelState:
    error = setpoint - reading
    change = 0.0 if s.begins else reading - s.reading
    turned = 0.0 if s.begins else error - s.error
    proportional = (0.0 if s.begins else s.proportional) - p.kp * change if p.on_measurement else p.kp * error
    total = clamp(s.integral + p.ki * error * interval, p.least, p.most)
    derivative = p.kd * turned / interval if p.on_error else -p.kd * change / interval
    output = clamp(proportional + total + derivative, p.low, p.high)
    return ParallelState(False, s.calls % _TEN + 1, total, proportional, derivative, reading, error, setpoint, output,
                         0.0, 0, s.slopes, CONTROLLER)


def clamp(value: float, low: float, high: float) -> float:
    """Return a number within limits; what is none stays none."""
    if value > high:
        return high
    return low if value < low else value


def narrowed_to(narrow: bool, value: float) -> float:
    """Return a number as single precision holds it, where that is asked for."""
    return 1.0 * single(value) if narrow else value


def quotient(narrow: bool, dividend: float, divisor: float) -> float:
    """Return a quotient of two numbers, of which the dividend is positive; by zero it is infinite."""
    return math.inf if divisor == 0.0 else narrowed_to(narrow, dividend / divisor)


def _measure(sensor: Sensor, temperature_degC: float) -> float:
    return 1.0 * single(sensor.low + sensor.span * count(sensor, temperature_degC) / sensor.counts)


def _other_starts(p: ParallelParameters, cold: ParallelState) -> list[ParallelState]:
    return [cold._replace(calls=calls) for calls in range(1, _TEN)] if p.late else []


PARALLEL: Final = StepFunctions(step=step, measure=_measure, flags=FLAGS, other_starts=_other_starts)
