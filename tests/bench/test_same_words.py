"""Words stay where digits change that mean nothing; the rate on a whole log is the bench's."""

import pytest

from heatertune.model.model_values import Fopdt, model_by_hand
from tests.bench.same_words import rate

HEATER = Fopdt(gain_degC_per_pct=0.37, time_constant_s=167.0, dead_time_s=12.0, ambient_degC=22.0)


@pytest.mark.long
def test_words_do_not_move_with_a_heater_that_differs_in_its_eighth_digit():
    changed, words = rate(model_by_hand(HEATER), "s5-ob251", 3)
    assert changed == 0
    assert sum(words.values()) == 3
