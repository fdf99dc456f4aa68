"""Disturbed logs of known heaters: exponentials superposed by the bench, SciPy's lsim for two lags."""

import numpy as np
import pytest
from scipy.signal import lsim, lti
from tests.bench.identification import answer

from heatertune.errors import OutOfRange
from heatertune.log.log_values import Log
from heatertune.model.fit import fit, fit_together
from heatertune.model.model_values import Fopdt, TwoLag

PLANT = Fopdt(gain_degC_per_pct=0.5, time_constant_s=150.0, dead_time_s=12.0, ambient_degC=20.0)
TIME = np.arange(0.0, 2000.0, 4.0)
POWER = np.select(
    [TIME < 60, TIME < 500, TIME < 900, TIME < 1200, TIME < 1600], [0.0, 60.0, 10.0, 80.0, 30.0], 70.0)


def _log(temperature, power=POWER, time=TIME, name="made"):
    return Log(name=name, source="", time_s=time, temperature_degC=temperature, power_pct=power)


def _read(power=POWER, noise=0.1, seed=4):
    return answer(PLANT, TIME, power, 20.0) + np.random.default_rng(seed).normal(0.0, noise, len(TIME))


def _thrown(at, size, lag=150.0):
    """Cold water: it cools by its size at once, and the heater forgets it with its own time constant."""
    return np.where(at <= TIME, size * np.exp(-np.clip(TIME - at, 0.0, None) / lag), 0.0)


def _disturbances(fitted):
    return [note for note in fitted.notes if "disturbed" in note]


def _is_the_heater(fitted):
    model = fitted.model
    assert model.gain_degC_per_pct == pytest.approx(0.5, rel=0.01)
    assert model.time_constant_s == pytest.approx(150.0, rel=0.02)
    assert model.dead_time_s == pytest.approx(12.0, abs=0.6)
    assert model.ambient_degC == pytest.approx(20.0, abs=0.5)
    for name, truth in (("gain_degC_per_pct", 0.5), ("time_constant_s", 150.0)):
        assert fitted.ci95[name].low < truth < fitted.ci95[name].high


@pytest.mark.long
@pytest.mark.parametrize("thrown", [((1000.0, -15.0),), ((700.0, -12.0), (1001.0, 20.0), (1500.0, -9.0))])
def test_a_log_that_jumps_is_fitted_to_its_end_as_one_heater(thrown):
    fitted = fit(_log(_read() + sum(_thrown(*each) for each in thrown)))
    (note,) = _disturbances(fitted)
    for at, _ in thrown:
        assert f"{TIME[at <= TIME][0]:g}" in note  # the first reading after it
    assert fitted.candidates[0].window_s == (0.0, 1996.0)
    assert fitted.fit_pct > 98.0
    assert fitted.validation.held_out.fit_pct > 95.0
    _is_the_heater(fitted)


@pytest.mark.long
def test_the_power_in_a_clock_gap_is_not_asked_for():
    # 100 % for 250 s that nobody logged
    unlogged = np.where((TIME >= 1250.0) & (TIME < 1500.0), 100.0, POWER)
    keep = (TIME < 1250.0) | (TIME >= 1520.0)
    fitted = fit(_log(_read(unlogged)[keep], POWER[keep], TIME[keep]))
    assert "a gap in the clock before 1520 s" in _disturbances(fitted)[0]
    _is_the_heater(fitted)


@pytest.mark.long
@pytest.mark.parametrize(("places", "reading"), [([0], 0.0), ([0, 1], 85.0), ([-1], 127.0), ([-2, -1], 0.0)])
def test_wild_readings_at_either_end_are_left_out_and_told(places, reading):
    temperature = _read()
    temperature[places] = reading
    fitted = fit(_log(temperature))
    assert any(f"too few to tell anything, were left out: {len(places)} (at" in note for note in fitted.notes)
    _is_the_heater(fitted)


@pytest.mark.long
def test_a_dropout_too_long_for_a_spike_is_left_out_and_told():
    temperature = _read()
    temperature[200:208] = 0.0
    fitted = fit(_log(temperature))
    assert any("left out: 8 (at 800, 804, 808, 812, 816 and 3 more s)" in note for note in fitted.notes)
    _is_the_heater(fitted)


@pytest.mark.long
def test_heavy_noise_and_slopes_over_gaps_and_kinks_at_edges_are_no_jumps():
    assert not _disturbances(fit(_log(_read(noise=4.0))))
    rng = np.random.default_rng(3)
    edges = np.flatnonzero(np.diff(POWER)) + 1
    keep = np.union1d(rng.choice(len(TIME), 200, replace=False), edges)  # every other reading or so, at random
    sparse = fit(_log(_read()[keep], POWER[keep], TIME[keep]))
    assert not _disturbances(sparse)
    assert sparse.model.gain_degC_per_pct == pytest.approx(0.5, rel=0.03)
    fast = Fopdt(gain_degC_per_pct=0.8, time_constant_s=3.0, dead_time_s=1.0, ambient_degC=20.0)
    quick = fit(_log(answer(fast, TIME, POWER, 20.0) + rng.normal(0.0, 0.1, len(TIME))))
    assert not _disturbances(quick)
    assert quick.model.time_constant_s == pytest.approx(3.0, rel=0.1)


@pytest.mark.long
def test_two_lags_have_two_states_in_each_segment():
    fine = np.arange(0.0, 2001.0, 0.25)
    held = POWER[np.clip(np.searchsorted(TIME, fine - 5.0 + 1e-9, side="right") - 1, 0, None)]
    rise = np.interp(TIME, fine, lsim(lti([0.5], np.polymul([120.0, 1.0], [30.0, 1.0])), held, fine, interp=False)[1])
    # warm water on the sensor's side: it cools there at once, and the mass behind follows
    thrown = _thrown(1000.0, -25.0, 30.0) + _thrown(1000.0, 5.0, 120.0)
    log = _log(20.0 + rise + thrown + np.random.default_rng(1).normal(0.0, 0.1, len(TIME)))
    fitted = fit(log)
    assert _disturbances(fitted)
    two = next(c.model for c in fitted.candidates if isinstance(c.model, TwoLag))
    assert two.lags_s == pytest.approx((120.0, 30.0), rel=0.05)
    assert two.dead_time_s == pytest.approx(5.0, abs=1.0)


@pytest.mark.long
def test_a_disturbed_log_and_a_quiet_one_are_fitted_together():
    fitted = fit_together([
        _log(_read() + _thrown(1000.0, -15.0), name="shaken"), _log(_read(seed=2), name="quiet")])
    (note,) = _disturbances(fitted)
    assert note.startswith("shaken: ")
    _is_the_heater(fitted)


@pytest.mark.long
def test_until_ends_a_log_before_its_disturbance():
    fitted = fit(_log(_read() + _thrown(1000.0, -15.0)), until_s=990.0)
    assert not _disturbances(fitted)
    assert fitted.candidates[0].window_s[1] == 988.0


@pytest.mark.long
@pytest.mark.parametrize("begins", [300.0, 504.0, 510.0, 700.0])
def test_from_begins_a_log_where_the_heater_is_not_at_rest_also_within_the_dead_time_after_a_step(begins):
    fitted = fit(_log(_read()), from_s=begins)
    assert fitted.candidates[0].window_s[0] == TIME[begins <= TIME][0]
    assert f"Readings before {begins:g} s were not used." in fitted.notes
    _is_the_heater(fitted)


def test_a_part_without_readings_is_refused_with_what_the_log_holds():
    with pytest.raises(OutOfRange, match=r"from 3000 to 1996 s = 0 .*>= 20; made goes from 0 to 1996 s"):
        fit(_log(_read()), from_s=3000.0)
    with pytest.raises(OutOfRange, match=r"from 900 to 300 s = 0 .*>= 20; made goes from 0 to 1996 s"):
        fit(_log(_read()), from_s=900.0, until_s=300.0)
