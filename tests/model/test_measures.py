import control
import numpy as np
import pytest

from heatertune.model.model_values import Fopdt, TwoLag
from heatertune.model.reduction import COMBINATIONS, ultimate_period_s


@pytest.mark.parametrize("plant", [
    Fopdt(gain_degC_per_pct=0.4, time_constant_s=166.0, dead_time_s=14.4),
    TwoLag(gain_degC_per_pct=0.78, time_constant_s=452.0, second_time_constant_s=79.0, dead_time_s=12.9),
], ids=["one lag", "two lags"])
def test_the_ultimate_period_is_that_of_python_control(plant):
    s = control.tf("s")
    numerator, denominator = control.pade(plant.dead_time_s, 12)  # exact to some 1e-9 at this frequency
    loop = plant.gain_degC_per_pct * control.tf(numerator, denominator)
    for lag in plant.lags_s:
        loop = loop / (lag * s + 1.0)
    _, _, crossover, _ = control.margin(loop)
    assert ultimate_period_s(plant) == pytest.approx(2.0 * np.pi / crossover, rel=1e-6)


def test_two_lags_without_dead_time_have_no_ultimate_period():
    plant = TwoLag(gain_degC_per_pct=1.0, time_constant_s=100.0, second_time_constant_s=10.0, dead_time_s=0.0)
    assert ultimate_period_s(plant) == np.inf


def test_the_effective_dead_time_is_that_of_the_half_rule():
    # the joint fit of the identification page: 452 s, 79 s, dead time 12.9 s become an effective dead time of 52.4 s
    plant = TwoLag(gain_degC_per_pct=0.78, time_constant_s=452.0, second_time_constant_s=79.0, dead_time_s=12.9)
    assert COMBINATIONS["effective_dead_time_s"](plant) == pytest.approx(52.4)
    assert COMBINATIONS["gain_per_time_constant_degC_per_s_pct"](plant) == pytest.approx(0.78 / 491.5)
