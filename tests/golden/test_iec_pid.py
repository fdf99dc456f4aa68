"""The PID of IEC 61131-3, repaired and as printed: both steps beside their text in the machine for structured text, which rounds by
NumPy, in exact fractions where nothing is at a limit, and against sums worked out by hand."""

import math
from fractions import Fraction

import numpy as np
import pytest
from tests.plc.st_machine import FunctionBlock
from tests.witness.iec_pid import Pid as PrintedWitness
from tests.witness.iec_pid import RepairedPid as RepairedWitness

from heatertune.errors import NotRepresentable, OutOfRange
from heatertune.pid.design_values import PidDesign, structure_of
from heatertune.plc import Certificate, Scaling, Words, controller_for
from heatertune.plc.cpu.iec.machine import TextProgram
from heatertune.plc.cpu.iec.st_syntax import units
from heatertune.plc.iec_pid import step as repaired
from heatertune.plc.iec_pid.export import SOURCE
from heatertune.plc.iec_pid_text import controller as printed
from heatertune.plc.replay import replay
from heatertune.plc.single_precision import single, to_single
from heatertune.plc.st.program_text import MILLISECONDS, NANOSECONDS, SECONDS, TENS_OF_MS, function_block, time_to_real

ROOM, PRINTED = controller_for("iec-pid"), controller_for("iec-pid-text")
#: TIME_TO_REAL in NumPy's singles, by unit
GIVES = {SECONDS: lambda ms: np.float32(ms // 1000 + np.float64(ms % 1000 * 1000000) / 1e9), MILLISECONDS: np.float32,
         TENS_OF_MS: lambda ms: np.float32(ms // 10), NANOSECONDS: lambda ms: np.float32(ms * 10**6)}
ODD = [0.0, -0.0, 1e-45, 3.4028234663852886e38, -3.4028234663852886e38, math.inf, -math.inf, math.nan]

# the standard's block in words of this test alone (its text is matiec's): what its three blocks do to one another's variables
STANDARD = """
FUNCTION_BLOCK Printed
VAR_INPUT
  AUTO : BOOL; PV : REAL; SP : REAL; X0 : REAL; KP : REAL; TR : REAL; TD : REAL; CYCLE : TIME;
END_VAR
VAR_OUTPUT
  XOUT : REAL;
END_VAR
VAR
  Away : REAL; Total : REAL; Slope : REAL; A : REAL; B : REAL; C : REAL;
END_VAR
Away := PV - SP;
IF AUTO THEN
  Total := Total + Away * TIME_TO_REAL(CYCLE);
  Slope := (3.0 * (Away - C) + A - B) / (10.0 * TIME_TO_REAL(CYCLE));
  C := B;
  B := A;
ELSE
  Total := TR * (X0 - Away);
  Slope := 0.0;
  C := Away;
  B := Away;
END_IF;
A := Away;
XOUT := KP * (Away + Total / TR + Slope * TD);
END_FUNCTION_BLOCK
"""


def _words(target="iec-pid", **changed):
    plain = {"KP": 2.0, "TR": 0.0, "TD": 0.0, "CYCLE": 1000} | ({"XMIN": 0.0, "XMAX": 100.0} if target == "iec-pid" else {}) | changed
    values = {name: single(value) if isinstance(value, float) else value for name, value in plain.items()}
    return Words(target=target, values=values, scaling=Scaling(), sample_time_s=plain["CYCLE"] / 1000)


def _run(words, rows, switches=None):
    names = ("SP", "PV", "X0", "AUTO", "RUN") if words.target == "iec-pid" else ("SP", "PV", "X0", "AUTO")
    rows = [dict(zip(names, row, strict=False)) for row in rows]
    return [scan.output for scan in replay(controller_for(words.target), words, rows, switches)]


def _real(chance, odd=0.02, scale=100.0):
    if chance.random() < odd:
        return float(np.float32(chance.choice(ODD)))
    return float(np.float32(chance.normal(0.0, scale)))


def _gains(chance):
    """KP, TR and TD over all sizes, none, or extreme ones."""
    sizes = [float(np.float32(10.0 ** chance.uniform(-3.0, 4.0) * (chance.random() > 0.2))) for _ in range(3)]
    if chance.random() < 0.1:
        sizes[chance.integers(3)] = float(np.float32(10.0 ** chance.uniform(-44.0, 38.0)))
    return sizes[0] * chance.choice([-1.0, 1.0]), sizes[1], sizes[2]


def _same(one, other):
    """The same bits, or both no number."""
    return (math.isnan(one) and math.isnan(other)) or (one == other and math.copysign(1.0, one) == math.copysign(1.0, other))


def _repaired_beside_text(chance, scans):
    """Run random words over random inputs in step and text; return how many outputs or memories differ."""
    kp, tr, td = _gains(chance)
    ends = sorted(float(np.float32(each)) for each in chance.uniform(0.0, 100.0, 2)) if chance.random() < 0.5 else [0.0, 100.0]
    unit, ms = int(chance.integers(4)), int(chance.integers(10, 60001))
    values = {"KP": kp, "TR": tr, "TD": td, "XMIN": ends[0], "XMAX": ends[1], "CYCLE": ms}
    block, state = repaired.block_of(values, repaired.IecPidAssumptions(unit)), repaired.COLD
    text, level, differ = FunctionBlock(function_block(SOURCE), time_to_real=GIVES[unit]), _real(chance, 0.0), 0
    auto = run = True
    for _ in range(scans):
        auto, run = auto != (chance.random() < 0.05), run != (chance.random() < 0.03)
        given = repaired.IecPidInputs(sp=level, pv=_real(chance, scale=10.0 ** chance.uniform(-2, 3)), x0=_real(chance), auto=auto, run=run)
        state = repaired.call(block, state, given)
        v = text.call(SP=given.sp, PV=given.pv, X0=given.x0, AUTO=auto, RUN=run, **values)
        theirs = (v.XOUT, v.IntegralPart, v.Error1, v.Error2, v.Error3)
        differ += not all(map(_same, (state.output, state.integral, state.e1, state.e2, state.e3), map(float, theirs)))
    return differ


def _printed_beside_text(chance, scans):
    kp, tr, td = _gains(chance)
    unit, ms = int(chance.integers(4)), int(chance.integers(1, 60001))
    values = {"KP": kp, "TR": tr, "TD": td, "CYCLE": ms}
    block, state = printed.block_of(values, printed.StandardPidAssumptions(unit)), printed.COLD
    text, auto, differ = FunctionBlock(STANDARD.replace("; ", ";\n"), time_to_real=GIVES[unit]), True, 0
    for _ in range(scans):
        auto = auto != (chance.random() < 0.05)
        sp, pv, x0 = (_real(chance, 0.002) for _ in range(3))
        state, output = printed.call(block, state, single(pv - sp), x0, auto)
        v = text.call(SP=sp, PV=pv, X0=x0, AUTO=auto, **values)
        differ += not all(map(_same, (output, *state), map(float, (v.XOUT, v.Total, v.A, v.B, v.C))))
    return differ


@pytest.mark.long
@pytest.mark.parametrize("beside", [_repaired_beside_text, _printed_beside_text], ids=["repaired", "printed"])
def test_no_bit_differs_between_the_step_and_the_text(beside):  # run once for a million scans each: 0 differ
    chance = np.random.default_rng(61131)
    assert sum(beside(chance, 60) for _ in range(200)) == 0


def _printed_beside_witness(chance, scans):
    kp, tr, td = _gains(chance)
    ms, milliseconds = int(chance.integers(1, 60001)), bool(chance.integers(2))
    values = {"KP": kp, "TR": tr, "TD": td, "CYCLE": ms}
    block, state = printed.block_of(values, printed.StandardPidAssumptions(MILLISECONDS if milliseconds else SECONDS)), printed.COLD
    witness, auto, differ = PrintedWitness(kp, tr, td, ms, milliseconds), True, 0
    for _ in range(scans):
        auto = auto != (chance.random() < 0.05)
        sp, pv, x0 = (_real(chance, 0.002) for _ in range(3))
        state, output = printed.call(block, state, single(pv - sp), x0, auto)
        differ += not _same(output, float(witness(auto, pv, sp, x0)))
    return differ


@pytest.mark.long
def test_no_bit_differs_between_the_printed_block_and_the_witness():  # run once for a million scans: 0 differ
    chance = np.random.default_rng(1131)
    assert sum(_printed_beside_witness(chance, 60) for _ in range(200)) == 0


def _repaired_beside_witness(chance, scans):
    """Return the largest difference over outputs of the size of a percent, while nothing is at a limit.

    The witness keeps the sum in °C·s and freezes it at a limit, where ours is led along; so they are one controller between the
    limits alone, to a few digits of the last place for each call.
    """
    kp, tr, td = (float(np.float32(10.0 ** chance.uniform(*ends))) for ends in ((-1.0, 0.5), (1.0, 3.0), (0.0, 1.0)))
    ms, milliseconds = int(chance.integers(500, 5001)), bool(chance.integers(2))
    values = {"KP": kp, "TR": tr, "TD": td, "XMIN": 0.0, "XMAX": 100.0, "CYCLE": ms}
    block, state = repaired.block_of(values, repaired.IecPidAssumptions(MILLISECONDS if milliseconds else SECONDS)), repaired.COLD
    # TR and TD of the witness are in what TIME_TO_REAL counts
    scale = 1000.0 if milliseconds else 1.0
    witness, sp, auto, most, compared = RepairedWitness(kp, tr * scale, td * scale, ms, milliseconds=milliseconds), 60.0, False, 0.0, 0
    for k in range(scans):
        auto = k % 20 > 3
        x0, pv = float(np.float32(chance.uniform(40.0, 60.0))), float(np.float32(sp + chance.normal(0.0, 0.3)))
        state = repaired.call(block, state, repaired.IecPidInputs(sp, pv, x0, auto, True))
        theirs = float(witness(auto, pv, sp, x0))
        bound = not 5.0 < state.output < 95.0 or not 5.0 < theirs < 95.0
        if bound:
            return most, compared
        most, compared = max(most, abs(state.output - theirs)), compared + 1
    return most, compared


def test_the_repaired_block_is_the_witness_between_the_limits():
    chance = np.random.default_rng(7)
    found = [_repaired_beside_witness(chance, 60) for _ in range(150)]
    assert sum(compared for _, compared in found) > 5000
    assert max(most for most, _ in found) < 60 * 8 * 100 * 2.0**-24  # 60 calls, no more than eight roundings each at 100 %


def test_by_hand_and_at_the_first_call_the_repaired_block_is_the_witness():
    words = {"KP": 2.5, "TR": 100.0, "TD": 10.0, "XMIN": 0.0, "XMAX": 100.0, "CYCLE": 1000}
    for sp, pv, x0, auto in ((60.0, 50.0, 30.0, True), (60.0, 50.0, 30.0, False), (60.0, 50.0, 130.0, False), (60.0, 50.0, -1.0, False)):
        state = repaired.call(repaired.block_of(words, repaired.IecPidAssumptions()), repaired.COLD, repaired.IecPidInputs(sp, pv, x0, auto, True))
        assert state.output == pytest.approx(float(RepairedWitness(2.5, 100.0, 10.0, 1000)(auto, pv, sp, x0)), abs=1e-4)


@pytest.mark.long
def test_the_compiled_step_gives_the_bits_of_the_plain_one():
    from heatertune.compiled import compile_function  # noqa: PLC0415 - Numba is slow to load
    chance = np.random.default_rng(3)
    for module, assumptions, room in (
            (repaired, repaired.IecPidAssumptions, ROOM), (printed, printed.StandardPidAssumptions, PRINTED)):
        fast = compile_function(room.core.step)
        for _ in range(30):
            kp, tr, td = _gains(chance)
            block = module.block_of({"KP": kp, "TR": tr, "TD": td, "XMIN": 0.0, "XMAX": 100.0, "CYCLE": 1730}, assumptions())
            plain, quick = module.COLD, module.COLD
            for _ in range(40):
                sp, pv = _real(chance, 0.0), _real(chance)
                plain, power, output, bits = module.step((block, assumptions()), plain, sp, pv, True)
                quick, *told = fast(to_single((block, assumptions())), to_single(quick), np.float32(sp), np.float32(pv), True)
                assert _same(power, float(told[0])), (block, sp, pv)
                assert _same(output, float(told[1]))
                assert told[2] == bits
                assert all(_same(float(a), float(b)) for a, b in zip(plain, quick, strict=True))


def test_time_is_in_seconds_whatever_the_unit():
    for ms in (1, 17, 250, 999, 1000, 1005, 8190, 60000):
        found = {unit: repaired.block_of(_words(TR=1.0, KP=1.0, CYCLE=ms).values, repaired.IecPidAssumptions(unit)).growth for unit in GIVES}
        assert found[SECONDS] == pytest.approx(ms / 1000, rel=1e-7)
        assert found[MILLISECONDS] == found[SECONDS] == float(np.float32(ms / 1000))
        assert found[NANOSECONDS] == pytest.approx(ms / 1000, rel=2e-7)
        assert found[TENS_OF_MS] == float(np.float32(ms // 10) / np.float32(100))  # what is cut off a CYCLE
    # so that milliseconds are no setting of their own
    assert all(time_to_real(ms, SECONDS) == float(np.float32(ms) / np.float32(1000)) for ms in range(1, 60001))
    with pytest.raises(Exception, match="unit of TIME_TO_REAL is not told"):
        TextProgram(units("PROGRAM P\nVAR\n  x : REAL;\nEND_VAR\nx := TIME_TO_REAL(T#1s);\nEND_PROGRAM"), {})
    assert [time_to_real(1500, unit) for unit in (SECONDS, MILLISECONDS, TENS_OF_MS, NANOSECONDS)] == [1.5, 1500.0, 150.0, 1.5e9]


def test_the_equation_in_fractions_where_nothing_is_at_a_limit():
    words = _words(KP=0.5, TR=40.0, TD=8.0, CYCLE=2000)
    readings = [49.0, 48.0, 48.5, 49.0, 50.0, 51.0, 50.5, 50.25, 50.0]
    errors = [Fraction(50) - Fraction(each) for each in readings]
    history, total, wanted = [errors[0]] * 3, Fraction(0), []
    for e in errors:
        total += Fraction(1, 2) * 2 / 40 * e
        total = min(max(total, -e / 2), 100 - e / 2)
        slope = (3 * (e - history[2]) + history[0] - history[1]) / (10 * 2)
        wanted.append(float(min(max(e / 2 + total + Fraction(1, 2) * 8 * slope, Fraction(0)), Fraction(100))))
        history = [e, *history[:2]]
    assert _run(words, [(50.0, each) for each in readings]) == pytest.approx(wanted, abs=1e-5)


def test_a_ramp_of_the_error_has_its_slope_after_three_calls():
    # (3·3 + 2 − 1)/10 = 1 once the history is the ramp's; before it is 0 + 0.3, 0.7: the four points
    assert _run(_words(KP=1.0, TD=1.0), [(50.0 + k, 50.0) for k in range(6)]) == pytest.approx([0.0, 1.3, 2.7, 4.0, 5.0, 6.0])


def test_the_return_from_hand_is_without_a_bump_and_the_sum_does_not_wind_up():
    words = _words(KP=2.0, TR=100.0)
    by_hand = [(50.0, 45.0, 30.0, 0)] * 3
    assert _run(words, [*by_hand, (50.0, 45.0, 30.0, 1)]) == pytest.approx([30.0, 30.0, 30.0, 30.1])
    # an hour below the setpoint, then above it: down at once, as P and I together were never above 100 %
    assert _run(words, [(50.0, 0.0)] * 3600 + [(50.0, 51.0)])[-1] < 1.0
    assert _run(words, [(50.0, 45.0, 130.0, 0), (50.0, 45.0, -5.0, 0), (50.0, 45.0, math.nan, 0)]) == [100.0, 0.0, 0.0]


def test_a_reading_that_is_no_number_is_forgotten_and_run_false_begins_anew():
    words = _words(KP=1.0, TR=10.0)
    good, bad = (50.0, 45.0), (50.0, math.nan)
    assert _run(words, [good, bad, good]) == pytest.approx([5.5, 0.0, 6.0])
    off = (50.0, 45.0, 0.0, 1, 0)
    assert _run(words, [good, good, off, good]) == pytest.approx([5.5, 6.0, 0.0, 5.5])


def test_no_reset_time_is_no_i_part():
    assert _run(_words(KP=2.0), [(50.0, 45.0)] * 4) == [10.0] * 4
    assert _run(_words(KP=-2.0), [(50.0, 55.0)] * 2) == [10.0] * 2  # a cooler


def test_the_printed_block_by_hand_gives_the_gain_times_the_output_asked_for():
    # TR·(X0 − e)/TR + e = X0, all of it times KP
    assert _run(_words("iec-pid-text", KP=2.5, TR=100.0), [(50.0, 45.0, 30.0, 0)]) == [75.0]
    assert math.isnan(_run(_words("iec-pid-text", KP=2.5), [(50.0, 45.0, 30.0, 0)])[0])


def test_the_printed_block_differentiates_against_zeros_at_first():
    # slopes of e = −10: −30/10; then with −10 one call old (−30 − 10)/10; two calls old (−30 − 10 + 10)/10; then none
    found = _run(_words("iec-pid-text", KP=-1.0, TR=1e30, TD=1.0), [(50.0, 40.0)] * 5)
    assert found == pytest.approx([13.0, 14.0, 13.0, 10.0, 10.0], abs=1e-4)


FAULTS = ["ERROR is PV - SP", "by hand XOUT is KP*X0", "no limits", "no anti-windup", "TR = 0 is not off", "first call after a start-up",
          "divided by TR as it is now", "unit of TIME_TO_REAL", "no number stays"]


@pytest.mark.parametrize(("changed", "absent"), [
    ({"KP": 2.5, "TD": 10.0}, []), ({"KP": -2.5}, ["ERROR is", "first call"]), ({"KP": 1.0, "TD": 1.0}, ["by hand XOUT is"]),
    ({"KP": 0.0}, ["ERROR is", "no limits", "no anti", "first call", "divided"])])
def test_the_faults_are_those_that_the_words_bring_out(changed, absent):
    told = PRINTED.faults(_words("iec-pid-text", TR=100.0, **{"TD": 0.0} | changed))
    missing = [fault for fault in FAULTS if not any(fault in each for each in told)]
    assert len(missing) == len(absent)
    assert all(any(fault.startswith(part) or part in fault for part in absent) for fault in missing)


def test_the_printed_block_refuses_a_design_without_an_i_part_and_negates_the_gain():
    design = PidDesign(gain_pct_per_degC=2.0, integral_time_s=math.inf, derivative_time_s=0.0, sample_time_s=1.0,
                       structure=structure_of(math.inf, 0.0), method="")
    with pytest.raises(NotRepresentable, match="PI or PID would fit"):
        PRINTED.encode(design, Scaling())
    assert ROOM.encode(design, Scaling()).values["TR"] == 0.0
    words = _words("iec-pid-text", KP=-2.0, TR=50.0)
    assert PRINTED.decode(words).gain_pct_per_degC == 2.0
    for bad in ({"KP": 0.0, "TR": 50.0}, {"TR": 0.0}):
        with pytest.raises(OutOfRange, match=r"word (KP|TR)"):
            PRINTED.decode(_words("iec-pid-text", **bad))


@pytest.mark.parametrize("changed", [{"XMIN": 60.0, "XMAX": 50.0}, {"CYCLE": 0}, {"TR": -1.0}, {"XMAX": 101.0}])
def test_words_that_cannot_be_are_refused(changed):
    with pytest.raises(OutOfRange, match=next(iter(changed))):
        ROOM.check(_words(**changed))


@pytest.mark.parametrize("room", [ROOM, PRINTED], ids=["repaired", "printed"])
def test_what_is_exported_is_read_back(room):
    words = _words(room.name, KP=-0.37, TR=123.456, TD=7.5, CYCLE=1730)
    for name, content in room.export(words, Certificate(verdict="PASS")).items():
        assert dict(room.text(content, None, name).values) == dict(words.values), name


@pytest.mark.parametrize(("text", "told"), [
    ("KP = 2.5\nTR = 100 min\nTD = 0\nXMIN = 0\nXMAX = 100\nCYCLE = 1000", "TR.*100 min"),
    ("KP = 2.5\nTR = 100\nTD = 0\nXMIN = 0\nXMAX = 100\nCYCLE = T#1.0005s", "CYCLE"),
    ("KP = 2.5\nTR = 100\nTD = 0\nXMIN = 0\nXMAX = 100", "CYCLE"), ("P(KP := 2.5, KP := 3.0)", "KP"), ("KP = x", "KP"),
    ("P(KP := 2.5);\nQ(KP := 2.5);", "lines 1 and 2")])
def test_a_bad_list_is_refused_with_its_line(text, told):
    with pytest.raises(Exception, match=told):
        ROOM.text(text, None, "oven.st")


@pytest.mark.parametrize(("literal", "ms"), [("T#1s500ms", 1500), ("TIME#1.5s", 1500), ("t#0.5m", 30000), ("T#1_000ms", 1000), ("250", 250)])
def test_a_duration_is_read_as_the_language_writes_it(literal, ms):
    text = f"Oven(AUTO := Auto, KP := REAL#2.5, TR := 100.0, TD := 0.0, XMIN := 0.0, XMAX := 100.0, CYCLE := {literal});"
    back = ROOM.text(text, None, "oven.st")
    assert back.values["CYCLE"] == ms
    assert back.passed_over == ("AUTO := Auto (line 1)",)


def test_a_text_with_more_than_the_call_says_that_the_rest_is_not_looked_at():
    words = ROOM.encode(PidDesign(gain_pct_per_degC=2.5, integral_time_s=100.0, derivative_time_s=0.0, sample_time_s=5.0,
                                  structure="pi", method=""), Scaling())
    for name, text in ROOM.export(words, Certificate(verdict="PASS")).items():
        *_, block, around = ROOM.text(text, None, name).passed_over
        assert block.startswith("FUNCTION_BLOCK HT_IEC_PID (line "), name
        assert around.startswith("the program around the call"), name
