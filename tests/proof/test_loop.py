from dataclasses import replace
from itertools import pairwise

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.signal import lsim

from heatertune.errors import InputError, OutOfRange, UnknownName
from heatertune.model.model_values import Fopdt, TwoLag
from heatertune.pid.design_values import PidDesign
from heatertune.plc import Ramp
from heatertune.proof import Actuator, Load, Scenario, TemperatureStep, simulate, simulate_wish
from heatertune.proof.loop import noise_of
from heatertune.proof.report_curves import _IdealState, _law_of, _step

FAST = Actuator(pwm_period_s=10.0)


def _lags(model):
    first, *rest = model.lags_s
    return first, rest[0] if rest else None


def _power(trace, model, t):
    """Heater power at the plant at t, from the switch's edges alone."""
    passed = np.count_nonzero(trace.edge_time_s <= t - model.dead_time_s)
    return 100.0 if passed and trace.edge_on[passed - 1] else 0.0


def _integrated(trace, model):
    """The temperature at each scan by SciPy's solver, one switching instant after the other."""
    first, second = _lags(model)
    jumps = {each.time_s: each.temperature_degC for each in trace.scenario.disturbances if isinstance(each, TemperatureStep)}
    loads = [each for each in trace.scenario.disturbances if isinstance(each, Load)]
    acting = [each.time_s + model.dead_time_s for each in loads]
    stops = sorted({*trace.time_s, *(trace.edge_time_s + model.dead_time_s), *jumps, *acting})
    state = np.full(2, 20.0)
    seen = []
    for left, right in pairwise([*stops, stops[-1] + 1.0]):
        state = state + jumps.get(left, 0.0)
        if left in trace.time_s:
            seen.append(state[0])
        added = sum(each.power_pct for each, at in zip(loads, acting, strict=True) if at <= left)
        target = 20.0 + model.gain_degC_per_pct * (_power(trace, model, (left + right) / 2.0) + added)

        def slope(_, s, target=target):
            return [((target if second is None else s[1]) - s[0]) / first, (target - s[1]) / (second or first)]

        state = solve_ivp(slope, (left, right), state, rtol=1e-10, atol=1e-10).y[:, -1]
    return np.array(seen)


def test_the_heater_agrees_with_an_ode_solver(any_heater, tenths, words):
    scenario = Scenario(setpoint_degC=40.0, duration_s=300.0, disturbances=(
        TemperatureStep(time_s=151.3, temperature_degC=-5.0), Load(time_s=200.1, power_pct=-7.0)))
    trace = simulate(tenths, words(gain=6.0, ta=4.0), any_heater, scenario, Actuator(pwm_period_s=7.0))
    assert len(trace.edge_time_s) > 30, "the loop has to switch, or half of it is not tested"
    assert trace.temperature_degC == pytest.approx(_integrated(trace, any_heater), abs=1e-6)


def test_the_heater_agrees_with_linear_simulation(tenths, words):
    heater = TwoLag(gain_degC_per_pct=0.5, time_constant_s=120.0, second_time_constant_s=30.0, dead_time_s=7.0,
                    ambient_degC=20.0)
    scenario = Scenario(setpoint_degC=40.0, duration_s=400.0)
    # all edges on the grid of lsim, which holds its input between the points
    trace = simulate(tenths, words(gain=6.0, ta=5.0), heater, scenario, Actuator(pwm_period_s=10.0, resolution_s=0.5))
    grid = np.arange(0.0, 400.1, 0.5)
    power = [_power(trace, heater, t + 0.25) for t in grid]
    _, rise, _ = lsim(([0.5], np.polymul([120.0, 1.0], [30.0, 1.0])), power, grid, interp=False)
    assert trace.temperature_degC == pytest.approx(20.0 + rise[::10], abs=1e-8)


def _linear(design, model, step, samples):
    """python-control's answer of the sampled loop to a setpoint step, power never limited."""
    h = design.sample_time_s
    plant = control.sample_system(control.tf([model.gain_degC_per_pct], [model.time_constant_s, 1.0]), h, "zoh")
    delay = round(model.dead_time_s / h)
    plant = plant * control.tf([1.0], [1.0] + [0.0] * delay, h)
    law = control.tf([1.0], [1.0], h) + control.tf([h / design.integral_time_s, 0.0], [1.0, -1.0], h)
    if design.derivative_time_s:
        law += control.tf(design.derivative_time_s / (2.0 * h) * np.array([1.0, -1.0]), [1.0, -0.5], h)
    closed = control.feedback(design.gain_pct_per_degC * law * plant, 1)
    return step * control.step_response(closed, np.arange(samples) * h).outputs


@pytest.mark.parametrize("tv", [0.0, 15.0], ids=["pi", "pid"])
def test_with_a_fast_pwm_the_wish_is_python_controls_linear_loop(tv):
    heater = Fopdt(gain_degC_per_pct=0.5, time_constant_s=150.0, dead_time_s=20.0, ambient_degC=20.0)
    design = PidDesign(gain_pct_per_degC=4.0, integral_time_s=120.0, derivative_time_s=tv, sample_time_s=5.0,
                       structure="pid" if tv else "pi", method="by hand")
    scenario = Scenario(setpoint_degC=28.0, duration_s=1000.0)
    expected = 20.0 + _linear(design, heater, 8.0, 201)
    wrong = []
    for period in (1.0, 0.5):
        trace = simulate_wish(design, heater, scenario, Actuator(pwm_period_s=period, resolution_s=1e-6))
        assert trace.power_asked_pct.min() > 0.0
        assert trace.power_asked_pct.max() < 100.0
        wrong.append(float(np.abs(trace.temperature_degC - expected).max()))
    assert wrong[0] < 0.05
    assert wrong[1] == pytest.approx(wrong[0] / 2.0, rel=0.1), "the PWM's error is of first order in its period"


def test_on_a_ramp_the_wish_is_python_controls_linear_loop():
    heater = Fopdt(gain_degC_per_pct=0.5, time_constant_s=150.0, dead_time_s=20.0, ambient_degC=20.0)
    design = PidDesign(gain_pct_per_degC=4.0, integral_time_s=120.0, derivative_time_s=0.0, sample_time_s=5.0,
                       structure="pi", method="by hand")
    # 2.4 °C/min are 0.2 °C per call: the ramp arrives with the 40th call
    way = 8.0 * np.minimum(np.arange(1, 202) / 40.0, 1.0)
    ones = _linear(design, heater, 1.0, 201)
    expected = 20.0 + np.convolve(np.diff(way, prepend=0.0), ones)[:201]
    actuator = Actuator(pwm_period_s=0.5, resolution_s=1e-6)
    trace = simulate_wish(design, heater, Scenario(setpoint_degC=28.0, duration_s=1000.0), actuator, ramp_degC_per_min=2.4)
    assert trace.followed_degC == pytest.approx(20.0 + way)
    assert trace.power_asked_pct.min() > 0.0
    assert trace.power_asked_pct.max() < 100.0
    assert trace.temperature_degC == pytest.approx(expected, abs=0.03)


def test_the_room_is_told_where_its_ramp_is_from_the_first_reading_on(tenths, words, heater):
    ramped = replace(words(), ramp=Ramp(step=15, calls=2))
    scenario = Scenario(setpoint_degC=30.0, duration_s=100.0, noise_degC=0.3, seed=5)
    trace = simulate(tenths, ramped, heater, scenario, FAST)
    setpoints, readings = [s for s, _, _ in tenths.seen], [r for _, r, _ in tenths.seen]
    assert readings[0] != 240, "the noise has to show in the first reading"
    assert setpoints == [min(300, readings[0] + 15 * ((k + 1) // 2)) for k in range(51)]
    assert trace.followed_degC == pytest.approx(np.array(setpoints) / 10.0)
    assert trace.setpoint_degC == 30.0


def test_while_the_power_is_at_its_limit_the_wish_does_not_wind_up(heater):
    design = PidDesign(gain_pct_per_degC=8.0, integral_time_s=110.0, derivative_time_s=0.0, sample_time_s=2.0,
                       structure="pi", method="by hand")
    trace = simulate_wish(design, heater, Scenario(setpoint_degC=60.0, duration_s=2000.0), FAST)
    assert trace.power_asked_pct.max() == 100.0
    assert trace.temperature_degC.max() < 60.0 + 0.05 * 36.0


def test_the_wish_lets_the_integral_lead_back_from_a_limit():
    design = PidDesign(gain_pct_per_degC=1.0, integral_time_s=10.0, derivative_time_s=100.0, sample_time_s=1.0,
                       structure="pid", method="by hand")
    law, state = _law_of(design), _IdealState(0.0, 0.0, 0.0)

    def step(reading):
        nonlocal state
        state, power, *_ = _step(law, state, 50.0, reading, True)
        return power

    assert step(45.0) == 100.0  # the derivative of the first error; its I step is left out
    powers = [step(49.0) for _ in range(40)]
    assert powers[0] == 0.0, "the derivative takes the power to the lower limit, where the error leads back"
    assert powers[-1] == pytest.approx(1.0 + 40 * 0.1)


def test_halving_the_resolution_converges(tenths, words, heater):
    scenario = Scenario(setpoint_degC=53.3, duration_s=600.0)

    def course(resolution):
        return simulate(tenths, words(), heater, scenario, Actuator(pwm_period_s=10.0, resolution_s=resolution))

    exact = course(1e-6).temperature_at(np.arange(600.0))
    wrong = [np.abs(course(r).temperature_at(np.arange(600.0)) - exact).max() for r in (1.0, 0.1, 0.01, 0.001)]
    assert wrong[3] < 0.01
    assert wrong[0] > wrong[1] > wrong[2]


@settings(max_examples=25)
@given(dead=st.floats(0.0, 60.0), power=st.floats(0.0, 100.0))
def test_dead_time_only_shifts_what_the_heater_does(program, words, dead, power):
    room = program(lambda count, _begins: power if count < 30 else 0.0)
    scenario = Scenario(setpoint_degC=40.0, duration_s=300.0)
    early, late = (
        simulate(room, words(), Fopdt(gain_degC_per_pct=0.5, time_constant_s=60.0, dead_time_s=each,
                                         ambient_degC=20.0), scenario, Actuator(pwm_period_s=3.0))
        for each in (0.0, dead)
    )
    times = np.arange(0.0, 300.0 - dead, 0.7)
    assert late.temperature_at(times + dead) == pytest.approx(early.temperature_at(times), abs=1e-9)
    assert late.temperature_at(np.linspace(0.0, dead, 5)) == pytest.approx(20.0)


def test_a_load_is_a_power_that_comes_after_the_dead_time(constant, words, heater):
    scenario = Scenario(setpoint_degC=40.0, duration_s=800.0, disturbances=(Load(time_s=100.0, power_pct=20.0),))
    trace = simulate(constant(0.0), words(), heater, scenario, FAST)
    since = np.maximum(0.0, trace.time_s - 114.0)
    assert trace.temperature_degC == pytest.approx(24.0 + 8.2 * (1.0 - np.exp(-since / 166.0)), abs=1e-9)


def test_loads_add_up(constant, words, heater):
    both = (Load(time_s=100.0, power_pct=20.0), Load(time_s=400.0, power_pct=-20.0))
    scenario = Scenario(setpoint_degC=40.0, duration_s=3000.0, disturbances=both)
    trace = simulate(constant(0.0), words(), heater, scenario, FAST)
    assert trace.temperature_degC[-1] == pytest.approx(24.0, abs=1e-5)


def test_a_jump_is_seen_by_the_scan_at_its_instant(any_heater, tenths, words):
    scenario = Scenario(setpoint_degC=40.0, duration_s=400.0, disturbances=(TemperatureStep(time_s=200.0, temperature_degC=-8.8),))
    trace = simulate(tenths, words(), any_heater, scenario, FAST)
    at, jump = trace.temperature_at(200.0), trace.temperature_at(200.0) - trace.temperature_at(200.0, before=True)
    assert jump == pytest.approx(-8.8)
    assert trace.temperature_degC[100] == at
    assert trace.reading_degC[100] == pytest.approx(at, abs=0.05 + 1e-9)


def test_the_same_seed_gives_the_same_run(tenths, words, heater):
    def run(seed):
        scenario = Scenario(setpoint_degC=53.3, duration_s=300.0, noise_degC=0.3, seed=seed)
        return simulate(tenths, words(), heater, scenario, FAST).reading_degC

    assert np.array_equal(run(1), run(1))
    assert not np.array_equal(run(1), run(2))


def test_minus_zero_is_no_noise():
    scenarios = [Scenario(setpoint_degC=53.3, duration_s=100.0, noise_degC=noise) for noise in (0.0, -0.0)]
    assert np.array_equal(*(noise_of(scenario, 5) for scenario in scenarios))


def test_noise_has_the_deviation_asked_for_and_is_not_in_the_true_temperature(constant, words, heater):
    scenario = Scenario(setpoint_degC=53.3, duration_s=8000.0, noise_degC=0.5)
    trace = simulate(constant(0.0), words(), heater, scenario, FAST)
    assert trace.temperature_degC == pytest.approx(24.0)
    assert np.std(trace.reading_degC) == pytest.approx(0.5, rel=0.05)


def test_the_controller_sees_its_own_units(constant, words, heater):
    room = replace(constant(0.0), counts=800)  # tenths of 80 °C
    scenario = Scenario(setpoint_degC=53.34, duration_s=4.0)
    trace = simulate(room, words(low=10.0, high=90.0), heater, scenario, FAST)
    assert room.seen[0][:2] == (533, 240)
    assert trace.reading_degC == pytest.approx(24.0)
    assert trace.resolution_degC == pytest.approx(0.1)


@pytest.mark.parametrize(("scan", "period"), [(0.1, 0.3), (0.1, 1.0), (0.7, 2.1), (1.0, 1.0), (0.3, 0.1), (2.0, 10.0)])
def test_a_period_takes_the_power_of_the_scan_at_its_beginning(program, words, heater, scan, period):
    room = program(lambda count, _begins: float(10 + count % 80))
    trace = simulate(room, words(ta=scan), heater, Scenario(setpoint_degC=40.0, duration_s=100 * scan),
                     Actuator(pwm_period_s=period, resolution_s=period / 1e4))
    starts, ends = trace.edge_time_s[::2], trace.edge_time_s[1::2]
    scans = np.floor(starts[:len(ends)] / scan + 1e-6)
    assert starts == pytest.approx(np.arange(len(starts)) * period)
    assert (ends - starts[:len(ends)]) / period * 100.0 == pytest.approx(10 + scans % 80, abs=0.01)


def test_a_controller_with_its_own_pwm_is_told_when_a_period_begins(program, words, heater):
    room = program(lambda count, _begins: float(count), pwm_period_s=1.0)
    trace = simulate(room, words(ta=0.1), heater, Scenario(setpoint_degC=40.0, duration_s=5.0))
    assert [k for k, (_, _, begins) in enumerate(room.seen) if begins] == [0, 10, 20, 30, 40, 50]
    assert (trace.actuator.pwm_period_s, trace.actuator.resolution_s) == (1.0, 0.001)
    # nothing at 0 %, then 10, 20, … % of a second
    assert np.diff(trace.edge_time_s)[::2] == pytest.approx([0.1, 0.2, 0.3, 0.4])


@pytest.mark.parametrize(("scan", "period", "told"), [
    (1.0, 2.5, [0, 3, 5, 8, 10]), (0.7, 2.1, [0, 3, 6, 9]), (0.1, 0.3, [0, 3, 6, 9]), (0.3, 0.1, list(range(11))),
])
def test_periods_are_told_by_the_scan_at_or_after_their_beginning(program, words, heater, scan, period, told):
    room = program(lambda _count, _begins: 0.0, pwm_period_s=period)
    simulate(room, words(ta=scan), heater, Scenario(setpoint_degC=40.0, duration_s=10 * scan))
    assert [k for k, (_, _, begins) in enumerate(room.seen) if begins] == told


def test_full_power_is_never_switched_off(constant, words, heater):
    trace = simulate(constant(100.0), words(), heater, Scenario(setpoint_degC=40.0, duration_s=300.0), FAST)
    assert (trace.edge_time_s.tolist(), trace.edge_on.tolist()) == ([0.0], [True])


def test_no_power_is_never_switched_on(constant, words, heater):
    trace = simulate(constant(0.0), words(), heater, Scenario(setpoint_degC=40.0, duration_s=300.0), FAST)
    assert (len(trace.edge_time_s), len(trace.edge_on)) == (0, 0)


def test_flags_are_counted(words, heater, tenths):
    trace = simulate(replace(tenths, overflows_above=399), words(), heater,
                     Scenario(setpoint_degC=53.3, duration_s=600.0), FAST)
    assert trace.flags == {"running": 301, "overflow": np.count_nonzero(trace.reading_degC > 39.95)}


def test_the_switches_not_named_have_their_default(switched, words, heater):
    trace = simulate(switched, words(), heater, Scenario(setpoint_degC=40.0, duration_s=10.0), FAST,
                     {"second": "never off"})
    assert trace.switches == {"integral": "off at the limit", "second": "never off", "third": "off at the limit"}


@pytest.mark.parametrize("given", [{"fourth": "never off"}, {"second": "sometimes"}])
def test_a_switch_the_room_does_not_have_is_refused(switched, words, heater, given):
    with pytest.raises(UnknownName):
        simulate(switched, words(), heater, Scenario(setpoint_degC=40.0, duration_s=10.0), FAST, given)


def test_a_controller_without_pwm_needs_an_actuator(tenths, words, heater):
    with pytest.raises(InputError, match="actuator"):
        simulate(tenths, words(), heater, Scenario(setpoint_degC=40.0, duration_s=10.0))


def test_a_setpoint_outside_the_sensors_range_is_refused(tenths, words, heater):
    with pytest.raises(OutOfRange, match="sensor"):
        simulate(tenths, words(high=50.0), heater, Scenario(setpoint_degC=53.3, duration_s=10.0), FAST)


def test_a_setpoint_out_of_reach_is_refused(tenths, words, heater):
    with pytest.raises(OutOfRange, match="cannot hold"):
        simulate(tenths, words(), heater, Scenario(setpoint_degC=65.0, duration_s=10.0), FAST)


def test_the_last_scan_is_not_before_the_end(tenths, words, heater):
    trace = simulate(tenths, words(ta=7.0), heater, Scenario(setpoint_degC=40.0, duration_s=100.0), FAST)
    assert trace.time_s[-1] == pytest.approx(105.0)
    assert trace.edge_time_s.max() <= 105.0
