"""A PASS with noise is one of many draws: more of them decide, and the verdict's line says what that means."""

import math
from dataclasses import replace

import pytest
from tests.witness.trace_measures import judge

from heatertune.compiled import dispatch
from heatertune.model.model_values import Fopdt, model_by_hand
from heatertune.plc import Scaling, Words, controller_for
from heatertune.proof import simulate
from heatertune.proof.criteria import Criterion
from heatertune.proof.proof import DRAWS, draw_noise, nearest
from heatertune.proof.prove_words import prove
from heatertune.proof.scenario import delay_heater
from heatertune.proof.verdict import verdict_line
from heatertune.settings import Conditions

HEATER = Fopdt(gain_degC_per_pct=0.37, time_constant_s=167.0, dead_time_s=12.0, ambient_degC=22.0)
FITTED = model_by_hand(HEATER)
S5 = controller_for("s5-ob251")
WORDS = Words(
    target="s5-ob251", sample_time_s=4.0, scaling=Scaling(low_degC=0.0, high_degC=100.0),
    values={"K": 9881, "R": 1024, "TI": 63, "TD": 0, "W": 0, "STEU": 33, "YH": 0, "BGOG": 2047, "BGUG": 0})
KNOWN = {switch.name: switch.default for switch in S5.switches}
NOISY = Conditions(setpoint_degC=40.0, noise_degC=0.2, tolerance_degC=0.44, switches=KNOWN)


def _of(value, name="limit_cycle", limit=1.0):
    return Criterion(name=name, value=value, limit=limit, unit="°C", what="")


def _remarks(proof):
    return [remark for remark in proof.diagnostics.remarks if remark.startswith("noise")]


def test_so_many_draws_speak_of_95_percent_with_95_percent_confidence():
    # S. S. Wilks 1941: the least n with 0.95^n <= 0.05; tables of tolerance limits without a distribution have 59, too
    assert math.ceil(math.log(0.05) / math.log(0.95)) == DRAWS


def test_words_that_pass_with_one_draw_fail_where_another_breaks_a_limit(monkeypatch, rated_only):
    # at the rated power: at 121 % of it, where the run nearest to a limit is otherwise, 26 of 59 draws break it
    monkeypatch.setattr(dispatch, "_PLAIN_SCANS", 0)  # in the machine code that the proof has anyway
    proof = prove(WORDS, FITTED, replace(NOISY, tolerance_degC=0.42, spec=rated_only))
    assert proof.verdict == "FAIL"
    assert _remarks(proof) == ["noise of 0.2 °C: 1 of 59 draws break a limit on the run nearest to one"]
    # draws on their own, measured on their traces and not by the meter that the proof uses
    heater, broken = delay_heater(HEATER, S5.delay_s), proof.worst.scenario.seed
    assert 0 < broken < DRAWS
    for seed in (0, 1, broken, DRAWS - 1):
        trace = simulate(S5, WORDS, heater, replace(proof.scenario, seed=seed), proof.actuator, KNOWN)
        assert all(each.ok for each in judge(trace, proof.limits)) == (seed != broken)


@pytest.mark.long
@pytest.mark.parametrize("interlock", [None, "heater-fan"])
def test_words_that_pass_with_all_draws_say_on_the_verdicts_line_what_that_means(monkeypatch, interlock):
    monkeypatch.setattr("heatertune.proof.proof.DRAWS", 3)
    proof = prove(WORDS, FITTED, replace(NOISY, tolerance_degC=1.0, interlock=interlock))
    line = verdict_line(proof.to_document())
    assert line.startswith("PASS at 40 °C in 3 runs")  # at the rated power, and at 81 % and 121 % of it
    assert "noise of 0.2 °C: 3 draws on the run nearest to a limit keep all, so 95 % of all draws do (95 % confidence)" in line


def test_without_noise_for_a_first_look_and_for_what_fails_anyway_nothing_more_is_drawn():
    assert _remarks(prove(WORDS, FITTED, replace(NOISY, noise_degC=0.0))) == []
    assert _remarks(prove(WORDS, FITTED, NOISY, first_look=True)) == []
    failed = prove(WORDS, FITTED, replace(NOISY, tolerance_degC=0.1))
    assert (failed.verdict, _remarks(failed)) == ("FAIL", [])


def test_a_first_look_has_the_figures_that_the_whole_proof_measures_on_its_nominal_run_without_a_trace():
    whole = prove(WORDS, FITTED, replace(NOISY, noise_degC=0.0)).runs[0].criteria
    first = prove(WORDS, FITTED, replace(NOISY, noise_degC=0.0), first_look=True).runs[0].criteria
    assert [each.name for each in first] == [each.name for each in whole]
    assert [each.value for each in first] == pytest.approx([each.value for each in whole], rel=1e-9, abs=1e-9)


def test_draws_end_with_those_that_break_a_limit_and_the_worst_of_each_criterion_counts():
    asked = []

    def again(seeds):
        asked.extend(seeds)
        return [(_of(1.2 if seed == 9 else 0.4), _of(float(seed), "iae", None)) for seed in seeds]

    draws = draw_noise((_of(0.5), _of(7.0, "iae", None)), again, seed=7, scans=1_000_000, noise_degC=0.3)
    assert asked == [8, 9], "two at once, no more numbers fit, and none after those"
    assert [each.value for each in draws.criteria] == [1.2, 9.0]
    assert (draws.seed, draws.summary) == (9, "noise of 0.3 °C: 1 of 3 draws break a limit on the run nearest to one")


def test_a_draw_that_is_no_number_breaks_a_limit():
    draws = draw_noise((_of(0.5),), lambda seeds: [(_of(math.nan),) for _ in seeds], seed=0, scans=2_000_000, noise_degC=0.3)
    assert not draws.criteria[0].ok
    assert "1 of 2 draws" in draws.summary


def test_the_nearest_run_is_that_of_most_offset_and_swing_together_or_most_of_another_limit():
    def run(offset, swing, overshoot, reserve=0.0):
        return [_of(offset, "steady_offset"), _of(swing), _of(overshoot, "overshoot"), _of(reserve, "power_reserve")]

    assert nearest([run(0.1, 0.6, 0.7), run(0.4, 0.4, 0.1), run(0.1, 0.6, 0.75)]) == 1  # 0.8 of the band
    assert nearest([run(0.1, 0.6, 0.7), run(0.4, 0.4, 0.1), run(0.1, 0.6, 0.85)]) == 2
    assert nearest([run(0.1, 0.6, 0.7), run(0.1, 0.1, 0.1, reserve=0.99)]) == 0, "noise takes no power"
