"""A heater with a cooler: the proof's loop beside one that shares nothing with it, the story, the verdict, what is refused."""

import math
from collections import deque
from dataclasses import replace

import numpy as np
import pytest
from tests.witness.pid_temp import HeatCool, Pulses, Set, with_factor
from tests.witness.trace_measures import judge

from heatertune import chain
from heatertune.codec import decode, plain
from heatertune.compiled import dispatch as machine
from heatertune.errors import InputError, OutOfRange
from heatertune.log.log_values import Log
from heatertune.model.model_values import Fopdt, TwoLag, model_by_hand
from heatertune.pid.design_values import PidDesign
from heatertune.plc import Scaling, controller_for
from heatertune.plc.controller import with_cooling
from heatertune.plc.pwm import on_time, pid_compact
from heatertune.proof import LoopLimits, SampleRequest, SampleSpread, replay, simulate
from heatertune.proof.as_left import as_left
from heatertune.proof.criteria import columns_of
from heatertune.proof.heaters import scale_power
from heatertune.proof.kernel import heat_after, period_of, switched_off, times_on
from heatertune.proof.loop import in_loop, noise_of, plant_row, scans_of
from heatertune.proof.monte_carlo.draw import measure
from heatertune.proof.proof_document import ProofView
from heatertune.proof.prove_words import actuator_for, course_for, prove
from heatertune.proof.redesign import DesignRequest, find_passing_design
from heatertune.proof.runs import Runs, measure_runs
from heatertune.proof.scenario import Load, Mains, NewSetpoint, PlcPower, Scenario, TemperatureStep
from heatertune.proof.text_comparison import ComparisonResult, compare_text
from heatertune.proof.verdict import Coverage
from heatertune.settings import Conditions, TuneSettings

PID_TEMP = controller_for("pid-temp-cooling")
HEATER = Fopdt(gain_degC_per_pct=0.9, time_constant_s=90.0, dead_time_s=6.0, ambient_degC=20.0)
RANGE = Scaling(low_degC=0.0, high_degC=120.0)
DESIGN = PidDesign(gain_pct_per_degC=5.0, integral_time_s=80.0, derivative_time_s=4.0, sample_time_s=2.0, structure="pid", method="")
WORDS = with_cooling(PID_TEMP.encode(DESIGN, RANGE), 0.5)
SWITCH = replace(pid_compact(pwm_period_s=2.0, call_interval_s=0.1, minimum_on_s=0.2, minimum_off_s=0.1), cooling_gain=0.5,
                 cooling_minimum_on_s=0.3, cooling_minimum_off_s=0.2)
#: exothermic goods, a setpoint far down, and all that may fail; the setpoints are whole counts
STORY = Scenario(setpoint_degC=65.0, duration_s=5400.0, disturbances=(
    Load(time_s=900.0, power_pct=80.0), NewSetpoint(time_s=1600.0, setpoint_degC=62.5), Load(time_s=2300.0, power_pct=-80.0),
    NewSetpoint(time_s=3000.0, setpoint_degC=45.0), TemperatureStep(time_s=3600.0, temperature_degC=12.0),
    Mains(time_s=4000.0, share=0.81), PlcPower(time_s=4400.0, on=False), PlcPower(time_s=4600.0, on=True)))


def _by_hand(heat, cool, cooling, switch, scenario, made, **settings):
    """Temperature and output at each call of the algorithm, tick by tick of 0.1 s: witness, two PWMs, one lag, a queue for the
    dead time. The pulses are of what the proof's loop asked for, which differs by the rounding of REALs alone."""
    ticks, calls = round(scenario.duration_s * 10), round(10 * WORDS.sample_time_s)
    law = HeatCool(heat, cool, TA=WORDS.sample_time_s, number=np.float32, **settings)
    pulses = [Pulses(20, round(10 * least_on), round(10 * least_off)) for least_on, least_off in (
        (switch.minimum_on_s, switch.minimum_off_s), (switch.cooling_minimum_on_s, switch.cooling_minimum_off_s))]
    decay, y, load, setpoint = math.exp(-0.1 / HEATER.time_constant_s), 20.0, 0.0, scenario.setpoint_degC
    found, asked = [], []
    way = deque([0.0] * round(10 * HEATER.dead_time_s))
    on = [0, 0]
    events = {round(10 * event.time_s): event for event in scenario.disturbances}
    late = deque([0.0] * len(way))
    for tick in range(ticks + 1):
        event = events.get(tick)
        if isinstance(event, NewSetpoint):
            setpoint = event.setpoint_degC
        if isinstance(event, TemperatureStep):
            y += event.temperature_degC
        if isinstance(event, Load):
            load += event.power_pct
        if tick % calls == 0:
            found.append(y)
            count = int(min(max(y * 27648 / 120.0, 0.0), 27648.0))
            reading = np.float32(np.float32(np.float32(count) / np.float32(27648)) * np.float32(120.0))
            asked.append(float(law(setpoint, reading)))
            on = [pulse(max(side * made[tick // calls], 0.0)) for pulse, side in zip(pulses, (1.0, -1.0), strict=True)]
        within = tick % calls
        way.append(100.0 * (within < on[0]) - 100.0 * cooling * (within < on[1]))
        late.append(load)
        target = 20.0 + HEATER.gain_degC_per_pct * (way.popleft() + late.popleft())
        y = target + (y - target) * decay
    return np.array(found), np.array(asked)


@pytest.mark.parametrize("settings", [
    {}, {"anti_windup": "late", "rule": "output"}, {"anti_windup": "limited", "rule": "both", "memory": "error"},
    {"anti_windup": "clamped", "integral": "forward", "memory": "error"}])
@pytest.mark.parametrize("advanced", [False, True])
def test_the_loop_is_the_one_that_a_few_lines_step_tick_by_tick(settings, advanced):
    scenario = replace(STORY, duration_s=4000.0, disturbances=STORY.disturbances[:5])
    own = {"AdvancedCooling": 1, "CoolGain": 7.0, "CoolTi": 50.0, "CoolTd": 2.0} if advanced else {}
    words = replace(WORDS, values=WORDS.values | own)
    named = {"rule": "parameter_set", "memory": "integral_kept"}
    trace = simulate(PID_TEMP, words, HEATER, scenario, SWITCH, {named.get(name, name): value for name, value in settings.items()})
    v = words.values
    heat = Set(v["Gain"], v["Ti"], v["Td"], v["TdFiltRatio"])
    cool = Set(7.0, 50.0, 2.0, v["CoolTdFiltRatio"]) if advanced else with_factor(heat, v["CoolFactor"])
    temperature, asked = _by_hand(heat, cool, 0.5, SWITCH, scenario, trace.power_asked_pct, **settings)
    assert np.abs(trace.temperature_degC - temperature).max() < 1e-9
    assert np.abs(trace.power_asked_pct - asked).max() < 2e-3  # I in REALs, over two thousand cycles
    assert {-100.0, 0.0, 100.0} == set(trace.edge_pct.tolist())
    assert np.ptp(trace.temperature_degC[trace.time_s > 1500.0]) > 10.0


@pytest.mark.parametrize("model", [HEATER, TwoLag(gain_degC_per_pct=0.9, time_constant_s=80.0, second_time_constant_s=20.0,
                                                  dead_time_s=4.5, ambient_degC=20.0)])
def test_compiled_it_is_the_same_bit_for_bit_and_the_meter_finds_what_the_judge_finds(model, monkeypatch):
    traces = []
    for at_once in (False, True):
        monkeypatch.setattr(machine, "_PLAIN_SCANS", -1 if at_once else 10**12)
        traces.append(simulate(PID_TEMP, WORDS, model, STORY, SWITCH))
    for name in ("temperature_degC", "power_asked_pct", "edge_time_s", "edge_pct", "stretches"):
        assert np.array_equal(*(getattr(trace, name) for trace in traces)), name
    loop = in_loop(PID_TEMP, WORDS, STORY.setpoints_degC, {})
    found = measure_runs(loop, np.array([plant_row(model, STORY)]), STORY, SWITCH, LoopLimits(), noise_of(STORY, scans_of(loop, STORY))[None],
                    np.zeros((1, 1)))
    ours = [criterion for column in columns_of(found, LoopLimits()) for criterion in column.criteria([""])]
    for one, other in zip(ours, judge(traces[0], LoopLimits()), strict=True):
        assert one.value == pytest.approx(other.value, rel=1e-6, abs=1e-6), one.name


def test_the_cooler_keeps_its_power_where_the_mains_of_the_heater_fail():
    scenario = Scenario(setpoint_degC=65.0, duration_s=1500.0, disturbances=(
        Load(time_s=700.0, power_pct=80.0), Mains(time_s=1100.0, share=0.0)))
    trace = simulate(PID_TEMP, WORDS, HEATER, scenario, SWITCH)
    held = trace.temperature_degC[trace.time_s > 1200.0]
    assert np.abs(held - 65.0).max() < 1.0  # 80 % of load, 50 needed: it goes on cooling


DRAWN = Scenario(setpoint_degC=65.0, duration_s=1500.0, disturbances=(
    Load(time_s=500.0, power_pct=80.0), Mains(time_s=1000.0, share=0.81)))


def test_the_cooler_is_as_strong_whatever_the_mains_of_a_drawn_heater():
    # once its power went with the square of the drawn mains, with the heater's: 73 % asked for at 207 V, 50 % at 253 V
    drawing = SampleRequest.of(PID_TEMP, WORDS, [HEATER], DRAWN, SampleSpread(ambient_degC=0.0, disturbance_pct=0.0), SWITCH)
    power = drawing.heaters_of(range(40))[0][:, 0] / HEATER.gain_degC_per_pct
    for seed in (int(power.argmin()), int(power.argmax())):
        trace = replay(drawing, seed)
        late = trace.time_s > 1100.0
        assert trace.power_asked_pct[late].mean() == pytest.approx(-60.0, abs=0.2), "27 of 45 °C"
        assert np.ptp(trace.stretches[trace.stretches[:, 0] > 1100.0, 3]) == pytest.approx(45.0, rel=1e-12)
    assert np.ptp(power) > 0.3


@pytest.mark.parametrize("mains_power", [0.81, 1.21])
def test_the_cooler_is_as_strong_at_a_held_voltage_of_the_heater(mains_power):
    # full heating lifts 90 °C at the rated voltage, and 90·0.81 or 90·1.21 °C; full cooling lowers by 45 °C at each
    runs = Runs.of(PID_TEMP, WORDS, [("heater", scale_power(HEATER, mains_power))], STORY, SWITCH, LoopLimits(), Coverage(),
                   interlock=None, mains_power=mains_power)
    (_, model, _), *_ = runs.cases
    assert 100.0 * model.gain_degC_per_pct == pytest.approx(90.0 * mains_power)
    assert 100.0 * model.gain_degC_per_pct * runs.actuator.switches.cooling == pytest.approx(45.0)


@pytest.mark.long
def test_a_drawn_heater_with_a_cooler_is_measured_as_it_is_replayed_and_compiled_as_plainly(monkeypatch):
    drawing, found = SampleRequest.of(PID_TEMP, WORDS, [HEATER], STORY, SampleSpread(), SWITCH), []
    for at_once in (False, True):
        monkeypatch.setattr(machine, "_PLAIN_SCANS", -1 if at_once else 10**12)
        found.append(measure(drawing, LoopLimits(), 3, workers=1))
    for name in ("rows", "table", "totals", "ripple"):
        assert np.array_equal(*(getattr(each, name) for each in found)), name
    for seed in range(3):
        judged = judge(replay(drawing, seed), LoopLimits())
        for column, each in zip(columns_of(found[1], LoopLimits()), judged, strict=True):
            assert column.values[seed] == pytest.approx(each.value, rel=1e-6, abs=1e-6), each.name


def test_a_run_without_a_plc_does_not_cool():
    scenario = Scenario(setpoint_degC=65.0, duration_s=900.0, disturbances=(
        Load(time_s=500.0, power_pct=80.0), PlcPower(time_s=700.0, on=False)))
    trace = simulate(PID_TEMP, WORDS, HEATER, scenario, SWITCH)
    assert trace.edge_time_s[-1] <= 700.0
    assert trace.edge_pct[-1] == 0.0
    assert trace.stretches[-1, -1] == pytest.approx(20.0 + 0.9 * 80.0)


# --- the switch ---------------------------------------------------------------------------------------------------------


def _edges(powers, cut=math.inf):
    numbers = replace(SWITCH, minimum_on_s=0.0, minimum_off_s=0.0, cooling_minimum_on_s=0.0, cooling_minimum_off_s=0.0).switches
    ring, switched, owed = [0.0] * 64, 0, (0.0, 0.0)
    for number, power in enumerate(powers):
        switched, owed = period_of(ring, switched, 2.0 * number, power, owed, numbers, cut)
    return ring, switched


def test_heater_and_cooler_each_have_their_own_shortest_times():
    # of 2 s: 10 % are 0.2 s, as short as the heater's pulse may be, the cooler's is 0.3 s; 95 % leave a pause of 0.1 s, the cooler's is 0.2 s
    heat, cool, _ = SWITCH.switches
    assert [on_time(power, 0.0, heat)[0] for power in (10.0, 95.0)] == pytest.approx([0.2, 1.9])
    assert [on_time(power, 0.0, cool)[0] for power in (10.0, 95.0)] == [0.0, 2.0]


def test_heater_and_cooler_follow_each_other_without_a_pause_and_never_both():
    ring, switched = _edges([-100.0, 100.0, -50.0, 0.0])
    assert [(abs(ring[n]), heat_after(ring, n, 0.5)) for n in range(switched)] == [
        (0.0, -50.0), (2.0, 0.0), (2.0, 100.0), (4.0, 0.0), (4.0, -50.0), (5.0, 0.0)]
    assert math.copysign(1.0, ring[0]) == -1.0  # also at 0
    assert [times_on(ring, switched, end) for end in (0.0, 1.9, 2.0, 4.0, 9.0)] == [1, 1, 2, 3, 3]


def test_a_cut_ends_the_heaters_pulse_and_none_of_the_coolers():
    ring, switched = _edges([100.0, 100.0, -100.0, 100.0, 0.0], cut=3.0)
    assert [(abs(ring[n]), heat_after(ring, n, 0.5)) for n in range(switched)] == [(0.0, 100.0), (3.0, 0.0), (4.0, -50.0), (6.0, 0.0)]


def test_what_is_left_of_a_coolers_pulse_is_taken_back_without_supply():
    ring, switched = _edges([-80.0])
    assert switched_off(ring, switched, 0.7) == 2
    assert (abs(ring[1]), heat_after(ring, 0, 0.5)) == (0.7, -50.0)


# --- words, story and verdict -------------------------------------------------------------------------------------------


FITTED = model_by_hand(HEATER)
ASKED = DesignRequest(target="pid-temp-cooling", scaling=RANGE, tune_settings=TuneSettings(sample_time_s=2.0),
              conditions=Conditions(setpoint_degC=65.0, cooling_gain=0.5))


@pytest.fixture(scope="module")
def made():
    return find_passing_design(FITTED, ASKED)


@pytest.mark.long
def test_a_heater_with_a_cooler_passes_and_is_exported(made):
    proof = made.proof
    assert proof.verdict == "PASS"
    assert proof.words.values["CoolFactor"] == 2.0
    assert proof.words.values["CoolGain"] == 2.0 * proof.words.values["Gain"]
    assert "the power of the cooler was entered as 0.5 times that of the heater" in proof.diagnostics.remarks
    assert "beside it a cooler of 0.5 times the heater's power" in proof.actuator.summary
    assert compare_text(PID_TEMP, proof.words, proof.worst) == ComparisonResult()
    files = chain.export(proof.words, proof)
    assert "Config.ActivateCooling := TRUE" in files["pid_temp_words.scl"]
    assert {run.switches["parameter_set"] for run in proof.runs} == {"now", "output", "both"}


@pytest.mark.long
def test_the_story_has_a_load_that_is_cooled_away_and_a_step_down_in_less_time(made):
    scenario = made.proof.scenario
    loads = [event.power_pct for event in scenario.disturbances if isinstance(event, Load)]
    assert loads == [-10.0, 10.0, 60.0, -60.0]  # 50 % hold 65 °C: 10 % of the heater's power are left for the cooler
    heats, cools = (course.scenario for course in (
        course_for(words, [HEATER], Conditions(setpoint_degC=65.0, **more), 65.0)
        for words, more in ((controller_for("pid-temp").encode(DESIGN, RANGE), {}), (WORDS, {"cooling_gain": 0.5}))))
    down = [next(event.time_s for event in one.disturbances if isinstance(event, NewSetpoint)) for one in (heats, cools)]
    lasts = [min(event.time_s for event in one.disturbances if event.time_s > at) - at for one, at in zip((heats, cools), down, strict=True)]
    assert lasts[1] < lasts[0]  # 45 °C to go to the ambient, 90 °C to full cooling
    trace = made.proof.nominal
    during = {event.power_pct: event.time_s for event in scenario.disturbances if isinstance(event, Load)}
    resting = trace.power_asked_pct[(trace.time_s > during[-60.0] - 100.0) & (trace.time_s < during[-60.0])]
    assert resting.mean() == pytest.approx(-20.0, abs=2.0)  # 10 % too much, of a cooler half as strong


@pytest.mark.long
def test_a_trace_with_the_power_of_a_cooler_is_compared_with_a_proof_that_has_one(made):
    proof, nominal = made.proof, made.proof.nominal
    view = decode(ProofView, plain(proof.to_document()), "proof.json")
    rows = nominal.time_s < 300.0  # the heat-up
    log = Log(name="after", source="the proof's own run", time_s=nominal.time_s[rows], temperature_degC=nominal.temperature_degC[rows],
              setpoint_degC=np.full(np.count_nonzero(rows), 65.0), power_pct=np.maximum(nominal.power_asked_pct[rows], 0.0),
              cooling_pct=np.where(nominal.time_s[rows] < 5.0, 0.0, 1e-3))
    found = as_left(log, proof.words, FITTED, view)
    assert (found.verdict, found.begins_by) == ("AS PROVEN", "first reading")
    colder = as_left(log.with_rows(temperature_degC=20.0 + 0.5 * (log.temperature_degC - 20.0)), proof.words, FITTED, view)
    assert colder.verdict == "NOT AS PROVEN"
    with pytest.raises(InputError, match="--power-column none"):
        as_left(log, proof.words, FITTED, replace(view, actuator=replace(view.actuator, cooling_gain=None)))


def test_a_cooler_that_is_weaker_than_the_load_is_told_as_not_tested():
    course = course_for(WORDS, [HEATER], Conditions(setpoint_degC=65.0, cooling_gain=0.04), 65.0)
    assert "a load that has to be cooled away" in course.not_tested


@pytest.mark.long
def test_words_for_another_cooler_fail_by_margins_and_by_runs(made):
    strong = prove(made.proof.words, FITTED, replace(ASKED.conditions, cooling_gain=3.0))
    broken = {criterion.name for criterion in strong.criteria if not criterion.ok}
    assert strong.verdict == "FAIL"
    assert {"ms", "gain_margin"} & broken
    margin = {one.name: one.value for one in made.proof.criteria}["gain_margin"]
    # six times the loop gain while it cools
    assert {one.name: one.value for one in strong.criteria}["gain_margin"] == pytest.approx(margin / 6.0, rel=1e-5)


def test_what_the_words_say_of_the_cooler_holds_where_nothing_is_told():
    assert actuator_for(Conditions(), WORDS).cooling_gain == 0.5
    told = prove(WORDS, FITTED, Conditions(setpoint_degC=65.0), first_look=True).diagnostics.remarks
    assert "the power of the cooler was taken from the parameters, 0.5 times that of the heater" in told
    for changed in ({"AdvancedCooling": 1}, {"CoolFactor": 0.0}):
        words = replace(WORDS, values=WORDS.values | changed)
        with pytest.raises(OutOfRange, match="--cooling-gain"):
            actuator_for(Conditions(), words)
        assert actuator_for(Conditions(cooling_gain=0.3), words).cooling_gain == 0.3


def test_a_cooler_is_refused_where_there_is_no_output_for_one():
    words = controller_for("pid-temp").encode(DESIGN, RANGE)
    with pytest.raises(InputError, match="pid-temp has no second output for a cooler; pid-temp-cooling has one"):
        actuator_for(Conditions(cooling_gain=0.5), words)
    with pytest.raises(InputError, match=r"cooling_minimum_on_s.* need cooling_gain"):
        Conditions(cooling_minimum_on_s=1.0)
    with pytest.raises(OutOfRange, match="cooling_gain"):
        Conditions(cooling_gain=0.0)
    with pytest.raises(OutOfRange, match="cooling_minimum_off_s"):
        actuator_for(Conditions(cooling_gain=0.5, cooling_minimum_off_s=3.0), WORDS)


@pytest.mark.parametrize(("changed", "named"), [
    ({"CoolCycle": 4.0}, "CoolCycle"), ({"OutputLowerLimit": 0.0}, "OutputLowerLimit"), ({"OutputUpperLimit": 0.0}, "OutputUpperLimit"),
    ({"CoolTd": 5.0, "CoolTdFiltRatio": 1e30, "AdvancedCooling": 1}, "TdFiltRatio"), ({"CoolGain": -1.0}, "CoolGain")])
def test_words_that_contradict_one_another_are_refused(changed, named):
    with pytest.raises(OutOfRange, match=named):
        PID_TEMP.check(replace(WORDS, values=WORDS.values | changed))


def test_what_is_odd_about_cooling_is_told():
    assert PID_TEMP.oddities(WORDS) == ()
    told = " ".join(PID_TEMP.oddities(replace(WORDS, values=WORDS.values | {
        "AdvancedCooling": 1, "CoolGain": 0.0, "CoolTi": 0.0, "OutputLowerLimit": -60.0})))
    assert all(part in told for part in ("CoolGain is 0", "CoolTi is 0", "limited to 60 %"))
