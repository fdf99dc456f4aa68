"""Words as they stood in a PLC or an instrument: shown as they are entered, and any values at all without an error."""

import math
import random

import pytest
from tests.report.screens import documents_of

from heatertune.plc import NAMES, controller_for
from heatertune.report.as_left_section import in_plc


def test_the_words_of_an_instrument_are_shown_with_their_decimals():
    words = documents_of("omron-e5cc", "PASS")["words"]
    text = in_plc({**words["words"], "P": 147, "I": 790, "TIMEUNIT": 1, "OL-H": 905}, words)
    assert {"P 14.7", "I 79.0", "OL-H 90.5", "ALFA 0.65"} <= set(text.split(", "))
    assert "I 790" in in_plc({**words["words"], "I": 790, "TIMEUNIT": 0}, words).split(", ")


@pytest.mark.parametrize("target", NAMES)
def test_any_values_at_all_are_shown(target):
    chance, words = random.Random(1), documents_of(target, "PASS")["words"]
    odd = (math.nan, math.inf, -math.inf, 0.0, -1.0, 1e30, 0, -1, 1, 255, 32767, -32768, 65535)
    names = [field.name for field in controller_for(target).fields]
    for _ in range(200):
        values = {name: chance.choice(odd) for name in names if chance.random() < 0.9}
        shown = in_plc(values, words)
        live = controller_for(target).written
        assert all(f"{name} " in shown for name in values if name not in live)
