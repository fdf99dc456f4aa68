"""Which words a design becomes."""

import math
from dataclasses import replace

import numpy as np
import pytest

from heatertune.batch.fleets import zone_row
from heatertune.errors import NotRepresentable, UnknownName
from heatertune.model.model_values import Fopdt, model_by_hand
from heatertune.model.statistics import Interval
from heatertune.pid.sampled_loop import iae_load, margins
from heatertune.pid.search.feasible import Problem, search
from heatertune.plc import controller_for, word_selection
from heatertune.plc.design import encode, tune
from heatertune.plc.word_selection import choose_words, search_document, tune_for_words
from heatertune.proof.redesign import DesignRequest
from heatertune.settings import Conditions, TuneSettings

HEATER = Fopdt(gain_degC_per_pct=0.37, time_constant_s=167.0, dead_time_s=12.0, ambient_degC=22.0)
SLOW = Fopdt(gain_degC_per_pct=0.8, time_constant_s=480.0, dead_time_s=60.0, ambient_degC=22.0)
#: the same heater as the S5's loop has it, whose input module is 0.48 s late
LATE = replace(SLOW, dead_time_s=60.48)


@pytest.fixture(autouse=True)
def no_cache(monkeypatch):
    monkeypatch.setenv("HEATERTUNE_CACHE", "")


def _optimum(plant, ta, ms=1.6):
    problem = Problem(plants=(plant,), structure="pi", ms=ms, sample_time_s=ta)
    return search(problem)


def test_where_rounding_decides_the_best_words_keep_the_limit_and_win_back_what_rounding_costs():
    # reference tuning page: naive rounding breaks at TI words of 10 and less; solving K anew recovers most of it
    design, fitted = _optimum(LATE, 1.0), model_by_hand(SLOW)
    choice = choose_words(design, "s5-ob251", fitted)
    plain = controller_for("s5-ob251").decode(encode(design, "s5-ob251"))
    best = controller_for("s5-ob251").decode(choice.words)
    wished = iae_load(LATE, design)
    assert choice.words.values["TI"] < 10
    assert margins(LATE, best).ms <= margins(LATE, design).ms
    lost, left = abs(iae_load(LATE, plain) / wished - 1.0), iae_load(LATE, best) / wished - 1.0
    assert lost > 0.05 or margins(LATE, plain).ms > margins(LATE, design).ms + 0.03
    assert left < 0.6 * max(lost, 0.35 * 0.5)
    search = choice.search.to_document()
    assert search["gap_pct"] == pytest.approx(100.0 * left)
    assert search["rounded"]["gap_pct"] == pytest.approx(100.0 * (iae_load(LATE, plain) / wished - 1.0))
    assert search["proven"]
    assert any("rounding matters" in note for note in search["notes"])


def test_the_interval_it_proposes_makes_the_word_fine():
    choice = choose_words(_optimum(SLOW, 1.0), "s5-ob251", model_by_hand(SLOW))
    note = next(note for note in choice.search.notes if "rounding matters" in note)
    ta = float(note.split("TA = ")[1].split(" s")[0])
    finer = choose_words(_optimum(SLOW, ta), "s5-ob251", model_by_hand(SLOW))
    assert 16 <= finer.words.values["TI"] <= 24
    assert not any("rounding matters" in note for note in finer.search.notes)


@pytest.mark.parametrize(
    ("target", "way", "said"),
    [
        ("weg", "auto", "there is no search over those of weg"),
        ("fb41", "optimum", "there is no search over those of fb41"),
        ("on-off", "auto", "no PID"),
        ("s5-ob251", "rounded", "requested with"),
    ],
)
def test_where_there_is_no_search_the_words_are_the_rounded_ones_and_it_is_said_why(target, way, said):
    design, fitted = _optimum(HEATER, 4.0), model_by_hand(HEATER)
    choice = choose_words(design, target, fitted, way=way)
    assert choice.words == encode(design, target)
    assert choice.search.way == "rounded"
    assert said in choice.search.notes[0]
    if target == "weg":
        assert abs(choice.search.realised.gap_pct) < 1e-4


def test_a_rule_is_kept_unless_the_optimum_is_asked_for():
    fitted = model_by_hand(HEATER)
    design = tune(fitted, target="s5-ob251", method="simc")
    assert choose_words(design, "s5-ob251", fitted).words == encode(design, "s5-ob251")
    asked = choose_words(design, "s5-ob251", fitted, way="optimum")
    assert asked.search.way == "optimum"
    assert asked.search.realised.iae_load < choose_words(design, "s5-ob251", fitted).search.realised.iae_load
    assert asked.search.realised.ms <= asked.search.ms_limit


def test_a_p_controller_and_an_unstable_design_are_only_rounded():
    fitted = model_by_hand(HEATER)
    p = choose_words(tune(fitted, structure="p", sample_time_s=4.0), "s5-ob251", fitted)
    assert "without an I part" in p.search.notes[0]
    wild = replace(_optimum(HEATER, 4.0), gain_pct_per_degC=31.0, integral_time_s=20.0)
    assert math.isinf(margins(HEATER, wild).ms)
    found = choose_words(wild, "s5-ob251", fitted)
    assert found.search.way == "rounded"
    assert found.search.realised.ms is None
    assert "does not settle" in found.search.notes[0]


def _open(plant):
    """A heater by hand with an interval of its gain, so that there are heaters to draw."""
    gain = plant.gain_degC_per_pct
    return replace(model_by_hand(plant), ci95={"gain_degC_per_pct": Interval(low=0.8 * gain, high=1.25 * gain)})


def test_a_document_tells_ms_on_drawn_heaters_of_the_very_words():
    fitted = _open(HEATER)
    choice = choose_words(_optimum(HEATER, 4.0), "weg", fitted)
    document = search_document(choice, fitted, ["One more."])
    # an interval of ±25 % is ln(1.25)/1.96 = 0.1138 in standard deviations: Ms at these gains, heater by heater
    real, draws = controller_for("weg").decode(choice.words), np.random.default_rng(0).normal(0.0, 1.0, (200, 3))[:, 0]
    gains = HEATER.gain_degC_per_pct * np.exp(draws * math.log(1.25) / 1.96)
    alone = sorted(margins(replace(HEATER, gain_degC_per_pct=gain), real).ms for gain in gains)
    drawn = document["ms_sampled"]
    assert (drawn["count"], drawn["unstable"]) == (200, 0)
    assert drawn["worst"] == pytest.approx(alone[-1], rel=1e-9)
    assert drawn["median"] == pytest.approx(alone[100], rel=1e-9)
    assert alone[100] < drawn["p95"] < alone[-1]
    assert document["notes"] == [*choice.search.notes, "One more."]
    assert {name: document[name] for name in choice.search.to_document() if name != "notes"} == {
        name: value for name, value in choice.search.to_document().items() if name != "notes"}
    assert search_document(choose_words(_optimum(HEATER, 4.0), "on-off", fitted), fitted)["ms_sampled"] is None
    assert search_document(choice, model_by_hand(HEATER))["ms_sampled"] is None


@pytest.mark.long
def test_a_row_of_a_table_which_shows_no_drawn_heaters_draws_none(monkeypatch):
    def refuse(*_):
        raise AssertionError("drawn for nobody")

    monkeypatch.setattr(word_selection, "draw_heaters", refuse)
    row = zone_row("zone", lambda: _open(HEATER), DesignRequest(
        target="weg", tune_settings=TuneSettings(method="simc"), conditions=Conditions(setpoint_degC=40.0)))
    assert row["runs"] > 0, "the words were proven"
    with pytest.raises(AssertionError, match="for nobody"):
        search_document(choose_words(_optimum(HEATER, 4.0), "weg", _open(HEATER)), _open(HEATER))


def test_bad_names_and_words_that_do_not_fit_are_refused():
    fitted = model_by_hand(HEATER)
    with pytest.raises(UnknownName, match="known: auto, optimum, rounded"):
        choose_words(_optimum(HEATER, 4.0), "s5-ob251", fitted, way="best")
    with pytest.raises(NotRepresentable, match="slower TA"):
        choose_words(_optimum(SLOW, 0.1), "s5-ob251", model_by_hand(SLOW))


@pytest.mark.long
def test_the_interval_found_by_the_words_is_no_worse_than_the_usual_one():
    fitted = model_by_hand(SLOW)
    usual = tune(fitted, target="s5-ob251")
    found = tune_for_words(fitted, target="s5-ob251")
    costs = [choose_words(design, "s5-ob251", fitted).search.realised.iae_load for design in (usual, found)]
    assert costs[1] <= costs[0]
    assert found.sample_time_s in np.round(np.array([0.5, 0.7, 1.0, 1.4, 2.0]) * usual.sample_time_s, 1)
    assert any("after rounding" in note for note in found.notes)
