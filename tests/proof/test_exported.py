"""The exported text runs what the proof ran; the witness is a text with a fault, which has to be noticed.

That the text and the proof are right is tests/golden's: awlsim, an S5 and a machine for structured text of its own.
"""

import math
import random
import re
from dataclasses import replace
from fractions import Fraction
from functools import cache
from itertools import product

import pytest
from tests.bench.text_faults import HEATER as PLANT
from tests.bench.text_faults import STORY, loops

from heatertune import chain
from heatertune.errors import InputError
from heatertune.model.model_values import Fopdt, TwoLag, model_by_hand
from heatertune.pid.design_values import PidDesign
from heatertune.plc import Certificate, Ramp, Scaling, controller_for
from heatertune.plc.cpu.s5.machine import S5Cpu
from heatertune.plc.cpu.s7_300.exported_blocks import ExportedS7
from heatertune.plc.cpu.s7_300.machine import S7300Cpu as S7Cpu
from heatertune.plc.cpu.s7_300.source import as_real, bits_of
from heatertune.plc.inputs import sensor_scaling
from heatertune.plc.open_points import assumptions_from
from heatertune.plc.pwm import Actuator, pulsegen
from heatertune.proof import Scenario, simulate
from heatertune.proof import text_comparison as of_text
from heatertune.proof.scenario import NewSetpoint, PlcPower
from heatertune.proof.text_comparison import ComparisonResult, as_exported, compare_text
from heatertune.proof.verdict import verdict_line
from heatertune.settings import Conditions

HEATER = TwoLag(gain_degC_per_pct=0.6, time_constant_s=50.0, second_time_constant_s=11.0, dead_time_s=1.3, ambient_degC=21.0)
FILES = {"s5-ob251": "program_listing.txt", "s7-300": "s7_300_pid.awl", "fb41": "fb41_cont_c.awl", "weg": "weg_pid_block.st"}

#: half a minute that shows most of a text
SHORT = Scenario(setpoint_degC=51.0, duration_s=36.0, noise_degC=0.05, disturbances=(
    NewSetpoint(time_s=14.0, setpoint_degC=44.0), PlcPower(time_s=24.0, on=False), PlcPower(time_s=27.0, on=True)))
SWITCH = Actuator(pwm_period_s=2.0, resolution_s=0.1, minimum_on_s=0.2)


@cache
def short_run(target, *, ramped=False, actuator=SWITCH, input_=None, **known):
    which = controller_for(target)
    design = PidDesign(gain_pct_per_degC=0.9 if target == "s5-ob251" else 4.0, integral_time_s=30.0, derivative_time_s=2.0, sample_time_s=1.0,
                       structure="pid", method="")
    words = which.encode(design, which.scaled(input_, (0.0, 150.0)))
    if ramped:
        ramp = which.ramp(words, 60.0, 6.0)
        words = replace(words, ramp=Ramp(step=2 * ramp.step, calls=2, hold=ramp.hold))
    return simulate(which, words, PLANT, SHORT, actuator, known)


def files_of(trace):
    told = Certificate(verdict="PASS", setpoint_degC=trace.setpoint_degC, actuator=trace.actuator, switches=trace.switches)
    return controller_for(trace.words.target).export(trace.words, told)


def compared_with(trace, files, monkeypatch):
    controller = controller_for(trace.words.target)
    monkeypatch.setattr(type(controller), "export", staticmethod(lambda *_: files))
    return compare_text(controller, trace.words, trace, trace.switches).departs


GEN = pulsegen(pwm_period_s=2.0, call_interval_s=0.1, minimum_s=0.2)


@pytest.mark.parametrize(("target", "how"), [
    *product(("s7-300", "fb41"), ({"actuator": GEN},)), *product(FILES, ({}, {"ramped": True})), *((target, {"input_": "4-20mA"}) for target in FILES if target != "weg"),
    ("pid-compact", {}), ("pid-temp", {}), ("pid-compact", {"anti_windup": "late", "integral": "trapezoid", "history": "zero"})])
def test_a_text_follows_a_short_run(target, how):
    trace = short_run(target, **how)
    assert len(set(trace.power_asked_pct)) > 12
    assert compare_text(controller_for(target), trace.words, trace) == ComparisonResult()


def proven(target, *, ramp=None, tv=0.0, scaling=None, **conditions):
    """A first look at PI or PID words; the heater passes with them or not."""
    wished = PidDesign(gain_pct_per_degC=1.4 if tv else 2.5, integral_time_s=40.0, derivative_time_s=tv, sample_time_s=3.0,
                       structure="pid" if tv else "pi", method="")
    words = chain.encode(wished, target, scaling=scaling or Scaling(low_degC=10.0, high_degC=110.0))
    if ramp is not None:
        words = replace(words, ramp=controller_for(target).ramp(words, *ramp))
    return chain.prove(words, model_by_hand(HEATER), Conditions(setpoint_degC=51.0, **conditions), first_look=True)


def departs(proof):
    return compare_text(controller_for(proof.words.target), proof.words, proof.nominal).departs


@pytest.mark.long
@pytest.mark.parametrize(("target", "asked"), [
    ("s5-ob251", {"tv": 6.0}), ("s5-ob251", {"ramp": (5.0, 4.0), "pwm_period_s": 12.0, "minimum_on_s": 0.7, "minimum_off_s": 0.9}),
    ("s5-ob251", {"pwm_period_s": 7.0 / 3.0}), ("s7-300", {"ramp": (5.0, 4.0), "pwm_period_s": 12.0, "minimum_on_s": 0.7}),
    ("s7-300", {"tv": 6.0, "pwm_period_s": 1.5, "pwm_resolution_s": 0.05}), ("fb41", {"ramp": (9.0,), "noise_degC": 0.3}),
    ("fb41", {"tv": 6.0, "pwm_period_s": 3.0, "pwm_rule": "pulsegen"}), ("weg", {"tv": 6.0, "noise_degC": 0.3}),
    ("weg", {"ramp": (5.0, 4.0), "pwm_period_s": 12.0, "minimum_on_s": 0.7, "minimum_off_s": 0.9}),
    ("weg", {"ramp": (9.0,), "pwm_period_s": 3.0, "pwm_rule": "pid-compact"}), ("pid-compact", {"tv": 6.0, "noise_degC": 0.3}),
    ("pid-temp", {"tv": 6.0, "pwm_period_s": 1.5, "pwm_resolution_s": 0.05, "minimum_on_s": 0.2})])
def test_the_text_does_what_was_proven(target, asked):
    proof = proven(target, **asked)
    assert len(set(proof.nominal.power_asked_pct)) > 20
    assert compare_text(controller_for(target), proof.words, proof.nominal) == ComparisonResult()


@pytest.mark.long
@pytest.mark.parametrize("setting", [
    {"anti_windup": "freeze"}, {"anti_windup": "none", "edge": "runs_at_once"}, {"order": "by_parts"}, {"filter": "exact"}])
def test_wegs_own_block_is_run_under_every_setting_and_ours_under_its_own(setting):
    controller, (words, actuator) = controller_for("weg"), next(loops("weg"))
    trace = simulate(controller, words, PLANT, STORY, actuator, setting)
    assert compare_text(controller, words, trace) == ComparisonResult()
    assert compare_text(controller, words, simulate(controller, words, PLANT, STORY, actuator)) == ComparisonResult()
    files = controller.export(words, Certificate(verdict=""))
    assert list(controller.load_exported(files, assumptions_from(controller.assumptions, setting))) == ["weg_pid_call.st"]
    assert list(controller.load_exported(files, controller.assumptions())) == ["weg_pid_call.st", "weg_pid_block.st", "weg_pid_plcopen.xml"]


@pytest.mark.long
def test_a_start_up_as_chosen_is_that_of_the_text():
    proof = proven("s5-ob251", tv=6.0, switches={"start_up": "retained"})
    which = controller_for("s5-ob251")
    assert compare_text(which, proof.words, proof.nominal, proof.stated_settings) == ComparisonResult()
    assert compare_text(which, proof.words, proof.nominal).departs is not None  # a text that clears goes on from cold
    cleared = proven("s5-ob251", tv=6.0).nominal
    assert cleared.power_asked_pct.tolist() != proof.nominal.power_asked_pct.tolist()
    assert compare_text(which, proof.words, cleared, proof.stated_settings) == ComparisonResult()  # a CPU without a battery


@pytest.mark.long
@pytest.mark.parametrize("who", ["caller", "skipped", "block"])
def test_whoever_keeps_ts_the_text_does_what_was_proven(who):
    proof = proven("weg", switches={"sampling": who})
    assert compare_text(controller_for("weg"), proof.words, proof.nominal, proof.stated_settings) == ComparisonResult()


@pytest.mark.long
@pytest.mark.parametrize(("target", "name"), [("s5-ob251", "4-20mA"), ("fb41", "thermocouple"), ("s7-300", "4-20mA")])
def test_a_text_for_another_range_of_the_module_does_what_was_proven(target, name):
    own = controller_for(target)
    proof = proven(target, scaling=sensor_scaling(own.ranges, name, (10.0, 110.0) if name == "4-20mA" else None))
    assert compare_text(own, proof.words, proof.nominal) == ComparisonResult()


#: target → a pattern of its text, what stands there instead
PLANTED = [
    ("s5-ob251", r"SRW 3", "SRW 2"), ("s5-ob251", r"KF = \+01382;( +K )", r"KF = +01383;\1"),
    ("s5-ob251", r":T  DW 22 ", ":T  DW 23 "), ("s5-ob251", r"(OUT  :L  DW 6.*\n +:L  KF \+)(\d+)", r"\g<1>39"),
    ("s5-ob251", r":SU D 11\.2", ":RU D 11.2"), ("s5-ob251", r"(;IF AHEAD > ASKED\n +:L  DW 0\n +):<=F", r"\1:>F"),
    ("s7-300", r"/R    ;", "*R    ;"), ("s7-300", r"DTR   ;", "NOP   0;"), ("s7-300", r"ou1:  L     1\.0", "ou1:  L     9.0"),
    ("s7-300", r"L     L#13824;", "L     L#13000;"), ("s7-300", r"CALL  FC 101;\r\nEND_ORG", "NOP   0;\r\nEND_ORG"),
    ("fb41", r"GAIN := \d", "GAIN := 9"), ("fb41", r"SP_INT := DB101\.DBD    2", "SP_INT := DB101.DBD    6"),
    ("fb41", r"SRD   12;", "SRD   11;"), ("fb41", r"COM_RST := TRUE", "COM_RST := FALSE"),
    ("fb41", "PVPER_ON := TRUE", "PVPER_ON := FALSE"), ("s7-300", "  AUTO := FALSE", "  AUTO := TRUE"), ("s7-300", "LEAST := 2765", "LEAST := 2766"), ("s7-300", "MOST := 26956", "MOST := 26955"), ("s5-ob251", r"KF \+205\n", "KF +206\n"),
    *(("s7-300 PULSEGEN", there, instead) for there, instead in (
        ("PER_TM := T#2000MS", "PER_TM := T#1000MS"), ("P_B_TM := T#200MS", "P_B_TM := T#900MS"), (" CYCLE := T#100MS", " CYCLE := T#50MS"),
        ("STEP3_ON := FALSE", "STEP3_ON := TRUE"), ("SYN_ON := FALSE", "SYN_ON := TRUE"), ("INV := #share", "INV := 0.0"), ("  PER_TM := T#2000MS ;", ""))),
    ("s7-300", r"PER_CALL := L#10", "PER_CALL := L#9"), ("s7-300", r"      L     -32768;", "      L     32767;"),
]


@pytest.mark.parametrize(("target", "there", "instead"), PLANTED)
def test_a_fault_in_the_text_is_noticed(target, there, instead, monkeypatch):
    target, _, block = target.partition(" ")
    trace = short_run(target, ramped="ASKED" in there, actuator=GEN if block else SWITCH)
    files, file = files_of(trace), FILES[target]
    broken, count = re.subn(there, instead, files[file])
    assert count, files[file]
    assert compared_with(trace, files | {file: broken}, monkeypatch).startswith(f"{file}: ")


def loaded(trace, files=None):
    controller = controller_for(trace.words.target)
    loads = controller.load_exported(files or files_of(trace), assumptions_from(controller.assumptions, trace.switches))
    return loads[FILES[trace.words.target]]()


@pytest.mark.parametrize("target", ["s7-300", "fb41"])
def test_an_underflow_that_does_not_take_the_power_away_is_seen(target):
    trace = short_run(target, actuator=Actuator(pwm_period_s=2.0, minimum_rule="carry"))  # so all there is is the power asked for
    source = files_of(trace)[FILES[target]]
    line = "      L     -32768;"
    assert source.count(line) == 1
    blind = loaded(trace, {FILES[target]: source.replace(line, "      L     1;")})
    for text, power in ((loaded(trace), 0.0), (blind, 100.0)):
        assert text.tick(9000, 100, 0.0)[1] is None
        assert text.interrupt() == (power, None)


def test_an_output_beyond_its_limits_is_no_power_beyond_100_pct():
    text = loaded(short_run("fb41"))
    for output, power in ((150.0, 100.0), (100.5, 100.0), (-3.0, 0.0), (37.5, 37.5)):
        text.force(output)
        assert text.outcome() == (output, power)
    text = loaded(short_run("s7-300"))
    for output, power in ((27648, 100.0), (-5, 0.0), (32767, 100.0), (-32768, 0.0)):
        text.force(output)
        assert text.outcome() == (output, power)


@pytest.mark.parametrize("target", ["s7-300", "fb41"])
def test_a_period_holds_the_nearest_number_of_ticks(target):
    # by hand: share of the period, halves up
    ticks, chance = 7000, random.Random(3)
    text = loaded(short_run(target, actuator=Actuator(pwm_period_s=70.0, resolution_s=0.01)))
    full = 27648 if target == "s7-300" else 100
    for _ in range(300):
        output = chance.randint(0, 27648) if target == "s7-300" else as_real(bits_of(chance.uniform(0.0, 100.0)))
        text.begin(output, ticks)
        assert text.tick_count() == math.floor(Fraction(output) * ticks / full + Fraction(1, 2)), output


def test_a_little_below_half_a_tick_a_text_may_round_down(monkeypatch):
    # 444 ticks in 0.888 s: the REAL nearest to 100/888 % is less than half a tick by 3e-10 of one, which on_time takes as half a tick
    design = PidDesign(gain_pct_per_degC=4.0, integral_time_s=30.0, derivative_time_s=0.0, sample_time_s=0.888, structure="pi", method="")
    controller = controller_for("weg")
    words, actuator = controller.encode(design, Scaling(low_degC=0.0, high_degC=150.0)), Actuator(pwm_period_s=0.888, resolution_s=0.002)
    trace = simulate(controller, words, PLANT, SHORT, actuator, {})
    assert compare_text(controller, words, trace) == ComparisonResult()
    monkeypatch.setattr(of_text, "_BELOW_HALF", 0.0)
    assert "0 ticks of a period are on at 0.112613 %; proven are 1" in compare_text(controller, words, trace).departs


@pytest.mark.parametrize(("actuator", "made"), [
    (Actuator(pwm_period_s=10.0, resolution_s=1.0), True), (Actuator(pwm_period_s=0.5, resolution_s=0.5), True),
    (Actuator(pwm_period_s=10.0, resolution_s=0.3), False), (Actuator(pwm_period_s=770.0), True), (Actuator(pwm_period_s=770.01), False)])
def test_pulses_are_made_where_they_are_whole_ticks_and_their_product_fits(actuator, made):
    trace = short_run("s7-300")
    files = controller_for("s7-300").export(trace.words, Certificate(verdict="", actuator=actuator))
    assert (loaded(trace, files).tick_count() is not None) == made


def test_a_short_run_restarts_from_what_the_text_leaves_and_from_cold():
    which = controller_for("s5-ob251")
    kept, cleared = short_run("s5-ob251", start_up="retained"), short_run("s5-ob251")
    assert kept.power_asked_pct.tolist() != cleared.power_asked_pct.tolist()
    assert compare_text(which, kept.words, kept, {"start_up": "retained"}) == ComparisonResult()
    assert compare_text(which, cleared.words, cleared, {"start_up": "retained"}) == ComparisonResult()  # a CPU without a battery
    assert compare_text(which, kept.words, kept).departs is not None


@pytest.mark.long
def test_a_proof_whose_text_does_other_is_none(monkeypatch):
    proof = proven("s7-300", ramp=(3.0, 4.0))
    assert (proof.verdict, as_exported(proof).verdict) == ("PASS", "PASS")
    monkeypatch.setattr(of_text, "compare_text", lambda *_, **__: ComparisonResult("at 3 s it asks for 7 %"))
    monkeypatch.setenv("HEATERTUNE_CACHE", "")  # what was seen of the same words in the same runs is remembered
    other = as_exported(proof)
    assert other.verdict == "NOT PROVEN"
    assert "the exported program behaves differently from what was proven" in verdict_line(other.to_document())


@pytest.mark.long
def test_the_clock_is_looked_at_in_one_run_and_each_power_in_one(monkeypatch):
    words, looked, pulses = proven("s7-300").words, [], {}
    heaters = HEATER, replace(HEATER, gain_degC_per_pct=0.9 * HEATER.gain_degC_per_pct)
    proofs = [chain.prove(words, model_by_hand(heater), Conditions(setpoint_degC=51.0), first_look=True) for heater in heaters]
    for name in ("_of_ticks", "_periods"):
        part = getattr(of_text._Comparison, name)
        monkeypatch.setattr(of_text._Comparison, name, lambda *given, name=name, part=part: (looked.append((name, *given[1:2])), part(*given))[1])
    for proof in proofs:
        assert compare_text(controller_for("s7-300"), words, proof.nominal, proof.stated_settings, pulses=pulses) == ComparisonResult()
    assert [name for name, *_ in looked] == ["_of_ticks", "_periods", "_periods"]
    (_, first), (_, second) = looked[1:]
    assert min(len(first), len(second)) > 0
    assert not set(first) & set(second)


@pytest.mark.parametrize(("target", "file", "there", "instead", "named"), [
    ("s5-ob251", "program_listing.txt", ":SRW 3", ":SRX 3", r"line \d+: statement 'SRX 3'"),
    ("s5-ob251", "program_listing.txt", "JU =OUT", "JU =OFF", r"line \d+: statement 'JU =OFF'"),
    ("s5-ob251", "program_listing.txt", "C  DB 31", "C  DB 77", r"line \d+: statement 'C DB 77'; the CPU stops here"),
    ("s5-ob251", "program_listing.txt", "JC =BROK", "JC =OUT\nA1 :JU =A1", r"line \d+: .*does not come to the end"),
    ("s7-300", "s7_300_pid.awl", "RND   ;", "RND+  ;", r"line \d+: statement 'RND\+'"),
    ("s7-300", "s7_300_pid.awl", "T     #OUT;", "T     #OUTS;", r"line \d+: statement 'T #OUTS'"),
    ("s7-300", "s7_300_pid.awl", "JC    auto;", "JC    away;", r"line \d+: statement 'JC away'"),
    ("fb41", "fb41_cont_c.awl", "CALL  FC 101;", "CALL  FC 109;", r"line \d+: statement 'CALL FC 109'"),
    ("fb41", "fb41_cont_c.awl", "ORGANIZATION_BLOCK OB 35", "ORGANIZATION_BLOCK OB 34", "OB 35: the source has no such block"),
    ("weg", "weg_pid_call.st", "HeaterWasOn := HeaterOn;", "WHILE HeaterOn;", r"line \d+: 'WHILE HeaterOn;'"),
    ("weg", "weg_pid_block.st", "KdByTs := Kd / Seconds;", "KdByTs := Kd / Ts;", r"line \d+: 'KdByTs := Kd / Ts;'; / does not go with"),
    ("weg", "weg_pid_block.st", "MOD 1000", "MOD 0", r"line \d+: 'HeaterSince := HeaterSince MOD 0;'; a controller stops here"),
    ("weg", "weg_pid_plcopen.xml", "KdByTs := Kd / Seconds;", "KdByTs := Kd;", "its HT_WEG_PID is not that of weg_pid_block.st"),
    ("weg", "weg_pid_plcopen.xml", "KdByTs := Kd / Seconds;", "KdByTs ::= Kd;", r"HT_WEG_PID: line \d+: 'KdByTs ::= Kd;'"),
    ("weg", "weg_pid_plcopen.xml", "T#100ms", "T#200ms", "its task calls HEATER every 200 ms"),
    ("weg", "weg_pid_plcopen.xml", "</project>", "", "this is no XML"),
])
def test_a_statement_that_no_cpu_knows_is_named(target, file, there, instead, named, monkeypatch):
    trace = short_run(target)
    files = files_of(trace)
    assert there in files[file], files[file]
    broken = files | {file: files[file].replace(there, instead)}
    assert re.match(f"{re.escape(file)}: .*{named}", compared_with(trace, broken, monkeypatch))


@pytest.mark.long
def test_what_is_not_run_is_bounded_and_told(monkeypatch):
    # a period of 60,000 ticks would take minutes, power by power
    monkeypatch.setattr(of_text, "_MOST_OF_PWM", 1000)
    monkeypatch.setattr(of_text, "_MOST_CALLS", 200)
    (words, _), run = next(loops("s7-300")), []
    monkeypatch.setattr(ExportedS7, "go_on", lambda machine, went=ExportedS7.go_on: run.append(machine) or went(machine))
    trace = simulate(controller_for("s7-300"), words, PLANT, STORY, Actuator(pwm_period_s=600.0))
    assert compare_text(controller_for("s7-300"), words, trace) == ComparisonResult(not_run=(
        "what the exported program does after 200 calls", "the exported PWM after 1000 ticks of a period"))
    powers = len(set(trace.power_asked_pct[:200]))
    assert 1000 < len(run) <= 1000 + powers + 4  # and beside both ends
    proof = proven("s5-ob251")
    left = as_exported(proof).diagnostics.not_tested
    assert left[:-2] == proof.diagnostics.not_tested
    assert left[-2] == "what the exported program does after 200 calls"
    assert re.fullmatch(r"the exported PWM at \d+ of \d+ powers", left[-1])


@pytest.mark.parametrize("target", ["weg", "fb41", "s7-300", "s5-ob251"])
def test_a_clock_that_ticks_too_often_for_a_call_is_told(monkeypatch, target):
    monkeypatch.setattr(of_text, "_MOST_TICKS", 1)
    proof = proven(target)
    shown = compare_text(controller_for(target), proof.words, proof.nominal)  # and the sensor that was broken is whole when the pulses are compared
    assert shown.departs is None
    assert "an exported clock of more than 1 ticks a call" in shown.not_run


def test_a_statement_that_no_cpu_here_knows_is_told():
    with pytest.raises(InputError, match="line 2: statement 'XYZ DW 3'"):
        S5Cpu("FB 1\n     :XYZ DW 3\n     :BE\n", {})
    with pytest.raises(InputError, match="line 2: 'what'"):
        S5Cpu("FB 1\nwhat\n", {})
    with pytest.raises(InputError, match="line 3: statement 'XYZ 3'"):
        S7Cpu("FUNCTION FC 1 : VOID\nBEGIN\n      XYZ   3;\nEND_FUNCTION\n", {})


@pytest.mark.long
def test_an_analog_output_makes_no_pulses():
    controller = controller_for("fb41")
    words = proven("fb41").words
    files = controller.export(words, Certificate(verdict="", actuator=Actuator(pwm_period_s=3.0, minimum_rule="carry")))
    assert controller.load_exported(files, controller.assumptions())["fb41_cont_c.awl"]().begin(50.0, 300) is None


@pytest.mark.long
def test_a_program_with_known_faults_passes_only_where_they_are_accepted(tmp_path):
    """As the standard prints it, the PID is a PID while it runs in automatic and nothing limits it: its limits are kept here."""
    fitted = model_by_hand(Fopdt(gain_degC_per_pct=0.4, time_constant_s=200.0, dead_time_s=10.0, ambient_degC=22.0))
    design = PidDesign(gain_pct_per_degC=2.273, integral_time_s=200.0, derivative_time_s=0.0, sample_time_s=20.0, structure="pi", method="")
    words = chain.encode(design, "iec-pid-text")
    spec = tmp_path / "spec.toml"
    spec.write_text('[limits]\novershoot = "300 %"\n[story]\nopen-circuit = false\n')
    asked = Conditions(setpoint_degC=27.0, spec=str(spec), switches={"time_unit": "s"})
    for accepted, verdict in (((), "NOT PROVEN"), (("known-faults",), "PASS")):
        proof = as_exported(chain.prove(words, fitted, replace(asked, accept=accepted)))
        assert (proof.verdict, [finding.name for finding in proof.diagnostics.findings]) == (verdict, ["known-faults"])
