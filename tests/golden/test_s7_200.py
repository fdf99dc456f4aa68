"""The S7-200 programs: figures worked out from the manual in the project's PLC page, section 2.4; exact sums; and the
statement list that is exported against direct emulations beside this file, which know nothing of it."""

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from tests.golden import printed, repaired

from heatertune.compiled import compile_function
from heatertune.errors import InputError, NotRepresentable, OutOfRange
from heatertune.model.model_values import Fopdt
from heatertune.pid.design_values import PidDesign, structure_of
from heatertune.plc import Certificate, Scaling, Words, controller_for
from heatertune.plc.cpu.s7_200 import COLD, assemble, run
from heatertune.plc.cpu.s7_200 import io_and_cycle as cycle
from heatertune.plc.cpu.s7_200.assembler import block_number
from heatertune.plc.cpu.s7_200.cpu import add_integers, carry_out, divide_integers, high_word, multiply_integers
from heatertune.plc.cpu.s7_200.io_and_cycle import own, run_cycle, timed_program
from heatertune.plc.s7_200.controller import COUNTDOWN, repaired_program
from heatertune.plc.s7_200_paper import step
from heatertune.plc.s7_200_paper.export import faults, printed_program
from heatertune.plc.s7_200_paper.step import S7200PaperAssumptions
from heatertune.plc.s7_200_paper.words import paper_words
from heatertune.proof import Scenario, simulate

ROOM = controller_for("s7-200")
PAPER = controller_for("s7-200-paper")
PLAIN = printed.Constants(kp=20, ki=0, kd=0, t=1, cycle_ms=1000, pot1=0)
HEATER = Fopdt(gain_degC_per_pct=0.4, time_constant_s=150.0, dead_time_s=10.0, ambient_degC=20.0)


def _design(gain=3.0, tn=300.0, tv=0.0, ta=7.0):
    return PidDesign(gain_pct_per_degC=gain, integral_time_s=tn, derivative_time_s=tv, sample_time_s=ta,
                     structure=structure_of(tn, tv), method="")


# the arithmetic, and the program as printed


def test_the_error_word_flips_its_sign_without_a_flag_beyond_128_counts():
    # SP = 200, PV = 50: −27136 instead of 38400, SM1.1 not set
    after = printed.scan(PLAIN, printed.Memory(), 200, 50, False)
    assert (after.error, after.overflow) == (-27136, False)


def test_the_error_word_overflows_across_128_counts_and_keeps_the_setpoint():
    # SP = 130, PV = 120: signed operands −32256 and 30720; SM1.1 set, a 22x keeps the old VW10, the setpoint word
    assert add_integers(-32256, -30720, 16, wrap=False) == (-32256, True)
    after = printed.scan(PLAIN, printed.Memory(), 130, 120, False)
    assert (after.error, after.overflow) == (-32256, True)
    assert printed.scan(PLAIN._replace(assume=S7200PaperAssumptions(wrap=True)), printed.Memory(), 130, 120, False).error == 2560


def test_the_second_product_reads_only_the_low_word_of_the_first():
    # two errors of 40 counts, Ki = 3, T = 5: −20480 instead of +307200
    error = 256 * 40
    assert multiply_integers(5, multiply_integers(3, error + error)) == -20480


def test_div_leaves_its_remainder_in_the_high_word():
    assert divide_integers(7, 2) == (65539, False)
    assert divide_integers(-7, 2) == ((-1 << 16) | (-3 & 0xFFFF), False)
    assert divide_integers(7, 0) == (7, True)


@pytest.mark.parametrize(("gain", "last_dead"), [(20, 12), (60, 4)])
def test_the_dead_zone_of_a_gain_is_that_of_the_plc_page(gain, last_dead):
    def change(counts):
        memory = printed.Memory()
        for _ in range(2):
            memory = printed.scan(PLAIN._replace(kp=gain), memory, 100 + counts, 100, False)
        return memory.change

    assert [change(n) for n in range(last_dead + 2)] == [0] * (last_dead + 1) + [1]
    assert change(-1) == -1


@pytest.mark.parametrize("width", [0, 1000])
def test_the_printed_program_sticks_at_its_rails(width):
    stuck = printed.Memory(width=width, applied=width, change=-5 if width else 5, scans=10)
    for _ in range(5):
        stuck = printed.scan(PLAIN, stuck, 100, 120 if width else 60, True)
    assert stuck.width == width
    free = printed.scan(PLAIN._replace(assume=S7200PaperAssumptions(stops_at_rails=False)), stuck, 100, 120 if width else 60, True)
    assert free.width != width


def test_without_a_loaded_cycle_time_a_width_of_2_ms_is_all_on():
    # System Manual: the register defaults to 0, a cycle below 2 units is 2 units, a width of the cycle is permanently on
    c = PLAIN._replace(assume=S7200PaperAssumptions(loads_cycle=False))
    assert [printed.power_pct(c, w) for w in (0, 1, 2, 500)] == [0.0, 50.0, 100.0, 100.0]


def test_the_printed_programs_last_sum_overflows_as_worked_out_by_hand():
    # KP·E_prev = 32767·20000 = 655340000; KD·(E − E_prev) = −4·(49·256 − 20000) = 29824, DIV by 32767 leaves it in the high
    # word: 29824·65536 = 1954545664; together above 2^31 − 1, so AC0 stays and its high word is 655340000 // 65536 = 9999
    c = PLAIN._replace(kp=32767, kd=-4, t=32767)
    after = printed.scan(c, printed.Memory(error=20000), 49, 0, False)
    assert (after.change, after.overflow, after.zero_division) == (9999, True, False)
    calm = printed.scan(c._replace(kd=-3), printed.Memory(error=20000), 49, 0, False)
    assert (calm.change, calm.overflow) == ((655340000 + 22368 * 65536) // 65536, False)


def test_words_and_double_words_are_signed():
    assert high_word(-1) == -1
    assert high_word(65536 * 3 + 5) == 3
    assert add_integers(32767, 1, 16, True) == (-32768, True)


def test_the_faults_are_counted_over_all_pairs_of_bytes():
    words = paper_words(gain=20, ki=3, t=5)
    wrong = 0  # by the direct emulation, pair by pair
    c = printed.constants(words, {})
    for setpoint in range(256):
        for reading in range(0, 256, 5):
            found = printed.scan(c, printed.Memory(), setpoint, reading, False).error
            wrong += found != 256 * (setpoint - reading)
    assert wrong == 256 * 52 // 2  # half of them: both on one side of 128 are right
    told = faults(words)
    assert told[0].endswith("32768 of 65536 pairs of setpoint and reading")
    assert len(told) == 6
    assert len(faults(paper_words(gain=20))) == 4  # nothing is multiplied by Ki = 0


def test_the_faults_are_counted_with_analog_adjustment_1_in_the_error():
    # by hand: E = 256·(SP − PV) + POT1 is right on one side of 128 for every POT1, so half of the pairs stay wrong; with
    # KD = 1, T = 256 and POT1 = 1 every DIV leaves 1, or what is left of 256·SP + 1; with POT1 = 0 none leaves anything
    for pot1, left in ((0, []), (1, ["65536 of 65536"])):
        words = paper_words(gain=20)
        told = faults(replace(words, values=dict(words.values, KD=1, T=256, POT1=pot1)))
        assert "32768 of 65536" in told[0]
        assert [line.partition(": ")[2].partition(" pairs")[0] for line in told if line.startswith("DIV")] == left


def test_a_start_up_of_the_printed_program_makes_no_pulse_before_it_computed_one():
    cold = running = PAPER.start(paper_words(gain=20), {})
    for _ in range(40):
        running, scan = PAPER.step(running, 120, 60)
    assert scan.power_pct > 0.0
    again = running._replace(state=PAPER.core.warm_start(running.parameters, cold.state, running.state))
    assert PAPER.step(again, 120, 60)[1].power_pct == 0.0


def test_the_edge_of_the_first_scan_is_served_in_the_third():
    # DIFFERENCES.md; by hand: E = 256·50, VW100 = ⌊20·E/65536⌋ = 3 from the second scan on, added where Q0.0 has risen
    memory, widths = printed.Memory(), []
    for _ in range(5):
        memory = printed.scan(PLAIN, memory, 110, 60, False)
        widths.append((memory.change, memory.width))
    assert widths == [(0, 0), (3, 0), (3, 3), (3, 3), (3, 3)]


def test_the_papers_constants_are_those_of_its_equation_in_the_longest_cycle_that_they_fit():
    words = PAPER.encode(_design(gain=6.0), Scaling(low_degC=0.0, high_degC=255.0))
    v = words.values
    # 1 °C per count, errors times 256, VW100 = AC0/65536: Kp/256 ms per count are 6 % of the cycle
    assert 256 * 0.06 * v["CYCLE"] <= 32767 < 256 * 0.06 * (v["CYCLE"] + 100)
    assert v["KP"] == round(256 * 0.06 * v["CYCLE"])
    assert v["KI"] == round(256 * 0.06 * v["CYCLE"] * v["CYCLE"] / 1000 / 300 / 2)
    assert (v["KD"], v["T"], v["CYCLE"] % 100) == (0, 1, 0)


# the machine


def _block(*lines):
    return "ORGANIZATION_BLOCK MAIN:OB1\nBEGIN\nNetwork 1\n" + "".join(f"\t{line}\n" for line in lines) + "END_ORGANIZATION_BLOCK\n"


def test_the_machine_does_what_the_manual_says_of_single_instructions():
    text = _block(
        "LD\tSM0.0", "MOVW\t+7, VW2", "MOVW\t+7, AC0", "DIV\t+2, AC0", "MOVD\tAC0, VD4",  # 65539
        "MOVW\t+32767, VW8", "+I\t+1, VW8",  # kept, SM1.1
        "MOVD\t16#80000000, AC1", "SRD\tAC1, 31", "MOVD\tAC1, VD12", "MOVB\t16#CA, VB16",
    )
    after = run(assemble(text), "OB1", COLD)
    assert (after.read("VD4"), after.read("VW8"), after.read("VD12"), after.read("VB16")) == (65539, 32767, 1, 0xCA)
    assert after.overflow
    assert run(assemble(text), "OB1", COLD, wrap=True).read("VW8") == -32768
    low = run(assemble(_block("LD\tSM0.0", "MOVD\t16#00010002, VD0")), "OB1", COLD)
    assert (low.read("VW0"), low.read("VW2"), low.read("VB3")) == (1, 2, 2)  # the high byte comes first


def test_pls_takes_only_what_the_control_byte_updates():
    def after(control):
        lines = ["LD\tSM0.0", f"MOVB\t{control}, SMB67", "MOVW\t+500, SMW68", "MOVW\t+120, SMW70", "PLS\t0"]
        found = run(assemble(_block(*lines)), "OB1", COLD)
        return found.cycle, found.width

    assert [after(c) for c in ("16#CB", "16#CA", "16#C9", "16#4B")] == [(500, 120), (0, 120), (500, 0), (0, 0)]


def test_there_are_the_events_0_to_33():
    # System Manual, table of interrupt events
    block = "INTERRUPT_BLOCK INT_0:INT0\nBEGIN\nNetwork 1\n\tLD\tSM0.0\nEND_INTERRUPT_BLOCK\n"
    for line in ("ATCH\tINT0, 33", "DTCH\t33"):
        assemble(_block("LD\tSM0.0", line) + block)
        with pytest.raises(InputError, match="no instruction"):
            assemble(_block("LD\tSM0.0", line.replace("33", "34")) + block)


def test_there_are_64_subroutines_and_128_interrupts_each_of_its_own_number():
    names = ["OB1", *(f"SBR{k}" for k in range(64)), *(f"INT{k}" for k in range(128))]
    assert len({block_number(name) for name in names}) == 193
    for name in ("SBR64", "INT128", "OB2"):
        with pytest.raises(ValueError, match=r"64|128|OB2"):
            block_number(name)


@pytest.mark.parametrize(("gain", "kp", "scale"), [(32767.4, 32767, 7), (32768.2, 16384, 6)])
def test_the_constants_take_as_many_bits_as_the_largest_leaves_room_for(gain, kp, scale):
    # by hand: TA = 7 s, so 1 % is 70 ms, and a count of 100/255 °C; KP = K·70·(100/255)·(1 + TA/2TN), in ms/2^SCALE
    words = ROOM.encode(_design(gain=gain / 2**7 / (70.0 * 100.0 / 255.0 * (1.0 + 7.0 / 600.0))), Scaling())
    assert (words.values["KP"], words.values["SCALE"]) == (kp, scale)


@pytest.mark.parametrize(("ki", "tn"), [(0, math.inf), (1, 7.0 * 99 / 2.0)])
def test_constants_without_an_integral_part_have_no_integral_time(ki, tn):
    # the sum E + E_prev is 2·E less the change: K is KP − KI, and K·TA/TN = 2·KI
    words, _ = _repaired({"KP": 100, "KI": ki, "KD": 0, "SCALE": 7, "TICK": 250, "TICKS": 28})
    assert ROOM.decode(words).integral_time_s == pytest.approx(tn)
    with pytest.raises(OutOfRange, match=r"word KP = 100 .*not KI"):
        ROOM.design(replace(words, values=dict(words.values, KI=100)))


@pytest.mark.parametrize("line", ["MOVX\t+1, VW0", "MOVW\t+1", "MOVW\t+1, VW511", "MOVW\t+1, VW999", "MOVW\t+1, VB0", "S\tQ0.0, 2", "PLS\t1"])
def test_an_instruction_the_machine_does_not_know_is_refused_by_its_line(line):
    with pytest.raises(InputError, match=r"line 5: .* no instruction"):
        assemble(_block("LD\tSM0.0", line))
    with pytest.raises(InputError, match=r"line 1: .* outside any block"):
        assemble(line)


# text against direct emulation


WORD_SETS = [
    {"KP": 10664, "KI": 123, "KD": 30118, "SCALE": 7, "TICK": 250, "TICKS": 28},
    {"KP": 32767, "KI": -32767, "KD": -32767, "SCALE": 16, "TICK": 255, "TICKS": 128},
    {"KP": -32767, "KI": 32767, "KD": 32767, "SCALE": 1, "TICK": 5, "TICKS": 20},
]


def _repaired(values):
    ms = values["TICK"] * values["TICKS"]
    words = Words(target="s7-200", values=values, scaling=Scaling(), sample_time_s=ms / 1000.0)
    ROOM.check(words)
    return words, repaired.Constants(values["KP"], values["KI"], values["KD"], values["SCALE"], ms)


@pytest.fixture
def fast(monkeypatch):
    """Blocks are carried out compiled, which is the same: see test_s7_200_machine.py."""
    for module in (cycle, step):
        monkeypatch.setattr(module, "carry_out", compile_function(carry_out))


@pytest.mark.brute
@pytest.mark.long
@pytest.mark.parametrize("values", WORD_SETS)
def test_the_repaired_text_is_exact_and_free_of_overflow_for_every_pair_of_bytes(values, fast):
    # from the state that every pair leaves behind, in an order in which neighbours differ as much as they can
    words, c = _repaired(values)
    state, memory = ROOM.start(words, {}), repaired.Memory()
    for number in range(65536):
        setpoint, reading = divmod((number * 40503) % 65536, 256)
        state, scan = ROOM.step(state, setpoint, reading)
        memory = repaired.cycle(c, memory, setpoint, reading)
        assert (scan.output, state.state.read("VD224"), scan.flags["SM1.1"]) == (memory.width, memory.rest, False)


def test_no_words_and_no_readings_overflow_the_repaired_program():
    # every intermediate result is linear in each constant and in each byte, so its extremes lie at their ends
    ends = [(0, 0), (0, 255), (255, 0), (255, 255)]
    for signs in product((-1, 1), repeat=3):
        constants_ = {name: 32767 * sign for name, sign in zip(("KP", "KI", "KD"), signs, strict=True)}
        words, c = _repaired(constants_ | {"SCALE": 1, "TICK": 255, "TICKS": 128})
        for sequence in product(ends, repeat=3):
            state, memory = ROOM.start(words, {}), repaired.Memory()
            for setpoint, reading in sequence:
                state, scan = ROOM.step(state, setpoint, reading)
                memory = repaired.cycle(c, memory, setpoint, reading)
                assert (scan.flags["SM1.1"], scan.output) == (False, memory.width)


@pytest.mark.parametrize("switches", [{}, {"overflow": "wrap"}, {"rails": "edges_go_on", "width_applies": "next_cycle"},
                                      {"cycle_time": "never_loaded"}, {"cycle_time": "never_loaded", "rails": "edges_go_on"}])
@pytest.mark.parametrize("constants", [{"KI": 3, "T": 5, "KD": 77, "POT1": 9}, {"KP": 32767, "KD": -4, "T": 32767}, {"T": 0, "CYCLE": 2}])
def test_the_printed_text_is_the_printed_program_scan_by_scan(switches, constants):
    # T = 0 is no word that heatertune writes; a CPU sets SM1.3 at the division
    words = paper_words(gain=20)
    words = replace(words, values=dict(words.values, **constants))
    state, memory, c = PAPER.start(words, switches), printed.Memory(), printed.constants(words, switches)
    for number, (setpoint, reading) in enumerate([(60, 50), (60, 50), (49, 0), (61, 50), (130, 120), (200, 50), (90, 80), (3, 250)] * 2):
        state, scan = PAPER.step(state, setpoint, reading, cycle_start=number % 2 == 0)
        memory = printed.scan(c, memory, setpoint, reading, number % 2 == 0)
        assert (scan.output, scan.power_pct, *scan.flags.values()) == (
            memory.applied, printed.power_pct(c, memory.applied), memory.overflow, memory.zero_division)


@pytest.mark.brute
@pytest.mark.long
@pytest.mark.parametrize("switches", [{}, {"overflow": "wrap"}, {"rails": "edges_go_on", "width_applies": "next_cycle"},
                                      {"cycle_time": "never_loaded"}])
def test_the_printed_text_is_the_printed_program_for_every_pair_of_bytes(switches, fast):
    words = paper_words(gain=20, ki=3, t=5)
    words = Words(target=words.target, values=dict(words.values) | {"KD": 77, "POT1": 9}, scaling=words.scaling,
                  sample_time_s=words.sample_time_s)
    state, memory, c = PAPER.start(words, switches), printed.Memory(), printed.constants(words, switches)
    for number in range(65536):
        setpoint, reading = divmod((number * 40503) % 65536, 256)
        begins = number % 5 == 0
        state, scan = PAPER.step(state, setpoint, reading, cycle_start=begins)
        memory = printed.scan(c, memory, setpoint, reading, begins)
        found = (state.state.cpu.read("VW10"), state.state.cpu.read("VW20"), state.state.cpu.read("VW100"), scan.output, *scan.flags.values())
        assert found == (memory.error, memory.previous, memory.change, memory.applied, memory.overflow, memory.zero_division)


@pytest.mark.parametrize("design", [_design(), _design(tv=15.0, ta=5.0), _design(gain=8.0, tn=90.0, ta=2.0)])
def test_whole_closed_loops_of_the_text_and_of_the_direct_emulation_are_the_same(design):
    words = ROOM.encode(design, Scaling())
    _, c = _repaired(words.values)
    trace = simulate(ROOM, words, HEATER, Scenario(setpoint_degC=45.0, duration_s=2000.0))
    memory, setpoint = repaired.Memory(), ROOM.measure(words, 45.0)
    for reading, power in zip(trace.reading_degC, trace.power_asked_pct, strict=True):
        memory = repaired.cycle(c, memory, setpoint, round(reading * 2.55))
        assert power == 100.0 * memory.width / c.cycle_ms
    assert np.ptp(trace.power_asked_pct) > 10.0


def test_the_ticks_that_the_room_passes_over_do_nothing_but_count():
    words, _ = _repaired({"KP": 900, "KI": 20, "KD": 50, "SCALE": 4, "TICK": 100, "TICKS": 7})
    program = assemble(repaired_program(words))
    whole = run(program, "OB1", COLD.written({"SM0.1": 1, "IB0": 91, "SMB28": 120})).written({"SM0.1": 0})
    short, widths = whole, []
    for reading in (90, 95, 99, 104):
        short = run(program, "INT0", short.written({"IB0": reading, "VW30": 1}))
        for _ in range(7 if widths else 1):
            assert not whole.pulsed or widths
            whole = run(program, "INT0", whole.written({"IB0": reading}))
        assert whole == short
        widths.append(whole.width)
    assert len(set(widths)) == 4


@pytest.mark.parametrize(("statement", "told"), [("MOVW\t+1, VW400", 0), ("DIV\t+0, VD400", 2), ("+I\t+32767, VW10", 1)])
def test_a_cycle_tells_overflow_as_bit_0_and_a_division_by_zero_as_bit_1(statement, told):
    words, _ = _repaired(WORD_SETS[0])  # VW10 is 1 and more where the setpoint is above the reading
    text = repaired_program(words).replace("END_INTERRUPT_BLOCK", f"Network 99 // added\r\n\tLD\tSM0.0\r\n\t{statement}\r\nEND_INTERRUPT_BLOCK")
    state = own(COLD.written({"SMB28": 120, "IB0": 90}))
    assert run_cycle(timed_program(assemble(text), words.values, COUNTDOWN, next_cycle=False), state.memory)[2] == told


def test_the_feedback_on_i0_0_does_not_reach_the_reading():
    words, _ = _repaired(WORD_SETS[0])
    program = assemble(repaired_program(words))
    ready = run(program, "OB1", COLD.written({"SM0.1": 1, "SMB28": 120}))
    both = [run(program, "INT0", ready.written({"IB0": 90 + bit, "I1.0": 0})).read("VW0") for bit in (0, 1)]
    assert both == [90, 90]
    assert run(program, "INT0", ready.written({"IB0": 90, "I1.0": 1})).read("VW0") == 91


@pytest.mark.parametrize("target", ["s7-200", "s7-200-pid"])
def test_a_width_may_apply_one_cycle_later(target):
    which = controller_for(target)
    words = which.encode(_design(), Scaling())
    widths = []
    for setting in ("this_cycle", "next_cycle"):
        state, found = which.start(words, {"width_applies": setting}), []
        for degrees in (40.0, 40.5, 41.5, 43.0):
            state, scan = which.step(state, which.measure(words, 60.0), which.measure(words, degrees))
            found.append(scan.output)
        widths.append(found)
    assert widths[1] == [0, *widths[0][:-1]]
    assert len(set(widths[0])) == 4


# the repaired program's words


def test_the_repaired_program_is_the_velocity_pid_of_its_words_in_exact_numbers():
    words = ROOM.encode(_design(tv=3.0), Scaling())
    v = words.values
    readings = np.random.default_rng(2).integers(98, 103, 60).tolist()
    state, errors, pvs, exact = ROOM.start(words, {}), [0.0], [readings[0]] * 2, []
    for reading in readings:
        state, scan = ROOM.step(state, 115, reading)
        errors.append(115 - reading)
        pvs.append(reading)
        change = (v["KP"] * (errors[-1] - errors[-2]) + v["KI"] * (errors[-1] + errors[-2])
                  + v["KD"] * (2 * pvs[-2] - pvs[-1] - pvs[-3])) / 2 ** v["SCALE"]
        exact.append(change + (exact[-1] if exact else 0.0))
        assert 1.0 < exact[-1] < 7000.0 - 1.0, "the run must stay off the limits to be comparable"
        assert scan.output == math.floor(exact[-1] + 1e-9)  # nothing is lost but the fraction of the width


@pytest.mark.parametrize("tv", [0.0, 20.0])
def test_the_words_come_back_as_the_design(tv):
    back = ROOM.decode(ROOM.encode(_design(tv=tv), Scaling()))
    assert back.gain_pct_per_degC == pytest.approx(3.0, rel=1e-3)
    assert back.integral_time_s == pytest.approx(300.0, rel=5e-3)
    assert back.derivative_time_s == pytest.approx(tv, rel=1e-3)
    assert (back.sample_time_s, back.derivative_filter) == (7.0, 0.0)


def test_what_the_program_cannot_do_is_refused_with_a_remedy():
    with pytest.raises(NotRepresentable, match="--structure pi"):
        ROOM.encode(_design(tn=math.inf), Scaling())
    with pytest.raises(NotRepresentable, match=r"TA.*32\.7"):
        ROOM.encode(_design(ta=40.0), Scaling())
    with pytest.raises(NotRepresentable, match="smaller K"):
        ROOM.encode(_design(gain=500.0, ta=30.0), Scaling())
    with pytest.raises(NotRepresentable, match=r"KI.*slower TA"):
        ROOM.encode(_design(gain=20.0, tn=1e6, ta=1.0), Scaling())
    with pytest.raises(OutOfRange, match="TICKS"):
        ROOM.check(Words(target="s7-200", values=WORD_SETS[0] | {"TICKS": 200}, scaling=Scaling(), sample_time_s=50.0))
    assert PAPER.decode(paper_words(gain=20)) is None
    with pytest.raises(NotRepresentable, match=r"KD.*smaller K"):
        PAPER.encode(_design(tv=2000.0), Scaling())


def test_the_exports_are_the_texts_that_ran():
    words = ROOM.encode(_design(), Scaling())
    certificate = Certificate(verdict="PASS", lines=("proven on Ü", "at −10 % of 2…3 °C"))
    (text,) = ROOM.export(words, certificate).values()
    assert [block_number(name) for name in ("OB1", "SBR0", "INT0")] == [n for n, begin in enumerate(assemble(text).begins) if begin >= 0]
    code = [line for line in text.splitlines() if not line.startswith("//")]
    assert code == [line for line in repaired_program(words).splitlines() if not line.startswith("//")]
    assert "// verdict of the proof: PASS\r\n// proven on ?\r\n// at -10 % of 2..3 degC\r\n" in text
    assert text.index("16#CB, SMB67") < text.index("\tPLS\t0") < text.index("16#CA, SMB67")
    assert "\tMOVW\t+7000, SMW68\r\n" in text
    assert "TA and PWM cycle 7 s: 28 timed interrupts of 250 ms" in text
    faithful = PAPER.export(paper_words(gain=60), Certificate(verdict="FAIL", forced=True))["s7_200_paper.awl"]
    assert "16#CB" not in faithful
    assert "\tDTCH\t0\r\n" in faithful  # network 12: the event is detached
    assert faithful.count("// fault: ") == 4
    assert "FORCED" in faithful
    plain = printed_program(paper_words(gain=60)).splitlines()
    assert [line for line in faithful.splitlines() if not line.startswith("//")] == plain
