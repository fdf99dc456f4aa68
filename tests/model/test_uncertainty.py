import numpy as np
import pytest
from tests.bench.identification import answer, noise

from heatertune.log.log_values import Log
from heatertune.model.model_values import Fopdt
from heatertune.model.power.open_loop import PowerProblem
from heatertune.model.power.regressors import Readings
from heatertune.model.power.uncertainty import _profile, bound_crossing, noise_of
from heatertune.model.statistics import ar1_weighted

PLANT = Fopdt(gain_degC_per_pct=0.5, time_constant_s=150.0, dead_time_s=12.0, ambient_degC=20.0)


def _profile_width(kind):
    time = np.arange(0.0, 1500.0, 4.0)
    power = np.select([time < 60, time < 500, time < 900, time < 1200], [0.0, 60.0, 10.0, 80.0], 30.0)
    y = answer(PLANT, time, power, 20.0) + noise(np.random.default_rng(1), kind, 0.3, len(time))
    problem = PowerProblem(readings=Readings.of(Log(name="", source="", time_s=time, temperature_degC=y, power_pct=power)))
    fit = problem.fit()
    found = _profile(problem, fit, "gain_degC_per_pct", noise_of(problem, fit))
    return found.high - found.low


@pytest.mark.long
def test_the_profile_alone_widens_with_the_noise_s_colour():
    # a mean of AR(1) noise with correlation 0.8 spreads by sqrt((1 + 0.8)/(1 - 0.8)) = 3 times as much as of white
    assert 2.0 < _profile_width("coloured") / _profile_width("white") < 4.5


def test_a_profile_that_never_rises_to_the_limit_leaves_the_end_open():
    values = np.array([1.0, 2.0, 3.0, 3.0])
    assert bound_crossing(values, np.array([0.0, 0.5, 0.9, 0.9]), 1.0) is None
    # a parabola rise = (x - 1)² meets 2.25 at 2.5, and its root is a straight line: exact
    assert bound_crossing(values, (values - 1.0) ** 2, 2.25) == pytest.approx(2.5, rel=1e-12)


def test_coloured_noise_by_shifts_is_the_product_with_its_whole_matrix():
    rows, rhos = np.random.default_rng(3).normal(size=(4, 37)), np.array([0.0, 0.5, 0.99])
    lags = np.abs(np.subtract.outer(np.arange(37), np.arange(37)))
    whole = np.array([rows @ rho**lags for rho in rhos])
    assert ar1_weighted(rows, rhos[:, None, None]) == pytest.approx(whole, rel=1e-12, abs=1e-12)
