"""Trace and margins → criteria."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from heatertune.pid.values import Margins
from heatertune.proof.criteria import Criterion, Limits, worst_of
from heatertune.proof.interlock import Interlock
from heatertune.proof.scenario import Kick, Load, temperatures
from heatertune.proof.trace import Trace

__all__ = ["judge", "rest_of"]

Array = npt.NDArray[np.float64]
#: instants [s] and distances from the setpoint there [°C]
Course = tuple[Array, Array]

_PERIODS_AT_REST = 3  # PWM periods that the time at rest spans at least


def judge(
    trace: Trace, limits: Limits, margins: Margins | None = None, step_power_pct: float | None = None
) -> tuple[Criterion, ...]:
    """Return what the run and the margins of its controller amount to, in a fixed order.

    The setpoint is always the one asked for, also while a ramp is on its way to it: overshoot is what goes beyond it,
    and settling time and IAE count the time that a ramp takes.

    Criteria of disturbances, interlock, margins and the power that one step of the reading moves at once [%] are there
    where the run has them and they are given. All temperatures are the true ones, at any instant, not the sensor's.
    """
    step = trace.setpoint_degC - temperatures(trace.scenario, trace.model)[1]
    band = max(limits.tolerance_degC, limits.tolerance_resolutions * trace.resolution_degC)
    heat_up, *later = (_error(trace, a, b) for a, b in pairwise(_stops(trace)))
    return (
        *_heat_up(limits, step, band, heat_up),
        *_at_rest(trace, limits, band),
        _absolute_error(limits, [heat_up, *later]),
        *_recovery(trace, limits, step, band, later),
        *_switching(trace, limits),
        *(_trips(trace, trace.interlock) if trace.interlock is not None else ()),
        *(_robustness(margins, limits) if margins is not None else ()),
        *(_step_power(step_power_pct, limits) if step_power_pct is not None else ()),
    )


def _stops(trace: Trace) -> list[float]:
    """Return the instants between which nothing disturbs: start, disturbances, end [s]."""
    return [0.0, *(each.time_s for each in trace.scenario.disturbances), float(trace.time_s[-1])]


def _error(trace: Trace, start_s: float, end_s: float) -> Course:
    times, temperature = trace.course(start_s, end_s)
    return times, temperature - trace.setpoint_degC


def _heat_up(limits: Limits, step: float, band: float, course: Course) -> tuple[Criterion, ...]:
    times, error = course
    return (
        Criterion(
            name="overshoot", value=max(0.0, float(error.max())) / step * 100.0, limit=limits.overshoot_pct, unit="%",
            what="Beyond the setpoint during heat-up, of the setpoint step.",
        ),
        Criterion(
            name="settling_time", value=_stays_within(times, error, band),
            limit=float(times[-1]) if limits.settling_s is None else limits.settling_s, unit="s",
            what=f"Time after which the temperature stays within ±{band:.3g} °C of the setpoint.",
        ),
    )


def _stays_within(times: Array, error: Array, band: float) -> float:
    """Return the instant after which |error| ≤ band [s], infinite where it ends outside."""
    outside = np.flatnonzero(np.abs(error) > band)
    if len(outside) == 0:
        return float(times[0])
    last = int(outside[-1])
    if last == len(times) - 1:
        return math.inf
    edge = math.copysign(band, error[last])
    share = (error[last] - edge) / (error[last] - error[last + 1])
    return float(times[last] + share * (times[last + 1] - times[last]))


def _at_rest(trace: Trace, limits: Limits, band: float) -> tuple[Criterion, ...]:
    end, period = _stops(trace)[1], trace.actuator.pwm_period_s
    periods, start = rest_of(limits, end, period)
    times, error = _error(trace, start, end)
    number = np.minimum((times - start) / period, periods - 1).astype(int)
    firsts = np.flatnonzero(np.diff(number, prepend=-1))
    ripple = np.maximum.reduceat(error, firsts) - np.minimum.reduceat(error, firsts)
    return (
        Criterion(
            name="steady_offset", value=abs(_integral(times, error)) / (end - start),
            limit=band, unit="°C",
            what=f"Mean distance from the setpoint from {start:.0f} to {end:.0f} s, before any disturbance.",
        ),
        Criterion(
            name="limit_cycle", value=float(np.ptp(error)) / 2.0,
            limit=band, unit="°C",
            what=f"Half of the temperature's peak to peak from {start:.0f} to {end:.0f} s, PWM ripple included.",
        ),
        Criterion(
            name="pwm_ripple", value=float(np.median(ripple)), limit=limits.pwm_ripple_degC, unit="°C",
            what="Peak to peak within one PWM period over the same time, median.",
        ),
    )


def rest_of(limits: Limits, end_s: float, period_s: float) -> tuple[int, float]:
    """Return how many PWM periods the time at rest spans, and where it begins [s]; it ends with the heat-up."""
    periods = max(_PERIODS_AT_REST, math.floor(limits.steady_share * end_s / period_s))
    return periods, max(0.0, end_s - periods * period_s)


def _integral(times: Array, values: Array) -> float:
    return float(np.sum(np.diff(times) * (values[1:] + values[:-1])) / 2.0)


def _absolute_error(limits: Limits, courses: Sequence[Course]) -> Criterion:
    return Criterion(
        name="iae", value=sum(_integral(times, np.abs(error)) for times, error in courses),
        limit=limits.iae_degC_s, unit="°C·s", what="Integral of the absolute error over the whole record.",
    )


def _recovery(
    trace: Trace, limits: Limits, step: float, band: float, courses: Sequence[Course]
) -> tuple[Criterion, ...]:
    found = [
        _after(limits, step, band, disturbance, course)
        for disturbance, course in zip(trace.scenario.disturbances, courses, strict=True)
    ]
    return tuple(worst_of(same) for same in zip(*found, strict=True))


def _after(
    limits: Limits, step: float, band: float, disturbance: Kick | Load, course: Course
) -> tuple[Criterion, ...]:
    start, (times, error) = disturbance.time_s, course
    change = disturbance.temperature_degC if isinstance(disturbance, Kick) else disturbance.power_pct
    along = error * math.copysign(1.0, change)
    return (
        Criterion(
            name="recovery_time", value=_stays_within(times, error, band) - start,
            limit=float(times[-1]) - start if limits.recovery_s is None else limits.recovery_s, unit="s",
            what=f"Time after a disturbance until the temperature stays within ±{band:.3g} °C of the setpoint.",
        ),
        Criterion(
            name="recovery_overshoot", value=max(0.0, -float(along.min())) / step * 100.0,
            limit=limits.recovery_overshoot_pct, unit="%",
            what="Beyond the setpoint after a disturbance, on the other side, of the setpoint step.",
        ),
        Criterion(
            name="deviation", value=max(0.0, float(along.max())), limit=limits.deviation_degC, unit="°C",
            what="Largest distance from the setpoint after a disturbance, on its side.",
        ),
    )


def _switching(trace: Trace, limits: Limits) -> tuple[Criterion, ...]:
    limited = (trace.power_asked_pct <= 0.0) | (trace.power_asked_pct >= 100.0)
    hours = trace.scenario.duration_s / 3600.0
    return (
        Criterion(
            name="saturation", value=float(np.mean(limited)) * 100.0, limit=limits.saturation_pct, unit="%",
            what="Share of the scans that ask for 0 or 100 % power.",
        ),
        Criterion(
            name="switchings", value=float(np.count_nonzero(trace.edge_on)) / hours, limit=limits.switchings_per_h,
            unit="1/h", what="How often the heater is switched on.",
        ),
        Criterion(
            name="overflow", value=float(sum(trace.flags.get(name, 0) for name in limits.overflow_flags)),
            limit=limits.overflows, unit="1", what="How often a flag that means a wrong result was set.",
        ),
    )


def _trips(trace: Trace, interlock: Interlock) -> tuple[Criterion, ...]:
    return (
        Criterion(
            name="interlock_trips", value=float(math.isfinite(trace.cut_s)), limit=0.0, unit="1",
            what=f"1 where the interlock {interlock.name}, limit {interlock.limit_degC:g} °C, "
            "switched the heater off for good, else 0.",
        ),
    )


def _step_power(value: float, limits: Limits) -> tuple[Criterion, ...]:
    return (
        Criterion(
            name="step_power", value=value, limit=limits.step_power_pct, unit="%",
            what="Power that one step of the reading, or its noise where that is more, moves within one scan.",
        ),
    )


def _robustness(margins: Margins, limits: Limits) -> tuple[Criterion, ...]:
    return (
        Criterion(
            name="stability", value=float(margins.stable), limit=1.0, unit="1", at_least=True,
            what="1 where the linear loop of the words as realised is stable, else 0.",
        ),
        Criterion(
            name="ms", value=margins.ms, limit=limits.ms, unit="1",
            what="Maximum sensitivity of the words as realised.",
        ),
        Criterion(
            name="gain_margin", value=margins.gain_margin, limit=limits.gain_margin, unit="1", at_least=True,
            what="Factor by which the heater's gain may grow.",
        ),
        Criterion(
            name="phase_margin", value=margins.phase_margin_deg, limit=limits.phase_margin_deg, unit="°",
            at_least=True, what="Phase that the loop may lose.",
        ),
    )
