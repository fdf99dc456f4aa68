"""An ambient interval for a log with power: the log of a heater at 22 °C, simulated in closed form."""

import numpy as np
import pytest

from heatertune.log.log_values import Log
from heatertune.model.fit import fit

TIME = np.arange(0.0, 900.0, 5.0)


@pytest.fixture(scope="module")
def log():
    power = np.where(TIME < 450.0, 50.0, 20.0)
    up = 22.0 + 30.0 * (1.0 - np.exp(-TIME / 150.0))
    down = 34.0 + (up[90] - 34.0) * np.exp(-(TIME - 450.0) / 150.0)
    shaken = np.where(TIME < 450.0, up, down) + np.random.default_rng(1).normal(0.0, 0.05, len(TIME))
    return Log(name="steps", source="closed form", time_s=TIME, temperature_degC=shaken, power_pct=power)


@pytest.mark.long
@pytest.mark.parametrize(("given", "end"), [((24.0, 30.0), 24.0), ((10.0, 20.0), 20.0)])
def test_an_ambient_that_leaves_its_interval_is_taken_at_the_nearest_end(log, given, end):
    fitted = fit(log, ambient_degC=given)
    assert fitted.model.ambient_degC == end
    assert any(f"its end of {end:g} °C was used" in note for note in fitted.notes)


@pytest.mark.long
def test_an_ambient_inside_its_interval_stays_free(log):
    fitted = fit(log, ambient_degC=(20.0, 24.0))
    assert fitted.model.ambient_degC == pytest.approx(22.0, abs=0.5)
    assert fitted.model.gain_degC_per_pct == pytest.approx(0.6, rel=0.03)
    assert not any("given interval" in note for note in fitted.notes)
