import math
from types import SimpleNamespace

import control
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from heatertune.errors import InputError, OutOfRange
from heatertune.model.experiment.fisher import rise, rows_of
from heatertune.model.model_values import Fopdt, TwoLag
from heatertune.model.relay_test import TwoLevelRelay, _ConstantPowerResponse, _RelayState, oscillation, simulate_relay
from heatertune.model.temperature.closed_loop import Constant, simulate_many

ONE = Fopdt(gain_degC_per_pct=0.5, time_constant_s=150.0, dead_time_s=20.0, ambient_degC=20.0)
TWO = TwoLag(
    gain_degC_per_pct=0.5, time_constant_s=150.0, second_time_constant_s=50.0, dead_time_s=10.0, ambient_degC=20.0
)
SKEW = TwoLevelRelay(setpoint_degC=38.0, hysteresis_degC=0.5, high_pct=80.0, low_pct=5.0)
EVEN = TwoLevelRelay(setpoint_degC=45.0, hysteresis_degC=0.5, high_pct=80.0, low_pct=20.0)


@pytest.mark.parametrize("model", [ONE, TWO], ids=["one lag", "two lags"])
@pytest.mark.parametrize("relay", [SKEW, EVEN], ids=["asymmetric", "symmetric"])
def test_the_relay_switches_at_the_very_crossings(model, relay):
    # the temperature at each switch by superposition of steps (held against SciPy in test_response)
    schedule = simulate_relay(model, relay, 2000.0)
    assert len(schedule.time_s) > 15
    at = 20.0 + rise(rows_of([model]), schedule, schedule.time_s)[0]
    assert at[1::2] == pytest.approx(relay.off_degC, abs=1e-6)
    assert at[2::2] == pytest.approx(relay.on_degC, abs=1e-6)
    assert set(schedule.power_pct[::2]) == {80.0}
    assert set(schedule.power_pct[1::2]) == {relay.low_pct}
    # and nowhere between two switches is a threshold passed unseen
    fine = np.arange(0.0, 2000.0, 0.5)
    temperature, power = 20.0 + rise(rows_of([model]), schedule, fine)[0], schedule.at(fine)
    late = fine > schedule.time_s[1]
    assert temperature[late & (power == 80.0)].max() <= relay.off_degC + 1e-6
    assert temperature[late & (power < 80.0)].min() >= relay.on_degC - 1e-6


@pytest.mark.long
@pytest.mark.parametrize("relay", [SKEW, EVEN], ids=["asymmetric", "symmetric"])
def test_the_closed_form_is_the_simulated_oscillation(relay):
    schedule, found = simulate_relay(ONE, relay, 3000.0), oscillation(ONE, relay)
    lengths = np.diff(schedule.time_s)
    assert lengths[2::2] == pytest.approx(found.on_s, abs=1e-6)
    assert lengths[1::2] == pytest.approx(found.off_s, abs=1e-6)
    fine = np.arange(schedule.time_s[-6], schedule.time_s[-1], 0.01)
    temperature = 20.0 + rise(rows_of([ONE]), schedule, fine)[0]
    assert temperature.max() == pytest.approx(found.highest_degC, abs=1e-3)
    assert temperature.min() == pytest.approx(found.lowest_degC, abs=1e-3)
    assert found.period_s == pytest.approx(float(schedule.time_s[5] - schedule.time_s[3]), abs=1e-6)


def test_a_symmetric_relay_without_hysteresis_has_the_textbook_period():
    # period 2T·ln(2e^(L/T) − 1), amplitude kd(1 − e^(−L/T)): K. J. Åström, T. Hägglund, "PID Controllers: Theory,
    # Design, and Tuning", 2nd ed. (1995), relay feedback of first order with dead time
    bare = TwoLevelRelay(setpoint_degC=45.0, hysteresis_degC=0.0, high_pct=80.0, low_pct=20.0)
    found, ratio = oscillation(ONE, bare), math.exp(20.0 / 150.0)
    assert found.period_s == pytest.approx(2.0 * 150.0 * math.log(2.0 * ratio - 1.0))
    assert found.highest_degC - 45.0 == pytest.approx(0.5 * 30.0 * (1.0 - 1.0 / ratio))
    assert 45.0 - found.lowest_degC == pytest.approx(0.5 * 30.0 * (1.0 - 1.0 / ratio))


@pytest.mark.parametrize(("dead", "quotient"), [(0.01, 8.0 / math.pi**2), (3000.0, 4.0 / math.pi)])
def test_the_describing_function_meets_its_limits(dead, quotient):
    # ultimate gain by describing function over that of the plant, by python-control, for L/T → 0 and L/T → ∞
    model = Fopdt(gain_degC_per_pct=0.5, time_constant_s=10.0, dead_time_s=dead, ambient_degC=20.0)
    found = oscillation(model, TwoLevelRelay(setpoint_degC=45.0, hysteresis_degC=0.0, high_pct=80.0, low_pct=20.0))
    told = 4.0 * 30.0 / (math.pi * (found.highest_degC - 45.0))
    w = np.geomspace(1.5, 3.5, 300) / dead  # the ultimate frequency lies between π/2L and π/L
    truth = control.margin(control.FRD(0.5 * np.exp(-1j * w * dead) / (10.0 * 1j * w + 1.0), w))[0]
    assert told / truth == pytest.approx(quotient, rel=0.02)


def _relay_law(form, constants, memory, error, h):
    """A relay in the loop of `model.kernel`: constants high, low, hysteresis; memory 1 = low."""
    if memory[0] == 0.0 and error <= -constants[2]:
        memory[0] = 1.0
    elif memory[0] == 1.0 and error >= constants[2]:
        memory[0] = 0.0
    return constants[0] if memory[0] == 0.0 else constants[1]


@pytest.mark.long
@pytest.mark.parametrize(("model", "ratio"), [(ONE, 0.0), (TWO, 50.0 / 150.0)], ids=["one lag", "two lags"])
@pytest.mark.parametrize("sample", [1.0, 3.0])
def test_a_sampled_relay_is_the_one_of_the_compiled_loop(model, ratio, sample):
    # the closed loop that runs inside the fits, itself held against an ODE solver, with the same relay as its law
    n = int(1500 / sample)
    plant, own = (math.log(0.5), math.log(150.0), ratio, model.dead_time_s), (20.0, 20.0, 20.0, 38.0, 0.0, np.inf)
    law = SimpleNamespace(step=_relay_law, form=0, constants=[Constant(name=name, low=0.0, high=0.0) for name in "abc"])
    loop = np.empty((1, n))
    simulate_many(law, np.array([[*plant, *own, 80.0, 5.0, 0.5]]), len(plant), sample, np.arange(n), loop, 0)
    schedule = simulate_relay(model, SKEW, 1500.0, sample_time_s=sample)
    assert len(schedule.time_s) > 12
    assert np.all(np.rint(schedule.time_s / sample) * sample == pytest.approx(schedule.time_s))
    ours = 20.0 + rise(rows_of([model]), schedule, np.arange(n) * sample)[0]
    assert ours == pytest.approx(loop[0], abs=1e-6)


def test_a_crossing_is_seen_though_the_temperature_turns_back_at_once():
    # a hot inner mass lifts the sensor past 38 °C for a while; the instant by SciPy's ODE solver and its event
    def slope(_, state):
        return [(state[1] - state[0]) / 50.0, (22.5 - state[1]) / 150.0]

    def passed(_, state):
        return state[0] - 38.0

    expected = solve_ivp(slope, (0.0, 1000.0), [36.0, 50.0], events=passed, rtol=1e-10, atol=1e-10).t_events[0]
    assert len(expected) == 2, "up and down again"
    course = _ConstantPowerResponse(TWO, _RelayState(36.0, 50.0), 5.0)
    assert course.crossing(38.0, 1000.0, rising=True) == pytest.approx(expected[0], abs=1e-5)
    assert course.crossing(60.0, 1000.0, rising=True) is None


def test_a_heater_that_begins_above_the_threshold_begins_with_the_low_power():
    schedule = simulate_relay(ONE, SKEW, 1000.0, base_pct=60.0)
    assert schedule.power_pct[:2].tolist() == [5.0, 80.0]
    # from 50 °C towards 22.5 °C down to 37.5 °C, after the dead time: the step response of one lag
    assert schedule.time_s[1] == pytest.approx(20.0 + 150.0 * math.log((50.0 - 22.5) / (37.5 - 22.5)))


@pytest.mark.parametrize("setpoint", [22.9, 59.6, 10.0, 99.0])
def test_a_relay_that_cannot_swing_is_refused(setpoint):
    with pytest.raises(OutOfRange, match="never swings"):
        oscillation(ONE, TwoLevelRelay(setpoint_degC=setpoint, hysteresis_degC=0.5, high_pct=80.0, low_pct=5.0))


def test_a_relay_that_never_rests_is_refused():
    quick = Fopdt(gain_degC_per_pct=0.5, time_constant_s=150.0, dead_time_s=0.0, ambient_degC=20.0)
    with pytest.raises(InputError, match="hysteresis"):
        simulate_relay(quick, TwoLevelRelay(setpoint_degC=38.0, hysteresis_degC=0.0, high_pct=80.0), 1000.0)


@pytest.mark.parametrize(("settings", "told"), [
    ({"high_pct": 5.0, "low_pct": 5.0}, "high_pct"), ({"hysteresis_degC": -0.1}, "hysteresis"),
    ({"high_pct": 101.0}, "high_pct"), ({"low_pct": -1.0}, "low_pct"), ({"setpoint_degC": float("nan")}, "setpoint"),
])
def test_a_relay_that_cannot_be_is_refused(settings, told):
    with pytest.raises(OutOfRange, match=told):
        TwoLevelRelay(**({"setpoint_degC": 38.0, "hysteresis_degC": 0.5, "high_pct": 80.0} | settings))


def test_what_a_relay_needs_is_asked_for():
    nowhere = Fopdt(gain_degC_per_pct=0.5, time_constant_s=150.0, dead_time_s=20.0)
    with pytest.raises(OutOfRange, match="ambient_degC"):
        oscillation(nowhere, SKEW)
    for settings in ({"duration_s": 0.0}, {"duration_s": 10.0, "sample_time_s": 0.0}):
        with pytest.raises(OutOfRange, match="_s"):
            simulate_relay(ONE, SKEW, **settings)
