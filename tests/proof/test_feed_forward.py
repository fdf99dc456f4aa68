"""Feed-forward beside plain feedback, against a simulation of its own: OB251's equation and the heater, written anew."""

from dataclasses import replace

import numpy as np
import pytest

from heatertune.errors import InputError
from heatertune.model.disturbance import DisturbanceEffect
from heatertune.model.model_values import Fopdt
from heatertune.pid.design_values import PidDesign
from heatertune.plc import Scaling, controller_for
from heatertune.plc.feed_forward import feed_forward
from heatertune.plc.pwm import Actuator
from heatertune.proof.criteria import LoopLimits
from heatertune.proof.feed_forward_check import FeedForwardComparison, PlainLoop, prove_feed_forward

TA, SETPOINT = 5.0, 80.0
#: until an input module's reading is there, S5 (AI 460) and S7-300 (SM 331 with wire-break check) [s]
LATE = {"s5-ob251": 0.48, "fb41": 8 * (0.022 + 0.01)}
#: with OB251's delay a dead time of three TA: there two simulations hunt alike at rest, and can be held against each other
HEATER = Fopdt(gain_degC_per_pct=0.9, time_constant_s=120.0, dead_time_s=15.0 - LATE["s5-ob251"], ambient_degC=25.0)
EFFECT = DisturbanceEffect(
    column="flow", pct_per_unit=-8.0, pct_per_unit_ci95=(-9.0, -7.0), delay_s=9.0, lead_s=6.0, lead_s_ci95=(4.0, 8.0),
    calm=1.0, strong=2.5, delta_bic=500.0, delta_bic_own_lag=300.0, own_lag_s=90.0)
ROOM = controller_for("s5-ob251")
DESIGN = PidDesign(gain_pct_per_degC=3.0, integral_time_s=100.0, derivative_time_s=0.0, sample_time_s=TA, structure="pi", method="")
WORDS = ROOM.encode(DESIGN, Scaling(low_degC=0.0, high_degC=200.0))
SWITCH = Actuator(pwm_period_s=TA, resolution_s=0.05)
DEFAULTS = {switch.name: switch.default for switch in ROOM.switches}


def _prove(effect=EFFECT, words=WORDS, **changed):
    room = controller_for(words.target)
    line = feed_forward(room.feed, column="flow", pct_per_unit=effect.pct_per_unit, calm=1.0, low=0.0, high=5.0)
    models = changed.pop("models", [("h", HEATER)])
    plain = {"stated_settings": {switch.name: switch.default for switch in room.switches}, "setpoint_degC": SETPOINT, "actuator": SWITCH}
    return prove_feed_forward(words, line, effect, models, PlainLoop(**(plain | changed)))


def _witness(fed, effect, lead, hot_s, rest_s):
    """∫|error| and largest |error| from the step on; 0.05 s steps, each exact for the power in it."""
    h, v = 0.05, WORDS.values
    steps, dead, left = round((hot_s + 2.0 * rest_s) / h), round(15.0 / h), np.exp(-h / HEATER.time_constant_s)
    pulse, period = np.zeros(steps + dead), round(TA / h)
    y, last, total, z_last, at_limit = HEATER.ambient_degC, 0.0, 0.0, 0, False
    absolute = largest = 0.0
    for i in range(steps):
        now = i * h
        strong = hot_s < now <= hot_s + rest_s
        if i % period == 0:
            x = int(min(max(y * 2047 / 200.0, 0), 2047))
            error = int(SETPOINT * 2047 / 200.0) - x
            count = int((2.5 if strong else 1.0) / 5.0 * 2047)
            # −(−8 %)·20.47·(0 − 1) and ·(5 − 1), rounded, between them cut towards zero
            z = int(-164 + 819 * count / 2047) if fed else 0
            gain, ti = v["K"] / 1024, v["TI"] / 1024
            total += gain * (error - last) + (0.0 if at_limit else gain * ti * error) + (z - z_last)
            last, z_last, at_limit = error, z, not 0 < total < 2047
            on = round(int(min(max(total, 0), 2047)) / 2047 * TA / h)
            pulse[i + dead : i + dead + min(on, period)] = 100.0
        begun = hot_s + HEATER.dead_time_s - lead
        load = effect * 1.5 if begun < now <= begun + rest_s else 0.0
        target = HEATER.ambient_degC + HEATER.gain_degC_per_pct * (pulse[i] + load)
        y = target + (y - target) * left
        if now >= hot_s:
            absolute, largest = absolute + abs(y - SETPOINT) * h, max(largest, abs(y - SETPOINT))
    return absolute, largest


@pytest.mark.long
@pytest.mark.usefixtures("whatever_pays")
def test_both_loops_are_as_simulated_elsewhere():
    proof = _prove()
    assert [run.label for run in proof.runs] == [
        "h", "h, heat-up while it is strong", "h, effect at its low end", "h, effect at its high end", "h, acting at its earliest"]
    # eight times lag and dead time, six times TN as OB251 holds it (round(1024·5/100) = 51), ten scans; whole scans
    rest_s = np.ceil((8 * (135.0 - LATE["s5-ob251"]) + 6 * 5.0 * 1024 / 51 + 50.0) / TA) * TA
    for number, effect, lead in ((2, -9.0, 6.0), (4, -8.0, 8.0)):
        for fed in (0, 1):
            absolute, largest = _witness(fed, effect, lead, rest_s, rest_s)
            assert proof.runs[number].iae_degC_s[fed] == pytest.approx(absolute, rel=0.02)
            assert proof.runs[number].deviation_degC[fed] == pytest.approx(largest, rel=0.02)
    assert proof.refusal == ""


@pytest.mark.long
@pytest.mark.usefixtures("whatever_pays")
def test_every_heater_and_setting_is_run_and_the_document_holds_them():
    cold = replace(HEATER, gain_degC_per_pct=1.0)
    proof = _prove(models=[("a", HEATER), ("b", cold)], stated_settings={})
    settings = sum(len(switch.settings) - 1 for switch in ROOM.switches if not (switch.in_manual or switch.chosen))
    # each of the settings alone, default first, with the step and with the heat-up; three more effects
    assert len(proof.runs) == 2 * (2 * (1 + settings) + 3)
    document = proof.to_document()
    assert (document["verdict"], document["input"], len(document["runs"])) == ("PASS", "Z", len(proof.runs))
    assert document["runs"][document["worst"]]["label"] == proof.worst.label
    assert document["load_pct"] == pytest.approx(-8.0 * 1.5)


@pytest.mark.long
def test_disv_does_the_same():
    words = controller_for("fb41").encode(DESIGN, Scaling(low_degC=0.0, high_degC=200.0))
    same = replace(HEATER, dead_time_s=15.0 - LATE["fb41"])
    mine, other = _prove(words=words, models=[("h", same)]), _prove()
    assert mine.word == "DISV"
    assert mine.refusal == ""
    assert mine.runs[0].iae_ratio == pytest.approx(other.runs[0].iae_ratio, abs=0.1)


def test_what_hardly_helps_is_refused():
    # 0.3 % of power moves the reading by no more than a PWM period does
    proof = _prove(effect=replace(EFFECT, pct_per_unit=-0.2, pct_per_unit_ci95=(-0.21, -0.19)))
    assert proof.refusal.startswith("feed-forward hardly helps")
    assert proof.to_document()["verdict"] == "FAIL"


@pytest.mark.long
@pytest.mark.usefixtures("whatever_pays")
def test_what_acts_long_before_the_power_does_is_no_better_than_the_dead_time_lets_it():
    far = replace(HEATER, dead_time_s=100.0)
    calm = ROOM.encode(replace(DESIGN, gain_pct_per_degC=0.5, integral_time_s=150.0), Scaling(low_degC=0.0, high_degC=200.0))
    early = _prove(effect=replace(EFFECT, lead_s=100.0, lead_s_ci95=(95.0, 105.0)), words=calm, models=[("far", far)]).runs[0]
    # nothing can be done for 100 s: 0.9·12·(1 − e^(−100/120)) = 6.1 °C
    assert 6.1 < early.deviation_degC[1] < early.deviation_degC[0]
    together = _prove(effect=replace(EFFECT, lead_s=0.0, lead_s_ci95=(-1.0, 1.0)), words=calm, models=[("far", far)]).runs[0]
    assert together.deviation_degC[1] < 0.2 * together.deviation_degC[0]


def test_an_interval_that_makes_it_worse_is_refused():
    # where the disturbance in truth does a fifth of it, four fifths are added for nothing
    wide = replace(EFFECT, pct_per_unit_ci95=(-9.0, -1.5))
    proof = _prove(effect=wide)
    assert proof.refusal.startswith("feed-forward may be worse than plain feedback")
    assert "effect at its high end" in proof.refusal


@pytest.mark.parametrize("place", range(4))
def test_what_is_no_number_is_a_refusal(place):
    proof = _prove()
    numbers = [10.0, 5.0, 2.0, 1.0]
    numbers[place] = float("nan")
    strange = FeedForwardComparison(label="strange", iae_degC_s=tuple(numbers[:2]), deviation_degC=tuple(numbers[2:]))
    assert "strange" in replace(proof, runs=(*proof.runs, strange)).refusal


def test_a_heat_up_that_it_drives_beyond_the_limit_is_refused():
    proof = _prove(limits=LoopLimits(overshoot_pct=1e-9))
    heated = next(run for run in proof.runs if run.allowed_degC is not None)
    assert heated.allowed_degC == pytest.approx(55.0 * 1e-11)
    assert bool(proof.refusal) == (heated.deviation_degC[1] > 1.05 * heated.deviation_degC[0])


@pytest.mark.parametrize(("changed", "match"), [
    ({"setpoint_degC": 113.0}, "leaves nothing to make up for the disturbance"),
    ({"models": []}, "at least one model"),
])
def test_what_cannot_be_tried_is_refused(changed, match):
    with pytest.raises(InputError, match=match):
        _prove(**changed)


def test_a_controller_without_an_input_for_it_is_refused():
    line = feed_forward(ROOM.feed, column="flow", pct_per_unit=-8.0, calm=1.0, low=0.0, high=5.0)
    words = controller_for("s7-300").encode(DESIGN, Scaling(low_degC=0.0, high_degC=200.0))
    with pytest.raises(InputError, match="s7-300 has no input for a measured disturbance"):
        prove_feed_forward(words, line, EFFECT, [("h", HEATER)], PlainLoop(setpoint_degC=SETPOINT, actuator=SWITCH))


def test_a_step_that_leaves_no_reserve_is_made_smaller():
    # holding 105 °C takes 88.9 %, and 95 % is the most: 6.1 % of the 13.5 % of the strongest effect's step
    proof = _prove(setpoint_degC=105.0)
    assert proof.step[1] == pytest.approx(1.0 + 1.5 * (95.0 - 80.0 / 0.9) / 13.5)
