"""Trace and margins → criteria."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from heatertune.pid.values import Margins
from heatertune.proof.criteria import (
    Criterion,
    CriterionTable,
    LoopLimits,
    band_of,
    columns_of,
    periods_at_rest,
    phases_measured,
)
from heatertune.proof.interlock import Interlock
from heatertune.proof.loop import plant_row
from heatertune.proof.scenario import Phase, SetpointRampEvent
from heatertune.proof.trace import Trace

__all__ = ["judge", "of_words"]

Array = npt.NDArray[np.float64]
#: instants [s] and distances from the setpoint there [°C]
Course = tuple[Array, Array]


def judge(
    trace: Trace, limits: LoopLimits, margins: Margins | None = None, step_power_pct: float | None = None,
    where: str = ""
) -> tuple[Criterion, ...]:
    """Return what the run and the margins of its controller amount to, in a fixed order.

    The setpoint is always the one asked for, also while a ramp is on its way to it: overshoot is what goes beyond it,
    and settling time and IAE count the time that a ramp takes.

    Criteria of disturbances and interlock are there where the run has them. All temperatures are the true ones, at any
    instant, not the sensor's.

    Args:
        trace: of the run.
        limits: what it has to keep.
        margins: of the words on this heater; None: they are not judged.
        step_power_pct: power that one step of the reading moves at once; None: it is not judged [%].
        where: label of the run.
    """
    columns = columns_of(_measured(trace, limits), limits)
    return (
        *(criterion for column in columns for criterion in column.criteria([where])),
        *([_trips(trace, trace.interlock, where)] if trace.interlock is not None else ()),
        *of_words(limits, margins, step_power_pct, where),
    )


def _measured(trace: Trace, limits: LoopLimits) -> CriterionTable:
    scenario, period = trace.scenario, trace.actuator.pwm_period_s
    band, phases = band_of(limits, trace.resolution_degC), phases_measured(
        scenario, limits, float(trace.time_s[-1]), period)
    ran = np.array(scenario.supplied)[np.searchsorted([phase.begin_s for phase in phases], trace.time_s, "right") - 1]
    asked = trace.power_asked_pct[ran]
    wrong = sum(trace.flags.get(name, 0) for name in limits.overflow_flags)
    totals = [len(asked), np.count_nonzero((asked <= trace.actuator.least_pct) | (asked >= 100.0)),
              wrong + np.count_nonzero(np.isnan(asked)), np.count_nonzero(trace.edge_on)]
    return CriterionTable(
        scenario=scenario, period_s=period, band_degC=band, phases=phases,
        rows=np.array([plant_row(trace.model, scenario)]),
        table=np.array([[_phase(trace, number, phase, band) for number, phase in enumerate(phases)]]),
        totals=np.array([totals], dtype=np.float64),
        ripple=np.array([_ripple(trace, phases[0], period)]),
    )


def _error(trace: Trace, phase: Phase, start_s: float) -> Course:
    times, temperature = trace.course(start_s, phase.end_s)
    return times, temperature - phase.setpoint_degC


def _phase(trace: Trace, number: int, phase: Phase, band: float) -> list[float]:
    """Return the columns of `CriterionTable.table`."""
    times, error = _error(trace, phase, phase.begin_s)
    crossed = np.flatnonzero(error[1:] * error[:-1] < 0.0)
    level = np.full(len(crossed), phase.setpoint_degC)
    zeros = trace.crossed_at(times[crossed], times[crossed + 1], level)
    absolute = np.abs(_integrals(trace, phase, np.union1d(times, zeros))).sum()
    settled = _stays_within(trace, phase, times, error, band)
    lag = _lag(trace, number, times)
    return [float(error.max()), float(error.min()), float(absolute), settled, *_rest(trace, phase), lag]


def _lag(trace: Trace, number: int, times: Array) -> float:
    """Return the largest distance from a setpoint that is led in a phase [°C], 0 where it is not."""
    event = (None, *trace.scenario.disturbances)[number]
    if not isinstance(event, SetpointRampEvent):
        return 0.0
    asked = np.interp(times - event.time_s, [0.0, event.duration_s], [event.from_degC, event.setpoint_degC])
    return float(np.abs(trace.temperature_at(times) - asked).max())


def _rest(trace: Trace, phase: Phase) -> list[float]:
    times, error = _error(trace, phase, phase.rest_s)
    return [float(_integrals(trace, phase, times).sum()), float(error.max()), float(error.min())]


def _stays_within(trace: Trace, phase: Phase, times: Array, error: Array, band: float) -> float:
    """Return the instant after which |error| ≤ band [s], infinite where it ends outside."""
    outside = np.flatnonzero(np.abs(error) > band)
    if len(outside) == 0:
        return float(times[0])
    last = int(outside[-1])
    if last == len(times) - 1:
        return math.inf
    edge = np.array([phase.setpoint_degC + math.copysign(band, error[last])])
    return float(trace.crossed_at(times[[last]], times[[last + 1]], edge).item())


def _integrals(trace: Trace, phase: Phase, times: Array) -> Array:
    """Return ∫error dt from each instant to the next [°C·s]."""
    return trace.areas(times) - phase.setpoint_degC * np.diff(times)


def _ripple(trace: Trace, phase: Phase, period: float) -> float:
    """Return the median peak to peak within one PWM period at rest [°C]."""
    times, error = _error(trace, phase, phase.rest_s)
    number = np.minimum((times - phase.rest_s) / period, periods_at_rest(phase, period) - 1).astype(int)
    _, firsts = np.unique(number, return_index=True)
    return float(np.median(np.maximum.reduceat(error, firsts) - np.minimum.reduceat(error, firsts)))


def _trips(trace: Trace, interlock: Interlock, where: str) -> Criterion:
    return Criterion(
        name="interlock_trips", value=float(math.isfinite(trace.cut_s)), limit=0.0, unit="1", where=where,
        what=f"1 where the interlock {interlock.name}, limit {interlock.limit_degC:g} °C, "
        "switched the heater off for good, else 0.",
    )


def of_words(
    limits: LoopLimits, margins: Margins | None, step_power_pct: float | None, where: str = ""
) -> Iterator[Criterion]:
    """Return what needs no run: margins on a heater, and the power that one step of the reading moves at once [%]."""
    if margins is not None:
        yield Criterion(
            name="stability", value=float(margins.stable), limit=1.0, unit="1", at_least=True, where=where,
            what="1 where the linear loop of the words as realised is stable, else 0.")
        yield Criterion(
            name="ms", value=margins.ms, limit=limits.ms, unit="1", where=where,
            what="Maximum sensitivity of the words as realised.")
        yield Criterion(
            name="gain_margin", value=margins.gain_margin, limit=limits.gain_margin, unit="1", at_least=True,
            where=where, what="Factor by which the heater's gain may grow.")
        yield Criterion(
            name="phase_margin", value=margins.phase_margin_deg, limit=limits.phase_margin_deg, unit="°", at_least=True,
            where=where, what="Phase that the loop may lose.")
    if step_power_pct is not None:
        yield Criterion(
            name="step_power", value=step_power_pct, limit=limits.step_power_pct, unit="% of power", where=where,
            what="Power that one step of the reading, or its noise where that is more, moves within one scan.")
