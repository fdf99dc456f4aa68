"""What was measured on loops → criteria: one table for both, the trace of a run and the kernel's meter.

`judge` measures on a trace, `metered` while the loops run; neither knows the other's arithmetic.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from heatertune.proof.criteria import Criterion, Limits
from heatertune.proof.meter import (
    ABSOLUTE,
    FAULTS,
    HIGHEST,
    LIMITED,
    LOWEST,
    MEAN,
    REST_HIGHEST,
    REST_LOWEST,
    SETTLED,
    SWITCHINGS,
)
from heatertune.proof.scenario import Kick, Scenario

__all__ = ["Column", "Measured", "band_of", "columns_of", "joined", "rest_of"]

Array = npt.NDArray[np.float64]

_PERIODS_AT_REST = 3  # PWM periods that the time at rest spans at least


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Measured:
    """What was measured on loops that live through one scenario, a row each, see `proof.meter`.

    Attributes:
        scenario: all temperatures are distances from its setpoint.
        band_degC: how far from it is still right [°C].
        stops_s: where each phase ends: the disturbances and the end [s].
        rest_s: where the time at rest begins; it ends with the first phase [s].
        scans: of each loop.
        rows: of `Batch.plants`, shape (n, 6).
        phases: shape (n, disturbances + 1, `COLUMNS`).
        totals: shape (n, `TOTALS`).
        ripple: peak to peak in each PWM period at rest [°C], median, shape (n,).
    """

    scenario: Scenario
    band_degC: float
    stops_s: tuple[float, ...]
    rest_s: float
    scans: int
    rows: Array
    phases: Array
    totals: Array
    ripple: Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Column:
    """One criterion of many loops.

    Attributes:
        name, unit, what: see `Criterion`; no value may exceed its limit.
        values: of the loops, shape (n,).
        limits: of each of them, shape (n,); None: the numbers inform.
    """

    name: str
    unit: str
    what: str
    values: Array
    limits: Array | None

    @property
    def strains(self) -> Array:
        """How much of its limit each loop uses, as `Criterion.strain`, shape (n,)."""
        unknown = np.isnan(self.values)
        if self.limits is None:
            return np.where(unknown, math.inf, 0.0)
        over = np.where(self.values <= self.limits, 0.0, math.inf)
        used = np.maximum(0.0, np.divide(self.values, self.limits, out=over, where=self.limits > 0.0))
        return np.where(unknown, math.inf, used)

    def criteria(self, labels: Iterable[str]) -> Iterator[Criterion]:
        """Return the criterion of each loop, the loops being called so."""
        limits = [None] * len(self.values) if self.limits is None else self.limits.tolist()
        for value, limit, label in zip(self.values.tolist(), limits, labels, strict=True):
            yield Criterion(name=self.name, value=value, limit=limit, unit=self.unit, what=self.what, where=label)


def joined(parts: Sequence[Measured], *, in_turn: bool = False) -> Measured:
    """Return the loops of all parts, which differ in nothing else: part by part, or in turn one of each part."""
    def all_of(name: str) -> Array:
        arrays = [getattr(part, name) for part in parts]
        return np.stack(arrays, axis=1).reshape(-1, *arrays[0].shape[1:]) if in_turn else np.concatenate(arrays)

    return replace(
        parts[0], rows=all_of("rows"), phases=all_of("phases"), totals=all_of("totals"), ripple=all_of("ripple"))


def band_of(limits: Limits, resolution_degC: float) -> float:
    """Return how far from the setpoint is still right [°C]; the sensor's resolution limits it."""
    return max(limits.tolerance_degC, limits.tolerance_resolutions * resolution_degC)


def rest_of(limits: Limits, end_s: float, period_s: float) -> tuple[int, float]:
    """Return how many PWM periods the time at rest spans, and where it begins [s]; it ends with the heat-up."""
    periods = max(_PERIODS_AT_REST, math.floor(limits.steady_share * end_s / period_s))
    return periods, max(0.0, end_s - periods * period_s)


def columns_of(measured: Measured, limits: Limits) -> list[Column]:
    """Return what the loops amount to, in a fixed order."""
    return [*_heat_up(measured, limits), *_at_rest(measured, limits), *_recovery(measured, limits),
            *_switching(measured, limits)]


def _column(name: str, unit: str, values: Array, limit: float | None, what: str) -> Column:
    limits = None if limit is None else np.full(len(values), limit)
    return Column(name=name, unit=unit, what=what, values=values, limits=limits)


def _steps(measured: Measured) -> Array:
    """Return how far each loop has to go [°C]."""
    return np.asarray(measured.scenario.setpoint_degC - measured.rows[:, 5])


def _heat_up(measured: Measured, limits: Limits) -> Iterator[Column]:
    first, end = measured.phases[:, 0], measured.stops_s[0]
    yield _column(
        "overshoot", "%", np.maximum(0.0, first[:, HIGHEST]) / _steps(measured) * 100.0, limits.overshoot_pct,
        "Beyond the setpoint during heat-up, of the setpoint step.")
    yield _column(
        "overshoot_degC", "°C", np.maximum(0.0, first[:, HIGHEST]), limits.overshoot_degC,
        "Beyond the setpoint during heat-up.")
    yield _column(
        "settling_time", "s", first[:, SETTLED], end if limits.settling_s is None else limits.settling_s,
        f"Time after which the temperature stays within ±{measured.band_degC:.3g} °C of the setpoint.")


def _at_rest(measured: Measured, limits: Limits) -> Iterator[Column]:
    total, band = measured.totals, measured.band_degC
    begin, end = measured.rest_s, measured.stops_s[0]
    yield _column(
        "steady_offset", "°C", np.abs(total[:, MEAN]) / (end - begin), band,
        f"Mean distance from the setpoint from {begin:.0f} to {end:.0f} s, before any disturbance.")
    yield _column(
        "limit_cycle", "°C", (total[:, REST_HIGHEST] - total[:, REST_LOWEST]) / 2.0, band,
        f"Half of the temperature's peak to peak from {begin:.0f} to {end:.0f} s, PWM ripple included.")
    yield _column(
        "pwm_ripple", "°C", measured.ripple, limits.pwm_ripple_degC,
        "Peak to peak within one PWM period over the same time, median.")
    yield _column(
        "iae", "°C·s", measured.phases[:, :, ABSOLUTE].sum(axis=1), limits.iae_degC_s,
        "Integral of the absolute error over the whole record.")


def _recovery(measured: Measured, limits: Limits) -> Iterator[Column]:
    """Return the criteria of the disturbances, for each loop that of the one that uses most of its limit."""
    after = [list(_after(measured, limits, number)) for number in range(len(measured.scenario.disturbances))]
    for first, *later in zip(*after, strict=True):
        worst = first
        for other in later:
            worst = _worse(worst, other)
        yield worst


def _after(measured: Measured, limits: Limits, number: int) -> Iterator[Column]:
    disturbance, phase = measured.scenario.disturbances[number], measured.phases[:, number + 1]
    change = disturbance.temperature_degC if isinstance(disturbance, Kick) else disturbance.power_pct
    up = math.copysign(1.0, change) > 0.0
    along, beyond = (phase[:, HIGHEST], -phase[:, LOWEST]) if up else (-phase[:, LOWEST], phase[:, HIGHEST])
    begin, end = measured.stops_s[number : number + 2]
    time = end - begin if limits.recovery_s is None else limits.recovery_s
    yield _column(
        "recovery_time", "s", phase[:, SETTLED] - begin, time,
        f"Time after a disturbance until the temperature stays within ±{measured.band_degC:.3g} °C of the setpoint.")
    yield _column(
        "recovery_overshoot", "%", np.maximum(0.0, beyond) / _steps(measured) * 100.0, limits.recovery_overshoot_pct,
        "Beyond the setpoint after a disturbance, on the other side, of the setpoint step.")
    yield _column(
        "recovery_overshoot_degC", "°C", np.maximum(0.0, beyond), limits.recovery_overshoot_degC,
        "Beyond the setpoint after a disturbance, on the other side.")
    yield _column(
        "deviation", "°C", np.maximum(0.0, along), limits.deviation_degC,
        "Largest distance from the setpoint after a disturbance, on its side.")


def _worse(one: Column, other: Column) -> Column:
    """Return, for each loop, the one that uses more of its limit; without limits the larger value."""
    used, more = one.strains, other.strains
    worse = (more > used) | ((more == used) & (other.values > one.values))
    limits = None if one.limits is None or other.limits is None else np.where(worse, other.limits, one.limits)
    return replace(one, values=np.where(worse, other.values, one.values), limits=limits)


def _switching(measured: Measured, limits: Limits) -> Iterator[Column]:
    total, hours = measured.totals, measured.scenario.duration_s / 3600.0
    yield _column(
        "saturation", "%", total[:, LIMITED] / measured.scans * 100.0, limits.saturation_pct,
        "Share of the scans that ask for 0 or 100 % power.")
    yield _column(
        "switchings", "1/h", total[:, SWITCHINGS] / hours, limits.switchings_per_h,
        "How often the heater is switched on.")
    yield _column(
        "overflow", "1", total[:, FAULTS], limits.overflows,
        "How often a flag that means a wrong result was set, or the power asked for was no number.")
