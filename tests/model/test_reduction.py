"""python-control's frequency response is the second implementation."""

import control
import numpy as np
import pytest

from heatertune.model.model_values import Fopdt, TwoLag
from heatertune.model.reduction import crossover_rad_s, match_fopdt

HEATER = TwoLag(gain_degC_per_pct=0.78, time_constant_s=452.0, second_time_constant_s=79.0, dead_time_s=12.9, ambient_degC=24.0)


def _response(model, omega):
    plant = control.tf([model.gain_degC_per_pct], [1.0])
    for lag in model.lags_s:
        plant = plant * control.tf([1.0], [lag, 1.0])
    return plant(1j * omega) * np.exp(-1j * omega * model.dead_time_s)


def _distance(first, second, omega):
    return np.max(np.abs(_response(first, omega) / _response(second, omega) - 1.0))


@pytest.mark.parametrize("model", [
    HEATER, Fopdt(gain_degC_per_pct=0.37, time_constant_s=167.0, dead_time_s=12.0),
    TwoLag(gain_degC_per_pct=1.0, time_constant_s=100.0, second_time_constant_s=100.0, dead_time_s=0.0),
])
def test_the_crossover_is_where_the_heater_lags_by_120_degrees(model):
    omega = crossover_rad_s(model)
    behind = np.unwrap(np.angle(_response(model, np.geomspace(1e-6, omega, 4000))))[-1]
    assert np.degrees(behind) == pytest.approx(-120.0, abs=1e-3)


@pytest.mark.parametrize("second", [5.0, 79.0, 452.0])
def test_the_match_is_nearer_than_the_half_rule_where_loops_are_cut(second):
    model = TwoLag(gain_degC_per_pct=0.78, time_constant_s=452.0, second_time_constant_s=second, dead_time_s=12.9)
    near = np.geomspace(0.5, 2.0, 50) * crossover_rad_s(model)
    assert _distance(match_fopdt(model), model, near) < 0.7 * _distance(model.half_rule(), model, near)
    assert match_fopdt(model).gain_degC_per_pct == 0.78


def test_a_small_second_lag_is_dead_time():
    # the limit case: a lag far above the crossover delays by itself and does nothing else
    model = TwoLag(gain_degC_per_pct=0.5, time_constant_s=300.0, second_time_constant_s=0.3, dead_time_s=20.0)
    found = match_fopdt(model)
    assert found.time_constant_s == pytest.approx(300.0, rel=1e-2)
    assert found.dead_time_s == pytest.approx(20.3, abs=0.1)


def test_one_lag_is_its_own_match():
    model = Fopdt(gain_degC_per_pct=0.37, time_constant_s=167.0, dead_time_s=0.0, ambient_degC=20.0)
    assert match_fopdt(model) == model
