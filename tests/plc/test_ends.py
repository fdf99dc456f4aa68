"""The ends of ranges and the figures of the manuals; every expected value is a manual's, or worked out by hand beside it."""

import math
from dataclasses import replace

import pytest
from tests.golden import printed
from tests.golden.one_bit_programs import HEATER_PRINTED, TWO_LEVEL_NAMES

from heatertune.errors import NotRepresentable, OutOfRange
from heatertune.pid.design_values import PidDesign, structure_of
from heatertune.plc import Certificate, Ramp, Scaling, controller_for
from heatertune.plc.cpu.one_bit.machine import HEATER_NAMES, ON_OFF_NAMES, START, Wiring, scan
from heatertune.plc.cpu.one_bit.machine import assemble as single_bit
from heatertune.plc.cpu.s7_200 import COLD, assemble, run
from heatertune.plc.cpu.s7_200.cpu import divide_integers
from heatertune.plc.cpu.s7_200.memory import SIZE, cell
from heatertune.plc.dump_reader import read_machine
from heatertune.plc.on_off.controller import OnOffState
from heatertune.plc.on_off.controller import step as direct
from heatertune.plc.s7_200_paper.export import faults
from heatertune.plc.s7_200_paper.words import paper_words
from heatertune.plc.words import round_to_word


def _design(gain=3.0, tn=200.0, tv=0.0, ta=5.0):
    return PidDesign(gain_pct_per_degC=gain, integral_time_s=tn, derivative_time_s=tv, sample_time_s=ta,
                     structure=structure_of(tn, tv), method="")


def _words(target, scaling=None, **changed):
    words = controller_for(target).encode(_design(), scaling or Scaling())
    return replace(words, values={**words.values, **changed})


@pytest.mark.parametrize(("target", "full"), [
    ("s5-ob251", 2047),  # table 11-11
    ("s7-300", 27648), ("fb41", 27648),  # 16#6C00, the upper end of every nominal range
    ("s7-200", 255), ("s7-200-paper", 255),  # a byte
    ("s7-200-pid", 4000),  # 12 bits of the EM 231: 0…32000 in steps of 8
])
def test_the_upper_end_of_the_sensors_range_is_the_modules_full_scale(target, full):
    controller = controller_for(target)
    high = controller.sensor(Scaling(low_degC=-20.0, high_degC=130.0))
    assert (high.counts, high.low, high.span) == (full, -20.0, 150.0)


@pytest.mark.parametrize(("target", "word", "half", "full"), [
    ("s5-ob251", "BGOG", 1024, 2047), ("fb41", "LMN_HLM", 50.0, 100.0), ("weg", "MaximumOutput", 50.0, 100.0),
])
def test_half_of_the_power_is_half_of_the_word_that_limits_it(target, word, half, full):
    controller, words = controller_for(target), _words(target)
    assert controller.with_output_limit(words, 50.0).values[word] == half
    assert controller.with_output_limit(words, 100.0).values[word] == full


@pytest.mark.parametrize(("sample", "fits"), [(1.0, True), (60000.0, True), (0.5, False), (60001.0, False)])
def test_the_call_interval_of_the_tip_is_1_ms_to_1_min(sample, fits):
    words = _words("s7-300", SAMPLE=sample)
    if fits:
        controller_for("s7-300").check(words)
    else:
        with pytest.raises(OutOfRange, match="word SAMPLE"):
            controller_for("s7-300").check(words)


@pytest.mark.parametrize(("low", "high", "fits"), [
    (0.0, 1e5, True), (-200.0, 1e5, False), (20.0, 20.0 + 2e-3, True), (20.0, 20.0 + 5e-4, False), (-273.15, 0.0, True),
    (-273.2, 0.0, False), (20.0, 20.0, False), (21.0, 20.0, False),
])
def test_a_sensor_range_is_wide_enough_and_not_too_wide(low, high, fits):
    if fits:
        assert Scaling(low_degC=low, high_degC=high).span_degC == high - low
    else:
        with pytest.raises(OutOfRange):
            Scaling(low_degC=low, high_degC=high)


def test_the_pid_instruction_without_a_gain_has_no_standard_form_and_its_gain_is_a_share_per_share():
    # KC = −1: 100 % of the power for the whole range of 100 °C; Ti and Td in minutes; no derivative filter (C233, p. 9-86)
    controller, words = controller_for("s7-200-pid"), _words("s7-200-pid", KC=-1.0, TI=5.0, TD=0.5)
    design = controller.decode(words)
    assert (design.gain_pct_per_degC, design.derivative_filter) == (-1.0, 0.0)
    assert (design.integral_time_s, design.derivative_time_s) == pytest.approx((300.0, 30.0))
    assert math.isinf(controller.decode(_words("s7-200-pid", TI=3.4028234663852886e38)).integral_time_s) is True
    with pytest.raises(OutOfRange, match="word KC"):
        controller.decode(_words("s7-200-pid", KC=0.0))


def test_a_ramp_of_a_range_below_zero_moves_by_a_step_of_the_converter_at_least():
    # WEG, 12 bits over −50…100 °C: 150/4095 = 0.0366 °C
    controller, words = controller_for("weg"), _words("weg", Scaling(low_degC=-50.0, high_degC=100.0))
    controller.check_ramp(replace(words, ramp=Ramp(step=0.0625)))
    for step in (0.03125, 150.0):
        with pytest.raises(OutOfRange, match="ramp step"):
            controller.check_ramp(replace(words, ramp=Ramp(step=step)))


def test_the_largest_gain_of_the_repaired_program_is_encoded_and_no_larger_one():
    scaling, design = Scaling(), _design(ta=7.0)
    most = controller_for("s7-200").most_gain(scaling, design)
    words = controller_for("s7-200").encode(replace(design, gain_pct_per_degC=0.999 * most), scaling)
    assert words.values["SCALE"] == 1
    with pytest.raises(NotRepresentable, match="constant KP"):
        controller_for("s7-200").encode(replace(design, gain_pct_per_degC=1.001 * most), scaling)


def test_the_largest_constant_of_the_repaired_program_uses_its_word():
    # the scaling takes as many bits as there is room for: KP lies between half of 32767 and 32767
    for gain in (0.7, 1.3, 3.1, 6.0):
        values = controller_for("s7-200").encode(_design(gain=gain, ta=7.0), Scaling()).values
        assert 16383 <= max(abs(values[name]) for name in ("KP", "KI", "KD")) <= 32767


def test_the_sum_of_two_errors_that_leaves_16_bits_keeps_the_first():
    # E = 256·78 = 19968 twice: 39936 > 32767, AC1 stays 19968; T·Ki·19968 = 199680, its high word is 3
    c = printed.Constants(kp=0, ki=1, kd=0, t=10, cycle_ms=1000, pot1=0)
    after = printed.scan(c, printed.Memory(error=19968), 78, 0, False)
    assert (after.error, after.change, after.overflow) == (19968, 3, True)


@pytest.mark.parametrize(("dividend", "divisor", "quotient", "remainder"), [
    (-1, 1, -1, 0), (1, -1, -1, 0), (-1, -1, 1, 0), (0, -5, 0, 0), (-7, 2, -3, -1), (7, -2, -3, 1),
])
def test_div_cuts_towards_zero_and_its_remainder_has_the_sign_of_the_dividend(dividend, divisor, quotient, remainder):
    word, by_zero = divide_integers(dividend, divisor)
    assert (word & 0xFFFF, word >> 16, by_zero) == (quotient & 0xFFFF, remainder, False)


@pytest.mark.parametrize(("second", "zero", "negative"), [(5, 1, 0), (6, 0, 1), (4, 0, 0)])
def test_a_result_sets_the_flags_of_zero_and_of_below_zero(second, zero, negative):
    # C233, special memory: SM1.0 where the result is zero, SM1.2 where it is negative
    lines = ["LD\tSM0.0", "MOVW\t+5, VW0", f"-I\t+{second}, VW0", "MOVB\tSMB1, VB4"]
    text = "\n\t".join(["ORGANIZATION_BLOCK MAIN:OB1\nBEGIN\nNetwork 1", *lines]) + "\nEND_ORGANIZATION_BLOCK\n"
    state = run(assemble(text), "OB1", COLD)
    assert (state.read("VW0"), state.read("VB4") & 7) == (5 - second, zero + 4 * negative)


def test_the_areas_of_the_memory_lie_one_behind_the_other():
    assert [cell(name, width).start for name, width in (("IB0", 1), ("QB0", 1), ("VB0", 1), ("AIW0", 2))] == [0, 16, 288, 816]
    ends = {"IB15": 1, "QB15": 1, "SMB223": 1, "VB511": 1, "AIW6": 2}
    places = sorted(set(range(cell(name, width).start, cell(name, width).start + width)) for name, width in ends.items())
    assert len(set().union(*places)) == sum(ends.values())
    assert max(max(place) for place in places) == SIZE - 1
    assert {cell(f"AC{k}", 4).start for k in range(4)} == {800, 804, 808, 812}
    assert cell("AC3", 1).start == 815
    for name, width in (("IB16", 1), ("QB16", 1), ("VB512", 1), ("VW511", 2), ("AIW8", 2), ("VB-1", 1)):
        with pytest.raises(ValueError, match=rf"^{name.removesuffix('-1')[0]}"):
            cell(name, width)


def test_the_heater_program_has_the_addresses_beside_its_code_words_where_these_are_no_misprints():
    # below figure 9 the paper prints B at C's place and R at F's: the two free addresses below F are taken instead
    assert HEATER_NAMES.bits == {"A": 0, "B": 1, "C": 2, "D": 3, "R": 4, "F": 5, "H": 6}
    assert HEATER_PRINTED.bits == HEATER_NAMES.bits | {"B": 2, "R": 5}


def test_a_whole_word_is_refused_beyond_its_ends():
    k = next(field for field in controller_for("s5-ob251").fields if field.name == "TI")
    assert [round_to_word(k, value) for value in (0.0, 9999.4, 0.5, -0.4)] == [0, 9999, 1, 0]
    for value in (-0.5, 9999.5, math.inf):
        with pytest.raises(NotRepresentable, match="word TI"):
            round_to_word(k, value)


@pytest.mark.parametrize(("disturbance", "flags"), [(0.0, ["QLMN_LLM"]), (100.0, ["QLMN_HLM"]), (50.0, [])])
def test_a_limit_of_cont_c_is_told_where_it_is_reached(disturbance, flags):
    # QLMN_HLM, QLMN_LLM: "limit reached": with SP = PV from cold LMN is DISV, the limits are 100 and 0
    controller, words = controller_for("fb41"), _words("fb41", DISV=disturbance)
    reading = controller.measure(words, 0.0)
    _, scan = controller.step(controller.start(words, {}), 0.0, reading)
    assert [name for name, is_set in scan.flags.items() if is_set] == flags


def test_an_overflow_of_cont_c_is_told_beside_the_limit():
    # GAIN·(SP − PV) = 3e38·(0 − 50) is no single
    controller, words = controller_for("fb41"), _words("fb41", GAIN=3.0000000054977558e38)
    _, scan = controller.step(controller.start(words, {}), 0.0, controller.measure(words, 50.0))
    assert scan.flags == {"QLMN_HLM": False, "QLMN_LLM": True, "overflow": True}


@pytest.mark.parametrize(("lines", "bits"), [
    (["MOVW\t+32767, VW0", "+I\t+1, VW0"], 2), (["MOVW\t-32768, VW0", "-I\t+1, VW0"], 2), (["MOVD\t+7, AC0", "DIV\t+0, AC0"], 8),
    (["MOVD\t-6, AC0", "DIV\t+2, AC0"], 4), (["MOVD\t+1, AC0", "DIV\t+2, AC0"], 1), (["MOVD\t+6, AC0", "DIV\t+2, AC0"], 0),
])
def test_an_overflow_a_division_by_zero_and_a_quotient_set_their_flags_and_no_other(lines, bits):
    # C233, special memory: SM1.1 overflow, SM1.3 division by zero; −6/2 is negative (SM1.2), 1/2 is 0 (SM1.0), the rest aside
    text = "\n\t".join(["ORGANIZATION_BLOCK MAIN:OB1\nBEGIN\nNetwork 1", "LD\tSM0.0", *lines, "MOVB\tSMB1, VB4"])
    assert run(assemble(f"{text}\nEND_ORGANIZATION_BLOCK\n"), "OB1", COLD).read("VB4") & 15 == bits


def test_the_blocks_of_ob251s_listings_have_the_numbers_of_its_manual_page():
    # COMMISSIONING.md and DIFFERENCES.md: FB30 in OB13, FB31 in OB21 and OB22, FB32 feed-forward, FB33 ramp; DB30 and DB31
    words = replace(_words("s5-ob251"), ramp=Ramp(step=4))
    files = controller_for("s5-ob251").export(words, Certificate(verdict="PASS"))
    blocks = {name: [line for line in files[name].splitlines() if line.startswith(("FB ", "OB ", "DB"))]
              for name in files if name.endswith(".txt")}
    assert blocks == {"DB30_listing.txt": ["DB30"], "program_listing.txt": [
        "DB30", "DB31", "FB 30", "FB 31", "FB 33", "OB 1", "OB 13", "OB 21", "OB 22"]}


@pytest.mark.parametrize(("word", "low", "high"), [("K", -32768, 32767), ("R", -32768, 32767), ("TI", 0, 9999), ("YH", -2047, 2047),
                                                   ("W", -2047, 2047)])
def test_the_words_of_ob251_have_the_ranges_of_table_11_11(word, low, high):
    controller = controller_for("s5-ob251")
    for value in (low, high):
        controller.check(_words("s5-ob251", **{word: value}))
    for value in (low - 1, high + 1):
        with pytest.raises(OutOfRange, match=f"word {word}"):
            controller.check(_words("s5-ob251", **{word: value}))


def test_ob251_holds_no_gain_beside_a_derivative_time_below_half_a_call():
    # TD is a whole multiple of TA: 2 s of 5 s is 0, 2.5 s is 1; then K is 1500/1024 at most, without a D part 32767/1024
    most = controller_for("s5-ob251").most_gain
    assert [most(Scaling(), _design(tv=tv)) for tv in (2.0, 2.5, 0.0)] == [0.0, 1500 / 1024, 32767 / 1024]


def test_the_papers_run_has_the_figures_that_are_assumed_for_it():
    # DIFFERENCES.md: cycle time 2000 ms, sensor 0…140 °C
    words = paper_words(gain=20)
    assert (words.sample_time_s, words.scaling, words.values["CYCLE"]) == (2.0, Scaling(low_degC=0.0, high_degC=140.0), 2000)


@pytest.mark.parametrize(("reading", "power", "overflow"), [(1000, 100.0, False), (1950, 0.0, False), (2051, 0.0, False)])
def test_two_level_control_in_16_bits_overflows_nowhere_near_its_words(reading, power, overflow):
    # SP = 2000, BAND = 50: on below 1950, off above 2050, between as before: off from the start
    _, on, output, flags = direct(50, OnOffState(), 2000, reading, False)
    assert (on, output, bool(flags & 1)) == (power, int(power > 0.0), overflow)


def test_before_the_first_comparison_neither_side_of_the_one_bit_processor_is_larger():
    wiring = Wiring(results={ON_OFF_NAMES.bits["AC1<AC2"]: -1, ON_OFF_NAMES.bits["AC1>AC2"]: 1})
    for side in ("<", ">"):
        program = single_bit(f"0. Test AC1{side}AC2\n1. Set(CFF=1) OUT\n2. Jump line0\n", ON_OFF_NAMES, operand_bits=4)
        assert not scan(program, wiring, START, registers=(1, 2, 3)).is_on(ON_OFF_NAMES.bits["OUT"])


def test_the_constants_of_the_repaired_program_are_words():
    controller = controller_for("s7-200")
    controller.check(_words("s7-200", KP=32767))
    with pytest.raises(OutOfRange, match="word KP"):
        controller.check(_words("s7-200", KP=32768))


def test_the_source_of_the_tip_tells_its_call_interval_and_the_factor_of_its_setpoint():
    # TA = 5 s; 27648 over 0…200 °C
    source = controller_for("s7-300").export(_words("s7-300", Scaling(high_degC=200.0)), Certificate(verdict="PASS"))["s7_300_pid.awl"]
    assert "the controller is called every 5000 ms" in source
    assert "SP = 27648/200 * (degC +0)" in source


@pytest.mark.parametrize(("target", "delay_s"), [
    ("s5-ob251", 0.48),  # analog input 460 with eight channels; T PY writes the output at once
    ("s7-300", 0.256), ("fb41", 0.256),  # SM 331 with eight channels at 50 Hz, 176 ms, 10 ms more each for the wire-break check
])
def test_input_modules_take_the_time_of_their_manuals(target, delay_s):
    assert controller_for(target).delay_s == pytest.approx(delay_s)


@pytest.mark.parametrize(("changed", "part"), [
    ({"Kp": 0.0, "Type": 0}, "in the academic form nothing acts"), ({"Kp": 0.0, "Type": 1}, "there is no proportional part"),
    ({"Ki": 0.0}, "there is no integral part"), ({"Type": 1}, "Type is 1, the parallel form"),
])
def test_what_is_odd_about_wegs_block_is_told_and_nothing_else(changed, part):
    # the seed's parameter list: Type 0 academic, 1 parallel; Kp multiplies all parts in the academic form only
    oddities = controller_for("weg").oddities
    assert oddities(_words("weg")) == ()
    told = oddities(_words("weg", **changed))
    assert any(part in line for line in told)
    assert ("Kp is 0" in " ".join(told)) is ("Kp" in changed)


def test_the_paper_programs_flags_are_those_of_the_last_scan_alone():
    # SM1.1 and SM1.3 tell the last instruction: T = 0 divides by zero; the scan after with T = 1 does not
    c = printed.Constants(kp=0, ki=0, kd=1, t=0, cycle_ms=1000, pot1=0)
    after = printed.scan(c, printed.Memory(error=500, overflow=True), 2, 0, False)
    assert (after.overflow, after.zero_division) == (False, True)
    assert printed.scan(c._replace(t=1), after, 2, 0, False).zero_division is False


@pytest.mark.parametrize(("ki", "kd", "t"), [(1, 0, 1), (3, 0, 5), (0, 7, 3), (2, 5, 40)])
def test_the_papers_faults_are_counted_as_pair_by_pair(ki, kd, t):
    """The list of operations of a CPU 214, pair by pair: +I and -I keep their operand where the result is no word."""

    def word(number):
        return (number + 2**15) % 2**16 - 2**15

    sums = cut = left = 0
    for setpoint in range(256):
        for reading in range(256):
            first, second = word(256 * setpoint), word(256 * reading)
            error = first - second if first - second == word(first - second) else first
            sums += ki != 0 and 2 * error != word(2 * error)
            cut += ki * word(2 * error) != word(ki * word(2 * error))
            left += math.remainder(abs(word(kd * error)), t) != 0.0
    words = paper_words(gain=20, ki=ki, t=t)
    told = faults(replace(words, values={**words.values, "KD": kd}))
    counts = {line.split(" ")[0]: int(line.split(": ")[1].split(" ")[0]) for line in told if " of 65536 pairs" in line}
    assert counts.get("Ki", 0) == cut
    assert counts.get("DIV", 0) == left
    assert [int(line.split(": ")[1].split(" ")[0]) for line in told if line.startswith("the sum")] == ([sums] if sums else [])


def test_ob251s_gain_is_in_units_per_unit_of_the_sensors_range():
    # 0…200 °C and 0…100 % are 2047 units each: 1 %/°C is 2 units per unit, 2048/1024
    words = controller_for("s5-ob251").encode(_design(gain=1.0), Scaling(high_degC=200.0))
    assert words.values["K"] == 2048
    assert controller_for("s5-ob251").decode(words).gain_pct_per_degC == 1.0


def test_the_scaling_of_the_repaired_program_has_16_bits_at_most():
    # KP = 0.005·7000/100·100/255 = 0.137 ms per count: 2^16 of it is 8996, 17 bits would still be a word
    values = controller_for("s7-200").encode(_design(gain=0.005, tn=30.0, ta=7.0), Scaling()).values
    assert values["SCALE"] == 16


@pytest.mark.parametrize(("constant", "k"), [("KS = 'AB'", 0x4142), ("KH = 0400", 1024), ("KY = 4,1", 1025), ("KF = -00002", -2)])
def test_a_data_word_is_read_in_any_format_of_step_5(constant, k):
    rows = [f"{dw}: {constant if dw == 1 else 'KH = 0400' if dw == 3 else 'KF = +00000'};" for dw in range(49)]
    read = read_machine(controller_for("s5-ob251"), "\n".join(rows).encode(), sample_time_s=1.0, scaling=Scaling(), source="DB")
    assert (read.words.values["K"], read.words.values["R"]) == (k, 1024)


@pytest.mark.parametrize("names", [HEATER_NAMES, ON_OFF_NAMES, TWO_LEVEL_NAMES])
def test_the_addresses_of_a_one_bit_program_are_counted_from_0(names):
    for addresses in (names.bits, names.registers):
        assert sorted(addresses.values()) == list(range(len(addresses)))


def test_limits_of_ob251_that_are_upside_down_are_refused_and_equal_ones_are_not():
    controller = controller_for("s5-ob251")
    controller.check(_words("s5-ob251", BGOG=500, BGUG=500))
    with pytest.raises(OutOfRange, match="word BGUG"):
        controller.check(_words("s5-ob251", BGOG=500, BGUG=501))


@pytest.mark.parametrize(("cycle", "fits"), [(1, True), (60000, True), (0, False), (60001, False)])
def test_the_call_interval_of_cont_c_is_1_ms_to_1_min(cycle, fits):
    # OB35: 1 ms to 1 min
    words = replace(_words("fb41", CYCLE=cycle), sample_time_s=cycle / 1000.0)
    if fits:
        controller_for("fb41").check(words)
    else:
        with pytest.raises(OutOfRange, match="word CYCLE"):
            controller_for("fb41").check(words)
