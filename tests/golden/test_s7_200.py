"""The S7-200 against figures worked out from its manual in the project's PLC page, section 2.4, and against exact sums."""

import numpy as np
import pytest

from heatertune.errors import NotRepresentable, OutOfRange
from heatertune.pid.values import PidDesign
from heatertune.plc import Certificate, Scaling, room
from heatertune.plc.s7_200 import paper_words
from heatertune.plc.s7_200.arithmetic import add_word, divide, high_word, multiply, subtract_word
from heatertune.plc.s7_200.program import Constants, Memory, printed_scan, repaired_scan

ROOM = room("s7-200")
PLAIN = Constants(kp=20, ki=0, kd=0, t=1, cycle_ms=1000, scale_bits=16, pot1=0, wrap=False, next_cycle=False,
                  stops_at_rails=True)


def _pi(gain=3.0, tn=300.0, ta=7.0):
    return PidDesign(
        gain_pct_per_degC=gain, integral_time_s=tn, derivative_time_s=0.0, sample_time_s=ta, structure="pi", method=""
    )


def test_the_error_word_flips_its_sign_without_a_flag_beyond_128_counts():
    # SP = 200, PV = 50: −27136 instead of 38400, SM1.1 not set
    after = printed_scan(PLAIN, Memory(), 200, 50, False)
    assert (after.error, after.overflow) == (-27136, False)


def test_the_error_word_overflows_across_128_counts_and_keeps_the_setpoint():
    # SP = 130, PV = 120: signed operands −32256 and 30720; SM1.1 set, a 22x keeps the old VW10, the setpoint word
    assert subtract_word(-32256, 30720, wrap=False) == (-32256, True)
    after = printed_scan(PLAIN, Memory(), 130, 120, False)
    assert (after.error, after.overflow) == (-32256, True)
    assert printed_scan(PLAIN._replace(wrap=True), Memory(), 130, 120, False).error == 2560


def test_the_second_product_reads_only_the_low_word_of_the_first():
    # two errors of 40 counts, Ki = 3, T = 5: −20480 instead of +307200
    error = 256 * 40
    assert multiply(5, multiply(3, error + error)) == -20480


def test_div_leaves_its_remainder_in_the_high_word():
    assert divide(7, 2) == (65539, False)
    assert divide(-7, 2) == ((-1 << 16) | (-3 & 0xFFFF), False)
    assert divide(7, 0) == (7, True)


@pytest.mark.parametrize(("gain", "last_dead"), [(20, 12), (60, 4)])
def test_the_dead_zone_of_a_gain_is_that_of_the_plc_page(gain, last_dead):
    def change(counts):
        memory = Memory()
        for _ in range(2):
            memory = printed_scan(PLAIN._replace(kp=gain), memory, 100 + counts, 100, False)
        return memory.change

    assert [change(n) for n in range(last_dead + 2)] == [0] * (last_dead + 1) + [1]
    assert change(-1) == -1


@pytest.mark.parametrize("width", [0, 1000])
def test_the_printed_program_sticks_at_its_rails(width):
    stuck = Memory(width=width, applied=width, change=-5 if width else 5, scans=10)
    for _ in range(5):
        stuck = printed_scan(PLAIN, stuck, 100, 120 if width else 60, True)
    assert stuck.width == width
    free = printed_scan(PLAIN._replace(stops_at_rails=False), stuck, 100, 120 if width else 60, True)
    assert free.width != width


def test_words_and_double_words_are_signed():
    assert high_word(-1) == -1
    assert high_word(65536 * 3 + 5) == 3
    assert add_word(32767, 1, wrap=True) == (-32768, True)


def test_the_repaired_program_is_the_velocity_pi_of_its_words_in_exact_numbers():
    words = ROOM.encode(_pi(), Scaling())
    v = words.values
    readings = np.random.default_rng(2).integers(90, 110, 200)
    state, total, last = ROOM.start(words, {}), 3500.0, 0
    state = state._replace(memory=Memory(width=3500, applied=3500))
    for reading in readings.tolist():
        state, scan = ROOM.step(words, state, 100, reading, {})
        error = 100 - reading
        # width change per cycle [ms]: KD/2^S·256·(E − E_prev) + KP/2^S·256·E_prev, nothing lost but the last fraction
        total += (v["KD"] * (error - last) + v["KP"] * last) * 256 / 2 ** v["SCALE"]
        last = error
        assert 1.0 < total < v["CYCLE"] - 1.0, "the run must stay off the limits to be comparable"
        assert scan.output == pytest.approx(total, abs=1.0 + 1e-9)


def test_no_pair_of_readings_overflows_the_repaired_program():
    words = ROOM.encode(_pi(gain=30.0, tn=40.0, ta=20.0), Scaling(low_degC=0.0, high_degC=400.0))
    c = ROOM.start(words, {}).constants
    corners = [(sp, pv) for sp in (0, 255) for pv in (0, 255)]
    sums = []
    for first in corners:
        before = repaired_scan(c, Memory(rest=(1 << c.scale_bits) - 1), *first)
        for second in corners:
            after = repaired_scan(c, before._replace(rest=(1 << c.scale_bits) - 1), *second)
            sums.append(abs((after.change << c.scale_bits) + after.rest))
    assert 2**29 < max(sums) < 2**31  # the corners are the extremes of a bilinear form


def test_the_words_come_back_as_the_design():
    words = ROOM.encode(_pi(), Scaling())
    back = ROOM.decode(words)
    assert back.gain_pct_per_degC == pytest.approx(3.0, rel=1e-3)
    assert back.integral_time_s == pytest.approx(300.0, rel=5e-3)
    assert back.sample_time_s == 7.0


def test_what_the_program_cannot_do_is_refused_with_a_remedy():
    pid = PidDesign(gain_pct_per_degC=3.0, integral_time_s=300.0, derivative_time_s=20.0, sample_time_s=7.0,
                    structure="pid", method="")
    with pytest.raises(NotRepresentable, match="--structure pi"):
        ROOM.encode(pid, Scaling())
    with pytest.raises(NotRepresentable, match=r"TA.*32\.767"):
        ROOM.encode(_pi(ta=40.0), Scaling())
    with pytest.raises(OutOfRange, match="PRINTED"):
        ROOM.decode(paper_words(gain=20))


def test_the_export_loads_the_cycle_time_and_calls_pls():
    words = ROOM.encode(_pi(), Scaling())
    files = ROOM.export(words, Certificate(verdict="PASS"))
    subroutine = files["s7_200_init.awl"]
    assert "\tMOVB\t16#CB, SMB67\r\n" in subroutine
    assert "\tMOVW\t+7000, SMW68\r\n" in subroutine
    assert subroutine.index("SMW68") < subroutine.index("PLS")
    assert f"VW204\t{words.values['KD']}\t// KD" in files["s7_200_constants.txt"]
    assert ROOM.export(words, Certificate(verdict="PASS")) == files
