import numpy as np
import pytest
from scipy.stats import chi2

from heatertune.log.log_values import Log
from heatertune.model.statistics import LJUNG_BOX_95, ljung_box
from heatertune.model.temperature.closed_loop import Hypothesis, LogSegment
from heatertune.model.temperature.hypothesis_fits import EARLY, constant_rmse, cross_rmse, fit_all, hold_out_rmse
from heatertune.plc.s7_200_paper.step import LAWS

NOISE = 0.1


def test_ljung_box_is_the_worked_sum():
    # 1, −1, 1, −1: autocorrelations −3/4, 2/4; 4·6·((9/16)/3 + (1/4)/2) = 7.5
    assert ljung_box(np.array([1.0, -1.0, 1.0, -1.0]), lags=2) == pytest.approx(7.5)


def test_the_threshold_is_scipys_and_white_noise_stays_below_it_in_95_of_100_logs():
    assert pytest.approx(chi2.ppf(0.95, 20), abs=0.005) == LJUNG_BOX_95
    rng = np.random.default_rng(5)
    above = [ljung_box(rng.normal(size=200)) > LJUNG_BOX_95 for _ in range(1000)]
    assert 30 <= sum(above) <= 80


def _simulated(setpoint_step=0.0):
    """A proportional loop of 8 %/°C on 0.6 °C/%, 200 s, 20 s at 22 °C, by Euler's rule in steps of 0.1 s.

    The loop is closed one sample before the first reading, as a fit takes it.
    """
    y, power, rows = 22.0, np.zeros(20000), []
    for k in range(16001):
        if k % 20 == 0:
            setpoint = 45.0 + (setpoint_step if k >= 10000 else 0.0)
            power[k : k + 20] = min(max(8.0 * (setpoint - y), 0.0), 100.0)
        if k % 100 == 0 and k > 0:
            rows.append(y)
        y += 0.1 * (22.0 + 0.6 * (power[k - 200] if k >= 200 else 0.0) - y) / 200.0
    shaken = np.array(rows) + np.random.default_rng(7).normal(0.0, NOISE, len(rows))
    return Log(name="loop", source="Euler", time_s=10.0 * np.arange(1, 161), temperature_degC=shaken)


def _hypothesis(log, law=LAWS[0]):
    return Hypothesis(segments=(LogSegment(log=log, law=law, event=False, ambient_degC=(21.0, 23.0)),), two_lags=False)


@pytest.mark.long
def test_the_true_law_foretells_and_explains_left_out_blocks_to_the_noise():
    (fit,) = fit_all([_hypothesis(_simulated())])
    assert fit.rmse_degC == pytest.approx(NOISE, rel=0.2)
    assert fit.hold_out_rmse_degC == pytest.approx(NOISE, rel=0.3)
    assert NOISE * 0.8 < fit.cross_rmse_degC < 1.4 * NOISE
    assert fit.rmse_degC < fit.cross_rmse_degC, "what was left out is not explained better than what was fitted"


def test_what_happens_after_the_beginning_is_what_a_hold_out_misses():
    quiet, stepped = _hypothesis(_simulated()), _hypothesis(_simulated(setpoint_step=5.0))
    vector = np.array([np.log(0.6), np.log(200.0), 0.0, 20.0, 22.0, 22.0, 0.0, 45.0, 0.0, np.inf, np.log(8.0)])
    good, missed = (hold_out_rmse(each, each.early(EARLY), vector) for each in (quiet, stepped))
    assert good < 1.5 * NOISE
    # from 1010 s to 1600 s, 60 of 96 readings, the loop rests 5·4.8/5.8 °C higher
    assert missed == pytest.approx(np.sqrt(60 / 96) * 5.0 * 4.8 / 5.8, rel=0.1)
    assert constant_rmse(stepped, stepped.early(EARLY)) == pytest.approx(np.std(_simulated(5.0).temperature_degC[64:]))


def test_a_block_left_out_is_not_seen_by_the_fit():
    log = _simulated()
    spoiled = log.temperature_degC.copy()
    for block in (5, 10, 15):  # a whole fold: readings 8·block…8·block + 7
        spoiled[8 * block : 8 * block + 8] += 10.0
    vector = np.array([np.log(0.6), np.log(200.0), 0.0, 20.0, 22.0, 22.0, 0.0, 45.0, 0.0, np.inf, np.log(8.0)])
    other = Log(name="spoiled", source="Euler", time_s=log.time_s, temperature_degC=spoiled)
    # the fold's own 24 of 152 readings cost 10 °C each: nothing of them may be fitted away
    assert cross_rmse(_hypothesis(other), vector) > np.sqrt(24 / 152) * 10.0
