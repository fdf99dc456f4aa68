"""Two time scales from logs with power: a fast element next to a slow mass, as two lags in parallel.

For given lags and dead time the temperature is linear in the gains of both, the ambient and the initial states, so
only lags and dead time are searched. Several logs share lags, dead time and gains; each has its own ambient and initial
states, and is weighted by its noise. The heater is taken only where it explains the logs better than every other one,
leaves nothing but noise in each, and where its slow lag and its rise after a step are known.

Ends of the 95 % intervals are plausible heaters: of the dead time, of the rise after a step (fast gain per fast lag),
of the fast lag and of the slow one; the other parameters follow as in the fit's normal equations, whose noise is that
of first-order autoregressive residuals.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
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
_NOISE: Final = 1.3  # times the noise between neighbours, that the fit may leave, as of a loss curve
_NOISE_FAR: Final = 2.0  # the same where the lags are far apart: a sensor's own lag, which is not fitted, is seen there
_FAR: Final = 10.0  # the slow lag by the fast one
_OF_RISE: Final = 0.015  # of the fast rise between the logged powers, that a sensor's lag may leave there instead
_SLOW_KNOWN: Final = 0.7  # half the interval of ln slow lag, at most
_RISE_KNOWN: Final = 0.4  # likewise of ln of the rise after a step


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TwoScaleFit:
    """The best heater of two time scales.

    Attributes:
        heaters: the fit, and the ends of its intervals.
        simulations_degC: of each log, shape (n,).
        bic: Bayesian information criterion.
        problems: that were solved, one for each log.
    """

    heaters: tuple[LossEnd, ...]
    simulations_degC: tuple[Array, ...]
    bic: float
    problems: tuple[PowerProblem, ...]

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
    simulations_degC: tuple[Array, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Logs:
    """Logs of one heater; m readings in all.

    Attributes:
        parts: one problem for each log.
        noise_degC: of each log; what is solved is divided by it.
    """

    parts: tuple[PowerProblem, ...]
    noise_degC: tuple[float, ...]

    def average(self, most: int) -> _Logs:
        """Return the logs with each one's readings averaged to about `most`."""
        parts = tuple(part.average(most) for part in self.parts)
        return _Logs(parts=parts, noise_degC=tuple(
            noise * math.sqrt(len(thin.readings.time_s) / len(part.readings.time_s))
            for noise, thin, part in zip(self.noise_degC, parts, self.parts, strict=True)))

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Least and largest vectors of the search, shape (3,)."""
        low = np.min([part.low for part in self.parts], axis=0)
        high = np.max([part.high for part in self.parts], axis=0)
        apart = math.log(_APART)
        return np.array([low[0] + apart, low[0], low[1]]), np.array([high[0], high[0] - apart, high[1]])

    def linear(self, z: Array) -> tuple[Array, Array]:
        """Return the columns of the linear part, both gains first, shape (k, m), and what they explain, shape (m,)."""
        each = [_columns(part, z) for part in self.parts]
        free = [len(columns) - 2 for columns, _ in each]
        gains, own, explained = [], [], []
        for place, (part, noise, (columns, offset)) in enumerate(zip(self.parts, self.noise_degC, each, strict=True)):
            gains.append(columns[:2] / noise)
            own.append(np.pad(columns[2:] / noise, ((sum(free[:place]), sum(free[place + 1 :])), (0, 0))))
            explained.append((part.readings.temperature_degC - offset) / noise)
        return np.vstack([np.hstack(gains), np.hstack(own)]), np.concatenate(explained)

    def left(self, z: Array) -> Array:
        """Return the residuals of lags and dead time, shape (m,)."""
        columns, explained = self.linear(z)
        return np.asarray(_weights(columns, explained) @ columns - explained)

    def split(self, stacked: Array) -> list[Array]:
        """Return the part of each log, along the last axis."""
        ends = np.cumsum([len(part.readings.time_s) for part in self.parts])
        return np.split(stacked, ends[:-1], axis=-1)

    def simulated(self, left: Array) -> tuple[Array, ...]:
        """Return the simulation of each log with these residuals (m,) [°C]."""
        return tuple(part.readings.temperature_degC + noise * own for part, noise, own in zip(
            self.parts, self.noise_degC, self.split(left), strict=True))


def fit_two_scales(
    problems: Sequence[PowerProblem], better_than: float, noise_degC: Sequence[float] = (1.0,)
) -> list[TwoScaleFit]:
    """Return the heater of two time scales, in a list, or an empty one where the logs do not ask for it.

    Args:
        problems: of one lag, without drift and loads, one for each log.
        better_than: BIC of the best heater of any other kind.
        noise_degC: of each log [°C].
    """
    if not all(map(_is_plain, problems)):
        return []
    logs = _Logs(parts=tuple(replace(problem, two_lags=False) for problem in problems), noise_degC=tuple(noise_degC))
    solution = _solve(logs)
    bic = _bic(logs, solution)
    whole = np.concatenate([solution.vector, solution.weights[:2]])
    model = _heater(whole, _ambient(logs.parts[0], solution.weights))
    if model is None or not bic < better_than - _NEAR or not _is_inside(logs, solution):
        return []
    ends = tuple(_ends(logs, solution, _covariance(logs, solution)))
    return [TwoScaleFit(heaters=(LossEnd(model, ""), *ends), simulations_degC=solution.simulations_degC, bic=bic,
                        problems=logs.parts)] if ends else []


def _is_plain(problem: PowerProblem) -> bool:
    return not (len(problem.readings.restart_s) or problem.drift or problem.loads_s)


def _bic(logs: _Logs, solution: _LagSolution) -> float:
    """Return the criterion over all logs; what they share counts once."""
    shared = _SEARCHED + 2
    own = sum(ar1_bic(part.readings.temperature_degC - simulated, len(_columns(part, solution.vector)[0]) - 2)
              for part, simulated in zip(logs.parts, solution.simulations_degC, strict=True))
    return own + shared * math.log(sum(len(part.readings.time_s) for part in logs.parts))


def _is_inside(logs: _Logs, solution: _LagSolution) -> bool:
    """Return whether a fit leaves little but noise in each log, its slow lag not at its end and the lags far apart."""
    vector, (_, high) = solution.vector, logs.bounds
    if vector[_SLOW] >= high[_SLOW] - 1e-2 or vector[_SLOW] - vector[_FAST] <= math.log(_APART):
        return False
    return all(_leaves_little(part, solution, simulated)
               for part, simulated in zip(logs.parts, solution.simulations_degC, strict=True))


def _leaves_little(problem: PowerProblem, solution: _LagSolution, simulated_degC: Array) -> bool:
    vector, readings = solution.vector, problem.readings
    if vector[_SLOW] - vector[_FAST] <= math.log(_FAR):
        return leaves_noise(readings, simulated_degC, _NOISE)
    left = float(np.sqrt(np.mean((readings.temperature_degC - simulated_degC) ** 2)))
    return (leaves_noise(readings, simulated_degC, _NOISE_FAR)
            or left < _OF_RISE * float(solution.weights[1]) * float(np.ptp(readings.level_pct)))


def _solve(logs: _Logs) -> _LagSolution:
    """Return the least squares over a grid, refined on averaged readings and then on all."""
    low, high = logs.bounds
    coarse = logs.average(_COARSE)
    axes = [np.linspace(low[place], high[place], count) for place, count in ((_SLOW, _GRID[0]), (_FAST, _GRID[1]))]
    late = low[_DEAD] + np.linspace(0.0, 1.0, _GRID[2]) ** 3 * (high[_DEAD] - low[_DEAD])
    grid = np.array([(slow, fast, dead) for slow in axes[0] for fast in axes[1] for dead in late
                     if slow - fast > math.log(_APART)])
    vectors = grid[np.argsort([float(np.sum(coarse.left(z) ** 2)) for z in grid])][:_STARTS]
    for thin, iterations in ((coarse, 30), (logs, 12)):
        def residuals(z: Array, _: npt.NDArray[np.intp], thin: _Logs = thin) -> Array:
            return np.array([thin.left(row) for row in z])

        minima = minimise(residuals, vectors, low, high, iterations=iterations)
        vectors = minima.parameters[np.argsort(minima.cost)[:1]]
    weights = _weights(*logs.linear(vectors[0]))
    return _LagSolution(vectors[0], weights, logs.simulated(logs.left(vectors[0])))


def _columns(problem: PowerProblem, z: Array) -> tuple[Array, Array]:
    """Return the columns of the linear part, both gains first, and what is given without them, shape (n,) [°C]."""
    slow, fast = (problem.basis(np.array([z[place], z[_DEAD], 0.0])) for place in (_SLOW, _FAST))
    fixed = problem.fixed
    free = [slow[AMBIENT]] if math.isnan(fixed[AMBIENT]) else []
    if math.isnan(fixed[FIRST_STATE]):
        free += [slow[FIRST_STATE], fast[FIRST_STATE]]
    offset_degC = np.zeros(len(slow[AMBIENT])) if math.isnan(fixed[AMBIENT]) else fixed[AMBIENT] * slow[AMBIENT]
    return np.array([slow[GAIN], fast[GAIN], *free]), offset_degC


def _weights(columns: Array, record: Array) -> Array:
    return np.asarray(np.linalg.lstsq(columns.T, record, rcond=None)[0])


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


def _covariance(logs: _Logs, solution: _LagSolution) -> Array | None:
    """Return the covariance of lags, dead time, gains and the rest of the linear part; None if it is singular."""
    z, weights = solution.vector, solution.weights
    low, high = logs.bounds
    columns, _ = logs.linear(z)
    rows = []
    for place in range(_SEARCHED):
        step = 1e-4 * float(high[place] - low[place])
        ends = []
        for sign in (1.0, -1.0):
            moved = z.copy()
            moved[place] += sign * step
            ends.append(weights @ logs.linear(moved)[0])
        rows.append((ends[0] - ends[1]) / (2.0 * step))
    slopes = np.array([*rows, *columns])
    parts = []
    for slope, left in zip(logs.split(slopes), logs.split(logs.left(z)), strict=True):
        rho = float(np.clip(autocorrelation(left, 1)[0], 0.0, 0.98))
        freedom = max(len(left) - int(np.count_nonzero(np.any(slope != 0.0, axis=1))), 1)
        parts.append(slope / math.sqrt(float(left @ left) / freedom * (1.0 + rho) / (1.0 - rho)))
    slopes = np.hstack(parts)
    scale = np.sqrt(np.sum(slopes**2, axis=1))
    if not np.all(scale > 0.0) or not np.all(np.isfinite(slopes)):
        return None
    normal = (slopes / scale[:, None]) @ (slopes / scale[:, None]).T
    if np.linalg.cond(normal) > 1e12:
        return None
    return np.asarray(np.linalg.inv(normal) / np.outer(scale, scale))


def _ends(logs: _Logs, solution: _LagSolution, covariance: Array | None) -> Iterator[LossEnd]:
    """Yield the heaters at the ends of intervals; none if slow lag or rise are not known."""
    if covariance is None:
        return
    whole = np.concatenate([solution.vector, solution.weights])
    reach = student_t(max(sum(map(len, solution.simulations_degC)) - len(whole), 2))
    unit = np.eye(len(whole))
    rise = unit[_FAST_GAIN] / whole[_FAST_GAIN] - unit[_FAST]
    directions = {"dead time": unit[_DEAD], "rise after a step": rise, "fast lag": unit[_FAST], "slow lag": unit[_SLOW]}
    deviations = {name: math.sqrt(max(float(way @ covariance @ way), 0.0)) for name, way in directions.items()}
    if not (reach * deviations["slow lag"] < _SLOW_KNOWN and reach * deviations["rise after a step"] < _RISE_KNOWN):
        return
    low, high = logs.bounds
    for name, way in directions.items():
        for sign, end in ((-1.0, "low"), (1.0, "high")):
            moved = whole + sign * reach * (covariance @ way) / max(deviations[name], 1e-300)
            moved[:_SEARCHED] = np.clip(moved[:_SEARCHED], low, high)
            model = _heater(moved[:5], _ambient(logs.parts[0], moved[_SEARCHED:]))
            if model is not None:
                yield LossEnd(model, f"{name} at its {end} end")
