"""SciPy's filters are the second implementation: the fit's own give the same, bit for bit, and need no half second of import."""

import numpy as np
import pytest
from scipy.ndimage import median_filter, uniform_filter1d
from scipy.optimize import brentq, least_squares
from scipy.signal import lfilter

from heatertune.model.model_values import TwoLag
from heatertune.model.power.explanation import _running_mean
from heatertune.model.power.feedback import _coloured
from heatertune.model.reduction import crossover_rad_s, match_fopdt
from heatertune.model.statistics import _median
from heatertune.pid.rules import ultimate_cycle

RNG = np.random.default_rng(4)


@pytest.mark.parametrize("count", [4, 5, 11, 25])
@pytest.mark.parametrize("rows", [30, 1801])
def test_running_medians_and_means_are_those_of_scipy(rows, count):
    values = RNG.normal(size=rows).round(1)
    assert np.array_equal(_median(values, count), median_filter(values, size=count, mode="nearest"))
    assert np.array_equal(_running_mean(values, count), uniform_filter1d(values, count, mode="nearest"))


@pytest.mark.parametrize("order", range(9))
def test_coloured_noise_is_that_of_scipy(order):
    whitening = np.concatenate([[1.0], RNG.normal(scale=0.1, size=order)])
    rows = RNG.normal(size=(20, 300))
    assert np.array_equal(_coloured(whitening, rows), lfilter([1.0], whitening, rows))


def _heaters():
    for _ in range(30):
        lag = 10.0 ** RNG.uniform(0.0, 4.0)
        yield TwoLag(gain_degC_per_pct=0.4, time_constant_s=lag, second_time_constant_s=lag * RNG.uniform(0.01, 1.0),
                     dead_time_s=lag * 10.0 ** RNG.uniform(-4.0, 1.5), ambient_degC=20.0)


def test_the_ultimate_cycle_is_the_root_that_scipy_finds():
    for heater in _heaters():
        def lacking(omega, heater=heater):
            return omega * heater.dead_time_s + sum(np.arctan(omega * lag) for lag in heater.lags_s) - np.pi

        omega = brentq(lacking, 0.0, np.pi / heater.dead_time_s, xtol=1e-300, rtol=1e-13)
        assert ultimate_cycle(heater)[1] == pytest.approx(2.0 * np.pi / omega, rel=1e-12)


def test_the_match_is_the_one_that_scipy_finds():
    for heater in _heaters():
        octaves = np.linspace(-2.0, 2.0, 60)
        omega = crossover_rad_s(heater) * 2.0 ** (0.5 * octaves)
        weight, response = np.exp(-0.5 * octaves**2), heater.frequency_response(omega)

        def error(z, heater=heater, omega=omega, weight=weight, response=response):
            one = heater.gain_degC_per_pct * np.exp(-1j * omega * z[1]) / (1.0 + 1j * omega * np.exp(z[0]))
            relative = weight * (one / response - 1.0)
            return np.concatenate([relative.real, relative.imag])

        found, start = match_fopdt(heater), heater.half_rule()
        best = least_squares(error, [np.log(start.time_constant_s), start.dead_time_s],
                             x_scale=[1.0, start.dead_time_s], xtol=1e-12, ftol=1e-12, gtol=1e-12).x
        assert found.time_constant_s == pytest.approx(np.exp(best[0]), rel=1e-5)
        assert found.dead_time_s == pytest.approx(best[1], rel=1e-5)
