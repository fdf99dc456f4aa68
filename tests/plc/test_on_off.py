"""The two-level control of the bit processor: its switching, the loop it makes, its word and its files."""

import csv
import io
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from heatertune.errors import InputError, NotRepresentable, OutOfRange
from heatertune.model.model_values import Fopdt
from heatertune.pid.design_values import PidDesign
from heatertune.plc import Certificate, Scaling, Words, controller_for
from heatertune.plc.cpu.one_bit.machine import ON_OFF_NAMES, assemble
from heatertune.plc.on_off.controller import PROGRAM, intel_hex
from heatertune.plc.replay import replay
from heatertune.proof import Acceptance, Actuator, Scenario, prove_models, simulate

ROOM = controller_for("on-off")
PASS = Certificate(verdict="PASS", lines=("proven in 3 runs",))


def _words(band=20, ta=1.0, scaling=None):
    return Words(target="on-off", values={"BAND": band}, scaling=scaling or Scaling(), sample_time_s=ta)


def _design(ta=1.0):
    return PidDesign(gain_pct_per_degC=3.0, integral_time_s=200.0, derivative_time_s=0.0, sample_time_s=ta, structure="pi",
                     method="")


@pytest.mark.parametrize("was_on", [False, True])
@pytest.mark.parametrize("setpoint", [0, 5, 2000, 4090, 4095])
def test_it_heats_below_the_band_and_rests_above_it(was_on, setpoint):
    # the sense of Example 3 as printed, around the setpoint: both comparisons are strict
    words = _words(band=10)
    for reading in range(max(0, setpoint - 15), min(4095, setpoint + 15) + 1):
        start = ROOM.start(words, {})
        begun, first = ROOM.step(start, 100, 0 if was_on else 4095)
        assert first.output == was_on
        _, scan = ROOM.step(begun, setpoint, reading)
        expected = False if reading > setpoint + 10 else True if reading < setpoint - 10 else was_on
        assert (scan.output, scan.power_pct) == (int(expected), 100.0 if expected else 0.0)
        assert not any(scan.flags.values())


@given(band=st.integers(1, 2047), w=st.integers(-32768, 32767), x=st.integers(-32768, 32767))
def test_it_is_two_level_control_wherever_no_word_overflows(band, w, x):
    _, scan = ROOM.step(ROOM.start(_words(band), {}), w, x)
    if w - band >= -32768 and w + band <= 32767:
        assert scan.output == (x < w - band)
        assert not scan.flags["overflow"]
    elif w + band > 32767:
        assert scan.flags["overflow"], "SP + BAND is computed in every scan"


@pytest.mark.long
def test_the_loop_swings_as_a_relay_with_dead_time_does():
    # continuous relay on k/(T·s + 1)·e^(−L·s): after switching off at SP + h the temperature goes on rising for L towards
    # ambient + 100·k, after switching on at SP − h it goes on falling for L towards ambient
    heater = Fopdt(gain_degC_per_pct=0.5, time_constant_s=150.0, dead_time_s=6.5, ambient_degC=20.0)
    words, h, late = _words(band=20, ta=0.05), 20 * 100.0 / 4095, math.exp(-6.5 / 150.0)
    trace = simulate(ROOM, words, heater, Scenario(setpoint_degC=40.0, duration_s=2000.0), Actuator(pwm_period_s=0.05))
    swing = trace.course(1000.0, 2000.0)[1]
    assert swing.max() == pytest.approx(70.0 - (70.0 - (40.0 + h)) * late, abs=0.05)
    assert swing.min() == pytest.approx(20.0 + (40.0 - h - 20.0) * late, abs=0.05)
    assert set(trace.power_asked_pct) == {0.0, 100.0}
    rising = trace.edge_time_s[trace.edge_on][5:7]
    top, bottom = swing.max(), swing.min()
    period = (6.5 + 150.0 * math.log((70.0 - bottom) / (70.0 - 40.0 - h))
              + 6.5 + 150.0 * math.log((top - 20.0) / (40.0 - h - 20.0)))
    assert rising[1] - rising[0] == pytest.approx(period, rel=0.01)


def test_a_proof_of_a_controller_without_a_law_has_no_margins():
    heater = Fopdt(gain_degC_per_pct=0.5, time_constant_s=400.0, dead_time_s=2.0, ambient_degC=20.0)
    scenario = Scenario(setpoint_degC=40.0, duration_s=3000.0)
    proof = prove_models(ROOM, _words(), [("one", heater)], scenario, Actuator(pwm_period_s=1.0),
                         Acceptance(margins_of=lambda *_: 1 / 0))
    assert (proof.design, proof.verdict) == (None, "PASS")


@pytest.mark.parametrize(("span", "band"), [(100.0, 20), (140.0, 15), (1000.0, 2), (10_000.0, 1), (1.01, 2027)])
def test_band_is_the_counts_nearest_half_a_degree(span, band):
    # 0.5 · 4095 / span, rounded: 20.475, 14.625, 2.0475, 0.205, 2027.2
    words = ROOM.encode(_design(), Scaling(low_degC=0.0, high_degC=span))
    assert words == _words(band, scaling=Scaling(low_degC=0.0, high_degC=span))


def test_a_reading_is_the_whole_part_of_its_share_of_the_range():
    # 70 of 140 °C: 2047.5; 0.1 of 140 °C: 2.925
    words = _words(scaling=Scaling(low_degC=-20.0, high_degC=120.0))
    assert [ROOM.measure(words, t) for t in (-30.0, -20.0, -19.9, 50.0, 120.0, 130.0)] == [0, 0, 2, 2047, 4095, 4095]


def test_what_the_word_or_the_timer_cannot_hold_is_refused():
    with pytest.raises(NotRepresentable, match=r"word BAND would be 2275, allowed 1…2047 counts; .* 1\.01 °C or more"):
        ROOM.encode(_design(), Scaling(low_degC=0.0, high_degC=0.9))
    with pytest.raises(NotRepresentable, match=r"sampling interval TA would be 0\.123.*0\.12 s would fit"):
        ROOM.encode(_design(ta=0.123), Scaling())
    with pytest.raises(NotRepresentable, match="600 s would fit"):
        ROOM.encode(_design(ta=700.0), Scaling())
    with pytest.raises(OutOfRange, match="sample_time_s"):
        ROOM.check(_words(ta=0.001))
    assert ROOM.decode(_words()) is None


def test_the_files_hold_program_and_word():
    files = ROOM.export(_words(band=300), PASS)
    assert set(files) == {"on_off_listing.txt", "on_off_words.csv", "on_off_rom.hex", "on_off_rom.bin"}
    # by hand: Load 1011, Add 1100, Sub 1101, Comp 1110, Test 0001, Reset(CFF=1) 0110, Jump(CFF=1) 1001, Set(CFF=1) 0011;
    # SP, PV, BAND at 0, 1, 2; OUT, AC1<AC2, AC1>AC2 at 0, 1, 2; then BAND = 300 = 012C
    by_hand = "B0 B2 C0 B1 E0 12 60 90  B0 B2 D0 B1 E0 11 30 80  01 2C"
    assert files["on_off_rom.bin"] == bytes.fromhex(by_hand)
    listing = files["on_off_listing.txt"]
    assert "; verdict of the proof: PASS\n; proven in 3 runs\n" in listing
    coded = [line.rpartition("; ")[2] for line in listing.splitlines() if line[:1].isdigit()]
    assert " ".join(f"{int(code.replace(' ', ''), 2):02X}" for code in coded) == by_hand.replace("  ", " ").removesuffix(" 01 2C")
    assert "register 2 (BAND) = 300 counts = 7.33 °C" in listing
    rows = list(csv.DictReader(io.StringIO(files["on_off_words.csv"])))
    assert [(row["address"], row["word"], row["value"]) for row in rows] == [("register 2", "BAND", "300")]
    assert ROOM.export(_words(band=300), PASS) == files


def test_the_listing_assembles_to_the_program():
    assert assemble(ROOM.export(_words(), PASS)["on_off_listing.txt"], ON_OFF_NAMES, operand_bits=4) == PROGRAM


def test_the_hex_file_is_intels():
    # the textbook record of three bytes at 0030, and the end record
    assert intel_hex(bytes.fromhex("02337A"), start=0x30) == ":0300300002337A1E\n:00000001FF\n"
    lines = ROOM.export(_words(), PASS)["on_off_rom.hex"].splitlines()
    assert [line[:9] for line in lines] == [":10000000", ":02001000", ":00000001"]
    for line in lines:
        assert sum(bytes.fromhex(line[1:])) % 256 == 0


def test_a_memory_is_read_back_or_refused():
    assert ROOM.read_image is not None
    assert ROOM.oddities is not None
    conditions = {"sample_time_s": 2.0, "scaling": Scaling(), "source": "dump"}
    image = ROOM.export(_words(band=1234), PASS)["on_off_rom.bin"]
    assert ROOM.read_image(image, **conditions) == _words(band=1234, ta=2.0)
    with pytest.raises(InputError, match="dump: 17 bytes; expected 18"):
        ROOM.read_image(image[:17], **conditions)
    with pytest.raises(InputError, match="line 14 of the program is 31; expected 30"):
        ROOM.read_image(image[:14] + b"\x31" + image[15:], **conditions)
    with pytest.raises(OutOfRange, match="word BAND = -1 "):
        ROOM.read_image(image[:16] + b"\xff\xff", **conditions)


def test_a_wide_band_is_odd():
    assert ROOM.oddities(_words(band=409)) == ()
    assert ROOM.oddities(_words(band=410)) == ("BAND is 410: the heater switches 10 °C above and below the setpoint.",)


def test_recorded_inputs_are_replayed():
    scans = replay(ROOM, _words(band=10), [{"SP": 1000, "PV": pv} for pv in (989, 1000, 1010, 1011, 990, 989)])
    assert [scan.output for scan in scans] == [1, 1, 1, 0, 0, 1]
