"""The heaters at the ends of what a log leaves open: truth is lsim's, costs are SciPy's own least squares."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq, least_squares
from tests.model.twins import AMBIENT, DEAD, GAIN, LAG, doublet, logged

from heatertune.errors import InputError, OutOfRange
from heatertune.log.log_values import Log
from heatertune.model import model_document as document
from heatertune.model.circumstances import setpoint_of
from heatertune.model.fit import fit
from heatertune.model.model_values import Fopdt
from heatertune.model.power.open_loop import PowerProblem
from heatertune.model.power.regressors import Readings
from heatertune.model.power.uncertainty import AtEnd, ends_of, fits_of_period, periods_of
from heatertune.model.statistics import Interval


def _noisy(seed=0, sample=4.0, deviation=0.4, **heater):
    time, power = doublet(sample=sample)
    return logged(time, power, noise=np.random.default_rng(seed).normal(0.0, deviation, len(time)), **heater)


def _parts(fitted):
    """The ends of one lag; two lags have their own."""
    return {each.part: each.model for each in fitted.candidates if each.part and isinstance(each.model, Fopdt)}


@pytest.mark.long
def test_the_family_holds_the_ends_of_dead_time_slope_and_ultimate_period():
    fitted = fit(_noisy())
    parts, dead = _parts(fitted), fitted.ci95["dead_time_s"]
    assert dead.low < DEAD < dead.high
    assert parts["dead time at its low end"].dead_time_s == pytest.approx(dead.low, rel=1e-6)
    # the interval reaches two rows (8 s) further than the fit says: the power may change between rows, and be a row late
    assert parts["dead time at its high end"].dead_time_s == pytest.approx(dead.high - 8.0, rel=1e-6)
    assert parts["dead time longer by 2 rows of the log"].dead_time_s == pytest.approx(dead.high, rel=1e-6)
    slope = parts["gain per time constant at its high end"]
    assert slope.gain_degC_per_pct / slope.time_constant_s > GAIN / LAG
    # a later answer has to be a quicker one to pass through the same readings
    assert parts["dead time at its high end"].time_constant_s < parts["dead time at its low end"].time_constant_s


def _cost(log, dead):
    """Least sum of squares of gain, lag and ambient with the dead time held, from rest, by SciPy alone."""
    fine = np.arange(0.0, log.time_s[-1] + 1.0, 0.5)
    held = log.power_pct[np.clip(np.searchsorted(log.time_s, fine - dead + 1e-9, side="right") - 1, 0, None)]

    def left(z):
        gain, lag, ambient = z
        y, course = ambient, []
        share = math.exp(-0.5 / lag)
        for u in held:
            course.append(y)
            y = ambient + gain * u + share * (y - ambient - gain * u)
        return np.interp(log.time_s, fine, course) - log.temperature_degC

    return least_squares(left, [GAIN, LAG, AMBIENT], x_scale=[0.1, 50.0, 5.0]).x


@pytest.mark.long
def test_at_a_held_dead_time_the_others_are_those_of_an_independent_least_squares_fit():
    log = _noisy()
    model = _parts(fit(log))["dead time at its high end"]
    gain, lag, _ = _cost(log, model.dead_time_s)
    assert model.gain_degC_per_pct == pytest.approx(gain, rel=0.01)  # steps of 0.5 s, and of readings averaged
    assert model.time_constant_s == pytest.approx(lag, rel=0.01)


def test_the_ultimate_period_is_where_the_phase_is_half_a_turn():
    vectors = np.array([[math.log(150.0), 12.0, 0.0], [math.log(90.0), 5.0, 0.4], [math.log(20.0), 0.0, 0.0]])
    for (log_lag, dead, ratio), found in zip(vectors.tolist(), periods_of(vectors).tolist(), strict=True):
        lag = math.exp(log_lag)
        if dead == 0.0:
            assert found == 0.0
            continue
        phase = brentq(lambda w, lag=lag, dead=dead, ratio=ratio: w * dead + math.atan(w * lag) + math.atan(w * ratio * lag)
                       - math.pi, 1e-9, math.pi / dead)
        assert found == pytest.approx(2.0 * math.pi / phase, rel=1e-9)


@pytest.mark.parametrize("two_lags", [False, True])
def test_with_the_period_held_no_other_heater_of_that_period_fits_better(two_lags):
    problem = PowerProblem(readings=Readings.of(_noisy()), two_lags=two_lags)
    held = 60.0
    (vector,), (cost,) = fits_of_period(problem, np.array([held]))
    assert periods_of(vector[None, :])[0] == pytest.approx(held, rel=1e-9)
    rng = np.random.default_rng(0)
    lags, ratios = rng.uniform(problem.low[0], problem.high[0], 4000), rng.uniform(0.01, 0.98, 4000) * two_lags
    omega = 2.0 * math.pi / held
    dead = (math.pi - np.arctan(omega * np.exp(lags)) - np.arctan(omega * np.exp(lags) * ratios)) / omega
    others = np.column_stack([lags, dead, ratios])
    others = others[(dead > 0.0) & (dead < problem.high[1])]
    assert cost <= 1.001 * problem.cost(others, np.tile(problem.readings.temperature_degC, (len(others), 1))).min()


@pytest.mark.long
def test_no_dead_time_is_believed_below_half_the_interval_and_the_sensor_s_delay():
    slow = fit(_noisy(sample=10.0, deviation=0.01, dead=1.0))
    assert slow.least_dead_time_s == 5.0
    assert min(plant.dead_time_s for plant in slow.plants) == 5.0
    assert slow.model.dead_time_s < 5.0, "what was fitted is told as it is"
    delayed = fit(_noisy(), sensor_delay_s=30.0)
    assert delayed.least_dead_time_s == 32.0
    assert min(plant.dead_time_s for plant in delayed.plants) == 32.0
    assert delayed.assumed == {"sensor_delay_s": 30.0}


@pytest.mark.long
def test_a_bound_that_the_user_knows_is_the_end_and_a_heater_of_the_family():
    fitted = fit(_noisy(deviation=1.5, sample=10.0), dead_time_at_most_s=14.0)
    assert fitted.ci95["dead_time_s"].high == 14.0
    assert _parts(fitted)["dead time at its high end"].dead_time_s == pytest.approx(14.0)
    assert fitted.assumed == {"dead_time_at_most_s": 14.0}
    assert "dead-time-open" not in [each.name for each in fitted.findings]


def test_a_bound_without_meaning_is_refused():
    log = _noisy()
    with pytest.raises(OutOfRange, match="dead_time_at_most_s"):
        fit(log, dead_time_at_most_s=0.0)
    with pytest.raises(OutOfRange, match="dead_time_at_most_s"):
        fit(log, dead_time_at_most_s=5.0, sensor_delay_s=8.0)
    with pytest.raises(OutOfRange, match="sensor_delay_s"):
        fit(log, sensor_delay_s=-1.0)
    with pytest.raises(InputError, match="dead_time_at_most_s"):
        fit(replace(log, power_pct=None), laws=(object(),), dead_time_at_most_s=9.0)


@pytest.mark.long
def test_what_is_known_of_a_log_survives_its_document():
    fitted = fit(_noisy(), dead_time_at_most_s=40.0)
    again = document.from_document(document.to_document(fitted))
    for name in ("assumed", "setpoint_degC", "log_interval_s", "least_dead_time_s", "reading_step_degC", "findings",
                 "heaters", "hypothetical"):
        assert getattr(again, name) == getattr(fitted, name), name


def _log(temperature, setpoint=None):
    time = np.arange(float(len(temperature)))
    return Log(name="", source="", time_s=time, temperature_degC=temperature, setpoint_degC=setpoint)


def test_the_setpoint_is_the_column_s_last_value_or_longest_or_the_middle_of_the_upper_half():
    up_and_down = np.concatenate([np.linspace(20.0, 220.0, 60), np.linspace(220.0, 30.0, 200)])
    assert setpoint_of(_log(up_and_down)) == 170.0  # 20 + ¾ · 200; its last ten readings are near 30
    asked = np.where(np.arange(260) < 100, 120.0, 200.0)
    assert setpoint_of(_log(up_and_down, asked)) == 200.0
    switched_off = np.where(np.arange(260) < 200, 200.0, 0.0)
    assert setpoint_of(_log(up_and_down, switched_off)) == 200.0, "asked for 200 of 260 s"
    two = np.where(np.arange(260) < 120, 210.0, switched_off)
    assert setpoint_of(_log(up_and_down, two)) == 210.0, "120 s, and the other 80 s"
    never_reached = np.where(switched_off > 0.0, 260.0, 0.0)
    ramp = np.where(np.arange(260) < 200, np.arange(260.0), 0.0)
    for asked in (never_reached, ramp, np.zeros(260)):
        assert setpoint_of(_log(up_and_down, asked)) == 170.0
    assert setpoint_of(replace(_log(up_and_down), rests_at_degC=53.3)) == 53.3


@pytest.mark.long
def test_a_heater_stands_once_in_the_family_and_ends_are_not_drawn_around():
    fitted = fit(_noisy())
    assert len(set(fitted.plants)) == len(fitted.plants)
    assert set(fitted.hypothetical) < set(fitted.plants)
    assert all(isinstance(model, Fopdt) or len(model.lags_s) == 2 for model in fitted.plants)


@pytest.mark.long
def test_the_nearest_heater_there_is_stands_for_an_end_that_no_heater_has():
    best = fit(_noisy()).candidates[0]

    def held(name, value):  # beyond 20 s of dead time no gain is positive
        return AtEnd(replace(best.model, dead_time_s=value), 90.0, 0.1) if value <= 20.0 else None

    ends = ends_of(best, {"dead_time_s": 12.0}, {"dead_time_s": Interval(low=8.0, high=30.0)}, held,
                   least_dead_time_s=2.0)
    assert [end.model.dead_time_s for end in ends] == [8.0, pytest.approx(20.0, abs=18.0 / 2**6)]
