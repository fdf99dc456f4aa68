"""The setpoint ramp that is found in the proof's loop, and what it does to the proof."""

from dataclasses import replace

import numpy as np
import pytest

from heatertune.chain.stages import export, fit_known
from heatertune.errors import ExportRefused, InputError, OutOfRange
from heatertune.log.log_values import Log
from heatertune.model.model_values import Fopdt, model_by_hand
from heatertune.plc import Ramp, controller_for
from heatertune.plc.design import encode, tune
from heatertune.proof import TestSequence, prove, setpoint_ramp
from heatertune.proof.setpoint_ramp import prove_ramped
from heatertune.proof.specification import Specification
from heatertune.settings import Conditions

#: overshoots from cold under the optimum for disturbances: its integral runs on at the limit (see test_refine)
SLOW = model_by_hand(Fopdt(gain_degC_per_pct=0.8, time_constant_s=480.0, dead_time_s=60.0, ambient_degC=22.0))
PROVING = Conditions(setpoint_degC=40.0)
#: a ramp mends nothing of what comes after an open circuit: the setpoint is there already
HEAT_UP_AND_DISTURBANCES = TestSequence(opens=False, changes=False, mains=False, restarts=False)


@pytest.fixture(autouse=True, scope="module")
def no_cache():
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HEATERTUNE_CACHE", "")
        patch.setattr(Specification, "story_at", lambda _, __: HEAT_UP_AND_DISTURBANCES)
        yield


@pytest.fixture(scope="module")
def words():
    return encode(tune(SLOW, target="s5-ob251", sample_time_s=10.0), "s5-ob251")


@pytest.fixture(scope="module")
def plain(words, no_cache):
    return prove(words, SLOW, PROVING)


@pytest.fixture(scope="module")
def found(words, no_cache):
    return prove_ramped(words, SLOW, "auto", PROVING)


def _of(proof, name):
    return next(criterion for criterion in proof.criteria if criterion.name == name)


def _broken(proof):
    return [criterion.name for criterion in proof.criteria if not criterion.ok]


def test_the_ramp_mends_the_overshoot_and_touches_neither_gains_nor_disturbances(words, plain, found):
    assert _broken(plain) == ["overshoot"]
    proof, notes = found
    assert proof.verdict == "PASS"
    assert replace(proof.words, ramp=None) == words
    assert proof.words.ramp is not None
    # the disturbance comes when the setpoint rests: what it does is the same but for the phase of the PWM
    for name in ("deviation", "recovery_time"):
        assert _of(proof, name).value == pytest.approx(_of(plain, name).value, rel=0.03)
    for name in ("ms", "gain_margin", "phase_margin"):
        assert _of(proof, name).value == _of(plain, name).value
    # its price: a later heat-up, and more IAE against the setpoint asked for
    assert _of(proof, "iae").value > _of(plain, "iae").value
    told = f"from {_of(plain, 'overshoot').value:.4g} to {_of(proof, 'overshoot').value:.4g} %"
    assert told in notes[0]
    assert f"{proof.ramp_degC_per_min:.3g} °C/min ({proof.words.ramp})" in notes[0]


def test_the_ramp_found_is_the_fastest(words, found):
    # the search promises 3 %, and whole units realise a rate within 5 %
    rate = found[0].ramp_degC_per_min
    for factor in (1.1, 1.5, 4.0):
        faster, _ = prove_ramped(words, SLOW, factor * rate, PROVING)
        assert faster.ramp_degC_per_min == pytest.approx(factor * rate, rel=0.05)
        assert _broken(faster) == ["overshoot"], factor


@pytest.mark.long
@pytest.mark.parametrize("setpoint", [36.0, pytest.param(40.0, marks=pytest.mark.sample), 46.0])
def test_where_the_step_is_a_real_the_ramp_found_is_the_fastest_within_3_percent(setpoint):
    options = Conditions(
        setpoint_degC=setpoint, switches={"order": "as_printed", "edge": "output_zero", "filter": "implicit"})
    words = encode(tune(SLOW, target="weg", sample_time_s=10.0), "weg")
    proof, _ = prove_ramped(words, SLOW, "auto", options)
    assert proof.verdict == "PASS"
    faster, _ = prove_ramped(words, SLOW, 1.032 * proof.ramp_degC_per_min, options)
    assert _broken(faster) == ["overshoot"]


@pytest.mark.long
def test_without_being_asked_it_is_proposed_only(words, plain, found):
    proof, notes = prove_ramped(words, SLOW, conditions=PROVING)
    assert proof.words == words
    assert _of(proof, "overshoot").value == _of(plain, "overshoot").value
    assert notes == [found[1][0].replace("With", "Only the overshoot fails. --setpoint-ramp auto would mend it: with")]
    again, silent = prove_ramped(found[0].words, SLOW, "none", PROVING)
    assert (again.words, silent) == (words, [])
    as_they_are, silent = prove_ramped(found[0].words, SLOW, conditions=PROVING)
    assert (as_they_are.words, silent) == (found[0].words, [])


def test_words_proven_with_a_ramp_are_not_exported_without_it_nor_the_other_way_round(words, plain, found):
    ramped = found[0]
    for other in (words, replace(words, ramp=Ramp(step=1, calls=7))):
        with pytest.raises(ExportRefused, match="other words"):
            export(other, ramped)
    with pytest.raises(ExportRefused, match="other words"):
        export(ramped.words, plain, force=True)
    files = export(ramped.words, ramped)
    rate = f"proven with the setpoint ramp {ramped.words.ramp}, {ramped.ramp_degC_per_min:.3g} °C/min"
    assert all(rate in content for name, content in files.items() if name.endswith(".txt"))
    assert "FB 33" in files["program_listing.txt"]
    document = ramped.to_document()["setpoint_ramp"]
    assert document == {"step": ramped.words.ramp.step, "calls": ramped.words.ramp.calls, "hold": None, "hold_degC": None,
                        "degC_per_min": pytest.approx(ramped.ramp_degC_per_min)}
    assert plain.to_document()["setpoint_ramp"] is None


@pytest.mark.long
def test_durations_are_not_walked_through_where_the_slowest_ramp_leaves_more_than_half_of_what_the_fastest_breaks(
    words, monkeypatch
):
    looked = list[None]()

    def broken_by(share):  # by the fastest ramp a whole limit, by the slowest a share of it
        def badness(_, words, __):
            return share if words.ramp == slowest else 1.0

        return badness

    conditions = replace(PROVING, limit=("overshoot=0.001%",))
    search = setpoint_ramp._Search(plain=prove(words, SLOW, conditions), fitted_model=SLOW, conditions=conditions,
                                   kept_limits=setpoint_ramp.OVERSHOOTS)
    slowest = search.with_duration(search.longest_s).ramp
    monkeypatch.setattr(setpoint_ramp.RunScreen, "keeps", lambda *_: looked.append(None) or False)
    for share, walks in ((0.0, True), (0.49, True), (0.51, False), (1.0, False)):
        monkeypatch.setattr(setpoint_ramp.RunScreen, "badness", broken_by(share))
        looked.clear()
        assert search.fastest() is None
        assert (len(looked) > 10) == walks
        assert (len(looked) == 1) != walks


@pytest.mark.long
def test_auto_says_why_there_is_no_ramp():
    quick = model_by_hand(Fopdt(gain_degC_per_pct=0.37, time_constant_s=167.0, dead_time_s=12.0, ambient_degC=22.0))
    words = encode(tune(quick, target="s5-ob251"), "s5-ob251")
    proof, notes = prove_ramped(words, quick, "auto", PROVING)
    assert proof.words.ramp is None
    assert notes == [f"No setpoint ramp is needed: the worst overshoot without one is "
                     f"{_of(proof, 'overshoot').value:.3g} % of the rise, within its limit."]
    wild = replace(words, values=dict(words.values) | {"TI": 12 * words.values["TI"]})
    proof, notes = prove_ramped(wild, quick, "auto", PROVING)
    assert {"overshoot", "ms"} <= set(_broken(proof))
    assert proof.words == wild
    assert "keeps the limit on overshoot" in notes[0] or "mends the overshoot alone" in notes[0]
    proof, notes = prove_ramped(words, quick, "auto", replace(PROVING, step_power_pct=0.01))
    assert "overshoot" not in _broken(proof)
    assert "mends nothing but overshoot, and" in notes[0]
    two_level = encode(tune(quick, target="on-off"), "on-off")
    proof, notes = prove_ramped(two_level, quick, "auto", PROVING)
    assert (proof.words, notes) == (two_level, ["on-off has no setpoint ramp."])
    with pytest.raises(InputError, match="on-off has no setpoint ramp"):
        prove_ramped(two_level, quick, 3.0, PROVING)
    with pytest.raises(OutOfRange, match="setpoint_ramp_degC_per_min = -3"):
        prove_ramped(words, quick, -3.0, PROVING)


def test_a_log_cannot_be_fitted_to_words_with_a_ramp(words):
    time = np.arange(100.0)
    log = Log(name="x", source="x", time_s=time, temperature_degC=20.0 + 0.1 * time)
    with pytest.raises(InputError, match="setpoint ramp"):
        fit_known(log, replace(words, ramp=Ramp(step=3)), setpoint_degC=40.0)


def test_the_heater_follows_what_the_room_was_told(words):
    ramp = Ramp(step=9, calls=2)
    nominal = prove(replace(words, ramp=ramp), SLOW, PROVING).nominal
    # OB251: 22 °C is 450 units, 40 °C is 818; a unit is 100/2047 °C
    rows = [450 + 9 * ((k + 1) // 2) for k in range(len(nominal.time_s))]
    assert nominal.followed_degC == pytest.approx(np.minimum(rows, 818) * 100.0 / 2047.0, abs=1e-9)
    assert controller_for("s5-ob251").measure(words, 40.0) == 818
