"""What a run amounts to by its trace: a second arithmetic beside the kernel's meter.

The meter adds up stretch by stretch while the loop runs; this program takes the finished trace: extremes at all instants
at which the temperature may turn, integrals of the exact answer, crossings by halving.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from heatertune.heater.exact import advance
from heatertune.pid.design_values import Margins
from heatertune.plc.pwm import INSTANT_S
from heatertune.proof.criteria import (
    CRITERION,
    Criterion,
    LoopLimits,
    band_of,
    columns_of,
    criteria_of_words,
    phases_measured,
)
from heatertune.proof.loop import plant_row
from heatertune.proof.phase_statistics import CriterionTable
from heatertune.proof.scenario import Phase, SetpointRampEvent
from heatertune.proof.trace import Trace

Array = npt.NDArray[np.float64]
HALVINGS = 60  # of the time between two instants, until its ends are neighbours as numbers
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
    columns = columns_of(measured(trace, limits), limits)
    return (
        *(criterion for column in columns for criterion in column.criteria([where])),
        *([_trips(trace, where)] if trace.interlock is not None else ()),
        *criteria_of_words(limits, margins, step_power_pct, where),
    )


def measured(trace: Trace, limits: LoopLimits) -> CriterionTable:
    """Measure a trace."""
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
    zeros = crossed_at(trace, times[crossed], times[crossed + 1], level)
    absolute = np.abs(_integrals(trace, phase, np.union1d(times, zeros))).sum()
    settled = stays_within(trace, phase, times, error, band)
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


def stays_within(trace: Trace, phase: Phase, times: Array, error: Array, band: float) -> float:
    """Return the instant after which |error| ≤ band [s], infinite where it ends outside."""
    outside = np.flatnonzero(np.abs(error) > band)
    if len(outside) == 0:
        return float(times[0])
    last = int(outside[-1])
    if last == len(times) - 1:
        return math.inf
    edge = np.array([phase.setpoint_degC + math.copysign(band, error[last])])
    return float(crossed_at(trace, times[[last]], times[[last + 1]], edge).item())


def _integrals(trace: Trace, phase: Phase, times: Array) -> Array:
    """Return ∫error dt from each instant to the next [°C·s]."""
    return trace.areas(times) - phase.setpoint_degC * np.diff(times)


def crossed_at(trace: Trace, low_s: Array, high_s: Array, levels_degC: Array) -> Array:
    """Return the instants at which the temperature is at some levels [s], all of one shape.

    Args:
        trace: of the run.
        low_s: an instant of `Trace.course` before each [s].
        high_s: the next one, after it [s].
        levels_degC: what lies between the temperatures at both [°C].
    """
    since, y, x, target = trace._stretch_at(low_s)
    lags = trace._lags(y, x)
    above = advance(y, x, target, low_s - since, *lags) > levels_degC
    for _ in range(HALVINGS):
        middle = 0.5 * (low_s + high_s)
        if np.all((middle == low_s) | (middle == high_s)):
            break
        still = (advance(y, x, target, middle - since, *lags) > levels_degC) == above
        low_s, high_s = np.where(still, middle, low_s), np.where(still, high_s, middle)
    return high_s


def _ripple(trace: Trace, phase: Phase, period: float) -> float:
    """Return the median peak to peak within one PWM period at rest [°C]."""
    times, error = _error(trace, phase, phase.rest_s)
    periods = max(1, math.floor((phase.end_s - phase.rest_s) / period + INSTANT_S))  # the last one is as long as it takes
    number = np.minimum((times - phase.rest_s) / period, periods - 1).astype(int)
    _, firsts = np.unique(number, return_index=True)
    return float(np.median(np.maximum.reduceat(error, firsts) - np.minimum.reduceat(error, firsts)))


def _trips(trace: Trace, where: str) -> Criterion:
    return CRITERION["interlock_trips"].criterion(
        float(math.isfinite(trace.cut_s)), where=where, interlock=trace.interlock.name, limit_degC=f"{trace.interlock.limit_degC:g}")
