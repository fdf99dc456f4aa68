"""The exported ramp programs, run: each moves the setpoint as the proof did.

Which machine runs them: S5, a small one written for this test from the list of operations; S7-300, awlsim; WEG, structured
text by tree-sitter; S7-200, the room's own machine on the exported text, against the room that is told the setpoint.
"""

import random
import struct
from dataclasses import replace

import numpy as np
import pytest
from tests.golden.s5_machine import Machine
from tests.golden.test_fb41 import _stub
from tests.plc.st_machine import Program
from tests.witness.setpoint_course import course

from heatertune.pid.design_values import PidDesign
from heatertune.plc import Certificate, Ramp, Scaling, controller_for
from heatertune.plc.cpu.s7_200 import assemble
from heatertune.plc.fb41.step import scale_reading

PASS = Certificate(verdict="PASS")
#: where the setpoint asked for goes in a run: (calls, share of the range); up, down, up before it has arrived, and to rest
JOURNEY = ((40, 0.5), (60, 0.3), (7, 0.6), (50, 0.31), (20, 0.31))


def _words(target, ramp, scaling=None):
    design = PidDesign(gain_pct_per_degC=3.0, integral_time_s=300.0, derivative_time_s=0.0, sample_time_s=4.0,
                       structure="pi", method="")
    return replace(controller_for(target).encode(design, scaling or Scaling()), ramp=ramp)


def _export(words, name):
    return controller_for(words.target).export(words, PASS)[name]


def _asked(full):
    return [round(share * full) for calls, share in JOURNEY for _ in range(calls)]


def _followed(ramp, begin, asked, readings=()):
    """The setpoint at each call by a loop of the test's own: after every `calls`-th call a step, as the export's head says.

    With a holdback: a step down ends at the reading less the holdback and is none from below it; and never is the setpoint
    above the reading and the holdback. Of a cooler, whose holdback is below zero, all that is turned upside down.
    """
    if ramp.cools:
        turned = _followed(replace(ramp, hold=-ramp.hold), -begin, [-end for end in asked], [-one for one in readings])
        return [-word for word in turned]
    word, found = begin, []
    for call, end in enumerate(asked, start=1):
        way = end - word
        if ramp.hold is not None and way < 0:
            way = min(0, max(way, readings[call - 1] - ramp.hold - word))
        if call % ramp.calls == 0:
            word += max(-ramp.step, min(ramp.step, way))
        if ramp.hold is not None:
            word = min(word, readings[call - 1] + ramp.hold)
        found.append(word)
    return found


def _wandering(full, low=0, seed=3):
    """Readings that follow the setpoint asked for, late, with a fall and a rise on the way, and now and then jump anywhere."""
    rng, reading, course = random.Random(seed), 0.25 * full, []
    for call, end in enumerate(_asked(full)):
        reading += 0.08 * (end * (0.4 if 20 < call < 30 or 150 < call < 160 else 1.1) - reading)
        jumps = rng.random() < 0.05
        course.append(rng.randint(low, full) if jumps else round(reading + 0.01 * full * rng.random()))
    return course


def test_the_loop_of_this_test_is_the_row_of_the_proof():
    ramp = Ramp(step=20, calls=2)
    assert _followed(ramp, 491, [552] * 8) == course(ramp, [491] * 8, 552) == [491, 511, 511, 531, 531, 551, 551, 552]


def _led(ramp, asked, readings):
    """W at each call of FB33, which the listing calls where W follows a ramp, from the first reading on."""
    cpu = Machine(_export(_words("s5-ob251", ramp), "program_listing.txt"))
    work, cpu.open, found = cpu.data[31], 31, []
    work[2], work[11] = readings[0], ramp.calls
    for work[0], work[1] in zip(asked, readings, strict=True):
        cpu.call("FB 33")
        found.append(work[2])
    return found


@pytest.mark.parametrize("ramp", [
    Ramp(step=37, hold=60), Ramp(step=90, calls=3, hold=20), Ramp(step=37, hold=-60), Ramp(step=90, calls=3, hold=-20)])
def test_the_s5_listing_holds_w_at_the_reading(ramp):
    asked, readings = _asked(2047), _wandering(2047, low=-2047)
    found = _led(ramp, asked, readings)
    assert found == _followed(ramp, readings[0], asked, readings)
    assert found != _followed(replace(ramp, hold=None), readings[0], asked)


@pytest.mark.parametrize("ramp", [
    Ramp(step=300, hold=700), Ramp(step=1001, calls=3, hold=250), Ramp(step=300, hold=-700),
    Ramp(step=1001, calls=3, hold=-250)])
def test_the_s7_300_source_holds_sp_at_the_reading_in_awlsim(awlsim, ramp):
    asked, readings = _asked(27648), _wandering(27648, low=-32768)
    readings[50:53] = [32767, 32767, -32768]  # a wire breaks: over-range, then below the range; the ramp begins anew
    rows = [[1, end, reading, None] for end, reading in zip(asked, readings, strict=True)]
    answer = awlsim(_export(_words("s7-300", ramp), "s7_300_pid.awl"), rows)
    at = answer["offsets"]["SP"][0]
    found = [struct.unpack_from(">h", bytes.fromhex(row), at)[0] for row in answer["rows"]]
    assert found[:50] == _followed(ramp, readings[0], asked[:50], readings)
    assert found[50:53] == [found[49]] * 3
    assert found[53:] == _followed(ramp, readings[53], asked[53:], readings[53:])


@pytest.mark.parametrize("hold", [250, -250])
def test_the_fb41_source_holds_sp_int_at_the_reading(awlsim, hold):
    ramp = Ramp(step=1001, calls=3, hold=hold)
    words, asked, readings = _words("fb41", ramp), _asked(27648), _wandering(27648)
    rows = [[1, end, reading, None] for end, reading in zip(asked, readings, strict=True)]
    answer = awlsim(_stub(_export(words, "fb41_cont_c.awl")), rows, block=41)
    at = answer["offsets"]["SP_INT"][0]
    parameters, _ = controller_for("fb41").start(words, {}).parameters
    assert [bytes.fromhex(row)[at:at + 4] for row in answer["rows"]] == [
        struct.pack(">f", scale_reading(parameters, word)[0]) for word in _followed(ramp, readings[0], asked, readings)]


@pytest.mark.parametrize("ramp", [Ramp(step=37), Ramp(step=90, calls=3)])
def test_the_s5_listing_moves_w(ramp):
    found = _led(ramp, _asked(2047), [491] * len(_asked(2047)))
    assert found == _followed(ramp, 491, _asked(2047))
    assert found[-1] == _asked(2047)[-1]


def test_the_s5_listing_is_totally_calm_at_the_ends_of_w():
    for begin, end in ((2047, -2047), (-2047, 2047), (2047, 2047), (-2047, -2047)):  # the machine refuses an overflow
        assert _led(Ramp(step=2046), [end], [begin]) == _followed(Ramp(step=2046), begin, [end])


@pytest.mark.parametrize("ramp", [Ramp(step=300), Ramp(step=1001, calls=3)])
def test_the_s7_300_source_moves_sp_in_awlsim(awlsim, ramp):
    rows = [[1, end, 13000 if call else 5000, None] for call, end in enumerate(_asked(27648))]
    answer = awlsim(_export(_words("s7-300", ramp), "s7_300_pid.awl"), rows)
    at = answer["offsets"]["SP"][0]
    found = [struct.unpack_from(">h", bytes.fromhex(row), at)[0] for row in answer["rows"]]
    assert found == _followed(ramp, 5000, _asked(27648))


def test_a_ramp_begins_at_the_reading_after_a_broken_sensor_and_after_manual(awlsim):
    rows = [[1, 20000, 32767, None]] * 3 + [[1, 20000, 13000, None]] * 4 + [[0, 20000, 9000, None]] * 2 + [[1, 20000, 9500, None]] * 3
    answer = awlsim(_export(_words("s7-300", Ramp(step=1001)), "s7_300_pid.awl"), rows, restart=32767)
    at = answer["offsets"]["SP"][0]
    found = [struct.unpack_from(">h", bytes.fromhex(row), at)[0] for row in answer["rows"]]
    assert found[3:7] == _followed(Ramp(step=1001), 13000, [20000] * 4)
    assert found[9:] == _followed(Ramp(step=1001), 9500, [20000] * 3)


@pytest.mark.parametrize("ramp", [Ramp(step=300), Ramp(step=1001, calls=3)])
def test_the_fb41_source_moves_sp_int_to_the_bits_of_the_room(awlsim, ramp):
    words = _words("fb41", ramp, Scaling(low_degC=-17.7, high_degC=250.3))
    rows = [[1, end, 13000 if call else 5000, None] for call, end in enumerate(_asked(27648))]
    answer = awlsim(_stub(_export(words, "fb41_cont_c.awl")), rows, block=41)
    at = answer["offsets"]["SP_INT"][0]
    found = [bytes.fromhex(row)[at:at + 4] for row in answer["rows"]]
    parameters, _ = controller_for("fb41").start(words, {}).parameters
    told = [struct.pack(">f", scale_reading(parameters, each)[0]) for each in _followed(ramp, 5000, _asked(27648))]
    assert found == told
    # 13824 of 27648 is the middle of the range: (250.3 − 17.7)/2
    assert struct.unpack(">f", found[39])[0] == pytest.approx(116.3, abs=1e-3)


def _weg_program(words, name):
    """The whole exported program, a scan each Ts; WEG's own block, which is in no text, does nothing."""
    program = Program(_export(words, name), {"FB_PID": Wegs})
    program.variables.ScanMs = words.whole["Ts"]
    return program


class Wegs:
    """The interface of WEG's block as its help's example in ST has it."""

    EN, Output = False, np.float32(0.0)

    def __call__(self, **inputs):
        self.inputs = inputs


@pytest.mark.parametrize("name", ["weg_pid_call.st", "weg_pid_block.st"])
@pytest.mark.parametrize("ramp", [Ramp(step=float(np.float32(0.7))), Ramp(step=float(np.float32(0.1)), calls=3)])
def test_the_structured_text_moves_the_setpoint_in_single_precision(name, ramp):
    program = _weg_program(_words("weg", ramp), name)
    program.call(HeaterOn=False, HeaterTemperature=99.0, HeaterSetPoint=40.0)
    begin = float(np.float32(24.3))
    found = [float(program.call(HeaterOn=True, HeaterTemperature=begin + k, HeaterSetPoint=40.0).HeaterRamp) for k in range(700)]
    assert found == course(ramp, [begin] * 700, 40.0)
    assert found[-1] == 40.0
    # switched off and on again it begins at the reading of that moment, and goes down as well
    program.call(HeaterOn=False, HeaterTemperature=47.0)
    down = [float(program.call(HeaterOn=True, HeaterTemperature=50.0).HeaterRamp) for _ in range(400)]
    assert down == course(ramp, [50.0] * 400, 40.0)


@pytest.mark.parametrize("name", ["weg_pid_call.st", "weg_pid_block.st"])
@pytest.mark.parametrize(("step", "calls", "hold"), [(0.7, 1, 2.1), (0.3, 3, 0.9)])
def test_the_structured_text_holds_the_setpoint_at_the_reading_in_single_precision(name, step, calls, hold):
    step, hold = np.float32(step), np.float32(hold)
    program = _weg_program(_words("weg", Ramp(step=float(step), calls=calls, hold=float(hold))), name)
    cooler = _weg_program(_words("weg", Ramp(step=float(step), calls=calls, hold=-float(hold))), name)
    for each in (program, cooler):
        each.call(HeaterOn=False)
    readings = np.array(_wandering(10000), dtype=np.float32) / np.float32(100.0)
    word, asked = readings[0], np.array(_asked(10000), dtype=np.float32) / np.float32(100.0)
    for call, (end, reading) in enumerate(zip(asked, readings, strict=True), start=1):
        if call % calls == 0 and word < end:
            word = min(word + step, end)
        elif call % calls == 0 and word > max(end, reading - hold):
            word = max(word - step, end, reading - hold)
        word = min(word, reading + hold)
        assert program.call(HeaterOn=True, HeaterTemperature=reading, HeaterSetPoint=end).HeaterRamp == word
        assert cooler.call(HeaterOn=True, HeaterTemperature=-reading, HeaterSetPoint=-end).HeaterRamp == -word


def test_a_sensor_that_breaks_on_the_way_leaves_the_held_ramp_where_it_is_asked_for():
    program = _weg_program(_words("weg", Ramp(step=0.5, hold=2.0)), "weg_pid_call.st")
    assert program.call(HeaterOn=True, HeaterTemperature=20.0, HeaterSetPoint=40.0).HeaterRamp == 20.5
    assert program.call(HeaterOn=True, HeaterTemperature=np.nan).HeaterRamp == 21.0
    assert program.call(HeaterOn=True, HeaterTemperature=10.0).HeaterRamp == 12.0


def test_a_broken_sensor_at_the_start_does_not_poison_the_structured_text():
    program = _weg_program(_words("weg", Ramp(step=0.5)), "weg_pid_call.st")
    assert program.call(HeaterOn=True, HeaterTemperature=np.nan, HeaterSetPoint=40.0).HeaterRamp == 40.0


def test_the_ramped_setpoint_is_wired_to_wegs_block():
    files = controller_for("weg").export(_words("weg", Ramp(step=0.5)), PASS)
    for content in files.values():
        assert "SetPoint := HeaterRamp," in content
        assert "SetPoint := HeaterSetPoint," not in content
        assert "HeaterWasOn" in content


def _loaded(running, text):
    """The controller with another program."""
    return running._replace(parameters=running.parameters._replace(program=assemble(text)))


@pytest.mark.parametrize("ramp", [Ramp(step=3), Ramp(step=7, calls=3), Ramp(step=7, calls=3, hold=5), Ramp(step=4, hold=9),
                                  Ramp(step=7, calls=3, hold=-5), Ramp(step=4, hold=-9)])
@pytest.mark.long
def test_the_s7_200_program_makes_the_setpoints_that_the_room_was_told(ramp):
    words, found = _words("s7-200", ramp), controller_for("s7-200")
    told = made = found.start(words, {})
    made = _loaded(made, _export(words, "s7_200_program.awl"))
    asked = _asked(255)
    readings = _readings(61, 255) if ramp.hold is None else _wandering(255)
    widths = set()
    for reading, end, setpoint in zip(readings, asked, _followed(ramp, readings[0], asked, readings), strict=True):
        told, one = found.step(told, setpoint, reading)
        made, other = found.step(made, end, reading)
        assert one == other
        assert made.state.read("VW34") == setpoint
        widths.add(one.output)
    assert len(widths) > 20


@pytest.mark.parametrize("ramp", [Ramp(step=400), Ramp(step=900, calls=3), Ramp(step=900, calls=3, hold=640),
                                  Ramp(step=900, calls=3, hold=-640)])
def test_the_program_around_the_pid_instruction_makes_the_setpoints_that_the_room_was_told(ramp):
    words, found = _words("s7-200-pid", ramp), controller_for("s7-200-pid")
    told = made = found.start(words, {})
    made = _loaded(made, _export(words, "s7_200_pid.awl"))
    asked = _asked(32000)
    readings = _readings(7600, 32000) if ramp.hold is None else _wandering(32000)
    widths = set()
    for reading, end, setpoint in zip(readings, asked, _followed(ramp, readings[0], asked, readings), strict=True):
        told, one = found.step(told, setpoint, reading)
        # the panel writes the setpoint asked for to VW80; what `step` writes to VD104 is overwritten by the ramp
        made = made._replace(state=made.state.written({"VW80": end, "AIW0": reading}))
        made, other = found.step(made, 0, reading)
        assert one == other
        assert made.state.read("VW82") == setpoint
        widths.add(one.output)
    assert len(widths) > 20


def _readings(begin, full):
    """Readings that wander a little below the middle, as the closed loop's would."""
    rng, count = random.Random(3), sum(calls for calls, _ in JOURNEY)
    return [begin, *(round(full * (0.33 + 0.06 * rng.random())) for _ in range(count - 1))]


@pytest.mark.parametrize("target", ["s5-ob251", "s7-200", "s7-200-pid", "s7-300", "fb41", "weg"])
def test_without_a_ramp_nothing_of_it_is_exported(target):
    words = _words(target, None)
    whole = isinstance(controller_for(target).measure(words, 50.0), int)
    ramped = controller_for(target).export(replace(words, ramp=Ramp(step=2 if whole else 0.5, calls=2)), PASS)
    plain = controller_for(target).export(words, PASS)
    assert set(plain) <= set(ramped)
    told = [name for name in ramped if plain.get(name) != ramped[name]]
    assert told, "the ramp is in the export"
    assert not any("ramp" in str(content).lower() for content in plain.values())
