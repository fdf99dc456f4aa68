"""Heaters that are not linear, each simulated with Euler's rule in steps of 0.25 s, worked out here."""

import math

import numpy as np
import pytest

from heatertune.log.log_values import Log
from heatertune.model.fit import fit, fit_together
from heatertune.model.model_values import FitOutcome
from heatertune.model.power.nonlinear import knots_of
from heatertune.model.power.open_loop import PowerProblem
from heatertune.model.power.regressors import Readings

AMBIENT, GAIN, LAG, DEAD = 32.0, 0.5, 200.0, 15.0
STEP = 0.25


def _levels(time):
    return np.select([time < 100, time < 900, time < 1700, time < 2500, time < 3200], [0.0, 40.0, 80.0, 100.0, 60.0], 20.0)


def _on_off(time):
    return np.select([time < 100, time < 1000, time < 2000, time < 3000], [0.0, 60.0, 0.0, 60.0], 0.0)


def _log(levels=_levels, *, effective=lambda u: u, loss=0.0, cooling=LAG, warming=LAG, second=0.0, ceiling=math.inf,
         load=(math.inf, 0.0), noise=0.1, seed=0):
    """T' = (gain·f(u) + load − θ·(1 + loss·θ))/lag, θ = T − 32 °C, read every 5 s; the lag depends on the sign."""
    time = np.arange(0.0, 4000.0, 5.0)
    power = levels(time)
    x = y = AMBIENT
    readings = []
    for k in range(int(time[-1] / STEP) + 1):
        now = k * STEP
        if k % 20 == 0:
            readings.append(y)
        acting = power[int(now - DEAD) // 5] if now >= DEAD else power[0]
        above = x - AMBIENT
        push = GAIN * effective(acting) + load[1] * (now > load[0]) - above * (1.0 + loss * above)
        x = min(x + STEP * push / (warming if push > 0.0 else cooling), ceiling)
        y = y + STEP * (x - y) / second if second else x
    noisy = np.array(readings) + np.random.default_rng(seed).normal(0.0, noise, len(time))
    return Log(name="made", source="Euler", time_s=time, temperature_degC=noisy, power_pct=power)


def _told(fitted):
    return [finding.message for finding in fitted.findings if finding.name == "nonlinear"]


def _rates(fitted):
    """Return gain per time constant of the candidates but the linear one [°C/(s·%)]."""
    return [c.model.gain_degC_per_pct / c.model.time_constant_s for c in fitted.candidates if c.law != "power logged"]


def _loads(fitted):
    return [note for note in fitted.notes if "unlogged load" in note]


@pytest.mark.long
@pytest.mark.parametrize("second", [0.0, 40.0])
def test_a_heater_that_saturates_keeps_its_true_gain_and_no_load_is_believed(second):
    # beyond 55 % of power nothing comes: from 40 to 60 % a mean of 0.375 °C/%, below 0.5 °C/%
    found = fit(_log(effective=lambda u: min(u, 55.0), second=second))
    assert max(_rates(found)) == pytest.approx(GAIN / LAG, rel=0.03)
    assert any(c.model.gain_degC_per_pct == pytest.approx(0.375, rel=0.03) for c in found.candidates)
    assert not _loads(found)
    (told,) = _told(found)
    assert told.startswith("The heater is not linear: gain from 0.5")
    assert "to 0 °C/% at 60…80 % of power" in told
    high = found.ci95["gain_degC_per_pct"].high  # open where the ambient is that of the first rows, without power
    assert high is None or high >= 0.98 * GAIN
    assert found.outcome is not FitOutcome.POOR_FIT, "it is explained, though not by one line"


@pytest.mark.long
@pytest.mark.parametrize(("effective", "ends"), [
    # mean slope of f over the steepest and the flattest stretch between logged levels, times 0.5 °C/%
    (lambda u: u * u / 100.0, (0.5 * 1.8, 0.5 * 0.2)),
    (lambda u: 10.0 * math.sqrt(u), (0.5 * 10.0 * math.sqrt(20.0) / 20.0, 0.5 * 10.0 * (10.0 - math.sqrt(80.0)) / 20.0)),
], ids=["square", "root"])
def test_a_gain_that_depends_on_the_power_has_both_its_ends_as_candidates(effective, ends):
    found = fit(_log(effective=effective))
    local = sorted(c.model.gain_degC_per_pct for c in found.candidates if "%" in c.law)
    assert local == pytest.approx(sorted(ends), rel=0.04)
    assert found.ci95["gain_degC_per_pct"].low <= local[0]
    assert found.ci95["gain_degC_per_pct"].high >= local[1]
    assert len(_told(found)) == 1
    assert not _loads(found)


@pytest.mark.long
def test_a_loss_that_grows_takes_gain_and_time_constant_down_together():
    # slope of θ·(1 + 0.02·θ): 1 at the ambient; at 100 %, where θ·(1 + 0.02·θ) = 50, θ = 30.9 °C and the slope is 2.24
    found = fit(_log(loss=0.02))
    hot, cold = sorted((c.model for c in found.candidates if "°C" in c.law), key=lambda m: m.gain_degC_per_pct)
    assert (cold.gain_degC_per_pct, cold.time_constant_s) == pytest.approx((GAIN, LAG), rel=0.03)
    assert (hot.gain_degC_per_pct, hot.time_constant_s) == pytest.approx((GAIN / 2.24, LAG / 2.24), rel=0.03)
    assert "and the time constant with it" in _told(found)[0]


@pytest.mark.long
def test_a_ceiling_is_told_and_the_heater_below_it_is_a_candidate():
    found = fit(_log(ceiling=58.0))
    assert max(_rates(found)) == pytest.approx(GAIN / LAG, rel=0.03)
    (told,) = _told(found)
    assert float(told.split("at less than ")[1].split(" °C")[0]) == pytest.approx(58.0, abs=0.4)


@pytest.mark.long
def test_heating_and_cooling_with_a_second_lag_and_two_powers():
    found = fit(_log(_on_off, warming=150.0, cooling=450.0, second=20.0))
    faces = {c.law.split(", ")[1]: c.model for c in found.candidates if "ing" in c.law.split(", ")[-1]}
    assert faces["heating"].time_constant_s == pytest.approx(150.0, rel=0.05)
    assert faces["cooling"].time_constant_s == pytest.approx(450.0, rel=0.05)
    assert max(_rates(found)) == pytest.approx(GAIN / 150.0, rel=0.05)


@pytest.mark.long
@pytest.mark.parametrize("second", [0.0, 60.0])
def test_a_linear_heater_is_not_bent(second):
    found = fit(_log(second=second))
    assert not found.findings
    assert all(c.law == "power logged" for c in found.candidates)


@pytest.mark.long
@pytest.mark.parametrize("instant", [2100.0, 1715.0])
def test_a_real_load_is_believed_where_no_bend_explains_it_even_with_an_edge(instant):
    # the power goes from 80 to 100 % at 1700 s and arrives at 1715 s
    found = fit(_log(load=(instant, -8.0)))
    (load,) = _loads(found)
    assert float(load.split()[1]) == pytest.approx(instant, abs=8.0)
    # nothing in the log tells a load that sets in with an edge, and against it, from a slow part of the heater
    assert [finding.name for finding in found.findings] == ["unexplained-by-power"] * (instant == 1715.0)
    assert found.model.gain_degC_per_pct == pytest.approx(GAIN, rel=0.01)


def test_the_gain_is_told_between_the_logged_levels_or_quantiles_of_many():
    time = np.arange(0.0, 1000.0, 5.0)
    few = Log(name="few", source="", time_s=time, temperature_degC=20.0 + time, power_pct=_levels(4.0 * time))
    assert knots_of(PowerProblem(readings=Readings.of(few))).tolist() == [0.0, 20.0, 40.0, 60.0, 80.0, 100.0]
    many = Log(name="many", source="", time_s=time, temperature_degC=20.0 + time, power_pct=np.linspace(10.0, 90.0, 200))
    assert knots_of(PowerProblem(readings=Readings.of(many))) == pytest.approx([10.0, 30.0, 50.0, 70.0, 90.0], abs=1.0)


def _glowing(levels, name, seed):
    """A kiln that loses by radiation above all, in Euler steps of half a second: 3 kW, 9 kJ/K, a row every 20 s."""
    ambient, rng, readings, powers = 22.0, np.random.default_rng(seed), [], []
    temperature = sensor = ambient
    for k in range(2 * (300 + 14_000 * len(levels))):
        power = 0.0 if k < 600 else levels[min(len(levels) - 1, (k - 600) // 28_000)]
        radiated = 0.018 * 5.67e-8 * ((temperature + 273.15) ** 4 - (ambient + 273.15) ** 4)
        temperature += 0.5 * (30.0 * power - 1.2 * (temperature - ambient) - radiated) / 9000.0
        sensor += 0.5 * (temperature - sensor) / 25.0
        if k % 40 == 0:
            readings.append(sensor + rng.normal(0.0, 0.3))
            powers.append(power)
    return Log(name=name, source="", time_s=20.0 * np.arange(len(readings)), temperature_degC=np.array(readings),
               power_pct=np.array(powers))


def test_several_logs_of_a_heater_that_is_not_linear_hold_both_ends_too():
    both = fit_together([_glowing((20.0, 35.0), "up", 1), _glowing((30.0,), "one", 2)])
    assert [finding.name for finding in both.findings].count("nonlinear") >= 1
    gains = [candidate.model.gain_degC_per_pct for candidate in both.candidates]
    # its slope of the steady temperature by the power, from 10 to 20 % and from 30 to 40 %: 15.1 and 8.9 °C/%
    assert min(gains) < 12.0
    assert max(gains) > 25.0
    inside = both.ci95["gain_degC_per_pct"]
    assert inside.low < 12.0
    assert inside.high > 25.0
