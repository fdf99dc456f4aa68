import json
import math

import pytest

from heatertune.cli import main
from heatertune.model.model_values import Candidate, FitOutcome, FittedModel, Fopdt, TwoLag, model_by_hand
from heatertune.pid.alternatives import alternatives
from heatertune.pid.rules import RULES, model_for
from heatertune.pid.tune import tune
from heatertune.report.report_text import alternatives_table

HEATER = Fopdt(gain_degC_per_pct=0.37, time_constant_s=167.0, dead_time_s=25.0, ambient_degC=22.0)
OTHER = TwoLag(gain_degC_per_pct=0.83, time_constant_s=378.0, second_time_constant_s=108.0, dead_time_s=9.2)
HAND = ("--gain", "0.37", "--time-constant", "167", "--dead-time", "12", "--sample-time", "4")


def _family():
    candidates = tuple(
        Candidate(model=m, log="", window_s=(0.0, 1.0), law="", fit_pct=90.0, rmse_degC=1.0, delta_bic=0.0)
        for m in (HEATER, OTHER)
    )
    return FittedModel(model=HEATER, outcome=FitOutcome.COMBINATIONS_ONLY, method="", candidates=candidates)


@pytest.mark.parametrize(("method", "structure"), [("simc", "pi"), ("amigo", "pid"), ("ziegler-nichols", "p")])
def test_a_row_of_the_table_is_what_tune_finds_with_that_rule(method, structure):
    # tune by the rule itself is the second way to the same numbers
    fitted = _family()
    design = tune(fitted, method="cohen-coon", structure=structure, sample_time_s=6.0)
    row = next(row for row in alternatives(fitted, design) if row["method"] == method)
    alone = tune(fitted, method=method, structure=structure, sample_time_s=6.0)
    for name in ("gain_pct_per_degC", "integral_time_s", "derivative_time_s"):
        assert row[name] == getattr(alone, name)
    assert row["ms"] == alone.margins.ms
    assert row["iae_load"] == alone.iae_load


def test_simc_pid_takes_the_candidate_with_two_lags():
    assert model_for("simc", "pid", _family()) == OTHER
    assert model_for("simc", "pi", _family()) == HEATER
    design = tune(_family(), method="amigo", structure="pid", sample_time_s=6.0)
    rows = {row["method"]: row for row in alternatives(_family(), design)}
    # Skogestad 2003, eqs. 24 and 25: series TN = min(378, 8·(9.2 + 3)), TV = 108; ideal TV = TV/(1 + TV/TN)
    assert rows["simc"]["derivative_time_s"] == pytest.approx(108.0 / (1.0 + 108.0 / 97.6))


def test_the_design_comes_first_and_every_rule_follows():
    fitted = model_by_hand(HEATER)
    design = tune(fitted, sample_time_s=6.0)
    rows = alternatives(fitted, design)
    assert [row["method"] for row in rows] == ["this design", *RULES]
    assert rows[0]["ms"] == pytest.approx(design.margins.ms)
    assert rows[0]["iae_load"] == pytest.approx(design.iae_load)


def test_no_applicable_rule_that_keeps_the_limit_of_the_optimum_beats_it():
    # the optimum's own claim, on rules it knows nothing of
    fitted = model_by_hand(HEATER)
    rows = alternatives(fitted, tune(fitted, ms=1.6, sample_time_s=6.0))
    as_robust = [row for row in rows[1:] if row["ms"] is not None and row["ms"] <= rows[0]["ms"]]
    assert len(as_robust) >= 4
    assert all(row["iae_load"] >= 0.995 * rows[0]["iae_load"] for row in as_robust)


def test_a_row_says_why_its_rule_does_not_apply():
    rows = {row["method"]: row for row in alternatives(_family(), tune(_family(), sample_time_s=6.0))}
    assert rows["cohen-coon"]["ms"] == math.inf
    assert rows["cohen-coon"]["iae_load"] == math.inf
    assert rows["cohen-coon"]["why_not"] == "Unstable on 1 of 2 candidate models."
    assert not rows["cohen-coon"]["applicable"]
    assert rows["usort-setpoint-2.0"]["gain_pct_per_degC"] is None
    assert "none for PI" in rows["usort-setpoint-2.0"]["why_not"]
    short = model_by_hand(Fopdt(gain_degC_per_pct=0.37, time_constant_s=500.0, dead_time_s=12.0))
    outside = next(r for r in alternatives(short, tune(short, sample_time_s=6.0)) if r["method"] == "rovira-iae")
    assert "Made for 0.1 <= L/T <= 1" in outside["why_not"]
    assert not outside["applicable"]
    assert outside["ms"] < 3.0
    assert rows["lambda"]["applicable"]
    assert rows["lambda"]["why_not"] is None


def test_the_table_shows_what_is_infinite_what_is_missing_and_why():
    row = {"method": "a", "gain_pct_per_degC": 2.0, "integral_time_s": math.inf, "derivative_time_s": 0.0, "ms": 1.5,
           "iae_load": math.inf, "applicable": True, "why_not": None}
    missing = dict.fromkeys(row) | {"method": "b", "why_not": "gives no P settings"}
    header, first, second = alternatives_table([row, missing]).splitlines()
    assert header.split() == ["method", "K", "TN", "TV", "worst", "Ms", "IAE", "load"]
    assert first.split() == ["a", "2", "∞", "0", "1.5", "∞"]
    assert second.split(maxsplit=6) == ["b", "—", "—", "—", "—", "—", "gives no P settings"]


def test_tune_prints_the_alternatives_and_writes_them(capsys, monkeypatch):
    monkeypatch.setenv("HEATERTUNE_CACHE", "")
    assert main(["tune", *HAND, "--method", "simc", "--closed-loop", "20", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["gain_pct_per_degC"] == pytest.approx(167.0 / (0.37 * 34.0))
    assert [row["method"] for row in document["alternatives"]] == ["this design", *RULES]
    assert document["forms"]["parallel"]["kp"] == document["gain_pct_per_degC"]
    assert "The rule claims: τc = θ: Ms 1.59" in document["notes"][1]
    assert main(["tune", *HAND, "--method", "simc", "--verbose"]) == 0
    out = capsys.readouterr().out
    assert "worst Ms" in out
    assert "in the series form: K" in out
    assert "cohen-coon" in out
