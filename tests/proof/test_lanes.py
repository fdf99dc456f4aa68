"""Loops side by side against the same loops one after the other, bit for bit; and that they are vector instructions."""

import re
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from llvmlite.binding import get_host_cpu_features, llvm_version_info

from heatertune.compiled import bound, compile_function
from heatertune.compiled import dispatch as machine
from heatertune.compiled.numba_compiler import overload
from heatertune.model.model_values import Fopdt, TwoLag, model_by_hand
from heatertune.pid.design_values import PidDesign
from heatertune.plc import TARGETS, Scaling, controller_for
from heatertune.plc.core import as_it_is
from heatertune.proof import Actuator, Load, LoopLimits, Mains, NewSetpoint, Scenario, TemperatureStep
from heatertune.proof.lanes import choice
from heatertune.proof.lanes import passes as one
from heatertune.proof.lanes import two_lags as two
from heatertune.proof.lanes.choice import fits
from heatertune.proof.lanes.passes import LANES, PhaseLimits, constant_function, rows_of
from heatertune.proof.monte_carlo.draw import BLOCK, SampleRequest, SampleSpread, _all_drawn, _parts, measure, parts
from heatertune.proof.monte_carlo.run import drawing_for
from heatertune.proof.scenario import PlcPower, SetpointRampEvent
from heatertune.settings import Conditions

HEATER = Fopdt(gain_degC_per_pct=0.41, time_constant_s=166.0, dead_time_s=14.3, ambient_degC=24.0)
TWO_LAGS = TwoLag(gain_degC_per_pct=0.5, time_constant_s=120.0, second_time_constant_s=30.0, dead_time_s=6.5, ambient_degC=20.0)
SCENARIO = Scenario(
    setpoint_degC=50.0, duration_s=1500.0, noise_degC=0.05,
    disturbances=(TemperatureStep(time_s=700.3, temperature_degC=-8.8), Load(time_s=900.0, power_pct=-7.0),
                  NewSetpoint(time_s=1100.0, setpoint_degC=55.0), Mains(time_s=1300.0, share=0.9)),
)
RESTARTS = replace(SCENARIO, duration_s=2000.0, disturbances=(
    *SCENARIO.disturbances, PlcPower(time_s=1401.0, on=False), PlcPower(time_s=1409.0, on=True),  # its pulses are still under way
    Load(time_s=1500.0, power_pct=5.0), PlcPower(time_s=1600.0, on=False), PlcPower(time_s=1800.0, on=True)))
SPREAD = SampleSpread(heater=(0.1, 0.1, 4.0))
PWM = Actuator(pwm_period_s=10.0)
PI = PidDesign(gain_pct_per_degC=1.4, integral_time_s=150.0, derivative_time_s=4.0, sample_time_s=2.0, structure="pid",
               method="")
ALONE = ("s7-200", "s7-200-paper", "s7-200-pid")
ROOMS = [name for name in TARGETS if controller_for(name).core.own is as_it_is]


def drawing_of(target, scenario=SCENARIO, heaters=(HEATER, TWO_LAGS), actuator=PWM, ramp=None):
    which = controller_for(target)
    words = which.encode(replace(PI, sample_time_s=which.timer.round(PI.sample_time_s)), Scaling())
    words = words if ramp is None else replace(words, ramp=which.ramp(words, ramp))
    settings = {each.name: each.default for each in which.switches}
    return SampleRequest.of(which, words, heaters, scenario, SPREAD, actuator, settings)


def ran(drawing, monkeypatch, *, side_by_side, compile_at_once=True, count=70):
    monkeypatch.setattr(machine, "_PLAIN_SCANS", -1 if compile_at_once else 10**12)
    monkeypatch.setattr("heatertune.proof.monte_carlo.draw.pays", lambda *_, **__: side_by_side)
    return measure(drawing, LoopLimits(), count, workers=1)


def same(one, other, count=None):
    for name in ("rows", "table", "totals", "ripple"):
        assert np.array_equal(getattr(one, name)[:count], getattr(other, name)[:count], equal_nan=True), name


@pytest.mark.long
@pytest.mark.parametrize("target", ROOMS)
def test_loops_side_by_side_are_those_one_after_the_other_bit_for_bit(target, monkeypatch):
    heaters = (HEATER,) if target != "weg" else (HEATER, TWO_LAGS)  # a second lag is nothing to a controller
    drawing = drawing_of(target, replace(RESTARTS, noise_degC=0.0), heaters)
    together = ran(drawing, monkeypatch, side_by_side=True)
    same(together, ran(drawing, monkeypatch, side_by_side=False))
    same(together, ran(drawing, monkeypatch, side_by_side=False, compile_at_once=False, count=3), 3)


@pytest.mark.long
@pytest.mark.parametrize(("scenario", "actuator", "ramp"), [
    (SCENARIO, PWM, None),
    (replace(SCENARIO, noise_degC=1.0), replace(PWM, minimum_on_s=0.3, minimum_off_s=0.3, minimum_rule="carry"), 2.0),
    (SCENARIO, replace(PWM, pwm_period_s=7.3, resolution_s=0.1), None),  # periods begin between two scans
    (replace(SCENARIO, disturbances=(), duration_s=600.0), Actuator(pwm_period_s=0.7), None),  # deep dead times
    (RESTARTS, replace(PWM, pwm_period_s=7.3, resolution_s=0.1), 2.0),
], ids=["noise", "minimum times and a ramp", "other period", "deep", "restarts"])
def test_whatever_is_measured_is_the_same(scenario, actuator, ramp, monkeypatch):
    drawing = drawing_of("s5-ob251", scenario, actuator=actuator, ramp=ramp)
    same(ran(drawing, monkeypatch, side_by_side=True), ran(drawing, monkeypatch, side_by_side=False))


def test_loops_that_do_not_fit_are_left_to_the_kernel():
    controller = drawing_of("s5-ob251").controllers[0]
    calm, late = np.zeros((1, 1)), np.full((1, 1), 0.1)
    assert fits(controller, SCENARIO, PWM, calm)
    assert not fits(controller, SCENARIO, PWM, late)
    assert not fits(controller, SCENARIO, replace(PWM, cooling_gain=1.0), calm)
    led = replace(SCENARIO, disturbances=(SetpointRampEvent(time_s=9.0, from_degC=50.0, setpoint_degC=60.0, duration_s=60.0),))
    assert not fits(controller, led, PWM, calm)
    assert not fits(drawing_of("s7-200-paper").controllers[0], SCENARIO, PWM, calm), "its state is the PLC's memory"


def default_drawing(target):
    """Return what `--samples` draws around a plausible heater of one lag and one of two, with the whole story."""
    which = controller_for(target)
    fitted = replace(model_by_hand(HEATER), candidates=(*model_by_hand(HEATER).candidates, *model_by_hand(TWO_LAGS).candidates))
    taken = which.timer.round(PI.sample_time_s)
    words = which.encode(replace(PI, sample_time_s=taken, integral_time_s=taken * round(150.0 / taken)), Scaling())
    return replace(drawing_for(words, fitted, {}, Conditions(setpoint_degC=45.0)), spread=SPREAD)


@pytest.mark.parametrize("target", TARGETS)
def test_samples_of_a_default_proof_run_side_by_side(target, monkeypatch):
    """But for rooms whose state is a PLC's memory, or that compile not at all, and the last few of a group."""
    monkeypatch.setattr("heatertune.proof.monte_carlo.draw.pays", lambda *_, **__: True)
    drawing, count = default_drawing(target), 2000
    assert {type(event) for event in drawing.scenario.disturbances} >= {PlcPower, Mains, NewSetpoint, Load, TemperatureStep}
    seeds = range(count)
    parts = _parts(drawing, drawing.heaters_of(seeds)[0], 1)
    assert sorted(np.concatenate([part.places for part in parts])) == list(seeds)
    alone = [part for part in parts if not part.side_by_side]
    if target in ALONE:
        assert len(alone) == len(parts)
    else:
        assert all(len(part.places) < 5 for part in alone)
        assert len(alone) <= 2, "one for each number of lags at most"


@pytest.mark.parametrize("count", [1, 7, 8, 9, 23, 33])
def test_few_loops_side_by_side_are_the_same(count, monkeypatch):
    """They are run in steps of eight, the last one again where there are fewer."""
    drawing = drawing_of("s5-ob251", replace(RESTARTS, noise_degC=0.1), (TWO_LAGS,))
    monkeypatch.setattr("heatertune.proof.monte_carlo.draw._LEAST", 1)
    same(*(ran(drawing, monkeypatch, side_by_side=way, count=count) for way in (True, False)))


@pytest.mark.long
@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_a_default_proof_finds_the_same_side_by_side(noise, monkeypatch):
    drawing = default_drawing("s5-ob251")
    drawing = replace(drawing, scenario=replace(drawing.scenario, noise_degC=noise), controllers=drawing.controllers[:1])
    same(*(ran(drawing, monkeypatch, side_by_side=way, count=80) for way in (True, False)))


def test_an_order_of_heaters_brings_those_together_that_are_switched_at_like_instants():
    """64 heaters that rise at one of two instants and fall after one of two: all of a group do both in the same scan."""
    chance = np.random.default_rng(0)
    dead, gain = np.repeat([9.0, 12.0], 64), np.tile([0.5, 1.0], 64)
    rows = np.column_stack([gain, *np.ones((2, 128)), dead, np.full(128, 20.0), np.ones(128)])[chance.permutation(128)]
    order = choice.order_by_edges(rows, 50.0, 10.0)  # on for 6 s or 3 s, at 0.5 °C/% or 1 °C/%: both instants lie 3 s apart
    assert sorted(order) == list(range(128))
    assert {len(np.unique(group[:, [0, 3]], axis=0)) for group in rows[order].reshape(4, LANES, 6)} == {1}
    assert choice.order_by_edges(rows[:1], 50.0, 10.0).tolist() == [0]
    rows[:, 0] = 1.0  # all alike but for dead times: by these alone
    assert np.all(np.diff(rows[choice.order_by_edges(rows, 50.0, 10.0), 3]) >= 0.0)


def test_only_work_that_pays_for_the_compiler_is_done_side_by_side(monkeypatch):
    controller = drawing_of("s5-ob251").controllers[0]
    monkeypatch.setattr(choice, "_asked", Counter())
    monkeypatch.setattr(machine, "has_machine_code", lambda _: False)

    def pays(scans):
        return choice.pays(controller, PWM, scans, two_lags=False)

    assert [pays(scans) for scans in (10**6, 10**9, 0)] == [False, True, True]
    choice._asked.clear()
    assert sum(not pays(10**7) for _ in range(20)) in range(3, 10), "many small works are a large one"
    choice._asked.clear()
    monkeypatch.setattr(machine, "has_machine_code", lambda _: True)
    assert [pays(scans) for scans in (10**5, 10**6)] == [False, True], "what is kept need only be loaded"
    monkeypatch.setattr(machine, "_decided", [False])
    assert not pays(10**9)


VECTORS = pytest.mark.skipif(llvm_version_info[0] < 22 or not get_host_cpu_features().get("avx2"),
                    reason="an older compiler leaves some of it one by one, and another processor was not tried: the results are the same")


def operations(function, *given):
    """Return how many sums and products the compiler left alone, and how many it made vectors of."""
    text = overload(function, given).library.get_llvm_str()
    return [len(re.findall(rf"= f(?:mul|add|sub|div) {kind}", text)) for kind in ("(?:float|double)", r"<\d+ x")]


def all_of_them(_rows):
    return LANES


@VECTORS
@pytest.mark.parametrize("part", [one._to_edges, two._to_edges, two._to_turns, two._search_crossings], ids=["one lag", "edges", "turns", "search"])
def test_what_each_heater_does_is_vector_instructions(part):
    held = PhaseLimits(50.0, 1.0, False, 0.0, 1.0, np.zeros((1, 1)), np.zeros((1, 1)), 0)
    given = np.zeros(choice.ROWS * LANES), *{one._to_edges: (held, 1.0), two._to_turns: ()}.get(part, (1.0,))
    alone, together = operations(bound(part, lanes_of=all_of_them), *given)
    assert alone == 0 < together
    _, together = operations(part, *given)  # of a number that is not known, 512 bits leave a rest one by one that never is
    assert together > 0


@VECTORS
def test_noise_is_drawn_by_vector_instructions():
    alone, together = operations(_all_drawn, np.zeros((2, 300)), np.zeros(BLOCK), parts([1, 2]), 0.1)
    assert alone == 0 < together


@pytest.mark.long
@VECTORS
@pytest.mark.parametrize("target", ["s5-ob251", "weg"])
def test_the_scan_of_all_controllers_is_vector_instructions(target, monkeypatch):
    """A change that looks harmless can make a compiler give up: the results stay right, and take twice the time."""
    controller = drawing_of(target).controllers[0]
    parts = []
    monkeypatch.setattr(choice, "bound", lambda function, **given: parts.append((function, given)) or bound(function, **given))
    choice._loop_and_rows(controller, two_lags=False)
    scan = bound(parts[1][0], **parts[1][1])
    state, program, parameters = (
        choice._in_precision(controller, each) for each in (controller.state, choice.SetpointProgram(
            np.array(controller.setpoints), np.ones(1, dtype=np.int64), controller.ramp_step, 0, controller.ramp_hold), controller.parameters))
    end = rows_of((state, program.setpoints[0].item()), choice.ROWS).end
    alone, together = operations(scan, np.zeros(end * LANES), parameters, controller.sensor, program, program.setpoints[0], 1, True, 3)
    assert alone <= 2 < together, "but for products of parameters, made once"


def test_a_tuple_is_held_in_rows_as_it_is():
    value = (3, (True, -2.5, np.float32(0.1)), -(2**62))
    rows = rows_of(value, first=2)
    places = np.zeros(7 * LANES)
    compile_function(rows.stored)(places, 5, value)
    assert compile_function(rows.loaded)(places, 5) == value
    assert rows.end == 7
    assert np.flatnonzero(places).tolist() == [LANES * row + 5 for row in range(2, 7)]
    with pytest.raises(TypeError, match="value\\[0\\] is of type ndarray"):
        rows_of((np.zeros(2),))
    assert constant_function((1.0, (float("inf"), -np.inf)))((2.0, (3.0, 4.0))) == (2.0, (np.inf, -np.inf))
