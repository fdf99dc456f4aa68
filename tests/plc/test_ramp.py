"""The setpoint ramp by itself: rows worked out by hand, and its laws."""

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.witness.setpoint_course import course

from heatertune.errors import InputError, OutOfRange
from heatertune.pid.design_values import PidDesign
from heatertune.plc import TARGETS, Ramp, Scaling, controller_for
from heatertune.plc.ramp import nearest, next_setpoint

DESIGN = PidDesign(gain_pct_per_degC=3.0, integral_time_s=300.0, derivative_time_s=0.0, sample_time_s=4.0, structure="pi",
                   method="")
RAMPED = [name for name in TARGETS if controller_for(name).has_ramp]
words_ = st.integers(-2047, 2047)
ramps = st.builds(Ramp, step=st.integers(1, 300), calls=st.integers(1, 7))
singles = st.floats(0.0, 1000.0, width=32)


def _words(target, scaling=None):
    which = controller_for(target)
    return which.encode(replace(DESIGN, sample_time_s=which.timer.round(DESIGN.sample_time_s)), scaling or Scaling())


def test_a_target_that_tells_of_a_setpoint_ramp_has_one():
    assert [name for name in TARGETS if any("setpoint ramp" in told for told in controller_for(name).can)] == RAMPED


@pytest.mark.parametrize(("ramp", "begin", "asked", "rows"), [
    # OB251, 0…100 °C = 0…2047 units: from 24 °C (491) to 27 °C (552), 20 units every second call
    (Ramp(step=20, calls=2), 491, 552, [491, 511, 511, 531, 531, 551, 551, 552, 552, 552]),
    (Ramp(step=20), 552, 491, [532, 512, 492, 491, 491]),
    (Ramp(step=20), -30, 30, [-10, 10, 30, 30]),
    (Ramp(step=61), 491, 552, [552, 552]),
    (Ramp(step=5, calls=3), 500, 500, [500, 500, 500, 500]),
    (Ramp(step=0.25, calls=2), 24.0, 24.625, [24.0, 24.25, 24.25, 24.5, 24.5, 24.625, 24.625]),
    (None, 491, 552, [552, 552]),
], ids=["every second call", "down", "through zero", "one step", "no way", "single precision", "no ramp"])
def test_a_ramp_is_the_row_worked_out_by_hand(ramp, begin, asked, rows):
    assert course(ramp, [begin] * len(rows), asked) == rows


@pytest.mark.parametrize(("ramp", "readings", "asked", "rows"), [
    # the reading follows late, falls while the circuit is open, and comes back: the setpoint is 30 above it at most
    (Ramp(step=20, hold=30), [500, 500, 505, 515, 470, 480, 500], 560, [520, 530, 535, 545, 500, 510, 530]),
    # down: not below the reading less 30; from there on it waits, and is not lifted when the reading rises
    (Ramp(step=20, hold=30), [560, 560, 555, 540, 545, 570, 520], 500, [540, 530, 525, 510, 510, 510, 500]),
    # between the steps it does not rise, but falls with the reading
    (Ramp(step=20, calls=2, hold=30), [500, 500, 470, 470, 480, 510], 560, [500, 520, 500, 500, 500, 520]),
    # it is where it shall be, and the heater too hot: it stays
    (Ramp(step=20, hold=30), [500, 600, 600], 500, [500, 500, 500]),
    (Ramp(step=0.5, hold=0.25), [24.0, 24.0, math.nan, 24.25], 25.0, [24.25, 24.25, 24.75, 24.5]),
    # a cooler's: the first row, each number below 560 now as far above it
    (Ramp(step=20, hold=-30), [620, 620, 615, 605, 650, 640, 620], 560, [600, 590, 585, 575, 620, 610, 590]),
    (Ramp(step=0.5, hold=-0.25), [26.0, 26.0, math.nan, 25.75], 25.0, [25.75, 25.75, 25.25, 25.5]),
], ids=["up", "down", "between steps", "at rest", "single precision, a broken sensor", "cooler", "cooler, single precision"])
def test_a_holdback_is_the_row_worked_out_by_hand(ramp, readings, asked, rows):
    assert course(ramp, readings, asked) == rows


@given(ramps, st.integers(1, 300), st.lists(words_, min_size=1, max_size=40), words_)
def test_a_held_setpoint_is_not_above_the_band_and_goes_down_on_purpose_only(ramp, hold, readings, asked):
    ramp = replace(ramp, hold=hold)
    way = [readings[0], *course(ramp, readings, asked)]
    for before, word, reading in zip(way[:-1], way[1:], readings, strict=True):
        assert word <= reading + hold
        assert word - before <= ramp.step
        if word < before:
            assert before > reading + hold or (before > asked and word >= reading - hold)


@given(ramps, st.integers(1, 300), st.lists(words_, min_size=1, max_size=40), words_)
def test_a_cooler_is_held_as_its_mirror_image(ramp, hold, readings, asked):
    heating = course(replace(ramp, hold=hold), readings, asked)
    assert course(replace(ramp, hold=-hold), [-one for one in readings], -asked) == [-word for word in heating]


def test_a_holdback_of_a_room_is_told_in_its_units_and_read_back():
    # 2 °C of 0…100 °C: 40.94 of 2047 units
    found, words = controller_for("s5-ob251"), _words("s5-ob251")
    ramp = found.ramp(words, 3.0, hold_degC=2.0)
    assert ramp == Ramp(step=4, hold=41)
    assert found.hold_degC(replace(words, ramp=ramp)) == pytest.approx(41 / 20.47)
    assert found.ramp(words, 3.0, hold_degC=-2.0) == replace(ramp, hold=-41)
    assert found.hold_degC(replace(words, ramp=replace(ramp, hold=-41))) == found.hold_degC(replace(words, ramp=ramp))
    assert found.hold_degC(words) is found.hold_degC(replace(words, ramp=Ramp(step=4))) is None
    assert controller_for("weg").ramp(_words("weg"), 3.0, hold_degC=2.0).hold == 2.0
    with pytest.raises(OutOfRange, match="setpoint_hold_degC = 0"):
        found.ramp(words, 3.0, hold_degC=0.0)
    with pytest.raises(OutOfRange, match="ramp hold = 3000"):
        found.check_ramp(replace(words, ramp=Ramp(step=4, hold=3000)))


@given(ramps, words_, words_)
def test_a_ramp_never_turns_never_goes_beyond_and_arrives_when_the_steps_are_done(ramp, begin, asked):
    arrival = math.ceil(abs(asked - begin) / ramp.step) * ramp.calls
    way = np.array([begin, *course(ramp, [begin] * (arrival + 3), asked)])
    sign = -1 if asked < begin else 1
    assert (np.diff(way) * sign >= 0).all()
    assert (np.abs(np.diff(way)) <= ramp.step).all()
    assert ((asked - way) * sign >= 0).all()
    assert (way[arrival:] == asked).all()
    assert arrival == 0 or way[arrival - 1] != asked, "it did not arrive before"


@given(singles, singles, st.floats(0.5, 50.0, width=32))
def test_a_ramp_of_reals_stays_in_single_precision_and_arrives(begin, asked, step):
    way = course(Ramp(step=step), [begin] * (math.ceil(abs(asked - begin) / step) + 5), asked)
    assert way[-1] == asked
    assert all(float(np.float32(each)) == each for each in way)
    # NumPy's float32 does the same sums
    value, end, by = np.float32(begin), np.float32(asked), np.float32(step)
    for each in way[:40]:
        value = min(value + by, end) if value < end else max(value - by, end)
        assert float(value) == each


def test_a_setpoint_that_is_no_number_is_left_at_once():
    assert next_setpoint(math.nan, 40.0, Ramp(step=0.5), 20.0) == 40.0


@given(st.floats(0.001, 500.0))
def test_a_whole_ramp_meets_its_rate_within_5_percent_with_the_fewest_calls(per_call):
    def misses(calls):
        step = max(1, math.floor(Fraction(per_call) * calls + Fraction(1, 2)))  # no tie decides: it is 5 % off before
        return abs(step / (Fraction(per_call) * calls) - 1)

    found = nearest(per_call, whole=True, least=1.0)
    assert abs(found.step / found.calls / per_call - 1.0) <= 0.05
    assert isinstance(found.step, int)
    assert all(misses(calls) > Fraction(5, 100) for calls in range(1, found.calls))


@given(st.floats(1e-4, 10.0), st.floats(0.01, 0.5))
def test_a_ramp_of_reals_moves_by_a_count_or_more_and_no_oftener_than_it_must(per_call, count):
    found = nearest(per_call, whole=False, least=count)
    assert found.step == np.float32(per_call * found.calls)
    assert found.step >= count * (1.0 - 1e-6)
    assert found.calls == 1 or per_call * (found.calls - 1) < count


@pytest.mark.parametrize(("target", "ramp", "rate"), [
    # 3 °C/min at TA = 4 s is 0.2 °C per call: 4.094 units of 2047, 0.51 counts of 255, 64 of 32000, 55.296 of 27648
    ("s5-ob251", Ramp(step=4), 4 / 20.47 * 15),
    ("s7-200", Ramp(step=1, calls=2), 1 / 2.55 / 2 * 15),
    ("s7-200-pid", Ramp(step=64), 3.0),
    ("s7-300", Ramp(step=55), 55 / 276.48 * 15),
    ("fb41", Ramp(step=55), 55 / 276.48 * 15),
    ("weg", Ramp(step=float(np.float32(0.2))), 3.0),
])
def test_a_rate_becomes_the_units_of_the_room(target, ramp, rate):
    words = _words(target)
    assert controller_for(target).ramp(words, 3.0) == ramp
    assert controller_for(target).ramp_degC_per_min(replace(words, ramp=ramp)) == pytest.approx(rate, rel=1e-6)
    assert controller_for(target).ramp_degC_per_min(words) == math.inf


def test_the_rate_holds_for_every_sensor_range():
    # 200 °C of range: 10.235 units per °C, so 0.2 °C are 2.047 units
    assert controller_for("s5-ob251").ramp(_words("s5-ob251", Scaling(low_degC=-50.0, high_degC=150.0)), 3.0) == Ramp(step=2)


@pytest.mark.parametrize("target", RAMPED)
@pytest.mark.parametrize("rate", [0.0, -1.0, math.nan, math.inf, 1e5, 1e-9])
def test_a_rate_that_is_no_ramp_is_refused_by_name(target, rate):
    with pytest.raises(OutOfRange, match="ramp"):
        controller_for(target).ramp(_words(target), rate)


def test_the_fastest_rate_named_in_the_refusal_is_the_sensors_range_in_one_call():
    with pytest.raises(OutOfRange, match=r"< 1500, the sensor's whole range"):
        controller_for("s5-ob251").ramp(_words("s5-ob251"), 1500.0)
    assert controller_for("s5-ob251").ramp(_words("s5-ob251"), 1490.0).step == 2033


def test_only_some_controllers_have_no_ramp_and_say_so():
    assert sorted(set(TARGETS) - set(RAMPED)) == [
        "arduino-pid", "esphome", "iec-pid-text", "klipper", "marlin", "on-off", "pband", "pid-compact", "pid-temp", "s7-200-paper", "simple-pid"]
    for name in set(TARGETS) - set(RAMPED):
        assert any("no setpoint ramp" in line for line in controller_for(name).cannot)
        with pytest.raises(InputError, match=f"{name} has no setpoint ramp"):
            controller_for(name).ramp(_words(name), 3.0)
        with pytest.raises(InputError, match=f"{name} has no setpoint ramp"):
            controller_for(name).check_ramp(replace(_words(name), ramp=Ramp(step=1)))


@pytest.mark.parametrize(("target", "step"), [
    ("s5-ob251", 0.5), ("s5-ob251", 2047), ("s7-200", 255), ("s7-200-pid", 32000), ("weg", 3), ("weg", 100.0),
    ("weg", 0.0078125),  # below 100 °C/4095
])
def test_a_ramp_that_the_setpoint_word_cannot_follow_is_refused(target, step):
    with pytest.raises(OutOfRange, match="ramp step"):
        controller_for(target).check_ramp(replace(_words(target), ramp=Ramp(step=step)))


@pytest.mark.parametrize("bad", [{"step": 0}, {"step": -3}, {"step": math.nan}, {"step": 0.1}, {"step": 1, "calls": 0},
                                 {"step": 1, "calls": 2.0}, {"step": 1, "calls": True}, {"step": 1, "calls": 40000},
                                 {"step": 1, "hold": 0}, {"step": 1, "hold": 2.0}, {"step": 0.5, "hold": 0.1}])
def test_a_ramp_that_makes_no_sense_is_refused(bad):
    with pytest.raises(OutOfRange, match="ramp"):
        Ramp(**bad)


def test_a_ramp_says_what_it_is():
    assert str(Ramp(step=4, hold=41)) == "4 units every call, held within 41 units of the reading"
    assert str(Ramp(step=4, hold=-41)) == "4 units every call, held within 41 units of the reading (of a cooler)"
    assert (str(Ramp(step=4)), str(Ramp(step=0.25, calls=3))) == ("4 units every call", "0.25 °C every 3 calls")


@pytest.mark.parametrize(("whole", "least"), [(True, 1.0 / 1.05), (False, 1.0)])
def test_a_step_takes_as_many_calls_as_a_counter_counts(whole, least):
    assert nearest(least / 32766.9, whole=whole, least=1.0).calls == 32767  # an INT
    with pytest.raises(OutOfRange, match="32767 calls"):
        nearest(least / 32767.1, whole=whole, least=1.0)


def test_a_slow_ramp_moves_no_less_than_a_step_of_the_module_wherever_the_range_begins():
    which = controller_for("weg")
    design = PidDesign(gain_pct_per_degC=2.0, integral_time_s=60.0, derivative_time_s=0.0, sample_time_s=1.0, structure="pi", method="")
    low, high = (which.encode(design, Scaling(low_degC=low, high_degC=low + 100.0)) for low in (0.0, 900.0))
    assert which.ramp(low, 0.05) == which.ramp(high, 0.05)
    assert which.ramp(high, 0.05).step >= 100.0 / which.counts
