"""WEG's block against its manual's sentences and example, the CFW501's equation in exact fractions and in NumPy's single
precision, python-control's linear answer, and sums worked out by hand."""

import math
from fractions import Fraction

import control
import numpy as np
import pytest

from heatertune.errors import NotRepresentable, OutOfRange, UnknownName
from heatertune.pid.design_values import PidDesign, structure_of
from heatertune.plc import Certificate, Scaling, Words, controller_for
from heatertune.plc.replay import replay
from heatertune.plc.single_precision import single
from heatertune.plc.weg.step import WegAssumptions, WegInputs, WegState, block_of, call

ROOM = controller_for("weg")
LINEAR = {"edge": "runs_at_once", "history": "zero"}

#: the ST example of the manual; its setpoint filter is slower than nothing and faster than Ts
EXAMPLE = {"Kp": 6.2, "Ki": 1.3, "Kd": 1.8, "TauSetPoint": 0.01, "MinimumOutput": 0.1, "MaximumOutput": 2.5, "Ts": 50}


def _words(**changed):
    plain = {"Kp": 1.0, "Ki": 0.0, "Kd": 0.0, "TauSetPoint": 0.0, "MinimumOutput": 0.0, "MaximumOutput": 100.0, "Type": 0,
             "Action": 0, "Ts": 1000} | changed
    values = {name: single(value) if isinstance(value, float) else value for name, value in plain.items()}
    return Words(target="weg", values=values, scaling=Scaling(), sample_time_s=plain["Ts"] / 1000)


def _run(words, setpoints, feedbacks, switches=None, **inputs):
    rows = [
        {"SetPoint": float(w), "Feedback": float(x)} | {name: column[k] for name, column in inputs.items()}
        for k, (w, x) in enumerate(zip(setpoints, feedbacks, strict=True))
    ]
    return [scan.output for scan in replay(ROOM, words, rows, switches)]


def _design(gain=2.0, tn=200.0, tv=20.0, ta=5.0):
    return PidDesign(gain_pct_per_degC=gain, integral_time_s=tn, derivative_time_s=tv, sample_time_s=ta,
                     structure=structure_of(tn, tv), method="")


def _exact_example(setpoints, feedbacks):
    """The CFW501's equation in fractions, limits and clamp included, from the second call on."""
    kp, ki, kd, tau, low, high = (Fraction(single(EXAMPLE[name])) for name in list(EXAMPLE)[:6])
    ts, i, filtered, past, out = Fraction(50, 1000), Fraction(0), None, None, []
    for w, x in zip(map(Fraction, setpoints), map(Fraction, feedbacks), strict=True):
        if filtered is None:
            filtered, past = w, w - x
            out.append(Fraction(0))
            continue
        filtered += ts / (tau + ts) * (w - filtered)
        e = filtered - x
        u = i + kp * ((1 + ki * ts + kd / ts) * e - kd / ts * past)
        i, past = min(max(i + kp * ki * ts * e, low - kp * e), high - kp * e), e
        out.append(min(max(u, low), high))
    return out


def test_the_manuals_example_is_the_equation_in_exact_fractions():
    setpoints = [1.0] * 60 + [single(1.05)] * 60
    feedbacks = [single(1.0 + 0.1 * math.sin(2.0 * math.pi * k / 80.0)) for k in range(120)]
    outputs = _run(_words(**EXAMPLE), setpoints, feedbacks)
    exact = _exact_example(setpoints, feedbacks)
    inside = [u for u in exact if Fraction(1, 9) < u < Fraction(249, 100)]
    assert len(inside) > 60, "most of the run must not hang at a limit"
    # e(k) and e(k−1) carry half a digit of a setpoint above 1, 6e-8 each, times 6.2·38 = 236; products below 26 add 1e-6 each
    assert outputs == pytest.approx([float(u) for u in exact], abs=4e-5)
    assert (max(outputs), min(outputs[1:])) == (2.5, single(0.1))


def test_every_operation_rounds_in_the_order_of_the_printed_equation():
    f = np.float32
    kp, ki, kd, ts = f(0.7), f(0.013), f(3.3), f(250) / f(1000)
    errors = np.random.default_rng(3).uniform(-0.3, 0.3, 300).astype(f)
    i, past, expected, parts = f(0), f(0), [], []
    for e in errors:
        expected.append(float(i + kp * ((f(1) + ki * ts + kd / ts) * e - (kd / ts) * past)))
        parts.append(float((kp * e + (i + kp * ki * ts * e)) + kp * ((kd / ts) * (e - past))))
        i, past = i + kp * ki * ts * e, e
    words = _words(Kp=0.7, Ki=0.013, Kd=3.3, Ts=250)
    free = WegAssumptions(runs_at_once=True, zero_history=True)
    for assume, wanted in ((free, expected), (free._replace(by_parts=True), parts)):
        block, state, found = block_of(words.values, assume)._replace(minimum=-100.0), WegState(), []
        for e in errors:
            state = call(block, assume, state, WegInputs(0.0, -float(e)))
            found.append(state.output)
        assert found == wanted
    assert expected != parts


@pytest.mark.parametrize("action", [0, 1])
@pytest.mark.parametrize("form", [0, 1])
def test_unlimited_it_is_python_controls_linear_answer(form, action):
    kp, ki, kd, ts = 1.5, 0.05, 4.0, 0.5
    z = control.TransferFunction([1, 0], [1], ts)
    integral, derivative = ki * ts * z / (z - 1), kd / ts * (z - 1) / z
    law = kp + integral + derivative if form else kp * (1 + integral + derivative)
    errors = np.abs(np.random.default_rng(8).normal(1.0, 0.2, 80)).cumsum() / 20 + 1.0
    _, expected = control.forced_response(control.minreal(law, verbose=False), U=errors)
    words = _words(Kp=kp, Ki=ki, Kd=kd, Ts=500, Type=form, Action=action)
    setpoints, feedbacks = (errors, errors * 0) if action == 0 else (errors * 0, errors)
    found = _run(words, setpoints, feedbacks, LINEAR)
    assert 0.0 < min(found) < max(found) < 100.0
    assert found == pytest.approx(expected, rel=1e-5)


def test_an_edge_of_en_zeroes_output_and_false_leaves_it():
    # manual: "On the positive transition edge in EN, Output receives zero value"; FALSE: "Output remains unchanged"
    enabled = [0, 1, 1, 1, 0, 0, 1, 1]
    found = _run(_words(Ki=0.5), [10] * 8, [0] * 8, EN=enabled)
    # u = i + 1.5·10, i grows by 5 a call; it begins at zero after each edge
    assert found == [0, 0, 15, 20, 20, 20, 0, 15]
    at_once = _run(_words(Ki=0.5), [10] * 8, [0] * 8, {"edge": "runs_at_once"}, EN=enabled)
    assert at_once == [0, 15, 20, 25, 25, 25, 15, 20]


def test_history_tells_whether_the_first_difference_is_one():
    words = _words(Kd=2.0, MaximumOutput=100.0)
    assert _run(words, [10] * 3, [0] * 3, {"edge": "runs_at_once"}) == [10, 10, 10]
    assert _run(words, [10] * 3, [0] * 3, LINEAR) == [30, 10, 10]
    # the filter begins at zero too: half of the way at Tau = Ts
    assert _run(_words(TauSetPoint=1.0), [80] * 3, [0] * 3, LINEAR) == [40, 60, 70]
    assert _run(_words(TauSetPoint=1.0), [80] * 3, [0] * 3, {"edge": "runs_at_once"}) == [80, 80, 80]


@pytest.mark.parametrize(("setting", "share"), [("implicit", 1.0 / 3.0), ("exact", 1.0 - math.exp(-0.5))])
def test_the_filter_goes_its_share_of_the_way(setting, share):
    # Ts = 1 s, Tau = 2 s
    found = _run(_words(TauSetPoint=2.0), [0, 80, 80], [0] * 3, {"filter": setting})
    assert found == pytest.approx([0.0, 80 * share, 80 * (1 - (1 - share) ** 2)], rel=1e-6)


def test_a_filter_shorter_than_ts_is_stable():
    # the example's Tau = Ts/5: an explicit step would go five times the way, the implicit one goes 5/6 of it
    found = _run(_words(TauSetPoint=0.2), [0, 60, 60, 60], [0] * 4)
    assert found == pytest.approx([0, 50, 60 - 10 / 6, 60 - 10 / 36], rel=1e-6)


@pytest.mark.parametrize(("setting", "after"), [("clamp", [30, 35]), ("freeze", [10, 15]), ("none", [90, 95])])
def test_the_integral_part_at_a_limit(setting, after):
    # Kp = Ki = Ts = 1: u = i + 2e. e = 80 gives 160, limited to 100: i is 100 − 80, 0 or 80; then e = 5 adds 10, and 5 to i
    assert _run(_words(Ki=1.0), [80] * 4, [0, 0, 75, 75], {"anti_windup": setting}) == [0, 100, *after]


def test_the_integral_part_is_led_back_at_the_lower_limit_too():
    # e = −10: u = −20, limited to 0: i = 0 + 10; then e = 10: 10 + 20
    assert _run(_words(Ki=1.0), [50] * 3, [60, 60, 40]) == [0, 0, 30]


def test_a_kick_of_the_derivative_part_does_not_move_the_integral_part():
    # Kp = 1, Ki = 0.1, Kd = 20: e steps from 0 to 10: u = 11 + 200, limited; i = 1, so the next calls give 12 and 13
    assert _run(_words(Ki=0.1, Kd=20.0), [40, 50, 50, 50], [40] * 4)[1:] == pytest.approx([100, 12, 13])


@pytest.mark.parametrize("setting", ["clamp", "freeze", "none"])
def test_a_proportional_controller_forgets_its_limits(setting):
    # u = 3e, held within 0…100, whatever came before
    assert _run(_words(Kp=3.0), [50] * 4, [50, 0, 45, 60], {"anti_windup": setting})[1:] == [100, 15, 0]


def test_the_flags_tell_the_limit():
    rows = [{"SetPoint": 50.0, "Feedback": x} for x in (50.0, 0.0, 45.0, 60.0)]
    flags = [scan.flags for scan in replay(ROOM, _words(Kp=3.0), rows)]
    assert [(f["upper limit"], f["lower limit"]) for f in flags] == [
        (False, True), (True, False), (False, False), (False, True),
    ]


def test_a_proportional_controller_does_not_ramp():
    # what u(k−1) in place of i(k−1), the misprint of the CFW700's manual, would do
    assert _run(_words(Kp=2.0), [50] * 6, [40] * 6)[1:] == [20] * 5


def test_action_tells_the_sign_of_the_error():
    assert _run(_words(), [50, 50], [40, 40]) == [0, 10]
    assert _run(_words(Action=1), [50, 50], [40, 40]) == [0, 0]
    assert _run(_words(Action=1), [40, 40], [50, 50]) == [0, 10]


def test_manual_is_the_output_and_the_way_back_is_a_switch():
    inputs = {"SelectSetPoint": [0, 0, 1, 1, 0], "ManualSetPoint": [0.0, 0.0, 60.0, 130.0, 0.0]}
    rows = ([10] * 5, [0] * 5)
    words = _words(Ki=0.5)
    # u = i + 15; i grows by 5 a call in automatic only
    assert _run(words, *rows, **inputs) == [0, 15, 60, 100, 20]
    assert _run(words, *rows, {"manual": "unlimited"}, **inputs) == [0, 15, 60, 130, 20]
    beyond = {"SetPoint": 10.0, "Feedback": 0.0, "SelectSetPoint": 1, "ManualSetPoint": 130.0}
    scans = replay(ROOM, words, [beyond] * 2, {"manual": "unlimited"})
    assert (scans[1].output, scans[1].power_pct) == (130.0, 100.0)
    # bumpless: i = 100 − 10, so the sum goes on from 100; it would pass the limit
    inputs["ManualSetPoint"][3] = 55.0
    assert _run(words, *rows, {"manual_return": "bumpless"}, **inputs) == [0, 15, 60, 55, 60]


@pytest.mark.parametrize("broken", [math.nan, math.inf, -math.inf])
def test_a_broken_sensor_switches_the_heater_off_and_is_forgotten(broken):
    words, assume = _words(Ki=0.5, Kd=1.0, MinimumOutput=5.0), WegAssumptions()
    block, states = block_of(words.values, assume), [WegState()]
    for feedback in (20.0, 20.0, broken, 20.0):
        states.append(call(block, assume, states[-1], WegInputs(50.0, feedback)))
    assert states[3] == states[2]._replace(output=5.0, overflow=True)
    assert states[4].output == pytest.approx(min(100.0, states[2].integral + 45.0))
    assert not states[4].overflow
    assert ROOM.step(ROOM.start(words, {}), 50.0, broken)[1].power_pct == 5.0


def test_sums_beyond_single_precision_stay_in_range():
    words = _words(Kp=3e38, Ki=3e38, Kd=3e38, Type=1)
    found = _run(words, [3e38, -3e38, 3e38, 1.0, 0.0, -1.0], [0.0, 3e38, 0.0, 0.0, 1.0, 0.0])
    assert all(0.0 <= u <= 100.0 for u in found)


def test_an_increment_below_half_a_digit_of_the_sum_is_lost():
    # at 50 the singles are 2^-18 = 3.8e-6 apart: DIFFERENCES.md, known differences
    words, assume = _words(Ki=1e-3), WegAssumptions()
    block, state = block_of(words.values, assume), WegState(enabled=True, integral=50.0, reference=0.0)
    lost, kept = (call(block, assume, state, WegInputs(0.0, -error)).integral for error in (1.8e-3, 2.0e-3))
    assert (lost, kept) == (50.0, single(50.0 + 2.0**-18))


def test_words_are_kp_one_over_ti_and_td():
    # CFW500 programming manual, p. 13-12: Ki = 1/Ti, Kd = Td
    v = ROOM.encode(_design(gain=2.5, tn=250.0, tv=12.0, ta=0.05), Scaling()).values
    assert (v["Kp"], v["Ki"], v["Kd"], v["Ts"], v["Type"], v["Action"]) == (2.5, single(0.004), 12.0, 50, 0, 0)
    assert (v["TauSetPoint"], v["MinimumOutput"], v["MaximumOutput"]) == (0.0, 0.0, 100.0)
    assert ROOM.encode(_design(tn=math.inf, tv=0.0), Scaling()).values["Ki"] == 0.0
    cooling = ROOM.encode(_design(gain=-2.5), Scaling())
    assert (cooling.values["Kp"], cooling.values["Action"]) == (2.5, 1)
    assert ROOM.decode(cooling).gain_pct_per_degC == -2.5


def test_both_forms_are_decoded_to_the_standard_form():
    academic = ROOM.decode(_words(Kp=2.0, Ki=0.005, Kd=20.0))
    parallel = ROOM.decode(_words(Kp=2.0, Ki=0.01, Kd=40.0, Type=1))
    for found in (academic, parallel):
        assert found.gain_pct_per_degC == 2.0
        assert found.integral_time_s == pytest.approx(200.0, rel=1e-7)
        assert (found.derivative_time_s, found.derivative_filter) == (20.0, 0.0)
    assert ROOM.decode(_words()).structure == "p"


def test_both_forms_of_one_design_give_one_answer():
    w, x = [60.0] * 40, np.linspace(55.0, 61.0, 40)
    academic = _run(_words(Kp=2.0, Ki=0.0625, Kd=4.0), w, x)
    assert _run(_words(Kp=2.0, Ki=0.125, Kd=8.0, Type=1), w, x) == pytest.approx(academic, rel=1e-5, abs=1e-4)
    assert np.ptp(academic) > 10.0


@pytest.mark.parametrize(("design", "word", "remedy"), [
    (_design(ta=0.0504), "TA", r"0\.05 s would fit"), (_design(ta=100.0), "TA", r"65\.535 s would fit"),
    (_design(ta=1e-5), "TA", r"0\.001 s would fit"), (_design(gain=1e39), "Kp", "nearer"),
    (_design(tn=1e46), "Ki", "TN"), (_design(tv=1e39), "Kd", "TV"), (_design(gain=1e-46), "Kp", "nearer"),
])
def test_what_does_not_fit_is_refused_with_what_would(design, word, remedy):
    with pytest.raises(NotRepresentable, match=rf"{word}\b.*{remedy}"):
        ROOM.encode(design, Scaling())


def test_a_real_given_as_a_whole_number_is_the_same_real():
    whole = _words(Kp=3, Ki=0, Kd=2, TauSetPoint=1, MinimumOutput=0, MaximumOutput=90)
    same = {name: value if name in ("Type", "Action", "Ts") else float(value) for name, value in whole.values.items()}
    ROOM.check(whole)
    # as text, as 0 == 0.0; a compiler tells them apart as well
    assert repr(block_of(whole.values, WegAssumptions())) == repr(block_of(same, WegAssumptions()))


@pytest.mark.parametrize(("words", "named"), [
    (_words(MinimumOutput=60.0, MaximumOutput=50.0), "word MinimumOutput"), (_words(Kp=0.0), "word Kp"),
    (Words(target="weg", values=_words().values, scaling=Scaling(), sample_time_s=2.0), "sample_time_s"),
])
def test_words_that_contradict_each_other_are_refused(words, named):
    with pytest.raises(OutOfRange, match=named):
        ROOM.decode(words)


def test_the_block_is_called_every_ts():
    assert ROOM.timing(_words(**EXAMPLE)).scan_s == 0.05


def test_a_setting_that_does_not_exist_is_refused():
    with pytest.raises(UnknownName, match="clamp, freeze, none"):
        ROOM.start(_words(), {"anti_windup": "hope"})


def test_a_reading_is_a_count_of_twelve_bits_in_degrees():
    words = _words()
    # 4095 counts over 100 °C: 50 °C is count 2047.5, cut to 2047
    assert ROOM.measure(words, 50.0) == single(100.0 * 2047 / 4095)
    assert ROOM.measure(words, 100.0) == 100.0


def test_the_call_is_the_manuals_example_with_its_words():
    files = ROOM.export(_words(**EXAMPLE), Certificate(verdict="PASS", lines=("proven in 9 runs",)))
    text = files["weg_pid_call.st"]
    # the assignments of the manual's ST example, and its members EN and Output
    for line in ("HeaterPid.EN := HeaterOn;", "MinimumOutput := 0.1,", "MaximumOutput := 2.5,", "Kp := 6.2,", "Ki := 1.3,",
                 "Kd := 1.8,", "TauSetPoint := 0.01,", "Type := 0,", "Action := 0,", "Ts := 50);",
                 "HeaterPower := HeaterPid.Output;", ": FB_PID;"):
        assert line in text
    for content in files.values():
        assert "verdict of the proof: PASS" in content
        assert "proven in 9 runs" in content
    assert ROOM.export(_words(**EXAMPLE), Certificate(verdict="PASS", lines=("proven in 9 runs",))) == files
