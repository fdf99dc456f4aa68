import numpy as np
import pytest
from tests.bench.identification import answer

from heatertune.errors import InputError
from heatertune.log.log_values import Log
from heatertune.model.fit import fit
from heatertune.model.model_values import Fopdt
from heatertune.model.power.feedback import follows_temperature

PLANT = Fopdt(gain_degC_per_pct=0.5, time_constant_s=150.0, dead_time_s=12.0, ambient_degC=20.0)


def _log(*, power=None, temperature=None, length=1500.0, noise=0.1, seed=1, setpoint=None):
    time = np.arange(0.0, length, 4.0)
    if power is None:
        power = np.select([time < 60, time < 500, time < 900, time < 1200], [0.0, 60.0, 10.0, 80.0], 30.0)
    if temperature is None:
        temperature = answer(PLANT, time, power, 20.0) + np.random.default_rng(seed).normal(0.0, noise, len(time))
    return Log(
        name="made", source="", time_s=time, temperature_degC=temperature, power_pct=power, setpoint_degC=setpoint
    )


def _held_by_a_p_controller(*, loads, n=600):
    """A loop at rest: P controller of 2 %/°C, disturbed by a slow load of up to `loads` °C; every scan logged."""
    rng = np.random.default_rng(5)
    decay = np.exp(-1.0 / 150.0)
    state, push, past = 20.0, 0.0, [30.0] * 12
    rows = []
    for _ in range(n):
        power = float(np.clip(30.0 + 2.0 * (40.0 - state), 0.0, 100.0))
        rows.append((state, power))
        past.append(power)
        push += 0.05 * (rng.normal(0.0, loads) - push)
        end = 20.0 + 0.5 * past[-13] + 20.0 * push
        state = end + decay * (state - end)
    y, u = np.array(rows[200:]).T
    return Log(name="loop", source="", time_s=np.arange(len(y)) * 1.0, temperature_degC=y, power_pct=u)


def test_the_controller_seen_backwards_is_refused():
    # u = 30 + 2·(40 − y), so y = 55 − u/2: a direct fit finds gain −0.5 °C/% and no lag at all, and fits nearly exactly
    log = _held_by_a_p_controller(loads=2.0)
    inverse = np.polyfit(log.power_pct, log.temperature_degC, 1)
    assert inverse[0] == pytest.approx(-0.5, rel=1e-6)
    assert follows_temperature(log)
    with pytest.raises(InputError, match=r"gain -0\.5.*controller seen backwards"):
        fit(log)


@pytest.mark.long
def test_a_loop_that_a_setpoint_moves_is_fitted_and_said_to_be_one():
    decay, state, past, rows = np.exp(-4.0 / 150.0), 20.0, [0.0] * 3, []
    rng = np.random.default_rng(2)
    for i in range(375):
        setpoint = 40.0 if i < 200 else 50.0
        seen = state + rng.normal(0.0, 0.05)
        power = float(np.clip(4.0 * (setpoint - seen), 0.0, 100.0))
        rows.append((seen, power))
        past.append(power)
        end = 20.0 + 0.5 * past[-4]
        state = end + decay * (state - end)
    y, u = np.array(rows).T
    fitted = fit(_log(power=u, temperature=y))
    assert any("closed loop" in note for note in fitted.notes)
    assert fitted.model.gain_degC_per_pct == pytest.approx(0.5, rel=0.03)
    assert fitted.model.dead_time_s == pytest.approx(12.0, abs=1.0)


@pytest.mark.long
def test_an_open_loop_log_does_not_look_like_a_loop():
    assert not follows_temperature(_log())
    rng = np.random.default_rng(7)
    assert not follows_temperature(_log(power=rng.uniform(0.0, 100.0, 375)))  # moves all the time, and asks nobody
    assert not any("closed loop" in note for note in fit(_log()).notes)


@pytest.mark.parametrize("mirrored", ["temperature", "power"])
def test_a_gain_of_the_wrong_sign_is_refused_with_its_size(mirrored):
    log = _log()
    if mirrored == "temperature":
        log = _log(temperature=80.0 - log.temperature_degC)
    else:
        log = _log(power=100.0 - log.power_pct, temperature=log.temperature_degC)
    with pytest.raises(InputError, match=r"gain -0\.5 °C/%, time constant 1[45]\d s\).*a cooler.*--cooler"):
        fit(log)


def test_a_power_column_with_a_late_clock_is_found_and_the_shift_told():
    log = _log()
    late = np.interp(log.time_s - 40.0, log.time_s, np.arange(len(log.time_s)))
    shifted = _log(power=log.power_pct[np.rint(late).astype(int)], temperature=log.temperature_degC)
    with pytest.raises(InputError, match=r"moves 2[78](\.\d)? s before the power") as told:  # 40 s less 12 s dead time
        fit(shifted)
    assert "clocks" in str(told.value)


def test_a_log_that_ends_before_the_temperature_answers_is_refused():
    time = np.arange(0.0, 300.0, 4.0)
    log = _log(
        power=np.where(time < 100.0, 0.0, 60.0), length=300.0,
        temperature=20.0 + np.random.default_rng(3).normal(0.0, 0.1, len(time)),
    )
    with pytest.raises(InputError, match="dead time is longer than the log"):
        fit(log)


@pytest.mark.long
def test_sound_logs_pass_all_checks_whatever_their_noise():
    for seed in range(8):
        noise = (0.0, 0.3, 2.0)[seed % 3]
        fit(_log(seed=seed, noise=noise))


def _two_scales_switched(n, sign=1.0):
    """A fast element (30 %, 15 s) beside a slow mass (1200 s) and a thermostat of 40 ± 0.5 °C; -1: a cooler from 60 °C."""
    fast = slow = sensor = 0.0
    rng, late, power, rows = np.random.default_rng(0), [0.0] * 30, 100.0, []
    for _ in range(n):
        reading = round(40.0 - sign * 18.0 + sensor + rng.normal(0.0, 0.05), 1)
        beyond = sign * (reading - 40.0)
        power = 0.0 if beyond > 0.5 else 100.0 if beyond < -0.5 else power
        rows.append((reading, power))
        for _ in range(10):
            late.append(power)
            push = sign * 0.6 * late.pop(0)
            fast += 0.1 * (0.3 * push - fast) / 15.0
            slow += 0.1 * (0.7 * push - slow) / 1200.0
            sensor += 0.1 * (fast + slow - sensor) / 6.0
    y, u = np.array(rows).T
    return Log(name="thermostat", source="", time_s=np.arange(float(n)), temperature_degC=y, power_pct=u)


@pytest.mark.long
def test_a_heater_of_two_time_scales_under_two_level_control_is_not_called_a_cooler():
    # the fast element answers within a cycle, against the slow mass; but a controller that switches on when it is cold
    # drives a heater
    found = fit(_two_scales_switched(2500))
    assert "unexplained-by-power" in {each.name for each in found.findings}


@pytest.mark.parametrize("n", [600, 1200])
def test_a_cooler_under_two_level_control_is_never_fitted_as_a_proven_heater(n):
    try:
        found = fit(_two_scales_switched(n, sign=-1.0))
    except InputError:
        return
    assert any(each.kind.effect == "blocks" for each in found.findings)
