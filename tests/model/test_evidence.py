"""Bounds and stretches on curves whose closed form is known, and the bound the project's identification page gives."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from heatertune.log.log_values import Log
from heatertune.model.statistics import undisturbed_part
from heatertune.model.temperature import evidence
from heatertune.model.temperature.evidence import (
    evidence_notes,
    fall_bound,
    free_cooling,
    rise_bound,
    saturated_heat_up,
)

GAIN, LAG, AMBIENT = 0.6, 300.0, 22.0


def _log(time, temperature, noise=0.05, seed=4):
    shaken = temperature + np.random.default_rng(seed).normal(0.0, noise, len(time))
    return Log(name="curve", source="closed form", time_s=time, temperature_degC=shaken)


def _one_lag(time, hot_until, power_after):
    """Full power from rest until an instant, then another constant power."""
    top, rest = AMBIENT + 100.0 * GAIN, AMBIENT + power_after * GAIN
    heated = top + (AMBIENT - top) * np.exp(-time / LAG)
    there = top + (AMBIENT - top) * np.exp(-hot_until / LAG)
    later = rest + (there - rest) * np.exp(-(time - hot_until) / LAG)
    return np.where(time < hot_until, heated, later)


TIME = np.arange(0.0, 2000.0, 10.0)


def test_table_3_bounds_a_single_lag_as_the_identification_page_says(table3):
    used = undisturbed_part(table3)[0]
    assert fall_bound(used, 30.0).value > 330.0
    assert fall_bound(used, 25.5).value < 440.0


def test_noise_alone_is_no_disturbance():
    # a sensor that never answers: its spikes are taken for odd readings, and what is left must not look like jumps
    quiet = _log(TIME, np.full(len(TIME), AMBIENT), noise=0.05)
    assert undisturbed_part(quiet) == (quiet, ())


def test_a_free_cooling_bounds_the_time_constant_by_itself():
    found = fall_bound(_log(TIME, _one_lag(TIME, 400.0, 0.0), noise=0.0001), AMBIENT)
    assert found.value == pytest.approx(LAG, rel=1e-2)
    assert found.start_s >= 390.0


def test_a_colder_room_bounds_less():
    log = _log(TIME, _one_lag(TIME, 400.0, 10.0), noise=0.0001)
    assert LAG < fall_bound(log, AMBIENT).value < fall_bound(log, AMBIENT - 10.0).value


def test_a_log_that_never_falls_bounds_no_time_constant():
    assert fall_bound(_log(TIME, _one_lag(TIME, 2000.0, 0.0), noise=0.0001), AMBIENT) is None


def test_full_power_from_rest_nearly_gives_gain_per_time_constant():
    found = rise_bound(_log(TIME, _one_lag(TIME, 400.0, 0.0), noise=0.0001))
    # over the first 70 s the mean slope of an exponential is (1 − e^(−70/300))/(70/300) of its first
    assert found.value == pytest.approx(GAIN / LAG * (1.0 - np.exp(-70.0 / 300.0)) / (70.0 / 300.0), rel=1e-3)
    assert (found.start_s, found.end_s) == (0.0, 70.0)


def test_a_heat_up_at_the_limit_is_found_with_what_it_aims_at():
    found = saturated_heat_up(_log(TIME, _one_lag(TIME, 250.0, 40.0)))
    assert found.end_s <= 260.0
    assert found.end_s - found.start_s > 150.0
    assert found.aim_degC[0] <= AMBIENT + 100.0 * GAIN <= found.aim_degC[1]
    assert found.time_constant_s[0] <= LAG <= found.time_constant_s[1]


def test_a_heat_up_that_aims_at_where_it_rests_shows_no_full_power():
    # a proportional controller that never saturates: the closed loop is an exponential to its rest
    rest = 22.0 + 25.0 * (1.0 - np.exp(-TIME / 120.0))
    assert saturated_heat_up(_log(TIME, rest)) is None


def test_a_free_cooling_is_found_with_its_time_constant():
    curve = _one_lag(TIME, 400.0, 0.0)
    found = [free_cooling(_log(TIME, curve, seed=seed), (20.0, 24.0)) for seed in range(20)]
    assert min(each.start_s for each in found) >= 390.0
    held = [each.time_constant_s[0] <= LAG <= each.time_constant_s[1] < 1.1 * LAG for each in found]
    assert sum(held) >= 17, "95 % intervals"
    assert sum(each.aim_degC[0] <= AMBIENT <= each.aim_degC[1] for each in found) >= 17


def test_a_fall_to_another_level_is_no_free_cooling():
    assert free_cooling(_log(TIME, _one_lag(TIME, 400.0, 30.0)), (20.0, 24.0)) is None


def test_a_heat_up_and_a_cooling_that_disagree_tell_of_two_lags():
    time = np.arange(0.0, 700.0, 10.0)
    ramp = np.minimum(22.0 + 0.15 * time, 82.0)  # slower than a single lag of 100 s allows
    log = _log(time, np.where(time < 400.0, ramp, 22.0 + 60.0 * np.exp(-(time - 400.0) / 100.0)))
    told = " ".join(evidence_notes(log, (21.0, 23.0)))
    assert "there are two" in told
    assert "cools freely" in told


def test_what_is_not_there_is_said(table4):
    told = " ".join(evidence_notes(undisturbed_part(table4)[0], (20.0, 25.0)))
    assert "heater was never off for long" in told
    assert "at least" in told


@given(st.integers(0, 2**32 - 1))
def test_the_first_look_leaves_out_no_stretch_that_is_quiet(seed):
    # what it spares is only work: without it, each stretch gives the same
    rng = np.random.default_rng(seed)
    n = int(rng.integers(20, 120))
    time = np.cumsum(rng.uniform(0.5, 2.0, n) if rng.random() < 0.5 else np.full(n, 10.0))
    lag = time[-1] * 10.0 ** rng.uniform(-2.5, 2.0)
    clean = 300.0 + rng.uniform(-200.0, 200.0) * np.exp(-(time - time[0]) / lag)
    clean = clean + rng.choice([0.0, 0.0, 0.05, 1.0]) * np.sin(time / time[-1] * rng.uniform(1.0, 30.0))
    noise = float(rng.choice([0.0, 1e-6, 0.03, 0.5]))
    step = float(rng.choice([0.0, 0.1, 1.0]))
    y = clean + rng.normal(0.0, noise, n) if noise else clean
    y = np.round(y / step) * step if step else y
    assume(np.ptp(y) > 0.0)
    log = Log(time_s=time, temperature_degC=y, name="drawn", source="")
    first = int(rng.integers(0, n - 8))
    last = int(rng.integers(first + 7, n))
    quiet = float(rng.uniform(0.5, 3.0)) * max(noise, step / 3.0, 1e-9)
    found = evidence._exponential(log, first, last, quiet)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(evidence, "_is_loud", lambda *_: False)
        assert found == evidence._exponential(log, first, last, quiet)
