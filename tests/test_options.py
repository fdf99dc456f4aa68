"""What is declared once says the same everywhere: in Python, on the command line, in a study, in a proof."""

import argparse
import math
from dataclasses import fields

import numpy as np
import pytest

import heatertune as ht
from heatertune import options
from heatertune.batch.studies import KEYS
from heatertune.cli import parser
from heatertune.errors import InputError, OutOfRange, UnknownName
from heatertune.pid.search.robust import ROBUST
from heatertune.pid.specs import OBJECTIVES
from heatertune.plc.pwm import RULES
from heatertune.plc.word_selection import WAYS
from heatertune.proof import SampleSpread
from heatertune.settings import (
    Conditions,
    FitSettings,
    ReadSettings,
    SampleSettings,
    SensorSettings,
    TuneSettings,
    ValidateSettings,
    WordSettings,
)
from heatertune.units import LARGEST

KINDS = (
    ReadSettings, FitSettings, TuneSettings, Conditions, WordSettings, SensorSettings, SampleSettings, ValidateSettings)
NUMBERS = [(kind, name) for kind in KINDS for name, one in options.options_of(kind).items() if one.kind in (float, int)]
#: what no heater, no switch and no controller has; 0, 1 and 100 are ordinary somewhere
WILD = (math.nan, -math.inf, 1e308, -1e308, 10**400, "12", [1.0])


@pytest.fixture(scope="module")
def model():
    heater = ht.Fopdt(gain_degC_per_pct=0.8, time_constant_s=120.0, dead_time_s=8.0, ambient_degC=21.0)
    return ht.model_by_hand(heater)


@pytest.fixture(scope="module")
def words(model):
    return ht.encode(ht.tune(model), target="s7-300")


@pytest.mark.parametrize(("kind", "name"), NUMBERS)
@pytest.mark.parametrize("value", WILD, ids=str)
def test_a_number_that_is_none_or_beyond_all_heaters_is_refused_by_name_and_range_in_one_line(kind, name, value):
    with pytest.raises(OutOfRange) as refused:
        kind(**{name: value})
    assert refused.value.field == name
    assert str(refused.value).count("\n") == 0
    assert len(str(refused.value)) < 500


@pytest.mark.parametrize(("kind", "name"), NUMBERS)
def test_the_smallest_number_of_all_is_taken_or_refused(kind, name):
    # 5e-324 is above 0, and its square and its inverse are no numbers: it is taken only where 0 itself has a meaning
    try:
        kind(**{name: 0.0})
    except InputError:
        with pytest.raises(InputError):
            kind(**{name: 5e-324})


@pytest.mark.parametrize("sixty", [60, np.float32(60.0), np.float64(60.0), np.int64(60)], ids=lambda one: type(one).__name__)
def test_a_whole_number_or_one_of_numpy_is_the_same_number_for_all_that_follow(sixty, model, words):
    assert {type(Conditions(setpoint_degC=sixty).setpoint_degC), type(Conditions(noise_degC=sixty).noise_degC)} == {float}
    assert list(map(type, Conditions(setpoint_degC=(sixty - 20, sixty)).setpoint_degC)) == [float, float]
    assert type(SampleSettings(samples=np.int64(60)).samples) is int
    proofs = [ht.prove(words, model, setpoint_degC=setpoint) for setpoint in (sixty, 60.0)]
    assert proofs[0].to_document() == proofs[1].to_document()


@pytest.mark.parametrize(("value", "rule"), [("nan", "a finite number"), ("-1", ">= 0"), ("1e308", f"within ±{LARGEST:g}")])
def test_the_command_line_names_the_option_and_its_range(value, rule):
    given = parser().parse_args(["verify", "pid.json", "--target", "weg", f"--noise={value}"])
    with pytest.raises(OutOfRange, match="--noise") as refused:
        options.of(Conditions, given)
    assert refused.value.rule == rule


def test_an_option_without_the_one_it_belongs_to_is_refused_in_the_words_of_each_side():
    with pytest.raises(InputError, match="limit_degC and fan_stops_s need interlock"):
        Conditions(fan_stops_s=900.0)
    given = parser().parse_args(["verify", "pid.json", "--target", "weg", "--fan-stops", "900"])
    with pytest.raises(InputError, match="--limit-temperature and --fan-stops need --interlock"):
        options.of(Conditions, given)
    with pytest.raises(InputError, match="minimum_on_s, minimum_off_s, pwm_rule and pwm_resolution_s need pwm_period_s"):
        Conditions(minimum_on_s=1.0)
    assert Conditions(minimum_on_s=0.0) == Conditions()


@pytest.mark.parametrize("kind", KINDS)
def test_nothing_said_on_the_command_line_is_nothing_said_in_python(kind):
    command = argparse.ArgumentParser()
    options.add(command, kind)
    assert options.of(kind, command.parse_args([])) == kind()
    assert options.of(kind, argparse.Namespace()) == kind(), "a command without these flags says nothing"


def test_every_flag_of_a_design_is_one_field_and_reaches_it():
    told = ["--setpoint=50", "--pwm-period=8", "--minimum-on=0.5", "--pwm-rule=pulsegen", "--accept=a", "--accept=b",
            "--assume=rounding=floor", "--ambient", "19", "21", "--until=30", "--sample-time=words", "--ms=1.4"]
    given = parser().parse_args(["design", "table4", "--target", "weg", "--out", "o", *told])
    assert options.of(Conditions, given) == Conditions(
        setpoint_degC=50.0, pwm_period_s=8.0, minimum_on_s=0.5, pwm_rule="pulsegen", accept=("a", "b"),
        switches={"rounding": "floor"})
    assert options.of(FitSettings, given) == FitSettings(ambient_degC=(19.0, 21.0), until_s=30.0)
    assert options.of(TuneSettings, given) == TuneSettings(ms=1.4)
    with pytest.raises(InputError, match="--ambient has 3 values; expected one, or LOW HIGH"):
        options.of(FitSettings, parser().parse_args(["fit", "table4", "--ambient", "1", "2", "3"]))


def test_what_may_be_chosen_is_what_there_is():
    choices = {name: one.choices for kind in KINDS for name, one in options.options_of(kind).items()}
    assert choices["objective"] == tuple(OBJECTIVES)
    assert choices["robust"] == tuple(ROBUST)
    assert choices["pwm_rule"] == tuple(RULES)
    assert choices["words_by"] == WAYS
    with pytest.raises(UnknownName, match="unknown structure 'ip'; known: p, pi, pid"):
        TuneSettings(structure="ip")


@pytest.mark.parametrize(("asked", "ramp"), [((), None), (("auto",), "auto"), (("none",), "none"), (("2.5",), 2.5)])
def test_a_number_may_have_texts_in_its_place(asked, ramp):
    given = parser().parse_args(["verify", "pid.json", "--target", "weg", *(f"--setpoint-ramp={text}" for text in asked)])
    assert options.of(WordSettings, given) == WordSettings(setpoint_ramp=ramp)


@pytest.mark.parametrize("pair", [(0.0,), (0.0, 1.0, 2.0), 100.0, "01", (0.0, math.nan)])
def test_a_pair_is_two_numbers(pair):
    with pytest.raises(OutOfRange, match="range_degC"):
        SensorSettings(range_degC=pair)
    given = parser().parse_args(["verify", "pid.json", "--target", "weg", "--range", "0", "850"])
    assert options.of(SensorSettings, given) == SensorSettings(range_degC=(0.0, 850.0))


def test_what_samples_are_drawn_from_is_the_proofs_own_where_nothing_is_said():
    assert SampleSpread(**SampleSettings().spread) == SampleSpread()


def test_every_number_and_name_of_fit_design_and_proof_is_a_key_of_a_study():
    for kind in (FitSettings, TuneSettings, Conditions):
        # a cooler's log, which is a yes or no, is fitted beforehand and comes as a model
        assert {one.name for one in fields(kind)} - set(KEYS) <= {"accept", "cooler", "limit"}
    assert KEYS["tolerance_degC"].quantity_with_unit == "tolerance around the setpoint [°C]"


def test_some_of_the_settings_can_be_changed_by_name_and_no_others():
    assert options.merge_options(TuneSettings, TuneSettings(ms=1.4), {"method": "simc"}) == TuneSettings(ms=1.4, method="simc")
    assert options.merge_options(TuneSettings, None, {}) == TuneSettings()
    with pytest.raises(TypeError, match="setpoint"):
        options.merge_options(TuneSettings, None, {"setpoint": 1.0})
