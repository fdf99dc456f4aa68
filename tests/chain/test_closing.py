"""The design closed on the verdict: what passes afterwards is what its own proof, run again, says."""

import pytest

from heatertune.chain import prove
from heatertune.model.by_hand import model_by_hand
from heatertune.model.values import Fopdt
from heatertune.proof.closing import Asked, closed, plainly
from heatertune.settings import Conditions, TuneSettings

#: a slow heater with a long dead time: the optimum at Ms 1.6 overshoots by more than the limit
HEATER = Fopdt(gain_degC_per_pct=0.9, time_constant_s=120.0, dead_time_s=18.0, ambient_degC=28.0)


def _asked(**changed):
    return Asked(**{"target": "s5-ob251", "conditions": Conditions(setpoint_degC=40.0)} | changed)


@pytest.fixture
def failing():
    """A heater and what is asked for, whose plain optimum breaks the limit on overshoot alone."""
    fitted = model_by_hand(HEATER)
    asked = _asked(tuned=TuneSettings(ms=2.0))
    first = plainly(fitted, asked)
    assert first.proof.verdict == "FAIL"
    return fitted, asked, first


@pytest.mark.long
def test_a_design_that_fails_is_closed_by_a_more_robust_one_and_the_price_is_told(failing):
    fitted, asked, first = failing
    found = closed(fitted, asked)
    assert found.proof.verdict == "PASS"
    assert prove(found.proof.words, fitted, asked.conditions).verdict == "PASS"
    assert found.choice.search.realised.ms < first.choice.search.realised.ms
    price = 100.0 * (found.choice.search.realised.iae_load / first.choice.search.realised.iae_load - 1.0)
    assert f"costs {price:.2g} % more IAE" in found.notes[0]
    assert found.proof.heard.remarks[-1].startswith("with Ms <= ")


def test_a_design_that_passes_stays_as_it_was():
    fitted = model_by_hand(HEATER)
    asked = _asked(tuned=TuneSettings(ms=1.3))
    plain, found = plainly(fitted, asked), closed(fitted, asked)
    assert (plain.proof.verdict, found.notes) == ("PASS", ())
    assert found.proof.words == plain.proof.words


@pytest.mark.long
def test_a_rule_is_not_made_more_robust_and_a_ramp_that_was_ruled_out_is_not_taken(failing):
    fitted, _, _ = failing
    asked = _asked(tuned=TuneSettings(method="ziegler-nichols"),
                   conditions=Conditions(setpoint_degC=40.0, pwm_period_s=10.0), setpoint_ramp="none")
    found = closed(fitted, asked)
    assert (found.proof.verdict, found.notes) == ("FAIL", ())
    assert found.proof.words.ramp is None
