"""Profiles: files and times worked out by hand, and a firing against another program, which steps by the millisecond."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from tests.proof.ways import assert_same_compiled_and_plain
from tests.witness.trace_measures import judge

from heatertune.errors import DocumentError, InputError
from heatertune.model.model_values import Fopdt, TwoLag, model_by_hand
from heatertune.pid.design_values import PidDesign
from heatertune.plc import TARGETS, Scaling, controller_for
from heatertune.proof import (
    Acceptance,
    Actuator,
    Coverage,
    LoopLimits,
    TestSequence,
    prove,
    prove_models,
    simulate,
    story_for,
)
from heatertune.proof.profile import Profile, Segment, read_profile
from heatertune.proof.proof_document import check_document
from heatertune.proof.scenario import PlcPower, Scenario, SetpointRampEvent, delay_heater, kinds_of, phases_of
from heatertune.proof.spec_file import in_force, read_spec, spec_text
from heatertune.proof.test_sequence import LoopTiming
from heatertune.proof.verdict import verdict_line, verdict_notes

#: 100 s of lag; at full power it can go up to 120 °C
HEATER = Fopdt(gain_degC_per_pct=1.0, time_constant_s=100.0, dead_time_s=2.0, ambient_degC=20.0)
LOOP = LoopTiming(scan_s=1.0, pwm_period_s=1.0, sample_time_s=1.0, integral_time_s=80.0)
PWM = Actuator(pwm_period_s=1.0)
#: nothing but a heat-up before the profile
ALONE = {"step_share": 0.0, "load_pct": 0.0, "opens": False, "changes": False, "mains": False, "restarts": False}
#: up to 60 °C at 0.2 °C/s, 100 s there, in 150.5 s up to 80 °C and 60 s there, and down to 70 °C at 0.1 °C/s
FIRING = Profile(name="firing.csv", segments=(
    Segment(target_degC=60.0, rate_degC_per_s=0.2, soak_s=100.0),
    Segment(target_degC=80.0, ramp_s=150.5, soak_s=60.0),
    Segment(target_degC=70.0, rate_degC_per_s=0.1)))


def _written(tmp_path, text):
    file = tmp_path / "firing.csv"
    file.write_text(text, encoding="utf-8")
    return file


@pytest.mark.parametrize("text", [
    "target [degC],ramp [degC/h],soak [min]\n600,150,10\n1060,100,30\n",
    "# a glaze\n\nTemperature [°C], rate [K/min], hold [h]\n600,2.5,\n1060,1.6666666666666667,0.5\n".replace("K/min", "°C/min").replace(
        "600,2.5,", f"600,2.5,{10 / 60!r}"),
    "\ufefftarget (°F);ramp (°F/h);soak (s)\n1112;270;600\n1940;180,0;1800\n",
    "target [degC]\tduration [min]\tramp [degC/h]\tsoak [min]\n600\t\t150\t10\n1060\t276\t\t30\n",
])
def test_a_file_is_read_in_the_units_of_its_header(text, tmp_path):
    first, second = read_profile(_written(tmp_path, text)).segments
    assert (first.target_degC, first.rate_degC_per_s, first.soak_s) == pytest.approx((600.0, 150.0 / 3600.0, 600.0))
    assert (second.target_degC, second.ramp_from(600.0), second.soak_s) == pytest.approx((1060.0, 460.0 * 36.0, 1800.0))


HEAD = "target [degC],ramp [degC/h],soak [min]\n"


@pytest.mark.parametrize(("text", "says"), [
    ("", "firing.csv: empty; expected the columns target [degC]"),
    (HEAD, "firing.csv, line 1: no segment"),
    ("target,ramp,soak\n600,150,10\n", "line 1: 'target' is no column with its unit"),
    ("target [degC],ramp [bar/h],soak [min]\n", "line 1: column 'ramp [bar/h]' has the unit 'bar/h'; expected degC/s or"),
    ("target [degC],soak [min]\n600,10\n", "line 1: no column rate; expected"),
    ("target [degC],ramp [min],soak [min],hold [h]\n600,10,3,3\n", "a column twice"),
    (HEAD + "600,150,10\n1060,fast,30\n", "line 3, column ramp [degC/h]: 'fast'; expected a number above 0"),
    (HEAD + "600,-150,10\n", "line 2, column ramp [degC/h]: '-150'; expected a number above 0"),
    (HEAD + "600,150,-1\n", "line 2, column soak [min]: '-1'; expected a time of 0 or more"),
    (HEAD + "nan,150,1\n", "line 2, column target [degC]: 'nan'; expected a temperature"),
    (HEAD + ",150,1\n", "line 2, column target [degC]: ''; expected a temperature"),
    (HEAD + "600,1e999,1\n", "line 2, column ramp [degC/h]: '1e999'"),
    (HEAD + "600,,1\n", "line 2: no ramps; expected a number in column ramp [degC/h]"),
    (HEAD + "600,150\n", "line 2: 2 cells; expected 3"),
    ("target [degC],ramp [min],rate [degC/h],soak [min]\n600,10,20,3\n", "line 2: 2 ramps; expected a number in column ramp [min] or"),
])
def test_what_is_no_profile_is_refused_by_file_line_column_and_value(text, says, tmp_path):
    with pytest.raises(DocumentError) as refused:
        read_profile(_written(tmp_path, text))
    assert "firing.csv" in str(refused.value)
    assert says in str(refused.value)


def test_a_file_that_is_not_there_or_no_text_is_refused(tmp_path):
    with pytest.raises(DocumentError, match=r"nothing\.csv: cannot be read"):
        read_profile(tmp_path / "nothing.csv")
    (tmp_path / "firing.csv").write_bytes(b"target [\xb0C]\n")
    with pytest.raises(DocumentError, match=r"firing\.csv: no text"):
        read_profile(tmp_path / "firing.csv")


def test_a_specification_names_a_profile_beside_it_or_holds_it(tmp_path):
    _written(tmp_path, HEAD + "600,150,10\n")
    beside, within = tmp_path / "beside.toml", tmp_path / "within.toml"
    beside.write_text('preset = "kiln"\nprofile = "firing.csv"\n')
    within.write_text('[profile]\n"target [degC]" = [600]\n"ramp [degC/h]" = [150]\n"soak [min]" = [10]\n')
    specs = [read_spec(beside), read_spec(within), in_force("kiln", [], str(tmp_path / "firing.csv"))]
    assert len({spec.profile.segments for spec in specs}) == 1
    assert [spec.profile.name for spec in specs] == ["firing.csv", "within.toml", "firing.csv"]
    within.write_text('[profile]\n"target [degC]" = [600, 700]\n"ramp [degC/h]" = [150, 0]\n"soak [min]" = [10, 10]\n')
    with pytest.raises(DocumentError, match=r"within.toml: profile, segment 2, column ramp \[degC/h\]: '0'"):
        read_spec(within)
    within.write_text("profile = 3\n")
    with pytest.raises(DocumentError, match="profile: expected the name of a file"):
        read_spec(within)


def test_a_specification_is_written_with_its_profile(tmp_path):
    file = tmp_path / "spec.toml"
    for profile in (FIRING, replace(FIRING, segments=FIRING.segments[:1])):
        file.write_text(spec_text(replace(in_force("kiln"), profile=profile)))
        for read, meant in zip(read_spec(file).profile.segments, profile.segments, strict=True):
            assert [read.target_degC, read.soak_s, read.ramp_from(20.0)] == pytest.approx(
                [meant.target_degC, meant.soak_s, meant.ramp_from(20.0)], rel=1e-10)


def test_legs_follow_each_other_and_a_last_ramp_is_watched():
    legs = [(leg.begin_s, leg.from_degC, leg.to_degC, leg.duration_s, leg.soaks) for leg in FIRING.legs(20.0, 102.0)]
    assert np.array(legs) == pytest.approx(np.array([
        (0.0, 20.0, 60.0, 200.0, False), (200.0, 60.0, 60.0, 100.0, True), (300.0, 60.0, 80.0, 150.5, False),
        (450.5, 80.0, 80.0, 60.0, True), (510.5, 80.0, 70.0, 100.0, False), (610.5, 70.0, 70.0, 102.0, False)]))


@pytest.mark.parametrize(("segment", "says"), [
    # at 100 °C full power leaves (120 − 100)/100 = 0.2 °C/s, and no power lets 80 °C fall by (80 − 20)/100
    (Segment(target_degC=100.0, rate_degC_per_s=0.21), "12.6 °C/min to 100 °C is faster than the weakest plausible heater "
                                                       "follows at full power there; expected at most 12 °C/min"),
    (Segment(target_degC=100.0, ramp_s=399.0), "expected at most 12 °C/min"),
    (Segment(target_degC=120.0, rate_degC_per_s=0.001), "target 120 °C; expected more than 20 and less than 120 °C"),
    (Segment(target_degC=10.0, rate_degC_per_s=0.001), "target 10 °C; expected more than 20 and less than 120 °C"),
])
def test_a_ramp_that_no_power_can_follow_is_refused_with_the_fastest_it_can(segment, says):
    with pytest.raises(InputError) as refused:
        story_for([HEATER], LOOP, TestSequence(profile=Profile(name="firing.csv", segments=(segment,)), **ALONE), setpoint_degC=60.0)
    assert "firing.csv, segment 1" in str(refused.value)
    assert says in str(refused.value)


def test_a_heater_falls_no_faster_than_by_itself():
    fast = replace(FIRING, segments=(*FIRING.segments[:2], Segment(target_degC=70.0, rate_degC_per_s=0.51)))
    with pytest.raises(InputError, match=r"segment 3: 30.6 °C/min to 70 °C is faster .* without power there; expected at most 30 °C/min"):
        story_for([HEATER], LOOP, TestSequence(profile=fast, **ALONE), setpoint_degC=60.0)
    just = replace(FIRING, segments=(*FIRING.segments[:2], Segment(target_degC=70.0, rate_degC_per_s=0.5)))
    assert story_for([HEATER], LOOP, TestSequence(profile=just, **ALONE), setpoint_degC=60.0).scenario.setpoints_degC[-1] == 70.0


def test_the_weakest_and_the_slowest_heater_bound_a_ramp_and_coolers_go_down():
    weak, slow = replace(HEATER, gain_degC_per_pct=0.9), TwoLag(
        gain_degC_per_pct=1.0, time_constant_s=100.0, second_time_constant_s=50.0, dead_time_s=0.0, ambient_degC=20.0)
    for other, fastest in ((weak, (110.0 - 60.0) / 100.0), (slow, (120.0 - 60.0) / 150.0)):
        for rate, able in ((0.999 * fastest, True), (1.001 * fastest, False)):
            profile = Profile(name="p", segments=(Segment(target_degC=60.0, rate_degC_per_s=rate),))
            try:
                profile.demand_followed([(HEATER, 20.0), (other, 20.0)])
            except InputError:
                assert not able
            else:
                assert able
    cooler = replace(HEATER, gain_degC_per_pct=-0.5)
    down = Profile(name="p", segments=(Segment(target_degC=-20.0, rate_degC_per_s=0.11),))
    with pytest.raises(InputError, match="at full power there; expected at most 6 °C/min"):  # (−20 − (20 − 50))/100
        down.demand_followed([(cooler, 20.0)])


def test_the_story_ends_with_the_profile_from_cold():
    scenario = story_for([HEATER], replace(LOOP, cold_degC=0.5), TestSequence(profile=FIRING, **ALONE), setpoint_degC=60.0).scenario
    off, *led = scenario.disturbances
    # from 60 °C down to half a degree above the ambient, after the dead time
    begin = off.time_s + math.ceil(2.0 + 100.0 * math.log(40.0 / 0.5))
    assert [event.time_s for event in led] == pytest.approx([begin + late for late in (0.0, 200.0, 300.0, 450.5, 510.5, 610.5)])
    assert scenario.duration_s == pytest.approx(begin + 610.5 + 102.0)
    assert [kind for kind, *_ in kinds_of(scenario)] == ["heat-up", "off", "ramp", "soak", "ramp", "soak", "ramp", "soak"]
    assert scenario.rests_s[2:] == pytest.approx((0.0, 50.0, 0.0, 30.0, 0.0, 0.0)), "half of each soak"
    assert [phase.rest_s for phase in phases_of(scenario, 1e6, 0.0)][3] == pytest.approx(begin + 250.0)


def test_a_scan_at_the_begin_of_a_part_of_a_profile_belongs_to_it():
    # 2.1 s added up is a last digit later than the scan of that instant: the part began a scan later, the PLC was without supply
    for scan_s in (4.2, 2.1, 0.7, 0.716):
        loop, scans = replace(LOOP, scan_s=scan_s, pwm_period_s=scan_s, sample_time_s=scan_s), range(1, 60)
        firing = Profile(name="", segments=tuple(
            Segment(target_degC=60.0 + k % 2, ramp_s=200 * scan_s * k, soak_s=scan_s * k) for k in scans))
        scenario = story_for([HEATER], loop, TestSequence(profile=firing), setpoint_degC=60.0).scenario
        times = [event.time_s for event in scenario.disturbances if isinstance(event, SetpointRampEvent)]
        assert len(times) == 2 * len(scans)
        for each in (*times, scenario.duration_s):
            assert each == round(each / scan_s) * scan_s


def test_what_a_soak_may_settle_in_is_the_users():
    def rests(**limits):
        course = story_for([HEATER], replace(LOOP, soak_settles_s=LoopLimits(**limits).soak_settles_s),
                           TestSequence(profile=FIRING, **ALONE), setpoint_degC=60.0)
        return [rest for rest in course.scenario.rests_s[2:] if rest > 0.0], course.not_tested[-1]

    assert rests(soak_settling_s=20.0)[0] == pytest.approx([80.0, 40.0])
    assert rests(soak_settling_pct=10.0)[0] == pytest.approx([90.0, 54.0])
    assert rests(soak_settling_pct=50.0, soak_settling_s=20.0)[0] == pytest.approx([80.0, 40.0])
    judged, untold = rests(soak_settling_s=60.0)
    assert judged == pytest.approx([40.0])
    assert "segment 3" in untold, "the last ramp has none"
    course = story_for([HEATER], replace(LOOP, soak_settles_s=lambda _: 60.0), TestSequence(profile=FIRING, **ALONE), setpoint_degC=60.0)
    assert course.not_tested[-2:] == tuple(
        f"whether segment {number} of the profile arrives (no soak longer than what it may settle in)" for number in (2, 3))


def test_the_papers_record_has_no_profile():
    with pytest.raises(InputError, match="leave one of them out"):
        TestSequence(profile=FIRING, paper_times=True)


def _fired(begin_s, temperature):
    """A two-level control and its heater along FIRING by another program, exactly from one millisecond to the next.

    It switches at each second, which is seen 2 s later; counts are those of 12 bits over 0 to 100 °C, the band is half
    a degree. The temperature is what the time before has left.
    """
    knees = begin_s + np.array([0.0, 200.0, 300.0, 450.5, 510.5, 610.5, 712.5])
    asked = np.array([20.0, 60.0, 60.0, 80.0, 80.0, 70.0, 70.0])
    milli = np.arange(round(1000.0 * begin_s), round(1000.0 * (begin_s + 713.0)) + 1)
    decay, band, hot = math.exp(-0.001 / 100.0), int(0.5 * 40.95 + 0.5), [False]
    seen = []
    for now in milli.tolist():
        if now % 1000 == 0:
            setpoint = int(np.interp(now / 1000.0, knees, asked) * 40.95)
            reading = int(temperature * 40.95)
            hot.append(reading < setpoint - band or (hot[-1] and reading <= setpoint + band))
        seen.append(temperature)
        second = (now - round(1000.0 * begin_s)) // 1000 - 2  # of the switch that acts now
        target = 120.0 if second >= 0 and hot[1 + second] else 20.0
        temperature = target + (temperature - target) * decay
    return milli / 1000.0, np.array(seen), np.interp(milli / 1000.0, knees, asked)


@pytest.mark.long
def test_a_firing_agrees_with_a_program_that_steps_by_the_millisecond():
    which = controller_for("on-off")
    words = which.encode(PidDesign(gain_pct_per_degC=1.0, integral_time_s=99.0, derivative_time_s=0.0, sample_time_s=1.0,
                                   structure="pi", method=""), Scaling())
    scenario = story_for([HEATER], LOOP, TestSequence(profile=FIRING, **ALONE), setpoint_degC=60.0).scenario
    begin = round(scenario.disturbances[1].time_s)
    trace = simulate(which, words, HEATER, scenario, PWM)
    time, temperature, asked = _fired(begin, float(trace.temperature_at(begin)))
    near = time <= trace.time_s[-1]
    assert trace.temperature_at(time[near]) == pytest.approx(temperature[near], abs=1e-6)

    def within(first, last):
        chosen = (time >= begin + first) & (time <= begin + last)
        return temperature[chosen], asked[chosen]

    soaks = [np.abs(one - target).max() for one, target in (within(250.0, 300.0), within(480.5, 510.5))]
    ramps = [np.abs(one - target).max() for one, target in (within(0.0, 200.0), within(300.0, 450.5), within(510.5, 610.5))]
    up, higher, down = within(0.0, 300.0)[0], within(300.0, 610.5)[0], within(510.5, 713.0)[0]
    beyond = [(up.max() - 60.0) / 40.0, (higher.max() - 80.0) / 20.0, (70.0 - down.min()) / 10.0]
    expected = {"soak_deviation": max(soaks), "ramp_overshoot": 100.0 * max(beyond), "ramp_deviation": max(ramps),
                "peak": higher.max()}
    limits = LoopLimits(tolerance_degC=0.2, soak_band_degC=3.0, overshoot_degC=1.5)
    own = {one.name: one for one in judge(trace, limits)}
    assert {name: own[name].value for name in expected} == pytest.approx(expected, abs=2e-3)
    assert (own["soak_deviation"].limit, own["ramp_overshoot"].limit, own["ramp_overshoot_degC"].limit) == (3.0, 20.0, 1.5)
    assert own["ramp_overshoot_degC"].value == pytest.approx(max(up.max() - 60.0, higher.max() - 80.0, 70.0 - down.min()), abs=2e-3)


SCENARIO = story_for([HEATER], replace(LOOP, scan_s=2.0, pwm_period_s=2.0), TestSequence(profile=FIRING, **ALONE), setpoint_degC=60.0).scenario


def _words(target):
    which = controller_for(target)
    return which, which.encode(PidDesign(gain_pct_per_degC=3.0, integral_time_s=60.0, derivative_time_s=0.0,
                                         sample_time_s=which.timer.round(2.0), structure="pi", method=""), Scaling())


@pytest.mark.long
@pytest.mark.parametrize("target", TARGETS)
def test_a_firing_is_judged_by_the_meter_as_by_its_trace(target):
    which, words = _words(target)
    models = [("one", HEATER), ("two", TwoLag(gain_degC_per_pct=0.9, time_constant_s=40.0, second_time_constant_s=20.0,
                                              dead_time_s=3.0, ambient_degC=20.0))]
    limits, switch = LoopLimits(tolerance_degC=2.0), Actuator(pwm_period_s=2.0)
    for run in prove_models(which, words, models, SCENARIO, switch, Acceptance(limits=limits), Coverage(open_points=False)).runs:
        heater = delay_heater(dict(models)[run.model], which.delay_s)
        trace = simulate(which, words, heater, SCENARIO, switch, run.switches)
        own = judge(trace, limits, where=run.label)
        assert {"soak_deviation", "ramp_overshoot", "ramp_deviation", "peak"} <= {one.name for one in own}
        for metered, traced in zip(run.criteria, own, strict=False):
            assert metered.value == pytest.approx(traced.value, rel=1e-9, abs=1e-9), (run.label, metered.name)
        led = SCENARIO.disturbances[1:]
        ways = np.interp(trace.time_s, [*(event.time_s for event in led), 1e9], [*(event.from_degC for event in led), 70.0])
        step = trace.resolution_degC
        since = trace.time_s >= led[0].time_s
        assert np.all((trace.followed_degC - ways)[since] <= 1e-4)
        assert np.all((ways - trace.followed_degC)[since] <= step + 1e-4)


def test_a_led_setpoint_stays_at_its_end_and_supplies_the_plc():
    which, words = _words("s7-300")
    scenario = Scenario(setpoint_degC=40.0, duration_s=400.0, disturbances=(
        PlcPower(time_s=60.0, on=False), SetpointRampEvent(time_s=100.0, from_degC=20.0, setpoint_degC=50.0, duration_s=150.0)))
    trace = simulate(which, words, HEATER, scenario, PWM)
    assert trace.followed_degC[-1] == pytest.approx(50.0, abs=0.01)
    assert trace.followed_degC[trace.time_s == 200.0] == pytest.approx(40.0, abs=0.01)
    assert np.all(trace.power_asked_pct[(trace.time_s >= 60.0) & (trace.time_s < 100.0)] == 0.0)
    assert trace.temperature_degC[-1] == pytest.approx(50.0, abs=1.0)
    ways = np.interp(trace.time_s, [100.0, 250.0], [20.0, 50.0])
    late = np.abs(trace.temperature_degC - ways)[trace.time_s >= 100.0].max()
    own = {one.name: one.value for one in judge(trace, LoopLimits())}
    assert own["ramp_deviation"] == pytest.approx(late, rel=0.05)


def test_a_cooler_is_led_down_as_a_heater_is_led_up():
    # the same loop in the mirror of 20 °C: what is above the setpoint on one side is below it on the other
    def measured(model, sign):
        which = controller_for("s7-300")
        words = which.encode(PidDesign(gain_pct_per_degC=sign * 3.0, integral_time_s=60.0, derivative_time_s=0.0,
                                       sample_time_s=2.0, structure="pi", method=""), Scaling(low_degC=-80.0, high_degC=120.0))
        profile = replace(FIRING, segments=tuple(
            replace(one, target_degC=20.0 + sign * (one.target_degC - 20.0)) for one in FIRING.segments))
        course = story_for([model], replace(LOOP, scan_s=2.0, pwm_period_s=2.0), TestSequence(profile=profile, **ALONE),
                           setpoint_degC=20.0 + sign * 40.0)
        trace = simulate(which, words, model, course.scenario, Actuator(pwm_period_s=2.0))
        return {one.name: one.value for one in judge(trace, LoopLimits())}

    up, down = measured(HEATER, 1.0), measured(replace(HEATER, gain_degC_per_pct=-1.0), -1.0)
    for name in ("soak_deviation", "ramp_overshoot", "ramp_deviation"):
        assert down[name] == pytest.approx(up[name], abs=0.5, rel=0.1), name


@pytest.mark.long
@pytest.mark.parametrize("target", ["weg", "s5-ob251"])
def test_a_firing_is_the_same_compiled_and_plain_bit_for_bit(target):
    assert_same_compiled_and_plain(*_words(target), HEATER, SCENARIO, PWM)


@pytest.fixture(scope="module")
def proven(tmp_path_factory):
    """A proof with a profile on a heater by hand, its file, and the fitted heater."""
    file = _written(tmp_path_factory.mktemp("firing"), "target [degC],ramp [degC/min],soak [min]\n60,12,5\n80,8,5\n")
    _, words = _words("s7-300")
    fitted = model_by_hand(HEATER)
    return prove(words, fitted, profile=str(file), tolerance_degC=2.0), file, words, fitted


def test_a_proof_is_made_where_the_profile_leads_and_says_so(proven):
    proof, *_ = proven
    document = json.loads(json.dumps(proof.to_document()))
    assert proof.scenario.setpoint_degC == 80.0, "the highest target, where the user tells no setpoint"
    assert check_document(document, "proof.json")["specification"]["profile"]["name"] == "firing.csv"
    along = "along the profile firing.csv (2 segments, sha256 "
    assert along in verdict_line(document)
    assert any(line.startswith(along) for line in verdict_notes(document)), "what the head of an export says"


@pytest.mark.parametrize(("name", "changes"), [
    ("soak_deviation", {"limit": 5.0}), ("ramp_overshoot", {"limit": 50.0}), ("peak", None)])
def test_a_document_that_forgives_a_profile_is_refused(name, changes, proven):
    document = json.loads(json.dumps(proven[0].to_document()))
    if changes is None:
        for part in (document, *document["runs"]):
            part["criteria"].pop(name)
    else:
        document["criteria"][name] |= changes
    with pytest.raises(DocumentError, match=rf"criteria.{name}"):
        check_document(document, "proof.json")


def test_limits_of_a_profile_are_heard(proven):
    _, file, words, fitted = proven
    free = {one.name: one for one in proven[0].criteria}
    limits = ("soak-band=0.01degC", "ramp-deviation=0.1degC", "peak=70degC")
    held = {one.name: one for one in prove(words, fitted, profile=str(file), limit=limits).criteria}
    for name, limit in (("soak_deviation", 0.01), ("ramp_deviation", 0.1), ("peak", 70.0)):
        assert (held[name].limit, held[name].ok) == (limit, False)
    assert (free["ramp_deviation"].limit, free["peak"].limit, free["soak_deviation"].limit) == (None, None, 2.0)


def test_a_setpoint_of_the_users_stays_and_the_profile_goes_beyond(proven):
    _, file, words, fitted = proven
    proof = prove(words, fitted, profile=str(file), setpoint_degC=50.0)
    assert (proof.scenario.setpoint_degC, max(proof.scenario.setpoints_degC)) == (50.0, 80.0)
