"""What a user specifies: units, several limits at once, presets, files, and what is refused."""

import math
import os
import tomllib
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from heatertune.errors import DocumentError, HeatertuneError, InputError, OutOfRange, UnknownName
from heatertune.proof.criteria import LIMITS, LoopLimits
from heatertune.proof.prove_words import aim_sentences, tune_settings_for
from heatertune.proof.spec_file import in_force, read_spec, spec_text, specification_of
from heatertune.proof.specification import PRESETS, limits_from, preset
from heatertune.proof.test_sequence import TestSequence
from heatertune.settings import Conditions, TuneSettings

pytestmark = pytest.mark.fast


def test_what_nobody_specified_is_the_limits_defaults():
    # that of small changes is of the specification alone: proofs of earlier versions had none, and are still read
    assert in_force().limits_for(300.0) == LoopLimits(small_change_overshoot_pct=65.0)


@pytest.mark.parametrize(("text", "field", "value"), [
    ("overshoot=5%", "overshoot_pct", 5.0),
    ("overshoot=3degC", "overshoot_degC", 3.0),
    ("overshoot = 3 °C", "overshoot_degC", 3.0),
    ("overshoot=3K", "overshoot_degC", 3.0),
    ("settling=20min", "settling_s", 1200.0),
    ("settling=0.5 h", "settling_s", 1800.0),
    ("settling=4 T+L", "settling_s", 1000.0),  # of a heater of 250 s
    ("recovery=90", None, None),
    ("recovery=90 s", "recovery_s", 90.0),
    ("load-deviation=2degC", "deviation_degC", 2.0),
    ("switchings=30/h", "switchings_per_h", 30.0),
    ("ms=1.7", "ms", 1.7),
    ("ms=none", "ms", None),
    ("gain-margin=2", "gain_margin", 2.0),
    ("phase-margin=45°", "phase_margin_deg", 45.0),
    ("iae=4e3 degC*s", "iae_degC_s", 4000.0),
    ("tolerance=0.2 degC", "tolerance_degC", 0.2),
])
def test_a_limit_is_read_in_its_unit(text, field, value):
    if field is None:
        with pytest.raises(InputError, match="with no unit; expected a number with its unit"):
            in_force(None, [text])
        return
    assert getattr(in_force(None, [text]).limits_for(250.0), field) == value


def test_several_limits_of_one_name_hold_together_and_the_tightest_of_one_unit_counts():
    limits = in_force("oven", ["overshoot=5%", "overshoot=3degC", "overshoot=4 degC", "gain-margin=2", "gain-margin=3"])
    kept = limits.limits_for(1.0)
    assert (kept.overshoot_pct, kept.overshoot_degC, kept.gain_margin) == (5.0, 3.0, 3.0)
    assert limits.changed == ("overshoot", "gain-margin")


def test_a_limit_of_ones_own_takes_the_place_of_the_presets_whole():
    assert preset("oven").limits_for(1.0).overshoot_degC == 2.0
    kept = in_force("oven", ["overshoot=5%"]).limits_for(1.0)
    assert (kept.overshoot_pct, kept.overshoot_degC) == (5.0, None)


@pytest.mark.parametrize(("text", "kind", "says"), [
    ("overshoot", InputError, "has no value; expected NAME=VALUE"),
    ("overshot=5%", UnknownName, "overshoot"),
    ("overshoot=five", InputError, "expected a number with its unit"),
    ("overshoot=5 bananas", InputError, "unit 'bananas'"),
    ("overshoot=-5%", OutOfRange, ">= 0"),
    ("overshoot=1e999%", OutOfRange, "finite"),
    ("tolerance=none", InputError, "expected a value"),
    ("ms=none and 1.7", InputError, "stands alone"),
])
def test_what_is_no_limit_is_refused_with_what_would_be_right(text, kind, says):
    with pytest.raises(kind, match=says):
        in_force(None, [text])


@pytest.mark.parametrize("name", PRESETS)
def test_a_specification_written_and_read_again_says_the_same(name, tmp_path):
    spec = in_force(name, ["settling=20min", "overshoot=5% and 3 degC", "ms=none"])
    file = tmp_path / "spec.toml"
    file.write_text(spec_text(spec), encoding="utf-8")
    assert in_force(str(file)).limits_for(100.0) == spec.limits_for(100.0)
    assert in_force(str(file)).story_at(40.0) == spec.story_at(40.0)
    assert set(tomllib.loads(spec_text(spec))) == {"preset", "limits", "story"}


def test_a_preset_of_a_file_keeps_its_other_limits(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text('preset = "bath"\n[limits]\novershoot = ["1 degC", "4 %"]\nms = 1.5\n')
    spec = read_spec(file)
    kept = spec.limits_for(1.0)
    assert (spec.name, kept.tolerance_degC, kept.overshoot_degC, kept.overshoot_pct, kept.ms) == (
        "mine.toml", 0.1, 1.0, 4.0, 1.5)


@pytest.mark.parametrize(("text", "says"), [
    ("limits = 3", "limits: expected a table"),
    ("preset = 3", "preset: expected a text"),
    ('preset = "oben"', "preset: unknown specification 'oben'"),
    ("[limit]", "limit: no such table"),
    ("[limits]\novershot = 1", "limits.overshot: unknown limit"),
    ("[limits]\novershoot = true", "limits.overshoot: expected a text"),
    ("[limits]\novershoot = []", "limits.overshoot: expected a text"),
    ('[limits]\novershoot = "5"', "limits.overshoot: limit overshoot is '5', with no unit"),
    ("[limits\n", "no TOML"),
    ("story = 3", "story: expected a table"),
    ("[story]\nfalls = true", "story.falls: unknown part of the test sequence 'falls'"),
    ("[story]\ntemperature-step = true", "story.temperature-step: story temperature-step is 'on'; expected a number with its unit %"),
    ('[story]\nmains = "10 %"', "story.mains: story mains is '10 %'; expected on or off"),
    ("[story]\nrestart = 3", "story.restart: expected true, false or a text"),
    ('[story]\nload = "-3 %"', "story.load: load_pct"),
])
def test_a_damaged_file_is_refused_by_file_table_and_key(text, says, tmp_path):
    file = tmp_path / "spec.toml"
    file.write_text(text)
    with pytest.raises(DocumentError) as refused:
        read_spec(file)
    assert str(file) in str(refused.value)
    assert says in str(refused.value)


def test_a_story_of_ones_own_is_what_words_live_through(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text('[story]\ntemperature-step = "50 %"\nload = "off"\nopen-circuit = false\n')
    story = read_spec(file).story_at(30.0)
    assert (story.step_share, story.load_pct, story.opens, story.mains, story.setpoint_low_degC) == (
        0.5, 0.0, False, True, 30.0)
    assert in_force().story_at(None) == TestSequence()
    assert in_force("paper").story_at(None).paper_times


def test_a_limit_by_its_own_option_is_any_number_and_an_infinite_one_asks_for_nothing():
    conditions = Conditions(tolerance_degC=np.float64(0.5), step_power_pct=math.inf)
    kept = specification_of(conditions).limits_for(1.0)
    assert (kept.tolerance_degC, kept.step_power_pct) == (0.5, None)
    assert specification_of(Conditions(tolerance_degC=1e-5)).tolerance_degC == 1e-5


def test_a_design_aims_at_what_the_user_specified_and_says_where_that_is_less_than_was_asked():
    asked = TuneSettings(ms=2.5)
    general = tune_settings_for(asked, Conditions())  # the proof judges by these limits in any case
    assert (general.ms, general.step_power_pct) == (2.0, 10.0)
    tuned = tune_settings_for(asked, Conditions(limit=("ms=1.7",)))
    assert tuned.ms == 1.7
    assert aim_sentences(asked, tuned) == ("Ms <= 1.7 instead of 2.5, as the specification requires.",)
    assert aim_sentences(asked, asked) == ()


def test_a_pipe_that_nobody_writes_to_is_refused_at_once(tmp_path):
    os.mkfifo(tmp_path / "spec.toml")
    with pytest.raises(DocumentError, match="a pipe without a writer"):
        in_force(str(tmp_path / "spec.toml"))


def test_a_value_over_two_lines_is_written_as_one(tmp_path):
    spec = in_force(None, ["overshoot=5\n %"])
    file = tmp_path / "two\nlines.toml"
    file.write_text(spec_text(spec), encoding="utf-8")
    again = in_force(str(file))
    assert tomllib.loads(spec_text(again))["limits"]["overshoot"] == "5 %"


def test_a_file_that_is_not_there_and_a_preset_that_is_none():
    with pytest.raises(DocumentError, match="cannot be read"):
        in_force("nowhere.toml")
    with pytest.raises(UnknownName, match="furnace"):
        in_force("furnice")


@pytest.mark.long
@given(st.lists(st.text(max_size=30), max_size=4))
def test_any_text_is_a_limit_or_refused(texts):
    with suppress(HeatertuneError):
        limits_from(texts)
        in_force(None, texts)


def test_every_limit_has_an_example_that_can_be_read():
    for name, kind in LIMITS.items():
        in_force(None, [f"{name}={kind.example}"])
