"""Words called scan by scan, against the proof's closed loop, which runs the same controllers in its own kernel."""

import math
from dataclasses import replace

import numpy as np
import pytest

import heatertune as ht
from heatertune.errors import InputError, OutOfRange, UnknownName
from heatertune.plc import TARGETS, controller_for
from heatertune.plc.ramp import Ramp, next_setpoint
from heatertune.proof.loop import simulate
from heatertune.proof.scenario import Mains, NewSetpoint

HEATER = ht.Fopdt(gain_degC_per_pct=0.37, time_constant_s=167.0, dead_time_s=12.0, ambient_degC=22.0)
SCENARIO = ht.Scenario(setpoint_degC=45.0, duration_s=400.0, noise_degC=0.05, seed=3)


def words_of(target):
    ta = controller_for(target).timer.round(2.0)  # a printer's has one interval
    design = ht.tune(ht.model_by_hand(HEATER), target=target, method="simc", sample_time_s=ta)
    return ht.encode(design, target)


def loop(words, **switches):
    """Return the trace of the closed loop, whose scan k sees temperature and noise k."""
    actuator = ht.Actuator(pwm_period_s=words.sample_time_s)
    return simulate(controller_for(words.target), words, HEATER, SCENARIO, actuator, switches)


def readings(trace):
    noise = np.random.default_rng(SCENARIO.seed).normal(0.0, SCENARIO.noise_degC, len(trace.time_s))
    return trace.temperature_degC + noise


@pytest.mark.parametrize("target", TARGETS)
def test_called_scan_by_scan_it_asks_for_what_it_asks_for_in_the_closed_loop(target):
    words = words_of(target)
    trace, c = loop(words), words.controller()
    assert c.scan_s == pytest.approx(trace.time_s[1])
    powers, asked, flags = [], [], []
    for reading in readings(trace).tolist():
        powers.append(c(reading, 45.0))
        asked.append(c.scan.power_pct)
        flags.append(c.flags)
    assert asked == trace.power_asked_pct.tolist()
    per_period = 1 if c.pwm_period_s is None else round(c.pwm_period_s / c.scan_s)
    assert powers == [asked[k - k % per_period] for k in range(len(asked))]
    assert {name: sum(scan[name] for scan in flags) for name in trace.flags} == trace.flags


def test_a_switch_is_given_by_name():
    words = words_of("weg")
    trace = loop(words, anti_windup="none")
    c = words.controller(anti_windup="none")
    assert [c(reading, 45.0) for reading in readings(trace)] == trace.power_asked_pct.tolist()
    with pytest.raises(UnknownName, match="colour"):
        words.controller(colour="red")


def test_a_setpoint_ramp_is_followed_from_the_first_reading_on():
    words = replace(words_of("s5-ob251"), ramp=Ramp(step=3, calls=2))
    trace, c = loop(words), words.controller()
    assert trace.followed_degC[0] < 23.0
    assert [c(reading, 45.0) for reading in readings(trace)] == trace.power_asked_pct.tolist()
    with pytest.raises(OutOfRange, match="ramp step"):
        replace(words, ramp=Ramp(step=30000)).controller()


@pytest.mark.long
@pytest.mark.parametrize(("target", "ramp"), [
    ("s5-ob251", Ramp(step=11, calls=2, hold=30)), ("weg", Ramp(step=0.5, hold=1.5)), ("s7-200", Ramp(step=2, hold=3)),
    ("s5-ob251", Ramp(step=11, calls=2, hold=-30)), ("weg", Ramp(step=0.5, hold=-1.5)),
])
def test_a_held_ramp_is_that_of_the_proof_compiled_and_plain(target, ramp, monkeypatch):
    words, room = replace(words_of(target), ramp=ramp), controller_for(target)
    opened = replace(SCENARIO, noise_degC=0.3, disturbances=(
        Mains(time_s=150.0, share=0.0), Mains(time_s=220.0, share=1.0), NewSetpoint(time_s=300.0, setpoint_degC=33.0)))
    unit = 100.0 / (room.measure(words, 100.0) - room.measure(words, 0.0))
    for compiles in (True, False):
        monkeypatch.setattr("heatertune.proof.loop.worth_compiling", lambda *_, compiles=compiles, **__: compiles)
        trace = simulate(room, words, HEATER, opened, ht.Actuator(pwm_period_s=2.0))
        asked = [room.measure(words, 45.0 if t < 300.0 else 33.0) for t in trace.time_s]
        seen, led = [], None
        rows = [round(each / unit) if unit < 1.0 else float(np.float32(each)) for each in trace.reading_degC]
        for call, (reading, end) in enumerate(zip(rows, asked, strict=True), start=1):
            led = next_setpoint(reading if led is None else led, end, ramp, reading, due=call % ramp.calls == 0)
            seen.append(led)
        assert trace.followed_degC == pytest.approx(np.array(seen) * unit, abs=1e-9)
        # the sum is a single, whose last digit is 3.8e-6 here
        beyond = (trace.followed_degC - trace.reading_degC) * (-1.0 if ramp.cools else 1.0)
        assert beyond.max() <= abs(ramp.hold) * unit + 3.8e-6


def test_the_setpoint_stays_until_another_one_comes_and_a_reset_begins_anew():
    words = words_of("s5-ob251")
    c, other = words.controller(), words.controller()
    assert c.flags == {}
    first = [c(30.0, 45.0), c(31.0), c(32.0, 50.0), c(33.0)]
    assert first == [other(30.0, 45.0), other(31.0, 45.0), other(32.0, 50.0), other(33.0, 50.0)]
    c.reset()
    assert c.scan is None
    with pytest.raises(InputError, match="needs a setpoint"):
        c(30.0)
    assert [c(30.0, 45.0), c(31.0), c(32.0, 50.0), c(33.0)] == first


@pytest.mark.parametrize("wrong", [math.nan, math.inf, np.float32("nan")])
def test_what_is_no_temperature_is_refused_and_leaves_the_controller_as_it_was(wrong):
    words = words_of("weg")
    c, other = words.controller(), words.controller()
    assert c(30.0, 45.0) == other(30.0, 45.0)
    with pytest.raises(OutOfRange, match="reading_degC"):
        c(wrong)
    with pytest.raises(OutOfRange, match="setpoint_degC"):
        c(30.0, wrong)
    assert c(30.5) == other(30.5)
