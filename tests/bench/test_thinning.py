"""Some drawn logs, each written in all the ways of `thinning.py`: the same heater within its intervals."""

import random

import pytest

from tests.bench import on_change, thinning


@pytest.mark.long
@pytest.mark.parametrize("writer", thinning.WRITERS, ids=lambda writer: writer.__name__)
def test_a_log_written_in_another_way_gives_the_heater_that_wrote_it(writer, tmp_path):
    rng = random.Random(7)
    for seed in range(6):
        case = on_change.drawn(rng)
        model = thinning.fitted(writer(thinning.drawn_rows(case, seed)), tmp_path)
        assert thinning.blocks(model) or not on_change.missed(case, model), (writer.__name__, seed)
