"""The exported S5 program by itself: its listing in an S5 that knows nothing of heatertune, on a heater of the test's own.

What comes out is what the proof simulated: every setpoint and output word at each call of OB251, every switching of the
heater at its tick, the temperature to a millionth of a degree, through the whole story with its restarts.
"""

import json
import math
import re
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from tests.golden.s5_machine import Controller, Machine, loaded

from heatertune import chain
from heatertune.chain.pipeline import design
from heatertune.model.model_values import Fopdt, TwoLag, model_by_hand
from heatertune.pid.design_values import PidDesign
from heatertune.plc import Certificate, Ramp, Scaling, controller_for
from heatertune.plc.pwm import Actuator, on_time
from heatertune.proof.design_request import DesignRequest
from heatertune.settings import Conditions

TARGET = "s5-ob251"
#: setting of an open point → what the machine's OB251 is told
SETTINGS = {"sum=limited": "limited", "integral_off=same_call": "same_call", "integral_inward=on": "inward",
            "rounding=whole_increments": "whole", "limit=exceeded": "beyond"}


class Heater:
    """Dead time, a small lag, a large one: exact steps from tick to tick, and in between where power arrives.

    The temperature is behind the larger lag, and all lags jump together; load and mains act behind the dead time, too.
    """

    def __init__(self, gain, lags, dead, ambient):
        self.gain, (self.large, self.small), self.dead, self.ambient = gain, sorted((*lags, 0.0)[:2], reverse=True), dead, ambient
        self.now, self.y, self.x, self.power, self.load, self.mains, self.coming = 0.0, ambient, ambient, 0.0, 0.0, 1.0, []
        self.kept = {}

    def to(self, now):
        """Go on to an instant, through all that arrives until then."""
        while self.coming and self.coming[0][0] <= now:
            due, name, value = self.coming.pop(0)
            self._step(due)
            setattr(self, name, value)
        self._step(now)

    def sends(self, name, value):
        """Send power, load or mains on its way."""
        self.coming.append((self.now + self.dead, name, value))

    def jumps(self, by):
        """All lags jump."""
        self.y, self.x = self.y + by, self.x + by

    def _step(self, now):
        dt = now - self.now
        if dt not in self.kept:
            self.kept[dt] = math.exp(-dt / self.large), math.exp(-dt / self.small) if self.small else 0.0
        large, small = self.kept[dt]
        end = self.ambient + self.gain * (self.power * self.mains + self.load)
        through = (self.x - end) * self.small / (self.small - self.large)
        self.y = end + (self.y - end - through) * large + through * small
        self.x, self.now = end + (self.x - end) * small, now


def heater_of(folder):
    """The nominal heater as the documents have it, with what input module and output add to its dead time."""
    model, proof = (json.loads((folder / "data" / f"{name}.json").read_text()) for name in ("model", "proof"))
    (late,) = [float(found[1]) for found in (re.match(r"dead time (\S+) s longer", told) for told in proof["remarks"]) if found]
    first = (model["candidates"] or [model])[0]
    lags = [first[name] for name in ("time_constant_s", "second_time_constant_s") if first.get(name)]
    return Heater(first["gain_degC_per_pct"], lags, first["dead_time_s"] + late, first["ambient_degC"])


class Life:
    """The listing in its S5, through the story of a proof (document), tick by tick.

    Without a battery the data blocks are as they were programmed after each loss of supply, but for the setpoint.

    What it leaves: `calls`, (W, YA) of each, None without supply; `temperatures` then; `switchings`, (tick, whether on).
    """

    def __init__(self, listing, proof, heater, controller=None, battery=True):
        self.listing, self.heater, self.battery = listing, heater, battery
        self.kept, self.began, self.number = [], [], 0
        self.low, self.span = proof["scaling"]["low_degC"], proof["scaling"]["high_degC"] - proof["scaling"]["low_degC"]
        self.tick, self.per_call = proof["actuator"]["resolution_s"], round(proof["sample_time_s"] / proof["actuator"]["resolution_s"])
        self.cpu = Machine(listing, read=self.read, controller=controller)
        self.calls, self.temperatures, self.switchings, self.supplied, self.mains = [], [], [], True, 1.0
        self.lives(proof["scenario"], proof["sample_time_s"])

    def read(self, name):
        """The analog input: 13 bits, the lowest three are status."""
        assert name == "PW 128"
        return self.units(self.heater.y) << 3

    def units(self, temperature):
        """The reading of a temperature."""
        return int(min(max((temperature - self.low) * 2047 / self.span, 0.0), 2047.0))

    def lives(self, story, interval):
        """Run the whole story, the last call at its end or just after."""
        events = {round(event["time_s"] / self.tick): event for event in story["disturbances"]}
        assert all(abs(number * self.tick - event["time_s"]) < 1e-6 for number, event in events.items())
        self.cpu.inputs.add("I 0.0")
        assert self.cpu.data[31][0] == self.units(story["setpoint_degC"])
        self.cpu.call("OB 21")
        assert self.cpu.written["RS 97"] == round(100.0 * self.tick)
        for number in range(math.ceil(round(story["duration_s"] / interval, 9)) * self.per_call + 1):
            self.heater.to(number * self.tick)
            self.number = number
            if number in events:
                self.happens(events[number])
            self.ticks(number)

    def ticks(self, number):
        """One call of OB13, where there is a supply; without one the output is off."""
        if self.supplied:
            self.cpu.call("OB 13")
        on = self.cpu.written["PY 4"] if self.supplied else 0
        if on != (len(self.switchings) % 2):
            self.switchings.append((number, bool(on)))
            self.heater.sends("power", 100.0 if on else 0.0)
        if number % self.per_call == 0:
            self.temperatures.append(self.heater.y)
            self.calls.append((self.cpu.data[30][9], self.cpu.data[30][48]) if self.supplied else None)

    def happens(self, event):
        """What the proof's document says of it."""
        if "temperature_degC" in event:
            self.heater.jumps(event["temperature_degC"])
        elif "power_pct" in event:
            self.heater.sends("load", self.heater.load + event["power_pct"])
        elif "setpoint_degC" in event:
            self.cpu.data[31][0] = self.units(event["setpoint_degC"])
        else:
            self.mains = event.get("share", self.mains)
            self.supply(event.get("on", self.supplied))
            self.heater.sends("mains", self.mains * self.supplied)

    def supply(self, on):
        """The PLC loses its supply, or gets it back."""
        if on and not self.supplied:
            if not self.battery:
                asked, (_, self.cpu.data) = self.cpu.data[31][0], loaded(self.listing)
                self.cpu.data[31][0] = asked
            before = list(self.cpu.data[30])
            self.cpu.call("OB 22")
            self.began.append(self.number)
            self.kept.append(self.cpu.data[30] == before)
        self.supplied = on


def assert_same(life, trace):
    """Compare with a trace of the proof, whose last edges may come after its last scan."""
    scale = trace.words.scaling
    told = [(round((w - scale.low_degC) * 2047 / scale.span_degC), round(power * 20.47))
            for w, power in zip(trace.followed_degC, trace.power_asked_pct, strict=True)]
    assert len(set(told)) > 20
    assert [call or (w, 0) for call, (w, _) in zip(life.calls, told, strict=True)] == told
    edges = [(round(time / life.tick), bool(on)) for time, on in zip(trace.edge_time_s, trace.edge_on, strict=True)]
    assert life.switchings == edges
    assert np.abs(np.array(life.temperatures) - trace.temperature_degC).max() < 1e-6


@pytest.mark.long
def test_the_files_of_table4_alone_do_what_was_proven(tmp_path):
    proven = design("table4", DesignRequest(target=TARGET), out=tmp_path).outcome.proof
    listing, proof = (tmp_path / "program_listing.txt").read_text(), json.loads((tmp_path / "data" / "proof.json").read_text())
    assert proof["verdict"] == "PASS"
    assert_same(Life(listing, proof, heater_of(tmp_path)), proven.nominal)
    assert not {f"{name}={setting}" for name, setting in proven.worst.switches.items()} & set(SETTINGS), "under the defaults"
    assert_same(Life(listing, proof, _like(proven.worst.model), Controller(), battery=False), proven.worst)


@pytest.mark.long
def test_the_files_of_table4_alone_do_what_was_proven_of_another_setting_of_ob251(tmp_path):
    conditions = Conditions(switches={"sum": "limited"})
    proven = design("table4", DesignRequest(target=TARGET, conditions=conditions), out=tmp_path).outcome.proof
    listing, proof = (tmp_path / "program_listing.txt").read_text(), json.loads((tmp_path / "data" / "proof.json").read_text())
    chosen = [SETTINGS[each] for each in (f"{name}={setting}" for name, setting in proven.worst.switches.items()) if each in SETTINGS]
    assert "limited" in chosen
    worst = Life(listing, proof, _like(proven.worst.model), Controller(**dict.fromkeys(chosen, True)), battery=False)
    assert_same(worst, proven.worst)


def _like(model):
    return Heater(model.gain_degC_per_pct, model.lags_s, model.dead_time_s, model.ambient_degC)


QUICK = Fopdt(gain_degC_per_pct=0.6, time_constant_s=60.0, dead_time_s=3.7, ambient_degC=21.0)
TWO = TwoLag(gain_degC_per_pct=0.6, time_constant_s=50.0, second_time_constant_s=11.0, dead_time_s=1.3, ambient_degC=21.0)


@pytest.mark.long
@pytest.mark.parametrize(("heater", "design", "ramp", "conditions"), [
    (QUICK, (1.4, 50.0, 5.0, 4.0), None, {}),  # a D part; TA = PWM period = 80 ticks of 50 ms
    (TWO, (2.5, 40.0, 0.0, 3.0), Ramp(step=7, calls=3, hold=40), {"pwm_period_s": 12.0, "minimum_on_s": 0.7, "minimum_off_s": 0.9}),
    (TWO, (2.5, 40.0, 0.0, 3.0), Ramp(step=2), {"pwm_period_s": 1.5, "pwm_resolution_s": 0.02}),
    (TWO, (2.5, 40.0, 0.0, 3.0), None, {"pwm_period_s": 7.1, "pwm_resolution_s": 0.1}),  # begins anew at each start-up
])
def test_the_listing_with_all_that_it_may_hold_does_what_was_proven(heater, design, ramp, conditions):
    gain, tn, tv, ta = design
    wished = PidDesign(gain_pct_per_degC=gain, integral_time_s=tn, derivative_time_s=tv, sample_time_s=ta,
                       structure="pid" if tv else "pi", method="")
    words = replace(chain.encode(wished, TARGET, scaling=Scaling(low_degC=10.0, high_degC=90.0 if tv else 110.0)), ramp=ramp)
    proof = chain.prove(words, model_by_hand(heater), Conditions(setpoint_degC=51.0, **conditions), first_look=True)
    told = Certificate(verdict="PASS", setpoint_degC=51.0, actuator=proof.actuator)
    listing = controller_for(TARGET).export(words, told)["program_listing.txt"]
    life = Life(listing, proof.to_document(), _like(proof.nominal.model))
    assert_same(life, proof.nominal)
    period = round(proof.actuator.pwm_period_s / life.tick)
    assert any(number % period for number in life.began) == (conditions.get("pwm_period_s") == 7.1)


@pytest.mark.long
def test_a_listing_that_retains_goes_on_where_ob251_was_or_from_cold_without_a_battery_as_was_proven():
    # S5-115U: with a battery data blocks outlive a loss of supply; without one they are as programmed, all zero but for the words
    wished = PidDesign(gain_pct_per_degC=1.4, integral_time_s=40.0, derivative_time_s=5.0, sample_time_s=3.0, structure="pid", method="")
    words = replace(chain.encode(wished, TARGET, scaling=Scaling(low_degC=10.0, high_degC=110.0)), ramp=Ramp(step=9))
    proof = chain.prove(words, model_by_hand(TWO), Conditions(setpoint_degC=51.0, switches={"start_up": "retained"}), first_look=False)
    plain = {switch.name: switch.default for switch in controller_for(TARGET).switches}
    kept, lost = ([run.switches for run in proof.runs].index(plain | {"start_up": way}) for way in ("retained", "cleared"))
    told = Certificate(verdict="PASS", setpoint_degC=51.0, actuator=proof.actuator, switches=proof.stated_settings)
    listing = controller_for(TARGET).export(words, told)["program_listing.txt"]
    for run, battery in ((kept, True), (lost, False)):
        trace = proof.trace(run)
        life = Life(listing, proof.to_document(), _like(trace.model), battery=battery)
        assert_same(life, trace)
        assert life.kept == [True, True]
    assert proof.trace(kept).power_asked_pct.tolist() != proof.trace(lost).power_asked_pct.tolist()
    assert "Backup battery" in listing


def test_what_is_retained_is_what_the_start_up_leaves_and_a_broken_sensor_stays_off():
    listing = controller_for(TARGET).export(WORDS, Certificate(
        verdict="PASS", actuator=Actuator(pwm_period_s=4.0, resolution_s=0.4), switches={"start_up": "retained"}))["program_listing.txt"]
    raw = [400 << 3]
    cpu = Machine(listing, read=lambda _: raw[0])
    cpu.inputs.add("I 0.0")
    cpu.data[31][0] = 450
    cpu.call("OB 21")
    _calls(cpu, 5)
    before = list(cpu.data[30])
    assert any(before[18:49])
    cpu.call("OB 21")
    assert cpu.data[30] == before
    assert (cpu.data[31][4:9], cpu.written["PY 4"]) == ([0, 1, 2047 + 1, 0, 0], 0)  # above full power: a period begins
    raw[0] |= 2
    cpu.call("OB 13")
    raw[0] &= ~2
    cpu.call("OB 22")
    _calls(cpu, 2)
    assert (cpu.written["PY 4"], cpu.data[31][9]) == (0, 1), "off until manual, after the loss of supply too"


@pytest.mark.parametrize("retained", [False, True])
def test_a_start_up_needs_nothing_of_what_a_battery_has_kept_but_what_was_chosen(retained):
    # all of DB31 but the setpoint, and of DB30 what OB251 remembers, hold rubbish; D 11.2 is as a loss of supply within FB30 left it
    words = replace(WORDS, ramp=Ramp(step=5, calls=2, hold=60))
    listing = controller_for(TARGET).export(words, Certificate(
        verdict="PASS", setpoint_degC=53.3, actuator=Actuator(pwm_period_s=4.0, resolution_s=0.4),
        switches={"start_up": "retained"} if retained else {}))["program_listing.txt"]
    runs = []
    for rubbish in (0, 0x5A5A, -1):
        cpu = Machine(listing, read=lambda _: 400 << 3)
        cpu.inputs.add("I 0.0")
        if rubbish:
            kept = cpu.data[31][9]
            cpu.data[31][1:] = [rubbish] * len(cpu.data[31][1:])
            cpu.data[31][9] = kept if retained else rubbish
            cpu.data[30][18:49] = cpu.data[30][18:49] if retained else [rubbish] * 31
            cpu.data[30][11] |= 4
        cpu.call("OB 22")
        seen = []
        for _ in range(60):
            cpu.call("OB 13")
            seen.append((cpu.written["PY 4"], cpu.data[30][9], cpu.data[30][48]))
        runs.append(seen)
    assert runs[1:] == runs[:1] * 2
    assert len(set(runs[0])) > 4


WORDS = chain.encode(PidDesign(gain_pct_per_degC=3.0, integral_time_s=300.0, derivative_time_s=0.0, sample_time_s=4.0,
                               structure="pi", method=""), TARGET)


def _listing(actuator, words=WORDS):
    return controller_for(TARGET).export(words, Certificate(verdict="PASS", setpoint_degC=53.3, actuator=actuator))["program_listing.txt"]


class Fixed:
    """Stands in for OB251: YA is what the test wants."""

    ya = 0

    def __call__(self, dw):
        dw[48] = self.ya


@pytest.mark.parametrize(("actuator", "step"), [
    (Actuator(pwm_period_s=4.0, resolution_s=0.1), 1),
    (Actuator(pwm_period_s=2.0, resolution_s=0.05, minimum_on_s=0.3), 3),
    (Actuator(pwm_period_s=4.0, resolution_s=0.02, minimum_on_s=0.11, minimum_off_s=0.5), 31),
    (Actuator(pwm_period_s=2.3, resolution_s=0.1), 7),  # 2047 = 23·89: the remainder stays where it is
    (Actuator(pwm_period_s=0.1, resolution_s=0.1), 11),  # one tick: on or off
])
def test_the_staircase_makes_the_nearest_number_of_ticks_at_the_begin_of_a_period(actuator, step):
    fixed = Fixed()
    cpu = Machine(_listing(actuator), controller=fixed)
    cpu.inputs.add("I 0.0")
    n = round(actuator.pwm_period_s / actuator.resolution_s)
    for fixed.ya in [*range(0, 2048, step), 2047]:
        cpu.call("OB 22")  # both begin with the first call of OB13
        made = [cpu.call("OB 13") or cpu.written["PY 4"] for _ in range(n)]
        nearest = math.floor(Fraction(fixed.ya * n, 2047) + Fraction(1, 2))
        on_s, _ = on_time(100.0 * fixed.ya / 2047, 0.0, actuator.numbers)
        assert made == [1] * sum(made) + [0] * (n - sum(made))
        assert sum(made) == round(on_s / actuator.resolution_s)
        wanted = fixed.ya / 2047 * actuator.pwm_period_s
        if min(wanted, nearest * actuator.resolution_s) >= actuator.minimum_on_s and (
                max(wanted, nearest * actuator.resolution_s) <= actuator.pwm_period_s - actuator.minimum_off_s):
            assert sum(made) == nearest


def _running(raw, words=WORDS, actuator=None):
    """A machine after its start-up whose analog input gives `raw[0]`, ten calls of OB13 to one of OB251."""
    cpu = Machine(_listing(actuator or Actuator(pwm_period_s=4.0, resolution_s=0.4), words), read=lambda _: raw[0])
    cpu.call("OB 21")
    return cpu


def _calls(cpu, count):
    for _ in range(10 * count):
        cpu.call("OB 13")


@pytest.mark.parametrize(("raw", "x"), [
    (0, 0), (7, 0), (8, 1), (1091 << 3, 1091), (1091 << 3 | 5, 1091),  # activity and overflow bits are no part of the value
    (2047 << 3, 2047), (2048 << 3, 2047), (4095 << 3, 2047),  # beyond the range's end
    (0xFFF8, 0), (0xC000, 0),  # negative: two's complement
])
def test_x_is_the_input_cut_and_limited_to_0_to_2047(raw, x):
    cpu = _running([raw])
    _calls(cpu, 1)
    assert cpu.data[30][22] == x


def test_a_wire_that_breaks_switches_off_at_once_and_until_somebody_asks_for_manual():
    raw = [400 << 3]
    cpu = _running(raw)
    cpu.inputs.add("I 0.0")
    _calls(cpu, 1)
    cpu.call("OB 13")
    assert (cpu.written["PY 4"], cpu.data[30][48] > 0) == (1, True)
    raw[0] |= 2  # bit 1
    cpu.call("OB 13")
    assert cpu.written["PY 4"] == 0, "in this very call of OB13"
    _calls(cpu, 3)
    raw[0] &= ~2
    _calls(cpu, 3)
    assert (cpu.written["PY 4"], cpu.data[31][4]) == (0, 0), "the sensor is back, automatic still asked for"
    assert cpu.data[30][18:49] == [0] * 31, "OB251 has forgotten"
    cpu.inputs.clear()
    _calls(cpu, 5)
    assert cpu.data[30][48] == 200, "manual: YH"
    cpu.inputs.add("I 0.0")
    _calls(cpu, 1)
    assert (cpu.data[30][9], cpu.data[30][48] > 200) == (1091, True)


@pytest.mark.parametrize("ramp", [None, Ramp(step=5, calls=2)])
def test_w_follows_x_in_manual_and_goes_from_there_in_automatic(ramp):
    raw, words = [400 << 3], replace(WORDS, ramp=ramp)
    cpu = _running(raw, words)
    followed = []
    for x in (400, 450, 430, 440, 440):
        raw[0] = x << 3
        _calls(cpu, 1)
        followed.append((cpu.data[30][9], cpu.data[30][22], cpu.data[30][11] & 1, cpu.data[30][48]))
    assert followed == [(400, 400, 0, 100), (450, 450, 0, 150), (430, 430, 0, 175), (440, 440, 0, 200), (440, 440, 0, 200)]
    cpu.inputs.add("I 0.0")
    led = []
    for _ in range(4):
        _calls(cpu, 1)
        led.append(cpu.data[30][9])
    assert led == ([1091] * 4 if ramp is None else [440, 445, 445, 450])
    assert cpu.data[30][11] == 33
    cpu.inputs.clear()
    _calls(cpu, 1)
    assert cpu.data[30][9] == 440, "back in manual"


@pytest.mark.parametrize("actuator", [
    None, Actuator(pwm_period_s=4.0 / 3.0, resolution_s=0.01), Actuator(pwm_period_s=4.0, resolution_s=0.1, minimum_rule="carry"),
    Actuator(pwm_period_s=4.0, resolution_s=0.005), Actuator(pwm_period_s=400.0, resolution_s=0.01)])
def test_where_no_ticks_of_ob13_make_the_pulses_the_output_is_analog(actuator):
    # 2047 units are 16376 of the 16384 that are the end of the range in the S5 format (VIPA HB300, p. 438)
    listing, raw = _listing(actuator), [400 << 3]
    cpu = Machine(listing, read=lambda _: raw[0])
    cpu.inputs.add("I 0.0")
    cpu.call("OB 22")
    assert (cpu.written["RS 97"], cpu.written["PW 176"]) == (400, 0), "OB13 every 4 s"
    for _ in range(3):
        cpu.call("OB 13")
        assert cpu.written["PW 176"] == 8 * cpu.data[30][48] > 0
    raw[0] |= 2
    cpu.call("OB 13")
    assert cpu.written["PW 176"] == 0
    assert "PY 4" not in cpu.written
    assert "Power controller behind PW 176" in listing
    assert ("which calls of OB13 do not make" in listing) == (actuator is not None)


@pytest.mark.parametrize("ramp", [None, Ramp(step=5, calls=2, hold=9)])
def test_the_words_are_loaded_as_a_start_up_leaves_them(ramp):
    cpu = Machine(_listing(Actuator(pwm_period_s=4.0, resolution_s=0.4), replace(WORDS, ramp=ramp)))
    as_loaded = list(cpu.data[31])
    cpu.call("OB 22")
    assert cpu.data[31] == as_loaded


def test_a_start_up_clears_what_the_ram_has_kept():
    cpu = _running([1000 << 3])
    cpu.inputs.add("I 0.0")
    fresh = _running([1000 << 3])
    _calls(cpu, 7)
    cpu.call("OB 13")
    cpu.call("OB 22")
    assert cpu.data[30][18:49] == [0] * 31
    changed = {number: word for number, word in enumerate(cpu.data[31]) if word != fresh.data[31][number]}
    assert set(changed) <= {1, 2, 3}, "X, W and the input, which the first call reads"
    assert cpu.written["PY 4"] == 0


def test_the_head_tells_under_which_conditions_the_proof_holds_and_what_is_left_to_do():
    actuator = Actuator(pwm_period_s=2.0, resolution_s=0.02)
    told = Certificate(verdict="PASS", lines=("proven at 53.3 °C in 3 runs",), setpoint_degC=53.3, actuator=actuator,
                       specification="general", digest="sha256:abc")
    head = controller_for(TARGET).export(WORDS, told)["program_listing.txt"].partition("\n\n")[0].splitlines()
    for part in ("sensor 0...100 °C = 0...2047 units", "OB13 every 0.02 s", "in every 200th call: TA = 4 s", "100 calls of OB13 a period",
                 "PWM period 2 s in steps of 0.02 s", "proven setpoint: 53.3 °C", "specification: general", "sha256:abc"):
        assert any(part in line for line in head), part
    by_hand = head[head.index("// to do by hand:") + 1:]
    assert [line[3:].partition(". ")[0] for line in by_hand] == [str(number) for number in range(1, len(by_hand) + 1)]
    assert any("up to 10 % of a CPU 941's time" in line for line in by_hand)
