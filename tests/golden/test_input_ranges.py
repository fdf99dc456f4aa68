"""Ranges of analog modules in the exported programs: digits that are degrees, 4 to 20 mA, and what a broken wire reads there.

Witnesses: ET 200S manual EWA 4NEB 780 6024-02, tables 12-1 and 12-14 ff. (S7 format: 0.1 °C per digit, overflow 32767,
underflow −32768); S5-135U/155U manual C79000-G8576-C199-06, p. 9-71 (4 mA 512 units, 20 mA 2560); S7-200 manual
A5E00066097-02 (0 to 20 mA is 0…32000; EM 231, tables A-27 and A-34: 100.2 °C is 1002, all channels new each 405 ms, broken wire
32767 or −32768, without supply 32766); NAMUR NE 43 (3.8 mA at the least, 3.6 mA: broken). The
programs run in awlsim, in an S5 that knows the listing alone, and in the S7-200's machine.
"""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from tests.golden.heater import Heater, told
from tests.golden.s5_machine import Machine
from tests.golden.test_fb41 import _stub
from tests.golden.test_s7_300_program import DATA, NAMES, Tip

from heatertune.cli import main
from heatertune.errors import InputError, OutOfRange, UnknownName
from heatertune.model.model_values import Fopdt, model_by_hand
from heatertune.pid.design_values import PidDesign
from heatertune.plc import Certificate, Ramp, controller_for
from heatertune.plc.cpu.s7_200 import COLD, assemble, run
from heatertune.plc.inputs import INPUTS, sensor_scaling
from heatertune.plc.pwm import Actuator
from heatertune.proof import Scenario, prove, simulate
from heatertune.proof.scenario import delay_heater
from heatertune.proof.test_sequence import LoopTiming, story_for
from heatertune.settings import Conditions

S7 = ("s7-300", "fb41")


def _words(target, name, sensor_degC=None, ramp=None):
    design = PidDesign(gain_pct_per_degC=4.0, integral_time_s=22.0, derivative_time_s=0.0, sample_time_s=4.0, structure="pi",
                       method="")
    which = controller_for(target)
    return replace(which.encode(design, sensor_scaling(which.ranges, name, sensor_degC)), ramp=ramp)


def _text(words, setpoint=61.7, actuator=None):
    told = Certificate(verdict="PASS", setpoint_degC=setpoint, actuator=actuator or Actuator(pwm_period_s=4.0, resolution_s=1.0))
    files = controller_for(words.target).export(words, told)
    return next(text for name, text in files.items() if name.endswith((".awl", "program_listing.txt")))


@pytest.mark.parametrize(("target", "name"), [
    *product(S7, ("thermocouple", "rtd", "rtd-climatic")), *product(["s7-200-pid"], ("thermocouple", "rtd"))])
def test_digits_are_degrees_as_the_modules_table_has_them_the_nearest_one(target, name):
    words, which = _words(target, name), controller_for(target)
    cases = {100.2: 1002, 200.0: 2000, 61.7: 617, 61.76: 618, 61.74: 617, 0.04: 0, -3.0: 0}
    if name == "rtd-climatic":
        cases = {61.7: 6170, 100.2: 10020, 61.704: 6170, 61.706: 6171}
    for celsius, digits in cases.items():
        assert which.measure(words, celsius) == digits, celsius
        if celsius > 1.0:
            assert {"s7-300": f"SP := {digits} ;", "fb41": "SP := ", "s7-200-pid": f"= {digits / 32000:.9g}, the proven"}[target] in _text(words, celsius)


def test_an_em_231_tells_no_power_of_a_broken_wire_and_is_read_in_each_scan():
    words = _words("s7-200-pid", "thermocouple")
    program = assemble(_text(words))
    begun = run(program, "OB1", COLD.written({"AIW0": 617, "SM0.1": 1})).written({"VD104": 0x3D000000})  # 1/32 of 3200 °C: 100 °C
    assert begun.read("VW94") == 617
    # the module has a new value only after the last one was read, A-73: OB1 reads it in each scan
    assert run(program, "OB1", begun.written({"AIW0": 618, "SM0.1": 0})).read("VW94") == 618

    def call(cpu, reading):
        return run(program, "INT0", cpu.written({"AIW0": reading, "VW90": 1}))

    for reading in (617, -50, 999):  # 100 °C − 99.9 °C is 0.1 °C · 4 %/°C = 0.4 %
        assert call(begun, reading).width > 0, reading
    for reading in (1001, 13720, 32766, 32767, -32767, -32768):
        assert call(begun, reading).width == 0, reading


def test_the_proof_of_an_em_231_waits_for_two_updates_of_the_module():
    own = controller_for("s7-200-pid")
    assert own.delayed_s(own.scaled("rtd")) == 2 * 0.405
    assert own.delayed_s(own.scaled("4-20mA")) == own.delayed_s(own.scaled(None)) == 0.0
    words = _words("s7-200-pid", "rtd")
    heater = Fopdt(gain_degC_per_pct=0.9, time_constant_s=40.0, dead_time_s=3.0, ambient_degC=20.0)
    trace = simulate(own, words, heater, Scenario(setpoint_degC=61.7, duration_s=600.0))
    assert trace.temperature_degC[-1] == pytest.approx(61.7, abs=0.2)
    assert trace.resolution_degC == pytest.approx(0.1)
    text = _text(words)
    for part in ("sensor 0...3200 degC = 0...32000 on AIW0", "an EM231 for a resistance thermometer (0.1 degC per digit", "gives 0: a limiter must"):
        assert part in text


def test_an_interlock_behind_a_module_in_degrees_needs_its_limit():
    for target, name, end in (("s7-300", "thermocouple", "2764.8"), ("s7-200-pid", "rtd", "3200")):
        with pytest.raises(InputError, match=rf"--interlock with --input {name} needs --limit-temperature: .* up to {end} °C"):
            prove(_words(target, name), model_by_hand(Fopdt(gain_degC_per_pct=0.9, time_constant_s=40.0, dead_time_s=3.0, ambient_degC=20.0)),
                  Conditions(setpoint_degC=60.0, interlock="heater-fan"), first_look=True)


class Thermocouple(Tip):
    """The program around the tip, its input a thermocouple's."""

    def setpoint(self, celsius):
        if not self.begun:  # loaded as it was proven
            assert self.machine.read(DATA, "SP") == int(10.0 * celsius + 0.5)
        self.machine.write(DATA, SP=int(10.0 * celsius + 0.5))

    def tick(self, celsius, due):
        output, _, image = self.machine.tick(self.tick_ms, int(10.0 * celsius + 0.5))
        assert output == image
        if due:
            self.output = 100.0 * self.machine.read(100, "OUT") / 27648
        return output


@pytest.mark.long
def test_a_program_for_a_thermocouple_runs_the_whole_story_as_it_was_proven(machine):
    heater = Fopdt(gain_degC_per_pct=0.9, time_constant_s=40.0, dead_time_s=3.0, ambient_degC=20.0)
    which, words = controller_for("s7-300"), _words("s7-300", "thermocouple")
    actuator, late = Actuator(pwm_period_s=4.0, resolution_s=1.0), delay_heater(heater, which.delay_s)
    loop = LoopTiming(scan_s=4.0, pwm_period_s=4.0, sample_time_s=4.0, integral_time_s=22.0)
    scenario = story_for([late], loop, setpoint_degC=61.7).scenario
    trace, plant = simulate(which, words, late, scenario, actuator), Heater(late, 20.0)
    seen, _ = told(Thermocouple(machine, _text(words), 1000), plant, scenario, 1.0, 4)
    _, temperature, power = map(np.array, zip(*seen, strict=True))
    assert power.tolist() == trace.power_asked_pct.tolist()
    assert temperature == pytest.approx(trace.temperature_degC, abs=1e-6)


@pytest.mark.parametrize("target", S7)
@pytest.mark.parametrize(("name", "good", "broken"), [
    ("thermocouple", (-50, 18200, 32766, -32767), (32767, -32768)), ("rtd", (-50, 8500), (32767, -32768)),
    ("4-20mA", (-691, -1, 27648, 32511), (32767, -692, -4864, -32768)),
])
def test_overflow_underflow_and_a_broken_wire_take_the_power_away_before_the_block(machine, target, name, good, broken):
    source = _text(_words(target, name, (0.0, 150.0) if name == "4-20mA" else None))
    machine.load(source if target == "s7-300" else _stub(source))
    machine.restart()
    power = {"POWER": 27648} if target == "s7-300" else {"LMN": 100.0}
    for reading in good:
        machine.write(DATA if target == "s7-300" else 41, **power)
        assert (machine.tick(1000, reading)[0], machine.read(DATA, "FAULT")) == (1, 0), reading
    for reading in broken:
        machine.write(DATA if target == "s7-300" else 41, **power)
        assert (machine.tick(1000, reading)[0], machine.read(DATA, "FAULT")) == (0, 1), reading


def _s5(raw):
    cpu = Machine(_text(_words("s5-ob251", "4-20mA", (0.0, 150.0))), read=lambda _: raw[0])
    cpu.call("OB 21")
    return cpu


@pytest.mark.parametrize(("units", "x"), [(512, 0), (513, 1), (511, 0), (461, 0), (1603, 1091), (2559, 2047), (2560, 2047), (3071, 2047)])
@pytest.mark.parametrize("status", [0, 4])
def test_the_s5_takes_512_units_for_4_ma(units, x, status):
    cpu = _s5([units << 3 | status])
    cpu.call("OB 13")
    assert (cpu.data[30][22], cpu.data[31][9]) == (x, 0)


@pytest.mark.parametrize("raw", [460 << 3 | 5, 384 << 3, 0, 2, 1603 << 3 | 2, 0xFFF8])
def test_the_s5_switches_off_at_once_below_3_6_ma_until_somebody_asks_for_manual(raw):
    reading = [800 << 3]
    cpu = _s5(reading)
    cpu.inputs.add("I 0.0")
    cpu.call("OB 13")
    assert cpu.written["PY 4"] == 1
    reading[0] = raw
    cpu.call("OB 13")
    assert (cpu.written["PY 4"], cpu.data[31][9]) == (0, 1)
    reading[0] = 800 << 3
    for _ in range(9):
        cpu.call("OB 13")
    assert cpu.written["PY 4"] == 0
    cpu.inputs.clear()
    for _ in range(4):
        cpu.call("OB 13")
    assert cpu.data[31][9] == 0


@pytest.mark.parametrize("ramp", [None, Ramp(step=400)])
def test_the_s7_200_switches_off_below_3_6_ma(ramp):
    # 0 to 20 mA is 0…32000, so 3.6 mA is 5760 and 4 mA 6400
    words = _words("s7-200-pid", "4-20mA", (0.0, 150.0), ramp)
    program = assemble(_text(words))

    def begun(reading):
        return run(program, "OB1", COLD.written({"AIW0": reading, "SM0.1": 1, "VW80": 24000})).written({"VD104": 0x3F400000})

    def call(cpu, reading):
        return run(program, "INT0", cpu.written({"AIW0": reading, "VW90": 1}))

    cpu = begun(6400)
    for _ in range(30):
        cpu = call(cpu, 6400)
    assert cpu.width > 0
    for reading in (5759, 0, -32767, 32766, 32767):
        assert call(cpu, reading).width == 0, reading
    for reading in (5760, 5768, 6080):
        assert call(cpu, reading).width > 0, reading


def test_a_transmitter_gives_3_8_ma_at_the_least_and_the_setpoint_stays_within_its_range():
    which, words = controller_for("s7-200-pid"), _words("s7-200-pid", "4-20mA", (50.0, 150.0))
    assert [which.measure(words, celsius) for celsius in (20.0, 50.0, 150.0, 170.0)] == [6080, 6400, 32000, 32000]
    assert which.ends(words) == (0, 32000)
    assert words.scaling.sensor_degC == (50.0, 150.0)
    heater = Fopdt(gain_degC_per_pct=1.5, time_constant_s=40.0, dead_time_s=3.0, ambient_degC=20.0)
    happens = Scenario(setpoint_degC=90.0, duration_s=400.0)
    trace = simulate(which, words, heater, happens)  # heats though the transmitter is below its range
    assert trace.temperature_degC[-1] == pytest.approx(90.0, abs=1.0)
    with pytest.raises(OutOfRange, match="> 50 and < 150"):
        simulate(which, words, heater, replace(happens, setpoint_degC=45.0))


def test_a_range_that_a_target_does_not_have_or_that_has_its_own_ends_is_refused():
    with pytest.raises(UnknownName, match="unknown input 'pt100'; known: 4-20mA"):
        sensor_scaling(controller_for("fb41").ranges, "pt100")
    for target, name, why in (("s5-ob251", "rtd", "ohms"), ("s5-ob251", "thermocouple", "not known"), ("weg", "4-20mA", "no analog module"),
                              ("s7-200", "thermocouple", "no analog module"), ("s7-200-pid", "rtd-climatic", "use rtd")):
        with pytest.raises(InputError, match=rf"^--input {name}: .*{why}"):
            controller_for(target).scaled(name, (0.0, 100.0))
    with pytest.raises(InputError, match=r"--range 0 400 beside --input rtd: its readings are 0…2764.8 °C"):
        sensor_scaling(controller_for("fb41").ranges, "rtd", (0.0, 400.0))
    for target in S7:
        assert set(controller_for(target).ranges) == set(INPUTS)


@pytest.mark.long
def test_the_range_goes_with_design_words_and_export(tmp_path, capsys):
    folder = tmp_path / "out"
    hand = ["--gain", "3", "--time-constant", "300", "--dead-time", "12", "--ambient", "22"]
    assert main(["tune", *hand, "-o", str(tmp_path / "pid.json")]) == 0
    asked = ["--target", "s7-300", "--setpoint", "200"]
    assert main(["export-db", str(tmp_path / "pid.json"), *asked, "--input", "thermocouple", "-o", str(folder)]) == 0
    text = (folder / NAMES["s7-300"]).read_text()
    assert "the range of a thermocouple in degC, 0.1 degC per digit" in text
    assert "SP := 2000 ;" in text
    again = tmp_path / "again"
    assert main(["export-db", str(folder / "words.json"), "--target", "s7-300", "-o", str(again)]) == 0
    assert (again / NAMES["s7-300"]).read_text() == text
    capsys.readouterr()
    assert main(["diff", str(folder), str(folder / NAMES["s7-300"])]) == 0
    assert main(["compare", str(tmp_path / "pid.json"), "--input", "rtd"]) == 2
