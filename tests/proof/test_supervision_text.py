"""The monitor's text is proven beside it: one that says other is told, and so is one that does not fit."""

import random

import numpy as np
import pytest
from tests.proof.test_supervision import OFF, random_numbers

from heatertune.errors import InputError
from heatertune.pid.design_values import PidDesign
from heatertune.plc import Scaling, controller_for
from heatertune.supervision.faulty_loops import Card, Ran
from heatertune.supervision.text import one_bit, program_check, s5, s7_300
from heatertune.supervision.text.monitor_statements import check_reach, statements_of

CARD = Card(0.0, 0.1, 1000)
NUMBERS = OFF._replace(low=5, high=900, jump=50, still=9, full=20, growths=2, slow_blocks=2, slow_scale=64, slow_gain=3, slow_rest=-900)


def words_of(target):
    design = PidDesign(gain_pct_per_degC=2.0, integral_time_s=100.0, derivative_time_s=0.0, sample_time_s=1.0, structure="pi",
                       method="by hand")
    return controller_for(target).encode(design, Scaling(low_degC=0.0, high_degC=100.0))


def run(seed=1, calls=600):
    chance = np.random.default_rng(seed)
    counts = np.clip(500 + np.cumsum(np.rint(chance.normal(0, 8, calls))), 0, 1000)
    power = np.clip(np.repeat(chance.integers(-10, 130, calls // 10), 10), 0, 100)
    power[200:220] = -1  # an outage
    return Ran(counts=counts.astype(np.int32), power=power.astype(np.int16), temperature_degC=0.1 * counts)


@pytest.mark.long(seconds=10)
@pytest.mark.parametrize("target", ["s5-ob251", "s7-300", "fb41", "s7-200", "s7-200-pid", "weg", "iec-pid"])
def test_every_target_s_text_is_run_beside_the_monitor(target):
    made = program_check.export_monitor(NUMBERS, words_of(target), CARD, ["head"], [run(1), run(2)])
    assert made.why is None
    assert made.runs == 3  # one goes to the limits
    assert made.calls > 1200
    assert "head" in made.text
    assert "8 swing grows" in made.text


@pytest.mark.parametrize(("old", "new", "said"), [
    ("      L     L#50;", "      L     L#51;", "in call"),  # the largest jump
    ("      L     L#20;", "      L     L#19;", "in call"),  # full power
    ("      L     L#55296;", "      L     L#55000;", "takes the output"),
    ("      T     #LAST;", "      T     #LAST_ONE;", "LAST_ONE"),
])
def test_a_text_that_says_other_is_told_and_is_not_exported(monkeypatch, old, new, said):
    whole = s7_300.written

    def damaged(*given, **named):
        text = whole(*given, **named)
        assert old in text
        return text.replace(old, new)

    monkeypatch.setattr(s7_300, "written", damaged)
    made = program_check.export_monitor(NUMBERS, words_of("s7-300"), CARD, [], [run(seed) for seed in range(4)])
    assert (made.file, made.text) == (None, "")
    assert said in made.why


def test_what_does_not_fit_into_words_is_refused_with_the_number():
    check_reach(NUMBERS, 16383, 16)  # a block of two
    with pytest.raises(InputError, match="readings may be 32768, which 16 bits"):
        check_reach(NUMBERS, 16384, 16)
    with pytest.raises(InputError, match="slow_gain may be 40000, which 16 bits"):
        check_reach(NUMBERS._replace(slow_gain=40000), 1000, 16)
    with pytest.raises(InputError, match=r"slow rule adds up may be \d+, which 32 bits"):
        check_reach(NUMBERS._replace(slow_gain=40000), 1 << 26, 32)
    with pytest.raises(InputError, match="words; a data block has 256"):
        s5.written(statements_of(NUMBERS._replace(delay_high=240)), [])
    assert program_check.export_monitor(NUMBERS._replace(still=40000), words_of("s5-ob251"), CARD, [], []).why.startswith("no program: still")


def test_a_target_without_a_program_of_its_own_is_told():
    assert program_check.export_monitor(NUMBERS, words_of("pid-compact"), CARD, [], []).why == "no program is written for pid-compact"


def test_the_one_bit_plc_s_listing_trips_as_what_is_left_of_the_monitor_does():
    for seed in range(5):
        text = one_bit.written(NUMBERS, 2.0, ["head"])
        assert one_bit.departs(text, NUMBERS, 2.0, [run(seed)]) is None
    assert "in scan" in one_bit.departs(text.replace("AC1<AC2", "AC1>AC2"), NUMBERS, 2.0, [run(1)])
    assert text.count("\n") == 24  # eight lines of remarks, sixteen of the ROM
    assert one_bit.departs(one_bit.written(NUMBERS._replace(full=0), 2.0, []), NUMBERS._replace(full=0), 2.0, [run(1)]) is None


@pytest.mark.long(seconds=5)
def test_the_statements_name_every_cell_that_they_use_and_stand_under_one_comparison_at_most():
    chance = random.Random(5)
    for _ in range(30):
        statements = statements_of(random_numbers(chance))
        text = "".join(group.lines for group in (*statements.each_call, *statements.each_block))
        assert " AND " not in text
        assert " OR " not in text
        assert all(len(group.title) <= 64 for group in (*statements.each_call, *statements.each_block))  # as STEP 7 holds it
        assert {name for name in statements.cells if name not in text} == set()
