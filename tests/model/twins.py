"""Twins of heaters made without the fit's own simulation: SciPy's lsim, and a loop closed by Euler's rule."""

import numpy as np
from scipy.signal import lsim, lti

from heatertune.log.log_values import Log

GAIN, LAG, DEAD, AMBIENT = 0.5, 150.0, 12.0, 20.0


def doublet(length=1500.0, sample=4.0):
    """Return instants and power: three steps up and down."""
    time = np.arange(0.0, length, sample)
    return time, np.select([time < 60, time < 500, time < 900, time < 1200], [0.0, 60.0, 10.0, 80.0], 30.0)


def coloured(seed, n, deviation):
    """Return AR(1) noise with correlation 0.8."""
    white = np.random.default_rng(seed).normal(0.0, deviation * 0.6, n + 50)
    for i in range(1, len(white)):
        white[i] += 0.8 * white[i - 1]
    return white[50:]


def logged(time, power, *, second=0.0, dead=DEAD, gain=GAIN, lag=LAG, noise=0.0, name="twin"):
    """Return the log of a heater of one lag or two, from rest without power."""
    fine = np.arange(0.0, time[-1] + 1.0, 0.5)
    held = power[np.clip(np.searchsorted(time, fine - dead + 1e-9, side="right") - 1, 0, None)]
    plant = lti([gain], np.polymul([lag, 1.0], [second, 1.0]) if second else [lag, 1.0])
    temperature = AMBIENT + np.interp(time, fine, lsim(plant, held, fine, interp=False)[1]) + noise
    return Log(name=name, source="lsim", time_s=time, temperature_degC=temperature, power_pct=power)


def closed_loop(*, load_degC=0.0, wall=False, noise=0.03, length=2400.0):
    """Return the log of a PI loop at 50 °C (4 %/°C, 200 s, every 4 s), begun cold; Euler's rule in steps of 0.5 s.

    The load sets in at 1300 s. With a wall, 0.3 °C/% come within 90 s and 0.2 °C/% through a mass of 900 s.
    """
    step, y, w, integral, powers, rows = 0.5, AMBIENT, AMBIENT, 0.0, [], []
    shaken = np.random.default_rng(2).normal(0.0, noise, int(length / 4.0) + 1)
    for k in range(int(length / step)):
        if k % 8 == 0:
            reading = y + shaken[k // 8]
            asked = 4.0 * (50.0 - reading) + integral
            integral += 4.0 * (50.0 - reading) * 4.0 / 200.0 * (0.0 < asked < 100.0)
            rows.append((reading, min(max(asked, 0.0), 100.0)))
        powers.append(rows[-1][1])
        acting = powers[k - 24] if k >= 24 else 0.0
        load = load_degC * (k * step > 1300.0)
        if wall:
            y, w = y + step * (0.3 * acting + load + w - y) / 90.0, w + step * (AMBIENT + 0.2 * acting - w) / 900.0
        else:
            y += step * (AMBIENT + GAIN * acting + load - y) / LAG
    temperature, power = np.array(rows).T
    time = 4.0 * np.arange(len(rows))
    return Log(name="loop", source="Euler", time_s=time, temperature_degC=temperature, power_pct=power)
