"""PID_Compact and PID_Temp: words, the exported SCL and table and what their machine makes of them, and what is read back."""

import csv
import re
from dataclasses import replace

import pytest

from heatertune.errors import InputError, NotRepresentable, OutOfRange
from heatertune.model.model_values import Fopdt
from heatertune.pid.design_values import PidDesign, structure_of
from heatertune.plc import Certificate, Scaling, controller_for
from heatertune.plc.cpu.iec.machine import Firmware
from heatertune.plc.dump_reader import read_machine
from heatertune.plc.pid_compact.export import LAW, FirmwareInstruction, literal, load, load_program
from heatertune.plc.pid_compact.step import PidCompactAssumptions
from heatertune.plc.pid_compact.words import COMPACT, PARAMETERS, TEMP, fields_of
from heatertune.plc.pwm import Actuator, pid_compact
from heatertune.plc.single_precision import single
from heatertune.proof import Scenario, simulate
from heatertune.proof.prove_words import actuator_for
from heatertune.proof.text_comparison import compare_text
from heatertune.settings import Conditions

BOTH = pytest.mark.parametrize("target", ["pid-compact", "pid-temp"])
TAGS = {"pid-compact": COMPACT, "pid-temp": TEMP}
OWN = pid_compact(pwm_period_s=4.0, call_interval_s=0.1, minimum_on_s=0.2)


def _words(target, gain=2.5, tn=80.0, tv=6.0, ta=4.0, **changed):
    design = PidDesign(gain_pct_per_degC=gain, integral_time_s=tn, derivative_time_s=tv, sample_time_s=ta,
                       structure=structure_of(tn, tv), method="")
    words = controller_for(target).encode(design, Scaling(low_degC=-10.0, high_degC=240.0))
    return replace(words, values=words.values | changed)


def _files(target, words=None, actuator=OWN):
    said = Certificate(verdict="PASS", lines=("one line",), setpoint_degC=60.0, actuator=actuator)
    return controller_for(target).export(words or _words(target), said)


def _source(target, **kwargs):
    return _files(target, **kwargs)[f"{TAGS[target].files}_words.scl"]


def _assigned(text):
    return dict(re.findall(r'^"\w+"\.([\w.]+) := ([^";]+);', text, re.MULTILINE))


def _read(target, text):
    return read_machine(controller_for(target), text.encode(), sample_time_s=4.0, source="block.txt",
                        scaling=Scaling(low_degC=-10.0, high_degC=240.0))


def test_a_design_becomes_words_in_seconds_with_the_lag_of_its_filter():
    v = _words("pid-compact").values
    # f = 1/2: the lag is one cycle, 4 s of Td 6 s
    assert v == {"Gain": 2.5, "Ti": 80.0, "Td": 6.0, "TdFiltRatio": single(4.0 / 6.0), "PWeighting": 1.0, "DWeighting": 0.0,
                 "Cycle": 4.0, "OutputUpperLimit": 100.0, "OutputLowerLimit": 0.0, "InvertControl": 0, "IntegralResetMode": 1}
    assert _words("pid-compact", tn=float("inf"), tv=0.0).values["Ti"] == 0.0


def test_a_cooler_inverts_pid_compact_and_is_refused_by_pid_temp():
    words = _words("pid-compact", gain=-2.5)
    assert (words.values["Gain"], words.values["InvertControl"]) == (2.5, 1)
    assert controller_for("pid-compact").decode(words).gain_pct_per_degC == -2.5
    with pytest.raises(NotRepresentable, match="pid-compact with InvertControl"):
        _words("pid-temp", gain=-2.5)


@BOTH
@pytest.mark.parametrize(("changed", "named"), [
    ({"OutputLowerLimit": 100.0}, "OutputLowerLimit"), ({"TdFiltRatio": 1e30}, "TdFiltRatio"), ({"Ti": 2e5}, "Ti"),
    ({"PWeighting": 1.5}, "PWeighting"), ({"Cycle": 0.0}, "Cycle")])
def test_words_that_go_beyond_the_manual_are_refused(target, changed, named):
    with pytest.raises(OutOfRange, match=named):
        controller_for(target).decode(_words(target, **changed))


@BOTH
def test_what_is_odd_is_told(target):
    odd = controller_for(target).oddities
    assert odd(_words(target)) == ()
    changed = {"Gain": 0.0, "Ti": 0.0, "PWeighting": 0.5, "OutputUpperLimit": 60.0}
    told = " ".join(odd(_words(target, **changed)))
    assert all(part in told for part in ("Gain is 0", "Ti is 0", "PWeighting is 0.5", "the wrong way", "0…60 %"))
    assert "begins with 0 %" in " ".join(odd(_words(target, IntegralResetMode=0)))


@BOTH
def test_the_head_tells_verdict_setpoint_switch_and_what_is_left_by_hand(target):
    head, tags = _source(target).split("FUNCTION")[0], TAGS[target]
    for part in ("verdict of the proof: PASS", "one line", "proven setpoint: 60 degC", "PWM period 4 s in steps of 0.1 s",
                 "not tried in TIA Portal", "cyclic interrupt OB every 100 ms", f"wire {tags.pulses}", "-10...240 degC"):
        assert part in head
    assert _files(target)[f"{tags.files}_rollback.scl"].count("LoadBackUp := TRUE;") == 1


def test_the_pulses_of_the_block_are_configured_where_they_are_the_proven_ones():
    told = _assigned(_source("pid-compact"))
    assert (told["Config.MinimumOnTime"], told["Config.MinimumOffTime"], told["CycleTime.Value"]) == (
        "0.200000003", "0.0", "0.100000001")
    told = _assigned(_source("pid-temp", actuator=pid_compact(pwm_period_s=2.0, call_interval_s=0.1)))
    assert (told["Config.Output.Heat.PwmPeriode"], told["Config.Output.Heat.Select"]) == ("2.0", "1")
    assert _assigned(_source("pid-temp"))["Config.Output.Heat.PwmPeriode"] == "0.0"


@pytest.mark.parametrize(("target", "actuator", "why"), [
    ("pid-compact", None, "no switch is known"), ("pid-compact", Actuator(pwm_period_s=4.0), "another rule"),
    ("pid-compact", pid_compact(pwm_period_s=2.0, call_interval_s=0.1), "its period is not Cycle, 4 s"),
    ("pid-temp", pid_compact(pwm_period_s=8.0, call_interval_s=0.1), "its period is above Cycle, 4 s"),
    ("pid-compact", pid_compact(pwm_period_s=4.0, call_interval_s=0.3), "no organization block"),
    ("pid-temp", pid_compact(pwm_period_s=4.0, call_interval_s=0.1, minimum_on_s=4.0), "fill the period")])
def test_another_switch_is_left_behind_the_output_and_the_head_says_why(target, actuator, why):
    text = _source(target, actuator=actuator)
    assert why in text
    assert f"wire {TAGS[target].power} through a PWM of yours" in text
    assert "MinimumOnTime :=" not in text


def test_limits_of_the_reading_are_those_of_the_sensor_and_not_the_blocks_defaults():
    told = _assigned(_source("pid-compact"))
    assert told["Config.InputScaling.LowerPointOut"] == told["Config.SetpointLowerLimit"] == "-10.0"
    assert told["Config.InputScaling.UpperPointOut"] == told["Config.SetpointUpperLimit"] == "240.0"
    assert float(told["Config.InputLowerLimit"]) < -10.0
    assert float(told["Config.InputUpperLimit"]) > 240.0 + 0.18 * 250.0  # as far as an analog input reads


def test_pid_temp_heats_alone_and_its_scaling_is_one_to_one():
    told = _assigned(_source("pid-temp", words=_words("pid-temp", OutputUpperLimit=60.0)))
    assert told["Config.ActivateCooling"] == "FALSE"
    assert told["Retain.CtrlParams.Heat.DeadZone"] == "0.0"
    assert told["Retain.CtrlParams.Heat.ControlZone"] == "3.402822E38"
    assert {told[f"Config.Output.Heat.{name}"] for name in ("PidUpperLimit", "UpperScaling", "PwmUpperScaling")} == {"60.0"}


@BOTH
def test_the_function_of_the_words_saves_those_of_before_once(target):
    tags, words = TAGS[target], _words(target)
    kinds = FirmwareInstruction(tags, fields_of(tags), PidCompactAssumptions(), LAW).firmware.variables
    text = load(tags, words, OWN) + 'FUNCTION "HeaterCall" : Void\nBEGIN\nEND_FUNCTION\n'
    program = load_program(text, tags, Firmware(kinds, lambda: lambda _given: {}))
    active, saved = ([f"PID.{tag(name).replace('.', '_')}" for name in PARAMETERS] for tag in (tags.active, tags.saved))
    before = [1.0, 20.0, 0.0, 0.2, 1.0, 1.0, 1.0]  # the block's own defaults
    for at, value in zip(active, before, strict=True):
        program[at] = value
    for _ in range(2):  # a second start-up finds the new words, and leaves what was saved
        program["Starts"] = True
        program.scan()
        assert [program[at] for at in active] == [words.values[name] for name in PARAMETERS]
        assert [program[at] for at in saved] == before


@BOTH
@pytest.mark.parametrize(("find", "put", "said"), [
    (".Gain := 2.5;", ".Gain := 2.4;", "it asks for"), ("Config.InputPerOn := TRUE", "Config.InputPerOn := FALSE", "InputPerOn"),
    ("UpperPointOut := 240.0", "UpperPointOut := 200.0", "it asks for"), ("CycleTime.Value := 0.1", "CycleTime.Value := 0.3", "its clock ticks"),
    ("SetpointUpperLimit := 240.0", "SetpointUpperLimit := 40.0", "it asks for"), ("Reading >= 32512", "Reading > 32767", "after a broken sensor"),
    ('FUNCTION "HeaterCall"', 'FUNCTION "Call"', "HeaterCall"), ('_1".IntegralResetMode', '_2".IntegralResetMode', "is not of PID_"),
    ("IntegralResetMode := 1", "IntegralResetMode := 0", "it asks for")])
def test_a_changed_source_is_found_by_running_it(target, find, put, said, monkeypatch):
    heater = Fopdt(gain_degC_per_pct=1.2, time_constant_s=90.0, dead_time_s=6.0, ambient_degC=20.0)
    controller, words = controller_for(target), _words(target)
    trace = simulate(controller, words, heater, Scenario(setpoint_degC=60.0, duration_s=120.0), OWN)
    assert compare_text(controller, words, trace).departs is None
    name, files = f"{TAGS[target].files}_words.scl", _files(target)
    assert find in files[name]
    files[name] = files[name].replace(find, put)
    monkeypatch.setattr(type(controller), "export", staticmethod(lambda *_: files))
    assert said in str(compare_text(controller, words, trace).departs)


@BOTH
def test_the_table_has_the_columns_of_a_watch_table_and_every_parameter_once(target):
    rows = list(csv.reader(_files(target)[f"{TAGS[target].files}_watch.csv"].splitlines()))
    heads = [row for row in rows if len(row) == 6]
    assert heads[0] == ["Name", "Address", "Display format", "Monitor value", "Modify value", "Comment"]
    names = [row[0].split(".", 1)[1] for row in heads[1:]]
    assert len(names) == len(set(names))
    assert {field.address for field in fields_of(TAGS[target])} <= set(names)
    assert all(len(row) == 1 and row[0].startswith("//") for row in rows[: len(rows) - len(heads)])


@BOTH
def test_source_and_table_come_back_and_a_changed_program_is_told(target):
    words = _words(target, OutputUpperLimit=60.0)
    for text in list(_files(target, words).values())[::2]:
        read = _read(target, text)
        assert read.words == words
    source = _source(target, words=words)
    assert _read(target, source).unlike(words) == ()
    for find, put in (("(#Reading >= 32512) OR ", ""), ("END_IF;", "END_IF;\nOther(In := 1);"), ("IF NOT", "IF")):
        assert _read(target, source.replace(find, put, 1)).unlike(words) != ()


@BOTH
def test_configuration_that_is_not_the_proven_one_is_told_from_source_and_table(target):
    words = _words(target)
    for text in list(_files(target, words).values())[::2]:
        assert _read(target, text).unlike(words) == ()
        assert all("CycleTime" in each or "Minimum" in each or "Select" in each or "Pwm" in each for each in _read(target, text).passed_over)
        for find, put, told in (("240.0", "300.0", "Config.InputScaling.UpperPointOut is 300.0, not 240.0"),
                                ("SubstituteOutput := 0.0", "SubstituteOutput := 50.0", "SubstituteOutput is 50.0, not 0.0"),
                                ('SubstituteOutput",,Floating-point number,,0.0', 'SubstituteOutput",,x,,50.0', "SubstituteOutput is 50.0")):
            if find in text:
                assert told in _read(target, text.replace(find, put, 1)).unlike(words)[0]
    other = replace(words, scaling=Scaling(low_degC=-10.0, high_degC=100.0))
    assert "UpperPointOut is 240.0, not 100.0" in _read(target, _source(target)).unlike(other)[0]


def test_a_list_of_tags_is_read_with_and_without_the_instance():
    text = "\n".join(f"{prefix}{field.address} {sign} {value}{end}" for (prefix, sign, end), (field, value) in zip(
        5 * [('"PID 1".', ":=", ";"), ("#pid.", ":=", ""), ("", "=", ";")],
        zip(fields_of(COMPACT), ("1.5", "2e1", "0.0", "0.2", "1", "0.0", "4.0", "100.0", "0.0", "FALSE", "4"), strict=True), strict=False))
    text = text.replace("#pid.", "")
    read = _read("pid-compact", f"// as noted\n{text}\nDisturbance := 0.0; // no word\n")
    assert (read.words.values["Gain"], read.words.values["Ti"], read.words.values["IntegralResetMode"]) == (1.5, 20.0, 4)
    assert "Disturbance := 0.0 (line 13)" in read.passed_over


@pytest.mark.parametrize(("target", "find", "put", "parts"), [
    ("pid-compact", "Retain.CtrlParams.Gain := 2.5", "sRet.r_Ctrl_Gain := 2.5", ("sRet.r_Ctrl_Gain", "V1 of the block")),
    ("pid-compact", "Retain.CtrlParams.Ti := 80.0", "Retain.CtrlParams.Ti := T#80s", ("Ti", "'T#80s'")),
    ("pid-compact", "Retain.CtrlParams.Ti := 80.0", "Retain.CtrlParams.Ti := -1.0", ("Ti", "'-1.0'", "0…100000")),
    ("pid-compact", '"PID_Compact_1".Retain.CtrlParams.Ti := 80.0;', "", ("Ti (Retain.CtrlParams.Ti) is missing",)),
    ("pid-compact", "Config.InputPerOn := TRUE", "Config.InputPerOn := FALSE", ("Config.InputPerOn", "'FALSE'", "Input_PER")),
    ("pid-compact", "Config.InputPerOn := TRUE", "Retain.CtrlParams.DeadZone := 0.5", ("DeadZone", "'0.5'", "dead zone")),
    ("pid-compact", "END_FUNCTION", "END_FUNCTION\nGain 7", ("line 65", "'Gain 7'", "END_FUNCTION")),
    ("pid-temp", "ActivateCooling := FALSE", "ActivateCooling := TRUE", ("Config.ActivateCooling", "the proof of this target has no cooling")),
    ("pid-temp", "ControlZone := 3.402822E38", "ControlZone := 40.0", ("ControlZone", "'40.0'", "control zone")),
    ("pid-temp", "Heat.Gain := 2.5", "Heat.Gain := 2.5.5", ("Gain", "'2.5.5'"))])
def test_a_bad_line_is_told_by_number_field_and_value(target, find, put, parts):
    text = _source(target)
    assert find in text
    with pytest.raises(InputError) as refused:
        _read(target, text.replace(find, put, 1))
    assert all(part in str(refused.value) for part in ("block.txt", *parts)), refused.value


@pytest.mark.parametrize(("text", "parts"), [
    ("Name,Display format,Modify value\n\"P\".Retain.CtrlParams.Gain,x\n", ("line 2", "watch table")),
    ("Name,Display format,Modify value\n3,x,4\n", ("line 2", "name", "'3'")),
    ("Names,Display format,Modify value\n\"P\".Retain.CtrlParams.Gain,x,1\n", ("line 2", "watch table")),
    ("Gain\n", ("Gain and Ti", "Gain = 2.5"))])
def test_a_bad_row_is_told(text, parts):
    with pytest.raises(InputError) as refused:
        _read("pid-compact", text)
    assert all(part in str(refused.value) for part in ("block.txt", *parts)), refused.value


@pytest.mark.parametrize("value", [0.0, 1.0, 0.1, 1e-7, 1e-45, 3.4028234663852886e38, 123456.789, 1e6, 1e7, 2.0**-126, 27648.0])
def test_a_literal_has_a_point_and_is_the_same_number_again(value):
    text = literal(single(value))
    assert re.fullmatch(r"\d+\.\d+(E-?\d+)?", text)
    assert single(float(text)) == single(value)


@BOTH
def test_without_a_switch_told_the_pwm_is_the_blocks_own(target):
    switch = actuator_for(Conditions(), _words(target, ta=17.0))
    assert (switch.block, switch.minimum_rule) == ("pid-compact", "carry")
    assert switch.pwm_period_s == (17.0 if target == "pid-compact" else 8.5)
    assert TAGS[target].pulses in _source(target, words=_words(target, ta=17.0), actuator=switch)
    assert actuator_for(Conditions(pwm_period_s=4.0, pwm_rule="burst"), _words(target)).block == "burst"
    assert actuator_for(Conditions(), replace(_words("pid-compact"), target="weg")).block is None
