"""The PWM period: ripple against the simulated loop, and what each kind of switch gets."""

import numpy as np
import pytest

from heatertune.errors import InputError, OutOfRange, UnknownName
from heatertune.model.model_values import Fopdt, TwoLag
from heatertune.proof.ripple_and_wear import life, propose_period, ripple_degC

HEATER = Fopdt(gain_degC_per_pct=0.37, time_constant_s=167.0, dead_time_s=12.0, ambient_degC=22.0)
SMOOTH = TwoLag(gain_degC_per_pct=0.37, time_constant_s=167.0, second_time_constant_s=40.0, dead_time_s=12.0)


def _simulated(lags, gain, period, power):
    """Return the peak to peak at rest of lags in series behind a switch, in steps of a thousandth period."""
    states, dt, seen = [gain * power] * len(lags), period / 1000.0, []
    for k in range(30_000):
        fed = gain * (100.0 if k % 1000 < 10.0 * power else 0.0)
        for i, lag in enumerate(lags):
            states[i] += (fed - states[i]) * -np.expm1(-dt / lag)
            fed = states[i]
        seen.append(states[-1])
    return np.ptp(seen[-1000:])


@pytest.mark.parametrize(("period", "power"), [(10.0, 50.0), (60.0, 20.0), (300.0, 80.0)])
def test_the_ripple_is_that_of_a_simulated_lag_and_a_bound_for_two(period, power):
    # 30 periods bring the mean to rest only where they span many time constants, so the lag is short here
    plant = Fopdt(gain_degC_per_pct=0.37, time_constant_s=3.0 * period, dead_time_s=0.0)
    assert ripple_degC(plant, period, power) == pytest.approx(_simulated((3.0 * period,), 0.37, period, power), rel=0.01)
    both = TwoLag(gain_degC_per_pct=0.37, time_constant_s=3.0 * period, second_time_constant_s=period, dead_time_s=0.0)
    assert ripple_degC(both, period, power) > _simulated((3.0 * period, period), 0.37, period, power)


def test_no_ripple_without_power_or_at_full_power_and_most_of_it_in_the_middle():
    found = [ripple_degC(HEATER, 20.0, power) for power in (0.0, 20.0, 50.0, 100.0)]
    assert found[0] == found[3] == 0.0
    assert found[2] > found[1] > 0.0
    # far below the time constant it is k·100·P·d·(1 − d)/T, worked out by hand: 37·20·0.25/167
    assert found[2] == pytest.approx(37.0 * 20.0 * 0.25 / 167.0, rel=0.01)


def _propose(kind, ta, most=0.2, models=(HEATER,), tick=None):
    return propose_period(models, kind=kind, sample_time_s=ta, setpoint_degC=40.5, ambient_degC=20.0, ripple_degC_most=most,
                          tick_s=tick)


def test_contacts_get_the_longest_period_within_the_ripple_and_whole_periods_in_ta():
    found = _propose("relay", 120.0, most=2.0)
    count = round(120.0 / found.period_s)
    assert found.period_s * count == pytest.approx(120.0)
    assert found.ripple_degC <= 2.0 < ripple_degC(HEATER, 120.0 / (count - 1), 50.0)
    # 20 s: 180 switchings an hour, 100,000 of them in 556 h
    calm = _propose("relay", 20.0, most=5.0)
    assert calm.period_s == 20.0
    assert "180 switchings an hour" in calm.summary
    assert "556 h" in calm.summary


def test_contacts_get_no_shorter_period_than_suits_them_whatever_the_interval():
    # the least multiple of TA that is 20 s or more for a relay, 30 s for a contactor
    assert _propose("relay", 7.0).period_s == 21.0
    assert _propose("contactor", 7.0).period_s == 35.0
    assert _propose("contactor", 10.0).period_s == 30.0


def test_the_life_of_a_contactor_is_its_switchings_divided_by_those_of_a_year():
    # a 10 s PWM switches 3.16 million times a year: 1.5 million are gone in half a year; 30 s last 1.4 years
    assert life("contactor", 360.0) == "6 months"
    assert life("contactor", 120.0) == "1.4 years"
    assert life("relay", 360.0) == "278 h"
    assert life("ssr", 3600.0) == "for ever"


def test_a_solid_state_relay_gets_the_shortest_period_of_a_second_or_more():
    assert _propose("ssr", 30.0).period_s == 1.0
    assert _propose("ssr", 4.5).period_s == pytest.approx(1.125)
    assert _propose("ssr", 0.4).period_s == 0.4
    assert "contacts" not in _propose("ssr", 30.0).summary


@pytest.mark.parametrize(("tick", "ta", "period"), [
    (0.1, 60.0, 5.0),  # OB13 of an S5 comes every 100 ms unless SD97 is changed (manual of the S5-115U): 50 of them are 5 s
    (0.1, 53.0, 5.3),  # the least part of 53 s that is 50 whole ticks or more
    (0.1, 4.0, 1.0),   # no part is 50 ticks: finer ones
    (0.01, 2.25, 2.25),  # half of it is 112.5 half-waves of 50 Hz
])
def test_a_solid_state_relay_gets_fifty_steps_of_the_controllers_usual_clock(tick, ta, period):
    oven = Fopdt(gain_degC_per_pct=1.14, time_constant_s=4600.0, dead_time_s=200.0, ambient_degC=20.0)
    assert _propose("ssr", ta, models=(oven,), tick=tick).period_s == pytest.approx(period)


def test_a_heater_too_fast_for_fifty_steps_of_that_clock_keeps_the_short_period():
    # k·100·P·d·(1 − d)/T: 5 s at half power are 37·5·0.25/167 = 0.28 °C, 1 s is 0.055 °C
    assert _propose("ssr", 60.0, tick=0.1).period_s == 1.0
    assert _propose("ssr", 60.0, most=0.3, tick=0.1).period_s == 5.0


def test_the_worst_heater_decides_and_a_ripple_that_cannot_be_had_is_told():
    fast = Fopdt(gain_degC_per_pct=0.37, time_constant_s=20.0, dead_time_s=1.0, ambient_degC=22.0)
    both = _propose("relay", 100.0, most=2.0, models=(HEATER, fast))
    assert both.period_s < _propose("relay", 100.0, most=2.0).period_s
    assert "above the 2 °C wanted" in both.summary
    assert "above" not in _propose("relay", 100.0, most=2.0).summary


def test_what_makes_no_sense_is_refused():
    with pytest.raises(UnknownName, match="ssr, relay, contactor"):
        _propose("triac", 10.0)
    with pytest.raises(InputError, match="at least one model"):
        _propose("ssr", 10.0, models=())
    with pytest.raises(OutOfRange, match="sample_time_s"):
        _propose("ssr", 0.0)
