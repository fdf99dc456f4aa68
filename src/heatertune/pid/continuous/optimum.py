"""The constrained optimum of the continuous loop: PI or PID in the ideal form, exact dead time, no Padé.

For each TN and TV the feasible gains are known exactly (`continuous.pieces`), which leaves a search in one or two
unknowns: a coarse grid, a local search, the same again on finer frequencies. A fine grid over all of the reduced
problem then looks for a better answer elsewhere; that is evidence as fine as the grid, not a proof.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from heatertune.compiled import compile_function
from heatertune.errors import InputError
from heatertune.model.values import HeaterModel
from heatertune.pid.continuous import descent
from heatertune.pid.continuous import kernel as continuous
from heatertune.pid.continuous.descent import Task
from heatertune.pid.continuous.kernel import Four, Space
from heatertune.pid.loop.robustness import crossings
from heatertune.pid.specs import Specs, is_boundless, refuse_boundless
from heatertune.pid.values import Margins, PidDesign, structure_of

__all__ = ["ContinuousProblem", "global_check", "global_optimum", "iae", "margins", "optimum", "peaks", "response_grid"]

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
Point = Four  # cost, K, TN, TV

_COARSE, _FINE, _EXACT = 1.0, 2.0, 8.0  # density of frequencies
_SCANNED, _CHECKED = (14, 8), (60, 40)  # points of TN and TV: of the first search, of the global check
_WORTH = 3e-4  # share of the cost by which a point has to be better to refute the optimum
_MOST_FREQUENCIES = 200_000
_KEPT = 8  # grids of frequencies; one rarely takes more than 100 kB
_STEPS = 2.0  # factor of the time steps with which a cost is reported; the search takes a quarter of them


@dataclass(frozen=True, slots=True, kw_only=True)
class ContinuousProblem:
    """Minimise the mean cost over the heaters subject to the limits on each.

    Attributes:
        plants: the heaters to serve.
        structure: "p", "pi" or "pid".
        specs: objective and limits.
        guards: heaters on which the limits hold too, but which cost nothing.

    Raises:
        OutOfRange, InputError: limits that contradict each other or the structure; an objective that only sampled
            loops have; a heater without dead time, whose gain Ms does not limit.
    """

    plants: tuple[HeaterModel, ...]
    structure: str
    specs: Specs
    guards: tuple[HeaterModel, ...] = ()

    @property
    def limited(self) -> tuple[HeaterModel, ...]:
        """Every heater on which the limits hold."""
        return self.plants + self.guards

    def __post_init__(self) -> None:
        self.specs.refuse_contradictions(self.limited, self.structure)
        if self.specs.objective == "ise":
            raise InputError("the objective ise is for sampled loops; with --sample-time 0: load, setpoint, itae or ki")
        refuse_boundless(self.limited, self.structure, self.specs.mks)

    @property
    def heaters(self) -> Array:
        """Gain [°C/%], larger and smaller lag (0: none), dead time [s] of each model, shape (p, 4)."""
        return np.array([_row(plant) for plant in self.plants])

    @property
    def weights(self) -> Array:
        """Weights of load IAE, setpoint IAE, load ITAE and TN/K in the cost, shape (p, 4)."""
        gains = self.heaters[:, 0]
        one, none = np.ones_like(gains), np.zeros_like(gains)
        share = self.specs.weight
        if share is not None:
            rows = [(1.0 - share) / gains, share * one, none, none]
        else:
            which = {"load": 0, "iae": 0, "setpoint": 1, "itae": 2, "ki": 3}[self.specs.objective]
            rows = [one if i == which else none for i in range(4)]
        return np.column_stack(rows) / len(gains)

    @property
    def limits(self) -> Four:
        """Ms, Mt, Mks and the shortest TV [s]."""
        return self.specs.ms, self.specs.mt, self.specs.mks, self.quickest_s / 50.0

    @property
    def quickest_s(self) -> float:
        """The shortest time that a loop can have to do with, but no less than the slow part shows [s]."""
        slow = max(sum(p.lags_s) + p.dead_time_s for p in self.plants)
        paces = [_pace(plant, self.structure, self.specs.mks) for plant in self.plants]
        return max(min(pace for pace in paces if pace > 0.0), 1e-4 * slow)

    def cost(self, design: PidDesign) -> float:
        """Return the cost of a feasible design, in the unit of its objective; a P controller's is −K."""
        if not math.isfinite(design.integral_time_s):
            return -design.gain_pct_per_degC
        return _price(self.heaters, self.weights, design, _STEPS)


def iae(plant: HeaterModel, design: PidDesign) -> tuple[float, float]:
    """Return ∫|e| dt after a load step of 1 % [°C·s] and after a setpoint step of 1 °C [s]; the loop is stable."""
    upright = replace(design, gain_pct_per_degC=abs(design.gain_pct_per_degC))  # a cooler's answer, mirrored
    row = np.abs([_row(plant)])
    load, setpoint = (
        _price(row, weights, upright, _STEPS)
        for weights in np.eye(4)[:2, None]
    )
    return load, setpoint


@lru_cache(maxsize=_KEPT)
def response_grid(plants: tuple[HeaterModel, ...], derivative: bool, density: float) -> tuple[Array, Complex]:
    """Return frequencies [rad/s] for each model, one model after the other, and G(jω) [°C/%] there; read-only.

    Logarithmic up to the inverse of the dead time, then even, so that every turn of e^(−jωL) is seen, up to where the
    lags have made the loop too small to come near −1.

    Args:
        plants: the models.
        derivative: whether the controller has a derivative part.
        density: 1 for some 300 frequencies.

    Returns:
        Frequencies and answers, each of shape (n,).
    """
    grids = [_frequencies(plant, derivative, density) for plant in plants]
    responses = [plant.frequency_response(omega) for plant, omega in zip(plants, grids, strict=True)]
    grid = np.concatenate(grids), np.concatenate(responses)
    for column in grid:
        column.flags.writeable = False
    return grid


def _frequencies(plant: HeaterModel, derivative: bool, density: float) -> Array:
    dead, slow = plant.dead_time_s, sum(plant.lags_s) + plant.dead_time_s
    low = 0.02 / slow
    high = 1e6 / min(plant.lags_s) if dead == 0.0 else max(1.5 / dead, 2.0 * low)
    omega = _even(low, high, int(40.0 * density * math.log10(high / low)) + 2)
    if dead == 0.0:
        return omega
    turns = max(60.0, 25.0 * dead / plant.lags_s[0]) if derivative else max(25.0, 3.0 * dead / plant.lags_s[0])
    near = np.arange(1.5 + 0.2 / density, 12.0, 0.2 / density)
    far = np.arange(12.0, turns, max(0.4 / density, turns / _MOST_FREQUENCIES))
    if not derivative:
        return np.unique(np.concatenate([omega, near / dead, far / dead]))
    # |C·S| may have its peak where the filter's gain is all there and the loop is small: a few whole turns far out
    rest = 2.0 * math.pi * _even(turns / 6.0, 5.0 * turns, 10)[:, None] + np.arange(0.0, 6.5, 0.4 / density)
    return np.unique(np.concatenate([omega, near / dead, far / dead, rest.ravel() / dead]))


def optimum(problem: ContinuousProblem) -> PidDesign:
    """Return the best design; its limits are exact.

    Raises:
        InputError: no gain keeps the limits on all models.
    """
    if problem.structure == "p":
        return _p_design(problem)
    return _descend(problem, _scanned(problem, *_SCANNED, math.inf, _COARSE))


def global_optimum(problem: ContinuousProblem) -> tuple[PidDesign, str]:
    """Return the optimum after the global check, and a sentence about the check; errors as `optimum`."""
    design = optimum(problem)
    if problem.structure == "p":
        return design, "The gain is the largest of all feasible ones: nothing was searched."
    better = global_check(problem, design)
    moved = design if better is None else _descend(problem, better)
    if problem.cost(moved) < problem.cost(design) * (1.0 - _WORTH):
        sentence = "The optimum was found by the global check; the first search had ended at another one."
        return _sharpened(problem, moved), sentence
    return _sharpened(problem, design), (
        f"No point of a grid of {_points(problem)} over the reduced problem, each with its best K, costs less: "
        "as far as this grid sees, the optimum is global."
    )


def global_check(problem: ContinuousProblem, design: PidDesign) -> Point | None:
    """Return the point of a fine grid over TN and TV, each with its best K, that beats the design; None: there is none.

    Points whose lower bound is above the design's cost are excluded without a simulation, so the grid is cheap.
    """
    cost = _price(problem.heaters, problem.weights, design, _STEPS / 4.0)
    rival = _scanned(problem, *_checked(problem), cost * (1.0 - _WORTH), _FINE)
    return rival if rival[1] > 0.0 else None


def peaks(omega: Array, plant: Complex, gain: float, tn: float, tv: float) -> tuple[Complex, float, float, float]:
    """Return L(jω), Ms, Mt and Mks [%/°C] at frequencies [rad/s] where the plant is known; infinite where unstable.

    Args:
        omega: ascending, shape (n,) [rad/s].
        plant: G(jω) there of any stable plant, shape (n,) [°C/%]; L(jω) has the same shape.
        gain: K of the ideal form [%/°C].
        tn: TN [s].
        tv: TV [s], 0 without a derivative part.
    """
    control = gain * continuous.controller(omega, tn, tv)
    loop = plant * control
    if compile_function(continuous.encirclements)(omega, loop, 1.0) != 0:
        return loop, math.inf, math.inf, math.inf
    size = np.append(1.0 / np.abs(1.0 + loop), 1.0)  # far out S is 1
    highest = abs(gain) * (1.0 + continuous.DERIVATIVE_FILTER_N if tv > 0.0 else 1.0)  # |C·S| at infinite frequency
    noise = max(highest, float(np.max(np.abs(control) * size[:-1])))
    return loop, float(np.max(size)), float(np.max(np.abs(loop) * size[:-1])), noise


def margins(plants: tuple[HeaterModel, ...], design: PidDesign) -> tuple[Margins, float]:
    """Return the worst margins of the continuous loop over the models, and the worst Mks [%/°C]."""
    rows = []
    for plant in plants:
        omega, response = response_grid((plant,), design.derivative_time_s > 0.0, _EXACT)
        settings = _settings(design)
        loop, ms, mt, mks = peaks(omega, response, *settings)
        if math.isfinite(design.integral_time_s):  # at frequency 0, which no grid reaches
            mt, mks = max(mt, 1.0), max(mks, 1.0 / abs(plant.gain_degC_per_pct))
        gain, phase = crossings(loop, sampled=False)
        rows.append((ms, mt, mks, gain, phase))
    ms, mt, mks = (max(row[i] for row in rows) for i in range(3))
    gain, phase = (min(row[i] for row in rows) for i in (3, 4))
    return Margins(ms=ms, mt=mt, gain_margin=gain, phase_margin_deg=phase), mks


def _pace(plant: HeaterModel, structure: str, mks: float) -> float:
    """Return dead time and second lag together; where these leave the gain without bound, the time Mks leaves [s]."""
    delays = plant.dead_time_s + sum(plant.lags_s[1:])
    if not is_boundless(plant, structure):
        return delays
    alone = plant.lags_s[0] / (plant.gain_degC_per_pct * mks)  # k·Mks/(T·s), the loop where C is largest, is 1 there
    return alone if alone >= delays else math.sqrt(alone * delays)


def _row(plant: HeaterModel) -> tuple[float, ...]:
    return plant.gain_degC_per_pct, *(*plant.lags_s, 0.0)[:2], plant.dead_time_s


def _settings(design: PidDesign) -> tuple[float, float, float]:
    return design.gain_pct_per_degC, design.integral_time_s, design.derivative_time_s


def _points(problem: ContinuousProblem) -> int:
    tns, tvs = _axes(problem, *_checked(problem))
    return len(tns) * len(tvs)


def _checked(problem: ContinuousProblem) -> tuple[int, int]:
    return _CHECKED if problem.structure == "pid" else (400, 1)


def _axes(problem: ContinuousProblem, many_tn: int, many_tv: int) -> tuple[Array, Array]:
    """Return the grid of TN and TV, each from its middle outwards: a good point early excludes bad ones by a bound."""
    slow = max(sum(p.lags_s) + p.dead_time_s for p in problem.plants)
    least = problem.quickest_s
    longest = max(least, *(p.dead_time_s + sum(p.lags_s[1:]) for p in problem.plants))
    tns = _outwards(0.2 * least, 3.0 * slow, many_tn)
    tvs = _outwards(least / 50.0, 1.3 * longest, many_tv) if problem.structure == "pid" else np.zeros(1)
    return tns, tvs


def _even(low: float, high: float, many: int) -> Array:
    """Return `numpy.geomspace`, in a fifth of its time."""
    return np.asarray(np.exp(np.linspace(math.log(low), math.log(high), many)))


def _outwards(low: float, high: float, many: int) -> Array:
    """Return numbers even in the logarithm from `low` to `high`, the middle one first."""
    return _even(low, high, many)[np.argsort(np.abs(np.arange(many) - many // 2), kind="stable")]


def _price(heaters: Array, weights: Array, design: PidDesign, finer: float) -> float:
    queue = continuous.space_for(0, heaters, finer).queue
    return compile_function(continuous.price, calls=True)(heaters, weights, *_settings(design), finer, math.inf, queue)


def _pieces(omega: Array, plant: Complex, tn: float, tv: float, limits: Four) -> tuple[Array, Array]:
    """Return bottoms and tops of the feasible pieces of K, the highest first."""
    space = continuous.space_for(len(omega), np.empty((0, 4)), 1.0)
    count = compile_function(continuous.pieces, calls=True)(omega, plant, tn, tv, limits, space)
    bottoms, tops = space.ends[:, :count][:, ::-1]
    return bottoms, tops


def _refine(problem: ContinuousProblem, density: float, start: Point, stride: float, least: float) -> Point:
    task = _task(problem, density)
    return compile_function(descent.refine, calls=True)(task, start, stride, least, _STEPS / 4.0, _space(task))


def _task(problem: ContinuousProblem, density: float) -> Task:
    omega, response = response_grid(problem.limited, problem.structure == "pid", density)
    return omega, response, problem.heaters, problem.weights, problem.limits


def _space(task: Task) -> Space:
    return continuous.space_for(len(task[0]), task[2], _STEPS / 4.0)


def _scanned(problem: ContinuousProblem, many_tn: int, many_tv: int, best: float, density: float) -> Point:
    task, axes = _task(problem, density), _axes(problem, many_tn, many_tv)
    best_point = compile_function(descent.scan, calls=True)(task, *axes, best, _STEPS / 4.0, _space(task))
    if best_point[1] == 0.0 and math.isinf(best):
        raise _impossible(problem)
    return best_point


def _descend(problem: ContinuousProblem, start: Point) -> PidDesign:
    """Return the local optimum near a point of the coarse search."""
    tns, _ = _axes(problem, *_SCANNED)
    stride = math.log(tns[0] / tns[1]) * (0.5 if problem.structure == "pid" else 1.0)
    point = _refine(problem, _COARSE, start, stride, 0.03)
    for density in (_FINE, _EXACT):
        # what other frequencies think of the start is not comparable with what these will
        near = _refine(problem, density, (math.inf, *point[1:]), 0.06, 3e-4)
        point = near if math.isfinite(near[0]) else point
        design = _finish(problem, point)
        if problem.cost(design) < point[0] * 1.002:
            break  # else the optimum lies at a cliff, and only the finest frequencies see its edge
    return design


def _sharpened(problem: ContinuousProblem, design: PidDesign) -> PidDesign:
    """Return the optimum on the finest frequencies; on those of the search a PID's cost ends up to 5e-5 above it."""
    begun: Point = (math.inf, *_settings(design))
    point = _refine(problem, _EXACT, begun, 0.02, 1e-4)
    better = _finish(problem, point) if math.isfinite(point[0]) else design
    return min((design, better), key=problem.cost)


def _finish(problem: ContinuousProblem, point: Point) -> PidDesign:
    """Return the design with K inside the piece that the finest frequencies leave."""
    _, gain, tn, tv = point
    omega, response = response_grid(problem.limited, tv > 0.0, _EXACT)
    bottoms, tops = _pieces(omega, response, tn, tv, problem.limits)
    for bottom, top in zip(bottoms, tops, strict=True):
        if gain > bottom:
            return _design(min(gain, float(top)), tn, tv)
    raise _impossible(problem)


def _design(gain: float, tn: float, tv: float) -> PidDesign:
    return PidDesign(
        gain_pct_per_degC=gain, integral_time_s=tn, derivative_time_s=tv, sample_time_s=0.0,
        structure=structure_of(tn, tv), method="optimum",
    )


def _p_design(problem: ContinuousProblem) -> PidDesign:
    omega, response = response_grid(problem.limited, False, _EXACT)
    tops = _pieces(omega, response, math.inf, 0.0, problem.limits)[1]
    if len(tops) == 0:
        raise _impossible(problem)
    return _design(float(tops[0]), math.inf, 0.0)


def _impossible(problem: ContinuousProblem) -> InputError:
    """Return the error for limits so close to what is possible that no gain is left in double precision."""
    return InputError(
        f"no {problem.structure.upper()} controller keeps {problem.specs.text} on all {len(problem.limited)} models; "
        f"loosen {' or '.join(f'--{name}' for name in problem.specs.limits)}"
    )
