"""The exported programs of the S7-300 whole, in awlsim: restart, clock, broken sensor, ramp, PWM.

The tests know the exported files only. awlsim never schedules OB35 and is slow: over the whole story OB35 ticks four times
in a sampling interval, every tick in awlsim; ticks of 10 ms are run for some periods, and held against `on_time`.
FB41 and FB43 are not in awlsim: a block with the interface stands in their place. CONT_C's LMN is then that of the test's
NumPy implementation of the equation (see test_fb41), PULSEGEN is written in STL after its manual's example.
"""

import random
import re
from dataclasses import replace

import numpy as np
import pytest
from tests.golden.heater import Heater, told
from tests.golden.test_fb41 import _Float32, _stub

from heatertune.model.model_values import Fopdt
from heatertune.pid.design_values import PidDesign
from heatertune.plc import Certificate, Ramp, Scaling, controller_for
from heatertune.plc.pwm import Actuator, on_time, pid_compact, pulsegen
from heatertune.plc.targets import commissioning
from heatertune.proof import simulate
from heatertune.proof.scenario import PlcPower, delay_heater
from heatertune.proof.test_sequence import LoopTiming, story_for

HEATER = Fopdt(gain_degC_per_pct=0.9, time_constant_s=40.0, dead_time_s=3.0, ambient_degC=20.0)
NAMES = {"s7-300": "s7_300_pid.awl", "fb41": "fb41_cont_c.awl"}
SETPOINT = 61.7
DATA = 101


def _words(target, ta=4.0, ramp=None):
    design = PidDesign(gain_pct_per_degC=4.0, integral_time_s=22.0, derivative_time_s=0.0, sample_time_s=ta, structure="pi",
                       method="")
    return replace(controller_for(target).encode(design, Scaling(low_degC=0.0, high_degC=150.0)), ramp=ramp)


def _folder(words, actuator, folder, setpoint=SETPOINT):
    certificate = Certificate(verdict="PASS", setpoint_degC=setpoint, actuator=actuator, specification="general",
                              digest="sha256:0")
    for name, content in controller_for(words.target).export(words, certificate).items():
        (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode("ascii"))
    return (folder / NAMES[words.target]).read_bytes().decode("ascii")


def _counts(celsius):
    """The analog input: 0…150 °C is 0…27648, cut and limited."""
    return int(min(max(celsius * 27648 / 150.0, 0.0), 27648.0))


class Tip:
    """The program around the tip, in awlsim."""

    def __init__(self, machine, source, tick_ms):
        self.machine, self.tick_ms, self.begun = machine, tick_ms, False
        machine.load(source)

    def setpoint(self, celsius):
        if not self.begun:  # loaded as it was proven
            assert self.machine.read(DATA, "SP") == _counts(celsius)
        self.machine.write(DATA, SP=_counts(celsius))

    def begin(self):
        self.machine.restart()
        if not self.begun:
            assert self.machine.tick(self.tick_ms, 0)[0] == 0  # manual after loading: nothing heats
            self.machine.restart()
            self.machine.write(DATA, AUTO=1)
        assert self.machine.read(DATA, "AUTO") == 1
        self.begun = True

    def tick(self, celsius, due):
        output, _, image = self.machine.tick(self.tick_ms, _counts(celsius))
        assert output == image
        if due:
            self.output = 100.0 * self.machine.read(100, "OUT") / 27648
        return output


class ContC(Tip):
    """The program around CONT_C, whose LMN is NumPy's."""

    def __init__(self, machine, source, tick_ms, values):
        super().__init__(machine, _stub(source), tick_ms)
        self.values = values

    def setpoint(self, celsius):
        f = np.float32
        self.asked = f(_counts(celsius)) * f(100) / f(27648) * f(1.5) + f(0)
        if not self.begun:
            assert self.machine.read(DATA, "SP") == self.asked
        self.machine.write(DATA, SP=float(self.asked))

    def begin(self):
        super().begin()
        assert self.machine.read(41, "COM_RST") == 1
        self.block = _Float32(self.values)

    def tick(self, celsius, due):
        if due:
            lmn = self.block.call(self.asked, _counts(celsius))
            self.machine.write(41, LMN=lmn)
            self.output = min(max(lmn, 0.0), 100.0)
        output = super().tick(celsius, False)
        if due:
            called = {name: self.machine.read(41, name) for name in ("COM_RST", "MAN_ON", "SP_INT", "PV_PER")}
            assert called == {"COM_RST": 0, "MAN_ON": 0, "SP_INT": self.asked, "PV_PER": _counts(celsius)}
        return output


@pytest.mark.long
@pytest.mark.parametrize(("target", "ramp"), [("s7-300", None), ("s7-300", Ramp(step=60, calls=1, hold=900)), ("fb41", None)],
                         ids=["s7-300", "s7-300 on a ramp", "fb41"])
def test_the_exported_folder_runs_the_whole_story_as_it_was_proven(machine, tmp_path, target, ramp):
    controller, words = controller_for(target), _words(target, ramp=ramp)
    actuator = Actuator(pwm_period_s=4.0, resolution_s=1.0)
    heater = delay_heater(HEATER, controller.delay_s)
    loop = LoopTiming(scan_s=4.0, pwm_period_s=4.0, sample_time_s=4.0, integral_time_s=22.0, ramp_degC_per_min=controller.ramp_degC_per_min(words))
    scenario = story_for([heater], loop, setpoint_degC=SETPOINT).scenario
    assert sum(isinstance(event, PlcPower) and event.on for event in scenario.disturbances) == 2  # hot and cold
    trace = simulate(controller, words, heater, scenario, actuator)
    source = _folder(words, actuator, tmp_path)
    plc = Tip(machine, source, 1000) if target == "s7-300" else ContC(machine, source, 1000, words.values)
    plant = Heater(heater, 20.0)
    seen, calls = told(plc, plant, scenario, 1.0, 4)
    time, temperature, power = map(np.array, zip(*seen, strict=True))
    assert time == pytest.approx(trace.time_s, abs=1e-6)
    assert power.tolist() == trace.power_asked_pct.tolist()
    assert temperature == pytest.approx(trace.temperature_degC, abs=1e-6)
    end = time[-1] - 4.0
    edges = [(at, on) for at, on in plant.edges if at < end]
    proven = [(at, on) for at, on in zip(trace.edge_time_s.tolist(), trace.edge_on.tolist(), strict=True) if at < end]
    assert [on for _, on in edges] == [on for _, on in proven]
    assert [at for at, _ in edges] == pytest.approx([at for at, _ in proven], abs=1e-6)
    assert calls < len(time)
    assert len(edges) > 500


def _loaded(machine, target, tmp_path, actuator, ta=4.0, before=""):
    source = _folder(_words(target, ta), actuator, tmp_path)
    machine.load(before + (source if target == "s7-300" else _stub(source)))
    machine.restart()


def _asked(machine, target, power):
    """Begin anew in manual with a power; the tick that follows is the first of a period."""
    machine.restart()
    if target == "s7-300":
        machine.write(DATA, POWER=power)
    else:
        machine.write(41, LMN=power)


def _powers(target, ticks):
    """Powers all over the range, at the ends, and around those at which half a tick is rounded."""
    rng = random.Random(ticks)
    if target == "s7-300":
        ties = [(2 * n + 1) * 27648 // (2 * ticks) + near for n in rng.sample(range(ticks), min(ticks, 40)) for near in (0, 1)]
        return [-5, 0, 1, 27647, 27648, 32767, *ties, *(rng.randint(0, 27648) for _ in range(60))]
    f = np.float32
    ties = [f((2 * n + 1) * 50 / ticks) for n in rng.sample(range(ticks), min(ticks, 40))]
    near = [np.nextafter(tie, f(way)) for tie in ties for way in (-1, 101)]
    small = [f(100 * 2.0**-power * rng.random()) for power in range(1, 30)]
    powers = [-3.0, 0.0, 1e-30, 100.0, 130.0, *ties, *near, *small, *(f(100 * rng.random()) for _ in range(60))]
    return [float(power) for power in powers]


@pytest.mark.long
@pytest.mark.parametrize("target", ["s7-300", "fb41"])
@pytest.mark.parametrize("actuator", [
    Actuator(pwm_period_s=4.0), Actuator(pwm_period_s=7.3, resolution_s=0.005), Actuator(pwm_period_s=1.0, resolution_s=1.0),
    Actuator(pwm_period_s=2.0, minimum_on_s=0.1, minimum_off_s=0.25), Actuator(pwm_period_s=60.0, minimum_on_s=5.0),
    Actuator(pwm_period_s=3.0, resolution_s=0.02, minimum_on_s=1.5, minimum_off_s=1.5),
], ids=["plain", "fine", "one tick", "both minima", "contactor", "half"])
def test_the_pwm_counts_the_ticks_that_were_proven(machine, tmp_path, target, actuator):
    # the count is made in the first tick of a period; that it is run is the next test's
    _loaded(machine, target, tmp_path, actuator, ta=4.0 if actuator.pwm_period_s != 7.3 else 7.3)
    tick_ms, ticks = round(1000 * actuator.resolution_s), round(actuator.pwm_period_s / actuator.resolution_s)
    counts = []
    for power in _powers(target, ticks):
        _asked(machine, target, power)
        machine.tick(tick_ms, 5000)
        asked = power if target == "fb41" else 100.0 * power / 27648
        proven = on_time(min(max(asked, 0.0), 100.0), 0.0, actuator.numbers)[0]
        counts.append(machine.read(102, "COUNT"))
        assert counts[-1] * actuator.resolution_s == pytest.approx(proven, abs=1e-9), power
    assert {0, ticks} <= set(counts)


@pytest.mark.parametrize("target", ["s7-300", "fb41"])
def test_ticks_of_10_ms_switch_the_output_at_once(machine, tmp_path, target):
    actuator = Actuator(pwm_period_s=0.5, minimum_on_s=0.03)
    _loaded(machine, target, tmp_path, actuator, ta=1.0)
    _asked(machine, target, 27648 * 3 // 10 if target == "s7-300" else 30.0)
    outputs = [machine.tick(10, 5000) for _ in range(100)]
    assert [output for output, _, _ in outputs] == ([1] * 15 + [0] * 35) * 2
    assert all(output == image for output, _, image in outputs)


@pytest.mark.parametrize("target", ["s7-300", "fb41"])
def test_a_period_keeps_the_power_that_it_began_with(machine, tmp_path, target):
    # the period is longer than TA: what is asked for in between waits for the next one, as in the proof
    _loaded(machine, target, tmp_path, Actuator(pwm_period_s=8.0, resolution_s=1.0))
    _asked(machine, target, 6912 if target == "s7-300" else 25.0)
    outputs = [machine.tick(1000, 5000)[0] for _ in range(3)]
    machine.write(DATA if target == "s7-300" else 41, **({"POWER": 20736} if target == "s7-300" else {"LMN": 75.0}))
    outputs += [machine.tick(1000, 5000)[0] for _ in range(13)]
    assert outputs == [1, 1, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 1, 0, 0]


@pytest.mark.parametrize("target", ["s7-300", "fb41"])
def test_a_restart_needs_nothing_of_what_data_blocks_have_kept_but_auto_and_sp(machine, target):
    words = _words(target, ramp=Ramp(step=60, calls=2, hold=900))
    source = controller_for(target).export(words, Certificate(
        verdict="PASS", setpoint_degC=SETPOINT, actuator=Actuator(pwm_period_s=4.0, resolution_s=1.0)))[NAMES[target]]
    kept = {"AUTO", "SP", "TICK_MS", "PER_CALL", "PERIOD", "LEAST", "MOST", "GAIN", "RATE", "RESET", "SAMPLE"}
    runs = []
    for rubbish in (0, 1, 77):
        machine.load(source if target == "s7-300" else _stub(source))
        machine.write(DATA, AUTO=1)
        for number in (DATA, 102, *([100] if target == "s7-300" else [])) if rubbish else ():
            machine.write(number, **{name: (1 if kind == "BOOL" else 0.77 if kind == "REAL" else rubbish)
                                     for name, (_, _, kind) in machine.names(number).items() if name not in kept})
        machine.restart()
        seen = []
        for tick in range(24):
            output, _, _ = machine.tick(1000, 5000 + 10 * tick)
            if target == "fb41":
                machine.write(41, LMN=40.0)
            seen.append((output, machine.read(DATA, "LED"), machine.read(100, "OUT") if target == "s7-300" else machine.read(41, "COM_RST")))
        runs.append(seen)
    assert runs[1:] == runs[:1] * 2
    assert len(set(runs[0])) > 4


def test_a_restart_in_manual_clears_the_power_that_cont_c_gets_by_hand(machine, tmp_path):
    _loaded(machine, "fb41", tmp_path, Actuator(pwm_period_s=1.0), ta=1.0)
    machine.write(DATA, POWER=40.0)
    machine.write(41, LMN=40.0)
    assert machine.tick(10, 5000)[0] == 1
    assert (machine.read(41, "MAN_ON"), machine.read(41, "MAN")) == (1, 40.0)
    machine.restart()
    assert machine.read(DATA, "POWER") == 0.0


def test_a_call_comes_every_so_many_ticks(machine, tmp_path):
    _loaded(machine, "s7-300", tmp_path, Actuator(pwm_period_s=4.0, resolution_s=0.5))
    readings = []
    for tick in range(24):
        machine.tick(500, 1000 + tick)
        readings.append(machine.read(100, "PV"))
    assert readings == [1000] * 8 + [1008] * 8 + [1016] * 8


@pytest.mark.parametrize("target", ["s7-300", "fb41"])
@pytest.mark.parametrize("broken", [32767, -32768])
def test_a_broken_wire_puts_the_heater_off_at_once_and_all_begins_anew(machine, tmp_path, target, broken):
    _loaded(machine, target, tmp_path, Actuator(pwm_period_s=4.0))
    machine.write(DATA, AUTO=1)
    machine.write(41 if target == "fb41" else DATA, **({"LMN": 50.0} if target == "fb41" else {"SP": 27000}))
    assert [machine.tick(10, 5000)[0] for _ in range(30)] == [1] * 30
    before = machine.block(100) if target == "s7-300" else b""
    assert machine.tick(10, broken)[0] == 0
    assert (machine.read(DATA, "FAULT"), machine.read(DATA, "HEAT"), machine.read(102, "TICK"), machine.read(DATA, "TICKS")) == (1, 0, 0, 0)
    if target == "s7-300":
        assert (machine.read(100, "STARTED"), machine.read(100, "BIAS"), machine.read(100, "OUT")) == (0, 0.0, 0)
    else:
        assert machine.read(41, "COM_RST") == 1
    assert machine.tick(10, 5000)[0] == 1
    assert (machine.read(DATA, "FAULT"), machine.read(DATA, "AUTO")) == (0, 1)
    if target == "s7-300":  # as from cold: the block holds what its first call left
        assert machine.block(100) == before
    assert machine.tick(10, 32766)[0] == machine.tick(10, -32767)[0] == 1  # over-range and under-range are readings


@pytest.mark.parametrize("target", ["s7-300", "fb41"])
@pytest.mark.long
def test_at_another_interval_of_ob35_the_heater_stays_off_and_the_bit_tells(machine, tmp_path, target):
    _loaded(machine, target, tmp_path, Actuator(pwm_period_s=4.0))
    for interval in (100, 9, 11):  # 100 ms is what STEP 7 sets
        _asked(machine, target, 20000 if target == "s7-300" else 60.0)
        assert {machine.tick(interval, 5000)[0] for _ in range(5)} == {0}
        assert machine.read(DATA, "WRONG_CLOCK") == 1
    _asked(machine, target, 20000 if target == "s7-300" else 60.0)
    assert machine.tick(10, 5000)[0] == 1
    assert machine.read(DATA, "WRONG_CLOCK") == 0


def test_a_restart_in_manual_stays_there_with_the_heater_off_and_automatic_hands_its_power_over(machine, tmp_path):
    _loaded(machine, "s7-300", tmp_path, Actuator(pwm_period_s=1.0), ta=1.0)
    _asked(machine, "s7-300", 13824)
    assert machine.tick(10, 5000)[0] == 1
    assert machine.restart()[0] == 0
    assert (machine.read(DATA, "AUTO"), machine.read(DATA, "POWER")) == (0, 0)
    assert machine.tick(10, 5000)[0] == 0
    machine.restart()
    machine.write(DATA, AUTO=1, SP=6000)
    for _ in range(101):
        machine.tick(10, 5000)
    power = machine.read(DATA, "POWER")
    assert power == machine.read(100, "OUT") > 0
    machine.write(DATA, AUTO=0)
    for _ in range(100):
        machine.tick(10, 5000)
    assert machine.read(100, "OUT") == power


#: FB43 as its manual's example counts: a pulse of whole calls, the nearest number of them
PULSEGEN = "\r\n".join(["FUNCTION_BLOCK FB 43", "VERSION : 0.1", "VAR_INPUT", *(f"  {name} : {kind} ;" for name, kind in (
    ("INV", "REAL"), ("PER_TM", "TIME"), ("P_B_TM", "TIME"), ("RATIOFAC", "REAL"), ("STEP3_ON", "BOOL"), ("ST2BI_ON", "BOOL"),
    ("MAN_ON", "BOOL"), ("POS_P_ON", "BOOL"), ("NEG_P_ON", "BOOL"), ("SYN_ON", "BOOL"), ("COM_RST", "BOOL"), ("CYCLE", "TIME"))),
    "END_VAR", "VAR_OUTPUT", "  QPOS_P : BOOL ;", "  QNEG_P : BOOL ;", "END_VAR", "VAR", "  SINCE : DINT ;", "  ON : DINT ;",
    "END_VAR", "BEGIN", "NETWORK",
    *(f"      {each};" for each in (
        "A #COM_RST", "JCN work", "L L#0", "T #SINCE", "T #ON", "CLR", "= #QPOS_P", "BEU")),
    "work: L #SINCE;", *(f"      {each};" for each in (
        "L L#0", "<>D", "JC run", "L #PER_TM", "L #CYCLE", "/D", "DTR", "L #INV", "*R", "L 1.0e2", "/R", "RND", "T #ON",
        "L #CYCLE", "*D", "L #P_B_TM", ">=D", "JC run", "L L#0", "T #ON")),
    "run:  L #SINCE;", *(f"      {each};" for each in (
        "L #ON", "<D", "= #QPOS_P", "L #SINCE", "L L#1", "+D", "T #SINCE", "L #CYCLE", "*D", "L #PER_TM", "<D", "JC end", "L L#0",
        "T #SINCE")), "end:  NOP 0;", "END_FUNCTION_BLOCK", "", ""])


@pytest.mark.parametrize("target", ["s7-300", "fb41"])
def test_where_pulsegen_was_proven_it_is_called(machine, tmp_path, target):
    actuator = pulsegen(pwm_period_s=2.0, call_interval_s=0.1, minimum_s=0.2)
    _loaded(machine, target, tmp_path, actuator, before=PULSEGEN)
    instance = {name: machine.read(43, name) for name in ("PER_TM", "P_B_TM", "CYCLE", "STEP3_ON", "ST2BI_ON", "SYN_ON", "COM_RST")}
    assert instance == {"PER_TM": 2000, "P_B_TM": 200, "CYCLE": 100, "STEP3_ON": 0, "ST2BI_ON": 0, "SYN_ON": 0, "COM_RST": 1}
    for share in (0.0, 3.1, 6.0, 30.0, 47.0, 100.0):
        _asked(machine, target, round(share * 276.48) if target == "s7-300" else share)
        on = sum(machine.tick(100, 5000)[0] for _ in range(20))
        assert on * 0.1 == pytest.approx(on_time(share, 0.0, actuator.numbers)[0], abs=1e-9), share
    assert machine.tick(100, 32767)[0] == machine.read(43, "QPOS_P") == 0
    text = (tmp_path / NAMES[target]).read_text(encoding="ascii")
    assert "FB 43" in text.partition("FUNCTION")[0].partition("DATA_BLOCK")[0]


@pytest.mark.parametrize("target", ["s7-300", "fb41"])
@pytest.mark.parametrize(("actuator", "why"), [
    (Actuator(pwm_period_s=4.0, resolution_s=0.0035), "no whole ticks"), (Actuator(pwm_period_s=4.1, resolution_s=0.3), "no whole ticks"),
    (Actuator(pwm_period_s=4000.0), "no whole ticks"), (pid_compact(pwm_period_s=4.0, call_interval_s=0.1), "makes up what is left out"),
    (None, "no switch is known"),
])
def test_where_ob35_cannot_make_the_pwm_the_output_is_analog_and_the_head_tells(machine, tmp_path, target, actuator, why):
    _loaded(machine, target, tmp_path, actuator)
    head = (tmp_path / NAMES[target]).read_text(encoding="ascii")
    assert why in head
    assert "PWM is not in this program" in head
    machine.write(DATA, POWER=13824 if target == "s7-300" else 50.0)
    if target == "fb41":
        machine.write(41, LMN_PER=13824)
    assert machine.tick(4000, 5000)[1] == 13824
    assert machine.tick(4000, 32767)[1] == 0
    assert machine.tick(100, 5000)[1] == 0


@pytest.mark.parametrize("target", ["s7-300", "fb41"])
@pytest.mark.parametrize("actuator", [Actuator(pwm_period_s=4.0), pulsegen(pwm_period_s=4.0, call_interval_s=0.1), None])
def test_the_folder_is_read_back_and_its_program_is_the_one_exported(tmp_path, target, actuator):
    words, controller = _words(target), controller_for(target)
    text = _folder(words, actuator, tmp_path)
    read = controller.text(text, 4.0, "file")
    assert read.values == words.values
    assert read.unlike(words) == ()
    other = text.replace("L     32767", "L     32766")
    assert "L 32766" in controller.text(other, 4.0, "file").unlike(words)[0]


@pytest.mark.parametrize(("target", "ramp"), [("s7-300", None), ("fb41", None), ("fb41", Ramp(step=9))])
def test_what_the_commissioning_card_names_stands_there(machine, target, ramp):
    words = _words(target, ramp=ramp)
    source = controller_for(target).export(words, Certificate(verdict="PASS", actuator=Actuator(pwm_period_s=4.0)))[NAMES[target]]
    machine.load(source if target == "s7-300" else _stub(source))
    steps = " ".join(step for steps in commissioning(target).steps.values() for step in steps)
    letters = {"INT": "W", "REAL": "D"}
    for name, (byte, bit, kind) in machine.names(DATA).items():
        place = f"DBX{byte}.{bit}" if kind == "BOOL" else f"DB{letters.get(kind)}{byte}"
        if name in ("AUTO", "FAULT", "WRONG_CLOCK", "HEAT", "SP", "POWER"):
            assert re.search(rf"\b{name}\b[^;:]{{0,60}}\b{place}\b", steps), (name, place)


def test_the_head_names_the_conditions_and_what_remains_to_be_done_by_hand(tmp_path):
    text = _folder(_words("s7-300"), Actuator(pwm_period_s=4.0, minimum_on_s=0.1), tmp_path)
    head = text.partition("FUNCTION_BLOCK")[0]
    for part in ("sensor 0..150 degC", "called every 4000 ms, every 400 ticks", "proven setpoint: 61.7 degC",
                 "PWM period 4 s in steps of 0.01 s, no pulse below 0.1 s, what is too short is left out",
                 "specification: general", "digest of the proof: sha256:0", "  1. hardware configuration: OB 35 every 10 ms"):
        assert part in head
    assert max(map(len, text.splitlines())) <= 200


@pytest.mark.parametrize(("ta", "tick", "per_call"), [(32.767, 32767, 1), (32.768, 16384, 2), (60.0, 30000, 2), (59.997, 19999, 3)])
def test_ob35_ticks_no_slower_than_its_exc_freq_can_tell_which_is_an_int(tmp_path, ta, tick, per_call):
    text = _folder(_words("s7-300", ta), None, tmp_path)
    assert f"TICK_MS := {tick} ;" in text
    assert f"PER_CALL := L#{per_call} ;" in text
    assert tick * per_call == round(1000 * ta)
