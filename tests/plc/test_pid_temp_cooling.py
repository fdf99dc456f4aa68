"""PID_Temp with a cooler: words, the exported SCL and table and what their machine makes of them, and what is read back."""

import csv
import re
from dataclasses import replace

import pytest

from heatertune.errors import InputError, NotRepresentable
from heatertune.model.model_values import Fopdt
from heatertune.pid.design_values import PidDesign
from heatertune.plc import Certificate, Scaling, controller_for
from heatertune.plc.controller import with_cooling
from heatertune.plc.cpu.iec.machine import Firmware
from heatertune.plc.dump_reader import read_machine
from heatertune.plc.pid_compact.export import FirmwareInstruction, load, load_program
from heatertune.plc.pid_temp.controller import cooling_exported
from heatertune.plc.pid_temp.step import CoolingAssumptions
from heatertune.plc.pid_temp.words import COOLING_FIELDS, TEMP_COOLING
from heatertune.plc.pwm import Actuator, pid_compact
from heatertune.plc.single_precision import single
from heatertune.proof import Scenario, simulate
from heatertune.proof.scenario import Load
from heatertune.proof.text_comparison import compare_text

PID_TEMP = controller_for("pid-temp-cooling")
RANGE = Scaling(low_degC=-10.0, high_degC=240.0)
DESIGN = PidDesign(gain_pct_per_degC=2.5, integral_time_s=80.0, derivative_time_s=6.0, sample_time_s=4.0, structure="pid", method="")
WORDS = with_cooling(PID_TEMP.encode(DESIGN, RANGE), 0.4)
TWO_SETS = replace(WORDS, values=WORDS.values | {"AdvancedCooling": 1, "CoolGain": 4.0, "CoolTi": 33.0})
OWN = replace(pid_compact(pwm_period_s=4.0, call_interval_s=0.1, minimum_on_s=0.2), cooling_gain=0.4, cooling_minimum_on_s=0.5,
              cooling_minimum_off_s=0.3)
HEATER = Fopdt(gain_degC_per_pct=1.2, time_constant_s=90.0, dead_time_s=6.0, ambient_degC=20.0)


def _files(words=WORDS, actuator=OWN):
    return PID_TEMP.export(words, Certificate(verdict="PASS", setpoint_degC=60.0, actuator=actuator))


def _assigned(text):
    return dict(re.findall(r'^"\w+"\.([\w.]+) := ([^";]+);', text, re.MULTILINE))


def _read(text):
    return read_machine(PID_TEMP, text.encode(), sample_time_s=4.0, source="block.txt", scaling=RANGE)


def test_the_words_of_a_cooler_ask_for_the_same_by_both_methods():
    v = WORDS.values
    assert (v["AdvancedCooling"], v["CoolFactor"], v["CoolGain"]) == (0, 2.5, 6.25)
    assert [v[f"Cool{name}"] for name in ("Ti", "Td", "TdFiltRatio", "Cycle")] == [v[name] for name in ("Ti", "Td", "TdFiltRatio", "Cycle")]
    assert list(v) == [field.name for field in COOLING_FIELDS]
    heating = controller_for("pid-temp").encode(DESIGN, RANGE).values
    assert {name: v[name] for name in heating if name != "OutputLowerLimit"} == {
        name: value for name, value in heating.items() if name != "OutputLowerLimit"}
    assert PID_TEMP.cooling.design(WORDS).gain_pct_per_degC == 6.25
    assert PID_TEMP.cooling.design(TWO_SETS).integral_time_s == 33.0
    assert PID_TEMP.decode(WORDS).gain_pct_per_degC == 2.5
    with pytest.raises(NotRepresentable, match="CoolFactor"):
        with_cooling(WORDS, 1e-60)
    with pytest.raises(NotRepresentable, match="pid-compact with InvertControl"):
        PID_TEMP.encode(replace(DESIGN, gain_pct_per_degC=-2.5), RANGE)


def test_the_source_configures_both_outputs_as_they_were_proven():
    told = _assigned(_files()["pid_temp_words.scl"])
    expected = {"ActivateCooling": "TRUE", "AdvancedCooling": "FALSE", "CoolFactor": "2.5", "Output.Heat.PidUpperLimit": "100.0",
                "Output.Heat.PidLowerLimit": "0.0", "Output.Cool.PidUpperLimit": "0.0", "Output.Cool.PidLowerLimit": "-100.0",
                "Output.Cool.UpperScaling": "100.0", "Output.Cool.LowerScaling": "0.0", "Output.Cool.PwmUpperScaling": "100.0",
                "Output.Heat.Select": "1", "Output.Cool.Select": "1", "Output.Cool.PwmPeriode": "0.0",
                "Output.Heat.MinimumOnTime": "0.200000003", "Output.Cool.MinimumOnTime": "0.5", "Output.Cool.MinimumOffTime": "0.300000012"}
    assert {name: told[f"Config.{name}"] for name in expected} == expected
    assert told["Retain.CtrlParams.Cool.Gain"] == "6.25"
    assert (told["Retain.CtrlParams.Cool.DeadZone"], told["Retain.CtrlParams.Cool.ControlZone"]) == ("0.0", "3.402822E38")
    head = _files()["pid_temp_words.scl"].split("FUNCTION")[0]
    assert "wire OutputHeat_PWM to the heater's switch and OutputCool_PWM to the cooler's" in head
    assert "beside it a cooler of 0.4 times the heater's power, no pulse of it below 0.5 s, no pause of it below 0.3 s" in head
    shorter = _assigned(_files(actuator=replace(OWN, pwm_period_s=2.0))["pid_temp_words.scl"])
    assert {shorter[f"Config.Output.{side}.PwmPeriode"] for side in ("Heat", "Cool")} == {"2.0"}


def test_another_switch_is_left_behind_both_outputs():
    text = _files(actuator=Actuator(pwm_period_s=4.0, cooling_gain=0.4))["pid_temp_words.scl"]
    assert "wire OutputHeat and OutputCool through a PWM of yours as it was proven" in text
    assert "MinimumOnTime :=" not in text
    filled = _files(actuator=replace(OWN, cooling_minimum_on_s=4.0, cooling_minimum_off_s=None))["pid_temp_words.scl"]
    assert "its shortest times fill the period" in filled


def test_the_function_of_the_words_saves_both_sets_of_before_once():
    kinds = FirmwareInstruction(TEMP_COOLING, COOLING_FIELDS, CoolingAssumptions(), cooling_exported.args[2]).firmware.variables
    text = load(TEMP_COOLING, WORDS, OWN) + 'FUNCTION "HeaterCall" : Void\nBEGIN\nEND_FUNCTION\n'
    program = load_program(text, TEMP_COOLING, Firmware(kinds, lambda: lambda _given: {}))
    names = TEMP_COOLING.parameters
    active, saved = ([f"PID.{tag(name).replace('.', '_')}" for name in names] for tag in (TEMP_COOLING.active, TEMP_COOLING.saved))
    before = [1.0, 20.0, 0.0, 0.2, 1.0, 1.0, 1.0] * 2  # the block's own defaults
    for at, value in zip(active, before, strict=True):
        program[at] = value
    for _ in range(2):
        program["Starts"] = True
        program.scan()
        assert [program[at] for at in active] == [WORDS.values[name] for name in names]
        assert [program[at] for at in saved] == before


@pytest.mark.parametrize("words", [WORDS, TWO_SETS], ids=["factor", "two sets"])
@pytest.mark.parametrize("switches", [{}, {"parameter_set": "both", "integral_kept": "error", "anti_windup": "limited"}])
def test_the_exported_text_asks_for_what_was_proven_heating_and_cooling(words, switches):
    scenario = Scenario(setpoint_degC=60.0, duration_s=1600.0, disturbances=(Load(time_s=800.0, power_pct=60.0),))
    trace = simulate(PID_TEMP, words, HEATER, scenario, OWN, switches)
    assert trace.power_asked_pct.min() < -20.0
    assert compare_text(PID_TEMP, words, trace).departs is None


@pytest.mark.parametrize(("find", "put", "said"), [
    ("CoolFactor := 2.5", "CoolFactor := 2.4", "it asks for"), ("ActivateCooling := TRUE", "ActivateCooling := FALSE", "ActivateCooling"),
    ("AdvancedCooling := FALSE", "AdvancedCooling := TRUE", None), ("Cool.PidLowerLimit := -100.0", "Cool.PidLowerLimit := -10.0", "it asks for")])
def test_a_changed_source_is_found_by_running_it(find, put, said, monkeypatch):
    scenario = Scenario(setpoint_degC=60.0, duration_s=1600.0, disturbances=(Load(time_s=800.0, power_pct=60.0),))
    trace, files = simulate(PID_TEMP, WORDS, HEATER, scenario, OWN), _files()
    assert find in files["pid_temp_words.scl"]
    files["pid_temp_words.scl"] = files["pid_temp_words.scl"].replace(find, put)
    monkeypatch.setattr(type(PID_TEMP), "export", staticmethod(lambda *_: files))
    departs = compare_text(PID_TEMP, WORDS, trace).departs
    assert departs is None if said is None else said in departs  # both methods are made to ask for the same


@pytest.mark.parametrize("words", [WORDS, TWO_SETS], ids=["factor", "two sets"])
def test_source_table_and_rollback_come_back_and_a_changed_configuration_is_told(words):
    files = _files(words)
    for name in ("pid_temp_words.scl", "pid_temp_watch.csv"):
        read = _read(files[name])
        assert read.words == words
        assert read.unlike(words) == ()
    table = files["pid_temp_watch.csv"]
    assert "Config.Output.Cool.UpperScaling is 50.0, not 100.0" in _read(
        table.replace('Output.Cool.UpperScaling",,Floating-point number,,100.0', 'Output.Cool.UpperScaling",,x,,50.0')).unlike(words)[0]
    rows = [row[0].partition(".")[2] for row in csv.reader(table.splitlines()) if len(row) == 6][1:]
    assert len(rows) == len(set(rows))
    assert {field.address for field in COOLING_FIELDS} <= set(rows)
    assert files["pid_temp_rollback.scl"].count("LoadBackUp := TRUE;") == 1


@pytest.mark.parametrize(("find", "put", "parts"), [
    ("ActivateCooling := TRUE", "ActivateCooling := FALSE", ("Config.ActivateCooling", "without cooling, use target pid-temp")),
    ("Cool.DeadZone := 0.0", "Cool.DeadZone := 0.5", ("Retain.CtrlParams.Cool.DeadZone", "'0.5'", "dead zone")),
    ("Cool.ControlZone := 3.402822E38", "Cool.ControlZone := 8.0", ("Retain.CtrlParams.Cool.ControlZone", "control zone")),
    ("Cool.Ti := 80.0", "Cool.Ti := -1.0", ("CoolTi", "'-1.0'", "0…100000")), ("CoolFactor := 2.5", "CoolFactor := x", ("CoolFactor", "'x'"))])
def test_a_bad_line_is_told_by_number_field_and_value(find, put, parts):
    text = _files()["pid_temp_words.scl"]
    assert find in text
    with pytest.raises(InputError) as refused:
        _read(text.replace(find, put, 1))
    assert all(part in str(refused.value) for part in ("block.txt", *parts)), refused.value


def test_a_block_that_only_heats_sends_one_with_a_cooler_to_its_target():
    with pytest.raises(InputError, match="has no cooling; use target pid-temp-cooling"):
        read_machine(controller_for("pid-temp"), _files()["pid_temp_words.scl"].encode(), sample_time_s=4.0, source="block.txt", scaling=RANGE)


def test_a_word_in_single_precision_stays_what_it_is():
    assert all(single(value) == value for value in WORDS.values.values())
