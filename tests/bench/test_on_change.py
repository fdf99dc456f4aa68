"""A log that is thinned to its changes gives the heater that wrote it, within its intervals; tests/bench/on_change.py writes them."""

import io
import random

import pytest

from heatertune.log import read_log
from heatertune.model.fit import fit
from tests.bench import on_change


@pytest.mark.long
@pytest.mark.parametrize("writer", on_change.WRITERS, ids=lambda writer: writer.__name__)
def test_the_intervals_of_a_log_that_is_written_on_change_hold_the_truth(writer):
    rng = random.Random("seen once")
    for seed in range(3):
        missed, fitted = on_change.judged(writer, on_change.drawn(rng), seed)
        assert not missed
        assert fitted.log_interval_s > 0.0


@pytest.mark.parametrize(("lag_s", "dead_s", "poll_s", "step_degC"), [
    (200.0, 20.0, 5.0, 0.1), (200.0, 20.0, 5.0, 0.5), (1800.0, 180.0, 30.0, 0.1), (200.0, 20.0, 30.0, 0.1),
])
@pytest.mark.parametrize("writer", [on_change.long_rounded, on_change.long_deadband, on_change.wide_blank], ids=lambda writer: writer.__name__)
def test_a_dead_time_of_twenty_seconds_is_found_as_twenty_not_as_two(writer, lag_s, dead_s, poll_s, step_degC):
    # the oven of a home automation: 0.6 °C/%, a step to 60 % after a minute and one to 20 %
    case = on_change.Case(
        gain=0.6, time_constant_s=lag_s, second_s=0.0, dead_time_s=dead_s, ambient_degC=20.0, poll_s=poll_s, step_degC=step_degC,
        plan=((0.0, 0.0), (0.3 * lag_s, 60.0), (5.0 * lag_s, 20.0)), end_s=10.0 * lag_s)
    missed, fitted = on_change.judged(writer, case, 1)
    assert not missed
    assert abs(fitted.model.dead_time_s - dead_s) < 0.5 * poll_s
    assert abs(fitted.model.time_constant_s / lag_s - 1.0) < 0.03


@pytest.mark.parametrize("bound_s", [None, 40.0])
def test_a_power_whose_change_is_only_written_with_the_next_reading_blocks_whatever_bounds_the_dead_time(bound_s):
    case = on_change.Case(
        gain=0.6, time_constant_s=200.0, second_s=0.0, dead_time_s=20.0, ambient_degC=20.0, poll_s=5.0, step_degC=0.1,
        plan=((0.0, 0.0), (60.0, 60.0), (1060.0, 20.0)), end_s=2000.0)
    log = read_log(io.StringIO(on_change.wide_readings(case, 1)))
    assert log.signals["power"].late_s == pytest.approx(85.0)  # rows at 0 and 85 s, and the power changed at 60 s
    told = {finding.name: finding.message for finding in fit(log, dead_time_at_most_s=bound_s).findings}
    assert "up to 85 s before the row" in told["alias"]
