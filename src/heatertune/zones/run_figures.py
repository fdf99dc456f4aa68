"""Figures of a run of zones: overshoots, how far zones are apart, and how many heaters are on at once."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

import numpy as np

from heatertune.arrays import Array
from heatertune.zones.joint_loop import JointTrace

__all__ = ["PeakPower", "RunPhase", "overshoot_criteria", "tightest_degC", "zone_spread"]

_Made = TypeVar("_Made")


class RunPhase(NamedTuple):
    """A part of a run: what is judged between two instants."""

    kind: str
    zone: int
    start_s: float
    end_s: float
    change_degC: float = 0.0
    idle: tuple[int, ...] = ()  # zones that are not judged


def zone_spread(highest_degC: Array, lowest_degC: Array, setpoints_degC: Array) -> tuple[float, int, int]:
    """Return by how much the largest difference between two zones exceeds that between their setpoints [°C].

    A zone may be warmer than another one by as much as its setpoint is higher. The numbers of both zones follow, the
    warmer one first.

    Args:
        highest_degC: of each zone from each scan up to the next one, shape (K, n) [°C].
        lowest_degC: likewise, shape (K, n) [°C].
        setpoints_degC: of the zones, shape (n,) [°C].
    """
    beyond = [(float(np.max(highest_degC[:, warm] - lowest_degC[:, cold]))
               - max(float(setpoints_degC[warm] - setpoints_degC[cold]), 0.0), warm, cold)
              for warm in range(len(setpoints_degC)) for cold in range(len(setpoints_degC)) if warm != cold]
    most, warm, cold = max(beyond)
    return max(most, 0.0), warm, cold


def tightest_degC(whole_degC: float, most_pct: float | None, most_degC: float | None) -> float | None:
    """Return the lower of two limits, one of them a share of a rise or change [°C]; None where there is none [°C]."""
    limits = [] if most_pct is None else [most_pct / 100.0 * whole_degC]
    return min([*limits, *([] if most_degC is None else [most_degC])], default=None)


def overshoot_criteria(
    make: Callable[..., _Made], rise_degC: float, name: str, beyond_degC: Array,
    most: tuple[float | None, float | None],
) -> Iterator[_Made]:
    """Yield an overshoot as a share of the rise, if it is limited, as a share of the rise or in °C.

    Args:
        make: a criterion of a name, value and limit.
        rise_degC: from the ambient to the setpoint [°C].
        name: of the criterion.
        beyond_degC: distance from the setpoint, shape (K,) [°C].
        most: limits, as a share of the rise [%] and in °C; None: none.
    """
    if (limit_degC := tightest_degC(rise_degC, *most)) is not None:
        yield make(name=name, value=100.0 * float(beyond_degC.max()) / rise_degC, limit=100.0 * limit_degC / rise_degC)


@dataclass(slots=True)
class PeakPower:
    """How many heaters are on at once while the setpoints are held, over all runs."""

    most: int = 0
    ever: int = 0
    bound: int = 0
    periods: int = 0
    within_bound: int = 0

    @property
    def share(self) -> float:
        """Share of the PWM periods in which no more heaters than the bound are on at once."""
        return self.within_bound / self.periods if self.periods else 1.0

    def count(self, trace: JointTrace, phases: Sequence[RunPhase], period_s: float, bound: int) -> None:
        """Count the heaters in the last fifth of phases in which the setpoints are held; `bound` is ⌈Σ duty⌉."""
        self.bound = self.bound or bound  # that of the best fit, which runs first
        instants, on = trace.heaters_on()
        self.ever = max(self.ever, int(np.max(on, initial=0)))
        for phase in phases:
            start = phase.end_s - 0.2 * (phase.end_s - phase.start_s)
            inside = (instants >= start) & (instants < phase.end_s)
            period = np.floor((instants[inside] - start) / period_s).astype(np.int64)
            if len(period):
                most = np.zeros(int(period.max()) + 1)
                np.maximum.at(most, period, on[inside])
                self.most = max(self.most, int(most.max()))
                self.periods += len(most)
                self.within_bound += int(np.count_nonzero(most <= bound))
