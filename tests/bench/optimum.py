"""Time of one constrained optimum, warm, beside SciPy's SLSQP and CasADi/IPOPT on the same problem; and many heaters.

    python tests/bench/optimum.py                  the table of times and costs
    python tests/bench/optimum.py --heaters 2000   random heaters: every one ends with a design or a sentence

The rivals minimise the same load IAE under the same Ms: SLSQP with this program's own compiled functions, from the
same start; IPOPT on a transcription of the delay equation in steps of 1/40 dead time.
"""

import argparse
import math
import time

import numpy as np
from scipy.optimize import minimize

from heatertune.compiled import compile_function
from heatertune.errors import InputError
from heatertune.model.model_values import Fopdt
from heatertune.pid import continuous_loop as continuous
from heatertune.pid.continuous_optimum import ContinuousProblem, global_optimum, margins, optimum, response_grid
from heatertune.pid.specs import Specs

MS = 1.6
FAR = 20.0  # SLSQP wanders: beyond these powers of e, as ratios to the heater's own numbers, there is no controller


def timed(function, times=1):
    """Best time [s] of several calls, and the last answer."""
    best, answer = math.inf, None
    for _ in range(times):
        begun = time.perf_counter()
        answer = function()
        best = min(best, time.perf_counter() - begun)
    return best, answer


def start(dead, structure):
    gain = 0.4 * (1.0 / dead + 0.3)
    return [math.log(gain), math.log(min(1.0, 6.0 * dead) + 0.3 * dead)] + ([math.log(0.3 * dead)] if structure == "pid" else [])


def settings(x):
    gain, *times = (math.exp(min(max(value, -FAR), FAR)) for value in x)
    return gain, times[0], times[1] if len(times) > 1 else 0.0


def priced(problem, gains, finer):
    """Return the cost of K, TN and TV."""
    queue = continuous.space_for(0, problem.heaters, finer).queue
    return compile_function(continuous.price, calls=True)(problem.heaters, problem.weights, *gains, finer, math.inf, queue)


def slsqp_asks(problem, structure):
    """Return what SLSQP minimises and what it keeps above 0, each of the logarithms of K, TN and TV."""
    omega, response = response_grid(problem.plants, structure == "pid", 2.0)

    def cost(x):
        price = priced(problem, settings(x), 0.5)
        return math.log(price if 0.0 < price < 1e6 else 1e6)

    def room(x):
        gain, tn, tv = settings(x)
        return 1.0 - np.max(1.0 / np.abs(1.0 + gain * response * continuous.controller(omega, tn, tv))) / MS

    return cost, room


def by_slsqp(problem, dead, structure):
    cost, room = slsqp_asks(problem, structure)
    found = minimize(cost, start(dead, structure), method="SLSQP", constraints={"type": "ineq", "fun": room},
                     options={"maxiter": 200, "ftol": 1e-9})
    return settings(found.x)


def ipopt_solver(dead, structure, density=1.0):
    """Return the solver of the transcription; the loop is simulated with a hold of first order, |e| is rounded by 1e-6.

    `density` is that of the frequencies on which it keeps Ms.
    """
    import casadi as ca  # noqa: PLC0415 - beside its only use

    per, spans = 40, 30
    h, n = dead / per, per * spans
    x = ca.SX.sym("x", 3 if structure == "pid" else 2)
    gain, tn = ca.exp(x[0]), ca.exp(x[1])
    tv = ca.exp(x[2]) if structure == "pid" else None
    a = math.exp(-h)
    new = 1.0 - (1.0 - a) / h
    old = 1.0 - a - new
    y, summed, slow, queue = ca.SX.sym("y"), ca.SX.sym("s"), ca.SX.sym("f"), ca.SX.sym("q", per + 1)
    after = a * y + old * (1.0 + queue[0]) + new * (1.0 + queue[1])
    total = summed - 0.5 * h * (y + after)
    power = gain * (-after + total / tn)
    filtered = slow
    if tv is not None:
        af = ca.exp(-h * 10.0 / tv)
        nf = 1.0 - (1.0 - af) * tv / (10.0 * h)
        filtered = af * slow - (1.0 - af - nf) * y - nf * after
        power += gain * 10.0 * (-after - filtered)
    state = ca.vertcat(y, summed, slow, queue)
    step = ca.Function("step", [state, x], [ca.vertcat(after, total, filtered, queue[1:], power), after])
    path = step.mapaccum("loop", n)(ca.DM.zeros(per + 4), ca.repmat(x, 1, n))[1]
    cost = h * ca.sum2(ca.sqrt(path**2 + 1e-12))
    omega = response_grid((Fopdt(gain_degC_per_pct=1.0, time_constant_s=1.0, dead_time_s=dead),), structure == "pid", density)[0]
    g = np.exp(-1j * omega * dead) / (1j * omega + 1.0)
    real = g.real + (g / (1j * omega)).real / tn
    imaginary = g.imag + (g / (1j * omega)).imag / tn
    if tv is not None:
        u = omega * tv
        d_real, d_imaginary = u**2 / 10.0 / (1.0 + (u / 10.0) ** 2), u / (1.0 + (u / 10.0) ** 2)
        real += g.real * d_real - g.imag * d_imaginary
        imaginary += g.real * d_imaginary + g.imag * d_real
    distance = (1.0 + gain * real) ** 2 + (gain * imaginary) ** 2
    options = {"ipopt.print_level": 0, "print_time": 0, "ipopt.sb": "yes", "ipopt.max_iter": 150, "ipopt.tol": 1e-7,
               "ipopt.hessian_approximation": "limited-memory"}
    return ca.nlpsol("s", "ipopt", {"x": x, "f": ca.log(cost), "g": distance}, options)


def by_ipopt(solver, begun):
    answer = solver(x0=begun, lbg=1.0 / MS**2, ubg=math.inf)
    return settings(np.asarray(answer["x"]).ravel()), solver.stats()["success"]


def beside(problem, design, found):
    """Return by which share another answer costs more; its K is put on the exact limit, so that both are as robust."""
    gain, tn, tv = found
    omega, response = response_grid(problem.plants, tv > 0.0, 8.0)
    space = continuous.space_for(len(omega), problem.heaters, 2.0)
    count = compile_function(continuous.pieces, calls=True)(omega, response, tn, tv, problem.limits, space)
    ends = zip(*space.ends[:, :count][:, ::-1].tolist(), strict=True)
    kept = min([gain, *[top for bottom, top in ends if gain > bottom][:1]])
    return priced(problem, (kept, tn, tv), 2.0) / problem.cost(design) - 1.0


def unsolved(dead, structure):
    plant = Fopdt(gain_degC_per_pct=1.0, time_constant_s=1.0, dead_time_s=dead)
    return ContinuousProblem(plants=(plant,), structure=structure, specs=Specs(ms=MS))


def case(dead, structure):
    problem = unsolved(dead, structure)
    return problem, global_optimum(problem)[0]


def from_ours(dead, structure, design):
    """Return IPOPT's answer from 2 % beside our optimum, Ms kept on eight times the frequencies, and whether it ended."""
    numbers = [design.gain_pct_per_degC, design.integral_time_s, design.derivative_time_s][: 3 if structure == "pid" else 2]
    return by_ipopt(ipopt_solver(dead, structure, 8.0), np.log(numbers) + 0.02 * np.array([-1.0, 1.0, -1.0])[: len(numbers)])


def compare():
    print(f"{'':4} {'L/T':>5}  {'here':>9} {'SLSQP':>9} {'IPOPT':>9}   {'SLSQP':>7} {'IPOPT':>7}   "
          "their cost above ours: SLSQP, IPOPT, IPOPT from beside ours on 8 times the frequencies")
    largest = 0.0
    for structure in ("pi", "pid"):
        for dead in (0.1, 0.3, 1.0, 3.0):
            problem, design = case(dead, structure)
            # each time another heater, by its ninth digit: what is kept of one does not help the next
            fresh = iter([unsolved(dead * (1.0 + 1e-9 * k), structure) for k in range(20)])
            ours, _ = timed(lambda fresh=fresh: optimum(next(fresh)), 20)
            by_slsqp(problem, dead, structure)
            slsqp, found = timed(lambda p=problem, d=dead, s=structure: by_slsqp(p, d, s), 2)
            solver = ipopt_solver(dead, structure)
            ipopt, (other, ended) = timed(lambda s=solver, d=dead, t=structure: by_ipopt(s, start(d, t)), 2)
            near = beside(problem, design, from_ours(dead, structure, design)[0])
            largest = max(largest, abs(near))
            told = f"{beside(problem, design, found):+.1e}, {beside(problem, design, other):+.1e}, {near:+.1e}"
            print(f"{structure:4} {dead:5.2f}  {1e3 * ours:6.2f} ms {1e3 * slsqp:6.1f} ms {1e3 * ipopt:6.0f} ms   "
                  f"{slsqp / ours:6.0f}× {ipopt / ours:6.0f}×   {told}{'' if ended else ', IPOPT not converged'}", flush=True)
    print(f"largest relative difference of the costs, ours and IPOPT's from beside ours: {largest:.1e}")


def random_heaters(count, seed=7):
    """Return heaters with dead time/time constant log-uniform in 0.01…10, each with a limit on Ms in 1.1…2.2."""
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(count):
        lag = float(np.exp(rng.uniform(0.0, math.log(3000.0))))
        plant = Fopdt(gain_degC_per_pct=float(np.exp(rng.uniform(-3.0, 3.0))), time_constant_s=lag,
                      dead_time_s=lag * float(np.exp(rng.uniform(math.log(0.01), math.log(10.0)))))
        found.append((plant, float(rng.uniform(1.1, 2.2))))
    return found


def judged(plant, ms, structure):
    """Return "" for a design that keeps its limit and comes to rest, else what is wrong; and the sentence, if any."""
    problem = ContinuousProblem(plants=(plant,), structure=structure, specs=Specs(ms=ms))
    try:
        design, told = global_optimum(problem)
    except InputError as refused:
        return "", str(refused)
    found = margins((plant,), design)[0].ms
    if not found <= ms:
        return f"Ms = {found:.5g} above its limit of {ms:.5g}", told
    cost, least = problem.cost(design), design.integral_time_s / design.gain_pct_per_degC
    return ("" if least * (1.0 - 1e-9) <= cost < 100.0 * least else f"cost {cost:.4g} beside TN/K = {least:.4g}"), told


def heaters(count):
    begun, sentences = time.perf_counter(), {}
    for number, (plant, ms) in enumerate(random_heaters(count)):
        for structure in ("pi", "pid"):
            wrong, told = judged(plant, ms, structure)
            sentences[told] = sentences.get(told, 0) + 1
            if wrong:
                print(f"heater {number}, {structure}, {plant}: {wrong}", flush=True)
    print(f"{count} heaters, PI and PID, {time.perf_counter() - begun:.0f} s; how they ended:")
    for told, times in sentences.items():
        print(f"{times:6d}  {told}")


if __name__ == "__main__":
    asked = argparse.ArgumentParser()
    asked.add_argument("--heaters", type=int, metavar="COUNT")
    count = asked.parse_args().heaters
    compare() if count is None else heaters(count)
