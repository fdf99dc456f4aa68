"""Zones that keep together while they heat up: measured, limited, on a setpoint ramp, recorded; a judge in C beside it."""

import json
import re
import shutil
from dataclasses import replace

import numpy as np
import pytest

from heatertune.codec import ZONES_FILE, to_json
from heatertune.errors import DocumentError, InputError, OutOfRange
from heatertune.model.findings import Finding
from heatertune.plc.ramp import Ramp
from heatertune.proof.proof_document import with_digest
from heatertune.settings import Conditions
from heatertune.zones import design_zones, export_zones, network_by_hand
from heatertune.zones.joint_loop import JointCriterion, ZoneLoop, zone_spread
from heatertune.zones.joint_proof import SPREAD_NAME, specification_for
from heatertune.zones.zone_record import design_files
from heatertune.zones.zones_folder import prove_again, read_zones_design, to_document
from tests.bench.zone_judge import judge, live, ramp_of, settling, spread
from tests.zones.networks import chain

#: a slow zone between two faster ones, one of them with much power
FITTED = network_by_hand(replace(
    chain(3, 1.0), gains_degC_per_pct=(1.2, 0.8, 2.0), time_constants_s=(240.0, 500.0, 150.0)))


def designed(limit_degC, target="s7-300", setpoints=60.0, **changed):
    spec = replace(specification_for(FITTED, setpoints, Conditions()), spread_degC=limit_degC, **changed)
    return design_zones(FITTED, target, specification=spec)


@pytest.fixture(scope="module")
def together():
    return designed(4.0)


def test_the_spread_of_zones_is_what_exceeds_the_difference_of_their_setpoints():
    # of two zones with setpoints of 50 and 80 °C, the colder one may not be warmer, the other may be 30 °C warmer
    highest, lowest = np.array([[24.0, 20.0], [51.0, 49.5], [50.0, 81.0]]), np.array([[23.0, 20.0], [50.0, 49.0], [49.0, 80.5]])
    assert zone_spread(highest, lowest, np.array([50.0, 80.0])) == (4.0, 0, 1)
    assert zone_spread(highest, lowest, np.array([50.0, 50.0])) == (32.0, 1, 0)
    assert zone_spread(highest[2:], lowest[2:], np.array([50.0, 85.0]))[0] == 0.0


@pytest.mark.parametrize("limit", [0.0, -1.0, float("nan"), float("inf")])
def test_a_limit_of_the_spread_that_is_none_is_refused(limit):
    with pytest.raises(OutOfRange, match="spread_degC"):
        replace(specification_for(FITTED, 60.0, Conditions()), spread_degC=limit)


@pytest.mark.long(seconds=30)
def test_a_ramp_at_the_pace_of_the_slowest_zone_keeps_zones_together(together):
    free = designed(None)
    assert free.verdict == "PASS"
    assert free.words[0].ramp is None
    assert free.spread.value > 20.0
    assert SPREAD_NAME not in {each.name for each in free.criteria}
    assert f"spread of the zones while all heat up together: {free.spread.value:.4g} °C beyond" in free.summary()
    assert together.verdict == "PASS", together.summary()
    assert together.spread.value <= 4.0
    assert len({words.ramp for words in together.words}) == 1
    # full power less the reserve, near 60 °C: the slowest zone, b, needs 47.5 % to hold it and rises by 0.8 · 47.5 / 500 a second
    assert ramp_of(together.words[0])[2] == pytest.approx(0.8 * 47.5 / 500.0, rel=0.05)
    assert "setpoint ramp of all zones: 4.5" in together.brief()


@pytest.mark.parametrize("limit", [None, 4.0])
@pytest.mark.long(seconds=30)
@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler, cc")
def test_a_judge_that_shares_nothing_measures_the_same_spread(together, limit):
    proof = together if limit else designed(None)
    lasts_s = settling(FITTED.network, proof, 0.95)
    phases, temperatures, _, asked = live(FITTED.network, proof, settle_s=lasts_s, noise_degC=0.0, seed=0, settings=None)
    found = spread(temperatures[:phases[0].end], asked[0])
    inside = slice(0, int(np.argmax(np.any(proof.trace.setpoints_degC != 60.0, axis=1))))  # the heat-up, up to the first change
    at_scans, between = (zone_spread(highest[inside], lowest[inside], np.full(3, 60.0))[0] for highest, lowest in (
        [proof.trace.temperatures_degC] * 2, (proof.trace.highest_degC, proof.trace.lowest_degC)))
    assert found == pytest.approx(at_scans, abs=0.1)
    assert at_scans <= between <= proof.spread.value  # the proof counts the ripple between scans, and other heaters
    strict = replace(proof, specification=replace(proof.specification, spread_degC=0.5))
    assert "apart while heating up" in judge(FITTED.network, strict, settle_s=lasts_s)


@pytest.mark.parametrize("target", ["s7-300", pytest.param("s5-ob251", marks=pytest.mark.sample)])
@pytest.mark.long(seconds=60)
def test_the_spread_that_a_failure_names_passes(target):
    proof = designed(0.3, target)
    assert proof.verdict == "FAIL"
    assert {each.name for each in proof.criteria if not each.ok} == {SPREAD_NAME}
    named = float(re.search(r"to allow it: --spread ([\d.]+)$", proof.summary(), re.MULTILINE)[1])
    again = designed(named, target)
    assert again.verdict == "PASS", again.summary()


def test_a_limit_that_would_be_allowed_does_not_hide_what_is_not_proven(together):
    """Four of ten followed limits had ended NOT PROVEN: the log, too, had a fault."""
    apart = JointCriterion(name=SPREAD_NAME, value=4.23, limit=4.0, where="zone a beyond zone b")
    fault = Finding(name="poor-fit", message="the network leaves far more than noise")
    failed, allowed = (replace(together, criteria=(replace(apart, limit=limit),), findings=(fault,)) for limit in (4.0, 4.3))
    assert "to allow it: --spread 4.3; NOT PROVEN until poor-fit is remedied, too" in failed.brief().splitlines()
    assert [failed.verdict, allowed.verdict, replace(allowed, accepted=("poor-fit",)).verdict] == ["FAIL", "NOT PROVEN", "PASS"]
    assert "to allow it: --spread 4.3" in replace(failed, findings=()).brief().splitlines()


@pytest.mark.long
def test_a_target_without_ramps_is_judged_all_the_same():
    network = chain(2, 0.05, gain=1.5, lag=300.0)
    fitted = network_by_hand(replace(network, gains_degC_per_pct=(1.5, 2.5)))
    spec = replace(specification_for(fitted, 60.0, Conditions()), spread_degC=1.0)
    proof = design_zones(fitted, "klipper", specification=spec)
    assert proof.verdict == "FAIL"
    assert "to allow it: --spread" in proof.summary()


def test_record_document_and_program_contain_the_ramp(together, tmp_path):
    files = design_files(together, force=False)
    page = str(files["record.html"])
    assert "setpoint ramp of all zones: 4.5" in page
    assert "exceeds that between their setpoints by 4 °C at the most" in page
    source = str(export_zones(together)["s7_300_zones.awl"])
    assert source.count("setpoint ramp under way") == 3
    assert source.count("setpoint ramp of all zones: 4.5") == 3
    path = tmp_path / ZONES_FILE
    path.parent.mkdir()
    path.write_text(files[ZONES_FILE], encoding="utf-8")
    design = read_zones_design(tmp_path)
    assert design.words == together.words
    assert design.specification.spread_degC == 4.0
    # a ramp twice as fast, with a digest of its own: no such words
    document = dict(to_document(together))
    changed = json.loads(json.dumps(document["provenance"]))
    changed["ramp"] = {"step": 40000, "calls": 1, "hold": None}
    path.write_text(to_json(with_digest({**document, "provenance": changed, "digest": None})), encoding="utf-8")
    with pytest.raises(DocumentError):
        read_zones_design(tmp_path)


@pytest.mark.long(seconds=20)
def test_the_repeated_proof_runs_with_the_ramp(together, tmp_path):
    path = tmp_path / ZONES_FILE
    path.parent.mkdir()
    path.write_text(to_json(to_document(together)), encoding="utf-8")
    again = prove_again(read_zones_design(tmp_path))
    assert again.words == together.words
    assert again.spread.value == together.spread.value


def test_zones_have_one_ramp(together):
    first, *others = together.words
    with pytest.raises(InputError, match="setpoint ramp"):
        ZoneLoop(words=(replace(first, ramp=Ramp(step=1)), *others), actuator=together.actuator)


@pytest.mark.long(seconds=20)
def test_power_that_no_limit_covers_is_stated():
    proof = designed(None, rated_kw=(2.0, 2.0, 2.0), peak_kw=4.0)
    assert proof.verdict == "PASS", proof.summary()
    assert "not limited to 4 kW: heating up, faults and restarts; fuses and supply have to bear 6 kW" in proof.brief()
