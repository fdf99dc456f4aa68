"""How long a circuit is open where most has been summed up, against the same sum in small steps."""

import math
from dataclasses import replace

import pytest

from heatertune.model.values import Fopdt, TwoLag
from heatertune.pid.values import PidDesign
from heatertune.plc import Boost, Scaling, controller_for
from heatertune.proof.brief import brief_openings_s
from heatertune.proof.night import nights_of
from heatertune.proof.scenario import Mains, Scenario

ONE = Fopdt(gain_degC_per_pct=1.0, time_constant_s=100.0, dead_time_s=10.0, ambient_degC=20.0)
TWO = TwoLag(gain_degC_per_pct=1.0, time_constant_s=100.0, second_time_constant_s=40.0, dead_time_s=10.0, ambient_degC=20.0)
DESIGN = PidDesign(gain_pct_per_degC=3.0, integral_time_s=80.0, derivative_time_s=0.0, sample_time_s=1.0, structure="pi", method="")
ROOM = controller_for("weg")
WORDS = ROOM.encode(DESIGN, Scaling())
REALISED = ROOM.decode(WORDS)
STORY = Scenario(setpoint_degC=60.0, duration_s=9000.0, rests_s=(500.0, 0.0, 50.0), disturbances=(
    Mains(time_s=1000.0, share=0.0), Mains(time_s=1800.0, share=1.0)))


def _in_steps(lags, most_pct=100.0, step_s=0.01):
    """When P and I of a heater that cools down by itself ask for so much power [s]; Euler's steps."""
    slow = fast = 40.0
    summed, seconds = 0.0, 0.0
    while 40.0 + REALISED.gain_pct_per_degC * (40.0 - slow + summed / REALISED.integral_time_s) < most_pct:
        if len(lags) > 1:
            fast -= step_s * fast / lags[1]
            slow += step_s * (fast - slow) / lags[0]
        else:
            slow -= step_s * slow / lags[0]
        summed, seconds = summed + step_s * (40.0 - slow), seconds + step_s
    return seconds


@pytest.mark.parametrize("heater", [ONE, TWO])
def test_it_is_about_the_time_until_all_power_is_asked_for_whatever_the_dead_time(heater):
    full = _in_steps(heater.lags_s)
    for late in (heater, replace(heater, dead_time_s=60.0)):
        assert brief_openings_s(ROOM, WORDS, REALISED, STORY, [late]) == pytest.approx([0.85 * full, full, 1.7 * full], rel=2e-3)
    limited = ROOM.limited(WORDS, 70.0)
    assert brief_openings_s(ROOM, limited, REALISED, STORY, [heater])[1] == pytest.approx(_in_steps(heater.lags_s, 70.0), rel=2e-3)


def test_it_is_open_for_longer_where_a_ramp_leads_the_setpoint_back():
    ramped = replace(WORDS, ramp=ROOM.ramp(WORDS, 2.0))
    times = brief_openings_s(ROOM, ramped, REALISED, STORY, [ONE])
    assert times[3:] == pytest.approx([2.5 * _in_steps(ONE.lags_s)], rel=2e-3)


def test_it_ends_before_a_boost_takes_the_heater_back():
    boosted = WORDS.boosted(Boost(within_degC=6.0, again_degC=8.0))
    falls = 100.0 * math.log(40.0 / 32.0)  # 8 of the 40 °C, by itself
    full = _in_steps(ONE.lags_s)
    assert falls < 0.85 * full
    assert brief_openings_s(ROOM, boosted, REALISED, STORY, [ONE]) == pytest.approx([0.95 * falls, 0.98 * falls])


def test_without_an_i_part_nothing_is_summed_up():
    assert brief_openings_s(ROOM, WORDS, replace(REALISED, integral_time_s=math.inf, structure="p"), STORY, [ONE]) == []
    assert brief_openings_s(ROOM, WORDS, None, STORY, [ONE]) == []


def test_the_shorter_circuits_come_one_after_the_other_each_with_its_way_back():
    *_, night = nights_of(STORY, [ONE], (20.0, 30.0))
    assert night.name == "briefly-open"
    # after the heat-up, at rest for as long as after any other part; 7,200 s are the way back
    assert [each.time_s for each in night.scenario.disturbances] == [550.0, 570.0, 7770.0, 7800.0]
    assert [each.share for each in night.scenario.disturbances] == [0.0, 1.0, 0.0, 1.0]
    assert night.scenario.rests_s == (50.0, 0.0, 50.0, 0.0, 50.0)
    assert night.scenario.duration_s == 15000.0
