"""The witness of the IEC blocks against what can be worked out by hand, and against exact fractions."""

import random
from fractions import Fraction

import numpy as np
import pytest
from tests.witness.iec_pid import REAL, Derivative, Integral, Pid, RepairedPid, time_to_real


def test_a_time_is_seconds_as_matiec_makes_it_or_milliseconds():
    assert time_to_real(1500) == 1.5
    assert time_to_real(100) == REAL(0.1)
    assert time_to_real(100, milliseconds=True) == 100.0


def test_the_derivative_of_a_ramp_comes_in_within_four_calls():
    block = Derivative()  # from zeros: (3·(x − x₃) + x₁ − x₂)/10 of 0, 1, 2, …
    assert [float(block(True, REAL(x), REAL(1))) for x in range(6)] == [0.0, float(REAL(0.3)), float(REAL(0.7)), 1.0, 1.0, 1.0]
    assert block(False, REAL(9), REAL(1)) == 0.0
    assert block(True, REAL(9), REAL(1)) == 0.0


def test_the_integral_adds_input_times_cycle_holds_and_is_set():
    block = Integral()
    assert [float(block(True, False, REAL(2), REAL(7), REAL(0.5))) for _ in range(3)] == [1.0, 2.0, 3.0]
    assert block(False, False, REAL(2), REAL(7), REAL(0.5)) == 3.0
    assert block.Q
    assert block(True, True, REAL(2), REAL(7), REAL(0.5)) == 7.0
    assert not block.Q


def test_manual_gives_kp_times_the_wanted_output_and_error_is_reading_less_setpoint():
    block = Pid(KP=2.5, TR=20.0, TD=0.0, cycle_ms=1000)
    assert block(False, PV=50.0, SP=60.0, X0=30.0) == 75.0
    assert block.ERROR == -10.0


def test_a_first_call_in_auto_is_the_sum_of_its_three_parts():
    block = Pid(KP=2.0, TR=8.0, TD=4.0, cycle_ms=500)
    # ERROR −4: I −4·0.5/8 = −0.25; D (3·−4)/(10·0.5)·4 = −9.6; 2·(−4.25 − 9.6) = −27.7
    assert float(block(True, PV=16.0, SP=20.0)) == pytest.approx(-27.7, rel=1e-6)


def test_nothing_is_limited_and_a_reset_time_of_zero_gives_no_number():
    block = Pid(KP=1.0, TR=1.0, TD=0.0, cycle_ms=1000)
    assert max(float(block(True, PV=100.0, SP=0.0)) for _ in range(1000)) == 100_100.0
    assert np.isnan(Pid(KP=1.0, TR=0.0, TD=0.0, cycle_ms=1000)(False, PV=1.0, SP=2.0))
    assert np.isinf(Pid(KP=1.0, TR=0.0, TD=0.0, cycle_ms=1000)(True, PV=1.0, SP=2.0))


def test_it_is_the_exact_law_but_for_what_single_precision_rounds():
    chance = random.Random(5)
    kp, tr, td, cycle = 3.25, 120.0, 24.0, 250
    block, errors, total, t = Pid(kp, tr, td, cycle), [0, 0, 0], Fraction(0), Fraction(1, 4)
    for _ in range(300):
        pv, sp = round(chance.uniform(0, 300) * 8) / 8, round(chance.uniform(0, 300) * 8) / 8
        e = Fraction(pv) - Fraction(sp)
        total += e * t
        d = (3 * (e - errors[2]) + errors[0] - errors[1]) / (10 * t)
        errors = [e, *errors[:2]]
        exact = float(Fraction(kp) * (e + total / Fraction(tr) + d * Fraction(td)))
        assert float(block(True, pv, sp)) == pytest.approx(exact, rel=1e-5, abs=2e-2)


def test_the_repaired_block_heats_when_cold_within_its_limits_and_does_not_wind_up():
    block = RepairedPid(KP=2.0, TR=10.0, TD=0.0, cycle_ms=1000)
    assert [float(block(True, PV=20.0, SP=120.0)) for _ in range(500)] == [100.0] * 500
    assert block.integral == 0.0
    assert float(block(True, PV=119.0, SP=120.0)) == pytest.approx(2.0 * (1.0 + 0.1))
    for _ in range(5):
        assert float(block(True, PV=300.0, SP=120.0)) == 0.0
    assert float(block.integral) == 1.0


def test_the_repaired_block_goes_from_manual_to_automatic_without_a_bump():
    block = RepairedPid(KP=2.0, TR=10.0, TD=30.0, cycle_ms=1000)
    assert block(False, PV=80.0, SP=100.0, X0=35.0) == 35.0
    assert float(block(True, PV=80.0, SP=100.0)) == pytest.approx(35.0 + 2.0 * 20.0 * 1.0 / 10.0)
    assert block(False, PV=80.0, SP=100.0, X0=135.0) == 100.0


def test_the_repaired_block_without_reset_time_is_proportional():
    block = RepairedPid(KP=2.0, TR=0.0, TD=0.0, cycle_ms=1000)
    assert [float(block(True, PV=90.0, SP=100.0)) for _ in range(9)] == [20.0] * 9
