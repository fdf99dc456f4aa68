"""The continuous loop on paper: exact frequency response, exact dead time; nothing of heatertune's own loop in it."""

import math

import numpy as np
from numba import njit
from scipy.optimize import minimize_scalar

from heatertune.model.model_values import Fopdt, TwoLag


def one_lag(ratio, *, gain=1.0, lag=1.0):
    """A heater with one lag and a dead time of so much of it."""
    return Fopdt(gain_degC_per_pct=gain, time_constant_s=lag, dead_time_s=ratio * lag)


def two_lags(first, second, *, dead=1.0, gain=1.0):
    return TwoLag(gain_degC_per_pct=gain, time_constant_s=first, second_time_constant_s=second, dead_time_s=dead)


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


@njit
def _respond(gain, rate, tv, k, decays, delay, h, count, setpoint, load, on_measurement):
    y, u, states = np.zeros(count), np.zeros(count), np.zeros(len(decays))
    summed = differential = last = 0.0
    for i in range(count):
        y[i] = states[-1]
        error = setpoint - y[i]
        summed += rate * error
        if tv > 0.0:
            moved = -y[i] if on_measurement else error
            differential = tv * (moved - last) / h
            last = moved
        u[i] = gain * (error + summed + differential) + load
        through = k * (u[i - delay] if i >= delay else 0.0)
        for j in range(len(decays)):
            states[j] = decays[j] * states[j] + (1.0 - decays[j]) * through
            through = states[j]
    return y


def respond(settings, k, lags, dead, *, until, setpoint=0.0, load=0.0, parts=200, on_measurement=False):
    """Time and deviation after a step, each lag exact over steps of dead time/parts, D without filter."""
    h, (gain, tn, tv) = dead / parts, settings
    count = round(until / h)
    decays = np.exp(-h / np.array(lags, dtype=float))
    y = _respond(gain, h / tn, tv, k, decays, parts, h, count, setpoint, load, on_measurement)
    return h * np.arange(count), y


def criterion(name, time, error):
    """IAE, ISE or ITAE of an error over time."""
    weight = {"iae": np.abs(error), "ise": error**2, "itae": time * np.abs(error)}[name]
    return float(np.sum(weight) * (time[1] - time[0]))


def swings(deviation):
    """The extremes of a swinging response in their order: sign changes of its slope, the largest |value| between."""
    slope = np.sign(np.diff(deviation))
    turns = np.flatnonzero(slope[1:] * slope[:-1] < 0) + 1
    return deviation[turns]


def decay_ratio(settings, k, lags, dead):
    """How much of a swing is left one period later: e^(2π·Re s/Im s) of the least damped root of 1 + L(s) = 0."""
    real, imaginary = np.meshgrid(np.linspace(-3.0, 0.2, 25), np.linspace(0.2, 4.0, 30))
    s = (real + 1j * imaginary).ravel() / dead

    def lacking(at):
        return 1.0 + controller(settings, at) * plant(k, lags, dead, at)

    for _ in range(60):
        step = 1e-6 * np.abs(s)
        value = lacking(s)
        move = value * step / (lacking(s + step) - value)
        s = s - move / np.maximum(1.0, np.abs(move) * dead / 0.2)  # Newton, no step too wide
    roots = s[(np.abs(lacking(s)) < 1e-8) & (s.imag > 1e-3 / dead)]
    return float(np.max(np.exp(2.0 * math.pi * roots.real / roots.imag), initial=0.0))
