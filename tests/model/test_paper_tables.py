"""The figures a good implementation reaches on the paper's logs are those of the project's identification page, which an
independent prototype produced; they are lower bounds here."""

import pytest

from heatertune.documents import to_json
from heatertune.model.document import from_document, to_document
from heatertune.model.fit import fit, model_by_hand, pool_candidates
from heatertune.model.values import Fopdt, Outcome, TwoLag
from heatertune.model.windows import disturbance_s
from heatertune.pid.robustness import margins
from heatertune.pid.tune import tune
from heatertune.plc.s7_200.paper.laws import LAWS

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def fitted3(table3):
    return fit(table3, laws=LAWS)


@pytest.fixture(scope="module")
def fitted4(table4):
    return fit(table4, laws=LAWS)


def test_the_disturbance_of_the_27th_minute_is_found_in_both_tables(table3, table4):
    assert disturbance_s(table3) == 1640.0
    assert disturbance_s(table4) == 1600.0


def test_table_3_until_the_disturbance_is_explained_by_two_lags_to_91_5_percent(fitted3):
    best = max(fitted3.candidates, key=lambda c: c.fit_pct)
    assert isinstance(best.model, TwoLag)
    assert best.fit_pct > 91.4
    assert best.window_s == (10.0, 1640.0)


def test_table_4_until_the_disturbance_is_explained_to_95_percent_and_by_one_lag_to_93(fitted4):
    assert fitted4.fit_pct > 94.9
    singles = [c for c in fitted4.candidates if isinstance(c.model, Fopdt)]
    assert max(c.fit_pct for c in singles) > 93.4


def test_the_beginning_of_table_4_is_explained_to_96_percent_by_one_lag_and_a_pi_law(table4):
    fitted = fit(table4, laws=LAWS, until_s=640.0)
    single = max((c for c in fitted.candidates if isinstance(c.model, Fopdt)), key=lambda c: c.fit_pct)
    assert single.fit_pct > 96.2
    assert single.model.gain_degC_per_pct == pytest.approx(0.365, abs=0.015)  # 36–37 °C at full power
    assert 155.0 < single.model.time_constant_s < 175.0
    assert 10.0 < single.model.dead_time_s < 15.0


@pytest.mark.parametrize("name", ["fitted3", "fitted4"])
def test_what_the_logs_cannot_tell_is_said(name, request):
    fitted = request.getfixturevalue(name)
    assert fitted.outcome is Outcome.COMBINATIONS_ONLY
    assert fitted.ci95["gain_degC_per_pct"] is None
    assert any("ambient" in note for note in fitted.notes)
    value, interval = fitted.combinations["gain_per_time_constant_degC_per_s_pct"]
    assert 0.0010 < interval.low <= value <= interval.high < 0.0030  # the page: 0.0014–0.0020


def test_a_known_ambient_is_kept(table4):
    fitted = fit(table4, laws=LAWS, ambient_degC=24.0, until_s=640.0)
    assert {c.model.ambient_degC for c in fitted.candidates} == {24.0}


def test_a_fit_survives_its_document(fitted4):
    assert to_json(to_document(from_document(to_document(fitted4)))) == to_json(to_document(fitted4))


def test_simc_on_table_4s_best_single_lag_all_but_oscillates_on_other_candidates_and_the_optimum_does_not(fitted3, fitted4):
    pooled = pool_candidates(fitted4, [fitted3])
    single = max((c for c in fitted4.candidates if isinstance(c.model, Fopdt)), key=lambda c: c.fit_pct)
    simc = tune(model_by_hand(single.model), method="simc")
    assert margins(single.model, simc).ms < 1.8
    assert max(margins(plant, simc).ms for plant in pooled.plants) > 4.0
    optimum = tune(pooled)
    assert max(margins(plant, optimum).ms for plant in pooled.plants) < 1.61
