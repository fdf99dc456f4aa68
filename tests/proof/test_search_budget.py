"""A search ends at its budget of simulated scans, with the best so far, and where it ends depends on the request alone."""

import pytest

from heatertune.model.model_values import Fopdt, model_by_hand
from heatertune.plc import Scaling
from heatertune.proof import prove
from heatertune.proof import runs as search_budget
from heatertune.proof.redesign import DesignRequest, find_passing_design
from heatertune.proof.runs import SearchBudget, count_scans, judge_once, outside_budget
from heatertune.settings import Conditions, TuneSettings

#: the plain optimum at Ms 2 overshoots; other gains and a setpoint ramp mend it
HEATER = model_by_hand(Fopdt(gain_degC_per_pct=0.9, time_constant_s=120.0, dead_time_s=18.0, ambient_degC=28.0))
ASKED = DesignRequest(target="fb41", conditions=Conditions(setpoint_degC=40.0), tune_settings=TuneSettings(ms=2.0))


def test_runs_whose_result_is_only_told_are_charged_to_no_budget():
    with SearchBudget(scans=10.0) as budget:
        with outside_budget():
            count_scans(100.0)
        count_scans(4.0)
    assert (budget.used, budget.spent) == (4.0, False)


def test_a_block_ends_beyond_its_budget_and_the_program_goes_on():
    steps = []
    with SearchBudget(scans=10.0) as budget:
        for number in range(5):
            count_scans(4.0)
            steps.append(number)
    assert (steps, budget.spent, budget.used) == ([0, 1], True, 12.0)
    count_scans(1e12)  # without a budget nothing is limited
    with SearchBudget(scans=10.0) as budget:
        count_scans(10.0)
    assert not budget.spent, "it is used up, but not exceeded"


def test_a_budget_within_another_is_charged_to_both_and_the_outer_one_ends_both():
    with SearchBudget(scans=10.0) as outer:
        with SearchBudget(scans=3.0) as inner:
            count_scans(4.0)
        assert (inner.spent, outer.used) == (True, 4.0)
        with SearchBudget(scans=100.0) as inner:
            count_scans(7.0)
        pytest.fail("the outer one is spent")
    assert (outer.spent, inner.spent) == (True, False)


def test_other_errors_leave_a_budget_as_they_are():
    with pytest.raises(KeyError), SearchBudget(scans=1.0) as budget:
        raise KeyError
    assert not budget.spent


def test_what_was_simulated_earlier_counts_as_well():
    words = find_passing_design(HEATER, DesignRequest(target="fb41", conditions=ASKED.conditions, as_is=True)).proof.words
    used = []
    with judge_once():
        for _ in range(2):
            with SearchBudget() as budget:
                prove(words, HEATER, ASKED.conditions)
            used.append(budget.used)
    assert used[0] == used[1] > 0.0


def _signature(found):
    return found.proof.words, found.proof.verdict, found.proof.diagnostics.remarks, found.notes, found.passes_with


@pytest.mark.long
def test_a_search_without_time_ends_with_the_plain_design_and_says_so(monkeypatch):
    plain = find_passing_design(HEATER, DesignRequest(target="fb41", conditions=ASKED.conditions, tune_settings=ASKED.tune_settings, as_is=True))
    whole = find_passing_design(HEATER, ASKED)
    assert (plain.proof.verdict, whole.proof.verdict) == ("FAIL", "PASS")
    assert not any("its budget" in remark for remark in whole.proof.diagnostics.remarks)
    monkeypatch.setattr(search_budget, "MOST_SCANS", 1e3)
    ended = find_passing_design(HEATER, ASKED)
    assert (ended.proof.verdict, ended.proof.words) == ("FAIL", plain.proof.words)
    assert "the search ended after 0.001 million simulated scans, its budget" in ended.proof.diagnostics.remarks[0]
    assert "the search ended" in ended.notes[-1]


@pytest.mark.long
def test_of_what_winds_up_the_best_so_far_is_returned_and_the_same_request_ends_at_the_same_place(monkeypatch):
    # with a dead time of two thirds of the lag nothing tried keeps the limit after an outage at the lowest setpoint
    plant = Fopdt(gain_degC_per_pct=0.53, time_constant_s=320.0, dead_time_s=209.0, ambient_degC=20.0)
    conditions = Conditions(setpoint_degC=(36.0, 40.0), tolerance_degC=0.45, switches={"anti_windup": "clamp", "sampling": "caller"})
    asked = DesignRequest(target="weg", scaling=Scaling(low_degC=0.0, high_degC=50.0), conditions=conditions)
    monkeypatch.setattr(search_budget, "MOST_SCANS", 8e6)
    first = find_passing_design(model_by_hand(plant), asked)
    assert first.proof.verdict == "NOT PROVEN"
    told = "the search ended after 8 million simulated scans, its budget; this is the best so far"
    assert told in first.proof.diagnostics.remarks
    assert any(told[1:] in note for note in first.notes)
    with judge_once():
        prove(first.proof.words, model_by_hand(plant), first.conditions)
        again = find_passing_design(model_by_hand(plant), asked)
    assert _signature(again) == _signature(first)
