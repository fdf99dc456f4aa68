"""What the judge in C sees after open circuits and restarts that a story does not tell, and the proof does not pass."""

import math
import shutil
from dataclasses import replace

import numpy as np
import pytest

from heatertune.model.model_values import model_by_hand
from heatertune.plc import Boost, Ramp, Words, controller_for
from heatertune.plc.open_points import settings_to_prove
from heatertune.plc.single_precision import single
from heatertune.proof.heaters import holding_heaters
from heatertune.proof.prove_words import prove, setpoints_for
from heatertune.proof.redesign import find_passing_design
from heatertune.proof.repetition import repeat_words
from tests.bench import second_opinion
from tests.bench.false_passes import _limits
from tests.bench.outages import SHORT_SLACK, Night, asked, bench_of, changes, logged, low_overshoots, restarts
from tests.bench.second_opinion import SWITCHES, compiled, opinion

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler, cc")

FIRST = {name: choices[0] for name, choices in SWITCHES["marlin"].items()}
NO_LIMITS = dict.fromkeys(("overshoot", "change_overshoot", "small_change_overshoot", "restart_overshoot", "reheat_overshoot", "recovery_overshoot"), np.inf)


def _rated(conditions, folder):
    """Return conditions without other mains voltages: boosts set for the rated power may break the sequence itself at 121 %."""
    path = folder / "rated.toml"
    path.write_text('preset = "general"\n[story]\nmains = false\n')
    return replace(conditions, spec=str(path))


@pytest.mark.long(seconds=20)
@pytest.mark.parametrize(("number", "target", "within_degC", "again_degC", "beyond"), [
    (17, "simple-pid", 1.99, 2.99, 1.3), (31, "esphome", 7.75, 11.6, 1.05), pytest.param(41, "esphome", 5.36, 8.04, 1.03, marks=pytest.mark.sample),
    pytest.param(43, "simple-pid", 28.0, 42.0, 1.04, marks=pytest.mark.sample)])
def test_a_boost_that_lasts_a_scan_longer_after_another_time_without_supply_does_not_pass(
    tmp_path, number, target, within_degC, again_degC, beyond
):
    # passed, before the proof looked at so many lengths that some come near the worst one; the figures are the judge's
    model, wanted = asked(number, target)
    design = find_passing_design(model_by_hand(model), replace(wanted, as_is=True))
    words = design.proof.words.with_boost(Boost(within_degC=single(within_degC), again_degC=single(again_degC)))
    proof = prove(words, model_by_hand(model), _rated(design.conditions, tmp_path))
    broken = [criterion.name for criterion in proof.criteria if not criterion.ok]
    assert broken == (["restart_overshoot"] if number == 17 else []), "17: by a late call that ends the boost, of the story itself"
    assert broken or "warm-restart" in proof.diagnostics.blocking
    assert proof.verdict == ("FAIL" if broken else "NOT PROVEN")
    benches = [bench_of(model, replace(design, proof=proof), settings) for settings in settings_to_prove(controller_for(target).switches)]
    library, limits = compiled(tmp_path), _limits(proof.limits) | {"iae": math.inf}
    assert max(restarts(library, b, limits)[0][0] for b in benches) > beyond


@pytest.mark.long(seconds=20)
@pytest.mark.parametrize(("number", "target", "within_degC", "again_degC"), [
    (30_001, "simple-pid", 9.64, 14.5), pytest.param(30_030, "arduino-pid", 16.3, 24.4, marks=pytest.mark.sample)])
def test_a_boost_that_no_part_of_the_range_begins_does_not_pass(tmp_path, number, target, within_degC, again_degC):
    model, wanted = asked(number, target)
    design = find_passing_design(model_by_hand(model), replace(wanted, as_is=True))
    words = design.proof.words.with_boost(Boost(within_degC=single(within_degC), again_degC=single(again_degC)))
    proof = prove(words, model_by_hand(model), _rated(design.conditions, tmp_path))
    change = next(criterion for criterion in proof.criteria if criterion.name == "change_overshoot")
    assert change.value < 0.2 * change.limit, "from the lowest setpoint on, which the boost leads"
    assert "part-change" in [finding.name for finding in proof.diagnostics.findings]
    assert proof.verdict == "NOT PROVEN"
    benches = [bench_of(model, replace(design, proof=proof), settings) for settings in settings_to_prove(controller_for(target).switches)]
    library, limits = compiled(tmp_path), _limits(proof.limits)
    seen = max(changes(library, b, limits, design.conditions.lowest_degC)[0] for b in benches)
    assert seen[0] > 1.1
    mended = find_passing_design(model_by_hand(model), wanted)
    assert mended.proof.verdict == "PASS"
    benches = [bench_of(model, mended, settings) for settings in settings_to_prove(controller_for(target).switches)]
    assert max(changes(library, b, limits, design.conditions.lowest_degC)[0] for b in benches)[0] <= 1.0


@pytest.mark.long(seconds=20)
@pytest.mark.parametrize(("number", "target", "beyond", "low_beyond"), [
    pytest.param(30_008, "pband", 1.29, None, marks=pytest.mark.sample), (30_016, "pband", 1.06, 1.15)])
@pytest.mark.parametrize("is_mended", [False, pytest.param(True, marks=pytest.mark.sample)])  # mended ones of a range stand above
def test_a_part_of_the_range_in_which_more_is_summed_up_than_in_all_of_it_does_not_pass(
    tmp_path, number, target, beyond, low_beyond, is_mended
):
    # passed, before the setpoint was changed by less than its range: the sum is zero outside of the proportional band
    model, wanted = asked(number, target)
    wanted = replace(wanted, conditions=_rated(wanted.conditions, tmp_path))
    design = find_passing_design(model_by_hand(model), replace(wanted, as_is=not is_mended))
    library, limits = compiled(tmp_path), _limits(design.proof.limits) | {"iae": math.inf}
    settings, lowest = settings_to_prove(controller_for(target).switches), wanted.conditions.lowest_degC
    outside = next(each for each in settings if each["anti_windup"] == "outside_band")
    changed = changes(library, bench_of(model, design, outside), limits, lowest)[0][0]
    opened = max(low_overshoots(library, bench_of(model, design, each), limits, lowest)[0][0] for each in settings)
    if is_mended:
        assert design.proof.verdict == "PASS"
        assert changed <= 1.0
        assert opened < SHORT_SLACK
        return
    assert all(criterion.ok for criterion in design.proof.criteria), "of the story"
    low_outage = [] if low_beyond is None else ["low-outage"]
    assert [finding.name for finding in design.proof.diagnostics.findings] == [*low_outage, "part-change"]
    assert design.proof.verdict == "NOT PROVEN"
    assert changed > beyond
    # nor does the judge see more after an open circuit at the lower setpoint than the proof does
    assert opened < 1.0 if low_beyond is None else opened > low_beyond


@pytest.mark.long(seconds=20)
def test_the_heater_that_is_the_hardest_in_a_part_of_the_range_is_found_where_it_is_another_one(tmp_path):
    # passed at 1.05 of the limit, when only that which overshoots most in all of the range was run; likewise 112 on esphome
    # (at 1.06), whose search takes 230 s: its smaller range is proven below
    target = "s7-200"
    fitted, wanted = logged(126, target, tmp_path)
    free = find_passing_design(fitted, replace(wanted, tune_settings=replace(wanted.tune_settings, sample_time_s=None)))
    assert free.proof.verdict == "PASS"
    last = _last_words(wanted)
    assert wanted.tune_settings.sample_time_s == last.sample_time_s
    design = replace(free, proof=prove(last, fitted, wanted.conditions))
    models, lowest = holding_heaters(fitted, setpoints_for(fitted, wanted.conditions)[1]), wanted.conditions.lowest_degC
    library, limits = compiled(tmp_path), _limits(design.proof.limits) | {"iae": math.inf}
    assert len(models) > 1

    # it has no limit of the output and no boost: after an open circuit at 27.2 °C, which 5 % of the power hold, nothing ends
    # full power in time where a width applies a cycle late; the judge sees it, and none over a smaller range
    assert design.proof.verdict == "NOT PROVEN"
    assert "low-outage" in [finding.name for finding in design.proof.diagnostics.findings]
    assert _most(low_overshoots, library, models, design, limits, lowest) > 1.0


def _last_words(wanted):
    """Return the words at which the search for heater 126 on s7-200 ends, which takes 200 s itself."""
    return Words(target="s7-200", values={"KP": 18225, "KI": 1416, "KD": 10146, "SCALE": 4, "TICK": 250, "TICKS": 128},
                 scaling=wanted.scaling, sample_time_s=32.0, ramp=Ramp(step=7, calls=8, hold=8))


@pytest.mark.sample
@pytest.mark.long(seconds=200)
def test_the_search_for_the_stated_interval_ends_at_these_words_and_names_the_way_on(tmp_path):
    fitted, wanted = logged(126, "s7-200", tmp_path)
    design = find_passing_design(fitted, wanted)
    assert design.proof.words == _last_words(wanted)
    assert design.passes_with == ("--sample-time", "auto")


@pytest.mark.long(seconds=20)
@pytest.mark.parametrize(("number", "target", "lowest", "highest"), [(126, "s7-200", 34.92, 37.5)])
def test_a_smaller_range_passes_where_the_judge_sees_nothing_either(tmp_path, number, target, lowest, highest):
    fitted, wanted = logged(number, target, tmp_path)
    design = find_passing_design(fitted, replace(wanted, conditions=replace(wanted.conditions, setpoint_degC=(lowest, highest))))
    assert design.proof.verdict == "PASS"
    models = holding_heaters(fitted, setpoints_for(fitted, design.conditions)[1])
    library, limits = compiled(tmp_path), _limits(design.proof.limits) | {"iae": math.inf}
    assert _most(changes, library, models, design, limits, lowest) < SHORT_SLACK
    assert _most(low_overshoots, library, models, design, limits, lowest) < SHORT_SLACK


def _most(of, library, models, design, limits, lowest):
    """How much of a limit the judge sees used at most on these heaters, under every setting that is not stated."""
    every = settings_to_prove(controller_for(design.proof.words.target).switches, design.proof.stated_settings)
    return max(of(library, bench_of(model, design, settings), limits, lowest)[0][0] for _, model in models for settings in every)


def _stays(library, model, design, monkeypatch):
    """Whether the judge sees the heater stay at the edge after one of 60 open circuits that end around it, without a load."""
    b = bench_of(model, design, FIRST)
    told, window = Night(b), b.words["PID_FUNCTIONAL_RANGE"]
    falls = second_opinion._takes(b, window / (b.setpoint - b.ambient)) - b.dead
    for share in np.random.default_rng(1).uniform(-1.0, 2.0, 60):
        told.open(max(b.interval, falls + share * b.dead))
    monkeypatch.setattr(second_opinion, "story", lambda _: told.parts)
    seen = opinion(library, b, NO_LIMITS, longer=0.0).seen
    return [part["rest_lowest"] < -0.5 * window for part in seen[2::2]]


@pytest.mark.long(seconds=20)
@pytest.mark.parametrize("number", [20535, pytest.param(20621, marks=pytest.mark.sample)])
def test_what_stays_at_the_edge_of_marlins_window_does_not_pass(tmp_path, monkeypatch, number):
    # the heaters that passed a story without the edge, of 125 drawn: they stay there after one circuit in thirty, at no load
    model, wanted = asked(number, "marlin")
    design = find_passing_design(model_by_hand(model), wanted)
    assert any(_stays(compiled(tmp_path), model, design, monkeypatch))
    assert design.proof.verdict == "FAIL"
    assert "reheat_time" in {each.name for each in design.proof.criteria if not each.ok}


@pytest.mark.long(seconds=20)
def test_what_the_judge_sees_stay_there_under_a_load_alone_is_found_under_a_load_alone(tmp_path, monkeypatch):
    # P asks for 36 % at the edge, 53 % hold the setpoint: the sum leads on before the heater is out of the window again; under the
    # test sequence's load of 10 % of the power, 63 % hold it, as in a room that is colder by what 10 % heat
    model, wanted = asked(20020, "marlin")
    conditions = _rated(wanted.conditions, tmp_path)
    design = find_passing_design(model_by_hand(model), replace(wanted, conditions=conditions))
    assert not any(_stays(compiled(tmp_path), model, design, monkeypatch))
    loaded = replace(model, ambient_degC=model.ambient_degC - 10.0 * model.gain_degC_per_pct)
    assert any(_stays(compiled(tmp_path), loaded, design, monkeypatch))
    assert design.proof.verdict == "PASS"
    assert "loaded-window" in [finding.name for finding in design.proof.diagnostics.findings]


@pytest.mark.long(seconds=20)
def test_what_stays_there_only_at_a_low_voltage_does_not_pass(tmp_path, monkeypatch):
    # the same heater with 81 % of its power: 53 / 0.81 = 66 % hold the setpoint, and the sum no longer leads on in time
    model, wanted = asked(20020, "marlin")
    design = find_passing_design(model_by_hand(model), wanted)
    low = replace(model, gain_degC_per_pct=0.81 * model.gain_degC_per_pct)
    assert any(_stays(compiled(tmp_path), low, design, monkeypatch))
    assert design.proof.verdict == "FAIL"
    assert {run.mains_power for run in design.proof.runs if run.verdict == "FAIL"} == {0.9**2}


@pytest.mark.long(seconds=20)
@pytest.mark.parametrize("number", [20535, pytest.param(20020, marks=pytest.mark.sample)])
def test_a_design_widens_marlins_window_where_the_loop_falls_out_of_it(tmp_path, monkeypatch, number):
    # the heaters of the tests above, designed by the search: the judge sees none stay at the edge, at no load and under one
    model, wanted = asked(number, "marlin")
    design = find_passing_design(model_by_hand(model), replace(wanted, as_is=False))
    assert design.proof.verdict == "PASS"
    assert design.proof.words.values["PID_FUNCTIONAL_RANGE"] == design.recipe.window_degC > 10
    assert "a firmware built with a window of" in design.notes[0]
    loaded = replace(model, ambient_degC=model.ambient_degC - 10.0 * model.gain_degC_per_pct)
    for heater in (model, loaded):
        assert not any(_stays(compiled(tmp_path), heater, design, monkeypatch))
    assert repeat_words(design.ideal, model_by_hand(model), design.recipe).words == design.proof.words
