"""The exact set of gains that keep a sensitivity limit, and the search built on it.

With C = K·c(jω), |1 + K·h| ≥ 1/Ms at one frequency excludes one interval of K (a quadratic in K), and so do the limits
on Mt and Mks; what is left over all frequencies and all models is the feasible set. It need not be connected, so its
pieces are tried from the top. That leaves a search over TN (and TV) only, and no start value can mislead it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from heatertune.errors import InputError
from heatertune.model.values import HeaterModel
from heatertune.pid.loop.response import iae_load, iae_setpoint, itae_load
from heatertune.pid.loop.robustness import noise_gain, sensitivity_peaks
from heatertune.pid.loop.sampled import combined, parts_seen, plant_seen
from heatertune.pid.specs import Specs
from heatertune.pid.values import PidDesign, step_parts, structure_of

__all__ = ["Problem", "largest_gain", "search"]

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

_FREQUENCIES = 300
_PIECES = 4  # feasible pieces tried, from the top
_TOLERANCE = 1.002  # the check's frequencies are finer than the search's


@dataclass(frozen=True, slots=True, kw_only=True)
class Problem:
    """Minimise the mean cost over the models subject to limits on each and on the guards; both as in `Specs`.

    Attributes:
        plants: the heaters to serve.
        structure: "p", "pi" or "pid".
        ms: limit of the maximum sensitivity.
        sample_time_s: TA [s].
        derivative_filter: weight of its past in the derivative part, see `PidDesign`.
        mt, mks: limits of the maximum complementary sensitivity and of the noise gain.
        objective, weight: what is minimised; for ise the feasible-set search takes the load IAE, and IPOPT the rest.
        guards: heaters on which the limits hold too, but which cost nothing.
        step_power: largest power that one scan may move per °C of a reading [%/°C].
    """

    plants: tuple[HeaterModel, ...]
    structure: str
    ms: float
    sample_time_s: float
    derivative_filter: float = 0.5
    mt: float = math.inf
    mks: float = math.inf
    objective: str = "load"
    weight: float | None = None
    guards: tuple[HeaterModel, ...] = ()
    step_power: float = math.inf

    @property
    def limited(self) -> tuple[HeaterModel, ...]:
        """Every heater on which the limits hold."""
        return self.plants + self.guards

    @property
    def specs(self) -> Specs:
        """Objective and limits."""
        return Specs(ms=self.ms, mt=self.mt, mks=self.mks, objective=self.objective, weight=self.weight)

    @property
    def slowest_s(self) -> float:
        """Largest sum of lags and dead time of the heaters on which the limits hold [s]."""
        return max(sum(plant.lags_s) + plant.dead_time_s for plant in self.limited)

    def design(self, gain: float, integral_time_s: float, derivative_time_s: float) -> PidDesign:
        """Return the design with these settings."""
        return PidDesign(
            gain_pct_per_degC=gain, integral_time_s=integral_time_s, derivative_time_s=derivative_time_s,
            sample_time_s=self.sample_time_s, structure=structure_of(integral_time_s, derivative_time_s),
            method="optimum", derivative_filter=self.derivative_filter, step_power_limit_pct_per_degC=self.step_power,
        )

    def cost(self, design: PidDesign) -> float:
        """Return the mean over the models of the objective, in its unit; infinite where a loop does not come to rest.

        A P controller keeps an offset whatever its gain; its cost is the negative gain.
        """
        if not math.isfinite(design.integral_time_s):
            return -design.gain_pct_per_degC
        if self.objective == "ki":
            return design.integral_time_s / design.gain_pct_per_degC
        return float(np.mean([self._cost_on(plant, design) for plant in self.plants]))

    def _cost_on(self, plant: HeaterModel, design: PidDesign) -> float:
        if self.weight is not None:
            load = iae_load(plant, design) / plant.gain_degC_per_pct
            return (1.0 - self.weight) * load + self.weight * iae_setpoint(plant, design)
        return {"setpoint": iae_setpoint, "itae": itae_load}.get(self.objective, iae_load)(plant, design)


def largest_gain(problem: Problem, integral_time_s: float, derivative_time_s: float) -> list[float]:
    """Return the upper ends of the feasible pieces of K > 0, the largest first; empty where none is stable."""
    looked_at = problem.sample_time_s, problem.slowest_s, _FREQUENCIES
    unit, specs = problem.design(1.0, integral_time_s, derivative_time_s), problem.specs
    c = combined(unit, parts_seen(problem.derivative_filter, *looked_at))
    excluded = [_excluded(plant_seen(plant, *looked_at) * c, c, specs) for plant in problem.limited]
    most = problem.step_power / step_parts(
        integral_time_s, derivative_time_s, problem.sample_time_s, problem.derivative_filter)
    tops = _tops(np.concatenate([*excluded, [[most, math.inf]]]))
    return [top for top in tops[-_PIECES:][::-1] if _keeps(problem, top, integral_time_s, derivative_time_s)]


def search(problem: Problem, *, around: PidDesign | None = None) -> PidDesign:
    """Return the best design: a grid over TN (and TV), then zooms around the best point.

    `around` is a design for a neighbouring problem (another TA); the grid then covers its surroundings only.

    Raises:
        InputError: no gain keeps the limit on all models.
    """
    if problem.structure == "p":
        found = _best_gain(problem, math.inf, 0.0)
        if found is None:
            raise _impossible(problem)
        return found[1]
    integral, derivative = _grids(problem, around)
    best: tuple[float, PidDesign] | None = None
    for _ in range(4):
        for tn in integral:
            for tv in derivative:
                tried = _best_gain(problem, float(tn), float(tv))
                if tried is not None and (best is None or tried[0] < best[0]):
                    best = tried
        if best is None:
            break
        integral = _zoom(integral, best[1].integral_time_s)
        derivative = _zoom(derivative, best[1].derivative_time_s)
    if best is None:
        raise _impossible(problem)
    return best[1]


def _grids(problem: Problem, around: PidDesign | None) -> tuple[Array, Array]:
    slow = problem.slowest_s
    derivative = np.geomspace(slow / 80.0, slow / 3.0, 8) if problem.structure == "pid" else np.zeros(1)
    if around is None:
        return np.geomspace(slow / 12.0, 3.0 * slow, 16), derivative
    near = np.geomspace(0.6, 1.6, 5)
    return around.integral_time_s * near, around.derivative_time_s * near if len(derivative) > 1 else derivative


def _impossible(problem: Problem) -> InputError:
    return InputError(
        f"no {problem.structure.upper()} controller keeps {problem.specs.text} on all {len(problem.limited)} models; "
        f"loosen {' or '.join(f'--{name}' for name in problem.specs.limits)}, or narrow the models with a better log"
    )


def _best_gain(problem: Problem, tn: float, tv: float) -> tuple[float, PidDesign] | None:
    """Return cost and design of the best feasible gain for one TN and TV."""
    designs = [problem.design(top, tn, tv) for top in largest_gain(problem, tn, tv)]
    # just below the limit the response may ring: a smaller gain can have the smaller cost
    designs += [replace(d, gain_pct_per_degC=0.85 * d.gain_pct_per_degC) for d in designs[-1:]]
    priced = [(problem.cost(design), design) for design in designs]
    return min(priced, key=lambda pair: pair[0], default=None)


def _zoom(grid: Array, centre: float) -> Array:
    if len(grid) == 1:
        return grid
    ratio = (grid[1] / grid[0]) ** 0.9
    return np.geomspace(centre / ratio, centre * ratio, 5)


def _excluded(h: Complex, c: Complex, specs: Specs) -> Array:
    """Return the intervals of K > 0 that some frequency excludes, shape (m, 2).

    Each limit is α·K² + 2·β·K + γ ≥ 0 with γ > 0.
    """
    size, real = np.abs(h) ** 2, h.real
    quadratics = [(size, 1.0 - 1.0 / specs.ms**2)]  # |1 + K·h|² ≥ 1/Ms²
    if math.isfinite(specs.mt):
        quadratics.append(((1.0 - 1.0 / specs.mt**2) * size, 1.0))  # |1 + K·h|² ≥ |K·h|²/Mt²
    if math.isfinite(specs.mks):
        quadratics.append((size - np.abs(c) ** 2 / specs.mks**2, 1.0))  # |1 + K·h|² ≥ |K·c|²/Mks²
    found = []
    for alpha, gamma in quadratics:
        square = real**2 - alpha * gamma
        root = np.sqrt(np.maximum(square, 0.0)) - real
        hit = (square > 0.0) & ((real < 0.0) | (alpha < 0.0)) & (root > 0.0)
        high = np.full(len(root), math.inf)
        np.divide(root, alpha, out=high, where=alpha > 0.0)
        found.append(np.column_stack([gamma / root[hit], high[hit]]))
    return np.concatenate(found)


def _tops(excluded: Array) -> list[float]:
    """Return the upper ends of the gaps between the excluded intervals (m, 2), ascending."""
    low, high = excluded[np.argsort(excluded[:, 0])].T
    reached = np.maximum.accumulate(np.append(0.0, high))[:-1]
    return [float(top) for top in low[(low > reached) & np.isfinite(low)]]


def _keeps(problem: Problem, gain: float, tn: float, tv: float) -> bool:
    design = problem.design(gain, tn, tv)
    for plant in problem.limited:
        ms, mt = sensitivity_peaks(plant, design)
        if ms > problem.ms * _TOLERANCE or mt > problem.mt * _TOLERANCE:
            return False
        if math.isfinite(problem.mks) and noise_gain(plant, design) > problem.mks * _TOLERANCE:
            return False
    return True
