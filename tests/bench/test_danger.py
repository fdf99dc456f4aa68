"""The heaters are what they say, the truth is judged rightly, and no PASS of a small choice of them is a false one."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.bench import danger, heaters, truth
from tests.bench.heaters import Heater, Rig
from tests.bench.truth import Law

PLAIN = Heater(gain=0.8, lags=(120.0,), dead=20.0, ambient=22.0)


def _pi(k, ta, tn):
    return Law(k, ta / tn, 0.0, 0.0, 0.0, ta)


def _sampled(heater, ta):
    (a, b), = truth.linearised(heater, 50.0)
    return truth.sampled(a, b, heater.dead, ta)


def test_a_heater_answers_a_step_as_its_lags_do():
    # 1 − e^(−t/T) for one lag, 1 − (1 + t/T)·e^(−t/T) for two equal ones, after the dead time
    for lags, share in (((120.0,), lambda x: 1.0 - math.exp(-x)), ((120.0, 120.0), lambda x: 1.0 - (1.0 + x) * math.exp(-x))):
        rig = Rig(replace(PLAIN, lags=lags), 22.0)
        rig.run(7.0)
        rig.set(50.0)
        assert rig.run(27.0) == 22.0
        assert rig.run(187.0) == pytest.approx(22.0 + 40.0 * share(160.0 / 120.0), abs=1e-4)


def test_a_heater_rests_where_gain_and_loss_are_even():
    assert PLAIN.rest_at(50.0) == pytest.approx(62.0)
    assert PLAIN.power_at(62.0) == pytest.approx(50.0)
    assert replace(PLAIN, saturates=25.0).rest_at(50.0) == pytest.approx(42.0)
    assert replace(PLAIN, bend=0.5).rest_at(50.0) == pytest.approx(22.0 + 40.0 * 0.75)
    assert replace(PLAIN, sag=1.0).rest_at(50.0) == pytest.approx(22.0 + 40.0 / 1.5)  # rise = 40·(1 − rise/80)
    assert replace(PLAIN, boils=50.0).rest_at(50.0) == pytest.approx(50.0 + 12.0 / 51.0)
    glowing = replace(PLAIN, gain=8.0, radiation=1.0)  # all loss by radiation: T⁴ = Ta⁴ + 4·Ta³·gain·power
    assert glowing.rest_at(50.0) == pytest.approx((295.15**4 + 4.0 * 295.15**3 * 400.0) ** 0.25 - 273.15)
    assert PLAIN.power_at(110.0) is None


def test_the_gain_near_a_setpoint_is_the_slope_of_what_a_heater_rests_at():
    for changes in ({}, {"bend": 0.5}, {"sag": 2.0}, {"radiation": 0.5}, {"bend": 0.3, "lags": (120.0, 40.0, 9.0)}):
        heater = replace(PLAIN, **changes)
        (a, b), = truth.linearised(heater, 40.0)
        power = heater.power_at(40.0)
        slope = (heater.rest_at(power + 0.01) - heater.rest_at(power - 0.01)) / 0.02
        assert -np.linalg.solve(a, b)[-1] == pytest.approx(slope, rel=1e-3)


def test_a_heater_that_cools_more_slowly_has_two_sides():
    sides = truth.linearised(replace(PLAIN, cooling=2.0), 40.0)
    assert [float(a[0, 0]) for a, _ in sides] == pytest.approx([-1.0 / 120.0, -1.0 / 240.0])


def test_a_sampled_p_loop_on_one_lag_is_stable_up_to_the_gain_of_its_one_pole():
    # x₊ = φ·x − (1 − φ)·k·K·x: |φ − (1 − φ)·k·K| < 1
    heater = replace(PLAIN, dead=0.0)
    phi = math.exp(-30.0 / 120.0)
    limit = (1.0 + phi) / (1.0 - phi) / 0.8
    for share, wanted in ((0.999, True), (1.001, False)):
        assert truth.stable(_sampled(heater, 30.0), Law(share * limit, 0.0, 0.0, 0.0, 0.0, 30.0)) is wanted


@pytest.mark.parametrize("parts", [100, 500])  # 500: encirclements instead of eigenvalues
def test_skogestad_s_pi_has_the_published_margins(parts):
    # SIMC with τc = L on FOPDT: Ms 1.59, gain margin 3.14 (J. Process Control 13 (2003), Table 2)
    ta, k = 20.0 / parts, 120.0 / (0.8 * 2.0 * 20.0)
    plant = _sampled(PLAIN, ta)
    assert truth.peak(plant, _pi(k, ta, 120.0), 140.0) == pytest.approx(1.59, abs=0.015)
    assert truth.stable(plant, _pi(3.08 * k, ta, 120.0))
    assert not truth.stable(plant, _pi(3.2 * k, ta, 120.0))


@pytest.mark.long
def test_eigenvalues_encirclements_and_a_run_of_the_loop_agree():
    rng = np.random.default_rng(1)
    seen = set()
    for number in range(25):
        ta = float(rng.uniform(2.0, 30.0))
        heater = replace(PLAIN, dead=float(rng.uniform(0.0, 60.0)), lags=(120.0, float(rng.uniform(1.0, 60.0))))
        law = Law(float(rng.uniform(1.0, 12.0)), ta / 120.0, 0.0, 0.0, 0.0, ta)
        if number % 2:  # as the derivative of IEC 61131-3
            law = replace(law, d=10.0 / ta, slope=(0.3, 0.1, -0.1, -0.3))
        plant = _sampled(heater, ta)
        stable = truth.stable(plant, law)
        seen.add(stable)
        assert truth._not_encircled(plant, law) is stable
        if not stable or truth.peak(plant, law, 200.0) < 2.5:  # between them the swing dies away too slowly
            assert truth.swings(Rig(heater, 22.0), law, 50.0, 4000.0) is not stable
    assert seen == {True, False}


def test_words_mean_what_the_manuals_say():
    # K = 1 %/°C, TN = 80 s, called every 5 s, on a range of 200 °C; TV 15 s where the block has a D part
    s5 = truth.law_of("s5-ob251", {"K": 2048, "R": 1024, "TI": 64, "TD": 3}, 0.0, 200.0, 5.0)
    assert s5 == Law(1.0, 5.0 / 80.0, 0.0, 3.0, 0.5, 5.0)
    tip = truth.law_of("s7-300", {"GAIN": 2.0, "RESET": 80000.0, "RATE": 15000.0, "SAMPLE": 5000.0}, 0.0, 200.0, 5.0)
    assert tip == Law(1.0, 5.0 / 80.0, 0.0, 3.0, 0.0, 5.0)
    weg = {"Kp": 1.0, "Ki": 0.0125, "Kd": 15.0, "Type": 0, "Action": 0, "Ts": 5000}
    assert truth.law_of("weg", weg, 0.0, 200.0, 5.0) == Law(1.0, 5.0 / 80.0, 0.0, 3.0, 0.0, 5.0)
    cont_c = {"GAIN": 1.0, "PV_FAC": 2.0, "LMN_FAC": 1.0, "CYCLE": 5000, "TI": 80000, "TD": 15000, "TM_LAG": 7500,
              "I_SEL": 1, "D_SEL": 1}
    assert truth.law_of("fb41", cont_c, 0.0, 200.0, 5.0) == Law(1.0, 1.0 / 32.0, 1.0 / 32.0, pytest.approx(3.0), 0.5, 5.0)
    # 1 % of a cycle of 5100 ms is 51 ms, 1 °C is 255/200 counts: 40 ms a count, here in 256ths
    own = truth.law_of("s7-200", {"KP": 10240, "KI": 320, "KD": 30720, "SCALE": 8, "TICK": 51, "TICKS": 100}, 0.0, 200.0, 5.1)
    assert (own.k, own.i_now, own.i_before, own.d) == pytest.approx((1.0, 1.0 / 32.0, 1.0 / 32.0, 3.0))
    # gains of 0…255, of 0…100 and of 0…1; a band of 100.0 °C, its derivative with a lag of 15/8 s
    for target, full in (("arduino-pid", 255.0), ("simple-pid", 100.0), ("esphome", 1.0)):
        names = ("kp", "ki", "kd") if target == "esphome" else ("Kp", "Ki", "Kd")
        gains = dict(zip(names, (full / 100.0, full / 8000.0, 0.15 * full), strict=True))
        assert truth.law_of(target, gains, 0.0, 200.0, 5.0) == Law(
            pytest.approx(1.0), pytest.approx(5.0 / 80.0), 0.0, pytest.approx(3.0), 0.0, 5.0)
    assert truth.law_of("iec-pid", {"KP": 1.0, "TR": 80.0, "TD": 0.0}, 0.0, 200.0, 5.0) == Law(1.0, 5.0 / 80.0, 0.0, 0.0, 0.0, 5.0)
    # a ramp of 1 °C per call, and a parabola: the four-point slope of IEC 61131-3 is exact on both, one call and a half behind
    slope = truth.law_of("iec-pid", {"KP": 1.0, "TR": 80.0, "TD": 15.0}, 0.0, 200.0, 5.0).slope
    assert np.dot(slope, [3.0, 2.0, 1.0, 0.0]) == pytest.approx(1.0)
    assert np.dot(slope, [9.0, 4.0, 1.0, 0.0]) == pytest.approx(2.0 * 1.5)
    band = truth.law_of("pband", {"Pb": 1000, "ti": 80, "td": 15}, 0.0, 200.0, 5.0)
    assert band == Law(1.0, 5.0 / 80.0, 0.0, 3.0, pytest.approx(1.875 / 6.875), 5.0)


@pytest.mark.long
def test_a_case_is_its_seed_s_and_its_log_can_be_read(tmp_path):
    for kind in heaters.KINDS:
        case = heaters.make(kind, 3)
        assert case.text() == heaters.make(kind, 3).text()
        rows = case.text().splitlines()
        assert len(rows) > 20
        assert rows[0].startswith("time_s,temperature_degC")
        assert case.range[1] > case.columns["temperature_degC"][5:-5].max()


# kind and seed: each of the first was a PASS that swung or nearly did on its heater
FALSE_ONCE = (("warm start", 2), ("frozen readings", 1), ("saturation", 0), ("heat is not cool", 2))
INSIDE = (("one lag", 1), ("equal lags", 0), ("ambient drift", 0), ("gaps", 1), ("coloured noise", 0), ("coarse sensor", 0))


@pytest.mark.long(seconds=40)
def test_no_pass_is_a_false_one_and_most_heaters_inside_the_model_class_pass(whatever_pays):
    outcomes = [danger.run((kind, seed, ["s7-300"], "pi", False, None, None)) for kind, seed in FALSE_ONCE + INSIDE]
    assert danger.dangers(outcomes) == []
    inside = [end for o in outcomes[len(FALSE_ONCE) :] for end in o.ends.values()]
    assert sum(end.end == "PASS" for end in inside) >= 0.8 * len(inside)


def test_the_controllers_are_taken_in_turn():
    asked = danger.cases(danger._arguments(["--kinds", "one lag", "cooler", "--count", "3", "--targets", "weg", "s7-300", "fb41", "--each", "2"]))
    assert [(kind, seed) for kind, seed, *_ in asked] == [(kind, seed) for seed in range(3) for kind in ("one lag", "cooler")]
    assert [targets for _, _, targets, *_ in asked] == [["weg", "s7-300"], ["fb41", "weg"], ["s7-300", "fb41"]] * 2


def test_a_design_that_takes_too_long_is_told(monkeypatch):
    def never(*_):
        while True:
            pass

    monkeypatch.setattr(danger, "on_target", never)
    late = danger.Outcome("one lag", 0, "", ends={"weg": danger.in_time(None, None, "weg", "pi", False, 0.01)})
    assert late.ends["weg"].why == "more than 0.01 s of processor time"
    lines = danger.table([late], ["weg", "fb41"])
    assert [line.split(" | ")[8] for line in (lines[0], lines[2])] == ["late", "1"]
