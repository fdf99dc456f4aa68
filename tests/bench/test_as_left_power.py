"""The power reserve of traces whose power is written in six ways, against what a loop of the bench's own is worth."""

import pytest

from heatertune.log.log_values import Log, LogSignal
from heatertune.proof.as_left import as_left
from tests.bench.as_left_power import WAYS, drawn, main, proven, run, told, trace


@pytest.mark.long
def test_a_reserve_is_told_within_its_tolerance_however_the_power_is_written():
    assert main(1, 3) == 0


@pytest.mark.long
def test_drawn_loops_are_as_proven_and_weaker_heaters_are_told():
    assert main(6, 300) == 0


@pytest.mark.long
def test_pulses_with_instants_of_their_own_are_measured_and_drawn_between_slow_readings():
    case = drawn(3)
    parts, curves = proven(case), run(case)
    found = as_left(trace(case, WAYS[4], curves, every=20.0), *parts)
    measured, right, _ = told(found)
    assert right
    assert measured == pytest.approx(100.0 - (case.setpoint - case.room) / case.gain, abs=0.5)
    # every pulse of the run begins and ends at an instant of the picture, or the picture is thinned to its extremes
    assert set(found.power_pct) == {0.0, 100.0}
    assert len(found.power_s) == len(found.power_pct) > len(found.time_s)
    rows = trace(case, WAYS[4], curves, every=20.0)
    sampled = {**rows.signals, "power": LogSignal(rows.power_pct, "100", time_s=rows.time_s)}  # the same as rows alone have it
    assert told(as_left(Log(name="rows.csv", source="a plain loop", signals=sampled), *parts))[0] is None
