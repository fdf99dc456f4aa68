"""Words of running controllers as people paste them: right at once, or a question whose answer works; never other numbers."""

import json
import random

import pytest

from heatertune.cli import main
from heatertune.errors import HeatertuneError
from tests.bench.pasted_words import ASKED, CASES, MAKERS, RIGHT, decoded, is_right, judge, lines_left_out

NAMES = [f"{case.target}: {case.name}" for case in CASES]
WHOLE = [case for case in CASES if case.answer is None]
#: full power, gains, direction and heaters that no reading may take for something else: target, text, part of what is said
REFUSED = [
    ("arduino-pid", "PID p(&i, &o, &s, 2, 5, 1, REVERSE);", "REVERSE"),
    ("arduino-pid", "PID p(&i, &o, &s, 2, 5, 1, DIRECT);\np.SetControllerDirection(REVERSE);", "line 2, direction"),
    ("arduino-pid", "PID p(&i, &o, &s, 2, 5, 1, DIRECT);\np.SetOutputLimits(0, 2", "line 2, SetOutputLimits"),
    ("arduino-pid", "PID p(&i, &o, &s, 2, 5", "no constructor"),
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


@pytest.mark.long(60)
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
