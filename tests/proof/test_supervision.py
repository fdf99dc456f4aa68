"""The monitor of whole numbers: what each rule says, worked out by hand, and that a second one says the same."""

import random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.bench.second_monitor import Monitors

from heatertune.errors import OutOfRange
from heatertune.model.model_values import Fopdt
from heatertune.supervision.faulty_loops import HeaterFamily
from heatertune.supervision.monitor import ALARMS, STATE, Numbers, cold, scan, watch
from heatertune.supervision.monitor_design import plane_of

OFF = Numbers(block=2, low=-10**6, high=10**6, jump=10**6, still=0, still_moved=0, moved=20, delay_low=0, delay_high=1,
              slow_blocks=0, slow_scale=1, slow_gain=0, slow_loss=0, slow_rest=0, fast_blocks=0, fast_scale=1, fast_gain=0,
              fast_loss=0, fast_rest=0, full=0, swing=10, growths=0)
HEATER = Fopdt(gain_degC_per_pct=1.0, time_constant_s=100.0, dead_time_s=10.0, ambient_degC=20.0)


def alarms(numbers, readings, powers):
    state = cold()
    return [ALARMS[scan(numbers, state, reading, power)] for reading, power in zip(readings, powers, strict=True)]


def test_a_reading_out_of_the_ends_is_a_sensor_that_is_gone_and_the_ends_themselves_are_not():
    told = alarms(OFF._replace(low=5, high=90), [5, 90, 4, 91], [0] * 4)
    assert told == ["none", "none", "sensor gone", "sensor gone"]


def test_a_reading_may_jump_so_far_and_no_further_and_the_first_one_jumps_from_nothing():
    assert alarms(OFF._replace(jump=7), [50, 57, 50, 58, 50], [0] * 5) == ["none"] * 3 + ["implausible rate"] * 2


def test_a_reading_may_stand_still_so_long_and_a_shorter_time_after_the_power_has_moved():
    assert alarms(OFF._replace(still=3), [50] * 6, [40] * 6) == ["none"] * 4 + ["frozen"] * 2
    # 40 → 59 is no move of 20 %; 40 → 60 is, and back again the time goes on
    assert alarms(OFF._replace(still_moved=2), [50] * 7, [40, 59, 59, 60, 40, 40, 40]) == ["none"] * 5 + ["frozen"] * 2


def test_full_power_may_be_asked_for_so_long_and_99_percent_for_ever():
    assert alarms(OFF._replace(full=2), [50] * 5, [99, 100, 100, 100, 99]) == ["none"] * 3 + ["setpoint out of reach", "none"]


def test_the_windows_hold_the_movement_against_the_power_of_every_delay():
    # a level is the sum of two scans; the third block is the first that has one before it and one before that
    slow = OFF._replace(slow_blocks=1, slow_gain=1, slow_rest=0)
    # without power it need not rise; with 200 in both blocks that may have caused it, 0 < 200
    assert alarms(slow, [10] * 8, [0] * 8) == ["none"] * 8
    assert alarms(slow, [10] * 6, [100] * 6)[5] == "heats too slowly"
    assert alarms(slow, [10, 10, 10, 10, 4, 4], [100] * 6)[5] == "falls although heated"  # by 12, a swing of 10
    assert alarms(slow, [10] * 6, [100, 100, 0, 0, 100, 100])[5] == "none"  # a block ago there was no power
    fast = OFF._replace(fast_blocks=1, fast_gain=1, fast_rest=5)
    rising = [10, 10, 10, 10, 20, 20]
    assert alarms(fast, rising, [0] * 6)[5] == "too hot for its power"  # 20 > 0 + 5
    assert alarms(fast, rising, [0, 0, 8, 8, 0, 0])[5] == "none"  # 20 < 16 + 5, a block ago
    # what is lost to the room grows with the level at the window's begin: 20 > 16 + 5 − 1·20
    assert alarms(fast._replace(fast_loss=1), rising, [0, 0, 8, 8, 0, 0])[5] == "too hot for its power"


def test_swings_that_grow_are_told_and_such_that_do_not_are_not():
    numbers = OFF._replace(growths=2)
    ends = [0, 20, 0, 30, -20, 40, 30]  # swings of 20, 20, 30, 50, 60 counts
    growing = [level for level in ends for _ in range(2)]
    assert alarms(numbers, growing, [0] * len(growing))[-1] == "swing grows"
    steady = [level for level in [0, 20] * 8 for _ in range(2)]
    assert "swing grows" not in alarms(numbers, steady, [0] * len(steady))


def random_numbers(chance):
    one = chance.choice
    return Numbers(
        block=one([1, 2, 3, 5]), low=one([-100, 5]), high=one([900, 1000]), jump=one([40, 200]), still=one([0, 4, 9]),
        still_moved=one([0, 3]), moved=20, delay_low=one([0, 1]), delay_high=one([1, 3, 6]), slow_blocks=one([0, 2, 5]), slow_scale=64,
        slow_gain=chance.randint(0, 9), slow_loss=chance.randint(0, 2), slow_rest=-chance.randint(0, 9000), fast_blocks=one([0, 2, 5]),
        fast_scale=64, fast_gain=chance.randint(0, 9), fast_loss=chance.randint(0, 2), fast_rest=chance.randint(0, 90000),
        full=one([0, 20]), swing=one([3, 30]), growths=one([0, 2, 4]))


@pytest.mark.long(seconds=2)
def test_a_second_monitor_written_from_the_meaning_of_the_numbers_says_the_same_at_every_scan():
    chance, said = random.Random(1), set()
    for _ in range(40):
        numbers, state, reading, power = random_numbers(chance), cold(), 500.0, 50.0
        second = Monitors(numbers._asdict(), 1)
        for _ in range(700):
            reading += chance.gauss(0, 12) if chance.random() < 0.3 else 0.0
            reading += chance.gauss(0, 90) if chance.random() < 0.01 else 0.0
            power = max(0.0, min(100.0, power + chance.gauss(0, 40))) if chance.random() < 0.2 else power
            alarm = scan(numbers, state, int(reading), int(power))
            assert alarm == second.feed(np.array([int(reading)]), np.array([int(power)]))[0]
            said.add(ALARMS[alarm])
    assert said == set(ALARMS)


def test_it_begins_anew_after_an_outage_and_a_record_tells_its_first_alarm():
    numbers = OFF._replace(still=3)
    held = np.full(12, 50)
    power = np.full(12, 40)
    assert watch(numbers, cold(), held, power, 0) == (4, ALARMS.index("frozen"))
    power[3:5] = -1  # no supply: from scan 5 on it counts anew
    assert watch(numbers, cold(), held, power, 0) == (9, ALARMS.index("frozen"))
    assert watch(numbers, cold(), held, power, 11) == (11, ALARMS.index("frozen"))
    assert watch(OFF, cold(), held, power, 0) == (-1, 0)


def test_its_state_stays_small_however_long_it_runs():
    state = [0] * STATE
    for k in range(2000):
        scan(OFF._replace(still=5), state, 27648, 100)
        assert k < 20 or max(state) <= 2 * 27648


@given(st.integers(0, 10**6), st.booleans(), st.sampled_from([30, 3000, 300000]))
def test_no_movement_that_was_seen_crosses_the_plane_that_was_made_of_it(seed, largest, size):
    chance = np.random.default_rng(seed)
    level, power = chance.integers(0, size, 400), chance.integers(0, 1000, 400)
    move = (power // 3 - level // 5 + chance.integers(-9, 9, 400)).astype(np.int64)
    points = np.array([(size / 2, 0.0), (size / 2, 500.0)])
    plane = plane_of(np.column_stack([move, level, power]), points, largest=largest, share=0.1, more=2.0)
    limit = plane.gain * power - plane.loss * level + plane.rest
    distance = limit - plane.scale * move if largest else plane.scale * move - limit
    assert distance.min() >= 2 * plane.scale  # the margin that was asked for is left
    assert max(np.abs(limit).max(), np.abs(plane.scale * move).max()) < 2**31


def test_every_heater_that_is_drawn_can_hold_its_setpoint_and_is_the_same_again():
    family = HeaterFamily(heaters=[HEATER], setpoint_degC=95.0, scan_s=1.0)
    members = [family.member(corner, corner=corner) for corner in family.corners()] + [family.member(seed) for seed in range(50)]
    assert all(0.0 < member.needs_pct <= 98.0 for member in members)
    assert {round(member.row[1]) for member in members[:32]} == {80, 120}
    assert {round(member.row[3]) for member in members[:32]} == {7, 13}
    assert family.member(7).row == family.member(7).row
    assert np.array_equal(family.member(7).noise(9), family.member(7).noise(9))
    kinds = [type(event).__name__ for event in members[0].scenario.disturbances]
    assert kinds == ["Load"] * 2 + ["NewSetpoint"] * 2 + ["Mains"] * 3 + ["PlcPower"] * 4


@pytest.mark.parametrize(("setpoint", "spread"), [(119.0, 0.2), (20.0, 0.2), (60.0, 0.7), (60.0, -0.1)])
def test_a_family_without_a_heater_is_refused(setpoint, spread):
    with pytest.raises(OutOfRange):
        HeaterFamily(heaters=[HEATER], setpoint_degC=setpoint, scan_s=1.0, spread=spread)
