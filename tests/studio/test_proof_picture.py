"""What the picture of a proof shows, held against the proof itself, which knows no picture."""

import numpy as np
import pytest

from heatertune.studio.loop_settings import StudioSettings, first_look, full_proof
from heatertune.studio.proof_picture import course_of, downsample, picture_of, step_corners, straight, walls_of

#: judged by margins or by counting, which no line of the temperature shows
UNSEEN = {"steady_offset", "limit_cycle", "pwm_ripple", "ms", "gain_margin", "phase_margin", "stability", "step_power",
          "overflow"}


def hits(proof, run):
    """Whether the line of a run is in a wall anywhere, by the exact temperature at many instants."""
    trace, found = proof.trace(run), False
    for wall in walls_of(proof, run):
        _, temperature = trace.course(wall.begin_s, wall.end_s)
        found |= bool(np.any((temperature > wall.low_degC + 1e-6) & (temperature < wall.high_degC - 1e-6)))
    return found


@pytest.mark.parametrize(("settings", "breaks"), [
    (StudioSettings(), set()), (StudioSettings(structure="p", setpoint_degC=60.0), {"settling_time"}),
    (StudioSettings(ms=2.0, spec="bath"), {"overshoot_degC"})])
@pytest.mark.long
def test_a_run_is_in_a_wall_where_the_proof_says_that_it_broke_a_limit_and_nowhere_else(heater, settings, breaks):
    proof, seen = full_proof(heater, first_look(heater, settings)), set()
    for number, run in enumerate(proof.runs):
        broken = {criterion.name for criterion in run.criteria if not criterion.ok} - UNSEEN
        assert hits(proof, number) == bool(broken), (run.label, broken)
        seen |= broken
    assert breaks <= seen


@pytest.fixture(scope="module")
def proof(heater):
    return full_proof(heater, first_look(heater, StudioSettings()))


@pytest.mark.long
def test_every_run_of_the_proof_is_drawn(proof):
    picture = picture_of(proof)
    assert picture.runs == len(proof.runs) > 5
    lines = [(picture.place(time), values) for time, values in picture.crowd]
    for run in range(len(proof.runs)):
        time, temperature = course_of(proof.trace(run), proof)
        span, across = np.ptp(temperature), picture.place(time)
        off = min(np.quantile(np.abs(np.interp(across, *line) - temperature), 0.99) for line in lines)
        assert off < 0.03 * span  # eight pixels of 250: one for the line, the others where it is steep


def test_the_highest_temperature_that_is_drawn_is_the_overshoot_that_was_judged(proof):
    _, drawn = course_of(proof.nominal, proof)
    overshoot = next(criterion.value for criterion in proof.runs[0].criteria if criterion.name == "overshoot")
    part = picture_of(proof).parts[0]
    reached = proof.scenario.setpoint_degC + overshoot / 100.0 * (proof.scenario.setpoint_degC - 20.0)
    assert part.highest_degC == pytest.approx(reached, abs=1e-6)
    assert drawn.max() >= part.highest_degC - 1e-9


def test_the_parts_settle_when_the_proof_says(proof):
    settled = next(criterion.value for criterion in proof.runs[0].criteria if criterion.name == "settling_time")
    assert picture_of(proof).parts[0].within_s == pytest.approx(settled, abs=proof.nominal.actuator.pwm_period_s)


def test_what_is_torn_out_has_no_width_and_all_else_its_own(proof):
    picture = picture_of(proof)
    begin, end = picture.torn[0]
    assert picture.place(begin) == pytest.approx(begin)
    assert picture.place(end) == pytest.approx(begin)
    assert picture.place(end + 7.0) - picture.place(end) == pytest.approx(7.0)


def test_of_each_pixel_the_least_and_the_most_are_drawn():
    time, values = np.arange(10_000.0), np.cumsum(np.random.default_rng(3).normal(size=10_000))
    kept = downsample(time, values, 50)
    assert len(kept) <= 200
    for pixel in range(50):  # of 200 instants each; the last instant is the end of the last one
        inside = (time * 50 / time[-1]).astype(int) == pixel
        seen = np.intersect1d(kept, np.flatnonzero(inside))
        assert (values[seen].min(), values[seen].max()) == (values[inside].min(), values[inside].max())


def test_a_line_without_its_straight_parts_lies_where_it_was():
    time = np.linspace(0.0, 10.0, 2000)
    values = np.sin(time)
    kept = straight(time, values, 0.01)
    assert 5 < len(kept) < 60
    assert np.abs(np.interp(time, time[kept], values[kept]) - values).max() <= 0.01
    assert straight(time, 3.0 * time, 1e-9).tolist() == [0, 1999]


def test_a_value_that_holds_makes_steps():
    time, values = step_corners(np.array([0.0, 1.0, 2.0, 3.0]), np.array([5.0, 5.0, 7.0, 7.0]))
    assert time.tolist() == [0.0, 2.0, 2.0, 3.0]
    assert values.tolist() == [5.0, 5.0, 7.0, 7.0]


def test_a_picture_that_nobody_wants_any_more_is_given_up(proof):
    asked = []

    def before_run():
        asked.append(True)
        if len(asked) == 3:
            raise InterruptedError

    with pytest.raises(InterruptedError):
        picture_of(proof, before_run)
    assert len(asked) == 3 < len(proof.runs)


def test_a_saw_keeps_its_teeth_in_pieces():
    time, values = np.arange(2001.0), np.tile([0.0, 1.0], 1001)[:2001]
    kept = straight(time, values, 0.1, 50)
    assert np.interp(time, time[kept], values[kept]) == pytest.approx(values, abs=0.1)
