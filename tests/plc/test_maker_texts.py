"""Texts of Marlin, Arduino, ESPHome and simple-pid: as their programs print and their users write them; and what is exported, run."""

import math
import re
import shutil
import subprocess
import sys
import types
from dataclasses import replace

import pytest
from tests.witness.arduino_pid import ArduinoPid

from heatertune.errors import HeatertuneError, InputError, NotRepresentable
from heatertune.pid.design_values import PidDesign
from heatertune.plc import Certificate, Scaling, controller_for
from heatertune.plc.dump_reader import read_machine
from heatertune.plc.firmware.firmware_text import decimal
from heatertune.plc.pwm import Actuator
from heatertune.plc.single_precision import single

DESIGN = PidDesign(gain_pct_per_degC=2.5, integral_time_s=100.0, derivative_time_s=4.0, sample_time_s=2.0, structure="pid", method="")
SAID = Certificate(verdict="PASS", setpoint_degC=60.0, actuator=Actuator(pwm_period_s=1.0, minimum_on_s=0.1, minimum_off_s=0.2))


def _read(target, text, interval=None):
    read = read_machine(controller_for(target), text.encode(), sample_time_s=interval, scaling=Scaling(), source="file.txt")
    return read.words.values, (*read.passed_over, *read.assumed)


def _refused(target, text, *parts, interval=2.0):
    with pytest.raises(HeatertuneError) as refused:
        _read(target, text, interval)
    for part in ("file.txt", *parts):
        assert part in str(refused.value), refused.value


@pytest.mark.parametrize("text", [
    "echo:; Hotend PID:\necho:  M301 P22.20 I1.08 D114.00\nok\n",
    "Recv: echo:  M301 P22.20 I1.08 D114.00\nRecv: ok\n",
    "M301 D114 I1.08 P22.2 ; from the wiki\nM500\n",
    "m301 e0 p22.20i1.08d114.00\n",
    "PID Autotune finished! Put the last Kp, Ki and Kd constants from below into Configuration.h\n#define DEFAULT_Kp 22.20\n"
    "#define DEFAULT_Ki 1.08\n#define DEFAULT_Kd 114.00\n",
    "bias: 174 d: 80 min: 197.27 max: 202.81 Ku: 36.77 Tu: 41.62\n Classic PID\n Kp: 22.20 Ki: 1.08 Kd: 114.00\n",
    "Recv:  Kp: 22.20\nRecv:  Ki: 1.08\nRecv:  Kd: 114.00\n",
    "  #define DEFAULT_Kp  22.20 // [P]\n  #define DEFAULT_Ki   (1.08)\n  #define DEFAULT_Kd 114.00 /* stock */\n#define PID_K1 0.95\n",
])
def test_marlins_stock_gains_are_read_wherever_they_stand(text):
    values, over = _read("marlin", text)
    assert values == {"Kp": single(22.2), "Ki": single(1.08), "Kd": 114.0, "PID_MAX": 255, "PID_FUNCTIONAL_RANGE": 10,
                      "PID_K1": single(0.95), "ADC_LOOPS": 10}
    assert "PID_FUNCTIONAL_RANGE = 10" in over
    assert any("two decimals" in told for told in over) == ("echo:  M301" in text)


def test_what_only_the_build_knows_is_read_where_it_stands():
    text = "M301 P1 I1 D1\n; #define PID_MAX 128\n//#define PID_FUNCTIONAL_RANGE 20\n; ADC_LOOPS = 12: of my build\n"
    values, over = _read("marlin", text)
    assert (values["PID_MAX"], values["PID_FUNCTIONAL_RANGE"], values["ADC_LOOPS"]) == (128, 20, 12)
    assert over == ("PID_K1 = 0.95",)
    assert _read("marlin", "M301 P1 I1 D1", 0.256)[0]["ADC_LOOPS"] == 16


@pytest.mark.parametrize(("text", "parts"), [
    ("M301 P22.2 I1.08\n", ("Kd",)), ("M301 P22.2 I1.08 D114\nM301 P22.3\n", ("line 2", "Kp", "22.3")), ("M301 P I1 D1", ("line 1", "Kp")),
    ("M301 E1 P1 I1 D1", ("one hot end",)), ("M301 P1 I-1 D1", ("Ki", "-1")), ("#define DEFAULT_Kp_LIST { 1, 2 }", ("a list has several",)),
    ("M301 P1 I1 D1 ??", ("M301",)), ("M104 S200", ("no gain of Marlin's",)), ("M301 P1 I1 D1\n; ADC_LOOPS = 9", ("ADC_LOOPS", "9")),
])
def test_a_bad_line_of_marlins_is_told(text, parts):
    _refused("marlin", text, *parts)


def test_a_sketch_is_read_as_sketches_are_written():
    values, over = _read("arduino-pid", """
        #include <PID_v1.h>
        /* PID old(&a, &b, &c, 9, 9, 9, DIRECT); */
        double Kp=2, Ki=5, Kd=1;   // tuned by hand
        int WindowSize = 5000;
        PID myPID(&Input, &Output, &Setpoint, Kp, Ki, Kd, DIRECT);
        void setup() { myPID.SetOutputLimits(0, WindowSize); myPID.SetMode(AUTOMATIC); }
    """)
    assert values == {"Kp": 2.0, "Ki": 5.0, "Kd": 1.0, "POn": 1, "OutMax": 5000.0, "Full": 5000.0, "SampleTime": 100}
    assert over == ()
    values, over = _read("arduino-pid", "#define KP 2.5e-1\nPID p(&i,&o,&s,KP,.1,0,P_ON_M,DIRECT); p.SetSampleTime(250);")
    assert (values["Kp"], values["POn"], values["OutMax"], values["SampleTime"]) == (0.25, 0, 255.0, 250)
    assert over == ("OutMax = 255", "output 255 = full power")


@pytest.mark.parametrize(("line", "parts"), [
    ("Input = analogRead(A0);", ("analogRead(A0)", "counts", "per °C")),
    ("Input = map(analogRead(A0), 0, 1023, 0, 255);", ("map(analogRead(A0)", "counts")),
    ("int raw = analogRead(A0); Input = raw;", ("analogRead(A0)", "counts")),
    ("Input = thermocouple.readFahrenheit();", ("°F", "1.8")), ("float f = c * 1.8 + 32; Input = f;", ("c * 1.8 + 32", "°F")), ("Input = sensor.getTempF(probe);", ("°F",)),
])
def test_gains_per_count_or_fahrenheit_are_gains_per_degree_on_a_condition_alone(line, parts):
    # PID_Basic, the library's own example, regulates analogRead's counts
    sketch = "double Setpoint, Input = 0, Output;\nPID heater(&Input, &Output, &Setpoint, 2, 5, 1, DIRECT);\nvoid loop() {{ {} heater.Compute(); }}"
    assumed = [phrase for phrase in _read("arduino-pid", sketch.format(line))[1] if phrase.startswith("Input in °C")]
    assert all(part in assumed[0] for part in parts)
    over = _read("arduino-pid", sketch.format("Input = (analogRead(A0) * 5.0 / 1023 - 0.5) * 100;"))[1]
    assert not any(phrase.startswith("Input in °C") for phrase in over)


@pytest.mark.parametrize("reading", ["adc.read_u16()", "adc.value", "chan_adc.read()", "read_adc(0)", "probe.temperature_f", "probe.fahrenheit()"])
def test_a_module_whose_reading_is_not_in_degrees_is_right_on_a_condition_alone(reading):
    module = "pid = PID(2.0, 0.1, 0.0, sample_time=2, output_limits=(0, 100))\npower = pid({})\n"
    assumed = [phrase for phrase in _read("simple-pid", module.format(reading))[1] if phrase.startswith("the reading in °C")]
    assert reading in assumed[0]
    assert ("per °C" if "adc" in reading else "1.8") in assumed[0]
    over = _read("simple-pid", module.format(f"({reading} - 32) * 0.01" if "adc" in reading else "probe.temperature"))[1]
    assert not any(phrase.startswith("the reading in °C") for phrase in over)


@pytest.mark.parametrize(("text", "parts"), [
    ("void loop() {}", ("no constructor",)), ("PID p(&i,&o,&s,1,2,3,REVERSE);", ("DIRECT",)), ("PID p(&i,&o,&s,kp,2,3,DIRECT);", ("Kp", "kp")),
    ("PID p(&i,&o,&s,1,2,3,DIRECT);\nvoid loop() { p.SetTunings(2,3,4); }", ("line 2", "SetTunings")),
    ("PID p(&i,&o,&s,1,2,3,DIRECT);\n\np.SetOutputLimits(-100,100);", ("line 3", "SetOutputLimits")),
    ("PID p(&i,&o,&s,1,-2,3,DIRECT);", ("Ki", "-2")), ("PID a(&i,&o,&s,1,2,3,DIRECT);PID b(&i,&o,&s,1,2,3,DIRECT);", ("2 constructors",)),
    ("PID p(&i,&o,&s,1,2,3,DIRECT); p.SetSampleTime(0);", ("SampleTime",)),
])
def test_a_sketch_of_another_kind_is_refused(text, parts):
    _refused("arduino-pid", text, *parts)


def test_esphomes_yaml_and_logs_are_read():
    yaml = "climate:\n  - platform: pid\n    control_parameters:\n      kp: 0.49460\n      ki: 0.00487  # slow\n      kd: 12.56301\n"
    values, over = _read("esphome", yaml, 5.0)
    assert (values["kp"], values["ki"], values["min_integral"], values["update_interval"]) == (single(0.4946), single(0.00487), -1.0, 5000)
    assert "min_integral = -1" in over
    assert _read("esphome", yaml + "    update_interval: 0.5s\n")[0]["update_interval"] == 500
    log = ("[12:00:01][C][pid.climate:108]:     kp: 0.49460, ki: 0.00487, kd: 12.56301, output samples: 1\n"
           "[12:00:01][C][pid.climate:112]:   Deadband disabled.\n")
    assert _read("esphome", log, 5.0)[0] == values
    tuned = ("[I][pid.autotune:163]:   control_parameters:\n[I][pid.autotune:163]:     kp: 0.49460\n[I][pid.autotune:163]:     ki: 0.00487\n"
             "[I][pid.autotune:163]:     kd: 12.56301\n[D][pid.autotune:216]:     Rule 'Ziegler-Nichols PI':\n"
             "[D][pid.autotune:216]:       kp: 0.37095, ki: 0.00400, kd: 0.00000\n")
    assert _read("esphome", tuned, 5.0)[0] == values


@pytest.mark.parametrize(("text", "parts"), [
    ("ki: 0.1", ("kp is missing",)), ("kp: high", ("line 1", "kp", "high")), ("kp: 1\nkp: 2", ("line 2", "'2'")),
    ("kp: 1\ndeadband_parameters:\n  threshold_high: 1", ("line 2", "deadband_parameters")), ("kp: 1\noutput_averaging_samples: 5", ("'5'",)),
    ("kp: 1\nderivative_averaging_samples: 9", ("derivative_averaging_samples", "9")), ("kp: 1\ncool_output: fan", ("cool_output",)),
    ("kp: 1\nstarting_integral_term: 0.4", ("starting_integral_term",)),
])
def test_what_esphome_can_and_is_not_proven_is_refused(text, parts):
    _refused("esphome", text, *parts)


def test_no_interval_in_yaml_and_none_told_is_refused():
    with pytest.raises(InputError, match="update_interval"):
        _read("esphome", "kp: 1\n")


def test_a_module_is_read_without_being_run():
    values, over = _read("simple-pid", "import simple_pid\nKP = 2\npid = simple_pid.PID(KP, .1, setpoint=50, output_limits=(0, 80))\nFULL = 100  # the package has no unit\n1/0\n", 0.5)
    assert values == {"Kp": 2.0, "Ki": 0.1, "Kd": 0.0, "output_max": 80.0, "proportional_on_measurement": 0,
                      "differential_on_measurement": 1, "PERIOD_MS": 500}
    assert over == ("sample_time = 0.01: calls that come sooner are left out, which is not run", "Kd = 0")


@pytest.mark.parametrize(("text", "parts"), [
    ("pid = ", ("line 1", "no Python")), ("print(1)", ("no calls of PID",)), ("PID(1, 2, 3)", ("output_limits",)),
    ("PID(1, 2, 3, output_limits=(-1, 1))", ("output_limits",)), ("PID(f(), 2, 3, output_limits=(0, 1))", ("Kp", "f()")),
    ("PID(1, 2, 3, output_limits=(0, 100), error_map=abs)", ("error_map",)), ("PID(*a)", ("'*a'",)), ("PID(1, gain=2)", ("PID",)),
    ("PID(1, 2, 3, output_limits=(0, 1e999))", ("output_limits", "inf")), ("PID(-1, 2, 3, output_limits=(0, 100))", ("Kp",)),
])
def test_a_module_of_another_kind_is_refused(text, parts):
    _refused("simple-pid", text, *parts)


@pytest.mark.parametrize("target", ["marlin", "arduino-pid", "esphome", "simple-pid"])
def test_a_cooler_and_a_gain_beyond_all_use_are_refused(target):
    which = controller_for(target)
    for gain in (-2.0, 1e12):
        design = PidDesign(gain_pct_per_degC=gain, integral_time_s=100.0, derivative_time_s=0.0, sample_time_s=which.timer.round(2.0),
                           structure="pi", method="")
        with pytest.raises(NotRepresentable):
            which.encode(design, Scaling())


@pytest.mark.parametrize(("value", "format_", "text"), [
    (single(22.2), "REAL", "22.2"), (114.0, "REAL", "114.0"), (single(1e-10), "REAL", "0.0000000001"), (0.1, "LREAL", "0.1"),
    (1e-7, "LREAL", "0.0000001"), (1e9, "LREAL", "1000000000.0"), (0.0, "REAL", "0.0"),
])
def test_a_number_is_written_without_an_exponent(value, format_, text):
    assert decimal(value, format_) == text


def _exported(target):
    which = controller_for(target)
    return which.encode(DESIGN, Scaling()), which.export(which.encode(DESIGN, Scaling()), SAID)


STUB = """
#include <math.h>
#include <cstdio>
#define OUTPUT 1
#define LOW 0
#define HIGH 1
static unsigned long nowMs; static int heater; static double temperature;
unsigned long millis() { return nowMs; }
void pinMode(int, int) {}
void digitalWrite(int, int on) { heater = on; }
enum { P_ON_M, P_ON_E }; enum { DIRECT, REVERSE }; enum { MANUAL, AUTOMATIC };
// the law of the library in this test's own words: called each SampleTime, P on the error
struct PID {
  double *in, *out, *sp, kp, ki, kd, low, high, sum, last; unsigned long each, then; bool on;
  PID(double* i, double* o, double* s, double p, double t, double d, int, int)
    : in(i), out(o), sp(s), kp(p), ki(t), kd(d), low(0), high(255), sum(0), last(0), each(100), then(nowMs - 100), on(false) {}
  void SetOutputLimits(double a, double b) { low = a; high = b; }
  void SetSampleTime(int ms) { each = ms; }
  void SetMode(int mode) { if (mode && !on) { sum = *out; last = *in; } on = mode; }
  double limited(double x) { return x > high ? high : x < low ? low : x; }
  bool Compute() {
    if (!on || nowMs - then < each) return false;
    double seconds = each / 1000.0, e = *sp - *in;
    sum = limited(sum + ki * seconds * e);
    *out = limited(kp * e + sum - kd / seconds * (*in - last));
    last = *in; then = nowMs;
    return true;
  }
};
"""
MAIN = """
int main() {
  setup();
  for (nowMs = 10000; nowMs < 40000; nowMs += 10) {
    temperature = nowMs < 20000 || nowMs > 25000 ? 40.0 + nowMs / 2000.0 : NAN;
    loop();
    std::printf("%lu %d %.17g\\n", nowMs, heater, Output);
  }
}
"""


def test_the_exported_sketch_compiles_and_switches_as_its_words_say(tmp_path):
    compiler = shutil.which("g++")
    if compiler is None:
        pytest.skip("g++ is not installed")
    words, files = _exported("arduino-pid")
    sketch = files["arduino_pid.ino"].replace("return NAN;", "return temperature;", 1)
    (tmp_path / "PID_v1.h").write_text(STUB)
    (tmp_path / "main.cpp").write_text(sketch + MAIN)
    subprocess.run([compiler, "-Wall", "-Werror", "-I", tmp_path, "-o", tmp_path / "main", tmp_path / "main.cpp"], check=True)
    rows = [line.split() for line in subprocess.run([tmp_path / "main"], capture_output=True, text=True, check=True).stdout.splitlines()]
    assert all(on == "0" and out == "0" for ms, on, out in rows if 20000 <= int(ms) <= 25000)  # a broken sensor
    v, pid = words.values, ArduinoPid(*(words.values[name] for name in ("Kp", "Ki", "Kd")))
    pid.set_sample_time(v["SampleTime"])
    pid.input, pid.setpoint, pid.last_ms = pid.number(45.0), pid.number(60.0), 10000 - v["SampleTime"]
    pid.set_mode(True)
    on_ms, seen = 0, 0
    for ms, on, out in rows:
        now = int(ms)
        if now >= 20000:
            break
        pid.input = pid.number(40.0 + now / 2000.0)
        pid.compute(now)
        assert float(out) == pytest.approx(float(pid.output), rel=1e-12)
        if (now - 10000) % 1000 == 0:  # the window begins: pulses of 100 ms or more, pauses of 200 ms or more, steps of 10 ms
            wanted = float(pid.output) / 255.0 * 1000.0
            on_ms = 10 * math.floor(wanted / 10.0 + 0.5)
            on_ms = 0 if min(wanted, on_ms) < 100 else 1000 if max(wanted, on_ms) > 800 else on_ms
        assert int(on) == ((now - 10000) % 1000 < on_ms)
        seen += int(on)
    assert 0 < seen < 1000


def test_the_exported_module_runs_on_a_clock_of_its_own(monkeypatch, witness):
    words, files = _exported("simple-pid")
    monkeypatch.syspath_prepend(str(witness("simple-pid")))
    module = types.ModuleType("exported")
    exec(compile(files["simple_pid_heater.py"], "exported", "exec"), module.__dict__)
    now, switched = [0.0], []

    def sleep(seconds):
        switched[-1] = (now[0], switched[-1])
        now[0] = round(now[0] + seconds, 6)
        if now[0] >= 30.0:
            raise KeyboardInterrupt

    def reading():
        return math.nan if 10.0 <= now[0] < 14.0 else 50.0 + now[0] / 4.0

    with pytest.raises(KeyboardInterrupt):
        module.run(reading, switched.append, clock=lambda: now[0], sleep=sleep)
    assert switched.pop() is False  # whatever ends it
    assert not any(on for at, on in switched if 10.0 <= at < 14.0)
    which = controller_for("simple-pid")
    running, expected, on_ms = which.start(words, {}), [], 0
    for at, on in switched:
        if at >= 10.0:
            break
        if abs(at / 2.0 - round(at / 2.0)) < 1e-9:
            running, scan = which.scan(running, {"setpoint": 60.0, "input_": 50.0 + at / 4.0})
            expected.append(scan.output)
        if abs(at - round(at)) < 1e-9:
            on_ms = 1000 if scan.output > 80.0 else 0 if scan.output < 10.0 else 10 * math.floor(scan.output + 0.5)
        into = 1000.0 * (at - math.floor(at + 1e-9))
        assert on == (into < on_ms) or abs(into - on_ms) < 1e-6, at  # hundredths of a second are no binary numbers
    assert len(set(expected)) > 3
    for name in [name for name in sys.modules if name.startswith("simple_pid")]:
        del sys.modules[name]


def test_a_switch_that_makes_up_is_told_and_a_short_period_too():
    which = controller_for("esphome")
    words = which.encode(DESIGN, Scaling())
    made_up = Actuator(pwm_period_s=0.05, minimum_on_s=0.02, minimum_rule="carry")
    [text] = which.export(words, Certificate(verdict="PASS", actuator=made_up)).values()
    assert "period: 100ms" in text
    assert "no period below 100 ms" in text
    assert "knows no shortest pulse" in text
    assert "this program does not" in text
    assert re.search("makes up what it leaves out", text)


@pytest.mark.parametrize(("heater", "command", "prefix", "limit"), [("hotend", "M301", "", "PID_MAX"), ("bed", "M304", "bed", "MAX_BED_POWER")])
def test_marlin_s_files_set_the_heater_that_is_known_and_no_other(heater, command, prefix, limit):
    files = _marlin_files({"heater": heater})
    header, code = (_without_comments(files[name]) for name in ("marlin_pid.h", "marlin_pid.gcode"))
    defined = dict(re.findall(r"#define (\w+) (\S+)", header))
    assert set(defined) == {f"DEFAULT_{prefix}Kp", f"DEFAULT_{prefix}Ki", f"DEFAULT_{prefix}Kd", limit, "PID_FUNCTIONAL_RANGE", "PID_K1"}
    assert [line.split()[0] for line in code.splitlines()] == [command, "M503"]
    given = dict(re.findall(r"([PID])(\d+\.\d+)", code.splitlines()[0]))
    assert given == {letter: defined[f"DEFAULT_{prefix}K{letter.lower()}"] for letter in "PID"}


def test_marlin_s_files_set_no_gain_while_the_heater_is_unknown():
    files = _marlin_files({})
    assert "DEFAULT_" not in _without_comments(files["marlin_pid.h"])
    assert _without_comments(files["marlin_pid.gcode"]) == "M503 S0\n"
    for name, text in files.items():
        assert controller_for("marlin").text(text, None, name).values["Kp"] == single(2.55)


#: Marlin's own Configuration.h, 2.1.2: its gains of a hot end and of a bed
STOCK = ("#define PID_MAX 255\n#define DEFAULT_Kp  22.20\n#define DEFAULT_Ki   1.08\n#define DEFAULT_Kd 114.00\n#define MAX_BED_POWER 200\n"
         "#define DEFAULT_bedKp 10.00\n#define DEFAULT_bedKi .023\n#define DEFAULT_bedKd 305.4\n")


@pytest.mark.parametrize(("text", "hotend", "bed"), [
    (STOCK, (22.2, 1.08, 114.0, 255), (10.0, 0.023, 305.4, 200)),
    ("M301 P22.20 I1.08 D114.00 ; M304 is the bed's\nM304 P10 I0.023 D305.4", (22.2, 1.08, 114.0, 255), (10.0, 0.023, 305.4, 255)),
])
def test_of_a_hot_end_and_a_bed_the_one_that_is_named_is_read(text, hotend, bed):
    read = controller_for("marlin").text_of_heater
    for heater, numbers in (("hotend", hotend), ("bed", bed)):
        values = read(text, None, "Configuration.h", heater).values
        assert [values[name] for name in ("Kp", "Ki", "Kd", "PID_MAX")] == [*map(single, numbers[:3]), numbers[3]]
    with pytest.raises(InputError, match="gains of a hot end and a bed; expected those of one heater: --assume heater=hotend or"):
        controller_for("marlin").text(text, None, "Configuration.h")
    with pytest.raises(InputError, match="gains of a hot end; expected those of a bed"):
        read("M301 P1 I1 D1", None, "gains.gcode", "bed")


def _marlin_files(known):
    room = controller_for("marlin")
    design = PidDesign(gain_pct_per_degC=1.0, integral_time_s=20.0, derivative_time_s=2.0, sample_time_s=0.16, structure="pid", method="")
    words = room.encode(design, Scaling(low_degC=0.0, high_degC=300.0))
    return room.export(replace(words, values={**words.values, "Kp": single(2.55)}), Certificate(verdict="PASS", switches=known))


def _without_comments(text):
    lines = (re.split(r";|//", line)[0].strip() for line in text.splitlines())
    return "".join(f"{line}\n" for line in lines if line)
