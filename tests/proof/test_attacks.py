"""Whatever is no number, or nothing at all, is no PASS: in a run, in a proof, in what was measured, in a document."""

import math
from dataclasses import replace

import numpy as np
import pytest
from tests.witness import trace_measures

from heatertune.errors import DocumentError, ExportRefused, HeatertuneError, InputError
from heatertune.model.model_values import Fopdt, model_by_hand
from heatertune.plc import Scaling, Words, controller_for
from heatertune.proof.criteria import columns_of, worst_of
from heatertune.proof.loop import in_loop, noise_of, plant_row, scans_of
from heatertune.proof.proof_document import check_document, with_digest
from heatertune.proof.prove_words import prove
from heatertune.proof.runs import measure_runs
from heatertune.proof.verdict import combined_verdict, derived_verdict, verdict_of_samples
from heatertune.proof.words_file import certificate

HEATER = Fopdt(gain_degC_per_pct=0.37, time_constant_s=167.0, dead_time_s=12.0, ambient_degC=22.0)
S5 = controller_for("s5-ob251")
WORDS = Words(
    target="s5-ob251", sample_time_s=4.0, scaling=Scaling(low_degC=0.0, high_degC=100.0),
    values={"K": 9881, "R": 1024, "TI": 63, "TD": 0, "W": 0, "STEU": 33, "YH": 0, "BGOG": 2047, "BGUG": 0})
NUMBERS = [None, math.nan, math.inf, -math.inf, True, "1", [], {}]
SAMPLES = {"verdict": "PASS", "count": 59, "seed": 0, "quantile": 0.95, "passing": 1.0, "worst_seed": 0, "spread": {},
           "criteria": {}, "settings": [{"switches": {}, "passing_count": 59}]}


@pytest.fixture(scope="module")
def proof(rated_only):
    # one run, at the rated power, so that a value broken in it and in the document is broken everywhere
    known = {switch.name: switch.default for switch in S5.switches}
    proof = prove(WORDS, model_by_hand(HEATER), setpoint_degC=40.0, switches=known, spec=rated_only)
    assert (proof.verdict, len(proof.runs)) == ("PASS", 1)
    return proof


def _passes(document):
    """Return whether a document is taken for a PASS, by what reads it and by the export."""
    try:
        certificate(check_document(with_digest(document), "proof.json"))
    except (DocumentError, ExportRefused):
        return False
    return True


def test_a_proof_that_is_left_as_it_is_passes(proof):
    assert _passes(proof.to_document())
    assert _passes(proof.to_document() | {"samples": SAMPLES})


def test_a_criterion_that_is_no_number_fails_its_run_and_the_proof_whichever_it_is(proof):
    for number, criterion in enumerate(proof.criteria):
        broken = replace(criterion, value=math.nan)
        criteria = (*proof.criteria[:number], broken, *proof.criteria[number + 1:])
        run = replace(proof.runs[0], criteria=criteria)
        assert run.verdict == replace(proof, runs=(proof.runs[0], run)).verdict == "FAIL", criterion.name
        assert replace(proof, criteria=criteria).verdict == "FAIL", "its runs do not say so"
        assert worst_of([criterion, broken, replace(criterion, value=math.inf)]) is broken
        failed = replace(proof, criteria=criteria, runs=(run,)).to_document()
        assert derived_verdict(failed) == "FAIL"
        assert not _passes(failed)
        assert not _passes(failed | {"verdict": "PASS"})


def test_nothing_proves_nothing(proof):
    for nothing in ({"runs": ()}, {"criteria": ()}):
        with pytest.raises(InputError, match="none"):
            replace(proof, **nothing)
    with pytest.raises(InputError, match="no criteria"):
        replace(proof.runs[0], criteria=())
    with pytest.raises(InputError, match="a verdict needs at least one run"):
        combined_verdict([])


@pytest.mark.parametrize("other", ["pass", "", None, "OK", "PASS "])
def test_what_is_no_verdict_is_not_taken_for_one(other):
    with pytest.raises(InputError, match="expected PASS, NOT PROVEN or FAIL"):
        combined_verdict(["PASS", other])


@pytest.mark.parametrize(("count", "quantile", "kept"), [
    (math.nan, 0.95, [59]), (59, math.nan, [59]), (59, 0.95, [math.nan]), (59, 0.95, [59, 58]), (59, 0.95, []), (59, 0.95, [60]), (0, 0.95, [0]),
])
def test_samples_that_are_no_numbers_too_few_or_none_are_no_pass(count, quantile, kept):
    assert verdict_of_samples(count, quantile, kept) != "PASS"


@pytest.mark.parametrize("wrong", NUMBERS)
def test_no_value_in_a_documents_runs_and_criteria_can_be_another_thing_than_a_number(proof, wrong):
    for number, name in enumerate(proof.to_document()["criteria"]):
        document = proof.to_document()
        for holder in (document, document["runs"][0]):  # both say the same, so that nothing contradicts it
            holder["criteria"][name]["value"] = wrong
        kept = name in ("gain_margin", "phase_margin", "stability", "power_reserve") and wrong in (None, math.inf)
        told = proof.criteria[number].limit is None and wrong in (None, math.inf, -math.inf)
        below = wrong == -math.inf and document["criteria"][name]["bound"] == "<="
        assert kept or told or below or not _passes(document), name


@pytest.mark.parametrize(("field", "wrong"), [
    *((field, wrong) for field in ("passing", "quantile", "count") for wrong in (None, math.nan, math.inf, -1, 0, "1", 2.5)),
    ("settings", []), ("settings", None), *(("settings", [{"switches": {}, "passing_count": kept}]) for kept in (None, 58, 60, 59.0, -1, True)),
    ("settings", [{"switches": {}, "passing": 1.0}]),
])
def test_samples_of_a_document_are_checked_and_heard(proof, field, wrong):
    assert not _passes(proof.to_document() | {"samples": SAMPLES | {field: wrong}})


def test_a_temperature_that_is_no_number_is_seen_wherever_it_comes_in(proof):
    controller = in_loop(S5, WORDS, proof.scenario.setpoints_degC, {}, direct=True)
    noise = noise_of(proof.scenario, scans_of(controller, proof.scenario))[None]
    for place in range(6):  # gain, lags, dead time, ambient, start: the second lag is no lag where it is 0
        row = np.array([plant_row(HEATER, proof.scenario)])
        row[0, place] = math.nan
        try:
            measured = measure_runs(controller, row, proof.scenario, proof.actuator, proof.limits, noise, np.zeros((1, 1)))
        except (ValueError, ZeroDivisionError):  # no room for what is under way, no turn of what is no number
            continue
        assert not all(one.ok for column in columns_of(measured, proof.limits) for one in column.criteria([""])), place


def test_what_was_measured_and_is_no_number_breaks_a_limit_whatever_it_is(proof):
    measured = trace_measures.measured(proof.nominal, proof.limits)
    judged = [number for number, phase in enumerate(measured.phases) if phase.kind != "off"]
    for name, places in (("table", np.ndindex(*measured.table.shape)), ("totals", np.ndindex(*measured.totals.shape)),
                         ("ripple", [(0,)])):
        for place in places:
            if name == "table" and place[1] not in judged:
                continue
            numbers = getattr(measured, name).copy()
            numbers[place] = math.nan
            columns = columns_of(replace(measured, **{name: numbers}), proof.limits)
            kept = all(one.ok for column in columns for one in column.criteria([""]))
            assert not kept or _unused(measured, name, place), (name, place)


def _unused(measured, name, place):
    """Return whether nothing is judged by a number: the other side of a way's overshoot, the lag behind no profile."""
    highest, lowest, lag = 0, 1, 7
    if name == "table" and place[2] == lag:
        return True
    if name != "table" or place[2] not in (highest, lowest):
        return False
    phase = measured.phases[place[1]]
    return phase.kind != "recovery" and place[2] == (lowest if phase.up else highest)


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf])
def test_no_condition_that_is_no_number_reaches_a_proof(wrong):
    for conditions in ({"setpoint_degC": wrong}, {"noise_degC": wrong}, {"tolerance_degC": wrong}, {"pwm_period_s": wrong},
                       {"step_power_pct": wrong if math.isnan(wrong) else -1.0}, {"limit": (f"overshoot={wrong} %",)}):
        with pytest.raises(HeatertuneError):
            prove(WORDS, model_by_hand(HEATER), **{"setpoint_degC": 40.0} | conditions)
