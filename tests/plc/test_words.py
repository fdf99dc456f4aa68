"""Words at the edges of what they hold, and what is told beside them; the expected values are the manuals', or worked out by hand."""

import math
from dataclasses import replace

import pytest

from heatertune.errors import InputError, NotRepresentable, OutOfRange
from heatertune.pid.design_values import PidDesign, Timer, structure_of
from heatertune.plc import Certificate, Scaling, WordField, Words, controller_for
from heatertune.plc.s5_ob251.export import to_image
from heatertune.plc.s5_ob251.words import most_gain
from heatertune.plc.words import check_fields, holds, round_half_away, round_to_word, timer_interval_s
from heatertune.proof.words_file import words_of

SINGLE = (2.0 - 2.0**-23) * 2.0**127
DAY_MS = 24 * 3600 * 1000

# tables 11-10 and 11-11 of the S5-115U manual
OB251 = [("K", "DW1", "KF", -32768, 32767), ("R", "DW3", "KF", -32768, 32767), ("TI", "DW5", "KF", 0, 9999), ("TD", "DW7", "KF", 0, 999),
         ("W", "DW9", "KF", -2047, 2047), ("STEU", "DW11", "KM", 0, 0xFFFF), ("YH", "DW12", "KF", -2047, 2047),
         ("BGOG", "DW14", "KF", -2047, 2047), ("BGUG", "DW16", "KF", -2047, 2047)]
# page 7 of the PID tip; OB35 is called every 1 ms to 1 min
TIP = [("GAIN", "DBD10", "REAL", -SINGLE, SINGLE), ("RATE", "DBD14", "REAL", 0.0, SINGLE), ("RESET", "DBD18", "REAL", 0.0, SINGLE),
       ("SAMPLE", "DBD22", "REAL", 1.0, 60_000.0)]
# parameter table of CONT_C; PVPER_ON is a BOOL without a range of its own, and FALSE by default
CONT_C = [*((name, f"DBX0.{bit}", "BOOL", 0, 1) for bit, name in enumerate(
              ("MAN_ON", "PVPER_ON", "P_SEL", "I_SEL", "INT_HOLD", "I_ITL_ON", "D_SEL"), 1)),
          ("CYCLE", "DBD2", "TIME", 1, 60_000), ("MAN", "DBD16", "REAL", -SINGLE, SINGLE), ("GAIN", "DBD20", "REAL", -SINGLE, SINGLE),
          *((name, f"DBD{place}", "TIME", 0, 2**31 - 1) for name, place in (("TI", 24), ("TD", 28), ("TM_LAG", 32))),
          ("DEADB_W", "DBD36", "REAL", 0.0, SINGLE),
          *((name, f"DBD{place}", "REAL", -SINGLE, SINGLE) for name, place in (
              ("LMN_HLM", 40), ("LMN_LLM", 44), ("PV_FAC", 48), ("PV_OFF", 52), ("LMN_FAC", 56), ("LMN_OFF", 60), ("I_ITLVAL", 64), ("DISV", 68)))]
# help of WPS: gains are not negative, Output is heater power; Type and Action have two values, Ts is an UINT of ms
WEG = [*((name, name, "REAL", 0.0, SINGLE) for name in ("Kp", "Ki", "Kd", "TauSetPoint")),
       *((name, name, "REAL", 0.0, 100.0) for name in ("MinimumOutput", "MaximumOutput")),
       *((name, name, "BYTE", 0, 1) for name in ("Type", "Action")), ("Ts", "Ts", "UINT", 1, 65535)]


@pytest.mark.parametrize(("target", "fields"), [
    ("s5-ob251", OB251), ("s7-300", TIP), ("fb41", CONT_C), ("weg", WEG), ("on-off", [("BAND", "register 2", "INT", 1, 2047)]),
])
def test_the_words_stand_where_the_manual_has_them_and_hold_what_it_allows(target, fields):
    assert [(f.name, f.address, f.format, f.low, f.high) for f in controller_for(target).fields] == fields


@pytest.mark.parametrize(("form", "low", "high"), [
    ("BOOL", 0, 1), ("BYTE", 0, 255), ("INT", -(2**15), 2**15 - 1), ("KF", -(2**15), 2**15 - 1), ("WORD", 0, 2**16 - 1),
    ("UINT", 0, 2**16 - 1), ("KM", 0, 2**16 - 1), ("TIME", -(2**31), 2**31 - 1),
])
def test_a_format_holds_its_bits(form, low, high):
    # IEC 61131-3, and STEP 5's KF and KM: 1, 8, 16 and 32 bits, with a sign or without
    assert [holds(form, value) for value in (low - 1, low, high, high + 1)] == [False, True, True, False]
    assert not holds(form, 0.5)


def test_a_word_that_is_missing_unknown_or_out_of_its_range_is_refused_by_its_name():
    fields = (WordField(name="N", address="1", format="INT", low=-5, high=7, comment=""),
              WordField(name="G", address="2", format="REAL", low=0.0, high=2.5, comment=""))

    def check(values):
        check_fields(fields, Words(target="x", values=values, scaling=Scaling(), sample_time_s=1.0))

    for n, g in ((-5, 0.0), (7, 2.5), (0, 1)):
        check({"N": n, "G": g})
    whole, single = "must be a whole number -5…7", r"must be a number in single precision 0…2\.5"
    for values, told in [({"N": -6, "G": 1.0}, f"word N = -6.*{whole}"), ({"N": 8, "G": 1.0}, f"word N = 8.*{whole}"), ({"N": 1}, f"word G.*{single}"),
                         ({"N": 1, "G": 0.1}, f"word G.*{single}"), ({"N": 1, "G": 2.75}, f"word G.*{single}"), ({"N": 1, "G": 1.0, "A": 2}, "word A = 2.*must be one of N, G")]:
        with pytest.raises(OutOfRange, match=told):
            check(values)


@pytest.mark.parametrize(("value", "whole"), [(0.5, 1), (-0.5, -1), (0.499, 0), (-0.499, 0), (1.5, 2), (-1.5, -2), (2.0, 2), (1.499, 1)])
def test_halves_are_rounded_away_from_zero(value, whole):
    assert (round_half_away(value), type(round_half_away(value))) == (whole, int)


@pytest.mark.parametrize(("interval", "kept"), [
    (0.5, 0.5), (10.0, 10.0), (2.5, 2.5), (2.5 + 4e-7, 2.5), (2.5 - 4e-7, 2.5), (2.5 + 6e-7, "2.5"), (0.49, "0.5"), (10.5, "10"), (2.7, "2.5"), (2.8, "3"),
])
def test_a_timer_keeps_a_millionth_of_its_step_and_names_the_nearest_that_it_keeps(interval, kept):
    timer = Timer(shortest_s=0.5, longest_s=10.0, step_s=0.5)
    if isinstance(kept, float):
        assert timer_interval_s(timer, interval) == kept
        return
    with pytest.raises(NotRepresentable, match=rf"allowed 0\.5…10 s in steps of 0\.5 s; {kept} s would fit"):
        timer_interval_s(timer, interval)


def test_a_scaling_is_0_to_100_and_a_certificate_not_forced_unless_told_so():
    assert (Scaling().low_degC, Scaling().high_degC, Scaling(low_degC=-20.0, high_degC=130.0).span_degC) == (0.0, 100.0, 150.0)
    assert Certificate(verdict="PASS", lines=("a", "b")).head == ("verdict of the proof: PASS", "a", "b")
    assert Certificate(verdict="FAIL", forced=True).head == ("verdict of the proof: FAIL - FORCED in spite of it",)


@pytest.mark.parametrize(("ends", "told"), [
    ({"high_degC": math.inf}, "high_degC = inf"), ({"high_degC": math.nan}, "high_degC = nan"), ({"low_degC": -math.inf}, "low_degC = -inf"), ({"low_degC": math.nan}, "low_degC = nan"),
])
def test_an_end_of_a_sensor_range_that_is_no_number_is_refused_by_its_name(ends, told):
    with pytest.raises(OutOfRange, match=f"^{told} is out of range"):
        Scaling(**ends)


@pytest.mark.parametrize(("exact", "held"), [(2.5, 2.5), (0.0, 0.0), (2.5001, None), (-0.001, None)])
def test_a_real_keeps_the_range_of_its_word(exact, held):
    field = WordField(name="G", address="1", format="REAL", low=0.0, high=2.5, comment="")
    if held is None:
        with pytest.raises(NotRepresentable, match="word G would be"):
            round_to_word(field, exact)
    else:
        assert round_to_word(field, exact) == held


def _design(gain=1.0, tn=200.0, tv=0.0, ta=10.0, past=None):
    filtered = {} if past is None else {"derivative_filter": past}
    return PidDesign(gain_pct_per_degC=gain, integral_time_s=tn, derivative_time_s=tv, sample_time_s=ta, structure=structure_of(tn, tv),
                     method="", **filtered)


def _refused(target, design, told, scaling=None):
    with pytest.raises(NotRepresentable) as refused:
        controller_for(target).encode(design, scaling or Scaling())
    assert str(refused.value) == told


def _words(target, values, ta, scaling=None):
    return Words(target=target, values=values, scaling=scaling or Scaling(), sample_time_s=ta)


# 2047 units over the range and over full power: 1 %/°C over 100 °C is 1 unit per unit, 1024
@pytest.mark.parametrize(("design", "words"), [
    (_design(), {"K": 1024, "TI": 51, "TD": 0}),  # 1024·10/200 = 51.2
    (_design(gain=-1.0, tn=math.inf), {"K": -1024, "TI": 0, "TD": 0}),
    (_design(gain=32767 / 1024), {"K": 32767, "TI": 51, "TD": 0}), (_design(gain=-32767.4 / 1024), {"K": -32767, "TI": 51, "TD": 0}),
    (_design(gain=1500 / 1024, tv=5.0), {"K": 1500, "TI": 51, "TD": 1}), (_design(tn=10240 / 9999), {"K": 1024, "TI": 9999, "TD": 0}),
    (_design(gain=0.00049), {"K": 1, "TI": 51, "TD": 0}), (_design(tn=20480.0), {"K": 1024, "TI": 1, "TD": 0}),
    (_design(tv=9994.9, tn=math.inf), {"K": 1024, "TI": 0, "TD": 999}), (_design(tv=14.9), {"K": 1024, "TI": 51, "TD": 1}),
])
def test_the_words_of_ob251_are_multiples_of_1_over_1024_nearest_to_the_design(design, words):
    rest = {"R": 1024, "W": 0, "STEU": 33, "YH": 0, "BGOG": 2047, "BGUG": 0}
    assert controller_for("s5-ob251").encode(design, Scaling()).values == {**words, **rest}


@pytest.mark.parametrize(("design", "told"), [
    # TI = 1024·TA/TN reaches a half at TA = 0.5·TN/1024 = 0.1465 s
    (_design(tn=300.0, ta=0.1), "word TI would be 0.341333, allowed 1…9999 (0 switches the part off); a slower TA of at least 0.15 s would fit (now 0.1 s)"),
    (_design(tn=1.0), "word TI would be 10240, allowed 1…9999; a faster TA would fit"),
    (_design(tv=4.0), "word TD would be 0.4, allowed 1…999 (0 switches the part off); a faster TA of at most 8 s would fit"),
    (_design(tv=0.5, ta=2.0), "word TD would be 0.25, allowed 1…999 (0 switches the part off); a faster TA of at most 1 s would fit"),
    (_design(tv=9995.0, ta=10.0), "word TD would be 999.5, allowed 1…999; a slower TA would fit"),
    (_design(gain=40.0), "word K would be 40960, allowed 1…32767 in size; a sensor range of 80 °C or a smaller K would fit"),
    (_design(gain=-40.0), "word K would be -40960, allowed 1…32767 in size; a sensor range of 80 °C or a smaller K would fit"),
    (_design(gain=1.6, tv=20.0), "word K would be 1638, allowed 1…1500 in size; a sensor range of 91.6 °C or a smaller K would fit"),
    (_design(gain=0.0004), "word K would be 0, allowed 1…32767 in size; a sensor range of 3.28e+06 °C or a smaller K would fit"),
])
def test_ob251_tells_what_would_fit_where_a_design_does_not(design, told):
    _refused("s5-ob251", design, told)


def test_the_largest_gain_of_ob251_is_that_of_its_word():
    assert most_gain(Scaling(), _design()) == 32767 / 1024
    assert most_gain(Scaling(high_degC=200.0), _design(tv=5.0)) == 1500 / 2048  # 1 %/°C over 200 °C is 2048
    assert most_gain(Scaling(), _design(tv=4.9)) == most_gain(Scaling(), _design(tv=0.5, ta=2.0)) == 0.0  # TD would be 0
    assert most_gain(Scaling(), _design(tv=0.5, ta=1.0)) == 1500 / 1024


OB251_WORDS = {"K": 1024, "R": 1024, "TI": 20, "TD": 0, "W": 0, "STEU": 33, "YH": 0, "BGOG": 2047, "BGUG": 0}


@pytest.mark.parametrize(("changed", "gain", "tn", "tv"), [
    ({"K": 1024, "R": 512, "TI": 64, "TD": 3}, 0.5, 80.0, 60.0),  # K·R; TN = R·TA·1024/TI, TV = TA·TD/R
    ({"K": -512, "TI": 0}, -0.5, math.inf, 0.0), ({"R": -1024, "TI": 0, "K": 1}, -1 / 1024, math.inf, 0.0),
    ({"K": 1500, "TD": 1}, 1500 / 1024, 512.0, 10.0), ({"K": -1500, "TD": 1}, -1500 / 1024, 512.0, 10.0), ({"R": 1500, "TD": 1}, 1500 / 1024, 750.0, 10240 / 1500),
    ({"K": 32767}, 32767 / 1024, 512.0, 0.0),
])
def test_what_the_words_of_ob251_make_is_read_from_them(changed, gain, tn, tv):
    found = controller_for("s5-ob251").decode(_words("s5-ob251", OB251_WORDS | changed, 10.0))
    assert (found.gain_pct_per_degC, found.integral_time_s, found.derivative_time_s) == pytest.approx((gain, tn, tv), rel=1e-12)


@pytest.mark.parametrize(("changed", "told"), [
    ({"K": 1501, "TD": 1}, "word K = 1501"), ({"K": -1501, "TD": 1}, "word K = -1501"), ({"R": 1501, "TD": 1}, "word R = 1501"), ({"R": -1501, "TD": 1}, "word R = -1501"),
    ({"K": 0}, "word K = 0"), ({"R": 0}, "word R = 0"), ({"R": -1}, "word R = -1"), ({"R": -1, "TI": 0, "TD": 1}, "word R = -1"), ({"BGUG": 1, "BGOG": 0}, "word BGUG = 1"),
])
def test_words_of_ob251_that_make_no_standard_form_are_refused(changed, told):
    with pytest.raises(OutOfRange, match=told):
        controller_for("s5-ob251").decode(_words("s5-ob251", OB251_WORDS | changed, 10.0))


def test_the_last_sizes_beside_a_d_part_are_held():
    # table 11-11: K and R of −1500…1500 beside a D part; a negative R is held, but has no standard form there
    for changed in ({"R": -1500, "TD": 1}, {"R": 1500, "TD": 1}, {"K": -1500, "TD": 1}, {"K": 1500, "TD": 1}, {"K": 1501, "R": -1501}):
        controller_for("s5-ob251").check(_words("s5-ob251", OB251_WORDS | changed, 10.0))


COARSE_9 = "TI is 9: half a word is 6 % of TN; a slower TA makes it finer."
NOT_1024 = "R is {}, not 1024: the proportional part is K·R; TN and TV change with R."


@pytest.mark.parametrize(("changed", "told"), [
    ({}, []), ({"TI": 10}, []), ({"TI": 9}, [COARSE_9]), ({"TI": 1}, ["TI is 1: half a word is 50 % of TN; a slower TA makes it finer."]), ({"TI": 0}, ["TI is 0: the controller has no integral action."]),
    ({"R": 1023}, [NOT_1024.format(1023)]), ({"R": 1}, [NOT_1024.format(1)]), ({"R": 0}, ["R is 0: the controller has no proportional action.", "I alone: K·TI is 0.01953 units per unit of XW and call."]),
    ({"R": 0, "TD": 1}, ["R is 0: the controller has no proportional action."]), ({"R": 0, "K": 0}, ["R is 0: the controller has no proportional action.", "K is 0: the output never moves."]),
    ({"R": 0, "TI": 0}, ["TI is 0: the controller has no integral action.", "R is 0: the controller has no proportional action."]),
    ({"R": -1}, ["R is -1: the proportional part acts against the others."]), ({"R": -1, "TI": 0}, ["TI is 0: the controller has no integral action.", NOT_1024.format(-1)]),
    ({"R": -1, "TI": 0, "TD": 1}, ["TI is 0: the controller has no integral action.", "R is -1: the proportional part acts against the others."]),
    ({"K": 0}, ["K is 0: the output never moves."]), ({"K": 0, "STEU": 1}, ["K is 0: the output moves by Z alone.", "STEU bit 5 is 0: the disturbance variable Z is added to the output."]),
    ({"K": 1, "TI": 1024, "R": 1}, [NOT_1024.format(1)]), ({"K": -1}, ["K is -1: the output falls where the temperature is too low, as for a cooler."]), ({"K": 1500, "TD": 1}, []), ({"K": 1}, []), ({"K": 1501}, []),
    ({"K": 1501, "TD": 1}, ["K is 1501 with a derivative part: the manual allows ±1500 where XW can jump."]),
    ({"BGOG": 1}, []), ({"BGOG": 0}, ["BGOG is not above BGUG: the output cannot move."]), ({"BGOG": 7, "BGUG": 7}, ["BGOG is not above BGUG: the output cannot move."]),
    ({"STEU": 32}, ["STEU bit 0 is 0: the controller is in manual mode."]), ({"STEU": 35}, ["STEU bit 1 is 1: the derivative part acts on XZ."]),
    ({"STEU": 37}, ["STEU bit 2 is 1: the controller is switched off and its state cleared at each call."]),
    ({"STEU": 41}, ["STEU bit 3 is 1: the output is an increment (velocity algorithm), not a position."]), ({"STEU": 49 + 0xFFC0}, []),
])
def test_what_is_odd_about_a_db_of_ob251_is_told(changed, told):
    assert list(controller_for("s5-ob251").oddities(_words("s5-ob251", OB251_WORDS | changed, 10.0))) == told


@pytest.mark.parametrize(("size", "fits"), [(96, False), (97, False), (98, True), (99, False), (100, True), (512, True)])
def test_a_db_of_ob251_has_49_words_or_more(size, fits):
    image = b"".join(n.to_bytes(2, "big") for n in (0, 0xFFFF, 0, 0x8000 >> 5, 0, 7, 0, 0, 0, 0, 0, 0xFF21)) + bytes(488)
    read = {"sample_time_s": 1.0, "scaling": Scaling(), "source": "DB"}
    if fits:
        found = controller_for("s5-ob251").read_image(image[:size], **read).values
        assert found == {"K": -1, "R": 1024, "TI": 7, "TD": 0, "W": 0, "STEU": 0x21, "YH": 0, "BGOG": 0, "BGUG": 0}
    else:
        with pytest.raises(InputError, match=rf"{size} bytes; expected 98 \(49 words\) or more, in whole words"):
            controller_for("s5-ob251").read_image(image[:size], **read)


WEG_PLAIN = {"TauSetPoint": 0.0, "MinimumOutput": 0.0, "MaximumOutput": 100.0, "Type": 0}
def test_a_db_of_ob251_is_written_word_by_word_high_byte_first_and_0_where_the_user_writes_nothing():
    image = to_image(_words("s5-ob251", OB251_WORDS | {"K": -2, "R": 0x1234, "W": -2047, "YH": 3, "BGUG": -1}, 10.0))
    cells = {1: 0xFFFE, 3: 0x1234, 5: 20, 9: 0x10000 - 2047, 11: 33, 12: 3, 14: 2047, 16: 0xFFFF}
    assert image == b"".join(cells.get(place, 0).to_bytes(2, "big") for place in range(49))


CONT_C_WORDS = {"MAN_ON": 0, "PVPER_ON": 1, "P_SEL": 1, "INT_HOLD": 0, "I_ITL_ON": 0, "MAN": 0.0, "DEADB_W": 0.0, "LMN_HLM": 100.0, "LMN_LLM": 0.0,
                "LMN_FAC": 1.0, "LMN_OFF": 0.0, "I_ITLVAL": 0.0, "DISV": 0.0, "PV_FAC": 1.0, "PV_OFF": 0.0}


@pytest.mark.parametrize(("design", "words"), [
    # TI = TN + TA/2, GAIN = K·TI/TN, TD = TV·TN/TI, TM_LAG = TA/2·(1 + f)/(1 − f); the block's own times where a part is off
    (_design(tn=math.inf, ta=1.0), {"I_SEL": 0, "D_SEL": 0, "CYCLE": 1000, "TI": 20000, "TD": 10000, "TM_LAG": 2000, "GAIN": 1.0}),
    (_design(tn=math.inf, ta=5.001), {"I_SEL": 0, "D_SEL": 0, "CYCLE": 5001, "TI": 20000, "TD": 10000, "TM_LAG": 2501, "GAIN": 1.0}),
    (_design(gain=2.0, tn=1.5, ta=1.0), {"I_SEL": 1, "D_SEL": 0, "CYCLE": 1000, "TI": 2000, "TD": 10000, "TM_LAG": 2000, "GAIN": 2.0 * 2.0 / 1.5}),
    (_design(tn=1.5, tv=4.0, ta=1.0, past=0.5), {"I_SEL": 1, "D_SEL": 1, "CYCLE": 1000, "TI": 2000, "TD": 3000, "TM_LAG": 1500, "GAIN": 4.0 / 3.0}),
    (_design(tn=math.inf, tv=1.0, ta=1.0, past=0.0), {"I_SEL": 0, "D_SEL": 1, "CYCLE": 1000, "TI": 20000, "TD": 1000, "TM_LAG": 500, "GAIN": 1.0}),
    (_design(tn=math.inf, tv=1.0, ta=1.0, past=0.8), {"I_SEL": 0, "D_SEL": 1, "CYCLE": 1000, "TI": 20000, "TD": 1000, "TM_LAG": 4500, "GAIN": 1.0}),
    (_design(tn=math.inf, tv=0.5, ta=0.25, past=0.0), {"I_SEL": 0, "D_SEL": 1, "CYCLE": 250, "TI": 20000, "TD": 500, "TM_LAG": 125, "GAIN": 1.0}),
    (_design(tn=0.0005, ta=1.0), {"I_SEL": 1, "D_SEL": 0, "CYCLE": 1000, "TI": 501, "TD": 10000, "TM_LAG": 2000, "GAIN": 501.0}),
    (_design(tn=2147483.147, ta=1.0), {"I_SEL": 1, "D_SEL": 0, "CYCLE": 1000, "TI": 2**31 - 1, "TD": 10000, "TM_LAG": 2000, "GAIN": 1.0}),
])
def test_the_words_of_cont_c_make_the_design_of_rectangles_by_trapezoids(design, words):
    assert controller_for("fb41").encode(design, Scaling()).values == pytest.approx(CONT_C_WORDS | words, rel=3e-7)


@pytest.mark.parametrize(("design", "told"), [
    (_design(tn=0.0004, ta=1.0), "word TI would be 500.4, allowed 501..2147483647 ms, or the block raises it; a longer time would fit"),
    (_design(tn=math.inf, tv=0.9994, ta=1.0), "word TD would be 999.4, allowed 1000..2147483647 ms, or the block raises it; a faster TA would fit"),
    (_design(tn=2147483.148, ta=1.0), "word TI would be 2.14748e+09, allowed 501..2147483647 ms; 2.14748e+06 s would fit"),
    (_design(tn=1e100, ta=1.0), "word TI would be 1e+103, allowed 501..2147483647 ms; 2.14748e+06 s would fit"),
])
def test_cont_c_tells_what_would_fit_where_a_design_does_not(design, told):
    _refused("fb41", design, told)


@pytest.mark.parametrize(("changed", "scaling", "ta", "design"), [
    # share (TI − CYCLE/2)/TI = 7/8; f = (TM_LAG − CYCLE/2)/(TM_LAG + CYCLE/2)
    ({}, (0.0, 100.0), 1.0, (1.75, 3.5, 8.0 / 0.875, 0.5)), ({"I_SEL": 0}, (0.0, 100.0), 1.0, (2.0, math.inf, 8.0, 0.5)),
    ({"D_SEL": 0}, (0.0, 100.0), 1.0, (1.75, 3.5, 0.0, 0.0)), ({"TD": 999, "TM_LAG": 499}, (0.0, 100.0), 1.0, (1.75, 3.5, 1.0 / 0.875, 0.0)),
    ({"PV_FAC": 3.0, "LMN_FAC": 0.5}, (-50.0, 150.0), 1.0, (1.75 * 1.5 / 2.0, 3.5, 8.0 / 0.875, 0.5)), ({}, (0.0, 100.0), 2.0, (1.75, 7.0, 16.0 / 0.875, 0.5)),
    ({"P_SEL": 0}, (0.0, 100.0), 1.0, None), ({"GAIN": 0.0}, (0.0, 100.0), 1.0, None), ({"TI": 499}, (0.0, 100.0), 1.0, None),
])
def test_what_the_words_of_cont_c_make_is_read_from_them(changed, scaling, ta, design):
    plain = CONT_C_WORDS | {"I_SEL": 1, "D_SEL": 1, "CYCLE": 1000, "TI": 4000, "TD": 8000, "TM_LAG": 1500, "GAIN": 2.0}
    found = controller_for("fb41").decode(_words("fb41", plain | changed, ta, Scaling(low_degC=scaling[0], high_degC=scaling[1])))
    if design is None:
        assert found is None
    else:
        assert (found.gain_pct_per_degC, found.integral_time_s, found.derivative_time_s, found.derivative_filter) == pytest.approx(design, rel=1e-12)


@pytest.mark.parametrize(("changed", "told"), [
    ({}, []), ({"TI": 500, "TD": 1000, "TM_LAG": 500}, []), ({"TI": 499}, ["TI is 499 ms: the block raises it to half a CYCLE."]),
    ({"TI": 499, "I_SEL": 0}, ["I_SEL is 0: there is no integral part."]), ({"TD": 999}, ["TD is 999 ms: the block raises it to CYCLE."]), ({"TD": 999, "TM_LAG": 499, "D_SEL": 0}, []),
    ({"TM_LAG": 499}, ["TM_LAG is 499 ms: the block raises it to half a CYCLE."]), ({"CYCLE": 1001}, ["CYCLE is 1001 ms, but the block is called every 1000 ms: all times are 0.999 times what the words say."]),
    ({"MAN_ON": 1}, ["MAN_ON is 1: the controller is in manual, LMN is MAN."]), ({"P_SEL": 0}, ["P_SEL or GAIN is 0: there is no proportional part."]),
    ({"GAIN": 0.0}, ["P_SEL or GAIN is 0: there is no proportional part."]), ({"INT_HOLD": 1}, ["INT_HOLD is 1: the integral part stands still."]),
    ({"INT_HOLD": 1, "I_ITL_ON": 1, "I_SEL": 0}, ["I_SEL is 0: there is no integral part."]), ({"I_ITL_ON": 1}, ["I_ITL_ON is 1: the integral part is I_ITLVAL for ever."]),
    ({"DEADB_W": 0.5}, ["DEADB_W is 0.5: inside it the temperature drifts."]), ({"LMN_LLM": 5.0}, ["LMN is limited to 5…100 %, not to 0…100 %."]),
    ({"LMN_HLM": 80.0}, ["LMN is limited to 0…80 %, not to 0…100 %."]), ({"LMN_FAC": 2.0}, ["LMN_FAC and LMN_OFF change the output: it is not in %."]),
    ({"LMN_OFF": 0.5}, ["LMN_FAC and LMN_OFF change the output: it is not in %."]), ({"GAIN": -2.0, "PV_FAC": -1.0}, []), ({"GAIN": 0.25, "PV_FAC": 0.5}, []),
    ({"GAIN": -0.5}, ["the gain is negative: the output falls where the temperature is too low."]),
])
def test_what_is_odd_about_an_instance_of_cont_c_is_told(changed, told):
    plain = CONT_C_WORDS | {"I_SEL": 1, "D_SEL": 1, "CYCLE": 1000, "TI": 4000, "TD": 8000, "TM_LAG": 1500, "GAIN": 2.0}
    assert list(controller_for("fb41").oddities(_words("fb41", plain | changed, 1.0))) == told


def test_an_instance_of_cont_c_that_is_called_at_another_interval_than_its_cycle_is_odd():
    plain = CONT_C_WORDS | {"I_SEL": 1, "D_SEL": 1, "CYCLE": 5000, "TI": 4000, "TD": 8000, "TM_LAG": 2500, "GAIN": 2.0}
    for called, told in ((5.0, []), (5.000004, []), (10.0, ["CYCLE is 5000 ms, but the block is called every 10000 ms: all times are 2 times what the words say."]),
                         (4.0, ["CYCLE is 5000 ms, but the block is called every 4000 ms: all times are 0.8 times what the words say."])):
        assert list(controller_for("fb41").oddities(_words("fb41", plain, called))) == told


@pytest.mark.parametrize(("design", "target", "words"), [
    # GAIN = K·200 °C/100 %, times in ms
    (_design(gain=1.5, tv=3.0, ta=2.5), "s7-300", {"GAIN": 3.0, "RATE": 3000.0, "RESET": 200_000.0, "SAMPLE": 2500.0}),
    (_design(gain=-1.5, tn=math.inf, ta=2.5), "s7-300", {"GAIN": -3.0, "RATE": 0.0, "RESET": 0.0, "SAMPLE": 2500.0}),
    # CFW500 programming manual, p. 13-12: Ki = 1/Ti, Kd = Td; Ts in ms; the sign is that of Action
    (_design(gain=1.5, tn=4.0, tv=3.0, ta=2.5), "weg", WEG_PLAIN | {"Kp": 1.5, "Ki": 0.25, "Kd": 3.0, "Action": 0, "Ts": 2500}),
    (_design(gain=-0.5, tn=0.5, tv=0.5, ta=0.5), "weg", WEG_PLAIN | {"Kp": 0.5, "Ki": 2.0, "Kd": 0.5, "Action": 1, "Ts": 500}),
    (_design(gain=-1.5, tn=math.inf, ta=2.5), "weg", WEG_PLAIN | {"Kp": 1.5, "Ki": 0.0, "Kd": 0.0, "Action": 1, "Ts": 2500}),
])
def test_the_words_of_the_tip_and_of_wegs_block_are_the_design_in_their_units(design, target, words):
    assert controller_for(target).encode(design, Scaling(high_degC=200.0)).values == words


TIP_WORDS = {"GAIN": 2.0, "RATE": 17000.0, "RESET": 200000.0, "SAMPLE": 5000.0}
RESET_ODD = "RESET is {} ms: shorter than one call or longer than a day; is it in ms?"
RATE_ODD = "RATE is {} ms: shorter than a tenth of a call or longer than a day; is it in ms?"


@pytest.mark.parametrize(("changed", "told"), [
    ({}, []), ({"RATE": 0.0}, []), ({"RATE": 500.0}, []), ({"RATE": 499.0}, [RATE_ODD.format("499")]), ({"RATE": 0.5}, [RATE_ODD.format("0.5")]), ({"RATE": float(DAY_MS)}, []),
    ({"RATE": DAY_MS + 1.0}, [RATE_ODD.format("8.64e+07")]), ({"RESET": 5000.0}, []), ({"RESET": 4999.0}, [RESET_ODD.format("4999")]), ({"RESET": float(DAY_MS)}, []),
    ({"RESET": DAY_MS + 1.0}, [RESET_ODD.format("8.64e+07")]), ({"RESET": 0.0}, ["RESET is 0 (or infinite): the controller has no integral part."]),
    ({"GAIN": 0.0}, ["GAIN is 0: no proportional part; the integral and derivative parts act with a gain of 1."]), ({"GAIN": 0.5}, []),
    ({"GAIN": -0.5}, ["GAIN is negative: the output falls where the temperature is too low, as for a cooler."]), ({"SAMPLE": 5000.004}, []),
    ({"SAMPLE": 4000.0}, ["SAMPLE is 4000 ms, but the block is called every 5000 ms: TN and TV are 1.25 times what RESET and RATE say."]),
])
def test_what_is_odd_about_an_instance_of_the_tip_is_told(changed, told):
    assert list(controller_for("s7-300").oddities(_words("s7-300", TIP_WORDS | changed, 5.0))) == told


def test_the_words_of_the_tip_are_read_in_seconds_and_percent():
    # K = GAIN·100 %/200 °C; TN and TV times 2.5 s/SAMPLE
    found = controller_for("s7-300").decode(_words("s7-300", TIP_WORDS | {"SAMPLE": 1000.0}, 2.5, Scaling(high_degC=200.0)))
    assert (found.gain_pct_per_degC, found.integral_time_s, found.derivative_time_s, found.derivative_filter) == (1.0, 500.0, 42.5, 0.0)


def test_the_shortest_reset_is_still_an_integral_part_and_the_least_gain_a_proportional_one():
    tip = controller_for("s7-300")
    assert tip.decode(_words("s7-300", TIP_WORDS | {"RESET": 1.0, "GAIN": 1.0, "RATE": 0.0}, 5.0)).integral_time_s == 0.001
    assert tip.decode(_words("s7-300", TIP_WORDS | {"RESET": 0.0, "GAIN": -1.0, "RATE": 1.0}, 5.0)).structure == "pd"
    assert tip.decode(_words("s7-300", TIP_WORDS | {"GAIN": 0.0}, 5.0)) is None


def test_a_block_of_weg_without_kp_has_no_standard_form():
    for form in (0, 1):
        with pytest.raises(OutOfRange, match="word Kp = 0"):
            controller_for("weg").decode(_words("weg", WEG_WORDS | {"Kp": 0.0, "Type": form}, 1.5))


WEG_WORDS = {"Kp": 2.0, "Ki": 0.5, "Kd": 0.25, "TauSetPoint": 0.0, "MinimumOutput": 0.0, "MaximumOutput": 100.0, "Type": 0, "Action": 0, "Ts": 1500}


@pytest.mark.parametrize(("changed", "design"), [
    ({}, (2.0, 2.0, 0.25)), ({"Type": 1}, (2.0, 4.0, 0.125)), ({"Action": 1}, (-2.0, 2.0, 0.25)), ({"Ki": 0.0}, (2.0, math.inf, 0.25)), ({"Kp": 0.5, "Kd": 0.0}, (0.5, 2.0, 0.0)),
    ({"MinimumOutput": 50.0, "MaximumOutput": 50.0}, (2.0, 2.0, 0.25)),
])
def test_what_the_words_of_wegs_block_make_is_read_from_them(changed, design):
    found = controller_for("weg").decode(_words("weg", WEG_WORDS | changed, 1.5))
    assert (found.gain_pct_per_degC, found.integral_time_s, found.derivative_time_s, found.derivative_filter) == (*design, 0.0)


@pytest.mark.parametrize(("changed", "told"), [
    ({}, []), ({"Kp": 0.0}, ["Kp is 0: in the academic form nothing acts."]), ({"Ki": 0.0}, ["Ki is 0: there is no integral part."]),
    ({"Kp": 0.0, "Type": 1}, ["Kp is 0: there is no proportional part.", "Type is 1, the parallel form: Ki and Kd act by themselves, not times Kp."]),
    ({"Type": 1}, ["Type is 1, the parallel form: Ki and Kd act by themselves, not times Kp."]), ({"TauSetPoint": 0.5}, ["TauSetPoint is 0.5 s: the setpoint is filtered."]),
    ({"Action": 1}, ["Action is 1: the output falls where the temperature is too low, as for a cooler."]), ({"Kp": 1.0, "Ki": 1.0}, []),
    ({"MinimumOutput": 5.0}, ["Output is limited to 5…100 %, not to 0…100 %."]), ({"MaximumOutput": 60.0}, ["Output is limited to 0…60 %, not to 0…100 %."]),
])
def test_what_is_odd_about_wegs_block_is_told(changed, told):
    assert list(controller_for("weg").oddities(_words("weg", WEG_WORDS | changed, 1.5))) == told


# 4095 counts over the range: 0.5 °C of 100 °C are 20.475
@pytest.mark.parametrize(("span", "band"), [(100.0, 20), (99.8, 21), (5000.0, 1), (1.01, 2027), (1.0003, 2047)])
def test_the_band_of_on_off_is_the_counts_nearest_to_half_a_degree(span, band):
    assert controller_for("on-off").encode(_design(), Scaling(high_degC=span)).values == {"BAND": band}


def test_on_off_tells_what_would_fit_where_a_design_does_not():
    _refused("on-off", _design(), "word BAND would be 2047.91, allowed 1…2047 counts; a sensor range of 1.01 °C or more would fit", Scaling(high_degC=0.9998))
    _refused("on-off", _design(gain=-0.5), "gain would be -0.5, allowed positive: on-off switches on below the setpoint; a PID controller would fit")
    assert controller_for("on-off").encode(_design(gain=0.5), Scaling()).values == {"BAND": 20}


@pytest.mark.parametrize(("interval", "fits"), [(0.01, True), (0.009, False), (600.0, True), (600.1, False)])
def test_the_timer_of_on_off_keeps_10_ms_to_10_min(interval, fits):
    words = _words("on-off", {"BAND": 20}, interval)
    if fits:
        controller_for("on-off").check(words)
    else:
        with pytest.raises(OutOfRange, match=r"sample_time_s.*0\.01…600 s"):
            controller_for("on-off").check(words)


@pytest.mark.parametrize(("band", "told"), [(409, []), (410, ["BAND is 410: the heater switches 20 °C above and below the setpoint."]), (1, [])])
def test_a_band_above_a_tenth_of_the_range_is_odd(band, told):
    # 410·200 °C/4095 = 20.02 °C
    assert list(controller_for("on-off").oddities(replace(_words("on-off", {"BAND": band}, 1.0), scaling=Scaling(high_degC=200.0)))) == told


def test_a_word_that_no_dialog_takes_is_refused_in_a_file_as_well():
    # table 11-10 of the S5-115U manual: TI is 0…9999
    document = {"target": "s5-ob251", "words": {**{name: 0 for name, *_ in OB251}, "K": 1000, "R": 1000, "TI": 9999, "BGOG": 2047},
                "scaling": {"low_degC": 0.0, "high_degC": 100.0}, "sample_time_s": 1.0, "setpoint_ramp": None, "boost": None}
    assert words_of(document, "s5-ob251", "words.json").values["TI"] == 9999
    document["words"]["TI"] = 10_000
    with pytest.raises(OutOfRange, match="word TI"):
        words_of(document, "s5-ob251", "words.json")
