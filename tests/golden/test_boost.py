"""A boost: what the exported program does with it, in the tests' own machine for structured text, is what the proof runs.

Of WEG's block the manual (WPS help, PID) says what a boost rests on: with EN FALSE Output remains unchanged, at EN's positive
edge Output is zero. The integral part begins at zero with it, as with a cold start.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from tests.plc.st_machine import Program

from heatertune.errors import InputError, OutOfRange
from heatertune.model.model_values import Fopdt
from heatertune.pid.design_values import PidDesign
from heatertune.plc import Boost, Certificate, Ramp, Scaling, controller_for
from heatertune.plc.pwm import Actuator
from heatertune.plc.replay import replay
from heatertune.proof import Scenario, TemperatureStep, simulate
from heatertune.proof.scenario import Mains, NewSetpoint, PlcPower
from heatertune.proof.text_comparison import compare_text

ROOM = controller_for("weg")
HEATER = Fopdt(gain_degC_per_pct=0.9, time_constant_s=40.0, dead_time_s=3.0, ambient_degC=20.0)
BOOST = Boost(within_degC=12.5, again_degC=18.75)
STORY = Scenario(setpoint_degC=70.0, duration_s=1000.0, disturbances=(
    NewSetpoint(time_s=200.0, setpoint_degC=40.0), NewSetpoint(time_s=300.0, setpoint_degC=70.0),
    TemperatureStep(time_s=450.0, temperature_degC=-16.0), Mains(time_s=550.0, share=0.0), Mains(time_s=700.0, share=1.0),
    PlcPower(time_s=850.0, on=False), PlcPower(time_s=880.0, on=True)))


def _words(boost=BOOST, **changed):
    design = PidDesign(gain_pct_per_degC=4.0, integral_time_s=22.0, derivative_time_s=0.0, sample_time_s=1.0, structure="pi",
                       method="")
    words = ROOM.encode(design, Scaling(low_degC=0.0, high_degC=150.0))
    return replace(words, values=dict(words.values) | changed, boost=boost)


def _began(trace):
    """When the program took the heater back [s]."""
    full = trace.power_asked_pct >= 100.0
    return trace.time_s[1:][np.diff(full.astype(int)) == 1].tolist()


def test_a_boost_is_full_power_until_near_and_then_a_cold_start():
    # 0.9 °C/%, 40 s: at full power it is 57.5 °C, 12.5 °C below the setpoint, after 3 + 40·ln(90/52.5) = 24.6 s
    trace = simulate(ROOM, _words(), HEATER, replace(STORY, duration_s=100.0, disturbances=()), Actuator(pwm_period_s=1.0))
    assert trace.power_asked_pct[:25].tolist() == [100.0] * 25
    assert trace.power_asked_pct[25:27].tolist() == [0.0, pytest.approx(4.0 * (70.0 - trace.reading_degC[26]), rel=0.05)]
    error = 70.0 - trace.reading_degC[26:30]
    integral = np.concatenate([[0.0], np.cumsum(error[:-1])]) / 22.0  # from the first call that computes on
    assert trace.power_asked_pct[26:30] == pytest.approx(4.0 * (error + integral + error / 22.0), rel=1e-3)


@pytest.mark.parametrize("target", ["iec-pid", "arduino-pid", "simple-pid", "esphome"])
def test_every_boost_is_full_power_until_near_and_then_nothing_summed_up(target):
    # as above; what begins there is each one's own first call with an empty I part, of which the last one of the boost is no part
    which, story = controller_for(target), replace(STORY, duration_s=100.0, disturbances=())
    design = PidDesign(gain_pct_per_degC=4.0, integral_time_s=22.0, derivative_time_s=0.0, sample_time_s=1.0, structure="pi", method="")
    words = which.encode(design, Scaling(low_degC=0.0, high_degC=150.0)).with_boost(BOOST)
    trace = simulate(which, words, HEATER, story, Actuator(pwm_period_s=1.0))
    assert trace.power_asked_pct[:25].tolist() == [100.0] * 25
    error = 70.0 - trace.reading_degC[25:30]
    assert trace.power_asked_pct[25:30] == pytest.approx(4.0 * (error + np.cumsum(error) / 22.0), rel=2e-3)


@pytest.mark.parametrize(("switches", "changed"), [
    ({}, {}), ({"edge": "runs_at_once", "history": "zero"}, {"MaximumOutput": 70.0, "MinimumOutput": 5.0, "TauSetPoint": 3.0}),
    ({"sampling": "block"}, {}), ({"sampling": "skipped"}, {}),
])
def test_the_exported_text_does_it_as_proven_in_each_part_of_a_story(switches, changed):
    words = _words(**changed)
    trace = simulate(ROOM, words, HEATER, STORY, Actuator(pwm_period_s=1.0, resolution_s=0.1), switches)
    assert compare_text(ROOM, words, trace, switches).departs is None
    # a step of 16 °C is less than 18.75 °C: the controller keeps the heater; setpoint up by 30 °C, circuit, restart: not
    most = changed.get("MaximumOutput", 100.0)
    boosted = [bool(np.any(trace.power_asked_pct[(trace.time_s >= at) & (trace.time_s < at + 5.0)] == most))
               for at in (300.0, 640.0, 880.0)]
    assert boosted == [True] * 3
    assert len(set(trace.power_asked_pct.tolist())) > 100


def _rows(rng, count):
    """Inputs, one reading in ten any number at all: infinite, huge, none."""
    usual, odd = rng.uniform(20.0, 80.0, count), rng.choice([math.nan, math.inf, -math.inf, 3e38, -3e38], count)
    readings = np.where(rng.random(count) < 0.9, usual, odd).astype(np.float32)
    setpoints = rng.choice([40.0, 60.0, 75.0], count).astype(np.float32)
    by_hand, on = rng.random(count) < 0.15, rng.random(count) < 0.9
    return list(zip(setpoints.tolist(), readings.tolist(), by_hand.tolist(), on.tolist(), strict=True))


@pytest.mark.parametrize("changed", [{}, {"Action": 1, "MaximumOutput": 80.0}], ids=["heater", "cooler"])
def test_whatever_it_reads_the_program_does_what_the_proof_does(changed):
    # tree-sitter's tree of the text, run by the tests' machine, against the kernel's step: second implementations
    words = _words(**changed)
    text = ROOM.export(words, Certificate(verdict="PASS"))["weg_pid_block.st"]
    rng, found, wanted, boosted = np.random.default_rng(5), [], [], 0
    for _ in range(12):
        program, rows = Program(text), _rows(rng, 40)
        scans = replay(ROOM, words, [
            {"SetPoint": sp, "Feedback": pv, "ManualSetPoint": 33.0, "SelectSetPoint": hand, "EN": on} for sp, pv, hand, on in rows])
        for (sp, pv, hand, on), scan in zip(rows, scans, strict=True):
            after = program.call(HeaterOn=on, ByHand=hand, HandPower=np.float32(33.0), HeaterSetPoint=np.float32(sp),
                                 HeaterTemperature=np.float32(pv), ScanMs=1000)
            found.append(float(after.HeaterPower))
            wanted.append(scan.output if on else 0.0)
            boosted += on and bool(after.HeaterBoost)
    assert found == wanted
    assert 40 < boosted < 400
    assert wanted.count(33.0) > 20


def _ways(noise_degC, boost):
    """How often full power begins in a heat-up and its rest."""
    scenario = Scenario(setpoint_degC=70.0, duration_s=400.0, noise_degC=noise_degC)
    trace = simulate(ROOM, _words(boost), HEATER, scenario, Actuator(pwm_period_s=1.0))
    return 1 + len(_began(trace))


def test_noise_at_the_threshold_does_not_chatter():
    # six standard deviations between the distances, as heatertune chooses them: one way up. With nothing between, many
    assert _ways(3.0, Boost(within_degC=12.5, again_degC=30.5)) == 1
    assert _ways(3.0, Boost(within_degC=12.5, again_degC=float(np.nextafter(np.float32(12.5), np.float32(13.0))))) > 1


@pytest.mark.parametrize(("within", "again", "told"), [
    (0.0, 1.0, "boost within_degC = 0"), (5.0, 5.0, "boost again_degC = 5"), (math.nan, 5.0, "boost within_degC = nan"),
    (0.1, 5.0, "boost within_degC = 0.1"), (5.0, math.inf, "boost again_degC = inf"),
])
def test_distances_that_make_no_boost_are_refused(within, again, told):
    with pytest.raises(OutOfRange, match=told):
        Boost(within_degC=within, again_degC=again)


def test_words_have_a_ramp_or_a_boost_where_their_controller_has_one():
    with pytest.raises(InputError, match="one of them"):
        replace(_words(), ramp=Ramp(step=0.5))
    other = controller_for("s7-300")
    words = other.encode(PidDesign(gain_pct_per_degC=4.0, integral_time_s=22.0, derivative_time_s=0.0, sample_time_s=1.0,
                                   structure="pi", method=""), Scaling())
    with pytest.raises(InputError, match="s7-300 has no boost"):
        replace(words, boost=BOOST).controller()
