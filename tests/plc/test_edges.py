"""What all controllers share, at the edges where it turns over: each expected value is worked out by hand."""

import math

import pytest

from heatertune.errors import InputError, NotRepresentable, OutOfRange
from heatertune.plc import OpenPoint, Ramp, Scaling, WordField, Words, controller_for
from heatertune.plc.core import Sensor, count
from heatertune.plc.dump_reader import _text
from heatertune.plc.feed_forward import FeedForward, FeedForwardHooks, feed_forward
from heatertune.plc.keyed_entry import KeyedEntry, typed_table, word_text
from heatertune.plc.open_points import settings_to_prove
from heatertune.plc.pwm import Actuator, Ticks, on_time, pid_compact, pulsegen, switched_by
from heatertune.plc.ramp import nearest
from heatertune.plc.readback import WordCollector, first_unlike, lines_of, real_of, text_of, whole_of


# period 8 s in steps of 1 s: 12.5 % are a step, half a step is rounded up
@pytest.mark.parametrize(("power", "carried", "on_s", "off_s", "carries", "expected"), [
    (25.0, 0.0, 0.0, 0.0, False, (2.0, 0.0)), (18.75, 0.0, 0.0, 0.0, False, (2.0, 0.0)), (18.7, 0.0, 0.0, 0.0, False, (1.0, 0.0)),
    (6.2, 0.0, 0.0, 0.0, False, (0.0, 0.0)), (93.7, 0.0, 0.0, 0.0, False, (7.0, 0.0)), (93.75, 0.0, 0.0, 0.0, False, (8.0, 0.0)),
    (25.0, 0.0, 2.0, 0.0, False, (2.0, 0.0)), (24.0, 0.0, 2.0, 0.0, False, (0.0, 0.0)), (75.0, 0.0, 0.0, 2.0, False, (6.0, 0.0)),
    (76.0, 0.0, 0.0, 2.0, False, (8.0, 0.0)), (25.0, 0.25, 0.0, 0.0, True, (2.0, 0.25)), (25.0, 0.5, 0.0, 0.0, True, (3.0, -0.5)),
    (24.0, 0.0, 2.0, 0.0, True, (0.0, 1.92)), (76.0, 0.0, 0.0, 2.0, True, (8.0, -1.92)), (0.0, 0.25, 0.0, 0.0, True, (0.0, 0.25)),
])
def test_a_pulse_is_the_nearest_whole_number_of_steps_and_long_enough(power, carried, on_s, off_s, carries, expected):
    assert on_time(power, carried, (8.0, 1.0, on_s, off_s, carries)) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(("resolution", "period", "sample", "ticks"), [
    (0.01, 10.0, 2.0, Ticks(200, 1000)), (0.1, 1.0, 0.3, Ticks(3, 10)), (0.3, 1.0, 0.3, None), (0.25, 1.0, 0.3, None), (0.01, 10.0, 2.0001, None), (1.0, 8.0, 1.0, Ticks(1, 8)),
])
def test_a_clock_that_ticks_at_the_resolution_makes_calls_and_periods_or_cannot(resolution, period, sample, ticks):
    assert Actuator(pwm_period_s=period, resolution_s=resolution).ticks(sample) == ticks


def test_a_switch_has_no_least_times_and_half_waves_of_50_hz_unless_told_so():
    assert Actuator(pwm_period_s=10.0).numbers == switched_by(None, pwm_period_s=10.0).numbers == (10.0, 0.01, 0.0, 0.0, False)
    assert pulsegen(pwm_period_s=10.0, call_interval_s=1.0).numbers == switched_by("pulsegen", pwm_period_s=10.0, resolution_s=1.0).numbers == (10.0, 1.0, 1.0, 1.0, False)  # P_B_TM is a call at least
    assert pid_compact(pwm_period_s=10.0, call_interval_s=1.0).numbers == switched_by("pid-compact", pwm_period_s=10.0, resolution_s=1.0).numbers == (10.0, 1.0, 0.0, 0.0, True)
    assert pulsegen(pwm_period_s=10.0, call_interval_s=1.0, minimum_s=2.0).numbers == (10.0, 1.0, 2.0, 2.0, False)
    halves = [pid_compact(pwm_period_s=10.0, call_interval_s=1.0, minimum_on_s=on).minimum_on_s for on in (0.4, 0.5, 1.4, 1.5)]
    assert halves == [0.0, 1.0, 1.0, 2.0]


@pytest.mark.parametrize(("changed", "field"), [
    ({"pwm_period_s": -0.5}, "pwm_period_s"), ({"resolution_s": 0.0}, "resolution_s"), ({"resolution_s": 8.5}, "resolution_s"), ({"minimum_on_s": -0.5}, "minimum_on_s"),
    ({"minimum_on_s": 8.5}, "minimum_on_s"), ({"minimum_off_s": -0.5}, "minimum_off_s"), ({"minimum_on_s": 4.0, "minimum_off_s": 4.5}, "minimum_off_s"),
])
def test_times_of_a_switch_that_leave_no_pulse_are_refused(changed, field):
    plain = {"pwm_period_s": 8.0, "resolution_s": 0.5, "minimum_on_s": 0.5, "minimum_off_s": 0.5}
    assert Actuator(**plain | {"minimum_on_s": 4.0, "minimum_off_s": 4.0}).minimum_off_s == 4.0
    with pytest.raises(OutOfRange, match=f"^{field} = "):
        Actuator(**plain | changed)


@pytest.mark.parametrize(("at_low", "at_high", "level", "counts", "word"), [
    (-100, 200, 9.0, 4, -100), (-100, 200, 12.4, 4, -100), (-100, 200, 12.5, 4, -25), (-100, 200, 20.0, 4, 200), (-100, 200, 25.0, 4, 200),
    (0, -7, 15.0, 2, -3), (0, 7, 15.0, 2, 3), (0.5, 1.5, 12.5, 4, 0.75), (0.5, 1.5, 9.0, 4, 0.5), (0.5, 1.5, 25.0, 4, 1.5),
])
def test_a_feed_forward_is_a_straight_line_cut_at_the_ends_of_its_sensor(at_low, at_high, level, counts, word):
    line = FeedForward(column="fan", low=10.0, high=20.0, calm=10.0, at_low=at_low, at_high=at_high, pct_per_unit=1.0)
    assert (line.at(level, counts), line.switched) == (word, False)


def _fed(whole=True, **changed):
    feed = FeedForwardHooks(word="Z", per_pct=20.0, most=600, whole=whole, listened=dict, set_disturbance=lambda p, _: p, listing=lambda *_: {})
    return feed_forward(feed, **{"column": "fan", "pct_per_unit": 1.5, "calm": 10.0, "low": 0.0, "high": 20.0} | changed)


def test_a_feed_forward_takes_back_the_power_that_the_disturbance_stands_for():
    # 1.5 % per unit are 30 units of Z: 300 ten units below the calm level, −300 ten above
    line = _fed()
    assert (line.at_low, line.at_high, line.pct_per_unit, line.calm) == (300, -300, -1.5, 10.0)
    assert (_fed(calm=0.0).at_low, _fed(calm=0.0).at_high) == (0, -600)
    assert (_fed(calm=20.0).at_low, _fed(calm=20.0).at_high) == (600, 0)
    assert _fed(pct_per_unit=1.503).pct_per_unit == -601 / 20.0 / 20.0 or _fed(pct_per_unit=1.503).at_low == 301
    assert _fed(whole=False, pct_per_unit=0.001).at_low == pytest.approx(0.2, rel=1e-7)
    for changed, told in (({"calm": -0.5}, "calm level"), ({"calm": 20.5}, "calm level"), ({"high": 0.0}, "disturbance range"), ({"low": math.nan}, "disturbance range")):
        with pytest.raises(OutOfRange, match=told):
            _fed(**changed)
    with pytest.raises(NotRepresentable, match=r"input Z would be 0\.4, allowed a unit or more"):
        _fed(pct_per_unit=0.001)
    with pytest.raises(NotRepresentable, match="input Z would be -602, allowed -600…600"):
        _fed(pct_per_unit=1.505, calm=0.0)


@pytest.mark.parametrize(("text", "whole"), [
    ("12", 12), ("-12", -12), ("+7", 7), ("16#FF", 255), ("8#17", 15), ("2#1000_0001", 129), ("10#5", None), ("16#", None), ("16#-1", None), ("2#2", None), ("", None), ("1.0", None), ("٣", None),
])
def test_a_whole_number_is_read_as_iec_61131_writes_it(text, whole):
    assert whole_of(text) == whole


@pytest.mark.parametrize(("text", "real"), [
    ("1.5", 1.5), ("-2", -2.0), ("1e3", 1000.0), ("1_000.5", 1000.5), ("_1", None), ("", None), ("nan", None), ("1e", None), ("0.1", 0.100000001490116119384765625), ("٣", None), ("1,5", None),
])
def test_a_real_is_read_in_single_precision(text, real):
    assert real_of(text) == real


@pytest.mark.parametrize(("content", "text"), [
    (b"", None), (b"A\x00", None), (b"A\x1fB", None), (b"A\t\r\n\x0c\x1aB ", "A\t\r\n\x0c\x1aB "), ("°".encode(), "°"), (b"\xef\xbb\xbfA", "A"), (b"\xb0", "°"),
    ("°C".encode("utf-16"), "°C"), ("A\x00".encode("utf-16"), None),
])
def test_bytes_are_text_where_nothing_controls_a_printer(content, text):
    assert text_of(content) == text


def test_lines_are_counted_from_1_however_they_end():
    assert list(lines_of(" a \r\nb\rc\x0c\n\x1a")) == [(1, "a"), (2, "b"), (3, "c"), (4, "")]
    ours = [(1, "L 1"), (2, "T 2")]
    assert first_unlike([(7, "L 1"), (9, "T 2")], ours) == ()
    assert first_unlike([(7, "L 1"), (9, "T 3")], ours)[0].endswith("(line 9: T 3, not T 2)")
    assert first_unlike([(7, "L 1")], ours)[0].endswith("(1 statements, not 2)")


GATHERED = (WordField(name="K", address="DW1", format="INT", low=-5, high=5, comment="gain"), WordField(name="TI", address="DW5", format="INT", low=0, high=5, comment="reset"),
            WordField(name="Ts", address="Ts", format="INT", low=1, high=5, comment="interval"))


@pytest.mark.parametrize(("put", "told"), [
    ({"K": 1, "TI": 2}, "f: Ts is missing; expected interval, a whole number 1…5"), ({"TI": 2, "Ts": 1}, "f: K (DW1) is missing; expected gain, a whole number -5…5"),
    ({"TI": 0}, "f: K (DW1) is missing; also missing: Ts; expected gain, a whole number -5…5"), ({}, "f: K (DW1) is missing; also missing: TI, Ts; expected gain, a whole number -5…5"),
    ({"K": 6}, "f, line 1, K: '6'; expected INT, a whole number -5…5"), ({"TI": None}, "f, line 1, TI: 'None'; expected INT, a whole number 0…5"),
    ({"TI": -1}, "f, line 1, TI: '-1'; expected INT, a whole number 0…5"),
])
def test_words_that_are_gathered_from_a_text_are_all_there_and_each_in_its_range(put, told):
    with pytest.raises(InputError) as refused:
        _gathered(put)
    assert str(refused.value) == told


def _gathered(put):
    gathered = WordCollector("f", GATHERED)
    for line, (name, value) in enumerate(put.items(), 1):
        gathered.put(name, value, line, str(value))
    return gathered.values()


def test_a_word_may_stand_there_twice_with_one_value():
    gathered = WordCollector("f", GATHERED)
    for line, (name, value) in enumerate((("Ts", 1), ("K", -5), ("TI", 5), ("K", -5)), 1):
        gathered.put(name, value, line, f"KF {value}")
    assert list(gathered.values().items()) == [("K", -5), ("TI", 5), ("Ts", 1)]
    with pytest.raises(InputError, match="f, line 9, K: 'KF 4'; expected KF -5, as in line 2"):
        gathered.put("K", 4, 9, "KF 4")


def test_a_text_of_a_million_characters_in_lines_of_a_thousand_is_read_and_no_larger_one():
    page = ("x" * 1000 + "\n") * 1047 + "y" * 529
    assert len(page) == 2**20
    assert _text(page.encode(), "f") == page
    with pytest.raises(InputError, match="f: 1048577 characters; expected one controller's, up to 1048576"):
        _text((page + "y").encode(), "f")
    with pytest.raises(InputError, match="f, line 2, length: '1001'; expected a line of up to 1000 characters"):
        _text(("x\n" + "y" * 1001).encode(), "f")


def test_words_are_typed_in_one_column_or_two_where_one_of_them_changes():
    same = KeyedEntry(address="DW1", name="K", format="KF", first=7, then=7, meaning="gain")
    other = KeyedEntry(address="DW11", name="STEU", format="KM", first=32, then=33, meaning="mode")
    assert typed_table([same]) == (("address", "word", "value", "meaning"), (2,), [("DW1", "K", "KF +00007", "gain")])
    heads, values, cells = typed_table([same, other])
    assert (len(heads), values) == (5, (2, 3))
    assert cells == [("DW1", "K", "KF +00007", "", "gain"), ("DW11", "STEU", "KM 00000000 00100000", "KM 00000000 00100001", "mode")]
    assert [word_text(0x8001, "KM"), word_text(1 / 3), word_text(5)] == ["KM 10000000 00000001", "0.333333333", "5"]


def _switches(*sizes):
    return tuple(OpenPoint(name=f"s{k}", means={str(n): n for n in range(size)}, reason="") for k, size in enumerate(sizes))


@pytest.mark.parametrize(("sizes", "known", "settings"), [
    ((), {}, 1), ((2,), {}, 2), ((2, 2, 2), {}, 8), ((3, 3), {}, 5), ((2, 2, 2, 2), {}, 5), ((2, 2, 2, 2), {"s0": "1"}, 8), ((9,), {}, 9),
])
def test_up_to_eight_combinations_of_settings_are_proven_together_else_each_switch_by_itself(sizes, known, settings):
    found = settings_to_prove(_switches(*sizes), known)
    assert len(found) == settings == len({tuple(sorted(one.items())) for one in found})
    assert found[0] == {f"s{k}": "0" for k in range(len(sizes))} | known


@pytest.mark.parametrize(("temperature", "counted"), [(19.9, 0), (20.0, 0), (20.49, 0), (20.5, 1), (20.99, 1), (69.9, 99), (70.0, 100), (71.0, 100)])
def test_a_reading_is_cut_and_held_at_the_ends_of_the_range(temperature, counted):
    assert count(Sensor(20.0, 50.0, 100), temperature) == counted


@pytest.mark.parametrize("changed", [
    {"step": 0}, {"step": -1}, {"step": 0.1}, {"hold": 0}, {"hold": 0.5}, {"step": 0.5, "hold": 1}, {"step": 0.5, "hold": 0.1}, {"calls": 0}, {"calls": 32768}, {"calls": True}, {"calls": 1.0},
])
def test_a_ramp_that_no_word_holds_is_refused(changed):
    assert Ramp(step=1, calls=32767, hold=1).calls == 32767
    assert Ramp(step=0.5, hold=0.5).hold == 0.5
    with pytest.raises(OutOfRange, match=r"^ramp "):
        Ramp(**{"step": 5, "calls": 1} | changed)


def test_a_ramp_is_told_to_people():
    assert [str(Ramp(step=5)), str(Ramp(step=0.25, calls=2, hold=1.5)), str(Ramp(step=5, hold=-3))] == [
        "5 units every call", "0.25 °C every 2 calls, held within 1.5 °C of the reading", "5 units every call, held within 3 units of the reading (of a cooler)"]
    assert [Ramp(step=5, hold=hold).cools for hold in (None, 1, -1)] == [False, False, True]


@pytest.mark.parametrize(("per_call", "whole", "least", "ramp"), [
    (4.0, True, 1.0, Ramp(step=4)), (0.96, True, 1.0, Ramp(step=1)), (0.94, True, 1.0, Ramp(step=9, calls=10)), (1.4, True, 1.0, Ramp(step=4, calls=3)), (1 / 32767, True, 1.0, Ramp(step=1, calls=31207)),
    (0.5, False, 0.5, Ramp(step=0.5)), (0.25, False, 0.5, Ramp(step=0.5, calls=2)), (0.375, False, 0.5, Ramp(step=0.75, calls=2)), (1.0 / 65536, False, 0.25, Ramp(step=0.25, calls=16384)),
])
def test_the_ramp_nearest_to_a_rate_has_the_fewest_calls(per_call, whole, least, ramp):
    assert nearest(per_call, whole=whole, least=least) == ramp


def test_a_rate_so_slow_that_no_countdown_makes_a_step_is_refused():
    with pytest.raises(OutOfRange, match=r"> 2\.91e-05, a step in 32767 calls"):
        nearest(2.9e-5, whole=True, least=1.0)
    with pytest.raises(OutOfRange, match=r"> 3\.05e-05, a step in 32767 calls"):
        nearest(3.05e-5, whole=False, least=1.0)
    for slow in (0.0, -0.5):
        with pytest.raises(OutOfRange, match="setpoint ramp in units per call"):
            nearest(slow, whole=True, least=1.0)


def _held(**ramp):
    controller = controller_for("s5-ob251")
    values = {"K": 1024, "R": 1024, "TI": 20, "TD": 0, "W": 0, "STEU": 33, "YH": 0, "BGOG": 2047, "BGUG": 0}
    words = Words(target="s5-ob251", values=values, scaling=Scaling(high_degC=204.7), sample_time_s=2.0, ramp=Ramp(**ramp) if ramp else None)
    return controller, words


def test_a_ramp_in_degrees_a_minute_is_units_a_call_and_back():
    # 10 units are 1 °C, a call every 2 s: 3 °C/min are one unit a call
    controller, words = _held()
    assert controller.ramp(words, 3.0) == Ramp(step=1)
    assert controller.ramp(words, 6.0, 0.06) == Ramp(step=2, hold=1)
    assert controller.ramp(words, 6.0, -2.5) == Ramp(step=2, hold=-25)
    assert controller.ramp(words, 6.0, -0.5) == Ramp(step=2, hold=-5)
    assert controller.ramp(words, 6.0, 0.01) == Ramp(step=2, hold=1)  # a unit at least
    assert controller.ramp_degC_per_min(words) == math.inf
    assert controller.hold_degC(words) is None
    controller, words = _held(step=6, calls=3, hold=-25)
    assert controller.ramp_degC_per_min(words) == pytest.approx(6.0, rel=1e-12)
    assert controller.hold_degC(words) == pytest.approx(2.5, rel=1e-12)
    assert _held(step=6)[0].hold_degC(_held(step=6)[1]) is None


@pytest.mark.parametrize(("ramp", "told"), [
    ({"step": 1}, None), ({"step": 2046}, None), ({"step": 2047}, "ramp step = 2047.*a whole number from 1 to below 2047"), ({"step": 0.5}, "ramp step = 0.5.*a whole number"),
    ({"step": 1, "hold": 2047}, None), ({"step": 1, "hold": -2047}, None), ({"step": 1, "hold": 2048}, "ramp hold = 2048"),
])
def test_a_ramp_of_a_controller_keeps_to_its_sensors_range(ramp, told):
    controller, words = _held(**ramp)
    if told is None:
        controller.check_ramp(words)
    else:
        with pytest.raises(OutOfRange, match=told):
            controller.check_ramp(words)


def test_a_rate_or_holdback_that_crosses_the_range_is_refused():
    # 204.7 °C in one call of 2 s
    controller, words = _held()
    assert controller.ramp(words, 6130.0).step < 2047
    for asked, told in (((6141.0,), r"setpoint_ramp_degC_per_min = 6141.0.*< 6141"), ((0.0,), "setpoint_ramp_degC_per_min"), ((-1.0,), "setpoint_ramp_degC_per_min"),
                        ((3.0, 0.0), "setpoint_hold_degC"), ((3.0, 204.8), "setpoint_hold_degC"), ((3.0, -204.8), "setpoint_hold_degC")):
        with pytest.raises(OutOfRange, match=told):
            controller.ramp(words, *asked)
    assert controller.ramp(words, 3.0, 204.7).hold == 2047
