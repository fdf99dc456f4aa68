"""What many samples amount to: quantiles of each criterion, the share that keeps all limits, the worst sample."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from heatertune.codec import encode
from heatertune.proof.criteria import Limits
from heatertune.proof.measured import columns_of
from heatertune.proof.samples import Drawing, Spread, measure
from heatertune.units import check

__all__ = ["SampleProof", "Spot", "prove_samples"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Spot:
    """One criterion over all samples; infinite for something that never happened.

    Attributes:
        name: of the criterion, as in `judge`.
        unit: of all its numbers.
        limit: with several disturbances that of the worst sample; None: the number informs.
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
        """Return the JSON object; numbers that are not finite are null."""
        document: dict[str, Any] = {"verdict": self.verdict, **encode(self)}
        return document | {"criteria": {spot.pop("name"): spot for spot in document["criteria"]}}


def prove_samples(
    drawing: Drawing, limits: Limits, count: int, *, seed: int = 0, quantile: float = 0.95, workers: int | None = None
) -> SampleProof:
    """Run samples and judge them: PASS where at least `quantile` of them keep every limit.

    Raises:
        OutOfRange: no samples, a negative seed, a quantile outside (0, 1].
    """
    check("quantile", quantile, above=0.0, most=1.0)
    measured = measure(drawing, limits, count, seed=seed, workers=workers)
    broken, strain = np.zeros(count), np.zeros(count)
    spots = []
    for column in columns_of(measured, limits):
        used = column.strains
        ok = used <= 1.0
        broken += ~ok
        strain = np.maximum(strain, used)
        limit = None if column.limits is None else column.limits[np.argmax(used)].item()
        median, p95, p99 = np.quantile(column.values, [0.5, 0.95, 0.99], method="higher").tolist()
        spots.append(Spot(name=column.name, unit=column.unit, limit=limit, median=median, p95=p95, p99=p99,
                          worst=float(column.values.max()), passing=float(np.mean(ok))))
    worst = int(np.lexsort((-strain, -broken))[0])
    return SampleProof(
        count=count, seed=seed, quantile=quantile, passing=float(np.mean(broken == 0.0)), worst_seed=seed + worst,
        spread=drawing.spread, criteria=tuple(spots),
    )
