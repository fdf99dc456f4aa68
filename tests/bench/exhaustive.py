"""Whether the fit of a log with power ends where a search of everything ends: python tests/bench/exhaustive.py.

Heaters of one lag and of two are drawn, their logs made by superposing step answers. The judge shares nothing with the
fit: step answers by their formulas, the linear unknowns by NumPy's least squares, every lag, dead time and ratio of a
dense grid, and SciPy's simplex from the best of them. Told is by how much the fit's sum of squares is above the least
one; so it is for logs whose residuals were drawn anew, as the intervals' bootstrap does.
"""

import argparse
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from heatertune.log.log_values import Log
from heatertune.model.power.open_loop import PowerProblem
from heatertune.model.power.regressors import Readings

DRAWN = 5  # records of one heater, of new noise
GRID, RATIOS, BEST = 48, (0.02, 0.06, 0.15, 0.3, 0.5, 0.7, 0.9), 6


@dataclass(frozen=True)
class Case:
    """Instants [s], held power [%], readings without noise and with it (first, then those drawn anew)."""

    time: np.ndarray
    power: np.ndarray
    records: np.ndarray
    two_lags: bool


def step_answer(since, first, second):
    """Return the answer to a unit step, of one lag where the second is 0."""
    t = np.maximum(since, 0.0)
    if second == 0.0:
        return 1.0 - np.exp(-t / first)
    if abs(first - second) < 1e-6 * first:
        return 1.0 - (1.0 + t / first) * np.exp(-t / first)
    return 1.0 - (first * np.exp(-t / first) - second * np.exp(-t / second)) / (first - second)


def columns(time, power, first, second, dead):
    """Return what is weighted and added: answer to the power, ambient, and a free state for each lag; shape (m, 3 or 4)."""
    moved = np.flatnonzero(np.diff(power)) + 1
    rise = np.full(len(time), float(power[0]))
    for i in moved:
        rise += (power[i] - power[i - 1]) * step_answer(time - time[i] - dead, first, second)
    free = [np.exp(-(time - time[0]) / lag) for lag in (first, second) if lag > 0.0]
    return np.column_stack([rise, np.ones(len(time)), *free])


def squares(case, record, log_lag, dead, ratio):
    """Return the least sum of squares for lags and dead time, infinite where the heater would cool."""
    lag = float(np.exp(log_lag))
    basis = columns(case.time, case.power, lag, ratio * lag, dead)
    weights = np.linalg.lstsq(basis, record, rcond=None)[0]
    return float(np.sum((record - basis @ weights) ** 2)) if weights[0] > 0.0 else np.inf


def make(seed, *, two_lags):
    """Return the case of a seed: two steps of the power, readings at even or uneven instants, noise."""
    rng = np.random.default_rng([seed, two_lags])
    lag = float(np.exp(rng.uniform(np.log(30.0), np.log(600.0))))
    second, dead = two_lags * lag * float(rng.uniform(0.05, 0.9)), lag * float(rng.uniform(0.03, 0.5))
    n, length = int(rng.integers(90, 160)), lag * float(rng.uniform(4.0, 8.0))
    time = np.linspace(0.0, length, n)
    if rng.random() < 0.5:
        time[1:-1] += rng.uniform(-0.4, 0.4, n - 2) * length / n
    power = np.select([time < 0.1 * length, time < 0.5 * length], rng.uniform(0.0, 100.0, 2), rng.uniform(0.0, 100.0))
    basis = columns(time, power, lag, second, dead)
    clean = basis @ np.array([rng.uniform(0.2, 2.0), rng.uniform(15.0, 30.0), *rng.uniform(-20.0, 20.0, basis.shape[1] - 2)])
    noise = rng.uniform(0.002, 0.02) * float(np.ptp(clean)) * rng.normal(size=(1 + DRAWN, n))
    return Case(time=time, power=power, records=clean + noise, two_lags=two_lags)


def least(case, record, low, high):
    """Return the least sum of squares of everything within the bounds (ln lag, dead time, ratio)."""
    ratios = RATIOS if case.two_lags else (0.0,)
    tried = [(squares(case, record, lag, dead, ratio), lag, dead, ratio)
             for lag in np.linspace(low[0], high[0], GRID)
             for dead in low[1] + np.linspace(0.0, 1.0, GRID) ** 2 * (high[1] - low[1]) for ratio in ratios]
    free = np.flatnonzero(high > low)
    found = []
    for _, *start in sorted(tried)[:BEST]:
        place, span = np.array(start), np.diag((high - low)[free])

        def cost(z, place=place):
            whole = place.copy()
            whole[free] = np.clip(z, low[free], high[free])
            return squares(case, record, *whole)

        for size in (0.03, 0.003, 0.0003):  # a simplex that has come to lie in a kink is begun anew
            corners = np.vstack([place[free], place[free] + size * span])
            place[free] = np.clip(minimize(cost, place[free], method="Nelder-Mead", options={
                "initial_simplex": corners, "xatol": 1e-9, "fatol": 1e-12, "maxiter": 400}).x, low[free], high[free])
        found.append(squares(case, record, *place))
    return min(found)


def above(case):
    """Return by what share the fit's sum of squares is above the least: of the log, and of its records drawn anew."""
    log = Log(name="drawn", source="made", time_s=case.time, temperature_degC=case.records[0], power_pct=case.power)
    problem = PowerProblem(readings=Readings.of(log), two_lags=case.two_lags)
    best = problem.fit()
    vectors = problem.minimum(np.tile(best.vector, (DRAWN, 1)), case.records[1:])
    ours = [squares(case, record, *vector) for record, vector in zip(case.records, [best.vector, *vectors], strict=True)]
    return [one / least(case, record, problem.low, problem.high) - 1.0 for one, record in zip(ours, case.records, strict=True)]


def main(given=None):
    asked = argparse.ArgumentParser()
    asked.add_argument("--heaters", type=int, default=20)
    settings = asked.parse_args(given)
    for two_lags in (False, True):
        shares = np.array([above(make(seed, two_lags=two_lags)) for seed in range(settings.heaters)])
        for name, part in (("the log", shares[:, 0]), ("drawn anew", shares[:, 1:].ravel())):
            print(f"{'two lags' if two_lags else 'one lag'}, {name}: {len(part)} fits, median {np.median(part):.1e}, largest "
                  f"{part.max():.1e} above the least sum of squares")


if __name__ == "__main__":
    main()
