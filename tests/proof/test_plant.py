import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from heatertune.heater import exact
from heatertune.heater.exact import turning_times
from heatertune.proof.kernel import HEAT, LOAD, apply_event
from heatertune.proof.plant import Flow, advance_heater, factors, plant_from, turn

lags = st.floats(1.0, 1e4)
degrees = st.floats(-50.0, 300.0)
seconds = st.floats(0.0, 1e4)


def advance(y, x, target, t, first, second):
    """(y, x) after t seconds, by the kernel's own functions."""
    heater = plant_from(1.0, first, second, 0.0, 0.0)
    after = advance_heater(Flow(0.0, y, x, target, 0.0, 0.0), t, factors(t, heater))
    return after.y, after.x


def _integrated(y, x, target, t, first, second):
    def slope(_, state):
        return [(state[1] - state[0]) / first, (target - state[1]) / second]

    return solve_ivp(slope, (0.0, t), [y, x], rtol=1e-11, atol=1e-11).y[:, -1]


@pytest.mark.parametrize("second", [40.0, 99.0, 100.0 * (1 - 1e-6), 100.0, 0.5])
@pytest.mark.parametrize("t", [0.3, 25.0, 400.0])
def test_two_lags_agree_with_an_ode_solver(second, t):
    assert advance(30.0, 55.0, 70.0, t, 100.0, second) == pytest.approx(
        _integrated(30.0, 55.0, 70.0, t, 100.0, second), abs=1e-7
    )


def test_one_lag_covers_63_percent_of_its_way_in_one_time_constant():
    assert advance(20.0, 0.0, 120.0, 50.0, 50.0, 0.0)[0] == pytest.approx(20.0 + 100.0 * (1.0 - math.exp(-1.0)))


@given(y=degrees, x=degrees, target=degrees, first=lags, share=st.floats(1e-6, 1.0), t=seconds, more=seconds)
def test_two_stretches_are_one_longer_stretch(y, x, target, first, share, t, more):
    at_once = advance(y, x, target, t + more, first, share * first)
    one_by_one = advance(*advance(y, x, target, t, first, share * first), target, more, first, share * first)
    assert one_by_one == pytest.approx(at_once, abs=1e-9)


@given(first=lags, t=seconds)
def test_lags_that_are_nearly_equal_go_over_into_equal_ones(first, t):
    equal = advance(20.0, 90.0, 60.0, t, first, first)
    assert advance(20.0, 90.0, 60.0, t, first, first * (1.0 - 1e-12)) == pytest.approx(equal, abs=1e-9)


def test_a_second_lag_that_is_very_fast_leaves_one_lag():
    one = advance(20.0, 0.0, 60.0, 30.0, 1e4, 0.0)[0]
    assert advance(20.0, 20.0, 60.0, 30.0, 1e4, 1e-6)[0] == pytest.approx(one, abs=1e-6)


@pytest.mark.parametrize("second", [0.0, 40.0, 100.0])
def test_arrays_and_numbers_take_the_same_formula(second):
    times = np.array([0.0, 1.0, 70.0])
    many = exact.advance(np.full(3, 20.0), np.full(3, 50.0), np.full(3, 60.0), times, 100.0, second)
    assert many.tolist() == pytest.approx([advance(20.0, 50.0, 60.0, t, 100.0, second)[0] for t in times], abs=1e-12)


@pytest.mark.parametrize("second", [40.0, 100.0])
def test_the_temperature_turns_where_both_lags_meet(second):
    after = turning_times(np.array([50.0]), np.array([60.0]), np.array([20.0]), 100.0, second)[0]
    y, x = advance(50.0, 60.0, 20.0, after, 100.0, second)
    assert y == pytest.approx(x, abs=1e-9)
    grid = [advance(50.0, 60.0, 20.0, t, 100.0, second)[0] for t in np.linspace(0.0, 500.0, 5001)]
    assert max(grid) == pytest.approx(y, abs=1e-4)
    assert max(grid) <= y


def test_a_temperature_on_its_way_down_does_not_turn():
    assert np.isnan(turning_times(np.array([60.0]), np.array([50.0]), np.array([20.0]), 100.0, 40.0)).all()


@pytest.mark.parametrize("second", [40.0, 100.0])
def test_the_turn_between_two_instants_is_the_one_of_the_whole_stretch(second):
    heater = plant_from(1.0, 100.0, second, 0.0, 0.0)
    begin = Flow(7.0, 50.0, 60.0, 20.0, 0.0, 0.0)
    expected = 7.0 + turning_times(np.array([50.0]), np.array([60.0]), np.array([20.0]), 100.0, second)[0]
    early, late = (advance_heater(begin, t, factors(t - 7.0, heater)) for t in (expected - 1.0, expected + 1.0))
    assert turn(early, late, heater) == pytest.approx(expected, abs=1e-9)
    assert turn(begin, early, heater) == math.inf
    assert turn(early, late, heater._replace(second=0.0)) == math.inf


def test_mains_change_the_heaters_power_and_neither_a_load_nor_a_cooler():
    # 1 °C/% from 20 °C: at 81 % of the power full power leads by 81 °C, a draught takes 10 °C as at any voltage, a cooler 50 °C
    heater, low_mains = plant_from(1.0, 100.0, 0.0, 0.0, 20.0), Flow(0.0, 60.0, 60.0, 101.0, 100.0, 0.0, 0.81)
    assert apply_event(heater, low_mains, LOAD, -10.0).target == pytest.approx(20.0 + 81.0 - 10.0)
    assert apply_event(heater, low_mains._replace(load=-10.0), HEAT, -50.0).target == pytest.approx(20.0 - 50.0 - 10.0)
