"""PID_Compact and PID_Temp against the witness, which another hand wrote from the manual, and the manual's own sentences."""

import math
from fractions import Fraction

import numpy as np
import pytest
from tests.witness.pid_compact import Continuous, Sampled

from heatertune.plc import Scaling, Words, controller_for
from heatertune.plc.pid_compact.step import COLD, PidCompactAssumptions, block_of, step
from heatertune.plc.pwm import on_time, pid_compact
from heatertune.plc.replay import replay
from heatertune.plc.single_precision import single

#: heatertune's setting → the witness's
INTEGRALS = {"backward": 0, "forward": 1, "trapezoid": 2}
LAGS = {"backward": (0, "backward"), "tustin": (1, "bilinear"), "ramp": (2, "ramp"), "step": (3, "step")}
PLAIN = {"Gain": 1.0, "Ti": 0.0, "Td": 0.0, "TdFiltRatio": 0.2, "PWeighting": 1.0, "DWeighting": 0.0, "Cycle": 1.0,
         "OutputUpperLimit": 100.0, "OutputLowerLimit": 0.0, "InvertControl": 0, "IntegralResetMode": 1}
_ROUNDING = 2.0**-24


def _words(**changed):
    values = {name: single(value) if isinstance(value, float) else value for name, value in (PLAIN | changed).items()}
    return Words(target="pid-compact", values=values, scaling=Scaling(), sample_time_s=float(f"{values['Cycle']:.7g}"))


def _outputs(words, setpoints, readings, **switches):
    rows = [{"Setpoint": w, "Input": x} for w, x in zip(setpoints, readings, strict=True)]
    return [scan.output for scan in replay(controller_for("pid-compact"), words, rows, switches)]


def _drawn(chance, *, derivative=True):
    """Random words with a lag that no sampling raises, and how the witness takes them."""
    def spread(low, high):
        return single(low * (high / low) ** chance.random())

    ta, td = spread(0.1, 60.0), spread(1.0, 300.0) if derivative and chance.random() < 0.7 else 0.0
    ratio = spread(max(0.05, 0.6 * ta / td), max(5.0, 2.0 * ta / td)) if td else 0.2
    return _words(Gain=spread(0.1, 30.0), Ti=spread(3.0 * ta, 400.0 * ta) if chance.random() < 0.8 else 0.0, Td=td,
                  TdFiltRatio=float(ratio), PWeighting=float(chance.integers(0, 5)) / 4.0,
                  DWeighting=float(chance.integers(0, 5)) / 4.0, Cycle=ta)


def _witness(words, **kinds):
    v = words.values
    return Sampled(v["Gain"], v["Ti"], v["Td"], v["TdFiltRatio"], v["PWeighting"], v["DWeighting"], TA=v["Cycle"], **kinds)


def _apart(words, assume, witness, chance, scans):
    """Run both from rest on a wandering reading; return the greatest difference as a multiple of the rounding bound."""
    block = block_of(words.values, assume)
    state, setpoint, reading, worst = COLD, single(chance.uniform(20, 200)), None, 0.0
    reading, size = setpoint, 0.0
    for scan in range(scans):
        if scan and chance.random() < 0.05:
            setpoint = single(chance.uniform(20, 200))
        if scan:
            reading = single(reading + chance.normal(0.0, 2.0))
        state, _, output, _ = step((block, assume), state, setpoint, reading, True)
        expected = float(witness(setpoint, reading))
        # each sum rounds by at most half a digit of the largest number in it, and I keeps what it was off by
        largest = abs(block.gain) * max(setpoint, reading) + abs(state.integral) + abs(block.kick) * 200.0 + 100.0
        size += 8.0 * _ROUNDING * largest
        worst = max(worst, abs(output - expected) / (16.0 * _ROUNDING * largest / (1.0 - block.past) + size))
    return worst


def _held_against(number, runs, scans):
    """Return the worst difference over random words and settings, and how many scans it took."""
    chance, worst = np.random.default_rng(number), 0.0
    for run in range(runs):
        integral = list(INTEGRALS)[run % 3]
        lag, other = LAGS[list(LAGS)[run % 4]]
        wide = run % 2 == 0
        words = _drawn(chance)
        limits = {"low": -1e9, "high": 1e9} if wide else {}
        if wide:  # beyond the words: the law without its limits
            assume = PidCompactAssumptions(integral=INTEGRALS[integral], lag=lag)
            words = Words(target="pid-compact", values=words.values | {"OutputUpperLimit": 1e9, "OutputLowerLimit": -1e9},
                          scaling=words.scaling, sample_time_s=words.sample_time_s)
            witness = _witness(words, integral=integral, derivative=other, anti_windup="none", **limits)
        else:  # what is clamped is the witness's back-calculation, where there is no D
            clamped = run % 4 == 3
            words = _drawn(chance, derivative=not clamped)
            assume = PidCompactAssumptions(integral=INTEGRALS[integral], lag=lag, anti_windup=3 if clamped else 0)
            witness = _witness(words, integral=integral, derivative=other, anti_windup="back" if clamped else "hold")
        worst = max(worst, _apart(words, assume, witness, chance, scans))
    return worst


def test_random_words_under_every_sampling_are_the_witness_within_the_rounding_of_reals():
    assert _held_against(1, runs=48, scans=60) < 1.0


@pytest.mark.long(seconds=20)
def test_a_hundred_thousand_scans_are_the_witness_within_the_rounding_of_reals():
    # runs=10_000 is a million: three minutes, the worst the same part of the bound
    assert _held_against(2, runs=1_000, scans=100) < 1.0


@pytest.mark.parametrize("integral", INTEGRALS)
@pytest.mark.parametrize("lag", LAGS)
def test_every_sampling_tends_to_the_continuous_equation(integral, lag):
    def away(cycle):
        law = Continuous(3.0, 40.0, 10.0, 0.2, 0.6, 0.3)
        times = cycle * np.arange(round(60.0 / cycle))
        setpoints, readings = 5.0 * np.sin(0.1 * times), 2.0 * np.sin(0.23 * times)
        words = _words(Gain=3.0, Ti=40.0, Td=10.0, PWeighting=0.6, DWeighting=0.3, Cycle=cycle, OutputLowerLimit=-100.0)
        made = _outputs(words, [single(w) for w in setpoints], [single(x) for x in readings], integral=integral, derivative_lag=lag)
        exact = [0.0, *(law(w, x, cycle) for w, x in zip(setpoints[1:], readings[1:], strict=True))]
        return max(abs(one - other) for one, other in zip(made, exact, strict=True))

    coarse, fine = away(0.5), away(0.125)
    assert fine < max(0.3 * coarse, 3e-3)  # first order: a quarter


def test_without_rounding_a_pi_law_is_the_equation_in_fractions():
    # Kp 3/2, T/TI 1/8: all numbers are short, so singles hold them
    integral, expected = Fraction(0), []
    errors = [8, 16, 4, -8, 2, 0]
    for error in errors:
        integral += Fraction(3, 2) * Fraction(1, 8) * error
        expected.append(float(Fraction(3, 2) * error + integral))
    words = _words(Gain=1.5, Ti=16.0, Cycle=2.0, OutputLowerLimit=-100.0)
    assert _outputs(words, [100.0 + error for error in errors], [100.0] * 6) == expected


@pytest.mark.parametrize(("mode", "weight", "begins"), [
    (0, 1.0, 0.0), (1, 1.0, 20.0), (2, 1.0, 20.0), (3, 1.0, 0.0), (4, 1.0, 20.0),
    (1, 0.5, 0.0),  # the manual's warning: near the setpoint P begins the wrong way, 30 − 50 = −20, which the limit holds
    (4, 0.5, 5.0)])  # "like a setpoint change": Kp·b·(w − x) = 5 whatever the weight
def test_integral_reset_mode_begins_as_the_manual_says(mode, weight, begins):
    # w 60, x 50, Kp 1 (Kp 2 with weight 1), TI so long that a cycle adds nothing
    words = _words(Gain=2.0 if weight == 1.0 else 1.0, Ti=100000.0, Cycle=0.0010000000474974513, PWeighting=weight, IntegralResetMode=mode)
    assert _outputs(words, [60.0], [50.0])[0] == pytest.approx(begins, abs=1e-5)


def test_td_filt_ratio_zero_acts_for_one_cycle_under_every_sampling():
    for lag in LAGS:
        made = _outputs(_words(Td=4.0, TdFiltRatio=0.0), [60.0] * 4, [50.0, 49.0, 49.0, 49.0], derivative_lag=lag)
        assert made == [10.0, 15.0, 11.0, 11.0], lag


def test_a_gain_inverted_is_the_mirror_of_a_heater():
    chance = np.random.default_rng(5)
    readings = [single(x) for x in 60.0 + chance.normal(0, 4, 200).cumsum()]
    mirrored = [120.0 - x for x in readings]
    exact = [single(x) == x for x in mirrored]
    readings = [x if same else 60.0 for x, same in zip(readings, exact, strict=True)]
    heating = _outputs(_words(Gain=3.0, Ti=40.0, Td=5.0), [60.0] * 200, readings)
    cooling = _outputs(_words(Gain=3.0, Ti=40.0, Td=5.0, InvertControl=1, DWeighting=0.0), [60.0] * 200, [120.0 - x for x in readings])
    assert cooling == heating


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_what_is_no_number_asks_for_nothing_and_leaves_the_memory(bad):
    words = _words(Gain=2.0, Ti=10.0)
    good = _outputs(words, [60.0, 60.0], [50.0, 50.0])
    assert _outputs(words, [60.0, 60.0, 60.0], [50.0, bad, 50.0]) == [good[0], 0.0, good[1]]
    assert _outputs(words, [60.0, bad, 60.0], [50.0, 50.0, 50.0]) == [good[0], 0.0, good[1]]


def test_a_reset_begins_anew_and_is_inactive_meanwhile():
    words = _words(Gain=2.0, Ti=10.0)
    rows = [{"Setpoint": 60.0, "Input": 50.0, "Reset": reset} for reset in (0, 0, 1, 0)]
    first, second, off, again = (scan.output for scan in replay(controller_for("pid-compact"), words, rows, {}))
    assert (off, again) == (0.0, first)
    assert second > first


def test_the_manuals_example_of_the_pwm():
    # 15 % of 1000 ms with at least 200 ms in calls of 100 ms: no pulse in the first cycle, both in the second
    numbers = pid_compact(pwm_period_s=1.0, call_interval_s=0.1, minimum_on_s=0.2).numbers
    first, owed = on_time(15.0, 0.0, numbers)
    assert (first, on_time(15.0, owed, numbers)[0]) == (0.0, pytest.approx(0.3))
