"""The PID tip against awlsim running the exported source, and against the document's formulas in NumPy's float32."""

import math
import random
import struct
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from heatertune.errors import InputError, NotRepresentable, OutOfRange, UnknownName
from heatertune.model.model_values import Fopdt
from heatertune.pid.design_values import PidDesign, structure_of
from heatertune.plc import Certificate, Scaling, Words, controller_for
from heatertune.plc.cpu.s7_300.machine import real
from heatertune.plc.s7_300.step import COLD, PidTipAssumptions, PidTipParameters, PidTipState, call, manual
from heatertune.proof import Actuator, Scenario, TemperatureStep, simulate

ROOM = controller_for("s7-300")
PASS = Certificate(verdict="PASS")
HEATER = Fopdt(gain_degC_per_pct=0.41, time_constant_s=166.0, dead_time_s=14.0, ambient_degC=24.0)
reals = st.integers(0, 2**32 - 1).map(lambda pattern: struct.unpack(">f", pattern.to_bytes(4, "big"))[0])


def _design(gain=3.0, tn=200.3, tv=0.0, ta=5.0):
    return PidDesign(gain_pct_per_degC=gain, integral_time_s=tn, derivative_time_s=tv, sample_time_s=ta,
                     structure=structure_of(tn, tv), method="", derivative_filter=0.0)


def _words(gain=3.0, rate=17700.0, reset=200300.0, sample=5000.0, ta=5.0):
    exact = {"GAIN": gain, "RATE": rate, "RESET": reset, "SAMPLE": sample}
    values = {name: float(np.float32(value)) for name, value in exact.items()}
    return Words(target="s7-300", values=values, scaling=Scaling(), sample_time_s=ta)


def _source(words):
    return ROOM.export(words, PASS)["s7_300_pid.awl"]


def _room_says(words, rows, switches=None):
    """OUT, OVERFLOW and the bits of BIAS and PV_LAST after each scan."""
    state, told = ROOM.start(words, switches or {}), []
    for mode, setpoint, reading, output in rows:
        inputs = {"SP": setpoint, "PV": reading, "mode_req": mode} | ({} if output is None else {"OUT": output})
        state, scan = ROOM.scan(state, inputs)
        kept = struct.pack(">ff", state.state.bias, state.state.reading)
        told.append((scan.output, scan.flags["overflow"], kept.hex()))
    return told


def _awlsim_says(answer):
    blocks = [bytes.fromhex(row) for row in answer["rows"]]
    return [(struct.unpack_from(">h", b, 6)[0], bool(b[8] & 1), b[26:34].hex()) for b in blocks]


def _closed_loop(words, seed):
    """PV of a loop from cold through a jump upwards (OUT at its lower limit) and one downwards (upper), with noise."""
    jumps = (TemperatureStep(time_s=250 * words.sample_time_s, temperature_degC=12.0), TemperatureStep(time_s=400 * words.sample_time_s, temperature_degC=-20.0))
    scenario = Scenario(setpoint_degC=53.3, duration_s=500 * words.sample_time_s, noise_degC=0.1, seed=seed, disturbances=jumps)
    trace = simulate(ROOM, words, HEATER, scenario, Actuator(pwm_period_s=5.0))
    setpoint = ROOM.measure(words, 53.3)
    return [[1, setpoint, ROOM.measure(words, float(t) + 1e-6), None] for t in trace.reading_degC]


@pytest.mark.parametrize("words", [
    _words(), _words(rate=0.0), _words(reset=0.0), _words(gain=0.0), _words(gain=0.0, rate=0.0), _words(gain=-1.7),
    _words(gain=11.1, rate=333.3), _words(reset=5000.0), _words(sample=4999.0),
], ids=["pid", "pi", "pd", "i and d alone", "i alone", "reversed", "high gain", "windup", "wrong sample"])
def test_the_exported_program_does_bit_for_bit_what_the_room_does(words, awlsim):
    # awlsim 0.77.1 executes the statements one by one
    rows = _closed_loop(words, seed=4)
    mine = _room_says(words, rows)
    assert mine == _awlsim_says(awlsim(_source(words), rows))
    assert len({output for output, _, _ in mine}) > 20


def test_the_runs_against_awlsim_reach_both_limits():
    outputs = [output for output, _, _ in _room_says(_words(), _closed_loop(_words(), seed=4))]
    assert (min(outputs), max(outputs)) == (0, 27648)


def _random_rows(count):
    rng = random.Random(8)
    return [
        [int(rng.random() < 0.8), rng.choice((12000, 27648, 0, 13824, -5)), rng.randint(-32768, 32767) if rng.random() < 0.3
         else rng.randint(11000, 13000), rng.choice((None, 0, 9999, 27648, 32767, -100))] for _ in range(count)
    ]


@pytest.mark.long
def test_any_readings_modes_and_manual_outputs_give_the_same_bits_as_awlsim(awlsim):
    # the user's OUT is written in manual only: in automatic the block overwrites it
    rows = [[mode, sp, pv, None if mode else out] for mode, sp, pv, out in _random_rows(3000)]
    words = _words(gain=0.77, reset=60000.0, rate=3000.0)
    assert _room_says(words, rows) == _awlsim_says(awlsim(_source(words), rows))


def test_the_setting_trunc_is_awlsims_trunc(awlsim):
    rows = _closed_loop(_words(), seed=5)
    source = _source(_words())
    assert source.count("      RND   ;") == 1
    answer = awlsim(source.replace("      RND   ;", "      TRUNC ;"), rows)
    mine = _room_says(_words(), rows, {"conversion": "trunc"})
    assert mine == _awlsim_says(answer)
    assert mine != _room_says(_words(), rows)


def test_results_too_small_for_a_real_set_os_as_in_awlsim_and_are_zero(awlsim):
    # STL reference manual, status word after floating-point math: below 1.175494e-38 in size OV and OS are set, CC says zero
    words = _words(gain=1e-37, rate=0.0)
    rows = [[1, 12000, 11990 + k % 5, None] for k in range(20)]
    mine = _room_says(words, rows)
    assert [each[:2] for each in mine] == [each[:2] for each in _awlsim_says(awlsim(_source(words), rows))] == [(0, True)] * 20
    assert {kept[:8] for _, _, kept in mine} == {"00000000"}  # awlsim keeps the small number itself: see DIFFERENCES.md
    for value, kept, overflow in ((1.17e-38, 0.0, True), (-1.17e-38, 0.0, True), (1.18e-38, 1.18e-38, False), (0.0, 0.0, False)):
        found, os = real(value)
        assert found == pytest.approx(kept, rel=1e-7, abs=0.0)
        assert (os, real(value, True)[1]) == (overflow, True)


def test_the_analog_module_cuts_and_keeps_to_its_nominal_range():
    words = _words()
    assert [ROOM.measure(words, n * 100.0 / 27648) for n in (-3.0, 0.99, 1.99, 13824.01, 27647.9, 27648.0, 30000.0)] == [
        0, 0, 1, 13824, 27647, 27648, 27648,
    ]


def test_the_words_stand_at_the_documents_addresses_bit_for_bit_after_ob100(awlsim):
    # document, page 7: Gain DBD10, Rate DBD14, Reset DBD18, Sample DBD22; awlsim computes the offsets of the VAR sections
    words = ROOM.encode(_design(gain=1.2345678, tv=17.77777), Scaling())
    answer = awlsim(_source(words), [[1, 20000, 12345, None]])
    assert {name: answer["offsets"][name] for name in ("GAIN", "RATE", "RESET", "SAMPLE")} == {
        "GAIN": [10, 0], "RATE": [14, 0], "RESET": [18, 0], "SAMPLE": [22, 0],
    }
    assert {name: answer["offsets"][name] for name in ("mode_req", "PV", "SP", "OUT", "OVERFLOW", "BIAS", "STARTED")} == {
        "mode_req": [0, 0], "PV": [2, 0], "SP": [4, 0], "OUT": [6, 0], "OVERFLOW": [8, 0], "BIAS": [26, 0], "STARTED": [34, 0],
    }
    image = bytes.fromhex(answer["restart"])
    exact = struct.pack(">ffff", *(words.values[n] for n in ("GAIN", "RATE", "RESET", "SAMPLE")))
    assert image[10:26] == exact
    assert answer["automatic"] == 0  # manual until the user says otherwise
    assert answer["written"] == [struct.unpack_from(">h", bytes.fromhex(answer["rows"][0]), 6)[0]]
    assert ROOM.read_image(image, sample_time_s=5.0, scaling=Scaling(), source="DB100") == words
    # BEGIN alone gives them, too: nine digits name a single
    assert bytes.fromhex(awlsim(_source(words), [], restart=None)["restart"])[10:26] == exact


def test_ob100_begins_from_cold_what_a_retentive_block_kept(awlsim):
    source = _source(_words())
    for kept, cold in (("BIAS := 0.00000000e+000", "BIAS := 9.0e-001"), ("STARTED := FALSE", "STARTED := TRUE")):
        assert source.count(kept) == 1
        source = source.replace(kept, cold)
    image = bytes.fromhex(awlsim(source, [])["restart"])
    assert (image[26:30], image[34] & 1) == (bytes(4), 0)


def _float32(words, rows):
    """The document's formulas in NumPy, PV_{n−1} of the first call being its reading."""
    f = np.float32
    gain, rate, reset, sample = (f(words.values[n]) for n in ("GAIN", "RATE", "RESET", "SAMPLE"))
    bias, before, outputs = f(0), None, []
    for _, raw_sp, raw_pv, _ in rows:
        sp, pv = f(raw_sp) / f(27648), f(raw_pv) / f(27648)
        error = sp - pv
        mp, md = gain * error, gain * (rate / sample) * ((pv if before is None else before) - pv)
        mi = bias + gain * (sample / reset) * error
        output, bias, before = mp + mi + md, mi, pv
        if output > 1:
            bias = min(max(f(1) - (mp + md), f(0)), f(1))
        if output < 0:
            bias = min(max(-(mp + md), f(0)), f(1))
        outputs.append(int(np.rint(min(max(output, f(0)), f(1)) * f(27648))))
    return outputs


def test_the_room_is_the_documents_formulas_in_numpys_single_precision():
    rows = _closed_loop(_words(), seed=6)
    assert [output for output, _, _ in _room_says(_words(), rows)] == _float32(_words(), rows)


def test_the_formulas_worked_by_hand():
    # Gain 2, Sample/Reset = 1/4, Rate/Sample = 2; SP = 1/2, PV = 3/8 then 5/16: powers of two, so nothing rounds
    p = PidTipParameters(gain=2.0, rate=2000.0, reset=4000.0, sample=1000.0)
    first = call(p, PidTipAssumptions(), PidTipState(bias=0.25), 13824, 10368)
    # MP = 2·1/8, MI = 1/4 + 1/2·1/8, MD = 0
    assert (first.bias, first.output) == (0.3125, round(Fraction(9, 16) * 27648))
    second = call(p, PidTipAssumptions(), first, 13824, 8640)
    # MP = 2·3/16, MI = 5/16 + 1/2·3/16, MD = 4·(3/8 − 5/16) = 1/4: Output = 1 1/32 > 1, Bias = 1 − (3/8 + 1/4)
    assert (second.bias, second.output) == (0.375, 27648)
    third = call(p, PidTipAssumptions(), PidTipState(bias=0.25, reading=0.5, started=True), 10368, 20736)
    # MP = −3/4, MI = 1/4 − 3/16, MD = −1: Output < 0, Bias = 7/4 clamped to 1
    assert (third.bias, third.output) == (1.0, 0)
    fourth = call(p, PidTipAssumptions(), PidTipState(bias=0.25, reading=0.75, started=True), 10368, 20736)
    assert (fourth.bias, fourth.output) == (0.75, 0)  # −(MP + MD), not clamped


def test_every_open_point_changes_something():
    p = PidTipParameters(gain=2.0, rate=0.0, reset=4000.0, sample=1000.0)
    state = PidTipState(bias=1.5, reading=0.5, started=True)  # MP = −1: the output is inside, the bias is not
    assert call(p, PidTipAssumptions(), state, 0, 13824).bias == 1.25
    assert call(p, PidTipAssumptions(bias_always_clamped=True), state, 0, 13824).bias == 1.0
    d = p._replace(rate=1000.0)
    assert call(d, PidTipAssumptions(), COLD, 13824, 10368).output > call(d, PidTipAssumptions(starts_at_zero=True), COLD, 13824, 10368).output
    half = PidTipState(bias=0.75 / 27648, started=True)
    off = PidTipParameters(gain=1.0, rate=0.0, reset=0.0, sample=1.0)
    assert [call(off, a, half, 0, 0).output for a in (PidTipAssumptions(), PidTipAssumptions(truncates=True))] == [1, 0]
    meant = {
        ("conversion", "trunc"): PidTipAssumptions(truncates=True), ("bias_clamp", "always"): PidTipAssumptions(bias_always_clamped=True),
        ("first_reading", "zero"): PidTipAssumptions(starts_at_zero=True),
    }
    for (name, setting), assumptions in meant.items():
        assert ROOM.start(_words(), {name: setting}).parameters[1] == assumptions
        with pytest.raises(UnknownName, match=name):
            ROOM.start(_words(), {name: "other"})


def test_manual_leaves_out_to_the_user_and_the_return_begins_there():
    # document, page 3: in manual the loop does nothing and the user controls the output
    state = manual(COLD, 12000, 20000)
    assert (state.output, manual(state, 12000).output) == (20000, 20000)
    p = PidTipParameters(gain=2.0, rate=9000.0, reset=0.0, sample=1000.0)
    assert call(p, PidTipAssumptions(), state, 12000, 12000).output == 20000
    assert manual(COLD, 0, 32767).bias == 1.0
    assert manual(COLD, 0, -5).bias == 0.0
    scans = [ROOM.scan(ROOM.start(_words(), {}), {"SP": 0, "PV": 0, "mode_req": 0, "OUT": out})[1] for out in (32767, 13824, -5)]
    assert [(scan.output, scan.power_pct) for scan in scans] == [(32767, 100.0), (13824, 50.0), (-5, 0.0)]


@given(words=st.tuples(reals, reals, reals, reals), bias=reals, readings=st.lists(st.integers(-32768, 32767), min_size=2, max_size=6))
def test_a_call_is_total_for_every_bit_pattern_of_words_and_state(words, bias, readings):
    state = PidTipState(bias=bias)
    for reading in readings:
        before = state
        state = call(PidTipParameters(*words), PidTipAssumptions(), before, 12000, reading)
        assert state == call(PidTipParameters(*words), PidTipAssumptions(), before, 12000, reading)
        assert 0 <= state.output <= 27648
        assert not math.isnan(state.bias)


@pytest.mark.parametrize(("gain", "reset"), [(3e38, 1.0), (math.nan, 1.0), (math.inf, 0.0), (1.0, math.nan)])
def test_an_overflow_is_told_and_never_heats_for_ever(gain, reset):
    p = PidTipParameters(gain=gain, rate=0.0, reset=reset, sample=1000.0)
    state = call(p, PidTipAssumptions(), COLD, 27648, 0)
    assert state.overflow
    after = call(p, PidTipAssumptions(), state, 0, 27648)
    assert after.output == 0


def test_an_infinite_reset_is_no_integral_part_as_is_0():
    # document, page 3: "a value of infinity or a value of 0"
    rows = [(12000, 11000), (12000, 11500), (12000, 12100)]
    outputs = []
    for reset in (0.0, math.inf):
        state = PidTipState(bias=0.5, started=True)
        p = PidTipParameters(gain=0.5, rate=0.0, reset=reset, sample=1000.0)
        for row in rows:
            state = call(p, PidTipAssumptions(), state, *row)
            outputs.append(state.output)
        assert not state.overflow
    assert outputs[:3] == outputs[3:] == [13824 + 500, 13824 + 250, 13824 - 50]


def test_the_words_are_the_design_in_milliseconds_and_shares_of_the_range():
    words = ROOM.encode(_design(gain=3.0, tn=200.0, tv=20.0, ta=2.5), Scaling(low_degC=0.0, high_degC=250.0))
    # 3 %/°C · 250 °C = 750 % per full range = 7.5
    assert words.values == {"GAIN": 7.5, "RATE": 20000.0, "RESET": 200000.0, "SAMPLE": 2500.0}
    assert ROOM.decode(words) == PidDesign(
        gain_pct_per_degC=3.0, integral_time_s=200.0, derivative_time_s=20.0, sample_time_s=2.5, structure="pid",
        derivative_filter=0.0, method="as the words of the S7-300 PID tip realise it",
    )
    p_only = ROOM.encode(_design(tn=math.inf), Scaling())
    assert (p_only.values["RESET"], p_only.values["RATE"]) == (0.0, 0.0)
    assert ROOM.decode(p_only).structure == "p"


@pytest.mark.parametrize(("design", "message"), [
    (_design(ta=0.0004), r"TA would be 0\.0004.*0\.001 s would fit"), (_design(ta=61.0), r"TA.*60 s would fit"),
    (_design(ta=0.0125), r"TA.*0\.01[23] s would fit"), (_design(gain=1e39), "GAIN"), (_design(gain=1e-46), "GAIN"),
    (_design(tn=1e36), "RESET"), (_design(tv=1e-50), "RATE"),
])
def test_what_does_not_fit_is_refused_with_the_nearest_that_would(design, message):
    with pytest.raises(NotRepresentable, match=message):
        ROOM.encode(design, Scaling())


def test_a_sample_that_is_not_the_call_interval_stretches_the_times():
    # CI = Gain·Sample/Reset is added per call, whatever the clock: called every 10 s with SAMPLE 5 s, TN doubles
    design = ROOM.decode(_words(ta=10.0, reset=200000.0, rate=20000.0))
    assert (design.integral_time_s, design.derivative_time_s, design.sample_time_s) == (400.0, 40.0, 10.0)
    assert ROOM.decode(_words(gain=0.0)) is None


def _image(*words):
    return bytes(10) + struct.pack(">ffff", *words) + bytes(10)


def test_a_dump_is_read_and_its_oddities_told():
    def told(*words, called=5.0):
        found = ROOM.read_image(_image(*words), sample_time_s=called, scaling=Scaling(), source="DB")
        return " ".join(ROOM.oddities(found))

    assert told(2.0, 17000.0, 200000.0, 5000.0) == ""
    assert "called every 10000 ms: TN and TV are 2 times" in told(2.0, 0.0, 200000.0, 5000.0, called=10.0)
    assert "no integral" in told(2.0, 0.0, 0.0, 5000.0)
    assert "no integral" in told(2.0, 0.0, math.inf, 5000.0)
    assert "no proportional" in told(0.0, 0.0, 200000.0, 5000.0)
    assert "negative" in told(-1.0, 0.0, 200000.0, 5000.0)
    assert "RESET is 200 ms" in told(1.0, 0.0, 200.0, 5000.0)
    assert "RESET is 1e+08 ms" in told(1.0, 0.0, 1e8, 5000.0)
    assert "RATE is 20 ms" in told(1.0, 20.0, 200000.0, 5000.0)


def test_a_dump_that_cannot_be_is_refused():
    with pytest.raises(InputError, match="DB: 25 bytes; expected 26"):
        ROOM.read_image(bytes(25), sample_time_s=5.0, scaling=Scaling(), source="DB")
    for words, name in (((math.nan, 0.0, 0.0, 5000.0), "GAIN"), ((1.0, -1.0, 0.0, 5000.0), "RATE"), ((1.0, 0.0, 0.0, 0.0), "SAMPLE")):
        with pytest.raises(OutOfRange, match=f"word {name}"):
            ROOM.read_image(_image(*words), sample_time_s=5.0, scaling=Scaling(), source="DB")


def test_the_source_is_ascii_with_crlf_and_tells_verdict_and_force():
    certificate = Certificate(verdict="FAIL", lines=("not kept: overshoot ≤ 2 °C…",), forced=True)
    files = ROOM.export(_words(), certificate)
    source = files["s7_300_pid.awl"]
    assert source.isascii()
    assert source.count("\r\n") == source.count("\n") > 200
    assert "// verdict of the proof: FAIL - FORCED" in source
    assert "// not kept: overshoot <= 2 degC..\r\n" in source
    blocks = [source.index(each) for each in ("FUNCTION_BLOCK FB 100", "DATA_BLOCK DB 100", "ORGANIZATION_BLOCK OB 100", "CALL  FB 100")]
    assert blocks == sorted(blocks)
    assert ROOM.export(_words(), certificate) == files
    assert files["s7_300_words.csv"].splitlines()[1] == 'DBD10,GAIN,REAL,3.00000000e+000,"gain, share per share"'
