"""PID_Temp that heats and cools against the witness, which was written from the manual before the controller could cool."""

import math

import numpy as np
import pytest
from tests.witness.pid_temp import (
    ANTI_WINDUP,
    DERIVATIVES,
    INTEGRALS,
    MEMORIES,
    RULES,
    HeatCool,
    Pulses,
    Set,
    outputs,
    with_factor,
)

from heatertune.plc import Scaling, Words, controller_for
from heatertune.plc.open_points import assumptions_from
from heatertune.plc.pid_temp.step import COLD_PAIR, CoolingAssumptions, pair_of, pair_step
from heatertune.plc.pwm import on_time, pid_compact
from heatertune.plc.replay import replay
from heatertune.plc.single_precision import single

PID_TEMP = controller_for("pid-temp-cooling")
PLAIN = {"Gain": 1.0, "Ti": 0.0, "Td": 0.0, "TdFiltRatio": 0.2, "PWeighting": 1.0, "DWeighting": 0.0, "Cycle": 1.0,
         "AdvancedCooling": 0, "CoolFactor": 1.0, "CoolGain": 1.0, "CoolTi": 0.0, "CoolTd": 0.0, "CoolTdFiltRatio": 0.2,
         "CoolPWeighting": 1.0, "CoolDWeighting": 0.0, "CoolCycle": 1.0, "OutputUpperLimit": 100.0, "OutputLowerLimit": -100.0,
         "IntegralResetMode": 1}
_ROUNDING = 2.0**-24


def _words(**changed):
    values = {name: single(value) if isinstance(value, float) else value for name, value in (PLAIN | changed).items()}
    return Words(target="pid-temp-cooling", values=values, scaling=Scaling(), sample_time_s=float(f"{values['Cycle']:.7g}"))


def _outputs(words, setpoints, readings, **switches):
    rows = [{"Setpoint": w, "Input": x} for w, x in zip(setpoints, readings, strict=True)]
    return [scan.output for scan in replay(PID_TEMP, words, rows, switches)]


def _drawn(chance):
    """Random words with a lag that no sampling raises."""
    def spread(low, high):
        return single(low * (high / low) ** chance.random())

    ta = spread(0.1, 60.0)

    def one():
        td = spread(1.0, 300.0) if chance.random() < 0.6 else 0.0
        ratio = spread(max(0.05, 0.6 * ta / td), max(5.0, 2.0 * ta / td)) if td else 0.2
        return {"Gain": spread(0.1, 30.0), "Ti": spread(3.0 * ta, 400.0 * ta) if chance.random() < 0.85 else 0.0, "Td": td,
                "TdFiltRatio": float(ratio), "PWeighting": float(chance.integers(0, 5)) / 4.0,
                "DWeighting": float(chance.integers(0, 5)) / 4.0}

    cool = {f"Cool{name}": value for name, value in one().items()}
    return _words(**one(), **cool, Cycle=ta, CoolCycle=ta, AdvancedCooling=int(chance.integers(0, 2)), CoolFactor=spread(0.1, 10.0),
                  OutputUpperLimit=spread(30.0, 100.0), OutputLowerLimit=-spread(30.0, 100.0))


def _sets(v):
    names = ("Gain", "Ti", "Td", "TdFiltRatio", "PWeighting", "DWeighting")
    heat, own = (Set(*(v[prefix + name] for name in names)) for prefix in ("", "Cool"))
    return heat, own if v["AdvancedCooling"] else with_factor(heat, v["CoolFactor"])


def _apart(words, settings, chance, scans):
    """Run both on one wandering reading; return the greatest difference as a multiple of the rounding bound, and how many
    cycles were at each side; None where they take another side once, for then rounding decides what comes after."""
    assume, v = assumptions_from(CoolingAssumptions, settings), words.values
    block = pair_of(v, assume)
    heat, cool = _sets(v)
    witness = HeatCool(heat, cool, TA=v["Cycle"], low=v["OutputLowerLimit"], high=v["OutputUpperLimit"], rule=settings["parameter_set"],
                       memory=settings["integral_kept"], integral=settings["integral"], derivative=settings["derivative_lag"],
                       anti_windup=settings["anti_windup"], history=settings["history"])
    gain = max(heat.Kp, cool.Kp)
    state, worst, size, sides = COLD_PAIR, 0.0, 0.0, [0, 0]
    setpoint = reading = single(chance.uniform(20, 200))
    for scan in range(scans):
        if scan and chance.random() < 0.05:
            setpoint = single(chance.uniform(20, 200))
        if scan:
            reading = single(reading + chance.normal(0.0, 2.0))
        state, power, output, _ = pair_step((block, assume), state, setpoint, reading, True)
        expected = float(witness(setpoint, reading))
        kick = max(block.heat.kick, block.cool.kick)
        past = max(block.heat.past, block.cool.past)
        kept = abs(state.integral) * (gain if settings["integral_kept"] == "error" else 1.0)
        largest = gain * max(setpoint, reading) + kept + gain * kick * 200.0 + 100.0
        size += 8.0 * _ROUNDING * largest * max(1.0, heat.Kp / cool.Kp, cool.Kp / heat.Kp)
        if state.cools != witness.cools:
            # rounding may decide between the sets where the sum, the last output or the deviation is next to 0; and a
            # sum next to a limit whether I is stopped: such a walk ends here
            return worst, scan, sides
        worst = max(worst, abs(output - expected) / (16.0 * _ROUNDING * largest / (1.0 - past) + size))
        sides[state.cools] += 1
        assert power == output
    return worst, scans, sides


def _held_against(number, runs, scans):
    chance, worst, ran, sides = np.random.default_rng(number), 0.0, 0, np.zeros(2)
    for run in range(runs):
        settings = {"integral": INTEGRALS[run % 3], "derivative_lag": DERIVATIVES[run % 4], "anti_windup": ANTI_WINDUP[run // 4 % 4],
                    "history": ("present", "zero")[run // 2 % 2], "parameter_set": RULES[run // 3 % 3],
                    "integral_kept": MEMORIES[run // 5 % 2]}
        apart, done, at = _apart(_drawn(chance), settings, chance, scans)
        worst, ran, sides = max(worst, apart), ran + done, sides + at
    assert sides.min() > 0.2 * ran  # heating and cooling both had their share
    return worst, ran


def test_random_words_under_every_setting_are_the_witness_within_the_rounding_of_reals():
    worst, ran = _held_against(1, runs=96, scans=60)
    assert worst < 1.0
    assert ran > 0.9 * 96 * 60


@pytest.mark.long(seconds=30)
def test_more_than_a_hundred_thousand_scans_are_the_witness_within_the_rounding_of_reals():
    worst, ran = _held_against(2, runs=1_300, scans=100)
    assert worst < 1.0
    assert ran > 100_000


def test_the_cooling_factor_is_at_kp_of_the_cooling_side():
    # the manual's table of the equation: P alone, 4 % per degree to heat, 4·2.5 to cool
    words = _words(Gain=4.0, CoolFactor=2.5)
    assert _outputs(words, [60.0] * 4, [55.0, 60.0, 62.0, 75.0]) == [20.0, 0.0, -20.0, -100.0]


def test_with_two_sets_the_cooling_one_has_its_own_gain():
    words = _words(Gain=4.0, AdvancedCooling=1, CoolGain=3.0, CoolFactor=9.0)
    for rule in RULES:
        made = _outputs(words, [60.0] * 4, [55.0, 62.0, 62.0, 64.0], parameter_set=rule)
        # "output" and "both" look at the cycle before: the first one beyond the setpoint is still heating's
        assert made == [20.0, -6.0 if rule == "now" else -8.0, -6.0, -12.0], rule


@pytest.mark.parametrize(("kept", "last"), [("percent", -2.0 * 3.0 + 10.0), ("error", 3.0 * (-2.0 + 10.0 / 4.0))])
def test_what_of_i_stays_where_the_set_changes(kept, last):
    # Kp 4 heats, 3 cools; one cycle with e = 10 and T/TI = 1/4 leaves I = 10 %, 2.5 °C before Kp; the sum 4·(−2) + 10·… is above 0,
    # so "output" is asked for: the cycle after a sum below 0 takes cooling's set
    words = _words(Gain=4.0, Ti=4.0, AdvancedCooling=1, CoolGain=3.0, CoolTi=100000.0, OutputUpperLimit=100.0)
    setpoints, readings = [60.0, 60.0, 60.0], [50.0, 70.0, 62.0]
    made = _outputs(words, setpoints, readings, parameter_set="output", integral_kept=kept)
    # 40 + 10; −40 + 10 − 10; then cooling's
    assert made[:2] == [50.0, -40.0]
    assert made[2] == pytest.approx(last - 10.0 * (1.0 if kept == "percent" else 0.75), abs=1e-3)


def test_both_sides_are_limited_each_by_its_own_limit():
    words = _words(Gain=10.0, OutputUpperLimit=80.0, OutputLowerLimit=-30.0)
    assert _outputs(words, [60.0] * 2, [40.0, 80.0]) == [80.0, -30.0]
    assert outputs(-30.0, low=-30.0, high=80.0, cool_full=30.0) == (0.0, 30.0)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_what_is_no_number_asks_for_nothing_and_leaves_the_memory(bad):
    words = _words(Gain=2.0, Ti=10.0, CoolFactor=3.0)
    good = _outputs(words, [60.0, 60.0], [70.0, 70.0])
    assert _outputs(words, [60.0, 60.0, 60.0], [70.0, bad, 70.0]) == [good[0], 0.0, good[1]]
    assert _outputs(words, [60.0, bad, 60.0], [70.0, 70.0, 70.0]) == [good[0], 0.0, good[1]]


@pytest.mark.parametrize(("mode", "begins"), [(0, 0.0), (1, -30.0), (2, -30.0), (3, 0.0), (4, -30.0)])
def test_integral_reset_mode_begins_on_the_cooling_side_as_on_the_other(mode, begins):
    words = _words(Gain=2.0, Ti=100000.0, CoolFactor=1.5, IntegralResetMode=mode, Cycle=0.0010000000474974513, CoolCycle=0.0010000000474974513)
    assert _outputs(words, [50.0], [60.0])[0] == pytest.approx(begins, abs=1e-4)


def test_each_output_has_pulses_of_its_own_as_the_manuals_two_blocks_make_them():
    # two PWMs that know nothing of each other, each fed with its own output in every period; ours does one of them a period
    chance = np.random.default_rng(3)
    own = pid_compact(pwm_period_s=4.0, call_interval_s=0.1)
    for least_on, least_off, cool_on, cool_off in ((0, 0, 0, 0), (5, 3, 8, 2), (1, 10, 10, 1), (7, 7, 2, 2)):
        heat, cool = Pulses(40, least_on, least_off), Pulses(40, cool_on, cool_off)
        numbers = [(*own.numbers[:2], 0.1 * on, 0.1 * off, True) for on, off in ((least_on, least_off), (cool_on, cool_off))]
        owed, at = [0.0, 0.0], 0.0
        for _ in range(20_000):
            at = min(max(at + chance.normal(0.0, 25.0), -100.0), 100.0)
            asked = 0.0 if chance.random() < 0.1 else float(at)
            expected = [heat(max(asked, 0.0)), cool(max(-asked, 0.0))]
            side = int(asked < 0.0)
            on, owed[side] = on_time(abs(asked), owed[side], numbers[side])
            assert expected[1 - side] == 0  # never both in a period
            assert round(on / 0.1) == expected[side]
