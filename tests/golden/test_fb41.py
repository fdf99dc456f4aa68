"""FB41 against exact fractions, SciPy's linear answer, NumPy's float32 and the offsets that awlsim computes."""

import math
import random
import struct
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter

from heatertune.errors import InputError, NotRepresentable, OutOfRange
from heatertune.model.model_values import Fopdt
from heatertune.pid.design_values import PidDesign, structure_of
from heatertune.plc import Certificate, Scaling, Words, controller_for
from heatertune.plc.fb41.export import DEFAULTS
from heatertune.plc.fb41.step import ContCAssumptions, call
from heatertune.plc.words import holds
from heatertune.proof import Actuator, Scenario, TemperatureStep, simulate

ROOM = controller_for("fb41")
HEATER = Fopdt(gain_degC_per_pct=0.41, time_constant_s=166.0, dead_time_s=14.0, ambient_degC=24.0)

#: the block's interface as STEP 7 shows it: name, type, default (the defaults of the standard parameter table)
INTERFACE = [
    ("COM_RST", "BOOL"), ("MAN_ON", "BOOL"), ("PVPER_ON", "BOOL"), ("P_SEL", "BOOL"), ("I_SEL", "BOOL"), ("INT_HOLD", "BOOL"),
    ("I_ITL_ON", "BOOL"), ("D_SEL", "BOOL"), ("CYCLE", "TIME"), ("SP_INT", "REAL"), ("PV_IN", "REAL"), ("PV_PER", "WORD"),
    ("MAN", "REAL"), ("GAIN", "REAL"), ("TI", "TIME"), ("TD", "TIME"), ("TM_LAG", "TIME"), ("DEADB_W", "REAL"), ("LMN_HLM", "REAL"),
    ("LMN_LLM", "REAL"), ("PV_FAC", "REAL"), ("PV_OFF", "REAL"), ("LMN_FAC", "REAL"), ("LMN_OFF", "REAL"), ("I_ITLVAL", "REAL"),
    ("DISV", "REAL"),
]
OUTPUTS = [
    ("LMN", "REAL"), ("LMN_PER", "WORD"), ("QLMN_HLM", "BOOL"), ("QLMN_LLM", "BOOL"), ("LMN_P", "REAL"), ("LMN_I", "REAL"),
    ("LMN_D", "REAL"), ("PV", "REAL"), ("ER", "REAL"),
]


def _design(gain=3.0, tn=200.0, tv=0.0, ta=5.0, past=0.5):
    return PidDesign(gain_pct_per_degC=gain, integral_time_s=tn, derivative_time_s=tv, sample_time_s=ta,
                     structure=structure_of(tn, tv), method="", derivative_filter=past if tv else 0.0)


def _words(design=None, scaling=None, **changed):
    words = ROOM.encode(design or _design(), scaling or Scaling())
    return Words(target="fb41", values=dict(words.values) | changed, scaling=words.scaling, sample_time_s=words.sample_time_s)


def _wide(design=None, **changed):
    return _words(design, LMN_HLM=1e6, LMN_LLM=-1e6, **changed)


def _run(words, rows, switches=None):
    """LMN of each call; rows of input mappings."""
    state, told = ROOM.start(words, switches or {}), []
    for row in rows:
        state, scan = ROOM.scan(state, row)
        told.append(scan.output)
    return told


def _errors(values):
    """Rows in which SP_INT − PV is a given error (PV = 0)."""
    return [{"SP_INT": float(e), "SP_PER": 0, "PV_PER": 0} for e in values]


def test_unlimited_it_is_scipys_filter_of_the_design_it_realises():
    # C(z) = K·[1 + TA/TN/(1 − 1/z) + (1 − f)·TV/TA·(1 − 1/z)/(1 − f/z)]: the form of the project's linear margins
    errors = np.round(np.random.default_rng(3).normal(0.0, 4.0, 300) * 64) / 64
    for design in (_design(), _design(tn=math.inf), _design(tv=23.0), _design(tv=23.0, past=0.8), _design(tv=23.0, past=0.0, ta=3.0)):
        words = _wide(design)
        d = ROOM.decode(words)
        expected = d.gain_pct_per_degC * errors
        if math.isfinite(d.integral_time_s):
            expected = expected + d.gain_pct_per_degC * d.sample_time_s / d.integral_time_s * np.cumsum(errors)
        if d.derivative_time_s:
            f = d.derivative_filter
            part = (1 - f) * d.derivative_time_s / d.sample_time_s
            expected = expected + d.gain_pct_per_degC * part * lfilter([1, -1], [1, -f], errors)
        assert _run(words, _errors(errors)) == pytest.approx(expected.tolist(), rel=1e-5, abs=1e-3)


def test_the_integral_part_sums_trapezoids_in_exact_fractions():
    # all numbers are powers of two, so single precision holds every sum: GAIN 1/2, CYCLE/TI = 1/16
    words = _wide(GAIN=0.5, CYCLE=1000, TI=16000)
    errors = [int(e) for e in np.random.default_rng(1).integers(-60, 60, 60)]
    expected, total, before = [], Fraction(0), Fraction(0)
    for error in errors:
        e = Fraction(error, 2)
        total += Fraction(1, 16) * (e + before) / 2
        before = e
        expected.append(float(e + total))
    assert _run(words, _errors(errors)) == expected
    assert _run(words, _errors(errors), {"integral": "rectangle"})[0] == float(Fraction(errors[0], 2) * (1 + Fraction(1, 16)))


def test_the_derivative_of_a_step_begins_at_td_over_lag_and_decays_by_its_pole():
    # TD = 8 s, TM_LAG = 1.5 s, CYCLE = 1 s: kick TD/(TM_LAG + CYCLE/2) = 4, pole (1.5 − ½)/(1.5 + ½) = ½
    words = _wide(GAIN=1.0, CYCLE=1000, TD=8000, TM_LAG=1500, D_SEL=1, I_SEL=0, P_SEL=0)
    assert _run(words, _errors([1] * 4)) == [4.0, 2.0, 1.0, 0.5]
    # whole cycle: 8/2.5 = 3.2, pole 1.5/2.5 = 0.6
    assert _run(words, _errors([1] * 3), {"derivative_lag": "whole_cycle"}) == pytest.approx([3.2, 1.92, 1.152], rel=1e-6)
    # a ramp of 3 per s settles to TD·slope
    assert _run(words, _errors(3 * k for k in range(60)))[-1] == pytest.approx(24.0)


def test_a_step_of_the_parameter_tables_defaults():
    # GAIN 2, TI 20 s, CYCLE 1 s, P and I: LMN jumps by 2·ER and grows by 2·ER·(1/20) per call, half of it in the first
    words = _wide(GAIN=2.0, CYCLE=1000, TI=20000)
    assert _run(words, _errors([10] * 4)) == pytest.approx([20.5, 21.5, 22.5, 23.5])


class _Float32:
    """The equation in NumPy's single precision, statement by statement with the block's own names of its statics."""

    def __init__(self, v):
        f = np.float32
        self.v = {n: f(f(x) / f(1000)) if n in ("CYCLE", "TI", "TD", "TM_LAG") else f(x) for n, x in v.items()}
        self.inv_old = self.i_old = self.rest_i = self.rest_d = self.feed = self.lmn_d = self.lmn = f(0)
        self.high = self.low = False

    def call(self, sp, raw):
        f, v = np.float32, self.v
        pv = f(raw) * f(100) / f(27648) * v["PV_FAC"] + v["PV_OFF"]
        er = sp - pv
        er = er - v["DEADB_W"] if er > v["DEADB_W"] else er + v["DEADB_W"] if er < -v["DEADB_W"] else f(0)
        e = er * v["GAIN"]
        step = v["CYCLE"] / v["TI"] * ((e + self.inv_old) * f(0.5)) + self.rest_i
        if (step > 0 and self.high) or (step < 0 and self.low):
            step = f(0)
        i = self.i_old + step
        self.rest_i = (self.i_old - i) + step
        d = f(0)
        if v["D_SEL"]:
            d = (e - self.feed) * (v["TD"] / (v["CYCLE"] * f(0.5) + v["TM_LAG"]))
            back = v["CYCLE"] / v["TD"] * d + self.rest_d
            old, self.feed = self.feed, back + self.feed
            self.rest_d = (old - self.feed) + back
        total = ((e + i) + d) + v["DISV"]
        hi, lo = v["LMN_HLM"], v["LMN_LLM"]
        if i > hi - v["DISV"] and total > hi and total - self.lmn_d > hi:
            i = i - min(i - (hi - v["DISV"]), total - hi)
        elif i < lo - v["DISV"] and total < lo and total - self.lmn_d < lo:
            i = i - max(i - (lo - v["DISV"]), total - lo)
        self.lmn_d, self.inv_old, self.i_old = d, e, i
        self.high, self.low = bool(total >= hi), bool(total <= lo)
        self.lmn = (hi if self.high else lo if self.low else total) * v["LMN_FAC"] + v["LMN_OFF"]
        return float(self.lmn)


@pytest.mark.parametrize("words", [
    _words(), _words(_design(tv=23.0)), _words(_design(tv=23.0, gain=9.0, tn=60.0), DEADB_W=0.5),
    _words(_design(tv=23.0), DISV=7.25, LMN_HLM=61.5, LMN_LLM=-3.0),
    _words(_design(gain=1.7, tv=11.0), scaling=Scaling(low_degC=-50.0, high_degC=333.3)),
], ids=["pi", "pid", "hot", "limits", "range"])
def test_a_closed_loop_is_the_equation_in_numpys_single_precision(words):
    jumps = (TemperatureStep(time_s=1200.0, temperature_degC=40.0), TemperatureStep(time_s=2000.0, temperature_degC=-20.0))
    scenario = Scenario(setpoint_degC=53.3, duration_s=3000.0, noise_degC=0.1, seed=7, disturbances=jumps)
    trace = simulate(ROOM, words, HEATER, scenario, Actuator(pwm_period_s=5.0))
    readings = [ROOM.measure(words, float(t) + 1e-6) for t in trace.reading_degC]
    sp = np.float32(53.3)
    second = _Float32(words.values)
    expected = [second.call(sp, raw) for raw in readings]
    found = _run(words, [{"SP_INT": float(sp), "SP_PER": 0, "PV_PER": raw} for raw in readings])
    assert found == expected
    assert (min(found), max(found)) == (words.values["LMN_LLM"], words.values["LMN_HLM"])


def test_any_readings_at_both_limits_keep_the_integral_part_as_the_equation_does():
    # an integral part that alone leaves the limit, with DISV, P of either sign: every branch of the taking back
    rng = random.Random(2)
    words = _words(_design(gain=2.0, tn=20.0, tv=23.0), DISV=-4.0)
    readings = [rng.choice((0, 10000, 13000, 14000, 15000, 20000, 27648)) for _ in range(60) for _ in range(rng.randint(1, 30))]
    second = _Float32(words.values)
    expected = [second.call(np.float32(50), raw) for raw in readings]
    assert _run(words, [{"SP_INT": 50.0, "SP_PER": 0, "PV_PER": raw} for raw in readings]) == expected
    assert expected != _run(words, [{"SP_INT": 50.0, "SP_PER": 0, "PV_PER": raw} for raw in readings], {"anti_windup": "held"})


def test_the_integral_part_holds_at_the_limit_and_comes_back_at_once():
    words = _words(_design(gain=1.0, tn=10.0, ta=1.0), GAIN=1.0, TI=10000)
    lmn = _run(words, _errors([90] * 50 + [-1] * 2))
    assert lmn[-1] < 100.0
    windup = _run(_wide(GAIN=1.0, TI=10000, CYCLE=1000), _errors([90] * 50 + [-1] * 2))
    assert windup[-1] > 300.0


def test_a_rest_that_single_precision_cuts_off_is_not_lost():
    # without the rests, 1e-6 added to an integral part of 64 would vanish for ever: half a place there is 4e-6
    words = _wide(GAIN=1.0, CYCLE=1000, TI=1000000, I_ITLVAL=64.0)
    lmn = _run(words, _errors([0.001] * 20000))
    assert lmn[-1] == pytest.approx(64.001 + 20000 * 1e-6, abs=2e-5)


def test_an_integral_part_that_only_the_last_derivative_lifts_over_a_limit_is_left_alone():
    # E = −50, I = 120, D = 150·1: the sum 220 is above 100; less the last D of 150 it is 70, less one of 0 it is 220
    p = ROOM.start(_words(GAIN=1.0, TI=2**31 - 1, D_SEL=1, TD=5000, TM_LAG=2500), {}).parameters[0]
    for sign in (1.0, -1.0):
        limits = p._replace(upper=100.0, lower=-100.0)
        state = ROOM.start(_words(), {}).state._replace(integral=120.0 * sign, feedback=-200.0 * sign, before=50.0 * sign)
        left = call(limits, ContCAssumptions(), state._replace(derivative=150.0 * sign), -50.0 * sign, 0.0)
        taken = call(limits, ContCAssumptions(), state, -50.0 * sign, 0.0)
        at_limit = call(limits, ContCAssumptions(), state._replace(derivative=120.0 * sign), -50.0 * sign, 0.0)  # 220 − 120: not beyond
        assert (left.integral, at_limit.integral, taken.integral) == (120.0 * sign, 120.0 * sign, 100.0 * sign)
        assert left.output == taken.output == 100.0 * sign


@pytest.mark.parametrize("design", [_design(), _design(tv=23.0)], ids=["pi", "pid"])
def test_manual_limits_man_and_its_return_is_smooth(design):
    words = _words(design)
    quiet = {"SP_INT": 50.0, "SP_PER": 0, "PV_PER": ROOM.measure(words, 48.0)}
    rows = [quiet | {"MAN_ON": 1, "MAN": man} for man in (37.5, 140.0, -3.0, 37.5, 37.5)] + [quiet]
    lmn = _run(words, rows)
    assert lmn[:5] == [37.5, 100.0, 0.0, 37.5, 37.5]
    assert lmn[5] == pytest.approx(37.5 + 3.0 * 2.0 * 5.0 / 202.5, abs=0.02)  # one integral step, no jump by P = 6


def test_the_bits_of_the_block_do_what_their_names_say():
    def lmn(**changed):
        return _run(_wide(**({"GAIN": 1.0, "CYCLE": 1000, "TI": 10000, "D_SEL": 0} | changed)), _errors([10] * 3))

    assert lmn() == pytest.approx([10.5, 11.5, 12.5])
    assert lmn(P_SEL=0) == pytest.approx([0.5, 1.5, 2.5])
    assert lmn(I_SEL=0) == [10.0] * 3
    assert lmn(INT_HOLD=1, I_ITLVAL=3.0) == [13.0] * 3
    assert lmn(I_ITL_ON=1, I_ITLVAL=4.0) == [14.0] * 3
    assert lmn(DISV=2.5, I_SEL=0) == [12.5] * 3
    assert lmn(LMN_FAC=2.0, LMN_OFF=-1.0, I_SEL=0) == [19.0] * 3
    assert lmn(DEADB_W=4.0, I_SEL=0) == [6.0] * 3
    assert lmn(DEADB_W=11.0, I_SEL=0) == [0.0] * 3
    assert _run(_wide(GAIN=1.0, DEADB_W=4.0, I_SEL=0), _errors([-10])) == [-6.0]
    # TI and TM_LAG below half a cycle and TD below a cycle are raised: E·(1 + ½) and TD/(½ + ½) = 1
    assert lmn(TI=1)[0] == pytest.approx(20.0)
    assert lmn(I_SEL=0, D_SEL=1, TD=1, TM_LAG=1) == pytest.approx([20.0, 10.0, 10.0])
    restarted = _run(_wide(GAIN=1.0, CYCLE=1000, TI=10000), [*_errors([10] * 3), *[e | {"COM_RST": 1} for e in _errors([10])], *_errors([10])])
    assert restarted[3:] == pytest.approx([0.0, 10.5])


def test_the_reading_is_normalised_as_documented():
    # PV = PV_PER·100/27648·PV_FAC + PV_OFF: half the range of −50…250 °C is 100 °C
    words = _wide(_design(gain=1.0, tn=math.inf), PV_FAC=3.0, PV_OFF=-50.0, GAIN=1.0)
    assert _run(words, [{"SP_INT": 101.0, "SP_PER": 0, "PV_PER": 13824}]) == [1.0]
    state, scan = ROOM.step(ROOM.start(words, {}), 13824 + 2765, 13824)
    assert scan.output == pytest.approx(30.0, abs=0.01)  # SP_PER: a tenth of the range above
    assert scan.flags == {"QLMN_HLM": False, "QLMN_LLM": False, "overflow": False}
    assert state.state.output == scan.output


def test_the_limit_bits_name_their_limit_and_power_stays_within_0_to_100():
    words = _words(LMN_FAC=3.0, LMN_LLM=-20.0)
    told = [ROOM.scan(ROOM.start(words, {}), row)[1] for row in _errors([90, 1, -90])]
    assert [(scan.flags["QLMN_HLM"], scan.flags["QLMN_LLM"]) for scan in told] == [(True, False), (False, False), (False, True)]
    assert [scan.power_pct for scan in (told[0], told[2])] == [100.0, 0.0]
    assert [scan.output for scan in (told[0], told[2])] == [300.0, -60.0]
    assert ROOM.scan(ROOM.start(_words(GAIN=float(np.float32(3e38))), {}), _errors([90])[0])[1].flags["overflow"]


def test_a_time_is_a_double_integer_in_ms():
    # STEP 7: TIME is a DINT, T#-24D20H31M23S648MS … T#24D20H31M23S647MS
    longest = ((24 * 24 + 20) * 60 + 31) * 60_000 + 23_647
    assert [holds("TIME", value) for value in (longest, longest + 1, -longest - 1, -longest - 2)] == [True, False, True, False]


def _stub(source):
    """A function block with CONT_C's interface and no statements, before its exported instance."""
    def section(kind, members):
        return [kind, *[f"  {name} : {type_} ;" for name, type_ in members], "END_VAR"]

    block = ["FUNCTION_BLOCK FB 41", "VERSION : 0.1", *section("VAR_INPUT", INTERFACE), *section("VAR_OUTPUT", OUTPUTS), "BEGIN",
             "NETWORK", "      NOP   0;", "END_FUNCTION_BLOCK", ""]
    return "\r\n".join(block) + source


def test_the_words_stand_where_the_interface_puts_them(awlsim):
    # awlsim computes the offsets from the types of the parameter table, and runs the calls of OB100 and OB35
    words = _words(_design(gain=1.2345678, tv=17.777), Scaling(low_degC=-17.7, high_degC=250.3))
    answer = awlsim(_stub(ROOM.export(words, Certificate(verdict="PASS"))["fb41_cont_c.awl"]), [[1, 0, 12345, None]], block=41)
    for field in ROOM.fields:
        byte, bit = answer["offsets"][field.name]
        assert field.address == (f"DBX{byte}.{bit}" if field.format == "BOOL" else f"DBD{byte}"), field.name
    restarted, called = (bytes.fromhex(answer[key] if key == "restart" else answer[key][0]) for key in ("restart", "rows"))
    assert ROOM.read_image(called, sample_time_s=5.0, scaling=words.scaling, source="DB41") == words
    assert (restarted[0] & 1, called[0] & 1) == (1, 0)  # COM_RST
    assert struct.unpack_from(">h", called, 14)[0] == 12345  # PV_PER
    assert answer["offsets"]["ER"] == [96, 0]


def test_the_design_comes_back_and_the_trapezoid_costs_nothing():
    scaling = Scaling(low_degC=-50.0, high_degC=250.0)
    words = ROOM.encode(_design(gain=3.0, tn=200.0, tv=20.0), scaling)
    v = words.values
    # GAIN = K·TI/TN with TI = TN + TA/2; TD = TV·TN/TI; TM_LAG = 3·TA/2
    assert (v["TI"], v["TM_LAG"], v["CYCLE"], v["PV_FAC"], v["PV_OFF"]) == (202500, 7500, 5000, 3.0, -50.0)
    assert v["GAIN"] == pytest.approx(3.0 * 202.5 / 200.0, rel=1e-7)
    assert v["TD"] == round(20000 * 200.0 / 202.5)
    back = ROOM.decode(words)
    assert back.gain_pct_per_degC == pytest.approx(3.0, rel=1e-7)
    assert (back.integral_time_s, back.derivative_filter, back.structure) == (200.0, 0.5, "pid")
    assert back.derivative_time_s == pytest.approx(20.0, abs=1e-3)


def test_the_gain_is_rounded_once_whatever_the_range():
    # the rounding of PV_FAC is made up in GAIN: half a unit of 24 places remains
    for span in np.random.default_rng(4).uniform(20.0, 1500.0, 200).tolist():
        back = ROOM.decode(ROOM.encode(_design(gain=3.3), Scaling(low_degC=-20.0, high_degC=span - 20.0)))
        assert back.gain_pct_per_degC == pytest.approx(3.3, rel=2.0**-24 * (1.0 + 1e-6))
    assert ROOM.decode(_words(LMN_FAC=2.0)).gain_pct_per_degC == pytest.approx(6.0)
    assert ROOM.decode(_words(PV_FAC=2.0)).gain_pct_per_degC == pytest.approx(6.0)


def test_words_without_a_proportional_part_are_no_pid():
    for changed in ({"P_SEL": 0}, {"GAIN": 0.0}, {"TI": 0}):
        assert ROOM.decode(_words(**changed)) is None
    stretched = _words()
    slow = Words(target="fb41", values=stretched.values, scaling=Scaling(), sample_time_s=10.0)
    assert ROOM.decode(slow).integral_time_s == pytest.approx(400.0)
    with pytest.raises(OutOfRange, match="LMN_LLM"):
        ROOM.check(_words(LMN_LLM=100.0))


@pytest.mark.parametrize(("design", "message"), [
    (_design(ta=61.0), "TA"), (_design(tv=3.0), r"word TD.*5000.*faster TA"), (_design(tn=1e8), r"word TI.*2\.14748e\+06 s"),
    (_design(tn=1e-5), "word TI"), (_design(gain=1e39), "GAIN"), (_design(tv=1e7), "word TD"),
])
def test_what_does_not_fit_is_refused_with_the_nearest_that_would(design, message):
    with pytest.raises(NotRepresentable, match=message):
        ROOM.encode(design, Scaling())


def test_oddities_of_a_running_block_are_told():
    def told(called=5.0, **changed):
        words = _words(_design(tv=20.0), **changed)
        return " ".join(ROOM.oddities(Words(target="fb41", values=words.values, scaling=Scaling(), sample_time_s=called)))

    assert told() == ""
    for changed, part in [
        ({"called": 10.0}, "called every 10000 ms: all times are 2 times"), ({"MAN_ON": 1}, "in manual"), ({"P_SEL": 0}, "no proportional"),
        ({"I_SEL": 0}, "no integral"), ({"INT_HOLD": 1}, "stands still"), ({"I_ITL_ON": 1}, "for ever"), ({"TI": 2000}, "TI is 2000 ms"),
        ({"TD": 4999}, "TD is 4999 ms"), ({"TM_LAG": 2499}, "TM_LAG is 2499 ms"), ({"DEADB_W": 1.0}, "drifts"),
        ({"LMN_HLM": 80.0}, "0…80 %"), ({"LMN_FAC": 2.0}, "not in %"), ({"GAIN": -1.0}, "negative"),
    ]:
        assert part in told(**changed)
    with pytest.raises(InputError, match="71 bytes; expected 72"):
        ROOM.read_image(bytes(71), sample_time_s=5.0, scaling=Scaling(), source="DB")


reals = st.integers(0, 2**32 - 1).map(lambda pattern: struct.unpack(">f", pattern.to_bytes(4, "big"))[0])


@given(numbers=st.lists(reals, min_size=15, max_size=15), bits=st.lists(st.booleans(), min_size=6, max_size=6),
       readings=st.lists(st.tuples(reals, reals), min_size=2, max_size=5))
@pytest.mark.long
def test_a_call_is_total_for_every_bit_pattern(numbers, bits, readings):
    running = ROOM.start(_words(), {})
    p = type(running.parameters[0])(*numbers, *bits)
    for setpoint, reading in readings:
        after = call(p, ContCAssumptions(), running.state, setpoint, reading)
        assert after == call(p, ContCAssumptions(), running.state, setpoint, reading)
        running = running._replace(parameters=(p, ContCAssumptions()), state=after)
        assert 0.0 <= ROOM.scan(running, {"SP_PER": 0, "PV_PER": 0})[1].power_pct <= 100.0


def test_the_source_is_ascii_with_crlf_and_tells_verdict_and_force():
    certificate = Certificate(verdict="FAIL", lines=("not kept: overshoot ≤ 2 °C",), forced=True)
    files = ROOM.export(_words(), certificate)
    source = files["fb41_cont_c.awl"]
    assert source.isascii()
    assert source.count("\r\n") == source.count("\n")
    assert "// verdict of the proof: FAIL - FORCED" in source
    assert "  TI := T#202500MS ;" in source
    assert "  P_SEL := TRUE ;" in source
    assert "DBD24,TI,TIME,T#202500MS,reset time" in files["fb41_words.csv"]
    assert ROOM.export(_words(), certificate) == files


def test_the_start_values_are_those_of_the_manual():
    """From the help of TIA Portal, "Input parameter CONT_C (S7-300, S7-400)", column Default; MAN_ON is TRUE there."""
    told = {"PVPER_ON": 0, "P_SEL": 1, "I_SEL": 1, "INT_HOLD": 0, "I_ITL_ON": 0, "D_SEL": 0, "CYCLE": 1000, "MAN": 0.0, "TD": 10000,
            "TM_LAG": 2000, "DEADB_W": 0.0, "LMN_HLM": 100.0, "LMN_LLM": 0.0, "PV_FAC": 1.0, "PV_OFF": 0.0, "LMN_FAC": 1.0, "LMN_OFF": 0.0,
            "I_ITLVAL": 0.0, "DISV": 0.0}
    assert {name: value for name, value in DEFAULTS.items() if name != "MAN_ON"} == told
