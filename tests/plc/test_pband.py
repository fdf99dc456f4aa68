"""Panel instruments: numbers from the makes' manuals, rounding by paper, a law written out by hand, texts that come back."""

import math
from dataclasses import replace
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from heatertune import chain
from heatertune.errors import ExportRefused, InputError, NotRepresentable, OutOfRange, UnknownName
from heatertune.model.model_values import Fopdt, model_by_hand
from heatertune.pid.design_values import PidDesign, structure_of
from heatertune.plc import ALIKE, COOLING, NAMES, TARGETS, Certificate, Scaling, controller_for
from heatertune.plc.dump_reader import read_machine
from heatertune.plc.pband.makes import MAKES
from heatertune.plc.pband.step import PbandAssumptions, PbandBlock, PbandState, step
from heatertune.plc.targets import commissioning
from heatertune.plc.words import with_pwm_period
from heatertune.proof.design_request import with_pwm
from heatertune.proof.redesign import DesignRequest, find_passing_design
from heatertune.settings import Conditions

PASSED = Certificate(verdict="PASS", lines=("proven at 150 °C",))
OVEN = Scaling(low_degC=0.0, high_degC=400.0)
makes = pytest.mark.parametrize("name", MAKES)


def _interval(name):
    timer = controller_for(name).timer
    return min(max(0.25, timer.shortest_s), timer.longest_s)


def _design(name, gain=8.13, tn=133.34, tv=21.43):
    return PidDesign(gain_pct_per_degC=gain, integral_time_s=tn, derivative_time_s=tv, sample_time_s=_interval(name),
                     structure=structure_of(tn, tv), method="")


def _words(name, scaling=OVEN, **changed):
    return controller_for(name).encode(_design(name, **changed), scaling)


def _read(name, text, **given):
    return read_machine(controller_for(name), text.encode(), sample_time_s=given.get("interval", _interval(name)), scaling=OVEN,
                        source="dump.txt")


def _refused(name, text, *parts):
    with pytest.raises((InputError, OutOfRange)) as refused:
        _read(name, text)
    for part in parts:
        assert part in str(refused.value), refused.value


# H175 p. 5-4, 5-7, 5-8 and H186 p. 5-15; HA028651 15.5; diconTOUCH 7.2.5; Commander 300 supplement 8.6.1; DT4848 RS-485
@pytest.mark.parametrize(("name", "places"), [
    ("omron-e5cc", {"P": 0x2A00, "I": 0x2A01, "D": 0x2A02, "CP": 0x2708, "OL-H": 0x2A05, "OL-L": 0x2A06, "ORBAND": 0x2D19,
                    "TIMEUNIT": 0x3309, "ALFA": 0x330A}),
    ("eurotherm-3200", {"PB": 6, "Ti": 8, "Td": 9, "CB.LO": 17, "CB.HI": 18}),
    ("jumo-dicon", {"XP1": 4249, "TV1": 4253, "TN1": 4257, "CY1": 4261, "Y0": 4272, "Y1": 4273, "TK1": 4275}),
    ("abb-commander-300", {"CT": "CT", "PB": "PB", "IT": "IT", "DT": "DT", "AB": "AB"}),
    ("omega-cn7800", {"Pb": 0x1009, "ti": 0x100A, "td": 0x100B, "ioF": 0x100C, "CYCLE1": 0x1007}),
])
def test_the_list_of_registers_has_the_addresses_of_the_manuals(name, places):
    files = controller_for(name).export(_words(name), PASSED)
    rows = [line.split(",") for line in files[f"{name.replace('-', '_')}_registers.csv"].splitlines() if line[0] != "#"][1:]
    assert {row[2]: row[0] for row in rows} == {word: str(place) for word, place in places.items()}
    assert all(row[1] == "" or int(row[1], 16) == int(row[0]) for row in rows)


@pytest.mark.parametrize(("name", "values"), [  # 100/8.13 = 12.3001 °C, of 400 °C 3.0750 %
    ("pband", {"Pb": 123, "ti": 133, "td": 21, "CYC": 20, "OPH": 1000}),
    ("omron-e5cc", {"P": 123, "I": 1333, "D": 214, "TIMEUNIT": 1, "CP": 2, "ALFA": 65, "ORBAND": 0, "OL-H": 1000, "OL-L": 0}),
    ("eurotherm-3200", {"PB": 31, "Ti": 133, "Td": 21, "CB.LO": 123, "CB.HI": 123}),
    ("jumo-dicon", {"XP1": 12.300000190734863, "TN1": 133.0, "TV1": 21.0, "CY1": 2.0, "Y0": 0, "Y1": 100, "TK1": 0.0}),
    ("abb-commander-300", {"PB": 31, "IT": 133, "DT": 214, "CT": 20, "AB": 30}),
    ("omega-cn7800", {"Pb": 123, "ti": 133, "td": 21, "ioF": 0, "CYCLE1": 2}),
])
def test_a_design_is_rounded_to_the_digits_of_each_make(name, values):
    assert _words(name).values == values


#: make → digit of the band [°C at 400 °C span], of Ti and of Td [s]
DIGITS = {"pband": (0.1, 1, 1), "omron-e5cc": (0.1, 0.1, 0.1), "eurotherm-3200": (0.4, 1, 1), "jumo-dicon": (0.1, 1, 1),
          "abb-commander-300": (0.4, 1, 0.1), "omega-cn7800": (0.1, 1, 1)}


@pytest.mark.law
@makes
@given(band=st.floats(0.5, 900.0), tn=st.one_of(st.floats(1.0, 990.0), st.just(math.inf)), tv=st.one_of(st.just(0.0), st.floats(1.0, 990.0)))
def test_words_decode_to_within_half_a_digit(name, band, tn, tv):
    words = _words(name, gain=100.0 / band, tn=tn, tv=tv)
    back, (of_band, of_ti, of_td) = controller_for(name).decode(words), DIGITS[name]
    assert abs(100.0 / back.gain_pct_per_degC - band) <= of_band / 2 + 1e-5 * band
    assert back.integral_time_s == tn or abs(back.integral_time_s - tn) <= of_ti / 2 + 1e-9
    assert abs(back.derivative_time_s - tv) <= of_td / 2 + 1e-9
    assert back.structure == structure_of(tn, tv)


def test_times_beyond_what_tenths_hold_are_in_seconds():
    assert [_words("omron-e5cc", tn=tn).whole[word] for tn in (999.9, 1000.0) for word in ("TIMEUNIT", "I", "D")] == [1, 9999, 214, 0, 1000, 21]


@makes
@pytest.mark.parametrize(("changed", "said"), [
    ({"gain": -2.0}, "positive"), ({"gain": 1e-3}, "another design would fit"), ({"gain": 1e6}, "another design would fit"),
    ({"tn": 0.01}, "a"), ({"tv": 0.01}, "a longer time"), ({"tn": 1e5}, "would fit"),
])
def test_what_does_not_fit_is_refused(name, changed, said):
    with pytest.raises(NotRepresentable, match=said):
        _words(name, **changed)


def test_abb_writes_7201_for_no_integral_part():
    words = _words("abb-commander-300", tn=math.inf)
    assert words.values["IT"] == 7201
    assert controller_for("abb-commander-300").decode(words).integral_time_s == math.inf


# H175: -2: 0.1 s, -1: 0.2 s, 0: 0.5 s, 1 to 99 s; DT4848: 0: 0.5 s, to 99 s
@pytest.mark.parametrize(("name", "word", "periods"), [
    ("omron-e5cc", "CP", {0.1: -2, 0.2: -1, 0.5: 0, 1.0: 1, 20.0: 20, 99.0: 99}), ("omega-cn7800", "CYCLE1", {0.5: 0, 1.0: 1, 99.0: 99}),
    ("abb-commander-300", "CT", {1.0: 10, 12.3: 123, 300.0: 3000}), ("jumo-dicon", "CY1", {0.5: 0.5, 20.0: 20.0}), ("pband", "CYC", {0.5: 5, 20.0: 200}),
])
def test_a_cycle_time_is_written_as_the_make_does(name, word, periods):
    which = controller_for(name)
    for period, number in periods.items():
        words = with_pwm_period(which.cycle, _words(name), period)
        which.check(words)
        assert (words.values[word], which.timing(words).pwm_period_s) == (number, period)
    with pytest.raises(OutOfRange, match=r"pwm_period_s = 1\.23.*a cycle time of the instrument; the nearest is 1"):
        with_pwm_period(which.cycle, _words(name), 1.23)
    assert with_pwm_period(which.cycle, _words(name), None) == _words(name)


def test_an_instrument_without_a_cycle_time_takes_no_other():
    which = controller_for("eurotherm-3200")
    assert which.timing(_words("eurotherm-3200")).pwm_period_s == 2.0
    with pytest.raises(OutOfRange, match="this instrument has no cycle time"):
        with_pwm_period(which.cycle, _words("eurotherm-3200"), 3.0)
    assert with_pwm_period(controller_for("weg").cycle, chain.encode(_design("pband"), "weg"), 3.0) == chain.encode(_design("pband"), "weg")


@pytest.mark.parametrize(("kind", "least"), [("ssr", 1.0), ("relay", 20.0), ("contactor", 30.0)])
def test_a_kind_of_switch_gets_a_cycle_time_that_suits_it(kind, least):
    fitted = model_by_hand(Fopdt(gain_degC_per_pct=3.0, time_constant_s=600.0, dead_time_s=30.0, ambient_degC=20.0))
    _, conditions = with_pwm(_design("omron-e5cc"), fitted, kind, Conditions(setpoint_degC=150.0), words=_words("omron-e5cc"))
    assert conditions.pwm_period_s >= least
    assert with_pwm_period(controller_for("omron-e5cc").cycle, _words("omron-e5cc"), conditions.pwm_period_s).values["CP"] == conditions.pwm_period_s


def test_a_cutback_that_is_not_the_band_is_refused_and_told():
    words = _words("eurotherm-3200")
    other = replace(words, values={**words.values, "CB.LO": 500})
    with pytest.raises(OutOfRange, match=r"word CB\.LO = 500 .*124, the proportional band"):
        controller_for("eurotherm-3200").check(other)
    assert any("CB.LO is 50.0 °C" in told for told in controller_for("eurotherm-3200").oddities(other))


def test_makes_are_targets_that_only_their_names_list():
    assert {name for alike in ALIKE.values() for name in alike} == set(MAKES) - {"pband"} == set(NAMES) - set(TARGETS) - set(COOLING.values())
    for name in MAKES:
        assert controller_for(name).name == name
        assert commissioning(name) == commissioning("pband")
    with pytest.raises(UnknownName, match="omron-e5cc"):
        controller_for("omron-e5cd")


# by paper: 100 counts are 10 °C, PB 20 °C: 0.5 % a count; TA/TN 0.1, TV/TA 4, a quarter of the way per sample
BLOCK = PbandBlock(gain=0.5, growth=0.1, slope=4.0, share=0.25, high=100.0, least=0.0, band=200.0, approach=math.inf, alpha=0.5, follows=0.5,
              tenth=1.0)


def _run(readings, setpoint=100, block=BLOCK, **assume):
    state, found = PbandState(), []
    for reading in readings:
        state, power, _, _ = step((block, PbandAssumptions(**assume)), state, setpoint, reading, False)
        found.append(power)
    return found


@pytest.mark.parametrize(("assume", "block", "powers"), [
    # e 40, 20, 10: I 2, 3, 3.5; D −0.25·4·20 = −20, then −20·¾ − 10 = −25
    ({}, {}, [22.0, 3.0, 0.0]),
    ({}, {"slope": 0.0}, [22.0, 13.0, 8.5]),
    ({}, {"slope": 0.0, "growth": 0.0}, [20.0, 10.0, 5.0]),
    ({}, {"slope": 0.0, "high": 15.0}, [15.0, 11.0, 6.5]),  # at the limit I stays 0
    ({"anti_windup": 1}, {"slope": 0.0, "high": 15.0}, [15.0, 6.0, 1.5]),  # I is 15 − 20 = −5, then −4, −3.5
    ({"anti_windup": 2}, {"slope": 0.0, "band": 20.0}, [20.0, 10.0, 5.5]),  # outside ±20 I is 0
    ({}, {"approach": 15.0}, [22.0, 13.0, 0.0]),  # beyond 15 counts no D; then 5 − 12.5 + 3.5
    ({}, {"slope": 0.0, "least": 9.0}, [22.0, 13.0, 0.0]),
    ({}, {"slope": 0.0, "least": 20.0}, [22.0, 0.0, 0.0]),
    # led 60 at first, then 80, 90: half of 100 and half of it: 80, 90, 95 less 60, 80, 90
    ({"filtered": True}, {"slope": 0.0, "growth": 0.0}, [10.0, 5.0, 2.5]),
    ({"displayed": True}, {"slope": 0.0, "growth": 0.0, "tenth": 30.0}, [15.0, 0.0, 0.0]),  # 90 less 60, 90, 90
])
def test_a_row_of_samples_is_the_one_worked_out_on_paper(assume, block, powers):
    assert _run([60, 80, 90], block=BLOCK._replace(**block), **assume) == pytest.approx(powers)


def test_a_step_of_the_setpoint_reaches_the_derivative_of_the_error_alone():
    for on_error, kick in ((False, 0.0), (True, 0.5 * 0.25 * 4.0 * 10)):
        state, _, _, _ = step((BLOCK._replace(growth=0.0), PbandAssumptions(on_error=on_error)), PbandState(), 100, 60, False)
        _, power, _, _ = step((BLOCK._replace(growth=0.0), PbandAssumptions(on_error=on_error)), state, 110, 60, False)
        assert power == 25.0 + kick


def test_whole_numbers_cut_the_integral_and_round_the_output():
    block = BLOCK._replace(slope=0.0, growth=0.001)
    state, powers, exact = PbandState(), [], Fraction(0)
    for reading in (99, 98, 99, 97):
        state, power, _, _ = step((block, PbandAssumptions(whole=True)), state, 100, reading, False)
        error = 100 - reading
        exact = Fraction(int((exact + Fraction(error, 2) * Fraction(1, 1000)) * 2**24), 2**24)
        assert state.integral == pytest.approx(float(exact), abs=2.0 ** -24)
        powers.append(power)
    assert powers == [0.5, 1.0, 0.5, 1.5]


@pytest.mark.law
@given(setpoint=st.integers(-32768, 32767), readings=st.lists(st.integers(-32768, 32767), min_size=1, max_size=20),
       switches=st.tuples(st.integers(0, 2), *(st.booleans() for _ in range(5))))
def test_a_sample_is_total(setpoint, readings, switches):
    for name in ("omron-e5cc", "abb-commander-300"):
        running = controller_for(name).begin(_words(name), PbandAssumptions(*switches))
        for reading in readings:
            running, scan = controller_for(name).step(running, setpoint, reading)
            assert 0.0 <= scan.power_pct <= 100.0
            assert all(map(math.isfinite, running.state))


@makes
def test_both_files_read_back_and_say_what_was_not_checked(name):
    for changed in ({}, {"tn": math.inf, "tv": 0.0}):
        words = _words(name, **changed)
        files = controller_for(name).export(words, PASSED)
        assert len(files) == 2
        for text in files.values():
            assert _read(name, text).words == words
            assert "verdict of the proof: PASS" in text
            unread = [entry.name for entry in MAKES[name].entries if not entry.read]
            assert ("NOT CHECKED" in text) == bool(unread)
            assert all(word in text for word in unread)


DUMP = """\
# CX-Thermo would not print this: address, number
0x2708, 20
2D19H = 0
9999, 17
10752 123
10753;1333
0x2A02: 214
0x2A05 1000
0x2A06 0
0x3309 1
330AH 65
"""


def test_a_dump_of_registers_is_read_and_what_is_none_is_told():
    read = _read("omron-e5cc", DUMP)
    assert read.words.values == _words("omron-e5cc").values | {"CP": 20}
    assert read.passed_over == ("register 9999 = 17 (line 4)",)
    assert _read("omron-e5cc", DUMP.replace("0x2708, 20", "0x2708, 65534")).words.values["CP"] == -2


def test_names_have_their_decimal_point():
    sheet = "Pb 12.3 °C\nti=133 s\ntd: 21\nCYC 2.0\nOPH 100\n"
    assert _read("pband", sheet).words.values == _words("pband").values


@pytest.mark.parametrize(("name", "old", "new", "said"), [
    ("omron-e5cc", "10752 123", "10752 0", ("line 5", "P: '0'", "1…9999")), ("omron-e5cc", "10752 123", "10752 12.3", ("line 5", "'12.3'")),
    ("omron-e5cc", "10752 123", "", ("P (2A00H) is missing", "proportional band")),
    ("omron-e5cc", "10752 123", "10752 123\n2A00H 124", ("line 6", "'124'", "123, as in line 5")),
    ("omron-e5cc", "10752 123", "P 12.34", ("P: '12.34'", "at most 1 decimal places")), ("omron-e5cc", "10752 123", "Q 12.3", ("line 5", "one of CP")),
    ("omron-e5cc", "10752 123", "P 12.3 of 400", ("line 5", "one value and its unit")), ("omron-e5cc", "10752 123", "P", ("line 5", "a name or an address")),
    ("omron-e5cc", "0x2708, 20", "0x2708, 100", ("line 2", "-2…99")), ("omron-e5cc", "0x2708, 20", "0x2708, 0x", ("line 2", "0x")),
])
def test_a_bad_line_is_told_by_number_field_and_value(name, old, new, said):
    _refused(name, DUMP.replace(old, new), "dump.txt", *said)


@pytest.mark.parametrize(("old", "new", "said"), [
    ("10752,2A00", "10753,2A00", "address of P: '10753, 2A00'; expected '10752, 2A00'"), ("10752,2A00,P", "10752,2A00,X", "name: 'X'"),
    (",degC,INT16", ",INT16", "expected 9 cells"),
])
def test_a_damaged_list_of_registers_is_refused(old, new, said):
    text = controller_for("omron-e5cc").export(_words("omron-e5cc"), PASSED)["omron_e5cc_registers.csv"]
    assert old in text
    _refused("omron-e5cc", text.replace(old, new), said.replace("'10752, 2A00'", "10752, 2A00"))


def test_an_export_that_does_not_read_back_is_refused(monkeypatch):
    monkeypatch.setattr("heatertune.plc.pband.export.from_text", lambda *_: _read("omron-e5cc", DUMP).words)
    with pytest.raises(ExportRefused, match="does not read back"):
        controller_for("omron-e5cc").export(_words("omron-e5cc"), PASSED)


def test_an_instrument_that_samples_at_one_interval_needs_none_told():
    sheet = controller_for("omega-cn7800").export(_words("omega-cn7800"), PASSED)["omega_cn7800_sheet.txt"]
    assert _read("omega-cn7800", sheet, interval=None).words.sample_time_s == 0.4
    with pytest.raises(InputError, match="--called-every is needed"):
        _read("pband", controller_for("pband").export(_words("pband"), PASSED)["pband_sheet.txt"], interval=None)


@pytest.mark.long(seconds=20)
@pytest.mark.parametrize("name", [name for name in MAKES if name != "pband"])
def test_a_typical_oven_passes_on_every_make(name):
    oven = model_by_hand(Fopdt(gain_degC_per_pct=4.0, time_constant_s=600.0, dead_time_s=20.0, ambient_degC=20.0))
    made = find_passing_design(oven, DesignRequest(target=name, scaling=OVEN, conditions=Conditions(setpoint_degC=150.0)))
    assert made.proof.verdict == "PASS"
    assert controller_for(name).export(made.proof.words, PASSED)
