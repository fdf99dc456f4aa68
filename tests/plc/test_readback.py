"""Words read back from text: what heatertune exports comes back the same, what other tools write is read by the facts of
the manuals, and every bad line is told by its number, field and value."""

import random
import struct
from contextlib import suppress
from dataclasses import replace

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from heatertune.errors import HeatertuneError, InputError, NotRepresentable, OutOfRange
from heatertune.pid.design_values import PidDesign, structure_of
from heatertune.plc import TARGETS, Certificate, Scaling, controller_for
from heatertune.plc.dump_reader import read_machine, realised_design
from heatertune.plc.readback import text_of
from heatertune.plc.words import check_fields

TEXTS = {
    "s5-ob251": ("DB30_listing.txt",), "s7-200": ("s7_200_program.awl",), "s7-200-paper": ("s7_200_paper.awl",),
    "s7-200-pid": ("s7_200_pid.awl",), "s7-300": ("s7_300_pid.awl",), "fb41": ("fb41_cont_c.awl",),
    "weg": ("weg_pid_call.st", "weg_pid_block.st", "weg_pid_plcopen.xml"), "on-off": ("on_off_rom.hex",),
    "iec-pid": ("iec_pid.st", "iec_pid_plcopen.xml"), "iec-pid-text": ("iec_pid_text.st",),
    "klipper": ("klipper_heater.cfg",), "marlin": ("marlin_pid.h", "marlin_pid.gcode"), "arduino-pid": ("arduino_pid.ino",),
    "esphome": ("esphome_pid.yaml",), "simple-pid": ("simple_pid_heater.py",),
    "pband": ("pband_sheet.txt", "pband_registers.csv"),
    "pid-compact": ("pid_compact_words.scl", "pid_compact_watch.csv"), "pid-temp": ("pid_temp_words.scl", "pid_temp_watch.csv"),
}
SAID = Certificate(verdict="PASS", lines=("proven at 40 °C; K := 3 (not this one)",))
DESIGN = PidDesign(gain_pct_per_degC=2.0, integral_time_s=200.0, derivative_time_s=0.0, sample_time_s=5.0, structure="pi", method="")
targets = pytest.mark.parametrize("target", TARGETS)


def _legal(target):
    """Return words of each target: its timer may not know 5 s."""
    which = controller_for(target)
    return which.encode(replace(DESIGN, sample_time_s=which.timer.round(DESIGN.sample_time_s)), Scaling())


def _read(target, content, *, interval=None, scaling=None, source="block.txt"):
    content = content.encode() if isinstance(content, str) else content
    machine = read_machine(controller_for(target), content, sample_time_s=interval, scaling=scaling or Scaling(), source=source)
    return machine.words, (*machine.passed_over, *(() if machine.unlike is None else machine.unlike(machine.words)))


def _refused(target, content, *parts, interval=7.0):
    with pytest.raises(HeatertuneError) as refused:
        _read(target, content, interval=interval)
    for part in ("block.txt", *parts):
        assert part in str(refused.value), refused.value


def _exported(words):
    files = controller_for(words.target).export(words, SAID)
    return [files[name] for name in TEXTS[words.target]]


@st.composite
def exports(draw, target):
    """Words of a random design that fits, with a ramp or without."""
    gain = draw(st.floats(0.05, 30.0)) * draw(st.sampled_from([1.0, 1.0, -1.0]))
    ta = controller_for(target).timer.round(draw(st.integers(1, 300)) / 10.0)
    tn = ta * draw(st.one_of(st.floats(3.0, 400.0), st.just(float("inf"))))
    tv = draw(st.sampled_from([0.0, 1.0])) * ta * draw(st.floats(0.6, 20.0))
    design = PidDesign(gain_pct_per_degC=gain, integral_time_s=tn, derivative_time_s=tv, sample_time_s=ta,
                       structure=structure_of(tn, tv), method="")
    scaling = Scaling(low_degC=draw(st.sampled_from([0.0, -50.0])), high_degC=draw(st.sampled_from([100.0, 400.0])))
    controller = controller_for(target)
    try:
        words = controller.encode(design, scaling)
        return replace(words, ramp=controller.ramp(words, 2.0)) if controller.has_ramp and draw(st.booleans()) else words
    except (NotRepresentable, OutOfRange):
        return _legal(target)


@targets
def test_the_texts_of_one_design_come_back_as_its_words(target):
    words = _legal(target)
    for text in _exported(words):
        assert _read(target, text, interval=words.sample_time_s)[0] == words


@pytest.mark.long
@pytest.mark.law
@targets
def test_what_is_exported_comes_back_the_same(target):
    @settings(max_examples=40)
    @given(words=exports(target))
    def holds(words):
        for text in _exported(words):
            machine = read_machine(controller_for(target), text.encode(), sample_time_s=words.sample_time_s,
                                   scaling=words.scaling, source="text")
            assert machine.words == replace(words, ramp=None)
            # a whole program is the one that is exported, once it is known what ramp is written into it
            assert (machine.unlike is not None) == (target.startswith("s7") or target == "fb41" or target.startswith("pid-"))
            if machine.unlike is not None:
                assert machine.unlike(words) == ()
                assert bool(machine.unlike(machine.words)) == (words.ramp is not None)

    holds()


@pytest.mark.law
@targets
def test_damaged_text_is_read_or_refused_and_never_ends_in_a_fault(target):
    words = _legal(target)
    texts = [text.encode() for text in _exported(words)]

    @settings(max_examples=80, suppress_health_check=[HealthCheck.too_slow])
    @given(seed=st.integers(0, 2**32), which=st.sampled_from(range(len(texts))), junk=st.text(max_size=8))
    def holds(seed, which, junk):
        chance, damaged = random.Random(seed), bytearray(texts[which])
        for _ in range(chance.randint(1, 4)):
            at = chance.randrange(len(damaged) + 1)  # a short text may be gone by now
            length = chance.choice([0, 1, 1, 3, 40])
            damaged[at : at + length] = chance.choice(
                [b"", junk.encode("utf-8", "replace"), bytes([chance.randrange(256)]), damaged[at : at + 60], b"9" * 400])
        with suppress(HeatertuneError):  # anything else is a fault
            read, _ = _read(target, bytes(damaged), interval=5.0)
            check_fields(controller_for(target).fields, read)

    holds()


# S5: table 11-11 for the places; constants KF, KH, KM, KY, KT, KZ, KC, KS as the S5-115U manual has them (p. 198)
def _listing(**lines):
    shown = {f"DW{dw}": f"{dw:4d}:      KH = 0000;" for dw in range(49)}
    named = {"DW1": "KF = +02956;", "DW3": "KF = +01024;", "DW5": "KF = +00057;", "DW11": "KM = 00000000 00100001;",
             "DW14": "KF = +02047;"} | lines
    for place, constant in named.items():
        shown[place] = f"{place[2:]:>4s}:      {constant}" if constant else ""
    return "\r\n".join(["DB30          C:HEATER ST.S5D            LAE=54", "", *shown.values(), "  49:"]) + "\r\n\x1a"


def test_a_step_5_listing_is_read_in_whatever_format_a_word_is_printed():
    read, _ = _read("s5-ob251", _listing(), interval=4.0)
    assert read.values == {"K": 2956, "R": 1024, "TI": 57, "TD": 0, "W": 0, "STEU": 33, "YH": 0, "BGOG": 2047, "BGUG": 0}
    # 2956 = 0B8Ch = 11,140; -2 = FFFEh; a count and a timer are BCD: 57h = 87, 0.1 s base 1 = 1000h + 57h
    for line, word, value in (
        ({"DW1": "KH = 0B8C;  // gain"}, "K", 2956), ({"DW1": "KY = 011,140;"}, "K", 2956), ({"DW1": "KF = -2;"}, "K", -2),
        ({"DW1": "KF=-00002;"}, "K", -2), ({"DW1": "KM = 11111111 11111110;"}, "K", -2), ({"DW5": "KZ = 057;"}, "TI", 0x57),
        ({"DW5": "KC = 057;"}, "TI", 0x57), ({"DW5": "KT = 057.1;"}, "TI", 0x1057), ({"DW11": "KH = A521;"}, "STEU", 0x21),
    ):
        assert _read("s5-ob251", _listing(**line), interval=4.0)[0].values[word] == value, line
    assert _read("s5-ob251", _listing(DW22="KF = +00777;"), interval=4.0)[1] == ("1 data words besides, which are not 0",)
    # a text takes several data words: "AB" = 4142h in DW18, "CD" in DW19; German tools call it KC
    for format_ in ("KS", "KC"):
        listing = _listing(DW18=f"{format_} = 'ABCD';", DW19="")
        assert _read("s5-ob251", listing, interval=4.0)[0].values["K"] == 2956


@pytest.mark.parametrize(("lines", "said"), [
    ({"DW1": "KF = +40000;"}, ("line 4", "DW1", "'+40000'", "-32768…32767")),
    ({"DW5": "KF = +10000;"}, ("line 8", "TI", "'+10000'", "0…9999")),
    ({"DW1": "KG = +1000000+03;"}, ("line 4", "DW1", "'KG'", "KF, KH")),
    ({"DW1": "KH = 0B8;"}, ("line 4", "DW1", "'0B8'", "four digits")),
    ({"DW1": "KF = +1 024;"}, ("line 4", "DW1", "'+1 024'")),
    ({"DW1": "KY = 300,1;"}, ("line 4", "DW1", "0…255")),
    ({"DW1": "gain 3"}, ("line 4", "'1:      gain 3'", "1: KF = +01024;")),
    ({"DW40": ""}, ("DW40", "DW0 to DW48")),
    ({"DW2": "KS = 'ABCD';"}, ("line 6", "DW3", "line 5 has it")),
    ({"DW7": "KF = +1;\r\nDB31"}, ("line 11", "'DB31'", "DB30")),
    ({"DW14": "KF = +2048;"}, ("line 17", "BGOG", "'+2048'", "-2047…2047")),
])
def test_a_bad_line_of_a_step_5_listing_is_told(lines, said):
    _refused("s5-ob251", _listing(**lines), *said)


def test_a_data_block_of_micro_win_is_read_for_both_programs():
    # the loop table is big-endian REALs at VB112, VB116 …; the paper's program has VW200 … (its own listing)
    block = "// heater\nVB80\t1, 2, 16#FF\nVD112  2.5  // gain\n       3.0, 5.5e0\nVD124 16#3F000000\n"
    read, _ = _read("s7-200-pid", block, interval=3.0)
    assert (read.values["KC"], read.values["TS"], read.values["TI"], read.values["TD"]) == (2.5, 3.0, 5.5, 0.5)
    assert read.values["TICK"] * read.values["TICKS"] == 3000
    # 2^5 - 1 = 31 keeps 5 bits; 3100 ms in ticks of 155 ms; FFFEh is -2
    block = "VW200 120\nVW202 9,16#FFFE\nVW208 20\nVD212 31\nVD220 3100\n"
    read, _ = _read("s7-200", block)
    assert read.values == {"KP": 120, "KI": 9, "KD": -2, "SCALE": 5, "TICK": 155, "TICKS": 20}
    assert read.sample_time_s == 3.1
    assert _read("s7-200", block.replace("16#FFFE", "-2"))[0].values == read.values
    _, over = _read("s7-200", f"VW10 7, 8\n{block}")
    assert over == ("VW10 7 (line 1)", "VW12 8 (line 1)")


def test_a_status_chart_of_micro_win_is_read():
    # columns of Micro/WIN's status chart; the new value has not been written to the CPU
    chart = ("\tAddress\tFormat\tCurrent Value\tNew Value\n1\tVD112\tFloating Point\t2.5\t9.0\n2\tVD116\tFloating Point\t3.0\n"
             "3\tVD120\tFloating Point\t5.5\n4\tVD124\tGleitpunkt\t0.5\n5\tVW10\tSigned\t+7\n")
    read, over = _read("s7-200-pid", chart, interval=3.0)
    assert (read.values["KC"], read.values["TS"], read.values["TI"], read.values["TD"]) == (2.5, 3.0, 5.5, 0.5)
    assert over == ("VW10 +7 (line 6)",)


def test_a_program_of_ones_own_is_read_by_the_place_of_its_loop_table():
    # S7-200 system manual, PID instruction: gain, sample time, TI and TD are 12, 16, 20 and 24 bytes into the table
    program = "NETWORK 1\nLD SM0.1\nMOVR 0.75, VD404\nMOVR 2.0, VD412\nMOVR 0.5, VD416\nMOVR 10.0, VD420\nMOVR 0.0, VD424\nMOVB 100, SMB34\n"
    machine = read_machine(controller_for("s7-200-pid"), (program + "PID VB400, 0\n").encode(), sample_time_s=None, scaling=Scaling(), source="b")
    read = machine.words
    assert (read.values["KC"], read.values["TS"], read.values["TI"], read.values["TD"]) == (2.0, 0.5, 10.0, 0.0)
    assert read.sample_time_s == 0.5
    assert machine.assumed == ("called every 0.5 s", "the heater is switched by a PWM with a cycle of 0.5 s")
    assert _read("s7-200-pid", program + "PID VB400, 0\n", interval=2.0)[0].sample_time_s == 2.0
    _refused("s7-200-pid", program + "PID VB400, 0\nPID VB500, 1\n", "VB400, VB500", "one loop")


@pytest.mark.parametrize(("target", "block", "said"), [
    ("s7-200-pid", "VD112 2\n", ("line 1", "KC", "'2'", "REAL with a point")),
    ("s7-200-pid", "VD112 2.5\nVD116 3.0\nVD120 5.0\n", ("TD (VD124)",)), ("s7-200-pid", "VD112 2.5\nVD120 5.0\nVD124 0.0\n", ("TS (VD116)",)),
    ("s7-200-pid", "VD112 2,5\n", ("line 1", "KC")),
    ("s7-200-pid", "VD112 2.5\nVD112 2.5\n", ("line 2", "line 1 has it")),
    ("s7-200-pid", "VD112 1e39\nVD116 3.0\n", ("line 1", "'1e39'")),
    ("s7-200-pid", "2.5\n", ("line 1", "'2.5'", "VD112 2.5")),
    ("s7-200-pid", "VR112 2.5\n", ("line 1", "'VR112 2.5'")),
    ("s7-200", "VW200 40000\nVW202 1\n", ("line 1", "VW200", "'40000'", "-32768…32767")),
    ("s7-200", "VW200 1\nVW202 1\nVW204 0\nVW208 20\nVD212 30\nVD220 3100", ("line 5", "'30'", "2^SCALE")),
    ("s7-200", "VW200 1\nVW202 1\nVW204 0\nVW208 21\nVD212 31\nVD220 3100", ("line 6", "'3100'", "VW208 = 21")),
    ("s7-200", "LD SM0.0\nMOVW +1, VW200\nMOVW +2, VW200", ("line 3", "KP", "'+2'", "line 2")),
    ("s7-200", "LD SM0.0\nMOVW +1x, VW200", ("line 2", "VW200", "'+1x'")),
    ("s7-200-paper", "LD SM0.0\nMUL +1, AC0", ("1 instructions MUL", "4")),
])
def test_a_bad_line_of_micro_win_is_told(target, block, said):
    _refused(target, block, *said)


def test_a_data_block_without_an_interval_asks_for_it():
    with pytest.raises(InputError, match="--called-every"):
        _read("s7-200-pid", "VD112 2.5\nVD116 3.0\nVD120 5.0\nVD124 0.0\n")
    with pytest.raises(InputError, match="--called-every"):
        _read("s5-ob251", bytes(98))


def test_a_changed_program_is_told():
    words = controller_for("s7-200").encode(DESIGN, Scaling())
    (text,) = _exported(words)
    read, remarks = _read("s7-200", text.replace("-I\tVW0, VW10", "-I\tVW2, VW10"))
    assert read.values == words.values
    assert "-I VW2, VW10, not -I VW0, VW10" in remarks[0]
    assert "differs from the exported one" in _read("s7-200", text.replace("\tENI\r\n", ""))[1][0]
    for old, new in (("=\tV1.0", "=\tV1.1"), ("LDW>=\tVW30", "LDW>\tVW30"), ("IB0", "IB1")):
        assert old in text
        assert _read("s7-200", text.replace(old, new))[1], old
    for target, name in (("s7-300", "s7_300_pid.awl"), ("fb41", "fb41_cont_c.awl")):
        text = controller_for(target).export(replace(words, target=target, values=controller_for(target).encode(
            DESIGN, Scaling()).values), SAID)[name]
        remarks = _read(target, text.replace("PIW 256", "PIW 258"), interval=5.0)[1]
        assert any("PIW 258" in rest and "differs from the exported one" in rest for rest in remarks)


# STEP 7: form of a data block's source as in Programming with STEP 7, chapter 13; parameters of FB41's table
FB41 = """\
DATA_BLOCK DB 7
TITLE =heater; zone 1
AUTHOR : HEAT
VERSION : 0.1
 "CONT_C"
BEGIN
   COM_RST := FALSE; MAN_ON := TRUE;
   PVPER_ON := TRUE; P_SEL := TRUE; I_SEL := TRUE; INT_HOLD := FALSE; I_ITL_ON := FALSE; D_SEL := FALSE;
   CYCLE := T#1S500MS;
   MAN := 0.000000e+000;
   GAIN := 2.500000e+000;  // %/degC
   TI := T#1M20S; TD := T#10S; TM_LAG := T#2S;
   DEADB_W := 0.0; LMN_HLM := 1.000000e+002; LMN_LLM := 0.0; PV_FAC := 1.0; PV_OFF := 0.0; LMN_FAC := 1.0; LMN_OFF := 0.0;
   I_ITLVAL := 0.0; DISV := 0.0;
   sInvAlt := 1.0;
END_DATA_BLOCK
"""


def test_an_instance_data_block_as_step_7_generates_it_is_read():
    read, over = _read("fb41", FB41, interval=1.5)
    v = read.values
    assert (v["CYCLE"], v["TI"], v["TD"], v["GAIN"], v["MAN_ON"], v["LMN_HLM"]) == (1500, 80000, 10000, 2.5, 1, 100.0)
    assert over == ("COM_RST := FALSE (line 7)", "sInvAlt := 1.0 (line 15)")
    for time, ms in (("T#1D2H3M4S5MS", 93784005), ("TIME#1.5S", 1500), ("t#20s", 20000), ("T#1H_30M", 5400000)):
        assert _read("fb41", FB41.replace("T#1M20S", time), interval=1.5)[0].values["TI"] == ms


def test_the_tips_data_block_is_read_from_initial_values_and_from_bits():
    text = ("DATA_BLOCK DB 100\nSTRUCT\n mode_req : BOOL ;\n GAIN : REAL := 1.0 ;\n RATE : REAL := 0.0; RESET : REAL := 9.0e4;\n"
            " SAMPLE : REAL := 5000.0;\nEND_STRUCT ;\nBEGIN\nEND_DATA_BLOCK\n")
    read, _ = _read("s7-300", text, interval=5.0)
    assert read.values == {"GAIN": 1.0, "RATE": 0.0, "RESET": 90000.0, "SAMPLE": 5000.0}
    # 40200000h is the single 2.5
    read, _ = _read("s7-300", text.replace(":= 1.0", ":= DW#16#40200000"), interval=5.0)
    assert read.values["GAIN"] == 2.5
    load = "ORGANIZATION_BLOCK OB 100\nBEGIN\n  L DW#16#40200000; // GAIN\n  T DB100.DBD 10;\nEND_ORGANIZATION_BLOCK\n"
    _refused("s7-300", text + load, "line 13", "GAIN", "DW#16#40200000", "1.0, as in line 4")


@pytest.mark.parametrize(("old", "new", "said"), [
    ("GAIN := 2.500000e+000;", "GAIN := 2.500000e+000", ("line 11", "NAME := VALUE ;")),
    ("GAIN := 2.500000e+000;", "GAIN := T#2S;", ("line 11", "GAIN", "'T#2S'", "REAL")),
    ("GAIN := 2.500000e+000;", "GIAN := 2.5;", ("GAIN (DBD20)",)),
    ("GAIN := 2.500000e+000;", "GAIN := 1.0e39;", ("line 11", "GAIN", "'1.0e39'")),
    ("GAIN := 2.500000e+000;", "GAIN := DW#16#140200000;", ("line 11", "GAIN", "'DW#16#140200000'", "REAL")),
    ("GAIN := 2.500000e+000;", "GAIN := DW#16#40G00000;", ("line 11", "GAIN", "'DW#16#40G00000'", "REAL")),
    ("T#1M20S", "80", ("line 12", "TI", "'80'", "TIME")),
    ("T#1M20S", "T#0.5MS", ("line 12", "TI")), ("T#1M20S", "T#20S1M", ("line 12", "TI")),
    ("BEGIN\n", "BEGIN GAIN := 2.6;\n", ("line 11", "GAIN", "2.6, as in line 6")),
    ("BEGIN\n", "BEGIN\n \"GAIN\" := 2.6\n", ("line 7", "NAME := VALUE ;")),
    ("MAN_ON := TRUE", "MAN_ON := YES", ("line 7", "MAN_ON", "'YES'")),
    ("END_DATA_BLOCK\n", "", ("line 1", "END_DATA_BLOCK")),
    ("END_DATA_BLOCK\n", "DATA_BLOCK DB 8\n", ("line 16", "END_DATA_BLOCK")),
    ("   sInvAlt := 1.0;", "   GAIN := 2.6;", ("line 15", "GAIN", "'2.6'", "2.500000e+000, as in line 11")),
    ("DATA_BLOCK", "BLOCK", ("no data block with MAN_ON",)),
])
def test_a_bad_line_of_a_source_is_told(old, new, said):
    _refused("fb41", FB41.replace(old, new, 1 if "END" not in old else -1), *said)


def test_two_controllers_in_one_source_are_not_guessed_between():
    _refused("fb41", FB41 + FB41.replace("DB 7", "DB 8"), "lines 1 and 17")


# WEG: names of the block's arguments and the sampling time of 50 ms from the WPS help (PID)
WEG = """\
Kp = 2,5
Ki: 0.02 1/s
Kd := 0.0;
TauSetPoint#   0.01 s
MinimumOutput = 0
MaximumOutput = 100 %
Type# = 0
Action# = 0
Ts# = 50 ms
SetPoint = 40
"""


def test_a_list_of_wegs_parameters_is_read():
    read, over = _read("weg", WEG)
    single = struct.unpack("f", struct.pack("f", 0.02))[0]
    assert (read.values["Kp"], read.values["Ki"], read.values["Ts"], read.sample_time_s) == (2.5, single, 50, 0.05)
    assert over == ("SetPoint := 40 (line 10)",)


CALL = """\
(* Kp := 9.0 was too much *)
PID_1.EN := TRUE; // held
PID_1(SetPoint := 40.0, Feedback := SCALE(AIW0), Kp := REAL#2.5, Ki := 0.02,
  Kd := 0.0, TauSetPoint := 0.0, MinimumOutput := 0.0, MaximumOutput := 100.0,
  Type := BYTE#0, Action := 16#0, Ts := UINT#50);
"""


def test_a_call_of_wegs_block_is_read_whatever_stands_in_comments():
    read, over = _read("weg", CALL)
    assert (read.values["Kp"], read.values["Ts"]) == (2.5, 50)
    assert over == ("SetPoint := 40.0 (line 3)", "Feedback := SCALE(AIW0) (line 3)",
                    "the program around the call: when it is called, what else switches the heater")


@pytest.mark.parametrize(("text", "said"), [
    (WEG.replace("50 ms", "0.05 s"), ("line 9", "Ts", "'0.05 s'", "ms")),
    (WEG.replace("= 2,5", "= 2,5,1"), ("line 1", "Kp", "'2,5,1'", "REAL")),
    (WEG.replace("Kp = 2,5\n", ""), ("Kp", "proportional gain")),
    (WEG.replace("= 100 %", "= 101"), ("line 6", "MaximumOutput", "'101'", "0…100")),
    (WEG.replace("Kd := 0.0;", "Kd"), ("line 3", "'Kd'", "Kp = 2.5")),
    (WEG + "Kp = 3\n", ("line 11", "Kp", "'3'", "2.5, as in line 1")),
    (CALL.replace("REAL#2.5", "Gain1"), ("line 3", "Kp", "'Gain1'")),
    (CALL.replace("Kd := 0.0", "0.0"), ("line 4", "'0.0'", "NAME := VALUE")),
    (CALL.replace("Kd := 0.0", "0.0\n"), ("line 4", "'0.0'", "NAME := VALUE")),
    (CALL + CALL, ("lines 3 and 8",)), ("PID_1.Kp := 3.0;\n" + CALL, ("line 4", "Kp", "'REAL#2.5'", "3.0, as in line 1")),
])
def test_a_bad_parameter_of_wegs_block_is_told(text, said):
    _refused("weg", text, *said)


# Intel HEX: revision A, 1988; the checksum is the two's complement of the sum of all bytes
@pytest.mark.parametrize(("change", "said"), [
    (lambda lines: [lines[0][:-2] + "00", *lines[1:]], ("line 1", "checksum", "'00'")),
    (lambda lines: [":0X" + lines[0][3:], *lines[1:]], ("line 1", "record")),
    (lambda lines: lines[1:], ("line 1", "address", "'0010'", "0000")),
    (lambda lines: lines[:-1], ("no record of kind 01",)),
    (lambda lines: [*lines, lines[0]], ("line 4", "nothing after")),
    (lambda lines: [":020000040000FA", *lines], ("line 1", "kind", "'04'")),
    (lambda lines: [lines[0], ":03" + lines[1][3:], *lines[2:]], ("line 2", "length", "'03'", "02")),
    (lambda lines: lines[-1:], ("0 bytes", "18")),
])
def test_a_bad_record_is_told(change, said):
    words = controller_for("on-off").encode(DESIGN, Scaling())
    (text,) = _exported(words)
    _refused("on-off", "\n".join(change(text.split())), *said)


def test_text_is_told_from_bytes_and_read_as_windows_writes_it():
    assert text_of(bytes(98)) is None
    assert text_of(b"") is None
    assert text_of("Kp = 2 %/°C".encode("cp1252")) == "Kp = 2 %/°C"
    assert text_of("﻿Kp".encode()) == "Kp"
    assert _read("weg", WEG.encode("utf-16"))[0].values["Kp"] == 2.5
    with pytest.raises(InputError, match="12 bytes"):
        _read("s5-ob251", b"1: KF = +01;", interval=4.0, source="DB30.bin")
    with pytest.raises(InputError, match="expected text"):
        _read("weg", bytes(8), interval=4.0)


def test_what_is_no_listing_at_all_is_refused_before_it_is_looked_through():
    _refused("weg", "Kp = 2\n" + 2000 * "x", "line 2", "'2000'", "1000 characters")
    _refused("weg", 600_000 * "(*\n", "1800000 characters")


@pytest.mark.long
@targets
def test_no_text_is_read_as_words_of_another_controller(target):
    words = _legal(target)
    for other in TARGETS:
        for text in _exported(words):
            if other != target:
                with pytest.raises(HeatertuneError):
                    _read(other, text, interval=5.0)


def test_realised_words_have_a_design_or_none():
    read, _ = _read("weg", WEG)
    assert realised_design(controller_for("weg"), read).gain_pct_per_degC == 2.5
    assert realised_design(controller_for("weg"), replace(read, values=dict(read.values, Kp=0.0))) is None
    with pytest.raises(OutOfRange, match="sample_time_s"):
        realised_design(controller_for("weg"), replace(read, sample_time_s=3.0))
