"""Two lags of one length, by the exact step answer 1 − (1 + t/T)·e^(−t/T)."""

import numpy as np
import pytest

from heatertune.log.log_values import Log
from heatertune.model.fit import fit, fit_together
from heatertune.model.model_values import TwoLag

LAG, DEAD, GAIN = 70.0, 8.0, 0.5


def _log(seed, name="equal"):
    time = np.arange(0.0, 1500.0, 4.0)
    power = np.select([time < 60, time < 500, time < 900, time < 1200], [0.0, 60.0, 10.0, 80.0], 30.0)
    rise = np.zeros(len(time))
    for i in np.flatnonzero(np.diff(power)) + 1:
        since = np.clip(time - time[i] - DEAD, 0.0, None) / LAG
        rise += GAIN * (power[i] - power[i - 1]) * (1.0 - (1.0 + since) * np.exp(-since))
    noise = np.random.default_rng(seed).normal(0.0, 0.1, len(time))
    return Log(name=name, source="", time_s=time, power_pct=power, temperature_degC=20.0 + rise + noise)


def _two_lags(fitted):
    return next(c for c in fitted.candidates if isinstance(c.model, TwoLag))


@pytest.mark.long
@pytest.mark.parametrize("seed", [2, 8])  # by their noise the best ratio is 1, the search's end
def test_two_equal_lags_are_a_heater(seed):
    fitted = fit(_log(seed))
    two = _two_lags(fitted)
    assert two.delta_bic == 0.0
    assert fitted.candidates[0].delta_bic > 181.0  # one lag alone was kept, though so much worse
    assert two.model.lags_s == pytest.approx((LAG, LAG), rel=0.03)
    assert two.model.dead_time_s == pytest.approx(DEAD, abs=0.5)


@pytest.mark.long
def test_two_equal_lags_of_several_logs_are_a_heater():
    lags = _two_lags(fit_together([_log(8, "first"), _log(9, "second")])).model.lags_s
    assert lags[1] / lags[0] > 0.97
    assert np.sqrt(lags[0] * lags[1]) == pytest.approx(LAG, rel=0.01)

