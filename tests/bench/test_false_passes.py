"""No PASS of a small choice of random designs is a false one, and the second opinion sees what is wrong."""

import shutil
from dataclasses import replace

import pytest

from tests.bench.false_passes import SLACK, _limits, _measured_apart, _proven, drawn, judged
from tests.bench.second_opinion import compiled, opinion

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler, cc")

LIMITS = {"overshoot": 20.0, "change_overshoot": 20.0, "restart_overshoot": 20.0, "reheat_overshoot": 40.0,
          "recovery_overshoot": 20.0, "small_change_overshoot": 65.0}


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    return compiled(tmp_path_factory.mktemp("judge"))


# one and two lags, noise, a ramp and a holdback, a preset, two setpoints, short pulses made up later, a profile, a boost, and every target; all
# keep the limits of their runs
@pytest.mark.parametrize(("number", "target"), [
    (10154, "fb41"), (10109, "s5-ob251"), (10138, "s7-200"), (20057, "s7-200-pid"), (6, "klipper"), (100099, "weg"),
    (100875, "s7-300"), (2000005, "weg"), (5000004, "iec-pid"), (5000012, "arduino-pid"), (5000024, "simple-pid"), (5000011, "esphome"),
    *(pytest.param(*case, marks=pytest.mark.sample) for case in ((10120, "s5-ob251"), (4017, "s7-300"), (4255, "weg"))),
])
@pytest.mark.long
def test_what_passes_keeps_its_limits_in_another_simulation_five_times_as_long(library, number, target):
    # the judge shares nothing with the proof: the manuals' equations in C, Runge-Kutta, a story of its own; 0.1 % is what
    # measures may differ by
    case = judged(library, number, target, longer=5.0, draws=4)
    assert case["runs"], case
    assert not case["wrong"], case
    assert case.get("draws broken", 0.0) <= 0.25, case


# a profile whose parts begin at 4.2 s and 0.716 s added up; OutMax in single precision, which GCC's vectors left out; a band met to a tenth
@pytest.mark.parametrize(("number", "target"), [(2000025, "pband"), (2000001, "s7-300"), (2000021, "arduino-pid"), (2000123, "pband")])
@pytest.mark.long
def test_what_is_measured_is_the_same_for_both_whatever_the_verdict(library, number, target):
    case = judged(library, number, target, longer=0.01, draws=1)
    assert "not kept" in case
    assert not case["wrong"], case


def test_what_is_measured_otherwise_is_told(library):
    model, words, bench, conditions = drawn(4255, "weg")
    proof = _proven(words, model, conditions, draws=False)
    limits = _limits(proof.limits)
    assert not _measured_apart(library, bench, limits, proof, kept=True)
    told = _measured_apart(library, replace(bench, dead=bench.dead + 0.1), limits, proof, kept=True)
    assert "deviation" in told["wrong"]["measures"]


@pytest.mark.long
@pytest.mark.parametrize(("change", "broken"), [
    (lambda b: {"gain": 3.0 * b.gain}, "settling_time"), (lambda b: {"dead": 4.0 * b.dead}, "limit_cycle"),
    (lambda b: {"tolerance": 0.25 * b.tolerance}, "reheat_time"),
    (lambda b: {"settings": b.settings | {"anti_windup": "none"}}, "reheat_time"),
])
def test_the_second_opinion_sees_what_is_wrong(library, change, broken):
    # words that keep their limits, on another heater, in a narrower band, or in a block that winds up
    _, _, bench, _ = drawn(4255, "weg")
    kept = opinion(library, bench, LIMITS, longer=0.0)
    assert all(value <= limit for value, limit in kept.values.values())
    value, limit = opinion(library, replace(bench, **change(bench)), LIMITS, longer=0.0).values[broken]
    assert value > limit * (1.0 + SLACK)


def test_the_second_opinion_knows_a_holdback(library):
    # as WEG's listing leads the setpoint: without the holdback the led setpoint runs ahead while the circuit is open
    _, _, bench, _ = drawn(100099, "weg")
    step, calls, hold = bench.ramp
    held, free = (opinion(library, replace(bench, ramp=(step, calls, far)), LIMITS, longer=0.0) for far in (hold, 0.0))
    assert hold > 0.0
    assert held.values["reheat_overshoot"][0] < 10.0
    assert free.values["reheat_overshoot"][0] > 40.0


def test_the_second_opinion_knows_a_boost(library):
    # the I part that winds up in an open circuit begins at zero where the program has had the heater meanwhile
    _, _, bench, _ = drawn(4255, "weg")
    wound = replace(bench, settings=bench.settings | {"anti_windup": "none"})
    near = 20.0 / bench.words["Kp"]
    free, boosted = (opinion(library, replace(wound, boost=boost), LIMITS, longer=0.0) for boost in (None, (near, 1.5 * near)))
    assert free.values["reheat_overshoot"][0] > 20.0 > boosted.values["reheat_overshoot"][0], "nearly taken back, it winds up, too"


def test_the_second_opinion_sees_a_profile(library):
    # the firing that its words keep, led twice as fast: the ramps' ends are overshot and the soaks begin too hot or too cold
    _, _, bench, _ = drawn(2000005, "weg")
    fast = tuple((end, bench.interval * max(1, round(ramp / 4.0 / bench.interval)), soak) for end, ramp, soak in bench.profile)
    kept, broken = (opinion(library, replace(bench, profile=profile), LIMITS, longer=0.0) for profile in (bench.profile, fast))
    for name in ("ramp_overshoot", "soak_deviation"):
        assert broken.values[name][0] > kept.values[name][0]


def test_a_loop_that_leaves_the_band_long_after_a_load_is_seen_by_the_story(library):
    # at 95 % of power the noise through the D part reaches the limit, where the S7-200 cuts the bias: within one period of
    # the loop the mean stays in the band, within ten it does not
    _, _, bench, _ = drawn(33275, "s7-200-pid")
    told = opinion(library, bench, LIMITS, longer=0.0)
    value, limit = told.values["recovery_time"]
    assert value > limit
