import numpy as np
import pytest

from heatertune.proof import Actuator, Scenario, TemperatureStep, simulate


@pytest.fixture
def trace(any_heater, tenths, words):
    scenario = Scenario(setpoint_degC=40.0, duration_s=500.0, disturbances=(TemperatureStep(time_s=251.0, temperature_degC=-4.0),))
    return simulate(tenths, words(), any_heater, scenario, Actuator(pwm_period_s=20.0))


def test_the_dense_temperature_is_the_sampled_one_at_the_scans(trace):
    assert trace.temperature_at(trace.time_s) == pytest.approx(trace.temperature_degC, abs=1e-10)


def test_a_single_instant_will_do(trace):
    assert float(trace.temperature_at(100.0)) == pytest.approx(trace.temperature_degC[50])


def test_before_and_after_differ_at_a_jump_only(trace):
    times = np.array([0.0, 100.0, 251.0, 400.0])
    jumps = trace.temperature_at(times) - trace.temperature_at(times, before=True)
    assert jumps == pytest.approx([0.0, 0.0, -4.0, 0.0])


@pytest.mark.parametrize(("start", "end"), [(0.0, 251.0), (251.0, 500.0), (123.4, 234.5)])
def test_the_course_holds_the_extremes(trace, start, end):
    times, values = trace.course(start, end)
    fine = trace.temperature_at(np.linspace(start, end, 20_001)[:-1])
    assert (times[0], times[-1]) == (start, end)
    assert (np.diff(times) > 0).all()
    assert values.max() >= fine.max() - 1e-9
    assert values.min() <= fine.min() + 1e-9
    assert values.max() == pytest.approx(fine.max(), abs=2e-3)


def test_a_course_of_many_stretches_is_that_of_a_fifth_as_many_scans(trace):
    most = len(trace.stretches) - 1
    times, values = trace.course(0.0, 251.0, most=most)
    assert 3 <= len(times) <= most / 5 + 2
    assert set(times[1:-1]) <= set(trace.time_s)
    assert values == pytest.approx(trace.temperature_at(times, before=True), abs=1e-10)


def test_the_course_ends_before_the_jump_and_begins_after_it(trace):
    before, after = trace.course(0.0, 251.0)[1][-1], trace.course(251.0, 500.0)[1][0]
    assert after - before == pytest.approx(-4.0)


def test_nobody_can_write_into_a_trace(trace):
    with pytest.raises(ValueError, match="read-only"):
        trace.temperature_degC[0] = 0.0
    assert not any(each.flags.writeable for each in (trace.time_s, trace.edge_time_s, trace.edge_pct, trace.stretches))


def test_up_to_an_instant_the_temperature_is_below_a_level(tenths, words, heater):
    jumped = Scenario(setpoint_degC=40.0, duration_s=500.0, disturbances=(TemperatureStep(time_s=251.0, temperature_degC=9.0),))
    trace = simulate(tenths, words(), heater, jumped, Actuator(pwm_period_s=10.0))
    grid = np.arange(0.0, 500.0, 0.25)
    for level in (25.0, 35.0, 47.0):
        first = grid[np.flatnonzero(trace.temperature_at(grid) >= level)[0]]
        assert 0.0 <= first - trace.below_until(level) < 2.3, "a scan, at most"
    assert trace.below_until(99.0) == np.inf
