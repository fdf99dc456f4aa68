"""A cooler on every controller: words, proof and export beside its mirror image, a heater; and a cooler's log."""

from dataclasses import replace

import numpy as np
import pytest
from tests.bench.identification import answer

from heatertune.chain.stages import export, fit
from heatertune.errors import InputError, NotRepresentable
from heatertune.log.log_values import Log
from heatertune.model.model_values import Fopdt, model_by_hand
from heatertune.model.reduction import mirror_heater
from heatertune.model.validate import validate
from heatertune.plc import Scaling
from heatertune.plc.design import encode, tune
from heatertune.plc.pwm import Actuator
from heatertune.plc.word_selection import choose_words
from heatertune.proof import TestSequence
from heatertune.proof.prove_words import prove
from heatertune.proof.redesign import DesignRequest, find_passing_design
from heatertune.proof.report_curves import simulate_wish
from heatertune.proof.scenario import TemperatureStep, scenario_for
from heatertune.proof.specification import Specification
from heatertune.settings import Conditions, TuneSettings

HEATER = Fopdt(gain_degC_per_pct=0.4, time_constant_s=160.0, dead_time_s=12.0, ambient_degC=20.0)
MIDDLE = 40.0  # of the sensor's range: in this mirror a whole number of units is one again
COOLER = replace(HEATER, gain_degC_per_pct=-0.4, ambient_degC=2.0 * MIDDLE - 20.0)
RANGE = Scaling(low_degC=MIDDLE - 60.0, high_degC=MIDDLE + 60.0)
TARGETS = ["s5-ob251", "s7-200", "s7-200-pid", "s7-300", "fb41", "weg", "pid-compact", "iec-pid"]
#: of each way to write the action one: whole numbers, a word of its own, single precision, a bit. The others of the way are samples
WAYS = [target if target in ("s5-ob251", "weg", "fb41", "pid-compact") else pytest.param(target, marks=pytest.mark.sample)
        for target in TARGETS]
#: the word that turns the action round
SIGNS = {"s5-ob251": "K", "s7-200": "KP", "s7-200-pid": "KC", "s7-300": "GAIN", "fb41": "GAIN", "iec-pid": "KP"}


def _made(model, target, **asked):
    fitted = model_by_hand(model)
    design = tune(fitted, target=target, scaling=RANGE, **asked)
    return choose_words(design, target, fitted, scaling=RANGE).words


def _of_one_step(proof):
    """An input module cuts towards zero: at most a step of it is between a reading and its mirror image, all the time."""
    return proof.nominal.resolution_degC * proof.scenario.duration_s


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.long
def test_the_words_of_a_cooler_are_those_of_its_mirror_image_turned_round(target):
    heating, cooling = (dict(_made(model, target, sample_time_s=4.0).values) for model in (HEATER, COOLER))
    if target == "weg":
        assert cooling == heating | {"Action": 1}  # the manual: 0 direct, 1 reverse
    elif target == "pid-compact":
        assert cooling == heating | {"InvertControl": 1}  # Gain is not negative
    else:
        turned = {name for name, value in heating.items() if cooling[name] == -value != 0}
        assert SIGNS[target] in turned
        assert {name: cooling[name] for name in heating if name not in turned} == {
            name: heating[name] for name in heating if name not in turned}


@pytest.mark.long
@pytest.mark.parametrize("target", TARGETS)
def test_a_cooler_passes_with_its_own_words_and_is_exported_and_fails_with_a_heaters(target):
    asked = DesignRequest(target=target, scaling=RANGE, tune_settings=TuneSettings(method="lambda", sample_time_s=4.0),
                  conditions=Conditions(setpoint_degC=MIDDLE, switches={"sampling": "caller"} if target == "weg" else {}))
    heating, cooling = (find_passing_design(model_by_hand(model), asked).proof for model in (HEATER, COOLER))
    assert heating.verdict == cooling.verdict == "PASS"
    assert export(cooling.words, cooling)
    # the mirror is true but for the sensor's rounding, which is not symmetrical everywhere
    for one, other in zip(heating.criteria, cooling.criteria, strict=True):
        if one.name in ("overshoot", "settling_time", "ms"):
            assert other.value == pytest.approx(one.value, rel=0.05, abs=0.5)
        if one.name == "iae":
            assert other.value == pytest.approx(one.value, abs=_of_one_step(heating))
    assert prove(heating.words, model_by_hand(COOLER), setpoint_degC=MIDDLE).verdict == "FAIL"


#: a long dead time: an optimum at Ms 2 overshoots, and other gains, an output limit or a ramp mend that
HASTY = Fopdt(gain_degC_per_pct=0.9, time_constant_s=120.0, dead_time_s=18.0, ambient_degC=28.0)


@pytest.mark.long
@pytest.mark.parametrize("target", WAYS)
def test_a_cooler_is_closed_as_its_mirror_image_and_at_the_same_price(target, monkeypatch):
    story = TestSequence(opens=False, changes=False, mains=False, restarts=False)
    monkeypatch.setattr(Specification, "story_at", lambda *_: story)
    asked = DesignRequest(target=target, scaling=RANGE, tune_settings=TuneSettings(ms=2.0), conditions=Conditions(setpoint_degC=MIDDLE))
    cooler = replace(HASTY, gain_degC_per_pct=-0.9, ambient_degC=2.0 * MIDDLE - 28.0)
    heating, cooling = (find_passing_design(model_by_hand(model), asked) for model in (HASTY, cooler))
    assert heating.proof.verdict == cooling.proof.verdict == "PASS"
    assert heating.notes
    assert heating.proof.diagnostics.remarks[-1] == cooling.proof.diagnostics.remarks[-1]  # what was changed
    assert cooling.ideal.gain_pct_per_degC == pytest.approx(-heating.ideal.gain_pct_per_degC)
    assert cooling.ideal.integral_time_s == pytest.approx(heating.ideal.integral_time_s)
    iae = [next(one.value for one in each.proof.criteria if one.name == "iae") for each in (heating, cooling)]
    assert iae[1] == pytest.approx(iae[0], abs=_of_one_step(heating.proof))
    if target == "s5-ob251":  # 2047 units, symmetrical about the middle
        assert heating.notes == cooling.notes
        assert iae[1] == pytest.approx(iae[0], rel=1e-6)


def test_a_range_of_a_cooler_is_proven_at_its_coldest_setpoint_as_a_heaters_at_its_hottest():
    courses = []
    for model, ends in ((HEATER, (30.0, 45.0)), (COOLER, (2.0 * MIDDLE - 45.0, 2.0 * MIDDLE - 30.0))):
        words = encode(tune(model_by_hand(model), target="iec-pid", scaling=RANGE, sample_time_s=4.0), "iec-pid", scaling=RANGE)
        courses.append(prove(words, model_by_hand(model), setpoint_degC=ends))
    heats, cools = (proof.scenario.setpoints_degC for proof in courses)
    assert (max(heats), min(heats)) == (45.0, 30.0)
    assert cools == pytest.approx([2.0 * MIDDLE - each for each in heats])
    assert not any("setpoint" in each for proof in courses for each in proof.diagnostics.not_tested)


def test_without_words_a_coolers_run_is_the_mirror_image_of_a_heaters():
    design = tune(model_by_hand(HEATER), sample_time_s=4.0)
    scenarios = [scenario_for([model], setpoint_degC=MIDDLE) for model in (HEATER, COOLER)]
    assert [scenario.disturbances[0] for scenario in scenarios] == [
        TemperatureStep(time_s=1620.0, temperature_degC=-6.0), TemperatureStep(time_s=1620.0, temperature_degC=6.0)]
    heats, cools = (
        simulate_wish(replace(design, gain_pct_per_degC=sign * design.gain_pct_per_degC), model, scenario,
                      Actuator(pwm_period_s=4.0))
        for sign, model, scenario in zip((1.0, -1.0), (HEATER, COOLER), scenarios, strict=True))
    assert cools.temperature_degC == pytest.approx(2.0 * MIDDLE - heats.temperature_degC, abs=1e-9)
    assert cools.power_asked_pct == pytest.approx(heats.power_asked_pct, abs=1e-9)


@pytest.mark.long
def test_s5_proves_a_cooler_to_the_last_digit_as_its_mirror_image():
    # 2047 units, symmetrical about the middle, and a controller that computes alike in both directions
    heating, cooling = (prove(_made(model, "s5-ob251", sample_time_s=4.0), model_by_hand(model), setpoint_degC=MIDDLE)
                        for model in (HEATER, COOLER))
    for one, other in zip(heating.criteria, cooling.criteria, strict=True):
        assert other.value == pytest.approx(one.value, rel=1e-6, abs=1e-6), one.name


def test_two_level_control_refuses_a_cooler():
    design = tune(model_by_hand(COOLER), sample_time_s=4.0)
    with pytest.raises(NotRepresentable, match="on-off switches on below the setpoint"):
        encode(design, "on-off", scaling=RANGE)


def test_an_interlock_is_refused_for_a_cooler():
    words = _made(COOLER, "s7-300", sample_time_s=4.0)
    with pytest.raises(InputError, match="for a cooler leave --interlock out"):
        prove(words, model_by_hand(COOLER), setpoint_degC=MIDDLE, interlock="heater-fan")


# --- a log ------------------------------------------------------------------------------------------------------------

TIME = np.arange(0.0, 2400.0, 4.0)
POWER = np.select([TIME < 200, TIME < 1000, TIME < 1700], [0.0, 60.0, 20.0], 80.0)


def _log(model):
    readings = answer(model, TIME, POWER, model.ambient_degC)
    noise = np.random.default_rng(3).normal(0.0, 0.05, len(TIME))
    return Log(name="made", source="", time_s=TIME, temperature_degC=readings + noise * np.sign(model.gain_degC_per_pct),
               power_pct=POWER)


@pytest.mark.long
def test_a_coolers_log_gives_the_mirror_image_of_what_the_heaters_gives():
    cooler, heater = fit(_log(COOLER), cooler=True), fit(_log(HEATER))
    turned = mirror_heater(cooler, MIDDLE)
    assert turned.model.gain_degC_per_pct == pytest.approx(heater.model.gain_degC_per_pct, rel=1e-6)
    assert cooler.model.gain_degC_per_pct == pytest.approx(-0.4, rel=0.01)
    assert cooler.model.ambient_degC == pytest.approx(60.0, abs=0.1)
    assert turned.ci95["time_constant_s"].low == pytest.approx(heater.ci95["time_constant_s"].low, rel=1e-4)
    assert "of a cooler" in cooler.notes[0]
    held = validate(cooler, _log(COOLER))
    assert not held.fails
    assert held.runs[0].ambient_degC == pytest.approx(60.0, abs=0.1)


def test_a_cooler_has_to_be_told_and_its_power_logged():
    with pytest.raises(InputError, match="for a cooler say --cooler"):
        fit(_log(COOLER))
    with pytest.raises(InputError, match="no law is known by which a controller cools"):
        fit(replace(_log(COOLER), power_pct=None), cooler=True)
