"""The constrained optimum, formulated in CasADi and solved by IPOPT.

min over ln K, ln TN, ln TV   mean over the models of Σ √(e² + ε²)·TA after a load step of 1 %, or another objective
subject to                    |1 + L(jω)|² ≥ 1/Ms², |L|²/Mt², |C|²/Mks²   at each frequency, for each model

The sampled loop with its exact dead time is simulated inside (single shooting); the start is the best
point of the feasible-set search, which no local minimum can mislead.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from heatertune.pid.loop.sampled import SampledPlant, frequencies, sample_plant
from heatertune.pid.search.feasible import Problem, keeps, largest_gain
from heatertune.pid.values import PidDesign

__all__ = ["polish"]

_SMOOTH = 1e-4  # °C; rounds the corner of |e| far below any sensor's resolution
_FREQUENCIES = 240
_MOST_SAMPLES = 400
_MOST_DELAY = 200  # samples of dead time; each is a state of the loop inside


def polish(problem: Problem, start: PidDesign) -> tuple[PidDesign, str]:
    """Return the better of `start` and IPOPT's optimum with K put on the exact limit, and how the two compare.

    Args:
        problem: models, objective and limits.
        start: a feasible design.
    """
    if problem.objective == "ki":
        return start, "IPOPT was not used: TN/K needs no simulation, and the feasible-set search is exact."
    plants = [sample_plant(model, problem.sample_time_s) for model in problem.limited]
    longest = max(plant.delay for plant in plants)
    if longest > _MOST_DELAY:
        return start, (f"IPOPT was not used: the dead time spans {longest} samples; the result of the feasible-set "
                       "search is used.")
    import casadi as ca  # noqa: PLC0415 - a tenth of a second that only the optimum needs

    unknowns = ca.SX.sym("x", 3 if problem.structure == "pid" else 2)
    gain, integral = ca.exp(unknowns[0]), ca.exp(unknowns[1])
    derivative = ca.exp(unknowns[2]) if problem.structure == "pid" else ca.SX(0.0)
    settings = ca.vertcat(gain, problem.sample_time_s / integral, derivative / problem.sample_time_s)
    omega = frequencies(problem.sample_time_s, problem.slowest_s, _FREQUENCIES)
    samples = _samples(problem, start)
    costs = [_cost(ca, plant, samples, problem, settings) for plant in plants[: len(problem.plants)]]
    limits = [_distances(ca, plant, settings, omega, problem) for plant in plants]
    if math.isfinite(problem.step_power):
        parts = 1.0 + settings[1] + (1.0 - problem.derivative_filter) * settings[2]
        limits.append(1.0 - gain * parts / problem.step_power)
    cost = problem.sample_time_s * sum(costs) / len(costs)
    nlp = {"x": unknowns, "f": ca.log(cost), "g": ca.vertcat(*limits)}
    solver = ca.nlpsol(
        "tune", "ipopt", nlp,
        {"ipopt.print_level": 0, "print_time": 0, "ipopt.sb": "yes", "ipopt.max_iter": 60, "ipopt.tol": 1e-6,
         "ipopt.hessian_approximation": "limited-memory",
         "ipopt.mumps_pivot_order": 0,  # AMD: the matrix is an arrow, and METIS takes as long again as all the rest
         "no_nlp_grad": True},  # CasADi's own gradient, which nobody asks for
    )
    first = _vector(start, problem.structure)
    value = ca.Function("f", [unknowns], [cost])
    highest = first + 1.0
    highest[0] = min(highest[0], max(math.log(problem.most_gain(start)), first[0]))
    answer = solver(x0=first, lbg=0.0, ubg=ca.inf, lbx=first - 1.0, ubx=highest)
    if not solver.stats()["success"]:
        return start, f"IPOPT stopped with {solver.stats()['return_status']}; the feasible-set search stands."
    polished = _on_the_limit(problem, start, np.asarray(answer["x"]).ravel())
    if not keeps(problem, polished):
        return start, "IPOPT ended between the feasible gains; the feasible-set search stands."
    change = 100.0 * (float(value(answer["x"])) / float(value(first)) - 1.0)
    comparison = f"IPOPT ended {abs(change):.1f} % {'below' if change < 0 else 'above'} the feasible-set search's cost."
    if problem.objective == "ise":
        return polished, comparison
    return min((start, polished), key=problem.cost), comparison


def _vector(design: PidDesign, structure: str) -> Any:
    settings = [design.gain_pct_per_degC, design.integral_time_s]
    if structure == "pid":
        settings.append(design.derivative_time_s)
    return np.log(settings)


def _samples(problem: Problem, start: PidDesign) -> int:
    loop_gain = start.gain_pct_per_degC * min(plant.gain_degC_per_pct for plant in problem.plants)
    slow = problem.slowest_s + start.integral_time_s * (1.0 + 1.0 / loop_gain)
    return int(np.clip(4.0 * slow / problem.sample_time_s, 40, _MOST_SAMPLES))


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


def _errors(
    ca: Any, plant: SampledPlant, samples: int, past: float, setpoint: float, load: float, given: Any
) -> Any:
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
    return step.mapaccum("loop", samples)(ca.DM.zeros(modes + taps + 3), ca.repmat(given, 1, samples))[1]


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
    kept = [distance - 1.0 / problem.ms**2]
    if math.isfinite(problem.mt):
        kept.append(distance - size(0.0, g) / problem.mt**2)
    if math.isfinite(problem.mks):
        kept.append(distance - size(0.0, np.ones_like(g)) / problem.mks**2)
    return ca.vertcat(*kept)


def _on_the_limit(problem: Problem, start: PidDesign, answer: Any) -> PidDesign:
    """Return IPOPT's design; K is put on the exact limit where the coarse frequencies let it slip past."""
    tn = float(np.exp(answer[1]))
    tv = float(np.exp(answer[2])) if problem.structure == "pid" else 0.0
    gain = float(np.exp(answer[0]))
    tops = [top for top in largest_gain(problem, tn, tv) if math.isfinite(top)]
    near = [top for top in tops if gain <= 1.2 * top]
    gain = min([gain, *near[-1:]])
    return replace(start, gain_pct_per_degC=gain, integral_time_s=tn, derivative_time_s=tv)
