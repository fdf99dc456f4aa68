"""Statistics of the phases of a run: from the kernel's meter, for many loops at once, and from readings.

What the meter found of each phase is a row of numbers; a measure makes one number of it, for each loop and phase.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.proof.kernel import REST
from heatertune.proof.meter import (
    ABSOLUTE,
    COLUMNS,
    FAULTS,
    HIGHEST,
    LAG,
    LIMITED,
    LOWEST,
    MEAN,
    REST_HIGHEST,
    REST_LOWEST,
    SCANS,
    SETTLED,
    SWITCHINGS,
    Meter,
)
from heatertune.proof.scenario import Phase, Scenario, SetpointRampEvent

__all__ = [
    "STEPS_DEGC", "CriterionTable", "PhaseMeasure", "behind_degC", "beyond_degC", "beyond_ramp_degC", "fault_count",
    "first_within", "highest_degC", "iae_degC_s", "join_tables", "lag_degC", "numbers_of", "off_at_rest_degC",
    "offset_degC", "reorder", "reserve_pct", "rests_of", "ripple_degC", "saturated_pct", "settling_s", "swing_degC",
    "switchings_per_h", "table_from", "turning_points",
]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CriterionTable:
    """What was measured on loops that live through one scenario, a row each, see `proof.meter`.

    Attributes:
        scenario: what they live through.
        period_s: of the PWM [s].
        band_degC: how far from the setpoint is still right [°C].
        phases: of the scenario; all temperatures are distances from their setpoints.
        rows: of `Batch.plants`, shape (n, 6).
        table: what was measured in each phase, shape (n, phases, `COLUMNS`).
        totals: shape (n, `TOTALS`).
        ripple: peak to peak in each PWM period at rest [°C], median, shape (n,).
    """

    scenario: Scenario
    period_s: float
    band_degC: float
    phases: tuple[Phase, ...]
    rows: Array
    table: Array
    totals: Array
    ripple: Array


#: takes a criterion from what was measured in some phases
PhaseMeasure = Callable[[CriterionTable, Sequence[int]], Array]


def join_tables(parts: Sequence[CriterionTable]) -> CriterionTable:
    """Return the loops of all parts, which differ in nothing else, part by part."""
    def all_of(name: str) -> Array:
        return np.concatenate([getattr(part, name) for part in parts])

    return replace(
        parts[0], rows=all_of("rows"), table=all_of("table"), totals=all_of("totals"), ripple=all_of("ripple"))


def reorder(measured: CriterionTable, places: npt.NDArray[np.intp]) -> CriterionTable:
    """Return the n loops in another order: first the one of the first place, shape (n,)."""
    return replace(measured, rows=measured.rows[places], table=measured.table[places], totals=measured.totals[places],
                   ripple=measured.ripple[places])


def rests_of(phases: Iterable[Phase]) -> list[tuple[float, int]]:
    """Return when the phases that come to rest do so, as events of the kernel."""
    return [(phase.rest_s, REST) for phase in phases if phase.rest_s < phase.end_s]


def table_from(meter: Meter, phases: tuple[Phase, ...], scenario: Scenario, rows: Array) -> CriterionTable:
    """Return what a meter of `meter_for` found, of plants by their rows, shape (n, 6)."""
    return CriterionTable(
        scenario=scenario, period_s=meter.period, band_degC=meter.band, phases=phases, rows=rows,
        table=meter.phases.reshape(len(rows), -1, COLUMNS), totals=meter.totals,
        ripple=_medians(np.where(meter.high >= meter.low, meter.high - meter.low, np.nan)))


def _medians(table: Array) -> Array:
    """Return the median of each row, what is not a number left out: `nanmedian` takes longer than a third of a run."""
    ordered, rows = np.sort(table, axis=1), np.arange(len(table))  # what is not a number comes last
    numbers = np.count_nonzero(~np.isnan(table), axis=1)
    below, above = ordered[rows, np.maximum(numbers - 1, 0) // 2], ordered[rows, numbers // 2]
    return np.asarray((below + above) / 2.0)


def settling_s(measured: CriterionTable, phases: Sequence[int]) -> Array:
    """Return the time of each phase after which the temperature stays in the band [s], shape (n, phases)."""
    return np.asarray(measured.table[:, phases, SETTLED] - numbers_of(measured, phases, "begin_s"))


def beyond_degC(measured: CriterionTable, phases: Sequence[int]) -> Array:
    """Return how far each phase goes beyond its setpoint, on the side to which its event moves, shape (n, phases)."""
    return _on_side(measured, phases, along=True)


def behind_degC(measured: CriterionTable, phases: Sequence[int]) -> Array:
    """Return the same on the other side: what a loop makes good of a disturbance, and more, shape (n, phases)."""
    return _on_side(measured, phases, along=False)


def beyond_ramp_degC(measured: CriterionTable, phases: Sequence[int]) -> Array:
    """Return what goes beyond the ends of ramps: on each, in the soak after it, and on a way back that follows.

    Shape (n, ramps).
    """
    return np.maximum(0.0, np.column_stack([_beyond_ramp(measured, number) for number in phases]))


def lag_degC(measured: CriterionTable, phases: Sequence[int]) -> Array:
    """Return the largest distance from a setpoint that moves, shape (n, phases)."""
    return measured.table[:, phases, LAG]


def highest_degC(measured: CriterionTable, phases: Sequence[int]) -> Array:
    """Return the highest temperature of each phase, shape (n, phases)."""
    return measured.table[:, phases, HIGHEST] + numbers_of(measured, phases, "setpoint_degC")


def offset_degC(measured: CriterionTable, phases: Sequence[int]) -> Array:
    """Return the mean distance from the setpoint at rest, shape (n, phases)."""
    lasts_s = numbers_of(measured, phases, "end_s") - numbers_of(measured, phases, "rest_s")
    return np.abs(measured.table[:, phases, MEAN]) / lasts_s


def swing_degC(measured: CriterionTable, phases: Sequence[int]) -> Array:
    """Return half of the peak to peak at rest, shape (n, phases)."""
    stats = measured.table[:, phases]
    return (stats[:, :, REST_HIGHEST] - stats[:, :, REST_LOWEST]) / 2.0


def off_at_rest_degC(measured: CriterionTable, phases: Sequence[int]) -> Array:
    """Return the largest distance from the setpoint at rest, shape (n, phases)."""
    stats = measured.table[:, phases]
    return np.maximum(stats[:, :, REST_HIGHEST], -stats[:, :, REST_LOWEST])


def ripple_degC(measured: CriterionTable, _phases: Sequence[int]) -> Array:
    """Return the peak to peak in a PWM period, shape (n,)."""
    return measured.ripple


def iae_degC_s(measured: CriterionTable, phases: Sequence[int]) -> Array:
    """Return the integral of the absolute error over the phases, shape (n,)."""
    errors = np.ascontiguousarray(measured.table[:, phases, ABSOLUTE])  # one order of sums for any number of loops
    return np.asarray(errors.sum(axis=1))


def reserve_pct(measured: CriterionTable, _phases: Sequence[int]) -> Array:
    """Return the power that is left over while the heater holds the highest setpoint, shape (n,)."""
    gain, ambient = measured.rows[:, :1], measured.rows[:, 4:5]
    return np.asarray(100.0 - ((np.asarray(measured.scenario.setpoints_degC) - ambient) / gain).max(axis=1))


def saturated_pct(measured: CriterionTable, _phases: Sequence[int]) -> Array:
    """Return the share of scans that ask for a limit of the power, shape (n,)."""
    return measured.totals[:, LIMITED] / np.maximum(measured.totals[:, SCANS], 1.0) * 100.0


def fault_count(measured: CriterionTable, _phases: Sequence[int]) -> Array:
    """Return how often something went wrong, shape (n,)."""
    return measured.totals[:, FAULTS]


def switchings_per_h(measured: CriterionTable, _phases: Sequence[int]) -> Array:
    """Return how often each loop's heater is switched on where it has to be, not thinned by times at full power or off.

    A PWM period has one pulse at most; a loop that is hardly ever between its limits would be told to have more. Shape
    (n,).
    """
    scenario, total = measured.scenario, measured.totals
    lasts = np.array([phase.end_s - phase.begin_s for phase in measured.phases])
    between_s = lasts[np.array(scenario.supplied)].sum() * (1.0 - total[:, LIMITED] / np.maximum(total[:, SCANS], 1.0))
    closed_s = lasts[[phase.kind != "off" for phase in measured.phases]].sum()
    times = total[:, SWITCHINGS]
    often = np.divide(times, between_s, out=np.zeros(len(times)), where=between_s > 0.0)
    return np.asarray(3600.0 * np.minimum(np.maximum(times / closed_s, often), 1.0 / measured.period_s))


def _on_side(measured: CriterionTable, phases: Sequence[int], *, along: bool) -> Array:
    stats = measured.table[:, phases]
    return np.maximum(0.0, np.where(_rises(measured, phases) == along, stats[:, :, HIGHEST], -stats[:, :, LOWEST]))


def _rises(measured: CriterionTable, phases: Sequence[int]) -> npt.NDArray[np.bool_]:
    """Return for each loop whether the event of a phase moves the temperature up: a cooler's power moves it down."""
    up, by_power = np.array([(measured.phases[number].up, measured.phases[number].by_power) for number in phases]).T
    return np.asarray(np.where(by_power, (measured.rows[:, :1] > 0.0) == up, up))


def numbers_of(measured: CriterionTable, phases: Sequence[int], name: str) -> Array:
    """Return a number that each phase has, shape (phases,)."""
    return np.array([getattr(measured.phases[number], name) for number in phases])


def _beyond_ramp(measured: CriterionTable, number: int) -> Array:
    """Return how far each loop goes beyond the end of a ramp [°C], shape (n,)."""
    phases, ramp = measured.phases, measured.phases[number]
    after = [number]
    for later in range(number + 1, len(phases)):
        if phases[later].kind == "ramp" and phases[later].up == ramp.up:
            break
        after.append(later)
        if phases[later].kind == "ramp":
            break
    if ramp.up:
        return np.asarray(highest_degC(measured, after).max(axis=1) - ramp.setpoint_degC)
    lowest = measured.table[:, after, LOWEST] + numbers_of(measured, after, "setpoint_degC")
    return np.asarray(ramp.setpoint_degC - lowest.min(axis=1))


def _rise(measured: CriterionTable, _phases: Sequence[int]) -> Array:
    """Return how far each loop has to go, up or down [°C], shape (n, 1)."""
    return np.asarray(np.abs(measured.scenario.setpoint_degC - measured.rows[:, 5:6]))


def _change(measured: CriterionTable, phases: Sequence[int]) -> Array:
    """Return by how much the setpoint changes at the begin of each phase [°C], shape (phases,)."""
    setpoints = measured.scenario.setpoints_degC
    return np.array([abs(setpoints[number] - setpoints[number - 1]) for number in phases])


def _ramp(measured: CriterionTable, phases: Sequence[int]) -> Array:
    """Return the heights of ramps [°C], shape (ramps,)."""
    ramps = [measured.scenario.disturbances[number - 1] for number in phases]
    return np.array([abs(each.setpoint_degC - each.from_degC) for each in ramps if isinstance(each, SetpointRampEvent)])


#: what a criterion may be a percentage of
STEPS_DEGC: Final[dict[str, PhaseMeasure]] = {"rise": _rise, "change": _change, "ramp": _ramp}


def first_within(error: Array, band: float) -> int:
    """Return the reading from which on the error stays within a band; as many as there are where the last one is not.

    Args:
        error: of the readings, shape (n,).
        band: how far from 0 is within it, in its unit.
    """
    outside = np.flatnonzero(np.abs(error) > band)
    return int(outside[-1]) + 1 if len(outside) else 0


def turning_points(values: Sequence[float], least: float) -> list[int]:
    """Return where values turn, by at least so much each time; the first is the extreme that they leave first."""
    turns: list[int] = []
    high = low = way = 0
    for place, value in enumerate(values):
        high = place if value > values[high] else high
        low = place if value < values[low] else low
        if way >= 0 and values[high] - value >= least:
            turns.append(high)
            way, low = -1, place
        elif way <= 0 and value - values[low] >= least:
            turns.append(low)
            way, high = 1, place
    return turns
