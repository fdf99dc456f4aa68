"""Heaters nearly as fast as their log, made by superposing exponentials: pulses are readings, not spikes."""

import numpy as np
import pytest
from tests.bench.identification import answer

from heatertune.log.log_values import Log
from heatertune.model.model_values import Fopdt
from heatertune.model.power.explanation import explain_log

FAST = Fopdt(gain_degC_per_pct=1.0, time_constant_s=2.0, dead_time_s=0.5, ambient_degC=20.0)
TIME = np.arange(0.0, 151.0)


def _log(power):
    noise = np.random.default_rng(0).normal(0.0, 0.1, len(TIME))
    temperature = answer(FAST, TIME, power, 20.0 + power[0]) + noise
    return Log(name="fast", source="", time_s=TIME, temperature_degC=temperature, power_pct=power)


def _explained(log):
    return explain_log(log, ambient_degC=None, power_before_pct=None)


@pytest.mark.parametrize("hold", [2, 3, 4, 6])
def test_the_pulses_of_a_fast_heater_are_fitted_as_they_were_read(hold):
    log = _log(np.where((TIME // hold) % 3 == 1, 80.0, 10.0))
    found = _explained(log)
    assert len(found.outliers) == 0
    assert np.array_equal(found.problems[0].readings.temperature_degC, log.temperature_degC)
    assert found.model.gain_degC_per_pct == pytest.approx(1.0, rel=0.01)
    assert found.model.time_constant_s == pytest.approx(2.0, rel=0.02)


def test_a_single_pulse_is_no_outlier():
    found = _explained(_log(np.where((TIME >= 60.0) & (TIME < 64.0), 80.0, 0.0)))
    assert len(found.outliers) == 0
    assert found.model.gain_degC_per_pct == pytest.approx(1.0, rel=0.02)


def test_what_is_fitted_is_the_record_with_nothing_but_the_outliers_told_replaced():
    log = _log(np.where((TIME // 6) % 3 == 1, 80.0, 10.0))
    y = log.temperature_degC.copy()
    y[[20, 77, 120]] += [400.0, -60.0, 300.0]
    found = _explained(Log(name="spiky", source="", time_s=TIME, temperature_degC=y, power_pct=log.power_pct))
    fitted = found.problems[0].readings.temperature_degC
    assert np.flatnonzero(fitted != y).tolist() == found.outliers.tolist() == [20, 77, 120]
    assert found.model.gain_degC_per_pct == pytest.approx(1.0, rel=0.01)
