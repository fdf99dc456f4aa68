"""Runs near a limit are repeated with events at other phases of scan and PWM; the verdict takes the worst."""

from dataclasses import replace
from itertools import pairwise

import pytest
from tests.proof.test_noise import FITTED, HEATER, KNOWN, NOISY, S5, WORDS
from tests.witness.trace_measures import judge

from heatertune.compiled import dispatch
from heatertune.proof import simulate
from heatertune.proof.criteria import Criterion
from heatertune.proof.heaters import scale_power
from heatertune.proof.prove_words import prove
from heatertune.proof.runs import STATES, near_limit, nearest_to_limits, other_states, worst_state
from heatertune.proof.scenario import (
    NewSetpoint,
    PlcPower,
    Scenario,
    SetpointRampEvent,
    TemperatureStep,
    delay_heater,
    phases_of,
)

QUIET = replace(NOISY, noise_degC=0.0, tolerance_degC=0.6)
#: at +10 % mains cold goods overshoot by 9.30 % of the rise on whole scans
AT_THE_LIMIT = replace(QUIET, limit=("recovery-overshoot=9.5 %",))
SEQUENCE = Scenario(
    setpoint_degC=60.0, duration_s=2400.0, ambient_degC=20.0, rests_s=(200.0, 200.0, 0.0, 100.0, 0.0, 0.0, 80.0),
    disturbances=(
        TemperatureStep(time_s=600.0, temperature_degC=-10.0), NewSetpoint(time_s=1000.0, setpoint_degC=50.0, unheld=True),
        NewSetpoint(time_s=1200.0, setpoint_degC=60.0), PlcPower(time_s=1600.0, on=False),
        SetpointRampEvent(time_s=1900.0, from_degC=20.0, setpoint_degC=60.0, duration_s=300.0),
        SetpointRampEvent(time_s=2200.0, from_degC=60.0, setpoint_degC=60.0, duration_s=200.0)))


def _of(value, name="overshoot", limit=1.0):
    return Criterion(name=name, value=value, limit=limit, unit="", what="")


def _overshoot_at_high_mains(scenario, proof):
    heater = scale_power(delay_heater(HEATER, S5.delay_s), 1.21)
    trace = simulate(S5, WORDS, heater, scenario, proof.actuator, KNOWN)
    return {each.name: each.value for each in judge(trace, proof.limits)}["recovery_overshoot"]


def test_a_limit_that_is_kept_on_whole_scans_alone_is_broken(monkeypatch):
    monkeypatch.setattr(dispatch, "_PLAIN_SCANS", 0)  # in the machine code that the proof has anyway
    proof = prove(WORDS, FITTED, AT_THE_LIMIT)
    assert proof.verdict == "FAIL"
    assert proof.broken_criteria == ("recovery_overshoot",)
    # the same from traces of readings, by other measures than those of the proof's meter
    (scenario,) = (supply.scenario for supply in proof.mains if supply.mains_power > 1.0)
    assert _overshoot_at_high_mains(scenario, proof) == pytest.approx(9.30, abs=0.01)
    others = [_overshoot_at_high_mains(other, proof) for other in other_states(scenario, 4.0, 4.0)]
    worst = next(each for each in proof.criteria if each.name == "recovery_overshoot")
    assert max(others) > 9.5
    assert worst.value == pytest.approx(max(others), rel=1e-3)
    remark = f"{STATES} other initial states: {100.0 * worst.value / 9.5:.4g} % of a limit is used, 97.88 % before"
    assert remark in proof.diagnostics.remarks


def test_a_proof_far_from_its_limits_runs_no_other_state(monkeypatch):
    def refuse(*_):
        raise AssertionError("another state was run")

    monkeypatch.setattr("heatertune.proof.proof.other_states", refuse)
    assert prove(WORDS, FITTED, QUIET).verdict == "PASS"
    with pytest.raises(AssertionError, match="another state"):
        prove(WORDS, FITTED, AT_THE_LIMIT)


def test_what_each_part_may_take_stays_the_same_and_it_comes_at_other_phases():
    before, phases = phases_of(SEQUENCE, 2400.0, 0.0), set()
    for state in other_states(SEQUENCE, 1.0, 10.0):
        now = phases_of(state, state.duration_s, 0.0)
        assert [each.kind for each in now] == [each.kind for each in before]
        for old, new in zip(before, now, strict=True):
            rests = old.rest_s < old.end_s
            assert -1e-9 <= new.limit_s - old.limit_s <= (1e-9 if rests else 10.0)
            longer_s = (new.end_s - new.rest_s) - (old.end_s - old.rest_s)
            assert -1e-9 <= longer_s <= 10.0 + 0.25 * (old.end_s - old.rest_s)
        legs = [event.time_s for event in state.disturbances if isinstance(event, SetpointRampEvent)]
        assert [*(end - begin for begin, end in pairwise(legs)), state.duration_s - legs[-1]] == pytest.approx([300.0, 200.0])
        phases |= {round(event.time_s % 1.0, 3) for event in state.disturbances}
    assert len(phases) > 15  # four states of six events


def test_the_first_state_has_its_events_just_after_a_scan():
    state, *_ = other_states(SEQUENCE, 2.0, 10.0)
    assert [event.time_s % 2.0 for event in state.disturbances] == pytest.approx([0.02] * 6)


def test_only_a_heat_up_or_a_record_without_rests_has_no_other_state():
    assert not list(other_states(replace(SEQUENCE, disturbances=(), rests_s=()), 1.0, 1.0))
    assert not list(other_states(replace(SEQUENCE, rests_s=()), 1.0, 1.0))


def test_of_each_limit_the_run_that_uses_most_is_near():
    runs = [(_of(0.5), _of(0.96, "reheat")), (_of(0.97), _of(0.99, "reheat")), (_of(0.98), _of(0.1, "reheat"))]
    assert nearest_to_limits(runs, [0.95] * 3, [0.0] * 3) == [1, 2]
    assert nearest_to_limits(runs, [0.99] * 3, [0.0] * 3) == []
    assert nearest_to_limits([(_of(0.97, "power_reserve"),)], [0.95], [0.0]) == []


def test_hunting_is_near_by_offset_half_swing_and_the_effect_of_a_tick_together():
    hunting = (_of(0.5, "steady_offset"), _of(0.4, "limit_cycle"))
    assert nearest_to_limits([hunting], [0.95], [0.04]) == []
    assert nearest_to_limits([hunting], [0.95], [0.06]) == [0]
    still = (_of(0.9, "steady_offset"), _of(0.02, "limit_cycle"))  # no tick that the temperature does not show
    assert nearest_to_limits([still], [0.95], [0.5]) == []


@pytest.mark.parametrize(("step_s", "dead_s", "share"), [(0.1, 10.0, 0.948), (2.5, 10.0, 0.9), (60.0, 1.0, 0.9)])
def test_a_step_that_is_long_against_the_dead_time_is_near_earlier(step_s, dead_s, share):
    assert near_limit(step_s, dead_s) == pytest.approx(share)


def test_the_worst_state_leaves_numbers_without_a_limit_as_they_are():
    iae = replace(_of(3.0, "iae"), limit=None)
    others = [(_of(0.4), replace(iae, value=9.0)), (_of(0.7), replace(iae, value=1.0))]
    assert worst_state((_of(0.5), iae), others) == (_of(0.7), iae)
