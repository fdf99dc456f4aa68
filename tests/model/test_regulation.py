"""Logs without power that no tried control law can have made, by heaters that are simulated here in small steps."""

from dataclasses import replace

import numpy as np
import pytest
from tests.bench import blind

from heatertune.log.log_values import Log
from heatertune.model.temperature.evidence import is_open_loop, steady_swing


def _log(readings, interval=2.0):
    time = interval * np.arange(len(readings))
    return Log(name="blind", source="", time_s=time, temperature_degC=np.asarray(readings, dtype=float))


def _simulated(power_of, n, *, gain=3.0, lags=(300.0, 60.0), delay=10, interval=2.0, noise=0.05, ambient=20.0, seed=3):
    """Return the readings of two lags in Euler steps of a tenth of the interval; power_of(number, reading) → %."""
    rng, sub = np.random.default_rng(seed), 10
    x = y = ambient
    late, readings = [0.0] * (delay * sub), []
    for i in range(n):
        readings.append(round((y + rng.normal(0.0, noise)) / 0.1) * 0.1)
        power = power_of(i, readings[-1])
        for _ in range(sub):
            late.append(power)
            x += interval / sub * (ambient + gain * late.pop(0) - x) / lags[0]
            y += interval / sub * (x - y) / lags[1]
    return readings


def _thermostat(target, half):
    state = [100.0]

    def power_of(_, reading):
        state[0] = 0.0 if reading > target + half else 100.0 if reading < target - half else state[0]
        return state[0]
    return power_of


def _pi(target, gain, integral_s, interval=2.0):
    part = [0.0]

    def power_of(_, reading):
        wanted = gain * (target - reading) + part[0]
        power = min(100.0, max(0.0, wanted))
        if power == wanted:
            part[0] += gain * interval / integral_s * (target - reading)
        return power
    return power_of


@pytest.mark.parametrize("off", [150, 220, 300])
@pytest.mark.parametrize("more", [0, 30, 400], ids=["ends at once", "ends soon", "cools down"])
def test_a_heat_up_at_constant_power_is_open_loop(off, more):
    log = _log(_simulated(lambda i, _: 100.0 if i < off else 0.0, off + more))
    assert is_open_loop(log, rmse_degC=0.05 * float(np.ptp(log.temperature_degC)))
    assert steady_swing(log) is None


def test_one_constant_power_until_it_rests_shows_no_controller():
    log = _log(_simulated(lambda *_: 40.0, 1000))
    assert is_open_loop(log, rmse_degC=0.06)


@pytest.mark.parametrize("levels", [(30.0, 60.0, 90.0), (100.0, 70.0, 0.0), (0.0, 50.0, 100.0)])
def test_stairs_of_power_that_end_off_are_open_loop(levels):
    program = [*np.repeat(levels, 150), *[0.0] * 120]
    assert is_open_loop(_log(_simulated(lambda i, _: program[i], len(program))), rmse_degC=1e-3)


@pytest.mark.parametrize("gain", [0.8, 1.5])
def test_a_pi_loop_is_no_open_loop_and_no_steady_swing(gain):
    log = _log(_simulated(_pi(120.0, gain, 200.0), 900))
    assert not is_open_loop(log, rmse_degC=0.08)  # what the right law leaves over: noise and resolution
    assert steady_swing(log) is None


def test_a_swing_that_dies_away_is_no_two_level_control():
    log = _log(_simulated(_pi(120.0, 1.5, 90.0), 900))
    turns = np.diff(np.sign(np.diff(np.asarray(log.temperature_degC)[::20])))
    assert np.count_nonzero(turns) >= 4, "it swings several times"
    assert steady_swing(log) is None


@pytest.mark.parametrize("half", [0.5, 3.0, 8.0])
@pytest.mark.parametrize("lags", [(300.0, 1.0), (300.0, 60.0)], ids=["one lag", "two lags"])
def test_a_thermostat_swings_steadily_and_its_period_and_ends_are_told(half, lags):
    readings = _simulated(_thermostat(130.0, half), 1500, lags=lags)
    swing = steady_swing(_log(readings))
    assert swing is not None
    late = np.array(readings[len(readings) // 2:])
    assert swing.highest_degC == pytest.approx(late.max(), abs=0.2 * np.ptp(late))
    assert swing.lowest_degC == pytest.approx(late.min(), abs=0.2 * np.ptp(late))
    up = np.flatnonzero(np.diff(np.signbit(late - late.mean()).astype(int)) == -1)
    periods = np.diff(up[np.concatenate([[True], np.diff(up) > 3])]) * 2.0  # noise crosses the mean more than once
    assert swing.period_s == pytest.approx(np.median(periods), rel=0.1)


@pytest.mark.parametrize("kind", ["pulse", "long pulse", "heat-up", "stairs", "firings", "thermostat", "slow thermostat"])
@pytest.mark.parametrize("seed", [100, 101, 102])
def test_drawn_logs_that_no_tried_law_made_are_recognised(kind, seed):
    case = blind.make(kind, seed)
    log = replace(_log(case.columns["temperature_degC"]), time_s=case.columns["time_s"])
    # of the span: what P and PI laws left over on such logs
    assert steady_swing(log) is not None or is_open_loop(log, rmse_degC=0.004 * float(np.ptp(log.temperature_degC)))


def test_a_quick_swing_in_a_long_log_is_seen():
    readings = _simulated(_thermostat(130.0, 0.5), 9000, lags=(300.0, 1.0), delay=4)
    log = _log(readings)
    swing = steady_swing(log)
    assert swing is not None
    assert swing.period_s < 60.0, "two of the parts over which the readings are averaged"
