"""Words of running controllers as people paste them: right at once, or a question whose answer works; never other numbers."""

import json
import random
import re
import struct

import pytest

from heatertune.cli import main
from heatertune.errors import HeatertuneError
from heatertune.pid.design_values import PidDesign
from heatertune.plc import TARGETS, Certificate, Scaling, controller_for
from heatertune.plc.dump_reader import read_machine, realised_design
from tests.bench.pasted_words import ASKED, CASES, MAKERS, RIGHT, decoded, is_right, judge, lines_left_out
from tests.plc.test_readback import TEXTS

NAMES = [f"{case.target}: {case.name}" for case in CASES]
WHOLE = [case for case in CASES if case.answer is None]
#: full power, gains, direction and heaters that no reading may take for something else: target, text, part of what is said
REFUSED = [
    ("arduino-pid", "PID p(&i, &o, &s, 2, 5, 1, REVERSE);", "REVERSE"),
    ("arduino-pid", "PID p(&i, &o, &s, 2, 5, 1, DIRECT);\np.SetControllerDirection(REVERSE);", "line 2, direction"),
    ("arduino-pid", "PID p(&i, &o, &s, 2, 5, 1, DIRECT);\np.SetOutputLimits(0, 2", "line 2, SetOutputLimits"),
    ("arduino-pid", "PID p(&i, &o, &s, 2, 5", "no constructor"),
    ("arduino-pid", "PID p(&i, &o, &s, 2, 5, 1, DIRECT);\nvoid setup() { if (saved) p.SetTunings(4, 2, 1); }", "in force"),
    ("arduino-pid", "PID p(&i, &o, &s, 2, 5, 1, DIRECT);\np.SetTuning(4, 2, 1);", "a function of PID_v1"),
    ("arduino-pid", "PID p(&i, &o, &s, 2, 5, 1, DIRECT);\np.SetOutputLimits(0, 20\n0);", "the line before"),
    ("arduino-pid", "PID p(&i, &o, &s, 2,5, 5, 1, DIRECT);", "P_ON_E"),
    ("arduino-pid", "PID p(&i, &o, &s, -2, 5, 1, DIRECT);", "Kp"),
    ("arduino-pid", "PID p(&i, &o, &s, 2, 5, 1, DIRECT);\np.SetOutputLimits(-255, 255);", "no power below 0"),
    ("arduino-pid", "PID p(&i, &o, &s, 1e39, 5, 1, DIRECT);", "Kp"),
    ("simple-pid", "PID(-1, 0.1, 0, output_limits=(0, 100), sample_time=1)", "Kp"),
    ("simple-pid", "PID(1, 0.1, 0, output_limits=(-100, 100), sample_time=1)", "output_limits"),
    ("simple-pid", "PID(1, 0.1, 0, output_limits=(0, 27648), sample_time=1)", "FULL = 27648"),
    ("simple-pid", "pid = PID(1, 0.1, 0, sample_time=1)\npid.output_limits = (0, 2", "line 2"),
    ("simple-pid", "a = PID(1, 0.1, 0)\nb = PID(2, 0.1, 0)", "2 calls of PID"),
    ("marlin", "M301 P22.20 I1.08", "Kd"), ("marlin", "M301 P-22.20 I1.08 D114", "Kp"), ("marlin", "M301 P1e12 I1 D1", "M301"),
    ("marlin", "Recv: T:21.3 /0.0 @:0", "no gain of Marlin's"), ("marlin", "M301 P22.2 I1.08 D114\nM301 P20 I1.08 D114", "line 2"),
    ("pid-compact", "Gain = 2.5\nTi = 20 furlongs", "its unit"), ("pid-compact", "Gain = 2.5, 3.5\nTi = 20 s", "one number"),
    ("pid-compact", "Gain = 2.5\nTi = 20 s\nTi = 30 s", "line 3"), ("pid-compact", "Gain = -2.5\nTi = 20 s", "Gain"),
    ("pid-compact", "Gain = 2.5\nTi = 1e6 s", "100000"), ("pid-compact", "Gain = 2.5\nTi = 20 s\nDeadZone = 0.5", "no dead zone"),
    ("pid-compact", "Gain = 2.5 s\nTi = 20", "no other unit"), ("pid-compact", "Gain = 2.5\nTi = 20 or 30", "one number"),
    ("pid-temp", "Gain = 2.5, Ti = 20\nActivateCooling = TRUE", "pid-temp-cooling"),
    ("pid-compact", "Retain.CtrlParams.Gain := 2.5;\nRetain.CtrlParams.Ti := 20.0;\ntain.CtrlParms.Td := 9.0;", "line 3"),
    ("s7-200-pid", "Gain 2\nSample time 60 s\nIntegral time 10\nDerivative time 0", "TA"),
    ("s7-200-pid", "Gain 2\nSample time 1 s\nIntegral time 0\nDerivative time 0", "TI"),
    ("s7-200-pid", "Gain 2\nSample time 1 s\nIntegral time 10", "Derivative time = 0 min"),
    ("fb41", "GAIN = MD100\nTI = T#20s", "GAIN"), ("fb41", "GAIN = 2.0\nTI = T#20s\nLMN_HLM = 100, 0", "one number"),
    ("fb41", "GAIN = 2.0\nTI = 9999 h", "TI"), ("fb41", "CtrlParams.Gain = 2.0\nTI = T#20s", "CONT_C"),
]


def test_there_are_enough_texts_of_each_kind():
    assert len(CASES) > 70
    assert {case.target for case in CASES} == {*MAKERS}
    assert len(WHOLE) >= 45


@pytest.mark.parametrize("case", CASES, ids=NAMES)
def test_a_text_that_says_all_is_right_at_once_and_another_is_a_question_with_an_answer(case):
    found, said = judge(case)
    assert found == (RIGHT if case.answer is None else ASKED), said


def test_the_bench_sees_other_numbers():
    assert judge(WHOLE[0]._replace(gain=1.01 * WHOLE[0].gain))[0] not in (RIGHT, ASKED)
    assert judge(CASES[-1]._replace(gain=1.0, answer=CASES[-1].answer))[0] not in (RIGHT, ASKED)
    assert judge(CASES[-1]._replace(answer=None))[0] not in (RIGHT, ASKED)


@pytest.mark.parametrize(("target", "text", "said"), REFUSED)
def test_what_cannot_be_right_is_a_clear_error(target, text, said):
    (case,) = [case for case in CASES if case.target == target][:1]
    with pytest.raises(HeatertuneError) as refused:
        decoded(case._replace(text=text, called_every=1.0 if target == "fb41" else None))
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("case", WHOLE, ids=[f"{case.target}: {case.name}" for case in WHOLE])
def test_a_line_that_is_lost_is_an_error_or_is_named_among_what_is_assumed(case):
    """A line that overrides another may be lost without a trace: then the text is another sketch, and says all."""
    overrides = ("SetTunings", "SetSampleTime", "SetOutputLimits", "analogWrite", "tunings", "WindowSize", "sleep")
    before, _ = decoded(case)
    for number, text in enumerate(lines_left_out(case)):
        try:
            machine, design = decoded(case, text)
        except HeatertuneError:
            continue
        lost = case.text.splitlines()[number]
        if not is_right(case, machine, design) and not any(name in lost for name in overrides):
            assert set(machine.assumed) - set(before.assumed), lost


@pytest.mark.parametrize("target", TARGETS)
def test_an_export_is_read_as_the_same_words_and_leaves_nothing_to_assume(target):
    controller = controller_for(target)
    ta = controller.timer.round(5.0)
    design = PidDesign(gain_pct_per_degC=2.0, integral_time_s=200.0, derivative_time_s=0.0, sample_time_s=ta, structure="pi", method="")
    words = controller.encode(design, Scaling())
    for name in TEXTS[target]:
        content = controller.export(words, Certificate(verdict="PASS"))[name]
        machine = read_machine(controller, content.encode() if isinstance(content, str) else content,
                               sample_time_s=words.sample_time_s, scaling=Scaling(), source=name)
        assert (machine.words, machine.assumed) == (words, ()), name


#: what a message says to add to the text
LINES = (r"a line such as (.+?;) with", r"add a line (.+?) with the output", r"such as (pid\..+?\)):", r"a line (\w+ := TRUE) or", r"such as: (.+)$")
ADDED = [case for case in CASES if case.answer is not None and any(re.search(line, judge(case)[1]) for line in LINES)]


def test_what_a_message_says_to_add_is_read_when_it_is_added():
    assert len(ADDED) >= 6
    for case in ADDED:
        message = judge(case)[1]
        (line,) = (found[1] for found in (re.search(line, message) for line in LINES) if found)
        machine, _ = decoded(case, case.text + "\n" + line.replace(" and ", "\n") + "\n")
        assert machine.words.values, message


def test_the_unit_that_a_message_says_for_pv_in_gives_the_gain_of_that_unit():
    """PV_IN of 0…1 for 0…100 °C: 2.5 % per °C is a GAIN of 250 % per unit, whose PV_FAC is 0.01 per percent."""
    case = next(case for case in CASES if case.name == "a call that reads PV_IN")
    machine, _ = decoded(case)
    controller = controller_for("fb41")
    (odd,) = (each for each in controller.oddities(machine.words) if "PV_IN" in each)
    assert "PVPER_ON := TRUE, PV_FAC := its units per percent of --range" in odd
    text = case.text.replace("PVPER_ON:=FALSE", "PVPER_ON:=TRUE").replace("2.500000e+000", "250.0") + " PV_FAC := 0.01\n"
    assert is_right(case, *decoded(case, text))
    assert "PV_IN, SP_INT and DEADB_W are in °C" in machine.assumed


def test_a_data_block_of_cont_c_with_pv_in_is_read_from_bytes_and_from_its_source():
    controller = controller_for("fb41")
    design = PidDesign(gain_pct_per_degC=2.0, integral_time_s=200.0, derivative_time_s=0.0, sample_time_s=5.0, structure="pi", method="")
    words = controller.encode(design, Scaling(high_degC=150.0))
    source = controller.export(words, Certificate(verdict="PASS"))["fb41_cont_c.awl"].replace("PVPER_ON := TRUE", "PVPER_ON := FALSE")
    for content, name in ((source.encode(), "db.awl"), (_image(words), "db.bin")):
        machine = read_machine(controller, content, sample_time_s=5.0, scaling=Scaling(high_degC=150.0), source=name)
        assert machine.words.values["PVPER_ON"] == 0
        assert machine.assumed == ("PV_IN, SP_INT and DEADB_W are in °C",)
        assert machine.words.controller() is not None
        # GAIN is in % per °C whatever PV_FAC says
        wanted = machine.words.values["GAIN"] * (200.0 / 202.5)
        assert realised_design(controller, machine.words).gain_pct_per_degC == pytest.approx(wanted, rel=1e-6)


def _image(words):
    """Return the instance data block's first 72 bytes with PVPER_ON FALSE, by the offsets of its types."""
    values, image = words.values, bytearray(72)
    for bit, name in enumerate(("MAN_ON", "PVPER_ON", "P_SEL", "I_SEL", "INT_HOLD", "I_ITL_ON", "D_SEL"), start=1):
        image[0] |= (0 if name == "PVPER_ON" else values[name]) << bit
    for place, name in {2: "CYCLE", 24: "TI", 28: "TD", 32: "TM_LAG"}.items():
        struct.pack_into(">i", image, place, values[name])
    for place, name in {16: "MAN", 20: "GAIN", 36: "DEADB_W", 40: "LMN_HLM", 44: "LMN_LLM", 48: "PV_FAC", 52: "PV_OFF", 56: "LMN_FAC",
                        60: "LMN_OFF", 64: "I_ITLVAL", 68: "DISV"}.items():
        struct.pack_into(">f", image, place, values[name])
    return bytes(image)


def _damaged(chance, text):
    for _ in range(chance.randint(1, 4)):
        at = chance.randrange(len(text) + 1)
        length = chance.choice([0, 1, 1, 2, 5, 40])
        junk = chance.choice(["", "\x00", "9" * 400, "((", "))", "'", '"', ",", "#", "\n", "T#", "-", "1e999", "é€", "PID(", "#*#", "{", text[at : at + 60]])
        text = text[:at] + junk + text[at + length :]
    return text[: chance.randrange(len(text) + 1)] if chance.random() < 0.2 else text


def _thrown(count, seed):
    """Throw damaged texts at their readers; anything but a number or a plain error is a fault."""
    chance, read, said = random.Random(seed), 0, []
    for number in range(count):
        case = CASES[number % len(CASES)]
        try:
            machine, _ = decoded(case, _damaged(chance, case.text), chance.choice([None, 1.0]), None)
        except HeatertuneError as problem:
            said.append(str(problem))
            continue
        assert all(value == value for value in machine.words.values.values())  # noqa: PLR0124 - no NaN is a word
        read += 1
    assert not any("\n" in message for message in said)
    return read


def test_damaged_texts_are_read_or_refused_in_one_line():
    assert 0 < _thrown(400, 7) < 400


@pytest.mark.long
def test_thousands_of_damaged_texts_are_read_or_refused_in_one_line():
    assert 0 < _thrown(12000, 11) < 12000


def test_the_command_says_what_it_assumed_and_names_it_as_the_condition_of_its_verdict(tmp_path, capsys):
    paste = tmp_path / "m503.txt"
    paste.write_text("Recv: echo:  M301 P22.20 I1.08 D114.00\n")
    heater = ["--range", "0", "300", "--setpoint", "210", "--gain", "4", "--time-constant", "150", "--dead-time", "1.5", "--ambient", "25"]
    words = ["decode", str(paste), "--target", "marlin", "--quiet", *heater]
    main(words)
    out = capsys.readouterr().out
    assumed = "PID_MAX = 255, PID_FUNCTIONAL_RANGE = 10, PID_K1 = 0.95, ADC_LOOPS = 10"
    assert f"assumed, as the text does not say: {assumed}" in out
    assert f"on condition that {assumed}" in next(line for line in out.splitlines() if line.startswith("VERDICT"))
    main([*words, "--json"])
    document = json.loads(capsys.readouterr().out)
    assert ", ".join(document["assumed"]) == assumed
    assert f"on condition that {assumed}" in document["proof"]["remarks"]
