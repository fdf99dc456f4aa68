"""Responses whose symptom is known: formulas of textbook responses, and the paper's own words about its tables."""

import math

import numpy as np
import pytest

from heatertune.errors import OutOfRange
from heatertune.proof.advice import Symptom, observe

TIME = np.arange(0.0, 1200.0, 2.0)


def second_order(damping, period_s=200.0, step=30.0, start=20.0):
    """Return the step response of a second-order system with unit gain: K. Ogata, Modern Control Engineering, ch. 5."""
    wn = 2.0 * math.pi / period_s / math.sqrt(1.0 - damping**2)
    wd, angle = 2.0 * math.pi / period_s, math.acos(damping)
    wave = np.exp(-damping * wn * TIME) / math.sqrt(1.0 - damping**2) * np.sin(wd * TIME + angle)
    return start + step * (1.0 - wave)


def first_order(lag_s, step=30.0, start=20.0):
    return start + step * (1.0 - np.exp(-TIME / lag_s))


@pytest.mark.parametrize("damping", [0.3, 0.4, 0.55])
def test_overshoot_and_decay_are_those_of_the_formula(damping):
    # Ogata: Mp = exp(−π·ζ/√(1 − ζ²)), which is also what each half period leaves of the one before
    left = math.exp(-math.pi * damping / math.sqrt(1.0 - damping**2))
    seen = observe(TIME, second_order(damping), 50.0)
    assert seen.overshoot_pct == pytest.approx(100.0 * left, rel=1e-3)
    assert seen.symptom is Symptom.OVERSHOOT
    if seen.decay is not None:
        assert seen.decay == pytest.approx(left, rel=1e-3)


def test_swings_that_hardly_decay_are_an_oscillation():
    # ζ = 0.05 leaves 85 % per half period: 17 half periods of more than a tenth of the step fit in the record, not all end
    seen = observe(TIME, second_order(0.05), 50.0)
    assert seen.symptom is Symptom.OSCILLATING
    assert seen.decay == pytest.approx(math.exp(-math.pi * 0.05 / math.sqrt(1.0 - 0.05**2)), rel=1e-3)
    assert seen.swings >= 8
    # an undamped one, away from the setpoint
    assert observe(TIME, 35.0 + 15.0 * np.sin(TIME / 30.0 - 1.5), 50.0).symptom is Symptom.OSCILLATING
    # ζ = 0.15 leaves 38 % per period: that decays
    assert observe(TIME, second_order(0.15), 50.0).symptom is Symptom.OVERSHOOT


def test_a_creeping_response_is_slow_or_far_by_where_it_ends():
    # a first-order lag is within 5 % after 3 lags, and 20 % short after 1.61 lags
    assert observe(TIME, first_order(100.0), 50.0).symptom is Symptom.NONE
    assert observe(TIME, first_order(100.0), 50.0).settled_s == pytest.approx(3.0 * 100.0, abs=2.0)
    assert observe(TIME, first_order(300.0), 50.0).symptom is Symptom.SLOW
    assert observe(TIME, first_order(300.0), 50.0, expected_s=901.0).symptom is Symptom.NONE
    assert observe(TIME, first_order(1200.0), 50.0).symptom is Symptom.FAR


def test_a_ripple_at_rest_is_unrest():
    calm = first_order(100.0)
    assert observe(TIME, calm + 1.4 * np.sin(TIME / 5.0), 50.0, expected_s=1e6).symptom is Symptom.RESTLESS
    assert observe(TIME, calm + 0.9 * np.sin(TIME / 5.0), 50.0, expected_s=1e6).symptom is Symptom.NONE
    assert observe(TIME, calm + 1.4 * np.sin(TIME / 5.0), 50.0, expected_s=1e6, tolerance_degC=2.0).symptom is Symptom.NONE


def test_cooling_down_is_judged_as_heating_up():
    up, down = observe(TIME, second_order(0.4), 50.0), observe(TIME, second_order(0.4, step=-30.0), -10.0)
    assert (up.symptom, up.swings, up.step_degC) == (down.symptom, down.swings, -down.step_degC)
    assert up.overshoot_pct == pytest.approx(down.overshoot_pct)


def test_time_begins_with_the_record():
    late = observe(TIME + 5000.0, first_order(100.0), 50.0)
    assert late == observe(TIME, first_order(100.0), 50.0)


def test_without_a_step_there_is_nothing_to_judge():
    with pytest.raises(OutOfRange, match="a step to judge"):
        observe(TIME, first_order(100.0), 20.5)


def test_table_3_is_far_from_its_setpoint(table3):
    # the paper on this run (P, 20 %): "the offset is considerably high"; Table 4's rest, 53.3 °C, is the setpoint it aimed at
    part = table3.window(0.0, 1600.0)
    seen = observe(part.time_s, part.temperature_degC, 53.3)
    assert seen.symptom is Symptom.FAR
    assert seen.distance_degC == pytest.approx(53.3 - 46.2, abs=0.1)


def test_table_4_overshoots_before_it_rests_at_its_setpoint(table4):
    # printed: 55.0 °C at 270 s, 53.3 °C from 1210 to 1600 s, 24.0 °C at the start
    part = table4.window(0.0, 1600.0)
    seen = observe(part.time_s, part.temperature_degC, 53.3)
    assert seen.symptom is Symptom.OVERSHOOT
    assert seen.overshoot_pct == pytest.approx(100.0 * (part.temperature_degC.max() - 53.3) / 29.3)
    assert (seen.distance_degC, seen.swing_degC) == (0.0, 0.0)
