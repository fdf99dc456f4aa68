"""Noise is drawn by chance: what passes with one draw of it lives through so many that its verdict speaks of all.

Where n draws all keep the limits, at least a share p of all draws does, with a confidence of 1 - p^n, however the noise
acts (S. S. Wilks, "Determination of sample sizes for setting tolerance limits", Annals of Mathematical Statistics 12,
1941): 59 draws for 95 % with 95 %. They are made on the one run that comes nearest to a limit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

from heatertune.proof.criteria import Criterion, worst_of

__all__ = ["DRAWS", "NoiseDraws", "draw_noise", "nearest"]

DRAWS: Final = 59
_SHARE_PCT: Final = 95  # of all draws, and confidence: 0.95**59 < 0.05
_MOST_NUMBERS: Final = 2_000_000  # of noise at once: 16 MB
_AT_REST: Final = ("steady_offset", "limit_cycle")

#: seeds → what the run amounts to with each
Again = Callable[[Sequence[int]], Sequence[tuple[Criterion, ...]]]


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseDraws:
    """What many draws of the noise do to one run.

    Attributes:
        criteria: each the worst of all draws.
        seed: of the draw that strains its limits most.
        told: what that means, a few words.
    """

    criteria: tuple[Criterion, ...]
    seed: int
    summary: str


def nearest(runs: Sequence[Sequence[Criterion]]) -> int:
    """Return the number of the run that comes nearest to a limit that noise may break."""
    return max(range(len(runs)), key=lambda run: _nearness(runs[run]))


def _nearness(criteria: Sequence[Criterion]) -> float:
    """Return how much of a limit is used; at rest offset and swing together, which is how far a band is left behind."""
    at_rest = sum(one.strain for one in criteria if one.name in _AT_REST)
    return max(at_rest, *(one.strain for one in criteria if one.name != "power_reserve"))


def draw_noise(first: tuple[Criterion, ...], again: Again, *, seed: int, scans: int, noise_degC: float) -> NoiseDraws:
    """Return a run with more draws of its noise, until one of them breaks a limit or all are made.

    Args:
        first: what the run amounts to with the first draw.
        again: runs it with others.
        seed: of the first draw; the others follow.
        scans: of the run.
        noise_degC: standard deviation [°C].
    """
    draws, at_once = {seed: first}, max(1, _MOST_NUMBERS // scans)
    while len(draws) < DRAWS and all(one.ok for criteria in draws.values() for one in criteria):
        seeds = range(seed + len(draws), seed + min(len(draws) + at_once, DRAWS))
        draws.update(zip(seeds, again(seeds), strict=True))
    broken = sum(not all(one.ok for one in criteria) for criteria in draws.values())
    worst = max(draws, key=lambda one: sorted((criterion.strain for criterion in draws[one]), reverse=True))
    return NoiseDraws(criteria=tuple(worst_of(same) for same in zip(*draws.values(), strict=True)), seed=worst,
                 summary=_told(noise_degC, len(draws), broken))


def _told(noise_degC: float, draws: int, broken: int) -> str:
    noise = f"noise of {noise_degC:.3g} °C"
    if broken:
        return f"{noise}: {broken} of {draws} draws break a limit on the run nearest to one"
    return (f"{noise}: {draws} draws on the run nearest to a limit keep all, so {_SHARE_PCT} % of all draws do "
            f"({_SHARE_PCT} % confidence)")
