"""One heater behind several logs with power: gain, lags and dead time shared, all else each log's own.

A log's ambient, drift, initial state and loads are solved inside, the shared numbers searched. A log weighs by the
noise it has in the long run, so a long, noisy record does not outvote a short, quiet one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from heatertune.model.least_squares import Residuals, minimise
from heatertune.model.power.open_loop import FixedUnknowns, PowerFit, PowerProblem, parameters_on_bounds
from heatertune.model.power.regressors import AMBIENT, GAIN
from heatertune.model.statistics import ar1_bic, autocorrelation

__all__ = ["DEAD", "FIRST_AMBIENT", "LAG", "POWER", "JointFit", "JointProblem"]

Array = npt.NDArray[np.float64]

#: places in a vector: ln gain (or ln gain per lag), ln first lag, dead time, ratio of the second lag; then, where it is
#: sought beside what is shared, the first log's ambient
POWER, LAG, DEAD, SECOND, FIRST_AMBIENT = 0, 1, 2, 3, 4

_FAR_AMBIENT = 10.0  # spans of the first log, about its best ambient
_FAR = 1e3  # times the largest gain of a log alone, and its inverse of the least, the search goes no further
_MOST_CORRELATION = 0.99
_LEAST_NOISE = 1e-6  # of the span: a log made without noise does not outweigh all others without limit


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JointFit:
    """The best heater of one order for all logs.

    Attributes:
        vector: see the places above.
        parts: each log's own fit, with the shared numbers held.
    """

    vector: Array
    parts: tuple[PowerFit, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JointProblem:
    """Logs of one heater as a bounded least-squares problem.

    Shapes of the arrays: a vector of what is shared (4,), or (5,) with the first log's ambient, see the places above;
    starts (n, 4) or (n, 5); readings (m,), one log after the other, stacked (…, m).

    Attributes:
        parts: one problem for each log, all of one lag or all of two.
        weights: of each log, the inverse of its noise [1/°C].
        low, high: bounds of the shared vector.
    """

    parts: tuple[PowerProblem, ...]
    weights: Array
    low: Array
    high: Array

    @classmethod
    def of(cls, parts: Sequence[PowerProblem], fits: Sequence[PowerFit]) -> JointProblem:
        """Return the problem of logs whose fits alone are known."""
        gains = [math.log(fit.linear[GAIN]) for fit in fits]
        low = np.min([part.low for part in parts], axis=0)
        high = np.max([part.high for part in parts], axis=0)
        return cls(
            parts=tuple(parts), weights=np.array([1.0 / _noise(p, f) for p, f in zip(parts, fits, strict=True)]),
            low=np.array([min(gains) - math.log(_FAR), *low]),
            high=np.array([max(gains) + math.log(_FAR), *high]),
        )

    @property
    def records(self) -> Array:
        """The readings of all logs, one log after the other [°C], shape (m,)."""
        return np.concatenate([part.readings.temperature_degC for part in self.parts])

    def average(self, most: int) -> JointProblem:
        """Return the problem with each log's readings averaged to about `most`; neighbours' noise is taken as one."""
        parts = tuple(part.average(most) for part in self.parts)
        counts = [math.sqrt(len(a.readings.time_s) / len(b.readings.time_s))
                  for a, b in zip(self.parts, parts, strict=True)]
        return replace(self, parts=parts, weights=self.weights * np.array(counts))

    def split(self, stacked: Array) -> list[Array]:
        """Return the part of each log, along the last axis: of shape (…, m) as many of shape (…, m of the log)."""
        ends = np.cumsum([len(part.readings.time_s) for part in self.parts])
        return np.split(stacked, ends[:-1], axis=-1)

    def residuals(self, records: Array, *, per_lag: bool = False) -> Residuals:
        """Return the weighted residuals of all logs as `minimise` wants them.

        Args:
            records: readings, shape (n, m), of the row that a problem belongs to [°C].
            per_lag: whether the vector begins with the gain per first lag instead of the gain.
        """
        split = self.split(records)

        def answer(z: Array, rows: npt.NDArray[np.intp]) -> Array:
            gain = np.exp(z[:, POWER] + (z[:, LAG] if per_lag else 0.0))
            weighted = []
            for i, (part, weight, record) in enumerate(zip(self.parts, self.weights, split, strict=True)):
                fixed = part.nothing_more(len(z)).values
                fixed[:, GAIN] = gain
                if i == 0 and z.shape[1] > FIRST_AMBIENT:
                    fixed[:, AMBIENT] = z[:, FIRST_AMBIENT]
                own = np.ascontiguousarray(z[:, LAG : SECOND + 1])
                weighted.append(weight * part.solve(own, record[rows], FixedUnknowns(values=fixed))[0])
            return np.concatenate(weighted, axis=1)

        return answer

    def with_ambient(self, fit: JointFit) -> tuple[JointProblem, Array]:
        """Return the problem that seeks the first log's ambient beside what is shared, and the vector of a fit in it.

        Of shape (4,), or with that ambient (5,). The problem itself, where that ambient is known.
        """
        first = self.parts[0]
        if not math.isnan(first.fixed[AMBIENT]):
            return self, fit.vector
        best = float(fit.parts[0].linear[AMBIENT])
        reach = _FAR_AMBIENT * float(np.ptp(first.readings.temperature_degC))
        wider = replace(self, low=np.append(self.low, best - reach), high=np.append(self.high, best + reach))
        return wider, np.append(fit.vector, best)

    def refine(self, starts: Array) -> JointFit:
        """Return the best fit that the starts (n, p), vectors of what is shared, lead to."""
        records = np.tile(self.records, (len(starts), 1))
        minima = minimise(self.residuals(records), starts, self.low, self.high, tolerance=1e-9)
        return self.at(minima.parameters[int(np.argmin(minima.cost))])

    def far(self, fit: JointFit) -> JointFit:
        """Return the best fit whose time constant is the longest searched: the heater as an integrator."""
        longer = self.high[LAG] - fit.vector[LAG]
        start = fit.vector + np.array([longer, longer, 0.0, 0.0])
        high = np.where(np.arange(len(start)) == LAG, self.low, np.maximum(self.high, start))
        records = self.records[None, :]
        return self.at(minimise(self.residuals(records), start[None, :], self.low, high).parameters[0])

    def at(self, vector: Array) -> JointFit:
        """Return the fit at a shared vector (p,), its gain not per lag."""
        gain = math.exp(vector[POWER])
        return JointFit(vector=vector, parts=tuple(part.fit_held(vector[LAG:], gain) for part in self.parts))

    def on_bound(self, fit: JointFit) -> tuple[str, ...]:
        """Return the names of the lags and the dead time that ended on a bound of the search."""
        low, high, z = (vector[LAG:] for vector in (self.low, self.high, fit.vector))
        return parameters_on_bounds(z, low, high)

    def bic(self, fit: JointFit) -> float:
        """Return the criterion over all logs; what they share counts once."""
        shared = 3 + self.parts[0].two_lags
        own = sum(
            ar1_bic(part.readings.temperature_degC - part_fit.simulated_degC, part_fit.unknowns - shared)
            for part, part_fit in zip(self.parts, fit.parts, strict=True)
        )
        return own + shared * math.log(len(self.records))


def _noise(part: PowerProblem, fit: PowerFit) -> float:
    """Return the deviation that white noise of the same size in the long run would have [°C]."""
    record = part.readings.temperature_degC
    left = record - fit.simulated_degC
    rho = float(np.clip(autocorrelation(left, 1)[0], 0.0, _MOST_CORRELATION))
    return max(float(np.std(left)) * math.sqrt((1.0 + rho) / (1.0 - rho)), _LEAST_NOISE * float(np.ptp(record)))
