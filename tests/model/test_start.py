"""How a log begins, judged by heaters simulated with Euler's rule in steps of 0.1 s, worked out here."""

import numpy as np
import pytest

from heatertune.log.log_values import Log
from heatertune.model.fit import fit
from heatertune.model.power.explanation import explain_log

AMBIENT, GAIN, LAG, SECOND, DEAD = 32.0, 0.5, 300.0, 80.0, 10.0


def _log(power_at, *, second=SECOND, start=AMBIENT, length=900.0, noise=0.1, seed=0):
    """Two lags from `start` without power before, read every 5 s; the ambient is 32 °C."""
    time = np.arange(0.0, length, 5.0)
    power = power_at(time)
    x = y = start
    readings = []
    for k in range(int(10 * time[-1]) + 1):
        if k % 50 == 0:
            readings.append(y)
        acting = power[int(0.1 * k - DEAD) // 5] if 0.1 * k >= DEAD else 0.0
        x += 0.1 * (AMBIENT + GAIN * acting - x) / LAG
        y = y + 0.1 * (x - y) / second if second else x
    noisy = np.array(readings) + np.random.default_rng(seed).normal(0.0, noise, len(time))
    return Log(name="made", source="Euler", time_s=time, temperature_degC=noisy, power_pct=power)


def _steps(time):
    return np.select([time < 60.0, time < 600.0], [0.0, 60.0], 40.0)


def _explained(log):
    return explain_log(log, ambient_degC=None, power_before_pct=None)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(3))
def test_a_test_that_begins_at_rest_keeps_its_ambient_though_a_second_lag_bends_the_one(seed):
    # with a free initial state one lag has 33.8 °C, and an interval from −7 to 41 °C
    found = fit(_log(_steps, seed=seed))
    assert found.model.ambient_degC == pytest.approx(AMBIENT, abs=0.4)
    two = next(c.model for c in found.candidates if len(c.model.lags_s) == 2)
    assert two.gain_degC_per_pct == pytest.approx(GAIN, rel=0.03)
    assert two.ambient_degC == pytest.approx(AMBIENT, abs=0.2)
    assert "begun at rest" in found.method


@pytest.mark.long
def test_the_heater_switched_on_with_the_log_is_seen_to_have_rested_without_power():
    found = _explained(_log(lambda time: np.where(time < 500.0, 60.0, 20.0)))
    assert (found.problems[0].power_before_pct, found.problems[0].at_rest) == (0.0, True)
    assert found.model.gain_degC_per_pct == pytest.approx(GAIN, rel=0.05)
    (told,) = (note for note in fit(found.log).notes if "already on" in note)
    assert "taken as 0 %, and the heater at rest, before" in told


def test_a_heater_that_still_cools_as_the_log_begins_is_not_at_rest():
    log = _log(_steps, second=0.0, start=45.0)
    found = _explained(log)
    assert not found.problems[0].at_rest
    assert found.model.gain_degC_per_pct == pytest.approx(GAIN, rel=0.03)
    assert found.model.ambient_degC == pytest.approx(AMBIENT, abs=0.5)


@pytest.mark.long
def test_a_rest_that_few_readings_show_leaves_both_starts_as_candidates():
    # 12 readings before the step bound the slope to 0.005 °C/s, times 380 s: 8 % of the span
    found = fit(_log(_steps))
    assert any(c.law == "power logged, not from rest" for c in found.candidates)
    assert any("log more readings before the first step" in note for note in found.notes)
    long = fit(_log(lambda time: _steps(time - 400.0), length=1300.0))
    assert not any("from rest" in c.law for c in long.candidates)
