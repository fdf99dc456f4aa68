"""The exported WEG program whole, scan by scan in the machine for structured text, over the whole story of a proof.

The block that the text declares is the room's second implementation. WEG's own, which keeps Ts itself or does not, is played
by it: called as often as the program calls it, or only once Ts has gone by on its own clock.
"""

import random
from dataclasses import replace

import numpy as np
import pytest
from tests.golden.heater import Heater, told
from tests.plc.st_machine import FunctionBlock, Program

from heatertune.model.model_values import Fopdt
from heatertune.pid.design_values import PidDesign
from heatertune.plc import Certificate, Ramp, Scaling, controller_for
from heatertune.plc.open_points import settings_to_prove
from heatertune.plc.pwm import Actuator, on_time, pid_compact
from heatertune.plc.replay import replay
from heatertune.proof import simulate
from heatertune.proof.scenario import delay_heater
from heatertune.proof.test_sequence import LoopTiming, story_for

ROOM = controller_for("weg")
HEATER = Fopdt(gain_degC_per_pct=0.9, time_constant_s=40.0, dead_time_s=3.0, ambient_degC=20.0)
SETPOINT = 61.7


def _words(ta=4.0, ramp=None):
    design = PidDesign(gain_pct_per_degC=4.0, integral_time_s=22.0, derivative_time_s=0.0, sample_time_s=ta, structure="pi",
                       method="")
    return replace(ROOM.encode(design, Scaling(low_degC=0.0, high_degC=150.0)), ramp=ramp)


def _files(words, actuator, folder, setpoint=SETPOINT, **switches):
    certificate = Certificate(verdict="PASS", setpoint_degC=setpoint, actuator=actuator, switches=switches)
    for name, content in ROOM.export(words, certificate).items():
        (folder / name).write_text(content, encoding="utf-8")
    return {path.name: path.read_text(encoding="utf-8") for path in folder.iterdir()}


def _reading(celsius):
    """Feedback: 0…150 °C in 4095 counts, cut."""
    return np.float32(150.0 * int(min(max(celsius * 4095 / 150.0, 0.0), 4095.0)) / 4095)


class Weg:
    """The program, cold at each start-up of the PLC."""

    def __init__(self, text, scan_ms, blocks=None):
        self.text, self.scan_ms, self.blocks = text, scan_ms, blocks
        self.program = Program(text, blocks)
        assert self.program.variables.HeaterSetPoint == _reading(SETPOINT)  # as it was proven

    def setpoint(self, celsius):
        self.asked = _reading(celsius)

    def begin(self):
        self.program = Program(self.text, self.blocks)

    def tick(self, celsius, due):
        after = self.program.call(HeaterOn=True, HeaterTemperature=_reading(celsius), HeaterSetPoint=self.asked, ScanMs=self.scan_ms)
        if due:
            self.output = float(after.HeaterPower)
        return after.HeaterOutput


@pytest.mark.long
@pytest.mark.parametrize("ramp", [None, Ramp(step=float(np.float32(0.31)), calls=1, hold=5.0)], ids=["plain", "on a ramp"])
def test_the_exported_folder_runs_the_whole_story_as_it_was_proven(tmp_path, ramp):
    words, actuator, heater = _words(ramp=ramp), Actuator(pwm_period_s=4.0, resolution_s=0.5), delay_heater(HEATER, ROOM.delay_s)
    loop = LoopTiming(scan_s=4.0, pwm_period_s=4.0, sample_time_s=4.0, integral_time_s=22.0, ramp_degC_per_min=ROOM.ramp_degC_per_min(words))
    scenario = story_for([heater], loop, setpoint_degC=SETPOINT).scenario
    trace = simulate(ROOM, words, heater, scenario, actuator)
    plant = Heater(heater, 20.0)
    seen, calls = told(Weg(_files(words, actuator, tmp_path)["weg_pid_block.st"], 500), plant, scenario, 0.5, 8)
    time, temperature, power = map(np.array, zip(*seen, strict=True))
    assert power.tolist() == trace.power_asked_pct.tolist()
    assert temperature == pytest.approx(trace.temperature_degC, abs=1e-6)
    end = time[-1] - 4.0
    edges, proven = ([(at, on) for at, on in pairs if at < end] for pairs in (
        plant.edges, zip(trace.edge_time_s.tolist(), trace.edge_on.tolist(), strict=True)))
    assert [on for _, on in edges] == [on for _, on in proven]
    assert [at for at, _ in edges] == pytest.approx([at for at, _ in proven], abs=1e-6)
    assert calls < len(time)
    assert len(edges) > 500


class Wegs:
    """WEG's block, played by the exported one; `clock` is the scans', kept is whether it keeps Ts itself.

    Its own clock is `early` ms behind when a call comes after Ts: then it waits for the next one.
    """

    kept, clock, text, early = False, 0, "", 0

    def __init__(self):
        self.block, self.since, self.calls, self.EN = FunctionBlock(self.text), None, 0, False

    def __call__(self, Type, Action, Ts, **inputs):
        waits = self.EN and self.kept and self.since is not None and Wegs.clock - self.since - self.early < Ts
        if not waits:
            self.block.call(Enable=self.EN, Form=Type, Acting=Action, Ts=Ts, **inputs)
            self.since, self.calls = Wegs.clock if self.EN else None, self.calls + self.EN
        return self

    @property
    def Output(self):
        return self.block.variables.Output


def _run(files, scans, *, kept, early=0, name="weg_pid_call.st", **inputs):
    """HeaterPower after each scan of 10 ms, and how often the block computed."""
    Wegs.kept, Wegs.text, Wegs.clock, Wegs.early = kept, files["weg_pid_block.st"], 0, early
    program, powers = Program(files[name], {"FB_PID": Wegs}), []
    for _ in range(scans):
        after = program.call(HeaterOn=True, HeaterTemperature=np.float32(60.0), HeaterSetPoint=np.float32(62.0), ScanMs=10, **inputs)
        powers.append(float(after.HeaterPower))
        Wegs.clock += 10
    return powers, program.variables.HeaterPid.calls


def test_whoever_keeps_ts_the_block_computes_each_ts_once_each_ts(tmp_path):
    # the help does not tell; a call each scan of a block that does not keep Ts would integrate a hundred times too fast
    files = _files(_words(ta=0.2), Actuator(pwm_period_s=0.2), tmp_path)
    plain, calls = _run(files, 200, kept=False)
    assert calls == 10
    assert _run(files, 200, kept=True) == (plain, 10)  # which the first scan finds out
    late, calls = _run(files, 200, kept=True, early=1)
    assert (calls, set(late[1:]) <= set(plain)) == (10, True)  # each call a scan late, none lost
    assert plain[0] == 0.0  # the edge of EN
    assert plain[20] == pytest.approx(8.0 + 4.0 / 22.0 * 0.2 * 2.0, abs=1e-3)
    told = _files(_words(ta=0.2), Actuator(pwm_period_s=0.2), tmp_path, sampling="block")
    assert _run(told, 200, kept=True) == (plain, 10)
    assert _run(told, 200, kept=False)[1] == 200  # told wrongly
    assert "keeps Ts itself, as you told" in told["weg_pid_call.st"]
    caller = _files(_words(ta=0.2), Actuator(pwm_period_s=0.2), tmp_path, sampling="caller")
    assert _run(caller, 200, kept=False) == (plain, 10)
    assert "is called each Ts, as you told" in caller["weg_pid_call.st"]


def test_a_block_that_keeps_ts_and_finds_the_calls_early_does_what_the_proof_calls_skipped(tmp_path):
    words = _words(ta=0.2)
    files = _files(words, Actuator(pwm_period_s=0.2), tmp_path, sampling="skipped")  # told, it does not find out
    powers, calls = _run(files, 200, kept=True, early=1)
    assert calls == 5
    rows = [{"SetPoint": float(np.float32(62.0)), "Feedback": float(np.float32(60.0))}] * 10
    assert powers[::20] == [scan.output for scan in replay(ROOM, words, rows, {"sampling": "skipped"})]
    assert powers[::20] != [scan.output for scan in replay(ROOM, words, rows, {})]
    open_ = {setting["sampling"] for setting in settings_to_prove(ROOM.switches)}
    assert open_ == {"caller"}
    assert {setting["sampling"] for setting in settings_to_prove(ROOM.switches, {"sampling": "block"})} == {"block"}


def test_a_contact_on_en_makes_each_call_an_edge_and_output_0_for_ever(tmp_path):
    # WPS help: the positive edge of EN makes Output zero; so the program holds EN and leaves the call out
    files = _files(_words(ta=0.2), Actuator(pwm_period_s=0.2), tmp_path)
    right = files["weg_pid_call.st"]
    begin, end = right.index("IF HeaterDue OR BlockKeepsTs"), right.index("IF NOT HeaterOn THEN")
    call = right[begin:end].split("\n", 1)[1].rsplit("END_IF;", 1)[0].replace("EN := HeaterOn", "EN := HeaterDue")
    files["contact"] = right[:begin] + call + right[end:]
    powers, calls = _run(files, 400, kept=False, name="contact")
    assert (set(powers), calls) == ({0.0}, 20)
    assert max(_run(files, 400, kept=False)[0]) > 8.0


def test_en_false_leaves_the_blocks_output_and_the_program_puts_the_power_to_0(tmp_path):
    # WPS help: "When EN has FALSE value, Output remains unchanged"; its positive edge makes Output 0
    files = _files(_words(ta=0.2), Actuator(pwm_period_s=0.2), tmp_path)
    Wegs.kept, Wegs.text, Wegs.clock = False, files["weg_pid_block.st"], 0
    program = Program(files["weg_pid_call.st"], {"FB_PID": Wegs})

    def scan(on):
        after = program.call(HeaterOn=on, HeaterTemperature=np.float32(30.0), ScanMs=10)
        return float(after.HeaterPower), after.HeaterOutput, float(after.HeaterPid.Output)

    on = [scan(True) for _ in range(41)]
    assert on[0] == (0.0, False, 0.0)
    assert on[40] == (100.0, True, 100.0)
    assert scan(False) == (0.0, False, 100.0)
    assert scan(False) == (0.0, False, 100.0)
    assert scan(True) == (0.0, False, 0.0)  # an edge again, at once
    assert [scan(True)[0] for _ in range(20)] == [0.0] * 19 + [100.0]


@pytest.mark.parametrize("actuator", [
    Actuator(pwm_period_s=4.0), Actuator(pwm_period_s=8.0, resolution_s=0.005), Actuator(pwm_period_s=1.0, resolution_s=1.0),
    Actuator(pwm_period_s=2.0, minimum_on_s=0.1, minimum_off_s=0.25), Actuator(pwm_period_s=60.0, minimum_on_s=5.0),
], ids=["plain", "fine", "one step", "both minima", "contactor"])
def test_the_pwm_gives_the_pulses_that_were_proven(tmp_path, actuator):
    program = Program(_files(_words(), actuator, tmp_path)["weg_pid_block.st"])
    rng, steps, f = random.Random(3), round(actuator.pwm_period_s / actuator.resolution_s), np.float32
    ties = [f((2 * n + 1) * 50 / steps) for n in rng.sample(range(steps), min(steps, 60))]
    powers = [f(0), f(100), *ties, *(np.nextafter(tie, f(way)) for tie in ties for way in (-1, 101)),
              *(f(100 * 2.0**-n * rng.random()) for n in range(30)), *(f(100 * rng.random()) for _ in range(200))]
    pulses = []
    for power in powers:
        program.call(HeaterOn=False)
        program.call(HeaterOn=True, ByHand=True, HandPower=power, HeaterTemperature=30.0, ScanMs=4000)
        program.call(HeaterOn=True)
        program.variables.HeaterPhase = 0
        program.call(HeaterOn=True, ScanMs=round(1000 * actuator.pwm_period_s))  # a period begins, at this power
        pulses.append(program.variables.HeaterOnMs / 1000.0)
        assert pulses[-1] == pytest.approx(on_time(float(power), 0.0, actuator.numbers)[0], abs=1e-9), power
    assert {0.0, actuator.pwm_period_s} <= set(pulses)


def test_a_scan_that_is_no_part_of_ts_keeps_the_mean_of_both_clocks(tmp_path):
    program = Program(_files(_words(ta=1.0), Actuator(pwm_period_s=1.0), tmp_path)["weg_pid_block.st"])
    outputs, due = [], []
    for _ in range(7 * 143):  # 7 ms; 143 scans are 1.001 s
        after = program.call(HeaterOn=True, ByHand=True, HandPower=30.0, HeaterTemperature=30.0, ScanMs=7)
        outputs.append(after.HeaterOutput)
        due.append(after.HeaterDue)
    assert sum(due) == 8
    assert sum(outputs[143:]) * 7 == pytest.approx(6 * 300, abs=6 * 7)


@pytest.mark.parametrize(("actuator", "why"), [
    (None, "no switch is known"), (Actuator(pwm_period_s=4.0, resolution_s=0.0035), "no whole steps"),
    (pid_compact(pwm_period_s=4.0, call_interval_s=0.1), "makes up what is left out"),
])
def test_what_is_no_pwm_of_whole_scans_is_left_to_the_user_and_told(tmp_path, actuator, why):
    files = _files(_words(), actuator, tmp_path)
    for text in files.values():
        assert f"no PWM in the program: {why}" in text or why in text
        assert "HeaterOutput" not in text
        assert "through a PWM of yours" in text


def test_the_files_are_read_back_and_their_heads_name_the_conditions(tmp_path):
    words = _words()
    for text in _files(words, Actuator(pwm_period_s=4.0), tmp_path).values():
        assert ROOM.text(text, None, "file").values == words.values
        for part in ("sensor 0...150 degC; TA: called every 4000 ms", "proven setpoint: 61.7", "PWM period 4 s in steps of 0.01 s",
                     "1. wire HeaterOn", "finds out (HeaterProbe)"):
            assert part in text
