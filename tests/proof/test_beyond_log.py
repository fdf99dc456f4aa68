"""Setpoints beyond the log: which are covered, which finding says so, and that it goes through every document."""

from dataclasses import replace

import numpy as np
import pytest

from heatertune.log.log_values import Log
from heatertune.model.findings import Finding
from heatertune.model.fit import fit, fit_together
from heatertune.model.model_document import from_document, to_document
from heatertune.model.model_values import Fopdt, model_by_hand
from heatertune.plc import Scaling
from heatertune.proof.heaters import (
    beyond_log,
    covered_degC,
    holding_heaters,
    left_out,
    range_is_unknown,
    unreachable_findings,
)
from heatertune.proof.prove_words import every_setpoint, prove
from heatertune.settings import Conditions


def _step(ambient=20.0, gain=1.0, power=60.0, sign=1.0, name="step", begin=0.0):
    """One lag of 100 s by its closed form, from `begin` % to `power` % at 200 s after a dead time of 10 s."""
    time = np.arange(0.0, 1200.0, 2.0)
    answer = np.where(time < 210.0, 0.0, 1.0 - np.exp(-np.maximum(time - 210.0, 0.0) / 100.0))
    rise = sign * gain * (begin + (power - begin) * answer)
    noise = np.random.default_rng(5).normal(0.0, 0.02, len(time))
    return Log(name=name, source="", time_s=time, temperature_degC=np.round(ambient + rise + noise, 2),
               power_pct=np.where(time < 200.0, begin, power))


@pytest.fixture(scope="module")
def fitted():
    return fit(_step())


def _names(findings):
    return [finding.name for finding in findings]


def test_a_tenth_of_the_rise_above_the_ambient_is_covered(fitted):
    assert fitted.logged_range_degC == pytest.approx((20.0, 80.0), abs=0.1)
    low, high = covered_degC(fitted)
    assert high == pytest.approx(86.0, abs=0.2)
    assert low == pytest.approx(14.0, abs=0.2)


def test_a_log_of_a_small_step_around_a_hot_setpoint_covers_a_tenth_of_its_rise_too():
    hot = fit(_step(begin=80.0, power=90.0), ambient_degC=20.0)
    assert covered_degC(hot)[1] == pytest.approx(110.0 + 9.0, abs=0.5)


@pytest.mark.parametrize(("setpoint", "expected"), [(60.0, []), (85.5, []), (87.0, ["beyond-the-log"]), (500.0, ["beyond-the-log"])])
def test_a_setpoint_beyond_it_is_found(fitted, setpoint, expected):
    assert _names(beyond_log(fitted, [setpoint])) == expected
    assert _names(beyond_log(fitted, [40.0, setpoint])) == expected
    assert _names(beyond_log(from_document(to_document(fitted)), [setpoint])) == expected


def test_the_setpoint_that_the_finding_names_is_covered(fitted):
    (finding,) = beyond_log(fitted, [300.0])
    named = float(finding.message.rstrip(").").rpartition("--setpoint ")[2])
    assert not list(beyond_log(fitted, [named]))
    assert list(beyond_log(fitted, [named + 0.2]))


def test_below_the_log_it_is_found_only_where_the_heater_is_not_linear():
    hot = fit(_step(begin=80.0, power=90.0), ambient_degC=20.0)
    bent = replace(hot, findings=(*hot.findings, Finding(name="nonlinear", message="The heater is not linear.")))
    assert not list(beyond_log(hot, [60.0]))
    assert _names(beyond_log(bent, [60.0])) == ["beyond-the-log"]
    assert not list(beyond_log(bent, [95.0]))


def test_of_a_cooler_it_is_the_other_side():
    cooler = fit(_step(ambient=25.0, gain=0.5, sign=-1.0), cooler=True)
    assert cooler.logged_range_degC == pytest.approx((-5.0, 25.0), abs=0.2)
    assert _names(beyond_log(cooler, [-12.0])) == ["beyond-the-log"]
    assert not list(beyond_log(cooler, [-7.0]))
    assert not list(beyond_log(cooler, [30.0]))


def test_of_several_logs_the_highest_counts():
    both = fit_together([_step(name="low"), _step(name="high", power=90.0)])
    assert both.logged_range_degC[1] == pytest.approx(110.0, abs=0.2)


def test_a_model_by_hand_has_no_log():
    by_hand = model_by_hand(Fopdt(gain_degC_per_pct=1.0, time_constant_s=100.0, dead_time_s=10.0, ambient_degC=20.0))
    assert not list(beyond_log(by_hand, [900.0]))
    assert not range_is_unknown(by_hand, [900.0])


def test_a_document_without_the_range_is_read_and_its_residuals_tell_it(fitted):
    document = to_document(fitted)
    del document["logged_range_degC"]
    old = from_document(document)
    assert old.logged_range_degC is None
    assert _names(beyond_log(old, [300.0])) == ["beyond-the-log"]
    assert not range_is_unknown(old, [300.0])
    bare = replace(old, residuals=None)
    assert not list(beyond_log(bare, [300.0]))
    assert range_is_unknown(bare, [300.0])
    assert not range_is_unknown(bare, [bare.setpoint_degC])


def test_both_ends_of_the_setpoints_of_use_count_and_a_profile_s_targets(fitted, tmp_path):
    assert set(every_setpoint(fitted, Conditions(setpoint_degC=(30.0, 70.0)))) == {30.0, 70.0}
    profile = tmp_path / "p.csv"
    profile.write_text("target [degC],ramp [degC/h],soak [min]\n60,100,10\n110,100,10\n40,100,10\n", encoding="utf-8")
    asked = every_setpoint(fitted, Conditions(profile=str(profile)))
    assert max(asked) == 110.0
    assert min(asked) == 40.0


def test_the_verdict_is_not_proven_until_it_is_accepted(fitted):
    import heatertune as ht  # noqa: PLC0415 - an optimiser

    words = ht.encode(ht.tune(fitted, ms=1.6), target="fb41", scaling=Scaling(low_degC=0.0, high_degC=200.0))
    asked = {"tolerance_degC": 3.0, "pwm_period_s": 1.0}
    inside, beyond, accepted = (
        prove(words, fitted, setpoint_degC=setpoint, accept=accept, **asked)
        for setpoint, accept in ((60.0, ()), (100.0, ()), (100.0, ("beyond-the-log",))))
    assert (inside.verdict, beyond.verdict, accepted.verdict) == ("PASS", "NOT PROVEN", "PASS")
    assert any(finding.name == "beyond-the-log" for finding in accepted.diagnostics.findings)


def _with_heaters(fitted, *heaters, until_s=np.inf, spike_degC=None):
    """Return the fit with further plausible heaters, of the first part of its log, with one reading that is wild."""
    rest = fitted.residuals
    rows = rest.time_s <= until_s
    measured = rest.measured_degC[rows].copy()
    if spike_degC is not None:
        measured[len(measured) // 2] = spike_degC
    cut = replace(rest, time_s=rest.time_s[rows], measured_degC=measured, simulated_degC=rest.simulated_degC[rows])
    others = [replace(fitted.candidates[0], model=heater, part=f"heater {i}") for i, heater in enumerate(heaters)]
    return replace(fitted, residuals=cut, candidates=(fitted.candidates[0], *others))


def _heater(gain, lag=100.0, ambient=20.0):
    return Fopdt(gain_degC_per_pct=gain, time_constant_s=lag, dead_time_s=10.0, ambient_degC=ambient)


# the log rises from 20 towards 80 °C with a lag of 100 s from 210 s on: it passes 75 °C at 210 + 100·ln 12 = 458 s
WEAK = _heater(0.5)  # 70 °C at full power


@pytest.mark.parametrize(("heater", "until_s"), [(WEAK, np.inf), (WEAK, 700.0), (_heater(1.0, ambient=78.0), np.inf),
                                                 (_heater(1.0, ambient=78.0), 350.0)])
def test_a_heater_that_cannot_hold_what_the_log_shows_held_is_left_out(fitted, heater, until_s):
    other = _with_heaters(fitted, heater, until_s=until_s)
    able = len(holding_heaters(other, 75.0))
    assert (able, len(other.heaters)) == (1, 2)
    assert list(unreachable_findings(other, able, 75.0)) == []
    assert list(left_out(other, able, 75.0)) == [
        "1 of 2 plausible heaters left out: they could not hold 75 °C, which the log shows to be held"]


@pytest.mark.parametrize(("heaters", "until_s", "spike_degC"), [
    ([WEAK], 350.0, None),  # the log ends below
    ([WEAK], 350.0, 90.0),  # but for one reading
    ([WEAK], 500.0, None),  # it has only just passed
    ([_heater(0.5, lag=5000.0)], np.inf, None),  # a slow one may have got there on what it had stored
    ([WEAK, _heater(0.5, lag=5000.0)], np.inf, None)])
def test_a_heater_that_the_log_does_not_contradict_keeps_the_finding(fitted, heaters, until_s, spike_degC):
    other = _with_heaters(fitted, *heaters, until_s=until_s, spike_degC=spike_degC)
    able = len(holding_heaters(other, 75.0))
    (finding,) = unreachable_findings(other, able, 75.0)
    assert finding.name == "setpoint-unreached"
    assert finding.message == f"{len(heaters)} of {len(heaters) + 1} plausible heaters cannot hold 75 °C."
    assert list(left_out(other, able, 75.0)) == []


def test_heaters_that_are_all_able_are_neither_left_out_nor_unreached(fitted):
    able = len(holding_heaters(fitted, 75.0))
    assert [*unreachable_findings(fitted, able, 75.0), *left_out(fitted, able, 75.0)] == []
