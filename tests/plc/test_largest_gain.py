"""The largest gain of a target is a limit inside the search, and its timer's stops are told."""

import numpy as np
import pytest

from heatertune.model.model_values import Fopdt, model_by_hand
from heatertune.pid.design_values import PidDesign
from heatertune.pid.sampled_loop import iae_load, margins
from heatertune.plc import Scaling, controller_for
from heatertune.plc.design import tune
from heatertune.plc.word_selection import choose_words

SMALL = Fopdt(gain_degC_per_pct=0.1, time_constant_s=300.0, dead_time_s=1.0)


def _pi(gain, tn, ta):
    return PidDesign(gain_pct_per_degC=gain, integral_time_s=tn, derivative_time_s=0.0, sample_time_s=ta,
                     structure="pi", method="")


#: S5-115U manual, table 11-11: K up to 32767/1024 units per unit, 1500/1024 with a D part; 100 °C and 100 % are 2047 units
#: each, so a unit per unit is 1 %/°C
MOST, MOST_WITH_D = 32767 / 1024.0, 1500 / 1024.0


def test_ob251_is_given_the_best_of_the_gains_that_its_word_holds():
    fitted = model_by_hand(SMALL)
    free, held = tune(fitted), tune(fitted, target="s5-ob251")
    assert free.gain_pct_per_degC > MOST
    assert held.gain_pct_per_degC == pytest.approx(MOST, rel=2e-6)
    assert held.gain_pct_per_degC <= MOST
    assert any("K is at the largest value that the target can store" in note for note in held.notes)
    assert not any("No limit is active" in note for note in held.notes)
    assert choose_words(held, "s5-ob251", fitted).words.whole["K"] <= 32767


@pytest.mark.long
def test_ob251_is_given_a_d_part_that_its_word_holds():
    fitted = model_by_hand(SMALL)
    free, held = tune(fitted, structure="pid"), tune(fitted, structure="pid", target="s5-ob251")
    assert free.gain_pct_per_degC > MOST_WITH_D >= held.gain_pct_per_degC
    assert choose_words(held, "s5-ob251", fitted).words.whole["TD"] >= 1


def test_no_integral_time_beside_the_largest_gain_costs_less():
    held = tune(model_by_hand(SMALL), target="s5-ob251")
    ta, gain = held.sample_time_s, MOST
    grid = [_pi(share * gain, tn, ta) for tn in np.geomspace(1.0, 300.0, 60) for share in (0.7, 0.9, 1.0)]
    best = min(iae_load(SMALL, each) for each in grid if margins(SMALL, each).ms <= 1.6)
    assert held.iae_load < 1.001 * best


def test_s7_200_is_given_a_gain_that_its_constants_hold():
    fitted, scaling = model_by_hand(SMALL), Scaling(low_degC=0.0, high_degC=400.0)
    design = tune(fitted, target="s7-200", scaling=scaling)
    words = controller_for("s7-200").encode(design, scaling)
    # constants are words of 15 bits; the largest of them is not half of what they hold
    assert max(words.whole["KP"], words.whole["KI"]) > 16383
    assert any("K is at the largest value" in note for note in design.notes) == (words.whole["SCALE"] == 1)


@pytest.mark.parametrize(("heater", "ta", "which"), [
    # manual of the S7-200's timed interrupt: PWM cycles of 0.1 to 32.7 s
    (Fopdt(gain_degC_per_pct=1.0, time_constant_s=9000.0, dead_time_s=900.0), 32.7, "longest"),
    (Fopdt(gain_degC_per_pct=1.0, time_constant_s=0.5, dead_time_s=0.005), 0.1, "shortest"),
])
def test_an_interval_at_the_timers_stop_is_told(heater, ta, which):
    design = tune(model_by_hand(heater), target="s7-200-pid")
    assert design.sample_time_s == ta
    assert any(f"TA = {ta:g} s is the {which} interval of the timer; TRdom/10 would be" in note for note in design.notes)
    assert not any("interval of the timer" in note for note in tune(model_by_hand(SMALL), target="s7-200-pid").notes)
