"""python-control and CasADi beside heatertune: the libraries are the witnesses, and a fault on either side is noticed."""

import json
from dataclasses import replace

import pytest
from tests.conftest import heater_log

import heatertune as ht
from heatertune.chain import precompile, second_opinion
from heatertune.codec import encode
from heatertune.model.model_values import model_by_hand
from heatertune.pid.sampled_loop import Margins
from heatertune.pid.search.feasible import nonlinear_program
from heatertune.pid.tune import stated_problem
from heatertune.plc.design import loop_fit
from heatertune.report import report_text
from heatertune.settings import TuneSettings

HEATER = ht.Fopdt(gain_degC_per_pct=0.9, time_constant_s=167.0, dead_time_s=12.0, ambient_degC=22.0)


def _opinion(target="weg", changed=None, **tuning):
    fitted, settings = loop_fit(model_by_hand(HEATER), target), TuneSettings(**tuning)
    ideal = ht.tune(HEATER, settings, target=target)
    problem = replace(stated_problem(fitted, settings, ideal.sample_time_s), derivative_filter=ideal.derivative_filter)
    realised = ht.decode(ht.encode(ideal, target))
    return second_opinion.second_opinion(realised, fitted.heaters, changed or ideal, problem, is_optimum=changed is None)


@pytest.mark.parametrize(("target", "structure", "ms"), [
    ("weg", "pi", 1.6), ("s7-300", "pid", 1.4), ("s5-ob251", "pi", 2.0), ("klipper", "pid", 1.6)])
def test_both_say_the_same_of_margins_step_and_optimum(target, structure, ms):
    opinion = _opinion(target, structure=structure, ms=ms)
    assert [row.quantity.split(" (")[0] for row in opinion.rows] == [
        "Ms", "Mt", "gain margin", "phase margin [°]", "highest value of the setpoint's step", "cost of the optimum"]
    assert second_opinion.disagreement(opinion) == ()
    for row in opinion.rows[:-1]:
        assert row.value == pytest.approx(row.library_value, rel=1e-3)


@pytest.mark.parametrize("target", ["klipper", "marlin", "omron-e5cc"])
@pytest.mark.parametrize("dead_time_s", [51.7, 4.0, 2.0])
def test_a_response_of_thousands_of_samples_is_counted_to_its_end(target, dead_time_s):
    heater = ht.Fopdt(gain_degC_per_pct=0.52, time_constant_s=389.0, dead_time_s=dead_time_s, ambient_degC=30.0)
    ideal = ht.tune(heater, target=target)
    problem = stated_problem(loop_fit(model_by_hand(heater), target), TuneSettings(), ideal.sample_time_s)
    rounded = 1e-4 * 400 * ideal.sample_time_s  # most that the corner of |e|, which the program rounds, adds [°C·s]
    for gain in (1.0, 0.6):  # the IAE by simulation from sample to sample
        design = replace(ideal, gain_pct_per_degC=gain * ideal.gain_pct_per_degC)
        program = nonlinear_program(problem, design)
        assert program.cost_at(program.start) == pytest.approx(problem.cost(design), rel=0.01, abs=rounded)


def test_a_response_that_is_too_long_for_its_dead_time_is_not_compared():
    heater = ht.Fopdt(gain_degC_per_pct=0.52, time_constant_s=2000.0, dead_time_s=0.5, ambient_degC=30.0)
    ideal = replace(ht.tune(heater, target="marlin"), gain_pct_per_degC=0.5, integral_time_s=2000.0)
    problem = stated_problem(loop_fit(model_by_hand(heater), "marlin"), TuneSettings(), ideal.sample_time_s)
    opinion = second_opinion.second_opinion(None, [], ideal, problem, is_optimum=True)
    assert "Not compared with CasADi: the response takes " in opinion.notes[-1]


def test_a_design_that_is_no_optimum_may_cost_more_and_is_told_so():
    slow = replace(ht.tune(HEATER, target="weg"), gain_pct_per_degC=1.0)
    opinion = _opinion(changed=slow)
    assert len(opinion.rows) == 5
    assert "times that of the design, which is no optimum" in opinion.notes[-1]


def test_a_slow_gain_that_calls_itself_the_optimum_is_a_disagreement():
    fitted, ideal = model_by_hand(HEATER), ht.tune(HEATER, target="weg")
    slow = replace(ideal, gain_pct_per_degC=0.5 * ideal.gain_pct_per_degC)
    problem = replace(stated_problem(fitted, TuneSettings(), ideal.sample_time_s), derivative_filter=ideal.derivative_filter)
    found = second_opinion.disagreement(second_opinion.second_opinion(None, [], slow, problem, is_optimum=True))
    assert [finding.name for finding in found] == ["second-opinion"]
    assert "CasADi (IPOPT) calculates cost of the optimum (load)" in found[0].message


def test_the_lines_show_both_figures():
    lines = report_text.opinion_lines(encode(_opinion()))
    assert "heatertune  the library" in lines.splitlines()[0]
    assert "python-control" in lines
    assert "DISAGREES" not in lines




@pytest.mark.long
def test_a_fault_of_the_margins_leaves_the_parameters_unproven_and_exports_nothing(tmp_path, monkeypatch):
    def flattered(model, design):
        real = margins(model, design)
        return Margins(ms=0.9 * real.ms, mt=real.mt, gain_margin=real.gain_margin, phase_margin_deg=real.phase_margin_deg)

    margins = second_opinion.margins
    monkeypatch.setattr(second_opinion, "margins", flattered)
    monkeypatch.setattr(precompile, "processors", lambda: 1)  # in this process
    log = tmp_path / "oven.csv"
    log.write_text(heater_log(0.4, 1), encoding="utf-8")
    result = ht.design(log, target="weg", out=tmp_path / "out")
    assert result.outcome.proof.verdict == "NOT PROVEN"
    assert result.outcome.proof.diagnostics.blocking == ("second-opinion",)
    assert not result.files
    assert "python-control calculates Ms" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    stored = json.loads((tmp_path / "out" / "data" / "second_opinion.json").read_text(encoding="utf-8"))
    assert stored["rows"][0]["agrees"] is False
    assert stored["digest"] == result.documents["proof"]["digest"]
