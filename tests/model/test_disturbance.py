"""A disturbance in a log with power, against heaters simulated here, second by second."""

import numpy as np
import pytest

from heatertune.errors import InputError, OutOfRange
from heatertune.log.log_values import Log
from heatertune.model.disturbance import DisturbanceEffect
from heatertune.model.fit import fit, model_by_hand
from heatertune.model.model_values import Fopdt
from heatertune.model.power.disturbance_fit import without_disturbance
from heatertune.model.validate import validate

SECONDS = 2400
POWER = np.select([np.arange(SECONDS) < edge for edge in (60, 900, 1500)], [0.0, 50.0, 30.0], 60.0)
FAN = np.where((np.arange(SECONDS) // 300) % 3 == 2, 2.5, 1.0)


def _delayed(course, seconds):
    return np.concatenate([np.full(seconds, course[0]), course[: len(course) - seconds]])


def _lagged(course, lag, begin):
    """One lag of a course held second by second, exactly: y += (1 − e^(−1/lag))·(u − y)."""
    out, y = np.empty(len(course)), begin
    for k, u in enumerate(course):
        out[k] = y
        y += (1.0 - np.exp(-1.0 / lag)) * (u - y)
    return out


def _log(effect=-8.0, delay=3, own_lag=None, fan=FAN, power=POWER, noise=0.05, colour=0.0, seed=1):
    """T = 60 + G·(0.9·power + 0.9·effect·fan), lags of 150 s and 20 s, dead time 12 s; read every 2 s."""
    heat = _lagged(_lagged(0.9 * _delayed(power, 12), 150.0, 0.9 * power[0]), 20.0, 0.9 * power[0])
    load, begin = 0.9 * effect * _delayed(fan, delay), 0.9 * effect * fan[0]
    felt = _lagged(load, own_lag, begin) if own_lag else _lagged(_lagged(load, 150.0, begin), 20.0, begin)
    white, rng = np.empty(SECONDS), np.random.default_rng(seed)
    for k, step in enumerate(rng.normal(0.0, noise, SECONDS)):
        white[k] = step + (colour * white[k - 1] if k else 0.0)
    temperature = np.round(60.0 + heat + felt + white, 2)
    return Log(name="fan", source="simulated", time_s=np.arange(0.0, SECONDS, 2.0), temperature_degC=temperature[::2],
               power_pct=power[::2], disturbance=fan[::2])


@pytest.mark.parametrize("effect", [-8.0, 5.0])
def test_the_effect_and_its_delay_are_found_and_taken_out(effect):
    cleared, seen = without_disturbance(_log(effect))
    low, high = seen.pct_per_unit_ci95
    assert low <= effect <= high
    assert high - low < 0.1 * abs(effect)
    assert seen.lead_s_ci95[0] <= 12 - 3 <= seen.lead_s_ci95[1]
    assert (seen.calm, seen.strong, seen.acts, seen.as_power) == (1.0, 2.5, True, True)
    assert cleared.disturbance is None
    # what is left is the heater with the fan at 1 all the time
    alone = _log(effect, fan=np.ones(SECONDS))
    np.testing.assert_allclose(cleared.temperature_degC, alone.temperature_degC, atol=0.3)


@pytest.mark.long
def test_the_interval_holds_the_effect_where_the_noise_is_coloured():
    # AR(1) noise of 0.9, as heaters have it: white-noise intervals would be four times too narrow
    held = [low <= -4.0 <= high for seed in range(12)
            for low, high in [without_disturbance(_log(-4.0, colour=0.9, noise=0.15, seed=seed))[1].pct_per_unit_ci95]]
    assert sum(held) >= 10  # of 12 at 95 %: fewer than 10 come by chance once in fifty


def test_what_does_not_act_is_told_and_the_readings_stay():
    log = _log(0.0, colour=0.9, noise=0.15)
    cleared, seen = without_disturbance(log)
    assert not seen.acts
    assert seen.sentence.startswith("The log does not show that the disturbance 'disturbance' acts")
    np.testing.assert_array_equal(cleared.temperature_degC, log.temperature_degC)


def test_what_moves_with_the_power_alone_is_not_told_apart_from_it():
    with pytest.raises(InputError, match="moves with the power, so their effects cannot be separated"):
        without_disturbance(_log(0.0, fan=POWER / 20.0))


def test_an_effect_through_another_lag_is_no_power():
    _, seen = without_disturbance(_log(-8.0, own_lag=15.0, delay=0))
    assert seen.acts
    assert not seen.as_power
    assert seen.own_lag_s == pytest.approx(15.0, rel=0.2)
    assert "through a lag of its own" in seen.sentence


@pytest.mark.parametrize(("changed", "match"), [
    ({"fan": np.ones(SECONDS)}, "the disturbance 'disturbance' is 1 in all but a hundredth"),
    ({"power": np.full(SECONDS, 40.0)}, "the power never changes, so no disturbance can be expressed in power"),
])
def test_a_log_that_cannot_tell_is_refused(changed, match):
    with pytest.raises(InputError, match=match):
        without_disturbance(_log(**changed))


def test_without_the_power_a_disturbance_is_refused():
    log = _log()
    alone = Log(name="fan", source="", time_s=log.time_s, temperature_degC=log.temperature_degC, disturbance=log.disturbance)
    with pytest.raises(InputError, match="fitted from a single log that contains the power"):
        fit(alone)


def test_a_model_is_not_validated_by_a_disturbed_log_as_if_it_were_calm():
    with pytest.raises(InputError, match="leave it out with --disturbance-column none"):
        validate(model_by_hand(Fopdt(gain_degC_per_pct=0.9, time_constant_s=150.0, dead_time_s=12.0, ambient_degC=60.0)), _log())


@pytest.mark.parametrize("changed", [
    {"pct_per_unit": 3.0}, {"lead_s": 20.0}, {"delay_s": -1.0}, {"strong": 1.0},
])
def test_an_effect_that_contradicts_itself_is_refused(changed):
    given = {"column": "fan", "pct_per_unit": -8.0, "pct_per_unit_ci95": (-9.0, -7.0), "delay_s": 3.0, "lead_s": 9.0,
             "lead_s_ci95": (7.0, 11.0), "calm": 1.0, "strong": 2.5, "delta_bic": 500.0, "delta_bic_own_lag": 100.0,
             "own_lag_s": 90.0}
    with pytest.raises(OutOfRange):
        DisturbanceEffect(**given | changed)
