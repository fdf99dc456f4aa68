"""What is exported for printers, instruments and makers, read by parsers that are not ours and run on what a proof's controller saw.

Python's ast, configparser and csv, PyYAML and a C++ compiler read the files; simple-pid, ESPHome's pid_controller.cpp and Kalico's
heaters.py from their packages run what they say, and so do tests/witness's Marlin, PID_v1 and panel instrument. The power that
they ask for, or the instants at which they switch, are those of the run: so they would have made this very run.
"""

import configparser
import csv
import math
import re
import shutil
import subprocess
import sys
import types
from dataclasses import replace

import numpy as np
import pytest
from tests.golden.test_klipper import _theirs
from tests.golden.test_makers import HAL, HELPERS
from tests.plc.test_maker_texts import STUB
from tests.witness.marlin import MarlinPid
from tests.witness.pband import PBand

from heatertune.cli.common import again
from heatertune.errors import InputError, OutOfRange
from heatertune.model.model_values import Fopdt, model_by_hand
from heatertune.pid.design_values import PidDesign
from heatertune.plc import Boost, Certificate, Scaling, controller_for
from heatertune.plc.pwm import Actuator
from heatertune.proof import Scenario, TemperatureStep, simulate
from heatertune.proof.redesign import DesignRequest, find_passing_design
from heatertune.proof.scenario import Mains
from heatertune.proof.text_comparison import compare_text
from heatertune.settings import Conditions, TuneSettings

HEATER = Fopdt(gain_degC_per_pct=0.9, time_constant_s=60.0, dead_time_s=2.0, ambient_degC=20.0)
STORY = Scenario(setpoint_degC=60.0, duration_s=500.0, noise_degC=0.05, disturbances=(
    TemperatureStep(time_s=150.0, temperature_degC=-6.0), Mains(time_s=250.0, share=0.0), Mains(time_s=300.0, share=1.0)))
BOOST = Boost(within_degC=6.25, again_degC=12.5)
SWITCH = Actuator(pwm_period_s=1.0, resolution_s=0.01, minimum_on_s=0.1, minimum_off_s=0.2)
#: each count is 0.1 °C, so that the setpoint is one
SCALING = {"klipper": Scaling(high_degC=300.0), "marlin": Scaling(high_degC=102.3), "pband": Scaling(high_degC=100.0)}
BOOSTED = ("arduino-pid", "simple-pid", "esphome")
TARGETS = ("klipper", "marlin", "pband", "omron-e5cc", "eurotherm-3200", "abb-commander-300", "jumo-dicon", "omega-cn7800", *BOOSTED)


def ran(target, *, boost=None, switch=SWITCH, tv=1.5, scaling=None, **switches):
    which = controller_for(target)
    design = PidDesign(gain_pct_per_degC=2.6, integral_time_s=25.0, derivative_time_s=tv, sample_time_s=which.timer.round(1.0),
                       structure="pid" if tv else "pi", method="")
    words = which.encode(design, scaling or SCALING.get(target, Scaling(high_degC=409.5))).with_boost(boost)
    period = which.timing(words).pwm_period_s
    trace = simulate(which, words, HEATER, STORY, switch if period is None else Actuator(pwm_period_s=period), switches)
    told = Certificate(verdict="PASS", setpoint_degC=trace.setpoint_degC, actuator=trace.actuator, switches=switches)
    powers = trace.power_asked_pct
    assert len(set(powers.tolist())) > 40
    if boost:  # heat-up and open circuit
        assert [bool(np.all(powers[(trace.time_s >= at) & (trace.time_s < at + 5.0)] == 100.0)) for at in (0.0, 290.0)] == [True, True]
    return which, trace, which.export(words, told)


def same(trace, outputs):
    assert np.max(np.abs(trace.power_asked_pct - np.array(outputs))) < 1e-9


@pytest.mark.parametrize("boost", [None, BOOST])
def test_the_module_with_simple_pids_own_class_switches_as_proven(witness, monkeypatch, boost):
    monkeypatch.syspath_prepend(str(witness("simple-pid")))
    _, trace, files = ran("simple-pid", boost=boost)
    module = types.ModuleType("exported")
    exec(compile(files["simple_pid_heater.py"], "exported", "exec"), module.__dict__)
    readings, ticks, on = iter(trace.reading_degC.tolist()), [0], []

    def sleep(seconds):
        assert seconds == 0.01
        ticks[0] += 1

    with pytest.raises(StopIteration):
        module.run(lambda: next(readings), on.append, clock=lambda: ticks[0] / 100.0, sleep=sleep)
    for name in [name for name in sys.modules if name.startswith("simple_pid")]:
        del sys.modules[name]
    _switched(trace, on[:-1], 0.01)


def _switched(trace, on, step_s):
    """Hold what a program did tick by tick against the instants at which the run's heater was switched."""
    count = round(STORY.duration_s / step_s)
    assert len(on) >= count
    at = (np.arange(count) + 0.5) * step_s
    edge = np.searchsorted(trace.edge_time_s, at) - 1
    proven = np.where(edge >= 0, trace.edge_on[np.maximum(edge, 0)], False)
    differ = np.flatnonzero(proven.astype(bool) != np.array(on[:count], bool))
    assert differ.size == 0, at[differ[:5]]


MAIN = """
int main() {
  setup();
  for (nowMs = 10000; std::scanf("%lf", &temperature) == 1;)
    for (int tick = 0; tick < 100; tick++, nowMs += 10) {
      loop();
      std::printf("%d ", heater);
    }
}
"""


@pytest.mark.parametrize("boost", [None, BOOST])
def test_the_sketch_switches_as_proven(tmp_path, boost):
    compiler = shutil.which("g++")
    if compiler is None:
        pytest.skip("g++ is not installed")
    _, trace, files = ran("arduino-pid", boost=boost)
    sketch = files["arduino_pid.ino"].replace("return NAN;", "return temperature;", 1)
    (tmp_path / "PID_v1.h").write_text(STUB)
    (tmp_path / "main.cpp").write_text(sketch + MAIN)
    subprocess.run([compiler, "-Wall", "-Werror", "-I", tmp_path, "-o", tmp_path / "main", tmp_path / "main.cpp"], check=True)
    out = subprocess.run([tmp_path / "main"], input="\n".join(map(repr, trace.reading_degC.tolist())), capture_output=True, text=True, check=True)
    _switched(trace, [int(each) for each in out.stdout.split()], 0.01)


#: a climate as far as the lambda asks it; update_pid_ and write_output_ as pid_climate.cpp has them for a heater alone
CLIMATE = """
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include "esphome/components/pid/pid_controller.h"
namespace esphome { static uint32_t now_ms = 1; uint32_t millis() { return now_ms; } }
using namespace esphome;
namespace esphome::climate { enum ClimateMode { CLIMATE_MODE_OFF, CLIMATE_MODE_HEAT }; }
static float sent;
static struct { void set_level(float level) { sent = level; } } heater_output;
static void write(float state);
namespace esphome::pid {
class PIDClimate {
 public:
  climate::ClimateMode mode = climate::CLIMATE_MODE_HEAT;
  float target_temperature, current_temperature;
  void set(float kp, float ki, float kd, float least, float most, int samples) {
    c.kp_ = kp; c.ki_ = ki; c.kd_ = kd; c.min_integral_ = least; c.max_integral_ = most; c.derivative_samples_ = samples;
    c.derivative_window_.init(8); c.output_window_.init(8);
  }
  void reset_integral_term() { c.reset_accumulated_integral(); }
  void update() {
    float value = 0.0;
    if (!std::isnan(current_temperature)) value = c.update(target_temperature, current_temperature);
    if (mode == climate::CLIMATE_MODE_OFF) value = 0.0;
    if (value <= 0) write(0.0f);
    if (value > 0) write(std::min(1.0f, value));
  }
  PIDController c;
};
}
static pid::PIDClimate heater_climate;
#define id(name) name
static void write(float state) {
%s
}
int main() {
  float target, reading, mode;
  heater_climate.set(%s);
  now_ms = 1000;
  while (std::scanf("%%f %%f %%f", &target, &reading, &mode) == 3) {
    heater_climate.mode = mode ? climate::CLIMATE_MODE_HEAT : climate::CLIMATE_MODE_OFF;
    heater_climate.target_temperature = target;
    heater_climate.current_temperature = reading;
    heater_climate.update();
    std::printf("%%.17g ", sent);
    now_ms += %d;
  }
}
"""


def _levels(folder, tmp_path, files, rows):
    """Return the levels that ESPHome's controller and the lambda of the YAML send for rows of setpoint, reading and mode."""
    yaml = pytest.importorskip("yaml", reason="PyYAML is not installed")
    compiler = shutil.which("g++")
    if compiler is None:
        pytest.skip("g++ is not installed")
    told = yaml.safe_load(files["esphome_pid.yaml"])
    [climate], outputs = told["climate"], {each["id"]: each for each in told["output"]}
    output = outputs[climate["heat_output"]]
    code = "  heater_output.set_level(state);" if output["platform"] == "slow_pwm" else output["write_action"][0]["lambda"]
    words = climate["control_parameters"]
    given = ", ".join(str(words[name]) + ("" if name.endswith("samples") else "f") for name in (
        "kp", "ki", "kd", "min_integral", "max_integral", "derivative_averaging_samples"))
    core = tmp_path / "esphome" / "core"
    core.mkdir(parents=True)
    (core / "hal.h").write_text(HAL)
    (core / "helpers.h").write_text(HELPERS)
    (tmp_path / "main.cpp").write_text(CLIMATE % (code, given, int(told["sensor"][0]["update_interval"].removesuffix("ms"))))
    source = folder / "esphome" / "components" / "pid" / "pid_controller.cpp"
    ran_ = subprocess.run([compiler, "-std=gnu++20", "-O1", "-ffp-contract=off", "-I", tmp_path, "-I", folder, "-o", tmp_path / "main",
                           tmp_path / "main.cpp", source], capture_output=True, text=True, check=False)
    assert ran_.returncode == 0, ran_.stderr
    out = subprocess.run([tmp_path / "main"], input="\n".join(f"{w!r} {x!r} {mode}" for w, x, mode in rows), capture_output=True, text=True, check=True)
    return told, [float(each) for each in out.stdout.split()]


@pytest.mark.parametrize("boost", [None, BOOST])
def test_the_yaml_with_esphomes_own_controller_asks_for_what_was_proven(witness, tmp_path, boost):
    _, trace, files = ran("esphome", boost=boost)
    told, levels = _levels(witness("esphome"), tmp_path, files, [(60.0, x, 1) for x in trace.reading_degC.tolist()])
    assert (told["climate"][0]["default_target_temperature"], told["output"][0]["period"]) == ("60.0°C", "1000ms")
    same(trace, [100.0 * level for level in levels])


def test_the_yaml_does_as_the_step_while_it_is_off_and_without_a_reading(witness, tmp_path):
    which, trace, files = ran("esphome", boost=BOOST)
    rng = np.random.default_rng(3)
    modes = rng.random(120).repeat(5)[:500] > 0.2
    readings = np.where(rng.random(500) < 0.05, math.nan, np.float32(60.0 + 15.0 * np.sin(np.arange(500) / 20.0)))
    rows = [(60.0, x, int(mode)) for x, mode in zip(readings.tolist(), modes.tolist(), strict=True)]
    _, levels = _levels(witness("esphome"), tmp_path, files, rows)
    running, ours = which.start(trace.words, {}), []
    for setpoint, reading, mode in rows:
        running, scan = which.scan(running, {"target_temperature": setpoint, "current_temperature": reading, "mode": mode,
                                             "elapsed_ms": 1000})
        ours.append(scan.power_pct)
    assert np.max(np.abs(np.array(ours) - 100.0 * np.array(levels))) < 1e-5
    assert 20 < ours.count(100.0) < 400


def test_the_section_with_kalicos_own_heater_asks_for_what_was_proven(witness, tmp_path):
    _, trace, files = ran("klipper", switch=Actuator(pwm_period_s=0.1, resolution_s=1e-5), firmware="kalico", heater="extruder")
    told = configparser.ConfigParser(inline_comment_prefixes=("#", ";"))
    told.read_string(files["klipper_heater.cfg"])
    section = told["extruder"]
    gains = np.array([section.getfloat(name) for name in ("pid_Kp", "pid_Ki", "pid_Kd", "max_power", "smooth_time")])
    assert (section["control"], section.getfloat("pwm_cycle_time")) == ("pid", 0.1)
    assert re.fullmatch(r"\d+\.\d{3}", section["pid_kp"])
    count = len(trace.time_s)
    case = gains, np.full(count, 60.0), trace.reading_degC, np.arange(count) == 0
    [theirs] = _theirs(witness("kalico"), tmp_path, [case])
    same(trace, 100.0 * theirs[:, 0])
    tried = re.search(r"SET_HEATER_PID HEATER=extruder KP=(\S+) KI=(\S+) KD=(\S+)", files["klipper_try.gcode"])
    assert list(map(float, tried.groups())) == gains[:3].tolist()


@pytest.mark.parametrize("file", ["marlin_pid.h", "marlin_pid.gcode"])
def test_marlins_lines_ask_for_what_was_proven(file):
    _, trace, files = ran("marlin", switch=Actuator(pwm_period_s=0.127, resolution_s=0.001), heater="hotend")
    text = files[file]
    defined = {name: float(value) for name, value in re.findall(r"#define (\w+) (\S+)", text)}
    sent = dict(re.findall(r"([PID])([\d.]+)", re.search(r"^M301 (.*)$", text, re.MULTILINE)[1])) if file.endswith("gcode") else {
        letter: defined[f"DEFAULT_K{letter.lower()}"] for letter in "PID"}
    pid = MarlinPid(*(float(sent[letter]) for letter in "PID"), states=int(re.search(r"ADC_LOOPS = (\d+)", text)[1]),
                    window=defined["PID_FUNCTIONAL_RANGE"], K1=defined["PID_K1"], max_pow=int(defined["PID_MAX"]))
    same(trace, [100.0 * pid.amount(60.0, reading) / 127.0 for reading in trace.reading_degC.tolist()])


@pytest.mark.parametrize("file", ["pband_sheet.txt", "pband_registers.csv"])
def test_an_instruments_sheet_and_registers_ask_for_what_was_proven(file):
    which, trace, files = ran("pband", tv=4.0)
    rows = [line for line in files[file].splitlines() if line[0] not in "#;"]
    if file.endswith("csv"):
        told = {row["name"]: float(row["value"]) for row in csv.DictReader(rows)}  # generic: as its display shows it
    else:
        told = {line.split()[0]: float(line.split()[1]) for line in rows}
    assert which.timing(trace.words).pwm_period_s == told["CYC"]
    pid = PBand(told["Pb"], told["ti"], told["td"], 1.0, high=told["OPH"], n=8.0)
    same(trace, [pid(60.0, reading) for reading in trace.reading_degC.tolist()])


@pytest.mark.parametrize("target", TARGETS)
def test_a_text_that_sets_what_was_proven_is_no_departure(target):
    for boost in (None, BOOST) if target in BOOSTED else (None,):
        which, trace, _ = ran(target, boost=boost, tv=2.0)
        assert compare_text(which, trace.words, trace).departs is None


#: file → what finds its numbers that set something
SET = {
    "klipper_heater.cfg": r"^(?:pid_K[pid]|max_power|smooth_time|pwm_cycle_time): (\S+)", "klipper_try.gcode": r"(?:K[PID]|TARGET)=(\S+)",
    "marlin_pid.h": r"^#define \w+ (\S+)", "marlin_pid.gcode": r"(?<=[PID])(\d[\d.]*)(?= [ID]|$)|^; #define \w+ (\S+)",
    "pband_sheet.txt": r"^(?:Pb|ti|td|CYC|OPH) +(\S+)", "pband_registers.csv": r"^\w+,\w*,\w+,(\d+)",
    "arduino_pid.ino": r"(?:(?:WITHIN|AGAIN|_MS|Full|Setpoint) = |SetOutputLimits\(0.0, |SetSampleTime\()([\d.]+)|, (\d+\.\d+)(?=,)",
    "simple_pid_heater.py": r"^[A-Z_]+ = ([\d.]+)|(?:K[pid]=|output_limits=\(0.0, )([\d.]+)",
    "esphome_pid.yaml": r"(?:update_interval|temperature|k[pid]|integral|samples|period): ([\d.]+)|boosting \? ([\d.]+)f| : ([\d.]+)f",
}


@pytest.mark.parametrize("target", ["klipper", "marlin", "pband", *BOOSTED])
def test_each_number_that_is_one_digit_off_is_noticed(monkeypatch, target):
    which, trace, files = ran(target, boost=BOOST if target in BOOSTED else None, tv=2.0)
    seen = 0
    for file, text in files.items():
        for match in re.finditer(SET[file], text, re.MULTILINE):
            at = max(group for group in range(1, match.re.groups + 1) if match[group])
            digits = match[at]
            last = next(i for i in reversed(range(len(digits))) if digits[i].isdigit() and i < 8)
            wrong = digits[:last] + str((int(digits[last]) + 1) % 10) + digits[last + 1:]
            changed = files | {file: text[: match.start(at)] + wrong + text[match.end(at):]}
            monkeypatch.setattr(type(which), "export", staticmethod(lambda *_, changed=changed: changed))
            assert compare_text(which, trace.words, trace).departs is not None, (file, match[0], wrong)
            seen += 1
    assert seen >= 6


def test_an_export_that_leaves_the_boost_out_is_noticed(monkeypatch):
    for target in BOOSTED:
        which, trace, _ = ran(target, boost=BOOST)
        files = which.export(replace(trace.words, boost=None), Certificate(verdict="PASS", setpoint_degC=60.0, actuator=SWITCH))
        monkeypatch.setattr(type(which), "export", staticmethod(lambda *_, files=files: files))
        assert "boost is None" in compare_text(which, trace.words, trace).departs


@pytest.mark.parametrize(("name", "told"), [
    ("4-20mA", "what 0 and 27648 of Input_PER mean"), ("rtd", "--range 0 2764.8"), ("thermocouple", "--range 0 2764.8"), ("rtd-climatic", "--range 0 276.48")])
@pytest.mark.parametrize("target", ["pid-compact", "pid-temp"])
def test_the_range_behind_input_per_is_told(target, name, told):
    with pytest.raises(InputError, match=told):
        controller_for(target).scaled(name)


def test_a_hot_end_beyond_the_plain_range_is_told_which_range_to_say():
    words = ran("klipper", switch=Actuator(pwm_period_s=0.1, resolution_s=1e-5), scaling=Scaling())[1].words
    with pytest.raises(OutOfRange, match="--range 0 300"):
        simulate(controller_for("klipper"), words, HEATER, replace(STORY, setpoint_degC=210.0), Actuator(pwm_period_s=0.1))


@pytest.mark.long
def test_a_program_with_the_faults_of_its_source_leads_to_the_one_repaired():
    asked = DesignRequest(target="iec-pid-text", scaling=Scaling(), tune_settings=TuneSettings(), conditions=Conditions(setpoint_degC=60.0))
    made = find_passing_design(model_by_hand(HEATER), asked)
    assert (made.proof.verdict, made.passes_with) == ("FAIL", ("--target", "iec-pid"))
    assert again(("design", "log.csv", "--target=iec-pid", "--as-printed"), made.passes_with) == ("heatertune", "design", "log.csv", "--target", "iec-pid")
