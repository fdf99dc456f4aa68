"""A log with power as the compiled fit wants it: readings, and the exact instants at which the power changes.

A long log is thinned by averaging runs of readings. The model is averaged over the same runs, exactly, and
the power's edges are not touched, so thinning costs resolution but brings no bias. Only where a controller moves
the power at nearly every reading is the power averaged too, between its largest moves; its integral is kept.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from heatertune.log.values import Log

__all__ = ["GAP", "Readings"]

Array = npt.NDArray[np.float64]

GAP = 2.5  # sampling intervals: a wider step of the time is a gap, over which nothing is averaged

_EDGES = 4000  # of the power: with more, a fit takes long


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Readings:
    """Readings and power edges.

    Attributes:
        time_s: middle of each reading, shape (n,).
        half_s: half the time over which it was averaged, 0: an instant, shape (n,).
        temperature_degC: shape (n,).
        edge_s: instants at which the power takes a new value, the log's first one included, shape (k,).
        level_pct: that value, shape (k,).
        averaged: most readings of the log in one of these.
        restart_s: instants of the first readings of later segments, whose state nothing before tells, shape (r,).
    """

    time_s: Array
    half_s: Array
    temperature_degC: Array
    edge_s: Array
    level_pct: Array
    averaged: int = 1
    restart_s: Array = field(default_factory=lambda: np.empty(0))

    @classmethod
    def of(cls, log: Log) -> Readings:
        """Return the readings of a log with power, one for one."""
        assert log.power_pct is not None
        changes = np.concatenate([[True], np.diff(log.power_pct) != 0.0])
        return cls(
            time_s=log.time_s, half_s=np.zeros(len(log.time_s)), temperature_degC=log.temperature_degC,
            edge_s=log.time_s[changes], level_pct=log.power_pct[changes],
        )

    def average(self, most: int) -> Readings:
        """Return the readings averaged to about `most`: more, where gaps and edges end a run early."""
        time, n = self.time_s, len(self.time_s)
        count = -(-n // most)
        if count == 1:
            return self
        starts = self._runs(count)
        sizes = np.diff(np.append(starts, n))
        ends = starts + sizes - 1
        weight = np.where(self.half_s > 0.0, self.half_s, 0.5 * float(np.median(np.diff(time))))
        total = np.add.reduceat(weight, starts)
        # each reading stands for its interval (midpoint rule), so a run reaches half an interval beyond its ends
        own = np.where(sizes > 1, (time[ends] - time[starts]) / np.maximum(sizes - 1, 1), 2.0 * self.half_s[starts])
        edges, levels = self._merged()
        return replace(
            self, edge_s=edges, level_pct=levels,
            time_s=np.add.reduceat(weight * time, starts) / total,
            half_s=0.5 * own * sizes,
            temperature_degC=np.add.reduceat(weight * self.temperature_degC, starts) / total,
            averaged=self.averaged * count,
        )

    def _merged(self) -> tuple[Array, Array]:
        """Return edges and levels; where there are very many edges, only the largest stay exact."""
        if len(self.edge_s) <= _EDGES:
            return self.edge_s, self.level_pct
        held = np.diff(self.edge_s, append=max(self.time_s[-1], self.edge_s[-1]) + 1e-9)
        large = 1 + np.argpartition(np.abs(np.diff(self.level_pct)), -_EDGES // 2)[-_EDGES // 2 :]
        count = -(-2 * len(held) // _EDGES)
        starts = np.union1d(large, np.arange(1, len(held), count))  # the first level is also the one before the log
        mean = np.add.reduceat(held * self.level_pct, starts) / np.add.reduceat(held, starts)
        return self.edge_s[np.append(0, starts)], np.append(self.level_pct[0], mean)

    def _runs(self, count: int) -> npt.NDArray[np.intp]:
        """Return where runs of `count` readings begin; one ends at a gap, a restart, at edges where few."""
        n, step = len(self.time_s), np.diff(self.time_s)
        breaks = np.concatenate([[True], step > GAP * np.median(step)])
        if len(self.edge_s) * count < n:
            breaks[np.minimum(np.searchsorted(self.time_s, self.edge_s), n - 1)] = True
        breaks[np.searchsorted(self.time_s, self.restart_s)] = True
        begun = np.maximum.accumulate(np.where(breaks, np.arange(n), 0))
        return np.flatnonzero((np.arange(n) - begun) % count == 0)
