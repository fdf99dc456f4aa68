"""A log without power that begins hot: the decay of its start passes for what the power does; the loop is this file's."""

import numpy as np
import pytest

from heatertune.log.log_values import Log
from heatertune.model.fit import fit, fit_together
from heatertune.model.temperature.closed_loop import Hypothesis, LogSegment
from heatertune.plc.s7_200_paper.step import LAWS

ROOM = 20.0


def _loop(start, setpoint, *, name="made", rows=400, every_s=5.0, second_lag_s=0.0, seed=1):
    """PI control (6 %/°C, 250 s, conditional integration) of 0.6 °C/%, 300 s, 20 s, in Euler steps of 0.1 s."""
    rng, step = np.random.default_rng(seed), 0.1
    late, temperature, sensor, integral = [0.0] * 200, start, start, 0.0
    readings = np.empty(rows)
    for row in range(rows):
        readings[row] = round(sensor + rng.normal(0.0, 0.05), 1)
        error = setpoint - readings[row]
        if 0.0 <= 6.0 * error + integral <= 100.0:
            integral += 6.0 * every_s / 250.0 * error
        power = min(max(6.0 * error + integral, 0.0), 100.0)
        for _ in range(round(every_s / step)):
            late.append(power)
            temperature += step * (ROOM + 0.6 * late.pop(0) - temperature) / 300.0
            sensor = sensor + step * (temperature - sensor) / second_lag_s if second_lag_s else temperature
    return Log(name=name, source="", time_s=every_s * np.arange(rows), temperature_degC=readings)


def _unexplained(fitted):
    return [finding.message for finding in fitted.findings if finding.name == "unexplained-by-power"]


@pytest.mark.long
@pytest.mark.parametrize(("start", "setpoint", "rows"), [(80.0, 40.0, 400), (80.0, 40.0, 180), (60.0, 25.0, 300)])
def test_a_log_that_begins_hot_and_cools_with_hardly_any_power_is_not_explained_by_it(start, setpoint, rows):
    fitted = fit(_loop(start, setpoint, rows=rows), laws=LAWS, ambient_degC=ROOM)
    assert fitted.fit_pct > 95.0, "so that a poor fit is not what blocks"
    assert not 0.6 / 1.3 < fitted.model.gain_degC_per_pct < 0.6 * 1.3, "the error that the finding is for"
    assert len(_unexplained(fitted)) == 1


@pytest.mark.long
@pytest.mark.parametrize("second_lag_s", [0.0, 40.0])
@pytest.mark.parametrize("start", [20.0, 30.0])
def test_a_heat_up_from_the_room_or_from_a_little_above_it_is_explained_by_its_power(start, second_lag_s):
    log = _loop(start, 50.0, second_lag_s=second_lag_s)
    assert _unexplained(fit(log, laws=LAWS)) == []


@pytest.mark.long
def test_of_several_logs_without_power_the_hot_one_is_named():
    told = _unexplained(fit_together([_loop(20.0, 50.0, name="cold"), _loop(80.0, 40.0, name="hot")], laws=LAWS, ambient_degC=ROOM))
    assert len(told) == 1
    assert told[0].startswith("hot:")


@pytest.mark.parametrize("two_lags", [False, True])
def test_the_response_without_power_is_that_of_small_steps(two_lags):
    log = _loop(80.0, 40.0, rows=60)
    hypothesis = Hypothesis(segments=(LogSegment(log=log, law=LAWS[0], event=False, ambient_degC=(15.0, 25.0)),),
                            two_lags=two_lags)
    vector = hypothesis.low + 0.5 * (hypothesis.high - hypothesis.low)
    places = {name: place for place, name in enumerate(hypothesis.names)}
    first, ratio = float(np.exp(vector[places["time_constant_s"]])), float(vector[places["lag_ratio"]])
    room = vector[places["ambient_degC"]]
    y = vector[places["start_degC"]]
    x = vector[places["inner_start_degC"]] if two_lags else room
    expected, step = [], 0.01
    for scan in range(round((log.time_s[-1] + 5.0) / step) + 1):
        if scan >= round(5.0 / step) and scan % round(5.0 / step) == 0:
            expected.append(y)
        y += step * (x - y) / (ratio * first if two_lags else first)
        x += step * (room - x) / first
    assert hypothesis.free_response(vector) == pytest.approx(np.array(expected), abs=0.02)
