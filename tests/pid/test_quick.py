"""The quick design against loops made of scipy's own sampled plants: nothing of heatertune's margins is in them."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.signal import cont2discrete

from heatertune.errors import InputError, OutOfRange, UnknownName
from heatertune.model.model_values import Fopdt, TwoLag
from heatertune.pid.design_values import Timer
from heatertune.pid.tune import quick_tune

TA = 5.0
ONE = Fopdt(gain_degC_per_pct=0.5, time_constant_s=200.0, dead_time_s=20.0)
TWO = TwoLag(gain_degC_per_pct=0.9, time_constant_s=150.0, second_time_constant_s=40.0, dead_time_s=10.0)


def sensitivity(plant, gain, tn, tv, past):
    """max |1/(1 + L)| of the sampled loop; the dead time is whole samples, so scipy's hold needs only z^−d."""
    lags = [*plant.lags_s]
    (num,), den, _ = cont2discrete(([plant.gain_degC_per_pct], np.poly([-1.0 / lag for lag in lags]) * math.prod(lags)), TA)
    z = np.exp(1j * np.geomspace(1e-5, math.pi, 20_000))
    g = np.polyval(num, z) / np.polyval(den, z) * z ** -round(plant.dead_time_s / TA)
    integral = 0.0 if math.isinf(tn) else TA / tn / (1.0 - 1.0 / z)
    derivative = (1.0 - past) * tv / TA * (1.0 - 1.0 / z) / (1.0 - past / z)
    return float(np.max(1.0 / np.abs(1.0 + gain * g * (1.0 + integral + derivative))))


@pytest.mark.parametrize("structure", ["p", "pi", "pid"])
@pytest.mark.parametrize("ms", [1.3, 1.6, 2.0])
@pytest.mark.parametrize("past", [0.0, 0.5])
def test_the_worst_heater_stands_at_the_limit(structure, ms, past):
    found = quick_tune([ONE, TWO], structure=structure, ms=ms, sample_time_s=TA, derivative_filter=past)
    settings = (found.gain_pct_per_degC, found.integral_time_s, found.derivative_time_s, past)
    assert max(sensitivity(plant, *settings) for plant in (ONE, TWO)) == pytest.approx(ms, rel=5e-3)
    assert found.structure == structure


@pytest.mark.long
def test_no_other_integral_time_gives_a_larger_integral_gain():
    def largest(tn):
        return brentq(lambda gain: sensitivity(ONE, gain, tn, 0.0, 0.0) - 1.6, 0.01, 12.0)

    best = max(largest(tn) / tn for tn in np.geomspace(20.0, 600.0, 60))
    found = quick_tune([ONE], structure="pi", ms=1.6, sample_time_s=TA)
    assert found.gain_pct_per_degC / found.integral_time_s == pytest.approx(best, rel=0.01)


def test_the_derivative_time_is_a_quarter_of_the_integral_time():
    found = quick_tune([ONE], structure="pid", sample_time_s=TA)
    assert found.derivative_time_s == found.integral_time_s / 4.0  # Ziegler and Nichols 1942: Td = Ti/4


def test_the_interval_is_one_that_the_timer_can_do_and_a_tenth_of_the_loop():
    found = quick_tune([ONE], timer=Timer(shortest_s=0.1, longest_s=600.0, step_s=0.1))
    assert found.sample_time_s * 10.0 == pytest.approx(round(found.sample_time_s * 10.0))
    gain, tn, ta = found.gain_pct_per_degC, found.integral_time_s, found.sample_time_s
    # the closed loop by hand: Euler in hundredths of a second on the continuous heater, power held for TA
    dt, temperature, summed, power, line = 0.01, 0.0, 0.0, 0.0, [0.0] * round(ONE.dead_time_s / 0.01)
    for k in range(100_000):
        if k % round(ta / dt) == 0:
            summed += ta / tn * (1.0 - temperature)
            power = gain * (1.0 - temperature + summed)
        line.append(power)
        temperature += dt / ONE.time_constant_s * (ONE.gain_degC_per_pct * line[k] - temperature)
        if temperature >= 1.0 - math.exp(-1.0):
            break
    assert ta == pytest.approx(k * dt / 10.0, rel=0.1)


@pytest.mark.parametrize(("settings", "kind"), [
    ({"structure": "pd"}, UnknownName), ({"ms": 1.0}, OutOfRange), ({"ms": math.nan}, OutOfRange),
    ({"sample_time_s": 0.0}, OutOfRange),
])
def test_what_has_no_meaning_is_refused(settings, kind):
    with pytest.raises(kind):
        quick_tune([ONE], **settings)


def test_no_heater_no_design():
    with pytest.raises(InputError, match="at least one heater"):
        quick_tune([])
