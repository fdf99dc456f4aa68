"""Windows a fit has not seen, and the halves of a log."""

import json
from dataclasses import replace

import numpy as np
import pytest
from tests.model.twins import DEAD, GAIN, LAG, doublet, logged

from heatertune.codec import to_json
from heatertune.model.fit import fit
from heatertune.model.model_document import from_document, to_document
from heatertune.model.model_values import Half, Validation, disagreeing_parameters
from heatertune.model.power.fit_checks import check_fit, halves, held_out, judgement_remarks
from heatertune.model.power.open_loop import PowerProblem
from heatertune.model.power.regressors import Readings
from heatertune.model.statistics import Interval

NOISE = 0.1
TRUE = np.array([[np.log(LAG), DEAD, 0.0]])


def _problem(log):
    problem = PowerProblem(readings=Readings.of(log))
    return problem, problem.refine(TRUE)


def _log(**changes):
    time, power = doublet()
    return logged(time, power, noise=np.random.default_rng(3).normal(0.0, NOISE, len(time)), **changes)


def test_the_right_model_foretells_windows_it_has_not_seen_to_the_noise():
    found = held_out(*_problem(_log()))
    assert found.rmse_degC == pytest.approx(NOISE, rel=0.15)
    assert found.fit_pct > 98.5
    assert len(found.windows_s) == len(found.rmses_degC) == 5
    assert found.windows_s[0][0] == 252.0  # 375 readings every 4 s in six windows, the first never left out: 4·63
    assert found.windows_s[-1][1] == 1496.0


def test_a_window_is_not_seen_by_the_fit_that_foretells_it():
    log = _log()
    spoiled = log.temperature_degC.copy()
    window = (log.time_s >= 252.0) & (log.time_s < 504.0)
    spoiled[window] += 30.0
    other = replace(log, temperature_degC=spoiled)
    problem, fit = PowerProblem(readings=Readings.of(other)), _problem(log)[1]
    found = held_out(problem, fit)
    assert found.rmses_degC[0] == pytest.approx(30.0, abs=0.5)  # nothing of it is fitted away
    # over all windows: one in five is off by 30 °C, and spoils the fits of the other four
    assert found.rmse_degC > 30.0 / np.sqrt(5.0)
    assert found.fit_pct < 50.0


def test_the_halves_of_a_heater_that_stays_the_same_agree():
    first, second = halves(*_problem(_log()))
    assert first.window_s == (0.0, 748.0)
    assert second.window_s == (752.0, 1496.0)
    for half in (first, second):
        for name, truth in (("gain_degC_per_pct", GAIN), ("time_constant_s", LAG), ("dead_time_s", DEAD)):
            assert half.values[name] == pytest.approx(truth, rel=0.1)
            assert half.ci95[name].high > half.values[name]
    assert disagreeing_parameters((first, second)) == ()


def test_a_heater_that_changes_half_way_is_told_by_name():
    time, power = doublet()
    parts = [logged(time, power, gain=gain) for gain in (0.5, 0.6)]
    changed = np.where(time < 750.0, *(part.temperature_degC for part in parts))
    log = replace(parts[0], temperature_degC=changed + np.random.default_rng(3).normal(0.0, NOISE, len(time)))
    problem, fit = _problem(log)
    found = check_fit(problem, fit)
    assert "gain_degC_per_pct" in disagreeing_parameters(found.halves)
    told = next(n.sentence for n in judgement_remarks(log, found, 99.0, None) if n.finding == "halves-disagree")
    assert "process gain 0.5 and then 0.6 °C/%" in told


def _half(value, reach):
    return Half(window_s=(0.0, 1.0), values={"gain_degC_per_pct": value}, ambient_degC=None, fit_pct=90.0, rmse_degC=0.1,
                ci95={"gain_degC_per_pct": Interval(low=value - reach, high=value + reach)})


def test_two_values_differ_where_the_root_of_the_squared_reaches_is_passed():
    # 3-4-5: two intervals of ±3 and ±4 allow a difference of 5
    assert disagreeing_parameters((_half(10.0, 3.0), _half(14.9, 4.0))) == ()
    assert disagreeing_parameters((_half(10.0, 3.0), _half(15.1, 4.0))) == ("gain_degC_per_pct",)


def test_what_is_foretold_worse_than_fitted_is_told_with_the_worst_window():
    log = _log()
    problem, fit = _problem(log)
    found = check_fit(problem, fit)
    assert list(judgement_remarks(log, found, 99.0, None)) == []
    poor = replace(found, held_out=replace(found.held_out, fit_pct=60.0, rmses_degC=(0.1, 0.1, 2.0, 0.1, 0.1)))
    ((name, told),) = judgement_remarks(log, poor, 99.0, None)
    assert name == "not-foretold"
    start, end = found.held_out.windows_s[2]
    assert f"to 60 % only (fit: 99 %), worst from {start:.4g} to {end:.4g} s" in told


@pytest.mark.parametrize("bare", [False, True])
@pytest.mark.long
def test_the_checks_survive_their_document(bare):
    fitted = fit(_log())
    found = fitted.validation
    if bare:
        found = Validation(ljung_box=1.0, input_correlation=None, held_out=found.held_out, halves=None)
    document = json.loads(to_json(to_document(replace(fitted, validation=found))))
    assert set(document["input_crosscorrelation"] or ()) == (set() if bare else {"largest", "at_lag_s", "limit", "ok"})
    assert from_document(document).validation == found


@pytest.mark.long
def test_a_half_in_which_a_coarse_sensor_never_moves_is_none():
    time = np.arange(0.0, 800.0, 4.0)
    heated = logged(time, np.where((time > 40.0) & (time < 200.0), 20.0, 0.0), lag=60.0)
    coarse = replace(heated, temperature_degC=5.0 * np.round(heated.temperature_degC / 5.0))
    assert np.ptp(coarse.temperature_degC[100:]) == 0.0
    fitted = fit(coarse)
    assert fitted.validation.halves is None
    assert np.isfinite(fitted.validation.held_out.fit_pct)
    assert from_document(to_document(fitted)).model == fitted.model


def test_where_all_that_moved_lies_in_the_first_window_the_others_are_measured_by_that():
    time = np.arange(0.0, 1200.0, 4.0)
    heated = logged(time, np.where(time > 8.0, 50.0, 0.0), lag=20.0, dead=4.0)
    still = replace(heated, temperature_degC=np.round(heated.temperature_degC))
    assert np.ptp(still.temperature_degC[50:]) == 0.0
    fitted = fit(still)
    assert 95.0 < fitted.validation.held_out.fit_pct <= 100.0  # within half a degree of a rise of 25 °C
    assert from_document(to_document(fitted)).model == fitted.model
