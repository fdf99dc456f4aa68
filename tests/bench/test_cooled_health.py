"""Days of loops that heat and cool, from a rig of the bench's own: each is judged, and it is said which of the two drifted."""

import pytest

from heatertune.proof.verdict import notes_by_kind
from tests.bench.cooled_health import main


@pytest.mark.long
def test_a_loop_that_heats_and_cools_is_judged_and_each_gain_is_compared():
    assert main(1, 20) == 0  # each kind of day once; `python -m tests.bench.cooled_health` has six rigs


def test_degrees_taken_from_a_room_are_an_assumption_of_the_verdict():
    finding = {"name": "begins-as-room", "effect": "told", "message": "", "accepted": False}
    told = notes_by_kind({"findings": [finding], "not_tested": [], "assumed": {}, "remarks": []})
    assert told["assumed"] == ["assumed: the temperature is in °C, as the log begins like a room in °C"]
    assert told["not known"] == []
