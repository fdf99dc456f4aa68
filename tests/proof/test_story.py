"""The story: its parts and times worked out by hand, and each kind of event against another program."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from tests.proof.ways import assert_same_compiled_and_plain
from tests.witness.trace_measures import judge

from heatertune.errors import InputError, OutOfRange
from heatertune.model.model_values import Fopdt, TwoLag
from heatertune.pid.design_values import PidDesign
from heatertune.plc import TARGETS, Scaling, controller_for
from heatertune.proof import (
    Acceptance,
    Actuator,
    Coverage,
    Load,
    LoopLimits,
    Mains,
    NewSetpoint,
    PlcPower,
    Scenario,
    TemperatureStep,
    TestSequence,
    prove_models,
    simulate,
    story_for,
)
from heatertune.proof.long_outage import nights_of
from heatertune.proof.scenario import delay_heater, kinds_of, phases_of
from heatertune.proof.test_sequence import LoopTiming

#: 100 s of lag and 10 s of dead time; 40 % of the power hold 60 °C
HEATER = Fopdt(gain_degC_per_pct=1.0, time_constant_s=100.0, dead_time_s=10.0, ambient_degC=20.0)
LOOP = LoopTiming(scan_s=5.0, pwm_period_s=5.0, sample_time_s=5.0, integral_time_s=80.0)
PWM = Actuator(pwm_period_s=5.0)


def _story(*models, loop=LOOP, setpoint=60.0, **parts):
    return story_for(models or [HEATER], loop, TestSequence(**parts), setpoint_degC=setpoint)


def _part(course, number):
    """Length of a part and its rest."""
    scenario = course.scenario
    ends = [0.0, *(each.time_s for each in scenario.disturbances), scenario.duration_s]
    return ends[number + 1] - ends[number], scenario.rests_s[number]


def _up(seconds):
    return 5.0 * math.ceil(seconds / 5.0)


def test_everything_that_goes_wrong_is_told_in_order():
    course = _story()
    what = [type(each).__name__ for each in course.scenario.disturbances]
    assert what == ["TemperatureStep", "Load", "Load", *4 * ["Mains"], "NewSetpoint", "NewSetpoint", *3 * ["Mains"], *4 * ["PlcPower"]]
    jump, load, gone, opened, closed, at_night, by_day, low, high, *mains, off, on, cold, again = course.scenario.disturbances
    assert (jump.temperature_degC, load.power_pct, gone.power_pct) == pytest.approx((-0.3 * 40.0, -10.0, 10.0))
    assert (opened.share, closed.share, low.setpoint_degC, high.setpoint_degC) == (0.0, 1.0, 52.0, 60.0)
    assert (at_night.share, by_day.share) == (0.0, 1.0)
    assert [each.share for each in mains] == pytest.approx([0.81, 1.21, 1.0])
    assert [each.on for each in (off, on, cold, again)] == [False, True, False, True]
    assert (course.not_tested, course.notes) == ((), ())
    assert [kind for kind, *_ in kinds_of(course.scenario)] == [
        "heat-up", *3 * ["recovery"], "off", "reheat", "off", "reheat", "change", "change", *3 * ["recovery"], "off", "restart", "off", "restart"]


def test_parts_last_as_long_as_the_heater_needs_and_a_rest():
    course = _story()
    slowest, heater = 2.0 * math.pi * 80.0, 110.0
    full = 10.0 - 100.0 * math.log(1.0 - 0.4)  # at full power to 40 % of the way
    assert _part(course, 0) == pytest.approx((_up(full + 5.0 * heater + 10.0 * slowest), 10.0 * slowest))
    assert _part(course, 1) == pytest.approx((_up(5.0 * heater + slowest), slowest))
    assert _part(course, 4) == pytest.approx((_up(2.0 * 80.0), 0.0)), "open for 2 TN"
    assert _part(course, 5) == pytest.approx((_up(full + 5.0 * heater + slowest), slowest))
    cooling = 10.0 - 100.0 * math.log(32.0 / 40.0)  # by itself from 40 to 32 °C above the ambient
    assert _part(course, 6) == pytest.approx((_up(10.0 * 80.0), 0.0)), "open for 10 TN: 310 s are cold"
    assert _part(course, 8) == pytest.approx((_up(cooling + 5.0 * heater + 10.0 * slowest), 10.0 * slowest))
    assert _part(course, 13)[0] == pytest.approx(_up(0.1 * heater))
    assert _part(course, 15)[0] == pytest.approx(_up(10.0 + 100.0 * math.log(20.0))), "5 % of the way are left"


def test_two_lags_take_the_time_of_their_own_answer():
    # equal lags of 50 s: (1 + t/50)·e^(−t/50) is 0.6 after 68.8 s, by hand
    heater = TwoLag(gain_degC_per_pct=1.0, time_constant_s=50.0, second_time_constant_s=50.0, dead_time_s=10.0, ambient_degC=20.0)
    phases = phases_of(_story(heater).scenario, 1e9, 0.0)
    assert phases[0].limit_s == pytest.approx(10.0 + 68.82 + 5.0 * 110.0, abs=5.0)


def test_an_open_circuit_lasts_until_a_boost_nearly_takes_the_heater_back_whatever_the_dead_time():
    # 8 of the 40 °C are lost after T·ln(40/32) of cooling by itself; with two scans in hand, and not a scan more. The dead
    # time lets the reading fall for as long after the circuit is closed as it waited before
    fast, slow = (replace(HEATER, time_constant_s=lag, dead_time_s=50.0) for lag in (100.0, 200.0))
    scenario = _story(fast, slow, loop=replace(LOOP, again_degC=8.0)).scenario
    cut = [later.time_s - each.time_s for each, later in pairwise(scenario.disturbances) if isinstance(each, Mains) and each.share == 0.0]
    assert cut[2:] == pytest.approx([_up(lag * math.log(40.0 / 32.0) - 10.0) for lag in (100.0, 200.0)])
    for heater, opened in zip((fast, slow), cut[2:], strict=True):
        assert 5.0 < 40.0 * (1.0 - math.exp(-opened / heater.time_constant_s)) < 8.0
    assert len(_story(fast, loop=replace(LOOP, again_degC=8.0)).scenario.disturbances) == len(_story(fast).scenario.disturbances) + 2
    assert len(_story(fast, loop=replace(LOOP, again_degC=40.0)).scenario.disturbances) == len(_story(fast).scenario.disturbances)


def _marlins():
    design = PidDesign(gain_pct_per_degC=4.0, integral_time_s=60.0, derivative_time_s=0.0, sample_time_s=0.16, structure="pi", method="")
    return controller_for("marlin").encode(design, Scaling(low_degC=0.0, high_degC=255.0))


def test_marlins_window_is_a_boost_whose_setpoint_is_whole_degrees():
    # temperature.h: beyond PID_FUNCTIONAL_RANGE the heater is full on and the sum begins anew; 255 °C in 1023 steps
    assert controller_for("marlin").again_degC(_marlins()) == pytest.approx(10.0 - 0.5 - 255.0 / 1023.0)


def test_a_window_is_left_twice_under_a_small_load():
    # Marlin forgets its sum beyond the window; 10.75 of the 40 °C are lost after T·ln(40/29.25) without power, and for the
    # dead time more the first time
    room, words = controller_for("marlin"), _marlins()
    assert room.forgets_degC(words) == pytest.approx(10.0 + 0.5 + 255.0 / 1023.0)
    fast, slow = HEATER, replace(HEATER, time_constant_s=200.0)
    scenario, plain = (_story(fast, slow, loop=replace(LOOP, forgets_degC=far)).scenario for far in (10.75, 40.0))
    told = scenario.disturbances[7:13]
    assert [type(each).__name__ for each in told] == ["Mains", "Load", "Mains", "Mains", "Mains", "Load"]
    assert [each.power_pct for each in told if isinstance(each, Load)] == [-1.0, 1.0]
    off, loaded, closed, again, by_now, _ = (each.time_s for each in told)
    assert (loaded - off, closed - loaded, by_now - again) == (
        _up(100.0 * math.log(40.0 / 29.25)), 10.0, _up(200.0 * math.log(40.0 / 29.25)))
    assert [kind for kind, *_ in kinds_of(scenario)][8:14] == ["off", "off", "reheat", "off", "reheat", "recovery"]
    assert len(plain.disturbances) == len(scenario.disturbances) - 6, "no way is so long"
    hot = _story(loop=replace(LOOP, forgets_degC=10.75), setpoint=119.0).scenario  # 1 % is left over: half of it is taken
    assert [each.power_pct for each in hot.disturbances if isinstance(each, Load)] == pytest.approx([-0.5, 0.5])


def test_a_night_is_made_of_the_longest_circuit_that_is_closed_again():
    scenario = _story().scenario
    opened, closed = scenario.disturbances[5:7]
    night, rising = nights_of(scenario, [HEATER])
    open_s = closed.time_s - opened.time_s
    assert open_s == _up(800.0)
    heated_s = scenario.disturbances[0].time_s - scenario.rests_s[0]  # the heat-up without its rest
    off_s = heated_s + scenario.rests_s[7]
    assert night.scenario.disturbances == (replace(opened, time_s=off_s), replace(closed, time_s=off_s + 4.0 * _up(800.0)))
    assert night.scenario.rests_s == (scenario.rests_s[7], 0.0, scenario.rests_s[7])
    assert night.scenario.duration_s - night.scenario.disturbances[1].time_s == pytest.approx(scenario.disturbances[7].time_s - closed.time_s)
    # and again: closed at the lower setpoint, which rises as full power has led there, or a fifth of that time later
    assert [kind for kind, *_ in kinds_of(rising.scenario)] == ["heat-up", *2 * ("off", "off", "off", "reheat")]
    times = [event.time_s for event in rising.scenario.disturbances]
    assert times[0] == off_s
    arrives_s = 10.0 + 100.0 * math.log(100.0 / 68.0)  # 32 % of the power hold 52 °C
    for first, rises_s in ((0, arrives_s), (4, 1.2 * arrives_s)):
        assert [later - times[first] for later in times[first + 1:first + 4]] == pytest.approx(
            [0.5 * open_s, open_s, open_s + rises_s])
    assert rising.scenario.setpoints_degC == (60.0, *2 * (60.0, 52.0, 52.0, 60.0))
    for never in ((opened,), (opened, Load(time_s=opened.time_s + 100.0, power_pct=-5.0))):  # a scenario of somebody's own
        assert not list(nights_of(replace(scenario, disturbances=never, rests_s=()), [HEATER]))


def test_a_ramp_and_a_slow_switch_get_their_time():
    plain, ramped = _story(), _story(loop=replace(LOOP, ramp_degC_per_min=4.0))
    assert _part(ramped, 0)[0] - _part(plain, 0)[0] == pytest.approx(600.0, abs=5.0)  # 40 °C
    assert _story(loop=replace(LOOP, pwm_period_s=900.0)).scenario.rests_s[0] == 9000.0
    # PWM of 3 s under scans of 10 s: a third of a period is missed each time, so they meet again after 30 s
    beating = LoopTiming(scan_s=10.0, pwm_period_s=3.0, sample_time_s=10.0, integral_time_s=1.0)
    assert _story(loop=beating).scenario.rests_s[0] == pytest.approx(300.0)


def test_nothing_happens_before_what_is_specified_may_be_over():
    course = _story(loop=replace(LOOP, settling_s=7200.0, recovery_s=1800.0))
    (heat_up, rest), (jump, after) = _part(course, 0), _part(course, 1)
    assert (heat_up - rest, jump - after) == pytest.approx((7200.0, 1800.0), abs=5.0)
    assert _part(_story(loop=replace(LOOP, settling_s=60.0)), 0) == _part(_story(), 0)


@pytest.mark.parametrize("tn", [None, math.inf])
def test_without_tn_the_heater_itself_tells_how_slow_a_hunt_may_be(tn):
    assert _story(loop=replace(LOOP, integral_time_s=tn)).scenario.rests_s[1] == pytest.approx(2.0 * math.pi * 110.0)


def test_what_a_heater_has_no_power_for_is_told_and_not_tested():
    course = _story(setpoint=108.0)  # 88 % of the power hold it
    assert [each.power_pct for each in course.scenario.disturbances if isinstance(each, Load)] == pytest.approx([-7.0, 7.0])
    assert course.notes == ("load of 7 % in place of 10 %: no more power is left over",)
    assert course.not_tested == ("mains voltage (at −10 % a heater has -8.64 % of power left over)",)
    assert _story(setpoint=117.0).not_tested[0] == "a load (a heater has 3 % of power left over)"


def test_what_is_left_out_is_told():
    course = _story(step_share=0.0, load_pct=0.0, opens=False, changes=False, mains=False, restarts=False)
    assert course.scenario.disturbances == ()
    assert course.not_tested == ("a step of the temperature", "a load", "an open circuit of the heater", "a change of the setpoint",
                                 "mains voltage", "a restart of the controller")
    assert _story(setpoint_low_degC=60.0).not_tested == ("a change of the setpoint",), "none is lower"


def test_a_setpoint_colder_than_the_room_is_asked_for_and_the_lowest_that_needs_power_as_well():
    # the lowest setpoint at which a heater without power is not right anyway is more than a tolerance above its ambient
    course = _story(loop=replace(LOOP, small_change_degC=3.0), setpoint_low_degC=19.0)
    changes = [each for each in course.scenario.disturbances if isinstance(each, NewSetpoint) and not each.small]
    assert [each.setpoint_degC for each in changes] == [23.0, 60.0, 19.0, 60.0]
    number = course.scenario.disturbances.index(changes[2])
    assert [kind for kind, *_ in kinds_of(course.scenario)][number - 1:number + 3] == ["change", "change", "off", "change"]
    cut = [later.time_s - each.time_s for each, later in pairwise(course.scenario.disturbances) if isinstance(each, Mains) and each.share == 0.0]
    assert changes[3].time_s - changes[2].time_s == max(cut), "as long as the longest outage: the sum has as much time to run away"
    assert course.not_tested == ()
    assert course.notes == ("23 °C is run as the lowest setpoint too: no power holds 19 °C at an ambient of 20 °C",)


@pytest.mark.parametrize(("low", "setpoints"), [
    (22.5, [23.0, 60.0, 22.5, 60.0]), (23.0, [23.0, 60.0]), (40.0, [40.0, 60.0])])
def test_a_setpoint_that_power_holds_is_held(low, setpoints):
    scenario = _story(loop=replace(LOOP, small_change_degC=3.0), setpoint_low_degC=low).scenario
    changes = [each for each in scenario.disturbances if isinstance(each, NewSetpoint) and not each.small]
    assert ([each.setpoint_degC for each in changes], scenario.held_setpoints_degC) == (setpoints, scenario.setpoints_degC)


def test_of_several_ambients_the_lowest_setpoint_is_one_that_every_heater_holds():
    cold, warm = (replace(HEATER, ambient_degC=ambient) for ambient in (15.0, 28.0))
    scenario = _story(cold, warm, loop=replace(LOOP, small_change_degC=2.0), setpoint_low_degC=20.0).scenario
    changes = [(each.setpoint_degC, each.unheld) for each in scenario.disturbances if isinstance(each, NewSetpoint) and not each.small]
    assert changes == [(30.0, None), (60.0, None), (20.0, True), (60.0, None)], "20 °C would be held by one of them alone"


def test_a_cooler_in_addition_is_not_proven_to_hold_what_is_colder_than_the_room():
    course = _story(loop=replace(LOOP, cooling_gain=0.5), setpoint_low_degC=10.0)
    assert course.not_tested == ("rest at 10 °C, which the cooler has to hold",)


def test_a_story_that_makes_no_sense_is_refused():
    with pytest.raises(InputError, match="at least one model"):
        story_for([], LOOP, setpoint_degC=60.0)
    for field, value in (("step_share", -0.1), ("load_pct", 100.0), ("setpoint_low_degC", math.nan)):
        with pytest.raises(OutOfRange, match=field):
            TestSequence(**{field: value})
    with pytest.raises(OutOfRange, match="rests_s"):
        Scenario(setpoint_degC=60.0, duration_s=100.0, rests_s=(60.0, 10.0))
    with pytest.raises(OutOfRange, match="rests_s"):
        Scenario(setpoint_degC=60.0, duration_s=100.0, rests_s=(101.0,))


#: every kind of event, none at an instant of a scan
SCENARIO = Scenario(setpoint_degC=40.0, duration_s=900.0, rests_s=(30.0, *8 * (10.0,)), disturbances=(
    Load(time_s=150.3, power_pct=-8.0), Mains(time_s=210.7, share=0.0), Mains(time_s=260.1, share=1.2),
    NewSetpoint(time_s=400.9, setpoint_degC=35.0), NewSetpoint(time_s=500.2, setpoint_degC=42.0),
    PlcPower(time_s=600.4, on=False), PlcPower(time_s=640.6, on=True), TemperatureStep(time_s=800.3, temperature_degC=-4.0)))


def _integrated(trace, model):
    """The temperature at each scan by SciPy's solver, from the switch's edges and the scenario alone."""
    first, *second = model.lags_s
    acting = [replace(each, time_s=each.time_s + model.dead_time_s) for each in SCENARIO.disturbances if not isinstance(each, TemperatureStep)]
    jump = SCENARIO.disturbances[-1]
    stops = sorted({*trace.time_s, *(trace.edge_time_s + model.dead_time_s), jump.time_s, *(each.time_s for each in acting)})
    state, seen = np.full(2, 20.0), []
    for left, right in pairwise([*stops, stops[-1] + 1.0]):
        if left == jump.time_s:
            state = state + jump.temperature_degC
        if left in trace.time_s:
            seen.append(state[0])
        begun = [each for each in acting if each.time_s <= left]
        share = [1.0, *(each.share for each in begun if isinstance(each, Mains))][-1]
        supplied = [True, *(each.on for each in begun if isinstance(each, PlcPower))][-1]
        heated = np.count_nonzero(trace.edge_time_s + model.dead_time_s <= left) % 2
        load = sum(each.power_pct for each in begun if isinstance(each, Load))
        target = 20.0 + model.gain_degC_per_pct * (100.0 * heated * share * supplied + load)

        def slope(_, s, target=target):
            return [((s[1] if second else target) - s[0]) / first, (target - s[1]) / (second[0] if second else first)]

        state = solve_ivp(slope, (left, right), state, rtol=1e-10, atol=1e-10).y[:, -1]
    return np.array(seen)


def test_the_heater_agrees_with_an_ode_solver_through_all_of_it(any_heater, tenths, words):
    trace = simulate(tenths, words(gain=6.0, ta=4.0), any_heater, SCENARIO, Actuator(pwm_period_s=7.0))
    assert trace.temperature_degC == pytest.approx(_integrated(trace, any_heater), abs=1e-6)


def test_a_plc_without_supply_runs_no_scan_and_starts_up_cold(tenths, words, any_heater):
    trace = simulate(tenths, words(gain=6.0, ta=4.0), any_heater, SCENARIO, PWM)
    off = (trace.time_s >= 600.4) & (trace.time_s < 640.6)
    assert np.count_nonzero(off) == 10
    assert len(tenths.seen) == len(trace.time_s) - 10
    assert np.all(trace.power_asked_pct[off] == 0.0)
    begun = int(np.flatnonzero(off)[-1]) + 1
    reading = trace.reading_degC[begun]
    # a controller without memory of the time before: K·(e + e·TA/TN)
    assert trace.power_asked_pct[begun] == pytest.approx(np.clip(6.0 * (42.0 - reading) * (1.0 + 4.0 / 110.0), 0.0, 100.0))


def test_what_a_plc_retains_is_there_after_a_restart(tenths, words, any_heater):
    class Retaining(type(tenths)):
        @property
        def core(self):
            return replace(super().core, warm_start=lambda _parameters, _cold, state: state)

    ran = [simulate(room, words(gain=6.0, ta=4.0), any_heater, SCENARIO, PWM) for room in (tenths, Retaining())]
    cold, kept = (trace.power_asked_pct for trace in ran)
    begun = int(np.flatnonzero(ran[0].time_s >= 640.6)[0])
    assert np.array_equal(cold[:begun], kept[:begun])
    assert cold[begun] != kept[begun]


def test_the_controller_is_asked_for_the_setpoint_of_each_part(tenths, words, any_heater):
    trace = simulate(tenths, words(gain=6.0, ta=4.0), any_heater, SCENARIO, PWM)
    asked = np.select([trace.time_s < 400.9, trace.time_s < 500.2], [40.0, 35.0], 42.0)
    assert trace.followed_degC == pytest.approx(asked)


def test_a_ramp_leads_to_each_setpoint_and_begins_anew_after_a_restart(tenths, words, any_heater):
    ramped = replace(words(gain=6.0, ta=4.0), ramp=controller_for("s7-300").ramp(
        controller_for("s7-300").encode(PidDesign(
            gain_pct_per_degC=1.0, integral_time_s=99.0, derivative_time_s=0.0, sample_time_s=4.0, structure="pi", method=""),
            Scaling()), 0.001))
    ramped = replace(ramped, ramp=replace(ramped.ramp, step=2, calls=3))
    trace = simulate(tenths, ramped, any_heater, SCENARIO, PWM)
    followed, readings = np.round(10.0 * trace.followed_degC), np.round(10.0 * trace.reading_degC)
    expected, word, calls = [], 0, 0
    for time, reading in zip(trace.time_s, readings, strict=True):
        asked = 400 if time < 400.9 else 350 if time < 500.2 else 420
        if 600.4 <= time < 640.6:
            calls = 0
        else:
            word = reading if calls == 0 else word
            calls += 1
            word += np.clip(asked - word, -2, 2) if calls % 3 == 0 else 0
        expected.append(word)
    assert followed.tolist() == expected


@pytest.mark.long
@pytest.mark.parametrize("target", TARGETS)
def test_a_run_is_judged_by_the_meter_as_by_its_trace_through_all_of_it(target):
    which = controller_for(target)
    words = which.encode(PidDesign(gain_pct_per_degC=3.0, integral_time_s=60.0, derivative_time_s=0.0,
                                   sample_time_s=which.timer.round(2.0), structure="pi", method=""), Scaling())
    words = replace(words, ramp=which.ramp(words, 20.0)) if which.has_ramp else words
    models = [("one", HEATER), ("two", TwoLag(gain_degC_per_pct=0.5, time_constant_s=40.0, second_time_constant_s=20.0,
                                              dead_time_s=3.0, ambient_degC=20.0))]
    limits = LoopLimits(tolerance_degC=2.0)
    for run in prove_models(which, words, models, SCENARIO, Actuator(pwm_period_s=2.0), Acceptance(limits=limits),
                            Coverage(open_points=False)).runs:
        heater = delay_heater(dict(models)[run.model], which.delay_s)
        own = judge(simulate(which, words, heater, SCENARIO, Actuator(pwm_period_s=2.0), run.switches), limits, where=run.label)
        assert {"reheat_overshoot", "change_time", "restart_overshoot", "power_reserve"} <= {each.name for each in own}
        for metered, traced in zip(run.criteria, own, strict=False):
            assert metered.value == pytest.approx(traced.value, rel=1e-9, abs=1e-9), (run.label, metered.name)
            assert replace(metered, value=0.0, limit=0.0) == replace(traced, value=0.0, limit=0.0)


@pytest.mark.long
@pytest.mark.parametrize("target", ["weg", "s5-ob251"])
def test_the_story_is_the_same_compiled_and_plain_bit_for_bit(target):
    which = controller_for(target)
    words = which.encode(PidDesign(gain_pct_per_degC=3.0, integral_time_s=60.0, derivative_time_s=0.0, sample_time_s=2.0,
                                   structure="pi", method=""), Scaling())
    words = replace(words, ramp=which.ramp(words, 20.0))
    assert_same_compiled_and_plain(which, words, HEATER, SCENARIO, PWM)
