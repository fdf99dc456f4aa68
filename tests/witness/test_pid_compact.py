"""The witness of PID_Compact's equation against its solutions on paper and SciPy's, and its samplings against the equation."""

import math
import random

import numpy as np
import pytest
from scipy.signal import lsim
from tests.witness.pid_compact import ANTI_WINDUP, DERIVATIVES, INTEGRALS, Continuous, Sampled

FORM = {"Kp": 3.0, "TI": 40.0, "TD": 10.0, "a": 0.2, "b": 0.6, "c": 0.3}
WIDE = {"low": -1e9, "high": 1e9}


def test_a_ramp_of_the_reading_gives_the_answer_on_paper():
    # x = −t, w = 0: b·w − x = t; integral t²/(2·TI); v = t: D = TD·(1 − exp(−t/(a·TD)))
    law, t = Continuous(**FORM), 0.0
    for dt in (0.5, 1.0, 3.0, 7.0):
        t += dt
        expected = 3.0 * (t + t * t / 80.0 + 10.0 * (1.0 - math.exp(-t / 2.0)))
        assert law(0.0, -t, dt) == pytest.approx(expected, rel=1e-12)


def test_any_setpoint_and_reading_in_straight_lines_are_as_scipy_integrates_them():
    chance, dt = np.random.default_rng(4), 0.25
    w, x = 100.0 + chance.normal(0, 3, (2, 200)).cumsum(axis=1)
    times, states = dt * np.arange(200), ([[-1 / 2.0]], [[1.0]])
    e, v, p = w - x, 0.3 * w - x, 0.6 * w - x
    _, integral, _ = lsim(([1.0], [40.0, 0.0]), e, times)
    _, lagged, _ = lsim((*states, [[-10.0 / 4.0]], [[10.0 / 2.0]]), v, times, X0=[2.0 * v[0]])  # TD·s/(2·s + 1), at rest in v[0]
    law = Continuous(**FORM, w=w[0], x=x[0])
    now = [law(w[k], x[k], dt) for k in range(1, 200)]
    assert now == pytest.approx(3.0 * (p + integral + lagged)[1:], abs=1e-9)


def test_zeros_switch_parts_off():
    law = Continuous(Kp=2.0, TI=0.0, TD=0.0, a=0.2)
    assert law(5.0, 1.0, 1.0) == 8.0
    sampled = Sampled(2.0, 0.0, 10.0, 0.0, TA=1.0, **WIDE)
    # a = 0: D is there in one call only
    assert [float(sampled(0.0, x)) for x in (0.0, -1.0, -1.0)] == [0.0, 2.0 * (1 + 10), 2.0]


@pytest.mark.parametrize("integral", INTEGRALS)
@pytest.mark.parametrize("derivative", DERIVATIVES)
def test_every_sampling_tends_to_the_equation(integral, derivative):
    def worst(TA):
        law = Continuous(**FORM)
        sampled = Sampled(*FORM.values(), TA=TA, integral=integral, derivative=derivative, anti_windup="none", **WIDE)
        sampled(0.0, 0.0)
        away, rise, last = 0.0, 0.0, 0.0
        for k in range(1, round(60 / TA)):
            w, x = math.sin(0.1 * k * TA), 2.0 * math.sin(0.23 * k * TA)
            y = law(w, x, TA)
            away, rise, last = max(away, abs(y - float(sampled(w, x)))), max(rise, abs(y - last)), y
        return away, rise

    (coarse, _), (fine, rise) = worst(0.2), worst(0.05)
    assert fine <= rise  # as if one call late or early, at most
    assert fine < 0.3 * coarse or coarse < 2e-3  # first order: a quarter


def test_the_ways_to_differ_in_the_first_call_of_a_step_as_on_paper():
    def first(kind):
        sampled = Sampled(1.0, 0.0, 10.0, 0.2, TA=1.0, derivative=kind, **WIDE)
        sampled(0.0, 0.0)
        return float(sampled(0.0, -1.0)) - 1.0

    assert first("backward") == pytest.approx(10.0 / 3.0)
    assert first("bilinear") == pytest.approx(20.0 / 5.0)
    assert first("step") == pytest.approx(5.0)
    assert first("ramp") == pytest.approx(10.0 * (1.0 - math.exp(-0.5)))


@pytest.mark.parametrize("anti_windup", ANTI_WINDUP)
def test_each_anti_windup_as_on_paper(anti_windup):
    # e = 100, Kp = 2, TI = 10, TA = 1: p alone asks for 200 %; then e = −1
    sampled = Sampled(2.0, 10.0, 0.0, 0.2, TA=1.0, anti_windup=anti_windup)
    assert [float(sampled(100.0, 0.0)) for _ in range(20)] == [100.0] * 20
    expected = {"none": 100.0, "hold": 0.0, "clamp": 2.0 * (-1.0 + 50.0 - 0.1), "back": 0.0}[anti_windup]
    assert float(sampled(100.0, 101.0)) == pytest.approx(expected)


def test_in_single_precision_every_operation_is_rounded_so_that_it_stays_near_the_double():
    chance = random.Random(1)
    laws = [Sampled(*FORM.values(), TA=0.5, number=number) for number in (np.float64, np.float32)]
    for _ in range(200):
        w, x = round(chance.uniform(0, 200), 1), round(chance.uniform(0, 200), 1)
        double, single = (law(w, x) for law in laws)
        assert single.dtype == np.float32
        assert float(single) == pytest.approx(float(double), abs=0.05)
