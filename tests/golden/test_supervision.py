"""Klipper's own rule, as Kalico's package has it, runs beside the monitor."""

import numpy as np
import pytest
from tests.bench import supervise


@pytest.mark.long(seconds=5)
def test_kalico_s_own_rule_trips_on_a_slow_heater_in_order_and_not_on_a_hot_end(witness):
    folder = witness("kalico")
    times = np.arange(0.0, 400.0, 0.5)
    slow = 22.0 + 31.3 * (1.0 - np.exp(-np.maximum(times - 12.0, 0.0) / 167.0))  # less than 2 °C in its first 20 s
    assert supervise.kalico_trips(folder, "extruder", times, slow, 53.3, 100.0) < 60.0
    hot = np.minimum(22.0 + 400.0 * (1.0 - np.exp(-np.maximum(times - 2.0, 0.0) / 120.0)), 200.0)
    assert np.isnan(supervise.kalico_trips(folder, "extruder", times, hot, 200.0, 285.0))
    frozen = np.where(times > 300.0, 200.0, hot)
    assert np.isnan(supervise.kalico_trips(folder, "extruder", times, frozen, 200.0, 285.0))
