import numpy as np
import pytest
from scipy.signal import lsim, lti
from tests.conftest import load_csv

from heatertune.errors import InputError
from heatertune.log.log_values import Log
from heatertune.model.fit import fit
from heatertune.model.model_values import FitOutcome, Fopdt, TwoLag
from heatertune.model.power.open_loop import PowerProblem
from heatertune.model.power.regressors import Readings


def _doublet(length=1500, sample=1.0):
    time = np.arange(0.0, length, sample)
    power = np.select([time < 60, time < 500, time < 900, time < 1200], [0.0, 60.0, 10.0, 80.0], 30.0)
    return time, power


def _logged(time, power, plant, *, dead, start, noise=0.0):
    """Made by SciPy on a grid fine enough that the dead time falls on it."""
    fine = np.arange(0.0, time[-1] + 1.0, 0.1)
    held = power[np.clip(np.searchsorted(time, fine - dead + 1e-9, side="right") - 1, 0, None)]
    rise = lsim(plant, held, fine, interp=False)[1]
    rise = np.interp(time, fine, rise)
    temperature = 20.0 + rise + (start - 20.0) * np.exp(-time / 150.0)
    temperature = temperature + np.random.default_rng(3).normal(0.0, noise, len(time))
    return Log(name="made", source="", time_s=time, temperature_degC=temperature, power_pct=power)


@pytest.mark.long
def test_the_dead_time_of_a_held_input_is_found_to_a_fraction_of_a_sample():
    # linear interpolation of the held power would shift it by half a sample, that is 0.5 s
    time, power = _doublet()
    log = _logged(time, power, lti([0.5], [150.0, 1.0]), dead=12.3, start=20.0)
    found = fit(log).model
    assert found.dead_time_s == pytest.approx(12.3, abs=0.06)  # the record's own grid is 0.1 s
    assert found.gain_degC_per_pct == pytest.approx(0.5, rel=2e-3)
    assert found.time_constant_s == pytest.approx(150.0, rel=5e-3)


@pytest.mark.long
def test_a_start_that_is_not_steady_does_not_spoil_the_gain():
    time, power = _doublet()
    log = _logged(time, power, lti([0.5], [150.0, 1.0]), dead=12.0, start=55.0)
    assert fit(log).model.gain_degC_per_pct == pytest.approx(0.5, rel=5e-3)


@pytest.mark.long
def test_the_intervals_hold_the_truth_and_widen_with_noise():
    time, power = _doublet(sample=4.0)
    quiet = fit(_logged(time, power, lti([0.5], [150.0, 1.0]), dead=12.0, start=20.0, noise=0.1))
    loud = fit(_logged(time, power, lti([0.5], [150.0, 1.0]), dead=12.0, start=20.0, noise=1.0))
    for name, truth in (("gain_degC_per_pct", 0.5), ("time_constant_s", 150.0)):
        assert loud.ci95[name].low < truth < loud.ci95[name].high
        width = [found.ci95[name].high - found.ci95[name].low for found in (quiet, loud)]
        assert 4.0 < width[1] / width[0] < 25.0  # ten times the noise
    assert loud.outcome is FitOutcome.IDENTIFIED


@pytest.mark.long
def test_an_interval_is_open_only_where_it_meets_a_bound():
    # a long, quiet record: every interval is narrow, far from the bounds, and closed
    time = np.arange(0.0, 40_000.0, 20.0)
    power = np.where((time // 3000) % 2 == 1, 60.0, 10.0)
    log = _logged(time, power, lti([0.5], [150.0, 1.0]), dead=30.0, start=20.0, noise=0.1)
    found = fit(log).ci95
    for name, truth in (("gain_degC_per_pct", 0.5), ("time_constant_s", 150.0), ("dead_time_s", 30.0)):
        assert found[name].low == pytest.approx(truth, rel=0.1)
        # the power may be two rows of 20 s late
        assert found[name].high == pytest.approx(truth + (40.0 if name == "dead_time_s" else 0.0), rel=0.1)


@pytest.mark.long
def test_two_lags_are_offered_where_the_heater_has_two():
    time, power = _doublet(sample=2.0)
    log = _logged(time, power, lti([0.5], [120.0 * 40.0, 160.0, 1.0]), dead=5.0, start=20.0, noise=0.05)
    fitted = fit(log)
    two = next(c.model for c in fitted.candidates if isinstance(c.model, TwoLag))
    assert two.lags_s == pytest.approx((120.0, 40.0), rel=0.05)
    assert any("Two lags" in note for note in fitted.notes)
    assert isinstance(fitted.model, Fopdt)


def test_constant_power_is_refused_with_what_would_help():
    time = np.arange(0.0, 500.0, 5.0)
    log = Log(
        name="flat", source="", time_s=time, temperature_degC=20.0 + 30.0 * (1 - np.exp(-time / 100.0)),
        power_pct=np.full(len(time), 50.0),
    )
    with pytest.raises(InputError, match="--ambient"):
        fit(log)
    # with the ambient known the final temperature gives the gain: 30 °C at 50 %
    assert fit(log, ambient_degC=20.0).model.gain_degC_per_pct == pytest.approx(0.6, rel=1e-3)


# reference fits printed beside the logs: gain °C/%, time constant s, dead time s, fit %
REFERENCE = {
    "apm_siso_doublet": (0.9206, 138.26, 14.16, 96.5277),
    "pds_tclab": (0.6981, 135.69, 15.76, 94.5888),
    "apm_mhe_lin_T1": (0.4967, 149.2, 14.68, 95.7202),
    "unal_profile_closed": (0.9702, 28.06, 0.142, 95.9595),
    "chamber_run13": (0.0188, 340.3, 32.13, 91.6541),
}


@pytest.mark.parametrize("name", REFERENCE)
def test_real_logs_are_fitted_as_well_as_by_their_reference(real_logs, name):
    log = load_csv(real_logs / "normalised" / f"{name}.csv", name)
    fitted = PowerProblem(readings=Readings.of(log)).fit()
    error = np.linalg.norm(log.temperature_degC - fitted.simulated_degC)
    reached = 100.0 * (1.0 - error / np.linalg.norm(log.temperature_degC - log.temperature_degC.mean()))
    assert reached > REFERENCE[name][3] - 0.1
    assert fitted.model.time_constant_s == pytest.approx(REFERENCE[name][1], rel=0.12)


def test_the_reaction_curve_meets_the_published_sum_of_squares(real_logs):
    # SSE 145.5, gain 1.998, time constant 349 samples of 0.1 s, dead time 47.7 samples
    log = load_csv(real_logs / "normalised" / "pypidtune_prc.csv", "prc")
    fitted = PowerProblem(readings=Readings.of(log)).fit()
    assert np.sum((fitted.simulated_degC - log.temperature_degC) ** 2) < 145.6
    assert fitted.model.gain_degC_per_pct == pytest.approx(1.998, rel=0.01)
    assert fitted.model.dead_time_s == pytest.approx(4.77, rel=0.02)
