"""What many samples amount to: quantiles of each criterion, the share that keeps all limits, the worst sample."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from heatertune.codec import encode
from heatertune.proof.criteria import Limits
from heatertune.proof.measured import columns_of
from heatertune.proof.samples import Drawing, Spread, measure
from heatertune.proof.verdict import verdict_of_samples
from heatertune.units import check

__all__ = ["SampleProof", "Setting", "Spot", "prove_samples"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Spot:
    """One criterion over all samples; infinite for something that never happened.

    Attributes:
        name: of the criterion, as in `judge`.
        unit: of all its numbers.
        limit: with several disturbances that of the worst sample; None: the number informs.
        bound: ">=" where it has to be reached, else "<=".
        median, p95, p99, worst: of its value over the samples; the largest is the worst, or, where it has to reach its
            limit, the smallest.
        passing: share of the samples that keep the limit, 0…1.
    """

    name: str
    unit: str
    limit: float | None
    bound: str
    median: float
    p95: float
    p99: float
    worst: float
    passing: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """A setting of what the manual leaves open, and the share of its samples that keep every limit; None: no sample."""

    switches: Mapping[str, str]
    passing: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class SampleProof:
    """The verdict on many samples.

    Attributes:
        count: how many samples.
        seed: of the first one; the others follow.
        quantile: share of the samples that must keep every limit.
        passing: share that does, under the setting of what the manual leaves open under which the fewest do: a
            controller has one setting, whichever it is.
        settings: each setting and the share that passes under it; None: it got no sample.
        worst_seed: seed of the worst sample: most limits broken, then the most of a limit used.
        spread: what they were drawn from.
        criteria: by name.
    """

    count: int
    seed: int
    quantile: float
    passing: float
    settings: tuple[Setting, ...]
    worst_seed: int
    spread: Spread
    criteria: tuple[Spot, ...]

    @property
    def verdict(self) -> str:
        """"PASS" where at least `quantile` of the samples keep every limit under each setting, else "FAIL".

        "NOT PROVEN" where a setting got no sample.
        """
        return verdict_of_samples(self.passing, self.quantile, [setting.passing for setting in self.settings])

    def to_document(self) -> dict[str, Any]:
        """Return the JSON object; numbers that are not finite are null."""
        document: dict[str, Any] = {"verdict": self.verdict, **encode(self)}
        return document | {"criteria": {spot.pop("name"): spot for spot in document["criteria"]}}


def prove_samples(
    drawing: Drawing, limits: Limits, count: int, *, seed: int = 0, quantile: float = 0.95, workers: int | None = None
) -> SampleProof:
    """Run samples and judge them.

    Args:
        drawing: what is drawn.
        limits: that each has to keep.
        count: how many samples.
        seed: of the first one.
        quantile: share that has to keep every limit, under each setting of what the manual leaves open.
        workers: how many processors share them; None: all.

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
        sign, bound = (-1.0, ">=") if column.at_least else (1.0, "<=")
        median, p95, p99, most = (
            sign * np.quantile(sign * column.values, [0.5, 0.95, 0.99, 1.0], method="higher")).tolist()
        spots.append(Spot(name=column.name, unit=column.unit, limit=limit, bound=bound, median=median, p95=p95, p99=p99,
                          worst=most, passing=float(np.mean(ok))))
    worst = int(np.lexsort((-strain, -broken))[0])
    ran = np.array([drawing.setting(drawn) for drawn in range(seed, seed + count)])
    shares = [float(np.mean(broken[ran == number] == 0.0)) if number in ran else None
              for number in range(len(drawing.controllers))]
    settings = tuple(Setting(switches=controller.switches, passing=share)
                     for controller, share in zip(drawing.controllers, shares, strict=True))
    return SampleProof(
        count=count, seed=seed, quantile=quantile, settings=settings, worst_seed=seed + worst, spread=drawing.spread,
        passing=min(share for share in shares if share is not None), criteria=tuple(spots),
    )
