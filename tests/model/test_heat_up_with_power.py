"""Heat-ups of two comparable lags with their power: one lag is refuted, so the values shown are those of two.

The logs are made by SciPy's lsim (`twins.logged`), which shares nothing with the fit's simulation.
"""

from dataclasses import replace

import numpy as np
import pytest
from tests.model.twins import AMBIENT, coloured, logged

import heatertune as ht
from heatertune.model.reduction import FIELDS

#: gain [°C/%], lags and dead time [s], share of the steady rise at which the power goes, lasting fall [share of the lags]
HEATERS = {
    "kiln": (7.2, (520.0, 260.0), 14.0, 0.42, 0.2),
    "oven": (5.1, (380.0, 90.0), 8.0, 0.5, 1.0),
    "nearly equal lags": (6.3, (700.0, 650.0), 6.0, 0.38, 0.5),
}


def heat_up(made, seed):
    gain, lags, dead, share, fall = HEATERS[made]
    time = np.arange(0.0, 60.0 + 3.0 * sum(lags), 4.0)
    on = np.where(time >= 60.0, 100.0, 0.0)
    reached = logged(time, on, gain=gain, lag=lags[0], second=lags[1], dead=dead).temperature_degC
    off_s = time[np.argmax(reached >= AMBIENT + share * 100.0 * gain)]
    time = time[time <= off_s + fall * sum(lags)]
    power = np.where((time >= 60.0) & (time < off_s), 100.0, 0.0)
    noise = np.random.default_rng(seed).normal(0.0, 0.1, len(time))  # slow noise would leave one lag, and what it leaves open
    return logged(time, power, gain=gain, lag=lags[0], second=lags[1], dead=dead, noise=noise)


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("made", HEATERS)
def test_what_is_shown_is_the_heater(made, seed):
    gain, lags, dead, *_ = HEATERS[made]
    fitted = ht.fit(heat_up(made, seed))
    assert fitted.outcome.name == "IDENTIFIED"
    assert not fitted.findings
    # the half rule (S. Skogestad, J. Process Control 13, 2003, eq. 10)
    late, slow = dead + 0.5 * lags[1], lags[0] + 0.5 * lags[1]
    shown = fitted.model
    assert shown.gain_degC_per_pct == pytest.approx(gain, rel=0.03)
    assert shown.time_constant_s == pytest.approx(slow, rel=0.08)
    assert shown.dead_time_s == pytest.approx(late, rel=0.15)
    inside = fitted.ci95["gain_degC_per_pct"]
    assert inside.low <= gain <= inside.high


def pulses(seed, *ends_s, noise):
    """A log of two lags whose power is on from 60 s and in each further pair of instants."""
    time = np.arange(0.0, ends_s[-1], 6.0)
    power = np.where(np.searchsorted([60.0, *ends_s[:-1]], time, side="right") % 2 == 1, 70.0, 0.0)
    return logged(time, power, gain=1.9, lag=600.0, second=150.0, dead=20.0, noise=noise(seed, len(time)))


def white(seed, count):
    return np.random.default_rng(seed).normal(0.0, 0.06, count)


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("ends_s", [(460.0, 2400.0), (360.0, 960.0, 1260.0, 2400.0), (960.0, 2400.0)],
                         ids=["a pulse", "two pulses", "up and down"])
def test_pulses_show_the_heater_too(ends_s, seed):
    """Here one lag alone puts the room too high: it is neither taken for the truth nor set to the first readings."""
    fitted = ht.fit(pulses(seed, *ends_s, noise=white))
    assert fitted.outcome.name == "IDENTIFIED"
    truths = {"gain_degC_per_pct": 1.9, "time_constant_s": 675.0, "dead_time_s": 95.0, "ambient_degC": AMBIENT}
    for name, truth in truths.items():
        inside = fitted.ci95[name]
        assert inside.low <= truth <= inside.high, name
    assert fitted.model.gain_degC_per_pct == pytest.approx(1.9, rel=0.02)
    assert not {each.name for each in fitted.findings} - {"one-level"}


def test_a_refuted_lag_shows_intervals_that_hold_two_lags_as_well():
    """Slow noise keeps two lags from one lag's place: their gain of 1.9 lay below one lag's interval."""
    fitted = ht.fit(pulses(4, 500.0, 501.0, noise=lambda seed, count: coloured(seed, count, 0.1)))
    assert fitted.outcome.name == "COMBINATIONS_ONLY"
    two = next(each.model for each in fitted.candidates if len(each.model.lags_s) == 2)
    for name, value in (("gain_degC_per_pct", two.gain_degC_per_pct), ("time_constant_s", two.half_rule().time_constant_s)):
        inside = fitted.ci95[name]
        assert inside.low <= value
        assert inside.high is None or value <= inside.high


def test_no_plausible_heater_is_one_that_the_log_refutes():
    gain, *_ = HEATERS["kiln"]
    fitted = ht.fit(heat_up("kiln", 3))
    gains = [each.model.gain_degC_per_pct for each in fitted.candidates]
    assert 0.8 * gain < min(gains) <= max(gains) < 1.25 * gain
    assert all(len(each.model.lags_s) == 2 for each in fitted.candidates)
    assert any("two lags as one by the half rule" in note for note in fitted.notes)
    assert fitted.model.time_constant_s == pytest.approx(FIELDS["time_constant_s"](fitted.candidates[0].model))


def test_one_lag_stays_where_it_identifies_the_heater():
    time = np.arange(0.0, 1500.0, 4.0)
    power = np.where((time >= 60.0) & (time < 900.0), 60.0, 0.0)
    fitted = ht.fit(logged(time, power, noise=coloured(4, len(time), 0.05)))
    assert fitted.outcome.name == "IDENTIFIED"
    assert not any("half rule" in note for note in fitted.notes)


def test_two_heat_ups_together_show_the_heater_too():
    gain, lags, dead, *_ = HEATERS["kiln"]
    logs = [replace(heat_up("kiln", seed), name=f"day {seed}") for seed in (5, 6)]
    fitted = ht.fit_together(logs)
    assert fitted.outcome.name == "IDENTIFIED"
    assert fitted.model.gain_degC_per_pct == pytest.approx(gain, rel=0.03)
    assert fitted.model.time_constant_s == pytest.approx(lags[0] + 0.5 * lags[1], rel=0.08)
    assert fitted.model.dead_time_s == pytest.approx(dead + 0.5 * lags[1], rel=0.1)
    inside = fitted.ci95["gain_degC_per_pct"]
    assert inside.low <= gain <= inside.high
    assert all(0.8 * gain < each.model.gain_degC_per_pct < 1.25 * gain for each in fitted.candidates)
    assert all(each.fit_pct > 99.0 for each in fitted.logs)
