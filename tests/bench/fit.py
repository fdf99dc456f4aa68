"""The fit of three parameters beside the usual scripts: python tests/bench/fit.py.

One descent from one start, warm: heatertune's output error with free ambient and initial state; scipy's curve_fit
around lfilter; curve_fit around odeint as course scripts have it. And the whole fit, multi-start, candidates and
intervals included. The log is a step up and down with white noise, made by superposing step answers.
"""

import argparse
import math
import time

import numpy as np
from identification import answer, course_script
from scipy.optimize import curve_fit
from scipy.signal import lfilter

from heatertune.log.log_values import Log
from heatertune.model.fit import fit
from heatertune.model.model_values import Fopdt
from heatertune.model.power.open_loop import PowerProblem
from heatertune.model.power.regressors import Readings

PLANT = Fopdt(gain_degC_per_pct=0.9, time_constant_s=180.0, dead_time_s=12.3, ambient_degC=20.0)
START = (0.6, 260.0, 8.0)
THINNED = 1000  # as the fit thins a long log


def made(rows):
    """Return a log of 3000 s."""
    t = np.linspace(0.0, 3000.0, rows)
    power = np.select([t < 300.0, t < 1500.0], [0.0, 60.0], 20.0)
    noise = np.random.default_rng(1).normal(0.0, 0.1, rows)
    temperature = answer(PLANT, t, power, 20.0) + noise
    return Log(name=f"{rows} rows", source="made", time_s=t, temperature_degC=temperature, power_pct=power)


def one_descent(log):
    """Return gain, time constant, dead time of one descent, the averaging of a long log included."""
    problem = PowerProblem(readings=Readings.of(log).average(THINNED))
    return _numbers(problem.refine(np.array([[math.log(START[1]), START[2], 0.0]])).model)


def whole_fit(log):
    """Return the same of the whole fit."""
    return _numbers(fit(log).model)


def by_lfilter(log):
    """Return the same by curve_fit around a first-order filter, the delayed power interpolated."""
    t, u, y = log.time_s, log.power_pct, log.temperature_degC
    h = t[1] - t[0]

    def simulated(_, gain, lag, dead):
        decay = math.exp(-h / lag)
        delayed = np.interp(t - dead, t, u, left=u[0])
        return y[0] + lfilter([0.0, gain * (1.0 - decay)], [1.0, -decay], delayed - u[0])

    return tuple(curve_fit(simulated, t, y, p0=START, bounds=([1e-4, 1.0, 0.0], [100.0, 3e4, 750.0]))[0])


def _numbers(model):
    return model.gain_degC_per_pct, model.time_constant_s, model.dead_time_s


def seconds(work, log, repeats):
    """Return the least time of some runs, and the result."""
    found = work(log)
    best = math.inf
    for _ in range(repeats):
        begun = time.perf_counter()
        work(log)
        best = min(best, time.perf_counter() - begun)
    return best, found


def main(arguments=None):
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--course-script", action="store_true", help="run odeint on 300 rows too (seconds)")
    settings = parser.parse_args(arguments)
    print("| rows | method | ms | ratio | gain, time constant, dead time |\n| --- | --- | --- | --- | --- |")
    for rows in (300, 3000, 30_000, 100_000):
        log, own = made(rows), None
        tried = [(one_descent, 20), (by_lfilter, 5), (whole_fit, 2)]
        if settings.course_script and rows == 300:
            tried.insert(2, (course_script, 1))
        for work, repeats in tried:
            spent, found = seconds(work, log, repeats)
            own = own or spent
            numbers = ", ".join(f"{value:.4g}" for value in found)
            print(f"| {rows} | {work.__name__} | {1e3 * spent:.3g} | {spent / own:.3g} | {numbers} |")


if __name__ == "__main__":
    main()
