"""Residuals that follow the power: the right model is believed, the wrong order is told."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from tests.model.twins import DEAD, GAIN, LAG, coloured, doublet, logged

from heatertune.model.fit import fit
from heatertune.model.power.feedback import _filtered, input_correlation
from heatertune.model.power.fit_checks import correlation_of
from heatertune.model.power.open_loop import PowerProblem
from heatertune.model.power.regressors import Readings

TRUE = np.array([[np.log(LAG), DEAD, 0.0]])


def _prbs():
    time = 4.0 * np.arange(375)
    return time, np.repeat(np.random.default_rng(9).choice([20.0, 60.0], 38), 10)[:375]


def _found(log, start=TRUE):
    problem = PowerProblem(readings=Readings.of(log))
    return correlation_of(problem, problem.refine(start))


@pytest.mark.long
@pytest.mark.parametrize("signal", [doublet, _prbs], ids=["doublet", "prbs"])
@pytest.mark.parametrize("colour", ["white", "coloured"])
def test_the_right_model_stays_inside_the_limit_in_about_95_of_100_logs(signal, colour):
    time, power = signal()
    beyond = 0
    for seed in range(40):
        noise = (coloured(seed, 375, 0.2) if colour == "coloured"
                 else np.random.default_rng(seed).normal(0.0, 0.2, 375))
        beyond += not _found(logged(time, power, noise=noise)).ok
    assert beyond <= 7  # 40 logs at 5 %: more come by chance once in 1,400 times


@pytest.mark.parametrize("second", [25.0, 60.0])
def test_a_second_lag_that_the_model_does_not_have_is_seen_after_about_its_own_time(second):
    time, power = _prbs()
    for seed in range(5):
        found = _found(logged(time, power, second=second, noise=np.random.default_rng(seed).normal(0.0, 0.2, 375)),
                       np.array([[np.log(LAG + second / 2), DEAD + second / 2, 0.0]]))
        assert not found.ok
        assert DEAD <= found.at_lag_s <= DEAD + 2.0 * second


@pytest.mark.parametrize("lag", [1, 5])
def test_the_correlation_is_that_of_a_program_that_does_nothing_clever(lag):
    # white residuals and random power, one of them held back by some samples: no whitening, no projection
    rng = np.random.default_rng(4)
    power, residuals = rng.choice([0.0, 100.0], 400), rng.normal(0.0, 1.0, 400)
    residuals[lag:] += 0.01 * power[:-lag]
    time = np.arange(400.0)
    readings = Readings(
        time_s=time, half_s=np.zeros(400), temperature_degC=residuals, edge_s=time, level_pct=power)
    found = input_correlation(readings, residuals, np.ones((400, 1)), before_pct=power[0], horizon_s=30.0, seed=1)
    assert found.at_lag_s == lag
    assert found.largest == pytest.approx(np.corrcoef(residuals[lag:], power[:-lag])[0, 1], abs=0.01)
    # of 30 independent lags the largest stays below 3.1 deviations of 1/√n in 95 of 100 (normal distribution)
    assert found.limit == pytest.approx(3.1 / np.sqrt(400), rel=0.1)
    assert not found.ok


@pytest.mark.parametrize("whitening", [[1.0], [1.0, -0.7], [1.0, -0.5, 0.2, -0.1]])
def test_rows_are_filtered_as_scipy_filters_them(whitening):
    rows = np.random.default_rng(1).normal(size=(3, 40))
    theirs = lfilter(whitening, [1.0], rows)[:, len(whitening) - 1 :]
    assert _filtered(np.array(whitening), rows) == pytest.approx(theirs - theirs.mean(axis=1)[:, None], abs=1e-12)


def test_averaged_readings_are_compared_with_the_average_power():
    rng = np.random.default_rng(4)
    power = rng.choice([0.0, 100.0], 800)
    residuals = rng.normal(0.0, 0.2, 800)
    residuals[8:] += 0.01 * power[:-8]
    time = np.arange(800.0)
    fine = Readings(time_s=time, half_s=np.zeros(800), temperature_degC=residuals, edge_s=time, level_pct=power)
    pairs = replace(fine, time_s=time[::2] + 1.0, half_s=np.full(400, 1.0),
                    temperature_degC=residuals.reshape(-1, 2).mean(axis=1))
    found = input_correlation(pairs, pairs.temperature_degC, np.ones((400, 1)), before_pct=power[0], horizon_s=60.0,
                              seed=1)
    assert found.at_lag_s == 8.0
    # power at an instant explains one of the two readings in a mean: its correlation is lower by the root of two
    means = [each.reshape(-1, 2).mean(axis=1) for each in (residuals[8:], power[:-8])]
    assert found.largest > 0.9 * np.corrcoef(*means)[0, 1]


def test_power_that_never_moves_correlates_with_nothing():
    time = np.arange(100.0)
    still = Readings(time_s=time, half_s=np.zeros(100), temperature_degC=time, edge_s=time[:1],
                     level_pct=np.array([50.0]))
    noise = np.random.default_rng(1).normal(size=100)
    assert input_correlation(still, noise, np.ones((100, 1)), before_pct=50.0, horizon_s=20.0, seed=1) is None


@pytest.mark.long
def test_a_fit_tells_the_missing_lag_in_words_and_what_two_lags_leave():
    time, power = doublet()
    noise = np.random.default_rng(2).normal(0.0, 0.1, len(time))
    fitted = fit(logged(time, power, second=40.0, noise=noise))
    told = next(note for note in fitted.notes if "still follows the power" in note)
    assert "a second lag or a longer dead time is missing" in told
    assert "two lags leave nothing of that" in told
    assert not fitted.validation.input_correlation.ok
    right = fit(logged(time, power, noise=noise))
    assert right.validation.input_correlation.ok
    assert not any("follows the power" in note for note in right.notes)
    assert right.model.gain_degC_per_pct == pytest.approx(GAIN, rel=0.01)
