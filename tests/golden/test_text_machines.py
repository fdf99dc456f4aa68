"""The CPUs that run exported S5 and S7-300 programs in the proof, statement by statement.

S5: an independent machine of the operation list, `s5_machine`. S7-300: one likewise, `s7_machine`, for statements in any
order; NumPy's whole and single-precision numbers for the arithmetic; for bits, jumps and places by hand from "Statement
List for S7-300 and S7-400", and Siemens' own addresses of CONT_C's instance and of OB35's start information.
"""

import random
import warnings
from dataclasses import replace

import numpy as np
import pytest
from tests.golden.s5_machine import Machine
from tests.golden.s7_machine import Machine as S7Machine
from tests.golden.s7_machine import Stopped

from heatertune.errors import InputError
from heatertune.pid.design_values import PidDesign
from heatertune.plc import Certificate, Scaling, WordField, controller_for
from heatertune.plc.cpu.s5.machine import S5Cpu
from heatertune.plc.cpu.s7_300.machine import S7300Cpu as S7Cpu
from heatertune.plc.cpu.s7_300.machine import read
from heatertune.plc.cpu.s7_300.source import as_real, bits_of
from heatertune.plc.pwm import Actuator

WORD = (0, 1, -1, 5, -7, 255, 256, -256, 32767, -32768)


def statements(chance, count):
    """Return random statements of the S5, which jump forwards alone, to the last one's label."""
    data = [f"{name} {word}" for name in ("L  DW", "T  DW") for word in range(8)]
    bits = [f"{name} D {word}.{bit}" for name in ("TB", "SU", "RU") for word in (2, 5) for bit in (0, 6, 9, 15)]
    constants = ["L  KF +00300", "L  KF -00007", "L  KB 200", "L  KH FFF0", "L  KM 10000000 00000110"]
    others = ["TAK", "SRW 3", "SLW 2", "T  PY 4", "T  PW 130", "T  RS 97", "L  PW 128", "L  PW 132", "JU OB 251", "C  DB 31", "C  DB 30",
              "JC =LAST", "JU FB 31\n     :L  DW 1\n     :L  DW 3\n     :>F"]
    kinds = [data, data, bits, constants, others, others, [f"{name}F" for name in ("!=", "><", ">", ">=", "<", "<=", "+", "-")],
             ["A  I 0.0\n     :JC =LAST", "A  I 0.1\n     :BEC", "A  I 0.1\n     :JC =LAST"]]
    return [chance.choice(chance.choice(kinds)) for _ in range(count)]


def listing(chance):
    """Return a listing of two blocks and two data blocks; a block begins with words of its own in the accumulators."""
    text = []
    for number in (31, 30):
        body = ["C  DB 30", "L  DW 4", "L  DW 6", ">F", *(line for line in statements(chance, 25) if number == 30 or "FB 31" not in line)]
        if number == 30 and chance.random() < 0.3:
            body.insert(chance.randrange(4, 20), "JU =LAST")
        text += [f"FB {number}", "NAME :TEST", *(f"     :{line}" for line in body), "LAST :L  DW 3", "     :T  DW 7", "     :BE", ""]
    for number in (30, 31):
        text += [f"DB{number}", *(f"  {k:2}:  KF = {chance.choice(WORD):+06d};  remark" for k in range(7)), "   7:  KH = 8001;", ""]
    return "\n".join(["// a remark", *text])


def firmware(words):
    words[3], words[1] = (words[1] * 3 + words[2]) % 1000, words[1] // 2


def test_any_statements_of_an_s5_leave_what_they_leave_in_another_machine():
    chance, ran = random.Random(5), 0
    while ran < 40:
        text, inputs = listing(chance), {"PW 128": chance.choice(WORD), "PW 132": 0x9000}
        other, cpu = Machine(text, inputs.get, firmware), S5Cpu(text, {"OB 251": firmware})
        cpu.inputs |= inputs | {"I 0.1": 1}
        del cpu.inputs["PW 132"]
        inputs["PW 132"] = 0  # what is not wired
        other.inputs.add("I 0.1")
        try:
            other.call("FB 30")
        except AssertionError:  # it asserts that no sum overflows
            continue
        cpu.run("FB 30")
        assert (cpu.data, cpu.outputs) == (other.data, other.written), text
        ran += 1


@pytest.mark.parametrize(("statement", "word", "left"), [
    ("SLW 15", 3, -32768), ("SLW 1", 0x4000, -32768), ("SLW 0", -7, -7), ("SLW 4", -1, -16), ("SRW 15", -1, 1), ("SRW 1", -1, 32767),
    ("SRW 0", -7, -7), ("SRW 4", 255, 15)])
def test_an_s5_shifts_sixteen_bits_and_fills_up_with_zeros(statement, word, left):
    # S5-115U manual, chapter 8: SLW and SRW shift ACCU 1's word, vacated bits become 0
    cpu = S5Cpu(f"DB30\n   0:  KF = {word:+06d};\nFB 1\n     :C  DB 30\n     :L  DW 0\n     :{statement}\n     :T  DW 0\n     :BE\n", {})
    cpu.run("FB 1")
    assert cpu.data == {30: [left]}


def test_an_s5_reads_an_input_and_a_constant_as_signed_words_and_wraps_a_sum():
    # "+F" of 32767 and 1 overflows; ACCU 1 holds the 16 bits all the same (manual, chapter 8: OV is set, nothing is limited)
    cpu = S5Cpu("DB30\n   0:  KH = FFFF;\n   1:  KM = 10000000 00000000;\nFB 1\n     :C  DB 30\n     :L  PW 128\n     :L  KF +1\n     :+F\n"
             "     :T  DW 0\n     :BE\n", {})
    assert cpu.data == {30: [-1, -32768]}
    for given, kept in ((32767, -32768), (0xFFFF, 0), (-2, -1), (0x8000, -32767)):
        cpu.inputs["PW 128"] = given
        cpu.run("FB 1")
        assert cpu.data[30][0] == kept


@pytest.mark.parametrize("line", [
    ":JU =GONE", ":JC =GONE", ":JU FB 9", ":JU OB 9", ":L  DX 3", ":L  DW x", ":SLW x", ":C  DX 3", ":A  Q 1.0", ":T  PX 3", ":TB D 3",
    ":BE  3", ":BEC 3", ":TAK 3", ":+F  3", ":>F  3", "no statement"])
def test_what_an_s5_of_the_project_does_not_know_is_refused(line):
    with pytest.raises(InputError, match=r"known here|expected a block"):
        S5Cpu(f"FB 1\n     {line}\n     :BE\n", {})


@pytest.mark.parametrize("text", ["FB 1\n     :L  DW 1\n", "FB 1\n     :BE\nOB 1\n", "FB 1\n     :BE\n     :L  DW 1\n"])
def test_a_block_of_an_s5_ends_with_be(text):
    with pytest.raises(InputError, match="a block ends with BE"):
        S5Cpu(text, {})


# S7-300

HEAD = "DATA_BLOCK DB 1\nSTRUCT\n  A : DINT ;\n  B : DINT ;\n  C : DINT ;\n  BIT : BOOL ;\nEND_STRUCT ;\nBEGIN\nEND_DATA_BLOCK\n"
I32 = (0, 1, -1, 7, -7, 2, 100000, -65537, 65535, 32767, 32768, -32768, 2**31 - 1, -(2**31), 16777217)
REALS = (0.0, 1.0, -1.0, 0.5, -0.5, 1.5, 2.5, -2.5, 0.1, 1e-3, 3.4e7, -7.25, 123456.789)


def source(statements, *, more=HEAD, block="FUNCTION FC 1 : VOID", declared=()):
    return "\n".join([more, block, "TITLE =test", *declared, "BEGIN", "NETWORK", "TITLE =L 1", *(f"{line};  // remark" for line in statements),
                      f"END_{block.split()[0]}\n"])


S7_KINDS = [
    [f"L DB1.DBD {place}" for place in range(0, 24, 4)] * 2, [f"T DB1.DBD {place}" for place in range(0, 24, 4)],
    ["L DB1.DBW 24", "L DB1.DBW 2", "L DB1.DBB 5", "T DB1.DBW 24", "T DB1.DBW 10", "T DB1.DBB 9"],
    ["L 0", "L 7", "L -3", "L L#100000", "L L#-1", "L 1.0", "L -2.5", "L 0.0", "L 1.0e-30", "L 3.0e38"],
    ["TAK", "SRD 3", "ITD", "DTR", "RND", "TRUNC", "NOP 0", "CALL FC 2"], ["+R", "-R", "*R", "/R"], ["+D", "-D", "*D", "/D", "MOD", "AD", "+I", "-I"],
    [f"{sign}{kind}" for sign in ("==", "<>", ">", ">=", "<", "<=") for kind in "IDR"],
    [f"{name} DB1.DBX 26.{bit}" for name in ("A", "AN", "=", "S", "R") for bit in (0, 7)] + ["SET", "CLR"],
    ["JU", "JC", "JCN", "JOS", "JC", "JCN", "JOS", "BEU"]]


def s7_statements(chance, count, labels):
    """Return random statements, label, operation and operand each, which jump to labels ahead and, seldom, back."""
    lines = []
    for place in range(count):
        operation, _, operand = chance.choice(chance.choice(S7_KINDS)).partition(" ")
        if operation[0] == "J":
            operand = f"M{chance.randrange(labels) if chance.random() < 0.1 else min(labels - 1, place * labels // count + 1)}"
        lines.append(["", operation, operand])
    for label, place in enumerate(sorted(chance.sample(range(count), labels))):
        lines[place][0] = f"M{label}"
    return lines


def twice(cpu):
    for _ in range(2):
        cpu.run("FC 1")


@pytest.mark.long
def test_any_statements_of_an_s7_300_leave_what_they_leave_in_another_machine():
    chance, ended, stopped = random.Random(7), 0, 0
    while ended < 250:
        called = [line for line in s7_statements(chance, 8, 2) if line[1] != "CALL"]
        blocks = {"FC 1": s7_statements(chance, 30, 6), "FC 2": called if {line[0] for line in called} >= {"M0", "M1"} else []}
        text = {name: [f"{label + ': ' if label else ''}{operation} {operand}".strip() for label, operation, operand in lines]
                for name, lines in blocks.items()}
        data = b"".join(value.to_bytes(4, "big") for value in chance.choices([*(u32(each) for each in I32), *map(bits_of, REALS), 0x7F800001], k=6)) + bytes(4)
        other, cpu = S7Machine(blocks, data), S7Cpu(source(text["FC 2"], more="DATA_BLOCK DB 1\nSTRUCT\n  A : DINT ;\nEND_STRUCT ;\nBEGIN\nEND_DATA_BLOCK\n",
                                                           block="FUNCTION FC 2 : VOID") + source(text["FC 1"], more=""), {})
        cpu.memory["DB 1"][:28] = data
        try:
            twice(other)
        except Stopped:
            with pytest.raises(InputError, match="the CPU"):
                twice(cpu)
            stopped += 1
            continue
        twice(cpu)
        assert cpu.memory["DB 1"][:28] == other.data, text
        assert (cpu.one, cpu.two, cpu.true, cpu.os) == (other.one, other.two, other.true, other.os), text
        ended += 1
    assert stopped > 25


def made(operation, then=("T DB1.DBD 8",), head=("L DB1.DBD 0", "L DB1.DBD 4")):
    """Return what an operation makes of the double words 0 and 4: the double word 8 and the bit 12.0, of 32 bits each."""
    cpu = S7Cpu(source([*head, operation, *then]), {})

    def run(two, one):
        cpu.memory["DB 1"][:8] = int(two).to_bytes(4, "big") + int(one).to_bytes(4, "big")
        cpu.run("FC 1")
        return int.from_bytes(cpu.memory["DB 1"][8:12], "big"), cpu.memory["DB 1"][12] & 1

    return run


def u32(value):
    return int(value) % 2**32


def quotient32(two, one):
    return int(np.trunc(np.float64(two) / np.float64(one)))


@pytest.mark.parametrize(("operation", "kind", "expected"), [
    ("+D", np.int64, lambda two, one: two + one), ("-D", np.int64, lambda two, one: two - one), ("*D", np.int64, lambda two, one: two * one),
    ("/D", np.int64, lambda two, one: quotient32(two, one) if one else None),
    ("MOD", np.int64, lambda two, one: np.fmod(two, one) if one else None),
    ("AD", np.int64, lambda two, one: two & one), ("TAK", np.int64, lambda two, _: two), ("SRD 12", np.int64, lambda _, one: u32(one) >> 12),
    ("ITD", np.int64, lambda _, one: np.int64(one).astype(np.int16)), ("NOP 0", np.int64, lambda _, one: one),
    ("+I", np.int64, lambda two, one: (u32(one) & 0xFFFF0000) | u32(two + one) & 0xFFFF),
    ("-I", np.int64, lambda two, one: (u32(one) & 0xFFFF0000) | u32(two - one) & 0xFFFF),
    ("DTR", np.int64, lambda _, one: np.float32(one).view(np.uint32)),
    ("RND", np.float32, lambda _, one: np.rint(one)), ("TRUNC", np.float32, lambda _, one: np.trunc(one)),
    ("+R", np.float32, lambda two, one: (two + one).view(np.uint32)), ("-R", np.float32, lambda two, one: (two - one).view(np.uint32)),
    ("*R", np.float32, lambda two, one: (two * one).view(np.uint32)),
    ("/R", np.float32, lambda two, one: (two / one).view(np.uint32) if one else None)])
def test_arithmetic_of_the_s7_300_is_numpys(operation, kind, expected):
    run = made(operation)
    for two in I32 if kind is np.int64 else REALS:
        for one in I32 if kind is np.int64 else REALS:
            wanted = expected(kind(two), kind(one))
            bits = [u32(value) if kind is np.int64 else int(np.float32(value).view(np.uint32)) for value in (two, one)]
            if wanted is not None:
                assert run(*bits)[0] == u32(wanted), (two, operation, one)


@pytest.mark.parametrize(("operation", "two", "one"), [
    ("RND", 0, bits_of(-2.5)), ("TRUNC", 0, bits_of(-2.5)), ("ITD", 0, 0xFFFE), ("-D", 1, 3), ("+D", 2**32 - 1, 2**32 - 1), ("*D", 2, 2**32 - 1),
    ("/D", 2**32 - 2, 1), ("MOD", 2**32 - 2, 3)])
def test_an_accumulator_holds_32_bits(operation, two, one):
    assert made(operation, ("SRD 1", "T DB1.DBD 8"))(two, one)[0] == (2**32 - 2) >> 1


@pytest.mark.parametrize("then", [["TAK", "T DB1.DBD 8"], ["JC on", "on: TAK", "T DB1.DBD 8"], ["L DB1.DBD 0", "T DB1.DBD 8"]])
def test_what_is_asked_for_as_a_real_keeps_its_bits_even_where_they_are_no_number(then):
    assert made("==R", then)(0x7F800001, 0)[0] == 0x7F800001


@pytest.mark.parametrize("line", ["L DB1.DBD 4000", "T DB1.DBD 1022", "L PIW 1023"])
def test_a_place_beyond_its_memory_is_none_of_an_s7_300(line):
    with pytest.raises(InputError, match=f"statement '{line}'; this is none that is known here"):
        S7Cpu(source([line]), {})


@pytest.mark.parametrize("kind", ["I", "D", "R"])
@pytest.mark.parametrize(("sign", "asks"), [
    ("==", np.equal), ("<>", np.not_equal), (">", np.greater), (">=", np.greater_equal), ("<", np.less), ("<=", np.less_equal)])
def test_comparisons_of_the_s7_300_ask_whether_accumulator_2_is_so_to_1(kind, sign, asks):
    run = made(f"{sign}{kind}", ["= DB1.DBX 12.0"])
    means = {"I": lambda bits: np.uint32(bits).astype(np.int16), "D": lambda bits: np.uint32(bits).view(np.int32),
             "R": lambda bits: np.uint32(bits).view(np.float32)}[kind]
    for two in (0, 1, 0x3F800000, 0xBF800000, 0x0000FFFF, 0xFFFF0001, 0x00008000):
        for one in (0, 1, 0x3F800000, 0xBF800000, 0x0000FFFF, 0xFFFF0001, 0x00008000):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # a pattern that is no number
                assert run(two, one)[1] == asks(means(two), means(one)), (two, sign, one)


@pytest.mark.parametrize(("text", "bits"), [
    ("TRUE", 1), ("FALSE", 0), ("T#3000MS", 3000), ("DW#16#FFF", 4095), ("L#-1", 0xFFFFFFFF), ("L#70000", 70000), ("-1", 0xFFFF), ("27648", 27648),
    ("1.50000000e+000", 0x3FC00000), ("-2.5", 0xC0200000)])
def test_constants_of_the_s7_300_are_their_bits(text, bits):
    assert made("NOP 0", head=(f"L {text}",))(0, 0)[0] == bits


#: by hand; RLO begins anew after =, S, R, SET, CLR and every jump, JC and JCN set it, a comparison is the first of a series
@pytest.mark.parametrize(("lines", "inputs", "outputs"), [
    (["A I 0.0", "A I 0.1", "= Q 4.0"], 0b01, 0), (["A I 0.0", "A I 0.1", "= Q 4.0"], 0b10, 0), (["A I 0.0", "A I 0.1", "= Q 4.0"], 0b11, 1), (["A I 0.0", "AN I 0.1", "= Q 4.1"], 0b01, 2),
    (["AN I 0.0", "AN I 0.1", "= Q 4.0"], 0b10, 0), (["AN I 0.0", "= Q 4.0", "A I 0.1", "= Q 4.7"], 0b10, 0x81),
    (["SET", "= Q 4.0", "CLR", "= Q 4.1"], 0, 1), (["SET", "S Q 4.3", "CLR", "S Q 4.4", "R Q 4.3"], 0, 8), (["SET", "S Q 4.3", "R Q 4.3"], 0, 0),
    (["SET", "A I 0.0", "= Q 4.0"], 1, 1), (["CLR", "A I 0.0", "= Q 4.0"], 1, 1),
    (["L 1", "L 2", "<I", "A I 0.0", "= Q 4.0"], 0, 0), (["L 2", "L 1", "<I", "A I 0.0", "= Q 4.0"], 1, 0),
    (["A I 0.0", "JC on", "SET", "= Q 4.0", "on: SET", "= Q 4.1"], 1, 2), (["A I 0.0", "JC on", "SET", "= Q 4.0", "on: SET", "= Q 4.1"], 0, 3),
    (["A I 0.0", "JCN on", "SET", "= Q 4.0", "on: SET", "= Q 4.1"], 1, 3), (["A I 0.0", "JCN on", "SET", "= Q 4.0", "on: SET", "= Q 4.1"], 0, 2),
    (["A I 0.0", "JC on", "S Q 4.0", "on: NOP 0"], 0, 1), (["A I 0.0", "JCN on", "NOP 0", "on: S Q 4.0"], 0, 1),
    (["CLR", "JU on", "NOP 0", "on: S Q 4.0"], 0, 0), (["A I 0.0", "JU on", "NOP 0", "on: A I 0.1", "= Q 4.0"], 0b10, 1),
    (["A I 0.0", "JC on", "on: A I 0.1", "= Q 4.0"], 0b10, 1), (["SET", "= Q 4.0", "BEU", "SET", "= Q 4.1"], 0, 1),
    (["L 1.0e38", "L 1.0e38", "*R", "JOS os", "BEU", "os: SET", "= Q 4.0", "JOS os", "SET", "= Q 4.1"], 0, 3),  # JOS clears OS
    (["L 1.0", "L 1.0", "+R", "JOS os", "BEU", "os: SET", "= Q 4.0"], 0, 0), (["L 1.0", "L 0.0", "/R", "JOS os", "BEU", "os: SET", "= Q 4.0"], 0, 1),
    (["L 1.0e-30", "L 1.0e-30", "*R", "L 1.0", "L 1.0", "-R", "JOS os", "BEU", "os: SET", "= Q 4.0"], 0, 1),
    (["L 3.0e38", "L -3.0e38", "-R", "JOS os", "BEU", "os: SET", "= Q 4.0"], 0, 1),
    (["L 5", "T QB 4", "L IB 0", "L QB 4", "+I", "T QB 4"], 2, 7), (["L 513", "T QW 4"], 0, 2), (["L PIW 256", "T QB 4"], 0, 0x34)])
def test_bits_and_jumps_of_the_s7_300_are_those_of_its_manual(lines, inputs, outputs):
    cpu = S7Cpu(source(lines), {})
    cpu.memory["I"][0], cpu.memory["P"][256:258] = inputs, b"\x12\x34"
    for _ in range(2):  # nothing is left of a pass but OS, which the programs clear
        cpu.run("FC 1")
        assert cpu.memory["Q"][4] == outputs


def test_members_stand_where_siemens_puts_them():
    """CONT_C's instance as its manual has it, a ninth bit, bytes behind bits; OB35's start information of 20 bytes."""
    bits = ("COM_RST", "MAN_ON", "PVPER_ON", "P_SEL", "I_SEL", "INT_HOLD", "I_ITL_ON", "D_SEL")
    declared = [*(f"{name} : BOOL ;" for name in bits), "CYCLE : TIME ;", "SP_INT : REAL ;", "PV_IN : REAL ;", "PV_PER : WORD ;", "MAN : REAL ;",
                "NINE : BOOL ;", "ODD : BYTE ;", "EVEN : INT ;", "LAST : DINT ;"]
    temporary = ["KIND : BYTE ;", "INFO : BYTE ;", "PRIORITY : BYTE ;", "NUMBER : BYTE ;", "R1 : BYTE ;", "R2 : BYTE ;", "OFFSET : WORD ;", "R3 : INT ;",
                 "FREQ : INT ;", "DATE : DATE_AND_TIME ;", "MINE : INT ;"]
    text = source(["L 258", "T #FREQ", "T #MAN", "L 7", "T #MINE", "T #PV_PER", "L 9", "T #EVEN", "SET", "= #D_SEL", "CLR", "= #MAN_ON"],
                  more="", block="FUNCTION_BLOCK FB 5", declared=["VAR_INPUT", *declared, "END_VAR", "VAR_TEMP", *temporary, "END_VAR"])
    cpu = S7Cpu(text + "DATA_BLOCK DB 9\nFB 5\nBEGIN\n  MAN_ON := TRUE ;\n  CYCLE := T#258MS ;\n  LAST := L#-2 ;  // remark\nEND_DATA_BLOCK\n"
             + source(["CALL FB 5 , DB 9 (NINE := TRUE, ODD := IB 1)"], more=""), {})
    own = {line.split()[0] for line in declared}
    places = {name: (place.memory, place.byte, place.bit, place.size) for name, place in cpu.members["DB 9"].items() if name in own}
    assert places == {**{name: ("DB 9", 0, k, 0) for k, name in enumerate(bits)}, **{name: ("DB 9", byte, 0, size) for name, byte, size in [
        ("CYCLE", 2, 4), ("SP_INT", 6, 4), ("PV_IN", 10, 4), ("PV_PER", 14, 2), ("MAN", 16, 4), ("NINE", 20, 0), ("ODD", 21, 1), ("EVEN", 22, 2),
        ("LAST", 24, 4)]}}
    before = cpu.memory["DB 9"]
    assert (before[0], before[2:6].hex(), before[24:28].hex()) == (2, "00000102", "fffffffe")
    cpu.memory["I"][1] = 0xA5
    cpu.run("FC 1")
    assert (before[0], before[14:28].hex()) == (0x80, "0007" + "00000102" + "01a5" + "0009" + "fffffffe")
    written = cpu.memory["L FB 5"]
    assert (written[10:12].hex(), written[20:22].hex(), set(written[:10] + written[12:20] + written[22:])) == ("0102", "0007", {0x5A}), (
        "what is not written is whatever was there")


def test_a_block_that_is_not_in_the_source_is_the_firmwares_and_in_and_out_come_back():
    text = ("DATA_BLOCK DB 41\nFB 41\nBEGIN\n  GAIN := 2.5 ;\nEND_DATA_BLOCK\n" + source(
        ["L #IO", "L 3", "+I", "T #IO"], more="", block="FUNCTION_BLOCK FB 5", declared=["VAR_IN_OUT", "IO : INT ;", "END_VAR"])
        + "DATA_BLOCK DB 5\nFB 5\nBEGIN\nEND_DATA_BLOCK\n"
        + source(["CALL FB 41 , DB 41 (SP := IW 2, ON := TRUE)", "CALL FB 5 , DB 5 (IO := QW 6)", "L #GONE", "T QW 8"],
                 more="", declared=["VAR_TEMP", "GONE : INT ;", "END_VAR"]))
    called = []
    cpu = S7Cpu(text, {"FB 41": lambda _, words: called.append(dict(words))})
    cpu.memory["I"][2:4], cpu.memory["Q"][6:8] = b"\x01\x02", b"\x00\x09"
    cpu.run("FC 1")
    assert called == [{"GAIN": bits_of(2.5), "SP": 0x0102, "ON": 1}]
    assert cpu.memory["Q"][6:8].hex() == "000c"


@pytest.mark.parametrize(("target", "file"), [("s7-300", "s7_300_pid.awl"), ("fb41", "fb41_cont_c.awl")])
def test_a_program_is_loaded_in_manual_and_with_the_heater_off(target, file):
    which = controller_for(target)
    words = which.encode(PidDesign(gain_pct_per_degC=2.5, integral_time_s=40.0, derivative_time_s=0.0, sample_time_s=3.0, structure="pi",
                                   method=""), Scaling(low_degC=20.0, high_degC=120.0))
    told = Certificate(verdict="PASS", setpoint_degC=53.3, actuator=Actuator(pwm_period_s=3.0, resolution_s=0.1))
    plain = S7Cpu(which.export(words, told)[file], dict.fromkeys(("FB 41", "FB 43"), lambda *_: None))
    asked = plain.get(plain.members["DB 101"]["SP"])
    assert {"s7-300": 20.0 + 100.0 * asked / 27648, "fb41": as_real(asked)}[target] == pytest.approx(53.3, abs=100.0 / 27648)
    words = replace(words, ramp=which.ramp(words, 5.0))
    text = which.export(words, told)[file]
    cpu = S7Cpu(text, dict.fromkeys(("FB 41", "FB 43"), lambda *_: None))
    bits = {name: cpu.get(place) for name, place in cpu.members["DB 101"].items() if place.size == 0}
    assert bits == {"AUTO": 0, "FAULT": 0, "WRONG_CLOCK": 0, "HEAT": 0, "BEGUN": 0}


def test_a_dump_that_ends_with_a_bit_is_read():
    fields = [WordField(name=name, address=address, format="BOOL", low=0, high=1, comment="") for name, address in (("A", "DBX0.3"), ("B", "DBX1.0"))]
    assert read(b"\x08\x01", fields, "dump") == {"A": 1, "B": 1}
    with pytest.raises(InputError, match="1 bytes; expected 2"):
        read(b"\x08", fields, "dump")


@pytest.mark.parametrize("line", ["XYZ", "T 3", "A 3", "= 3", "L #GONE", "L DB1.DBZ 3", "JU gone", "CALL OB 3", "==X", "+X", "L S5T#1S"])
def test_what_an_s7_of_the_project_does_not_know_is_refused(line):
    with pytest.raises((InputError, KeyError)):
        S7Cpu(source([line]), {})
