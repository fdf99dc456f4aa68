"""The constrained optimum of the continuous loop, for `--sample-time 0`: PI or PID in the ideal form, exact dead time.

For each TN and TV the feasible gains are known exactly (`continuous_loop.pieces`), which leaves a search in one or two
unknowns: a coarse grid, a local search, the same again on finer frequencies. A fine grid over the whole reduced
problem then looks for a better optimum elsewhere. This is evidence at the resolution of the grid, not a proof.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache, partial

import numpy as np

from heatertune.arrays import Array, Complex
from heatertune.compiled import compile_function
from heatertune.errors import InputError
from heatertune.model.model_values import FittedModel, HeaterModel
from heatertune.pid import continuous_loop as continuous
from heatertune.pid.continuous_loop import DERIVATIVE_FILTER_N, Four, Space, least_price, pieces, price
from heatertune.pid.design_values import Margins, PidDesign, Promise, structure_of
from heatertune.pid.rules import RULES, apply_rule, model_for
from heatertune.pid.sampled_loop import crossings
from heatertune.pid.search.robust import Open, robust_design
from heatertune.pid.specs import Specs, explain, heating_cooling_notes, is_boundless, refuse_boundless

__all__ = [
    "ContinuousProblem", "Task", "assess_design", "global_check", "global_optimum", "iae", "margins", "optimum",
    "peaks", "refine", "response_grid", "scan", "tune_continuous",
]


#: frequencies, heaters' answers there, heaters, weights, limits: see `pieces` and `price`
Task = tuple[Array, Complex, Array, Array, Four]

_RINGING = 2.0  # a response this much dearer than the best is not made the best by a smaller K


def _inside(
    heaters: Array, weights: Array, piece: tuple[float, float], tn: float, tv: float, at_top: float, finer: float,
    queue: Array,
) -> tuple[float, float]:
    """Return the best cost and gain below the top of a piece, by golden section; the bound closes the range below."""
    bottom, top = piece
    a = math.log(max(bottom, top * least_price(heaters, weights, top, tn) / at_top))
    b = math.log(top)
    golden = 0.5 * (math.sqrt(5.0) - 1.0)
    c, d = b - golden * (b - a), a + golden * (b - a)
    fc = price(heaters, weights, math.exp(c), tn, tv, finer, at_top, queue)
    fd = price(heaters, weights, math.exp(d), tn, tv, finer, at_top, queue)
    while b - a > 1e-3:
        if fc < fd:
            b, d, fd = d, c, fc
            c = b - golden * (b - a)
            fc = price(heaters, weights, math.exp(c), tn, tv, finer, at_top, queue)
        else:
            a, c, fc = c, d, fd
            d = a + golden * (b - a)
            fd = price(heaters, weights, math.exp(d), tn, tv, finer, at_top, queue)
    return (fc, math.exp(c)) if fc < fd else (fd, math.exp(d))


def _reduced(task: Task, tn: float, tv: float, best: float, finer: float, space: Space) -> tuple[float, float]:
    """Return the least cost over K at one TN and TV, and that K; infinite if it cannot be below `best`.

    TV > TN is left out: with TV without bound the filtered derivative is a gain, a PI controller under another name;
    and so is TV below the shortest, where noise would pay for a derivative that does nothing.
    """
    omega, plant, heaters, weights, limits = task
    cost, gain = math.inf, 0.0
    if tv > tn or 0.0 < tv < limits[3]:
        return cost, gain
    for j in range(pieces(omega, plant, tn, tv, limits, space) - 1, -1, -1):  # from the highest
        bottom, top = space.ends[0, j], space.ends[1, j]
        lowest = least_price(heaters, weights, top, tn)
        if lowest >= min(best, cost):
            break  # lower pieces have higher bounds
        dear = _RINGING * min(best, cost)
        value, at = price(heaters, weights, top, tn, tv, finer, dear, space.queue), top
        if lowest * (1.0 + 1e-7) < value < dear:
            near = top * 0.999
            if near > bottom and price(heaters, weights, near, tn, tv, finer, value, space.queue) < value:
                value, at = _inside(heaters, weights, (bottom, top), tn, tv, value, finer, space.queue)
        if value < cost:
            cost, gain = value, at
    return cost, gain


def scan(task: Task, tns: Array, tvs: Array, best: float, finer: float, space: Space) -> Four:
    """Return (cost, K, TN, TV) of the best point of a grid; cost `best` and K = 0 if none is below `best`.

    Args:
        task: heaters, weights and limits.
        tns: TN of the grid, shape (a,) [s].
        tvs: TV of the grid, shape (b,) [s].
        best: cost to be below.
        finer: factor of the number of time steps.
        space: work arrays for the task.
    """
    best_point = (best, 0.0, 0.0, 0.0)
    for tn in tns:
        for tv in tvs:
            cost, gain = _reduced(task, tn, tv, best_point[0], finer, space)
            if cost < best_point[0]:
                best_point = (cost, gain, tn, tv)
    return best_point


def refine(task: Task, start: Four, stride: float, least: float, finer: float, space: Space) -> Four:
    """Return (cost, K, TN, TV) of the local optimum over ln TN (and ln TV) near a start, found by two simplex searches.

    Args:
        task: heaters, weights and limits.
        start: (cost, K, TN, TV).
        stride: first distance of a simplex.
        least: its last distance.
        finer: factor of the number of time steps.
        space: work arrays for the task.
    """
    best = _simplex(task, start, stride, least, finer, space)
    # restarted from the other side: a simplex can collapse where two peaks of |S| meet
    return _simplex(task, best, -0.3 * stride, least, finer, space)


def _simplex(task: Task, start: Four, stride: float, least: float, finer: float, space: Space) -> Four:
    """J. A. Nelder and R. Mead, Computer Journal 7 (1965) 308-313, in one dimension (TV = 0) or two."""
    n, x = 1 if start[3] == 0.0 else 2, space.corners
    for j in range(n + 1):
        x[j, 2] = math.log(start[2]) + (stride if j == 1 else 0.0)
        x[j, 3] = math.log(start[3]) + (stride if j == 2 else 0.0) if n == 2 else -math.inf
        x[j, 0], x[j, 1] = _at(task, x[j, 2], x[j, 3], finer, space)
    for _ in range(200):
        _sort(x, n)
        if _width(x, n) < least:
            break
        tn, tv = (x[0, 2], x[0, 3]) if n == 1 else (0.5 * (x[0, 2] + x[1, 2]), 0.5 * (x[0, 3] + x[1, 3]))
        away_tn, away_tv = tn - x[n, 2], tv - x[n, 3] if n == 2 else 0.0
        point = tn + away_tn, tv + away_tv
        value, k = _at(task, point[0], point[1], finer, space)
        if value < x[0, 0]:
            further = point[0] + away_tn, point[1] + away_tv
            wide, w = _at(task, further[0], further[1], finer, space)
            if wide < value:
                point, value, k = further, wide, w
        elif value >= x[n - 1, 0]:
            level = min(value, x[n, 0])
            share = 0.5 if value < x[n, 0] else -0.5
            point = tn + share * away_tn, tv + share * away_tv
            value, k = _at(task, point[0], point[1], finer, space)
            if value >= level:
                for j in range(1, n + 1):
                    for i in range(2, n + 2):
                        x[j, i] = 0.5 * (x[0, i] + x[j, i])
                    x[j, 0], x[j, 1] = _at(task, x[j, 2], x[j, 3], finer, space)
                continue
        x[n, 0], x[n, 1], x[n, 2], x[n, 3] = value, k, point[0], point[1]
    _sort(x, n)
    answer = x[0, 0], x[0, 1], math.exp(x[0, 2]), math.exp(x[0, 3])
    return answer if answer[0] < start[0] else start


def _sort(x: Array, n: int) -> None:
    """Sort the n + 1 corners of a simplex, the cheapest first; the sort is stable."""
    for last in range(1, n + 1):
        j = last
        while j > 0 and x[j, 0] < x[j - 1, 0]:
            for i in range(4):
                x[j - 1, i], x[j, i] = x[j, i], x[j - 1, i]
            j -= 1


def _width(x: Array, n: int) -> float:
    """Return the largest distance of a corner from the cheapest one, in ln TN or ln TV."""
    widest = 0.0
    for j in range(1, n + 1):
        for i in range(2, n + 2):
            widest = max(widest, abs(x[j, i] - x[0, i]))
    return widest


def _at(task: Task, ln_tn: float, ln_tv: float, finer: float, space: Space) -> tuple[float, float]:
    """Return least cost and K at ln TN and ln TV."""
    return _reduced(task, math.exp(ln_tn), math.exp(ln_tv), math.inf, finer, space)


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
        guards: heaters that only add constraints, not cost.

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
        """A row of each model, see `continuous_loop.Heater`, shape (p, 5)."""
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
    load, setpoint = (_price(row, weights, upright, _STEPS) for weights in np.eye(4)[:2, None])
    return load, setpoint


@lru_cache(maxsize=_KEPT)
def response_grid(plants: tuple[HeaterModel, ...], derivative: bool, density: float) -> tuple[Array, Complex]:
    """Return frequencies [rad/s] for each model, one model after the other, and G(jω) [°C/%] there; read-only.

    They are logarithmic up to the inverse of the dead time, then linear, to resolve every turn of e^(−jωL), up to where
    the lags have attenuated the loop too much to come near −1.

    Args:
        plants: the models.
        derivative: whether the controller has a derivative part.
        density: 1 for some 300 frequencies.

    Returns:
        Frequencies and responses, each of shape (n,).
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
        return design, "The gain is the largest feasible one; no search was needed."
    better = global_check(problem, design)
    moved = design if better is None else _descend(problem, better)
    if problem.cost(moved) < problem.cost(design) * (1.0 - _WORTH):
        sentence = "The global check found the optimum; the first search had ended at a local one."
        return _sharpened(problem, moved), sentence
    return _sharpened(problem, design), (
        f"No point of a grid of {_points(problem)} over the reduced problem, each with its best K, costs less: "
        "at the resolution of this grid, the optimum is global."
    )


def global_check(problem: ContinuousProblem, design: PidDesign) -> Point | None:
    """Return the point of a fine grid over TN and TV, each with its best K, that beats the design, or None.

    Points whose lower bound is above the design's cost are excluded without a simulation, so the grid is cheap.
    """
    cost = _price(problem.heaters, problem.weights, design, _STEPS / 4.0)
    rival = _scanned(problem, *_checked(problem), cost * (1.0 - _WORTH), _FINE)
    return rival if rival[1] > 0.0 else None


def peaks(omega: Array, plant: Complex, gain: float, tn: float, tv: float) -> tuple[Complex, float, float, float]:
    """Return L(jω), Ms, Mt and Mks [%/°C] at frequencies [rad/s] at which the plant is given; infinite if unstable.

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
    return plant.gain_degC_per_pct, *(*plant.lags_s, 0.0)[:2], plant.dead_time_s, plant.fast_share or 0.0


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
    space = continuous.space_for(len(omega), np.empty((0, 5)), 1.0)
    count = compile_function(continuous.pieces, calls=True)(omega, plant, tn, tv, limits, space)
    bottoms, tops = space.ends[:, :count][:, ::-1]
    return bottoms, tops


def _refine(problem: ContinuousProblem, density: float, start: Point, stride: float, least: float) -> Point:
    task = _task(problem, density)
    return compile_function(refine, calls=True)(task, start, stride, least, _STEPS / 4.0, _space(task))


def _task(problem: ContinuousProblem, density: float) -> Task:
    omega, response = response_grid(problem.limited, problem.structure == "pid", density)
    return omega, response, problem.heaters, problem.weights, problem.limits


def _space(task: Task) -> Space:
    return continuous.space_for(len(task[0]), task[2], _STEPS / 4.0)


def _scanned(problem: ContinuousProblem, many_tn: int, many_tv: int, best: float, density: float) -> Point:
    task, axes = _task(problem, density), _axes(problem, many_tn, many_tv)
    best_point = compile_function(scan, calls=True)(task, *axes, best, _STEPS / 4.0, _space(task))
    if best_point[1] == 0.0 and math.isinf(best):
        raise _impossible(problem)
    return best_point


def _descend(problem: ContinuousProblem, start: Point) -> PidDesign:
    """Return the local optimum near a point of the coarse search."""
    tns, _ = _axes(problem, *_SCANNED)
    stride = math.log(tns[0] / tns[1]) * (0.5 if problem.structure == "pid" else 1.0)
    point = _refine(problem, _COARSE, start, stride, 0.03)
    for density in (_FINE, _EXACT):
        # the cost of the start at other frequencies is not comparable
        near = _refine(problem, density, (math.inf, *point[1:]), 0.06, 3e-4)
        point = near if math.isfinite(near[0]) else point
        design = _finish(problem, point)
        if problem.cost(design) < point[0] * 1.002:
            break  # else the optimum lies at a cliff, and only the finest frequencies see its edge
    return design


def _sharpened(problem: ContinuousProblem, design: PidDesign) -> PidDesign:
    """Return the optimum on the finest frequencies; on those of the search a PID's cost ends up to 5e-5 above it."""
    start: Point = (math.inf, *_settings(design))
    point = _refine(problem, _EXACT, start, 0.02, 1e-4)
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
    """Return the error for limits so tight that no gain satisfies them in double precision."""
    return InputError(
        f"no {problem.structure.upper()} controller keeps {problem.specs.text} on all {len(problem.limited)} models; "
        f"loosen {' or '.join(f'--{name}' for name in problem.specs.limits)}"
    )


_TOLD = (
    f"Continuous loop with its exact dead time, TV filtered by TV/{DERIVATIVE_FILTER_N:g}; "
    "for words of a PLC tune with a sampling interval."
)


def tune_continuous(
    fitted: FittedModel, *, method: str, structure: str, specs: Specs, closed_loop_s: float | None = None,
    robust: str = "none",
) -> PidDesign:
    """Return the continuous design by the optimum or a rule; the optimum is checked on a grid.

    Args:
        fitted: model and candidates.
        method: "optimum" or the name of a rule.
        structure: "p", "pi" or "pid".
        specs: objective and limits, for the optimum.
        closed_loop_s: closed-loop time constant, for a rule with this parameter [s]; None: the rule's default.
        robust: over which heaters sampled from the fit the optimum keeps its limits, as in `heatertune.pid.tune.tune`.

    Raises:
        InputError, OutOfRange: as `ContinuousProblem` and `optimum`; the rule does not give the structure.
        UnknownName: no such rule.
    """
    if method != "optimum":
        model = model_for(method, structure, fitted)
        gain, tn, tv = apply_rule(method, model, structure, 0.0, closed_loop_s=closed_loop_s)
        by_rule = PidDesign(
            gain_pct_per_degC=gain, integral_time_s=tn, derivative_time_s=tv, sample_time_s=0.0,
            structure=structure_of(tn, tv), method=f"{method} ({RULES[method].source})",
        )
        return replace(assess_design(fitted, by_rule), notes=(_TOLD,))
    problem = ContinuousProblem(plants=fitted.plants, structure=structure, specs=specs)
    best, checked = global_optimum(problem)
    notes = [_TOLD, checked]
    if robust != "none":
        strategy = robust_design(
            Open.of(fitted, robust), specs, robust, lambda guards: optimum(replace(problem, guards=guards)), best)
        problem = replace(problem, guards=strategy.guards)
        notes = [_TOLD, strategy.sentence(problem.cost(best), problem.cost(strategy.design))]
        best = replace(strategy.design, promise=Promise(way=robust, limits=specs.limits))
    design = assess_design(fitted, best)
    notes += [*_explained(problem, design), *_plainer(problem, design)]
    notes += heating_cooling_notes(fitted, design, partial(_alone, problem))
    return replace(design, method=f"optimum ({specs.text} on {len(fitted.plants)} models)", notes=tuple(notes))


def _alone(problem: ContinuousProblem, plant: HeaterModel) -> tuple[PidDesign, Callable[[PidDesign], float]]:
    own = replace(problem, plants=(plant,), guards=())
    return optimum(own), own.cost


def assess_design(fitted: FittedModel, design: PidDesign) -> PidDesign:
    """Return the design with its margins and costs, worst over the models; a cost is None if it does not exist."""
    worst, mks = margins(fitted.plants, design)
    at_rest = worst.stable and math.isfinite(design.integral_time_s)
    alone = [iae(plant, design) for plant in fitted.plants] if at_rest else []
    return replace(
        design, margins=worst, mks=mks if worst.stable else None,
        iae_load=max((load for load, _ in alone), default=None),
        iae_setpoint=max((setpoint for _, setpoint in alone), default=None),
    )


def _explained(problem: ContinuousProblem, design: PidDesign) -> list[str]:
    of_all, noise = margins(problem.limited, design)
    peaks = {"ms": of_all.ms, "mt": of_all.mt, "mks": noise}

    def solve(specs: Specs) -> float:
        other = replace(problem, specs=specs)
        return other.cost(optimum(other))

    if problem.structure == "p":
        return explain(problem.specs, peaks, -1.0 / design.gain_pct_per_degC, lambda specs: 1.0 / solve(specs))
    return explain(problem.specs, peaks, problem.cost(design), solve)


def _plainer(problem: ContinuousProblem, design: PidDesign) -> list[str]:
    """Suggest a PI controller if it is better: the derivative part amplifies noise by 1 + N, however short TV is."""
    if problem.structure != "pid":
        return []
    try:
        plain = replace(problem, structure="pi")
        gained = 100.0 * (1.0 - plain.cost(optimum(plain)) / problem.cost(design))
    except InputError:
        return []
    return [f"A PI controller under the same limits costs {gained:.1f} % less."] if gained > 0.0 else []
