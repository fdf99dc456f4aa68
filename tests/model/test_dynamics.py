"""A heater asked for its answer: witnesses are python-control's own simulations and SciPy's lsim."""

import control
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.signal import lsim, lti

from heatertune.errors import InputError, OutOfRange
from heatertune.model.model_values import Fopdt, TwoLag, model_by_hand

ONE = Fopdt(gain_degC_per_pct=0.4, time_constant_s=100.0, dead_time_s=12.3, ambient_degC=20.0)
TWO = TwoLag(gain_degC_per_pct=0.4, time_constant_s=100.0, second_time_constant_s=30.0, dead_time_s=8.0)
EQUAL = TwoLag(gain_degC_per_pct=0.4, time_constant_s=50.0, second_time_constant_s=50.0, dead_time_s=0.0)


@pytest.mark.parametrize("heater", [ONE, TWO, EQUAL])
def test_a_step_is_lsims(heater):
    time = np.linspace(0.0, 600.0, 601)
    lags = np.poly1d([1.0])
    for lag in heater.lags_s:
        lags *= np.poly1d([lag, 1.0])
    expected = lsim(lti([heater.gain_degC_per_pct], lags.coeffs), np.ones(601), time)[1]
    assert heater.step(time + heater.dead_time_s) == pytest.approx(expected, abs=1e-9)
    assert heater.step(0.999 * heater.dead_time_s, power_pct=80.0) == 0.0


@given(st.floats(1e-9, 1.0), st.floats(0.0, 5.0), st.floats(0.1, 30.0))
@example(ratio=1.0, dead=1.1249999701976776, interval=0.375)  # power that arrives 3e-8 s before an instant: -9e-17 degC
@pytest.mark.long
def test_a_sampled_heater_is_exact_whatever_the_dead_time(ratio, dead, interval):
    heater = TwoLag(gain_degC_per_pct=1.0, time_constant_s=20.0, second_time_constant_s=20.0 * ratio, dead_time_s=dead)
    time = interval * np.arange(12)
    _, seen = control.step_response(heater.to_tf(sample_time_s=interval), T=time)
    assert seen == pytest.approx(heater.step(time), abs=1e-9)


def test_a_continuous_heater_has_pythons_control_pade():
    time = np.linspace(0.0, 500.0, 300)
    for system in (TWO.to_tf(pade=4), TWO.to_ss(pade=4)):
        assert control.step_response(system, T=time)[1] == pytest.approx(TWO.step(time), abs=2e-4)
    assert np.asarray(EQUAL.to_tf().num[0][0]) == pytest.approx([0.4])
    assert control.dcgain(ONE.to_ss(sample_time_s=5.0)) == pytest.approx(0.4)


# neither is a stated order since 0.12.0, as users of python-control expect of a continuous system: tests/chain/test_control_objects.py
@pytest.mark.parametrize("asked", [{"pade": 2, "sample_time_s": 1.0}])
def test_a_dead_time_has_to_be_taken_in_one_way(asked):
    with pytest.raises(OutOfRange, match="exact dead time"):
        ONE.to_tf(**asked)


@pytest.mark.parametrize("order", [0, -1])
def test_no_order_leaves_the_dead_time_out(order):
    with pytest.raises(OutOfRange, match="pade"):
        ONE.to_tf(pade=order)


def test_a_course_of_power_is_answered_as_lsim_does():
    time = np.arange(0.0, 3000.0, 2.5)
    power = np.random.default_rng(1).integers(0, 2, len(time)) * 60.0
    fine = np.arange(0.0, 3000.0, 0.1)
    late = power[np.clip(((fine - ONE.dead_time_s) / 2.5 + 1e-9).astype(int), 0, None)]
    late[fine < ONE.dead_time_s - 1e-9] = power[0]
    expected = 20.0 + lsim(lti([0.4], [100.0, 1.0]), late, fine, X0=[power[0] * 0.4], interp=False)[1]
    assert model_by_hand(ONE).predict(time, power) == pytest.approx(np.interp(time, fine, expected), abs=1e-6)


def test_what_cannot_be_predicted_says_why():
    with pytest.raises(InputError, match="ambient"):
        TWO.predict([0.0, 1.0], [0.0, 5.0])
    with pytest.raises(OutOfRange, match="increasing"):
        ONE.predict([0.0, 0.0], [0.0, 5.0])
    with pytest.raises(OutOfRange, match="one power for each"):
        ONE.predict([0.0, 1.0], [5.0])
    with pytest.raises(OutOfRange, match="100"):
        ONE.predict([0.0, 1.0], [0.0, 101.0])
