import json

import numpy as np
import pytest
from scipy.signal import lsim, lti
from tests.bench.heaters import Heater, Rig
from tests.conftest import load_csv

from heatertune.log.log_values import Log
from heatertune.model.model_document import from_document, to_document
from heatertune.model.model_values import FitOutcome, FittedModel, Fopdt
from heatertune.model.relay_test import (
    TwoLevelRelay,
    estimate,
    find_relay,
    oscillating_fopdt,
    oscillation,
    simulate_relay,
    with_relay,
)

TRUTH = Fopdt(gain_degC_per_pct=0.5, time_constant_s=150.0, dead_time_s=20.0, ambient_degC=20.0)
SKEW = TwoLevelRelay(setpoint_degC=38.0, hysteresis_degC=0.5, high_pct=80.0, low_pct=5.0)
EVEN = TwoLevelRelay(setpoint_degC=45.0, hysteresis_degC=0.5, high_pct=80.0, low_pct=20.0)


def _numbers(model):
    return (model.gain_degC_per_pct, model.time_constant_s, model.dead_time_s, model.ambient_degC)


TRUE = _numbers(TRUTH)


def _at_the_limit(gain, lags, dead):
    """Return ultimate gain and period of a transfer function: where its phase is −180°."""
    w = np.geomspace(1e-4, 10.0, 1_000_000)
    ultimate = w[np.argmax(sum(np.arctan(lag * w) for lag in lags) + dead * w >= np.pi)]
    return float(np.prod([np.hypot(1.0, lag * ultimate) for lag in lags])) / gain, 2.0 * np.pi / ultimate


def _logged(relay, *, sample=1.0, rest=60.0, noise=0.0, length=1500.0, seed=1):
    """A relay test: switched by `simulate_relay`, the temperature from those powers by SciPy's linear simulation."""
    schedule = simulate_relay(TRUTH, relay, length, sample_time_s=sample)
    time = np.arange(0.0, length + rest, sample)
    power = np.where(time < rest, 0.0, schedule.at(time - rest + 1e-9))
    fine = np.arange(0.0, time[-1] + 1.0, 0.1)
    delayed = np.interp(fine - 20.0 + 1e-9, time, np.arange(len(time)), left=-1.0)
    held = np.where(delayed < 0.0, 0.0, power[np.floor(np.clip(delayed, 0.0, None)).astype(int)])
    response = np.interp(time, fine, lsim(lti([0.5], [150.0, 1.0]), held, fine, interp=False)[1])
    temperature = 20.0 + response + np.random.default_rng(seed).normal(0.0, noise, len(time))
    return Log(name="relay", source="", time_s=time, temperature_degC=temperature, power_pct=power)


@pytest.mark.parametrize("relay", [SKEW, EVEN], ids=["asymmetric", "symmetric"])
@pytest.mark.parametrize("low", [0.0, 5.0])
def test_the_inverse_undoes_the_closed_form(relay, low):
    relay = TwoLevelRelay(setpoint_degC=40.0 + low, hysteresis_degC=relay.hysteresis_degC, high_pct=80.0, low_pct=low)
    found = oscillation(TRUTH, relay)
    for gain in (0.5, None):
        back = oscillating_fopdt(
            relay, on_s=found.on_s, off_s=found.off_s, highest_degC=found.highest_degC, lowest_degC=found.lowest_degC,
            gain=gain,
        )
        if gain is None and abs(found.on_s - found.off_s) < 0.1 * found.period_s:
            assert back is None, "a symmetric swing has one equation less"
        else:
            assert _numbers(back) == pytest.approx(TRUE, rel=1e-6)


def test_a_nearly_symmetric_swing_does_not_tell_the_gain():
    relay = TwoLevelRelay(setpoint_degC=40.5, hysteresis_degC=0.5, high_pct=80.0, low_pct=0.0)
    found = oscillation(TRUTH, relay)
    assert 0.01 < abs(found.on_s / found.off_s - 1.0) < 0.1
    told = {"on_s": found.on_s, "off_s": found.off_s, "highest_degC": found.highest_degC, "lowest_degC": found.lowest_degC}
    assert oscillating_fopdt(relay, **told, gain=None) is None
    assert _numbers(oscillating_fopdt(relay, **told, gain=0.5)) == pytest.approx(TRUE, rel=1e-6)


def test_a_wide_hysteresis_hides_the_ultimate_gain():
    wide = TwoLevelRelay(setpoint_degC=38.0, hysteresis_degC=3.0, high_pct=80.0, low_pct=5.0)
    log = _logged(wide, length=2500.0)
    bare = FittedModel(model=TRUTH, outcome=FitOutcome.IDENTIFIED, method="")
    told = with_relay(log, bare, ambient_degC=None)
    assert not told.combinations
    assert "too far from the limit of stability" in told.notes[-1]
    assert _numbers(estimate(find_relay(log)).oscillation) == pytest.approx(TRUE, rel=0.05), "the heater shows all the same"
    narrow = with_relay(_logged(SKEW), bare, ambient_degC=None)
    assert set(narrow.combinations) == {"ultimate_gain_pct_per_degC", "ultimate_period_s"}


def test_what_no_fopdt_does_has_no_fopdt():
    found = oscillation(TRUTH, SKEW)
    told = {"on_s": found.on_s, "off_s": found.off_s, "highest_degC": found.highest_degC, "lowest_degC": found.lowest_degC}
    assert oscillating_fopdt(SKEW, **told, gain=0.01) is None  # such a heater could not swing that far
    assert oscillating_fopdt(SKEW, **(told | {"highest_degC": 38.5}), gain=0.5) is None  # no dead time: nothing passes


@pytest.mark.parametrize("relay", [SKEW, EVEN], ids=["asymmetric", "symmetric"])
def test_a_relay_test_is_found_with_its_powers_thresholds_and_rest(relay):
    record = find_relay(_logged(relay, sample=0.5))
    assert (record.high_pct, record.low_pct) == (80.0, relay.low_pct)
    assert record.rest == pytest.approx((0.0, 20.0))
    assert record.relay.setpoint_degC == pytest.approx(relay.setpoint_degC, abs=0.1)
    assert record.relay.hysteresis_degC == pytest.approx(0.5, abs=0.1)
    # the heat-up and the first swing are left out; the rest are whole periods
    assert record.periods == pytest.approx(1300.0 / oscillation(TRUTH, relay).period_s, abs=1.5)
    assert record.off[0] < record.on[0] < record.off[1]
    power = record.log.power_pct
    assert np.all(power[record.off] == relay.low_pct)
    assert np.all(power[record.off - 1] == 80.0)
    assert np.all(power[record.on] == 80.0)


@pytest.mark.parametrize("relay", [SKEW, EVEN], ids=["asymmetric", "symmetric"])
@pytest.mark.parametrize("rest", [60.0, 0.0], ids=["with rest", "without rest"])
def test_period_gain_and_heater_are_those_that_made_the_log(relay, rest):
    log = _logged(relay, sample=0.1, rest=rest)
    found, truth = estimate(find_relay(log)), oscillation(TRUTH, relay)
    assert found.period_s[0] == pytest.approx(truth.period_s, rel=3e-3)  # the relay waits for its next reading
    down = log.time_s[1:][np.diff(log.power_pct) < 0.0]
    assert found.period_s[0] == pytest.approx((down[-1] - down[1]) / (len(down) - 2))
    assert found.period_s[1].high - found.period_s[0] >= 0.1 / found.periods, "no better than the sampling"
    gain, period = _at_the_limit(0.5, [150.0], 20.0)
    assert found.ultimate_gain[0] == pytest.approx(gain, rel=0.05), "thresholds and unequal times are no part of it"
    assert found.ultimate_period_s[0] == pytest.approx(period, rel=0.05)
    if rest == 0.0 and relay is EVEN:
        assert found.oscillation is None
        assert "symmetric" in found.source
        return
    assert _numbers(found.oscillation) == pytest.approx(TRUE, rel=0.02 if rest else 0.1)
    assert _numbers(found.output_error) == pytest.approx(TRUE, rel=3e-3)
    assert ("integrals" in found.source) == bool(rest)


def test_a_rest_too_short_to_show_that_it_is_one_is_not_believed():
    assert find_relay(_logged(SKEW, rest=5.0)).rest is None  # a twentieth of the period


def test_a_known_ambient_serves_for_a_rest():
    found = estimate(find_relay(_logged(EVEN, rest=0.0), ambient_degC=20.0), ambient_degC=20.0)
    assert _numbers(found.oscillation) == pytest.approx(TRUE, rel=0.03)
    assert _numbers(found.output_error) == pytest.approx(TRUE, rel=3e-3)


@pytest.mark.parametrize("hysteresis", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("setpoint", [37.0, 42.0, 48.0], ids=["short pulses", "even", "long pulses"])
def test_the_ultimate_gain_is_that_of_the_transfer_function(hysteresis, setpoint):
    # the describing function alone gives 14 to 19 of 25.5 %/°C here
    relay = TwoLevelRelay(setpoint_degC=setpoint, hysteresis_degC=hysteresis, high_pct=80.0, low_pct=10.0)
    found = estimate(find_relay(_logged(relay, sample=0.1)))
    gain, period = _at_the_limit(0.5, [150.0], 20.0)
    assert found.ultimate_gain[0] == pytest.approx(gain, rel=0.12)
    assert found.ultimate_period_s[0] == pytest.approx(period, rel=0.12)


@pytest.mark.parametrize("seed", range(12))
def test_the_intervals_of_ultimate_gain_and_period_hold_those_of_one_lag_and_of_two(seed):
    rng = np.random.default_rng(seed)
    first = float(rng.uniform(60.0, 400.0))
    lags = (first,) if seed % 3 == 0 else (first, first * float(rng.uniform(0.05, 0.6)))
    heater = Heater(gain=float(rng.uniform(0.3, 1.5)), lags=lags, dead=first * float(rng.uniform(0.03, 0.4)), ambient=20.0)
    log = _switched(heater, share=float(rng.uniform(0.25, 0.75)), hysteresis=float(rng.uniform(0.0, 0.02)), rng=rng)
    found = estimate(find_relay(log))
    if not np.isnan(found.ultimate_gain[0]):
        for truth, (_, inside) in zip(_at_the_limit(heater.gain, lags, heater.dead),
                                      (found.ultimate_gain, found.ultimate_period_s), strict=True):
            assert inside.low <= truth <= inside.high
    with_relay(log, FittedModel(model=TRUTH, outcome=FitOutcome.IDENTIFIED, method=""), ambient_degC=None)


def _switched(heater, *, share, hysteresis, rng):
    """A two-level loop around a share of full power's rise, by Runge-Kutta steps; hysteresis is a share of that rise."""
    rig, interval = Rig(heater, heater.ambient), max(0.5, round(heater.dead / 8.0, 1))
    setpoint, on, rows = heater.ambient + 100.0 * heater.gain * share, True, []
    for i in range(int((6.0 * sum(heater.lags) + 30.0 * heater.dead) / interval)):
        reading = rig.run(i * interval) + float(rng.normal(0.0, 0.02))
        off = setpoint + (1.0 if on else -1.0) * 100.0 * heater.gain * hysteresis
        if (reading <= off) != on or not rows:
            on = reading <= off
            rig.set(100.0 * on)
        rows.append((i * interval, reading, 100.0 * on))
    time, y, u = np.array(rows).T
    return Log(name="two levels", source="", time_s=time, temperature_degC=y, power_pct=u)


def _other(power, sample=2.0):
    time = np.arange(len(power)) * sample
    fine = lsim(lti([0.5], [150.0, 1.0]), power, time, interp=False)[1]
    return Log(name="other", source="", time_s=time, temperature_degC=20.0 + fine, power_pct=power)


def test_what_a_clock_switched_is_no_relay_test():
    wave = np.tile(np.repeat([60.0, 0.0], 250), 6)  # long half periods: the temperature rests at each end
    assert find_relay(_other(wave)) is None
    pulses = np.tile(np.repeat([100.0, 0.0], [3, 7]), 60)  # PWM from cold: each switch a little warmer
    assert find_relay(_other(pulses)) is None
    assert find_relay(_other(np.tile(pulses[:100], 20))) is None
    random = np.repeat(np.random.default_rng(0).integers(0, 2, 60) * 50.0, 20)
    assert find_relay(_other(random)) is None


def test_a_doublet_a_staircase_and_a_log_without_power_are_no_relay_test():
    doublet = np.repeat([0.0, 60.0, 0.0, 60.0, 0.0], 60)
    assert find_relay(_other(doublet)) is None
    assert find_relay(_other(np.repeat(np.arange(10) * 5.0, 30))) is None
    assert find_relay(_other(np.full(100, 50.0))) is None
    bare = _other(doublet)
    assert find_relay(Log(name="", source="", time_s=bare.time_s, temperature_degC=bare.temperature_degC)) is None


REAL = (
    "apm_mimo_random_T1", "apm_siso_doublet", "box_kp8", "pds_tclab", "tec_run16", "unal_prbs_open", "unal_profile_closed"
)


@pytest.mark.parametrize("name", REAL)
def test_real_logs_that_are_none_are_not_taken_for_one(real_logs, name):
    assert find_relay(load_csv(real_logs / "normalised" / f"{name}.csv", name)) is None


def test_a_real_relay_test_is_found(real_logs):
    # the catalogue: relay autotune of a chamber, setpoint 400 counts, "noise" (hysteresis) 50, output 0 and 254 of 255
    record = find_relay(load_csv(real_logs / "normalised" / "chamber_relay_autotune2.csv", "chamber"))
    assert (record.high_pct, record.low_pct) == (99.60784, 0.0)
    assert record.relay.hysteresis_degC == pytest.approx(50.0, rel=0.03)
    assert estimate(record).period_s[0] == pytest.approx(0.5 * (2329.5 - 160.0))  # its switches, read off the file


def test_a_coarse_card_that_does_not_see_the_swings_tells_no_ultimate_gain():
    """A clock of 10 s, a card of 0.1 °C that changes once: the describing function divides by swings of nothing."""
    time = np.arange(120.0)
    power, reading = np.where(time % 10.0 < 4.0, 100.0, 0.0), np.full(120, 50.0)
    reading[56] = 50.1
    log = Log(name="card", source="", time_s=time, temperature_degC=reading, power_pct=power)
    assert find_relay(log) is not None
    told = with_relay(log, FittedModel(model=TRUTH, outcome=FitOutcome.IDENTIFIED, method=""), ambient_degC=None)
    assert not told.combinations
    assert "too far from the limit of stability" in told.notes[-1]
    assert from_document(json.loads(json.dumps(to_document(told)))).model == TRUTH
