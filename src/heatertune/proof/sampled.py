"""What many samples amount to: quantiles of each criterion, the share that keeps all limits, the worst sample."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from heatertune.proof.criteria import Limits
from heatertune.proof.judge import rest_of
from heatertune.proof.loop import scans_of
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
from heatertune.proof.samples import Drawing, Measured, Spread, measure
from heatertune.proof.scenario import Kick
from heatertune.units import check

__all__ = ["SampleProof", "Spot", "criteria_of", "prove_samples"]

Array = npt.NDArray[np.float64]

_UNITS: Final = {
    "overshoot": "%", "settling_time": "s", "steady_offset": "°C", "limit_cycle": "°C", "pwm_ripple": "°C",
    "iae": "°C·s", "recovery_time": "s", "recovery_overshoot": "%", "deviation": "°C", "saturation": "%",
    "switchings": "1/h", "overflow": "1",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Spot:
    """One criterion over all samples; infinite for something that never happened.

    Attributes:
        name: of the criterion, as in `judge`.
        unit: of all its numbers.
        limit: None: the number informs.
        median, p95, p99, worst: of its value over the samples; the largest is the worst.
        passing: share of the samples that keep the limit, 0…1.
    """

    name: str
    unit: str
    limit: float | None
    median: float
    p95: float
    p99: float
    worst: float
    passing: float

    def to_document(self) -> dict[str, Any]:
        """Return the JSON object; a number that is not finite is null."""
        told = asdict(self)
        del told["name"]
        return {key: None if isinstance(v, float) and not math.isfinite(v) else v for key, v in told.items()}


@dataclass(frozen=True, slots=True, kw_only=True)
class SampleProof:
    """The verdict on many samples.

    Attributes:
        count: how many samples.
        seed: of the first one; the others follow.
        quantile: share of the samples that must keep every limit.
        passing: share that does.
        worst_seed: seed of the worst sample: most limits broken, then the most of a limit used.
        spread: what they were drawn from.
        criteria: by name.
    """

    count: int
    seed: int
    quantile: float
    passing: float
    worst_seed: int
    spread: Spread
    criteria: tuple[Spot, ...]

    @property
    def verdict(self) -> str:
        """"PASS" where at least `quantile` of the samples keep every limit, else "FAIL"."""
        return "PASS" if self.passing >= self.quantile else "FAIL"

    def to_document(self) -> dict[str, Any]:
        """Return the JSON object."""
        return {
            "verdict": self.verdict, "count": self.count, "seed": self.seed, "quantile": self.quantile,
            "passing": self.passing, "worst_seed": self.worst_seed, "spread": asdict(self.spread),
            "criteria": {spot.name: spot.to_document() for spot in self.criteria},
        }


def prove_samples(
    drawing: Drawing, limits: Limits, count: int, *, seed: int = 0, quantile: float = 0.95, workers: int | None = None
) -> SampleProof:
    """Run samples and judge them: PASS where at least `quantile` of them keep every limit.

    Raises:
        OutOfRange: no samples, a negative seed, a quantile outside (0, 1].
    """
    check("quantile", quantile, above=0.0, most=1.0)
    found = criteria_of(drawing, limits, measure(drawing, limits, count, seed=seed, workers=workers))
    broken, strain = np.zeros(count), np.zeros(count)
    spots = []
    for name, (values, used, limit) in found.items():
        ok = used <= 1.0
        broken += ~ok
        strain = np.maximum(strain, used)
        median, p95, p99 = np.quantile(values, [0.5, 0.95, 0.99], method="higher").tolist()
        spots.append(Spot(name=name, unit=_UNITS[name], limit=limit, median=median, p95=p95, p99=p99,
                          worst=float(values.max()), passing=float(np.mean(ok))))
    worst = int(np.lexsort((-strain, -broken))[0])
    return SampleProof(
        count=count, seed=seed, quantile=quantile, passing=float(np.mean(broken == 0.0)), worst_seed=seed + worst,
        spread=drawing.spread, criteria=tuple(spots),
    )


def criteria_of(drawing: Drawing, limits: Limits, found: Measured) -> dict[str, tuple[Array, Array, float | None]]:
    """Return by name, as `judge` has them: value and share of the limit used of each sample, and the limit.

    With several disturbances the one that uses most of its limit counts; the limit told is then the first one's.
    """
    scenario, scans = drawing.scenario, scans_of(drawing.controller, drawing.scenario)
    end = (scans - 1) * drawing.controller.scan_s
    stops = [*(each.time_s for each in scenario.disturbances), end]
    _, begin = rest_of(limits, stops[0], drawing.actuator.pwm_period_s)
    step, total, first = scenario.setpoint_degC - found.rows[:, 5], found.totals, found.phases[:, 0]
    band = max(limits.tolerance_degC, limits.tolerance_resolutions * drawing.controller.resolution_degC)
    settling = stops[0] if limits.settling_s is None else limits.settling_s
    plain: dict[str, tuple[Array, float | None]] = {
        "overshoot": (100.0 * np.maximum(0.0, first[:, HIGHEST]) / step, limits.overshoot_pct),
        "settling_time": (first[:, SETTLED], settling),
        "steady_offset": (np.abs(total[:, MEAN]) / (stops[0] - begin), band),
        "limit_cycle": ((total[:, REST_HIGHEST] - total[:, REST_LOWEST]) / 2.0, band),
        "pwm_ripple": (found.ripple, limits.pwm_ripple_degC),
        "iae": (found.phases[:, :, ABSOLUTE].sum(axis=1), limits.iae_degC_s),
    }
    after = {
        "saturation": (100.0 * total[:, LIMITED] / scans, limits.saturation_pct),
        "switchings": (total[:, SWITCHINGS] / (scenario.duration_s / 3600.0), limits.switchings_per_h),
        "overflow": (total[:, FAULTS], limits.overflows),
    }
    told = {name: (values, _used(values, limit), limit) for name, (values, limit) in plain.items()}
    told |= _recoveries(drawing, limits, found, step, stops)
    return told | {name: (values, _used(values, limit), limit) for name, (values, limit) in after.items()}


def _recoveries(
    drawing: Drawing, limits: Limits, found: Measured, step: Array, stops: list[float]
) -> dict[str, tuple[Array, Array, float | None]]:
    """Return the criteria of the disturbances, of each sample that of the one that uses most of its limit."""
    rows: dict[str, list[tuple[Array, Array, float | None]]] = {}
    for number, each in enumerate(drawing.scenario.disturbances):
        phase = found.phases[:, number + 1]
        change = each.temperature_degC if isinstance(each, Kick) else each.power_pct
        up = math.copysign(1.0, change) > 0.0
        along, beyond = (phase[:, HIGHEST], -phase[:, LOWEST]) if up else (-phase[:, LOWEST], phase[:, HIGHEST])
        time = stops[number + 1] - stops[number] if limits.recovery_s is None else limits.recovery_s
        for name, values, limit in (
            ("recovery_time", phase[:, SETTLED] - stops[number], time),
            ("recovery_overshoot", 100.0 * np.maximum(0.0, beyond) / step, limits.recovery_overshoot_pct),
            ("deviation", np.maximum(0.0, along), limits.deviation_degC),
        ):
            rows.setdefault(name, []).append((values, _used(values, limit), limit))
    return {name: _worst(cases) for name, cases in rows.items()}


def _worst(cases: list[tuple[Array, Array, float | None]]) -> tuple[Array, Array, float | None]:
    values, used, limit = cases[0]
    for other, strain, _ in cases[1:]:
        worse = (strain > used) | ((strain == used) & (other > values))
        values, used = np.where(worse, other, values), np.where(worse, strain, used)
    return values, used, limit


def _used(values: Array, limit: float | None) -> Array:
    """Return how much of an upper limit is used, as `Criterion.strain`."""
    if limit is None:
        return np.zeros(len(values))
    if limit > 0.0:
        return np.maximum(0.0, values / limit)
    return np.where(values <= limit, 0.0, math.inf)
