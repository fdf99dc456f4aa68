"""The witness of the panel instruments' law against what their manuals define."""

import pytest
from tests.witness.pband import PBand, band_pct, switched


def test_the_deviation_of_a_whole_band_is_full_power():
    law = PBand(25.0, 0.0, 0.0, 1.0)
    assert [law(200.0, 200.0 - e) for e in (0.0, 6.25, 12.5, 25.0, 60.0, -3.0)] == [0.0, 25.0, 50.0, 100.0, 100.0, 0.0]


def test_after_the_integral_time_the_i_part_is_as_large_as_the_p_part():
    law = PBand(100.0, 60.0, 0.0, 0.5)
    outputs = [law(200.0, 190.0) for _ in range(120)]
    assert outputs[-1] == pytest.approx(20.0)


def test_a_ramps_d_part_is_ahead_of_its_p_part_by_the_derivative_time():
    law = PBand(100.0, 0.0, 30.0, 1.0)
    outputs = [law(200.0, 120.0 + 0.5 * k) for k in range(20)]
    assert outputs[10] == pytest.approx(75.0 - 15.0)  # P of 30 s later: 0.5 °C/s · 30 s = 15 °C


def test_a_setpoint_step_kicks_the_derivative_of_the_deviation_only():
    on_reading, on_error = (PBand(100.0, 0.0, 30.0, 1.0, on_error=kind) for kind in (False, True))
    for law in (on_reading, on_error):
        law(100.0, 100.0)
    assert on_reading(101.0, 100.0) == pytest.approx(1.0)
    assert on_error(101.0, 100.0) == pytest.approx(31.0)


def test_a_lag_of_the_derivative_takes_its_time():
    law = PBand(100.0, 0.0, 30.0, 1.0, n=10)  # lag 3 s: of a rate of −1 °C/s a quarter in the first call
    law(100.0, 60.0)
    assert law(100.0, 59.0) == pytest.approx(41.0 + 30.0 * 0.25)


@pytest.mark.parametrize("kind", ["hold", "band"])
def test_it_does_not_wind_up_while_it_heats_up(kind):
    law = PBand(20.0, 100.0, 0.0, 1.0, anti_windup=kind)
    for t in range(20, 180):
        assert law(200.0, float(t)) == 100.0
    assert law.integral_degC_s == 0.0


def test_a_band_in_per_cent_of_the_span_and_a_switching_output():
    assert band_pct(20.0, 400.0) == 5.0
    assert sum(switched(30.0, 20.0, 0.1)) == 60
    assert sum(switched(30.0, 20.0, 0.1, least_s=7.0)) == 0
    assert sum(switched(90.0, 20.0, 0.1, least_s=3.0)) == 200
    assert switched(50.0, 2.0, 0.5) == [True, True, False, False]
