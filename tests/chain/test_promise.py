"""What --robust promises on heaters drawn from the fit, kept by the words too.

Ms on one heater is `margins`, which tests/pid holds to python-control; here it is what is done with it that is tested.
"""

from dataclasses import replace

import pytest

from heatertune.errors import DocumentError, NotRepresentable
from heatertune.model.model_values import Fopdt, model_by_hand
from heatertune.model.statistics import Interval
from heatertune.pid.design_document import from_document, to_document
from heatertune.pid.design_values import Promise
from heatertune.pid.sampled_loop import iae_load, margins, noise_gain
from heatertune.pid.search.robust import Open, draw_heaters
from heatertune.plc import controller_for
from heatertune.plc.design import encode, tune
from heatertune.plc.word_selection import RealisedResult, WordChoice, WordSearch, choose_words
from heatertune.proof.refine import _RefinementLoop

SLOW = Fopdt(gain_degC_per_pct=0.8, time_constant_s=480.0, dead_time_s=60.0, ambient_degC=22.0)
FITTED = replace(model_by_hand(SLOW), ci95={
    "gain_degC_per_pct": Interval(low=0.7, high=0.92), "dead_time_s": Interval(low=52.0, high=69.0)})

#: the same as the S5's loop has them, whose input module is 0.48 s late
LATE = replace(SLOW, dead_time_s=60.48)


def late_heaters():
    """Return the heaters drawn from the fit, each with the module's delay."""
    return [replace(heater, dead_time_s=heater.dead_time_s + 0.48) for heater in draw_heaters(FITTED)]


@pytest.fixture(autouse=True)
def no_cache(monkeypatch):
    monkeypatch.setenv("HEATERTUNE_CACHE", "")


@pytest.fixture(scope="module")
def design():
    """At 0.6 s a step of TI is a third of it, so that rounding decides."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HEATERTUNE_CACHE", "")
        return tune(FITTED, target="s5-ob251", robust="worst", sample_time_s=0.6)


def ms_of(heater, loop):
    return margins(heater, loop).ms


def peaks(words, peak=ms_of, heaters=None):
    """Return a peak on each heater, those drawn if none are given, in rising order."""
    loop = controller_for(words.target).decode(words)
    return sorted(peak(heater, loop) for heater in heaters or late_heaters())


@pytest.mark.long
def test_where_rounding_breaks_it_the_words_found_keep_it_and_rounded_ones_tell_by_how_much(design):
    assert design.promise == Promise(way="worst", limits={"ms": 1.6})
    rounded = encode(design, "s5-ob251")
    worst = peaks(rounded)[-1]
    assert worst > 1.02 * 1.6
    told = choose_words(design, "s5-ob251", FITTED, way="rounded")
    assert told.words == rounded
    assert f"Ms is {worst:.4g}, {100.0 * (worst / 1.6 - 1.0):.2g} % above 1.6" in told.search.notes[-1]
    found = choose_words(design, "s5-ob251", FITTED)
    assert found.words != rounded
    assert peaks(found.words)[-1] <= 1.6
    assert found.search.notes[-1] == (
        "Of the 200 heaters sampled from the fit, all of them keep the limits with the rounded parameters too.")
    assert found.search.to_document()["robust"] == {"way": "worst", "limits": {"ms": 1.6}}


@pytest.mark.long
def test_with_p95_one_in_twenty_may_break_it(design):
    free = choose_words(replace(design, promise=None), "s5-ob251", FITTED)
    limit = 0.99 * peaks(free.words)[189]
    found = choose_words(replace(design, promise=Promise(way="p95", limits={"ms": limit})), "s5-ob251", FITTED)
    ms = peaks(found.words)
    assert ms[189] <= limit < ms[199]


@pytest.mark.long
@pytest.mark.parametrize("name", ["ms", "mks"])
def test_a_promise_tighter_than_the_candidates_limit_is_searched_on_to_the_best_words(design, name):
    peak = ms_of if name == "ms" else noise_gain
    free = choose_words(replace(design, promise=None), "s5-ob251", FITTED)
    limit = 0.97 * peaks(free.words, peak)[-1]
    found = choose_words(replace(design, promise=Promise(way="worst", limits={name: limit})), "s5-ob251", FITTED)
    assert peaks(found.words, peak)[-1] <= limit
    # by hand: with each TI the largest K that keeps both, found by halving, since both rise with K; the heaters that
    # are worst with one gain are with all near it
    loop = controller_for("s5-ob251").decode(found.words)
    worst = sorted(late_heaters(), key=lambda heater: peak(heater, loop))[-20:]
    costs = []
    for ti in (2, 3, 4):
        low, high = 2000, 4047
        while low < high:
            middle = (low + high + 1) // 2
            words = replace(found.words, values=dict(found.words.values) | {"K": middle, "TI": ti})
            loop = controller_for("s5-ob251").decode(words)
            kept = margins(LATE, loop).ms <= found.search.ms_limit and peaks(words, peak, worst)[-1] <= limit
            low, high = (middle, high) if kept else (low, middle - 1)
        if low > 2000:  # else none was kept
            words = replace(found.words, values=dict(found.words.values) | {"K": low, "TI": ti})
            costs.append(iae_load(LATE, controller_for("s5-ob251").decode(words)))
    assert found.search.realised.iae_load == pytest.approx(min(costs), rel=1e-3)


@pytest.mark.long
def test_words_that_cannot_keep_it_are_refused_with_what_would_help(design):
    asked = replace(design, promise=Promise(way="p95", limits={"ms": 0.99}))
    with pytest.raises(NotRepresentable, match=r"Ms of the rounded parameters .* \(95 % of them\) would be 1\.\d+, allowed <= 0\.99"):
        choose_words(asked, "s5-ob251", FITTED)
    told = choose_words(asked, "s5-ob251", FITTED, way="rounded")
    assert "Rounding breaks the limits" in told.search.notes[-1]


@pytest.mark.long
def test_a_controller_without_whole_numbers_is_held_to_it_as_well(design):
    assert choose_words(design, "weg", FITTED).search.notes[-1].startswith("Of the 200 heaters")
    with pytest.raises(NotRepresentable, match="sampled from the fit"):
        choose_words(replace(design, promise=Promise(way="worst", limits={"ms": 1.5})), "weg", FITTED)


@pytest.mark.long
def test_without_intervals_nothing_can_be_told_and_without_a_promise_nothing_is(design):
    blind = choose_words(design, "s5-ob251", model_by_hand(SLOW))
    assert "could not be checked" in blind.search.notes[-1]
    plain = choose_words(replace(design, promise=None), "s5-ob251", FITTED)
    assert plain.search.promise is None
    assert not any("keep the limits with the rounded" in note for note in plain.search.notes)


@pytest.mark.long
def test_refining_looks_only_at_words_that_keep_it(design):
    rounded = encode(design, "s5-ob251")
    search = WordSearch(
        way="rounded", realised=RealisedResult(iae_load=None, gap_pct=None, ms=None), ms_limit=None, iae_load_wished=None, notes=())
    held = replace(search, promise=Promise(way="worst", limits={"ms": 1.6}))
    near = {}
    for name, found in (("held", held), ("free", search)):
        loop = _RefinementLoop(choice=WordChoice(words=rounded, search=found), fitted_model=FITTED, conditions=None, ms=3.0,
                     drawn=Open.of(FITTED, "worst"))
        near[name] = [words for words, _ in loop.around(design, 0.15, set())]
    kept = [words for words in near["free"] if peaks(words)[-1] <= 1.6]
    assert near["held"] == kept
    assert 0 < len(kept) < len(near["free"])


def test_the_document_holds_the_promise_and_a_strange_one_is_refused(design):
    document = to_document(design)
    assert document["robust"] == {"way": "worst", "limits": {"ms": 1.6}}
    assert from_document(document).promise == design.promise
    assert from_document(document | {"robust": None}).promise is None
    for strange in ({"way": "best", "limits": {"ms": 1.6}}, {"way": "p95", "limits": {"gain": 1.0}}, {"way": "p95"}, 3,
                    {"way": "worst", "limits": {}}, {"way": "worst", "limits": {"ms": 0.0}}, {"way": "p95", "limits": {"mt": -1.0}}):
        with pytest.raises(DocumentError, match="robust"):
            from_document(document | {"robust": strange})
