"""The continuous loop on paper: exact frequency response, exact dead time; nothing of heatertune's own loop in it."""

import math

import numpy as np
from scipy.optimize import minimize_scalar

FILTER = 10.0  # N of the derivative filter TV/N where a test asks for one


def controller(settings, s, n=math.inf):
    gain, tn, tv = settings
    return gain * (1.0 + (0.0 if math.isinf(tn) else 1.0 / (tn * s)) + tv * s / (1.0 + tv * s / n))


def plant(k, lags, dead, s):
    found = k * np.exp(-dead * s)
    for lag in lags:
        found = found / (lag * s + 1.0)
    return found


def peak(function, omega):
    """The largest value of a function of ω: a grid, then a scalar search around its best points."""
    values = function(omega)
    best = float(values.max())
    for i in np.argsort(values)[-3:]:
        low, high = omega[max(i - 1, 0)], omega[min(i + 1, len(omega) - 1)]
        found = minimize_scalar(lambda w: -float(function(np.array([w]))[0]), bounds=(low, high), method="bounded",
                                options={"xatol": 1e-10 * high})
        best = max(best, -found.fun)
    return best


def margins(settings, k, lags, dead, n=math.inf):
    """Ms, Mt, gain margin and phase margin [°] of a stable loop."""
    omega = np.geomspace(1e-4 / (sum(lags) + dead), 60.0 / dead, 20_000)

    def loop(w):
        return controller(settings, 1j * w, n) * plant(k, lags, dead, 1j * w)

    ms = peak(lambda w: 1.0 / np.abs(1.0 + loop(w)), omega)
    mt = peak(lambda w: np.abs(loop(w) / (1.0 + loop(w))), omega)
    response = loop(omega)
    phase, size = np.unwrap(np.angle(response)), np.abs(response)
    phase -= 2.0 * math.pi * round((phase[0] + math.pi / 2.0) / (2.0 * math.pi))
    at = np.interp(math.pi, -phase, size)
    pm = 180.0 + math.degrees(np.interp(0.0, -np.log(size), phase))
    return ms, mt, 1.0 / at, pm


def respond(settings, k, lags, dead, *, until, steps_per_dead=200, setpoint=0.0, load=0.0):
    """Deviation of the process variable after a step: time, response; RK-free, exact lags, small steps."""
    h = dead / steps_per_dead
    count = round(until / h)
    gain, tn, tv = settings
    y, states = np.zeros(count), [0.0] * len(lags)
    decays = [math.exp(-h / lag) for lag in lags]
    u = np.zeros(count)
    summed = last = 0.0
    filtered = 0.0
    for i in range(count):
        y[i] = states[-1]
        error = setpoint - y[i]
        if i == 0:
            last = 0.0
        summed += h * error / tn if math.isfinite(tn) else 0.0
        smooth = max(tv / FILTER, 0.0)
        if tv > 0.0:
            filtered = (smooth * filtered + tv * (error - last)) / (smooth + h)
        last = error
        u[i] = gain * (error + summed + filtered) + load
        through = k * (u[i - steps_per_dead] if i >= steps_per_dead else 0.0)
        for j, decay in enumerate(decays):
            states[j] = decay * states[j] + (1.0 - decay) * through
            through = states[j]
    return h * np.arange(count), y
