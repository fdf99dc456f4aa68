"""Klipper's own rule, as Kalico's package has it, runs beside the monitor."""

import numpy as np
import pytest
from tests.bench import supervise

from heatertune.supervision import supervise as printers


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


@pytest.mark.long(seconds=5)
def test_the_rule_that_is_designed_for_klipper_is_kalico_s_own(witness):
    folder, chance, stopped = witness("kalico"), np.random.default_rng(3), 0
    for _ in range(40):
        given = {"hysteresis": float(chance.choice([1.0, 3.0, 8.0])), "max_error": float(chance.choice([10.0, 60.0, 300.0])),
                 "heating_gain": float(chance.choice([1.0, 2.0, 8.0])), "check_gain_time": float(chance.choice([10.0, 40.0]))}
        seen = np.clip(np.cumsum(chance.normal(0.3, 1.5, 500)) + 20.0, 0.0, 230.0).round(1)
        theirs = supervise.kalico_trips(folder, "extruder", np.arange(501.0), np.append(seen[:1], seen), 120.0, 210.0, **given)
        rule = printers.VerifyHeater(**given, min_temp=0.0, max_temp=210.0)
        at, _ = printers.klipper(rule, seen[:-1], np.full(499, 120.0), 1.0, 0)
        assert (np.nan if at < 0 else at + 1.0) == pytest.approx(theirs, nan_ok=True), given
        stopped += at >= 0
    assert 10 < stopped < 40
