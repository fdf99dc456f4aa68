"""The last step of tuning, in the proof's own loop."""

import pytest

from heatertune.model.model_values import Fopdt, model_by_hand
from heatertune.pid.sampled_loop import margins
from heatertune.plc import controller_for
from heatertune.plc.design import tune
from heatertune.plc.word_selection import choose_words
from heatertune.proof import TestSequence, prove
from heatertune.proof.refine import WORTH, refine
from heatertune.proof.specification import Specification
from heatertune.settings import Conditions

HEATER = Fopdt(gain_degC_per_pct=0.37, time_constant_s=167.0, dead_time_s=12.0, ambient_degC=22.0)
SLOW = Fopdt(gain_degC_per_pct=0.8, time_constant_s=480.0, dead_time_s=60.0, ambient_degC=22.0)
PROVING = Conditions(setpoint_degC=40.0)
HEAT_UP_AND_DISTURBANCES = TestSequence(opens=False, changes=False, mains=False, restarts=False)


@pytest.fixture(autouse=True)
def no_cache(monkeypatch):
    monkeypatch.setenv("HEATERTUNE_CACHE", "")
    monkeypatch.setattr(Specification, "story_at", lambda _, __: HEAT_UP_AND_DISTURBANCES)


def _chosen(plant, target):
    model = model_by_hand(plant)
    return model, choose_words(tune(model, target=target), target, model)


def _iae(proof):
    return next(criterion.value for criterion in proof.criteria if criterion.name == "iae")


@pytest.mark.long
@pytest.mark.parametrize("target", ["s5-ob251", "weg"])
def test_gains_that_wind_up_are_mended_and_the_whole_proof_says_so(target):
    # the linear optimum overshoots on this heater because the integral runs on at the limit
    model, choice = _chosen(SLOW, target)
    before = prove(choice.words, model, PROVING)
    assert [criterion.name for criterion in before.criteria if not criterion.ok] == ["overshoot"]
    found = refine(choice, model, PROVING)
    after = prove(found.words, model, PROVING)
    assert after.verdict == "PASS"
    assert margins(SLOW, controller_for(target).decode(found.words)).ms <= choice.search.ms_limit
    assert found.search.way == "refined"
    assert "overshoot is kept now" in found.search.notes[-1]
    assert f"to {_iae(after):.0f} °C·s" in found.search.notes[-1]


@pytest.mark.long
def test_gains_that_are_right_already_are_left_alone():
    model, choice = _chosen(HEATER, "s5-ob251")
    found = refine(choice, model, PROVING)
    assert found.words == choice.words
    assert "so the gains were not changed" in found.search.notes[-1]
    # no neighbour within the limit on Ms is worth it, judged here one by one
    design, least = controller_for("s5-ob251").decode(choice.words), _iae(prove(choice.words, model, PROVING))
    for gain in (0.8, 1.0, 1.2):
        for ti in (0.8, 1.0, 1.25):
            values = dict(choice.words.values)
            values |= {"K": round(values["K"] * gain), "TI": round(values["TI"] * ti)}
            near = type(choice.words)(target="s5-ob251", values=values, scaling=choice.words.scaling,
                                      sample_time_s=design.sample_time_s)
            if margins(HEATER, controller_for("s5-ob251").decode(near)).ms <= choice.search.ms_limit:
                assert _iae(prove(near, model, PROVING)) > (1.0 - WORTH) * least


def test_a_controller_that_is_no_pid_is_not_refined():
    model = model_by_hand(HEATER)
    design = tune(model, sample_time_s=4.0)
    choice = choose_words(design, "on-off", model)
    found = refine(choice, model, PROVING)
    assert found.words == choice.words
    assert "not refined" in found.search.notes[-1]
