import json
import math
from dataclasses import replace
from threading import get_ident

import numpy as np
import pytest
from tests.witness.trace_measures import judge

from heatertune.errors import InputError
from heatertune.model.model_values import Fopdt
from heatertune.pid.design_values import PidDesign
from heatertune.pid.sampled_loop import margins
from heatertune.plc import Scaling, controller_for
from heatertune.plc.open_points import OpenPoint, settings_to_prove
from heatertune.proof import (
    Acceptance,
    Actuator,
    Coverage,
    LoopLimits,
    Scenario,
    paper_scenario,
    prove_models,
    runs,
    simulate,
)
from heatertune.proof.runs import measure_runs

PWM = Actuator(pwm_period_s=10.0)
PAPER = paper_scenario(duration_s=3000.0)
JUDGED = Acceptance(margins_of=margins)


def _switches(*sizes):
    return tuple(
        OpenPoint(name=f"s{i}", means={name: k for k, name in enumerate("bacd"[:size])}, reason="not told") for i, size in enumerate(sizes)
    )


@pytest.fixture
def slower(heater):
    return replace(heater, time_constant_s=220.0, dead_time_s=30.0)


def test_sane_words_pass(tenths, words, heater, slower):
    proof = prove_models(tenths, words(), [("best", heater), ("second", slower)], PAPER, PWM, JUDGED)
    assert proof.verdict == "PASS"
    assert [run.verdict for run in proof.runs] == ["PASS", "PASS"]
    assert all(each.ok for each in proof.criteria)


def test_words_that_are_unstable_on_one_model_fail_and_say_where(tenths, words, heater):
    late = replace(heater, dead_time_s=80.0)
    proof = prove_models(tenths, words(gain=15.0), [("best", heater), ("late", late)], PAPER, PWM, JUDGED)
    found = {each.name: each for each in proof.criteria}
    assert proof.verdict == "FAIL"
    assert [run.verdict for run in proof.runs] == ["PASS", "FAIL"]
    assert (found["stability"].ok, found["stability"].where) == (False, "late")
    assert (found["ms"].value, found["ms"].ok) == (math.inf, False)
    assert not found["limit_cycle"].ok, "time and frequency agree"
    assert found["settling_time"].value == math.inf
    assert proof.worst.model == late
    assert proof.nominal.model == heater


def test_an_unstable_loop_fails_without_margins_too(tenths, words, heater):
    proof = prove_models(tenths, words(gain=60.0), [("best", replace(heater, dead_time_s=80.0))], PAPER, PWM)
    assert proof.verdict == "FAIL"
    assert "ms" not in {each.name for each in proof.criteria}


def test_every_model_runs_under_every_setting(switched, words, heater, slower):
    proof = prove_models(switched, words(), [("best", heater), ("second", slower)], PAPER, PWM)
    assert len(proof.runs) == 16
    assert proof.runs[0].label == "best"
    assert {run.label for run in proof.runs} >= {
        "second", "best, integral = never off", "best, integral = never off, third = never off"
    }


def test_the_worst_setting_counts(switched, words, heater):
    alone = {
        setting: judge(simulate(switched, words(tn=60), heater, PAPER, PWM, {"integral": setting}), LoopLimits())
        for setting in ("off at the limit", "never off")
    }
    proof = prove_models(switched, words(tn=60), [("best", heater)], PAPER, PWM)
    *found_, step_power = proof.criteria  # the last one is of the words alone, whatever their setting
    assert step_power.name == "step_power"
    for mild, hard, found in zip(*alone.values(), found_, strict=True):
        if found.limit is not None:
            assert found.value == pytest.approx(max(mild.value, hard.value), rel=1e-9)
    overshoot = proof.criteria[0]
    assert overshoot.where.startswith("best, integral = never off"), "an integral that winds up overshoots more"


def test_runs_that_are_asked_for_alone_are_those_of_the_whole_proof_and_count_as_no_whole_one(
    switched, words, heater, slower
):
    heaters = [("best", heater), ("second", slower)]
    whole = prove_models(switched, words(tn=60), heaters, PAPER, PWM, JUDGED)
    chosen = [whole.runs[place] for place in (13, 2, 9)]
    alone = prove_models(switched, words(tn=60), heaters, PAPER, PWM, JUDGED,
                         Coverage(only=[run.run for run in chosen]))
    assert alone.runs == tuple(sorted(chosen, key=whole.runs.index))
    assert (whole.open_points, alone.open_points) == (True, False)
    with pytest.raises(InputError, match="at least one run"):
        prove_models(switched, words(tn=60), heaters, PAPER, PWM,
                     coverage=Coverage(only=[("third", whole.runs[0].switches, None)]))


@pytest.mark.parametrize("noise_degC", [0.0, 0.1])
@pytest.mark.parametrize("workers", [2, 3, 5])
def test_runs_that_processors_share_are_those_of_one(heater, slower, monkeypatch, workers, noise_degC):
    ob251 = controller_for("s5-ob251")
    words = ob251.encode(PidDesign(gain_pct_per_degC=2.0, integral_time_s=60.0, derivative_time_s=0.0,
                                   sample_time_s=10.0, structure="pi", method=""), Scaling())

    def proven():
        told = list[str]()
        proof = prove_models(
            ob251, words, [("best", heater), ("second", slower), ("third", replace(heater, dead_time_s=33.0))],
            replace(PAPER, noise_degC=noise_degC), PWM, JUDGED, Coverage(progress=told.append))
        return proof.runs, told

    alone, told = proven()
    threads = set()
    monkeypatch.setattr(runs, "_SHARED", 0)
    monkeypatch.setattr(runs, "processors", lambda: workers)
    monkeypatch.setattr(runs, "measure_runs", lambda *given, **named: threads.add(get_ident()) or measure_runs(*given, **named))
    shared, told_by_them = proven()
    assert shared == alone
    assert told_by_them[-1] == told[-1] == f"{len(alone)} of {len(alone)} runs"
    assert get_ident() not in threads


def test_the_worst_trace_is_the_run_that_strains_its_limits_most(switched, words, heater, slower):
    proof = prove_models(switched, words(tn=60), [("best", heater), ("second", slower)], PAPER, PWM)
    hardest = max(proof.runs, key=lambda run: run.strains)
    model = {"best": heater, "second": slower}[hardest.model]
    again = simulate(switched, words(tn=60), model, PAPER, PWM, hardest.switches)
    assert np.array_equal(proof.worst.temperature_degC, again.temperature_degC)


def test_where_nothing_is_worse_the_nominal_run_is_the_worst(tenths, words, heater):
    proof = prove_models(tenths, words(), [("best", heater), ("the same", heater)], PAPER, PWM)
    assert proof.worst is proof.nominal


def test_an_overflow_fails(tenths, words, heater):
    proof = prove_models(replace(tenths, overflows_above=530), words(), [("best", heater)], PAPER, PWM)
    assert [each.name for each in proof.criteria if not each.ok] == ["overflow"]
    assert proof.verdict == "FAIL"


@pytest.mark.parametrize(("sizes", "count"), [
    ((), 1), ((2,), 2), ((2, 2, 2), 8), ((2, 4), 8), ((3, 3), 5), ((2, 2, 2, 2), 5),
])
def test_settings_are_combined_where_they_are_few_and_else_varied_singly(sizes, count):
    switches = _switches(*sizes)
    settings = settings_to_prove(switches)
    assert len(settings) == len({tuple(each.items()) for each in settings}) == count
    assert set(settings[0].values()) <= {"b"}, "the defaults come first"
    for switch in switches:
        assert {each[switch.name] for each in settings} == set(switch.settings)


def test_what_shows_in_manual_alone_is_not_run_but_told(tenths, words, heater):
    shown, hidden = _switches(2, 2)
    hidden = replace(hidden, in_manual=True)
    assert settings_to_prove([shown, hidden]) == settings_to_prove([shown, hidden], {hidden.name: "b"})
    assert len(settings_to_prove([shown, hidden])) == 2
    s5 = controller_for("s5-ob251")
    which = [switch.name for switch in s5.switches if switch.in_manual]
    assert which == ["manual_flag", "velocity_return", "manual_way", "manual_count"]
    design = PidDesign(gain_pct_per_degC=2.0, integral_time_s=170.0, derivative_time_s=0.0, sample_time_s=10.0, structure="pi", method="")
    proofs = [prove_models(s5, s5.encode(design, Scaling()), [("best", heater)], PAPER, PWM,
                           coverage=Coverage(stated_settings=known, open_points=open_points))
              for known, open_points in (({}, True), ({"manual_way": "whole"}, True), ({}, False))]
    assert [len(proof.runs) for proof in proofs] == [6, 6, 1]
    told = [[name for name in which if any(name in part for part in proof.diagnostics.not_tested)] for proof in proofs]
    assert told == [which, [name for name in which if name != "manual_way"], []]


def test_the_document_is_json_and_tells_what_was_proven(tenths, words, heater):
    late = replace(heater, dead_time_s=80.0)
    proof = prove_models(tenths, words(gain=15.0), [("late", late)], PAPER, PWM, JUDGED)
    document = json.loads(json.dumps(proof.to_document(), allow_nan=False))
    assert (document["schema"], document["verdict"]) == ("heatertune/proof/4", "FAIL")
    assert document["words"] == {"K": 15000, "TN": 110}
    assert document["criteria"]["ms"] == {
        "value": None, "limit": 2.0, "bound": "<=", "ok": False, "unit": "1", "where": "late",
        "what": document["criteria"]["ms"]["what"],
    }
    assert document["runs"][0]["criteria"]["settling_time"] == {"value": None, "ok": False}
    assert document["scenario"]["disturbances"] == [{"time_s": 1620.0, "temperature_degC": -8.8}]
    assert document["limits"]["ms"] == 2.0


def test_a_proof_needs_a_model(tenths, words):
    with pytest.raises(InputError, match="at least one model"):
        prove_models(tenths, words(), [], PAPER, PWM)


def test_a_model_that_cannot_hold_the_setpoint_is_named(tenths, words, heater):
    weak = Fopdt(gain_degC_per_pct=0.2, time_constant_s=100.0, dead_time_s=5.0, ambient_degC=24.0)
    with pytest.raises(InputError, match=r"model weak: setpoint_degC = 53\.3 .* < 44 "):
        prove_models(tenths, words(), [("best", heater), ("weak", weak)], PAPER, PWM)


def test_pwm_ripple_and_mean_are_the_closed_form(constant, words, heater):
    # one lag, constant duty d: peak to peak = full rise·(1 − e^(−dP/T))·(1 − e^(−(1−d)P/T))/(1 − e^(−P/T))
    period, duty, full, lag = 40.0, 0.3, 41.0, 166.0
    trace = simulate(constant(100.0 * duty), words(), heater, Scenario(setpoint_degC=50.0, duration_s=4000.0),
                     Actuator(pwm_period_s=period))
    found = {each.name: each.value for each in judge(trace, LoopLimits())}
    up, down, both = (1.0 - math.exp(-share * period / lag) for share in (duty, 1.0 - duty, 1.0))
    assert found["pwm_ripple"] == pytest.approx(full * up * down / both, rel=1e-9)
    assert found["limit_cycle"] == pytest.approx(full * up * down / both / 2.0, rel=1e-6)
    assert found["steady_offset"] == pytest.approx(50.0 - (24.0 + full * duty), abs=1e-3)
    assert found["switchings"] == pytest.approx(90.0, abs=1.0)


def test_settings_that_no_run_tells_apart_are_not_tested(switched, words, heater):
    # the tenths room knows what "integral" does; "second" and "third" do nothing
    proof = prove_models(switched, words(tn=60), [("best", heater)], PAPER, PWM)
    assert proof.diagnostics.not_tested == ("settings of second, third (they change no run)",)
    known = prove_models(switched, words(tn=60), [("best", heater)], PAPER, PWM, coverage=Coverage(stated_settings={"second": "never off"}))
    assert known.diagnostics.not_tested == ("settings of third (they change no run)",)
    defaults = prove_models(switched, words(tn=60), [("best", heater)], PAPER, PWM, coverage=Coverage(open_points=False))
    assert defaults.diagnostics.not_tested == ()
