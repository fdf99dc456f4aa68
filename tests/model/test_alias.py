"""PWM of known period and duty behind an exact first-order lag, logged once per so many periods; and honest switching."""

import numpy as np
import pytest
from scipy.signal import lfilter
from tests.bench.identification import answer

from heatertune.errors import InputError
from heatertune.log.log_values import Log
from heatertune.model.fit import fit, fit_together
from heatertune.model.model_values import Fopdt

GAIN, LAG, DEAD, STEP = 0.5, 150.0, 8.0, 0.05


def _log(time, power, temperature, name="made"):
    return Log(name=name, source="", time_s=time, power_pct=power, temperature_degC=temperature)


def _pwm(periods, *, period=5.0, seed=1, name="made"):
    """On for its share of every period; a reading and what the output was just then, every so many periods."""
    time = np.arange(0.0, 1500.0, STEP)
    duty = np.select([time < 60, time < 500, time < 900, time < 1200], [0.0, 60.0, 15.0, 80.0], 35.0)
    power = np.where(time % period < duty / 100.0 * period, 100.0, 0.0)
    decay = np.exp(-STEP / LAG)
    acting = np.concatenate([np.zeros(int(DEAD / STEP)), power])[: len(time)]
    temperature = 20.0 + lfilter([0.0, 1.0 - decay], [1.0, -decay], GAIN * acting)
    rows = np.round(np.arange(0.0, 1499.0, periods * period) / STEP).astype(int)
    noise = np.random.default_rng(seed).normal(0.0, 0.05, len(rows))
    return _log(time[rows], power[rows], temperature[rows] + noise, name)


def _alias(log):
    """The finding's sentence, or that of the refusal."""
    try:
        findings = fit(log).findings
    except InputError as refused:
        return str(refused)
    return next((each.message for each in findings if each.name == "alias"), "")


@pytest.mark.long
@pytest.mark.parametrize("periods", [0.7, 1.3, 1.618, 3.7])
@pytest.mark.parametrize("period", [2.0, 5.0])
def test_power_that_switches_between_two_readings_is_told_by_its_own_sentence(periods, period):
    told = _alias(_pwm(periods, period=period))
    assert "switches faster than it was logged" in told
    assert "clocks" not in told


@pytest.mark.long
def test_a_fit_on_aliased_power_carries_the_finding_that_blocks_its_verdict():
    for fitted in (fit(_pwm(1.618)), fit_together([_pwm(1.618), _pwm(1.618, seed=2, name="b")])):
        found = [each for each in fitted.findings if each.name == "alias"]
        assert found
        assert found[0].kind.effect == "blocks"
        assert any("switches faster than it was logged" in note for note in fitted.notes)


@pytest.mark.long
@pytest.mark.parametrize("hold", [1, 2, 4])
def test_a_prbs_that_was_logged_at_every_switching_is_not_accused(hold):
    plant = Fopdt(gain_degC_per_pct=GAIN, time_constant_s=LAG, dead_time_s=DEAD, ambient_degC=20.0)
    time, rng = np.arange(0.0, 1500.0, 4.0), np.random.default_rng(3)
    power = np.repeat(rng.choice([0.0, 100.0], len(time) // hold + 1), hold)[: len(time)]
    temperature = answer(plant, time, power, 20.0) + rng.normal(0.0, 0.1, len(time))
    assert _alias(_log(time, power, temperature)) == ""


@pytest.mark.long
@pytest.mark.parametrize("band", [0.3, 1.0])
def test_a_thermostat_is_not_accused(band):
    y, on, past, rows = 20.0, False, [0.0] * 16, []
    rng = np.random.default_rng(1)
    for k in range(2400):  # Euler's rule in steps of 0.5 s, read every 2 s
        if k % 4 == 0:
            seen = y + rng.normal(0.0, 0.02)
            on = seen < 45.0 + (band if on else -band)
            rows.append((0.5 * k, 100.0 * on, seen))
        past.append(100.0 * on)
        y += 0.5 * (20.0 + GAIN * past[-16] - y) / LAG
    assert _alias(_log(*np.array(rows).T)) == ""


@pytest.mark.long
def test_a_relay_test_and_slow_steps_are_not_accused():
    plant = Fopdt(gain_degC_per_pct=GAIN, time_constant_s=LAG, dead_time_s=DEAD, ambient_degC=20.0)
    time = np.arange(0.0, 1500.0, 4.0)
    for power in (np.where((time // 40.0) % 2 == 1, 100.0, 0.0), np.where((time > 60.0) & (time < 700.0), 100.0, 0.0)):
        noise = np.random.default_rng(1).normal(0.0, 0.1, len(time))
        assert _alias(_log(time, power, answer(plant, time, power, 20.0) + noise)) == ""
