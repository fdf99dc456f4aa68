"""Some drawn logs, each written in all the ways of `thinning.py`: the same heater within its intervals."""

import random

import pytest

from tests.bench import on_change, thinning


@pytest.mark.long
@pytest.mark.parametrize("writer", thinning.WRITERS, ids=lambda writer: writer.__name__)
def test_a_log_written_in_another_way_gives_the_heater_that_wrote_it(writer, tmp_path):
    rng = random.Random(7)
    for seed in range(3):
        case = on_change.drawn(rng)
        model = thinning.fitted(writer(thinning.drawn_rows(case, seed)), tmp_path)
        assert thinning.blocks(model) or not on_change.missed(case, model), (writer.__name__, seed)


@pytest.mark.long
def test_loads_that_begin_with_each_step_of_the_power_are_not_told_from_it(tmp_path):
    """A drawn log with rows of 76 s and its power a row late: three loads stood in for a part of each step, the gain was 0.48 to 0.71."""
    case = on_change.Case(gain=0.785968, time_constant_s=1611.6, second_s=0.0, dead_time_s=80.4963, ambient_degC=21.5,
                          plan=((0.0, 0.0), (458.8, 58), (7710.979, 20)), end_s=14963.158, poll_s=76, step_degC=0.1, noise_degC=0.0)
    model = thinning.fitted(thinning.late(thinning.drawn_rows(case, 9093)), tmp_path)
    assert thinning.blocks(model) or not on_change.missed(case, model), (model.outcome, model.ci95)


@pytest.mark.long
@pytest.mark.parametrize(("seed", "writer"), [(85, thinning.mean_both), (97, thinning.late)])
def test_a_power_column_so_late_that_the_temperature_moves_first_is_no_load_in_the_power_s_place(seed, writer, tmp_path):
    # the row that shows the power comes 55 s, or 13 s, after the temperature has begun to rise
    rng = random.Random(7)
    case = [on_change.drawn(rng) for _ in range(seed + 1)][seed]
    model = thinning.fitted(writer(thinning.drawn_rows(case, seed)), tmp_path)
    assert not thinning.blocks(model)
    assert not on_change.missed(case, model), model.ci95
    assert any("the power column was taken as a row late" in note for note in model.notes)
