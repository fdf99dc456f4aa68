import pytest
from hypothesis import given
from hypothesis import strategies as st

from heatertune.errors import OutOfRange, UnknownName
from heatertune.options import options_of
from heatertune.plc import TARGETS, controller_for
from heatertune.plc.pwm import RULES, Actuator, on_time, pid_compact, pulse_ends, pulsegen, switched_by, tick_for
from heatertune.proof.prove_words import default_pwm_period_s
from heatertune.settings import Conditions

powers = st.lists(st.floats(0.0, 100.0), min_size=1, max_size=40)


@st.composite
def actuators(draw, rules=("drop", "carry")):
    period = draw(st.floats(0.5, 60.0))
    resolution = period / draw(st.integers(1, 500))
    on = draw(st.floats(0.0, 0.5)) * period
    return Actuator(
        pwm_period_s=period, resolution_s=resolution, minimum_on_s=on, minimum_off_s=draw(st.floats(0.0, 0.5)) * period,
        minimum_rule=draw(st.sampled_from(rules)),
    )


def _pulses(actuator, asked):
    carried, pulses = 0.0, []
    for power in asked:
        on, carried = on_time(power, carried, actuator.numbers)
        pulses.append(on)
    return pulses, carried


def test_thirty_percent_of_ten_calls_are_three_on_and_seven_off():
    # PULSEGEN, system software manual vol. 2: 30 % with 10 calls per period
    assert on_time(30.0, 0.0, Actuator(pwm_period_s=10.0, resolution_s=1.0).numbers)[0] == pytest.approx(3.0)


def test_a_pulse_that_is_too_short_is_made_up_in_the_next_period():
    # PID_Compact's documentation: 15 % asked for, 20 % the least; one period without pulse, the next with both
    actuator = Actuator(pwm_period_s=1.0, resolution_s=0.1, minimum_on_s=0.2, minimum_rule="carry")
    assert _pulses(actuator, [15.0] * 4)[0] == pytest.approx([0.0, 0.3, 0.0, 0.3])


def test_pulsegen_counts_calls_and_never_makes_up_what_it_left_out():
    # system software manual vol. 2, FB43: 30 % in 10 calls: 3 on, 7 off; below P_B_TM nothing, above PER_TM − P_B_TM all
    block = pulsegen(pwm_period_s=10.0, call_interval_s=1.0, minimum_s=2.0)
    assert _pulses(block, [30.0, 34.0, 15.0, 15.0, 19.0, 20.0, 80.0, 81.0, 85.0, 100.0])[0] == pytest.approx(
        [3.0, 3.0, 0.0, 0.0, 0.0, 2.0, 8.0, 10.0, 10.0, 10.0]
    )


def test_pid_compact_rounds_its_minimum_times_to_calls_and_makes_up_what_it_left_out():
    # Siemens's example: 15 % with a minimum of 20 %: a period without pulse, then one with both
    block = pid_compact(pwm_period_s=1.0, call_interval_s=0.1, minimum_on_s=0.2)
    assert _pulses(block, [15.0] * 4)[0] == pytest.approx([0.0, 0.3, 0.0, 0.3])
    rounded = pid_compact(pwm_period_s=10.0, call_interval_s=1.0, minimum_on_s=1.6, minimum_off_s=2.4)
    assert (rounded.minimum_on_s, rounded.minimum_off_s) == (2.0, 2.0)
    # 85 % leaves a pause of 1.5 s, too short: full on, and the next pulse is shorter by what was too much
    assert _pulses(rounded, [85.0, 60.0])[0] == pytest.approx([10.0, 5.0])  # 6 − 1.5, rounded half up to 5 calls


def test_a_rule_by_name_is_the_blocks_switch():
    times = {"pwm_period_s": 10.0, "resolution_s": 0.5, "minimum_on_s": 1.2}
    assert switched_by("pulsegen", **times) == pulsegen(pwm_period_s=10.0, call_interval_s=0.5, minimum_s=1.2)
    assert switched_by("pid-compact", **times, minimum_off_s=2.0) == pid_compact(
        pwm_period_s=10.0, call_interval_s=0.5, minimum_on_s=1.2, minimum_off_s=2.0
    )
    assert switched_by(None, **times) == Actuator(**times)
    assert tuple(RULES) == options_of(Conditions)["pwm_rule"].choices
    assert [switched_by(rule, **times).block for rule in (None, *RULES)] == [None, *RULES]
    with pytest.raises(UnknownName, match="pulsegen, pid-compact"):
        switched_by("relay", pwm_period_s=1.0)
    with pytest.raises(UnknownName, match="relay"):
        Actuator(pwm_period_s=1.0, block="relay")
    with pytest.raises(OutOfRange, match="one P_B_TM"):
        switched_by("pulsegen", pwm_period_s=10.0, minimum_on_s=1.0, minimum_off_s=2.0)
    with pytest.raises(OutOfRange, match="resolution_s"):
        switched_by("pid-compact", pwm_period_s=10.0, resolution_s=0.0)


def test_a_switch_is_told_in_a_few_words():
    assert Actuator(pwm_period_s=4.0).summary == "PWM period 4 s in steps of 0.01 s"
    assert pulsegen(pwm_period_s=10.0, call_interval_s=0.5, minimum_s=1.0).summary == (
        "PWM period 10 s in steps of 0.5 s, no pulse below 1 s, no pause below 1 s, what is too short is left out, "
        "as pulsegen does it")
    assert pid_compact(pwm_period_s=10.0, call_interval_s=0.5).summary.endswith("what is left out is made up, as pid-compact does it")


def test_bursts_of_whole_waves_make_up_what_is_left_in_the_next_one():
    # a third of ten waves of 50 Hz: 3⅓ waves a burst, so 10 in three bursts; a plain switch gives 9
    times = {"pwm_period_s": 0.2, "resolution_s": 0.02}
    waves = [round(on / 0.02) for on in _pulses(switched_by("burst", **times), [100.0 / 3.0] * 6)[0]]
    assert waves == [3, 4, 3, 3, 4, 3]
    assert sum(_pulses(switched_by(None, **times), [100.0 / 3.0] * 6)[0]) == pytest.approx(18 * 0.02)
    # beside a block's, its least times are not rounded to calls
    assert switched_by("burst", **times, minimum_on_s=0.05, minimum_off_s=0.03).numbers == (0.2, 0.02, 0.05, 0.03, True)


def test_a_pulse_that_is_too_short_is_dropped():
    actuator = Actuator(pwm_period_s=10.0, resolution_s=0.1, minimum_on_s=2.0)
    assert _pulses(actuator, [15.0, 19.9, 20.0])[0] == pytest.approx([0.0, 0.0, 2.0])


def test_a_pause_that_is_too_short_is_closed():
    actuator = Actuator(pwm_period_s=10.0, resolution_s=0.1, minimum_off_s=2.0)
    assert _pulses(actuator, [85.0, 80.1, 80.0])[0] == pytest.approx([10.0, 10.0, 8.0])


def test_rounding_does_not_make_a_pause_too_short():
    actuator = Actuator(pwm_period_s=10.0, resolution_s=1.0, minimum_off_s=1.5)
    assert _pulses(actuator, [85.0, 84.0])[0] == pytest.approx([10.0, 8.0])


@pytest.mark.parametrize(("period", "resolution"), [(0.7, 0.1), (0.3, 0.1), (7.0, 0.007), (1.1, 0.1), (10.0, 0.01)])
def test_full_power_has_no_pause_and_no_power_no_pulse(period, resolution):
    numbers = Actuator(pwm_period_s=period, resolution_s=resolution).numbers
    assert on_time(100.0, 0.0, numbers)[0] == period
    assert on_time(0.0, 0.0, numbers)[0] == 0.0


@given(actuator=actuators(), asked=powers)
def test_every_pulse_and_pause_is_long_enough(actuator, asked):
    for on in _pulses(actuator, asked)[0]:
        off = actuator.pwm_period_s - on
        assert on == 0.0 or on >= actuator.minimum_on_s - 1e-6
        assert off == 0.0 or off >= actuator.minimum_off_s - 1e-6
        assert 0.0 <= on <= actuator.pwm_period_s


@given(actuator=actuators(rules=("carry",)), asked=powers)
def test_carrying_loses_no_energy(actuator, asked):
    pulses, carried = _pulses(actuator, asked)
    wanted = sum(asked) / 100.0 * actuator.pwm_period_s
    assert sum(pulses) + carried == pytest.approx(wanted, abs=1e-6)
    most = max(actuator.minimum_on_s, actuator.minimum_off_s) + actuator.resolution_s
    assert abs(carried) <= most


@given(actuator=actuators(rules=("drop",)), less=st.floats(0.0, 100.0), more=st.floats(0.0, 100.0))
def test_dropping_never_gives_a_longer_pulse_for_less_power(actuator, less, more):
    less, more = sorted((less, more))
    assert on_time(less, 0.0, actuator.numbers)[0] <= on_time(more, 0.0, actuator.numbers)[0]


@given(power=st.floats(0.0, 100.0), parts=st.integers(1, 1000))
def test_rounding_costs_at_most_half_the_resolution(power, parts):
    actuator = Actuator(pwm_period_s=10.0, resolution_s=10.0 / parts)
    assert on_time(power, 0.0, actuator.numbers)[0] == pytest.approx(power / 10.0, abs=5.0 / parts + 1e-6)


@pytest.mark.parametrize(("field", "settings"), [
    ("pwm_period_s", {"pwm_period_s": 0.0}),
    ("resolution_s", {"pwm_period_s": 1.0, "resolution_s": 1.1}),
    ("minimum_on_s", {"pwm_period_s": 1.0, "minimum_on_s": -0.1}),
    ("minimum_off_s", {"pwm_period_s": 1.0, "minimum_on_s": 0.6, "minimum_off_s": 0.5}),
    ("minimum_rule", {"pwm_period_s": 1.0, "minimum_rule": "keep"}),
])
def test_an_actuator_that_cannot_be_is_refused(field, settings):
    with pytest.raises(OutOfRange, match=field):
        Actuator(**settings)


@pytest.mark.parametrize(("interval", "period", "resolution"), [
    (17.0, 8.5, 0.1),  # 85 ticks, as OB13 is called every 100 ms where nobody changes SD97
    (23.0, 5.75, 0.05),  # 57½ of them are none
    (2.0, 2.0, 0.02),  # 20 would be steps of 5 %
    (5.0, 5.0, 0.1), (4.9, 4.9, 0.05),  # 50 are steps of 2 %, 49 would be more
    (0.2, 0.2, 0.01),  # the finest, 20 of them
    (17.0, 17.0 / 3.0, 0.01),  # no clock of 10 ms makes it: a switch of its own
])
def test_a_target_with_a_clock_gets_its_ticks(interval, period, resolution):
    assert tick_for(0.1, sample_time_s=interval, pwm_period_s=period) == pytest.approx(resolution)
    assert tick_for(None, sample_time_s=interval, pwm_period_s=period) == 0.01


def test_the_clock_of_each_target_is_that_of_its_cpu():
    # a printer's pulses are of its own clock, finer than any half-wave
    # a new cyclic interrupt of an S7-1200/1500 is one of 100 ms
    # OB13 is called every 100 ms unless SD97 says otherwise (S5-115U); OB35 and WEG's cycle are set: a half-wave of 50 Hz
    assert {name: controller_for(name).tick_s for name in TARGETS if controller_for(name).tick_s is not None} == {
        "s5-ob251": 0.1, "s7-300": 0.01, "fb41": 0.01, "weg": 0.01, "pid-compact": 0.1, "pid-temp": 0.1, "iec-pid": 0.01, "iec-pid-text": 0.01, "klipper": 1e-5, "marlin": 0.001,
        "arduino-pid": 0.01, "esphome": 0.1, "simple-pid": 0.01}


@pytest.mark.parametrize(("times", "full", "ends"), [
    ({}, 2, (1, 1)),  # a half and the whole: pulses from 1 on, pauses up to 1
    ({}, 1, (1, 0)), ({"resolution_s": 0.1}, 100, (5, 94)),  # 5 % of ten steps are half a step, rounded up
    ({"minimum_on_s": 0.2, "minimum_off_s": 0.3}, 100, (20, 70)),
])
def test_the_first_pulse_and_the_last_pause_of_a_number_are_worked_out(times, full, ends):
    assert pulse_ends(Actuator(pwm_period_s=1.0, **times), lambda number: 100.0 * number / full, full) == ends


@given(st.one_of(st.integers(1, 1000).map(lambda n: n / 100.0), st.integers(11, 600).map(float)))
def test_the_period_that_nobody_chose_is_whole_ticks_of_the_s5(interval):
    # intervals as `Timer.round` makes them; 73.21 s has no whole part in 10 ms, and nobody but its user asks for it
    period = default_pwm_period_s(interval, tick_s=0.1)
    actuator = Actuator(pwm_period_s=period, resolution_s=tick_for(0.1, sample_time_s=interval, pwm_period_s=period))
    ticks = actuator.ticks(interval)
    assert ticks.per_call % ticks.per_period == 0
    assert 0.01 <= actuator.resolution_s <= 0.1
    assert min(interval, 4.9) <= period <= 10.0
    assert default_pwm_period_s(73.21, tick_s=0.1) == 73.21 / 8.0


@pytest.mark.parametrize("period", [1e-9, 9e-4])
def test_a_period_shorter_than_any_pwm_of_a_heater_is_refused(period):
    with pytest.raises(OutOfRange, match=r"pwm_period_s = .* >= 0.001"):
        Actuator(pwm_period_s=period, resolution_s=period)
    assert Actuator(pwm_period_s=1e-3, resolution_s=1e-3).pwm_period_s == 1e-3
