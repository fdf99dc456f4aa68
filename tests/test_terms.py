"""What heatertune's symbols and words mean: found by any of their names, at the terminal and in the glossary of a page."""

import json

import pytest

from heatertune.cli import main
from heatertune.errors import InputError
from heatertune.report.page import glossary
from heatertune.units import TERMS, terms_in, the_term


def test_every_term_has_a_place_of_its_own_and_a_meaning():
    assert len({term.anchor for term in TERMS}) == len(TERMS)
    assert all(term.meaning and term.anchor for term in TERMS)


@pytest.mark.parametrize(("asked", "field"), [
    ("TA", "sample_time_s"), ("Ta", "ambient_degC"), ("ta", "sample_time_s"), ("TN", "integral_time_s"), ("MS", "ms"),
    ("K", "gain_pct_per_degC"), ("k", "gain_degC_per_pct"), ("dead time", "dead_time_s")])
def test_capitals_tell_terms_apart_where_they_have_to(asked, field):
    assert the_term(asked).field == field


def test_an_unknown_term_names_the_one_it_is_near_to():
    with pytest.raises(InputError, match="unknown term 'holdbak': did you mean holdback"):
        the_term("holdbak")


def test_the_terms_of_a_text_are_whole_words_or_their_plural():
    assert [term.names[0] for term in terms_in("Ms and TA of all plausible heaters; a table")] == ["Ms", "plausible heater", "TA"]


def test_the_glossary_of_a_page_reads_its_text_alone():
    page = '<style>.TN{}</style><svg><text>Ku</text></svg><p title="TV">Ms ≤ 1.6 &amp; <b>TA</b></p>'
    assert glossary(page) == (
        '<h2>Terms</h2><dl class="terms"><dt>Ms, maximum sensitivity</dt><dd>largest amplification of a disturbance at any '
        'frequency; a small value means a robust, calm loop</dd><dt>TA, sampling interval</dt><dd>time from one call of the '
        'controller to the next</dd></dl>')
    assert glossary("<p></p>") == ""


def test_the_command_tells_what_is_asked_for_in_lines_of_80_columns(capsys):
    assert main(["terms", "TN", "ms"]) == 0
    told = capsys.readouterr().out
    assert told.splitlines()[0].startswith("TN                  integral-action time [s]: ")
    assert main(["terms"]) == 0
    assert max(map(len, capsys.readouterr().out.splitlines())) <= 80
    assert main(["terms", "PWM period", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["terms"][0]["names"] == ["PWM period"]
    assert main(["terms", "TX"]) == 2


def test_long_answers_say_where_their_terms_are_told_beside_the_result(capsys):
    given = ["tune", "--gain", "0.37", "--time-constant", "167", "--dead-time", "12", "--method", "simc"]
    for options, told in ((["--verbose"], True), (["--verbose", "--quiet"], False), ([], False)):
        assert main([*given, *options]) == 0
        shown = capsys.readouterr()
        assert ("heatertune terms TA TN Ms" in shown.err) == told
        assert "heatertune terms" not in shown.out
