"""Which findings a fit carries, on logs of known heaters (superposed exponentials, SciPy's lsim)."""

import numpy as np
import pytest
from tests.bench.identification import answer
from tests.model.twins import coloured, doublet, logged

from heatertune.log.log_values import Log
from heatertune.model.fit import fit, fit_together
from heatertune.model.model_values import FitOutcome, Fopdt


def _names(fitted):
    return {each.name for each in fitted.findings}


def _log(time, power, temperature, name="made"):
    return Log(name=name, source="", time_s=time, power_pct=power, temperature_degC=temperature)


def test_a_clean_log_has_no_finding():
    time, power = doublet()
    assert fit(logged(time, power, noise=coloured(1, len(time), 0.05))).findings == ()


@pytest.mark.long
def test_a_poor_fit_is_a_finding_with_its_size():
    time, power = doublet()
    fitted = fit(logged(time, power, noise=np.random.default_rng(2).normal(0.0, 12.0, len(time))))
    assert fitted.outcome is FitOutcome.POOR_FIT
    told = next(each.message for each in fitted.findings if each.name == "poor-fit")
    assert told.startswith(f"{fitted.fit_pct:.0f} % of twin")


@pytest.mark.long
@pytest.mark.parametrize(("lag", "is_fast"), [(0.8, True), (20.0, False)])
def test_a_heater_faster_than_its_log_is_a_finding(lag, is_fast):
    time, power = doublet()  # a reading every 4 s
    plant = Fopdt(gain_degC_per_pct=0.5, time_constant_s=lag, dead_time_s=1.0, ambient_degC=20.0)
    noise = np.random.default_rng(1).normal(0.0, 0.1, len(time))
    fitted = fit(_log(time, power, answer(plant, time, power, 20.0) + noise))
    assert ("faster-than-log" in _names(fitted)) is is_fast
    assert is_fast == any("responds faster than the log shows" in note for note in fitted.notes)


@pytest.mark.long
def test_every_finding_of_the_checks_is_told_in_the_notes_word_for_word():
    # half way through, the heater's gain rises by half: a fan that stops
    time, power = doublet(3000.0)
    power = power[np.arange(len(time)) % 375]
    made = logged(time, power, noise=coloured(1, len(time), 0.05))
    temperature = np.where(time < 1500.0, made.temperature_degC, 1.5 * made.temperature_degC - 10.0)
    fitted = fit(_log(time, power, temperature))
    assert "halves-disagree" in _names(fitted)
    assert all(each.message in fitted.notes for each in fitted.findings if each.name != "poor-fit")


@pytest.mark.long
def test_a_second_lag_that_two_lags_explain_is_no_finding():
    time, power = doublet()
    fitted = fit(logged(time, power, second=30.0, noise=coloured(1, len(time), 0.05)))
    assert any("two lags leave nothing of that" in note for note in fitted.notes)
    assert "follows-power" not in _names(fitted)


@pytest.mark.long
def test_logs_of_two_heaters_disagree_and_of_one_do_not():
    time, power = doublet()
    logs = [logged(time, power, gain=gain, noise=coloured(seed, len(time), 0.05), name=f"log {gain}")
            for seed, gain in ((1, 0.5), (2, 0.6))]
    assert "logs-disagree" in _names(fit_together(logs))
    same = [logged(time, power, noise=coloured(seed, len(time), 0.05), name=f"log {seed}") for seed in (1, 2)]
    assert "logs-disagree" not in _names(fit_together(same))
