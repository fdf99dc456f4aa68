"""The witness of PID_v1 against arithmetic on paper."""

import numpy as np
import pytest
from tests.witness.arduino_pid import ArduinoPid


def _running(*gains, **how):
    pid = ArduinoPid(*gains, **how)
    pid.set_mode(automatic=True)
    return pid


def _at(pid, now_ms, setpoint, reading):
    pid.setpoint, pid.input = pid.number(setpoint), pid.number(reading)
    assert pid.compute(now_ms)
    return float(pid.output)


def test_three_parts_at_the_sampling_time_of_100_ms():
    pid = _running(2.0, 0.5, 4.0)
    pid.last = np.float64(20.0)
    assert _at(pid, 0, 30, 20) == pytest.approx(2 * 10 + 0.05 * 10)
    assert _at(pid, 100, 30, 21) == pytest.approx(2 * 9 + 0.05 * 19 - 40 * 1) == 0.0 or pid.output == 0.0
    assert _at(pid, 200, 30, 21) == pytest.approx(2 * 9 + 0.05 * 28)


def test_it_computes_in_automatic_only_and_once_the_sampling_time_has_passed_over_the_clocks_end_too():
    pid = ArduinoPid(1, 0, 0, now_ms=2**32 - 50)
    assert not pid.compute(2**32 - 50)
    pid.set_mode(automatic=True)
    assert pid.compute(2**32 - 50)
    assert not pid.compute(40)  # 90 ms later
    assert pid.compute(50)


def test_it_goes_on_summing_while_the_output_is_saturated_up_to_the_limit_of_the_sum():
    pid = _running(10.0, 1.0, 0.0)
    for k in range(100):
        assert _at(pid, 100 * k, 100, 0) == 255.0
    assert pid.sum == 255.0


def test_on_measurement_the_p_part_is_summed_and_setpoint_steps_do_not_kick():
    pid = _running(2.0, 1.0, 0.0, on_measurement=True)
    pid.sum = np.float64(100.0)
    assert _at(pid, 0, 50, 0) == pytest.approx(105.0)
    assert _at(pid, 100, 50, 3) == pytest.approx(105.0 + 4.7 - 6.0)


def test_from_manual_it_goes_on_from_the_output():
    pid = ArduinoPid(1.0, 1.0, 1.0)
    pid.output, pid.input, pid.setpoint = np.float64(300.0), np.float64(70.0), np.float64(70.0)
    pid.set_mode(automatic=True)
    assert _at(pid, 0, 70, 70) == 255.0
    pid.set_mode(automatic=False)
    pid.output = np.float64(40.0)
    pid.set_mode(automatic=True)
    assert _at(pid, 100, 70, 70) == 40.0


def test_a_new_sampling_time_rescales_and_limits_take_effect_at_once():
    pid = _running(1.0, 2.0, 3.0)
    assert (pid.ki, pid.kd) == (pytest.approx(0.2), pytest.approx(30.0))
    pid.set_sample_time(1000)
    assert (pid.ki, pid.kd, pid.sample_ms) == (pytest.approx(2.0), pytest.approx(3.0), 1000)
    pid.set_sample_time(0)
    assert pid.sample_ms == 1000
    pid.output = pid.sum = np.float64(80.0)
    pid.set_output_limits(0, 50)
    assert (pid.output, pid.sum) == (50.0, 50.0)
    pid.set_output_limits(60, 60)
    assert pid.high == 50.0


def test_reverse_turns_the_signs_and_negative_gains_are_refused():
    pid = _running(1.0, 0.0, 0.0, reverse=True)
    assert _at(pid, 0, 10, 30) == 20.0
    pid.set_direction(reverse=False)
    assert _at(pid, 100, 10, 30) == 0.0
    pid.set_tunings(-1, 0, 0)
    assert pid.kp == 1.0


def test_on_avr_a_double_is_single():
    pid = _running(0.1, 0.0, 0.0, number=np.float32)
    assert _at(pid, 0, 30, 20) == float(np.float32(0.1) * np.float32(10))
