"""Two time scales from a log with power: a fast element next to a slow mass, as two lags in parallel.

For given lags and dead time the temperature is linear in the gains of both, the ambient and the initial states, so
only lags and dead time are searched. The heater is taken only where it explains the log better than every other one,
leaves nothing but noise, and where its slow lag and its rise after a step are known.

Ends of the 95 % intervals are plausible heaters: of the dead time, of the rise after a step (fast gain per fast lag),
of the fast lag and of the slow one; the other parameters follow as in the fit's normal equations, whose noise is that
of first-order autoregressive residuals.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.errors import OutOfRange
from heatertune.log.log_values import ABSOLUTE_ZERO_DEGC
from heatertune.model.least_squares import minimise
from heatertune.model.power.loss_fit import LossEnd, leaves_noise
from heatertune.model.power.open_loop import PowerProblem
from heatertune.model.power.regressors import AMBIENT, FIRST_STATE, GAIN
from heatertune.model.statistics import ar1_bic, autocorrelation, student_t
from heatertune.model.two_scales import TwoScale

__all__ = ["TwoScaleFit", "fit_two_scales"]

#: ln slow lag, ln fast lag, dead time, gain of the slow lag, gain of the fast one
_SLOW, _FAST, _DEAD, _SLOW_GAIN, _FAST_GAIN = range(5)
_SEARCHED: Final = 3
_COARSE: Final = 250  # averaged readings in the search
_GRID: Final = (8, 8, 5)  # slow lags, fast lags, dead times
_STARTS: Final = 4
_NEAR: Final = 10.0  # BIC points
_APART: Final = 4.0  # the slow lag by the fast one, at least: two lags or one serve where it is less
_LEAST_SHARE: Final = 0.02  # of the gain, that each lag has
_OWN: Final = 0.5  # of the rise; less may be a neighbour's
_NOISE: Final = 1.3  # times the noise between neighbours, that the fit may leave, as of a loss curve
_NOISE_FAR: Final = 2.0  # the same where the lags are far apart: a sensor's own lag, which is not fitted, is seen there
_FAR: Final = 10.0  # the slow lag by the fast one
_SLOW_KNOWN: Final = 0.7  # half the interval of ln slow lag, at most
_RISE_KNOWN: Final = 0.4  # likewise of ln of the rise after a step


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TwoScaleFit:
    """The best heater of two time scales.

    Attributes:
        heaters: the fit, and the ends of its intervals.
        simulated_degC: shape (n,).
        bic: Bayesian information criterion.
        problem: that was solved.
    """

    heaters: tuple[LossEnd, ...]
    simulated_degC: Array
    bic: float
    problem: PowerProblem

    law = "power logged, two time scales"
    method = "exact simulation with the logged power of two lags and a zero"

    @property
    def model(self) -> TwoScale:
        """The heater."""
        model = self.heaters[0].model
        assert isinstance(model, TwoScale)
        return model

    @property
    def own_share(self) -> float:
        """Share of the rise that comes with the fast lag."""
        fast, slow = self.model.second_time_constant_s, self.model.time_constant_s
        return (self.model.fast_share * slow - fast) / (slow - fast)

    @property
    def is_mostly_shared(self) -> bool:
        """Whether most of the rise is that of the slow mass, as of zones that exchange much heat.

        A log of one zone shows no difference. Three equal zones with 1.2 °C/% that exchange four times what each loses
        pass one by one with Ms 1.6, and swing together.
        """
        return self.own_share < _OWN

    @property
    def sentence(self) -> str:
        """What was found."""
        model, share = self.model, self.own_share
        fast, slow = model.second_time_constant_s, model.time_constant_s
        return (f"The heater has two time scales: {100.0 * share:.0f} % of its rise come within {fast:.3g} s, the rest "
                f"within {slow:.3g} s (two lags and a zero); the gain is {model.gain_degC_per_pct:.3g} °C/%. One lag "
                "next to them has the same gain and rises alike shortly after a step.")


class _LagSolution(NamedTuple):
    vector: Array
    weights: Array
    simulated_degC: Array


def fit_two_scales(problem: PowerProblem, better_than: float) -> list[TwoScaleFit]:
    """Return the heater of two time scales, in a list, or an empty one where the log does not ask for it.

    Args:
        problem: of one lag, without drift and loads.
        better_than: BIC of the best heater of any other kind.
    """
    if len(problem.readings.restart_s) or problem.drift or problem.loads_s:
        return []
    plain = replace(problem, two_lags=False)
    solution = _solve(plain)
    record = plain.readings.temperature_degC
    unknowns = _SEARCHED + len(solution.weights)
    bic = ar1_bic(record - solution.simulated_degC, unknowns)
    whole = np.concatenate([solution.vector, solution.weights[:2]])
    model = _heater(whole, _ambient(plain, solution.weights))
    if model is None or not bic < better_than - _NEAR or not _is_inside(plain, solution):
        return []
    ends = tuple(_ends(plain, solution, _covariance(plain, solution)))
    return [TwoScaleFit(heaters=(LossEnd(model, ""), *ends), simulated_degC=solution.simulated_degC, bic=bic,
                        problem=plain)] if ends else []


def _bounds(problem: PowerProblem) -> tuple[Array, Array]:
    low = np.array([problem.low[0] + math.log(_APART), problem.low[0], problem.low[1]])
    high = np.array([problem.high[0], problem.high[0] - math.log(_APART), problem.high[1]])
    return low, high


def _is_inside(problem: PowerProblem, solution: _LagSolution) -> bool:
    """Return whether a fit leaves little more than noise, its slow lag not at its end and the lags far apart."""
    vector, (_, high) = solution.vector, _bounds(problem)
    noise = _NOISE_FAR if vector[_SLOW] - vector[_FAST] > math.log(_FAR) else _NOISE
    on_bound = vector[_SLOW] >= high[_SLOW] - 1e-2 or vector[_SLOW] - vector[_FAST] <= math.log(_APART)
    return not on_bound and leaves_noise(problem.readings, solution.simulated_degC, noise)


def _solve(problem: PowerProblem) -> _LagSolution:
    """Return the least squares over a grid, refined on averaged readings and then on all."""
    low, high = _bounds(problem)
    coarse = problem.average(_COARSE)
    axes = [np.linspace(low[place], high[place], count) for place, count in ((_SLOW, _GRID[0]), (_FAST, _GRID[1]))]
    late = low[_DEAD] + np.linspace(0.0, 1.0, _GRID[2]) ** 3 * (high[_DEAD] - low[_DEAD])
    grid = np.array([(slow, fast, dead) for slow in axes[0] for fast in axes[1] for dead in late
                     if slow - fast > math.log(_APART)])
    starts, count = grid[np.argsort([float(np.sum(_left(coarse, z) ** 2)) for z in grid])], _STARTS
    vectors = starts[:count]
    for thin, iterations in ((coarse, 30), (problem, 12)):
        def residuals(z: Array, _: npt.NDArray[np.intp], thin: PowerProblem = thin) -> Array:
            return np.array([_left(thin, row) for row in z])

        minima = minimise(residuals, vectors, low, high, iterations=iterations)
        vectors = minima.parameters[np.argsort(minima.cost)[:1]]
    columns, given = _columns(problem, vectors[0])
    weights = _weights(columns, problem.readings.temperature_degC - given)
    return _LagSolution(vectors[0], weights, given + weights @ columns)


def _columns(problem: PowerProblem, z: Array) -> tuple[Array, Array]:
    """Return the columns of the linear part, both gains first, and what is given without them, shape (n,) [°C]."""
    slow, fast = (problem.basis(np.array([z[place], z[_DEAD], 0.0])) for place in (_SLOW, _FAST))
    fixed = problem.fixed
    free = [slow[AMBIENT]] if math.isnan(fixed[AMBIENT]) else []
    if math.isnan(fixed[FIRST_STATE]):
        free += [slow[FIRST_STATE], fast[FIRST_STATE]]
    given = np.zeros(len(slow[AMBIENT])) if math.isnan(fixed[AMBIENT]) else fixed[AMBIENT] * slow[AMBIENT]
    return np.array([slow[GAIN], fast[GAIN], *free]), given


def _weights(columns: Array, record: Array) -> Array:
    return np.asarray(np.linalg.lstsq(columns.T, record, rcond=None)[0])


def _left(problem: PowerProblem, z: Array) -> Array:
    """Return the residuals of lags and dead time, shape (n,) [°C]."""
    columns, given = _columns(problem, z)
    record = problem.readings.temperature_degC
    return np.asarray(given + _weights(columns, record - given) @ columns - record)


def _ambient(problem: PowerProblem, weights: Array) -> float | None:
    ambient = float(weights[2]) if math.isnan(problem.fixed[AMBIENT]) else float(problem.fixed[AMBIENT])
    return ambient if ambient >= ABSOLUTE_ZERO_DEGC else None


def _heater(z: Array, ambient_degC: float | None) -> TwoScale | None:
    """Return the heater of lags, dead time and gains, shape (5,); None if a gain is too small or it is none."""
    slow, fast = math.exp(z[_SLOW]), math.exp(z[_FAST])
    gain = float(z[_SLOW_GAIN] + z[_FAST_GAIN])
    if min(z[_SLOW_GAIN], z[_FAST_GAIN]) <= _LEAST_SHARE * abs(gain):
        return None
    share = float(z[_FAST_GAIN]) / gain
    try:
        return TwoScale(gain_degC_per_pct=gain, time_constant_s=slow, second_time_constant_s=fast,
                        dead_time_s=max(float(z[_DEAD]), 0.0), ambient_degC=ambient_degC,
                        fast_share=share + (1.0 - share) * fast / slow)
    except OutOfRange:
        return None


def _covariance(problem: PowerProblem, solution: _LagSolution) -> Array | None:
    """Return the covariance of lags, dead time, gains and the rest of the linear part; None if it is singular."""
    z, weights = solution.vector, solution.weights
    low, high = _bounds(problem)
    columns, _ = _columns(problem, z)
    rows = []
    for place in range(_SEARCHED):
        step = 1e-4 * float(high[place] - low[place])
        ends = []
        for sign in (1.0, -1.0):
            moved = z.copy()
            moved[place] += sign * step
            ends.append(weights @ _columns(problem, moved)[0])
        rows.append((ends[0] - ends[1]) / (2.0 * step))
    slopes = np.array([*rows, *columns])
    left = problem.readings.temperature_degC - solution.simulated_degC
    rho = float(np.clip(autocorrelation(left, 1)[0], 0.0, 0.98))
    variance = float(left @ left) / max(len(left) - len(slopes), 1) * (1.0 + rho) / (1.0 - rho)
    scale = np.sqrt(np.sum(slopes**2, axis=1))
    if not np.all(scale > 0.0) or not np.all(np.isfinite(slopes)):
        return None
    normal = (slopes / scale[:, None]) @ (slopes / scale[:, None]).T
    if np.linalg.cond(normal) > 1e12:
        return None
    return np.asarray(variance * np.linalg.inv(normal) / np.outer(scale, scale))


def _ends(problem: PowerProblem, solution: _LagSolution, covariance: Array | None) -> Iterator[LossEnd]:
    """Yield the heaters at the ends of intervals; none if slow lag or rise are not known."""
    if covariance is None:
        return
    whole = np.concatenate([solution.vector, solution.weights])
    reach = student_t(max(len(solution.simulated_degC) - len(whole), 2))
    unit = np.eye(len(whole))
    rise = unit[_FAST_GAIN] / whole[_FAST_GAIN] - unit[_FAST]
    named = {"dead time": unit[_DEAD], "rise after a step": rise, "fast lag": unit[_FAST], "slow lag": unit[_SLOW]}
    deviations = {name: math.sqrt(max(float(way @ covariance @ way), 0.0)) for name, way in named.items()}
    if not (reach * deviations["slow lag"] < _SLOW_KNOWN and reach * deviations["rise after a step"] < _RISE_KNOWN):
        return
    low, high = _bounds(problem)
    for name, way in named.items():
        for sign, end in ((-1.0, "low"), (1.0, "high")):
            moved = whole + sign * reach * (covariance @ way) / max(deviations[name], 1e-300)
            moved[:_SEARCHED] = np.clip(moved[:_SEARCHED], low, high)
            model = _heater(moved[:5], _ambient(problem, moved[_SEARCHED:]))
            if model is not None:
                yield LossEnd(model, f"{name} at its {end} end")
