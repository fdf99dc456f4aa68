"""Intervals widened where the halves of a log differ: truths are Euler's sums and SciPy's lsim, worked out here."""

import numpy as np
import pytest
from tests.bench import halves as bench
from tests.model.twins import doublet, logged

from heatertune.log.log_values import Log
from heatertune.model.fit import fit
from heatertune.model.power.fit_checks import widening_notes
from heatertune.model.power.fit_power import interval_widening
from heatertune.model.power.open_loop import PowerProblem
from heatertune.model.power.regressors import Readings
from heatertune.model.statistics import RATIO

GAINS = (0.4, 0.6)


def _white(n, deviation=0.1, seed=1):
    return np.random.default_rng(seed).normal(0.0, deviation, n)


def _restless(gains=GAINS):
    """T' = (20 + gain·u(t − 10) − T)/100 in steps of 0.1 s, read every 4 s; the second gain holds from the middle on."""
    time = np.arange(0.0, 3200.0, 4.0)
    levels = np.random.default_rng(4).choice([0.0, 30.0, 60.0], 33)
    power = levels[(time / 100.0).astype(int)]
    y, readings = 20.0 + gains[0] * power[0], []
    for k in range(int(time[-1] * 10) + 1):
        if k % 40 == 0:
            readings.append(y)
        acting = power[max(k - 100, 0) // 40]
        y += 0.1 * (20.0 + gains[k > 16000] * acting - y) / 100.0
    return Log(name="restless", source="Euler", time_s=time, temperature_degC=np.array(readings) + _white(len(time)),
               power_pct=power)


def _factors(log):
    problem = PowerProblem(readings=Readings.of(log))
    return interval_widening(problem, problem.fit())


@pytest.mark.long
def test_a_gain_that_changes_in_the_middle_widens_the_interval_until_it_holds_both_and_is_told():
    found = fit(_restless())
    gain = found.ci95["gain_degC_per_pct"]
    assert 0.5 * GAINS[0] < gain.low < GAINS[0], "each half's gain, and no more than twice as far"
    assert GAINS[1] < gain.high < 1.5 * GAINS[1]
    told = next(note for note in found.notes if note.startswith("Intervals were widened"))
    assert "gain" in told
    assert "the halves of the log differ more than their noise explains" in told


@pytest.mark.long
def test_one_heater_is_hardly_widened():
    # the deviations of two halves from their whole are one number with one degree of freedom: 1 in 3 logs exceeds 1
    time, power = doublet(3000.0)
    power = np.where(time < 1500.0, power, np.interp(time - 1500.0, time, power))
    factors = [_factors(logged(time, power, noise=_white(len(time), seed=seed))) for seed in range(12)]
    for name in ("gain_degC_per_pct", "time_constant_s", "dead_time_s", RATIO):
        assert np.median([each[name] for each in factors]) < 1.2
        assert np.max([each[name] for each in factors]) < 3.5
    assert widening_notes({"gain_degC_per_pct": 1.0, RATIO: 5.0}) == ()


def test_a_half_in_which_the_power_never_changes_is_no_surprise():
    time = np.arange(0.0, 3000.0, 5.0)
    power = np.select([time < 60.0, time < 700.0], [0.0, 60.0], 20.0)
    factors = _factors(logged(time, power, noise=_white(len(time))))
    assert max(factors.values()) < 2.0


@pytest.mark.long
@pytest.mark.parametrize("name", [
    "unal_prbs_open", "apm_siso_doublet", "chamber_relay_autotune2", "pds_tclab", "unal_profile_closed"])
def test_the_halves_of_a_real_log_lie_in_its_intervals(real_logs, name):
    # the share over all logs is the benchmark's; in the last two the residual follows the power
    found = bench.compared(str(real_logs / "normalised" / f"{name}.csv"))
    assert all(all(bench.inside_of(found, half)) for half in found.halves)


@pytest.mark.long
def test_the_table_of_halves_is_made(real_logs, capsys, tmp_path):
    (tmp_path / "a.csv").symlink_to(real_logs / "normalised" / "unal_prbs_open.csv")
    bench.main([str(tmp_path)])
    printed = capsys.readouterr().out
    assert "| a | IDENTIFIED" in printed
    assert "all halves: 2, inside the whole log's intervals for k, T, L: 100, 100, 100 %" in printed


def _step(left_out=()):
    """Return one step of 900 rows, by the closed solution, without some rows."""
    time = np.arange(900.0)
    power = np.where(time >= 60.0, 50.0, 0.0)
    degC = 20.0 + 30.0 * np.where(time > 72.0, 1.0 - np.exp(-np.maximum(time - 72.0, 0.0) / 180.0), 0.0)
    kept = np.delete(np.arange(900), left_out)
    return Log(name="step", source="closed", time_s=time[kept], temperature_degC=(degC + _white(900, 0.02, seed=5))[kept],
               power_pct=power[kept])


@pytest.mark.parametrize("seed", [pytest.param(seed, marks=[pytest.mark.long] * (seed > 3)) for seed in range(16)])
def test_four_rows_left_out_of_900_change_no_interval(seed):
    # before, in 2 of 16 such logs the gain's interval reached from 0.598 to 3.29, in several it was six times narrower
    whole = fit(_step()).ci95
    some = fit(_step(np.random.default_rng(seed).choice(np.arange(1, 899), 4, replace=False))).ci95
    for name in ("gain_degC_per_pct", "time_constant_s"):
        widths = [each[name].high - each[name].low for each in (whole, some)]
        assert 0.75 < widths[1] / widths[0] < 1.33, name
    assert 0.5997 < some["gain_degC_per_pct"].low < 0.6 < some["gain_degC_per_pct"].high < 0.6003
