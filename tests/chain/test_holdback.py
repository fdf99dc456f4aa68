"""The holdback of the setpoint ramp: what a controller winds up by while the heater's circuit is open."""

import json
import re
from dataclasses import replace
from types import SimpleNamespace

import pytest

from heatertune.chain.stages import export
from heatertune.model.model_values import Fopdt, model_by_hand
from heatertune.model.reduction import mirror_heater as mirrored_fit
from heatertune.plc import Ramp, controller_for
from heatertune.plc.design import encode, tune
from heatertune.proof import Mains, TestSequence, prove
from heatertune.proof.redesign import DesignRequest, find_passing_design
from heatertune.proof.redesign.design_changes import DesignChange, design_changes
from heatertune.proof.setpoint_ramp import prove_ramped, slow_ramps
from heatertune.proof.specification import Specification
from heatertune.proof.words_file import read_words
from heatertune.settings import Conditions, TuneSettings

HEATER = model_by_hand(Fopdt(gain_degC_per_pct=0.5, time_constant_s=150.0, dead_time_s=15.0, ambient_degC=22.0))
#: WEG's block adds up on and on where it has no anti-windup, which its manual leaves open
WINDING = {"anti_windup": "none", "manual": "limited", "manual_return": "held", "filter": "implicit"}
#: so a night with an open circuit is too long for it, with a holdback or without
PROVING = Conditions(setpoint_degC=46.0, switches=WINDING, accept=("winds-up",))


@pytest.fixture(autouse=True, scope="module")
def heat_up_jump_and_an_open_circuit():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Specification, "story_at", lambda *_: TestSequence(load_pct=0.0, changes=False, mains=False, restarts=False))
        yield


@pytest.fixture(scope="module")
def words():
    return encode(tune(HEATER, target="weg", sample_time_s=6.0), "weg")


@pytest.fixture(scope="module")
def found(words, heat_up_jump_and_an_open_circuit):
    return prove_ramped(words, HEATER, "auto", PROVING)


def _of(proof, name):
    return next(criterion for criterion in proof.criteria if criterion.name == name)


def _broken(proof):
    return {criterion.name for criterion in proof.criteria if not criterion.ok}


def test_a_windup_under_an_open_circuit_is_mended_by_a_holdback_only(words, found):
    plain = prove(words, HEATER, PROVING)
    assert "reheat_overshoot" in _broken(plain)
    proof, notes = found
    assert proof.verdict == prove(proof.words, HEATER, PROVING).verdict == "PASS"
    assert replace(proof.words, ramp=None) == words
    # the same ramp without it, and the slowest that the search would take, leave what happens at the setpoint as it is
    free = replace(words, ramp=replace(proof.words.ramp, hold=None))
    for ramp in (free.ramp, controller_for("weg").ramp(words, 1.0)):
        assert "reheat_overshoot" in _broken(prove(replace(words, ramp=ramp), HEATER, PROVING))
    told = f"after an open circuit from {_of(plain, 'reheat_overshoot').value:.4g} to {_of(proof, 'reheat_overshoot').value:.4g} %"
    assert told in notes[0]
    assert f"which follows the reading within {proof.hold_degC:.3g} °C" in notes[0]


def test_the_frames_of_a_design_end_with_the_ramp_where_an_open_circuit_is_what_fails(words):
    plain = prove(words, HEATER, replace(PROVING, limit=("overshoot=90%", "reheat-overshoot=15%")))
    assert _broken(plain) == {"reheat_overshoot"}
    tried = list(design_changes(plain, HEATER.plants, TuneSettings(), period_given=True, interval_given=True, ramp_open=True,
                        boost_open=True, least_interval_s=1.0))
    assert tried[0] == DesignChange(has_boost=True)  # which costs less than all else
    assert tried[-3].ramp == "fastest"
    assert tried[-2] == DesignChange()  # gains, which cost more than the 30 % that another change may: they come after it
    assert tried[-1] == tried[0]  # a boost once more, with what has helped by then


def test_a_holdback_is_carried_by_documents_certificate_and_words(words, found, tmp_path):
    proof, _ = found
    document = proof.to_document()["setpoint_ramp"]
    assert (document["hold"], document["hold_degC"]) == (proof.words.ramp.hold, pytest.approx(proof.words.ramp.hold))
    for content in export(proof.words, proof).values():
        assert f"held within {proof.words.ramp.hold:.9g} degC of the reading" in content
        assert "HeaterRampEnd" in content
    path = tmp_path / "words.json"
    whole = {"target": "weg", "words": dict(words.values), "sample_time_s": words.sample_time_s,
             "scaling": {"low_degC": 0.0, "high_degC": 100.0}, "setpoint_ramp": document}
    path.write_text(json.dumps({"schema": "heatertune/words/2", **whole}))
    assert read_words(path, "weg").ramp == proof.words.ramp


def test_a_design_is_led_rather_than_made_many_times_dearer():
    asked = DesignRequest(target="weg", conditions=PROVING, tune_settings=TuneSettings(sample_time_s=6.0), boost="none")
    design = find_passing_design(HEATER, asked)
    assert design.proof.verdict == prove(design.proof.words, HEATER, PROVING).verdict == "PASS"
    assert design.proof.hold_degC is not None
    assert "and a holdback of" in design.proof.diagnostics.remarks[-1]
    assert "winds-up" in [finding.name for finding in design.proof.diagnostics.findings]
    # without a ramp no gains at all pass: whatever they are, a sum without a limit winds up in a night
    plain = find_passing_design(HEATER, replace(asked, setpoint_ramp="none"))
    assert plain.proof.verdict == "FAIL"
    assert "reheat_overshoot" in [each.name for each in plain.proof.criteria if not each.ok]


@pytest.mark.parametrize(("limit", "unit"), [("40%", "% of rise"), ("9.6degC", "°C")])
def test_a_holdback_winds_up_the_more_the_longer_the_circuit_is_open(found, limit, unit):
    # the setpoint is held as far from the reading as ever, and WEG's sum grows with the time: nothing ends it
    asked = replace(PROVING, limit=(f"reheat-overshoot={limit}",), accept=())
    proof = prove(found[0].words, HEATER, asked)
    (finding,) = [each for each in proof.diagnostics.findings if each.name == "winds-up"]
    assert proof.verdict == "NOT PROVEN"
    hours, beyond = re.search(rf"After ([\d.]+) h with an open circuit it overshoots by ([\d.]+) {unit};", finding.message).groups()
    *_, opened, closed_again = (each.time_s for each in proof.scenario.disturbances if isinstance(each, Mains))
    assert float(hours) == pytest.approx(4.0 * (closed_again - opened) / 3600.0, rel=0.05)
    assert float(beyond) > float(limit.rstrip("%degC"))


def test_a_rate_of_ones_own_has_no_holdback(words):
    proof, _ = prove_ramped(words, HEATER, 3.0, PROVING)
    assert proof.words.ramp == Ramp(step=proof.words.ramp.step)
    assert (proof.hold_degC, proof.to_document()["setpoint_ramp"]["hold"]) == (None, None)


def test_a_cooler_is_held_as_the_heater_that_is_its_mirror_image(words, found):
    heating = found[0]
    mirrored = mirrored_fit(HEATER, 50.0)  # the middle of the sensor's range
    cooling = replace(words, values={**words.values, "Action": 1})
    proof, notes = prove_ramped(cooling, mirrored, "auto", replace(PROVING, setpoint_degC=54.0))
    assert proof.verdict == heating.verdict == "PASS"
    assert proof.words.ramp.hold == -heating.words.ramp.hold
    # the sensor cuts towards zero, so that the mirror is true but for a count, and the search ends within 3 %
    assert proof.words.ramp.step == pytest.approx(heating.words.ramp.step, rel=0.05)
    assert _of(proof, "iae").value == pytest.approx(_of(heating, "iae").value, rel=0.02)
    assert "which follows the reading within" in notes[0]


def test_slow_ramps_take_an_eighth_to_a_half_of_the_longest_way_and_wait_within_four_or_two_bands(words):
    proof = prove(words, HEATER, PROVING)
    controller, way = controller_for("weg"), 46.0 - 22.0
    longest_s = proof.scenario.disturbances[0].time_s / 2.0
    led = list(slow_ramps(proof, HEATER))
    assert [60.0 * way / controller.ramp_degC_per_min(each) for each in led] == pytest.approx(
        2 * [longest_s / 8.0, longest_s / 4.0, longest_s / 2.0], rel=0.02)
    band = proof.limits.tolerance_degC
    assert [controller.hold_degC(each) for each in led] == pytest.approx([4.0 * band] * 3 + [2.0 * band] * 3, rel=0.01)
    assert [replace(each, ramp=None) for each in led] == [words] * 6


def test_a_design_with_a_slow_ramp_is_asked_for_with_the_ramp_that_its_words_hold():
    frame = DesignChange(power_most_pct=60.0, ramp="slow")
    first = SimpleNamespace(conditions=PROVING, ideal=SimpleNamespace(sample_time_s=6.0))
    assert frame.apply_to(DesignRequest(target="weg", conditions=PROVING, setpoint_ramp="none"), first, None).setpoint_ramp is None
    assert frame.summary(6.0, None) == "an output of at most 60 % and a slow setpoint ramp"
