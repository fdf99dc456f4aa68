"""Klipper's words in printer.cfg, in its block SAVE_CONFIG and in what PID_CALIBRATE prints; words and lines that are exported."""

import configparser
import math
import re

import pytest

from heatertune.errors import HeatertuneError, NotRepresentable, OutOfRange
from heatertune.pid.design_values import PidDesign, structure_of
from heatertune.plc import Certificate, Scaling, Words, controller_for
from heatertune.plc.dump_reader import read_machine

ROOM = controller_for("klipper")
#: the lines that generic-*.cfg of Klipper's folder config has
EXAMPLE = "[extruder]\nstep_pin: PF0\nheater_pin: PB4\ncontrol: pid\npid_Kp: 22.2\npid_Ki: 1.08\npid_Kd: 114\nmin_temp: 0\nmax_temp: 250\n"
BED = "[heater_bed]\nheater_pin: PH5\ncontrol: pid\npid_Kp: 54.027\npid_Ki: 0.770\npid_Kd: 948.182\n"
SAVED = ("\n#*# <---------------------- SAVE_CONFIG ---------------------->\n"
         "#*# DO NOT EDIT THIS BLOCK OR BELOW. The contents are auto-generated.\n#*#\n#*# [extruder]\n#*# control = pid\n"
         "#*# pid_kp = 28.182\n#*# pid_ki = 1.978\n#*# pid_kd = 100.397\n#*#\n#*# [bed_mesh default]\n#*# version = 1\n#*# points =\n"
         "#*# \t  0.1, 0.2\n")
SCALING = Scaling(high_degC=300.0)


def _read(text, heater=None):
    known = {} if heater is None else {"heater": heater}
    machine = read_machine(ROOM, text.encode(), sample_time_s=None, scaling=SCALING, source="printer.cfg", stated=known)
    return machine.words, (*machine.passed_over, *machine.assumed)


def _gains(text, heater=None):
    return tuple(_read(text, heater)[0].values[name] for name in ("pid_Kp", "pid_Ki", "pid_Kd"))


def test_the_default_gains_of_the_firmware_are_a_pid():
    """22.2/255 of full power per °C; TN = 22.2/1.08, TV = 114/22.2; the derivative keeps 1 − 0.3 s/1 s of itself."""
    words, over = _read(EXAMPLE)
    assert words.values == {"pid_Kp": 22.2, "pid_Ki": 1.08, "pid_Kd": 114.0, "max_power": 1.0, "smooth_time": 1.0}
    assert words.sample_time_s == 0.3
    design = ROOM.decode(words)
    assert design.gain_pct_per_degC == pytest.approx(2220.0 / 255.0)
    assert (design.integral_time_s, design.derivative_time_s) == pytest.approx((22.2 / 1.08, 114.0 / 22.2))
    assert design.derivative_filter == pytest.approx(0.7)
    assert "max_power = 1" in over
    assert "heater_pin: PB4 (line 3)" in over


@pytest.mark.parametrize(("text", "gains"), [
    (EXAMPLE, (22.2, 1.08, 114.0)),
    (EXAMPLE.replace(": ", " = ").replace("pid_K", "PID_k"), (22.2, 1.08, 114.0)),
    (EXAMPLE.replace("22.2", "22.2 # a remark").replace("1.08", "1.08 ; another"), (22.2, 1.08, 114.0)),
    (EXAMPLE.replace("\n", "\r\n"), (22.2, 1.08, 114.0)),
    (BED, (54.027, 0.77, 948.182)),
    (EXAMPLE + SAVED, (28.182, 1.978, 100.397)),
    (EXAMPLE.replace("pid_", "#pid_").replace("control", "#control") + SAVED, (28.182, 1.978, 100.397)),
    ("PID parameters: pid_Kp=22.019 pid_Ki=36.698 pid_Kd=3.303\nThe SAVE_CONFIG command will update the printer config file",
     (22.019, 36.698, 3.303)),
    ("Recv: // PID parameters for 210.00\xb0C: pid_Kp=22.019 pid_Ki=36.698 pid_Kd=3.303", (22.019, 36.698, 3.303)),
    (EXAMPLE.replace("[extruder]", "[heater_generic  chamber ]"), (22.2, 1.08, 114.0)),
])
def test_gains_are_read_wherever_the_printer_has_them(text, gains):
    assert _gains(text) == gains


CHAMBER = EXAMPLE.replace("[extruder]", "[heater_generic chamber]").replace("22.2", "11.5")


@pytest.mark.parametrize("text", [BED + EXAMPLE + CHAMBER, EXAMPLE + CHAMBER + BED])
def test_of_several_heaters_the_one_that_is_named_is_read(text):
    assert _gains(text, "extruder") == (22.2, 1.08, 114.0)
    assert _gains(text, "heater_bed") == (54.027, 0.77, 948.182)
    assert _gains(text, "heater_generic") == (11.5, 1.08, 114.0)
    with pytest.raises(HeatertuneError, match=r"\[extruder\].*expected those of one heater: --assume heater=extruder"):
        _gains(text)


def test_a_heater_that_is_not_there_or_there_twice_is_refused():
    with pytest.raises(HeatertuneError, match=r"gains of \[extruder\]; expected those of one \[heater_bed\]"):
        _gains(EXAMPLE, "heater_bed")
    two = CHAMBER + CHAMBER.replace("chamber", "plate")
    with pytest.raises(HeatertuneError, match=r"expected those of one \[heater_generic\]"):
        _gains(two, "heater_generic")
    with pytest.raises(HeatertuneError, match="a text without the others"):
        _gains(two)


def test_what_save_config_says_counts_and_the_rest_is_told():
    over = _read(EXAMPLE + BED + SAVED, "extruder")[1]
    assert "pid_kp: 22.2 (line 5; SAVE_CONFIG has another)" in over
    assert "[heater_bed]" in over
    assert "[bed_mesh default]" in over


@pytest.mark.parametrize(("text", "said"), [
    (EXAMPLE.replace("22.2", "22.2x"), ("line 5", "pid_Kp", "'22.2x'", "3 decimals")),
    (EXAMPLE.replace("22.2", "22.2345"), ("line 5", "pid_Kp", "'22.2345'", "3 decimals")),
    (EXAMPLE.replace("22.2", "-22.2"), ("line 5", "'-22.2'")), (EXAMPLE.replace("22.2", "nan"), ("line 5", "'nan'")),
    (EXAMPLE.replace("22.2", "1e400"), ("line 5", "'1e400'")), (EXAMPLE.replace("22.2", ""), ("line 5", "''")),
    (EXAMPLE.replace("pid_Ki: 1.08\n", ""), ("pid_Ki", "is missing")),
    (EXAMPLE.replace("pid_Kp: 22.2\n", ""), ("pid_Kp", "is missing")),
    (EXAMPLE.replace("pid_Kp: 22.2", "pid_Kp 22.2"), ("line 5", "name: value")),
    (EXAMPLE + "pid_Kp: 23\n", ("line 10", "'23'", "22.2, as in line 5")),
    (EXAMPLE.replace("control: pid", "control: watermark"), ("line 4", "control", "'watermark'")),
    (EXAMPLE.replace("control: pid", "control: pid_v"), ("line 4", "control", "'pid_v'")),
    (EXAMPLE + "max_power: 1.5\n", ("line 10", "max_power", "'1.5'")), (EXAMPLE + "smooth_time: 0\n", ("line 10", "smooth_time")),
    (BED + EXAMPLE.replace("[extruder]", "[heater_generic chamber]"), ("[heater_bed] and [heater_generic chamber]", "--assume heater=heater_bed or --assume heater=heater_generic")),
    ("[extruder]\nheater_pin: PB4\n", ("no gains", "PID_CALIBRATE")), ("hello\n", ("no gains",)), ("\n", ("no gains",)),
    ("pid_Kp=1.0 pid_Ki=2.0 pid_Kd=3.0\npid_Kp=1.5 pid_Ki=2.0 pid_Kd=3.0", ("line 2", "'1.5'", "1.0, as in line 1")),
    ("pid_Kp=1.0 pid_Ki=inf pid_Kd=3.0", ("line 1", "pid_Ki", "'inf'")),
])
def test_a_bad_text_is_refused_by_line_and_value(text, said):
    with pytest.raises(HeatertuneError) as refused:
        _read(text)
    for part in ("printer.cfg", *said):
        assert part in str(refused.value), refused.value


def _design(gain=2.0, tn=20.0, tv=2.0):
    return PidDesign(gain_pct_per_degC=gain, integral_time_s=tn, derivative_time_s=tv, sample_time_s=0.3,
                     structure=structure_of(tn, tv), method="")


def test_words_are_gains_times_255_with_three_decimals():
    values = ROOM.encode(_design(gain=1.23456, tn=7.0, tv=3.0), SCALING).values
    assert values == {"pid_Kp": 3.148, "pid_Ki": 0.45, "pid_Kd": 9.444, "max_power": 1.0, "smooth_time": 1.0}


@pytest.mark.parametrize(("design", "named"), [
    (_design(gain=-2.0), "of a heater"), (_design(tn=20_000.0), "pid_Ki"), (_design(gain=1e-4), "pid_Kp"),
    (_design(tv=5e-5), "pid_Kd"), (_design(gain=1e6), "pid_Kp"),
])
def test_what_three_decimals_cannot_hold_is_refused(design, named):
    with pytest.raises(NotRepresentable, match=named):
        ROOM.encode(design, SCALING)


def test_an_interval_that_the_printer_does_not_have_is_refused():
    values = ROOM.encode(_design(), SCALING).values
    with pytest.raises(OutOfRange, match="sample_time_s"):
        ROOM.check(Words(target="klipper", values=values, scaling=SCALING, sample_time_s=1.0))
    with pytest.raises(OutOfRange, match="word pid_Kp"):
        ROOM.decode(Words(target="klipper", values={**values, "pid_Kp": 0.0}, scaling=SCALING, sample_time_s=0.3))


def test_without_a_part_the_words_say_so():
    words = ROOM.encode(_design(tn=math.inf, tv=0.0), SCALING)
    assert words.values["pid_Ki"] == words.values["pid_Kd"] == 0.0
    # without integral action an offset remains wherever power is needed at rest: Åström and Hägglund, Advanced PID Control, 3.2
    assert ROOM.oddities(words) == ("pid_Ki is 0: there is no integral part, and an offset remains.",)


def test_power_is_limited_to_no_more_than_is_asked():
    words = ROOM.encode(_design(), SCALING)
    assert [ROOM.with_output_limit(words, share).values["max_power"] for share in (57.0, 33.3333, 66.69)] == [0.57, 0.333, 0.666]


def test_the_files_say_what_was_proven_and_hold_no_more_than_the_printer_knows():
    words = ROOM.encode(_design(), SCALING)
    files = ROOM.export(words, Certificate(verdict="PASS", lines=("one fact",), setpoint_degC=215.0, switches={"heater": "extruder"}))
    config, trial = files["klipper_heater.cfg"], files["klipper_try.gcode"]
    assert all(line.startswith("#") or line == "[extruder]" or ": " in line for line in config.splitlines())
    assert "# verdict of the proof: PASS\n# one fact\n" in config
    assert "\npid_Kp: 5.100\npid_Ki: 0.255\npid_Kd: 10.200\n" in config
    commands = [line.split(";")[0].strip() for line in trial.splitlines() if not line.startswith(";")]
    assert commands == ["M107", "SET_HEATER_TEMPERATURE HEATER=extruder TARGET=215", "TEMPERATURE_WAIT SENSOR=extruder MINIMUM=214",
                        "G4 P120000", "M106 S255", "G4 P60000", "M107", "G4 P60000", "TURN_OFF_HEATERS"]
    assert "SET_HEATER_PID HEATER=extruder KP=5.100 KI=0.255 KD=10.200" in trial


@pytest.mark.parametrize(("known", "section", "name", "sensor"), [
    ({"heater": "heater_bed"}, "heater_bed", "heater_bed", "heater_bed"),
    ({"heater": "heater_generic"}, "heater_generic YOUR_HEATER", "YOUR_HEATER", '"heater_generic YOUR_HEATER"'),
    ({}, "YOUR_HEATER", "YOUR_HEATER", "YOUR_HEATER")])
def test_no_file_names_another_heater_than_the_one_that_is_known(known, section, name, sensor):
    words = ROOM.encode(_design(), SCALING)
    files = ROOM.export(words, Certificate(verdict="PASS", setpoint_degC=60.0, switches=known))
    config, trial = files["klipper_heater.cfg"], files["klipper_try.gcode"]
    parser = configparser.RawConfigParser(comment_prefixes=("#", ";"), delimiters=(":", "="))
    parser.read_string(config)
    assert parser.sections() == [section]
    assert {value for key, value in re.findall(r"\b(HEATER|SENSOR)=(\"[^\"]*\"|\S+)", trial)} == {name, sensor}
    assert ROOM.text(config, None, "file").values == dict(words.values)


def test_without_a_setpoint_the_trial_heats_nothing():
    trial = ROOM.export(ROOM.encode(_design(), SCALING), Certificate(verdict="FAIL", forced=True))["klipper_try.gcode"]
    assert all(line.startswith(";") for line in trial.splitlines())
