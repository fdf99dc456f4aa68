"""Proofs judge runs by the kernel's meter; here by the traces of the same runs, which a second program measures.

The trace of a room that has a listing is of the listing, step by step; the meter runs the direct form.
"""

import random
from dataclasses import replace

import numpy as np
import pytest
from tests.witness.trace_measures import judge

from heatertune.errors import NotRepresentable
from heatertune.model.model_values import Fopdt, TwoLag
from heatertune.pid.design_values import PidDesign
from heatertune.plc import TARGETS, Scaling, controller_for
from heatertune.proof import (
    Acceptance,
    Actuator,
    Interlock,
    Load,
    LoopLimits,
    Scenario,
    TemperatureStep,
    paper_scenario,
    prove_models,
    runs,
    simulate,
)
from heatertune.proof.criteria import CriterionColumn, columns_of
from heatertune.proof.loop import in_loop
from heatertune.proof.meter import COLUMNS, HIGHEST, LOWEST, SETTLED, TOTALS, begin, is_led, no_meter
from heatertune.proof.phase_statistics import CriterionTable
from heatertune.proof.runs import measure_runs
from heatertune.proof.scenario import NewSetpoint, SetpointRampEvent, delay_heater, phases_of

#: between both ways: they add up in another order and take exponentials over other times
NEAR = {"rel": 1e-9, "abs": 1e-9}


def heaters(chance, count):
    """Heaters of one, two and equal lags, some sampled far slower than they are."""
    made = []
    for number in range(count):
        first = chance.uniform(10.0, 150.0)
        given = {"gain_degC_per_pct": chance.uniform(0.4, 1.2), "time_constant_s": first, "ambient_degC": 20.0,
                 "dead_time_s": chance.choice([0.0, 2.0, chance.uniform(0.5, 25.0)])}
        second = first if chance.random() < 0.2 else first * chance.uniform(0.02, 0.9)
        model = Fopdt(**given) if chance.random() < 0.5 else TwoLag(**given, second_time_constant_s=second)
        made.append((f"heater {number}", model))
    return made


def conditions(chance):
    """A scenario, a switch and limits."""
    end = chance.choice([240.0, 300.0, 301.3])
    shaken = [TemperatureStep(time_s=end * 0.5, temperature_degC=chance.uniform(-9.0, 5.0)),
              Load(time_s=end * chance.uniform(0.6, 0.95), power_pct=chance.uniform(-15.0, 15.0))]
    scenario = Scenario(
        setpoint_degC=chance.uniform(35.0, 55.0), duration_s=end, noise_degC=chance.choice([0.0, 0.3]),
        seed=chance.randrange(9), disturbances=tuple(each for each in shaken if chance.random() < 0.6),
        start_degC=chance.choice([None, 30.0]),
    )
    limits = LoopLimits(
        tolerance_degC=chance.choice([0.3, 1.0, 5.0]), settling_s=chance.choice([None, 90.0]),
        recovery_s=chance.choice([None, 40.0]), steady_share=chance.choice([0.05, 0.2, 1.0]),
        pwm_ripple_degC=chance.choice([None, 0.2]), deviation_degC=chance.choice([None, 4.0]), switchings_per_h=300.0,
        overflow_flags=("SM1.1", "SM1.3", "overflow", chance.choice(["upper limit", "lower limit"]), "QLMN_LLM"),
    )
    return scenario, Actuator(pwm_period_s=chance.choice([1.0, 2.0, 7.0])), limits


def words_of(target, chance):
    """Words from sluggish to unstable, some with a setpoint ramp."""
    which = controller_for(target)
    while True:
        design = PidDesign(
            gain_pct_per_degC=chance.uniform(0.5, 9.0), integral_time_s=chance.uniform(20.0, 200.0),
            derivative_time_s=0.0, sample_time_s=which.timer.round(2.0), structure="pi", method="")
        try:
            words = which.encode(design, Scaling())
        except NotRepresentable:
            continue
        return replace(words, ramp=which.ramp(words, 20.0)) if which.has_ramp and chance.random() < 0.3 else words


def drawn(target, seed):
    """What a proof is given: room, words, models, scenario, switch and limits."""
    chance = random.Random(seed)
    return controller_for(target), words_of(target, chance), heaters(chance, 2), *conditions(chance)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("target", TARGETS)
def test_a_run_is_judged_by_the_meter_as_by_its_trace(target, seed):
    which, words, models, scenario, actuator, limits = drawn(target, seed)
    for run in prove_models(which, words, models, scenario, actuator, Acceptance(limits=limits)).runs:
        trace = simulate(which, words, delay_heater(dict(models)[run.model], which.delay_s), scenario, actuator, run.switches)
        own = judge(trace, limits, where=run.label)
        for measured, traced in zip(run.criteria, own, strict=False):  # the last, the step's power, is of the words alone
            assert measured.value == pytest.approx(traced.value, **NEAR), (run.label, measured.name)
            assert measured.ok == traced.ok, (run.label, measured.name, measured.value, measured.limit)
            assert measured.limit == (None if traced.limit is None else pytest.approx(traced.limit))
            assert replace(measured, value=0.0, limit=0.0) == replace(traced, value=0.0, limit=0.0)
        assert [each.name for each in run.criteria[len(own) :]] == ([] if which.decode(words) is None else ["step_power"])


def test_traces_are_run_when_they_are_asked_for(monkeypatch):
    asked, run = [], runs.simulate
    monkeypatch.setattr(runs, "simulate", lambda *given, **how: asked.append(given[5]) or run(*given, **how))
    which, chance = controller_for("weg"), random.Random(1)
    scenario, actuator, limits = conditions(chance)
    proof = prove_models(which, words_of("weg", chance), heaters(chance, 2), scenario, actuator, Acceptance(limits=limits))
    assert proof.to_document()["scenario"]["duration_s"] == scenario.duration_s
    assert asked == []
    assert proof.nominal is proof.nominal
    assert asked == [proof.runs[0].switches]
    worst = max(proof.runs, key=lambda each: each.strains)
    assert proof.worst.switches == worst.switches


@pytest.mark.parametrize("late", [False, True])  # the worst run is the first one, or another
def test_a_listing_that_fails_fails_the_proof_whatever_its_direct_form_does(tenths, words, heater, late):
    models = [("best", heater), ("late", replace(heater, dead_time_s=40.0))][: 1 + late]
    core, running = tenths.core, tenths.start(words(), {})
    listing = replace(tenths, direct=lambda *_: (core, running), overflows_above=545 if late else 530)
    paper, actuator = paper_scenario(duration_s=3000.0), Actuator(pwm_period_s=10.0)
    assert prove_models(tenths, words(), models, paper, actuator).verdict == "PASS"
    proof = prove_models(listing, words(), models, paper, actuator)
    assert [each.name for each in proof.criteria if not each.ok] == ["overflow"]
    assert [run.verdict for run in proof.runs] == (["PASS", "FAIL"] if late else ["FAIL"])


def test_a_run_behind_an_interlock_is_measured_up_to_its_end():
    which, chance = controller_for("s5-ob251"), random.Random(3)
    scenario, actuator, limits = conditions(chance)
    words, models = words_of("s5-ob251", chance), heaters(chance, 2)
    watch = Interlock(name="heater-fan", limit_degC=scenario.setpoint_degC - 5.0)
    proof = prove_models(which, words, models, scenario, actuator, Acceptance(limits=limits), interlock=watch)
    for run in proof.runs:
        heater = delay_heater(dict(models)[run.model], which.delay_s)
        trace = simulate(which, words, heater, scenario, actuator, run.switches, watch, limits=limits)
        assert np.isfinite(trace.cut_s)
        assert run.criteria[:-1] == tuple(replace(each, where=run.label) for each in trace.criteria)
        for measured, traced in zip(trace.criteria, judge(trace, limits), strict=True):
            assert (measured.name, measured.value, measured.ok) == (traced.name, pytest.approx(traced.value, **NEAR), traced.ok)


def test_a_trace_is_the_same_bit_for_bit_whether_it_is_measured_or_not():
    which, words, models, scenario, actuator, _ = drawn("weg", 5)
    limits = LoopLimits()
    free, measured = (simulate(which, words, models[0][1], scenario, actuator, limits=each) for each in (None, limits))
    assert free.criteria == ()
    assert [each.name for each in measured.criteria] == [each.name for each in judge(measured, limits)]
    for name in ("temperature_degC", "reading_degC", "power_asked_pct", "edge_time_s", "stretches"):
        np.testing.assert_array_equal(getattr(free, name), getattr(measured, name))


def test_each_loop_is_held_against_the_disturbance_that_uses_most_of_its_time():
    # 20 s of the 60 s between the jumps and 15 s of the last 30 s; 50 s of 60 s and 3 s of 30 s
    scenario = Scenario(setpoint_degC=50.0, duration_s=190.0, disturbances=(
        TemperatureStep(time_s=100.0, temperature_degC=-5.0), TemperatureStep(time_s=160.0, temperature_degC=-5.0)))
    table = np.zeros((2, 3, COLUMNS))
    table[:, :, SETTLED] = [[0.0, 120.0, 175.0], [0.0, 150.0, 163.0]]
    measured = CriterionTable(
        scenario=scenario, period_s=1.0, band_degC=1.0, phases=phases_of(scenario, 190.0, 80.0), rows=np.ones((2, 6)), table=table,
        totals=np.zeros((2, TOTALS)), ripple=np.zeros(2))
    column = next(each for each in columns_of(measured, LoopLimits()) if each.name == "recovery_time")
    assert [(each.value, each.limit) for each in column.criteria("ab")] == [(15.0, 30.0), (50.0, 60.0)]
    assert column.strains == pytest.approx([15.0 / 30.0, 50.0 / 60.0])


def test_a_ramp_that_stays_below_its_end_goes_beyond_it_by_nothing():
    # up from 50 to 60 °C, then a soak; highest 1 °C and 0.5 °C below the setpoints, or 2 °C above that of the soak: 20 % of 10 °C
    scenario = Scenario(setpoint_degC=50.0, duration_s=300.0, disturbances=(
        SetpointRampEvent(time_s=100.0, from_degC=50.0, setpoint_degC=60.0, duration_s=10.0), SetpointRampEvent(time_s=200.0, from_degC=60.0, setpoint_degC=60.0, duration_s=100.0)))
    table = np.zeros((2, 3, COLUMNS))
    table[:, :, HIGHEST] = [[0.0, -1.0, -0.5], [0.0, -1.0, 2.0]]
    measured = CriterionTable(
        scenario=scenario, period_s=1.0, band_degC=1.0, phases=phases_of(scenario, 300.0, 80.0), rows=np.ones((2, 6)), table=table,
        totals=np.zeros((2, TOTALS)), ripple=np.zeros(2))
    column = next(each for each in columns_of(measured, LoopLimits()) if each.name == "ramp_overshoot")
    assert column.values.tolist() == [0.0, 20.0]


def test_a_small_change_of_the_setpoint_is_judged_by_the_change():
    # 0.5 °C beyond the setpoint after 2 °C down and 2 °C up: 25 % of the change, which are 1.25 % of the 40 °C from 20 to 60 °C
    scenario = Scenario(setpoint_degC=60.0, duration_s=300.0, disturbances=(
        NewSetpoint(time_s=100.0, setpoint_degC=58.0, small=True), NewSetpoint(time_s=200.0, setpoint_degC=60.0, small=True)))
    table, rows = np.zeros((1, 3, COLUMNS)), np.array([[1.0, 100.0, 0.0, 10.0, 20.0, 20.0]])
    table[:, 1, LOWEST], table[:, :, HIGHEST] = -0.25, [0.5, 0.0, 0.5]
    measured = CriterionTable(
        scenario=scenario, period_s=1.0, band_degC=1.0, phases=phases_of(scenario, 300.0, 80.0), rows=rows, table=table,
        totals=np.zeros((1, TOTALS)), ripple=np.zeros(1))
    columns = {each.name: each for each in columns_of(measured, LoopLimits(small_change_overshoot_pct=30.0))}
    assert columns["small_change_overshoot"].values.tolist() == [25.0]
    assert columns["overshoot"].values.tolist() == [1.25]


def test_a_setpoint_moves_where_its_rate_is_not_0():
    # of each phase: begin [s], from [°C], rate [°C/s], duration [s]
    leads = np.array([0.0, 50.0, 0.0, 0.0, 100.0, 50.0, 1.0, 10.0, 200.0, 60.0, -1.0, 10.0])
    assert [bool(is_led(leads, phase)) for phase in range(3)] == [False, True, True]
    assert not is_led(np.empty(0), 0)


def test_a_ramp_begins_without_a_lag_where_the_temperature_is_at_its_begin():
    # the phase's setpoint is the ramp's end, 60 °C: 10 °C below it and 10 s on its way from 50 °C, or 12 °C below it at its begin
    meter = no_meter()._replace(setpoints=np.array([60.0]), leads=np.array([100.0, 50.0, 0.5, 20.0]))
    assert [begin(meter, 0, time, error).lag for time, error in ((100.0, -10.0), (110.0, -10.0), (100.0, -12.0))] == [0.0, 5.0, 2.0]


@pytest.mark.parametrize(("ta_s", "dead_s"), [(2.0, 64.5), (64.0, 2.5)])
def test_all_that_is_switched_within_a_long_dead_time_is_under_way(ta_s, dead_s):
    # 64.5 s and a call of 2 s, or the other way round, the heater switched on and off each second: 133 instants, which the
    # next power of two below does not hold
    which = controller_for("s5-ob251")
    words = which.encode(PidDesign(gain_pct_per_degC=1.0, integral_time_s=400.0, derivative_time_s=0.0, sample_time_s=ta_s, structure="pi",
                                   method=""), Scaling())
    near = Fopdt(gain_degC_per_pct=0.6, time_constant_s=100.0, dead_time_s=2.0, ambient_degC=20.0)
    models = [("near", near), ("far", replace(near, dead_time_s=dead_s - which.delay_s))]
    scenario, actuator, limits = Scenario(setpoint_degC=50.0, duration_s=400.0), Actuator(pwm_period_s=1.0), LoopLimits()
    runs_ = {run.model: run for run in prove_models(which, words, models, scenario, actuator, Acceptance(limits=limits)).runs}
    trace = simulate(which, words, delay_heater(models[1][1], which.delay_s), scenario, actuator, runs_["far"].switches)
    for measured, traced in zip(runs_["far"].criteria, judge(trace, limits), strict=False):
        assert measured.value == pytest.approx(traced.value, **NEAR), measured.name


def test_less_power_lets_a_heater_fall_and_a_cooler_rise():
    scenario = Scenario(setpoint_degC=50.0, duration_s=200.0, disturbances=(Load(time_s=100.0, power_pct=-10.0),))
    table, rows = np.zeros((2, 2, COLUMNS)), np.ones((2, 6))
    table[:, 1, HIGHEST], table[:, 1, LOWEST], rows[1, 0] = 3.0, -4.0, -1.0
    measured = CriterionTable(scenario=scenario, period_s=1.0, band_degC=1.0, phases=phases_of(scenario, 200.0, 80.0), rows=rows, table=table,
                        totals=np.zeros((2, TOTALS)), ripple=np.zeros(2))
    column = next(each for each in columns_of(measured, LoopLimits()) if each.name == "deviation")
    assert column.values.tolist() == [4.0, 3.0]


def test_a_limit_below_1_is_used_by_its_share():
    column = CriterionColumn(name="steady_offset", unit="°C", what="", values=np.array([0.25, 0.5, 1.0, 0.0]), limits=np.full(4, 0.5))
    assert column.strains.tolist() == [0.5, 1.0, 2.0, 0.0]


def test_noise_of_too_few_scans_is_refused():
    which = controller_for("s5-ob251")
    words = which.encode(PidDesign(gain_pct_per_degC=1.0, integral_time_s=400.0, derivative_time_s=0.0, sample_time_s=1.0, structure="pi",
                                   method=""), Scaling())
    scenario, actuator = Scenario(setpoint_degC=50.0, duration_s=100.5), Actuator(pwm_period_s=1.0)
    controller = in_loop(which, words, scenario.setpoints_degC, {})
    rows = np.array([[0.6, 100.0, 0.0, 2.0, 20.0, 20.0]])
    assert measure_runs(controller, rows, scenario, actuator, LoopLimits(), np.zeros((1, 102)), np.zeros((1, 1))).table.shape[0] == 1
    with pytest.raises(ValueError, match="of 102 scans, got 101"):
        measure_runs(controller, rows, scenario, actuator, LoopLimits(), np.zeros((1, 101)), np.zeros((1, 1)))
