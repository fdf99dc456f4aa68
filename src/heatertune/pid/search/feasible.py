"""The exact set of gains that keep a sensitivity limit, the search based on it, and its refinement by IPOPT.

With C = K·c(jω), |1 + K·h| ≥ 1/Ms excludes one interval of K at each frequency, and so do the limits on Mt and Mks.
The rest keeps the limits if the loop is stable. Stable pieces need not be connected, so they are tried from the top,
and only TN (and TV) are searched; feasibility is decided by the margins on their own frequencies, without a tolerance.
After a load step ∫|e| is no less than ∫e dt = TN/K: grid points are simulated in the order of this bound.

IPOPT (formulated in CasADi) starts at the best point: min over ln K, ln TN, ln TV of the mean over the models of Σ
√(e² + ε²)·TA after a load step of 1 %, or another objective, subject to |1 + L|² ≥ 1/Ms², |L|²/Mt², |C|²/Mks² at each
frequency and model.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from heapq import heapify, heappop, heappush
from itertools import count, product
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array, Complex
from heatertune.errors import InputError
from heatertune.model.model_values import HeaterModel
from heatertune.pid.design_values import PidDesign, step_parts, structure_of
from heatertune.pid.sampled_loop import (
    SampledPlant,
    frequencies,
    horizon,
    iae_load,
    iae_setpoint,
    itae_load,
    noise_gain,
    plant_and_controller_response,
    respond,
    sample_plant,
    sensitivity_peaks,
)
from heatertune.pid.specs import ROOM, Specs
from heatertune.processors import interruption_point

__all__ = [
    "NonlinearProgram", "Problem", "keeps", "largest_gain", "nonlinear_program", "on_the_limit", "polish", "search",
]


_PIECES: Final = 4  # stable pieces tried, from the top
_TN_RATIO, _TV_RATIO = 1.27, 1.6  # of neighbours in the first grid
_FINE: Final = 1.01  # ratio of TN at which the zooms end

def _any_gain(_design: PidDesign) -> float:
    return math.inf


#: cost and design
CostedDesign = tuple[float, PidDesign]


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
        objective, weight: the objective; for ise the feasible-set search minimises the load IAE, and IPOPT does the
            rest.
        guards: heaters that only add constraints, not cost.
        step_power: largest change of power in one scan per °C of a reading [%/°C].
        most_gain: design → the largest K that the target can store with its times [%/°C].
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
    most_gain: Callable[[PidDesign], float] = _any_gain

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
        """Return the mean over the models of the objective, in its unit; infinite if a loop does not come to rest.

        A P controller keeps an offset whatever its gain; its cost is the negative gain.
        """
        if not math.isfinite(design.integral_time_s):
            return -design.gain_pct_per_degC
        if self.objective == "ki":
            return design.integral_time_s / design.gain_pct_per_degC
        return float(np.mean([self._cost_on(plant, design) for plant in self.plants]))

    def least_cost(self, design: PidDesign) -> float:
        """Return a lower bound of `cost`, from ∫e dt = TN/K after a load step of 1 %."""
        if not math.isfinite(design.integral_time_s):
            return -design.gain_pct_per_degC
        if self.objective == "itae":
            return 0.0
        net = design.integral_time_s / design.gain_pct_per_degC
        if self.objective == "setpoint" or self.weight is not None:
            return net * float(np.mean([1.0 / plant.gain_degC_per_pct for plant in self.plants]))
        return net

    def _cost_on(self, plant: HeaterModel, design: PidDesign) -> float:
        if self.weight is not None:
            load = iae_load(plant, design) / plant.gain_degC_per_pct
            return (1.0 - self.weight) * load + self.weight * iae_setpoint(plant, design)
        return {"setpoint": iae_setpoint, "itae": itae_load}.get(self.objective, iae_load)(plant, design)


def keeps(problem: Problem, design: PidDesign) -> bool:
    """Return whether a design keeps every limit on every heater, as the margins judge it."""
    if design.step_power_pct_per_degC > problem.step_power or design.gain_pct_per_degC > problem.most_gain(design):
        return False
    for plant in problem.limited:
        ms, mt = sensitivity_peaks(plant, design)
        if ms > problem.ms or mt > problem.mt:
            return False
        if math.isfinite(problem.mks) and noise_gain(plant, design) > problem.mks:
            return False
    return True


def largest_gain(problem: Problem, integral_time_s: float, derivative_time_s: float) -> list[float]:
    """Return the upper ends of the feasible pieces of K > 0, the largest first; empty if none is stable."""
    designs = _at_the_tops(problem, integral_time_s, derivative_time_s)
    return [design.gain_pct_per_degC for design in designs if keeps(problem, design)]


def _at_the_tops(problem: Problem, tn: float, tv: float) -> list[PidDesign]:
    """Return designs a hair below the upper ends of the stable pieces of K, the largest first."""
    return _Looked.at(problem, tn, tv, problem.limited).tops(problem)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Looked:
    """The intervals of K that some heaters exclude at one TN and TV.

    Attributes:
        unit: the design with K = 1.
        loops: h of each, shape (n,).
        excluded: intervals of K, shape (m, 2), of each; the first entry belongs to no heater.
    """

    unit: PidDesign
    loops: list[Complex]
    excluded: list[Array]

    @classmethod
    def at(cls, problem: Problem, tn: float, tv: float, plants: Iterable[HeaterModel]) -> _Looked:
        """Look at heaters at a TN and TV."""
        unit = problem.design(1.0, tn, tv)
        steps = step_parts(tn, tv, problem.sample_time_s, problem.derivative_filter)
        most = min(problem.step_power / steps, problem.most_gain(unit))
        return cls(unit=unit, loops=[], excluded=[np.array([[most, math.inf]])]).with_(problem, plants)

    def with_(self, problem: Problem, plants: Iterable[HeaterModel]) -> _Looked:
        """Look at others, too."""
        looked_at, specs = [(plant * c, c) for plant,
                            c in (plant_and_controller_response(plant, self.unit) for plant in plants)], problem.specs
        return replace(self, loops=[*self.loops, *(h for h, _ in looked_at)],
                       excluded=[*self.excluded, *(_excluded(h, c, specs) for h, c in looked_at)])

    def tops(self, problem: Problem) -> list[PidDesign]:
        """Return designs a hair below the upper ends of the stable pieces of K, the largest first."""
        tops = np.array(_tops(np.concatenate(self.excluded)))
        for h in self.loops:
            tops = tops[_stable(h, tops)]
        tn, tv = self.unit.integral_time_s, self.unit.derivative_time_s
        return [problem.design((1.0 - ROOM) * float(top), tn, tv) for top in tops[-_PIECES:][::-1]]


def search(problem: Problem) -> PidDesign:
    """Return the best design: a grid over TN (and TV), then zooms around the best point.

    Raises:
        InputError: no gain keeps the limit on all models.
    """
    integral, derivative = _grids(problem)
    best: CostedDesign | None = None
    while True:
        best = _best_of(problem, _candidates(problem, product(integral, derivative)), best)
        if best is None:
            raise _impossible(problem)
        if len(integral) == 1 or integral[1] < _FINE * integral[0]:
            return best[1]
        integral = _zoom(integral, best[1].integral_time_s)
        derivative = _zoom(derivative, best[1].derivative_time_s)


def _grids(problem: Problem) -> tuple[Array, Array]:
    """Return the initial TN and TV, scaled by the dead time plus half a sample if the lag is much longer."""
    if problem.structure == "p":
        return np.array([math.inf]), np.zeros(1)
    slow = problem.slowest_s
    quick = min(plant.dead_time_s + sum(plant.lags_s[1:]) for plant in problem.limited) + 0.5 * problem.sample_time_s
    integral = _even(min(slow / 12.0, quick), 3.0 * slow, _TN_RATIO)
    if problem.structure == "pi":
        return integral, np.zeros(1)
    return integral, _even(min(slow / 80.0, 0.1 * quick), slow / 3.0, _TV_RATIO)


def _even(low: float, high: float, ratio: float) -> Array:
    return np.geomspace(low, high, math.ceil(math.log(high / low) / math.log(ratio)) + 1)


def _candidates(problem: Problem, times: Iterable[tuple[float, float]]) -> Iterator[CostedDesign]:
    """Yield possible optima for some TN and TV, each with a lower bound of its cost, the lowest first."""
    hardest, *others = sorted(problem.limited, key=_hardness)
    ahead, numbers = list[tuple[float, int, PidDesign | _Looked]](), count()
    for tn, tv in times:
        interruption_point()
        looked = _Looked.at(problem, float(tn), float(tv), [hardest])
        ahead += [(problem.least_cost(top), next(numbers), looked) for top in looked.tops(problem)[:1]]
    heapify(ahead)
    while ahead:
        least, _, first = heappop(ahead)
        if isinstance(first, PidDesign):
            yield least, first
            continue
        tops = first.with_(problem, others).tops(problem)
        # just below the limit the response may ring: a smaller gain can have the smaller cost
        for design in (*tops, *(replace(top, gain_pct_per_degC=0.85 * top.gain_pct_per_degC) for top in tops[-1:])):
            heappush(ahead, (problem.least_cost(design), next(numbers), design))


def _hardness(plant: HeaterModel) -> float:
    """Estimate K for a heater from its lag and dead time alone; the heater with the lowest value allows the least."""
    return plant.lags_s[0] / (abs(plant.gain_degC_per_pct) * max(plant.dead_time_s + sum(plant.lags_s[1:]), 1e-9))


def _best_of(problem: Problem, candidates: Iterable[CostedDesign], best: CostedDesign | None) -> CostedDesign | None:
    """Return the best of the candidates and of the previous best; None if nothing keeps the limits."""
    for bound, design in candidates:
        interruption_point()
        if best is not None and bound >= best[0]:
            break
        if keeps(problem, design):
            best = min((pair for pair in (best, (problem.cost(design), design)) if pair), key=lambda pair: pair[0])
    return best


def _impossible(problem: Problem) -> InputError:
    return InputError(
        f"no {problem.structure.upper()} controller keeps {problem.specs.text} on all {len(problem.limited)} models; "
        f"loosen {' or '.join(f'--{name}' for name in problem.specs.limits)}, or narrow the models with a better log"
    )


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
    intervals = []
    for alpha, gamma in quadratics:
        square = real**2 - alpha * gamma
        root = np.sqrt(np.maximum(square, 0.0)) - real
        hit = (square > 0.0) & ((real < 0.0) | (alpha < 0.0)) & (root > 0.0)
        high = np.full(len(root), math.inf)
        np.divide(root, alpha, out=high, where=alpha > 0.0)
        intervals.append(np.column_stack([gamma / root[hit], high[hit]]))
    return np.concatenate(intervals)


def _stable(h: Complex, gains: Array) -> npt.NDArray[np.bool_]:
    """Return for which K the curve K·h does not turn around −1; h, shape (n,), up to half the sampling frequency."""
    lower = h.imag[:-1] < 0.0  # the end is real
    at = np.flatnonzero(lower[1:] != lower[:-1])
    share = h.imag[at] / (h.imag[at] - h.imag[at + 1])
    crossed = np.append(h.real[at] + share * (h.real[at + 1] - h.real[at]), h.real[-1])
    turns = np.where(lower[np.append(at, -1)], 2, -2)
    turns[-1] //= 2  # the mirrored half of the curve goes through the same crossing
    return np.asarray((gains[:, None] * crossed < -1.0) @ turns == 0)


def _tops(excluded: Array) -> list[float]:
    """Return the upper ends of the gaps between the excluded intervals (m, 2), ascending."""
    low, high = excluded[np.argsort(excluded[:, 0])].T
    reached = np.maximum.accumulate(np.append(0.0, high))[:-1]
    return [float(top) for top in low[(low > reached) & np.isfinite(low)]]


_SMOOTH = 1e-4  # °C; rounds the corner of |e| far below any sensor's resolution
_FREQUENCIES = 240
_SAMPLES = 400  # of a response; where more of TA are needed, the program takes one every few
_MOST_SAMPLES = 2000  # where a short dead time allows no longer intervals
_SLOWER = 1.5  # times the response of the start: gains on the way may be lower
_NEARLY_ALL = 0.998
_MOST_DELAY = 200  # samples of dead time; each is a state of the loop inside


def polish(problem: Problem, start: PidDesign) -> tuple[PidDesign, str]:
    """Return the better of `start` and IPOPT's optimum with K put on the exact limit, and how the two compare.

    Args:
        problem: models, objective and limits.
        start: a feasible design.
    """
    if problem.objective == "ki":
        return start, "IPOPT was not used: TN/K needs no simulation, and the feasible-set search is exact."
    interruption_point()
    try:
        program = _exact_program(problem, start)
    except _NoProgram as why:
        return start, f"IPOPT was not used: {why}; the result of the feasible-set search is used."
    interruption_point()
    answer, status = program.run_ipopt(program.cost, [])
    if status not in _SOLVED:
        return start, f"IPOPT stopped with {status}; the result of the feasible-set search is used."
    gain, integral, *derivative = map(float, np.exp(answer))
    polished = on_the_limit(problem, replace(start, gain_pct_per_degC=gain, integral_time_s=integral,
                                             derivative_time_s=derivative[0] if derivative else 0.0))
    if not keeps(problem, polished):
        return start, "IPOPT ended at infeasible gains; the result of the feasible-set search is used."
    change = 100.0 * (program.cost_at(answer) / program.cost_at(program.start) - 1.0)
    comparison = f"IPOPT ended {abs(change):.1f} % {'below' if change < 0 else 'above'} the feasible-set search's cost."
    if problem.objective == "ise":
        return polished, comparison
    return min((start, polished), key=problem.cost), comparison


def _exact_program(problem: Problem, start: PidDesign) -> NonlinearProgram:
    """Return the program; one whose intervals are not TA only where the search leaves the rest to IPOPT."""
    if problem.objective != "ise" and _intervals(problem, start)[0] > 1:
        raise _NoProgram(f"the response takes more than {_SAMPLES} samples")
    return nonlinear_program(problem, start)


_PATIENT: Final = 1000  # iterations of a changed problem, whose start may be far away
#: of IPOPT, where it ended as it should
_SOLVED: Final = ("Solve_Succeeded", "Solved_To_Acceptable_Level")


class _NoProgram(InputError):
    """Raised where no nonlinear program can be made."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NonlinearProgram:
    """The problem behind the optimum, in the symbols of CasADi: minimise `cost` with every one of `limits` >= 0.

    Attributes:
        problem: in numbers.
        unknowns: ln K, ln TN and, of a PID, ln TV, shape (2,) or (3,).
        gain_pct_per_degC: K as an expression of them [%/°C].
        integral_time_s: TN likewise [s].
        derivative_time_s: TV likewise [s].
        cost: mean of the objective over the heaters, in its unit.
        limits: distance from each limit, not negative where it is kept.
        start: unknowns of the design at which it begins, shape as of `unknowns`.
        lowest: bounds of the unknowns, shape as of `unknowns`.
        highest: likewise.
    """

    problem: Problem
    unknowns: Any
    gain_pct_per_degC: Any
    integral_time_s: Any
    derivative_time_s: Any
    cost: Any
    limits: Any
    start: Array
    lowest: Array
    highest: Array

    def __repr__(self) -> str:
        """Return its size in one line; the expressions alone have some 100,000 characters."""
        return (f"<NonlinearProgram of a {self.problem.structure.upper()}, TA {self.problem.sample_time_s:.4g} s: "
                f"{len(self.start)} unknowns, {self.limits.numel()} limits on {len(self.problem.plants)} heaters>")

    def solve(self, *, cost: Any = None, limits: Iterable[Any] = ()) -> PidDesign:
        """Return the design at which IPOPT ends.

        Args:
            cost: another one, positive, an expression of the symbols here; None: that of the problem.
            limits: further ones, as `a <= b` or `a >= b`, or expressions that must not be negative.

        Raises:
            InputError: what is given is no expression of these symbols; IPOPT found no optimum, and with what status.
        """
        cost = self.cost if cost is None else self._expression("cost", cost)
        if not cost.is_scalar():
            raise InputError(f"cost has {cost.numel()} values; it must be one")
        if not np.iterable(limits) or isinstance(limits, str):
            raise InputError(f"limits is {limits!r}; it must be a list of expressions")
        further = [self._expression("limits", limit) for limit in limits]
        answer, status = self.run_ipopt(cost, further, most_iterations=_PATIENT)
        if status not in _SOLVED:
            raise InputError(f"IPOPT ended with {status}: relax a limit, or begin with another design")
        gain, integral, *derivative = np.exp(answer)
        design = self.problem.design(float(gain), float(integral), float(derivative[0]) if derivative else 0.0)
        return replace(design, method="optimum of a nonlinear program (IPOPT)")

    def _expression(self, field: str, value: Any) -> Any:
        """Return what a user gives as an expression of the unknowns."""
        import casadi as ca

        try:
            expression = ca.SX(value)
        except NotImplementedError:  # of CasADi: a type that it does not take
            raise InputError(f"{field} holds {value!r}; it must be an expression of this program's symbols, a casadi.SX"
                             ) from None
        own = ca.symvar(self.unknowns)
        hashes = {symbol.element_hash() for symbol in own}  # another program's symbols bear the same names
        if free := [symbol.name() for symbol in ca.symvar(expression) if symbol.element_hash() not in hashes]:
            raise InputError(f"{field} holds the symbol {', '.join(free)}, which is not one of this program's: "
                             f"{', '.join(symbol.name() for symbol in own)}")
        return expression if field == "cost" else _not_negative(ca, expression, value)

    def cost_at(self, unknowns: Array) -> float:
        """Return the cost at values of the unknowns, shape (2,) or (3,)."""
        import casadi as ca

        return float(ca.Function("f", [self.unknowns], [self.cost])(unknowns))

    def run_ipopt(self, cost: Any, limits: list[Any], *, most_iterations: int = 60) -> tuple[Array, str]:
        """Return the unknowns at which IPOPT ends, shape (2,) or (3,), and its status.

        Args:
            cost: as of `solve`.
            limits: as of `solve`.
            most_iterations: after so many it gives up.
        """
        import casadi as ca

        nlp = {"x": self.unknowns, "f": ca.log(cost), "g": ca.vertcat(self.limits, *limits)}
        solver = ca.nlpsol(
            "tune", "ipopt", nlp,
            {"ipopt.print_level": 0, "print_time": 0, "ipopt.sb": "yes", "ipopt.tol": 1e-6,
             "ipopt.max_iter": most_iterations,
             "ipopt.hessian_approximation": "limited-memory",
             "ipopt.mumps_pivot_order": 0,  # AMD: the matrix is an arrow, and METIS takes as long again as all the rest
             "no_nlp_grad": True},  # CasADi's own gradient, which is not needed
        )
        answer = solver(x0=self.start, lbg=0.0, ubg=ca.inf, lbx=self.lowest, ubx=self.highest)
        return np.asarray(answer["x"]).ravel(), str(solver.stats()["return_status"])


def _not_negative(ca: Any, limit: Any, value: Any) -> Any:
    """Return a limit as an expression that must not be negative; as a truth value it would always be kept."""
    parts = ca.vertsplit(ca.vec(limit))
    logical = (ca.OP_EQ, ca.OP_NE, ca.OP_NOT, ca.OP_AND, ca.OP_OR)
    if isinstance(value, bool) or any(part.is_op(op) for part in parts for op in logical):
        raise InputError(f"limits holds {value!r}; write a <= b, a >= b, or an expression that is not negative")
    return ca.vertcat(*(part.dep(1) - part.dep(0) if part.is_op(ca.OP_LE) or part.is_op(ca.OP_LT) else part
                        for part in parts))


def nonlinear_program(problem: Problem, start: PidDesign) -> NonlinearProgram:
    """Return the problem in the symbols of CasADi, to begin at a feasible design.

    Where the response takes more than 400 TA, cost and limits are those of loops that are sampled every few TA, with
    as much less dead time as the longer hold adds.

    Args:
        problem: models, objective and limits.
        start: a design within the limits.

    Raises:
        InputError: CasADi is not installed; a P controller; the objective ki; a dead time or a response of too many
            intervals.
    """
    if problem.objective == "ki" or problem.structure == "p":
        raise _NoProgram("the objective ki and a P controller need no program: their search is exact")
    scans, samples = _intervals(problem, start)
    interval, past = scans * problem.sample_time_s, problem.derivative_filter**scans
    hold_s = 0.5 * (interval - problem.sample_time_s)
    plants = [sample_plant(model, interval, computing_delay_s=-hold_s) for model in problem.limited]
    longest = max(plant.delay for plant in plants)
    if longest > _MOST_DELAY:
        raise _NoProgram(f"the dead time spans {longest} samples")
    try:
        import casadi as ca
    except ImportError as missing:
        raise _NoProgram("CasADi is not installed (pip install casadi)") from missing

    unknowns = ca.SX.sym("x", 3 if problem.structure == "pid" else 2)
    gain, integral = ca.exp(unknowns[0]), ca.exp(unknowns[1])
    derivative = ca.exp(unknowns[2]) if problem.structure == "pid" else ca.SX(0.0)
    settings = ca.vertcat(gain, interval / integral, derivative / interval)
    omega = frequencies(interval, problem.slowest_s, _FREQUENCIES)
    coarser = replace(problem, derivative_filter=past)
    costs = [_cost(ca, plant, samples, coarser, settings) for plant in plants[: len(problem.plants)]]
    limits = [_distances(ca, plant, settings, omega, coarser) for plant in plants]
    if math.isfinite(problem.step_power):
        ta = problem.sample_time_s
        parts = 1.0 + ta / integral + (1.0 - problem.derivative_filter) * derivative / ta
        limits.append(1.0 - gain * parts / problem.step_power)
    first = _vector(start, problem.structure)
    highest = first + 1.0
    highest[0] = min(highest[0], max(math.log(problem.most_gain(start)), first[0]))
    return NonlinearProgram(
        problem=problem, unknowns=unknowns, gain_pct_per_degC=gain, integral_time_s=integral,
        derivative_time_s=derivative, cost=interval * sum(costs) / len(costs), limits=ca.vertcat(*limits),
        start=first, lowest=first - 1.0, highest=highest)


def _vector(design: PidDesign, structure: str) -> Any:
    settings = [design.gain_pct_per_degC, design.integral_time_s]
    if structure == "pid":
        settings.append(design.derivative_time_s)
    return np.log(settings)


def _response_s(problem: Problem, start: PidDesign) -> float:
    """Return how long the response takes of which a program has the samples [s]."""
    loop_gain = start.gain_pct_per_degC * min(plant.gain_degC_per_pct for plant in problem.plants)
    longest = 4.0 * (problem.slowest_s + start.integral_time_s * (1.0 + 1.0 / loop_gain))
    whole = _SAMPLES * problem.sample_time_s
    if longest <= whole:
        return longest
    return max(whole, min(longest, _SLOWER * max(_settled_s(plant, start) for plant in problem.plants)))


def _settled_s(model: HeaterModel, design: PidDesign) -> float:
    """Return after how long nearly all of the error's integral is there, after steps of load and setpoint [s]."""
    samples = horizon(model, design)
    errors = respond(model, design, samples, load_pct=1.0), 1.0 - respond(model, design, samples, setpoint_degC=1.0)
    sums = [np.cumsum(np.abs(error)) for error in errors]
    return design.sample_time_s * max(int(np.searchsorted(each, _NEARLY_ALL * each[-1])) for each in sums)


def _intervals(problem: Problem, start: PidDesign) -> tuple[int, int]:
    """Return how many TA an interval of the program has, and how many intervals reach to the end of the response.

    Half of what it is longer than TA is taken from each dead time, which it adds as a hold.

    Raises:
        InputError: the shortest dead time allows only intervals of which the response has too many.
    """
    ta, response = problem.sample_time_s, _response_s(problem, start)
    dead_time = min(model.dead_time_s for model in problem.limited)
    scans = min(max(1, math.ceil(response / (_SAMPLES * ta) - 1e-9)), 1 + math.floor(0.5 * dead_time / ta))
    if response > (_MOST_SAMPLES + 1) * scans * ta:
        raise _NoProgram(f"the response takes {response / (scans * ta):.0f} intervals of {scans * ta:.3g} s, which is "
                         f"as long as the shortest dead time allows, and {_MOST_SAMPLES} are calculated at most")
    return scans, int(np.clip(response / (scans * ta), 40, _MOST_SAMPLES))


def _cost(ca: Any, plant: SampledPlant, samples: int, problem: Problem, settings: Any) -> Any:
    """Return the objective on one model, in units of TA."""
    past = problem.derivative_filter

    def errors(setpoint: float, load: float) -> Any:
        return _errors(ca, plant, samples, past, setpoint, load, settings)

    def size(course: Any) -> Any:
        return ca.sqrt(course**2 + _SMOOTH**2)

    if problem.objective == "setpoint":
        return ca.sum2(size(errors(1.0, 0.0)))
    load = errors(0.0, 1.0)
    if problem.objective == "ise":
        return ca.sumsqr(load)
    if problem.weight is not None:
        gain = float(np.sum((plant.now + plant.before) / (1.0 - plant.poles)))
        rise = size(errors(1.0, 0.0))
        return (1.0 - problem.weight) / gain * ca.sum2(size(load)) + problem.weight * ca.sum2(rise)
    if problem.objective == "itae":
        return plant.sample_time_s * (size(load) @ np.arange(1.0, samples + 1.0))
    return ca.sum2(size(load))


def _errors(ca: Any, plant: SampledPlant, samples: int, past: float, setpoint: float, load: float, value: Any) -> Any:
    """Return the control errors after steps of setpoint [°C] and load [%] with settings, shape (1, samples)."""
    modes, taps = len(plant.poles), plant.delay + 1
    state = ca.SX.sym("state", modes + taps + 3)
    settings = ca.SX.sym("settings", 3)
    x, queue, memory = state[:modes], state[modes : modes + taps], state[modes + taps :]
    error = setpoint - ca.sum1(x)
    summed = memory[0] + settings[1] * error
    filtered = past * memory[1] + (1.0 - past) * settings[2] * (error - memory[2])
    power = settings[0] * (error + summed + filtered) + load
    line = ca.vertcat(power, queue)  # newest first
    following = plant.poles * x + plant.now * line[plant.delay] + plant.before * line[plant.delay + 1]
    after = ca.vertcat(following, line[:taps], summed, filtered, error)
    step = ca.Function("step", [state, settings], [after, setpoint - ca.sum1(following)])
    return step.mapaccum("loop", samples)(ca.DM.zeros(modes + taps + 3), ca.repmat(value, 1, samples))[1]


def _distances(ca: Any, plant: SampledPlant, settings: Any, omega: Any, problem: Problem) -> Any:
    """Return by how much each limit is kept at each frequency; negative where it is not."""
    past = problem.derivative_filter
    backward = np.exp(-1j * omega * plant.sample_time_s)
    g = plant.frequency_response(omega)
    integral = 1.0 / (1.0 - backward)
    derivative = (1.0 - past) * (1.0 - backward) / (1.0 - past * backward)

    def size(start: float, factor: Any) -> Any:
        parts = [factor * part for part in (1.0, integral, derivative)]
        real, imaginary = (
            settings[0] * (get(parts[0]) + settings[1] * get(parts[1]) + settings[2] * get(parts[2]))
            for get in (np.real, np.imag)
        )
        return (start + real) ** 2 + imaginary**2

    distance = size(1.0, g)
    distances = [distance - 1.0 / problem.ms**2]
    if math.isfinite(problem.mt):
        distances.append(distance - size(0.0, g) / problem.mt**2)
    if math.isfinite(problem.mks):
        distances.append(distance - size(0.0, np.ones_like(g)) / problem.mks**2)
    return ca.vertcat(*distances)


def on_the_limit(problem: Problem, design: PidDesign) -> PidDesign:
    """Return IPOPT's design; K is put on the exact limit where the coarse frequencies let it slip past."""
    gain = design.gain_pct_per_degC
    tops = largest_gain(problem, design.integral_time_s, design.derivative_time_s)
    near = [top for top in tops if math.isfinite(top) and gain <= 1.2 * top]
    return replace(design, gain_pct_per_degC=min([gain, *near[-1:]]))
