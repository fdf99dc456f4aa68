"""What many samples amount to: quantiles of each criterion, how many keep all limits, the worst sample."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.codec import encode
from heatertune.proof.criteria import LoopLimits, columns_of
from heatertune.proof.monte_carlo.draw import SampleRequest, SampleSpread, measure
from heatertune.proof.verdict import verdict_of_samples
from heatertune.units import check

__all__ = ["SampleProof", "SampledSetting", "Spot", "hardest_setting", "prove_samples"]


_AT_ONCE: Final = 10_000  # samples of which all is kept that was measured: some kilobytes each
_NAMED: Final = 500  # runs that break a limit whose samples are named


@dataclass(frozen=True, slots=True, kw_only=True)
class Spot:
    """One criterion over all samples, each under the setting that is worst for it; infinite for what never happened.

    Attributes:
        name: of the criterion, as in `CRITERIA`.
        unit: of all its numbers.
        limit: with several disturbances that of the worst sample; None: the number informs.
        bound: ">=" where it has to be reached, else "<=".
        median, p95, p99, worst: of its value over the samples; the largest is the worst, or, where it has to reach its
            limit, the smallest.
        passing: share of the samples that keep the limit under every setting, 0…1.
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
class SampledSetting:
    """A setting of what the manual leaves open, and how many of the samples keep every limit under it."""

    switches: Mapping[str, str]
    passing_count: int


@dataclass(frozen=True, slots=True, kw_only=True)
class SampleProof:
    """The verdict on many samples.

    Attributes:
        count: how many samples, each run under every setting of what the manual leaves open.
        seed: of the first one; the others follow.
        quantile: share of all such heaters that must keep every limit.
        passing: share of the samples that does, under the setting under which the fewest do: a controller has one
            setting, whichever it is.
        settings: each setting and how many samples keep every limit under it.
        worst_seed: seed of the worst sample: most limits broken, then the most of a limit used.
        broken: seeds of samples that break a limit, the worst first, of very many some; no document has them.
        spread: what they were drawn from.
        criteria: by name.
    """

    count: int
    seed: int
    quantile: float
    passing: float
    settings: tuple[SampledSetting, ...]
    worst_seed: int
    spread: SampleSpread
    criteria: tuple[Spot, ...]
    broken: tuple[int, ...]

    @property
    def verdict(self) -> str:
        """Whether `quantile` of all such heaters keep every limit under each setting, see `verdict_of_samples`."""
        return verdict_of_samples(self.count, self.quantile, [setting.passing_count for setting in self.settings])

    def to_document(self) -> dict[str, Any]:
        """Return the JSON object; numbers that are not finite are null."""
        document: dict[str, Any] = {"verdict": self.verdict, **encode(self)}
        del document["broken"]
        return document | {"criteria": {spot.pop("name"): spot for spot in document["criteria"]}}


def prove_samples(
    drawing: SampleRequest, limits: LoopLimits, count: int, *, seed: int = 0, quantile: float = 0.95,
    workers: int | None = None
) -> SampleProof:
    """Run samples and judge them.

    Args:
        drawing: what is drawn.
        limits: that each has to keep.
        count: how many samples.
        seed: of the first one.
        quantile: share of all such heaters that has to keep every limit, under each setting.
        workers: how many processors share them; None: all.

    Raises:
        OutOfRange: no samples, a negative seed, a quantile outside (0, 1].
    """
    check("quantile", quantile, above=0.0, most=1.0)
    check("samples", count, least=1)
    found = [_run(drawing, limits, min(_AT_ONCE, count - begun), seed + begun, workers)
             for begun in range(0, count, _AT_ONCE)]
    broken, strain = (np.concatenate([getattr(part, name) for part in found], axis=1) for name in ("broken", "strain"))
    kept, hardest = np.count_nonzero(broken == 0, axis=1).tolist(), _hardest(broken, strain)
    settings = tuple(SampledSetting(switches=controller.switches, passing_count=number)
                     for controller, number in zip(drawing.controllers, kept, strict=True))
    return SampleProof(
        count=count, seed=seed, quantile=quantile, settings=settings, spread=drawing.spread,
        passing=min(kept) / count, worst_seed=seed + int(hardest[0]) % count,
        broken=tuple(dict.fromkeys((seed + hardest[:np.count_nonzero(broken)][:_NAMED] % count).tolist())),
        criteria=tuple(_spot(each) for each in zip(*(part.criteria for part in found), strict=True)))


class _SampledCriterion(NamedTuple):
    """One criterion of some samples: of each its worst value, signed so that the largest is the worst, and strain."""

    name: str
    unit: str
    at_least: bool
    values: Array
    strain: Array
    limit: float | None  # of the one that strains most


class _SampleTally(NamedTuple):
    """What some samples amount to: of each, under each setting, how many limits it breaks and the most it uses of one.

    Arrays of shape (settings, samples).
    """

    criteria: list[_SampledCriterion]
    broken: npt.NDArray[np.intp]
    strain: Array


def _run(drawing: SampleRequest, limits: LoopLimits, count: int, seed: int, workers: int | None) -> _SampleTally:
    columns = list(columns_of(measure(drawing, limits, count, seed=seed, workers=workers), limits))
    strains = np.array([column.strains.reshape(-1, count) for column in columns])
    criteria = [
        _SampledCriterion(
            name=column.name, unit=column.unit, at_least=column.at_least, strain=strain.max(axis=0),
            values=(_sign(column.at_least) * column.values).reshape(-1, count).max(axis=0),
            limit=None if column.limits is None else column.limits[np.argmax(strain)].item())
        for column, strain in zip(columns, strains, strict=True)]
    return _SampleTally(criteria, np.count_nonzero(~(strains <= 1.0), axis=0), strains.max(axis=0))


def _spot(parts: Sequence[_SampledCriterion]) -> Spot:
    first, values, strain = parts[0], *(np.concatenate([getattr(part, name) for part in parts])
                                        for name in ("values", "strain"))
    median, p95, p99, most = (_sign(first.at_least) * np.quantile(
        values, [0.5, 0.95, 0.99, 1.0], method="higher")).tolist()
    return Spot(
        name=first.name, unit=first.unit, limit=max(parts, key=lambda part: float(part.strain.max())).limit,
        bound=">=" if first.at_least else "<=", median=median, p95=p95, p99=p99, worst=most,
        passing=float(np.mean(strain <= 1.0)))


def _sign(at_least: bool) -> float:
    """Return by what values are multiplied so that the largest is the worst."""
    return -1.0 if at_least else 1.0


def _hardest(broken: npt.NDArray[np.intp], strain: Array) -> npt.NDArray[np.intp]:
    """Return the numbers of the runs: first what breaks the most limits, of equals what uses most of one."""
    return np.lexsort((-strain.ravel(), -broken.ravel()))


def hardest_setting(drawing: SampleRequest, limits: LoopLimits, seed: int) -> int:
    """Return the number of the setting under which the sample of a seed is the worst, as in `SampleProof.worst_seed`.

    Raises:
        OutOfRange: a negative seed.
    """
    if len(drawing.controllers) == 1:
        return 0
    found = _run(drawing, limits, 1, seed, 1)
    return int(_hardest(found.broken, found.strain)[0])
